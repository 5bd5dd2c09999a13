"""The file of a guarantee: both checkers, which share no code, accept it and refuse every forgery."""

import copy
import importlib.util
import json
import time
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from thinned import few

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError
from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, continuous_peaks, guarantee, read_guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee, save_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import family_of
from quakedesign.laws import (
    ErrorModel,
    ImplicitStep,
    Power,
    compensated,
    disturbance_estimate,
    slip_observer,
    summed_integrals,
)
from quakedesign.loop import exact_integrals
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import fault_plant as package_task
from quakedesign.plant import uncertain_plant

PATH = Path(__file__).parents[3] / "proofs" / "check.py"
SPECIFICATION = importlib.util.spec_from_file_location("guarantee_check", PATH)
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)

STEP = F("0.184")
ESTIMATE = disturbance_estimate(
    (F(672300000), F(198900000)),
    F("0.6"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), F("2.282e-8")),
)
INTEGRALS = summed_integrals((F(696000000), F(253000000), F(602000000), F(216000000)), STEP)
GAIN = STEP * F("2.25e-8")


def implicit(scale, slope, remainder="0"):
    """The 2-CTA with the gains 7, 5, 23/10, 11/10 and λ = ρ⁶ in a compensated step, μ0N̂0 = 2353/125000000000."""
    push, rho = GAIN / F(2353, 125000000000), F(scale)
    factors = (7 * rho**4 * push, 5 * rho**3 * push, F("2.3") * rho**6 * STEP * push, F("1.1") * rho**6 * STEP * push)
    parts = zip(factors, ("1/3", "1/2", "0", "0"), ("slip", "rate", "slip", "rate"), strict=True)
    pull = tuple(Power(factor=(c, c), exponent=F(p), argument=of) for c, p, of in parts)
    root = ImplicitStep(pull=pull, slopes=(F(slope), F(1)), remainder=F(remainder))
    return SampledLoop(law=compensated(root, F("0.3"), GAIN), step=STEP)


OBSERVER = slip_observer(
    (F(680000000), F(215900000)),
    (F("0.949"), F("6.53"), F("0.605")),
    ErrorModel.delayed(
        ((F("1.007"), F("0.1598")), (F("0.0718"), F("0.7513"))), ((F("0.0154"), F("0.1598")),), F("2.282e-8")
    ),
)
NOISY = {"slip_noise": F(1, 10**6), "rate_noise": F(1, 10**5)}
LOOPS = {
    "deadbeat": implicit("1", "1"),
    "sluggish": implicit("3/5", "97/100", "1/1000000"),
    "estimate": SampledLoop(law=ESTIMATE, step=STEP),
    "late": SampledLoop(law=ESTIMATE, step=STEP, delay=F("0.02")),
    "integrals": SampledLoop(law=INTEGRALS, step=STEP),
    "lagging": SampledLoop(law=ESTIMATE, step=F("0.1"), lag=F("0.03")),
    "noisy": SampledLoop(law=ESTIMATE, step=STEP, **NOISY),
    "observer": SampledLoop(law=OBSERVER, step=STEP, slip_noise=F(1, 10**6)),
    "noisy deadbeat": replace(implicit("1", "1"), **NOISY),
    "jittery": SampledLoop(law=ESTIMATE, step=STEP, jitter=F("0.002"), delay_jitter=F("0.001")),
    "mean": SampledLoop(law=ESTIMATE, step=STEP, delay=F("0.002"), averaging=F("0.004")),
    "jittery deadbeat": replace(implicit("1", "1"), jitter=F("0.001")),
    "jittery lag": SampledLoop(
        law=ESTIMATE, step=F("0.1"), lag=F("0.01"), jitter=F("0.0002"), delay_jitter=F("0.0002")
    ),
    "jittery and late": SampledLoop(law=ESTIMATE, step=STEP, delay=F("0.02"), jitter=F("0.001")),
    "paced": SampledLoop(law=ESTIMATE, step=STEP, pump=Pump(rate=F(20_000_000), least=F(-(10**8)), largest=F(10**8))),
    "noisy sluggish": replace(implicit("4/5", "97/100", "1/1000000"), slip_noise=F(1, 10**6)),
}
PATHS_OF = {
    "rock": {"diffusion": F(1)},
    "lagging rock": {"diffusion": F(1), "lag": F("0.05")},
    "late rock": {"diffusion": F("0.5"), "delay": F("0.02")},
}
for name, path in PATHS_OF.items():
    through = family_of(uncertain_plant(load_fault("real-fault")), STEP, "slip-and-rate", ExactSetup(**path)).law
    LOOPS[name] = SampledLoop(law=through(np.array([0.94, -8.28, 0.1237])), step=STEP, **path)
