"""Why a load step failed: what the last equilibrium shows, and the last iterate of the step.

Each finding says what, where and how much, and what to do about it. The first of them is the likely
cause, so that its advice is given.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.friction import OPEN, SLIP, STATUS_NAMES
from calfsocket.materials.law import Law
from calfsocket.mechanics.newton import Newton, NewtonResult
from calfsocket.mechanics.problem import Problem, Site
from calfsocket.meshes import tags
from calfsocket.meshes.quality import determinant

FloatArray = NDArray[np.float64]

SOFTENED = 0.5
"""Share of a law's initial stiffness below which it has softened; those of the paper stiffen."""

CRUSHED = 0.2
"""Volume ratio J below which a cell is nearly flat: a few more per cent of strain invert it."""

MOVING = 0.5
"""Share of the step's largest displacement that is the socket's as a rigid body when it slides."""

LANCZOS = 30
"""Iterations of the search for a negative mode: it need not be accurate to show where."""

SHOWN = 2
"""Findings that are shown at most: the likely cause, and what else is seen or follows from it."""

_STEP = 1e-5
"""Logarithmic strain of a central difference; half of the digits remain."""


@dataclass(frozen=True)
class Finding:
    """What stands in the way of an equilibrium, and what helps."""

    text: str
    advice: str


@dataclass(frozen=True)
class Grip:
    """How a socket that nothing else holds sits on the limb.

    Attributes
    ----------
    share : float
        Part of the skin's outline in contact.
    slipping : float
        Part of that contact that slips.
    opening : float
        Largest angle without contact between two neighbouring directions of contact pressure, deg:
        from 180 on the pressures cannot balance each other.
    between : (float, float)
        Where it touches: from and to which polar angle, counter-clockwise, deg.
    """

    share: float
    slipping: float
    opening: float
    between: tuple[float, float]


@dataclass(frozen=True)
class State:
    """What decides whether a state can bear more load.

    Attributes
    ----------
    load : float
        Its load.
    volume_ratio : float
        Smallest J, at `flattest`.
    stiffness : float
        Smallest share of its initial stiffness that a law has, at `softest`.
    stretches : (float, float)
        Principal stretches there.
    negative_modes : int
        Those of the tissues' tangent with contact as a constraint.
    waving : Site, optional
        Where the most negative of them moves most.
    grip : Grip, optional
        Of a floating socket.
    """

    load: float
    volume_ratio: float
    flattest: Site
    stiffness: float
    softest: Site
    stretches: tuple[float, float]
    negative_modes: int
    waving: Site | None
    grip: Grip | None


@dataclass(frozen=True)
class Motion:
    """How a socket moves as a rigid body in a load step.

    Attributes
    ----------
    shift : float
        Length of its translation, mm.
    turn : float
        Angle about its middle, counter-clockwise, deg.
    share : float
        Its largest displacement that is rigid, as a share of the largest one of all bodies.
    """

    shift: float
    turn: float
    share: float

    def __str__(self) -> str:
        return f"{self.shift:.2g} mm and {self.turn:.2g} deg in this step"


@dataclass(frozen=True)
class Iterate:
    """Where Newton's method was when it gave up.

    Attributes
    ----------
    unbalanced : str
        Region with the largest residual.
    state : State, optional
        None where it ran away to unknowns or forces that are not finite.
    motion : Motion, optional
        Of a floating socket, since the equilibrium before.
    unsettled : int
        Points of the skin that one more iteration opens, closes, sticks, slides or brings to
        another edge of the socket.
    points : int
        All points of the skin.
    """

    unbalanced: str
    state: State | None = None
    motion: Motion | None = None
    unsettled: int = 0
    points: int = 0


def observe(newton: Newton, problem: Problem) -> State:
    """Return what the present unknowns show, which are finite (collective)."""
    problem.set_unknowns(newton.x)
    gradients = problem.elastic_gradients()
    J = determinant(gradients)
    volume_ratio, flattest = problem.smallest(J.min(axis=1, initial=np.inf))
    stiffness, stretches = _stiffness_in_cells(problem, gradients, J)
    least, softest = problem.smallest(stiffness)
    # The unloaded state is stable, but for the free motions of a socket that touches nothing yet.
    negative, waving = _negative_modes(newton, problem) if problem.load > 0 else (0, None)
    return State(
        load=problem.load,
        volume_ratio=volume_ratio,
        flattest=flattest,
        stiffness=least,
        softest=softest,
        stretches=_at_smallest(problem.comm, stiffness, stretches),
        negative_modes=negative,
        waving=waving,
        grip=_grip(problem) if _floats(problem) else None,
    )


