"""The command fit: files that it reads and writes, and one line for each that it cannot use."""

import json
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from calfsocket.cli import main
from calfsocket.fit.data import read_test
from calfsocket.fit.synthetic import EXAMPLES
from calfsocket.materials import tissues
from calfsocket.materials.file import read_material

REPOSITORY = Path(__file__).resolve().parent.parent
GOOD = "1, 0\n1.05, 1\n1.1, 2.1\n1.15, 3.3\n1.2, 4.6\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "data.csv"
    path.write_text(text)
    return path


# Stretch 1.25: 500 kPa over the current area are 500/1.25 = 400 kPa over the reference area.
def test_columns_units_and_measures_by_hand(tmp_path):
    engineering = read_test(
        written(tmp_path, "# A title\n# more\n\nstrain [%], stress [kPa]\n0, 0\n25, 400\n")
    )
    assert (engineering.title, engineering.mode) == ("A title", "uniaxial")
    assert engineering.stretch == pytest.approx([1.0, 1.25])
    assert engineering.stress == pytest.approx([0.0, 0.4])
    assert engineering.sd is None
    cauchy = read_test(
        written(
            tmp_path,
            "stress_sd [Pa], cauchy_stress [N/mm^2], mode, stretch\n"
            "2e4, 0, planar, 1\n1e4, 0.5, planar, 1.25\n",
        )
    )
    assert (cauchy.title, cauchy.mode, cauchy.measure) == ("data.csv", "planar", "cauchy")
    assert cauchy.stress == pytest.approx(engineering.stress)
    assert cauchy.sd == pytest.approx([0.02, 0.008])
    asked = read_test(written(tmp_path, "stretch, stress [MPa]\n1, 0\n1.25, 0.5\n"), None, "cauchy")
    assert asked.stress == pytest.approx(cauchy.stress)


