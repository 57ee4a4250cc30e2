"""Results for other programs: labelled arrays and netCDF, series for ParaView, SVG."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
import xarray
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import InputError
from calfsocket.materials.material_set import MaterialSet
from calfsocket.plotting import case
from calfsocket.postprocess import series
from calfsocket.postprocess.quantities import Quantities
from calfsocket.simulation.record import StateRecord
from calfsocket.simulation.result import Result
from calfsocket.simulation.simulation import Simulation
from report_results import result
from sections import contact_around, limb_and_socket
from tiny_study import tiny_limb, tiny_socket


@pytest.fixture(scope="module")
def solved() -> Result:
    return result(("TC", "separate"), limb_and_socket(), contact_around())


@pytest.fixture(scope="module")
def walked(solved: Result) -> Result:
    """A case with the state after one stage, in which all stresses are doubled."""
    fields = replace(solved.fields, stress=2 * solved.fields.stress)
    record = solved.record.model_copy(update={"state": StateRecord(stage="lift")})
    state = replace(solved, fields=fields, record=record)
    record = solved.record.model_copy(update={"states": ("lift",)})
    curve = solved.steps[["step", "load"]]
    return replace(solved, record=record, states={"lift": state}, curve=curve)


# --- labelled arrays


def test_arrays_are_those_of_the_result(solved: Result) -> None:
    data = solved.to_xarray()
    assert np.array_equal(data.stress_kPa.sel(component="12"), solved.fields.stress[..., 3])
    nodal = solved.quantities.nodal["effective_stress"]
    skin = data.effective_stress_kPa.where(data.tissue == "skin", drop=True)
    assert np.array_equal(skin, nodal[solved.fields.cells_of("skin")])
    assert np.array_equal(data.contact_pressure_kPa, solved.contact.pressure_kPa)
    assert data.contact_pressure_kPa.units == "kPa" and data.arc_mm.units == "mm"
    assert data.amp_log_strain_percent.units == "percent"
    assert (data.socket, data.material_set, data.load_reached) == ("TC", "separate", 1.0)
    assert "state" not in data.dims


def test_every_array_says_what_it_is(walked: Result) -> None:
    data = walked.to_xarray()
    assert all(data[name].long_name for name in data.variables)
    numbers = [name for name, array in data.data_vars.items() if array.dtype.kind == "f"]
    assert all(data[name].units for name in numbers)
    assert data.deformation_gradient.units == "1" and data.source.startswith("calfsocket ")


def test_states_are_a_dimension(walked: Result) -> None:
    data = walked.to_xarray()
    donned, lifted = data.stress_kPa.sel(state="donned"), data.stress_kPa.sel(state="lift")
    assert np.array_equal(2 * donned, lifted) and np.abs(donned).max() > 0
    assert "state" not in data.region.dims and "state" not in data.arc_mm.dims


def test_net_cdf_holds_all_of_it(walked: Result, tmp_path: Path) -> None:
    data = walked.to_xarray()
    data.to_netcdf(tmp_path / "result.nc")
    with xarray.open_dataset(tmp_path / "result.nc") as read:
        xarray.testing.assert_equal(read.load(), data)
        assert read.stress_kPa.units == "kPa" and read.title == data.title


# --- a series for ParaView


def test_stages_are_a_series(walked: Result, tmp_path: Path) -> None:
    walked.save(tmp_path)
    reader = pyvista.get_reader(tmp_path / series.SERIES_FILE)
    assert reader.time_values == [1.0, 2.0]
    reader.set_active_time_value(2.0)
    stress = reader.read()[0].cell_data["gauss_stress_kPa"]
    assert np.array_equal(stress, 2 * walked.fields.stress.reshape(stress.shape))
    Result.remove(tmp_path)
    assert not list(tmp_path.iterdir())


def test_one_state_is_no_series(solved: Result, tmp_path: Path) -> None:
    (tmp_path / series.SERIES_FILE).write_text("of an earlier run")
    solved.save(tmp_path)
    assert not (tmp_path / series.SERIES_FILE).exists()


def test_load_steps_are_a_series(tmp_path: Path) -> None:
    simulation = Simulation(
        tiny_limb(),
        tiny_socket("C"),
        MaterialSet.paper("combined"),
        mesh_size="coarse",
        contact=Contact(),
        comm=MPI.COMM_SELF,
    )
    series.write_step(tmp_path, result(("A", "x"), *ROUND).quantities, 0.987)  # of an earlier run
    found = simulation.solve(step_fields=tmp_path)
    found.save(tmp_path)
    reader = pyvista.get_reader(tmp_path / series.SERIES_FILE)
    loads = found.steps.load[found.steps.converged]
    assert len(loads) > 2
    assert reader.time_values == pytest.approx(loads.tolist(), abs=1e-6)
    largest = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        grid = reader.read()[0]
        assert grid.field_data["load"] == pytest.approx(time, abs=1e-6)
        largest.append(np.abs(grid.point_data["displacement"]).max())
    assert np.all(np.diff(largest) > 0)  # the socket presses more and more
    series.remove_steps(tmp_path)
    assert not (tmp_path / series.STEPS_FOLDER).exists()


class StoppedLater(Exception):
    """Raised after a few steps."""


def test_a_run_that_was_stopped_goes_on_with_its_series(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it was stopped, as the third step's fields were to be written, none is missing."""

    def solve(name: str, **options: Any) -> Result:
        sets = MaterialSet.paper("combined")
        tiny = Simulation(tiny_limb(), tiny_socket("C"), sets, "coarse", comm=MPI.COMM_SELF)
        checkpoint = tmp_path / f"{name}.npz"
        return tiny.solve(checkpoint=checkpoint, step_fields=tmp_path / name, **options)

    solve("whole").save(tmp_path / "whole")

    def stop(folder: Path, quantities: Quantities, load: float) -> None:
        if len(series.loads_of_steps(folder)) == 2:
            raise StoppedLater
        series.write_step(folder, quantities, load)

    with monkeypatch.context() as patch:
        patch.setattr("calfsocket.simulation.simulation.write_step", stop)
        with pytest.raises(StoppedLater):
            solve("stopped")
    series.write_step(tmp_path / "stopped", result(("A", "x"), *ROUND).quantities, 0.987)
    resumed = solve("stopped", resume=True)
    resumed.save(tmp_path / "stopped")
    assert resumed.record.resumed_from_load > 0
    files = [
        {file.relative_to(tmp_path / name): file.read_bytes() for file in found}
        for name in ("whole", "stopped")
        for found in [(tmp_path / name).glob("load_steps/*/*"), (tmp_path / name).glob("*.pvd")]
    ]
    assert len(files[0]) > 2 and files[:2] == files[2:]


ROUND = limb_and_socket(), contact_around()


# --- pictures


def test_svg_has_letters_and_the_same_bytes(
    solved: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(case, "PIXELS", 300)
    first = solved.draw(tmp_path, "svg")
    text = first.read_bytes()
    assert first.name == "picture.svg" and text.startswith(b"<?xml") and b"</svg>" in text
    assert solved.draw(tmp_path, "svg").read_bytes() == text
    Result.remove(tmp_path)
    assert not first.exists()


def test_other_formats_are_refused(solved: Result, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="form is 'bmp'; allowed: png, svg, pdf"):
        solved.draw(tmp_path, "bmp")
