"""Figures of uncertain inputs: contact pressure around the limb with its band, shares of inputs."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from calfsocket.meshes.frame import Frame
from calfsocket.plotting.style import MOST_SHOWN, new_figure
from calfsocket.report import names
from calfsocket.report.uncertain import DOUBT, NO_SHARE, Uncertainty, key_of
from calfsocket.simulation.record import KEY
from calfsocket.simulation.result import STATE

PANEL_MM, KEY_MM, ROW_MM, FOOT_MM = 58.0, 6.0, 5.0, 24.0
BAND, LINE, OWN = "#f4d6ae", "#96540c", "#333333"
LEFT_MM, RIGHT_MM = 52.0, 176.0

Name = tuple[str, str, str, str, str]
"""Socket, material set, state, tissue and quantity."""


def figures(uncertain: Uncertainty) -> dict[str, Callable[[], Figure]]:
    """Return the figures by name, not yet drawn."""
    made: dict[str, Callable[[], Figure]] = {}
    found = uncertain.found
    if len(found.pressure):
        frame = next(iter(uncertain.results.records.values())).frame
        shown = found.pressure[found.pressure[STATE].isin(uncertain.states)]
        made["pressure_band"] = partial(pressure_band, shown, frame)
    if len(found.shares):
        labels = {
            (*key_of(row), row.state, row.tissue, row.quantity): uncertain.label(row)
            + ("" if row.trusted else f" {DOUBT}")
            for row in uncertain.headlines.itertuples()
        }
        explained = dict(
            zip(labels, uncertain.headlines.q2.fillna(0.0).clip(lower=0.0), strict=True)
        )
        value = (found.shares["first"] + found.shares["total"]) / 2
        table = found.shares.assign(share=value)
        made["shares"] = partial(shares, table, labels, uncertain.titles, explained)
    return made


def pressure_band(table: pd.DataFrame, frame: Frame) -> Figure:
    """Draw contact pressure over the angle, a panel for each case in each state."""
    groups = [*table.groupby([*KEY, STATE], sort=False)][:MOST_SHOWN]
    several = table[STATE].nunique() > 1
    rows = -(-len(groups) // 2) if len(groups) > 1 else 1
    height = PANEL_MM * rows + KEY_MM
    figure = new_figure(height)
    every = figure.subplots(rows, min(len(groups), 2), squeeze=False, sharex=True, sharey=True)
    for axes, ((socket, name, state), part) in zip(every.ravel(), groups, strict=False):
        whole = pd.concat([part, part[:1].assign(angle_deg=360.0)])
        angle = whole.angle_deg
        axes.fill_between(
            angle, whole.low_kPa, whole.high_kPa, color=BAND, linewidth=0, label="95 % of cases"
        )
        axes.plot(angle, whole.median_kPa, color=LINE, linewidth=1.1, label="median")
        if whole.nominal_kPa.notna().all():
            axes.plot(angle, whole.nominal_kPa, color=OWN, linewidth=0.8, dashes=(4, 3),
                      label="file's values")  # fmt: skip
        at = f", {state}" if several else ""
        axes.set_title(f"{socket} {names.material_set(name)}{at}")
        axes.set(xlim=(0, 360), ylabel="contact pressure, kPa")
        words = [*frame.words, frame.words[0]]
        axes.set_xticks(np.arange(0, 361, 90), words)
        axes.grid(linewidth=0.3, color="0.85")
        axes.label_outer()
    every[0, 0].set_ylim(bottom=0)  # of all panels, and so only when all are drawn
    for axes in every.ravel()[len(groups) :]:
        axes.remove()
    handles, labels = every[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, loc="lower center", ncols=3)
    figure.tight_layout(rect=(0, KEY_MM / height, 1, 1))
    return figure


def shares(
    table: pd.DataFrame,
    labels: Mapping[Name, str],
    titles: Mapping[str, str],
    explained: Mapping[Name, float],
) -> Figure:
    """Draw the column `share` of inputs as bars, each bar as long as what all of them explain.

    Inputs whose share is below `NO_SHARE` everywhere are left out.
    """
    wide = table.pivot_table(
        index=[*KEY, STATE, "tissue", "quantity"], columns="input", values="share", sort=False
    )
    wide = wide.loc[[name for name in labels if name in wide.index]]
    wide = wide[[name for name in titles if name in wide and wide[name].max() > NO_SHARE]]
    length = np.array([100 * explained[name] for name in wide.index])
    height = ROW_MM * len(wide) + FOOT_MM
    figure = new_figure(height)
    axes = figure.add_axes(
        (LEFT_MM / 180, (FOOT_MM - 4) / height, (RIGHT_MM - LEFT_MM) / 180,
         ROW_MM * len(wide) / height)
    )  # fmt: skip
    places = np.arange(len(wide))
    left = np.zeros(len(wide))
    colours = _colours(len(wide.columns))
    for colour, name in zip(colours, wide.columns, strict=True):
        width = length * wide[name].fillna(0.0).to_numpy()
        axes.barh(places, width, left=left, height=0.72, color=colour, label=_plain(titles[name]))
        left += width
    axes.set_yticks(places, [labels[name] for name in wide.index])
    axes.set(ylim=(len(wide) - 0.4, -0.6), xlim=(0, max(100.0, left.max())))
    axes.set_xlabel("share of the variance, %")
    axes.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    figure.legend(frameon=False, loc="lower left", ncols=5, bbox_to_anchor=(0.01, 0.0))
    return figure


def _plain(text: str) -> str:
    """Return a text in which matplotlib finds no formula."""
    return text.replace("$", r"\$")


def _colours(n: int) -> list[object]:
    """Return colours that neighbours can be told apart by."""
    from matplotlib import colormaps

    return [colormaps["tab20"]((2 * i) % 20 + (2 * i) // 20) for i in range(n)]
