"""The report's figures: files, what is drawn against numbers known by hand, and partial studies."""

from dataclasses import replace
from pathlib import Path

import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from calfsocket.report import comparison
from calfsocket.report.drawn import Drawn
from calfsocket.report.figures import PLANS, changes, geometry, maps, pressure
from calfsocket.report.figures.style import save, type_set
from calfsocket.report.results import Results, read_results
from report_results import contact_on, limb, limb_study, write_results
from sections import annulus

VECTOR = ("1", "2", "5", "5b", "6", "8", "9")


@pytest.fixture(scope="module")
def results(six_runs) -> Results:
    return read_results(six_runs)


@pytest.fixture(scope="module")
def drawn(six_runs) -> dict[str, Drawn]:
    """Figures of the six runs, which their report has drawn."""
    folder = six_runs / "figures"
    assert len(list(folder.iterdir())) == 2 * len(PLANS)
    return {
        plan.number: Drawn(plan, folder / f"{plan.name}.png", folder / f"{plan.name}.pdf")
        for plan in PLANS
    }


@pytest.fixture(scope="module")
def pulled(tmp_path_factory) -> Results:
    """TC with negative shear stress, whose magnitude the Combined set raises by half."""
    cases = {}
    for name, factor in (("separate", -1.0), ("combined", -1.5)):
        fields = limb(factor)
        cases["TC", name] = (fields, contact_on(fields, -10 * factor))
    return read_results(write_results(tmp_path_factory.mktemp("pulled"), cases))


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_every_figure_is_there_at_300_dpi_and_180_mm(drawn):
    for figure in drawn.values():
        with Image.open(figure.png) as image:
            assert image.width == pytest.approx(180 / 25.4 * 300, abs=1)
            assert image.info["dpi"] == pytest.approx((300, 300), abs=0.1)
            assert np.asarray(image.convert("L")).std() > 10
        assert figure.pdf.read_bytes().startswith(b"%PDF")


def test_plots_are_vectors_and_maps_have_one_image_a_case(drawn):
    for number, figure in drawn.items():
        images = figure.pdf.read_bytes().count(b"/Subtype /Image")
        # six images, each with its mask, and the scale of colours
        assert images == (0 if number in VECTOR else 13), number


@pytest.mark.parametrize("number", ["1", "4", "5"])
def test_files_have_the_same_bytes_again(results, drawn, number, tmp_path):
    plan = drawn[number].heading
    with type_set():
        png, pdf = save(plan.draw(results), tmp_path, plan.name)
    assert png.read_bytes() == drawn[number].png.read_bytes()
    assert pdf.read_bytes() == drawn[number].pdf.read_bytes()


def test_one_run_has_the_figures_that_compare_nothing(one_run):
    names = {path.stem for path in (one_run / "figures").iterdir()}
    assert names == {plan.name for plan in PLANS if plan.number in ("1", "2", "4", "7", "9")}


def test_an_unsolved_case_leaves_its_panel_empty(tmp_path):
    keys = (("TC", "separate"), ("HS", "separate"), ("HS", "combined"))
    results = read_results(write_results(tmp_path, limb_study(keys)))
    assert texts(pressure.contact_pressure(results)).count("not solved") == 1


def test_every_region_of_the_limb_has_a_number_and_a_name(results):
    shown = texts(geometry.regions(results))
    for name in ("soleus", "deep fascia", "fibular artery", "fibula", "tibia"):
        assert shown.count(name) == 1
    for number in map(str, range(1, 8)):
        assert shown.count(number) == 2  # in the section and in the key
    assert "8" not in shown and "socket" not in shown


def test_the_area_that_a_socket_takes(tmp_path):
    # a socket of 46.8 mm inside on a limb of 48 mm encloses 1 - (46.8/48)^2 = 4.94 % less
    fields = limb()
    shell, cells, _ = annulus([46.8, 51.3], 36)
    points = fields.points.copy()
    socket = np.unique(fields.cells[fields.region == 7])
    assert len(cells) == (fields.region == 7).sum()
    points[socket] = shell[np.unique(cells)]
    fields = replace(fields, points=points)
    write_results(tmp_path, {("TC", "separate"): (fields, contact_on(limb(), 10.0))})
    assert "encloses 4.94 % less area" in texts(geometry.overlays(read_results(tmp_path)))


