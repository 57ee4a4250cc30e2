"""gmsh, tamed: one session at a time, one closed edge per loop, plain arrays out."""

import math
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np

from calfsocket.io.system import gmsh
from calfsocket.meshes import tags
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.triangles import TriangleMesh

#: Element types of the MSH format: lines of 2 and 3 nodes, triangles of 3 and 6.
LINE2, LINE3, TRIANGLE3, TRIANGLE6 = 1, 8, 2, 9
#: How many nodes they have.
_NODES = {LINE2: 2, LINE3: 3, TRIANGLE3: 3, TRIANGLE6: 6}

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
    with _termination_kept():
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield
    finally:
        gmsh.finalize()


@contextmanager
def _termination_kept() -> Iterator[None]:
    """Keep what SIGTERM does, which gmsh 4.15 sets back to the default."""
    handler = signal.getsignal(signal.SIGTERM)
    yield
    if handler is not None and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, handler)


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


def add_circle(radius: float, height: float = 0.0, turn: float = 0.0) -> int:
    """Add a circle about (0, height), mm, that starts at the angle `turn`, rad; return its tag."""
    edge: int = gmsh.model.occ.addCircle(
        0.0, height, 0.0, radius, angle1=turn, angle2=turn + 2.0 * math.pi
    )
    return edge


def add_region(*loops: Sequence[int]) -> int:
    """Add the plane surface inside the first closed loop of edges and outside the others."""
    surface: int = gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop(x) for x in loops])
    return surface


def add_field(kind: str, **options: float | str | Sequence[int]) -> int:
    """Add one of gmsh's size fields with its options; return its tag."""
    field = gmsh.model.mesh.field
    tag: int = field.add(kind)
    for option, value in options.items():
        match value:
            case str():
                field.setString(tag, option, value)
            case float() | int():
                field.setNumber(tag, option, value)
            case _:
                field.setNumbers(tag, option, value)
    return tag


def add_growth(distance: int, h: float, largest: float, growth: float, reach: float = 0.0) -> int:
    """Add a size that is h up to a distance (a field), mm, and grows from there to the largest."""
    slope = max(largest - h, 1e-9 * largest) / growth
    return add_field(
        "Threshold", InField=distance, SizeMin=h, SizeMax=largest, DistMin=reach,
        DistMax=reach + slope,
    )  # fmt: skip


def mesh(
    surfaces: Mapping[str, int],
    edges: Mapping[str, Sequence[int]],
    size: Callable[[], Sequence[int]],
    region_tags: Mapping[str, int] | None = None,
    curved: bool = True,
) -> None:
    """Mesh the current model with 6-node triangles whose mid-side nodes lie on the curves.

    Unless they are to be `curved`, they are straight and have 3 nodes, until `curve`.

    `surfaces` and `edges` are by region and boundary. `size` adds size fields when the surfaces are
    there; the smallest counts. `region_tags` are by default 1, 2, ... in the order of `surfaces`;
    socket and liner always have their own.
    """
    gmsh.model.occ.synchronize()
    if region_tags is None:
        names = [name for name in surfaces if name not in (tags.SOCKET, tags.LINER)]
        region_tags = {name: number for number, name in enumerate(names, start=1)}
    region_tags = {**region_tags, tags.SOCKET: tags.SOCKET_ID, tags.LINER: tags.LINER_ID}
    for name, surface in surfaces.items():
        gmsh.model.addPhysicalGroup(2, [surface], region_tags[name], name)
    for name, parts in edges.items():
        gmsh.model.addPhysicalGroup(1, parts, tags.FACETS[name], name)
    gmsh.model.mesh.field.setAsBackgroundMesh(add_field("Min", FieldsList=size()))
    gmsh.model.mesh.generate(2)
    if curved:
        curve()


def curve() -> None:
    """Make 6-node triangles of the current model's straight ones."""
    gmsh.model.mesh.setOrder(2)


def move_nodes(points: np.ndarray) -> None:
    """Move nodes inside regions of the current model to these points, in the order of `extract`.

    Surfaces are meshed with them anew, since gmsh moves nodes one by one.
    """
    mesh = gmsh.model.mesh
    every, _ = _nodes()
    for surface in gmsh.model.getEntities(2):
        inside, _, _ = mesh.getNodes(*surface)
        elements = mesh.getElements(*surface)
        moved = np.zeros((len(inside), 3))
        moved[:, :2] = points[np.searchsorted(every, inside)]
        mesh.clear([surface])
        mesh.addNodes(*surface, inside, moved.ravel())
        mesh.addElements(*surface, *elements)


def extract() -> TriangleMesh:
    """Return the mesh of the current model as arrays, numbered as gmsh numbers it."""
    node_tags, points = _nodes()
    row = np.zeros(int(node_tags[-1]) + 1, dtype=np.int64)
    row[node_tags] = np.arange(len(node_tags))

    def elements(dim: int, kind: int) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
        nodes, values, names = [], [], {}
        for _, group in gmsh.model.getPhysicalGroups(dim):
            names[gmsh.model.getPhysicalName(dim, group)] = group
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
                _, connectivity = gmsh.model.mesh.getElementsByType(kind, entity)
                nodes.append(row[connectivity].reshape(-1, _NODES[kind]))
                values.append(np.full(len(nodes[-1]), group, dtype=np.int32))
        return np.concatenate(nodes), np.concatenate(values), names

    is_curved = TRIANGLE6 in gmsh.model.mesh.getElementTypes(2)
    cells, cell_tags, regions = elements(2, TRIANGLE6 if is_curved else TRIANGLE3)
    facets, facet_tags, boundaries = elements(1, LINE3 if is_curved else LINE2)
    return TriangleMesh(points, cells, cell_tags, facets, facet_tags, regions, boundaries)


def _nodes() -> tuple[np.ndarray, np.ndarray]:
    """Tags and points (n, 2) of the current model's nodes, by tag."""
    node_tags, points, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(node_tags)
    return node_tags[order], points.reshape(-1, 3)[order, :2]
