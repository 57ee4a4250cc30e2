"""Scans, label maps and drawings that no limb can be made of: one line each, nothing written."""

import gzip
import struct
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista
from phantom import HEIGHT, Phantom
from PIL import Image
from test_bad_input import check_trial, refused, shortened
from test_imaging_labels import metaimage, nifti, nrrd

from drawings import outlined_svg
from reliability import Trial

TITLE = "Scans, label maps and drawings of limbs"
INTRO = "What `limb` says of a source that it cannot use."

PARTS = ("skin", "tibia", "fibula")
UP = ("--proximal", "+z")
Make = Callable[[Path], Sequence[str]]


@cache
def surface(part: str, taper: tuple[float, float] = (0.8, 1.2)) -> pyvista.PolyData:
    return Phantom(taper=taper).surface(part)


def saved(folder: Path, name: str, *parts: pyvista.PolyData) -> list[str]:
    """Write one file of some surfaces; return its path."""
    pyvista.merge([part.copy() for part in parts]).extract_surface().save(folder / name)
    return [str(folder / name)]


def limb(folder: Path, *words: str, parts: Sequence[str] = PARTS) -> list[str]:
    """Write the phantom as one file; return words of a command."""
    return [*saved(folder, "limb.stl", *(surface(part) for part in parts)), *words]


def without(part: pyvista.PolyData, place: Sequence[float], radius: float) -> pyvista.PolyData:
    """Cut a hole."""
    far = np.linalg.norm(part.cell_centers().points - np.array(place), axis=1) > radius
    return part.extract_cells(np.flatnonzero(far)).extract_surface()


def moved(part: pyvista.PolyData, x: float) -> pyvista.PolyData:
    return part.translate((x, 0, 0), inplace=False)


def binary(name: str, content: bytes) -> Make:
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(content)
        return [str(folder / name)]

    return make


