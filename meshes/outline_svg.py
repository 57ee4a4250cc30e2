"""Outlines as SVG: one closed path, polygon, circle or ellipse.

The origin is that of the drawing's user units (the viewBox's, not the corner of the page). SVG's y
axis points down: what is drawn at (x, y) lies at (x, -y) in the limb's frame. A user unit is the
width of the page over that of its viewBox; without a viewBox it is SVG's pixel, 25.4/96 mm.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import svgelements

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.meshes.curves import Array
from calfsocket.meshes.drawn import EXTENT, STEP, Drawn, Piece, check_extent, joined

SHAPES = ("path", "polygon", "polyline", "line", "circle", "ellipse")
#: Elements that draw nothing.
_SILENT = ("defs", "title", "desc", "metadata", "style", "clipPath", "mask", "marker", "symbol")
_SVG = "{http://www.w3.org/2000/svg}"
_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "px": 25.4 / 96}
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LENGTH = re.compile(rf"\s*({_NUMBER})\s*([a-z]*)\s*")
_TRANSFORM = re.compile(
    rf"(?:[\s,]*(?:matrix|translate|scale|rotate|skewX|skewY)\s*\((?:[\s,]*{_NUMBER})+\s*\))*\s*"
)
_PATH = re.compile(r"[MmZzLlHhVvCcSsQqTtAaeE0-9+\-.,\s]*")
#: Points from which the length of a curved segment is estimated.
_FIRST_LOOK = 33


def read_svg(path: Path) -> Drawn:
    """Read a closed outline.

    Raises
    ------
    InputError
        Naming file and element.
    """
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: is not an SVG drawing ({error}); export it again") from error
    if root.tag.removeprefix(_SVG) != "svg":
        raise InputError(
            f"{path}: is not an SVG drawing: its root is {root.tag!r}; export it again"
        )
    scale = _unit(path, root)
    unit = f"its unit is {scale:.4g} mm by width and viewBox"
    pieces = []
    for place, element, matrix in _shapes(path, root):
        try:
            segments = list(_segments(element))
        except (ValueError, IndexError, TypeError, ArithmeticError) as error:
            raise InputError(f"{path}, {place}: cannot be read; draw it again") from error
        pieces += [_piece(path, place, segment * matrix, scale, unit) for segment in segments]
    if not pieces:
        raise InputError(f"{path}: the drawing is empty; draw one outline as {', '.join(SHAPES)}")
    return joined(path, pieces, unit)


def _unit(path: Path, root: ElementTree.Element) -> float:
    """Return the user unit in mm."""
    box = root.get("viewBox")
    if box is None:
        return _MM["px"]
    numbers = re.fullmatch(rf"\s*{_NUMBER}(?:[\s,]+{_NUMBER}){{3}}\s*", box)
    sides = [float(number) for number in re.findall(_NUMBER, box)[2:]] if numbers else [0.0]
    if min(sides) <= 0:
        raise InputError(
            f"{path}: viewBox is {box!r}; give x, y, width and height, the last two > 0"
        )
    scales = []
    for name, side in zip(("width", "height"), sides, strict=True):
        text = root.get(name)
        if text is None and name == "height":
            continue
        found = _LENGTH.fullmatch(text or "")
        if not found or (found[2] or "px") not in _MM or float(found[1]) <= 0:
            what = "missing" if text is None else repr(text)
            raise InputError(
                f"{path}: {name} is {what}; with a viewBox it needs a unit, e.g. 150mm"
            )
        scales.append(float(found[1]) * _MM[found[2] or "px"] / side)
    if max(scales) > 1.001 * min(scales):
        raise InputError(
            f"{path}: a unit of the viewBox is {scales[0]:.4g} mm wide but {scales[1]:.4g} mm high;"
            " width and height must have the ratio of the viewBox"
        )
    return scales[0]


def _shapes(
    path: Path, root: ElementTree.Element
) -> Iterator[tuple[str, ElementTree.Element, svgelements.Matrix]]:
    """Yield what is drawn: its place, the element, and the transform of it and its groups."""
    todo = [(element, svgelements.Matrix()) for element in reversed(root)]
    number = 0
    while todo:
        element, outside = todo.pop()
        if not isinstance(element.tag, str):
            continue  # a comment
        name = element.tag.removeprefix(_SVG)
        hidden = re.search(r"(^|;)\s*display\s*:\s*none", element.get("style", ""))
        if name in _SILENT or name.startswith("{") or hidden or element.get("display") == "none":
            continue
        number += 1
        place = f"{name} {element.get('id', f'number {number}')}"
        matrix = _transform(path, place, element.get("transform", "")) * outside
        if name == "g":
            todo.extend((child, matrix) for child in reversed(element))
        elif name in SHAPES:
            yield place, element, matrix
        else:
            raise InputError(
                f"{path}, {place}: cannot be part of an outline; keep {', '.join(SHAPES)}, convert"
                " other objects to paths and delete the rest"
            )


def _transform(path: Path, place: str, text: str) -> svgelements.Matrix:
    try:
        if _TRANSFORM.fullmatch(text):
            return svgelements.Matrix(text)
    except (ValueError, IndexError, TypeError):
        pass  # too few numbers, which the library finds out
    raise InputError(f"{path}, {place}: transform {text!r} cannot be read; draw it without one")


def _segments(element: ElementTree.Element) -> Iterator[svgelements.PathSegment]:
    """Yield the lines and curves of a shape in user units."""
    match element.tag.removeprefix(_SVG):
        case "path":
            text = element.get("d", "")
            if not _PATH.fullmatch(text):
                raise ValueError(text)
            outline = svgelements.Path(text)
        case "polygon" | "polyline" as name:
            numbers = _numbers(element.get("points", ""))
            corners = list(zip(numbers[::2], numbers[1::2], strict=True))
            make = svgelements.Polygon if name == "polygon" else svgelements.Polyline
            outline = svgelements.Path(make(*corners))
        case "line":
            start, end = (_attributes(element, f"x{i}", f"y{i}") for i in (1, 2))
            outline = svgelements.Path(svgelements.SimpleLine(*start, *end))
        case "circle":
            x, y, r = _attributes(element, "cx", "cy", "r")
            outline = svgelements.Path(svgelements.Circle(x, y, r))
        case _:
            x, y, rx, ry = _attributes(element, "cx", "cy", "rx", "ry")
            outline = svgelements.Path(svgelements.Ellipse(x, y, rx, ry))
    yield from (part for part in outline if not isinstance(part, svgelements.Move))


def _numbers(text: str) -> list[float]:
    if not re.fullmatch(rf"(?:[\s,]*{_NUMBER})*[\s,]*", text):
        raise ValueError(text)
    return [float(number) for number in re.findall(_NUMBER, text)]


def _attributes(element: ElementTree.Element, *names: str) -> list[float]:
    """Return lengths in user units."""
    return [float(element.get(name, "0").strip().removesuffix("px")) for name in names]


def _piece(
    path: Path, place: str, segment: svgelements.PathSegment, scale: float, unit: str
) -> Piece:
    """Return a segment as points in mm in the limb's frame."""
    if isinstance(segment, svgelements.Line | svgelements.Close):
        points = np.array([[end.x, end.y] for end in (segment.start, segment.end)], dtype=float)
    else:
        points = _at(segment, _FIRST_LOOK)
    points = points * [scale, -scale]
    if not np.isfinite(points).all():
        raise InputError(f"{path}, {place}: has no finite size; draw it again")
    if len(points) == 2:
        return Piece(place, points)
    check_extent(path, points, (0.0, 10 * EXTENT[1]), unit)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    number = max(int(length / STEP) + 2, 5)
    return Piece(place, _at(segment, number) * [scale, -scale], curved=True)


def _at(segment: svgelements.PathSegment, number: int) -> Array:
    with np.errstate(all="ignore"):  # what is not finite is refused
        points = segment.npoint(np.linspace(0.0, 1.0, number))
    return np.asarray(points, dtype=float).reshape(-1, 2)
