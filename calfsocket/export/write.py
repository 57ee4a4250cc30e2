"""Writes a case for another program, or its mesh."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from calfsocket.export import febio, keywords, mesh_file
from calfsocket.export.case import ExportedCase
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.schema import nearest

ExportFormat = Literal["abaqus", "calculix", "febio", "msh", "xdmf"]
FORMATS: tuple[ExportFormat, ...] = get_args(ExportFormat)

_MESH_ALONE = ["the file has the mesh and its names alone: no laws, contact, constraints or loads"]

_DECKS: dict[str, Callable[[ExportedCase], tuple[str, list[str]]]] = {
    "abaqus": lambda case: keywords.deck(case, keywords.ABAQUS),
    "calculix": lambda case: keywords.deck(case, keywords.CALCULIX),
    "febio": febio.deck,
    "xdmf": lambda case: (mesh_file.xdmf(case.mesh), _MESH_ALONE),
}


def checked_format(format: str) -> ExportFormat:
    """Return a format that exists.

    Raises
    ------
    InputError
        For another one.
    """
    if format not in FORMATS:
        raise InputError(f"format: no format '{format}'; {nearest(format, FORMATS)}")
    return format  # type: ignore[return-value]


def write(path: Path, case: ExportedCase, format: ExportFormat) -> tuple[str, ...]:
    """Write a case; return what has no equivalent, or another one, in that format, a line each.

    The file appears whole or not at all, and the same case gives the same bytes.

    Raises
    ------
    InputError
        For a law that other programs do not have.
    """
    if format == "msh":
        with replacing(path) as temporary:
            mesh_file.write_msh(temporary, case.mesh)
        return tuple(_MESH_ALONE)
    text, remarks = _DECKS[format](case)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return tuple(remarks)
