"""A picture of what a study file would solve: sockets on the limb, undeformed, and the cases."""

import textwrap
from collections.abc import Collection
from pathlib import Path

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.path import Path as Outline
from shapely.geometry.polygon import orient

from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import MaterialSet
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.levels import Place, sections
from calfsocket.meshes.lining import fitted
from calfsocket.meshes.socket import AnySocket
from calfsocket.plotting import files
from calfsocket.plotting import section as drawing
from calfsocket.study.cases import Case, Plan

STEP_MM = 0.3  # of the points that curves are drawn by
MOST_SHOWN = 9
MOST_LISTED = 24
OVERLAP = "#d55e00"
CUSTOM_LAW = "#7b3f9d"
PANEL_INCH, LINE_INCH = 4.0, 0.135


def draw(plan: Plan, path: Path) -> None:
    """Draw a plan as the file that a path names: PNG, SVG or PDF."""
    sockets = _different(plan)
    columns = min(len(sockets), 3)
    rows = -(-len(sockets) // columns)
    lines = _lines(plan, len(sockets))
    text = LINE_INCH * (len(lines) + 2)
    size = (max(columns * PANEL_INCH, 8.0), rows * (PANEL_INCH + 0.5) + text + 0.5)
    figure = Figure(figsize=size, dpi=150)
    for number, case in enumerate(sockets):
        row, column = divmod(number, columns)
        left = column / columns
        bottom = 1 - (row + 1) * (PANEL_INCH + 0.5) / size[1]
        axes = figure.add_axes((left, bottom, 1 / columns, PANEL_INCH / size[1]))
        _draw_socket(axes, plan, case)
    tissues = {tissue for limb in sections(plan.limb) for tissue in limb.tissues.values()}
    tissues |= {"liner" for case in sockets if case.document.liner}
    _draw_legend(figure, tissues, text + 0.3)
    figure.text(
        0.02, (text - 0.05) / size[1], "\n".join(lines), va="top", family="monospace", fontsize=8,
        parse_math=False,
    )  # fmt: skip
    files.save(figure, path)


def _different(plan: Plan) -> list[Case]:
    """Return one case for each socket, at each level of the limb."""
    found: dict[tuple[AnySocket, Liner | None, Place | None], Case] = {}
    for case in plan.cases:
        shape = case.socket.model_copy(update={"name": ""}), case.document.liner
        found.setdefault((*shape, case.place), case)
    return list(found.values())[:MOST_SHOWN]


def _draw_socket(axes: Axes, plan: Plan, case: Case) -> None:
    limb = case.limb
    skin, bodies = limb.skin, limb.bodies(STEP_MM)
    socket = case.socket
    fit = fitted(limb, socket, case.document.liner)
    inner, outer = fit.inner, fit.outer
    custom = {name for each in plan.cases for name in each.materials.regions}
    for region in limb.regions:
        outline = _outline(bodies[region.name])
        colour = drawing.TISSUE_COLOURS[region.tissue]
        drawing.draw_path(axes, outline, facecolor=colour, edgecolor=drawing.OUTLINE, linewidth=0.4)
        if region.name in custom:
            drawing.draw_path(
                axes,
                outline,
                fill=False,
                edgecolor=CUSTOM_LAW,
                linewidth=1.4,
                hatch="///",
                zorder=3,
            )
    ring, body = _path(outer, fit.face), _path(fit.surface)
    if fit.lining is not None:
        on_limb = fit.surface is fit.lining
        layer = _path(fit.lining, skin) if on_limb else _path(inner, fit.lining)
        colour, above = drawing.TISSUE_COLOURS["liner"], 3.5 if on_limb else 4.5
        drawing.draw_path(axes, layer, facecolor=colour, linewidth=0, zorder=above)
    drawing.draw_path(axes, ring, facecolor=drawing.SOCKET, alpha=0.9, linewidth=0, zorder=4)
    inside = drawing.draw_path(axes, ring, facecolor=OVERLAP, linewidth=0, zorder=5)
    inside.set_clip_path(body, axes.transData)
    for curve in (skin, inner, outer, *([] if fit.lining is None else [fit.lining])):
        drawing.draw_path(
            axes, _path(curve), fill=False, edgecolor=drawing.OUTLINE, linewidth=0.5, zorder=6
        )
    points = np.vstack([_points(outer), _points(skin)])
    (left, bottom), (right, top) = points.min(axis=0) - 7, points.max(axis=0) + 7
    window = (left, right, bottom, top)
    drawing.frame(axes, window)
    drawing.mark_directions(axes, window, limb.frame, fontsize=7, margin=0.5)
    drawing.scale_bar(axes, window, fontsize=7)
    on, met = case.placement, "liner" if fit.surface is fit.lining else "skin"
    at = f" at level {case.level.name}" if case.level else ""
    axes.set_title(
        f"{case.of[0]}{at}: wall {socket.thickness(limb):g} mm, "
        f"{100 * on.area_reduction:.2f} % less area\n"
        f"presses up to {on.largest_overlap:.2f} mm at {on.largest_angle:.0f} deg, "
        f"on {100 * on.touching:.0f} % of the {met}",
        fontsize=8,
        parse_math=False,
    )


def custom_laws(case: Case) -> list[str]:
    """Return the tissues and regions whose law is not that of the set it starts from."""
    materials, model = case.materials, case.document.model
    paper = MaterialSet.paper(materials.base, model.fascia_c10, model.ogden_form)
    changed = [name for name, law in materials.laws.items() if law != paper.laws[name]]
    return sorted([*changed, *materials.regions])


def _points(curve: ClosedCurve) -> np.ndarray:
    return curve.evaluate(curve.sample(STEP_MM))


def _outline(body: shapely.Polygon | shapely.MultiPolygon) -> Outline:
    """Return the path of an area; holes turn the other way."""
    turned = [orient(part) for part in getattr(body, "geoms", [body])]
    rings = [ring for part in turned for ring in (part.exterior, *part.interiors)]
    return Outline.make_compound_path(
        *(Outline(np.asarray(ring.coords), closed=True) for ring in rings)
    )


def _path(outer: ClosedCurve, *holes: ClosedCurve) -> Outline:
    """Return the path of a region; holes turn the other way."""
    loops = [_points(outer), *(_points(hole)[::-1] for hole in holes)]
    closed = [Outline(np.vstack([loop, loop[:1]]), closed=True) for loop in loops]
    return Outline.make_compound_path(*closed)


def _draw_legend(figure: Figure, tissues: Collection[str], bottom_inch: float) -> None:
    colours = drawing.TISSUE_COLOURS.items()
    handles = [Patch(color=colour, label=name) for name, colour in colours if name in tissues]
    handles += [
        Patch(color=drawing.SOCKET, label="socket"),
        Patch(color=OVERLAP, label="overlap"),
        Patch(facecolor="white", edgecolor=CUSTOM_LAW, hatch="///", label="custom law"),
    ]
    figure.legend(
        handles=handles, ncols=len(handles), loc="center", fontsize=7.5, frameon=False,
        bbox_to_anchor=(0.5, (bottom_inch - 0.1) / figure.get_figheight()), columnspacing=1.0,
        handlelength=1.2,
    )  # fmt: skip


def _lines(plan: Plan, drawn: int) -> list[str]:
    """Describe in words what would be solved."""
    model, steps = plan.document.model, plan.document.steps
    lines = [
        f"{len(plan.cases)} cases; mesh {model.size}, friction {model.friction:g}, socket "
        f"{model.socket_support}, steps of {steps.first:g} to {steps.largest:g}"
    ]
    lines += [
        f"threshold: {each.quantity} in {each.tissue} above {each.value:g} {each.unit}"
        for each in plan.thresholds
    ]
    own = [case for case in plan.cases if case.row is None]
    for case in own[:MOST_LISTED]:
        custom = custom_laws(case)
        words = f"  custom laws: {', '.join(custom)}" if custom else ""
        lines += textwrap.wrap(f"{case.name}{words}", 110, subsequent_indent="    ")
    if len(own) > MOST_LISTED:
        lines.append(f"and {len(own) - MOST_LISTED} more")
    if len(own) < len(plan.cases):
        lines.append(f"and {len(plan.cases) - len(own)} of a design in uncertain inputs")
    if drawn == MOST_SHOWN:
        lines.append(f"The first {MOST_SHOWN} geometries are drawn.")
    return lines
