"""The limb itself: mesh, energy, load steps, Newton's method, and the choices that are open."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.materials.material_set import BASE_SETS, BaseSet
from calfsocket.meshes.sizing import SIZES as MESH_SIZES
from calfsocket.meshes.sizing import named_size
from calfsocket.meshes.socket import reference_sockets
from calfsocket.simulation.results import Results
from calfsocket.verification import limb_convergence as convergence
from calfsocket.verification.energy import energy_error
from calfsocket.verification.limb_path import (
    STARTS,
    LimbPath,
    energy_figure,
    energy_table,
    follow,
    newton_figure,
    newton_table,
    path_table,
)
from calfsocket.verification.limb_runs import (
    all_checks,
    largest_distance,
    mean_pressure,
    solved_study,
)
from calfsocket.verification.report import Check, Section, check_each

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
    **{name: (name, "effective_stress") for name in ("skin", "fat", "muscle", "fascia", "vessel")},
}
"""Columns: contact pressures and the largest effective stress of each tissue, kPa."""

PRESSURES = {
    "mean contact pressure": ("skin", "contact_pressure_mean"),
    "largest contact pressure": ("skin", "contact_pressure_max"),
    "largest vessel pressure": ("vessel", "pressure"),
}
"""Numbers that must settle with the mesh."""

SAME_END_PCT = 0.1
"""Difference of mean contact pressure up to which two paths end on the same branch, %."""


def report(sizes: Sequence[str] = SIZES, results: Path = RESULTS) -> Section:
    """Measure the limb on two mesh sizes at least; paths and variants are solved on the coarsest.

    The folder `results` has, or gets, a folder of results a size and variant.
    """
    sizes = coarsest_first(sizes)
    coarsest, finest = sizes[0], sizes[-1]
    studies = {size: solved_study(results / size, size) for size in sizes}
    variants = {"study": studies[coarsest]} | {
        name: solved_study(results / f"{coarsest}-{name}", coarsest, sets, **changed)
        for name, (changed, sets) in VARIANTS.items()
    }
    elements = {
        size: pd.Series([checks.cells for checks in all_checks(study)]).mean()
        for size, study in studies.items()
    }
    table = convergence.long_table({s: study.summary for s, study in studies.items()}, elements)
    fields = {result.record.name: result.fields for result in studies[finest].values()}
    paths, failed = limb_paths(coarsest)
    study_paths = [path for path in paths if path.as_the_study]
    references = {path.name: path for path in study_paths if path.largest == STEPS[0]}
    return Section(
        [
            *_run_checks(studies),
            *_mesh_checks(table, finest),
            *_path_checks(study_paths, references),
        ],
        {
            "limb_convergence": convergence.figure(table, sizes, elements),
            "limb_energy": energy_figure(paths),
            "limb_newton": newton_figure(paths),
        },
        {
            "mesh": convergence.digest(table, sizes),
            "unconverged": convergence.unconverged(table, sizes, fields),
            "quantiles": _fascia_quantiles(studies),
            "paths": path_table(paths, references),
            "energy": energy_table(study_paths),
            "newton": newton_table(list(references.values())),
            "variants": comparison(variants),
        },
        {"limb_convergence.csv": table},
        {
            "sizes": sizes,
            "step": STEPS[0],
            "elements": elements,
            "verdicts": table["verdict"].value_counts(),
            "same_end_pct": SAME_END_PCT,
            "branches": list(_other_branches(paths, references)),
            "failed": failed,
        },
    )


def limb_paths(size: str) -> tuple[list[LimbPath], list[str]]:
    """Follow the six runs with each of `STEPS`, and Separate with extrapolation, too.

    Return the paths that reach the full load, and what became of the others.
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


def _pressure_change(path: LimbPath, references: Mapping[str, LimbPath]) -> float:
    """Change of the mean contact pressure from the study's path, %."""
    reference = mean_pressure(references[path.name].end)
    return 100.0 * (mean_pressure(path.end) / reference - 1.0)


def _other_branches(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> Iterator[str]:
    """Describe which paths end elsewhere than the study's."""
    for path in paths:
        change = _pressure_change(path, references)
        if abs(change) > SAME_END_PCT:
            start = STARTS[path.extrapolated]
            distance = largest_distance(path.end, references[path.name].end)
            yield (
                f"{path.name} with steps of {path.largest:g} and {start} ends with {change:+.2f} % "
                f"of mean contact pressure and points up to {distance:.2f} mm away"
            )


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
    last = table[f"change_{finest}_pct"].abs().groupby([table["tissue"], table["quantity"]]).max()
    changes = {f"{name}: last change, worst run": last[of] for name, of in PRESSURES.items()}
    return check_each(changes, 1.0, "the mesh before", "%")


def _path_checks(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> list[Check]:
    asked = len(STEPS) * len(reference_sockets()) * len(BASE_SETS)
    name = "the study's paths that reach the full load"
    checks = [Check(name, len(paths), asked, "count", rule="exactly")]
    for path in paths:
        name, energy = f"{path.name}, steps of {path.largest:g}", 100.0 * energy_error(path.energy)
        checks.append(Check(f"{name}: work less energy and friction", energy, 1.0, "balance", "%"))
        if path.largest == STEPS[0]:
            name = f"{name}: Newton's order at the end"
            checks.append(Check(name, path.newton_order, 1.9, "2", rule="at least"))
        else:
            name, source = f"{name}: mean contact pressure", f"steps of {STEPS[0]:g}"
            change = _pressure_change(path, references)
            checks.append(Check(name, change, SAME_END_PCT, source, "%"))
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
    cases = dict.fromkeys(key for study in studies.values() for key in study)
    return pd.DataFrame(
        {
            "case": "_".join(key),
            "variant": name,
            **{column: study.value(*key, *of) for column, of in SHOWN.items()},
        }
        for key in cases
        for name, study in studies.items()
        if key in study
    )
