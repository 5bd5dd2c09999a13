"""Slow sliding, guaranteed: sectors, inertia, cells and files against closed forms and a second way to the bounds."""

import copy
import importlib.util
import itertools
import json
import math
from dataclasses import fields, replace
from fractions import Fraction as F
from pathlib import Path

import mpmath
import pytest
from thinned import few

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError, ParameterError, UnsupportedError
from quakedesign.exact import UpperBound
from quakedesign.fault import friction_law, load_fault
from quakedesign.guarantees import NoProof, SampledLoop, SlidingClaims, SlidingProof, cell_bounds
from quakedesign.guarantees.exact import sliding_proof
from quakedesign.guarantees.exact import sliding_small_gain as small_gain
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.search.lqg import Weights, sliding_law
from quakedesign.laws import LinearLaw
from quakedesign.loop import SlidingModel, sliding_loop
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov import Verdict
from quakedesign.plant import SlidingPlant, cells, slow_sliding_plant

PROOFS = Path(__file__).parents[3] / "proofs"
SPECIFICATION = importlib.util.spec_from_file_location("sliding_check", PROOFS / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
standalone = checker.beside("guarantee.slow_sliding")

RATE = F("1.2e-6")


def around(value, half):
    return F(value) * (1 - F(half)), F(value) * (1 + F(half))


def task(half="0.02", stress=25000, **changes):
    ranges = {
        "direct_effect": around("0.01", half),
        "evolution_effect": around("0.015", half),
        "critical_slip": around("0.001", half),
        "coefficient": (F("0.6"), F("0.6")),
        "normal_stress": (F(50 * 10**6), F(50 * 10**6)),
    }
    given = {
        "name": "a patch", "density": F(2700), "shear_modulus": F(30 * 10**9), "length": F(5000),
        "damping": F(5 * 10**14), "ranges": ranges, "rate": RATE, "distance": F("0.01"), "ramp": F(12),
        "stress": F(stress), "swing": F(0),
    }  # fmt: skip
    return SlidingPlant(**(given | changes))


MODEL = SlidingModel(
    rate=RATE, state_rate=F("1.2e-3"), slope=F(1), state_slope=F(1), strength=F(500024), weakening=F(750000),
    direct=F("0.01"), evolution=F("0.015"), stiffness=F(6 * 10**6), coefficient=F("0.6"),
)  # fmt: skip
WEIGHTS = Weights(slip=3.0, state=0.18, pressure=9000.0, slip_noise=3.0, state_noise=0.006, level_noise=20.0)
LAW = sliding_law(replace(MODEL, weakening=F(1100000), evolution=F("0.022")), F(50), weights=WEIGHTS)
LAGGED = SampledLoop(law=LAW, step=F(50), lag=F(10))


def claims(log_rate="1/2", log_state="1/18", slip_error="4e-5", push=380000, asked=380000):
    given = {"log_rate": log_rate, "log_state": log_state, "slip_error": slip_error, "push": push, "asked": asked}
    return SlidingClaims(**{name: UpperBound(F(value)) for name, value in given.items()})


CLAIM = SlidingProof(task=task(), sampled_loop=LAGGED, cuts=(None,), claims=claims())


def test_a_sliding_loop_has_a_direct_path_unless_told():
    direct = sliding_loop(LAW, MODEL, F(50))
    assert direct == sliding_loop(LAW, MODEL, F(50), delay=F(0), lag=F(0), diffusion=F(0))
    assert direct != sliding_loop(LAW, MODEL, F(50), delay=F(1))


@pytest.mark.parametrize("chords", [small_gain.chords, standalone.sector], ids=["package", "standalone"])
@pytest.mark.parametrize("size", ["1/1000", "1/2", "1", "3"])
def test_sectors_hold_the_exponentials_and_no_more(size, chords):
    low, high = chords(F(size))
    x = F(size)
    exact = sum((x**k / math.factorial(k) for k in range(60)), F(0))  # below e^x by less than 1e-50
    assert low <= (1 - 1 / exact) / x < (exact - 1) / x < high
    assert high - low == pytest.approx(((exact - 1) - (1 - 1 / exact)) / x, rel=1e-11)


@pytest.mark.parametrize("exponential", [small_gain.exponential, standalone.power_of_e], ids=["package", "standalone"])
def test_the_exponential_is_above_by_less_than_its_remainder(exponential):
    for x in (F(1, 1000), F(1), F(3)):
        exact = sum((x**k / math.factorial(k) for k in range(60)), F(0))
        assert 2 * x**60 / math.factorial(60) < exponential(x) - exact < x**26 / math.factorial(24) / 5000


def test_the_guarantee_is_proved_by_both_checkers_and_survives_its_file(tmp_path):
    text = guarantee_text(CLAIM)
    assert parse_guarantee(text) == CLAIM
    assert guarantee_text(parse_guarantee(text)) == text
    path = tmp_path / "sliding.json"
    path.write_text(text)
    ((verdict, lines),) = check_files([path]).values()
    assert verdict == "proved"
    assert any("never exceeds 1.649 V = 1.98 µm/s" in line for line in lines)
    result = checker.check(text)
    assert result.verdict == "proved"
    assert any("never exceeds 1.979e-06 m/s" in line for line in result.statement)
    assert any("small gain 0." in line for line in result.statement)


@pytest.mark.parametrize("half", ["0.02", "1/3", "1e-9", "1e-20"])
def test_the_ranges_that_are_said_lie_inside_those_that_are_proved(half):
    one = task(half)
    sentence = replace(CLAIM, task=one).sentence()
    said = sentence.split("for every constant value of ")[1].split(", all other constants as they are given: ")[0]
    for text, axis in zip(said.split(", "), ("direct_effect", "evolution_effect", "critical_slip"), strict=True):
        low, high = one.ranges[axis]
        left, right = map(F, text.split(" from ")[1].split(" to "))
        assert low <= left < right <= high
        assert max(left / low, high / right) < 1 + F(1, 10**5)


def paired(one, held, given):
    """Bounds of both checkers for one cell."""
    document = json.loads(guarantee_text(replace(CLAIM, task=one, sampled_loop=held, claims=given)))
    fault, numbers = standalone.read_fault(document), {name: F(v) for name, v in document["claims"].items()}
    loop, path = standalone.read_path(document["loop"])
    cell = standalone.Cell(fault, path, numbers, fault.normal(numbers["push"]))
    return cell_bounds(one, held, given), standalone.bounds(loop, cell)


STIFF = LinearLaw(
    states=("level",),
    update=((F(1),),),
    measured=((F(33 * 10**7), F(0)),),
    output=(F(-1),),
    feedback=(F(-33 * 10**8), F(0)),
)
"""Of the slip and its sum: holds sliding over steps of 200 s, and forgets what is past in a few of them."""


UNSURE = {
    "direct_effect": (F("0.009"), F("0.012")),
    "evolution_effect": (F("0.013"), F("0.017")),
    "critical_slip": (F("0.0008"), F("0.0011")),
    "coefficient": (F("0.5"), F("0.6")),
    "normal_stress": (F(40 * 10**6), F(50 * 10**6)),
}


def alone(one, held=LAGGED, given=None):
    """The standalone checker's cell of a task."""
    given = given or claims()
    document = json.loads(guarantee_text(replace(CLAIM, task=one, sampled_loop=held, claims=given)))
    fault, numbers = standalone.read_fault(document), {name: F(v) for name, v in document["claims"].items()}
    return standalone.Cell(fault, standalone.read_path(document["loop"])[1], numbers, fault.normal(numbers["push"]))


@pytest.mark.parametrize(("ramp", "drift"), [("14", "2"), ("12.4", "2"), ("13.5", "1.5"), ("0", "14.4")])
def test_the_pressure_that_is_needed_leaves_the_plan_and_lowers_the_normal_stress(ramp, drift):
    """KV = 7.2 Pa/s and K·distance = 60 kPa, over coefficients from 0.5 to 0.6."""
    one = task(ranges=UNSURE, ramp=F(ramp))
    cell = alone(one)
    assert one.drift == cell.fault.drift() == F(drift)
    normal = 40 * 10**6 - 120000 - 380000, 50 * 10**6 + 380000
    assert one.normal_stress(F(380000)) == cell.normal == normal
    swinging = replace(one, swing=F(1, 5))
    assert swinging.drift == alone(swinging).fault.drift() == F(6, 5) * F(drift)
    assert swinging.normal_stress(F(380000)) == alone(swinging).normal == normal


FRICTION = {
    "ageing": {},
    "slip": {"state_law": "slip"},
    "regularised": {"regularised": True},
    "regularised slip": {"state_law": "slip", "regularised": True},
}
OUTPUTS = ("log_rate", "ageing", "strength", "log_state", "slip_error", "push", "asked", "left_out")
PATHS = [
    {"lag": F(10)},
    {"lag": F(10), "delay": F(20), "slip_noise": F(1, 10**7)},
    {"diffusion": F(40)},
    {"diffusion": F(40), "delay": F(20)},
    {"diffusion": F(100), "lag": F(10)},
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("friction", FRICTION.values(), ids=FRICTION)
@pytest.mark.parametrize("swing", [F(0), F(1, 5)])
def test_both_checkers_state_the_same_loop_exactly(path, friction, swing):
    """Flow, inputs, outputs, what bounds the inputs and what may move after a step; with a rock that damps much."""
    one = task(ranges=UNSURE, ramp=F(14), damping=F(5 * 10**20), swing=swing, **friction)
    held = SampledLoop(law=STIFF, step=F(200), **path)
    cell, model = alone(one, held), small_gain.model_of(one, claims())
    plain, _ = standalone.read_path(json.loads(guarantee_text(replace(CLAIM, task=one, sampled_loop=held)))["loop"])
    theirs, ours = standalone.around(plain, cell), small_gain.loop_of(held, model, one)
    assert [list(row) for row in ours.flow] == theirs.flow
    assert [list(row) for row in ours.inputs.values()] == theirs.inputs[: len(ours.inputs)]
    assert [list(ours.outputs[name]) for name, _ in zip(OUTPUTS, theirs.outputs, strict=False)] == theirs.outputs
    assert [list(fading.entry) for fading in ours.fading.values()] == theirs.inputs[
        4 + bool(held.slip_noise) + bool(swing) :
    ]
    channels, (own, shares) = small_gain.channels_of(one, held, claims(), ours), standalone.shares_of(theirs, cell)
    assert [channel.constant for channel in channels] == own
    assert [[c.coefficients.get(name, 0) for name in OUTPUTS[: len(theirs.outputs)]] for c in channels] == shares
    assert list(small_gain.after_a_step(ours)) == standalone.since_step(theirs)
    moved = small_gain._moved(one, held, claims(), model, F(3))
    assert [moved[name] for name in OUTPUTS[:3]] == cell.soon(F(3))


@few("path", [{"diffusion": F(40), "delay": F(20), "slip_noise": F(1, 10**7)}, *PATHS], every=2)
@pytest.mark.parametrize("friction", FRICTION.values(), ids=FRICTION)
def test_both_checkers_make_the_same_of_gains(path, friction, monkeypatch):
    """Exactly, of gains that are made up: what adds at once, what a step does, small gain and bounds."""
    one, held = task(ranges=UNSURE, ramp=F(14), swing=F(1, 5), **friction), SampledLoop(law=STIFF, step=F(200), **path)
    ours = small_gain.loop_of(held, small_gain.model_of(one, claims()), one)
    phases, names = small_gain.after_a_step(ours), (*ours.inputs, *held.noise, *ours.fading)

    def gain(output, name, j):
        return F(1 + (7 * OUTPUTS.index(output) + 3 * names.index(name) + 5 * j) % 11, 10**9)

    made_up = {(y, n): tuple(gain(y, n, j) for j in range(len(phases))) for y in ours.outputs for n in names}
    asked = []

    def gains(_loop, _entry, sudden, fade=None):
        name = names[len(asked)]
        asked.append((name, sudden, fade is not None))
        return [list(made_up[output, name]) for output in OUTPUTS[: len(ours.outputs)]]

    monkeypatch.setattr(standalone, "gains", gains)
    plain, _ = standalone.read_path(json.loads(guarantee_text(replace(CLAIM, sampled_loop=held)))["loop"])
    theirs, small = standalone.bounds(plain, alone(one, held))
    found = small_gain.bounds_from(one, held, claims(), ours, made_up, phases)
    assert set(names) >= {"drift", "reference"}
    assert {name: found[name] for name in theirs} == theirs
    assert small <= found["small_gain"] <= small * (1 + F(1, 10**5))
    assert asked == [(name, name in held.noise, name in ours.fading) for name in names]


def test_what_adds_at_once_and_after_a_step_is_that_of_the_format():
    """Through rock, with gains of 0: y, g and f have what the stress and a step add, that of the last part at first."""
    one, held = task(ranges=UNSURE), SampledLoop(law=STIFF, step=F(200), diffusion=F(40))
    model = small_gain.model_of(one, claims())
    loop = small_gain.loop_of(held, model, one)
    phases, late, fading = small_gain.after_a_step(loop), small_gain.settled(loop), loop.fading["left_out"]
    weights = [
        float(fading.height) / sum((float(fading.rate * t)) ** k / math.factorial(k) for k in range(5))
        + float(fading.floor)
        for t in phases
    ]
    assert late == next(t for t, w in zip(phases, weights, strict=True) if w <= 1 / 16)
    assert 0 < phases.index(late) < len(phases) - 1
    still = {(y, n): (F(0),) * len(phases) for y in loop.outputs for n in (*loop.inputs, "left_out")}
    found = small_gain._once_settled(small_gain._with_what_adds_at_once(loop, model, still, phases), phases, late)
    for output, share in (("log_rate", 1), ("ageing", model.slope), ("strength", model.direct)):
        stress = float(share / model.strength)
        assert [float(v) for v in found[output, "stress"]] == pytest.approx([stress] * len(phases))
        fades = [weights[-1] if t < late else w for t, w in zip(phases, weights, strict=True)]
        assert [float(v) for v in found[output, "left_out"]] == pytest.approx([0.55 * stress * w for w in fades])
    assert not any(any(found[y, n]) for y, n in found if y not in OUTPUTS[:3] or n not in ("stress", "left_out"))


def test_what_the_loop_leaves_out_of_the_equations_stays_below_its_shares():
    """Balance of forces and ageing law typed in again, at all corners of constants, states and pressures.

    The shares are no larger than it takes: at some corner each input is near its bound.
    """
    one, given = task(ranges=UNSURE, damping=F(5 * 10**20)), claims("1/2", "1/5")
    held, model = SampledLoop(law=STIFF, step=F(200), lag=F(10)), small_gain.model_of(one, given)
    channels = {c.name: c for c in small_gain.channels_of(one, held, given, small_gain.loop_of(held, model, one))}
    strength, slope, bent, fast = map(float, (model.strength, model.slope, model.state_slope, model.state_rate))
    rate, x = float(RATE), 2e-5
    worst = dict.fromkeys(("stress", "rate", "state"), 0.0)
    for a, b, length, mu, normal in itertools.product(*([float(v) for v in one.ranges[axis]] for axis in UNSURE)):
        for y, z, q, need in itertools.product((-0.5, 0.5), (-0.2, 0.2), (-3.8e5, 3.8e5), (0.0, 6e6 * 0.01 / mu)):
            held_back = (normal - need - q) * (a * y + b * z) + 2e13 * rate * math.expm1(y) + 6e6 * x - mu * q
            nominal = strength * y + float(model.weakening) * z + 6e6 * x - float(model.coefficient) * q
            aged = rate / length * (math.expm1(y) - math.expm1(-z)) / fast
            left = {"stress": nominal - held_back, "rate": math.expm1(y) - slope * y}
            left["state"] = aged - slope * y - bent * z - left["rate"]
            seen = {"log_rate": y, "log_state": z, "push": q, "ageing": slope * y + bent * z}
            seen["strength"] = float(model.direct) * y + float(model.evolution) * z
            for name, value in left.items():
                bound = sum(float(c) * abs(seen[output]) for output, c in channels[name].coefficients.items())
                worst[name] = max(worst[name], abs(value) / bound)
    assert all(0.9 < ratio <= 1 + 1e-9 for ratio in worst.values()), worst


def test_what_the_loop_leaves_out_of_the_slip_law_stays_below_its_share():
    """Ruina's law typed in again, at the corners; where the slip evolves fastest or slowest the share is reached."""
    one, given = task(ranges=UNSURE, state_law="slip"), claims("1/2", "1/5")
    held, model = SampledLoop(law=STIFF, step=F(200), lag=F(10)), small_gain.model_of(one, given)
    loop = small_gain.loop_of(held, model, one)
    channels = {c.name: c for c in small_gain.channels_of(one, held, given, loop)}
    assert set(channels["state"].coefficients) == {"ageing"}
    assert loop.inputs["rate"][:2] == (model.rate, 0)
    slope, evolving, fast = map(float, (model.slope, model.evolution_slope, model.state_rate))
    ratios = []
    for length, y, z in itertools.product((0.8e-3, 1.1e-3), (-0.5, 0.5), (-0.2, 0.2)):
        evolved = float(RATE) / length * math.exp(y) * (y + z) / fast
        assert abs(math.expm1(y) - slope * y) <= float(channels["rate"].coefficients["log_rate"]) * abs(y) * (1 + 1e-9)
        bound = float(channels["state"].coefficients["ageing"]) * abs(evolving * (y + z))
        ratios.append(abs(evolved - evolving * (y + z)) / bound)
    assert sorted(ratios)[-4:] == pytest.approx([1.0] * 4)  # the shortest slips at +Y, the longest at -Y


def test_the_slip_law_is_the_ageing_law_where_both_are_linear():
    """With all slopes 1 both are the linearisation about steady sliding."""
    loops = [sliding_loop(STIFF, replace(MODEL, state_law=law), F(200), lag=F(10)) for law in ("ageing", "slip")]
    assert loops[0].flow == loops[1].flow
    assert loops[0].outputs == loops[1].outputs
    assert {n: v for n, v in loops[0].inputs.items() if n != "rate"} == {
        n: v for n, v in loops[1].inputs.items() if n != "rate"
    }


def test_the_state_of_the_slip_law_moves_at_most_as_fast_as_the_slip():
    given, slipping = claims("1/2", "1/18"), task(ranges=UNSURE, state_law="slip")
    fastest = 1.2e-6 / 0.8e-3 * math.exp(0.5) * (0.5 + 1 / 18)
    found = alone(slipping, given=given).fastest_state()
    assert small_gain._state_rate(slipping, given) == found
    assert float(found) == pytest.approx(fastest, rel=1e-9)


@pytest.mark.parametrize(("a", "mu"), [("1/10", "1/2"), ("1/5", "3/5"), ("1/100", "3/5")])
def test_regularised_friction_differs_from_its_logarithm_by_no_more_than_is_added(a, mu):
    """arsinh in 60 digits at the corners of what the claims allow; a is large, so that there is a difference."""
    b, y, z = F("0.015"), F(1, 2), F(1, 5)
    ranges = {**UNSURE, "direct_effect": (F(a), F(a)), "evolution_effect": (b, b), "coefficient": (F(mu), F(mu))}
    one, given = task(ranges=ranges, regularised=True), claims("1/2", "1/5")
    held = SampledLoop(law=STIFF, step=F(200), lag=F(10))
    added = small_gain.regularisation(one, given)
    assert alone(one, held, given).stress() - alone(replace(one, regularised=False), held, given).stress() == added
    mpmath.mp.dps = 150
    a, b, mu, y, z = (mpmath.mpf(v.numerator) / v.denominator for v in (F(a), b, F(mu), y, z))
    off = [
        a * mpmath.asinh(mpmath.sinh(mu / a) * mpmath.exp((a * s * y + b * t * z) / a)) - mu - a * s * y - b * t * z
        for s, t in itertools.product((-1, 0, 1), repeat=2)
    ]
    largest = max(map(abs, off)) * mpmath.mpf(int(one.normal_stress(given.push)[1]))
    assert 0 < largest < mpmath.mpf(added.numerator) / added.denominator
    assert a < 0.05 or mpmath.mpf(added.numerator) / added.denominator < 8 * largest
    assert small_gain.regularisation(replace(one, regularised=False), given) == 0


def test_regularised_friction_that_may_come_near_zero_is_refused_by_both():
    """2m/a is 1 at the largest effect, 1/2, for Y = Z = 1/10 where mu* = 0.3015."""
    for coefficient, refused in (("0.3015", False), ("0.3014", True)):
        ranges = {**UNSURE, "direct_effect": (F(2, 5), F(1, 2)), "evolution_effect": (F("0.015"),) * 2}
        ranges["coefficient"] = (F(coefficient),) * 2
        one, given = task(ranges=ranges, regularised=True), claims("1/10", "1/10")
        assert (small_gain.model_of(one, given) is None) is refused
        if refused:
            found = cell_bounds(one, LAGGED, given)
            assert found.reason == "regularised friction may come near 0"
            with pytest.raises(checker.Refused, match="must stay above half its direct effect"):
                alone(one, given=given).stress()
        else:
            alone(one, given=given).stress()


SLIPPING = replace(
    CLAIM,
    task=task("0.002", stress=8000, state_law="slip", regularised=True),
    claims=claims("541/10000", "9/1250", "287/100000000", 34900, 34900),
)


def test_a_guarantee_of_the_slip_law_is_proved_by_both_checkers_and_survives_its_file():
    text = guarantee_text(SLIPPING)
    assert parse_guarantee(text) == SLIPPING
    assert SLIPPING.check() is Verdict.PROVED
    assert SLIPPING.sentence().endswith("(with inertia, friction regularised, state by the slip law)")
    statement = checker.check(text).statement
    assert "regularised rate-and-state friction with the slip law, with inertia" in statement[0]


@pytest.mark.parametrize(
    ("claim", "name", "new"),
    [
        (CLAIM, "state_law", "ageing"),
        (CLAIM, "state_law", True),
        (CLAIM, "regularised", False),
        (CLAIM, "regularised", 1),
        (CLAIM, "regularised", "true"),
        (SLIPPING, "state_law", "slips"),
        (SLIPPING, "state_law", ["slip"]),
        (SLIPPING, "regularised", None),
    ],
)
def test_a_law_of_the_state_that_is_not_known_is_refused_by_both(claim, name, new):
    raw = json.loads(guarantee_text(claim))
    raw["fault"][name] = new
    with pytest.raises(checker.Refused, match=f"{name} must be"):
        checker.check(json.dumps(raw))
    with pytest.raises(CertificateError, match=f"fault.{name}"):
        parse_guarantee(json.dumps(raw))


def test_what_is_proved_of_ageing_is_not_proved_of_the_slip_law():
    raw = json.loads(guarantee_text(CLAIM))
    raw["fault"]["state_law"] = "slip"
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED
    with pytest.raises(checker.Refused, match="small gain must be below 1"):
        checker.check(json.dumps(raw))


@pytest.mark.parametrize(
    ("law", "more", "expected"),
    [
        ("rate-and-state-aging", {}, ("ageing", False)),
        ("rate-and-state-slip", {}, ("slip", False)),
        ("regularised-rate-and-state", {}, ("ageing", True)),
        ("regularised-rate-and-state", {"evolution": "slip"}, ("slip", True)),
    ],
)
def test_the_task_of_a_fault_has_its_law(law, more, expected):
    patch = load_fault("crustal-patch")
    quantities = {n: getattr(patch.friction, n) for n in patch.friction.quantities()}
    found = slow_sliding_plant(replace(patch, friction=friction_law(law)(**quantities, **more)), F(1000))
    assert (found.state_law, found.regularised) == expected
    known = slow_sliding_plant(patch, F(1000))
    assert [float(v) for v in found.ranges["coefficient"]] == pytest.approx(
        [float(v) for v in known.ranges["coefficient"]]
    )


@pytest.mark.parametrize("path", [{"lag": 10}, {"diffusion": 40}, {"diffusion": 40, "lag": 10}])
def test_both_checkers_add_the_inertia_of_the_balance_of_forces(path):
    """m V e^Y sup|r| over the smallest strength, typed in again."""
    held = SampledLoop(law=LAW, step=F(50), **{name: F(v) for name, v in path.items()})
    one = task(ranges=UNSURE, ramp=F(14))
    found = small_gain.inertia(one, held, claims())
    for density in (F(1, 10**9), F(2700), F(27 * 10**9)):
        heavy = replace(one, density=density)
        assert alone(heavy, held).stress() == heavy.stress + found * density / 2700
    lag, rock = path.get("lag", 0), path.get("diffusion", 0)
    speed = 2.5 / rock if rock else 1 / lag
    moved = speed * (3.8e5 + 3.8e5 + 2 * (rock / 2 + lag)) + 2  # d = 14 - 12
    state = 1.2e-6 / 0.8e-3 * (math.exp(0.5) - math.exp(-1 / 18))
    rest = (7.2 / 0.5 + moved) * (0.012 * 0.5 + 0.017 / 18) + 50.38e6 * 0.017 * state
    rest += 7.2 * math.expm1(0.5) + 0.6 * moved
    light = (40e6 - 0.12e6 - 0.38e6) * 0.009 / (2700 * 5000 * 1.2e-6 * math.exp(0.5))
    assert float(found) == pytest.approx(rest / light, rel=1e-9)
    swinging = replace(one, swing=F(1, 5))
    later = 0.2 * 2 * (1 + speed * (rock / 2 + lag))
    rest += (0.2 * 7.2 / 0.5 + later) * (0.012 * 0.5 + 0.017 / 18) + 7.2 * 0.2 + 0.6 * later
    more = small_gain.inertia(swinging, held, claims())
    assert alone(swinging, held).stress() == swinging.stress + more
    assert float(more) == pytest.approx(rest / light, rel=1e-9)


def test_the_state_that_ages_fastest_counts():
    """Where the state may be farther off than the rate, it is e^Z - e^-Y."""
    given = claims("1/18", "1/2")
    cell = alone(task(ranges=UNSURE), given=given)
    fastest = 1.2e-6 / 0.8e-3 * (math.exp(0.5) - math.exp(-1 / 18))
    assert small_gain._state_rate(task(ranges=UNSURE), given) == cell.fastest_state()
    assert float(cell.fastest_state()) == pytest.approx(fastest, rel=1e-9)


@pytest.mark.parametrize("delay", [0, 20, 50, 70])
def test_what_is_asked_is_read_at_the_valve(delay):
    held = replace(LAGGED, delay=F(delay))
    document = json.loads(guarantee_text(replace(CLAIM, sampled_loop=held)))
    loop = small_gain.loop_of(held, small_gain.model_of(task(), claims()), task())
    read = standalone.read_path(document["loop"])[0].outputs[-1]
    assert read == [int(state == "valve") for state in loop.states]


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.slow] * ({"diffusion", "delay"} <= set(path))) for path in PATHS],
    ids=["lag", "late and noisy", "rock", "rock and delay", "rock behind a lag"],
)
def test_both_checkers_find_the_same_bounds(path):
    """With a, b and D that are known to 0.2 percent, friction to a sixth of one, and a plan that is off."""
    one = task("0.002", ramp=F("11.9"))
    one = replace(one, ranges={**one.ranges, "coefficient": (F("0.599"), F("0.601"))})
    ours, (theirs, small) = paired(one, SampledLoop(law=STIFF, step=F(200), **path), claims("1/4", "1/10"))
    assert not isinstance(ours, NoProof)
    for name, value in theirs.items():
        assert float(ours[name]) == pytest.approx(float(value), rel=1e-3), name
    assert float(ours["small_gain"]) == pytest.approx(float(small), rel=1e-3)


