"""Material files: what is written is read back without loss; what is wrong is said in one line."""

import math
import tomllib

import pytest

from calfsocket.cli import main
from calfsocket.commands import study
from calfsocket.commands.options import material_files
from calfsocket.io.errors import InputError
from calfsocket.io.units import COMPLIANCE, STRESS, like
from calfsocket.materials import tissues
from calfsocket.materials.file import read_material, write_material
from calfsocket.materials.laws import Hencky, Ogden, Yeoh
from calfsocket.materials.material_set import MaterialSet


@pytest.mark.parametrize(
    "law",
    [
        *MaterialSet.paper("separate").laws.values(),
        tissues.MUSCLE_AND_FASCIA,
        # Digits that a division by 1000 in floating point would not bring back.
        Ogden(mu=(math.pi / 700, math.e / 9000), alpha=(1 / 3, -math.pi), d1=math.sqrt(2)),
        Ogden(mu=(math.pi / 700,), alpha=(1 / 3,), d1=0.0, form="as-printed"),
        Yeoh(c10=1e-9 / 3, c20=2e5 / 3, c30=0.1 + 0.2),
        Hencky(e=1 / 30, nu=0.5),
    ],
)
def test_round_trip_keeps_every_digit(law, tmp_path):
    path = tmp_path / "law.toml"
    write_material(path, law, {})
    assert read_material(path) == law


def test_provenance_is_kept_for_people(tmp_path):
    path = tmp_path / "law.toml"
    provenance_in = {"data file": 'a "b"\\\x7f\n.csv', "points": [1, 2.5], "r2": 0.9, "ok": True}
    write_material(path, tissues.SKIN, provenance_in)
    provenance = tomllib.loads(path.read_text())["provenance"]
    assert provenance.pop("calfsocket")
    assert provenance == provenance_in


# By hand: nu = 0.495 gives D1 = 3 0.01/(1.495 mu) = 0.0200669/mu.
def test_a_file_by_hand(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text('law = "ogden"\nmu = ["12 kPa", "3000 Pa"]\nalpha = [14, -2.5]\nnu = 0.495\n')
    law = read_material(path)
    assert law.mu == (0.012, 0.003) and law.alpha == (14, -2.5)
    assert law.d1 == pytest.approx(0.0200669 / 0.015, rel=1e-5)
    path.write_text('law = "neo-hookean"\nmu = "10 N/cm^2"\nd1 = "2e-6 1/Pa"\n')
    assert read_material(path) == Ogden(mu=(0.1,), alpha=(2.0,), d1=2.0)
    path.write_text('law = "neo-hookean"\nmu = "1 MPa"\nnu = 0.5\n')
    assert read_material(path).bulk_modulus == math.inf


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            'mu = ["1 kPa"]',
            ["law is missing", "ogden, yeoh, hencky, mooney-rivlin, neo-hookean, linear-elastic"],
        ),
        (
            'law = "odgen"',
            [
                "law is 'odgen'",
                "'ogden', 'yeoh', 'hencky', 'mooney-rivlin', 'neo-hookean', 'linear-elastic'",
            ],
        ),
        ('law = ["ogden"]', ["law is '['ogden']'", "yeoh"]),
        ('law = "yeoh"', ["c10: is missing; add it"]),
        ('law = "yeoh"\nc10 = 4.91', ["c10", "4.91", "unit"]),
        ('law = "yeoh"\nc10 = "4.91"', ["c10", "unit ''", "Pa, kPa, MPa"]),
        ('law = "yeoh"\nc10 = "4.91 kpa"', ["c10", "'kpa'", "Pa, kPa, MPa"]),
        ('law = "yeoh"\nc10 = "nan kPa"', ["c10", "'nan kPa'"]),
        ('law = "yeoh"\nc10 = "-1 kPa"', ["c10: is '-1 kPa'", "greater than 0"]),
        ('law = "yeoh"\nc10 = "1 kPa"\nc_20 = "1 kPa"', ["c_20", "did you mean 'c20'"]),
        ('law = "ogden"\nmu = ["1 kPa"]\nalpha = [2, 3]\nnu = 0.4', ["mu has length 1, alpha 2"]),
        ('law = "ogden"\nmu = ["1 kPa", "1"]\nalpha = [2]\nnu = 0.4', ["mu.1", "unit ''"]),
        ('law = "ogden"\nmu = ["1 kPa"]\nalpha = [2]', ["give one of d1, k and nu"]),
        (
            'law = "ogden"\nmu = ["1 kPa"]\nalpha = [2]\nnu = 0.4\nd1 = "1 1/MPa"',
            ["give one of d1, k and nu; d1 and nu are given"],
        ),
        ('law = "ogden"\nmu = ["1 kPa"]\nalpha = [2]\nnu = 0.6', ["nu: is 0.6", "0.5"]),
        ('law = "ogden"\nmu = ["1 kPa"]\nalpha = [2]\nd1 = "1 kPa"', ["d1", "'kPa'", "1/MPa"]),
        ("law = ", ["Invalid value"]),
    ],
)
def test_a_bad_file_gets_one_line(text, says, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InputError) as raised:
        read_material(path)
    message = str(raised.value)
    assert message.startswith(f"{path}: ") and "\n" not in message
    assert message.count(str(path)) == 1
    for word in says:
        assert word in message


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: cannot be read"):
        read_material(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="UTF-8"):
        read_material(tmp_path / "binary.toml")


