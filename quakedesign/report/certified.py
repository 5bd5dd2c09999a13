"""Answers about given gains of a homogeneous law, as facts for JSON and as sentences."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, nextafter
from time import perf_counter
from typing import Any

from quakedesign.certificates import Certificate, Verdict
from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.synthesis.decision import Number, certify, closed_loop
from quakedesign.synthesis.questions import Reach, against, largest_gain_range, largest_lipschitz, necessary_limit
from quakedesign.synthesis.settling import Settling, fastest_settling

MAXIMIZE = ("lipschitz", "beta", "beta-factor", "decay")
_AGAINST = {
    "exact": "an exact counterexample was found: an equilibrium away from the origin",
    "simulated": "a simulation was found in which the state grows (measured, not proved)",
    "none": "no counterexample was found either, neither an exact one nor by simulation",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """One answer about given gains.

    Attributes
    ----------
    verdict : Verdict
    certificate : Certificate or None
    facts : mapping
        Exact quantities as texts, measured ones as numbers.
    lines : tuple of str
        The same for people.
    """

    verdict: Verdict
    certificate: Certificate | None
    facts: Mapping[str, Any]
    lines: tuple[str, ...] = field(default=())


def certified(
    name: str,
    gains: tuple[Number, ...],
    *,
    lipschitz: Number | None = None,
    maximize: str | None = None,
    gain_range: tuple[Number, Number] = (1, 1),
) -> Certified:
    """Verdict on given gains for a bound L̄, or how far they reach.

    Parameters
    ----------
    name : str
        Law.
    gains : tuple of number or text
    lipschitz : number or text, optional
        L̄; not needed to maximise it. If given then as well, the smallest scale λ for it is told.
    maximize : str, optional
        One of `MAXIMIZE`: L̄; the upper end of the range of β; f in [b/f, b·f]; κ of the decay.
    gain_range : tuple of two
        b_m and b_M; a point b where the range is asked for.

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        For unknown wishes, and as `quakedesign.synthesis.certify`.
    """
    began = perf_counter()
    low, high = (rational(v, "gain_range") for v in gain_range)
    if maximize not in (None, *MAXIMIZE):
        raise ParameterError(f"maximize must be one of {', '.join(MAXIMIZE)}. Received {maximize!r}.")
    if maximize in ("beta", "beta-factor") and low != high:
        raise ParameterError(f"to maximise the range of beta, give one value twice. Received {low} {high}.")
    if lipschitz is None and maximize != "lipschitz":
        raise ParameterError("a bound on |h'| is needed. Received none. Give --lipschitz, or --maximize lipschitz.")
    if lipschitz is None or maximize == "lipschitz":
        reach = largest_lipschitz(name, gains, gain_range=gain_range)
        answer = _of_reach(reach, None, lipschitz)
    elif maximize is None:
        answer = _plain(name, gains, lipschitz, gain_range)
    elif maximize == "decay":
        answer = _of_decay(name, gains, lipschitz, gain_range)
    else:
        options = {"lipschitz": lipschitz, "nominal": low, "symmetric": maximize == "beta-factor"}
        answer = _of_reach(largest_gain_range(name, gains, **options), low, lipschitz)
    return _complete(answer, name, gains, lipschitz, (low, high), perf_counter() - began)
