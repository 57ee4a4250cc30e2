"""Limbs from AOP files and from drawings, and the command that makes them."""

from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely
from phantom import HEIGHT, Phantom
from test_imaging_surface import differences

import calfsocket as cs
from calfsocket import cli
from calfsocket.imaging.anatomy import Said, find_anatomy
from calfsocket.imaging.aop import read_aop
from calfsocket.imaging.limb import imported, read_source
from calfsocket.imaging.plane import Level
from calfsocket.imaging.section import section

PARTS = ("skin", "tibia", "fibula")


def aop(path: Path, phantom: Phantom, side: str = "RIGHT", spacing: float = 0.0) -> Path:
    """Write the phantom's skin as AOP: 72 radii at 41 levels."""
    levels = np.linspace(0, HEIGHT, 41)
    lines = ["AAOP1", "a remark", "END COMMENTS", "CYLINDRICAL", side, "0", "72", "5.0", "41"]
    lines += [f"{spacing}"] if spacing else ["0", *map(str, levels)]
    for level in levels:
        skin = phantom.section("skin", level / HEIGHT)
        for angle in np.deg2rad(5 * np.arange(72)):
            ray = shapely.LineString([(0, 0), (200 * np.cos(angle), 200 * np.sin(angle))])
            lines.append(f"{ray.intersection(skin).length:.6f}")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("spacing", [0.0, HEIGHT / 40])
def test_an_aop_has_the_sections_that_went_into_it(tmp_path: Path, spacing: float) -> None:
    phantom = Phantom(taper=(0.6, 1.2))
    source = read_source([aop(tmp_path / "scan.aop", phantom, spacing=spacing)])
    assert source.side == "right"
    anatomy = find_anatomy(source, Said(anterior="+y"))
    assert anatomy.axis @ [0, 0, 1] > 0.99  # the thinner end is the distal one
    part = section(source, anatomy, None, ((0, 0, 100), (0, 0, 1)))
    true = phantom.section("skin", 0.5)
    assert part.outlines.skin.curve.area == pytest.approx(true.area, rel=2e-3)
    assert part.outlines.side == "right"
    assert part.outlines.frame.known


MARKS = {"Patella Tendon": (0.9, 90.0), "Fibula Head": (0.85, -30.0), "Distal End": (0.05, 10.0)}


def with_landmarks(
    path: Path, phantom: Phantom, order: tuple[int, int, int], layout: str
) -> dict[str, np.ndarray]:
    """Add landmarks to an AOP file as programs write them; return where they are."""
    lines = aop(path, phantom, side="NONE").read_text().splitlines()
    rows, places = [], {}
    for name, (share, angle) in MARKS.items():
        away = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
        ray = shapely.LineString([(0, 0), 200 * away])
        radius = ray.intersection(phantom.section("skin", share)).length
        places[name.lower()] = np.array([*radius * away, share * HEIGHT])
        numbers = [str((radius, angle, share * HEIGHT)[i]) for i in order]
        rows += {
            "one line": [" ".join([name, *numbers])],
            "two lines": [name, " ".join(numbers)],
            "four lines": [f'"{name}"', *numbers],
        }[layout]
    changed = [*lines[:5], str(len(MARKS)), *rows, *lines[6:]]
    path.write_text("\r\n".join(changed), newline="")
    return places


@pytest.mark.parametrize(
    ("order", "layout"),
    [((0, 1, 2), "one line"), ((1, 2, 0), "two lines"), ((2, 1, 0), "four lines")],
)
def test_landmarks_of_an_aop_say_front_and_side(
    tmp_path: Path, order: tuple[int, int, int], layout: str
) -> None:
    phantom = Phantom(taper=(0.6, 1.2))
    places = with_landmarks(tmp_path / "scan.aop", phantom, order, layout)
    source = read_source([tmp_path / "scan.aop"])
    assert source.landmarks.keys() == places.keys()
    for name, place in places.items():
        assert source.landmarks[name] == pytest.approx(place, abs=1e-6)
    found = find_anatomy(source, Said())
    assert found.side == "right"
    assert found.anterior is not None and found.anterior @ [0, 1, 0] > 0.98


def test_landmarks_that_are_not_on_the_surface_are_not_used(tmp_path: Path) -> None:
    path = aop(tmp_path / "scan.aop", Phantom(taper=(0.6, 1.2)), side="NONE")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:5], "1", "patella 1 2 3", *lines[6:]]))
    source = read_source([path])
    assert source.landmarks == {}
    assert find_anatomy(source, Said()).anterior is None


def test_levels_from_the_top_and_angles_one_by_one(tmp_path: Path) -> None:
    lines = aop(tmp_path / "scan.aop", Phantom()).read_text().splitlines()
    points, triangles = read_aop(tmp_path / "scan.aop")
    radii = np.array(lines[51:], dtype=float).reshape(41, 72)[::-1]
    listed = [*lines[:7], "0", *map(str, 5.0 * np.arange(72)), *lines[8:10], *lines[50:9:-1]]
    (tmp_path / "other.aop").write_text("\n".join([*listed, *map(str, radii.ravel())]))
    same, cells = read_aop(tmp_path / "other.aop")
    assert same == pytest.approx(points)
    assert np.array_equal(cells, triangles)


