"""Readers given anything at all: a result or an InputError of one line, soon, and nothing else."""

import re
from collections.abc import Callable
from dataclasses import astuple
from datetime import timedelta
from io import StringIO
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from geometry import LIMB
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import deck

from calfsocket.fit.data import read_test
from calfsocket.imaging.mesh.limb import limb_of_mesh
from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_json
from calfsocket.materials.file import read_material
from calfsocket.meshes import limb
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.outline import read_outline
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.socket import Bump, CircleBlend, NormalOffset, Outline, Socket, Sockets

Reader = Callable[[Path], object]

#: The same examples in every run, so that a test that fails here fails everywhere.
fuzzed = settings(
    max_examples=60,
    deadline=timedelta(seconds=5),
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def drawing() -> bytes:
    """Two lines and two half circles as three entities: a DXF without header and tables."""
    document = ezdxf.new("R2000")
    space = document.modelspace()
    space.add_line((0, 0), (40, 0))
    space.add_arc((40, 30), 30, -90, 90)
    space.add_lwpolyline([(40, 60, 0, 0, 0), (0, 60, 0, 0, 1), (0, 0)])
    text = StringIO()
    document.write(text)
    entities = text.getvalue().partition("ENTITIES\n")[2].partition("ENDSEC")[0]
    return f"  0\nSECTION\n  2\nENTITIES\n{entities}ENDSEC\n  0\nEOF\n".encode()


def ring_mesh(kind: str) -> bytes:
    """Two rings of 24 triangles, bone and skin, as a file of Abaqus or gmsh."""
    angle = 2 * np.pi * np.arange(12) / 12
    points = np.concatenate(
        [r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (12.0, 20.0, 30.0)]
    )
    cells = np.array(
        [
            row
            for i in (0, 12)
            for j in range(12)
            for a, b in [(i + j, i + (j + 1) % 12)]
            for row in ([a, a + 12, b + 12], [a, b + 12, b])
        ]
    )
    if kind == "inp":
        sets = {"bone": np.arange(24), "skin": np.arange(24, 48)}
        return deck(points, {"CPE3": cells}, sets).encode()
    nodes = [f"{n} {x:.4f} {y:.4f} 0" for n, (x, y) in enumerate(points, 1)]
    elements = [
        f"{n} 2 2 {1 + (n > 24)} 1 {a} {b} {c}"
        for n, (a, b, c) in enumerate((cells + 1).tolist(), 1)
    ]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 1 "bone"',
             '2 2 "skin"', "$EndPhysicalNames", "$Nodes", str(len(nodes)), *nodes, "$EndNodes",
             "$Elements", str(len(elements)), *elements, "$EndElements"]  # fmt: skip
    return "\n".join(lines).encode() + b"\n"


FOLDER = Path(limb.__file__).parent
CSV = b"x, y\n" + b"".join(
    b"%.2f, %.2f\n" % (55 * np.cos(t), 50 * np.sin(t)) for t in np.arange(0, 6.2, 0.35)
)
SVG = (
    b'<svg xmlns="http://www.w3.org/2000/svg" width="90mm" viewBox="0 0 90 90"><g transform='
    b'"translate(3) rotate(4)"><path d="M0 0 H40 A30 30 0 0 1 40 60 C9 60 9 60 0 60"/>'
    b'<path d="M 0 0 a 30 30 0 0 0 0 60"/></g></svg>'
)
MATERIAL = b'law = "ogden"\nmu = ["12 kPa"]\nalpha = [14.0]\nnu = 0.495\n[provenance]\na = 1\n'
STRETCHES = b"# fascia\nstretch, stress [kPa]\n1.0, 0.0\n1.1, 20\n1.2, 50\n"

#: Name of the file, its reader, and what it reads.
READERS: dict[str, tuple[str, Reader, bytes]] = {
    "CSV outline": ("a.csv", read_outline, CSV),
    "DXF outline": ("a.dxf", read_outline, drawing()),
    "SVG outline": ("a.svg", read_outline, SVG),
    "Abaqus mesh": ("a.inp", limb_of_mesh, ring_mesh("inp")),
    "gmsh mesh": ("a.msh", limb_of_mesh, ring_mesh("msh")),
    "limb": ("limb.json", Limb.read, (FOLDER / "calf.json").read_bytes()),
    "sockets": (
        "sockets.json",
        lambda path: read_json(path, Sockets),
        (FOLDER / "sockets.json").read_bytes(),
    ),
    "material": ("a.toml", read_material, MATERIAL),
    "stress-stretch data": ("a.csv", read_test, STRETCHES),
}
each_reader = pytest.mark.parametrize("reader", READERS)

