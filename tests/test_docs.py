"""Tutorials and the README's example run; what the documentation lists is complete."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import pytest

import calfsocket

REPOSITORY = Path(__file__).resolve().parent.parent
DOCS = REPOSITORY / "docs"
KEY = ("socket", "material_set")
RESULTS_PAGE = DOCS / "formats" / "results.md"


def cells(page: Path) -> list[str]:
    """Code cells of a notebook, or of a page in MyST's text form of one."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        content = json.loads(text)["cells"]
        return ["".join(cell["source"]) for cell in content if cell["cell_type"] == "code"]
    found = re.findall(r"^```\{code-cell\}.*?\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    return [re.sub(r"\A(:.*\n)+", "", cell) for cell in found]


def run(code: str, page: Path) -> None:
    exec(compile(code, page, "exec"), {"__name__": "__main__"})


@pytest.fixture
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Work in a folder of the test's own, and close its figures."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    plt.close("all")


def test_one_case(in_folder: Path) -> None:
    page = DOCS / "tutorials" / "one_case.ipynb"
    run("\n".join(cells(page)), page)
    # The columns that the page on results lists are those of the files.
    (contact,) = in_folder.glob("results/*/contact.csv")
    assert [*columns("contact.csv"), "load"] == list(pd.read_csv(contact).columns)


def test_a_law(in_folder: Path) -> None:
    page = DOCS / "tutorials" / "a_law.md"
    run("\n".join(cells(page)), page)


def test_a_sweep(in_folder: Path) -> None:
    page = DOCS / "tutorials" / "a_sweep.md"
    run("\n".join(cells(page)), page)
    for name in ("summary.csv", "contact.csv", "steps.csv", "cases.csv"):
        table = pd.read_csv(in_folder / "results" / name, index_col=False)
        assert columns(name) == [column for column in table if column not in KEY]


def columns(name: str) -> list[str]:
    """Names in the first column of a section's table."""
    text = RESULTS_PAGE.read_text(encoding="utf-8")
    _, _, section = text.partition(f"## {name}\n")
    rows = re.findall(r"^\| (`.*?) \|", section.partition("\n## ")[0], flags=re.MULTILINE)
    return re.findall(r"`(\w+)`", " ".join(rows))


def test_readme_example(in_folder: Path) -> None:
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```$", readme, flags=re.DOTALL | re.MULTILINE)
    run(example, REPOSITORY / "README.md")
    assert (in_folder / "results" / "HS_separate" / "result.json").is_file()


def test_every_public_name_is_in_the_reference() -> None:
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^   (\w+)$", page, flags=re.MULTILINE)
    assert sorted(listed) == sorted(set(calfsocket.__all__) - {"__version__"})


def test_links_of_the_readme() -> None:
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", readme)
    assert targets
    assert [target for target in targets if not (REPOSITORY / target).exists()] == []
