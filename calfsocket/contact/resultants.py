"""What contact does as a whole: its force and moments, and the work of friction between states."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calfsocket.contact.interface import ContactInterface
from calfsocket.contact.nitsche import ContactState, traction_vector

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Resultants:
    """Resultants of the contact tractions on the skin.

    Attributes
    ----------
    force : (2,) float
        Force on the skin, N/mm; minus it is that on the socket.
    on_skin, on_socket : float
        Moment about the origin, N mm/mm, of the tractions on the skin at its deformed points, and
        of those on the socket at their closest points. Their sum is that of the gaps which the
        discrete contact has.
    pressing : float
        Integral of the contact pressure over the skin, N/mm.
    """

    force: FloatArray
    on_skin: float
    on_socket: float
    pressing: float


def resultants(contact: ContactInterface, state: ContactState) -> Resultants:
    """Integrate the tractions of a state over the skin (collective)."""
    weight, traction = contact.points.weight, traction_vector(state)
    force, pressing = contact.force(state)
    moments = [
        weight @ (at[:, 0] * traction[:, 1] - at[:, 1] * traction[:, 0])
        for at in (contact.deformed_points(), state.projection.point)
    ]
    on_skin, on_socket = contact.comm.allreduce(np.array(moments))
    return Resultants(force, float(on_skin), -float(on_socket), pressing)


@dataclass(frozen=True)
class Slid:
    """What friction does between two states, on one rank."""

    slip: FloatArray  #: (n,) slip of each skin point on the socket, mm
    work: FloatArray  #: (n,) work of friction there with the later shear, -q slip, N/mm

    @classmethod
    def between(
        cls, contact: ContactInterface, before: ContactState, after: ContactState
    ) -> "Slid":
        """Compare two states of an interface."""
        slip = contact.chain.slip(after.projection.arc, before.projection.arc)
        return cls(slip, -after.traction.shear * slip)
