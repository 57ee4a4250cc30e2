"""Files read back; and whole at every moment, whoever else writes."""

import errno
import fcntl
import json
import multiprocessing
import os
import stat
import subprocess
import sys

import meshio
import numpy as np
import pandas as pd
import pytest
import pyvista

from calfsocket.io.errors import InputError, WriteError
from calfsocket.io.files import occupied, remove_unfinished, replacing, write_json
from calfsocket.io.tables import merge_csv
from calfsocket.postprocess.fields import TISSUES
from calfsocket.postprocess.quantities import Quantities
from calfsocket.postprocess.vtu import FIELDS_FILE, read_fields, write_fields
from sections import limb_and_socket
from shared_table import KEY, ORDER, rows, write_often

# --- atomic


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "run.json"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["run.json"]


def test_files_have_the_mode_of_any_new_file(tmp_path):
    with replacing(tmp_path / "new" / "run.json") as temporary:
        temporary.write_text("")
    plain = tmp_path / "plain"
    plain.write_text("")
    assert stat.S_IMODE((tmp_path / "new/run.json").stat().st_mode) == stat.S_IMODE(
        plain.stat().st_mode
    )


def test_json_round_trip(tmp_path):
    content = {"versions": {"dolfinx": "0.9.0"}, "unit": "N/mm²", "sizes": [1, 2.5]}
    write_json(tmp_path / "run.json", content)
    text = (tmp_path / "run.json").read_text(encoding="utf-8")
    assert json.loads(text) == content and "N/mm²" in text
    with pytest.raises(ValueError):
        write_json(tmp_path / "run.json", {"x": float("nan")})  # no other reader takes NaN
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8")) == content


# --- shared CSV


def test_merge_sorts_by_the_study_and_keeps_the_order_within_a_case(tmp_path):
    path = tmp_path / "summary.csv"
    for socket, material_set in [("HS", "separate"), ("TC", "combined"), ("TC", "separate")]:
        merge_csv(path, rows(socket, material_set, [3.0, 1.0, 2.0]), KEY, ORDER)
    frame = pd.read_csv(path)
    assert list(frame.socket + frame.material_set) == (
        ["TCseparate"] * 3 + ["TCcombined"] * 3 + ["HSseparate"] * 3
    )
    assert frame.value.tolist() == [3, 1, 2] * 3


def test_merge_replaces_a_case_and_keeps_the_others_to_the_letter(tmp_path):
    path = tmp_path / "summary.csv"
    path.write_text("socket,material_set,value\nTC,separate,0.12345678901234567\nHS,separate,9\n")
    merge_csv(path, rows("HS", "separate", [1.0, 2.0]), KEY, ORDER)
    assert path.read_text() == (
        "socket,material_set,value\nTC,separate,0.12345678901234567\nHS,separate,1\nHS,separate,2\n"
    )


def test_cases_outside_the_study_come_last(tmp_path):
    path = tmp_path / "summary.csv"
    merge_csv(path, rows("AA", "separate", [1.0]), KEY, ORDER)
    merge_csv(path, rows("TC", "separate", [1.0]), KEY, ORDER)
    assert pd.read_csv(path).socket.tolist() == ["TC", "AA"]


def test_numbers_are_written_once_and_for_all(tmp_path):
    path = tmp_path / "summary.csv"
    merge_csv(path, rows("TC", "separate", [1 / 3, -0.0, np.nan, 1e-12, 12]), KEY, ORDER)
    first = path.read_text()
    assert [line.split(",")[2] for line in first.splitlines()[1:]] == [
        "0.3333333333",
        "0",
        "",
        "1e-12",
        "12",
    ]
    # read and written again, the file is the same
    merge_csv(path, pd.read_csv(path), KEY, ORDER)
    assert path.read_text() == first


def test_names_that_look_like_missing_values_stay(tmp_path):
    path = tmp_path / "summary.csv"
    merge_csv(path, rows("NA", "separate", [1.0]), KEY, ORDER)
    merge_csv(path, rows("TC", "separate", [1.0]), KEY, ORDER)
    assert "NA,separate,1" in path.read_text()


def test_four_processes_at_once_lose_nothing_and_a_reader_sees_whole_files(tmp_path):
    path = tmp_path / "summary.csv"
    context = multiprocessing.get_context("spawn")
    start = context.Event()
    cases = ORDER[:4]
    writers = [context.Process(target=write_often, args=(path, *case, start)) for case in cases]
    for writer in writers:
        writer.start()
    start.set()
    seen = 0
    while any(writer.is_alive() for writer in writers):
        if path.exists():
            frame = pd.read_csv(path)
            assert frame.groupby(KEY).value.count().isin([200]).all()
            seen += 1
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * 4
    assert seen > 0
    frame = pd.read_csv(path)
    assert list(frame[KEY].drop_duplicates().itertuples(index=False, name=None)) == cases
    for _, case in frame.groupby(KEY):
        assert case.value.tolist() == list(range(9, 209))


# --- a folder for one run


