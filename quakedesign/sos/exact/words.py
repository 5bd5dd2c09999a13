"""Sentences about results for polynomials and regions of attraction."""

from collections.abc import Sequence
from decimal import ROUND_CEILING, Context, Decimal
from fractions import Fraction

from quakedesign.exact import LowerBound, UpperBound, exact_text
from quakedesign.files import Json
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.attraction import Attraction, Region
from quakedesign.sos.exact.polynomial import Polynomial, evaluate
from quakedesign.sos.exact.proofs import Functional, Point, SumOfSquares
from quakedesign.sos.exact.work_budget import length

# ----------------------------------------------------------------------
# Sentences about an answer.

_LONGEST = 200


def polynomial_words(polynomial: Polynomial, variables: Sequence[str]) -> str:
    """Text of a polynomial, which `quakedesign.sos.exact.polynomial_text.parse` can read."""
    parts = []
    for e, c in sorted(polynomial.items(), key=lambda item: (sum(item[0]), item[0]), reverse=True):
        powers = [n if x == 1 else f"{n}^{x}" for n, x in zip(variables, e, strict=True) if x]
        number = exact_text(abs(c)) if abs(c) != 1 or not powers else ""
        parts.append((" - " if c < 0 else " + ") + "*".join(filter(None, [number, *powers])))
    text = "".join(parts) or "0"
    return text[3:] if text.startswith(" + ") else text.replace(" - ", "-", 1)


def sentences(answer: Answer, *, verbose: bool = False) -> list[str]:
    """Verdict, polynomial, set and reason of an answer, one sentence each.

    Parameters
    ----------
    verbose : bool
        Add the sizes of the Gram matrices before and after the reduction.
    """
    statement = answer.statement
    lines = [f"{answer.verdict}: {_short(polynomial_words(statement.polynomial, statement.variables))}"]
    conditions = [f"{polynomial_words(g, statement.variables)} >= 0" for g in statement.inequalities]
    conditions += [f"{polynomial_words(h, statement.variables)} == 0" for h in statement.equalities]
    if conditions:
        lines.append(f"on {', '.join(conditions)}")
    multiplier = polynomial_words(statement.multiplier, statement.variables)
    if multiplier != "1":
        lines.append(f"multiplied by {multiplier}")
    lines += [*_reason(answer), *filter(None, [answer.remark])]
    lines += ["the set is empty, so the statement holds trivially"] if answer.set_is_empty else []
    if verbose:
        lines += [
            f"Gram matrices {when} reduction: {' + '.join(map(str, sizes)) or 'none'}"
            for when, sizes in answer.blocks.items()
        ]
    lines.append(f"{answer.seconds:.2f} s; checked in exact arithmetic")
    return lines if answer.proof is not None else [*lines[:-1], f"{answer.seconds:.2f} s"]


def statement_words(answer: Answer) -> list[str]:
    """Details that `sentences` omits: the complete polynomial, products, degree, and a refuting functional."""
    statement = answer.statement
    whole = polynomial_words(statement.polynomial, statement.variables)
    products = ("*".join(f"[{i}]" for i in chosen) or "1" for chosen in statement.products)
    lines = [f"polynomial: {whole}"] if _short(whole) != whole else []
    lines.append(f"products: {', '.join(products)}; degree: {statement.degree}")
    if isinstance(answer.proof, Functional):
        values = sorted(answer.proof.values.items(), reverse=True)
        equations = (f"L({polynomial_words({e: Fraction(1)}, statement.variables)}) = {value}" for e, value in values)
        lines.append(f"functional, zero on all other monomials: {', '.join(equations)}")
    return lines


