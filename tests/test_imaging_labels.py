"""Limbs from label maps, in any format and orientation."""

import gzip
from collections.abc import Callable
from functools import cache
from pathlib import Path

import nibabel
import numpy as np
import pytest
import shapely
from phantom import Phantom, turned
from PIL import Image
from test_imaging_surface import differences, polygons
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkIOImage import vtkNIFTIImageWriter

import calfsocket as cs
from calfsocket.imaging.labels import read_labels
from calfsocket.imaging.section import around_all
from calfsocket.imaging.volume import read_volume

PARTS = ("skin", "muscle", "tibia", "fibula")
TABLE = "label,region\n1,fat\n2,muscle\n3,tibia\n4,fibula\n"
#: The limb a little oblique in the map.
TILTED = np.linalg.qr(np.eye(3) + 0.15 * turned(5))[0]
TILTED = TILTED * np.sign(np.diag(TILTED))


@cache
def tilted_map() -> tuple[Phantom, np.ndarray, np.ndarray]:
    phantom = Phantom(turn=TILTED)
    return phantom, *phantom.labels((1.0, 1.0, 3.0), *PARTS)


def nrrd(path: Path, labels: np.ndarray, affine: np.ndarray, space: str = "LPS") -> Path:
    """Write an NRRD file; the limb's x, y, z become left, posterior, superior."""
    to = np.diag({"LPS": [-1.0, -1, 1], "LAS": [-1.0, 1, 1]}.get(space, [1.0, 1, 1]))
    vectors = " ".join("(" + ",".join(map(str, to @ v)) + ")" for v in affine[:, :3].T)
    origin = "(" + ",".join(map(str, to @ affine[:, 3])) + ")"
    header = (
        f"NRRD0004\n# a remark\ntype: {labels.dtype}\ndimension: 3\n"
        + (f"space: {'left-posterior-superior' if space == 'LPS' else space}\n" if space else "")
        + f"sizes: {' '.join(map(str, labels.shape))}\nspace directions: {vectors}\n"
        f"endian: little\nencoding: gzip\nspace origin: {origin}\n\n"
    )
    path.write_bytes(header.encode() + gzip.compress(labels.tobytes(order="F"), 1))
    return path