def test_an_aop_turns_counter_clockwise(tmp_path: Path) -> None:
    points, triangles = read_aop(aop(tmp_path / "scan.aop", Phantom(twist=0)))
    ring = points[:72]
    assert ring[0, 1] == 0
    assert ring[18, 0] == pytest.approx(0, abs=1e-9)
    assert ring[18, 1] > 0
    assert triangles.max() == len(points) - 1


def test_a_scan_of_the_skin_gets_its_bones_from_the_atlas(tmp_path: Path) -> None:
    phantom = Phantom()
    (path,) = phantom.write(tmp_path, "skin")
    source = read_source([path])
    anatomy = find_anatomy(source, Said("right", "+z", "+y"))
    made = imported(section(source, anatomy, Level.parse("0.5")))
    assert made.limb.source is not None
    assert any("tibia and fibula" in line for line in made.limb.source.assumed)
    origin = {region.name: region.origin for region in made.limb.regions}
    assert origin["tibia"] == "assumed"
    assert len(made.limb.regions) == 27
    true = phantom.section("tibia", 0.5)
    assert made.limb.areas["tibia"] == pytest.approx(
        true.area - phantom.section("cavity", 0.5).area, rel=0.1
    )


def csv(folder: Path, phantom: Phantom, *parts: str, turn: float = 0.0) -> dict[str, Path]:
    """Write outlines half way up, turned by an angle, as CSV files."""
    c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
    files = {}
    for part in parts:
        points = shapely.get_coordinates(phantom.section(part, 0.5).exterior)[:-1]
        files[part] = folder / f"{part}.csv"
        np.savetxt(files[part], points @ np.array([[c, s], [-s, c]]) + 20, delimiter=",")
    return files


@pytest.mark.parametrize("turn", [0.0, 70.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_outlines_give_the_limb(tmp_path: Path, turn: float, mirrored: bool) -> None:
    phantom = Phantom(mirrored=mirrored)
    limb = cs.Limb.from_outlines(csv(tmp_path, phantom, *PARTS, turn=turn), tissues="lumped")
    assert limb.axes == {"+x": "medial" if mirrored else "lateral", "+y": "anterior"}
    assert limb.side is None  # seen from above a right leg, from below a left one
    for area, distance in differences(limb, phantom, 0.5).values():
        assert abs(area) < 0.002
        assert distance < 0.1


def test_a_drawing_with_layers(tmp_path: Path) -> None:
    phantom = Phantom()
    document = ezdxf.new(units=ezdxf.units.MM)
    for part in (*PARTS, "muscle"):
        points = shapely.get_coordinates(phantom.section(part, 0.5).exterior)[:-1]
        document.layers.add(part)
        document.modelspace().add_lwpolyline(points, close=True, dxfattribs={"layer": part})
    document.saveas(tmp_path / "limb.dxf")
    limb = cs.Limb.from_outlines(tmp_path / "limb.dxf", side="right", tissues="lumped")
    assert set(limb.tissues) == {"skin", "subcutaneous_fat", "muscle", "tibia", "fibula"}
    assert limb.side == "right"
    assert limb.seen_from == "above"
    with pytest.raises(cs.InputError, match="posteromedial of the tibia"):
        cs.Limb.from_outlines(tmp_path / "limb.dxf", side="left", anterior="+y", tissues="lumped")


def test_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    paths = Phantom().write(tmp_path, *PARTS)
    words = ["limb", *map(str, paths), "--level", "100 mm", "--out", "mine.json"]
    assert cli.main(words) == 0
    shown = capsys.readouterr().out
    assert "100 mm from the distal end (50 % of the height)" in shown
    assert "soleus" in shown
    limb = cs.Limb.read("mine.json")
    assert len(limb.regions) == 27
    assert limb.source is not None
    assert set(limb.source.files) == {"skin.stl", "tibia.stl", "fibula.stl"}
    first = (tmp_path / "mine.json").read_bytes(), (tmp_path / "mine.png").read_bytes()
    assert cli.main([*words, "--tissues", "lumped"]) == 0
    assert "soft_tissue" in capsys.readouterr().out
    assert cli.main(words) == 0
    assert ((tmp_path / "mine.json").read_bytes(), (tmp_path / "mine.png").read_bytes()) == first
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\nlimb = "mine.json"\nsockets = ["HS"]\nmaterials = ["separate"]\n'
        '[sockets.HS]\nlike = "HS"\narea_reduction = "4 %"\n'.replace(
            "sockets.HS", "sockets.mine"
        ).replace('["HS"]', '["mine"]')
    )
    assert cli.main(["check", "study.toml"]) == 0


def test_many_levels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    paths = Phantom(twist=0).write(tmp_path, *PARTS)
    words = ["limb", *map(str, paths), "--tissues", "lumped", "--out", "mine.json"]
    assert cli.main([*words, "--levels", "0:0.6:4"]) == 0
    shown = capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.glob("mine_*.json")) == [
        "mine_0.200.json", "mine_0.400.json", "mine_0.600.json",
    ]  # fmt: skip
    assert "left out: skin.stl, tibia.stl, fibula.stl, level 0: " in shown
    areas = [cs.Limb.read(path).areas["tibia"] for path in sorted(tmp_path.glob("mine_*.json"))]
    assert areas == sorted(areas)  # it tapers
