"""How far a case has come: its last equilibrium in a file, to continue from after an interruption.

Stages of loading have a file each, whose end is kept until the case is done.

Unknowns are kept cell by cell and the slip history edge by edge, in the mesh generator's order: a
case may continue with another number of ranks. What solves a case decides the last digits too, so a
checkpoint is used only with the same inputs, mesh, options and versions.
"""

import hashlib
import json
from collections.abc import Mapping
from copy import copy
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc
from pydantic import TypeAdapter

from calfsocket.io import petsc_options
from calfsocket.io.errors import CalfsocketError, in_one_line
from calfsocket.io.fenics import cell_nodes
from calfsocket.io.files import replacing
from calfsocket.io.versions import versions
from calfsocket.mechanics.carrier import COMPONENTS, Control
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stages import Limit, Point, StageMilestone
from calfsocket.mechanics.stepping import LoadStep, Milestone

CHECKPOINT_FILE = "checkpoint.npz"
STAGE_FILES = "checkpoint_*.npz"
"""Beside it where the case has stages of loading, one for each that has begun."""

Arrays = dict[str, NDArray[Any]]
_STEPS = TypeAdapter(tuple[LoadStep, ...])


def conditions() -> dict[str, Any]:
    """Return what numbers depend on besides the inputs."""
    return {"versions": versions(), "petsc_options": petsc_options.given()}


