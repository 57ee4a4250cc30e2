"""The results of several cases: a study's folder, read when it is asked for."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.schema import nearest, read_json
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.mechanics.loading import DONNED
from calfsocket.parallel.first_rank import agree, on_first_rank
from calfsocket.postprocess.contact_line import COLUMNS as CONTACT_COLUMNS
from calfsocket.postprocess.levels import LEVEL_COLUMNS
from calfsocket.postprocess.mesh_error import MESH_ERROR, with_levels
from calfsocket.postprocess.pressure_map import PressureMap
from calfsocket.postprocess.quantities import SUMMARY_COLUMNS
from calfsocket.simulation.design import Design, read_design
from calfsocket.simulation.levels import Cases, along, map_of, worst_levels
from calfsocket.simulation.record import KEY, RUN_FILE, CaseRecord, StudyRecord, read_run
from calfsocket.simulation.result import CONTACT_FILE, RESULT_FILE, STATE, STEPS_FILE, Result

if TYPE_CHECKING:
    import pandas as pd
    from mpi4py import MPI

    from calfsocket.simulation.uncertain import Evaluation, Uncertain

SUMMARY_FILE = "summary.csv"
LEVELS_FILE = "levels.csv"
WORST_FILE = "worst_levels.csv"
SHARED_CELLS = 200_000
"""Most cells of results that ranks hand to each other, some 0.2 GB on each."""
MAPS = "pressure_maps"
"""Folder of the maps of a limb of many levels."""
Key = tuple[str, str]
"""Socket and material set."""


class Results(Mapping[Key, Result]):
    """Results of several cases by (socket, material set), in the order of the study.

    A case's files are read when it is first asked for. Cases that did not reach their full load are
    left out.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    run : StudyRecord, optional
        Inputs and versions of the study; None where single results were saved into the folder.
    records : mapping
        (socket, material set) -> record of every case, in order.
    read : callable
        Returns the result of a record.
    """

    def __init__(
        self,
        folder: Path,
        run: StudyRecord | None,
        records: Mapping[Key, CaseRecord],
        read: Callable[[CaseRecord], Result],
    ) -> None:
        self.folder, self.run, self._read = folder, run, read
        self._records = dict(records)
        self.records = {key: each for key, each in records.items() if each.solved}
        """Records of the solved cases."""

    def __getitem__(self, key: Key) -> Result:
        if key not in self.records:
            name = "_".join(key)
            why = self.left_out.get(name, "no such case")
            raise KeyError(f"{self.folder} contains no solved case {name}: {why}")
        return self._read(self.records[key])

    def __contains__(self, key: object) -> bool:  # without reading its files
        return key in self.records

    def __iter__(self) -> Iterator[Key]:
        return iter(self.records)

    def __len__(self) -> int:
        return len(self.records)

    @property
    def unsolved(self) -> dict[Key, CaseRecord]:
        """Records of the cases that are not solved."""
        return {key: record for key, record in self._records.items() if not record.solved}

    @property
    def left_out(self) -> dict[str, str]:
        """Name of every case that is not solved -> why."""
        return {each.name: each.message or "not finished" for each in self.unsolved.values()}

    @property
    def sockets(self) -> tuple[str, ...]:
        """Sockets of the solved cases."""
        return tuple(dict.fromkeys(socket for socket, _ in self))

    @property
    def material_sets(self) -> tuple[str, ...]:
        """Material sets of the solved cases, in the order of all."""
        solved = {name for _, name in self}
        return tuple(dict.fromkeys(name for _, name in self._records if name in solved))

    @cached_property
    def summary(self) -> "pd.DataFrame":
        """Rows of summary.csv of all donned sockets; computed where there is none."""
        return self._table(SUMMARY_FILE, Result.summary, SUMMARY_COLUMNS)

    @cached_property
    def levels(self) -> "pd.DataFrame":
        """Rows of levels.csv of all donned sockets; computed where there is none."""
        return self._table(LEVELS_FILE, Result.levels, LEVEL_COLUMNS).fillna({"region": ""})

    @cached_property
    def states(self) -> "pd.DataFrame":
        """Rows of summary.csv in every state, with a column `state`; empty without stages."""
        return self._in_states(Result.summary)

    @cached_property
    def levels_of_states(self) -> "pd.DataFrame":
        """Rows of levels.csv in every state, with a column `state`; empty without stages."""
        return self._in_states(Result.levels)

    def _in_states(self, of_result: "Callable[[Result], pd.DataFrame]") -> "pd.DataFrame":
        import pandas as pd

        parts = [
            of_case(result.of_states(of_result), result.record, key)
            for key, result in self.items()
            if result.states
        ]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    @cached_property
    def contact(self) -> "pd.DataFrame":
        """Rows of contact.csv of all donned sockets."""
        return self._table(CONTACT_FILE, lambda result: result.contact, CONTACT_COLUMNS)

    @cached_property
    def steps(self) -> "pd.DataFrame":
        """Rows of steps.csv of all cases."""
        return self._table(STEPS_FILE, lambda result: result.steps)

    def value(self, socket: str, material_set: str, tissue: str, quantity: str) -> float:
        """Value of the summary; NaN where there is none."""
        return self._numbers("value").get((socket, material_set, tissue, quantity), float("nan"))

    def mesh_error(self, socket: str, material_set: str, tissue: str, quantity: str) -> float:
        """Mesh error of a value of the summary, in its unit; NaN where there is none."""
        return self._numbers(MESH_ERROR).get((socket, material_set, tissue, quantity), float("nan"))

    @cached_property
    def _columns(self) -> dict[str, dict[tuple[str, ...], float]]:
        import pandas as pd

        key = pd.MultiIndex.from_frame(self.summary[[*KEY, "tissue", "quantity"]])
        known = [name for name in ("value", MESH_ERROR) if name in self.summary]
        return {name: dict(zip(key, map(float, self.summary[name]), strict=True)) for name in known}

    def _numbers(self, column: str) -> dict[tuple[str, ...], float]:
        return self._columns.get(column, {})

    # -- along a limb of many levels ------------------------------------------------------------

    @property
    def along(self) -> Cases:
        """Records of all cases with a level by socket and material set, and by their level."""
        return along(self._records.values())

    def pressure_map(self, socket: str, material_set: str) -> PressureMap:
        """Return contact pressure and friction of a limb of many levels over angle and height.

        Parameters
        ----------
        socket, material_set : str
            Names of the cases without their level, as in the study file.

        Raises
        ------
        InputError
            When the study has no levels or no such cases, or none of them reached its full load.
        """
        limb, name = self.run.levels if self.run else None, f"{socket}_{material_set}"
        if limb is None:
            raise InputError(
                f"{self.folder}: the limb of this study has one level; a pressure map needs one of"
                " many (`python3 -m calfsocket limb --levels`)"
            )
        cases = self.along.get((socket, material_set))
        if cases is None:
            known = map("_".join, self.along)
            raise InputError(f"{self.folder}: no cases {name}; {nearest(name, [*known])}")
        if not any(record.solved for record in cases.values()):
            raise InputError(f"{self.folder}: no level of {name} reached its full load")
        return map_of(
            limb,
            cases,
            lambda record: self._read(record).line,
            lambda record: self.mesh_error(*record.key, "skin", "contact_pressure_max"),
        )

    @cached_property
    def worst_levels(self) -> "pd.DataFrame":
        """The level at which each quantity of each tissue is largest in magnitude, a row each."""
        return worst_levels(with_levels(self.summary, self.levels), self._records.values())

    def write_maps(self, pictures: bool = True) -> list[Path]:
        """Write maps as CSV, VTP and PNG, and the table of the worst levels; return their paths.

        What an earlier run has left is removed. A study without levels has none.
        """
        folder, worst = self.folder / MAPS, self.folder / WORST_FILE
        for old in (worst, *folder.glob("*.*")):
            old.unlink(missing_ok=True)
        solved = {record.along: None for record in self.records.values() if record.level}
        paths: list[Path] = []
        for key in solved:
            found = self.pressure_map(*key)
            paths += found.write(folder)
            if pictures:
                from calfsocket.plotting import pressure_map as picture  # takes half a second

                paths.append(picture.save(found, folder))
        if solved:
            with replacing(worst) as temporary:
                self.worst_levels.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
            paths.append(worst)
        return paths

    # -- with uncertain inputs ------------------------------------------------------------------

    @cached_property
    def uncertainty(self) -> "Uncertain | None":
        """What the study's uncertain inputs do to its results; None where it has none."""
        if self.run is None or "uncertainty" not in self.run.study.content:
            return None
        from mpi4py import MPI

        from calfsocket.simulation.uncertain import Uncertain, evaluate

        return Uncertain.read(self.folder) or evaluate(self._evaluations, MPI.COMM_SELF)

    @property
    def design(self) -> Design:
        """Cases of the design of uncertain inputs, solved or not."""
        assert self.run is not None
        content = self.run.study.content["uncertainty"]
        return read_design(self.folder, content, self._records.values())

    def write_uncertainty(self, comm: "MPI.Intracomm") -> None:
        """Write the tables of `uncertainty`, if there is any (collective)."""
        if self.run is None or "uncertainty" not in self.run.study.content:
            return
        from calfsocket.simulation.uncertain import Uncertain, evaluate

        found = on_first_rank(comm, lambda: Uncertain.read(self.folder))
        if found is None:
            found = evaluate(self._evaluations, comm)
            on_first_rank(comm, lambda: found.write(self.folder))

    def _evaluations(self) -> "list[Evaluation]":
        """Collect what is computed of the uncertain inputs."""
        from calfsocket.simulation.uncertain import evaluations, numbers

        summary = self._rows(SUMMARY_FILE, Result.summary, SUMMARY_COLUMNS)
        levels = self._rows(LEVELS_FILE, Result.levels, LEVEL_COLUMNS).fillna({"region": ""})
        contact = self._rows(CONTACT_FILE, lambda result: result.contact, CONTACT_COLUMNS)
        return evaluations(self.design, numbers(summary, levels), contact)

    def shared(self, comm: "MPI.Intracomm") -> "Results":
        """Return these results, each read by one rank for all (collective).

        Where they have more cells than `SHARED_CELLS`, each rank reads what it needs.

        Raises
        ------
        InputError
            On all ranks, where one cannot read a file.
        """
        mine: dict[Key, Result] = {}
        failure: Exception | None = None
        cells = 0
        for key in [*self][comm.rank :: comm.size] if comm.size > 1 else ():
            try:
                mine[key] = self[key]
                mine[key].summary()  # and what it is made of, which the result keeps
            except Exception as error:
                failure = error
                break
            cells += len(mine[key].fields.cells) * (1 + len(mine[key].states))
            if cells > SHARED_CELLS:
                break
        agree(comm, failure)
        if comm.allreduce(cells) <= SHARED_CELLS:
            mine = {key: each for part in comm.allgather(mine) for key, each in part.items()}
        known = {each.record.key: each for each in mine.values()}

        def read(record: CaseRecord) -> Result:
            return known[record.key] if record.key in known else self._read(record)

        return Results(self.folder, self.run, self._records, read)

    def only(self, keys: Iterable[Key]) -> "Results":
        """Return the results of some cases."""
        keys = set(keys)
        records = {key: record for key, record in self._records.items() if key in keys}
        return Results(self.folder, self.run, records, self._read)

    def select(self, changes: Mapping[str, Any]) -> "Results":
        """Return the cases of a sweep that differ from the base in just these changes.

        Parameters
        ----------
        changes : mapping
            Dotted name of a parameter -> value as in the study file; empty for the base.

        Returns
        -------
        Results
            By the names that the cases have in the base (`CaseRecord.base`).
        """
        records = {
            record.base: record
            for record in self._records.values()
            if record.changes == dict(changes)
        }
        return Results(self.folder, self.run, records, self._read)

    def _table(
        self, name: str, of_result: "Callable[[Result], pd.DataFrame]", columns: Sequence[str] = ()
    ) -> "pd.DataFrame":
        """Return the rows of a table of all donned sockets; computed where there is none."""
        rows = self._rows(name, of_result, columns)
        return rows[rows[STATE] == DONNED].drop(columns=STATE).reset_index(drop=True)

    def _rows(
        self, name: str, of_result: "Callable[[Result], pd.DataFrame]", columns: Sequence[str] = ()
    ) -> "pd.DataFrame":
        """Return the rows of all states, whose names are in a column `state`."""
        import pandas as pd

        if not self.records:
            return pd.DataFrame(columns=[*KEY, STATE, *columns])
        path = self.folder / name
        of_cases = None
        if path.is_file():
            of_cases = dict(list(_read_table(path).groupby([*KEY], sort=False)))
        parts = []
        for key, record in self.records.items():
            if of_cases is None:
                rows = self[key].of_states(of_result)
            else:
                rows = of_cases.get(record.key, pd.DataFrame())
                rows = rows.drop(columns=list(record.columns), errors="ignore")
                if rows.empty:
                    raise InputError(
                        f"{path}: has no rows of {record.name}, which is solved according to "
                        f"{RUN_FILE}"
                    )
            if STATE in rows:
                rows = rows.fillna({STATE: DONNED})
            else:
                rows = rows.assign(**{STATE: DONNED})
            parts.append(of_case(rows, record, key))
        return pd.concat(parts, ignore_index=True)


