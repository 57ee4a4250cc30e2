"""The figures of any study: the section, the sockets, stress, strain, contact pressure."""

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from calfsocket.plotting import loading
from calfsocket.report import along
from calfsocket.report.figures import geometry, maps, pressure, sweep, uncertain
from calfsocket.report.findings import Findings


def figures(findings: Findings) -> dict[str, Callable[[], Figure]]:
    """Return the figures of a study by name, not yet drawn."""
    loads = {
        f"loading_{number}": partial(loading.draw, result.curve)
        for number, result in enumerate(findings.results.values())
        if result.curve is not None
    }
    return {
        **loads,
        **(uncertain.figures(findings.uncertainty) if findings.uncertainty else {}),
        **along.figures(findings),
        **sweep.figures(findings),
        "regions": partial(geometry.regions, findings),
        "overlays": partial(geometry.overlays, findings),
        **{name: partial(maps.draw_map, findings, what) for name, what in maps.MAPS.items()},
        "contact_pressure": partial(pressure.contact_pressure, findings),
    }
