"""Noises get other seeds, each its own, and nothing else changes."""

from dataclasses import dataclass

from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing import Transducer
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation.campaign.problem import reseeded


@dataclass(frozen=True)
class Pair:
    stages: tuple
    seed: int = 0


@dataclass(frozen=True)
class Seedless:
    stages: tuple


def test_a_measurement_within_a_scheme_gets_the_seed():
    scheme = simulation_scheme("implicit", measurement=Measurement(slip_noise=1e-6), substeps=3)
    one, other = reseeded(scheme, 1), reseeded(scheme, 2)
    assert one.measurement.seed != other.measurement.seed
    assert (one.measurement.slip_noise, one.substeps) == (1e-6, 3)
    assert reseeded(scheme, 1) == one


def test_two_noises_stay_independent():
    found = reseeded(Pair(stages=(Transducer(deviation=1e-6), Transducer(deviation=1e-6))), 7)
    assert len({found.seed, *(stage.seed for stage in found.stages)}) == 3


def test_what_has_no_seed_stays():
    scheme = simulation_scheme("continuous")
    assert reseeded(scheme, 3) is scheme
    pair, plain = Pair(stages=(1, "two")), Seedless(stages=(1, Seedless(stages=())))
    assert reseeded(pair, 3).stages is pair.stages
    assert reseeded(plain, 3) is plain
