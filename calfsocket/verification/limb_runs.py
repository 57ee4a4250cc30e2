"""The limb: studies solved into folders, and single cases to be followed step by step."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.materials.law import Law
from calfsocket.materials.material_set import BASE_SETS, BaseSet, MaterialSet
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.section import section_mesh
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket
from calfsocket.simulation.record import Checks
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results
from calfsocket.simulation.simulation import Simulation
from calfsocket.study.record import results_folder
from calfsocket.study.study import Study
from calfsocket.verification.sampling import FloatArray


def solved_study(
    folder: Path, size: str, material_sets: Sequence[BaseSet] = BASE_SETS, **model: str
) -> Results:
    """Solve the paper's study into a folder, unless the folder contains its results; return them.

    With some cases of each socket, a mesh size, and what differs in the study file's table "model".
    A study may be solved beforehand, on several ranks.

    Raises
    ------
    InputError
        If the folder contains results of other inputs.
    """
    tables: dict[str, dict[str, Any]] = {
        "study": {"materials": list(material_sets)},
        "model": {"size": size, **model},
    }
    study = Study.paper().changed(tables)
    try:
        with results_folder(folder, study.plan):
            pass
    except InputError:
        raise InputError(
            f"--results: {folder} cannot be written to, or contains results of other inputs; "
            "name another folder"
        ) from None
    return study.run(MPI.COMM_SELF, folder, resume=True, pictures=False)


def all_checks(results: Results) -> list[Checks]:
    """Return the checks of the solved cases."""
    return [record.checks for record in results.records.values() if record.checks]


def one_case(
    socket: str, material_set: BaseSet, size: str
) -> tuple[Simulation, SectionMesh, dict[str, Law]]:
    """Return a case of the paper's study with its mesh and the laws of its regions, on one rank."""
    materials = MaterialSet.paper(material_set)
    limb, shape = Limb.reference(), Socket.reference(socket)
    case = Simulation(limb, shape, materials, mesh_size=size, comm=MPI.COMM_SELF)
    section = section_mesh(MPI.COMM_SELF, limb, shape, mesh_size(size))
    return case, section, {name: case.region_laws[name] for name in section.regions}


def value(result: Result, tissue: str, quantity: str) -> float:
    """Value of a row of the summary."""
    return float(result.summary().set_index(["tissue", "quantity"])["value"][tissue, quantity])


def mean_pressure(result: Result) -> float:
    """Mean contact pressure, kPa."""
    return value(result, "skin", "contact_pressure_mean")


def largest_distance(result: Result, other: Result) -> float:
    """Largest distance of a node of the limb from its place in another result, mm."""
    moved, reference = _limb_displacement(result), _limb_displacement(other)
    return float(np.linalg.norm(moved - reference, axis=1).max())


def _limb_displacement(result: Result) -> FloatArray:
    """Of the limb's nodes alone: a socket without friction is free to turn."""
    fields = result.fields
    socket = [tag for tag, name in fields.region_names.items() if name == tags.SOCKET]
    limb = np.unique(fields.cells[~np.isin(fields.region, socket)])
    return np.asarray(fields.displacement[limb])
