"""Disturbance and start of a sample are what they are called."""

from dataclasses import asdict, replace
from fractions import Fraction
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop
from quakedesign.laws import published, summed_integrals
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation import Load, Variation, simulate
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign.problem import SteppedProblem
from quakedesign.simulation.campaign.space import Sample

LAB = load_fault("lab-fault", box="ten-percent")
LAW = published("lab-fault")["elqr"]


def test_amplitude_and_phase_are_those_of_a_perturbation_written_out():
    share, phase, own = 0.4, 2.5, LAB.disturbance
    wave = sp.Float(share * own.amplitude) * sp.sin(own.frequency * sp.Symbol("time") + sp.Float(phase))
    calm = LAB.with_disturbance(replace(own, amplitude=0.0))
    written = simulate(calm, LAW, duration=0.2, load=Load(perturbation=wave), variation=Variation())
    varied = simulate(LAB, LAW, duration=0.2, variation=Variation(amplitude=share, phase=phase))
    assert np.allclose(varied.slip, written.slip, rtol=1e-8, atol=1e-12 * np.max(np.abs(written.slip)))
    assert varied.energy.disturbance == pytest.approx(written.energy.disturbance, rel=1e-7)
    assert varied.provenance["variation_phase"] == phase


@pytest.mark.parametrize("wrong", [{"amplitude": 1.1}, {"phase": -0.1}, {"phase": 6.3}])
def test_a_disturbance_outside_the_class_is_refused(wrong):
    with pytest.raises(ParameterError, match=f"{next(iter(wrong))} of a variation must be 0 to"):
        simulate(LAB, LAW, duration=0.01, variation=Variation(**wrong))


def test_a_start_away_from_rest_keeps_the_energy_budget():
    problem = campaign_problem(LAB, LAW, step=2.5e-5, duration=0.05, load=Load(drift=1e-3))
    sample = Sample(numbers=asdict(Variation()) | {"initial_slip": 2e-4, "initial_slip_rate": 0.03}, noise_seed=0)
    run = problem.trajectory(sample, 50)
    assert (run.slip[0], run.slip_rate[0], run.provenance["drift"]) == (2e-4, 0.03, 1e-3)
    kinetic = LAB.mass * (run.slip_rate[-1] ** 2 - 0.03**2) / 2
    assert run.energy.kinetic == pytest.approx(kinetic)
    assert run.energy.relative_residual < 1e-7


def test_divergence_is_that_of_the_sampled_linear_loop():
    """Without weakening the loop is linear; it diverges if the spectral radius under zero-order hold exceeds one."""
    problem = campaign_problem(LAB, LAW, duration=4.0, initial_slip=1e-4, plant="printed")
    ranges = problem.space.ranges | {"weakening": (0.0, 0.0)}
    problem = replace(problem, space=replace(problem.space, ranges=MappingProxyType(ranges)))
    samples = [problem.sample(i) for i in range(32)]
    ends = problem.program.ends([problem.start(s) for s in samples], problem.setting.steps)
    radii = np.array([spectral_radius(sample.numbers) for sample in samples])
    found = np.array([result.diverged for result in problem.results(ends)])
    clear = (radii < 1) | (radii > 1.012)  # 1.012^4000 is 5e20
    assert min(sum(found[clear]), sum(~found[clear])) > 3
    assert np.array_equal(found[clear], radii[clear] > 1)


def spectral_radius(numbers):
    k, eta = numbers["stiffness"] * LAB.specific_stiffness, numbers["damping"] * LAB.specific_damping
    gain = LAB.friction.residual * LAB.authority * numbers["authority"]
    field = np.array([[0, 1, 0], [LAB.disturbance.slip_growth - k, -eta, gain], [0, 0, 0]])
    step, (k1, k2, k3, k4) = LAB.sampling_time, (float(v) for v in LAW.gains.values())
    held = expm(field * step)
    feedback = -np.array([[k1, k2, k3, k4]])
    plant = np.hstack([held[:2, :2], np.zeros((2, 2))]) + held[:2, 2:] @ feedback
    integrals = np.array([[step, 0, 1, 0], [0, 0, step, 1]])
    return max(abs(np.linalg.eigvals(np.vstack([plant, integrals]))))


@pytest.mark.parametrize(
    "wrong",
    [{"plant": "nonsense"}, {"method": "nonsense"}, {"settled_from": 1e300}, {"settled_from": np.nan}],
    ids=str,
)
def test_a_problem_is_refused_before_it_runs(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        campaign_problem(LAB, LAW, **wrong)


def test_an_index_that_is_none():
    problem = campaign_problem(LAB, LAW)
    for index in (-1, 1.0, True, 2**20, 10**30):
        for asked in (problem.sample, problem.point):
            with pytest.raises(ParameterError, match=r"^index .*must be a whole number"):
                asked(index)


def test_what_a_campaign_cannot_do_is_refused():
    with pytest.raises(ParameterError, match="method must be one of"):
        campaign_problem(LAB, LAW, method="cvodes")
    with pytest.raises(ParameterError, match="seed"):
        campaign_problem(LAB, LAW, seed=-1)


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_many_starts_at_once_are_those_of_each(noise, monkeypatch):
    scheme = simulation_scheme("explicit", measurement=Measurement(slip_noise=noise))
    problem = campaign_problem(LAB, LAW, scheme=scheme, initial_slip=1e-4, initial_slip_rate=1e-3, plant="stick-slip")
    samples = [problem.sample(i) for i in range(5)]
    assert np.array_equal(problem.starts(samples), [problem.start(sample) for sample in samples])
    assert len({start.tobytes() for start in problem.starts(samples)}) == 5
    seeds = [replace(samples[0], noise_seed=seed) for seed in range(3)]
    assert len({start.tobytes() for start in problem.starts(seeds)}) == (3 if noise else 1)
    built, start = [], SteppedProblem.start
    monkeypatch.setattr(SteppedProblem, "start", lambda self, sample: built.append(1) or start(self, sample))
    problem.starts([problem.sample(i) for i in range(40)])
    assert len(built) == (40 if noise else 1)
    assert problem.starts([]).size == 0


def test_how_many_instants_are_kept_does_not_tell_campaigns_apart(monkeypatch):
    """They are resumed where what determines their digits is the same: the duration does, instants do not."""
    monkeypatch.setattr(SteppedProblem, "program", SimpleNamespace(fingerprint="of one step"))
    problem = campaign_problem(LAB, LAW, duration=0.1)
    assert replace(problem, setting=replace(problem.setting, samples=7)).inputs == problem.inputs
    longer = campaign_problem(LAB, LAW, duration=0.2)
    assert longer.inputs["setting"] != problem.inputs["setting"]
    assert {k: v for k, v in longer.inputs.items() if k != "setting"} == {
        k: v for k, v in problem.inputs.items() if k != "setting"
    }


def test_a_scheme_that_is_given_keeps_its_own_path():
    """By name it gets the rock that a sampled law is designed for; no seed is seed 0."""
    fault, step = load_fault("real-fault"), Fraction("0.184")
    law = summed_integrals((Fraction(10**9),) * 4, step)
    controller = SampledLoop(law=law, step=step, diffusion=Fraction(2)).controller
    given = simulation_scheme("explicit")
    assert campaign_problem(fault, controller, scheme=given, duration=1.0).scheme is given
    named = campaign_problem(fault, controller, duration=1.0)
    assert [stage.name for stage in named.scheme.actuator.stages] == ["diffusion"]
    assert (named.seed, campaign_problem(fault, controller, duration=1.0, seed=3).seed) == (0, 3)
