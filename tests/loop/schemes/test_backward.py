"""A law at the end of the step, by hand."""

import sympy as sp

from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, authority, rate_error, slip_error, step
from quakedesign.loop.schemes.implicit import backward_euler, end_rate, end_slip, inclusion

ONE, TWO = sp.symbols("xi_1 xi_2", real=True)
ERRORS = -2 * slip_error - 3 * rate_error


def same(found, expected):
    return len(found) == len(expected) and all(sp.expand(a - b) == 0 for a, b in zip(found, expected, strict=True))


def test_every_integral_state_has_the_one_before_it_at_the_end():
    law = DiscreteLaw(ERRORS - 5 * ONE - 7 * TWO, (slip_error, ONE + TWO + rate_error), (ONE, TWO))
    first = ONE + step * end_slip
    second = TWO + step * (first + TWO + end_rate)
    pull = step * authority * (-2 * end_slip - 3 * end_rate - 5 * first - 7 * second)
    assert same(backward_euler(law), (pull, 0, first, second))


def test_states_are_replaced_at_once_whatever_they_are_called():
    """Those before come later in the alphabet."""
    last, middle, first = sp.symbols("a b c", real=True)
    law = DiscreteLaw(ERRORS - middle - last, (slip_error, first, middle), (first, middle, last))
    ends = [first + step * end_slip]
    ends.append(middle + step * ends[0])
    ends.append(last + step * ends[1])
    pull = step * authority * (-2 * end_slip - 3 * end_rate - ends[1] - ends[2])
    assert same(backward_euler(law), (pull, 0, *ends))


def test_slip_and_rate_are_taken_at_the_end_where_the_pressure_never_rises_with_them():
    falls = DiscreteLaw(ERRORS - 4 * discrete_law.slip - discrete_law.rate, (), ())
    ahead = -4 * discrete_law.next_reference - discrete_law.next_reference_rate
    assert same(backward_euler(falls), (step * authority * (-6 * end_slip - 4 * end_rate), ahead))
    rises = DiscreteLaw(ERRORS + 4 * discrete_law.slip, (), ())
    pull = step * authority * (-2 * end_slip - 3 * end_rate)
    assert same(backward_euler(rises), (pull, 4 * discrete_law.slip))
    flat = DiscreteLaw(sp.Integer(6), (), ())
    assert same(backward_euler(flat), (0, 6))


def test_the_inclusion_is_of_the_measured_errors():
    found = inclusion(-end_rate)
    assert (found.free, found.pull, found.slip_error, found.step) == (rate_error, -end_rate, slip_error, step)
