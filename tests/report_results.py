"""Hand-made results in a folder, as a study writes them, for the tests of the report."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from calfsocket.io.files import write_json
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.meshes.data import load_limb, load_sockets
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import summary_rows
from calfsocket.postprocess.vtu import write_fields
from calfsocket.simulation.case import Case, Settings, case_laws
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
        circumference_mm=18.0,
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


def contact_on(fields: SectionFields, pressure: float) -> ContactLine:
    """Even pressure on the outline of `limb`, at four Gauss points an edge."""
    on = np.isclose(np.linalg.norm(fields.points, axis=1), 48) & np.isin(
        np.arange(len(fields.points)), fields.cells[fields.region == 5]
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
        circumference_mm=float(length.sum()),
    )


def limb_study(keys: tuple[Key, ...] = ALL) -> dict[Key, tuple[SectionFields, ContactLine]]:
    """Cases of the round limb: more stress and pressure with Combined, more with HS than TC."""
    cases = {}
    for socket, name in keys:
        factor = {"TC": 2.0, "TSB": 1.0, "HS": 3.0}[socket] * (1.5 if name == "combined" else 1.0)
        fields = limb(factor, shear=0.02 * factor)
        cases[socket, name] = (fields, contact_on(fields, 5 * factor))
    return cases


def write_results(
    folder: Path,
    cases: Mapping[Key, tuple[SectionFields, ContactLine]],
    settings: Settings | None = None,
    failed: Mapping[str, str] | None = None,
) -> Path:
    """Write a study's folder; `failed` names cases that did not reach their full load."""
    settings = settings or Settings(size="coarse")
    summary, contact, steps = [], [], []
    entries: dict[str, dict] = {
        name: {"status": "failed", "message": why} for name, why in (failed or {}).items()
    }
    for (socket, name), (fields, line) in cases.items():
        write_fields(folder / f"{socket}_{name}", fields, socket, name)
        summary.append(summary_rows(fields, line, socket, name))
        contact.append(line.rows(socket, name))
        for number, load in enumerate((0.5, 1.0)):
            step = {"socket": socket, "material_set": name, "step": number + 1, "load": load}
            steps.append(step | {"converged": True, "newton_iterations": 3})
        entries[f"{socket}_{name}"] = {
            "status": "solved",
            "message": "",
            "unknowns": 2 * (len(fields.points) + len(fields.cells)) + 3 * len(fields.cells),
            "pressing_force_N_per_mm": float(line.pressure_kPa.mean()),
            "negative_modes": 0,
        }
    for file, rows in (
        ("summary", summary),
        ("contact", contact),
        ("steps", [pd.DataFrame(steps)]),
    ):
        pd.concat(rows).to_csv(folder / f"{file}.csv", index=False, float_format=FLOAT_FORMAT)
    laws = {
        name: {
            tissue: law.model_dump(mode="json")
            for tissue, law in case_laws(Case("", name), settings).items()
        }
        for name in ("separate", "combined")
    }
    run = {
        "versions": {"calfsocket": "0", "fenics-dolfinx": "0.9.0"},
        "inputs": {"settings": settings.record()},
        "laws": laws,
        "limb": load_limb().model_dump(mode="json"),
        "sockets": load_sockets().model_dump(mode="json"),
        "finished": True,
        "cases": entries,
    }
    write_json(folder / "run.json", run)
    return folder
