"""The error of a section's stresses and strains, estimated by recovery (Zienkiewicz and Zhu).

Stresses of quadratic triangles jump between cells. Averaged at the nodes and interpolated from
there, they are closer to the exact ones, so that the difference shows where the mesh is too coarse.
O. C. Zienkiewicz, J. Z. Zhu, Int. J. Numer. Methods Eng. 24 (1987) 337-357,
https://doi.org/10.1002/nme.1620240206
"""

import numpy as np
from numpy.typing import NDArray

from calfsocket.materials.tissues import TISSUES
from calfsocket.postprocess.fields import GAUSS_POINTS, SectionFields
from calfsocket.postprocess.levels import SHARES, level
from calfsocket.postprocess.quantities import EXTRAPOLATION, REPORTED, log_strain

SHARE = SHARES[-1]
"""Of a tissue's area, %, that stays below the level by which its errors are divided."""


def recovery_error(fields: SectionFields) -> NDArray[np.float64]:
    r"""Return the relative error of each cell, (n_cells,); 0 in tissues that are not reported.

    .. math:: \eta_K = \max_{c = s, \varepsilon}
        \left( \frac{1}{A_t} \int_K w^2 \, \frac{|c^* - c|^2}{L_t^2} \, dA \right)^{1/2},
        \qquad w = \min \left( 1, \frac{|c|}{L_t} \right)

    with s the deviator of the Cauchy stress, epsilon the logarithmic strain, c* either as averaged
    at the nodes over the cells of the tissue t and interpolated quadratically, A_t the tissue's
    area and L_t the level that 99.9 % of it stays below. So the squares sum up to the square of a
    tissue's relative error, whose size depends neither on how stiff the tissue is nor on how much
    there is of it. The weight w is there because levels are wanted: an error beside a large value
    moves them, one beside a small value does not. Fields that are linear across a tissue have no
    error; for smooth ones the root of the sum of squares falls with the square of the triangles'
    sides.

    The pressure is left out: where a tissue is nearly incompressible, no other quantity has it.
    """
    node, size = _node_of_tissue(fields)
    area = fields.gauss_area.sum(axis=1)
    weight = np.bincount(node.ravel(), np.repeat(area, 6), minlength=size)
    errors = []
    for components in (_deviator(fields.stress), log_strain(fields.elastic) * [1, 1, np.sqrt(2)]):
        at_nodes = EXTRAPOLATION @ components * area[:, None, None]
        summed = [
            np.bincount(node.ravel(), each.ravel(), minlength=size)
            for each in np.moveaxis(at_nodes, -1, 0)
        ]
        recovered = _AT_GAUSS_POINTS @ (np.stack(summed, axis=-1) / weight[:, None])[node]
        errors.append(_relative(fields, components, recovered - components))
    return np.sqrt(np.maximum(*errors))


def _relative(
    fields: SectionFields, components: NDArray[np.float64], error: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the square of each cell's weighted error over level and area of its tissue."""
    areas, magnitude = fields.gauss_area, np.linalg.norm(components, axis=-1)
    found = np.zeros(len(areas))
    for tissue in REPORTED:
        cells = fields.cells_of(tissue)
        if not len(cells) or not magnitude[cells].any():
            continue
        largest = level(magnitude[cells].ravel(), areas[cells].ravel(), SHARE)
        square = np.sum((error[cells] / largest) ** 2, axis=-1)
        weighted = np.minimum(magnitude[cells] / largest, 1.0) ** 2 * square * areas[cells]
        found[cells] = weighted.sum(axis=1) / areas[cells].sum()
    return found


def _deviator(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the deviator of s11, s22, s33, s12, its norm that of the tensor."""
    normal = stress[..., :3] - stress[..., :3].mean(axis=-1, keepdims=True)
    return np.concatenate([normal, np.sqrt(2) * stress[..., 3:]], axis=-1)


def _node_of_tissue(fields: SectionFields) -> tuple[NDArray[np.int64], int]:
    """Give nodes a number in each tissue, (n_cells, 6), and say how many there are."""
    numbers, node = np.unique(
        fields.cells * len(TISSUES) + fields.tissue[:, None], return_inverse=True
    )
    return node.reshape(fields.cells.shape), len(numbers)


def _quadratic(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the six shape functions at points of the reference triangle, (n, 6)."""
    r, s = points.T
    first, second, third = 1 - r - s, r, s
    corners = [each * (2 * each - 1) for each in (first, second, third)]
    sides = [4 * first * second, 4 * second * third, 4 * third * first]
    return np.column_stack([*corners, *sides])


_AT_GAUSS_POINTS = _quadratic(GAUSS_POINTS)
