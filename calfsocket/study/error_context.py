"""Errors of parts, told with the file and the key they belong to."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from calfsocket.io.errors import InputError
from calfsocket.io.schema import place_in
from calfsocket.study.document import Document


@contextmanager
def told(path: Path, place: str = "") -> Iterator[None]:
    """Put the file and the place in it before what the body refuses.

    Raises
    ------
    InputError
        That of the body, with file and place.
    """
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {place + ': ' if place else ''}{error}") from None


def checked_document(path: Path, content: Any, origin: str = "") -> Document:
    """Check the content of a study file.

    Parameters
    ----------
    path : Path
        The file.
    content
        As parsed.
    origin : str
        What was changed in it, told first.

    Raises
    ------
    InputError
        One line: file, origin, key, what it is, what it must be.
    """
    try:
        return Document.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = place_in(content, first["loc"], first["type"] == "missing")
        raise InputError(
            f"{path}: {origin}{place + ': ' if place else ''}{_message(dict(first))}"
        ) from None


_TABLE = "Input should be a table"
_NUMBER = "Input should be a number, without quotes"
_LIST = "Input should be a list in brackets"
_PLAIN = {
    "model_type": _TABLE,
    "dict_type": _TABLE,
    "string_type": "Input should be text in quotes",
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "tuple_type": _LIST,
    "list_type": _LIST,
    "string_pattern_mismatch": "Input should be a name of at most 40 letters, digits, and . _ + - "
    "within, which begins with a letter or digit",
}
"""Words for what pydantic says to programmers, by its name of the error."""


def _message(error: dict[str, Any]) -> str:
    """Say what a value is and must be, where pydantic says only the latter."""
    text: str = error["msg"]
    if error["type"] == "missing":
        return "is missing; add it"
    if error["type"] == "value_error":
        return text.removeprefix("Value error, ")
    if text.startswith("is no "):
        return text
    text = _PLAIN.get(error["type"], text)
    said = text.replace("Input should be", "it must be").replace("Input should", "it must")
    return f"is {_shortened(error['input'])}; {said[0].lower()}{said[1:]}"


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
