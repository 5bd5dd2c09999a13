"""Samples by no clock: both checkers on one file, and on what is worse, smaller or of another kind."""

import copy
import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from flint import ctx
from scipy.linalg import expm
from scipy.optimize import linprog
from standalone_guarantee import checker
from thinned import few

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.guarantees import NoProof, guarantee
from quakedesign.guarantees.exact import invariant_set as reach
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.invariant_set import _SampleMap, reduced
from quakedesign.guarantees.exact.norms import matrix
from quakedesign.guarantees.exact.sampled_loop import channels_of
from quakedesign.guarantees.exact.small_gain import VaryingGain
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.claim import Verdict

FILE = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_no-clock_lab-fault.json"
REFUSED = checker.Refused


@cache
def text():
    return FILE.read_text()


@cache
def claim():
    return parse_guarantee(text())


def changed(place, new):
    raw = json.loads(text())
    holder = raw
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = new(holder[place[-1]]) if callable(new) else new
    return raw


def package(raw):
    try:
        return str(parse_guarantee(json.dumps(raw)).check())
    except CertificateError:
        return "invalid"


def standalone(raw):
    try:
        checker.verify(copy.deepcopy(raw))
    except REFUSED as refused:
        return str(refused)
    return "proved"


def without(place):
    raw = json.loads(text())
    holder = raw
    for key in place[:-1]:
        holder = holder[key]
    del holder[place[-1]]
    return raw


def times(factor):
    return lambda value: str(F(value) * F(factor))


def scaled(rows, factor):
    return [[str(F(v) * F(factor)) for v in row] for row in rows]


def test_both_prove_the_file_and_say_so():
    assert claim().check() is Verdict.PROVED
    assert "with zero-order hold over sampling intervals from 0.001 s to 0.002 s in any order," in claim().sentence()
    lines = checker.verify(json.loads(text()))
    assert "every 1/1000 s to 1/500 s in any order," in lines[2]
    assert guarantee_text(claim()) == text()


def test_both_find_the_same_bounds():
    ours, theirs = both_bounds(json.loads(text()))
    assert ours == pytest.approx(theirs, rel=1e-12)


def edited(**parts):
    """The stored file with parts of it replaced, by their names with two underscores between the keys."""
    raw = json.loads(text())
    for name, new in parts.items():
        first, last = name.split("__")
        raw[first][last] = new
    return raw


NOISY = edited(
    loop__noise={"slip": "1/1000000000000", "rate": "1/1000000000"},
    reach__inputs=[*json.loads(text())["reach"]["inputs"], "1/1000000000000", "1/1000000000"],
)


def both_bounds(raw):
    ours = parse_guarantee(json.dumps(raw)).theorem_bounds()
    task = checker.read_task(raw)
    loop = checker.read_loop(raw["loop"], task, [F(0)] * 2)
    peaks, small = checker.bounds_within(task, loop, checker.read_reach(raw["reach"], loop))
    return [float(v) for v in (ours.slip_error, ours.slip_rate_error, ours.push, ours.small_gain)], [
        float(v) for v in (*peaks, small)
    ]


def test_noise_counts_in_both_at_the_samples_and_after_them():
    ours, theirs = both_bounds(NOISY)
    quiet, _ = both_bounds(json.loads(text()))
    assert ours == pytest.approx(theirs, rel=1e-12)
    assert all(a > b * (1 + 1e-9) for a, b in zip(ours[:3], quiet, strict=False))
    more = edited(
        loop__noise={"slip": "1/900000000000", "rate": "1/1000000000"}, reach__inputs=NOISY["reach"]["inputs"]
    )
    assert "within the bounds that reach gives" in standalone(more)
    assert package(more) == "undecided"


def test_a_disturbance_of_bounded_rate_shifts_the_pressure_and_drifts_as_it_couples():
    slow = {"amplitude": "1/1000", "change": "1/1000000", "growths": json.loads(text())["disturbance"]["growths"]}
    raw = json.loads(text())
    ours, theirs = both_bounds(raw | {"disturbance": slow})
    assert ours == pytest.approx(theirs, rel=1e-12)
    assert ours[2] > 1e-3
    coupled = raw | {"disturbance": slow | {"amplitude": "1/20"}}
    assert "within the bounds that reach gives" in standalone(coupled)
    assert package(coupled) == "undecided"
    without_shift = dict(slow) | {"amplitude": "1/1000"}
    del without_shift["change"]
    assert both_bounds(raw | {"disturbance": without_shift})[0][2] == pytest.approx(ours[2] - 1e-3, rel=1e-6)


