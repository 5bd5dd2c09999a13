"""What every way to a proof must keep, those of users included."""

from fractions import Fraction

import pytest
from own_parts import Monomials
from thinned import few

from quakedesign.errors import PolynomialError
from quakedesign.sos import Positivity, prove
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.proofs import Square, SumOfSquares
from quakedesign.sos.exact.words import sentences
from quakedesign.sos.solve import engine
from quakedesign.sos.solve.engine import Method, methods

ALL = {method.name: method for method in (*methods(), Monomials())}
POSITIVE = ("3*x^4*y^2", "x^2 + 1", "x^4 - 2*x^2 + 1", "(x - y)^2*(x^2 + 1)", "x^2*y^2 + x^2 + y^2")
OTHERS = ("-x^2", "x^3", "x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2", "x^2 - 1")


def asked(text):
    return prove(text).statement


def test_they_are_tried_in_order():
    assert [method.name for method in methods()] == ["square-factor", "conic"]


@few("text", [*POSITIVE, *OTHERS], every=2)
@pytest.mark.parametrize("name", ALL)
def test_what_is_proposed_is_a_proof_of_what_was_asked_or_refused(name, text):
    question = asked(text)
    proof = ALL[name].propose(question)
    answer = Answer(statement=question, proof=proof)
    assert answer.check() or text in OTHERS
    if text in OTHERS and answer.check():
        assert answer.verdict is not Positivity.SOS


def test_a_method_of_ones_own_is_one_class(monkeypatch):
    monkeypatch.setattr(engine, "methods", lambda: (Monomials(),))
    assert prove("3*x^4*y^2").verdict is Positivity.SOS
    assert prove("-3*x^4*y^2").verdict is prove("x^2 + 1").verdict is Positivity.UNDECIDED


@pytest.mark.slow
def test_one_that_claims_too_much_changes_no_verdict(monkeypatch):
    class Bold(Method):
        name, order = "bold", -1

        def propose(self, asked):
            """That the polynomial is one, whatever it is."""
            one = Square(basis=((0,) * len(asked.variables),), gram=(Fraction(1),))
            return SumOfSquares(squares=(one,), cofactors=())

    honest = {text: prove(text).verdict for text in (*POSITIVE, *OTHERS)}
    monkeypatch.setattr(engine, "methods", lambda: (Bold(), *methods()))
    assert {text: prove(text).verdict for text in honest} == honest
    assert honest["x^2 - 1"] is not Positivity.SOS


ROBINSON = "x^6+y^6+z^6-x^4*y^2-x^2*y^4-x^4*z^2-x^2*z^4-y^4*z^2-y^2*z^4+3*x^2*y^2*z^2"


@pytest.mark.slow
@few("factor", ["x + w", "x*w - y^2 + 1"], every=2)
def test_an_automatic_multiplier_is_one_of_what_is_left_beside_squares(factor):
    answer = prove(f"({factor})^2*({ROBINSON})", multiplier="auto")
    assert answer.verdict is Positivity.SOS
    assert answer.check()
    assert all(not e[answer.statement.variables.index("w")] for e in answer.statement.multiplier)


@pytest.mark.slow
def test_a_square_in_the_multiplier_stays_where_what_is_left_needs_it():
    quartic = (
        "x^2*(x - w)^2 + y^2*(y - w)^2 + z^2*(z - w)^2 + 2*x*y*z*(x + y + z - 2*w)"  # Robinson's, in four variables
    )
    answer = prove(f"({quartic})*(x + y)^2", multiplier="(x^2 + y^2 + z^2 + w^2)^2")
    assert answer.verdict is Positivity.SOS
    assert answer.check()
    assert prove(quartic).verdict is Positivity.NOT_SOS


@pytest.mark.parametrize("text", ["x^2", "x^2*y^2", "5", "0", "(x^2 + y)^2"])
def test_where_only_squares_are_left_no_multiplier_is_needed(text):
    answer = prove(text, multiplier="auto")
    assert (answer.verdict, len(answer.statement.multiplier)) == (Positivity.SOS, 1)


def test_an_empty_set_is_named():
    empty = prove("-1", on=["x >= 1", "x <= 0"])
    assert (empty.verdict, empty.set_is_empty) == (Positivity.SOS, True)
    assert "the set is empty, so the statement holds trivially" in sentences(empty)
    for answer in (prove("1", on=["x >= 1"]), prove("x - 1", on=["x >= 1"]), prove("-1", on=["x >= 0"]), prove("0")):
        assert not answer.set_is_empty
        assert not any("empty" in line for line in sentences(answer))


def test_what_no_solver_has_the_memory_for_is_refused_at_once():
    """It took all the memory of the machine."""
    with pytest.raises(PolynomialError, match=r"Received 2 of up to 150 x 150\. Lower the degree"):
        prove({(598,): 1, (0,): 1}, variables=("x",))
    assert prove({(598,): 1}, variables=("x",)).verdict is Positivity.SOS
