r"""One weak form for every tissue: displacement u and pressure p.

The total potential per reference volume is

    psi(q, J) + p (J - 1) - p^2 / (2 K),

psi the law's isochoric energy and p > 0 in tension: stationarity in p gives J - 1 = p/K, so that
U(J) = K/2 (J - 1)^2, which is Abaqus's (J - 1)^2 / D1 with K = 2/D1. Where a tissue is
incompressible 1/K = 0 and the last term is absent. For "linear elastic" tissues Abaqus has
p = K ln J instead: in vessels (K = 167 kPa) at 15 kPa J is 0.910 here and 0.914 there; bone and
PETG do not tell the difference.

The unknown is p_dof, with p = pressure_scale * p_dof and the tissue's shear modulus as the scale,
so that soft and stiff tissues have unknowns of like size.

All parameters are UFL coefficients and the law is chosen by the integral's cell tag: one compiled
residual and one compiled tangent serve all regions, tissues and material sets.
"""

from dataclasses import dataclass

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from calfsocket.forms import hencky, ogden, yeoh
from calfsocket.forms.element import QUADRATURE_DEGREE
from calfsocket.forms.kinematics import (
    cofactor,
    deformation_gradient,
    distortion,
    stretch_difference_squared,
)

LAW_IDS = {"ogden": 1, "yeoh": 2, "hencky": 3}


@dataclass(frozen=True)
class LawFields:
    """Parameters of the laws as UFL coefficients (constant in each cell), or numbers.

    Attributes
    ----------
    ogden_mu, ogden_alpha : tuple of Expr
        Moduli, MPa, and exponents of Ogden's terms in Abaqus's form.
    c10, c20, c30 : Expr
        Yeoh's coefficients, MPa.
    hencky_mu : Expr
        Hencky's shear modulus, MPa.
    inverse_bulk : Expr
        1/K, 1/MPa; 0 where incompressible.
    pressure_scale : Expr
        Pressure of a unit value of the unknown, MPa.
    """

    ogden_mu: tuple[Expr, ...]
    ogden_alpha: tuple[Expr, ...]
    c10: Expr
    c20: Expr
    c30: Expr
    hencky_mu: Expr
    inverse_bulk: Expr
    pressure_scale: Expr


@dataclass(frozen=True)
class Isochoric:
    """Isochoric energy psi (MPa) and its derivatives by the invariants q and J of `kinematics`."""

    psi: Expr
    q: Expr
    J: Expr
    qq: Expr
    qJ: Expr
    JJ: Expr


def isochoric(law: str, F: Expr, fields: LawFields) -> Isochoric:
    """Isochoric energy of a law per reference volume at F (2x2), with its derivatives.

    Laws are functions of x = q/(2J) and J; the chain rule, dx/dq = 1/(2J) and dx/dJ = -x/J, does
    the rest.
    """
    J = ufl.variable(ufl.det(F))
    x = stretch_difference_squared(F) / (2.0 * ufl.det(F))
    match law:
        case "ogden":
            psi = ogden.energy(x, J, fields.ogden_mu, fields.ogden_alpha)
        case "yeoh":
            psi = yeoh.energy(x, J, fields.c10, fields.c20, fields.c30)
        case "hencky":
            psi = hencky.energy(x, J, fields.hencky_mu)
        case _:
            raise ValueError(f"law {law!r} is not one of {', '.join(LAW_IDS)}")
    by_J, by_xJ = ufl.diff(psi.value, J), ufl.diff(psi.first, J)
    value, by_x, by_xx, by_J, by_xJ, by_JJ = map(
        _without_variables, (psi.value, psi.first, psi.second, by_J, by_xJ, ufl.diff(by_J, J))
    )
    one_J = 1.0 / ufl.det(F)
    x_q, x_J = 0.5 * one_J, -x * one_J
    return Isochoric(
        psi=value,
        q=by_x * x_q,
        J=by_J + by_x * x_J,
        qq=by_xx * x_q**2,
        qJ=(by_xJ + by_xx * x_J - by_x * one_J) * x_q,
        JJ=by_JJ + (2.0 * by_xJ + by_xx * x_J - 2.0 * by_x * one_J) * x_J,
    )


class _Variables(MultiFunction):
    expr = MultiFunction.reuse_if_untouched

    def variable(self, _variable: Expr, operand: Expr, _label: Expr) -> Expr:
        return operand


def _without_variables(expression: Expr) -> Expr:
    """Take the derivatives, and let variables be what they stand for.

    Their labels are numbered through the process: with them, the same expression would have another
    name in the cache of compiled forms each time.
    """
    return map_expr_dag(_Variables(), expand_derivatives(expression))


def pressure(p_dof: Expr, fields: LawFields) -> Expr:
    """Pressure p in MPa, > 0 in tension, of the unknown p_dof."""
    return fields.pressure_scale * p_dof


def first_piola(law: str, F: Expr, p: Expr, fields: LawFields) -> Expr:
    """First Piola-Kirchhoff stress P = 2 psi_q D(F) + (psi_J + p) cof F (2x2), MPa.

    Parameters
    ----------
    law : str
        "ogden", "yeoh" or "hencky".
    F : Expr
        In-plane deformation gradient (2x2).
    p : Expr
        Pressure, MPa, > 0 in tension (see `pressure`).
    fields : LawFields
        Parameters of the laws.
    """
    by = isochoric(law, F, fields)
    return 2.0 * by.q * distortion(F) + (by.J + p) * cofactor(F)


