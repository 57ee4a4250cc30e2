"""The verification page: subjects run, their checks, tables and figures written as Markdown.

Each section stands between comments that contain what the summary at the top needs, so that one
subject can be run again without the others.
"""

import importlib
import re
import time
from collections.abc import Collection, Mapping, Sequence
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

Problems with known answers, solved with the mesh, the laws, the contact and the solver that studies
use. `python3 -m calfsocket verify` makes this page; the same problems run as tests. `--only
SUBJECT` makes one section again and keeps the others.
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
        """Return the section between its comments."""
        return (
            f"<!-- {self.subject}: {self.passed} of {self.checks} checks, {self.seconds:.0f} s, "
            f"calfsocket {self.version} -->\n{self.body}<!-- end of {self.subject} -->\n"
        )

    @classmethod
    def all_of(cls, page: str) -> dict[str, "Part"]:
        """Read the sections of a page back."""
        found = re.finditer(
            r"<!-- (?P<subject>\w+): (?P<passed>\d+) of (?P<checks>\d+) checks, "
            r"(?P<seconds>\d+) s, calfsocket (?P<version>\S+) -->\n"
            r"(?P<body>## (?P<title>.*?)\n.*?)<!-- end of \1 -->\n",
            page,
            flags=re.DOTALL,
        )
        numbers = {"passed": int, "checks": int, "seconds": float}
        parts = [
            cls(**{name: numbers.get(name, str)(text) for name, text in match.groupdict().items()})
            for match in found
        ]
        return {part.subject: part for part in parts}


def chosen_subjects(names: Sequence[str]) -> list[str]:
    """Return the subjects of these names, in the order of the page.

    Raises
    ------
    InputError
        For a name that is none of `SUBJECTS`.
    """
    for name in names:
        if name not in SUBJECTS:
            raise InputError(f"--only: unknown subject {name!r}; use {', '.join(SUBJECTS)}")
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
        {
            "section": f"[{part.title}](#{_anchor(part.title)})",
            "subject": f"`{part.subject}`",
            "checks": part.checks,
            "passed": f"{part.passed}" if part.passed == part.checks else f"**{part.passed}**",
            "seconds": f"{part.seconds:.0f}",
            "calfsocket": part.version,
        }
        for part in parts
    ]
    total = {name: sum(getattr(p, name) for p in parts) for name in ("checks", "passed", "seconds")}
    rows.append({"section": "all", **total, "seconds": f"{total['seconds']:.0f}"})
    return _markdown(pd.DataFrame(rows).fillna(""), right=("checks", "passed", "seconds")) + "\n"


def _anchor(title: str) -> str:
    """Anchor of a heading as code forges make it: lower case, hyphens, no punctuation."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def _body(section: Section, checks: Sequence[Check], folder: Path) -> str:
    for name, frame in section.files.items():
        with replacing(folder / name) as temporary:
            frame.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
    parts = [
        f"## {section.title}",
        section.text.strip(),
        _markdown(pd.DataFrame(map(_row, checks)), right=("value", "bar")),
        *map(_table, section.tables),
        *(f"In full: [{name}]({FOLDER}/{name})." for name in section.files),
        *(_figure(figure, folder) for figure in section.figures),
    ]
    return "\n\n".join(parts) + "\n\n"


_SIGN = {"at most": "≤", "at least": "≥", "exactly": "="}


def _row(check: Check) -> dict[str, str]:
    unit = f" {check.unit}" if check.unit else ""
    return {
        "measured": check.name,
        "value": _number(check.measured) + unit,
        "bar": f"{_SIGN[check.rule]} {_number(check.bar)}{unit}",
        "": "passes" if check.passes else "**fails**",
        "exact value from": check.source,
    }


def _number(value: float) -> str:
    """Three digits, or all of a count."""
    return str(int(value)) if float(value).is_integer() else f"{value:.3g}"


def _table(table: Table) -> str:
    frame = table.frame
    right = [name for name in frame if pd.api.types.is_numeric_dtype(frame[name])]

    def cell(value: Any) -> str:
        if isinstance(value, float):
            return "" if pd.isna(value) else f"{value:.{table.digits}g}"
        return str(value)

    return f"*{table.caption}*\n\n{_markdown(frame.map(cell), right)}"


def _markdown(frame: pd.DataFrame, right: Collection[str]) -> str:
    """Markdown of a table of texts, some columns to the right."""
    align = ["--:" if name in right else "---" for name in frame]
    # Bars of magnitudes must not end a cell.
    rows = [[str(text).replace("|", r"\|") for text in row] for row in [frame, *frame.to_numpy()]]
    return "\n".join(f"| {' | '.join(row)} |" for row in [rows[0], align, *rows[1:]])


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
