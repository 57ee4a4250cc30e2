"""The limb: studies solved into folders, and single cases to be followed step by step."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.io.errors import InputError
from calfsocket.materials.law import Law
from calfsocket.materials.material_set import BASE_SETS, BaseSet, MaterialSet
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.section import section_mesh
from calfsocket.meshes.socket import Socket
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import Quantities, summary
from calfsocket.simulation.record import Checks
from calfsocket.simulation.results import Results
from calfsocket.simulation.simulation import Simulation, check
from calfsocket.study.record import results_folder
from calfsocket.study.study import Study


def solved_study(
    folder: Path, size: str, material_sets: Sequence[BaseSet] = BASE_SETS, **model: str
) -> Results:
    """Solve the paper's study into a folder, unless the folder contains its results; return them.

    A study may be solved beforehand, on several ranks.

    Parameters
    ----------
    folder : Path
        Of the results.
    size : str
        Mesh size.
    material_sets : sequence of str
        Which cases of each socket.
    **model
        Keys of the study file's table "model" that differ.

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


def cells(results: Results) -> float:
    """Mean number of elements of the cases."""
    return float(np.mean([checks.cells for checks in all_checks(results)]))


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
    section = section_mesh(MPI.COMM_SELF, limb, shape, case.mesh_size)
    return case, section, {name: case.region_laws[name] for name in section.regions}


@dataclass(frozen=True, eq=False)
class End:
    """The limb at full load."""

    checks: Checks  #: as of every result
    #: stress and strain of the section, and contact along the skin
    fields: SectionFields
    line: ContactLine

    @classmethod
    def of(cls, stepper: LoadStepper, limb: Limb) -> "End":
        """Take the equilibrium that a stepper has come to, on one rank."""
        fields = section_fields(stepper.problem, limb.tissues | {tags.SOCKET: tags.SOCKET})
        line = contact_line(stepper.problem)
        assert fields is not None and line is not None
        return cls(check(stepper), fields, line)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Rows of summary.csv."""
        return summary(Quantities.of(self.fields), self.line)

    def value(self, tissue: str, quantity: str) -> float:
        """Value of a row of the summary."""
        rows = self.summary
        return float(rows[(rows.tissue == tissue) & (rows.quantity == quantity)]["value"].iloc[0])

    @property
    def mean_pressure(self) -> float:
        """Mean contact pressure, kPa."""
        return self.value("skin", "contact_pressure_mean")

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Of the limb's nodes, mm; (n, 2). A socket without friction is free to turn."""
        names = {name: tag for tag, name in self.fields.region_names.items()}
        limb = np.unique(self.fields.cells[self.fields.region != names[tags.SOCKET]])
        return self.fields.displacement[limb]

    def moved_from(self, other: "End") -> float:
        """Largest distance of a node of the limb from its place in another end, mm."""
        return float(np.linalg.norm(self.displacement - other.displacement, axis=1).max())
