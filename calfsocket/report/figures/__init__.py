"""The figures of any study: the section, the sockets, stress, strain, contact pressure."""

from collections.abc import Callable

from matplotlib.figure import Figure

from calfsocket.plotting import loading
from calfsocket.report import along
from calfsocket.report.figures import geometry, maps, pressure
from calfsocket.report.findings import Findings


def figures(findings: Findings) -> dict[str, Callable[[], Figure]]:
    """Return the figures of a study by name, not yet drawn."""
    loads = {
        f"loading_{number}": lambda curve=result.curve: loading.draw(curve)  # type: ignore[misc]
        for number, result in enumerate(findings.results.values())
        if result.curve is not None
    }
    return {
        **loads,
        **along.figures(findings),
        "regions": lambda: geometry.regions(findings),
        "overlays": lambda: geometry.overlays(findings),
        "effective_stress": lambda: maps.draw_map(findings, maps.EFFECTIVE_STRESS),
        "shear_strain": lambda: maps.draw_map(findings, maps.SHEAR_STRAIN),
        "contact_pressure": lambda: pressure.contact_pressure(findings),
    }
