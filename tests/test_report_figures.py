"""The figures of any study: what is drawn against numbers known by hand, and their files."""

from dataclasses import replace

import matplotlib
import matplotlib.colors
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from PIL import Image

from calfsocket.plotting import section, style
from calfsocket.plotting.files import Drawing
from calfsocket.plotting.raster import FieldImage
from calfsocket.plotting.style import MOST_ABREAST, MOST_SHOWN, abreast, type_set
from calfsocket.report.figures import figures, geometry, maps, pressure, sweep
from calfsocket.report.findings import Findings
from report_results import ALL, contact_on, limb, results_of
from sections import annulus


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def test_files_are_at_300_dpi_and_180_mm_and_have_the_same_bytes_again(six_results, tmp_path):
    one = six_results.only(ALL[:1])
    backend = matplotlib.get_backend()
    for number in ("first", "second"):
        with type_set():
            Drawing.of(figures(Findings(one))["contact_pressure"]()).write(tmp_path, number)
    assert matplotlib.get_backend() == backend
    with Image.open(tmp_path / "first.png") as image:
        assert image.width == pytest.approx(180 / 25.4 * 300, abs=1)
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        assert np.asarray(image.convert("L")).std() > 10
    for extension in ("png", "pdf"):
        first, second = ((tmp_path / f"{n}.{extension}").read_bytes() for n in ("first", "second"))
        assert first == second
    assert first.startswith(b"%PDF") and first.count(b"/Subtype /Image") == 0  # all vectors


def test_a_case_that_is_not_in_the_study_leaves_its_panel_empty(six_results):
    keys = (("TC", "separate"), ("HS", "separate"), ("HS", "combined"))
    shown = texts(pressure.contact_pressure(Findings(six_results.only(keys))))
    assert shown.count("not in the study") == 1


@pytest.mark.parametrize(("width", "words"), [(400, "100 mm"), (120, "20 mm"), (30, "5 mm")])
def test_a_scale_bar_is_no_longer_than_a_quarter_of_the_drawing(width, words):
    axes = Figure().add_subplot()
    section.scale_bar(axes, (0, width, 0, width), fontsize=6)
    (bar,), (text,) = axes.lines, axes.texts
    assert text.get_text() == words == f"{np.ptp(bar.get_xdata()):g} mm"


def test_type_is_small_enough_for_its_room():
    assert style.fitting("a text\nwith lines", 100.0, 6.5) == 6.5
    # ten letters in 10 mm
    assert style.fitting("with lines", 10.0, 6.5) == pytest.approx(10 / 25.4 * 72 / 5.5)


FRICTION, WALL = "model.friction", "sockets.HS.wall_thickness [mm]"


def swept() -> pd.DataFrame:
    """A grid of three frictions and two walls in two sockets."""
    rows = [
        {
            **{"case": f"{name}_separate", "socket": name, "material_set": "separate"},
            **{FRICTION: friction, WALL: wall, "contact_pressure_mean_kPa": 10 * friction + wall},
            "contact_pressure_mean_kPa_mesh_error": 0.1 * wall,
            **{"skin_effective_stress_below_99.9_kPa": wall, "skin_effective_stress_kPa": 2.0},
        }
        for socket in ("HS", "TC")
        for friction in (0.4, 0.2, 0.6)
        for wall in (3.0, 5.5)
        for name in [f"{socket}@friction={friction},w={wall}"]
    ]
    return pd.DataFrame(rows).assign(status="solved")


