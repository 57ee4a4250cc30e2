"""The outlines of one section, as a source gives them: what an atlas or a mesh starts from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.frame import Frame

Origin = Literal["measured", "assumed"]


@dataclass(frozen=True)
class Outline:
    """A closed smooth curve and where it comes from.

    Attributes
    ----------
    curve : ClosedCurve
        mm, in the section's axes, counter-clockwise.
    origin : {"measured", "assumed"}
        Whether the source has it, or the atlas placed it.
    deviation_mm : float
        Largest distance of the source's points from the curve; 0 where it is assumed.
    """

    curve: ClosedCurve
    origin: Origin = "measured"
    deviation_mm: float = 0.0


@dataclass(frozen=True)
class SectionOutlines:
    """What is known of a transverse section.

    The origin is the centroid of the skin's outline; `frame` says what the axes point to.

    Attributes
    ----------
    skin : Outline
        Outer face of the skin.
    bones : mapping of str to Outline
        Periosteal outlines by name: "tibia", "fibula" or others; empty for a scan of the skin.
    cavities : mapping of str to Outline
        Marrow cavities by the name of their bone, where the source has them.
    muscle_envelope : Outline, optional
        Around all muscles and their fascia: fat lies between it and the skin.
    skin_thickness : float, optional
        Mean, mm, where the source has the skin as a layer.
    regions : mapping of str to (tissue, Outline)
        Further regions that the source has: bellies, vessels.
    frame : Frame
        What +x and +y point to.
    side : {"left", "right"}, optional
        Of the body.
    """

    skin: Outline
    bones: Mapping[str, Outline] = field(default_factory=dict)
    cavities: Mapping[str, Outline] = field(default_factory=dict)
    muscle_envelope: Outline | None = None
    skin_thickness: float | None = None
    regions: Mapping[str, tuple[str, Outline]] = field(default_factory=dict)
    frame: Frame = field(default_factory=Frame)
    side: Literal["left", "right"] | None = None
