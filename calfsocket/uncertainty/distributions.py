"""Distributions of uncertain inputs as study files have them, and their counterparts in OpenTURNS.

Values are numbers, or texts with a unit; the unit of the first one is that of the input.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, TypeAdapter, model_validator

from calfsocket.io import units
from calfsocket.io.schema import Strict

if TYPE_CHECKING:
    import openturns as ot

Value = Annotated[float, Field(strict=True)] | str
Share = Annotated[str, Field(examples=["20 %"])]

LEAST_KEPT = 0.01
"""Least probability that bounds may leave of a distribution; to cut off more is a slip."""


def number(value: Value, unit: str) -> float:
    """Return a value in a unit, empty for plain numbers; a ValueError where that is impossible."""
    if isinstance(value, str):
        return units.in_unit(value, unit)
    if unit:
        raise ValueError(f"{value:g} has no unit, and another value of the input is in {unit}")
    return float(value)


class Distribution(Strict):
    """What all distributions have.

    Attributes
    ----------
    distribution : str
        Its kind.
    scales : tuple of str
        Dotted names of parameters that the input multiplies, whose values are those of the file;
        the name of the input is free then.
    title : str
        Words for the input in the report.
    source : str
        Where its numbers come from.
    """

    distribution: str
    scales: Annotated[tuple[str, ...], Field(min_length=1)] = ()
    title: Annotated[str, Field(max_length=60)] = ""
    source: Annotated[str, Field(max_length=300)] = ""

    discrete: ClassVar[bool] = False

    @property
    def written(self) -> list[Value]:
        """Values of the input that the file has, as it has them."""
        keys = ("mean", "low", "mode", "high", "sd")
        found = [value for key in keys if (value := getattr(self, key, None)) is not None]
        return [*found, *(getattr(self, "quantiles", None) or {}).values()]

    @property
    def unit(self) -> str:
        """Unit of the input; empty for a plain number."""
        first = self.written[0]
        return units.unit_of(first) if isinstance(first, str) else ""

    def get(self, key: str) -> float | None:
        """Return a value in the unit of the input, None where the file has none."""
        value = getattr(self, key, None)
        return None if value is None else number(value, self.unit)

    def numbers(self, *keys: str) -> tuple[float, ...]:
        """Return values in the unit of the input, 0 where the file has none."""
        return tuple(self.get(key) or 0.0 for key in keys)

    @property
    def terms(self) -> int:
        """Terms of a linear chaos in this input alone, without the constant."""
        return 1

    @property
    def bounds(self) -> list[tuple[str, Any]]:
        """Values that the file has as ends of the range, by their keys."""
        keys = ("low", "high")
        return [(key, value) for key in keys if (value := getattr(self, key, None)) is not None]

    def text(self, value: float) -> Any:
        """Return a drawn value as a study file has it, to `DIGITS` digits."""
        rounded = float(f"{value:.{DIGITS}g}")
        return f"{rounded!r} {self.unit}" if self.unit else rounded

    def value(self, text: Any) -> float:
        """Return the number of what `text` has written."""
        return number(text, self.unit)

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        raise NotImplementedError

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _is_one(self) -> "Distribution":
        if self.scales and self.unit:
            raise ValueError(f"scales: a factor has no unit, and values are in {self.unit}")
        for key in ("sd", "mean", "low", "mode", "high"):
            self.get(key)
        self._check()
        return self

    def _check(self) -> None:
        """Raise a ValueError if the numbers do not fit together."""


DIGITS = 6
"""Digits of drawn values: they stand in names of no file, but in run.json, and are read again."""


class _Spread(Distribution):
    """A distribution with a mean and a standard deviation, or a coefficient of variation."""

    mean: Value | None = None
    sd: Value | None = None
    cv: Share | None = None

    @property
    def deviation(self) -> float:
        """Standard deviation in the unit of the input."""
        if self.cv is not None:
            return units.SHARE.parse(self.cv) * abs(self.get("mean") or 0.0)
        return self.get("sd") or 0.0

    def _check_spread(self) -> None:
        if self.mean is None or (self.sd is None) == (self.cv is None):
            raise ValueError("give mean and one of sd and cv")
        if self.cv is not None and self.get("mean") == 0:
            raise ValueError("a mean of 0 has no cv; give sd in its place")
        if not self.deviation > 0:
            key = "sd" if self.cv is None else "cv"
            raise ValueError(f"{key} is {getattr(self, key)!r}; it must be above 0")

    @property
    def _spread_words(self) -> str:
        way = f"cv {self.cv}" if self.cv is not None else f"sd {self.sd}"
        return f"mean {self.mean}, {way}"


class _Cut(_Spread):
    """Such a distribution, or one given by two quantiles, that bounds may cut.

    Mean and standard deviation are those before it is cut.
    """

    quantiles: dict[str, Value] | None = None
    low: Value | None = None
    high: Value | None = None

    def _check(self) -> None:
        if self.quantiles is None:
            self._check_spread()
        else:
            self._check_quantiles()
        low, high = self.get("low"), self.get("high")
        if low is not None and high is not None and not low < high:
            raise ValueError(f"low is {self.low!r}; it must be below high, {self.high!r}")

    def _check_quantiles(self) -> None:
        if self.mean is not None or self.sd is not None or self.cv is not None:
            raise ValueError("give either quantiles, or mean with sd or cv")
        if len(self.quantiles or {}) != 2:
            raise ValueError('quantiles: give two, as { "5 %" = 1.0, "95 %" = 2.0 }')
        try:
            (p, a), (q, b) = self._points
        except ValueError as error:
            raise ValueError(f"quantiles: {error}") from None
        if not (0 < p < q < 1 and a < b):
            raise ValueError("quantiles: shares must be above 0 % and below 100 %, and values grow")

    @property
    def _points(self) -> list[tuple[float, float]]:
        """Shares and values of the quantiles, in order."""
        assert self.quantiles is not None
        return sorted((units.SHARE.parse(p), number(v, self.unit)) for p, v in
                      self.quantiles.items())  # fmt: skip

    def _normal_from(self, points: list[tuple[float, float]]) -> tuple[float, float]:
        """Return mean and standard deviation of the normal distribution through two quantiles."""
        from scipy.stats import norm

        (p, a), (q, b) = points
        sd = (b - a) / (norm.ppf(q) - norm.ppf(p))
        return a - sd * norm.ppf(p), sd

    def _cut(self, whole: "ot.Distribution", centre: float, scale: float) -> "ot.Distribution":
        """Cut a distribution at the bounds."""
        import openturns as ot

        low, high = ((None if v is None else (v - centre) / scale) for v in
                     (self.get("low"), self.get("high")))  # fmt: skip
        if low is None and high is None:
            return whole
        below = 0.0 if low is None else whole.computeCDF(low)
        above = 1.0 if high is None else whole.computeCDF(high)
        if above - below < LEAST_KEPT:
            raise ValueError(
                f"low and high leave less than {100 * LEAST_KEPT:g} % of the distribution; "
                "widen them"
            )
        if high is None:
            return ot.TruncatedDistribution(whole, low, ot.TruncatedDistribution.LOWER)
        if low is None:
            return ot.TruncatedDistribution(whole, high, ot.TruncatedDistribution.UPPER)
        return ot.TruncatedDistribution(whole, low, high)

    @property
    def is_cut(self) -> bool:
        """Whether bounds cut it."""
        return self.low is not None or self.high is not None

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        if self.quantiles is None:
            how = self._spread_words
        else:
            how = ", ".join(f"{share} below {value}" for share, value in self.quantiles.items())
        cut = "".join(f", {key} {value}" for key, value in self.bounds)
        return f"{self.distribution}, {how}{cut}"


class Normal(_Cut):
    """The normal distribution, which bounds may cut.

    Attributes
    ----------
    mean, sd : number or text with a unit
        Mean and standard deviation, before it is cut.
    cv : str
        sd over mean, in the place of sd.
    quantiles : mapping
        Two shares with their values, in the place of mean and sd.
    low, high : number or text with a unit, optional
        Where it is cut.
    """

    distribution: Literal["normal"]

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        import openturns as ot

        if self.quantiles is not None:
            mean, sd = self._normal_from(self._points)
        else:
            mean, sd = self.get("mean") or 0.0, self.deviation
        return self._cut(ot.Normal((mean - centre) / scale, sd / scale), centre, scale)


class LogNormal(_Cut):
    """The distribution of a positive number whose logarithm is normal, which bounds may cut.

    Attributes
    ----------
    mean, sd : number or text with a unit
        Mean and standard deviation of the number itself, before it is cut.
    cv : str
        sd over mean, in the place of sd.
    quantiles : mapping
        Two shares with their values, in the place of mean and sd.
    low, high : number or text with a unit, optional
        Where it is cut.
    """

    distribution: Literal["lognormal"]

    def _check(self) -> None:
        super()._check()
        values = [self.mean] if self.quantiles is None else self.quantiles.values()
        if any(value is not None and number(value, self.unit) <= 0 for value in values):
            raise ValueError("a lognormal distribution has values above 0 only; use normal")

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        import math

        import openturns as ot

        if self.quantiles is not None:
            m, s = self._normal_from([(p, math.log(v)) for p, v in self._points])
        else:
            mean = self.get("mean") or 0.0
            s = math.sqrt(math.log1p((self.deviation / mean) ** 2))
            m = math.log(mean) - s * s / 2
        whole = ot.LogNormal(m - math.log(scale), s, -centre / scale)
        return self._cut(whole, centre, scale)


class Uniform(Distribution):
    """Every value between two bounds alike.

    Attributes
    ----------
    low, high : number or text with a unit
        The bounds.
    """

    distribution: Literal["uniform"]
    low: Value
    high: Value

    def _check(self) -> None:
        _check_order(self, "low", "high")

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        import openturns as ot

        low, high = ((value - centre) / scale for value in self.numbers("low", "high"))
        return ot.Uniform(low, high)

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        return f"uniform, {self.low} to {self.high}"


class Triangular(Distribution):
    """A density that rises from one bound to the mode and falls to the other bound.

    Attributes
    ----------
    low, mode, high : number or text with a unit
        Bounds and the likeliest value.
    """

    distribution: Literal["triangular"]
    low: Value
    mode: Value
    high: Value

    def _check(self) -> None:
        _check_order(self, "low", "high")
        low, mode, high = self.numbers("low", "mode", "high")
        if not low <= mode <= high:
            raise ValueError(f"mode is {self.mode!r}; it must be from low to high")

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        import openturns as ot

        values = ((value - centre) / scale for value in self.numbers("low", "mode", "high"))
        return ot.Triangular(*values)

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        return f"triangular, {self.low} to {self.high}, likeliest {self.mode}"


class Beta(_Spread):
    """The beta distribution between two bounds.

    Attributes
    ----------
    low, high : number or text with a unit
        The bounds.
    mean, sd : number or text with a unit
        Mean and standard deviation.
    cv : str
        sd over mean, in the place of sd.
    """

    distribution: Literal["beta"]
    low: Value
    high: Value

    def _check(self) -> None:
        self._check_spread()
        _check_order(self, "low", "high")
        low, mean, high = self.numbers("low", "mean", "high")
        if not low < mean < high:
            raise ValueError(f"mean is {self.mean!r}; it must be between low and high")
        if self.deviation**2 >= (mean - low) * (high - mean):
            raise ValueError(
                "the standard deviation is too large for these bounds; give a smaller one"
            )

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of (x - centre)/scale."""
        import openturns as ot

        low, mean, high = self.numbers("low", "mean", "high")
        share = (mean - low) / (high - low)
        both = share * (1 - share) * ((high - low) / self.deviation) ** 2 - 1
        ends = (low - centre) / scale, (high - centre) / scale
        return ot.Beta(share * both, (1 - share) * both, *ends)

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        return f"beta, {self.low} to {self.high}, {self._spread_words}"


