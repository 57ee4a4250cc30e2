"""A study file as checked tables, and their JSON schema for editors."""

import json
from collections.abc import Container
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from calfsocket.contact.parameters import Contact
from calfsocket.imaging.layer_thickness import LayerThickness
from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict
from calfsocket.io.units import SHARE, STRESS
from calfsocket.materials.laws import OgdenForm
from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import BASE_SETS
from calfsocket.materials.tissues import FasciaC10
from calfsocket.mechanics.donning import Donning, SocketSupport
from calfsocket.mechanics.load_steps import LoadSteps
from calfsocket.mechanics.loading import Carried, Loading, Stage, check_carried, check_names
from calfsocket.meshes.sizing import checked_size
from calfsocket.meshes.socket import SocketTable, reference_sockets
from calfsocket.postprocess.quantities import REPORTED
from calfsocket.postprocess.thresholds import THRESHOLD_UNITS, Threshold
from calfsocket.study.materials import LawOrFile, MaterialSetTable
from calfsocket.study.names import File, Name
from calfsocket.study.sweep import Sweep
from calfsocket.uncertainty.inputs import Uncertainty

SCHEMA_FILE = "study.schema.json"

Quantity = Literal[
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
    """What is solved, and where results go.

    Attributes
    ----------
    title : str
        Heading of the report.
    out : str
        Folder of the results, below the current one.
    limb : str, optional
        JSON file of a limb; the reference calf unless given.
    sockets : tuple of str
        TC, TSB, HS, or sockets of the file.
    materials : tuple of str
        separate, combined, or material sets of the file.
    quantities : tuple of str
        Columns of sweep.csv.
    mesh_error : bool
        Whether each case is solved on a second mesh, too, for the mesh error of every number.
    """

    title: Annotated[str, Field(max_length=200)] = ""
    out: Annotated[str, Field(min_length=1, max_length=200)] = "results"
    limb: File | None = None
    sockets: tuple[Name, ...] = ()
    materials: tuple[Name, ...] = ()
    quantities: tuple[Quantity, ...] = (
        "contact_pressure_mean",
        "contact_pressure_max",
        "effective_stress",
    )
    mesh_error: Annotated[bool, Field(strict=True)] = False

    @field_validator("sockets", "materials", "quantities")
    @classmethod
    def _once(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if value.count(name) > 1:
                raise ValueError(f"'{name}' is listed twice; list it once")
        return value

    @field_validator("out")
    @classmethod
    def _inside(cls, value: str) -> str:
        parts = value.replace("\\", "/").split("/")
        if value.startswith(("/", "~")) or ".." in parts or ":" in value or not value.isprintable():
            raise ValueError(
                f"{value!r} is outside the current folder; name a folder inside it, or use --out"
            )
        return value


class ModelTable(Contact):
    """What all cases share unless a case or the sweep changes it.

    Attributes
    ----------
    size : str or int
        Mesh: coarse, medium or paper, or the number of triangles. adaptive: at most 60 000 of them,
        where a first solution has its errors; adaptive-40000: at most so many.
    socket_support : str
        Whether the socket rests on the limb alone or is fixed at its outer face.
    donning : str
        How the socket is put on: gap closes the gaps in proportion; expanded starts with a wide
        socket, moves it over the limb and lets it go. Shear and skin stress depend on it.
    socket_carried : str
        How loads after donning act on the socket's outer face: a rigid frame carries it, or they
        are spread evenly over it.
    fascia_c10 : str
        C10 of fascia: 4.91 MPa as printed, or 0.491 MPa, which the paper's tables need.
    ogden_form : str
        Factor of Ogden's terms in the paper's laws: 2 mu/alpha^2, or mu/alpha as printed.
    """

    size: str | Annotated[int, Field(strict=True)] = "paper"
    socket_support: SocketSupport = "floating"
    donning: Donning = "gap"
    socket_carried: Carried = "frame"
    fascia_c10: FasciaC10 = "printed"
    ogden_form: OgdenForm = "abaqus"

    @field_validator("size", mode="before")
    @classmethod
    def _is_a_size(cls, value: Any) -> str:
        try:
            return checked_size(value).name
        except InputError as error:
            raise ValueError(str(error).removeprefix("mesh size: ")) from None

    @property
    def contact(self) -> Contact:
        """Friction and Nitsche stiffness alone."""
        return Contact(**{key: getattr(self, key) for key in Contact.model_fields})


class ThresholdTable(Strict):
    """A level of a quantity; the summary has the share of the tissue beyond it.

    Attributes
    ----------
    quantity, tissue : str
        What is compared, and where.
    value : str
        The level, with its unit.
    """

    quantity: Literal[tuple(THRESHOLD_UNITS)]  # type: ignore[valid-type]
    tissue: Literal[REPORTED] = "skin"  # type: ignore[valid-type]
    value: Annotated[str, Field(examples=["60 kPa", "50 %"])]

    @model_validator(mode="after")
    def _is_valid(self) -> "ThresholdTable":
        self.threshold()
        return self

    def threshold(self) -> Threshold:
        """Return it in the quantity's unit."""
        in_percent = THRESHOLD_UNITS[self.quantity] == "%"
        value = 100 * SHARE.parse(self.value) if in_percent else 1e3 * STRESS.parse(self.value)
        return Threshold(self.quantity, self.tissue, value)


class CaseTable(Strict):
    """A socket with a material set, and custom parameters.

    Attributes
    ----------
    socket, materials : str
        Names, as in `study`.
    label : str, optional
        Part of the case's name; the values set unless given.
    set : mapping
        Dotted name of a parameter -> value.
    """

    socket: Name
    materials: Name
    label: Name | None = None
    set: dict[str, Any] = Field(default_factory=dict)


class Document(Strict):
    """A whole study file."""

    study: StudyTable = Field(default_factory=StudyTable)
    model: ModelTable = Field(default_factory=ModelTable)
    steps: LoadSteps = Field(default_factory=LoadSteps)
    layers: LayerThickness = Field(default_factory=LayerThickness)
    liner: Liner | None = None
    sockets: dict[Name, SocketTable] = Field(default_factory=dict)
    materials: dict[Name, MaterialSetTable] = Field(default_factory=dict)
    laws: dict[str, LawOrFile] = Field(
        default_factory=dict,
        description="laws of tissues in the place of Table 1's, in every material set",
    )
    thresholds: tuple[ThresholdTable, ...] = ()
    loads: Annotated[
        tuple[Stage, ...],
        Field(description="stages of loading after donning, one after the other"),
    ] = ()
    cases: tuple[CaseTable, ...] = ()
    sweep: Sweep | None = None
    uncertainty: Uncertainty | None = None

    @model_validator(mode="before")
    @classmethod
    def _in_their_tables(cls, data: Any) -> Any:
        """Say where a key belongs that stands above the tables, or in another one."""
        content = data if isinstance(data, dict) else {}
        tables: dict[str, type[Strict]] = {
            "": cls,
            "study": StudyTable,
            "model": ModelTable,
            "steps": LoadSteps,
            "layers": LayerThickness,
            "liner": Liner,
        }
        for place, table in tables.items():
            written = content.get(place) if place else content
            for key in written if isinstance(written, dict) else ():
                homes = [name for name, each in tables.items() if key in each.model_fields]
                if homes and key not in table.model_fields:
                    where = f"the table [{homes[0]}]" if homes[0] else "a table of its own"
                    raise ValueError(f"{place}{place and '.'}{key}: belongs in {where}; move it")
        return data

    @field_validator("loads")
    @classmethod
    def _names_differ(cls, value: tuple[Stage, ...]) -> tuple[Stage, ...]:
        check_names(value)
        return value

    @model_validator(mode="after")
    def _loads_are_carried(self) -> "Document":
        try:
            check_carried(self.loads, self.model.socket_carried)
        except ValueError as error:
            raise ValueError(f"model.socket_carried: {error}") from None
        return self

    @model_validator(mode="after")
    def _one_way_to_change(self) -> "Document":
        if self.sweep and self.uncertainty:
            raise ValueError("sweep: cannot be combined with uncertainty; remove one of the two")
        return self

    @property
    def loading(self) -> Loading | None:
        """The stages of loading, if there are any."""
        carried = self.model.socket_carried
        return Loading(stages=self.loads, carried=carried) if self.loads else None

    @field_validator("sockets")
    @classmethod
    def _not_a_reference(cls, value: dict[str, Any]) -> dict[str, Any]:
        return _custom_names(value, reference_sockets(), "a reference socket")

    @field_validator("materials")
    @classmethod
    def _not_the_papers(cls, value: dict[str, Any]) -> dict[str, Any]:
        return _custom_names(value, BASE_SETS, "a set of the paper")


def _custom_names(value: dict[str, Any], taken: Container[str], what: str) -> dict[str, Any]:
    for name in value:
        if name in taken:
            raise ValueError(
                f"'{name}' is {what}; choose another name, and write like = '{name}' in the table "
                "to start from it"
            )
    return value


def schema_text() -> str:
    """Return the JSON schema of study files, by which editors complete and check them."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Document.model_json_schema(),
        "title": "calfsocket study",
    }
    return json.dumps(schema, indent=2, ensure_ascii=False) + "\n"
