"""A second code: a limb in a socket in GetFEM, on the program's mesh, compared point by point.

Mesh, parameters of the laws and load steps are handed over; the rest is GetFEM's, in the script
`getfem_limb`, which runs in a process of its own.
"""

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mpi4py import MPI
from scipy.spatial import cKDTree

from calfsocket.io.errors import SolveError
from calfsocket.materials.law import Law
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.distributed import distribute
from calfsocket.meshes.section import build
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.triangles import TriangleMesh
from calfsocket.postprocess.contact_line import ContactLine, running_mean
from calfsocket.postprocess.extract import KILOPASCAL
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import effective_stress
from calfsocket.verification.limb_friction import ALONG
from calfsocket.verification.limb_runs import one_case
from calfsocket.verification.report import Check, Draw, Section, curves
from calfsocket.verification.sampling import FloatArray, deviation, triangle_shapes

SCRIPT = Path(__file__).with_name("getfem_limb.py")

INSTALL = (
    "GetFEM is not installed; install it with `apt-get install python3-getfem` (Debian 13; it is "
    "not on PyPI)"
)

#: Sockets, in the Separate set.
SOCKETS = ("TSB", "HS")

#: Elements of `getfem_limb`: the one that is judged, and the program's.
P2, BUBBLE = "P2", "P2 + bubble"

#: How GetFEM solves a case: as it is judged, and to see what the differences come from.
OWN, HALVED, SAME = "GetFEM", "GetFEM, half steps", "GetFEM, the program's element"

VARIANTS: dict[str, dict[str, Any]] = {
    OWN: {},
    HALVED: {"halved": True},
    SAME: {"element": BUBBLE},
}
"""Arguments of `Solved.by_getfem`."""

BARS = {
    OWN: {
        "mean pressure": 0.5,
        "shear over pressure": 1.0,
        "pressure, rms": 2.0,
        "skin Mises, rms": 3.0,
    },
    SAME: {"mean pressure": 0.05, "pressure, 3 mm means, rms": 0.5},
}
"""Largest `differences` from the program, %. With one element, contact alone differs."""

LAW_BAR = 1e-7
"""Of the laws' stresses: GetFEM's have a small number where stretches are equal."""

SAME_PLACE = 1e-8
"""Distance in mm up to which the codes' points are one: rounding of coordinates of 100 mm."""

GRADIENTS = np.array(
    [
        [[1.0, 0.0], [0.0, 1.0]],
        [[1.02, 0.0], [0.0, 0.97]],
        [[1.0, 0.4], [0.0, 1.0]],
        [[1.3, 0.2], [-0.1, 0.8]],
        [[0.1, -1.4], [0.7, 0.05]],
    ]
)
"""In-plane deformation gradients at which laws are compared: none, small, large and turned."""


def missing() -> str:
    """Say how GetFEM is installed where it is not; nothing where it is."""
    return "" if find_spec("getfem") else INSTALL


def run_getfem(about: Mapping[str, Any], **arrays: Any) -> dict[str, Any]:
    """Run `getfem_limb` on a problem; return the arrays that it writes, and its CPU seconds.

    Raises
    ------
    SolveError
        If it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        problem, result = Path(folder) / "problem.npz", Path(folder) / "result.npz"
        np.savez(problem, about=json.dumps(about), **arrays)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        # Without -P modules of this folder would be found before others of their names.
        run = subprocess.run(
            [sys.executable, "-P", SCRIPT, problem, result], capture_output=True, text=True
        )
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        if run.returncode:
            said = run.stderr.strip().splitlines() or [f"it ended with {run.returncode}"]
            raise SolveError(f"GetFEM: {said[-1]}")
        with np.load(result) as file:
            return {**file, "seconds": seconds}


def parameters(law: Law) -> dict[str, Any]:
    """Return a law as `getfem_limb` takes it."""
    return law.model_dump(mode="json", exclude={"given"})


def law_errors(laws: Sequence[Law], gradients: FloatArray = GRADIENTS) -> FloatArray:
    """Compare GetFEM's stresses with the closed forms; by law, over its largest stress component.

    Both are Cauchy stresses, with the pressure that belongs to the change of volume; without where
    a law is incompressible.
    """
    found = run_getfem({"laws": [*map(parameters, laws)]}, gradients=gradients)["stress"]
    exact = np.array([[_closed_form(law, F) for F in [*gradients]] for law in laws])
    return np.asarray(np.abs(found - exact).max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2)))


def _closed_form(law: Law, F: FloatArray) -> FloatArray:
    bulk = law.bulk_modulus
    return law.cauchy(F, 0.0 if math.isinf(bulk) else bulk * (np.linalg.det(F) - 1.0))


@dataclass(frozen=True)
class Skin:
    """The skin of a solved limb, and the limb's displacement, at the places of one mesh."""

    pressure: FloatArray  #: contact pressure at the Gauss points of the skin's surface, kPa
    shear: FloatArray  #: shear traction there, along increasing arc length, kPa
    mises: FloatArray  #: Mises stress at the Gauss points of the skin's triangles, kPa
    displacement: FloatArray  #: of the limb's nodes, mm, (n, 2)


