"""Weighted homogeneity of functions and vector fields, weights, and relative degree.

Homogeneity is proved symbolically or refuted by an exact counterexample. Δ is the dilation x_i → ε^{r_i}x_i, Δ² that
with ε² in place of ε, and m the degree. The weights r_i are computed from the terms of the field. The relative degree
is the lowest order at which a time derivative of the output depends on the control.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, islice, product
from typing import Any

import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.symbolic.enclosure import enclose
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, normal_form, signs, symbols_of
from quakedesign.symbolic.term_expressions import lie_derivative

# ----------------------------------------------------------------------
# Weighted homogeneity of functions and of fields with signs, with a proof or an exact counterexample.

Weights = Mapping[sp.Symbol, int | sp.Rational]
epsilon = sp.Dummy("epsilon", positive=True)  # differs from every symbol of the user
_TRIES = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Claim that left = right for every state and every ε > 0."""

    # left, right: In the states and ε
    left: sp.Expr
    right: sp.Expr

    @property
    def holds(self) -> bool:
        """Whether both sides have the same normal form; recomputed."""
        return bool(normal_form(self.left - self.right) == 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterexample:
    """A point and an ε at which a necessary identity fails."""

    identity: Identity  # Necessary for homogeneity
    meaning: str  # The identity in words
    point: Mapping[sp.Symbol, sp.Rational]  # Exact values of all states and parameters
    epsilon: sp.Rational

    @property
    def values(self) -> tuple[sp.Expr, sp.Expr]:
        """Exact values of both sides at the point."""
        at = {**self.point, epsilon: self.epsilon}
        left, right = (side.subs(at, simultaneous=True) for side in (self.identity.left, self.identity.right))
        return left, right

    @property
    def holds(self) -> bool:
        """Whether both sides are proved to differ at the point, by ball arithmetic."""
        left, right = self.values
        return _differ(left, right)

    def __str__(self) -> str:
        where = ", ".join(f"{s} = {v}" for s, v in self.point.items())
        left, right = self.values
        return f"{self.meaning} fails at {where}, ε = {self.epsilon}: {left} ≠ {right}"


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Homogeneity:
    """Whether a function or field is r-homogeneous, and its degree (Bacciotti, Rosier 2005; inclusions: Levant 2005).

    Attributes
    ----------
    weights : mapping of Symbol to Rational
        r_i of every state.
    degree : Rational or None
        Degree, if proved. For a function or field that is identically zero, the requested degree or None.
    proof : tuple of Identity
        One identity for a function, one for every component of a field; empty without a proof.
    counterexample : Counterexample or None
        Point at which a necessary identity fails.
    switching : tuple of (Expr, Rational)
        Arguments of signs with their degrees: the switching surfaces are invariant under dilation. An identity that
        holds for every choice of the signs therefore also holds for set-valued signs.
    """

    weights: Mapping[sp.Symbol, sp.Rational]
    degree: sp.Rational | None
    proof: tuple[Identity, ...] = ()
    counterexample: Counterexample | None = None
    switching: tuple[tuple[sp.Expr, sp.Rational], ...] = ()

    @property
    def verdict(self) -> str:
        """``proved``, ``refuted`` or ``undecided``, recomputed from the identities and the counterexample."""
        if self.proof and all(identity.holds for identity in self.proof):
            return "proved"
        return "refuted" if self.counterexample is not None and self.counterexample.holds else "undecided"

    def __bool__(self) -> bool:
        return self.verdict == "proved"

    def _repr_latex_(self) -> str:
        if self.proof:
            rows = [rf"{sp.latex(i.left)} &= {sp.latex(i.right)}" for i in self.proof]
            return r"$\displaystyle\begin{aligned}" + r"\\".join(rows) + r"\end{aligned}$"
        return rf"$\text{{{self.counterexample or self.verdict}}}$"


def dilation(weights: Weights, factor: sp.Expr = epsilon) -> dict[sp.Symbol, sp.Expr]:
    """x_i → ε^{r_i}x_i, for `subs`.

    Raises
    ------
    ParameterError
        If a weight is not a positive rational, or the factor is not known to be positive.
    """
    exact = {state: sp.sympify(weight) for state, weight in weights.items()}
    wrong = {state: weight for state, weight in exact.items() if not (weight.is_Rational and weight > 0)}
    if wrong or not factor.is_positive:
        raise ParameterError(
            f"weights must be positive rationals and the factor positive. Received {wrong or factor}. "
            "Use for example 3, 2, 1."
        )
    return {state: factor**weight * state for state, weight in exact.items()}


def dilate(expression: sp.Expr, weights: Weights, factor: sp.Expr = epsilon) -> sp.Expr:
    """Expression at the dilated point, in normal form: ε is factored out wherever an argument is homogeneous."""
    return normal_form(normal_form(expression).subs(dilation(weights, factor), simultaneous=True))


def homogeneous(
    subject: sp.Expr | Mapping[sp.Symbol, sp.Expr], weights: Weights, degree: int | sp.Rational | None = None
) -> Homogeneity:
    """Degree of homogeneity with a proof, or an exact counterexample.

    Parameters
    ----------
    subject : Expr or mapping of Symbol to Expr
        A function V, tested for V(Δx) = ε^m V(x), or a field f, tested for f(Δx) = ε^m Δf(x), single- or set-valued.
        Only the symbols in `weights` are dilated.
    weights : mapping of Symbol to int or Rational
        r_i > 0 of every state.
    degree : int or Rational, optional
        Degree to prove or refute; by default the degree is computed.

    Returns
    -------
    Homogeneity
        Verdict with its proof or counterexample; its truth value is True only if homogeneity is proved.

    Raises
    ------
    ParameterError
        If a weight is missing or not a positive rational.
    """
    rates = subject if isinstance(subject, Mapping) else {None: subject}
    components = {s: normal_form(r) for s, r in rates.items()}
    missing = [s for s in components if s is not None and s not in weights]
    if missing:
        raise ParameterError(f"every state needs a weight. Received none for {', '.join(map(str, missing))}.")
    exact = {s: sp.sympify(r) for s, r in weights.items()}
    return _decided(components, exact, None if degree is None else sp.sympify(degree))


def _decided(components: Mapping[Any, Any], weights: Mapping[Any, Any], degree: sp.Rational | None) -> Homogeneity:
    moved = {s: dilate(e, weights) for s, e in components.items()}
    degrees = {s: _degrees(e) for s, e in moved.items()}
    differences = {m - weights.get(s, 0) for s, several in degrees.items() if several is not None for m in several}
    homogeneous = all(several is not None for several in degrees.values())
    if homogeneous and len(differences | ({degree} if degree is not None else set())) <= 1:
        m = next(iter(differences), degree)
        proof = tuple(
            Identity(left=e.subs(dilation(weights), simultaneous=True), right=epsilon ** (m + weights.get(s, 0)) * e)
            if e != 0
            else Identity(left=e, right=e)
            for s, e in components.items()
        )
        return Homogeneity(weights=weights, degree=m, proof=proof, switching=_switching(components, weights))
    claims = _claims(components, weights, degree)
    failure = next((c for claim in claims if (c := _search(*claim, weights)) is not None), None)
    return Homogeneity(weights=weights, degree=None, counterexample=failure)


def _degrees(dilated: sp.Expr) -> set[sp.Rational] | None:
    """Exponents of ε in the terms of a sum; None if a term has no factor ε^q with rational q."""
    degrees = set()
    for term in sp.Add.make_args(dilated) if dilated != 0 else ():
        power = term.as_independent(epsilon, as_Add=False)[1]
        base, exponent = power.as_base_exp()
        if power != 1 and (base != epsilon or not exponent.is_Rational):
            return None
        degrees.add(sp.Integer(0) if power == 1 else exponent)
    return degrees


def _switching(components: Mapping[Any, Any], weights: Mapping[Any, Any]) -> tuple[tuple[sp.Expr, sp.Rational], ...]:
    switches = dict[sp.Expr, sp.Rational]()
    for e in components.values():
        for argument in signs(e):
            degrees = _degrees(dilate(argument, weights)) or {sp.Integer(0)}
            switches[argument] = max(degrees)
    return tuple(switches.items())


def _claims(
    components: Mapping[Any, Any], weights: Mapping[Any, Any], degree: sp.Rational | None
) -> Iterator[tuple[Identity, str]]:
    """Necessary identities for homogeneity of the claimed degree, or of any degree."""
    at = {e: e.subs(dilation(weights), simultaneous=True) for e in components.values()}
    if degree is not None:
        for s, e in components.items():
            m = degree + weights.get(s, 0)
            yield Identity(left=at[e], right=epsilon**m * e), f"f(Δx) = ε^{{{m}}} f(x) for f = {e}"
        return
    for e in components.values():
        twice = e.subs(dilation(weights, epsilon**2), simultaneous=True)
        yield (
            Identity(left=twice * e, right=at[e] ** 2),
            f"f(Δ²x)·f(x) = f(Δx)², Δ the dilation, necessary for any degree, for f = {e}",
        )
    for (s, e), (other, f) in combinations(components.items(), 2):
        left, right = epsilon ** weights[other] * at[e] * f, epsilon ** weights[s] * at[f] * e
        yield Identity(left=left, right=right), f"equality of the degrees of the components of {s} and {other}"


def _search(identity: Identity, meaning: str, weights: Mapping[Any, Any]) -> Counterexample | None:
    symbols = [s for s in symbols_of((identity.left, identity.right)) if s != epsilon]
    states = [s for s in symbols if s in weights]
    primes = dict(zip((s for s in symbols if s not in weights), map(sp.Integer, sp.sieve), strict=False))
    values = [sp.Integer(n) for n in (1, -1, 2, 0, -3)]
    for chosen in islice(product(values, repeat=len(states)), _TRIES):
        point = dict(zip(states, chosen, strict=True)) | primes
        counterexample = Counterexample(identity=identity, meaning=meaning, point=point, epsilon=sp.Integer(2))
        if not _on_a_switch(counterexample) and counterexample.holds:
            return counterexample
    return None


def _on_a_switch(counterexample: Counterexample) -> bool:
    """Whether the argument of a sign may vanish at the point: values there would not refute a set-valued identity."""
    at = {**counterexample.point, epsilon: counterexample.epsilon}
    both = sp.Tuple(counterexample.identity.left, counterexample.identity.right)
    return not all(_differ(argument.subs(at, simultaneous=True), sp.Integer(0)) for argument in signs(both))


def _differ(left: sp.Expr, right: sp.Expr) -> bool:
    try:
        enclosure = enclose(left - right, {})
    except (UnsupportedError, AttributeError):
        return False
    return bool(enclosure.is_finite() and not enclosure.contains(0))


# ----------------------------------------------------------------------
# Weights computed from the terms of a field.


def weights_for(rates: Mapping[sp.Symbol, sp.Expr], degree: int | sp.Rational) -> dict[sp.Symbol, sp.Rational]:
    """Unique weights for which a field is proved homogeneous of a given degree.

    Parameters
    ----------
    rates : mapping of Symbol to Expr
        Rate of every state.
    degree : int or Rational
        Degree of homogeneity, for example −1 for sliding modes with a discontinuous integral.

    Raises
    ------
    ParameterError
        If positive weights do not exist or are not unique, a term has no degree, or homogeneity is not proved.
    """
    unknown = {state: sp.Dummy(f"r_{state}", positive=True) for state in rates}
    equations: list[sp.Expr] = []
    for state, rate in rates.items():
        for term in sp.Add.make_args(normal_form(rate)):
            if any(f.has(*rates) for f in term.atoms(sp.Function) - term.atoms(SignedPower, AbsolutePower)):
                raise ParameterError(f"{term} is not a product of signed powers and has no degree.")
            if term != 0:
                equations.append(size_of(term, unknown, equations) - unknown[state] - degree)
    solution = sp.linsolve([e for e in equations if e != 0], *unknown.values())
    values = next(iter(solution), ())
    if not values or not all(v.is_Rational and v > 0 for v in values):
        raise ParameterError(
            f"the terms determine no unique positive weights for degree {degree}. Solving gives {solution}. "
            "Try another degree."
        )
    weights = dict(zip(rates, values, strict=True))
    if not homogeneous(rates, weights, degree):
        raise ParameterError(
            f"with the weights {weights} that the terms determine, homogeneity of degree {degree} is not proved."
        )
    return weights


def size_of(e: sp.Expr, sizes: Mapping[sp.Symbol, sp.Expr], equations: list[sp.Expr]) -> sp.Expr:
    """Degree of an expression from the degrees of its symbols; degrees add up in products.

    Conditions for sums, Max, Min and arguments of functions are appended to `equations`, as expressions that must be 0.
    Raises `ParameterError` for an exponent that is not rational.

    Parameters
    ----------
    sizes : mapping of Symbol to Expr
        Degrees of symbols, linear in the unknowns; every other symbol has degree 0.
    equations : list of Expr
        List that is extended in place.
    """
    if e in sizes or not e.has(*sizes):
        return sizes.get(e, sp.Integer(0))
    parts = [size_of(part, sizes, equations) for part in e.args]
    match e:
        case sp.Mul():
            return sum(parts, start=sp.Integer(0))
        case sp.Pow() | SignedPower() | AbsolutePower():
            if not e.args[1].is_Rational:
                raise ParameterError(f"an exponent must be rational. Received {e.args[1]} in {e}.")
            return parts[0] * e.args[1]
        case sp.Add() | sp.Max() | sp.Min() | sp.Abs():
            equations += [parts[0] - other for other in parts[1:]]
            return parts[0]
        case sp.sign():
            return sp.Integer(0)
    equations += parts
    return sp.Integer(0)


# ----------------------------------------------------------------------
# Relative degree: lowest order at which a time derivative of the output depends on the control.


def relative_degree(output: sp.Expr, field: Mapping[sp.Symbol, sp.Expr], control: sp.Symbol) -> int | None:
    """Least n for which the nth derivative of the output along the field depends on the control.

    Parameters
    ----------
    field : mapping of Symbol to Expr
        Rate of every state.

    Returns
    -------
    int or None
        None if no derivative up to the number of states depends on the control. If the field is smooth, no later one
        does either.
    """
    for degree, _ in enumerate(field, start=1):
        output = sp.expand(lie_derivative(output, field))
        if output.has(control):
            return degree
    return None
