"""Nested powers as polynomial conditions on cells."""

from fractions import Fraction as F

import pytest

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligations
from quakedesign.errors import CertificateError
from quakedesign.symbolic.terms import Term

V = (Term(F(1), (), (("x", F(2), "a"),)),)


def loop(lifts, field, states=("x",)):
    weights = dict.fromkeys(states, 1)
    return Loop(
        law="own", gains={}, constants={}, states=weights, domain="cells", uncertain={}, field=field, lifts=lifts
    )


def power(name, exponent="1", kind="s", factor=1):
    return Term(F(factor), (), ((name, F(exponent), kind),))


def test_an_argument_that_is_zero_on_an_open_set_is_refused():
    """n = x, m = ⌈n⌋ − x ≡ 0: a multiplier that holds m's variable would prove anything."""
    bad = loop({"n": (power("x"),), "m": (power("n"), power("x", factor=-1))}, {"x": (power("x"), power("m"))})
    with pytest.raises(CertificateError, match="vanish on an open set"):
        _ = Obligations(bad, V).cells


def test_a_nested_argument_with_a_state_of_its_own_is_accepted():
    field = {"x": (power("m", factor=-1),), "y": (power("y", factor=-1),)}
    good = loop({"n": (power("x"),), "m": (power("n"), power("y"))}, field, ("x", "y"))
    assert Obligations(good, V).variables == 4


def test_a_lift_without_use_and_one_of_no_degree_are_refused():
    with pytest.raises(CertificateError, match="occurs nowhere"):
        _ = Obligations(loop({"n": (power("x"),)}, {"x": (power("x"),)}), V).cells
    mixed = loop({"n": (power("x"), power("x", "2", "a"))}, {"x": (power("n", factor=-1),)})
    with pytest.raises(CertificateError, match="no form of one positive degree"):
        _ = Obligations(mixed, V).cells


def test_cells_without_interior_are_left_out():
    """⌈x + y⌋ with x, y > 0 cannot be negative: of eight cells two have an interior only with one sign each."""
    field = {"x": (power("n", factor=-1),), "y": (power("y", factor=-1),)}
    cells = Obligations(loop({"n": (power("x"), power("y"))}, field, ("x", "y")), V).cells
    assert [cell.name for cell in cells] == ["+++", "+-+", "+--", "-++", "-+-", "---"]
