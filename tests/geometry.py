"""The calf, its curves, and meshes of it that are built once a session."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from calfsocket.meshes import limb, section
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import TriangleMesh

LIMB = Limb.reference()
LOOPS = limb_curves(LIMB)
SKIN = LOOPS["skin_outline"]


@cache
def section_of(socket: str, size: str = "coarse") -> TriangleMesh:
    """Mesh of the calf in a socket of the paper."""
    return section.build(LIMB, Socket.reference(socket), mesh_size(size))


#: x and y of the reference calf -> of another limb, and what that limb's +x and +y point to.
MIRRORED = np.array([[-1.0, 0.0], [0.0, 1.0]]), ("medial", "anterior")
TURNED = np.array([[0.0, -1.0], [1.0, 0.0]]), ("posterior", "lateral")
TURNED_AND_MIRRORED = TURNED[0] @ MIRRORED[0], ("posterior", "medial")


def calf_content() -> dict[str, Any]:
    """The content of the reference calf's file."""
    return json.loads((Path(limb.__file__).parent / "calf.json").read_text(encoding="utf-8"))


def moved_calf(matrix: np.ndarray, axes: tuple[str, str]) -> dict[str, Any]:
    """The content of the file of a calf turned or mirrored about the origin."""
    content = calf_content()
    mirrored = np.linalg.det(matrix) < 0
    turn = np.rad2deg(np.arctan2(matrix[1, 0], matrix[0, 0]))
    for curve in content["curves"].values():
        if curve["type"] == "spline":
            points = (np.array(curve["points"]) @ matrix.T).tolist()
            # A mirrored curve starts at the same point, and so has the same spline.
            curve["points"] = points[:1] + points[:0:-1] if mirrored else points
        elif curve["type"] == "ellipse":
            curve["center"] = (matrix @ curve["center"]).tolist()
            curve["angle_deg"] = turn + (-1 if mirrored else 1) * curve["angle_deg"]
    fat = [
        ((turn + (-angle if mirrored else angle)) % 360, thickness)
        for angle, thickness in content["layers"]["fat_thickness"]
    ]
    content["layers"]["fat_thickness"] = sorted(fat)
    content["side"] = "left" if mirrored else "right"
    content["axes"] = dict(zip(("+x", "+y"), axes, strict=True))
    return content
