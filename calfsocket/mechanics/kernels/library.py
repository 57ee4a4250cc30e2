"""The laws and the loops over cells in C: compiled once by cffi, as the forms are by FFCx."""

import hashlib
import importlib.util
import inspect
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

from calfsocket.forms import hencky, kinematics, mixed, ogden, yeoh
from calfsocket.mechanics.kernels import laws as law_kernels

FOLDER = Path(__file__).parent
SOURCES = ("vectors.h", "cells.h", "internal_force.c", "condensation.c")
# What the laws are made of.
LAW_SOURCES = (law_kernels, mixed, hencky, ogden, yeoh, kinematics)
# Unlike -ffast-math these keep NaN, which tells a step that overshot.
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


def library(comm: MPI.Comm, ogden_terms: int) -> Library:
    """Return the compiled functions of the C files, for laws of so many terms (collective)."""
    return Library(jit.mpi_jit_decorator(_module)(comm, ogden_terms))


@cache
def _module(ogden_terms: int) -> Any:
    texts = [(FOLDER / name).read_text(encoding="utf-8") for name in SOURCES]
    laws = [inspect.getsource(module) for module in LAW_SOURCES]
    versions = [ffcx.__version__, str(ogden_terms)]
    key = hashlib.sha256(" ".join(texts + laws + versions + COMPILE_ARGUMENTS).encode())
    name = f"calfsocket_cells_{key.hexdigest()[:16]}"
    cache_dir = Path(jit.get_options()["cache_dir"])
    target = cache_dir / (name + sysconfig.get_config_var("EXT_SUFFIX"))
    if not target.exists():
        _compile(name, law_kernels.source(ogden_terms), "\n".join(texts), target)
    spec = importlib.util.spec_from_file_location(name, target)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _compile(name: str, laws: str, source: str, target: Path) -> None:
    """Compile beside the target and move it there: a process that looks finds it whole."""
    builder = cffi.FFI()
    builder.cdef("\n".join(_prototypes(source)))
    builder.set_source(
        name,
        "\n".join([laws, *(f'#include "{file}"' for file in SOURCES)]),
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
