"""Tutorials and the README's example run; what the documentation lists is complete."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
import pytest
from phantom import Phantom
from socket_phantom import GAP, SocketPhantom, elsewhere

import calfsocket
from calfsocket import cli

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


def test_a_scan(in_folder: Path) -> None:
    """The commands and the study file of the page, as they stand there, on the phantom."""
    Phantom(noise=0.1).write_one(in_folder / "leg.stl", "skin", "tibia", "fibula")
    elsewhere(SocketPhantom(Phantom(), noise=0.1)).write(in_folder / "socket.stl")
    page = (DOCS / "tutorials" / "a_scan.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(sh|toml)\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)
    for kind, text in blocks:
        if kind == "toml":
            (in_folder / "study.toml").write_text(text)
            continue
        for line in text.splitlines():
            python, m, program, *words = shlex.split(line)
            assert (python, m, program) == ("python3", "-m", "calfsocket")
            assert cli.main(words) == 0
    made = calfsocket.Socket.read(in_folder / "my-socket.json")
    assert isinstance(made, calfsocket.Sections) and made.source is not None
    assert f"{made.source.gap_mm:.2f} +- {made.source.gap_error_mm:.1f} mm" in page
    assert abs(made.source.gap_mm - GAP) < made.source.gap_error_mm
    results = calfsocket.load_results(in_folder / "results")
    means = [result.contact_levels["contact_pressure_mean"].value for result in results.values()]
    assert [round(mean) for mean in means] == [26, 25, 23]
    assert {path.suffix for path in (in_folder / "results" / "pressure_maps").iterdir()} == {
        ".csv", ".png", ".vtp",
    }  # fmt: skip


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
