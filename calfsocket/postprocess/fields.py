"""The solved section as plain arrays: what quantities, files and pictures are made from."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calfsocket.materials.tissues import TISSUES
from calfsocket.meshes.quality import determinant, jacobians

# Reference coordinates of the 3-point rule of a triangle, which is that of Abaqus's CPE6H.
GAUSS_POINTS = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])


@dataclass(frozen=True)
class SectionFields:
    """Displacement, stress, deformation gradient and pressure of one case, collected on one rank.

    Nodes and cells stand in the mesh generator's order, so that nothing here depends on how the
    mesh was distributed. Cells are six-node triangles in VTK's order: three corners, then the
    mid-sides 01, 12, 20.
    """

    points: NDArray[np.float64]
    """Reference coordinates of the nodes, mm, (n_nodes, 2); +x lateral, +y anterior."""
    cells: NDArray[np.int64]
    """Node indices, (n_cells, 6)."""
    region: NDArray[np.int64]
    """Region id of each cell, (n_cells,)."""
    region_names: dict[int, str]
    region_tissues: dict[int, str]
    """By region id, one of `TISSUES`."""
    displacement: NDArray[np.float64]
    """mm, (n_nodes, 2)."""
    stress: NDArray[np.float64]
    """Cauchy stress s11, s22, s33, s12 at the Gauss points, kPa, (n_cells, 3, 4)."""
    deformation_gradient: NDArray[np.float64]
    """In-plane F at the Gauss points, (n_cells, 3, 2, 2); F33 = 1 (plane strain)."""
    pressure: NDArray[np.float64]
    """Of the mixed field at the Gauss points, kPa, > 0 in compression, (n_cells, 3)."""
    elastic_gradient: NDArray[np.float64] | None = None
    """Fe = F G^-1, which stresses and reported strains are of, where a region has a stress-free
    state G of its own; as `deformation_gradient`. None where it is F in all regions."""
    gauss_points: ClassVar[NDArray[np.float64]] = GAUSS_POINTS

    def __post_init__(self) -> None:
        n_nodes, n_cells = len(self.points), len(self.cells)
        shapes = {
            "points": (n_nodes, 2),
            "cells": (n_cells, 6),
            "region": (n_cells,),
            "displacement": (n_nodes, 2),
            "stress": (n_cells, 3, 4),
            "deformation_gradient": (n_cells, 3, 2, 2),
            "pressure": (n_cells, 3),
        }
        if self.elastic_gradient is not None:
            shapes["elastic_gradient"] = (n_cells, 3, 2, 2)
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, not {shape}")
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} has values that are not finite")
        if n_cells == 0:
            raise ValueError("cells is empty")
        if self.cells.min() < 0 or self.cells.max() >= n_nodes:
            raise ValueError(f"cells names nodes outside 0 to {n_nodes - 1}")
        for region in map(int, np.unique(self.region)):
            if region not in self.region_names:
                raise ValueError(f"region {region} has no name in region_names")
            tissue = self.region_tissues.get(region)
            if tissue not in TISSUES:
                raise ValueError(
                    f"region {region} has tissue {tissue!r}; allowed: {', '.join(TISSUES)}"
                )
        if np.linalg.det(self.deformation_gradient).min() <= 0:
            raise ValueError("deformation_gradient has det F <= 0: a cell is inverted")

    @property
    def elastic(self) -> NDArray[np.float64]:
        """In-plane deformation gradient from the stress-free state, (n_cells, 3, 2, 2)."""
        none = self.elastic_gradient is None
        return self.deformation_gradient if none else self.elastic_gradient  # type: ignore[return-value]

    @property
    def deformed(self) -> NDArray[np.float64]:
        """Deformed positions of the nodes, mm, (n_nodes, 2)."""
        return self.points + self.displacement

    def cells_of(self, *tissues: str) -> NDArray[np.int64]:
        """Return the indices of the cells of some tissues."""
        return np.flatnonzero(np.isin(self.tissue, [TISSUES.index(name) for name in tissues]))

    @cached_property
    def bodies(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Cells of the limb and of the socket; a liner is a part of the one it is bonded to."""
        socket, liner = self.cells_of("socket"), self.cells_of("liner")
        limb = np.setdiff1d(np.arange(len(self.cells)), [*socket, *liner])
        if np.intersect1d(self.cells[limb], self.cells[liner]).size:
            return np.sort(np.append(limb, liner)), socket
        return limb, np.sort(np.append(socket, liner))

    @cached_property
    def gauss_area(self) -> NDArray[np.float64]:
        """Area of the reference section that each Gauss point stands for, mm^2, (n_cells, 3)."""
        return np.abs(determinant(jacobians(self.points[self.cells], GAUSS_POINTS))) / 6

    @cached_property
    def tissue(self) -> NDArray[np.int64]:
        """Index into `TISSUES` of each cell, (n_cells,)."""
        ids, place = np.unique(self.region, return_inverse=True)
        return np.array([TISSUES.index(self.region_tissues[int(i)]) for i in ids])[place]
