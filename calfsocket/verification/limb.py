r"""The limb itself: mesh, energy, load steps, Newton's method, and the choices that are open.

No exact solution is known here. What can be shown is that the six runs are consistent: their
numbers settle with the mesh, no energy is lost, the end does not depend on the path of the load
steps, and how much the choices matter that the paper leaves open.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.materials.material_set import BASE_SETS, BaseSet
from calfsocket.meshes.sizing import SIZES as MESH_SIZES
from calfsocket.meshes.sizing import named_size
from calfsocket.meshes.socket import reference_sockets
from calfsocket.simulation.results import Results
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
from calfsocket.verification.limb_runs import all_checks, cells, solved_study
from calfsocket.verification.report import Check, Section, Table

SIZES = ("coarse", "medium")
RESULTS = Path("results") / "verification"

STEPS = (0.25, 0.1)
"""Largest load steps of the runs that are followed; the first is the study's."""

VARIANTS: dict[str, tuple[dict[str, str], tuple[BaseSet, ...]]] = {
    "as-printed": ({"ogden_form": "as-printed"}, BASE_SETS),
    "tables": ({"fascia_c10": "tables"}, ("separate",)),
}
"""Choices that differ from the study's, and the material sets that they change."""

SHOWN = {
    "mean pressure": ("skin", "contact_pressure_mean"),
    "largest pressure": ("skin", "contact_pressure_max"),
    "skin": ("skin", "effective_stress"),
    "fat": ("fat", "effective_stress"),
    "muscle": ("muscle", "effective_stress"),
    "fascia": ("fascia", "effective_stress"),
    "vessel": ("vessel", "effective_stress"),
}
"""Columns: contact pressures and the largest effective stress of each tissue, kPa."""

SAME_END = 1e-3
"""Relative difference of mean contact pressure up to which two paths end on the same branch."""

FASCIA = """\
The fascia of the Separate set does not converge because of how a maximum is defined rather than
because of its field: the root mean square of its stress settles, and quantiles by area change far
less (table below). Fascia bends, so its stress varies from one face to the other, and the paper's
maximum uses the means of two elements: with one element across the fascia the mean of both faces,
with two across one face each; finer meshes show more of the bending. The maximum in a layer that
bends therefore depends on the mesh: compare it on one mesh, or use a quantile."""

ENERGY = """\
**Energy.** The work of the shrink fit, the integral of contact pressure over the overclosure that
is removed, must equal the energy stored in limb and socket plus the work of friction (`energy`
derives the balance). The difference falls with the square of the load step, as the trapezoidal
rule's error does."""

