"""Both checkers of a guarantee part by part: against each other on random data, and against closed forms."""

import json
from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from random import Random

import pytest
from standalone_guarantee import checker
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees import Bounds, Claims, ContinuousProof, SampledLoop, TrackingProof
from quakedesign.guarantees.exact import small_gain
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import channels_of
from quakedesign.guarantees.exact.small_gain import bounds_from, certified_bounds
from quakedesign.laws import NOISES, ImplicitStep, LinearLaw, Power
from quakedesign.loop import ContinuousLaw, PeriodicLoop, Segment, exact_integrals
from quakedesign.loop.loop_setup import Pump
from quakedesign.plant import FaultPlant
from quakedesign.plant import fault_plant as package_task
from quakedesign.plant.fault_plant import Friction

SHAPES = [(0, 0, 3, -2), (0, 0, 0, 10, -15, 6), (0, 0, 0, 4, -3), (0, 0, 6, -8, 3)]
OUTPUTS = ("slip_error", "slip_rate_error", "push")


def some(random, low, high, parts=1):
    return F(random.randint(low, high), parts)


def some_task(random):
    least = some(random, 1, 4, 10)
    static = least + some(random, 0, 3, 10)
    tenths = lambda high: some(random, 0, high, 10)  # noqa: E731
    return FaultPlant(
        name="fault",
        density=some(random, 1, 9),
        shear_modulus=some(random, 1, 50),
        length=some(random, 2, 5, 2),
        damping=some(random, 0, 9),
        normal_stress=some(random, 1, 9),
        spreads=(tenths(4), tenths(4), tenths(4)),
        friction=Friction(
            static=static,
            least=least,
            largest=static + tenths(3),
            weakening=tenths(5),
            strengthening=tenths(5),
            rate_slope=random.choice([F(0), tenths(3)]),
        ),
        shape=tuple(map(F, random.choice(SHAPES))),
        target_slip=some(random, 1, 20, 10),
        operation_time=some(random, 1, 9, 2),
        amplitude=some(random, 0, 5),
        change=random.choice([None, some(random, 0, 5)]),
        growths=(some(random, -9, 9, 4), some(random, -9, 9, 4)),
    )


def some_rows(random, height, width):
    return tuple(tuple(some(random, -9, 9, 4) for _ in range(width)) for _ in range(height))


def singular(random, size):
    """Rows of which the last follows from the others, some of them and some columns zero."""
    rows = [[v * random.randint(0, 3) for v in line] for line in some_rows(random, size - 1, size)]
    gone = random.randint(0, 2 * size)
    rows = [[F(0) if j == gone else v for j, v in enumerate(line)] for line in rows]
    rows.append([sum((line[j] for line in rows), F(0)) for j in range(size)])
    random.shuffle(rows)
    return rows


def some_root(random):
    low, high = sorted(some(random, 0, 4, 4) for _ in range(2))
    inner = Power(factor=(F(1), F(2)), exponent=F(3, 2), argument="rate")
    pull = (Power(factor=(F(1, 2), F(1)), exponent=F(1, 3), argument=(inner,)),)
    return ImplicitStep(pull=pull, slopes=(low, high), remainder=some(random, 0, 3))


def some_claims(random):
    size = [some(random, 1, 9, 4) for _ in range(4)]
    return Claims(
        slip_error=UpperBound(size[0]),
        slip_rate_error=UpperBound(size[1]),
        peak_slip_rate=UpperBound(size[2]),
        least_pressure=LowerBound(-size[3]),
        largest_pressure=UpperBound(size[0]),
    )


def some_held(random):
    n, step = random.randint(1, 3), some(random, 1, 9, 4)
    root = random.choice([None, some_root(random)])
    seen = 2 + (root is not None)
    still = singular(random, n)
    law = LinearLaw(
        states=tuple(f"z{i}" for i in range(n)),
        update=tuple(tuple(v + (i == j) for j, v in enumerate(line)) for i, line in enumerate(still)),
        measured=some_rows(random, n, seen),
        output=some_rows(random, 1, n)[0],
        feedback=some_rows(random, 1, seen)[0],
        implicit_step=root,
    )
    delay = step * random.choice([F(0), F(0), F(1, 3), F(1), F(5, 2), F(8)])
    noise = {f"{name}_noise": random.choice([F(0), some(random, 0, 9, 4)]) for name in ("slip", "rate")}
    if law.of_slip_alone:
        noise["rate_noise"] = F(0)
    return SampledLoop(law=law, step=step, delay=delay, lag=random.choice([F(0), F(1, 3)]), **noise)


