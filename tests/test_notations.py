"""Laws in other notations: the same energy by the formula of each, and what is kept of them."""

import tomllib

import numpy as np
import pytest

from calfsocket.io.errors import InputError
from calfsocket.materials.file import read_material, write_material
from calfsocket.materials.law import Law
from calfsocket.materials.laws import Hencky, Ogden, Yeoh, material_law
from calfsocket.simulation.record import read_run
from calfsocket.study.record import Recorder
from calfsocket.study.study import Study

RNG = np.random.default_rng(14)
STRETCHES = np.exp(RNG.uniform(-0.5, 0.5, (3, 200)))
J = np.prod(STRETCHES, axis=0)
MU, ALPHA = np.array([6.3e-3, 1.2e-5, -1e-4]), np.array([1.3, 5.0, -2.0])


def powers(exponent):
    """Sum of lb_k^m - 3 of the isochoric stretches J^(-1/3) l_k."""
    return np.sum((STRETCHES * J ** (-1 / 3)) ** exponent, axis=0) - 3


def invariants():
    """I1b and I2b by the principal stretches' squares, I2 = l1^2 l2^2 + l2^2 l3^2 + l3^2 l1^2."""
    a, b, c = STRETCHES**2
    return (a + b + c) * J ** (-2 / 3), (a * b + b * c + c * a) * J ** (-4 / 3)


