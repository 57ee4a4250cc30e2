"""Meshes that were made before, in the user's cache: the same section need not be meshed again.

A file is named after all that its mesh follows from, to the last bit, so that none is ever out of
date: what has changed has another name. Files that were not used for longest go first.
"""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import scipy

from calfsocket.io.errors import WriteError
from calfsocket.io.files import replacing
from calfsocket.io.system import cache_folder, gmsh
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.lining import Lining, fitted
from calfsocket.meshes.sizing import MeshSize
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import TriangleMesh

#: Largest size of all files, bytes: some fifty meshes of the size "paper".
LIMIT = 200_000_000

_ARRAYS = ("points", "cells", "cell_tags", "facets", "facet_tags")
_NAMES = ("regions", "boundaries")


def stored(name: str, make: Callable[[], TriangleMesh]) -> TriangleMesh:
    """Return the mesh of a name, as it was made before, or make and store it.

    A file that cannot be read or written changes nothing but the time that this takes.
    """
    path = cache_folder() / "meshes" / f"{name}.npz"
    mesh = _read(path)
    if mesh is None:
        mesh = make()
        with suppress(OSError, WriteError):
            path.parent.mkdir(parents=True, exist_ok=True)
            _write(path, mesh)
            _make_room(path.parent)
    return mesh


def name_of(limb: Limb, socket: Socket, size: MeshSize, liner: Lining | None = None) -> str:
    """Return the name of the mesh of a section: a hash of its curves, regions and sizes.

    With them come this room's sources and the versions of what it calls.
    """
    fit = fitted(limb, socket, liner)
    curves = {**limb_curves(limb), "socket inside": fit.inner, "socket outside": fit.outer}
    if fit.lining is not None:
        curves["liner"] = fit.lining
    said = {
        "limb": limb.model_dump(
            mode="json", include={"regions", "contact_boundary", "fixed_boundary", "mesh"}
        ),
        "bonded": liner and liner.bonded,
        "size": asdict(size),
        "versions": [gmsh.__version__, np.__version__, scipy.__version__],
    }
    digest = hashlib.sha256(json.dumps(said).encode())
    for source in _sources():
        digest.update(source.read_bytes())
    _add_curves(digest, curves)
    return digest.hexdigest()[:32]


def _add_curves(digest: Any, curves: Mapping[str, ClosedCurve]) -> None:
    for name, curve in curves.items():
        digest.update(name.encode())
        digest.update(curve.spline.x.tobytes())
        digest.update(np.ascontiguousarray(curve.spline.c).tobytes())


def _sources() -> list[Path]:
    return sorted(Path(__file__).parent.glob("*.py"))


def _read(path: Path) -> TriangleMesh | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in _ARRAYS}
            names = {name: json.loads(str(file[name])) for name in _NAMES}
        os.utime(path)  # used just now
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None
    return TriangleMesh(**arrays, **names)


def _write(path: Path, mesh: TriangleMesh) -> None:
    arrays = {name: getattr(mesh, name) for name in _ARRAYS}
    names = {name: np.array(json.dumps(getattr(mesh, name))) for name in _NAMES}
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays, **names)


def _make_room(folder: Path) -> None:
    """Remove files that were not used for longest, until all are within the limit."""
    files = sorted(((p.stat(), p) for p in folder.glob("*.npz")), key=lambda each: each[0].st_mtime)
    size = sum(status.st_size for status, _ in files)
    for status, path in files:
        if size <= LIMIT:
            return
        path.unlink(missing_ok=True)
        size -= status.st_size
