"""Sockets: one class for each kind, which knows its numbers, its checks and its faces."""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Protocol, Union

import numpy as np
from pydantic import Field, GetJsonSchemaHandler, RootModel, model_validator
from pydantic_core import CoreSchema

from calfsocket.io.errors import InputError, error_context
from calfsocket.io.files import write_json
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict, checked, nearest, parsed_json, read_json, read_toml
from calfsocket.io.units import ANGLE, LENGTH, SHARE, STRESS
from calfsocket.meshes import curves, tags
from calfsocket.meshes.curves import Array, ClosedCurve, Points
from calfsocket.meshes.drawn import OutlineFile
from calfsocket.meshes.fairing import TOLERANCE
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.given import GivenMesh
from calfsocket.meshes.limb import Provenance

if TYPE_CHECKING:
    from calfsocket.meshes.outline import ReadOutline

#: How far a socket's face may lie from the skin, mm.
Offset = Annotated[float, Written(LENGTH, "1 mm"), Field(ge=-100, le=100)]
Shift = Annotated[float, Written(LENGTH, "1 mm"), Field(ge=-1000, le=1000)]
Wall = Annotated[float, Written(LENGTH, "4.5 mm"), Field(gt=0, le=1000)]
Angle = Annotated[float, Written(ANGLE, "90 deg")]
Width = Annotated[float, Written(ANGLE, "20 deg"), Field(gt=0)]
AreaReduction = Annotated[float, Written(SHARE, "5 %"), Field(gt=-1, lt=1)]
Modulus = Annotated[float, Written(STRESS, "1.5 GPa"), Field(gt=0)]


class Wearer(Protocol):
    """What a socket is put around: a limb, or one with a liner."""

    @property
    def skin(self) -> ClosedCurve:
        """The surface that the socket meets."""

    @property
    def frame(self) -> Frame:
        """Where lateral and anterior are."""

    @property
    def source(self) -> Provenance | None:
        """What the limb was made from."""


class Bump(Strict):
    r"""A Gaussian of the anatomical angle (`frame.Frame`); positive presses inward.

    0 is lateral, 90 anterior, 180 medial and 270 degrees posterior on a left leg as on a right one.

    .. math:: a \exp\left(-\tfrac12 \left(\frac{\mathrm{wrap}_{180}(\theta - \theta_0)}{w}\right)^2
        \right)

    Attributes
    ----------
    site : str
        Where it presses, in words.
    center, width : float
        Its centre and its standard deviation w, degrees.
    amplitude : float
        Its height a, mm.
    """

    site: str = ""
    center: Angle
    width: Width
    amplitude: Offset


def bumps_at(bumps: tuple[Bump, ...], angle: Array) -> Array:
    """Return the sum of Gaussian bumps, mm, at anatomical angles in degrees, shape (n,)."""
    total = np.zeros_like(angle)
    for bump in bumps:
        turn = (angle - bump.center + 180.0) % 360.0 - 180.0
        total += bump.amplitude * np.exp(-0.5 * (turn / bump.width) ** 2)
    return total


