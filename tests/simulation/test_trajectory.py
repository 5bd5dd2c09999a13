import json

import numpy as np
import pytest
import xarray as xr

from quakedesign.controllers import published
from quakedesign.errors import OutputError
from quakedesign.fault import load_fault
from quakedesign.simulation import natural_earthquake, simulate

LAB = load_fault("lab-fault")


@pytest.fixture(scope="module")
def run():
    return simulate(LAB, published("lab-fault")["elqr"], duration=2.0, samples=100)


@pytest.fixture(scope="module")
def uncontrolled():
    return natural_earthquake(LAB)


def test_a_dataset_carries_units(run):
    data = run.to_xarray()
    assert data.slip.attrs == {"long_name": "slip x1", "units": "m"}
    assert {name: variable.attrs["units"] for name, variable in data.variables.items()} == {
        "time": "s",
        "slip": "m",
        "slip_rate": "m/s",
        "pressure": "Pa",
        "reference": "m",
        "reference_rate": "m/s",
        "matched_perturbation": "m^3 Pa/(kg s^2)",
        "friction": "1",
        "xi_1": "m s",
        "xi_2": "m s^2",
    }


def test_a_table_names_its_units(run):
    table = run.to_pandas()
    assert table.index.name == "time [s]"
    assert "slip_rate [m/s]" in table
    assert np.array_equal(table["pressure [Pa]"], run.pressure)


def test_the_response_is_python_controls(run):
    response = run.response
    assert response.output_labels == ["slip", "slip_rate"]
    assert response.input_labels == ["p"]
    assert np.array_equal(response.outputs[0], run.slip)
    assert np.array_equal(response.inputs.ravel(), run.pressure)
    assert response.states.shape == (4, run.time.size)


def test_the_figure_names_quantities_and_units(run, uncontrolled):
    labels = [axis.get_ylabel() for axis in run.plot().axes]
    assert [label.split(" [")[0] for label in labels] == [
        "slip",
        "slip rate",
        "pressure",
        "slip error",
        "slip-rate error",
    ]
    assert all(label.endswith(("m]", "m/s]", "Pa]")) for label in labels)
    assert len(uncontrolled.plot().axes) == 3
    assert uncontrolled.plot().axes[-1].get_xlabel() == "time [s]"


def test_a_saved_run_reads_back(run, tmp_path):
    path = run.save(tmp_path / "run.nc")
    with xr.open_dataset(path, engine="h5netcdf") as data:
        assert np.array_equal(data.slip, run.slip)
        assert data.slip.attrs["units"] == "m"
        assert json.loads(data.attrs["metrics"]) == run.metrics.to_dict()
        assert data.attrs["method"] == "dormand-prince"
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


def test_a_folder_that_does_not_exist_is_reported(run, tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        run.save(tmp_path / "missing" / "run.nc")


def test_a_failed_write_leaves_the_old_file(run, tmp_path, monkeypatch):
    path = run.save(tmp_path / "run.nc")
    before = path.read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full)
    with pytest.raises(OutputError, match="No space"):
        run.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


def test_without_control_nothing_is_followed(uncontrolled):
    assert uncontrolled.reference is None
    assert uncontrolled.slip_error is None
    assert "reference" not in uncontrolled.to_xarray()


def test_a_run_says_where_it_comes_from(run):
    assert {"method", "step", "scheme", "backend", "version_casadi", "version_numpy"} <= set(run.provenance)


def test_its_text_shows_figures_not_arrays(run):
    assert "Metrics" in repr(run)
    assert "array" not in repr(run)
