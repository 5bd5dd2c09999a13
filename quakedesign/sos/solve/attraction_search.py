"""Search for Lyapunov functions and the largest regions of attraction of polynomial fields.

Chapters: points with V̇ ≥ 0 and lowest V; expansion of a region by alternation (W. Tan and A. Packard, IEEE Trans.
Automat. Contr. 53, 2008); stability and the largest proved level.
"""

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.optimize import fsolve, minimize

from quakedesign.errors import PolynomialError
from quakedesign.exact import fraction_of, nearest
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.attraction import Attraction, LyapunovProof, Region, along
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    combination,
    constant,
    degree,
    evaluate,
    mapping,
    monomials,
    product,
)
from quakedesign.sos.exact.polynomial_statement import Statement, statement
from quakedesign.sos.exact.polynomial_text import read
from quakedesign.sos.exact.proofs import Point, SumOfSquares, form, integer_gram
from quakedesign.sos.exact.words import polynomial_words
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.sos.solve.engine import decide
from quakedesign.sos.solve.facial_reduction import just_below, simplest, simplest_between
from quakedesign.sos.solve.points import Arrays
from quakedesign.sos.solve.program import NoSolution, Program

# ----------------------------------------------------------------------
# Points with V̇ ≥ 0 and the lowest V: sought in floating point, then made rational and checked exactly.

_SEED = 20240609
_DIRECTIONS, _REFINED, _STARTS = 300, 3, 30  # directions per state, refined directions, starts for equilibria
_NEAR = 1e-3  # distance from the origin of the point tried on a ray along which V̇ is not negative near the origin
_PRECISE = {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 200}
_TOLERANCES = (1e-3, 1e-7, 1e-12)  # relative tolerances of the fractions tried for a point
_BEYOND = (0.0, 1e-10, 1e-7, 1e-4)  # relative distance by which a point is moved outward


class _Rays:
    """A function (V or a shape) at the first points on rays from the origin where a polynomial is not negative."""

    def __init__(self, size: int, lyapunov: Polynomial, rate: Polynomial) -> None:
        self.size = size
        self.lyapunov = Arrays(lyapunov, size)
        self.rate = self.graded(rate)

    def graded(self, polynomial: Polynomial) -> list[Arrays]:
        """Homogeneous parts of a polynomial, by degree."""
        top = max((sum(e) for e in polynomial), default=0)
        return [Arrays({e: c for e, c in polynomial.items() if sum(e) == k}, self.size) for k in range(top + 1)]

    def crossings(self, directions: np.ndarray, parts: list[Arrays]) -> np.ndarray:
        """First point on each ray where a polynomial is not negative, one per row; infinite where there is none."""
        table = np.array([part.at(directions) for part in parts]).T
        distances = np.array([_first_root(row) for row in table])
        return np.where(
            np.isfinite(distances)[:, None], np.nan_to_num(distances, posinf=0.0)[:, None] * directions, np.inf
        )

    def heights(self, directions: np.ndarray) -> np.ndarray:
        """The function at the first point of every ray; infinite where there is none."""
        points = self.crossings(directions, self.rate)
        finite = np.isfinite(points).all(axis=1)
        return np.where(finite, self.lyapunov.at(np.where(finite[:, None], points, 0.0)), np.inf)

    def height(self, direction: np.ndarray) -> float:
        """The function at the first point of one ray."""
        return float(self.heights((direction / np.linalg.norm(direction))[None, :])[0])

    def sampled(self) -> np.ndarray:
        """Seeded random directions and those of the axes, one per row."""
        random = np.random.default_rng(_SEED).standard_normal((_DIRECTIONS * self.size, self.size))
        return np.concatenate([random / np.linalg.norm(random, axis=1)[:, None], np.eye(self.size), -np.eye(self.size)])

    def lowest(self, directions: np.ndarray) -> list[np.ndarray]:
        """Refined directions in which the function is lowest at the first point."""
        heights = self.heights(directions)
        order = np.argsort(heights, kind="stable")[:_REFINED]
        starts = [directions[i] for i in order if np.isfinite(heights[i])]
        return [minimize(self.height, d, method="Nelder-Mead", options=_PRECISE).x for d in starts]