CONTINUOUS_GAINS = tuple(map(F, ("2640677339", "523784305.9", "2647975129", "957074176.5")))
CONTINUOUS = exact_integrals(CONTINUOUS_GAINS)
EVERY = (*(name for name in LOOPS if name != "late rock"), "continuous")


@cache
def claim(name="estimate", rate_limited=False):
    task = uncertain_plant(load_fault("real-fault"), rate_limited=rate_limited)
    return continuous_peaks(task, CONTINUOUS) if name == "continuous" else guarantee(task, LOOPS[name])


def package(text):
    try:
        return str(parse_guarantee(text).check())
    except CertificateError as error:
        return f"invalid: {error}"


def standalone(text):
    try:
        return checker.check(text).verdict
    except checker.Refused as error:
        return f"invalid: {error}"


@few(
    ("name", "rate_limited"),
    [
        pytest.param(name, kind, marks=pytest.mark.slow if kind and "rock" in name else ())
        for name in EVERY
        for kind in (False, True)
        if not kind or "noisy" not in name
    ],
    every=2,
)
def test_both_checkers_accept_what_the_package_writes(name, rate_limited):
    found = claim(name, rate_limited)
    text = guarantee_text(found)
    assert parse_guarantee(text) == found
    began = time.process_time()
    assert standalone(text) == "proved"
    assert time.process_time() - began < 10
    began = time.process_time()
    assert package(text) == "proved"
    assert time.process_time() - began < 0.5


@pytest.mark.slow
def test_a_layer_behind_a_delay_is_accepted_by_both():
    text = guarantee_text(claim("late rock"))
    assert parse_guarantee(text).sampled_loop == LOOPS["late rock"]
    assert standalone(text) == package(text) == "proved"


@pytest.mark.parametrize("new", ["x", "1/0", "2/4", 0.5, True, [], {}, -1, "-1", "0", "22/4000", "11/2000"], ids=repr)
def test_another_layer_is_refused_by_both(new):
    """0 is said by leaving it out; 23/4000 is a 32nd part of the step."""
    text = json.dumps(changed(json.loads(guarantee_text(claim("rock"))), ("loop", "diffusion"), new))
    assert standalone(text).startswith("invalid")
    assert package(text).startswith("invalid")


def test_the_statement_says_what_is_measured_and_how_well():
    """A bound of the noise is a premise: what is printed of it is never above what was proved."""
    said = (
        "law with 2 states, every 23/125 s, 0 s late, lag 0 s, measured slip within 1/1000000 m of the true one, slip "
    )
    assert said + "rate within 1/100000 m/s" in checker.check(guarantee_text(claim("noisy"))).statement
    said = "law with 3 states, slip alone measured, every 23/125 s, 0 s late, lag 0 s, measured slip within 1/1000000 m"
    assert f"{said} of the true one" in checker.check(guarantee_text(claim("observer"))).statement
    third = replace(LOOPS["noisy"], slip_noise=F(1, 3 * 10**6))
    found = guarantee(uncertain_plant(load_fault("real-fault")), third).sentence()
    said = "over 0.184 s, with any noise of at most 3.33333e-07 m in the measured slip, with any noise of at most"
    assert f"with zero-order hold {said} 1e-05 m/s in the measured slip rate, for every disturbance" in found
    said = (
        "hold over 0.184 s, with the slip alone measured, with any noise of at most 1e-06 m in the measured slip, for"
    )
    assert said in claim("observer").sentence()


def test_noise_of_a_slip_rate_that_is_not_measured_is_refused_by_both():
    raw = json.loads(guarantee_text(claim("observer")))
    text = json.dumps(changed(raw, ("loop", "noise", "rate"), "1/100000"))
    assert "needs a law that measures it" in standalone(text)
    assert "needs a law that measures the slip rate" in package(text)


