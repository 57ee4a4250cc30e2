"""A socket in a study file: a law of its inner face or an outline, and its wall."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict
from calfsocket.materials.law import Stress
from calfsocket.materials.laws import Hencky
from calfsocket.materials.tissues import SOCKET
from calfsocket.meshes.data import Bump, CircleBlend, NormalOffset, Outline, Shape
from calfsocket.study.files import Files
from calfsocket.study.quantities import (
    Angle,
    File,
    Length,
    PositiveAngle,
    PositiveLength,
    Share,
)


class BumpEntry(Strict):
    """A Gaussian of the polar angle (0 lateral, 90 deg anterior); positive presses inward."""

    site: str = ""
    center: Angle
    width: PositiveAngle
    amplitude: Length

    def bump(self) -> Bump:
        """Return it in mm and degrees."""
        return Bump(**dict(self))


class Wall(Strict):
    """What every socket may have: a title, its wall's thickness, its material."""

    kind: ClassVar[str]
    title: str = ""
    wall_thickness: PositiveLength | None = None
    modulus: Stress | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None

    def material(self) -> Hencky | None:
        """Return the wall's own law; None where it is the material set's."""
        if self.modulus is None and self.poisson is None:
            return None
        modulus = SOCKET.e if self.modulus is None else self.modulus
        return Hencky(e=modulus, nu=SOCKET.nu if self.poisson is None else self.poisson)

    def shape(self, files: Files, known: dict[str, Shape]) -> Shape:
        """Return the law of the inner face with its numbers in mm and degrees."""
        raise NotImplementedError


class OffsetSocket(Wall):
    """Inner face: the skin moved inward by base + bumps."""

    kind: ClassVar[str] = "normal_offset"
    law: Literal["normal_offset"]
    base: Length
    bumps: tuple[BumpEntry, ...] = ()

    def shape(self, files: Files, known: dict[str, Shape]) -> Shape:
        """Return the law."""
        return NormalOffset(
            title=self.title,
            wall_thickness=self.wall_thickness,
            law=self.law,
            base=self.base,
            bumps=tuple(bump.bump() for bump in self.bumps),
        )


class BlendSocket(Wall):
    """Inner face: the skin blended with a circle, of an area reduced by this share, minus bumps."""

    kind: ClassVar[str] = "circle_blend"
    law: Literal["circle_blend"]
    area_reduction: Annotated[Share, Field(gt=-1, lt=1)]
    roundness: Annotated[float, Field(ge=0, le=1)] = 0.0
    bumps: tuple[BumpEntry, ...] = ()

    def shape(self, files: Files, known: dict[str, Shape]) -> Shape:
        """Return the law."""
        return CircleBlend(
            title=self.title,
            wall_thickness=self.wall_thickness,
            law=self.law,
            area_reduction=self.area_reduction,
            roundness=self.roundness,
            bumps=tuple(bump.bump() for bump in self.bumps),
        )


class DrawnSocket(Wall):
    """Inner face: the outline of a CSV, DXF or SVG file, turned and then shifted."""

    kind: ClassVar[str] = "outline"
    outline: File
    shift: tuple[Length, Length] = (0.0, 0.0)
    rotation: Angle = 0.0

    def shape(self, files: Files, known: dict[str, Shape]) -> Shape:
        """Read the file."""
        return Outline(
            title=self.title,
            wall_thickness=self.wall_thickness,
            law="outline",
            points=files.outline(self.outline),
            shift=self.shift,
            rotation=self.rotation,
        )


class LikeSocket(Wall):
    """A socket of the reference data with some of its parameters changed."""

    kind: ClassVar[str] = "like"
    like: Literal["TC", "TSB", "HS"]
    base: Length | None = None
    area_reduction: Annotated[Share, Field(gt=-1, lt=1)] | None = None
    roundness: Annotated[float, Field(ge=0, le=1)] | None = None
    bumps: tuple[BumpEntry, ...] | None = None

    def shape(self, files: Files, known: dict[str, Shape]) -> Shape:
        """Return the reference socket's law with these numbers in the place of its own."""
        reference = known[self.like]
        changed: dict[str, Any] = {
            key: value
            for key in ("title", "wall_thickness", "base", "area_reduction", "roundness")
            if (value := getattr(self, key)) not in (None, "")
        }
        if self.bumps is not None:
            changed["bumps"] = tuple(bump.bump() for bump in self.bumps)
        for key in changed:
            if key not in type(reference).model_fields:
                raise InputError(
                    f"{self.like} is a socket of the law {reference.law}, which has no {key}"
                )
        return type(reference)(**(dict(reference) | changed))


KINDS = {each.kind: each for each in (OffsetSocket, BlendSocket, DrawnSocket, LikeSocket)}
_HOW = "give one of law = 'normal_offset' or 'circle_blend', outline = a file, like = TC, TSB or HS"


def _kind(content: Any) -> str | None:
    """Tell by its keys what a socket's table is; the brackets tell it from a key in errors."""
    if isinstance(content, Wall):
        return f"<{type(content).kind}>"
    if not isinstance(content, dict):
        return None
    found = [key for key in ("law", "outline", "like") if key in content]
    if len(found) != 1:
        return None
    kind = content["law"] if found == ["law"] else found[0]
    return f"<{kind}>" if isinstance(kind, str) and kind in KINDS else None


SocketEntry = Annotated[
    Annotated[OffsetSocket, Tag("<normal_offset>")]
    | Annotated[BlendSocket, Tag("<circle_blend>")]
    | Annotated[DrawnSocket, Tag("<outline>")]
    | Annotated[LikeSocket, Tag("<like>")],
    Discriminator(
        _kind, custom_error_type="socket_kind", custom_error_message=f"is no socket; {_HOW}"
    ),
]
