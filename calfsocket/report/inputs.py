"""What a study was solved with, as its run.json has it, in the words that a report needs."""

from collections.abc import Mapping
from typing import Any, cast

from calfsocket.materials.law import Law
from calfsocket.simulation.results import Results

Laws = Mapping[str, Mapping[str, Law]]
"""Material set -> tissue or region -> law."""


def settings(results: Results) -> dict[str, Any]:
    """Return the settings of the cases by their last name; empty where no study was solved.

    What is changed in all of the cases is as they have it.
    """
    if results.run is None:
        return {}
    found = {key: value for table in results.run.settings.values() for key, value in table.items()}
    changes = [record.changes for record in results.records.values()]
    if all(each == changes[0] for each in changes):
        found |= {key.split(".")[-1]: value for key, value in changes[0].items()}
    return found


def of_cases(results: Results, setting: str, default: Any = None) -> list[Any]:
    """Return the values of a setting that the cases have, by its last name, each once."""
    common = settings(results).get(setting, default)
    known = [f"{table}.{setting}" for table in ("model", "steps", "liner")]
    found: list[Any] = []
    for record in results.records.values():
        value = next((record.changes[name] for name in known if name in record.changes), common)
        if value is not None and value not in found:
            found.append(value)
    return found


def friction(results: Results) -> list[float]:
    """Return the coefficients of friction of the cases, each once."""
    return sorted({float(value) for value in of_cases(results, "friction")})


DONNING = {
    "gap": "donned by closing the gaps in proportion",
    "expanded": "donned wide, moved over the limb and let go",
}
"""Words for the way in which a socket is put on."""


def donning(results: Results) -> list[str]:
    """Return in words how the sockets were put on, each once; empty without a study."""
    if results.run is None:
        return []
    # the default is the only way of earlier versions
    return [DONNING[value] for value in of_cases(results, "donning", "gap") if value in DONNING]


def wide(results: Results) -> str:
    """Return whether "all" sockets start wide, or "some"; empty where none does."""
    found = donning(results)
    if DONNING["expanded"] not in found:
        return ""
    return "all" if len(found) == 1 else "some"


CARRIED = {
    "frame": "A rigid frame carries the socket's outer face",
    "evenly": "Forces and moments are spread evenly over the socket's outer face, which is free to "
    "deform, and its motion is the mean translation and the rotation that fits it best",
}
"""Words for how stages load the socket."""


def carried(results: Results) -> list[str]:
    """Return in words how stages load the sockets, each once; empty where none does."""
    return [CARRIED[value] for value in of_cases(results, "socket_carried") if value in CARRIED]


def laws(results: Results) -> Laws:
    """Return the laws of every material set of the study, of variants by the base's names."""
    if results.run is None:
        return {}
    known = cast(Laws, results.run.laws)
    own = {
        key[1]: known.get(record.name, known.get(record.material_set))
        for key, record in results.records.items()
    }
    return {**known, **{name: found for name, found in own.items() if found is not None}}
