"""How far given gains reach: the largest disturbance, range of β or decay that is proved, and what limits it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from time import perf_counter

from quakedesign.certificates import Certificate, Loop
from quakedesign.controllers import LoopField, Subject, law
from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.symbolic.terms import value as coefficient
from quakedesign.synthesis.analysis.certify import Number, closed_loop
from quakedesign.synthesis.analysis.falsification import escape
from quakedesign.synthesis.analysis.parametric_program import Screened, Sweep, prove
from quakedesign.synthesis.analysis.root_bracketing import TOLERANCE, Bracket, first_below, last_success
from quakedesign.synthesis.lyapunov.search import candidate_degrees, refute

_STEPS_BACK = (Fraction(0), TOLERANCE / 4, TOLERANCE / 2, 10 * TOLERANCE, 100 * TOLERANCE)
_FAR = Fraction(10) ** 12
_WIDE = 10**6  # a range of β that is wide enough
_HAIR = Fraction(1, 10**9)  # so that a range of β has two ends even where it is asked to be a point


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How far gains reach in one number, with the proof.

    Attributes
    ----------
    quantity : str
        ``"lipschitz"``, ``"beta"`` (upper end b_M) or ``"beta-factor"`` (range [b/f, b·f]).
    value : Fraction or None
        Proved exactly; None where the search finds nothing at all.
    beyond : Fraction or None
        Smallest number at which the search found nothing, at most value·(1 + 1e-4) unless a proof could not be
        finished; None where `limit` is as near, or where there seems to be no end.
    limit : Fraction or None
        No Lyapunov function exists there, of whatever kind; None where none is known.
    degrees : tuple of int
        Degrees of V that were tried, all sums of squares on cells without multiplier.
    degree : int or None
        That of the certificate.
    certificate : Certificate or None
        Proof for the value; where there is none, the exact counterexample, if one is known.
    counterexample : str
        What speaks against the gains where nothing is found, see `against`; else ``"none"``.
    solves : int
    seconds : float
    """

    quantity: str
    value: Fraction | None
    beyond: Fraction | None
    limit: Fraction | None
    degrees: tuple[int, ...]
    degree: int | None
    certificate: Certificate | None
    counterexample: str
    solves: int
    seconds: float

    @property
    def sharp(self) -> bool:
        """Whether the value is the largest of its family to four digits, or within 1e-4 of the limit."""
        ends = [end for end in (self.beyond, self.limit) if end is not None]
        return self.value is not None and any(end <= self.value * (1 + TOLERANCE) for end in ends)

    def smallest_scale(self, lipschitz: Number) -> Fraction | None:
        """Smallest λ for which the scaled gains are proved for a needed bound L̄: needed/value; None without a proof.

        Raises
        ------
        ParameterError
            When the bound is not positive, or this is the reach in another quantity.
        """
        needed = rational(lipschitz, "lipschitz")
        if needed <= 0 or self.quantity != "lipschitz":
            raise ParameterError(f"a scale needs the reach in lipschitz and a positive bound. Received {needed}.")
        return needed / self.value if self.value else None


@dataclass(frozen=True, slots=True)
class _Line:
    """Loops along one number x ≥ floor, and the derivative of every name of a sweep in x."""

    quantity: str
    at: Callable[[Fraction], Loop]
    direction: Callable[[float], dict[str, float]]
    floor: Fraction
    first: Fraction
    limit: Fraction | None
    most: Fraction | None = None


def largest_lipschitz(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    gain_range: tuple[Number, Number] = (1, 1),
    degrees: int | Iterable[int] | None = None,
) -> Reach:
    """Largest L̄ for which the gains are proved for all |d| ≤ L̄ and all β of a range.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        See `certify`.
    gains : tuple of number or text
    gain_range : tuple of two
        b_m and b_M [-].
    degrees : int or iterable of int, optional
        Degrees of V to try; those that `certify` tries unless given.

    Returns
    -------
    Reach

    Raises
    ------
    ParameterError, UnknownNameError
        As `certify`.
    CertificateError
        When the law has parts that certificates do not know.
    """
    began = perf_counter()
    base = closed_loop(subject, gains, lipschitz=1, gain_range=gain_range)
    _needs(base, "d", "largest L̄")
    limit = necessary_limit(base, subject)

    def at(x: Fraction) -> Loop:
        return replace(base, uncertain={**base.uncertain, "d": (-x, x)})

    first = _reachable(base) if limit is None else first_below(limit)
    line = _Line("lipschitz", at, lambda x: {"d": 1.0}, Fraction(0), first, limit)
    return _reach(line, subject, _chosen(degrees, base), began)


def largest_gain_range(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number,
    nominal: Number = 1,
    symmetric: bool = False,
    degrees: int | Iterable[int] | None = None,
) -> Reach:
    """Largest range of β for which the gains are proved for all |d| ≤ lipschitz.

    Parameters
    ----------
    subject, gains, degrees
        See `largest_lipschitz`.
    lipschitz : number or text
    nominal : number or text
        b: the lower end of the range, or its middle.
    symmetric : bool
        Ask for the largest f with range [b/f, b·f] instead of the largest b_M with [b, b_M].

    Returns
    -------
    Reach
        Its value is b_M, or f.

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        As `largest_lipschitz`.
    """
    began = perf_counter()
    base = closed_loop(subject, gains, lipschitz=lipschitz, gain_range=(nominal, nominal))
    _needs(base, "beta", "largest range of β")
    middle = rational(nominal, "nominal")
    b = float(middle)

    floor = Fraction(1) if symmetric else middle

    def at(x: Fraction) -> Loop:
        x = max(x, floor * (1 + _HAIR))
        ends = (middle / x, middle * x) if symmetric else (middle, x)
        return replace(base, uncertain={**base.uncertain, "beta": ends})

    def direction(x: float) -> dict[str, float]:
        return {"beta+": b, "beta-": -b / x**2} if symmetric else {"beta+": 1.0}

    line = _Line(
        "beta-factor" if symmetric else "beta", at, direction, floor, Fraction(11, 10) * floor, None, _WIDE * floor
    )
    return _reach(line, subject, _chosen(degrees, base), began)


