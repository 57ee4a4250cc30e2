"""Meshes made elsewhere as limbs and sockets: read, mended, and solved as they are."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest
from mesh_files import WRITERS, deck, inp, msh22, sets_of, vtu
from mpi4py import MPI
from scipy.spatial import Delaunay

import calfsocket as cs
from calfsocket import cli
from calfsocket.imaging.mesh.limb import limb_of_mesh
from calfsocket.imaging.mesh.socket import socket_of_mesh
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes import curves, quality, rings, section, tags
from calfsocket.meshes.distributed import distribute
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.placement import askew
from calfsocket.meshes.sizing import SIZES
from calfsocket.meshes.socket import NormalOffset, Outline
from calfsocket.meshes.triangles import TriangleMesh

LAYERS = [("tibia", 5.0, 12.0), ("muscle", 12.0, 26.0), ("fat", 26.0, 30.0), ("skin", 30.0, 32.0)]
SOCKET = (31.7, 36.0)
SETS = {"1": "tibia", "2": "muscle", "3": "fat", "4": "skin", "100": "socket"}
COMBINED = cs.MaterialSet.paper("combined")


@cache
def ring() -> TriangleMesh:
    """A limb of rings in a socket."""
    return rings.build(LAYERS, SOCKET, 5.0)


def limb_alone(mesh: TriangleMesh) -> TriangleMesh:
    """Leave the socket out; its nodes stay, unused."""
    kept = mesh.cell_tags != tags.SOCKET_ID
    regions = {name: tag for name, tag in mesh.regions.items() if name != tags.SOCKET}
    return replace(mesh, cells=mesh.cells[kept], cell_tags=mesh.cell_tags[kept], regions=regions)


def circles() -> Limb:
    """The rings as curves."""
    radii = [LAYERS[0][1], *(outer for *_, outer in LAYERS)]
    return Limb.model_validate(
        {
            "units": "mm, deg",
            "fixed_boundary": "c0",
            "contact_boundary": "c4",
            "curves": {
                f"c{i}": {"type": "ellipse", "center": [0, 0], "semi_axes": [r, r], "angle_deg": 0}
                for i, r in enumerate(radii)
            },
            "regions": [
                {"name": name, "tissue": name if name != "tibia" else "bone", "outer": f"c{i + 1}",
                 "holes": [f"c{i}"]}
                for i, (name, *_) in enumerate(LAYERS)
            ],
        }
    )  # fmt: skip


def by_place(mesh: TriangleMesh) -> np.ndarray:
    """Cells as their nodes' coordinates and regions, in an order of their own."""
    names = {tag: name for name, tag in mesh.regions.items()}
    order = np.array([sorted(set(names.values())).index(names[t]) for t in mesh.cell_tags])
    rows = np.column_stack([order, mesh.coordinates.reshape(len(mesh.cells), -1)])
    return rows[np.lexsort(np.round(rows, 6).T)]


@pytest.mark.parametrize("name", WRITERS)
def test_a_mesh_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    path, mesh = tmp_path / name, ring()
    WRITERS[name](mesh, path)
    sets = SETS if path.suffix in (".vtu", ".vtk") else None
    limb = cs.Limb.from_mesh(path, sets)
    socket = cs.Socket.from_mesh(path, limb, sets)
    assert {**limb.tissues} == {"tibia": "bone", "muscle": "muscle", "fat": "fat", "skin": "skin"}
    back = section.build(limb, socket, SIZES["coarse"])
    np.testing.assert_allclose(by_place(back), by_place(mesh), atol=1e-12)
    for boundary in mesh.boundaries:
        there, here = (
            m.points[m.facets[m.facet_tags == m.boundaries[boundary]]].mean(axis=1)
            for m in (mesh, back)
        )
        assert sorted(map(tuple, np.round(here, 9))) == sorted(map(tuple, np.round(there, 9)))
    assert limb.source is not None
    assert "marrow cavity" in " ".join(limb.source.found)
    assert limb.areas["skin"] == pytest.approx(np.pi * (32**2 - 30**2), rel=1e-4)


