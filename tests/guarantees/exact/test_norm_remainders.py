"""Remainders of the bounds of `norms`, on loops for which the bound of the proof is a closed form, and its checks.

A triple integrator is reset by the first jump. A response b1 + b2·σ + b3·σ²/2 exceeds its chords by exactly h³/12·|b3|
on a piece if it is concave, so that the integral up to the end of a piece is exact, and the rest is known in rationals.
"""

from dataclasses import replace
from fractions import Fraction as F
from itertools import pairwise

import mpmath
import pytest
from flint import arb, arb_mat, ctx

from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact import norms as module
from quakedesign.guarantees.exact.norms import flow_norms, free_peaks, norms
from quakedesign.loop import Fading, PeriodicLoop, Segment

CHAIN = ((F(0), F(1), F(0)), (F(0), F(0), F(1)), (F(0),) * 3)
NONE = ((F(0),) * 3,) * 3
ONE = tuple(tuple(F(int(i == j)) for j in range(3)) for i in range(3))
COARSE = (F(0), F(1, 2), F(1))
FIRST, SECOND = F(2), F(3)  # durations


def chain(entry=(), past=None, **more):
    ends = {} if past is None else {"past_ends": past}
    return PeriodicLoop(
        states=("x", "v", "a"),
        flow=CHAIN,
        segments=(Segment(jump=NONE, duration=FIRST, **ends), Segment(jump=ONE, duration=SECOND, **ends)),
        inputs={"w": tuple(map(F, entry))} if entry else {},
        outputs={"x": (F(1), F(0), F(0))},
        **more,
    )


def pieces(duration, count=8):
    return [(duration * i / count, duration * (i + 1) / count) for i in range(count)]


def close(found, exact):
    return found == [pytest.approx(float(v), rel=1e-30, abs=0) for v in exact] or all(
        0 <= a - b <= b * F(1, 10**25) for a, b in zip(found, exact, strict=True)
    )


def test_the_bound_of_a_concave_response_is_its_integral_and_the_distance_of_chords():
    """Between the ends a, b of a piece: h²/8 times the largest slope, and h²/8·|a| of all earlier inputs' curvature."""
    found = list(norms(chain((20, 0, -1)))["x", "w"])
    area = lambda s: 20 * s - s**3 / 6  # noqa: E731
    within = [(b - a) ** 2 / 8 * (a + (b - a)) for a, b in pieces(FIRST)]
    exact = [area(b) + rest for (_, b), rest in zip(pieces(FIRST), within, strict=True)]
    within = [(b - a) ** 2 / 8 * (a + (b - a) + FIRST) for a, b in pieces(SECOND)]
    exact += [area(FIRST + b) + rest for (_, b), rest in zip(pieces(SECOND), within, strict=True)]
    assert close(found, exact)


@pytest.mark.parametrize(("past", "count", "both"), [(None, 8, True), (COARSE, 2, True), (COARSE, 2, False)])
def test_a_convex_response_is_counted_above_its_integral_by_the_pieces_of_past_inputs(past, count, both):
    """Chords lie above by h³/12 on each piece, and as much is added: the pieces of the past are those of the loop."""
    loop = chain((10, 0, 1), past)
    segments = loop.segments if both else (loop.segments[0], replace(loop.segments[1], past_ends=loop.segments[1].ends))
    found = list(norms(replace(loop, segments=segments))["x", "w"])
    area = lambda s: 10 * s + s**3 / 6  # noqa: E731
    above = lambda pairs: sum((b - a) ** 3 / 6 for a, b in pairs)  # noqa: E731
    earlier = above(pieces(FIRST, count))
    exact = []
    for number, duration in enumerate((FIRST, SECOND)):
        for i, (a, b) in enumerate(pieces(duration)):
            own = area(b) + above(pieces(duration)[: i + 1]) + (b - a) ** 2 / 8 * (a + (b - a))
            before = area(FIRST + b) - area(b) + earlier + (b - a) ** 2 / 8 * FIRST
            exact.append(own + before * number)
    assert close(found, exact)


def test_a_sampled_input_lies_within_the_distance_of_its_chords():
    """|20 − θ²/2| of the sample that begins the period, and h²/8 more."""
    found = list(norms(chain(sampled={"w": (F(20), F(0), F(-1))}))["x", "w"])
    exact = [20 - a**2 / 2 + (b - a) ** 2 / 8 for a, b in pieces(FIRST)]
    exact += [20 - (FIRST + a) ** 2 / 2 + (b - a) ** 2 / 8 for a, b in pieces(SECOND)]
    assert close(found, exact)


def test_the_direct_effect_of_an_input_is_added():
    plain = norms(chain((20, 0, -1)))["x", "w"]
    direct = norms(chain((20, 0, -1), feedthrough={("x", "w"): F(1, 3)}))["x", "w"]
    assert [a - b for a, b in zip(direct, plain, strict=True)] == [F(1, 3)] * 16