def test_a_file_of_before_noise_is_one_without():
    raw = json.loads(guarantee_text(claim("noisy")))
    del raw["loop"]["noise"]
    assert standalone(json.dumps(raw)) == package(json.dumps(raw)) == "proved"
    assert parse_guarantee(json.dumps(raw)).sampled_loop == LOOPS["estimate"]


def test_the_root_lies_between_its_lines_for_all_errors_that_it_is_told():
    """Errors as claimed and the noise on top: lines that hold for the errors alone are refused by both."""
    found = claim("noisy deadbeat")
    raw, claims = json.loads(guarantee_text(found)), found.claims
    told = claims.slip_error + NOISY["slip_noise"], claims.slip_rate_error + NOISY["rate_noise"]
    least = told[0] / STEP + told[1]  # a sign of this size holds the end of the step at w = −e1/T_s
    for factor, shown in ((1 + F(1, 10**9), True), (1 - F(1, 10**9), False)):
        sign = {"factor": [str(least * factor)] * 2, "power": "0", "of": "slip"}
        text = json.dumps(changed(raw, ("loop", "root", "pull"), [sign]))
        assert ("implicit step must lie" in standalone(text)) is not shown
        assert package(text) == ("proved" if shown else "undecided")


def test_the_statement_says_the_slip_rate_of_this_fault():
    found = claim()
    lines = checker.check(guarantee_text(found)).statement
    assert f"the slip rate of this fault never exceeds {float(found.claims.peak_slip_rate):.4g} m/s" in lines


STATE = exact_integrals(CONTINUOUS_GAINS, of_state=True)


@pytest.mark.slow
def test_feedback_of_the_state_is_accepted_by_both_and_needs_a_smooth_reference():
    """A cubic reference starts and ends with an acceleration, which the law would pass on as a jump."""
    text = guarantee_text(continuous_peaks(uncertain_plant(load_fault("real-fault")), STATE))
    assert parse_guarantee(text).law == STATE
    assert package(text) == standalone(text) == "proved"
    raw = json.loads(text)
    cubic = json.dumps(changed(raw, ("reference", "shape"), ["0", "0", "3", "-2"]))
    assert "without acceleration" in standalone(cubic)
    assert "without acceleration" in package(cubic)
    much = [str(10**8 * F(v)) for v in raw["loop"]["of_reference"]]
    for new in (much, ["0"], ["1", "2", "3"], "1", ["x", "1"]):
        text = json.dumps(changed(raw, ("loop", "of_reference"), new))
        assert standalone(text).startswith("invalid"), new
        assert package(text) != "proved", new


@pytest.mark.slow
def test_a_slower_disturbance_is_never_bounded_worse():
    """The published integrals are so slow that the shifted pressure drifts too much; the larger class bounds them."""
    law = exact_integrals(tuple(map(F, ("1880000000", "579000000", "1020000", "18.52"))))
    any_, slow = (
        continuous_peaks(uncertain_plant(load_fault("real-fault"), rate_limited=k), law) for k in (False, True)
    )
    assert slow.claims == any_.claims
    assert package(guarantee_text(slow)) == standalone(guarantee_text(slow)) == "proved"


def test_the_statement_about_continuous_time_says_so_in_both():
    found = claim("continuous")
    said = "in continuous time (pressure without sampling or delay)"
    assert any(said in line for line in checker.check(guarantee_text(found)).statement)
    assert f"from rest, {said}, with exact measurements, for every disturbance" in found.sentence()
    assert not any("held" in line for line in (found.sentence(), *checker.check(guarantee_text(found)).statement))


CLAIMS = ("slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure", "largest_pressure")


@few(
    ("loop", "name"),
    [(loop, name) for loop in ("estimate", "sluggish", "continuous") for name in CLAIMS]
    + [("rock", "slip_rate_error"), ("lagging rock", "slip_error")]
    + [pytest.param("rock", "largest_pressure", marks=pytest.mark.slow)]
    + [("jittery", name) for name in ("slip_rate_error", "largest_pressure", "largest_step")]
    + [("jittery deadbeat", "slip_error"), ("jittery lag", "largest_asked"), ("paced", "largest_step")]
    + [("jittery and late", "least_pressure")]
    + [("observer", "slip_rate_error"), ("noisy sluggish", "slip_error"), ("noisy", "least_pressure")],
    every=2,
)
def test_one_percent_less_is_refused_by_both(name, loop):
    raw = json.loads(guarantee_text(claim(loop)))
    raw["claims"][name] = str(F(raw["claims"][name]) * F(99, 100))
    text = json.dumps(raw)
    assert name in standalone(text)
    assert package(text) == "undecided"


