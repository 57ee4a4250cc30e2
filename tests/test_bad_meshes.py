"""Meshes of other programs that cannot be solved as they are: one line each, nothing written."""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest
from mesh_files import deck
from numpy.typing import NDArray
from test_bad_input import check_trial, refused, shortened

import calfsocket as cs
from reliability import Trial

TITLE = "Meshes of other programs"
INTRO = "What `limb` and `socket` say of a mesh that cannot be solved as it is."

RADII = np.array([5.0, 8.5, 12.0, 19.0, 26.0, 28.0, 30.0, 31.0, 32.0])
NAMES = ("tibia", "muscle", "fat", "skin")
N = 36
Points, Cells = NDArray[np.float64], NDArray[np.int64]
Change = Callable[[Points, Cells, dict[str, Cells]], tuple[Points, Cells, dict[str, Cells]]]
Make = Callable[[Path], Sequence[str]]


@cache
def grid() -> tuple[Points, Cells]:
    """Rings of triangles: points and corners, 2 N of them from ring to ring."""
    angle = 2 * np.pi * np.arange(N) / N
    points = np.concatenate([r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in RADII])
    rows = []
    for i in range(len(RADII) - 1):
        for j in range(N):
            a, b = i * N + j, i * N + (j + 1) % N
            rows += [[a, a + N, b + N], [a, b + N, b]]
    return points, np.array(rows, dtype=np.int64)


def limb(*words: str, change: Change | None = None, kind: str = "CPE3", more: str = "") -> Make:
    """A limb of rings as a file of Abaqus, changed, with words of the command."""

    def make(folder: Path) -> list[str]:
        points, cells = grid()
        sets = {name: np.arange(4 * N * i, 4 * N * (i + 1)) for i, name in enumerate(NAMES)}
        if change:
            points, cells, sets = change(points.copy(), cells.copy(), sets)
        (folder / "limb.inp").write_text(deck(points, {kind: cells}, sets, more))
        return ["limb", str(folder / "limb.inp"), *(word.format(folder) for word in words)]

    return make


def table(text: str, *words: str, name: str = "sets.csv") -> Make:
    """The limb with a table of its sets."""

    def make(folder: Path) -> list[str]:
        (folder / name).write_text(text)
        return limb("--sets", str(folder / name), *words)(folder)

    return make


def text(content: str | bytes, name: str = "limb.inp", *words: str) -> Make:
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return ["limb", str(folder / name), *words]

    return make


def by_meshio(name: str, kind: str = "triangle", *words: str, **data: object) -> Make:
    """The limb as a file that meshio writes, with arrays of its cells."""

    def make(folder: Path) -> list[str]:
        points, cells = grid()
        flat = np.pad(points, ((0, 0), (0, 1)))
        rows = cells if kind == "triangle" else np.column_stack([cells, cells[:, 0]])
        arrays = {key: [np.broadcast_to(value, len(rows))] for key, value in data.items()}
        meshio.Mesh(flat, [(kind, rows)], cell_data=arrays).write(folder / name)
        return ["limb", str(folder / name), *words]

    return make


def points_changed(change: Callable[[Points], Points]) -> Change:
    return lambda points, cells, sets: (change(points), cells, sets)


def cells_changed(change: Callable[[Cells], Cells]) -> Change:
    return lambda points, cells, sets: (points, change(cells), sets)


def sets_changed(change: Callable[[dict[str, Cells]], dict[str, Cells]]) -> Change:
    return lambda points, cells, sets: (points, cells, change(sets))


def loose_skin(gap: float) -> Change:
    """Give the skin nodes of its own, moved outward, mm."""

    def change(
        points: Points, cells: Cells, sets: dict[str, Cells]
    ) -> tuple[Points, Cells, dict[str, Cells]]:
        skin = cells[sets["skin"]]
        cells[sets["skin"]] = skin + len(points)
        return np.concatenate([points, points * (1 + gap / 30)]), cells, sets

    return change


