"""What was tried against calfsocket and what it gave: the table type of the tests, and the page.

    python3 tests/reliability.py

writes docs/reliability.md from the tables of the modules in `SUBJECTS`. Each has

    TITLE, INTRO    of its part of the page
    TRIALS          a tuple of `Trial`, which its own test is parametrised by

and, where a trial ends in one line to the user, `said(trial, folder)`, which makes the trial in an
empty folder and returns that line without the path of the folder. Where it does not, `Trial.gives`
says in words what the test checks.
"""

import importlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reliability.md"

SUBJECTS = (
    "test_bad_input",
    "test_bad_outlines",
    "test_bad_sources",
    "test_bad_meshes",
    "test_bad_sockets",
    "test_bad_sections",
    "test_bad_levels",
    "test_bad_uncertainty",
    "test_bad_data",
    "test_bad_export",
    "test_faults",
    "test_mpi_faults",
)

HEADER = """\
# Reliability

Bad input gives one line that names the file and the key and says what is allowed or what to do; the
exit code is 2, and nothing is written. Faults during a run lose nothing that was finished. Every
row below is a test; `python3 tests/reliability.py` makes this page from them.
"""


@dataclass(frozen=True)
class Trial:
    """Something that was tried.

    Attributes
    ----------
    name : str
        What is wrong, in a few words; unique in its table.
    given : any
        What the test needs to make it: a text, a file, a function.
    says : tuple of str
        Parts of the one line that the user must get to read.
    gives : str
        What happens instead of a line, in words.
    """

    name: str
    given: Any = None
    says: tuple[str, ...] = ()
    gives: str = ""

    def __str__(self) -> str:
        return self.name


def page(line_of: Callable[[ModuleType, Trial], str]) -> str:
    """Return the text of the page, given what a trial makes the user read."""
    return "\n".join([HEADER, *(_part(subject, line_of) for subject in _subjects())])


def row(trial: Trial, line: str) -> str:
    """Return a trial's row of the page."""
    given = trial.gives or f"`` {line} ``"
    return f"| {_cell(trial.name)} | {_cell(given)} |"


@cache
def rows() -> frozenset[str]:
    """Return the lines of the page as it is."""
    return frozenset(PAGE.read_text(encoding="utf-8").splitlines())


def _subjects() -> list[ModuleType]:
    folder = Path(__file__).parent
    return [importlib.import_module(name) for name in SUBJECTS if (folder / f"{name}.py").is_file()]


def _part(subject: ModuleType, line_of: Callable[[ModuleType, Trial], str]) -> str:
    lines = [
        f"## {subject.TITLE}",
        "",
        subject.INTRO,
        "",
        "| input or fault | result |",
        "|---|---|",
    ]
    lines += [
        row(trial, "" if trial.gives else line_of(subject, trial)) for trial in subject.TRIALS
    ]
    return "\n".join(lines) + "\n"


def _line(subject: ModuleType, trial: Trial) -> str:
    with tempfile.TemporaryDirectory() as folder:
        line: str = subject.said(trial, Path(folder))
        return line


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    PAGE.write_text(page(_line), encoding="utf-8")
    print(PAGE)
