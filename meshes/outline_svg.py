"""Outlines as SVG: one closed path, polygon, circle or ellipse.

The origin is that of the drawing's user units (the viewBox's, not the corner of the page). SVG's y
axis points down: what is drawn at (x, y) lies at (x, -y) in the limb's frame. A user unit is the
width of the page over that of its viewBox; without a viewBox it is SVG's pixel, 25.4/96 mm.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import svgelements

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.meshes.curves import Array
from calfsocket.meshes.drawn import STEP, Drawn, OutlineFile, Piece, joined

SHAPES = ("path", "polygon", "polyline", "line", "circle", "ellipse")
#: Elements that draw nothing.
_SILENT = ("defs", "title", "desc", "metadata", "style", "clipPath", "mask", "marker", "symbol")
_SVG = "{http://www.w3.org/2000/svg}"
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_MM = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "px": 25.4 / 96}
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LENGTH = re.compile(rf"\s*({_NUMBER})\s*([a-z]*)\s*")
_TRANSFORM = re.compile(
    rf"(?:[\s,]*(?:matrix|translate|scale|rotate|skewX|skewY)\s*\((?:[\s,]*{_NUMBER})+\s*\))*\s*"
)
_PATH = re.compile(r"[MmZzLlHhVvCcSsQqTtAaeE0-9+\-.,\s]*")
#: Points from which the length of a curved segment is estimated.
_FIRST_LOOK = 33


def read_svg(path: Path, file: OutlineFile) -> Drawn:
    """Read a closed outline.

    Raises
    ------
    InputError
        Naming file and element.
    """
    return joined(path, *svg_pieces(path), file)


def svg_pieces(path: Path) -> tuple[list[Piece], str]:
    """Return all that is drawn, and what the drawing says of its unit."""
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: is not an SVG drawing ({error}); export it again") from error
    if root.tag.removeprefix(_SVG) != "svg":
        raise InputError(
            f"{path}: is not an SVG drawing: its root is {root.tag!r}; export it again"
        )
    scale = _unit(path, root)
    pieces = [piece for shape in _shapes(root) for piece in _pieces(shape, scale)]
    return pieces, f"its unit is {scale:.4g} mm by width and viewBox"


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


@dataclass(frozen=True)
class _Shape:
    """What is drawn, with the transforms of it and its groups."""

    place: str
    element: ElementTree.Element
    transforms: tuple[str, ...]
    layer: str


def _shapes(root: ElementTree.Element) -> Iterator[_Shape]:
    """Yield what is drawn; a layer is a group, by its label or id."""
    todo = [_Shape("", element, (), "") for element in reversed(root)]
    number = 0
    while todo:
        shape = todo.pop()
        element = shape.element
        if not isinstance(element.tag, str):
            continue  # a comment
        name = element.tag.removeprefix(_SVG)
        hidden = re.search(r"(^|;)\s*display\s*:\s*none", element.get("style", ""))
        if name in _SILENT or name.startswith("{") or hidden or element.get("display") == "none":
            continue
        number += 1
        place = f"{name} {element.get('id', f'number {number}')}"
        # What is inside is transformed first.
        transforms = (element.get("transform", ""), *shape.transforms)
        if name == "g":
            layer = element.get(_LABEL) or element.get("id") or shape.layer
            todo.extend(_Shape("", child, transforms, layer) for child in reversed(element))
        else:
            yield _Shape(place, element, transforms, shape.layer)


def _pieces(shape: _Shape, scale: float) -> Iterator[Piece]:
    """Yield the lines and curves of a shape, in mm in the limb's frame."""
    name = shape.element.get("id", "")
    label = shape.element.get(_LABEL, "")
    nothing = Piece(shape.place, np.empty((0, 2)), name, label, shape.layer)
    if shape.element.tag.removeprefix(_SVG) not in SHAPES:
        yield replace(
            nothing,
            problem=f"cannot be part of an outline, which is made of {', '.join(SHAPES)}; convert"
            " it to a path or delete it",
        )
        return
    try:
        matrix = _matrix(shape.transforms)
        segments = [segment * matrix for segment in _segments(shape.element)]
    except InputError as error:
        yield replace(nothing, problem=str(error))
        return
    except (ValueError, IndexError, TypeError, ArithmeticError):
        yield replace(nothing, problem="cannot be read; draw it again")
        return
    for segment in segments:
        straight = isinstance(segment, svgelements.Line | svgelements.Close)
        points = _at(segment, 2 if straight else _FIRST_LOOK) * [scale, -scale]
        if not np.isfinite(points).all():
            yield replace(nothing, problem="has no finite size; draw it again")
        else:
            sample = None if straight else partial(_sampled, segment, scale)
            yield replace(nothing, points=points, sample=sample)


def _matrix(transforms: tuple[str, ...]) -> svgelements.Matrix:
    """Return the product of transforms, the first of which acts first."""
    matrix = svgelements.Matrix()
    for text in transforms:
        try:
            if not _TRANSFORM.fullmatch(text):
                raise ValueError(text)
            matrix = matrix * svgelements.Matrix(text)
        except (ValueError, IndexError, TypeError):  # too few numbers, which the library finds out
            raise InputError(f"transform {text!r} cannot be read; draw it without one") from None
    return matrix


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


def _sampled(segment: svgelements.PathSegment, scale: float) -> Array:
    sides = np.diff(_at(segment, _FIRST_LOOK) * scale, axis=0)
    number = max(int(np.linalg.norm(sides, axis=1).sum() / STEP) + 2, 5)
    return _at(segment, number) * [scale, -scale]


def _at(segment: svgelements.PathSegment, number: int) -> Array:
    if isinstance(segment, svgelements.Line | svgelements.Close):
        return np.array([[end.x, end.y] for end in (segment.start, segment.end)], dtype=float)
    with np.errstate(all="ignore"):  # what is not finite is refused
        points = segment.npoint(np.linspace(0.0, 1.0, number))
    return np.asarray(points, dtype=float).reshape(-1, 2)
