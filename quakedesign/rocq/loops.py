"""Closed loops in Gallina: field, V and claims, from which Rocq derives the proof obligations."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.lyapunov.exact.claim import Evidence
from quakedesign.lyapunov.exact.obligations import Obligations, obligation_degree
from quakedesign.rocq import gallina
from quakedesign.symbolic.terms import Term, value

_POTENTIAL = "V"
_POINTS = "forall x, nowhere_zero x ->"


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Variables of the loop in Rocq, in order: states, lifts with a variable, V if a decay is claimed, other lifts.

    Lifts are arguments of nested powers; of the others, only the sign is used. `weights`: homogeneity weights by name.
    """

    weights: Mapping[str, int]
    varying: tuple[str, ...]  # Parameters with a range of more than one point
    values: Mapping[str, Fraction]  # All other parameters

    def index(self, name: str) -> int:
        """Column of a state or lift."""
        return list(self.weights).index(name)

    def expression(self, terms: Iterable[Term]) -> str:
        """Sum of terms as a Gallina list; terms with a factor that is a zero parameter are omitted."""
        return gallina.listed(filter(None, map(self._term, terms)), ";\n   ")

    def _term(self, term: Term) -> str:
        parameters = tuple(p for p in term.parameters if p in self.values)
        number = value(Term(term.coefficient, parameters, ()), self.values)
        if not number:
            return ""
        varying = gallina.listed((str(self.varying.index(p)) for p in term.parameters if p not in self.values), ";")
        powers = {self.index(name): _power(exponent, kind) for name, exponent, kind in term.factors}
        row = (powers.get(i, _power(Fraction(0), "a")) for i in range(max(powers, default=-1) + 1))
        return f"Monomial {gallina.rational(number)} {varying} {gallina.listed(row)}"

    def magnitudes(self, factor: Fraction, names: Iterable[str], total: int) -> str:
        """factor · Σ |x|^(total / weight)."""
        return self.expression(Term(factor, (), ((n, Fraction(total, self.weights[n]), "a"),)) for n in names)


def _power(exponent: Fraction, kind: str) -> str:
    if not exponent:
        return "sign_only" if kind == "s" else "absent"
    return f"{'odd_power' if kind == 's' else 'even_power'} {gallina.rational(exponent)}"


def loop_theorems(evidence: Evidence) -> Iterator[str]:
    """Definitions of a loop on cells, and theorems about V and its derivative along the field.

    In the file, they follow the definition `questions` and the theorem `certificate` that all these questions hold.
    """
    loop, obligations = evidence.loop, Obligations(evidence.loop, evidence.lyapunov)
    m = obligation_degree([p for _, p in obligations.function()], "V")
    n = obligation_degree([one.polynomial for _, one in obligations.decrease("")], "V̇")
    columns = _columns(evidence, obligations, m)
    yield from _definitions(evidence, columns)
    claims = {"positive": tuple(loop.states)} | {f"bound_{state}": (state,) for state in loop.states}
    for claim, names in claims.items():
        if claim in evidence.claims:
            yield _bound(claim, columns.magnitudes(evidence.claims[claim], names, m))
    yield _decrease("decrease", columns.magnitudes(evidence.claims["decrease"], loop.states, n))
    if "decay" in evidence.claims:
        yield _decrease("decay", columns.magnitudes(evidence.claims["decay"], (_POTENTIAL,), n))
    everything = ", ".join(["certificate", *(c for c in (*claims, "decrease", "decay") if c in evidence.claims)])
    yield f"Definition everything := ({everything}).\nPrint Assumptions everything."


def _columns(evidence: Evidence, obligations: Obligations, m: int) -> Columns:
    loop = evidence.loop
    variables = obligations.with_variable
    potential = {_POTENTIAL: m} if "decay" in evidence.claims else {}
    degrees = obligations.lift_degrees
    return Columns(
        weights={
            **loop.states,
            **{lift: degrees[lift] for lift in variables},
            **potential,
            **{lift: 1 for lift in loop.lifts if lift not in variables},
        },
        varying=tuple(name for name, (low, high) in loop.ranges.items() if low < high),
        values={**loop.parameters, **{name: low for name, (low, high) in loop.ranges.items() if low == high}},
    )


def _definitions(evidence: Evidence, columns: Columns) -> Iterator[str]:
    loop = evidence.loop
    yield f"(* columns: {', '.join(columns.weights)}; parameters: {', '.join(columns.varying) or 'none'} *)"
    entries = [f"Column {weight} {str(name == _POTENTIAL).lower()}" for name, weight in columns.weights.items()]
    yield f"Definition columns : list column := {gallina.listed(entries)}."
    yield f"Definition states : list column := {gallina.listed(entries[: len(loop.states)])}."
    yield f"Definition function : expression :=\n  {columns.expression(evidence.lyapunov)}."
    rows = (columns.expression(loop.field[state]) for state in loop.states)
    yield f"Definition field : list expression :=\n  {gallina.listed(rows, ';' + chr(10) + '  ')}."
    arguments = [f"({columns.index(lift)}, {columns.expression(terms)})" for lift, terms in loop.lifts.items()]
    arguments += [f"({columns.index(_POTENTIAL)}, function)"] if _POTENTIAL in columns.weights else []
    yield f"Definition arguments : list (nat * expression) :=\n  {gallina.listed(arguments)}."
    ends = (loop.ranges[name] for name in columns.varying)
    pairs = (f"({gallina.rational(low)}, {gallina.rational(high)})%Q" for low, high in ends)
    yield f"Definition ranges : list (Q * Q) := {gallina.listed(pairs)}."


def _bound(claim: str, margin: str) -> str:
    values = f"expression_value x (listed nil) margin_{claim} <= expression_value x (listed nil) function"
    return "\n".join(
        [
            f"Definition margin_{claim} : expression :=\n  {margin}.",
            gallina.accepted(f"covers states nil nil questions (rest function margin_{claim})", f"covered_{claim}"),
            f"Theorem {claim} : {_POINTS} with_lifts x nil states nil ->\n  ({values})%R.",
            f"Proof. exact (bound_sound states questions function margin_{claim} certificate covered_{claim}). Qed.",
        ]
    )


def _decrease(claim: str, margin: str) -> str:
    data = f"columns arguments ranges questions function field margin_{claim}"
    derivative = "derivable_pt_lim (fun t => expression_value (update x i t) (listed p) function) (x i) (d i)"
    return "\n".join(
        [
            f"Definition margin_{claim} : expression :=\n  {margin}.",
            gallina.accepted(
                f"covers columns arguments ranges questions (fall function field margin_{claim})", f"covered_{claim}"
            ),
            f"Theorem {claim} : {_POINTS} forall p, in_ranges p ranges -> with_lifts x p columns arguments ->",
            f"  forall d, (forall i, {derivative}) ->",
            f"  (along_field d x (listed p) 0 field <= - expression_value x (listed p) margin_{claim})%R.",
            f"Proof. exact (fall_sound {data} certificate covered_{claim}). Qed.",
        ]
    )
