"""The cases of a study file: every socket's shape, every law, nothing solved."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

from calfsocket.imaging.layer_thickness import LayerThickness
from calfsocket.io.errors import InputError, error_context
from calfsocket.io.schema import checked, misspelt, nearest
from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import BASE_SETS, BaseSet, MaterialSet
from calfsocket.meshes.levels import Level, LimbLevels, Place, sections
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.lining import Lining
from calfsocket.meshes.placement import (
    Placement,
    askew,
    check_liner_between,
    check_placement,
    check_size_of_rest,
    with_own_mesh,
)
from calfsocket.meshes.sizing import AdaptiveSize, MeshSize, checked_size
from calfsocket.meshes.socket import AnySocket, MeshedSocket, Outline, resolved
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation.record import CaseRecord, StudySource
from calfsocket.study import design, sweep
from calfsocket.study.absent import refuse_absent
from calfsocket.study.document import Document
from calfsocket.study.files import Files
from calfsocket.study.sweep import Changes, Labels, Point
from calfsocket.uncertainty.inputs import Uncertainty

if TYPE_CHECKING:
    from mpi4py import MPI

    from calfsocket.simulation.simulation import Simulation

MOST_CASES = 1000

OF_PLACEMENT = ("sockets.", "liner.")
"""Beginnings of the parameters that decide how a socket sits on the limb."""


@dataclass(frozen=True)
class Case:
    """A socket with a material set, and all that is solved with them.

    The two have the names of the tables, with a label where the case is a variant of those in the
    study file, which are `of`. `document` is the file with the `changes` of the case.
    """

    limb: Limb
    socket: AnySocket
    materials: MaterialSet
    document: Document
    of: tuple[str, str]
    changes: Changes
    placement: Placement
    level: Level | None = None
    row: int | None = None
    """Of the design of uncertain inputs; None of a case that the file asks for."""

    @property
    def place(self) -> Place | None:
        """Where along a limb of many levels its section lies."""
        level = self.level
        return level and Place(height=level.height, height_mm=level.height_mm)

    @property
    def record(self) -> CaseRecord:
        """Its entry in run.json before it is solved."""
        return CaseRecord(
            socket=self.socket.name,
            material_set=self.materials.name,
            of=self.of,
            base_set=self.materials.base,
            axes=self.limb.axes,
            level=self.place,
            changes=dict(self.changes),
        )

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.record.name

    @property
    def key(self) -> tuple[str, str]:
        """Values of the columns that name it in every table."""
        return self.socket.name, self.materials.name

    @property
    def has_mesh_error(self) -> bool:
        """Whether a second mesh is solved, too: not of the many cases of a design."""
        return self.document.study.mesh_error and self.row is None

    @property
    def geometry(self) -> str:
        """What its mesh depends on: cases that share it are solved one after the other."""
        return self.simulation().geometry

    def simulation(
        self, comm: "MPI.Intracomm | None" = None, mesh_size: MeshSize | AdaptiveSize | None = None
    ) -> "Simulation":
        """Return the simulation of the case on a communicator; of its own mesh size by default."""
        from calfsocket.simulation.simulation import Simulation

        model = self.document.model
        return Simulation(
            self.limb,
            self.socket,
            self.materials,
            mesh_size=mesh_size or model.size,
            contact=model.contact,
            support=model.socket_support,
            steps=self.document.steps,
            comm=comm,
            placement=self.placement,
            liner=self.document.liner,
            loading=self.document.loading,
            donning=model.donning,
        )


@dataclass(frozen=True)
class Plan:
    """What a study solves: the cases of its file, or those whose names are chosen.

    `source` repeats it; `parameters` are those of `Planner`.
    """

    source: StudySource
    document: Document
    limb: Limb | LimbLevels
    cases: tuple[Case, ...]
    chosen: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()

    @property
    def to_solve(self) -> tuple[Case, ...]:
        """The chosen cases."""
        return tuple(case for case in self.cases if not self.chosen or case.name in self.chosen)

    @property
    def order(self) -> list[tuple[str, str]]:
        """Keys of all cases, in the order of the tables."""
        return [case.key for case in self.cases]

    @property
    def unused(self) -> list[str]:
        """Dotted names of what the file says and no case has to do with, with the reason."""
        sockets, sets = ({case.of[place] for case in self.cases} for place in (0, 1))
        document, limbs = self.document, sections(self.limb)
        tissues = {word for each in limbs for word in (*each.tissues, *each.tissues.values())}
        found = [f"sockets.{name} (no case)" for name in document.sockets if name not in sockets]
        found += [f"materials.{name} (no case)" for name in document.materials if name not in sets]
        laws = {"laws": document.laws}
        laws |= {f"materials.{name}": table.laws for name, table in document.materials.items()}
        found += [
            f"{place}.{tissue} (the limb has none)"
            for place, of in laws.items()
            for tissue in of
            if tissue not in {*tissues, "combined"}
        ]
        if "quantities" in document.study.model_fields_set and not self.parameters:
            found.append("study.quantities (no sweep)")
        return found

    @property
    def thresholds(self) -> tuple[Threshold, ...]:
        """Levels beyond which the summary counts a share of a tissue."""
        return tuple(each.threshold() for each in self.document.thresholds)

    @property
    def notices(self) -> list[str]:
        """What whoever wrote the files should know of limb and sockets, a line each."""
        lines = [f"limb: {notice}" for notice in self.limb.notices()]
        for case in self.cases:
            lines += [f"sockets.{case.of[0]}: {notice}" for notice in case.socket.notices()]
        return list(dict.fromkeys(lines))

    @property
    def settings(self) -> dict[str, dict[str, Any]]:
        """Tables `model`, `steps` and, if there are any, `layers` and `liner`, defaults filled in.

        What carries the socket is none where nothing loads it.
        """
        shape = dict.fromkeys(Lining.model_fields, True)
        tables = self.document.model_dump(
            mode="json", include={"model": True, "steps": True, "layers": True, "liner": shape}
        )
        tables["layers"] = {key: text for key, text in tables["layers"].items() if text} or None
        loadings = [case.document.loading for case in self.cases]
        if not any(loading and loading.moves_socket for loading in loadings):
            del tables["model"]["socket_carried"]
        return {name: table for name, table in tables.items() if table is not None}

    @cached_property
    def fingerprints(self) -> dict[str, str]:
        """Fingerprint of the inputs of each case, by its name."""
        return {case.name: case.simulation().fingerprint for case in self.cases}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes one doubt laws or places of the cases: the name of each, and why."""
        found = [
            f"materials.{case.materials.name}.{name}: {text}"
            for case in self.cases
            for name, text in case.materials.warnings
        ]
        for case in {(each.socket, id(each.limb)): each for each in self.cases}.values():
            if text := askew(case.socket, case.limb):
                found.append(f"sockets.{case.of[0]}: {text}")
        return tuple(dict.fromkeys(found))


