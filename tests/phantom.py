"""A limb of known shape: the reference calf drawn out along its tibia, with taper and twist."""

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pyvista
import shapely

from calfsocket.meshes.limb import Limb, limb_curves

HEIGHT = 200.0
PARTS = {
    "skin": "skin_outline",
    "muscle": "fascia_outer",
    "tibia": "tibia",
    "fibula": "fibula",
    "cavity": "tibia_medullary",
}
POINTS = {"skin": 300, "muscle": 300, "tibia": 150, "fibula": 80, "cavity": 100}
LEVELS = 41


@cache
def outline(part: str) -> np.ndarray:
    """Points of a curve of the reference calf, evenly along it; a part, or the curve's own name."""
    curve = limb_curves(Limb.reference())[PARTS.get(part, part)]
    t = curve.sample(0.05)
    points = curve.evaluate(t)
    number = POINTS.get(part, 120)
    return points[np.linspace(0, len(points), number, endpoint=False).astype(int)]


@dataclass(frozen=True)
class Phantom:
    """How the calf is drawn out, and where it lies in its source.

    Attributes
    ----------
    taper, twist : float
        Scale from the distal to the proximal end, and turn in degrees; none half way up.
    mirrored : bool
        A left leg.
    turn : Array
        Rotation of the source's axes.
    noise : float
        Standard deviation of each vertex, mm.
    seed : int
        Of the noise.
    scale : float
        Units of the source in mm.
    """

    taper: tuple[float, float] = (0.8, 1.2)
    twist: float = 10.0
    mirrored: bool = False
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    noise: float = 0.0
    seed: int = 7
    scale: float = 1.0

    def section(self, part: str, share: float) -> shapely.Polygon:
        """Outline of a part at a share of the height, in the limb's axes before the turn."""
        size = self.taper[0] + (self.taper[1] - self.taper[0]) * share
        angle = np.deg2rad(self.twist) * (share - 0.5)
        turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        about = outline("tibia").mean(axis=0)  # so that the tibia's axis stays straight
        points = about + size * (outline(part) - about) @ turned.T
        return shapely.Polygon(points * [-1, 1] if self.mirrored else points)

    def surface(self, part: str) -> pyvista.PolyData:
        """Closed surface of a part in the source's axes and units."""
        shares = np.linspace(0, 1, LEVELS) if part == "skin" else np.linspace(0.02, 0.98, LEVELS)
        rings = [shapely.get_coordinates(self.section(part, s).exterior)[:-1] for s in shares]
        n = len(rings[0])
        points = np.concatenate(
            [
                np.column_stack([r, np.full(n, HEIGHT * s)])
                for r, s in zip(rings, shares, strict=True)
            ]
        )
        here = np.arange(n)
        onward = (here + 1) % n
        quads = np.stack([here, onward, onward + n, here + n], axis=-1)
        cells = (quads + n * np.arange(LEVELS - 1)[:, None, None]).reshape(-1, 4)
        triangles = [cells[:, :3], cells[:, [0, 2, 3]]]
        for first, ring in ((0, rings[0]), (n * (LEVELS - 1), rings[-1])):  # flat ends
            triangles.append(
                np.column_stack([here + first, onward + first, np.full(n, len(points))])
            )
            height = points[first, 2]
            points = np.concatenate([points, [[*ring.mean(axis=0), height]]])
        rng = np.random.default_rng(self.seed)
        points = points + rng.normal(scale=self.noise, size=points.shape) if self.noise else points
        return pyvista.PolyData.from_regular_faces(
            points @ self.turn.T / self.scale, np.concatenate(triangles)
        )

    def labels(
        self, voxel: tuple[float, float, float], *parts: str, margin: float = 8.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Label map, the first part 1 and those in it 2, 3, ..., and its affine (3, 4).

        The limb lies straight in the affine's space, and the map's axes are turned.
        """
        size = np.array(voxel)
        corners = np.array([[x, y, z] for x in (-65, 75) for y in (-65, 75) for z in (0, HEIGHT)])
        there = corners @ self.turn
        low = there.min(axis=0) - margin
        shape = np.ceil((np.ptp(there, axis=0) + 2 * margin) / size).astype(int)
        affine = np.column_stack([self.turn * size, self.turn @ low])
        places = np.indices(shape).reshape(3, -1).T @ affine[:, :3].T + affine[:, 3]
        found = np.zeros(len(places), dtype=np.uint8)
        thin = size.min() / 4
        layer = np.floor(places[:, 2] / thin).astype(int)
        order = np.argsort(layer, kind="stable")
        starts = np.flatnonzero(np.diff(layer[order], prepend=layer[order[0]] - 1))
        for chosen in np.split(order, starts[1:]):
            share = (layer[chosen[0]] + 0.5) * thin / HEIGHT
            if 0 < share < 1:
                for number, part in enumerate(parts, start=1):
                    inside = shapely.contains_xy(self.section(part, share), *places[chosen, :2].T)
                    found[chosen[inside]] = number
        return found.reshape(shape), affine

    def write(self, folder: Path, *parts: str, name: str = "{}.stl") -> list[Path]:
        """Write a file for each part."""
        paths = []
        for part in parts:
            paths.append(folder / name.format(part))
            self.surface(part).save(paths[-1])
        return paths

    def write_one(self, path: Path, *parts: str) -> Path:
        """Write one file with all parts."""
        whole = pyvista.merge([self.surface(part) for part in parts])
        whole.extract_surface().save(path)
        return path


def turned(seed: int) -> np.ndarray:
    """Return some rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q
