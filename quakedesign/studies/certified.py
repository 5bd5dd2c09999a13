"""Verdicts on given gains of a homogeneous law, as facts for JSON and as sentences."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import takewhile
from time import perf_counter
from typing import Any

from quakedesign.errors import CertificateError, ParameterError, require_known
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.lyapunov import Certificate, Loop, Verdict
from quakedesign.lyapunov.exact.domain import certified_lipschitz
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.lyapunov.search.certify import (
    CertifiedLimit,
    Number,
    closed_loop,
    counterexample_kind,
    largest_gain_range,
    largest_lipschitz,
    necessary_limit,
    proof,
)
from quakedesign.lyapunov.search.infeasibility import dual
from quakedesign.lyapunov.search.lyapunov_search import candidate_degrees, refute
from quakedesign.lyapunov.search.settling_time import Settling, fastest_settling
from quakedesign.simulation import Trajectory, simulate
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.synthesis import Design

_LARGEST_FAMILY = 24  # largest number of monomials of V
MAXIMIZE = ("lipschitz", "beta", "beta-factor", "decay")
_AGAINST = {
    "exact": "an exact counterexample was found, an equilibrium away from the origin",
    "simulated": "a simulation was found in which the state grows, which is no proof",
    "none": "no counterexample was found, neither an exact one nor by simulation",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Certified:
    """Verdict on given gains.

    Attributes
    ----------
    certificate : Certificate or None
        Proof or counterexample.
    facts : mapping
        Exact quantities as strings, measured ones as numbers.
    lines : tuple of str
        The same as sentences.
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
    """Verdict on given gains for |h'| ≤ L̄, h the matched perturbation, or the largest certified value of a quantity.

    Parameters
    ----------
    name : str
        Control law.
    lipschitz : number or text, optional
        L̄ [m/s³]. Not needed to maximise it; if given nevertheless, the smallest scale λ for it is reported.
    maximize : str, optional
        One of `MAXIMIZE`: L̄; the upper end b_M of the range of β; f in [b/f, b·f]; κ of the decay.
    gain_range : tuple of two
        b_m and b_M [-]; one value b twice to maximise the range.

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        For an unknown `maximize`, and as in `quakedesign.lyapunov.certify`.
    """
    began = perf_counter()
    low, high = (rational(v, "gain_range") for v in gain_range)
    if maximize is not None:
        require_known(maximize, MAXIMIZE, "maximize")
    if lipschitz is None and maximize != "lipschitz":
        raise ParameterError(
            f"certify {name} needs a bound on |h'|. Received none. Give --lipschitz, or --maximize lipschitz."
        )
    if maximize in ("beta", "beta-factor") and low != high:
        raise ParameterError(f"to maximise the range of beta, give one value twice. Received {low} {high}.")
    try:
        certificate, values, lines = _results(name, gains, lipschitz, maximize, (low, high))
    except CertificateError as error:
        bound = None if lipschitz is None else rational(lipschitz, "lipschitz")
        certificate, values, lines = None, _values(bound, (low, high)), [f"no certificate can be sought: {error}"]
    verdict = _verdict(certificate)
    head = f"{verdict}: {name} {' '.join(map(str, gains))}"
    if values["lipschitz"] is not None:
        head += f", |h'| <= {values['lipschitz']}, beta from {values['gain_range'][0]} to {values['gain_range'][1]}"
    whole = {"verdict": str(verdict), **values, "certificate": None, "seconds": perf_counter() - began}
    return Certified(verdict=verdict, certificate=certificate, facts=whole, lines=(head, *lines))


def _results(
    name: str, gains: tuple[Number, ...], lipschitz: Number | None, maximize: str | None, ends: "Ends"
) -> "Results":
    if maximize == "lipschitz":
        return _of_limit(name, gains, largest_lipschitz(name, gains, gain_range=ends), ends, lipschitz)
    if maximize in ("beta", "beta-factor"):
        largest = largest_gain_range(
            name, gains, lipschitz=str(lipschitz), nominal=ends[0], symmetric=maximize == "beta-factor"
        )
        return _of_limit(name, gains, largest, ends, lipschitz)
    return _at(name, gains, str(lipschitz), ends, decay=maximize == "decay")


def _values(bound: Fraction | None, ends: "Ends", **values: Any) -> Json:
    """Facts of every verdict; missing values are unknown."""
    empty: dict[str, Any] = {"decay": None, "settling": None, "limit": None, "counterexample": "none", "dual": []}
    return {"lipschitz": _text(bound), "gain_range": [str(v) for v in ends], **empty, **values}


