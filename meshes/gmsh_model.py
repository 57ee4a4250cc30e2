"""gmsh, tamed: one session at a time, one closed edge per loop, plain arrays out."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import gmsh
import numpy as np

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.triangles import TriangleMesh

#: Element types of the MSH format: 3-node line and 6-node triangle.
LINE3, TRIANGLE6 = 8, 9

# Everything that decides where a node goes, so that neither a user's ~/.gmshrc nor the number of
# processors can move one. Frontal-Delaunay gives the best-shaped triangles. The element size is
# the background field's alone.
OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.RandomSeed": 1,
    "Mesh.Algorithm": 6,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    # The default 1e-9 integrates the size along an edge to far more digits than it has.
    "Mesh.LcIntegrationPrecision": 1e-5,
    # gmsh's smoothing asks OpenCASCADE whether each node is still inside; ours is in smoothing.py.
    "Mesh.Smoothing": 0,
    "Mesh.SecondOrderLinear": 0,
    "Mesh.HighOrderOptimize": 0,
    "Mesh.MshFileVersion": 4.1,
}


@contextmanager
def session(name: str) -> Iterator[None]:
    """Open gmsh with a new model of this name and close it again, whatever happens in between."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield
    finally:
        gmsh.finalize()


def add_loop(curve: ClosedCurve) -> int:
    """Add a closed curve as one OpenCASCADE edge, exactly, and return its tag.

    One edge that starts and ends in the same vertex has no joints at which the mesh would have to
    place a node, and gmsh puts the mid-side nodes on the curve itself.
    """
    degree, knots, multiplicities, control = curve.b_spline()
    # The last control point is the first: the edge closes on one vertex.
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in control[:-1]]
    edge: int = gmsh.model.occ.addBSpline(
        [*points, points[0]],
        degree=degree,
        knots=knots.tolist(),
        multiplicities=multiplicities.tolist(),
    )
    # The edge has a vertex of its own; control points left in the model would become stray nodes.
    gmsh.model.occ.remove([(0, point) for point in points])
    return edge


def add_region(outer: int, holes: Sequence[int] = ()) -> int:
    """Add the plane surface inside edge `outer` and outside the edges `holes`; return its tag."""
    loops = [gmsh.model.occ.addCurveLoop([edge]) for edge in (outer, *holes)]
    surface: int = gmsh.model.occ.addPlaneSurface(loops)
    return surface


def name_regions(
    surfaces: Mapping[str, int],
    edges: Mapping[str, Sequence[int]],
    region_tags: Mapping[str, int],
    boundary_tags: Mapping[str, int],
) -> None:
    """Give surfaces and edges their names and tags as physical groups of the current model."""
    for name, surface in surfaces.items():
        gmsh.model.addPhysicalGroup(2, [surface], region_tags[name], name)
    for name, parts in edges.items():
        gmsh.model.addPhysicalGroup(1, parts, boundary_tags[name], name)


def mesh_order2() -> None:
    """Mesh the current model with 6-node triangles whose mid-side nodes lie on the curves."""
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(2)


def move_nodes(points: np.ndarray) -> None:
    """Move the nodes of the current model to these points, in the order of `extract`."""
    node_tags = np.sort(gmsh.model.mesh.getNodes()[0])
    for node, point in zip(node_tags, points, strict=True):
        gmsh.model.mesh.setNode(node, [*point, 0.0], [])


def extract() -> TriangleMesh:
    """Return the mesh of the current model as arrays, numbered as gmsh numbers it."""
    node_tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(node_tags)
    node_tags, points = node_tags[order], points.reshape(-1, 3)[order, :2]

    def elements(dim: int, kind: int) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
        nodes, values, names = [], [], {}
        for _, group in gmsh.model.getPhysicalGroups(dim):
            names[gmsh.model.getPhysicalName(dim, group)] = group
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
                _, connectivity = gmsh.model.mesh.getElementsByType(kind, entity)
                width = 6 if kind == TRIANGLE6 else 3
                nodes.append(np.searchsorted(node_tags, connectivity).reshape(-1, width))
                values.append(np.full(len(nodes[-1]), group, dtype=np.int32))
        return np.concatenate(nodes), np.concatenate(values), names

    cells, cell_tags, regions = elements(2, TRIANGLE6)
    facets, facet_tags, boundaries = elements(1, LINE3)
    return TriangleMesh(points, cells, cell_tags, facets, facet_tags, regions, boundaries)
