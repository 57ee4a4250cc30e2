"""A disc that touches a flat floor or the bore of a ring, for the verification of contact.

The boundaries have the names of the section: what is constrained is ``tibia_medullary`` and
``socket_outer``, what touches is ``skin_surface`` and ``socket_inner``.
"""

import math
from typing import Annotated

from mpi4py import MPI
from pydantic import Field, PositiveFloat, model_validator

from calfsocket.io.schema import Strict
from calfsocket.io.system import gmsh
from calfsocket.meshes import gmsh_model, tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh


class DiscInCavity(Strict):
    """A disc with a constrained core that touches a cavity at its lowest point, (0, -radius).

    Attributes
    ----------
    radius, core : float
        Outer radius of the disc, about the origin, and of its hole, whose edge is constrained, mm.
    bore : float
        Radius of the cavity, mm, > radius; infinite for a flat floor (the cavity is a box then).
    thickness : float
        From the cavity to the constrained outer face, mm.
    h : float
        Length of the triangles' sides where the bodies touch, mm.
    reach : float
        Distance from the point of contact up to which sides have length h, mm.
    growth : float
        Increase of the length with the distance beyond, at most up to a quarter of `radius`.
    """

    radius: PositiveFloat
    core: PositiveFloat
    bore: Annotated[float, Field(gt=0, allow_inf_nan=True)]
    thickness: PositiveFloat
    h: PositiveFloat
    reach: PositiveFloat
    growth: PositiveFloat = 0.25

    @model_validator(mode="after")
    def _nested(self) -> "DiscInCavity":
        if not self.core < self.radius < self.bore:
            raise ValueError(
                f"core, radius, bore are {self.core}, {self.radius}, {self.bore} mm; "
                "need core < radius < bore"
            )
        return self

    def build(self) -> TriangleMesh:
        """Mesh disc and cavity on this process."""
        with gmsh_model.session("disc in cavity"):
            core, skin = ([gmsh_model.add_circle(radius)] for radius in (self.core, self.radius))
            limb = gmsh_model.add_region(skin, core)
            if math.isinf(self.bore):
                wide, low, t = 1.25 * self.radius, -self.radius, self.thickness
                inner = _add_box(-wide, low, wide, wide)
                outer = _add_box(-wide - t, low - t, wide + t, wide + t)
            else:
                inner, outer = (
                    [gmsh_model.add_circle(radius, self.bore - self.radius)]
                    for radius in (self.bore, self.bore + self.thickness)
                )
            socket = gmsh_model.add_region(outer, inner)
            touch = gmsh.model.occ.addPoint(0.0, -self.radius, 0.0)

            def size() -> list[int]:
                distance = gmsh_model.add_field("Distance", PointsList=[touch])
                largest = max(0.25 * self.radius, self.h)
                return [gmsh_model.add_growth(distance, self.h, largest, self.growth, self.reach)]

            gmsh_model.mesh(
                {tags.LIMB: limb, tags.SOCKET: socket},
                {
                    tags.TIBIA_MEDULLARY: core,
                    tags.SKIN_SURFACE: skin,
                    tags.SOCKET_INNER: inner,
                    tags.SOCKET_OUTER: outer,
                },
                size,
            )
            gmsh.model.removeEntities([(0, touch)])  # the point that distances count from
            return gmsh_model.extract()

    def mesh(self, comm: MPI.Comm) -> SectionMesh:
        """Mesh on all ranks of `comm`."""
        return distribute(comm, self.build)


def _add_box(left: float, low: float, right: float, high: float) -> list[int]:
    """Add the four sides of a rectangle."""
    corners = [(left, low), (right, low), (right, high), (left, high)]
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in corners]
    return [gmsh.model.occ.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
