"""Bodies for the verification of contact: turned rings of two sizes, a disc on a flat or in a bore.

The boundaries have the names of the section: what is held is ``tibia_medullary`` and
``socket_outer``, what touches is ``skin_surface`` and ``socket_inner``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import gmsh
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.meshes import gmsh_model, tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh

LIMB = "limb"


@dataclass(frozen=True)
class Rings:
    """A limb ring in a socket ring, both about the origin, each with its own element size.

    Attributes
    ----------
    limb, socket : tuple of float
        Inner and outer radius, mm; the limb's outer may be larger than the socket's inner.
    h_limb, h_socket : float
        Length of the triangles' sides, mm.
    turn : float
        Angle at which the socket's numbering starts, rad: it turns the nodes of its faces.
    """

    limb: tuple[float, float]
    socket: tuple[float, float]
    h_limb: float
    h_socket: float
    turn: float = 0.0

    def __post_init__(self) -> None:
        for name, (inner, outer) in (("limb", self.limb), ("socket", self.socket)):
            if not 0 < inner < outer:
                raise InputError(f"rings: {name}: radii {inner} and {outer} mm; need 0 < inner")
        _positive("rings", h_limb=self.h_limb, h_socket=self.h_socket)

    def build(self) -> TriangleMesh:
        """Mesh the rings on this process."""
        with gmsh_model.session("two rings"):
            core, skin = _circle(self.limb[0]), _circle(self.limb[1])
            inner, outer = (_circle(radius, turn=self.turn) for radius in self.socket)
            limb = gmsh_model.add_region(skin, [core])
            socket = gmsh_model.add_region(outer, [inner])
            gmsh.model.occ.synchronize()
            _name(limb, socket, [core], [skin], [inner], [outer])
            _size_by_surface({limb: self.h_limb, socket: self.h_socket})
            gmsh_model.mesh_order2()
            return gmsh_model.extract()

    def mesh(self, comm: MPI.Comm) -> SectionMesh:
        """Mesh on all ranks of `comm`."""
        return distribute(comm, self.build)


@dataclass(frozen=True)
class DiscInCavity:
    """A disc with a held core that touches a cavity at its lowest point, (0, -radius).

    Attributes
    ----------
    radius, core : float
        Outer radius of the disc, about the origin, and of its hole, whose edge is held, mm.
    bore : float
        Radius of the cavity, mm, > radius; infinite for a flat floor (the cavity is a box then).
    thickness : float
        From the cavity to the held outer face, mm.
    h : float
        Length of the triangles' sides where the bodies touch, mm.
    reach : float
        Distance from the point of contact up to which sides have length h, mm.
    growth : float
        Increase of the length with the distance beyond, at most up to a quarter of `radius`.
    """

    radius: float
    core: float
    bore: float
    thickness: float
    h: float
    reach: float
    growth: float = 0.25

    def __post_init__(self) -> None:
        if not 0 < self.core < self.radius < self.bore:
            raise InputError(
                f"disc: core, radius, bore are {self.core}, {self.radius}, {self.bore} mm; "
                "need 0 < core < radius < bore"
            )
        _positive("disc", thickness=self.thickness, h=self.h, reach=self.reach, growth=self.growth)

    def build(self) -> TriangleMesh:
        """Mesh disc and cavity on this process."""
        with gmsh_model.session("disc in cavity"):
            core, skin = _circle(self.core), _circle(self.radius)
            limb = gmsh_model.add_region(skin, [core])
            if math.isinf(self.bore):
                wide, low = 1.25 * self.radius, -self.radius
                inner = _box(-wide, low, wide, wide)
                t = self.thickness
                outer = _box(-wide - t, low - t, wide + t, wide + t)
            else:
                centre = self.bore - self.radius
                inner = [_circle(self.bore, centre)]
                outer = [_circle(self.bore + self.thickness, centre)]
            loops = [gmsh.model.occ.addCurveLoop(edges) for edges in (outer, inner)]
            socket = gmsh.model.occ.addPlaneSurface(loops)
            touch = gmsh.model.occ.addPoint(0.0, -self.radius, 0.0)
            gmsh.model.occ.synchronize()
            _name(limb, socket, [core], [skin], inner, outer)
            self._size_by_distance(touch)
            # The point that distances count from is no node.
            gmsh_model.mesh_order2()
            gmsh.model.removeEntities([(0, touch)])
            return gmsh_model.extract()

    def mesh(self, comm: MPI.Comm) -> SectionMesh:
        """Mesh on all ranks of `comm`."""
        return distribute(comm, self.build)

    def _size_by_distance(self, touch: int) -> None:
        field = gmsh.model.mesh.field
        distance = field.add("Distance")
        field.setNumbers(distance, "PointsList", [touch])
        largest = max(0.25 * self.radius, self.h)
        size = field.add("Threshold")
        for option, value in (
            ("InField", distance),
            ("SizeMin", self.h),
            ("SizeMax", largest),
            ("DistMin", self.reach),
            ("DistMax", self.reach + max(largest - self.h, 1e-9 * largest) / self.growth),
        ):
            field.setNumber(size, option, value)
        field.setAsBackgroundMesh(size)


def _circle(radius: float, centre: float = 0.0, turn: float = 0.0) -> int:
    """Add a circle about (0, centre) that starts at the angle `turn`."""
    edge: int = gmsh.model.occ.addCircle(
        0.0, centre, 0.0, radius, angle1=turn, angle2=turn + 2.0 * math.pi
    )
    return edge


def _box(left: float, low: float, right: float, high: float) -> list[int]:
    """Add the four sides of a rectangle."""
    corners = [(left, low), (right, low), (right, high), (left, high)]
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in corners]
    return [gmsh.model.occ.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]


def _name(
    limb: int,
    socket: int,
    core: Sequence[int],
    skin: Sequence[int],
    inner: Sequence[int],
    outer: Sequence[int],
) -> None:
    gmsh.model.addPhysicalGroup(2, [limb], 1, LIMB)
    gmsh.model.addPhysicalGroup(2, [socket], tags.SOCKET_ID, tags.SOCKET)
    for name, edges in (
        (tags.TIBIA_MEDULLARY, core),
        (tags.SKIN_SURFACE, skin),
        (tags.SOCKET_INNER, inner),
        (tags.SOCKET_OUTER, outer),
    ):
        gmsh.model.addPhysicalGroup(1, edges, tags.BOUNDARIES[name], name)


def _size_by_surface(sizes: dict[int, float]) -> None:
    field = gmsh.model.mesh.field
    parts = []
    for surface, h in sizes.items():
        part = field.add("Constant")
        field.setNumbers(part, "SurfacesList", [surface])
        field.setNumber(part, "VIn", h)
        parts.append(part)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", parts)
    field.setAsBackgroundMesh(smallest)


def _positive(what: str, **lengths: float) -> None:
    for name, value in lengths.items():
        if not value > 0:
            raise InputError(f"{what}: {name} is {value}; need a positive number")
