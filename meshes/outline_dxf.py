"""Outlines as DXF: one closed polyline, spline, circle or ellipse, or lines and arcs that close.

Lengths are in the unit that the drawing names ($INSUNITS), in mm where it names none. Everything
in model space counts, on every layer; x and y are those of the world.
"""

import logging
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import path as dxf_path
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity
from ezdxf.math import Matrix44

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable
from calfsocket.meshes.drawn import EXTENT, Drawn, Piece, check_extent, joined

TYPES = ("LWPOLYLINE", "POLYLINE", "SPLINE", "CIRCLE", "ELLIPSE", "LINE", "ARC")
#: Distance, mm, from a curve to the chords that stand for it; their ends are on the curve.
_FLATNESS = 1e-5
#: Bezier pieces of an arc, at least: to 1e-6 mm on a circle of 100 mm, where one is 0.03 mm off.
_ARC_PIECES = 16
#: Times a spline that is no plain cubic is halved on the way to Bezier pieces.
_SPLINE_LEVEL = 6
#: How far an outline may leave its plane, mm.
_FLAT = 0.01

# What it has to say of bad drawings is said in one line here.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())


def read_dxf(path: Path) -> Drawn:
    """Read a closed outline.

    Raises
    ------
    InputError
        Naming file and entity.
    """
    check_readable(path)
    try:
        document = ezdxf.readfile(path)
    except Exception as error:  # the parser has many ways to fail on files of other kinds
        raise InputError(f"{path}: is not a readable DXF drawing; export it again") from error
    scale, unit = _unit(path, document)
    entities = list(document.modelspace())
    if not entities:
        raise InputError(f"{path}: the drawing is empty; draw one outline in model space")
    return joined(path, [_piece(path, entity, scale, unit) for entity in entities], unit)


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


def _piece(path: Path, entity: DXFEntity, scale: float, unit: str) -> Piece:
    """Return an entity as points in mm."""
    place = f"{entity.dxftype()} {entity.dxf.handle}"
    if entity.dxftype() not in TYPES:
        raise InputError(
            f"{path}, {place}: cannot be part of an outline; keep {', '.join(TYPES)}, explode"
            " blocks and delete the rest"
        )
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused
            curve = dxf_path.make_path(entity, segments=_ARC_PIECES, level=_SPLINE_LEVEL)
            curve = curve.transform(Matrix44.scale(scale))
        control = np.array([tuple(point) for point in curve.control_vertices()]).reshape(-1, 3)
    except Exception as error:  # of the library's own, on entities that contradict themselves
        raise InputError(f"{path}, {place}: cannot be read; draw it again") from error
    if len(control) < 2 or not np.isfinite(control).all():
        raise InputError(f"{path}, {place}: has no finite size; draw it again")
    if np.ptp(control[:, 2]) > _FLAT:
        raise InputError(
            f"{path}, {place}: extends {np.ptp(control[:, 2]):.3g} mm out of its plane; project it"
            " onto the x-y plane"
        )
    check_extent(path, control[:, :2], (0.0, 10 * EXTENT[1]), unit)
    points = np.array([(point.x, point.y) for point in curve.flattening(_FLATNESS)])
    return Piece(place, points, curve.has_curves)
