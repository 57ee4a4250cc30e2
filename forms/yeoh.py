r"""Yeoh's law.

    psi = C10 (I1b - 3) + C20 (I1b - 3)^2 + C30 (I1b - 3)^3,   I1b = J^(-2/3) (l1^2 + l2^2 + l3^2),

with the deviatoric first invariant; l3 = 1 in plane strain. The initial shear modulus is
mu_0 = 2 C10. With s = J^(1/3) and 2 J x = (l1 - l2)^2, free of cancellation near F = I,

    I1b - 3 = 2 J x / s^2 + (s - 1)^2 (2 s + 1) / s^2.

Yeoh, Some forms of the strain energy function for rubber, 1993, doi:10.5254/1.3538343.
"""

import ufl
from ufl.core.expr import Expr

from calfsocket.forms.kinematics import Jet


def energy(x: Expr, J: Expr, c10: Expr, c20: Expr, c30: Expr) -> Jet:
    """Isochoric energy per reference volume and its derivatives by x, MPa.

    Parameters
    ----------
    x, J : Expr
        Invariants of `kinematics`: (l1 - l2)^2 / (2 J) and det F.
    c10, c20, c30 : Expr
        Coefficients, MPa.
    """
    s = ufl.exp(ufl.ln(J) / 3.0)
    i_x = 2.0 * J / s**2
    i = i_x * x + (s - 1.0) ** 2 * (2.0 * s + 1.0) / s**2
    return Jet(
        i * (c10 + i * (c20 + i * c30)),
        c10 + i * (2.0 * c20 + i * 3.0 * c30),
        2.0 * c20 + i * 6.0 * c30,
    ).of(Jet(i, i_x, 0.0))
