"""What is the system's: a folder for what is kept, a C compiler, and the libraries of gmsh."""

import os
import shlex
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy  # noqa: F401  # before gmsh, with which it would be kept, too

from calfsocket.io.errors import CalfsocketError


def cache_folder() -> Path:
    """Folder for what need not be made again, under the user's cache directory."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "calfsocket"


@contextmanager
def _bytecode_kept() -> Iterator[None]:
    """Keep what Python compiles of a module in the user's cache.

    Debian compiles nothing of gmsh ahead, and a user may not write beside it: Python would compile
    its 400 kB at every start.
    """
    before = sys.pycache_prefix
    with suppress(RuntimeError):  # no home
        sys.pycache_prefix = str(cache_folder() / "python")
    try:
        yield
    finally:
        sys.pycache_prefix = before


try:
    with _bytecode_kept():
        import gmsh as gmsh
except OSError as error:  # its wheel is linked with those of a desktop
    raise CalfsocketError(
        f"gmsh cannot be loaded: {error}; it needs libraries of a desktop, in Debian 13: "
        "apt-get install libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1; "
        "docs/getting-started.md has a way without root"
    ) from error

_MISSING = (
    "the forms cannot be compiled: {reason}; a C compiler and the headers of Python are needed, in "
    "Debian 13: apt-get install gcc libc6-dev python3-dev; another compiler is named by CC"
)


@contextmanager
def compiler_needed() -> Iterator[None]:
    """Where the body fails and nothing can be compiled here, say so and what to install."""
    try:
        yield
    except Exception as error:
        reason = _cannot_compile()
        if reason is None:
            raise
        raise CalfsocketError(_MISSING.format(reason=reason)) from error


def _cannot_compile() -> str | None:
    """Return why the smallest module of Python cannot be compiled; None if it can."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    include = sysconfig.get_path("include")
    try:
        done = subprocess.run(
            [*compiler, f"-I{include}", "-x", "c", "-c", "-o", os.devnull, "-"],
            input="#include <Python.h>\n",
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError as error:
        return f"{compiler[0]}: {error.strerror}"
    if done.returncode == 0:
        return None
    lines = [line for line in done.stderr.splitlines() if "error" in line]
    return lines[0].strip() if lines else f"{compiler[0]} ends with {done.returncode}"
