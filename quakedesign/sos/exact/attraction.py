"""Regions of attraction of polynomial fields by Lyapunov functions: claim, proof, files.

The claim holds if V is a sum of squares, μ·(−V̇) = σ_0 + (level − V)·σ_1 with a positive polynomial μ, all Gram
matrices are positive definite, and the bases contain a pure power of every state; see the first chapter. Further
chapters: files of regions (proofs/FORMAT.md) and of fields (TOML).
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.files import Json, parse_toml, read_text
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, combination, constant, degree, evaluate, product
from quakedesign.sos.exact.polynomial_files import TERMS, Names, PointEntries, SosEntries, proof_entries
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Point, Square, SumOfSquares, holds
from quakedesign.sos.exact.strict import (
    Entries,
    PolynomialEntries,
    headed,
    made,
    parse,
    polynomial_text,
    read_as,
    require_polynomial,
    write_readable,
    written,
)
from quakedesign.sos.exact.work_budget import limited

# ----------------------------------------------------------------------
# Regions of attraction by a Lyapunov function: the claim about a polynomial field, and the check of its proof.
#
# V = Σ bᵀQb and μ·(−V̇) = Σ σ_0 + (level − V)·Σ σ_1 with every Q positive definite and a polynomial μ whose
# coefficients show that it is positive. If the bases of the squares of V contain a pure power of every state, V is
# positive except at the origin and radially unbounded. If the bases of σ_0 and σ_1 contain a pure power of every state,
# V̇ < 0 where V < level, except at the origin. Then {V < level} is bounded and invariant, and every solution in it
# tends to zero.


@dataclass(frozen=True, kw_only=True)
class LyapunovProof:
    """Sums of squares of V and of μ·(−V̇)."""

    positive: SumOfSquares
    decrease: SumOfSquares


@checked_dataclass(frozen=True, kw_only=True)
class Attraction:
    """Claim that V > 0 > V̇ for x' = field(x) where V < level, except at the origin; proved, refuted or undecided.

    Attributes
    ----------
    variables : tuple of str
    field : tuple of Polynomial
        Time derivatives of the variables, in their order; they vanish at the origin.
    lyapunov : Polynomial
        V; it vanishes at the origin.
    level : Fraction or None
        Positive; None for the whole space.
    multiplier : Polynomial
        μ.
    proof : LyapunovProof, Point or None
        A point refutes the claim: it is not the origin, V < level there, and V <= 0 or V̇ >= 0.
    reason : str
        Reason why the claim is undecided; empty otherwise.
    """

    variables: tuple[str, ...]
    field: tuple[Polynomial, ...]
    lyapunov: Polynomial
    level: Fraction | None
    multiplier: Polynomial
    proof: LyapunovProof | Point | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        size = len(self.variables)
        origin = (0,) * size
        if len(self.field) != size:
            raise PolynomialError(f"a field of {size} states needs {size} polynomials. Received {len(self.field)}.")
        if origin in self.lyapunov or any(origin in f for f in self.field):
            raise PolynomialError(
                "V and the field must vanish at the origin. Received a constant term. Subtract V(0) from V, and choose "
                "coordinates in which the equilibrium is the origin."
            )
        if self.level is not None and self.level <= 0:
            raise PolynomialError(f"a level must be positive. Received {self.level}.")

    @cached_property
    def derivative(self) -> dict[Exponents, Fraction]:
        """V̇ along the field."""
        return along(self.field, self.lyapunov)

    @cached_property
    def positive(self) -> Statement:
        """Statement that V is a sum of squares."""
        return _statement(self.variables, self.lyapunov, constant(len(self.variables)), ())

    @cached_property
    def decrease(self) -> Statement:
        """Statement that μ·(−V̇) is non-negative where V is at most the level."""
        falling = combination([(Fraction(-1), self.derivative)])
        size = len(self.variables)
        below = (
            () if self.level is None else (combination([(self.level, constant(size)), (Fraction(-1), self.lyapunov)]),)
        )
        return _statement(self.variables, falling, self.multiplier, below)

    @property
    def verdict(self) -> str:
        """``proved``, ``refuted`` or ``undecided``."""
        return "undecided" if self.proof is None else "refuted" if self.refutation else "proved"

    @property
    def refutation(self) -> Point | None:
        """Point that refutes the claim; None without one."""
        match self.proof:
            case Point() as point:
                return point
        return None

    @property
    def height(self) -> Fraction | None:
        """V at the refuting point; None without one."""
        return evaluate(self.lyapunov, self.refutation.coordinates) if self.refutation else None

    @property
    def equilibrium(self) -> bool:
        """Whether the field vanishes at the refuting point: it refutes every V, in a claim about the whole space."""
        point = self.refutation
        return point is not None and not any(evaluate(f, point.coordinates) for f in self.field)

    def check(self) -> bool:
        """Whether the proof is valid, in exact arithmetic and without a solver; True for an undecided claim.

        Raises
        ------
        WorkError
            When the check exceeds its work budget.
        """
        with limited():
            match self.proof:
                case Point() as point:
                    return self.refuted_by(point)
                case proof:
                    return proof is None or self._proves(proof)

    def _proves(self, proof: LyapunovProof) -> bool:
        parts = ((self.positive, proof.positive), (self.decrease, proof.decrease))
        size = len(self.variables)
        return all(vanishes_at_origin_only(sums.squares, size) and holds(statement, sums) for statement, sums in parts)

    def refuted_by(self, point: Point) -> bool:
        """Whether a point other than the origin has V < level, and V ≤ 0 or V̇ ≥ 0."""
        x = point.coordinates
        if len(x) != len(self.variables) or not any(x):
            return False
        value = evaluate(self.lyapunov, x)
        inside = self.level is None or value < self.level
        return inside and (value <= 0 or evaluate(self.derivative, x) >= 0)


@checked_dataclass(frozen=True, kw_only=True)
class Region:
    """Largest proved region of attraction {V < level}, and a refuted level.

    Attributes
    ----------
    proved : Attraction or None
        Claim of the largest level that is proved.
    refuted : Attraction or None
        Claim refuted by a point where V ≤ 0 or V̇ ≥ 0, which refutes every level above the value of V there.
    remark : str
        Reason why no level was proved; empty otherwise.
    inclusion : Answer or None
        Proof that V is below the level where the given shape is at most β; None without a shape.
    """

    proved: Attraction | None
    refuted: Attraction | None
    remark: str = ""
    inclusion: Answer | None = None

    @staticmethod
    def of(claim: Attraction) -> "Region":
        """Region of a single claim, about the whole space."""
        proved, refuted = (claim if claim.verdict == verdict else None for verdict in ("proved", "refuted"))
        remark = "" if proved or refuted else claim.reason or "neither a proof nor a counterexample was found"
        return Region(proved=proved, refuted=refuted, remark=remark)

    @property
    def verdict(self) -> str:
        """``proved``, ``refuted`` (the claim without a level fails for this V or this field) or ``undecided``."""
        if self.proved is not None:
            return "proved"
        return "refuted" if self.refuted is not None and self.refuted.level is None else "undecided"

    @property
    def level(self) -> Fraction | None:
        """Proved level; None if nothing is proved, and also if the whole space is proved (see `verdict`)."""
        return None if self.proved is None else self.proved.level

    @property
    def shape_level(self) -> Fraction | None:
        """β of the inclusion; None without one."""
        if self.inclusion is None:
            return None
        inside = self.inclusion.statement.inequalities[0]
        return inside[(0,) * len(self.inclusion.statement.variables)]

    @property
    def refuted_above(self) -> Fraction | None:
        """V at the refuting point; None without one."""
        return None if self.refuted is None else self.refuted.height


def vanishes_at_origin_only(squares: Iterable[Square], size: int) -> bool:
    """Whether the bases contain a pure power of every variable, so that the squares vanish at the origin only."""
    pure = {_pure(b) for square in squares for b in square.basis if isinstance(b, tuple)}
    return pure >= set(range(size))


def _pure(exponents: Exponents) -> int | None:
    """Index of the variable of a pure power; None for other monomials."""
    used = [i for i, x in enumerate(exponents) if x]
    return used[0] if len(used) == 1 else None


def along(field: Sequence[Polynomial], function: Polynomial) -> dict[Exponents, Fraction]:
    """Derivative of a function along the solutions of a field."""
    slopes = [_partial(function, i) for i in range(len(field))]
    parts = (product(len(field), (slope, f)) for slope, f in zip(slopes, field, strict=True))
    return combination((Fraction(1), part) for part in parts)


def _partial(polynomial: Polynomial, index: int) -> dict[Exponents, Fraction]:
    lowered = ((e, c) for e, c in polynomial.items() if e[index])
    return {(*e[:index], e[index] - 1, *e[index + 1 :]): c * e[index] for e, c in lowered}


def _statement(
    variables: tuple[str, ...], polynomial: Polynomial, multiplier: Polynomial, inequalities: tuple[Polynomial, ...]
) -> Statement:
    top = max(degree(multiplier) + degree(polynomial), *map(degree, inequalities), 0)
    return Statement(
        variables=variables,
        polynomial=polynomial,
        inequalities=inequalities,
        products=((), *((i,) for i in range(len(inequalities)))),
        degree=top + top % 2,
        multiplier=multiplier,
    )


# ----------------------------------------------------------------------
# The file of a region of attraction (proofs/FORMAT.md): read strictly, written atomically.


class AttractionEntries(Entries):
    """A polynomial field, its Lyapunov function, and the level, which is empty for the whole space."""

    variables: Names
    field: tuple[PolynomialEntries, ...]
    V: PolynomialEntries
    level: Annotated[tuple[Fraction, ...], Meta(max_length=1)]

    def claim(self, multiplier: Polynomial) -> Attraction:
        """Claim; its polynomials must be in its variables."""
        size = len(self.variables)
        for polynomial in (self.V, multiplier, *self.field):
            require_polynomial(polynomial, "a polynomial", size, TERMS)
        level = self.level[0] if self.level else None
        field = tuple(map(dict, self.field))
        return made(Attraction, self, field=field, lyapunov=dict(self.V), level=level, multiplier=dict(multiplier))


class ProvedFile(AttractionEntries):
    """Entries of a file with a proof, without format and kind."""

    multiplier: PolynomialEntries
    positive: SosEntries
    decrease: SosEntries


class RefutedFile(AttractionEntries):
    """Entries of a file with a refutation, without format and kind."""

    negative: PointEntries


def read(raw: Any) -> Attraction:
    """Claim and proof of a parsed file, which are not checked.

    Raises
    ------
    CertificateError
        When the file breaks a rule of FORMAT.md.
    """
    entries = headed(raw, "attraction")
    try:
        if "negative" in entries:
            refuted = read_as(RefutedFile, entries)
            size = len(refuted.variables)
            return replace(refuted.claim(constant(size)), proof=refuted.negative.proof(size))
        file = read_as(ProvedFile, entries)
        claim = file.claim(file.multiplier)
        proof = LyapunovProof(
            positive=file.positive.proof(claim.positive), decrease=file.decrease.proof(claim.decrease)
        )
        return replace(claim, proof=proof)
    except PolynomialError as error:
        raise CertificateError(str(error)) from None


def load(text: str) -> Attraction:
    """Claim and proof of the text of a file. Raises CertificateError as `read`."""
    return read(parse(text))


def text(claim: Attraction) -> str:
    """Text of the file, reproducible for a given proof.

    Raises
    ------
    CertificateError
        When there is neither a proof nor a refutation.
    """
    proof = claim.proof
    if proof is None:
        raise CertificateError("only a proof or a refutation can be saved. Received an undecided claim.")
    entries = made(
        AttractionEntries,
        claim,
        field=tuple(map(PolynomialEntries, claim.field)),
        V=PolynomialEntries(claim.lyapunov),
        level=() if claim.level is None else (claim.level,),
    )
    plain: Json = {"format": 1, "kind": "attraction"} | written(entries)
    if claim.refutation is not None:
        plain |= proof_entries(claim.refutation)
    else:
        plain["multiplier"] = polynomial_text(claim.multiplier)
        plain |= {part: proof_entries(getattr(proof, part))["sos"] for part in ("positive", "decrease")}
    return json.dumps(plain, ensure_ascii=True, separators=(",", ":")) + "\n"


def save_attraction(claim: Attraction, path: str | Path) -> None:
    """Write the file atomically, and only if it can be read back.

    Raises
    ------
    CertificateError
        When there is no proof, or it exceeds the limits of the format.
    OutputError
        When the folder is not writable.
    """
    write_readable(path, text(claim), load)


# ----------------------------------------------------------------------
# A polynomial field and a Lyapunov function from a TOML file.

_LARGEST = 1 << 16  # bytes


def read_field(path: str | Path) -> tuple[dict[str, str], str | None]:
    """Time derivatives of the states by name, from the table ``field``, and V or None; all as text.

    Raises
    ------
    PolynomialError
        When the file is not readable, or has other keys or values.
    """
    content = read_text(path, "a field file", largest=_LARGEST, refusal=PolynomialError)
    try:
        raw = parse_toml(content)
    except ValueError as error:
        reason = str(error).partition("\n")[0]
        raise PolynomialError(f"{path} must be TOML. Received: {reason}. Quote polynomials.") from None
    field: Any = raw.get("field")
    function = raw.get("V")
    sound = isinstance(field, dict) and all(isinstance(rate, str) for rate in field.values())
    if not raw.keys() <= {"field", "V"} or not sound or not isinstance(function, str | None):
        raise PolynomialError(
            f'{path} must have a table [field], such as x = "-x + x^3", and may have V = "x^2" before it.'
        )
    return dict(field), function
