"""The exact decision: whether a certificate proves, or refutes, what it claims."""

from fractions import Fraction
from itertools import product

from quakedesign.certificates.claim import Certificate, Equilibrium, Loop, Verdict, loop_of, require
from quakedesign.certificates.obligations import claimed
from quakedesign.controllers import control_laws
from quakedesign.sos import proves
from quakedesign.symbolic.terms import Term, value


def check(certificate: Certificate) -> Verdict:
    """Decide a certificate in exact arithmetic; see `Certificate.check`."""
    _same_field(certificate.loop)
    if certificate.refutation is not None:
        _check_equilibrium(certificate.loop, certificate.refutation)
        return Verdict.REFUTED
    _check_proof(certificate)
    return Verdict.PROVED


def _same_field(loop: Loop) -> None:
    """Re-derive the field from the law's own expressions and compare."""
    laws = control_laws()
    require(loop.law in laws, f"the law {loop.law!r} is unknown, so its field cannot be derived again.")
    model = laws[loop.law].loop_field()
    derived = loop_of(loop.law, model, gains=loop.gains, uncertain=loop.uncertain, constants=loop.constants)
    names = (model.gains, model.constants, model.uncertain)
    given = (loop.gains, loop.constants, loop.uncertain)
    require(
        all({s.name for s in symbols} == set(values) for symbols, values in zip(names, given, strict=True)),
        f"the gains, constants or uncertain parameters are not those of {loop.law}.",
    )
    require(
        list(derived.states.items()) == list(loop.states.items())
        and derived.domain == loop.domain
        and _sorted(derived) == _sorted(loop),
        f"the field is not that of {loop.law}.",
    )


def _sorted(loop: Loop) -> dict[str, list[Term]]:
    order = {s: i for i, s in enumerate(loop.states)}
    return {
        state: sorted(
            Term(t.coefficient, tuple(sorted(t.parameters)), tuple(sorted(t.factors, key=lambda f: order[f[0]])))
            for t in terms
        )
        for state, terms in loop.field.items()
    }


def _check_proof(certificate: Certificate) -> None:
    loop, claims = certificate.loop, certificate.claims
    second = "decrease" if loop.domain == "cells" else "rate"
    required, allowed = {"positive", second}, {f"bound_{state}" for state in loop.states}
    require(
        required <= set(claims) <= required | allowed, f"the claims must be positive, {second} and bounds of states."
    )
    require(all(c > 0 for c in claims.values()), "a claim must be positive.")
    uncertain = {p for t in certificate.lyapunov for p in t.parameters} & set(loop.uncertain)
    require(not uncertain, "V must not depend on an uncertain parameter.")
    known = set[tuple[tuple[tuple[int, ...], Fraction], ...]]()
    expected = list[str]()
    for name, polynomial in claimed(loop, certificate.lyapunov, claims):
        key = tuple(sorted(polynomial.items()))
        if key in known:
            continue
        known.add(key)
        expected.append(name)
        require(name in certificate.witnesses, f"the witness of {name!r} is missing.")
        witness = certificate.witnesses[name]
        fits = all(len(e) == len(loop.states) for e in witness.multiplier)
        require(
            fits and proves(polynomial, witness, orthant=loop.domain == "cells"),
            f"the witness of {name!r} does not prove its polynomial.",
        )
    extra = "there are witnesses that no obligation needs, or in another order."
    require(expected == list(certificate.witnesses), extra)


def _check_equilibrium(loop: Loop, equilibrium: Equilibrium) -> None:
    require(loop.domain == "cells", "an equilibrium refutes only a loop on cells.")
    point, parameters = equilibrium.point, equilibrium.parameters
    require(set(point) == set(loop.states) and any(point.values()), "the point must be away from the origin.")
    require(
        set(parameters) == set(loop.uncertain)
        and all(low <= parameters[name] <= high for name, (low, high) in loop.uncertain.items()),
        "the parameters of the counterexample are outside their ranges.",
    )
    cells = touching_cells(loop, point)
    weights = equilibrium.weights
    require(
        set(weights) == set(cells) and all(w >= 0 for w in weights.values()) and sum(weights.values()) == 1,
        "the weights of the counterexample are not convex weights of the touching cells.",
    )
    for state, terms in loop.field.items():
        mean = sum(
            (weights[cell] * limit(terms, loop, point, signs, parameters) for cell, signs in cells.items()), Fraction(0)
        )
        require(mean == 0, f"the field does not vanish in {state} at the counterexample.")


def touching_cells(loop: Loop, point) -> dict[str, dict[str, int]]:
    """Sign cells whose closure holds a point, by name."""
    choices = [(1, -1) if point[s] == 0 else ((1,) if point[s] > 0 else (-1,)) for s in loop.states]
    return {
        "".join("+" if s > 0 else "-" for s in signs): dict(zip(loop.states, signs, strict=True))
        for signs in product(*choices)
    }


def limit(terms, loop: Loop, point, signs, parameters) -> Fraction:
    """Limit of a sum of terms at a point from one cell."""
    total = Fraction(0)
    for term in terms:
        part = value(term, {**loop.parameters, **parameters})
        for state, exponent, kind in term.factors:
            power = exponent * loop.states[state]
            require(power.denominator == 1, f"⌈{state}⌋^{exponent} is no polynomial on a cell.")
            part *= abs(point[state]) ** power.numerator * (signs[state] if kind == "s" else 1)
        total += part
    return total
