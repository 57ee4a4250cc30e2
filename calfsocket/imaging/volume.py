"""Label maps as segmentation programs write them: voxels, and where they lie in space."""

import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import nibabel
import numpy as np
from nibabel import imageglobals
from nibabel.filebasedimages import ImageFileError
from nibabel.spatialimages import HeaderDataError
from numpy.typing import NDArray
from PIL import Image

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable
from calfsocket.meshes.curves import Array

#: Largest file, bytes, and most voxels: eight times what a scan of two legs has.
MAX_BYTES, MAX_VOXELS = 2_000_000_000, 500_000_000
#: By how much deflated data can grow at most.
_DEFLATED = 1032
#: Most labels of a segmentation; an image has more values.
MOST_LABELS = 500

Labels = NDArray[np.integer]


@dataclass(frozen=True)
class Volume:
    """A label map.

    Attributes
    ----------
    path : Path
    labels : array
        Integers, shape (ni, nj, nk).
    affine : Array
        Indices -> mm in the source's axes, shape (3, 4).
    superior, anterior : Array, optional
        Where head and front are in these axes, where the file says so.
    """

    path: Path
    labels: Labels
    affine: Array
    superior: Array | None = None
    anterior: Array | None = None


def is_volume(path: Path) -> bool:
    """Return whether a file or folder is read as a label map."""
    return path.is_dir() or _kind(path) in (*READERS, *_PICTURES)


def _kind(path: Path) -> str:
    name = path.name.lower()
    return ".nii.gz" if name.endswith(".nii.gz") else path.suffix.lower()


def read_volume(path: Path, voxel: tuple[float, float, float] | None) -> Volume:
    """Read a label map.

    Parameters
    ----------
    path
        NIfTI, NRRD or MetaImage; a TIFF with several pages; a folder of PNG or TIFF slices.
    voxel
        Size of a voxel in mm, for pictures, which do not have it.

    Raises
    ------
    InputError
        When it cannot be read or is no label map.
    """
    kind = _kind(path)
    if path.is_dir() or kind in _PICTURES:
        if voxel is None:
            raise InputError(
                f"{path}: pictures do not have the size of a voxel; add --voxel X,Y,Z in mm, Z"
                " being the distance of slices"
            )
        raw, affine, known = _stack(path), np.diag([*voxel, 1.0])[:3], None
    else:
        if voxel is not None:
            raise InputError(f"{path}: has the size of its voxels; leave --voxel out")
        check_readable(path, MAX_BYTES)
        try:
            raw, affine, known = READERS[kind](path)
        except InputError:
            raise
        except _UNREADABLE as error:
            words = " ".join(str(error).split())[:100]
            raise InputError(
                f"{path}: cannot be read, or is not complete ({words}); export it again"
            ) from None
    size = np.linalg.norm(affine[:, :3], axis=0)
    if not (np.isfinite(affine).all() and size.min() > 0 and abs(np.linalg.det(affine[:, :3])) > 0):
        raise InputError(f"{path}: its voxels have no size or no orientation; export it again")
    superior, anterior = known or (None, None)
    return Volume(path, _integers(path, raw), affine, superior, anterior)


_UNREADABLE = (
    ValueError, KeyError, IndexError, TypeError, OSError, EOFError, MemoryError, OverflowError,
    zlib.error, HeaderDataError,
)  # fmt: skip
_Known = tuple[Array, Array] | None
_Read = tuple[NDArray, Array, _Known]
#: What a header's unit of length is, mm; one that is not known is taken to be mm.
_NIFTI_UNITS = {"meter": 1000.0, "mm": 1.0, "micron": 1e-3}
_RAS: _Known = (np.array([0.0, 0, 1]), np.array([0.0, 1, 0]))
_LPS: _Known = (np.array([0.0, 0, 1]), np.array([0.0, -1, 0]))


def _integers(path: Path, raw: NDArray) -> Labels:
    """Return the labels of an array, which must be three-dimensional and of integers."""
    if raw.ndim != 3 or min(raw.shape) < 2:
        shape = " x ".join(map(str, raw.shape))
        raise InputError(
            f"{path}: is {shape}, which is no volume; give a label map with three dimensions"
        )
    if not np.issubdtype(raw.dtype, np.integer):
        whole = np.rint(raw)
        if not np.array_equal(whole, raw):
            raise InputError(
                f"{path}: has values that are no integers: an image, not labels; segment it first"
            )
        raw = whole.astype(np.int32)
    return raw


def _check_room(
    path: Path, shape: tuple[int, ...], item: int, packed: bool, start: int = 0
) -> None:
    """Raise an InputError where a header announces more than the file can hold."""
    voxels = int(np.prod([int(n) for n in shape], dtype=object))
    if any(n < 1 for n in shape) or voxels > MAX_VOXELS:
        listed = " x ".join(map(str, shape))
        raise InputError(f"{path}: announces {listed} voxels; 1 to {MAX_VOXELS:.0e} are accepted")
    room = (path.stat().st_size - start) * (_DEFLATED if packed else 1)
    if voxels * item > room:
        raise ValueError(f"{voxels * item / 1e6:.4g} MB announced")


