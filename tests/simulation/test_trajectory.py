import json
import os
import re
from dataclasses import fields, replace

import numpy as np
import pint
import pytest
import xarray as xr

from quakedesign.errors import OutputError, ParameterError
from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.laws import published
from quakedesign.loop import Actuator, Diffusion, Lag, Saturation
from quakedesign.simulation import natural_earthquake, simulate, velocity_step
from quakedesign.simulation import trajectory as trajectory_module
from quakedesign.simulation.trajectory import Trajectory

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
        "matched_perturbation": "m/s^2",
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
    assert np.array_equal(table["friction [-]"], run.friction)


def test_what_a_run_does_not_have_is_none(run, uncontrolled):
    assert (uncontrolled.slip_error, uncontrolled.slip_rate_error) == (None, None)
    assert np.array_equal(run.slip_rate_error, run.slip_rate - run.reference_rate)
    assert json.loads(replace(run, energy=None).attributes()["energy"]) is None
    assert json.loads(run.attributes()["energy"]) == run.energy.to_dict()
    with pytest.raises(ValueError, match="JSON"):  # as files hold what every reader of JSON reads
        replace(run, events={"opening": float("nan")}).attributes()


@pytest.mark.parametrize("count", [2, 3])
def test_few_instants_are_resampled_no_finer_than_they_are_known(uncontrolled, count):
    """Also of a run that begins later."""
    kept = np.linspace(0, len(uncontrolled.time) - 1, count).astype(int)
    arrays = {f.name: getattr(uncontrolled, f.name) for f in fields(uncontrolled)}
    run = replace(uncontrolled, **{name: v[..., kept] for name, v in arrays.items() if isinstance(v, np.ndarray)})
    run = replace(run, time=np.linspace(5.0, 9.0, count))
    mean = 4.0 / (count - 1)
    assert run.resample(mean).time.values == pytest.approx(run.time)
    assert run.resample(mean).slip.values == pytest.approx(run.slip)
    for wrong in (0.9 * mean, 4.1):
        with pytest.raises(ParameterError, match="dt must be between"):
            run.resample(wrong)


def test_one_instant_cannot_be_resampled(uncontrolled):
    """A fault that opens at once has no other."""
    for wrong in (0.0, 1.0):
        with pytest.raises(ParameterError, match="dt must be between 0 s"):
            replace(uncontrolled, time=np.array([0.0])).resample(wrong)


@pytest.fixture(scope="module")
def twice():
    """Two events of friction with a state and the beginning of a third: slip rates in straight lines, level 1 m/s."""
    law = friction_law("rate-and-state-aging")(
        reference_coefficient=0.6, direct_effect=0.01, evolution_effect=0.015, critical_slip=1e-5, reference_rate=1e-6,
        slowest_rate=1e-12, fastest_rate=10.0,
    )  # fmt: skip
    run = velocity_step(law, 1e9, [(1.0, 1e-6)], times=np.linspace(0, 1, 11))
    rate = np.array([0.0, 2.0, 0.5, 0.5, 3.0, 3.0, 0.0, 0.0, 0.0, 4.0, 4.0])
    slip = np.array([0.0, 1.0, 2.0, 2.5, 4.0, 7.0, 8.0, 8.0, 8.0, 10.0, 14.0])
    told = {"slip_rate": rate, "slip": slip, "time": np.arange(11.0), "onset_rate": 1.0}
    return replace(run, **told, onsets=np.array([0.5, 3.2, 8.25]))


