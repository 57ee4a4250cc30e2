"""Compiled forms: kept in a separate cache, made once before ranks need them side by side."""

import fcntl
import hashlib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

import basix
import dolfinx
import ffcx
import numpy as np
import ufl
from dolfinx import jit
from mpi4py import MPI

import calfsocket
from calfsocket.io import system
from calfsocket.io.files import replacing
from calfsocket.io.system import compiler_needed
from calfsocket.materials.fields import Kind, kind
from calfsocket.materials.law import Law
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.materials.tissues import SOCKET
from calfsocket.mechanics.kernels.laws import signature
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.newton import Newton
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import contact_line, section_fields

_INNER, _SKIN, _OUTER = 10.0, 30.0, 32.0
# The socket overlaps the limb a little, so that contact is compiled as well.
_SOCKET = (31.9, 36.0)
_TIMEOUT_S = 600
"""How long a rank waits for another to compile; compiling takes some 10 s in all."""
_SOURCES = (
    "contact",
    "forms",
    "io/fenics.py",
    "materials",
    "mechanics",
    "postprocess",
    "simulation",
)
"""What says which forms there are, in the package."""
_COMPILED = "*.so"
"""Compiled forms in their folder."""


def cache_folder() -> Path:
    """Folder of the compiled forms, under the user's cache directory."""
    return system.cache_folder() / "fenics"


def precompile(
    comm: MPI.Comm, sets: Iterable[MaterialSet] | None = None, linings: Iterable[Law] = ()
) -> None:
    """Compile every form that cases need, unless that was done before (collective).

    Rank 0 compiles, under a lock against other processes of the same user. A form that is found
    half compiled while no other process uses the cache was left by one that was killed, and is
    thrown away; without that, dolfinx waits for it in vain.

    Which forms these are only their use says, which takes half a second: a file in their folder,
    `done_file`, says that it has been seen to.

    The material sets of the cases are the paper's unless given: each kind of law, and the one of
    the skin's surface, has forms of its own. A law of `linings` is that of a liner, whose surface
    meets the socket as the skin's does.
    """
    folder = cache_folder()
    jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = (folder, "calfsocket")
    jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (_TIMEOUT_S, "calfsocket")
    if comm.rank == 0:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / ".lock").open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            _throw_away_leftovers(folder)
            sets = map(MaterialSet.paper, BASE_SETS) if sets is None else sets
            for laws in [*_problems(sets), *([law] for law in linings)]:
                kinds = folder, *map(kind, laws)
                if kinds not in _compiled:
                    _compile(folder, laws)
                    _compiled.add(kinds)
    comm.Barrier()


_compiled: set[tuple[object, ...]] = set()
"""Folder and kinds of laws for which this process has used all forms."""

_used: dict[Path, IO[str]] = {}


def _compile(folder: Path, laws: Sequence[Law]) -> None:
    """Use all forms of laws, unless a process has done so and what it left is still there."""
    done = folder / done_file(laws)
    there = {path.name for path in folder.glob(_COMPILED)}
    if done.is_file() and there.issuperset(done.read_text(encoding="utf-8").split()):
        return
    with compiler_needed():
        _use_all_forms(laws)
    with replacing(done) as unfinished:
        names = sorted(path.name for path in folder.glob(_COMPILED))
        unfinished.write_text("\n".join(names), encoding="utf-8")


def done_file(laws: Sequence[Law]) -> str:
    """Name of the file that lists compiled forms, those of these laws among them.

    It changes with all that a form's name follows from: the laws, the sources of this package, the
    versions of the compilers and the options that they are given.
    """
    versions = [each.__version__ for each in (dolfinx, ufl, ffcx, basix, np)]
    options = {name: value for name, value in jit.get_options().items() if name != "cache_dir"}
    parts = [*versions, repr(sorted(options.items())), os.environ.get("CC", "")]
    parts += map(signature, map(kind, laws))
    digest = hashlib.sha256("\n".join(parts).encode())
    for path in _sources():
        digest.update(path.read_bytes())
    return f"done-{digest.hexdigest()[:16]}"


def _sources() -> list[Path]:
    """Files of this package that say which forms there are."""
    found: list[Path] = []
    for place in calfsocket.__path__:
        for name in _SOURCES:
            path = Path(place) / name
            found += [path] if path.is_file() else path.glob("**/*.[pch]*")
    return sorted([Path(__file__), *(p for p in found if p.suffix in (".py", ".c", ".h"))])


def _throw_away_leftovers(folder: Path) -> None:
    """Delete half compiled forms, unless a living process may be compiling them.

    From here on this process is a user of the cache: it shares a lock as long as it lives.
    """
    for marker in folder.glob("*.c.cached"):
        if not marker.with_suffix("").exists():
            marker.unlink()  # dolfinx compiles anew, and then fails to make the marker
    if folder in _used:
        return
    _used[folder] = (folder / ".users").open("a")
    try:
        fcntl.flock(_used[folder], fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        pass
    else:
        for source in folder.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                source.unlink()
    fcntl.flock(_used[folder], fcntl.LOCK_SH)


def _problems(sets: Iterable[MaterialSet]) -> list[list[Law]]:
    """Laws of a problem for each kind of law that a skin has: the skin's, then one a kind."""
    every: dict[Kind, Law] = {}
    skins: dict[Kind, Law] = {}
    for each in sets:
        skin = each.laws["skin"]
        skins[kind(skin)] = skin
        every |= {kind(law): law for law in (*each.laws.values(), *each.regions.values())}
    return [[skin, *every.values()] for skin in skins.values()]


def _use_all_forms(laws: Sequence[Law]) -> None:
    """Solve for rings, the outermost of the first law, which the others are within."""
    skin, *inner = laws
    radii = np.linspace(_INNER, _SKIN, len(inner) + 1)
    layers = [(f"layer {i}", *radii[i : i + 2]) for i in range(len(inner))]
    section = ring_mesh(MPI.COMM_SELF, [*layers, ("skin", _SKIN, _OUTER)], _SOCKET, h=4.0)
    of_layer = {name: law for (name, *_), law in zip(layers, inner, strict=True)}
    problem = limb_problem(section, {**of_layer, "skin": skin, "socket": SOCKET})
    problem.load = 0.01
    Newton(problem).solve()
    problem.smallest_volume_ratio()
    section_fields(problem, {name: "skin" for name in section.regions})
    contact_line(problem)
