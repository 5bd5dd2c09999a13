"""A multiplier that is not positive turns every false inequality into an identity: each checker refuses it."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.laws import LoopField
from quakedesign.lyapunov import Certificate, Witness, loop_of
from quakedesign.lyapunov.exact.obligations import Obligation, claimed, different, proves, statement_of, width
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.terms import Term

ONE = Square(basis=((1,),), gram=(F(1),))


@pytest.mark.parametrize("multiplier", [{(0,): F(-1)}, {(2,): F(1), (0,): F(-1)}, {(0,): F(0)}, {(1,): F(0)}, {}])
def test_no_multiplier_but_a_positive_one_proves_that_minus_a_square_is_non_negative(multiplier):
    false = Obligation("false", {(2,): F(-1)})
    squares = {
        1: (ONE,),
        2: (ONE, Square(basis=((2,),), gram=(F(1),))),
    }
    for own in ((), *squares.values()):
        assert not proves(false, Witness(multiplier=multiplier, squares=own), "cells")


def test_the_identity_with_a_negative_multiplier_is_exact_and_refused_for_its_sign_alone():
    # −1·(−u²) = u², and 1·u² = u²
    assert not proves(Obligation("p", {(2,): F(-1)}), Witness(multiplier={(0,): F(-1)}, squares=(ONE,)), "cells")
    assert proves(Obligation("p", {(2,): F(1)}), Witness(multiplier={(0,): F(1)}, squares=(ONE,)), "cells")
    # 0·(−u²) = 0 needs no squares at all
    assert not proves(Obligation("p", {(2,): F(-1)}), Witness(multiplier={(0,): F(0)}), "cells")


x, k = sp.symbols("x k", real=True)
GROWING = LoopField(
    states={x: 2}, field={x: k * SignedPower(x, sp.Rational(1, 2))}, gains=(k,), constants=(), uncertain=(),
    domain="cells",
)  # fmt: skip


def forged():
    """x' = +⌈x⌋^½ runs away; with V = |x|^{3/2}, −V̇ = −(3/2)u², "proved" by the multiplier −1."""
    loop = loop_of("custom", GROWING, gains={"k": F(1)}, uncertain={})
    lyapunov, claims = (Term(F(1), (), (("x", F(3, 2), "a"),)),), {"positive": F(1, 2), "decrease": F(1)}
    witnesses = {}
    for one in different(claimed(loop, lyapunov, claims)):
        ((exponents, value),) = one.polynomial.items()
        square = Square(product=(0,) * (exponents[0] % 2), basis=((exponents[0] // 2,),), gram=(abs(value),))
        witnesses[one.name] = Witness(multiplier={(0,): F(1 if value > 0 else -1)}, squares=(square,))
    return Certificate(loop=loop, lyapunov=lyapunov, claims=claims, witnesses=witnesses)


def test_a_loop_that_runs_away_is_not_proved_by_a_negative_multiplier():
    certificate = forged()
    assert [w.multiplier for w in certificate.witnesses.values()] == [{(0,): F(1)}, {(0,): F(-1)}]
    with pytest.raises(CertificateError, match="does not prove"):
        certificate.check(GROWING)
    settling = replace(GROWING, field={x: -k * SignedPower(x, sp.Rational(1, 2))})
    turned = {name: replace(w, multiplier={(0,): F(1)}) for name, w in certificate.witnesses.items()}
    loop = loop_of("custom", settling, gains={"k": F(1)}, uncertain={})
    claims = {"positive": F(1, 2), "decrease": F(1)}
    good = {}
    for one in different(claimed(loop, certificate.lyapunov, claims)):
        (value,) = one.polynomial.values()
        square = replace(turned[one.name].squares[0], gram=(value,))
        good[one.name] = replace(turned[one.name], squares=(square,))
    assert str(replace(certificate, loop=loop, witnesses=good).check(settling)) == "proved"


# ---------------------------------------------------------------- every rule of a witness by itself


def proved(polynomial, *squares, domain="cells", equalities=(), inequalities=(), **parts):
    given = {"multiplier": {(0,) * len(next(iter(polynomial), (0,))): F(1)}, "conditions": len(inequalities)} | parts
    one = Obligation("p", polynomial, tuple(equalities), tuple(inequalities))
    return proves(one, Witness(squares=squares, **given), domain)


def of(value, *exponents, product=()):
    """One monomial squared, times a number."""
    return Square(product=product, basis=(exponents,), gram=(F(value),))


def test_a_multiplier_is_in_the_variables_of_its_obligation():
    assert proved({(2, 0): F(1)}, of(1, 1, 0))
    assert not proved({(2, 0): F(1)}, of(1, 1), multiplier={(0,): F(1)})
    assert not proved({(2,): F(1)}, of(1, 1, 0), multiplier={(0, 0): F(1)})
    assert not proved({(2,): F(1)}, of(1, 1), multiplier={(0,): F(1), (0, 0): F(1)})
    assert not proved({}, multiplier={(0,): F(1), (0, 0): F(1)})


def test_on_the_reals_the_multiplier_is_one_and_nothing_has_a_sign():
    assert proved({(2,): F(1)}, of(2, 1), multiplier={(0,): F(2)})
    assert not proved({(2,): F(1)}, of(2, 1), multiplier={(0,): F(2)}, domain="reals")
    assert proved({(2,): F(1)}, of(1, 1), domain="reals")
    assert proved({(3,): F(1)}, of(1, 1, product=(0,)))
    assert not proved({(3,): F(1)}, of(1, 1, product=(0,)), domain="reals")
    assert proved({(1,): F(1)}, of(1, 1, product=(0,)), multiplier={(2,): F(1)})
    assert not proved({(1,): F(1)}, of(1, 1, product=(0,)), multiplier={(2,): F(1)}, domain="reals")


def test_conditions_are_counted_and_follow_the_variables():
    """p = a - b + 2 (b - a) = b - a on a >= b and b >= a, in this order."""
    conditions = {(1, 0): F(1), (0, 1): F(-1)}, {(1, 0): F(-1), (0, 1): F(1)}
    p = {(1, 0): F(-1), (0, 1): F(1)}
    first, second = of(1, 0, 0, product=(2,)), of(2, 0, 0, product=(3,))
    assert proved(p, first, second, inequalities=conditions)
    assert not proved(p, first, second, inequalities=conditions[::-1])
    assert not proved(p, first, second, inequalities=conditions, conditions=1)
    assert not proved(p, first, second, inequalities=conditions, conditions=3)
    both = {(1, 1): F(1), (2, 0): F(-1)}  # a (b - a)
    assert proved(both, of(1, 0, 0, product=(0, 3)), inequalities=conditions)


def test_where_nothing_is_to_prove_a_witness_is_empty():
    h, g = ({(1,): F(1)},), ({(1,): F(1)},)
    assert proved({})
    assert proved({}, equalities=h, cofactors=({},))
    assert not proved({}, of(1, 0))
    assert not proved({}, equalities=h)
    assert not proved({}, cofactors=({},))
    assert not proved({}, equalities=h, cofactors=({(1,): F(1)},))
    assert not proved({}, equalities=h * 2, cofactors=({}, {(1,): F(1)}))
    assert not proved({}, of(1, 0, product=(1,)), equalities=h, inequalities=g, cofactors=({(0,): F(-1)},))
    assert not proved({}, multiplier={(0,): F(2)})
    assert not proved({}, multiplier={(1,): F(1)})


def test_the_statement_of_an_obligation():
    one = Obligation("p", {(2, 1): F(1)}, ({(1, 0): F(1)},), ({(0, 1): F(-1)},))
    found = statement_of(one, "cells", {(1, 1): F(1)})
    assert found.degree == 5
    assert found.inequalities == ({(1, 0): 1}, {(0, 1): 1}, {(0, 1): -1})
    assert set(found.products) == {(), (0,), (1,), (0, 1), (2,), (0, 2), (1, 2), (0, 1, 2)}
    plain = statement_of(one, "reals")
    assert plain.multiplier == {(0, 0): 1}
    assert plain.inequalities == ({(0, 1): -1},)
    assert (plain.products, plain.degree) == (((), (0,)), 3)
    assert [width(Obligation("p", *parts)) for parts in (({},), ({}, ({(0, 0): F(1)},)), ({(1, 1, 1): F(1)},))] == [
        1,
        2,
        3,
    ]


def test_one_negative_coefficient_is_too_many():
    """(-u^2 + u - 1)(-u^2) = u^4 - u^3 + u^2 is a square, and the multiplier is negative everywhere."""
    square = Square(basis=((2,), (1,)), gram=(F(1), F(-1, 2), F(1)))
    assert not proved({(2,): F(-1)}, square, multiplier={(2,): F(-1), (1,): F(1), (0,): F(-1)})
    assert proved(
        {(2,): F(1)}, of(1, 2), of(1, 1), of(1, 1, product=(0,)), multiplier={(2,): F(1), (1,): F(1), (0,): F(1)}
    )
