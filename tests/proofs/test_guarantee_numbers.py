"""Numbers in both checkers of a guarantee: gains, integers with errors and roots, against closed forms."""

from fractions import Fraction as F
from math import factorial
from random import Random

import numpy as np
import pytest
from flint import arb_mat, ctx
from mpmath import mp
from scipy.linalg import expm
from standalone_guarantee import checker

from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact import norms as ball_matrices
from quakedesign.guarantees.exact import norms as package
from quakedesign.guarantees.exact import norms as slowest_mode
from quakedesign.guarantees.exact import small_gain as sector
from quakedesign.guarantees.exact.norms import flow_norms, norms
from quakedesign.laws import ImplicitStep, Power
from quakedesign.loop import PeriodicLoop, Segment


def some(random, low, high, parts):
    return F(random.randint(low, high), parts)


# ---------------------------------------------------------------- gains


def rationals(rows):
    return tuple(tuple(map(F, line)) for line in rows)


def gains_of_both(flow, jumps, durations, entry, row, *, sudden=False):
    """The three outputs of the standalone checker are the same one."""
    named = {"w": tuple(map(F, entry))}
    jumps, flow = list(map(rationals, jumps)), rationals(flow)
    ours = norms(
        PeriodicLoop(
            states=tuple(f"x{i}" for i in range(len(flow))),
            flow=flow,
            segments=tuple(Segment(jump=j, duration=F(d)) for j, d in zip(jumps, durations, strict=True)),
            inputs={} if sudden else named,
            outputs={"other": (F(0),) * len(flow), "y": tuple(map(F, row))},
            sampled=named if sudden else {},
        )
    )["y", "w"]
    lists = lambda rows: [list(line) for line in rows]  # noqa: E731
    events = [(lists(j), F(d)) for j, d in zip(jumps, durations, strict=True)]
    outputs = [[F(0)] * len(flow), list(map(F, row)), [2 * F(v) for v in row]]
    loop = checker.Loop(lists(flow), events, outputs, [], None, sum(map(F, durations)))
    zeros, theirs, twice = checker.gains(loop, list(named["w"]), sudden)
    assert max(zeros) < F(1, 10**30)
    assert all(abs(b - 2 * a) < F(1, 10**30) for a, b in zip(theirs, twice, strict=True))
    return ours, theirs


def both_are(found, exact, share=F(1, 10**20)):
    """Whether the gains that both found bound the exact ones from above, and closely."""
    return all(e <= v <= e + (abs(e) + 1) * share for gains in found for v, e in zip(gains, exact, strict=True))


def chain(size):
    return [[int(j == i + 1) for j in range(size)] for i in range(size)]


def test_the_area_of_a_parabola_between_ends_of_pieces_is_exact():
    """Reset at every sample; the response 8σ − σ²/2 is concave and its curvature 1 what is known of it."""
    flow, nothing = chain(3), [[0] * 3] * 3
    found = gains_of_both(flow, [nothing], [8], [0, 8, -1], [1, 0, 0])
    area = lambda t: F(4 * t**2) - F(t**3, 6)  # noqa: E731
    falls = [8 - i + 1 for i in range(8)]  # |c|·e^{Mh}·|Ab|, with e^{M} = 1 + M + M²/2
    assert both_are(found, [area(i + 1) + F(falls[i], 8) for i in range(8)])


def test_what_enters_with_the_sample_peaks_between_the_ends_of_a_piece():
    """9θ − θ² has its peak at 4.5, in the middle of the fifth piece, h²/8·2 above both ends."""
    found = gains_of_both(chain(3), [[[0] * 3] * 3], [8], [0, 9, -2], [1, 0, 0], sudden=True)
    ends = [9 * t - t**2 for t in range(9)]
    assert both_are(found, [max(ends[i : i + 2]) + F(1, 4) for i in range(8)])


def test_what_is_earlier_peaks_between_the_ends_of_a_piece():
    """An input of the last period, T·v in all, comes with the jump and makes (9θ − θ²)·T."""
    jump = [[0, 0, 0, 0], [0, 0, 0, 9], [0, 0, 0, -2], [0, 0, 0, 0]]
    flow = [[*line, 0] for line in chain(3)] + [[0] * 4]
    found = gains_of_both(flow, [jump], [8], [0, 0, 0, 1], [1, 0, 0, 0])
    ends = [9 * t - t**2 for t in range(9)]
    assert both_are(found, [8 * (max(ends[i : i + 2]) + F(1, 4)) for i in range(8)])


def test_what_is_earlier_falls_while_what_is_new_rises():
    """7·8(1 − θ/16) + 8θ − θ²/2 has its peak at 4.5 as well."""
    jump = [[0, 0, 7], [0, 0, F(-7, 16)], [0, 0, 0]]
    found = gains_of_both([[0, 1, 0], [0, 0, 0], [0, 0, 0]], [jump], [8], [8, -1, 1], [1, 0, 0])
    ends = [56 * (1 - F(t, 16)) + 8 * t - F(t**2, 2) for t in range(9)]
    assert both_are(found, [max(ends[i : i + 2]) + F(1, 8) for i in range(8)])


@pytest.mark.parametrize("sudden", [False, True])
@pytest.mark.parametrize("time", [8, F(1, 64)])
@pytest.mark.parametrize("share", ["624/10000", "249/1000", "1/3", "-1/3", "9/10"])
def test_the_tail_of_the_past_is_the_rest_of_a_geometric_series(share, time, sudden):
    """x → q·x at every sample: what is left of 1 + |q| + q² … is bounded by the sums so far, of whatever size."""
    q, entry = abs(F(share)), F(time, 8) if sudden else 1
    jump = [["1/100", 0], [0, share]]  # another state forgets sooner
    found = gains_of_both([[0, 0], [0, 0]], [jump], [time], [1, entry], [0, 1], sudden=sudden)
    whole = (entry if sudden else time) * q / (1 - q)
    exact = [whole + (entry if sudden else F(time, 8) * (i + 1)) for i in range(8)]
    assert all(e <= v <= e * (1 + F(1, 10**4)) for gains in found for v, e in zip(gains, exact, strict=True))


