"""The atlas: the calf's regions in sections that differ from it in known ways, and in unknown."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from geometry import LIMB, LOOPS, MIRRORED, TURNED, TURNED_AND_MIRRORED
from mesh_measures import jacobian_bounds

from calfsocket.imaging.atlas import AtlasLimb, carried
from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.imaging.smooth_map import fitted
from calfsocket.imaging.thickness import thickness
from calfsocket.io.errors import InputError
from calfsocket.meshes import curves, section
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket

Deformation = Callable[[Array], Array]
BELLIES = [region.name for region in LIMB.regions if region.tissue == "muscle"]
VESSELS = [region.name for region in LIMB.regions if region.tissue == "vessel"]
BONES = "tibia", "fibula"
ATLAS = thickness(LIMB)
LOOP = {name: Outline(curve) for name, curve in LOOPS.items()}


def linear(*rows: tuple[float, float]) -> Deformation:
    return lambda x: x @ np.array(rows).T


def bulged(x: Array) -> Array:
    """Move what is behind further back by up to 14 mm."""
    return x - np.outer(14 * np.exp(-((x - [-5, -50]) ** 2 / [1800, 1250]).sum(axis=1)), [0, 1])


def tapered(x: Array) -> Array:
    """Make what is behind narrower, what is in front wider: by a fifth at the skin."""
    return np.column_stack([x[:, 0] * (1 + 0.004 * x[:, 1]), x[:, 1]])


def waves(seed: int, most: float) -> Deformation:
    """Return a rotation by up to 0.2 rad, a scaling by 0.8 to 1.2, and waves of some 200 mm."""
    random = np.random.default_rng(seed)
    number, phase = random.normal(scale=0.03, size=(6, 2)), random.uniform(0, 2 * np.pi, 6)
    amplitude = random.normal(scale=random.uniform(1, most) / np.sqrt(6), size=(6, 2))
    turn, scale = random.uniform(-0.2, 0.2), random.uniform(0.8, 1.2)
    turned = linear((np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn)))
    return lambda x: scale * turned(x + np.sin(x @ number.T + phase) @ amplitude)


KNOWN: dict[str, Deformation] = {
    "smaller": linear((0.8, 0), (0, 0.8)),
    "larger": linear((1.25, 0), (0, 1.25)),
    "sheared": linear((1, 0.15), (0.1, 1)),
    "flat": linear((1.15, 0), (0, 0.85)),
    "bulged": bulged,
    "tapered": tapered,
    "waves": lambda x: x + 3 * np.sin(x @ np.array([[0.03, 0.0], [0.01, 0.04]])),
}


@cache
def deformed(name: str | int) -> dict[str, ClosedCurve]:
    """The calf's curves after a deformation, about the centroid of the skin."""
    move = (lambda x: x) if name == "" else KNOWN[name] if isinstance(name, str) else waves(name, 4)
    points = {
        key: move(curve.evaluate(curve.sample(0.5 if curve.perimeter < 40 else 1.0)))
        for key, curve in LOOPS.items()
    }
    center = shapely.Polygon(points["skin_outline"]).centroid
    return {key: curves.through(x - [center.x, center.y]) for key, x in points.items()}


def known_of(name: str | int = "", bones: tuple[str, ...] = BONES) -> SectionOutlines:
    """Skin and bones of a deformed calf."""
    loops = deformed(name)
    return SectionOutlines(
        skin=Outline(loops["skin_outline"], deviation_mm=0.1),
        bones={bone: Outline(loops[bone]) for bone in bones},
        frame=Frame("lateral", "anterior"),
        side="right",
    )


@cache
def limb_of(name: str | int = "") -> AtlasLimb:
    return carried(known_of(name))


def body(curve: ClosedCurve) -> shapely.Polygon:
    return shapely.Polygon(curve.evaluate(curve.sample(0.2)))


def dice(limb: Limb, loops: dict[str, ClosedCurve]) -> dict[str, float]:
    """Overlap of each belly with the true one."""
    found = limb_curves(limb)
    result = {}
    for region in limb.regions:
        if region.tissue == "muscle":
            one, other = body(found[region.outer]), body(loops[region.outer])
            result[region.name] = 2 * one.intersection(other).area / (one.area + other.area)
    return result


def moved_in(curve: ClosedCurve, by: float) -> ClosedCurve:
    return curves.offset(curve, lambda x: np.full(len(x), -by))