class Socket(Strict):
    """A socket around a limb: an inner face, and a wall of one thickness outside it.

    Attributes
    ----------
    name : str
        What cases, tables and folders call it; in a study file that is the name of its table.
    title : str
        Its name in words, for reports.
    wall_thickness : float
        From the inner face outward along its normal, mm.
    modulus, poisson : float, optional
        Young's modulus, MPa, and Poisson's ratio of the wall, in the place of the material set's.
    """

    name: str = "socket"
    title: str = ""
    wall_thickness: Wall = 4.5
    modulus: Modulus | None = None
    poisson: Annotated[float, Field(ge=0, lt=0.5)] | None = None

    _remedy: ClassVar[str] = "use smaller or wider bumps"  # where a face crosses itself
    tighter: ClassVar[str] = ""  #: what makes it smaller

    @staticmethod
    def reference(name: str) -> "AnySocket":
        """Return a socket of the paper: ``"TC"``, ``"TSB"`` or ``"HS"``.

        Raises
        ------
        InputError
            For another name.
        """
        return _named(name, reference_sockets())

    @staticmethod
    def read(path: Path | str) -> "AnySocket":
        """Read a socket from a TOML table or from an outline.

        Parameters
        ----------
        path
            A TOML file with what a study file has under ``[sockets.NAME]``, a JSON file of the
            command `socket`, or an outline as CSV, DXF or SVG (`from_outline`). Its name is the
            socket's.

        Raises
        ------
        InputError
            When the file cannot be read or is wrong; names the file and the key.
        """
        path = Path(path)
        if path.suffix.lower() == ".json":
            content = made_in(path)
            table = {"name": path.stem} | {k: v for k, v in content.items() if k != "units"}
            table["law"] = "mesh" if "mesh" in content else "sections"
            return checked(path, table, RootModel[AnySocket], units_required=False).root
        if path.suffix.lower() != ".toml":
            return Socket.from_outline(path)
        content = read_toml(path)
        with error_context(path):
            table = resolved(
                content,
                reference_sockets(),
                lambda name, file: _read_outline(path.parent / name, file),
                lambda name: made_in(path.parent / name),
            )
        table["name"] = content.get("name", path.stem)
        return checked(path, table, RootModel[AnySocket]).root

    @staticmethod
    def from_outline(
        path: Path | str,
        shift: tuple[float, float] = (0.0, 0.0),
        rotation: float = 0.0,
        tolerance: float = TOLERANCE,
        layer: str | None = None,
        curve: str | None = None,
        **wall: Any,
    ) -> "Outline":
        """Read the inner face of a socket from a CSV, DXF or SVG file (`outline.read_outline`).

        Parameters
        ----------
        path
            The file.
        shift, rotation
            The outline is turned about the origin, in degrees, and then shifted, in mm.
        tolerance, layer, curve
            How closely a rough outline is followed, mm, and which curve of a drawing is meant:
            `OutlineFile`.
        **wall
            `title`, `wall_thickness`, `modulus` or `poisson`; and `name`, that of the file by
            default.

        Raises
        ------
        InputError
            When the file cannot be read or holds no closed outline.
        """
        path = Path(path)
        wall.setdefault("name", path.stem)
        file = OutlineFile(tolerance=tolerance, layer=layer, curve=curve)
        read = _read_outline(path, file)
        return Outline(**vars(read), shift=shift, rotation=rotation, **wall)

    def thickness(self, limb: Wearer) -> float:
        """Return the thickness of the wall around a limb, mm."""
        return self.wall_thickness

    def elasticity(self) -> dict[str, float]:
        """Return what is the wall's own of E (MPa) and nu; empty where it is the material set's."""
        numbers = {"e": self.modulus, "nu": self.poisson}
        return {name: value for name, value in numbers.items() if value is not None}

    def notices(self) -> Iterator[str]:
        """Yield what whoever wrote its file should know, a line each; nothing is wrong with it."""
        yield from ()

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the inner face for a limb."""
        raise NotImplementedError

    def faces(self, limb: Wearer) -> tuple[ClosedCurve, ClosedCurve]:
        """Return the inner and the outer face for a limb.

        Raises
        ------
        InputError
            When a face crosses itself, or the wall folds over where the inner face is hollow.
        """
        thickness = self.thickness(limb)
        inner = self.inner_face(limb)
        check_face(inner, limb.frame, "the inner face crosses itself", self._remedy)
        check_wall(
            (inner, "the inner face"),
            limb.frame,
            thickness,
            f"a wall of {thickness:g} mm",
            "make the wall thinner or the concavity wider",
        )
        outer = curves.offset(inner, lambda points: np.full(len(points), thickness))
        check_face(
            outer,
            limb.frame,
            f"the outer face crosses itself, for a wall of {thickness:g} mm does not fit,",
            "make the wall thinner or the hollow there wider",
        )
        return inner, outer


class NormalOffset(Socket):
    """Inner face: the skin moved inward along its normal by base + bumps, mm.

    Attributes
    ----------
    base : float
        Distance by which the skin is moved inward, mm.
    bumps : tuple of Bump
        Gaussians of the anatomical angle that are added.
    """

    tighter: ClassVar[str] = "make it smaller by a larger `base`"

    law: Literal["normal_offset"] = "normal_offset"
    base: Offset
    bumps: tuple[Bump, ...] = ()

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the skin moved inward."""
        angle = limb.frame.angle
        return curves.offset(
            limb.skin, lambda points: -(self.base + bumps_at(self.bumps, angle(points)))
        )


