"""What a report shows of a limb of many levels: its pressure maps, and the worst levels."""

from collections.abc import Callable

from matplotlib.figure import Figure

from calfsocket.plotting import pressure_map
from calfsocket.postprocess.mesh_error import MESH_ERROR
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table, in_words, settling, spread
from calfsocket.report.words import measured_all
from calfsocket.simulation.results import Key

MOST_MAPS = 12
"""Maps that a report draws; every one has files in the study's folder."""


def maps(findings: Findings) -> dict[str, Key]:
    """Return socket and material set of each map by the name of its figure."""
    if findings.levels is None:
        return {}
    solved = dict.fromkeys(record.along for record in findings.results.records.values())
    return {f"pressure_map_{'_'.join(key)}": key for key in [*solved][:MOST_MAPS]}


def figures(findings: Findings) -> dict[str, Callable[[], Figure]]:
    """Return the maps by name, not yet drawn."""

    def drawn(key: Key) -> Callable[[], Figure]:
        return lambda: pressure_map.draw(findings.results.pressure_map(*key))

    return {name: drawn(key) for name, key in maps(findings).items()}


def tables(findings: Findings) -> list[Table]:
    """Return the table of the worst levels, where there are any."""
    if findings.levels is None:
        return []
    data = findings.results.worst_levels
    rows = settling(data)
    values = measured_all(rows.value, rows, MESH_ERROR)
    text = [f"{value} at {level:.3f}" for value, level in zip(values, rows.level, strict=True)]
    shown = in_words(rows)
    shown = shown.assign(quantity=shown.quantity + ", " + shown.unit)
    cells = spread(shown, ["tissue", "quantity"], ["socket", "material_set"], text)
    return [Table("worst_levels", data, cells)]
