"""Limbs whose skin or fat is thicker or thinner than in their file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import shapely
from pydantic import AfterValidator, Field, ValidationError, WithJsonSchema
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict, first_problem
from calfsocket.io.units import LENGTH, SHARE, unit_of
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.limb import SAMPLE_STEP, Limb, limb_curves

#: Least and largest thickness, as shares of the limb's own: what lies deeper has to make room.
RANGE = 0.5, 2.0
#: Largest distance of the points of a curve that is moved, mm, and digits of these and of factors.
STEP, DIGITS = 2.0, 4
#: Distance of the points that the map of what lies deeper goes through, mm.
CONTROL_STEP = 3.0
_NO_ROOM = "skin and fat so thick leave no room"


def _parsed(text: str) -> tuple[float, bool]:
    """Return the value of a thickness, mm or a share, and whether it is a share."""
    unit = unit_of(text)
    if SHARE.has(unit):
        return SHARE.parse(text), True
    if LENGTH.has(unit):
        return LENGTH.parse(text), False
    raise ValueError(f"{text!r} is neither a length nor a share; write e.g. '1.8 mm' or '120 %'")


def _is_thickness(text: str) -> str:
    if not _parsed(text)[0] > 0:
        raise ValueError(f"is {text!r}; it must be above 0")
    return text


_UNITS = "|".join((*LENGTH.allowed, *SHARE.allowed))
Amount = Annotated[
    str,
    AfterValidator(_is_thickness),
    WithJsonSchema(
        {
            "type": "string",
            "pattern": rf"^\s*\+?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*({_UNITS})\s*$",
            "description": "a length, the mean along the limb, or a share of the limb's own",
            "examples": ["1.8 mm", "120 %"],
        }
    ),
]


class LayerThickness(Strict):
    """How thick the limb's skin and fat are, in the place of what its file says.

    The skin's surface and the bones stay where they are; what lies between moves. Fat stays as
    thick as it is where there is no muscle between it and a bone.

    Attributes
    ----------
    skin_thickness, fat_thickness : str, optional
        A length, which is the mean along the limb, or a share of the limb's own, such as 120 %.
    """

    skin_thickness: Annotated[Amount | None, Field(description="of the skin")] = None
    fat_thickness: Annotated[Amount | None, Field(description="of the fat under it")] = None

    def of(self, limb: Limb) -> Limb:
        """Return a limb with layers so thick; the limb itself where nothing is said of them.

        Raises
        ------
        InputError
            If the limb has no such layer, or it would leave no room for what lies deeper.
        """
        said = {key: text for key, text in self if text is not None}
        if not said:
            return limb
        if limb.mesh is not None:
            raise InputError(
                f"{next(iter(said))}: the limb has a mesh of its own, which is solved as it is;"
                " remove the key, or import outlines in the place of the mesh"
            )
        under = _Under(limb)
        factors = {key: under.factor(key, text) for key, text in said.items()}
        if all(factor == 1.0 for factor in factors.values()):
            return limb
        return under.changed(factors.get("skin_thickness", 1.0), factors.get("fat_thickness", 1.0))


@dataclass(frozen=True, eq=False)
class _Under:
    """The layers under the skin of a limb, and what lies deeper."""

    limb: Limb

    @cached_property
    def loops(self) -> dict[str, ClosedCurve]:
        """Its curves."""
        return limb_curves(self.limb)

    @cached_property
    def inner(self) -> str:
        """Curve under the skin; empty where the limb has none."""
        return self._under(self.limb.contact_boundary, "skin")

    @cached_property
    def envelope(self) -> str:
        """Curve under the fat; empty where the limb has none."""
        return self._under(self.inner, "fat")

    def _under(self, outer: str, tissue: str) -> str:
        """Return the curve under a layer: its largest hole, for vessels may lie in it."""
        for region in self.limb.regions:
            if region.outer == outer and region.tissue == tissue and region.holes:
                under = max(region.holes, key=lambda name: self.loops[name].area)
                return "" if under in self.hard else under
        return ""

    @cached_property
    def hard(self) -> tuple[str, ...]:
        """Curves that stay where they are: of bones, and where the limb is fixed."""
        bones = (each.loops for each in self.limb.regions if each.tissue == "bone")
        names = (name for loops in bones for name in loops)
        return tuple(dict.fromkeys((*names, self.limb.fixed_boundary)))

    def factor(self, key: str, text: str) -> float:
        """Return how many times its own thickness a layer is to have."""
        above, below = {
            "skin_thickness": (self.limb.contact_boundary, self.inner),
            "fat_thickness": (self.inner, self.envelope),
        }[key]
        layer = key.partition("_")[0]
        if not below:
            raise InputError(f"{key}: no {layer} lies all around this limb; remove the key")
        points = self._sampled(below, STEP)
        own = float(np.linalg.norm(points - _nearest(self.loops[above], points), axis=1).mean())
        value, is_share = _parsed(text)
        factor = value if is_share else round(value / own, DIGITS)
        least, most = RANGE
        if not least <= factor <= most:
            raise InputError(
                f"{key}: is {text}; it must be {100 * least:g} % to {100 * most:g} % of the limb's"
                f" own, {least * own:.2f} mm to {most * own:.2f} mm"
            )
        return factor

    def changed(self, skin: float, fat: float) -> Limb:
        """Return the limb with so many times the thickness of skin and fat."""
        layers = tuple(name for name in (self.inner, self.envelope) if name)
        target = self._layers({name: self._points(name) for name in layers}, skin, fat)
        known = (self.limb.contact_boundary, *layers, *self.hard)
        free = {name: self._points(name) for name in self.loops if name not in known}
        around = shapely.Polygon(self._sampled(layers[-1], SAMPLE_STEP))
        deep = {name: x for name, x in free.items() if shapely.contains_xy(around, *x[0])}
        in_layers = {name: x for name, x in free.items() if name not in deep}
        # A smooth map of both would go on below the fat as it stretches it.
        target |= self._mapped(deep, layers[-1:], self.hard, skin, fat)
        target |= self._mapped(in_layers, layers, (), skin, fat)
        content = self.limb.model_dump()
        content["layers"] = None  # the file's own, of which its offsets are made
        content["curves"] = {
            name: {"type": "spline", "points": np.round(target[name], DIGITS).tolist()}
            if name in target
            else content["curves"][name]
            for name in self.loops
        }
        for region in content["regions"]:
            region["area"] = None
        try:
            return type(self.limb).model_validate(content)
        except ValidationError as error:
            raise InputError(f"{_NO_ROOM}: {first_problem(content, error)}") from None

    def _layers(self, points: Mapping[str, Array], skin: float, fat: float) -> dict[str, Array]:
        """Return where points on the curves under skin and fat come."""
        surface, inner = self.loops[self.limb.contact_boundary], self.loops[self.inner]

        def under_skin(x: Array) -> Array:
            above = _nearest(surface, x)
            return above + skin * (x - above)

        found = {}
        if self.inner in points:
            found[self.inner] = under_skin(points[self.inner])
        if self.envelope in points:
            x = points[self.envelope]
            above = _nearest(inner, x)
            deeper = under_skin(above) + fat * (x - above)
            found[self.envelope] = x + self._free(x)[:, None] * (deeper - x)
        return found

    def _free(self, x: Array) -> Array:
        """Return 1 where there is muscle between places under the fat and bone, to 0."""
        from calfsocket.imaging.atlas import MUSCLE  # takes a while, which most studies do without

        rings = [shapely.LinearRing(self._sampled(name, SAMPLE_STEP)) for name in self.hard]
        points: Any = shapely.points(x)
        room = shapely.distance(points[:, None], np.array(rings)).min(axis=1)
        free = np.clip((room - MUSCLE[0]) / (MUSCLE[1] - MUSCLE[0]), 0.0, 1.0)
        return np.asarray(free**2 * (3 - 2 * free))

    def _mapped(
        self,
        points: Mapping[str, Array],
        layers: Sequence[str],
        fixed: Sequence[str],
        skin: float,
        fat: float,
    ) -> dict[str, Array]:
        """Return where curves come that lie between those under layers and those that stay."""
        from calfsocket.imaging.smooth_map import fitted

        if not points:
            return {}
        moving = {name: self._sampled(name, CONTROL_STEP) for name in layers}
        still = [self._sampled(name, CONTROL_STEP) for name in fixed]
        source = np.concatenate([*moving.values(), *still])
        target = np.concatenate([*self._layers(moving, skin, fat).values(), *still])
        try:
            smooth, _ = fitted(source, target, np.concatenate([source, *points.values()]))
        except InputError:
            raise InputError(f"{_NO_ROOM} for what lies deeper; make them thinner") from None
        return {name: smooth(x) for name, x in points.items()}

    def _points(self, name: str) -> Array:
        """Return points by which a curve is drawn again: its own ones, and some between."""
        curve = self.loops[name]
        parts = np.ceil(np.diff(curve.knots) / STEP).astype(int)
        ends = zip(curve.knots[:-1], curve.knots[1:], parts, strict=True)
        t = [np.linspace(start, end, n, endpoint=False) for start, end, n in ends]
        return curve.evaluate(np.concatenate(t))

    def _sampled(self, name: str, step: float) -> Array:
        curve = self.loops[name]
        return curve.evaluate(curve.sample(step))


def _nearest(curve: ClosedCurve, points: Array) -> Array:
    """Return the points of a curve nearest to others, (n, 2): by close samples and tangents."""
    t = curve.sample(SAMPLE_STEP)
    t = t[cKDTree(curve.evaluate(t)).query(points)[1]]
    place, tangent = curve.evaluate(t), curve.evaluate(t, 1)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    along = np.sum((points - place) * tangent, axis=1)
    return place + np.clip(along, -SAMPLE_STEP / 2, SAMPLE_STEP / 2)[:, None] * tangent
