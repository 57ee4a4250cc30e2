"""Compiled forms: kept in a cache of our own, made once before ranks need them side by side."""

import fcntl
import os
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from dolfinx import jit
from mpi4py import MPI

from calfsocket.materials.laws import Ogden
from calfsocket.materials.tissues import MUSCLE, material_set
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.newton import Newton
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import contact_line, section_fields

# The socket overlaps the limb a little, so that contact is compiled as well.
_LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 30.0), ("skin", 30.0, 32.0)]
_SOCKET = (31.9, 36.0)
_TIMEOUT_S = 600
"""How long a rank waits for another to compile; compiling takes some 10 s in all."""


def cache_folder() -> Path:
    """Folder of the compiled forms, under the user's cache directory."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "calfsocket" / "fenics"


def warm(comm: MPI.Comm, ogden_terms: Iterable[int] = (1,)) -> None:
    """Compile every form that a case needs, unless that was done before (collective).

    Rank 0 compiles, under a lock against other processes of the same user. A form that is found
    half compiled while no other process uses the cache was left by one that was killed, and is
    thrown away; without that, dolfinx waits for it in vain.

    Parameters
    ----------
    comm
        All ranks.
    ogden_terms
        Numbers of Ogden terms that the cases' laws have; each has forms of its own.
    """
    folder = cache_folder()
    jit.DOLFINX_DEFAULT_JIT_OPTIONS["cache_dir"] = (folder, "calfsocket")
    jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (_TIMEOUT_S, "calfsocket")
    if comm.rank == 0:
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / ".lock").open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            _throw_away_leftovers(folder)
            for number in sorted(set(ogden_terms)):
                _use_all_forms(number)
    comm.Barrier()


_used: dict[Path, IO[str]] = {}


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


def _use_all_forms(ogden_terms: int) -> None:
    section = ring_mesh(MPI.COMM_SELF, _LAYERS, _SOCKET, h=4.0)
    muscle = Ogden(MUSCLE.mu * ogden_terms, MUSCLE.alpha * ogden_terms, MUSCLE.d1)
    laws = material_set("separate", materials={"muscle": muscle})
    model = limb_problem(section, {name: laws[name] for name in section.regions})
    newton = Newton(model)
    model.load = 0.01
    newton.solve()
    model.smallest_volume_ratio()
    section_fields(model, {name: name for name in section.regions})
    contact_line(model)
