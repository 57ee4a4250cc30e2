"""Drawings of single muscles and vessels: CSV files by name, and drawings with layers or ids."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

import calfsocket as cs
from calfsocket import cli
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.thickness import thickness
from calfsocket.io.errors import InputError
from calfsocket.meshes.limb import limb_curves
from drawings import outlined_svg

CALF = cs.Limb.reference()
BELLIES = [region.name for region in CALF.regions if region.tissue == "muscle"]
BONES = ("skin", "tibia", "fibula")
Shapes = Mapping[str, shapely.Polygon]


@cache
def outlines() -> dict[str, shapely.Polygon]:
    """Every region's outer boundary."""
    curves = limb_curves(CALF)
    return {
        region.name: shapely.Polygon(
            curves[region.outer].evaluate(curves[region.outer].sample(0.6))
        )
        for region in CALF.regions
    }


def some(*names: str) -> dict[str, shapely.Polygon]:
    return {name: outlines()[name] for name in names}


@cache
def touching() -> dict[str, shapely.Polygon]:
    """Bellies up to the middle of their septa, to the envelope and the bones."""
    found = Reference.calf().compartments
    return some(*BONES) | {name: shapely.Polygon(each.edge) for name, each in found.items()}


def overlapping(by: float) -> dict[str, shapely.Polygon]:
    """The same, the soleus larger, but for bones and fat."""
    whole = outlines()
    larger = touching()["soleus"].buffer(by).difference(whole["tibia"].union(whole["fibula"]))
    return touching() | {"soleus": larger.intersection(whole["deep_fascia"])}


def corners(body: shapely.Polygon) -> np.ndarray:
    """Points about every 0.6 mm: what buffers leave is denser than what anybody draws."""
    return shapely.get_coordinates(body.exterior.simplify(0.01).segmentize(0.6))[:-1]


def csv(folder: Path, shapes: Shapes) -> dict[str, Path]:
    for name, body in shapes.items():
        np.savetxt(folder / f"{name}.csv", corners(body), delimiter=",", fmt="%.4f")
    return {name: folder / f"{name}.csv" for name in shapes}


def dxf(folder: Path, shapes: Shapes) -> Path:
    document = ezdxf.new(units=ezdxf.units.MM)
    for name, body in shapes.items():
        document.modelspace().add_lwpolyline(corners(body), close=True, dxfattribs={"layer": name})
    document.saveas(folder / "limb.dxf")
    return folder / "limb.dxf"


def svg(folder: Path, shapes: Shapes) -> Path:
    return outlined_svg(folder / "limb.svg", {name: corners(each) for name, each in shapes.items()})


each_way = pytest.mark.parametrize("write", [csv, dxf, svg])


def made(folder: Path, shapes: Shapes, write: Callable = csv, **said: object) -> cs.Limb:
    return cs.Limb.from_outlines(write(folder, shapes), **said)


def measured(limb: cs.Limb, tissue: str) -> set[str]:
    return {r.name for r in limb.regions if r.tissue == tissue and r.origin == "measured"}


def notes(limb: cs.Limb) -> str:
    assert limb.source is not None
    return "\n".join((*limb.source.found, *limb.source.notes))


@each_way
def test_all_regions_come_back(tmp_path: Path, write: Callable) -> None:
    limb = made(tmp_path, outlines(), write)
    assert limb.tissues == CALF.tissues
    for region in limb.regions:
        if region.tissue in ("muscle", "vessel", "bone") or region.name == "plantaris_tendon":
            assert region.origin == "measured", region.name
            assert limb.areas[region.name] == pytest.approx(CALF.areas[region.name], rel=0.03)
    for name in ("skin", "subcutaneous_fat", "deep_fascia"):
        assert limb.areas[name] == pytest.approx(CALF.areas[name], rel=0.05), name
    assert thickness(limb)["skin"].median == pytest.approx(1.6, abs=0.1)


@each_way
def test_three_bellies_and_a_vessel(tmp_path: Path, write: Callable) -> None:
    given = ("soleus", "gastrocnemius_medial_head", "tibialis_anterior", "fibular_artery")
    limb = made(tmp_path, some(*BONES, *given), write)
    assert measured(limb, "muscle") | measured(limb, "vessel") == set(given)
    assert set(BELLIES) <= set(limb.tissues)  # the others are the atlas's
    for name in given:
        assert limb.areas[name] == pytest.approx(CALF.areas[name], rel=0.02), name


@pytest.mark.parametrize("septum", [None, 1.2])
def test_bellies_that_touch_get_septa(tmp_path: Path, septum: float | None) -> None:
    limb = made(tmp_path, touching(), septum=septum)
    assert measured(limb, "muscle") == set(BELLIES)
    wanted = 0.76 if septum is None else septum
    assert thickness(limb)["septa"].median == pytest.approx(wanted, abs=0.05)
    assert f"septa of {wanted:.2g} mm and fascia were cut out of" in notes(limb)
    assert "the envelope lies around the muscles that were drawn" in notes(limb)


