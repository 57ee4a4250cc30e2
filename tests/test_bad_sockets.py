"""Scans of sockets that cannot be used: one line each, nothing written."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista
from phantom import Phantom
from socket_phantom import SocketPhantom
from test_bad_input import check_trial, refused, shortened

import calfsocket as cs
from reliability import Trial

TITLE = "Scans of sockets"
INTRO = "What `socket` says of a scan that it cannot use, and a study of its file."

PHANTOM = Phantom()
Make = Callable[[Path], Sequence[str]]


@cache
def limb_text(level: float) -> str:
    """The file of a section of the phantom."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        files = PHANTOM.write(Path(folder), "skin", "tibia", "fibula")
        limb = cs.Limb.from_surface(*files, level=level, tissues="lumped")
        limb.write(Path(folder) / "limb.json")
        return (Path(folder) / "limb.json").read_text()


@cache
def inner() -> pyvista.PolyData:
    return SocketPhantom(PHANTOM).inner()


def words(folder: Path, surface: pyvista.PolyData, *more: str) -> list[str]:
    """Write a scan and a limb; return words of a command."""
    surface.save(folder / "scan.ply")
    (folder / "limb.json").write_text(limb_text(0.5))
    return [str(folder / "scan.ply"), "--limb", str(folder / "limb.json"), *more]


def scan(*more: str, change: Callable[[pyvista.PolyData], pyvista.PolyData] | None = None) -> Make:
    def make(folder: Path) -> list[str]:
        return words(folder, change(inner()) if change else inner(), *more)

    return make


def clipped(low: float, high: float) -> Callable[[pyvista.PolyData], pyvista.PolyData]:
    def clip(surface: pyvista.PolyData) -> pyvista.PolyData:
        box = (-200, 200, -200, 200, low, high)
        return surface.clip_box(box, invert=False).extract_surface().triangulate()

    return clip


def with_a_hole(surface: pyvista.PolyData) -> pyvista.PolyData:
    far = np.linalg.norm(surface.cell_centers().points - [55, 0, 100], axis=1) > 20
    return surface.extract_cells(np.flatnonzero(far)).extract_surface()


def solid(surface: pyvista.PolyData) -> pyvista.PolyData:
    """A shell whose inside begins above the level: a cup with a thick floor."""
    cup = pyvista.CylinderStructured(
        radius=np.array([45.0, 55.0]), height=60, center=(0, 0, 150), direction=(0, 0, 1),
        theta_resolution=120, z_resolution=30,
    )  # fmt: skip
    floor = pyvista.Cylinder(
        radius=55, height=60, center=(0, 0, 90), direction=(0, 0, 1), resolution=120
    )
    return pyvista.merge([cup.extract_surface(), floor]).extract_surface().triangulate()


def drawn_limb(folder: Path) -> list[str]:
    """A limb that was drawn."""
    given = words(folder, inner())
    content = json.loads(limb_text(0.5))
    del content["source"]
    (folder / "limb.json").write_text(json.dumps(content))
    return given


def round_tube(surface: pyvista.PolyData) -> pyvista.PolyData:
    return pyvista.Cylinder(
        radius=50,
        height=180,
        center=(300, 0, 0),
        direction=(1, 1, 1),
        resolution=200,
        capping=False,
    ).triangulate()


def waved(surface: pyvista.PolyData) -> pyvista.PolyData:
    """The socket of a limb with five edges."""
    points = surface.points.copy()
    points[:, :2] *= 1 + 0.2 * np.cos(5 * np.arctan2(points[:, 1], points[:, 0]))[:, None]
    return pyvista.PolyData(points, faces=surface.faces)


def two(surface: pyvista.PolyData) -> pyvista.PolyData:
    return pyvista.merge([surface, surface.translate((200, 0, 0), inplace=False)]).extract_surface()


TRIALS = (
    Trial("no such scan", lambda folder: [*words(folder, inner())[1:], str(folder / "none.stl")],
          ("none.stl: cannot be read",)),
    Trial("no limb", lambda folder: words(folder, inner())[:1], ("--limb",)),
    Trial("a limb that is a scan",
          lambda folder: [*words(folder, inner())[:2], str(folder / "scan.ply")],
          ("a limb is a JSON file",)),
    Trial("a limb that was drawn", drawn_limb, ("was drawn",)),
    Trial("a scan in metres", scan(change=lambda s: s.scale(1e-3, inplace=False)),
          ("may be in m: add --units m", "no socket")),
    Trial("two sockets", scan(change=two), ("has 2 surfaces", "give one socket")),
    Trial("another limb's socket", scan(change=waved),
          ("does not lie along the limb",)),
    Trial("a round socket", scan(change=round_tube), ("fits the skin as well when it is turned",)),
    Trial("a socket that ends below the level", scan("--register", "none", change=clipped(0, 80)),
          ("level 0.5: lies outside the socket",)),
    Trial("a hole at the level", scan(change=with_a_hole), ("level 0.5: the socket is open by",)),
    Trial("a solid floor at the level", scan("--register", "none", change=solid),
          ("the socket is solid there",)),
    Trial("a turn for a place that is found", scan("--rotate", "30"), ("register none with them",)),
    Trial("a shift of two numbers", scan("--register", "none", "--shift", "0,5"),
          ("three numbers",)),
    Trial("a wall of -2 mm", scan("--wall-thickness", "-2"),
          ("--wall-thickness: is -2 mm; it must be more than 0",)),
    Trial("a tolerance of the curves of 0", scan("--tolerance", "0"), ("more than 0",)),
    Trial("the result not as JSON, of a socket", scan("--out", "socket.stl"), ("ends in .json",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return what a trial gives, without the folder's path."""
    return shortened(refused(["socket", *trial.given(folder)]), folder)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_a_bad_scan_gets_one_line(
    trial: Trial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_trial(trial, said, tmp_path, monkeypatch, longest=400)
