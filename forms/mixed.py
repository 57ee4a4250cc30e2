r"""One weak form for every tissue: displacement u and pressure p.

The total potential per reference volume is

    psi(q, J) + p (J - 1) - p^2 / (2 K),

psi the law's isochoric energy and p > 0 in tension: stationarity in p gives J - 1 = p/K, so that
U(J) = K/2 (J - 1)^2, which is Abaqus's (J - 1)^2 / D1 with K = 2/D1. Where a tissue is
incompressible 1/K = 0 and the last term is absent. For "linear elastic" tissues Abaqus has
p = K ln J instead: in vessels (K = 167 kPa) at 15 kPa J is 0.910 here and 0.914 there; bone and
PETG do not show the difference.

A material may have a stress-free state of its own, which an in-plane tensor G makes of the
reference: a tissue that has swollen, a layer that is stretched where it lies. The law then sees the
elastic part of the deformation gradient, Fe = F G^-1, and the energy is that of the stress-free
volume, det(G) W(Fe, p) per reference volume, so that P = Pe cof(G) (Rodriguez, Hoger and McCulloch
1994, doi:10.1016/0021-9290(94)90021-3, with "growth" for G). Out of the plane nothing is stretched:
F33 = G33 = 1.

The unknown is p_dof, with p = pressure_scale * p_dof and the tissue's shear modulus as the scale,
so that soft and stiff tissues have unknowns of like size.

All parameters are UFL coefficients, constant in each cell, and the material is chosen by the
integral's cell tag: regions whose laws differ in their parameters alone share compiled code.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from calfsocket.forms.element import QUADRATURE_DEGREE
from calfsocket.forms.kinematics import (
    Jet,
    cofactor,
    deformation_gradient,
    distortion,
    stretch_difference_squared,
)

LawForm = Callable[[Expr, Expr, Sequence[Expr]], Jet]
"""A law's isochoric energy per reference volume, MPa, and its derivatives by x.

