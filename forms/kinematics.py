r"""Plane-strain kinematics without eigenvalues.

The in-plane deformation gradient F (2x2; F33 = 1) splits into F = (F + cof F)/2 + (F - cof F)/2, a
rotation times a number and its opposite. With the second part,

    D(F) = F - cof F = [[F11 - F22, F12 + F21], [F12 + F21, F22 - F11]],

the two invariants of an isotropic law in plane strain are quadratic in F, hence smooth at F = I and
at equal stretches l1 = l2, where formulas with eigenvalues are not:

    q = D:D / 2 = (F11 - F22)^2 + (F12 + F21)^2 = (l1 - l2)^2,    dq/dF = 2 D(F),
    J = det F = l1 l2,                                            dJ/dF = cof F.

D(F) and cof F are linear in F, which makes second derivatives as short as the first ones.
"""

import math
from dataclasses import dataclass
from typing import Any

import ufl
from ufl.core.expr import Expr

# Two series; tests measure the relative error that they leave in the stress: for
# exponents up to 26 it is 1e-14 up to l1/l2 = 3, 1e-12 at 4, 1e-10 at 6.8 and 1e-6 at 26.
# ln^2(l1/l2): halvings of the logarithm, and terms of the series.
LOG_HALVINGS = 2
LOG_TERMS = 8
LOG_COEFFICIENTS = tuple(
    (-1) ** n * 2.0 ** (n + 2) / ((n + 1) ** 2 * math.comb(2 * n + 2, n + 1))
    for n in range(LOG_TERMS)
)

# cosh(sqrt(t)) - 1: halvings of sqrt(t), and terms of the series.
COSH_HALVINGS = 4
COSH_TERMS = 8
COSH_COEFFICIENTS = tuple(1.0 / math.factorial(2 * n + 2) for n in range(COSH_TERMS))


def deformation_gradient(u: Expr) -> Expr:
    """In-plane deformation gradient F = I + du/dX (2x2) of the displacement u, mm."""
    return ufl.Identity(2) + ufl.grad(u)


def cofactor(F: Expr) -> Expr:
    """Cofactor cof F = J F^-T = dJ/dF (2x2), linear in F."""
    return ufl.as_matrix([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])


def distortion(F: Expr) -> Expr:
    """D(F) = F - cof F (2x2), linear in F; zero exactly where l1 = l2."""
    a, b = F[0, 0] - F[1, 1], F[0, 1] + F[1, 0]
    return ufl.as_matrix([[a, b], [b, -a]])


def stretch_difference_squared(F: Expr) -> Expr:
    """Return q = (l1 - l2)^2 of the in-plane principal stretches."""
    return (F[0, 0] - F[1, 1]) ** 2 + (F[0, 1] + F[1, 0]) ** 2


@dataclass(frozen=True)
class Jet:
    """Value of a function of one variable and its first two derivatives: UFL or arrays.

    Series have them written out: UFL's derivative of Horner's rule takes several times the work.
    """

    value: Any
    first: Any
    second: Any

    def of(self, inner: "Jet") -> "Jet":
        """Chain rule: this function, taken at the value of `inner`."""
        return Jet(
            self.value,
            self.first * inner.first,
            self.second * inner.first**2 + self.first * inner.second,
        )

    def __rmul__(self, factor: Any) -> "Jet":
        """Multiply by a constant."""
        return Jet(factor * self.value, factor * self.first, factor * self.second)


def first_invariant(x: Expr, J: Expr) -> Jet:
    r"""I1b - 3 of the deviatoric stretches, with its derivatives by x, dimensionless.

    I1b = J^(-2/3) (l1^2 + l2^2 + l3^2), l3 = 1 in plane strain. With s = J^(1/3) and
    2 J x = (l1 - l2)^2, free of cancellation near F = I,

        I1b - 3 = 2 J x / s^2 + (s - 1)^2 (2 s + 1) / s^2.

    A law psi(I1b - 3) is `Jet(psi, psi', psi'').of(first_invariant(x, J))`.
    """
    s = ufl.exp(ufl.ln(J) / 3.0)
    slope = 2.0 * J / s**2
    return Jet(slope * x + (s - 1.0) ** 2 * (2.0 * s + 1.0) / s**2, slope, 0.0)


def log_ratio_squared(x: Any, sqrt: Any = ufl.sqrt) -> Jet:
    r"""ln^2(l1/l2) as a smooth function of x = q/(2J) = cosh(ln(l1/l2)) - 1.

    Halving the logarithm d, x' = cosh(d/2) - 1 = (x/2) / (1 + sqrt(1 + x/2)), brings x near zero,
    where d^2 = acosh^2(1 + x) = sum_{n>=1} (-1)^(n+1) 2^(n+1) x^n / (n^2 C(2n, n)) converges fast.

    x >= 0 is a UFL expression, or an array with `numpy.sqrt` as its square root.
    """
    halved = Jet(x, 1.0, 0.0)
    for _ in range(LOG_HALVINGS):
        root = sqrt(1.0 + 0.5 * halved.value)
        slope = 0.25 / root
        halved = Jet(0.5 * halved.value / (1.0 + root), slope, -4.0 * slope * slope**2).of(halved)
    return 4.0**LOG_HALVINGS * power_series(LOG_COEFFICIENTS, halved.value).of(halved)


def cosh_minus_one(t: Any) -> Jet:
    r"""cosh(sqrt(t)) - 1, smooth in t >= 0 and without cancellation (UFL expression or array).

    c(t) = sum_{n>=1} t^n / (2n)! at t / 4^k, then k times c(4t) = 2 c(t) (2 + c(t)).
    """
    share = 4.0**-COSH_HALVINGS
    c = power_series(COSH_COEFFICIENTS, share * t).of(Jet(share * t, share, 0.0))
    for _ in range(COSH_HALVINGS):
        c = Jet(2.0 * c.value * (2.0 + c.value), 4.0 * (1.0 + c.value), 4.0).of(c)
    return c


def power_series(coefficients: tuple[float, ...], x: Any) -> Jet:
    """Return c1 x + c2 x^2 + ... by Horner's rule, for coefficients from c1 on."""
    first = tuple(n * c for n, c in enumerate(coefficients, start=1))
    second = tuple(n * c for n, c in enumerate(first[1:], start=1))
    return Jet(x * _horner(coefficients, x), _horner(first, x), _horner(second, x))


def _horner(coefficients: tuple[float, ...], x: Any) -> Any:
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = coefficient + x * value
    return value