def test_the_calf_gives_itself() -> None:
    made = limb_of()
    assert min(dice(made.limb, LOOPS).values()) > 0.98
    assert 0.95 < made.smallest_determinant and made.largest_determinant < 1.05
    for layer, found in made.thickness.items():
        assert found.smallest == pytest.approx(ATLAS[layer].smallest, rel=0.1), layer
        assert found.median == pytest.approx(ATLAS[layer].median, rel=0.1), layer
    for name in (*VESSELS, *BONES):
        assert made.limb.areas[name] == pytest.approx(LIMB.areas[name], rel=0.02), name
    for name in ("skin", "subcutaneous_fat"):
        assert made.limb.areas[name] == pytest.approx(LIMB.areas[name], rel=0.01), name
    # 6 % more fascia, taken from the bellies, were 3.5 % more contact pressure.
    for name in BELLIES:
        assert made.limb.areas[name] == pytest.approx(LIMB.areas[name], rel=0.004), name
    fascia = LIMB.areas["deep_fascia"]
    assert made.limb.areas["deep_fascia"] == pytest.approx(fascia, rel=0.01)
    assert [region.name for region in made.limb.regions] == [each.name for each in LIMB.regions]
    assert made.limb.region_tags == LIMB.region_tags
    assert not made.warnings and not made.thinned


def test_every_region_says_where_it_comes_from() -> None:
    regions = {region.name: region for region in limb_of().limb.regions}
    assert regions["skin"].origin == "measured"
    assert regions["skin"].deviation_mm == 0.1
    assert regions["tibia"].origin == "measured"
    assert {regions[name].origin for name in (*BELLIES, *VESSELS, "deep_fascia")} == {"atlas"}
    assert len(limb_of().assumed) == 3
    assert "whatever the level" in limb_of().assumed[-1]


@pytest.mark.parametrize("name", KNOWN)
def test_bellies_of_a_limb_deformed_by_a_known_map(name: str) -> None:
    made = limb_of(name)
    overlap = dice(made.limb, deformed(name))
    assert len(overlap) == len(BELLIES)
    assert min(overlap.values()) > 0.9
    assert made.smallest_determinant > 0.3
    # Layers are as thick as in the calf, whatever the map does to areas.
    for layer in ("skin", "crural fascia", "septa", "sheaths"):
        assert made.thickness[layer].median == pytest.approx(ATLAS[layer].median, rel=0.1), layer
        assert made.thickness[layer].smallest > 0.9 * ATLAS[layer].smallest, layer
    for vessel in VESSELS:
        assert made.limb.areas[vessel] == pytest.approx(LIMB.areas[vessel], rel=0.02), vessel


@pytest.mark.parametrize("seed", range(12))
def test_no_fold_in_limbs_of_many_shapes(seed: int) -> None:
    """The limb's own checks hold in it: curves apart, nested, not crossing."""
    made = limb_of(seed)
    assert made.smallest_determinant > 0.2
    assert made.thickness["septa"].smallest > 0.5
    assert made.thickness["crural fascia"].smallest > 0.65
    overlap = list(dice(made.limb, deformed(seed)).values())
    # Points may have slid along the outlines, which outlines do not show.
    assert len(overlap) == len(BELLIES) and np.mean(overlap) > 0.87


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 160))
def test_no_fold_in_many_more_limbs(seed: int) -> None:
    made = limb_of(seed)
    assert made.smallest_determinant > 0.1
    assert made.thickness["septa"].smallest > 0.5


@pytest.mark.parametrize("moved", [MIRRORED, TURNED, TURNED_AND_MIRRORED])
def test_a_left_or_turned_limb_is_the_same(moved: tuple[np.ndarray, tuple[str, str]]) -> None:
    matrix, axes = moved
    mirrored = np.linalg.det(matrix) < 0

    def turned(outline: Outline) -> Outline:
        points = outline.curve.evaluate(outline.curve.knots[:-1]) @ matrix.T
        return replace(outline, curve=curves.through(points[::-1] if mirrored else points))

    plain = known_of("bulged")
    made = carried(
        SectionOutlines(
            skin=turned(plain.skin),
            bones={name: turned(bone) for name, bone in plain.bones.items()},
            frame=Frame(*axes),
            side="left" if mirrored else "right",
        )
    )
    assert (made.limb.side, made.limb.seen_from) == ("left" if mirrored else "right", "above")
    there = limb_curves(limb_of("bulged").limb)
    for name, curve in limb_curves(made.limb).items():
        back = shapely.Polygon(curve.evaluate(curve.sample(0.2)) @ matrix)
        assert back.hausdorff_distance(body(there[name])) < 0.15, name