@pytest.mark.parametrize("name", ["slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure"])
def test_one_percent_less_is_refused_by_both(name):
    raw = changed(("claims", name), times("99/100"))
    assert name in standalone(raw)
    assert package(raw) == "undecided"


WORSE = [
    (("disturbance", "amplitude"), times("51/50")),
    (("fault", "friction", "largest"), times("51/50")),
    (("fault", "friction", "weakening"), times("21/20")),
    (("fault", "friction", "least"), times("49/50")),
    (("reference", "operation_time"), times("1/20")),
    (("loop", "step"), times("9/10")),
    (("loop", "longest"), times("21/20")),
    (("loop", "feedback", 0), times("6/5")),
    (("loop", "feedback", 1), times("11/10")),
    (("loop", "output", 1), times("11/10")),
    (("loop", "measured", 0, 1), times("11/10")),
    (("loop", "measured", 1, 1), times("6/5")),
    (("loop", "update", 1, 0), times("6/5")),
    (("reach", "inputs", 0), times("99/100")),
    (("reach", "inputs", 0), times("101/100")),
    (("reach", "inputs", 1), times("99/100")),
    (("reach", "facets"), lambda rows: scaled(rows, "99/100")),  # a larger set, whose outputs are
    (("reach", "facets"), lambda rows: scaled(rows, "101/100")),  # a smaller one, which is left
    (("reach", "facets", 5), lambda row: scaled([row], "11/10")[0]),
    (("reach", "between"), lambda lines: [[line[0]] * len(line) for line in lines]),
    (("reach", "at_samples"), lambda lines: [[line[0]] * len(line) for line in lines]),
    (("reach", "at_samples", 3, 2), lambda basis: [basis[0]] * len(basis)),  # not independent
    (("reach", "at_samples"), lambda lines: [line[::2] for line in lines]),  # pieces that bend too much
]


@few(("place", "new"), WORSE, ids=lambda v: "-".join(map(str, v)) if isinstance(v, tuple) else "", every=3)
def test_worse_data_and_other_sets_are_refused_by_both(place, new):
    raw = changed(place, new)
    assert "must" in standalone(raw)
    assert package(raw) in ("undecided", "invalid")  # where a sample keeps more, the sizes are others too


SIZES = [
    (("loop", "longest"), "1/1000"),
    (("loop", "longest"), "0"),
    (("loop", "longest"), "-1/500"),
    (("loop", "delay"), "1/1000"),
    (("loop", "lag"), "1/1000"),
    (("loop", "diffusion"), "1"),
    (("loop", "jitter"), {"measured": "1/10000", "delay": "0"}),
    (("loop", "pump"), {"rate": "10000000", "ramp": "1/10000"}),
    (("loop", "first"), [["0", "1"], ["0", "0"]]),
    (("start",), {"slip": "1/1000000", "rate": "0"}),
    (("slow_gain",), {"parts": 2, "growth": "1"}),
    (("reach",), None),
    (("reach", "more"), "1"),
    (("reach", "inputs"), ["1"]),
    (("reach", "inputs"), ["1", "1", "1"]),
    (("reach", "inputs", 0), "-1"),
    (("reach", "inputs", 0), 1),
    (("reach", "facets"), []),
    (("reach", "facets"), lambda rows: rows[:2]),
    (("reach", "facets"), lambda rows: rows[:-1]),
    (("reach", "facets"), lambda rows: [row[:2] for row in rows]),
    (("reach", "facets", 0), lambda row: [*row, "1"]),
    (("reach", "facets", 0, 0), 1),
    (("reach", "facets", 0, 0), f"{10**20 + 1}/{10**15}"),
    (("reach", "facets", 0, 0), f"1/{10**20}"),
    (("reach", "at_samples"), lambda lines: [line[:1] * 25 for line in lines]),  # 4000 bases, and those of outputs
    (("reach", "at_samples"), {}),
    (("reach", "at_samples"), lambda lines: lines[:-1]),
    (("reach", "at_samples"), lambda lines: [line[:1] for line in lines]),
    (("reach", "at_samples"), lambda lines: [line * 5 for line in lines]),
    (("reach", "at_samples", 0), lambda line: line[:-1]),
    (("reach", "at_samples", 0), "x"),
    (("reach", "at_samples", 0, 0), lambda basis: basis[:2]),
    (("reach", "at_samples", 0, 0), lambda basis: [*basis, 0]),
    (("reach", "at_samples", 0, 0), {}),
    (("reach", "at_samples", 0, 0, 0), True),
    (("reach", "at_samples", 0, 0, 0), -1),
    (("reach", "at_samples", 0, 0, 0), 400),
    (("reach", "at_samples", 0, 0, 0), 0.0),
    (("reach", "at_samples", 0, 0, 0), "0"),
    (("reach", "between"), lambda lines: lines[:2]),
    (("reach", "between"), lambda lines: [*lines, lines[0]]),
]


