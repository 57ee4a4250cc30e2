"""Outlines that cannot be used: each is refused in one line that says where and what to do."""

import gzip
import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import reliability
from calfsocket.io.errors import InputError
from calfsocket.meshes.drawn import OutlineFile
from calfsocket.meshes.outline import read_outline
from drawings import dxf
from reliability import Trial

TITLE = "Outlines of sockets"
INTRO = "Files given as the inner face of a socket, as CSV, DXF or SVG."

ANGLES = np.deg2rad(np.arange(0, 360, 4))
CIRCLE = 55 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
EIGHT = np.column_stack([80 * np.cos(ANGLES), 50 * np.sin(2 * ANGLES)])
SQUARE = np.array([(-50, -50), (50, -50), (50, 50), (-50, 50)])
DENSE_ANGLES = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
DENSE = np.column_stack([np.cos(DENSE_ANGLES), np.sin(DENSE_ANGLES)])
#: Wavy by 0.3 mm every 0.7 mm.
ROUGH = (55 + 0.3 * np.cos(500 * DENSE_ANGLES))[:, None] * DENSE
#: A circle with a flat side that meets it in two corners of 45 degrees, scanned with noise.
CUT = np.minimum(55, 55 * np.cos(np.pi / 4) / np.maximum(DENSE[:, :1], 1e-9))
CORNERED = (CUT * DENSE)[::5] + np.random.default_rng(1).normal(0, 0.05, (600, 2))
#: A step of 1 mm, where a scan ends that was moved meanwhile.
STEPPED = ((55 + DENSE_ANGLES / (2 * np.pi))[:, None] * DENSE)[::5]


def rows(points: np.ndarray, header: str = "x, y\n") -> str:
    return header + "".join(f"{x:.5f}, {y:.5f}\n" for x, y in points)


def row(number: int, text: str) -> str:
    """A circle with another text in one line; the header is line 1."""
    lines = rows(CIRCLE).splitlines()
    lines[number - 1] = text
    return "\n".join(lines)


def numbered(separator: str) -> str:
    """Rows of a number, x and y."""
    return "".join(separator.join((f"{i}", f"{x}", f"{y}\n")) for i, (x, y) in enumerate(CIRCLE))


def scanned(points: np.ndarray) -> np.ndarray:
    """Points of a curve with noise of 0.05 mm."""
    return points + np.random.default_rng(0).normal(0, 0.05, points.shape)


def tilted(space: Any) -> None:
    space.add_circle((0, 0), 55, dxfattribs={"extrusion": (0.1, 0, 1)})


def stairs(space: Any) -> None:
    for i, (start, end) in enumerate(zip(CIRCLE, np.roll(CIRCLE, -1, axis=0), strict=True)):
        space.add_line((*start, i / 100), (*end, i / 100))


def layers(space: Any) -> None:
    space.add_circle((0, 0), 55, dxfattribs={"layer": "SOCKET"})
    space.add_circle((0, 0), 50, dxfattribs={"layer": "LIMB"})
    space.add_line((-80, 0), (80, 0), dxfattribs={"layer": "AXES"})
    space.add_text("TSB", dxfattribs={"layer": "TEXT"})


def arcs_with_a_gap(space: Any) -> None:
    space.add_arc((0, 0), 55, 0, 179.8)
    space.add_arc((0, 0), 55, 180, 360)


def on_paper(space: Any) -> None:
    space.doc.paperspace().add_circle((0, 0), 55)


def block(space: Any) -> None:
    space.doc.blocks.new("SOCKET").add_circle((0, 0), 55)
    space.add_blockref("SOCKET", (0, 0))


def lines(space: Any, points: np.ndarray) -> None:
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        space.add_line(start, end)


def almost_closed(space: Any) -> None:
    for start, end in pairwise([*CIRCLE, CIRCLE[0] + [1, 0]]):
        space.add_line(start, end)


def cut_short(path: Path) -> None:
    dxf(lambda space: space.add_lwpolyline(CIRCLE, close=True))(path)
    text = path.read_text()
    path.write_text(text[: text.index("LWPOLYLINE") + 300])


