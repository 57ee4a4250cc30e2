"""Contact pressure as a band around the section, its height in proportion to the pressure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

FILL = "#f4d6ae"
EDGE = "#96540c"
LEVEL_LINE: dict[str, Any] = {"color": "#666666", "linewidth": 0.5, "dashes": (4, 3)}


def key(label: str) -> Patch:
    """Return the band's handle in a legend."""
    return Patch(facecolor=FILL, edgecolor=EDGE, linewidth=0.9, label=label)


def outward_normals(line: NDArray[np.float64], smooth_mm: float = 4.0) -> NDArray[np.float64]:
    """Return unit normals of a closed counter-clockwise line (n, 2), averaged over `smooth_mm`."""
    tangent = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    step = np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1).mean()
    half = round(smooth_mm / step / 2)
    total = sum((np.roll(normal, k, axis=0) for k in range(-half, half + 1)), np.zeros_like(line))
    return total / np.linalg.norm(total, axis=1, keepdims=True)


@dataclass(frozen=True)
class PressureBand:
    """Contact pressure, (n,), around a closed line."""

    foot: NDArray[np.float64]
    """The line, mm, (n, 2)."""
    normal: NDArray[np.float64]
    """Its outward unit normals, (n, 2)."""
    pressure_kPa: NDArray[np.float64]
    mm_per_kPa: float

    def at(self, pressure_kPa: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Return the closed line at a pressure, mm, (n + 1, 2)."""
        height = self.mm_per_kPa * np.broadcast_to(pressure_kPa, len(self.foot))
        line = self.foot + height[:, None] * self.normal
        return np.vstack([line, line[:1]])

    def draw(self, axes: Axes, levels: Sequence[float], fontsize: float) -> None:
        """Draw the band, and dashed lines of equal pressure around it, with their values in kPa."""
        low, high = self.at(0.0), self.at(self.pressure_kPa)
        band = Path.make_compound_path(Path(high, closed=True), Path(low[::-1], closed=True))
        axes.add_artist(PathPatch(band, facecolor=FILL, edgecolor=FILL, linewidth=0.2, zorder=1))
        axes.plot(*high.T, color=EDGE, linewidth=0.9, zorder=2)
        axes.plot(*low.T, color=EDGE, linewidth=0.5, zorder=2)
        clear = self._clear_place()
        for level in levels:
            axes.plot(*self.at(level).T, **LEVEL_LINE, zorder=2)
            x, y = self.at(level)[clear]
            axes.text(
                x,
                y,
                f"{level:g} kPa" if level == levels[0] else f"{level:g}",
                fontsize=fontsize,
                color="#333333",
                ha="center",
                va="center",
                zorder=5,
                path_effects=[withStroke(linewidth=3, foreground="white")],
            )

    def _clear_place(self) -> int:
        """Index of the point with the lowest pressure around it, away from the axes' directions."""
        angle = np.degrees(np.arctan2(self.normal[:, 1], self.normal[:, 0]))
        off_axis = np.abs((angle + 45) % 90 - 45)
        n = len(angle)
        half = max(1, n // 40)
        around = (np.arange(n)[:, None] + np.arange(-half, half + 1)) % n
        load = self.pressure_kPa[around].max(axis=1)
        return int(np.argmin(np.where(off_axis > 20, load, np.inf)))
