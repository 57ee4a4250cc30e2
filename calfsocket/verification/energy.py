"""Energy balance of a shrink fit: its work against stored energy and friction.

Its derivation is in pages/limb.md. All integrals over the load are trapezoids over the load steps,
friction and lever together from the motion of the skin against the same material point of the
socket, which is what the residual works on.
"""

from dataclasses import dataclass

import numpy as np
from dolfinx import fem, mesh

from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.projection import shape_functions
from calfsocket.forms import mixed
from calfsocket.mechanics.kernels.library import JIT_OPTIONS
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep
from calfsocket.meshes import tags
from calfsocket.verification.sampling import FloatArray, Slid


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of a path from its begin to each of n load steps, N mm per mm of limb length."""

    load: FloatArray  #: (n,) loads, from 0
    work: FloatArray  #: (n,) work of the fit
    #: (n,) stored energies
    limb: FloatArray
    socket: FloatArray
    friction: FloatArray  #: (n,) dissipated by slip of the socket's undeformed arc length
    lever: FloatArray  #: (n,) rest of the work of friction tractions
    #: (n,) work of contact pressure on the reduced gap, > 0 where it takes energy
    penetration: FloatArray

    def share(self, *parts: str) -> float:
        """Share of the work that went into these parts, at the end."""
        return float(sum(getattr(self, part)[-1] for part in parts) / self.work[-1])

    @property
    def error(self) -> float:
        """Work less stored energy and friction, at the end, relative to the work."""
        return 1.0 - self.share("limb", "socket", "friction")

    @property
    def full_error(self) -> float:
        """The same with lever and penetration: what the trapezoids leave."""
        return self.error - self.share("lever", "penetration")


class EnergyMeter:
    """Follows a problem, undeformed at load 0, along its load steps, on one rank."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        domain, cells = problem.section.mesh, problem.fields.tags
        of_socket = (
            problem.section.cell_regions()[cells.indices] == problem.section.regions[tags.SOCKET]
        )
        self._stored = []
        for part in (~of_socket, of_socket):
            laws = mesh.meshtags(domain, 2, cells.indices[part], cells.values[part])
            potential = mixed.potential(
                problem.w, problem.fields.materials, mixed.volume_measure(domain, laws)
            )
            self._stored.append(fem.form(potential, jit_options=JIT_OPTIONS))
        contact = problem.contact
        state = contact.state()
        self._closing = np.minimum(state.gap, 0.0)
        self._weight = contact.points.weight
        self._rows = [np.zeros(7)]
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
        along = shear @ np.sum(way * tangent, axis=1)
        friction = -shear @ Slid.between(contact, before, state).slip
        growth = np.array(
            [
                step.load - last[0],
                -(step.load - last[0]) * normal @ self._closing,
                0.0,
                0.0,
                friction,
                -along - friction,
                -normal @ (state.reduced_gap - before.reduced_gap),
            ]
        )
        row = last + growth
        row[2:4] = [float(np.real(fem.assemble_scalar(form))) for form in self._stored]
        self._rows.append(row)
        self._state, self._position, self._socket_u = state, position, socket_u

    def balance(self) -> EnergyBalance:
        """Return what was recorded."""
        return EnergyBalance(*np.array(self._rows).T)


def _at(state: ContactState, nodal: FloatArray) -> FloatArray:
    """Interpolate values at the socket's nodes (n_edges, 3, 2) to the closest points; (n, 2)."""
    at = state.projection
    return np.asarray(np.einsum("na,nac->nc", shape_functions(at.xi)[0], nodal[at.edge]))
