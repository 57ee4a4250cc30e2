"""A flat plate with rounded edges that presses on a skin, and the fillets it is drawn with."""

from collections.abc import Sequence

import numpy as np
from pydantic import PositiveFloat, model_validator

from calfsocket.io.schema import Strict

# gmsh is imported by the functions that need it: records of calibrations have a plate, too.

Corner = tuple[float, float, float]
"""Place of a corner and radius of its fillet, mm."""


class Plate(Strict):
    """Width over all, radius of the two edges towards the skin, and thickness, mm."""

    width: PositiveFloat
    edge_radius: PositiveFloat
    thickness: PositiveFloat

    @model_validator(mode="after")
    def _edges_fit(self) -> "Plate":
        if not (2 * self.edge_radius < self.width and self.edge_radius < self.thickness):
            raise ValueError(
                f"edge_radius is {self.edge_radius}; it must be less than half the width "
                f"{self.width} and less than the thickness {self.thickness}"
            )
        return self


def add_plate(
    plate: Plate, middle: float, face: float, side: int
) -> tuple[int, list[int], list[int]]:
    """Add a plate; return the tags of its surface, of the edges that press, and of the others.

    Parameters
    ----------
    middle, face
        x of its middle and y of its face, mm.
    side
        1 where the plate lies above its face, -1 where below.
    """
    from calfsocket.meshes import gmsh_model

    half, r = 0.5 * plate.width, plate.edge_radius
    back = face + side * plate.thickness
    edges = add_fillets(
        [
            (middle - half, face, r),
            (middle + half, face, r),
            (middle + half, back, 0.0),
            (middle - half, back, 0.0),
        ]
    )
    # As `add_fillets` goes: left edge's arc, face, right edge's arc, side, back, side.
    return gmsh_model.add_region(edges), edges[:3], edges[3:]


def add_fillets(corners: Sequence[Corner]) -> list[int]:
    """Add a closed line with rounded corners; return the tags of its edges.

    Each corner gives its arc, unless its radius is 0, and then the line to the next one.
    """
    from calfsocket.io.system import gmsh

    place = np.array([corner[:2] for corner in corners])
    before, behind = (_unit(np.roll(place, step, axis=0) - place) for step in (1, -1))
    starts: list[int] = []
    ends: list[int] = []
    arcs: list[list[int]] = []
    for corner, to_last, to_next in zip(corners, before, behind, strict=True):
        point, radius = np.array(corner[:2]), corner[2]
        if radius == 0.0:
            starts.append(_point(point))
            ends.append(starts[-1])
            arcs.append([])
            continue
        half_angle = 0.5 * np.arccos(to_last @ to_next)
        reach = radius / np.tan(half_angle)
        centre = _point(point + radius / np.sin(half_angle) * _unit(to_last + to_next))
        starts.append(_point(point + reach * to_last))
        ends.append(_point(point + reach * to_next))
        arcs.append([gmsh.model.occ.addCircleArc(starts[-1], centre, ends[-1])])
        gmsh.model.occ.remove([(0, centre)])  # left in the model it would become a stray node
    edges = []
    for i, arc in enumerate(arcs):
        edges += arc
        edges.append(gmsh.model.occ.addLine(ends[i], starts[(i + 1) % len(corners)]))
    return edges


def _unit(vector: np.ndarray) -> np.ndarray:
    length: np.ndarray = np.linalg.norm(vector, axis=-1, keepdims=True)
    return vector / length


def _point(place: np.ndarray) -> int:
    from calfsocket.io.system import gmsh

    tag: int = gmsh.model.occ.addPoint(*place, 0.0)
    return tag