def test_an_event_lasts_until_its_slip_rate_is_back(twice):
    """From 2 to 0.5 m/s within a second: back at 1 m/s after 2/3 of it; from 3 to 0: after 2/3 as well."""
    assert twice.arrests == pytest.approx([1 + 2 / 3, 5 + 2 / 3])
    assert twice.event_slips == pytest.approx([1 + 2 / 3 - 0.5, 7 + 2 / 3 - (2.5 + 0.2 * 1.5)])
    assert twice.recurrence_intervals == pytest.approx([2.7, 5.05])
    rate = np.array([0.0, 2.0, 1.0, 2.0, 0.0, 2.0, 1.0])  # at the level itself it is back
    again = replace(twice, slip_rate=rate, time=np.arange(7.0), onsets=np.array([0.5, 2.0, 4.5]))
    assert again.arrests == pytest.approx([2.0, 3.5, 6.0])
    assert replace(twice, onsets=np.array([1.0])).arrests == pytest.approx([1 + 2 / 3])  # one instant alone is above


def test_the_response_is_python_controls(run):
    response = run.response
    assert response.output_labels == ["slip", "slip_rate"]
    assert response.input_labels == ["p"]
    assert response.state_labels == ["slip", "slip_rate", "xi_1", "xi_2"]
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

    monkeypatch.setattr(os, "replace", full)
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


def test_its_text_shows_figures_not_arrays(run, twice, actuated):
    assert "Metrics" in repr(run)
    for each in (run, twice, actuated):
        assert "array" not in repr(each)
    of_a_law = {"name", "integral_units", "metrics", "events"}
    assert [shown_fields(each) for each in (run, actuated)] == [of_a_law, of_a_law]
    rates = {"onset_rate", "loading_rate"}
    assert shown_fields(twice) == {"name", "state_names", "state_units", "metrics", "events"} | rates


def shown_fields(run):
    text = repr(run).replace("Metrics(", "")
    return {field.name for field in fields(run) if re.search(rf"[(\s]{field.name}=", text)}


def test_a_file_follows_the_climate_and_forecast_conventions(run, uncontrolled, tmp_path):
    """Sections 2.5.1 (no fill value of a coordinate), 2.6 (Conventions, title, source, history), 3.1 and 3.2 (units,
    long_name), 4.4 (axis T is for dates); no attribute is an object."""
    for one in (run, uncontrolled):
        with xr.open_dataset(one.save(tmp_path / "run.nc"), engine="h5netcdf") as data:
            assert data.attrs["Conventions"].startswith("CF-1.")
            assert data.attrs["title"] == one.name
            assert data.attrs["source"].startswith("quakedesign")
            assert "axis" not in data.time.attrs
            assert not any("_FillValue" in variable.encoding for variable in data.variables.values())
            assert data.attrs["history"].startswith("simulated by quakedesign")
            assert np.all(np.diff(data.time) > 0)
            for name, variable in data.variables.items():
                assert {"units", "long_name"} <= set(variable.attrs), name
                assert variable.dims == ("time",)
                assert np.all(np.isfinite(variable))
            assert all(isinstance(value, str | int | float | np.number) for value in data.attrs.values())
            assert all(name.isidentifier() for name in (*data.variables, *data.attrs))


@pytest.fixture(scope="module")
def actuated():
    """Every step kept, so that extremes can be seen."""
    rock = Diffusion.of_time(0.05, storage=1e-9, cells=4)
    stages = Saturation(lowest=-2e4, highest=2e4), Lag(time_constant=5e-3), rock
    law = published("lab-fault")["cta"]
    actuator = Actuator(stages=stages)
    return simulate(
        LAB, law, scheme="explicit", actuator=actuator, substeps=2, duration=2.0, samples=2000, plant="printed"
    )


@pytest.mark.slow
def test_what_an_actuator_adds_is_in_every_export_with_its_unit(actuated, tmp_path):
    units = {"well_pressure": "Pa", "injected_volume": "m^3", "flow_rate": "m^3/s"}
    with xr.open_dataset(actuated.save(tmp_path / "run.nc"), engine="h5netcdf") as data:
        for name, unit in units.items():
            values = actuated.actuation[name][0]
            assert data[name].attrs["units"] == unit
            assert data[name].dims == ("time",)
            assert np.array_equal(data[name], values)
            assert np.array_equal(actuated.to_pandas()[f"{name} [{unit}]"], values)
            pint.UnitRegistry().parse_units(unit)
        assert "Saturation(lowest=-20000.0, highest=20000.0)" in data.attrs["actuator"]
        assert json.loads(data.attrs["metrics"])["max_injected_volume"] == actuated.metrics.max_injected_volume
    assert np.array_equal(actuated.response.inputs.ravel(), actuated.pressure)


