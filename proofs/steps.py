"""Steps of a derivation: each asserts something when it is made, and can be read afterwards."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp
from sympy.printing.str import StrPrinter

from quakedesign.symbolic import normal_form


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One assertion that held.

    Attributes
    ----------
    claim : str
        What is shown, in a sentence.
    formula : str
        The result; may be empty.
    basis : str
        ``identity`` (two expressions have one normal form), ``sign`` (an inequality, by exact algebra), ``point``
        (exact numbers at a point) or ``cited`` (a theorem of others that is used, not proved).
    """

    claim: str
    formula: str
    basis: str

    def __str__(self) -> str:
        lines = [f"[{self.basis}] {self.claim}", *(f"    {line}" for line in self.formula.splitlines())]
        return "\n".join(lines)


def equal(claim: str, left: sp.Expr, right: sp.Expr, shown: str = "") -> Step:
    """Step that two expressions are identical.

    Raises
    ------
    AssertionError
        When their difference has another normal form than 0.
    """
    rest = normal_form(sp.sympify(left) - sp.sympify(right))
    assert rest == 0, f"{claim}: the difference is {text(rest)}, not 0"
    return Step(claim=claim, formula=shown or text(right), basis="identity")


def true(claim: str, fact: object, shown: str = "", basis: str = "sign") -> Step:
    """Step that a fact is exactly true.

    Raises
    ------
    AssertionError
        When it is not, or not known to be.
    """
    assert fact is True or fact is sp.true, f"{claim}: {fact}"
    return Step(claim=claim, formula=shown, basis=basis)


def cited(claim: str, source: str) -> Step:
    """Step that rests on a published theorem."""
    return Step(claim=claim, formula=source, basis="cited")


def printed(title: str, steps: Iterable[Step]) -> str:
    """Readable proof: numbered steps under a title."""
    numbered = (f"{i}. {step}" for i, step in enumerate(steps, 1))
    return "\n\n".join([title + "\n" + "=" * len(title), *numbered])


class _Signed(StrPrinter):
    """Text with ⌈x⌋^a and |x|^a, and Greek letters."""

    def _print_Symbol(self, e):
        parts = re.split(r"([_^])", e.name.replace("\\", "").replace("*", "⋆").replace("'_n", "'"))
        return "".join(_LETTERS.get(part, part) for part in parts).replace("_", "").replace("^", "")

    def _print_SignedPower(self, e):
        return f"⌈{self._print(e.args[0])}⌋^{self._exponent(e.args[1])}"

    def _print_AbsolutePower(self, e):
        return f"|{self._print(e.args[0])}|" + ("" if e.args[1] == 1 else f"^{self._exponent(e.args[1])}")

    def _print_Abs(self, e):
        return f"|{self._print(e.args[0])}|"

    def _exponent(self, a):
        inside = self._print(a)
        return inside if a.is_Integer and a >= 0 else f"({inside})"


_GREEK = "alpha α beta β gamma γ eta η theta θ kappa κ lambda λ mu μ xi ξ rho ρ sigma σ phi φ Delta Δ".split()
_LETTERS = {
    **dict(zip(_GREEK[::2], _GREEK[1::2], strict=True)),
    **{"hat{N}": "N̂", "hat{k}": "k̂", "hat{eta}": "η̂", "sigma'": "σ'", "hdot": "h'", "Lbar": "L̄"},
}


def text(expression: sp.Expr) -> str:
    """One line of text for an expression."""
    return _Signed().doprint(expression).replace("**", "^")
