"""Answers about given gains of a homogeneous law, as facts for JSON and as sentences."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
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
    "exact": "an exact counterexample was found, an equilibrium away from the origin",
    "simulated": "a simulation was found in which the state grows (measured, not proved)",
    "none": "no counterexample was found, neither an exact one nor by simulation",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """One answer about given gains.

    Attributes
    ----------
    verdict : Verdict
    certificate : Certificate or None
        Proof or counterexample.
    facts : mapping
        Exact quantities as texts, measured ones as numbers.
    lines : tuple of str
        The same for people.
    """

    verdict: Verdict
    certificate: Certificate | None
    facts: Mapping[str, Any]
    lines: tuple[str, ...]


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
        L̄. Not needed to maximise it; if given all the same, the smallest scale λ for it is told.
    maximize : str, optional
        One of `MAXIMIZE`: L̄; the upper end b_M of the range of β; f in [b/f, b·f]; κ of the decay.
    gain_range : tuple of two
        b_m and b_M; one value b twice where the range is asked for.

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        For unknown wishes, and as `quakedesign.synthesis.certify`.
    """
    began = perf_counter()
    low, high = (rational(v, "gain_range") for v in gain_range)
    if maximize not in (None, *MAXIMIZE):
        raise ParameterError(f"maximize must be one of {', '.join(MAXIMIZE)}. Received {maximize!r}.")
    if lipschitz is None and maximize != "lipschitz":
        raise ParameterError(
            f"certify {name} needs a bound on |h'|. Received none. Give --lipschitz, or --maximize lipschitz."
        )
    if maximize == "lipschitz":
        answer = _of_reach(largest_lipschitz(name, gains, gain_range=gain_range), (low, high), lipschitz)
    elif maximize in ("beta", "beta-factor"):
        if low != high:
            raise ParameterError(f"to maximise the range of beta, give one value twice. Received {low} {high}.")
        reach = largest_gain_range(
            name, gains, lipschitz=str(lipschitz), nominal=low, symmetric=maximize == "beta-factor"
        )
        answer = _of_reach(reach, (low, high), lipschitz)
    else:
        answer = _at(name, gains, str(lipschitz), (low, high), decay=maximize == "decay")
    certificate, facts, lines = answer
    verdict = _verdict(certificate)
    head = f"{verdict}: {name} {' '.join(map(str, gains))}"
    if facts["lipschitz"] is not None:
        head += f", |h'| <= {facts['lipschitz']}, beta from {facts['gain_range'][0]} to {facts['gain_range'][1]}"
    whole = {"verdict": str(verdict), **facts, "certificate": None, "seconds": perf_counter() - began}
    return Certified(verdict=verdict, certificate=certificate, facts=whole, lines=(head, *lines))


def _verdict(certificate: Certificate | None) -> Verdict:
    if certificate is None:
        return Verdict.UNDECIDED
    return Verdict.REFUTED if certificate.refutation is not None else Verdict.PROVED


Answer = tuple[Certificate | None, dict[str, Any], list[str]]


def _at(
    name: str, gains: tuple[Number, ...], lipschitz: str, ends: tuple[Fraction, Fraction], *, decay: bool
) -> Answer:
    """Verdict for one bound, with the decay if that is asked for."""
    fast = None
    if decay:
        start = rational(lipschitz, "lipschitz") or Fraction(1)
        fast = fastest_settling(name, gains, lipschitz=lipschitz, gain_range=ends, start=start)
    certificate = fast[0] if fast else certify(name, gains, lipschitz=lipschitz, gain_range=ends)[1]
    loop = closed_loop(name, gains, lipschitz=lipschitz, gain_range=ends)
    limit = necessary_limit(loop, name)
    kind = against(loop, name)[0] if _verdict(certificate) is not Verdict.PROVED else "none"
    told = fast[1] if fast else None
    facts = {
        "lipschitz": str(rational(lipschitz)),
        "gain_range": [str(v) for v in ends],
        "decay": str(told.decay) if told else None,
        "settling": _settling_facts(told),
        "limit": _text(limit),
        "counterexample": kind,
    }
    lines = [_limit_line(limit)]
    lines += _settling_lines(told) if told else ["no decay rate was found"] if decay else []
    return certificate, facts, lines + ([] if _verdict(certificate) is Verdict.PROVED else [_AGAINST[kind]])


