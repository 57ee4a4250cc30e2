"""A mesh that was made elsewhere and is solved as it is, as text that a JSON file can hold."""

import base64
import binascii
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import model_validator

from calfsocket.io.schema import Strict
from calfsocket.meshes import tags
from calfsocket.meshes.curves import Array, xy
from calfsocket.meshes.quality import LATTICE, areas, determinant, jacobians
from calfsocket.meshes.triangles import TriangleMesh

#: More would not fit into the largest JSON file that is read.
MOST_TRIANGLES = 120_000
#: Straight pieces that stand for a quadratic side where areas are drawn and distances measured.
PIECES = 4
_KINDS = {"points": ("<f8", 2), "cells": ("<i4", 6), "regions": ("<i4", 0)}
"""Type and number of columns of the packed arrays; 0 is a vector."""
_FACETS = ("<i4", 3)


class GivenMesh(Strict):
    """Six-node triangles of one body, as of `TriangleMesh`.

    Arrays are little-endian numbers in base64, row by row, so that they are exact and compact.

    Attributes
    ----------
    points : str
        Float64, x and y, mm.
    cells : str
        Int32, six nodes: three corners counter-clockwise, the nodes between 0-1, 1-2 and 2-0.
    regions : str
        Int32, the number of each triangle's region.
    boundaries : mapping of str to str
        By name; int32, two ends and the node between them of each edge.
    """

    points: str
    cells: str
    regions: str
    boundaries: dict[str, str]

    @classmethod
    def of(cls, mesh: TriangleMesh) -> Self:
        """Pack a mesh of one body."""
        return cls(
            points=_packed(mesh.points, "<f8"),
            cells=_packed(mesh.cells, "<i4"),
            regions=_packed(mesh.cell_tags, "<i4"),
            boundaries={
                name: _packed(mesh.facets[mesh.facet_tags == tag], "<i4")
                for name, tag in mesh.boundaries.items()
            },
        )

    def triangles(self, regions: Mapping[str, int]) -> TriangleMesh:
        """Return the mesh; `regions` are the numbers of its regions by name."""
        return TriangleMesh(
            points=self._points,
            cells=self._cells,
            cell_tags=self.cell_tags,
            facets=np.concatenate([self.facets(name) for name in self.boundaries]),
            facet_tags=np.concatenate(
                [
                    np.full(len(self.facets(name)), tags.BOUNDARIES[name], dtype=np.int32)
                    for name in self.boundaries
                ]
            ),
            regions=dict(regions),
            boundaries={name: tags.BOUNDARIES[name] for name in self.boundaries},
        )

    @property
    def _points(self) -> Array:
        return np.asarray(_unpacked(self.points, *_KINDS["points"]), dtype=np.float64)

    @property
    def _cells(self) -> NDArray[np.int64]:
        return np.asarray(_unpacked(self.cells, *_KINDS["cells"]), dtype=np.int64)

    @property
    def cell_tags(self) -> NDArray[np.int32]:
        """Number of each triangle's region."""
        return np.asarray(_unpacked(self.regions, *_KINDS["regions"]), dtype=np.int32)

    @property
    def coordinates(self) -> Array:
        """Nodes of each triangle, shape (m, 6, 2), mm."""
        return self._points[self._cells]

    def facets(self, boundary: str) -> NDArray[np.int64]:
        """Nodes of a boundary's edges, two ends and the middle; (k, 3)."""
        return np.asarray(_unpacked(self.boundaries[boundary], *_FACETS), dtype=np.int64)

    def edges(self, boundary: str) -> Array:
        """Return straight pieces of a boundary, shape (n, 2, 2), mm."""
        return pieces(self._points[self.facets(boundary)])

    def body(self, region: int) -> shapely.Polygon | shapely.MultiPolygon:
        """Return the area of a region, its curved sides in `PIECES`."""
        return area_of(self._points, self._cells[self.cell_tags == region])

    def outline(self, regions: Sequence[int]) -> Array:
        """Return straight pieces of the outlines of regions, shape (n, 2, 2), mm."""
        rows = [outer_sides(self._cells[self.cell_tags == region]) for region in regions]
        return pieces(self._points[np.concatenate([np.empty((0, 3), dtype=np.int64), *rows])])

    @property
    def areas(self) -> dict[int, float]:
        """Area of each region, mm^2."""
        of = areas(self.coordinates)
        return {
            int(tag): float(of[self.cell_tags == tag].sum()) for tag in np.unique(self.cell_tags)
        }

    def __hash__(self) -> int:
        """Sockets are keys of what was measured of them."""
        return hash((self.points, self.cells, self.regions, *sorted(self.boundaries.items())))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        """Check what a file may have wrong."""
        for name, (kind, columns) in _KINDS.items():
            _check_packed(name, getattr(self, name), kind, columns)
        for name, text in self.boundaries.items():
            if name not in tags.BOUNDARIES:
                raise ValueError(f"boundaries: no boundary '{name}'")
            _check_packed(f"boundaries.{name}", text, *_FACETS)
        n, m = len(self._points), len(self._cells)
        if not m or len(self.cell_tags) != m:
            raise ValueError(f"regions: has {len(self.cell_tags)} numbers for {m} triangles")
        if m > MOST_TRIANGLES:
            raise ValueError(f"has {m} triangles; give {MOST_TRIANGLES} at most")
        if not np.isfinite(self._points).all():
            raise ValueError("points: has coordinates that are no numbers")
        for name, nodes in [
            ("cells", self._cells),
            *((f"boundaries.{name}", self.facets(name)) for name in self.boundaries),
        ]:
            if nodes.min(initial=0) < 0 or nodes.max(initial=-1) >= n:
                raise ValueError(f"{name}: names a node that there is not; there are {n}")
        smallest = determinant(jacobians(self.coordinates, LATTICE)).min(axis=1)
        worst = int(np.argmin(smallest))
        if smallest[worst] <= 0:
            place = xy(self.coordinates[worst, :3].mean(axis=0))
            raise ValueError(f"cells: a triangle is inverted at {place}; mesh it anew")
        return self


