"""The versions of what results are made with."""

import importlib.metadata
import platform

import calfsocket

PACKAGES = ("fenics-ufl", "fenics-basix", "numpy", "scipy", "pyvista")


def versions() -> dict[str, str]:
    """Version of each package by its name; "unknown" where the package has none."""
    # Reports read records that have versions: they need none of these, and take a second less.
    import dolfinx
    from mpi4py import MPI
    from petsc4py import PETSc

    from calfsocket.io.system import gmsh

    found = {"calfsocket": calfsocket.__version__, "python": platform.python_version()}
    found["fenics-dolfinx"] = dolfinx.__version__  # its distribution has several names
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "unknown"
    found["gmsh"] = gmsh.__version__
    found["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    mpi = MPI.Get_library_version().strip("\0\n ").splitlines()[0].split(",")[0]
    found["mpi"] = " ".join(mpi.split())
    return found
