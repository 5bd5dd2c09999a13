"""The default 2-CTA and 2-DIA: laws of samples that run exactly as they are guaranteed, everywhere."""

import pickle
from dataclasses import fields, replace
from fractions import Fraction as F
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.cli.design_commands import positive
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, TrackingProof, design_compensated
from quakedesign.laws import Sampling
from quakedesign.loop import simulation_scheme
from quakedesign.lyapunov import Verdict, load_certificate
from quakedesign.plant import uncertain_plant
from quakedesign.simulation import controller_step, simulate, to_casadi, to_iosystem
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.studies.comparison import Entry
from quakedesign.studies.single_runs import choice
from quakedesign.synthesis import assess

pytestmark = pytest.mark.slow  # tests/laws/test_rest_limit.py designs one by default
REAL = load_fault("real-fault")
DATA = Path(__file__).parents[2] / "data"
SLOW = load_fault(DATA / "undersampled_fault.toml")
STEP = F("0.184")
DESIGN, COMPENSATED = map(
    import_module, ("quakedesign.synthesis.sliding_mode_design", "quakedesign.guarantees.search.compensated_search")
)
DEFAULT = import_module("quakedesign.guarantees.search.default_designs")
CERTIFICATE = Path(__file__).parents[3] / "proofs" / "certificates" / "cta_7_5_2.3_1.1.json"


@cache
def designed(name="cta"):
    return qd.design(REAL, name, plant="printed")


@pytest.fixture
def unproved(monkeypatch):
    """Without the search in continuous time, which is another test's and takes most of a design."""
    monkeypatch.setattr(DESIGN, "find_certificate", lambda *_, **__: None)


@pytest.fixture
def unreached(monkeypatch):
    """Without how far other designs would go, which is another test's."""
    designed()  # cached with it
    for name in ("longest_step", "longest_delay"):
        monkeypatch.setattr(f"quakedesign.guarantees.search.default_designs.{name}", lambda *_, **__: None)


def run(controller, **options):
    return simulate(REAL, controller, duration=36.8, samples=201, compiled=False, plant="printed", **options)


def recursion(run, claim):
    """Pressure [Pa] of the matrices that the guarantee is about, with a deadbeat step w = -e1/T_s."""
    law = claim.sampled_loop.law
    assert law.root.slopes == (1, 1)
    F_, G, C, D = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    state, found = np.zeros(len(C)), []
    for e1, e2 in zip(run.slip - run.reference, run.slip_rate - run.reference_rate, strict=True):
        seen = np.array([e1, e2, -e1 / float(claim.sampled_loop.step)])
        found.append(C @ state + D @ seen)
        state = F_ @ state + G @ seen
    return np.array(found)


def test_the_default_of_the_real_fault_is_guaranteed_as_asked_for():
    design = designed()
    found = design.guarantee
    assert (design.verdict, found.check()) == (Verdict.PROVED, Verdict.PROVED)
    assert found.claims.slip_rate_error <= F(4, 10**4)
    assert found.claims.slip_error <= F(6, 10**5)
    assert design.controller.sampling.step == found.sampled_loop.step == STEP
    assert design.compensation.proof is found
    settings = dict(design.controller.sampling.settings)
    limit = {f"rest_{part.name}": getattr(found.rest_limit, part.name) for part in fields(found.rest_limit)}
    assert settings == {name: design.gains[name] for name in ("weight", "authority")} | limit
    premises = {p.name: p for p in design.premises}
    assert [p.name for p in design.conditions] == ["sampling_time", "delay"]
    assert all(p.holds for p in premises.values())
    assert premises["sampling_time"].certified >= F("0.5")
    assert 0 < premises["delay"].certified < STEP


def test_its_base_gains_stay_proved_in_continuous_time():
    design = designed()
    assert design.certificate.check() is Verdict.PROVED
    assert dict(design.certificate.loop.gains) == dict(design.controller.gains)
    assert design.controller.scale == F(design.details["rho"]) ** 6
    assert {"control_coefficient", "along_reference", "level_set"} <= {p.name for p in design.premises}


