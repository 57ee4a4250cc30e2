"""The regions of the reference calf carried into another section of a leg."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calfsocket.imaging.aligned import AlignedSection
from calfsocket.imaging.correspondence import (
    Correspondence,
    around_bones,
    bones_by_skin,
    smooth_map,
    with_layers,
)
from calfsocket.imaging.layers import Fat, Thinned, layers
from calfsocket.imaging.outlines import SectionOutlines
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.regions import RegionOrigin, Regions
from calfsocket.imaging.shapes import polygon
from calfsocket.imaging.thickness import Thickness, thickness
from calfsocket.meshes.curves import Array
from calfsocket.meshes.limb import Limb

#: Where bone lies less than the first deep below the fat of the atlas, mm, no muscle is between
#: them; where it lies deeper than the second, some is.
MUSCLE = 1.0, 3.0


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
    thinned : tuple of str
        Places where skin and fascia are thinner than in the atlas for want of room, in words.
    warnings : tuple of str
        What whoever uses the limb should know.
    """

    limb: Limb
    smallest_determinant: float
    largest_determinant: float
    steps: int
    origin: Mapping[str, RegionOrigin]
    thinned: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

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

    Raises
    ------
    InputError
        In one line with the place, where outlines contradict each other or leave no room.
    """
    atlas = Reference.calf() if reference is None else Reference.of(reference)
    section = AlignedSection.of(outlines)
    warnings = []
    bones = {name: section.rings[name] for name in outlines.bones}
    if not bones:
        given = {"crest": crest, "fibular_head": fibular_head}
        known = {name: angle for name, angle in given.items() if angle is not None}
        bones = bones_by_skin(atlas, section.skin, known)
        by = " and ".join(["the shape of the skin", *(key.replace("_", " ") for key in known)])
        warnings.append(f"tibia and fibula are assumed: the atlas's, placed by {by}")
    for name in [name for name in atlas.bones if name not in bones]:
        warnings.append(f"the section has no {name}: the muscles around it fill its place")
        atlas = atlas.without(name)
    envelope = section.rings.get("envelope")
    found = around_bones(atlas, "skin", section.skin, bones)
    under = layers(
        section.skin, skin_thickness or atlas.skin_thickness,
        lambda s: _fat(atlas, found, s, fat_thickness), bones, envelope, section.at,
    )  # fmt: skip
    if envelope is not None:
        found = around_bones(atlas, "envelope", under.envelope_ring, bones)
    bellies = {name: section.rings[name] for name in outlines.regions if name in atlas.bellies}
    found = with_layers(found, atlas, section.skin, under.envelope_ring, bellies)
    smooth, determinant = smooth_map(found, atlas, section.at)
    regions = Regions(atlas, section, bones, under, smooth, found)
    return AtlasLimb(
        regions.limb(title),
        float(determinant.min()),
        float(determinant.max()),
        len(smooth.steps),
        regions.origin,
        tuple(_words(each, section) for each in under.thinned),
        (*warnings, *regions.warnings),
    )


def _fat(atlas: Reference, found: Correspondence, s: Array, mean: float | None) -> Fat:
    """Return the fat that the atlas has under places of the section's skin."""
    own = found.on_skin_of_atlas(s, atlas.skin_ring)
    scale = np.sqrt(polygon(found.rings["skin"]).area / polygon(atlas.skin_ring).area)
    if mean is not None:
        scale = mean / atlas.fat_thickness
    depth = atlas.depth(own)
    fascia = atlas.depth_of_bone(own) - depth
    bare = np.clip((MUSCLE[1] - fascia) / (MUSCLE[1] - MUSCLE[0]), 0.0, 1.0)
    return Fat(scale * (depth - atlas.skin_thickness), bare**2 * (3 - 2 * bare), fascia)


def _words(thinned: Thinned, section: AlignedSection) -> str:
    return (
        f"over the {thinned.over} at {section.at(thinned.place)}, for {thinned.length:.0f} mm:"
        f" skin {thinned.skin:.2f} mm, fat {thinned.fat:.2f} mm"
    )