def _reason(answer: Answer) -> list[str]:
    proof, statement = answer.proof, answer.statement
    match proof:
        case SumOfSquares():
            digits = max((len(exact_text(q)) for s in proof.squares for q in s.gram), default=1)
            count = sum(len(s.basis) for s in proof.squares)
            return [
                f"a sum of {count} square{'s' * (count != 1)} with rational coefficients of at most {digits} characters"
            ]
        case Functional():
            return [
                f"it has no sum of squares with summands up to degree {statement.degree}: a rational functional with "
                f"{len(proof.values)} values is non-negative on all such sums and negative on this polynomial"
            ]
        case Point():
            point = ", ".join(
                f"{n} = {exact_text(v)}" for n, v in zip(statement.variables, proof.coordinates, strict=True)
            )
            return [f"negative at {point}", f"value {_shown(evaluate(answer.statement.polynomial, proof.coordinates))}"]
    return ["neither a rational proof nor a rational refutation was found"]


def _shown(value: Fraction) -> str:
    """Number as text; a long one is rounded upward, to six significant digits."""
    if length(value) < 1000:
        return _short(exact_text(value))
    upwards = Context(prec=6, rounding=ROUND_CEILING)
    return f"at most {upwards.divide(Decimal(value.numerator), Decimal(value.denominator))}"


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


# ----------------------------------------------------------------------
# Sentences and JSON entries about a region of attraction.


def claim_words(claim: Attraction) -> list[str]:
    """Sentences about a claim: field, V, and the proved or refuted statement."""
    names = claim.variables
    lines = [f"{name}' = {polynomial_words(f, names)}" for name, f in zip(names, claim.field, strict=True)]
    lines.append(f"V = {polynomial_words(claim.lyapunov, names)}")
    if claim.refutation is not None:
        level = [f"level {claim.level} is refuted for this V"] if claim.level is not None else []
        return [*lines, *level, *_point_words(claim)]
    if claim.proof is None:
        return lines
    return [*lines, f"every solution {_start(claim)} tends to the origin, which is asymptotically stable"]


def region_words(region: Region) -> list[str]:
    """Sentences about a region: verdict, proved and refuted levels, and remark."""
    lines = [region.verdict]
    shown = region.proved or region.refuted
    if shown is not None:
        lines += claim_words(shown)
    if (level := region.shape_level) is not None:
        lines.append(f"the region contains {_shape(region)} <= {level} ({LowerBound(level)} rounded down)")
    if region.proved is not None and region.refuted is not None:
        lines += _point_words(region.refuted)
    return [*lines, *filter(None, [region.remark])]


def region_entries(region: Region) -> Json:
    """Entries about a region for JSON; exact numbers are strings."""
    shown = region.proved or region.refuted
    point = region.refuted.refutation if region.refuted is not None else None
    return {
        "verdict": region.verdict,
        "variables": list(shown.variables) if shown else None,
        "V": polynomial_words(shown.lyapunov, shown.variables) if shown else None,
        "everywhere": region.proved is not None and region.proved.level is None,
        "level": None if region.level is None else str(region.level),
        "shape": None if region.inclusion is None else _shape(region),
        "shape_level": None if region.shape_level is None else str(region.shape_level),
        "refuted_above": None if region.refuted_above is None else str(region.refuted_above),
        "point": None if point is None else [str(x) for x in point.coordinates],
        "equilibrium": None if region.refuted is None else region.refuted.equilibrium,
        "remark": region.remark or None,
    }


def _shape(region: Region) -> str:
    """Text of the polynomial s of the inequality β − s ≥ 0."""
    assert region.inclusion is not None
    statement = region.inclusion.statement
    return polynomial_words({e: -c for e, c in statement.inequalities[0].items() if any(e)}, statement.variables)


def _start(claim: Attraction) -> str:
    if claim.level is None:
        return "from any initial state"
    return f"that starts where V < {claim.level} ({LowerBound(claim.level)} rounded down)"


def _point_words(claim: Attraction) -> list[str]:
    assert claim.refutation is not None
    assert claim.height is not None
    point = ", ".join(f"{name} = {x}" for name, x in zip(claim.variables, claim.refutation.coordinates, strict=True))
    if claim.equilibrium:
        return [f"another equilibrium, which no region of attraction contains: {point}"]
    what = "V is not positive" if claim.height <= 0 else "V does not decrease"
    above = "" if claim.height <= 0 else f", which refutes every level above {UpperBound(claim.height)} (rounded up)"
    return [f"{what} at {point}{above}"]
