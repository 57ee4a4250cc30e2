"""A limb of several levels that solves in a second a level: the tiny study's oval, tapered."""

from pathlib import Path

from calfsocket.meshes.levels import Level, LimbLevels
from calfsocket.meshes.limb import EllipseCurve, Limb, Provenance
from tiny_study import tiny_limb

HEIGHT = 40.0
SHARES = (0.2, 0.4, 0.5, 0.8)
STUDY = """
[study]
limb = "mine.json"
sockets = ["tight"]
materials = ["combined"]
[model]
size = "coarse"
[sockets.tight]
law = "normal_offset"
base = "0.15 mm"
wall_thickness = "2 mm"
bumps = [{ center = "40 deg", width = "25 deg", amplitude = "0.15 mm" }]
"""


def section(share: float) -> Limb:
    """Return the section at a share of the height; its plane has an axis along x of the source."""
    limb, size = tiny_limb(), 0.9 + 0.2 * share
    curves = {
        name: curve.model_copy(update={"semi_axes": tuple(size * a for a in curve.semi_axes)})
        for name, curve in limb.curves.items()
        if isinstance(curve, EllipseCurve)
    }
    source = Provenance(
        files={"leg.stl": "0" * 64},
        height=share,
        height_mm=HEIGHT * share,
        origin=(100.0 + HEIGHT * share, 5.0, 0.0),
        normal=(1.0, 0.0, 0.0),
        anterior=(0.0, 0.0, 1.0),
        tolerance_mm=0.2,
        program="test",
    )
    regions = tuple(each.model_copy(update={"area": None}) for each in limb.regions)
    values = dict(limb) | {"curves": curves, "regions": regions, "source": source}
    return Limb(**values | {"side": "right", "axes": {"+x": "lateral", "+y": "anterior"}})


def levels(shares: tuple[float, ...] = SHARES) -> LimbLevels:
    """Return the limb."""
    return LimbLevels(
        title="an oval limb",
        levels=tuple(
            Level(
                height=share, height_mm=HEIGHT * share, file=f"mine_{share:.3f}.json",
                limb=section(share),
            )
            for share in shares
        ),
    )  # fmt: skip


def write_study(folder: Path, text: str = STUDY) -> Path:
    """Write the limb and a study over it; return the study's path."""
    folder.mkdir(exist_ok=True)
    levels().write(folder / "mine.json")
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"
