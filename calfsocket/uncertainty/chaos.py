r"""Sparse polynomial chaos of an output, with its cross-validated error.

.. math:: y(x) = \sum_\alpha c_\alpha \prod_i \psi^i_{\alpha_i}(x_i)

with polynomials that are orthonormal under each input's own distribution (Hermite's of the
underlying normal number where an input is normal, lognormal or correlated). OpenTURNS makes the
polynomials and selects the terms by least angle regression (Blatman and Sudret 2011,
doi:10.1016/j.jcp.2010.12.021).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from calfsocket.uncertainty.inputs import Array, Joint, uniform_design

TRUSTED = 0.9
"""Least Q2 of a chaos whose numbers may be quoted."""

FOLDS = 10
"""Parts of the cases that are left out in turn, to judge what the rest predicts of them."""

TERMS_PER_CASE = 3
"""Terms to choose from for each case: a degree that has more is not tried."""

MOST_DEGREE = 12

PATIENCE = 3
"""Degrees that are tried beyond the best one so far."""

PROJECTED, MOST_PROJECTED = 2**12, 300
"""Points by which the exponential of a chaos is developed, and most terms of it."""

SAMPLE = 2**14
"""Points at which a chaos is evaluated for its quantiles."""

BAND = (0.025, 0.975)
"""Shares below the ends of a band of 95 %."""

DEPENDENT = 1e-8
"""A column with less than this share of its length beside the columns before it has only rounding
of its own."""

Multi = NDArray[np.int64]


class Basis:
    """Polynomials of inputs, orthonormal under their joint distribution.

    Correlated inputs are replaced by independent standard normal numbers.
    """

    def __init__(self, joint: Joint) -> None:
        self.joint = joint
        self._lower = np.linalg.cholesky(joint.correlation)
        self._hermite = [
            bool(dependent) or (each.distribution in ("normal", "lognormal") and not each.bounds)
            for dependent, each in zip(joint.dependent, joint.marginals, strict=True)
        ]
        self._scales = [_mean_and_sd(each.openturns()) for each in joint.marginals]
        self._most = [each.terms if each.discrete else MOST_DEGREE for each in joint.marginals]
        self._coefficients = [self._polynomials(i) for i in range(len(joint.names))]

    def _polynomials(self, i: int) -> list[Array]:
        """Return the coefficients of an input's polynomials, by degree."""
        import openturns as ot

        measure = (
            ot.Normal() if self._hermite[i] else self.joint.marginals[i].openturns(*self._scales[i])
        )
        factory = ot.StandardDistributionPolynomialFactory(ot.AdaptiveStieltjesAlgorithm(measure))
        return [np.array(factory.build(k).getCoefficients()) for k in range(self._most[i] + 1)]

    def germs(self, values: Array) -> Array:
        """Return what the polynomials are of, at values of the inputs, (n, d)."""
        independent = np.linalg.solve(self._lower, self.joint.normal(values).T).T
        mean, sd = np.array(self._scales).T
        return np.where(self._hermite, independent, (values - mean) / sd)

    @cached_property
    def sample(self) -> Array:
        """The variables at a sample of the inputs, (SAMPLE, d)."""
        cube = uniform_design("sobol", SAMPLE, len(self.joint.names), seed=0)
        return self.germs(self.joint.at(cube))

    def terms(self, degree: int, among: Sequence[int] | None = None) -> Multi:
        """Return the exponents of all terms in some inputs up to a total degree, (terms, d)."""
        d = len(self.joint.names)
        inputs = range(d) if among is None else among
        rows = [
            np.bincount(chosen, minlength=d) if chosen else np.zeros(d, dtype=int)
            for total in range(degree + 1)
            for chosen in combinations_with_replacement(inputs, total)
        ]
        every = np.array(rows)
        kept = (every <= self._most).all(axis=1)
        # a choice of many values by itself has terms of any degree
        extra = [
            np.eye(d, dtype=int)[i] * k
            for i in inputs
            if self.joint.marginals[i].discrete
            for k in range(degree + 1, self._most[i] + 1)
        ]
        return np.vstack([every[kept], *extra]).astype(np.int64)

    def evaluate(self, terms: Multi, germs: Array) -> Array:
        """Return the values of terms, (n, terms)."""
        return self.rows(terms, germs).T

    def rows(self, terms: Multi, germs: Array) -> Array:
        """Return the values of terms, a row each, (terms, n)."""
        found = np.ones((len(terms), len(germs)))
        for i, polynomials in enumerate(self._coefficients):
            touched = np.flatnonzero(terms[:, i])  # a few of all: the first polynomial is 1
            if not len(touched):
                continue
            degrees = terms[touched, i]
            table = np.stack([
                np.polynomial.polynomial.polyval(germs[:, i], polynomials[k])
                for k in range(degrees.max() + 1)
            ])  # fmt: skip
            found[touched] *= table[degrees]
        return found