def _with_arrays(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields of a dataclass with arrays in the place of lists."""
    return {key: np.array(each) if isinstance(each, list) else each for key, each in values.items()}


class CheckpointError(CalfsocketError):
    """A checkpoint cannot be used."""


class Checkpoint:
    """The file of a case's last equilibrium (every method is collective).

    `inputs` is everything that the numbers depend on besides the problem, as JSON takes it.
    """

    def __init__(self, path: Path, model: Problem, inputs: Mapping[str, object]) -> None:
        self.path = path
        self._model = model
        domain = model.section.mesh
        text = json.dumps(inputs, sort_keys=True, default=str)
        mesh = self._collect_cells(np.asarray(domain.geometry.x[cell_nodes(domain)]))
        digest = ""
        if mesh is not None:
            digest = hashlib.sha256(text.encode() + mesh.tobytes()).hexdigest()
        self._fingerprint = model.comm.bcast(digest, root=0)

    def of_stage(self, number: int) -> "Checkpoint":
        """Return that of a stage of loading, counted from 1."""
        found = copy(self)
        found.path = self.path.with_stem(f"{self.path.stem}_{number}")
        return found

    def save(self, milestone: Milestone) -> None:
        """Replace the file by a new one, in one step.

        Raises
        ------
        WriteError
            On rank 0 alone, which writes; nothing collective is left to do then.
        """
        self._save(milestone, {})

    def save_stage(self, milestone: StageMilestone) -> None:
        """Replace the file by a new one, as `save`."""
        control = milestone.control
        self._save(
            milestone.way,
            {
                "stage": milestone.stage,
                "ways": milestone.ways,
                "start": [milestone.held, milestone.force, milestone.place],
                "volume": milestone.volume,
                "control": vars(control) if control else None,
                "points": [vars(point) for point in milestone.points],
                "limits": [vars(limit) for limit in milestone.limits],
                "stage_steps": [asdict(step) for step in milestone.steps],
            },
        )

    def _save(self, milestone: Milestone, more: Mapping[str, Any]) -> None:
        unknowns = self._unknowns_in_cells(milestone.unknowns)
        before = self._unknowns_in_cells(milestone.unknowns_before)
        carried, carried_before = (
            self._carried(x) for x in (milestone.unknowns, milestone.unknowns_before)
        )
        arc = self._collect_skin(milestone.converged_arc)
        if unknowns is None or before is None or arc is None:
            return
        content = {
            "fingerprint": self._fingerprint,
            **more,
            "load": milestone.load,
            "load_before": milestone.load_before,
            "next_step": milestone.next_step,
            "steps": [asdict(step) for step in milestone.steps],
            "bend": milestone.bend,
        }
        with replacing(self.path) as temporary, temporary.open("wb") as file:
            np.savez(
                file,
                content=np.array(json.dumps(content, default=np.ndarray.tolist)),
                unknowns=unknowns,
                unknowns_before=before,
                carrier=np.array([carried, carried_before]),
                converged_arc=arc,
            )

    def load(self) -> Milestone | None:
        """Return what was saved; None where there is no file.

        Raises
        ------
        CheckpointError
            On every rank, for a file that is damaged or was made from anything else.
        """
        read = self._shared()
        return None if read is None else self._milestone(*read)

    def load_stage(self, name: str) -> StageMilestone | None:
        """Return what was saved of a stage of this name; None where there is no file.

        Raises
        ------
        CheckpointError
            As of `load`, and for another stage.
        """
        read = self._shared()
        if read is None:
            return None
        content = read[0]
        if content.get("stage") != name:
            raise CheckpointError(f"{self.path}: cannot be used: it is of another stage")
        held, force, place = map(np.array, content["start"])
        control = content["control"]
        return StageMilestone(
            stage=name,
            ways=content["ways"],
            way=self._milestone(*read),
            held=held,
            force=force,
            place=place,
            volume=content["volume"],
            control=Control(**_with_arrays(control)) if control else None,
            points=tuple(Point(**_with_arrays(point)) for point in content["points"]),
            limits=tuple(Limit(**_with_arrays(limit)) for limit in content["limits"]),
            steps=_STEPS.validate_python(content["stage_steps"]),
        )

    def _shared(self) -> tuple[dict[str, Any], Arrays] | None:
        """Read the file, on every rank (collective)."""
        read: tuple[dict[str, Any], Arrays] | None = None
        refusal = ""
        if self._model.comm.rank == 0 and self.path.exists():
            try:
                read = self._read()
            except Exception as error:  # whatever is wrong with it, the case can start again
                refusal = f"{self.path}: cannot be used: {in_one_line(error)}"
        refusal, read = self._model.comm.bcast((refusal, read), root=0)
        if refusal:
            raise CheckpointError(refusal)
        return read

    def _milestone(self, content: dict[str, Any], arrays: Arrays) -> Milestone:
        carried = arrays["carrier"]
        return Milestone(
            load=content["load"],
            load_before=content["load_before"],
            next_step=content["next_step"],
            unknowns=self._vector(arrays["unknowns"], carried[0]),
            unknowns_before=self._vector(arrays["unknowns_before"], carried[1]),
            converged_arc=self._on_skin(arrays["converged_arc"]),
            steps=_STEPS.validate_python(content["steps"]),
            bend=content["bend"],
        )

    def _read(self) -> tuple[dict[str, Any], Arrays]:
        with np.load(self.path, allow_pickle=False) as file:
            arrays = dict(file)
        content = json.loads(str(arrays.pop("content")))
        if content["fingerprint"] != self._fingerprint:
            raise CheckpointError("it was made with other inputs, options or versions")
        return content, arrays

    # -- unknowns, cell by cell -----------------------------------------------------------------

    def _collect_cells(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Values of this rank's cells, one row a cell, as those of all cells on rank 0."""
        topology = self._model.section.mesh.topology
        owned = topology.index_map(2).size_local
        return self._collect(topology.original_cell_index[:owned], values[:owned])

    def _unknowns_in_cells(self, x: PETSc.Vec) -> NDArray[Any] | None:
        V = self._model.V
        w = fem.Function(V)
        owned = V.dofmap.index_map.size_local
        w.x.array[:owned] = x.array_r[:owned]
        w.x.scatter_forward()
        return self._collect_cells(w.x.array[V.dofmap.list])

    def _carried(self, x: PETSc.Vec) -> NDArray[Any]:
        """Unknowns of what carries the socket, 0 where nothing does (collective)."""
        carrier = self._model.carrier
        return np.zeros(COMPONENTS) if carrier is None else carrier.of_all(x.array_r)

    def _vector(self, in_cells: NDArray[Any], carried: NDArray[Any]) -> PETSc.Vec:
        V = self._model.V
        values = np.empty_like(self._model.w.x.array)
        values[V.dofmap.list] = in_cells[V.mesh.topology.original_cell_index]
        x = self._model.create_vector()
        owned = V.dofmap.index_map.size_local
        x.array[:owned] = values[:owned]
        if self._model.carrier is not None and self._model.carrier.extra:
            x.array[owned:] = carried
        return x

    # -- slip history, edge by edge -------------------------------------------------------------

    def _skin_edges(self) -> NDArray[Any]:
        """Return the number of each skin edge of this rank: of its cell, and its place there."""
        cell, facet = self._model.contact.skin.entities.T
        return 3 * self._model.section.mesh.topology.original_cell_index[cell] + facet

    def _collect_skin(self, at_points: NDArray[Any]) -> NDArray[Any] | None:
        edges = self._skin_edges()
        points = len(self._model.contact.edge_parameters)
        return self._collect(edges, at_points.reshape(len(edges), points))

    def _on_skin(self, at_points: NDArray[Any]) -> NDArray[Any]:
        edges = self._skin_edges()
        everyone = np.sort(np.concatenate(self._model.comm.allgather(edges)))
        return at_points[np.searchsorted(everyone, edges)].ravel()

    def _collect(self, numbers: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any] | None:
        """Rows of all ranks in the order of their numbers; on rank 0."""
        collected = self._model.comm.gather((numbers, rows), root=0)
        if collected is None:
            return None
        number, row = (np.concatenate(parts) for parts in zip(*collected, strict=True))
        return row[np.argsort(number)]
