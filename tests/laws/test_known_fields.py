"""The closed loops that are kept are those that the laws derive."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import UnknownNameError
from quakedesign.laws import LoopField, known_fields, laws
from quakedesign.laws.known_fields import field_of, is_law
from quakedesign.symbolic.terms import Term


def test_every_law_is_derived_again():
    assert known_fields.derived_again() == known_fields.FILE.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", laws())
def test_what_is_read_is_what_the_law_derives(name):
    assert field_of(name) == field_of(laws()[name]) == (name, laws()[name].loop_field().terms)


def test_what_is_not_kept_is_derived(monkeypatch):
    x = sp.Symbol("x", real=True)
    bare = LoopField(states={x: 1}, field={x: -2 * x}, gains=(), constants=(), uncertain=(), domain="reals")
    name, found = field_of(bare)
    assert (name, found.field) == ("custom", {"x": (Term(F(-2), (), (("x", F(1), "s"),)),)})
    expected = field_of("cta")
    monkeypatch.setattr(known_fields, "_stored", dict)
    assert field_of("cta") == expected
    assert is_law("cta")
    assert not is_law("nothing")
    with pytest.raises(UnknownNameError):
        field_of("nothing")