def _first_root(row: np.ndarray) -> float:
    """Smallest r > 0 where Σ row_k·r^k stops being negative; infinite if none; `_NEAR` if not negative near 0."""
    used = np.flatnonzero(row)
    if not len(used) or row[used[0]] > 0:
        return _NEAR
    roots = np.roots(row[used[0] :][::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-7 * (1 + np.abs(roots))) & (roots.real > 0)]
    return float(np.min(real, initial=np.inf))


def lowest_crossing(claim: Attraction) -> Point | None:
    """Rational point other than the origin with V ≤ 0 or V̇ ≥ 0 and the lowest V found; None without one."""
    size = len(claim.variables)
    rays = _Rays(size, claim.lyapunov, claim.derivative)
    directions = rays.sampled()
    ends = [rays.crossings((d / np.linalg.norm(d))[None, :], rays.rate)[0] for d in rays.lowest(directions)]
    depth = rays.graded({e: -c for e, c in claim.lyapunov.items()})
    below = rays.crossings(directions, depth)
    ends += list(below[np.isfinite(below).all(axis=1)][:_REFINED])
    candidates = (point for x in ends if np.all(np.isfinite(x)) for point in _rational(claim, x))
    return min(candidates, key=lambda point: evaluate(claim.lyapunov, point.coordinates), default=None)


def _rational(claim: Attraction, x: np.ndarray) -> Iterator[Point]:
    """Rational points near a point, or slightly farther out, that refute the claim."""
    for beyond in _BEYOND:
        for tolerance in _TOLERANCES:
            point = Point(coordinates=_fractions(x * (1 + beyond), tolerance))
            if claim.refuted_by(point):
                yield point


def _fractions(x: np.ndarray, tolerance: float) -> tuple[Fraction, ...]:
    """Simple fractions near the coordinates; zero for those far below the largest."""
    least = 1e-9 * float(np.abs(x).max())
    return tuple(simplest(float(v), tolerance) if abs(v) > least else Fraction(0) for v in x)


def other_equilibrium(claim: Attraction) -> Point | None:
    """Rational point other than the origin where the field vanishes; None if none is found."""
    size = len(claim.variables)
    field = [Arrays(f, size) for f in claim.field]
    random = np.random.default_rng(_SEED)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ends = [fsolve(lambda x: [f(x) for f in field], random.standard_normal(size) * 3) for _ in range(_STARTS)]
    for x in ends:
        for tolerance in _TOLERANCES if np.all(np.isfinite(x)) and np.abs(x).max() > 1e-3 else ():
            point = _fractions(x, tolerance)
            if any(point) and not any(evaluate(f, point) for f in claim.field):
                return Point(coordinates=point)
    return None


# ----------------------------------------------------------------------
# Search, by alternation, for a Lyapunov function whose region of attraction contains the largest set {shape ≤ β}.
#
# For the region V < 1, multipliers s and t with
#
#     −V̇ − s·(1 − V),  1 − V − t·(β − shape)  and  V  sums of squares
#
# are computed by `strict_proof` for a given V. With s and t fixed, a programme linear in V and β then maximises β (W.
# Tan and A. Packard, IEEE Trans. Automat. Contr. 53, 2008). The caller proves the level of every new V.

_ROUNDS = 30
_GROWTH = Fraction(1002, 1000)  # smallest growth of β in a round for which the search continues
_INSIDE = Fraction(999999, 1000000)  # share of the level that V must not exceed where shape ≤ β
# Shares of the β at which {shape ≤ β} touches the level set
_SHARES = tuple(Fraction(s) for s in ("99999/100000", "999/1000", "99/100", "9/10"))
# shares of level and β for which the multipliers are computed; at 1, V could not change
_SLACK = (Fraction(99, 100), Fraction(9, 10))
_MORE = (0, 2)
_LOSS = 1e-3  # share of the largest β given up for a V with a margin
_GRID = 2**20  # denominator of the coefficients of V