@pytest.mark.parametrize(("place", "new"), SIZES, ids=lambda v: "-".join(map(str, v)) if isinstance(v, tuple) else "")
def test_other_sizes_kinds_and_surroundings_are_invalid_for_both(place, new):
    raw = changed(place, new) if new is not None else without(place)
    assert standalone(raw) != "proved"
    assert package(raw) == "invalid"


@pytest.mark.parametrize(
    ("name", "longest", "said"),
    [
        ("lab-fault", "0", "the longest interval must be longer than step"),
        ("cta_real-fault", "1/5", "must have a linear law from rest"),
    ],
)
def test_other_files_have_no_longest_interval(name, longest, said):
    raw = json.loads((FILE.parent / f"guarantee_{name}.json").read_text())
    raw["loop"]["longest"] = longest
    assert said in standalone(raw)
    assert package(raw) == "invalid"


def test_what_is_wrong_with_a_set_is_said():
    alike = changed(("reach", "at_samples", 3, 2), lambda basis: [basis[0]] * len(basis))
    assert "must be independent" in standalone(alike)
    assert "must be linearly independent" in parse_guarantee(json.dumps(alike)).theorem_bounds().reason
    assert "bounds of the inputs must be" in standalone(changed(("reach", "inputs", 0), "-1"))
    for new, said in (
        (lambda lines: [line * 5 for line in lines], "must have 1 to 32 pieces"),
        (lambda lines: [lines[0][:-1], *lines[1:]], "must have the same pieces in every row"),
        (lambda lines: [[basis[:2] for basis in line] for line in lines], "must name 3 facets each time"),
    ):
        assert said in standalone(changed(("reach", "at_samples"), new))
    assert "name facets by their numbers" in standalone(changed(("reach", "at_samples", 0, 0, 0), -1))


def test_a_law_with_an_implicit_step_needs_a_clock():
    held = parse_guarantee((FILE.parent / "guarantee_cta_real-fault.json").read_text()).sampled_loop
    plain = replace(held, law=replace(held.law, first=()))
    with pytest.raises(ParameterError, match="or implicit step"):
        replace(plain, longest_step=2 * held.step)


def test_a_set_has_no_more_than_six_dimensions(monkeypatch):
    for module in (reach, checker):
        monkeypatch.setattr(module, "MOST_SIZE" if module is reach else "MAX_ENTRIES", 2)
    assert "at most 2 entries" in standalone(json.loads(text()))
    assert package(json.loads(text())) == "invalid"


def test_a_set_is_for_samples_by_no_clock_alone():
    raw = without(("loop", "longest"))
    assert "for that alone" in standalone(raw)
    assert package(raw) == "invalid"
    known = claim()
    assert isinstance(guarantee(known.task, known.sampled_loop), NoProof)


@pytest.mark.parametrize("more", [{"delay": F(1, 1000)}, {"longest_step": F(1, 1000)}, {"initial_slip": F(1)}])
def test_a_loop_by_no_clock_has_nothing_else_around(more):
    with pytest.raises(ParameterError, match="longest"):
        replace(claim().sampled_loop, **more)


def test_a_sample_keeps_what_its_reduced_map_sees():
    jump = ((F(1), F(0), F(2)), (F(2), F(0), F(4)), (F(0), F(0), F(1)))
    seen, kept = (np.array(part.tolist(), dtype=float) for part in reduced(jump))
    assert (kept @ seen == np.array(jump, dtype=float)).all()
    assert (seen.shape, kept.shape) == ((2, 3), (3, 2))
    rows, columns = checker.reduced([list(row) for row in jump])
    assert (np.array(rows, dtype=float) == seen).all()
    assert (np.array(columns, dtype=float) == kept).all()


