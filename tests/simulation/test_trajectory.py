import json

import numpy as np
import pint
import pytest
import xarray as xr

from quakedesign.controllers import published
from quakedesign.errors import OutputError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.fault.friction import friction_law
from quakedesign.simulation import natural_earthquake, simulate, velocity_step
from quakedesign.simulation.recording import Recording

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
        "shear_stress": "Pa",
        "moment_rate": "N m/s",
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


def test_a_file_follows_the_climate_and_forecast_conventions(run, uncontrolled, tmp_path):
    """Section 2.6 (Conventions, title, source), 3.1 and 3.2 (units, long_name), 4 (axis); no attribute is an object."""
    for one in (run, uncontrolled):
        with xr.open_dataset(one.save(tmp_path / "run.nc"), engine="h5netcdf") as data:
            assert data.attrs["Conventions"].startswith("CF-1.")
            assert data.attrs["title"] == one.name
            assert data.attrs["source"].startswith("quakedesign")
            assert data.time.attrs["axis"] == "T"
            assert np.all(np.diff(data.time) > 0)
            for name, variable in data.variables.items():
                assert {"units", "long_name"} <= set(variable.attrs), name
                assert variable.dims == ("time",)
                assert np.all(np.isfinite(variable))
            assert all(isinstance(value, str | int | float | np.number) for value in data.attrs.values())
            assert all(name.isidentifier() for name in (*data.variables, *data.attrs))


def test_every_unit_can_be_read_by_a_library_of_units(run):
    """In the notation of UDUNITS; pint knows the same letters."""
    registry = pint.UnitRegistry()
    expected = {"moment_rate": "N*m/s", "shear_stress": "Pa", "matched_perturbation": "m/s^2 * Pa * m^2/kg"}
    for name, (_, _, unit) in run.signals().items():
        found = registry.parse_units(unit.replace(" ", "*").replace("/(kg*s^2)", "/kg/s^2"))
        assert name not in expected or found.dimensionality == registry.parse_units(expected[name]).dimensionality


def test_the_moment_rate_integrates_to_the_moment(uncontrolled):
    """M0 = G·A·slip (Kanamori 1977)."""
    moment = np.trapezoid(uncontrolled.moment_rate, uncontrolled.time)
    final = LAB.shear_modulus * LAB.area * uncontrolled.slip[-1]
    assert moment == pytest.approx(final, rel=2e-2)
    assert np.array_equal(uncontrolled.moment_rate, LAB.shear_modulus * LAB.area * uncontrolled.slip_rate)


def test_the_area_under_stress_against_slip_is_the_work_of_friction(uncontrolled):
    heat = np.trapezoid(uncontrolled.shear_stress, uncontrolled.slip) * LAB.area
    assert heat == pytest.approx(uncontrolled.energy.frictional, rel=1e-3)
    assert uncontrolled.shear_stress[0] == pytest.approx(0.57 * LAB.effective_normal_stress, rel=1e-12)


def test_friction_at_rest_sets_no_more_against_the_load_than_it_must():
    """Coulomb: τA = load on the block where it rests."""
    push = -0.3 * LAB.friction.residual * LAB.authority * LAB.effective_normal_stress
    run = simulate(LAB.with_disturbance(Disturbance(constant=push)), duration=0.1, plant="coulomb")
    static = (LAB.friction.residual + LAB.friction.drop) * LAB.effective_normal_stress
    assert np.all(run.slip == 0)
    assert run.shear_stress == pytest.approx(np.full(run.time.size, static + push * LAB.mass / LAB.area), rel=1e-12)


def test_the_figure_of_stress_names_quantities_and_units(uncontrolled):
    above, below = uncontrolled.plot_stress().axes
    assert above.get_ylabel().startswith("shear stress [")
    assert above.get_xlabel() == "slip [mm]"
    assert below.get_ylabel() == "moment rate [N m/s]"


def test_a_run_with_state_is_saved_by_the_same_calls(tmp_path):
    law = friction_law("rate-and-state-aging")(
        reference_coefficient=0.6,
        direct_effect=0.01,
        evolution_effect=0.015,
        critical_slip=1e-5,
        reference_rate=1e-6,
        slowest_rate=1e-12,
        fastest_rate=1.0,
    )
    run = velocity_step(law, 1e3, [(1.0, 1e-6), (1.0, 1e-5)])
    assert isinstance(run, Recording)
    with xr.open_dataset(run.save(tmp_path / "state.nc"), engine="h5netcdf") as data:
        assert data.attrs["Conventions"].startswith("CF-1.")
        assert np.array_equal(data.theta, run.states[0])
        assert data.time.attrs["units"] == "s"
