r"""A socket ring turned on a limb ring: elastic torque, Coulomb's plateau, hysteresis.

Layers r1 < r < r2 of shear modulus G under a torque M per length (linear, axisymmetric) turn by
u_t / r = A + B / r^2, with the shear stress -2 G B / r^2 = M / (2 pi r^2), so that the turn of the
held outer face against the held core is

    phi = M C,   C = sum_layers (1/r1^2 - 1/r2^2) / (4 pi G).

The overclosure d presses with the p of Lame's problem, u_r = A r + B / r in each layer, held at
both ends. The contact slips all around when M reaches Ms = mu p 2 pi r^2, and stays there. A cycle
between -phi_max and phi_max encloses the area 4 Ms (phi_max - Ms C), all of it friction's work.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.contact.parameters import Contact
from calfsocket.materials.laws import Hencky
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.problems import held_socket
from calfsocket.verification.report import LOG, Check, Section, curves
from calfsocket.verification.sampling import Slid, skin_mean, worst

FloatArray = NDArray[np.float64]

TORSION = "axisymmetric torsion, layer by layer: u_t = A r + B/r"
LAME = "Lame's problem, layer by layer: u_r = A r + B/r"


INNER, OUTER = Hencky(e=1.0, nu=0.3), Hencky(e=3.0, nu=0.4)
STIFF = Hencky(e=100.0, nu=0.3)


@dataclass(frozen=True)
class TurnedRing:
    """A limb of layers in a socket ring with an overclosure.

    Attributes
    ----------
    layers : sequence of (name, inner radius, outer radius, law)
        The limb from the inside out, mm.
    socket : (inner radius, outer radius, law)
        Inner radius without the overclosure, mm.
    overclosure : float
        By which the socket is too small, mm; small, for the linear solutions to be exact.
    friction : float
        Coefficient of friction.
    h : float
        Element side, mm.
    """

    layers: tuple[tuple[str, float, float, Hencky], ...] = (
        ("inner", 10.0, 16.0, INNER),
        ("outer", 16.0, 20.0, OUTER),
    )
    socket: tuple[float, float, Hencky] = (20.0, 24.0, STIFF)
    overclosure: float = 2e-4
    friction: float = 0.4
    h: float = 2.0

    @property
    def radius(self) -> float:
        """Radius of the contact, mm."""
        return self.socket[0]

    @property
    def compliance(self) -> float:
        """C in rad mm per N mm."""
        return sum(
            (1.0 / inner**2 - 1.0 / outer**2) / (4.0 * math.pi * law.initial_shear_modulus)
            for inner, outer, law in self._rings()
        )

    @property
    def pressure(self) -> float:
        """Contact pressure of Lame's problem, MPa."""
        rings = self._rings()
        n = len(rings)
        matrix, right = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)

        def displacement(r: float) -> list[float]:
            return [r, 1.0 / r]

        def stress(r: float, law: Hencky) -> list[float]:
            shear = law.initial_shear_modulus
            return [2.0 * (law.bulk_modulus + shear / 3.0), -2.0 * shear / r**2]

        matrix[0, :2] = displacement(rings[0][0])
        matrix[1, -2:] = displacement(rings[-1][1])
        for i, ((_, r, law), (_, _, outside)) in enumerate(pairwise(rings)):
            here, there = slice(2 * i, 2 * i + 2), slice(2 * i + 2, 2 * i + 4)
            row = 2 + 2 * i
            matrix[row, here], matrix[row, there] = displacement(r), np.negative(displacement(r))
            matrix[row + 1, here], matrix[row + 1, there] = (
                stress(r, law),
                np.negative(stress(r, outside)),
            )
        right[2 + 2 * (n - 2)] = -self.overclosure
        limb = np.linalg.solve(matrix, right)[2 * n - 4 : 2 * n - 2]
        return -float(np.dot(stress(self.radius, rings[-2][2]), limb))

    @property
    def slip_torque(self) -> float:
        """Ms, N mm per mm."""
        return self.friction * self.pressure * 2.0 * math.pi * self.radius**2

    @property
    def slip_turn(self) -> float:
        """Turn at which the contact slips, rad."""
        return self.slip_torque * self.compliance

    def _rings(self) -> list[tuple[float, float, Hencky]]:
        return [(inner, outer, law) for _, inner, outer, law in self.layers] + [self.socket]

    @property
    def laws(self) -> dict[str, Hencky]:
        """Law of each region."""
        return {name: law for name, _, _, law in self.layers} | {tags.SOCKET: self.socket[2]}

    def mesh(self, comm: MPI.Comm) -> SectionMesh:
        """Mesh the rings."""
        inner, outer, _ = self.socket
        layers = [layer[:3] for layer in self.layers]
        return ring_mesh(comm, layers, (inner - self.overclosure, outer), self.h)

    def pressed(self, comm: MPI.Comm) -> PrescribedMotion:
        """Make the rings and press them."""
        motion = held_socket(self.mesh(comm), self.laws, Contact(friction=self.friction))
        motion.solve()
        return motion