def ring(radius: float, number: int, turn: float = 0.0) -> Array:
    angle = 2 * np.pi * np.arange(number) / number + turn
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def test_small_steps_do_not_fold_where_one_thin_plate_does() -> None:
    """A disc turned within a ring that stays: exact at the points, one-to-one between them."""
    source = np.concatenate([ring(50, 40), ring(25, 30)])
    target = np.concatenate([ring(50, 40), ring(25, 30, turn=2.0)])
    samples = np.concatenate([ring(radius, 200) for radius in np.arange(1, 50)])
    smooth, determinant = fitted(source, target, samples)
    assert len(smooth.steps) > 4 and determinant.min() > 0.1
    assert smooth(source) == pytest.approx(target, abs=1e-6)
    single = replace(smooth, steps=(replace(smooth.steps[0], displacements=target - source),))
    assert single.determinant(samples).min() < 0
    # The determinant is that of the map: compared with differences.
    x, h = samples[::97], 1e-5
    columns = [(smooth(x + step) - smooth(x - step)) / (2 * h) for step in np.eye(2) * h]
    assert smooth.determinant(x) == pytest.approx(
        np.linalg.det(np.stack(columns, axis=-1)), rel=1e-6
    )


def test_points_that_change_places_fold_whatever_the_steps() -> None:
    source = np.concatenate([ring(50, 40), [[-1.0, 0.0], [1.0, 0.0]]])
    target = np.concatenate([ring(50, 40), [[1.0, 0.0], [-1.0, 0.0]]])
    with pytest.raises(InputError, match=r"the atlas would fold near \(.*\) mm"):
        fitted(source, target, np.concatenate([ring(radius, 90) for radius in np.arange(0.2, 50)]))


@pytest.mark.parametrize(("by", "thinner"), [(1.5, False), (3.5, True), (4.5, True)])
def test_layers_thin_out_where_skin_lies_on_bone(by: float, thinner: bool) -> None:
    """The calf has 5.6 mm of soft tissue over the tibia."""
    plain = known_of()
    made = carried(replace(plain, skin=Outline(moved_in(plain.skin.curve, by))))
    assert bool(made.thinned) is thinner
    if thinner:
        (words,) = made.thinned
        assert "over the tibia at 1" in words
        assert made.thickness["skin"].smallest < 1.3
        assert made.thickness["fat"].smallest < 0.5
    assert made.thickness["skin"].median == pytest.approx(1.6, rel=0.02)
    assert made.thickness["fat"].smallest > 0.15


def test_fat_reaches_down_to_the_tibia_under_a_skin_that_is_far_from_it() -> None:
    """Over the medial face of the tibia is no muscle, so that the fascia lies on the bone."""
    plain = known_of()
    made = carried(replace(plain, skin=Outline(moved_in(plain.skin.curve, -12.0))))
    envelope = body(limb_curves(made.limb)["fascia_outer"]).exterior
    face = LOOPS["tibia"].evaluate(LOOPS["tibia"].sample(0.5))
    angle = np.rad2deg(np.arctan2(face[:, 1], face[:, 0]))
    # Points of the medial face: they are those that look away from the muscles.
    outward = LOOPS["tibia"].normal(LOOPS["tibia"].sample(0.5)) @ [-0.75, 0.66]
    medial = face[(outward > 0.95) & (angle > 108) & (angle < 132)]
    assert len(medial) > 10
    gap = shapely.distance(shapely.points(medial), envelope)
    assert gap.max() < 1.5 and gap.min() > 0.5


def test_the_marrow_cavity() -> None:
    cavity = Outline(moved_in(LOOPS["tibia_medullary"], 0.8))
    made = carried(replace(known_of(), cavities={"tibia": cavity, "fibula": cavity}))
    assert limb_curves(made.limb)["tibia_medullary"].area == pytest.approx(
        cavity.curve.area, rel=1e-3
    )
    assert made.warnings == ("the marrow cavity of the fibula is not used: it is solid",)
    loops = limb_curves(limb_of("flat").limb)
    assert body(loops["tibia"]).exterior.distance(body(loops["tibia_medullary"])) > 1.1
    true = body(deformed("flat")["tibia_medullary"])
    found = body(loops["tibia_medullary"])
    assert 2 * found.intersection(true).area / (found.area + true.area) > 0.95