def _verdict(certificate: Certificate | None) -> Verdict:
    if certificate is None:
        return Verdict.UNDECIDED
    return Verdict.REFUTED if certificate.refutation is not None else Verdict.PROVED


Ends = tuple[Fraction, Fraction]
Results = tuple[Certificate | None, dict[str, Any], list[str]]


def _at(name: str, gains: tuple[Number, ...], lipschitz: str, ends: Ends, *, decay: bool) -> Results:
    """Verdict for one bound, with the decay if requested."""
    loop = closed_loop(name, gains, lipschitz=lipschitz, gain_range=ends)
    limit, bound, fast = necessary_limit(loop, name), rational(lipschitz, "lipschitz"), None
    infeasible = limit is not None and bound >= limit
    if decay and not infeasible:
        fast = fastest_settling(name, gains, lipschitz=lipschitz, gain_range=ends, start=bound or Fraction(1))
    refuted = None if fast else refute(loop, name)
    certificate = fast[0] if fast else refuted or (None if infeasible else proof(loop, name))
    proved = certificate is not None and refuted is None
    kind = "none" if proved else counterexample_kind(loop, refuted)
    excluded = [] if proved or kind == "exact" else _excluded(loop)
    settling = fast[1] if fast else None
    values = _values(
        bound,
        ends,
        decay=str(settling.decay) if settling else None,
        settling=_settling_values(settling),
        limit=_text(limit),
        counterexample=kind,
        dual=excluded,
    )
    lines = [_limit_line(limit), *(["the bound is at or beyond that limit"] if infeasible else [])]
    lines += _settling_lines(settling) if settling else ["no decay rate was found"] if decay else []
    return certificate, values, lines + _refutation_lines(certificate, kind, excluded)


def _excluded(loop: Loop) -> list[int]:
    """Degrees, up to the first failure, for which an exact dual excludes every V of even signed monomials.

    Only families that take a few seconds.
    """
    small = (
        m for m in candidate_degrees(loop) if len(signed_monomials(loop.states, m, loop.domain)) <= _LARGEST_FAMILY
    )
    return list(takewhile(lambda degree: dual(loop, degree) is not None, small))


def _refutation_lines(certificate: Certificate | None, kind: str, excluded: list[int]) -> list[str]:
    if _verdict(certificate) is Verdict.PROVED:
        return []
    if kind == "exact":
        return [_AGAINST[kind]]
    degrees = ", ".join(map(str, excluded))
    if not excluded:
        return [_AGAINST[kind], "no exact dual was found"]
    family = f"no sum of even signed monomials of degree {degrees}"
    return [_AGAINST[kind], f"an exact dual was found: {family} is positive and decreases along all solutions"]


def _of_limit(
    name: str, gains: tuple[Number, ...], largest: CertifiedLimit, ends: Ends, lipschitz: Number | None
) -> Results:
    """Largest certified L̄ or range of β of given gains."""
    tried = ends if largest.quantity == "lipschitz" else (ends[0], ends[0])
    lowest = closed_loop(
        name, gains, lipschitz=0 if largest.quantity == "lipschitz" else str(lipschitz), gain_range=tried
    )
    limit = necessary_limit(lowest, name)
    kind = largest.counterexample
    excluded = _excluded(lowest) if largest.certificate is None else []
    value, bound = largest.value, None if lipschitz is None else rational(lipschitz, "lipschitz")
    scale = largest.smallest_scale(bound) if largest.quantity == "lipschitz" and bound else None
    least = bound / limit if bound and limit and scale is not None else None
    if largest.quantity == "lipschitz":
        bound = value
    elif value is not None:
        ends = (ends[0], value) if largest.quantity == "beta" else (ends[0] / value, ends[0] * value)
    values = _values(
        bound,
        ends,
        limit=_text(limit),
        counterexample=kind,
        dual=excluded,
        maximized={"quantity": largest.quantity, "value": _text(value), "beyond": _text(largest.beyond)},
        degrees=list(largest.degrees),
        degree=largest.degree,
        scale=_text(scale),
        scale_limit=_text(least),
        solves=largest.solves,
    )
    lines = [*_limit_lines(largest), *_refutation_lines(largest.certificate, kind, excluded), _limit_line(limit)]
    if scale is not None:
        lines.append(f"the bound {lipschitz} needs gains scaled by lambda >= {UpperBound(scale)}")
    return largest.certificate, values, lines