def _mean_and_sd(distribution: object) -> tuple[float, float]:
    mean, sd = distribution.getMean()[0], distribution.getStandardDeviation()[0]  # type: ignore[attr-defined]
    return float(mean), float(sd)


@dataclass(frozen=True, eq=False)
class Chaos:
    """A polynomial chaos of one output.

    Attributes
    ----------
    basis : Basis
        Of its inputs.
    terms : array
        Exponents of its terms, (terms, d), the constant first.
    coefficients : array
        (terms,)
    residuals : array
        By how much each case differs from what a chaos without it says, (n,).
    q2 : float
        1 minus the mean square of the residuals over the variance of the cases; NaN where all
        cases are the same.
    """

    basis: Basis
    terms: Multi
    coefficients: Array
    residuals: Array
    q2: float

    @property
    def mean(self) -> float:
        """Mean of the output."""
        return float(self.coefficients[0])

    @property
    def variance(self) -> float:
        """Variance of the output, without what the chaos does not explain."""
        return float((self.coefficients[1:] ** 2).sum())

    @property
    def trusted(self) -> bool:
        """Whether its numbers may be quoted."""
        return not self.q2 < TRUSTED

    def at_germs(self, germs: Array) -> Array:
        """Return the output where the basis's variables have some values, (n,)."""
        return self.coefficients @ self.basis.rows(self.terms, germs)

    def __call__(self, values: Array) -> Array:
        """Return the output at values of the inputs, (n,)."""
        return self.at_germs(self.basis.germs(values))

    @cached_property
    def sample(self) -> Array:
        """Outputs at a sample of the inputs, each with a residual, (SAMPLE,).

        With residuals a band is not too narrow where the chaos explains little.
        """
        return self.at_germs(self.basis.sample) + self.residuals[drawn(len(self.residuals))]

    @property
    def sd(self) -> float:
        """Standard deviation, with what the chaos does not explain."""
        return float(np.sqrt(self.variance + np.mean(self.residuals**2)))


def drawn(n: int) -> NDArray[np.int64]:
    """Return a number below n for each point of a sample; the same for all outputs."""
    return np.random.default_rng(0).integers(n, size=SAMPLE)


def fit(basis: Basis, values: Array, output: Array) -> Chaos:
    """Fit a chaos to an output (n,) of cases at values of the inputs (n, d).

    The degree is that with the largest Q2, by `FOLDS`-fold cross-validation in which terms are
    selected anew without each part. Where all cases are above 0, and the exponential of a chaos of
    the logarithm predicts them better, it is that, developed in the polynomials in its turn.
    """
    plain = _fit(basis, values, output)
    if not output.min() > 0 or not plain.q2 < 1:
        return plain
    bent = _fit(basis, values, np.log(output))
    residuals = output - output * np.exp(-bent.residuals)
    q2 = 1 - float(np.mean(residuals**2) / np.var(output))
    return _exponential(bent, residuals, q2) if q2 > plain.q2 else plain


def _exponential(bent: Chaos, residuals: Array, q2: float) -> Chaos:
    """Develop the exponential of a chaos in the polynomials of the inputs that it has."""
    basis, germs = bent.basis, bent.basis.sample[:PROJECTED]
    used = [int(i) for i in np.flatnonzero(bent.terms.any(axis=0))]
    terms = basis.terms(1, used)
    for degree in range(2, MOST_DEGREE + 1):
        larger = basis.terms(degree, used)
        if len(larger) > MOST_PROJECTED:
            break
        terms = larger
    target = np.exp(bent.at_germs(germs))
    coefficients = np.linalg.lstsq(basis.evaluate(terms, germs), target)[0]
    return Chaos(basis, terms, coefficients, residuals, q2)