@dataclass(frozen=True)
class Loop:
    """A turned ring, step by step; arrays have one value a step, the first before any turn.

    Attributes
    ----------
    ring : TurnedRing
        The problem.
    turn : (n,)
        Turn of the socket's outer face, rad.
    torque : (n,)
        Torque that holds it, N mm per mm, from the reaction.
    pressure : (n,)
        Mean contact pressure, MPa.
    work : (n,)
        Work of friction in the step, integral of -q ds, N mm per mm.
    least_work : float
        Smallest work of friction at a point in a step, relative to mu p r phi_s.
    slip : (n,)
        Mean slip of the skin on the socket in the step, mm.
    """

    ring: TurnedRing
    turn: FloatArray
    torque: FloatArray
    pressure: FloatArray
    work: FloatArray
    least_work: float
    slip: FloatArray

    @property
    def slope_error(self) -> float:
        """Relative error of torque over turn in the first step, without slip."""
        return float(self.torque[1] / self.turn[1] * self.ring.compliance) - 1.0

    @property
    def pressure_error(self) -> float:
        """Relative error of the contact pressure before any turn."""
        return float(self.pressure[0]) / self.ring.pressure - 1.0

    def plateau(self) -> FloatArray:
        """Relative errors of |torque| against mu p 2 pi r^2 of Lame's p in the slipping steps."""
        return np.abs(self.torque[self._slipping()]) / self.ring.slip_torque - 1.0

    def coulomb(self) -> FloatArray:
        """Relative errors of |torque| against mu p 2 pi r^2 of the present p, slipping steps."""
        at = self._slipping()
        limit = self.ring.friction * self.pressure[at] * 2.0 * np.pi * self.ring.radius**2
        return np.abs(self.torque[at]) / limit - 1.0

    @property
    def dissipation_error(self) -> float:
        """Relative error of friction's work over the closed cycle against its exact area."""
        return float(self.work[self._cycle()].sum()) / self._area() - 1.0

    @property
    def area_error(self) -> float:
        """Relative error of the cycle's area, by torque and turn, against its exact area.

        The torque between two states is not linear where slip begins; the area is that of the
        polygon with the corner at which an elastic line meets the next torque.
        """
        total = 0.0
        stiffness = 1.0 / self.ring.compliance
        for i in np.flatnonzero(self._cycle()):
            way = self.turn[i] - self.turn[i - 1]
            before, after = self.torque[i - 1], self.torque[i]
            elastic = (after - before) / stiffness
            total += 0.5 * (before + after) * elastic + after * (way - elastic)
        return total / self._area() - 1.0

    @property
    def slip_error(self) -> float:
        """Largest error of slip against r times the turn in fully slipping steps, relative."""
        way = np.diff(self.turn)
        full = self._slipping() & np.append(False, self._slipping()[:-1])
        full[1:] &= np.sign(self.torque[1:]) == np.sign(self.torque[:-1])
        exact = -self.ring.radius * way[full[1:]]
        return worst(self.slip[full] / exact - 1.0)

    def _area(self) -> float:
        ring = self.ring
        return 4.0 * ring.slip_torque * (float(self.turn.max()) - ring.slip_turn)

    def _slipping(self) -> NDArray[np.bool_]:
        return np.abs(self.slip) > 1e-3 * self.ring.radius * self.ring.slip_turn

    def _cycle(self) -> NDArray[np.bool_]:
        """Tell the steps after the largest turn was first reached."""
        return np.arange(len(self.turn)) > int(np.argmax(self.turn > 0.999 * self.turn.max()))


#: Turns of a cycle from rest to both sides and back, in units of the turn of first slip.
CYCLE = (0.5, 1.5, 2.0, 2.5, 1.5, 0.0, -1.0, -2.5, -1.5, 0.0, 1.0, 2.5)