class CircleBlend(Socket):
    r"""Inner face: the skin blended with a circle, of a reduced area, minus bumps.

    .. math:: \rho(\theta) = k b(\theta) - s(\theta),
        \quad b = (1 - c)\, r(\theta) + c\, \bar r

    with r the polar radius of the skin about the origin, its mean over the polar angle, c the
    `roundness`, s the bumps, and k such that the area, half the integral of rho^2 over the angle,
    is (1 - `area_reduction`) times the limb's. That is a quadratic equation in k.

    Attributes
    ----------
    area_reduction : float
        Share of the limb's area that the inner face encloses less than the skin.
    roundness : float
        0 the shape of the skin, 1 a circle.
    bumps : tuple of Bump
        Gaussians of the anatomical angle that are taken off.
    """

    tighter: ClassVar[str] = "make it smaller by a larger `area_reduction`"

    law: Literal["circle_blend"] = "circle_blend"
    area_reduction: AreaReduction
    roundness: Annotated[float, Field(ge=0, le=1)] = 0.0
    bumps: tuple[Bump, ...] = ()

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the blend."""
        skin = limb.skin

        def polar(t: Array) -> tuple[Array, Array]:
            """Return the polar radius of the skin and the derivative of its polar angle."""
            point, velocity = skin.evaluate(t), skin.evaluate(t, 1)
            radius = np.linalg.norm(point, axis=-1)
            turning = point[..., 0] * velocity[..., 1] - point[..., 1] * velocity[..., 0]
            return radius, turning / radius**2

        mean_radius = skin.integrate(lambda t: np.prod(polar(t), axis=0)) / (2 * np.pi)

        def blend(t: Array) -> Array:
            return (1 - self.roundness) * polar(t)[0] + self.roundness * mean_radius

        def bumps(t: Array) -> Array:
            return bumps_at(self.bumps, limb.frame.angle(skin.evaluate(t)))

        bb = skin.integrate(lambda t: blend(t) ** 2 * polar(t)[1]) / 2
        bs = skin.integrate(lambda t: blend(t) * bumps(t) * polar(t)[1]) / 2
        ss = skin.integrate(lambda t: bumps(t) ** 2 * polar(t)[1]) / 2
        excess = ss - (1 - self.area_reduction) * skin.area
        if bs**2 < bb * excess:
            raise InputError(
                "with these bumps no circle blend reduces the area by"
                f" {100 * self.area_reduction:g} %; use smaller bumps"
            )
        k = (bs + np.sqrt(bs**2 - bb * excess)) / bb

        def exact(t: Array) -> Array:
            point = skin.evaluate(t)
            radius = k * blend(t) - bumps(t)
            return point * (radius / np.linalg.norm(point, axis=-1))[:, None]

        return curves.interpolated(exact, skin.knots)


class Outline(Socket):
    """Inner face: a closed spline through points, moved: turned about the origin, then shifted.

    Attributes
    ----------
    points : tuple of (x, y)
        At least four points, mm, the first not repeated.
    shift : (float, float)
        By which the points are moved after they were turned, mm.
    rotation : float
        By which they are turned about the origin, degrees, counter-clockwise.
    deviation : float
        Largest distance of the curve from the outline in its file, mm, where that was too rough and
        was smoothed; otherwise 0.
    """

    law: Literal["outline"] = "outline"
    points: Points
    deviation: Annotated[float, Written(LENGTH, "0.1 mm"), Field(ge=0)] = 0.0
    shift: tuple[Shift, Shift] = (0.0, 0.0)
    rotation: Angle = 0.0

    _remedy: ClassVar[str] = "correct its points"
    tighter: ClassVar[str] = "make it smaller by another drawing"

    def notices(self) -> Iterator[str]:
        """Yield how far the curve is from an outline that was smoothed."""
        if self.deviation:
            yield f"the outline was smoothed; the curve is up to {self.deviation:.2f} mm from it"

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the spline; it is the same for every limb."""
        turn = np.deg2rad(self.rotation)
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        return curves.through(np.asarray(self.points) @ rotation + np.asarray(self.shift))


