"""What a study was solved with, as its run.json has it, in the words that a report needs."""

from collections.abc import Mapping
from typing import Any

from calfsocket.simulation.results import Results

Laws = dict[str, dict[str, dict[str, Any]]]
"""Material set -> tissue or region -> kind of law and parameters (MPa)."""


def settings(results: Results) -> dict[str, Any]:
    """Return the settings of the cases by their last name; empty where no study was solved.

    What is changed in all of the cases is as they have it.
    """
    found = _flat(results.run.inputs.get("settings", {}))
    if "fric_coeff" in found:
        found["friction"] = found.pop("fric_coeff")
    changes = [record.changes for record in results.records.values()]
    if all(each == changes[0] for each in changes):
        found |= {key.split(".")[-1]: value for key, value in changes[0].items()}
    return found


def laws(results: Results) -> Laws:
    """Return the laws of every material set of the study, of variants by the base's names."""
    known = results.run.laws
    own = {key[1]: record.material_set for key, record in results.records.items()}
    return known | {name: known[real] for name, real in own.items() if real in known}


def title(results: Results) -> str:
    """Title of the study file; empty without one."""
    return results.run.study.get("content", {}).get("study", {}).get("title") or ""


def _flat(tables: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in tables.items():
        flat |= _flat(value) if isinstance(value, dict) else {key: value}
    return flat
