"""Settling time of a proved loop: the rate κ of V̇ ≤ −κV^{n/m}, and its bound."""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.exact import end_of, float_above, rational, to_sympy
from quakedesign.laws import LoopField, Subject, model_of
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.loop_expressions import error_units
from quakedesign.lyapunov.exact.obligations import Obligations, obligation_degree
from quakedesign.lyapunov.search.certify import Number, closed_loop
from quakedesign.lyapunov.search.lyapunov_search import balance, candidate_degrees, find_certificate, with_largest_decay
from quakedesign.symbolic.enclosure import enclose
from quakedesign.symbolic.term_expressions import from_terms

_BASE = sp.Symbol("V", positive=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settling:
    """T ≤ factor·V(0)^power, exact, from V̇ ≤ −κV^{n/m}: power = 1 − n/m, factor = 1/(κ·power).

    Attributes
    ----------
    decay : Fraction
        κ, proved; it belongs to this V.
    start : Fraction
        Size of every |e_i| at the start.
    seconds : float
        Bound on the settling time from every such start [s], rounded up.
    """

    decay: Fraction
    factor: Fraction
    power: Fraction
    start: Fraction
    seconds: float


def settling(certificate: Certificate, start: Number = 1, model: LoopField | None = None) -> Settling | None:
    """Bound on the settling time from all |e_i| ≤ start; None without a claimed decay or without finite time.

    Parameters
    ----------
    certificate : Certificate
        Checked already.
    start : number or text
        Largest size of every error, whatever the states of the loop (`LoopField.units`).
    model : LoopField, optional
        Loop of the law, for the units of its states; that of the law of the package by the certificate's name.
    """
    if "decay" not in certificate.claims:
        return None
    size, kappa = rational(start, "start"), certificate.claims["decay"]
    obligations = Obligations(certificate.loop, certificate.lyapunov)
    m = obligation_degree([p for _, p in obligations.function()], "V")
    n = obligation_degree([one.polynomial for _, one in obligations.decrease("")], "V̇")
    power = Fraction(m - n, m)
    if power <= 0:
        return None
    factor = 1 / (kappa * power)
    loop = certificate.loop
    sizes = {loop.symbols[s]: size / unit for s, (unit, _) in error_units(loop, model).items()}
    level = enclose(from_terms(certificate.lyapunov, loop.symbols), {s: (-v, v) for s, v in sizes.items()})
    top = end_of(level.upper())
    bound = enclose(to_sympy(factor) * _BASE ** to_sympy(power), {_BASE: (top, top)})
    seconds = float_above(end_of(bound.upper()))
    return Settling(decay=kappa, factor=factor, power=power, start=size, seconds=seconds)


def fastest_settling(
    subject: Subject,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number,
    gain_range: tuple[Number, Number] = (1, 1),
    start: Number = 1,
    degrees: int | Iterable[int] | None = None,
) -> tuple[Certificate, Settling] | None:
    """Certificate with the largest κ that is found for its V, by the degree of V that settles first; None if none.

    κ is 1 % below the largest for that V, which itself is the one with the largest margins, not the fastest one.

    Parameters
    ----------
    subject, gains, lipschitz, gain_range
        See `certify`.
    start : number or text
        Size of every |e_i| from which the settling times are compared.
    degrees : int or iterable of int, optional
        Those that `certify` tries, up to two that succeed, unless given.

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        As `certify`.
    """
    loop = closed_loop(subject, gains, lipschitz=lipschitz, gain_range=gain_range)
    tried = candidate_degrees(loop) if degrees is None else (degrees,) if isinstance(degrees, int) else tuple(degrees)
    settled: list[tuple[Certificate, Settling]] = []
    for m in tried:
        plain = find_certificate(loop, m, subject=subject)
        faster = with_largest_decay(plain, balance(loop), subject) if plain else None
        time = settling(faster, start, model_of(subject)[1]) if faster else None
        if faster and time:
            settled.append((faster, time))
        if degrees is None and len(settled) == 2:
            break
    return min(settled, key=lambda one: one[1].seconds, default=None)
