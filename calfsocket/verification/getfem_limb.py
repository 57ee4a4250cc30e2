"""A limb in a socket in GetFEM: the second code of `peer`, which shares nothing with the program.

    python3 getfem_limb.py PROBLEM.npz RESULT.npz

It is run in a process of its own: GetFEM has another build of MUMPS than PETSc.

Laws are energies in GetFEM's language of weak forms, from which GetFEM derives residual, tangent
and stresses. Displacements are quadratic, on the curved triangles of the problem's mesh; where a
law is incompressible a linear pressure is added in each region (element "P2"), or, as the program
has it, a cubic bubble and a discontinuous linear pressure everywhere ("P2 + bubble"). Contact is an
augmented Lagrangian with a linear traction along the skin, whose points meet the socket along their
own normal (ray tracing), and with Coulomb's friction that sticks rigidly (Poulios and Renard 2015,
doi:10.1016/j.compstruc.2015.02.027).

Lengths are mm, stresses MPa.
"""

import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import getfem as gf
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

LAWS = {
    # Squares of the in-plane stretches: roots of s^2 - (F:F) s + det(F)^2. The small number keeps
    # the derivative finite where both are equal; the energies are even in the difference, so that
    # it changes their stress by 1e-8 of the modulus times the strain, at most.
    "Apart(F)": "sqrt(sqr(Norm_sqr(F))-4*sqr(Det(F))+1e-8)",
    "Larger(F)": "(0.5*(Norm_sqr(F)+Apart(F)))",
    "Smaller(F)": "(0.5*(Norm_sqr(F)-Apart(F)))",
    "Ogden(F,l,f,a)": "f*pow(Det(F)*l,-(a)/3)"
    "*(pow(Larger(F),(a)/2)+pow(Smaller(F),(a)/2)+pow(l,a))",
    "Strain(F,l)": "(pow(Det(F)*l,-2/3)*(Norm_sqr(F)+sqr(l))-3)",
    "Yeoh(F,l,a,b,c)": "(a*Strain(F,l)+b*sqr(Strain(F,l))+c*pow(Strain(F,l),3))",
    # mu (e:e - (tr e)^2/3) of the logarithmic strains e.
    "Hencky(F,l,m)": "m*(sqr(0.5*log(Larger(F)))+sqr(0.5*log(Smaller(F)))+sqr(log(l))"
    "-sqr(log(Det(F)*l))/3)",
    # U = K/2 (J - 1)^2.
    "Volume(F,l,K)": "(K)/2*sqr(Det(F)*l-1)",
}
"""Isochoric energies, and the volumetric one, of an in-plane F and the stretch l out of plane."""

FURTHER = (
    "((Id(2)+exx*[[1,0],[0,0]]+eyy*[[0,0],[0,1]]+exy/2*[[0,1],[1,0]])*(Id(2)+Grad_u))",
    "(1+ezz)",
)
"""F and l of a deformed limb that is strained a little further: stress is the energy's derivative
by that strain, J s = dW/de."""

COMPONENTS = ("exx", "eyy", "ezz", "exy")
"""In the order of stresses: s11, s22, s33, s12."""

GUIDE = 1e-5
"""Elastic foundation of the socket at load 0, N/mm^3, before friction holds it; none at load 1."""

AUGMENTATION = 1.0
"""Of the augmented Lagrangian, MPa/mm; the solution does not depend on it."""

REACH = 6.0
"""Largest distance along a ray at which skin and socket may meet, mm."""

TOLERANCE = 1e-7
"""Largest residual of Newton's method, N/mm: rounding in bone and socket is below it, and the
pressing force a million times above."""

ITERATIONS = 40
"""Of Newton's method in a load step: active sets settle within half of them, or not at all."""

SMALLEST_STEP = 1 / 320
"""Load step below which a failure ends the run: far below a step that fascia needs to wave."""


def bulk_modulus(law: Mapping[str, Any]) -> float:
    """K in MPa; infinite where incompressible."""
    if law["law"] == "ogden":
        return 2 / law["d1"] if law["d1"] else math.inf
    if law["law"] == "hencky" and law["nu"] < 0.5:
        return float(law["e"] / (3 * (1 - 2 * law["nu"])))
    return math.inf


