"""Every sign cell counts: loops without odd symmetry, in which no cell repeats another."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.certificates import Certificate, Witness, loop_of
from quakedesign.certificates.obligations import Obligations, claimed, different
from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.terms import Term

x, y = sp.symbols("x y", real=True)
HALF = sp.Rational(1, 2)


def model(*rates):
    states = (x, y)[: len(rates)]
    return LoopField(
        states=dict.fromkeys(states, 2), field=dict(zip(states, rates, strict=True)), gains=(), constants=(),
        uncertain=(), domain="cells",
    )  # fmt: skip


def powers(*rates):
    """Certificate with V = Σ|x_i|^{3/2} and a witness for every obligation that is a positive sum of powers."""
    loop_field = model(*rates)
    loop = loop_of("custom", loop_field, gains={}, uncertain={})
    lyapunov = tuple(Term(F(1), (), ((state, F(3, 2), "a"),)) for state in loop.states)
    claims = {"positive": F(1, 2), "decrease": F(1)}
    witnesses = {}
    for one in different(claimed(loop, lyapunov, claims)):
        squares = tuple(
            Square(product=tuple(i for i, n in enumerate(e) if n % 2), basis=(tuple(n // 2 for n in e),), gram=(c,))
            for e, c in one.polynomial.items()
        )
        if all(c > 0 for c in one.polynomial.values()):
            witnesses[one.name] = Witness(multiplier={(0,) * len(loop.states): F(1)}, squares=squares)
    return loop_field, Certificate(loop=loop, lyapunov=lyapunov, claims=claims, witnesses=witnesses)


def test_a_loop_that_runs_away_on_its_last_cell_alone_is_not_proved():
    # x' = −|x|^½ comes back from the right and runs away to the left
    field, certificate = powers(-AbsolutePower(x, HALF))
    assert list(certificate.witnesses) == ["positive +", "decrease +"]
    with pytest.raises(CertificateError, match="the witness of 'decrease -' is missing"):
        certificate.check(field)


def test_the_last_of_four_cells_counts_too():
    # y' = −⌈y⌋^½ but for x, y < 0, where (1 − sign x)(1 − sign y)/4 = 1 turns it
    turned = (1 - SignedPower(x, 0)) * (1 - SignedPower(y, 0)) / 4
    field, certificate = powers(
        sp.expand(-SignedPower(x, HALF)), sp.expand(-SignedPower(y, HALF) - 3 * turned * AbsolutePower(y, HALF))
    )
    assert "decrease --" not in certificate.witnesses
    with pytest.raises(CertificateError, match="the witness of 'decrease --' is missing"):
        certificate.check(field)


def test_the_same_loops_with_every_cell_falling_are_proved():
    for rates in ((-SignedPower(x, HALF),), (-SignedPower(x, HALF), -SignedPower(y, HALF))):
        field, certificate = powers(*rates)
        assert str(certificate.check(field)) == "proved"


def test_a_function_that_is_negative_on_its_last_cell_is_not_positive():
    # V = ⌈x⌋^{3/2} is odd; its first cell is as good as |x|^{3/2}
    field, certificate = powers(-SignedPower(x, HALF))
    odd = Certificate(
        loop=certificate.loop, lyapunov=(Term(F(1), (), (("x", F(3, 2), "s"),)),), claims=certificate.claims,
        witnesses=certificate.witnesses,
    )  # fmt: skip
    with pytest.raises(CertificateError, match="the witness of 'positive -' is missing"):
        odd.check(field)


@pytest.mark.parametrize("count", [1, 2])
def test_there_are_two_cells_for_every_state(count):
    field, certificate = powers(*(-SignedPower(s, HALF) for s in (x, y)[:count]))
    words = [cell.name for cell in Obligations(certificate.loop, certificate.lyapunov).sign_cells()]
    assert words == {1: ["+", "-"], 2: ["++", "+-", "-+", "--"]}[count]
    assert len(field.states) == count
