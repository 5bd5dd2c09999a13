"""One run as the command line asks for it: gains, options, premises."""

from fractions import Fraction
from fractions import Fraction as F
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof
from quakedesign.laws import published
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.loop import Actuator, Lag, simulation_scheme
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.loop.sensing import Measurement
from quakedesign.simulation import Load, simulate
from quakedesign.studies import single_runs as single
from quakedesign.studies.single_runs import Choice, choice, run_single, sensor

LAB = load_fault("lab-fault")
USUAL = {"step": None, "scheme": "continuous", "method": "dormand-prince", "plant": None, "substeps": 1}
BASE = ("7", "5", "2.3", "1.1")


def told(law, **more):
    known = {"duration", "load", "noise", "actuator"}
    rest = {k: v for k, v in more.items() if k not in known}
    return run_single(LAB, law, progress=lambda _: None, **{k: more[k] for k in known & set(more)}, **(USUAL | rest))


def test_scale_and_feed_forward_are_exact():
    law = choice(LAB, "cta", BASE, scale="1/1000", feedforward="centred").controller
    assert law.scale == Fraction(1, 1000)
    assert law.feedforward == feed_forward("centred", LAB, law.divisor)
    assert choice(LAB, "cta", BASE).controller.feedforward.name == "none"


@pytest.mark.parametrize("more", [{"scale": "2"}, {"feedforward": "nominal"}])
def test_a_linear_law_has_neither_scale_nor_feed_forward(more):
    with pytest.raises(ParameterError, match="scale and feedforward are for sliding modes"):
        choice(LAB, "elqr", ("published",), **more)


def test_an_unknown_feed_forward_is_refused():
    with pytest.raises(UnknownNameError, match="centred"):
        choice(LAB, "cta", BASE, feedforward="magic")


def test_designed_gains_are_those_of_the_design(monkeypatch):
    from types import SimpleNamespace

    from quakedesign.studies import single_runs as single

    law = choice(LAB, "cta", BASE).controller
    for found in (law, None):
        design = SimpleNamespace(controller=found, certificate=None)
        monkeypatch.setattr(single, "design", lambda fault, name, design=design, **_: design)
        if found is None:
            with pytest.raises(ParameterError, match="no gains with a proof"):
                choice(LAB, "cta", ("designed",))
        else:
            assert choice(LAB, "cta", ("designed",)).controller is law


def test_without_a_law_a_duration_decides_what_is_run():
    natural, _ = told(None)
    own, premises = told(None, duration=0.02, load=Load(drift=1e-6))
    assert natural.metrics.peak_slip_rate > 0.05 > own.metrics.peak_slip_rate
    assert (own.provenance["drift"], premises) == (1e-6, [])


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"step": 1e-3}, "step"),
        ({"load": Load(drift=1.0)}, "load"),
        ({"noise": Measurement(slip_noise=1.0)}, "measurement"),
        ({"actuator": Actuator(stages=(Lag(time_constant=1.0),))}, "actuator"),
        ({"scheme": "explicit"}, "scheme"),
    ],
)
def test_the_natural_earthquake_takes_no_options(more, named):
    with pytest.raises(ParameterError, match=f"Received {named}"):
        told(None, **more)


@pytest.mark.slow
def test_a_differentiator_comes_with_its_premise():
    law = choice(LAB, "cta", ("published",)).controller
    found = {}
    for bound in (1.0, 1e4):
        run, premises = told(law, scheme="implicit", duration=0.2, noise=sensor(1e-3, Measurement(), bound))
        names = [p.name for p in premises]
        assert names == ["on_trajectory", "differentiator"]
        assert run.provenance["measurement"].startswith("OutputFeedback")
        found[bound] = premises[1]
    assert found[1e4].certified == 1e4
    assert not found[1.0].holds
    assert found[1e4].holds == (found[1e4].required <= 1e4)
    assert found[1e4].unit == "m/s^2"


def test_without_a_certificate_the_premise_on_the_run_says_so():
    _, (premise,) = told(choice(LAB, "cta", BASE).controller, duration=0.02)
    assert (premise.name, premise.certified, premise.ratio, premise.holds) == ("on_trajectory", 0, None, False)
    assert "no certificate was given, and no bound of these gains exceeds 1.2 m/s^3" in premise.note


def test_a_certified_bound_goes_with_the_scale(monkeypatch):
    """λ multiplies what is certified for λ = 1."""
    from quakedesign.studies import single_runs as single

    law = choice(LAB, "cta", BASE).controller
    monkeypatch.setattr(single, "design", lambda fault, name, **_: law)
    monkeypatch.setattr(single, "certified_bound", lambda design: Fraction(9, 10))
    monkeypatch.setattr(type(law), "controller", property(lambda self: self), raising=False)
    found = choice(LAB, "cta", ("designed",), scale="1/3", feedforward="nominal")
    assert (found.controller.scale, found.lipschitz) == (Fraction(1, 3), Fraction(3, 10))
    _, (premise,) = told(Choice(controller=law, lipschitz=Fraction(10**9)), duration=0.02)
    assert premise.holds
    assert premise.ratio == premise.required / 10**9


