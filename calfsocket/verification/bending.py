"""A bending strip of fascia, and the elements that fail it.

**Bending.** A thin strip of fascia between two of muscle is bent by a displacement of an
edge. The elements that were not taken are solved beside the one that was: P2 with a continuous P1
pressure, and P2 with a pressure constant in each element.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import basix.ufl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from calfsocket.forms.element import section_element
from calfsocket.materials.laws import Law
from calfsocket.materials.tissues import FASCIA, MUSCLE
from calfsocket.verification.body import Body, at_points
from calfsocket.verification.report import Check, Figure
from calfsocket.verification.strips import BOTTOM, LEFT, RIGHT, TOP, strip_mesh

Array = NDArray[Any]
Field = Callable[[Array], Array]


def taylor_hood() -> Any:
    """P2 displacement and continuous P1 pressure."""
    return basix.ufl.mixed_element(
        [
            basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
            basix.ufl.element("Lagrange", "triangle", 1),
        ]
    )


def constant_pressure() -> Any:
    """P2 displacement and a pressure constant in each element."""
    return basix.ufl.mixed_element(
        [
            basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
            basix.ufl.element("Lagrange", "triangle", 0, discontinuous=True),
        ]
    )


ELEMENTS: dict[str, Callable[[], Any]] = {
    "P2 + bubble / P1 discontinuous": section_element,
    "P2 / P1 continuous": taylor_hood,
    "P2 / P0": constant_pressure,
}


@dataclass(frozen=True)
class Bending:
    """A fascia strip bent in muscle.

    Attributes
    ----------
    force : float
        Force that moves the right edge, N/mm.
    deflection : float
        Mean of the squared deflection of the fascia, root, mm.
    """

    force: float
    deflection: float


@cache
def bending(element: str, across: int, fascia_across: int = 1, depth: float = 0.6) -> Bending:
    """Bend 1 mm of fascia between strips of muscle, 5 mm each, 24 mm long.

    The left edge is held, the upper and lower ones slide along x, and the right edge takes the
    displacement -depth (1 - cos(2 pi y/24))/2 along x and none along y.

    Parameters
    ----------
    element : str
        One of `ELEMENTS`.
    across : int
        Elements in 5 mm of muscle; elements are as long as these are wide.
    fascia_across : int
        Elements across the fascia.
    depth : float
        mm.
    """
    length = 24.0
    section = strip_mesh(
        [("inner", 5.0, across), ("fascia", 1.0, fascia_across), ("outer", 5.0, across)],
        length,
        round(length * across / 5.0),
    )

    def none(x: Array) -> Array:
        return np.zeros_like(x)

    def pressed(x: Array) -> Array:
        push = 0.5 * depth * (1.0 - np.cos(2.0 * np.pi * x[1] / length))
        return np.array([-push, 0.0 * push])

    held: list[tuple[str, int, Field]] = [(LEFT, 0, none), (LEFT, 1, none)]
    held += [(BOTTOM, 1, none), (TOP, 1, none), (RIGHT, 0, pressed), (RIGHT, 1, pressed)]
    laws: dict[str, Law] = {"inner": MUSCLE, "fascia": FASCIA, "outer": MUSCLE}
    body = Body(section, laws, held, element=ELEMENTS[element]())
    body.solve(steps=2)
    at = at_points(body)
    fascia = at.region == section.regions["fascia"]
    weight, u = at.weight[fascia], at.u[0, fascia]
    return Bending(body.reaction(0, RIGHT), float(np.sqrt(np.average(u**2, weights=weight))))


def bending_errors(element: str, fine: Bending, across: int = 5) -> tuple[float, float]:
    """Relative errors of force and deflection against a fine solution."""
    coarse = bending(element, across)
    return coarse.force / fine.force - 1.0, coarse.deflection / fine.deflection - 1.0


OURS, CONTINUOUS, CONSTANT = ELEMENTS
REFERENCE = (20, 4)
"""Elements across 5 mm of muscle and across 1 mm of fascia in the fine solution."""


def checks(errors: Mapping[str, tuple[float, float]]) -> list[Check]:
    """Check what the element must pass, and what each of the others must fail."""
    source = "the same element, four times as fine"
    force, deflection = errors[OURS]
    return [
        Check(f"bending, {OURS}: force", force, 1e-5, "", source),
        Check(f"bending, {OURS}: deflection", deflection, 1e-3, "", source),
        *(
            Check(
                f"bending, {name}: {quantity} off by",
                100.0 * abs(errors[name][which]),
                wrong,
                "%",
                source,
                "at least",
            )
            for name, which, quantity, wrong in (
                (CONTINUOUS, 0, "force", 50.0),
                (CONSTANT, 1, "deflection", 2.0),
            )
        ),
    ]


def figure(fine: Bending) -> Figure:
    """Plot the errors of the three elements over the element size."""

    def draw(axes: Axes) -> None:
        across = (5, 10)
        for name in ELEMENTS:
            bent = [bending(name, n, n // 5) for n in across]
            sizes = [5.0 / n for n in across]
            force = [abs(b.force / fine.force - 1.0) for b in bent]
            deflection = [abs(b.deflection / fine.deflection - 1.0) for b in bent]
            (line,) = axes.loglog(sizes, force, "o-", label=f"{name}: force")
            axes.loglog(sizes, deflection, "s--", color=line.get_color(), label="deflection")
        axes.set(xlabel="element size, mm", ylabel="relative error")
        axes.legend(fontsize="small")

    return Figure("element_bending", draw, "A bending fascia: three elements.")