def _nifti(path: Path) -> _Read:
    with imageglobals.LoggingOutputSuppressor():  # it corrects slips in headers, and says so
        try:
            image = nibabel.load(path)
        except ImageFileError:
            raise ValueError("no NIfTI header") from None
    if not isinstance(image, nibabel.Nifti1Pair):  # NIfTI-2 is one, too
        raise ValueError("no NIfTI header")
    header = image.header
    shape, kind = header.get_data_shape(), header.get_data_dtype()
    while len(shape) > 3 and shape[-1] == 1:
        shape = shape[:-1]
    if len(shape) != 3 or kind.names or kind.kind not in "iuf":
        what = "several values a voxel" if len(shape) == 3 else f"{len(shape)} dimensions"
        raise InputError(f"{path}: has {what}; give a label map: one number a voxel, 3-D")
    _check_room(path, shape, kind.itemsize, path.suffix.lower() == ".gz")
    raw = np.asanyarray(image.dataobj).reshape(shape, order="F")
    scale = _NIFTI_UNITS.get(header.get_xyzt_units()[0], 1.0)
    if not (header["sform_code"] or header["qform_code"]):
        return raw, np.diag([*header.get_zooms()[:3], 1.0])[:3] * scale, None
    return raw, image.affine[:3] * scale, _RAS


def _header(file: IO[bytes], divider: str, last: Callable[[str, str], bool]) -> dict[str, str]:
    """Read lines ``key divider value`` up to the last one."""
    found: dict[str, str] = {}
    for _ in range(1000):
        line = file.readline(10_000).decode("latin-1")
        if not line or last(line.strip(), ""):
            return found
        key, mark, value = line.partition(divider)
        if mark:
            found[key.strip().lower()] = value.lstrip("=").strip()
        if last("", key.strip()):
            return found
    raise ValueError("its header does not end")


_TYPES: Mapping[str, str] = {
    "signed char": "i1", "int8": "i1", "int8_t": "i1", "met_char": "i1",
    "uchar": "u1", "unsigned char": "u1", "uint8": "u1", "uint8_t": "u1", "met_uchar": "u1",
    "short": "i2", "signed short": "i2", "int16": "i2", "int16_t": "i2", "met_short": "i2",
    "ushort": "u2", "unsigned short": "u2", "uint16": "u2", "uint16_t": "u2", "met_ushort": "u2",
    "int": "i4", "signed int": "i4", "int32": "i4", "int32_t": "i4", "met_int": "i4",
    "uint": "u4", "unsigned int": "u4", "uint32": "u4", "uint32_t": "u4", "met_uint": "u4",
    "float": "f4", "float32": "f4", "met_float": "f4",
    "double": "f8", "float64": "f8", "met_double": "f8",
}  # fmt: skip


def _nrrd(path: Path) -> _Read:
    with path.open("rb") as file:
        if not file.readline(100).startswith(b"NRRD"):
            raise ValueError("no NRRD header")
        header = _header(file, ":", lambda line, key: line == "" and key == "")
        start = file.tell()
    shape = _whole(header["sizes"])
    if len(shape) != 3:
        raise InputError(f"{path}: has {len(shape)} dimensions; give a label map with three")
    order = ">" if header.get("endian", "little").lower() == "big" else "<"
    kind = np.dtype(order + _TYPES[header["type"].lower()])
    encoding = header["encoding"].lower()
    if encoding not in ("raw", "gzip", "gz"):
        raise InputError(f"{path}: is encoded as {encoding}; save it as gzip or raw")
    data = header.get("data file") or header.get("datafile")
    source = path.parent / data if data else path
    check_readable(source, MAX_BYTES)
    raw = _values(source, shape, kind, encoding != "raw", 0 if data else start)
    affine = np.zeros((3, 4))
    if "space directions" in header:
        vectors = re.findall(r"\(([^)]*)\)", header["space directions"])
        affine[:, :3] = np.array([_numbers(vector, ",") for vector in vectors]).T
        if "space origin" in header:
            affine[:, 3] = _numbers(header["space origin"].strip("()"), ",")
    elif "spacings" in header:
        affine[:, :3] = np.diag(_numbers(header["spacings"], None))
    else:
        raise InputError(f"{path}: has neither space directions nor spacings; export it again")
    space = header.get("space", "").lower()
    if space in ("left-posterior-superior", "lps"):
        return raw, affine, _LPS
    if space in ("right-anterior-superior", "ras"):
        return raw, affine, _RAS
    if space in ("left-anterior-superior", "las"):
        # Left-handed: x is turned around, or the limb would be one of the other side.
        return raw, affine * np.array([[-1.0], [1.0], [1.0]]), _RAS
    return raw, affine, None


