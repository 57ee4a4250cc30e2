r"""Yeoh's law.

    psi = C10 (I1b - 3) + C20 (I1b - 3)^2 + C30 (I1b - 3)^3

with the deviatoric first invariant (`kinematics.first_invariant`); see `materials.yeoh.Yeoh`.
"""

from collections.abc import Sequence

from ufl.core.expr import Expr

from calfsocket.forms.kinematics import Jet, first_invariant


def energy(x: Expr, J: Expr, coefficients: Sequence[Expr]) -> Jet:
    """`mixed.LawForm` of (C10, C20, C30), MPa."""
    c10, c20, c30 = coefficients
    strain = first_invariant(x, J)
    i = strain.value
    return Jet(
        i * (c10 + i * (c20 + i * c30)),
        c10 + i * (2.0 * c20 + i * 3.0 * c30),
        2.0 * c20 + i * 6.0 * c30,
    ).of(strain)
