"""Sizes of load steps, as whoever writes a study chooses them."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from calfsocket.io.schema import Strict

Number = Annotated[float, Field(strict=True)]
Share = Annotated[Number, Field(gt=0, le=1)]


class LoadSteps(Strict):
    """How the load grows from 0 to 1.

    Attributes
    ----------
    first : float
        First step of the load.
    largest : float
        Largest step. Long steps may carry a socket on a stiff fascia past the point where the
        fascia buckles, to an unstable equilibrium that Newton's method does not notice.
    smallest : float
        A step that fails at this size ends the run; smallest <= first <= largest.
    growth : float
        Factor on the step when Newton needed at most `few_iterations`, >= 1; iterations in which a
        tenth of the contact points begin or cease to slip do not count.
    few_iterations : int
        See `growth`.
    cutback : float
        Factor on the step after a failure, between 0 and 1.
    extrapolate : bool or "smooth", optional
        Start Newton from the secant through the last two states: always, never, or where the path
        is smooth, so that the secant is expected to miss the end of the step by less than 6 % of
        it. By default, simulations do so always with material sets whose muscle and fascia are
        combined: nothing buckles there, and it saves half of the iterations. With others they do so
        where the path is smooth: a separate, stiff fascia waves in the soft muscle and snaps, and a
        start ahead of that may end on another branch (TC Separate, coarse: 0.5 % less contact
        pressure).

    Raises
    ------
    InputError
        For a number outside its range.
    """

    first: Share = 0.1
    largest: Share = 0.25
    smallest: Share = 1e-3
    growth: Annotated[Number, Field(ge=1)] = 1.5
    few_iterations: Annotated[int, Field(strict=True, ge=0)] = 5
    cutback: Annotated[Number, Field(gt=0, lt=1)] = 0.4
    extrapolate: Annotated[bool, Field(strict=True)] | Literal["smooth"] | None = None

    @model_validator(mode="after")
    def _in_order(self) -> "LoadSteps":
        if not self.smallest <= self.first <= self.largest:
            raise ValueError(
                f"smallest {self.smallest:g}, first {self.first:g}, largest {self.largest:g}: they "
                "must satisfy smallest <= first <= largest"
            )
        return self
