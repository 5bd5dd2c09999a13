"""Certified peaks as a certificate of FORMAT.md: every witness is read off, nothing is searched."""

from dataclasses import replace
from fractions import Fraction

from quakedesign.certificates import Certificate, Loop, Witness, loop_of
from quakedesign.certificates.error_coordinates import in_error_coordinates
from quakedesign.certificates.meaning import rows
from quakedesign.certificates.obligations import Obligation
from quakedesign.certificates.response import InputResponse, InvariantSet, OutputBound, Response
from quakedesign.certificates.response_obligations import demanded
from quakedesign.certificates.tracking import ENTERS
from quakedesign.controllers import Controller
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.linear.certified_peaks import CertifiedPeaks
from quakedesign.synthesis.linear.peak import Ellipsoid, PeakBound
from quakedesign.synthesis.linear.plant.polytope import ERROR_STATES, ErrorLoop


def peak_certificate(peaks: CertifiedPeaks, controller: Controller) -> Certificate:
    """Certificate of peaks: one file with everything that the final bounds rest on but the bounds of the inputs.

    Parameters
    ----------
    peaks : CertifiedPeaks
    controller : Controller
        The law that they are about.

    Returns
    -------
    Certificate
        Not checked yet.
    """
    parts = {name: _part(name, peaks) for name in dict.fromkeys(name for name, _ in peaks.bounds)}
    bounds = next(iter(peaks.bounds.values()))
    outputs = dict.fromkeys(output for _, output in peaks.bounds)
    loop = _with_inputs(controller, bounds.loop, {name: limits for name, (limits, _) in parts.items()})
    response = Response(
        outputs={output: rows(loop)[output] for output in outputs},
        parts={name: part for name, (_, part) in parts.items()},
    )
    witnesses: dict[str, Witness] = {}
    known = set()
    for one in demanded(loop, response):
        if one.key not in known:
            known.add(one.key)
            witnesses[one.name] = quadratic_witness(one)
    return Certificate(loop=loop, response=response, witnesses=witnesses)


def _with_inputs(controller: Controller, known: ErrorLoop, inputs: dict[str, tuple[Fraction, ...]]) -> Loop:
    """Loop of the law in error coordinates, every input in the rate of its state."""
    loop = loop_of(
        controller.name,
        in_error_coordinates(controller.loop_field()),
        gains=controller.gains,
        constants={"b": known.authority},
        uncertain={"beta": known.beta, "s": known.slip, "w": known.rate},
    )
    pushes = {state: [Term(Fraction(1), (n,), ()) for n in inputs if ENTERS[n] == state] for state in loop.states}
    return replace(loop, inputs=inputs, field={s: (*terms, *pushes[s]) for s, terms in loop.field.items()})


def _part(name: str, peaks: CertifiedPeaks) -> tuple[tuple[Fraction, ...], InputResponse]:
    """Limits of one input, and its sets and bounds; sets that serve several outputs stand there once."""
    own = {output: bound for (known, output), bound in peaks.bounds.items() if known == name}
    groups: list[PeakBound] = []
    for bound in own.values():
        if all(bound.ellipsoids != known.ellipsoids for known in groups):
            groups.append(bound)
    sizes = [len(group.ellipsoids) for group in groups]

    def padded(values: tuple[Fraction, ...], bound: PeakBound) -> tuple[Fraction, ...]:
        n = next(n for n, known in enumerate(groups) if known.ellipsoids == bound.ellipsoids)
        return (*(Fraction(0),) * sum(sizes[:n]), *values, *(Fraction(0),) * sum(sizes[n + 1 :]))

    sets = [_set(one, name, group, padded(one.borrowed, group)) for group in groups for one in group.ellipsoids]
    bounds = {output: OutputBound(bound=b.bound, weights=padded(b.weights, b)) for output, b in own.items()}
    return tuple(groups[0].inputs.values()), InputResponse(sets=tuple(sets), bounds=bounds)


def _set(one: Ellipsoid, name: str, bound: PeakBound, borrowed: tuple[Fraction, ...]) -> InvariantSet:
    variables = (*ERROR_STATES, name) if bound.held else ERROR_STATES
    entries, terms = iter(one.shape), list[Term]()
    for i, left in enumerate(variables):
        for right in variables[i:]:
            value = next(entries)
            factors = (
                ((left, Fraction(2), "a"),) if left == right else ((left, Fraction(1), "s"), (right, Fraction(1), "s"))
            )
            terms += [Term(value if left == right else 2 * value, (), factors)] if value else []
    shares = tuple(one.shares[n] for n in bound.inputs)
    return InvariantSet(function=tuple(terms), decay=one.decay, shares=shares, borrowed=borrowed)


def quadratic_witness(one: Obligation) -> Witness:
    """The only Gram matrix of a quadratic form, on all its variables."""
    size = len(next(iter(one.polynomial)))
    basis = tuple(tuple(int(i == j) for j in range(size)) for i in range(size))

    def entry(i: int, j: int) -> Fraction:
        value = one.polynomial.get(tuple(a + b for a, b in zip(basis[i], basis[j], strict=True)), Fraction(0))
        return value if i == j else value / 2

    gram = tuple(entry(i, j) for i in range(size) for j in range(i, size))
    return Witness(multiplier=constant(size), squares=(Square(basis=basis, gram=gram),))