def with_reference(held, random):
    """The same with a law of the reference as well, for which there is a state that moves with it."""
    rows = [list(line) for line in some_rows(random, len(held.law.states) + 1, 2)]
    along = some_rows(random, 1, len(held.law.states))[0]
    still = [[v - (i == j) for j, v in enumerate(line)] for i, line in enumerate(held.law.update)]
    for row, line in zip(rows, [*still, held.law.output], strict=True):
        row[0] = -sum(v * x for v, x in zip(line, along, strict=True))
    return replace(held, law=replace(held.law, of_reference=tuple(map(tuple, rows))))


def off_schedule(held, number):
    """The same with jitter of measurements, of the delay or both, or a pump of some rate, or all of that."""
    jitter, later, ramp = [(1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 1, 1)][number % 5]
    pump = Pump(rate=F(5), least=F(-3), largest=F(2)) if ramp else None
    short = held.step / 12
    mean = short if number % 2 else F(0)
    held = replace(held, averaging=mean, ramp=ramp * short)
    return replace(held, jitter=jitter * short, delay_jitter=later * short, pump=pump)


def some_continuous(random):
    n = random.randint(1, 3)
    return ContinuousLaw(
        states=tuple(f"z{i}" for i in range(n)),
        rates=tuple(map(tuple, singular(random, n))),
        measured=some_rows(random, n, 2),
        output=some_rows(random, 1, n)[0],
        feedback=some_rows(random, 1, 2)[0],
        of_reference=random.choice([(F(0), F(0)), some_rows(random, 1, 2)[0]]),
    )


def document_of(claim):
    return json.loads(guarantee_text(claim))


@cache
def some_tasks():
    """Four tasks, each as both read it, one of every class and kind of friction."""
    random = Random(5)
    found = [replace(some_task(random), shape=tuple(map(F, shape)), change=F(1, 3)) for shape in SHAPES]
    found[3] = replace(found[3], change=None)
    found[2] = replace(found[2], friction=replace(found[2].friction, rate_slope=F(0)))
    held = some_held(random)
    raws = [document_of(TrackingProof(task=task, sampled_loop=held, claims=some_claims(random))) for task in found]
    return [(task, checker.read_task(raw)) for task, raw in zip(found, raws, strict=True)]


@pytest.fixture
def coarse(monkeypatch):
    """Few parts of the unit interval, in which both find the same ranges of a polynomial."""
    monkeypatch.setattr(checker, "HALVINGS", 2)
    monkeypatch.setattr(package_task, "_HALVINGS", 2)


@pytest.mark.usefixtures("coarse")
def test_both_derive_the_same_ranges_and_inputs_from_a_fault():
    random, held = Random(1), some_held(Random(6))
    for i in range(8):
        task = some_task(random)
        friction = replace(task.friction, rate_slope=F(i % 2, 10))
        task = replace(task, friction=friction, amplitude=F(i + 1), change=F(1, 3) if i & 2 else None)
        found = checker.read_task(document_of(TrackingProof(task=task, sampled_loop=held, claims=some_claims(random))))
        assert (found.name, found.b, found.s, found.w) == ("fault", task.authority, task.slip_chord, task.rate_chord)
        assert (found.beta, found.rest) == (task.beta, task.rest_pressure)
        assert (found.reference_rate, found.reference_force) == (task.reference_rates[0], task.reference_force)
        assert (found.drift, found.amplitude, found.change) == (task.drift, task.amplitude, task.change)
        assert found.reference_acceleration == task.reference_rates[1]
        smooth = task.shape == SHAPES[1]
        assert (found.reference_jerk, found.smooth) == (task.reference_jerk, smooth)
        with nullcontext() if smooth else pytest.raises(ParameterError, match="without acceleration"):
            task.require_smooth_reference()
        half = task.half_ranges
        force, drift, coupling, shifted = checker.inputs(found, half["push"])
        ours = channels_of(task, None, held.step)
        assert [c.constant for c in ours] == [force, drift]
        assert [c.coefficients for c in ours] == [half, {"slip_rate_error": coupling}]
        zero = {(y, k): (F(0),) for y in OUTPUTS for k in ("acceleration", "drift")}
        assert bounds_from(task, zero, None, held.step).push == shifted


def plain(terms):
    return [
        (list(t.factor), t.exponent, t.argument if isinstance(t.argument, str) else plain(t.argument)) for t in terms
    ]