def slit(
    points: Points, cells: Cells, sets: dict[str, Cells]
) -> tuple[Points, Cells, dict[str, Cells]]:
    """Open four sides between fat and skin: nodes of their own on the skin's side."""
    own = 6 * N + np.arange(5, 8)
    number = {int(node): len(points) + i for i, node in enumerate(own)}
    for cell in sets["skin"]:
        cells[cell] = [number.get(int(node), node) for node in cells[cell]]
    return np.concatenate([points, points[own] * 1.0005]), cells, sets


def without(*gone: int) -> Change:
    """Leave triangles out."""

    def change(
        points: Points, cells: Cells, sets: dict[str, Cells]
    ) -> tuple[Points, Cells, dict[str, Cells]]:
        kept = np.setdiff1d(np.arange(len(cells)), gone)
        number = np.full(len(cells), -1)
        number[kept] = np.arange(len(kept))
        return (
            points,
            cells[kept],
            {name: number[np.setdiff1d(each, gone)] for name, each in sets.items()},
        )

    return change


def moved(node: int, to: int, share: float) -> Change:
    """Move a node toward another one."""

    def change(points: Points) -> Points:
        points[node] += share * (points[to] - points[node])
        return points

    return points_changed(change)


def bulged(
    points: Points, cells: Cells, sets: dict[str, Cells]
) -> tuple[Points, Cells, dict[str, Cells]]:
    """Give triangles nodes between their corners, one of them beyond the third corner."""
    ends = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    unique, inverse = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    middle = points[unique].mean(axis=1)
    side = inverse.reshape(3, -1)[:, 100]
    middle[side[0]] += 0.8 * (points[cells[100, 2]] - middle[side[0]])
    rows = np.column_stack([cells, len(points) + inverse.reshape(3, -1).T])
    return np.concatenate([points, middle]), rows, sets


def fibula_at(angle: float) -> Change:
    """Make a fibula of some of the fat, and a tibia of what lies opposite."""

    def change(
        points: Points, cells: Cells, sets: dict[str, Cells]
    ) -> tuple[Points, Cells, dict[str, Cells]]:
        x = points[cells].mean(axis=1)
        muscle = sets["muscle"]
        toward = x[muscle] @ [np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))]
        near = muscle[toward > 0.8 * np.linalg.norm(x[muscle], axis=1)]
        return points, cells, sets | {"fibula": near, "muscle": np.setdiff1d(muscle, near)}

    return change


def socket_off(z: float) -> Make:
    """A socket that lies so far from the plane of its limb."""

    def make(folder: Path) -> list[str]:
        words = of_sets("skin,socket\n")(folder)
        flat = (folder / "limb.inp").read_text().splitlines()
        lifted = [f"{line}, {z}" if line.count(",") == 2 and "." in line else line
                  for line in flat]  # fmt: skip
        (folder / "socket.inp").write_text("\n".join(lifted))
        return [words[0], str(folder / "socket.inp"), *words[2:]]

    return make


def doubled(cells: Cells) -> Cells:
    cells[1] = cells[0]
    return cells


def bone_left_out(sets: dict[str, Cells]) -> dict[str, Cells]:
    return {name: cells for name, cells in sets.items() if name != "tibia"}


def of_socket(*words: str) -> Make:
    """A socket for that limb."""

    def make(folder: Path) -> list[str]:
        limb()(folder)
        cs.Limb.from_mesh(folder / "limb.inp").write(folder / "limb.json")
        given = [word.format(folder) for word in words]
        return ["socket", str(folder / "limb.inp"), "--limb", str(folder / "limb.json"), *given]

    return make


def of_sets(content: str) -> Make:
    def make(folder: Path) -> list[str]:
        (folder / "sets.csv").write_text(content)
        return of_socket("--sets", str(folder / "sets.csv"))(folder)

    return make


