"""A limb of many levels from a source, which is read once."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

from calfsocket.imaging.anatomy import Anatomy, Said, Side, find_anatomy
from calfsocket.imaging.labels import read_labels
from calfsocket.imaging.limb import Filling, Imported, imported
from calfsocket.imaging.plane import Level
from calfsocket.imaging.section import section
from calfsocket.imaging.source import Source, read_surface
from calfsocket.io.errors import InputError
from calfsocket.meshes import levels as meshes
from calfsocket.meshes.levels import MOST_LEVELS

Shares = str | Sequence[float]
#: Smallest distance of two levels, a share of the height: their names have three digits.
CLOSEST = 1e-3


class LimbLevels(meshes.LimbLevels):
    """A limb of many levels: from files, or from a source.

    Attributes
    ----------
    title : str
        For reports.
    levels : tuple of Level
        From distal to proximal: the `limb` of each, its `height` (share of the source's height, 0
        distal) and `height_mm`, and the name of its `file`.
    refused : tuple of RefusedLevel
        Levels that were asked for and could not be made, with the `reason`.
    """

    @classmethod
    def from_surface(
        cls,
        *paths: Path | str,
        levels: Shares,
        units: str = "mm",
        tolerance: float | None = None,
        side: Side | None = None,
        proximal: str | None = None,
        anterior: str | None = None,
        skin: str | None = None,
        muscle: str | None = None,
        tibia: str | None = None,
        fibula: str | None = None,
        **filling: Any,
    ) -> Self:
        """Make a limb of many levels from surfaces of its skin and bones.

        Parameters
        ----------
        levels
            Shares of the height, or ``"0.2:0.8:13"`` for 13 levels from one share to another.
        *paths, units, tolerance, side, proximal, anterior, skin, muscle, tibia, fibula, **filling
            As of `Limb.from_surface`.

        Raises
        ------
        InputError
            Where no level can be made: why the first cannot.
        """
        roles = {"skin": skin, "muscle": muscle, "tibia": tibia, "fibula": fibula}
        source = read_surface(list(paths), units, {k: v for k, v in roles.items() if v})
        anatomy = find_anatomy(source, Said(side, proximal, anterior))
        made = imported_levels(source, anatomy, levels_of(levels), tolerance, filling)
        return cls.model_construct(**dict(made))

    @classmethod
    def from_labels(
        cls,
        path: Path | str,
        labels: Path | str,
        *,
        levels: Shares,
        voxel: tuple[float, float, float] | None = None,
        tolerance: float | None = None,
        side: Side | None = None,
        proximal: str | None = None,
        anterior: str | None = None,
        **filling: Any,
    ) -> Self:
        """Make a limb of many levels from a label map.

        Parameters
        ----------
        levels
            As of `from_surface`.
        path, labels, voxel, tolerance, side, proximal, anterior, **filling
            As of `Limb.from_labels`.

        Raises
        ------
        InputError
            Where no level can be made: why the first cannot.
        """
        source = read_labels(path, labels, voxel)
        anatomy = find_anatomy(source, Said(side, proximal, anterior))
        made = imported_levels(source, anatomy, levels_of(levels), tolerance, filling)
        return cls.model_construct(**dict(made))


def levels_of(shares: Shares) -> list[Level]:
    """Return levels from distal to proximal, of shares of the height or of FROM:TO:N."""
    if isinstance(shares, str):
        try:
            first, last, number = shares.split(":")
            low, high, count = float(first), float(last), int(number)
        except ValueError:
            count = 0
        if not 2 <= count <= MOST_LEVELS:
            raise InputError(
                f"levels: is '{shares}'; give FROM:TO:N with shares of the height and a number of 2"
                f" to {MOST_LEVELS}, such as 0.2:0.8:13"
            )
        shares = [round(low + (high - low) / (count - 1) * i, 6) for i in range(count)]
    if not 1 <= len(shares) <= MOST_LEVELS:
        raise InputError(f"levels: are {len(shares)}; give 1 to {MOST_LEVELS}")
    levels = [Level.parse(float(share)) for share in sorted(shares)]
    if any(above - below < CLOSEST for below, above in pairwise(sorted(shares))):
        raise InputError(
            f"levels: two are closer than {CLOSEST:g} of the height; give fewer, or a wider range"
        )
    return levels


def imported_levels(
    source: Source,
    anatomy: Anatomy,
    levels: Sequence[Level],
    tolerance: float | None = None,
    filling: Filling | Mapping[str, Any] | None = None,
    stem: str = "limb",
    on_made: Callable[[Imported, str], None] = lambda _, __: None,
) -> meshes.LimbLevels:
    """Make a limb of many levels of a source.

    Parameters
    ----------
    levels
        From distal to proximal, as shares of the height.
    tolerance, filling
        As of `section` and `imported`.
    stem
        Of the names of the sections' files.
    on_made
        Called with each level and the name of its file as soon as it is made.

    Raises
    ------
    InputError
        Where no level can be made: why the first cannot.
    """
    made: list[meshes.Level] = []
    refused: list[meshes.RefusedLevel] = []
    for level in levels:
        assert level.share is not None
        height_mm = round(level.height(anatomy.low, anatomy.high) - anatomy.low, 3)
        place = meshes.Place(height=level.share, height_mm=height_mm)
        file = f"{stem}_{place.name}.json"
        try:
            found = imported(section(source, anatomy, level, None, tolerance), filling or {})
        except InputError as error:
            refused.append(meshes.RefusedLevel(**dict(place), reason=str(error)))
            continue
        on_made(found, file)
        made.append(meshes.Level(**dict(place), file=file, limb=found.limb))
    if not made:
        raise InputError(f"levels: none can be made; the first: {refused[0].reason}")
    return meshes.LimbLevels(title=source.names, levels=tuple(made), refused=tuple(refused))