class Choice(Distribution):
    """One of several values.

    Attributes
    ----------
    values : list
        As the parameter may have them.
    weights : list of float, optional
        How often each is taken; alike unless given.
    """

    distribution: Literal["choice"]
    values: tuple[Any, ...]
    weights: tuple[Annotated[float, Field(gt=0)], ...] | None = None

    discrete: ClassVar[bool] = True

    @property
    def written(self) -> list[Value]:
        """Values are taken as they are."""
        return [0.0]

    @property
    def terms(self) -> int:
        """Terms that tell the values apart."""
        return len(self.values) - 1

    @property
    def bounds(self) -> list[tuple[str, Any]]:
        """Each value by its place."""
        return [(f"values.{number}", value) for number, value in enumerate(self.values)]

    def text(self, value: float) -> Any:
        """Return the value of a number."""
        return self.values[round(value)]

    def value(self, text: Any) -> float:
        """Return the number of a value, as the file or a table has it."""
        alike = [str(each) == str(text) or each == text for each in self.values]  # 1 is 1.0
        return float(alike.index(True))

    def _check(self) -> None:
        if len(self.values) < 2 or len(set(map(repr, self.values))) < len(self.values):
            raise ValueError("values: give two or more that differ")
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(f"weights: give {len(self.values)}, one for each value")

    def openturns(self, centre: float = 0.0, scale: float = 1.0) -> "ot.Distribution":
        """Return the distribution of the number of the value."""
        import openturns as ot

        places = [[(number - centre) / scale] for number in range(len(self.values))]
        return ot.UserDefined(places, self.weights or [1.0] * len(self.values))

    @property
    def words(self) -> str:
        """The distribution as a reader knows it."""
        if self.weights is None:
            return " or ".join(map(str, self.values)) + ", equally likely"
        total = sum(self.weights)
        pairs = zip(self.values, self.weights, strict=True)
        return " or ".join(f"{value} ({100 * weight / total:.3g} %)" for value, weight in pairs)


def _check_order(of: Distribution, first: str, second: str) -> None:
    if not (of.get(first) or 0.0) < (of.get(second) or 0.0):
        raise ValueError(
            f"{first} is {getattr(of, first)!r}; it must be below {second}, {getattr(of, second)!r}"
        )


AnyDistribution = Annotated[
    Normal | LogNormal | Uniform | Triangular | Beta | Choice, Discriminator("distribution")
]
ADAPTER: TypeAdapter[Any] = TypeAdapter(AnyDistribution)


KEYS = ("distribution", "mean", "sd", "cv", "low", "mode", "high", "quantiles", "values")
"""Keys by which a table shows that it is meant as a distribution."""


def leaves(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return tables of distributions by dotted name: names without quotes are tables in tables."""
    found: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, Mapping) and value and not any(word in value for word in KEYS):
            found |= leaves(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found
