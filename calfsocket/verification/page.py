"""The verification page: subjects run, and their templates filled with what they show.

Each section stands between comments that contain what the summary at the top needs, so that one
subject can be run again without the others.
"""

import importlib
import re
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.axis import Axis
from matplotlib.ticker import (
    LogFormatterSciNotation,
    LogLocator,
    NullFormatter,
    StrMethodFormatter,
)

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.verification.newton import newton_checks, recording
from calfsocket.verification.report import Check, Draw, Section

SUBJECTS = (
    "material_point",
    "element",
    "tangent",
    "exact_ring",
    "lined_ring",
    "contact_patch",
    "hertz",
    "friction",
    "loaded_ring",
    "fretting",
    "limb",
    "limb_friction",
    "peer",
)
"""Modules of this package with a function ``report() -> Section``, in the order of the page; what
they fill is ``pages/SUBJECT.md``."""

PAGE, FOLDER = "verification.md", "verification"

TEMPLATES = Environment(
    loader=PackageLoader("calfsocket.verification", "pages"),
    undefined=StrictUndefined,
    trim_blocks=True,
    keep_trailing_newline=True,
)


@dataclass(frozen=True)
class Part:
    """A section of the page as text, with what the summary says of it."""

    subject: str  #: name of the module
    #: number of checks, and of those that pass
    checks: int
    passed: int
    seconds: float  #: wall time
    version: str  #: of the program that made it
    body: str  #: markdown

    @property
    def title(self) -> str:
        """Heading."""
        return self.body.partition("\n")[0].removeprefix("## ")

    @property
    def anchor(self) -> str:
        """Anchor of the heading as code forges make it: lower case, hyphens, no punctuation."""
        return re.sub(r"[^\w -]", "", self.title.lower()).replace(" ", "-")

    def __str__(self) -> str:
        """Return the section between its comments."""
        return (
            f"<!-- {self.subject}: {self.passed} of {self.checks} checks, {self.seconds:.0f} s, "
            f"calfsocket {self.version} -->\n{self.body}<!-- end of {self.subject} -->\n"
        )

    @classmethod
    def all_of(cls, page: str) -> dict[str, "Part"]:
        """Read the sections of a page back."""
        found = re.findall(
            r"<!-- (\w+): (\d+) of (\d+) checks, (\d+) s, calfsocket (\S+) -->\n"
            r"(## .*?)<!-- end of \1 -->\n",
            page,
            flags=re.DOTALL,
        )
        return {
            subject: cls(subject, int(checks), int(passed), float(seconds), version, body)
            for subject, passed, checks, seconds, version, body in found
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
            raise InputError(f"--only: unknown subject {name!r}; use {', '.join(SUBJECTS)}")
    return [subject for subject in SUBJECTS if subject in names]


def write_page(
    folder: Path,
    subjects: Sequence[str] = SUBJECTS,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> bool:
    """Run subjects; write ``verification.md`` with their sections, figures and tables.

    Figures and tables go to ``verification/`` in the folder; sections of an earlier page stay when
    their subject is not run. Options are keywords of a subject's ``report``. Return whether every
    check of the subjects that were run passes.
    """
    page = folder / PAGE
    passed = True
    for subject in subjects:
        part = _run(subject, (options or {}).get(subject, {}), folder / FOLDER)
        passed = passed and part.passed == part.checks
        # Read and written after each subject: they take minutes, the next may fail, and others may
        # run beside this one.
        earlier = Part.all_of(page.read_text(encoding="utf-8")) if page.is_file() else {}
        parts = earlier | {subject: part}
        shown = [parts[name] for name in SUBJECTS if name in parts]
        with replacing(page) as temporary:
            text = TEMPLATES.get_template(PAGE).render(parts=shown)
            temporary.write_text(text, encoding="utf-8")
    return passed


def _run(subject: str, options: Mapping[str, Any], folder: Path) -> Part:
    """Run a subject; write its figures and files into a folder."""
    start = time.perf_counter()
    module = importlib.import_module(f"calfsocket.verification.{subject}")
    with recording() as solves:
        section = module.report(**options)
    checks = [*section.checks, *newton_checks(solves)]
    return Part(
        subject=subject,
        checks=len(checks),
        passed=sum(check.passes for check in checks),
        seconds=time.perf_counter() - start,
        version=calfsocket.__version__,
        body=_body(subject, section, checks, folder),
    )


def _body(subject: str, section: Section, checks: Sequence[Check], folder: Path) -> str:
    """Fill a subject's template, which must show all that there is."""
    results: dict[str, Any] = {**section.figures, **section.tables, **section.files}

    def show(write: Any, name: str, caption: str, *more: Any) -> str:
        return str(write(results.pop(name), " ".join(caption.split()), *more))

    text = TEMPLATES.get_template(f"{subject}.md").render(
        section.values,
        checks=_markdown(pd.DataFrame(map(_row, checks)), right=("value", "bar")),
        figure=lambda name, caption: show(_figure, name, caption, folder / f"{name}.png"),
        table=partial(show, _table),
        file=lambda name: show(_file, name, name, folder),
    )
    if results:
        raise ValueError(f"{subject}.md: does not show {', '.join(results)}")
    return f"{text}\n"


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


def _table(frame: pd.DataFrame, caption: str, digits: int = 4) -> str:
    right = [name for name in frame if pd.api.types.is_numeric_dtype(frame[name])]

    def cell(value: Any) -> str:
        if isinstance(value, float):
            return "" if pd.isna(value) else f"{value:.{digits}g}"
        return str(value)

    return f"*{caption}*\n\n{_markdown(frame.map(cell), right)}"


def _markdown(frame: pd.DataFrame, right: Collection[str]) -> str:
    """Markdown of a table of texts, some columns to the right."""
    align = ["--:" if name in right else "---" for name in frame]
    # Bars of magnitudes must not end a cell.
    rows = [[str(text).replace("|", r"\|") for text in row] for row in [frame, *frame.to_numpy()]]
    return "\n".join(f"| {' | '.join(row)} |" for row in [rows[0], align, *rows[1:]])


def _file(frame: pd.DataFrame, name: str, folder: Path) -> str:
    with replacing(folder / name) as temporary:
        frame.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
    return f"[{name}]({FOLDER}/{name})"


def _figure(draw: Draw, caption: str, path: Path) -> str:
    drawing, axes = plt.subplots(figsize=(8.0, 4.0), layout="constrained")
    draw(axes)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            label(axis)
    if legend := axes.get_legend():  # beside the axes, where it covers no curve
        legend.set_loc("center left")
        legend.set_bbox_to_anchor((1.0, 0.5))
    with replacing(path) as temporary:
        drawing.savefig(temporary, dpi=150)
    plt.close(drawing)
    return f"![{caption}]({FOLDER}/{path.name})\n\n*{caption}*"


SHORT = 30.0
"""Ratio of the ends of a logarithmic axis that has fewer than two powers of ten to label."""

PLAIN = (1e-3, 1e4)
"""Numbers that are written without a power of ten."""


def label(axis: Axis) -> None:
    """Label a logarithmic axis at powers of ten alone, a short one at 1, 2, 3 and 5 times them."""
    low, high = axis.get_view_interval()
    if high < SHORT * low:
        plain = PLAIN[0] <= low and high <= PLAIN[1]
        powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))  # labels all ticks
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}") if plain else powers)
    axis.set_minor_formatter(NullFormatter())