def isochoric(law: Mapping[str, Any], F: str, out: str) -> str:
    """Isochoric energy of a law in GetFEM's language, MPa; `out` is the stretch out of plane."""
    match law["law"]:
        case "ogden":
            abaqus = law["form"] == "abaqus"
            terms = [
                (2 * mu / a**2 if abaqus else mu / a, a)
                for mu, a in zip(law["mu"], law["alpha"], strict=True)
            ]
            return "+".join(f"Ogden({F},{out},{factor!r},{a!r})" for factor, a in terms)
        case "yeoh":
            return f"Yeoh({F},{out},{law['c10']!r},{law['c20']!r},{law['c30']!r})"
        case "hencky":
            return f"Hencky({F},{out},{law['e'] / (2 * (1 + law['nu']))!r})"
    raise ValueError(f"no law {law['law']}")


def energy(law: Mapping[str, Any], F: str, out: str = "1", pressure: str = "") -> str:
    """Energy of a law; with the name of a pressure, its potential with p as an unknown."""
    bulk = bulk_modulus(law)
    density = isochoric(law, F, out)
    if pressure:
        density += f"+{pressure}*(Det({F})*{out}-1)"
        return density if math.isinf(bulk) else f"{density}-sqr({pressure})/{2 * bulk!r}"
    return density if math.isinf(bulk) else f"{density}+Volume({F},{out},{bulk!r})"


def model() -> Any:
    """Make an empty model that knows the laws."""
    made = gf.Model("real")
    for name, text in LAWS.items():
        made.add_macro(name, text)
    return made


def curved_mesh(points: Array, cells: Array) -> Any:
    """Make a mesh of six-node triangles: corners, then the nodes on 0-1, 1-2 and 2-0."""
    mesh = gf.Mesh("empty", 2)
    # GetFEM numbers the nodes row by row.
    mesh.add_convex(gf.GeoTrans("GT_PK(2,2)"), points[cells[:, [0, 3, 1, 5, 4, 2]]].T)
    return mesh


def stress(md: Any, law: Mapping[str, Any], points: Any, region: int, pressure: str = "") -> Array:
    """Cauchy stress s11, s22, s33, s12 at the points of a region, MPa; (n, 4)."""
    density = energy(law, *FURTHER, pressure)
    return np.stack(
        [
            md.interpolation(f"Diff({density},{e},1)/Det(Id(2)+Grad_u)", points, region)
            for e in COMPONENTS
        ],
        axis=1,
    )


def add_further_strain(md: Any) -> None:
    """Add the components of the strain by which stresses are derivatives; they are zero."""
    for name in COMPONENTS:
        md.add_variable(name, 1)
        md.disable_variable(name)