def _of_reach(reach: Reach, ends: tuple[Fraction, Fraction], lipschitz: Number | None) -> Answer:
    """How far gains reach in L̄ or in the range of β."""
    value, bound = reach.value, None if lipschitz is None else rational(lipschitz, "lipschitz")
    scale = reach.smallest_scale(bound) if reach.quantity == "lipschitz" and bound else None
    if reach.quantity == "lipschitz":
        bound = value
    elif value is not None:
        ends = (ends[0], value) if reach.quantity == "beta" else (ends[0] / value, ends[0] * value)
    facts = {
        "lipschitz": _text(bound),
        "gain_range": [str(v) for v in ends],
        "decay": None,
        "settling": None,
        "limit": _text(reach.limit),
        "counterexample": reach.counterexample,
        "maximized": {"quantity": reach.quantity, "value": _text(value), "beyond": _text(reach.beyond)},
        "degrees": list(reach.degrees),
        "degree": reach.degree,
        "scale": _text(scale),
        "solves": reach.solves,
    }
    lines = [*_reach_lines(reach), *([] if reach.quantity != "lipschitz" else [_limit_line(reach.limit)])]
    if scale is not None:
        lines.append(f"the bound {lipschitz} needs gains scaled by lambda >= {_up(scale)}")
    return reach.certificate, facts, lines


def _reach_lines(reach: Reach) -> list[str]:
    names = {"lipschitz": "bound on |h'|", "beta": "upper end of beta", "beta-factor": "factor f of beta in [b/f, b f]"}
    degrees = ", ".join(map(str, reach.degrees))
    if reach.value is None:
        return [f"nothing is proved with Lyapunov functions of degree {degrees}", _AGAINST[reach.counterexample]]
    said = f"largest {names[reach.quantity]}: {_down(reach.value)} (exactly {reach.value}), V of degree {reach.degree}"
    if reach.beyond is None and reach.sharp:
        return [said, "which is within 1e-4 of what no Lyapunov function can exceed"]
    if reach.beyond is None:
        return [said, "the search stopped there, as there seems to be no end"]
    found = f"at {_up(reach.beyond)} the search finds none of degree {degrees}"
    return [said, found if reach.sharp else f"{found}; in between it is not known"]


def _limit_line(limit: Fraction | None) -> str:
    if limit is None:
        return "no necessary limit of |h'| is known for this law"
    return f"necessary limit: from |h'| = {_down(limit)} on nothing can be proved of these gains"


def _settling_facts(told: Settling | None) -> dict[str, Any] | None:
    if told is None:
        return None
    exact = {"factor": str(told.factor), "power": str(told.power), "start": str(told.start)}
    return exact | {"seconds": told.seconds}


def _settling_lines(told: Settling) -> list[str]:
    return [
        f"decay: V' <= -k V^{1 - told.power} with k = {_down(told.decay)} 1/s for this V",
        f"settles within {_up(told.factor)} V(0)^{told.power} s; from |e_i| <= {_down(told.start)} "
        f"within {_up(Fraction(told.seconds))} s",
    ]


def _text(value: Fraction | None) -> str | None:
    return None if value is None else str(value)


def _down(value: Fraction) -> str:
    """Six digits, not above the value."""
    return rounded(value, ROUND_FLOOR)


def _up(value: Fraction) -> str:
    """Six digits, not below the value."""
    return rounded(value, ROUND_CEILING)


def rounded(value: Fraction, side: str) -> str:
    """Six digits of an exact number on one side of it, ``decimal.ROUND_FLOOR`` or ``ROUND_CEILING``."""
    return str(Context(prec=6, rounding=side).divide(Decimal(value.numerator), Decimal(value.denominator)))
