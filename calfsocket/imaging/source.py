"""Which surface of a source is the skin and which the bones: by nesting and size, or as said."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import numpy as np
import pyvista

from calfsocket.imaging.aop import landmarks_of, side_of
from calfsocket.imaging.surface import UNITS, Shell, check_size, read_shells
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

#: How far, mm, the box of a bone may leave that of the skin: an open rim ends where it was cut.
_RIM = 15.0
#: The same, mm, of a marrow cavity and its bone: both may end in one plane.
_NOISE = 1.0
#: A shell inside the skin with more than this share of its volume is the muscle envelope.
_ENVELOPE = 0.45
#: Pieces with less than this share of the area of their file's largest are left out.
_CRUMB = 0.003
#: A fibula has less than this share of the tibia's volume, runs beside it for this share of its
#: own length, and is this many times longer than thick. A patella and a femur fail in the last.
_FIBULA_VOLUME, _FIBULA_OVERLAP, _FIBULA_SLENDER = 0.4, 0.5, 1.5
#: Parts that have a role of their own in a section.
ROLES = ("skin", "muscle", "tibia", "fibula")
_BONES = ("tibia", "fibula", "femur", "patella")


@dataclass(frozen=True)
class Source:
    """The surfaces of one limb, in mm, and what each of them is.

    Attributes
    ----------
    names : str
        Of the files, for messages.
    files : mapping of str to str
        The files' names, and their hashes (SHA-256).
    skin : Shell
    bones : mapping of str to Shell
        By name: "tibia", "fibula", and others such as "femur" or "shell 5".
    cavities : mapping of str to Shell
        Marrow cavities by the name of their bone.
    muscle : Shell, optional
        Around all muscles and their fascia.
    skin_inner : Shell, optional
        Around all that is not skin.
    regions : mapping of str to (tissue, Shell)
        What else a label map has: bellies, vessels.
    superior : Array, optional
        Where the head is, by the file's own axes.
    anterior : Array, optional
        Where the front is, by the file's own axes.
    side : str, optional
        As the file states it.
    landmarks : mapping of str to Array
        Named points of the file, mm.
    voxel : Array, optional
        Edges of a voxel of a label map as columns, mm.
    remarks : sequence of str
        What was found and dropped.
    """

    names: str
    files: Mapping[str, str]
    skin: Shell
    bones: Mapping[str, Shell] = field(default_factory=dict)
    cavities: Mapping[str, Shell] = field(default_factory=dict)
    muscle: Shell | None = None
    skin_inner: Shell | None = None
    regions: Mapping[str, tuple[str, Shell]] = field(default_factory=dict)
    superior: Array | None = None
    anterior: Array | None = None
    side: str | None = None
    landmarks: Mapping[str, Array] = field(default_factory=dict)
    voxel: Array | None = None
    remarks: Sequence[str] = ()

    def resolution(self, across: Array) -> float:
        """Return the size, mm, of a voxel in directions, (n, 3), the largest; 0 of surfaces."""
        if self.voxel is None:
            return 0.0
        edges = self.voxel / np.linalg.norm(self.voxel, axis=0)
        sizes = np.linalg.norm((across @ edges) * np.linalg.norm(self.voxel, axis=0), axis=1)
        return float(sizes.max())


def read_surface(
    paths: Sequence[Path | str], units: str = "mm", said: Mapping[str, str] | None = None
) -> Source:
    """Read the surfaces of a limb.

    Parameters
    ----------
    paths
        Files; one for each tissue, or one with several closed shells.
    units
        Of the files: mm, cm, m or inch.
    said : mapping of str to str, optional
        Which file or shell is what, by role: "skin", "muscle" (the envelope of all muscles),
        "tibia", "fibula".

    Raises
    ------
    InputError
        When a file cannot be read, or it is not clear what a shell is.
    """
    files = [Path(path) for path in paths]
    shells = read_shells(files, units)
    named = _as_said(shells, said or {}) or {}
    named = _as_files_say(shells, named)
    remarks = [f"{role}: {shell.title}" for role, shell in named.items()]
    left = [shell for shell in shells if shell not in named.values()]
    left, crumbs = _without_crumbs(left, shells)
    if crumbs:
        remarks.append(
            f"{len(crumbs)} pieces below {100 * _CRUMB:g} % of a file's largest left out"
        )
    skin = named.pop("skin", None) or _skin(left)
    left = [shell for shell in left if shell is not skin]
    check_size(str(skin), skin.surface.points, units)
    inside = _inside(skin, left)
    outside = [shell for shell in left if shell not in inside]
    _check_one_limb(skin, outside)
    remarks += [f"{shell.title}: outside the skin, left out" for shell in outside]
    left = inside
    muscle = named.pop("muscle", None) or _envelope(skin, left)
    left = [shell for shell in left if shell is not muscle]
    bones = {role: shell for role, shell in named.items() if role in _BONES}
    cavities, left = _cavities([*bones.values(), *left], left)
    bones |= _bones(left, bones)
    for role in ("tibia", "fibula"):
        if role in bones and not any(line.startswith(f"{role}:") for line in remarks):
            remarks.append(f"{role}: {bones[role].title}, by its size and place")
    return Source(
        names=", ".join(path.name for path in files),
        files={path.name: sha256(path) for path in files},
        skin=skin,
        bones=bones,
        cavities={name: cavities[id(bone)] for name, bone in bones.items() if id(bone) in cavities},
        muscle=muscle,
        side=_stated_side(files),
        landmarks={
            name: UNITS[units] * place
            for path in files
            if path.suffix.lower() == ".aop"
            for name, place in landmarks_of(path).items()
        },
        remarks=tuple(remarks),
    )


def _without_crumbs(
    shells: Sequence[Shell], every: Sequence[Shell]
) -> tuple[list[Shell], list[Shell]]:
    """Separate what scanners leave: pieces much smaller than the largest of their file."""
    largest: dict[Path, float] = {}
    for shell in every:
        largest[shell.path] = max(largest.get(shell.path, 0.0), shell.surface.area)
    small = [each for each in shells if each.surface.area < _CRUMB * largest[each.path]]
    return [each for each in shells if each not in small], small


def sha256(path: Path) -> str:
    """Return the hash of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _stated_side(files: Sequence[Path]) -> str | None:
    sides = {side_of(path) for path in files if path.suffix.lower() == ".aop"}
    return sides.pop() if len(sides) == 1 else None


