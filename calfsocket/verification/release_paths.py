r"""Three ways to put a socket on a limb that end in the same problem of Signorini and Coulomb.

A socket that is too small can be let go in more than one way, and friction remembers which:

- ``closed``: the gaps are closed in proportion, the study's way (`ContactInterface`);
- ``stiffened``: the whole overclosure is there at once, and contact stiffens (`StiffeningContact`);
- ``shrunk``: the socket starts swollen and clear of the limb, and shrinks to its size, stress free,
  until it would fit no limb; true contact and friction from the first touch (`ShrinkingContact`).

All three run from load 0 to load 1 under the program's own `LoadStepper`.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from calfsocket.contact.interface import ContactInterface
from calfsocket.contact.parameters import Contact
from calfsocket.materials.law import Law
from calfsocket.mechanics.limb_problem import SocketSupport, limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.verification.sampling import FloatArray

FOUNDATION = 1e-2
"""Contact stiffness at half the load in MPa/mm, above the limb's own."""


class WholeOverclosure(ContactInterface):
    """Contact in which nothing is taken off the gaps."""

    def closing(self) -> FloatArray:
        """No part of the gaps, in mm; (n,)."""
        return np.zeros(len(self.points.weight))


class StiffeningContact(WholeOverclosure):
    r"""Contact through springs that stiffen until they are rigid.

    At load l the skin rests on normal springs of the stiffness e = FOUNDATION l^2/(1 - l)^2, and on
    tangential ones of e_t = e gamma_t/gamma with Coulomb's limit:

        p = e [-g]_+,    q = q0 - e_t ds, |q| <= mu p,

    q0 the shear at the last converged step and ds the slip since then. In Nitsche's form, with the
    skin's traction T and a share a = max(1 - gamma/e, 0) of it,

        trial pressure = a T.n - min(gamma, e) g,
        trial shear    = a T.e - min(gamma_t, e_t) (ds - q0/e_t),

    which has the same solution, and at l = 1, where e is infinite and a = 1, is contact proper.
    """

    @property
    def parameters(self) -> Contact:
        """Parameters with the stiffness of the present load."""
        rigid = self._rigid
        softened = min(1.0, self.stiffness / rigid.gamma)
        return rigid.model_copy(
            update={"gamma": softened * rigid.gamma, "gamma_t": softened * rigid.gamma_t}
        )

    @parameters.setter
    def parameters(self, parameters: Contact) -> None:
        self._rigid = parameters

    @property
    def stiffness(self) -> float:
        """Stiffness e of the normal springs, MPa/mm."""
        if self.load == 1.0:
            return np.inf
        return FOUNDATION * (self.load / (1.0 - self.load)) ** 2

    @property
    def traction_share(self) -> float:
        """Share a of the skin's own traction."""
        return max(0.0, 1.0 - self._rigid.gamma / self.stiffness) if self.load > 0.0 else 0.0

    def nominal_traction(self) -> FloatArray:
        """Share of T = P N that the trial values hold, MPa; (n, 2)."""
        return self.traction_share * super().nominal_traction()

    def nominal_traction_variation(self) -> FloatArray:
        """Return its derivative by the unknowns of each point's cell; (n, 2, k)."""
        return self.traction_share * super().nominal_traction_variation()

    def slip(self, arc: FloatArray) -> FloatArray:
        """Slip since the last converged step and the springs' deflection then, mm; (n,)."""
        return super().slip(arc) + self._deflection()

    def accept(self) -> None:
        """Take the slip so far as done, and remember the shear that springs hold (collective)."""
        self._earlier_shear = self._shear
        shear = self.state().traction.shear
        super().accept()
        self._shear = shear
        self.converged_arc = self.converged_arc + self._deflection()

    def revert(self) -> None:
        """Take the last `accept` back."""
        super().revert()
        self._shear = self._earlier_shear

    _shear: FloatArray | None = None
    _earlier_shear: FloatArray | None = None

    def _deflection(self) -> FloatArray | float:
        """Tangential deflection under the remembered shear at the present stiffness, mm."""
        if self._shear is None:
            return 0.0
        stiffness = self.stiffness * self._rigid.gamma_t / self._rigid.gamma
        return np.asarray(-self._shear / stiffness)


CLEARANCE = 0.1
"""Smallest distance of the swollen socket from the limb, mm."""

GUIDE_STIFFNESS = 1e-5
"""Foundation in N/mm^3 of a floating socket that does not touch the limb yet; it fades out with the
load."""


class ShrinkingContact(WholeOverclosure):
    """True contact with a socket whose stress-free shape is larger until the load is 1.

    The socket's undeformed nodes lie at c + (1 + s (1 - load)) (X - c), c the middle of its inner
    face and s, the `swelling`, such that it is clear of the limb by `CLEARANCE` at load 0. Its
    displacement counts from there; arc lengths along it, and so slip, are those at load 1.
    """

    swelling = 0.0
    _centre: FloatArray = np.zeros(2)

    def __init__(self, w: Any, section: SectionMesh, *arguments: Any) -> None:
        super().__init__(w, section, *arguments)
        cells = section.cell_tags.find(section.regions[tags.SOCKET])
        self._centre = self.chain.reference[:, 2].mean(axis=0)
        self._nodes = np.unique(section.mesh.geometry.dofmap[cells])
        self._unswollen = section.mesh.geometry.x[self._nodes, :2].copy()
        if self._smallest_gap(0.0) < CLEARANCE:
            self.swelling = brentq(lambda s: self._smallest_gap(s) - CLEARANCE, 0.0, 1.0)
        self.load = 0.0
        self.converged_arc = self._earlier_arc = self.state().projection.arc

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


DAMPING = 3e-5
"""Drag on the stiffened path: force per volume and way of a step, N/mm^3 per mm; it fades out with
the load. A limb whose fascia buckles may snap: there is no equilibrium near the last one then. With
the drag there is, and the limb moves on over the next steps."""

PATHS: dict[str, type[ContactInterface]] = {
    "closed": ContactInterface,
    "stiffened": StiffeningContact,
    "shrunk": ShrinkingContact,
}


def path_problem(
    path: str,
    section: SectionMesh,
    laws: Mapping[str, Law],
    contact: Contact | None = None,
    support: SocketSupport = "floating",
) -> Problem:
    """Make the problem of a limb in a socket that is put on by one of `PATHS`.

    The swollen socket is guided by an elastic foundation. The stiffening one drags on dashpots from
    where its foundation was last at rest: `FoundationTerm.rest` after each step moves them on.
    """
    fading = {
        "closed": {},
        "stiffened": dict.fromkeys(section.regions, DAMPING),
        "shrunk": {tags.SOCKET: GUIDE_STIFFNESS},
    }
    return limb_problem(section, laws, contact, support, PATHS[path], fading[path])
