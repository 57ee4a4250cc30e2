"""Meshes that were made before: the same to the last bit, and never those of another section."""

from dataclasses import fields, replace

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.materials.liner import Liner
from calfsocket.meshes import section, store
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.triangles import TriangleMesh
from tiny_study import tiny_limb, tiny_socket

COARSE = mesh_size("coarse")
LINER = Liner(thickness=2.0, law="gel", undersize=0.02)


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    monkeypatch.setattr(store, "cache_folder", lambda: tmp_path)
    return tmp_path / "meshes"


@pytest.fixture(scope="module")
def mesh() -> TriangleMesh:
    return section.build(tiny_limb(), tiny_socket("A"), COARSE)


def same(a: TriangleMesh, b: TriangleMesh) -> bool:
    pairs = [(getattr(a, each.name), getattr(b, each.name)) for each in fields(TriangleMesh)]
    return all(
        x == y and list(x) == list(y)
        if isinstance(x, dict)
        else x.dtype == y.dtype and x.tobytes() == y.tobytes()
        for x, y in pairs
    )


def refuse() -> TriangleMesh:
    pytest.fail("made again")


def test_a_mesh_that_was_made_is_the_same(mesh):
    assert store.stored("one", lambda: mesh) is mesh
    assert same(store.stored("one", refuse), mesh)


def test_a_simulation_takes_it_and_others_mesh_again(monkeypatch, mesh):
    made = []
    build = section.build
    monkeypatch.setattr(section, "build", lambda *given: made.append(given) or build(*given))
    for again, count in ((False, 1), (False, 1), (True, 2)):
        parts = (tiny_limb(), tiny_socket("A"), COARSE)
        found = section.section_mesh(MPI.COMM_SELF, *parts, again=again)
        assert len(made) == count
        np.testing.assert_array_equal(np.sort(found.cell_tags.values), np.sort(mesh.cell_tags))


def test_all_that_a_mesh_follows_from_is_in_its_name(monkeypatch, tmp_path):
    limb, socket = tiny_limb(), tiny_socket("A")
    region = limb.regions[0]
    moved = {name: curve for name, curve in limb.curves.items()}
    first = next(name for name, curve in moved.items() if hasattr(curve, "semi_axes"))
    a, b = moved[first].semi_axes
    moved[first] = moved[first].model_copy(update={"semi_axes": (a * (1 + 1e-15), b)})
    renamed = (region.model_copy(update={"name": "another"}), *limb.regions[1:])
    names = [
        store.name_of(limb, socket, COARSE),
        store.name_of(limb, tiny_socket("B"), COARSE),
        store.name_of(limb, socket, replace(COARSE, on_skin=COARSE.on_skin * (1 + 1e-15))),
        store.name_of(limb, socket, COARSE, LINER),
        store.name_of(limb, socket, COARSE, LINER.model_copy(update={"bonded": "socket"})),
        store.name_of(limb.model_copy(update={"curves": moved}), socket, COARSE),
        store.name_of(limb.model_copy(update={"regions": renamed}), socket, COARSE),
    ]
    source = tmp_path / "another.py"
    source.write_text("# gmsh's options")
    monkeypatch.setattr(store, "_sources", lambda: [source])
    names.append(store.name_of(limb, socket, COARSE))
    source.write_text("# other options")
    names.append(store.name_of(limb, socket, COARSE))
    monkeypatch.setattr(store.gmsh, "__version__", "another")
    names.append(store.name_of(limb, socket, COARSE))
    assert len(set(names)) == len(names)
    assert names[-1] == store.name_of(tiny_limb(), tiny_socket("A"), mesh_size("coarse"))


@pytest.mark.parametrize("damage", [lambda data: data[: len(data) // 2], lambda data: b"", None])
def test_a_damaged_file_is_made_again(damage, folder, mesh):
    store.stored("one", lambda: mesh)
    (file,) = folder.iterdir()
    if damage is None:
        np.savez(file, points=mesh.points)
    else:
        file.write_bytes(damage(file.read_bytes()))
    assert store.stored("one", lambda: mesh) is mesh
    assert same(store.stored("one", refuse), mesh)


def test_a_folder_that_cannot_be_written_costs_time_alone(folder, mesh):
    folder.write_text("no folder")
    assert store.stored("one", lambda: mesh) is mesh
    assert store.stored("one", lambda: mesh) is mesh


def test_meshes_that_were_not_used_for_longest_go_first(monkeypatch, folder, mesh):
    store.stored("one", lambda: mesh)
    size = (folder / "one.npz").stat().st_size
    monkeypatch.setattr(store, "LIMIT", int(2.5 * size))
    store.stored("two", lambda: mesh)
    for n, name in enumerate(("two", "one")):  # one was used after two was made
        store.os.utime(folder / f"{name}.npz", (n, n))
    store.stored("one", refuse)
    store.stored("three", lambda: mesh)
    assert {path.stem for path in folder.iterdir()} == {"one", "three"}