#: Planes of a limb's section and a socket's outline that differ by less, mm and of unit vectors,
#: are one: files have five digits.
SAME_PLANE = 1e-3
Triple = tuple[float, float, float]


class SectionOutline(Strict):
    """A socket's inner face in the plane of one section of a limb.

    Attributes
    ----------
    level : str, optional
        Of the section, as it was asked for.
    origin, normal, anterior : tuple of float
        The section's plane, mm, as in the `source` of the limb's file.
    points : tuple of (x, y)
        mm, of a closed spline in the section's axes.
    deviation_mm : float
        Largest distance of that spline from the scan.
    wall_mm : float, optional
        Thickness of the wall there, where the scan has both faces.
    """

    level: str | None = None
    origin: Triple
    normal: Triple
    anterior: Triple
    points: Points
    deviation_mm: Annotated[float, Field(ge=0)] = 0.0
    wall_mm: Annotated[float, Field(gt=0)] | None = None

    def is_of(self, limb: Wearer) -> bool:
        """Return whether it was cut in the plane of a limb's section."""
        if limb.source is None:
            return False
        return all(
            there is not None and np.abs(np.subtract(here, there)).max() < SAME_PLANE
            for here, there in (
                (self.origin, limb.source.origin),
                (self.normal, limb.source.normal),
                (self.anterior, limb.source.anterior),
            )
        )


class SocketProvenance(Strict):
    """Which scan a socket was cut from, and how it was laid on the limb.

    Attributes
    ----------
    file, sha256 : str
        Name of the scan, and its hash.
    registration : {"icp", "none"}
        How its place was found.
    rotation, shift : tuple of float
        From the scan's axes to those of the limb's source: a matrix, row by row, and then mm.
    gap_mm, gap_error_mm : float
        Mean distance of the skin outside the inner face, and its standard uncertainty.
    rms_mm, largest_mm : float
        Root mean square, and largest, of the distances from that mean.
    covered : float
        Share of the skin's points that the inner face has beside it.
    tolerance_mm : float
        Largest distance of the curves from the scan.
    program : str
        What made it, with its version.
    notes : tuple of str
        What was left out, and what is not certain.
    """

    file: str
    sha256: str
    registration: Literal["icp", "none"]
    rotation: tuple[Triple, Triple, Triple]
    shift: Triple
    gap_mm: float
    gap_error_mm: float
    rms_mm: float
    largest_mm: float
    covered: float
    tolerance_mm: float
    program: str
    notes: tuple[str, ...] = ()


class SectionsFile(Strict):
    """A socket as the command `socket` writes it: an outline for each section of a limb."""

    title: str = ""
    units: Literal["mm, deg"]
    source: SocketProvenance
    sections: Annotated[tuple[SectionOutline, ...], Field(min_length=1)]