def metaimage(path: Path, labels: np.ndarray, affine: np.ndarray) -> Path:
    """Write a MetaImage file."""
    to = np.diag([-1.0, -1, 1])
    size = np.linalg.norm(affine[:, :3], axis=0)
    directions = (to @ affine[:, :3] / size).T.ravel()
    header = (
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        f"CompressedData = False\nTransformMatrix = {' '.join(map(str, directions))}\n"
        f"Offset = {' '.join(map(str, to @ affine[:, 3]))}\nAnatomicalOrientation = LPI\n"
        f"ElementSpacing = {' '.join(map(str, size))}\n"
        f"DimSize = {' '.join(map(str, labels.shape))}\n"
        "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    )
    path.write_bytes(header.encode() + labels.tobytes(order="F"))
    return path


def nifti(path: Path, labels: np.ndarray, affine: np.ndarray) -> Path:
    """Write a NIfTI file."""
    size = np.linalg.norm(affine[:, :3], axis=0)
    image = vtkImageData()
    image.SetDimensions(labels.shape)
    image.SetSpacing(*size)
    values = numpy_to_vtk(np.ascontiguousarray(labels.ravel(order="F")), deep=True)
    image.GetPointData().SetScalars(values)
    matrix = vtkMatrix4x4()
    for i, row in enumerate(np.column_stack([affine[:, :3] / size, affine[:, 3]])):
        for j, value in enumerate(row):
            matrix.SetElement(i, j, value)
    writer = vtkNIFTIImageWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    writer.SetSFormMatrix(matrix)
    writer.SetQFormMatrix(matrix)
    writer.Write()
    return path


def table(folder: Path, text: str = TABLE) -> Path:
    path = folder / "labels.csv"
    path.write_text(text)
    return path


def test_axes_that_are_left_handed_do_not_mirror_the_limb(tmp_path: Path) -> None:
    phantom, labels, affine = tilted_map()
    path = nrrd(tmp_path / "a.nrrd", labels, affine, "LAS")
    limb = cs.Limb.from_labels(path, table(tmp_path), tissues="lumped")
    assert limb.side == "right"
    assert differences(limb, phantom, 0.5)["skin"][1] < 0.8


@pytest.mark.parametrize(
    ("write", "name"),
    [(nifti, "limb.nii.gz"), (nifti, "limb.nii"), (nrrd, "limb.nrrd"), (metaimage, "limb.mha")],
    ids=["nii.gz", "nii", "nrrd", "mha"],
)
def test_every_format_gives_the_limb(
    tmp_path: Path, write: Callable[[Path, np.ndarray, np.ndarray], Path], name: str
) -> None:
    phantom, labels, affine = tilted_map()
    path = write(tmp_path / name, labels, affine)
    limb = cs.Limb.from_labels(path, table(tmp_path), tissues="lumped")
    assert set(limb.tissues) == {"skin", "subcutaneous_fat", "muscle", "tibia", "fibula"}
    assert limb.side == "right"
    for part, (area, distance) in differences(limb, phantom, 0.5).items():
        assert abs(area) < {"skin": 0.003, "tibia": 0.01, "fibula": 0.03}[part]
        assert distance < 0.8  # half a voxel, and the height of the section
    deviations = [r.deviation_mm for r in limb.regions if r.deviation_mm is not None]
    assert max(deviations) <= 1.0


def said_by_header(labels: np.ndarray, affine: np.ndarray) -> dict[str, nibabel.Nifti1Image]:
    """The map as headers of other kinds say where it lies."""
    by_qform = nibabel.Nifti1Image(labels[::-1], None)  # left-handed: qfac is -1
    turned_over = affine * [-1.0, 1, 1, 1] + np.outer(affine[:, 0], [0, 0, 0, len(labels) - 1])
    by_qform.set_qform(np.vstack([turned_over, [0, 0, 0, 1]]), 1)
    assert by_qform.header["pixdim"][0] == -1 and not by_qform.header["sform_code"]
    in_metres = nibabel.Nifti1Image(labels, np.vstack([affine / 1000, [0, 0, 0, 1]]))
    in_metres.header.set_xyzt_units("meter")
    whole = np.vstack([affine, [0, 0, 0, 1]])
    scaled = nibabel.Nifti1Image((labels * 2 + 4).astype(np.int16), whole)
    scaled.header.set_slope_inter(0.5, -2)
    big = nibabel.Nifti1Header(endianness=">")
    return {
        "qform": by_qform,
        "metres": in_metres,
        "scaled": scaled,
        "floats": nibabel.Nifti1Image(labels.astype(np.float32), whole),
        "big-endian": nibabel.Nifti1Image(labels.astype(">i2"), whole, big),
        "NIfTI-2": nibabel.Nifti2Image(labels[..., None], whole),
    }


@pytest.mark.parametrize("kind", ["qform", "metres", "scaled", "floats", "big-endian", "NIfTI-2"])
def test_nifti_headers_of_other_kinds(tmp_path: Path, kind: str) -> None:
    _, labels, affine = tilted_map()
    nibabel.save(said_by_header(labels, affine)[kind], tmp_path / "limb.nii.gz")
    found = read_volume(tmp_path / "limb.nii.gz", None)
    places = [np.argwhere(each == 3).mean(axis=0) for each in (found.labels, labels)]
    middle, true = (
        to[:, :3] @ place + to[:, 3]
        for to, place in zip((found.affine, affine), places, strict=True)
    )
    assert middle == pytest.approx(true, abs=1e-3)
    assert np.array_equal(np.unique(found.labels), np.unique(labels))
    assert found.superior is not None


def test_axes_in_any_order_give_the_same_limb(tmp_path: Path) -> None:
    _, labels, affine = tilted_map()
    limb = cs.Limb.from_labels(
        nrrd(tmp_path / "a.nrrd", labels, affine), table(tmp_path), tissues="lumped"
    )
    order = [2, 0, 1]
    flipped = labels.transpose(order)[:, ::-1]
    columns = affine[:, :3][:, order]
    origin = affine[:, 3] + columns[:, 1] * (flipped.shape[1] - 1)
    columns = columns * [1, -1, 1]
    other = nrrd(tmp_path / "b.nrrd", flipped, np.column_stack([columns, origin]))
    same = polygons(cs.Limb.from_labels(other, table(tmp_path), tissues="lumped"))
    for name, polygon in polygons(limb).items():
        # Triangles of voxels depend on the order of the axes.
        assert polygon.exterior.hausdorff_distance(same[name].exterior) < 0.2


def test_stacks_of_pictures(tmp_path: Path) -> None:
    phantom = Phantom()
    labels, _ = phantom.labels((1.0, 1.0, 4.0), *PARTS)
    pages = [
        Image.fromarray(np.ascontiguousarray(page.T[::-1])) for page in labels.transpose(2, 0, 1)
    ]
    # First: Pillow 13 keeps what PNG set in a picture, and the encoder of TIFF refuses it.
    pages[0].save(tmp_path / "limb.tif", save_all=True, append_images=pages[1:])
    (tmp_path / "slices").mkdir()
    for number, page in enumerate(pages):
        page.save(tmp_path / "slices" / f"limb{number}.png")
    for path in (tmp_path / "slices", tmp_path / "limb.tif"):
        limb = cs.Limb.from_labels(
            path, table(tmp_path), voxel=(1, 1, 4), proximal="+z", tissues="lumped"
        )
        assert limb.side == "right"
        for area, distance in differences(limb, phantom, 0.5).values():
            assert abs(area) < 0.03
            assert distance < 0.6


def test_curves_are_smooth(tmp_path: Path) -> None:
    """Within half a voxel the steps of 1 mm are gone: the skin bends as the true one does."""
    _, labels, affine = tilted_map()
    limb = cs.Limb.from_labels(
        nrrd(tmp_path / "a.nrrd", labels, affine), table(tmp_path), tissues="lumped"
    )
    bends = np.abs(limb.skin.curvature(limb.skin.sample(0.5)))
    assert bends.max() < 2 / 14.7  # twice that of the reference calf


@pytest.mark.parametrize("voxel", [0.5, 1.0])
def test_steps_of_voxels_are_no_gaps_between_muscles(voxel: float) -> None:
    """Filled, they would move the envelope outward, and make the fat too thin."""
    number = int(60 / voxel)
    places = voxel * (np.indices((number, number)).reshape(2, -1).T + 0.5)
    x, y = places[np.hypot(*(places - [30.2, 29.9]).T) < 25].T
    body = shapely.union_all(
        shapely.box(x - voxel / 2, y - voxel / 2, x + voxel / 2, y + voxel / 2)
    )
    remarks: list[str] = []
    assert around_all([body], remarks, voxel).area == pytest.approx(body.area, abs=1e-6)
    assert around_all([body], [], 0.0).area > body.area + 0.05 * voxel * 2 * np.pi * 25
    assert not remarks
    gap = shapely.box(29.5, 30, 30.5, 60)
    closed = around_all([body.difference(gap)], remarks, voxel)
    assert closed.area == pytest.approx(body.area, abs=0.5)
    assert remarks == ["muscle: gaps of 25 mm2 between muscles closed"]


def test_stray_voxels_and_holes_are_cleaned_and_told(tmp_path: Path) -> None:
    _, labels, affine = tilted_map()
    spoiled = labels.copy()
    inside = np.argwhere(labels == 3)
    middle = inside[len(inside) // 2]
    spoiled[tuple(middle)] = 0
    spoiled[2:4, 2:4, 2] = 3
    clean = read_labels(nrrd(tmp_path / "a.nrrd", labels, affine), table(tmp_path))
    source = read_labels(nrrd(tmp_path / "b.nrrd", spoiled, affine), table(tmp_path))
    assert "limb: 4 stray voxels in 1 island left out" in source.remarks
    assert "tibia: 1 voxel of holes filled" in source.remarks
    assert source.bones["tibia"].surface.n_points == clean.bones["tibia"].surface.n_points


def test_regions_of_their_own_and_cavities(tmp_path: Path) -> None:
    phantom = Phantom()
    labels, affine = phantom.labels((1.0, 1.0, 4.0), *PARTS, "cavity")
    text = TABLE.replace("2,muscle", "2,soleus,muscle") + "5,tibia_cavity\n"
    source = read_labels(nrrd(tmp_path / "a.nrrd", labels, affine), table(tmp_path, text))
    assert list(source.regions) == ["soleus"]
    assert list(source.cavities) == ["tibia"]
    limb = cs.Limb.from_labels(tmp_path / "a.nrrd", tmp_path / "labels.csv", tissues="lumped")
    true = phantom.section("cavity", 0.5).area
    cavity = shapely.Polygon(polygons(limb)["cavity"]).area
    assert cavity == pytest.approx(true, rel=0.02)