def test_the_bounds_are_a_fixed_point_of_their_sectors():
    """Without ranges and at tiny claims only the linear loop is left: y of a stress at once, and a little more."""
    small = claims("1/1000", "1/1000", "1e-6", 1000, 3000)
    still = task("0", stress=1, distance=F(0), density=F(1, 10**6))
    found = cell_bounds(still, LAGGED, small)
    assert found["log_rate"] > F(1) / F(500024)
    ten = cell_bounds(replace(still, stress=F(10)), LAGGED, small)
    assert float(ten["log_rate"] / found["log_rate"]) == pytest.approx(10, rel=1e-3)


def test_cells_cover_the_box():
    cuts = (("direct_effect", F("0.0099")), None, ("critical_slip", F("0.001")), None, None)
    found = cells(task(), cuts)
    below, *above = (cell.ranges for cell in found)
    assert below["direct_effect"] == (F("0.0098"), F("0.0099"))
    assert [cell["critical_slip"] for cell in above] == [(F("0.00098"), F("0.001")), (F("0.001"), F("0.00102"))]
    assert {cell["direct_effect"] for cell in above} == {(F("0.0099"), F("0.0102"))}
    volume = sum(math.prod(cell.ranges[a][1] - cell.ranges[a][0] for a in list(cell.ranges)[:3]) for cell in found)
    assert volume == math.prod(high - low for low, high in list(task().ranges.values())[:3])


