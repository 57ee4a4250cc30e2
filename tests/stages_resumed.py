"""Resume the tiny limb: `python3 stages_resumed.py CHECKPOINT CARRIED` prints the curve."""

import json
import sys
from pathlib import Path

from mpi4py import MPI
from test_stages_simulation import STAGES, StopAfter, simulation

from calfsocket.mechanics.loading import Loading


def main(path: str, carried: str) -> None:
    comm = MPI.COMM_WORLD
    loading, monitor = Loading(stages=STAGES, carried=carried), StopAfter()
    result = simulation(loading=loading, comm=comm).solve(monitor, Path(path), resume=True)
    if comm.rank == 0:
        columns = ["moment_N_mm_per_mm", "rotation_deg", "dissipated_N_mm_per_mm"]
        found = {
            "curve": result.curve[columns].to_numpy().tolist(),
            "negative_modes": [each.checks.negative_modes for each in result.states.values()],
            "continued": "stage twist: continues from its checkpoint" in monitor.said,
        }
        print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
