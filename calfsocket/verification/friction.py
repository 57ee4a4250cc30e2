"""A socket ring turned on a limb ring: elastic torque, Coulomb's plateau, hysteresis."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.contact.resultants import Slid
from calfsocket.materials.laws import Hencky, Law
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.problems import prescribed_supports
from calfsocket.verification.radial import RadialSolution, Ring
from calfsocket.verification.report import LOG, Check, Section, check_each, curves
from calfsocket.verification.sampling import skin_mean, worst

TORSION = "axisymmetric torsion, layer by layer: u_t = A r + B/r"
LAME = "radial solution, Lame's at small strain"
AREA = "4 Ms (phi_max - Ms C)"
BAR = 1e-3
"""Largest relative error of all that has an exact value here."""


@dataclass(frozen=True)
class TurnedRing:
    """A limb of layers in a socket ring with an overclosure."""

    #: from the inside out, mm; the last one is the socket, whose inner radius is given without the
    #: overclosure
    layers: tuple[tuple[str, float, float, Law], ...] = (
        ("inner", 10.0, 16.0, Hencky(e=1.0, nu=0.3)),
        ("outer", 16.0, 20.0, Hencky(e=3.0, nu=0.4)),
        (tags.SOCKET, 20.0, 24.0, Hencky(e=100.0, nu=0.3)),
    )
    #: by which the socket is too small, mm; small, for the linear solutions to be exact
    overclosure: float = 2e-4
    friction: float = 0.4  #: coefficient of friction
    h: float = 2.0  #: element side, mm

    @property
    def radius(self) -> float:
        """Radius of the contact, mm."""
        return self.layers[-1][1]

    @property
    def laws(self) -> dict[str, Law]:
        """Law of each region."""
        return {name: law for name, _, _, law in self.layers}

    @property
    def compliance(self) -> float:
        """C in rad mm per N mm: turn over torque per length where nothing slips."""
        return sum(
            (1.0 / inner**2 - 1.0 / outer**2) / (4.0 * math.pi * law.initial_shear_modulus)
            for _, inner, outer, law in self.layers
        )

    @property
    def pressure(self) -> float:
        """Contact pressure before any turn, MPa."""
        *limb, (name, inner, outer, _) = self.layers
        rings = [Ring(layer, layer, start, end) for layer, start, end, _ in limb]
        rings.append(Ring(name, name, inner - self.overclosure, outer))
        fixed = (1.0, 0.0, 0.0)  # u = 0 at the outer face
        solution = RadialSolution(rings, self.laws, fixed, jump=self.overclosure)
        return -solution.at_end(limb[-1][0])[1]

    @property
    def slip_torque(self) -> float:
        """Ms = mu p 2 pi r^2, N mm per mm."""
        return self.friction * self.pressure * 2.0 * math.pi * self.radius**2

    @property
    def slip_turn(self) -> float:
        """Turn at which the contact slips, rad."""
        return self.slip_torque * self.compliance

    def mesh(self, comm: MPI.Comm) -> SectionMesh:
        """Mesh the rings."""
        *limb, (_, inner, outer, _) = self.layers
        socket = inner - self.overclosure, outer
        return ring_mesh(comm, [layer[:3] for layer in limb], socket, self.h)

    def pressed(self, comm: MPI.Comm) -> PrescribedMotion:
        """Make the rings and press them."""
        motion = prescribed_supports(self.mesh(comm), self.laws, Contact(friction=self.friction))
        motion.solve()
        return motion


@dataclass(frozen=True)
class Loop:
    """A turned ring, step by step."""

    ring: TurnedRing  #: the problem
    #: a row a step, the first before any: turn of the socket's outer face (rad) and the torque that
    #: turns it (N mm per mm, from the reaction); mean contact pressure (MPa) and mean slip in the
    #: step (mm); work of friction in it (N mm per mm), and the smallest at a point, relative to
    #: mu p r phi_s
    steps: pd.DataFrame

    @property
    def slope_error(self) -> float:
        """Relative error of torque over turn in the first step, without slip."""
        return float(self.steps.torque[1] / self.steps.turn[1] * self.ring.compliance) - 1.0

    @property
    def slipping(self) -> "pd.Series[bool]":
        """Steps in which all of the contact slips."""
        return self.steps.slip.abs() > 1e-3 * self.ring.radius * self.ring.slip_turn

    def checks(self) -> list[Check]:
        """Check a whole cycle."""
        ring, steps, slipping = self.ring, self.steps, self.slipping
        largest = float(steps.turn.max())
        # The cycle is closed from where the largest turn was first reached.
        cycle = steps.index > int(np.argmax(steps.turn > 0.999 * largest))
        area = 4.0 * ring.slip_torque * (largest - ring.slip_turn)
        # Steps that slip from their begin: a step before in the same direction slipped, too.
        same = np.sign(steps.torque) == np.sign(steps.torque.shift())
        full = slipping & slipping.shift(fill_value=False) & same
        pressures = {
            "contact pressure": steps.pressure[0] / ring.pressure - 1.0,
            "plateau of the torque": worst(steps.torque[slipping].abs() / ring.slip_torque - 1.0),
        }
        areas = {"area of the cycle": self._areas(), "work of friction": steps.work}
        errors = {name: float(each[cycle].sum()) / area - 1.0 for name, each in areas.items()}
        slip = steps.slip[full] / (-ring.radius * steps.turn.diff()[full])
        return [
            Check("elastic slope of the torque", self.slope_error, BAR, TORSION),
            *check_each(pressures, BAR, LAME),
            *check_each(errors, BAR, AREA),
            Check("work of friction, negative part", steps.least_work.min(), 1e-4, "second law"),
            Check("slip of a turn while slipping", worst(slip - 1.0), BAR, "r times the turn"),
        ]

    def _areas(self) -> "pd.Series[float]":
        """Area under torque over turn, step by step.

        The torque between two states is not linear where slip begins; the area is that of the
        polygon with the corner at which an elastic line meets the next torque.
        """
        after, change = self.steps.torque, self.steps.torque.diff()
        elastic = change * self.ring.compliance
        return (after - 0.5 * change) * elastic + after * (self.steps.turn.diff() - elastic)


#: Turns of a cycle from rest to both sides and back, in units of the turn of first slip.
CYCLE = (0.5, 1.5, 2.0, 2.5, 1.5, 0.0, -1.0, -2.5, -1.5, 0.0, 1.0, 2.5)


def turn(ring: TurnedRing, turns: Sequence[float] = CYCLE) -> Loop:
    """Turn the socket's outer face to these angles, in units of the turn of first slip."""
    motion = ring.pressed(MPI.COMM_SELF)
    contact = motion.problem.contact
    state = contact.state()
    unit = ring.friction * ring.pressure * ring.radius * ring.slip_turn
    columns = ["turn", "torque", "pressure", "work", "least_work", "slip"]
    rows = [(0.0, 0.0, skin_mean(contact, state.traction.pressure), 0.0, 0.0, 0.0)]
    for way in np.diff([0.0, *turns]) * ring.slip_turn:
        motion.step([tags.SOCKET], angle=way)
        before, state = state, contact.state()
        slid = Slid.between(contact, before, state)
        torque = motion.problem.reaction(tags.SOCKET_OUTER)[1]
        pressure, slip = (skin_mean(contact, v) for v in (state.traction.pressure, slid.slip))
        work = float(contact.points.weight @ slid.work)
        rows.append((rows[-1][0] + way, torque, pressure, work, slid.work.min() / unit, slip))
    return Loop(ring, pd.DataFrame(rows, columns=columns))


