"""A multiplier that is not positive turns every false inequality into an identity: each checker refuses it."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.certificates import Certificate, Witness, loop_of
from quakedesign.certificates.obligations import Obligation, claimed, different
from quakedesign.certificates.witnesses import proves
from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError
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
