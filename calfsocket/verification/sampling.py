"""Solved problems at points: bodies at quadrature points, contact on the skin's edges."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.contact.interface import ContactInterface
from calfsocket.io.fenics import evaluate
from calfsocket.materials.fields import LawFields
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]
Array = NDArray[Any]  # also long doubles and complex numbers


@dataclass(frozen=True)
class Points:
    """A solved body at n quadrature points."""

    #: (2, n) position and displacement, mm
    x: FloatArray
    u: FloatArray
    F: FloatArray  #: (2, 2, n) deformation gradient
    p: FloatArray  #: (n,) pressure, MPa, > 0 in tension
    weight: FloatArray  #: (n,) quadrature weight times area element, mm^2
    region: NDArray[np.int32]  #: (n,) region tag


def at_points(section: SectionMesh, w: fem.Function, fields: LawFields, degree: int = 8) -> Points:
    """Evaluate mixed unknowns at the points of a quadrature rule of some degree, on one rank."""
    domain = section.mesh
    points, weights = map(np.asarray, basix.make_quadrature(basix.CellType.triangle, degree))
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    u, p_dof = ufl.split(w)

    def values(expression: Any) -> NDArray[Any]:
        at_points = fem.Expression(expression, points, comm=domain.comm)
        return evaluate(at_points, domain, cells).reshape(len(cells) * len(points), -1).T

    area = np.abs(values(ufl.JacobianDeterminant(domain))[0])
    return Points(
        x=values(ufl.SpatialCoordinate(domain)),
        u=values(u),
        F=values(ufl.Identity(2) + ufl.grad(u)).reshape(2, 2, -1),
        p=values(fields.pressure_scale * p_dof)[0],
        weight=area * np.tile(weights, len(cells)),
        region=np.repeat(section.cell_regions(), len(points)),
    )


def edge_means(contact: ContactInterface, values: FloatArray) -> FloatArray:
    """Mean over each of this rank's skin edges of values at its points."""
    by_edge = -1, len(contact.edge_parameters)
    weight = contact.points.weight.reshape(by_edge)
    return np.asarray((weight * values.reshape(by_edge)).sum(axis=1) / weight.sum(axis=1))


def skin_mean(contact: ContactInterface, values: FloatArray) -> float:
    """Mean over the skin of values at its points (collective)."""
    weight = contact.points.weight
    comm = contact.comm
    return float(comm.allreduce(weight @ values) / comm.allreduce(weight.sum()))


def largest(comm: MPI.Comm, values: FloatArray) -> float:
    """Largest of the values of all ranks (collective)."""
    return float(comm.allreduce(values.max(initial=-np.inf), op=MPI.MAX))


def deviation(values: FloatArray, exact: FloatArray, weight: FloatArray) -> float:
    """Root mean square of a difference, over that of the exact values."""
    return float(np.sqrt(weight @ (values - exact) ** 2 / (weight @ exact**2)))


def triangle_shapes(at: FloatArray) -> FloatArray:
    """Shape functions of VTK's six-node triangle at reference coordinates (n, 2); (n, 6)."""
    x, y = at.T
    z = 1.0 - x - y
    return np.stack(
        [z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * z * x, 4 * x * y, 4 * y * z], axis=1
    )


def worst(values: Sequence[float] | FloatArray) -> float:
    """Largest magnitude."""
    return float(np.abs(values).max())
