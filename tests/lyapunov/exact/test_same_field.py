"""A certificate is about the field of its law: one that differs anywhere is refused before anything is decided."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest
import sympy as sp

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.laws import LoopField, laws
from quakedesign.lyapunov import load_certificate
from quakedesign.lyapunov.exact.certificate import _same_field, limit, touching_cells
from quakedesign.lyapunov.exact.claim import Equilibrium, Loop, loop_of, root_enclosure
from quakedesign.lyapunov.exact.loop_expressions import error_units, unit_ranges
from quakedesign.symbolic.terms import Term

FILES = Path(__file__).parents[3] / "proofs" / "certificates"
CTA, DIA, ELQR = (
    load_certificate(FILES / f"{name}.json").loop
    for name in ("cta_7_5_2.3_1.1", "dia_1.5625_5.248_1.183_0", "elqr_real-fault")
)


def changed(term):
    """The same term with another number, parameter, exponent and kind, in turn."""
    (name, exponent, kind), *rest = term.factors
    yield replace(term, coefficient=2 * term.coefficient)
    yield replace(term, parameters=(*term.parameters, "beta"))
    yield replace(term, factors=((name, exponent + 1, kind), *rest))
    yield replace(term, factors=((name, exponent, {"a": "s", "s": "a"}[kind]), *rest))


def other_fields(loop):
    for part in ("field", "lifts"):
        for state, terms in getattr(loop, part).items():
            whole = getattr(loop, part)
            yield replace(loop, **{part: whole | {state: terms[1:]}})
            yield replace(loop, **{part: whole | {state: (*terms, terms[0])}})
            for i, term in enumerate(terms):
                for new in changed(term) if term.factors else ():
                    yield replace(loop, **{part: whole | {state: (*terms[:i], new, *terms[i + 1 :])}})


@pytest.mark.parametrize("loop", [CTA, DIA, ELQR], ids=lambda loop: loop.law)
def test_the_field_is_that_of_the_law_in_any_order(loop):
    _same_field(loop, None)
    _same_field(loop, loop.law)
    _same_field(loop, laws()[loop.law])
    turned = {
        state: tuple(
            replace(t, parameters=t.parameters[::-1], factors=t.factors[::-1]) for t in reversed(terms)
        )
        for state, terms in loop.field.items()
    }  # fmt: skip
    assert turned != loop.field
    _same_field(replace(loop, field=turned), None)


@pytest.mark.parametrize("loop", [CTA, DIA, ELQR], ids=lambda loop: loop.law)
def test_any_other_field_is_refused(loop):
    others = list(other_fields(loop))
    assert len(others) > 20
    for other in others:
        with pytest.raises(CertificateError, match="the field in the certificate differs from that"):
            _same_field(other, None)


@pytest.mark.parametrize(
    "parts",
    [
        {"states": {"e1": 3, "e2": 2, "e3": 2}},
        {"states": dict(reversed(CTA.states.items()))},
        {"domain": "reals"},
        {"gains": {k: v for k, v in CTA.gains.items() if k != "k4"}},
        {"gains": CTA.gains | {"k5": F(1)}},
        {"constants": {"c": F(1)}},
        {"uncertain": {"beta": CTA.uncertain["beta"]}},
        {"uncertain": CTA.uncertain | {"q": (F(0), F(1))}},
        {"law": "dia"},
        {"law": "unheard-of"},
    ],
    ids=lambda parts: next(iter(parts)),
)
def test_other_names_weights_and_domains_are_refused(parts):
    with pytest.raises(CertificateError):
        _same_field(replace(CTA, **parts), None)


def test_another_law_is_refused_and_a_field_has_no_name():
    with pytest.raises(CertificateError, match="is about 'cta', not 'dia'"):
        _same_field(CTA, "dia")
    field = laws()["cta"].loop_field()
    _same_field(CTA, field)
    _same_field(replace(CTA, law="own"), field)
    with pytest.raises(CertificateError, match="own"):
        _same_field(replace(CTA, law="own"), None)
    with pytest.raises(CertificateError, match="differ from those of"):
        _same_field(DIA, field)


def test_the_root_of_another_gain_is_refused():
    (name, (of, ends)), *_ = DIA.roots.items()
    other = next(gain for gain in DIA.gains if gain != of)
    with pytest.raises(CertificateError, match="the field in the certificate differs from that"):
        _same_field(replace(DIA, roots={name: (other, ends)}), None)
    _same_field(replace(DIA, roots={name: (of, (F(0), F(9)))}), None)  # whether it holds the root is asked elsewhere


# ---------------------------------------------------------------- what a loop is made of


@pytest.mark.parametrize("number", [F(2), F(1, 3), F(10**12 + 1), F(7, 10**15), F(10**30 + 7, 3), F(3, 10**40)])
def test_a_root_lies_within_a_millionth(number):
    low, high = root_enclosure(number)
    assert 0 < low < high
    assert low**2 < number < high**2
    assert high - low <= low / 10**5


@pytest.mark.parametrize("number", [F(2), F(8), F(3, 2), F(2**15 - 1), F(1, 2**15 + 1), F(2**25 + 1, 2**24 - 1)])
def test_a_root_is_two_millionths_wide_and_no_longer_than_that_takes(number):
    low, high = root_enclosure(number)
    assert low**2 < number < high**2
    assert high - low <= low * F(2, 10**6)
    assert (high - low).numerator == 1
    assert low.numerator.bit_length() <= 21


def test_the_root_of_a_large_number_lies_between_neighbouring_integers():
    assert root_enclosure(F(10**40 + 1)) == (10**20, 10**20 + 1)


def test_a_root_may_be_that_of_a_constant():
    x, c, r = sp.symbols("x c r", real=True)
    model = LoopField(
        states={x: 1}, field={x: -r * x}, gains=(), constants=(c,), uncertain=(), domain="reals", roots={r: c}
    )  # fmt: skip
    assert loop_of("own", model, gains={}, constants={"c": F(49, 4)}, uncertain={}).roots == {
        "r": ("c", (F(7, 2), F(7, 2)))
    }


def test_a_rational_root_is_a_point_and_a_negative_number_has_none():
    assert root_enclosure(F(25, 16)) == (F(5, 4), F(5, 4))
    assert root_enclosure(F(0)) == (0, 0)
    assert root_enclosure(F(1, 49)) == (F(1, 7), F(1, 7))
    with pytest.raises(ParameterError):
        root_enclosure(F(-1))


def test_a_range_must_be_ordered():
    parts = {"law": "own", "gains": {}, "constants": {}, "states": {"x": 1}, "domain": "reals", "field": {"x": ()}}
    Loop(**parts, uncertain={"d": (F(1), F(1))})
    with pytest.raises(ParameterError, match="ordered"):
        Loop(**parts, uncertain={"d": (F(2), F(1))})


def test_units_are_enclosed_and_positive():
    loop = Loop(
        law="own",
        gains={"k": F(3)},
        constants={"c": F(2)},
        states={"x": 1, "y": 1},
        domain="reals",
        uncertain={},
        field={"x": (), "y": ()},
        roots={"r": ("c", (F(7, 5), F(3, 2)))},
    )
    k, r = sp.symbols("k r", real=True)
    found = unit_ranges(loop, {"x": r})
    assert found["y"] == (1, 1)
    low, high = found["x"]
    assert F(7, 5) * (1 - F(1, 10**6)) <= low <= F(7, 5) < F(3, 2) <= high <= F(3, 2) * (1 + F(1, 10**6))
    for bad in (-k, r - F(7, 5), k - 3):
        with pytest.raises(CertificateError, match="positive"):
            unit_ranges(loop, {"x": bad})


def test_cells_touch_a_point_where_its_coordinates_are_zero():
    names = ("e1", "e2", "e3")
    point = dict(zip(names, map(F, (0, -2, 3)), strict=True))
    assert touching_cells(CTA, point) == {
        "+-+": {"e1": 1, "e2": -1, "e3": 1},
        "--+": {"e1": -1, "e2": -1, "e3": 1},
    }
    assert len(touching_cells(CTA, dict.fromkeys(names, F(0)))) == 8


def test_the_limit_of_a_field_by_hand():
    """2 k1 [e1]^(2/3) |e2|^(1/2) with e1 = -v^3, v = 2, and e2 = 9: 2 * 7 * -4 * 3 from any cell with e1 < 0."""
    terms = (Term(F(2), ("k1",), (("e1", F(2, 3), "s"), ("e2", F(1, 2), "a"))), Term(F(5), ("d",), ()))
    point = {"e1": F(-2), "e2": F(3), "e3": F(0)}
    signs = {"e1": -1, "e2": 1, "e3": 1}
    assert limit(terms, CTA, point, signs, {"d": F(1, 10), "beta": F(1)}) == -168 + F(1, 2)
    negative = {"e1": -1, "e2": -1, "e3": 1}
    assert limit(terms, CTA, point, negative, {"d": F(1, 10), "beta": F(1)}) == -168 + F(1, 2)  # |e2| has no sign
    with pytest.raises(CertificateError, match="not polynomial"):
        limit((Term(F(1), (), (("e2", F(1, 3), "s"),)),), CTA, point, signs, {})


def test_a_law_from_outside_may_have_fewer_states():
    x, k = sp.symbols("x k", real=True)
    own = LoopField(states={x: 1}, field={x: -k * x}, gains=(k,), constants=(), uncertain=(), domain="reals")
    loop = Loop(
        law="own", gains={"k": F(1)}, constants={}, states={"x": 1}, domain="reals", uncertain={},
        field={"x": (Term(F(-1), ("k",), (("x", F(1), "s"),)),)},
    )  # fmt: skip
    _same_field(loop, own)
    with pytest.raises(CertificateError, match="the field in the certificate differs from that"):
        _same_field(replace(loop, field={"x": ()}), own)


def test_units_are_those_of_the_model_or_of_the_law_by_its_name():
    root, other = DIA.roots["kappa"][1]
    assert root == other == F(5, 4)
    own = error_units(DIA)
    assert set(own) == set(DIA.states)
    assert own != dict.fromkeys(DIA.states, (F(1), F(1)))
    assert error_units(DIA, laws()["dia"].loop_field()) == own
    assert error_units(replace(DIA, law="own")) == dict.fromkeys(DIA.states, (F(1), F(1)))
    assert error_units(replace(DIA, law="own"), laws()["dia"].loop_field()) == own
    assert error_units(CTA) == dict.fromkeys(CTA.states, (F(1), F(1)))
    assert error_units(DIA, replace(laws()["dia"].loop_field(), units={})) == dict.fromkeys(DIA.states, (F(1), F(1)))


def test_a_loop_is_shown_in_one_short_line_whatever_its_numbers():
    huge = replace(CTA, gains=dict(CTA.gains) | {"k1": F(10) ** 400}, uncertain={"beta": (F(1, 3), F(1))})
    assert repr(huge).startswith("Loop(cta; k1 ≈ 1.00000e+400, k2 ≈ 5, k3 ≈ 2.3, k4 ≈ 1.1; beta in [0.333333, 1]")
    assert repr(replace(CTA, gains={}, uncertain={})) == "Loop(cta)"
    proved = load_certificate(FILES / "cta_7_5_2.3_1.1.json")
    assert "claims positive, decrease" in repr(proved)
    assert len(repr(proved)) < 250
    nothing = replace(
        proved, lyapunov=(), claims={}, witnesses={}, refutation=Equilibrium(parameters={}, point={}, weights={})
    )
    assert repr(nothing).endswith("; refuted by an equilibrium)")
