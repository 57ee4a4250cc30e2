"""The results of several cases: a study's folder, read when it is asked for."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_json
from calfsocket.mechanics.loading import DONNED
from calfsocket.postprocess.contact_line import COLUMNS as CONTACT_COLUMNS
from calfsocket.postprocess.quantities import SUMMARY_COLUMNS
from calfsocket.simulation.record import KEY, RUN_FILE, CaseRecord, StudyRecord, read_run
from calfsocket.simulation.result import CONTACT_FILE, RESULT_FILE, STATE, STEPS_FILE, Result

SUMMARY_FILE = "summary.csv"
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
    def summary(self) -> pd.DataFrame:
        """Rows of summary.csv of all donned sockets; computed where there is none."""
        return self._table(SUMMARY_FILE, Result.summary, SUMMARY_COLUMNS)

    @cached_property
    def states(self) -> pd.DataFrame:
        """Rows of summary.csv in every state, with a column `state`; empty without stages."""
        parts = [
            of_case(result.of_states(Result.summary), result.record)
            for result in self.values()
            if result.states
        ]
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    @cached_property
    def contact(self) -> pd.DataFrame:
        """Rows of contact.csv of all donned sockets."""
        return self._table(CONTACT_FILE, lambda result: result.contact, CONTACT_COLUMNS)

    @cached_property
    def steps(self) -> pd.DataFrame:
        """Rows of steps.csv of all cases."""
        return self._table(STEPS_FILE, lambda result: result.steps)

    def value(self, socket: str, material_set: str, tissue: str, quantity: str) -> float:
        """Value of the summary; NaN where there is none."""
        return self._values.get((socket, material_set, tissue, quantity), float("nan"))

    @cached_property
    def _values(self) -> dict[tuple[str, ...], float]:
        rows = self.summary[[*KEY, "tissue", "quantity", "value"]]
        return {tuple(row[:4]): float(row[4]) for row in rows.itertuples(index=False, name=None)}

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
            By the names that the cases have in the base (`CaseRecord.of`).
        """
        records = {
            record.of: record
            for record in self._records.values()
            if record.changes == dict(changes)
        }
        return Results(self.folder, self.run, records, self._read)

    def _table(
        self, name: str, of_result: Callable[[Result], pd.DataFrame], columns: Sequence[str] = ()
    ) -> pd.DataFrame:
        if not self.records:
            return pd.DataFrame(columns=[*KEY, *columns])
        path = self.folder / name
        whole = _read_table(path) if path.is_file() else None
        parts = []
        for key, record in self.records.items():
            if whole is None:
                rows = of_result(self[key])
            else:
                mine = (whole.socket == record.socket) & (whole.material_set == record.material_set)
                rows = whole[mine].drop(columns=list(record.columns), errors="ignore")
                if STATE in rows:
                    rows = rows[rows[STATE].isin([DONNED]) | rows[STATE].isna()]
                    rows = rows.drop(columns=STATE)
                if rows.empty:
                    raise InputError(
                        f"{path}: has no rows of {record.name}, which is solved according to "
                        f"{RUN_FILE}"
                    )
            # A selection of a sweep has the names of the base.
            parts.append(of_case(rows, record).assign(**dict(zip(KEY, key, strict=True))))
        return pd.concat(parts, ignore_index=True)


def of_case(rows: pd.DataFrame, record: CaseRecord) -> pd.DataFrame:
    """Return a case's rows with the columns that name it in a table of several cases."""
    rows = rows.copy()
    for place, (column, value) in enumerate(record.columns.items()):
        rows.insert(place, column, value)
    return rows


def load_results(folder: Path | str) -> Results:
    """Read the results of a study, or of single results that were saved into one folder.

    Parameters
    ----------
    folder : Path
        Holds a run.json, or a folder with a result.json for every case.

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
        read = [(path.parent, read_json(path, CaseRecord)) for path in paths]
        found = {record.key: (place, record) for place, record in read}
    if not found:
        raise InputError(f"{folder}: contains neither a {RUN_FILE} nor a case's {RESULT_FILE}")
    known: dict[Key, Result] = {}

    def read_once(record: CaseRecord) -> Result:
        if record.key not in known:
            known[record.key] = Result.read(found[record.key][0], record)
        return known[record.key]

    records = {key: record for key, (_, record) in found.items()}
    return Results(folder, run, records, read_once)


def _read_table(path: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(KEY, str), keep_default_na=True)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); solve the study again") from None
    for column in KEY:
        if column not in table:
            raise InputError(f"{path}: has no column '{column}', so it is not the table of a study")
    return table
