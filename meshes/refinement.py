"""A mesh refined where a first solution has its errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calfsocket.meshes.curves import Array
from calfsocket.meshes.quality import areas
from calfsocket.meshes.sizing import AdaptiveSize, MeshSize, SizeField, Sizes, Surroundings
from calfsocket.meshes.triangles import EQUILATERAL_AREA, SUBDIVISION

#: Order of the stresses' error in the sides of quadratic triangles.
ORDER = 2
#: How many times smaller than before a triangle's side may become: stresses grow without end in the
#: corners of stiff tissues, and would ask for ever smaller ones.
MOST_REFINED = 8.0
#: How many times larger it may become, where the first mesh's own size field lets it.
LARGEST = 2.0
#: Steps of sizes, as powers of 2. Solutions on several numbers of ranks differ in their last
#: digits, which must not reach the mesh.
ROUNDING = 1 / 32


@dataclass(frozen=True)
class WantedSizes:
    """Triangle sides that a solution asks for at points of a body, mm.

    A mesh has them times the factor by which the size of the first mesh is scaled.
    """

    points: Array  #: (n, 2)
    sizes: Array  #: (n,)


@dataclass(frozen=True)
class FirstError:
    """The error of a first solution, which meshes of several sizes may follow from."""

    x: Array  #: nodes of the triangles of the first mesh, (m, 6, 2), mm
    error: Array  #: of each of them; squares sum up to that of the whole, (m,)
    bodies: Sequence[NDArray[np.int64]]  #: triangles of the limb's side, and of the socket's


@dataclass(frozen=True)
class Refinement:
    """Wanted sizes of the two bodies, which overlap in space."""

    first: MeshSize  #: that of the first mesh, which no triangle exceeds
    limb: WantedSizes
    socket: WantedSizes

    @classmethod
    def of(cls, first: FirstError, size: AdaptiveSize) -> "Refinement":
        r"""Return the sizes by which so many triangles have the smallest error.

        .. math:: h \to h \left( \frac{\bar\eta}{\eta} \right)^{1 / (p + 1)}

        with the error :math:`\eta` of each triangle, which falls with :math:`h^{p + 1}`, p = 2, and
        is the same for all of the new ones. Where curves ask for smaller ones they are smaller.
        `size` says how many triangles there are.
        """
        sides = np.sqrt(areas(first.x) / EQUILATERAL_AREA)
        share = first.error ** (1.0 / (ORDER + 1))
        # One triangle becomes (h / new h)^2.
        mean = np.sqrt(np.sum(share**2) / size.triangles)
        ratio = np.divide(mean, share, out=np.full(len(share), LARGEST), where=share > 0.0)
        power = np.log2(np.clip(ratio, 1.0 / MOST_REFINED, LARGEST))
        sizes = sides * 2.0 ** (np.round(power / ROUNDING) * ROUNDING)
        points = np.einsum("qv,mvc->mqc", SUBDIVISION, first.x[:, :3])

        def wanted(cells: NDArray[np.int64]) -> WantedSizes:
            return WantedSizes(
                points[cells].reshape(-1, 2), np.repeat(sizes[cells], len(SUBDIVISION))
            )

        return cls(size.first, *map(wanted, first.bodies))


class RefinedSizes:
    """Element sizes of a body as a solution asks for them, and not larger than a bound."""

    def __init__(self, bound: MeshSize, own: Sizes, wanted: WantedSizes) -> None:
        self._size, self._wanted = bound, wanted.sizes
        self._bound = own.field(bound)
        self._around = Surroundings(wanted.points, self._bound)

    def field(self, size: MeshSize) -> SizeField:
        """Return the wanted sizes, scaled as this size is."""
        factor = size.largest / self._size.largest
        field = self._around.spread(factor * self._wanted, size)
        return replace(field, values=np.minimum(field.values, self._bound.values))