@pytest.mark.usefixtures("unproved", "unreached")
def test_a_design_is_guaranteed_and_run_with_the_noise_that_it_is_made_for():
    design = qd.design(REAL, "cta", slip_noise="1e-6", rate_noise="1e-5", plant="printed")
    claim, told = design.guarantee, {"slip_noise": F(1, 10**6), "rate_noise": F(1, 10**5)}
    assert (design.verdict, claim.check(), claim.sampled_loop.noise) == (Verdict.PROVED, Verdict.PROVED, told)
    assert replace(design, runs=None).guarantee == claim
    assert designed().guarantee.claims.slip_rate_error < claim.claims.slip_rate_error <= F(26, 10**5)
    assert {name: design.details[name] for name in told} == {name: str(bound) for name, bound in told.items()}
    seen = run(design.controller, measurement=design.measurement).metrics
    assert 0 < seen.max_slip_error <= claim.claims.slip_error
    assert 0 < seen.max_slip_rate_error <= claim.claims.slip_rate_error


@pytest.mark.usefixtures("unproved")
def test_how_far_other_designs_go_is_asked_with_the_same_noise(monkeypatch):
    asked = []

    def seen(task, *_, kind, setup):
        asked.append((type(kind).__name__, setup.slip_noise))

    for name in ("longest_step", "longest_delay"):
        monkeypatch.setattr(DEFAULT, name, seen)
    qd.design(REAL, "dia", slip_noise="1e-6", plant="printed")
    assert asked == 2 * [("Deadbeat", F(1, 10**6))]


def test_what_runs_is_what_is_guaranteed():
    found = run(designed().controller)
    assert np.allclose(found.pressure, recursion(found, designed().guarantee), rtol=1e-7, atol=1e-3)
    assert np.ptp(found.pressure) > 1e3
    told = {name: found.provenance[name] for name in ("scheme", "step", "weight", "authority")}
    assert told == {"scheme": "compensated", "step": 0.184, "weight": 0.35, "authority": 2.282e-8}


def test_it_runs_in_no_other_way():
    law = designed().controller
    limit = {name: float(value) for name, value in law.sampling.settings if name.startswith("rest_")}
    own = dict(weight=0.35, authority=2.282e-8, **limit)
    same = run(law, scheme=simulation_scheme("compensated", **own), step=0.184)
    assert np.array_equal(same.pressure, run(law).pressure)
    for other in (
        {"scheme": "explicit"},
        {"scheme": simulation_scheme("compensated")},
        {"scheme": simulation_scheme("compensated", **own | {"weight": 0.3})},
        {"step": 0.1},
    ):
        with pytest.raises(
            ParameterError,
            match=r"compensated, weight 0\.35, authority 2\.282e-08, rest_width .* and the step 0\.184 s",
        ):
            run(law, **other)


def test_campaigns_exports_and_python_control_run_it_as_simulate_does():
    law, found = designed().controller, run(designed().controller)
    scheme = campaign_problem(REAL, law, duration=36.8).scheme
    assert (scheme.name, scheme.weight, scheme.authority) == ("compensated", 0.35, 2.282e-8)
    told = np.vstack([found.slip, found.slip_rate, found.reference, found.reference_rate])
    system = to_iosystem(law)
    assert (system.dt, system.noutputs) == (0.184, 1)
    response = control.input_output_response(system, 0.184 * np.arange(len(found.time)), told)
    assert np.allclose(response.outputs, found.pressure, rtol=1e-9, atol=1e-6)
    step = controller_step(REAL, law)
    memory, pressures, pressure = list(step.start.values()), [], 0.0
    for slip, rate in zip(found.slip, found.slip_rate, strict=True):
        memory, pressure = step.function([slip, rate], pressure, memory)
        pressures.append(float(pressure))
    assert (step.step, step.facts["weight"]) == (0.184, "0.35")
    assert np.allclose(pressures, found.pressure, rtol=1e-9, atol=1e-6)
    with pytest.raises(UnsupportedError, match="a sampled law has no closed loop"):
        to_casadi(REAL, law)


def test_python_control_has_no_fault_to_take_an_input_gain_from():
    law = designed().controller
    bare = replace(law, gains=dict(law.gains), sampling=Sampling(step=STEP, scheme="compensated"))
    with pytest.raises(UnsupportedError, match="uses them"):
        to_iosystem(bare)


