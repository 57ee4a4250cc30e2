"""What loads a limb in its socket after donning: stages, as a user writes them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from calfsocket.io.errors import InputError
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict
from calfsocket.io.units import ANGLE, FORCE, LENGTH, MOMENT, SHARE
from calfsocket.meshes.frame import Frame

Side = Literal["lateral", "medial", "anterior", "posterior", "x", "y"]
SoftTissue = Literal["muscle", "fat", "soft"]

Carried = Literal["frame", "evenly"]
CARRIED: tuple[Carried, ...] = get_args(Carried)

DONNED = "donned"
"""Name of the state before the first stage."""

CASE_FOLDERS = ("load_steps", "second_mesh")
"""Folders beside those of the stages, in that of a case."""

SOFT: tuple[str, ...] = ("muscle", "fat")
"""Tissues that "soft" stands for, those that swell and shrink."""

Force = Annotated[float, Field(strict=True), Written(FORCE, "1 N/mm")]
Moment = Annotated[float, Field(strict=True), Written(MOMENT, "20 N mm/mm")]
Displacement = Annotated[float, Field(strict=True), Written(LENGTH, "2 mm")]
Rotation = Annotated[float, Field(strict=True), Written(ANGLE, "3 deg")]
Volume = Annotated[float, Field(strict=True), Written(SHARE, "-3 %")]

AXES = ("x", "y", "turn")
"""Components of a frame's place, and of its force."""