@pytest.mark.parametrize(
    "cuts",
    [
        (),
        (None, None),
        (("direct_effect", F("0.0099")), None),
        (("direct_effect", F("0.0098")), None, None),
        (("direct_effect", F("0.0102")), None, None),
        (("direct_effect", F("0.02")), None, None),
        (("rate", F("0.0099")), None, None),
        (("coefficient", F("0.6")), None, None),
    ],
)
def test_cuts_that_do_not_cut_a_box_are_refused_by_both(cuts):
    with pytest.raises(ParameterError):
        cells(task(), cuts)
    entries = [[] if cut is None else [cut[0], str(cut[1])] for cut in cuts]
    with pytest.raises(checker.Refused):
        standalone.read_cells(entries, dict(task().ranges))


def test_no_more_than_64_cells_are_read():
    many = task("0.02")
    cuts, low = [], many.ranges["direct_effect"][0]
    for k in range(64):
        cuts += [("direct_effect", low + F(k + 1, 10**6)), None]
    entries = [[] if cut is None else [cut[0], str(cut[1])] for cut in (*cuts, None)]
    assert len(cells(many, (*cuts[:126], None))) == len(standalone.read_cells([*entries[:126], []], many.ranges)) == 64
    with pytest.raises(ParameterError):
        cells(many, (*cuts, None))
    for beyond in (entries, [[]] * 128):
        with pytest.raises(checker.Refused, match="there must be 1 to 64 cells"):
            standalone.read_cells(beyond, dict(many.ranges))