def study(content: str, *words: str) -> Make:
    """A study of a limb with a mesh of its own."""

    def make(folder: Path) -> list[str]:
        limb()(folder)
        cs.Limb.from_mesh(folder / "limb.inp").write(folder / "limb.json")
        (folder / "study.toml").write_text(
            '[sockets.mine]\nlaw = "normal_offset"\nbase = "0.4 mm"\n[study]\n'
            'limb = "limb.json"\nsockets = ["mine"]\nmaterials = ["combined"]\n' + content
        )
        return ["check", str(folder / "study.toml"), *words]

    return make


ALL = "tibia,tibia\nmuscle,muscle\nfat,fat\nskin,skin\n"
SOLID = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4, ELSET=A\n1,1,2,3,4\n"

TRIALS = (
    # the file
    Trial("an empty file", text(""), ("has no triangles or quadrilaterals",)),
    Trial("binary rubbish", text(bytes(range(256)) * 9), ("is not UTF-8 text",)),
    Trial("a msh file of no such kind", text("$MeshFormat\n9.9 0 8\n", "limb.msh"),
          ("limb.msh: cannot be read as .msh",)),
    Trial("a VTK file that is cut off", text('<?xml version="1.0"?><VTKFile', "limb.vtu"),
          ("limb.vtu: cannot be read as .vtu",)),
    Trial("a mesh of a solid", text(SOLID), ("*ELEMENT: C3D4 are elements of a solid",)),
    Trial("a solid of VTK", by_meshio("limb.vtu", "tetra", region=1),
          ("has 576 tetra, which are elements of a solid",)),
    Trial("elements of a kind that is not known",
          text("*NODE\n1,0,0\n*ELEMENT,TYPE=CPE5\n1,1,1,1,1,1\n"),
          ("CPE5 are neither triangles nor quadrilaterals",)),
    Trial("nodes that another keyword makes", limb(more="*NGEN\n1,5\n"),
          ("*NGEN: is not read; write the deck with all nodes and elements",)),
    Trial("an element without its node", text("*NODE\n1,0,0\n2,9,0\n*ELEMENT,TYPE=S3\n1,1,2,3\n"),
          ("element 1 has node 3, which is not listed",)),
    Trial("a node that is no number", text("*NODE\n1,zero,0\n"),
          ("line 1: *NODE: is not understood",)),
    Trial("a set of a set that there is not", limb(more="*ELSET, ELSET=all\nSkyn\n"),
          ("*ELSET: there is no set 'Skyn' before it",)),
    Trial("an instance of no part", text("*INSTANCE, NAME=a, PART=b\n*END INSTANCE\n"),
          ("there is no part 'b' before it",)),
    Trial("two meshes", lambda folder: [*limb()(folder), str(folder / "limb.inp")],
          ("give a mesh alone",)),
    Trial("a node listed twice", limb(more="*NODE\n1,3,3\n"),
          ("*NODE: node 1 is listed twice, in two places; give each a number of its own",)),
    Trial("an element listed twice", limb(more="*ELEMENT, TYPE=CPE3\n1,1,2,3\n"),
          ("*ELEMENT: element 1 is listed twice, with other nodes",)),
    Trial("a set without a name", limb(more="*ELSET\n1,2\n"),
          ("*ELSET: has no ELSET=...; export the mesh again",)),
    Trial("a part that no instance places",
          text("*PART, NAME=Leg\n*NODE\n1,0,0\n2,9,0\n3,0,9\n*ELEMENT,TYPE=S3\n1,1,2,3\n"
               "*END PART\n"),
          ("no *INSTANCE places the part LEG; write the deck with its assembly, or flat",)),
    # sets
    Trial("a file without sets", limb(change=sets_changed(lambda sets: {})),
          ("has no sets of triangles; name one for each tissue",)),
    Trial("sets without names of tissues",
          limb(change=sets_changed(lambda sets: {f"Set-{i}": s for i, s in
                                                 enumerate(sets.values())})),
          ("are in no set whose tissue is known", "Set-0 (", "--sets")),
    Trial("a VTK file that numbers nothing", by_meshio("limb.vtu"),
          ("does not say its regions: it has no sets, and no array of whole numbers",)),
    Trial("a VTK file with fractions", by_meshio("limb.vtu", region=1.5),
          ("no array of whole numbers of its cells (region has others); add one",)),
    Trial("a VTK file with several numbers", by_meshio("limb.vtu", a=1, b=2),
          ("the arrays a, b; say which one by --data",)),
    Trial("an array that is not there",
          by_meshio("limb.vtu", "triangle", "--data", "tisue", tissue=1),
          ("has no array of whole numbers of cells 'tisue'; did you mean 'tissue'?",)),
    Trial("a set that is not there", table(ALL + "bloood,vessel\n"),
          ("set 'bloood': is not in the file; it has tibia (",)),
    Trial("a misspelt set", table(ALL.replace("muscle,", "muscel,")),
          ("set 'muscel': is not in the file; did you mean 'muscle'?",)),
    Trial("a tissue that is not known", table(ALL.replace(",fat", ",lard")),
          ("set 'fat': what tissue is 'lard'?",)),
    Trial("a table that is not set,region", table("tibia\n"),
          ("sets.csv, line 1: is not set,region or set,region,tissue",)),
    Trial("an empty table", table("# nothing\n"), ("sets.csv: lists no sets",)),
    Trial("a set twice", table(ALL + "fat,fat\n"), ("line 5: set 'fat' is listed twice",)),
    Trial("a TOML table with a wrong key", table('fat = {tisue = "fat"}\n', name="sets.toml"),
          ("set 'fat': give tissue = '...' and, if you like, name = '...'",)),
    Trial("a set that the table forgets", table(ALL.replace("fat,fat\n", "")),
          ("144 triangles", "are in no set whose tissue is known; they are in fat (")),
    Trial("a triangle in two regions",
          limb(change=sets_changed(lambda s: s | {"fat": np.append(s["fat"], s["skin"][:3])})),
          ("3 triangles", "are both in 'fat' and in 'skin'")),
    Trial("one region of two tissues", table("tibia,a,bone\nmuscle,a,muscle\nfat,fat\nskin,skin\n"),
          ("set 'muscle': is muscle, and another set of the region 'a' is bone",)),
    # size and plane
    Trial("a mesh in metres", limb(change=points_changed(lambda x: x / 1000)),
          ("its lengths may be in m: add --units m",)),
    Trial("a mesh of another size", limb(change=points_changed(lambda x: x * 15)),
          ("which is no limb (40 to 400 mm wide)",)),
    Trial("a mesh that is not flat",
          limb(change=points_changed(lambda x: np.column_stack([x, 0.1 * x[:, 0] ** 2]))),
          ("is not flat: its nodes leave a plane by up to",)),
    Trial("a coordinate that is no number",
          limb(change=moved(40, 41, np.nan)), ("has coordinates that are no numbers",)),
    # triangles
    Trial("triangles on each other", limb(change=cells_changed(doubled)),
          ("a side belongs to 3 triangles", "triangles lie on each other there")),
    Trial("a triangle that is a needle", limb(change=moved(150, 151, 0.97)),
          ("a triangle is a needle with an angle of", "mesh it anew")),
    Trial("a side that is curved too far", limb(change=bulged, kind="CPE6"),
          ("a triangle is inverted by a curved side, whose middle node lies too far off, at",)),
    Trial("a triangle that folds over", limb(change=moved(150, 151, 1.6)),
          ("two triangles lie on each other at",)),
    Trial("two corners in one place", limb(change=moved(150, 151, 1.0)),
          ("a triangle has two corners in one place",)),
    Trial("a skin that is not tied", limb(change=loose_skin(0.05)),
          ("is in 2 pieces that share no nodes", "merge the nodes along its edge")),
    Trial("a seam", limb(change=slit), ("is open along a seam of", "merge the nodes")),
    Trial("a mesh that touches itself", limb(change=without(6 * N, 6 * N + 2)),
          ("touches itself in one node at",)),
    Trial("a skin that ends", limb(change=without(*range(12 * N, 12 * N + 8),
                                                  *range(14 * N, 14 * N + 8))),
          ("the outer boundary is skin, but for", "which are fat")),
    Trial("a bone that there is not", limb("--fixed", "femur"),
          ("fixed: has no region and no set of nodes or edges 'femur'; allowed: fat",)),
    Trial("a limb that is fixed where the socket presses",
          limb("--fixed", "all", more=f"*NSET, NSET=all, GENERATE\n1,{N * len(RADII)}\n"),
          ("fixed: 'all' reaches the outer boundary, which is pressed by the socket",)),
    Trial("two holes in muscle", limb("--sets", "{0}/soft.csv", change=without(8 * N, 8 * N + 1)),
          ("which of its holes is the limb fixed at?", "--fixed holes")),
    # what a mesh is combined with
    Trial("a geometry that is not its own", limb("--geometry", "{0}/other.csv"),
          ("no side has both ends within 0.02 mm of the curves",)),
    Trial("a level of a mesh", limb("--level", "0.4"),
          ("--level: does not belong to a mesh, which is solved as it is",)),
    Trial("sets of a scan", text("solid x\nendsolid x\n", "a.stl", "--sets", "sets.csv"),
          ("--sets: belongs to a mesh, and a.stl is none",)),
    Trial("no socket among the sets", of_socket(),
          ("which set is the socket?", "NAME,socket")),
    Trial("a socket without a hole", of_sets("skin,socket\nmuscle,socket\n"),
          ("is in 2 pieces that share no nodes",)),
    Trial("a socket in another plane", socket_off(12.0),
          ("lies in another plane than the limb's section: its nodes are up to 12 mm off",)),
    Trial("a fibula on the wrong side", limb("--sets", "{0}/legs.csv", "--side", "right",
                                             "--anterior", "+y", change=fibula_at(180)),
          ("axes: +x is lateral and +y anterior, so that the fibula would lie",)),
    Trial("a socket's wall that is moved", of_socket("--rotate", "3"),
          ("--rotate: does not belong to a mesh",)),
    Trial("a number of triangles", study('[model]\nsize = 20000\n'),
          ("model.size: is 20000, but the limb has a mesh of its own",)),
    Trial("an adaptive mesh", study('[model]\nsize = "adaptive"\n'),
          ("model.size: is adaptive, but the limb has a mesh of its own",)),
    Trial("a mesh error", study("mesh_error = true\n[model]\nsize = \"coarse\"\n"),
          ("study.mesh_error: needs a second mesh, and the limb has one of its own",)),
    Trial("a thicker skin", study('[model]\nsize = "coarse"\n[layers]\nskin_thickness = "2 mm"\n'),
          ("layers: skin_thickness: the limb has a mesh of its own, which is solved as it is",)),
    Trial("a liner bonded to the limb",
          study('[model]\nsize = "coarse"\n[liner]\nthickness = "3 mm"\n'
                'law = {law = "neo-hookean", mu = "20 kPa", nu = 0.49}\n'),
          ("liner.bonded: is 'limb', but the limb has a mesh of its own", "bond it to the socket")),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return what a trial gives, without the folder's path."""
    return shortened(refused(words_of(trial, folder)), folder)


def words_of(trial: Trial, folder: Path) -> Sequence[str]:
    circle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    outline = 29.5 * np.column_stack([np.cos(circle), np.sin(circle)])
    (folder / "legs.csv").write_text(ALL + "fibula,fibula\n")
    (folder / "soft.csv").write_text(ALL.replace(",tibia", ",calf:muscle"))
    (folder / "other.csv").write_text("\n".join(f"{x:.6f},{y:.6f}" for x, y in outline))
    words: Sequence[str] = trial.given(folder)
    return words


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_a_bad_mesh_gets_one_line(
    trial: Trial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_trial(trial, said, tmp_path, monkeypatch, longest=700)