class Sections(Socket):
    """Inner face: of the outlines cut from a socket's scan, the one in the limb's own section.

    Attributes
    ----------
    sections : tuple of SectionOutline
        For each section of the limb.
    source : SocketProvenance, optional
        The scan.
    """

    law: Literal["sections"] = "sections"
    sections: Annotated[tuple[SectionOutline, ...], Field(min_length=1)]
    source: SocketProvenance | None = None

    _remedy: ClassVar[str] = "smooth the scan"
    tighter: ClassVar[str] = "check that the scan is that of the socket's inner face, and its place"

    def of(self, limb: Wearer) -> SectionOutline:
        """Return the outline in the section of a limb.

        Raises
        ------
        InputError
            When there is none.
        """
        for each in self.sections:
            if each.is_of(limb):
                return each
        known = ", ".join(each.level or "a plane" for each in self.sections)
        level = limb.source.level if limb.source else None
        where = f"{level} of the limb" if level else "this limb"
        raise InputError(
            f"has no outline in the section at {where}, but for {known} of the limb that it was cut"
            " for; cut it for this one by `python3 -m calfsocket socket`"
        )

    def thickness(self, limb: Wearer) -> float:
        """Return the thickness of the wall there: the scan's where it has both faces."""
        return self.of(limb).wall_mm or self.wall_thickness

    def notices(self) -> Iterator[str]:
        """Yield how the scan was laid on the limb."""
        if self.source:
            yield (
                f"cut from {self.source.file}, which lies {self.source.gap_mm:.2f} mm"
                f" inside the skin (+-{self.source.rms_mm:.2f} mm root mean square)"
            )

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the spline in the limb's section."""
        return curves.through(self.of(limb).points)

    def write(self, path: Path | str) -> None:
        """Write the outlines so that `Socket.read` gives them back."""
        assert self.source is not None
        file = SectionsFile(
            title=self.title, units="mm, deg", source=self.source, sections=self.sections
        )
        write_json(Path(path), file.model_dump(mode="json", exclude_none=True))


class MeshProvenance(Strict):
    """Which file a mesh was read from.

    Attributes
    ----------
    file, sha256 : str
        Its name, and its hash.
    program : str
        What read it, with its version.
    notes : tuple of str
        What was changed.
    """

    file: str
    sha256: str
    program: str
    notes: tuple[str, ...] = ()


class MeshedSocket(Socket):
    """A wall with a mesh that was made elsewhere, which is solved as it is.

    Attributes
    ----------
    mesh : GivenMesh
        Of the wall.
    inner, outer : tuple of (x, y)
        Points of its faces, mm; `placement` sees closed splines through them.
    source : MeshProvenance, optional
        The file.
    """

    law: Literal["mesh"] = "mesh"
    mesh: GivenMesh
    inner: Points
    outer: Points
    source: MeshProvenance | None = None

    _remedy: ClassVar[str] = "mesh the wall anew"
    tighter: ClassVar[str] = "check that the mesh is that of the socket, and its place"

    @model_validator(mode="after")
    def _is_a_wall(self) -> "MeshedSocket":
        for name in (tags.SOCKET_INNER, tags.SOCKET_OUTER):
            if name not in self.mesh.boundaries:
                raise ValueError(f"mesh.boundaries: '{name}' is missing; import the mesh again")
        if (self.mesh.cell_tags != tags.SOCKET_ID).any():
            raise ValueError("mesh.regions: has other regions than the wall")
        return self

    def notices(self) -> Iterator[str]:
        """Yield which file it is from."""
        if self.source:
            yield f"its wall is the mesh of {self.source.file}, as it is"

    def inner_face(self, limb: Wearer) -> ClosedCurve:
        """Return the spline through its nodes; it is the same for every limb."""
        return curves.through(self.inner)

    def faces(self, limb: Wearer) -> tuple[ClosedCurve, ClosedCurve]:
        """Return the splines through the nodes of its faces.

        Raises
        ------
        InputError
            When a face crosses itself.
        """
        inner, outer = curves.through(self.inner), curves.through(self.outer)
        for name, face in (("inner", inner), ("outer", outer)):
            check_face(face, limb.frame, f"the {name} face crosses itself", self._remedy)
        return inner, outer

    def write(self, path: Path | str) -> None:
        """Write it so that `Socket.read` gives it back."""
        file = MeshFile(
            units="mm, deg", **{key: getattr(self, key) for key in MeshFile.model_fields
                                if key != "units"},
        )  # fmt: skip
        write_json(Path(path), file.model_dump(mode="json", exclude_none=True))


class MeshFile(Strict):
    """A socket with a mesh of its own, as the command `socket` writes it."""

    title: str = ""
    units: Literal["mm, deg"]
    wall_thickness: Annotated[float, Field(gt=0, le=1000)]
    mesh: GivenMesh
    inner: Points
    outer: Points
    source: MeshProvenance