def sides(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sides of triangles: start, end and middle, counter-clockwise; (m, 3, 3)."""
    return np.stack([cells[:, [i, (i + 1) % 3, 3 + i]] for i in range(3)], axis=1)


def outer_sides(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the sides that belong to one of these triangles alone, as of `sides`; (n, 3)."""
    every = sides(cells).reshape(-1, 3)
    _, first, count = np.unique(
        np.sort(every[:, :2], axis=1), axis=0, return_index=True, return_counts=True
    )
    return every[np.sort(first[count == 1])]


def pieces(x: Array) -> Array:
    """Return straight pieces of quadratic sides (n, 3, 2): start, end, middle; (4 n, 2, 2)."""
    s = np.linspace(0.0, 1.0, PIECES + 1)
    shape = np.stack([(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)])
    points = np.einsum("is,nia->nsa", shape, x)
    return np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 2)


def area_of(points: Array, cells: NDArray[np.int64]) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the area that triangles cover."""
    lines = shapely.linestrings(pieces(points[outer_sides(cells)]))
    area = shapely.build_area(shapely.multilinestrings(np.asarray(lines)))
    assert isinstance(area, shapely.Polygon | shapely.MultiPolygon)
    return area


def joined(one: TriangleMesh, other: TriangleMesh) -> TriangleMesh:
    """Return two bodies as one mesh; they share no nodes."""
    n = len(one.points)
    return TriangleMesh(
        points=np.concatenate([one.points, other.points]),
        cells=np.concatenate([one.cells, other.cells + n]),
        cell_tags=np.concatenate([one.cell_tags, other.cell_tags]),
        facets=np.concatenate([one.facets, other.facets + n]),
        facet_tags=np.concatenate([one.facet_tags, other.facet_tags]),
        regions=one.regions | other.regions,
        boundaries=one.boundaries | other.boundaries,
    )


def _packed(values: NDArray[np.generic], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


@lru_cache(maxsize=32)  # some limbs and sockets; the arrays cannot be written to
def _unpacked(text: str, kind: str, columns: int) -> NDArray[np.generic]:
    values: NDArray[np.generic] = np.frombuffer(base64.b64decode(text), dtype=kind)
    return values.reshape(-1, columns) if columns else values


def _check_packed(name: str, text: str, kind: str, columns: int) -> None:
    try:
        size = len(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        raise ValueError(f"{name}: is not base64; import the mesh again") from None
    if size % (np.dtype(kind).itemsize * max(columns, 1)):
        raise ValueError(f"{name}: is cut off; import the mesh again")
