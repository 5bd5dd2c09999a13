"""Controllers as model units of FMI 2.0: FMPy reads, checks and runs them, and the digits are those of the step."""

import platform
import xml.etree.ElementTree as ET
import zipfile

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave, fmi2FMUstate
from fmpy.validation import validate_fmu

from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop import simulation_scheme
from quakedesign.loop.actuators.chain import Actuator
from quakedesign.loop.actuators.pump_limits import Saturation
from quakedesign.loop.sensing import Differentiator, OutputFeedback
from quakedesign.simulation import export, simulate
from quakedesign.simulation.export import controller_step, export_controller

LAB = load_fault("lab-fault")
STEP = 1e-3
CTA = published("lab-fault")["cta"]
SENSED = OutputFeedback(differentiator=Differentiator(bound=100.0, step=STEP))
WAYS = {"slip and rate": simulation_scheme("explicit"), "slip": simulation_scheme("explicit", measurement=SENSED)}


@pytest.fixture(scope="module", params=WAYS)
def unit(request, tmp_path_factory):
    """File, and the step that it must repeat."""
    folder = tmp_path_factory.mktemp("fmu") / "c"
    found = export_controller(LAB, CTA, folder, step=STEP, scheme=WAYS[request.param], fmu=True)
    return folder / "controller.fmu", found


def signals(found, times):
    columns = {"slip": 1e-3 * np.sin(7 * times), "slip_rate": 7e-3 * np.cos(7 * times)}
    return np.array([columns[name] for name in found.measurement]).T


def pressures(found, measured):
    """Pressures that the step in Python asks for at every sample [Pa]."""
    memory, asked = list(found.start.values()), []
    for row in measured:
        memory, pressure = found.function(row, asked[-1] if asked else 0.0, memory)
        asked.append(float(pressure))
    return asked


def run(path, found, starts, ends, measured):
    """Pressure after every communication step [Pa]."""
    slave, asked = loaded(path), []
    names = list(range(len(found.measurement)))
    for start, end, row in zip(starts, ends, measured, strict=True):
        slave.setReal(names, row)
        slave.doStep(start, end - start)
        asked.append(slave.getReal([len(names)])[0])
    slave.terminate()
    slave.freeInstance()
    return asked


def loaded(path, start=0.0, before=()):
    description = fmpy.read_model_description(path)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path, path.parent / "extracted"),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    slave.instantiate()
    slave.setupExperiment(startTime=start)
    slave.enterInitializationMode()
    for name, value in before:  # start values, as importers set them
        slave.setReal([name], [value])
    slave.exitInitializationMode()
    return slave


def test_the_description_follows_the_standard_and_names_units(unit):
    path, found = unit
    assert validate_fmu(str(path)) == []
    told = fmpy.read_model_description(path)
    assert {v.name: (v.causality, v.unit) for v in told.modelVariables} == {
        **{name: ("input", measured) for name, measured in found.measurement.items()},
        "pressure": ("output", "Pa"),
        "applied": ("input", "Pa"),
    }
    assert float(told.defaultExperiment.stepSize) == STEP
    assert "lab-fault" in told.description
    with zipfile.ZipFile(path) as archive:
        text = archive.read("modelDescription.xml").decode()
    assert text.startswith("<?xml version=")
    assert [entry.get("name") for entry in ET.fromstring(text).find("LogCategories")] == ["logStatusError"]
    assert fmpy.supported_platforms(path) == ["c-code", found.facts["fmu"]]


def test_fmpy_gets_the_pressures_of_the_step_in_python(unit):
    path, found = unit
    times = STEP * np.arange(201)
    rows = np.rec.fromarrays([times, *signals(found, times).T], names=["time", *found.measurement])
    told = fmpy.simulate_fmu(
        str(path), stop_time=0.2, step_size=STEP, output_interval=STEP, input=rows, output=["pressure"]
    )
    assert told["pressure"][0] == 0.0
    expected = pressures(found, signals(found, told["time"][:-1]))
    assert told["pressure"][1:] == pytest.approx(expected, rel=1e-9)
    assert len(set(expected)) > 150


@pytest.mark.parametrize(("of_a_period", "count"), [(1, 100), (4, 400), (0.5, 50)])
def test_samples_lie_a_period_apart_whatever_the_communication_steps(unit, of_a_period, count):
    path, found = unit
    ends = STEP * np.arange(1, count + 1) / of_a_period
    starts = np.concatenate([[0.0], ends[:-1]])
    measured = signals(found, starts)
    period = int(max(of_a_period, 1))
    sampled = [row for row in measured[::period] for _ in range(int(max(1, 1 / of_a_period)))]
    expected = pressures(found, sampled)[int(max(1, 1 / of_a_period)) - 1 :: int(max(1, 1 / of_a_period))]
    assert run(path, found, starts, ends, measured)[period - 1 :: period] == expected
    held = np.array(run(path, found, starts, ends, measured)).reshape(-1, period)
    assert (held == held[:, :1]).all()


