"""A study file as checked tables: what may stand in it, and what it means."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from calfsocket.contact.nitsche import ContactParameters
from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict
from calfsocket.io.units import SHARE, STRESS
from calfsocket.materials.laws import OgdenForm
from calfsocket.materials.material_set import BASE_SETS
from calfsocket.materials.tissues import FasciaC10
from calfsocket.mechanics.problem import SocketSupport
from calfsocket.mechanics.stepping import StepControl
from calfsocket.meshes.sizing import mesh_size
from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.postprocess.thresholds import THRESHOLD_UNITS, Threshold
from calfsocket.study.materials import LawOrFile, MaterialSetEntry
from calfsocket.study.quantities import File, Name
from calfsocket.study.sockets import SocketEntry

REFERENCE_SOCKETS = ("TC", "TSB", "HS")
Number = Annotated[float, Field(strict=True)]
Outcome = Literal[
    "contact_pressure_mean",
    "contact_pressure_max",
    "contact_share",
    "effective_stress",
    "shear_stress",
    "amp_log_strain",
    "shear_log_strain",
    "pressure",
]


class StudyTable(Strict):
    """What is solved, and where results go."""

    title: Annotated[str, Field(max_length=200)] = ""
    out: Annotated[str, Field(min_length=1, max_length=200)] = "results"
    limb: File | None = None
    sockets: tuple[Name, ...] = ()
    materials: tuple[Name, ...] = ()
    outcomes: tuple[Outcome, ...] = (
        "contact_pressure_mean",
        "contact_pressure_max",
        "effective_stress",
    )

    @field_validator("sockets", "materials", "outcomes")
    @classmethod
    def _once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if value.count(name) > 1:
                raise ValueError(f"'{name}' stands there twice; name it once")
        return value

    @field_validator("out")
    @classmethod
    def _inside(cls, value: str) -> str:
        parts = value.replace("\\", "/").split("/")
        if value.startswith(("/", "~")) or ".." in parts or ":" in value or not value.isprintable():
            raise ValueError(
                f"{value!r} leads elsewhere; give a folder below the one you are in, or use --out"
            )
        return value


class ModelTable(Strict):
    """What all cases share unless a case or the sweep changes it."""

    size: str | Annotated[int, Field(strict=True)] = Field(
        default="paper", description="coarse, medium or paper, or the number of triangles"
    )
    friction: Annotated[Number, Field(ge=0)] = ContactParameters.fric_coeff
    socket_support: SocketSupport = "floating"
    fascia_c10: FasciaC10 = "printed"
    ogden_form: OgdenForm = "abaqus"
    gamma: Annotated[Number, Field(gt=0, description="MPa/mm")] = ContactParameters.gamma
    gamma_t: Annotated[Number, Field(gt=0, description="MPa/mm")] = ContactParameters.gamma_t

    @field_validator("size", mode="before")
    @classmethod
    def _a_size(cls, value: object) -> str:
        if isinstance(value, bool) or not isinstance(value, str | int):
            raise ValueError(
                f"is {value!r}; give coarse, medium or paper, or a number of triangles"
            )
        try:
            return mesh_size(str(value)).name
        except InputError as error:
            raise ValueError(str(error).removeprefix("size: ")) from None


class StepsTable(Strict):
    """Load steps: the load is the share of the overlap that is released, 0 to 1."""

    first: Annotated[Number, Field(gt=0, le=1)] = StepControl.first
    largest: Annotated[Number, Field(gt=0, le=1)] = StepControl.largest
    smallest: Annotated[Number, Field(gt=0, le=1)] = StepControl.smallest

    @model_validator(mode="after")
    def _in_order(self) -> "StepsTable":
        if not self.smallest <= self.first <= self.largest:
            raise ValueError(
                f"smallest {self.smallest:g}, first {self.first:g} and largest {self.largest:g} "
                "must not fall in this order"
            )
        return self


class ThresholdTable(Strict):
    """A level of an outcome; the summary then tells how much of the tissue is beyond it."""

    outcome: Literal[tuple(THRESHOLD_UNITS)]  # type: ignore[valid-type]
    tissue: Literal[SUMMARY_TISSUES] = "skin"  # type: ignore[valid-type]
    value: Annotated[str, Field(description="with its unit", examples=["60 kPa", "50 %"])]

    @model_validator(mode="after")
    def _is_one(self) -> "ThresholdTable":
        self.threshold()
        return self

    def threshold(self) -> Threshold:
        """Return it in the outcome's unit."""
        in_percent = THRESHOLD_UNITS[self.outcome] == "%"
        value = 100 * SHARE.parse(self.value) if in_percent else 1e3 * STRESS.parse(self.value)
        return Threshold(self.outcome, self.tissue, value)


class CaseTable(Strict):
    """A socket with a material set, and parameters of its own: dotted name -> value."""

    socket: Name
    materials: Name
    label: Name | None = None
    set: dict[str, Any] = Field(default_factory=dict)


class SweepTable(Strict):
    """Parameters with their values: all combinations (grid), or one after the other (list)."""

    grid: dict[str, Any] | None = None
    list: dict[str, Any] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "SweepTable":
        if (self.grid is None) == (self.list is None):
            raise ValueError("give either grid or list")
        return self


class Document(Strict):
    """A whole study file."""

    study: StudyTable = Field(default_factory=StudyTable)
    model: ModelTable = Field(default_factory=ModelTable)
    steps: StepsTable = Field(default_factory=StepsTable)
    sockets: dict[Name, SocketEntry] = Field(default_factory=dict)
    materials: dict[Name, MaterialSetEntry] = Field(default_factory=dict)
    laws: dict[str, LawOrFile] = Field(
        default_factory=dict,
        description="laws of tissues in the place of Table 1's, in every material set",
    )
    thresholds: tuple[ThresholdTable, ...] = ()
    cases: tuple[CaseTable, ...] = ()
    sweep: SweepTable | None = None

    @field_validator("sockets")
    @classmethod
    def _not_a_reference(cls, value: dict[str, Any]) -> dict[str, Any]:
        return _own_names(value, REFERENCE_SOCKETS, "a socket of the reference data")

    @field_validator("materials")
    @classmethod
    def _not_the_papers(cls, value: dict[str, Any]) -> dict[str, Any]:
        return _own_names(value, BASE_SETS, "a set of the paper")


def _own_names(value: dict[str, Any], taken: tuple[str, ...], what: str) -> dict[str, Any]:
    for name in value:
        if name in taken:
            raise ValueError(f"'{name}' is {what}; choose another name, with like = '{name}' in it")
    return value
