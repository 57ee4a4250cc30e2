"""Follows a limb in its donned socket through stages of loading, and finds what it cannot bear."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.friction import SLIP
from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.resultants import Resultants, Slid, resultants
from calfsocket.io.errors import ConvergenceError
from calfsocket.mechanics.carrier import COMPONENTS, FREE, Carrier, Control
from calfsocket.mechanics.loading import Carried, Stage, Targets
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper, LoadSteps, Milestone
from calfsocket.meshes import tags
from calfsocket.meshes.frame import Frame

FloatArray = NDArray[np.float64]

SMALLEST = 0.02
"""Smallest step, as a share of a stage's."""

LONGEST_WAY = 0.05
"""Way of a whole force by the tangent at most, over the frame's radius: a socket that nothing but
its shape keeps from turning has next to no stiffness."""

SHORTEST = 1e-3
"""Smallest step of a prescribed way, as a share of a stage's step by the tangent."""

CUTBACK, GROWTH, FEW_ITERATIONS = 0.4, 1.5, 8
"""Factors on steps of a prescribed way: after a failure, and after few iterations."""

LIMIT = 1e-3
"""Relative rise of the force over the last part of the way below which it has come to its limit."""

LAST_PART = 0.2
"""Share of the way gone that the last part of it is, over which `LIMIT` counts."""

MOST_STEPS, MOST_PER_STEP = 50, 5
"""Steps along a prescribed way at most, failed ones too: so many, and as many again for each step
that the stage asks for."""


@dataclass(frozen=True)
class Point:
    """An equilibrium on the way through the stages.

    Attributes
    ----------
    stage : str
        Name of the stage that leads here.
    force : (3,) float
        Force on the socket along x and y, N/mm, and moment, N mm/mm.
    place : (3,) float
        Its translation, mm, and rotation, rad, since it was donned.
    volume : mapping of str to float
        Change of volume by tissue, as a share.
    pressing : float
        Integral of contact pressure over the skin, N/mm.
    slipping : float
        Share of the skin in contact that slips, by length.
    dissipated : float
        Work of friction since the socket was donned, N mm/mm.
    applied : float
        Work of force and moment since then, N mm/mm: of their means in each step.
    iterations : int
        Newton iterations of the step.
    imbalance : float
        Largest force out of balance of the limb and of the socket, moments over the skin's mean
        distance from the origin, as a share of `pressing`.
    """

    stage: str
    force: FloatArray
    place: FloatArray
    volume: Mapping[str, float]
    pressing: float
    slipping: float
    dissipated: float
    applied: float
    iterations: int
    imbalance: float


@dataclass(frozen=True)
class Limit:
    """A force that the limb in its socket cannot bear, or that it was not followed to.

    Attributes
    ----------
    stage : str
        The stage.
    force : (3,) float
        The largest force along that of the stage, N/mm, and moment, N mm/mm.
    asked : (3,) float
        What the stage asked for.
    still_rises : bool
        Whether it still rose there, where no further equilibrium was found.
    """

    stage: str
    force: FloatArray
    asked: FloatArray
    still_rises: bool = False


@dataclass(frozen=True)
class StageMilestone:
    """All that a stage needs to continue from an equilibrium as if it had never stopped.

    Attributes
    ----------
    stage : str
        Its name.
    ways : int
        How many of its ways (`legs`) are done.
    way : Milestone
        Where on the next one it is; the load is the share of it.
    held : (3,) bool
        Components whose place is held, when that way began.
    force, place : (3,) float
        Force and place then, as of `Point`.
    volume : mapping of str to float
        Change of volume then.
    control : Control, optional
        What is prescribed in the equilibrium, where the socket is carried.
    points : tuple of Point
        All equilibria since the donned state.
    limits : tuple of Limit
        Those found so far.
    steps : tuple of LoadStep
        Load steps of the stage.
    """

    stage: str
    ways: int
    way: Milestone
    held: NDArray[np.bool_]
    force: FloatArray
    place: FloatArray
    volume: Mapping[str, float]
    control: Control | None
    points: tuple[Point, ...]
    limits: tuple[Limit, ...]
    steps: tuple[LoadStep, ...]


