"""The verification page: every subject run, its checks and figures written as Markdown."""

import importlib
import time
from pathlib import Path

import matplotlib.pyplot as plt

import calfsocket
from calfsocket import writers
from calfsocket.verification.report import Check, Figure, Section

SUBJECTS = ("element", "exact_ring", "contact_patch", "hertz", "friction")
"""Modules of this package with a function ``report() -> Section``, in the order of the page."""


def write_page(folder: Path) -> bool:
    """Run every subject; write ``verification.md`` and its figures.

    Parameters
    ----------
    folder : Path
        Where the page goes; the figures go to ``verification/`` in it.

    Returns
    -------
    bool
        Whether every check passed.
    """
    parts, passed = [], True
    for subject in SUBJECTS:
        start = time.perf_counter()
        section = importlib.import_module(f"calfsocket.verification.{subject}").report()
        parts.append(_section(section, folder, time.perf_counter() - start))
        passed = passed and all(check.passes for check in section.checks)
    head = (
        "# Verification\n\n"
        "Problems with known answers, solved by the program's own mesh, laws, contact and solver. "
        "This page is made by `python3 -m calfsocket verify`; the same problems run as tests. Here "
        f"it was made by calfsocket {calfsocket.__version__}.\n"
    )
    with writers.replacing(folder / "verification.md") as temporary:
        temporary.write_text("\n".join([head, *parts]), encoding="utf-8")
    return passed


def _section(section: Section, folder: Path, seconds: float) -> str:
    figures = [_figure(figure, folder) for figure in section.figures]
    rows = "\n".join(_row(check) for check in section.checks)
    table = f"| measured | value | bar | | exact value from |\n|---|--:|--:|---|---|\n{rows}\n"
    text = "\n\n".join([f"## {section.title}", section.text, table, *figures])
    return f"{text}\n\n({seconds:.0f} s)\n"


def _row(check: Check) -> str:
    verdict = "passes" if check.passes else "**fails**"
    return (
        f"| {check.name} | {check.measured:.2e} {check.unit} | {check.bar:.0e} {check.unit} "
        f"| {verdict} | {check.source} |"
    )


def _figure(figure: Figure, folder: Path) -> str:
    path = folder / "verification" / f"{figure.name}.png"
    drawing, axes = plt.subplots(figsize=(8.0, 4.0), layout="constrained")
    figure.draw(axes)
    if legend := axes.get_legend():  # beside the axes, where it covers no curve
        legend.set_loc("center left")
        legend.set_bbox_to_anchor((1.0, 0.5))
    with writers.replacing(path) as temporary:
        drawing.savefig(temporary, dpi=150)
    plt.close(drawing)
    return f"![{figure.caption}](verification/{path.name})\n\n*{figure.caption}*"
