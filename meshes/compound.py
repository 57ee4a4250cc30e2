"""A compound of tissues in layers and compartments on bone, under a plate: the calibration test."""

from itertools import chain, pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from mpi4py import MPI
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from calfsocket.io.schema import Strict, read_json
from calfsocket.io.system import gmsh
from calfsocket.meshes import gmsh_model, tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.limb import Units
from calfsocket.meshes.plate import Plate, add_fillets, add_plate
from calfsocket.meshes.sizing import MeshSize
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.triangles import TriangleMesh

#: Points of a curve from which gmsh measures distances.
SAMPLING = 200


class CompoundLayers(Strict):
    """Thicknesses from the surface to the depth, mm; muscle is the depth of a compartment."""

    skin: PositiveFloat
    fat: PositiveFloat
    fascia: PositiveFloat
    muscle: PositiveFloat
    periosteum: PositiveFloat
    bone: PositiveFloat


class Compartments(Strict):
    """Muscle compartments side by side: their width, and that of the septa between them, mm.

    The septa lean by an angle against the vertical, which has no meaning for the halves of one at
    either end.
    """

    number: PositiveInt
    width: PositiveFloat
    septum: PositiveFloat
    lean_deg: Annotated[float, Field(gt=-45, lt=45)]
    corner_radius: PositiveFloat


class Compound(Strict):
    """Skin, fat, fascia around compartments of muscle, and bone, under a plate; stroke in mm."""

    title: str
    units: Units
    source: str = ""
    layers: CompoundLayers
    compartments: Compartments
    plate: Plate
    stroke: PositiveFloat

    @model_validator(mode="after")
    def _fits(self) -> "Compound":
        layers, inside = self.layers, self.compartments
        narrowest = inside.width - abs(self.lean)
        if 4 * inside.corner_radius > min(layers.muscle, narrowest):
            raise ValueError(
                f"compartments.corner_radius: {inside.corner_radius} mm is more than a quarter of "
                f"the smaller side of a compartment, {min(layers.muscle, narrowest):.3g} mm"
            )
        soft = self.top - layers.bone
        if self.stroke > 0.5 * soft:
            raise ValueError(
                f"stroke: {self.stroke} mm is more than half of the soft layers, {soft:.3g} mm"
            )
        return self

    @property
    def width(self) -> float:
        """Width of the compound, mm."""
        return self.compartments.number * (self.compartments.width + self.compartments.septum)

    @property
    def top(self) -> float:
        """Height of the skin's surface above the lower face of the bone, mm."""
        return sum(thickness for _, thickness in self.layers)

    @property
    def lean(self) -> float:
        """How far the upper end of a septum is ahead of its lower end, mm."""
        return self.layers.muscle * float(np.tan(np.deg2rad(self.compartments.lean_deg)))

    @property
    def muscles(self) -> list[str]:
        """Names of the regions of muscle."""
        return [f"muscle_{i + 1}" for i in range(self.compartments.number)]

    @property
    def tissues(self) -> dict[str, str]:
        """Tissue of each region, the plate ("socket") among them."""
        return (
            {name: name for name in ("skin", "fat", "fascia")}
            | dict.fromkeys(self.muscles, "muscle")
            | {"bone": "bone", tags.SOCKET: tags.SOCKET}
        )


def load_compound(path: Path | str | None = None) -> Compound:
    """Read a compound, by default that of the package.

    Raises
    ------
    InputError
        When the file cannot be read, or a key or a dimension is wrong.
    """
    return read_json(
        Path(path) if path is not None else Path(__file__).with_name("compound.json"), Compound
    )


def compound_mesh(comm: MPI.Comm, compound: Compound, size: MeshSize) -> SectionMesh:
    """Mesh a compound and its plate, on all ranks of `comm`."""
    return distribute(comm, lambda: build(compound, size))


def build(compound: Compound, size: MeshSize) -> TriangleMesh:
    """Mesh a compound and its plate on this process; x = 0 is the middle, y = 0 below the bone."""
    layers = compound.layers
    depths = [
        layers.bone,
        layers.periosteum + layers.muscle + layers.fascia,
        layers.fat,
        layers.skin,
    ]
    heights = np.cumsum([0.0, *depths])
    # By the rules of the limb: fine along fascia and skin, growing from there.
    inside = compound.compartments
    thinnest = min(layers.fascia, layers.periosteum, inside.septum)
    on_fascia = float(np.clip(size.gap_fraction * thinnest, size.smallest, size.on_curves))
    at_corners = min(on_fascia, size.curvature_fraction * inside.corner_radius)
    with gmsh_model.session("compound"):
        right = 0.5 * compound.width
        ends = [[gmsh.model.occ.addPoint(x, y, 0.0) for x in (-right, right)] for y in heights]
        across = [gmsh.model.occ.addLine(*pair) for pair in ends]
        sides = [
            [gmsh.model.occ.addLine(low[i], high[i]) for i in (0, 1)]
            for low, high in pairwise(ends)
        ]
        muscles = [add_fillets(corners) for corners in _compartments(compound, heights[1])]
        bone, fascia, fat, skin = (
            gmsh_model.add_region(
                [across[level], right_side, across[level + 1], left_side],
                *(muscles if level == 1 else []),
            )
            for level, (left_side, right_side) in enumerate(sides)
        )
        within = [gmsh_model.add_region(muscle) for muscle in muscles]
        plate, face, back = add_plate(compound.plate, 0.0, heights[-1], side=1)
        gmsh_model.mesh(
            {
                "skin": skin,
                "fat": fat,
                "fascia": fascia,
                **dict(zip(compound.muscles, within, strict=True)),
                "bone": bone,
                tags.SOCKET: plate,
            },
            {
                tags.SKIN_SURFACE: [across[-1]],
                tags.SOCKET_INNER: face,
                tags.SOCKET_OUTER: back,
                tags.TIBIA_MEDULLARY: [across[0]],
                tags.SIDES: [*chain(*sides)],
            },
            lambda: [
                gmsh_model.add_growth(
                    gmsh_model.add_field("Distance", CurvesList=curves, Sampling=SAMPLING),
                    h,
                    size.largest,
                    size.growth,
                )
                for curves, h in (
                    ([*across[1:3], *chain(*muscles)], on_fascia),
                    ([arc for muscle in muscles for arc in muscle[::2]], at_corners),
                    (across[-2:], size.on_skin),
                    (face, size.socket_inner),
                )
            ],
        )
        return smooth(gmsh_model.extract())


def _compartments(compound: Compound, bone: float) -> list[list[tuple[float, float, float]]]:
    """Corners of each compartment, counter-clockwise, with their radius."""
    layers, inside = compound.layers, compound.compartments
    low = bone + layers.periosteum
    high = low + layers.muscle
    walls = np.linspace(-0.5, 0.5, inside.number + 1) * compound.width
    lean = np.full(inside.number + 1, 0.5 * compound.lean)
    lean[[0, -1]] = 0.0  # the compound's own sides
    half = 0.5 * inside.septum
    return [
        [
            (walls[i] - lean[i] + half, low, inside.corner_radius),
            (walls[i + 1] - lean[i + 1] - half, low, inside.corner_radius),
            (walls[i + 1] + lean[i + 1] - half, high, inside.corner_radius),
            (walls[i] + lean[i] + half, high, inside.corner_radius),
        ]
        for i in range(inside.number)
    ]
