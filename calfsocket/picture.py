"""A picture of one case, drawn from its result files alone.

The deformed section with the effective (Mises) stress of the soft tissues on the paper's scale,
and around it the contact pressure on the skin. Run as `python3 -m calfsocket.picture FOLDER`.
"""

import argparse
import logging
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyvista
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calfsocket.section_fields import TISSUES
from calfsocket.writers import FIELDS_FILE, replacing

PICTURE_FILE = "picture.png"
CONTACT_FILE = "contact.csv"

STRESS_LIMIT_KPA = 10.0  # as the paper's figure 4
PRESSURE_MM_PER_KPA = 0.4  # the same in every picture, so that pictures can be compared
PRESSURE_STEP_KPA = 20.0
HALF_FRAME_MM = 92.0  # grows where the pressure needs it
PIXELS = 2100

# Light where stress is low, so that outlines show; told apart by colour-blind eyes too.
COLOUR_MAP = "YlGnBu"
ABOVE = "#cc3c58"
BONE = "#d9d9d9"
SOCKET = "#555555"
OUTLINE = "#1a1a1a"
PRESSURE = "#f4d6ae"
PRESSURE_EDGE = "#96540c"

SOCKET_NAMES = {"TC": "total contact", "TSB": "total surface bearing", "HS": "hydrostatic"}

SOFT_TISSUES = ("skin", "fat", "fascia", "muscle", "vessel")

log = logging.getLogger(__name__)


def region_outlines(
    cells: NDArray[np.int64], points: NDArray[np.float64], pieces: int = 6
) -> NDArray[np.float64]:
    """Curved edges that belong to one cell of their region alone, as polylines.

    Parameters
    ----------
    cells
        Six-node triangles whose nodes are not shared between regions, (n_cells, 6).
    points
        Positions, (n_points, 2).
    pieces
        Straight pieces to an edge.

    Returns
    -------
    lines
        (n_edges, pieces + 1, 2).
    """
    corners = cells[:, :3]
    edges = np.stack([corners, np.roll(corners, -1, axis=1), cells[:, 3:]], axis=2).reshape(-1, 3)
    _, index, count = np.unique(edges[:, 2], return_index=True, return_counts=True)
    ends = points[edges[index[count == 1]]]
    s = np.linspace(0, 1, pieces + 1)
    shape = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)], axis=1)
    return np.einsum("sa,eai->esi", shape, ends)


def outward_normals(line: NDArray[np.float64], smooth_mm: float = 4.0) -> NDArray[np.float64]:
    """Give unit normals of a closed counter-clockwise line (n, 2), averaged over `smooth_mm`."""
    tangent = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    step = np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1).mean()
    half = round(smooth_mm / step / 2)
    total = sum((np.roll(normal, k, axis=0) for k in range(-half, half + 1)), np.zeros_like(line))
    return total / np.linalg.norm(total, axis=1, keepdims=True)


@dataclass(frozen=True)
class Case:
    """Result files of one case: grid of fields.vtu, rows of contact.csv."""

    socket: str
    material_set: str
    grid: pyvista.UnstructuredGrid
    skin: NDArray[np.float64]
    pressure_kPa: NDArray[np.float64]

    @property
    def cells(self) -> NDArray[np.int64]:
        """Node indices, (n_cells, 6)."""
        return np.asarray(self.grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE])

    @property
    def deformed(self) -> NDArray[np.float64]:
        """Deformed positions, mm, (n_points, 2)."""
        return (self.grid.points + self.grid.point_data["displacement"])[:, :2]

    def of_tissue(self, *names: str) -> NDArray[np.int64]:
        """Give the indices of the cells of some tissues."""
        ids = [TISSUES.index(name) for name in names]
        return np.flatnonzero(np.isin(self.grid.cell_data["tissue"], ids))


def read_case(folder: Path) -> Case:
    """Read what a picture needs from a case's folder and contact.csv beside the folder."""
    grid = pyvista.read(folder / FIELDS_FILE)
    socket = str(grid.field_data["socket"][0])
    material_set = str(grid.field_data["material_set"][0])
    contact = pd.read_csv(folder.parent / CONTACT_FILE)
    contact = contact[(contact.socket == socket) & (contact.material_set == material_set)]
    if contact.empty:
        raise ValueError(f"{CONTACT_FILE} has no row of socket {socket}, set {material_set}")
    return Case(
        socket,
        material_set,
        grid,
        contact[["x_mm", "y_mm"]].to_numpy(),
        contact["pressure_kPa"].to_numpy(),
    )


