"""Outlines read from CSV, DXF and SVG: the same curve comes back, whatever it was drawn with."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from geometry import LIMB
from mesh_measures import area, jacobian_bounds
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes import curves, section
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.outline import MANY_POINTS, read_outline
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Outline, Socket
from drawings import dxf

TSB = Socket.reference("TSB")
FACE = TSB.inner_face(LIMB)
POINTS = FACE.evaluate(np.linspace(0, FACE.period, 180, endpoint=False))


def deviation(one: ClosedCurve, other: ClosedCurve) -> float:
    """Largest distance of a curve from another, whose points are 0.02 mm apart."""
    tree = cKDTree(other.evaluate(other.sample(0.02)))
    return tree.query(one.evaluate(one.sample(0.1)))[0].max()


def csv(path: Path) -> None:
    np.savetxt(path, POINTS, delimiter=",", fmt="%.4f", header="x, y", comments="")


def dense_csv(path: Path) -> None:
    points = FACE.evaluate(np.linspace(0, FACE.period, 5000, endpoint=False))
    np.savetxt(path, points[::-1], delimiter=",", fmt="%.6f")


def scanned_csv(path: Path) -> None:
    """Every 0.1 mm, to 0.01 mm."""
    points = FACE.evaluate(np.linspace(0, FACE.period, 3600, endpoint=False))
    np.savetxt(path, points, delimiter=",", fmt="%.2f")


def german_csv(path: Path) -> None:
    """As a German spreadsheet writes it, closed by its first point."""
    rows = [f"{x:.4f};{y:.4f}".replace(".", ",") for x, y in [*POINTS, POINTS[0]]]
    path.write_text("\ufeff" + "\r\n".join(["X [mm];Y [mm]", *rows]) + "\r\n", encoding="utf-8")


def spline(space: Any) -> None:
    """The very B-spline of the face."""
    degree, knots, _, control = FACE.b_spline()
    entity = space.add_spline(degree=degree)
    entity.control_points = np.column_stack([control, np.zeros(len(control))])
    entity.knots = [*[knots[0]] * degree, *knots, *[knots[-1]] * degree]


def loose_lines(space: Any) -> None:
    """Lines in any order and direction."""
    sides = list(zip(POINTS, np.roll(POINTS, -1, axis=0), strict=True))
    for i in np.random.default_rng(0).permutation(len(sides)):
        space.add_line(*sides[i][:: 1 if i % 3 else -1])


def bare_dxf(path: Path) -> None:
    """Entities without header and tables, as scanners' programs write them."""
    lines = ["0", "SECTION", "2", "ENTITIES"]
    for (x, y), (u, v) in zip(POINTS, np.roll(POINTS, -1, axis=0), strict=True):
        lines += ["0", "LINE", "8", "0"]
        for code, value in zip((10, 20, 11, 21), (x, y, u, v), strict=True):
            lines += [str(code), f"{value:.5f}"]
    path.write_text("\n".join([*lines, "0", "ENDSEC", "0", "EOF", ""]))


def blanks(path: Path) -> None:
    """Decimal commas between blanks, after remarks."""
    rows = [f"{x:.4f}\t {y:.4f}".replace(".", ",").replace("\t", " ") for x, y in POINTS]
    path.write_text("\n".join(["% scanned", "// in mm", "X Y", *rows]))


def spreadsheet(path: Path) -> None:
    """Numbered, in metres by a line of units, with z constant and an empty last column."""
    rows = [f"{i}\t{x / 1e3:.7f}\t{y / 1e3:.7f}\t0.35\t" for i, (x, y) in enumerate(POINTS)]
    path.write_text("\n".join(["nr\tpos x\ty_coord\tZ value\t", "\tm\tm\tm\t", *rows]))


def paraview(path: Path) -> None:
    """A slice that rises by 0.02 mm, its points written twice now and then, y first."""
    rows = [f"{y:.5f},7,{x:.5f},{0.02 * (x > 0)}" for x, y in POINTS]
    rows = [row for i, row in enumerate(rows) for _ in range(1 + (i % 50 == 0))]
    path.write_text("\n".join(['"Points:1","id","Points:0","Points:2"', *rows]))