def _fit(basis: Basis, values: Array, output: Array) -> Chaos:
    """Fit a chaos to an output as it is."""
    constant = np.zeros((1, values.shape[1]), dtype=np.int64)
    if np.ptp(output) <= 1e-12 * np.abs(output).max():
        return Chaos(basis, constant, output[:1] * 1.0, np.zeros(len(output)), np.nan)
    germs = basis.germs(values)
    residuals: Array = output - output.mean()
    terms: Multi = constant
    matrix: Array = np.ones((len(output), 1))
    best, most = 0, TERMS_PER_CASE * len(output)
    for degree in range(1, MOST_DEGREE + 1):
        candidates = basis.terms(degree)
        if degree > 1 and (len(candidates) > most or degree > best + PATIENCE):
            break
        columns = basis.evaluate(candidates, germs)
        left_out = _left_out(columns, output)
        if np.mean(left_out**2) < np.mean(residuals**2):
            best, residuals, terms, matrix = degree, left_out, candidates, columns
    coefficients = select(matrix, output)
    kept = coefficients != 0
    kept[0] = True
    q2 = 1 - float(np.mean(residuals**2) / np.var(output))
    return Chaos(basis, terms[kept], coefficients[kept], residuals, q2)


def _left_out(matrix: Array, output: Array) -> Array:
    """Return the differences of cases from what is fitted without them."""
    residuals = np.empty(len(output))
    fold = np.arange(len(output)) % min(FOLDS, len(output))
    for each in range(fold.max() + 1):
        out = fold == each
        coefficients = select(matrix[~out], output[~out])
        residuals[out] = output[out] - matrix[out] @ coefficients
    return residuals


@cache
def _coordinates(p: int) -> list[object]:
    """Return the functions that OpenTURNS selects from: the columns of a matrix with p of them."""
    import openturns as ot

    return [
        ot.LinearFunction(ot.Point(p), ot.Point(1), ot.Matrix([row.tolist()])) for row in np.eye(p)
    ]


def select(matrix: Array, output: Array) -> Array:
    """Select columns by least angle regression; return their coefficients, 0 of the others.

    As many as have the smallest corrected leave-one-out error.
    """
    if matrix.shape[1] == 1:
        return np.array([output.mean()])
    if not _deficient(matrix):
        return _least_angle(matrix, output)
    kept = independent(matrix)
    coefficients = np.zeros(matrix.shape[1])
    coefficients[kept] = _least_angle(matrix[:, kept], output)
    return coefficients


def _deficient(matrix: Array) -> bool:
    """Whether columns are combinations of others, or cases where there are more columns.

    Least angle regression then ends early (OpenTURNS 1.24), or is refused (1.27).
    """
    upright = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    own = np.abs(np.diag(np.linalg.qr(upright, mode="r")))
    return bool((own <= DEPENDENT * np.linalg.norm(upright, axis=0)).any())


def independent(matrix: Array) -> NDArray[np.int64]:
    """Return the columns that are no combination of those before them."""
    basis = np.empty((len(matrix), 0))
    kept = []
    for number, column in enumerate(matrix.T):
        rest = column - basis @ (basis.T @ column)
        rest -= basis @ (basis.T @ rest)  # what rounding has left of it
        length = np.linalg.norm(rest)
        if length > DEPENDENT * np.linalg.norm(column):
            basis = np.column_stack([basis, rest / length])
            kept.append(number)
    return np.array(kept)


def _least_angle(matrix: Array, output: Array) -> Array:
    """Select among columns as `select` does, the constant the first of them."""
    import openturns as ot

    n, p = matrix.shape
    centre, scale = output.mean(), output.std() or 1.0
    method = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
    algorithm = method.build(
        ot.Sample(matrix),
        # least angle regression stops at once where the constant has no part in the output
        ot.Sample((1.0 + (output - centre) / scale)[:, None]),
        ot.Point(n, 1.0 / n),
        _coordinates(p),
        ot.Indices(range(p)),
    )
    algorithm.run()
    coefficients = np.array(algorithm.getCoefficients()) * scale
    coefficients[0] += centre - scale
    return coefficients
