"""How the results were computed: settings, cases and their checks, versions, as tables."""

from typing import Any

import pandas as pd

from calfsocket.report import inputs, names
from calfsocket.report.answer import MOST_NAMED
from calfsocket.report.table import Table, number
from calfsocket.simulation.record import StudyRecord
from calfsocket.simulation.results import Results

SETTINGS = {
    "size": "mesh size",
    "socket_support": "socket support",
    "fascia_c10": "fascia's C10",
    "ogden_form": "Ogden form",
    "friction": "friction coefficient",
    "gamma": "Nitsche's stiffness gamma, MPa/mm",
    "gamma_t": "its tangential part gamma_t, MPa/mm",
    "first": "first load step",
    "largest": "largest load step",
    "smallest": "smallest load step",
    "growth": "growth of steps",
    "few_iterations": "iterations up to which steps grow",
    "cutback": "cutback after a failure",
    "extrapolate": "extrapolation from the last two steps",
}
"""Words for settings; one that is not here keeps its name."""


def tables(results: Results) -> list[Table]:
    """Return the tables of cases, of settings and of versions."""
    made = [_cases(results)]
    if found := inputs.settings(results):
        made.append(_settings(found))
    if results.run:
        made.append(_versions(results.run))
    return made


def summary(results: Results) -> str:
    """Return in one sentence what was solved."""
    runs = "; ".join(
        f"{socket} {' and '.join(_sets(results, socket))}" for socket in results.sockets
    )
    if len(results.sockets) > MOST_NAMED:
        runs = f"{len(results)} cases"
    found = inputs.settings(results)
    parts = [
        f"{word} {str(found[key]).replace('-', ' ')}"
        for key, word in {
            "size": "mesh size",
            "socket_support": "socket",
            "friction": "friction",
            "fascia_c10": "fascia's C10",
            "ogden_form": "Ogden form",
        }.items()
        if key in found
    ]
    if not parts:
        return f"{runs}."
    text = ", ".join(parts)
    return f"{runs}. {text[0].upper()}{text[1:]}."


def warnings(results: Results) -> list[str]:
    """List what a reader must know before using a number: cases left out, and checks not passed."""
    found = [f"{name} is left out: {why}" for name, why in results.left_out.items()]
    for record in results.records.values():
        found += [f"{record.name}: {text}" for text in record.warnings]
    return found


def _sets(results: Results, socket: str) -> list[str]:
    return [names.material_set(name) for name in results.material_sets if (socket, name) in results]


def _cases(results: Results) -> Table:
    """Make a row for each case: size of the problem, steps and checks."""
    data = pd.DataFrame(
        [
            {
                "socket": socket,
                "material_set": material_set,
                "changes": ", ".join(f"{key} = {value}" for key, value in record.changes.items()),
                "ranks": record.ranks,
                **(record.checks.model_dump() if record.checks else {}),
                "seconds": sum(record.seconds.values()),
            }
            for (socket, material_set), record in results.records.items()
        ]
    )
    columns = {
        "changed": ("changes", str),
        "triangles": ("cells", str),
        "unknowns": ("unknowns", str),
        "load steps": ("steps", str),
        "failed steps": ("failed_steps", str),
        "Newton iterations": ("newton_iterations", str),
        "residual, N/mm": ("residual_N_per_mm", number),
        "force imbalance": ("relative_force_imbalance", number),
        "smallest J": ("smallest_volume_ratio", number),
        "gap in contact, mm": ("largest_gap_in_contact_mm", number),
        "negative modes": ("negative_modes", str),
        "seconds": ("seconds", number),
    }
    if not data.changes.any():
        data = data.drop(columns="changes")
    shown = pd.DataFrame(
        {label: data[key].map(text) for label, (key, text) in columns.items() if key in data}
    )
    sets = map(names.material_set, data.material_set)
    shown.index = pd.Index([f"{s} {m}" for s, m in zip(data.socket, sets, strict=True)])
    return Table(
        "cases",
        "Runs and their checks",
        "Each run raises the load (the share of the overlap that is released) to 1 in steps. "
        "Residual: force left on the nodes. Force imbalance: contact pressure and friction against "
        "the tibia's reaction, relative to the pressing force. Smallest J: strongest volume loss. "
        "Negative modes: 0 at a stable equilibrium.",
        data,
        shown,
    )


def _settings(found: dict[str, Any]) -> Table:
    data = pd.DataFrame({"setting": list(found), "value": [_text(found[key]) for key in found]})
    shown = data.set_index(data.setting.map(lambda key: SETTINGS.get(key, key)))[["value"]]
    return Table(
        "settings", "Settings", "Shared by all runs, except for the changes of some.", data, shown
    )


def _versions(run: StudyRecord) -> Table:
    versions = {**run.versions, "ranks": str(run.ranks)}
    data = pd.DataFrame({"program": list(versions), "version": list(versions.values())})
    caption = "Programs that the runs were made with."
    return Table("versions", "Versions", caption, data, data.set_index("program"))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
