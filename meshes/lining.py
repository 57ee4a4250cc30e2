"""A liner's shape: a layer of one thickness between skin and socket, and how a socket fits it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field

from calfsocket.io.errors import error_context
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict
from calfsocket.io.units import LENGTH, SHARE
from calfsocket.meshes import curves, tags
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.limb import Limb, Provenance
from calfsocket.meshes.socket import Socket, check_face, check_wall

Bond = Literal["limb", "socket"]
BONDS: tuple[Bond, ...] = get_args(Bond)


class Lining(Strict):
    """Shape of a liner.

    Attributes
    ----------
    thickness : float
        Of the liner before it is put on, mm.
    bonded : {"limb", "socket"}
        What it sticks to: the limb, so that it meets the socket in frictional contact, or the
        socket's inner face, so that it meets the skin.
    undersize : float
        Share by which every fibre around the limb is shorter before it is put on: that by which the
        liner's circumference is smaller.
    """

    thickness: Annotated[float, Written(LENGTH, "6 mm"), Field(gt=0, le=50)]
    bonded: Bond = "limb"
    undersize: Annotated[float, Written(SHARE, "5 %"), Field(ge=0, lt=0.5)] = 0.0

    def stress_free(self, fit: "Fit") -> Callable[[Array], Array] | None:
        r"""Return the tensors G of the liner's stress-free state at positions; None where it is I.

        .. math:: G = (1 - s)\, t \otimes t + n \otimes n

        with s the `undersize` and t the direction of the surface that it is bonded to, at the
        nearest point. The thickness is that of the stress-free liner.
        """
        return hoop(self.undersize, fit.bonded_to.direction) if self.undersize else None


def hoop(undersize: float, direction: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return tensors (n, 2, 2) at positions (n, 2) of fibres that are shorter along a direction."""

    def tensors(points: Array) -> Array:
        t = direction(points)
        return np.eye(2) - undersize * np.einsum("ni,nj->nij", t, t)

    return tensors


@dataclass(frozen=True)
class Worn:
    """What a socket's inner face is made for: a limb, with its liner."""

    limb: Limb
    skin: ClosedCurve  #: the surface that the socket meets

    @property
    def frame(self) -> Frame:
        """Where lateral and anterior are."""
        return self.limb.frame

    @property
    def source(self) -> Provenance | None:
        """What the limb was made from."""
        return self.limb.source


@dataclass(frozen=True)
class Fit:
    """Curves of a socket around a limb, with or without a liner, all undeformed.

    Attributes
    ----------
    inner, outer : ClosedCurve
        Faces of the socket.
    lining : ClosedCurve or None
        Free face of the liner: outside where it is bonded to the limb, inside where to the socket.
    surface, face : ClosedCurve
        What meets in contact: skin or liner, and socket or liner around it.
    bonded_to : ClosedCurve
        Surface that the liner sticks to; the skin without one.
    """

    inner: ClosedCurve
    outer: ClosedCurve
    lining: ClosedCurve | None
    surface: ClosedCurve
    face: ClosedCurve
    bonded_to: ClosedCurve


def fitted(limb: Limb, socket: Socket, liner: Lining | None = None) -> Fit:
    """Put a socket around a limb and its liner.

    The laws of sockets count from the liner's outer face: the skin moved outward by its thickness,
    for a liner inside the socket, too. Outlines are where they are drawn.

    Raises
    ------
    InputError
        When a face crosses itself, or a wall or the liner folds over.
    """
    skin = limb.skin
    if liner is None:
        inner, outer = socket.faces(limb)
        return Fit(inner, outer, None, skin, inner, skin)
    with error_context(tags.LINER):
        around = _layer(skin, liner.thickness, limb.frame, "the skin")
    inner, outer = socket.faces(Worn(limb, around))
    if liner.bonded == "limb":
        return Fit(inner, outer, around, around, inner, skin)
    with error_context(tags.LINER):
        within = _layer(inner, -liner.thickness, limb.frame, "the socket's inner face")
    return Fit(inner, outer, within, skin, within, inner)


def _layer(curve: ClosedCurve, thickness: float, frame: Frame, on: str) -> ClosedCurve:
    """Return the free face of a liner on a curve, outside it where its thickness is positive."""
    what, remedy = f"a liner of {abs(thickness):g} mm", "make the liner thinner"
    check_wall((curve, on), frame, thickness, what, remedy)
    face = curves.offset(curve, lambda points: np.full(len(points), thickness))
    check_face(face, frame, f"{what} on {on} crosses itself", remedy)
    return face