def svg(inside: str, attributes: str = 'width="160mm" viewBox="-80 -80 160 160"') -> str:
    return f'<svg xmlns="http://www.w3.org/2000/svg" {attributes}>{inside}</svg>'


CIRCLE_SVG = '<circle id="face" r="55"/>'
HALF = " ".join(f"{x:.3f},{y:.3f}" for x, y in CIRCLE[:46])
RING = "".join(f"M{r} 0A{r} {r} 0 0 1 {-r} 0A{r} {r} 0 0 1 {r} 0Z" for r in (55, 60))
LAYERS = (
    '<g id="socket"><circle id="inner" r="55"/></g>'
    '<g xmlns:i="http://www.inkscape.org/namespaces/inkscape" i:label="limb">'
    '<circle id="skin" r="56"/></g>'
)
LAUGHS = (
    '<!DOCTYPE svg [<!ENTITY a0 "ha">'
    + "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    + ']><svg xmlns="http://www.w3.org/2000/svg"><title>&a9;</title></svg>'
)


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(11_000_000)


TRIALS = (
    Trial("no such file", ("none.csv", None), ("none.csv: cannot be read (No such file",)),
    Trial("a folder", ("folder.csv", Path.mkdir), ("is not a regular file",)),
    Trial("a pipe that nobody writes to", ("pipe.csv", os.mkfifo), ("is not a regular file",)),
    Trial("a file of 11 MB", ("large.csv", sparse), ("is 11 MB; files up to 10 MB",)),
    Trial("a spreadsheet", ("a.xlsx", "x"), ("is a spreadsheet (XLSX)", ".csv, .dxf, .svg")),
    Trial(
        "a scan as STL",
        ("socket.stl", b"solid socket\n"),
        ("is a surface mesh (STL), not the outline of a socket; export it as one of .csv",),
    ),
    Trial("a file of an unknown kind", ("a.cut", "x"), (".cut is not an outline format",)),
    Trial("no extension", ("outline", "x"), ("outline: has no extension; export it as",)),
    Trial("an empty CSV", ("a.csv", ""), ("is empty; give a row `x, y`",)),
    Trial("a CSV of comments", ("a.csv", "# x, y\n\n"), ("is empty",)),
    Trial("a picture called CSV", ("a.csv", b"\x89PNG\r\n\x1a\n\0\0"), ("is not UTF-8 text",)),
    Trial("a CSV in Latin-1", ("a.csv", "# B\xf6schung\n".encode("latin-1")), ("not UTF-8",)),
    Trial("prose", ("a.csv", "Dear socket,\nhello"), ("names no columns x and y; write a header",)),
    Trial(
        "other columns",
        ("a.csv", "x, z\n1, 2\n"),
        ("names no columns x and y; write a header `x, y`",),
    ),
    Trial("a CSV in UTF-16", ("a.csv", "x, y\n".encode("utf-16")), ("is UTF-16 text; save it",)),
    Trial(
        "millimetres called cm",
        ("a.csv", rows(CIRCLE, "x [cm], y [cm]\n")),
        ("1.1e+03 x 1.1e+03 mm; allowed are 30 to 500 mm: its header says cm, correct that",),
    ),
    Trial("pixels", ("a.csv", rows(CIRCLE, "x [px], y [px]\n")), ("line 1: unit 'px'", "in mm")),
    Trial(
        "x and y in different units",
        ("a.csv", rows(CIRCLE, "x [mm], y [cm]\n")),
        ("line 1: unit 'cm, mm'",),
    ),
    Trial(
        "three columns",
        ("a.csv", rows(CIRCLE, "") + "1, 2, 3\n"),
        ("line 91: has 3 cells; every line must have two, x and y in mm",),
    ),
    Trial("one column", ("a.csv", row(5, "1")), ("line 5: has 1 cell; its header names 2",)),
    Trial(
        "decimal commas between commas",
        ("a.csv", "57,1,0,0\n57,0,4,2\n"),
        ("line 1: has 4 cells; every line must have two", "or a header must name them"),
    ),
    Trial(
        "a row that breaks off",
        ("a.csv", f"nr; x; y\n{numbered(';')}91;5\n"),
        ("line 92: has 2 cells; its header names 3",),
    ),
    Trial(
        "decimal commas in quotes between commas",
        ("a.csv", "x,y\n" + "".join(f'"{x:.1f}","{y:.1f}"\n'.replace(".", ",") for x, y in CIRCLE)),
        ("line 2: has 4 cells; its header names 2; decimal commas need semicolons",),
    ),
    Trial(
        "a cut that is not flat",
        ("a.csv", "x, y, z\n" + "".join(f"{x}, {y}, {0.1 * x}\n" for x, y in CIRCLE)),
        ("extends 11 mm out of its plane, more than 0.05 mm; turn it into the x-y plane",),
    ),
    Trial(
        "numbered points without a header",
        ("a.csv", numbered(",")),
        ("out of its plane", "name the columns x and y where the third is not z"),
    ),
    Trial(
        "a layer of a CSV",
        ("a.csv", rows(CIRCLE), {"layer": "SOCKET"}),
        ("a CSV has one curve and no layers; remove `layer`",),
    ),
    Trial(
        "a letter for a digit", ("a.csv", row(7, "5O.1, 2")), ("line 7: '5O.1' is not a length",)
    ),
    Trial("NaN", ("a.csv", row(7, "nan, 2")), ("line 7: 'nan' is not a length; give a number",)),
    Trial(
        "infinity",
        ("a.csv", row(7, "1, 1e999")),
        ("line 7: '1e999' is not a length; give a number",),
    ),
    Trial("three points", ("a.csv", rows(CIRCLE[::30])), ("has 3 points", "needs at least 4")),
    Trial("a header alone", ("a.csv", "x, y\n"), ("has 0 points",)),
    Trial(
        "half an outline",
        ("a.csv", rows(CIRCLE[:46])),
        ("is open: its ends, line 47 and line 2, are 110.0 mm apart",),
    ),
    Trial(
        "a figure of eight",
        ("a.csv", rows(EIGHT)),
        ("crosses or touches itself near (0.00, 0.00) mm", "in order"),
    ),
    Trial(
        "points out of order",
        ("a.csv", rows(CIRCLE[np.r_[0:20, 40:20:-1, 41:90]])),
        ("crosses or touches itself",),
    ),
    Trial(
        "twice around",
        ("a.csv", rows(np.concatenate([CIRCLE, CIRCLE]))),
        ("crosses or touches itself",),
    ),
    Trial(
        "metres", ("a.csv", rows(CIRCLE / 1000)), ("0.11 x 0.11 mm (drawn in m?)", "30 to 500 mm")
    ),
    Trial("inches", ("a.csv", rows(CIRCLE / 25.4)), ("drawn in inch",)),
    Trial("micrometres", ("a.csv", rows(CIRCLE * 1000)), ("drawn in micrometres?",)),
    Trial(
        "a square",
        ("a.csv", rows(SQUARE)),
        ("line 2: the outline turns by 90 degrees at (-50.00, -50.00) mm", "round the corner off"),
    ),
    Trial(
        "a spike",
        ("a.csv", row(7, "80, 30")),
        ("line 7: the outline turns too sharply near", "no smooth curve stays within 0.2 mm of it"),
    ),
    Trial(
        "60 000 points",
        ("a.csv", rows(np.tile(CIRCLE, (700, 1)))),
        ("has 63000 points, more than 50000",),
    ),
    Trial(
        "a rough outline", ("a.csv", rows(ROUGH)), ("no smooth curve stays within 0.2 mm of it",)
    ),
    Trial(
        "corners in a noisy scan",
        ("a.csv", rows(CORNERED)),
        ("the outline turns too sharply near (38.", "round the corner off"),
    ),
    Trial(
        "a scan with a step where it closes",
        ("a.csv", rows(STEPPED)),
        ("the outline turns too sharply near (56.", "no smooth curve stays within 0.2 mm of it"),
    ),
    Trial(
        "a scan with less noise allowed than it has",
        ("a.csv", rows(scanned(55 * DENSE[::5])), {"tolerance": 0.01}),
        ("no smooth curve stays within 0.01 mm of it", "set `tolerance`"),
    ),
    Trial("prose called DXF", ("a.dxf", "Dear socket,\nhello"), ("is not a readable DXF drawing",)),
    Trial("an empty DXF", ("a.dxf", b""), ("is not a readable DXF drawing",)),
    Trial("bytes called DXF", ("a.dxf", bytes(range(256))), ("is not a readable DXF drawing",)),
    Trial("a DXF cut short", ("a.dxf", cut_short), ("is not a readable DXF drawing",)),
    Trial("a DXF with nothing in it", ("a.dxf", dxf(lambda s: None)), ("the drawing is empty",)),
    Trial(
        "an open polyline",
        ("a.dxf", dxf(lambda s: s.add_lwpolyline(CIRCLE[:46]))),
        ("LWPOLYLINE", "is open at", "110 mm away"),
    ),
    Trial(
        "lines that miss by 1 mm",
        ("a.dxf", dxf(almost_closed)),
        ("LINE", "is open at (56.00, 0.00) mm: the nearest end is 1 mm away"),
    ),
    Trial(
        "two circles",
        ("a.dxf", dxf(lambda s: (s.add_circle((0, 0), 50), s.add_circle((0, 0), 55)))),
        ("contains 2 outlines (CIRCLE", "keep the inner face only"),
    ),
    Trial(
        "a line too many",
        ("a.dxf", dxf(lambda s: (lines(s, CIRCLE), s.add_line(CIRCLE[3], (90, 90))))),
        ("remove the branches",),
    ),
    Trial(
        "a text beside the outline",
        ("a.dxf", dxf(lambda s: (s.add_circle((0, 0), 55), s.add_text("TSB")))),
        ("TEXT", "cannot be part of an outline"),
    ),
    Trial("an outline in a block", ("a.dxf", dxf(block)), ("INSERT", "explode or delete it")),
    Trial(
        "a DXF in metres",
        ("a.dxf", dxf(lambda s: s.add_circle((0, 0), 55), unit=6)),
        ("1.1e+05 x 1.1e+05 mm", "$INSUNITS says meters"),
    ),
    Trial(
        "a polyline out of its plane",
        ("a.dxf", dxf(lambda s: s.add_polyline3d([(x, y, x) for x, y in CIRCLE], close=True))),
        ("extends 110 mm out of its plane",),
    ),
    Trial(
        "a square as lines",
        ("a.dxf", dxf(lambda s: lines(s, SQUARE))),
        ("turns by 90 degrees",),
    ),
    Trial(
        "a circle without radius",
        ("a.dxf", dxf(lambda s: s.add_circle((0, 0), 0))),
        ("CIRCLE", "has no finite size"),
    ),
    Trial(
        "a circle of NaN",
        ("a.dxf", dxf(lambda s: s.add_circle((0, 0), float("nan")))),
        ("CIRCLE",),
    ),
    Trial("a DWG drawing called DXF", ("a.dxf", b"AC1027\0\0\1"), ("is a DWG drawing; export it",)),
    Trial("a PDF called DXF", ("a.dxf", b"%PDF-1.7\n%EOF"), ("is not a readable DXF drawing",)),
    Trial("an outline in paper space", ("a.dxf", dxf(on_paper)), ("the drawing is empty",)),
    Trial(
        "a cloud of points",
        ("a.dxf", dxf(lambda s: [s.add_point(p) for p in CIRCLE])),
        ("POINT", "cannot be part of an outline"),
    ),
    Trial(
        "a face of a surface",
        ("a.dxf", dxf(lambda s: s.add_3dface([(0, 0), (50, 0), (50, 50), (0, 50)]))),
        ("3DFACE", "cannot be part of an outline"),
    ),
    Trial("a tilted circle", ("a.dxf", dxf(tilted)), ("extends 10.9 mm out of its plane",)),
    Trial("lines at rising heights", ("a.dxf", dxf(stairs)), ("extends 0.89 mm out of its plane",)),
    Trial(
        "millimetres called inches",
        ("a.dxf", dxf(lambda s: s.add_circle((0, 0), 55), unit=1)),
        ("2.79e+03 x 2.79e+03 mm", "$INSUNITS says inches"),
    ),
    Trial(
        "arcs with a gap of 0.19 mm",
        ("a.dxf", dxf(arcs_with_a_gap)),
        ("ARC", "is open at", "the nearest end is 0.192 mm away; close it, to 0.05 mm"),
    ),
    Trial(
        "curves on several layers",
        ("a.dxf", dxf(layers)),
        ("TEXT 32: cannot be part of an outline", "CIRCLE 2F on layer 'SOCKET', 346 mm"),
    ),
    Trial(
        "a layer misspelt",
        ("a.dxf", dxf(layers), {"layer": "SOCKTE"}),
        ("no layer 'SOCKTE'; did you mean 'SOCKET'?",),
    ),
    Trial(
        "a handle that is not there",
        ("a.dxf", dxf(layers), {"curve": "FF"}),
        (
            "no curve 'FF'; there are CIRCLE 2F on layer 'SOCKET', 346 mm; CIRCLE 30 on layer "
            "'LIMB', 314 mm; LINE 31 on layer 'AXES', 160 mm, open",
        ),
    ),
    Trial(
        "a layer with an axis",
        ("a.dxf", dxf(layers), {"layer": "AXES"}),
        ("LINE 31: the outline is open at", "the nearest end is 160 mm away"),
    ),
    Trial("prose called SVG", ("a.svg", "Dear socket"), ("is not an SVG drawing (syntax error",)),
    Trial("an empty SVG file", ("a.svg", ""), ("is not an SVG drawing (no element found",)),
    Trial("a web page called SVG", ("a.svg", "<html></html>"), ("its root is 'html'",)),
    Trial("an SVG with nothing in it", ("a.svg", svg("<g/>")), ("the drawing is empty",)),
    Trial("an SVG that a bomb is hidden in", ("a.svg", LAUGHS), ("is not an SVG drawing",)),
    Trial("an SVG in UTF-16", ("a.svg", svg(CIRCLE_SVG).encode("utf-16")), ("is UTF-16 text",)),
    Trial("a packed SVG", ("a.svg", gzip.compress(b"<svg/>", mtime=0)), ("is not UTF-8 text",)),
    Trial("a text", ("a.svg", svg(CIRCLE_SVG + "<text>TSB</text>")), ("text number 2: cannot be",)),
    Trial(
        "a picture with the outline",
        ("a.svg", svg('<image id="scan"/>' + CIRCLE_SVG)),
        ("image scan: cannot be part of an outline",),
    ),
    Trial("an icon", ("a.svg", svg('<circle r="11"/>', "")), ("5.82 x 5.82 mm; allowed",)),
    Trial(
        "inner and outer face in one path",
        ("a.svg", svg(f'<path id="wall" d="{RING}"/>')),
        ("contains 2 outlines (path wall, 346 mm; path wall, 377 mm)", "break path wall apart"),
    ),
    Trial(
        "a rectangle as a path",
        ("a.svg", svg('<path id="box" d="M-40-40H40V40H-40Z"/>')),
        ("path box: the outline turns by 90 degrees at ",),
    ),
    Trial(
        "corners of a curved path",
        ("a.svg", svg('<path id="drop" d="M0 60C-60 60-60-60 0-60 30-60 30 20 0 60Z"/>')),
        ("path drop: the outline turns too sharply near (0.",),
    ),
    Trial(
        "a star",
        ("a.svg", svg('<polygon id="star" points="0,-60 35,50 -57,-20 57,-20 -35,50"/>')),
        ("polygon star: the outline crosses or touches itself",),
    ),
    Trial(
        "two layers",
        ("a.svg", svg(LAYERS)),
        ("contains 2 outlines (circle inner on layer 'socket', 346 mm; circle skin on layer",),
    ),
    Trial(
        "a layer of another name",
        ("a.svg", svg(LAYERS), {"layer": "limbs"}),
        ("no layer 'limbs'; did you mean 'limb'?",),
    ),
    Trial(
        "an id of another name",
        ("a.svg", svg(CIRCLE_SVG), {"curve": "inner"}),
        ("no curve 'inner'; there are circle face, 346 mm",),
    ),
    Trial(
        "a layer where there is none",
        ("a.svg", svg(CIRCLE_SVG), {"layer": "a"}),
        ("no layer 'a'; the drawing has none",),
    ),
    Trial(
        "an open path",
        ("a.svg", svg(f'<path id="face" d="M {HALF}"/>')),
        ("path face", "is open at", "110 mm away"),
    ),
    Trial(
        "two shapes",
        ("a.svg", svg(CIRCLE_SVG + '<circle r="50"/>')),
        ("contains 2 outlines (circle face, 346 mm; circle number 2, 314 mm)",),
    ),
    Trial(
        "a path that breaks off",
        ("a.svg", svg('<path d="M 0 0 L 10"/>')),
        ("path number 1: cannot be read",),
    ),
    Trial(
        "a path of words", ("a.svg", svg('<path d="round"/>')), ("path number 1: cannot be read",)
    ),
    Trial(
        "a polygon with half a point",
        ("a.svg", svg('<polygon points="0,0 1,1 2"/>')),
        ("polygon number 1: cannot be read",),
    ),
    Trial(
        "a radius in per cent",
        ("a.svg", svg('<circle r="50%"/>')),
        ("circle number 1: cannot be read",),
    ),
    Trial(
        "a rectangle",
        ("a.svg", svg('<rect width="100" height="80"/>')),
        ("rect number 1: cannot be part of an outline",),
    ),
    Trial(
        "a clone",
        ("a.svg", svg(f'{CIRCLE_SVG}<use href="#face"/>')),
        ("use number 2: cannot be part",),
    ),
    Trial(
        "a transform of words",
        ("a.svg", svg('<circle r="55" transform="turn it"/>')),
        ("transform 'turn it' cannot be read",),
    ),
    Trial(
        "a matrix of three",
        ("a.svg", svg('<circle r="55" transform="matrix(1 2 3)"/>')),
        ("transform 'matrix(1 2 3)' cannot",),
    ),
    Trial(
        "a viewBox without a width",
        ("a.svg", svg(CIRCLE_SVG, 'viewBox="-80 -80 160 160"')),
        ("width is missing; with a viewBox",),
    ),
    Trial(
        "a width in per cent",
        ("a.svg", svg(CIRCLE_SVG, 'width="100%" viewBox="-80 -80 160 160"')),
        ("width is '100%'",),
    ),
    Trial(
        "a viewBox without area",
        ("a.svg", svg(CIRCLE_SVG, 'width="160mm" viewBox="0 0 0 0"')),
        ("viewBox is '0 0 0 0'",),
    ),
    Trial(
        "a page of another shape",
        ("a.svg", svg(CIRCLE_SVG, 'width="160mm" height="100mm" viewBox="-80 -80 160 160"')),
        ("1 mm wide but 0.625 mm high",),
    ),
    Trial(
        "a page ten times too small",
        ("a.svg", svg(CIRCLE_SVG, 'width="16mm" viewBox="-80 -80 160 160"')),
        ("11 x 11 mm; allowed are 30 to 500 mm: its unit is 0.1 mm by width and viewBox, correct",),
    ),
)


def said(trial: Trial, folder: Path) -> str:
    """Return the message with which the reader refuses the outline."""
    name, content, *choice = trial.given
    path = folder / name
    if callable(content):
        content(path)
    elif content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read_outline(path, OutlineFile(**dict(*choice)))
    return str(caught.value).replace(f"{folder}/", "")


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_an_outline_that_cannot_be_used_is_refused_in_one_line(
    trial: Trial, tmp_path: Path
) -> None:
    line = said(trial, tmp_path)
    assert line.startswith(trial.given[0])
    assert "\n" not in line
    assert len(line) < 400
    for part in trial.says:
        assert part in line
    assert reliability.row(trial, line) in reliability.rows()