def test_a_folder_is_occupied_once_and_free_afterwards(tmp_path):
    with occupied(tmp_path / "new"):
        with pytest.raises(
            InputError, match=rf"process {os.getpid()} on .* \(since 2.*name another"
        ):
            with occupied(tmp_path / "new"):
                pass
        with pytest.raises(InputError, match="is solving into this folder"):
            with occupied(tmp_path / "new"):
                pass
    with occupied(tmp_path / "new"):
        pass


def test_a_disk_without_locks_gets_a_warning(tmp_path, monkeypatch, caplog):
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with occupied(tmp_path):
        assert f"{tmp_path}: cannot be locked (No locks available)" in caplog.text


# --- fields


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "TC_separate"
    fields = limb_and_socket()
    write_fields(folder, Quantities.of(fields), 0.5)
    return folder, fields


def test_fields_hold_names_and_values(written):
    folder, fields = written
    grid = pyvista.read(folder / FIELDS_FILE)
    assert set(grid.celltypes) == {pyvista.CellType.QUADRATIC_TRIANGLE}
    named = {name: values.tolist() for name, values in grid.field_data.items()}
    for number, name in fields.region_names.items():
        tissue = TISSUES.index(fields.region_tissues[number])
        assert named[f"region {name}"] == [number, tissue]
        assert named[f"tissue {TISSUES[tissue]}"] == [tissue]
    assert named["load"] == [0.5]
    assert grid.cell_data["region"].tolist() == fields.region.tolist()
    assert set(grid.point_data.keys()) == {
        "displacement",
        "effective_stress_kPa",
        "shear_stress_kPa",
        "amp_log_strain_percent",
        "shear_log_strain_percent",
        "pressure_kPa",
        "node",
    }
    cells = grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE]
    np.testing.assert_array_equal(grid.points[cells][..., :2], fields.points[fields.cells])
    displacement = grid.point_data["displacement"][cells]
    np.testing.assert_array_equal(displacement[..., :2], fields.displacement[fields.cells])
    np.testing.assert_array_equal(displacement[..., 2], 0)
    nodal = Quantities.of(fields).nodal
    for name in ("effective_stress_kPa", "shear_log_strain_percent"):
        np.testing.assert_array_equal(
            grid.point_data[name][cells], nodal[name.removesuffix("_kPa").removesuffix("_percent")]
        )


def test_meshio_reads_the_fields_as_pyvista_does(written):
    folder, _ = written
    grid, mesh = pyvista.read(folder / FIELDS_FILE), meshio.read(folder / FIELDS_FILE)
    (cells,) = mesh.cells
    assert cells.type == "triangle6"
    np.testing.assert_array_equal(cells.data, grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE])
    np.testing.assert_array_equal(mesh.points, grid.points)
    assert set(mesh.point_data) == set(grid.point_data) and mesh.point_data
    for name, values in mesh.point_data.items():
        np.testing.assert_array_equal(values, grid.point_data[name])
    assert set(mesh.cell_data) == set(grid.cell_data)
    for name, (values,) in mesh.cell_data.items():
        np.testing.assert_array_equal(values, grid.cell_data[name])
    assert set(mesh.field_data) == set(grid.field_data)
    for name, values in mesh.field_data.items():
        np.testing.assert_array_equal(values, grid.field_data[name])


def test_stress_may_jump_between_regions(written):
    folder, fields = written
    grid = pyvista.read(folder / FIELDS_FILE)
    names = {name: i for i, name in fields.region_names.items()}
    node, stress = grid.point_data["node"], grid.point_data["effective_stress_kPa"]
    cells = grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE]
    skin = np.unique(cells[fields.region == names["skin"]])
    fat = np.unique(cells[fields.region == names["subcutaneous_fat"]])
    assert not set(skin) & set(fat)
    shared, in_skin, in_fat = np.intersect1d(node[skin], node[fat], return_indices=True)
    assert len(shared) > 100
    # the made-up stress of skin is 6 times that of fat
    np.testing.assert_allclose(stress[skin][in_skin] / stress[fat][in_fat], 6, rtol=0.1)


def test_fields_read_back_without_loss(written):
    folder, fields = written
    again = read_fields(folder)
    for name, value in vars(fields).items():
        np.testing.assert_array_equal(getattr(again, name), value)


def test_fields_are_binary_and_compressed(written):
    head = (written[0] / FIELDS_FILE).read_bytes()[:2000]
    assert b"vtkZLibDataCompressor" in head and b'format="ascii"' not in head


def test_what_killed_writers_left_is_removed_and_living_ones_are_left_alone(tmp_path):
    program = (
        "import os, signal, sys\n"
        "from calfsocket.io.files import replacing\n"
        "with replacing(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", program, tmp_path / "run.json"], check=False)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["half"]
    with replacing(tmp_path / "run.json") as temporary:
        remove_unfinished(tmp_path)
        assert list(tmp_path.iterdir()) == [temporary]
        temporary.write_text("whole")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["whole"]


def test_a_table_that_is_none_is_named_and_left_as_it_is(tmp_path):
    path = tmp_path / "summary.csv"
    for content in (b"", b"\xff\x00", b"a,b\n1,2\n"):
        path.write_bytes(content)
        with pytest.raises(WriteError, match=r"summary\.csv: is not the table .* move it away"):
            merge_csv(path, pd.DataFrame({"case": ["A"]}), ["case"], [])
        assert path.read_bytes() == content
