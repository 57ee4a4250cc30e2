"""The meshes of the section: their size, their quality, and that they are what was asked for."""

from pathlib import Path

import gmsh
import numpy as np
import pandas as pd
import pytest
from geometry import LIMB, LOOPS, SKIN, section_of
from mesh_measures import area, facets, jacobian_bounds, layers_across
from mpi4py import MPI
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.fenics import read_from_msh
from calfsocket.meshes import gmsh_model, quality, section, tags
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.sizing import SIZES, LimbSizes, mesh_size
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import TriangleMesh

HS = Socket.reference("HS")


@pytest.fixture(params=SIZES)
def sized(request: pytest.FixtureRequest) -> tuple[str, TriangleMesh]:
    """A size's name, and the hydrostatic socket's mesh of this size."""
    return request.param, section_of("HS", request.param)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pd.DataFrame]:
    """The hydrostatic socket's coarse mesh as a file, and its quality table."""
    path = tmp_path_factory.mktemp("mesh") / "hs.msh"
    return path, section.write_section(path, LIMB, HS, mesh_size("coarse"))


def count(mesh: TriangleMesh) -> tuple[int, int]:
    """Triangles of limb and of socket."""
    socket = int(np.sum(mesh.cell_tags == tags.SOCKET_ID))
    return len(mesh.cells) - socket, socket


def distance_to(curve: ClosedCurve, points: np.ndarray) -> np.ndarray:
    """Distance of points from a curve: the nearest of many points on it, then Newton."""
    t = curve.sample(0.02)
    t = t[cKDTree(curve.evaluate(t)).query(points)[1]]
    for _ in range(3):
        velocity = curve.evaluate(t, 1)
        off = curve.evaluate(t) - points
        slope = np.sum(velocity**2, axis=1) + np.sum(off * curve.evaluate(t, 2), axis=1)
        t = t - np.sum(off * velocity, axis=1) / slope
    return np.linalg.norm(curve.evaluate(t) - points, axis=1)


def test_sizes_have_the_number_of_triangles_they_are_named_for(
    sized: tuple[str, TriangleMesh],
) -> None:
    name, mesh = sized
    limb, socket = count(mesh)
    if name == "paper":
        assert limb == pytest.approx(26_330, rel=0.01)  # the paper's numbers, line 44
        assert socket == pytest.approx(3_000, rel=0.05)
    else:
        about = {"coarse": 7_000, "medium": 14_000}[name]
        assert limb + socket == pytest.approx(about, rel=0.05)


def test_every_tag_is_present_and_named(sized: tuple[str, TriangleMesh]) -> None:
    _, mesh = sized
    assert mesh.regions == LIMB.region_tags | {"socket": 100}
    assert mesh.boundaries == tags.BOUNDARIES
    assert set(mesh.cell_tags) == set(mesh.regions.values())
    assert set(mesh.facet_tags) == set(mesh.boundaries.values())


def test_every_node_is_used_and_the_mesh_conforms(sized: tuple[str, TriangleMesh]) -> None:
    """A side has two triangles, or one where it lies on a named boundary; no other exist."""
    _, mesh = sized
    assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.points)))
    middle, uses = np.unique(mesh.cells[:, 3:], return_counts=True)
    assert set(uses) == {1, 2}
    assert np.array_equal(middle[uses == 1], np.sort(mesh.facets[:, 2]))
    bodies = mesh.cell_tags == tags.SOCKET_ID
    assert not np.intersect1d(mesh.cells[bodies], mesh.cells[~bodies]).size


def test_boundaries_lie_on_their_curves_mid_side_nodes_too(
    sized: tuple[str, TriangleMesh],
) -> None:
    _, mesh = sized
    inner, outer = HS.faces(LIMB)
    curves = {
        tags.SKIN_SURFACE: SKIN,
        tags.TIBIA_MEDULLARY: LOOPS["tibia_medullary"],
        tags.SOCKET_INNER: inner,
        tags.SOCKET_OUTER: outer,
    }
    for name, curve in curves.items():
        own = facets(mesh, name)
        assert distance_to(curve, mesh.points[np.unique(own)]).max() < 1e-6
        # The facets make up the whole curve.
        start, end, middle = (mesh.points[own[:, i]] for i in range(3))
        points, weights = np.polynomial.legendre.leggauss(4)
        along = [(end - start) / 2 + s * (start + end - 2 * middle) for s in points]
        length = np.einsum("q,qf->", weights, np.linalg.norm(along, axis=-1))
        assert length == pytest.approx(curve.perimeter, rel=1e-4)


def test_all_mid_side_nodes_between_regions_lie_on_the_curves(
    sized: tuple[str, TriangleMesh],
) -> None:
    _, mesh = sized
    inside = {region.outer: region for region in LIMB.regions}
    for name, curve in LOOPS.items():
        if name not in inside or name == LIMB.contact_boundary:
            continue
        in_vessel = mesh.cell_tags == inside[name].id
        (around,) = (region.id for region in LIMB.regions if name in region.holes)
        shared = np.intersect1d(mesh.cells[in_vessel], mesh.cells[mesh.cell_tags == around])
        middles = np.intersect1d(shared, mesh.cells[:, 3:])
        assert len(middles) == len(shared) / 2 > 4
        assert distance_to(curve, mesh.points[shared]).max() < 1e-6