@pytest.mark.parametrize("sudden", [False, True])
@pytest.mark.parametrize("quick", ["1/3", "49/50"])  # the second is gone after 512 periods
def test_a_slow_mode_that_several_states_see_counts_as_it_is(quick, sudden):
    """Beside a state that is reset: q = 1 − 2⁻¹⁵ and r, seen by (1, 2) and (1, 1), make qᵏ + rᵏ of the entry."""
    q, r = 1 - F(1, 2**15), F(quick)
    jump = [[0, 0, 0], [0, 2 * r - q, 2 * r - 2 * q], [0, q - r, 2 * q - r]]
    found = gains_of_both([[0] * 3] * 3, [jump], [8], [1, 1, 0], [0, 2, 3], sudden=sudden)
    earlier = q / (1 - q) + r / (1 - r)
    exact = [2 + earlier if sudden else 8 * earlier + 2 * (i + 1) for i in range(8)]
    assert all(e <= v <= e * (1 + F(1, 10**3)) for gains in found for v, e in zip(gains, exact, strict=True))


@pytest.mark.parametrize("sudden", [False, True])
def test_two_flows_of_a_period_follow_each_other(sudden):
    """x → x/2, 8 s, x → x/3, 16 s: parts of both, those before in the same period, and all earlier ones."""
    found = gains_of_both([[0]], [[["1/2"]], [["1/3"]]], [8, 16], [1], [1], sudden=sudden)
    if sudden:
        first = F(1) / (1 - F(1, 6))
        exact = [first] * 8 + [first / 3] * 8
    else:
        before = (16 + F(8, 3)) / (1 - F(1, 6))
        second = (before / 2 + 8) / 3
        exact = [before / 2 + i + 1 for i in range(8)] + [second + 2 * (i + 1) for i in range(8)]
    assert both_are(found, exact, F(1, 10**4))


def test_three_flows_of_a_period_with_bends_count_in_every_one():
    """The area of 8σ − σ²/2 over 8, 4 and 2 s is kept by the jumps, times q once a period, and all else reset."""
    keep, q = [[1, 0, 0], [0, 0, 0], [0, 0, 0]], F(624, 10000)
    times = [8, 4, 2]
    found = gains_of_both(chain(3), [[[q, 0, 0], [0] * 3, [0] * 3], keep, keep], times, [0, 8, -1], [1, 0, 0])
    area = lambda t: 4 * t**2 - F(t**3, 6)  # noqa: E731
    before, exact = q * sum(map(area, times)) / (1 - q), []
    for time in times:
        h = F(time, 8)
        exact += [before + area((i + 1) * h) + (8 - i * h + h) * h**2 / 8 for i in range(8)]
        before += area(time)
    assert both_are(found, exact, F(1, 10**5))


def upper_sum(flow, entry, row, piece):
    """The sums of FORMAT.md in floats: stretches of 64 pieces, twice as long each time, and what is left."""
    size = len(flow)
    a, state = np.array(flow, float), np.column_stack([np.eye(size), np.array(entry, float)])
    c, major = np.array(row, float), np.abs(a) - np.diag(np.abs(np.diag(a)))
    major += np.diag(np.maximum(np.diag(a), 0))
    near, sums = expm(major * piece), np.zeros(size + 1)
    while True:
        step = expm(a * piece)
        for _ in range(64):
            after = step @ state
            sums += piece / 2 * (np.abs(c @ state) + np.abs(c @ after))
            sums += piece**3 / 12 * (np.abs(c) @ near @ np.abs(a @ a @ state))
            state = after
        late = sums[:size] @ np.abs(state)
        if (late[:size] <= sums[:size] / 4096).all():
            return sums[size] + late[size] * 4096 / 4095
        near = np.maximum(near, np.abs(step) @ near)
        piece *= 2


SCALE = 2**20
FLOWING = [
    ([[-1]], [1], [1]),
    ([[-3, 1], [1, -2]], [1, -2], [2, 1]),
    ([[-1, 2], [-2, F(-1, 2)]], [1, 1], [1, -3]),
    ([[F(1, 2), 2, 0], [-2, -3, 1], [0, -1, -1]], [0, 1, 0], [1, 0, 1]),
]


@pytest.mark.parametrize(("flow", "entry", "row"), FLOWING)
def test_gains_in_continuous_time_are_the_sums_that_are_written_down(flow, entry, row):
    largest, first = max(sum(map(abs, line)) for line in flow), F(1)
    pieces = {}
    for name, share in (("package", F(1, 4096)), ("standalone", F(1, 64))):
        while first * largest > share or (name == "package" and first * largest == share):
            first /= 2
        pieces[name], first = float(first), F(1)
    named = tuple(map(F, entry))
    ours = PeriodicLoop(
        states=tuple(f"x{i}" for i in range(len(flow))), flow=rationals(flow), segments=(),
        inputs={"first": named[::-1], "w": named}, outputs={"z": tuple(map(F, row[::-1])), "y": tuple(map(F, row))},
    )  # fmt: skip
    found = flow_norms(ours)
    assert found.keys() == {(y, w) for y in "zy" for w in ("first", "w")}
    assert float(found["y", "w"][0]) == pytest.approx(upper_sum(flow, entry, row, pieces["package"]), rel=1e-9)
    for scale in (1, F(SCALE), F(1, SCALE)):  # of the first state: another unit
        units = [scale if i == 0 else 1 for i in range(len(flow))]
        other = [[F(v) * units[j] / units[i] for j, v in enumerate(line)] for i, line in enumerate(flow)]
        outputs = [[F(v) * u for v, u in zip(line, units, strict=True)] for line in (row, row[::-1])]
        loop = checker.Loop(other, [], outputs, [], None, F(0))
        given = [F(v) / u for v, u in zip(entry, units, strict=True)]
        (theirs,), (turned,) = checker.gains(loop, given, False)
        assert float(theirs) == pytest.approx(upper_sum(flow, entry, row, pieces["standalone"]), rel=1e-9)
        assert float(turned) == pytest.approx(upper_sum(flow, entry, row[::-1], pieces["standalone"]), rel=1e-9)