NEWTON = """\
**Newton's method.** Of the last two iterations of each step (figure), those that are full steps, in
which no contact point changes its status or its edge of the socket, and which end above rounding,
satisfy |F| after = C |F|^2 before. C is largest in HS Combined. At a load of 0.2 there, the tangent
is exact and no point changes, but the fibula, stiff in soft muscle, rotates: its second-order
strain makes up most of |F| (in its pressures). A full step would increase |F|, so a line search
shortens steps that a second full step would correct; the first full step is followed by one that
reaches rounding. The table has the loads at which contact still changes in the last two iterations,
so that these are not quadratic. The order at each end state, measured from points closer and closer
to it, is 2."""


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
    coarsest = sizes[0]
    studies = {size: solved_study(results / size, size) for size in sizes}
    variants = {"study": studies[coarsest]} | {
        name: solved_study(results / f"{coarsest}-{name}", coarsest, sets, **changed)
        for name, (changed, sets) in VARIANTS.items()
    }
    elements = {size: cells(study) for size, study in studies.items()}
    table = convergence.long_table({s: study.summary for s, study in studies.items()}, elements)
    paths, failed = limb_paths(coarsest)
    study_paths = [path for path in paths if path.as_the_study]
    references = {path.name: path for path in study_paths if path.largest == STEPS[0]}
    finest = studies[sizes[-1]]
    fields = {record.name: finest[key].fields for key, record in finest.records.items()}
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
            *_run_checks(studies),
            *_mesh_checks(table, sizes[-1]),
            *_path_checks(study_paths, references),
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
                _fascia_quantiles(studies),
            ),
            Table(
                f"Ends of paths, {sizes[0]} mesh, beside the study's (steps of {STEPS[0]:g}).",
                path_table(paths, references),
            ),
            Table(
                f"Work of the shrink fit and where it went, {sizes[0]} mesh.",
                energy_table(study_paths),
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
    """Follow the six runs with each of `STEPS`, and Separate with extrapolation, too.

    Returns
    -------
    paths, failures
        Paths that reach the full load, and what became of the others.
    """
    paths, failures = [], []
    for socket in reference_sockets():
        for name in BASE_SETS:
            ways = [(largest, True) for largest in STEPS]
            if name == "separate":
                ways.append((STEPS[0], False))
            for largest, as_the_study in ways:
                try:
                    paths.append(follow(socket, name, size, largest, as_the_study))
                except ConvergenceError as error:
                    start = "" if as_the_study else ", extrapolated"
                    case = f"{socket}_{name}: steps of {largest:g}{start}"
                    failures.append(f"{case}: {error}")
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
        raise InputError(f"--size: {', '.join(sizes)}; give at least two mesh sizes")
    return [size for size in MESH_SIZES if size in sizes]


def _verdicts(table: pd.DataFrame, elements: Mapping[str, float]) -> str:
    counts = table["verdict"].value_counts()
    meshes = ", ".join(f"{size} ({n:.0f} elements)" for size, n in elements.items())
    found = ", ".join(f"{count} are {name}" for name, count in counts.items())
    return f"Meshes: {meshes}. Of {len(table)} numbers {found}."


def _branches(
    paths: Sequence[LimbPath], failed: Sequence[str], references: Mapping[str, LimbPath]
) -> str:
    """Describe which paths end elsewhere than the study's, or fail."""
    other = []
    for path in paths:
        reference = references[path.name].end
        mean = path.end.mean_pressure / reference.mean_pressure - 1.0
        if abs(mean) > SAME_END:
            start = "extrapolation" if path.extrapolated else "no extrapolation"
            other.append(
                f"{path.name} with steps of {path.largest:g} and {start} ends with "
                f"{100 * mean:+.2f} % of mean contact pressure and points up to "
                f"{path.end.moved_from(reference):.2f} mm away"
            )
    text = (
        "**Load steps.** Each run is repeated with two step sizes, and the Separate set also with "
        "the extrapolation that studies do not use there. Ends within "
        f"{100 * SAME_END:g} % of mean "
        "contact pressure count as the same branch. "
    )
    text += f"Ends on another branch: {'; '.join(other) or 'none'}."
    if failed:
        text += f" Paths that do not reach the full load: {'; '.join(failed)}."
    return text


def _run_checks(studies: Mapping[str, Results]) -> list[Check]:
    checks = []
    for size, study in studies.items():
        found, asked = all_checks(study), len(study) + len(study.left_out)
        modes = sum(each.negative_modes for each in found)
        force = max(each.relative_force_imbalance for each in found)
        checks += [
            Check(f"{size}: runs at full load", len(found), asked, "count", rule="exactly"),
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
    found = []
    for (tissue, quantity), name in pressures.items():
        rows = table[(table["tissue"] == tissue) & (table["quantity"] == quantity)]
        change = float(rows[f"change_{finest}_pct"].abs().max())
        found.append(Check(f"{name}: last change, worst run", change, 1.0, "the mesh before", "%"))
    return found


def _path_checks(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> list[Check]:
    asked = len(STEPS) * len(reference_sockets()) * len(BASE_SETS)
    name = "the study's paths that reach the full load"
    checks = [Check(name, len(paths), asked, "count", rule="exactly")]
    for path in paths:
        name = f"{path.name}, steps of {path.largest:g}"
        energy = 100.0 * path.energy.error
        checks.append(Check(f"{name}: work less energy and friction", energy, 1.0, "balance", "%"))
        if path.largest == STEPS[0]:
            order = f"{name}: Newton's order at the end"
            checks.append(Check(order, path.probe.order, 1.9, "2", rule="at least"))
        else:
            reference = references[path.name].end.mean_pressure
            mean = 100.0 * (path.end.mean_pressure / reference - 1.0)
            source = f"steps of {STEPS[0]:g}"
            checks.append(
                Check(f"{name}: mean contact pressure", mean, 100.0 * SAME_END, source, "%")
            )
    return checks


def _fascia_quantiles(studies: Mapping[str, Results]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "socket": socket,
            "mesh": size,
            **convergence.stress_quantiles(study[socket, "separate"].fields, "fascia"),
        }
        for socket in reference_sockets()
        for size, study in studies.items()
    )


def comparison(studies: Mapping[str, Results]) -> pd.DataFrame:
    """Means and maxima of each case by variant, in kPa, case by case."""
    rows = [
        {
            "case": "_".join(key),
            "variant": name,
            **{column: study.value(*key, *of) for column, of in SHOWN.items()},
        }
        for name, study in studies.items()
        for key in study
    ]
    table = pd.DataFrame(rows)
    cases = list(dict.fromkeys(table["case"]))
    return table.sort_values("case", key=lambda c: c.map(cases.index), kind="stable")