def test_the_bound_of_a_proved_design_is_that_of_its_certificate():
    from types import SimpleNamespace

    from quakedesign.lyapunov import Verdict
    from quakedesign.studies.certified import certified_bound

    law = choice(LAB, "cta", BASE).controller
    design = SimpleNamespace(controller=law, certificate=None, verdict=Verdict.PROVED)
    assert certified_bound(design) is None
    assert certified_bound(None) is None
    assert certified_bound(SimpleNamespace(controller=law, certificate="any", verdict=Verdict.UNDECIDED)) is None


@pytest.mark.slow
def test_a_scheme_is_tuned_as_its_guarantee_says():
    """Weight and B0 change the run as they do in a scheme that is set by hand."""
    law = published("lab-fault")["cta"]
    tuning, small = {"weight": 0.35, "authority": 0.0035}, {"duration": 0.5, "scheme": "compensated"}
    run, _ = run_single(LAB, law, progress=lambda _: None, tuning=tuning, **(USUAL | small))
    by_hand = simulate(LAB, law, duration=0.5, scheme=simulation_scheme("compensated", **tuning))
    assert run.pressure.tolist() == by_hand.pressure.tolist()
    plain, _ = run_single(LAB, law, progress=lambda _: None, **(USUAL | small))
    assert run.pressure.tolist() != plain.pressure.tolist()
    for scheme in ("explicit", "continuous"):
        with pytest.raises(ParameterError, match="weight is a setting of compensated"):
            run_single(LAB, law, progress=lambda _: None, tuning={"weight": 0.35}, **(USUAL | {"scheme": scheme}))
    with pytest.raises(ParameterError, match="Received weight"):
        run_single(LAB, None, progress=lambda _: None, tuning={"weight": 0.35}, **USUAL)


def designs_in_place_of_searches(monkeypatch, found):
    """What is asked of searches, which answer at once."""
    asked = []

    def answered(fault, name, setup=LoopSetup(), continuous=False):  # noqa: B008
        asked.append((fault.sampling_time, name, setup))
        return found

    monkeypatch.setattr(single, "guarantee", answered)
    monkeypatch.setattr(single, "design", answered)
    return asked


def test_a_design_is_for_what_stands_around_it_in_the_run(monkeypatch):
    law = single.Controller
    proved = SimpleNamespace(proved=True, controller=law)
    asked = designs_in_place_of_searches(monkeypatch, proved)
    assert choice(LAB, "elqr", ("designed",), path={"lag": 0.02, "delay": 0.05}, step=0.025).controller is law
    assert asked == [(0.025, "elqr", LoopSetup(lag=F(1, 50), delay=F(1, 20)))]
    with pytest.raises(ParameterError, match="delay must be 0 to 100 sampling periods"):
        choice(LAB, "elqr", ("designed",), path={"delay": 3.0}, step=0.025)
    assert len(asked) == 1
    limited = SimpleNamespace(proved=True, controller="limited")
    designs_in_place_of_searches(monkeypatch, limited)
    assert single._designed_for_path(LAB, "cta", {"lag": 0.02}) == "limited"


def test_a_design_without_a_proof_behind_its_path_is_refused_with_the_reason(monkeypatch):
    sooner = SimpleNamespace(sampled_loop=SimpleNamespace(step=F(1, 200)))
    for shorter, said in ((sooner, "Give --step '0.005 s'"), (None, "Give gains as numbers")):
        none = SimpleNamespace(proved=False, proof=NoProof(reason="nothing holds"), shorter=shorter)
        designs_in_place_of_searches(monkeypatch, none)
        with pytest.raises(ParameterError, match=f"elqr with lag 0.02 s, T_s = 0.001 s: nothing holds. {said}"):
            choice(LAB, "elqr", ("designed",), path={"lag": 0.02})


def test_a_design_is_for_the_step_of_the_command(monkeypatch):
    law = Mock(sampling=None, divisor=None)
    found = SimpleNamespace(controller=law, certificate=None, details={})
    asked = designs_in_place_of_searches(monkeypatch, found)
    monkeypatch.setattr(single, "certified_bound", lambda designed: None)
    for gains, step in ((("designed",), 0.04), (("designed",), None), (("continuous",), 0.04)):
        assert choice(LAB, "elqr", gains, step=step).controller is law
    assert [time for time, *_ in asked] == [0.04, LAB.sampling_time, LAB.sampling_time]
