"""Files that a study file names: read once, from beside it, and kept for run.json."""

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable, read_toml
from calfsocket.materials.file import law_in
from calfsocket.materials.laws import Law
from calfsocket.meshes.curves import Point


class Files:
    """Outlines and materials by the names that a study file has for them.

    Parameters
    ----------
    folder : Path
        Of the study file.
    recorded : mapping, optional
        Content of the files of an earlier run, from its run.json: read in their place.
    """

    def __init__(self, folder: Path, recorded: Mapping[str, Any] | None = None) -> None:
        self._folder = folder
        self._recorded = recorded
        self._content: dict[str, dict[str, Any]] = {}

    @property
    def record(self) -> dict[str, dict[str, Any]]:
        """What was read so far: name -> sha256 and content."""
        return dict(sorted(self._content.items()))

    def outline(self, name: str) -> tuple[Point, ...]:
        """Points of an outline, mm."""
        from calfsocket.meshes.outline import read_outline

        return tuple((float(x), float(y)) for x, y in self._read(name, read_outline))

    def law(self, name: str) -> Law:
        """Law of a material file."""
        return law_in(self._folder / name, self._read(name, read_toml))

    def laws(self, tables: Mapping[str, Any]) -> dict[str, Law]:
        """Laws by name, of tables that are laws or name material files."""
        return {
            name: table if isinstance(table, Law) else self.law(table.file)
            for name, table in tables.items()
        }

    def _read(self, name: str, read: Callable[[Path], Any]) -> Any:
        """Return the content of a file, which is read once."""
        if name not in self._content:
            if self._recorded is None:
                path = self._folder / name
                check_readable(path)
                content = read(path)
                self._content[name] = {"sha256": sha256(path), "content": content}
            elif name in self._recorded:
                self._content[name] = dict(self._recorded[name])
            else:
                raise InputError(f"{name}: is not one of the files recorded in that run.json")
        return self._content[name]["content"]


def sha256(path: Path) -> str:
    """Return the hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