def test_states_at_samples_stay_in_the_set_and_come_near_its_sides():
    """By matrix exponentials of floats, pushes that follow one side at a time."""
    known = claim()
    loop, reach = known.loop, known.invariant_set
    facets, inputs = (np.array(v, dtype=float) for v in (reach.facets, reach.inputs))
    seen = np.array([[float(F(int(v.p), int(v.q))) for v in row] for row in reduced(loop.segments[0].jump)[0].tolist()])
    jump, flow = np.array(loop.segments[0].jump, dtype=float), np.array(loop.flow, dtype=float)
    entries = np.array(list(loop.inputs.values()), dtype=float) * inputs[:, None]
    random, largest = np.random.default_rng(4), np.zeros(len(facets))
    lengths = np.linspace(float(known.sampled_loop.step), float(known.sampled_loop.longest_step), 5)
    part = [expm(flow * length / 8) for length in lengths]
    for row in (facets @ seen)[::4]:
        order, states = random.integers(5, size=40), np.zeros(len(flow))
        order[::3] = 4
        rows = [row]
        for i in order[::-1]:
            for _ in range(8):
                rows.append(rows[-1] @ part[i])
            rows[-1] = rows[-1] @ jump if i != order[0] else rows[-1]
        for step, i in enumerate(order):
            states = jump @ states
            for k in range(8):
                costate = rows[len(rows) - 2 - 8 * step - k]
                states = part[i] @ states + np.sign(entries @ costate) @ entries * lengths[i] / 8
            largest = np.maximum(largest, np.abs(facets @ seen @ states))
    assert 0.7 < largest.max() < 1.005  # sums of eight parts


def rows_of(raw, count):
    """Bounds of the first facets' rows, in the package and in the standalone checker."""
    known, task = parse_guarantee(json.dumps(raw)), checker.read_task(raw)
    loop, (soonest, latest) = (
        checker.read_loop(raw["loop"], task, [F(0)] * 2),
        (known.sampled_loop.step, known.sampled_loop.longest_step),
    )
    read = checker.read_reach(raw["reach"], loop)
    theirs = checker.Between(loop, read)
    pieces = len(known.invariant_set.at_samples[0]) - 1
    ends = [soonest * i / 4 for i in range(4)] + [soonest + (latest - soonest) * i / pieces for i in range(pieces + 1)]
    found = []
    with ctx.workprec(128):
        channels = channels_of(known.task, None, soonest, known.sampled_loop.noise)
        ours = _SampleMap.of(known.loop, channels, known.invariant_set)
        for facet, bases in list(zip(known.invariant_set.facets, known.invariant_set.at_samples, strict=True))[:count]:
            row = matrix((facet,)) * ours.seen
            other = theirs.largest(checker.fixed([list(facet)]) * theirs.seen, ends, bases)
            found.append((float(ours._largest(row, ends, bases)), float(other)))
    return found


@pytest.mark.parametrize("raw", [json.loads(text()), NOISY], ids=["quiet", "noisy"])
def test_both_bound_every_side_alike(raw):
    for ours, theirs in rows_of(raw, 12):
        assert ours == pytest.approx(theirs, rel=1e-12)


def test_bounds_of_sides_lie_a_little_above_what_linear_programmes_and_fine_sums_give():
    known = claim()
    loop, facets = known.loop, np.array(known.invariant_set.facets, dtype=float)
    seen, kept = (
        np.array([[float(F(int(v.p), int(v.q))) for v in row] for row in part.tolist()])
        for part in reduced(loop.segments[0].jump)
    )
    flow, scale = np.array(loop.flow, dtype=float), np.abs(np.linalg.inv(facets[:3])).sum(axis=1)
    inputs = (
        np.array(list(loop.inputs.values()), dtype=float) * np.array(known.invariant_set.inputs, dtype=float)[:, None]
    )
    step, both = expm(flow * 2e-5), np.vstack([facets, -facets]) * scale
    for facet, (bound, _) in zip(facets, rows_of(json.loads(text()), 3), strict=False):
        row, area, highest = facet @ seen, 0.0, 0.0
        for i in range(101):
            if i >= 50 and i % 5 == 0:
                best = linprog(-(row @ kept) * scale, both, np.ones(len(both)), bounds=(None, None))
                highest = max(highest, area - best.fun)
            following = row @ step
            area += (np.abs(inputs @ row) + np.abs(inputs @ following)).sum() * 1e-5
            row = following
        assert highest <= bound <= highest + 0.006


