"""The concentric limb with a liner, and with tissue that swells, against its exact solution."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pandas as pd
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.materials.law import Law
from calfsocket.materials.liner import LINER_LAWS
from calfsocket.materials.material_set import BaseSet, MaterialSet
from calfsocket.materials.stress_free import StressFreeState
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper
from calfsocket.meshes import tags
from calfsocket.meshes.lining import hoop
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.exact_ring import RADIAL, ring_errors
from calfsocket.verification.radial import (
    LIMB,
    SOCKET,
    SOCKET_THICKNESS,
    ExactRing,
    Ring,
    exact_ring,
)
from calfsocket.verification.report import LOG, Check, Curve, Section, curves
from calfsocket.verification.sampling import FloatArray, skin_mean, worst

OVERCLOSURE = 0.92
"""As of `exact_ring`, mm."""

SKIN_POINTS = 16
"""Gauss points on a skin edge. Four do not resolve the kinks of the shape functions that they press
on: a soft liner inside the socket feels it as a few parts in 100 000 of its pressure."""

THICKNESS = 6.0
"""Of the liner, mm."""

STEPS = (0.5, 1.0)


class Lined(NamedTuple):
    """A concentric limb with a liner."""

    bonded: str  #: "limb" or "socket"; "" without a liner
    undersize: float = 0.0
    swollen: Mapping[str, float] = MappingProxyType({})  #: volume ratio by tissue


CASES = {
    "liner on the limb": Lined("limb"),
    "undersized liner on the limb": Lined("limb", 0.05),
    "liner in the socket": Lined("socket"),
    "undersized liner in the socket": Lined("socket", 0.05),
    "swollen muscle, shrunken fat": Lined("", 0.0, {"muscle": 1.03, "fat": 0.97}),
    "all of it": Lined("limb", 0.03, {"muscle": 1.03, "fat": 0.97, "skin": 1.02}),
}


@dataclass(frozen=True)
class LinedRing:
    """One of the cases with a material set."""

    case: Lined
    material: BaseSet = "separate"

    @property
    def tissues(self) -> dict[str, str]:
        """Tissue of each region."""
        names = {ring.name: ring.tissue for ring in self.rings} | {SOCKET: SOCKET}
        return names | ({tags.LINER: tags.LINER} if self.case.bonded else {})

    @property
    def rings(self) -> tuple[Ring, ...]:
        """Rings on the limb's side of the contact."""
        skin = LIMB[-1].outer
        liner = Ring(tags.LINER, tags.LINER, skin, skin + THICKNESS)
        return (*LIMB, liner) if self.case.bonded == "limb" else LIMB

    @property
    def lining(self) -> float:
        """Thickness of a liner inside the socket, mm."""
        return THICKNESS if self.case.bonded == "socket" else 0.0

    @property
    def laws(self) -> dict[str, Law]:
        """Laws by tissue."""
        laws = MaterialSet.paper(self.material).tissue_laws()
        return laws | {tags.LINER: LINER_LAWS["silicone"]}

    def exact(self, load: float = 1.0) -> ExactRing:
        """Return the exact solution."""
        states = {
            ring.name: (np.sqrt(self.case.swollen[ring.tissue]),) * 2
            for ring in self.rings
            if ring.tissue in self.case.swollen
        }
        if self.case.undersize:
            states[tags.LINER] = (1.0, 1.0 - self.case.undersize)
        return exact_ring(
            self.laws, OVERCLOSURE, load, self.rings, stress_free=states, lining=self.lining
        )

    def solve(self, h: float) -> pd.DataFrame:
        """Solve with elements of h mm; errors as of `exact_ring.solve_ring`, a row a load step."""
        inner = self.rings[-1].outer - OVERCLOSURE + self.lining
        layers = [(ring.name, ring.inner, ring.outer) for ring in self.rings]
        socket = (inner, inner + SOCKET_THICKNESS)
        section = ring_mesh(MPI.COMM_SELF, layers, socket, h, lining=self.lining)
        laws = {name: self.laws[tissue] for name, tissue in self.tissues.items()}
        problem = limb_problem(section, laws, Contact(gauss_points=SKIN_POINTS))
        states: dict[str, StressFreeState] = {
            name: self.case.swollen[tissue]
            for name, tissue in self.tissues.items()
            if tissue in self.case.swollen
        }
        if self.case.undersize:
            states[tags.LINER] = hoop(self.case.undersize, around)
        problem.set_stress_free(states)
        rows: list[dict[str, float]] = []

        def compare(step: LoadStep) -> None:
            if step.newton.converged:
                problem.set_unknowns(stepper.newton.x)
                rows.append(self._errors(problem, step.load))

        stepper = LoadStepper(problem, STEPS, on_step=compare)
        stepper.run()
        return pd.DataFrame(rows)

    def _errors(self, problem: Problem, load: float) -> dict[str, float]:
        exact, contact, outer = self.exact(load), problem.contact, self.rings[-1].outer
        mean = skin_mean(contact, contact.state().traction.pressure)
        radius = skin_mean(contact, np.hypot(*contact.deformed_points().T))
        return {
            "load": load,
            "pressure": mean / exact.pressure - 1.0,
            "radius": (radius - exact.skin_radius) / (outer - exact.skin_radius),
            **ring_errors(problem, self.tissues, exact).max(),
        }


def around(points: FloatArray) -> FloatArray:
    """Return the direction around the origin at positions, (n, 2)."""
    turned = np.stack([-points[:, 1], points[:, 0]], axis=1)
    return turned / np.linalg.norm(points, axis=1)[:, None]


BARS = {
    "contact pressure": ("pressure", 1e-6),
    "radius of what meets the socket": ("radius", 1e-6),
    "mean stress of a ring": ("mean_stress", 1e-5),
    "mean stretch of a ring": ("mean_stretch", 1e-6),
}
"""What is checked of a load step: its column and its bar, at 1 mm elements."""

SIZES = (4.0, 2.0, 1.0)


def report() -> Section:
    """Compare all cases with their exact solutions, in both load steps."""
    checks: list[Check] = []
    convergence: list[Curve] = []
    styles = ("o-", "s-", "^-", "v-", "D-", "x-")
    for (name, case), style in zip(CASES.items(), styles, strict=True):
        ring = LinedRing(case)
        by_size = [ring.solve(h) for h in SIZES]
        convergence.append((SIZES, [abs(each.pressure.iloc[-1]) for each in by_size], style, name))
        finest = by_size[-1]
        checks += [
            Check(f"{name}: {what}", worst(finest[column].to_numpy()), bar, RADIAL)
            for what, (column, bar) in BARS.items()
        ]
    labels = ("element side, mm", "relative error of contact pressure")
    return Section(checks, {"lined_ring_convergence": curves(labels, convergence, **LOG)})