ANY = [
    (("disturbance", "amplitude"), F(21, 20)),
    (("fault", "friction", "largest"), F(21, 20)),
    (("fault", "friction", "weakening"), F(21, 20)),
    (("fault", "friction", "least"), F(19, 20)),
    (("fault", "normal_stress"), F(21, 20)),
    (("loop", "output", 1), F(4, 3)),
]
WORSE = [("estimate", *worse) for worse in ANY] + [("continuous", *worse) for worse in ANY]
WORSE += [
    ("estimate", ("loop", "step"), F(21, 20)),
    ("estimate", ("loop", "feedback", 0), F(3, 2)),
    ("estimate", ("loop", "feedback", 1), F(4, 3)),
    ("estimate", ("loop", "measured", 1, 1), F(4, 3)),
    ("estimate", ("loop", "update", 1, 0), F(4, 3)),
    ("noisy", ("loop", "noise", "slip"), F(3, 2)),
    ("noisy", ("loop", "noise", "rate"), F(21, 20)),
    ("noisy deadbeat", ("loop", "noise", "slip"), F(3, 2)),
    ("noisy sluggish", ("loop", "noise", "slip"), F(21, 20)),
    ("jittery", ("loop", "jitter", "measured"), F(21, 20)),
    ("mean", ("loop", "jitter", "mean"), F(21, 20)),
    ("jittery", ("loop", "jitter", "delay"), F(21, 20)),
    ("jittery deadbeat", ("loop", "jitter", "measured"), F(21, 20)),
    ("jittery lag", ("loop", "jitter", "delay"), F(21, 20)),
    ("jittery and late", ("loop", "jitter", "measured"), F(21, 20)),
    ("paced", ("loop", "pump", "rate"), F(9, 10)),
    ("paced", ("loop", "pump", "ramp"), F(9, 10)),
    ("paced", ("loop", "pump", "ramp"), F(11, 10)),
    ("paced", ("loop", "pump", "least"), F(1, 8)),
    ("paced", ("loop", "pump", "largest"), F(1, 8)),
    ("observer", ("loop", "noise", "slip"), F(21, 20)),
    ("observer", ("loop", "measured", 1, 0), F(3, 2)),
    ("rock", ("loop", "diffusion"), F(11, 10)),
    ("lagging rock", ("loop", "lag"), F(4, 5)),
    ("continuous", ("loop", "feedback", 0), F(3, 4)),
    ("continuous", ("loop", "feedback", 1), F(3, 4)),
    ("continuous", ("loop", "measured", 0, 0), F(4, 3)),
    ("continuous", ("loop", "rates", 1, 0), F(4, 3)),
]


@few(("loop", "place", "factor"), WORSE, ids=lambda v: "-".join(map(str, v)) if isinstance(v, tuple) else "", every=3)
def test_worse_data_under_the_same_claims_are_refused_by_both(loop, place, factor):
    raw = json.loads(guarantee_text(claim(loop)))
    holder = raw
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = str(F(holder[place[-1]]) * factor)
    text = json.dumps(raw)
    assert standalone(text).startswith("invalid")
    assert package(text) != "proved"


IMPLICIT = [
    (("pull", 0, "factor", 0), "1/2"),  # a weaker cube root
    (("pull", 1, "factor", 1), "10"),  # a stronger damping
    (("pull", 2, "factor", 0), "1/100000"),  # hardly a sign of the slip
    (("pull", 3, "factor", 1), "1/10"),
    (("pull", 0, "power"), "1"),
    (("pull", 1, "power"), "1/6"),
    (("pull", 0, "of"), "rate"),
    (("pull", 2, "of"), [{"factor": ["1", "1"], "power": "1", "of": "rate"}]),
    (("pull",), []),
    (("slopes",), ["98/100", "1"]),
    (("slopes",), ["99/100", "99/100"]),
    (("slopes", 0), "1/2"),  # wide enough for the root, too wide for the loop
    (("remainder",), "1/1000"),
]


