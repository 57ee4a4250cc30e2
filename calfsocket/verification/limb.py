r"""The limb itself: mesh, energy, load steps, Newton's method, and the choices that are open.

No exact solution is known here. What can be shown is that the six runs hang together: that their
numbers settle with the mesh, that no energy is lost on the way, that the end does not depend on how
it was reached, and how much the choices matter that the paper leaves open.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError, SolveError
from calfsocket.meshes.sizing import SIZES as MESH_SIZES
from calfsocket.meshes.sizing import named_size
from calfsocket.meshes.socket import reference_sockets
from calfsocket.postprocess.vtu import read_fields
from calfsocket.simulation.case import Settings
from calfsocket.study.study import all_cases
from calfsocket.verification import limb_convergence as convergence
from calfsocket.verification.limb_path import (
    LimbPath,
    energy_figure,
    energy_table,
    follow,
    newton_figure,
    newton_table,
    path_table,
)
from calfsocket.verification.limb_runs import cells, run_entries, solved_study, summary
from calfsocket.verification.limb_variants import comparison, variant_folders
from calfsocket.verification.report import Check, Section, Table

SIZES = ("coarse", "medium")
RESULTS = Path("results") / "verification"

STEPS = (0.25, 0.1)
"""Largest load steps of the runs that are followed; the first is the study's."""

SAME_END = 1e-3
"""Relative difference of mean contact pressure up to which two paths end on the same branch."""

FASCIA = """\
What keeps the Separate set's fascia from converging is not its field so much as the maximum: the
root mean square of its stress settles, and quantiles by area change far less (table below). Fascia
bends, so that its stress runs from one face to the other, and the paper's maximum takes means over
each of two elements: one element across the fascia holds the mean of both faces, two across hold
one face each, and finer meshes show more of the bending. The maximum of a layer that bends belongs
to its mesh; compare it between runs on one mesh, or take a quantile."""

ENERGY = """\
**Energy.** The work of the shrink fit, the integral of contact pressure over the overclosure that
is released, must be found as energy stored in limb and socket and as friction (`energy` derives
the balance). What is left falls with the square of the load step, as it does for trapezoids."""

NEWTON = """\
**Newton's method.** Of the last two iterations of each step (figure) the smooth ones, whole steps
in which no contact point changes its status or its edge of the socket and which end above rounding,
have |F| after = C |F|^2 before. C is largest in HS Combined. There, looked at closely at a load of
0.2, the tangent is exact and no point changes, but the fibula, stiff in soft muscle, turns: its
strain of second order is most of |F| (in its pressures), and since a whole step would increase |F|,
the line search cuts steps that a second whole one would make good; the first whole one is followed
by one to rounding. The table has the loads at which contact still changes in the last two
iterations, so that there these are not quadratic. The order at each end state, measured from points
closer and closer to it, is 2."""


def report(sizes: Sequence[str] = SIZES, results: Path = RESULTS) -> Section:
    """Measure the limb.

    Parameters
    ----------
    sizes : sequence of str
        Mesh sizes, two at least. Paths and variants are solved on the coarsest.
    results : Path
        Folder that has, or gets, a folder of results a size and variant.
    """
    sizes = coarsest_first(sizes)
    folders = {size: solved_study(results / size, Settings(size=size)) for size in sizes}
    variants = {"study": folders[sizes[0]]} | variant_folders(results, sizes[0])
    elements = {size: cells(folder) for size, folder in folders.items()}
    table = convergence.long_table({s: summary(folders[s]) for s in sizes}, elements)
    paths, failed = limb_paths(sizes[0])
    references = {path.case.name: path for path in paths if path.as_the_study(STEPS[0])}
    fields = {
        path.name: read_fields(path) for path in (folders[sizes[-1]] / name for name in references)
    }
    text = [
        __doc__ or "",
        "**Mesh.** " + (convergence.__doc__ or "").partition("\n")[2].strip(),
        _verdicts(table, elements),
        FASCIA,
        ENERGY,
        _branches(paths, failed, references),
        NEWTON,
    ]
    return Section(
        "The limb",
        "\n\n".join(part.strip() for part in text),
        [
            *_run_checks(folders),
            *_mesh_checks(table, sizes[-1]),
            *_path_checks(paths, references),
        ],
        [
            convergence.figure(table, sizes, elements),
            energy_figure(paths),
            newton_figure(paths),
        ],
        [
            Table(
                f"Largest change from {sizes[-2]} to {sizes[-1]} and uncertainty of {sizes[-1]} "
                "over the sockets, %.",
                convergence.digest(table, sizes),
                2,
            ),
            Table(
                "Numbers that do not converge.", convergence.unconverged(table, sizes, fields), 3
            ),
            Table(
                "Effective stress of fascia at Gauss points, Separate set, kPa: root mean square "
                "and quantiles by area.",
                _fascia_quantiles(folders),
            ),
            Table(
                f"Ends of paths, {sizes[0]} mesh, beside the study's (steps of {STEPS[0]:g}).",
                path_table(paths, references),
            ),
            Table(
                f"Work of the shrink fit and where it went, {sizes[0]} mesh.",
                energy_table([path for path in paths if path.as_the_study(path.largest)]),
                3,
            ),
            Table(
                f"The last two iterations of each step of the study's paths, {sizes[0]} mesh.",
                newton_table(list(references.values())),
                2,
            ),
            Table(
                f"Open choices, {sizes[0]} mesh: contact pressure and largest effective stress of "
                "each tissue, kPa. As printed is Ogden's form with mu/alpha, tables is fascia's "
                "C10 of 0.491 MPa.",
                comparison(variants),
            ),
        ],
        {"limb_convergence.csv": table},
    )