SWINGING = replace(
    CLAIM,
    task=task("0.002", stress=2000, swing=F(1, 20)),
    claims=claims("1/5", "1/15", "1/50000", 210000, 210000),
)


def test_a_guarantee_along_references_of_a_swing_is_proved_by_both_checkers_and_survives_its_file():
    text = guarantee_text(SWINGING)
    assert json.loads(text)["reference"]["swing"] == "1/20"
    assert parse_guarantee(text) == SWINGING
    assert SWINGING.check() is Verdict.PROVED
    assert "whose rate stays between 0.95 V and 1.05 V, for every constant value of a" in SWINGING.sentence()
    statement = checker.check(text).statement
    assert any("whose rate stays within (1 +- 0.05) times this slip rate" in line for line in statement)


@pytest.mark.parametrize("swing", ["0", "1", "-1/10", "11/10", 1, None])
def test_a_swing_that_is_none_or_stops_the_reference_is_refused_by_both(swing):
    raw = json.loads(guarantee_text(SWINGING))
    raw["reference"]["swing"] = swing
    reason = "swing must be above 0 and below 1" if isinstance(swing, str) else "swing must be a rational"
    with pytest.raises(checker.Refused, match=reason):
        checker.check(json.dumps(raw))
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


def test_the_task_of_a_fault_has_the_rates_of_its_ramp():
    patch = load_fault("crustal-patch")
    ramped = replace(patch, reference=replace(patch.reference, ramp=0.05))
    found, plain = slow_sliding_plant(ramped, F(1000)), slow_sliding_plant(patch, F(1000))
    assert found.rate == F(95, 100) * plain.rate
    assert found.fastest == plain.rate * F(104375, 100000)  # 1 - 0.05 + 15/8 of 0.05, at half of the time
    assert (found.distance, plain.swing) == (plain.distance, 0)
    with pytest.raises(UnsupportedError, match="a ramp below 8/23"):
        slow_sliding_plant(replace(patch, reference=replace(patch.reference, ramp=0.35)), F(1000))


