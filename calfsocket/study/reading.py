"""Study files read: TOML as a person writes it, or the run.json of an earlier run."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from calfsocket.io.errors import InputError
from calfsocket.io.schema import checked, read_text, read_toml
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import AnySocket, Sockets, reference_sockets
from calfsocket.study.document import REFERENCE_SOCKETS
from calfsocket.study.files import Files, sha256
from calfsocket.study.plan import Plan, Planner


@dataclass(frozen=True)
class StudyFile:
    """A study file and what it needs to be planned.

    Attributes
    ----------
    path : Path
        The file.
    content : mapping
        As parsed.
    files : Files
        What it names.
    limb : Limb
        The section.
    reference : mapping of str to Socket
        TC, TSB and HS.
    sha256 : mapping of str to str
        Hashes of the files read so far.
    only : tuple of str
        Names of the cases to run; all of the file where empty.
    petsc_options : mapping
        Of the earlier run.
    """

    path: Path
    content: Mapping[str, Any]
    files: Files
    limb: Limb
    reference: Mapping[str, AnySocket]
    sha256: Mapping[str, str]
    only: tuple[str, ...] = ()
    petsc_options: Mapping[str, str] = field(default_factory=dict)

    def plan(self) -> Plan:
        """Return its cases.

        Raises
        ------
        InputError
            One line: file, key, what is allowed, what to do.
        """
        plan = Planner(self.path, self.content, self.files, self.limb, self.reference).plan()
        missing = set(self.only) - {case.name for case in plan.cases}
        if missing:
            raise InputError(
                f"{self.path}: cases: {', '.join(sorted(missing))} are none of the study's; "
                "the file was changed"
            )
        return plan


def read_study(path: Path) -> StudyFile:
    """Read a study file, or the run.json of an earlier run.

    Raises
    ------
    InputError
        When it cannot be read, or names a limb that cannot be used.
    """
    path = Path(path)
    if path.suffix == ".json":
        return _of_run(path)
    content = read_toml(path)
    if not content:
        raise InputError(f"{path}: is empty; `new` writes an example to start from")
    hashes = {path.name: sha256(path)}
    table = content.get("study")
    name = table.get("limb") if isinstance(table, dict) else None
    limb = Limb.reference()
    if isinstance(name, str):
        limb = Limb.read(path.parent / name)
        hashes[name] = sha256(path.parent / name)
    return StudyFile(path, content, Files(path.parent), limb, reference_sockets(), sha256=hashes)


def paper_study() -> StudyFile:
    """Read the study of the paper, which is part of the package."""
    path = Path(str(files("calfsocket.study") / "data" / "paper.toml"))
    return read_study(path)


def example() -> str:
    """Return the example study, a file for people to change."""
    return (files("calfsocket.study") / "data" / "example.toml").read_text(encoding="utf-8")


def _of_run(path: Path) -> StudyFile:
    """Read what an earlier run was made of."""
    run = _parsed_json(path)
    try:
        study = run["study"]
        reference = {"sockets": {name: run["sockets"][name] for name in REFERENCE_SOCKETS}}
        return StudyFile(
            path=path,
            content=dict(study["content"]),
            files=Files(path.parent, dict(study["files"])),
            limb=checked(path, run["limb"], Limb),
            reference=checked(path, reference, Sockets, units_required=False).sockets,
            sha256={path.name: sha256(path), **study["sha256"]},
            only=tuple(run["cases"]),
            petsc_options=_harmless(path, dict(run["petsc_options"])),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: is not the run.json of a study ({type(error).__name__}: {error}); "
            "name a study file, or a run.json that this version wrote"
        ) from None


def _harmless(path: Path, options: dict[str, str]) -> dict[str, str]:
    """Refuse options of PETSc that name files: its viewers would write them anywhere."""
    for name, value in options.items():
        if not (re.fullmatch(r"[a-z0-9_]+", name) and re.fullmatch(r"[\w.+-]*", value)):
            raise InputError(
                f"{path}: petsc_options.{name}: is {value!r}; give it on the command line, "
                "-NAME VALUE, if it is wanted, and take it out here"
            )
    return options


def _parsed_json(path: Path) -> Any:
    try:
        return json.loads(read_text(path))
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{path}: is no JSON: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: is nested too deeply") from None