def test_a_set_that_is_left_by_a_hundred_thousandth_is_refused_by_both():
    kept, left = (changed(("reach", "facets"), lambda rows, by=by: scaled(rows, by)) for by in ("1001/1000", "501/500"))
    assert (standalone(kept), package(kept)) == ("proved", "proved")
    beyond = [max(bounds) for bounds in zip(*rows_of(left, len(left["reach"]["facets"])), strict=True)]
    assert all(1 < bound < 1 + 1e-4 for bound in beyond)
    assert "must stay in the set" in standalone(left)
    assert "may leave the set" in parse_guarantee(json.dumps(left)).theorem_bounds().reason


@pytest.mark.parametrize(
    ("place", "new"),
    [
        (("loop", "delay"), "1/1000"),
        (("loop", "lag"), "1/1000"),
        (("loop", "diffusion"), "1"),
        (("loop", "jitter"), {"measured": "1/10000", "delay": "0"}),
        (("loop", "first"), [["0", "1"], ["0", "0"]]),
        (("start",), {"slip": "1/1000000", "rate": "0"}),
    ],
    ids=lambda v: v[-1] if isinstance(v, tuple) else "",
)
def test_what_a_set_does_not_know_of_is_refused_for_that_and_not_for_its_size(place, new):
    assert "must have a linear law from rest" in standalone(changed(place, new))


def test_an_implicit_step_and_an_interval_no_longer_than_the_step_are_refused_for_themselves():
    raw = json.loads((FILE.parent / "guarantee_cta_real-fault.json").read_text())
    del raw["loop"]["first"]
    raw["loop"]["longest"] = "1/5"
    assert "must have a linear law from rest" in standalone(raw)
    assert "must be longer than step" in standalone(changed(("loop", "longest"), "1/1000"))
    with pytest.raises(ParameterError, match="must exceed the step"):
        replace(claim().sampled_loop, longest_step=claim().sampled_loop.step)


@pytest.mark.parametrize(
    "more",
    [
        {"lag": F(1, 1000)},
        {"diffusion": F(1)},
        {"initial_slip_rate": F(1)},
        {"jitter": F(1, 10000)},
        {"delay_jitter": F(1, 10000)},
        {"averaging": F(1, 10000)},
        {"ramp": F(1, 10000)},
        {"pump": Pump(rate=F(10**7))},
    ],
    ids=lambda more: next(iter(more)),
)
def test_what_a_set_does_not_know_of_is_refused_before_its_size_is_looked_at(more):
    with pytest.raises(ParameterError, match="aperiodic sampling needs a linear law"):
        replace(claim().sampled_loop, **more)


def test_a_law_that_starts_from_what_it_measures_needs_a_clock():
    law = claim().sampled_loop.law
    with pytest.raises(ParameterError, match="aperiodic sampling needs a linear law"):
        replace(claim().sampled_loop, law=replace(law, first=((F(0), F(1)), (F(0), F(0)))))


def test_intervals_are_said_on_their_inner_side():
    held = replace(claim().sampled_loop, step=F("0.0010000001"), longest_step=F("0.0019999999"))
    assert "intervals from 0.00100001 s to 0.00199999 s in any order" in replace(claim(), sampled_loop=held).sentence()


def test_sizes_that_others_hide_are_invalid_too():
    few = json.loads(text())
    few["reach"]["facets"] = few["reach"]["facets"][:2]
    few["reach"]["at_samples"] = [[[0, 1, 0]] * 7] * 2
    few["reach"]["between"] = [[[0, 1, 0]] * 9] * 3
    many = changed(("reach", "between"), lambda lines: [line * 4 for line in lines])
    uneven = changed(("reach", "facets", 5), lambda row: [*row, "1"])
    for raw, said in ((few, "reach needs 3 to 400 facets"), (many, "1 to 32 pieces"), (uneven, "list of 3 rationals")):
        assert said in standalone(raw)
        assert package(raw) == "invalid"


