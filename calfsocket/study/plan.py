"""From a checked study file to cases: every socket's shape, every law, nothing solved."""

import difflib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from calfsocket.contact.nitsche import ContactParameters
from calfsocket.io.errors import InputError, error_context
from calfsocket.io.schema import checked, nearest
from calfsocket.materials.laws import Law
from calfsocket.materials.material_set import BASE_SETS, BaseSet, MaterialSet
from calfsocket.mechanics.stepping import StepControl
from calfsocket.meshes.data import Limb, Shape, Sockets
from calfsocket.meshes.placement import Placement, check_placement
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation.case import Case, Settings, material_set
from calfsocket.study import parameters as changes
from calfsocket.study.document import REFERENCE_SOCKETS, Document
from calfsocket.study.files import Files
from calfsocket.study.materials import MaterialSetEntry, laws
from calfsocket.study.parameters import Changes, Labels

MOST_CASES = 1000


@dataclass(frozen=True)
class Plan:
    """What a study file asks for.

    Attributes
    ----------
    document : Document
        The file, checked.
    settings : Settings
        Shared by all cases that have none of their own.
    cases : tuple of Case
        In the order of the file.
    sockets : Sockets
        TC, TSB and HS.
    shapes : mapping of str to Shape
        The other sockets of the cases.
    limb : Limb
        The section.
    placements : mapping of str to Placement
        How each socket of the cases sits on the limb.
    thresholds : tuple of Threshold
        What the summary tells besides.
    parameters : tuple of str
        Dotted names of what a sweep changes, in the order of the file.
    """

    document: Document
    settings: Settings
    cases: tuple[Case, ...]
    sockets: Sockets
    shapes: Mapping[str, Shape]
    limb: Limb
    placements: Mapping[str, Placement]
    thresholds: tuple[Threshold, ...]
    parameters: tuple[str, ...]


@dataclass(frozen=True)
class _Asked:
    """A case as asked for: names, what is changed for it, and where the file says so."""

    socket: str
    materials: str
    changes: Changes = field(hash=False)
    label: str
    place: str


