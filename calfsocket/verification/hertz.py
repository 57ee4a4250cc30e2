"""Hertz and Cattaneo-Mindlin: an elastic disc on a flat, and in a bore.

Johnson, Contact Mechanics, 1985, doi:10.1017/CBO9781139171731, sections 4.2 and 7.2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pandas as pd
from mpi4py import MPI

from calfsocket.contact.friction import STICK
from calfsocket.contact.parameters import Contact
from calfsocket.contact.resultants import Slid
from calfsocket.materials.laws import Hencky
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.meshes import tags
from calfsocket.meshes.disc import DiscInCavity
from calfsocket.verification.problems import prescribed_supports
from calfsocket.verification.report import LOG, Curve, Section, check_each, curves
from calfsocket.verification.sampling import Array, FloatArray, deviation, edge_means

JOHNSON = "Johnson 1985, section 4.2"
CATTANEO = "Cattaneo 1938, Mindlin 1949; Johnson 1985, section 7.2"
DIVISIONS = (3.0, 6.0, 12.0)
SHARE, STEPS = 0.6, 6
"""Q/(mu P) that is aimed at, and the steps of the push."""

MATERIAL = Hencky(e=1.0, nu=0.3)


@dataclass(frozen=True)
class Line:
    """A disc pressed on a cavity."""

    bore: float = math.inf  #: radius of the cavity in mm; infinite for a flat
    half_width: float = 0.1  #: half-width of contact aimed at, mm: sets how far the core is moved
    divisions: float = 6.0  #: element sides in a half-width
    #: materials of disc and cavity; linear elastic at strains of a few 1e-3
    limb: Hencky = MATERIAL
    socket: Hencky = MATERIAL
    friction: float = 0.0  #: coefficient of friction
    #: radii of the disc and of its fixed core, and thickness of the cavity's wall, mm
    radius: float = 10.0
    core: float = 7.0
    thickness: float = 5.0

    @property
    def h(self) -> float:
        """Element side in the contact, mm."""
        return self.half_width / self.divisions

    @property
    def relative_radius(self) -> float:
        """R = 1/(1/R1 + 1/R2), mm."""
        return 1.0 / (1.0 / self.radius - 1.0 / self.bore)

    @property
    def modulus(self) -> float:
        """E' = 1/((1 - nu1^2)/E1 + (1 - nu2^2)/E2), MPa."""
        return 1.0 / sum((1.0 - law.nu**2) / law.e for law in (self.limb, self.socket))

    def half_width_of(self, force: float) -> float:
        """Half-width a = sqrt(4 P R/(pi E')) in mm of the force in N/mm."""
        return math.sqrt(4.0 * force * self.relative_radius / (math.pi * self.modulus))

    def peak_of(self, force: float) -> float:
        """Peak p0 = 2 P/(pi a) in MPa of the force in N/mm."""
        return 2.0 * force / (math.pi * self.half_width_of(force))

    def approach(self) -> float:
        """How far to move the core for `half_width`, mm, from layers of the bodies' depths.

        Johnson 1985, equation (5.57): the depression of the surface of a half-plane under a Hertz
        pressure with respect to a point at the depth d. It only sets the load's size.
        """
        force = math.pi * self.modulus * self.half_width**2 / (4.0 * self.relative_radius)
        depths = (self.radius - self.core, self.thickness)
        depression = 0.0
        for law, depth in zip((self.limb, self.socket), depths, strict=True):
            layer = 2.0 * math.log(2.0 * depth / self.half_width) - law.nu / (1.0 - law.nu)
            depression += force / math.pi * (1.0 - law.nu**2) / law.e * layer
        return depression

    def pressed(self, comm: MPI.Comm) -> PrescribedMotion:
        """Make the bodies, touching in one point, and press them in one step."""
        disc = DiscInCavity(
            radius=self.radius,
            core=self.core,
            bore=self.bore,
            thickness=self.thickness,
            h=self.h,
            reach=1.5 * self.half_width,
        )
        stiffness = self.limb.e / self.h
        motion = prescribed_supports(
            disc.mesh(comm),
            {tags.LIMB: self.limb, tags.SOCKET: self.socket},
            Contact(friction=self.friction, gamma=stiffness, gamma_t=0.5 * stiffness),
        )
        motion.step([tags.LIMB], shift=(0.0, -self.approach()))
        return motion


BORE = Line(bore=12.5, socket=Hencky(e=3.0, nu=0.4))
PARTIAL_SLIP = Line(divisions=12.0, friction=0.4)


