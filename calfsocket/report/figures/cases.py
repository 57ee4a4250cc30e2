"""A panel for every case: material sets by sockets."""

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.plotting import section as drawing
from calfsocket.plotting.style import panels
from calfsocket.report import names
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results

KEY_MM = 21.0


def case_panels(
    results: Results, window: drawing.Window, draw: Callable[[Axes, Result], None]
) -> Figure:
    """Draw every case in a panel of its own, all to one scale, with room for a key below."""
    sets = results.material_sets

    def draw_case(axes: Axes, socket: str, row: int) -> None:
        if (socket, sets[row]) in results:
            draw(axes, results[socket, sets[row]])
        else:
            axes.text(0.5, 0.5, "not solved", transform=axes.transAxes, ha="center")

    rows = [f"{names.material_set(name)} set" for name in sets]
    return panels(results.sockets, rows, window, draw_case, KEY_MM)