@dataclass(frozen=True)
class Places:
    """Where two codes are compared, in the undeformed section."""

    line: ContactLine  #: Gauss points of the skin's surface
    surface: FloatArray  #: their positions, mm, (n, 2)
    inside: FloatArray  #: Gauss points of the skin's triangles, mm, (m, 2)
    area: FloatArray  #: that each of these stands for, mm^2, (m,)
    nodes: FloatArray  #: of the limb, mm, (k, 2)

    def skin(self, solved: Mapping[str, FloatArray]) -> Skin:
        """Bring what `getfem_limb` has solved to these places.

        Raises
        ------
        ValueError
            If it has no point at one of them.
        """
        on = _nearest(solved["skin_points"], self.surface)
        normal, traction = solved["normal"][on], KILOPASCAL * solved["traction"][on]
        # Arc length increases counter-clockwise, with the skin's inside on its left.
        along = np.column_stack([-normal[:, 1], normal[:, 0]])
        within = _nearest(solved["stress_points"], self.inside)
        return Skin(
            pressure=-np.sum(traction * normal, axis=1),
            shear=np.sum(traction * along, axis=1),
            mises=effective_stress(KILOPASCAL * solved["stress"][within]),
            displacement=solved["displacement"][_nearest(solved["nodes"], self.nodes)],
        )

    def smooth(self, values: FloatArray) -> FloatArray:
        """Average values at the surface over 3 mm along the skin."""
        return running_mean(self.line, values=values)

    def through_skin(self, values: FloatArray) -> FloatArray:
        """Average values inside the skin over its thickness and 3 mm along it, at the surface."""
        below = cKDTree(self.surface).query(self.inside)[1]
        weight = self.line.weight_mm
        amount, area = (
            self.smooth(np.bincount(below, of, len(weight)) / weight)
            for of in (self.area * values, self.area)
        )
        return amount / area


def _nearest(points: FloatArray, places: FloatArray) -> Any:
    distance, index = cKDTree(points).query(places)
    if distance.max() > SAME_PLACE:
        raise ValueError(f"no point within {SAME_PLACE} mm of a place: the meshes differ")
    return index


def places_of(line: ContactLine, surface: FloatArray, fields: SectionFields) -> Places:
    """Return the places of a solution of the program."""
    skin = fields.cells_of("skin")
    shapes = triangle_shapes(fields.gauss_points)
    inside = np.einsum("qa,cad->cqd", shapes, fields.points[fields.cells[skin]])
    return Places(
        line,
        surface,
        inside.reshape(-1, 2),
        fields.gauss_area[skin].ravel(),
        fields.points[_limb_nodes(fields)],
    )


def _limb_nodes(fields: SectionFields) -> Any:
    return np.unique(fields.cells[fields.bodies[0]])


def differences(places: Places, ours: Skin, theirs: Skin) -> dict[str, float]:
    """Differences of two solutions, % of the first; of the displacement, mm.

    Means are over the skin's surface, weighted with its length. "rms" is the root mean square of
    the difference at the points over that of the first solution, weighted with length or area.
    """
    weight = places.line.weight_mm

    def ratio(skin: Skin) -> float:
        return float(weight @ np.abs(skin.shear) / (weight @ skin.pressure))

    def rms(name: str) -> tuple[float, float]:
        a, b = getattr(theirs, name), getattr(ours, name)
        return deviation(a, b, weight), deviation(places.smooth(a), places.smooth(b), weight)

    pressure, shear = rms("pressure"), rms("shear")
    shares = {
        "mean pressure": float(weight @ theirs.pressure / (weight @ ours.pressure)) - 1.0,
        "shear over pressure": ratio(theirs) / ratio(ours) - 1.0,
        "pressure, rms": pressure[0],
        "pressure, 3 mm means, rms": pressure[1],
        "shear, rms": shear[0],
        "shear, 3 mm means, rms": shear[1],
        "skin Mises, rms": deviation(theirs.mises, ours.mises, places.area),
    }
    moved = np.linalg.norm(theirs.displacement - ours.displacement, axis=1).max()
    percent = {name: 100.0 * share for name, share in shares.items()}
    return {**percent, "nodes apart, mm": float(moved)}


@dataclass(frozen=True)
class Effort:
    """What a solution took."""

    unknowns: int
    steps: int  #: load steps that converged
    iterations: int  #: of Newton's method in them
    seconds: float  #: CPU time


@dataclass(frozen=True)
class Solved:
    """A case that the program has solved, and all that another code needs to do the same."""

    mesh: TriangleMesh
    about: dict[str, Any]  #: names of regions and boundaries, laws, friction, loads
    places: Places
    skin: Skin
    effort: Effort

    def by_getfem(self, element: str = P2, halved: bool = False) -> tuple[Skin, Effort]:
        """Solve the same in GetFEM, with the program's load steps or half of them."""
        loads = self.about["loads"]
        if halved:
            middles = 0.5 * (np.array([0.0, *loads[:-1]]) + loads)
            loads = sorted([*middles.tolist(), *loads])
        arrays = {
            name: value for name, value in vars(self.mesh).items() if isinstance(value, np.ndarray)
        }
        solved = run_getfem({**self.about, "loads": loads, "element": element}, **arrays)
        steps = solved["steps"]
        effort = Effort(
            int(solved["unknowns"]), len(steps), int(steps[:, 1].sum()), solved["seconds"]
        )
        return self.places.skin(solved), effort


