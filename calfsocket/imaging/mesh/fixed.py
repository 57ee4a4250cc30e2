"""Where a limb of a mesh is fixed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calfsocket.imaging.mesh.plane_mesh import Loop, PlaneMesh
from calfsocket.imaging.mesh.reader import ReadMesh
from calfsocket.imaging.mesh.sets import Assigned
from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.meshes.curves import xy
from calfsocket.meshes.given import area_of, outer_sides, sides

#: Holes that a message lists.
_LISTED = 6
#: What `fixed` calls all holes.
HOLES = "holes"
#: Bones that a limb is fixed in before the others.
_MAIN_BONES = ("tibia", "femur")


def fixed_sides(
    mesh: PlaneMesh,
    read: ReadMesh,
    parts: Assigned,
    loops: Sequence[Loop],
    wanted: str | None,
    remarks: list[str],
) -> tuple[NDArray[np.int64], str]:
    """Return the sides where the limb is fixed, and the region with the hole if it is one."""
    found, hole_of = _wanted_sides(mesh, read, parts, loops, wanted, remarks)
    if np.isin(found[:, :2], loops[0].sides[:, :2]).any():
        raise InputError(
            f"{mesh.name}: fixed: '{wanted}' reaches the outer boundary, which is pressed by the"
            " socket; name a bone, or a set of nodes or edges inside the limb"
        )
    return found, hole_of


def _wanted_sides(
    mesh: PlaneMesh,
    read: ReadMesh,
    parts: Assigned,
    loops: Sequence[Loop],
    wanted: str | None,
    remarks: list[str],
) -> tuple[NDArray[np.int64], str]:
    names, tissues = list(parts.regions), parts.regions
    holes = [(loop, names[_region_at(mesh, loop)]) for loop in loops[1:]]
    if wanted == HOLES:
        if not holes:
            raise InputError(f"{mesh.name}: fixed: there are no holes; name a bone")
        remarks.append(f"fixed at its {len(holes)} holes, as said")
        return np.concatenate([loop.sides for loop, _ in holes]), ""
    if wanted in names:
        found = [(loop, name) for loop, name in holes if name == wanted]
        if found:
            remarks.append(f"fixed at the hole in {wanted}, as said")
            return found[0][0].sides, wanted
        remarks.append(f"fixed at the surface of {wanted}, as said")
        return outer_sides(mesh.cells[mesh.regions == names.index(wanted)]), ""
    if wanted is not None:
        return _of_set(mesh, read, wanted, names, remarks), ""
    in_bone = [(loop, name) for loop, name in holes if tissues[name] == "bone"]
    if in_bone:
        loop, name = min(in_bone, key=lambda each: (not _is_main(each[1]), each[0].area))
        remarks.append(f"fixed at the hole in {name}, its marrow cavity")
        if free := [other for other, _ in holes if other is not loop]:
            remarks.append(f"holes that are free to deform: {_places(free)}")
        return loop.sides, name
    if len(holes) == 1:
        loop, name = holes[0]
        remarks.append(f"fixed at its hole, in {name}, of {-loop.area:.4g} mm^2")
        return loop.sides, name
    if holes:
        places = _places([loop for loop, _ in holes])
        raise InputError(
            f"{mesh.name}: which of its holes is the limb fixed at? they are at {places}: say"
            f" --fixed {HOLES} for all of them, or the name of a set of nodes or edges"
        )
    bones = [name for name, tissue in tissues.items() if tissue == "bone"]
    if not bones:
        raise InputError(
            f"{mesh.name}: has neither bone nor a hole, so that nothing holds it; say where it is"
            " fixed, by the name of a region or of a set of nodes or edges: --fixed NAME"
        )
    area = {name: area_of(mesh.points, mesh.cells[mesh.regions == names.index(name)]).area
            for name in bones}  # fmt: skip
    name = min(bones, key=lambda each: (not _is_main(each), -area[each]))
    remarks.append(f"fixed at the surface of {name}, which has no hole")
    return outer_sides(mesh.cells[mesh.regions == names.index(name)]), ""


def _places(holes: Sequence[Loop]) -> str:
    """Say where holes are, the largest first, and how large."""
    words = [f"{xy(hole.centre)} ({-hole.area:.4g} mm^2)" for hole in holes[::-1]]
    more = f" and {len(words) - _LISTED} more" if len(words) > _LISTED else ""
    return ", ".join(words[:_LISTED]) + more


def _is_main(name: str) -> bool:
    return any(word in name for word in _MAIN_BONES)


def _region_at(mesh: PlaneMesh, loop: Loop) -> int:
    """Return the region that most sides of a hole belong to."""
    every = sides(mesh.cells).reshape(-1, 3)
    inside = np.isin(every[:, 2], loop.sides[:, 2])
    return int(np.bincount(np.repeat(mesh.regions, 3)[inside]).argmax())


def _of_set(
    mesh: PlaneMesh, read: ReadMesh, wanted: str, names: Sequence[str], remarks: list[str]
) -> NDArray[np.int64]:
    same = [name for name in read.edges if name.casefold() == wanted.casefold()]
    if not same:
        known = [*names, *read.edges]
        raise InputError(
            f"{mesh.name}: fixed: has no region and no set of nodes or edges '{wanted}';"
            f" {nearest(wanted, known)}"
        )
    nodes = [mesh.of_node[int(n)] for n in read.edges[same[0]] if int(n) in mesh.of_node]
    every: NDArray[np.int64] = sides(mesh.cells).reshape(-1, 3)
    every = every[np.unique(every[:, 2], return_index=True)[1]]
    found: NDArray[np.int64] = every[np.isin(every[:, :2], nodes).all(axis=1)]
    if not len(found):
        raise InputError(f"{mesh.name}: fixed: '{wanted}' has no edges of the limb's triangles")
    remarks.append(f"fixed at {same[0]}, as said")
    return found