def test_units_by_hand():
    assert STRESS.parse("760 mmHg") == pytest.approx(0.101325)  # one atmosphere
    assert STRESS.parse(" -1.5e3Pa ") == -0.0015
    assert STRESS.text(0.00191, "kPa") == "1.91 kPa"
    assert COMPLIANCE.text(0.0, "1/MPa") == "0 1/MPa"
    assert COMPLIANCE.parse("1.67e-6 1/Pa") == COMPLIANCE.parse("1.67e-6 Pa^-1") == 1.67
    # The pound-force, 0.45359237 kg times 9.80665 m/s^2, on a square of 25.4 mm.
    psi = 0.45359237 * 9.80665 / 25.4**2
    assert STRESS.parse("2 psi") == pytest.approx(2 * psi, rel=1e-14)
    assert STRESS.parse("2 ksi") == pytest.approx(2000 * psi, rel=1e-14)
    assert COMPLIANCE.parse("3 1/psi") == COMPLIANCE.parse("3 psi^-1")
    assert COMPLIANCE.parse("3 1/psi") == pytest.approx(3 / psi, rel=1e-14)
    for text in ("3 MPa⁻¹", "3 mm²/N", "3 MPa-1", "3/MPa", "3e-3 kPa^-1"):
        assert COMPLIANCE.parse(text) == 3.0
    assert STRESS.parse("4 N/mm²") == STRESS.parse("4 N/mm2") == STRESS.parse("400 N/cm2") == 4.0
    # Limits in messages: in the unit that was written.
    assert like("120 %", 1.0) == "100 %" and like("7 N/mm2", 0.5) == "0.5 N/mm2"
    assert like(1.2, 1.0) == like("1.2", 1.0) == "1"
    with pytest.raises(ValueError, match="'mPa' is unknown"):
        STRESS.parse("12 mPa")  # a slip for MPa


@pytest.mark.parametrize(
    ("words", "sets", "says"),
    [
        (["fascia"], ["separate"], ["is 'fascia'; it must be TISSUE=FILE.toml"]),
        (["fascia="], ["separate"], ["is 'fascia='; it must be TISSUE=FILE.toml"]),
        (["facia=a.toml"], ["separate"], ["'facia'", "skin, fat, muscle, fascia"]),
        (["combined=a.toml"], ["separate"], ["'combined'", "skin, fat, muscle, fascia"]),
        (["muscle=a.toml"], ["combined"], ["'muscle'", "skin, fat, combined"]),
        (["fat=a.toml", "fat=b.toml"], ["separate"], ["'fat' is given twice"]),
    ],
)
def test_bad_choice_of_materials(words, sets, says):
    with pytest.raises(InputError) as raised:
        material_files(words, sets)
    for word in says:
        assert word in str(raised.value)


def test_the_study_takes_material_files_by_name(tmp_path, monkeypatch):
    fascia, shared = tmp_path / "fascia.toml", tmp_path / "shared.toml"
    write_material(fascia, Yeoh(c10=1.25, c20=2.0), {})
    write_material(shared, Ogden(mu=(0.02, 0.01), alpha=(9.0, -3.0), d1=0.5), {})
    asked = []

    def solve(_comm, study, _arguments):
        asked.append(study)
        return 0

    monkeypatch.setattr(study, "solve", solve)
    words = ["--material", f"fascia={fascia}", "--material", f"combined={shared}"]
    assert main([*words, "--sockets", "TC", "--out", str(tmp_path / "out")]) == 0
    sets = {case.of[1]: case.materials for case in asked[0].cases}
    assert sets["separate"].laws["fascia"] == Yeoh(c10=1.25, c20=2.0)
    assert sets["combined"].laws["combined"].alpha == (9.0, -3.0)