def render_section(case: Case, window: tuple[float, float, float, float]) -> NDArray[np.uint8]:
    """Draw the deformed section alone, seen along the limb.

    Returns
    -------
    image
        RGBA of the window left, right, bottom, top (mm), transparent around the section.
    """
    deformed = case.grid.copy()
    deformed.points = case.grid.points + case.grid.point_data["displacement"]
    plotter = pyvista.Plotter(off_screen=True, window_size=[PIXELS, PIXELS])

    def surface(cells: NDArray[np.int64]) -> pyvista.PolyData:
        return deformed.extract_cells(cells).extract_surface(nonlinear_subdivision=3)

    for tissue, colour in (("bone", BONE), ("socket", SOCKET)):
        cells = case.of_tissue(tissue)
        if len(cells):
            plotter.add_mesh(surface(cells), color=colour, lighting=False)
    plotter.add_mesh(
        surface(case.of_tissue(*SOFT_TISSUES)),
        scalars="effective_stress_kPa",
        clim=(0, STRESS_LIMIT_KPA),
        cmap=COLOUR_MAP,
        above_color=ABOVE,
        interpolate_before_map=True,
        lighting=False,
        show_scalar_bar=False,
    )
    left, right, bottom, top = window
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = ((left + right) / 2, (bottom + top) / 2, 0)
    plotter.camera.position = ((left + right) / 2, (bottom + top) / 2, 1000)
    plotter.camera.up = (0, 1, 0)
    plotter.camera.parallel_scale = (top - bottom) / 2
    plotter.camera.clipping_range = (1, 2000)
    image = plotter.screenshot(transparent_background=True, return_img=True)
    plotter.close()
    return np.asarray(image)


