"""A limb of many levels: sections one above the other, and the file that lists them."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from calfsocket.io.errors import InputError, error_context
from calfsocket.io.files import write_json
from calfsocket.io.schema import Strict, checked, parsed_json
from calfsocket.meshes.limb import Limb

#: Levels of one limb.
MOST_LEVELS = 200
#: By how much a section's own height may differ from the one that is listed: both are rounded.
HEIGHT_DIGIT = 1e-3

Height = Annotated[float, Field(ge=0, le=1)]
Title = Annotated[str, Field(min_length=1, max_length=200)]


class Place(Strict):
    """Where along the limb a section lies.

    Attributes
    ----------
    height : float
        Share of the source's height, 0 distal and 1 proximal.
    height_mm : float
        The same in mm from the distal end.
    """

    height: Height
    height_mm: Annotated[float, Field(ge=0)]

    @property
    def name(self) -> str:
        """Its name in cases, tables and files, e.g. ``0.350``."""
        return f"{self.height:.3f}"

    @property
    def label(self) -> str:
        """Part of a case's name."""
        return f"level={self.name}"


class ListedLevel(Place):
    """A level in the file that lists them.

    Attributes
    ----------
    file : str
        The section's file, relative to the one that lists it.
    """

    file: Annotated[str, Field(min_length=1, max_length=1000)]


class Level(ListedLevel):
    """A section of a limb, and where along it the section lies.

    Attributes
    ----------
    file : str
        The section's file, relative to the one that lists it.
    limb : Limb
        The section.
    """

    limb: Limb


class RefusedLevel(Place):
    """A level at which the source gave no section.

    Attributes
    ----------
    reason : str
        Why.
    """

    reason: str


class LimbLevels(Strict):
    """A limb of many levels.

    Attributes
    ----------
    title : str
        For reports.
    levels : tuple of Level
        From distal to proximal.
    refused : tuple of RefusedLevel
        Levels that were asked for and could not be made.
    """

    title: Title = "A limb"
    levels: Annotated[tuple[Level, ...], Field(min_length=1, max_length=MOST_LEVELS)]
    refused: tuple[RefusedLevel, ...] = ()

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read the file that lists the levels, and the section of each.

        Raises
        ------
        InputError
            When a file cannot be read or is wrong, or the sections are not those of one limb, one
            above the other.
        """
        path = Path(path)
        index = checked(path, parsed_json(path), _Index, units_required=False)
        with error_context(path):
            _check_ascending(index.levels)
        levels = []
        for number, entry in enumerate(index.levels):
            with error_context(path, f"levels.{number}.file"):
                limb = Limb.read(path.parent / entry.file)
            levels.append({**dict(entry), "limb": limb})
        content = {"title": index.title, "levels": levels, "refused": index.refused}
        return checked(path, content, cls, units_required=False)

    def write(self, path: Path | str) -> None:
        """Write the sections and the file that lists them, so that `read` gives them back."""
        path = Path(path)
        if path.suffix != ".json":
            raise InputError(f"{path}: limbs are JSON files; use a name that ends in .json")
        for level in self.levels:
            level.limb.write(path.parent / level.file)
        self.write_index(path)

    def write_index(self, path: Path) -> None:
        """Write the file that lists the levels, whose sections are written already."""
        content = self.model_dump(mode="json", exclude={"levels": {"__all__": {"limb"}}})
        if not self.refused:
            del content["refused"]
        write_json(path, content)

    @model_validator(mode="after")
    def _one_limb(self) -> "LimbLevels":
        _check_ascending(self.levels)
        first = self.levels[0].limb
        for number, level in enumerate(self.levels):
            limb, place = level.limb, f"levels.{number}"
            for what, one, other in (
                ("side", first.side, limb.side),
                ("axes", first.axes, limb.axes),
            ):
                if one != other:
                    raise ValueError(
                        f"{place}: {level.file} has the {what} {_said(other)}, and"
                        f" {self.levels[0].file} {_said(one)}; list sections of one limb"
                    )
            source, of_first = limb.source, first.source
            if (source and source.files) != (of_first and of_first.files):
                raise ValueError(
                    f"{place}: {level.file} was made of other files than {self.levels[0].file};"
                    " list sections of one limb"
                )
            own = source.height if source else None
            if own is not None and abs(own - level.height) > HEIGHT_DIGIT:
                raise ValueError(
                    f"{place}.height: is {level.height:g}, but {level.file} lies at {own:g};"
                    " correct it"
                )
        return self

    def __len__(self) -> int:
        return len(self.levels)

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """The sections, from distal to proximal."""
        return tuple(level.limb for level in self.levels)

    def notices(self) -> Iterator[str]:
        """Yield what whoever made the levels should know, a line each; nothing is wrong."""
        for each in self.refused:
            yield f"level {each.name} is missing: {each.reason}"
        lines: dict[str, list[str]] = {}
        for level in self.levels:
            for line in level.limb.notices():
                lines.setdefault(line, []).append(level.name)
        for line, names in lines.items():
            where = "all levels" if len(names) == len(self.levels) else f"level {', '.join(names)}"
            yield f"{where}: {line}"


class _Index(Strict):
    """The file that lists the levels."""

    title: Title = "A limb"
    levels: Annotated[tuple[ListedLevel, ...], Field(min_length=1, max_length=MOST_LEVELS)]
    refused: tuple[RefusedLevel, ...] = ()


def read_limb(path: Path | str) -> Limb | LimbLevels:
    """Read a limb's file, which is a section or lists the levels of one.

    Raises
    ------
    InputError
        As of `Limb.read` and `LimbLevels.read`.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        content = parsed_json(path)
        if isinstance(content, dict) and "levels" in content:
            return LimbLevels.read(path)
    return Limb.read(path)


def sections(limb: Limb | LimbLevels) -> tuple[Limb, ...]:
    """Return the section of a limb, or that of each of its levels."""
    return limb.limbs if isinstance(limb, LimbLevels) else (limb,)


def _check_ascending(levels: Sequence[ListedLevel]) -> None:
    """Refuse levels that are listed twice or not from distal to proximal."""
    files: dict[str, int] = {}
    for number, level in enumerate(levels):
        if level.file in files:
            raise InputError(
                f"levels.{number}.file: {level.file} is also that of levels.{files[level.file]};"
                " list each section once"
            )
        files[level.file] = number
    for number, (below, above) in enumerate(pairwise(levels), 1):
        if below.name == above.name:
            raise InputError(
                f"levels.{number}.height: is {above.height:g}, as that of levels.{number - 1}"
                " (to a thousandth of the limb); list each level once"
            )
        if above.height < below.height or above.height_mm <= below.height_mm:
            key = "height" if above.height < below.height else "height_mm"
            raise InputError(
                f"levels.{number}.{key}: is {getattr(above, key):g}, below that of"
                f" levels.{number - 1}; list levels from distal to proximal"
            )


def _said(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{axis} {way}" for axis, way in value.items()) or "unknown"
    return str(value or "unknown")
