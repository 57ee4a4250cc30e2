"""Limbs from surfaces: the drawn-out calf comes back, wherever and however its surfaces lie."""

import struct
from pathlib import Path

import numpy as np
import pytest
import shapely
from phantom import HEIGHT, Phantom, outline, turned

import calfsocket as cs
from calfsocket.imaging.plane import Level, Plane, cut
from calfsocket.imaging.ply import read_ply
from calfsocket.imaging.section import distinct
from calfsocket.io.errors import InputError
from calfsocket.meshes.fairing import noise_of
from calfsocket.meshes.limb import limb_curves

PARTS = ("skin", "tibia", "fibula")


def polygons(limb: cs.Limb) -> dict[str, shapely.Polygon]:
    return {
        name: shapely.Polygon(curve.evaluate(curve.sample(0.1)))
        for name, curve in limb_curves(limb).items()
    }


def differences(limb: cs.Limb, phantom: Phantom, share: float) -> dict[str, tuple[float, float]]:
    """Relative error of the area, and largest distance, of each part."""
    skin = phantom.section("skin", share)
    found = polygons(limb)
    away = {}
    for part in PARTS:
        true = shapely.affinity.translate(
            phantom.section(part, share), -skin.centroid.x, -skin.centroid.y
        )
        distance = found[part].exterior.hausdorff_distance(true.exterior)
        away[part] = (found[part].area / true.area - 1, distance)
    return away


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Phantom, cs.Limb]:
    phantom = Phantom()
    folder = tmp_path_factory.mktemp("straight")
    return phantom, cs.Limb.from_surface(*phantom.write(folder, *PARTS), tissues="lumped")


def test_the_calf_comes_back(straight: tuple[Phantom, cs.Limb]) -> None:
    phantom, limb = straight
    for area, distance in differences(limb, phantom, 0.5).values():
        assert abs(area) < 0.002
        assert distance < 0.2
    assert (limb.side, limb.seen_from) == ("right", "above")
    assert limb.axes == {"+x": "lateral", "+y": "anterior"}


def test_nothing_is_rounded_off_where_there_is_no_noise(
    straight: tuple[Phantom, cs.Limb],
) -> None:
    """The skin over the crest of the tibia bends by 15 mm: there the pressure is highest."""
    assert differences(straight[1], straight[0], 0.5)["skin"][1] < 0.05


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_levels(tmp_path: Path, share: float) -> None:
    phantom = Phantom(twist=0.0)
    limb = cs.Limb.from_surface(*phantom.write(tmp_path, *PARTS), level=share, tissues="lumped")
    for area, distance in differences(limb, phantom, share).values():
        assert abs(area) < 0.002
        assert distance < 0.2
    assert limb.source is not None and limb.source.height == pytest.approx(share)


def test_one_file_with_scanner_noise(tmp_path: Path) -> None:
    phantom = Phantom(noise=0.1)
    path = phantom.write_one(tmp_path / "limb.ply", *PARTS)
    limb = cs.Limb.from_surface(path, tolerance=0.4, tissues="lumped")
    for area, distance in differences(limb, phantom, 0.5).values():
        assert abs(area) < 0.01
        assert distance < 0.4
    deviations = [r.deviation_mm for r in limb.regions if r.deviation_mm is not None]
    assert 0.05 < max(deviations) < 0.4