def first_piola_increment(
    law: str, F: Expr, p: Expr, dF: Expr, dp: Expr, fields: LawFields
) -> Expr:
    """Return the derivative of `first_piola` in the direction (dF, dp) (2x2), MPa.

    The same as `ufl.derivative` gives, but compiled in half the time: the law is differentiated by
    its two invariants only, and D and cof are linear.
    """
    return _increment(isochoric(law, F, fields), F, p, dF, dp)


def _increment(by: Isochoric, F: Expr, p: Expr, dF: Expr, dp: Expr) -> Expr:
    D, C = distortion(F), cofactor(F)
    dq = 2.0 * ufl.inner(D, dF)
    dJ = ufl.inner(C, dF)
    return (
        2.0 * by.q * distortion(dF)
        + (by.J + p) * cofactor(dF)
        + 2.0 * (by.qq * dq + by.qJ * dJ) * D
        + (by.qJ * dq + by.JJ * dJ + dp) * C
    )


def stresses(law: str, F: Expr, p: Expr, fields: LawFields) -> Expr:
    """Return what the residual has at a point, for residuals that are put together without UFL.

    Returns
    -------
    Expr
        (5,): P11, P12, P21, P22, pressure_scale (J - 1 - p/K), MPa.
    """
    P = first_piola(law, F, p, fields)
    volumetric = fields.pressure_scale * (ufl.det(F) - 1.0 - p * fields.inverse_bulk)
    return ufl.as_vector([P[0, 0], P[0, 1], P[1, 0], P[1, 1], volumetric])


def moduli(law: str, F: Expr, p: Expr, fields: LawFields) -> Expr:
    """Tangent moduli at a point, for element tangents that are put together without UFL.

    Returns
    -------
    Expr
        (15,): the upper triangle, row by row, of the symmetric derivative of `stresses` by (F11,
        F12, F21, F22, p_dof), MPa.
    """
    by = isochoric(law, F, fields)
    unit = [ufl.as_matrix(((a, b), (c, d))) for a, b, c, d in np.eye(4)]
    zero = ufl.as_ufl(0.0)
    columns = [_increment(by, F, p, dF, zero) for dF in unit]
    C, scale = cofactor(F), fields.pressure_scale
    entries: list[Expr] = []
    for i in range(4):
        entries += [columns[j][i // 2, i % 2] for j in range(i, 4)]
        entries.append(scale * C[i // 2, i % 2])
    return ufl.as_vector([*entries, -(scale**2) * fields.inverse_bulk])


def volume_measure(domain: ufl.Mesh, law_tags: object) -> ufl.Measure:
    """Return dx with the quadrature of the section and the cell tags of the laws (`LAW_IDS`)."""
    return ufl.Measure(
        "dx",
        domain=domain,
        subdomain_data=law_tags,
        metadata={"quadrature_degree": QUADRATURE_DEGREE},
    )


def potential(w: Expr, fields: LawFields, dx: ufl.Measure) -> ufl.Form:
    """Total potential of the mixed function w = (u, p_dof), N mm per mm of limb length."""
    u, p_dof = ufl.split(w)
    F, p = deformation_gradient(u), pressure(p_dof, fields)
    volumetric = p * (ufl.det(F) - 1.0) - 0.5 * p**2 * fields.inverse_bulk
    return sum(
        (isochoric(law, F, fields).psi + volumetric) * dx(law_id) for law, law_id in LAW_IDS.items()
    )


def residual(w: Expr, fields: LawFields, dx: ufl.Measure) -> ufl.Form:
    """First variation of `potential`: internal force of w = (u, p_dof), N/mm."""
    u, p_dof = ufl.split(w)
    v, p_test = ufl.TestFunctions(w.ufl_function_space())
    F, p = deformation_gradient(u), pressure(p_dof, fields)
    volumetric = pressure(p_test, fields) * (ufl.det(F) - 1.0 - p * fields.inverse_bulk)
    return sum(
        (ufl.inner(first_piola(law, F, p, fields), ufl.grad(v)) + volumetric) * dx(law_id)
        for law, law_id in LAW_IDS.items()
    )


def tangent(w: Expr, fields: LawFields, dx: ufl.Measure) -> ufl.Form:
    """Second variation of `potential` (symmetric): the derivative of `residual`, N/mm^2."""
    u, p_dof = ufl.split(w)
    v, p_test = ufl.TestFunctions(w.ufl_function_space())
    du, dp_dof = ufl.TrialFunctions(w.ufl_function_space())
    F, p = deformation_gradient(u), pressure(p_dof, fields)
    dF, dp = ufl.grad(du), pressure(dp_dof, fields)
    volumetric = pressure(p_test, fields) * (ufl.inner(cofactor(F), dF) - dp * fields.inverse_bulk)
    return sum(
        (ufl.inner(first_piola_increment(law, F, p, dF, dp, fields), ufl.grad(v)) + volumetric)
        * dx(law_id)
        for law, law_id in LAW_IDS.items()
    )
