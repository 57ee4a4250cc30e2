"""What is written of a case: its identity, how it ended, and the checks of its result."""

from typing import Any, Literal

from pydantic import Field

from calfsocket.io.schema import Strict

GAP_TOLERANCE = 1e-2
"""Largest gap in mm that a result may have where there is contact."""

FORCE_TOLERANCE = 1e-6
"""Largest force imbalance of a result, as a share of the force that presses on the skin."""


class Checks(Strict):
    """Numbers by which a result is judged.

    Attributes
    ----------
    load : float
        Load reached, 0 to 1.
    unknowns, cells : int
        Size of the problem.
    steps, failed_steps, newton_iterations : int
        Converged and failed load steps, and Newton iterations of both.
    residual_N_per_mm : float
        Euclidean norm of the residual at the last equilibrium.
    smallest_volume_ratio : float
        Smallest J = det F of all quadrature points.
    smallest_volume_ratio_region : str
        The region that it is in.
    largest_gap_in_contact_mm : float
        Largest gap where there is contact.
    pressing_force_N_per_mm : float
        Integral of the contact pressure over the skin.
    relative_force_imbalance : float
        Force by which contact and the tibia's reaction differ, over the pressing force.
    negative_modes : int
        0 at a stable equilibrium.
    """

    load: float
    unknowns: int
    cells: int
    steps: int
    failed_steps: int
    newton_iterations: int
    residual_N_per_mm: float
    smallest_volume_ratio: float
    smallest_volume_ratio_region: str
    largest_gap_in_contact_mm: float
    pressing_force_N_per_mm: float
    relative_force_imbalance: float
    negative_modes: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """Say which checks the result does not pass."""
        found = []
        if self.negative_modes != 0:
            found.append(f"unstable equilibrium: {self.negative_modes} negative modes")
        if self.smallest_volume_ratio <= 0:
            found.append(f"inverted material in {self.smallest_volume_ratio_region}")
        if self.largest_gap_in_contact_mm > GAP_TOLERANCE:
            found.append(f"gap of {self.largest_gap_in_contact_mm:.2g} mm in contact")
        if self.relative_force_imbalance > FORCE_TOLERANCE:
            found.append("contact pressure not in equilibrium with the tibia's reaction")
        return tuple(found)


class CaseRecord(Strict):
    """A case in run.json, and in the result.json of its folder.

    Attributes
    ----------
    socket, material_set : str
        Names of the case in every table; a label after an ``@`` tells variants apart.
    of : (str, str)
        Socket and material set that it is a variant of: the names without labels.
    base_set : str
        Material set of the paper that its own is, or starts from.
    changes : mapping
        Parameters by which it differs from the other cases of its study: dotted name -> value as
        written in the study file.
    status : str
        "running", "solved" (the full load is reached) or "failed".
    message : str
        Why it failed; empty otherwise.
    ranks : int
        MPI ranks that solved it together.
    resumed_from_load : float
        Load of the checkpoint that it started from; 0 without one.
    seconds : mapping of str to float
        Wall time by phase.
    checks : Checks, optional
        Of the last equilibrium; None where there is none.
    files : mapping of str to str
        SHA-256 of its files and table rows; None where one is missing.
    traceback : tuple of str
        Of an error that nobody foresaw.
    """

    socket: str
    material_set: str
    of: tuple[str, str]
    base_set: Literal["separate", "combined"] = "separate"
    changes: dict[str, Any] = Field(default_factory=dict)
    status: Literal["running", "solved", "failed"] = "running"
    message: str = ""
    ranks: int = 1
    resumed_from_load: float = 0.0
    seconds: dict[str, float] = Field(default_factory=dict)
    checks: Checks | None = None
    files: dict[str, str | None] = Field(default_factory=dict)
    traceback: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the case's folder, e.g. ``TC_separate``."""
        return f"{self.socket}_{self.material_set}"

    @property
    def key(self) -> tuple[str, str]:
        """Values of the columns that name the case in every table."""
        return self.socket, self.material_set

    @property
    def warnings(self) -> tuple[str, ...]:
        """Checks that its result does not pass."""
        return self.checks.warnings if self.checks else ()