class StageStepper:
    """Leads a donned problem through stages of loading.

    Parameters
    ----------
    donned : LoadStepper
        That has brought the load to 1.
    axes : Frame
        Where lateral and anterior are.
    tissues : mapping of region name to str
        Tissue of each region, for changes of volume.
    carried : {"frame", "evenly"}, optional
        What carries the socket's outer face from now on: a rigid frame, or an even load; by default
        nothing does.
    on_iteration, on_step : callable, optional
        As of `LoadStepper`; the load is the share of the way to the stage's values.
    on_milestone : callable, optional
        Called with each `StageMilestone` on every rank; its vectors change when the run continues.

    Attributes
    ----------
    problem : Problem
        In its last equilibrium.
    stepper : LoadStepper
        Brings it through each way.
    points : list of Point
        All equilibria, the donned one first.
    limits : list of Limit
        Those found.
    steps : list of LoadStep
        Load steps of the stage, failed ones too.
    """

    def __init__(
        self,
        donned: LoadStepper,
        axes: Frame,
        tissues: Mapping[str, str] | None = None,
        carried: Carried | None = None,
        on_iteration: Callable[[float, int, float], None] | None = None,
        on_step: Callable[[LoadStep], None] | None = None,
        on_milestone: Callable[[StageMilestone], None] | None = None,
    ) -> None:
        self._on_step, self.on_milestone = on_step, on_milestone
        self.problem: Problem = donned.problem
        self._axes, self._tissues = axes, dict(tissues or {})
        state = self.problem.contact.state()
        if carried:
            self.problem.carry(tags.SOCKET_OUTER, evenly=carried == "evenly")
        self.stepper = LoadStepper(
            self.problem, (1.0,), on_iteration, self._take_step, on_milestone=self._arrive
        )
        unknowns = donned.newton.x.array_r
        self.x.array[: len(unknowns)] = unknowns
        self._held: NDArray[np.bool_] = np.zeros(COMPONENTS, dtype=bool)
        self._force, self._place = np.zeros((2, COMPONENTS))
        self._volume: dict[str, float] = {}
        self._volume_before: dict[str, float] = {}
        self._state = state
        self._stage, self._ways = "", 0
        self.steps: list[LoadStep] = []
        self.points: list[Point] = []
        self.limits: list[Limit] = []
        self.problem.residual(self.x, self.x.duplicate())
        if self.carrier is not None:
            # Where the outer face is fixed already, a force holds it.
            self._force = self.carrier.force(self.problem.bodies_residual)
            self.carrier.control = replace(FREE, force=self._force)
            self._compliance = self._compliances()
        self.points.append(self._point(state, 0))

    @property
    def x(self) -> PETSc.Vec:
        """Unknowns of the last equilibrium."""
        return self.stepper.newton.x

    @property
    def carrier(self) -> Carrier | None:
        """What carries the socket's outer face, if it is loaded."""
        return self.problem.carrier

    def run(self, stage: Stage, start: StageMilestone | None = None) -> Limit | None:
        """Go through a stage; return the last limit that its forces came to, if any (collective).

        A way along a force ends at its limit, or where no further equilibrium is found.

        Parameters
        ----------
        stage : Stage
            The stage.
        start : StageMilestone, optional
            An equilibrium of this stage to continue from; its end is one, too.

        Raises
        ------
        ConvergenceError
            If there is no equilibrium on the way, and no force is followed there. The problem then
            holds the last one.
        """
        self._stage, self._ways, self.steps = stage.name, 0, []
        way = None
        if start is not None:
            self._restore(start)
            way = start.way if start.way.load > 0.0 else None
        for targets in list(legs(stage, self._axes))[self._ways :]:
            self._go(targets, stage.steps, way)
            way = None
            self._ways += 1
            self._reach(self._snapshot())
        mine = [limit for limit in self.limits if limit.stage == stage.name]
        return mine[-1] if mine else None

    def _restore(self, start: StageMilestone) -> None:
        """Take an equilibrium of an earlier run (collective)."""
        self._ways, self.steps = start.ways, list(start.steps)
        self._held, self._force, self._place = start.held, start.force, start.place
        self.points, self.limits = list(start.points), list(start.limits)
        self._set_volume(start.volume)
        start.way.unknowns.copy(self.x)
        if self.carrier is not None and start.control is not None:
            self.carrier.control = start.control
        self.problem.slip_history = start.way.converged_arc
        self.problem.residual(self.x, self.x.duplicate())
        self._state = self.problem.contact.state()

    # -- one way ----------------------------------------------------------------------------------

    def _go(self, targets: Targets, steps: int, way: Milestone | None) -> Limit | None:
        """Go to the targets in steps, as far as possible; perhaps from a place on the way."""
        held, volume = self._held.copy(), dict(self._volume)
        self._volume_before = volume
        force, place = self._force, self._place
        end_force, end_place = force.copy(), place.copy()
        for component, value in targets.force.items():
            held[component], end_force[component] = False, value
        for component, value in targets.place.items():
            held[component], end_place[component] = True, value
        end_volume = {**volume, **targets.volume}

        def set_share(share: float) -> None:
            self._set_volume(
                {
                    tissue: volume.get(tissue, 0.0) + share * (end - volume.get(tissue, 0.0))
                    for tissue, end in end_volume.items()
                }
            )
            if self.carrier is not None:
                self.carrier.control = Control.of(
                    held, force + share * (end_force - force), place + share * (end_place - place)
                )

        limit = None
        if targets.place or targets.volume or np.array_equal(force, end_force):
            size = 1.0 / steps
            control = LoadSteps(first=size, largest=size, smallest=SMALLEST * size)
            self._run(control, set_share, way)
        else:
            try:
                self._run([(k + 1) / steps for k in range(steps)], set_share, way)
            except ConvergenceError:
                limit = self._along(held, force, end_force, end_place, 1.0 / steps)
        self._held = held
        self._force, self._place = self.points[-1].force, self.points[-1].place
        if limit is None:  # what is prescribed is so to the last digit
            self._force = np.where(held, self._force, end_force)
            self._place = np.where(held, end_place, self._place)
        return limit

    def _set_volume(self, changes: Mapping[str, float]) -> None:
        """Give the regions of tissues a volume without stress that has changed by a share."""
        self._volume = dict(changes)
        states = {
            region: 1.0 + changes[tissue]
            for region, tissue in self._tissues.items()
            if tissue in changes
        }
        if states:
            self.problem.set_stress_free(states)

    def _run(
        self,
        control: LoadSteps | Sequence[float],
        set_share: Callable[[float], None],
        way: Milestone | None = None,
    ) -> None:
        """Run the stepper over one way, or on from a place on it."""
        stepper, problem = self.stepper, self.problem
        stepper.control = control
        first = control.first if isinstance(control, LoadSteps) else 1.0
        here = Milestone(0.0, 0.0, first, self.x, self.x, problem.slip_history)
        # A force that fails is followed by its way, and a way by a shorter one.
        stepper.newton.searches = isinstance(control, LoadSteps)
        stepper.run(way or here, lambda before, after: set_share(after))

    def _along(
        self,
        held: NDArray[np.bool_],
        force: FloatArray,
        end_force: FloatArray,
        end_place: FloatArray,
        step: float,
    ) -> Limit | None:
        """Prescribe the way along the force, until that is reached or rises no more (collective).

        Each step goes on by a share of the way that the donned socket's tangent has for the whole
        force; it grows where Newton's method finds it easy.
        """
        carrier = self.carrier
        assert carrier is not None
        change = np.where(held, 0.0, carrier.scale * (end_force - force))
        size = float(np.linalg.norm(change))
        unit = change / size

        def along(values: FloatArray) -> float:
            return float(unit @ values)

        way = min(abs(along(self._compliance @ change)), LONGEST_WAY * carrier.radius)
        origin = along(carrier.place / carrier.scale)

        def share() -> float:
            return along(carrier.scale * (self.points[-1].force - force)) / size

        shares, ways = [share()], [0.0]
        whole = Control.of(held, end_force, end_place)
        advance = step * way
        for _ in range(MOST_STEPS + round(MOST_PER_STEP / step)):
            here, before = self._snapshot(), carrier.control
            if len(ways) > 1:
                rise = (shares[-1] - shares[-2]) / (ways[-1] - ways[-2])
                if shares[-1] + rise * advance >= 1.0:
                    try:
                        self._run(ONE_STEP, self._choice(before, whole))
                    except ConvergenceError:
                        advance *= CUTBACK
                    else:
                        return None
            target = carrier.place + advance * carrier.scale * unit
            control = Control.along(held, force, np.where(held, end_place, target), change)
            try:
                self._run(ONE_STEP, self._choice(before, control))
            except ConvergenceError:
                advance *= CUTBACK
                if advance >= SHORTEST * step * way:
                    continue
                if len(ways) == 1:  # it was not followed at all
                    raise
                break
            if share() >= 1.0:  # beyond the stage's force, which friction would remember
                self._return(here, before)
                advance *= CUTBACK
                continue
            shares.append(share())
            ways.append(along(carrier.place / carrier.scale) - origin)
            if self._at_limit(ways, shares, force, unit, size):
                break
            if self.points[-1].iterations <= FEW_ITERATIONS:
                advance *= GROWTH
        still_rises = not self._at_limit(ways, shares, force, unit, size)
        best = int(np.argmax(shares))
        reached = force + shares[best] * size * unit / carrier.scale
        self.limits.append(Limit(self._stage, reached, end_force, still_rises))
        return self.limits[-1]

    def _snapshot(self) -> Milestone:
        """Return the present equilibrium, to go back to."""
        x = self.x.copy()
        return Milestone(0.0, 0.0, 1.0, x, x, self.problem.slip_history)

    def _return(self, here: Milestone, control: Control) -> None:
        """Go back to an equilibrium, the last but one (collective)."""
        assert self.carrier is not None
        here.unknowns.copy(self.x)
        self.carrier.control = control
        self.problem.slip_history = here.converged_arc
        self.problem.residual(self.x, self.x.duplicate())
        self._state = self.problem.contact.state()
        self.points.pop()

    def _at_limit(
        self,
        ways: list[float],
        shares: list[float],
        force: FloatArray,
        unit: FloatArray,
        size: float,
    ) -> bool:
        """Whether the force has risen by less than `LIMIT` over the last part of the way."""
        assert self.carrier is not None
        if ways[-1] <= 0.0:
            return False
        then = float(np.interp((1.0 - LAST_PART) * ways[-1], ways, shares))
        total = abs(float(unit @ (self.carrier.scale * force)) + shares[-1] * size)
        return (shares[-1] - then) * size < LIMIT * total

    def _choice(self, before: Control, after: Control) -> Callable[[float], None]:
        """Return what sets one control before a step, and another one for it."""
        carrier = self.carrier
        assert carrier is not None

        def set_share(share: float) -> None:
            carrier.control = after if share > 0.0 else before

        return set_share

    def _compliances(self) -> FloatArray:
        """Motion of the carrier by its forces in the present state, s^-1 dp/d(s G) (collective)."""
        carrier, newton = self.carrier, self.stepper.newton
        assert carrier is not None
        newton.factorise()
        columns = []
        for unit in np.eye(COMPONENTS):
            residual = self.x.duplicate()
            residual.set(0.0)
            if carrier.extra:
                residual.array[-COMPONENTS:] = unit
            columns.append(carrier.motion(newton.correction(residual)) / carrier.scale)
        return np.column_stack(columns)

    # -- equilibria -------------------------------------------------------------------------------

    def _arrive(self, milestone: Milestone) -> None:
        """Take an equilibrium in."""
        state = self.problem.contact.state()
        self.points.append(self._point(state, milestone.steps[-1].newton.iterations))
        self._state = state
        # The end of a way is handed on when it is complete; where the place along a force is
        # prescribed, each step is a way of its own, and all of them begin again.
        if milestone.load < 1.0:
            self._reach(milestone)

    def _take_step(self, step: LoadStep) -> None:
        self.steps.append(step)
        if self._on_step is not None:
            self._on_step(step)

    def _reach(self, way: Milestone) -> None:
        """Hand on that an equilibrium is reached."""
        if self.on_milestone is None:
            return
        self.on_milestone(
            StageMilestone(
                stage=self._stage,
                ways=self._ways,
                way=way,
                held=self._held,
                force=self._force,
                place=self._place,
                volume=self._volume if way.load == 0.0 else self._volume_before,
                control=self.carrier.control if self.carrier is not None else None,
                points=tuple(self.points),
                limits=tuple(self.limits),
                steps=tuple(self.steps),
            )
        )

    def _point(self, state: ContactState, iterations: int) -> Point:
        contact, carrier, comm = self.problem.contact, self.carrier, self.problem.comm
        last = self.points[-1] if self.points else None
        weight = contact.points.weight
        closed = state.traction.pressure > 0
        slid = Slid.between(contact, self._state, state)
        sums = [
            weight @ slid.work,
            weight[closed].sum(),
            weight[state.traction.status == SLIP].sum(),
        ]
        work, touching, slipping = comm.allreduce(np.array(sums))
        whole = resultants(contact, state)
        force, place = np.zeros((2, COMPONENTS))
        if carrier is not None:
            force, place = carrier.force(self.problem.bodies_residual), carrier.place.copy()
        applied = 0.5 * (last.force + force) @ (place - last.place) if last else 0.0
        return Point(
            stage=self._stage,
            force=force,
            place=place,
            volume=dict(self._volume),
            pressing=whole.pressing,
            slipping=float(slipping / touching) if touching else 0.0,
            dissipated=float(work) + (last.dissipated if last else 0.0),
            applied=float(applied) + (last.applied if last else 0.0),
            iterations=iterations,
            imbalance=self._imbalance(whole),
        )

    def _imbalance(self, whole: Resultants) -> float:
        """Return the largest force out of balance, at the last residual (collective)."""
        problem, contact = self.problem, self.problem.contact
        at = contact.deformed_points()
        squares, length = problem.comm.allreduce(
            np.array([contact.points.weight @ np.sum(at**2, axis=1), contact.points.weight.sum()])
        )
        arm = float(np.sqrt(squares / length))
        found = 0.0
        for boundary, sign, moment in (
            (tags.TIBIA_MEDULLARY, 1.0, whole.on_skin),
            (tags.SOCKET_OUTER, -1.0, whole.on_socket),
        ):
            force, torque = problem.reaction(boundary)
            missing = [*(force + sign * whole.force), (torque + moment) / arm]
            found = max(found, *np.abs(missing))
        return float(found / whole.pressing) if whole.pressing else 0.0


ONE_STEP = (1.0,)
"""Load steps of a way in one step."""


def legs(stage: Stage, axes: Frame) -> Iterator[Targets]:
    """Yield the values that a stage goes to, one after the other."""
    targets = stage.targets(axes)
    yield targets
    for _ in range(stage.cycles):
        yield targets.opposite
        yield targets
