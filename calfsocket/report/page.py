"""The report as one page that needs nothing else: no network, no script."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

import calfsocket
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.plotting import section as drawing
from calfsocket.report import method
from calfsocket.report.answer import Line
from calfsocket.report.calibration import HEADING, NoCalibration
from calfsocket.report.drawn import Drawn
from calfsocket.report.images import data_uri
from calfsocket.report.results import Results
from calfsocket.report.scoreboard import FAILS, HOLDS, UNCHECKED, counts
from calfsocket.report.table import Table

PAGE_FILE = "report.html"

# How the paper's parts begin in the list of claims; all others have their own name there.
PARTS = {"1": "Introduction", "2": "Method", "3": "Results", "4": "Discussion", "T": "Tables"}

MARKS = {HOLDS: "✓", FAILS: "✗", UNCHECKED: "?"}


@dataclass(frozen=True)
class Chapter:
    """A part of the page: figures by number, tables by name, in the order they are shown."""

    anchor: str
    title: str
    intro: str
    content: tuple[str, ...]


CHAPTERS = (
    Chapter(
        "model",
        "The model",
        "A transverse section of a calf in plane strain, pressed by a socket that is smaller than "
        "the limb. In the Separate set every tissue has its own law; in the Combined set muscle "
        "and fascia share one.",
        ("1", "2", "table1", "laws", "3", "calibration"),
    ),
    Chapter(
        "cases-side-by-side",
        "The cases side by side",
        "",
        ("sweep", "maxima"),
    ),
    Chapter(
        "stress",
        "Stress",
        "Compression, distortion and shear of the tissues at rest in the socket, without body "
        "weight. The largest value of a tissue is the largest level held by two neighbouring "
        "elements and five of their nodes, so that no single point decides.",
        ("4", "table2"),
    ),
    Chapter(
        "strain",
        "Strain",
        "Shear strain is engineering shear, twice the tensor's component. Stiff fascia in soft "
        "muscle buckles under little compression: waves along it are part of the result, stable "
        "where a run counts no negative modes.",
        ("7", "table4"),
    ),
    Chapter(
        "merging",
        "What merging fascia and muscle changes",
        "The Combined set against the Separate set, at each set's own maximum and at each other's "
        "sites.",
        ("5", "5b", "6", "table3", "8", "table5"),
    ),
    Chapter("contact", "Contact pressure", "", ("9", "pressure")),
    Chapter("damage-risk", "Damage thresholds", "", ("thresholds", "damage")),
    Chapter("agreement-with-paper", "Agreement with the paper", "", ("agreement",)),
    Chapter(
        "choices",
        "What the paper leaves open",
        "None of these choices is made because it looks like the paper.",
        ("variants", "dependence", "claims_by_variant"),
    ),
)


def write_page(
    results: Results,
    answer: Sequence[Line],
    figures: Sequence[Drawn],
    tables: Sequence[Table],
    board: pd.DataFrame,
    why_no_calibration: InputError | None = None,
) -> Path:
    """Write report.html into the results' folder; return its path.

    Parameters
    ----------
    results : Results
        Of a study.
    answer : sequence of Line
        What stands at the top.
    figures, tables
        What the study has of them.
    board : DataFrame
        The scoreboard.
    why_no_calibration : InputError, optional
        Why the study has no figure 3: told in its place, and at the top where a calibration is
        there that cannot be used.
    """
    content: dict[str, Any] = {
        drawn.heading.number: _figure(drawn, results.folder) for drawn in figures
    }
    content |= {table.name: {"html": Markup(table.html()), "name": table.name} for table in tables}
    warnings = method.warnings(results)
    if why_no_calibration is not None and results.of_paper is not None:
        missing = f"Figure 3 {why_no_calibration}."
        if not isinstance(why_no_calibration, NoCalibration):
            missing = f"The calibration, figure 3, is left out: {why_no_calibration}."
            warnings.append(missing)
        content[HEADING.number] = {"missing": missing}
    chapters = [
        {"about": chapter, "content": [content[key] for key in chapter.content if key in content]}
        for chapter in CHAPTERS
    ]
    environment = Environment(
        loader=FunctionLoader(read_template),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("report.html").render(
        style=Markup(read_template("report.css")),
        version=calfsocket.__version__,
        title=_title(results),
        sockets=[
            f"{name} {drawing.SOCKET_NAMES.get(name, '')}".strip()
            for name in results.sockets[: method.MOST_NAMED]
        ],
        summary=method.summary(results),
        warnings=warnings,
        answer=answer,
        chapters=[chapter for chapter in chapters if chapter["content"]],
        tally=counts(board),
        marks=MARKS,
        parts=[
            (name, group.to_dict("records"))
            for name, group in board.groupby(board.section.map(_part), sort=False)
        ],
        method=[Markup(table.html()) for table in method.tables(results)],
    )
    path = results.folder / PAGE_FILE
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _title(results: Results) -> str:
    """Give the title that the study file has, or the paper's question."""
    content = results.run.get("study", {}).get("content", {})
    return content.get("study", {}).get("title") or "What a prosthetic socket does inside a calf"


def _part(section: str) -> str:
    return PARTS.get(section[0], section)


def read_template(name: str) -> str:
    """Read a file of the page's template."""
    return (files("calfsocket.report") / "templates" / name).read_text(encoding="utf-8")


def _figure(drawn: Drawn, folder: Path) -> dict[str, Any]:
    uri, width, height = data_uri(drawn.png)
    return {
        "heading": drawn.heading,
        "uri": Markup(uri),
        "width": width,
        "height": height,
        "png": _link(drawn.png, folder),
        "pdf": _link(drawn.pdf, folder),
    }


def _link(file: Path, folder: Path) -> str:
    """Path of a file from the page's folder."""
    return Path(os.path.relpath(file, folder)).as_posix()
