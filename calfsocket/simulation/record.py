"""What is written of a case: its identity, how it ended, and the checks of its result."""

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict, checked, read_text
from calfsocket.materials.laws import AnyLaw
from calfsocket.mechanics.loading import DONNED
from calfsocket.meshes.frame import Direction, Frame
from calfsocket.meshes.levels import LimbLevels, Place
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import AnySocket

KEY = ("socket", "material_set")
"""Columns that name the case in every table that cases share."""

LEVEL = ("level", "height_mm")
"""Columns behind them where a limb has many levels: share of its height, and mm from its end."""

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
        Force by which contact and reaction where the limb is fixed differ, over the pressing force.
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
        """Return which checks the result does not pass, in words."""
        found = []
        if self.negative_modes != 0:
            plural = "" if self.negative_modes == 1 else "s"
            found.append(f"unstable equilibrium: {self.negative_modes} negative mode{plural}")
        if self.smallest_volume_ratio <= 0:
            found.append(f"inverted material in {self.smallest_volume_ratio_region}")
        if self.largest_gap_in_contact_mm > GAP_TOLERANCE:
            found.append(f"gap of {self.largest_gap_in_contact_mm:.2g} mm in contact")
        if self.relative_force_imbalance > FORCE_TOLERANCE:
            found.append("contact force and reaction do not balance")
        return tuple(found)


class StateRecord(Strict):
    """A state after a stage of loading.

    Attributes
    ----------
    stage : str
        Name of the stage.
    limit : str
        Which force the limb in its socket could not bear, in words; empty where it bore all.
    """

    stage: str
    limit: str = ""


class SecondMesh(Strict):
    """The second mesh of a case, by which its mesh error is estimated.

    Attributes
    ----------
    size : str
        Its size, in words.
    cells : int
        Its triangles; 0 where it could not be solved.
    message : str
        Why it could not be; empty where it was.
    """

    size: str
    cells: int = 0
    message: str = ""


