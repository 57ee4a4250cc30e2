"""The regions of the reference calf carried into another section of a leg."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calfsocket.imaging.aligned import NOT_REGIONS, AlignedSection
from calfsocket.imaging.correspondence import (
    Correspondence,
    around_bones,
    bones_by_skin,
    smooth_map,
    with_layers,
)
from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.layers import Fat, Thinned, layers
from calfsocket.imaging.outlines import SectionOutlines
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.regions import RegionOrigin, Regions
from calfsocket.imaging.shapes import polygon
from calfsocket.imaging.thickness import Thickness, thickness
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array
from calfsocket.meshes.limb import Limb

#: Where bone lies less than the first deep below the fat of the atlas, mm, no muscle is between
#: them; where it lies deeper than the second, some is.
MUSCLE = 1.0, 3.0
_BARE = "and down to the bone where no muscle lies between them"
#: A tibia with so many times the share of the section that it has in the atlas is near the knee.
MUCH_BONE = 2.5
#: Thickness that may be asked for, mm.
SKIN_THICKNESS, FAT_THICKNESS, SEPTUM = (0.2, 10.0), (0.3, 100.0), (0.2, 5.0)


@dataclass(frozen=True)
class AtlasLimb:
    """A limb with regions of the atlas.

    Attributes
    ----------
    limb : Limb
        The section.
    smallest_determinant, largest_determinant : float
        By how much the map shrinks and enlarges areas where it is used.
    steps : int
        Of which the map is composed.
    origin : mapping of str to RegionOrigin
        By region.
    assumed : tuple of str
        What the source does not have, and where it is from.
    thinned : tuple of str
        Places where skin and fascia are thinner than in the atlas for want of room.
    warnings : tuple of str
        What was changed or left out.
    """

    limb: Limb
    smallest_determinant: float
    largest_determinant: float
    steps: int
    origin: Mapping[str, RegionOrigin]
    assumed: tuple[str, ...]
    thinned: tuple[str, ...]
    warnings: tuple[str, ...]

    @cached_property
    def thickness(self) -> dict[str, Thickness]:
        """Thickness of skin, fat, crural fascia, septa and sheaths of bones, measured."""
        return thickness(self.limb)


def carried(
    outlines: SectionOutlines,
    reference: Limb | None = None,
    *,
    title: str = "A limb",
    skin_thickness: float | None = None,
    fat_thickness: float | None = None,
    crest: float | None = None,
    fibular_head: float | None = None,
    septum: float | None = None,
) -> AtlasLimb:
    """Carry the regions of a reference limb into a section.

    Parameters
    ----------
    outlines : SectionOutlines
        What is known of the section: at least its skin.
    reference : Limb, optional
        The atlas; the calf of the package by default.
    title : str
        Of the new limb.
    skin_thickness : float, optional
        mm; by default the atlas's.
    fat_thickness : float, optional
        Mean around the section, mm, where no envelope of the muscles is given; by default the
        atlas's times the square root of the ratio of the sections' areas.
    crest, fibular_head : float, optional
        Anatomical angles, degrees, of the crest of the tibia and of the fibula, for a section of
        which only the skin is known.
    septum : float, optional
        Between muscles of the section that touch, mm; by default the median of the atlas's septa.

    Raises
    ------
    InputError
        In one line with the place, where outlines contradict each other or leave no room.
    """
    _check_range("skin thickness", skin_thickness, SKIN_THICKNESS)
    _check_range("fat thickness", fat_thickness, FAT_THICKNESS)
    _check_range("septum", septum, SEPTUM)
    atlas = Reference.calf() if reference is None else Reference.of(reference)
    _check_regions(atlas, outlines)
    section = AlignedSection.of(outlines)
    skin, assumed = atlas.skin_thickness, []
    if skin_thickness is not None:
        skin = skin_thickness
    elif outlines.skin_thickness is not None:
        skin = float(np.clip(outlines.skin_thickness, *SKIN_THICKNESS))
    if outlines.skin_thickness is None or skin_thickness is not None:
        assumed.append(f"skin: {skin:.2g} mm thick")
    bones = {name: section.rings[name] for name in outlines.bones}
    if not bones:
        given = {"crest": crest, "fibular_head": fibular_head}
        known = {name: angle for name, angle in given.items() if angle is not None}
        bones = bones_by_skin(atlas, section.skin, known)
        by = " and ".join(["the shape of the skin", *(name.replace("_", " ") for name in known)])
        assumed.append(f"tibia and fibula: the atlas's, placed by {by}")
    warnings = list(_bones_that_differ(atlas, section.skin, bones))
    for name in [name for name in atlas.bones if name not in bones]:
        atlas = atlas.without(name)
    envelope = section.rings.get("envelope")
    found = around_bones(atlas, "skin", section.skin, bones)
    if envelope is None:
        scale = np.sqrt(polygon(section.skin).area / polygon(atlas.skin_ring).area)
        if fat_thickness is not None:
            scale = fat_thickness / atlas.fat_thickness
        assumed.append(f"fat: {scale:.2f} times as thick as the atlas's, {_BARE}")
    else:
        scale = 1.0  # not used: what lies outside the envelope is fat
    muscles = {
        name: section.rings[name] for name, (tissue, _) in outlines.regions.items()
        if tissue == "muscle" or name in atlas.inlays
    }  # fmt: skip
    under = layers(
        section.skin, skin, lambda s: _fat(atlas, found, s, scale), bones, muscles, envelope,
        section.at,
    )  # fmt: skip
    if envelope is not None:
        found = around_bones(atlas, "envelope", under.envelope_ring, bones)
    bellies = {name: ring for name, ring in muscles.items() if name in atlas.bellies}
    outer = found
    found = with_layers(outer, atlas, section.skin, under.envelope_ring, bellies)
    try:
        smooth, determinant = smooth_map(found, atlas, section.at)
    except InputError:
        if not bellies:
            raise
        warnings.append(
            "the map does not follow the muscles of the source, which lie too differently from the"
            " atlas's: their neighbours are cut back instead"
        )
        found = with_layers(outer, atlas, section.skin, under.envelope_ring, {})
        smooth, determinant = smooth_map(found, atlas, section.at)
    if septum is None:
        septum = thickness(atlas.limb)["septa"].median
    regions = Regions(atlas, section, bones, under, smooth, found, septum)
    layered = atlas.skin.name, atlas.fat.name, atlas.fascia.name
    if any(each.origin == "atlas" for name, each in regions.origin.items() if name not in layered):
        assumed.append(
            "muscles, vessels and fascia that the source lacks: of the atlas, which is one section"
            " of a calf just above mid-calf, whatever the level"
        )
    return AtlasLimb(
        regions.limb(title),
        float(determinant.min()),
        float(determinant.max()),
        len(smooth.steps),
        regions.origin,
        tuple(assumed),
        tuple(_words(each, section) for each in under.thinned),
        (*warnings, *regions.warnings),
    )


def _check_range(name: str, value: float | None, allowed: tuple[float, float]) -> None:
    low, high = allowed
    if value is not None and not low <= value <= high:
        raise InputError(f"{name}: is {value:g} mm; it must be {low:g} to {high:g}")


def _check_regions(atlas: Reference, outlines: SectionOutlines) -> None:
    made = {atlas.skin.name, atlas.fat.name, atlas.fascia.name, *atlas.bones, *NOT_REGIONS}
    for name, (tissue, _) in outlines.regions.items():
        if name in made or tissue in ("skin", "bone"):
            raise InputError(
                f"region {name}: skin, bones and the layers between are not given as regions; leave"
                " it out, or give it as what it is"
            )


def _bones_that_differ(atlas: Reference, skin: Ring, bones: Mapping[str, Ring]) -> Iterator[str]:
    """Yield what bones tell of a level at which the atlas is not at home."""
    for name in [name for name in atlas.bones if name not in bones]:
        yield f"the section has no {name}: the muscles around it fill its place"
    share, own = (
        polygon(tibia).area / polygon(around).area
        for tibia, around in ((bones["tibia"], skin), (atlas.ring("tibia"), atlas.skin_ring))
    )
    if share > MUCH_BONE * own:
        yield (
            f"the tibia is {share:.0%} of the section, and {own:.0%} of the atlas, which is one"
            " section just above mid-calf: near the knee the places of single muscles are a guess"
        )


def _fat(atlas: Reference, found: Correspondence, s: Array, scale: float) -> Fat:
    """Return the fat that the atlas has under places of the section's skin, so many times."""
    own = found.on_skin_of_atlas(s, atlas.skin_ring)
    depth = atlas.depth(own)
    fascia = atlas.depth_of_bone(own) - depth
    bare = np.clip((MUSCLE[1] - fascia) / (MUSCLE[1] - MUSCLE[0]), 0.0, 1.0)
    return Fat(scale * (depth - atlas.skin_thickness), bare**2 * (3 - 2 * bare), fascia)


def _words(thinned: Thinned, section: AlignedSection) -> str:
    return (
        f"over the {thinned.over} at {section.at(thinned.place)}, for {thinned.length:.0f} mm:"
        f" skin {thinned.skin:.2f} mm, fat {thinned.fat:.2f} mm"
    )
