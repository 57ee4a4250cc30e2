"""Continue the ring: `python3 ring_checkpoint.py CONTROL FROM LAST` prints how far off LAST."""

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.simulation.checkpoint import Checkpoint
from ring_model import ring_model

CONTROLS = {
    "with-secant": LoadSteps(first=0.2, largest=0.4, extrapolate=True),
    "where-smooth": LoadSteps(first=0.1, largest=0.3, extrapolate="smooth"),
    "without": LoadSteps(first=0.5, largest=0.5),
}


def main(control: str, first: str, last: str) -> None:
    comm = MPI.COMM_WORLD
    model = ring_model(comm, h=6.0)
    start, end = (Checkpoint(Path(path), model, {}).load() for path in (first, last))
    assert start is not None and end is not None
    stepper = LoadStepper(model, CONTROLS[control])
    stepper.run(start)

    def largest(difference: np.ndarray) -> float:
        return comm.allreduce(float(np.abs(difference).max(initial=0.0)), op=MPI.MAX)

    result = {
        "newton": [step.newton.iterations for step in stepper.steps],
        "difference": largest(stepper.newton.x.array - end.unknowns.array),
        "arc_difference": largest(model.contact.converged_arc - end.converged_arc),
    }
    if comm.rank == 0:
        print(json.dumps(result))


if __name__ == "__main__":
    main(*sys.argv[1:])
