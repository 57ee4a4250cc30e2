"""The picture, from files; and no picture without harm where there is no screen."""

import logging
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest

from calfsocket import picture
from calfsocket.picture import (
    PressureBand,
    draw_in_subprocess,
    outward_normals,
    read_case,
    region_outlines,
)
from calfsocket.writers import merge_csv, write_fields
from sections import contact_around, limb_and_socket


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    results = tmp_path_factory.mktemp("results")
    write_fields(results / "TC_separate", limb_and_socket(), "TC", "separate")
    contact = contact_around()
    for material_set in ("separate", "combined"):
        merge_csv(
            results / "contact.csv",
            contact.rows("TC", material_set),
            ["socket", "material_set"],
            [("TC", "separate"), ("TC", "combined")],
        )
    return results / "TC_separate"


def share_of(image, colour) -> float:
    """Share of the pixels that have a colour, to one part in 100."""
    return np.all(np.abs(image[..., :3] - matplotlib.colors.to_rgb(colour)) < 0.01, axis=-1).mean()


@pytest.mark.skipif(not shutil.which("xvfb-run"), reason="no X server to start")
def test_picture_is_drawn(folder, monkeypatch):
    # neither the user's lost screen nor the study's MPI may reach the drawing
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    path = draw_in_subprocess(folder)
    assert path == folder / "picture.png"
    image = matplotlib.image.imread(path)
    assert min(image.shape[:2]) >= 2000
    assert image.std() > 0.1
    # areas from the radii, mm2, in a frame of 184 x 184 mm and 7/8 of the picture:
    # socket 48 to 52.5 mm: 4.2 %, bone 5 to 12 mm: 0.96 %, skin (above 10 kPa nearly everywhere)
    # 46 to 48 mm of 1.5 %; lines cover a part of each
    part = 7 / 8 / 184**2 * np.pi
    assert share_of(image, picture.SOCKET) == pytest.approx(part * (52.5**2 - 48**2), rel=0.08)
    assert share_of(image, picture.BONE) == pytest.approx(part * (12**2 - 5**2), rel=0.15)
    assert 0.5 < share_of(image, picture.ABOVE) / (part * (48**2 - 46**2)) < 1.1
    assert share_of(image, picture.PRESSURE) > 0.02


def test_no_screen_is_a_warning(folder, tmp_path, monkeypatch, caplog):
    copy = tmp_path / "results" / folder.name
    shutil.copytree(folder.parent, copy.parent)
    (copy / "picture.png").unlink(missing_ok=True)
    monkeypatch.setenv("DISPLAY", ":987")
    monkeypatch.setenv("PATH", str(tmp_path))  # no xvfb-run either
    with caplog.at_level(logging.WARNING):
        assert draw_in_subprocess(copy) is None
    (record,) = caplog.records
    message = record.getMessage()
    assert message.startswith(f"no picture of {copy}: ") and len(message.splitlines()) == 1
    assert "exit code" in message or "killed by SIG" in message
    assert sorted(os.listdir(copy)) == ["fields.vtu"]


def test_the_reason_is_said(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        assert draw_in_subprocess(tmp_path / "nowhere") is None
    assert "fields.vtu" in caplog.text and "exit code 1" in caplog.text


def fake_xvfb_run(folder, monkeypatch, body) -> None:
    script = folder / "xvfb-run"
    script.write_text(f"#!/bin/sh\n{body}\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


def test_drawing_too_long_is_stopped_with_its_children(folder, tmp_path, monkeypatch, caplog):
    fake_xvfb_run(tmp_path, monkeypatch, f"sleep 300 & echo $! > {tmp_path}/pid; wait")
    started = time.monotonic()
    with caplog.at_level(logging.WARNING):
        assert draw_in_subprocess(folder, timeout_s=2) is None
    assert "not done after 2 s" in caplog.text
    state = Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}/stat")
    while state.exists() and state.read_text().split()[2] != "Z":
        assert time.monotonic() - started < 60
        time.sleep(0.1)


def test_mpi_variables_do_not_reach_the_drawing(folder, tmp_path, monkeypatch):
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PRTE_LAUNCHED"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("KEPT", "1")
    fake_xvfb_run(tmp_path, monkeypatch, f"env > {tmp_path}/env")
    draw_in_subprocess(folder)
    given = (tmp_path / "env").read_text().splitlines()
    assert not [line for line in given if line.startswith(("OMPI_", "PMIX_", "PRTE_"))]
    assert "KEPT=1" in given


def test_drawing_does_not_need_the_solver():
    code = (
        "import sys, calfsocket.picture;"
        "print([m for m in ('mpi4py', 'petsc4py', 'dolfinx', 'gmsh') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_rows_of_another_case_are_not_drawn(folder):
    case = read_case(folder)
    assert (case.socket, case.material_set) == ("TC", "separate")
    assert len(case.skin) == 360  # contact.csv has as many rows of another set


def test_a_case_without_contact_rows_is_said(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "TC_separate")
    (tmp_path / "contact.csv").write_text("socket,material_set,x_mm,y_mm,pressure_kPa\n")
    with pytest.raises(ValueError, match="no row of socket TC, set separate"):
        read_case(tmp_path / "TC_separate")


def test_outlines_are_curved_and_lie_on_the_circles():
    fields = limb_and_socket(24)
    skin = fields.cells[fields.region == 5]
    lines = region_outlines(skin, fields.points)
    assert lines.shape == (48, 7, 2)  # 24 edges inside, 24 outside
    radius = np.linalg.norm(lines, axis=2)
    # straight edges of 7.5 deg would lie up to 0.41 mm inside; parabolas are within 3e-4 mm
    assert np.minimum(abs(radius - 46), abs(radius - 48)).max() < 1e-3


def test_band_stands_out_by_the_pressure():
    angle = np.radians(np.arange(360))
    circle = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    normal = outward_normals(circle)
    np.testing.assert_allclose(normal, circle / 50, atol=1e-12)
    band = PressureBand(circle, normal, np.zeros(360))
    # 20 kPa at 0.4 mm/kPa: 8 mm outside
    np.testing.assert_allclose(np.linalg.norm(band.at(20.0), axis=1), 58)
    assert band.at(20.0).shape == (361, 2)
