"""Files: what they are by their names, and how they are written.

A reader always sees a whole one: every file is written beside its place, flushed to the disk and
moved there in one step.
"""

import errno
import fcntl
import json
import logging
import os
import socket
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from calfsocket.io.errors import InputError, WriteError

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

_OCCUPIED = ".running"
"""Says which process solves into a folder, and is locked by it."""

log = logging.getLogger(__name__)


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


@contextmanager
def occupied(folder: Path) -> Iterator[None]:
    """Keep a folder for this process until the body ends; others are refused meanwhile.

    The kernel releases the lock when the process ends, however it ends: none is left behind. On NFS
    the lock counts on all hosts. A file system without locks gets a warning instead.

    Raises
    ------
    InputError
        If another process occupies the folder: which one, on which host, since when.
    OSError
        If the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # Not the lock of `locked`, which ranks of this very run hold for moments. The file stays, too.
    with (folder / _OCCUPIED).open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            raise InputError(
                f"{folder}: {file.read() or 'another process'} is solving into this folder; wait "
                "for its end, or name another folder"
            ) from None
        except OSError as error:
            log.warning(
                "%s: cannot be locked (%s): start no other run into it", folder, error.strerror
            )
        file.truncate(0)
        since = time.strftime("%Y-%m-%d %H:%M:%S")
        file.write(f"process {os.getpid()} on {socket.gethostname()} (since {since})")
        file.flush()
        try:
            yield
        finally:
            file.truncate(0)


def write_json(path: Path, content: object) -> None:
    """Write JSON, indented, keys in the order given."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
