"""Sockets from their own scans: a skin moved inward comes back, wherever it was scanned."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from phantom import HEIGHT, Phantom
from socket_phantom import GAP, WALL, SocketPhantom, elsewhere

import calfsocket as cs
from calfsocket.imaging.registration import Motion

LEVELS = (0.2, 0.4, 0.6, 0.8)
PHANTOM = Phantom()


@pytest.fixture(scope="module")
def limbs(tmp_path_factory: pytest.TempPathFactory) -> list[cs.Limb]:
    files = PHANTOM.write(tmp_path_factory.mktemp("limb"), "skin", "tibia", "fibula")
    return [cs.Limb.from_surface(*files, level=level, tissues="lumped") for level in LEVELS]


def errors(made: cs.Sections, limbs: list[cs.Limb], socket: SocketPhantom) -> tuple[float, float]:
    """Largest distance of the outlines from the true ones, mm, and error of their areas."""
    away, area = [], []
    for limb in limbs:
        curve = made.inner_face(limb)
        found = shapely.Polygon(curve.evaluate(curve.sample(0.1)))
        true = socket.outline(limb)
        away.append(found.exterior.hausdorff_distance(true.exterior))
        area.append(found.area / true.area - 1)
    return max(away), max(map(abs, area))


def motion(made: cs.Sections) -> Motion:
    assert made.source is not None
    return Motion(np.array(made.source.rotation), np.array(made.source.shift))


def moved(made: cs.Sections, socket: SocketPhantom) -> float:
    """Largest distance, mm, of the limb's box from where the true motion brings it."""
    corners = np.array([[x, y, z] for x in (-60, 60) for y in (-60, 60) for z in (0, HEIGHT)])
    rotation = np.eye(3) if socket.rotation is None else socket.rotation
    back = motion(made)(corners @ rotation.T + np.array(socket.shift))
    return float(np.linalg.norm(back - corners, axis=1).max())


@pytest.mark.parametrize(
    ("noise", "place", "outline", "area"),
    [(0.0, 0.5, 0.2, 0.003), (0.1, 0.6, 0.5, 0.003), (0.5, 2.0, 1.0, 0.01)],
)
def test_a_socket_scanned_elsewhere_comes_back(
    tmp_path: Path, limbs: list[cs.Limb], noise: float, place: float, outline: float, area: float
) -> None:
    socket = elsewhere(SocketPhantom(PHANTOM, noise=noise))
    made = cs.Socket.from_scan(
        socket.write(tmp_path / "socket.stl"), limbs, tolerance=0.2 + 4 * noise
    )
    assert moved(made, socket) < place
    away, of_area = errors(made, limbs, socket)
    assert away < outline
    assert of_area < area
    assert made.source is not None
    assert abs(made.source.gap_mm - GAP) < 2 * made.source.gap_error_mm < 0.5


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_a_scan_in_the_limbs_axes_stays(tmp_path: Path, limbs: list[cs.Limb], noise: float) -> None:
    socket = SocketPhantom(PHANTOM, noise=noise)
    path = socket.write(tmp_path / "socket.ply")
    made = cs.Socket.from_scan(path, limbs, tolerance=0.2 + 4 * noise)
    assert moved(made, socket) == 0.0
    away, area = errors(made, limbs, socket)
    assert away < 0.2 + 2 * noise
    assert area < 0.001 + 0.004 * noise
    assert made.source is not None
    assert made.source.gap_mm == pytest.approx(GAP, abs=0.05)


def bumps(skin: np.ndarray) -> np.ndarray:
    """A gap that is wider by 4 mm in front, half way up, and narrower by 1.5 mm behind."""
    x, y, z = np.moveaxis(skin - skin.mean(axis=1, keepdims=True) * [1, 1, 0], -1, 0)
    angle = np.rad2deg(np.arctan2(y, x)) % 360
    high = np.exp(-(((z - 0.6 * HEIGHT) / 30) ** 2))
    front, behind = (np.exp(-(((angle - a) / w) ** 2)) for a, w in ((90, 25), (250, 40)))
    return GAP + high * (4 * front - 1.5 * behind)


