"""The loops over cells in C: compiled once by cffi, as the forms are by FFCx."""

import hashlib
import importlib.util
import os
import re
import sysconfig
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import cffi
from dolfinx import jit
from mpi4py import MPI

SOURCE = Path(__file__).with_name("condensation.c")
COMPILE_ARGUMENTS = ["-O3", "-g0", "-fno-math-errno", "-fno-trapping-math"]


def library(comm: MPI.Comm) -> Any:
    """Return the compiled functions of condensation.c (collective)."""
    return jit.mpi_jit_decorator(_library)(comm)


@cache
def _library() -> Any:
    source = SOURCE.read_text(encoding="utf-8")
    key = hashlib.sha256((source + " ".join(COMPILE_ARGUMENTS)).encode()).hexdigest()[:16]
    name = f"calfsocket_cells_{key}"
    cache_dir = Path(jit.get_options()["cache_dir"])
    target = cache_dir / (name + sysconfig.get_config_var("EXT_SUFFIX"))
    if not target.exists():
        _compile(name, source, target)
    spec = importlib.util.spec_from_file_location(name, target)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compile(name: str, source: str, target: Path) -> None:
    """Compile beside the target and move it there: a process that looks finds it whole."""
    builder = cffi.FFI()
    builder.cdef("\n".join(_prototypes(source)))
    builder.set_source(name, source, extra_compile_args=COMPILE_ARGUMENTS)
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        os.replace(builder.compile(tmpdir=folder), target)


def _prototypes(source: str) -> list[str]:
    """Declare the functions that are not static."""
    found = re.findall(r"^((?:void|int) \w+\([^)]*\))\n\{", source, flags=re.MULTILINE)
    return [prototype + ";" for prototype in found]