@dataclass(frozen=True)
class Pressed:
    """Contact of a `Line`, on one rank."""

    line: Line  #: the problem
    #: force and tangential force from the reaction of the core, N/mm
    force: float
    tangential: float
    total: float  #: integral of the contact pressure, N/mm
    #: second moments of pressure and of |shear| about the centre of pressure, N mm
    moments: tuple[float, ...]
    peak: float  #: largest pressure, mean over a skin edge, MPa
    #: skin edges near the floor: middle x from the centre of pressure (mm), mean pressure and shear
    #: (MPa), length (mm)
    edges: pd.DataFrame
    #: half the length of the points that stick, mm; it counts points, so that it jumps
    stick_half_width: float

    @property
    def half_width(self) -> float:
        """From the second moment of the pressure, which is a^2/4 for Hertz's, mm."""
        return 2.0 * math.sqrt(self.moments[0] / self.total)

    @property
    def stick_ratio(self) -> float:
        """Exact c/a = sqrt(1 - Q/(mu P)) for the measured forces."""
        return math.sqrt(1.0 - abs(self.tangential) / (self.line.friction * self.force))

    @property
    def exact_half_width(self) -> float:
        """Hertz's a of the measured force, mm."""
        return self.line.half_width_of(self.force)

    def hertz_errors(self) -> dict[str, float]:
        """Relative errors of the pressed disc by what they are of; that of a profile is its rms."""
        line, force = self.line, self.force
        theory = math.pi * line.modulus * self.half_width**2 / (4.0 * line.relative_radius)
        a, p0 = self.exact_half_width, line.peak_of(force)
        edges = self.edges
        exact = p0 * root_mean(edges.x / a, edges.length / a)
        return {
            "force of the measured half-width": theory / force - 1.0,
            "half-width": self.half_width / a - 1.0,
            "peak pressure": self.peak / p0 - 1.0,
            "pressure profile": deviation(edges.pressure, exact, edges.length),
        }

    def slip_errors(self) -> dict[str, float]:
        """Relative errors of the pulled disc.

        The second moment of Cattaneo's traction is mu times that of the pressure times
        1 - (c/a)^4, which gives a measured c; the exact one comes from the forces.
        """
        normal, tangential = self.moments
        share = tangential / (self.line.friction * normal)
        edges = self.edges
        exact = self.exact_shear(edges.x, edges.length)
        return {
            "stick half-width": (1.0 - share) ** 0.25 / self.stick_ratio - 1.0,
            "shear profile": deviation(edges.shear, exact, edges.length),
        }

    def exact_shear(self, x: Array, length: Array) -> FloatArray:
        """Cattaneo's traction on the skin for the measured forces, mean over edges about x, MPa."""
        a, ratio = self.exact_half_width, self.stick_ratio
        c = ratio * a
        size = self.line.friction * self.line.peak_of(self.force)
        sign = math.copysign(1.0, -self.tangential)
        return sign * size * (root_mean(x / a, length / a) - ratio * root_mean(x / c, length / c))


def press(line: Line) -> Pressed:
    """Press the disc in one step."""
    return read(line, line.pressed(MPI.COMM_SELF))


@dataclass(frozen=True)
class Push:
    """A pressed disc that is pushed sideways, to and fro."""

    line: Line  #: the problem
    #: a row a step, the first before any: where the core is (mm), normal and tangential force
    #: (N/mm), and work of friction in the step, the integral of -q ds (N mm per mm)
    steps: pd.DataFrame
    states: list[Pressed]  #: contact and reactions, step by step
    #: smallest work of friction at a point in a step, over mu p0 times the largest step's way
    least_work: float


def push(line: Line, turns: Sequence[float], step: float) -> Push:
    """Press a disc with friction on its own material, then push its core to and fro.

    It changes its direction at `turns`; they and the largest `step` are in units of mu times the
    approach, at which about the whole contact begins to slip: a half-plane gives way alike to
    normal and to tangential forces.
    """
    motion = line.pressed(MPI.COMM_SELF)
    contact, unit = motion.problem.contact, line.friction * line.approach()
    states, state = [read(line, motion)], contact.state()
    way, work, least = [0.0], [0.0], 0.0
    for start, end in pairwise([0.0, *turns]):
        for target in np.linspace(start, end, math.ceil(abs(end - start) / step - 1e-9) + 1)[1:]:
            motion.step([tags.LIMB], shift=(target * unit - way[-1], 0.0))
            states.append(read(line, motion))
            before, state = state, contact.state()
            slid = Slid.between(contact, before, state)
            least = min(least, float(slid.work.min()))
            work.append(float(contact.points.weight @ slid.work))
            way.append(target * unit)
    forces = [(each.force, each.tangential) for each in states]
    steps = pd.DataFrame(forces, columns=["force", "tangential"]).assign(way=way, work=work)
    return Push(line, steps, states, least / (line.friction * states[0].peak * step * unit))


