"""A model whose held boundaries are moved: prescribed displacements instead of an overclosure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.io.errors import SolveError
from calfsocket.mechanics.newton import NewtonResult, Solver
from calfsocket.mechanics.problem import Model

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """Displacement unknowns of some regions.

    Not all are values at nodes (the element has a bubble), so positions are given as unknowns, too.

    Attributes
    ----------
    dofs : (n, 2) int
        Local indices of the two components, ghosts included.
    reference : (n, 2) float
        Unknowns of the field that is the undeformed position, mm.
    shift : (n, 2) float
        Unknowns of the field that is 1 everywhere.
    """

    dofs: NDArray[np.int32]
    reference: FloatArray
    shift: FloatArray


class DrivenModel(Model):
    """A `Model` whose held unknowns keep prescribed values instead of zero.

    Attributes
    ----------
    prescribed : (n,) float
        Values of all local unknowns; those of held ones count.
    """

    def __init__(self, *args: Any, **keywords: Any) -> None:
        super().__init__(*args, **keywords)
        self.prescribed = np.zeros_like(self.w.x.array)

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual in N/mm; held unknowns have their distance from the prescribed value."""
        super().residual(x, f)
        f.array[self.held] -= self.prescribed[self.held]

    def body(self, regions: Sequence[str]) -> "Body":
        """Return the displacement unknowns of regions (collective)."""
        cells = np.flatnonzero(
            np.isin(self.region_ids(), [self.section.regions[name] for name in regions])
        )
        dofs, reference, shift = [], [], []
        for component in range(2):
            space, parent = self.V.sub(0).sub(component).collapse()
            position, one = fem.Function(space), fem.Function(space)
            position.interpolate(lambda x, c=component: x[c])
            one.interpolate(lambda x: np.ones(x.shape[1]))
            own = np.unique(space.dofmap.list[cells])
            dofs.append(np.asarray(parent, dtype=np.int32)[own])
            reference.append(position.x.array[own])
            shift.append(one.x.array[own])
        return Body(*(np.stack(values, axis=1) for values in (dofs, reference, shift)))

    def reaction(self, boundary: str) -> tuple[FloatArray, float]:
        """Force and torque that hold a boundary, at the last residual (collective).

        Parameters
        ----------
        boundary : str
            "tibia_medullary" or "socket_outer".

        Returns
        -------
        force, torque : (2,) float, float
            N per mm, and N mm per mm about the origin at the deformed positions.
        """
        section = self.section
        body = self.body(list(section.regions))
        facets = section.facet_tags.find(section.boundaries[boundary])
        held = fem.locate_dofs_topological(self.V.sub(0).sub(0), 1, facets)
        owned = np.isin(body.dofs[:, 0], held[held < self.V.dofmap.index_map.size_local])
        dofs = body.dofs[owned]
        force = self._b.array_r[dofs]
        position = body.reference[owned] + self.w.x.array[dofs]
        torque = position[:, 0] @ force[:, 1] - position[:, 1] @ force[:, 0]
        total = self.comm.allreduce(np.array([*force.sum(axis=0), torque]))
        return total[:2], float(total[2])


class Drive:
    """Moves bodies of a `DrivenModel` step by step.

    Parameters
    ----------
    model : DrivenModel
        At its start.

    Attributes
    ----------
    results : list of NewtonResult
        How Newton's method ended, step by step.
    """

    def __init__(self, model: DrivenModel) -> None:
        self.model = model
        self.solver = Solver(model)
        self.results: list[NewtonResult] = []

    def move(
        self, regions: Sequence[str], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Move regions as they are: turn about the origin by `angle` (rad), then shift (mm).

        Where they are held they keep the new place; elsewhere it is where Newton's method starts.
        """
        model, x = self.model, self.solver.x
        model.set_unknowns(x)
        body = model.body(regions)
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        moved = (body.reference + model.w.x.array[body.dofs]) @ rotation.T - body.reference
        model.w.x.array[body.dofs] = moved + body.shift * shift
        model.prescribed[:] = model.w.x.array
        x.array[:] = model.w.x.array[: len(x.array)]

    def solve(self) -> NewtonResult:
        """Find the equilibrium from the present start (collective).

        Raises
        ------
        SolveError
            If there is none.
        """
        result = self.solver.solve()
        self.results.append(result)
        if not result.converged:
            raise SolveError(f"no equilibrium: {result.reason}, {result.residual:.2g} N/mm")
        return result

    def step(
        self, regions: Sequence[str], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
    ) -> NewtonResult:
        """Count slip from the present state, move and solve (collective)."""
        self.model.set_unknowns(self.solver.x)
        self.model.contact.accept()
        self.move(regions, angle, shift)
        return self.solve()