AnySocket = Annotated[
    Union[NormalOffset, CircleBlend, Outline, Sections, MeshedSocket],  # noqa: UP007
    Field(discriminator="law"),
]


def check_face(face: ClosedCurve, frame: Frame, what: str, remedy: str) -> None:
    """Refuse a face that crosses itself or runs clockwise, in words of what it is."""
    crossing = curves.crossing_of(face)
    if crossing is not None:
        raise InputError(f"{what} at {frame.at(crossing)}; {remedy}")
    if face.area <= 0:
        raise InputError("a face runs clockwise; give its points counter-clockwise")


def check_wall(
    on: tuple[ClosedCurve, str], frame: Frame, thickness: float, what: str, remedy: str
) -> None:
    """Refuse a layer that folds over: on the hollow side of a face with a smaller radius.

    The face comes with its name; the layer is outside it where its thickness, mm, is positive.
    """
    face, name = on
    t = face.sample(face.perimeter / curves.CROSSING_POINTS)
    # 1/mm, negative where the wall's material is squeezed together away from the face.
    curvature = np.sign(thickness) * face.curvature(t)
    worst = int(np.argmin(curvature))
    if 1 + abs(thickness) * curvature[worst] <= 0:
        place = frame.at(face.evaluate(t[worst]))
        shape = "concave" if thickness > 0 else "convex"
        raise InputError(
            f"{what} folds over where {name} is {shape} with a radius"
            f" of {-1 / curvature[worst]:.2g} mm, at {place}; {remedy}"
        )


# ----- files


class Sockets(Strict):
    """Sockets by name as a file has them, in mm and degrees."""

    units: Literal["mm, deg"]
    sockets: Annotated[dict[str, AnySocket], Field(min_length=1)]


@cache
def _reference() -> Sockets:
    return read_json(Path(__file__).with_name("sockets.json"), Sockets)


def reference_sockets() -> dict[str, AnySocket]:
    """Return the sockets of the paper by name: TC, TSB and HS."""
    sockets = _reference().sockets
    return {name: each.model_copy(update={"name": name}) for name, each in sockets.items()}


def _named(name: str, sockets: Mapping[str, AnySocket]) -> AnySocket:
    if name not in sockets:
        raise InputError(f"no socket '{name}'; {nearest(name, sockets)}")
    return sockets[name]


def _read_outline(path: Path, file: OutlineFile) -> "ReadOutline":
    from calfsocket.meshes.outline import read_outline  # with readers of drawings

    return read_outline(path, file)


def made_in(path: Path) -> dict[str, Any]:
    """Return the content of a file of the command `socket`, checked: its sections, or a mesh."""
    content = parsed_json(path)
    kind: type[Strict] = SectionsFile
    if isinstance(content, dict) and "mesh" in content:
        kind = MeshFile
    file = checked(path, content, kind, units_required=False)
    return file.model_dump(mode="json", exclude_none=True)


_KINDS: dict[str, type[Socket]] = {"normal_offset": NormalOffset, "circle_blend": CircleBlend}
"""Kinds whose numbers a table may give."""