class CaseRecord(Strict):
    """A case in run.json, and in the result.json of its folder.

    Attributes
    ----------
    socket, material_set : str
        Names of the case in every table; a label after an ``@`` distinguishes variants.
    of : (str, str)
        Socket and material set that it is a variant of: the names without labels.
    base_set : str
        Material set of the paper that its own is, or starts from.
    axes : mapping
        What +x and +y of the limb point to; empty where that is not known.
    level : Place, optional
        Where along a limb of many levels its section lies.
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
        Of an error that the package did not raise itself.
    state : StateRecord, optional
        The stage of loading that it is the end of; None for the donned socket.
    states : tuple of str
        Names of the stages that have come to their end.
    limited : tuple of str
        Those at whose end the limb in its socket does not bear what the stage asks for.
    second_mesh : SecondMesh, optional
        That of the mesh error, where one was asked for.
    """

    socket: str
    material_set: str
    of: tuple[str, str]
    base_set: Literal["separate", "combined"] = "separate"
    axes: dict[str, Direction] = Field(default_factory=dict)
    level: Place | None = None
    changes: dict[str, Any] = Field(default_factory=dict)
    status: Literal["running", "solved", "failed"] = "running"
    message: str = ""
    ranks: int = 1
    resumed_from_load: float = 0.0
    seconds: dict[str, float] = Field(default_factory=dict)
    checks: Checks | None = None
    files: dict[str, str | None] = Field(default_factory=dict)
    traceback: tuple[str, ...] = ()
    state: StateRecord | None = None
    states: tuple[str, ...] = ()
    limited: tuple[str, ...] = ()
    second_mesh: SecondMesh | None = None

    @model_serializer(mode="wrap")
    def _without_stages(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave stages and a second mesh out where there are none."""
        found: dict[str, Any] = write(self)
        if_any = ("state", "states", "limited", "second_mesh")
        return {key: value for key, value in found.items() if value or key not in if_any}

    @property
    def name(self) -> str:
        """Name of the case's folder, e.g. ``TC_separate``."""
        return f"{self.socket}_{self.material_set}"

    @property
    def key(self) -> tuple[str, str]:
        """Values of the columns that name the case in every table."""
        return self.socket, self.material_set

    @property
    def columns(self) -> dict[str, Any]:
        """Columns of its rows in tables that cases share: its key, and its level if it has one."""
        level = self.level
        columns = {} if level is None else {"level": level.height, "height_mm": level.height_mm}
        return dict(zip(KEY, self.key, strict=True)) | columns

    @property
    def base(self) -> tuple[str, str]:
        """Its key where nothing is changed: `of`, at its level."""
        socket, materials = self.of
        return (f"{socket}@{self.level.label}" if self.level else socket), materials

    @property
    def along(self) -> tuple[str, str]:
        """What it shares with the cases of the other levels: its key without the level."""
        label = f"@{self.level.label}" if self.level else ""
        return self.socket.replace(label, "", 1), self.material_set

    @property
    def frame(self) -> Frame:
        """Where lateral and anterior are."""
        return Frame(self.axes.get("+x"), self.axes.get("+y"))

    @property
    def solved(self) -> bool:
        """Whether it reached its full load: only then has it results."""
        return self.status == "solved"

    @property
    def has_second_mesh(self) -> bool:
        """Whether it has a result on a second mesh."""
        return self.second_mesh is not None and not self.second_mesh.message

    @property
    def load(self) -> float | None:
        """Load of its last equilibrium, 0 to 1; None where there is none."""
        return self.checks.load if self.checks else None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Checks that its result does not pass."""
        found = self.checks.warnings if self.checks else ()
        if self.second_mesh and self.second_mesh.message:
            found = (*found, f"no mesh error: {self.second_mesh.message}")
        return found

    @property
    def state_name(self) -> str:
        """Name of the state in tables."""
        return self.state.stage if self.state else DONNED


class StudySource(Strict):
    """The study file that a study was made from, and all that it named.

    Attributes
    ----------
    file : str
        Name of the file.
    content : mapping
        As parsed, with the changes of the command line.
    sha256 : mapping of str to str
        Hashes of the files that were read.
    files : mapping
        Content of the outlines and material files, by the name that the study file has for them.
    """

    file: str
    content: dict[str, Any]
    sha256: dict[str, str] = Field(default_factory=dict)
    files: dict[str, dict[str, Any]] = Field(default_factory=dict)


RUN_FILE = "run.json"

FORMAT: Literal[2] = 2
"""Of run.json; 1 was that of calfsocket 0.1."""


class StudyRecord(Strict):
    """A study in its run.json: inputs, versions, and how each case ended.

    Attributes
    ----------
    program, format
        Mark the file as ours.
    versions, petsc_options : mapping of str to str
        What the numbers depend on besides the inputs.
    ranks : int
        MPI ranks of the run.
    study : StudySource
        The file that repeats it.
    settings : mapping
        Tables `model`, `steps` and, if there are any, `layers` and `liner` of the study file,
        defaults filled in.
    limb : Limb, optional
        The section.
    levels : LimbLevels, optional
        Several along the limb, in the place of the one section.
    sockets : mapping of str to socket
        Each case's socket, by the name in the tables.
    laws : mapping
        Material set -> tissue or region -> law; a case whose laws are changed has its own entry,
        by the name of its folder.
    inputs : mapping of str to str
        Fingerprint of what the result of each case depends on.
    thresholds : list of mapping
        Those of the study.
    finished : bool
        Whether the last run of the study came to its end.
    seconds : float
        Wall time of that run.
    cases : mapping of str to CaseRecord
        By the name of the case's folder, in the order of the study.
    """

    program: Literal["calfsocket"] = "calfsocket"
    format: Literal[2] = FORMAT
    versions: dict[str, str]
    petsc_options: dict[str, str]
    ranks: int
    study: StudySource
    settings: dict[str, dict[str, Any]]
    limb: Limb | None = None
    levels: LimbLevels | None = None
    sockets: dict[str, AnySocket]
    laws: dict[str, dict[str, AnyLaw]]
    inputs: dict[str, str]
    thresholds: tuple[dict[str, Any], ...] = ()
    finished: bool = False
    seconds: float = 0.0
    cases: dict[str, CaseRecord]

    @model_validator(mode="after")
    def _has_a_limb(self) -> "StudyRecord":
        if (self.limb is None) == (self.levels is None):
            raise ValueError("limb: give either limb or levels")
        return self

    @property
    def whole_limb(self) -> Limb | LimbLevels:
        """The section, or all levels."""
        limb = self.levels or self.limb
        assert limb is not None
        return limb


def read_run(path: Path, advice: str = "") -> StudyRecord:
    """Read the run.json of a study.

    Parameters
    ----------
    advice : str, optional
        What to do where it cannot be read; by default what helps who wants to solve it again.

    Raises
    ------
    InputError
        If it is none, or was written by another version: why, and the advice.
    """
    again = "solve the study file again"
    try:
        content = json.loads(read_text(path))
    except InputError as error:
        raise _refusal(path, error, advice or again) from None
    except ValueError as error:
        raise InputError(f"{path}: is not JSON: {error}; {advice or again}") from None
    except RecursionError:
        raise InputError(f"{path}: has too many levels of nesting; {advice or again}") from None
    if not isinstance(content, dict) or content.get("program") != "calfsocket":
        usual = "name a study file, or a run.json that this version has written"
        raise InputError(f"{path}: is not the run.json of a study; {advice or usual}")
    if content.get("format") != FORMAT:
        versions = content.get("versions")
        version = versions.get("calfsocket") if isinstance(versions, dict) else None
        by = f"calfsocket {version}" if version else "another version"
        raise InputError(
            f"{path}: was written by {by}, whose run.json this version does not read; "
            f"{advice or f'{again}, or use that version'}"
        )
    try:
        return checked(path, content, StudyRecord, units_required=False)
    except InputError as error:
        raise _refusal(path, error, advice or again) from None


def _refusal(path: Path, error: InputError, advice: str) -> InputError:
    """Return an error with advice for who does not want to mend the file."""
    return InputError(f"{path}: cannot be used ({str(error).removeprefix(f'{path}: ')}); {advice}")