def test_what_is_proved_of_one_swing_is_not_proved_of_a_larger_one():
    raw = json.loads(guarantee_text(SWINGING))
    raw["reference"]["swing"] = "1/2"
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED
    with pytest.raises(checker.Refused, match="must follow from all claims"):
        checker.check(json.dumps(raw))


@pytest.mark.parametrize("place", [0, 1])
def test_every_cell_must_give_the_claims(place, monkeypatch):
    """Two cells, one of which gives a bound at its claim: neither the first nor the last may hide it."""
    middle = sum(task().ranges["direct_effect"]) / 2
    two = replace(CLAIM, cuts=(("direct_effect", middle), None, None))
    below = {part.name: F(getattr(two.claims, part.name)) / 2 for part in fields(two.claims)}
    of_cells = [below, below]
    of_cells[place] = below | {"push": F(two.claims.push)}
    monkeypatch.setattr(sliding_proof, "cell_bounds", lambda *_: next(given))
    given = iter([below, below])
    assert (len(two.cells), two.check()) == (2, Verdict.PROVED)
    given = iter(of_cells)
    assert two.theorem_bounds() == of_cells[place]
    given = iter(of_cells)
    assert two.check() is Verdict.UNDECIDED


def test_pressures_follow_the_plan_and_the_claims():
    """p* rises by K·distance/μ* = 6e6·0.01/0.6 Pa."""
    assert CLAIM.slides
    assert CLAIM.pressures == CLAIM.valve_pressures == (-380_000, 480_000)


