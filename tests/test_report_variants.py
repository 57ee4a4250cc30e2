"""Variants: which studies they are, and how their results are compared."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import InputError
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import reference_sockets
from calfsocket.report import variants
from calfsocket.report.scoreboard import HOLDS, UNCHECKED
from calfsocket.simulation.case import Case, Settings
from calfsocket.study import variants as family
from calfsocket.study.study import Study
from report_results import ALL, contact_on, limb, limb_study, write_results


def study(settings: Settings) -> Study:
    return Study(
        (Case("TC", "separate"),),
        settings,
        Limb.reference(),
        reference_sockets(),
        Path("out"),
        pictures=False,
    )


def test_one_choice_is_changed_at_a_time():
    base, *others = family.studies(study(Settings(size="coarse")))
    assert base.out == Path("out/variants/base") and base.settings == Settings(size="coarse")
    changed = {
        each.out.name: {
            key
            for key in ("size", "socket_support", "fascia_c10", "ogden_form", "contact")
            if getattr(each.settings, key) != getattr(base.settings, key)
        }
        for each in others
    }
    assert changed == {
        "socket-held": {"socket_support"},
        "fascia-c10-tables": {"fascia_c10"},
        "frictionless": {"contact"},
        "ogden-as-printed": {"ogden_form"},
        "socket-held-and-fascia-c10-tables": {"socket_support", "fascia_c10"},
    }
    frictionless = {each.out.name: each.settings.contact for each in others}["frictionless"]
    assert frictionless == Contact(friction=0.0)
    assert all(each.cases == base.cases and each.limb is base.limb for each in others)


def test_a_choice_already_made_is_no_variant():
    settings = Settings(contact=Contact(friction=0.0))
    names = [each.out.name for each in family.studies(study(settings))]
    assert "frictionless" not in names and len(names) == 5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """TC as base; with twice the stress in muscle; with one case failed; and not readable."""
    out = tmp_path_factory.mktemp("study")
    base = limb_study(ALL[:2])
    write_results(out / "variants" / "base", base)
    doubled = {}
    for key, (fields, line) in base.items():
        muscle = np.where(fields.region == 2, 2.0, 1.0)[:, None, None]
        doubled[key] = (replace(fields, stress=muscle * fields.stress), line)
    write_results(
        out / "variants" / "fascia-c10-tables",
        doubled,
        Settings(size="coarse", fascia_c10="tables"),
    )
    write_results(
        out / "variants" / "socket-held",
        {("TC", "separate"): base["TC", "separate"]},
        Settings(size="coarse", socket_support="outer-fixed"),
        failed={"TC_combined": "load 0.4 and no further"},
    )
    broken = out / "variants" / "frictionless"
    write_results(broken, {("TC", "separate"): (limb(), contact_on(limb(), 5))})
    (broken / "summary.csv").unlink()
    return out


@pytest.fixture(scope="module")
def tables(folder: Path) -> dict[str, pd.DataFrame]:
    made = variants.build(variants.read_variants(folder))
    return {table.name: table.data for table in made}


def test_choices_and_counts(tables):
    rows = tables["variants"].set_index("variant")
    assert rows.index.tolist() == ["base", "fascia-c10-tables", "socket-held"]
    assert rows.choice["fascia-c10-tables"] == "fascia_c10 tables"
    assert "friction 0.4" in rows.choice["base"]
    assert rows.cases.tolist() == [2, 2, 1]
    assert (rows[["holds", "does not hold", UNCHECKED]].sum(axis=1) == 105).all()


def test_claims_under_each_variant(tables):
    rows = tables["claims_by_variant"].set_index("id")
    assert len(rows) == 105
    assert rows.loc["C024", ["base", "fascia-c10-tables"]].tolist() == [HOLDS, "does not hold"]
    assert not rows.same["C024"] and rows.same["C023"]
    assert rows["socket-held"]["C054"] == UNCHECKED


def test_dependence_on_a_choice(tables):
    rows = tables["dependence"].set_index(["tissue", "outcome", "material_set", "variant"])
    muscle = rows.loc[("muscle", "effective_stress", "combined", "fascia-c10-tables")]
    assert muscle["median"] == pytest.approx(2) and not muscle.robust
    assert muscle.low == pytest.approx(2) and muscle.high == pytest.approx(2)
    skin = rows.loc[("skin", "effective_stress", "separate", "fascia-c10-tables")]
    assert skin["median"] == pytest.approx(1) and skin.robust
    assert "base" not in rows.index.get_level_values("variant")


def test_tables_are_written_and_say_what_is_left_out(folder):
    place = folder / "tables"
    for table in variants.build(variants.read_variants(folder)):
        table.write(place)
    assert {path.name for path in place.glob("*.md")} == {
        "variants.md",
        "claims_by_variant.md",
        "dependence.md",
    }
    text = (place / "variants.md").read_text()
    assert "frictionless is left out" in text and "summary.csv" in text
    assert "C023" not in (place / "claims_by_variant.md").read_text()
    assert "×2.00 (2.00 to 2.00) *" in (place / "dependence.md").read_text()  # noqa: RUF001


def test_a_folder_without_variants_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no base; solve the study with --variants first"):
        variants.read_variants(tmp_path)


@pytest.mark.slow
def test_variants_from_the_command_line(mpirun: Callable[..., str], tmp_path: Path):
    words = ["-m", "calfsocket", "--size", "coarse", "--sockets", "TSB", "--materials", "combined"]
    mpirun(2, [*words, "--variants", "--no-pictures"], timeout=900)
    base = tmp_path / "results" / "variants" / "base"
    assert 'id="claims_by_variant"' in (base / "report.html").read_text()
    rows = pd.read_csv(base / "tables" / "variants.csv")
    assert len(rows) == 6 and (rows.cases == 1).all()
