"""A model whose held boundaries are moved: the loads of the verification problems."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.errors import SolveError
from calfsocket.model import Model
from calfsocket.solver import NewtonResult, Solver

FloatArray = NDArray[np.float64]


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

    def body(self, regions: Sequence[str]) -> tuple[NDArray[np.int32], FloatArray]:
        """Displacement unknowns of regions and the coefficients of their reference position.

        Returns
        -------
        dofs, reference : (n, 2) each
            Local indices, ghosts included, and the undeformed position in mm; zero for the cubic
            bubbles, whose functions are not needed for a position on quadratic triangles.
        """
        domain = self.section.mesh
        domain.topology.create_connectivity(2, 2)
        cells = np.flatnonzero(
            np.isin(self.region_ids(), [self.section.regions[name] for name in regions])
        )
        components = [self.V.sub(0).sub(c).dofmap for c in range(2)]
        layouts = [dofmap.dof_layout for dofmap in components]
        entities = [(0, i) for i in range(3)] + [(1, i) for i in range(3)] + [(2, 0)]
        at = np.array([[layout.entity_dofs(*e)[0] for layout in layouts] for e in entities])
        dofs = np.stack([components[c].list[cells][:, at[:, c]] for c in range(2)], axis=2)
        reference = np.zeros((len(cells), len(entities), 2))
        reference[:, :6] = domain.geometry.x[domain.geometry.dofmap[cells]][:, :, :2]
        unique, first = np.unique(dofs[:, :, 0].ravel(), return_index=True)
        assert len(unique) == len(first)
        return dofs.reshape(-1, 2)[first], reference.reshape(-1, 2)[first]

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
        dofs, reference = self.body(list(section.regions))
        on = np.zeros_like(self._constrained)
        facets = section.facet_tags.find(section.boundaries[boundary])
        on[self._facet_dofs(facets)] = True
        owned = on[dofs[:, 0]] & (dofs[:, 0] < self.V.dofmap.index_map.size_local)
        dofs, reference = dofs[owned], reference[owned]
        force = self._b.array_r[dofs]
        position = reference + self.w.x.array[dofs]
        torque = position[:, 0] @ force[:, 1] - position[:, 1] @ force[:, 0]
        total = self.comm.allreduce(np.array([*force.sum(axis=0), torque]))
        return total[:2], float(total[2])

    def _facet_dofs(self, facets: NDArray[np.int32]) -> NDArray[np.int32]:
        from dolfinx import fem

        return fem.locate_dofs_topological(self.V.sub(0).sub(0), 1, facets)


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
        dofs, reference = model.body(regions)
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        is_node = np.any(reference != 0.0, axis=1)
        moved = (reference + model.w.x.array[dofs]) @ rotation.T - reference
        moved[is_node] += shift
        model.w.x.array[dofs] = moved
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
