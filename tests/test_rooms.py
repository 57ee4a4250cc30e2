"""The rooms of the package: a room imports only from rooms below it, and nothing in a circle."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from calfsocket import __all__ as PUBLIC_NAMES

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "calfsocket"

FLOORS = (
    ("io",),
    ("parallel", "forms", "meshes", "uncertainty"),
    ("materials", "imaging"),
    ("contact",),
    ("mechanics",),
    ("export", "postprocess"),
    ("plotting",),
    ("simulation",),
    ("fit", "calibration", "study"),
    ("report",),
    ("paper",),
    ("verification",),
    ("commands",),
    ("cli",),
    ("__main__",),
)
"""From the ground up, as in docs/architecture.md. Rooms of one floor do not know each other."""

FLOOR_OF = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
MOST_NAMES = 22


def module_files() -> dict[str, Path]:
    """Return every module of the package by its dotted name."""
    found = {}
    for folder in (PACKAGE, REPOSITORY / "forms", REPOSITORY / "meshes"):
        base = REPOSITORY if folder == PACKAGE else folder.parent
        for path in folder.rglob("*.py"):
            parts = path.relative_to(base).with_suffix("").parts
            parts = parts if folder == PACKAGE else ("calfsocket", *parts)
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = path
    return found


def imports_of(path: Path, known: dict[str, Path]) -> set[str]:
    """Return the modules of the package that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: a relative import"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (names & known.keys()) or {node.module}
    return {name for name in found if name in known and name != "calfsocket"}


def room(module: str) -> str:
    return module.split(".")[1]


@pytest.fixture(scope="module")
def arrows() -> dict[str, set[str]]:
    known = module_files()
    return {name: imports_of(path, known) for name, path in known.items() if name != "calfsocket"}


def test_every_room_has_a_floor(arrows):
    assert {room(name) for name in arrows} == FLOOR_OF.keys()


def test_no_import_leads_up_or_across(arrows):
    wrong = [
        f"{name} imports {target}"
        for name, targets in arrows.items()
        for target in sorted(targets)
        if room(target) != room(name) and FLOOR_OF[room(target)] >= FLOOR_OF[room(name)]
    ]
    assert wrong == []


def test_no_import_circle(arrows):
    TopologicalSorter(arrows).prepare()  # raises CycleError, which names the modules


def test_few_names_at_the_top():
    names = {path.name for path in PACKAGE.iterdir() if path.name != "__pycache__"}
    assert len(names) <= MOST_NAMES


def test_public_names_are_where_they_are_said_to_be():
    import calfsocket

    for name in PUBLIC_NAMES:
        value = getattr(calfsocket, name)
        assert value.__name__ == name
        assert value.__doc__, f"{name} has no docstring"
