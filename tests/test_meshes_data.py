"""The data files: what they say, and what is said when they are wrong."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_json
from calfsocket.meshes import limb
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import (
    CircleBlend,
    NormalOffset,
    Socket,
    Sockets,
    reference_sockets,
)

FOLDER = Path(limb.__file__).parent
Change = Callable[[dict[str, Any]], Any]


def test_the_calf_has_27_regions_of_6_tissues() -> None:
    limb = Limb.reference()
    counts: dict[str, int] = {}
    for region in limb.regions:
        counts[region.tissue] = counts.get(region.tissue, 0) + 1
    assert counts == {"skin": 1, "fat": 1, "fascia": 2, "muscle": 11, "bone": 2, "vessel": 10}
    assert sorted(limb.region_tags.values()) == list(range(1, 28))
    assert limb.fixed_boundary == "tibia_medullary"


def test_the_sockets_are_three_with_a_wall_of_4_5_mm() -> None:
    sockets = reference_sockets()
    assert list(sockets) == ["TC", "TSB", "HS"]
    assert {socket.wall_thickness for socket in sockets.values()} == {4.5}


def test_limbs_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="frozen"):
        Limb.reference().title = "another"


def wrong(tmp_path: Path, name: str, change: Change) -> str:
    """Change a copy of a data file; return the error message that loading it gives."""
    content = json.loads((FOLDER / name).read_text())
    change(content)
    path = tmp_path / name
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as caught:
        read_json(path, Limb if name == "calf.json" else Sockets)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


def region(content: dict[str, Any], name: str) -> dict[str, Any]:
    (found,) = (entry for entry in content["regions"] if entry["name"] == name)
    return found


def move(content: dict[str, Any], curve: str, x: float, y: float) -> None:
    curve = content["curves"][curve]
    curve["points"] = [[a + x, b + y] for a, b in curve["points"]]


def shift_all(content: dict[str, Any]) -> None:
    for curve in content["curves"].values():
        if curve["type"] == "spline":
            curve["points"] = [[x + 200.0, y] for x, y in curve["points"]]
        elif curve["type"] == "ellipse":
            curve["center"][0] += 200.0


CANAL = {"type": "ellipse", "center": [27.2, 0.8], "semi_axes": [2.6, 2.0], "angle_deg": 110.0}

LIMB_ERRORS: dict[str, tuple[Change, str]] = {
    "units": (lambda c: c.update(units="cm, deg"), "units: is 'cm, deg'; it must be 'mm, deg'"),
    "missing key": (lambda c: c.pop("curves"), "curves: is missing; add it"),
    "misspelt key": (
        lambda c: c.update(contact_boundry=c.pop("contact_boundary")),
        "unknown key 'contact_boundry'; did you mean 'contact_boundary'?",
    ),
    "misspelt key inside": (
        lambda c: c["curves"]["fibular_vein"].update(angle=3),
        "curves.fibular_vein: unknown key 'angle'; did you mean 'angle_deg'?",
    ),
    "not a number": (
        lambda c: c["curves"]["tibia"]["points"][3].__setitem__(1, "high"),
        "curves.tibia.points.3.1: is 'high'; it must be a number",
    ),
    "infinite": (
        lambda c: c["curves"]["tibia"]["points"][3].__setitem__(1, float("inf")),
        "curves.tibia.points.3.1: is inf; it must be a finite number",
    ),
    "repeated point": (
        lambda c: c["curves"]["tibia"]["points"].append([-6.89, 21.23]),
        "curves.tibia.points: point [-6.89, 21.23] is repeated",
    ),
    "nearly repeated point": (
        lambda c: c["curves"]["tibia"]["points"].append([-6.8905, 21.23]),
        "curves.tibia.points: point [-6.8905, 21.23] is repeated",
    ),
    "unknown curve type": (
        lambda c: c["curves"]["fibular_vein"].update(type="circle"),
        "curves.fibular_vein: type is 'circle'; it must be one of 'spline'",
    ),
    "negative semi-axis": (
        lambda c: c["curves"]["fibular_vein"].update(semi_axes=[1.0, -1.0]),
        "curves.fibular_vein.semi_axes.1: is -1.0; it must be greater than 0",
    ),
    "offset of nothing": (
        lambda c: c["curves"]["skin_inner"].update(of="skin_outlin"),
        "curves.skin_inner.of: no curve 'skin_outlin'; did you mean 'skin_outline'?",
    ),
    "offset of an offset": (
        lambda c: c["curves"]["fascia_outer"].update(of="skin_inner"),
        "curves.fascia_outer.of: 'skin_inner' is itself an offset",
    ),
    "fat angles": (
        lambda c: c["layers"]["fat_thickness"].append([10.0, 4.0]),
        "layers.fat_thickness: angles must increase",
    ),
    "fat angle of 400 degrees": (
        lambda c: c["layers"]["fat_thickness"].append([400.0, 4.0]),
        "layers.fat_thickness: angles must lie in 0 <= angle < 360",
    ),
    "unknown tissue": (
        lambda c: region(c, "tibia").update(tissue="bones"),
        "regions.15.tissue: is 'bones'; it must be 'skin', 'fat', 'fascia', 'muscle'",
    ),
    "ids not unique": (
        lambda c: region(c, "fibula").update(id=16),
        "regions: id 16 is used by two regions",
    ),
    "names not unique": (
        lambda c: region(c, "fibula").update(name="tibia"),
        "regions: name tibia is used by two regions",
    ),
    "the socket's id": (
        lambda c: region(c, "fibula").update(id=100),
        "regions.fibula.id: 100 is reserved; choose one below 100",
    ),
    "the socket's name": (
        lambda c: region(c, "fibula").update(name="socket"),
        "regions.socket.name: reserved",
    ),
    "no such outer curve": (
        lambda c: region(c, "fibula").update(outer="fibla"),
        "regions.fibula: no curve 'fibla'; did you mean 'fibula'?",
    ),
    "no such hole": (
        lambda c: region(c, "tibia").update(holes=["tibia_medulary"]),
        "regions.tibia: no curve 'tibia_medulary'; did you mean 'tibia_medullary'?",
    ),
    "one outer curve twice": (
        lambda c: region(c, "fibula").update(outer="tibia"),
        "regions.fibula.outer: 'tibia' is already the outer curve of tibia",
    ),
    "one hole twice": (
        lambda c: region(c, "skin")["holes"].append("fibula"),
        "regions.deep_fascia.holes: 'fibula' is already a hole of skin",
    ),
    "a second hole that nothing fills": (
        lambda c: (
            region(c, "fibula").update(holes=["canal"]),
            c["curves"].update(canal=CANAL),
        ),
        "fixed_boundary: 'tibia_medullary' must be the one hole",
    ),
    "a region outside": (
        lambda c: region(c, "deep_fascia")["holes"].remove("fibula"),
        "contact_boundary: 'skin_outline' must be the one outer curve",
    ),
    "a loop that crosses itself": (
        lambda c: c["curves"]["skin_outline"]["points"].__setitem__(0, [-30.0, 0.0]),
        "curves.skin_outline: crosses itself at ",
    ),
    "an offset that folds over": (
        lambda c: c["layers"].update(skin_thickness=20.0),
        "curves.skin_inner: crosses itself",
    ),
    "touching curves": (
        lambda c: c["curves"]["fibular_artery"].update(center=[17.0, -6.4]),
        "mm of 'fibular_vein' at 335 degrees, (16.78, -7.91) mm; keep curves 0.1 mm apart",
    ),
    "beside the origin": (
        shift_all,
        "curves.skin_outline: does not enclose the origin",
    ),
    "a point of one number": (
        lambda c: c["curves"]["tibia"]["points"].__setitem__(3, [1.0]),
        "curves.tibia.points.3.1: is missing; add it",
    ),
    "a limb of 2 m": (
        lambda c: c["curves"]["tibia"]["points"].__setitem__(3, [0.0, 2000.0]),
        "curves.tibia.points.3.1: is 2000.0; it must be less than or equal to 1000",
    ),
    "half a character": (
        lambda c: c.update({"\ud800": 1}),
        "contains an invalid character (half of a surrogate pair); retype it",
    ),
    "a key of two lines": (lambda c: c.update({"a\nb": 1}), "unknown key 'a\\nb'; allowed:"),
    "sides without axes": (
        lambda c: c.update(side="middle"),
        "side: is 'middle'; it must be 'left' or 'right'",
    ),
    "an axis that points outside": (
        lambda c: c["axes"].update({"+x": "outside"}),
        "axes.+x: is 'outside'; it must be 'lateral', 'anterior', 'medial' or 'posterior'",
    ),
    "one axis": (
        lambda c: c["axes"].pop("+y"),
        "axes: give '+x' and '+y', or leave the axes out where they are not known",
    ),
    "both axes lateral": (
        lambda c: c["axes"].update({"+y": "lateral"}),
        "axes: +x lateral and +y lateral are not at right angles; one of them must be",
    ),
    "a right leg called left": (
        lambda c: c.update(side="left leg seen from above (proximal)"),
        "axes: +x is lateral and +y anterior, which is a left limb seen from below, not from above",
    ),
    "a fibula on the medial side": (
        lambda c: c["axes"].update({"+x": "medial"}) or c.update(side="left"),
        "axes: +x is medial and +y anterior, so that the fibula would lie posteromedial of the "
        "tibia, but in every leg it is lateral and further back; correct axes (and side)",
    ),
    "a shin at the back": (
        lambda c: c["axes"].update({"+y": "posterior"}) or c.update(seen_from="below"),
        "axes: +x is lateral and +y posterior, so that the fibula would lie anterolateral of",
    ),
    "an area that the curves do not have": (
        lambda c: region(c, "fibula").update(area=142.0),
        "regions.fibula.area: is 142 mm^2, but its curves enclose 124.4; correct the curves",
    ),
    "an offset without layers": (
        lambda c: c.pop("layers"),
        "layers: is missing, but curves.skin_inner is an offset; add it",
    ),
    "a hole outside": (
        lambda c: move(c, "fibula", 200.0, 0.0),
        "regions.deep_fascia: hole 'fibula' is not inside 'fascia_outer'",
    ),
    "a hole in a hole": (
        lambda c: c["curves"]["fibular_vein"].update(center=[5.0, 35.0]),
        "regions.deep_fascia: hole 'fibular_vein' lies inside hole 'tibialis_anterior'",
    ),
}


@pytest.mark.parametrize(("change", "expected"), LIMB_ERRORS.values(), ids=LIMB_ERRORS)
def test_a_wrong_limb_is_refused_in_one_line(tmp_path: Path, change: Change, expected: str) -> None:
    assert expected in wrong(tmp_path, "calf.json", change)


SOCKET_ERRORS: dict[str, tuple[Change, str]] = {
    "unknown law": (
        lambda c: c["sockets"]["TC"].update(law="offset"),
        "sockets.TC: law is 'offset'; it must be one of 'normal_offset'",
    ),
    "another law's parameter": (
        lambda c: c["sockets"]["TC"].update(roundness=0.1),
        "sockets.TC: unknown key 'roundness'; allowed: base, bumps, law, modulus",
    ),
    "bump without width": (
        lambda c: c["sockets"]["HS"]["bumps"][0].pop("width"),
        "sockets.HS.bumps.0.width: is missing; add it",
    ),
    "roundness above 1": (
        lambda c: c["sockets"]["HS"].update(roundness=1.1),
        "sockets.HS.roundness: is 1.1; it must be less than or equal to 1",
    ),
    "no wall": (
        lambda c: c["sockets"]["TC"].update(wall_thickness=0.0),
        "sockets.TC.wall_thickness: is 0.0; it must be greater than 0",
    ),
}


@pytest.mark.parametrize(("change", "expected"), SOCKET_ERRORS.values(), ids=SOCKET_ERRORS)
def test_a_wrong_socket_is_refused_in_one_line(
    tmp_path: Path, change: Change, expected: str
) -> None:
    assert expected in wrong(tmp_path, "sockets.json", change)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('{"units": "mm, deg", "units": "mm, deg"}', "key 'units' appears twice"),
        ('{"units": ', "line 1 column 11"),
        ("[]", r"is \[\]; it must be a table"),
        ("[" * 100_000, "has too many levels of nesting"),
        ("9" * 5000, "Exceeds the limit"),
    ],
)
def test_what_is_not_proper_json_is_refused(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "limb.json"
    path.write_text(text)
    with pytest.raises(InputError, match=expected):
        Limb.read(path)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("limb.stl", "a surface mesh (STL)"),
        ("LIMB.PLY", "a surface mesh (PLY)"),
        ("limb.nii.gz", "a volume image (NII.GZ)"),
        ("limb.png", "a picture (PNG)"),
        ("limb.step", "a CAD model (STEP)"),
        ("limb.csv", "a table (CSV)"),
    ],
)
def test_what_is_no_limb_is_called_what_it_is(tmp_path: Path, name: str, kind: str) -> None:
    (tmp_path / name).write_bytes(b"solid \x00\xff")
    with pytest.raises(InputError) as caught:
        Limb.read(tmp_path / name)
    assert f"{name}: is {kind}; a limb is a JSON file, which" in str(caught.value)


def test_a_byte_order_mark_is_dropped_and_utf_16_is_named(tmp_path: Path) -> None:
    text = (FOLDER / "calf.json").read_text(encoding="utf-8")
    path = tmp_path / "limb.json"
    path.write_text(text, encoding="utf-8-sig")
    assert Limb.read(path) == Limb.reference()
    path.write_text(text, encoding="utf-16")
    with pytest.raises(InputError, match=r"limb\.json: is UTF-16 text; save it as UTF-8"):
        Limb.read(path)
    toml = tmp_path / "socket.toml"
    toml.write_text('like = "TC"\n', encoding="utf-8-sig")
    assert Socket.read(toml) == Socket.reference("TC").model_copy(update={"name": "socket"})


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.json: cannot be read \(No such file"):
        Limb.read(tmp_path / "nowhere.json")


def test_unknown_names_are_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match="no socket 'TCB'; did you mean 'TC'"):
        Socket.reference("TCB")
    with pytest.raises(InputError, match="no socket 'x'; allowed: HS, TC, TSB"):
        Socket.reference("x")


def test_the_direction_of_a_limbs_points_is_of_no_account() -> None:
    limb = Limb.reference()
    content = limb.model_dump()
    for curve in content["curves"].values():
        if curve["type"] == "spline":
            curve["points"] = curve["points"][::-1]
    turned = Limb(**content)
    assert turned.areas == pytest.approx(limb.areas, rel=1e-9)
    assert turned.skin.area > 0


def test_what_is_built_in_python_is_refused_in_the_same_words() -> None:
    content = Limb.reference().model_dump()
    with pytest.raises(InputError, match=r"^Limb: fixed_boundary: 'tibia' must be the one hole"):
        Limb(**content | {"fixed_boundary": "tibia"})
    with pytest.raises(InputError, match=r"^NormalOffset: base: is 200\.0; it must be less than"):
        NormalOffset(base=200.0)
    with pytest.raises(InputError, match=r"^NormalOffset: base: unit 'kPa' is unknown"):
        NormalOffset(base="1 kPa")
    with pytest.raises(InputError, match=r"^CircleBlend: unknown key 'base'; allowed: area"):
        CircleBlend(area_reduction="5 %", base=1.0)


def test_a_socket_is_read_from_a_table(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('like = "HS"\narea_reduction = "3 %"\nmodulus = "2 GPa"\n')
    mine = Socket.read(path)
    assert mine == Socket.reference("HS").model_copy(
        update={"name": "mine", "area_reduction": 0.03, "modulus": 2000.0}
    )
    assert mine.elasticity() == {"e": 2000.0} and Socket.reference("HS").elasticity() == {}
    path.write_text('law = "normal_offset"\nbase = 1.0\n')
    with pytest.raises(InputError, match=r"mine\.toml: base: 1\.0 is not a number with a unit"):
        Socket.read(path)
    path.write_text('like = "XS"\n')
    with pytest.raises(InputError, match=r"mine\.toml: like: no socket 'XS'; allowed: HS"):
        Socket.read(path)
