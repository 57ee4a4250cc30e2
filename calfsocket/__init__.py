"""calfsocket answers what a prosthetic socket does inside a leg.

A FEniCSx application: a transverse section of a calf with 27 regions of 6 tissues, pressed by
deformable prosthetic sockets through large-sliding frictional Nitsche contact.

>>> import calfsocket as cs
>>> limb, socket = cs.Limb.reference(), cs.Socket.reference("HS")
>>> materials = cs.MaterialSet.paper("separate")
>>> result = cs.Simulation(limb, socket, materials, mesh_size="coarse").solve()  # doctest: +SKIP
"""

import os
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calfsocket.contact.parameters import Contact as Contact
    from calfsocket.imaging.layer_thickness import LayerThickness as LayerThickness
    from calfsocket.imaging.levels import LimbLevels as LimbLevels
    from calfsocket.imaging.limb import Limb as Limb
    from calfsocket.imaging.socket_scan import Socket as Socket
    from calfsocket.io.errors import CalfsocketError as CalfsocketError
    from calfsocket.io.errors import ConvergenceError as ConvergenceError
    from calfsocket.io.errors import InputError as InputError
    from calfsocket.materials.file import read_material as read_material
    from calfsocket.materials.file import write_material as write_material
    from calfsocket.materials.hencky import Hencky as Hencky
    from calfsocket.materials.law import Law as Law
    from calfsocket.materials.laws import material_law as material_law
    from calfsocket.materials.liner import Liner as Liner
    from calfsocket.materials.material_set import MaterialSet as MaterialSet
    from calfsocket.materials.ogden import Ogden as Ogden
    from calfsocket.materials.yeoh import Yeoh as Yeoh
    from calfsocket.mechanics.loading import Loading as Loading
    from calfsocket.mechanics.loading import Stage as Stage
    from calfsocket.mechanics.stepping import LoadSteps as LoadSteps
    from calfsocket.meshes.socket import CircleBlend as CircleBlend
    from calfsocket.meshes.socket import NormalOffset as NormalOffset
    from calfsocket.meshes.socket import Outline as Outline
    from calfsocket.meshes.socket import Sections as Sections
    from calfsocket.simulation.result import Result as Result
    from calfsocket.simulation.results import Results as Results
    from calfsocket.simulation.results import load_results as load_results
    from calfsocket.simulation.simulation import Simulation as Simulation
    from calfsocket.study.study import Study as Study

__version__ = "0.2.0"

# `calfsocket.meshes` and `calfsocket.forms` lie at the top of the repository. An installed package
# has them as ordinary subpackages; in a bare checkout, the repository joins the search path.
_repository = Path(__file__).resolve().parent.parent
if (_repository / "pyproject.toml").is_file() and (_repository / "meshes" / "tags.py").is_file():
    __path__.append(str(_repository))

if find_spec("dolfinx_solver"):
    # Installed by pip. What ./in-debian13 sets: MPI's ranks use the cores, threads only compete.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # This wheel wants to be imported before the dolfinx and petsc4py in it: it loads their MPI.
    import dolfinx_solver  # noqa: F401

_MODULES = {
    "Contact": "contact.parameters",
    "CalfsocketError": "io.errors",
    "ConvergenceError": "io.errors",
    "InputError": "io.errors",
    "read_material": "materials.file",
    "write_material": "materials.file",
    "Hencky": "materials.hencky",
    "Law": "materials.law",
    "material_law": "materials.laws",
    "Liner": "materials.liner",
    "MaterialSet": "materials.material_set",
    "Ogden": "materials.ogden",
    "Yeoh": "materials.yeoh",
    "Loading": "mechanics.loading",
    "Stage": "mechanics.loading",
    "LoadSteps": "mechanics.stepping",
    "LayerThickness": "imaging.layer_thickness",
    "Limb": "imaging.limb",
    "LimbLevels": "imaging.levels",
    "CircleBlend": "meshes.socket",
    "NormalOffset": "meshes.socket",
    "Outline": "meshes.socket",
    "Sections": "meshes.socket",
    "Socket": "imaging.socket_scan",
    "Result": "simulation.result",
    "Results": "simulation.results",
    "load_results": "simulation.results",
    "Simulation": "simulation.simulation",
    "Study": "study.study",
}
"""Where each public name is defined. They are imported when first used: importing the package alone
loads neither dolfinx nor, in Debian, MPI."""

__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module 'calfsocket' has no attribute '{name}'")
    value = getattr(import_module(f"calfsocket.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return sorted([*globals(), *_MODULES])