def test_points_beside_one_vertex_are_one_measurement() -> None:
    """Where a plane cuts all triangles at a vertex, their points have the same error."""
    true = outline("skin")
    along = np.roll(true, -1, axis=0) - np.roll(true, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    vertices = true + np.random.default_rng(1).normal(scale=0.1, size=true.shape)
    points = (vertices[:, None] + np.array([[-0.1], [0.0], [0.1]]) * along[:, None]).reshape(-1, 2)
    assert len(distinct(points)) == len(vertices)
    assert noise_of(distinct(points), 1.0) == pytest.approx(0.1, rel=0.2)
    assert len(distinct(points[:60])) == 60  # 20 would be too few


def test_a_surface_noisier_than_the_tolerance_is_not_followed(tmp_path: Path) -> None:
    phantom = Phantom(noise=0.15, seed=1)
    path = phantom.write_one(tmp_path / "limb.ply", *PARTS)
    limb = cs.Limb.from_surface(path, tissues="lumped")
    area, distance = differences(limb, phantom, 0.5)["skin"]
    assert abs(area) < 0.002
    assert distance < 0.25
    assert limb.source is not None
    said = [line for line in limb.source.found if line.startswith("skin: leaves the data by")]
    assert "(noise of 0.1" in said[0]
    with pytest.raises(InputError, match="more than the tolerance"):
        cs.Limb.from_surface(path, tolerance=0.2, tissues="lumped")


@pytest.mark.parametrize(
    "changed",
    [
        {"turn": turned(1)},
        {"turn": turned(2), "scale": 1000.0},
        {"mirrored": True},
        {"mirrored": True, "turn": turned(3)},
    ],
    ids=["turned", "metres", "left", "left and turned"],
)
def test_the_same_limb_however_it_lies(
    tmp_path: Path, straight: tuple[Phantom, cs.Limb], changed: dict
) -> None:
    phantom = Phantom(**changed)
    units = "m" if phantom.scale > 1 else "mm"
    limb = cs.Limb.from_surface(
        *phantom.write(tmp_path, *PARTS, name="{}.vtp"), units=units, tissues="lumped"
    )
    assert limb.side == ("left" if phantom.mirrored else "right")
    assert limb.axes["+x"] == ("medial" if phantom.mirrored else "lateral")
    same = polygons(straight[1])
    for name, found in polygons(limb).items():
        if phantom.mirrored:
            found = shapely.affinity.scale(found, -1, 1, origin=(0, 0))
        assert found.exterior.hausdorff_distance(same[name].exterior) < 0.05
    for name, area in limb.areas.items():
        assert area == pytest.approx(straight[1].areas[name], rel=2e-3)


def test_fat_and_cavity_are_used_where_they_are_known(tmp_path: Path) -> None:
    phantom = Phantom()
    path = phantom.write_one(tmp_path / "limb.vtp", *PARTS, "muscle", "cavity")
    limb = cs.Limb.from_surface(path, tissues="lumped")
    assert set(limb.tissues) == {"skin", "subcutaneous_fat", "muscle", "tibia", "fibula"}
    true = {part: phantom.section(part, 0.5).area for part in (*PARTS, "muscle", "cavity")}
    assert limb.areas["tibia"] == pytest.approx(true["tibia"] - true["cavity"], rel=0.01)
    assert limb.source is not None
    assert not any("cavity" in line for line in limb.source.assumed)
    # The muscle's envelope is moved where the tibia comes closer to it than 0.5 mm.
    whole = limb.areas["muscle"] + true["tibia"] + true["fibula"]
    assert whole == pytest.approx(true["muscle"], rel=0.005)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_as_programs_write_it(tmp_path: Path, kind: str) -> None:
    """Colours, other types of numbers, lists for textures, quadrangles among triangles."""
    points = np.array([[0.0, 0, 0], [30, 0, 0], [30, 40, 0], [0, 40, 0], [15, 20, 99]])
    faces = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (3, 2, 1, 0)]
    header = (
        f"ply\nformat {kind} 1.0\ncomment a remark\nelement vertex 5\nproperty double x\n"
        "property double y\nproperty double z\nproperty uchar red\nelement face 5\n"
        "property list uchar uint vertex_index\nproperty list uchar float texcoord\n"
        "property char quality\nend_header\n"
    )
    if kind == "ascii":
        lines = [f"{x} {y} {z} 9" for x, y, z in points]
        lines += [f"{len(f)} {' '.join(map(str, f))} 2 0.5 0.5 1" for f in faces]
        content = "\n".join(lines).encode()
    else:
        order = "<" if "little" in kind else ">"
        content = b"".join(struct.pack(f"{order}3dB", *point, 9) for point in points)
        content += b"".join(
            struct.pack(f"{order}B{len(f)}IB2fb", len(f), *f, 2, 0.5, 0.5, 1) for f in faces
        )
    (tmp_path / "a.ply").write_bytes(header.encode() + content)
    found, triangles = read_ply(tmp_path / "a.ply")
    assert found.tolist() == points.tolist()
    fans = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [3, 2, 1], [3, 1, 0]]
    assert triangles.tolist() == fans
    for missing in (10, 60):
        (tmp_path / "a.ply").write_bytes((header.encode() + content)[:-missing])
        with pytest.raises(ValueError, match="missing"):
            read_ply(tmp_path / "a.ply")


def test_parts_may_be_said(tmp_path: Path) -> None:
    phantom = Phantom()
    skin, one, two = phantom.write(tmp_path, *PARTS, name="part-{}.obj".replace("{}", "{0:.1}"))
    limb = cs.Limb.from_surface(
        one, two, skin, tibia="part-t", fibula="part-f", side="right", tissues="lumped"
    )
    assert set(limb.tissues) == {"skin", "soft_tissue", "tibia", "fibula"}


def test_directions_may_be_said(tmp_path: Path) -> None:
    paths = Phantom().write(tmp_path, *PARTS)
    limb = cs.Limb.from_surface(*paths, proximal="-z", anterior="0,1,0", tissues="lumped")
    assert limb.side == "left"  # the same surfaces upside down
    assert limb.axes == {"+x": "medial", "+y": "anterior"}


def test_read_back(tmp_path: Path, straight: tuple[Phantom, cs.Limb]) -> None:
    limb = straight[1]
    limb.write(tmp_path / "limb.json")
    assert cs.Limb.read(tmp_path / "limb.json") == limb


def test_levels_in_words() -> None:
    assert Level.parse("0.25").height(100, 300) == 150
    assert Level.parse("80 mm").height(100, 300) == 180
    assert Level.parse("80 mm from proximal").height(100, 300) == 220
    assert Level.parse("80mm from the distal end").height(100, 300) == 180


def test_a_cut_finds_holes_and_parts() -> None:
    phantom = Phantom()
    middle = Plane.square_to(np.array([0.0, 0, 1]), np.array([0.0, 0, HEIGHT / 2]))
    both = phantom.surface("tibia").merge(phantom.surface("cavity")).extract_surface()
    (body,) = cut(both, middle).bodies
    assert len(body.interiors) == 1
    assert cut(phantom.surface("skin"), middle).gap == 0
    skin = phantom.surface("skin")
    keep = np.linalg.norm(skin.cell_centers().points - [50, 0, HEIGHT / 2], axis=1) > 15
    holed = skin.extract_cells(np.flatnonzero(keep)).extract_surface()
    found = cut(holed, middle)
    assert 20 < found.gap < 32
    assert found.place is not None
    place = middle.origin + found.place[0] * middle.x + found.place[1] * middle.y
    assert place == pytest.approx([50, 0, HEIGHT / 2], abs=8)
