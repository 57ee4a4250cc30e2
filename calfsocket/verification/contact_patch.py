"""Pressure across meshes that do not match: patch test, complementarity, independence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.materials.laws import Hencky
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.problems import prescribed_supports
from calfsocket.verification.report import LOG, Check, Curve, Section, check_each, curves
from calfsocket.verification.sampling import FloatArray, edge_means, largest, skin_mean, worst

LIMB_LAW = Hencky(e=1.0, nu=0.3)
OVERCLOSURE = 0.02
UNIFORM = "uniform by symmetry"
GAUSS_POINTS = Contact().gauss_points


def pressed(comm: MPI.Comm, h: float, socket_modulus: float, contact: Contact) -> PrescribedMotion:
    """Press two rings with elements of h and 0.8 h mm, the socket's turned by 0.3 rad.

    The limb has a Young's modulus of 1 MPa, the socket `socket_modulus`.
    """
    socket = (20.0 - OVERCLOSURE, 26.0)
    rings = ring_mesh(comm, [(tags.LIMB, 10.0, 20.0)], socket, (h, 0.8 * h), turn=0.3)
    laws = {tags.LIMB: LIMB_LAW, tags.SOCKET: Hencky(e=socket_modulus, nu=0.3)}
    motion = prescribed_supports(rings, laws, contact)
    motion.solve()
    return motion


def patch(h: float, socket_modulus: float, points: int = GAUSS_POINTS) -> dict[str, float]:
    """Measure the pressed rings, without friction, with so many Gauss points a skin edge.

    The standard deviation of the pressure, that of its points and that of its means over skin
    edges, over its mean, should be zero; so should the imbalance, the reaction of the core over the
    pressing force.
    """
    contact = Contact(friction=0.0, gauss_points=points)
    problem = pressed(MPI.COMM_SELF, h, socket_modulus, contact).problem
    pressure = problem.contact.state().traction.pressure
    mean = skin_mean(problem.contact, pressure)
    reaction, _ = problem.reaction(tags.TIBIA_MEDULLARY)
    return {
        "points": float(np.std(pressure) / mean),
        "edges": float(np.std(edge_means(problem.contact, pressure)) / mean),
        "imbalance": float(np.linalg.norm(reaction) / (mean * problem.contact.points.weight.sum())),
    }


@dataclass(frozen=True)
class Shifted:
    """A limb moved sideways in its socket."""

    force: FloatArray  #: (2,) reaction of the core, N/mm
    pressing: float  #: integral of the contact pressure, N/mm
    peak: float  #: largest mean pressure of a skin edge, MPa
    open_share: float  #: share of the skin that is open
    least_pressure: float  #: smallest contact pressure, over the peak
    penetration: float  #: largest |gap| where pressed, over the way of the core
    overlap: float  #: largest negative gap where open, over the way of the core
    #: largest |gap| times pressure, over the way of the core and the peak pressure
    complementarity: float
    newton: int  #: Newton iterations in all


#: Way of the core, mm, and the steps it is made in.
WAY, STEPS = 0.1, 2


def shifted(
    comm: MPI.Comm, h: float = 2.0, gamma: float = 1.0, points: int = GAUSS_POINTS
) -> Shifted:
    """Press a limb with elements of h mm, then move its core sideways by `WAY` (collective).

    Nitsche's stiffness is `gamma` in MPa/mm along the normal and half of it along the tangent; a
    skin edge has so many Gauss points.
    """
    contact = Contact(gamma=gamma, gamma_t=0.5 * gamma, gauss_points=points)
    motion = pressed(comm, h, 100.0, contact)
    for _ in range(STEPS):
        motion.step([tags.LIMB], shift=(WAY / STEPS, 0.0))
    skin = motion.problem.contact
    state = skin.state()
    pressure, gap, weight = state.traction.pressure, state.reduced_gap, skin.points.weight
    closed = pressure > 0.0
    peak = largest(comm, edge_means(skin, pressure))
    return Shifted(
        force=motion.problem.reaction(tags.TIBIA_MEDULLARY)[0],
        pressing=float(comm.allreduce(weight @ pressure)),
        peak=peak,
        open_share=skin_mean(skin, (~closed).astype(float)),
        least_pressure=-largest(comm, -pressure) / peak,
        penetration=largest(comm, np.abs(gap[closed])) / WAY,
        overlap=max(largest(comm, -gap[~closed]), 0.0) / WAY,
        complementarity=largest(comm, np.abs(gap) * pressure) / (WAY * peak),
        newton=motion.iterations,
    )


def spread(results: Sequence[Shifted]) -> float:
    """Largest relative difference of force, pressing force and peak pressure among results."""
    numbers = np.array([[r.force[0], r.pressing, r.peak] for r in results])
    return worst(np.ptp(numbers, axis=0) / np.abs(numbers).max(axis=0))


SIZES = (4.0, 2.8, 2.0, 1.4, 1.0)
POINTS = (3, 4, 8, 16)
STIFF, EQUAL = 100.0, 1.0


def report() -> Section:
    """Measure scatter, complementarity and independence of what must not matter."""
    stiff = pd.DataFrame([patch(h, STIFF) for h in SIZES])
    equal = {n: pd.DataFrame([patch(h, EQUAL, n) for h in SIZES]) for n in POINTS}
    gammas = {gamma: shifted(MPI.COMM_SELF, gamma=gamma) for gamma in (0.1, 1.0, 10.0)}
    fine = shifted(MPI.COMM_SELF, h=1.0)
    gauss = [shifted(MPI.COMM_SELF, points=n) for n in (3, 4, 8)]
    last = equal[GAUSS_POINTS].iloc[-1]
    errors = {
        "equal stiffness: scatter of points": last.points,
        "equal stiffness: scatter of edge means": last.edges,
    }
    signorini = {"|gap| p": fine.complementarity, "overlap where open": fine.overlap}
    lines: list[Curve] = [(SIZES, stiff.points, "ko-", "stiff socket, 4 Gauss points")]
    lines += [
        (SIZES, scatter.points, ".--", f"equal stiffness, {n}") for n, scatter in equal.items()
    ]
    return Section(
        [
            Check("stiff socket: scatter of points", stiff.points.iloc[-1], 2e-3, UNIFORM),
            *check_each(errors, 2e-2, UNIFORM),
            Check("pressure below zero", min(gammas[1.0].least_pressure, 0.0), 0.0, "Signorini"),
            *check_each(signorini, 1e-3, "Signorini"),
            Check("gamma 0.1 to 10 MPa/mm", spread(list(gammas.values())), 1e-3, "same problem"),
            Check("3, 4, 8 Gauss points", spread(gauss), 5e-3, "same problem"),
        ],
        {
            "patch_scatter": curves(
                ("element side of the limb, mm", "scatter of pressure / mean"), lines, **LOG
            )
        },
    )
