"""A socket of known shape: the phantom's skin moved inward, as a scan of it would be."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista
import shapely
from phantom import HEIGHT, Phantom, turned

from calfsocket.imaging.plane import cut
from calfsocket.imaging.socket_scan import plane_of
from calfsocket.meshes.limb import Limb

#: By which the inner face lies inside the skin, and how thick the wall is, mm.
GAP, WALL = 1.2, 5.0
ROWS, AROUND = 46, 300


@dataclass(frozen=True)
class SocketPhantom:
    """A socket from 5 to 95 % of the limb's height.

    Attributes
    ----------
    phantom : Phantom
    gap : float or callable
        mm, at points of the skin, shape (ROWS, AROUND, 3).
    noise : float
        Standard deviation of each coordinate of each vertex, mm.
    rotation, shift : Array
        From the limb's axes to those of the scan.
    shares : (float, float)
        Of the limb's height, its ends.
    """

    phantom: Phantom
    gap: float | Callable[[np.ndarray], np.ndarray] = GAP
    noise: float = 0.0
    rotation: np.ndarray | None = None
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shares: tuple[float, float] = (0.05, 0.95)

    def skin(self) -> tuple[np.ndarray, np.ndarray]:
        """Points of the skin, (ROWS, AROUND, 3), and its normals outward."""
        points = np.stack(
            [
                np.column_stack([self._ring(share), np.full(AROUND, HEIGHT * share)])
                for share in np.linspace(*self.shares, ROWS)
            ]
        )
        around = np.roll(points, -1, axis=1) - np.roll(points, 1, axis=1)
        normals = np.cross(around, np.gradient(points, axis=0))
        return points, normals / np.linalg.norm(normals, axis=-1, keepdims=True)

    def _ring(self, share: float) -> np.ndarray:
        ring = shapely.get_coordinates(self.phantom.section("skin", share).exterior)[:-1]
        assert len(ring) == AROUND
        return ring if shapely.LinearRing(ring).is_ccw else ring[::-1]

    def inner(self) -> pyvista.PolyData:
        """The inner face, open at both ends."""
        points, normals = self.skin()
        gap = self.gap(points) if callable(self.gap) else self.gap
        moved = points - normals * np.asarray(gap)[..., None]
        return self._scanned(moved.reshape(-1, 3), _sides(0))

    def shell(self) -> pyvista.PolyData:
        """Inner and outer face, closed at both ends."""
        points, normals = self.skin()
        assert not callable(self.gap)
        faces = [points - normals * self.gap, points + normals * (WALL - self.gap)]
        number = ROWS * AROUND
        cells = [_sides(0)[:, ::-1], _sides(number)]
        here = np.arange(AROUND)
        onward = (here + 1) % AROUND
        for first, order in ((0, -1), (number - AROUND, 1)):
            a, b = here + first, onward + first
            rim = np.concatenate(
                [np.column_stack([b, a, a + number]), np.column_stack([b, a + number, b + number])]
            )
            cells.append(rim[:, ::order])
        return self._scanned(np.concatenate(faces).reshape(-1, 3), np.concatenate(cells))

    def _scanned(self, points: np.ndarray, cells: np.ndarray) -> pyvista.PolyData:
        noisy = points + np.random.default_rng(1).normal(scale=self.noise, size=points.shape)
        if self.rotation is not None:
            noisy = noisy @ self.rotation.T
        return pyvista.PolyData.from_regular_faces(noisy + np.array(self.shift), cells)

    def write(self, path: Path) -> Path:
        """Write the inner face."""
        self.inner().save(path)
        return path

    def write_aop(self, path: Path, radii: int = 120, levels: int = 60) -> Path:
        """Write the inner face in cylindrical coordinates about the axis of the limb's source."""
        surface = SocketPhantom(self.phantom, self.gap).inner()
        low, high = surface.bounds[4] + 1.0, surface.bounds[5] - 1.0
        spacing = (high - low) / (levels - 1)
        lines = ["AAOP1", "END COMMENTS", "CYLINDRICAL", "RIGHT", "0"]
        lines += [str(radii), str(360 / radii), str(levels), f"{spacing:.6f}"]
        angles = np.deg2rad(np.arange(radii) * 360 / radii)
        rng = np.random.default_rng(2)
        for height in low + spacing * np.arange(levels):
            ring = surface.slice(normal=(0, 0, 1), origin=(0, 0, height)).points
            radius = np.interp(
                angles,
                np.arctan2(ring[:, 1], ring[:, 0]) % (2 * np.pi),
                np.linalg.norm(ring[:, :2], axis=1),
                period=2 * np.pi,
            )
            noisy = radius + rng.normal(scale=self.noise, size=radii)
            lines += [f"{each:.4f}" for each in noisy]
        path.write_text("\n".join(lines))
        return path

    def outline(self, limb: Limb) -> shapely.Polygon:
        """The inner face in a section of the limb, without noise, in the section's axes."""
        return cut(SocketPhantom(self.phantom, self.gap).inner(), plane_of(limb)).bodies[0]


def elsewhere(socket: SocketPhantom) -> SocketPhantom:
    """Return the same socket scanned in other axes."""
    return SocketPhantom(
        socket.phantom, socket.gap, socket.noise, turned(3), (120.0, -40.0, 300.0), socket.shares
    )


def _sides(first: int) -> np.ndarray:
    here = np.arange(AROUND)
    onward = (here + 1) % AROUND
    quads = np.stack([here, onward, onward + AROUND, here + AROUND], axis=-1)
    cells = (quads + AROUND * np.arange(ROWS - 1)[:, None, None]).reshape(-1, 4) + first
    return np.concatenate([cells[:, :3], cells[:, [0, 2, 3]]])
