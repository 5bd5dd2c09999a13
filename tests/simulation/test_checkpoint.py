"""A run that is interrupted, at any moment and by any means, ends as if it had not been."""

from dataclasses import replace

import numpy as np
import pytest
from thinned import few

from quakedesign.errors import SimulationError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop import Actuator, Delay, Diffusion, Lag, Quantisation, RateLimit, Saturation
from quakedesign.loop.sensing import Averaging, Differentiator, OutputFeedback, Transducer
from quakedesign.simulation import simulate
from quakedesign.simulation import stepping as checkpoint

REAL = load_fault("real-fault")
SETTING = {"duration": 4000.0, "samples": 300, "compiled": False}


def same(one, other):
    assert list(one.signals()) == list(other.signals())
    for name, (values, _, _) in one.signals().items():
        assert np.array_equal(values, other.signals()[name][0]), name
    assert replace(one.metrics, seconds=0.0) == replace(other.metrics, seconds=0.0)
    assert one.events == other.events
    assert one.energy == other.energy


@few("plant", ["printed", "stick-slip"], every=2)
def test_a_run_interrupted_thrice_ends_with_the_same_digits(tmp_path, plant):
    law = published("real-fault")["cta"]
    whole = simulate(REAL, law, plant=plant, **SETTING)
    path = tmp_path / "run.checkpoint"
    for stop in (0.2, 0.21, 0.7):

        def interrupt(done, stop=stop):
            if done >= stop:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            simulate(REAL, law, plant=plant, progress=interrupt, checkpoint=path, **SETTING)
        assert [file.name for file in tmp_path.iterdir()] == ["run.checkpoint"]
    said = []
    resumed = simulate(REAL, law, plant=plant, progress=said.append, checkpoint=path, **SETTING)
    assert said[0] > 0.69
    same(whole, resumed)
    assert not path.exists()


def test_memories_of_actuator_and_sensors_go_on_too(tmp_path):
    """Queue of a delay, pump, cells of the rock, noise generator, readings of the mean and differentiator."""
    stages = (
        Delay(samples=3),
        Quantisation(quantum=10.0),
        Saturation(lowest=0.0, highest=2e7),
        RateLimit(rate=1e6),
        Lag(time_constant=1.0),
        Diffusion.of_time(2.0, storage=1e-4, cells=4),
    )
    sensor = OutputFeedback(
        stages=(Transducer(deviation=1e-7, bandwidth=2.0, seed=5), Averaging(samples=3)),
        differentiator=Differentiator(bound=1.0, step=REAL.sampling_time, filter_order=1),
    )
    around = {"actuator": Actuator(stages=stages), "measurement": sensor, "scheme": "compensated", "substeps": 4}
    law, path = published("real-fault")["cta"], tmp_path / "run.checkpoint"
    setting = SETTING | {"duration": 400.0}
    whole = simulate(REAL, law, **setting, **around)
    for stop in (0.013, 0.5):

        def interrupt(done, stop=stop):
            if done >= stop:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            simulate(REAL, law, progress=interrupt, checkpoint=path, **setting, **around)
    said = []
    resumed = simulate(REAL, law, progress=said.append, checkpoint=path, **setting, **around)
    assert said[0] > 0.5
    same(whole, resumed)
    assert whole.metrics.max_flow_rate > 0
    other = around | {"measurement": replace(sensor, stages=(Transducer(deviation=1e-7, bandwidth=2.0, seed=6),))}
    assert not np.array_equal(simulate(REAL, law, **setting, **other).slip, whole.slip)


@pytest.mark.slow
def test_a_killed_run_goes_on(start, tmp_path):
    """SIGKILL in the middle of writing again and again."""
    path = tmp_path / "run.checkpoint"
    program = (
        "from quakedesign.laws import published\nfrom quakedesign.fault import load_fault\n"
        "from quakedesign.simulation import simulate\n"
        "from quakedesign.simulation import stepping\nstepping.SECONDS = 0.0\n"
        "done = lambda share: print(share, flush=True)\n"
        "simulate(load_fault('real-fault'), published('real-fault')['cta'], duration=4000.0, samples=300,"
        f" compiled=False, progress=done, checkpoint={str(path)!r})\n"
    )
    running = start("-c", program)
    while float(running.stdout.readline()) < 0.3:
        pass
    running.kill()
    running.communicate()
    law = published("real-fault")["cta"]
    said = []
    resumed = simulate(REAL, law, checkpoint=path, progress=said.append, **SETTING)
    assert said[0] > 0.29
    same(simulate(REAL, law, **SETTING), resumed)


def test_it_is_written_now_and_then(tmp_path, monkeypatch):
    path, seen = tmp_path / "run.checkpoint", []
    monkeypatch.setattr(checkpoint, "SECONDS", 0.0)
    simulate(REAL, duration=50.0, samples=10, progress=lambda _: seen.append(path.exists()), checkpoint=path)
    assert seen[1:] == [True] * 9
    monkeypatch.setattr(checkpoint, "SECONDS", 1e9)
    seen.clear()
    simulate(REAL, duration=50.0, samples=10, progress=lambda _: seen.append(path.exists()), checkpoint=path)
    assert not any(seen)


@pytest.mark.parametrize("change", [{"duration": 3999.0}, {"samples": 150}, {"settled_from": 5.0}, {"method": "rk4"}])
def test_the_checkpoint_of_another_run_is_refused(tmp_path, change):
    path = tmp_path / "run.checkpoint"

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(REAL, published("real-fault")["elqr"], progress=stop, checkpoint=path, **SETTING)
    before = path.read_bytes()
    with pytest.raises(SimulationError, match=r"does not belong to this run"):
        simulate(REAL, published("real-fault")["elqr"], checkpoint=path, **(SETTING | change))
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04broken"])
def test_a_file_of_another_kind_is_refused_and_kept(tmp_path, content):
    path = tmp_path / "thesis.txt"
    path.write_bytes(content)
    with pytest.raises(SimulationError, match="or is not a checkpoint"):
        simulate(REAL, duration=10.0, checkpoint=path)
    assert path.read_bytes() == content