def test_a_sweep_is_drawn_over_its_numbers_with_mesh_errors():
    data = swept()
    curves = sweep.curves_of(data, FRICTION, [WALL])
    wall = "sockets.HS.wall_thickness"
    assert list(curves) == [f"{s}, {wall} {w} mm" for s in ("HS", "TC") for w in ("3", "5.5")]
    assert all(rows[FRICTION].tolist() == [0.2, 0.4, 0.6] for rows in curves.values())
    together = data[data[WALL] == 3].assign(**{WALL: lambda rows: 10 * rows[FRICTION]})
    assert list(sweep.curves_of(together, FRICTION, [WALL])) == ["HS", "TC"]
    figure = sweep.draw(data, FRICTION, [WALL])
    titles = [axes.get_title() for axes in figure.axes]
    # and not the largest level of the paper's rule
    assert titles == ["mean contact pressure, kPa", "skin: effective stress, kPa"]
    (bars,) = figure.axes[0].containers[1].lines[2]
    ends = np.array([segment[:, 1] for segment in bars.get_segments()])
    np.testing.assert_allclose(np.diff(ends).ravel(), 2 * 0.55)


def test_every_region_of_the_limb_has_a_number_and_a_name(six_results):
    shown = texts(geometry.regions(Findings(six_results)))
    for name in ("soleus", "deep fascia", "fibular artery", "fibula", "tibia"):
        assert shown.count(name) == 1
    for number in map(str, range(1, 8)):
        assert shown.count(number) == 2  # in the section and in the key
    assert "8" not in shown and "socket" not in shown


def test_the_area_that_a_socket_takes():
    # a socket of 46.8 mm inside on a limb of 48 mm encloses 1 - (46.8/48)^2 = 4.94 % less
    fields = limb()
    shell, cells, _ = annulus([46.8, 51.3], 36)
    points = fields.points.copy()
    socket = np.unique(fields.cells[fields.region == 7])
    assert len(cells) == (fields.region == 7).sum()
    points[socket] = shell[np.unique(cells)]
    fields = replace(fields, points=points)
    results = results_of({("TC", "separate"): (fields, contact_on(limb(), 10.0))})
    assert "encloses 4.94 % less area" in texts(geometry.overlays(Findings(results)))


def test_contact_pressure_is_written_and_drawn_to_one_scale(six_results):
    figure = pressure.contact_pressure(Findings(six_results))
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
    np.testing.assert_allclose(
        height / height.max(), np.array([10, 5, 15, 15, 7.5, 22.5]) / 22.5, atol=0.08
    )


def test_maps_show_values_on_one_scale(six_results, monkeypatch):
    monkeypatch.setattr(style, "PNG_DPI", 60)
    assert (maps.EFFECTIVE_STRESS.low, maps.EFFECTIVE_STRESS.high) == (0, 10)
    assert (maps.SHEAR_STRAIN.low, maps.SHEAR_STRAIN.high) == (-50, 50)
    figure = maps.draw_map(Findings(six_results), maps.EFFECTIVE_STRESS)
    images = figure.findobj(FieldImage)
    assert len(images) == 6
    assert {image.scale.get_clim() for image in images} == {(0, 10)}
    # stress in proportion to 2 (TC), 1 (TSB), 3 (HS), times 1.5 in the second row
    means = [image.values.mean() for image in images]
    np.testing.assert_allclose(np.divide(means, means[1]), [2, 1, 3, 3, 1.5, 4.5], rtol=0.02)
    above = matplotlib.colors.to_rgb(maps.EFFECTIVE_STRESS.beyond)
    assert images[0].scale.cmap(11.0 / 0.1)[:3] == pytest.approx(above)


def test_sites_move_with_the_limb():
    fields = limb()
    moved = maps.deformed_site(fields, *fields.points[100])
    np.testing.assert_allclose(moved, (fields.points + fields.displacement)[100])


def test_many_sockets_are_drawn_in_rows_and_the_rest_is_said():
    sockets = [f"s{i:02d}" for i in range(14)]
    assert [len(row) for row in abreast(sockets)] == [MOST_ABREAST] * 3
    fields = limb()
    one = (fields, contact_on(fields, 5.0))
    many = Findings(results_of({(name, "soft"): one for name in sockets}))
    figure = pressure.contact_pressure(many)
    said = " ".join(text.get_text() for text in figure.texts)
    assert f"the first {MOST_SHOWN} of 14 sockets" in said