@pytest.mark.parametrize("move", [False, True])
def test_where_a_socket_presses_does_not_move_it(
    tmp_path: Path, limbs: list[cs.Limb], move: bool
) -> None:
    socket = SocketPhantom(PHANTOM, gap=bumps, noise=0.1)
    socket = elsewhere(socket) if move else socket
    made = cs.Socket.from_scan(socket.write(tmp_path / "socket.stl"), limbs, tolerance=0.6)
    assert made.source is not None
    if not move:
        assert moved(made, socket) == 0.0
    away, area = errors(made, limbs, socket)
    assert away < 1.0
    assert area < (0.015 if move else 0.001)


def test_a_shell_has_an_inner_face_and_a_wall(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    socket = elsewhere(SocketPhantom(PHANTOM))
    socket.shell().save(tmp_path / "socket.stl")
    made = cs.Socket.from_scan(tmp_path / "socket.stl", limbs)
    away, area = errors(made, limbs, socket)
    assert away < 0.2
    assert area < 0.003
    for limb in limbs:
        assert made.thickness(limb) == pytest.approx(WALL, abs=0.05)


def test_two_faces_without_a_brim(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    inner, outer = (SocketPhantom(PHANTOM, gap=gap) for gap in (GAP, GAP - WALL))
    (inner.inner() + outer.inner()).extract_surface().save(tmp_path / "socket.stl")
    made = cs.Socket.from_scan(tmp_path / "socket.stl", limbs[1:2], register="none")
    assert errors(made, limbs[1:2], inner)[0] < 0.1
    assert made.thickness(limbs[1]) == pytest.approx(WALL, abs=0.05)


def test_aop(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    """It begins at its first level: the axis is the limb's, and the height is found."""
    socket = SocketPhantom(PHANTOM, noise=0.1)
    made = cs.Socket.from_scan(socket.write_aop(tmp_path / "socket.aop"), limbs, tolerance=0.6)
    away, area = errors(made, limbs, socket)
    assert away < 0.5
    assert area < 0.003


def test_a_place_that_is_said(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    """Turned back about the limb's axis, and shifted back."""
    centre = np.mean([limb.source.origin for limb in limbs[1:2]], axis=0)  # type: ignore[union-attr]
    there = Motion.about(np.array([0.0, 0.0, 1.0]), 30.0, centre, np.array([0.0, 0.0, 12.0]))
    socket = SocketPhantom(
        PHANTOM,
        rotation=there.rotation,
        shift=tuple(there.shift),  # type: ignore[arg-type]
    )
    path = socket.write(tmp_path / "socket.stl")
    made = cs.Socket.from_scan(
        path, limbs[1:2], register="none", rotate=-30, shift=(0, 0, -12), wall_thickness=3.0
    )
    assert errors(made, limbs[1:2], socket)[0] < 0.5
    assert made.thickness(limbs[1]) == 3.0


def test_levels_beyond_the_brim_are_left_out(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    socket = SocketPhantom(PHANTOM, shares=(0.1, 0.7))
    made = cs.Socket.from_scan(socket.write(tmp_path / "socket.stl"), limbs)
    assert made.source is not None
    assert [each.level for each in made.sections] == ["level 0.2", "level 0.4", "level 0.6"]
    (note,) = made.source.notes
    assert "level 0.8: lies outside the socket" in note
    with pytest.raises(cs.InputError, match=r"has no outline in the section at level 0\.8"):
        made.inner_face(limbs[-1])


def test_a_file_comes_back(tmp_path: Path, limbs: list[cs.Limb]) -> None:
    path = SocketPhantom(PHANTOM).write(tmp_path / "socket.stl")
    made = cs.Socket.from_scan(path, limbs[1:2], register="none", name="mine")
    made.write(tmp_path / "mine.json")
    assert cs.Socket.read(tmp_path / "mine.json") == made