@pytest.mark.parametrize(("place", "new"), IMPLICIT, ids=str)
def test_another_implicit_step_under_the_same_claims_is_refused_by_both(place, new):
    raw = json.loads(guarantee_text(guarantee(uncertain_plant(load_fault("real-fault")), implicit("3/5", "97/100"))))
    text = json.dumps(changed(raw, ("loop", "root", *place), new))
    assert standalone(text).startswith("invalid")
    assert package(text) != "proved"


@pytest.mark.parametrize("factor", [F(3, 2), F(4)])
def test_larger_claims_are_refused_where_the_root_leaves_its_lines(factor):
    """The claims say where the lines must hold: what is weaker about the errors asks more of the step."""
    raw = json.loads(guarantee_text(claim("deadbeat")))
    raw["loop"]["root"] = json.loads(
        guarantee_text(guarantee(uncertain_plant(load_fault("real-fault")), implicit("4/5", "1")))
    )["loop"]["root"]
    assert standalone(json.dumps(raw)) == package(json.dumps(raw)) == "proved"
    for name in ("slip_error", "slip_rate_error", "peak_slip_rate"):
        raw["claims"][name] = str(F(raw["claims"][name]) * 100 * factor)
    assert "implicit step must lie" in standalone(json.dumps(raw))
    assert package(json.dumps(raw)) == "undecided"


def places(value, path=()):
    """Every place in a JSON value."""
    yield path
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(inner, (*path, key))


def changed(raw, path, new):
    raw = copy.deepcopy(raw)
    holder = raw
    for key in path[:-1]:
        holder = holder[key]
    if new is None:
        del holder[path[-1]]
    else:
        holder[path[-1]] = new
    return raw


RAW = json.loads(guarantee_text(claim()))
CONTINUOUS_RAW = json.loads(guarantee_text(claim("continuous")))
NESTED = changed(json.loads(guarantee_text(claim("sluggish"))), ("reference", "shape"), ["0", "0", "3", "-2"])
TERMS = ("loop", "root", "pull")
NESTED = changed(NESTED, (*TERMS, 0), {"factor": ["1", "1"], "power": "1", "of": NESTED["loop"]["root"]["pull"][:1]})
PATHS = [(RAW, path) for path in places(RAW) if path and path != ("fault", "name")]
PATHS += [(CONTINUOUS_RAW, path) for path in places(CONTINUOUS_RAW) if path and path[0] == "loop"]
PATHS += [(NESTED, ("loop", "root", *path)) for path in places(NESTED["loop"]["root"])]
PATHS += [(NESTED, ("loop", key)) for key in ("feedback", "measured", "update")]
NOISY_RAW = json.loads(guarantee_text(claim("noisy")))
PATHS += [(NOISY_RAW, ("loop", "noise", name)) for name in ("slip", "rate")]
JITTERY_RAW, PACED_RAW = (json.loads(guarantee_text(claim(name))) for name in ("jittery", "paced"))
PATHS += [(JITTERY_RAW, ("loop", "jitter", *path)) for path in ((), ("measured",), ("delay",))]
PATHS += [(PACED_RAW, ("loop", "pump", *path)) for path in ((), ("least",), ("largest",), ("rate",), ("ramp",))]
PATHS += [(PACED_RAW, ("claims", "largest_step"))]
PATHS += [(json.loads(guarantee_text(claim("mean"))), ("loop", "jitter", "mean"))]


@pytest.fixture
def coarse(monkeypatch):
    """Few parts of the unit interval: cheap, and as strict."""
    monkeypatch.setattr(checker.beside("guarantee.task"), "HALVINGS", 2)
    monkeypatch.setattr(package_task, "_HALVINGS", 2)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("new", [None, "x", "1/0", "2/4", 0.5, True, [], {}, -1], ids=repr)