def test_given_fat() -> None:
    plain = known_of()
    thin = carried(replace(plain, skin=Outline(moved_in(plain.skin.curve, 1.5))), fat_thickness=3.4)
    assert min(dice(thin.limb, LOOPS).values()) > 0.9
    # A third of the limb around the muscles of the calf is fat.
    much = replace(
        plain,
        skin=Outline(moved_in(plain.skin.curve, -15.0)),
        muscle_envelope=Outline(deformed("")["fascia_outer"]),
    )
    fat = carried(much)
    assert min(dice(fat.limb, LOOPS).values()) > 0.97
    assert fat.thickness["fat"].median == pytest.approx(ATLAS["fat"].median + 15, rel=0.05)
    regions = {region.name: region for region in fat.limb.regions}
    assert regions["deep_fascia"].origin == "measured"


def test_veins_in_thin_fat() -> None:
    """An assumed envelope gives way to them; under a measured one they are smaller."""
    plain = known_of()
    made = carried(replace(plain, skin=Outline(moved_in(plain.skin.curve, 2.5))), fat_thickness=2.0)
    veins = "great_saphenous_vein", "small_saphenous_vein"
    for vein in veins:
        assert made.limb.areas[vein] == pytest.approx(LIMB.areas[vein], rel=0.02)
    assert not made.warnings
    envelope = Outline(moved_in(LOOPS["skin_outline"], 4.0))
    bones = {"tibia": Outline(moved_in(LOOPS["tibia"], 1.0)), "fibula": LOOP["fibula"]}
    made = carried(replace(plain, muscle_envelope=envelope, bones=bones))
    assert [line.split(" ")[0] for line in made.warnings] == list(veins)
    assert all("the fat is" in line for line in made.warnings)
    for vein in veins:
        assert 1.0 < made.limb.areas[vein] < 0.9 * LIMB.areas[vein]


def test_an_envelope_of_the_muscles_alone_is_widened_around_the_bones() -> None:
    envelope = shapely.Polygon(LOOPS["fascia_outer"].evaluate(LOOPS["fascia_outer"].sample(0.5)))
    muscles = envelope.difference(body(LOOPS["tibia"]).buffer(1.0)).buffer(-2).buffer(2)
    points = shapely.get_coordinates(muscles.simplify(0.05).segmentize(1.0).exterior)[:-1][::-1]
    made = carried(replace(known_of(), muscle_envelope=Outline(curves.through(points))))
    (warning,) = made.warnings
    assert "envelope was moved by up to" in warning
    assert min(dice(made.limb, LOOPS).values()) > 0.95


def test_muscles_of_a_coarse_segmentation_that_reach_the_skin() -> None:
    outside = Outline(moved_in(LOOPS["skin_outline"], -1.0))
    made = carried(replace(known_of(), muscle_envelope=outside))
    assert any("room for the skin" in line for line in made.warnings)
    assert 0.15 < made.thickness["fat"].smallest < 0.6
    assert made.thinned


def test_bellies_and_vessels_of_the_source_are_used_as_they_are() -> None:
    loops = deformed("waves")
    given = {"soleus": "muscle", "gastrocnemius_medial_head": "muscle", "fibular_artery": "vessel"}
    outlines = known_of("waves")
    made = carried(
        replace(outlines, regions={name: (t, Outline(loops[name])) for name, t in given.items()})
    )
    regions = {region.name: region for region in made.limb.regions}
    assert {regions[name].origin for name in given} == {"measured"}
    assert made.limb.areas["soleus"] == pytest.approx(loops["soleus"].area, rel=1e-3)
    with_them, without = (dice(each.limb, loops) for each in (made, limb_of("waves")))
    assert min(with_them.values()) > 0.93
    neighbours = ("tibialis_posterior", "flexor_hallucis_longus", "gastrocnemius_lateral_head")
    assert all(with_them[name] > without[name] for name in neighbours)


def test_bellies_that_touch_get_a_septum() -> None:
    loops = deformed("")
    names = "soleus", "gastrocnemius_medial_head", "gastrocnemius_lateral_head"
    touching = {name: ("muscle", Outline(moved_in(loops[name], -0.4))) for name in names}
    made = carried(replace(known_of(), regions=touching))
    assert made.thickness["septa"].smallest > 0.4
    assert made.thickness["septa"].median == pytest.approx(0.75, abs=0.15)
    deviation = {region.name: region.deviation_mm for region in made.limb.regions}
    assert all(0.2 < deviation[name] < 3 for name in names)


