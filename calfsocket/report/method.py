"""How the results were computed: settings, cases and their checks, versions, as tables."""

from typing import Any

import pandas as pd

from calfsocket.report import names
from calfsocket.report.results import Results
from calfsocket.report.table import Table, number

MOST_NAMED = 4
"""Sockets that the summary names."""

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
    "extrapolate": "predictor",
}
"""Words for the settings in run.json; one that is not here keeps its name."""


def tables(results: Results) -> list[Table]:
    """Make the tables of cases, of settings and of versions."""
    return [_cases(results), _settings(results), _versions(results)]


def summary(results: Results) -> str:
    """Say in one sentence what was solved."""
    settings = results.run["inputs"]["settings"]
    runs = "; ".join(
        f"{socket} {' and '.join(_sets(results, socket))}" for socket in results.sockets
    )
    if len(results.sockets) > MOST_NAMED:
        runs = f"{len(results.cases)} cases"
    return (
        f"{runs}. Mesh “{settings['size']}”, socket "
        f"{settings['socket_support'].replace('-', ' ')}, friction "
        f"{settings['contact']['friction']:g}, fascia's C10 {settings['fascia_c10']}, "
        f"Ogden form {settings['ogden_form']}."
    )


def warnings(results: Results) -> list[str]:
    """List what a reader must know before using a number: cases left out, and checks not passed."""
    found = [f"{name} is left out: {why}" for name, why in results.left_out.items()]
    for name in map("_".join, results.cases):
        found += [f"{name}: {text}" for text in results.run["cases"][name].get("warnings", ())]
    return found


def _sets(results: Results, socket: str) -> list[str]:
    return [
        names.material_set(name)
        for name in results.material_sets
        if (socket, name) in results.cases
    ]


def _cases(results: Results) -> Table:
    """One row a case: size of the problem, the way to its end, and what it was judged by."""
    entries = [results.run["cases"]["_".join(key)] for key in results.cases]
    data = pd.DataFrame(
        [
            {
                "socket": socket,
                "material_set": material_set,
                **{
                    key: value
                    for key, value in entry.items()
                    if not isinstance(value, dict | list) and key != "paper_set"
                },
                "own": ", ".join(
                    f"{key} = {value}" for key, value in entry.get("changes", {}).items()
                ),
                "seconds": sum(entry.get("seconds", {}).values()),
            }
            for (socket, material_set), entry in zip(results.cases, entries, strict=True)
        ]
    )
    columns = {
        "changed": ("own", str),
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
    if not (data.own != "").any():
        data = data.drop(columns="own")
    shown = pd.DataFrame(
        {label: data[key].map(text) for label, (key, text) in columns.items() if key in data}
    )
    sets = [names.material_set(name) for name in data.material_set]
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


def _settings(results: Results) -> Table:
    flat = _flat(results.run["inputs"]["settings"])
    data = pd.DataFrame({"setting": list(flat), "value": [_text(flat[key]) for key in flat]})
    shown = data.set_index(data.setting.map(lambda key: SETTINGS.get(key, key)))[["value"]]
    return Table(
        "settings", "Settings", "Shared by all runs, but for what is changed in some.", data, shown
    )


def _versions(results: Results) -> Table:
    versions = {**results.run.get("versions", {}), "ranks": results.run.get("ranks", "")}
    data = pd.DataFrame({"program": list(versions), "version": list(map(str, versions.values()))})
    return Table(
        "versions", "Versions", "Programs that the runs were made with.", data,
        data.set_index("program"),
    )  # fmt: skip


def _flat(settings: dict[str, Any]) -> dict[str, Any]:
    """Give settings by their last name."""
    flat: dict[str, Any] = {}
    for key, value in settings.items():
        flat |= _flat(value) if isinstance(value, dict) else {key: value}
    return flat


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
