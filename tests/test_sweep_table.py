"""sweep.csv: parameters and results of each case in a row, and nothing that a spreadsheet runs."""

import pandas as pd
import pytest

from calfsocket.meshes.limb import Limb
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation.record import CaseRecord, StudySource
from calfsocket.study.cases import Plan
from calfsocket.study.document import Document
from calfsocket.study.sweep_table import column, harmless, table


def record(socket: str, status: str, **changes: object) -> CaseRecord:
    of = (socket.partition("@")[0], "m")
    named = {key.replace("__", "."): value for key, value in changes.items()}
    return CaseRecord(socket=socket, material_set="m", of=of, changes=named, status=status)


RECORDS = (
    record("A@friction=0.2", "solved", model__friction=0.2),
    record("B@w=3mm", "failed", model__friction=0.4, sockets__B__wall_thickness="3 mm"),
    record("B@w=5mm", "running", model__friction=0.4, sockets__B__wall_thickness="5.5 mm"),
)


def plan(quantities: tuple[str, ...], *parameters: str) -> Plan:
    """Return a plan whose cases are the records."""
    threshold = {"quantity": "contact_pressure", "value": "60 kPa"}
    document = Document.model_validate(
        {"study": {"quantities": quantities}, "thresholds": [threshold]}
    )
    source = StudySource(file="study.toml", content={})
    return Plan(source, document, Limb.reference(), RECORDS, parameters=parameters)


def test_a_row_a_case():
    limit = Threshold("contact_pressure", "skin", 60.0)
    sweep = plan(
        ("contact_pressure_mean", "effective_stress", "pressure"),
        "model.friction",
        "sockets.B.wall_thickness",
    )
    rows = [
        ("A@friction=0.2", "m", "skin", "contact_pressure_mean", 12.5),
        ("A@friction=0.2", "m", "fascia", "effective_stress", 100.0),
        ("A@friction=0.2", "m", "fascia", "effective_stress_below_99.9", 80.0),
        ("A@friction=0.2", "m", "vessel", "pressure", 9.0),
        ("A@friction=0.2", "m", "skin", limit.name, 3.0),
        ("B@w=3mm", "m", "skin", "contact_pressure_mean", 20.0),
    ]
    columns = ["socket", "material_set", "tissue", "quantity", "value"]
    records = {each.name: each for each in RECORDS}
    made = table(sweep, records, pd.DataFrame(rows, columns=columns))
    assert list(made.columns) == [
        "case", "socket", "material_set", "model.friction", "sockets.B.wall_thickness [mm]",
        "contact_pressure_mean_kPa",
        "skin_effective_stress_below_99.9_kPa", "fat_effective_stress_below_99.9_kPa",
        "muscle_effective_stress_below_99.9_kPa", "fascia_effective_stress_below_99.9_kPa",
        "vessel_effective_stress_below_99.9_kPa",
        "skin_effective_stress_kPa", "fat_effective_stress_kPa",
        "muscle_effective_stress_kPa", "fascia_effective_stress_kPa",
        "vessel_effective_stress_kPa", "vessel_pressure_below_99.9_kPa", "vessel_pressure_kPa",
        "skin_share_of_contact_pressure_above_60_kPa_in_percent", "status",
    ]  # fmt: skip
    first, second, third = made.to_dict("records")
    assert first["case"] == "A@friction=0.2_m" and first["model.friction"] == 0.2
    assert pd.isna(first["sockets.B.wall_thickness [mm]"])  # does not reach it
    assert (first["fascia_effective_stress_kPa"], first["vessel_pressure_kPa"]) == (100.0, 9.0)
    assert first["fascia_effective_stress_below_99.9_kPa"] == 80.0
    assert first["skin_share_of_contact_pressure_above_60_kPa_in_percent"] == 3.0
    assert second["sockets.B.wall_thickness [mm]"] == 3.0 and second["status"] == "failed"
    assert third["sockets.B.wall_thickness [mm]"] == 5.5
    assert pd.isna(third["contact_pressure_mean_kPa"])


def test_each_number_has_its_mesh_error_behind_it_where_there_is_any():
    rows = [
        ("A@friction=0.2", "m", "skin", "contact_pressure_mean", 12.5, 0.3),
        ("B@w=3mm", "m", "skin", "contact_pressure_mean", 20.0, None),
    ]
    columns = ["socket", "material_set", "tissue", "quantity", "value", "mesh_error"]
    records = {each.name: each for each in RECORDS}
    summary = pd.DataFrame(rows, columns=columns)
    made = table(plan(("contact_pressure_mean",), "model.friction"), records, summary)
    name = "contact_pressure_mean_kPa"
    assert list(made.columns)[4:6] == [name, f"{name}_mesh_error"]
    assert made[f"{name}_mesh_error"].fillna(-1).tolist() == [0.3, -1, -1]


def test_before_anything_is_solved():
    records = {RECORDS[0].name: RECORDS[0].model_copy(update={"status": "running"})}
    made = table(plan(("contact_share",), "model.friction"), records, pd.DataFrame())
    assert [row["status"] for row in made.to_dict("records")] == ["running"]


@pytest.mark.parametrize(
    ("values", "heading", "cells"),
    [
        (["-0.35 mm", "1 mm"], "p [mm]", [-0.35, 1.0]),
        (["3 mm", "1 cm"], "p", ["3 mm", "1 cm"]),
        ([0.2, None], "p", [0.2, None]),
        (["-x.csv", "=1+1", "@a", "+b", "\tc", "a"], "p",
         ["'-x.csv", "'=1+1", "'@a", "'+b", "'\tc", "a"]),
    ],
)  # fmt: skip
def test_cells_are_numbers_or_harmless_text(values, heading, cells):
    assert column("p", values) == (heading, cells)


def test_numbers_and_truths_stay():
    assert [harmless(value) for value in (-1, -0.5, True, None)] == [-1, -0.5, True, None]
    assert harmless(["-1 kPa"]) == "['-1 kPa']"
