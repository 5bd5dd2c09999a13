"""Verdict on given gains of a homogeneous law, and proved margins of these gains.

The margins are the largest disturbance bound and the largest range of β. Each is located by Newton's method on the
margin of the conic programme, safeguarded by a bracket.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from time import perf_counter

import sympy as sp

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import rational, to_sympy
from quakedesign.laws import LoopField, Subject, law, model_of
from quakedesign.lyapunov.exact.certificate import Certificate, cached_verdict
from quakedesign.lyapunov.exact.claim import Loop, Verdict, loop_of
from quakedesign.lyapunov.maps.sweep import SURE, Screened, Sweep, prove
from quakedesign.lyapunov.search.infeasibility import escape
from quakedesign.lyapunov.search.lyapunov_search import candidate_degrees, find_certificate, refute
from quakedesign.symbolic.terms import Term
from quakedesign.symbolic.terms import value as coefficient

# ----------------------------------------------------------------------
# Verdict on given gains of any homogeneous law, of the package or user-defined.

Number = str | float | Fraction


def certify(
    subject: Subject, gains: tuple[Number, ...], *, lipschitz: Number, gain_range: tuple[Number, Number] = (1, 1)
) -> tuple[Verdict, Certificate | None]:
    """Decide whether gains make the origin stable for |ḣ| ≤ lipschitz and all β of a range.

    Stability is global and asymptotic, and in finite time if the field has a negative degree.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        Name of a law of the package, a user-defined class, or a bare closed loop; its uncertain parameters are
        ``beta``, ``d`` = ḣ, or both. The certificate of a user-defined law is checked with ``check(subject)``.
    gains : tuple of number or text
        Exact numbers (decimal, scientific notation or p/q) in the order of the law.
    lipschitz : number or text
        Bound L̄ on |ḣ| [unit of ν per s], not negative; ν is the control input that the law computes.
    gain_range : tuple of two numbers or texts
        Range [b_m, b_M] of β [-], positive.

    Returns
    -------
    verdict : Verdict
    certificate : Certificate or None
        Proof or counterexample; None when undecided.

    Raises
    ------
    ParameterError
        If the number of gains is wrong, a gain or range is not a number, a range is empty or not positive, or the law
        has other uncertain parameters or is not homogeneous in its weights.
    CertificateError
        When certificates do not support a part of the law, such as a squared uncertain parameter.
    UnknownNameError
        If the name of the law is unknown.
    """
    loop = closed_loop(subject, gains, lipschitz=lipschitz, gain_range=gain_range)
    certificate = refute(loop, subject) or proof(loop, subject)
    return (cached_verdict(certificate, subject), certificate) if certificate else (Verdict.UNDECIDED, None)


def proof(loop: Loop, subject: Subject) -> Certificate | None:
    """Certificate of stability of a loop that has no known counterexample; None if no proof is found."""
    return find_certificate(loop, subject=subject) or _swept(loop, subject)


def _swept(loop: Loop, subject: Subject) -> Certificate | None:
    """Certificate by the programme of `Sweep`, which normalises the mean of V and is more accurate near the limits."""
    for degree in candidate_degrees(loop):
        try:
            sweep = Sweep(loop, degree)
            solution = sweep.solve(loop)
        except CertificateError:  # no candidates of this degree, or numbers too far apart
            continue
        if solution is not None and solution.feasible:
            certificate = prove(sweep, loop, solution, subject)
            if certificate is not None:
                return certificate
    return None


def closed_loop(
    subject: Subject, gains: tuple[Number, ...], *, lipschitz: Number, gain_range: tuple[Number, Number] = (1, 1)
) -> Loop:
    """Loop with exact gains for |d| ≤ lipschitz and all β of a range.

    Raises
    ------
    ParameterError, UnknownNameError
        As `certify`.
    CertificateError
        When certificates do not support a part of the law.
    """
    name, model = model_of(subject)
    exact = exact_gains(subject, gains)
    if {str(symbol) for symbol in model.gains} != set(exact):
        raise ParameterError(
            f"the loop of {name} must have the gains of the law, {', '.join(exact)}. "
            f"Received {', '.join(map(str, model.gains))}."
        )
    ranges = _ranges(name, model, lipschitz, gain_range)
    _require_declared(model, {gain: (value, value) for gain, value in exact.items()} | ranges)
    loop = loop_of(name, model, gains=exact, uncertain=ranges)
    _require_homogeneous(loop)
    return loop


def _require_declared(model: LoopField, ranges: Mapping[str, tuple[Fraction, Fraction]]) -> None:
    """Reject numbers that violate the assumptions of their symbol, which SymPy has used to simplify the field."""
    numbers: dict[sp.Symbol, set[sp.Expr]] = {}
    for symbol in (*model.gains, *model.uncertain):
        low, high = ranges[str(symbol)]
        numbers[symbol] = {to_sympy(v) for v in (low, high, min(max(low, Fraction(0)), high))}
        if low < high:
            numbers[symbol].add(to_sympy(low) + to_sympy(high - low) / sp.sqrt(2))
    numbers |= {root: {sp.sqrt(to_sympy(ranges[str(of)][0]))} for root, of in model.roots.items() if of in numbers}
    for symbol, values in numbers.items():
        for kind, declared in symbol.assumptions0.items():
            wrong = [v for v in values if getattr(v, f"is_{kind}") != declared]
            if wrong:
                raise ParameterError(
                    f"{symbol} must be {'' if declared else 'not '}{kind}, as declared in the loop. Received a gain "
                    f"or range with the value {wrong[0]}. Declare the symbol with real=True only."
                )


def _require_homogeneous(loop: Loop) -> None:
    """Reject a field, or argument of a nested power, whose terms differ in degree in the weights of the loop."""
    weights: dict[str, Fraction] = {state: Fraction(weight) for state, weight in loop.states.items()}
    for lift, terms in loop.lifts.items():
        degrees = _degrees(loop, terms, weights)
        _require_one({m: f"{t} in a nested power" for m, t in degrees.items()}, loop)
        weights[lift] = next(iter(degrees), Fraction(1))
    every: dict[Fraction, str] = {}
    for state, terms in loop.field.items():
        every |= {m - loop.states[state]: f"{t} in {state}'" for m, t in _degrees(loop, terms, weights).items()}
    _require_one(every, loop)


def _degrees(loop: Loop, terms: tuple[Term, ...], weights: Mapping[str, Fraction]) -> dict[Fraction, str]:
    """Degrees of the nonzero terms, each with the factors of one term of this degree."""
    zero = {name for name, v in loop.parameters.items() if not v}
    zero |= {name for name, ends in loop.ranges.items() if not any(ends)}
    live = (t for t in terms if not zero & set(t.parameters))
    return {
        sum((a * weights[x] for x, a, _ in t.factors), Fraction(0)): "·".join(
            (*t.parameters, *(f"{x}^{a}" for x, a, _ in t.factors)) or ("1",)
        )
        for t in live
    }


def _require_one(degrees: Mapping[Fraction, str], loop: Loop) -> None:
    if len(degrees) > 1:
        (m, first), (n, second), *_ = degrees.items()
        raise ParameterError(
            f"the loop must be homogeneous in the weights {dict(loop.states)}. Received degree {m} of "
            f"{first} and {n} of {second}. Use the weights from quakedesign.symbolic.homogeneity.weights_for."
        )


def exact_gains(subject: Subject, gains: tuple[Number, ...]) -> dict[str, Fraction]:
    """Gains by name, exact, in the order of the law.

    Raises
    ------
    ParameterError
        When their number is wrong, or the law rejects them.
    """
    if not isinstance(subject, LoopField):
        chosen = law(subject) if isinstance(subject, str) else subject
        return dict(chosen.from_values(tuple(gains)).gains)
    names = [str(symbol) for symbol in subject.gains]
    if len(gains) != len(names):
        raise ParameterError(f"the loop needs {len(names)} gains ({', '.join(names)}). Received {len(gains)}.")
    return {name: rational(v, f"gain {name}") for name, v in zip(names, gains, strict=True)}


def _ranges(
    name: str, model: LoopField, lipschitz: Number, gain_range: tuple[Number, Number]
) -> dict[str, tuple[Fraction, Fraction]]:
    bound = rational(lipschitz, "lipschitz")
    low, high = (rational(v, "gain_range") for v in gain_range)
    if bound < 0 or not 0 < low <= high:
        raise ParameterError(
            f"lipschitz must not be negative and gain_range must be 0 < b_m <= b_M. Received {bound}, [{low}, {high}]."
        )
    ranges = {"beta": (low, high), "d": (-bound, bound)}
    unknown = [*(str(u) for u in model.uncertain if str(u) not in ranges), *map(str, model.constants)]
    if unknown or model.domain != "cells":
        raise ParameterError(
            "a Lipschitz bound requires a sliding-mode law whose uncertain parameters are beta or d. "
            f"Received {name!r} with {', '.join(unknown) or 'a polynomial loop'}."
        )
    return {str(u): ranges[str(u)] for u in model.uncertain}


# ----------------------------------------------------------------------
# Largest number for which a search succeeds, from margins and their slopes, with few solves.

TOLERANCE = Fraction(1, 10_000)
"""Relative width of a bracket: the search succeeds at x and not at x(1 + TOLERANCE)."""
_BELOW, _ABOVE = TOLERANCE / 2, TOLERANCE / 5  # intended distances of the bracket's ends from the root
_MOST = 40  # largest number of evaluations
_STRIDE = 8  # largest factor by which one step increases the distance from the floor
_TANGENTS = 6  # evaluations after which tangents are combined with bisection
_NEAR = 3 * TOLERANCE  # relative distance from the root below which the other end of the bracket is tried


@dataclass(frozen=True, slots=True, kw_only=True)
class Bracket:
    """Numbers at which a search succeeds and fails."""

    low: Fraction | None = None  # Largest number at which the search succeeded
    # Smallest number at which it failed; None if none was tried, as a limit makes a trial unnecessary
    high: Fraction | None = None
    best: Screened | None = None  # Solution at `low`
    evaluations: int = 0  # Number of evaluations

    def closed(self, limit: Fraction | None) -> bool:
        """Whether `low` is within the tolerance of `high` or of a limit."""
        ends = [end for end in (self.high, limit) if end is not None]
        return self.low is not None and any(end <= self.low * (1 + TOLERANCE) for end in ends)

    def updated(self, x: Fraction, solution: Screened | None) -> "Bracket":
        """Bracket after one more evaluation."""
        if solution is not None and solution.feasible:
            return Bracket(low=x, high=self.high, best=solution, evaluations=self.evaluations + 1)
        return Bracket(low=self.low, high=x, best=self.best, evaluations=self.evaluations + 1)


def last_success(
    evaluate: Callable[[Fraction], tuple[Screened | None, float]],
    first: Fraction,
    *,
    floor: Fraction = Fraction(0),
    limit: Fraction | None = None,
    most: Fraction | None = None,
    only_above: bool = False,
) -> Bracket:
    """Bracket of the largest number at which a search succeeds, by Newton's method inside the bracket.

    Parameters
    ----------
    evaluate : callable
        Function of a number; returns the solution at this number, and the derivative of its margin.
    first : Fraction
        Initial number; the floor if no better guess is known.
    floor : Fraction
        Smallest admissible number.
    limit : Fraction, optional
        Smallest number at which no search can succeed; the search stays below it.
    most : Fraction, optional
        Number from which on a success ends the search.
    only_above : bool
        Stop if the search fails at `first`.

    Returns
    -------
    Bracket
        Without `low` if the search fails even at the floor, or at `first` with `only_above`.
    """
    bracket, x = Bracket(), first
    for _ in range(_MOST):
        solution, slope = evaluate(x)
        bracket = bracket.updated(x, solution)
        enough = most is not None and bracket.low is not None and bracket.low >= most
        if bracket.closed(limit) or enough or bracket.high == floor or (only_above and bracket.low is None):
            break
        step = _next(bracket, x, _root(x, solution, slope), floor, limit)
        x = max(floor, Fraction(f"{float(step):.7e}"))  # eight digits suffice
    return bracket


def _root(x: Fraction, solution: Screened | None, slope: float) -> Fraction | None:
    """Number at which the tangent of the margin reaches `SURE`; None without a decreasing tangent."""
    if solution is None or not slope < 0:
        return None
    return Fraction(float(x) - (solution.margin - SURE) / slope)


def _next(bracket: Bracket, x: Fraction, root: Fraction | None, floor: Fraction, limit: Fraction | None) -> Fraction:
    """Next number to try: near the tangent's root, on the side where the bracket needs an end; else the middle."""
    low, high = bracket.low, bracket.high
    unusable = root is None or root <= floor or bracket.evaluations > _TANGENTS
    if low is None and bracket.evaluations > 1 and unusable:
        return floor
    ceiling = None if limit is None else first_below(limit)
    middle = _middle(x, low, high, floor, ceiling)
    if root is None or (bracket.evaluations > _TANGENTS and bracket.evaluations % 3 == 0):
        return middle
    near = abs(root - x) < _NEAR * x
    guess = root * (1 - _BELOW) if not near or x == high else root * (1 + _ABOVE)
    if x > floor:
        guess = min(guess, floor + (x - floor) * _STRIDE)
    if ceiling is not None:
        guess = min(guess, ceiling)
    bottom = low if low is not None else (floor + x) / 2
    return guess if bottom < guess and (high is None or guess < high) else middle


