"""PLY surfaces of all kinds, none of them half.

VTK's reader crashes where a file ends too early; meshio's reads few files; trimesh's takes texts
that end too early as they are, and reads no binary files in which triangles and quadrangles are
mixed, nor polygons of more corners.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calfsocket.meshes.curves import Array

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDER = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
#: Rows that are read at once, of bytes and of text, in the hope that their lists are equally long.
_BLOCK, _TEXT_BLOCK = 4096, 64
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    """A table of the file: columns of numbers, or of lists of numbers."""

    name: str
    rows: int
    columns: list[tuple[str, str, str]] = field(default_factory=list)  #: name, type, type of length

    def row(self, order: str, lengths: list[int]) -> np.dtype:
        """Return the layout of a row whose lists have these lengths."""
        fields: list[tuple] = []
        left = iter(lengths)
        for name, kind, counter in self.columns:
            if counter:
                fields.append((f"number of {name}", order + counter))
                fields.append((name, order + kind, (next(left),)))
            else:
                fields.append((name, order + kind))
        return np.dtype(fields)

    @property
    def lists(self) -> list[str]:
        """Names of the columns of lists."""
        return [name for name, _, counter in self.columns if counter]


def read_ply(path: Path) -> tuple[Array, np.ndarray]:
    """Return points and triangles; polygons of more corners are cut into fans.

    Raises
    ------
    ValueError
        When the file is no PLY or ends too early.
    """
    content = path.read_bytes()
    head, mark, data = content.partition(b"end_header")
    if not content.startswith(b"ply") or not mark:
        raise ValueError("no PLY header")
    order, elements = _elements(head.decode("latin-1"))
    data = data[data.index(b"\n") + 1 :]
    words = data.split() if order == "" else []
    place = 0
    points: list[np.ndarray] = [np.empty((0, 3))]
    corners: list[np.ndarray] = [np.empty((0, 3), dtype=np.int64)]
    for element in elements:
        parts, place = (
            _text_rows(element, words, place) if order == "" else _rows(element, data, place, order)
        )
        for table in parts:
            if element.name == "vertex":
                points.append(np.column_stack([table[axis] for axis in "xyz"]))
            elif element.name == "face":
                name = next(name for name in _CORNERS if name in (table.dtype.names or ()))
                polygons = table[name].astype(np.int64)
                corners += [polygons[:, [0, i, i + 1]] for i in range(1, polygons.shape[1] - 1)]
    return np.concatenate(points), np.concatenate(corners)


def _elements(head: str) -> tuple[str, list[_Element]]:
    order, found = None, []
    for line in head.splitlines():
        match line.split():
            case ["format", kind, _]:
                order = _ORDER[kind]
            case ["element", name, rows]:
                found.append(_Element(name, int(rows)))
            case ["property", "list", counter, kind, name]:
                found[-1].columns.append((name, _TYPES[kind], _TYPES[counter]))
            case ["property", kind, name]:
                found[-1].columns.append((name, _TYPES[kind], ""))
    if order is None:
        raise ValueError("its header has no format")
    return order, found


def _ends(element: _Element, left: int) -> ValueError:
    return ValueError(f"{left} of {element.rows} rows of {element.name} are missing")


def _rows(element: _Element, data: bytes, place: int, order: str) -> tuple[list[np.ndarray], int]:
    """Return the rows, in parts whose lists are equally long, and where the next element begins."""
    parts: list[np.ndarray] = []
    left = element.rows
    while left:
        lengths: list[int] = []
        for _ in element.lists:  # each length stands behind the lists before it
            before = element.row(order, [*lengths, *[0] * (len(element.lists) - len(lengths))])
            name = f"number of {element.lists[len(lengths)]}"
            kind, offset = before.fields[name][:2]  # type: ignore[index]
            if place + offset + kind.itemsize > len(data):
                raise _ends(element, left)
            lengths.append(int(np.frombuffer(data, kind, 1, place + offset)[0]))
        row = element.row(order, lengths)
        number = min(left, (len(data) - place) // row.itemsize, _BLOCK)
        if not number:
            raise _ends(element, left)
        table = np.frombuffer(data, row, number, place)
        same = np.ones(number, dtype=bool)
        for name, length in zip(element.lists, lengths, strict=True):
            same &= table[f"number of {name}"] == length
        number = number if same.all() else int(np.argmin(same))
        parts.append(table[:number])
        left -= number
        place += number * row.itemsize
    return parts, place


def _text_rows(element: _Element, words: list[bytes], place: int) -> tuple[list[np.ndarray], int]:
    """Return the rows of a text, as `_rows` does."""
    parts: list[np.ndarray] = []
    left = element.rows
    while left:
        lengths, at = [], place
        for _, _, counter in element.columns:
            if counter:
                if at >= len(words):
                    raise _ends(element, left)
                lengths.append(int(words[at]))
            at += 1 + (lengths[-1] if counter else 0)
        width = at - place
        number = min(left, (len(words) - place) // width, _TEXT_BLOCK) if width else 0
        if not number:
            raise _ends(element, left)
        # Numbers of a text are read at once; what follows rows of another length is not used.
        block = np.array(words[place : place + number * width], dtype=float).reshape(-1, width)
        row = element.row("", lengths)
        table, column, same = np.zeros(number, dtype=row), 0, np.ones(number, dtype=bool)
        for name in row.names or ():
            shape = row[name].shape
            cells = block[:, column : column + (shape[0] if shape else 1)]
            table[name] = cells if shape else cells[:, 0]
            column += cells.shape[1]
        for name, length in zip(element.lists, lengths, strict=True):
            same &= table[f"number of {name}"] == length
        number = number if same.all() else int(np.argmin(same))
        parts.append(table[:number])
        left -= number
        place += number * width
    return parts, place