def test_its_extremes_are_metrics_with_units(actuated):
    metrics = actuated.metrics
    for name in ("well_pressure", "injected_volume", "flow_rate"):
        values, _, unit = actuated.actuation[name]
        assert getattr(metrics, f"max_{name}") == values.max()
        assert getattr(metrics, f"min_{name}") == values.min()
        assert metrics.unit(f"max_{name}") == metrics.unit(f"min_{name}") == unit
    assert (metrics.max_well_pressure, metrics.min_well_pressure) == (2e4, -2e4)
    assert 0 < metrics.max_injected_volume <= 1e-9 * 2e4


def test_the_flow_rate_is_what_the_volume_grows_by(actuated):
    """Conservation of fluid; under a held pressure behind a lag the flow is smooth between samples."""
    volume, flow = (actuated.actuation[name][0] for name in ("injected_volume", "flow_rate"))
    gained = np.concatenate([[0.0], np.cumsum((flow[1:] + flow[:-1]) / 2 * np.diff(actuated.time))])
    assert np.max(np.abs(gained - volume)) < 0.02 * np.max(np.abs(volume))


def test_a_run_through_an_actuator_has_its_signals_beside_those_of_every_run(run, actuated):
    assert set(actuated.signals()) == {*run.signals(), *actuated.actuation} - {"xi_2"}  # its law has one state
    assert actuated.signals()["well_pressure"][1:] == ("pressure at the well", "Pa")


def test_the_well_is_drawn_in_the_panel_of_the_pressure(actuated):
    panels, well = actuated.panels(), actuated.actuation["well_pressure"][0]
    names = ["slip", "slip rate", "pressure", "slip error", "slip-rate error", "injected volume", "injected flow rate"]
    assert [panel[0] for panel in panels] == names
    assert panels[2][2] is actuated.pressure
    assert panels[2][3] == ("at the well", well)
    without = {name: signal for name, signal in actuated.actuation.items() if name != "well_pressure"}
    alone = replace(actuated, actuation=without).panels()
    assert [panel[0] for panel in alone] == names
    assert alone[2][3] == ("at the well", None)


def test_the_figure_shows_the_well_and_what_flows(actuated):
    axes = actuated.plot().axes
    assert [axis.get_ylabel() for axis in axes[5:]] == ["injected volume [m³]", "injected flow rate [m³/s]"]
    assert [line.get_label() for line in axes[2].lines] == ["at the well", "fault"]
    assert actuated.plot().get_suptitle() == actuated.name


def test_the_figure_of_a_decimated_run_says_so(run):
    assert run.plot().get_suptitle() == f"{run.name}\n100 of 2000 steps drawn"
    assert run.plot_stress().get_suptitle().endswith("100 of 2000 steps drawn")


def test_every_unit_can_be_read_by_a_library_of_units(run):
    """In the notation of UDUNITS; pint knows the same letters."""
    registry = pint.UnitRegistry()
    expected = {"moment_rate": "N*m/s", "shear_stress": "Pa", "matched_perturbation": "Pa * m^2/kg"}
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
    run = simulate(LAB.with_disturbance(Disturbance(constant=push)), duration=0.1, plant="stick-slip")
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
    assert isinstance(run, Trajectory)
    with xr.open_dataset(run.save(tmp_path / "state.nc"), engine="h5netcdf") as data:
        assert data.attrs["Conventions"].startswith("CF-1.")
        assert np.array_equal(data.theta, run.states[0])
        assert data.time.attrs["units"] == "s"


DAY, HOUR, MINUTE = 86400.0, 3600.0, 60.0


