r"""The assembled tangent, contact included.

Rings of vessel, muscle, fascia and skin lie in a soft socket, of similar stiffness so that no law
is lost in the rounding errors of another, and random displacements and pressures are added. The
socket is larger than the limb (all points open), overlaps it (all stick), is also turned (all
slip), or is moved sideways (open, stick and slip at once).

**Finite differences.** The tangent times a random direction is compared with central differences of
the residual. No point that is compared changes its status between the two.

**Parameters.** Residual and tangent change with a parameter in the states where they depend on it,
and are identical to the last bit in the others: friction has no effect while all points stick, the
tangential stiffness none while all slip, and no contact parameter has any while all are open.

**Newton's method.** The order of convergence at an equilibrium of each kind, on the rings of
`friction`: |F| after one iteration against |F| before it, from three distances (see `newton`).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.friction import OPEN, SLIP, STICK
from calfsocket.contact.parameters import Contact
from calfsocket.materials.laws import Hencky
from calfsocket.materials.tissues import FASCIA, MUSCLE, SKIN, VESSEL
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes import tags
from calfsocket.verification.friction import TurnedRing
from calfsocket.verification.newton import Probe, probe_at
from calfsocket.verification.problems import held_socket
from calfsocket.verification.report import LOG, Check, Curve, Section, Table, curves

FloatArray = NDArray[np.float64]

OVERLAP = 0.2
"""mm."""

LAYERED = TurnedRing(
    layers=(
        ("vessel", 10.0, 14.0, VESSEL),
        ("muscle", 14.0, 22.0, MUSCLE),
        ("fascia", 22.0, 24.0, FASCIA),
        ("skin", 24.0, 28.0, SKIN),
        (tags.SOCKET, 28.0, 32.0, Hencky(e=1.0, nu=0.3)),
    ),
    h=4.0,
)

NOISE = 1e-3
"""Of the unknowns in a state; displacements in mm, pressures over the shear modulus."""

DIFFERENCE = 1e-7
"""Step of the finite differences, of unknowns of size 1."""


@dataclass(frozen=True)
class Kind:
    """How a state is made and what it must be."""

    overlap: float  #: by which the socket is smaller than the limb, mm
    turn: float  #: of the socket, rad
    shift: float  #: of the socket along x, mm
    status: frozenset[int]  #: contact statuses of its points


KINDS = {
    "open": Kind(-0.5, 0.0, 0.0, frozenset({OPEN})),
    "stick": Kind(OVERLAP, 0.0, 0.0, frozenset({STICK})),
    "slip": Kind(OVERLAP, 0.02, 0.0, frozenset({SLIP})),
    "mixed": Kind(OVERLAP, 0.0, 0.3, frozenset({OPEN, STICK, SLIP})),
}


def ring(kind: Kind) -> PrescribedMotion:
    """Return the rings, to be moved by their socket's outer face."""
    rings = replace(LAYERED, overclosure=kind.overlap)
    return held_socket(rings.mesh(MPI.COMM_SELF), rings.laws, Contact())


def state(kind: Kind) -> tuple[Problem, PETSc.Vec]:
    """Make a state that is not an equilibrium: the rings with noise, their socket moved."""
    motion = ring(kind)
    motion.move([tags.SOCKET], kind.turn, (kind.shift, 0.0))
    problem, x = motion.problem, motion.x
    x.array[:] += NOISE * np.random.default_rng(4).normal(size=x.getLocalSize())
    x.array[problem.constrained] = problem.prescribed[problem.constrained]
    problem.set_unknowns(x)
    return problem, x


# -- finite differences ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Difference:
    """A tangent against finite differences of the residual."""

    error: float  #: norm of the difference, relative
    status: NDArray[np.int64]  #: (n,) contact status of the points
    switched: int  #: points whose status differs between the two ends of the difference


def difference(
    problem: Problem, x: PETSc.Vec, direction: FloatArray, step: float = DIFFERENCE
) -> Difference:
    """Compare the tangent at x, times a direction, with a central difference of the residual."""
    A, f = problem.create_matrix(), x.duplicate()
    ends, status = [], []
    for sign in (1.0, -1.0):
        moved, end = x.copy(), x.duplicate()
        moved.array[:] += sign * step * direction
        problem.residual(moved, end)
        ends.append(end.array.copy())
        status.append(problem.contact.state().traction.status)
    problem.tangent(x, A)
    along = x.duplicate()
    along.array[:] = direction
    A.mult(along, f)
    exact = (ends[0] - ends[1]) / (2.0 * step)
    return Difference(
        error=float(np.linalg.norm(f.array - exact) / np.linalg.norm(exact)),
        status=problem.contact.state().traction.status,
        switched=int(np.count_nonzero(status[0] != status[1])),
    )


def random_direction(problem: Problem, x: PETSc.Vec, seed: int = 5) -> FloatArray:
    """Return a direction of size 1, zero where unknowns are constrained."""
    direction = np.random.default_rng(seed).normal(size=x.getLocalSize())
    direction[problem.constrained] = 0.0
    return direction


# -- parameters -----------------------------------------------------------------------------------

CONTACT_PARAMETERS: dict[str, frozenset[str]] = {
    "gamma": frozenset({"stick", "slip", "mixed"}),
    "gamma_t": frozenset({"stick", "mixed"}),
    "friction": frozenset({"slip", "mixed"}),
    "load": frozenset({"stick", "slip", "mixed"}),
}
"""States in which each parameter of contact counts."""

MOVE = 0.1
"""Of a parameter, relative."""


