"""Limbs of many levels: their file, and a study over them on one rank, two and three."""

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
import tiny_levels
from phantom import HEIGHT, Phantom
from tiny_levels import SHARES

import calfsocket as cs
from calfsocket import cli
from calfsocket.imaging.levels import levels_of
from calfsocket.io.errors import InputError
from calfsocket.meshes.levels import LimbLevels
from calfsocket.study.study import Study

PARTS = ("skin", "tibia", "fibula")
NAMES = [f"tight@level={share:.3f}_combined" for share in SHARES]


def test_the_file_of_a_limb_gives_it_back(tmp_path: Path) -> None:
    limb = tiny_levels.levels()
    limb.write(tmp_path / "mine.json")
    assert LimbLevels.read(tmp_path / "mine.json") == limb
    listed = json.loads((tmp_path / "mine.json").read_text())
    assert listed["levels"][1] == {"height": 0.4, "height_mm": 16.0, "file": "mine_0.400.json"}


def test_the_command_and_the_class_make_the_same_levels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = Phantom().write(tmp_path, *PARTS)
    words = ["limb", *map(str, paths), "--tissues", "lumped", "--out", str(tmp_path / "my.json")]
    assert cli.main([*words, "--levels", "0:0.8:3"]) == 0
    shown = capsys.readouterr().out
    assert "left out: skin.stl, tibia.stl, fibula.stl, level 0: " in shown
    assert "2 levels are listed in" in shown
    read = cs.LimbLevels.read(tmp_path / "my.json")
    assert [level.file for level in read.levels] == ["my_0.400.json", "my_0.800.json"]
    assert [level.height_mm for level in read.levels] == pytest.approx(
        [0.4 * HEIGHT, 0.8 * HEIGHT], abs=0.1
    )
    assert [each.height for each in read.refused] == [0.0]
    assert "does not meet the skin" in read.refused[0].reason
    made = cs.LimbLevels.from_surface(*paths, levels=[0.8, 0, 0.4], tissues="lumped")
    assert [dict(limb) for limb in made.limbs] == [dict(limb) for limb in read.limbs]
    assert made.refused == read.refused


@pytest.mark.parametrize(
    ("shares", "says"),
    [
        ("0.2:0.8", "FROM:TO:N"),
        ("0.2:0.8:201", "a number of 2 to 200"),
        ("0.3:0.3:4", "two are closer than 0.001 of the height"),
        ([0.2, 1.4], "between 0"),
        ([], "give 1 to 200"),
    ],
)
def test_levels_that_cannot_be(shares: str | list[float], says: str) -> None:
    with pytest.raises(InputError, match=says):
        levels_of(shares)


def test_levels_from_above_are_those_from_below() -> None:
    assert levels_of("0.8:0.2:4") == levels_of("0.2:0.8:4") == levels_of([0.2, 0.4, 0.6, 0.8])


# -- a study over them -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("levels")
    path = tiny_levels.write_study(folder)
    out = folder / "results"
    assert cli.main(["run", str(path), "--out", str(out), "--no-report", "--no-pictures"]) == 0
    return out


def test_a_study_has_a_case_for_each_level(solved: Path) -> None:
    cases = pd.read_csv(solved / "cases.csv")
    assert cases.case.tolist() == NAMES
    assert cases.level.tolist() == list(SHARES)
    for name in ("summary.csv", "levels.csv", "contact.csv", "cases.csv"):
        table = pd.read_csv(solved / name)
        of_level = table.groupby("level").height_mm.unique().explode()
        assert of_level.to_dict() == pytest.approx({s: tiny_levels.HEIGHT * s for s in SHARES})


def test_results_know_their_level(solved: Path) -> None:
    results = cs.load_results(solved)
    assert [record.level.height for record in results.records.values()] == list(SHARES)
    assert results.summary.level.unique().tolist() == list(SHARES)
    assert results.summary.columns[:4].tolist() == ["socket", "material_set", "level", "height_mm"]


def test_a_section_at_one_level_gives_the_same_as_the_study(solved: Path) -> None:
    study = Study.read(solved.parent / "study.toml")
    case = study.cases[1]
    alone = cs.Simulation(case.limb, case.socket, case.materials, mesh_size="coarse").solve()
    mine = cs.load_results(solved)[case.key]
    assert alone.summary().equals(mine.summary())


def test_a_run_is_repeated_from_its_record_alone(solved: Path, tmp_path: Path) -> None:
    study = Study.read(solved / "run.json")
    assert [case.name for case in study.cases] == NAMES
    assert study.plan.fingerprints == Study.read(solved.parent / "study.toml").plan.fingerprints


def test_what_is_solved_is_kept_and_the_rest_is_resumed(solved: Path, tmp_path: Path) -> None:
    path = tiny_levels.write_study(tmp_path)
    out = tmp_path / "results"
    study = Study.read(path)
    study.changed(chosen=NAMES[1:3]).run(out=out, pictures=False)
    before = (out / NAMES[1] / "result.json").stat().st_mtime_ns
    study.run(out=out, pictures=False, resume=True)
    assert (out / NAMES[1] / "result.json").stat().st_mtime_ns == before
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        assert (out / name).read_bytes() == (solved / name).read_bytes()


@pytest.mark.parametrize("ranks", [2, 3])
def test_any_number_of_ranks_gives_the_same(
    solved: Path, ranks: int, mpirun: Callable[..., str], tmp_path: Path
) -> None:
    words = ["-m", "calfsocket", "run", solved.parent / "study.toml", "--no-report"]
    mpirun(ranks, [*words, "--no-pictures", "--out", f"r{ranks}"])
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        assert (tmp_path / f"r{ranks}" / name).read_bytes() == (solved / name).read_bytes()


def test_check_lists_levels_in_a_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = tiny_levels.STUDY + "[sweep.grid]\nmodel.friction = [0.0, 0.4]\n"
    assert cli.main(["check", str(tiny_levels.write_study(tmp_path, text))]) == 0
    shown = capsys.readouterr().out
    for share in SHARES:
        assert f"tight@level={share:.3f}@friction=0.4_combined" in shown
