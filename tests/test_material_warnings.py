"""Laws that can be used but perhaps should not be: said by `check`, by a run and in Python."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from report_text import written
from scipy.optimize import brentq

from calfsocket import cli
from calfsocket.io.errors import InputError
from calfsocket.materials import tissues
from calfsocket.materials.law import Law, PositiveStress, deviatoric
from calfsocket.materials.laws import Ogden, Yeoh, material_law
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.materials.stability import stable_ranges, tangents
from calfsocket.materials.warnings import MaterialWarning
from calfsocket.materials.warnings import warnings as law_warnings
from calfsocket.simulation.results import Results
from calfsocket.study.study import Study

STUDY = '[study]\nsockets = ["TSB"]\nmaterials = ["mine"]\n[materials.mine]\nfat = {{ {} }}\n'
SOFTENS = 'law = "ogden", mu = ["-14.0 kPa", "17 kPa"], alpha = [-3.3, 5.1], nu = 0.495'
OTHER_FORM = (
    'law = "ogden", mu = ["6.3 kPa", "0.012 kPa", "-0.1 kPa"], alpha = [1.3, 5.0, -2.0], nu = 0.495'
)


def checked(folder: Path, law: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Warnings of `check` for this law of fat."""
    path = folder / "study.toml"
    path.write_text(STUDY.format(law))
    assert cli.main(["check", str(path)]) == 0
    output, errors = capsys.readouterr()
    assert errors == ""
    return [line for line in output.splitlines() if line.startswith("warning: ")]


def test_check_names_law_deformation_and_stretch(tmp_path, capsys):
    stability, form = checked(tmp_path, SOFTENS, capsys)
    assert stability.startswith(
        "warning: materials.mine.fat: loses stability (Drucker) in uniaxial"
    )
    assert "planar tests below stretch 0.96 and above stretch 1.04" in stability
    assert "load steps may fail" in stability
    # Its moduli are those of a stable law in the other form.
    assert '66.45 kPa with form = "textbook"' in form
    assert checked(tmp_path, SOFTENS + ', form = "textbook"', capsys) == []
    (alone,) = checked(tmp_path, SOFTENS + ', form = "abaqus"', capsys)
    assert alone == stability


