"""One run of the study: a socket and a material set, solved."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from typing import Any, cast

from mpi4py import MPI

from calfsocket.contact.nitsche import ContactParameters
from calfsocket.io.errors import SolveError
from calfsocket.materials.laws import Law, OgdenForm
from calfsocket.materials.material_set import BaseSet, MaterialSet
from calfsocket.materials.tissues import FasciaC10
from calfsocket.mechanics.problem import Model, SocketSupport
from calfsocket.mechanics.stepping import LoadStep, Milestone, StepControl, Stepper
from calfsocket.meshes import tags
from calfsocket.meshes.data import Limb, Socket
from calfsocket.meshes.section import section_mesh
from calfsocket.meshes.sizing import mesh_size

GAP_TOLERANCE = 1e-2
"""Largest gap in mm that a result may have where there is contact."""

FORCE_TOLERANCE = 1e-6
"""Largest force imbalance of a result, as a share of the force that presses on the skin."""


@dataclass(frozen=True)
class Case:
    """A socket and a material set.

    Attributes
    ----------
    socket : str
        Name in the study's sockets.
    material_set : str
        "separate", "combined", or the name of a set of the study's own.
    base : str, optional
        Set of the paper that one of the study's own starts from.
    settings : Settings, optional
        Its own, in the place of those that the study's cases share.
    changes : mapping
        Parameters by which it differs from the study file's other cases, as written there: dotted
        name -> value.
    """

    socket: str
    material_set: str
    base: BaseSet | None = None
    settings: "Settings | None" = field(default=None, hash=False)
    changes: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def name(self) -> str:
        """Name of the case's folder, e.g. ``TC_separate``."""
        return f"{self.socket}_{self.material_set}"

    @property
    def key(self) -> tuple[str, str]:
        """Values of the columns that name the case in every table."""
        return self.socket, self.material_set

    @property
    def paper_set(self) -> BaseSet:
        """The set of the paper that the case's own is, or starts from."""
        return self.base or cast(BaseSet, self.material_set)


@dataclass(frozen=True)
class Settings:
    """What all cases of a study share.

    Attributes
    ----------
    size : str
        Mesh size: "coarse", "medium" or "paper".
    socket_support : str
        "floating" or "outer-fixed".
    fascia_c10 : str
        "printed" or "tables" (`tissues.FASCIA_C10`).
    ogden_form : str
        "abaqus" or "as-printed".
    materials : mapping of str to law
        Laws in the place of Table 1's, by name of the tissue, "combined", or a single region.
    contact : ContactParameters
        Friction and Nitsche stiffness.
    steps : StepControl
        Load steps.
    """

    size: str = "paper"
    socket_support: SocketSupport = "floating"
    fascia_c10: FasciaC10 = "printed"
    ogden_form: OgdenForm = "abaqus"
    materials: Mapping[str, Law] = field(default_factory=dict)
    contact: ContactParameters = field(default_factory=ContactParameters)
    steps: StepControl = field(default_factory=StepControl)

    def record(self) -> dict[str, Any]:
        """Return them as JSON has them."""
        laws = {name: law.model_dump(mode="json") for name, law in self.materials.items()}
        return {**asdict(replace(self, materials={})), "materials": laws}


def region_tissues(limb: Limb) -> dict[str, str]:
    """Tissue of each region, the socket among them."""
    return {region.name: region.tissue for region in limb.regions} | {tags.SOCKET: tags.SOCKET}


def material_set(case: Case, settings: Settings, regions: Iterable[str] = ()) -> MaterialSet:
    """Material set of a case on a limb with these regions; it has no place for other laws."""
    paper = MaterialSet.paper(case.paper_set, settings.fascia_c10, settings.ogden_form)
    return replace(paper, name=case.material_set).replace_known(settings.materials, regions)


def case_laws(case: Case, settings: Settings) -> dict[str, Law]:
    """Law of each tissue in a case."""
    return material_set(case, settings).tissue_laws()


def region_laws(case: Case, settings: Settings, limb: Limb) -> dict[str, Law]:
    """Law of each region in a case, the socket among them: its own, or that of its tissue."""
    tissues = {region.name: region.tissue for region in limb.regions}
    return material_set(case, settings, tissues).region_laws(tissues)


