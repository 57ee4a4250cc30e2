"""Files: what they are by their names, and how they are written.

A reader always sees a whole one: every file is written beside its place, flushed to the disk and
moved there in one step.
"""

import errno
import fcntl
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from calfsocket.io.errors import WriteError

_KINDS = {
    "a surface mesh": ("stl", "ply", "obj", "3mf", "off", "wrl", "vtp"),
    "a volume mesh or its fields": ("msh", "vtk", "vtu", "xdmf", "inp", "feb"),
    "a volume image": ("nii", "nii.gz", "nrrd", "mha", "mhd", "dcm", "gipl", "img", "hdr"),
    "a picture": ("png", "jpg", "jpeg", "tif", "tiff", "bmp", "gif", "webp", "pdf"),
    "a CAD model": ("stp", "step", "igs", "iges", "brep", "sldprt", "3dm", "dwg"),
    "a drawing": ("dxf", "svg"),
    "a spreadsheet": ("xls", "xlsx", "ods"),
    "a table": ("csv", "tsv", "txt"),
}
"""What files are that people have of a limb or a socket, by the end of their names."""

_UNFINISHED = ".unfinished-"
"""Start of the name of a file that is being written."""


def kind_of(path: Path) -> str:
    """Return what a file is by its name, e.g. "a surface mesh (STL)"; empty where that is open."""
    for kind, ends in _KINDS.items():
        for end in ends:
            if path.name.lower().endswith(f".{end}"):
                return f"{kind} ({end.upper()})"
    return ""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; at the end it takes the place of `path`.

    If the body fails, `path` stays as it was.

    Raises
    ------
    WriteError
        When there is no space, no right, no such folder.
    """
    path = Path(path)
    try:
        with _temporary(path) as temporary:
            yield temporary
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o666 & ~umask)  # mkstemp's files are for their owner alone
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(path)
    except WriteError:
        raise
    except OSError as error:
        advice = "; free some space" if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
        raise WriteError(f"{path}: cannot be written: {error.strerror or error}{advice}") from error


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """Yield an empty file beside `path`, locked as long as this process lives and needs it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=_UNFINISHED, suffix=path.suffix)
    temporary = Path(name)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield temporary
    finally:
        os.close(handle)
        temporary.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder."""
    for temporary in folder.glob(f"{_UNFINISHED}*"):
        with suppress(OSError), temporary.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # refused while somebody writes
            temporary.unlink()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the folder; other processes that ask for it wait."""
    folder.mkdir(parents=True, exist_ok=True)
    # The lock file stays: removing it would let two processes lock two different files.
    with (folder / ".lock").open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def write_json(path: Path, content: object) -> None:
    """Write JSON, indented, keys in the order given."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
