"""A smooth map of the plane that takes points to given places and does not fold."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.distance import cdist

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array, xy

#: Numbers of small steps that are tried.
STEPS = 4, 8, 16, 32, 64
#: The largest gradient of a small displacement (its norm as a matrix). With less than 1 no two
#: points come together; half of it leaves room for what lies between the points that are looked at.
SMALL_STEP = 0.5
#: The smallest determinant of a map that is used. Below, what was 10 mm wide would be 0.2 mm.
SMALLEST_DETERMINANT = 0.02
#: Length that makes the equations well scaled, mm: half of a leg.
_UNIT = 50.0


@dataclass(frozen=True)
class ThinPlate:
    r"""Displacement that is given at some points and bends as little as possible between them.

    .. math:: u(x) = a + B x + \sum_i w_i\, U(|x - x_i|), \qquad U(r) = r^2 \ln r

    the minimiser of the integral of the squared second derivatives [1]_.

    Parameters
    ----------
    points, displacements : Array
        mm, shape (n, 2).
    slack : Array, optional
        How loosely each displacement holds, shape (n,): 0 exactly.

    References
    ----------
    .. [1] F. L. Bookstein, IEEE Trans. Pattern Anal. Mach. Intell. 11 (1989) 567-585,
       doi:10.1109/34.24792.
    """

    points: Array
    displacements: Array
    slack: Array | None = None

    @cached_property
    def _coefficients(self) -> Array:
        n = len(self.points)
        matrix = _system(self.points)
        if self.slack is not None:
            matrix[:n, :n] += np.diag(self.slack)
        right = np.concatenate([self.displacements, np.zeros((3, 2))])
        return np.asarray(np.linalg.solve(matrix, right), dtype=float)

    def at(self, x: Array) -> tuple[Array, Array]:
        """Return displacements, mm, and their gradients at points (m, 2): (m, 2) and (m, 2, 2)."""
        n, coefficients = len(self.points), self._coefficients
        weights = coefficients[:n]
        x, points = np.asarray(x / _UNIT, dtype=float), np.asarray(self.points / _UNIT, dtype=float)
        square = np.maximum(cdist(x, points, "sqeuclidean"), 1e-30)
        logarithm = np.log(square)
        value = (square * logarithm / 2) @ weights
        value += coefficients[n] + x @ coefficients[n + 1 :]
        # The gradient of U is (x - x_i) (ln r^2 + 1): sums over i with weights w_i and w_i x_i.
        moments = np.column_stack([weights, *(weights[:, [c]] * points for c in (0, 1))])
        sums = (logarithm + 1) @ moments
        gradient = sums[:, :2, None] * x[:, None] - sums[:, 2:].reshape(-1, 2, 2)
        return value, (gradient + coefficients[n + 1 :].T) / _UNIT


def _system(points: Array) -> Array:
    """Return the matrix of the equations for the coefficients, (n + 3, n + 3)."""
    n = len(points)
    square = cdist(points / _UNIT, points / _UNIT, "sqeuclidean")
    matrix = np.zeros((n + 3, n + 3))
    matrix[:n, :n] = square * np.log(np.maximum(square, 1e-30)) / 2
    matrix[:n, n] = matrix[n, :n] = 1.0
    matrix[:n, n + 1 :] = points / _UNIT
    matrix[n + 1 :, :n] = points.T / _UNIT
    return matrix


def bending_energy(points: Array) -> Array:
    """Return the matrix L for which u @ L @ u is the energy of displacements u at points (n, n)."""
    n = len(points)
    return np.asarray(np.linalg.inv(_system(points))[:n, :n], dtype=float)


@dataclass(frozen=True)
class SmoothMap:
    """An affine map and then a sequence of small displacements.

    Attributes
    ----------
    matrix, shift : Array
        Of the affine map x -> matrix @ x + shift, mm.
    steps : tuple of ThinPlate
        Each from where the one before has led.
    """

    matrix: Array
    shift: Array
    steps: tuple[ThinPlate, ...] = ()

    def __call__(self, x: Array) -> Array:
        """Return where points (n, 2) come, mm."""
        return self.with_gradient(x)[0]

    def with_gradient(self, x: Array) -> tuple[Array, Array]:
        """Return where points (n, 2) come, mm, and the gradients of the map there, (n, 2, 2)."""
        place = np.asarray(x, dtype=float) @ self.matrix.T + self.shift
        gradient = np.broadcast_to(self.matrix, (len(place), 2, 2))
        for step in self.steps:
            displacement, slope = step.at(place)
            place = place + displacement
            gradient = gradient + slope @ gradient
        return place, gradient

    def determinant(self, x: Array) -> Array:
        """Return by how much the map enlarges areas at points, shape (n,)."""
        return np.asarray(np.linalg.det(self.with_gradient(x)[1]))


def best_affine(source: Array, target: Array) -> SmoothMap:
    """Return the affine map that takes points nearest to others, by least squares."""
    base = np.column_stack([source, np.ones(len(source))])
    solution = np.asarray(np.linalg.lstsq(base, target, rcond=None)[0], dtype=float)
    return SmoothMap(solution[:2].T, solution[2])


def fitted(
    source: Array,
    target: Array,
    samples: Array,
    slack: Array | None = None,
    at: Callable[[Array], str] = xy,
) -> tuple[SmoothMap, Array]:
    r"""Return a map from points to others without folds.

    The best affine map comes first. The points then move on straight lines to their places, in so
    many steps that each is small. A map x + u(x) has an inverse where the gradient of u is smaller
    than 1, for it brings no two points together, and a sequence of such maps has one too. A single
    thin-plate spline may fold.

    Parameters
    ----------
    source, target : Array
        Corresponding points, mm, shape (n, 2).
    samples : Array
        Points all over the region that is mapped, mm, at which folds are looked for.
    slack : Array, optional
        How loosely the correspondence holds, as of `ThinPlate`.
    at : callable
        Words for a place, for errors.

    Returns
    -------
    SmoothMap
        The map.
    Array
        Its determinant at the samples.

    Raises
    ------
    InputError
        When the map folds, or squeezes an area to less than `SMALLEST_DETERMINANT` of its size.
    """
    affine = best_affine(source, target)
    if np.linalg.det(affine.matrix) <= 0:
        raise InputError("the section is a mirror image of the atlas; correct its side or axes")
    for number in STEPS:
        smooth, determinant, steepest = _in_steps(affine, source, target, samples, slack, number)
        if steepest is None:
            break
    if steepest is not None:
        raise InputError(
            f"the atlas would fold near {at(affine(samples[[steepest]])[0])}: outer curve and bones"
            " lie too differently; correct the outlines, or choose another level, or tissues lumped"
        )
    worst = int(np.argmin(determinant))
    if determinant[worst] < SMALLEST_DETERMINANT:
        raise InputError(
            f"the atlas would be squeezed to {determinant[worst]:.1%} of its area at"
            f" {at(smooth(samples[[worst]])[0])}: too little room between the muscles' edge and the"
            " bones; choose another level, or tissues lumped"
        )
    return smooth, determinant


def _in_steps(
    affine: SmoothMap,
    source: Array,
    target: Array,
    samples: Array,
    slack: Array | None,
    number: int,
) -> tuple[SmoothMap, Array, int | None]:
    """Return the map, its determinants, and the sample at which a step is not small, if any."""
    start, moving = affine(source), affine(samples)
    total = np.full(len(samples), np.linalg.det(affine.matrix))
    steps = []
    for i in range(number):
        here = start + i / number * (target - start)
        step = ThinPlate(here, (target - start) / number, slack)
        displacement, slope = step.at(moving)
        steps.append(step)
        size = np.linalg.norm(slope, 2, axis=(1, 2))
        if size.max() > SMALL_STEP:
            return affine, total, int(size.argmax())
        moving = moving + displacement
        total *= np.linalg.det(np.eye(2) + slope)
    return SmoothMap(affine.matrix, affine.shift, tuple(steps)), total, None
