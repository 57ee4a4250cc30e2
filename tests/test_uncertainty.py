"""Designs, chaos and shares of uncertain inputs, against functions whose answers are known."""

from math import pi

import numpy as np
import pytest
from scipy.stats import norm, spearmanr

from calfsocket.uncertainty.chaos import Basis, fit, independent, select
from calfsocket.uncertainty.failures import pattern
from calfsocket.uncertainty.field import fit_field
from calfsocket.uncertainty.inputs import Uncertainty
from calfsocket.uncertainty.shares import Explained


def uniform(low: float, high: float) -> dict[str, object]:
    return {"distribution": "uniform", "low": low, "high": high}


def normal(mean: float, sd: float) -> dict[str, object]:
    return {"distribution": "normal", "mean": mean, "sd": sd}


def inputs(cases: int = 40, **tables: object) -> Uncertainty:
    return Uncertainty(cases=cases, inputs=tables)


LINEAR = {"a": normal(1, 0.5), "b": normal(2, 0.25), "c": normal(0, 1)}


def linear(x: np.ndarray) -> np.ndarray:
    """Parts of the variance: (3/2)^2, 1 and 2^2."""
    return 3 * x[:, 0] + 4 * x[:, 1] - 2 * x[:, 2]


# ----- functions with known answers


def test_ishigami_and_homma_have_their_sobol_indices():
    """Ishigami and Homma 1990: sin x1 + 7 sin^2 x2 + 0.1 x3^4 sin x1."""
    table = inputs(200, x1=uniform(-pi, pi), x2=uniform(-pi, pi), x3=uniform(-pi, pi))
    x, basis = table.drawn, Basis(table.joint)
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    chaos = fit(basis, x, y)
    shares = Explained(basis)(chaos)
    v1, v2 = 0.5 * (1 + 0.1 * pi**4 / 5) ** 2, 49 / 8
    v13 = 0.01 * pi**8 * (1 / 18 - 1 / 50)
    total = v1 + v2 + v13
    assert chaos.q2 > 0.999 and chaos.trusted
    assert chaos.mean == pytest.approx(3.5, rel=1e-3)
    assert chaos.variance == pytest.approx(total, rel=1e-2)
    assert shares.first == pytest.approx([v1 / total, v2 / total, 0], abs=5e-3)
    assert shares.total == pytest.approx([(v1 + v13) / total, v2 / total, v13 / total], abs=5e-3)
    assert shares.order == [1, 0, 2]  # by the means of both: 0.442, 0.436 and 0.122


def test_a_linear_function_of_normal_inputs_is_exact():
    table = inputs(**LINEAR)
    basis = Basis(table.joint)
    chaos = fit(basis, table.drawn, linear(table.drawn))
    shares = Explained(basis)(chaos)
    assert (chaos.mean, chaos.variance) == pytest.approx((11, 7.25), rel=1e-9)
    assert chaos.q2 == pytest.approx(1, abs=1e-9)
    for each in (shares.first, shares.total):
        assert each == pytest.approx(np.array([2.25, 1, 4]) / 7.25, rel=1e-6)
    ends = np.quantile(chaos.sample, [0.025, 0.975])
    exact = norm(11, np.sqrt(7.25)).ppf([0.025, 0.975])
    assert ends == pytest.approx(exact, abs=0.02 * np.sqrt(7.25))


def test_correlated_inputs_have_what_they_explain_alone_and_what_only_they_do():
    """With r between a and b: Var E[y|a] = (1.5 + r)^2, Var y - Var E[y|b, c] = 1.5^2 (1 - r^2)."""
    table = Uncertainty(
        cases=60, inputs=LINEAR, correlations=[{"between": ("a", "b"), "rank": 0.6}]
    )
    r = 2 * np.sin(pi * 0.6 / 6)
    assert table.correlation[0, 1] == pytest.approx(r)
    basis = Basis(table.joint)
    chaos = fit(basis, table.drawn, linear(table.drawn))
    shares = Explained(basis)(chaos)
    variance = 2.25 + 1 + 2 * 1.5 * r + 4
    assert chaos.variance == pytest.approx(variance, rel=1e-6)
    alone = np.array([(1.5 + r) ** 2, (1 + 1.5 * r) ** 2, 4]) / variance
    only = np.array([2.25 * (1 - r**2), 1 - r**2, 4]) / variance
    assert shares.first == pytest.approx(alone, rel=0.02)
    assert shares.total == pytest.approx(only, rel=0.02)
    assert list(table.joint.dependent) == [True, True, False]
    assert shares.first[2] == pytest.approx(4 / variance, rel=1e-6)  # exact, as it depends on none


