"""Sides of a limb: on a left leg, or one that lies turned, labels and sockets are in place."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from geometry import (
    LIMB,
    MIRRORED,
    TURNED,
    TURNED_AND_MIRRORED,
    calf_content,
    moved_calf,
)
from mesh_measures import area

from calfsocket.meshes import section
from calfsocket.meshes.frame import QUARTERS, Frame
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket

MOVED = {"left": MIRRORED, "turned": TURNED, "left and turned": TURNED_AND_MIRRORED}
SITES = {
    "lateral": (50, 0), "anterolateral": (30, 35), "anterior": (1, 50), "anteromedial": (-30, 30),
    "medial": (-50, 3), "posteromedial": (-30, -30), "posterior": (0, -9),
    "posterolateral": (20, -20),
}  # fmt: skip


def of_file(content: dict, folder: Path) -> Limb:
    path = folder / "limb.json"
    path.write_text(json.dumps(content))
    return Limb.read(path)


@pytest.mark.parametrize("name", MOVED)
def test_sides_are_where_the_axes_say(name: str) -> None:
    matrix, axes = MOVED[name]
    frame = Frame(*axes)
    for site, point in SITES.items():
        assert LIMB.frame.direction(*point) == site
        assert frame.direction(*(matrix @ point)) == site
        assert frame.angle(matrix @ point) == pytest.approx(LIMB.frame.angle(np.array(point)))


def test_words_go_around_with_the_axes() -> None:
    assert LIMB.frame.words == QUARTERS
    assert Frame(*MIRRORED[1]).words == ("medial", "anterior", "lateral", "posterior")
    for x, y in product(QUARTERS, QUARTERS):
        if (QUARTERS.index(x) - QUARTERS.index(y)) % 2:
            frame = Frame(x, y)
            ends = frame.words
            assert ends[:2] == (x, y)
            for word, point in zip(ends, ((1, 0), (0, 1), (-1, 0), (0, -1)), strict=True):
                assert frame.direction(*point) == word
            assert frame.view("left") != frame.view("right")


def test_what_is_not_known_is_called_by_the_axes() -> None:
    frame = Frame()
    assert [frame.direction(*point) for point in ((9, 0), (9, 8), (0, 5), (-5, -6))] == [
        "+x side",
        "+x +y side",
        "+y side",
        "-x -y side",
    ]
    assert frame.words == ("+x", "+y", "-x", "-y")
    assert frame.anatomical(30.0) == 30.0


@pytest.mark.parametrize("name", MOVED)
def test_sockets_follow_the_limb(name: str, tmp_path: Path) -> None:
    """TC has reliefs over crest and fibula, HS is a blend: both with bumps of the angle."""
    matrix, axes = MOVED[name]
    limb = of_file(moved_calf(matrix, axes), tmp_path)
    for socket in (Socket.reference("TC"), Socket.reference("HS")):
        here, there = check_placement(socket, limb), check_placement(socket, LIMB)
        for key, value in vars(there).items():
            assert getattr(here, key) == pytest.approx(value, abs=1e-3, rel=1e-3), key
        face, reference = socket.inner_face(limb), socket.inner_face(LIMB)
        assert face.area == pytest.approx(reference.area, rel=1e-6)
        t = np.linspace(0, reference.period, 97)
        moved = reference.evaluate(t) @ matrix.T
        same_way = np.linalg.det(matrix) > 0
        found = face.evaluate(t if same_way else face.period - t)
        assert found == pytest.approx(moved, abs=1.5e-3)  # splines of 0.0005 mm and other knots


def test_a_left_leg_is_meshed_with_the_same_areas(tmp_path: Path) -> None:
    left = of_file(moved_calf(*MIRRORED), tmp_path)
    mesh = section.build(left, Socket.reference("TC"), mesh_size("coarse"))
    for name, expected in LIMB.areas.items():
        assert left.areas[name] == pytest.approx(expected, rel=1e-4)
        assert area(mesh, name) == pytest.approx(expected, rel=5e-3)
    fibula = limb_curves(left)["fibula"].evaluate(0.0)
    assert left.frame.direction(*fibula) == "lateral"
    assert left.side == "left"


@pytest.mark.parametrize(
    ("text", "side", "seen_from"),
    [
        ("right leg seen from above (proximal)", "right", "above"),
        ("Right, distal view", "right", "below"),
        ("L", "left", None),
        ("right", "right", None),
        ("unknown", None, None),
        ("", None, None),
    ],
)
def test_a_side_may_be_written_as_in_earlier_files(
    text: str, side: str | None, seen_from: str | None
) -> None:
    content = calf_content() | {"side": text}
    del content["seen_from"], content["axes"]
    limb = Limb(**content)
    assert (limb.side, limb.seen_from) == (side, seen_from)


def test_a_minimal_limb_needs_no_more_than_curves_and_regions(tmp_path: Path) -> None:
    content = {
        "units": "mm, deg",
        "fixed_boundary": "canal",
        "contact_boundary": "skin",
        "curves": {
            name: {"type": "ellipse", "center": [0, 0], "semi_axes": [r, r], "angle_deg": 0}
            for name, r in (("skin", 50.0), ("bone", 15.0), ("canal", 6.0))
        },
        "regions": [
            {"name": "soft", "tissue": "muscle", "outer": "skin", "holes": ["bone"]},
            {"name": "bone", "tissue": "bone", "outer": "bone", "holes": ["canal"]},
        ],
    }
    limb = of_file(content, tmp_path)
    assert limb.region_tags == {"soft": 1, "bone": 2}
    assert limb.areas["soft"] == pytest.approx(np.pi * (50**2 - 15**2), rel=1e-4)
    (notice,) = limb.notices()
    assert "no axes are given, so sides are called +x and +y" in notice


@pytest.mark.parametrize("name", MOVED)
def test_axes_that_are_proposed_are_accepted(name: str, tmp_path: Path) -> None:
    content = moved_calf(*MOVED[name]) | {"axes": {}}
    (notice,) = (each for each in of_file(content, tmp_path).notices() if "no axes" in each)
    proposed = json.loads(f"{{{notice.partition('e.g. ')[2]}}}")
    assert of_file(content | proposed, tmp_path).frame.known


def test_what_is_not_used_of_a_limb_is_named() -> None:
    content = calf_content() | {"fat_law": "linear", "topology": "nested"}
    content["axes"]["origin"] = "centroid"
    content["regions"][0] |= {"latin": "cutis", "target_area": 567, "adjacent": ["fat"]}
    content["curves"]["spare"] = content["curves"]["fibular_vein"]
    limb = Limb(**content)
    assert list(limb.notices()) == [
        "nothing is computed from regions.latin, regions.target_area, regions.adjacent, fat_law,"
        " topology, axes.origin",
        "curves that bound no region: spare",
    ]
    assert Limb(**limb.model_dump()) == limb
    assert not list(LIMB.notices())


def test_a_limb_without_axes_is_told_where_its_fibula_shows_that_bumps_go_astray() -> None:
    content = moved_calf(*MIRRORED)
    del content["axes"]
    (notice,) = Limb(**content).notices()
    assert (
        "from +x counter-clockwise, which by the fibula is not lateral by anterior; add" in notice
    )
    content = calf_content()
    del content["axes"]
    (notice,) = Limb(**content).notices()
    assert "from +x counter-clockwise; add" in notice


def test_a_limb_seen_from_below_is_told() -> None:
    content = calf_content() | {"side": "left"}
    del content["seen_from"]
    assert list(Limb(**content).notices()) == ["with these axes it is a left limb seen from below"]