def with_shape(region: Region, shape: Polynomial) -> Region:
    """Region with the largest β found for which {shape ≤ β} is proved to be a subset."""
    claim = region.proved
    if claim is None or claim.level is None:
        return region
    size = len(claim.variables)
    boundary = combination([(Fraction(1), claim.lyapunov), (-claim.level, constant(size))])
    rays = _Rays(len(next(iter(boundary))), shape, boundary)
    touching = min(map(rays.height, rays.lowest(rays.sampled())), default=0.0)
    if not 0 < touching < inf:
        return region
    for beta in (just_below(Fraction(touching) * share) for share in _SHARES):
        inclusion = _inclusion(claim, _INSIDE * claim.level, shape, beta, degree(claim.lyapunov))
        proof = strict_proof(inclusion)
        if proof is not None:
            return replace(region, inclusion=Answer(statement=inclusion, proof=proof))
    return region


def expanded(given: Region, shape: Polynomial, top: int, certify: Callable[[Attraction], Region]) -> Region:
    """Enlarge the β for which {shape ≤ β} lies in a proved region, by a search for V of degree at most `top`.

    Parameters
    ----------
    given : Region
        Proved region to start from.
    shape : Polynomial
    top : int
        Largest degree of V, even; that of the given V if it is higher.
    certify : callable
        Maps a claim with a new V to a region with a proved level.
    """
    best = with_shape(given, shape)
    for degree_now in range(2, top + 1, 2):
        for _ in range(_ROUNDS):
            candidates = (with_shape(certify(claim), shape) for claim in _improved(best, shape, degree_now))
            least = None if best.shape_level is None else _GROWTH * best.shape_level
            better = next(
                (r for r in candidates if r.shape_level and least is not None and r.shape_level > least), None
            )
            if better is None:
                break
            best = better
    return best


def _improved(region: Region, shape: Polynomial, top: int) -> Iterator[Attraction]:
    """Unproved claims with new candidates for V, from multipliers computed first with small, then with large slack."""
    claim, beta = region.proved, region.shape_level
    if claim is None or claim.level is None or beta is None:
        return
    own = combination([(1 / claim.level, claim.lyapunov)])
    top = max(top, degree(own))
    for slack in _SLACK:
        candidate = replace(claim, lyapunov=own, level=slack, proof=None)
        falling = _multiplier(candidate.decrease, top - 1 + max(map(degree, claim.field)))
        inner = _multiplier(_inclusion(candidate, Fraction(1), shape, slack * beta, top), top)
        if falling is not None and inner is not None:
            lyapunov = _larger(claim, shape, top, falling, inner)
            if lyapunov is not None:
                yield replace(claim, lyapunov=lyapunov, level=None, proof=None)


def _inclusion(claim: Attraction, level: Fraction, shape: Polynomial, beta: Fraction, top: int) -> Statement:
    """Statement that V ≤ level where shape ≤ β."""
    one = constant(len(claim.variables))
    return statement(
        claim.variables,
        combination([(level, one), (Fraction(-1), claim.lyapunov)]),
        inequalities=(combination([(beta, one), (Fraction(-1), shape)]),),
        products=False,
        degree_bound=_even(max(top, degree(claim.lyapunov), degree(shape))),
    )


def _even(number: int) -> int:
    return number + number % 2


def _multiplier(statement: Statement, least: int) -> Polynomial | None:
    """Sum of squares that multiplies the inequality in a proof of at least a given degree; None without a proof."""
    for more in _MORE:
        proof = strict_proof(replace(statement, degree=max(statement.degree, _even(least)) + more))
        if proof is not None:
            size = len(statement.variables)
            parts = (mapping(form(s.basis, integer_gram(s), size)) for s in proof.squares if s.product)
            return combination((Fraction(1), part) for part in parts)
    return None