def test_entries_of_another_kind_are_refused_by_both_at_every_place(new):
    for raw, path in PATHS:
        if new == "x" and path[:2] == ("loop", "states") and len(path) == 3:
            continue  # a state may have the name x
        if new is None and path[:3] == TERMS and len(path) == 4:
            continue  # a sum with one term less is a sum
        if new is None and path == ("loop", "applied"):
            continue  # a law need not look after limits
        text = json.dumps(changed(raw, path, new))
        assert standalone(text).startswith("invalid"), path
        assert package(text).startswith("invalid"), path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("loop", "feedback"), ["9" * 390, "0"]),
        (("loop", "feedback"), ["1/" + "9" * 390, "0"]),
        (("loop", "feedback"), ["0", "0"]),
        (("loop", "output"), ["0", "0"]),
        (("loop", "output"), ["9" * 390, "-" + "9" * 390]),
        (("loop", "output"), ["-1", "-1"]),
        (("loop", "rates"), [["1", "0"], ["1", "1"]]),
        (("loop", "rates"), [["0", "0"], ["1/" + "9" * 390, "0"]]),
        (("loop", "states"), ["a", "a"]),
        (("loop", "step"), "1"),
    ],
)
def test_hostile_values_in_continuous_time_are_refused_by_both_in_bounded_time(path, value):
    text = json.dumps(changed(CONTINUOUS_RAW, path, value))
    began = time.process_time()
    assert standalone(text).startswith("invalid")
    assert package(text) != "proved"
    assert time.process_time() - began < 10


@pytest.mark.slow
def test_a_law_of_many_states_in_continuous_time_is_decided_by_both():
    """Ten more states that follow e1 and are not used: the same claims, in bounded time."""
    raw = copy.deepcopy(CONTINUOUS_RAW)
    loop = raw["loop"]
    loop["states"] += [f"more{i}" for i in range(10)]
    loop["rates"] = [row + ["0"] * 10 for row in loop["rates"]] + [
        ["0"] * (2 + i) + ["-1"] + ["0"] * (9 - i) for i in range(10)
    ]
    loop["measured"] += [["1", "0"]] * 10
    loop["output"] += ["0"] * 10
    began = time.process_time()
    assert standalone(json.dumps(raw)) == "proved"
    assert time.process_time() - began < 30
    assert package(json.dumps(raw)) == "proved"


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("fault", "density"), "0"),
        (("fault", "length"), "-5000"),
        (("fault", "spreads", "authority"), "1"),
        (("fault", "friction", "least"), "0"),
        (("fault", "friction", "static"), "1/10"),
        (("fault", "friction", "weakening"), "-1"),
        (("reference", "shape"), ["0", "1"]),
        (("reference", "shape"), ["0", "0", "9", "-8"]),
        (("reference", "target_slip"), "0"),
        (("disturbance", "amplitude"), "-1"),
        (("loop", "step"), "0"),
        (("loop", "step"), "9" * 390),
        (("loop", "step"), "1/" + "9" * 390),
        (("loop", "delay"), "-1"),
        (("loop", "delay"), "100"),
        (("loop", "lag"), "-1"),
        (("loop", "lag"), "1/" + "9" * 390),
        (("loop", "feedback"), ["9" * 390, "0"]),
        (("loop", "output"), ["0", "0"]),
        (("loop", "states"), ["a", "a"]),
    ],
)
def test_hostile_values_are_refused_by_both_in_bounded_time(path, value):
    text = json.dumps(changed(RAW, path, value))
    began = time.process_time()
    assert standalone(text).startswith("invalid")
    assert package(text) != "proved"
    assert time.process_time() - began < 10


def test_the_command_checks_files_and_compares_with_a_fault(tmp_path):
    path = tmp_path / "guarantee.json"
    save_guarantee(claim(), path)
    ((verdict, lines),) = check_files([path], "real-fault").values()
    assert verdict == "proved"
    assert 'the data are those of "real-fault", box paper' in lines
    ((verdict, _),) = check_files([path], "lab-fault").values()
    assert verdict == 'invalid: the data are not those of "lab-fault"'


def test_what_is_claimed_too_low_is_undecided_by_itself():
    found = claim()
    assert (
        replace(found, claims=replace(found.claims, slip_error=UpperBound(found.claims.slip_error / 2))).check()
        is Verdict.UNDECIDED
    )


@pytest.mark.parametrize("kind", ["another", "not-sos", "", None])
def test_a_file_of_another_kind_is_not_read_as_a_guarantee(kind):
    raw = json.loads((Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_real-fault.json").read_text())
    with pytest.raises(CertificateError, match="kind must be"):
        read_guarantee(raw | {"kind": kind})
    with pytest.raises(CertificateError, match="kind must be guarantee"):
        read_guarantee({key: entry for key, entry in raw.items() if key != "kind"})