def _middle(
    x: Fraction, low: Fraction | None, high: Fraction | None, floor: Fraction, ceiling: Fraction | None
) -> Fraction:
    if high is None:
        doubled = 2 * x - floor if x > floor else x + 1
        return doubled if ceiling is None else min(doubled, ceiling)
    return ((floor if low is None else low) + high) / 2


def first_below(limit: Fraction) -> Fraction:
    """Number below a limit, so close to it that success there ends the search."""
    return limit * (1 - _BELOW - _ABOVE)


# ----------------------------------------------------------------------
# Proved limits of given gains: the largest disturbance or range of β, each with an upper bound.

_STEPS_BACK = (Fraction(0), TOLERANCE / 4, TOLERANCE / 2, 10 * TOLERANCE, 100 * TOLERANCE)
_FAR = Fraction(10) ** 12  # least bound on |d| in the search for a counterexample
_WIDE = 10**6  # factor of β at which the search stops
_LEAST_WIDTH = Fraction(1, 10**9)  # least relative width of a range of β, so that it always has two ends


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedLimit:
    """Largest proved value of one quantity for given gains, with the proof."""

    quantity: str  # ``"lipschitz"``, ``"beta"`` (upper end b_M) or ``"beta-factor"`` (range [b/f, b·f])
    value: Fraction | None  # Proved exactly; None if the search finds no proof
    # Largest over all degrees of the smallest number at which the search failed; at most value·(1 + 1e-4) unless an
    # exact proof failed. None if `limit` is within 1e-4 of the value, or no search failed
    beyond: Fraction | None
    limit: Fraction | None  # Value at which no Lyapunov function of any kind exists; None if unknown
    degrees: tuple[int, ...]  # Degrees of V, tried in order until `limit` is reached; no multiplier in the proofs
    degree: int | None  # Degree of V in the certificate
    # Proof for the value; without a proof, the exact counterexample, if one is known
    certificate: Certificate | None
    counterexample: str  # Kind of counterexample if nothing is proved, see `counterexample_kind`; else ``"none"``
    solves: int  # Number of conic programmes solved
    seconds: float  # Wall time [s]

    @property
    def sharp(self) -> bool:
        """Whether the value is the largest for its family of V to four digits, or within a relative 1e-4 of `limit`."""
        ends = [end for end in (self.beyond, self.limit) if end is not None]
        return self.value is not None and any(end <= self.value * (1 + TOLERANCE) for end in ends)

    def smallest_scale(self, lipschitz: Number) -> Fraction | None:
        """Smallest gain scale λ = L̄/value with which the gains are proved for a required L̄; None without a proof.

        Raises
        ------
        ParameterError
            When the bound is not positive, or this is the limit of another quantity.
        """
        needed = rational(lipschitz, "lipschitz")
        if needed <= 0 or self.quantity != "lipschitz":
            raise ParameterError(
                "a scale needs the limit of lipschitz and a positive bound. Received the limit of "
                f"{self.quantity} and the bound {needed}."
            )
        return needed / self.value if self.value else None


