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
    """Exact bound T ≤ factor·V(0)^power from V̇ ≤ −κV^{n/m}: power = 1 − n/m, factor = 1/(κ·power).

    Attributes
    ----------
    decay : Fraction
        Proved κ for this V.
    factor, power : Fraction
        Constants of the bound.
    start : Fraction
        Bound on every initial error |e_i|, in the unit of e_i.
    seconds : float
        Bound on the settling time from all these initial errors [s], rounded up.
    """

    decay: Fraction
    factor: Fraction
    power: Fraction
    start: Fraction
    seconds: float


def settling(certificate: Certificate, start: Number = 1, model: LoopField | None = None) -> Settling | None:
    """Bound on the settling time from all |e_i| ≤ start; None without a claimed decay or finite-time convergence.

    Parameters
    ----------
    certificate : Certificate
        Certificate that was already checked.
    start : number or text
        Bound on every initial |e_i|, in the unit of e_i; `LoopField.units` converts errors to states.
    model : LoopField, optional
        Loop of the law, for the units of its states; by default that of the law that the certificate names.
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
    """Certificate with the smallest bound on the settling time over the degrees of V tried; None without a proof.

    κ is 1 % below the largest value that the solver finds for its V. This V has the largest margins of its degree, so
    another V of this degree may decay faster.

    Parameters
    ----------
    subject, gains, lipschitz, gain_range
        See `certify`.
    start : number or text
        Bound on every initial |e_i| for which the settling times are compared.
    degrees : int or iterable of int, optional
        Degrees of V to try; by default those of `certify`, until two of them succeed.

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