def in_cm(path: Path) -> None:
    rows = [f"{x / 10:.6f},{y / 10:.6f},cm" for x, y in POINTS]
    path.write_text("\n".join(["Inner face, left", "", "x,y,unit", *rows]))


def periodic_spline(space: Any) -> None:
    """The face as a periodic B-spline, whose knots go on beyond its ends."""
    t, h = np.linspace(0, FACE.period, 181), FACE.period / 180
    control = make_interp_spline(t, FACE.evaluate(t), k=3, bc_type="periodic").c
    entity = space.add_spline(degree=3)
    entity.closed = True
    entity.control_points = np.column_stack([control, np.zeros(len(control))])
    entity.knots = [*(-h * np.arange(3, 0, -1)), *t, *(t[-1] + h * np.arange(1, 4))]


def blank_handles(path: Path) -> None:
    """Lines without handles, in a file that ends too early, after a byte order mark."""
    bare_dxf(path)
    text = path.read_text().replace("\nLINE\n", "\nLINE\n5\n\n").replace("0\nEOF\n", "")
    path.write_text("\ufeff999\nexported\n" + text)


def one_handle(path: Path) -> None:
    """Lines that all have the same handle."""
    bare_dxf(path)
    path.write_text(path.read_text().replace("\nLINE\n", "\nLINE\n5\nA1\n"))


def binary(path: Path) -> None:
    document = ezdxf.new("R2018", units=4)
    document.modelspace().add_lwpolyline(POINTS, close=True)
    document.saveas(path, fmt="bin")


def old(path: Path) -> None:
    document = ezdxf.new("R2000", units=1)
    document.modelspace().add_polyline2d(POINTS / 25.4, close=True)
    document.saveas(path)


def almost_flat(space: Any) -> None:
    heights = np.random.default_rng(0).uniform(350.0, 350.02, (len(POINTS), 1))
    space.add_polyline3d(np.hstack([POINTS, heights]), close=True)


def almost_joined(space: Any) -> None:
    """Lines whose ends were rounded to 0.02 mm apart."""
    for start, end in zip(POINTS, np.roll(POINTS, -1, axis=0), strict=True):
        space.add_line(start, end - 0.02 * (end - start) / np.linalg.norm(end - start))


def bezier(path: Path) -> None:
    """The face's cubic pieces, on a page of 15 x 15 cm, in a group that is moved and moved back."""
    t = FACE.knots
    third = np.diff(t)[:, None] / 3
    point, velocity = FACE.evaluate(t), FACE.evaluate(t, 1)
    pieces = np.stack(
        [point[:-1] + third * velocity[:-1], point[1:] - third * velocity[1:], point[1:]], axis=1
    )
    down = np.array([1.0, -1.0])
    text = (
        "M"
        + " ".join(map(str, point[0] * down))
        + "C"
        + " ".join(map(str, (pieces * down).ravel()))
    )
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="15cm" height="15cm"'
        ' viewBox="-75 -75 150 150"><title>TSB</title><defs><circle r="3"/></defs>'
        '<g transform="translate(30, 40)"><rect style="display:none" width="9"/>'
        f'<path id="face" transform="translate(-30 -40)" d="{text}Z"/></g></svg>'
    )


def pixels(path: Path) -> None:
    """Without a viewBox a unit is a pixel, of which an inch has 96."""
    x, y = POINTS.T / 25.4 * 96
    text = " ".join(f"{a:.6f},{-b:.6f}" for a, b in zip(x, y, strict=True))
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg"><polygon points="{text}"/></svg>')


