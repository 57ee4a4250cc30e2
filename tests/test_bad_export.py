"""Exports that cannot be made: each gets one line, exit code 2, and no file."""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from calfsocket import cli
from reliability import Trial

TITLE = "Decks for other programs"
INTRO = "`export` of a case that is not there, or into a format that is not."

STUDY = '[study]\nsockets = ["TSB", "HS"]\nmaterials = ["combined"]\n[model]\nsize = "coarse"\n'
OUT = ("--out", "tsb.inp")

TRIALS = (
    Trial("no case is chosen", ("--format", "abaqus", *OUT),
          ("study.toml: has 2 cases; choose one with --case, e.g. --case TSB_combined",)),
    Trial("a case that is not there", ("--case", "TBS_combined", "--format", "abaqus", *OUT),
          ("--case: ", "has no case 'TBS_combined'; did you mean 'TSB_combined'?")),
    Trial("a program that is not known", ("--case", "TSB_combined", "--format", "ansys", *OUT),
          ("--format: invalid choice: 'ansys'", "abaqus")),
    Trial("no file", ("--case", "TSB_combined", "--format", "msh"), ("--out",)),
    Trial("a folder for a file", ("--case", "TSB_combined", "--format", "msh", "--out", "."),
          ("is a folder; give the name of a file",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return the line that a trial gives."""
    (folder / "study.toml").write_text(STUDY)
    words = [str(folder / word) if word in ("tsb.inp", ".") else word for word in trial.given]
    errors = StringIO()
    with redirect_stderr(errors), redirect_stdout(StringIO()):
        assert cli.main(["export", str(folder / "study.toml"), *words]) == 2
    return errors.getvalue().strip().replace(f"{folder}/", "").replace(str(folder), ".")


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_an_export_that_cannot_be_gets_one_line(trial: Trial, tmp_path: Path) -> None:
    line = said(trial, tmp_path)
    assert "\n" not in line
    for part in trial.says:
        assert part in line
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]
