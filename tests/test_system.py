"""What an installation by pip needs of the system, and the line that says what is missing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from calfsocket.io.errors import CalfsocketError
from calfsocket.io.system import compiler_needed


def test_a_missing_compiler_is_named_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-compiler -O2")
    with pytest.raises(CalfsocketError, match=r"no-compiler: No such file.*apt-get") as caught:
        with compiler_needed():
            raise RuntimeError("cffi gave up")
    assert str(caught.value.__cause__) == "cffi gave up"


def test_missing_headers_of_python_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sysconfig.get_path", lambda _: "/nowhere")
    with pytest.raises(CalfsocketError, match=r"Python\.h: No such file.*python3-dev"):
        with compiler_needed():
            raise RuntimeError


def test_where_all_is_there_an_error_stays_what_it_is() -> None:
    with pytest.raises(ZeroDivisionError), compiler_needed():
        raise ZeroDivisionError


def test_gmsh_is_compiled_once_and_kept_where_the_user_may_write(tmp_path: Path) -> None:
    program = "import sys; from calfsocket.io import system; print(sys.pycache_prefix)"
    environment = os.environ | {"XDG_CACHE_HOME": os.fspath(tmp_path)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{os.environ.get('PYTHONPYCACHEPREFIX')}\n"
    (kept,) = (tmp_path / "calfsocket" / "python").rglob("gmsh.*.pyc")
    assert kept.stat().st_size > 100_000


def test_missing_libraries_of_gmsh_are_said_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open')")
    search = os.pathsep.join([str(tmp_path), str(Path(__file__).resolve().parent.parent)])
    done = subprocess.run(
        [sys.executable, "-m", "calfsocket", "--out", tmp_path / "results"],
        env=os.environ | {"PYTHONPATH": search},
        capture_output=True,
        text=True,
    )
    (line,) = done.stderr.splitlines()
    assert line.startswith("calfsocket: gmsh cannot be loaded: libGLU.so.1: cannot open; ")
    assert "libglu1-mesa" in line and done.returncode == 1
