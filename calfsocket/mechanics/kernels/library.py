"""The loops over cells in C: compiled once a law by cffi, as the forms are by FFCx.

A law of another kind has a library of its own, so that a problem uses those of its laws, whatever
laws others have.
"""

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
import ffcx
import numpy as np
from dolfinx import jit
from mpi4py import MPI

from calfsocket.materials.fields import Kind
from calfsocket.mechanics.kernels.laws import LawKernel, signature

FOLDER = Path(__file__).parent
SOURCES = ("vectors.h", "cells.h", "internal_force.c", "condensation.c")
# Unlike -ffast-math these keep NaN, which reveals a step that overshot.
COMPILE_ARGUMENTS = [
    "-O3",
    "-g0",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-fassociative-math",
    "-freciprocal-math",
    "-Wno-psabi",  # vectors are handed over within one file alone
]
JIT_OPTIONS = {"cffi_extra_compile_args": COMPILE_ARGUMENTS}
"""For forms that FFCx compiles alone; they halve the time of a tangent."""

_C_TYPES = {
    np.dtype(np.float64): "double[]",
    np.dtype(np.int32): "int32_t[]",
    np.dtype(np.int64): "int64_t[]",
    np.dtype(np.uint8): "uint8_t[]",
}


class Library:
    """Compiled functions, which take arrays as they are.

    Parameters
    ----------
    module : module
        As cffi makes it.
    """

    def __init__(self, module: Any) -> None:
        self._lib, self._ffi = module.lib, module.ffi

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function: an array, which has to be contiguous, is its address, None is NULL."""
        return getattr(self._lib, name)(*map(self._argument, arguments))

    def _argument(self, argument: Any) -> Any:
        if argument is None:
            return self._ffi.NULL
        if not isinstance(argument, np.ndarray):
            return argument
        assert argument.flags.c_contiguous
        return self._ffi.from_buffer(_C_TYPES[argument.dtype], argument)


def library(comm: MPI.Comm, kind: Kind) -> Library:
    """Return the compiled functions of the C files for a kind of law (collective)."""
    return Library(jit.mpi_jit_decorator(_module)(comm, kind))


@cache
def _module(kind: Kind) -> Any:
    files = [(FOLDER / name).read_text(encoding="utf-8") for name in (*SOURCES, "laws.py")]
    parts = [*files, signature(kind), ffcx.__version__, *COMPILE_ARGUMENTS]
    name = f"calfsocket_cells_{hashlib.sha256(' '.join(parts).encode()).hexdigest()[:16]}"
    cache_dir = Path(jit.get_options()["cache_dir"])
    target = cache_dir / (name + sysconfig.get_config_var("EXT_SUFFIX"))
    if not target.exists():
        _compile(name, LawKernel(kind).source(), "\n".join(files[:-1]), target)
    spec = importlib.util.spec_from_file_location(name, target)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compile(name: str, law: str, source: str, target: Path) -> None:
    """Compile beside the target and move it there: a process that looks finds it whole."""
    builder = cffi.FFI()
    builder.cdef("\n".join(_prototypes(source)))
    builder.set_source(
        name,
        "\n".join([law, *(f'#include "{file}"' for file in SOURCES)]),
        include_dirs=[str(FOLDER)],
        extra_compile_args=COMPILE_ARGUMENTS,
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        os.replace(builder.compile(tmpdir=folder), target)


def _prototypes(source: str) -> list[str]:
    """Declare the functions that are not static."""
    found = re.findall(r"^((?:void|int) \w+\([^)]*\))\n\{", source, flags=re.MULTILINE)
    return [prototype + ";" for prototype in found]