@pytest.mark.parametrize(
    ("end", "unit", "seconds"),
    [
        (2 * DAY, "d", DAY),
        (2 * DAY - 1, "h", HOUR),
        (2 * HOUR, "h", HOUR),
        (2 * HOUR - 1, "min", MINUTE),
        (2 * MINUTE, "min", MINUTE),
        (2 * MINUTE - 1, "s", 1.0),
        (1e-3, "s", 1.0),
    ],
)
def test_time_is_drawn_in_the_largest_unit_of_which_there_are_two(end, unit, seconds):
    time, values = np.array([0.0, end / 4, end]), np.array([1.0, 1.0, 2.0])
    (above, axis) = trajectory_module.figure("title", time, [("slip", "m", values, ("", None))] * 2).axes
    assert above.get_shared_x_axes().joined(above, axis)
    _, below = trajectory_module.stress_figure("title", time, values, values, 3 * values).axes
    for drawn in (axis, below):
        assert drawn.get_xlabel() == f"time [{unit}]"
        assert list(drawn.lines[0].get_xdata()) == [0, end / 4 / seconds, end / seconds]
    assert list(below.lines[0].get_ydata()) == [3, 3, 6]


@pytest.mark.parametrize(
    ("largest", "prefix", "size"),
    [
        (1e6, "M", 1e6),
        (-2e6, "M", 1e6),
        (999999.0, "k", 1e3),
        (1e3, "k", 1e3),
        (999.0, "", 1.0),
        (1.0, "", 1.0),
        (0.5, "m", 1e-3),
        (1e-3, "m", 1e-3),
        (9e-4, "µ", 1e-6),
        (1e-6, "µ", 1e-6),
        (9e-7, "n", 1e-9),
        (1e-12, "n", 1e-9),
        (0.0, "", 1.0),
    ],
)
def test_values_are_drawn_with_the_prefix_of_the_largest(largest, prefix, size):
    time, values = np.array([0.0, 1.0]), np.array([largest / 4, largest])
    panels = [("pressure", "Pa", values, ("", None)), ("flow", "m^3/s", values, ("", None))]
    drawing = trajectory_module.figure("title", time, panels)
    axis, power = drawing.axes
    assert (axis.get_ylabel(), power.get_ylabel()) == (f"pressure [{prefix}Pa]", "flow [m³/s]")  # no prefix of a power
    assert list(axis.lines[0].get_ydata()) == pytest.approx([largest / 4 / size, largest / size], abs=0)
    assert list(power.lines[0].get_ydata()) == [largest / 4, largest]
    assert axis.get_legend() is None
    assert (drawing.get_suptitle(), axis.get_xlabel()) == ("title", "")
    above, _ = trajectory_module.stress_figure("title", time, values, values, values).axes
    assert (above.get_xlabel(), above.get_ylabel()) == (f"slip [{prefix}m]", f"shear stress [{prefix}Pa]")
    assert list(above.lines[0].get_xdata()) == pytest.approx([largest / 4 / size, largest / size], abs=0)


@pytest.mark.parametrize("name", ["reference", "at the well"])
def test_a_second_curve_shares_the_prefix_and_is_named(name):
    """The reference lies below the fault's own curve, a pressure at the well above it."""
    time, own, other = np.array([0.0, 1.0]), np.array([1.0, -2.0]), np.array([500.0, -5000.0])
    (axis, _) = trajectory_module.figure("title", time, [("pressure", "Pa", own, (name, other))] * 2).axes
    beside, fault = axis.lines
    assert (beside.get_label(), beside.get_linestyle(), beside.get_color()) == (name, "--", "black")
    assert (fault.get_label(), fault.get_linestyle()) == ("fault", "-")
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [name, "fault"]
    assert axis.get_ylabel() == "pressure [kPa]"
    assert list(beside.get_ydata()) == [0.5, -5.0]
    assert list(fault.get_ydata()) == pytest.approx([1e-3, -2e-3])
    assert (fault.get_zorder() > beside.get_zorder()) is (name == "reference")
