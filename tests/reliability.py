"""What was tried against calfsocket and what it gave: the table type of the tests, and the page.

    python3 tests/reliability.py

writes docs/reliability.md from the tables of the modules in `SUBJECTS`. Each has

    TITLE, INTRO    of its part of the page
    TRIALS          a tuple of `Trial`, which its own test is parametrised by

and, where a trial ends in one line to the user, `said(trial, folder)`, which makes the trial in an
empty folder and returns that line without the path of the folder. Where it does not, `Trial.gives`
tells in words what the test checks.
"""

import importlib
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reliability.md"

SUBJECTS = ("test_bad_input", "test_bad_outlines", "test_faults", "test_mpi_faults")

HEADER = """\
# Reliability

Bad input gives one line that names the file and the key and says what is allowed or what to do; the
exit code is 2, and nothing is written. Faults during a run lose nothing that was finished. Every row
below is a test; `python3 tests/reliability.py` makes this page from them.
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


def page() -> str:
    """Give the text of the page."""
    return "\n".join([HEADER, *(_part(subject) for subject in _subjects())])


def _subjects() -> list[ModuleType]:
    folder = Path(__file__).parent
    return [importlib.import_module(name) for name in SUBJECTS if (folder / f"{name}.py").is_file()]


def _part(subject: ModuleType) -> str:
    lines = [f"## {subject.TITLE}", "", subject.INTRO, "", "| input or fault | result |", "|---|---|"]
    for trial in subject.TRIALS:
        lines.append(f"| {_cell(trial.name)} | {_cell(_given(subject, trial))} |")
    return "\n".join(lines) + "\n"


def _given(subject: ModuleType, trial: Trial) -> str:
    if trial.gives:
        return trial.gives
    with tempfile.TemporaryDirectory() as folder:
        return f"`` {subject.said(trial, Path(folder))} ``"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