@pytest.mark.parametrize(
    ("place", "new", "said"),
    [
        (("reach", "facets"), lambda rows: (rows * 3)[:401], "reach needs 3 to 400 facets"),
        (("reach", "facets", 0, 0), f"1/{10**20}", "at most 20 digits"),
        (("reach", "at_samples"), lambda lines: [line[:1] * 25 for line in lines], "at most 4000 bases"),
    ],
    ids=["facets", "digits", "bases"],
)
def test_limits_of_a_set_are_said(place, new, said):
    assert said in standalone(changed(place, new))


def test_a_slow_gain_which_is_of_a_clock_proves_nothing_without_one():
    known, slow = claim(), VaryingGain(parts=4, growth=F(1, 2))
    for longest in (known.sampled_loop.longest_step, F(1000)):
        found = guarantee(known.task, replace(known.sampled_loop, longest_step=longest), slow)
        assert isinstance(found, NoProof)
    assert replace(known, varying_gain=slow).check() is Verdict.UNDECIDED
    assert replace(known, varying_gain=slow, invariant_set=None).check() is Verdict.UNDECIDED


def test_with_a_clock_no_set_is_looked_at():
    known = claim()
    found = guarantee(known.task, replace(known.sampled_loop, longest_step=F(0)), invariant_set=known.invariant_set)
    assert "needs no invariant set" in found.reason


_ROW = (F(1),) * 7


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda s: {"facets": ()}, "facets must be 1 to .* Received 0 rows of 0 entries"),
        (lambda s: {"facets": s.facets[:1]}, r"facets must be 1 to .* Received 1 rows of \d entries"),
        (lambda s: {"facets": (_ROW,) * 8}, "facets must have at most 6 entries each .* Received 7"),
        (lambda s: {"at_samples": s.at_samples * 200}, r"bases must be at most 4000 in all .* Received \d{5}"),
        (
            lambda s: {"facets": (*s.facets[:-1], s.facets[-1][:-1])},
            r"facets must have the same number of entries .* Received rows of \d, \d entries",
        ),
        (
            lambda s: {"facets": ((F(10) ** 20, *s.facets[0][1:]), *s.facets[1:])},
            r"must be below 1e20 .* Received the entry 1e\+20, whose numerator or denominator is larger",
        ),
        (lambda s: {"at_samples": s.at_samples[:-1]}, "at_samples must have one row for each facet"),
        (
            lambda s: {"between": ((), *s.between[1:])},
            r"rows of between must have the same number of bases, 2 to 33, .* Received rows of 0, \d bases",
        ),
        (lambda s: {"at_samples": tuple(line[:1] for line in s.at_samples)}, "rows of at_samples .* rows of 1 bases"),
        (
            lambda s: {"between": ((s.between[0][0][:-1], *s.between[0][1:]), *s.between[1:])},
            r"a basis must be \d indices of facets, each at least 0 and below \d+ .* Received \(",
        ),
        (
            lambda s: {"between": (((len(s.facets), *s.between[0][0][1:]), *s.between[0][1:]), *s.between[1:])},
            r"a basis must be \d indices of facets, each at least 0 and below \d+ .* Received \(",
        ),
        (
            lambda s: {"inputs": (F(-1), *s.inputs[1:])},
            "bounds of the inputs must be given, and each must be 0 or more, .* Received -1",
        ),
        (lambda s: {"inputs": ()}, "bounds of the inputs must be given, and each must be 0 or more, .* Received none"),
    ],
)
def test_the_condition_that_a_set_misses_is_named(wrong, said):
    found = claim().invariant_set
    with pytest.raises(ParameterError, match=said):
        replace(found, **wrong(found))


@pytest.mark.parametrize("wrong", [{"inputs": (0.5,)}, {"facets": ((None,),)}, {"between": (((1.5,),),)}])
def test_a_set_is_made_of_rationals_and_whole_numbers(wrong):
    with pytest.raises(ParameterError, match=f"{next(iter(wrong))} of InvariantPolytope must be a tuple of"):
        replace(claim().invariant_set, **wrong)


# ---------------------------------------------------------------- what the standalone checker reads


def loop_of(rank):
    """A loop of so many states that all pass a sample, with two inputs and three outputs."""
    unit = checker.unit(rank)
    return checker.Loop(checker.zeros(rank), [(unit, F(1))], [unit[0]] * 3, [unit[0]] * 2, None, F(1), longest=F(2))


