"""Outlines as DXF: one closed polyline, spline, circle or ellipse, or lines and arcs that close.

Lengths are in the unit that the drawing names ($INSUNITS), in mm where it names none. Everything
in model space counts, on every layer unless one is chosen; x and y are those of the world.
"""

import codecs
import io
import logging
import re
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import path as dxf_path
from ezdxf import recover, units
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity, Spline
from ezdxf.math import Matrix44
from scipy.interpolate import BSpline

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable
from calfsocket.meshes.curves import Array
from calfsocket.meshes.drawn import Drawn, OutlineFile, Piece, joined

TYPES = ("LWPOLYLINE", "POLYLINE", "SPLINE", "CIRCLE", "ELLIPSE", "LINE", "ARC")
#: Distance, mm, from a curve to the chords that stand for it; their ends are on the curve.
_FLATNESS = 1e-5
#: Bezier pieces of an arc, at least: to 1e-6 mm on a circle of 100 mm, where one is 0.03 mm off.
_ARC_PIECES = 16
#: Times a spline that is no plain cubic is halved on the way to Bezier pieces.
_SPLINE_LEVEL = 6
#: A handle that was left blank, which the format does not allow.
_BLANK_HANDLE = re.compile(rb"(?m)^[ \t]*5[ \t]*\r?\n[ \t]*\r?\n")
#: Parts of other entities that are entities of their own in the file.
_PARTS = {b"VERTEX", b"SEQEND", b"ATTRIB"}

# What it has to say of bad drawings is said in one line here.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())


def read_dxf(path: Path, file: OutlineFile) -> Drawn:
    """Read a closed outline.

    Raises
    ------
    InputError
        Naming file and entity.
    """
    return joined(path, *dxf_pieces(path), file)


def dxf_pieces(path: Path) -> tuple[list[Piece], str]:
    """Return all that is drawn, and what the drawing says of its unit."""
    check_readable(path)
    document = _document(path)
    scale, unit = _unit(path, document)
    entities = list(document.modelspace())
    uses = Counter(entity.dxf.handle for entity in entities)
    pieces = [
        _piece(entity, "" if uses[entity.dxf.handle] > 1 else entity.dxf.handle, number, scale)
        for number, entity in enumerate(entities, 1)
    ]
    return pieces, unit


def _document(path: Path) -> Drawing:
    """Read a drawing, and mend it where it is only a little wrong."""
    content = path.read_bytes()
    if content.startswith(b"AC10"):
        raise InputError(f"{path}: is a DWG drawing; export it as DXF")
    # The parser has many ways to fail on files that are wrong, or of other kinds.
    with suppress(Exception):
        return ezdxf.readfile(path)
    mended = _BLANK_HANDLE.sub(b"", content.removeprefix(codecs.BOM_UTF8).strip()) + b"\n"
    end = mended.split()[-1:]
    if end == [b"ENDSEC"]:
        mended += b"0\nEOF\n"
    elif end != [b"EOF"]:  # maybe in the middle of the outline
        raise InputError(
            f"{path}: is not a readable DXF drawing, or was cut short; export it again"
        )
    with suppress(Exception):
        return ezdxf.read(io.StringIO(mended.decode("utf-8", "replace")))
    with suppress(Exception):
        document, auditor = recover.read(io.BytesIO(mended))
        if not auditor.has_errors and _entities(mended) <= sum(map(len, document.layouts)):
            return document
    raise InputError(f"{path}: is not a readable DXF drawing; export it again")


def _entities(content: bytes) -> int:
    """Return how many entities a drawing has, so that none is lost."""
    section = re.search(rb"\bENTITIES\s(.*?)\bENDSEC\b", content, re.DOTALL)
    names = re.findall(rb"(?m)^[ \t]*0[ \t]*\r?\n[ \t]*(\w+)", section[1] if section else b"")
    return sum(name not in _PARTS for name in names)


def _unit(path: Path, document: Drawing) -> tuple[float, str]:
    """Return the drawing's unit in mm, and what the drawing says of it."""
    number = document.units
    # Where a drawing has no header at all, the library says metres.
    if number == 0 or b"$INSUNITS" not in path.read_bytes():
        return 1.0, ""
    name = units.unit_name(number).lower()
    try:
        scale = units.conversion_factor(units.InsertUnits(number), units.InsertUnits(units.MM))
    except (TypeError, ValueError, IndexError, KeyError) as error:
        raise InputError(
            f"{path}: $INSUNITS is {number}, which is not a unit of length; set it to 4"
            " (millimetres)"
        ) from error
    return scale, f"its $INSUNITS says {name}"


def _piece(entity: DXFEntity, handle: str, number: int, scale: float) -> Piece:
    """Return an entity as points in mm."""
    place = f"{entity.dxftype()} {handle or f'number {number}'}"
    layer = entity.dxf.get("layer", "0") if entity.dxf.is_supported("layer") else "0"
    nothing = Piece(place, np.empty((0, 3)), handle, layer=layer)
    if entity.dxftype() not in TYPES:
        return replace(
            nothing,
            problem=f"cannot be part of an outline, which is made of {', '.join(TYPES)}; explode"
            " or delete it",
        )
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused
            if isinstance(entity, Spline):
                _clamp(entity)
            curve = dxf_path.make_path(entity, segments=_ARC_PIECES, level=_SPLINE_LEVEL)
            curve = curve.transform(Matrix44.scale(scale))
        control = np.array([tuple(point) for point in curve.control_vertices()]).reshape(-1, 3)
    except Exception:  # of the library's own, on entities that contradict themselves
        return replace(nothing, problem="cannot be read; draw it again")
    if len(control) < 2 or not np.isfinite(control).all():
        return replace(nothing, problem="has no finite size; draw it again")

    def sample() -> Array:
        return np.array([(point.x, point.y) for point in curve.flattening(_FLATNESS)])

    return replace(nothing, points=control, sample=sample if curve.has_curves else None)


def _clamp(spline: Spline) -> None:
    """Let a periodic spline begin and end at control points, without which it is not read right."""
    degree, number = spline.dxf.degree, len(spline.control_points)
    knots = np.array(spline.knots)
    if len(knots) != number + degree + 1 or knots[0] == knots[degree]:
        return
    weights = np.array(spline.weights or [1.0] * number)[:, None]
    # In homogeneous coordinates a knot that is added does not change the curve.
    control = np.hstack([np.array(spline.control_points) * weights, weights])
    curve = BSpline(knots, control, degree)
    ends = knots[degree], knots[number]
    for end in ends:
        for _ in range(degree + 1 - np.count_nonzero(knots == end)):
            curve = curve.insert_knot(end)
    inside = np.flatnonzero((curve.t >= ends[0]) & (curve.t <= ends[1]))
    control = curve.c[inside[0] :][: len(inside) - degree - 1]
    spline.knots = list(curve.t[inside])
    spline.control_points = control[:, :3] / control[:, 3:]
    spline.weights = list(control[:, 3])
