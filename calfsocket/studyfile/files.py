"""Files that a study file names: read once, from beside it, and kept for run.json."""

import hashlib
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from calfsocket.errors import InputError
from calfsocket.laws import Law
from calfsocket.material_entry import entry_of
from calfsocket.meshes.data import Point
from calfsocket.meshes.schema import checked

LARGEST_MB = 20
"""No outline, material or study is that large; a disk image given by mistake is."""


def regular_file(path: Path) -> Path:
    """Return a path to read.

    Raises
    ------
    InputError
        When it is no file, such as a device that never ends, or too large.
    """
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # a zero byte
        raise InputError(f"{str(path)!r}: cannot be read ({error})") from None
    if not path.is_file():
        raise InputError(f"{path}: is no file; name a file")
    if size > LARGEST_MB * 10**6:
        raise InputError(
            f"{path}: {size / 1e6:.0f} MB; files of a study have at most {LARGEST_MB} MB"
        )
    return path


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
        if name not in self._content:
            from calfsocket.meshes.outline import read_outline  # readers of drawings take a second

            self._read(name, read_outline)
        points = self._content[name]["content"]
        return tuple((float(x), float(y)) for x, y in points)

    def law(self, name: str) -> Law:
        """Law of a material file."""
        if name not in self._content:
            self._read(name, _parsed_toml)
        content = self._content[name]["content"]
        path = self._folder / name
        try:
            model = entry_of(content)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        return checked(path, content, model).to_law()

    def _read(self, name: str, read: Callable[[Path], Any]) -> None:
        if self._recorded is not None:
            if name not in self._recorded:
                raise InputError(f"{name}: is not among the files of that run")
            self._content[name] = dict(self._recorded[name])
            return
        path = regular_file(self._folder / name)
        content = read(path)
        self._content[name] = {"sha256": sha256(path), "content": content}


def sha256(path: Path) -> str:
    """Return the hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _parsed_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # no UTF-8, no TOML
        raise InputError(f"{path}: {error}") from None
