"""sweep.csv: parameters and results of each case in a row, and nothing that a spreadsheet runs."""

import pandas as pd
import pytest

from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation.case import Case
from calfsocket.study.sweep_table import Sweep, column, harmless, table

CASES = [
    Case("A@friction=0.2", "m", changes={"model.friction": 0.2}),
    Case("B@w=3mm", "m", changes={"model.friction": 0.4, "sockets.B.wall_thickness": "3 mm"}),
    Case("B@w=5mm", "m", changes={"model.friction": 0.4, "sockets.B.wall_thickness": "5.5 mm"}),
]


def test_a_row_a_case():
    limit = Threshold("contact_pressure", "skin", 60.0)
    sweep = Sweep(
        ("model.friction", "sockets.B.wall_thickness"),
        ("contact_pressure_mean", "effective_stress", "pressure"),
        (limit,),
    )
    rows = [
        ("A@friction=0.2", "m", "skin", "contact_pressure_mean", 12.5),
        ("A@friction=0.2", "m", "fascia", "effective_stress", 100.0),
        ("A@friction=0.2", "m", "vessel", "pressure", 9.0),
        ("A@friction=0.2", "m", "skin", limit.name, 3.0),
        ("B@w=3mm", "m", "skin", "contact_pressure_mean", 20.0),
    ]
    columns = ["socket", "material_set", "tissue", "quantity", "value"]
    status = {CASES[0].name: "solved", CASES[1].name: "failed", CASES[2].name: "running"}
    made = table(sweep, CASES, status, pd.DataFrame(rows, columns=columns))
    assert list(made.columns) == [
        "case", "socket", "material_set", "model.friction", "sockets.B.wall_thickness [mm]",
        "contact_pressure_mean_kPa", "skin_effective_stress_kPa", "fat_effective_stress_kPa",
        "muscle_effective_stress_kPa", "fascia_effective_stress_kPa",
        "vessel_effective_stress_kPa", "vessel_pressure_kPa",
        "skin_share_of_contact_pressure_above_60_kPa_in_percent", "status",
    ]  # fmt: skip
    first, second, third = made.to_dict("records")
    assert first["case"] == "A@friction=0.2_m" and first["model.friction"] == 0.2
    assert pd.isna(first["sockets.B.wall_thickness [mm]"])  # does not reach it
    assert (first["fascia_effective_stress_kPa"], first["vessel_pressure_kPa"]) == (100.0, 9.0)
    assert first["skin_share_of_contact_pressure_above_60_kPa_in_percent"] == 3.0
    assert second["sockets.B.wall_thickness [mm]"] == 3.0 and second["status"] == "failed"
    assert third["sockets.B.wall_thickness [mm]"] == 5.5
    assert pd.isna(third["contact_pressure_mean_kPa"])


def test_before_anything_is_solved():
    made = table(Sweep(("model.friction",), ("contact_share",)), CASES[:1], {CASES[0].name: "x"},
                 pd.DataFrame())  # fmt: skip
    assert made.to_dict("records")[0]["status"] == "x"


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
