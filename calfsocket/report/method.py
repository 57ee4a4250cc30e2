"""How the results were computed: settings, cases and their checks, versions, as tables."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from calfsocket.materials.material_set import MaterialSet
from calfsocket.report import inputs, names
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table
from calfsocket.report.variants import changes_of
from calfsocket.report.words import listed, number
from calfsocket.simulation.record import CaseRecord, StudyRecord
from calfsocket.simulation.results import KEY, Results

SETTINGS = {
    "size": "mesh size",
    "socket_support": "socket support",
    "donning": "donning",
    "socket_carried": "outer face under loads",
    "fascia_c10": "fascia's C10",
    "ogden_form": "Ogden form",
    "friction": "friction coefficient",
    "gamma": "Nitsche's stiffness gamma, MPa/mm",
    "gamma_t": "its tangential part gamma_t, MPa/mm",
    "gauss_points": "Gauss points on a skin edge",
    "first": "first load step",
    "largest": "largest load step",
    "smallest": "smallest load step",
    "growth": "growth of steps",
    "few_iterations": "iterations up to which steps grow",
    "cutback": "cutback after a failure",
    "extrapolate": "extrapolation from the last two steps",
    "skin_thickness": "skin's thickness, the mean or a share of the limb's own",
    "fat_thickness": "fat's thickness, the mean or a share of the limb's own",
    "thickness": "liner's thickness, mm",
    "bonded": "liner bonded to the",
    "undersize": "liner's undersize, share of its circumference",
}
"""Words for settings; one that is not here keeps its name."""

COLUMNS = {
    "changes": ("changed", str),
    "cells": ("triangles", str),
    "unknowns": ("unknowns", str),
    "steps": ("load steps", str),
    "failed_steps": ("failed steps", str),
    "newton_iterations": ("Newton iterations", str),
    "residual_N_per_mm": ("residual, N/mm", number),
    "relative_force_imbalance": ("force imbalance", number),
    "smallest_volume_ratio": ("smallest J", number),
    "largest_gap_in_contact_mm": ("gap in contact, mm", number),
    "negative_modes": ("negative modes", str),
    "seconds": ("seconds", number),
}
"""Columns of the table of cases: their data's name -> heading, and how a cell is written."""


def tables(findings: Findings) -> list[Table]:
    """Return the tables of cases, of settings and of versions."""
    run = findings.study.run
    made = [_cases(findings.results)]
    return [*made, _settings(findings), _versions(run)] if run else made


def settings(findings: Findings) -> dict[str, Any]:
    """Return the settings that reach a case: choices of the paper's laws only where one is used."""
    found = inputs.settings(findings.results)
    used = [law for laws in findings.laws.values() for law in laws.values()]
    if "fascia_c10" in found:
        paper = MaterialSet.paper("separate", found["fascia_c10"]).tissue_laws()["fascia"]
        if not any(laws.get("fascia") == paper for laws in findings.laws.values()):
            del found["fascia_c10"]
    if not any(getattr(law, "form", None) == found.get("ogden_form") for law in used):
        found.pop("ogden_form", None)
    return found


FIRST = {
    "size": "mesh size",
    "socket_support": "socket",
    "friction": "friction",
}
"""What a reader wants to know of the settings first, and its words."""


def in_words(findings: Findings, words: Mapping[str, str]) -> list[str]:
    """Return some of the settings of the cases in words, with every value that these have."""
    found = {key: text for key, text in _texts(findings).items() if key in words}
    return [f"{words[key]} {found[key].replace('-', ' ')}" for key in words if key in found]


def warnings(results: Results) -> list[str]:
    """List what a reader must know before using a number: cases left out, and checks not passed."""
    found = []
    for record in results.unsolved.values():
        about = f"{record.name} is left out" + (f", {stopped(record)}" if stopped(record) else "")
        found.append(f"{about}: {results.left_out[record.name]}")
    for name, record in states_of(results):
        found += [f"{name}: {text}" for text in record.warnings]
    return found


def states_of(results: Results) -> list[tuple[str, CaseRecord]]:
    """Return the record of each case, and of each of its states after a stage of loading."""
    found = []
    for key, record in results.records.items():
        found.append((record.name, record))
        if record.states:
            states = results[key].states
            found += [(f"{record.name}, {name}", state.record) for name, state in states.items()]
    return found


def second_meshes(results: Results) -> list[str]:
    """Return the sizes of the second meshes by which numbers have an error, in words."""
    seconds = [each.second_mesh for each in results.records.values() if each.has_second_mesh]
    return list(dict.fromkeys(f"a mesh of {each.size}" for each in seconds if each))


def finer_second(results: Results) -> bool:
    """Return whether a second mesh is finer than that of its case."""
    return any(
        each.second_mesh.cells > each.checks.cells
        for each in results.records.values()
        if each.second_mesh and each.checks
    )


def stopped(record: CaseRecord) -> str:
    """Return at which load a case has failed; empty where it reached none."""
    failed = record.status == "failed" and record.load and record.load < 1.0
    return f"stopped at load {record.load:.3g} of 1" if failed else ""


def _cases(results: Results) -> Table:
    """Make a row for each case: size of the problem, steps and checks."""
    data = pd.DataFrame(
        [
            {
                **dict(zip(KEY, key, strict=True)),
                "changes": changes_of(record),
                "ranks": record.ranks,
                **(record.checks.model_dump() if record.checks else {}),
                "seconds": sum(record.seconds.values()),
            }
            for key, record in results.records.items()
        ]
    )
    if not data.changes.any():
        data = data.drop(columns="changes")
    shown = pd.DataFrame(
        {label: data[key].map(text) for key, (label, text) in COLUMNS.items() if key in data}
    )
    shown.index = data.socket + " " + data.material_set.map(names.material_set)
    return Table("cases", data, shown)


def _texts(findings: Findings) -> dict[str, str]:
    """Return settings as text, with every value where the cases have several."""
    values = {
        key: inputs.of_cases(findings.results, key) or [value]
        for key, value in settings(findings).items()
    }
    return {key: listed(map(_text, each)) for key, each in values.items()}


def _settings(findings: Findings) -> Table:
    found = _texts(findings)
    data = pd.DataFrame({"setting": list(found), "value": list(found.values())})
    shown = data.set_index(data.setting.map(lambda key: SETTINGS.get(key, key)))[["value"]]
    return Table("settings", data, shown)


def _versions(run: StudyRecord) -> Table:
    versions = {**run.versions, "ranks": str(run.ranks)}
    data = pd.DataFrame({"program": list(versions), "version": list(versions.values())})
    return Table("versions", data, data.set_index("program"))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:  # of `LoadSteps.extrapolate`
        return "as by default"
    if value == "smooth":
        return "where the path is smooth"
    return f"{value:g}" if isinstance(value, float) else str(value)
