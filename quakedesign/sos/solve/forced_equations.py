"""Facial reduction with decisions: linear equations that membership in a cone forces on the decisions.

If a polynomial p(d), affine in the decisions d, is in the cone, it is in the span of the products that the cone allows.
A monomial that no product contains therefore has the coefficient zero, which is an equation on d. Its exact solution
may cancel further coefficients; then diagonal Gram entries vanish (`reduced_bases`), and the products contain fewer
monomials. This is repeated until nothing changes. If a Gram matrix has a numerical kernel for every d, the rounded
kernel restricts the basis likewise. These equations are a guess, but the resulting decisions are proved like all
others.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

from flint import fmpq, fmpq_mat

from quakedesign.exact import fraction_of
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, combination
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.facial_reduction import Block, modulo
from quakedesign.sos.solve.joint import shape_of
from quakedesign.sos.solve.moment import MomentProgram
from quakedesign.sos.solve.rounding import System, relations

Affine = tuple[Fraction, ...]
"""Constant, then the coefficient of every decision."""


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """One polynomial p(d) that must be in a cone, after the reductions so far."""

    # Constant part of p and the part of every decision; empty for eliminated decisions
    parts: Sequence[Polynomial]
    template: Statement  # The cone; its polynomial only lists the monomials that may occur
    blocks: Sequence[Block] | None = None  # Faces that replace the blocks of the template

    @cached_property
    def shape(self) -> MomentProgram | None:
        """The cone in floating point; None if it contains only zero."""
        rows = [{e: float(c) for e, c in r.items()} for _, _, r in relations(self.template)]
        if not self.present and not rows:
            return None
        whole = self.blocks is None and self.present
        return shape_of(self.template) if whole else MomentProgram([b.shape() for b in self.present], rows)

    @property
    def reached(self) -> Mapping[Exponents, int]:
        """Monomials that products and multiples of equalities may contain."""
        return {} if self.shape is None else self.shape.index

    @property
    def present(self) -> Sequence[Block]:
        """Blocks of `shape`."""
        multiples = [] if self.blocks is not None else [r for _, _, r in relations(self.template)]
        return modulo(initial_blocks(self.template), multiples) if self.blocks is None else self.blocks

    def coefficient(self, e: Exponents) -> Affine:
        """Coefficient of a monomial, affine in the decisions."""
        return tuple(part.get(e, Fraction(0)) for part in self.parts)


@dataclass(frozen=True, kw_only=True)
class Forced:
    """Solved equations on the decisions, and the requirements without the eliminated decisions."""

    requirements: tuple[Requirement, ...]
    solved: Mapping[int, Affine] = field(default_factory=dict)  # Eliminated decisions as functions of the others
    reasons: tuple[str, ...] = ()  # One sentence per equation, in the order of elimination
    contradiction: bool = False  # Whether the last equation has no solution

    def completed(self, values: Sequence[Fraction]) -> list[Fraction]:
        """Decisions that satisfy every equation, from the free ones among the values."""
        return [_value(self.solved[j], values) if j in self.solved else v for j, v in enumerate(values)]

    def reduced(self, names: Sequence[str]) -> "Forced":
        """Requirements after all equations from monomials that no product contains."""
        present, before = self, -1
        while len(present.reasons) > before and not present.contradiction:
            before = len(present.reasons)
            for k, required in enumerate(present.requirements):
                reached = required.reached
                for e in sorted({e for part in required.parts for e in part if e not in reached}, reverse=True):
                    rule = f"requirement {k + 1}: no certificate contains {_monomial(required.template.variables, e)}"
                    present = present._with(present.requirements[k].coefficient(e), rule, names)
        return present

    def on_faces(self, faces: Sequence[Sequence[Block] | None], names: Sequence[str]) -> "Forced":
        """Requirements restricted to the given faces, after all equations from the span of their products."""
        within = (
            r if b is None else replace(r, blocks=tuple(b)) for r, b in zip(self.requirements, faces, strict=True)
        )
        present = replace(self, requirements=tuple(within))
        for k, required in enumerate(present.requirements):
            rule = f"requirement {k + 1}: the rounded kernel of its Gram matrix removes a coefficient"
            for row in _annihilators(required) if faces[k] is not None else ():
                parts = present.requirements[k].parts
                equation = tuple(sum((c * p.get(e, 0) for e, c in row.items()), start=Fraction(0)) for p in parts)
                present = present._with(equation, rule, names)
        return present.reduced(names)

    def refuted(self) -> str:
        """Sentence on a monomial that only squares produce, but with a negative coefficient; empty without one."""
        for k, required in enumerate(self.requirements):
            system = System(required.template, required.present)
            mixed = {e for _, _, r in system.relations for e in r}
            for (_, i, j), column in zip(system.entries, system.columns, strict=False):
                mixed |= {e for e, c in column.items() if i != j or c < 0}
            for e, c in required.parts[0].items():
                if c < 0 and e not in mixed and not any(required.coefficient(e)[1:]):
                    monomial = _monomial(required.template.variables, e)
                    return f"requirement {k + 1}: only squares contain {monomial}, but its coefficient is {c}"
        return ""

    def _with(self, equation: Affine, rule: str, names: Sequence[str]) -> "Forced":
        """Result with one more equation, equation·(1, d) = 0."""
        if self.contradiction or not any(equation):
            return self
        pivot = next((j for j, c in enumerate(equation[1:]) if c), None)
        if pivot is None:
            text = f"{rule}, but its coefficient is {equation[0]}"
            return replace(self, reasons=(*self.reasons, text), contradiction=True)
        row = tuple(Fraction(0) if j == pivot + 1 else -c / equation[pivot + 1] for j, c in enumerate(equation))
        text = f"{rule}, so {names[pivot]} = {_sentence(row, names)}"
        solved = {pivot: row} | {j: _insert(old, pivot, row) for j, old in self.solved.items()}
        requirements = tuple(_eliminated(r, pivot, row) for r in self.requirements)
        return Forced(requirements=requirements, solved=solved, reasons=(*self.reasons, text))


def _eliminated(required: Requirement, pivot: int, row: Affine) -> Requirement:
    gone = required.parts[pivot + 1]
    if not gone:
        return required
    parts = [combination([(Fraction(1), p), (c, gone)]) if c else p for p, c in zip(required.parts, row, strict=True)]
    parts[pivot + 1] = {}
    support = dict.fromkeys((e for p in parts for e in p), Fraction(1))
    return replace(required, parts=tuple(parts), template=replace(required.template, polynomial=support))


def _insert(affine: Affine, pivot: int, row: Affine) -> Affine:
    factor = affine[pivot + 1]
    if not factor:
        return affine
    return tuple(
        (Fraction(0) if j == pivot + 1 else c) + factor * r for j, (c, r) in enumerate(zip(affine, row, strict=True))
    )


def _value(affine: Affine, values: Sequence[Fraction]) -> Fraction:
    return sum((c * v for c, v in zip(affine[1:], values, strict=True) if c), start=affine[0])


def _annihilators(required: Requirement) -> Iterable[dict[Exponents, Fraction]]:
    """Basis of the functionals that vanish on every product of a face."""
    columns = [dict(c) for c in {frozenset(c.items()) for c in System(required.template, required.present).columns}]
    keys = sorted({e for c in (*columns, *required.parts) for e in c})
    if not columns:
        return [{e: Fraction(1)} for e in keys]
    entries = [[c.get(e, Fraction(0)) for e in keys] for c in columns]
    reduced, rank = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in entries]).rref()
    rows = [[fraction_of(v) for v in row] for row in reduced.tolist()[:rank]]
    pivots = [next(i for i, v in enumerate(row) if v) for row in rows]
    free = [i for i in range(len(keys)) if i not in set(pivots)]
    return [
        {keys[i]: Fraction(1)} | {keys[p]: -row[i] for p, row in zip(pivots, rows, strict=True) if row[i]} for i in free
    ]


def _monomial(variables: Sequence[str], e: Exponents) -> str:
    return "*".join(v if n == 1 else f"{v}^{n}" for v, n in zip(variables, e, strict=True) if n) or "1"


def _sentence(equation: Affine, names: Sequence[str]) -> str:
    """Text of an affine function of the decisions."""
    terms = [(equation[0], ""), *zip(equation[1:], names, strict=True)]
    text = "".join(f" {'-' if c < 0 else '+'} {'*'.join(filter(None, (_factor(c, n), n)))}" for c, n in terms if c)
    return text.removeprefix(" + ").removeprefix(" ") or "0"


def _factor(c: Fraction, name: str) -> str:
    return "" if name and abs(c) == 1 else str(abs(c))