@pytest.mark.parametrize(
    ("changes", "said"), [({}, "25 kPa"), ({"stress": F(0)}, "without disturbance"), ({"distance": F(0)}, "vacuous")]
)
def test_a_sentence_names_a_disturbance_and_an_empty_reference(changes, said):
    sentence = replace(CLAIM, task=replace(task(), **changes)).sentence()
    expected = {"25 kPa": "stress" not in changes, "without disturbance": said == "without disturbance"}
    assert {words: words in sentence for words in expected} == expected
    assert sentence.startswith("vacuous") is (said == "vacuous")


def test_a_file_keeps_the_cells():
    two = replace(CLAIM, cuts=(("direct_effect", F("0.01")), None, None))
    assert parse_guarantee(guarantee_text(two)) == two


PATHS = {"with a delay of 20 s": {"delay": F(20)}, "through a lag of 10 s": {"lag": F(10)}}
PATHS["through a diffusion path of L^2/D = 40 s"] = {"diffusion": F(40)}


@pytest.mark.parametrize("given", PATHS)
def test_a_sentence_names_what_lies_between_law_and_fault_and_nothing_else(given):
    sentence = replace(CLAIM, sampled_loop=SampledLoop(law=STIFF, step=F(50), **PATHS[given])).sentence()
    assert [words for words in PATHS if words in sentence] == [given]
    assert " 0 s" not in sentence


def test_a_sentence_names_the_wide_constants_and_the_friction():
    given = replace(CLAIM, task=task("0", regularised=False)).sentence()
    assert "for the constants of fault and friction as they are given" in given
    assert given.endswith("(with inertia)")
    one = replace(CLAIM, task=task("0", ranges={**task("0").ranges, "critical_slip": (F("0.0008"), F("0.0011"))}))
    assert "for every constant value of D_c from" in one.sentence()
    assert "constant a " not in one.sentence()


def test_a_rate_that_is_off_for_ever_is_followed():
    """The nominal loop settles at y = ω/c without a slip error, so that the gain of y is at least 1/c."""
    still = task("0", stress=0, swing=F(1, 10), distance=F(0))
    model = small_gain.model_of(still, claims())
    loop = small_gain.loop_of(LAGGED, model, still)
    assert loop.inputs["reference"] == (-RATE, *[0] * (len(loop.states) - 1))
    found = small_gain.norms(loop)
    assert 1 / model.slope < max(found["log_rate", "reference"]) < 3 / model.slope


