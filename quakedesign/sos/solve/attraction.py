"""Stability and regions of attraction of polynomial fields: Lyapunov functions, and the largest level proved."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mat

from quakedesign.errors import PolynomialError
from quakedesign.rationals import fraction_of
from quakedesign.sos.exact.attraction import Attraction, LyapunovProof, Region, along
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, combination, constant, monomials
from quakedesign.sos.exact.proofs import SumOfSquares
from quakedesign.sos.exact.reading import read
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.decide import strict_proof
from quakedesign.sos.solve.engine import decide
from quakedesign.sos.solve.expanding_interior import affine, decision_names, expanded, with_shape
from quakedesign.sos.solve.faces import just_below, simplest_between
from quakedesign.sos.solve.level_crossing import lowest_crossing, other_equilibrium
from quakedesign.sos.solve.program import NoSolution, Program

_SHARES = tuple(
    Fraction(s) for s in ("999999/1000000", "9999/10000", "999/1000", "99/100", "9/10", "1/2", "1/10", "1/1000")
)
_UNBOUNDED = tuple(Fraction(10) ** power for power in range(6, -7, -1))  # levels where nothing refutes
_MORE = (0, 2)  # degrees beyond the least that fits
_FINEST = 1e-6  # step of a bisection whose levels are of few digits


def stability(field: Mapping[Any, Any], V: Any = None, *, degrees: Sequence[int] = (2, 4)) -> Attraction:
    """Decide whether every solution of x' = field(x) tends to the origin, by a polynomial Lyapunov function.

    Parameters
    ----------
    field : mapping of str or Symbol to str, SymPy expression or mapping
        For every state its rate: a polynomial in the states with rational coefficients that vanishes at the origin.
    V : str, SymPy expression or mapping, optional
        Searched unless given.
    degrees : sequence of int
        Of V, to be tried in turn where it is searched.

    Returns
    -------
    Attraction
        ``proved``: the origin is globally asymptotically stable. ``refuted``: by a point where V is not positive or
        does not fall; without a given V, by another equilibrium. ``undecided`` otherwise.

    Raises
    ------
    PolynomialError
        When something cannot be read, or does not vanish at the origin.
    """
    claim = _claim(field, V)
    if V is not None:
        refuted = _refuted(claim)
        return _proved(claim) or (replace(refuted, level=None) if refuted else claim)
    rest = other_equilibrium(claim)
    if rest is not None:
        return replace(claim, proof=rest)
    searched = filter(None, (_searched(claim, top) for top in degrees))
    return next(filter(None, map(_proved, searched)), claim)


def region_of_attraction(
    field: Mapping[Any, Any],
    V: Any = None,
    *,
    relative: float = 1e-4,
    degree: int | None = None,
    shape: Any = None,
) -> Region:
    """Find the largest level ρ for which V̇ < 0 wherever V < ρ, but at the origin: then {V < ρ} is attracted by it.

    Parameters
    ----------
    field, V
        As for `stability`, but V solves AᵀP + PA = −I for the linearised field x' = Ax unless given.
    relative : float
        Width of the last step of the bisection, between proved and not proved; from 1e-6 to below 1.
    degree : int, optional
        Even: search other V of at most this degree, from the one at hand, for a larger part of the shape in the region.
    shape : str, SymPy expression or mapping, optional
        A polynomial that is positive but at the origin. The largest β found is proved for which shape ≤ β lies in
        the region. Σ x_i² with a degree, none unless given.

    Returns
    -------
    Region
        The largest level proved, and a point that refutes every larger one where such a point is found.

    Raises
    ------
    PolynomialError
        As for `stability`, or for another width.
    """
    if not _FINEST <= relative < 1:
        raise PolynomialError(
            f"relative must be from {_FINEST:g} to below 1. Received {relative!r}. Leave it out for 1e-4."
        )
    claim = _claim(field, V)
    inner = _shape(field, shape, degree)
    if V is None:
        own = _of_linearised(claim)
        if own is None:
            return Region(proved=None, refuted=None, remark="the linearised field has no V = x'Px. Give a V")
        claim = replace(claim, lyapunov=own)
    found = _region(claim, relative)
    if inner is None:
        return found
    return (
        with_shape(found, inner) if degree is None else expanded(found, inner, degree, lambda c: _region(c, relative))
    )


def _region(claim: Attraction, relative: float) -> Region:
    """Largest level that is proved for the V of a claim, and what refutes more."""
    refuted = _refuted(claim)
    if refuted is None:
        proved = _proved(claim) or next(filter(None, (_proved(replace(claim, level=r)) for r in _UNBOUNDED)), None)
        return Region(proved=proved, refuted=None, remark="" if proved else "no level was proved, and none refuted")
    if refuted.level is None:
        return Region(proved=None, refuted=refuted, remark="V is not positive")
    found = Region(proved=_bisected(claim, refuted.height or Fraction(0), relative), refuted=refuted)
    return found if found.proved else replace(found, remark="no level below was proved")


def _shape(field: Mapping[Any, Any], shape: Any, degree: int | None) -> Polynomial | None:
    """The shape as it is read, Σ x_i² where V is searched without one, or else None."""
    if degree is not None and not (isinstance(degree, int) and degree >= 2 and degree % 2 == 0):
        raise PolynomialError(f"degree must be an even number from 2. Received {degree!r}. Give for example 4.")
    return None if shape is None and degree is None else _claim(field, shape).lyapunov


def _claim(field: Mapping[Any, Any], V: Any) -> Attraction:
    """The field as it is read, V or else Σ x_i²."""
    names = tuple(map(str, field))
    size = len(names)
    if not names:
        raise PolynomialError("a field needs a rate for every state. Received none. Give for example {'x': '-x'}.")
    exact = tuple(read(f, (), None, names)[1] for f in field.values())
    squares = {tuple(2 * (i == j) for j in range(size)): Fraction(1) for i in range(size)}
    function = squares if V is None else read(V, (), None, names)[1]
    return Attraction(variables=names, field=exact, lyapunov=function, level=None, multiplier=constant(size))


def _refuted(claim: Attraction) -> Attraction | None:
    """Level just above the lowest point found where V does not fall; no level where V is not positive."""
    found = replace(claim, proof=lowest_crossing(claim))
    if found.height is None:
        return None
    return _checked(replace(found, level=_just_above(found.height) if found.height > 0 else None))


def _just_above(height: Fraction) -> Fraction:
    """Simple number above one, by less than two parts in a thousand million."""
    return simplest_between(height * (1 + Fraction(1, 10**9)), height * (1 + Fraction(2, 10**9)))


def _checked(claim: Attraction) -> Attraction | None:
    return claim if claim.check() else None


def _proved(claim: Attraction, *, thorough: bool = False) -> Attraction | None:
    """Claim with its proof; None if none is found."""
    positive = _squares(claim.positive, thorough)
    for more in _MORE if positive is not None else ():
        asked = replace(claim.decrease, degree=claim.decrease.degree + more)
        decrease = _squares(asked, thorough)
        if positive is not None and decrease is not None:
            found = _checked(replace(claim, proof=LyapunovProof(positive=positive, decrease=decrease)))
            if found is not None:
                return found
    return None


def _squares(asked: Statement, thorough: bool) -> SumOfSquares | None:
    """Proof of one statement: with a margin, or where that has none, on a face."""
    found = strict_proof(asked)
    if found is None and thorough:
        proof = decide(asked).proof
        found = proof if isinstance(proof, SumOfSquares) else None
    return found


def _bisected(claim: Attraction, ceiling: Fraction, relative: float) -> Attraction | None:
    """Largest level that is proved, a simple number just below the refuted ones where it can be."""
    best, above = None, ceiling
    for share in _SHARES:
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
        found = _proved(replace(claim, level=middle))
        best, low, above = (found, middle, above) if found is not None else (best, low, middle)
    return best


def _of_linearised(claim: Attraction) -> dict[Exponents, Fraction] | None:
    """V = xᵀPx with AᵀP + PA = −I, exactly; None where there is no such V > 0."""
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
    found = combination((value, {e: Fraction(1)}) for value, e in parts)
    return found if strict_proof(replace(claim, lyapunov=found).positive) is not None else None


def _searched(claim: Attraction, top: int) -> Attraction | None:
    """Claim with a V of some degree for which V − Σ x_i² and −V̇ have squares; None if none is found."""
    size = len(claim.variables)
    terms = list(monomials(size, top, 2))
    program = Program(claim.variables, decision_names(claim.variables, len(terms)))
    powers: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    program.require(affine(combination([(Fraction(-1), claim.lyapunov)]), powers))
    program.require(affine({}, [combination([(Fraction(-1), along(claim.field, p))]) for p in powers]))
    solution = program.solve()
    if isinstance(solution, NoSolution):
        return None
    values = zip(terms, solution.values.values(), strict=True)
    return replace(claim, lyapunov={e: c for e, c in values if c})
