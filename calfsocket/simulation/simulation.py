"""One limb in one socket: meshed, solved and checked."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import ConvergenceError, InputError, error_context, in_one_line
from calfsocket.io.schema import nearest
from calfsocket.materials.hencky import Hencky
from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import MaterialSet
from calfsocket.materials.tissues import SOCKET
from calfsocket.mechanics.donning import DONNINGS, SUPPORTS, Donning, SocketSupport
from calfsocket.mechanics.limb_problem import limb_problem, surfaces_with
from calfsocket.mechanics.load_steps import LoadSteps
from calfsocket.mechanics.loading import Loading, Stage
from calfsocket.mechanics.stages import StageMilestone, StageStepper
from calfsocket.mechanics.stepping import LoadStep, LoadStepper, Milestone
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.lining import Fit, Lining, fitted
from calfsocket.meshes.placement import (
    Placement,
    check_liner_between,
    check_placement,
    check_size_of_rest,
)
from calfsocket.meshes.refinement import FirstError, Refinement
from calfsocket.meshes.section import build, section_mesh
from calfsocket.meshes.sizing import AdaptiveSize, MeshSize, checked_size
from calfsocket.meshes.socket import Socket
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.postprocess.extract import contact_line, section_fields, skin_line
from calfsocket.postprocess.loading_curve import curve_table, in_words
from calfsocket.postprocess.quantities import Quantities
from calfsocket.postprocess.recovery import recovery_error
from calfsocket.postprocess.series import remove_steps, write_step
from calfsocket.simulation.checkpoint import Checkpoint, CheckpointError, conditions
from calfsocket.simulation.precompile import precompile
from calfsocket.simulation.prepared import Prepared
from calfsocket.simulation.profile import Phases, Profile
from calfsocket.simulation.record import CaseRecord, Checks, StateRecord
from calfsocket.simulation.result import Result

if TYPE_CHECKING:
    import pandas as pd

    from calfsocket.export.case import ExportedCase
    from calfsocket.export.write import ExportFormat

STEP_COLUMNS = {
    "step": "number",
    "load": "load",
    "converged": "newton.converged",
    "reason": "newton.reason",
    "newton_iterations": "newton.iterations",
    "residual_N_per_mm": "newton.residual",
    "seconds": "seconds",
}
"""Columns of load steps, and where a `LoadStep` has their values."""


LARGEST_EXPANDED = 0.05
"""Largest load step of an expanded socket: it touches the skin point by point."""


class Monitor:
    """Called while a simulation runs, on every rank; this one does nothing."""

    def message(self, text: str, load: float | None, milestone: bool = False) -> None:
        """Take a remark; a milestone is worth a line of a log."""

    def iteration(self, load: float, number: int, residual: float) -> None:
        """Take the residual norm (N/mm) before an iteration of Newton's method."""

    def step(self, step: LoadStep) -> None:
        """Take a load step that converged or failed."""

    def resumed(self, start: Milestone) -> None:
        """Take the equilibrium that the simulation starts from, of an earlier run."""