def homogeneous_stresses(laws: Sequence[Mapping[str, Any]], gradients: Array) -> Array:
    """Cauchy stress of laws at in-plane deformation gradients (m, 2, 2), MPa; (laws, m, 4).

    Of an incompressible law at a pressure of zero.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    mesh = curved_mesh(
        np.vstack([corners, 0.5 * (corners + np.roll(corners, -1, axis=0))]), np.arange(6)[None]
    )
    space = gf.MeshFem(mesh, 2)
    space.set_classical_fem(2)
    whole = 1
    mesh.set_region(whole, np.array([[0], [-1]]))
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(1)"))  # to be kept: its data do not
    middle = gf.MeshImData(rule, whole)
    md = model()
    md.add_fem_variable("u", space)
    add_further_strain(md)
    at = space.basic_dof_nodes()[:, ::2]
    result = np.empty((len(laws), len(gradients), 4))
    for j, gradient in enumerate(gradients):
        md.set_variable("u", ((gradient - np.eye(2)) @ at).T.ravel())
        for i, law in enumerate(laws):
            result[i, j] = stress(md, law, middle, whole)[0]
    return result


class Limb:
    """A limb and its socket, whose gaps are closed in proportion to the load.

    Parameters
    ----------
    arrays : mapping of str to array
        ``points``, ``cells``, ``cell_tags``, ``facets``, ``facet_tags`` of the mesh.
    about : mapping
        ``regions`` and ``boundaries`` (tags by name), ``laws`` by region, ``friction``,
        ``element``.
    """

    def __init__(self, arrays: Mapping[str, Array], about: Mapping[str, Any]) -> None:
        self._arrays, self._about = arrays, about
        self.laws = about["laws"]
        of_socket = arrays["cell_tags"] == about["regions"]["socket"]
        self.md = md = model()
        self.limb, self._u = self._body("u", ~of_socket)
        self.socket, self._v = self._body("v", of_socket)
        self._pressures: dict[str, str] = {}
        for name in about["regions"]:
            self._add_region(name)
        fixed = self._boundary(self.limb, "tibia_medullary")
        md.add_Dirichlet_condition_with_multipliers(self._points(self.limb, 4), "u", 2, fixed)
        md.add_initialized_data("guide", [GUIDE])
        md.add_nonlinear_term(self._points(self.socket, 4), "guide/2*Norm_sqr(v)")
        self._add_contact()
        add_further_strain(md)

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return int(self.md.nbdof())

    # -- model ----------------------------------------------------------------------------------

    def _body(self, name: str, of_body: Array) -> tuple[Any, Any]:
        """Mesh a body, tag its regions, and give it a displacement."""
        mesh = curved_mesh(self._arrays["points"], self._arrays["cells"][of_body])
        region = self._arrays["cell_tags"][of_body]
        for tag in np.unique(region):
            cells = np.flatnonzero(region == tag)
            mesh.set_region(int(tag), np.stack([cells, np.full_like(cells, -1)]))
        space = gf.MeshFem(mesh, 2)
        bubble = self._about["element"] == "P2 + bubble"
        space.set_fem(gf.Fem("FEM_PK_WITH_CUBIC_BUBBLE(2,2)" if bubble else "FEM_PK(2,2)"))
        self.md.add_fem_variable(name, space)
        self.md.add_fem_data(f"{name}_before", space)
        return mesh, space

    def _boundary(self, mesh: Any, name: str) -> int:
        """Tag the edges of a boundary in the mesh of a body; return the tag."""
        tag = int(self._about["boundaries"][name])
        facets = self._arrays["facets"][self._arrays["facet_tags"] == tag]
        nodes = mesh.pid_from_coords(self._arrays["points"][np.unique(facets)].T)
        mesh.set_region(tag, mesh.faces_from_pid(nodes))
        return tag

    @staticmethod
    def _points(mesh: Any, degree: int) -> Any:
        """Gauss points in the triangles and, with the same degree, on their edges."""
        return gf.MeshIm(mesh, gf.Integ(f"IM_TRIANGLE({degree})"))

    def _add_region(self, name: str) -> None:
        """Add the energy of a region."""
        tag, law = int(self._about["regions"][name]), self.laws[name]
        mesh, u = (self.socket, "v") if name == "socket" else (self.limb, "u")
        bubble = self._about["element"] == "P2 + bubble"
        pressure = ""
        if bubble or math.isinf(bulk_modulus(law)):
            pressure = self._pressures[name] = f"p{tag}"
            space = gf.MeshFem(mesh, 1)
            fem = "FEM_PK_DISCONTINUOUS(2,1)" if bubble else "FEM_PK(2,1)"
            space.set_fem(gf.Fem(fem), mesh.region(tag)[0])
            self.md.add_fem_variable(pressure, space)
        density = energy(law, f"(Id(2)+Grad_{u})", pressure=pressure)
        degree = 6 if bubble else 4
        self.md.add_nonlinear_term(self._points(mesh, degree), density, tag)

    def _add_contact(self) -> None:
        """Add contact and friction of the skin with the socket's inner face."""
        md = self.md
        self._skin = skin = self._boundary(self.limb, "skin_surface")
        face = self._boundary(self.socket, "socket_inner")
        self._skin_points = self._points(self.limb, 7)  # four on each edge
        md.add_raytracing_transformation("face", REACH)
        md.add_master_contact_boundary_to_raytracing_transformation("face", self.socket, "v", face)
        md.add_slave_contact_boundary_to_raytracing_transformation("face", self.limb, "u", skin)
        traction = gf.MeshFem(self.limb, 2)
        traction.set_classical_fem(1)
        md.add_filtered_fem_variable("traction", traction, skin)
        md.add_initialized_data("r", [AUGMENTATION])
        md.add_initialized_data("friction", [self._about["friction"]])
        md.add_initialized_data("ahead", [1.0])
        md.add_im_data("overclosure", gf.MeshImData(self._skin_points, skin))
        md.set_variable("overclosure", self._overclosure())
        md.add_macro("Outward", "Transformed_unit_vector(Grad_u, Normal)")
        md.add_macro("Moved", "(Interpolate(v,face)-u)")
        md.add_macro("Gap", "((Interpolate(X,face)-X+Moved).Outward-ahead*overclosure)")
        md.add_macro("Slip", "(u-u_before-Interpolate(v,face)+Interpolate(v_before,face))")
        # Where no ray meets the socket the skin is free: its traction is zero.
        for term in (
            "-traction.Test_u",
            "Interpolate_filter(face, traction.Interpolate(Test_v,face), 1)",
            "-(1/r)*traction.Test_traction",
            "Interpolate_filter(face, (1/r)*Coulomb_friction_coupled_projection("
            "traction, Outward, Slip, Gap, friction, r).Test_traction, 1)",
        ):
            md.add_nonlinear_term(self._skin_points, term, skin)

    def _overclosure(self) -> Array:
        """Gap of the undeformed bodies where it is negative, mm, and 0 elsewhere."""
        gap = "Interpolate_filter(face, (Interpolate(X,face)-X).Normal, 1)"
        return np.minimum(self._at_skin(gap), 0.0)

    # -- solution -------------------------------------------------------------------------------

    def solve(self, loads: Sequence[float]) -> list[tuple[float, int]]:
        """Go through loads, the last of them 1; return those reached and Newton's iterations.

        A step that fails is halved.

        Raises
        ------
        RuntimeError
            Where a step becomes too small.
        """
        steps: list[tuple[float, int]] = []
        load, ahead = 0.0, list(loads)
        while ahead:
            before = self.md.from_variables()
            iterations, converged = self._take(ahead[0])
            print(
                f"load {ahead[0]:.4f}: {iterations} iterations, converged: {converged}", flush=True
            )
            if converged:
                load = ahead.pop(0)
                steps.append((load, iterations))
                for name in ("u", "v"):
                    self.md.set_variable(f"{name}_before", self.md.variable(name))
                continue
            self.md.to_variables(before)
            if ahead[0] - load < SMALLEST_STEP:
                raise RuntimeError(f"no equilibrium after load {load:g}")
            ahead.insert(0, 0.5 * (load + ahead[0]))
        return steps

    def _take(self, load: float) -> tuple[int, bool]:
        """Solve at a load; return iterations and whether they converged."""
        self.md.set_variable("ahead", [1.0 - load])
        self.md.set_variable("guide", [GUIDE * (1.0 - load)])
        try:
            iterations, converged = self.md.solve(
                "max_iter", ITERATIONS, "max_res", TOLERANCE, "lsearch", "simplest",
                "lsolver", "mumps",
            )  # fmt: skip
        except RuntimeError:  # an inverted element, whose energy is not a number
            return ITERATIONS, False
        return int(iterations), bool(converged)

    # -- results --------------------------------------------------------------------------------

    def _at_skin(self, expression: str, size: int = 1) -> Array:
        """Values at the skin's Gauss points; (n,) or (n, size)."""
        points = gf.MeshImData(self._skin_points, self._skin, size)
        values = self.md.interpolation(expression, points, self._skin)
        return np.asarray(values if size == 1 else values.reshape(-1, size))

    def results(self) -> dict[str, Any]:
        """Traction along the skin, stress in it, and displacement, with their undeformed places."""
        tag = int(self._about["regions"]["skin"])
        inside = self._points(self.limb, 2)  # three in each triangle

        def points(size: int) -> Any:
            return gf.MeshImData(inside, tag, size)

        # dofs of the bubbles included
        return {
            "skin_points": self._at_skin("X", 2),
            "normal": self._at_skin("Outward", 2),
            "traction": self._at_skin("traction", 2),
            "stress_points": self.md.interpolation("X", points(2), tag).reshape(-1, 2),
            "stress": stress(
                self.md, self.laws["skin"], points(1), tag, self._pressures.get("skin", "")
            ),
            "nodes": self._u.basic_dof_nodes()[:, ::2].T,
            "displacement": self.md.variable("u").reshape(-1, 2),
        }


def main(problem: str, result: str) -> None:
    """Solve a problem of a file, write its result to another."""
    gf.util("trace level", 0)
    gf.util("warning level", 0)
    with np.load(problem) as file:
        arrays = dict(file)
    about = json.loads(str(arrays.pop("about")))
    if "gradients" in arrays:
        np.savez(result, stress=homogeneous_stresses(about["laws"], arrays["gradients"]))
        return
    limb = Limb(arrays, about)
    steps = np.array(limb.solve(about["loads"]))
    np.savez(result, steps=steps, unknowns=limb.unknowns, **limb.results())


if __name__ == "__main__":
    main(*sys.argv[1:])
