"""What a deck is made of, without any program's words: mesh, laws, contact, supports, steps."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import brentq

from calfsocket.contact.expanded import CLEARANCE
from calfsocket.contact.parameters import Contact
from calfsocket.materials.law import Law
from calfsocket.mechanics.carrier import COMPONENTS
from calfsocket.mechanics.donning import Donning, SocketSupport
from calfsocket.mechanics.limb_problem import GUIDE_STIFFNESS, SUPPORT_STIFFNESS
from calfsocket.mechanics.loading import Loading
from calfsocket.mechanics.stages import legs
from calfsocket.meshes import tags
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.quality import areas
from calfsocket.meshes.triangles import TriangleMesh

FloatArray = NDArray[np.float64]

SIDES = ((0, 1), (1, 2), (2, 0))
"""Corners of the sides of a triangle."""

PARTS = 4
"""Straight pieces that stand for a quadratic edge where distances of curves are measured."""


def rows(values: FloatArray) -> list[list[float]]:
    """Rows of an array as lists of plain numbers."""
    listed: Any = values.tolist()
    return list(listed)


@dataclass(frozen=True)
class Material:
    """A law with a name, and the regions that have it."""

    name: str
    law: Law
    regions: tuple[str, ...]


@dataclass(frozen=True)
class LoadStep:
    """A way of a stage of loading: the values that it ends at.

    Attributes
    ----------
    name : str
        Of the stage; with a number where it goes back and forth.
    increments : int
        How many steps the program takes.
    held : (3,) bool
        Whether the place along x and y, and the turn, are prescribed, or the force.
    force, place : (3,) float
        N/mm and N mm/mm; mm and rad since donning. Those that count are said by `held`.
    volume : mapping of tissue to float
        Change of volume, as a share.
    """

    name: str
    increments: int
    held: NDArray[np.bool_]
    force: FloatArray
    place: FloatArray
    volume: Mapping[str, float]


@dataclass(frozen=True)
class ExportedCase:
    """A limb in a socket, ready to be written.

    Attributes
    ----------
    title : str
        One line.
    mesh : TriangleMesh
        The undeformed section, mm.
    tissues : mapping of region name to str
        Tissue of each region, those of socket and liner too.
    laws : mapping of region name to Law
        Law of each region.
    contact : Contact
        Friction.
    surfaces : (str, str)
        Boundaries that meet: the limb's side, whose traction counts, and the socket's.
    support, donning : str
        As of `Simulation`.
    frame : Frame
        Where lateral and anterior are.
    loading : Loading, optional
        Stages of loading.
    undersize : float
        Share by which a liner's fibres around the limb are shorter.
    around : callable, optional
        Direction of these fibres at positions, (n, 2) each.
    """

    title: str
    mesh: TriangleMesh
    tissues: Mapping[str, str]
    laws: Mapping[str, Law]
    contact: Contact
    surfaces: tuple[str, str]
    support: SocketSupport
    donning: Donning
    frame: Frame
    loading: Loading | None = None
    undersize: float = 0.0
    around: Callable[[FloatArray], FloatArray] | None = None

    @property
    def is_fixed(self) -> bool:
        """Whether the socket's outer face is fixed."""
        return self.support == "outer-fixed"

    @cached_property
    def materials(self) -> list[Material]:
        """Laws by tissue; a region with a law of its own has its own material."""
        found: dict[tuple[str, Law], list[str]] = {}
        for region in self.mesh.regions:
            found.setdefault((self.tissues[region], self.laws[region]), []).append(region)
        several = [tissue for tissue, _ in found]
        return [
            Material(tissue if several.count(tissue) == 1 else regions[0], law, tuple(regions))
            for (tissue, law), regions in found.items()
        ]

    @property
    def tissue_sets(self) -> dict[str, list[str]]:
        """Regions of each tissue."""
        found: dict[str, list[str]] = {}
        for region in self.mesh.regions:
            found.setdefault(self.tissues[region], []).append(region)
        return found

    def cells(self, region: str) -> NDArray[np.int64]:
        """Cells of a region."""
        return np.flatnonzero(self.mesh.cell_tags == self.mesh.regions[region])

    def facets(self, boundary: str) -> NDArray[np.int64]:
        """Nodes of a boundary's edges, two ends and the middle; (n, 3)."""
        return self.mesh.facets[self.mesh.facet_tags == self.mesh.boundaries[boundary]]

    def nodes(self, boundary: str) -> NDArray[np.int64]:
        """Nodes of a boundary, in ascending order."""
        return np.unique(self.facets(boundary))

    def sides(self, boundary: str) -> list[tuple[int, int]]:
        """Cell and number of its side, 0 to 2, of a boundary's edges.

        Where a boundary lies within the body, the skin under a liner, it is the limb's side, and
        the socket's where a liner is bonded to that.
        """
        liner = self.mesh.regions.get(tags.LINER)
        found = []
        for middle in self.facets(boundary)[:, 2]:
            on_side = self._cells_of_middle[int(middle)]
            own = [each for each in on_side if self.mesh.cell_tags[each[0]] != liner]
            found.append((own or on_side)[0])
        return found

    @cached_property
    def _cells_of_middle(self) -> dict[int, list[tuple[int, int]]]:
        """Cells and sides that a node between two corners belongs to."""
        found: dict[int, list[tuple[int, int]]] = {}
        middles = self.mesh.cells[:, 3:]
        for cell in range(len(middles)):
            for side in range(len(SIDES)):
                found.setdefault(int(middles[cell, side]), []).append((cell, side))
        return found

    @cached_property
    def steps(self) -> list[LoadStep]:
        """Ways of the stages of loading, one after the other."""
        held, force, place = (
            np.zeros(COMPONENTS, dtype=bool),
            np.zeros(COMPONENTS),
            np.zeros(COMPONENTS),
        )
        volume: dict[str, float] = {}
        found = []
        for stage in self.loading.stages if self.loading else ():
            ways = list(legs(stage, self.frame))
            for number, targets in enumerate(ways, 1):
                held, force, place = held.copy(), force.copy(), place.copy()
                for component, value in targets.force.items():
                    held[component], force[component] = False, value
                for component, value in targets.place.items():
                    held[component], place[component] = True, value
                volume = {**volume, **targets.volume}
                name = stage.name if len(ways) == 1 else f"{stage.name}-{number}"
                found.append(LoadStep(name, stage.steps, held, force, place, volume))
        return found

    @property
    def moves_socket(self) -> bool:
        """Whether a stage loads the socket."""
        return self.loading is not None and self.loading.moves_socket

    @property
    def fibres(self) -> FloatArray:
        """Direction around the limb in the middle of the liner's cells; (n, 2)."""
        assert self.around is not None
        corners = self.mesh.cells[self.cells(tags.LINER), :3]
        return self.around(self.mesh.points[corners].mean(axis=1))

    # -- the socket -----------------------------------------------------------------------------

    @property
    def socket_regions(self) -> list[str]:
        """The socket, and a liner that is bonded to it."""
        return [tags.SOCKET, *[tags.LINER] * (self.surfaces[1] == tags.LINER_SURFACE)]

    @property
    def socket_cells(self) -> NDArray[np.int64]:
        """Cells of the `socket_regions`."""
        return np.concatenate([self.cells(region) for region in self.socket_regions])

    @cached_property
    def outer_middle(self) -> FloatArray:
        """Middle of the area within the socket's outer face, mm; (2,)."""
        middle = shapely.Polygon(self._outline(tags.SOCKET_OUTER)).centroid
        return np.array([middle.x, middle.y])

    @cached_property
    def outer_weights(self) -> FloatArray:
        """Length that each node of the outer face stands for, mm, in the order of `nodes`."""
        facets = self.facets(tags.SOCKET_OUTER)
        a, b, middle = self.mesh.points[facets].transpose(1, 0, 2)
        # Simpson's rule of the length element at the three nodes.
        at = [-3 * a + 4 * middle - b, b - a, a - 4 * middle + 3 * b]
        share = np.array([1, 4, 1]) / 6
        weight = np.zeros(len(self.mesh.points))
        for column, tangent, factor in zip((0, 2, 1), at, share, strict=True):
            np.add.at(weight, facets[:, column], factor * np.linalg.norm(tangent, axis=1))
        return weight[self.nodes(tags.SOCKET_OUTER)]

    @property
    def outer_arms(self) -> FloatArray:
        """Positions of the outer face's nodes from `outer_middle`, mm; (n, 2)."""
        return self.mesh.points[self.nodes(tags.SOCKET_OUTER)] - self.outer_middle

    def even_forces(self, force: FloatArray) -> FloatArray:
        """Nodal forces of a force and a moment, spread evenly over the outer face; (n, 2)."""
        weight = self.outer_weights[:, None]
        points = self.mesh.points[self.nodes(tags.SOCKET_OUTER)]
        arms = points - (weight * points).sum(axis=0) / weight.sum()
        across = np.column_stack([-arms[:, 1], arms[:, 0]])
        spread = float((weight * arms**2).sum())
        return np.asarray(weight * (force[:2] / weight.sum() + force[2] * across / spread))

    @property
    def guide(self) -> float:
        """Stiffness that keeps a floating socket in its place, N/mm; 0 where none is needed."""
        if self.is_fixed:
            return 0.0
        area = float(areas(self.mesh.coordinates[self.socket_cells]).sum())
        if self.donning == "expanded":
            return GUIDE_STIFFNESS * area
        return SUPPORT_STIFFNESS * area if self.contact.friction == 0.0 else 0.0

    @cached_property
    def swelling(self) -> float:
        """Share by which the socket has to be larger in the plane to be clear of the limb."""
        limb = shapely.Polygon(self._outline(self.surfaces[0]))
        skin = shapely.points(self._outline(self.surfaces[0]))
        face = self._outline(self.surfaces[1])

        def clearance(swelling: float) -> float:
            wide = shapely.Polygon(face + swelling * (face - self.inner_middle))
            rim = shapely.LinearRing(wide.exterior)
            distance = float(limb.distance(rim))
            if wide.contains(limb):
                return distance
            return -float(np.max(shapely.distance(skin, wide))) or distance

        if clearance(0.0) >= CLEARANCE:
            return 0.0
        return float(brentq(lambda s: clearance(s) - CLEARANCE, 0.0, 1.0, xtol=1e-6))

    @property
    def inner_middle(self) -> FloatArray:
        """Point about which the socket swells, mm; (2,)."""
        return np.asarray(self.mesh.points[self.facets(self.surfaces[1])[:, 2]].mean(axis=0))

    def _outline(self, boundary: str) -> FloatArray:
        """Points along a closed boundary, in order, mm."""
        facets = self.facets(boundary)
        after = {int(a): row for row, a in enumerate(facets[:, 0])}
        if len(after) < len(facets):
            raise ValueError(f"{boundary} is not one closed curve in one direction")
        share = np.arange(PARTS) / PARTS
        shape = np.stack(
            [(1 - share) * (1 - 2 * share), share * (2 * share - 1), 4 * share * (1 - share)]
        )
        found, row = [], 0
        for _ in facets:
            found.append(shape.T @ self.mesh.points[facets[row]])
            row = after[int(facets[row, 1])]
        return np.concatenate(found)