def _metaimage(path: Path) -> _Read:
    with path.open("rb") as file:
        header = _header(file, "=", lambda _, key: key.lower() == "elementdatafile")
        start = file.tell()
    if "dimsize" not in header:
        raise ValueError("no MetaImage header")
    shape = _whole(header["dimsize"])
    channels = int(header.get("elementnumberofchannels", "1"))
    if len(shape) != 3 or channels != 1:
        what = f"{channels} values a voxel" if len(shape) == 3 else f"{len(shape)} dimensions"
        raise InputError(f"{path}: has {what}; give a label map: one number a voxel, 3-D")
    big = header.get("binarydatabyteordermsb", header.get("elementbyteordermsb", "")).lower()
    kind = np.dtype((">" if big == "true" else "<") + _TYPES[header["elementtype"].lower()])
    packed = header.get("compresseddata", "").lower() == "true"
    local = header["elementdatafile"].lower() == "local"
    source = path if local else path.parent / header["elementdatafile"]
    check_readable(source, MAX_BYTES)
    raw = _values(source, shape, kind, packed, start if local else 0)
    spacing = _numbers(header.get("elementspacing") or header["elementsize"], None)
    turn = header.get("transformmatrix") or header.get("rotation") or header.get("orientation")
    directions = np.reshape(_numbers(turn, None), (3, 3)).T if turn else np.eye(3)
    origin = header.get("offset") or header.get("position") or header.get("origin") or "0 0 0"
    affine = np.column_stack([directions * spacing, _numbers(origin, None)])
    named = header.get("anatomicalorientation", "???")
    return raw, affine, None if "?" in named else _LPS


def _whole(text: str) -> tuple[int, ...]:
    return tuple(int(word) for word in text.split())


def _numbers(text: str, divider: str | None) -> Array:
    return np.array([float(word) for word in text.split(divider)])


def _values(
    path: Path, shape: tuple[int, ...], kind: np.dtype, packed: bool, start: int
) -> NDArray:
    """Return an array of a file, whose first index runs fastest."""
    _check_room(path, shape, kind.itemsize, packed, start)
    wanted = int(np.prod(shape)) * kind.itemsize
    with path.open("rb") as file:
        file.seek(start)
        data = file.read() if packed else file.read(wanted)
    if packed:
        # gzip's or zlib's header; no more is unpacked than was announced.
        data = zlib.decompressobj(zlib.MAX_WBITS | 32).decompress(data, wanted)
    if len(data) < wanted:
        raise ValueError(f"{len(data)} of {wanted} bytes")
    return np.frombuffer(data, dtype=kind).reshape(shape, order="F")


READERS: Mapping[str, Callable[[Path], _Read]] = {
    ".nii": _nifti,
    ".nii.gz": _nifti,
    ".nrrd": _nrrd,
    ".nhdr": _nrrd,
    ".mha": _metaimage,
    ".mhd": _metaimage,
}
_PICTURES = (".tif", ".tiff", ".png")


def _stack(path: Path) -> NDArray:
    """Return a stack of pictures: x to the right, y up, z from slice to slice."""
    if path.is_dir():
        files = sorted(
            (each for each in path.iterdir() if each.suffix.lower() in _PICTURES),
            key=lambda each: [int(w) if w.isdigit() else w for w in re.split(r"(\d+)", each.name)],
        )
        if not files:
            raise InputError(
                f"{path}: is a folder without PNG or TIFF slices; give a label map, such as NIfTI"
            )
        if len({each.suffix.lower() for each in files}) > 1:
            raise InputError(f"{path}: has both PNG and TIFF files; keep one stack in a folder")
    else:
        files = [path]
    slices: list[NDArray] = []
    for file in files:
        check_readable(file, MAX_BYTES)
        try:
            with Image.open(file) as picture:
                for page in range(getattr(picture, "n_frames", 1)):
                    picture.seek(page)
                    slices.append(_page(file, picture))
                    _check_number(file, slices)
        except InputError:
            raise
        except (*_UNREADABLE, SyntaxError, Image.DecompressionBombError) as error:
            raise InputError(
                f"{file}: cannot be read as a picture ({' '.join(str(error).split())[:100]})"
            ) from None
    if len(slices) < 2:
        raise InputError(f"{path}: is one slice; give a stack, or an outline as CSV, DXF or SVG")
    return np.stack([each[::-1].T for each in slices], axis=-1)


def _page(file: Path, picture: Image.Image) -> NDArray:
    if picture.mode not in ("1", "L", "P", "I", "I;16", "I;16L", "I;16B", "F"):
        raise InputError(
            f"{file}: is a picture in colours ({picture.mode}); give labels: one number a pixel"
        )
    page = np.array(picture)
    return page.astype(np.uint8) if page.dtype == bool else page


def _check_number(file: Path, slices: list[NDArray]) -> None:
    if slices[-1].shape != slices[0].shape:
        raise InputError(
            f"{file}: is {slices[-1].shape[1]} x {slices[-1].shape[0]} pixels, the first slice"
            f" {slices[0].shape[1]} x {slices[0].shape[0]}; all slices must be equal"
        )
    if len(slices) * slices[0].size > MAX_VOXELS:
        raise InputError(f"{file}: is beyond {MAX_VOXELS:.0e} voxels of its stack; give fewer")
