"""The study: cases times settings, solved side by side, written case by case."""

import ctypes
import gc
import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from mpi4py import MPI
from rich.console import Console

from calfsocket.io.errors import CalfsocketError, InputError
from calfsocket.materials.material_set import BASE_SETS
from calfsocket.meshes.data import Limb, Shape, Socket, Sockets
from calfsocket.meshes.placement import check_placement
from calfsocket.parallel.progress import Event, Reporter
from calfsocket.parallel.scheduler import Farm
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation import precompile as compilation
from calfsocket.simulation.case import Case, Settings, material_set
from calfsocket.study.inventory import about
from calfsocket.study.record import FILES, RUN_FILE, Ledger
from calfsocket.study.runner import try_case
from calfsocket.study.sweep_table import Sweep


@dataclass(frozen=True)
class Study:
    """Cases, what they share, and where results go.

    Attributes
    ----------
    cases : tuple of Case
        In the order of the result tables.
    settings : Settings
        Shared by all that have none of their own.
    limb, sockets
        Geometry: the section, and the sockets of the reference data.
    out : Path
        Folder of the results.
    pictures : bool
        Whether to draw each case.
    profile : bool
        Whether to write where the time goes (profile.csv).
    known : tuple of Case
        All cases that a folder of this study may hold, `cases` among them, in the order of the
        result tables; by default every socket of the reference data with every set of the paper.
    shapes : mapping of str to Shape
        Sockets beside those of the reference data.
    thresholds : tuple of Threshold
        What the summary tells besides.
    sweep : Sweep, optional
        What sweep.csv tells.
    origin : mapping
        The study file and what it read, for run.json.
    """

    cases: tuple[Case, ...]
    settings: Settings
    limb: Limb
    sockets: Sockets
    out: Path
    pictures: bool = True
    profile: bool = False
    known: tuple[Case, ...] = ()
    shapes: Mapping[str, Shape] = field(default_factory=dict)
    thresholds: tuple[Threshold, ...] = ()
    sweep: Sweep | None = None
    origin: Mapping[str, Any] = field(default_factory=dict)

    @property
    def order(self) -> tuple[Case, ...]:
        """All cases that the folder may hold, in the order of the tables."""
        return self.known or tuple(all_cases(self.sockets))

    @property
    def all_sockets(self) -> Sockets:
        """Sockets of the reference data and the study's own."""
        return self.sockets.model_copy(update={"sockets": {**self.sockets.sockets, **self.shapes}})

    def socket(self, case: Case) -> Socket:
        """Socket of a case."""
        return self.all_sockets.socket(case.socket)

    def settings_of(self, case: Case) -> Settings:
        """Give the settings of a case: its own, or those that all share."""
        return case.settings or self.settings

    def inputs(self) -> dict[str, Any]:
        """Everything that the results depend on, apart from the choice of cases."""
        return {
            "settings": self.settings.record(),
            "limb": _fingerprint(self.limb.model_dump_json()),
            "sockets": _fingerprint(self.sockets.model_dump_json(exclude_none=True)),
            "thresholds": [asdict(threshold) for threshold in self.thresholds],
            "cases": {case.name: self.fingerprint(case) for case in self.order},
        }

    def inputs_of(self, case: Case) -> dict[str, Any]:
        """Everything that the solution of a case depends on."""
        return {"limb": _fingerprint(self.limb.model_dump_json()), "case": self.fingerprint(case)}

    def fingerprint(self, case: Case) -> str:
        """Hash all that a case depends on but the limb."""
        own = {
            "socket": self.socket(case).model_dump(mode="json", exclude_none=True),
            "set": case.paper_set,
            "settings": self.settings_of(case).record(),
        }
        return _fingerprint(json.dumps(own))


