"""How sockets sit on the calf, and the sockets that cannot be donned."""

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from geometry import LIMB, LOOPS, SKIN
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.socket import Bump, CircleBlend, NormalOffset, Outline, Socket


def offset(base: float, *bumps: Bump) -> NormalOffset:
    return NormalOffset(base=base, bumps=bumps)


def outline(points: Any, **placed: Any) -> Outline:
    return Outline(points=tuple(map(tuple, points)), **placed)


def ring(radius: float, waves: float = 0.0) -> np.ndarray:
    """Points of a circle, wavy nine times by so many mm."""
    t = np.deg2rad(np.arange(0, 360, 4))
    r = radius + waves * np.cos(9 * t)
    return np.round(np.column_stack([r * np.cos(t), r * np.sin(t)]), 6)


def test_checks_load_neither_the_mesher_nor_the_solver() -> None:
    """So that a study is checked in a moment."""
    code = """
import sys
import calfsocket
before = set(sys.modules)  # mpi4py, where pip installed it
from calfsocket.meshes import outline, placement
print(sorted({"gmsh", "dolfinx", "petsc4py", "mpi4py"} & (set(sys.modules) - before)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


#: Reduction of area and perimeter in %, overlap min, mean and max in mm (geometry's note).
NOTE = {
    "TC": (3.15, 1.51, 0.16, 0.90, 2.00),
    "TSB": (1.64, 0.81, 0.36, 0.47, 0.48),
    "HS": (5.00, 2.60, 0.88, 1.44, 1.78),
}


@pytest.mark.parametrize("name", NOTE)
def test_the_reference_sockets_sit_as_the_note_says(name: str) -> None:
    found = check_placement(Socket.reference(name), LIMB)
    area, perimeter, least, mean, most = NOTE[name]
    assert 100 * found.area_reduction == pytest.approx(area, abs=0.005)
    assert 100 * found.perimeter_reduction == pytest.approx(perimeter, abs=0.006)
    assert found.touching == 1
    assert [found.smallest_overlap, found.mean_overlap, found.largest_overlap] == pytest.approx(
        [least, mean, most], abs=0.011
    )


def test_a_constant_offset_is_its_overlap_and_takes_the_strip_off_the_area() -> None:
    """Of an inward offset d: overlap d, area loss d P - pi d^2, perimeter loss 2 pi d."""
    found = check_placement(offset(0.7), LIMB)
    assert [found.smallest_overlap, found.largest_overlap] == pytest.approx([0.7, 0.7], abs=1e-3)
    strip = 0.7 * SKIN.perimeter - np.pi * 0.7**2
    assert found.area_reduction == pytest.approx(strip / SKIN.area, abs=1e-5)
    assert found.perimeter_reduction == pytest.approx(2 * np.pi * 0.7 / SKIN.perimeter, abs=1e-5)


def test_a_gap_counts_as_negative_overlap_and_is_found_where_it_is() -> None:
    relief = Bump(center=200.0, width=20.0, amplitude=-2.0)
    found = check_placement(offset(0.5, relief), LIMB)
    assert found.smallest_overlap == pytest.approx(-1.5, abs=0.01)
    assert found.smallest_angle == pytest.approx(200.0, abs=1.0)
    # 0.5 - 2 exp(-x^2/2) < 0 for x < 1.67: 33 degrees on either side.
    angle = np.rad2deg(np.arctan2(*SKIN.evaluate(SKIN.sample(0.25)).T[::-1])) % 360
    assert found.touching == pytest.approx(np.mean(np.abs(angle - 200) > 33.3), abs=0.002)


def test_what_is_squeezed_is_the_overlap_over_the_tissue_above_bone() -> None:
    """A bump over the tibial crest, where the least tissue lies over bone."""
    found = check_placement(offset(0.3, Bump(center=101, width=8, amplitude=2.5)), LIMB)
    tibia = LOOPS["tibia"]
    depth = cKDTree(tibia.evaluate(tibia.sample(0.02))).query(SKIN.evaluate(SKIN.sample(0.1)))[0]
    assert found.largest_angle == pytest.approx(101, abs=1)
    assert 2.8 / (1.2 * depth.min()) < found.squeezed < 2.8 / depth.min()


def test_an_outline_is_turned_about_the_origin_then_shifted() -> None:
    points = ring(54.0, waves=2.0)
    found = outline(points, shift=(3.0, -1.0), rotation=90.0).inner_face(LIMB)
    # (x, y) -> (-y, x): the first point, on +x, goes to +y.
    assert found.evaluate(0.0) == pytest.approx([3.0, 56.0 - 1.0])
    assert found.evaluate(found.knots[:-1]) == pytest.approx(
        np.column_stack([3.0 - points[:, 1], points[:, 0] - 1.0])
    )


REFUSED = {
    "turned over": (offset(60.0), ("crosses itself at", "smaller or wider bumps")),
    "outline clockwise": (outline(ring(54.0)[::-1]), ("runs clockwise",)),
    "outline crossing itself": (
        outline(ring(54.0)[np.r_[0:20, 40:20:-1, 41:90]]),
        ("the inner face crosses itself at", "degrees, (", "correct its points"),
    ),
    "wall in a hollow": (
        # A bump of 3 mm whose width, 2.5 degrees, is 2.4 mm of skin: a radius of 2.4^2 / 3 mm.
        offset(0.5, Bump(center=268, width=2.5, amplitude=3.0)),
        ("a wall of 4.5 mm folds over", "radius of 1.9 mm, at 268 degrees, (-1.93, -52.72) mm"),
    ),
    "thick wall on a wavy face": (
        outline(ring(54.0, waves=2.0), wall_thickness=60.0),
        ("a wall of 60 mm folds over", "make the wall thinner"),
    ),
    "beside": (
        outline(ring(54.0), shift=(300.0, 0.0)),
        (
            "lies beside the limb, 1",
            "mm away, centred at 0 degrees, (300.00, 0.00) mm",
            "; shift = ['0 mm', '0 mm'] centres it on the limb",
        ),
    ),
    "half beside": (
        outline(ring(54.0) + np.array([40.0, -30.0]), rotation=90.0),
        ("reaches into bone", "; shift = ['-30 mm', '-40 mm'] centres it on the limb"),
    ),
    "as large as the limb": (
        outline(SKIN.evaluate(SKIN.sample(3.0)), shift=(3.0, 0.0)),
        (
            "is not smaller than the limb (area lost 0.00 %): resting on the limb alone it only",
            "until it presses nowhere; make it smaller by another drawing, or constrain it by "
            "socket_support = 'outer-fixed'",
        ),
    ),
    "as large, turned and scanned": (
        outline(
            SKIN.evaluate(SKIN.sample(3.0)) + np.random.default_rng(0).normal(0, 0.01, (144, 2)),
            rotation=5.0,
        ),
        ("is not smaller than the limb (area lost ",),
    ),
    "larger, with a bump on one side": (
        offset(-0.6, Bump(center=180, width=25, amplitude=1.0)),
        ("is not smaller than the limb (area lost -", "by a larger `base`"),
    ),
    "around": (
        offset(-5.0),
        ("does not press on the limb", "at least 5.00 mm away from the skin (closest at"),
    ),
    "ring that is too wide": (outline(ring(80.0)), ("does not press on the limb",)),
    "deep all round": (
        Socket.reference("TSB").model_copy(update={"base": 9.0}),
        (
            "reaches into bone: it presses 9.0 mm deep at 132 degrees",
            "where the bone has 5.6 mm",
            "of soft tissue",
        ),
    ),
    "small ring": (outline(ring(20.0)), ("reaches into bone",)),
    "no blend": (
        CircleBlend(
            area_reduction=0.98,
            roundness=0.5,
            bumps=(
                Bump(center=0, width=30, amplitude=100.0),
                Bump(center=180, width=30, amplitude=-100.0),
            ),
        ),
        ("no circle blend reduces the area by 98 %",),
    ),
}


def test_a_socket_that_is_no_smaller_may_press_from_two_sides_or_be_fixed() -> None:
    pinching = offset(
        -0.4, Bump(center=0, width=20, amplitude=1.0), Bump(center=180, width=20, amplitude=1.0)
    )
    assert check_placement(pinching, LIMB).area_reduction < 0
    moved = outline(SKIN.evaluate(SKIN.sample(3.0)), shift=(3.0, 0.0))
    assert check_placement(moved, LIMB, floating=False).largest_overlap == pytest.approx(3, abs=0.1)
    assert check_placement(offset(0.02), LIMB).area_reduction == pytest.approx(7.06e-4, rel=0.01)


@pytest.mark.parametrize(("wrong", "expected"), REFUSED.values(), ids=REFUSED)
def test_a_socket_that_cannot_be_donned_is_refused_in_one_line(
    wrong: Socket, expected: tuple[str, ...]
) -> None:
    with pytest.raises(InputError) as caught:
        check_placement(wrong, LIMB, "mine")
    line = str(caught.value)
    assert line.startswith("socket mine: ")
    assert "\n" not in line
    for part in expected:
        assert part in line
