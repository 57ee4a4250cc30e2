"""Stress-free states of regions: swollen tissues, layers that are stretched on the limb."""

from collections.abc import Callable, Mapping

import numpy as np
from dolfinx import fem
from dolfinx.mesh import Mesh, MeshTags
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
StressFreeState = float | Callable[[FloatArray], FloatArray]
"""A stress-free state: a volume ratio, or in-plane tensors G (n, 2, 2) at positions (n, 2) in mm.

The volume ratio det G of 1.03 is a tissue that has swollen by 3 %, alike in both directions of the
plane, G = sqrt(1.03) I; along the limb it keeps its length.
"""

DEGREE = 2
"""Of the polynomial that G is in a cell: the direction around a limb changes by some degrees in it,
and what a parabola leaves of that is 1e-6 and less."""


class StressFree:
    """In-plane tensor G of a mesh's regions, by which `forms.mixed` has their stress-free state.

    At a share of the load it has gone that share of its way, I + load (G - I).

    Attributes
    ----------
    tensor : fem.Function or None
        G at the present load, a quadratic in each cell; None while no region has one.
    changes : int
        How often `tensor` has changed.
    """

    def __init__(self, mesh: Mesh, cell_tags: MeshTags, regions: Mapping[str, int]) -> None:
        self._mesh, self._cell_tags, self._regions = mesh, cell_tags, dict(regions)
        self.changes = -1
        self.clear()

    def clear(self) -> None:
        """Go back to where no region has a stress-free state of its own."""
        self._states: dict[str, StressFreeState] = {}
        self._full: FloatArray | None = None  # G - I at full load
        self._load = 1.0
        self.tensor: fem.Function | None = None
        self.changes += 1

    def set(self, states: Mapping[str, StressFreeState]) -> None:
        """Change the stress-free states of regions; the volume ratio 1 is the reference again.

        Raises
        ------
        ValueError
            If there is no such region, or a volume would not be left of it.
        """
        for name, state in states.items():
            if name not in self._regions:
                raise ValueError(f"stress-free state: no region {name}")
            if not callable(state) and not 0.0 < state < np.inf:
                raise ValueError(f"stress-free state of {name}: volume ratio {state:g}, not > 0")
        merged = {**self._states, **states}
        self._states = {name: state for name, state in merged.items() if state != 1.0}
        if not self._states:
            self.tensor = self._full = None
            self.changes += 1
            return
        if self.tensor is None:
            space = fem.functionspace(self._mesh, ("DG", DEGREE, (2, 2)))
            self.tensor = fem.Function(space, name="stress_free")
        self.tensor.interpolate(_identity)
        for name, state in self._states.items():
            cells = self._cell_tags.find(self._regions[name])
            if len(cells):
                self.tensor.interpolate(_rows(state), cells)
        self._full = self.tensor.x.array - np.tile(np.eye(2).ravel(), self.tensor.x.array.size // 4)
        self.set_load(self._load)

    def set_load(self, load: float) -> None:
        """Go to a share of the load, 0 to 1."""
        self._load = load
        if self.tensor is not None and self._full is not None:
            identity = np.tile(np.eye(2).ravel(), self._full.size // 4)
            self.tensor.x.array[:] = identity + load * self._full
            self.changes += 1

    def at(self, points: FloatArray) -> FloatArray:
        """G at points (q, 2) of the reference triangle in the owned cells, (m, q, 2, 2)."""
        assert self.tensor is not None
        space = self.tensor.function_space
        shape = space.element.basix_element.tabulate(0, points)[0, :, :, 0]
        dofs = space.dofmap.list[: self._mesh.topology.index_map(2).size_local]
        nodal = self.tensor.x.array.reshape(-1, 2, 2)[dofs]
        return np.asarray(np.einsum("qa,maij->mqij", shape, nodal))


def _identity(x: FloatArray) -> FloatArray:
    return np.repeat(np.eye(2).reshape(4, 1), x.shape[1], axis=1)


def _rows(state: StressFreeState) -> Callable[[FloatArray], FloatArray]:
    """As dolfinx interpolates a tensor: (4, n) at positions (3, n)."""
    if callable(state):
        return lambda x: np.asarray(state(x[:2].T)).reshape(-1, 4).T
    return lambda x: np.sqrt(state) * _identity(x)