@dataclass(frozen=True)
class PressureBand:
    """Contact pressure as a band around the section: its foot, and outward unit normals, mm."""

    foot: NDArray[np.float64]
    normal: NDArray[np.float64]
    pressure_kPa: NDArray[np.float64]

    def at(self, pressure_kPa: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Give the closed line at a pressure, mm, (n + 1, 2)."""
        height = PRESSURE_MM_PER_KPA * np.broadcast_to(pressure_kPa, len(self.foot))
        line = self.foot + height[:, None] * self.normal
        return np.vstack([line, line[:1]])


def pressure_band(case: Case) -> PressureBand:
    """Place the band outside the socket, so that it hides nothing."""
    normal = outward_normals(case.skin)
    foot_mm = 1.5
    socket = case.cells[case.of_tissue("socket")]
    if len(socket):
        to_skin, _ = cKDTree(case.skin).query(case.deformed[np.unique(socket)])
        foot_mm += to_skin.max()
    return PressureBand(case.skin + foot_mm * normal, normal, case.pressure_kPa)


def _draw_pressure(axes: Axes, band: PressureBand) -> None:
    low, high = band.at(0.0), band.at(band.pressure_kPa)
    quads = np.stack([low[:-1], low[1:], high[1:], high[:-1]], axis=1)
    axes.add_collection(
        PolyCollection(list(quads), facecolor=PRESSURE, edgecolor=PRESSURE, linewidth=0.2, zorder=1)
    )
    axes.plot(*high.T, color=PRESSURE_EDGE, linewidth=0.9, zorder=2)
    axes.plot(*low.T, color=PRESSURE_EDGE, linewidth=0.5, zorder=2)
    highest = max(band.pressure_kPa.max(), PRESSURE_STEP_KPA)
    levels = np.arange(1, int(highest / PRESSURE_STEP_KPA) + 1) * PRESSURE_STEP_KPA
    clear = _clear_place(band)
    for level in levels:
        axes.plot(*band.at(level).T, color="#666666", linewidth=0.5, dashes=(4, 3), zorder=2)
        x, y = band.at(level)[clear]
        axes.text(
            x,
            y,
            f"{level:g} kPa" if level == levels[0] else f"{level:g}",
            fontsize=7,
            color="#333333",
            ha="center",
            va="center",
            zorder=5,
            path_effects=[withStroke(linewidth=3, foreground="white")],
        )


def _clear_place(band: PressureBand) -> int:
    """Index of the point with the lowest pressure around it, away from the direction labels."""
    angle = np.degrees(np.arctan2(band.normal[:, 1], band.normal[:, 0]))
    off_axis = np.abs((angle + 45) % 90 - 45)
    n = len(angle)
    half = max(1, n // 40)
    around = (np.arange(n)[:, None] + np.arange(-half, half + 1)) % n
    load = band.pressure_kPa[around].max(axis=1)
    return int(np.argmin(np.where(off_axis > 20, load, np.inf)))


def _draw_frame(axes: Axes, case: Case, window: tuple[float, float, float, float]) -> None:
    left, right, bottom, top = window
    x, y = (left + right) / 2, (bottom + top) / 2
    edge = 3.0
    for text, place, ha, va, rotation in (
        ("anterior", (x, top - edge), "center", "top", 0),
        ("posterior", (x, bottom + edge), "center", "bottom", 0),
        ("medial", (left + edge, y), "left", "center", 90),
        ("lateral", (right - edge, y), "right", "center", 270),
    ):
        axes.text(*place, text, ha=ha, va=va, rotation=rotation, fontsize=9, color="#333333")
    bar = (left + edge, bottom + edge)
    axes.plot(
        [bar[0], bar[0] + 20], [bar[1]] * 2, color="black", linewidth=2, solid_capstyle="butt"
    )
    axes.text(bar[0] + 10, bar[1] + 1.5, "20 mm", ha="center", va="bottom", fontsize=8)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.axis("off")


def _draw_legend(figure: Figure) -> None:
    bar = figure.add_axes((0.06, 0.045, 0.40, 0.015))
    shades = matplotlib.colormaps[COLOUR_MAP].with_extremes(over=ABOVE)
    figure.colorbar(
        plt.cm.ScalarMappable(plt.Normalize(0, STRESS_LIMIT_KPA), shades),
        cax=bar,
        orientation="horizontal",
        extend="max",
        extendfrac=0.08,
    )
    bar.tick_params(labelsize=8)
    bar.set_title("effective (Mises) stress, kPa; arrow: above", fontsize=8.5)
    band = Patch(facecolor=PRESSURE, edgecolor=PRESSURE_EDGE, linewidth=0.9)
    lines = Line2D([], [], color="#666666", linewidth=0.5, dashes=(4, 3))
    bone, socket = Patch(color=BONE), Patch(color=SOCKET)
    figure.legend(
        [band, lines, bone, socket],
        [
            "contact pressure on the skin",
            f"lines every {PRESSURE_STEP_KPA:g} kPa",
            "bone",
            "socket",
        ],
        ncols=2,
        loc="center right",
        bbox_to_anchor=(0.97, 0.045),
        fontsize=8,
        frameon=False,
    )


def draw(folder: Path) -> Path:
    """Draw the picture of the case in `folder` from its files; returns the picture's path."""
    case = read_case(Path(folder))
    band = pressure_band(case)
    x, y = 0.5 * (case.skin.min(axis=0) + case.skin.max(axis=0))
    reach = np.abs(band.at(band.pressure_kPa) - (x, y)).max() + 10
    half = max(HALF_FRAME_MM, reach)
    window = (x - half, x + half, y - half, y + half)

    figure = plt.figure(figsize=(7.0, 8.0), dpi=PIXELS / 7.0)
    axes = figure.add_axes((0.0, 0.08, 1.0, 7.0 / 8.0))
    axes.imshow(render_section(case, window), extent=window, zorder=3)
    outlines = region_outlines(case.cells, case.deformed)
    axes.add_collection(LineCollection(list(outlines), colors=OUTLINE, linewidths=0.45, zorder=4))
    _draw_pressure(axes, band)
    _draw_frame(axes, case, window)
    _draw_legend(figure)
    name = SOCKET_NAMES.get(case.socket)
    title = f"{case.socket} socket" + (f" ({name})" if name else "")
    figure.text(0.5, 0.965, f"{title}, {case.material_set} set", ha="center", fontsize=13)
    path = Path(folder) / PICTURE_FILE
    with replacing(path) as temporary:
        figure.savefig(temporary, facecolor="white")
    plt.close(figure)
    return path


def draw_in_subprocess(folder: Path, timeout_s: float = 300.0) -> Path | None:
    """Draw the picture in a process of its own, so that a crash of the graphics loses nothing.

    Returns
    -------
    path
        The picture, or None with a warning that says why there is none.
    """
    # A child that finds MPI's variables would take itself for a rank of the running study.
    environment = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("OMPI_", "PMIX_", "PRTE_", "PMI_"))
    }
    package_parent = str(Path(__file__).resolve().parent.parent)
    inherited = environment.get("PYTHONPATH")
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [package_parent, inherited]))
    command = [sys.executable, "-m", "calfsocket.picture", str(folder)]
    # An X server of its own where one can be started: the user's may be far away, or gone.
    # (xvfb-run needs xauth; ./in-debian13 has a server running instead.)
    xvfb = shutil.which("xvfb-run")
    if xvfb and shutil.which("xauth"):
        command = [xvfb, "-a", "-s", "-screen 0 1280x1024x24", *command]
    try:
        code, errors = _run(command, environment, timeout_s)
    except subprocess.TimeoutExpired:
        log.warning("no picture of %s: not done after %g s", folder, timeout_s)
        return None
    except OSError as error:
        log.warning("no picture of %s: %s", folder, error)
        return None
    if code == 0:
        return Path(folder) / PICTURE_FILE
    log.warning("no picture of %s: %s", folder, _reason(code, errors))
    return None


def _run(command: list[str], environment: dict[str, str], timeout_s: float) -> tuple[int, str]:
    """Run a command to its end; returns its exit code and what it wrote to stderr."""
    with subprocess.Popen(
        command,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            _, errors = process.communicate(timeout=timeout_s)
        except BaseException:
            # all of it: xvfb-run has an X server and the drawing as children
            os.killpg(process.pid, signal.SIGTERM)
            raise
    return process.returncode, errors


def _reason(code: int, stderr: str) -> str:
    lines = [line.strip() for line in stderr.splitlines() if line.strip()]
    ended = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return f"{lines[-1]} ({ended})" if lines else ended


def main() -> int:
    """Draw the picture of one case's folder."""
    parser = argparse.ArgumentParser(prog="python3 -m calfsocket.picture", description=__doc__)
    parser.add_argument("folder", type=Path, help="a case's folder, such as results/TC_separate")
    draw(parser.parse_args().folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
