"""A panel for every case: material sets by sockets."""

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.plotting import section as drawing
from calfsocket.plotting.style import panels
from calfsocket.report import names
from calfsocket.report.findings import Findings
from calfsocket.report.method import stopped
from calfsocket.simulation.result import Result

KEY_MM = 21.0


def case_panels(
    findings: Findings, window: drawing.Window, draw: Callable[[Axes, Result], None]
) -> Figure:
    """Draw every case in a panel of its own, all to one scale, with room for a key below."""
    results = findings.results
    sets = results.material_sets

    def draw_case(axes: Axes, socket: str, row: int) -> None:
        if (socket, sets[row]) in results:
            draw(axes, results[socket, sets[row]])
        else:
            record = results.unsolved.get((socket, sets[row]))
            text = stopped(record) or "not solved" if record else "not in the study"
            axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center")

    rows = [f"{names.material_set(name)} set" for name in sets]
    return panels(findings.socket_titles, rows, window, draw_case, findings.frame, KEY_MM)