def of_case(rows: "pd.DataFrame", record: CaseRecord, key: Key | None = None) -> "pd.DataFrame":
    """Return a case's rows with the columns that name it in a table of several cases.

    `key` is its name where that is not its own.
    """
    rows = rows.copy()
    columns = record.columns | dict(zip(KEY, key or record.key, strict=True))
    for place, (column, value) in enumerate(columns.items()):
        rows.insert(place, column, value)
    return rows


def load_results(folder: Path | str, known: Mapping[Key, Result] | None = None) -> Results:
    """Read the results of a study, or of single results that were saved into one folder.

    Parameters
    ----------
    folder : Path
        Holds a run.json, or a folder with a result.json for every case.
    known : mapping, optional
        Results that need not be read.

    Returns
    -------
    Results
        By (socket, material set); cases are read when they are asked for.

    Raises
    ------
    InputError
        When there are no results, or a file is missing or cannot be read.
    """
    folder = Path(folder)
    run = None
    if (folder / RUN_FILE).is_file():
        run = read_run(folder / RUN_FILE)
        # `inputs` has the cases in the order of the study, whatever was solved when
        order = dict.fromkeys([*run.inputs, *run.cases])
        solved = [run.cases[name] for name in order if name in run.cases]
        found = {record.key: (folder / record.name, record) for record in solved}
    else:
        paths = sorted(folder.glob(f"*/{RESULT_FILE}"))
        places = [(path.parent, read_json(path, CaseRecord)) for path in paths]
        found = {record.key: (place, record) for place, record in places}
    if not found:
        raise InputError(f"{folder}: contains neither a {RUN_FILE} nor a case's {RESULT_FILE}")
    read: dict[Key, Result] = dict(known or {})

    def read_once(record: CaseRecord) -> Result:
        if record.key not in read:
            read[record.key] = Result.read(found[record.key][0], record)
        return read[record.key]

    records = {key: record for key, (_, record) in found.items()}
    return Results(folder, run, records, read_once)


def _read_table(path: Path) -> "pd.DataFrame":
    import pandas as pd

    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(KEY, str), keep_default_na=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); solve the study again") from None
    for column in KEY:
        if column not in table:
            raise InputError(f"{path}: has no column '{column}', so it is not the table of a study")
    return table