def rigid_turn(ring: TurnedRing, angle: float) -> list[Check]:
    """Press the ring, turn the socket until it sticks at half the limit, then turn everything."""
    motion = ring.pressed(MPI.COMM_SELF)
    motion.step([tags.SOCKET], angle=0.5 * ring.slip_turn)
    problem = motion.problem
    before = problem.contact.state()
    motion.move(list(problem.section.regions), angle=angle)
    residual = motion.x.duplicate()
    problem.residual(motion.x, residual)
    after = problem.contact.state()
    mean = before.traction.pressure.mean()
    change = max(
        worst(getattr(after.traction, name) - getattr(before.traction, name)) / mean
        for name in ("pressure", "shear")
    )
    slip = worst(after.slip - before.slip) / ring.radius
    force = worst(residual.array) / (mean * 2.0 * math.pi * ring.radius)
    changes = {"traction changed by a rigid turn": change, "residual of a rigid turn": force}
    return [
        Check("slip of a rigid turn of both bodies", slip, 1e-12, "objectivity"),
        *check_each(changes, 1e-6, "objectivity"),
    ]


def report() -> Section:
    """Measure the turned ring: elastic slope, plateau, hysteresis, objective slip."""
    sizes = np.array([4.0, 2.8, 2.0, 1.4])
    slopes = np.abs([turn(TurnedRing(h=h), CYCLE[:1]).slope_error for h in sizes])
    loop = turn(TurnedRing())
    ring, steps = loop.ring, loop.steps
    exact = np.array([(0, 0), (1, 1), (2.5, 1), (0.5, -1), (-2.5, -1), (-0.5, 1), (2.5, 1)])
    computed = steps.turn / ring.slip_turn, steps.torque / ring.slip_torque
    square = slopes[0] * (sizes / sizes[0]) ** 2
    return Section(
        [*loop.checks(), *rigid_turn(TurnedRing(), 0.7)],
        {
            "friction_loop": curves(
                ("turn / turn of first slip", "torque / (mu p 2 pi r^2)"),
                [(*exact.T, "k-", "exact"), (*computed, "o", "computed")],
            ),
            "friction_slope": curves(
                ("element side, mm", "relative error"),
                [(sizes, slopes, "o-", "elastic slope"), (sizes, square, "k--", "h^2")],
                **LOG,
            ),
        },
    )