CHANGES = {
    "more stress": (("stress",), "60000"),
    "weaker direct effect": (("fault", "direct_effect", 0), "1/125"),
    "stronger evolution": (("fault", "evolution_effect", 1), "1/50"),
    "shorter slips": (("fault", "critical_slip", 0), "1/2000"),
    "unsure friction": (("fault", "coefficient", 1), "7/10"),
    "less normal stress": (("fault", "normal_stress", 0), "40000000"),
    "farther": (("reference", "distance"), "1"),
    "faster": (("reference", "rate"), "3/1000000"),
    "another plan": (("reference", "ramp"), "1000"),
    "heavier": (("fault", "density"), "2700000000"),
    "viscous": (("fault", "damping"), "500000000000000000000000"),
    "noise": (("loop", "slip_noise"), "1/1000"),
    "slower well": (("loop", "lag"), "200"),
    "late": (("loop", "delay"), "200"),
    "longer step": (("loop", "step"), "200"),
    "wrong gain": (("loop", "feedback"), "-1000000"),
    "wrong output": (("loop", "output", 1), "50000000"),
    "wrong update": (("loop", "update", 1, 1), "1/100"),
    "wrong correction": (("loop", "measured", 2), "-1"),
    "lower rate": (("claims", "log_rate"), "1/20"),
    "lower state": (("claims", "log_state"), "1/100"),
    "less slip": (("claims", "slip_error"), "1/1000000"),
    "less pressure": (("claims", "push"), "10000"),
    "less asked": (("claims", "asked"), "10000"),
}


def changed(path, new):
    raw = copy.deepcopy(json.loads(guarantee_text(CLAIM)))
    holder = raw
    for key in path[:-1]:
        holder = holder[key]
    assert holder[path[-1]] != new
    holder[path[-1]] = new
    return json.dumps(raw)


@few("name", CHANGES, every=3)
def test_what_makes_the_statement_harder_is_not_proved(name):
    text = changed(*CHANGES[name])
    try:
        verdict = parse_guarantee(text).check()
    except CertificateError:
        verdict = Verdict.UNDECIDED
    assert verdict is Verdict.UNDECIDED


@pytest.mark.parametrize("name", ["more stress", "another plan"])
def test_the_standalone_checker_refuses_it_as_well(name):
    with pytest.raises(checker.Refused):
        checker.check(changed(*CHANGES[name]))


@pytest.mark.parametrize(
    ("path", "new"),
    [
        (("format",), 2),
        (("fault", "name"), ""),
        (("fault", "name"), 5),
        (("fault", "density"), "0"),
        (("fault", "damping"), "-1"),
        (("fault", "direct_effect"), ["1/50", "1/100"]),
        (("fault", "direct_effect", 0), "0"),
        (("fault", "normal_stress", 0), "0"),
        (("reference", "rate"), "0"),
        (("reference", "distance"), "-1"),
        (("stress",), "-1"),
        (("stress",), "25000.0"),
        (("loop", "lag"), "0"),
        (("loop", "step"), "0"),
        (("loop", "slip_noise"), "-1"),
        (("loop", "measured"), ["1"]),
        (("loop", "measured"), "111"),
        (("loop", "states"), ["slip", "slip", "level"]),
        (("loop", "output"), "1"),
        (("cells",), []),
        (("cells",), [[], []]),
        (("cells",), 5),
        (("cells", 0), "none"),
        (("cells", 0), 5),
        (("cells",), [["direct_effect", "1/100", "1"], [], []]),
        (("cells",), [[["direct_effect"], "1/100"], [], []]),
        (("cells", 0), ["rate", "1"]),
        (("claims", "log_rate"), "31/10"),
        (("claims", "log_rate"), "0"),
        (("claims", "push"), "60000000"),
    ],
)  # fmt: skip
def test_what_breaks_a_rule_is_refused_by_both(path, new):
    text = changed(path, new)
    with pytest.raises(checker.Refused):
        checker.check(text)
    if path == ("claims", "push"):  # no rule is broken: nothing follows
        assert parse_guarantee(text).check() is Verdict.UNDECIDED
        return
    with pytest.raises(CertificateError):
        parse_guarantee(text)


@pytest.mark.parametrize("where", [(), ("fault",), ("reference",), ("loop",), ("claims",)])
def test_a_key_that_is_not_known_is_refused_by_both(where):
    raw = json.loads(guarantee_text(CLAIM))
    holder = raw
    for key in where:
        holder = holder[key]
    holder["more"] = "1"
    with pytest.raises(checker.Refused, match="must have exactly the keys"):
        checker.check(json.dumps(raw))
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


@pytest.mark.parametrize("name", ["fault", "reference", "loop", "claims", "cells"])
@pytest.mark.parametrize("value", [5, None, True])
def test_a_part_that_is_no_object_and_no_list_is_refused_by_both(name, value):
    raw = json.loads(guarantee_text(CLAIM)) | {name: value}
    with pytest.raises(checker.Refused):
        checker.check(json.dumps(raw))
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


def test_a_lag_and_a_diffusion_path_of_half_a_second_are_read_and_bound_the_pressure():
    """q̇ = (1/lag or 5/(2τ))·(asked + drift·(τ/2 + lag) + push) + drift, with τ = L²/D and a drift of 2 Pa/s."""
    one, half = task(ranges=UNSURE, ramp=F(14)), F(1, 2)
    for path, fastest, late in (({"lag": half}, 1 / half, half), ({"diffusion": half}, F(5, 2) / half, half / 2)):
        cell = alone(one, SampledLoop(law=STIFF, step=F(1), **path))
        assert cell.fastest_push() == fastest * (380000 + 2 * late + 380000) + 2
    nothing = json.loads(guarantee_text(CLAIM))["loop"] | {"lag": "0", "diffusion": "0"}
    with pytest.raises(checker.Refused, match="through a lag or a diffusion path"):
        standalone.read_path(nothing)


