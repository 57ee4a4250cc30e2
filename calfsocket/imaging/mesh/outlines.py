"""The outlines of a mesh's regions alone, for a limb that is meshed here."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from calfsocket.imaging.drawing_parts import Parts
from calfsocket.imaging.label_table import CAVITY, Meaning
from calfsocket.imaging.mesh.plane_mesh import PlaneMesh
from calfsocket.imaging.section import counter_clockwise
from calfsocket.imaging.shapes import largest
from calfsocket.imaging.source import sha256
from calfsocket.meshes.drawn import Drawn
from calfsocket.meshes.given import area_of

#: Names that outlines of a section have.
_SKIN, _FAT, _ENVELOPE = "skin", "fat", "muscle"


def outlines_of(mesh: PlaneMesh, path: Path, tissues: Mapping[str, str]) -> Parts:
    """Return the outlines of a mesh as if they had been drawn.

    The skin's is the outer boundary, the fat's the inner face of the skin, and the envelope of the
    muscles lies around all that is within the fat.
    """
    meanings: dict[str, Meaning] = {}
    curves: dict[str, list[Drawn]] = {}
    for name, tissue, bodies in _named(mesh, tissues):
        meanings[name] = Meaning(name, tissue)
        curves[name] = [_drawn(path, body) for body in bodies]
    return Parts({path.name: sha256(path)}, meanings, curves, None, list(mesh.remarks))


def _named(
    mesh: PlaneMesh, tissues: Mapping[str, str]
) -> Iterator[tuple[str, str, list[shapely.Polygon]]]:
    """Yield the name, the tissue and the areas of each outline."""
    names = list(tissues)

    def cells(*of: str) -> NDArray[np.int64]:
        inside = [number for number, name in enumerate(names) if tissues[name] in of]
        return mesh.cells[np.isin(mesh.regions, inside)]

    yield _SKIN, "skin", [largest(area_of(mesh.points, mesh.cells))]
    deeper = ("fascia", "muscle", "bone", "vessel")
    for name, tissue, within in ((_FAT, "fat", ("fat", *deeper)), (_ENVELOPE, "muscle", deeper)):
        outside = {"skin"} if name == _FAT else {"skin", "fat"}
        if len(cells(*within)) and outside & set(tissues.values()):
            yield name, tissue, [largest(area_of(mesh.points, cells(*within)))]
    for number, name in enumerate(names):
        meaning = Meaning(name, tissues[name])
        area = area_of(mesh.points, mesh.cells[mesh.regions == number])
        if meaning.tissue == "bone":
            bone = largest(area)
            yield name, "bone", [shapely.Polygon(bone.exterior)]
            holes = [shapely.Polygon(ring) for ring in bone.interiors]
            if holes:
                yield f"{name}{CAVITY}", "bone", [max(holes, key=lambda hole: hole.area)]
        elif meaning.is_region and name not in (_SKIN, _FAT, _ENVELOPE):
            yield name, meaning.tissue, [*getattr(area, "geoms", [area])]


def _drawn(path: Path, body: shapely.Polygon) -> Drawn:
    points = counter_clockwise(body)
    return Drawn(path, points, [f"point {number}" for number in range(1, len(points) + 1)])