def _as_said(shells: Sequence[Shell], said: Mapping[str, str]) -> dict[str, Shell]:
    """Return the shells that were named, by role."""
    found: dict[str, Shell] = {}
    for role, name in said.items():
        fits = [
            shell
            for shell in shells
            if name in (shell.name, str(shell.path), shell.path.name, shell.path.stem)
        ]
        if not fits:
            known = ", ".join(dict.fromkeys(shell.name for shell in shells))
            raise InputError(f"{role}: no file or shell '{name}'; there are: {known}")
        if fits[0] in found.values():
            raise InputError(f"{role}: '{name}' is already {_key(found, fits[0])}; name another")
        found[role] = fits[0]
    return found


def _key(found: Mapping[str, Shell], shell: Shell) -> str:
    return next(role for role, each in found.items() if each is shell)


def _as_files_say(shells: Sequence[Shell], named: dict[str, Shell]) -> dict[str, Shell]:
    """Add the roles that the names of files state: ``left_tibia.stl`` is the tibia."""
    for shell in shells:
        if shell in named.values() or shell.name not in (shell.path.stem, "shell 1"):
            continue
        words = re.findall(r"[a-z]+", shell.path.stem.lower())
        roles = [role for role in (*ROLES, *_BONES) if role in words or f"{role}s" in words]
        if len(set(roles)) == 1 and roles[0] not in named:
            named[roles[0]] = shell
    return named


def _skin(shells: Sequence[Shell]) -> Shell:
    if not shells:
        raise InputError("skin: every file is said to be something else; give the skin's surface")
    return max(shells, key=lambda each: each.surface.length)


def _inside(skin: Shell, shells: Sequence[Shell]) -> list[Shell]:
    """Return the shells whose boxes lie in the skin's."""
    low, high = _box(skin.surface)
    return [
        each
        for each in shells
        if np.all(_box(each.surface)[0] > low - _RIM)
        and np.all(_box(each.surface)[1] < high + _RIM)
    ]


def _box(surface: pyvista.PolyData) -> Array:
    return np.array(surface.bounds).reshape(3, 2).T