@pytest.mark.parametrize("name", ["log_rate", "log_state"])
def test_logarithms_above_3_are_refused_by_both_for_that_reason(name):
    text = changed(("claims", name), "300001/100000")
    with pytest.raises(checker.Refused, match="log_rate and log_state must be at most 3"):
        checker.check(text)
    with pytest.raises(CertificateError, match="log_rate and log_state at most 3"):
        parse_guarantee(text)
    with pytest.raises(checker.Refused) as refused:
        checker.check(changed(("claims", name), "3"))
    assert "at most 3" not in str(refused.value)


@pytest.mark.parametrize("push", [49_900_000, 60_000_000])
def test_a_pressure_that_may_open_the_fault_is_the_reason_for_both(push):
    """50 MPa less K·distance/μ* = 0.1 MPa are left: exactly 0, or less."""
    with pytest.raises(checker.Refused, match="must not open the fault"):
        checker.check(changed(("claims", "push"), str(push)))
    assert cell_bounds(task(), LAGGED, claims(push=push)).reason == "the pressure may open the fault"


def test_half_a_pascal_of_normal_stress_does_not_open_the_fault():
    with pytest.raises(checker.Refused, match="small gain"):
        checker.check(changed(("claims", "push"), "99799999/2"))
    assert "open the fault" not in cell_bounds(task(), LAGGED, claims(push="99799999/2")).reason


@pytest.mark.parametrize(
    ("changes", "noise"), [({"state_law": "slip", "swing": F(1, 20)}, "1/10000000"), ({"distance": F("0.02")}, "0")]
)
def test_the_statement_has_the_conditions_inward_and_the_bounds_outward(changes, noise, monkeypatch):
    wide = task(name="a patch", **changes)
    wide = replace(wide, ranges=wide.ranges | {"coefficient": (F(3, 10), F(3, 5))})
    claim = replace(CLAIM, task=wide, sampled_loop=replace(LAGGED, slip_noise=F(noise)))
    bounds = dict.fromkeys(standalone.CLAIMS, F(0)), F(1, 3)
    monkeypatch.setattr(standalone, "bounds", lambda *_: bounds)
    first, law, disturbance, _, _, fault, valve, *_ = standalone.verify(json.loads(guarantee_text(claim)))
    assert first.startswith('fault "a patch" (a label; ')
    assert ("with the slip law" in first, "with the ageing law" in first) == (
        wide.swing > 0,
        wide.swing == 0,
    )
    assert law.endswith(" of the true one") is (noise != "0")
    assert (f"within {noise} m" in law) is (noise != "0")
    assert ("whose rate stays within (1 +- 0.05)" in disturbance) is (wide.swing > 0)
    assert ("along any reference" in disturbance) is (wide.swing > 0)
    needed = 6_000_000 * wide.distance / F(3, 10)  # K·distance/μ*, which the plan reaches at its end
    assert fault == f"pressure in the fault from -3.8e+05 Pa to {float(380_000 + needed):.4g} Pa"
    assert valve == f"pressure at the valve from -3.8e+05 Pa to {float(380_000 + needed):.4g} Pa"


@pytest.mark.parametrize("name", [None, "log_rate", "log_state", "slip_error", "push", "asked"])
def test_a_claim_that_is_only_reached_on_one_cell_does_not_follow(name, monkeypatch):
    """Bounds that are made up: below all claims on one cell, one of them equal to its claim on the other."""
    two = replace(CLAIM, cuts=(("direct_effect", F("0.01")), None, None))
    numbers = {k: F(v) for k, v in json.loads(guarantee_text(two))["claims"].items()}
    below = {k: v * F(999, 1000) for k, v in numbers.items()}
    given = [(below, F(1, 2)), (below | ({name: numbers[name]} if name else {}), F(1, 4))]
    assert [small_gain.follows(found, claims()) for found, _ in given] == [True, name is None]
    answers = iter(given)
    monkeypatch.setattr(standalone, "bounds", lambda *_: next(answers))
    document = json.loads(guarantee_text(two))
    if name is None:
        assert any("small gain 0.5" in line for line in standalone.verify(document))
        return
    with pytest.raises(checker.Refused, match=f"the claim {name} must follow"):
        standalone.verify(document)


def test_a_law_of_the_slip_rate_or_a_pressure_that_jumps_is_refused():
    fed = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(F(-1), F(-1)))
    for held in (SampledLoop(law=fed, step=F(50), lag=F(10)), SampledLoop(law=LAW, step=F(50))):
        with pytest.raises(ParameterError, match="a law of the slip alone, with a diffusion path or a lag"):
            cell_bounds(task(), held, claims())


def test_the_task_is_that_of_the_fault():
    """Crustal patch: K = 32.04 GPa/15 km, V = 1 m in 1e6 s, and μ* from a − b over three decades of rate."""
    found = slow_sliding_plant(load_fault("crustal-patch"), F(25000), F("0.1"))
    assert found.stiffness == F(32040, 15) * 1000
    assert found.ranges["direct_effect"] == (F("0.009"), F("0.011"))
    low, high = found.ranges["coefficient"]
    decades = math.log(1e3)
    assert float(low) == pytest.approx(0.63454 - (0.005 + 0.0025) * decades, rel=1e-9)
    assert float(high) == pytest.approx(0.63454 - (0.005 - 0.0025) * decades, rel=1e-9)
    middle = 0.63454 - 0.005 * decades
    assert float(found.ramp) == pytest.approx(2.136e6 * 1e-6 / middle, rel=1e-9)
    exact = slow_sliding_plant(load_fault("crustal-patch"), F(25000))
    assert exact.drift < F(1, 10**8)
    with pytest.raises(UnsupportedError):
        slow_sliding_plant(load_fault("real-fault"), F(1))


@pytest.mark.parametrize("changes", [{"jitter": F(1)}, {"delay_jitter": F(1)}, {"pump": Pump(rate=F(1)), "ramp": F(1)}])
def test_jitter_and_the_rate_of_a_pump_are_refused_not_ignored(changes):
    known = parse_guarantee((PROOFS / "certificates" / "sliding_crustal-patch.json").read_text())
    off = replace(known, sampled_loop=replace(known.sampled_loop, **changes))
    with pytest.raises(ParameterError, match="no guarantee with jitter, averaging or the rate limit"):
        off.check()