# ----------------------------------------------------------------------
# Decaying inputs.


def omega(fading, start, length):
    """Ω and Ω′ of the statement."""
    x = fading.rate * start
    height = fading.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)
    mass = height * min(1 / fading.rate, length) + fading.floor * length
    return mass, height * min(1 / fading.rate**2, length**2 / 2) + fading.floor * length**2 / 2


def exact_ball(value, exact):
    return abs(value - arb(exact.numerator) / exact.denominator) < arb(2) ** -40


@pytest.mark.parametrize("rate", [F(1, 7), F(3), F(19)])
@pytest.mark.parametrize("start", [F(0), F(1, 3), F(5)])
def test_the_weights_of_a_piece_are_those_of_the_statement(rate, start):
    """1/λ² or ℓ²/2, the smaller; both are above the integrals of the weight."""
    fading, length = Fading(entry=(F(1),), first=0, height=F(5, 2), rate=rate, floor=F(1, 9)), F(3, 5)
    found = module._weight(fading, start, length)
    for value, exact in zip(found, omega(fading, start, length), strict=True):
        assert exact_ball(value, exact)
    for power, value in enumerate(found):
        lies = mpmath.quad(
            lambda s, p=power: s**p * (2.5 * mpmath.exp(-float(rate) * (float(start) + s)) + 1 / 9), [0, 0.6]
        )
        assert lies <= float(value)


@pytest.mark.parametrize("ends", [tuple(F(i, 8) for i in range(9)), (F(0), F(1, 4), F(1, 3), F(1))])
def test_a_decaying_input_of_a_chain_has_the_bound_of_the_statement(ends):
    """One segment with a reset: all inputs are those since the jump.

    A past piece p adds Ω|x(θ − α)| at both ends, and Ω·h²/8·|a| + Ω′ times the largest slope at its end; the piece
    that contains θ adds at most Ω·max|x|.
    """
    fading = Fading(entry=(F(10), F(1), F(-1)), first=0, height=F(2), rate=F(3), floor=F(1, 9))
    loop = PeriodicLoop(
        states=("x", "v", "a"), flow=CHAIN, segments=(Segment(jump=NONE, duration=SECOND, ends=ends),), inputs={},
        outputs={"x": (F(1), F(0), F(0))}, fading={"w": fading},
    )  # fmt: skip
    parts = [(SECOND * a, SECOND * b) for a, b in pairwise(ends)]
    height = lambda s: 10 + s - s**2 / 2  # noqa: E731
    masses = [omega(fading, a, b - a) for a, b in parts]
    exact = []
    for i, (a, b) in enumerate(parts):
        h = b - a
        start = sum(height(a - parts[p][0]) * masses[p][0] for p in range(i))
        end = sum(height(b - parts[p][0]) * masses[p][0] for p in range(i))
        more = (max(height(F(0)), height(h)) + h**2 / 8) * masses[i][0]
        for p in range(i):
            since, length = a - parts[p][1], parts[p][1] - parts[p][0]
            # |Ae^{Aσ}b| = |1 − σ|, 1, 0; e^{|A|h} adds h to the first for each of the two pieces
            more += h**2 / 8 * masses[p][0] + (abs(1 - since) + h + length) * masses[p][1]
        exact.append(max(start, end) + more)
    assert close(list(norms(loop)["x", "w"]), exact)


def test_a_decaying_input_fades_from_its_segment_on_in_the_order_of_time():
    """An integrator with three segments, reset by the second, from which on the input fades."""
    fading = Fading(entry=(F(1),), first=1, height=F(1), rate=F(9), floor=F(0))
    durations = (F(1), F(2), F(3))
    loop = PeriodicLoop(
        states=("x",), flow=((F(0),),), inputs={}, outputs={"x": (F(1),)}, fading={"w": fading},
        segments=tuple(Segment(jump=((F(int(i != 1)),),), duration=d) for i, d in enumerate(durations)),
    )  # fmt: skip
    found, total, exact, start = norms(loop)["x", "w"], F(0), {}, F(0)
    for number in (1, 2, 0):
        exact[number] = []
        for a, b in pieces(durations[number]):
            total += omega(fading, start + a, b - a)[0]
            exact[number].append(total)
        start += durations[number]
    assert close(list(found), [*exact[0], *exact[1], *exact[2]])


# ----------------------------------------------------------------------
# Continuous loops.