def run_study(
    comm: MPI.Intracomm,
    study: Study,
    ranks_per_case: int | None = None,
    console: Console | None = None,
    go_on: bool = False,
) -> bool:
    """Solve every case and write its results (collective).

    Cases run side by side on groups of ranks. A case that fails does not stop the others: its last
    converged state is written, and run.json says why.

    Parameters
    ----------
    comm, study, ranks_per_case
        What is solved by whom.
    console
        Where progress is shown; standard error by default.
    go_on
        Keep the cases that an earlier run into the same folder has finished, and go on with those
        that it had begun from their last equilibrium.

    Returns
    -------
    bool
        Whether every case reached the full load.

    Raises
    ------
    InputError
        When the earlier run cannot be gone on with.
    WriteError
        When run.json cannot be written.
    """
    ledger, refusal = None, None
    cases: list[Case] = []
    if comm.rank == 0:
        try:
            ledger = Ledger(study, comm.size, go_on)
            cases = ledger.to_solve
        except CalfsocketError as error:
            refusal = error
    refusal, cases = comm.bcast((refusal, cases), root=0)
    if refusal is not None:
        raise refusal
    if cases:
        console = console or Console(stderr=True)
        reporter = Reporter([case.name for case in cases], console) if ledger else None

        def on_report(message: Event | dict[str, Any]) -> None:
            assert ledger is not None and reporter is not None
            if isinstance(message, Event):
                reporter.show(message)
            else:
                ledger.record(message)

        with reporter or nullcontext():
            regions = [region.name for region in study.limb.regions]
            compilation.warm(
                comm, [material_set(case, study.settings_of(case), regions) for case in cases]
            )
            farm = Farm(comm, len(cases), ranks_per_case, on_report)
            if farm.n_groups > 1:
                cases = longest_first(study, cases)
            while (number := farm.next_case()) is not None:
                case = cases[number]
                entry = try_case(farm, study, case, go_on)
                farm.report({"name": case.name, **about(case), **entry})
                _give_memory_back()
            farm.finish()
    return comm.bcast(ledger.close() if ledger else None, root=0)


def _give_memory_back() -> None:
    """Give back what a case leaves: Python's cycles, and pages that glibc keeps for later.

    The next case does not fit into their gaps: without this, six cases come to twice the memory.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def longest_first(study: Study, cases: Sequence[Case]) -> list[Case]:
    """Order cases for several groups of ranks, so that no group is left with a long one at the end.

    A socket takes the more iterations the more it squeezes, and separate materials take more than
    combined ones.
    """
    sockets = {case.socket: study.socket(case) for case in cases}
    squeezed = {
        name: check_placement(socket, study.limb).squeezed for name, socket in sockets.items()
    }
    return sorted(cases, key=lambda case: (-squeezed[case.socket], case.paper_set == "combined"))


def check_folder(study: Study, overwrite: bool) -> None:
    """Refuse a folder whose results were made with other settings.

    Raises
    ------
    InputError
        When the folder holds another study, unless it may be overwritten, or cannot be written.
    """
    path = study.out / RUN_FILE
    try:
        study.out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            return
        if overwrite:
            for name in FILES:
                (study.out / name).unlink(missing_ok=True)
            return
        before = json.loads(path.read_text(encoding="utf-8"))["inputs"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"--out {study.out}: {error}; name a folder that can be written, "
            "or add --overwrite to replace the results in it"
        ) from None
    now = json.loads(json.dumps(study.inputs()))
    # Cases may be added; results made before there were any thresholds have none.
    own_before, own_now = before.pop("cases", {}), now.pop("cases")
    before.setdefault("thresholds", [])
    changed = sorted(_differences(before, now)) or sorted(
        f"case {name}" for name in own_before.keys() & own_now if own_before[name] != own_now[name]
    )
    if changed:
        raise InputError(
            f"--out {study.out}: holds results made with other inputs ({', '.join(changed)}); "
            "name another folder, or add --overwrite to replace them"
        )


def all_cases(sockets: Sockets) -> list[Case]:
    """Every socket with every material set, in the order of the tables."""
    return [Case(socket, name) for socket in sockets.sockets for name in BASE_SETS]


def _fingerprint(text: str) -> str:
    return "sha256:" + hashlib.sha256(text.encode()).hexdigest()


def _differences(before: Any, now: Any, path: str = "") -> set[str]:
    """Dotted names of the values that differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        found: set[str] = set()
        for key in before.keys() | now.keys():
            name = f"{path}.{key}" if path else str(key)
            found |= _differences(before.get(key), now.get(key), name)
        return found
    return set() if before == now else {path}


def select(names: Sequence[str], allowed: Sequence[str], option: str) -> list[str]:
    """Return the chosen names in the order of the allowed ones, whatever their case.

    Raises
    ------
    InputError
        For a name that is not allowed, one given twice, or none at all.
    """
    by_lower = {name.lower(): name for name in allowed}
    chosen = []
    for name in names:
        key = name.strip().lower()
        if key not in by_lower:
            raise InputError(f"{option}: {name!r} is none of {', '.join(allowed)}")
        if by_lower[key] in chosen:
            raise InputError(f"{option}: {name!r} stands there twice; name each once")
        chosen.append(by_lower[key])
    if not chosen:
        raise InputError(f"{option}: nothing chosen; name at least one of {', '.join(allowed)}")
    return [name for name in allowed if name in chosen]