def _check_one_limb(skin: Shell, outside: Sequence[Shell]) -> None:
    """Raise an InputError where something as large as a limb lies beside the skin."""
    for other in outside:
        if other.surface.length > 0.5 * skin.surface.length:
            raise InputError(
                f"{other}: lies beside {skin} and is {other.surface.length:.0f} mm large; give one"
                " limb: cut the other away, or say which shell is the skin by --skin"
            )


def _volume(shell: Shell) -> float:
    return float(abs(shell.surface.volume))


def _envelope(skin: Shell, shells: Sequence[Shell]) -> Shell | None:
    large = [each for each in shells if _volume(each) > _ENVELOPE * _volume(skin)]
    if len(large) > 1:
        raise InputError(
            f"{large[1]}: is nearly as large as {large[0]}; say what they are: --skin, --muscle"
        )
    return large[0] if large else None


def _cavities(
    bones: Sequence[Shell], shells: Sequence[Shell]
) -> tuple[dict[int, Shell], list[Shell]]:
    """Return the shells that lie in a bone, by the bone's identity, and the others."""
    found: dict[int, Shell] = {}
    for bone, shell in permutations(bones, 2):
        low, high = _box(bone.surface)
        box = _box(shell.surface)
        if shell not in shells or np.any(box[0] < low - _NOISE) or np.any(box[1] > high + _NOISE):
            continue
        some = shell.surface.points[:: max(1, shell.surface.n_points // 50)]
        enclosed = pyvista.PolyData(some).select_enclosed_points(bone.surface, check_surface=False)
        if enclosed["SelectedPoints"].mean() > 0.9:
            found[id(bone)] = shell
    return found, [each for each in shells if all(each is not c for c in found.values())]


def _bones(shells: Sequence[Shell], named: Mapping[str, Shell]) -> dict[str, Shell]:
    """Return what the shells in the skin are, the tibia and the fibula where that is clear."""
    wanted = [role for role in ("tibia", "fibula") if role not in named]
    if not shells:
        return {}
    if len(wanted) < 2 or len(shells) == 1:
        if len(shells) == 1 and wanted:
            other = named.get("tibia") or named.get("fibula")
            role = wanted[0] if other is None or _is_pair(named, wanted[0], shells[0]) else None
            return {role or shells[0].name: shells[0]}
        return {shell.name: shell for shell in shells}
    pairs = [
        (big, small)
        for big, small in permutations(shells, 2)
        if _volume(small) < _FIBULA_VOLUME * _volume(big)
        and _beside(big.surface, small.surface) > _FIBULA_OVERLAP
        and _slenderness(small.surface) > _FIBULA_SLENDER
    ]
    if not pairs:
        listed = "; ".join(f"{each.name}, {_volume(each) / 1000:.0f} cm3" for each in shells)
        raise InputError(
            f"{shells[0].path}: which shell is the tibia? (in the skin are: {listed}) name it by"
            " --tibia, and --fibula if there is one"
        )
    tibia, fibula = max(pairs, key=lambda pair: _slenderness(pair[1].surface))
    bones = {"tibia": tibia, "fibula": fibula}
    return bones | {each.name: each for each in shells if each is not tibia and each is not fibula}


def _is_pair(named: Mapping[str, Shell], role: str, shell: Shell) -> bool:
    """Return whether a shell can be the partner of the tibia or fibula that was named."""
    other = named["tibia"] if role == "fibula" else named["fibula"]
    big, small = (other, shell) if role == "fibula" else (shell, other)
    return _beside(big.surface, small.surface) > _FIBULA_OVERLAP


def _main_axis(points: Array) -> tuple[Array, Array]:
    """Return spreads, increasing, and directions of points."""
    values, vectors = np.linalg.eigh(np.cov((points - points.mean(axis=0)).T))
    return np.sqrt(values), vectors


def _slenderness(surface: pyvista.PolyData) -> float:
    spread, _ = _main_axis(surface.points)
    return float(spread[2] / spread[1])


def _beside(big: pyvista.PolyData, small: pyvista.PolyData) -> float:
    """Return the share of the small surface's length beside which the big one lies."""
    along = _main_axis(small.points)[1][:, 2]
    one, other = small.points @ along, big.points @ along
    overlap = min(one.max(), other.max()) - max(one.min(), other.min())
    return float(overlap / np.ptp(one))