def turn(ring: TurnedRing, turns: Sequence[float] = CYCLE) -> Loop:
    """Turn the socket's outer face to these angles, in units of the turn of first slip."""
    motion = ring.pressed(MPI.COMM_SELF)
    contact = motion.problem.contact
    weight = contact.points.weight
    state = contact.state()
    rows = [(0.0, 0.0, skin_mean(contact, state.traction.pressure), 0.0, 0.0)]
    angle, least = 0.0, 0.0
    unit = ring.friction * ring.pressure * ring.radius * ring.slip_turn
    for target in turns:
        way = target * ring.slip_turn - angle
        motion.step([tags.SOCKET], angle=way)
        angle += way
        before, state = state, contact.state()
        slid = Slid.between(contact, before, state)
        least = min(least, float(slid.work.min()) / unit)
        rows.append(
            (
                angle,
                motion.problem.reaction(tags.SOCKET_OUTER)[1],
                skin_mean(contact, state.traction.pressure),
                float(weight @ slid.work),
                skin_mean(contact, slid.slip),
            )
        )
    turns_, torque, pressure, work, slip = np.array(rows).T
    return Loop(ring, turns_, torque, pressure, work, least, slip)


@dataclass(frozen=True)
class RigidTurn:
    """What changes when both bodies of a solved ring turn together.

    Attributes
    ----------
    slip : float
        Largest change of slip, relative to the contact's radius.
    traction : float
        Largest change of contact pressure or shear, relative to the mean pressure.
    residual : float
        Largest residual of an unknown that is not held, relative to the pressing force.
    """

    slip: float
    traction: float
    residual: float


def rigid_turn(ring: TurnedRing, angle: float) -> RigidTurn:
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
        worst(getattr(after.traction, name) - getattr(before.traction, name))
        for name in ("pressure", "shear")
    )
    return RigidTurn(
        slip=worst(after.slip - before.slip) / ring.radius,
        traction=change / mean,
        residual=worst(residual.array) / (mean * 2.0 * math.pi * ring.radius),
    )


def report() -> Section:
    """Measure the turned ring: elastic slope, plateau, hysteresis, objective slip."""
    sizes = (4.0, 2.8, 2.0, 1.4)
    slopes = [turn(TurnedRing(h=h), CYCLE[:1]).slope_error for h in sizes]
    loop = turn(TurnedRing())
    rigid = rigid_turn(TurnedRing(), 0.7)
    ring, area = loop.ring, "4 Ms (phi_max - Ms C)"
    exact = np.array([(0, 0), (1, 1), (2.5, 1), (0.5, -1), (-2.5, -1), (-0.5, 1), (2.5, 1)])
    square = abs(slopes[0]) * (np.array(sizes) / sizes[0]) ** 2
    return Section(
        title="Friction: a socket turned on a limb",
        text=__doc__ or "",
        checks=[
            Check("elastic slope of the torque", loop.slope_error, 1e-3, TORSION),
            Check("contact pressure", loop.pressure_error, 1e-3, LAME),
            Check("plateau of the torque", worst(loop.plateau()), 1e-3, LAME),
            Check("area of the cycle", loop.area_error, 1e-3, area),
            Check("work of friction", loop.dissipation_error, 1e-3, area),
            Check("work of friction, negative part", loop.least_work, 1e-4, "second law"),
            Check("slip of a turn while slipping", loop.slip_error, 1e-3, "r times the turn"),
            Check("slip of a rigid turn of both bodies", rigid.slip, 1e-12, "objectivity"),
            Check("traction changed by a rigid turn", rigid.traction, 1e-6, "objectivity"),
            Check("residual of a rigid turn", rigid.residual, 1e-6, "objectivity"),
        ],
        figures=[
            curves(
                "friction_loop",
                "Torque of a socket turned to and fro.",
                "turn / turn of first slip",
                "torque / (mu p 2 pi r^2)",
                [
                    (*exact.T, "k-", "exact"),
                    (loop.turn / ring.slip_turn, loop.torque / ring.slip_torque, "o", "computed"),
                ],
            ),
            curves(
                "friction_slope",
                "Error of the elastic slope.",
                "element side, mm",
                "relative error",
                [
                    (sizes, np.abs(slopes), "o-", "elastic slope"),
                    (sizes, square, "k--", "h^2"),
                ],
                **LOG,
            ),
        ],
    )