def test_the_majorant_has_no_negative_entry():
    flow = rationals([[-2, -3], [4, 5]])
    assert checker.majorant(list(map(list, flow))) == [[0, 3], [4, 5]]
    assert ball_matrices.majorant(ball_matrices.matrix(flow)).tolist() == [[0, 3], [4, 5]]


# ---------------------------------------------------------------- integers with bounds of their errors

UNIT = 1 << checker.BITS
FIXED = [
    (([[0]], UNIT - 1), ([[0]], UNIT - 1)),
    (([[1]], UNIT - 1), ([[0, UNIT - 1]], 0)),
    (([[1]], 0), ([[UNIT - 1]], UNIT - 1)),
    (([[UNIT - 1]], UNIT - 1), ([[1]], 0)),
    (([[3, -5]], 2), ([[UNIT - 1], [7 - UNIT]], 3)),
    (([[UNIT, 1], [-UNIT, UNIT]], 1), ([[1, -1], [UNIT - 1, 1 - UNIT]], UNIT // 3)),
]


@pytest.mark.parametrize(("one", "other"), FIXED)
def test_products_enclose_what_the_factors_enclose(one, other):
    """Worst of all corners: |Σ (a ± e)(b ± f)/2^BITS − entry| ≤ error, and not much less."""
    found = checker.Fixed(*one) * checker.Fixed(*other)
    room = []
    for i, line in enumerate(one[0]):
        for j, entry in enumerate(found.rows[i]):
            column = [row[j] for row in other[0]]
            corners = [[(a + s * one[1]) * (b + t * other[1]) for s in (-1, 1) for t in (-1, 1)]
                       for a, b in zip(line, column, strict=True)]  # fmt: skip
            ends = sum(map(min, corners)), sum(map(max, corners))
            room.append(min(found.error - abs(F(end, UNIT) - entry) for end in ends))
    assert 0 <= min(room) <= 3 + max(one[1], other[1]) // UNIT


def test_sums_scales_and_sizes_enclose_what_their_parts_enclose():
    a, b = checker.Fixed([[2, -7]], 2), checker.Fixed([[5, 1]], 3)
    assert checker.Fixed([[2]]).error == 0
    assert (a + b) == checker.Fixed([[7, -6]], 5)
    assert a.scaled(F(1, 3)) == checker.Fixed([[0, -3]], 2)  # 4/3 and −3 at the ends
    assert a.scaled(F(2)) == checker.Fixed([[4, -14]], 6)
    assert a.size() == checker.Fixed([[4, 9]], 0)
    assert a.sums() == [13]
    assert a.beside(b) == checker.Fixed([[2, -7, 5, 1]], 3)
    assert b.above(a, a) == checker.Fixed([[5, 1], [2, -7], [2, -7]], 3)
    assert checker.fixed([[F(1, 3), F(-1, 3)]]) == checker.Fixed([[UNIT // 3, -UNIT // 3]], 1)
    assert checker.column([F(1), F(2)]).rows == [[UNIT], [2 * UNIT]]


@pytest.mark.parametrize("rows", [[[checker.LARGEST + 1], [0]], [[0, -checker.LARGEST - 1]]])
def test_numbers_of_an_absurd_size_are_refused(rows):
    with pytest.raises(checker.Refused, match=r"below 2\^192"):
        checker.bounded(checker.Fixed(rows, 0))
    with pytest.raises(checker.Refused, match=r"below 2\^192"):
        checker.bounded(checker.Fixed([[0]], checker.LARGEST + 1))
    assert checker.bounded(checker.Fixed([[checker.LARGEST]], checker.LARGEST)).error == checker.LARGEST


@pytest.mark.parametrize("bits", [24, 25, 32, 192])
@pytest.mark.parametrize("time", ["1/2", "1", "3", "40"])
def test_exponentials_of_matrices_enclose_their_closed_forms(time, bits, monkeypatch):
    """e^{−t}, a rotation by 2t, the chain 1, t, t²/2, and a fast state beside a slow one, in few bits as well."""
    monkeypatch.setattr(checker, "BITS", bits)
    with mp.workdps(150):
        t = mp.mpf(F(time).numerator) / F(time).denominator
        cases = [
            ([[-1]], [[mp.exp(-t)]]),
            ([[0, 2], [-2, 0]], [[mp.cos(2 * t), mp.sin(2 * t)], [-mp.sin(2 * t), mp.cos(2 * t)]]),
            (chain(3), [[1, t, t**2 / 2], [0, 1, t], [0, 0, 1]]),
            ([[F(-1, 1024), 0], [0, -100]], [[mp.exp(-t / 1024), 0], [0, mp.exp(-100 * t)]]),
        ]
        for flow, exact in cases:
            found = checker.exponential([list(map(F, line)) for line in flow], F(time))
            assert found.error < 2**40
            for line, expected in zip(found.rows, exact, strict=True):
                assert all(abs(e * 2**bits - v) <= found.error for v, e in zip(line, expected, strict=True))


@pytest.mark.parametrize("bits", [8, 9, 10, 11, 12, 64, 192])
def test_a_taylor_sum_has_the_terms_that_its_rest_needs(bits, monkeypatch):
    """2/n! is below a unit for the n terms that are taken, and for no fewer."""
    taken, scaled = [], checker.Fixed.scaled
    monkeypatch.setattr(checker, "BITS", bits)
    monkeypatch.setattr(checker.Fixed, "scaled", lambda term, factor: taken.append(factor) or scaled(term, factor))
    checker.exponential([[F(-1, 2)]], F(1))
    assert taken == [F(1, k) for k in range(1, len(taken) + 1)]
    assert factorial(len(taken)) < 2 ** (bits + 1) <= factorial(len(taken) + 1)


def test_exponentials_of_several_times_enclose_their_closed_forms():
    """e^{−t} and t·e^{−t}, of times with a common grain of 1/24."""
    times = list(map(F, ("1/2", "1/8", "7/12", "1/24", "3", "1/2")))
    with mp.workdps(100):
        found = checker.exponentials([[F(-1), F(1)], [F(0), F(-1)]], times)
        for time, one in zip(times, found, strict=True):
            t = mp.mpf(time.numerator) / time.denominator
            for line, expected in zip(one.rows, ([1, t], [0, 1]), strict=True):
                assert all(
                    abs(e * mp.exp(-t) * UNIT - v) <= one.error < 2**40 for v, e in zip(line, expected, strict=True)
                )


@pytest.mark.parametrize("floor", [F(0), F(1, 3)])
@pytest.mark.parametrize("rate", [F(1, 10), F(7)])
def test_what_fades_is_bounded_on_every_piece_and_closely_on_short_and_on_long_ones(rate, floor):
    """5e^{−λt} + f from α on, over h, and its moment about α, with e^x − Σ x^k/k! ≤ x⁵/120·e^x for k up to 4."""
    fade = checker.Fade(0, F(5), rate, floor)
    with mp.workdps(50):
        for x in map(F, ("0", "1/8", "1/2", "3", "20")):
            height = 5 * mp.exp(-mp.mpf(x.numerator) / x.denominator)
            for share in (F(1, 10**9), F(1), F(3, 2), F(60)):
                length, h = share / rate, mp.mpf(share.numerator) / share.denominator
                area = height * (1 - mp.exp(-h)) / rate.numerator * rate.denominator
                moment = height * (1 - (1 + h) * mp.exp(-h)) / rate.numerator**2 * rate.denominator**2
                constant, linear = floor * length, floor * length**2 / 2
                pairs = zip(checker.mass(fade, x / rate, length), (constant, linear), (area, moment), strict=True)
                for bound, flat, exact in pairs:
                    found = mp.mpf((bound - flat).numerator) / (bound - flat).denominator
                    assert found >= exact * (1 - mp.mpf(10) ** -40)
                    if x <= 1 and share not in (1, F(3, 2)):
                        assert found <= exact / (1 - mp.mpf(x.numerator) ** 5 / x.denominator**5 / 120) * (
                            1 + mp.mpf(10) ** -8
                        )


def test_the_time_since_an_event_goes_on_through_the_end_of_a_period(monkeypatch):
    """Events at 0, 2 and 5 s of 10 s, the time counted from the second on, two pieces each."""
    monkeypatch.setattr(checker, "mass", lambda _, start, length: (start, length))
    same = [[F(1)]]
    loop = checker.Loop([[F(-1)]], [(same, F(2)), (same, F(3)), (same, F(5))], [[F(1)]], [], None, F(10))
    fade = checker.Fade(1, F(1), F(1), F(0))
    flows = checker.cut(loop, [F(0), F(1, 2), F(1)], [F(1)], False, fade)
    assert [flow.masses for flow in flows] == [
        [(8, 1), (9, 1)],
        [(0, F(3, 2)), (F(3, 2), F(3, 2))],
        [(3, F(5, 2)), (F(11, 2), F(5, 2))],
    ]
    flows = checker.cut(loop, [F(0), F(1)], [F(1)], False, checker.Fade(2, F(1), F(1), F(0)))
    assert [flow.masses for flow in flows] == [[(5, 2)], [(7, 3)], [(0, 5)]]
    assert [flow.masses for flow in checker.cut(loop, [F(0), F(1)], [F(1)], False)] == [[], [], []]


def test_a_flow_that_changes_by_an_absurd_factor_is_refused():
    with pytest.raises(checker.Refused, match="norm of at most 4096"):
        checker.exponential([[F(-1)]], F(4097))
    assert checker.exponential([[F(-1)]], F(4096)).rows[0][0] <= checker.exponential([[F(-1)]], F(4096)).error


@pytest.mark.parametrize("q", range(1, 7))
def test_roots_of_integers_are_floors(q):
    for base in (1, 2, 3, 10, 2**30 - 1, 3**20):
        assert [checker.whole_root(base**q + d, q) for d in (-1, 0, 1)] == [base - 1, base, base + (q == 1)]
    assert checker.whole_root(0, q) == 0


# ---------------------------------------------------------------- an implicit step


def plain(terms):
    return [(list(t.factor), t.exponent, t.argument if isinstance(t.argument, str) else plain(t.argument))
            for t in terms]  # fmt: skip


def lower_end(terms, slip, rate):
    """In 100 digits."""
    total = mp.mpf(0)
    for t in terms:
        plain = {"slip": slip, "rate": rate}
        x = plain[t.argument] if isinstance(t.argument, str) else lower_end(t.argument, slip, rate)
        c, a = t.factor[x < 0], mp.mpf(t.exponent.numerator) / t.exponent.denominator
        size = abs(x) ** a if x or not a else mp.mpf(a == 0)
        total += (-size if x < 0 else size) * c.numerator / c.denominator
    return total


def test_both_bound_a_sum_of_powers_from_below():
    random = Random(7)
    powers = [F(0), F(1, 3), F(1, 2), F(2, 3), F(1), F(3, 2), F(6)]

    def term(of):
        return Power(factor=(some(random, 1, 4, 3), some(random, 5, 9, 3)), exponent=random.choice(powers), argument=of)

    for _ in range(60):
        pull = (term("slip"), term("rate"), term((term("slip"), term("rate"))))
        slip, rate = some(random, -5, 5, 7), some(random, -5, 5, 11)
        with mp.workdps(100), ctx.workprec(128):
            exact = lower_end(pull, *(mp.mpf(v.numerator) / v.denominator for v in (slip, rate)))
            theirs = checker.least(plain(pull), slip, rate)
            ours = sector._least(pull, *(ball_matrices.ball(v).lower() for v in (slip, rate)))
            for found in (theirs, F(int(ours.fmpq().p), int(ours.fmpq().q))):
                assert -1e-30 < mp.mpf(found.numerator) / found.denominator - exact <= 1e-80


@pytest.mark.parametrize(("room", "shown"), [(F(1, 2**11), True), (F(1, 2**11) - F(1, 2**40), False)])
def test_lines_are_shown_after_ten_halvings_or_not_at_all(room, shown):
    """q = 2(e1 + T·w), one slope 1/2, T = 1/2: on a part of width δ 2ε − R − δ/2 is left, which 2^−10 just allows."""
    pull = (Power(factor=(F(2), F(2)), exponent=F(1), argument="slip"),)
    for slopes in ((F(1, 2), F(1)), (F(0), F(1, 2))):
        root = ImplicitStep(pull=pull, slopes=slopes, remainder=F(1))
        other = checker.Root(plain(pull), list(slopes), F(1))
        assert sector.sector_is_valid(root, F(1, 2), F(1, 2), 2 - room) == shown
        assert checker.root_within(other, F(1, 2), F(1, 2), 2 - room) == shown


@pytest.mark.parametrize(
    ("slopes", "factor", "room", "shown"),
    [
        ((F(1, 2), F(1)), 1, F(1, 8), False),
        ((F(1, 2), F(1)), 1, F(1, 2), True),
        ((F(1, 2), F(1)), 4, F(1, 2**12), False),  # near the reference
        ((F(0), F(1, 4)), 2, F(1, 4), False),
        ((F(0), F(1, 4)), 2, F(3, 4), True),
    ],
)
def test_lines_that_the_root_leaves_at_one_end_are_not_shown(slopes, factor, room, shown):
    """q = c(e1 + T·w), T = 1/2, u ≤ 1: the lines are (1 + c/2)ε − R − u/4 and, with the slope 1/4, − u/2 above."""
    pull = (Power(factor=(F(factor), F(factor)), exponent=F(1), argument="slip"),)
    rate, half = 1 + F(factor, 2) - room, F(1, 2)
    assert sector.sector_is_valid(ImplicitStep(pull=pull, slopes=slopes, remainder=F(1)), half, half, rate) == shown
    assert checker.root_within(checker.Root(plain(pull), list(slopes), F(1)), half, half, rate) == shown


def test_a_slow_state_that_only_feeds_a_fast_one_counts_to_its_end():
    """(e^{−t/64} − e^{−t})/(1 − 1/64) has the integral 64."""
    loop = checker.Loop([[F(-1), F(1)], [F(0), F(-1, 64)]], [], [[F(1), F(0)]], [], None, F(0))
    ((found,),) = checker.gains(loop, [F(0), F(1)], False)
    assert 64 <= found <= 65


def test_a_state_that_is_not_seen_has_no_part_in_a_gain():
    loop = checker.Loop([[F(-1), F(0)], [F(0), F(-2)]], [], [[F(1), F(0)]], [], None, F(0))
    ((found,),) = checker.gains(loop, [F(1), F(1)], False)
    assert 1 <= found <= F(1001, 1000)


def test_a_bend_that_changes_counts_in_every_piece():
    """σ²/2 − σ³/96 over 8 s, kept by the jump and halved: trapezia, and h³/12 of 1 − i/16 + h/16 on every piece."""
    keep = [["1/2", 0, 0, 0], *[[0] * 4] * 3]
    found = gains_of_both(chain(4), [keep], [8], [0, 0, 1, F(-1, 16)], [1, 0, 0, 0])
    y = [F(t**2, 2) - F(t**3, 96) for t in range(9)]
    areas = [(y[i] + y[i + 1]) / 2 + (1 - F(i, 16) + F(1, 16)) / 12 for i in range(8)]
    steep = F(7) - F(49, 32) + (1 - F(7, 16)) + F(1, 32)  # |c|·e^{Mh}·|A·e^{Aα}b| on the last piece
    assert both_are([gains[-1:] for gains in found], [2 * sum(areas) + steep / 8], F(1, 10**2))
    assert all(gains[-1] >= 2 * sum(areas) for gains in found)


def test_what_enters_with_the_sample_fades_until_the_next():
    """x → x/2 + v at every sample and x′ = −x, 1/2 s: 1 + q + q² …, q = e^{−1/2}/2, just after a sample."""
    found = gains_of_both([[-1]], [[["1/2"]]], ["1/2"], [1], [1], sudden=True)
    exact = 1 / (1 - np.exp(-0.5) / 2)
    assert all(exact <= float(max(gains)) <= exact * 1.001 for gains in found)


def test_what_is_left_of_the_past_counts_with_its_errors():
    """Both products lose less than a unit and are known to two; the rest is rounded up to 1 before."""
    one = checker.Fixed([[UNIT]], 0)
    past = checker.Past(checker.Fixed([[0]], 0), checker.Fixed([[UNIT - 1]], 0), checker.Fixed([[1]], 0))
    assert past.of(one) == [2 + 1 + 2]


def test_gains_of_samples_do_not_depend_on_the_units_of_the_states():
    """x' = u + w; u = −x/2 − z/4 is held over a second, and z is the x that was measured before."""
    flow = [[F(0), F(1), F(0)], [F(0)] * 3, [F(0)] * 3]
    sample = [[F(1), F(0), F(0)], [F(-1, 2), F(0), F(-1, 4)], [F(1), F(0), F(0)]]
    found = []
    for units in ([1, 1, 1], [1, F(2) ** 70, F(2) ** -70], [1, F(2) ** -70, F(2) ** 70]):
        scaled = [
            [[v * units[j] / units[i] for j, v in enumerate(line)] for i, line in enumerate(m)] for m in (flow, sample)
        ]
        loop = checker.Loop(scaled[0], [(scaled[1], F(1))], [[F(1), F(0), F(0)]], [], None, F(1))
        found.append(checker.gains(loop, [F(1), F(0), F(0)], False)[0])
    period = np.array([[0.5, -0.25], [1, 0]])  # of x and z
    largest = sum(abs(np.linalg.matrix_power(period, k)[0, 0]) for k in range(200))
    assert largest <= max(found[0]) <= 1.1 * largest + 1
    assert found[1] == pytest.approx(found[0], rel=1e-15)
    assert found[2] == pytest.approx(found[0], rel=1e-15)


def test_loops_that_forget_nothing_are_refused(monkeypatch):
    monkeypatch.setattr(checker, "STRETCHES", 3)
    monkeypatch.setattr(checker, "DOUBLINGS", 3)
    for flow, events in (([[F(0)]], [([[F(1)]], F(1))]), ([[F(0)]], [])):
        with pytest.raises(checker.Refused, match="nominal loop must be stable"):
            checker.gains(checker.Loop(flow, events, [[F(1)]] * 3, [], None, F(1)), [F(1)], False)


@pytest.mark.parametrize("events", [[([[F(1, 2)]], F(1))], []])
def test_loops_that_take_too_much_work_are_refused(events, monkeypatch):
    loop = checker.Loop([[F(-1)]], events, [[F(1)]] * 3, [], None, F(1))
    assert checker.gains(loop, [F(1)], False)
    monkeypatch.setattr(checker, "MAX_SUMS" if events else "MAX_WORK", 10)
    with pytest.raises(checker.Refused, match=r"must be stable, as shown|takes too long"):
        checker.gains(loop, [F(1)], False)


def test_the_package_proves_nothing_that_takes_the_checker_too_long(monkeypatch):
    """The package stops at half of the work, so that whatever it counts differently is no more."""
    assert 2 * package._MOST_SUMS == checker.MAX_SUMS
    given = [[-1]], [[[F(1, 2)]]], [1], [1], [1]
    gains_of_both(*given)
    package._norms.cache_clear()
    monkeypatch.setattr(package, "_MOST_SUMS", 10)
    with pytest.raises(ParameterError, match="nominal loop must be stable"):
        gains_of_both(*given)


# ---------------------------------------------------------------- the last unit


def test_areas_of_pieces_are_rounded_up_by_less_than_a_unit_each():
    """Trapezia and h³/12·bend, two columns and three pieces, in rationals."""
    random = Random(8)
    for piece in (F(1), F(1, 3), F(5, 7), F(2)):
        for _ in range(20):
            heights, bends = ([random.randint(0, 9) for _ in range(n)] for n in (8, 6))
            sums = [[5, 7]]
            checker.add_areas(sums, checker.Fixed([heights]), checker.Fixed([bends]), piece)
            for k, start in enumerate((5, 7)):
                areas = [(heights[i] + heights[i + 2]) * piece / 2 + bends[i] * piece**3 / 12 for i in range(k, 6, 2)]
                assert 0 <= sums[0][k] - start - sum(areas) < 3
                assert all(v.denominator > 1 for v in areas) or sums[0][k] - start - sum(areas) < 2


@pytest.mark.parametrize("decay", ["1/32", "7/100", "1/5", "1/2"])
@pytest.mark.parametrize("entry", [1, 3, 500, 520, 2000, 10**6])
def test_what_is_left_of_a_past_of_few_units_is_a_small_share_to_the_last_one(entry, decay):
    """S + |Ψ|·x ≤ x exactly, all errors counted, and x hardly larger than that asks for."""
    none = checker.Fixed([[0]])
    whole = checker.Fixed([[int(F(decay) * UNIT)]])
    flow = checker.Flow(none, [], [], [], whole, checker.Fixed([[entry]]), none, set(), True, [])
    found = checker.past([flow], 1)
    ((far,),), ((left,),), (total,) = found.far.size().rows, found.left.rows, found.columns.sums()
    assert total * UNIT + far * left <= left * UNIT
    assert left <= (total + 4) * UNIT // (UNIT - far) + 3
    assert total >= sum(entry * F(decay) ** n for n in range(len(found.columns.rows[0])))


def test_the_slowest_mode_is_seen_alone():
    """Ψ has the modes 1/2 and 1/3, seen by the rows (1, 2) and (1, 1): (1, 2)Ψ = (1, 2)/2."""
    left, right = [[F(1), F(2)], [F(1), F(1)]], [[F(-1), F(2)], [F(1), F(-1)]]
    modes = F(1, 2), F(1, 3)
    rows = [[sum(right[i][k] * modes[k] * left[k][j] for k in (0, 1)) for j in (0, 1)] for i in (0, 1)]
    found = checker.slowest(checker.fixed(rows))
    assert F(found[1], found[0]) == pytest.approx(2, rel=1e-40)
    place, seen, back = checker.seen_alone(found, [1, 1])
    assert (place, seen.rows[0], back.rows[0]) == (1, [UNIT, 0], [UNIT, 0])
    assert seen.rows[1][1] == back.rows[1][1] == UNIT
    assert abs(seen.rows[1][0] - UNIT // 2) < 1 << 20
    assert back.rows[1][0] == -seen.rows[1][0]
    assert checker.seen_alone(found, [3, 1])[0] == 0
    nothing = checker.slowest(checker.Fixed([[0, UNIT], [0, 0]]))
    assert checker.seen_alone(nothing, [1, 1]) == (0, *[checker.Fixed([[UNIT, 0], [0, UNIT]])] * 2)


def test_sums_that_bound_themselves_are_solved_for():
    """x = 10 + x/2 and y = 6 + x/4 + y/4096: 20 and 11·4096/4095."""
    left = [[F(1, 2), F(0)], [F(1, 4), F(1, 4096)]]
    theirs = checker.whole_sums(checker.Fixed([[int(v * UNIT) for v in row] for row in left]), [10 << 50, 6 << 50], 0)
    ours = package._whole(ball_matrices.matrix(left), arb_mat([[10], [6]])).entries()
    found = [[F(v, 1 << 50) for (v,) in theirs.rows], [ball_matrices.upper(v) for v in ours]]
    for slow, quick in found:
        assert 20 <= slow < 20 + F(1, 1 << 27)
        assert F(11 * 4096, 4095) <= quick < F(11 * 4096, 4095) + F(1, 1 << 27)


@pytest.mark.parametrize(
    ("left", "words"),
    [
        ([[1, 0], [0, 0]], "slowest mode"),
        ([[2, 0], [0, 0]], "slowest mode"),
        ([[0, 0], [0, 1]], "must be stable and decay"),
        ([[0, 0], [0, 2]], "must be stable and decay"),
        ([[0, 2], [2, 0]], "must be stable and decay"),
    ],
)
def test_sums_that_grow_beyond_themselves_are_refused(left, words):
    with pytest.raises(checker.Refused, match=words):
        checker.whole_sums(checker.Fixed([[v * UNIT for v in row] for row in left]), [1, 1], 0)
    with pytest.raises(ParameterError, match="not shown to be stable in 4096 periods"):
        package._whole(ball_matrices.matrix(left), arb_mat([[1], [1]]))


@pytest.mark.parametrize("mode", [1, 2])
def test_a_loop_that_grows_or_stays_is_refused_before_anything_is_summed(mode, monkeypatch):
    monkeypatch.setattr(package._Past, "of", None)
    with pytest.raises(ParameterError, match="nominal loop must be stable"):
        gains_of_both([[0]], [[[mode]]], [1], [1], [1])


def test_a_loop_of_two_slow_modes_is_refused(monkeypatch):
    """9/10 and 8/10 after 2³ periods: one alone can be seen as it is."""
    for module in (package, slowest_mode):
        monkeypatch.setattr(module, "MOST_DOUBLINGS", 3)
    monkeypatch.setattr(checker, "DOUBLINGS", 3)
    jump = [[F(9, 10), F(0)], [F(0), F(8, 10)]]
    with pytest.raises(ParameterError, match="not shown to be stable in 8 periods"):
        gains_of_both([[0] * 2] * 2, [jump], [1], [1, 1], [1, 1])
    loop = checker.Loop([[F(0)] * 2] * 2, [(jump, F(1))], [[F(1)] * 2] * 3, [], None, F(1))
    with pytest.raises(checker.Refused, match="shown within 8 periods"):
        checker.gains(loop, [F(1), F(1)], False)


@pytest.mark.parametrize("bits", [24, 27, 32])
@pytest.mark.parametrize("sudden", [False, True])
def test_gains_in_few_bits_are_bounds_of_the_same_sums(bits, sudden, monkeypatch):
    """Areas of 8σ − σ²/2, or its heights, kept by the jump and halved: what is rounded is rounded outward."""
    monkeypatch.setattr(checker, "BITS", bits)
    flow, keep = [list(map(F, line)) for line in chain(3)], [[F(1, 2), F(0), F(0)], [F(0)] * 3, [F(0)] * 3]
    loop = checker.Loop(flow, [(keep, F(8))], [[F(1), F(0), F(0)]] * 3, [], None, F(8))
    found = checker.gains(loop, [F(0), F(8), F(-1)], sudden)
    if sudden:
        heights = [8 * t - F(t**2, 2) for t in range(9)]
        sums = [heights[8] + max(heights[i : i + 2]) + F(1, 8) for i in range(8)]
    else:
        areas = [4 * t**2 - F(t**3, 6) for t in range(9)]
        sums = [areas[8] + areas[i + 1] + F(8 - i + 1, 8) for i in range(8)]
    for line in found:
        assert all(e <= v <= e * F(1001, 1000) + F(2**31, 2**bits) for v, e in zip(line, sums, strict=True))


@pytest.mark.parametrize("bits", [24, 27, 32])
def test_gains_in_continuous_time_in_few_bits_are_bounds(bits, monkeypatch):
    """∫ t·e^{−t} dt = 1 and ∫ |1 − t|e^{−t} dt = 2/e."""
    monkeypatch.setattr(checker, "BITS", bits)
    flow = [[F(0), F(1)], [F(-1), F(-2)]]
    found = checker.gains(checker.Loop(flow, [], [[F(1), F(0)], [F(0), F(1)]], [], None, F(0)), [F(0), F(1)], False)
    for (gain,), exact in zip(found, (1, 2 / np.e), strict=True):
        assert exact <= gain <= exact * 1.001 + 2.0 ** (20 - bits)


# ---------------------------------------------------------------- elimination


@pytest.mark.parametrize(
    ("table", "square"),
    [([[1]], 1), ([[0, 9], [1, 0]], 9), ([[0, 0], [0, 0]], 0), ([[0, 5], [0, 0]], 0), ([[1, 1], [1, 1]], 4)],
)
def test_radii_known_by_hand_are_bounded_closely(table, square):
    """Squares of the spectral radii."""
    found = checker.radius([list(map(F, line)) for line in table])
    assert square <= found**2 <= square + F(1, 10**12)


def test_a_radius_of_one_is_refused_and_a_smaller_one_solved():
    for table in ([[F(1)]], [[F(0), F(1)], [F(1), F(0)]], [[F(0), F(9)], [F(1), F(0)]]):
        with pytest.raises(checker.Refused, match="small gain must be below 1"):
            checker.solve(table, [F(1)] * len(table))
    assert checker.solve([[F(0), F(1, 2)], [F(1, 2), F(0)]], [F(3), F(0)]) == [4, 2]


@pytest.mark.parametrize(("gain", "said"), [("1", "It is 1.0"), ("3/2", "It is 1.5"), ("999/1000", None)])
def test_a_small_gain_that_is_not_below_one_is_named(gain, said):
    """Only friction's slope in slip is uncertain, by ±1, and only its own gain is not zero."""
    zero, one = F(0), F(1)
    task = checker.Task(
        name="a", b=one, s=(-one, one), w=(zero, zero), beta=(one, one), normal_stress=one,
            rest=(zero, zero), reference_rate=zero,
        reference_acceleration=zero, reference_jerk=zero, smooth=True, reference_force=zero, drift=zero, amplitude=one,
        change=None, slope_of_beta=zero, steady_beta=True,
    )  # fmt: skip
    loop = checker.Loop([], [([], one)], [[]] * 3, [[], []], None, one)
    found = [[[F(gain)], [zero], [zero]], [[zero], [zero], [zero]]]
    if said:
        with pytest.raises(checker.Refused, match=said):
            checker.of_class(task, loop, found)
    else:
        assert checker.of_class(task, loop, found)[0] == [999, 0, 0]


def test_of_a_disturbance_of_bounded_rate_what_the_gains_range_leaves_counts():
    """β ∈ [1, 3] may jump: (1 − β/2)φ stays in a, half of 6 m/s², p* is shifted by φ/2, and w has another range."""
    zero, one = F(0), F(1)
    task = checker.Task(
        name="a", b=one, s=(zero, zero), w=(zero, F(8)), beta=(one, F(3)), normal_stress=one,
            rest=(zero, zero), reference_rate=zero,
        reference_acceleration=zero, reference_jerk=zero, smooth=True, reference_force=zero, drift=zero, amplitude=F(6),
        change=zero, slope_of_beta=zero, steady_beta=False,
    )  # fmt: skip
    loop = checker.Loop([], [([], one)], [[]] * 3, [[], []], None, one)
    found = [[[one], [zero], [zero]], [[zero], [zero], [zero]]]
    assert checker.of_class(task, loop, found)[0] == [3, 0, 3]


def entries(random, height, width, bits):
    """Signed, some of them extreme."""
    most = 1 << bits
    return [
        [random.choice([random.randint(-most, most), -most, most - 1, 0]) for _ in range(width)] for _ in range(height)
    ]


@pytest.mark.parametrize(("count", "error"), [(63, 0), (64, 0), (64, 1), (200, 5), (200, 1 << 120)])
@pytest.mark.parametrize("bits", [(2, 190), (59, 60), (60, 61), (150, 100), (190, 192), (200, 191)])
def test_sums_of_many_columns_at_once_are_above_those_that_are_true_and_just_above(count, error, bits):
    """Against exact sums for the worst true entries: each entry `error` farther from 0, all products of one sign."""
    random = Random(count + bits[0])
    left = checker.Fixed(entries(random, 3, 20, bits[0]), error)
    right = checker.Fixed(entries(random, 20, count, bits[1]), 2 * error)
    found = checker.sums_of_product(left, right)
    for row, value in zip(left.rows, found, strict=True):
        columns = list(zip(*right.rows, strict=True))
        plain = sum(abs(sum(map(int.__mul__, row, column))) for column in columns)
        off = sum(
            error * abs(v) + 2 * error * abs(u) + 2 * error**2
            for column in columns
            for u, v in zip(row, column, strict=True)
        )
        assert plain + off <= value << checker.BITS
        read = sum(max(bits + 1 - 60, 0) for bits in bits)  # what is cut off, with half of every place
        assert value << checker.BITS <= plain + 2 * off + 64 * count * (1 << 64 + read) + (4 * count << checker.BITS)


def test_the_slowest_mode_is_seen_in_any_units():
    """Two modes that turn, 3/5 and 4/5 of 0.9: other units of the states change the row, but not which it is."""
    turn = [[F(54, 100), F(-72, 100), F(1, 9)], [F(72, 100), F(54, 100), F(1, 5)], [F(0), F(0), F(1, 2)]]
    places = []
    for units in ([F(1)] * 3, [F(1), F(64), F(1, 8)], [F(1 << 20), F(1), F(1)]):
        rows = [[v * b / a for v, b in zip(row, units, strict=True)] for row, a in zip(turn, units, strict=True)]
        seen = checker.slowest(checker.fixed(rows))
        scale = [F(v) / u for v, u in zip(seen, units, strict=True)]
        places.append([float(v / max(scale, key=abs)) for v in scale])
    assert places[0] == pytest.approx(places[1], rel=1e-9)
    assert places[0] == pytest.approx(places[2], rel=1e-9)


@pytest.mark.parametrize("states", [1, 100])
def test_all_that_is_cut_off_counts(states):
    """Of 100 states what is cut off the entries is most; of one, whose entries lose nothing, half of every place."""
    random, much = Random(1), (1 << 192) - 1
    left = [much] * states if states > 1 else [((1 << 60) - 1) << 2]
    right = [much] * 99 if states > 1 else [random.randint(1 << 59, (1 << 60) - 1) << 132 for _ in range(99)]
    (found,) = checker.sums_of_product(checker.Fixed([left]), checker.Fixed([right] * states))
    assert sum(left) * sum(right) <= found << checker.BITS <= sum(left) * sum(right) * F(10**6 + 1, 10**6)


def test_columns_that_nothing_is_in_add_nothing():
    many = checker.Fixed([[0] * 99 for _ in range(3)])
    assert checker.sums_of_product(checker.Fixed([[1 << 192] * 3]), many) == [99 * 2]
    assert checker.sums_of_product(checker.Fixed([[0] * 3]), checker.Fixed([[1 << 192] * 99] * 3))[0] < 1 << 20


@pytest.mark.parametrize("shape", [(3, 20, 64), (64, 20, 3), (70, 3, 70), (3, 1, 65)])
@pytest.mark.parametrize("bits", [(192, 192), (3, 190), (190, 0), (0, 0)])
def test_products_of_many_columns_and_of_many_rows_are_those_of_integers(bits, shape):
    random, (height, inner, width) = Random(1), shape
    left, right = entries(random, height, inner, bits[0]), entries(random, inner, width, bits[1])
    columns = list(zip(*right, strict=True))
    exact = [[sum(map(int.__mul__, line, column)) for column in columns] for line in left]
    assert checker.long_product(left, right) == exact
    found = checker.Fixed(left, 5) * checker.Fixed(right, 7)
    assert found.rows == [[v >> checker.BITS for v in line] for line in exact]


def test_places_of_a_long_integer_hold_the_largest_sums():
    left, right = [[(1 << 190) - 1] * 20], [[(1 << 193) - 1, 1 - (1 << 193)]] * 20
    assert checker.long_product(left, right) == [[20 * left[0][0] * v for v in right[0]]]
    assert checker.long_product([[-31] * 7], [[127] * 3] * 7) == [[-7 * 31 * 127] * 3]  # 15 bits and a sign


def test_bounds_are_rounded_up_to_whole_units():
    assert checker.times([10, 9, 0], F(1, 3)) == [4, 3, 0]
