"""The command fit: files that it reads and writes, and one line for each that it cannot use."""

import json
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from calfsocket.cli import main
from calfsocket.fit import branches
from calfsocket.fit.data import read_test
from calfsocket.fit.synthetic import EXAMPLES
from calfsocket.materials import tissues
from calfsocket.materials.file import read_material
from calfsocket.materials.modes import engineering_stress, sheared_stretch

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


# The same five points in all of them: stretches 1 to 1.2, stresses 0 to 4.6 kPa.
SPELLINGS = {
    "semicolons, decimal commas": (
        "Stretch;Stress (kPa)\n1,00;0\n1,05;1,0\n1,10;2,1\n1,15;3,3\n1,20;4,6\n"
    ),
    "semicolons at the ends, a mark, DOS lines": (
        "\ufeffsep=;\r\nStretch;Stress (kPa);\r\n1;0;\r\n1,05;1;\r\n1,1;2,1;\r\n1,15;3,3;\r\n"
        "1,2;4,6;\r\n;;\r\n"
    ),
    "tabs and decimal commas": (
        "stress / kPa\tSTRAIN / %\n0\t0\n1,0\t5,0\n2,1\t10,0\n3,3\t15,0\n4,6\t20,0\n"
    ),
    "blanks": (
        "  Strain [%]   Nominal Stress (KPa)\n0 0\n 5   1.0\n10   2.1\n15   3.3\n20   4.6\n"
    ),
    "units in a line of their own": (
        "Strain;Engineering stress\nmm/mm;N/mm²\n0;0\n0,05;0,001\n0,1;2,1e-3\n0,15;3,3e-3\n"
        "0,2;4,6e-3\n"
    ),
    "quoted cells, other columns": (
        '"Time (s)","strain_%","stress_Pa"\n"0,0","0,0","0"\n"1,0","5,0","1000"\n'
        '"2,0","10,0","2100"\n"3,0","15,0","3300"\n"4,0","20,0","4600"\n'
    ),
    "separators at the end of the header, signs as in print": (
        "Strain [1];Stress (kPa);;\n0;\u22120\n0,05;1\n0,10;2,1;\n0,15;3,3\n0,2;4,6\n"
    ),
    "a machine's words before the header": (
        "Specimen;fascia 12\nDate;2024-05-03\nStrain gauge;A\n\n"
        "Time;Eng. strain [%];Eng. stress [Pa]\n"
        "1;0;0\n2;5;1000\n3;10;2100\n4;15;3300\n5;20;4600\n"
    ),
    "true strain and stress": "true strain, True stress [kPa]\n"
    + "".join(
        f"{np.log(s):.12g}, {p * s:.12g}\n"
        for s, p in zip((1, 1.05, 1.1, 1.15, 1.2), (0, 1.0, 2.1, 3.3, 4.6), strict=True)
    ),
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_data_as_people_have_them(spelling, tmp_path):
    test = read_test(written(tmp_path, SPELLINGS[spelling]))
    assert test.stretch == pytest.approx([1.0, 1.05, 1.1, 1.15, 1.2])
    assert test.stress == pytest.approx([0.0, 1e-3, 2.1e-3, 3.3e-3, 4.6e-3])
    assert test.unused == {"q": ("Time (s)",), "a": ("Time",)}.get(spelling[0], ())


# Amount of shear 0.75, the tangent of 36.87 degrees: stretch 0.375 + sqrt(1 + 0.375^2) = 1.443.
@pytest.mark.parametrize(
    ("text", "mode"),
    [
        ("gamma [%], shear stress [kPa]\n0, 0\n75, 3\n", None),
        ("shear_angle (deg), cauchy_stress [kPa]\n0, 0\n36.86989764584402, 3\n", None),
        ("strain, stress [kPa]\n0, 0\n0.75, 3\n", "shear"),
        ("strain, shear stress [kPa]\n0, 0\n0.75, 3\n", None),
        ("strain, stress [kPa], mode\n0, 0, Simple shear\n0.75, 3, simple_shear\n", None),
    ],
)
def test_simple_shear_by_hand(text, mode, tmp_path):
    test = read_test(written(tmp_path, text), mode)
    assert test.mode == "shear"
    assert test.stretch == pytest.approx([1.0, 0.375 + np.sqrt(1 + 0.375**2)])
    assert test.stress == pytest.approx([0.0, 3e-3])  # engineering and Cauchy alike


LOOP = "stretch, stress [kPa]\n1, 0\n0.97, -0.15\n0.94, -0.42\n0.9, -1.14\n0.94, -0.2\n1, 0\n"


def test_branches_and_cycles(tmp_path):
    path = written(tmp_path, LOOP)
    loading = read_test(path, branch="loading")
    assert loading.stretch.tolist() == [1.0, 0.97, 0.94, 0.9]
    assert loading.branch == "loading, cycle 1 of 1"
    assert read_test(path, branch="unloading").stretch.tolist() == [0.9, 0.94, 1.0]

    # A second cycle to 0.8, and then into tension, whose first loading is a cycle 1.
    path = written(tmp_path, LOOP + "0.9, -1\n0.8, -3\n0.95, -0.1\n1.05, 0.4\n1.1, 1\n1, 0\n")
    assert read_test(path, branch="loading", cycle=2).stretch.tolist() == [1.0, 0.9, 0.8]
    assert read_test(path, branch="loading", cycle="last").branch == "loading, cycle 2 of 2"
    assert read_test(path, branch="unloading", cycle=2).stretch.tolist() == [0.8, 0.95]
    first = read_test(path, branch="loading", cycle=1).stretch.tolist()
    assert first == [1.0, 0.97, 0.94, 0.9, 1.05, 1.1]


# Noise of 0.7 % of the range of stretches, fourteen times the way from one point to the next.
def test_noise_is_not_taken_for_unloading(tmp_path):
    rng = np.random.default_rng(4)
    up = np.linspace(1.0, 1.2, 2000)
    noisy = up + 0.0014 * rng.standard_normal(2000)
    assert np.sum(np.diff(noisy) < 0) > 900
    assert [piece.branch for piece in branches.pieces(noisy)] == ["loading"]
    loop = np.concatenate([noisy, noisy[::-1]])
    assert [piece.branch for piece in branches.pieces(loop)] == ["loading", "unloading"]
    assert abs(branches.turning_points(loop)[0] - 2000) < 100


def test_one_curve_may_pass_from_compression_to_tension():
    (piece,) = branches.pieces(np.linspace(0.8, 1.3, 11))
    assert len(piece.rows) == 11


def test_shear_recovers_its_law(tmp_path, capfd):
    law = tissues.MUSCLE
    amount = np.linspace(0, 1, 15)
    stress = engineering_stress(law, "shear", sheared_stretch(amount)) / tissues.KPA
    rows = "".join(f"{g:.6g}; {s:.10g}\n" for g, s in zip(amount, stress, strict=True))
    path = written(tmp_path, f"Shear strain [-]; Shear stress [kPa]\n{rows}".replace(".", ","))
    out = tmp_path / "out"
    assert main(["fit", str(path), "--law", "ogden", "--out", str(out)]) == 0
    found = read_material(out / "material.toml")
    # Shear alone does not tell alpha from -alpha: l and 1/l change places.
    assert found.mu[0] == pytest.approx(law.mu[0], rel=1e-5)
    assert abs(found.alpha[0]) == pytest.approx(law.alpha[0], rel=1e-5)
    assert "2 sets of parameters" in capfd.readouterr().out
    curve = pd.read_csv(out / "curve.csv")
    assert curve.shear_strain.to_numpy() == pytest.approx(amount, abs=1e-6)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["none.csv", "--law", "yeoh"], ["none.csv: cannot be read"]),
        (["data.csv"], ["--law"]),
        (["data.csv", "--law", "yeo"], ["--law: unknown law 'yeo'", "yeoh, ogden, neo-hookean"]),
        (["data.csv", "--law", "yeoh", "--terms", "4"], ["--terms: is 4", "1 to 3"]),
        (["data.csv", "--law", "yeoh", "--nu", "0.49"], ["--nu", "incompressible"]),
        (["data.csv", "--law", "ogden", "--nu", "0.6"], ["0.6", "0.5"]),
        (["data.csv", "--law", "yeoh", "--mode", "torsion"], ["--mode", "planar", "shear"]),
        (["data.csv", "--law", "yeoh", "--cycle", "0"], ["--cycle", "a number from 1, or last"]),
        (["data.csv", "--law", "yeoh", "--branch", "down"], ["--branch", "loading", "unloading"]),
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
    assert {path.name for path in (REPOSITORY / "examples").glob("*.csv")} == EXAMPLES.keys()
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
