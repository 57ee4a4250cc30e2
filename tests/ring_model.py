"""A concentric limb in a smaller socket: `python3 ring_model.py` prints its state as JSON."""

import json
import sys
from collections.abc import Mapping, Sequence

import numpy as np
from mpi4py import MPI

from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.limb_problem import SocketSupport, limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import contact_line, section_fields

LAYERS = [
    ("bone", 10.0, 14.0),
    ("muscle", 14.0, 26.0),
    ("fat", 26.0, 30.0),
    ("skin", 30.0, 32.0),
]
SOCKET = (31.8, 36.0)
SWOLLEN = {"fat": 1.02, "skin": 0.99}
TISSUES = {name: name for name in ("bone", "muscle", "fat", "skin", "socket")}


def ring_model(comm: MPI.Comm, support: SocketSupport = "floating", h: float = 3.0) -> Problem:
    """Make the model; the overclosure of 0.2 mm is 0.6 % of the radius."""
    laws = MaterialSet.paper("separate").tissue_laws()
    section = ring_mesh(comm, LAYERS, SOCKET, h)
    return limb_problem(section, {name: laws[name] for name in section.regions}, support=support)


def solved_ring(comm: MPI.Comm, swollen: Mapping[str, float] | None = None) -> LoadStepper:
    """Solve it, with regions that swell to a volume ratio while the load grows."""
    problem = ring_model(comm)
    if swollen:
        problem.set_stress_free(swollen)
    stepper = LoadStepper(problem, LoadSteps(first=0.5, largest=0.5))
    stepper.run()
    return stepper


def describe(stepper: LoadStepper) -> dict[str, object] | None:
    """Sum the solved ring up, on rank 0."""
    fields = section_fields(stepper.problem, TISSUES)
    line = contact_line(stepper.problem)
    balance = stepper.problem.force_balance(stepper.newton.x, tags.TIBIA_MEDULLARY)
    volume_ratio, region = stepper.problem.smallest_volume_ratio()
    negative = stepper.newton.negative_modes()
    if fields is None or line is None:
        return None
    return {
        "newton": [step.newton.iterations for step in stepper.steps],
        "pressing": balance[1],
        "imbalance": balance[0] / balance[1],
        "volume_ratio": volume_ratio,
        "region": region,
        "negative_modes": negative,
        "arc": line.arc_mm.tolist(),
        "pressure": line.pressure_kPa.tolist(),
        "displacement": np.ravel(fields.displacement).tolist(),
        "stress": np.ravel(fields.stress).tolist(),
        "points": np.ravel(fields.points).tolist(),
    }


PULLED_LAYERS = [("bone", 10.0, 14.0), ("fascia", 14.0, 15.0), ("skin", 15.0, 20.0)]


def pulled_rings(comm: MPI.Comm, loads: LoadSteps | Sequence[float] = (0.5, 1.0)) -> LoadStepper:
    """Turn and stretch the skin of rings without a socket, whose core is held."""

    def turned(x: np.ndarray) -> np.ndarray:
        return 0.02 * x[[1, 0]] * [[-1.0], [1.0]] + 0.05 * x

    laws = MaterialSet.paper("separate").tissue_laws()
    section = ring_mesh(comm, PULLED_LAYERS, None, 2.0)
    constraints = [
        Constraint(tags.TIBIA_MEDULLARY),
        Constraint(tags.SKIN_SURFACE, values=turned),
    ]
    problem = Problem(section, {name: laws[name] for name in section.regions}, constraints)
    stepper = LoadStepper(problem, loads)
    stepper.run()
    return stepper


def describe_pulled(stepper: LoadStepper) -> dict[str, object]:
    """Sum the pulled rings up."""
    problem = stepper.problem
    torque, other = (problem.reaction(at)[1] for at in (tags.SKIN_SURFACE, tags.TIBIA_MEDULLARY))
    return {
        "newton": [step.newton.iterations for step in stepper.steps],
        "torque": torque,
        "both": torque + other,
        "volume": problem.smallest_volume_ratio()[0],
        "modes": stepper.newton.negative_modes(),
    }


if __name__ == "__main__":
    result = {
        "ring": describe(solved_ring(MPI.COMM_WORLD)),
        "swollen": describe(solved_ring(MPI.COMM_WORLD, SWOLLEN)),
        "pulled": describe_pulled(pulled_rings(MPI.COMM_WORLD)),
    }
    if MPI.COMM_WORLD.rank == 0:
        json.dump(result, sys.stdout)