#: What numbers, words and brackets are likely to be changed into.
WORDS = b'nan -1e999 1e308 1e-308 -0 0 null true " [ { } ] < & = , ; \\ud800 \\n'.split()
PIECES = st.one_of(
    st.sampled_from([*WORDS, b"", b"9" * 5000, b"\0", b"\xff", b"\n", b"\xe2\x80\xa8"]),
    st.integers(-1000, 1000).map(lambda number: b"%d" % number),
    st.floats().map(lambda number: repr(number).encode()),
    st.binary(max_size=6),
)


@st.composite
def damaged(draw: st.DrawFn, valid: bytes) -> bytes:
    """A valid file with up to four places changed, cut, doubled or taken out."""
    parts = re.split(rb"([^\w.+-]+)", valid)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(parts) - 1))
        match draw(st.sampled_from(["change", "change", "change", "cut", "double", "drop"])):
            case "change":
                parts[place] = draw(PIECES)
            case "cut":
                del parts[place + 1 :]
            case "double":
                parts[place:place] = parts[place : place + 40]
            case "drop":
                del parts[place : place + draw(st.integers(1, 40))]
        parts = parts or [b""]
    return b"".join(parts)


def survives(reader: str, folder: Path, content: bytes) -> None:
    name, read, _ = READERS[reader]
    path = folder / name
    path.write_bytes(content)
    try:
        read(path)
    except InputError as error:
        line = str(error)
        assert len(line.splitlines()) == 1
        line.encode()  # no lone surrogates, which cannot be printed
        assert len(line) < 1100


@each_reader
@fuzzed
@given(content=st.data())
def test_a_damaged_file_is_read_or_refused(
    tmp_path: Path, reader: str, content: st.DataObject
) -> None:
    survives(reader, tmp_path, content.draw(damaged(READERS[reader][2])))


@each_reader
@fuzzed
@given(content=st.binary(max_size=400) | st.text(max_size=200).map(str.encode))
def test_any_bytes_are_read_or_refused(tmp_path: Path, reader: str, content: bytes) -> None:
    survives(reader, tmp_path, content)


@each_reader
def test_undamaged_they_are_read(tmp_path: Path, reader: str) -> None:
    name, read, valid = READERS[reader]
    (tmp_path / name).write_bytes(valid)
    assert read(tmp_path / name)


@each_reader
def test_deep_nesting_is_refused(tmp_path: Path, reader: str) -> None:
    for mark in (b"[", b"{", b'{"a":', b"<g>", b"a.", b"0\n", b"((("):
        for before in (b"", b"a = ", b"<svg>"):
            survives(reader, tmp_path, before + mark * 20_000)


@each_reader
def test_cells_and_words_without_end_are_refused(tmp_path: Path, reader: str) -> None:
    for before in (b"", b"stretch, stress [kPa]\n1, ", b"x, y\n1, ", b'{"'):
        survives(reader, tmp_path, before + b"7" * 200_000)


def test_a_key_that_would_take_minutes_to_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"a." * 100_000)
    with pytest.raises(InputError, match=r"a\.toml: is 0\.2 MB; files up to 0\.05 MB are accepted"):
        read_material(path)


OFFSETS = st.floats(-100, 100) | st.floats(-5, 5)
PLACES = st.integers(-9000, 9000).map(lambda hundredths: hundredths / 100)
BUMPS = st.builds(
    Bump,
    center=st.floats(allow_nan=False, allow_infinity=False),
    width=st.floats(1e-6, 1e6) | st.floats(3, 40),
    amplitude=OFFSETS,
)
WALLS = st.floats(1e-9, 100) | st.floats(1, 9)
SOCKETS: st.SearchStrategy[Socket] = st.one_of(
    st.builds(
        NormalOffset,
        wall_thickness=WALLS,
        base=OFFSETS,
        bumps=st.lists(BUMPS, max_size=3),
    ),
    st.builds(
        CircleBlend,
        wall_thickness=WALLS,
        area_reduction=st.floats(-0.99, 0.99),
        roundness=st.floats(0, 1),
        bumps=st.lists(BUMPS, max_size=3),
    ),
    st.builds(
        Outline,
        wall_thickness=WALLS,
        points=st.lists(st.tuples(PLACES, PLACES), min_size=4, max_size=12, unique=True),
        shift=st.tuples(OFFSETS, OFFSETS),
        rotation=st.floats(-360, 360),
    ),
)


@settings(fuzzed, max_examples=30, deadline=timedelta(seconds=10))
@given(socket=SOCKETS)
def test_any_socket_is_placed_or_refused(socket: Socket) -> None:
    try:
        found = check_placement(socket, LIMB, "any")
    except InputError as error:
        assert str(error).startswith("socket any: ")
    else:
        assert np.isfinite(astuple(found)).all()
        assert found.largest_overlap > 0