# Before the header, the mark that spreadsheets put before UTF-8.
def test_compression_may_run_downwards_and_repeat_a_stretch(tmp_path):
    test = read_test(
        written(tmp_path, "\ufeffstretch, stress [kPa]\n1, 0\n0.9, -1\n0.9, -1.1\n0.8, -3\n")
    )
    assert test.stretch.tolist() == [1.0, 0.9, 0.9, 0.8]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", ["data.csv: contains no data"]),
        ("# only a comment\nstretch, stress [kPa]\n", ["data.csv: contains no data"]),
        (f"stretch\n{GOOD}", ["no column of engineering_stress, cauchy_stress, stress"]),
        (f"stress [kPa]\n{GOOD}", ["no column of stretch, strain"]),
        (f"stretch; stress [kPa]\n{GOOD}", ["'stretch; stress [kPa]'", "NAME [UNIT]"]),
        (f"strech, stress [kPa]\n{GOOD}", ["'strech' is unknown", "did you mean 'stretch'"]),
        (f"stretch, stress (kPa)\n{GOOD}", ["'stress (kPa)'", "NAME [UNIT]"]),
        (f"stretch, stretch\n{GOOD}", ["stretch appears twice"]),
        (f"stretch, strain, stress [kPa]\n{GOOD}", ["more than one column of stretch, strain"]),
        (f"stretch, stress\n{GOOD}", ["stress: unit '' is unknown", "Pa, kPa", "`stress [kPa]`"]),
        (f"stretch, stress [kpa]\n{GOOD}", ["unit 'kpa' is unknown", "Pa, kPa"]),
        (f"stretch [%], stress [kPa]\n{GOOD}", ["stretch: unit '%' is unknown; use -"]),
        (f"strain [mm], stress [kPa]\n{GOOD}", ["strain: unit 'mm' is unknown; use - or %"]),
        ("stretch, stress [kPa]\n1, 0\n1.1, 1, 2\n", ["line 3: 3 cells; the header has 2"]),
        ("stretch, stress [kPa]\n1, 0\n\n1.1, x\n", ["line 4: stress is 'x'"]),
        ("stretch, stress [kPa]\n1, 0\n1.1, nan\n", ["line 3: stress is 'nan'"]),
        ("stretch, stress [kPa]\n1, 0\n1.1,\n", ["line 3: stress is ''"]),
        ("stretch, stress [kPa]\n1, 0\n-1.1, 1\n", ["line 3: the stretch is outside 0.25 to 4"]),
        ("stretch, stress [kPa]\n100, 0\n110, 1\n", ["line 2: the stretch is outside"]),
        ("stretch, stress [kPa]\n1, 0\n1.2, 2\n1.1, 1\n1.3, 3\n", ["line 4: the stretch turns"]),
        ("stretch, stress [kPa]\n1, 0\n1.2, 2\n1.1, 1\n", ["line 4: the stretch turns back"]),
        (
            "stretch, stress [kPa]\n1, 0\n0.9, 1\n0.8, 2\n",
            ["opposite signs", "compression negative"],
        ),
        ("stretch, stress [kPa], stress_sd [kPa]\n1, 0, 0\n1.1, 1, 1\n", ["line 2: stress_sd"]),
        ("stretch, stress [kPa], mode\n1, 0, shear\n", ["line 2: mode is unknown", "planar"]),
        (
            "stretch, stress [kPa], mode\n1, 0, uniaxial\n1.1, 1, planar\n",
            ["line 3: mode changes from uniaxial", "a separate file"],
        ),
        (f"stretch, stress [kPa]\n{GOOD[:13]}", ["1 stretches other than 1", "at least 4"]),
    ],
)
def test_bad_data_gets_one_line_and_exit_code_2(text, says, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, text)
    assert main(["fit", path.name, "--law", "yeoh"]) == 2
    output, errors = capfd.readouterr()
    assert output == ""
    lines = errors.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("calfsocket: data.csv"), errors
    for word in says:
        assert word in lines[0]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["none.csv", "--law", "yeoh"], ["none.csv: cannot be read"]),
        (["data.csv"], ["--law"]),
        (["data.csv", "--law", "yeo"], ["--law: unknown law 'yeo'", "yeoh, ogden, neo-hookean"]),
        (["data.csv", "--law", "yeoh", "--terms", "4"], ["--terms: is 4", "1 to 3"]),
        (["data.csv", "--law", "yeoh", "--nu", "0.49"], ["--nu", "incompressible"]),
        (["data.csv", "--law", "ogden", "--nu", "0.6"], ["0.6", "0.5"]),
        (["data.csv", "--law", "yeoh", "--mode", "shear"], ["--mode", "planar"]),
        (["data.csv", "--law", "yeoh", "--mode", "planar"], ["says uniaxial", "says planar"]),
        (
            ["data.csv", "--law", "yeoh", "--stress", "cauchy"],
            ["column's name says engineering", "--stress says cauchy"],
        ),
        (["data.csv", "--law", "yeoh", "--out", "data.csv"], ["--out data.csv", "cannot be"]),
    ],
)
def test_bad_options_get_one_line_and_exit_code_2(words, says, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    rows = GOOD.replace("\n", ", uniaxial\n")
    path = written(tmp_path, f"stretch, engineering_stress [kPa], mode\n{rows}")
    assert main(["fit", *words]) == 2
    output, errors = capfd.readouterr()
    assert output == "" and len(errors.strip().splitlines()) == 1
    for word in says:
        assert word in errors
    assert list(tmp_path.iterdir()) == [path]


def test_examples_are_what_the_package_makes():
    assert {path.name for path in (REPOSITORY / "examples").iterdir()} == EXAMPLES.keys()
    for name, example in EXAMPLES.items():
        text = (REPOSITORY / "examples" / name).read_text()
        assert text == example.csv()
        assert text.startswith("# SYNTHETIC")


def test_the_command_on_the_examples(tmp_path, capfd):
    data = [
        str(REPOSITORY / "examples" / f"muscle_{m}_synthetic.csv") for m in ("uniaxial", "planar")
    ]
    out = tmp_path / "muscle"
    words = ["fit", *data, "--law", "ogden", "--nu", "0.49", "--out", str(out)]
    assert main(words) == 0
    told = capfd.readouterr().out
    assert "SYNTHETIC" in told and "mu1 = 1.9" in told and "stable (Drucker)" in told
    names = {"material.toml", "fit.json", "curve.csv", "fit.png", "fit.pdf"}
    assert {path.name for path in out.iterdir()} == names

    law = read_material(out / "material.toml")
    record = json.loads((out / "fit.json").read_text())
    mu, alpha = (record["parameters"][name] for name in ("mu1", "alpha1"))
    assert law.mu == pytest.approx([mu["value"] * 1e-3]) and law.alpha == (alpha["value"],)
    # The law that the data were made of lies within the intervals.
    assert abs(mu["value"] - 1.907) < mu["half_width"] < 0.1
    assert abs(alpha["value"] - 4.6) < alpha["half_width"] < 0.5
    assert law.d1 == pytest.approx(3 * 0.02 / (1.49 * law.mu[0]))
    assert record["covariance"][0][0] == pytest.approx(mu["standard_error"] ** 2)
    assert record["data"][0]["sha256"] in (out / "material.toml").read_text()

    rows = pd.read_csv(out / "curve.csv")
    assert len(rows) == 52
    residual = rows.fitted_kPa - rows.engineering_stress_kPa
    assert rows.residual_kPa.to_numpy() == pytest.approx(residual.to_numpy(), abs=1e-7)
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(record["rms_residual_kPa"], rel=1e-6)
    assert matplotlib.image.imread(out / "fit.png").std() > 0.05

    first = {name: (out / name).read_bytes() for name in names}
    assert main(words) == 0  # the same input, the same files
    assert {name: (out / name).read_bytes() for name in names} == first


def test_ogden_on_fascia_is_reported_plainly(tmp_path, capfd):
    data = str(REPOSITORY / "examples" / "fascia_uniaxial_synthetic.csv")
    assert main(["fit", data, "--law", "ogden", "--terms", "2", "--out", str(tmp_path / "o")]) == 0
    told = capfd.readouterr().out
    assert "note: " in told and "Not determined" in told
    assert json.loads((tmp_path / "o" / "fit.json").read_text())["diagnostics"]
    assert main(["fit", data, "--law", "yeoh", "--out", str(tmp_path / "y")]) == 0
    law = read_material(tmp_path / "y" / "material.toml")
    record = json.loads((tmp_path / "y" / "fit.json").read_text())
    for name in ("c10", "c20", "c30"):
        half = record["parameters"][name.upper()]["half_width"] * 1e-3
        assert abs(getattr(law, name) - getattr(tissues.FASCIA, name)) < half