@dataclass(frozen=True)
class _Asked:
    """A case as the file asks for it: names, changes, and where the file says so."""

    socket: str
    materials: str
    changes: Changes = field(hash=False)
    label: str
    place: str


class Planner:
    """Makes the cases of a study file; parameters as of `Study`.

    `document` is the file without changes; `parameters` are the dotted names of what a sweep
    changes, in the order of the file.

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
        limb: Limb | LimbLevels,
        reference: Mapping[str, AnySocket],
    ) -> None:
        self._path, self._content, self._files = path, content, files
        self._reference = reference
        #: Sections with their levels; a limb of one section has none.
        self._sections: tuple[tuple[Limb, Level | None], ...] = (
            tuple((level.limb, level) for level in limb.levels)
            if isinstance(limb, LimbLevels)
            else ((limb, None),)
        )
        self._regions = tuple(
            dict.fromkeys(name for each in sections(limb) for name in each.tissues)
        )
        self._documents: dict[str, Document] = {}
        self._limbs: dict[tuple[int, LayerThickness], Limb] = {}
        self._placements: dict[tuple[AnySocket, int, bool, Liner | None], Placement] = {}
        self.document = self._changed_document({}, "")
        self._check_names(self.document)
        uncertain = self.document.uncertainty
        self._way = "uncertainty" if uncertain else "sweep"
        if uncertain:
            self._points = self._design(uncertain)
        else:
            with error_context(path):
                self._points = sweep.points(self.document.sweep)
        changed = (name for point in self._points for name in point.changes)
        self.parameters = tuple(dict.fromkeys(changed))

    def cases(self) -> tuple[Case, ...]:
        """Return all cases in the order of the file."""
        asked = list(self._asked())
        self._check_changes(asked)
        labels = Labels(
            [*self.parameters, *(name for each in asked for name in each.changes)], self._points
        )
        cases: dict[tuple[str, str], Case] = {}
        seen: set[tuple[_Asked, str]] = set()
        for each in asked:
            for number, point in enumerate(self._points, 1):
                changes = sweep.reaching(
                    {**each.changes, **point.changes}, each.socket, each.materials
                )
                known = (each, json.dumps([changes, point.label], default=str))
                if known in seen or (point.label and not changes):
                    continue
                seen.add(known)
                for case in self._at_levels(each, changes, point, labels, number):
                    if case.key in cases:
                        raise InputError(
                            f"{self._path}: {each.place}: two cases have the name {case.name}; "
                            "give each a label"
                        )
                    cases[case.key] = case
                    if len(cases) > MOST_CASES:
                        raise InputError(
                            f"{self._path}: more than {MOST_CASES} cases; split the study"
                        )
        self._check_folders(cases)
        for name in self.parameters:
            if not any(name in case.changes for case in cases.values()):
                raise InputError(
                    f"{self._path}: {self._way}: {name} affects no case; add its socket or "
                    "material set to the study, or remove it"
                )
        return tuple(cases.values())

    def _design(self, uncertain: Uncertainty) -> list[Point]:
        """Return the file as it is and the cases of the design, whose ends are checked first."""
        place = "uncertainty.inputs"
        for name, key, value in design.ends(uncertain):
            with error_context(self._path, f"{place}: {name}: {key}"):
                changes = design.changes(self._content, uncertain.inputs[name], name, value)
                sweep.applied(self._content, changes)
            at = f"{place}: {name}: {key}"
            document = self._changed_document(changes, at)
            for section in range(len(self._sections)):
                self._limb(section, document, _origin(changes, at, "layers."))
        return design.points(uncertain, self._content)

    # -- what the file asks for -----------------------------------------------------------------

    def _asked(self) -> Iterator[_Asked]:
        """Yield the cases of the file before any sweep."""
        document = self.document
        study = document.study
        if document.cases and (study.sockets or study.materials):
            raise InputError(
                f"{self._path}: cases: give either [[cases]], or study.sockets and "
                "study.materials, which give a case for each combination"
            )
        for number, table in enumerate(document.cases):
            changes = sweep.flat(table.set)
            yield _Asked(
                table.socket, table.materials, changes, table.label or "", f"cases.{number}"
            )
        if not document.cases:
            for key in ("sockets", "materials"):
                if not getattr(study, key):
                    raise InputError(
                        f"{self._path}: study.{key}: is empty, so there are no cases; name at "
                        f"least one of {', '.join(self._known(key))}, or add [[cases]]"
                    )
            for socket in study.sockets:
                for materials in study.materials:
                    yield _Asked(socket, materials, {}, "", "study")

    def _check_changes(self, asked: list[_Asked]) -> None:
        changed = [(self._way, point.changes) for point in self._points]
        changed += [(each.place, each.changes) for each in asked]
        for place, changes in changed:
            with error_context(self._path, place):
                sweep.applied(self._content, changes)

    def _known(self, key: str) -> list[str]:
        ours = {"sockets": tuple(self._reference), "materials": BASE_SETS}[key]
        return [*ours, *getattr(self.document, key)]

    def _check_names(self, document: Document) -> None:
        """Refuse names of sockets, material sets and tissues that do not exist."""
        named = [("study.sockets", "sockets", name) for name in document.study.sockets]
        named += [("study.materials", "materials", name) for name in document.study.materials]
        for number, case in enumerate(document.cases):
            named.append((f"cases.{number}.socket", "sockets", case.socket))
            named.append((f"cases.{number}.materials", "materials", case.materials))
        for place, key, name in named:
            known = self._known(key)
            if name not in known:
                what = "socket" if key == "sockets" else "material set"
                raise InputError(
                    f"{self._path}: {place}: no {what} '{name}'; {nearest(name, known)}"
                )
        for name, table in document.materials.items():
            self._check_laws(f"materials.{name}", table.laws, [table.like])
        used = [*document.study.materials, *(case.materials for case in document.cases)]
        bases = [self._base(document, name) for name in used]
        self._check_laws("laws", document.laws, bases)

    def _base(self, document: Document, name: str) -> BaseSet:
        """Return the set of the paper that a material set is, or starts from."""
        return document.materials[name].like if name in document.materials else name  # type: ignore[return-value]

    def _check_laws(self, place: str, laws: Mapping[str, Any], bases: list[BaseSet]) -> None:
        regions = list(self._regions)
        materials = [name for base in bases for name in MaterialSet.paper(base).laws]
        for name in laws:
            if name not in (*materials, *regions):
                near = misspelt(name, [*materials, *regions])
                hint = (
                    f"did you mean '{near}'?"
                    if near
                    else f"allowed: {', '.join(dict.fromkeys(materials))}, or a region such as "
                    f"'{regions[0]}' (`show` draws them)"
                )
                raise InputError(
                    f"{self._path}: {place}.{name}: no tissue or region '{name}'; {hint}"
                )

    # -- one case -------------------------------------------------------------------------------

    def _changed_document(self, changes: Changes, place: str) -> Document:
        """Return the file, checked, with some parameters changed."""
        key = json.dumps(changes, default=str)
        if key not in self._documents:
            with error_context(self._path, place):
                content = sweep.applied(self._content, changes)
                if changes:  # what is drawn of it is checked, and takes time
                    content.pop("uncertainty", None)
                refuse_absent(content)
            origin = _origin(changes, place)
            if (part := _part_of_liner(self._content, content)) and changes:
                raise InputError(f"{self._path}: {origin}{part}")
            sockets: Any = content.get("sockets")
            for name, table in sockets.items() if isinstance(sockets, dict) else ():
                with error_context(self._path, f"{origin}sockets.{name}"):
                    sockets[name] = resolved(
                        table, self._reference, self._files.outline, self._files.socket
                    )
            _read_liner_law(content, self._files)
            self._documents[key] = checked(self._path, content, Document, origin)
        return self._documents[key]

    def _at_levels(
        self, asked: _Asked, changes: Changes, point: Point, labels: Labels, number: int
    ) -> Iterator[Case]:
        """Yield a case for each section of the limb, from distal to proximal."""
        place = self._way if any(name in changes for name in point.changes) else asked.place
        document = self._changed_document(changes, place)
        if changes:
            self._check_names(document)
        if point.label is None:
            shown = {k: v for k, v in changes.items() if not asked.label or k in point.changes}
            of_set = {k: v for k, v in shown.items() if k.startswith("materials.")}
            of_socket = {k: v for k, v in shown.items() if k not in of_set}
            words = labels.of(of_socket, number), labels.of(of_set, number)
        else:
            words = point.label, ""
        socket = document.sockets.get(asked.socket) or self._reference[asked.socket]
        if len(self._sections) > 1 and isinstance(socket, Outline | MeshedSocket):
            what = "outline" if isinstance(socket, Outline) else "mesh"
            raise InputError(
                f"{self._path}: sockets.{asked.socket}: is one {what}, and the limb has"
                f" {len(self._sections)} levels; use a socket that follows each level, by a law or"
                " like = 'HS'"
            )
        for section, (_, level) in enumerate(self._sections):
            limb = self._limb(section, document, _origin(changes, place, "layers."))
            at = level.label if level else ""
            name = _joined(asked.socket, at, asked.label, words[0])
            self._check_own_meshes(limb, socket, document)
            if document.loading:
                from calfsocket.simulation.simulation import check_loading

                with error_context(self._path):
                    check_loading(document.loading, limb, document.model.socket_support)
            yield Case(
                limb=limb,
                socket=socket.model_copy(update={"name": name}),
                materials=self._materials(document, asked.materials, words[1], limb),
                document=document,
                of=(asked.socket, asked.materials),
                changes=dict(changes),
                placement=self._placement(
                    socket, asked.socket, section, document, _origin(changes, place, *OF_PLACEMENT)
                ),
                level=level,
                row=point.row,
            )

    def _check_own_meshes(self, limb: Limb, socket: AnySocket, document: Document) -> None:
        """Refuse what a body with a mesh of its own cannot be combined with."""
        with error_context(self._path, "model.size"):
            check_size_of_rest(limb, socket, checked_size(document.model.size))
        with error_context(self._path, "liner.bonded"):
            check_liner_between(limb, socket, document.liner)
        own = [name for name, has in with_own_mesh(limb, socket).items() if has]
        if own and document.study.mesh_error:
            raise InputError(
                f"{self._path}: study.mesh_error: needs a second mesh, and the {own[0]} has one of"
                " its own, which is solved as it is; remove it, or --mesh-error"
            )

    def _materials(self, document: Document, name: str, label: str, limb: Limb) -> MaterialSet:
        model = document.model
        paper = MaterialSet.paper(self._base(document, name), model.fascia_c10, model.ogden_form)
        with error_context(self._path):
            laws = self._files.laws(document.laws)
            if name in document.materials:
                laws |= self._files.laws(document.materials[name].laws)
        # `Plan.warnings` says it once for all cases, and where.
        with error_context(self._path, f"materials.{name}"), catch_warnings():
            simplefilter("ignore")
            changed = paper.replace_known(laws, limb.tissues)
            return replace(changed, name=_joined(name, label))

    def _limb(self, section: int, document: Document, place: str) -> Limb:
        """Return a section with layers as thick as the file has them."""
        key = section, document.layers
        if key not in self._limbs:
            limb, level = self._sections[section]
            at = f": level {level.name}" if level else ""
            with error_context(self._path, f"{place}layers{at}"):
                self._limbs[key] = document.layers.of(limb)
        return self._limbs[key]

    def _placement(
        self, socket: AnySocket, name: str, section: int, document: Document, origin: str
    ) -> Placement:
        """Measure how a socket sits on a section, once for each shape; refuse one that does not."""
        floating, liner = document.model.socket_support == "floating", document.liner
        limb, level = self._sections[section]
        key = socket.model_copy(update={"name": ""}), section, floating, liner
        if key not in self._placements:
            place = f"{origin}sockets.{name}" + (f": level {level.name}" if level else "")
            with error_context(self._path, place):
                self._placements[key] = check_placement(
                    socket, limb, floating=floating, liner=liner
                )
        return self._placements[key]

    def _check_folders(self, cases: Mapping[tuple[str, str], Case]) -> None:
        """Refuse two cases with one folder, also where capitals make no difference."""
        folders: dict[str, Case] = {}
        for case in cases.values():
            other = folders.setdefault(case.name.casefold(), case)
            if other is not case:
                raise InputError(
                    f"{self._path}: the cases {'/'.join(other.key)} and "
                    f"{'/'.join(case.key)} would share the folder {case.name}; "
                    "rename a socket or a material set"
                )


def _origin(changes: Changes, place: str, *prefixes: str) -> str:
    """Return where an error comes from: the changes, or those whose names begin so."""
    words = [f"{k} = {v!r}" for k, v in changes.items() if not prefixes or k.startswith(prefixes)]
    return f"{place}: with {', '.join(words)}: " if words else ""


def _part_of_liner(written: Mapping[str, Any], changed: Mapping[str, Any]) -> str:
    """Return what is wrong where changes vary a liner that the file does not have."""
    liner = changed.get("liner")
    whole = isinstance(liner, dict) and {"thickness", "law"} <= liner.keys()
    if "liner" in written or liner is None or whole:
        return ""
    return (
        "the study has no [liner] to vary; add a table [liner] with thickness and law, e.g."
        " thickness = '3 mm' and law = 'silicone'"
    )


def _read_liner_law(content: Mapping[str, Any], files: Files) -> None:
    """Put the law of a material file in the place of its name, if a liner has one."""
    liner = content.get("liner")
    if isinstance(liner, dict) and isinstance(law := liner.get("law"), dict):
        if set(law) == {"file"} and isinstance(law["file"], str):
            liner["law"] = files.law(law["file"])


def _joined(*words: str) -> str:
    return "@".join(word for word in words if word)
