"""The table of uncertain inputs, their joint distribution, and designs of cases drawn from it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError, field_validator, model_validator

from calfsocket.io.schema import Strict, first_problem, nearest
from calfsocket.uncertainty.distributions import ADAPTER, Distribution, leaves

Array = NDArray[np.float64]

CASES_PER_TERM = 2
"""Least cases for each term of a linear chaos: as many to fit it, and as many to judge it."""

NAME = re.compile(r"[^\W\d_][\w .+'-]{0,79}")
"""Of an input: it is a cell in tables, and must be no formula."""

LEAST_CHECK = 10
"""Least cases that check a chaos: fewer tell neither a spread nor a share of cases."""

EDGE = 1e-12
"""Distance that probabilities keep from 0 and 1, where a normal distribution has no quantile."""


class Correlation(Strict):
    """A rank correlation of two inputs.

    Attributes
    ----------
    between : list of str
        Names of the two inputs.
    rank : float
        Spearman's correlation, -1 to 1 without these.
    """

    between: tuple[str, str]
    rank: Annotated[float, Field(gt=-1, lt=1)]


class Uncertainty(Strict):
    """Inputs of a study that have a distribution in the place of a value.

    Attributes
    ----------
    cases : int
        Cases of the design, beside the one with the file's own values.
    design : str
        How they are drawn: sobol is a low-discrepancy sequence, to which a larger number of cases
        adds; lhs an optimised Latin hypercube; random draws each case by itself.
    seed : int
        Another one gives another design.
    check : int
        Cases that are drawn at random beside the design, and that nothing is fitted to: what is
        said of the others is compared with them.
    inputs : mapping
        Dotted name of a parameter -> its distribution.
    correlations : list of tables
        Inputs that depend on each other, through a normal copula.
    """

    cases: Annotated[int, Field(gt=0, le=900)] = 120
    design: Literal["sobol", "lhs", "random"] = "sobol"
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    check: Annotated[int, Field(ge=0, le=900)] = 0
    inputs: dict[str, Any]
    correlations: tuple[Correlation, ...] = ()

    @field_validator("inputs")
    @classmethod
    def _are_distributions(cls, value: dict[str, Any]) -> dict[str, Any]:
        found = {}
        for name, table in leaves(value).items():
            if isinstance(table, Distribution):
                found[name] = table
                continue
            if not isinstance(table, Mapping) or "distribution" not in table:
                raise ValueError(
                    f"{name}: is {table!r}; it must be a table with distribution = 'normal', "
                    "'lognormal', 'uniform', 'triangular', 'beta' or 'choice'"
                )
            try:
                found[name] = ADAPTER.validate_python(dict(table))
            except ValidationError as error:
                problem = first_problem(table, error)
                raise ValueError(f"{name}: {problem}") from None
        if not found:
            raise ValueError("is empty; give at least one parameter a distribution")
        return found

    @model_validator(mode="after")
    def _fits_together(self) -> "Uncertainty":
        for name, each in self.inputs.items():
            try:
                each.openturns()
            except ValueError as error:
                raise ValueError(f"inputs: {name}: {error}") from None
        self._check_parameters()
        self._check_correlations()
        terms = 1 + sum(each.terms for each in self.inputs.values())
        if self.cases < CASES_PER_TERM * terms:
            raise ValueError(
                f"cases: is {self.cases}; a linear chaos in these inputs has {terms} terms, which "
                f"need {CASES_PER_TERM * terms} cases or more"
            )
        if 0 < self.check < LEAST_CHECK:
            raise ValueError(
                f"check: is {self.check}; give {LEAST_CHECK} cases or more, or 0 for none"
            )
        return self

    def _check_parameters(self) -> None:
        """Refuse names that are no words, and a parameter or title that two inputs share."""
        owner: dict[str, str] = {}
        titled: dict[str, str] = {}
        for name, each in self.inputs.items():
            if not NAME.fullmatch(name):
                raise ValueError(
                    f"inputs: {name!r} is no name; use up to 80 letters, digits, blanks and "
                    "._+'- that begin with a letter"
                )
            if titled.setdefault(each.title or name, name) != name:
                raise ValueError(
                    f"inputs: {name}: title: {each.title or name!r} is that of"
                    f" '{titled[each.title or name]}', too; give each input its own"
                )
            for parameter in each.scales or (name,):
                if owner.setdefault(parameter, name) != name:
                    raise ValueError(
                        f"inputs: {parameter} is changed by '{owner[parameter]}' and by '{name}'; "
                        "leave it to one"
                    )

    def _check_correlations(self) -> None:
        pairs = set()
        for number, each in enumerate(self.correlations):
            place = f"correlations.{number}"
            for name in each.between:
                if name not in self.inputs:
                    raise ValueError(f"{place}: no input '{name}'; {nearest(name, self.inputs)}")
                if self.inputs[name].discrete:
                    raise ValueError(
                        f"{place}: '{name}' is a choice, which cannot be correlated; remove it"
                    )
            pair = frozenset(each.between)
            if len(pair) == 1 or pair in pairs:
                why = "an input with itself" if len(pair) == 1 else "a pair that is listed twice"
                raise ValueError(f"{place}: {why}; give each pair of inputs once")
            pairs.add(pair)
        if np.linalg.eigvalsh(self.correlation)[0] <= EDGE:
            raise ValueError(
                "correlations: the matrix is not positive definite: these correlations cannot "
                "occur together; make one smaller"
            )

    @property
    def correlation(self) -> Array:
        """Correlations of the normal copula: 2 sin(pi rank/6) for Spearman's rank."""
        names = [*self.inputs]
        matrix = np.eye(len(names))
        for each in self.correlations:
            i, j = (names.index(name) for name in each.between)
            matrix[i, j] = matrix[j, i] = 2 * np.sin(np.pi * each.rank / 6)
        return matrix

    @cached_property
    def joint(self) -> "Joint":
        """Their joint distribution."""
        return Joint(tuple(self.inputs), tuple(self.inputs.values()), self.correlation)

    @cached_property
    def drawn(self) -> Array:
        """The design: a row a case and a column an input, in its unit; choices as numbers."""
        return self._at(uniform_design(self.design, self.cases, len(self.inputs), self.seed))

    @cached_property
    def drawn_to_check(self) -> Array:
        """The cases that check it, in the same way; a larger number of them keeps the first."""
        # by another generator than that of designs, or a random one would be drawn again
        generator = np.random.default_rng(self.seed)
        return self._at(generator.random((self.check, len(self.inputs))))

    @cached_property
    def rows(self) -> Array:
        """The design and, below it, the cases that check it."""
        return np.vstack([self.drawn, self.drawn_to_check])

    def _at(self, cube: Array) -> Array:
        """Return values of the inputs at points of the unit cube, as the file has them.

        So what is fitted is what was solved.
        """
        if not len(cube):
            return np.empty((0, len(self.inputs)))
        values = self.joint.at(cube)
        return np.column_stack(
            [
                [of.value(of.text(x)) for x in values[:, i]]
                for i, of in enumerate(self.inputs.values())
            ]
        )