def test_a_choice_and_bounded_inputs_keep_their_families():
    values = {"p": 1.0, "t": 5.0, "q": 2.0}
    table = inputs(
        120,
        law={"distribution": "choice", "values": list(values), "weights": [1, 1, 2]},
        mu={"distribution": "lognormal", "mean": "2 kPa", "cv": "30 %"},
        wall={"distribution": "triangular", "low": "1 mm", "mode": "0.2 cm", "high": "4 mm"},
        share={"distribution": "beta", "low": 0, "high": 1, "mean": 0.3, "cv": "50 %"},
        friction={"distribution": "normal", "mean": 0.4, "sd": 0.2, "low": 0.1},
    )
    x, basis = table.drawn, Basis(table.joint)
    of_law = np.array([*values.values()])[x[:, 0].astype(int)]
    chaos = fit(basis, x, of_law + np.log(x[:, 1]) + x[:, 2] + x[:, 3] + 0 * x[:, 4])
    shares = Explained(basis)(chaos)
    # variances of a choice, a normal logarithm, a triangular and a beta distribution
    law = np.average([1, 25, 4], weights=[1, 1, 2]) - np.average([1, 5, 2], weights=[1, 1, 2]) ** 2
    parts = np.array([law, np.log1p(0.09), (1 + 4 + 16 - 2 - 4 - 8) / 18, 0.15**2, 0])
    assert chaos.q2 > 0.9999
    assert chaos.variance == pytest.approx(parts.sum(), rel=1e-4)
    assert shares.total == pytest.approx(parts / parts.sum(), abs=1e-3)


def test_a_product_is_fitted_by_its_logarithm_and_keeps_its_sobol_indices():
    """y = a^2 b with lognormal a, b: 1 + the part of each is exp(of its logarithm's variance)."""
    moduli = {"distribution": "lognormal", "mean": 1, "cv": "50 %"}
    table = inputs(25, a=moduli, b=moduli, c=uniform(0, 1))
    x, basis = table.drawn, Basis(table.joint)
    y = x[:, 0] ** 2 * x[:, 1]
    chaos = fit(basis, x, y)
    assert chaos.q2 > 0.999
    own = np.exp(np.log(1.25) * np.array([4.0, 1.0])) - 1
    variance = (1 + own[0]) * (1 + own[1]) - 1
    mean = 1.25  # E[a^2] = (E a)^2 (1 + cv^2), E[b] = 1
    assert chaos.mean == pytest.approx(mean, rel=0.01)
    assert chaos.variance / chaos.mean**2 == pytest.approx(variance, rel=0.05)
    shares = Explained(basis)(chaos)
    assert shares.first[:2] == pytest.approx(own / variance, abs=0.02)
    assert shares.total[2] == pytest.approx(0, abs=1e-3)


def test_noise_is_not_trusted_and_widens_its_band():
    table = inputs(60, a=uniform(0, 1), b=uniform(0, 1))
    noise = np.random.default_rng(1).normal(size=60)
    chaos = fit(Basis(table.joint), table.drawn, noise)
    assert chaos.q2 < 0.3 and not chaos.trusted
    assert np.quantile(chaos.sample, 0.975) - np.quantile(chaos.sample, 0.025) > 3


def test_an_output_that_does_not_vary_has_no_shares():
    table = inputs(20, a=uniform(0, 1), b=uniform(0, 1))
    basis = Basis(table.joint)
    chaos = fit(basis, table.drawn, np.full(20, 100.0))
    assert (chaos.mean, chaos.variance, chaos.sd) == (100, 0, 0)
    assert np.isnan(Explained(basis)(chaos).first).all()


def test_dependent_columns_are_selected_from_as_well():
    """Few cases and a choice of values leave terms that are combinations of others."""
    rng = np.random.default_rng(5)
    a, choice = rng.normal(size=11), np.repeat([-1.0, 1.0], [5, 6])
    matrix = np.column_stack([np.ones(11), a, choice, choice**2 - 1.0, a * choice, a * choice**3,
                              1.0 + choice, *(a * choice**k for k in range(2, 8))])  # fmt: skip
    assert independent(matrix).tolist() == [0, 1, 2, 4]
    output = 3.0 + 2.0 * a - choice + 0.01 * rng.normal(size=11)
    assert matrix @ select(matrix, output) == pytest.approx(output, abs=0.05)