class Planner:
    """Makes a plan of the content of a study file.

    Parameters
    ----------
    path : Path
        The file, for messages.
    content : mapping
        As parsed.
    files : Files
        What the file may name.
    limb : Limb
        The section.
    reference : Sockets
        TC, TSB and HS.

    Raises
    ------
    InputError
        One line: file, key, what is allowed, what to do.
    """

    def __init__(
        self,
        path: Path,
        content: Mapping[str, Any],
        files: Files,
        limb: Limb,
        reference: Sockets,
    ) -> None:
        self._path, self._content, self._files = path, content, files
        self._limb, self._reference = limb, reference
        self._documents: dict[str, Document] = {}

    def plan(self) -> Plan:
        """Return the plan."""
        document = self._document({}, "")
        self._check_names(document)
        with error_context(self._path):
            points = changes.points(document.sweep)
        swept = tuple(points[0])
        asked = list(self._asked(document))
        for place, names in (("sweep", points[0]), *((a.place, a.changes) for a in asked)):
            with error_context(self._path, place):
                changes.applied(self._content, names)
        labels = Labels([*swept, *(name for each in asked for name in each.changes)], points)
        shared = self._settings(document)
        cases: dict[tuple[str, str], Case] = {}
        shapes: dict[str, Shape] = {}
        seen: set[tuple[_Asked, str]] = set()
        for each in asked:
            for number, point in enumerate(points, 1):
                own = changes.reaching({**each.changes, **point}, each.socket, each.materials)
                done = (each, json.dumps(own, default=str))
                if done in seen:
                    continue
                seen.add(done)
                case, shape = self._case(each, own, point, number, labels, shared)
                if case.key in cases:
                    raise InputError(
                        f"{self._path}: {each.place}: two cases would be called {case.name}; "
                        "give each a label of its own"
                    )
                cases[case.key] = case
                shapes[case.socket] = shape
                if len(cases) > MOST_CASES:
                    raise InputError(
                        f"{self._path}: more than {MOST_CASES} cases; make several studies"
                    )
        self._check_folders(cases)
        for name in swept:
            if not any(name in case.changes for case in cases.values()):
                raise InputError(
                    f"{self._path}: sweep: {name} reaches no case; add its socket or material set "
                    "to the study, or leave it out"
                )
        shapes = {k: v for k, v in shapes.items() if k not in self._reference.sockets}
        placements = self._placements(cases.values(), shapes)
        return Plan(
            document=document,
            settings=shared,
            cases=tuple(cases.values()),
            sockets=self._reference,
            shapes=shapes,
            limb=self._limb,
            placements=placements,
            thresholds=tuple(each.threshold() for each in document.thresholds),
            parameters=swept,
        )

    def _asked(self, document: Document) -> Iterator[_Asked]:
        """List the cases of the file before any sweep."""
        study = document.study
        if document.cases and (study.sockets or study.materials):
            raise InputError(
                f"{self._path}: cases: give either [[cases]], or study.sockets and "
                "study.materials, whose combinations are the cases"
            )
        for number, table in enumerate(document.cases):
            own = changes.flat(table.set)
            yield _Asked(table.socket, table.materials, own, table.label or "", f"cases.{number}")
        if not document.cases:
            for key in ("sockets", "materials"):
                if not getattr(study, key):
                    raise InputError(
                        f"{self._path}: study.{key}: names nothing, so there is no case; name at "
                        f"least one of {', '.join(self._known(document, key))}, or add [[cases]]"
                    )
            for socket in study.sockets:
                for materials in study.materials:
                    yield _Asked(socket, materials, {}, "", "study")

    def _known(self, document: Document, key: str) -> list[str]:
        own = {"sockets": REFERENCE_SOCKETS, "materials": BASE_SETS}[key]
        return [*own, *getattr(document, key)]

    def _check_names(self, document: Document) -> None:
        """Refuse names of sockets, sets and tissues that do not exist."""
        named = [("study.sockets", "sockets", name) for name in document.study.sockets]
        named += [("study.materials", "materials", name) for name in document.study.materials]
        for number, case in enumerate(document.cases):
            named.append((f"cases.{number}.socket", "sockets", case.socket))
            named.append((f"cases.{number}.materials", "materials", case.materials))
        for place, key, name in named:
            known = self._known(document, key)
            if name not in known:
                what = "socket" if key == "sockets" else "material set"
                raise InputError(
                    f"{self._path}: {place}: no {what} '{name}'; {nearest(name, known)}"
                )
        for name, entry in document.materials.items():
            self._check_tissues(f"materials.{name}", entry.model_extra or {}, [entry.like])
        used = [*document.study.materials, *(case.materials for case in document.cases)]
        own = {name: entry.like for name, entry in document.materials.items()}
        sets = [own.get(name, cast(BaseSet, name)) for name in used]
        self._check_tissues("laws", document.laws, sets)

    def _check_tissues(self, place: str, entries: Mapping[str, Any], sets: list[BaseSet]) -> None:
        regions = [region.name for region in self._limb.regions]
        tissues = [name for each in sets for name in MaterialSet.paper(each).laws]
        for name in entries:
            if name not in (*tissues, *regions):
                near = difflib.get_close_matches(name, [*tissues, *regions], n=1)
                hint = (
                    f"did you mean '{near[0]}'?"
                    if near
                    else f"allowed: {', '.join(dict.fromkeys(tissues))}, or a region such as "
                    f"'{regions[0]}' (`show` draws them)"
                )
                raise InputError(
                    f"{self._path}: {place}.{name}: no tissue or region '{name}'; {hint}"
                )

    def _document(self, own: Changes, place: str) -> Document:
        """Return the file, checked, with some parameters changed."""
        key = json.dumps(own, default=str)
        if key not in self._documents:
            with error_context(self._path, place):
                content = changes.applied(self._content, own)
            origin = f"{place}: with {_words(own)}: " if own else ""
            self._documents[key] = checked(self._path, content, Document, origin)
        return self._documents[key]

    def _case(
        self,
        asked: _Asked,
        own: Changes,
        point: Changes,
        number: int,
        labels: Labels,
        shared: Settings,
    ) -> tuple[Case, Shape]:
        place = "sweep" if any(name in own for name in point) else asked.place
        document = self._document(own, place)
        if own:
            self._check_names(document)
        shown = {name: value for name, value in own.items() if not asked.label or name in point}
        to_set = {name: value for name, value in shown.items() if name.startswith("materials.")}
        to_socket = {name: value for name, value in shown.items() if name not in to_set}
        socket = _joined(asked.socket, asked.label, labels.of(to_socket, number))
        materials = _joined(asked.materials, labels.of(to_set, number))
        entry = document.materials.get(asked.materials)
        shape, wall = self._socket(document, asked.socket)
        settings = self._settings(document, entry, wall)
        self._check_room(asked, entry, settings)
        case = Case(
            socket=socket,
            material_set=materials,
            base=entry.like if entry else _paper_set(asked.materials, materials),
            settings=None if settings == shared else settings,
            changes=dict(own),
        )
        return case, shape

    def _socket(self, document: Document, name: str) -> tuple[Shape, dict[str, Law]]:
        """Return a socket's shape, and the law of its wall where it has one of its own."""
        if name in REFERENCE_SOCKETS:
            return self._reference.sockets[name], {}
        entry = document.sockets[name]
        with error_context(self._path, f"sockets.{name}"):
            shape = entry.shape(self._files, self._reference.sockets)
            law = entry.material()
        return shape, {"socket": law} if law else {}

    def _settings(
        self,
        document: Document,
        entry: MaterialSetEntry | None = None,
        wall: Mapping[str, Law] | None = None,
    ) -> Settings:
        model, steps = document.model, document.steps
        with error_context(self._path):
            own = laws(document.laws, self._files)
            own |= entry.laws(self._files) if entry else {}
        return Settings(
            size=str(model.size),
            socket_support=model.socket_support,
            fascia_c10=model.fascia_c10,
            ogden_form=model.ogden_form,
            materials={**own, **(wall or {})},
            contact=ContactParameters(
                fric_coeff=model.friction, gamma=model.gamma, gamma_t=model.gamma_t
            ),
            steps=StepControl(first=steps.first, largest=steps.largest, smallest=steps.smallest),
        )

    def _check_room(
        self, asked: _Asked, entry: MaterialSetEntry | None, settings: Settings
    ) -> None:
        """Refuse a limb that cannot give way: a socket takes some of its area."""
        if entry is None:
            return
        case = Case(asked.socket, asked.materials, entry.like)
        with error_context(self._path, f"materials.{asked.materials}"):
            material_set(case, settings, [region.name for region in self._limb.regions])

    def _check_folders(self, cases: Mapping[tuple[str, str], Case]) -> None:
        """Refuse two cases with one folder, also where capitals make no difference."""
        folders: dict[str, Case] = {}
        for case in cases.values():
            other = folders.setdefault(case.name.casefold(), case)
            if other is not case:
                raise InputError(
                    f"{self._path}: the cases {other.socket} with {other.material_set} and "
                    f"{case.socket} with {case.material_set} would share the folder {case.name}; "
                    "rename a socket or a material set"
                )

    def _placements(
        self, cases: Iterable[Case], shapes: Mapping[str, Shape]
    ) -> dict[str, Placement]:
        """Measure how each socket sits on the limb, and refuse one that does not."""
        sockets = self._reference.model_copy(
            update={"sockets": {**self._reference.sockets, **shapes}}
        )
        of_shape: dict[str, Placement] = {}
        found: dict[str, Placement] = {}
        for case in cases:
            socket = sockets.socket(case.socket)
            shape = socket.model_dump_json(exclude={"name"})
            if shape not in of_shape:
                with error_context(self._path, f"sockets.{case.socket.split('@')[0]}"):
                    of_shape[shape] = check_placement(socket, self._limb)
            found[case.socket] = of_shape[shape]
        return found


def _words(own: Changes) -> str:
    return ", ".join(f"{name} = {value!r}" for name, value in own.items())


def _joined(*words: str) -> str:
    return "@".join(word for word in words if word)


def _paper_set(name: str, label: str) -> BaseSet | None:
    """Return the set of the paper that a label stands for; None where it is called so."""
    return None if name == label else cast(BaseSet, name)