def test_what_is_unstable_at_small_strain_is_refused(tmp_path, capsys):
    """Its initial modulus is 1.3 kPa, but 2 % of strain are too much for it."""
    law = SOFTENS.replace("-14.0", "-15.7")
    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(law))
    assert cli.main(["check", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "fat: loses stability (Drucker) at small strain, in uniaxial tests below" in line
    assert '69.25 kPa with form = "textbook"' in line and "write the form" in line
    with pytest.raises(InputError, match=r"soleus: loses .* at small strain"):
        MaterialSet.paper("separate").replace(
            soleus=Ogden(mu=(-15.7e-3, 17e-3), alpha=(-3.3, 5.1), nu=0.495, form="abaqus")
        )
    assert checked(tmp_path, law + ', form = "textbook"', capsys) == []


# By hand: 6.3 + 0.012 - 0.1 kPa; (6.3 x 1.3 + 0.012 x 5 + 0.1 x 2)/2 kPa.
def test_the_form_is_asked_for_where_signs_are_those_of_another(tmp_path, capsys):
    beyond, form = checked(tmp_path, OTHER_FORM, capsys)
    assert '4.225 kPa with form = "textbook"' in form and '6.212 kPa with "abaqus"' in form
    assert "write the form" in form
    # Softening far outside is said for what it is.
    assert "no socket is expected to impose" in beyond and "fail" not in beyond
    for chosen in ("textbook", "as-printed"):
        assert checked(tmp_path, f'{OTHER_FORM}, form = "{chosen}"', capsys) == []


def test_signs_that_say_nothing_are_not_asked_about():
    for law in (
        Ogden(mu=(1.0, -0.1), alpha=(3.0, 2.0), nu=0.4),
        Ogden(mu=(1.0, 0.1), alpha=(3.0, -2.0), nu=0.4),
        material_law("mooney-rivlin", c10=1.0, c01=-0.1, nu=0.4),
        Ogden(c=(1.0, -0.1), m=(3.0, -2.0), nu=0.4),
    ):
        assert not law.doubt


@pytest.mark.parametrize("base", BASE_SETS)
@pytest.mark.parametrize("form", ["abaqus", "as-printed"])
def test_no_law_of_the_paper_is_doubted(base, form):
    assert MaterialSet.paper(base, ogden_form=form).warnings == ()


def test_python_warns_where_the_set_is_made():
    law = Ogden(mu=(-14e-3, 17e-3), alpha=(-3.3, 5.1), nu=0.495, form="abaqus")
    paper = MaterialSet.paper("separate")
    with pytest.warns(MaterialWarning, match="material set separate: fat: loses stability"):
        changed = paper.replace(fat=law)
    assert [name for name, _ in changed.warnings] == ["fat"]
    with pytest.warns(MaterialWarning, match="soleus: loses stability"):
        paper.replace(soleus=law)


def test_a_study_says_it_once(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(SOFTENS).replace('"TSB"', '"TSB", "HS"'))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(Study.read(path).plan.warnings) == 2


def test_a_slip_of_the_unit_of_d1_is_said():
    law = Ogden(mu=("1.7 kPa",), alpha=(26.0,), d1="11.8 1/kPa")  # for 1.18e-5 1/Pa
    (said,) = law_warnings(law)
    # K = 2/11.8 = 0.1695 kPa: (3 K - 2 mu)/(6 K + 2 mu) = -2.892/4.417.
    assert said.startswith("Poisson's ratio at small strain is -0.65:")
    assert "check d1, k or nu" in said
    assert law_warnings(tissues.FAT) == []


def test_an_exponent_beyond_those_that_the_forms_take_is_said():
    (said,) = law_warnings(Ogden(mu=(1e-3,), alpha=(-150.0,), nu=0.4))
    assert said.startswith("an exponent is -150")
    assert law_warnings(Ogden(mu=(1e-3,), alpha=(100.0,), nu=0.4)) == []


class Softening(Law):
    """A custom law that takes real stretches only: mu sum_k (1 - cos ln lb_k)."""

    law: str = "softening"
    mu: PositiveStress

    @property
    def initial_shear_modulus(self):
        return self.mu / 2

    def coefficients(self):
        return (self.mu,)

    @staticmethod
    def energy_form(x, J, coefficients):
        raise NotImplementedError("not solved here")

    def energy(self, stretches):
        return self.mu * np.sum(1 - np.cos(np.log(deviatoric(stretches))), axis=0)


# With f'' = mu cos(e), det D = f1'' (f1'' + 2 f3'') in equibiaxial tension, where e3 = -2 e1; in
# uniaxial tension f2'' + 2 f1'' is positive up to the end of what is scanned.
def test_a_law_without_complex_stress_is_scanned_too():
    ranges = {r.mode: r for r in stable_ranges(Softening(mu=2.0))}
    e = brentq(lambda e: np.cos(e) + 2 * np.cos(2 * e), 0.5, 1.3)
    assert ranges["equibiaxial"].high == pytest.approx(np.exp(e), rel=1e-6)
    assert ranges["uniaxial"].high is None


class Locking(Softening):
    """Gent's law, which has no energy where I1 - 3 is beyond 1: in planar tests above 1.618."""

    def energy(self, stretches):
        return -self.mu / 2 * np.log(4 - np.sum(deviatoric(stretches) ** 2, axis=0))


def test_a_law_is_scanned_where_it_is_defined():
    law = Locking(mu=1.0)
    assert np.isfinite(tangents(law, "planar", [1.617, 1.619])).tolist() == [
        [True] * 2,
        [False] * 2,
    ]
    assert not any(r.words for r in stable_ranges(law))


def test_stiff_and_soft_yeoh():
    assert law_warnings(Yeoh(c10=1.0, c20=0.1)) == []
    (said,) = law_warnings(Yeoh(c10=1.0, c20=-1.0, c30=0.4))
    assert "loses stability" in said


def test_the_report_repeats_what_makes_one_doubt_a_law(six_results, tmp_path):
    law = material_law("ogden", mu=[-14e-3, 17e-3], alpha=[-3.3, 5.1], nu=0.495)
    run = six_results.run
    doubted = {**run.laws, "separate": {**run.laws["separate"], "fat": law}}
    run = run.model_copy(update={"laws": doubted})
    one = six_results.only([("TC", "separate")])

    def text(run):
        return written(Results(tmp_path, run, one.records, lambda record: one[record.key])).text

    told, doubts = text(run), law_warnings(law)
    assert len(doubts) == 2
    assert all(f"\nSeparate set, fat: {doubt}.\n" in told for doubt in doubts)
    assert "doubt a law" not in text(six_results.run)