@pytest.mark.parametrize(("pole", "entry"), [(F(1), F(3)), (F(5, 2), F(1, 7))])
def test_the_bound_of_a_lag_is_the_sum_of_its_proof(pole, entry):
    """∫|e^{−pσ}| on stretches of 64 pieces, each twice as long, h³/12·max|y″| more, and the rest by the factor q."""
    loop = PeriodicLoop(states=("x",), flow=((-pole,),), segments=(), inputs={"w": (entry,)}, outputs={"y": (F(1),)})
    with mpmath.workprec(300):
        p, q, h, now, total = mpmath.mpf(pole.numerator) / pole.denominator, mpmath.mpf(2) ** -12, mpmath.mpf(1), 0, 0
        while not h * p < q:
            h /= 2
        while True:
            for i in range(64):
                a, b = (mpmath.exp(-p * (now + h * (i + j))) for j in (0, 1))
                total += h * (a + b) / 2 + h**3 / 12 * p**2 * a
            now, left, h = now + 64 * h, mpmath.exp(-p * (now + 64 * h)), 2 * h
            if left <= q:
                break
        size = mpmath.mpf(entry.numerator) / entry.denominator
        exact = size * total * (1 + left / (1 - q))
        found = flow_norms(loop)["y", "w"][0]
        assert abs(mpmath.mpf(found.numerator) / found.denominator / exact - 1) < mpmath.mpf(10) ** -60


# ----------------------------------------------------------------------
# What makes a bound of all periods one: the checks.


def test_entries_that_exceed_others_are_found():
    """An entry 0 lies under every bound; an equal entry does too."""
    matrix = lambda *entries: arb_mat([list(entries)])  # noqa: E731
    assert module.not_above(matrix(0, 2), matrix(arb(0, 1), 2))
    assert not module.not_above(matrix(1), matrix(arb("0.5")))
    assert not module.not_above(matrix(0, 3), matrix(1, 2))


@pytest.mark.parametrize(("left", "why"), [("2", "the sum does not converge"), ("1", "there is no solution")])
def test_a_sum_over_blocks_that_does_not_converge_has_no_bound(left, why):
    with pytest.raises(ParameterError, match="not shown to be stable in 4096 periods"):
        module._whole(arb_mat([[arb(left)]]), arb_mat([[1]]))


def test_a_sum_over_blocks_that_converges_is_solved():
    found = module._whole(arb_mat([[arb("0.5")]]), arb_mat([[3]]))[0, 0]
    assert 6 <= found <= 6 * (1 + arb(2) ** -31)


def held(*rows):
    """A loop without flow: its states change at jumps every second."""
    size = len(rows)
    return PeriodicLoop(
        states=tuple(f"x{i}" for i in range(size)),
        flow=((F(0),) * size,) * size,
        segments=(Segment(jump=tuple(tuple(map(F, row)) for row in rows), duration=F(1)),),
        inputs={"w": (F(1), *(F(0),) * (size - 1))},
        outputs={"y": (*(F(0),) * (size - 1), F(1))},
    )


@pytest.mark.parametrize("rows", [(["1/2"],), (["1/2", 0], [0, "1/3"])])
def test_a_loop_that_needs_more_products_than_allowed_has_no_bound(monkeypatch, rows):
    """x is halved every second: 2·c·n·(n + r) products for two periods, with n states, c columns and r rows.

    c is that of the ends of eight pieces, r that of the outputs there and of unit rows. The mode that is excited is the
    slowest, which need not decay, so that two periods suffice.
    """
    loop, needed = held(*rows), 2 * 9 * len(rows) * (len(rows) + (9 + len(rows)))
    for most, proved in ((needed, True), (needed - 1, False)):
        module._norms.cache_clear()
        monkeypatch.setattr(module, "_MOST_SUMS", most)
        if proved:
            assert norms(loop)["y", "w"]
        else:
            with pytest.raises(ParameterError, match="not shown to be stable"):
                norms(loop)
    module._norms.cache_clear()


def test_free_responses_that_peak_after_many_periods_are_bounded():
    """A chain of n delays passes its initial state on: y is 1 after n − 1 periods, and 0 before."""
    for size in range(2, 10):
        rows = [[int(j == i - 1) for j in range(size)] for i in range(size)]
        start = ((F(1), *(F(0),) * (size - 1)),)
        assert all(v >= 1 for v in free_peaks(replace(held(*rows), start=start))["y"])


def test_a_free_response_that_grows_has_no_bound_whatever_mode_is_isolated(monkeypatch):
    """The estimate of the slowest mode decides nothing: the rows of W must not grow over K periods."""
    monkeypatch.setattr(module, "slowest", lambda flows: [arb(1)])
    for growth in ("3/2", "-1001/1000"):
        with pytest.raises(ParameterError, match="not shown to be stable in 4096 periods"):
            free_peaks(replace(held([growth]), start=((F(1),),)))


def test_what_bounds_all_later_periods_exceeds_the_first_ones():
    """m of the statement, for a state that is halved: at least its initial value 1, which is exact."""
    with ctx.workprec(128):
        segment = module._SegmentFlow.of(module.BALLS, arb_mat([[0]]), held(["1/2"]).segments[0], past=True)
        _, (far, most) = module._followed(module._Periods([segment]), arb_mat([[1]]))
        assert 1 < most[0] < 1 + arb(2) ** -59
        assert far[0, 0] == arb(2) ** -2  # after two periods
