"""A body pressed on a flat and pushed to and fro: the fretting loop.

Mindlin and Deresiewicz 1953, doi:10.1115/1.4010702; Jaeger 1998, doi:10.1115/1.2833765; Johnson,
Contact Mechanics, 1985, doi:10.1017/CBO9781139171731, section 7.4.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import xlogy

from calfsocket.verification.hertz import (
    PARTIAL_SLIP,
    SHARE,
    Line,
    Pressed,
    Push,
    push,
    root_mean,
)
from calfsocket.verification.report import Check, Curve, Section, curves
from calfsocket.verification.sampling import Array, FloatArray, worst

MINDLIN = "Mindlin, Deresiewicz 1953"
LINE = replace(PARTIAL_SLIP, divisions=6.0)


def give(line: Line, force: float, tangential: FloatArray) -> FloatArray:
    """Return g(Q) = mu (f(P) - f(P - Q/mu)) in mm, f(P) = -P ln(P)/(pi E'), forces in N/mm."""

    def f(p: FloatArray) -> FloatArray:
        p = np.maximum(p, 0.0)  # rounding where all of the contact slips
        return -xlogy(p, p) / (math.pi * line.modulus)

    mu = line.friction
    return np.asarray(mu * (f(np.array(force)) - f(force - tangential / mu)))


def loop_work(line: Line, force: float, largest: float) -> float:
    """W = 4 Q1 g(Q1) - 8 int_0^Q1 g dQ of a loop between -Q1 and Q1 = `largest`, N/mm."""
    at, weight = np.polynomial.legendre.leggauss(40)
    area = 0.5 * largest * float(weight @ give(line, force, 0.5 * largest * (1.0 + at)))
    return 4.0 * largest * float(give(line, force, np.array(largest))) - 8.0 * area


def locked_shear(state: Pressed, largest: float, x: Array, length: Array) -> FloatArray:
    """Return q on the skin after Q came from `largest` back to that of `state`, MPa.

    As means over edges of a `length` about x, both in mm.
    """
    line, a = state.line, state.exact_half_width
    limit = line.friction * state.force

    def root(ratio: float) -> FloatArray:
        return ratio * root_mean(x / (ratio * a), length / (ratio * a))

    first = math.sqrt(1.0 - largest / limit)
    back = math.sqrt(1.0 - (largest - state.tangential) / (2.0 * limit))
    # The floor's traction on the skin is against the push.
    return -line.friction * line.peak_of(state.force) * (2.0 * root(back) - root(first) - root(1))


@dataclass(frozen=True)
class Loop:
    """A loop without sliding: from 0 to Q1, to -Q1, and to Q1 again."""

    push: Push  #: all of it
    #: steps at which the loop begins, turns, and closes
    top: int
    low: int
    end: int

    @property
    def largest(self) -> float:
        """Q1 where the loop begins, N/mm."""
        return float(self.push.steps.tangential[self.top])

    @property
    def locked(self) -> int:
        """Step on the way from Q1 to -Q1 at which Q is closest to 0."""
        way = self.push.steps.tangential[self.top : self.low + 1]
        return self.top + int(np.argmin(np.abs(way)))

    def checks(self, bar: float = 0.02) -> list[Check]:
        """Check work, closing, and the largest error of shear of all steps from Q1 to -Q1."""
        pushed, line, top, end = self.push, self.push.line, self.top, self.end
        force = float(pushed.steps.force[top : end + 1].mean())
        work = float(pushed.steps.work[top + 1 : end + 1].sum())
        scale = line.friction * line.peak_of(force)
        errors = []
        for state in pushed.states[top : self.low + 1]:
            edges = state.edges
            difference = edges.shear - locked_shear(state, self.largest, edges.x, edges.length)
            errors.append(math.sqrt(np.average(difference**2, weights=edges.length)) / scale)
        work_error = work / loop_work(line, force, self.largest) - 1.0
        closing = float(pushed.steps.tangential[end] / self.largest) - 1.0
        return [
            Check("loop without sliding: work of friction", work_error, bar, MINDLIN),
            Check("loop without sliding: it closes", closing, 1e-3, "Masing"),
            Check("shear on the way back, over mu p0", max(errors), bar, MINDLIN),
        ]


def partial_loop(line: Line, share: float = SHARE, steps: int = 4) -> Loop:
    """Push to and fro by the way that gives about Q1 = `share` mu P, in so many steps a quarter."""
    pushed = push(line, [share, -share, share], share / steps)
    return Loop(pushed, steps, 3 * steps, 5 * steps)


def sliding(line: Line, step: float = 0.5) -> Push:
    """Push the disc over the limit, back over the other one, and forth again."""
    return push(line, [2.0, -2.0, 2.0], step)


def sliding_error(pushed: Push) -> float:
    """Largest error of |Q| against mu P in steps in which the disc slides."""
    ratio = pushed.steps.tangential.abs() / (pushed.line.friction * pushed.steps.force)
    return worst(ratio[ratio > 0.99] - 1.0)


def _loop_lines(partial: Loop, slid: Push) -> list[Curve]:
    """Both loops in units of the way and force of first sliding, on curves of the theory."""
    unit, limit = LINE.friction * LINE.approach(), LINE.friction * slid.steps.force[0]
    top = partial.largest
    elastic = partial.push.steps.way[partial.top] - give(LINE, slid.steps.force[0], np.array(top))
    lines: list[Curve] = []
    for pushed, largest, mark in ((partial.push, top, "o"), (slid, limit, "s")):
        back = np.linspace(0.0, 2.0 * largest, 101)  # by how much Q fell since the turn
        way = pushed.steps.way.max() - elastic / top * back
        way = way - 2.0 * give(LINE, slid.steps.force[0], 0.5 * back)
        Q = largest - back
        if pushed is slid:
            way, Q = np.append(way, -pushed.steps.way.max()), np.append(Q, -largest)
        lines += [(sign * way / unit, sign * Q / limit, "k-", None) for sign in (1.0, -1.0)]
        lines.append((pushed.steps.way / unit, pushed.steps.tangential / limit, mark, None))
    first = np.linspace(0.0, limit, 101)
    way = elastic / top * first + give(LINE, slid.steps.force[0], first)
    return [*lines, (way / unit, first / limit, "k-", None)]


def _locked_lines(partial: Loop) -> list[Curve]:
    lines: list[Curve] = []
    for i, name in ((partial.top, "Q = Q1"), (partial.locked, "back at Q = 0")):
        state = partial.push.states[i]
        a = state.exact_half_width
        scale = -state.line.friction * state.line.peak_of(state.force)
        x: FloatArray = a * np.linspace(-1.5, 1.5, 1201)
        exact = locked_shear(state, partial.largest, x, np.full_like(x, 1e-6 * a))
        lines += [
            (x / a, exact / scale, "k-", None),
            (state.edges.x / a, state.edges.shear / scale, "o", name),
        ]
    return lines


def report() -> Section:
    """Measure the loops of a disc pushed to and fro, without and with sliding."""
    partial, slid = partial_loop(PARTIAL_SLIP, steps=3), sliding(LINE)
    least = min(partial.push.least_work, slid.least_work)
    return Section(
        [
            *partial.checks(),
            Check("sliding: Q over mu P, less 1", sliding_error(slid), 2e-3, "Coulomb"),
            Check("work of friction, negative part", least, 1e-2, "second law"),
        ],
        {
            "fretting_loop": curves(
                ("way of the core / (mu approach)", "Q / (mu P)"), _loop_lines(partial, slid)
            ),
            "fretting_shear": curves(
                ("x / a", "q / (mu p0)"), _locked_lines(partial), xlim=(-1.5, 1.5)
            ),
        },
    )
