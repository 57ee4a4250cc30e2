"""Nitsche's method for frictional contact, biased to the skin: residual and exact tangent.

At a quadrature point of the skin with deformed position x, nominal traction T = P N and closest
point y of the socket (tangent e, normal n into the limb), with gap g = (x - y) . n (>= 0 open) and
slip s of the load step:

    trial pressure   T . n - gamma (g - (1 - load) min(g0, 0))
    trial shear      T . e - gamma_t s

Coulomb's projection of the two gives the contact traction t = p n + q e on the skin, and minus it
on the socket. The incomplete variant (theta = 0) has no term with the variation of T:

    R(v) = - int_skin t . (v_skin(X) - v_socket(xi)) dS.

Slip counts from where the last converged step left off with its own shear q, T . e - gamma_t s = q
(`settled_slip`), so that this state is an equilibrium of the next step too.

At an exact solution T = t, so the method is consistent for any gamma > 0 (Chouly, Hild and Renard
2015, doi:10.1090/S0025-5718-2014-02913-X; Mlika, Renard and Chouly 2017,
doi:10.1016/j.cma.2017.05.015). The shrink fit subtracts the part (1 - load) of each point's initial
overclosure g0 < 0, so that load = 0 is stress free and load = 1 leaves no overclosure.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calfsocket.contact.active_set import ActiveSet
from calfsocket.contact.friction import OPEN, SLIP, STICK, ContactTraction, branches, coulomb
from calfsocket.contact.parameters import Contact
from calfsocket.contact.projection import Projection, shape_functions

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SkinPoints:
    """Skin quadrature points: what does not change with the deformation.

    Attributes
    ----------
    reference : (n, 2)
        Undeformed position, in mm.
    weight : (n,)
        Quadrature weight times undeformed edge length element, in mm.
    shape : (n, 2, m)
        Displacement of the point per unit of each of the m displacements of its edge's nodes.
    """

    reference: FloatArray
    weight: FloatArray
    shape: FloatArray


@dataclass(frozen=True)
class ContactState:
    """Contact at every skin quadrature point.

    Attributes
    ----------
    projection : Projection
        Closest points on the socket.
    gap : (n,)
        Gap in mm, >= 0 open, before the shrink fit's share is taken off.
    reduced_gap : (n,)
        gap - (1 - load) min(initial gap, 0), in mm.
    slip : (n,)
        Slip of the load step, in mm.
    trial_shear : (n,)
        Shear before Coulomb's projection, in MPa.
    traction : ContactTraction
        Contact pressure and shear.
    """

    projection: Projection
    gap: FloatArray
    reduced_gap: FloatArray
    slip: FloatArray
    trial_shear: FloatArray
    traction: ContactTraction


def contact_state(
    position: FloatArray,
    nominal_traction: FloatArray,
    projection: Projection,
    closing: FloatArray,
    slip: FloatArray,
    parameters: Contact,
    active_set: ActiveSet | None = None,
) -> ContactState:
    """Contact pressure, shear and status from the skin's traction, gap and slip.

    Deformed skin points in mm and their nominal traction T = P N in MPa, pressure part included,
    are (n, 2). `closing` is the shrink fit's part of the gap, (1 - load) min(initial gap, 0), and
    `slip` that of the load step, both (n,) in mm. An active set may put points on other branches of
    Coulomb's law than those of their trial values (collective).
    """
    gap = np.sum((position - projection.point) * projection.normal, axis=1)
    reduced_gap = gap - closing
    trial_pressure = (
        np.sum(nominal_traction * projection.normal, axis=1) - parameters.gamma * reduced_gap
    )
    trial_pressure[projection.beyond] = -np.inf
    trial_shear = np.sum(nominal_traction * projection.tangent, axis=1) - parameters.gamma_t * slip
    branch = branches(trial_pressure, trial_shear, parameters.friction)
    if active_set is not None:
        branch = active_set.branches(branch)
    traction = coulomb(trial_pressure, trial_shear, parameters.friction, branch)
    return ContactState(projection, gap, reduced_gap, slip, trial_shear, traction)


def settled_slip(state: ContactState, parameters: Contact) -> FloatArray:
    """Slip with which each point's trial shear is the shear itself, in mm; (n,).

    Where a point sticks it is the slip that it has, where it slid that of the limit of friction.
    Were it set to zero after each step, points that stick would creep by the small difference of
    T . e and q in every step, and the end would depend on the number of steps.
    """
    excess = state.trial_shear - state.traction.shear
    settled = state.slip + excess / parameters.gamma_t
    return np.where(state.traction.status == OPEN, 0.0, settled)


def residual(points: SkinPoints, state: ContactState) -> tuple[FloatArray, FloatArray]:
    """Contact part of the residual at each point.

    Returns
    -------
    skin : (n, m)
        Entries for the displacements of the skin edge's nodes, in N/mm.
    socket : (n, 3, 2)
        Entries for the displacements of the socket edge's nodes, in N/mm.
    """
    traction = points.weight[:, None] * traction_vector(state)
    skin = -np.einsum("nck,nc->nk", points.shape, traction)
    socket = np.einsum("na,nc->nac", shape_functions(state.projection.xi)[0], traction)
    return skin, socket


def tangent(
    points: SkinPoints,
    state: ContactState,
    nominal_traction: FloatArray,
    gamma: float,
    gamma_t: float,
) -> tuple[FloatArray, FloatArray]:
    """Exact derivative of `residual`: projection, normal, tangent and T all vary.

    Parameters
    ----------
    points, state
        As in `residual`.
    nominal_traction : (n, 2)
        T in MPa.
    gamma, gamma_t : float
        Nitsche stiffness in MPa/mm.

    Returns
    -------
    by_motion : (n, m + 6, m + 6)
        At a fixed T. Rows and columns: the m displacements of the skin edge's nodes, then those of
        the socket edge's nodes with their two components each.
    by_traction : (n, m + 6, 2)
        By T.
    """
    at, law = state.projection, state.traction
    n, _, m = points.shape.shape
    d_values = shape_functions(at.xi)[1]

    # Variations as row vectors over the m + 6 displacements: of x - y, of y' at fixed xi.
    d_offset = _offset_variation(points, at)
    d_first = np.zeros((n, 2, m + 6))
    d_first[:, :, m:] = np.einsum("na,cd->ncad", d_values, np.eye(2)).reshape(n, 2, 6)

    # Closest point: (x - y) . y' = 0 stays true. At it, x - y = gap n.
    offset = state.gap[:, None] * at.normal
    slope = np.sum(offset * at.second, axis=1) - np.sum(at.first**2, axis=1)
    d_xi = -(_rows(at.first, d_offset) + _rows(offset, d_first)) / slope[:, None]
    # Rotation of the socket's tangent: de = n turn, dn = - e turn.
    stretch = np.linalg.norm(at.first, axis=1)
    d_first_total = d_first + at.second[:, :, None] * d_xi[:, None, :]
    turn = _rows(at.normal, d_first_total) / stretch[:, None]

    nominal_n = np.sum(nominal_traction * at.normal, axis=1)
    nominal_e = np.sum(nominal_traction * at.tangent, axis=1)
    d_trial_pressure = -nominal_e[:, None] * turn - gamma * _rows(at.normal, d_offset)
    d_trial_shear = nominal_n[:, None] * turn - gamma_t * at.darc[:, None] * d_xi
    d_pressure = law.d_pressure[:, None] * d_trial_pressure
    d_shear = (
        law.d_shear_pressure[:, None] * d_trial_pressure
        + law.d_shear_shear[:, None] * d_trial_shear
    )
    d_traction = (
        at.normal[:, :, None] * (d_pressure + law.shear[:, None] * turn)[:, None, :]
        + at.tangent[:, :, None] * (d_shear - law.pressure[:, None] * turn)[:, None, :]
    )
    lever = -points.weight[:, None, None] * d_offset.transpose(0, 2, 1)
    by_motion = lever @ d_traction
    # The socket's test functions move along the edge with the closest point.
    moving = np.einsum("na,nc->nac", d_values, traction_vector(state)).reshape(n, 6)
    by_motion[:, m:, :] += (points.weight[:, None] * moving)[:, :, None] * d_xi[:, None, :]

    normal, along = at.normal[:, None, :], at.tangent[:, None, :]
    by_nominal = at.normal[:, :, None] * (law.d_pressure[:, None, None] * normal)
    by_nominal += at.tangent[:, :, None] * (
        law.d_shear_pressure[:, None, None] * normal + law.d_shear_shear[:, None, None] * along
    )
    return by_motion, lever @ by_nominal


def constraint_tangent(points: SkinPoints, state: ContactState, stiffness: float) -> FloatArray:
    """Tangent of contact seen as a constraint, for counting the negative modes of an equilibrium.

    The tangent of Nitsche's method will not do: where gamma is below the skin's stiffness over the
    element size it is indefinite by itself, at stable equilibria too. What decides stability is the
    stiffness of the tissues on the motions that contact allows. A sticking point is glued to its
    partner on the socket, which is linear in the displacements; a slipping point stays on the
    socket's face, at fixed contact pressure p and friction:

        stick  stiffness |dx - dy|^2,      slip  stiffness (n . (dx - dy))^2 - p d^2 gap.

    Parameters
    ----------
    points, state
        As in `residual`, at an equilibrium.
    stiffness : float
        Stiffness in MPa/mm, large against that of the tissues.

    Returns
    -------
    (n, m + 6, m + 6)
        As `by_motion` of `tangent`; symmetric where the gap is closed.
    """
    at, law = state.projection, state.traction
    n = len(points.weight)
    none = np.zeros(n)
    slipping = law.status == SLIP
    pressed = ContactTraction(
        pressure=np.where(slipping, law.pressure, 0.0),
        shear=none,
        branch=law.branch,
        d_pressure=none,
        d_shear_pressure=none,
        d_shear_shear=none,
    )
    curvature, _ = tangent(
        points,
        replace(state, traction=pressed),
        nominal_traction=np.zeros((n, 2)),
        gamma=0.0,
        gamma_t=0.0,
    )
    d_offset = _offset_variation(points, at)
    direction = np.where(
        (law.status == STICK)[:, None, None],
        np.eye(2),
        slipping[:, None, None] * at.normal[:, :, None] * at.normal[:, None, :],
    )
    spring = np.einsum("ncr,ncd,nds->nrs", d_offset, direction, d_offset)
    return curvature + stiffness * points.weight[:, None, None] * spring


def _offset_variation(points: SkinPoints, at: Projection) -> FloatArray:
    """Variation of x - y at fixed xi over the m + 6 displacements; (n, 2, m + 6)."""
    values = shape_functions(at.xi)[0]
    socket = -np.einsum("na,cd->ncad", values, np.eye(2)).reshape(len(values), 2, 6)
    return np.concatenate([points.shape, socket], axis=2)


def traction_vector(state: ContactState) -> FloatArray:
    """Traction on the skin, p n + q e, in MPa; (n, 2)."""
    at, law = state.projection, state.traction
    return law.pressure[:, None] * at.normal + law.shear[:, None] * at.tangent


def _rows(vector: FloatArray, variation: FloatArray) -> FloatArray:
    """Contract (n, 2) vectors with (n, 2, m) variations to (n, m)."""
    return np.einsum("nc,ncm->nm", vector, variation)