def _larger(
    claim: Attraction, shape: Polynomial, top: int, falling: Polynomial, inner: Polynomial
) -> Polynomial | None:
    """V of degree `top` with the largest β for two fixed multipliers; None if none is found."""
    size = len(claim.variables)
    terms = list(monomials(size, top, 2))
    program = Program(claim.variables, decision_names(claim.variables, len(terms) + 1))
    powers: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    minus = [combination([(Fraction(-1), p)]) for p in powers]
    slopes = [
        combination([(Fraction(-1), along(claim.field, p)), (Fraction(1), product(size, (falling, p)))]) for p in powers
    ]
    program.require(affine({}, [*powers, {}]))
    one = combination([(Fraction(1), constant(size)), (Fraction(1), product(size, (inner, shape)))])
    program.require(affine(one, [*minus, combination([(Fraction(-1), inner)])]))
    program.require(affine(combination([(Fraction(-1), falling)]), [*slopes, {}]))
    program.maximize({tuple(int(i == len(terms)) for i in range(len(terms) + 1)): Fraction(1)})
    values = program.proposal(_LOSS)
    if values is None:
        return None
    rounded = {e: nearest(v, _GRID) for e, v in zip(terms, values, strict=False)}
    return {e: c for e, c in rounded.items() if c}


def affine(fixed: Polynomial, parts: list[Polynomial]) -> dict[Exponents, Fraction]:
    """Polynomial fixed + Σ_j decision_j·part_j in variables and decisions, an argument of `Program.require`."""
    whole = {(*e, *(0,) * len(parts)): c for e, c in fixed.items()}
    for j, part in enumerate(parts):
        whole |= {(*e, *(int(i == j) for i in range(len(parts)))): c for e, c in part.items()}
    return whole


def decision_names(variables: tuple[str, ...], count: int) -> list[str]:
    """Names of decisions that differ from all variables."""
    prefix = "c" * (1 + max(map(len, variables)))
    return [f"{prefix}{i}" for i in range(count)]


# ----------------------------------------------------------------------
# Stability and regions of attraction of polynomial fields: Lyapunov functions, and their largest proved level.

_LEVEL_SHARES = tuple(
    Fraction(s) for s in ("999999/1000000", "9999/10000", "999/1000", "99/100", "9/10", "1/2", "1/10", "1/1000")
)
# levels tried if the search finds no refuting point
_UNBOUNDED = tuple(Fraction(10) ** power for power in range(6, -7, -1))
_FINEST = 1e-6  # smallest relative width for which the levels of the bisection have few digits


def stability(field: Mapping[Any, Any], V: Any = None, *, degrees: Sequence[int] = (2, 4)) -> Attraction:
    """Decide global asymptotic stability of the origin of x' = field(x), by a polynomial Lyapunov function.

    Parameters
    ----------
    field : mapping of str or Symbol to str, SymPy expression or mapping
        Rate of every state: a polynomial in the states with rational coefficients that vanishes at the origin.
    V : str, SymPy expression or mapping, optional
        Lyapunov function; by default one is sought.
    degrees : sequence of int
        Degrees of V that the search tries in turn.

    Returns
    -------
    Attraction
        ``proved`` if the origin is globally asymptotically stable. ``refuted`` by a point where V ≤ 0 or V̇ ≥ 0 or,
        without a given V, by another equilibrium. ``undecided`` otherwise.

    Raises
    ------
    PolynomialError
        When field or V is not readable, or does not vanish at the origin.
    """
    claim = _claim(field, V)
    if V is not None:
        refuted = _refuted(claim)
        neither = "neither a proof that V and -dV/dt are positive nor a point that refutes V was found"
        return _proved(claim) or (replace(refuted, level=None) if refuted else replace(claim, reason=neither))
    rest = other_equilibrium(claim)
    if rest is not None:
        return replace(claim, proof=rest)
    reasons = []
    for top in degrees:
        candidate = _searched(claim, top)
        if isinstance(candidate, Attraction) and (proved := _proved(candidate)) is not None:
            return proved
        why = candidate.reason if isinstance(candidate, NoSolution) else "the V that was found has no exact proof"
        reasons.append(f"no V of degree {top}: {why}")
    return replace(claim, reason="; ".join(reasons) or "no degree of V was tried")