def solve(socket: str, size: str) -> Solved:
    """Solve a case of the study, in the Separate set, with the program on one rank."""
    case, _, laws = one_case(socket, "separate", size)
    mesh = build(case.limb, case.socket, mesh_size(size))
    start = time.process_time()
    section = distribute(MPI.COMM_SELF, lambda: mesh)
    problem = limb_problem(section, laws, case.contact, case.support)
    stepper = LoadStepper(problem, case.steps)
    stepper.run()
    seconds = time.process_time() - start
    end = case.result(stepper)
    skin, fields = problem.contact, end.fields
    order = cKDTree(skin.deformed_points()).query(end.line.points)[1]
    about = {
        "regions": mesh.regions,
        "boundaries": mesh.boundaries,
        "laws": {name: parameters(law) for name, law in laws.items()},
        "friction": case.contact.friction,
        "loads": [step.load for step in stepper.steps if step.newton.converged],
    }
    return Solved(
        mesh,
        about,
        places_of(end.line, skin.points.reference[order], fields),
        Skin(
            end.line.pressure_kPa,
            end.line.shear_kPa,
            effective_stress(fields.stress[fields.cells_of("skin")]).ravel(),
            fields.displacement[_limb_nodes(fields)],
        ),
        Effort(end.checks.unknowns, end.checks.steps, end.checks.newton_iterations, seconds),
    )


SHOWN = {
    "pressure": "contact pressure, kPa",
    "shear": "shear traction, kPa",
    "mises": "skin's Mises stress, kPa",
}
"""What the figures show, and labels of their axes."""

MAGNIFIED = 10
"""Of the difference in the figures: it could not be seen."""


def report(size: str = "coarse") -> Section:
    """Compare TSB and HS Separate in both codes, at a mesh size."""
    checks = [_law_check()]
    figures: dict[str, Draw] = {}
    apart: list[dict[str, Any]] = []
    solutions: list[dict[str, Any]] = []
    for socket in SOCKETS:
        ours = solve(socket, size)
        solutions.append(_solution_row(socket, "calfsocket", ours.places, ours.skin, ours.effort))
        for name, choices in VARIANTS.items():
            theirs, effort = ours.by_getfem(**choices)
            found = differences(ours.places, ours.skin, theirs)
            solutions.append(_solution_row(socket, name, ours.places, theirs, effort))
            apart.append({"socket": socket, "code": name, **found})
            checks += [
                Check(f"{socket}, {name}: {what}", found[what], bar, "the program", "%")
                for what, bar in BARS.get(name, {}).items()
            ]
            if name == OWN:
                figures |= _figures(socket, ours.places, ours.skin, theirs)
    return Section(
        checks,
        figures,
        {"solutions": pd.DataFrame(solutions), "differences": pd.DataFrame(apart)},
        values={"sockets": SOCKETS, "triangles": len(ours.mesh.cells), "magnified": MAGNIFIED},
    )


def _law_check() -> Check:
    laws = {law for base in BASE_SETS for law in MaterialSet.paper(base).laws.values()}
    error = float(law_errors([*laws]).max())
    return Check(f"stress of {len(laws)} laws, worst", error, LAW_BAR, "principal stretches")


def _solution_row(
    socket: str, code: str, places: Places, skin: Skin, effort: Effort
) -> dict[str, Any]:
    weight = places.line.weight_mm
    pressing = weight @ skin.pressure
    return {
        "socket": socket,
        "code": code,
        "unknowns": effort.unknowns,
        "steps": effort.steps,
        "Newton": effort.iterations,
        "CPU s": round(effort.seconds),
        "mean pressure, kPa": pressing / weight.sum(),
        "shear / pressure": weight @ np.abs(skin.shear) / pressing,
        "skin's mean Mises, kPa": places.area @ skin.mises / places.area.sum(),
    }


def _figures(socket: str, places: Places, ours: Skin, theirs: Skin) -> dict[str, Draw]:
    """Both codes along the skin, in 3 mm means, and their difference."""
    figures = {}
    for name, label in SHOWN.items():
        mean = places.through_skin if name == "mises" else places.smooth
        a, b = mean(getattr(ours, name)), mean(getattr(theirs, name))
        figures[f"peer_{socket}_{name}"] = curves(
            (ALONG, label),
            [
                (places.line.arc_mm, a, "C0-", "calfsocket"),
                (places.line.arc_mm, b, "C3--", "GetFEM"),
                (places.line.arc_mm, MAGNIFIED * (b - a), "k-", f"difference, {MAGNIFIED} times"),
            ],
        )
    return figures
