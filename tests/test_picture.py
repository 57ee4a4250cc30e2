"""The picture of a case and what drawings of the section share, from files and without a screen."""

import subprocess
import sys

import matplotlib.colors
import matplotlib.image
import numpy as np
import pytest
from matplotlib.path import Path as Curve

from calfsocket.plotting import case as picture
from calfsocket.plotting import pressure_band
from calfsocket.plotting import section as drawing
from calfsocket.plotting.pressure_band import PressureBand, outward_normals
from calfsocket.plotting.raster import Raster
from report_results import result
from sections import contact_around, limb_and_socket


def share_of(image, colour) -> float:
    """Share of the pixels that have a colour, to one part in 100."""
    return np.all(np.abs(image[..., :3] - matplotlib.colors.to_rgb(colour)) < 0.01, axis=-1).mean()


def test_picture_is_drawn(tmp_path, monkeypatch):
    monkeypatch.setenv("DISPLAY", ":987")  # a screen that is not there
    assert picture.PIXELS >= 2000
    monkeypatch.setattr(picture, "PIXELS", 1000)
    solved = result(("TC", "separate"), limb_and_socket(), contact_around())
    path = solved.draw(tmp_path)
    assert path == tmp_path / "picture.png"
    image = matplotlib.image.imread(path)
    assert image.shape[1] == 1000
    assert image.std() > 0.1
    # areas from the radii, mm2, in a frame of 1.55 times 96 mm and 7/8 of the picture:
    # socket 48 to 52.5 mm: 5.6 %, bone 5 to 12 mm: 1.5 %, skin (above 10 kPa nearly everywhere)
    # 46 to 48 mm of 2.3 %; lines cover a part of each
    part = 7 / 8 / (picture.FRAME * 96) ** 2 * np.pi
    assert share_of(image, drawing.SOCKET) == pytest.approx(part * (52.5**2 - 48**2), rel=0.08)
    assert share_of(image, drawing.BONE) == pytest.approx(part * (12**2 - 5**2), rel=0.15)
    assert 0.5 < share_of(image, drawing.ABOVE) / (part * (48**2 - 46**2)) < 1.1
    assert share_of(image, pressure_band.FILL) > 0.02


def test_drawing_does_not_need_the_solver():
    code = (
        "import sys, calfsocket; before = set(sys.modules);"  # mpi4py, where pip installed it
        "import calfsocket.plotting.case, calfsocket.simulation.results;"
        "loaded = ('mpi4py', 'petsc4py', 'dolfinx', 'gmsh');"
        "print([m for m in loaded if m in sys.modules.keys() - before])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_boundary_is_curved_and_closed_and_holes_turn_the_other_way():
    fields = limb_and_socket(24)
    path = drawing.boundary(fields.cells[fields.region == 5], fields.points)
    assert np.count_nonzero(path.codes == Curve.MOVETO) == 2
    rings = path.to_polygons(closed_only=True)
    radius = np.concatenate([np.linalg.norm(ring, axis=1) for ring in rings])
    # straight edges of 7.5 deg would lie up to 0.41 mm inside; parabolas are within 3e-4 mm
    assert np.minimum(abs(radius - 46), abs(radius - 48)).max() < 1e-3
    x, y = zip(*(ring.T for ring in rings), strict=True)
    areas = sorted(0.5 * np.sum(a[:-1] * b[1:] - a[1:] * b[:-1]) for a, b in zip(x, y, strict=True))
    # circles of 46 mm and 48 mm (as polygons of 96 sides: 0.2 % less), one of them a hole;
    # which, depends on how the cells turn
    np.testing.assert_allclose(np.sort(np.abs(areas)), [np.pi * 46**2, np.pi * 48**2], rtol=3e-3)
    assert areas[0] < 0 < areas[1]


def test_a_field_is_sampled_where_it_is_and_only_in_its_cells():
    fields = limb_and_socket(24)
    still = np.zeros_like(fields.displacement)
    fields = type(fields)(**{**vars(fields), "displacement": still})
    muscle = fields.cells_of("muscle")
    x, y = np.moveaxis(fields.points[fields.cells], -1, 0)
    window = (-48.0, 48.0, -48.0, 48.0)
    raster = Raster.of(fields.deformed[fields.cells[muscle]], window, 240)
    image = np.ma.masked_all(raster.shape)
    image.ravel()[raster.pixels] = raster.sampled((2 * x - 3 * y)[muscle])
    centre = (np.arange(240) + 0.5) * 0.4 - 48
    x, y = np.meshgrid(centre, centre)
    radius = np.hypot(x, y)
    assert image.mask[(radius < 11.9) | (radius > 40.1)].all()
    ring = (radius > 12.2) & (radius < 39.8) & (np.hypot(x - 25, y) > 9)
    assert not image.mask[ring].any()
    # linear in x and y: to 0.1 mm, since the place in a curved cell is found by straight pieces
    np.testing.assert_allclose(image[ring], (2 * x - 3 * y)[ring], atol=0.1 * np.hypot(2, 3))


def test_band_stands_out_by_the_pressure():
    angle = np.radians(np.arange(360))
    circle = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    normal = outward_normals(circle)
    np.testing.assert_allclose(normal, circle / 50, atol=1e-12)
    band = PressureBand(circle, normal, np.zeros(360), mm_per_kPa=0.4)
    # 20 kPa at 0.4 mm/kPa: 8 mm outside
    np.testing.assert_allclose(np.linalg.norm(band.at(20.0), axis=1), 58)
    assert band.at(20.0).shape == (361, 2)