def step_control(case: Case, settings: Settings) -> StepControl:
    """Load steps of a case.

    With muscle and fascia combined nothing buckles and the path is smooth: the secant saves half of
    the iterations. A separate, stiff fascia waves in the soft muscle, and a start ahead of the
    friction may end on another branch (TC Separate, coarse: 0.5 % less contact pressure).
    """
    return replace(settings.steps, predict=case.paper_set == "combined")


class Run:
    """A case on its way through mesh, set-up and solution.

    Parameters
    ----------
    comm : MPI.Comm
        Ranks that solve it together.
    case, settings
        What to solve.
    limb, socket
        Geometry.
    on_iteration, on_step, on_milestone : callable, optional
        As of `stepping.Stepper`.

    Attributes
    ----------
    seconds : dict of str to float
        Wall time of each phase so far.
    failure : str
        Why the run did not reach the full load; empty when it did.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        case: Case,
        settings: Settings,
        limb: Limb,
        socket: Socket,
        on_iteration: Callable[[float, int, float], None] | None = None,
        on_step: Callable[[LoadStep], None] | None = None,
        on_milestone: Callable[[Milestone], None] | None = None,
    ) -> None:
        self.case = case
        self.seconds: dict[str, float] = {}
        self._inside = 0.0  # wall time of phases inside the present one
        self.failure = ""
        with self.phase("mesh"):
            section = section_mesh(comm, limb, socket, mesh_size(settings.size))
        with self.phase("setup"):
            laws = region_laws(case, settings, limb)
            self.model = Model(
                section,
                {name: laws[name] for name in section.regions},
                settings.contact,
                settings.socket_support,
            )
            self.stepper = Stepper(
                self.model, step_control(case, settings), on_iteration, on_step, on_milestone
            )

    def solve(self, start: Milestone | None = None) -> None:
        """Raise the load to 1, or as far as it goes (collective); see `failure`.

        An earlier run may have come to the milestone `start` already.
        """
        with self.phase("solve"):
            try:
                self.stepper.run(start)
            except SolveError as error:
                self.failure = str(error)

    def checks(self) -> dict[str, Any]:
        """Numbers by which a result is judged (collective).

        Returns
        -------
        dict
            load reached; unknowns; steps, failed steps and Newton iterations; residual (N/mm);
            smallest volume ratio and its region; largest gap in contact (mm); force imbalance
            relative to the pressing force; negative modes.
        """
        with self.phase("checks"):
            model, stepper = self.model, self.stepper
            newton = [step.newton for step in stepper.steps]
            done = [step.newton for step in stepper.steps if step.newton.converged]
            volume_ratio, region = model.smallest_volume_ratio()
            imbalance, pressing = model.force_balance(stepper.solver.x)
            return {
                "load": model.contact.load,
                "unknowns": model.V.dofmap.index_map.size_global,
                "cells": model.section.mesh.topology.index_map(2).size_global,
                "steps": len(done),
                "failed_steps": len(newton) - len(done),
                "newton_iterations": sum(result.iterations for result in newton),
                "residual_N_per_mm": done[-1].residual if done else 0.0,
                "smallest_volume_ratio": volume_ratio,
                "smallest_volume_ratio_region": region,
                "largest_gap_in_contact_mm": model.contact.largest_gap(),
                "pressing_force_N_per_mm": pressing,
                "relative_force_imbalance": imbalance / pressing if pressing else 0.0,
                "negative_modes": stepper.solver.negative_modes(),
            }

    @staticmethod
    def warnings(checks: dict[str, Any]) -> list[str]:
        """Say which of the `checks` a result does not pass."""
        found = []
        if checks["negative_modes"] != 0:
            found.append(f"unstable equilibrium: {checks['negative_modes']} negative modes")
        if checks["smallest_volume_ratio"] <= 0:
            found.append(f"inverted material in {checks['smallest_volume_ratio_region']}")
        if checks["largest_gap_in_contact_mm"] > GAP_TOLERANCE:
            found.append(f"gap of {checks['largest_gap_in_contact_mm']:.2g} mm in contact")
        if checks["relative_force_imbalance"] > FORCE_TOLERANCE:
            found.append("contact pressure not in equilibrium with the tibia's reaction")
        return found

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the wall time of the body to a phase, without that of phases inside it."""
        start, outside = time.perf_counter(), self._inside
        self._inside = 0.0
        try:
            yield
        finally:
            elapsed = time.perf_counter() - start
            self.seconds[name] = self.seconds.get(name, 0.0) + elapsed - self._inside
            self._inside = outside + elapsed