def test_a_field_has_the_band_of_its_points():
    """y(t) = a sin t + b cos t with independent normal a, b: mean and variance at each t."""
    table = inputs(60, a=normal(2, 0.5), b=normal(1, 0.25))
    t = np.linspace(0, 2 * pi, 12, endpoint=False)
    fields = table.drawn[:, [0]] * np.sin(t) + table.drawn[:, [1]] * np.cos(t)
    basis = Basis(table.joint)
    field = fit_field(basis, table.drawn, fields)
    assert field.q2 > 0.999 and len(field.chaos) == 2
    middle, sd = 2 * np.sin(t) + np.cos(t), np.hypot(0.5 * np.sin(t), 0.25 * np.cos(t))
    for end, share in zip(field.band, (0.025, 0.5, 0.975), strict=True):
        assert end == pytest.approx(middle + norm.ppf(share) * sd, abs=0.02)
    assert field(table.drawn) == pytest.approx(fields, abs=1e-6)
    shares = Explained(basis).of(field.chaos)
    assert shares.first == pytest.approx([0.8, 0.2], abs=0.01)  # 0.5^2 and 0.25^2 around


# ----- designs


@pytest.mark.parametrize("design", ["sobol", "lhs", "random"])
def test_a_design_is_the_same_again_and_another_with_another_seed(design):
    first, again, other = (
        Uncertainty(cases=20, design=design, seed=seed, inputs=LINEAR).drawn for seed in (1, 1, 2)
    )
    assert (first == again).all() and (first != other).any()


def test_more_cases_of_a_low_discrepancy_sequence_keep_the_first():
    few, many = (Uncertainty(cases=n, inputs=LINEAR).drawn for n in (20, 30))
    assert (many[:20] == few).all()


@pytest.mark.parametrize("design", ["sobol", "random"])
def test_cases_that_check_are_none_of_the_design_and_more_of_them_keep_the_first(design):
    few, many = (
        Uncertainty(cases=20, design=design, check=n, inputs=LINEAR).drawn_to_check
        for n in (20, 300)
    )
    assert (many[:20] == few).all()
    table = Uncertainty(cases=20, design=design, check=20, inputs=LINEAR)
    assert not np.isin(table.drawn[:, 0], few[:, 0]).any()
    assert (table.rows == np.vstack([table.drawn, few])).all()
    assert many.mean(axis=0) == pytest.approx([1, 2, 0], abs=0.12)
    assert many.std(axis=0) == pytest.approx([0.5, 0.25, 1], rel=0.1)


def test_a_design_has_the_distributions_and_the_correlation_asked_for():
    table = Uncertainty(
        cases=500,
        inputs={
            "mu": {"distribution": "lognormal", "quantiles": {"5 %": "1 kPa", "95 %": "4 kPa"}},
            "nu": uniform(0.4, 0.49),
        },
        correlations=[{"between": ("mu", "nu"), "rank": -0.5}],
    )
    x = table.drawn
    assert np.quantile(x[:, 0], [0.05, 0.5, 0.95]) == pytest.approx([1, 2, 4], rel=0.03)
    assert 0.4 <= x[:, 1].min() and x[:, 1].max() <= 0.49
    assert spearmanr(*x.T).statistic == pytest.approx(-0.5, abs=0.05)


# ----- failures


def test_failures_at_one_end_of_an_input_are_a_pattern_and_scattered_ones_are_not():
    x = Uncertainty(cases=60, inputs=LINEAR).drawn
    order = np.argsort(x[:, 1])
    failed = np.zeros(60, dtype=bool)
    failed[order[-6:]] = True
    assert pattern(["a", "b", "c"], x, failed).inputs == {"b": "large"}
    scattered = np.zeros(60, dtype=bool)
    scattered[order[4::10]] = True
    found = pattern(["a", "b", "c"], x, scattered)
    assert found.tells and not found.inputs
    one = np.arange(60) == 0
    assert not pattern(["a", "b", "c"], x, one).tells
