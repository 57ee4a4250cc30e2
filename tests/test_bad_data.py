"""Stress-stretch data that `fit` cannot use: each gets one line with the file and the place."""

from pathlib import Path

import pytest
from test_bad_input import refused, shortened

import reliability
from reliability import Trial

TITLE = "Stress-stretch data"
INTRO = "Files given to `fit --law yeoh`, with the options that are named."

GOOD = "1, 0\n1.05, 1\n1.1, 2.1\n1.15, 3.3\n1.2, 4.6\n"
KPA = "stretch, stress [kPa]\n"
LOOP = "1, 0\n1.1, 1\n1.2, 3\n1.1, 0.6\n1, 0\n"

TRIALS = (
    Trial("an empty data file", "", ("data.csv: contains no data",)),
    Trial("a header alone", f"# only a comment\n{KPA}", ("data.csv: contains no data",)),
    Trial("names and units alone", "Stretch;Stress\n-;kPa\n", ("data.csv: contains no data",)),
    Trial("no header", GOOD,
          ("has no header", "one of stretch, strain", "e.g. stretch, engineering_stress")),
    Trial("no header, semicolons", "1,00;0,00\n1,05;0,31\n", ("has no header",)),
    Trial("a spreadsheet as such", b"PK\x03\x04\x14\x00\x06\x00\x08\x00\xe7", ("UTF-8",)),
    # Columns
    Trial("no stress", f"stretch, time\n{GOOD}",
          ("no column of engineering_stress, cauchy_stress", "has stretch, time")),
    Trial("a machine's words before a header of other names",
          "Specimen 12\n\nTime\tDehnung\tSpannung\ns\t%\tkPa\n0\t0\t0\n1\t5\t1\n",
          ("no column of stretch, strain", "has Time, Dehnung, Spannung")),
    Trial("no stretch", f"time [s], stress [kPa]\n{GOOD}",
          ("no column of stretch, strain", "has time [s], stress [kPa]")),
    Trial("force over displacement", f"Extension (mm);Force (N)\n{GOOD.replace(', ', ';')}",
          ("no column of stretch", "Extension (mm), Force (N)")),
    Trial("a column misspelt", f"strech, stress [kPa]\n{GOOD}",
          ("'strech' is unknown", "did you mean 'stretch'")),
    Trial("a column twice", f"stretch, stretch, stress [kPa]\n{GOOD.replace(', ', ', 1, ')}",
          ("stretch appears twice",)),
    Trial("stretch and strain", f"stretch, strain, stress [kPa]\n{GOOD.replace(', ', ', 1, ')}",
          ("more than one column of stretch, strain",)),
    # Units
    Trial("a stress without a unit", f"stretch, stress\n{GOOD}",
          ("stress: unit '' is unknown", "Pa, kPa", "`stress [kPa]`")),
    Trial("a stress in mPa", f"stretch, stress [mPa]\n{GOOD}",
          ("unit 'mPa' is unknown", "Pa, kPa, MPa")),
    Trial("a stress in newton", f"stretch, stress (N)\n{GOOD}", ("unit 'N' is unknown", "N/mm^2")),
    Trial("a stretch in per cent", f"stretch [%], stress [kPa]\n{GOOD}",
          ("stretch: unit '%' is unknown",)),
    Trial("a strain in mm", f"strain [mm], stress [kPa]\n{GOOD}",
          ("strain: unit 'mm' is unknown", "%")),
    Trial("an angle without a unit", f"shear_angle, stress [kPa]\n{GOOD}",
          ("shear_angle: unit '' is unknown", "deg")),
    Trial("strain in per cent that does not say so", "Strain, Stress (kPa)\n0, 0\n20, 4\n",
          ("line 3: the stretch is outside 0.25 to 4", "`strain [%]`")),
    # Rows
    Trial("a cell too many", f"{KPA}1, 0\n1.1, 1, 2\n", ("line 3: 3 cells; the header has 2",)),
    Trial("a cell too few", f"{KPA}1, 0\n1.1\n", ("line 3: 1 cell; the header has 2",)),
    Trial("commas for decimals and for columns", "Stretch,Stress (kPa)\n1,00,0,00\n1,10,0,61\n",
          ("line 2: 4 cells; the header has 2", "semicolons")),
    Trial("commas and points for decimals", "stretch;stress [kPa]\n1,0;0\n1,1;1.234,5\n",
          ("line 2: stretch is '1,0'", "decimal points and commas")),
    Trial("commas for thousands", "stretch;stress [Pa]\n1.0;0\n1.1;1,234\n",
          ("line 3: stress is '1,234'",)),
    Trial("several specimens in one file",
          f"Strain 1, Stress 1, Strain 2, Stress 2\n{GOOD.replace(', ', ', 1, 1, ')}",
          ("strain appears twice",)),
    Trial("a remark at the end", f"{KPA}{GOOD}End of test\n",
          ("line 7: 1 cell; the header has 2",)),
    Trial("a word for a number", f"{KPA}1, 0\n\n1.1, x\n", ("line 4: stress is 'x'",)),
    Trial("a stress of nan", f"{KPA}1, 0\n1.1, nan\n", ("line 3: stress is 'nan'",)),
    Trial("an empty cell", f"{KPA}1, 0\n1.1,\n", ("line 3: stress is ''",)),
    Trial("a quotation mark that is not closed", f'{KPA}1, 0\n"1.1, 1\n1.2, 2\n',
          ("is not a table", "quotation marks")),
    Trial("a quotation mark that is closed lines later", f'{KPA}1, 0\n"1.1, 1\n1.2", 2\n',
          ("a quotation mark is not closed",)),
    Trial("a negative stretch", f"{KPA}1, 0\n-1.1, 1\n",
          ("line 3: the stretch is outside 0.25 to 4",)),
    Trial("stretches in per cent", f"{KPA}100, 0\n110, 1\n", ("line 2: the stretch is outside",)),
    Trial("compression as positive stress", f"{KPA}1, 0\n0.9, 1\n0.8, 2\n",
          ("opposite signs", "compression negative")),
    Trial("a standard deviation of 0",
          "stretch, stress [kPa], stress_sd [kPa]\n1, 0, 0\n1.1, 1, 1\n",
          ("line 2: stress_sd",)),
    Trial("too few stretches", f"{KPA}{GOOD[:13]}", ("1 stretches other than 1", "at least 4")),
    # Branches
    Trial("loading and unloading", f"{KPA}{LOOP}",
          ("turns back at line 4", "--branch loading or unloading")),
    Trial("rows out of order", f"{KPA}1, 0\n1.2, 2\n1.1, 1\n1.3, 3\n",
          ("turns back 2 times, first at line 3", "sort the rows")),
    Trial("two cycles, --branch loading", (f"{KPA}{LOOP}{LOOP[5:]}", "--branch", "loading"),
          ("2 cycles", "--cycle 1 to 2", "--cycle last")),
    Trial("a cycle that the file lacks, --branch loading --cycle 3",
          (f"{KPA}{LOOP}{LOOP[5:]}", "--branch", "loading", "--cycle", "3"),
          ("no loading in cycle 3", "--cycle 1 to 2")),
    Trial("one curve, --branch unloading", (f"{KPA}{GOOD}", "--branch", "unloading"),
          ("does not turn", "omit --branch")),
    # Modes
    Trial("an unknown mode", "stretch, stress [kPa], mode\n1, 0, torsion\n",
          ("line 2: mode is unknown", "planar, shear")),
    Trial("two modes in one file", "stretch, stress [kPa], mode\n1, 0, uniaxial\n1.1, 1, planar\n",
          ("line 3: mode changes from uniaxial", "a separate file")),
    Trial("simple shear with a stretch, --mode shear", (f"{KPA}{GOOD}", "--mode", "shear"),
          ("of a shear test cannot be a stretch", "shear_strain")),
    Trial("shear strain of a uniaxial test", "shear_strain, stress [kPa], mode\n0.1, 1, uniaxial\n",
          ("mode says uniaxial", "column shear_strain")),
    Trial("shear strain, --mode planar", (f"gamma, stress [kPa]\n{GOOD}", "--mode", "planar"),
          ("column shear_strain says shear", "--mode says planar")),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return the line with which `fit` refuses the data."""
    text, *options = trial.given if isinstance(trial.given, tuple) else (trial.given,)
    path = folder / "data.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    words = ["fit", str(path), "--law", "yeoh", "--out", str(folder / "out"), *options]
    return shortened(refused(words), folder)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_bad_data_get_one_line_and_exit_code_2(trial: Trial, tmp_path: Path) -> None:
    line = said(trial, tmp_path)
    assert line.startswith("data.csv")
    for part in trial.says:
        assert part in line
    assert reliability.row(trial, line) in reliability.rows()
    assert [path.name for path in tmp_path.iterdir()] == ["data.csv"]
