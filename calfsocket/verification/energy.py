"""Energy balance of a shrink fit: its work against stored energy and friction.

Its derivation is in pages/limb.md. All integrals over the load are trapezoids over the load steps,
friction and lever together from the motion of the skin against the same material point of the
socket, which is what the residual works on.
"""

import numpy as np
import pandas as pd
from dolfinx import fem, mesh

from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.projection import shape_functions
from calfsocket.contact.resultants import Slid
from calfsocket.forms import mixed
from calfsocket.mechanics.kernels.library import JIT_OPTIONS
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep
from calfsocket.meshes import tags
from calfsocket.verification.sampling import FloatArray

PARTS = ("load", "work", "limb", "socket", "friction", "lever", "penetration")


class EnergyMeter:
    """Follows a problem, undeformed at load 0, along its load steps, on one rank.

    Its `balance` has a row a load step, the first at load 0, in N mm per mm of limb length: load;
    work of the fit; energies stored in limb and socket; friction, dissipated by slip of the arc
    length of the undeformed socket; lever, the rest of the work of friction tractions; penetration,
    the work of contact pressure on the reduced gap, > 0 where it takes energy.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        domain, cells = problem.section.mesh, problem.fields.tags
        of_socket = (
            problem.section.cell_regions()[cells.indices] == problem.section.regions[tags.SOCKET]
        )
        self._stored = {}
        for name, part in (("limb", ~of_socket), ("socket", of_socket)):
            laws = mesh.meshtags(domain, 2, cells.indices[part], cells.values[part])
            potential = mixed.potential(
                problem.w, problem.fields.materials, mixed.volume_measure(domain, laws)
            )
            self._stored[name] = fem.form(potential, jit_options=JIT_OPTIONS)
        contact = problem.contact
        state = contact.state()
        self._closing = np.minimum(state.gap, 0.0)
        self._weight = contact.points.weight
        self._rows = [dict.fromkeys(PARTS, 0.0)]
        self._state = state
        self._socket_u = contact.socket_displacement()
        self._position = contact.deformed_points()

    def record(self, step: LoadStep) -> None:
        """Take a load step in; one that failed is passed over. For `LoadStepper`'s `on_step`."""
        if not step.newton.converged:
            return
        contact = self._problem.contact
        state, weight = contact.state(), self._weight
        position, socket_u = contact.deformed_points(), contact.socket_displacement()
        before, last = self._state, self._rows[-1]
        normal = 0.5 * weight * (before.traction.pressure + state.traction.pressure)
        # The way of x - y with y the same point of the socket before and after.
        moved = socket_u - self._socket_u
        way = (position - self._position) - 0.5 * (_at(before, moved) + _at(state, moved))
        shear = 0.5 * weight * (before.traction.shear + state.traction.shear)
        tangent = before.projection.tangent + state.projection.tangent
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        along = float(shear @ np.sum(way * tangent, axis=1))
        friction = -float(shear @ Slid.between(contact, before, state).slip)
        work = -(step.load - last["load"]) * normal @ self._closing
        penetration = -normal @ (state.reduced_gap - before.reduced_gap)
        self._rows.append(
            {
                "load": step.load,
                "work": last["work"] + float(work),
                **{
                    part: float(np.real(fem.assemble_scalar(e))) for part, e in self._stored.items()
                },
                "friction": last["friction"] + friction,
                "lever": last["lever"] - along - friction,
                "penetration": last["penetration"] + float(penetration),
            }
        )
        self._state, self._position, self._socket_u = state, position, socket_u

    @property
    def balance(self) -> pd.DataFrame:
        """Energies from the path's begin to each load step."""
        return pd.DataFrame(self._rows)


def share(balance: pd.DataFrame, *parts: str) -> float:
    """Share of the work that went into these parts, at the end."""
    end = balance.iloc[-1]
    return float(end[list(parts)].sum() / end.work)


def energy_error(balance: pd.DataFrame) -> float:
    """Work less stored energy and friction, at the end, relative to the work."""
    return 1.0 - share(balance, "limb", "socket", "friction")


def trapezoid_error(balance: pd.DataFrame) -> float:
    """Return what is left with lever and penetration, too: the error of the trapezoids."""
    return energy_error(balance) - share(balance, "lever", "penetration")


def _at(state: ContactState, nodal: FloatArray) -> FloatArray:
    """Interpolate values at the socket's nodes (n_edges, 3, 2) to the closest points; (n, 2)."""
    at = state.projection
    return np.asarray(np.einsum("na,nac->nc", shape_functions(at.xi)[0], nodal[at.edge]))
