"""calfsocket starts from the repository's root, after an editable install, and from a wheel."""

import ast
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

import calfsocket

REPOSITORY = Path(__file__).resolve().parent.parent
VERSION = f"calfsocket {calfsocket.__version__}"
# The whole way from installed names to installed data.
READ_DATA = """
import calfsocket.forms
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import Socket
from calfsocket.paper import guest, published
from calfsocket.report import templates, write
Limb.reference()
Socket.reference("HS")
published.claims(), published.checks()
for name in ("report.html", "table.html", "report.css"):
    templates.read(name)
templates.read("scoreboard.html", "calfsocket.paper.templates")
from calfsocket.study.study import example
example()
from calfsocket.verification import page
for name in (*page.SUBJECTS, "verification"):
    page.TEMPLATES.get_template(f"{name}.md")
"""


#: What the wheel of dolfinx brings, and what others have under another name.
DISTRIBUTION_OF = {
    **dict.fromkeys(
        "basix cffi dolfinx dolfinx_solver ffcx mpi4py numpy petsc4py ufl".split(),
        "dolfinx-solver-real",
    ),
    "PIL": "pillow",
    "pydantic_core": "pydantic",
    "vtkmodules": "vtk",
}

#: This environment's, or of the Python that made it without one.
PIP = (
    [sys.executable, "-m", "pip"]
    if find_spec("pip")
    else [f"{sys.base_exec_prefix}/bin/python3", "-m", "pip", "--python", sys.executable]
)
of_debian = pytest.mark.skipif(
    bool(find_spec("dolfinx_solver")),
    reason="calfsocket's packages are those of pip, which a new environment does not see",
)

#: What is not on PyPI; whatever needs it says so where it is missing.
DEBIANS_ALONE = {"getfem"}


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command that knows nothing of this checkout nor of the network."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    process = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env=environment | {"PIP_NO_INDEX": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
    )
    assert process.returncode == 0, process.stdout
    return process.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the checkout: building leaves artefacts behind."""
    copy = tmp_path_factory.mktemp("packaging") / "sources"
    made = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist")

    def left_out(folder: str, names: list[str]) -> set[str]:
        results = {name for name in names if name.startswith("results")}
        return made(folder, names) | (results if Path(folder) == REPOSITORY else set())

    shutil.copytree(REPOSITORY, copy, ignore=left_out)
    return copy


@pytest.fixture(scope="module")
def wheel(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder]
    run(*PIP, *build, sources, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    return wheel


def install(folder: Path, *what: str | Path) -> Path:
    """Make an environment that sees Debian's packages, install into it, return its Python."""
    venv = ["-m", "venv", "--without-pip", "--system-site-packages"]
    run(sys.executable, *venv, folder / "venv", cwd=folder)
    python = folder / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "--no-deps", "--no-build-isolation", *what, cwd=folder)
    return python


def test_pip_installs_what_is_imported_and_nothing_else(sources: Path) -> None:
    extras = tomllib.loads((sources / "pyproject.toml").read_text())["project"]
    solver = extras["optional-dependencies"]["solver"]
    imported = set()
    for folder in ("calfsocket", "forms", "meshes"):
        for path in (sources / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    imported |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    imported.add(node.module)
    top_level = {name.split(".")[0] for name in imported} - {"calfsocket"}
    foreign = top_level - sys.stdlib_module_names - DEBIANS_ALONE
    needed = {DISTRIBUTION_OF.get(name, name) for name in foreign}
    assert needed == {requirement.split()[0] for requirement in solver}


def test_from_the_repository_root(sources: Path) -> None:
    assert run(sys.executable, "-m", "calfsocket", "--version", cwd=sources).startswith(VERSION)
    run(sys.executable, "-c", READ_DATA, cwd=sources)


@of_debian
def test_from_elsewhere_after_an_editable_install(sources: Path, tmp_path: Path) -> None:
    python = install(tmp_path, "--editable", sources)
    assert run(python, "-m", "calfsocket", "--version", cwd=tmp_path).startswith(VERSION)
    assert run(tmp_path / "venv/bin/calfsocket", "--version", cwd=tmp_path).startswith(VERSION)
    run(python, "-c", READ_DATA, cwd=tmp_path)
    where = "import calfsocket.meshes as m; print(m.__file__)"
    assert Path(run(python, "-c", where, cwd=tmp_path).strip()) == sources / "meshes/__init__.py"


@of_debian
def test_from_a_wheel(wheel: Path, tmp_path: Path) -> None:
    python = install(tmp_path, wheel)
    assert run(python, "-m", "calfsocket", "--version", cwd=tmp_path).startswith(VERSION)
    run(python, "-c", READ_DATA, cwd=tmp_path)
    (site_packages,) = (tmp_path / "venv" / "lib").glob("python3*/site-packages")
    top_level = {path.name for path in site_packages.iterdir()}
    assert top_level == {"calfsocket", f"calfsocket-{calfsocket.__version__}.dist-info"}


def test_the_wheel_holds_every_module_and_data_file(sources: Path, wheel: Path) -> None:
    """A new subpackage that pyproject.toml does not name would be missing."""
    places = {
        "calfsocket": "calfsocket",
        "forms": "calfsocket/forms",
        "meshes": "calfsocket/meshes",
    }
    expected = {
        Path(place) / path.relative_to(sources / folder)
        for folder, place in places.items()
        for path in (sources / folder).rglob("*")
        if path.suffix in {".c", ".h", ".py", ".json", ".csv", ".html", ".css", ".toml"}
        or path.parent.name == "pages"
    }
    with zipfile.ZipFile(wheel) as archive:
        packed = {Path(name) for name in archive.namelist() if "dist-info" not in name}
    assert packed == expected


def test_the_wheel_carries_both_licences(wheel: Path) -> None:
    """LGPL 3 is a set of permissions added to GPL 3: one is incomplete without the other."""
    with zipfile.ZipFile(wheel) as archive:
        texts = {Path(n).name: archive.read(n) for n in archive.namelist() if "/licenses/" in n}
    assert b"GNU LESSER GENERAL PUBLIC LICENSE" in texts["LICENSE"]
    assert b"GNU GENERAL PUBLIC LICENSE" in texts["LICENSE.GPL"]
