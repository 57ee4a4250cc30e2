"""Hand-made results in a folder, as a study writes them, for the tests of the report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.io.files import write_json
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.mechanics.stepping import LoadSteps
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import reference_sockets
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.thresholds import Threshold, shares_beyond
from calfsocket.simulation.record import CaseRecord, Checks, SecondMesh, StudyRecord, StudySource
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results, of_case
from calfsocket.study.document import ModelTable
from sections import grid, limb_and_socket, section

Key = tuple[str, str]
ALL: tuple[Key, ...] = tuple((s, m) for s in ("TC", "TSB", "HS") for m in ("separate", "combined"))


def plate() -> SectionFields:
    """Squares of 1 mm: muscle below y = 3, skin from there to y = 6; 12 mm wide."""
    points, cells = grid(12, 6)
    region = np.where(points[cells].mean(axis=1)[:, 1] < 3, 1, 2)
    return section(points, cells, region, {1: ("soleus", "muscle"), 2: ("skin", "skin")})


def with_shear(fields: SectionFields, *patches: tuple[float, float, float]) -> SectionFields:
    """Set shear stress to 1 kPa, and to given values around places: (x, y, value), 1.5 mm wide."""
    stress = np.zeros_like(fields.stress)
    stress[..., 3] = 1.0
    middle = fields.points[fields.cells].mean(axis=1)
    for x, y, value in patches:
        stress[np.abs(middle - (x, y)).max(axis=1) < 1.5, :, 3] = value
    return replace(fields, stress=stress)


def contact_on_plate(pressure: Callable[[np.ndarray], np.ndarray]) -> ContactLine:
    """Contact on the plate's skin: up its right side, back along the top, down its left side."""
    s, weight = np.polynomial.legendre.leggauss(4)
    arc = (np.arange(18)[:, None] + (1 + s) / 2).ravel()
    return ContactLine(
        arc_mm=arc,
        angle_deg=np.zeros(len(arc)),
        x_mm=np.interp(arc, [0, 3, 15, 18], [12, 12, 0, 0]),
        y_mm=np.interp(arc, [0, 3, 15, 18], [3, 6, 6, 3]),
        pressure_kPa=pressure(arc),
        shear_kPa=np.zeros(len(arc)),
        gap_mm=np.zeros(len(arc)),
        weight_mm=np.tile(weight / 2, 18),
        status=np.where(pressure(arc) > 0, "stick", "open"),
    )


def limb(stress_factor: float = 1.0, shear: float = 0.0) -> SectionFields:
    """The round limb of `sections` with a fibula; simple shear on top of its squeeze."""
    fields = limb_and_socket(36)
    region = fields.region.copy()
    middle = fields.points[fields.cells].mean(axis=1)
    region[(region == 2) & (np.hypot(middle[:, 0] + 25, middle[:, 1]) < 6)] = 8
    region[(region == 2) & (np.hypot(*middle.T) < 14)] = 3  # a sheath on the tibia
    turn = np.array([[1.0, shear], [0.0, 1.0]])
    return replace(
        fields,
        region=region,
        region_names=fields.region_names | {8: "fibula"},
        region_tissues=fields.region_tissues | {8: "bone"},
        stress=stress_factor * fields.stress,
        deformation_gradient=turn @ fields.deformation_gradient,
        displacement=np.where(
            np.linalg.norm(fields.points, axis=1, keepdims=True) > 5.01, fields.displacement, 0
        ),
    )


def contact_on(fields: SectionFields, pressure: float, radius: float = 48.0) -> ContactLine:
    """Even pressure on the outline of a round limb, `limb` say, at four Gauss points an edge."""
    on = np.isclose(np.linalg.norm(fields.points, axis=1), radius) & np.isin(
        np.arange(len(fields.points)), fields.cells[fields.cells_of("skin")]
    )
    node = np.flatnonzero(on)
    angle = np.arctan2(*fields.points[node].T[::-1]) % (2 * np.pi)
    node = node[np.argsort(angle)]  # corner, middle, corner, ...
    edges = np.column_stack([node[::2], np.roll(node[::2], -1), node[1::2]])
    s, weight = np.polynomial.legendre.leggauss(4)
    shape = np.column_stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s**2])
    slope = np.column_stack([s - 0.5, s + 0.5, -2 * s])
    place = (shape @ (fields.points + fields.displacement)[edges]).reshape(-1, 2)
    length = (weight * np.linalg.norm(slope @ fields.points[edges], axis=2)).ravel()
    n = len(length)
    return ContactLine(
        arc_mm=np.cumsum(length) - length / 2,
        angle_deg=np.linspace(0, 360, n, endpoint=False),
        x_mm=place[:, 0],
        y_mm=place[:, 1],
        pressure_kPa=np.full(n, pressure),
        shear_kPa=np.zeros(n),
        gap_mm=np.zeros(n),
        weight_mm=length,
        status=np.full(n, "stick"),
    )


def limb_study(keys: tuple[Key, ...] = ALL) -> dict[Key, tuple[SectionFields, ContactLine]]:
    """Cases of the round limb: more stress and pressure with Combined, more with HS than TC."""
    cases = {}
    for socket, name in keys:
        factor = {"TC": 2.0, "TSB": 1.0, "HS": 3.0}[socket] * (1.5 if name == "combined" else 1.0)
        fields = limb(factor, shear=0.02 * factor)
        cases[socket, name] = (fields, contact_on(fields, 5 * factor))
    return cases