@pytest.mark.parametrize("name", ["cta", "elqr"])
def test_behind_a_pump_that_tells_what_it_applied_it_asks_for_what_simulate_does(name, tmp_path):
    """Of slip and slip rate as simulated; without being told, the law winds up and asks for something else."""
    law = published("lab-fault")[name]
    around = {"step": STEP, "method": "rk4", "duration": 0.2, "samples": 200, "compiled": False}
    most = float(np.abs(simulate(LAB, law, scheme="explicit", **around, plant="printed").pressure).max()) / 4
    pump = simulation_scheme("explicit", actuator=Actuator(stages=(Saturation(lowest=-most, highest=most),)))
    seen = simulate(LAB, law, scheme=pump, **around, plant="printed")
    found = export_controller(LAB, law, tmp_path / "c", step=STEP, fmu=True)
    measured = {"slip": seen.slip, "slip_rate": seen.slip_rate}
    rows = np.array([measured[signal] for signal in found.measurement]).T
    told, untold = (pumped(tmp_path / "c" / "controller.fmu", rows, most, told) for told in (True, False))
    assert np.sum(np.abs(told) == most) > 3
    assert seen.pressure == pytest.approx(told, rel=1e-9, abs=1e-9 * most)
    assert not np.allclose(untold, seen.pressure, atol=1e-6 * most) or name == "cta"


def pumped(path, rows, most, told):
    """What a pump applies of the pressure of a unit at every sample, and says if it is told."""
    names = list(range(rows.shape[1]))
    slave, applied = loaded(path, before=[(len(names) + 1, 9.0)]), []
    for i, row in enumerate(rows):
        slave.setReal(names, row)
        if told and applied:
            slave.setReal([len(names) + 1], applied[-1:])
        slave.doStep(i * STEP, STEP)
        applied.append(float(np.clip(slave.getReal([len(names)])[0], -most, most)))
    slave.freeInstance()
    return applied


def test_a_state_can_be_kept_and_set(unit):
    path, found = unit
    slave, names = loaded(path, 5.0), list(range(len(found.measurement)))
    slave.setReal(names, [1e-3] * len(names))
    slave.doStep(5.0, STEP)
    kept = slave.getFMUstate()
    slave.doStep(5.0 + STEP, STEP)
    after = slave.getReal([len(names)])
    slave.setFMUstate(kept)
    slave.doStep(5.0 + STEP, STEP)
    assert slave.getReal([len(names)]) == after
    assert isinstance(kept, fmi2FMUstate)
    slave.freeFMUstate(kept)
    slave.freeInstance()


@pytest.mark.parametrize("wrong", ["gap", "back", "measurement", "variable", "no variable", "pressure", "applied"])
def test_what_cannot_be_is_an_error_of_the_standard(unit, wrong):
    path, found = unit
    slave, names = loaded(path), list(range(len(found.measurement)))
    calls = {
        "gap": lambda: slave.doStep(STEP, STEP),
        "back": lambda: slave.doStep(0.0, -STEP),
        "measurement": lambda: (slave.setReal(names, [np.nan] * len(names)), slave.doStep(0.0, STEP)),
        "variable": lambda: slave.getReal([len(names) + 2]),
        "no variable": lambda: slave.setReal([len(names) + 2], [0.0]),
        "applied": lambda: (slave.setReal([len(names) + 1], [np.nan]), slave.doStep(0.0, STEP)),
        "pressure": lambda: slave.setReal([len(names)], [1.0]),
    }
    with pytest.raises(fmpy.fmi1.FMICallException, match="status 3"):
        calls[wrong]()
    slave.freeInstance()


@pytest.mark.slow
def test_the_same_controller_gives_the_same_bytes_and_another_one_another_name(tmp_path):
    files = {}
    for name, controller in {"one": CTA, "two": CTA, "other": published("lab-fault")["elqr"]}.items():
        export_controller(LAB, controller, tmp_path / name, fmu=True)
        files[name] = tmp_path / name / "controller.fmu"
    assert files["one"].read_bytes() == files["two"].read_bytes()
    guids = {fmpy.read_model_description(files[name]).guid for name in ("one", "other")}
    assert len(guids) == 2


def test_without_a_compiler_the_sources_lie_inside(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    found = export_controller(LAB, CTA, tmp_path / "c", fmu=True)
    assert found.facts["fmu"].startswith("sources only: no C compiler")
    with zipfile.ZipFile(tmp_path / "c" / "controller.fmu") as archive:
        assert not [name for name in archive.namelist() if name.startswith("binaries")]
    assert fmpy.supported_platforms(tmp_path / "c" / "controller.fmu") == ["c-code"]


@pytest.mark.parametrize(
    ("system", "machine"), [("Linux", "aarch64"), ("Darwin", "arm64"), ("Windows", "AMD64"), ("Plan9", "mips")]
)
def test_a_platform_that_is_not_built_here_gets_the_sources(monkeypatch, system, machine):
    monkeypatch.setattr(platform, "system", lambda: system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(export, "shared_library", lambda *_: pytest.fail("compiled"))
    assert export._binary({}) == ({}, "sources only: no binary of FMI 2.0 is built for this platform")


@pytest.mark.parametrize(
    ("system", "machine", "place"),
    [("Linux", "x86_64", "linux64/controller.so"), ("Darwin", "AMD64", "darwin64/controller.dylib")],
)
def test_a_binary_has_the_name_of_its_platform(monkeypatch, tmp_path, system, machine, place):
    (tmp_path / "built").write_bytes(b"library")
    monkeypatch.setattr(platform, "system", lambda: system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(export, "shared_library", lambda *_: tmp_path / "built")
    assert export._binary({}) == ({f"binaries/{place}": b"library"}, place.partition("/")[0])


def test_no_unit_is_written_unless_asked_for(tmp_path):
    found = export_controller(LAB, CTA, tmp_path / "c")
    assert not (tmp_path / "c" / "controller.fmu").exists()
    assert found.facts == controller_step(LAB, CTA).facts
