"""A socket that starts wide and clear of the limb, is moved over it, and is let go."""

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import brentq

from calfsocket.contact.interface import ContactInterface
from calfsocket.io.fenics import cell_nodes
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]


class WholeOverclosure(ContactInterface):
    """Contact in which nothing is taken off the gaps."""

    def closing(self) -> FloatArray:
        """No part of the gaps, in mm; (n,)."""
        return np.zeros(len(self.points.weight))


CLEARANCE = 0.1
"""Smallest distance of the swollen socket from the limb, mm."""

GUIDE_STIFFNESS = 1e-5
"""Foundation in N/mm^3 of a floating socket that does not touch the limb yet; it fades out with the
load."""


class ExpandedSocket(WholeOverclosure):
    """True contact with a socket whose stress-free shape is wider until the load is 1.

    Contact and friction are there from the first touch, and nothing is taken off the gaps.

    The socket's undeformed nodes lie at c + (1 + s (1 - load)) (X - c), c the middle of its inner
    face and s, the `swelling`, such that it is clear of the limb by `CLEARANCE` at load 0. Its
    displacement counts from there; arc lengths along it, and so slip, are those at load 1.
    """

    swelling = 0.0
    _centre: FloatArray = np.zeros(2)

    def __init__(self, w: Any, section: SectionMesh, *arguments: Any) -> None:
        super().__init__(w, section, *arguments)
        *_, pair = arguments
        moved = [tags.SOCKET]
        if pair.socket == tags.LINER_SURFACE:  # a liner that is bonded to the socket
            moved.append(tags.LINER)
        cells = np.concatenate([section.cell_tags.find(section.regions[name]) for name in moved])
        self._centre = self.chain.reference[:, 2].mean(axis=0)
        self._nodes = np.unique(cell_nodes(section.mesh)[cells])
        self._unswollen = section.mesh.geometry.x[self._nodes, :2].copy()
        if self._smallest_gap(0.0) < CLEARANCE:
            self.swelling = brentq(lambda s: self._smallest_gap(s) - CLEARANCE, 0.0, 1.0)
        self.load = 0.0
        self.converged_arc = self._earlier_arc = self._initial_arc = self.state().projection.arc

    @property
    def load(self) -> float:
        """Share of the swelling that is gone, 0 to 1."""
        return self._load

    @load.setter
    def load(self, load: float) -> None:
        self._load = load
        if self.swelling:
            self._set_size(self.swelling * (1.0 - load))

    def socket_displacement(self) -> FloatArray:
        """Displacement of the nodes of the chain from their places at load 1, mm."""
        swollen = self.swelling * (1.0 - self.load) * (self.chain.reference - self._centre)
        return super().socket_displacement() + swollen

    def _set_size(self, swelling: float) -> None:
        """Move this rank's socket nodes to where they lie without stress."""
        self._mesh.geometry.x[self._nodes, :2] = self._unswollen + swelling * (
            self._unswollen - self._centre
        )

    def _smallest_gap(self, swelling: float) -> float:
        """Smallest gap to a swollen socket in mm (collective)."""
        position = self.deformed_points()
        at = self.chain.project(position, swelling * (self.chain.reference - self._centre))
        gap = np.sum((position - at.point) * at.normal, axis=1)
        return float(self.comm.allreduce(gap.min(initial=np.inf), op=MPI.MIN))
