"""A concentric limb in a smaller socket: `python3 ring_model.py` prints its state as JSON."""

import json
import sys

import numpy as np
from mpi4py import MPI

from calfsocket.materials.material_set import MaterialSet
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
TISSUES = {name: name for name in ("bone", "muscle", "fat", "skin", "socket")}


def ring_model(comm: MPI.Comm, support: SocketSupport = "floating", h: float = 3.0) -> Problem:
    """Make the model; the overclosure of 0.2 mm is 0.6 % of the radius."""
    laws = MaterialSet.paper("separate").tissue_laws()
    section = ring_mesh(comm, LAYERS, SOCKET, h)
    return limb_problem(section, {name: laws[name] for name in section.regions}, support=support)


def solved_ring(comm: MPI.Comm) -> LoadStepper:
    """Solve it."""
    stepper = LoadStepper(ring_model(comm), LoadSteps(first=0.5, largest=0.5))
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


if __name__ == "__main__":
    result = describe(solved_ring(MPI.COMM_WORLD))
    if result is not None:
        json.dump(result, sys.stdout)
