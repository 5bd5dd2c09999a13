"""Roots: an interval that does not contain the root proves something about another loop."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest
import sympy as sp

from quakedesign.errors import CertificateError, WorkError
from quakedesign.laws import LoopField
from quakedesign.lyapunov import Certificate, Loop, Verdict, Witness, cached_verdict, load_certificate, loop_of
from quakedesign.lyapunov.exact.certificate import _check_equilibrium, _check_proof, _check_roots
from quakedesign.lyapunov.exact.claim import Equilibrium
from quakedesign.lyapunov.exact.obligations import claimed, different
from quakedesign.lyapunov.search.lyapunov_search import certificate_of
from quakedesign.sos.exact import work_budget as work
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.terms import Term

CATALOGUE = Path(__file__).parents[3] / "proofs" / "certificates"

x, k, root = sp.symbols("x k root", real=True)
MODEL = LoopField(
    states={x: 2}, field={x: -root * SignedPower(x, sp.Rational(1, 2))}, gains=(k,), constants=(), uncertain=(),
    domain="cells", roots={root: k},
)  # fmt: skip


def proof(gain, low, high, claim=F(1, 100)):
    """x' = −√k·⌈x⌋^½ with V = |x|^{3/2}: −V̇ = (3/2)√k·u²; all witnesses are exact for any interval above the claim."""
    loop = loop_of("custom", MODEL, gains={"k": F(2)}, uncertain={})
    loop = replace(loop, gains={"k": F(gain)}, roots={"root": ("k", (F(low), F(high)))})
    lyapunov, claims = (Term(F(1), (), (("x", F(3, 2), "a"),)),), {"positive": F(1, 2), "decrease": claim}
    witnesses = {}
    for one in different(claimed(loop, lyapunov, claims)):
        ((exponents, value),) = one.polynomial.items()
        square = Square(product=(0,) * (exponents[0] % 2), basis=((exponents[0] // 2,),), gram=(value,))
        witnesses[one.name] = Witness(multiplier={(0,): F(1)}, squares=(square,))
    return Certificate(loop=loop, lyapunov=lyapunov, claims=claims, witnesses=witnesses)


@pytest.mark.parametrize(
    ("gain", "low", "high"), [("2", "7/5", "3/2"), ("4", "2", "2"), ("1/4", "1/2", "1"), ("9", "1", "3")]
)  # fmt: skip
def test_an_interval_that_holds_the_root_is_proved(gain, low, high):
    assert str(proof(gain, low, high).check(MODEL)) == "proved"


@pytest.mark.parametrize(
    ("gain", "low", "high"),
    [("2", "3/2", "8/5"), ("2", "1", "7/5"), ("4", "3", "3"), ("1/4", "1/8", "1/4"), ("-4", "2", "2"), ("0", "1", "2")],
    ids=["above the root", "below it", "a wrong point", "the number itself", "of a negative number", "of zero"],
)
def test_an_interval_that_does_not_is_refused_though_every_witness_is_exact(gain, low, high):
    with pytest.raises(CertificateError, match="the range of root does not contain the root of k"):
        proof(gain, low, high).check(MODEL)


@pytest.mark.parametrize(("low", "high"), [("-1", "3/2"), ("3/2", "7/5")])
def test_an_interval_below_zero_or_turned_round_is_refused(low, high):
    good = proof("2", "7/5", "3/2")
    loop = replace(good.loop, roots={"root": ("k", (F(low), F(high)))})
    with pytest.raises(CertificateError, match="does not contain the root"):
        replace(good, loop=loop).check(MODEL)


# ---------------------------------------------------------------- every other condition by itself


def accepted(decide, *given):
    """Whether a condition is met."""
    try:
        decide(*given)
    except CertificateError:
        return False
    return True


@pytest.mark.parametrize(("gain", "low", "high"), [("1", "0", "2"), ("1", "1", "1"), ("1", "0", "1"), ("4", "2", "9")])
def test_ends_may_be_zero_or_the_root(gain, low, high):
    loop = replace(proof("4", "2", "2").loop, gains={"k": F(gain)}, roots={"root": ("k", (F(low), F(high)))})
    assert accepted(_check_roots, loop)
    assert not accepted(_check_roots, replace(loop, gains={"k": F(high) ** 2 + F(1, 1000)}))


def test_a_root_is_that_of_a_positive_number():
    for low, high in (("0", "0"), ("0", "1")):
        loop = replace(proof("4", "2", "2").loop, gains={"k": F(0)}, roots={"root": ("k", (F(low), F(high)))})
        with pytest.raises(CertificateError, match="does not contain the root"):
            _check_roots(loop)


def test_lifts_belong_on_cells():
    loop = replace(proof("4", "2", "2").loop, lifts={"n": ()})
    _check_roots(loop)
    with pytest.raises(CertificateError, match="lifts require the domain 'cells'"):
        _check_roots(replace(loop, domain="reals"))


@pytest.mark.parametrize("claim", [F(0), F(-1)])
def test_a_claim_that_is_not_positive_is_refused_though_every_witness_is_exact(claim):
    with pytest.raises(CertificateError, match="the value of every claim must be positive"):
        proof("4", "2", "2", claim).check(MODEL)


def test_the_claims_are_those_of_the_domain():
    good = proof("4", "2", "2")
    for claims in (
        {"positive": F(1, 2)},
        {"decrease": F(1, 100)},
        good.claims | {"bound_y": F(1)},
        good.claims | {"rate": F(1)},
    ):
        with pytest.raises(CertificateError, match="the claims must be 'positive'"):
            replace(good, claims=claims).check(MODEL)
    rates = {"positive": F(1), "rate": F(1), "decay": F(1)}
    with pytest.raises(CertificateError, match="the claims must be 'positive'"):
        _check_proof(replace(good, loop=replace(good.loop, domain="reals"), claims=rates))


def test_the_function_of_a_proof_has_nothing_uncertain():
    good = proof("4", "2", "2")
    (term,) = good.lyapunov
    with pytest.raises(CertificateError, match="must not depend"):
        replace(good, lyapunov=(replace(term, parameters=("root",)),)).check(MODEL)


def test_witnesses_are_those_of_the_obligations_in_order():
    good = proof("4", "2", "2")
    assert str(good.check(MODEL)) == "proved"
    for witnesses in (
        dict(reversed(good.witnesses.items())),
        good.witnesses | {"more": next(iter(good.witnesses.values()))},
        dict(list(good.witnesses.items())[1:]),
        dict(list(good.witnesses.items())[:1]),
        {},
    ):
        with pytest.raises(CertificateError, match=r"missing|must be those of the distinct obligations"):
            replace(good, witnesses=witnesses).check(MODEL)


def test_the_field_is_compared_before_anything_is_decided():
    other = replace(MODEL, field={x: -2 * root * SignedPower(x, sp.Rational(1, 2))})
    with pytest.raises(CertificateError, match="the field in the certificate differs from that"):
        proof("4", "2", "2").check(other)


def resting(**parts):
    """x' = -⌈x⌋⁰ + d rests at x = 1 where d = 1, and with half of each limit at 0."""
    terms = (Term(F(-1), (), (("x", F(0), "s"),)), Term(F(1), ("d",), ()))
    return Loop(**{
        "law": "own", "gains": {}, "constants": {}, "states": {"x": 1}, "domain": "cells",
        "uncertain": {"d": (F(-1), F(1))}, "field": {"x": terms},
    } | parts)  # fmt: skip


def rest(point=1, weights=None, **parameters):
    given = {name: F(value) for name, value in ({"d": 1} | parameters).items()}
    weights = {"+": F(1)} if weights is None else weights
    return Equilibrium(parameters=given, point={"x": F(point)}, weights=weights)


def test_an_equilibrium_by_hand():
    assert accepted(_check_equilibrium, resting(), rest())
    assert accepted(_check_equilibrium, resting(), rest(-1, {"-": F(1)}, d=-1))
    assert not accepted(_check_equilibrium, resting(), rest(-1, {"-": F(1)}, d=1))


@pytest.mark.parametrize(
    ("loop", "equilibrium", "reason"),
    [
        (resting(domain="reals"), rest(), "the domain 'cells' and a loop without lifts"),
        (resting(lifts={"n": ()}), rest(), "the domain 'cells' and a loop without lifts"),
        (resting(roots={"r": ("d", (F(1), F(1)))}), rest(), "the domain 'cells' and a loop without lifts"),
        (resting(), rest(0, {"+": F(0), "-": F(1)}, d=-1), "away from the origin"),
        (resting(), replace(rest(), point={}), "away from the origin"),
        (resting(), replace(rest(), point={"x": F(1), "y": F(1)}), "away from the origin"),
        (resting(uncertain={"d": (F(-1), F(99, 100))}), rest(), "outside their ranges"),
        (resting(uncertain={"d": (F(101, 100), F(2))}), rest(), "outside their ranges"),
        (resting(), rest(e=1), "outside their ranges"),
        (resting(), replace(rest(), parameters={}), "outside their ranges"),
        (resting(), rest(weights={"+": F(1, 2)}), "convex weights"),
        (resting(), rest(weights={"+": F(1), "-": F(0)}), "convex weights"),
        (resting(), rest(weights={}), "convex weights"),
        (resting(), rest(weights={"-": F(1)}), "convex weights"),
        (resting(), rest(-1, {"-": F(1)}), "does not vanish"),
        (resting(), rest(d=0), "does not vanish"),
    ],
)
def test_what_is_no_equilibrium_is_refused_for_its_reason(loop, equilibrium, reason):
    with pytest.raises(CertificateError, match=reason):
        _check_equilibrium(loop, equilibrium)


def test_a_refutation_is_decided_by_its_equilibrium():
    d = sp.Symbol("d", real=True)
    field = {x: d - SignedPower(x, 0)}
    model = LoopField(states={x: 1}, field=field, gains=(), constants=(), uncertain=(d,), domain="cells")
    loop = loop_of("custom", model, gains={}, uncertain={"d": (F(-1), F(1))})
    assert Certificate(loop=loop, refutation=rest()).check(model) is Verdict.REFUTED
    with pytest.raises(CertificateError, match="does not vanish"):
        Certificate(loop=loop, refutation=rest(d=0)).check(model)


def test_weights_are_convex():
    """y' = 2⌈x⌋⁰ on x = 0, y = 1 rests with half of each side; -1 and 2 also add up to 1, 0 and 1 do not rest."""
    loop = resting(states={"x": 1, "y": 1}, uncertain={}, field={"x": (), "y": (Term(F(2), (), (("x", F(0), "s"),)),)})
    point = {"x": F(0), "y": F(1)}

    def resting_with(left, right):
        weights = {"++": F(right), "-+": F(left)}
        _check_equilibrium(loop, Equilibrium(parameters={}, point=point, weights=weights))

    resting_with("1/2", "1/2")
    with pytest.raises(CertificateError, match="does not vanish"):
        resting_with(0, 1)
    still = replace(loop, field={"x": (), "y": ()})
    _check_equilibrium(still, Equilibrium(parameters={}, point=point, weights={"++": F(1), "-+": F(0)}))
    with pytest.raises(CertificateError, match="convex weights"):
        _check_equilibrium(still, Equilibrium(parameters={}, point=point, weights={"++": F(2), "-+": F(-1)}))


def test_a_proof_that_would_take_too_long_to_check_is_not_found(monkeypatch):
    good = proof("4", "2", "2")
    assert certificate_of(good.loop, good.lyapunov, good.claims, MODEL) is not None
    monkeypatch.setattr(work, "STEPS", 1)
    assert certificate_of(good.loop, good.lyapunov, good.claims, MODEL) is None
    with pytest.raises(WorkError, match="budget of exact arithmetic"):
        good.check(MODEL)


def test_a_verdict_is_found_once_for_all_that_a_certificate_holds(monkeypatch):
    """One number less in a witness, changed in the very object, is another certificate; so is another law."""
    good, asked = load_certificate(CATALOGUE / "cta_7_5_2.3_1.1.json"), []
    check = Certificate.check
    monkeypatch.setattr(Certificate, "check", lambda self, law=None: asked.append(law) or check(self, law))
    assert [cached_verdict(good, law) for law in (None, None, "cta", "cta")] == [Verdict.PROVED] * 4
    assert asked == [None, "cta"]
    name, witness = next(iter(good.witnesses.items()))
    square = witness.squares[0]
    less = replace(square, gram=(square.gram[0] - F(1, 10**9), *square.gram[1:]))
    good.witnesses[name] = replace(witness, squares=(less, *witness.squares[1:]))
    for _ in range(2):
        with pytest.raises(CertificateError, match="does not prove"):
            cached_verdict(good, "cta")
    with pytest.raises(CertificateError, match="is about 'cta', not 'dia'"):
        cached_verdict(load_certificate(CATALOGUE / "cta_7_5_2.3_1.1.json"), "dia")
    assert len(asked) == 5


def test_a_bare_loop_is_decided_each_time():
    assert str(cached_verdict(proof("2", "7/5", "3/2"), MODEL)) == "proved"
