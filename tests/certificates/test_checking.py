"""Roots: an interval that does not hold the root proves something about another loop."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.certificates import Certificate, Witness, loop_of
from quakedesign.certificates.obligations import claimed, different
from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.terms import Term

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
    with pytest.raises(CertificateError, match="the range of root does not hold the root of k"):
        proof(gain, low, high).check(MODEL)


@pytest.mark.parametrize(("low", "high"), [("-1", "3/2"), ("3/2", "7/5")])
def test_an_interval_below_zero_or_turned_round_is_refused(low, high):
    good = proof("2", "7/5", "3/2")
    loop = replace(good.loop, roots={"root": ("k", (F(low), F(high)))})
    with pytest.raises(CertificateError, match="does not hold the root"):
        replace(good, loop=loop).check(MODEL)
