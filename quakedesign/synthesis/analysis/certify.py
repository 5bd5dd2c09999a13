"""The verdict on given gains of any homogeneous law, of the package or of a user's own."""

from collections.abc import Mapping
from fractions import Fraction

import sympy as sp

from quakedesign.certificates import Certificate, Loop, Verdict, decided_once, loop_of
from quakedesign.controllers import LoopField, Subject, law, model_of
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.rationals import rational, to_sympy
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.analysis.parametric_program import Sweep, prove
from quakedesign.synthesis.lyapunov.search import candidate_degrees, find_certificate, refute

Number = str | float | Fraction


def certify(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number,
    gain_range: tuple[Number, Number] = (1, 1),
) -> tuple[Verdict, Certificate | None]:
    """Decide whether gains make the origin stable for |d| ≤ lipschitz and all β of a range.

    Globally asymptotically, and in finite time where the field has a negative degree.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        Name of a law of the package, a class of the user's own, or a bare closed loop; uncertain in ``beta`` and ``d``
        or one of them. A certificate for one from outside the package is checked again with ``check(subject)``.
    gains : tuple of number or text
        Exact: decimals, exponents or p/q; order of the law.
    lipschitz : number or text
        L̄ [unit of ν per s], not negative.
    gain_range : tuple of two
        b_m and b_M [-], positive.

    Returns
    -------
    verdict : Verdict
    certificate : Certificate or None
        Proof or counterexample; None when undecided.

    Raises
    ------
    ParameterError
        For gains or ranges that are no numbers, a range that is empty or not positive, a law with other uncertainty, or
        one that is not homogeneous in its weights.
    CertificateError
        For a law with parts that certificates do not know, such as a squared uncertain parameter.
    UnknownNameError
        For the name of an unknown law.
    """
    loop = closed_loop(subject, gains, lipschitz=lipschitz, gain_range=gain_range)
    certificate = refute(loop, subject) or proof(loop, subject)
    return (decided_once(certificate, subject), certificate) if certificate else (Verdict.UNDECIDED, None)


def proof(loop: Loop, subject: Subject) -> Certificate | None:
    """Proof of a loop without a counterexample, or None."""
    return find_certificate(loop, subject=subject) or _swept(loop, subject)


def _swept(loop: Loop, subject: Subject) -> Certificate | None:
    """What the search along a line would find here; its V has a fixed mean, which serves better at the edges."""
    for degree in candidate_degrees(loop):
        try:
            sweep = Sweep(loop, degree)
            answer = sweep.solve(loop)
        except CertificateError:  # no candidates of this degree, or numbers too far apart
            continue
        if answer is not None and answer.found:
            certificate = prove(sweep, loop, answer, subject)
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
        When the law has parts that certificates do not know.
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
    """Refuse numbers that a symbol's declaration excludes: SymPy has simplified the field by it."""
    inside: dict[sp.Symbol, set[sp.Expr]] = {}
    for symbol in (*model.gains, *model.uncertain):
        low, high = ranges[str(symbol)]
        inside[symbol] = {to_sympy(v) for v in (low, high, min(max(low, Fraction(0)), high))}
        if low < high:
            inside[symbol].add(to_sympy(low) + to_sympy(high - low) / sp.sqrt(2))
    inside |= {root: {sp.sqrt(to_sympy(ranges[str(of)][0]))} for root, of in model.roots.items() if of in inside}
    for symbol, values in inside.items():
        for kind, declared in symbol.assumptions0.items():
            wrong = [v for v in values if getattr(v, f"is_{kind}") != declared]
            if wrong:
                raise ParameterError(
                    f"{symbol} is declared {'' if declared else 'not '}{kind} in the loop. Received {wrong[0]}. "
                    "Declare it with real=True only."
                )


def _require_homogeneous(loop: Loop) -> None:
    """Refuse a field or an argument of a nested power with terms of different degrees in the weights of the loop."""
    weights: dict[str, Fraction] = {state: Fraction(weight) for state, weight in loop.states.items()}
    for lift, terms in loop.lifts.items():
        degrees = _degrees(loop, terms, weights)
        _require_one({m: f"{t} in a nested power" for m, t in degrees.items()}, loop)
        weights[lift] = next(iter(degrees), Fraction(1))
    found: dict[Fraction, str] = {}
    for state, terms in loop.field.items():
        found |= {m - loop.states[state]: f"{t} in {state}'" for m, t in _degrees(loop, terms, weights).items()}
    _require_one(found, loop)


def _degrees(loop: Loop, terms: tuple[Term, ...], weights: Mapping[str, Fraction]) -> dict[Fraction, str]:
    """Degrees of the terms that do not vanish, each with the factors of one such term."""
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
            f"a certificate needs a loop of one degree in the weights {dict(loop.states)}. Received degree {m} of "
            f"{first} and {n} of {second}. Other weights may do: quakedesign.symbolic.weights.weights_for."
        )


def exact_gains(subject: Subject, gains: tuple[Number, ...]) -> dict[str, Fraction]:
    """Gains by name, exact, in the order of the law.

    Raises
    ------
    ParameterError
        When their number is wrong, or the law refuses them.
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
    known = {"beta": (low, high), "d": (-bound, bound)}
    unknown = [*(str(u) for u in model.uncertain if str(u) not in known), *map(str, model.constants)]
    if unknown or model.domain != "cells":
        raise ParameterError(
            "a Lipschitz bound applies to sliding-mode laws, uncertain in beta and d. "
            f"Received {name!r} with {', '.join(unknown) or 'a polynomial loop'}."
        )
    return {str(u): known[str(u)] for u in model.uncertain}
