"""The verification page: subjects run, their checks, tables and figures written as Markdown.

Each section stands between comments that hold what the summary at the top needs, so that one
subject can be run again without the others.
"""

import importlib
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.verification.newton import newton_checks, recording
from calfsocket.verification.report import Check, Figure, Section, Table

SUBJECTS = (
    "material_point",
    "element",
    "tangent",
    "exact_ring",
    "contact_patch",
    "hertz",
    "friction",
    "fretting",
    "limb",
    "limb_friction",
)
"""Modules of this package with a function ``report() -> Section``, in the order of the page."""

PAGE, FOLDER = "verification.md", "verification"

HEAD = """\
# Verification

Problems with known answers, solved by the program's own mesh, laws, contact and solver. This page
is made by `python3 -m calfsocket verify`; the same problems run as tests. With `--only SUBJECT` one
section is made again and the others stay.
"""


@dataclass(frozen=True)
class Part:
    """A section of the page as text, with what the summary says of it."""

    #: name of the module, and heading
    subject: str
    title: str
    #: number of checks, and of those that pass
    checks: int
    passed: int
    seconds: float  #: wall time
    version: str  #: of the program that made it
    body: str  #: markdown

    def __str__(self) -> str:
        """Give the section between its comments."""
        told = (
            f"<!-- {self.subject}: {self.passed} of {self.checks} checks, {self.seconds:.0f} s, "
            f"calfsocket {self.version} -->"
        )
        return f"{told}\n{self.body}<!-- end of {self.subject} -->\n"

    @classmethod
    def all_of(cls, page: str) -> dict[str, "Part"]:
        """Read the sections of a page back."""
        found = re.finditer(
            r"<!-- (\w+): (\d+) of (\d+) checks, (\d+) s, calfsocket (\S+) -->\n"
            r"(## (.*?)\n.*?)<!-- end of \1 -->\n",
            page,
            flags=re.DOTALL,
        )
        return {
            subject: cls(subject, title, int(checks), int(passed), float(seconds), version, body)
            for subject, passed, checks, seconds, version, body, title in (
                match.groups() for match in found
            )
        }


def chosen_subjects(names: Sequence[str]) -> list[str]:
    """Return the subjects of these names, in the order of the page.

    Raises
    ------
    InputError
        For a name that is none of `SUBJECTS`.
    """
    for name in names:
        if name not in SUBJECTS:
            raise InputError(f"--only: {name!r} is none of {', '.join(SUBJECTS)}")
    return [subject for subject in SUBJECTS if subject in names]


def write_page(
    folder: Path,
    subjects: Sequence[str] = SUBJECTS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> bool:
    """Run subjects; write ``verification.md`` with their sections, figures and tables.

    Parameters
    ----------
    folder : Path
        Where the page goes; figures and tables go to ``verification/`` in it. Sections of an
        earlier page stay when their subject is not run.
    subjects : sequence of str
        Which to run.
    options : mapping of subject to keywords, optional
        What the ``report`` of a subject is called with.

    Returns
    -------
    bool
        Whether every check of the subjects that were run passes.
    """
    page = folder / PAGE
    passed = True
    for subject in subjects:
        start = time.perf_counter()
        module = importlib.import_module(f"calfsocket.verification.{subject}")
        with recording() as solves:
            section = module.report(**(options or {}).get(subject, {}))
        checks = [*section.checks, *newton_checks(solves)]
        part = Part(
            subject=subject,
            title=section.title,
            checks=len(checks),
            passed=sum(check.passes for check in checks),
            seconds=time.perf_counter() - start,
            version=calfsocket.__version__,
            body=_body(section, checks, folder / FOLDER),
        )
        passed = passed and part.passed == part.checks
        # Read and written after each subject: they take minutes, the next may fail, and others may
        # run beside this one.
        earlier = Part.all_of(page.read_text(encoding="utf-8")) if page.is_file() else {}
        parts = earlier | {subject: part}
        shown = [parts[name] for name in SUBJECTS if name in parts]
        with replacing(page) as temporary:
            text = "\n".join([HEAD, _summary(shown), *map(str, shown)])
            temporary.write_text(text, encoding="utf-8")
    return passed


def _summary(parts: Sequence[Part]) -> str:
    rows = [
        f"| [{part.title}](#{_anchor(part.title)}) | `{part.subject}` | {part.checks} "
        f"| {part.passed if part.passed == part.checks else f'**{part.passed}**'} "
        f"| {part.seconds:.0f} | {part.version} |"
        for part in parts
    ]
    total = [sum(values) for values in zip(*((p.checks, p.passed) for p in parts), strict=True)]
    seconds = sum(part.seconds for part in parts)
    rows.append(f"| all | | {total[0]} | {total[1]} | {seconds:.0f} | |")
    head = (
        "| section | subject | checks | passed | seconds | calfsocket |\n|---|---|--:|--:|--:|--:|"
    )
    return "\n".join([head, *rows]) + "\n"


def _anchor(title: str) -> str:
    """Anchor of a heading as code forges make it: lower case, hyphens, no punctuation."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def _body(section: Section, checks: Sequence[Check], folder: Path) -> str:
    for name, frame in section.files.items():
        with replacing(folder / name) as temporary:
            frame.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
    files = [f"In full: [{name}]({FOLDER}/{name})." for name in section.files]
    rows = "\n".join(_row(check) for check in checks)
    table = f"| measured | value | bar | | exact value from |\n|---|--:|--:|---|---|\n{rows}"
    parts = [
        f"## {section.title}",
        section.text.strip(),
        table,
        *map(_table, section.tables),
        *files,
        *(_figure(figure, folder) for figure in section.figures),
    ]
    return "\n\n".join(parts) + "\n\n"


_SIGN = {"at most": "≤", "at least": "≥", "exactly": "="}


def _row(check: Check) -> str:
    verdict = "passes" if check.passes else "**fails**"
    unit = f" {check.unit}" if check.unit else ""
    return (
        f"| {_escaped(check.name)} | {_number(check.measured)}{unit} "
        f"| {_SIGN[check.rule]} {_number(check.bar)}{unit} | {verdict} | {_escaped(check.source)} |"
    )


def _escaped(text: str) -> str:
    """Keep bars of magnitudes from ending a cell."""
    return text.replace("|", r"\|")


def _number(value: float) -> str:
    """Three digits, or all of a count."""
    return str(int(value)) if float(value).is_integer() else f"{value:.3g}"


def _table(table: Table) -> str:
    """Markdown of a table, numbers to the right."""
    frame = table.frame
    align = ["--:" if pd.api.types.is_numeric_dtype(kind) else "---" for kind in frame.dtypes]

    def cell(value: Any) -> str:
        if isinstance(value, float):
            return "" if pd.isna(value) else f"{value:.{table.digits}g}"
        return _escaped(str(value))

    rows = [list(map(cell, frame.columns)), align]
    rows += [[cell(value) for value in row] for row in frame.itertuples(index=False)]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([f"*{table.caption}*", "", *lines])


def _figure(figure: Figure, folder: Path) -> str:
    path = folder / f"{figure.name}.png"
    drawing, axes = plt.subplots(figsize=(8.0, 4.0), layout="constrained")
    figure.draw(axes)
    if legend := axes.get_legend():  # beside the axes, where it covers no curve
        legend.set_loc("center left")
        legend.set_bbox_to_anchor((1.0, 0.5))
    with replacing(path) as temporary:
        drawing.savefig(temporary, dpi=150)
    plt.close(drawing)
    return f"![{figure.caption}]({FOLDER}/{path.name})\n\n*{figure.caption}*"