def test_it_is_written_and_read_again(tmp_path: Path) -> None:
    msh22(ring(), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh")
    socket = cs.Socket.from_mesh(tmp_path / "a.msh", limb)
    limb.write(tmp_path / "limb.json")
    socket.write(tmp_path / "socket.json")
    assert cs.Limb.read(tmp_path / "limb.json") == limb
    again = cs.Socket.read(tmp_path / "socket.json")
    assert again.model_copy(update={"name": socket.name}) == socket
    assert len({socket, again.model_copy(update={"name": socket.name})}) == 1


def test_the_same_mesh_has_the_same_solution(tmp_path: Path) -> None:
    msh22(ring(), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh")
    socket = cs.Socket.from_mesh(tmp_path / "a.msh", limb)
    simulation = cs.Simulation(limb, socket, COMBINED, mesh_size="coarse")
    ours = simulation.solve().summary()
    mesh = distribute(MPI.COMM_SELF, ring)
    stepper = LoadStepper(limb_problem(mesh, simulation.region_laws), simulation.steps)
    stepper.run()
    theirs = simulation.result(stepper).summary()
    np.testing.assert_allclose(ours["value"], theirs["value"], rtol=1e-8)
    assert list(ours["quantity"]) == list(theirs["quantity"])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["msh", "abaqus"])
def test_the_calf_that_was_exported_has_the_same_numbers(kind: str, tmp_path: Path) -> None:
    calf = cs.Simulation(
        cs.Limb.reference(), cs.Socket.reference("TSB"), COMBINED, mesh_size="coarse"
    )
    path = tmp_path / ("calf.msh" if kind == "msh" else "calf.inp")
    calf.export(path, kind)  # type: ignore[arg-type]
    limb = cs.Limb.from_mesh(path, anterior="+y")
    socket = cs.Socket.from_mesh(path, limb)
    assert limb.tissues == calf.limb.tissues
    imported = cs.Simulation(limb, socket, COMBINED, mesh_size="coarse")
    ours, theirs = imported.solve().summary(), calf.solve().summary()
    np.testing.assert_allclose(ours["value"], theirs["value"], rtol=1e-8)


def test_fields_of_a_solved_case_are_a_mesh_with_names(tmp_path: Path) -> None:
    """`fields.vtu`, with doubled nodes between regions, gives the numbers that it holds."""
    msh22(ring(), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh")
    socket = cs.Socket.from_mesh(tmp_path / "a.msh", limb)
    solved = cs.Simulation(limb, socket, COMBINED, mesh_size="coarse").solve()
    solved.save(tmp_path / "case")
    path = tmp_path / "case" / "fields.vtu"
    again = cs.Limb.from_mesh(path)
    assert again.tissues == limb.tissues
    socket = cs.Socket.from_mesh(path, again)
    back = section.build(again, socket, SIZES["coarse"])
    np.testing.assert_allclose(by_place(back), by_place(ring()), atol=1e-12)


@pytest.mark.parametrize(
    ("place", "says"),
    [
        (lambda x: (x * [-1, 1])[::-1], "mirrored it would be"),
        (lambda x: x @ [[0.0, 1.0], [-1.0, 0.0]], "turned by -90 degrees about its middle it"),
        (lambda x: x + np.array([6.0, 0.0]), "moved by (-6, 0) mm it would be"),
        (lambda x: x, None),
    ],
    ids=["mirrored", "turned", "moved", "in its place"],
)
def test_a_socket_that_lies_askew_is_said_with_where_it_would_fit(place, says) -> None:
    limb = cs.Limb.reference()
    face = curves.offset(limb.skin, lambda points: np.full(len(points), -0.5))
    points = place(face.evaluate(face.sample(2.0)))
    socket = Outline(points=[tuple(point) for point in points], wall_thickness=4.0)
    text = askew(socket, limb)
    assert (text is None) if says is None else says in text
    if text:
        assert "from 0.5 to 0.5 mm" in text or "from 0.4 to 0.6 mm" in text


def test_what_is_no_part_of_the_limb_is_said(tmp_path: Path) -> None:
    msh22(ring(), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh")
    assert "left out: socket" in limb.source.found and "liner" not in found_in(limb)
    sets = {"tibia": "tibia", "muscle": "muscle", "fat": "fat", "skin": "liner", "socket": "socket"}
    found = found_in(cs.Limb.from_mesh(tmp_path / "a.msh", {**sets, "fat": "skin"}))
    assert "left out: skin, socket" in found and "a liner is not imported" in found


def test_what_it_is_named_by_follows_from_its_content(tmp_path: Path) -> None:
    mesh = ring()
    moved = mesh.points.copy()
    inner = np.setdiff1d(np.arange(len(moved)), mesh.facets)
    moved[inner[0]] += 1e-6
    found = []
    for number, points in enumerate((mesh.points, mesh.points, moved)):
        path = tmp_path / f"{number}.msh"
        msh22(replace(mesh, points=points), path)
        limb = limb_of_mesh(path).limb.model_copy(update={"title": "", "source": None})
        socket = NormalOffset(base=0.3)
        found.append(cs.Simulation(limb, socket, COMBINED, mesh_size="coarse").geometry)
    assert found[0] == found[1] != found[2]


def test_only_the_socket_is_meshed_around_a_limb_with_a_mesh(tmp_path: Path) -> None:
    msh22(ring(), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh")
    assert limb.mesh is not None
    mesh = section.build(limb, NormalOffset(base=0.3), SIZES["coarse"])
    own = limb.mesh.triangles(limb.region_tags)
    np.testing.assert_array_equal(mesh.cells[: len(own.cells)], own.cells)
    np.testing.assert_array_equal(mesh.points[: len(own.points)], own.points)
    assert set(mesh.boundaries) == {
        tags.SKIN_SURFACE, tags.TIBIA_MEDULLARY, tags.SOCKET_INNER, tags.SOCKET_OUTER,
    }  # fmt: skip
    face = mesh.points[mesh.facets[mesh.facet_tags == tags.FACETS[tags.SOCKET_INNER]]]
    np.testing.assert_allclose(np.linalg.norm(face, axis=-1), 31.7, atol=2e-3)
    of_socket = cs.Socket.from_mesh(tmp_path / "a.msh", limb)
    other = section.build(circles(), of_socket, SIZES["coarse"])
    assert (other.cell_tags == tags.SOCKET_ID).sum() == (ring().cell_tags == tags.SOCKET_ID).sum()


LAID = "straight sides were laid onto the curves"


def test_straight_sides_are_laid_onto_the_curves_that_they_were_meshed_from(tmp_path: Path) -> None:
    path, mesh = tmp_path / "a.inp", limb_alone(ring())
    path.write_text(deck(mesh.points, {"CPE3": mesh.cells[:, :3]}, sets_of(mesh)))
    straight = limb_of_mesh(path).limb
    curved = limb_of_mesh(path, geometry=circles()).limb
    exact = np.pi * (32**2 - 30**2)
    assert curved.areas["skin"] == pytest.approx(exact, rel=2e-5)
    assert abs(straight.areas["skin"] / exact - 1) > 5e-4
    assert LAID in " ".join(curved.source.found)  # type: ignore[union-attr]
    assert quality.scaled_jacobians(curved.mesh.coordinates).min() > 0.3  # type: ignore[union-attr]


def test_curved_sides_bring_the_pressure_of_a_ring_back(tmp_path: Path) -> None:
    """Against quadratic triangles of the same size, whose sides are on the circles."""
    path, mesh = tmp_path / "a.inp", ring()
    path.write_text(deck(mesh.points, {"CPE3": mesh.cells[:, :3]}, sets_of(mesh)))
    msh22(mesh, tmp_path / "a.msh")
    wall = NormalOffset(base=0.3, wall_thickness=4.3)
    force = []
    for file, of_limb, of_socket in (
        (tmp_path / "a.msh", None, None), (path, circles(), wall), (path, None, None),
    ):  # fmt: skip
        limb = limb_of_mesh(file, geometry=of_limb).limb
        socket = socket_of_mesh(file, limb, geometry=of_socket)
        result = cs.Simulation(limb, socket, COMBINED, mesh_size="coarse").solve()
        force.append(result.checks.pressing_force_N_per_mm)
    second, curved, straight = force
    assert abs(curved / second - 1) < 1e-3
    assert abs(straight / second - 1) > 10 * abs(curved / second - 1)


def test_a_side_that_would_invert_a_triangle_stays_straight(tmp_path: Path) -> None:
    """One on the skin's inner face that bulges as far as its triangle is high."""
    mesh = limb_alone(ring())
    points, corners = mesh.points.copy(), mesh.cells[:, :3]
    skin = corners[mesh.cell_tags == mesh.regions["skin"]]
    inside = np.abs(np.linalg.norm(points, axis=1) - 30.0) < 1e-6
    row = next(row for row in skin if inside[row].sum() == 2)
    middle = points[row[inside[row]]].mean(axis=0)
    (tip,) = row[~inside[row]]
    points[tip] = middle * (1 + 0.15 / np.linalg.norm(middle))
    path = tmp_path / "a.inp"
    path.write_text(deck(points, {"CPE3": corners}, sets_of(mesh)))
    limb = limb_of_mesh(path, geometry=circles()).limb
    assert "1 sides stay straight" in found_in(limb)
    assert quality.scaled_jacobians(limb.mesh.coordinates).min() > 0.05  # type: ignore[union-attr]


# ----- what files have


def first_order(mesh: TriangleMesh, folder: Path) -> Path:
    path = folder / "limb.inp"
    path.write_text(deck(mesh.points, {"CPS3": mesh.cells[:, :3]}, sets_of(mesh)))
    return path


def found_in(limb: Limb) -> str:
    assert limb.source is not None
    return "; ".join(limb.source.found)


def test_nodes_at_interfaces_are_merged(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    skin = mesh.cell_tags == mesh.regions["skin"]
    own, inverse = np.unique(mesh.cells[skin], return_inverse=True)
    cells = mesh.cells.copy()
    cells[skin] = len(mesh.points) + inverse.reshape(-1, 6)
    apart = replace(
        mesh, points=np.concatenate([mesh.points, mesh.points[own] + 2e-4]), cells=cells
    )
    msh22(apart, tmp_path / "a.msh")
    limb = limb_of_mesh(tmp_path / "a.msh").limb
    assert "nodes within 0.001 mm of others were merged" in found_in(limb)
    assert len(limb.mesh.triangles({}).points) == len(np.unique(mesh.cells))  # type: ignore[union-attr]


def test_clockwise_triangles_are_turned_round(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    cells = mesh.cells.copy()
    cells[::3] = cells[::3][:, [0, 2, 1, 5, 4, 3]]
    msh22(replace(mesh, cells=cells), tmp_path / "a.msh")
    limb = limb_of_mesh(tmp_path / "a.msh").limb
    assert "clockwise triangles were turned round" in found_in(limb)
    msh22(mesh, tmp_path / "b.msh")
    straight = limb_of_mesh(tmp_path / "b.msh").limb
    assert limb.areas == pytest.approx(straight.areas)


def in_plane(
    x: np.ndarray, y: np.ndarray, about: tuple[float, float, float]
) -> Callable[[np.ndarray], np.ndarray]:
    return lambda p: np.array(about) + p[:, :1] * x + p[:, 1:] * y


@pytest.mark.parametrize(
    "place",
    [
        in_plane(np.eye(3)[0], np.eye(3)[1], (0, 0, 310.0)),
        in_plane(np.eye(3)[1], np.eye(3)[2], (7.0, 120.0, -80.0)),
        in_plane(np.eye(3)[2], np.eye(3)[0], (120.0, -5.0, 0.0)),
        in_plane(np.array([0.8, 0.6, 0.0]), np.array([0.0, 0.0, 1.0]), (9.0, 9.0, 400.0)),
    ],
    ids=["z", "x", "y", "oblique"],
)
def test_any_plane_will_do(place: Callable[[np.ndarray], np.ndarray], tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    meshio.Mesh(
        place(mesh.points), [("triangle6", mesh.cells)], cell_data={"region": [mesh.cell_tags]}
    ).write(tmp_path / "a.vtu")
    sets = {name: region for name, region in SETS.items() if region != "socket"}
    limb = limb_of_mesh(tmp_path / "a.vtu", sets).limb
    points = limb.mesh.triangles({}).points  # type: ignore[union-attr]
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(32.0, abs=0.05)
    assert limb.areas["skin"] == pytest.approx(np.pi * (32**2 - 30**2), rel=1e-4)


@pytest.mark.parametrize("units", ["m", "cm", "inch"])
def test_units(units: str, tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    factor = {"m": 1000.0, "cm": 10.0, "inch": 25.4}[units]
    inp(replace(mesh, points=mesh.points / factor), tmp_path / "a.inp")
    limb = limb_of_mesh(tmp_path / "a.inp", units=units).limb
    assert limb.skin.area == pytest.approx(np.pi * 32**2, rel=1e-3)


def quads(n: int = 48, order: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, quadrilaterals and regions of the rings, the first or second order."""
    radii = np.array([5.0, 8.5, 12.0, 19.0, 26.0, 28.0, 30.0, 31.0, 32.0])
    steps = radii if order == 1 else np.sort(np.append(radii, (radii[1:] + radii[:-1]) / 2))
    m = n * order
    angle = 2 * np.pi * np.arange(m) / m
    points = (steps[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], -1)).reshape(-1, 2)

    def at(i: int, j: int) -> int:
        return i * m + j % m

    rows = []
    for i in range(0, len(steps) - 1, order):
        for j in range(0, m, order):
            o = order
            row = [at(i, j), at(i + o, j), at(i + o, j + o), at(i, j + o)]
            if order == 2:
                row += [at(i + 1, j), at(i + 2, j + 1), at(i + 1, j + 2), at(i, j + 1)]
            rows.append(row)
    return points, np.array(rows), np.repeat([1, 1, 2, 2, 3, 3, 4, 4], n)


@pytest.mark.parametrize("kind", ["CPE4R", "cpe8"])
def test_quadrilaterals_are_split_exactly(kind: str, tmp_path: Path) -> None:
    order = 1 if "4" in kind else 2
    points, cells, regions = quads(order=order)
    sets = {name: np.flatnonzero(regions == i + 1) for i, (name, *_) in enumerate(LAYERS)}
    (tmp_path / "a.inp").write_text(deck(points, {kind: cells}, sets))
    limb = limb_of_mesh(tmp_path / "a.inp").limb
    n = 48
    polygon = n / 2 * np.sin(2 * np.pi / n) if order == 1 else np.pi
    assert limb.areas["skin"] == pytest.approx(polygon * (32**2 - 30**2), rel=1e-5)
    assert "quadrilaterals were split" in found_in(limb)
    assert len(limb.mesh.cell_tags) == 2 * len(cells)  # type: ignore[union-attr]


def test_first_and_second_order_may_meet(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    skin = mesh.cell_tags == mesh.regions["skin"]
    cells = {"CPE6H": mesh.cells[skin], "CPE3": mesh.cells[~skin][:, :3]}
    tag = np.concatenate([mesh.cell_tags[skin], mesh.cell_tags[~skin]])
    sets = {name: np.flatnonzero(tag == number) for name, number in mesh.regions.items()}
    (tmp_path / "a.inp").write_text(deck(mesh.points, cells, sets))
    limb = limb_of_mesh(tmp_path / "a.inp").limb
    assert limb.areas["skin"] == pytest.approx(np.pi * (32**2 - 30**2), rel=1e-4)
    assert "a node was added in the middle" in found_in(limb)


def test_a_limb_of_parts_and_instances(tmp_path: Path) -> None:
    """As Abaqus/CAE writes it: numbers begin anew in each part, and sets have the same name."""
    mesh = limb_alone(ring())
    lines = []
    for name, tag in mesh.regions.items():
        used, cells = np.unique(mesh.cells[mesh.cell_tags == tag], return_inverse=True)
        shift = [0.0, 0.0] if name != "fat" else [100.0, 0.0]
        lines += [f"*Part, name={name}-part", "*Node"]
        lines += [
            f"{i}, {x!r}, {y!r}" for i, (x, y) in enumerate((mesh.points[used] - shift).tolist(), 1)
        ]
        lines.append("*Element, type=CPE6M")
        lines += [
            ", ".join(map(str, [i, *row]))
            for i, row in enumerate((cells.reshape(-1, 6) + 1).tolist(), 1)
        ]
        lines += ["*Elset, elset=Set-1, generate", f"  1, {len(cells.reshape(-1, 6))}, 1",
                  "*End Part"]  # fmt: skip
    lines.append("*Assembly, name=Assembly")
    for name in mesh.regions:
        lines += [f"*Instance, name={name}-1, part={name}-part"]
        lines += ["100., 0., 0."] if name == "fat" else []
        lines.append("*End Instance")
    lines += ["*Nset, nset=_Picked, internal, instance=skin-1", "1, 2", "*End Assembly"]
    (tmp_path / "a.inp").write_text("\n".join(lines))
    sets = {f"{name}-1.Set-1": name for name in mesh.regions}
    limb = limb_of_mesh(tmp_path / "a.inp", sets).limb
    assert limb.areas["fat"] == pytest.approx(np.pi * (30**2 - 26**2), rel=1e-4)
    assert "were merged" in found_in(limb)


def test_tables_of_sets(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    vtu(mesh, tmp_path / "a.vtu")
    table = tmp_path / "sets.csv"
    table.write_text("set,region,tissue\n1,tibia\n2,calf,muscle\n3,fat\n4,skin\n")
    of_csv = cs.Limb.from_mesh(tmp_path / "a.vtu", table)
    toml = tmp_path / "sets.toml"
    toml.write_text(
        '1 = "tibia"\n2 = {tissue = "muscle", name = "calf"}\n3 = "fat"\n4 = {tissue = "skin"}\n'
    )
    assert cs.Limb.from_mesh(tmp_path / "a.vtu", toml) == of_csv
    assert of_csv.tissues == {"tibia": "bone", "calf": "muscle", "fat": "fat", "skin": "skin"}


def test_a_table_may_have_semicolons(tmp_path: Path) -> None:
    vtu(limb_alone(ring()), tmp_path / "a.vtu")
    (tmp_path / "sets.csv").write_text("1;tibia\n2;calf;muscle\n3;fat\n4;skin\n")
    limb = cs.Limb.from_mesh(tmp_path / "a.vtu", tmp_path / "sets.csv")
    assert limb.tissues["calf"] == "muscle"


def test_a_deck_of_a_windows_code_page(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    inp(mesh, tmp_path / "a.inp")
    text = (tmp_path / "a.inp").read_text().replace("ELSET=skin", "ELSET=Außenhülle")
    (tmp_path / "a.inp").write_bytes(f"** Gefäße\n{text}".encode("cp1252"))
    sets = {"tibia": "tibia", "muscle": "muscle", "fat": "fat", "Außenhülle": "skin"}
    assert limb_of_mesh(tmp_path / "a.inp", sets).limb.tissues["skin"] == "skin"


def test_sets_of_tissues_tell_those_of_regions_with_names_of_their_own(tmp_path: Path) -> None:
    """As an exported deck has them: one set for each region, and one for each tissue."""
    mesh = limb_alone(ring())
    sets = sets_of(mesh)
    sets["gastro"], sets["soleus"] = sets["muscle"][::2], sets["muscle"][1::2]
    sets["TISSUE_muscle"] = sets.pop("muscle")
    (tmp_path / "a.inp").write_text(deck(mesh.points, {"CPE6": mesh.cells}, sets))
    tissues = limb_of_mesh(tmp_path / "a.inp").limb.tissues
    assert {name for name, tissue in tissues.items() if tissue == "muscle"} == {"gastro", "soleus"}


# ----- where it is fixed, and how it lies


def disc() -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """A limb without a hole: points, triangles and sets."""
    radii = [3.0, 7.0, 10.0, 12.0, 16.0, 21.0, 26.0, 30.0, 32.0]
    angle = 2 * np.pi * np.arange(36) / 36
    rows = [r * np.column_stack([np.cos(angle + r), np.sin(angle + r)]) for r in radii]
    points = np.concatenate([np.zeros((1, 2)), *rows])
    cells = Delaunay(points).simplices.astype(np.int64)
    radius = np.linalg.norm(points[cells].mean(axis=1), axis=1)
    number = np.searchsorted([11.5, 25.9, 29.9], radius)
    return points, cells, {name: np.flatnonzero(number == i) for i, (name, *_) in enumerate(LAYERS)}


def test_a_bone_without_a_cavity_is_fixed_at_its_surface(tmp_path: Path) -> None:
    points, cells, sets = disc()
    (tmp_path / "a.inp").write_text(deck(points, {"S3": cells}, sets))
    limb = limb_of_mesh(tmp_path / "a.inp").limb
    assert "fixed at the surface of tibia, which has no hole" in found_in(limb)
    edges = limb.mesh.edges(tags.TIBIA_MEDULLARY)  # type: ignore[union-attr]
    assert np.linalg.norm(edges, axis=-1).max() == pytest.approx(12.0)
    assert limb.regions[0].holes == ()  # so that a report says nothing of an inner boundary
    result = cs.Simulation(limb, NormalOffset(base=0.2), COMBINED, mesh_size="coarse").solve()
    assert result.checks.relative_force_imbalance < 1e-6
    fields = result.fields
    in_bone = np.unique(fields.cells[fields.region == 1])
    assert np.abs(fields.displacement[in_bone]).max() < 1e-6


def test_holes_without_bones_are_held(tmp_path: Path) -> None:
    """Two bones that were left out of the mesh."""
    points, cells, sets = disc()
    centre = points[cells].mean(axis=1)
    holes = [np.linalg.norm(centre - [x, 0], axis=1) < 5 for x in (-15.0, 15.0)]
    gone = holes[0] | holes[1]
    number = np.searchsorted([25.9, 29.9], np.linalg.norm(centre, axis=1))[~gone]
    sets = {name: np.flatnonzero(number == i) for i, name in enumerate(["muscle", "fat", "skin"])}
    (tmp_path / "a.inp").write_text(deck(points, {"S3": cells[~gone]}, sets))
    with pytest.raises(cs.InputError, match="which of its holes is the limb fixed at"):
        limb_of_mesh(tmp_path / "a.inp")
    limb = limb_of_mesh(tmp_path / "a.inp", fixed="holes").limb
    assert "fixed at its 2 holes, as said" in found_in(limb)


def test_a_region_is_named_that_the_limb_is_fixed_at(tmp_path: Path) -> None:
    path = first_order(limb_alone(ring()), tmp_path)
    limb = limb_of_mesh(path, fixed="muscle").limb
    assert "fixed at the surface of muscle, as said" in found_in(limb)
    edges = limb.mesh.edges(tags.TIBIA_MEDULLARY)  # type: ignore[union-attr]
    ends = np.linalg.norm(edges[:, 0], axis=-1)
    assert {12, 26} == set(np.round(ends[np.abs(ends - np.round(ends)) < 1e-9]).astype(int))
    limb = limb_of_mesh(path, fixed="tibia").limb
    assert "fixed at the hole in tibia, as said" in found_in(limb)


def test_a_limb_is_fixed_by_a_set_of_nodes(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    at = np.flatnonzero(np.abs(np.linalg.norm(mesh.points, axis=1) - 12.0) < 1e-6) + 1
    more = "*NSET, NSET=Held\n" + "\n".join(map(str, at)) + "\n"
    (tmp_path / "a.inp").write_text(deck(mesh.points, {"CPE6": mesh.cells}, sets_of(mesh), more))
    limb = limb_of_mesh(tmp_path / "a.inp", fixed="held").limb
    edges = limb.mesh.edges(tags.TIBIA_MEDULLARY)  # type: ignore[union-attr]
    np.testing.assert_allclose(np.linalg.norm(edges, axis=-1), 12.0, atol=0.01)


def test_a_limb_is_fixed_by_the_nodes_of_a_set_of_elements(tmp_path: Path) -> None:
    mesh = limb_alone(ring())
    more = "*NSET, NSET=HOLD, ELSET=tibia\n"
    (tmp_path / "a.inp").write_text(deck(mesh.points, {"CPE6": mesh.cells}, sets_of(mesh), more))
    limb = limb_of_mesh(tmp_path / "a.inp", fixed="hold").limb
    assert "fixed at HOLD, as said" in found_in(limb)
    edges = limb.mesh.edges(tags.TIBIA_MEDULLARY)  # type: ignore[union-attr]
    assert np.linalg.norm(edges, axis=-1).max() == pytest.approx(12.0, abs=1e-3)


def test_the_origin_is_moved_into_the_limb_and_the_socket_with_it(tmp_path: Path) -> None:
    moved = replace(ring(), points=ring().points + np.array([150.0, 40.0]))
    msh22(moved, tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh", side="left", anterior="-x")
    socket = cs.Socket.from_mesh(tmp_path / "a.msh", limb)
    centre = limb.skin.evaluate(limb.skin.sample(0.5)).mean(axis=0)
    np.testing.assert_allclose(centre, 0, atol=0.05)
    back = section.build(limb, socket, SIZES["coarse"])
    inside = back.facets[back.facet_tags == tags.FACETS[tags.SOCKET_INNER]]
    np.testing.assert_allclose(np.linalg.norm(back.points[inside], axis=-1), 31.7, atol=0.05)
    assert limb.axes == {"+x": "medial", "+y": "anterior"}
    assert limb.source is not None
    np.testing.assert_allclose(limb.source.anterior, [-1, 0, 0], atol=1e-9)


def test_the_nearest_points_of_a_curve() -> None:
    circle = curves.ellipse((0, 0), (10, 10), 0)
    points = np.array([[20.0, 0.0], [0.0, 5.0], [-9.0, -9.0]])
    expected = 10 * points / np.linalg.norm(points, axis=1)[:, None]
    np.testing.assert_allclose(circle.evaluate(circle.nearest(points)), expected, atol=1e-3)
    assert set(limb_curves(circles())) == {"c0", "c1", "c2", "c3", "c4"}


@pytest.mark.slow
def test_its_outlines_alone_make_a_limb_that_is_meshed_here(tmp_path: Path) -> None:
    """The calf's own regions, from its mesh."""
    calf = cs.Limb.reference()
    msh22(section.build(calf, cs.Socket.reference("TSB"), SIZES["coarse"]), tmp_path / "a.msh")
    limb = cs.Limb.from_mesh(tmp_path / "a.msh", anterior="+y", side="right", outlines=True)
    assert limb.mesh is None
    assert set(calf.tissues) <= set(limb.tissues)
    for name in ("soleus", "tibia", "fibula", "great_saphenous_vein", "tibialis_anterior"):
        assert limb.areas[name] == pytest.approx(calf.areas[name], rel=0.03)
    with pytest.raises(cs.InputError, match="septum: belongs to outlines"):
        cs.Limb.from_mesh(tmp_path / "a.msh", septum=0.5)
    with pytest.raises(cs.InputError, match="fixed: belongs to a mesh that is solved as it is"):
        cs.Limb.from_mesh(tmp_path / "a.msh", outlines=True, fixed="tibia")


# ----- commands


def test_the_commands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    msh22(ring(), tmp_path / "a.msh")
    assert cli.main(["limb", "a.msh", "--side", "right", "--anterior", "+y"]) == 0
    printed = capsys.readouterr().out
    assert "smallest angle" in printed and "fixed at the hole in tibia" in printed
    assert cli.main(["socket", "a.msh", "--limb", "limb.json"]) == 0
    assert "a wall of 4.3 mm on average" in capsys.readouterr().out
    assert Path("limb.png").stat().st_size > 5000 < Path("socket.png").stat().st_size
    Path("study.toml").write_text(
        '[study]\nlimb = "limb.json"\nsockets = ["own", "mine"]\nmaterials = ["combined"]\n'
        '[model]\nsize = "coarse"\n[sockets.own]\nmesh = "socket.json"\n'
        '[sockets.mine]\nlaw = "normal_offset"\nbase = "0.4 mm"\n'
    )
    assert cli.main(["check", "study.toml"]) == 0
    printed = capsys.readouterr().out
    assert "its wall is the mesh of a.msh" in printed
    assert "askew" not in printed
    assert cli.main(["show", "study.toml", "--out", "show.png"]) == 0


def test_check_warns_of_a_mesh_beside_its_place(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    msh22(ring(), tmp_path / "a.msh")
    msh22(replace(ring(), points=ring().points + np.array([3.0, 0.0])), tmp_path / "b.msh")
    assert cli.main(["limb", "a.msh", "--side", "right", "--anterior", "+y"]) == 0
    assert cli.main(["socket", "b.msh", "--limb", "limb.json"]) == 0
    assert "warning: lies askew on the limb" in capsys.readouterr().out
    Path("study.toml").write_text(
        '[study]\nlimb = "limb.json"\nsockets = ["own"]\nmaterials = ["combined"]\n'
        '[model]\nsize = "coarse"\n[sockets.own]\nmesh = "socket.json"\n'
    )
    assert cli.main(["check", "study.toml"]) == 0
    said = capsys.readouterr()
    assert "sockets.own: lies askew on the limb" in said.out + said.err
    assert "moved by (-3, 0) mm it would be from 0.3 to 0.3 mm" in said.out + said.err


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda c: c["mesh"].update(points="!"), "points: is not base64"),
        (lambda c: c["mesh"].update(cells=c["mesh"]["cells"][:-8]), "is cut off"),
        (lambda c: c["mesh"].update(regions=c["mesh"]["regions"][:-8]), "numbers for"),
        (lambda c: c["mesh"].update(points=c["mesh"]["points"][:640]), "a node that there is not"),
        (lambda c: c["mesh"]["boundaries"].pop("skin_surface"), "'skin_surface' is missing"),
        (lambda c: c["mesh"]["boundaries"].update(skin="AAAA"), "boundaries: no boundary 'skin'"),
        (lambda c: c["regions"].pop(), "has triangles of a region 4, which is not listed"),
        (lambda c: c["regions"].append({"id": 9, "name": "x", "tissue": "fat"}),
         "regions.x: has no triangles; remove it"),
        (lambda c: c.pop("mesh"), "regions.tibia.outer: is missing; add it"),
        (lambda c: c.update(contact_boundary="skn"), "contact_boundary: no curve 'skn'"),
    ],
)  # fmt: skip
def test_a_file_that_was_changed_gets_one_line(
    change: Callable[[dict], object], says: str, tmp_path: Path
) -> None:
    msh22(ring(), tmp_path / "a.msh")
    cs.Limb.from_mesh(tmp_path / "a.msh").write(tmp_path / "limb.json")
    content = json.loads((tmp_path / "limb.json").read_text())
    change(content)
    (tmp_path / "limb.json").write_text(json.dumps(content))
    with pytest.raises(cs.InputError) as error:
        cs.Limb.read(tmp_path / "limb.json")
    assert says in str(error.value)
    assert str(error.value).startswith(str(tmp_path))