def last_iterate(newton: Newton, problem: Problem, equilibrium: PETSc.Vec) -> Iterate:
    """Return what the last iterate of a step that failed shows; it is lost (collective)."""
    if not np.isfinite(newton.x.norm()):
        equilibrium.copy(newton.x)  # at the load of the step, it is not balanced
        return Iterate(problem.least_balanced_region(newton.x))
    unbalanced, residual = problem.least_balanced_region(newton.x), newton.x.duplicate()
    problem.residual(newton.x, residual)
    if not np.isfinite(residual.norm()):  # the tangent is not, either
        return Iterate(unbalanced)
    state = observe(newton, problem)
    if not problem.has_contact:
        return Iterate(unbalanced, state)
    motion = _rigid_motion(problem, newton.x, equilibrium) if state.grip else None
    before = _contact_of_points(problem)
    newton.iterate()
    changed = np.zeros_like(before, dtype=bool)
    if np.isfinite(newton.x.norm()):
        problem.set_unknowns(newton.x)
        changed = before != _contact_of_points(problem)
    unsettled, points = problem.comm.allreduce(np.array([changed.sum(), changed.size]))
    return Iterate(unbalanced, state, motion, int(unsettled), int(points))


def explain(
    equilibrium: State, load: float, target: float, result: NewtonResult, iterate: Iterate
) -> str:
    """Say in one line why there is no equilibrium between two loads, and what to do."""
    found = list(islice(findings(equilibrium, iterate), SHOWN)) or [UNEXPLAINED]
    what = ", and ".join(finding.text for finding in found)
    norms = [f"{norm:.1e}" for norm in result.history]
    shown = norms if len(norms) <= 5 else [*norms[:2], "...", *norms[-2:]]
    return (
        f"no equilibrium between load {load:.4f} and {target:.4f}: {what}; "
        f"{found[0].advice} (Newton's method: {result.reason} after {result.iterations} "
        f"iterations, residual {' '.join(shown)} N/mm, most of it in {iterate.unbalanced})"
    )


UNEXPLAINED = Finding(
    "no tissue is crushed or buckles, no law has softened, and contact settles",
    "try smaller load steps (steps.smallest), another mesh size, or "
    "-calfsocket_snes_linesearch_type l2",
)


def findings(equilibrium: State, iterate: Iterate) -> Iterator[Finding]:
    """Yield what stands in the way, the likely cause first."""
    states = [state for state in (equilibrium, iterate.state) if state is not None]
    grip = states[-1].grip
    motion = iterate.motion
    if grip is not None and grip.opening >= 180.0:
        yield Finding(
            f"nothing holds the socket: it {_touching(grip)}"
            + (f" and moves by {motion}" if motion else ""),
            "a floating socket must press on the limb from all sides: make it smaller or move "
            'it, or use socket_support = "outer-fixed"',
        )
    soft = [state for state in states if state.stiffness <= SOFTENED]
    if soft:
        larger, smaller = soft[0].stretches
        yield Finding(
            f"the law of {soft[0].softest} has softened to {100 * soft[0].stiffness:.0f} % of its "
            f"initial stiffness at load {soft[0].load:.4f}, stretched to {larger:.3f} and "
            f"{smaller:.3f}",
            "use a law that is stable at these stretches, or a socket that presses less",
        )
    # A mode that moves the socket most is its motion as a rigid body.
    unstable = [
        state
        for state in states
        if state.negative_modes > 0
        and not (state.waving is not None and state.waving.region == tags.SOCKET)
    ]
    if unstable:
        kind = "equilibrium" if unstable[0] is equilibrium else "last iterate"
        count, site = unstable[0].negative_modes, unstable[0].waving
        yield Finding(
            f"tissue buckles: the {kind} at load {unstable[0].load:.4f} has {count} negative "
            f"mode{'s' if count > 1 else ''}{f', with most motion in {site}' if site else ''}",
            "take smaller load steps (steps.largest = 0.05), a socket that presses less there, or "
            "tissues whose stiffness differs less",
        )
    flat = [state for state in states if state.volume_ratio <= CRUSHED]
    if flat:
        ratio = flat[-1].volume_ratio
        how = "turned inside out" if ratio <= 0 else f"compressed to {100 * ratio:.2g} % of itself"
        yield Finding(
            f"{flat[-1].flattest} is {how} at load {flat[-1].load:.4f}",
            "use a socket that presses less there, or a law that resists compression more (a "
            "larger nu, a smaller d1)",
        )
    if grip is not None and grip.opening < 180.0 and motion and motion.share > MOVING:
        yield Finding(
            f"the socket moves as a rigid body, by {motion}, with {100 * grip.slipping:.0f} % of "
            "its contact slipping",
            "take smaller load steps (steps.first, steps.smallest), more friction, or "
            'socket_support = "outer-fixed"',
        )
    if iterate.state is None:
        yield Finding(
            "Newton's method runs away to displacements or forces that are not finite",
            UNEXPLAINED.advice,
        )
    if iterate.unsettled:
        yield Finding(
            f"contact does not settle: {iterate.unsettled} of the skin's {iterate.points} points "
            "open, close, stick, slip or change their partner in an iteration",
            "take smaller load steps (steps.first, steps.smallest), another mesh size, or "
            "-calfsocket_snes_linesearch_type l2",
        )


