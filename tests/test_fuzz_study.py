"""Study files of random content: planned, or refused in one line, and nothing else."""

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from test_bad_input import GOOD

from calfsocket.io.errors import InputError
from calfsocket.mechanics.stepping import LoadSteps
from calfsocket.study import document
from calfsocket.study.files import Files
from calfsocket.study.study import Study

KEYS = sorted(
    {
        *document.Document.model_fields,
        *(key for table in (document.StudyTable, document.ModelTable, LoadSteps,
                            document.CaseTable, document.ThresholdTable)
          for key in table.model_fields),
        "grid", "like", "law", "outline", "file", "fat", "soleus", "mine", "TC", "separate", "mu",
        "alpha", "nu", "e", "base", "bumps", "wall_thickness", "modulus", "model.friction", "0", "",
    }
)  # fmt: skip
TEXTS = st.sampled_from(
    ["TC", "mine", "separate", "soft", "coarse", "1 mm", "-1 mm", "1 kPa", "5 %", "HS", "ogden",
     "hencky", "normal_offset", "circle_blend", "contact_pressure", "skin", "../x", "\n", "\x00"]
) | st.text(max_size=8)  # fmt: skip
VALUES = st.recursive(
    TEXTS | st.integers() | st.floats() | st.booleans(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=4), inner, max_size=4)
    ),
    max_leaves=12,
)
DOCUMENTS = st.dictionaries(
    st.sampled_from(sorted(document.Document.model_fields)), VALUES, max_size=5
)
FUZZ = settings(
    max_examples=200,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@pytest.fixture(scope="module")
def paper() -> Study:
    return Study.paper()


def plan_or_one_line(study) -> None:
    try:
        assert study().plan
    except InputError as error:
        assert str(error).isprintable()
        assert "study.toml: " in str(error)


@FUZZ
@given(content=DOCUMENTS)
@example(content={"study": {"sockets": ["TC"], "materials": ["separate"]}, "sweep": {"grid": {}}})
@example(content={"sweep": {"grid": {"model.friction": [float("nan"), float("nan")]}}})
@example(content={"cases": [{"socket": "TC", "materials": "separate", "set": {"": 1}}]})
@example(content={"cases": [{"socket": "TC", "materials": "separate", "set": {"model": {}}}]})
def test_any_content_is_planned_or_refused(content, paper, tmp_path):
    study = replace(paper, path=Path("study.toml"), content=content, files=Files(tmp_path))
    plan_or_one_line(lambda: study)


@FUZZ
@given(
    start=st.integers(0, len(GOOD)), length=st.integers(0, 30), instead=TEXTS | st.text(max_size=20)
)
def test_a_file_with_a_piece_replaced_is_planned_or_refused(start, length, instead, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        GOOD[:start] + instead + GOOD[start + length :], encoding="utf-8", errors="replace"
    )
    plan_or_one_line(lambda: Study.read(path))


REAL_NAMES = st.sampled_from(
    ["model.friction", "model.size", "sockets.mine.base", "sockets.mine.area_reduction",
     "sockets.mine.bumps", "materials.soft.fat.mu.0", "materials.soft.fat", "materials.soft.like",
     "materials.soft", "steps.first", "laws.fat", "laws", "steps"]
)  # fmt: skip
NAMES = REAL_NAMES | st.lists(st.sampled_from(KEYS), min_size=1, max_size=5).map(".".join)
SEVERAL = st.lists(VALUES | st.floats(0.01, 0.9), min_size=1, max_size=2)


@FUZZ
@given(
    grid=st.dictionaries(REAL_NAMES, SEVERAL, min_size=1, max_size=2)
    | st.dictionaries(NAMES, SEVERAL | VALUES, max_size=2),
    custom=st.dictionaries(NAMES, VALUES, max_size=1),
)
def test_any_change_is_planned_or_refused(grid, custom, paper, tmp_path):
    content = tomllib.loads(GOOD) | {"sweep": {"grid": grid}}
    content["study"] = {}
    content["cases"] = [{"socket": "mine", "materials": "soft", "set": custom}]
    study = replace(paper, path=Path("study.toml"), content=content)
    plan_or_one_line(lambda: study)