def test_contact_pressure_is_written_and_drawn_to_one_scale(results):
    figure = pressure.contact_pressure(results)
    shown = texts(figure)
    # 5 kPa times 2 (TC), 1 (TSB), 3 (HS), half as much again with Combined
    for value in ("5.0", "7.5", "10.0", "15.0", "22.5"):
        assert any(text.startswith(f"largest {value} kPa\nmean {value} kPa") for text in shown)
    panels = [axes for axes in figure.axes if axes.patches and axes.lines]
    outer = [
        max(np.linalg.norm(line.get_xydata(), axis=1).max() for line in axes.lines[:1])
        for axes in panels
    ]
    skin = [np.linalg.norm(axes.lines[1].get_xydata(), axis=1).mean() for axes in panels]
    height = np.subtract(outer, skin)
    # TC, TSB, HS Separate, then Combined: heights in proportion to 10, 5, 15, 15, 7.5, 22.5 kPa
    np.testing.assert_allclose(height / height.max(), np.array([10, 5, 15, 15, 7.5, 22.5]) / 22.5,
                               atol=0.08)  # fmt: skip


def bars_and_marks(figure: Figure) -> tuple[list[float], list[float]]:
    bars = [bar.get_height() for axes in figure.axes for c in axes.containers for bar in c]
    marks = [
        line.get_ydata()[0]
        for axes in figure.axes
        for line in axes.lines
        if line.get_marker() == "D"
    ]
    return bars, marks


def test_bars_are_ours_and_marks_are_the_papers(results):
    table = comparison.changes(results)
    maxima = table[table.site == "max_both"]
    bars, marks = bars_and_marks(changes.of_maxima(results))
    assert sorted(bars) == pytest.approx(sorted(maxima.ours))
    assert sorted(marks) == pytest.approx(sorted(maxima.paper))
    assert max(marks) == 459  # the paper's largest: muscle, effective stress, TC
    assert min(marks) == -599
    sites = table[(table.site != "max_both") & table.outcome.isin(changes.STRAINS)]
    bars, marks = bars_and_marks(changes.of_strain_at_sites(results))
    assert sorted(bars) == pytest.approx(sorted([*sites.ours, *sites.ours]))  # in two ranges
    assert min(marks) == -15900


def test_equation_3_and_the_change_of_magnitude_are_not_mixed_up(pulled):
    equation_3, _ = bars_and_marks(changes.of_maxima(pulled))
    magnitude, _ = bars_and_marks(changes.of_magnitudes(pulled))
    # shear stress from -s to -1.5 s: equation (3) -50 %, magnitude +50 %
    assert np.count_nonzero(np.isclose(equation_3, -50)) == 5
    assert np.count_nonzero(np.isclose(magnitude, -50)) == 0
    assert np.count_nonzero(np.isclose(magnitude, 50)) == 10  # effective stress, too


def test_maps_show_values_on_the_papers_scales(results, drawn):
    assert (maps.EFFECTIVE_STRESS.low, maps.EFFECTIVE_STRESS.high) == (0, 10)
    assert (maps.SHEAR_STRAIN.low, maps.SHEAR_STRAIN.high) == (-50, 50)
    figure = maps.draw_map(results, maps.EFFECTIVE_STRESS)
    images = [image for axes in figure.axes for image in axes.get_images()]
    assert len(images) == 6
    assert {(image.norm.vmin, image.norm.vmax) for image in images} == {(0, 10)}
    # stress in proportion to 2 (TC), 1 (TSB), 3 (HS), times 1.5 in the second row
    means = [image.get_array().mean() for image in images]
    np.testing.assert_allclose(np.divide(means, means[1]), [2, 1, 3, 3, 1.5, 4.5], rtol=0.02)
    above = matplotlib.colors.to_rgb(maps.EFFECTIVE_STRESS.beyond)
    picture = matplotlib.image.imread(drawn["4"].png)[..., :3]
    assert np.all(np.abs(picture - above) < 0.02, axis=-1).mean() > 0.005


def test_sites_move_with_the_limb():
    fields = limb()
    moved = maps.deformed_site(fields, *fields.points[100])
    np.testing.assert_allclose(moved, (fields.points + fields.displacement)[100])


def test_figures_know_no_solver():
    source = Path(maps.__file__).parent
    text = "".join(path.read_text() for path in source.glob("*.py"))
    assert "dolfinx" not in text and "petsc4py" not in text
