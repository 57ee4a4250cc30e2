"""Checked models: built in Python or read from a file, they refuse bad input in the same words."""

import codecs
import difflib
import json
import stat
import tomllib
from collections.abc import Collection, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from calfsocket.io import units
from calfsocket.io.errors import InputError

#: Largest file that is read, bytes. The largest of the package's own has 30 kB.
MAX_BYTES = 10_000_000
#: The same of TOML, whose reader takes 17 s for a key of 200 kB.
MAX_TOML_BYTES = 50_000


def misspelt(key: str, allowed: Collection[str]) -> str | None:
    """Return the name that a key most likely means, if it is really near to one.

    "fricton" is near to "friction", "fad" to "fat", and "angle" to "angle_deg"; "loads" means
    something else than "laws".
    """
    whole = [name for name in allowed if name.startswith(f"{key}_")]
    if len(whole) == 1:  # without its unit, say
        return whole[0]
    # One letter of three is a third of a name; two of five are a slip no more.
    alike = 0.75 if len(key) > 4 else 0.6
    return next(iter(difflib.get_close_matches(key, allowed, n=1, cutoff=alike)), None)


def nearest(key: str, allowed: Collection[str]) -> str:
    """Return "did you mean ...?" when a name is likely misspelt, else the names allowed."""
    near = misspelt(key, allowed)
    return f"did you mean '{near}'?" if near else f"allowed: {', '.join(sorted(allowed))}"


class Strict(BaseModel):
    """A model that cannot be changed and accepts no key that it does not know.

    Built in Python, it raises an `InputError` that names the class and the key; read from a file by
    `checked`, one that names the file and the key. The rest of the message is the same.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise InputError(f"{type(self).__name__}: {first_problem(values, error)}") from None

    # A model with an __init__ of its own would be built through it inside other models, too, and
    # their errors would lose the place: pydantic distinguishes the two by this attribute.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

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
    """Read and check a file whose numbers have the units that it states.

    An `InputError` is one line that names the file and the key.
    """
    return checked(path, parsed_json(path), model, units_required=False)


def parsed_json(path: Path) -> Any:
    """Read a file of JSON; raise an InputError naming it otherwise."""
    text = read_text(path)
    with _parsing(path):
        return json.loads(text, object_pairs_hook=_unique)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a file of tables; raise an InputError naming it otherwise."""
    text = read_text(path, MAX_TOML_BYTES)
    with _parsing(path):
        return tomllib.loads(text)


@contextmanager
def _parsing(path: Path) -> Iterator[None]:
    """Raise an InputError naming the file when its text cannot be parsed."""
    try:
        yield
    except ValueError as error:  # another format, a repeated key, a number of 5000 digits
        kind = "is not JSON: " if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"{path}: {kind}{error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: has too many levels of nesting") from error


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
        raise InputError(f"{path}: is not a regular file; name a file")
    if status.st_size > most:
        raise InputError(
            f"{path}: is {status.st_size / 1e6:.4g} MB; files up to {most / 1e6:g} MB are accepted"
        )


def read_text(path: Path, most: int = MAX_BYTES) -> str:
    """Read a file of so many bytes at most as UTF-8; raise an InputError naming it otherwise."""
    check_readable(path, most)
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors write a byte order mark
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        if error.object.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise InputError(f"{path}: is UTF-16 text; save it as UTF-8") from error
        raise InputError(f"{path}: is not UTF-8 text ({error.reason})") from error


def checked(
    path: Path,
    content: Any,
    model: type[Model],
    origin: str = "",
    units_required: bool = True,
) -> Model:
    """Build a model from the parsed content of a file.

    Parameters
    ----------
    origin : str
        What was changed in the content after reading; it stands first in the message.
    units_required : bool
        Whether quantities with a dimension must be texts with a unit (`io.quantity`), as in all
        files but those that state one unit for all their numbers.

    Raises
    ------
    InputError
        One line: file, origin, key, the value, and what it must be.
    """
    try:
        return model.model_validate(content, context={"units_required": units_required})
    except UnicodeEncodeError as error:  # in a key; in a text it is a ValidationError
        raise InputError(
            f"{path}: {error.object!r} contains an invalid character (half of a surrogate pair); "
            "retype it"
        ) from error
    except ValidationError as error:
        raise InputError(f"{path}: {origin}{first_problem(content, error)}") from None


def first_problem(content: Any, error: ValidationError) -> str:
    """Describe the first problem that pydantic found: the place in the content, then why."""
    first = error.errors()[0]
    place = place_in(content, first["loc"], first["type"] == "missing")
    return f"{place + ': ' if place else ''}{_message(dict(first))}"


_TABLE = "Input should be a table"
_NUMBER = "Input should be a number, without quotes"
_LIST = "Input should be a list in brackets"
_PLAIN = {
    "model_type": _TABLE,
    "dict_type": _TABLE,
    "string_type": "Input should be text in quotes",
    "bool_type": "Input should be true or false",
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "tuple_type": _LIST,
    "list_type": _LIST,
    "string_pattern_mismatch": "Input should be a name of up to 40 letters, digits and . _ + - "
    "that begins with a letter or a digit",
}
"""Words for what pydantic says to programmers, by its name of the error."""

_LIMITS = {
    "greater_than": "gt",
    "greater_than_equal": "ge",
    "less_than": "lt",
    "less_than_equal": "le",
}
"""Where pydantic keeps the limit, by its name of the error."""


def _message(error: dict[str, Any]) -> str:
    """Return what a value is and must be; pydantic has only the latter."""
    text: str = error["msg"]
    if error["type"] == "missing":
        return "is missing; add it"
    if error["type"] == "value_error":
        return text.removeprefix("Value error, ")
    if text.startswith("is not "):
        return text
    if error["type"].startswith("union_tag"):
        context = error["ctx"]
        key = context["discriminator"].strip("'")
        if "tag" not in context:
            return f"{key} is missing; add it"
        return f"{key} is '{context['tag']}'; it must be one of {context['expected_tags']}"
    if error["type"] == "too_short":
        least = error["ctx"]["min_length"]
        text = f"Input should have at least {least} item{'s' if least > 1 else ''}"
    text = _PLAIN.get(error["type"], text)
    if limit := _LIMITS.get(error["type"]):  # in the unit of what was written
        words, _, _ = text.rpartition(" ")
        text = f"{words} {units.like(error['input'], error['ctx'][limit])}"
    said = text.replace("Input should be", "it must be").replace("Input should", "it must")
    return f"is {_shortened(error['input'])}; {said[0].lower()}{said[1:]}"


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


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


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse keys that appear twice in one object; JSON readers would silently take the last."""
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise ValueError(f"key '{key}' appears twice in one object; keep one")
        content[key] = value
    return content
