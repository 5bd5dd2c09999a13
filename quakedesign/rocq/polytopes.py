"""Invariant polytopes of the stick–slip plant in Gallina: loop, facets, responses, multipliers."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from itertools import product
from math import ceil, floor, log10

from flint import arb, ctx

from quakedesign.errors import UnsupportedError
from quakedesign.exact import fraction_of
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.guarantees.exact.stick_slip_set import (
    BALLS,
    BITS,
    COMBINATIONS,
    EXACT,
    Period,
    Rows,
    Verifier,
    facet_rows,
    feedback_range,
    ranges,
    verifiers,
)
from quakedesign.rocq import gallina

_BITS, _GRAIN = 80, 40  # binary places of numbers and of multipliers in polytope.v
_CLOSE = 2.0**-30  # a bound by multipliers is used if below 1 − `_CLOSE`; otherwise the facet's own inequality is used
_DIGITS = 12  # significant digits of the ends of ranges, rounded outward
_OFF = 77  # bits of accuracy of the polynomials for the impulse responses
_MOST_TERMS = 400
_PAIRS = {0: (0, 0), 1: (0, 1), 2: (1, 0), 3: (1, 1), 4: (2, 0), 7: (2, 1), 5: (3, 0), 6: (3, 1)}
"""By index in `resting_rows`: number of the polytope, 0 to 3, and 0 for the least or 1 for the largest r'."""


def polytope_theorem(claim: StickSlipProof) -> Iterator[str]:
    """Loop, facets, responses, multipliers and theorem of a guarantee on the stick–slip plant.

    Raises `UnsupportedError` for aperiodic sampling, or a sampling time that is too long (see `_terms`).
    """
    task, loop, polytope = claim.task, claim.sampled_loop, claim.invariant_set
    if loop.longest_step:
        raise UnsupportedError("Rocq verifies only periodic sampling. Received aperiodic sampling. Use check.py.")
    with ctx.workprec(BITS):
        feedback, moved = _outward(*feedback_range(task, loop, polytope)), task.reference_rates[0] * loop.step
        bounds = ranges(task, polytope.box[0] + moved, feedback, polytope.box[1] * loop.step)
        bounds = replace(bounds, **{name: _outward(*getattr(bounds, name)) for name in ("slope", "damping", "chord")})
        (period,) = periods = Period.deciding(BALLS, task, loop, bounds, polytope.box[1], feedback)
        deciding = verifiers(task, loop, polytope, bounds)
        sliding, resting = (_hints(deciding, rows) for rows in facet_rows(periods, polytope))
        yield _loop(period)
        yield (
            "Definition facets : list facet :=\n  "
            + gallina.listed(map(_facet, polytope.facets, polytope.multipliers), ";\n   ")
            + "."
        )
        yield f"Definition known : responses near :=\n  {_responses(period)}."
        count, falls = len(polytope.facets), [row[2] <= 0 for row in polytope.facets]
        by_slide, by_rest = _by_slide(sliding, count), _by_rest(resting, falls)
        pairs = _feedback_bounds(deciding[:3], period)
    for name, kind, entries in (
        ("hints_of_slides", "list (list hint)", by_slide),
        ("hints_of_rests", "list (list pair)", by_rest),
    ):
        yield f"Definition {name} : list ({kind}) :=\n  " + gallina.listed(entries, ";\n   ") + "."
    low, high = map(gallina.rational, feedback)
    yield f"Definition proposed : proposals :=\n  Proposals hints_of_slides hints_of_rests {low} {high}\n  {pairs}."
    stated = (getattr(claim.claims, one.name) for one in fields(claim.claims))
    numbers = map(gallina.rational, (*stated, *bounds.rest_pressure))
    yield f"Definition claimed : claims := Claims {' '.join(numbers)}."
    yield gallina.accepted("follows plant facets proposed claimed", "followed")
    flow = f"follows_from_flow plant known {_terms(period)} (1 # {1 << _OFF})"
    yield gallina.accepted(flow, "solved_flow")
    yield gallina.accepted("accepts plant facets known proposed")
    yield (
        "Theorem certificate : guaranteed plant facets claimed.\n"
        "Proof. exact (polytope_sound plant facets known proposed claimed _ _ _ accepted followed solved_flow). Qed.\n"
        "Print Assumptions certificate."
    )