def necessary_limit(loop: Loop, subject: Subject) -> Fraction | None:
    """Bound on |d| from which on nothing can be proved of these gains, known from the law or a refuting equilibrium."""
    chosen = None if isinstance(subject, LoopField) else law(subject) if isinstance(subject, str) else subject
    limit = chosen(gains=dict(loop.gains)).lipschitz_limit if chosen is not None else None
    limits = [] if limit is None else [max(Fraction(0), limit)]
    for bound in (Fraction(0), max(_FAR, 4 * _reachable(loop))):
        held = refute(replace(loop, uncertain={**loop.uncertain, "d": (-bound, bound)}), subject)
        if held is not None and held.refutation is not None:
            limits.append(abs(held.refutation.parameters["d"]))
    return min(limits, default=None)


def against(loop: Loop, refuted: Certificate | None) -> str:
    """What speaks against a loop without a proof, of which a counterexample is known or none.

    ``"exact"`` for an equilibrium away from the origin, ``"simulated"`` for a run that grows, else ``"none"``.
    """
    if refuted is not None:
        return "exact"
    return "simulated" if escape(loop) is not None else "none"


def _reach(line: _Line, subject: Subject, degrees: tuple[int, ...], began: float) -> Reach:
    value: Fraction | None = None
    beyond: Fraction | None = None
    degree: int | None = None
    certificate: Certificate | None = None
    solves = 0
    for tried in degrees if line.limit != 0 else ():
        search = _Search(line, subject, tried)
        bracket = search.above(value)
        proof = search.proved(bracket) if bracket.low is not None else None
        solves += search.sweep.solves
        if proof is not None:
            (value, certificate), degree = proof, tried
        beyond = max((end for end in (beyond, bracket.high) if end is not None), default=None)
        if value is not None and line.limit is not None and line.limit <= value * (1 + TOLERANCE):
            beyond = None
            break
    kind = "none"
    if certificate is None:
        loop = line.at(line.floor)
        certificate = refute(loop, subject)
        kind = against(loop, certificate)
    return Reach(
        quantity=line.quantity,
        value=value,
        beyond=beyond,
        limit=line.limit,
        degrees=degrees,
        degree=degree,
        certificate=certificate,
        counterexample=kind,
        solves=solves,
        seconds=perf_counter() - began,
    )


class _Search:
    """The search along a line with one degree of V."""

    def __init__(self, line: _Line, subject: Subject, degree: int) -> None:
        self.line, self.subject = line, subject
        reference = line.at(line.limit or line.first)
        self.sweep = Sweep(reference, degree)
        self.frame = self.sweep.frame(reference)

    def ask(self, x: Fraction) -> tuple[Screened | None, float]:
        """Answer at x, and the slope of its margin."""
        answer = self.sweep.solve(self.line.at(x), self.frame)
        if answer is None:
            return None, 0.0
        return answer, sum(answer.slopes.get(n, 0.0) * step for n, step in self.line.direction(float(x)).items())

    def above(self, value: Fraction | None) -> Bracket:
        """Bracket, with `low` only where it exceeds what is proved."""
        first = self.line.first if value is None else value * (1 + TOLERANCE * Fraction(9, 10))
        return last_success(
            self.ask,
            first,
            floor=self.line.floor,
            limit=self.line.limit,
            most=self.line.most,
            only_above=value is not None,
        )

    def proved(self, bracket: Bracket) -> tuple[Fraction, Certificate] | None:
        """Number at or below that of a bracket, and its certificate."""
        assert bracket.low is not None
        answer = bracket.best
        for step in _STEPS_BACK:
            x = max(self.line.floor, bracket.low * (1 - step))
            answer = answer if x == bracket.low else self.ask(x)[0]
            if answer is not None and answer.found:
                certificate = prove(self.sweep, self.line.at(x), answer, self.subject)
                if certificate is not None:
                    return x, certificate
        return None


def _chosen(degrees: int | Iterable[int] | None, loop: Loop) -> tuple[int, ...]:
    if degrees is None:
        return candidate_degrees(loop)
    return (degrees,) if isinstance(degrees, int) else tuple(degrees)


def _reachable(loop: Loop) -> Fraction:
    """Half of what all other terms of the rates that d acts on amount to."""
    rates = [terms for terms in loop.field.values() if any("d" in t.parameters for t in terms)]
    ends = {name: max(map(abs, range_)) for name, range_ in loop.ranges.items()}
    known = {**loop.parameters, **ends}
    return (
        sum((abs(coefficient(t, known)) for terms in rates for t in terms if "d" not in t.parameters), Fraction(0)) / 2
    )


def _needs(loop: Loop, name: str, what: str) -> None:
    if name not in loop.uncertain:
        raise ParameterError(f"the {what} needs a law that is uncertain in {name}. Received {loop.law!r}.")