def _limit_lines(largest: CertifiedLimit) -> list[str]:
    names = {"lipschitz": "bound on |h'|", "beta": "upper end of beta", "beta-factor": "factor f of beta in [b/f, b f]"}
    degrees = ", ".join(map(str, largest.degrees))
    if largest.value is None:
        return [f"nothing is proved with Lyapunov functions of degree {degrees}"]
    value = f"{LowerBound(largest.value)} (exactly {largest.value})"
    text = f"largest {names[largest.quantity]}: {value}, V of degree {largest.degree}"
    if largest.beyond is None and largest.sharp:
        return [text, "this is within a relative 1e-4 of the limit of every Lyapunov function"]
    if largest.beyond is None:
        return [text, "the search ended there without reaching an upper limit"]
    beyond = f"at {UpperBound(largest.beyond)} no function of degree {degrees} was found"
    return [text, beyond if largest.sharp else f"{beyond}; between the two values nothing is known"]


def _limit_line(limit: Fraction | None) -> str:
    if limit is None:
        return "no necessary limit of |h'| is known for this law"
    return f"necessary limit: no certificate of these gains exists for a bound |h'| >= {UpperBound(limit)}"


def _settling_values(settling: Settling | None) -> Json | None:
    if settling is None:
        return None
    exact = {"factor": str(settling.factor), "power": str(settling.power), "start": str(settling.start)}
    return exact | {"seconds": settling.seconds}


def _settling_lines(settling: Settling) -> list[str]:
    return [
        f"decay: V' <= -k V^{1 - settling.power} with k = {LowerBound(settling.decay)} 1/s for this V",
        f"settles within {UpperBound(settling.factor)} V(0)^{settling.power} s; from |e_i| <= "
        f"{LowerBound(settling.start)} within {UpperBound(settling.seconds)} s",
    ]


def _text(value: Fraction | None) -> str | None:
    return None if value is None else str(value)


# ----------------------------------------------------------------------
# Sampling time for which the premise on |h'| holds on the run itself.

_WINDOW = 4000
_FINEST = 1000.0
_HALVINGS = 6


def on_trajectory(lipschitz: float, run: Trajectory) -> Premise | None:
    """Largest |Δh/Δt| of a run against the certified bound [m/s³]; None for a run that diverged."""
    measured = run.metrics.max_h_rate
    if measured is None:
        return None
    return Premise(
        name="on_trajectory",
        required=measured,
        certified=lipschitz,
        unit="m/s^3",
        measured=True,
        note=f"largest |Δh/Δt| of the run, scheme {run.provenance['scheme']}, step {run.provenance['step']:g} s",
    )


def largest_sampling_time(fault: Fault, controller: Controller, lipschitz: float) -> float | None:
    """Largest T_s [s], at most the fault's, for which a run stays inside |Δh/Δt| ≤ lipschitz [m/s³], by bisection.

    Measured only on the first 4000 of the fault's T_s, so an indication; None if even 1/256 of that T_s is too long.
    """
    window = min(_WINDOW * fault.sampling_time, fault.reference.operation_time)

    def proves(step: float) -> bool:
        run = simulate(fault, controller, step=step, duration=window, samples=2)
        rate = run.metrics.max_h_rate
        return rate is not None and rate <= lipschitz

    high = fault.sampling_time
    if proves(high):
        return high
    low = high / 4
    while not proves(low):
        high, low = low, low / 4
        if low < fault.sampling_time / _FINEST:
            return None
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if proves(middle) else (low, middle)
    return float(f"{low * 0.995:.2g}")


# ----------------------------------------------------------------------
# The premise that a run decides: |h'| along it against the certified bound.


def certified_bound(design: Design | None) -> Fraction | None:
    """Proved bound on |h'| of a design for λ = 1 [m/s³]; None for a linear law, and without a proof."""
    law = design.controller if design else None
    if design is None or design.certificate is None or law is None or law.lipschitz_limit is None:
        return None
    return certified_lipschitz(design.certificate) if design.verdict is Verdict.PROVED else None


def trajectory_premise(law: Controller, lipschitz: float | None, run: Trajectory) -> Premise | None:
    """Largest |Δh/Δt| of a run against the certified bound; None for a run that diverged, or a law without a limit.

    Parameters
    ----------
    lipschitz : float or None
        Certified bound on |h'| [m/s³]. None without a certificate: then nothing is certified, the premise fails for
        every run, and its note names the limit that no certificate of these gains exceeds.
    """
    if law.lipschitz_limit is None:
        return None
    limit = float(law.lipschitz_limit)
    premise = on_trajectory(limit if lipschitz is None else lipschitz, run)
    if premise is None or lipschitz is not None:
        return premise
    text = f"{premise.note}; no certificate was given, and no bound of these gains exceeds {limit:.4g} {premise.unit}"
    return replace(premise, certified=0.0, proved=False, note=text)
