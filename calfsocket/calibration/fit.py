r"""Least squares on a force-displacement curve: Ogden's parameters of muscle and fascia combined.

The residuals are r_k = (F_k(theta) - F_k) / max F at the displacements of the reference curve, and
theta = (ln mu, alpha/10), with ln D1 as a third where it is free; otherwise D1 follows mu by
Poisson's ratio. An isochoric Ogden law in plane strain is even in alpha: towards alpha = 0 it
stiffens least, and a curve determines alpha less and less.
The parameters are fields on the mesh, so that each evaluation is a curve without compiling, and the
Jacobian takes differences to curves of neighbouring laws (`Indentation.curve`).

Far from the minimum the search could end in another one, at a large alpha with a small mu, whose
curve is flat at first and too steep in the end. In ln(F_k(theta) / F_k), where mu is all but
linear and the first points count as much as the last, there is none: a rough search with these
comes first.

Covariance is that of least squares, s^2 (J^T J)^-1 with s^2 = |r|^2 / (n - k). What is left here is
the difference between two models and not noise: it says how well the curve determines the
parameters, and is not a confidence interval.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calfsocket.calibration.indentation import Curve
from calfsocket.io.errors import InputError, SolveError
from calfsocket.materials.laws import Ogden

FloatArray = NDArray[np.float64]

NU = 0.495
"""Poisson's ratio of the combined material (the paper's note under Table 1)."""

ALPHA_SCALE = 10.0
SMALLEST_ALPHA, LARGEST_ALPHA = 0.5, 40.0
"""Range of the search. At the lower end the law stiffens as little as it can: stresses are within
1 % of those at alpha = 0 up to a stretch of 1.5."""

DIFFERENCE_STEP = 1e-3
"""Change of a scaled parameter for the Jacobian. Newton's tolerance leaves 1e-9 of the force."""

ROUGH_TOLERANCE, TOLERANCE = 1e-2, 1e-4
"""Relative change of the parameters, or of the sum of squares, at which a search is done."""


@dataclass(frozen=True)
class Fit:
    """Fitted parameters and how well they are determined."""

    law: Ogden
    start: Ogden  #: where the search began
    names: tuple[str, ...]  #: "mu", "alpha" and, where it was free, "d1"
    relative_covariance: FloatArray  #: of the parameters' relative changes, d ln theta, (k, k)
    rms: float  #: root mean square of the residuals, as a share of the largest force
    curves: int  #: curves solved

    @property
    def relative_deviation(self) -> FloatArray:
        """Standard deviation of each parameter, as a share of it."""
        return np.asarray(np.sqrt(np.diag(self.relative_covariance)))

    @property
    def alpha_at_limit(self) -> bool:
        """Whether alpha is at a limit of its range, so that the curve asks for more."""
        alpha = self.law.alpha[0]
        return bool(np.isclose([SMALLEST_ALPHA, LARGEST_ALPHA], alpha, rtol=1e-2).any())

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the parameters, (k, k)."""
        return self.relative_covariance / np.outer(self.relative_deviation, self.relative_deviation)


def ogden(mu: float, alpha: float, d1: float | None = None) -> Ogden:
    """Ogden's law of one term; D1 in 1/MPa from `NU` unless it is given."""
    by: dict[str, Any] = {"nu": NU} if d1 is None else {"d1": d1}
    # No other notation: the record says whether D1 follows from `NU`.
    return Ogden(mu=(mu,), alpha=(alpha,), **by).model_copy(update={"given": None})


def fit_curve(
    curve_of: Callable[[Ogden, Sequence[Ogden]], Curve],
    reference: FloatArray,
    start: Ogden,
    free_d: bool = False,
    on_curve: Callable[[Ogden, float], None] | None = None,
) -> Fit:
    """Fit the law whose curve is closest to the reference.

    Parameters
    ----------
    curve_of : callable
        Curve of a law and of neighbouring laws at the displacements of the reference; may raise
        `SolveError`.
    reference : (n,)
        Forces to match, N/mm.
    start : Ogden
        One term; its D1 counts only where it is fitted, too (`free_d`).
    free_d, on_curve
        `on_curve` is called with each law tried and its root mean square residual.

    Raises
    ------
    InputError
        For fewer points than parameters, or a start without a curve.
    """
    names = ("mu", "alpha", "d1") if free_d else ("mu", "alpha")
    k = len(names)
    if len(reference) <= k:
        raise InputError(f"points: are {len(reference)}; the fit needs more than {k}")
    largest = np.abs(reference).max()
    solved: dict[bytes, tuple[FloatArray, Any]] = {}

    def force(scaled: FloatArray) -> FloatArray:
        """Solve the curve, and its derivatives, unless that was done before."""
        if scaled.tobytes() not in solved:
            law = _law(scaled)
            neighbours = [_law(scaled + one) for one in DIFFERENCE_STEP * np.eye(k)]
            try:
                curve = curve_of(law, neighbours)
            except SolveError:
                # The search takes a shorter step where residuals are not finite.
                return np.full(len(reference), np.nan)
            change = (curve.varied_force - curve.force).T / DIFFERENCE_STEP
            solved[scaled.tobytes()] = (curve.force, change)
            if on_curve is not None:
                on_curve(law, _rms((curve.force - reference) / largest))
        return solved[scaled.tobytes()][0]

    def jacobian(scaled: FloatArray) -> FloatArray:
        force(scaled)
        return solved[scaled.tobytes()][1]

    limits = np.array([[-np.inf, np.inf], [SMALLEST_ALPHA, LARGEST_ALPHA], [-np.inf, np.inf]])
    limits[1] /= ALPHA_SCALE

    search = partial(least_squares, bounds=limits[:k].T, x_scale="jac")
    try:
        rough = search(
            lambda scaled: np.log(force(scaled) / reference),
            _scaled(start)[:k],
            lambda scaled: jacobian(scaled) / force(scaled)[:, None],
            xtol=ROUGH_TOLERANCE,
            ftol=ROUGH_TOLERANCE,
        )
        result = search(
            lambda scaled: (force(scaled) - reference) / largest,
            rough.x,
            lambda scaled: jacobian(scaled) / largest,
            xtol=TOLERANCE,
            ftol=TOLERANCE,
        )
    except ValueError as error:
        raise InputError(
            f"start: mu {1e3 * start.mu[0]:g} kPa, alpha {start.alpha[0]:g}: {error}"
        ) from error
    r = result.fun
    # d scaled / d ln theta is 1 for a logarithm, alpha itself for alpha.
    J = result.jac * np.where(np.arange(k) == 1, result.x, 1.0)
    covariance = (r @ r) / (len(r) - k) * np.linalg.inv(J.T @ J)
    return Fit(
        law=_law(result.x),
        start=start,
        names=names,
        relative_covariance=covariance,
        rms=_rms(r),
        curves=len(solved),
    )


def _scaled(law: Ogden) -> FloatArray:
    return np.array([np.log(law.mu[0]), law.alpha[0] / ALPHA_SCALE, np.log(law.d1)])


def _law(scaled: FloatArray) -> Ogden:
    d1 = float(np.exp(scaled[2])) if len(scaled) > 2 else None
    return ogden(float(np.exp(scaled[0])), ALPHA_SCALE * float(scaled[1]), d1)


def _rms(residuals: FloatArray) -> float:
    return float(np.sqrt(np.mean(residuals**2)))