def checks(fields: SectionFields, line: ContactLine, negative_modes: int = 0) -> Checks:
    """Checks of a hand-made case."""
    return Checks(
        load=1.0,
        unknowns=2 * (len(fields.points) + len(fields.cells)) + 3 * len(fields.cells),
        cells=len(fields.cells),
        steps=2,
        failed_steps=0,
        newton_iterations=6,
        residual_N_per_mm=1e-12,
        smallest_volume_ratio=0.9,
        smallest_volume_ratio_region="skin",
        largest_gap_in_contact_mm=0.0,
        pressing_force_N_per_mm=float(line.pressure_kPa.mean()),
        relative_force_imbalance=0.0,
        negative_modes=negative_modes,
    )


def result(key: Key, fields: SectionFields, line: ContactLine, **about: Any) -> Result:
    """Return a solved case; `about` is for its record."""
    steps = pd.DataFrame(
        {
            "step": [1, 2],
            "load": [0.5, 1.0],
            "converged": True,
            "reason": "",
            "newton_iterations": 3,
            "residual_N_per_mm": 1e-12,
            "seconds": 1.0,
            "negative_modes": 0,
        }
    )
    socket, name = key
    of = (socket.split("@")[0], name.split("@")[0])
    known = {"of": of, "status": "solved", "checks": checks(fields, line)}
    return Result(
        CaseRecord(socket=socket, material_set=name, **known | about), fields, line, steps
    )


def with_second(first: Result, second: Result, times: int = 2) -> Result:
    """Return a case with its result on a second mesh of `times` as many triangles."""
    cells = times * first.checks.cells
    checks = second.checks.model_copy(update={"cells": cells})
    second = replace(second, record=second.record.model_copy(update={"checks": checks}))
    about = SecondMesh(size="twice the triangles of coarse", cells=cells)
    record = first.record.model_copy(update={"second_mesh": about})
    return replace(first, record=record).on_second_mesh(second)


def study_record(records: Iterable[CaseRecord], model: ModelTable | None = None) -> StudyRecord:
    """Return what a run.json has."""
    model = model or ModelTable(size="coarse")
    sets = [MaterialSet.paper(name, model.fascia_c10, model.ogden_form) for name in BASE_SETS]
    return StudyRecord(
        versions={"calfsocket": "0", "fenics-dolfinx": "0.9.0"},
        petsc_options={},
        ranks=1,
        study=StudySource(file="study.toml", content={}),
        settings={"model": model.model_dump(), "steps": LoadSteps(extrapolate=False).model_dump()},
        limb=Limb.reference(),
        sockets=reference_sockets(),
        laws={each.name: each.tissue_laws() for each in sets},
        inputs=dict.fromkeys(map("_".join, ALL), ""),
        finished=True,
        cases={record.name: record for record in records},
    )


def results_of(
    cases: Mapping[Key, tuple[SectionFields, ContactLine] | Result],
    model: ModelTable | None = None,
    folder: Path = Path("nowhere"),
) -> Results:
    """Return results that are in no file."""
    made = {
        key: case if isinstance(case, Result) else result(key, *case) for key, case in cases.items()
    }
    records = {key: each.record for key, each in made.items()}
    run = study_record(records.values(), model)
    return Results(folder, run, records, lambda record: made[record.key])


def with_value(results: Results, key: Key, tissue: str, quantity: str, value: float) -> Results:
    """Return results with one value of the summary replaced."""
    summary = results.summary.copy()
    row = (
        (summary.socket == key[0])
        & (summary.material_set == key[1])
        & (summary.tissue == tissue)
        & (summary["quantity"] == quantity)
    )
    assert row.sum() == 1
    summary.loc[row, "value"] = value
    return with_summary(results, summary)


def with_summary(results: Results, summary: pd.DataFrame) -> Results:
    """Return results with another summary."""
    changed = results.only(results)
    changed.__dict__["summary"] = summary  # which is computed once
    return changed


def write_results(
    folder: Path,
    cases: Mapping[Key, tuple[SectionFields, ContactLine] | Result],
    model: ModelTable | None = None,
    failed: Mapping[Key, str] | None = None,
    thresholds: Sequence[Threshold] = (),
) -> Path:
    """Write a study's folder; `failed` names cases that did not reach their full load."""
    tables: dict[str, list[pd.DataFrame]] = {}
    records = [
        CaseRecord(socket=key[0], material_set=key[1], of=key, status="failed", message=why)
        for key, why in (failed or {}).items()
    ]
    for key, case in cases.items():
        made = case if isinstance(case, Result) else result(key, *case)
        made.save(folder / made.record.name)
        beyond = shares_beyond(made.quantities, made.line, thresholds)
        summary = pd.concat([made.summary(), beyond]) if thresholds else made.summary()
        of_name = {"levels": made.levels(), "contact": made.contact, "steps": made.steps}
        for name, rows in {"summary": summary, **of_name}.items():
            tables.setdefault(name, []).append(of_case(rows, made.record))
        records.append(made.record)
    for name, parts in tables.items():
        path = folder / f"{name}.csv"
        pd.concat(parts).to_csv(path, index=False, float_format=FLOAT_FORMAT)
    run = study_record(records, model).model_dump(mode="json", exclude_none=True)
    write_json(folder / "run.json", run)
    return folder