def region_of_attraction(
    field: Mapping[Any, Any], V: Any = None, *, relative: float = 1e-4, degree: int | None = None, shape: Any = None
) -> Region:
    """Find the largest ρ for which {V < ρ} is proved to be a region of attraction of the origin.

    Parameters
    ----------
    field, V
        As for `stability`. By default V = xᵀPx with AᵀP + PA = −I for the linearised field x' = Ax.
    relative : float
        Relative width of the final bracket of the bisection, in [1e-6, 1).
    degree : int, optional
        Even degree up to which other V are tried (or that of `V`, if higher), starting from `V` or its default, so that
        the region contains {shape ≤ β} for a larger β.
    shape : str, SymPy expression or mapping, optional
        A polynomial that is positive except at the origin. The result contains the largest β found for which {shape ≤
        β} is proved to lie in the region. By default Σ x_i² if a degree is given, otherwise none.

    Returns
    -------
    Region
        The largest proved level and, if found, a point that refutes every level above its value of V.

    Raises
    ------
    PolynomialError
        As for `stability`, or when the shape is not readable, `relative` is out of range, or `degree` is not even.
    """
    if not _FINEST <= relative < 1:
        raise PolynomialError(
            f"relative must be from {_FINEST:g} to below 1. Received {relative!r}. The default is 1e-4."
        )
    claim = _claim(field, V)
    inner = _shape(field, shape, degree)
    if V is None:
        own = _of_linearised(claim)
        if own is None:
            return Region(
                proved=None,
                refuted=None,
                remark="the linearised field has no positive definite V = x^T P x with A^T P + P A = -I: give a V",
            )
        claim = replace(claim, lyapunov=own)
    region = _region(claim, relative)
    if inner is None:
        return region
    return (
        with_shape(region, inner) if degree is None else expanded(region, inner, degree, lambda c: _region(c, relative))
    )


def _region(claim: Attraction, relative: float) -> Region:
    """Largest proved level for the V of a claim, and the lowest refuted level."""
    refuted = _refuted(claim)
    if refuted is None:
        proved = _proved(claim) or next(filter(None, (_proved(replace(claim, level=r)) for r in _UNBOUNDED)), None)
        return Region(proved=proved, refuted=None, remark="" if proved else "no level was proved, and none refuted")
    if refuted.level is None:
        return Region(proved=None, refuted=refuted, remark="V is not positive")
    region = Region(proved=_bisected(claim, refuted.height or Fraction(0), relative), refuted=refuted)
    return region if region.proved else replace(region, remark="no level below the refuted one was proved")


def _shape(field: Mapping[Any, Any], shape: Any, degree: int | None) -> Polynomial | None:
    """Exact shape; by default Σ x_i² if other V are tried (`degree`), otherwise None."""
    if degree is not None and not (isinstance(degree, int) and degree >= 2 and degree % 2 == 0):
        raise PolynomialError(f"degree must be an even number from 2. Received {degree!r}. Give for example 4.")
    if shape is None:
        return None if degree is None else _claim(field, None).lyapunov
    polynomial = read(shape, (), None, tuple(map(str, field)))[1]
    if any(sum(exponents) == 0 for exponents in polynomial):
        raise PolynomialError("a shape must vanish at the origin. Received a constant term. Omit the constant term.")
    return polynomial


def _claim(field: Mapping[Any, Any], V: Any) -> Attraction:
    """Claim about the whole space for a field and V in exact numbers; V is Σ x_i² by default."""
    names = tuple(map(str, field))
    size = len(names)
    if not names:
        raise PolynomialError("a field needs a rate for every state. Received none. Give for example {'x': '-x'}.")
    exact = tuple(read(f, (), None, names)[1] for f in field.values())
    squares = {tuple(2 * (i == j) for j in range(size)): Fraction(1) for i in range(size)}
    function = squares if V is None else read(V, (), None, names)[1]
    return Attraction(variables=names, field=exact, lyapunov=function, level=None, multiplier=constant(size))


def _refuted(claim: Attraction) -> Attraction | None:
    """Claim refuted by the point with the lowest V found, at a level just above V there (None if V ≤ 0), or None."""
    refuted = replace(claim, proof=lowest_crossing(claim))
    if refuted.height is None:
        return None
    low, high = (refuted.height * (1 + Fraction(part, 10**9)) for part in (1, 2))
    return _checked(replace(refuted, level=simplest_between(low, high) if low > 0 else None))