@dataclass(frozen=True, slots=True)
class _Line:
    """Loops as a function of one number x ≥ floor, and the derivatives of the sweep's parameters with respect to x."""

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
) -> CertifiedLimit:
    """Largest L̄ for which the gains are proved for all |d| ≤ L̄ and all β of a range.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        As in `certify`.
    gains : tuple of number or text
        As in `certify`.
    gain_range : tuple of two numbers or texts
        Range [b_m, b_M] of β [-].
    degrees : int or iterable of int, optional
        Degrees of V to try; by default those of `certify`.

    Raises
    ------
    ParameterError, UnknownNameError
        As `certify`.
    CertificateError
        When certificates do not support a part of the law.
    """
    began = perf_counter()
    base = closed_loop(subject, gains, lipschitz=1, gain_range=gain_range)
    _needs(base, "d", "largest L̄")
    limit = necessary_limit(base, subject)

    def at(x: Fraction) -> Loop:
        return replace(base, uncertain={**base.uncertain, "d": (-x, x)})

    first = _disturbance_scale(base) if limit is None else first_below(limit)
    line = _Line("lipschitz", at, lambda x: {"d": 1.0}, Fraction(0), first, limit)
    return _largest(line, subject, _chosen(degrees, base), began)


def largest_gain_range(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number,
    nominal: Number = 1,
    symmetric: bool = False,
    degrees: int | Iterable[int] | None = None,
) -> CertifiedLimit:
    """Largest range of β for which the gains are proved for all |d| ≤ lipschitz.

    Parameters
    ----------
    subject, gains, degrees
        See `largest_lipschitz`.
    lipschitz : number or text
        Bound L̄ on |d| [unit of ν per s].
    nominal : number or text
        Lower end b [-] of the range, or its geometric middle if symmetric.
    symmetric : bool
        Compute the largest f with range [b/f, b·f] instead of the largest b_M with range [b, b_M].

    Returns
    -------
    CertifiedLimit
        Limit whose value is b_M or f.

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
        x = max(x, floor * (1 + _LEAST_WIDTH))
        ends = (middle / x, middle * x) if symmetric else (middle, x)
        return replace(base, uncertain={**base.uncertain, "beta": ends})

    def direction(x: float) -> dict[str, float]:
        return {"beta+": b, "beta-": -b / x**2} if symmetric else {"beta+": 1.0}

    line = _Line(
        "beta-factor" if symmetric else "beta", at, direction, floor, Fraction(11, 10) * floor, None, _WIDE * floor
    )
    return _largest(line, subject, _chosen(degrees, base), began)


def necessary_limit(loop: Loop, subject: Subject) -> Fraction | None:
    """Smallest known bound on |d| for which no proof exists, from the law or an equilibrium; None if unknown."""
    chosen = None if isinstance(subject, LoopField) else law(subject) if isinstance(subject, str) else subject
    limit = chosen(gains=dict(loop.gains)).lipschitz_limit if chosen is not None else None
    limits = [] if limit is None else [max(Fraction(0), limit)]
    for bound in (Fraction(0), max(_FAR, 4 * _disturbance_scale(loop))):
        refuted = refute(replace(loop, uncertain={**loop.uncertain, "d": (-bound, bound)}), subject)
        if refuted is not None and refuted.refutation is not None:
            limits.append(abs(refuted.refutation.parameters["d"]))
    return min(limits, default=None)


def counterexample_kind(loop: Loop, refuted: Certificate | None) -> str:
    """Kind of counterexample to a loop without a proof.

    ``"exact"`` for a refuting equilibrium, ``"simulated"`` for a simulation whose state grows, else ``"none"``.
    """
    if refuted is not None:
        return "exact"
    return "simulated" if escape(loop) is not None else "none"


def _largest(line: _Line, subject: Subject, degrees: tuple[int, ...], began: float) -> CertifiedLimit:
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
        kind = counterexample_kind(loop, certificate)
    return CertifiedLimit(
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
    """Search along a line with one degree of V."""

    def __init__(self, line: _Line, subject: Subject, degree: int) -> None:
        self.line, self.subject = line, subject
        reference = line.at(line.limit or line.first)
        self.sweep = Sweep(reference, degree)
        self.frame = self.sweep.frame(reference)

    def evaluate(self, x: Fraction) -> tuple[Screened | None, float]:
        """Solution at x, and the derivative of its margin with respect to x."""
        solution = self.sweep.solve(self.line.at(x), self.frame)
        if solution is None:
            return None, 0.0
        return solution, sum(solution.slopes.get(n, 0.0) * step for n, step in self.line.direction(float(x)).items())

    def above(self, value: Fraction | None) -> Bracket:
        """Bracket of the largest number; has `low` only if it exceeds the proved value."""
        first = self.line.first if value is None else value * (1 + TOLERANCE * Fraction(9, 10))
        return last_success(
            self.evaluate,
            first,
            floor=self.line.floor,
            limit=self.line.limit,
            most=self.line.most,
            only_above=value is not None,
        )

    def proved(self, bracket: Bracket) -> tuple[Fraction, Certificate] | None:
        """Number at or just below the lower end of a bracket, and its certificate; None without a proof."""
        assert bracket.low is not None
        solution = bracket.best
        for step in _STEPS_BACK:
            x = max(self.line.floor, bracket.low * (1 - step))
            solution = solution if x == bracket.low else self.evaluate(x)[0]
            if solution is not None and solution.feasible:
                certificate = prove(self.sweep, self.line.at(x), solution, self.subject)
                if certificate is not None:
                    return x, certificate
        return None


def _chosen(degrees: int | Iterable[int] | None, loop: Loop) -> tuple[int, ...]:
    if degrees is None:
        return candidate_degrees(loop)
    return (degrees,) if isinstance(degrees, int) else tuple(degrees)


def _disturbance_scale(loop: Loop) -> Fraction:
    """Half the sum of the magnitudes of all other terms in the rates that contain d."""
    rates = [terms for terms in loop.field.values() if any("d" in t.parameters for t in terms)]
    ends = {name: max(map(abs, range_)) for name, range_ in loop.ranges.items()}
    values = {**loop.parameters, **ends}
    return (
        sum((abs(coefficient(t, values)) for terms in rates for t in terms if "d" not in t.parameters), Fraction(0)) / 2
    )


def _needs(loop: Loop, name: str, what: str) -> None:
    if name not in loop.uncertain:
        raise ParameterError(f"the {what} needs a law that is uncertain in {name}. Received {loop.law!r}.")