def _outward(low: Fraction, high: Fraction) -> tuple[Fraction, Fraction]:
    """A range rounded outward to ends with few digits; an end of 0 is unchanged."""
    size = max(abs(low), abs(high))
    unit = Fraction(10) ** (ceil(log10(size)) - _DIGITS) if size else Fraction(1)
    return (floor(low / unit) - 1) * unit if low else low, (ceil(high / unit) + 1) * unit if high else high


def _loop(period: Period) -> str:
    task, loop, bounds, law = period.task, period.sampled_loop, period.plant, period.sampled_loop.law
    fastest, bend = task.reference_rates
    bent = (_outward(Fraction(0), fraction_of(v.upper().fmpq()))[1] for v in period.bent)
    numbers = (
        *(loop.step, task.amplitude, task.authority, task.beta[1], *bounds.slope, *bounds.chord, *bounds.damping),
        *(fastest + loop.target_noise, bend, *bent, law.rate_gain, law.target_gain, law.return_rate, law.level_gain),
        *(law.slip_gain, law.rest_slip, loop.slip_noise),
    )
    return f"Definition plant : loop := Loop {' '.join(map(gallina.rational, numbers))}."


def _facet(row: tuple[Fraction, ...], given: tuple[Fraction, ...]) -> str:
    free, bare, cut, bare_cut, rest = given
    flags = ["true" if flag else "false" for flag in (bare, bare_cut)]
    entries = *map(gallina.rational, (*row, free)), flags[0], gallina.rational(cut), flags[1], gallina.rational(rest)
    return f"Facet {' '.join(entries)}"


def _responses(period: Period) -> str:
    pairs = zip(*(reversed(list(part)) for part in period.impulses), strict=True)
    nodes = gallina.listed((f"({_near(x)}, {_near(y)})" for x, y in pairs), ";\n   ")
    return f"Responses {nodes}\n  ({_near(period.of_force[0])}) ({_near(period.of_force[1])})"


def _near(value: arb) -> str:
    """Middle and radius of a ball, in units of 2^−`_BITS`."""
    middle, radius = (fraction_of(part.fmpq()) * (1 << _BITS) for part in (value.mid(), value.rad()))
    return f"Near ({gallina.integer(floor(middle))}) {gallina.integer(ceil(radius) + (2 << _BITS - _OFF) + 2)}"


def _terms(period: Period) -> str:
    """Text "terms n": number of terms of the Taylor polynomials of the impulse responses, and n with e^(KT) <= 3^n.

    K is the growth rate of the error of the polynomials [1/s] and T the sampling time [s]. Raises `UnsupportedError`
    for a sampling time that is too long compared with the time scales of the plant.
    """
    step, (s, w) = (
        period.sampled_loop.step,
        (sum(pair, Fraction(0)) / 2 for pair in (period.plant.slope, period.plant.damping)),
    )
    n, terms = ceil((3 + abs(s) + 2 * abs(w)) * step), 1
    x, y = Fraction(0), Fraction(1)
    while terms < _MOST_TERMS:
        lacking = (x**2 + y**2 + (s * x - w * y) ** 2) * step ** (2 * terms - 2)
        if terms > 2 and lacking * step * 3**n * 4 ** (_OFF + 1) <= 1:
            return f"{terms} {n}"
        x, y, terms = y / terms, (s * x - w * y) / terms, terms + 1
    raise UnsupportedError(
        f"T_s = {float(step):g} s is too long for Rocq: impulse responses exceed {_MOST_TERMS} terms. Use check.py."
    )


@dataclass(frozen=True)
class _Hint:
    """Bound of a facet: whether the facet's own inequality is used, and the multipliers of the constraints."""

    own: bool
    shares: tuple[tuple[int, float], ...]
    turn: int | None = None  # index of the constraint that the target rate is not negative

    @classmethod
    def of(cls, verifier: Verifier, basis: Iterable[int], shares: Iterable[float]) -> "_Hint":
        """Bound by a vertex."""
        return cls(False, tuple(zip(map(int, basis), shares, strict=True)))

    @classmethod
    def itself(cls, verifier: Verifier, left: Sequence[float]) -> "_Hint":
        """Bound by the facet itself, and further constraints used in `Verifier.largest`."""
        more = [(len(verifier.rows) - 1, left[3])] if len(left) > 3 else []
        more += [(verifier.last, left[0])] if verifier.last is not None else []
        return cls(True, tuple((i, v * (1 + 2.0**-_GRAIN)) for i, v in more), verifier.last)

    def text(self, *, without: int | None = None) -> str:
        """Gallina term, without the constraint `without`."""
        whole = ((i, ceil(share * 2.0**_GRAIN)) for i, share in self.shares if share > 0 and i != without)
        listed = gallina.listed((f"Share {i} {gallina.integer(p)}" for i, p in whole), ";")
        return f"Hint {str(self.own).lower()} {listed}"