def read(line: Line, motion: PrescribedMotion) -> Pressed:
    """Read contact and reactions at the present equilibrium, on one rank."""
    problem = motion.problem
    contact = problem.contact
    problem.set_unknowns(motion.x)
    law = contact.state().traction
    reaction, _ = problem.reaction(tags.TIBIA_MEDULLARY)
    position, weight = contact.deformed_points(), contact.points.weight
    total = weight @ law.pressure
    x = position[:, 0] - weight @ (law.pressure * position[:, 0]) / total
    values = {"x": x, "pressure": law.pressure, "shear": law.shear}
    edges = pd.DataFrame({name: edge_means(contact, each) for name, each in values.items()})
    by_edge = len(edges), -1
    edges["length"] = weight.reshape(by_edge).sum(axis=1)
    near = (position[:, 1] < -0.5 * line.radius).reshape(by_edge).all(axis=1)
    near &= edges.x.abs() < 2.0 * line.half_width
    moments = (float(weight @ (each * x**2)) for each in (law.pressure, np.abs(law.shear)))
    return Pressed(
        line=line,
        force=-float(reaction[1]),
        tangential=float(reaction[0]),
        total=float(total),
        moments=tuple(moments),
        peak=float(edges.pressure.max()),
        edges=edges[near].sort_values("x"),
        stick_half_width=0.5 * float(weight[law.status == STICK].sum()),
    )


def root_mean(x: Array, length: Array) -> FloatArray:
    """Mean of sqrt(1 - t^2), zero beyond 1, over the intervals of a length about x."""

    def integral(t: Array) -> Array:
        t = np.clip(t, -1.0, 1.0)
        return 0.5 * (t * np.sqrt(1.0 - t**2) + np.arcsin(t))

    mean: FloatArray = (integral(x + 0.5 * length) - integral(x - 0.5 * length)) / length
    return mean


def _pressure_lines(flat: Pressed, bore: Pressed) -> list[Curve]:
    x = np.linspace(-1.5, 1.5, 601)
    lines: list[Curve] = [
        (r.edges.x / r.exact_half_width, r.edges.pressure / r.line.peak_of(r.force), mark, name)
        for r, mark, name in ((flat, "o", "flat"), (bore, "x", "bore"))
    ]
    return [*lines, (x, np.sqrt(np.maximum(1.0 - x**2, 0.0)), "k-", "Hertz")]


def _shear_lines(partial: Pressed) -> list[Curve]:
    a, mu, edges = partial.exact_half_width, partial.line.friction, partial.edges
    scale = mu * partial.line.peak_of(partial.force)
    x = np.linspace(-1.5, 1.5, 1201)
    exact = partial.exact_shear(x * a, np.full_like(x, 1e-6 * a))
    return [
        (edges.x / a, edges.pressure * mu / scale, ".C7", None),
        (x, np.sqrt(np.maximum(1.0 - x**2, 0.0)), "-C7", "mu p"),
        (edges.x / a, edges.shear.abs() / scale, "o", "computed"),
        (x, np.abs(exact) / scale, "k-", "Cattaneo, Mindlin"),
    ]


def report() -> Section:
    """Hertz on a flat and in a bore, and partial slip: minutes."""
    presses = {
        name: [press(replace(line, divisions=n)) for n in DIVISIONS]
        for name, line in (("on a flat", Line()), ("in a bore", BORE))
    }
    partial = push(PARTIAL_SLIP, [SHARE], SHARE / STEPS).states[-1]
    errors = {
        name: pd.DataFrame([p.hertz_errors() for p in pressed], index=DIVISIONS)
        for name, pressed in presses.items()
    }
    hertz = {
        f"disc {name}: {what}": error
        for name, by_size in errors.items()
        for what, error in by_size.iloc[-1].items()
    }
    slip = {f"partial slip: {what}": error for what, error in partial.slip_errors().items()}
    convergence: list[Curve] = [
        (DIVISIONS, by_size[what].abs(), f"o{style}C{k}", f"{what}, {name}")
        for (name, by_size), style in zip(errors.items(), ("-", "--"), strict=True)
        for k, what in enumerate(("half-width", "peak pressure", "pressure profile"))
    ]
    flat, bore = (pressed[-1] for pressed in presses.values())
    sides, inside = ("element sides in a half-width", "relative error"), {"xlim": (-1.5, 1.5)}
    return Section(
        [*check_each(hertz, 0.01, JOHNSON), *check_each(slip, 0.02, CATTANEO)],
        {
            "hertz_pressure": curves(("x / a", "p / p0"), _pressure_lines(flat, bore), **inside),
            "hertz_convergence": curves(sides, convergence, **LOG),
            "partial_slip": curves(("x / a", "q / (mu p0)"), _shear_lines(partial), **inside),
        },
    )
