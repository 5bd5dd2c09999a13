"""Upper sums of the standalone checker for uncertain plants: integers by hand, and loops with closed forms."""

import random
from fractions import Fraction as F
from math import exp, log

import pytest
from standalone_guarantee import CHECK

checker = CHECK.beside("guarantee.plant")
ONE = 1 << checker.BITS


def rows(*lines):
    return [[F(v) for v in line] for line in lines]


def loop_of(flow, inputs=(), told=(), start=(), jump=None, times=(1,), outputs=None):
    """A loop with the given flow; every segment begins with the same jump, by default none."""
    n = len(flow)
    jump = rows(*jump) if jump else checker.unit(n)
    return checker.Loop(
        rows(*flow),
        [(jump, F(time)) for time in times],
        rows(*inputs),
        rows(*told),
        rows(*start),
        rows(*(outputs or checker.unit(n))),
    )


# ---------------------------------------------------------------- integers in units of 2^-BITS


@pytest.mark.parametrize(("entry", "part"), [(1, 1), (ONE, 5), (3 * ONE // 4, 5), (ONE - 1, ONE + 1)])
def test_a_product_of_sizes_is_rounded_up_by_at_most_one(entry, part):
    (found,) = checker.times(checker.Fixed([[entry, 2 * entry]]), [part, part])
    assert found - 1 <= F(3 * entry * part, ONE) < found


def test_bounds_are_raised_above_0_by_a_share_of_the_largest():
    assert checker.raised([0, 0]) == [1, 1]
    assert checker.raised([0, 1 << 70, 5]) == [1025, (1 << 70) + 1025, 1030]


@pytest.mark.parametrize(("sizes", "shrinks"), [((ONE - 1, 1), True), ((ONE, 1), False), ((1, ONE), False)])
def test_a_map_shrinks_vectors_if_every_row_sum_is_below_1(sizes, shrinks):
    half = sizes[0] // 2
    assert checker.shrinks(checker.Fixed([[half - sizes[0], half], [0, -sizes[1]]])) == shrinks


def test_bounds_fade_if_no_more_than_a_1024th_of_each_remains():
    def fades(*remains):
        """Whether bounds of 4096 fade of which these parts, up to 1, remain."""
        far = checker.Fixed([[(v - 1) * ONE // 4096 * (i == j) for j in range(2)] for i, v in enumerate(remains)])
        return checker.fades(far, [4096, 4096])

    assert fades(4, 4)
    assert not fades(5, 4)
    assert not fades(4, 5)


def exactly(left, right, lengths):
    """Sums over groups of columns of the largest absolute values of the products, for positive entries."""
    sums, first = [], 0
    for length in lengths:
        columns = range(first, first + length)
        first += length
        largest = (
            sum((a + left.error) * (line[c] + right.error) for a, line in zip(left.rows[0], right.rows, strict=True))
            for c in columns
        )
        sums.append(F(sum(largest), ONE))
    return sums


@pytest.mark.parametrize(
    ("height", "left_bits", "right_bits", "errors"),
    [
        (3, 190, 200, (0, 0)),
        (3, 190, 200, (1 << 185, 0)),
        (3, 190, 200, (0, 1 << 195)),
        (3, 190, 30, (1 << 189, 1 << 29)),
        (3, 20, 20, (1 << 120, 1 << 120)),
        (2000, 190, 200, (0, 0)),
        (2000, 150, 192, (0, 0)),
        (2000, 192, 58, (0, 0)),
    ],
)
def test_packed_products_are_bounds_and_close_to_the_largest_products(height, left_bits, right_bits, errors):
    """Entries of ones in binary lose most when they are cut; with many rows the cuts of all of them add up."""
    draw = random.Random(1)
    mixed = [(1 << right_bits) - 1 - draw.getrandbits(3) for _ in range(height)]
    left = checker.Fixed([[(1 << left_bits) - 1] * height], errors[0])
    right = checker.Fixed([[v, v, v] for v in mixed], errors[1])
    (found,) = checker.grouped(left, right, [1, 2])
    for bound, largest in zip(found, exactly(left, right, [1, 2]), strict=True):
        assert largest <= bound <= largest * (1 + F(1, 1 << 45)) + 64


@pytest.mark.parametrize("cut", [0, 40])
def test_each_part_of_the_error_of_packed_products_counts(cut):
    """|l|·e + d·|r'| with l = 2^120 in 2000 rows: cutting r, cutting l, and both errors, each alone."""
    height, l, r = 2000, 1 << 120, 1 << 57 + cut
    shift = max(120 + 1 + cut - checker.COARSE, 0)  # bits by which rows of `left` are cut

    def bound(left_error, right_error):
        left = checker.Fixed([[l] * height], left_error)
        (found,) = checker.grouped(left, checker.Fixed([[r, 0]] * height, right_error), [1, 1])
        return found[0] * ONE

    plain = height * l * r + height * (l * (1 << cut) + (1 << shift) * ((1 << 57) + 1))
    slack = (2 << checker.HALF + shift) + 2 * ONE
    assert plain <= bound(0, 0) <= plain + slack
    both = plain + height * (l * (1 << 100) + (3 << 90 + cut) * ((1 << 57) + 1) + (3 << 190))
    assert both <= bound(3 << 90, 1 << 100) <= both + slack


# ---------------------------------------------------------------- units of the states


def test_units_of_the_states_balance_rows_and_columns():
    """0 and 2^20 beside each other: units 2^10 and 1 make both 2^10; the diagonal has no part in it."""
    even = checker.in_even_units(loop_of([[1 << 40, 1 << 20], [1, 3]], inputs=[[1, 2]], told=[[3, 4]], start=[[5, 6]]))
    assert even.flow == rows([1 << 40, 1 << 10], [1 << 10, 3])
    assert (even.inputs, even.told) == (rows([F(1, 1 << 10), 2]), rows([F(3, 1 << 10), 4]))
    assert (even.start, even.rows) == (rows([F(5, 1 << 10), 6]), rows([1 << 10, 0], [0, 1]))


def test_a_flow_counts_by_the_time_of_the_period_and_jumps_by_1():
    """2^16·(1/2 + 1/2) in the flow, 2·2^20 in the jumps: the other entry is 2·1, so the ratio is 2^20."""
    loop = loop_of([[0, 1 << 16], [0, 0]], jump=[[1, 1 << 20], [1, 1]], times=("1/2", "1/2"))
    (jump, _), _ = checker.in_even_units(loop).segments
    assert jump == rows([1, 1 << 10], [1 << 10, 1])
    flow = loop_of([[0, 1 << 22], [0, 0]], jump=[[1, 0], [1, 1]], times=("1/4", "1/4"))
    (jump, _), _ = checker.in_even_units(flow).segments  # 2^22·(1/4 + 1/4) and 1 + 1: the ratio is 2^20
    assert jump == rows([1, 0], [1 << 10, 1])
    quick = checker.in_even_units(loop_of([[0, 1 << 40], [1, 0]], times=[F(1, 1 << 20)]))
    assert quick.flow == rows([0, 1 << 20], [1 << 20, 0])  # the time is that of both entries


@pytest.mark.parametrize("flow", [[[0, 1 << 20], [0, 0]], [[0, 0], [1 << 20, 0]], [[1, 0], [0, 1 << 30]]])
def test_states_that_do_not_act_on_each_other_both_ways_keep_their_units(flow):
    assert checker.in_even_units(loop_of(flow)).flow == rows(*flow)


def test_three_states_in_a_chain_have_units_in_proportion():
    """Both neighbours of the middle state: 2^20 and 1 on either side, in opposite directions."""
    even = checker.in_even_units(loop_of([[0, 1 << 20, 0], [1, 0, 1 << 20], [0, 1, 0]]))
    sizes = {v for line in even.flow for v in line if v}
    assert max(sizes) / min(sizes) <= 4


# ---------------------------------------------------------------- loops with closed forms


@pytest.mark.parametrize("pieces", [1, 3, 64])
def test_an_input_held_within_a_period_acts_until_the_next_jump(pieces):
    """x⁺ = 0 at every jump: the peak over a period of 2 is 1 - exp(-2), plus the remainder of the trapezoidal rule."""
    found = checker.responses(loop_of([[-1]], inputs=[[1]], jump=[[0]], times=[2]), pieces)
    exact = 1 - exp(-2)
    h = 2 / pieces
    assert exact <= float(found.inputs[0][0]) <= exact + h**2 / 8 * 2 + h**3 / 12 * 2 * pieces
    assert (found.start, found.told) == ([0], [[]])


def test_impulses_at_the_samples_add_up_over_all_periods():
    """exp(-t) after each sample, 1/(1 - exp(-1/2)) right after one."""
    found = checker.responses(loop_of([[-1]], inputs=[[0]], told=[[1]], times=["1/2"]), 16)
    exact = 1 / (1 - exp(-0.5))
    assert exact <= float(found.told[0][0]) <= exact * (1 + 2e-3)
    assert float(found.inputs[0][0]) < 1e-9


def test_impulses_of_a_second_segment_pass_its_jump():
    """Two segments of 1/4, a jump by 1/2 at each: the noise enters at the first one only."""
    found = checker.responses(loop_of([[-1]], told=[[1]], jump=[["1/2"]], times=["1/4", "1/4"]), 16)
    exact = 1 / (1 - exp(-0.5) / 4)
    assert exact <= float(found.told[0][0]) <= exact * (1 + 2e-3)


@pytest.mark.parametrize("share", [F(1, 1025), F(1, 1030)])
def test_all_periods_after_those_that_are_summed_are_added(share):
    """After 8 periods slightly less than 1/1024 of the response is left, which is more than all that is rounded."""
    rate = F(round(-log(share) / 8 * 10**9) + 1, 10**9)
    found = checker.responses(loop_of([[-rate]], inputs=[[1]]), 64)
    exact = 1 / float(rate)
    assert exact <= float(found.inputs[0][0]) <= exact * (1 + 3e-4)


@pytest.mark.parametrize("rate", ["1/100", "1/20", 3])
def test_slow_and_fast_loops_are_summed_until_they_have_decayed(rate, monkeypatch):
    calls, grouped = [], checker.grouped
    monkeypatch.setattr(checker, "grouped", lambda *given: calls.append(given) or grouped(*given))
    found = checker.responses(loop_of([[-F(rate)]], inputs=[[1]], start=[[2]]), 8)
    exact = 1 / float(F(rate))
    assert exact <= float(found.inputs[0][0]) <= exact * (1 + 0.1)
    assert 2 <= float(found.start[0]) <= 2.2
    assert len(calls) == {"1/100": 128, "1/20": 32, 3: 1}[rate]  # each of 8 periods, doubled until 1/1024 is left


def test_each_input_and_each_state_must_have_decayed():
    """A fast and a slow state, each with an input of its own: neither is cut short by the other."""
    found = checker.responses(loop_of([[-5, 0], [0, F(-1, 20)]], inputs=[[1, 0], [0, 1]], start=[[0, 3]]), 32)
    assert 1 / 5 <= float(found.inputs[0][0]) <= 1 / 5 * 1.02
    assert 20 <= float(found.inputs[1][1]) <= 20 * 1.001
    assert 0 <= float(found.inputs[0][1]) < 1e-9
    assert 3 <= float(found.start[1]) <= 3 * 1.001


def test_a_loop_without_initial_states_starts_at_exactly_0():
    assert checker.responses(loop_of([[-1, 1], [0, -1]], inputs=[[1, 0]]), 4).start == [0, 0]


def sums_of(loop, pieces=1):
    return checker.Sums(loop, pieces)


def test_the_remainder_of_the_trapezoidal_rule_is_that_of_every_piece():
    """h³/12·Σ exp(-ih) over four pieces of 1/4, |A²| = 1 and |exp(Aσ)| ≤ 1 on a piece."""
    sums = sums_of(loop_of([[-1]], inputs=[[1]]), 4)
    _, rest = sums.own(sums.segments[0], sums.entries[0])
    exact = sum(exp(-i / 4) for i in range(4)) / 64 / 12
    assert float(F(rest.rows[0][0], ONE)) == pytest.approx(exact, rel=1e-12)


def test_the_error_of_columns_is_bounded_by_the_sums_for_unit_columns():
    """5 + ⌊3·2⌋ + 1 + ⌊7/2⌋ + 1; a rest of 0 adds nothing."""
    sums = sums_of(loop_of([[-1]], inputs=[[1]]))
    rest = checker.Fixed([[2 * ONE], [0], [ONE // 2]])
    assert sums.whole([[5, 3, 9, 7], [0, 0, 0, 0]], 0, rest, 1) == [5 + 7 + 4, 2]


def test_columns_of_several_periods_have_the_error_of_the_worst(monkeypatch):
    """Two columns of the input and two of the states are mapped over 1 to 7 periods by a shear of up to 4000."""
    given, errors, grouped, product = [], [], checker.grouped, checker.Fixed.__mul__

    def recorded(left, right):
        result = product(left, right)
        if len(result.rows[0]) == 4:
            errors.append(result.error)
        return result

    monkeypatch.setattr(checker, "grouped", lambda a, b, lengths: given.append(b) or grouped(a, b, lengths))
    monkeypatch.setattr(checker.Fixed, "__mul__", recorded)
    checker.Sums(loop_of([[F(-1, 2), 4000], [0, F(-1, 2)]], inputs=[[0, 1]]), 1).found()  # in its own units
    assert len(set(errors)) > 1
    assert given[0].error == max(errors)


# ---------------------------------------------------------------- limits of work, and checks of decay


def columns_at_once(monkeypatch, loop, pieces=1):
    """Number of unit columns that are followed at once."""
    widths = []
    grouped = checker.grouped
    monkeypatch.setattr(checker, "grouped", lambda a, b, lengths: widths.append(lengths) or grouped(a, b, lengths))
    checker.responses(loop, pieces)
    return widths[0][1]  # the second group: that of the unit columns of one state


WORK = 4 * 1 * (3 + 1)  # of a period: rows of two ends, of the state and once more; two columns of the input, a unit


def test_work_is_limited_before_and_while_periods_are_followed(monkeypatch):
    fast = loop_of([[-9]], inputs=[[1]])
    monkeypatch.setattr(checker, "MOST_WORK", 8 * WORK)
    checker.responses(fast, 1)
    monkeypatch.setattr(checker, "MOST_WORK", 8 * WORK - 1)
    with pytest.raises(CHECK.Refused, match="the loop must be smaller"):
        checker.responses(fast, 1)
    slow = loop_of([[F(-1, 2)]], inputs=[[1]])  # 16 periods
    monkeypatch.setattr(checker, "MOST_WORK", 16 * WORK)
    checker.responses(slow, 1)
    monkeypatch.setattr(checker, "MOST_WORK", 16 * WORK - 1)
    with pytest.raises(CHECK.Refused, match="must be stable and decay fast"):
        checker.responses(slow, 1)


SHEARED = [[F(-1, 2), 12], [0, F(-1, 2)]]  # maps of up to 8 periods make some vectors larger, of 16 none


def test_more_periods_are_followed_at_once_until_their_map_shrinks(monkeypatch):
    assert columns_at_once(monkeypatch, loop_of([[F(-1, 2)]], inputs=[[1]])) == 8
    assert columns_at_once(monkeypatch, loop_of(SHEARED, inputs=[[1, 0]])) == 16


def test_periods_at_once_are_limited_by_their_number_and_by_work(monkeypatch):
    loop = loop_of(SHEARED, inputs=[[1, 0]])
    height, columns = 2 * 2 + 2 + 2, 2 + 2  # both outputs at both ends, states twice; two columns of the input, units
    each = height * 2 * (columns + 2)
    monkeypatch.setattr(checker, "AT_ONCE", (8, 8))
    assert columns_at_once(monkeypatch, loop) == 8
    monkeypatch.setattr(checker, "AT_ONCE", (8, 9))
    assert columns_at_once(monkeypatch, loop) == 16
    monkeypatch.setattr(checker, "AT_ONCE", (8, 256))
    monkeypatch.setattr(checker, "MOST_WORK", 32 * each)
    assert columns_at_once(monkeypatch, loop) == 16
    monkeypatch.setattr(checker, "require_fading", lambda *_: None)
    monkeypatch.setattr(checker, "fades", lambda *_: True)
    monkeypatch.setattr(checker, "times", lambda far, part: [0] * len(far.rows))
    monkeypatch.setattr(checker, "MOST_WORK", 16 * each)
    assert columns_at_once(monkeypatch, loop) == 16
    monkeypatch.setattr(checker, "MOST_WORK", 16 * each - 1)
    assert columns_at_once(monkeypatch, loop) == 8


def test_sums_are_closed_by_a_check_of_their_own(monkeypatch):
    """A map that still enlarges some vectors after 8 periods leaves sums that do not bound themselves."""
    monkeypatch.setattr(checker, "fades", lambda *_: True)
    monkeypatch.setattr(checker, "AT_ONCE", (8, 8))
    with pytest.raises(CHECK.Refused, match=r"the nominal loop must be stable and decay$"):
        checker.responses(loop_of(SHEARED, inputs=[[0, 1]]), 1)
    with pytest.raises(CHECK.Refused, match=r"the nominal loop must be stable and decay$"):
        checker.responses(loop_of([[F(-1, 10)]], inputs=[[1]]), 1)
    with pytest.raises(CHECK.Refused, match=r"the nominal loop must be stable and decay$"):
        checker.responses(loop_of([[F(-1, 10), 0], [0, -9]], inputs=[[1, 1]]), 1)  # one of two states has decayed
    with pytest.raises(CHECK.Refused, match="the free response must decay"):
        checker.responses(loop_of([[0, 12], [0, 0]], jump=[["9/10", 0], [0, "9/10"]], start=[[0, 1]]), 1)


def test_a_plant_without_measurements_has_a_loop():
    """No column of C: the law is a clock, here of one state that commands the control."""
    plant = checker.Plant(rows([-1]), rows([1]), [], [(rows([1])[0], F(1))], [], [], [], [F(0)], rows([1]))
    law = checker.Law(F(1), F(0), rows(["1/2"]), [[]], rows([1]), [[]])
    loop = checker.loop_of(plant, law)
    assert loop.flow == rows([-1, 0, 1], [0, 0, 0], [0, 0, 0])
    assert loop.segments == [(rows([1, 0, 0], [0, "1/2", 0], [0, 1, 0]), F(1))]


@pytest.mark.parametrize(("periods", "valid"), [(7, True), (8, False)])
def test_a_loop_of_the_checker_has_at_most_96_states(periods, valid):
    """40 of the plant, 48 of the law, one control, and one for every period of delay."""
    none = [[F(0)] * 40 for _ in range(40)]
    plant = checker.Plant(none, [[F(1)]] * 40, [], [], [], [], [], [F(0)] * 40, [])
    law = checker.Law(F(1), F(periods), [[F(0)] * 48] * 48, [[]] * 48, [[F(0)] * 48], [[]])
    if valid:
        assert len(checker.loop_of(plant, law).flow) == 96
        return
    with pytest.raises(CHECK.Refused, match="the loop must have at most 96 states"):
        checker.loop_of(plant, law)


def test_a_sector_enters_by_its_mean_slope_times_its_entry():
    """entry 2, row 3, slopes 1 and 4: 2·3·5/2 = 15."""
    sector = checker.Sector(rows([2])[0], rows([3, 0])[0], F(1), F(4), None)
    plant = checker.Plant(rows([-20]), rows([1]), rows([1]), [], [], [sector], [F(0)], [F(0)], rows([1]))
    loop = checker.loop_of(plant, checker.Law(F(1), F(0), [], [], [[]], rows([0])))
    assert loop.flow == rows([-5, 1], [0, 0])


def test_claims_of_a_file_are_those_of_the_outputs_and_controls_alone():
    plant = {
        "A": [["-1"]], "B": [["1"]], "C": [["1"]], "disturbances": [{"entry": ["1"], "size": "1"}], "loads": [],
        "sectors": [], "noise": ["0"], "start": ["0"], "outputs": [["1"]],
    }  # fmt: skip
    law = {"step": "1", "delay": "0", "A": [], "B": [], "C": [[]], "D": [["0"]]}
    document = {"format": 1, "kind": "uncertain_plant", "plant": plant, "law": law, "pieces": 4, "inputs": []}
    claims = {"output_1": "11/10", "control_1": "1"}
    assert checker.verify(document | {"claims": claims})
    with pytest.raises(CHECK.Refused, match="the claims must follow"):
        checker.verify(document | {"claims": claims | {"output_1": "99/100"}})
    with pytest.raises(CHECK.Refused, match="claims"):
        checker.verify(document | {"claims": claims | {"output_2": "11/10"}})
    two = {**plant, "B": [["1", "1"]], "sectors": [sector_with_controls("1", "0")]}
    with pytest.raises(CHECK.Refused, match="of a row of the states alone"):
        checker.read_plant(two)


def sector_with_controls(*controls):
    return {"entry": ["1"], "row": ["1", *controls], "slopes": ["0", "1"], "within": "1"}
