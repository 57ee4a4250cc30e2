"""Files that a study file names: read once, from beside it, and kept for run.json."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable, read_toml
from calfsocket.materials.file import law_in
from calfsocket.materials.laws import Law
from calfsocket.meshes.drawn import OutlineFile
from calfsocket.meshes.socket import made_in

if TYPE_CHECKING:
    from calfsocket.meshes.outline import ReadOutline


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

    def outline(self, name: str, file: OutlineFile) -> "ReadOutline":
        """Outline of a socket."""
        from calfsocket.meshes.outline import ReadOutline, read_outline

        # One file may hold several outlines.
        unusual = dict(file).items() - dict(OutlineFile()).items()
        how = ", ".join(f"{key} = {value}" for key, value in sorted(unusual))
        content = self._read(name, lambda path: asdict(read_outline(path, file)), how)
        points = tuple((float(x), float(y)) for x, y in content["points"])
        return ReadOutline(points, float(content["deviation"]))

    def socket(self, name: str) -> dict[str, Any]:
        """Outlines of a socket that was cut from its scan, or the mesh of its wall."""
        content: dict[str, Any] = self._read(name, made_in)
        return content

    def law(self, name: str) -> Law:
        """Law of a material file."""
        return law_in(self._folder / name, self._read(name, read_toml))

    def laws(self, tables: Mapping[str, Any]) -> dict[str, Law]:
        """Laws by name, of tables that are laws or name material files."""
        return {
            name: table if isinstance(table, Law) else self.law(table.file)
            for name, table in tables.items()
        }

    def _read(self, name: str, read: Callable[[Path], Any], how: str = "") -> Any:
        """Return the content of a file, which is read once in each way."""
        key = f"{name} ({how})" if how else name
        if key not in self._content:
            if self._recorded is None:
                path = self._folder / name
                check_readable(path)
                content = read(path)
                self._content[key] = {"sha256": sha256(path), "content": content}
            elif key in self._recorded:
                self._content[key] = dict(self._recorded[key])
            else:
                raise InputError(f"{key}: is not one of the files recorded in that run.json")
        return self._content[key]["content"]


def sha256(path: Path) -> str:
    """Return the hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
