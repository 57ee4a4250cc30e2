"""Small sections with hand-made fields, shared by the tests of quantities, files and pictures."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import GAUSS_POINTS, SectionFields

Field = Callable[[np.ndarray], np.ndarray]


def zero(x: np.ndarray) -> np.ndarray:
    return np.zeros_like(x)


def shape_gradients(points: np.ndarray) -> np.ndarray:
    """Gradients of the six shape functions in reference coordinates, (n, 6, 2)."""
    b, c = points.T
    a = 1 - b - c
    o = np.zeros_like(a)
    return np.stack(
        [
            np.stack([1 - 4 * a, 1 - 4 * a], -1),
            np.stack([4 * b - 1, o], -1),
            np.stack([o, 4 * c - 1], -1),
            np.stack([4 * (a - b), -4 * b], -1),
            np.stack([4 * c, 4 * b], -1),
            np.stack([-4 * c, 4 * (a - c)], -1),
        ],
        axis=1,
    )


def section(
    points: np.ndarray,
    cells: np.ndarray,
    region: np.ndarray,
    regions: dict[int, tuple[str, str]],
    displacement: Field = zero,
    stress: Field | None = None,
    pressure: Field | None = None,
) -> SectionFields:
    """Make a section with F of the displacement's interpolant; stress and pressure as functions."""
    u = displacement(points)
    gradients = shape_gradients(GAUSS_POINTS)
    dx = np.einsum("nai,gaj->ngij", points[cells], gradients)
    du = np.einsum("nai,gaj->ngij", u[cells], gradients)
    at = np.einsum("ga,nai->ngi", shape_values(GAUSS_POINTS), points[cells])
    n = len(cells)
    return SectionFields(
        points=points,
        cells=cells,
        region=region,
        region_names={i: name for i, (name, _) in regions.items()},
        region_tissues={i: tissue for i, (_, tissue) in regions.items()},
        displacement=u,
        stress=stress(at) if stress else np.zeros((n, 3, 4)),
        deformation_gradient=np.eye(2) + du @ np.linalg.inv(dx),
        pressure=pressure(at) if pressure else np.zeros((n, 3)),
    )


def shape_values(points: np.ndarray) -> np.ndarray:
    b, c = points.T
    a = 1 - b - c
    return np.stack(
        [a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], -1
    )


def grid(nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit squares of two quadratic triangles each; cells 2 (i + nx j) and the one after it."""
    x, y = np.meshgrid(np.arange(2 * nx + 1) / 2, np.arange(2 * ny + 1) / 2)
    points = np.column_stack([x.ravel(), y.ravel()])

    def node(i: int, j: int) -> int:
        return i + (2 * nx + 1) * j

    cells = []
    for j in range(0, 2 * ny, 2):
        for i in range(0, 2 * nx, 2):
            a, b, c, d = node(i, j), node(i + 2, j), node(i + 2, j + 2), node(i, j + 2)
            ab, bc, cd, da = node(i + 1, j), node(i + 2, j + 1), node(i + 1, j + 2), node(i, j + 1)
            ac = node(i + 1, j + 1)
            cells += [[a, b, c, ab, bc, ac], [a, c, d, ac, cd, da]]
    return points, np.array(cells)


def annulus(
    radii: list[float], n: int, per_mm: float = 0.5
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Curved quadratic triangles between circles; points, cells and the ring of each cell."""
    levels, ring = [radii[0]], []
    for k, (inner, outer) in enumerate(pairwise(radii)):
        layers = max(1, round((outer - inner) * per_mm))
        levels += list(np.linspace(inner, outer, layers + 1)[1:])
        ring += [k] * layers
    squares, cells = grid(n, len(ring))
    i, j = squares[:, 0], squares[:, 1]
    r = np.interp(j, np.arange(len(levels)), levels)
    angle = 2 * np.pi * i / n
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    # the seam: nodes at i = n are those at i = 0
    index = np.arange(len(points)).reshape(2 * len(ring) + 1, 2 * n + 1)
    index[:, -1] = index[:, 0]
    used, cells = np.unique(index.ravel()[cells], return_inverse=True)
    return points[used], cells.reshape(-1, 6), np.repeat(ring, 2 * n)


def limb_and_socket(n: int = 72) -> SectionFields:
    """Round limb (bone, muscle, fascia, fat, skin; a vessel by the bone) squeezed in a socket."""
    limb, cells, ring = annulus([5, 12, 40, 41, 46, 48], n)
    shell, shell_cells, _ = annulus([48.0, 52.5], n)
    names = ["tibia", "soleus", "deep_fascia", "subcutaneous_fat", "skin"]
    tissues = ["bone", "muscle", "fascia", "fat", "skin"]
    regions = {k + 1: pair for k, pair in enumerate(zip(names, tissues, strict=True))}
    regions[6] = ("fibular_artery", "vessel")
    regions[7] = ("socket", "socket")
    region = ring + 1
    middle = limb[cells].mean(axis=1)
    region[(region == 2) & (np.hypot(middle[:, 0] - 25, middle[:, 1]) < 6)] = 6

    def squeeze(x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(x, axis=1, keepdims=True)
        angle = np.arctan2(x[:, 1:], x[:, :1])
        inward = 0.02 * (1 + 0.6 * np.cos(3 * angle)) * np.clip(r - 12, 0, 36)
        return -inward * x / r

    def stress(x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(x, axis=-1)
        p = 8 * (1 + 0.6 * np.cos(3 * np.arctan2(x[..., 1], x[..., 0])))
        s = np.where(r > 46, 6.0, 1.0) * 0.4 * p * np.clip(r / 48, 0.2, 1)
        return np.stack([s, -s, 0 * s, 0.3 * s], -1)

    return section(
        np.vstack([limb, shell]),
        np.vstack([cells, shell_cells + len(limb)]),
        np.concatenate([region, np.full(len(shell_cells), 7)]),
        regions,
        squeeze,
        stress,
        pressure=lambda x: 8 + 0 * x[..., 0],
    )


def contact_around(
    fields: SectionFields | None = None, n: int = 360, radius: float = 48.0
) -> ContactLine:
    """Pressure 10 + 12 cos(3 angle) kPa around a circle; 0 and open where it would be negative."""
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    pressure = np.maximum(10 + 12 * np.cos(3 * angle), 0)
    shrunk = radius * (1 - 0.015 * (1 + 0.6 * np.cos(3 * angle)))
    length = 2 * np.pi * radius
    return ContactLine(
        arc_mm=radius * angle,
        angle_deg=np.degrees(angle),
        x_mm=shrunk * np.cos(angle),
        y_mm=shrunk * np.sin(angle),
        pressure_kPa=pressure,
        shear_kPa=0.1 * pressure,
        gap_mm=np.where(pressure > 0, 0.0, 0.1),
        weight_mm=np.full(n, length / n),
        status=np.where(pressure > 0, "stick", "open"),
    )
