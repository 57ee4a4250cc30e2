"""Files read into frozen, checked models; what is wrong is said in one line."""

import difflib
import json
import stat
import tomllib
from collections.abc import Collection
from contextlib import nullcontext
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from calfsocket.io.errors import InputError

#: Largest file that is read, bytes. The largest of the package's own has 30 kB.
MAX_BYTES = 10_000_000
#: The same of TOML, whose reader takes 17 s for a key of 200 kB.
MAX_TOML_BYTES = 50_000


def nearest(key: str, allowed: Collection[str]) -> str:
    """Return "did you mean ...?" when a name is likely misspelt, else the names allowed."""
    close = difflib.get_close_matches(key, allowed, n=1)
    return f"did you mean '{close[0]}'?" if close else f"allowed: {', '.join(sorted(allowed))}"


class Strict(BaseModel):
    """A model that cannot be changed and that takes no key it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        """Name the nearest key when one is unknown, which pydantic's own check does not."""
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    raise ValueError(f"unknown key '{key}'; {nearest(key, cls.model_fields)}")
        return data


Model = TypeVar("Model", bound=BaseModel)


def read_json(path: Path, model: type[Model]) -> Model:
    """Read and check a file; raise an InputError naming the file and the key otherwise."""
    try:
        content = json.loads(read_text(path), object_pairs_hook=_unique)
    except InputError:
        raise
    except ValueError as error:  # no JSON, a repeated key, a number of 5000 digits
        raise InputError(f"{path}: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: is nested too deeply") from error
    return checked(path, content, model)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a file of tables; raise an InputError naming it otherwise."""
    text = read_text(path, MAX_TOML_BYTES)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # no TOML, a number of 5000 digits
        raise InputError(f"{path}: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: is nested too deeply") from error


def check_readable(path: Path, most: int = MAX_BYTES) -> None:
    """Raise an InputError unless this is a file that can be read and is not too large.

    Pipes and devices are none: to read them may never end.
    """
    try:
        status = path.stat()
        with path.open("rb") if stat.S_ISREG(status.st_mode) else nullcontext():
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:  # a NUL in its name
        raise InputError(f"{str(path)!r}: cannot be read ({error})") from error
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{path}: is no file; give the name of one")
    if status.st_size > most:
        raise InputError(
            f"{path}: has {status.st_size / 1e6:.3g} MB; at most {most / 1e6:g} MB are read"
        )


def read_text(path: Path, most: int = MAX_BYTES) -> str:
    """Read a file of so many bytes at most as UTF-8; raise an InputError naming it otherwise."""
    check_readable(path, most)
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text ({error.reason})") from error


def checked(path: Path, content: Any, model: type[Model]) -> Model:
    """Check the parsed content of a file; raise an InputError naming the file and the key."""
    try:
        return model.model_validate(content)
    except UnicodeEncodeError as error:  # in a key; in a text it is a ValidationError
        raise InputError(
            f"{path}: {error.object!r} holds half a character; write it whole"
        ) from error
    except ValidationError as error:
        first = error.errors()[0]
        place = place_in(content, first["loc"], first["type"] == "missing")
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{path}: {place + ': ' if place else ''}{message}") from error


def place_in(content: Any, parts: tuple[int | str, ...], missing: bool) -> str:
    """Return the path to a place in the file, without what pydantic adds: the kind of a union.

    Where the last part of the path is what is missing from the file, it is kept.
    """
    keys = []
    for number, part in enumerate(parts):
        known = isinstance(content, dict) and part in content
        listed = isinstance(content, list) and isinstance(part, int) and part < len(content)
        if known or listed:
            content = content[part]
        elif not (missing and number == len(parts) - 1):
            continue
        keys.append(str(part))
    return ".".join(keys)


class _RepeatedKeyError(ValueError):
    """A key stands twice in one object; JSON readers would silently take the last."""


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make an object of its pairs, refusing repeated keys."""
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise _RepeatedKeyError(f"key '{key}' stands twice in one object; keep one")
        content[key] = value
    return content