def _checked(claim: Attraction) -> Attraction | None:
    return claim if claim.check() else None


def _proved(claim: Attraction, *, thorough: bool = False) -> Attraction | None:
    """Claim with its proof; None if none is found."""
    positive = _squares(claim.positive, thorough)
    for more in _MORE if positive is not None else ():
        statement = replace(claim.decrease, degree=claim.decrease.degree + more)
        decrease = _squares(statement, thorough)
        if positive is not None and decrease is not None:
            proved = _checked(replace(claim, proof=LyapunovProof(positive=positive, decrease=decrease)))
            if proved is not None:
                return proved
    return None


def _squares(statement: Statement, thorough: bool) -> SumOfSquares | None:
    """Proof of one statement with a margin, or else, if `thorough`, by every method."""
    squares = strict_proof(statement)
    if squares is None and thorough:
        proof = decide(statement).proof
        squares = proof if isinstance(proof, SumOfSquares) else None
    return squares


def _bisected(claim: Attraction, ceiling: Fraction, relative: float) -> Attraction | None:
    """Claim of the largest proved level, if possible a simple number just below the refuted level."""
    best, above = None, ceiling
    for share in _LEVEL_SHARES:
        best = _proved(replace(claim, level=just_below(share * ceiling)))
        if best is not None:
            break
        above = share * ceiling
    if best is None or best.level is None:
        return None
    if above == ceiling:
        exact = replace(claim, level=simplest_between(best.level, ceiling))
        return _proved(exact, thorough=True) or best
    low = best.level
    while above - low > Fraction(relative) * above:
        middle = just_below((low + above) / 2)
        proved = _proved(replace(claim, level=middle))
        best, low, above = (proved, middle, above) if proved is not None else (best, low, middle)
    return best


def _of_linearised(claim: Attraction) -> dict[Exponents, Fraction] | None:
    """Exact V = xᵀPx with AᵀP + PA = −I; None if there is no positive one."""
    size = len(claim.variables)
    units = [tuple(int(i == j) for j in range(size)) for i in range(size)]
    A = [[f.get(u, Fraction(0)) for u in units] for f in claim.field]
    places = [(i, j) for i in range(size) for j in range(size)]
    rows = [[fmpq(0)] * len(places) for _ in places]
    for row, (i, j) in zip(rows, places, strict=True):
        for k in range(size):
            for place, entry in (((k, j), A[k][i]), ((i, k), A[k][j])):
                row[places.index(place)] += fmpq(entry.numerator, entry.denominator)
    try:
        P = fmpq_mat(rows).solve(fmpq_mat([[fmpq(-(i == j))] for i, j in places]))
    except ZeroDivisionError:
        return None
    parts = (
        (fraction_of(P[n, 0]), tuple(map(sum, zip(units[i], units[j], strict=True)))) for n, (i, j) in enumerate(places)
    )
    function = combination((value, {e: Fraction(1)}) for value, e in parts)
    return function if strict_proof(replace(claim, lyapunov=function).positive) is not None else None


def _searched(claim: Attraction, top: int) -> Attraction | NoSolution:
    """Claim with a V of given degree for which V − Σ x_i² and −V̇ are sums of squares, or the reason for the failure."""
    size = len(claim.variables)
    terms = list(monomials(size, top, 2))
    program = Program(claim.variables, decision_names(claim.variables, len(terms)))
    powers: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    program.require(affine(combination([(Fraction(-1), claim.lyapunov)]), powers))
    program.require(affine({}, [combination([(Fraction(-1), along(claim.field, p))]) for p in powers]))
    solution = program.solve()
    if isinstance(solution, NoSolution):
        terms_in_words = (polynomial_words({e: Fraction(1)}, claim.variables) for e in terms)
        named = dict(zip(program.decisions, terms_in_words, strict=True))
        return NoSolution(reason=re.sub(r"\bc+\d+\b", lambda m: f"the coefficient of {named[m[0]]}", solution.reason))
    values = zip(terms, solution.values.values(), strict=True)
    return replace(claim, lyapunov={e: c for e, c in values if c})
