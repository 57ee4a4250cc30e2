r"""Linear elasticity in the logarithmic (Hencky) strain, isochoric part.

    psi = mu dev(e):dev(e),   e = ln V,   mu = E / (2 (1 + nu)).

In plane strain (e3 = 0), with d = ln(l1/l2) = e1 - e2 and ln J = e1 + e2,

    dev(e):dev(e) = d^2 / 2 + (ln J)^2 / 6.

The Kirchhoff stress has the deviator 2 mu dev(e). Abaqus's "linear elastic" at large strain applies
the moduli to the Cauchy stress: a factor of J, which an energy cannot have. For bone and PETG
(strains below 1 %) nothing of that is measurable; in vessels the deviator differs by their change
of volume. References are those of `materials.hencky.Hencky`.
"""

from collections.abc import Sequence

import ufl
from ufl.core.expr import Expr

from calfsocket.forms.kinematics import Jet, log_ratio_squared


def energy(x: Expr, J: Expr, coefficients: Sequence[Expr]) -> Jet:
    """`mixed.LawForm` of (mu,), the shear modulus, MPa."""
    (mu,) = coefficients
    shear = 0.5 * mu * log_ratio_squared(x)
    return Jet(shear.value + mu * ufl.ln(J) ** 2 / 6.0, shear.first, shear.second)