From the invariants of `kinematics`, x = (l1 - l2)^2 / (2 J) and J = det F, and its coefficients.
"""


@dataclass(frozen=True)
class Material:
    """A law in UFL: its energy with its parameters, constant in each cell."""

    law_form: LawForm  #: e.g. `ogden.energy`
    coefficients: tuple[Expr, ...]  #: what it takes
    inverse_bulk: Expr  #: 1/K, 1/MPa; 0 where incompressible
    pressure_scale: Expr  #: pressure of a unit value of the unknown, MPa
    stress_free: Expr | None = None  #: in-plane tensor G (2x2) of its stress-free state, if not I

    def elastic(self, gradient: Expr) -> Expr:
        """Part of a gradient by reference coordinates that counts from the stress-free state."""
        return gradient if self.stress_free is None else gradient * ufl.inv(self.stress_free)

    def per_reference_volume(self, density: Expr) -> Expr:
        """Density per reference volume of one per stress-free volume."""
        return density if self.stress_free is None else ufl.det(self.stress_free) * density

    def nominal(self, stress: Expr) -> Expr:
        """First Piola-Kirchhoff stress (2x2) of that by the stress-free state."""
        return stress if self.stress_free is None else stress * cofactor(self.stress_free)


@dataclass(frozen=True)
class Isochoric:
    """Isochoric energy psi (MPa) and its derivatives by the invariants q and J of `kinematics`."""

    psi: Expr
    q: Expr
    J: Expr
    qq: Expr
    qJ: Expr
    JJ: Expr


def isochoric(law_form: LawForm, F: Expr, coefficients: Sequence[Expr]) -> Isochoric:
    """Isochoric energy of a law per reference volume at F (2x2), with its derivatives.

    Laws are functions of x = q/(2J) and J; the chain rule, dx/dq = 1/(2J) and dx/dJ = -x/J, does
    the rest.
    """
    J = ufl.variable(ufl.det(F))
    x = stretch_difference_squared(F) / (2.0 * ufl.det(F))
    psi = law_form(x, J, coefficients)
    value, by_x, by_xx = map(ufl.as_ufl, (psi.value, psi.first, psi.second))
    by_J, by_xJ = ufl.diff(value, J), ufl.diff(by_x, J)
    by_JJ = ufl.diff(by_J, J)
    value, by_x, by_xx, by_J, by_xJ, by_JJ = map(
        _without_variables, (value, by_x, by_xx, by_J, by_xJ, by_JJ)
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
    """Expand the derivatives and replace variables by their operands.

    Their labels are numbered through the process: with them, the same expression would have another
    name in the cache of compiled forms each time.
    """
    return map_expr_dag(_Variables(), expand_derivatives(expression))


def pressure(p_dof: Expr, pressure_scale: Expr) -> Expr:
    """Pressure p in MPa, > 0 in tension, of the unknown p_dof."""
    return pressure_scale * p_dof


def first_piola(material: Material, F: Expr, p: Expr) -> Expr:
    """First Piola-Kirchhoff stress P = 2 psi_q D(F) + (psi_J + p) cof F (2x2), MPa.

    F is the in-plane deformation gradient (2x2), p the `pressure`; from a stress-free state G it is
    the stress of F G^-1, times cof G.
    """
    F = material.elastic(F)
    by = isochoric(material.law_form, F, material.coefficients)
    return material.nominal(2.0 * by.q * distortion(F) + (by.J + p) * cofactor(F))


def first_piola_increment(material: Material, F: Expr, p: Expr, dF: Expr, dp: Expr) -> Expr:
    """Differentiate `first_piola` in the direction (dF, dp) (2x2), MPa.

    The same as `ufl.derivative` gives, but compiled in half the time: the law is differentiated by
    its two invariants only, and D and cof are linear.
    """
    F, dF = material.elastic(F), material.elastic(dF)
    by = isochoric(material.law_form, F, material.coefficients)
    return material.nominal(_increment(by, F, p, dF, dp))


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


def _volumetric(material: Material, F: Expr, p: Expr) -> Expr:
    """Residual of the volume, which vanishes at J - 1 = p/K with the elastic J."""
    volume = ufl.det(material.elastic(F)) - 1.0 - p * material.inverse_bulk
    return material.per_reference_volume(volume)


def stresses(material: Material, F: Expr, p: Expr) -> Expr:
    """Stress measures of the residual at a point, for residuals that are assembled without UFL.

    They are P11, P12, P21, P22, pressure_scale (J - 1 - p/K), MPa; (5,). The loops have the
    stress-free state themselves.
    """
    P = first_piola(material, F, p)
    volumetric = material.pressure_scale * _volumetric(material, F, p)
    return ufl.as_vector([P[0, 0], P[0, 1], P[1, 0], P[1, 1], volumetric])


def moduli(material: Material, F: Expr, p: Expr) -> Expr:
    """Tangent moduli at a point, for element tangents that are assembled without UFL.

    The upper triangle, row by row, of the symmetric derivative of `stresses` by (F11, F12, F21,
    F22, p_dof), MPa; (15,).
    """
    by = isochoric(material.law_form, F, material.coefficients)
    unit = [ufl.as_matrix(((a, b), (c, d))) for a, b, c, d in np.eye(4)]
    zero = ufl.as_ufl(0.0)
    columns = [_increment(by, F, p, dF, zero) for dF in unit]
    C, scale = cofactor(F), material.pressure_scale
    entries: list[Expr] = []
    for i in range(4):
        entries += [columns[j][i // 2, i % 2] for j in range(i, 4)]
        entries.append(scale * C[i // 2, i % 2])
    return ufl.as_vector([*entries, -(scale**2) * material.inverse_bulk])


def volume_measure(domain: ufl.Mesh, material_tags: object) -> ufl.Measure:
    """Measure dx with the quadrature of the section and the cell tags of the materials."""
    return ufl.Measure(
        "dx",
        domain=domain,
        subdomain_data=material_tags,
        metadata={"quadrature_degree": QUADRATURE_DEGREE},
    )


def potential(w: Expr, materials: Mapping[int, Material], dx: ufl.Measure) -> ufl.Form:
    """Total potential of the mixed function w = (u, p_dof), N mm per mm of limb length.

    `materials` has the material of each cell tag of dx, which is a `volume_measure`.
    """
    u, p_dof = ufl.split(w)
    F = deformation_gradient(u)

    def density(material: Material) -> Expr:
        p = pressure(p_dof, material.pressure_scale)
        Fe = material.elastic(F)
        psi = isochoric(material.law_form, Fe, material.coefficients).psi
        energy = psi + p * (ufl.det(Fe) - 1.0) - 0.5 * p**2 * material.inverse_bulk
        return material.per_reference_volume(energy)

    return sum(density(material) * dx(tag) for tag, material in materials.items())


def residual(w: Expr, materials: Mapping[int, Material], dx: ufl.Measure) -> ufl.Form:
    """First variation of `potential`: internal force of w = (u, p_dof), N/mm."""
    u, p_dof = ufl.split(w)
    v, p_test = ufl.TestFunctions(w.ufl_function_space())
    F = deformation_gradient(u)

    def density(material: Material) -> Expr:
        p, q = (pressure(each, material.pressure_scale) for each in (p_dof, p_test))
        P = first_piola(material, F, p)
        return ufl.inner(P, ufl.grad(v)) + q * _volumetric(material, F, p)

    return sum(density(material) * dx(tag) for tag, material in materials.items())


def tangent(w: Expr, materials: Mapping[int, Material], dx: ufl.Measure) -> ufl.Form:
    """Second variation of `potential` (symmetric): the derivative of `residual`, N/mm^2."""
    u, p_dof = ufl.split(w)
    v, p_test = ufl.TestFunctions(w.ufl_function_space())
    du, dp_dof = ufl.TrialFunctions(w.ufl_function_space())
    F, dF = deformation_gradient(u), ufl.grad(du)

    def density(material: Material) -> Expr:
        p, q, dp = (pressure(each, material.pressure_scale) for each in (p_dof, p_test, dp_dof))
        dP = first_piola_increment(material, F, p, dF, dp)
        Fe, dFe = material.elastic(F), material.elastic(dF)
        d_volume = ufl.inner(cofactor(Fe), dFe) - dp * material.inverse_bulk
        return ufl.inner(dP, ufl.grad(v)) + q * material.per_reference_volume(d_volume)

    return sum(density(material) * dx(tag) for tag, material in materials.items())