class Stage(Strict):
    """A stage of loading: the values that it ends at, counted from the donned socket.

    What a stage does not name stays as it is: a force at its value, a displacement or a rotation
    where the socket is held. A force lets a displacement along it go, and the other way round.

    Attributes
    ----------
    name : str
        Name of the stage, and of the state at its end.
    force : mapping of side to float
        Force on the socket for each mm of limb length, N/mm, along lateral, medial, anterior,
        posterior, or along x and y of the section.
    moment : float, optional
        Moment on the socket for each mm of limb length, N mm/mm, counter-clockwise in the section.
    displacement : mapping of side to float
        Displacement of the socket, mm.
    rotation : float, optional
        Rotation of the socket, deg, counter-clockwise in the section.
    volume : mapping of tissue to float
        Change of volume of muscle, fat or, "soft", both, as a share; the limb keeps its length.
    steps : int
        Load steps on the way to these values, and on each way between them and their opposites.
    cycles : int
        How many times the stage goes on to the opposite values and back.

    Raises
    ------
    InputError
        If nothing is loaded, a component is named twice, or a number is outside its range.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,39}$")]
    force: dict[Side, Force] = Field(default_factory=dict)
    moment: Moment | None = None
    displacement: dict[Side, Displacement] = Field(default_factory=dict)
    rotation: Rotation | None = None
    volume: dict[SoftTissue, Volume] = Field(default_factory=dict)
    steps: Annotated[int, Field(strict=True, ge=1, le=1000)] = 10
    cycles: Annotated[int, Field(strict=True, ge=0, le=100)] = 0

    @model_validator(mode="after")
    def _is_a_load(self) -> "Stage":
        if self.name == DONNED:
            raise ValueError(f"name: '{DONNED}' is the state before all stages; choose another")
        if self.name in CASE_FOLDERS:
            raise ValueError(f"name: '{self.name}' is another folder of a case; choose another")
        if not (self.moves_socket or self.volume):
            raise ValueError("loads nothing; give force, moment, displacement, rotation or volume")
        if self.moment is not None and self.rotation is not None:
            raise ValueError("moment and rotation: one follows from the other; give one of them")
        if "soft" in self.volume and len(self.volume) > 1:
            raise ValueError("volume: soft is muscle and fat; give it alone, or each of the two")
        for tissue, change in self.volume.items():
            if not -1.0 < change <= 1.0:
                raise ValueError(
                    f"volume.{tissue}: is {100 * change:g} %; it must be more than -100 % and at "
                    "most 100 %"
                )
            if self.cycles and change >= 1.0:
                raise ValueError(f"volume.{tissue}: a cycle would come to -100 %; give less")
        for first, second in combinations((*self.force, *self.displacement), 2):
            if _LINE[first] == _LINE[second]:
                raise ValueError(
                    f"{first} and {second}: lie along one line; give one force or displacement "
                    "along it"
                )
        lines = {_LINE[side] for side in (*self.force, *self.displacement)}
        if len({line in "xy" for line in lines}) > 1:
            raise ValueError("force, displacement: give anatomical sides, or x and y, not both")
        return self

    @property
    def moves_socket(self) -> bool:
        """Whether the stage loads the socket, which then needs a frame."""
        turned = self.moment is not None or self.rotation is not None
        return bool(self.force or self.displacement) or turned

    @property
    def tissue_volumes(self) -> dict[str, float]:
        """Change of volume by tissue, as a share."""
        return {
            tissue: change
            for name, change in self.volume.items()
            for tissue in (SOFT if name == "soft" else (name,))
        }

    def targets(self, frame: Frame) -> "Targets":
        """Return the values in a section's axes.

        Raises
        ------
        InputError
            If it names an anatomical side, and the section's axes are not known.
        """
        force, place = dict[int, float](), dict[int, float]()
        for values, found in ((self.force, force), (self.displacement, place)):
            for side, value in values.items():
                axis, sign = _axis(side, frame)
                found[axis] = sign * value
        if self.moment is not None:
            force[2] = self.moment
        if self.rotation is not None:
            place[2] = math.radians(self.rotation)
        return Targets(force, place, self.tissue_volumes)


@dataclass(frozen=True)
class Targets:
    """Values at the end of a stage by component: 0 along x, 1 along y, 2 for the turn.

    Attributes
    ----------
    force : mapping of int to float
        N/mm, and N mm/mm.
    place : mapping of int to float
        mm, and rad.
    volume : mapping of str to float
        Change of volume by tissue, as a share.
    """

    force: Mapping[int, float]
    place: Mapping[int, float]
    volume: Mapping[str, float]

    @property
    def opposite(self) -> "Targets":
        """The values with the other sign."""
        return Targets(
            force={component: -value for component, value in self.force.items()},
            place={component: -value for component, value in self.place.items()},
            volume={tissue: -change for tissue, change in self.volume.items()},
        )


class Loading(Strict):
    """Stages of loading, one after the other, after donning.

    Where a stage loads the socket, its outer face is carried from the donned state on, as it is
    then. A rigid frame moves it as one body with two translations and a rotation; moments count
    about the middle of the area within the undeformed outer face, which moves with the frame. An
    even load leaves it free to deform; its moments count about the mean of the face, and its motion
    is the mean translation and the rotation that fits it best.

    Attributes
    ----------
    stages : tuple of Stage
        At least one; each has a name of its own.
    carried : {"frame", "evenly"}
        Whether a rigid frame carries the socket's outer face, or forces and moments are spread
        evenly over it.

    Raises
    ------
    InputError
        If there is no stage, or a name twice, or an even load would be moved.
    """

    stages: Annotated[tuple[Stage, ...], Field(min_length=1)]
    carried: Carried = "frame"

    @model_validator(mode="after")
    def _names_differ(self) -> "Loading":
        check_names(self.stages)
        return self

    @model_validator(mode="after")
    def _moves_a_frame(self) -> "Loading":
        check_carried(self.stages, self.carried)
        return self

    @property
    def moves_socket(self) -> bool:
        """Whether any stage loads the socket."""
        return any(stage.moves_socket for stage in self.stages)


def check_names(stages: tuple[Stage, ...]) -> None:
    """Raise a ValueError where two stages have one name; capitals make no difference in folders."""
    names = [stage.name.casefold() for stage in stages]
    for stage in stages:
        if names.count(stage.name.casefold()) > 1:
            raise ValueError(f"two stages have the name '{stage.name}'; give each its own")


def check_carried(stages: tuple[Stage, ...], carried: Carried) -> None:
    """Raise a ValueError where a stage moves what nothing but an even load carries."""
    for stage in stages if carried == "evenly" else ():
        if stage.displacement or stage.rotation is not None:
            key = "displacement" if stage.displacement else "rotation"
            raise ValueError(
                f"stage {stage.name}: {key}: an outer face loaded evenly deforms and has no place "
                "of its own; give force and moment, or let a frame carry it"
            )


_LINE: dict[Side, str] = {
    "lateral": "across",
    "medial": "across",
    "anterior": "along",
    "posterior": "along",
    "x": "x",
    "y": "y",
}


def _axis(side: Side, frame: Frame) -> tuple[int, float]:
    """Return the axis, 0 or 1, that a side lies along, and on which end of it."""
    if side in ("x", "y"):
        return "xy".index(side), 1.0
    if not frame.known:
        raise InputError(
            f"{side}: the limb's data do not say where its axes point; add `axes` to them, or give "
            "x and y"
        )
    place = frame.words.index(side)
    return place % 2, 1.0 if place < 2 else -1.0