def limb_paths(size: str) -> tuple[list[LimbPath], list[str]]:
    """Follow the six runs with each of `STEPS`, and Separate with the secant predictor, too.

    Returns
    -------
    paths, failures
        Paths that reach the full load, and what became of the others.
    """
    settings = Settings(size=size)
    paths, failures = [], []
    for case in all_cases(reference_sockets()):
        ways: list[tuple[float, bool | None]] = [(largest, None) for largest in STEPS]
        if case.material_set == "separate":
            ways.append((STEPS[0], True))
        for largest, extrapolate in ways:
            try:
                paths.append(follow(case, settings, largest, extrapolate))
            except SolveError as error:
                predictor = ", secant predictor" if extrapolate else ""
                failures.append(f"steps of {largest:g}{predictor}: {error}")
    return paths, failures


def coarsest_first(sizes: Sequence[str]) -> list[str]:
    """Sort mesh sizes.

    Raises
    ------
    InputError
        For a size that there is not, or fewer than two.
    """
    for size in sizes:
        named_size(size)
    if len(set(sizes)) < 2:
        raise InputError(f"--size: {', '.join(sizes)}; name two mesh sizes at least")
    return [size for size in MESH_SIZES if size in sizes]


def _verdicts(table: pd.DataFrame, elements: Mapping[str, float]) -> str:
    counts = table["verdict"].value_counts()
    meshes = ", ".join(f"{size} ({n:.0f} elements)" for size, n in elements.items())
    found = ", ".join(f"{count} are {name}" for name, count in counts.items())
    return f"Meshes: {meshes}. Of {len(table)} numbers {found}."


def _branches(
    paths: Sequence[LimbPath], failed: Sequence[str], references: Mapping[str, LimbPath]
) -> str:
    """Say which paths end elsewhere than the study's, or fail."""
    other = []
    for path in paths:
        reference = references[path.case.name]
        mean = path.mean_pressure / reference.mean_pressure - 1.0
        if abs(mean) > SAME_END:
            moved = np.linalg.norm(path.displacement - reference.displacement, axis=1).max()
            predictor = "the secant predictor" if path.extrapolate else "no predictor"
            other.append(
                f"{path.case.name} with steps of {path.largest:g} and {predictor} ends with "
                f"{100 * mean:+.2f} % of mean contact pressure and points up to {moved:.2f} mm away"
            )
    text = (
        "**Load steps.** Each run is followed with two step sizes, and the Separate set with the "
        f"predictor that the study does not use there. Ends within {100 * SAME_END:g} % of mean "
        "contact pressure count as the same branch. "
    )
    text += f"Ends on another branch: {'; '.join(other) or 'none'}."
    if failed:
        text += f" Paths that do not reach the full load: {'; '.join(failed)}."
    return text


def _run_checks(folders: Mapping[str, Path]) -> list[Check]:
    checks = []
    for size, folder in folders.items():
        entries = run_entries(folder).values()
        solved = sum(entry["status"] == "solved" for entry in entries)
        modes = sum(entry["checks"]["negative_modes"] for entry in entries)
        force = max(entry["checks"]["relative_force_imbalance"] for entry in entries)
        checks += [
            Check(f"{size}: runs at full load", solved, len(entries), "count", rule="exactly"),
            Check(f"{size}: negative modes of all runs", modes, 0, "stability", rule="exactly"),
            Check(f"{size}: force imbalance, worst run", force, 1e-6, "equilibrium"),
        ]
    return checks


def _mesh_checks(table: pd.DataFrame, finest: str) -> list[Check]:
    pressures = {
        ("skin", "contact_pressure_mean"): "mean contact pressure",
        ("skin", "contact_pressure_max"): "largest contact pressure",
        ("vessel", "pressure"): "largest vessel pressure",
    }
    return [
        Check(
            f"{name}: last change, worst run",
            float(
                table.loc[
                    (table["tissue"] == tissue) & (table["quantity"] == quantity),
                    f"change_{finest}_pct",
                ]
                .abs()
                .max()
            ),
            1.0,
            "the mesh before",
            "%",
        )
        for (tissue, quantity), name in pressures.items()
    ]


def _path_checks(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> list[Check]:
    reached = sum(path.as_the_study(path.largest) for path in paths)
    asked = len(STEPS) * len(all_cases(reference_sockets()))
    checks = [
        Check("the study's paths that reach the full load", reached, asked, "count", rule="exactly")
    ]
    for path in paths:
        name = f"{path.case.name}, steps of {path.largest:g}"
        if not path.as_the_study(path.largest):
            continue
        energy = 100.0 * path.energy.error
        checks.append(Check(f"{name}: work less energy and friction", energy, 1.0, "balance", "%"))
        if path.largest == STEPS[0]:
            order = path.probe.order
            checks.append(
                Check(f"{name}: Newton's order at the end", order, 1.9, "2", rule="at least")
            )
        else:
            mean = 100.0 * (path.mean_pressure / references[path.case.name].mean_pressure - 1.0)
            source = f"steps of {STEPS[0]:g}"
            checks.append(
                Check(f"{name}: mean contact pressure", mean, 100.0 * SAME_END, source, "%")
            )
    return checks


def _fascia_quantiles(folders: Mapping[str, Path]) -> pd.DataFrame:
    rows = []
    for socket in reference_sockets():
        for size, folder in folders.items():
            fields = read_fields(folder / f"{socket}_separate")
            stress = convergence.stress_quantiles(fields, "fascia")
            rows.append({"socket": socket, "mesh": size, **stress})
    return pd.DataFrame(rows)