def test_it_travels_and_its_base_gains_may_be_scaled_as_they_are():
    law = designed().controller
    assert pickle.loads(pickle.dumps(law)) == law
    assert law.scaled(1).sampling == law.sampling


def test_both_objectives_are_what_they_are_called(unproved, unreached):
    laws = [qd.design(REAL, "dia", objective=name, plant="printed") for name in ("peak", "tracking")]
    peak, tracking = (law.guarantee.claims for law in laws)
    assert peak.slip_rate_error < tracking.slip_rate_error
    assert peak.slip_rate_error <= F(25, 10**5)


def test_a_guarantee_needs_no_certificate_in_continuous_time(unproved, unreached):
    design = qd.design(REAL, "cta", plant="printed")
    assert (design.verdict, design.certificate) == (Verdict.PROVED, None)
    assert design.guarantee == designed().guarantee
    again = assess(REAL, design.controller)
    assert (again.verdict, again.guarantee) == (Verdict.PROVED, design.guarantee)
    weak = assess(REAL, design.controller.scaled("1/1000000"))
    assert weak.verdict is Verdict.UNDECIDED
    assert weak.guarantee.reason.startswith("the implicit step leaves its sector")
    assert qd.design(REAL, "cta", continuous=True).verdict is Verdict.UNDECIDED


@pytest.mark.slow
def test_a_fault_sampled_too_slowly_gets_a_design_for_the_longest_step_that_works(unproved):
    design = qd.design(SLOW, "cta", plant="printed")
    base = replace(design.controller, gains=dict(design.controller.gains), sampling=None)
    assert isinstance(design_compensated(uncertain_plant(SLOW), base, F(1, 10)).proof, NoProof)
    step = design.controller.sampling.step
    assert F(2, 100) < step < F(1, 10)
    assert (design.verdict, design.guarantee.check(), design.guarantee.sampled_loop.step) == (Verdict.PROVED,) * 2 + (
        step,
    )
    assert design.details["reason"]
    found = {p.name: p for p in design.premises}["sampling_time"]
    assert (found.holds, found.certified) == (False, step)


@pytest.mark.slow
def test_where_no_step_has_a_guarantee_it_is_the_design_in_continuous_time(monkeypatch):
    fails = NoProof(reason="small gain 1.2")
    known = load_certificate(CERTIFICATE)
    monkeypatch.setattr(DESIGN, "find_certificate", lambda *_, **__: known)
    monkeypatch.setattr(COMPENSATED, "compensated", lambda *_, **__: fails)
    design = qd.design(REAL, "cta", plant="printed")
    assert design.controller == qd.design(REAL, "cta", continuous=True).controller
    assert (design.verdict, design.controller.sampling) == (Verdict.PROVED, None)
    assert design.guarantee.sentence() == "none: run in the scheme compensated, small gain 1.2"
    assert design.compensation is None
    for runs, is_positive in ((fails, False), (None, True)):
        judged = replace(design, runs=runs, premises=())
        entry = Entry(label="x", origin="designed", design=judged, run=None)
        assert positive(SimpleNamespace(of=lambda _, one=entry: (one,))) == is_positive


def test_gains_of_the_command_line_are_designed_either_way(unproved, monkeypatch):
    monkeypatch.setattr("quakedesign.studies.single_runs.design", lambda fault, name, continuous: designed())
    assert choice(REAL, "cta", ("designed",)).controller is designed().controller
    with pytest.raises(ParameterError, match="Give --gains continuous"):
        choice(REAL, "cta", ("designed",), feedforward="centred")
    assert choice(REAL, "cta", ("designed",), scale="1").controller.scale == 1


UNUSUAL = {
    "sampled every minute": replace(REAL, sampling_time=60.0),
    "ten percent": REAL.with_box("ten-percent"),
    "undamped": replace(REAL, damping=0.0),
    "laboratory": load_fault("lab-fault"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_faults_are_designed_with_a_guarantee_that_holds(unproved, name):
    design = qd.design(UNUSUAL[name], "dia", plant="printed")
    assert isinstance(design.guarantee, TrackingProof)
    assert design.guarantee.check() is design.verdict is Verdict.PROVED
