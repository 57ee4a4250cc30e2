r"""Ogden's law, isochoric part.

    psi = sum_i 2 mu_i / alpha_i^2 (lb1^alpha_i + lb2^alpha_i + lb3^alpha_i - 3),

lb_k = J^(-1/3) l_k the three deviatoric stretches (plane strain: l3 = 1): Abaqus's form, to which
`materials.ogden.Ogden`, which has the reference, converts its other one.

With s = J^(alpha/6), d = ln(l1/l2) and l1^a + l2^a = 2 J^(a/2) cosh(a d/2), the bracket is

    2 s (cosh(alpha d/2) - 1) + (s - 1)^2 (2 s + 1) / s^2,

where neither term cancels near F = I.
"""

from collections.abc import Sequence

import ufl
from ufl.core.expr import Expr

from calfsocket.forms.kinematics import Jet, cosh_minus_one, log_ratio_squared


def energy(x: Expr, J: Expr, coefficients: Sequence[Expr]) -> Jet:
    """`mixed.LawForm` of (mu_1, alpha_1, mu_2, alpha_2, ...): moduli, MPa, and exponents, not 0."""
    d_squared = log_ratio_squared(x)
    log_J = ufl.ln(J)
    psi, by_x, by_xx = 0.0, 0.0, 0.0
    for mu, alpha in zip(coefficients[::2], coefficients[1::2], strict=True):
        s = ufl.exp(alpha * log_J / 6.0)
        inner = 0.25 * alpha**2 * d_squared
        distorted = 2.0 * s * cosh_minus_one(inner.value).of(inner)
        factor = 2.0 * mu / alpha**2
        psi += factor * (distorted.value + (s - 1.0) ** 2 * (2.0 * s + 1.0) / s**2)
        by_x += factor * distorted.first
        by_xx += factor * distorted.second
    return Jet(psi, by_x, by_xx)