def set_of(facets, rank=2, sampled=1, between=1, **given):
    """A set with so many facets, and so many pieces at the samples and between them."""
    basis = list(range(rank))
    rows = [["0"] * (i % rank) + ["1"] + ["0"] * (rank - 1 - i % rank) for i in range(facets)]
    parts = {"at_samples": [[basis] * (sampled + 1)] * facets, "between": [[basis] * (between + 1)] * 3}
    return {"inputs": ["1", "0"], "facets": rows} | parts | given


def test_a_set_is_read_up_to_its_limits():
    for value, rank in (
        (set_of(2), 2),
        (set_of(400), 2),
        (set_of(6, rank=6), 6),
        (set_of(2, sampled=32, between=32), 2),
        (set_of(397, sampled=9, between=9), 2),  # 397·10 + 3·10 bases
    ):
        assert len(checker.read_reach(value, loop_of(rank)).facets) == len(value["facets"])


@pytest.mark.parametrize(
    ("value", "rank", "said"),
    [
        (set_of(1), 2, "2 to 400 facets"),
        (set_of(401), 2, "2 to 400 facets"),
        (set_of(2) | {"facets": 5}, 2, "2 to 400 facets"),
        (set_of(2, inputs=["1", "-1/9"]), 2, "bounds of the inputs must be >= 0"),
        (set_of(7, rank=7), 7, "at most 6 entries"),
        (set_of(397, sampled=9, between=10), 2, "at most 4000 bases"),
        (set_of(2, at_samples=5), 2, "at_samples must have 2 rows"),
        (set_of(2, at_samples=[[[0, 1]] * 2]), 2, "at_samples must have 2 rows"),
        (set_of(2, at_samples=[[[0, 1]] * 2, 5]), 2, "at_samples must be rows"),
        (set_of(2, at_samples=["ab", "ab"]), 2, "at_samples must be rows"),
        (set_of(2, sampled=0), 2, "1 to 32 pieces"),
        (set_of(2, sampled=33), 2, "1 to 32 pieces"),
        (set_of(2, at_samples=[[[0, 1]] * 2, [[0, 1]] * 3]), 2, "the same pieces in every row"),
        (set_of(2, at_samples=[[[0, 1], "01"], [[0, 1]] * 2]), 2, "must name 2 facets each time"),
        (set_of(2, at_samples=[[[0, 1], {0: 1, 1: 1}], [[0, 1]] * 2]), 2, "must name 2 facets each time"),
        (set_of(2, at_samples=[[[0, 1], [0]], [[0, 1]] * 2]), 2, "must name 2 facets each time"),
        (set_of(2, at_samples=[[[0, 1], [0, 2]], [[0, 1]] * 2]), 2, "must name facets by their numbers"),
        (set_of(2, at_samples=[[[0, 1], [0, -1]], [[0, 1]] * 2]), 2, "must name facets by their numbers"),
        (set_of(2, at_samples=[[[0, 1], [0, True]], [[0, 1]] * 2]), 2, "must name facets by their numbers"),
    ],
)
def test_a_set_beyond_a_limit_is_refused_by_the_standalone_checker(value, rank, said):
    with pytest.raises(checker.Refused, match=said):
        checker.read_reach(value, loop_of(rank))


def test_the_share_of_an_input_is_that_of_its_bound_and_none_of_one_that_is_zero(monkeypatch):
    """Of a: (1/2)·e1 + 1·e2 + (1/4)·v = 3/2 + 1 + 1 of 7; of d: 1/5 of e2, or none where its bound is 0."""
    asked = []
    monkeypatch.setattr(checker.Between, "__init__", lambda *_: None)
    monkeypatch.setattr(checker.Between, "outputs", lambda *_: [F(3), F(1), F(4)])
    task = checker.read_task(json.loads(text()))
    task = replace(task, s=(F(-1), F(0)), w=(F(1), F(3)), beta=(F(1), F(3, 2)))
    for coupling, bound, small in ((F(1, 5), F(1, 4), F(4, 5)), (F(0), F(0), F(1, 2))):
        given = F(1), F(0), coupling, F(1, 3)
        monkeypatch.setattr(checker, "inputs", lambda _, half, given=given: asked.append(half) or given)
        found = checker.bounds_within(task, loop_of(2), checker.Reach([F(7), bound], [], [], []))
        assert found == ([3, 1, 4 + F(1, 3)], small)
    assert asked == [F(1, 4), F(1, 4)]
