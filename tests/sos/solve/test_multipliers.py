"""Multipliers that are searched: what powers of the norm do not prove, in any units."""

from fractions import Fraction as F

import pytest
from thinned import few

from quakedesign import sos
from quakedesign.sos.exact.polynomial_files import load, text
from quakedesign.sos.exact.polynomial_text import parse
from quakedesign.sos.solve import engine as multipliers
from quakedesign.sos.solve.engine import searched

MOTZKIN = "{x}^4*{y}^2 + {x}^2*{y}^4 + {z}^6 - 3*{x}^2*{y}^2*{z}^2"
STRETCHED = MOTZKIN.format(x="x", y="(1000*y)", z="(z/100)")


def even_symmetric(variables, a, b, c):
    """Form of Choi, Lam and Reznick (1987): nonnegative where a + b·t + c·t² is at t = 1, …, n."""
    power = {d: "(" + " + ".join(f"{v}^{d}" for v in variables) + ")" for d in (2, 4, 6)}
    return f"{a}*{power[6]} + {b}*{power[4]}*{power[2]} + {c}*{power[2]}^3"


@pytest.mark.slow
def test_a_form_in_other_units_is_proved_though_its_norm_is_no_multiplier():
    assert str(sos.prove(STRETCHED, multiplier="x^2 + y^2 + z^2").verdict) == "not-sos"
    found = sos.prove(STRETCHED, multiplier="auto")
    assert (str(found.verdict), found.check(), found.statement.degree) == ("sos", True, 8)
    asked, proof = load(text(found.statement, found.proof))
    assert (asked, proof) == (found.statement, found.proof)


@pytest.mark.slow
def test_a_form_that_needs_a_quartic_multiplier_is_proved():
    """f(t) = (t − 2)(t − 3): the norm alone is refuted, exactly."""
    form = even_symmetric("xyzw", 6, -5, 1)
    assert str(sos.prove(form, multiplier="x^2 + y^2 + z^2 + w^2").verdict) == "not-sos"
    found = sos.prove(form, multiplier="auto")
    assert (str(found.verdict), found.check(), found.statement.degree) == ("sos", True, 10)


def test_what_is_negative_somewhere_has_no_multiplier():
    names, form = parse(STRETCHED.replace("- 3", "- 4"))
    assert searched(names, form, 2) is None
    assert str(sos.prove(STRETCHED.replace("- 3", "- 4"), multiplier="auto").verdict) == "negative"


@few("top", [2, 4], every=2)
def test_a_multiplier_is_a_sum_of_squares_of_its_degree_in_the_variables_that_occur(top):
    names, form = parse(MOTZKIN.format(x="x", y="y", z="z") + " + 0*w", ("w", "x", "y", "z"))
    multiplier = searched(names, form, top)
    assert {sum(e) for e in multiplier} == {top}
    assert not any(e[0] for e in multiplier)
    assert str(sos.prove(multiplier, variables=names).verdict) == "sos"
    product = sos.prove(form, variables=names, multiplier=multiplier)
    assert (str(product.verdict), product.check()) == ("sos", True)


def test_what_is_not_a_form_has_multipliers_with_a_constant():
    names, polynomial = parse(MOTZKIN.format(x="x", y="(100*y)", z="1"))
    multiplier = searched(names, polynomial, 2)
    assert multiplier[0, 0] > F(0)
    assert str(sos.prove(polynomial, variables=names, multiplier=multiplier).verdict) == "sos"


@pytest.mark.parametrize("values", [[0.0] * 3, [1.0, 1.0, -0.5], [1.0, 1.0, 1e-9]])
def test_what_rounds_to_no_sum_of_squares_is_no_multiplier(values, monkeypatch):
    monkeypatch.setattr(multipliers, "_centred", lambda *_: values)
    names, form = parse(MOTZKIN.format(x="x", y="y", z="z"))
    found = searched(names, form, 2)
    assert found is None or str(sos.prove(found, variables=names).verdict) == "sos"
    assert (found is None) == (min(values) < 0 or not any(values))


def test_forms_in_many_variables_are_not_searched():
    names, form = parse(" + ".join(f"v{i}^2" for i in range(13)) + " + v0*v1 + v2*v3*0")
    assert searched(names, form, 4) is None
