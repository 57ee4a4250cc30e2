r"""Three ways to put a socket on a limb that end in the same problem of Signorini and Coulomb.

A socket that is too small can be let go in more than one way, and friction remembers which:

- ``closed``: the gaps are closed in proportion, the study's way (`ContactInterface`);
- ``stiffened``: the whole overclosure is there at once, and contact stiffens (`StiffeningContact`);
- ``shrunk``: the socket starts swollen and clear of the limb, and shrinks to its size, stress free,
  until it would fit no limb; true contact and friction from the first touch (`ExpandedSocket`).

All three run from load 0 to load 1 under the program's own `LoadStepper`.
"""

from collections.abc import Mapping

import numpy as np

from calfsocket.contact.expanded import ExpandedSocket, WholeOverclosure
from calfsocket.contact.interface import ContactInterface
from calfsocket.contact.parameters import Contact
from calfsocket.materials.law import Law
from calfsocket.mechanics.limb_problem import GUIDE_STIFFNESS, SocketSupport, limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.verification.sampling import FloatArray

FOUNDATION = 1e-2
"""Contact stiffness at half the load in MPa/mm, above the limb's own."""


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


DAMPING = 3e-5
"""Drag on the stiffened path: force per volume and way of a step, N/mm^3 per mm; it fades out with
the load. A limb whose fascia buckles may snap: there is no equilibrium near the last one then. With
the drag there is, and the limb moves on over the next steps."""

PATHS: dict[str, type[ContactInterface]] = {
    "closed": ContactInterface,
    "stiffened": StiffeningContact,
    "shrunk": ExpandedSocket,
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
