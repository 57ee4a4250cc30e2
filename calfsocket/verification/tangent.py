"""The assembled tangent, contact included: finite differences, parameters, Newton's order.

Rings of similar stiffness, so that no law is lost in the rounding errors of another; the socket is
larger than the limb, overlaps it, is turned, or is moved sideways.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

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
from calfsocket.verification.newton import probe_at
from calfsocket.verification.problems import prescribed_supports
from calfsocket.verification.report import LOG, Check, Curve, Section, check_each, curves, order
from calfsocket.verification.sampling import FloatArray

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


class Kind(NamedTuple):
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
    return prescribed_supports(rings.mesh(MPI.COMM_SELF), rings.laws, Contact())


def state(kind: Kind) -> tuple[Problem, PETSc.Vec]:
    """Make a state that is not an equilibrium: the rings with noise, their socket moved."""
    motion = ring(kind)
    motion.move([tags.SOCKET], kind.turn, (kind.shift, 0.0))
    problem, x = motion.problem, motion.x
    x.array[:] += NOISE * np.random.default_rng(4).normal(size=x.getLocalSize())
    x.array[problem.constrained] = problem.prescribed[problem.constrained]
    problem.set_unknowns(x)
    return problem, x


class Difference(NamedTuple):
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
def moved(problem: Problem, parameter: str, laws: Mapping[str, fem.Function]) -> Iterator[None]:
    """Move a parameter of contact or of the laws by `MOVE`, for the body."""
    contact, load = problem.contact, problem.load
    before, factor = contact.parameters, 1.0 + MOVE
    values = laws[parameter].x.array if parameter in laws else np.zeros(0)
    kept = values.copy()
    if parameter in laws:
        values *= factor
    elif parameter == "load":
        problem.load *= 1.0 - MOVE
    else:
        changed = {parameter: factor * getattr(before, parameter)}
        contact.parameters = before.model_copy(update=changed)
    yield
    values[:] = kept
    problem.load, contact.parameters = load, before


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
    laws = {parameter.name: parameter for parameter in problem.fields.parameters}
    should = {parameter: name in counts for parameter, counts in CONTACT_PARAMETERS.items()}
    if name == "mixed":
        should |= dict.fromkeys(laws, True)
    rows = []
    for parameter, moving in should.items():
        with moved(problem, parameter, laws):
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
    moving = moves[["residual", "tangent"]] > 0
    return int(moving.eq(moves["should"] == "moves", axis=0).all(axis=1).sum())


RING = TurnedRing(overclosure=0.2, h=2.8)

EQUILIBRIA: dict[str, tuple[float, Sequence[tuple[float, float]], frozenset[int]]] = {
    "stick": (0.4, [(0.5, 0.0)], frozenset({STICK})),
    "slip": (0.4, [(0.5, 0.0), (1.0, 0.0), (1.0, 0.0)], frozenset({SLIP})),
    "mixed": (0.1, [(0.0, 0.1)] * 4, frozenset({OPEN, STICK, SLIP})),
}
"""Coefficient of friction; steps of the socket, turned by a share of the turn of first slip and
moved sideways by mm; contact statuses that come of it."""


def equilibrium_probe(name: str) -> tuple[pd.DataFrame, set[int]]:
    """Press the rings of `friction`, move the socket, and probe Newton's method there.

    Along the last change of the unknowns; the contact statuses are returned, too.
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


DIRECTIONS = 4


def report() -> Section:
    """Compare with finite differences, move the parameters, measure the order."""
    errors = {}
    for name, kind in KINDS.items():
        problem, x = state(kind)
        directions = (random_direction(problem, x, k) for k in range(DIRECTIONS))
        errors[f"{name}: tangent in {DIRECTIONS} directions"] = max(
            difference(problem, x, direction).error for direction in directions
        )
    moves = parameter_moves()
    probes = {name: equilibrium_probe(name)[0] for name in EQUILIBRIA}
    orders = {f"{name}: Newton's order": order(p.before, p.after) for name, p in probes.items()}
    lines: list[Curve] = [(p.before, p.after, "o-", name) for name, p in probes.items()]
    before, after = probes["mixed"].before, probes["mixed"].after
    lines.append((before, 2.0 * after[0] * (before / before[0]) ** 2, "k--", "slope 2"))
    return Section(
        [
            *check_each(errors, 1e-6, "central differences of the residual"),
            Check(
                "parameters that move residual and tangent where they should, and only there",
                as_it_should(moves),
                len(moves),
                "the law of contact",
                rule="exactly",
            ),
            *check_each(orders, 1.9, "2", rule="at least"),
        ],
        {
            "newton_order": curves(
                ("|F| before the iteration, N/mm", "|F| after it, N/mm"), lines, **LOG
            )
        },
        {"moves": moves},
    )
