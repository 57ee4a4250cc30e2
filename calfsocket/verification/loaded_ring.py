"""Stages of loading on a ring: elastic slope, Coulomb's limit, dissipation and balance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.loading import CARRIED, Carried, Stage
from calfsocket.mechanics.stages import StageStepper
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.frame import Frame
from calfsocket.verification.friction import AREA, LAME, TORSION, TurnedRing
from calfsocket.verification.radial import RadialSolution, Ring
from calfsocket.verification.report import LOG, Check, Section, check_each, curves, order

AXES = Frame("lateral", "anterior")

RING = TurnedRing(overclosure=2e-3, h=2.8)


@dataclass(frozen=True)
class LoadedRing:
    """A ring whose socket floats, and is carried by a frame or an even load once it is donned."""

    ring: TurnedRing = RING
    carried: Carried = "frame"

    @property
    def pressure(self) -> float:
        """Contact pressure while the socket's outer face is free, MPa."""
        *limb, (name, inner, outer, _) = self.ring.layers
        rings = [Ring(layer, layer, start, end) for layer, start, end, _ in limb]
        rings.append(Ring(name, name, inner - self.ring.overclosure, outer))
        free = (0.0, 1.0, 0.0)  # no traction at the outer face
        solution = RadialSolution(rings, self.ring.laws, free, jump=self.ring.overclosure)
        return -solution.at_end(limb[-1][0])[1]

    @property
    def limit(self) -> float:
        """Largest moment, mu p 2 pi r^2, N mm/mm."""
        return self.ring.friction * self.pressure * 2.0 * math.pi * self.ring.radius**2

    def donned(self, comm: MPI.Comm = MPI.COMM_SELF) -> StageStepper:
        """Don the socket."""
        ring = self.ring
        problem = limb_problem(ring.mesh(comm), ring.laws, Contact(friction=ring.friction))
        stepper = LoadStepper(problem, (1.0,))
        stepper.run()
        return StageStepper(stepper, AXES, carried=self.carried)

    def follow(self, *stages: Stage) -> StageStepper:
        """Don the socket and go through stages."""
        stepper = self.donned()
        for stage in stages:
            stepper.run(stage)
        return stepper

    @property
    def slope_error(self) -> float:
        """Relative error of rotation over moment, at a fifth of the limit, where nothing slips."""
        point = self.follow(Stage(name="twist", moment=0.2 * self.limit, steps=1)).points[-1]
        return float(point.place[2] / point.force[2] / self.ring.compliance) - 1.0


SIZES = (3.4, 2.4, 1.7, 1.2)
"""Element sides for the slope, mm."""

SMALL = TurnedRing(overclosure=2e-5)
"""So small that the strains do not count: the closed form is that of small ones."""

OVER = 1.2
"""Moment that is asked for, over the limit."""

FAR = 2.5
"""Rotation of the cycle over that of first slip."""


def slopes(carried: Carried, sizes: Sequence[float] = SIZES) -> pd.DataFrame:
    """Measure the elastic slope on finer and finer meshes: h in mm, and its relative error."""
    rings = [LoadedRing(replace(SMALL, h=float(h)), carried) for h in sizes]
    return pd.DataFrame({"h": sizes, "error": [ring.slope_error for ring in rings]})


def over_the_limit(ring: LoadedRing) -> tuple[StageStepper, list[Check]]:
    """Ask for more than the limit, release, and push to a side."""
    stepper = ring.follow(
        Stage(name="over", moment=OVER * ring.limit, steps=2),
        Stage(name="released", moment=0.0, steps=1),
        Stage(name="push", force={"lateral": 0.02 * ring.pressure * ring.ring.radius}, steps=1),
    )
    error = stepper.limits[-1].force[2] / ring.limit - 1.0
    name = f"{ring.carried}: largest moment that is found"
    return stepper, [Check(name, error, 1e-3, "mu p 2 pi r^2")]


def cycle(ring: LoadedRing) -> tuple[StageStepper, list[Check]]:
    """Turn the socket to and fro."""
    turn = FAR * ring.limit * ring.ring.compliance
    stepper = ring.follow(Stage(name="turn", rotation=math.degrees(turn), steps=10, cycles=1))
    points = stepper.points[10:]  # from the largest turn, to the other side, and back
    area = 4.0 * ring.limit * (turn - ring.limit * ring.ring.compliance)
    dissipated = (points[-1].dissipated - points[0].dissipated) / area - 1.0
    slid = [abs(point.force[2]) / ring.limit - 1.0 for point in points if point.slipping > 0.99]
    return stepper, [
        Check("a closed cycle's dissipation", dissipated, 5e-3, AREA),
        Check("moment while all of the contact slips", max(slid, key=abs), 1e-3, LAME),
    ]


def report() -> Section:
    """Measure slopes, limits, a cycle, and the balance of every equilibrium."""
    rings = {carried: LoadedRing(carried=carried) for carried in CARRIED}
    by_size = {carried: slopes(carried) for carried in CARRIED}
    orders = {
        f"{name}: order of the elastic slope": order(table.h, table.error.abs())
        for name, table in by_size.items()
    }
    finest = {
        f"{name}: elastic slope at {SIZES[-1]:g} mm": float(table.error.iloc[-1])
        for name, table in by_size.items()
    }
    followed: dict[str, tuple[StageStepper, list[Check]]] = {
        name: over_the_limit(ring) for name, ring in rings.items()
    }
    followed["cycle"] = cycle(rings["frame"])
    balance = {
        f"{name}: force and moment out of balance": max(p.imbalance for p in stepper.points)
        for name, (stepper, _) in followed.items()
    }
    limit = rings["frame"].limit
    first = limit * rings["frame"].ring.compliance
    exact = np.array([(0, 0), (1, 1), (FAR, 1), (FAR - 2, -1), (-FAR, -1), (2 - FAR, 1), (FAR, 1)])
    lines = [(*exact.T, "k-", "exact")]
    for (name, (stepper, _)), style in zip(followed.items(), ("s", "^", "o"), strict=True):
        points = [point for point in stepper.points if point.stage != "push"]
        turn = [point.place[2] / first for point in points]
        lines.append((turn, [p.force[2] / limit for p in points], style, name))
    return Section(
        [
            *check_each(orders, 2.0, "2", rule="at least"),
            *check_each(finest, 1e-5, TORSION),
            *(check for _, checks in followed.values() for check in checks),
            *check_each(balance, 1e-8, "equilibrium, over the pressing force"),
        ],
        {
            "loaded_ring_loop": curves(
                ("rotation / rotation of first slip", "moment / (mu p 2 pi r^2)"), lines
            ),
            "loaded_ring_slope": curves(
                ("element side, mm", "relative error of rotation over moment"),
                [
                    (table.h, table.error.abs(), style, name)
                    for (name, table), style in zip(by_size.items(), ("o-", "x--"), strict=True)
                ],
                **LOG,
            ),
        },
    )