def test_a_region_that_the_atlas_lacks_is_added() -> None:
    extra = {
        "lipoma": ("fat", Outline(curves.ellipse((20.0, 40.0), (4.0, 3.0), 10.0))),
        "spare_vein": ("vessel", Outline(curves.ellipse((25.0, -48.0), (1.2, 1.0), 0.0))),
    }
    made = carried(replace(known_of(), regions=extra))
    regions = {region.name: region for region in made.limb.regions}
    assert "lipoma" in regions["deep_fascia"].holes
    assert "spare_vein" in regions["subcutaneous_fat"].holes
    assert made.limb.areas["lipoma"] == pytest.approx(12 * np.pi, rel=1e-3)


def test_a_scan_of_the_skin_alone() -> None:
    made = carried(known_of("smaller", bones=()))
    regions = {region.name: region for region in made.limb.regions}
    assert regions["tibia"].origin == regions["fibula"].origin == "assumed"
    assert any(line.startswith("tibia and fibula: the atlas's") for line in made.assumed)
    assert made.limb.areas["tibia"] == pytest.approx(0.64 * LIMB.areas["tibia"], rel=0.02)
    assert min(dice(made.limb, deformed("smaller")).values()) > 0.9


def test_landmarks_turn_the_bones_under_the_skin() -> None:
    turn = 0.3
    loops = {
        name: curves.through(
            linear((np.cos(turn), -np.sin(turn)), (np.sin(turn), np.cos(turn)))(
                curve.evaluate(curve.sample(1.0))
            )
        )
        for name, curve in deformed("").items()
    }
    scan = replace(known_of(bones=()), skin=Outline(loops["skin_outline"]))
    for known in (
        {"crest": 100.8 + np.rad2deg(turn)},
        {"crest": 100.8 + np.rad2deg(turn), "fibular_head": 2.0 + np.rad2deg(turn)},
    ):
        made = carried(scan, **known)
        assert min(dice(made.limb, loops).values()) > 0.94
        assert "crest" in made.assumed[1]


def test_where_the_fibula_has_ended_muscles_fill_its_place() -> None:
    made = carried(known_of("bulged", bones=("tibia",)))
    assert "fibula" not in made.limb.tissues
    assert made.warnings == ("the section has no fibula: the muscles around it fill its place",)
    filled = sum(made.limb.areas[name] for name in BELLIES)
    before = sum(limb_of("bulged").limb.areas[name] for name in BELLIES)
    assert filled - before > 0.5 * limb_of("bulged").limb.areas["fibula"]


def test_near_the_knee_it_is_told_what_is_a_guess() -> None:
    """Bones that fill much of the section leave no room for some regions; the rest is a limb."""
    plain = known_of()
    swollen = {
        "tibia": curves.ellipse((-8.0, 18.0), (33.0, 28.0), 20.0),
        "fibula": curves.ellipse((38.0, -8.0), (8.0, 7.0), 0.0),
    }
    bones = {name: Outline(curve) for name, curve in swollen.items()}
    made = carried(replace(plain, bones=bones))
    assert "the tibia is 29% of the section" in made.warnings[0]
    assert any("is left out" in line or "is narrow" in line for line in made.warnings[1:])
    assert made.smallest_determinant > 0.02


@pytest.mark.parametrize(("name", "size"), [("smaller", "coarse"), ("bulged", "paper")])
def test_it_can_be_meshed(name: str, size: str) -> None:
    mesh = section.build(limb_of(name).limb, Socket.reference("HS"), mesh_size(size))
    assert jacobian_bounds(mesh.coordinates)[0].min() > 0


def test_thin_layers_over_bone_can_be_meshed() -> None:
    plain = known_of()
    made = carried(replace(plain, skin=Outline(moved_in(plain.skin.curve, 4.0))))
    mesh = section.build(made.limb, Socket.reference("HS"), mesh_size("coarse"))
    assert jacobian_bounds(mesh.coordinates)[0].min() > 0


@pytest.mark.parametrize("given", [{"skin_thickness": 0.0}, {"fat_thickness": -1.0}])
def test_a_thickness_has_a_range(given: dict[str, float]) -> None:
    with pytest.raises(InputError, match="it must be 0"):
        carried(known_of(), **given)