def _hints(deciding: list[Verifier], given: Iterable[Rows]) -> Iterator[tuple[Rows, dict[int, _Hint]]]:
    """Bounds of the facets, for every set of rows."""
    for rows in given:
        verifier = deciding[rows.place]
        tops = verifier.largest(rows.factors, rows.constants)
        floats = EXACT.middle(rows.factors)
        bases, shares = verifier.proposed(floats * EXACT.middle(verifier.sizes))
        own = floats - EXACT.middle(verifier.rows[rows.which])
        signed = floats.copy()
        signed[:, 0], signed[:, 2] = signed[:, 0] * verifier.sign, abs(signed[:, 2])
        signs = EXACT.middle(rows.constants) + (signed.clip(min=0) * EXACT.middle(verifier.sizes)).sum(axis=1)
        hints = {}
        for w, top, sign, basis, share, left in zip(rows.which, tops, signs, bases, shares, own, strict=True):
            if float(1 - top) > _CLOSE:
                hints[int(w)] = _Hint.of(verifier, basis, share)
            else:
                hints[int(w)] = _Hint(False, ()) if 1 - sign > _CLOSE else _Hint.itself(verifier, left)
        yield rows, hints


def _pair(least: _Hint, largest: _Hint, *, positive: bool = False) -> str:
    """Bounds at the least and the largest r'; with `positive` they may omit the target rate, which is at least 0."""
    bare = positive and largest.own and any(i == largest.turn and share > 0 for i, share in largest.shares)
    return f"Pair {str(bare).lower()} ({least.text()}) ({largest.text(without=largest.turn if bare else None)})"


def _by_slide(given: Iterator[tuple[Rows, dict[int, _Hint]]], count: int) -> list[str]:
    """Bounds per facet, ordered by cut-off of the innovation, chord and β, each for the seven `COMBINATIONS`."""
    by_facet: dict[int, list[str]] = {i: [] for i in range(count)}
    for many in zip(*[given] * len(COMBINATIONS), strict=True):
        for facet in many[0][1]:
            by_facet[facet].append(gallina.listed(hints[facet].text() for _, hints in many))
    return [gallina.listed(by_facet[i], ";\n     ") for i in range(count)]


def _by_rest(given: Iterator[tuple[Rows, dict[int, _Hint]]], falls: list[bool]) -> list[str]:
    """Bounds per facet, ordered by chord, weight of the innovation at rest, polytope, and least and largest r'."""
    raised, table = [i for i, fall in enumerate(falls) if not fall], {}
    groups = [2 if raised else 0, 1 if any(falls) else 0]
    for part, chord in product(range(len(_PAIRS)), range(2)):
        for place in range(sum(groups)):
            for facet, hint in next(given)[1].items():
                share = 0 if falls[facet] else place
                table[facet, chord, share, *_PAIRS[part]] = hint
    texts = []
    for facet, fall in enumerate(falls):
        cases = []
        for chord, share in product(range(2), range(1 if fall else 2)):
            pairs = (_pair(*(table[facet, chord, share, i, j] for j in (0, 1)), positive=i == 1) for i in range(4))
            cases.append(gallina.listed(pairs))
        texts.append(gallina.listed(cases, ";\n     "))
    return texts


def _feedback_bounds(slices: list[Verifier], period: Period) -> str:
    """Multipliers that bound the feedback U = p* − p at a sample below and above, for the first three verifiers."""
    law = period.sampled_loop.law
    row = law.target_gain * law.return_rate, law.rate_gain, Fraction(1)
    factors = EXACT.middle(EXACT.array([[-v for v in row], row]))
    pairs = []
    for verifier in slices:
        bases, shares = verifier.proposed(factors * EXACT.middle(verifier.sizes))
        pairs.append(_pair(*(_Hint.of(verifier, basis, share) for basis, share in zip(bases, shares, strict=True))))
    return gallina.listed(pairs)