WAYS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "CSV": ("face.csv", csv),
    "dense clockwise CSV": ("face.csv", dense_csv),
    "scanned CSV": ("face.csv", scanned_csv),
    "German CSV": ("face.csv", german_csv),
    "CSV with blanks": ("face.csv", blanks),
    "CSV in m with a line of units": ("face.csv", spreadsheet),
    "CSV of ParaView": ("face.csv", paraview),
    "CSV in cm by a column": ("face.csv", in_cm),
    "DXF with blank handles and no end": ("face.dxf", blank_handles),
    "DXF with one handle": ("face.dxf", one_handle),
    "binary DXF": ("face.dxf", binary),
    "old DXF in inches": ("face.dxf", old),
    "DXF flat to 0.02 mm": ("face.dxf", dxf(almost_flat)),
    "DXF with gaps of 0.02 mm": ("face.dxf", dxf(almost_joined)),
    "DXF polyline": ("face.dxf", dxf(lambda s: s.add_lwpolyline(POINTS, close=True))),
    "DXF polyline in cm": ("face.dxf", dxf(lambda s: s.add_lwpolyline(POINTS / 10, close=True), 5)),
    "DXF polyline without unit": (
        "FACE.DXF",
        dxf(lambda s: s.add_polyline2d(POINTS, close=True), 0),
    ),
    "DXF spline": ("face.dxf", dxf(spline)),
    "DXF periodic spline": ("face.dxf", dxf(periodic_spline)),
    "DXF lines": ("face.dxf", dxf(loose_lines)),
    "DXF of lines alone": ("face.dxf", bare_dxf),
    "SVG path": ("face.svg", bezier),
    "SVG polygon in pixels": ("face.svg", pixels),
}


@pytest.mark.parametrize(("name", "write"), WAYS.values(), ids=WAYS)
def test_the_reference_socket_comes_back_from_a_file(
    name: str, write: Callable[[Path], None], tmp_path: Path
) -> None:
    write(tmp_path / name)
    custom = Socket.read(tmp_path / name)
    assert isinstance(custom, Outline)
    assert len(custom.points) <= MANY_POINTS
    for face, reference in zip(custom.faces(LIMB), TSB.faces(LIMB), strict=True):
        assert deviation(face, reference) < 0.02
    found, wanted = check_placement(custom, LIMB), check_placement(TSB, LIMB)
    assert found.area_reduction == pytest.approx(wanted.area_reduction, abs=3e-5)
    assert found.mean_overlap == pytest.approx(wanted.mean_overlap, abs=1e-3)


def test_shapes_of_known_area(tmp_path: Path) -> None:
    """Circle, ellipse, and two lines with two arcs, as loose entities and as one polyline."""
    stadium = [(-20, -40, 0), (20, -40, 1), (20, 40, 0), (-20, 40, 1)]

    def loose_stadium(space: Any) -> None:
        space.add_line((-20, -40), (20, -40))
        space.add_arc((-20, 0), 40, 90, 270)
        space.add_line((-20, 40), (20, 40))
        space.add_arc((20, 0), 40, -90, 90)

    half_circles = "M-20 40 L20 40 A40 40 0 0 0 20 -40 H-20 A40 40 0 0 0 -20 40"
    drawings: dict[str, tuple[Any, float]] = {
        "circle.dxf": (dxf(lambda s: s.add_circle((3, 4), 50)), np.pi * 50**2),
        "ellipse.dxf": (dxf(lambda s: s.add_ellipse((3, 4), (30, 40), 0.8)), np.pi * 50 * 40),
        "loose.dxf": (dxf(loose_stadium), np.pi * 40**2 + 80 * 40),
        "bulges.dxf": (
            dxf(lambda s: s.add_lwpolyline(stadium, format="xyb", close=True)),
            np.pi * 40**2 + 80 * 40,
        ),
        "circle.svg": ('<circle cx="3" cy="4px" r="50"/>', np.pi * 50**2),
        "ellipse.svg": ('<ellipse rx="50" ry="40" transform="rotate(30)"/>', np.pi * 50 * 40),
        "stadium.svg": (f'<path d="{half_circles}"/>', np.pi * 40**2 + 80 * 40),
    }
    for name, (draw, enclosed) in drawings.items():
        if callable(draw):
            draw(tmp_path / name)
        else:
            head = '<svg xmlns="http://www.w3.org/2000/svg" width="1in" viewBox="0 0 25.4 1">'
            (tmp_path / name).write_text(f"{head}{draw}</svg>")
        curve = curves.through(read_outline(tmp_path / name).points)
        assert curve.area == pytest.approx(enclosed, rel=1e-5), name
        if name.startswith("circle"):
            centre = (3.0, 4.0 if name.endswith("dxf") else -4.0)  # y points down in an SVG
            radius = np.linalg.norm(curve.evaluate(curve.sample(0.1)) - centre, axis=1)
            assert radius == pytest.approx(np.full(len(radius), 50.0), abs=2e-4)


