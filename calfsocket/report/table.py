"""A table of the report and the three forms it is written in: CSV, Markdown, HTML fragment."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from markupsafe import Markup

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.postprocess.levels import ALONG_SKIN, NEARLY_ALL
from calfsocket.postprocess.quantities import CONTACT_UNITS, REPORTED, UNITS
from calfsocket.report import names
from calfsocket.report.templates import render

SETTLING = (*CONTACT_UNITS, *(f"{name}_{NEARLY_ALL}" for name in (*UNITS, *ALONG_SKIN)))
"""Numbers of contact, and of tissues those that settle with the mesh."""


@dataclass(frozen=True)
class Table:
    """A table with everything a reader needs beside it."""

    name: str
    """File name without ending."""
    data: pd.DataFrame
    """All numbers, one row a thing, for programs."""
    shown: pd.DataFrame
    """Cells as people read them, plain text; index and columns are the labels."""
    notes: tuple[str, ...] = ()
    title: str = ""
    caption: str = ""

    @cached_property
    def html(self) -> Markup:
        """A fragment without styles: a figure whose table may scroll in its own box."""
        body = self.shown.to_html(border=0, na_rep="", index_names=False, justify="unset")
        body = body.replace(' style="text-align: unset;"', "")  # styles are the page's
        return render("table.html", table=self, body=Markup(body))

    def markdown(self) -> str:
        """Return the table as a section of a Markdown page."""
        flat = self.shown.copy()
        flat.columns = [_words(label, " ") for label in flat.columns]
        labels = [_words(label, ", ") for label in flat.index]
        lines = ["| | " + " | ".join(map(_cell, flat.columns)) + " |"]
        lines.append("|---" * (flat.shape[1] + 1) + "|")
        for label, row in zip(labels, flat.to_numpy(), strict=True):
            lines.append("| " + " | ".join(map(_cell, [label, *row])) + " |")
        notes = "".join(f"- {note}\n" for note in self.notes)
        parts = [f"## {self.title}", self.caption, "\n".join(lines), notes.rstrip()]
        return "\n\n".join(part for part in parts if part) + "\n"

    def write(self, folder: Path) -> None:
        """Write NAME.csv, NAME.md and NAME.html."""
        with replacing(folder / f"{self.name}.csv") as path:
            self.data.to_csv(path, index=False, float_format=FLOAT_FORMAT)
        for extension, text in (("md", self.markdown()), ("html", str(self.html))):
            with replacing(folder / f"{self.name}.{extension}") as path:
                path.write_text(text, encoding="utf-8")


def spread(
    cells: pd.DataFrame, rows: list[str], columns: list[str], text: Iterable[str]
) -> pd.DataFrame:
    """Arrange one text per row of `cells` in a table, in the order of first appearance."""
    frame = cells[rows + columns].assign(text=[*text])
    for name in rows + columns:
        frame[name] = pd.Categorical(frame[name], frame[name].unique(), ordered=True)
    wide = frame.pivot(index=rows, columns=columns, values="text")
    return wide.astype(object).fillna("")


def settling(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return the rows that a table of several cases shows, tissue by tissue.

    Contact and levels by area, of `calfsocket.postprocess.mesh_error.with_levels`; those of the
    paper's rule are in the table's file.
    """
    rows = numbers[numbers["quantity"].isin(SETTLING)]
    place = rows.tissue.map({tissue: place for place, tissue in enumerate(REPORTED)})
    return rows.iloc[np.argsort(place.to_numpy(), kind="stable")]


def in_words(data: pd.DataFrame) -> pd.DataFrame:
    """Return columns of names in the words that people read."""
    known = {
        "tissue": names.TISSUES,
        "quantity": names.QUANTITIES,
        "site": names.SITES,
        "material_set": names.SETS,
    }
    return data.assign(
        **{
            column: [words.get(name, name) for name in data[column]]
            for column, words in known.items()
            if column in data
        }
    )


def _words(label: object, between: str) -> str:
    return between.join(map(str, label)) if isinstance(label, tuple) else str(label)


def _cell(text: object) -> str:
    return str(text).replace("|", "\\|").replace("\n", " ")
