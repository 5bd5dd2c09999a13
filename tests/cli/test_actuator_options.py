"""Actuators as the command line makes them."""

import dataclasses
import json
import re
import subprocess
import sys

import pytest

from quakedesign.cli.options import ActuatorOptions
from quakedesign.errors import ParameterError
from quakedesign.loop import Delay, Diffusion, Lag, Quantisation, RateLimit, Saturation, stages


def actuator(step, **options):
    return ActuatorOptions(**options).build(step)


def test_nothing_asked_for_is_no_stage():
    assert actuator(0.1).stages == ()


def test_every_stage_of_the_package_can_be_asked_for_in_the_order_of_the_signal():
    found = actuator(
        0.1,
        delay=0.3,
        quantum=1e3,
        saturation=2e7,
        rate_limit=1e6,
        lag=1.0,
        diffusion=60.0,
        storage=1e-4,
        cells=8,
    ).stages
    assert {stage.name for stage in found} == set(stages())
    assert found[:5] == (
        Delay(samples=3),
        Quantisation(quantum=1e3),
        Saturation(lowest=-2e7, highest=2e7),
        RateLimit(rate=1e6),
        Lag(time_constant=1.0),
    )
    assert isinstance(found[5], Diffusion)
    assert found[5].time == pytest.approx(60.0, rel=1e-15)
    assert (found[5].storage, found[5].cells) == (1e-4, 8)


def test_a_pump_that_only_injects():
    assert actuator(0.1, saturation=2e7, withdrawal=0.0).stages == (Saturation(lowest=0.0, highest=2e7),)


def test_rock_of_unknown_storage_has_no_volume():
    assert not actuator(0.1, diffusion=60.0).stores
    assert actuator(0.1, diffusion=60.0, storage=1e-4).stores


@pytest.mark.parametrize("delay", [-0.1, 10.1, float("nan"), float("inf"), 1e300])
def test_a_delay_that_cannot_be_run_is_refused(delay):
    with pytest.raises(ParameterError, match=r"0 to 100 sampling periods of 0\.1 s"):
        actuator(0.1, delay=delay)


@pytest.mark.parametrize(("delay", "samples", "part"), [(0.05, 0, 0.5), (0.125, 1, 0.25), (0.3, 3, 0), (0.7, 7, 0)])
def test_a_delay_is_periods_and_a_part_of_one(delay, samples, part):
    (stage,) = actuator(0.1, delay=delay).stages
    assert stage.samples == samples
    assert stage.part == pytest.approx(part, abs=1e-12)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"storage": 1.0}, "storage needs diffusion"),
        ({"withdrawal": 1.0}, "withdrawal needs saturation"),
        ({"saturation": -1.0}, "lowest and highest"),
        ({"quantum": 0.0}, "quantum"),
        ({"diffusion": 0.0}, "time"),
        ({"diffusion": 1.0, "storage": -1.0}, "storage"),
        ({"delay": 100.0}, "0 to 100"),
    ],
)
def test_what_a_stage_refuses_is_refused(more, said):
    with pytest.raises(ParameterError, match=said):
        actuator(0.1, **more)


OPTIONS = [option for stage in stages().values() for option in stage.options]


def test_every_stage_of_the_package_has_options_that_no_other_has():
    assert all(stage.options for stage in stages().values())
    assert [field.name for field in dataclasses.fields(ActuatorOptions)] == [option.name for option in OPTIONS]
    assert len({option.name for option in OPTIONS}) == len(OPTIONS)


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
def test_an_option_says_in_a_sentence_what_it_is(option):
    assert option.name.isidentifier()
    assert re.fullmatch(r"[A-Z].*\.", option.help)


@pytest.mark.parametrize("name", stages())
def test_a_stage_is_made_of_its_own_options_alone(name):
    stage = stages()[name]
    (found,) = actuator(1.0, **{stage.options[0].name: 2.0}).stages
    assert type(found) is stage


LEAK = '''
"""A well that leaks."""

from dataclasses import dataclass
from typing import ClassVar

from quakedesign.loop.actuators.base import Option, SampledStage


@dataclass(frozen=True, kw_only=True)
class Leak(SampledStage):
    """Takes a pressure away."""

    name: ClassVar[str] = "leak"
    place: ClassVar[int] = 0
    options: ClassVar[tuple[Option, ...]] = (Option(name="leak", unit="Pa", help="What is lost."),)

    leak: float

    @property
    def numbers(self):
        """What is lost [Pa]."""
        return (self.leak,)

    def apply(self, numbers, memory, pressure, step):
        """What is left."""
        return pressure - numbers[0], memory
'''


@pytest.mark.slow
def test_an_actuator_is_one_file_its_option_included(tmp_path):
    """Beside the others, with nothing else changed: told by the help, read in units, put in its place and run."""
    (tmp_path / "leak.py").write_text(LEAK)
    run = ("simulate", "lab-fault", "--controller", "cta", "--duration", "20 ms", "--scheme", "explicit")
    for arguments, said in (
        (("simulate", "--help"), r"--leak FLOAT +What is lost\."),
        ((*run, "--leak", "2 kPa", "--delay", "2 ms", "--json"), r"Leak\(leak=2000\.0\), Delay\(samples=2"),
    ):
        lines = (
            "import quakedesign.loop.actuators as folder",
            f"folder.__path__.append({str(tmp_path)!r})",
            "from quakedesign.cli import main",
            f"main({json.dumps(arguments)})",
        )
        done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert re.search(said, done.stdout)