def test_down_in_a_drawing_is_the_back_of_the_limb(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    path.write_text('<svg width="99mm" viewBox="0 0 99 99"><circle cx="50" cy="30" r="40"/></svg>')
    assert np.mean(read_outline(path).points, axis=0) == pytest.approx([50, -30], abs=0.01)


def test_slight_corners_of_a_drawing_are_rounded_off_within_0_02_mm(tmp_path: Path) -> None:
    """A circle's arc with a polygon about it: corners of 28 degrees, and of 14 to the arc."""
    radius, turn = 60.0, np.deg2rad(28.0)
    angles = np.arange(5) * turn
    corners = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    bulge = np.tan((2 * np.pi - angles[-1]) / 4)
    vertices = [(x, y, 0.0) for x, y in corners[:-1]] + [(*corners[-1], bulge)]
    dxf(lambda s: s.add_lwpolyline(vertices, format="xyb", close=True))(tmp_path / "a.dxf")
    curve = curves.through(read_outline(tmp_path / "a.dxf").points)
    points = curve.evaluate(curve.sample(0.02))
    angle = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
    radii = np.linalg.norm(points, axis=1)
    # On a chord the radius is that of its middle over the cosine of the angle from there.
    off_middle = angle % turn - turn / 2
    on_chord = radius * np.cos(turn / 2) / np.cos(off_middle)
    error = np.abs(radii - np.where(angle < angles[-1], on_chord, radius))
    assert 0.005 < error.max() < 0.02


def test_the_points_of_a_polygon_are_kept_as_they_are(tmp_path: Path) -> None:
    csv(tmp_path / "a.csv")
    assert np.array(read_outline(tmp_path / "a.csv").points) == pytest.approx(POINTS, abs=6e-5)


def scan(face: ClosedCurve, noise: float, seed: int = 0) -> np.ndarray:
    """Points 0.015 to 4 mm apart with noise in both directions."""
    random = np.random.default_rng(seed)
    along = np.cumsum(random.choice([0.015, 0.1, 0.5, 2.0, 4.0], 400))
    along = along[along < face.perimeter - 1]
    t = face.sample(0.01)
    places = np.interp(along, np.linspace(0, face.perimeter, len(t), endpoint=False), t)
    return face.evaluate(places) + random.normal(0, noise, (len(along), 2))


@pytest.mark.parametrize("name", ["TC", "HS"])
def test_a_scan_is_smoothed_within_the_tolerance(name: str, tmp_path: Path) -> None:
    """The curve is nearer to the face than the points are, and as large."""
    face = Socket.reference(name).inner_face(LIMB)
    points = scan(face, noise=0.05)
    np.savetxt(tmp_path / "scan.csv", points, delimiter=",")
    socket = Socket.from_outline(tmp_path / "scan.csv")
    found = socket.inner_face(LIMB)
    off = cKDTree(found.evaluate(found.sample(0.02))).query(points)[0].max()
    assert 0.05 < off <= socket.deviation + 0.01 <= 0.21
    assert deviation(found, face) < 0.1
    assert found.area == pytest.approx(face.area, rel=1e-3)
    assert list(socket.notices()) == [
        f"the outline was smoothed; the curve is up to {socket.deviation:.2f} mm from it"
    ]
    # Clockwise, and started elsewhere, it is the same curve.
    np.savetxt(tmp_path / "back.csv", np.roll(points[::-1], 50, axis=0), delimiter=",")
    back = Socket.from_outline(tmp_path / "back.csv").inner_face(LIMB)
    assert deviation(back, found) < 0.03


def test_more_noise_needs_more_tolerance(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "scan.csv", scan(FACE, noise=0.15), delimiter=",")
    with pytest.raises(InputError, match=r"no smooth curve stays within 0\.2 mm of it .*toler"):
        Socket.from_outline(tmp_path / "scan.csv")
    (tmp_path / "mine.toml").write_text('outline = "scan.csv"\ntolerance = "0.8 mm"\n')
    mine = Socket.read(tmp_path / "mine.toml")
    assert 0.2 < mine.deviation < 0.8
    assert deviation(mine.inner_face(LIMB), FACE) < 0.3
    (tmp_path / "mine.toml").write_text('outline = "scan.csv"\ntolerance = "3 mm"\n')
    with pytest.raises(InputError, match=r"outline: tolerance: is '3 mm'; it must be less than or"):
        Socket.read(tmp_path / "mine.toml")


def test_what_is_clean_is_not_smoothed(tmp_path: Path) -> None:
    csv(tmp_path / "a.csv")
    assert Socket.from_outline(tmp_path / "a.csv", tolerance=1.0).deviation == 0
    assert not list(Socket.from_outline(tmp_path / "a.csv").notices())


def two_faces(space: Any) -> None:
    space.add_lwpolyline(POINTS, close=True, dxfattribs={"layer": "inner", "handle": "2F"})
    space.add_lwpolyline(1.1 * POINTS, close=True, dxfattribs={"layer": "outer"})
    space.add_line((-90, 0), (90, 0), dxfattribs={"layer": "axis"})
    space.add_text("TSB", dxfattribs={"layer": "inner text"})


@pytest.mark.parametrize("choice", [{"layer": "inner"}, {"curve": "2F"}])
def test_a_curve_of_a_drawing_is_chosen(choice: dict[str, str], tmp_path: Path) -> None:
    dxf(two_faces)(tmp_path / "a.dxf")
    rings = "".join(
        f'<g id="{name}"><polygon id="{handle}" points="'
        + " ".join(f"{scale * x},{-scale * y}" for x, y in POINTS)
        + '"/></g>'
        for name, handle, scale in (("outer", "30", 1.1), ("inner", "2F", 1.0))
    )
    (tmp_path / "a.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="2mm" viewBox="0 0 2 2">{rings}'
        "<text>TSB</text></svg>"
    )
    (tmp_path / "a.toml").write_text(
        'outline = "a.dxf"\n' + "".join(f'{key} = "{name}"\n' for key, name in choice.items())
    )
    made = [Socket.from_outline(tmp_path / "a.dxf", **choice), Socket.read(tmp_path / "a.toml")]
    if "curve" in choice:  # the text has no layer
        made.append(Socket.from_outline(tmp_path / "a.svg", **choice))
    for socket in made:
        assert deviation(socket.inner_face(LIMB), FACE) < 0.02


def test_what_the_file_gives_cannot_be_given_beside_it(tmp_path: Path) -> None:
    csv(tmp_path / "a.csv")
    (tmp_path / "a.toml").write_text('outline = "a.csv"\ndeviation = "1 mm"\n')
    with pytest.raises(InputError, match=r"a\.toml: deviation: comes from the file a\.csv"):
        Socket.read(tmp_path / "a.toml")


def test_a_file_that_may_not_be_read_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not by taking the permission away, for tests may run as root."""
    csv(tmp_path / "a.csv")

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(InputError, match=r"a\.csv: cannot be read \(Permission denied\)"):
        read_outline(tmp_path / "a.csv")


def test_an_outline_is_meshed_with_its_wall(tmp_path: Path) -> None:
    """The wall of 3 mm has an area of 3 P + 9 pi."""
    np.savetxt(tmp_path / "a.csv", POINTS[::3], delimiter=",")
    (tmp_path / "custom.toml").write_text('outline = "a.csv"\nwall_thickness = "3 mm"\n')
    custom = Socket.read(tmp_path / "custom.toml")
    assert custom == Socket.from_outline(tmp_path / "a.csv", wall_thickness=3.0, name="custom")
    mesh = section.build(LIMB, custom, mesh_size("coarse"))
    assert jacobian_bounds(mesh.coordinates)[0].min() > 0
    assert area(mesh, "socket") == pytest.approx(3 * FACE.perimeter + 9 * np.pi, rel=1e-3)