def test_no_triangle_is_inverted_anywhere(sized: tuple[str, TriangleMesh]) -> None:
    name, mesh = sized
    assert jacobian_bounds(mesh.coordinates)[0].min() > 0
    least = {"coarse": 0.2, "medium": 0.25, "paper": 0.4}[name]
    assert quality.scaled_jacobians(mesh.coordinates).min() > least


def test_areas_are_those_of_the_data(sized: tuple[str, TriangleMesh]) -> None:
    _, mesh = sized
    areas = LIMB.areas
    for region in LIMB.regions:
        allowed = 0.02 if region.tissue == "vessel" else 0.01
        expected = pytest.approx(areas[region.name], rel=allowed)
        assert area(mesh, region.name) == expected, region.name


def test_two_elements_across_every_fascia_band_at_paper_size(
    sized: tuple[str, TriangleMesh],
) -> None:
    name, mesh = sized
    layers = layers_across(mesh, "deep_fascia")
    assert layers.thickness.min() == pytest.approx(0.534, abs=0.01)  # the geometry's note
    band = layers.thickness >= 0.7
    assert band.sum() > 500
    single = np.sum(layers.count[band] < 2)
    if name == "paper":
        assert single == 0
    else:  # the measure can show it
        assert single > 500


def test_the_limb_is_the_same_in_every_socket() -> None:
    meshes = [section_of(socket) for socket in ("TC", "HS")]
    limbs = [mesh.coordinates[mesh.cell_tags != tags.SOCKET_ID] for mesh in meshes]
    assert np.array_equal(*limbs)
    assert count(meshes[0])[1] == pytest.approx(count(meshes[1])[1], rel=0.05)


def test_the_file_can_be_read_back_with_its_names(written: tuple[Path, pd.DataFrame]) -> None:
    path, table = written
    assert list(path.parent.iterdir()) == [path]  # nothing unfinished beside it
    made = section_of("HS")
    with gmsh_model.session("read"):
        gmsh.merge(str(path))
        read = gmsh_model.extract()
    assert (read.regions, read.boundaries) == (made.regions, made.boundaries)
    # Nodes are written with 16 digits, after smoothing.
    assert read.points == pytest.approx(made.points, abs=1e-12)
    assert np.array_equal(read.cells, made.cells)

    mesh, cell_tags, facet_tags = read_from_msh(path, MPI.COMM_SELF, gdim=2)[:3]
    assert mesh.topology.index_map(2).size_global == len(made.cells) == table.triangles.sum()
    assert set(cell_tags.values) == set(made.regions.values())
    assert len(facet_tags.values) == len(made.facets)


def test_the_quality_table_has_a_row_a_region(written: tuple[Path, pd.DataFrame]) -> None:
    table = written[1].set_index("region")
    assert len(table) == 28
    assert table.tissue.to_dict() == LIMB.tissues | {"socket": "socket"}
    assert table.data_mm2["soleus"] == pytest.approx(LIMB.areas["soleus"])
    assert table.deviation_percent.abs().max() < 1
    # A wall of 4.5 mm around the inner face: 4.5 * perimeter + pi * 4.5^2.
    inner, _ = HS.faces(LIMB)
    assert table.data_mm2["socket"] == pytest.approx(
        4.5 * inner.perimeter + np.pi * 4.5**2, abs=0.1
    )
    assert table.min_scaled_jacobian.between(0.2, 1).all()
    assert table.min_angle_deg.between(10, 60).all()
    text = quality.format_table(table.reset_index())
    assert len(text.splitlines()) == 29
    assert "soleus muscle" in text


@pytest.mark.parametrize(
    ("file", "expected"),
    [("hs.vtk", r"use a name that ends in \.msh"), ("nowhere/hs.msh", "no folder")],
)
def test_wrong_names_of_files_are_refused(tmp_path: Path, file: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        section.write_section(tmp_path / file, LIMB, HS, mesh_size("coarse"))
    assert not list(tmp_path.iterdir())


def test_the_size_field_is_as_small_as_asked_and_no_steeper() -> None:
    size = mesh_size("coarse")
    field = LimbSizes(LOOPS, LIMB.contact_boundary).field(size)
    x, y = (field.origin[i] + 0.25 * np.arange(field.values.shape[i]) for i in (0, 1))

    def at(point: tuple[float, float]) -> float:
        return field.values[np.argmin(np.abs(x - point[0])), np.argmin(np.abs(y - point[1]))]

    assert field.values.max() == size.largest
    # The medial septum between soleus and gastrocnemius at (0, -32) is under 1 mm thick, so that
    # the size there is 1.7 times that; the middle of the soleus is far from all curves.
    assert at((0.0, -40.0)) < 1.7
    assert at((-20.0, -5.0)) > 5
    for axis in (0, 1):
        slope = np.abs(np.diff(field.values, axis=axis)).max() / 0.25
        assert slope < 1.01 * size.growth