class Simulation:
    """A limb in a socket: the equilibrium in which the socket rests on the skin.

    Limb and socket overlap at the start. The overlap is released in load steps, the load growing
    from 0 to 1, with frictional contact between the skin and the socket's inner face.

    Parameters
    ----------
    limb : Limb
        The section.
    socket : Socket
        The socket.
    materials : MaterialSet
        Law of every tissue of the limb, and of the socket unless it has one of its own.
    mesh_size : str or int
        "coarse", "medium" or "paper", a number of triangles, or "adaptive": at most 60 000 of them
        ("adaptive-40000": so many), where a solution on the medium mesh has its errors. Of a limb
        or socket with a mesh of its own: the size of the other one's.
    contact : Contact, optional
        Friction and Nitsche stiffness; by default those of the paper.
    support : {"floating", "outer-fixed"}
        Whether the socket rests on the limb alone, or is fixed at its outer face.
    steps : LoadSteps, optional
        Sizes of the load steps.
    comm : MPI.Intracomm, optional
        Ranks that solve it together; by default all ranks of the program.
    placement : Placement, optional
        How the socket sits on the limb, where that is known already.
    liner : Liner, optional
        A layer between skin and socket, which is put on with the socket: its undersize grows with
        the load.
    loading : Loading, optional
        Stages of loading after donning.
    donning : {"gap", "expanded"}
        Whether the gaps are closed in proportion, or the socket starts wide, is moved over the limb
        and let go. Shear and the stress of the skin depend on it. An expanded socket takes load
        steps of at most `LARGEST_EXPANDED`, without extrapolation.

    Raises
    ------
    InputError
        If an argument cannot be used, or the limb has a tissue without a law.

    Examples
    --------
    >>> limb, socket = Limb.reference(), Socket.reference("HS")
    >>> simulation = Simulation(limb, socket, MaterialSet.paper("separate"), mesh_size="coarse")
    >>> result = simulation.solve()  # doctest: +SKIP
    """

    def __init__(
        self,
        limb: Limb,
        socket: Socket,
        materials: MaterialSet,
        mesh_size: str | int | MeshSize | AdaptiveSize = "paper",
        contact: Contact | None = None,
        support: SocketSupport = "floating",
        steps: LoadSteps | None = None,
        comm: MPI.Intracomm | None = None,
        placement: Placement | None = None,
        loading: Loading | None = None,
        donning: Donning = "gap",
        liner: Liner | None = None,
    ) -> None:
        for name, value, allowed in (
            ("support", support, SUPPORTS),
            ("donning", donning, DONNINGS),
        ):
            if value not in allowed:
                raise InputError(f"{name}: is '{value}'; {nearest(str(value), allowed)}")
        self.limb, self.socket, self.materials = limb, socket, materials
        self.mesh_size = checked_size(mesh_size)
        with error_context("mesh size"):
            check_size_of_rest(limb, socket, self.mesh_size)
        with error_context("liner.bonded"):
            check_liner_between(limb, socket, liner)
        self.contact = contact or Contact()
        self.support = support
        self.steps = steps or LoadSteps()
        if self.steps.extrapolate is None:
            smooth = True if materials.base == "combined" else "smooth"
            self.steps = self.steps.model_copy(update={"extrapolate": smooth})
        self.donning = donning
        if donning == "expanded":
            self.steps = expanded_steps(self.steps)
        self.comm = MPI.COMM_WORLD if comm is None else comm
        self.phases = Phases()
        self._placement = placement
        self.loading = loading
        if loading:
            check_loading(loading, limb, support)
        self.liner = liner
        self.region_laws = materials.region_laws(limb.tissues)
        if wall := socket.elasticity():
            law = self.region_laws[tags.SOCKET]
            # What the wall does not say is the set's, if that is linear, too.
            base = law if isinstance(law, Hencky) else SOCKET
            self.region_laws[tags.SOCKET] = base.model_copy(update={**wall, "given": None})
        if liner is not None:
            self.region_laws[tags.LINER] = liner.law

    @cached_property
    def placement(self) -> Placement:
        """How the socket sits on the undeformed limb.

        Raises
        ------
        InputError
            If it cannot be put on: one line that names the socket and the place.
        """
        return self._placement or check_placement(
            self.socket,
            self.limb,
            self.socket.name,
            floating=self.support == "floating",
            liner=self.liner,
        )

    @property
    def _fit(self) -> Fit:
        """Curves of socket and liner around the limb."""
        return fitted(self.limb, self.socket, self.liner)

    @property
    def geometry(self) -> str:
        """All that the mesh depends on, as JSON: cases that share it differ in numbers alone."""
        shape = self.liner and self.liner.model_dump(mode="json", include=set(Lining.model_fields))
        return json.dumps(
            {
                "limb": self.limb.model_dump(mode="json"),
                "socket": self.socket.model_dump(mode="json", exclude={"name", "title"}),
                "liner": shape,
                "size": asdict(self.mesh_size),
                # A refined mesh depends on the solution, and so on all that this depends on.
                **({"case": self.inputs} if isinstance(self.mesh_size, AdaptiveSize) else {}),
            }
        )

    @property
    def inputs(self) -> dict[str, Any]:
        """All that the result depends on, except versions and PETSc's options, as JSON."""
        # What is as by default is left out, so that earlier results keep their fingerprints.
        added: dict[str, Any] = {}
        if self.loading:
            by_default = {"carried"} if self.loading.carried == "frame" else None
            added["loading"] = self.loading.model_dump(mode="json", exclude=by_default)
        if self.donning != "gap":
            added["donning"] = self.donning
        return {
            "limb": self.limb.model_dump(mode="json"),
            **({"liner": self.liner.model_dump(mode="json")} if self.liner else {}),
            "socket": self.socket.model_dump(mode="json", exclude={"name", "title"}),
            "laws": {
                name: law.model_dump(mode="json", exclude={"given"})
                for name, law in self.region_laws.items()
            },
            "mesh_size": self.mesh_size.name,
            "contact": self.contact.model_dump(mode="json"),
            "support": self.support,
            "steps": self.steps.model_dump(mode="json"),
            **added,
        }

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the `inputs`."""
        return "sha256:" + hashlib.sha256(json.dumps(self.inputs).encode()).hexdigest()

    def solve(
        self,
        monitor: Monitor | None = None,
        checkpoint: Path | None = None,
        resume: bool = False,
        profile: Profile | None = None,
        prepared: Prepared | None = None,
        step_fields: Path | None = None,
    ) -> Result:
        """Mesh, solve and check (collective).

        Parameters
        ----------
        monitor : Monitor, optional
            Called while it runs.
        checkpoint : Path, optional
            File that holds the last equilibrium while the simulation runs.
        resume : bool
            Start from that file if it was made from the same inputs.
        profile : Profile, optional
            Times the solution.
        prepared : Prepared, optional
            Mesh and problem of the last case, which are taken where they are those of this one.
        step_fields : Path, optional
            Folder of the case: the fields of each load step are written there, below load_steps/,
            and `Result.save` into it joins them in fields.pvd for ParaView.

        Returns
        -------
        Result
            The state at full load, with those of the stages of loading, on every rank.

        Raises
        ------
        InputError
            If the socket cannot be put on the limb, or the geometry cannot be meshed.
        ConvergenceError
            If the full load, or the end of a stage, is not reached; its `result` holds the last
            equilibrium. A force that the limb cannot bear is a result, and no error.
        """
        monitor, prepared = monitor or Monitor(), prepared or Prepared()
        on_first_rank(self.comm, lambda: self.placement)
        monitor.message("mesh and set-up", 0.0, True)
        precompile(self.comm, [self.materials], [self.liner.law] if self.liner else [])
        with self.phases("mesh"):
            section = prepared.section(self.geometry, lambda: self._mesh(monitor, prepared))
        with self.phases("setup"):
            laws = {name: self.region_laws[name] for name in section.regions}
            problem = prepared.problem(
                laws,
                self.contact,
                (self.support, self.donning),
                lambda: limb_problem(
                    section, laws, self.contact, self.support, donning=self.donning
                ),
            )
            if self.liner and (state := self.liner.stress_free(self._fit)):
                problem.set_stress_free({tags.LINER: state})
            stepper = LoadStepper(
                problem, self.steps, on_iteration=monitor.iteration, on_step=monitor.step
            )
        kept, start = self._keep_checkpoints(stepper, monitor, checkpoint, resume)
        if step_fields:
            self._keep_step_fields(stepper, monitor, step_fields, start)
        failure = ""
        if profile:
            profile.start()
        try:
            with self.phases("solve"):
                stepper.run(start)
        except ConvergenceError as error:
            failure = str(error)
        if profile:
            profile.stop()
        result = self.result(stepper, start, failure)
        if self.loading and not failure:
            result, failure = self._load(stepper, result, monitor, kept, start is not None)
        if failure:
            raise ConvergenceError(failure, result)
        return result

    def export(self, path: Path | str, format: "ExportFormat") -> tuple[str, ...]:
        """Write the case as the input of another program, or its mesh (collective).

        Parameters
        ----------
        path : Path or str
            File, which is replaced.
        format : {"abaqus", "calculix", "febio", "msh", "xdmf"}
            Abaqus/Standard, CalculiX 2.20, FEBio 4; or the mesh alone, with its names, for gmsh and
            for ParaView.

        Returns
        -------
        tuple of str
            What has no equivalent, or another one, in that program, a line each; it stands in the
            head of the file, too.

        Raises
        ------
        InputError
            For an unknown format, a socket that cannot be put on the limb, a geometry that cannot
            be meshed, or a law of a script's own.
        """
        from calfsocket.export.write import checked_format, write

        format = checked_format(format)

        size, refinement = self._refined(Monitor(), Prepared())

        def work() -> tuple[str, ...]:
            _ = self.placement
            return write(Path(path), self._exported(size, refinement), format)

        return on_first_rank(self.comm, work)

    def _exported(self, size: MeshSize, refinement: Refinement | None) -> "ExportedCase":
        """Mesh the section on this process, and return all that a deck is made of."""
        from calfsocket.export.case import ExportedCase

        liner = self.liner
        return ExportedCase(
            title=f"{self.socket.name} {self.materials.name}, {self.mesh_size.name} mesh",
            mesh=build(self.limb, self.socket, size, liner, refinement),
            tissues=self._tissues,
            laws=self.region_laws,
            contact=self.contact,
            surfaces=surfaces_with(liner is not None, liner is not None and liner.bonded == "limb"),
            support=self.support,
            donning=self.donning,
            frame=self.limb.frame,
            loading=self.loading,
            undersize=liner.undersize if liner else 0.0,
            around=self._fit.bonded_to.direction if liner else None,
        )

    def _mesh(self, monitor: Monitor, prepared: Prepared) -> SectionMesh:
        """Mesh the section (collective)."""
        size, refinement = self._refined(monitor, prepared)
        return section_mesh(
            self.comm, self.limb, self.socket, size, self.liner, refinement, again=False
        )

    def _refined(self, monitor: Monitor, prepared: Prepared) -> tuple[MeshSize, Refinement | None]:
        """Return the final size and, if it is adaptive, its refinement (collective)."""
        size = self.mesh_size
        if not isinstance(size, AdaptiveSize):
            return size, None
        first = self._on_first_mesh(size)
        with self.phases("first solution"):
            error = prepared.first_error(first.fingerprint, lambda: _first_error(first, monitor))
        return size.final, Refinement.of(error, size)

    def _on_first_mesh(self, size: AdaptiveSize) -> "Simulation":
        """Return the donning of the socket on the mesh that is to be refined."""
        return Simulation(
            self.limb,
            self.socket,
            self.materials,
            size.first,
            self.contact,
            self.support,
            self.steps,
            self.comm,
            self.placement,
            donning=self.donning,
            liner=self.liner,
        )

    def _keep_checkpoints(
        self, stepper: LoadStepper, monitor: Monitor, path: Path | None, resume: bool
    ) -> tuple[Checkpoint | None, Milestone | None]:
        """Write each equilibrium to a file from now on; return that, and the one to start from."""
        if path is None:
            return None, None
        inputs = {"case": self.fingerprint, **conditions()}
        checkpoint = Checkpoint(path, stepper.problem, inputs)
        troubles: set[str] = set()

        def save(milestone: Milestone) -> None:
            with self.phases("checkpoints"), reported(monitor, milestone.load, troubles):
                checkpoint.save(milestone)

        stepper.on_milestone = save
        if not resume:
            return checkpoint, None
        try:
            start = checkpoint.load()
        except CheckpointError as error:  # on all ranks
            monitor.message(f"starts from load 0: {error}", 0.0, True)
            return checkpoint, None
        if start is not None:
            monitor.resumed(start)
        return checkpoint, start

    def _keep_step_fields(
        self, stepper: LoadStepper, monitor: Monitor, folder: Path, start: Milestone | None
    ) -> None:
        """Write the fields of each equilibrium below the full load from now on."""
        others, troubles = stepper.on_milestone, set[str]()
        on_first_rank(self.comm, lambda: remove_steps(folder, start.load if start else -1.0))

        def save(milestone: Milestone) -> None:
            if milestone.load < 1.0:
                with self.phases("fields"):
                    fields = section_fields(stepper.problem, self._tissues)
                    if fields is not None:  # on the first rank
                        with reported(monitor, milestone.load, troubles):
                            write_step(folder, Quantities.of(fields), milestone.load)
            if others:  # a checkpoint comes last: who continues from it has the fields up to there
                others(milestone)

        stepper.on_milestone = save

    @property
    def _tissues(self) -> dict[str, str]:
        """Tissue of each region, those of socket and liner too."""
        return self.limb.tissues | {name: name for name in (tags.SOCKET, tags.LINER)}

    def result(
        self, stepper: LoadStepper, start: Milestone | None = None, failure: str = ""
    ) -> Result:
        """Read and check the equilibrium that a stepper has come to, from a start (collective)."""
        with self.phases("checks"):
            checks = check(stepper)
        with self.phases("fields"):
            fields = section_fields(stepper.problem, self._tissues)
            line, lining = skin_line(stepper.problem), None
            if self.liner and self.liner.bonded == "limb":
                lining = contact_line(stepper.problem)
            if self.comm.size > 1:
                fields, line, lining = self.comm.bcast((fields, line, lining), root=0)
        assert fields is not None and line is not None
        record, table = self._record(checks, start, failure), steps_table(stepper.steps, checks)
        return Result(record, fields, line, table, lining)

    def _load(
        self,
        donned: LoadStepper,
        result: Result,
        monitor: Monitor,
        checkpoint: Checkpoint | None,
        resume: bool,
    ) -> tuple[Result, str]:
        """Go through the stages of loading; return the result with them, and why one failed."""
        loading, frame = self.loading, self.limb.frame
        assert loading is not None
        troubles: set[str] = set()

        def on_step(step: LoadStep) -> None:
            how = "" if step.newton.converged else f"failed ({step.newton.reason}) after "
            text = (
                f"stage {name}, {100 * step.load:.0f} %: {how}{step.newton.iterations} iterations"
            )
            monitor.message(text, donned.problem.load, True)

        with self.phases("stages"):
            stages = StageStepper(
                donned,
                frame,
                self.limb.tissues,
                loading.carried if loading.moves_socket else None,
                lambda _, number, norm: monitor.iteration(1.0, number, norm),
                on_step,
            )
        states, failure = dict[str, Result](), ""
        for number, stage in enumerate(loading.stages, 1):
            name, start = stage.name, None
            if checkpoint is not None:
                file = checkpoint.of_stage(number)
                start = self._start_of(stage, file, monitor) if resume else None
                resume = start is not None  # what comes after a stage follows from it

                def save(milestone: StageMilestone, file: Checkpoint = file) -> None:
                    with self.phases("checkpoints"), reported(monitor, 1.0, troubles):
                        file.save_stage(milestone)

                stages.on_milestone = save
            try:
                with self.phases("stages"):
                    limit = stages.run(stage, start)
            except ConvergenceError as error:
                failure = f"stage {name}: {error}"
                break
            stages.stepper.steps = list(stages.steps)
            state = self.result(stages.stepper)
            reached = StateRecord(stage=name, limit=in_words(limit, frame) if limit else "")
            if limit:
                monitor.message(f"stage {name}: {reached.limit}", 1.0, True)
            record = state.record.model_copy(update={"state": reached})
            states[name] = replace(state, record=record)
        limited = tuple(
            name for name, each in states.items() if each.record.state and each.record.state.limit
        )
        record = result.record.model_copy(
            update={"states": tuple(states), "limited": limited, "message": failure}
        )
        if failure:
            record = record.model_copy(update={"status": "failed"})
        return replace(
            result, record=record, states=states, curve=curve_table(stages.points, frame)
        ), failure

    def _start_of(self, stage: Stage, file: Checkpoint, monitor: Monitor) -> StageMilestone | None:
        """Return the equilibrium that a stage continues from, if there is one (collective)."""
        try:
            start = file.load_stage(stage.name)
        except CheckpointError as error:  # on all ranks
            monitor.message(f"stage {stage.name} starts anew: {error}", 1.0, True)
            return None
        if start is not None:
            monitor.message(f"stage {stage.name}: continues from its checkpoint", 1.0, True)
        return start

    def _record(self, checks: Checks, start: Milestone | None, failure: str) -> CaseRecord:
        return CaseRecord(
            socket=self.socket.name,
            material_set=self.materials.name,
            of=(self.socket.name, self.materials.name),
            base_set=self.materials.base,
            axes=self.limb.axes,
            status="failed" if failure else "solved",
            message=failure,
            ranks=self.comm.size,
            resumed_from_load=start.load if start else 0.0,
            seconds=self.phases.seconds,
            checks=checks,
        )


def _first_error(simulation: Simulation, monitor: Monitor) -> FirstError:
    """Solve on a first mesh and return its error; where that fails, as far as it came."""
    monitor.message(f"first solution, mesh {simulation.mesh_size.name}", 0.0, True)
    try:
        fields = simulation.solve().fields
    except ConvergenceError as error:
        fields, load = error.result.fields, error.result.record.checks.load
        monitor.message(f"first solution stopped: {error}; it refines as of there", load, True)
    return FirstError(fields.points[fields.cells], recovery_error(fields), fields.bodies)


def expanded_steps(steps: LoadSteps) -> LoadSteps:
    """Return load steps that an expanded socket may take."""
    largest = min(steps.largest, LARGEST_EXPANDED)
    sizes = {
        "first": min(steps.first, largest),
        "largest": largest,
        "smallest": min(steps.smallest, largest),
    }
    return steps.model_copy(update={**sizes, "extrapolate": False})


def check_loading(loading: Loading, limb: Limb, support: SocketSupport) -> None:
    """Check that stages of loading can act on a limb in a socket.

    Raises
    ------
    InputError
        If a fixed socket would be loaded, a side is not known, or the limb has no such tissue.
    """
    for number, stage in enumerate(loading.stages):
        with error_context(f"loads.{number} ({stage.name})"):
            if stage.moves_socket and support == "outer-fixed":
                raise InputError(
                    "a socket that is fixed at its outer face cannot be loaded or moved; choose "
                    "support floating, or change volumes alone"
                )
            stage.targets(limb.frame)
            for tissue in stage.tissue_volumes:
                if tissue not in limb.tissues.values() and tissue in stage.volume:
                    raise InputError(f"volume.{tissue}: the limb has no {tissue}; remove it")


def check(stepper: LoadStepper) -> Checks:
    """Compute the checks of the equilibrium that a stepper has come to (collective)."""
    problem = stepper.problem
    newton = [step.newton for step in stepper.steps]
    converged = [result for result in newton if result.converged]
    volume_ratio, region = problem.smallest_volume_ratio()
    imbalance, pressing = problem.force_balance(stepper.newton.x, tags.TIBIA_MEDULLARY)
    return Checks(
        load=problem.load,
        unknowns=problem.V.dofmap.index_map.size_global,
        cells=problem.section.mesh.topology.index_map(2).size_global,
        steps=len(converged),
        failed_steps=len(newton) - len(converged),
        newton_iterations=sum(result.iterations for result in newton),
        residual_N_per_mm=converged[-1].residual if converged else 0.0,
        smallest_volume_ratio=volume_ratio,
        smallest_volume_ratio_region=region,
        largest_gap_in_contact_mm=problem.contact.largest_gap(),
        pressing_force_N_per_mm=pressing,
        relative_force_imbalance=imbalance / pressing if pressing else 0.0,
        negative_modes=stepper.newton.negative_modes(),
    )


def steps_table(steps: Sequence[LoadStep], checks: Checks | None = None) -> "pd.DataFrame":
    """Return load steps as a table; the negative modes are those of the last equilibrium."""
    import pandas as pd

    values = attrgetter(*STEP_COLUMNS.values())
    table = pd.DataFrame([values(step) for step in steps], columns=list(STEP_COLUMNS))
    modes: list[Any] = [""] * len(steps)
    if modes and checks:
        modes[-1] = checks.negative_modes
    return table.assign(negative_modes=modes)


@contextmanager
def reported(monitor: Monitor, load: float, troubles: set[str]) -> Iterator[None]:
    """Report once that a file cannot be written, and carry on: it may be possible later."""
    try:
        yield
    except OSError as error:
        text = in_one_line(error)
        if text not in troubles:
            monitor.message(text, load, True)
        troubles.add(text)