def half(suffix: str) -> Make:
    """A file that ends half way."""

    def make(folder: Path) -> list[str]:
        path = folder / f"limb.{suffix}"
        if suffix == "obj":
            pyvista.save_meshio(path, surface("tibia"))
        else:
            surface("tibia").save(path)
        content = path.read_bytes()
        path.write_bytes(content[: 2 * len(content) // 3])
        return [str(path)]

    return make


def a_hole(folder: Path) -> list[str]:
    skin = without(surface("skin"), (50, 0, HEIGHT / 2), 15)
    return saved(folder, "limb.stl", skin, surface("tibia"), surface("fibula"))


def two_limbs(folder: Path) -> list[str]:
    both = [moved(surface(part), x) for x in (0, 150) for part in PARTS]
    return saved(folder, "limbs.stl", *both)


def upside_down(folder: Path) -> list[str]:
    """A limb as thick below as above, whose skin is closed."""
    return saved(folder, "limb.stl", *(surface(part, (1.0, 1.0)) for part in PARTS))


def metres(folder: Path) -> list[str]:
    parts = [surface(part).scale(1e-3, inplace=False) for part in PARTS]
    return saved(folder, "limb.vtp", *parts)


def outside(folder: Path) -> list[str]:
    """A tibia that leaves the skin."""
    parts = (surface("skin"), moved(surface("tibia"), -25), surface("fibula"))
    return saved(folder, "limb.stl", *parts)


def a_ball(folder: Path) -> list[str]:
    return saved(folder, "ball.stl", pyvista.Sphere(radius=60))


def points_alone(folder: Path) -> list[str]:
    pyvista.PolyData(surface("tibia").points).save(folder / "cloud.vtp")
    return [str(folder / "cloud.vtp")]


def three_bones(folder: Path) -> list[str]:
    balls = [pyvista.Sphere(radius=9, center=(x, 10, 100)) for x in (-25, 0, 25)]
    return saved(folder, "limb.stl", surface("skin"), *balls)


def an_aop(change: Callable[[list[str]], list[str]]) -> Make:
    """A cylinder of 80 mm as AOP, changed."""

    def make(folder: Path) -> list[str]:
        lines = ["AAOP1", "END COMMENTS", "CYLINDRICAL", "RIGHT", "0", "72", "5", "10", "20"]
        lines += ["40.0"] * 720
        (folder / "scan.aop").write_text("\n".join(change(lines)))
        return [str(folder / "scan.aop"), "--side", "right"]

    return make


@cache
def a_map() -> tuple[np.ndarray, np.ndarray]:
    return Phantom().labels((2.0, 2.0, 5.0), *PARTS)


TABLE = "1,muscle\n2,tibia\n3,fibula\n"


def labelled(
    change: Callable[[np.ndarray], np.ndarray] = lambda labels: labels,
    text: str = TABLE,
    *words: str,
) -> Make:
    """A label map that is changed, and its table."""

    def make(folder: Path) -> list[str]:
        labels, affine = a_map()
        nrrd(folder / "limb.nrrd", change(labels.copy()), affine)
        (folder / "labels.csv").write_text(text)
        return [str(folder / "limb.nrrd"), "--labels", str(folder / "labels.csv"), *words]

    return make


def no_table(folder: Path) -> list[str]:
    return [str(nrrd(folder / "limb.nrrd", *a_map()))]


def two_tibias(labels: np.ndarray) -> np.ndarray:
    i, j, k = np.argwhere(labels == 2).T
    labels[i, j, k] = np.where(abs(k - k.mean()) < 2, 1, 2)
    return labels


def a_muscle_in_another(labels: np.ndarray) -> np.ndarray:
    """A region is what lies within its outline, whatever the map has in there."""
    i, j = np.argwhere(labels[..., labels.shape[2] // 2] == 1).T
    x, y = np.indices(labels.shape[:2])
    far = np.hypot(x - i.mean(), y - np.quantile(j, 0.25))
    for radius, label in ((6, 4), (4, 5)):
        inside = (far < radius)[..., None] & (labels == (1 if label == 4 else 4))
        labels[inside] = label
    return labels


def two_of_them(labels: np.ndarray) -> np.ndarray:
    return np.concatenate([labels, labels[::-1]])


def truncated_map(write: Callable[..., Path], name: str) -> Make:
    def make(folder: Path) -> list[str]:
        path = write(folder / name, *a_map())
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])
        return [str(path)]

    return make


def four_dimensions(folder: Path) -> list[str]:
    return nifti_header(folder, (4, 40, 40, 20, 5), 5 * 40 * 40 * 20)


def a_huge_header(folder: Path) -> list[str]:
    return nifti_header(folder, (3, 1000, 1000, 400), 1000)


def nifti_header(folder: Path, dim: tuple[int, ...], size: int) -> list[str]:
    """A NIfTI file with a header of its own and so many bytes of data."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, *(dim + (1,) * (8 - len(dim))))
    struct.pack_into("<2h", header, 70, 2, 8)
    struct.pack_into("<8f", header, 76, *([1.0] * 8))
    struct.pack_into("<f", header, 108, 352.0)
    header[344:348] = b"n+1\0"
    (folder / "limb.nii").write_bytes(bytes(header) + bytes(size))
    return [str(folder / "limb.nii")]


def coloured_voxels(folder: Path) -> list[str]:
    given = nifti_header(folder, (3, 40, 40, 20), 3 * 40 * 40 * 20)
    content = bytearray((folder / "limb.nii").read_bytes())
    struct.pack_into("<2h", content, 70, 128, 24)  # RGB24
    (folder / "limb.nii").write_bytes(content)
    return given


def a_gzipped_bomb(folder: Path) -> list[str]:
    content = (
        b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 700 700 700\n"
        b"spacings: 1 1 1\nencoding: gzip\n\n"
    )
    (folder / "limb.nrrd").write_bytes(content + gzip.compress(bytes(1000)))
    return [str(folder / "limb.nrrd")]


def an_image(folder: Path) -> list[str]:
    """Grey values instead of labels."""
    labels, affine = a_map()
    grey = np.random.default_rng(1).integers(0, 2000, labels.shape).astype(np.int16)
    return [str(nrrd(folder / "ct.nrrd", grey, affine))]


def slices(mode: str, *sizes: tuple[int, int], words: Sequence[str] = ()) -> Make:
    def make(folder: Path) -> list[str]:
        (folder / "slices").mkdir()
        for number, size in enumerate(sizes):
            Image.new(mode, size).save(folder / "slices" / f"{number}.png")
        return [str(folder / "slices"), *words]

    return make


def an_empty_folder(folder: Path) -> list[str]:
    (folder / "slices").mkdir()
    return [str(folder / "slices"), "--voxel", "1,1,3"]


def outlines(**parts: np.ndarray) -> Make:
    """Outlines as CSV files by name."""

    def make(folder: Path) -> list[str]:
        for name, points in parts.items():
            np.savetxt(folder / f"{name}.csv", points, delimiter=",", fmt="%.3f")
        return [str(folder / f"{name}.csv") for name in parts]

    return make


def circle(radius: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


TWO = outlines(skin=circle(50), tibia=circle(12))


def drawn(**parts: np.ndarray) -> Make:
    """Skin, bones and other closed curves of one SVG drawing, by id."""
    bones = {"skin": circle(50), "tibia": circle(12, -20, 8), "fibula": circle(6, 25, -5)}

    def make(folder: Path) -> list[str]:
        return [str(outlined_svg(folder / "limb.svg", bones | parts))]

    return make


TRIALS = (
    Trial("no such file", lambda folder: [str(folder / "leg.stl")], ("cannot be read",)),
    Trial("another format", binary("limb.pdf", b"%PDF-1.7"), ("is no surface", ".stl")),
    Trial("an empty STL", binary("limb.stl", b""), ("cannot be read as STL",)),
    Trial("a text for an STL", binary("limb.stl", b"hello world\n" * 50), ("as STL",)),
    Trial("an STL of 2 GB by its header", binary("limb.stl", bytes(80) + b"\xff" * 4 + bytes(50)),
          ("4294967295 triangles announced, 1 there",)),
    Trial("an STL that ends too early", half("stl"), ("is not complete", "announced")),
    Trial("a PLY that ends too early", half("ply"), ("is not complete",)),
    Trial("a VTP that ends too early", half("vtp"), ("is not complete",)),
    Trial("an OBJ that ends too early", half("obj"), ("is not complete",)),
    Trial("an OBJ that names points that it lacks",
          binary("limb.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99\n"), ("names points",)),
    Trial("points without triangles", points_alone, ("has no triangles",)),
    Trial("a file twice", lambda folder: limb(folder) * 2, ("is given twice",)),
    Trial("lengths in metres", metres, ("may be in m: add --units m",)),
    Trial("two limbs", two_limbs, ("lies beside", "give one limb")),
    Trial("a hole in the skin", a_hole, ("level 0.5", "the outline of skin is open by", "hole")),
    Trial("a ball", a_ball, ("--proximal +z",)),
    Trial("both ends alike", upside_down, ("which end is proximal?", "--proximal=")),
    Trial("bones that cannot be told apart", three_bones, ("which shell is the tibia?",)),
    Trial("a tibia outside the skin", outside, ("tibia leaves the skin by",)),
    Trial("no bone", lambda folder: limb(folder, *UP, "--tissues", "lumped", parts=["skin"]),
          ("no bone is known",)),
    Trial("no bone, and no directions for the atlas",
          lambda folder: limb(folder, *UP, parts=["skin"]),
          ("add --side, and --anterior",)),
    Trial("a level outside the source", lambda folder: limb(folder, "--level", "400 mm"),
          ("the source is 200 mm high",)),
    Trial("a level of 30, not 0.3", lambda folder: limb(folder, "--level", "30"),
          ("between 0 (distal) and 1", "'30 mm'")),
    Trial("a level in words", lambda folder: limb(folder, "--level", "knee"), ("is 'knee'",)),
    Trial("levels of one number", lambda folder: limb(folder, "--levels", "0.3"),
          ("FROM:TO:N",)),
    Trial("levels that all miss the tibia", lambda folder: limb(folder, "--levels", "0:0.01:2"),
          ("none can be made",)),
    Trial("a level without tibia", lambda folder: limb(folder, "--level", "0.01"),
          ("lies beyond the tibia", "between 0.02 and 0.98")),
    Trial("a plane along the limb", lambda folder: limb(folder, "--plane", "0,0,100,1,0,0"),
          ("lies along the limb",)),
    Trial("a plane of five numbers", lambda folder: limb(folder, "--plane", "0,0,100,1,0"),
          ("six numbers",)),
    Trial("a direction in words", lambda folder: limb(folder, "--proximal", "up"), ("is 'up'",)),
    Trial("an anterior that points upward", lambda folder: limb(folder, "--anterior", "+z"),
          ("lies along the limb's axis",)),
    Trial("a tolerance of 0", lambda folder: limb(folder, "--tolerance", "0"), ("more than 0",)),
    Trial("a tolerance that cannot be kept", lambda folder: limb(folder, "--tolerance", "0.001"),
          ("more than the tolerance", "add --tolerance")),
    Trial("a shell that is not there", lambda folder: limb(folder, "--tibia", "bone"),
          ("no file or shell 'bone'", "shell 1")),
    Trial("a skin 20 mm thick", lambda folder: limb(folder, "--skin-thickness", "20"),
          ("skin thickness",)),
    Trial("the result not as JSON", lambda folder: limb(folder, "--out", "limb.stl"),
          ("ends in .json",)),
    Trial("labels for a surface", lambda folder: limb(folder, "--labels", "labels.csv"),
          ("belongs to a label map",)),
    Trial("an AOP that ends too early", an_aop(lambda lines: lines[:500]),
          ("ends after", "of 720 radii")),
    Trial("an AOP with a word among its numbers",
          an_aop(lambda lines: [*lines[:99], "x", *lines[100:]]),
          ("line 100: 'x' is no number",)),
    Trial("an AOP in other coordinates",
          an_aop(lambda lines: [line.replace("CYLINDRICAL", "CARTESIAN") for line in lines]),
          ("line 3: is 'CARTESIAN'",)),
    Trial("an AOP that ends in its landmarks",
          an_aop(lambda lines: [*lines[:4], "2", "patella", "40 90 100"]),
          ("ends after 1 of 2 landmarks",)),
    Trial("an AOP with radii of 0", an_aop(lambda lines: [*lines[:-1], "0"]), ("radii positive",)),
    Trial("a label map without a table", no_table, ("what are its labels 1", "--labels FILE.csv")),
    Trial("a label that the table lacks", labelled(text="1,muscle\n2,tibia\n"),
          ("does not list label 3",)),
    Trial("a tissue that there is not", labelled(text="1,flesh\n"), ("line 1", "'flesh'")),
    Trial("a label twice in the table", labelled(text=TABLE + "3,tibia\n"), ("listed twice",)),
    Trial("a table of other columns", labelled(text="tibia,2\n"), ("line 1: is not label,region",)),
    Trial("an empty label map", labelled(np.zeros_like), ("is empty",)),
    Trial("a tibia in two pieces", labelled(two_tibias), ("tibia is in pieces of",)),
    Trial("a muscle around another one in a label map",
          labelled(a_muscle_in_another, TABLE + "4,soleus\n5,muscle 2\n"),
          ("limb.nrrd, level 0.5", "soleus and muscle_2 overlap by", "correct the outlines")),
    Trial("two limbs in a label map", labelled(two_of_them), ("has two limbs; add --side left",)),
    Trial("parts of both legs in the table",
          labelled(text="1,muscle\n2,left_tibia\n3,tibia_right\n"),
          ("names parts of a left and of a right limb", "--side")),
    Trial("septa of 20 mm", lambda folder: limb(folder, "--septum", "20"), ("septum: is 20 mm",)),
    Trial("no tibia in the table", labelled(text="1,muscle\n2,ignore\n3,ignore\n"),
          ("add --side, and --anterior",)),
    Trial("bones alone", labelled(text="1,ignore\n2,tibia\n3,fibula\n"),
          ("label skin or flesh too",)),
    Trial("grey values", an_image, ("an image, not labels",)),
    Trial("a label map with four dimensions", four_dimensions, ("has 4 dimensions",)),
    Trial("a NIfTI in colours", coloured_voxels, ("has several values a voxel",)),
    Trial("a NIfTI of 400 MB by its header", a_huge_header, ("400 MB announced",)),
    Trial("343 million voxels in a packed file of 1 kB", a_gzipped_bomb, ("343 MB announced",)),
    Trial("a NIfTI that ends too early", truncated_map(nifti, "limb.nii"), ("is not complete",)),
    Trial("a packed NIfTI that ends too early", truncated_map(nifti, "limb.nii.gz"),
          ("is not complete",)),
    Trial("a NRRD that ends too early", truncated_map(nrrd, "limb.nrrd"), ("is not complete",)),
    Trial("a MetaImage that ends too early", truncated_map(metaimage, "limb.mha"),
          ("is not complete",)),
    Trial("a text for a NIfTI", binary("limb.nii", b"hello world\n" * 50), ("limb.nii",)),
    Trial("pictures without the size of a voxel", slices("L", (9, 9), (9, 9)), ("--voxel X,Y,Z",)),
    Trial("pictures in colours", slices("RGB", (9, 9), (9, 9), words=["--voxel", "1,1,3"]),
          ("in colours (RGB)",)),
    Trial("pictures of different size", slices("L", (9, 9), (9, 8), words=["--voxel", "1,1,3"]),
          ("all slices must be equal",)),
    Trial("one picture", slices("L", (9, 9), words=["--voxel", "1,1,3"]), ("is one slice",)),
    Trial("a folder without pictures", an_empty_folder, ("without PNG or TIFF",)),
    Trial("voxels of no size", slices("L", (9, 9), (9, 9), words=["--voxel", "1,1,0"]),
          ("three sizes",)),
    Trial("an outline alone", outlines(skin=circle(50)), ("is one outline",)),
    Trial("outlines without names", outlines(a=circle(50), b=circle(10)), ("what is it?",)),
    Trial("an outline outside the skin", outlines(skin=circle(50), tibia=circle(12, 80)),
          ("tibia is not inside the skin's",)),
    Trial("outlines that do not tell the side",
          outlines(skin=circle(50), tibia=circle(12, -20), fibula=circle(6, 25)),
          ("a left or a right limb?",)),
    Trial("a file that has the name of no tissue",
          outlines(skin=circle(50), tibia=circle(12), soleous=circle(5, 0, -30)),
          ("soleous.csv: what is it?", "did you mean 'soleus'?")),
    Trial("a curve that has the name of no tissue", drawn(zebra=circle(5, 0, -30)),
          ("limb.svg, 'zebra': what tissue is 'zebra'?", "soleus", "ignore")),
    Trial("a curve with a tissue that there is not", drawn(**{"mine:flesh": circle(5, 0, -30)}),
          ("'mine:flesh'", "what tissue is 'flesh'?")),
    Trial("muscles that overlap",
          outlines(skin=circle(50), tibia=circle(12), soleus=circle(8, 0, -30),
                   fibularis_longus=circle(8, 14, -30)),
          ("soleus and fibularis_longus overlap by 2 mm near (7.00, -30.00) mm", "0.2 mm")),
    Trial("a muscle over a bone", drawn(soleus=circle(9, -20, -10)),
          ("soleus and tibia overlap by 3 mm",)),
    Trial("a muscle outside the envelope",
          drawn(muscle=circle(46), soleus=circle(10, 0, -38)),
          ("soleus leaves muscle, which is around it, by 2 mm",)),
    Trial("two files of one bone",
          outlines(skin=circle(50), tibia=circle(12), my_tibia=circle(8)),
          ("my_tibia.csv: is tibia, and so is",)),
    Trial("a drawing of both legs", drawn(left_soleus=circle(5, 0, -30), right_soleus=circle(5, 9)),
          ("a left and of a right limb", "--side left")),
    Trial("a drawing with a label table",
          lambda folder: [*TWO(folder), "--labels", "x.csv"],
          ("does not belong to a drawing",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return what a trial gives, without the folder's path."""
    return shortened(refused(["limb", *trial.given(folder)]), folder)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_a_bad_source_gets_one_line(
    trial: Trial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_trial(trial, said, tmp_path, monkeypatch, longest=400)


def test_there_are_more_than_forty() -> None:
    assert len({trial.name for trial in TRIALS}) == len(TRIALS) > 40
