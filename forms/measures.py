"""Stress of the solved section, all components."""

import ufl
from ufl.core.expr import Expr

from calfsocket.forms.kinematics import distortion, stretch_difference_squared
from calfsocket.forms.mixed import Material, isochoric


def cauchy_stress(material: Material, F: Expr, p: Expr) -> Expr:
    r"""Cauchy stress s11, s22, s33, s12 (vector of 4), MPa.

    In the plane sigma = P F^T / J, with P of `mixed.first_piola`. Out of it the energy is not
    differentiated, but the isochoric part of the stress has no trace in three dimensions:

        sigma = 2 psi_q D(F) F^T / J + (psi_J + p) I,   sigma33 = p - 2 (psi_q q / J + psi_J).

    F is the in-plane deformation gradient (2x2), p the `mixed.pressure`; from a stress-free state G
    the stress is that of F G^-1.
    """
    F = material.elastic(F)
    by = isochoric(material.law_form, F, material.coefficients)
    q, J = stretch_difference_squared(F), ufl.det(F)
    # One `isochoric` for all components: FFCx compares equal expressions of two for seconds.
    sigma = 2.0 * by.q / J * distortion(F) * F.T + (by.J + p) * ufl.Identity(2)
    s33 = p - 2.0 * (by.q * q / J + by.J)
    return ufl.as_vector([sigma[0, 0], sigma[1, 1], s33, sigma[0, 1]])