@contextmanager
def moved(problem: Problem, parameter: str) -> Iterator[None]:
    """Move a parameter of contact or of the laws by `MOVE`, for the body."""
    contact = problem.contact
    load, before = problem.load, contact.parameters
    factor = 1.0 + MOVE
    if parameter == "load":
        problem.load *= 1.0 - MOVE
    elif parameter in CONTACT_PARAMETERS:
        changed = {parameter: factor * getattr(before, parameter)}
        contact.parameters = before.model_copy(update=changed)
    else:
        values = law_parameters(problem)[parameter].x.array
        kept, values[:] = values.copy(), factor * values
    yield
    problem.load, contact.parameters = load, before
    if parameter not in CONTACT_PARAMETERS:
        values[:] = kept


def law_parameters(problem: Problem) -> dict[str, fem.Function]:
    """Return the parameters of the laws, by name."""
    return {parameter.name: parameter for parameter in problem.fields.parameters}


def moves_of(name: str) -> list[dict[str, object]]:
    """Move each parameter of contact, and in the mixed state each of the laws, in a state.

    A row has parameter, state, the relative changes of residual and of tangent times a direction,
    and whether the two should move.
    """
    problem, x = state(KINDS[name])
    A, direction = problem.create_matrix(), x.duplicate()
    direction.array[:] = random_direction(problem, x)

    def both() -> tuple[PETSc.Vec, PETSc.Vec]:
        residual, along = x.duplicate(), x.duplicate()
        problem.residual(x, residual)
        problem.tangent(x, A)
        A.mult(direction, along)
        return residual, along

    before = both()
    should = {parameter: name in counts for parameter, counts in CONTACT_PARAMETERS.items()}
    if name == "mixed":
        should |= dict.fromkeys(law_parameters(problem), True)
    rows = []
    for parameter, moving in should.items():
        with moved(problem, parameter):
            f, g = (
                (now - then).norm() / then.norm() for now, then in zip(both(), before, strict=True)
            )
        changes = {"residual": f, "tangent": g, "should": "moves" if moving else "stays"}
        rows.append({"parameter": parameter, "state": name, **changes})
    return rows


def parameter_moves() -> pd.DataFrame:
    """Move the parameters in every state."""
    return pd.DataFrame(row for name in KINDS for row in moves_of(name))


def as_it_should(moves: pd.DataFrame) -> int:
    """Count the parameters and states where both move, or neither does, as they should."""
    should = moves["should"] == "moves"
    return int((((moves["residual"] > 0) == should) & ((moves["tangent"] > 0) == should)).sum())


# -- Newton's method ------------------------------------------------------------------------------


RING = TurnedRing(overclosure=0.2, h=2.8)

EQUILIBRIA: dict[str, tuple[float, Sequence[tuple[float, float]], frozenset[int]]] = {
    "stick": (0.4, [(0.5, 0.0)], frozenset({STICK})),
    "slip": (0.4, [(0.5, 0.0), (1.0, 0.0), (1.0, 0.0)], frozenset({SLIP})),
    "mixed": (0.1, [(0.0, 0.1)] * 4, frozenset({OPEN, STICK, SLIP})),
}
"""Coefficient of friction; steps of the socket, turned by a share of the turn of first slip and
moved sideways by mm; contact statuses that come of it."""


def equilibrium_probe(name: str) -> tuple[Probe, set[int]]:
    """Press the rings of `friction`, move the socket, and probe Newton's method there.

    Returns
    -------
    probe, status
        The probe along the last change of the unknowns, and the contact statuses.
    """
    friction, steps, _ = EQUILIBRIA[name]
    ring = replace(RING, friction=friction)
    motion = ring.pressed(MPI.COMM_SELF)
    problem, x = motion.problem, motion.x
    for turn, shift in steps:
        before = x.array.copy()
        motion.step([tags.SOCKET], turn * ring.slip_turn, (shift, 0.0))
    problem.set_unknowns(x)
    status = {int(number) for number in problem.contact.state().traction.status}
    direction = x.array_r - before
    direction[problem.constrained] = 0.0
    return probe_at(problem, x, direction), status


# -- report ---------------------------------------------------------------------------------------

DIRECTIONS = 4


def report() -> Section:
    """Compare with finite differences, move the parameters, measure the order."""
    checks = []
    for name, kind in KINDS.items():
        problem, x = state(kind)
        found = [
            difference(problem, x, random_direction(problem, x, k)).error for k in range(DIRECTIONS)
        ]
        label = f"{name}: tangent in {DIRECTIONS} directions"
        checks.append(Check(label, max(found), 1e-6, "central differences of the residual"))
    moves = parameter_moves()
    label = "parameters that move residual and tangent where they should, and only there"
    source = "the law of contact"
    checks.append(Check(label, as_it_should(moves), len(moves), source, rule="exactly"))
    probes = {name: equilibrium_probe(name)[0] for name in EQUILIBRIA}
    checks += [
        Check(f"{name}: Newton's order", probe.order, 1.9, "2", rule="at least")
        for name, probe in probes.items()
    ]
    lines: list[Curve] = [(probe.before, probe.after, "o-", name) for name, probe in probes.items()]
    before, after = probes["mixed"].before, probes["mixed"].after
    lines.append((before, 2.0 * after[0] * (before / before[0]) ** 2, "k--", "slope 2"))
    return Section(
        "The tangent",
        __doc__ or "",
        checks,
        [
            curves(
                "newton_order",
                "One iteration from three distances of an equilibrium.",
                ("|F| before the iteration, N/mm", "|F| after it, N/mm"),
                lines,
                **LOG,
            )
        ],
        [
            Table(
                f"Relative change when a parameter grows by {MOVE:.0%}; in the states where it "
                "plays no part it must be zero.",
                moves,
                2,
            )
        ],
    )