def uniform_design(kind: str, cases: int, inputs: int, seed: int) -> Array:
    """Return a design in the unit cube, (cases, inputs); the same for the same seed."""
    import openturns as ot

    ot.RandomGenerator.SetSeed(seed)
    if kind == "sobol":
        shift = np.array(ot.RandomGenerator.Generate(inputs))
        sequence = np.array(ot.SobolSequence(inputs).generate(cases))
        return np.asarray((sequence + shift) % 1.0)
    cube = ot.JointDistribution([ot.Uniform(0.0, 1.0)] * inputs)
    if kind == "random":
        return np.array(ot.MonteCarloExperiment(cube, cases).generate())
    hypercube = ot.LHSExperiment(cube, cases)
    hypercube.setAlwaysShuffle(True)
    return np.array(ot.SimulatedAnnealingLHS(hypercube, ot.SpaceFillingC2()).generate())


@dataclass(frozen=True, eq=False)
class Joint:
    """The joint distribution of inputs: their own ones, and a normal copula.

    Attributes
    ----------
    names : tuple of str
        Of the inputs.
    marginals : tuple of Distribution
        Their own distributions.
    correlation : array
        Of the copula, (d, d).
    """

    names: tuple[str, ...]
    marginals: tuple[Distribution, ...]
    correlation: Array

    def only(self, kept: Sequence[bool]) -> "Joint":
        """Return the joint distribution of some inputs."""
        which = np.flatnonzero(kept)
        return Joint(
            tuple(self.names[i] for i in which),
            tuple(self.marginals[i] for i in which),
            self.correlation[np.ix_(which, which)],
        )

    @cached_property
    def dependent(self) -> NDArray[np.bool_]:
        """Whether each input is correlated with another one, (d,)."""
        return np.asarray((np.abs(self.correlation - np.eye(len(self.names))) > 0).any(axis=1))

    def at(self, cube: Array) -> Array:
        """Return values of the inputs at points of the unit cube, (n, d)."""
        from scipy.stats import norm

        lower = np.linalg.cholesky(self.correlation)
        normal = norm.ppf(np.clip(cube, EDGE, 1 - EDGE)) @ lower.T
        return self.of_normal(normal, cube)

    def of_normal(self, normal: Array, cube: Array) -> Array:
        """Return values of the inputs by correlated standard normal numbers, (n, d).

        Inputs that no other one depends on are taken from the unit cube, to the last digit.
        """
        from scipy.stats import norm

        shares = np.where(self.dependent, norm.cdf(normal), cube)
        columns = [
            np.array(each.openturns().computeQuantile(shares[:, i].tolist())).ravel()
            for i, each in enumerate(self.marginals)
        ]
        return np.column_stack(columns)

    def normal(self, values: Array) -> Array:
        """Return the standard normal numbers of values of the inputs, (n, d)."""
        from scipy.stats import norm

        columns = [
            np.array(each.openturns().computeCDF(values[:, [i]])).ravel()
            for i, each in enumerate(self.marginals)
        ]
        return np.asarray(norm.ppf(np.clip(np.column_stack(columns), EDGE, 1 - EDGE)))
