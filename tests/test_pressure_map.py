"""Contact of a limb's levels over angle and height: numbers, surface, picture, worst levels."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
import pyvista
import tiny_levels
from matplotlib.collections import QuadMesh
from matplotlib.patches import Rectangle

import calfsocket as cs
from calfsocket.io.errors import InputError
from calfsocket.meshes.levels import Place
from calfsocket.plotting import pressure_map as picture
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.pressure_map import PLANE_STRAIN, MapLevel, PressureMap, angles
from calfsocket.simulation.results import MAPS, WORST_FILE
from calfsocket.study.study import Study
from conftest import write_small_report

N = 400
POLAR = np.linspace(0, 2 * np.pi, N, endpoint=False)


def contact(share: float) -> ContactLine:
    """Contact whose pressure is known: a wave around the limb that grows with the height."""
    width = 2 * np.pi * 12 / N
    return ContactLine(
        arc_mm=width * np.arange(N),
        angle_deg=np.degrees(POLAR),
        x_mm=12 * np.cos(POLAR),
        y_mm=12 * np.sin(POLAR),
        pressure_kPa=100 * share * (1 + np.cos(POLAR)),
        shear_kPa=10 * np.sin(POLAR),
        gap_mm=np.zeros(N),
        weight_mm=np.full(N, width),
        status=np.full(N, "slip"),
    )


def made(missing: Mapping[float, str] = {}) -> PressureMap:
    """Return a map of the tiny limb."""
    levels = [
        MapLevel.of(
            Place(height=each.height, height_mm=each.height_mm),
            each.limb,
            None if each.height in missing else contact(each.height),
            missing.get(each.height, ""),
        )
        for each in tiny_levels.levels().levels
    ]
    return PressureMap("A", "combined", levels, tiny_levels.section(0.5).frame)


def test_a_map_has_the_pressure_of_each_level_at_its_angles() -> None:
    found = made()
    wave = 1 + np.cos(np.deg2rad(angles()))
    for row, share in zip(found.pressure_kPa, tiny_levels.SHARES, strict=True):
        # The running mean takes 0.3 % off the wave.
        np.testing.assert_allclose(row, 100 * share * wave, atol=0.004 * 100 * share)


def test_angles_of_a_left_limb_are_anatomical() -> None:
    limb = tiny_levels.section(0.5)
    left = limb.model_copy(update={"side": "left", "axes": {"+x": "medial", "+y": "anterior"}})
    place = Place(height=0.5, height_mm=20)
    one, other = MapLevel.of(place, limb, contact(0.5)), MapLevel.of(place, left, contact(0.5))
    # +x is medial: its largest pressure is at 180 degrees, and angles run the other way.
    mirrored = np.round((180 - angles()) % 360 / 2).astype(int)
    np.testing.assert_allclose(other.pressure_kPa, one.pressure_kPa[mirrored], atol=1e-9)
    np.testing.assert_allclose(other.shear_kPa, -one.shear_kPa[mirrored], atol=1e-9)
    np.testing.assert_allclose(other.points, one.points[mirrored], atol=0.02)


def test_the_surface_lies_where_the_sections_were_cut(tmp_path: Path) -> None:
    found = made()
    csv, vtp = found.write(tmp_path)
    surface = pyvista.read(vtp)
    n = len(angles())
    assert surface.n_points == 4 * n
    assert surface.n_cells == 3 * n
    points = surface.points.reshape(4, n, 3)
    for ring, share in zip(points, tiny_levels.SHARES, strict=True):
        np.testing.assert_allclose(ring[:, 0], 100 + tiny_levels.HEIGHT * share, atol=1e-4)
    # Anterior (+y of the section, 90 degrees) is +z of the source, lateral (+x) is its +y.
    size = 0.9 + 0.2 * 0.4
    np.testing.assert_allclose(points[1, 45], [116, 5, 12 * size], atol=0.02)
    np.testing.assert_allclose(points[1, 0], [116, 5 + 12.5 * size, 0], atol=0.02)
    np.testing.assert_allclose(
        surface.point_data["pressure_kPa"], found.pressure_kPa.ravel(), atol=1e-9
    )
    assert surface.cell_data["solved"].all()
    assert {"shear_kPa", "level", "height_mm", "angle_deg"} <= {*surface.point_data}
    table = pd.read_csv(csv)
    assert len(table) == 4 * n
    assert table.pressure_kPa.max() == pytest.approx(found.pressure_kPa.max(), rel=1e-6)


def test_meshio_reads_the_surface_that_paraview_saves_as_vtk(tmp_path: Path) -> None:
    made().surface().cast_to_unstructured_grid().save(tmp_path / "map.vtu")
    read = meshio.read(tmp_path / "map.vtu")
    assert read.cells_dict["quad"].shape == (3 * len(angles()), 4)


def test_a_level_without_result_is_missing_everywhere(tmp_path: Path) -> None:
    found = made({0.4: "stopped at load 0.5"})
    assert found.missing == {"0.400": "stopped at load 0.5"}
    assert np.isnan(found.pressure_kPa[1]).all()
    assert not np.isnan(np.delete(found.pressure_kPa, 1, axis=0)).any()
    table = found.table
    assert table[table.level == 0.4].pressure_kPa.isna().all()
    surface = found.surface()
    assert surface.cell_data["solved"].tolist() == [0] * 360 + [1] * 180
    assert np.isnan(surface.point_data["pressure_kPa"]).sum() == 180
    axes = picture.draw(found).axes[0]
    hatched = [each for each in axes.patches if isinstance(each, Rectangle) and each.get_hatch()]
    assert [(each.get_y(), each.get_y() + each.get_height()) for each in hatched] == [(8.0, 20.0)]
    meshes = [each for each in axes.collections if isinstance(each, QuadMesh)]
    coloured = [each.get_coordinates()[..., 1] for each in meshes]
    assert [(y.min(), y.max()) for y in coloured] == [(20.0, 32.0)]


def test_a_level_without_section_has_no_surface() -> None:
    found = made()
    gap = MapLevel.of(Place(height=0.3, height_mm=12), None, None, "open by 4 mm")
    levels = sorted([*found.levels, gap], key=lambda level: level.place.height)
    surface = replace(found, levels=levels).surface()
    assert surface.n_cells == 2 * len(angles())  # none from 0.2 to 0.4
    assert not np.isnan(surface.points).any()


def test_the_picture_says_what_it_shows(tmp_path: Path) -> None:
    figure = picture.draw(made())
    axes = figure.axes[0]
    words = [label.get_text() for label in axes.get_xticklabels()]
    assert words == [
        "posterior\n270°", "lateral\n0°", "anterior\n90°", "medial\n180°", "posterior\n270°",
    ]  # fmt: skip
    assert axes.get_ylabel() == "height above the distal end, mm"
    text = " ".join(each.get_text() for each in figure.texts)
    assert "interpolated" in text and "plane strain" in text
    assert axes.texts[-1].get_text() == "160 kPa"


def test_the_largest_pressure_has_the_mesh_error_of_its_level() -> None:
    found = made()
    figure = picture.draw(
        replace(found, levels=[replace(level, error_kPa=2.0) for level in found.levels])
    )
    assert figure.axes[0].texts[-1].get_text() == "160\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}2 kPa"
    assert any("±: mesh error" in each.get_text() for each in figure.texts)


# -- of a study ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> cs.Results:
    """Three levels of four, in two variants; the fourth was not asked for."""
    folder = tmp_path_factory.mktemp("maps")
    text = tiny_levels.STUDY + "[sweep.grid]\nmodel.friction = [0.2, 0.4]\n"
    study = Study.read(tiny_levels.write_study(folder, text))
    names = [case.name for case in study.cases if "0.500" not in case.name]
    return study.changed(chosen=names).run(out=folder / "results", pictures=False)


def test_a_study_writes_its_maps(results: cs.Results) -> None:
    folder = results.folder / MAPS
    assert sorted(path.name for path in folder.iterdir()) == [
        f"tight@friction={f}_combined.{end}" for f in ("0.2", "0.4") for end in ("csv", "vtp")
    ]
    found = results.pressure_map("tight@friction=0.4", "combined")
    assert found.missing == {"0.500": "not asked for"}
    largest = results.summary.query("quantity == 'contact_pressure_max'").value.max()
    assert np.nanmax(found.pressure_kPa) <= largest * (1 + 1e-6)
    limit = 0.4 * np.nan_to_num(found.pressure_kPa) + 1e-6
    assert (np.abs(np.nan_to_num(found.shear_kPa)) <= limit).all()


def test_the_worst_level_is_the_largest_of_the_summary(results: cs.Results) -> None:
    worst = pd.read_csv(results.folder / WORST_FILE)
    summary = results.summary
    row = worst.query("socket == 'tight@friction=0.4' and quantity == 'effective_stress'"
                      " and tissue == 'skin'").iloc[0]  # fmt: skip
    mine = summary[summary.socket.str.endswith("friction=0.4") & (summary.tissue == "skin")]
    mine = mine[mine.quantity == "effective_stress"]
    assert row.value == pytest.approx(mine.value.max())
    assert row.level == mine.level[mine.value.idxmax()]
    assert (row.levels_solved, row.levels) == (3, 3)
    assert set(worst.quantity) >= {"contact_pressure_max", "contact_pressure_mean"}
    assert "contact_share" not in set(worst.quantity)


def test_maps_that_cannot_be(results: cs.Results, six_results: cs.Results) -> None:
    with pytest.raises(InputError, match=r"did you mean 'tight@friction=0\.4_combined'"):
        results.pressure_map("tight@friction=0.5", "combined")
    with pytest.raises(InputError, match="the limb of this study has one level"):
        six_results.pressure_map("HS", "separate")


# -- its report ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def report(results: cs.Results) -> str:
    write_small_report(results.folder)
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    return " ".join(re.sub(r"<[^>]+>", " ", page).split())


def test_the_report_has_a_chapter_on_the_levels(report: str, results: cs.Results) -> None:
    assert PLANE_STRAIN in report
    assert "4 levels of a limb (an oval limb), each a section in plane strain" in report
    assert "The unloaded section at level 0.200 of a right limb" in report
    assert "Contact along the limb: tight@friction=0.2, combined" in report
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    for path in re.findall(r'href="(pressure_maps/[^"]+)"', page):
        assert (results.folder / path).is_file()
    assert (results.folder / "tables" / "worst_levels.csv").is_file()


def test_an_ordinary_report_has_none(six_runs: Path) -> None:
    page = (six_runs / "report.html").read_text(encoding="utf-8")
    assert "Along the limb" not in page
    assert not (six_runs / MAPS).exists()