def unless(error, work, *arguments):
    """None if it is refused."""
    try:
        return work(*arguments)
    except error:
        return None


def without_awaited(loop, theirs):
    """A loop without what is awaited of a layer, in which that is as the other checker has it."""
    sampled, fading, inputs = dict(loop.sampled), dict(loop.fading), dict(loop.inputs)
    assert sampled.pop("awaited_told") == tuple(theirs.told)
    assert loop.feedthrough == {("slip_rate_error", "awaited"): theirs.at_once}
    if loop.fading:
        own, given = fading.pop("awaited"), theirs.fade
        assert (own.first, own.height, own.rate, own.floor) == (given.event, given.height, given.rate, given.floor)
    assert (own.entry if loop.fading else inputs.pop("awaited")) == tuple(theirs.entry)
    return replace(loop, sampled=sampled, fading=fading, inputs=inputs, feedthrough={})


@pytest.mark.usefixtures("coarse")
def test_both_build_the_same_loop_of_a_law_that_is_held():
    random, built, referred, layers, late = Random(2), 0, 0, set(), set()
    for i in range(60):
        (task, read), held = some_tasks()[i % 4], some_held(random)
        if i % 3 and held.delay < 3 * held.step:
            held = replace(held, diffusion=F(i, 7) * held.step)
        elif i % 3 == 0:
            held = off_schedule(held, i // 3)
        if i % 2 and held.law.implicit_step is None and not held.diffusion:
            held = with_reference(held, random)
        raw = document_of(TrackingProof(task=task, sampled_loop=held, claims=some_claims(random)))
        ours = unless(ParameterError, held.loop, task)
        theirs = unless(checker.Refused, checker.read_loop, raw["loop"], read)
        assert (ours is None) == (theirs is None)
        if ours:
            built, referred = built + 1, referred + theirs.referred
            if theirs.layer:
                theirs, more = checker.without_area(theirs, sum(task.beta) / 2)
                ours = without_awaited(ours, more)
            assert theirs.flow == [list(line) for line in ours.flow]
            jumps = [([list(line) for line in s.jump], s.duration) for s in ours.segments]
            assert theirs.events == jumps
            assert theirs.outputs == [list(line) for line in ours.outputs.values()]
            assert all(list(theirs.cuts) == list(s.ends) for s in ours.segments)
            assert all(list(theirs.past_cuts) == list(s.past_ends) for s in ours.segments)
            fades = [(f.first, f.height, f.rate, f.floor) for f in ours.fading.values()]
            given = theirs.fade
            assert fades == ([(given.event, given.height, given.rate, given.floor)] if given else [])
            layers.add((held.diffusion > 0, held.lag > 0, given.event if given else None))
            late.add(same_pulse(task, ours, theirs, held))
            entries = [ours.inputs[name] for name in ("acceleration", "drift", "reference") if name in ours.inputs]
            entries += ours.sampled.values()
            entries += [f.entry for f in ours.fading.values()]
            assert theirs.inputs == list(map(list, entries))
            assert (theirs.step, theirs.root is None) == (ours.period, held.law.implicit_step is None)
            assert theirs.noise == (held.slip_noise, held.rate_noise)
            assert len(ours.states) == len(set(ours.states)) == len(ours.flow)
            if theirs.root:
                given = (
                    plain(held.law.implicit_step.pull),
                    list(held.law.implicit_step.slopes),
                    held.law.implicit_step.remainder,
                )
                assert (theirs.root.pull, theirs.root.slopes, theirs.root.remainder) == given
            more = {"largest_step": UpperBound(1)} if held.pump else {}
            more |= {"least_asked": LowerBound(-1), "largest_asked": UpperBound(1)} if held.pump and held.lag else {}
            claim = TrackingProof(task=task, sampled_loop=held, claims=replace(some_claims(random), **more))
            assert parse_guarantee(guarantee_text(claim)) == claim
    assert built > 25
    assert referred > 3
    assert {(True, True, None), (True, False, 0), (True, False, 1)} <= layers
    assert {(0, True), (0, False), (1, True), (1, False), None} <= late


def same_pulse(task, ours, theirs, held):
    """What is late, in both: its event, and whether it comes through a lag; None where nothing is."""
    assert (theirs.off, theirs.stepped) == (held.jitter + held.averaging / 2, "stepped" in ours.outputs)
    assert [NOISES[k] for k in theirs.told] == [name for name in NOISES if name in ours.sampled]
    if "late" not in ours.pulses:
        assert theirs.pulse is None
        assert "late" not in {name for _, name in ours.feedthrough}
        return None
    own, given = ours.pulses["late"], theirs.pulse
    assert (own.first, own.early, own.late) == (given.event, given.early, given.late)
    assert (own.before, own.after) == (given.before, given.after)
    assert list(own.entry) == checker.pulse_entry(theirs, sum(task.beta) / 2)
    assert ours.feedthrough == {("asked" if held.lag else "push", "drift"): own.late}
    return own.first, held.lag > 0


@pytest.mark.usefixtures("coarse")
def test_both_build_the_same_loop_in_continuous_time():
    random, built = Random(3), 0
    for i in range(30):
        (task, read), law = some_tasks()[i % 4], some_continuous(random)
        claim = ContinuousProof(task=task, law=law, claims=some_claims(random))
        raw = document_of(claim)
        ours = unless(ParameterError, getattr, claim, "loop")
        theirs = unless(checker.Refused, checker.read_loop, raw["loop"], read)
        assert (ours is None) == (theirs is None)
        if ours:
            built += 1
            assert theirs.flow == [list(line) for line in ours.flow]
            assert theirs.outputs == [list(ours.outputs[y]) for y in OUTPUTS]
            named = ("acceleration", "drift", *(FORWARD if any(law.of_reference) else ()))
            nothing = (F(0),) * len(ours.flow)
            assert theirs.inputs == [list(ours.inputs.get(name, nothing)) for name in named]
            assert (theirs.events, theirs.root, theirs.step, ours.period) == ([], None, 0, 0)
            assert parse_guarantee(guarantee_text(claim)) == claim
    assert built > 12


FORWARD = ("reference_acceleration", "reference_jerk")
HEARD = (NOISES, NOISES[:1], NOISES[1:], ("root", *NOISES), ("root", "slip_noise"))
REFERENCE = ("reference", "reference_rate")  # never with an implicit step
OFF = ((*NOISES, "late"), ("root", *NOISES, "late"), ("slip_noise", "late"), ("late",))
OFF += (REFERENCE, (*REFERENCE, *NOISES, "late"))
AT_SAMPLES = ("root", "reference_rate", *NOISES)


@pytest.mark.usefixtures("coarse")
@few(
    ("more", "held"),
    [((), False), (("root",), True), (FORWARD, False), ((), True), *((more, True) for more in (*HEARD, *OFF))],
    every=2,
)
@pytest.mark.parametrize("asked", [(), ("asked",)])
def test_both_draw_the_same_bounds_from_the_same_gains(more, held, asked, monkeypatch):
    """Three parts of a period, of which another one is the worst for every output; the better of both classes."""
    random, proved, entered = Random(4), 0, []
    names, parts = ("acceleration", "drift", *more), 3 if held else 1
    for i in range(8):
        (task, read), step = some_tasks()[1 if more == FORWARD else i % 4], some(random, 1, 9, 4)
        root = some_root(random) if "root" in more else None
        noise = {name: some(random, 1, 9, 4) for name in more if name in NOISES}
        late, jitter = "late" in more, some(random, 1, 9, 99) if "late" in more and noise else F(0)
        seen = (*OUTPUTS, *asked, *["stepped"] * late)
        table = {(y, k): tuple(some(random, 0, 9, 900 >> i) for _ in range(parts)) for y in seen for k in names}
        answers = iter([[list(table[y, k]) for y in seen] for k in names])
        events = [([], step)] if held else []
        monkeypatch.setattr(
            checker, "gains", lambda _l, _e, sudden, queue=answers, pulse=None: entered.append(sudden) or next(queue)
        )
        monkeypatch.setattr(small_gain, "norms" if held else "flow_norms", lambda _, known=table: known)
        given = checker.Root([], list(root.slopes), root.remainder) if root else None
        off = tuple(noise.get(name, F(0)) for name in NOISES)
        told = [k for k, name in enumerate(NOISES) if name in noise]
        watched = {"stepped": True, "pulse": checker.Pulse(0, step, F(0), F(0), F(0)), "off": jitter} if late else {}
        inputs = [[] for name in names if name != "late"]
        loop = checker.Loop([[F(0)] * 3] * 3, events, [[]] * len(seen), inputs, given, step, off, asked=bool(asked))
        loop = replace(loop, told=told, referred="reference" in more, **watched)
        segments = tuple(Segment(jump=(), duration=step) for _ in events)
        ours = PeriodicLoop(states=(), flow=(), segments=segments, inputs={}, outputs={})
        found = certified_bounds(task, ours, root, noise, jitter)
        theirs = unless(checker.Refused, checker.bounds, read, loop)
        assert (theirs is None) == (not isinstance(found, Bounds))
        if theirs:
            proved += 1
            each = found.slip_error, found.slip_rate_error, found.push, found.valve_push, found.stepped
            assert theirs[0] == [v for v in each if v is not None]
            assert (found.valve_push is None, found.stepped is None) == (not asked, not late)
            assert abs(theirs[1] - found.small_gain) <= max(found.small_gain / 2**19, F(1, 2**40))
    assert 2 < proved < 8
    assert not held or entered == 8 * [name in AT_SAMPLES for name in names]


@pytest.mark.parametrize(
    ("shape", "ends"),
    [
        ([0, 1, -1], (0, F(1, 4))),  # peaks at 1/2
        ([1, -3, 0, 4], (0, 2)),  # least at 1/2
        ([F(9, 128**2), F(-6, 128), 1], (0, F(125, 128) ** 2)),  # least at 3/128, where seven halvings cut
        ([7], (7, 7)),
    ],
)
def test_both_enclose_a_polynomial_exactly_where_it_turns_at_the_end_of_a_part(shape, ends):
    shape = list(map(F, shape))
    assert checker.on_unit_interval(shape) == ends
    assert package_task._range_of(tuple(shape)) == ends
    slope = [n * c for n, c in enumerate(shape) if n]
    assert checker.slope(shape) == list(package_task._derived(tuple(shape), 1)) == slope
    assert checker.hull(iter([F(2), F(3), F(1)])) == (1, 3)


@pytest.mark.parametrize(
    ("growth", "change", "rest"),
    [
        (F(0), {"weakening": F(1, 2), "strengthening": F(0)}, (9 - 15, 9 - F(3, 2))),  # largest where μ reaches 1/5
        (F(3, 4), {"weakening": F(0), "strengthening": F(1, 2)}, (9 - F(33, 2), 9 - 7)),  # least where it reaches 3/5
    ],
)
def test_the_stress_at_rest_turns_where_friction_reaches_a_bound(growth, change, rest):
    """(2/5·9 ∓ 3/2·r)/μ at r = 0, 2/5 and 2, by hand."""
    zero = F(0)
    friction = Friction(static=F(2, 5), least=F(1, 5), largest=F(3, 5), rate_slope=zero, **change)
    task = FaultPlant(
        name="fault", density=F(2), shear_modulus=F(3), length=F(2), damping=zero, normal_stress=F(9),
        spreads=(zero, zero, zero), friction=friction, shape=tuple(map(F, SHAPES[0])), target_slip=F(2),
        operation_time=F(1), amplitude=zero, change=None, growths=(growth, zero),
    )  # fmt: skip
    raw = document_of(TrackingProof(task=task, sampled_loop=some_held(Random(6)), claims=some_claims(Random(1))))
    assert checker.read_task(raw).rest == task.rest_pressure == rest


@pytest.mark.usefixtures("coarse")
def test_a_law_of_the_state_has_two_inputs_more():
    """ζ = (0, −1/k4) and η = (−1/k4, k3/k4²), times −k1 and −k2; for a reference without jumps of acceleration."""
    task, read = some_tasks()[1]
    k1, k2, k3, k4 = gains = tuple(map(F, (2, 3, 5, 7)))
    claim = ContinuousProof(task=task, law=exact_integrals(gains, of_state=True), claims=some_claims(Random(1)))
    theirs, ours = checker.read_loop(document_of(claim)["loop"], read), claim.loop
    expected = [[0, 0, k / k4, -k * k3 / k4**2] for k in (k1, k2)]
    assert theirs.inputs[2:] == [list(ours.inputs[name]) for name in FORWARD] == expected
    assert parse_guarantee(guarantee_text(claim)) == claim
    rough, read = some_tasks()[0]
    for law in (replace(claim.law, of_reference=(F(1), F(0))), replace(claim.law, of_reference=(F(0), F(1)))):
        other = replace(claim, task=rough, law=law)
        with pytest.raises(checker.Refused, match="without acceleration"):
            checker.read_loop(document_of(other)["loop"], read)
        with pytest.raises(ParameterError, match="without acceleration"):
            _ = other.loop