def _touching(grip: Grip) -> str:
    if grip.share == 0.0:
        return "touches the limb nowhere"
    first, last = grip.between
    return f"touches {100 * grip.share:.2g} % of the skin, from {first:.0f} to {last:.0f} deg"


# -- laws -----------------------------------------------------------------------------------------


def stiffness_share(law: Law, stretches: FloatArray) -> FloatArray:
    """Stiffness of a law at principal stretches, as a share of its initial one; (n,).

    The stretches, (2, n), are those in the plane. The stiffness is that against pure shear on top
    of them, d(t1 - t2)/de with e1 = e = -e2, of Kirchhoff stresses t and logarithmic strains; it is
    4 mu0 at first. A law that is not convex in the logarithmic strains comes to 0, and loses its
    stability there.
    """
    stretch = np.stack([*stretches, np.ones_like(stretches[0])])

    def difference(strain: float) -> FloatArray:
        shear = np.exp([[strain], [-strain], [0.0]])
        t = law.kirchhoff(stretch * shear)
        return np.asarray(t[0] - t[1])

    slope = (difference(_STEP) - difference(-_STEP)) / (2.0 * _STEP)
    return np.asarray(slope / (4.0 * law.initial_shear_modulus))


def _stiffness_in_cells(
    problem: Problem, gradients: FloatArray, J: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smallest `stiffness_share` of each owned cell, (m,), and the stretches there, (m, 2)."""
    stretches = np.linalg.svd(gradients, compute_uv=False)
    share = np.full(J.shape, np.inf)
    regions = problem.section.cell_regions()[: len(J)]
    for name, tag in problem.section.regions.items():
        # What is turned inside out has no stretches.
        there = (regions == tag)[:, None] & (J > 0)
        if there.any():
            with np.errstate(over="ignore", invalid="ignore"):  # of an iterate that runs away
                found = stiffness_share(problem.region_laws[name], stretches[there].T)
            share[there] = np.where(np.isfinite(found), found, np.inf)
    if not share.size:
        return np.zeros(0), np.zeros((0, 2))
    point = share.argmin(axis=1)
    cells = np.arange(len(share))
    return share[cells, point], stretches[cells, point]


def _at_smallest(comm: MPI.Comm, keys: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Two values of the cell with the smallest key (collective)."""
    mine = (np.inf, 0.0, 0.0)
    if len(keys):
        cell = int(np.argmin(keys))
        mine = (float(keys[cell]), float(values[cell, 0]), float(values[cell, 1]))
    _, first, second = min(comm.allgather(mine))
    return first, second


# -- stability ------------------------------------------------------------------------------------


def _negative_modes(newton: Newton, problem: Problem) -> tuple[int, Site | None]:
    """Count the negative modes; return where the most negative one moves most (collective)."""
    negative, factor = newton.stability()
    site = None
    if negative > 0:
        mode = _most_negative_mode(newton, problem, factor)
        if mode is not None:
            site = _largest_motion(problem, mode)
    factor.destroy()
    return negative, site


def _most_negative_mode(newton: Newton, problem: Problem, factor: PETSc.PC) -> FloatArray | None:
    """Owned unknowns of a negative mode; None where the search finds none (collective).

    Lanczos' method for the smallest 1/lambda of S u = lambda M u, M the identity on displacements.
    Among negative modes that is the one nearest to zero, which has just become negative.
    """
    comm, unknowns = problem.comm, newton.tangent.getPythonContext().unknowns
    moves = _is_displacement(problem)[unknowns].astype(float)
    b, x = factor.getOperators()[0].createVecs()

    def dot(u: FloatArray, v: FloatArray) -> Any:
        return comm.allreduce(u @ v)

    basis = np.zeros((LANCZOS + 1, len(unknowns)))
    projected = np.zeros((LANCZOS, LANCZOS))
    vector = np.random.default_rng(comm.rank).standard_normal(len(unknowns)) * moves  # any will do
    basis[0] = vector / np.sqrt(dot(vector, vector))
    for k in range(LANCZOS):
        b.array[:] = basis[k]
        factor.apply(b, x)
        vector = x.array_r * moves
        for _ in range(2):  # the second time removes what rounding has left
            part = dot(basis[: k + 1], vector)
            projected[: k + 1, k] += part
            vector = vector - part @ basis[: k + 1]
        length = float(np.sqrt(dot(vector, vector)))
        if not 0.0 < length < np.inf:  # the matrix is singular
            return None
        basis[k + 1] = vector / length
    values, turn = np.linalg.eigh(projected, "U")
    if values[0] >= 0.0:
        return None
    mode = np.zeros(problem.V.dofmap.index_map.size_local)
    mode[unknowns] = turn[:, 0] @ basis[:LANCZOS]
    return mode


def _is_displacement(problem: Problem) -> NDArray[np.bool_]:
    """Whether a local unknown is one of the displacement."""
    found = np.zeros(len(problem.w.x.array), dtype=bool)
    for component in range(2):
        found[problem.V.sub(0).sub(component).dofmap.list] = True
    return found


def _largest_motion(problem: Problem, owned: FloatArray) -> Site:
    """Where the displacement of owned unknowns is largest (collective)."""
    motion = fem.Function(problem.V)
    motion.x.array[: len(owned)] = owned
    motion.x.scatter_forward()
    cells = problem.section.mesh.topology.index_map(2).size_local
    squares = sum(
        motion.x.array[problem.V.sub(0).sub(component).dofmap.list[:cells]] ** 2
        for component in range(2)
    )
    return problem.smallest(-np.max(squares, axis=1, initial=0.0))[1]


# -- the socket -----------------------------------------------------------------------------------


def _floats(problem: Problem) -> bool:
    """Whether there is a socket that only contact holds (collective)."""
    if not problem.has_contact or tags.SOCKET not in problem.section.regions:
        return False
    dofs = problem.body([tags.SOCKET]).dofs
    return not problem.comm.allreduce(bool(np.isin(dofs, problem.constrained).any()), op=MPI.LOR)


def _grip(problem: Problem) -> Grip:
    """Return how the socket sits on the limb (collective)."""
    contact = problem.contact
    state = contact.state()
    status, weight = state.traction.status, contact.points.weight
    closed = status != OPEN
    sums = [weight.sum(), weight[closed].sum(), weight[status == SLIP].sum()]
    whole, touching, slipping = problem.comm.allreduce(np.array(sums))
    angles = [
        np.concatenate(problem.comm.allgather(np.degrees(np.arctan2(v[closed, 1], v[closed, 0]))))
        for v in (state.projection.normal, contact.deformed_points())
    ]
    directions, places = angles
    first, opening = _largest_opening(places)
    return Grip(
        share=float(touching / whole),
        slipping=float(slipping / touching) if touching else 0.0,
        opening=_largest_opening(directions)[1],
        between=(first, (first - opening) % 360.0),
    )


def _contact_of_points(problem: Problem) -> NDArray[np.int64]:
    """Return a number for the status and the partner of each skin point (collective)."""
    state = problem.contact.state()
    return len(STATUS_NAMES) * state.projection.edge + state.traction.status


def _rigid_motion(problem: Problem, x: PETSc.Vec, before: PETSc.Vec) -> Motion:
    """Return the socket's motion from one vector of unknowns to another (collective)."""
    difference = fem.Function(problem.V)
    owned = problem.V.dofmap.index_map.size_local
    difference.x.array[:owned] = (x.array_r - before.array_r)[:owned]
    difference.x.scatter_forward()
    socket, everything = problem.body([tags.SOCKET]), problem.body()
    moved = difference.x.array[socket.dofs]
    one, position = socket.shift, socket.reference
    # Columns: two translations and a small turn.
    basis = np.zeros((*moved.shape, 3))
    basis[:, 0, 0], basis[:, 1, 1] = one[:, 0], one[:, 1]
    basis[:, 0, 2], basis[:, 1, 2] = -position[:, 1], position[:, 0]
    rows = basis.reshape(-1, 3)
    normal = problem.comm.allreduce(rows.T @ rows)
    fitted = np.linalg.solve(normal, problem.comm.allreduce(rows.T @ moved.ravel()))
    largest = [
        problem.comm.allreduce(np.abs(values).max(initial=0.0), op=MPI.MAX)
        for values in (basis @ fitted, difference.x.array[everything.dofs])
    ]
    return Motion(
        shift=float(np.hypot(*fitted[:2])),
        turn=float(np.degrees(fitted[2])),
        share=float(largest[0] / largest[1]) if largest[1] else 0.0,
    )


def _largest_opening(angles: FloatArray) -> tuple[float, float]:
    """Where the largest gap between directions ends, and how wide it is, deg."""
    if not len(angles):
        return 0.0, 360.0
    ordered = np.sort(angles % 360.0)
    gaps = np.diff(np.append(ordered, ordered[0] + 360.0))
    widest = int(np.argmax(gaps))
    return float(ordered[(widest + 1) % len(ordered)]), float(gaps[widest])