def resolved(
    table: Any,
    reference: Mapping[str, AnySocket],
    outline: Callable[[str, OutlineFile], "ReadOutline"],
    made: Callable[[str], Mapping[str, Any]],
) -> Any:
    """Return a socket's table as its class has it, its file read and its reference filled in.

    Parameters
    ----------
    table
        With one of the keys `law`, `outline`, `sections`, `mesh` and `like`, as read from TOML.
    reference : mapping
        Sockets that others may be like.
    outline : callable
        Reads an outline by the name of its file.
    made : callable
        Reads a file of the command `socket` by its name.

    Raises
    ------
    InputError
        When the table is none of the five, or has a key that the socket it is like does not have.
    """
    known = ("law", "outline", "sections", "mesh", "like")
    ways = [key for key in known if isinstance(table, dict) and key in table]
    if len(ways) != 1 or (ways == ["law"] and str(table["law"]) not in _KINDS):
        *some, last = map(repr, reference)
        raise InputError(
            "is not a socket; give exactly one of law = 'normal_offset' or 'circle_blend', "
            f"outline = 'FILE', sections = 'FILE', mesh = 'FILE', like = {', '.join(some)} or"
            f" {last}"
        )
    if ways == ["law"]:
        return table
    changed = dict(table)
    source = changed.pop(ways[0])
    if not isinstance(source, str):
        raise InputError(f"{ways[0]}: is {source!r}; it must be text in quotes")
    if ways == ["outline"]:
        for key in ("points", "deviation"):
            if key in changed:
                raise InputError(f"{key}: comes from the file {source}; remove it")
        how = {key: changed.pop(key) for key in OutlineFile.model_fields if key in changed}
        read = outline(source, checked(Path("outline"), how, OutlineFile))
        deviation = LENGTH.text(read.deviation, "mm")
        return {"law": "outline", "points": read.points, "deviation": deviation} | changed
    if ways == ["sections"]:
        if "source" in changed:
            raise InputError(f"source: comes from the file {source}; remove it")
        content = made(source)
        if "sections" not in content:
            raise InputError(f"sections: {source} is a mesh; write mesh = '{source}'")
        # A thickness that is given counts, also where the scan has one.
        without = {"wall_mm": None} if "wall_thickness" in changed else {}
        outlines = [each | without for each in content["sections"]]
        found = {"law": "sections", "sections": outlines, "source": content["source"]}
        return found | {"title": content.get("title", "")} | changed
    if ways == ["mesh"]:
        content = made(source)
        if "mesh" not in content:
            raise InputError(f"mesh: {source} has sections of a scan; write sections = '{source}'")
        for key in ("wall_thickness", "inner", "outer", "source"):
            if key in changed:
                raise InputError(f"{key}: comes from the file {source}; remove it")
        thickness = LENGTH.text(content["wall_thickness"], "mm")
        found = {key: value for key, value in content.items() if key != "units"}
        return found | {"law": "mesh", "wall_thickness": thickness} | changed
    with error_context("like"):
        like = _named(source, reference)
    fields = {name for kind in _KINDS.values() for name in kind.model_fields}
    for key in changed:
        if key in fields - set(type(like).model_fields):
            raise InputError(f"{source} is a {like.law} socket, which has no key '{key}'")
    units = {SHARE.internal: "%"}
    return like.model_dump(mode="json", exclude_none=True, context={"units": units}) | changed


class _Table:
    """Annotation of a socket that a file has as a table (`resolved`): how editors check it."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        kinds = [handler.resolve_ref_schema(kind) for kind in handler(schema)["oneOf"]]
        how = OutlineFile.model_json_schema()["properties"]
        for properties in (*(kind["properties"] for kind in kinds), how):
            properties.pop("name", None)  # that of its table
            for field in properties.values():
                field.pop("default", None)  # a number without a unit
        offset, blend, outline, sections, mesh = (dict(kind["properties"]) for kind in kinds)
        required = [["law", *kind["required"]] for kind in kinds[:2]]
        like = {"like": {"enum": list(reference_sockets())}, **offset, **blend}
        like.pop("law")
        outline["outline"] = {"type": "string", "minLength": 1, "description": "name of a file"}
        outline |= how
        del outline["law"], outline["points"], outline["deviation"]
        sections["sections"] = outline["outline"] | {"description": "file of the command socket"}
        del sections["law"], sections["source"]
        mesh["mesh"] = sections["sections"]
        for key in ("law", "source", "inner", "outer", "wall_thickness"):
            del mesh[key]
        tables = zip(
            (offset, blend, outline, sections, mesh, like),
            (*required, ["outline"], ["sections"], ["mesh"], ["like"]),
            strict=True,
        )
        shared = {"type": "object", "additionalProperties": False}
        return {
            "anyOf": [
                {**shared, "properties": properties, "required": keys}
                for properties, keys in tables
            ]
        }


SocketTable = Annotated[AnySocket, _Table()]
"""A socket in the place of which a file may have any table that `resolved` accepts."""
