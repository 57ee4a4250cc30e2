"""From a study file to the study that is solved."""

from collections.abc import Collection
from pathlib import Path

from calfsocket.study.plan import Plan
from calfsocket.study.reading import StudyFile
from calfsocket.study.study import Study
from calfsocket.study.sweep_table import Sweep

SEEDS = "none: nothing in a run is random"


def to_study(
    file: StudyFile,
    plan: Plan,
    out: Path | None = None,
    pictures: bool = True,
    only: Collection[str] | None = None,
) -> Study:
    """Return the study of a file.

    Parameters
    ----------
    file, plan
        The file, and what it asks for.
    out : Path, optional
        Folder of the results; by default the file's.
    pictures : bool
        Whether to draw each case.
    only : collection of str, optional
        Names of the cases to solve; by default the file's choice.
    """
    chosen = file.only if only is None else only
    sweep = Sweep(plan.parameters, plan.document.study.outcomes, plan.thresholds)
    return Study(
        cases=tuple(case for case in plan.cases if not chosen or case.name in chosen),
        settings=plan.settings,
        limb=plan.limb,
        sockets=plan.sockets,
        out=Path(plan.document.study.out) if out is None else out,
        pictures=pictures,
        known=plan.cases,
        thresholds=plan.thresholds,
        sweep=sweep if plan.parameters else None,
        origin={
            "file": file.path.name,
            "content": dict(file.content),
            "sha256": dict(file.sha256),
            "files": file.files.record,
            "seeds": SEEDS,
        },
    )