@each_way
def test_a_small_overlap_gets_a_septum(tmp_path: Path, write: Callable) -> None:
    limb = made(tmp_path, overlapping(0.1), write)
    assert measured(limb, "muscle") == set(BELLIES)
    assert thickness(limb)["septa"].smallest > 0.5


@each_way
def test_a_large_overlap_is_refused(tmp_path: Path, write: Callable) -> None:
    files = write(tmp_path, overlapping(2.0))
    with pytest.raises(InputError, match=r"\w+ and soleus overlap by 2(\.\d)? mm near \(") as error:
        cs.Limb.from_outlines(files)
    assert "more than the tolerance, 0.2 mm" in str(error.value)
    assert "\n" not in str(error.value)
    assert str(error.value).count("limb.") + str(error.value).count(".csv") <= 2


def test_a_larger_tolerance_allows_a_larger_overlap(tmp_path: Path) -> None:
    limb = made(tmp_path, overlapping(0.5), tolerance=0.6)
    assert measured(limb, "muscle") == set(BELLIES)


def test_names_of_the_user(tmp_path: Path) -> None:
    names = {
        "soleus": "my calf:muscle",
        "tibialis_anterior": "Muscle 3",
        "fibular_artery": "x:vessel",
    }
    shapes = some(*BONES) | {names[name]: outlines()[name] for name in names}
    limb = made(tmp_path, shapes, svg)
    assert measured(limb, "muscle") == {"my_calf", "muscle_3"}
    assert measured(limb, "vessel") == {"x"}
    assert limb.areas["my_calf"] == pytest.approx(CALF.areas["soleus"], rel=0.02)


def test_parts_crumbs_and_what_is_ignored(tmp_path: Path) -> None:
    path = dxf(tmp_path, some(*BONES, "soleus"))
    document = ezdxf.readfile(path)
    space = document.modelspace()
    anterior = corners(outlines()["tibialis_anterior"])
    space.add_lwpolyline(anterior, close=True, dxfattribs={"layer": "soleus"})
    x, y = outlines()["gastrocnemius_medial_head"].representative_point().coords[0]
    space.add_circle((x, y), 0.3, dxfattribs={"layer": "soleus"})
    space.add_circle((x, y), 5, dxfattribs={"layer": "ignore"})
    space.add_text("a leg", dxfattribs={"layer": "notes"})
    document.saveas(path)
    limb = cs.Limb.from_outlines(path)
    assert measured(limb, "muscle") == {"soleus", "soleus_2"}
    assert limb.areas["soleus_2"] == pytest.approx(CALF.areas["tibialis_anterior"], rel=0.02)
    assert "soleus: 1 part of 0.28 mm2 left out" in notes(limb)
    assert "'notes': not used, for it has no closed outline" in notes(limb)


def test_layers_labels_and_ids_of_an_svg(tmp_path: Path) -> None:
    """A curve's own name counts before that of its layer, if it is one of a part."""
    path = svg(tmp_path, some(*BONES, "soleus", "tibialis_anterior"))
    text = path.read_text()
    text = text.replace('<path id="soleus"', '<g id="soleus"><path id="path12"')
    text = text.replace('<path id="tibialis_anterior"', '</g><path id="path13" '
                        'inkscape:label="tibialis anterior"', 1)  # fmt: skip
    path.write_text(text)
    limb = cs.Limb.from_outlines(path)
    assert measured(limb, "muscle") == {"soleus", "tibialis_anterior"}


def test_a_vessel_drawn_over_a_muscle(tmp_path: Path) -> None:
    inside = outlines()["soleus"].representative_point().buffer(1.5)
    limb = made(tmp_path, some(*BONES, "soleus") | {"my_artery:vessel": inside}, svg)
    assert limb.areas["my_artery"] == pytest.approx(inside.area, rel=0.03)
    assert limb.areas["soleus"] < CALF.areas["soleus"] - inside.area


def test_the_command_knows_files_by_their_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = csv(tmp_path, some(*BONES, "tibialis_anterior", "fibularis_longus", "fibular_vein"))
    files["fibular_vein"] = files["fibular_vein"].rename(tmp_path / "p7 fibular-vein v2.csv")
    assert cli.main(["limb", *map(str, files.values()), "--out", "mine.json"]) == 0
    assert "tibialis_anterior             muscle" in capsys.readouterr().out
    limb = cs.Limb.read("mine.json")
    assert measured(limb, "muscle") == {"tibialis_anterior", "fibularis_longus"}
    assert measured(limb, "vessel") == {"fibular_vein"}
    assert limb.source is not None
    assert set(limb.source.files) == {path.name for path in files.values()}
