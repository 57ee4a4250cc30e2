"""A compound of tissues in layers and compartments on bone, under a plate: the calibration test."""

from itertools import chain, pairwise
from pathlib import Path
from typing import Annotated

import gmsh
import numpy as np
from mpi4py import MPI
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from calfsocket.io.schema import Strict, read_json
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
    heights = np.cumsum(
        [
            0.0,
            layers.bone,
            layers.periosteum + layers.muscle + layers.fascia,
            layers.fat,
            layers.skin,
        ]
    )
    with gmsh_model.session("compound"):
        right = 0.5 * compound.width
        ends = [[gmsh.model.occ.addPoint(x, y, 0.0) for x in (-right, right)] for y in heights]
        across = [gmsh.model.occ.addLine(*pair) for pair in ends]
        sides = [
            [gmsh.model.occ.addLine(low[i], high[i]) for i in (0, 1)]
            for low, high in pairwise(ends)
        ]
        muscles = [add_fillets(corners) for corners in _compartments(compound, heights[1])]
        surfaces = {}
        for level, name in enumerate(("bone", "fascia", "fat", "skin")):
            loops = [[across[level], sides[level][1], across[level + 1], sides[level][0]]]
            if name == "fascia":
                loops += muscles
            surfaces[name] = _surface(loops)
        for name, muscle in zip(compound.muscles, muscles, strict=True):
            surfaces[name] = _surface([muscle])
        plate = add_plate(compound.plate, 0.0, heights[-1], side=1)
        gmsh.model.occ.synchronize()

        names = ["skin", "fat", "fascia", *compound.muscles, "bone"]
        gmsh_model.name_regions(
            surfaces | {tags.SOCKET: plate.surface},
            {
                tags.SKIN_SURFACE: [across[-1]],
                tags.SOCKET_INNER: plate.face,
                tags.SOCKET_OUTER: plate.back,
                tags.TIBIA_MEDULLARY: [across[0]],
                tags.SIDES: [*chain(*sides)],
            },
            {name: number for number, name in enumerate(names, start=1)}
            | {tags.SOCKET: tags.SOCKET_ID},
            tags.BOUNDARIES | {tags.SIDES: tags.SIDES_ID},
        )
        _set_size(
            compound,
            size,
            fascia=[*across[1:3], *chain(*muscles)],
            corners=[arc for muscle in muscles for arc in muscle[::2]],
            skin=across[-2:],
            plate=plate.face,
        )
        gmsh_model.mesh_order2()
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


def _surface(loops: list[list[int]]) -> int:
    surface: int = gmsh.model.occ.addPlaneSurface(
        [gmsh.model.occ.addCurveLoop(loop) for loop in loops]
    )
    return surface


def _set_size(
    compound: Compound,
    size: MeshSize,
    fascia: list[int],
    corners: list[int],
    skin: list[int],
    plate: list[int],
) -> None:
    """Set sides by the rules of the limb: fine along fascia and skin, growing from there."""
    layers, inside = compound.layers, compound.compartments
    thinnest = min(layers.fascia, layers.periosteum, inside.septum)
    on_fascia = float(np.clip(size.gap_fraction * thinnest, size.smallest, size.on_curves))
    at_corners = min(on_fascia, size.curvature_fraction * inside.corner_radius)
    field = gmsh.model.mesh.field
    fields = []
    for curves, h in (
        (fascia, on_fascia),
        (corners, at_corners),
        (skin, size.on_skin),
        (plate, size.socket_inner),
    ):
        distance = field.add("Distance")
        field.setNumbers(distance, "CurvesList", curves)
        field.setNumber(distance, "Sampling", SAMPLING)
        threshold = field.add("Threshold")
        for option, value in (
            ("InField", distance),
            ("SizeMin", h),
            ("SizeMax", size.largest),
            ("DistMin", 0.0),
            ("DistMax", (size.largest - h) / size.growth),
        ):
            field.setNumber(threshold, option, value)
        fields.append(threshold)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", fields)
    field.setAsBackgroundMesh(smallest)