# Each with the isochoric energy as its notation has it, its initial shear modulus and bulk modulus,
# by hand: 2 (C10 + C01); E/(2 (1 + nu)) and E/(3 (1 - 2 nu)); 2 C10; sum c/2; sum mu alpha/2.
CASES = {
    "Mooney-Rivlin": (
        {"law": "mooney-rivlin", "c10": "2 kPa", "c01": "1 kPa", "d1": "1e-5 Pa^-1"},
        2e-3 * (invariants()[0] - 3) + 1e-3 * (invariants()[1] - 3),
        (6e-3, 0.2),
    ),
    "Mooney-Rivlin by k": (
        {"law": "mooney-rivlin", "c10": "2 kPa", "c01": "-0.5 kPa", "kappa": "0.3 MPa"},
        2e-3 * (invariants()[0] - 3) - 0.5e-3 * (invariants()[1] - 3),
        (3e-3, 0.3),
    ),
    "neo-Hookean by mu": (
        {"law": "neo-hookean", "mu": "12 kPa", "k": "1 MPa"},
        6e-3 * (invariants()[0] - 3),
        (12e-3, 1.0),
    ),
    "neo-Hookean by C10": (
        {"law": "neo-hookean", "c10": "6 kPa", "d1": "2 1/MPa"},
        6e-3 * (invariants()[0] - 3),
        (12e-3, 1.0),
    ),
    "neo-Hookean by E and nu": (
        {"law": "neo-hookean", "e": "29 kPa", "nu": 0.45},
        5e-3 * (invariants()[0] - 3),
        (10e-3, 0.029 / 0.3),
    ),
    "FEBio's Ogden": (
        {"law": "ogden", "c": ["6 kPa", "-1 kPa"], "m": [3.0, -2.5], "k": "0.4 MPa"},
        6e-3 / 9 * powers(3.0) - 1e-3 / 6.25 * powers(-2.5),
        (2.5e-3, 0.4),
    ),
    "FEBio's Ogden with numbered terms": (
        {"law": "ogden", "c1": "6 kPa", "m1": 3.0, "c2": "-1 kPa", "m2": -2.5, "k": "0.4 MPa"},
        6e-3 / 9 * powers(3.0) - 1e-3 / 6.25 * powers(-2.5),
        (2.5e-3, 0.4),
    ),
    "FEBio's Ogden with one term": (
        {"law": "ogden", "form": "febio", "c": "6 kPa", "m": 3.0, "nu": 0.5},
        6e-3 / 9 * powers(3.0),
        (3e-3, np.inf),
    ),
    "textbook's Ogden": (
        {"law": "ogden", "mu": ["6.3 kPa", "12 Pa", "-0.1 kPa"], "alpha": [1.3, 5.0, -2.0],
         "form": "textbook", "nu": 0.49},
        sum(mu / alpha * powers(alpha) for mu, alpha in zip(MU, ALPHA, strict=True)),
        (4.225e-3, 4.225e-3 * 2 * 1.49 / (3 * 0.02)),
    ),
    "Abaqus's Ogden": (
        {"law": "ogden", "mu": ["6.3 kPa", "12 Pa", "-0.1 kPa"], "alpha": [1.3, 5.0, -2.0],
         "form": "abaqus", "k": "1 MPa"},
        sum(2 * mu / alpha**2 * powers(alpha) for mu, alpha in zip(MU, ALPHA, strict=True)),
        (6.212e-3, 1.0),
    ),
    "linear elastic": (
        {"law": "linear-elastic", "e": "29 kPa", "nu": 0.45},
        10e-3 * (np.sum(np.log(STRETCHES) ** 2, axis=0) - np.log(J) ** 2 / 3),
        (10e-3, 0.029 / 0.3),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_energy_is_that_of_the_notation(case):
    table, energy, (shear, bulk) = CASES[case]
    law = made(table)
    assert law.energy(STRETCHES) == pytest.approx(energy, rel=1e-12, abs=1e-12 * np.max(energy))
    assert law.initial_shear_modulus == pytest.approx(shear, rel=1e-14)
    assert law.bulk_modulus == pytest.approx(bulk, rel=1e-12)
    assert type(law) in (Ogden, Hencky)


def made(table) -> Law:
    """The law in Python."""
    return material_law(table["law"], **{key: table[key] for key in table if key != "law"})


@pytest.mark.parametrize("case", CASES)
def test_files_keep_what_was_given_beside_what_is_used(case, tmp_path):
    table, path = CASES[case][0], tmp_path / "law.toml"
    path.write_text("".join(f"{key} = {value!r}\n" for key, value in table.items()))
    law = read_material(path)
    assert law == made(table) and law.given == table
    write_material(path, law, {"source": "a book"})
    written = tomllib.loads(path.read_text())
    assert written["given"] == table and written["law"] in ("ogden", "hencky")
    again = read_material(path)
    assert again == law and again.given == law.given
    assert hash(again) == hash(law)


def test_what_was_given_makes_no_other_law():
    by_k = Ogden(mu=(1e-3,), alpha=(2.0,), k=2.0)
    plain = Ogden(mu=(1e-3,), alpha=(2.0,), d1=1.0)
    assert by_k == plain and hash(by_k) == hash(plain) and by_k.given != plain.given
    assert plain.given is None and plain != Ogden(mu=(1e-3,), alpha=(2.0,), d1=1.1)
    assert plain != Yeoh(c10=1.0)


def test_the_textbooks_form_is_what_the_paper_prints():
    parameters = {"mu": (6.3e-3, -1e-4), "alpha": (1.3, -2.0), "d1": 2.0}
    textbook, printed = (Ogden(**parameters, form=form) for form in ("textbook", "as-printed"))
    assert textbook.coefficients() == printed.coefficients()
    assert textbook.form == "abaqus" and printed.form == "as-printed"  # the one is converted
    assert textbook.bulk_modulus == printed.bulk_modulus == 1.0
    # In FEBio's form c may be called mu where the form is given.
    febio = Ogden(mu=(6.3e-3, -1e-4), alpha=(1.3, -2.0), d1=2.0, form="febio")
    assert febio == Ogden(c=(6.3e-3, -1e-4), m=(1.3, -2.0), k=1.0)


STUDY = """
[study]
sockets = ["TC"]
materials = ["mine"]
[materials.mine]
fat = { law = "mooney-rivlin", c10 = "2 kPa", c01 = "1 kPa", d1 = "1e-5 1/Pa" }
muscle = { file = "muscle.toml" }
"""


def test_a_run_records_both(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "muscle.toml").write_text('law = "ogden"\nc1 = "1 psi"\nm1 = 3.0\nk = "1 ksi"\n')
    plan = Study.read(tmp_path / "study.toml").plan
    Recorder(plan, tmp_path / "out", ranks=1)
    record = read_run(tmp_path / "out" / "run.json")
    fat, muscle = (record.laws["mine"][tissue] for tissue in ("fat", "muscle"))
    assert fat.given == {"law": "mooney-rivlin", "c10": "2 kPa", "c01": "1 kPa", "d1": "1e-5 1/Pa"}
    assert (fat.mu, fat.alpha, fat.d1) == ((4e-3, 2e-3), (2.0, -2.0), 10.0)
    assert muscle.given["c1"] == "1 psi"
    assert muscle.mu == pytest.approx((6.894757293168e-3 / 2,))
    assert record.laws["mine"]["skin"].given is None
    # The run's own file repeats it, and it has the fingerprint of the law as it is used.
    assert Study.read(tmp_path / "out" / "run.json").plan.fingerprints == plan.fingerprints
    used = STUDY.replace(
        '"mooney-rivlin", c10 = "2 kPa", c01 = "1 kPa", d1 = "1e-5 1/Pa"',
        '"ogden", mu = ["4 kPa", "2 kPa"], alpha = [2, -2], d1 = "10 1/MPa"',
    )
    (tmp_path / "study.toml").write_text(used)
    assert Study.read(tmp_path / "study.toml").plan.fingerprints == plan.fingerprints


def test_what_was_given_must_be_plain(tmp_path):
    path = tmp_path / "law.toml"
    path.write_text('law = "yeoh"\nc10 = "1 kPa"\n[given]\nwhen = 2026-01-01\n')
    with pytest.raises(InputError, match="given: it must have texts, numbers"):
        read_material(path)
