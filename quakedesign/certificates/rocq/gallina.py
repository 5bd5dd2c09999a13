"""Values as terms of Gallina, the language of Rocq."""

from collections.abc import Iterable
from fractions import Fraction

from quakedesign.certificates.rocq.integers import IntegerSquare, IntegerWitness
from quakedesign.certificates.rocq.multipliers import Reason
from quakedesign.sos.exact.polynomial import Exponents, Polynomial
from quakedesign.sos.exact.statement import Statement


def listed(entries: Iterable[str], joint: str = "; ") -> str:
    """Terms as a list."""
    return f"[{joint.join(entries)}]"


def integer(number: int) -> str:
    """Integer as a literal; those of more than nine digits with sixteen digits, which coqc reads in half the time."""
    short = abs(number) < 10**9
    text = str(abs(number)) if short else hex(abs(number))
    return f"-{text}" if number < 0 else text


def rational(number: Fraction) -> str:
    """Rational as a literal of Q, of which no other digit gives the same number."""
    return f"({number.numerator} # {number.denominator})" if number else "0%Q"


def exponents(powers: Exponents) -> str:
    """Exponents as a list of nat."""
    return listed(map(str, powers), ";")


def polynomial(given: Polynomial) -> str:
    """Polynomial with rational coefficients: coefficient and exponents of every term."""
    return listed(f"term {rational(c)} {exponents(e)}" for e, c in sorted(given.items(), reverse=True))


def tree(given: Polynomial) -> str:
    """Polynomial with integer coefficients."""
    if list(given.values()) == [1]:
        return f"power {exponents(next(iter(given)))}"
    return "sum " + listed(
        f"monomial ({integer(int(c))}) {exponents(e)}" for e, c in sorted(given.items(), reverse=True)
    )


def witness(given: IntegerWitness) -> str:
    """Witness as a record of squares.v."""
    squares = listed(map(_square, given.squares), ";\n    ")
    parts = given.clearing, given.left, given.right, f"({tree(given.multiplier)})"
    return f"Witness {' '.join(map(str, parts))}\n   {squares}\n   {listed(map(tree, given.cofactors))}"


def _square(given: IntegerSquare) -> str:
    rows = listed((listed(map(integer, row), ";") for row in given.gram), ";\n      ") + "%Z"
    product, basis = exponents(given.product), listed(map(tree, given.basis))
    return f"Square {product} {basis}\n      {rows}"


def question(asked: Statement) -> str:
    """The polynomial, the inequalities and the equalities of a statement."""
    inequalities, equalities = (
        listed(map(polynomial, given), ";\n   ") for given in (asked.inequalities, asked.equalities)
    )
    return f"Question\n  {polynomial(asked.polynomial)}\n  {inequalities}\n  {equalities}"


def reason(given: Reason) -> str:
    """Why the multiplier is nowhere negative."""
    if given.sums is None:
        return "Terms"
    if not given.rest:
        return f"Dense ({witness(given.sums)})"
    return f"Sums {given.numerator} {given.rest} ({witness(given.sums)})"


def accepted(check: str, name: str = "accepted") -> str:
    """Lemma that a check comes out as true, by running it."""
    return f"Lemma {name} : {check} = true.\nProof. vm_cast_no_check (eq_refl true). Qed."
