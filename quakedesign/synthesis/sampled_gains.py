"""Gains that err least at a given sampling time, as simulated on a fault, among gains with a proof."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from quakedesign.certificates.premises import coefficient_range, least_authority
from quakedesign.controllers import SlidingMode, control_law
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.simulation import Metrics, simulate
from quakedesign.synthesis.climbing import look, short, with_gains
from quakedesign.synthesis.design import required_lipschitz, smallest_root
from quakedesign.synthesis.gain_question import Question, question
from quakedesign.synthesis.gains import Compared, Synthesis, synthesise
from quakedesign.synthesis.lyapunov import find_certificate
from quakedesign.synthesis.stretching import scaled_norm

_HEADROOM = Fraction(11, 10)
_WINDOW = 4000
_SIMPLEX = 0.15
_WORST = 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """How a set of gains is tried out.

    Attributes
    ----------
    fault : Fault
    law : type of SlidingMode
    scale, divisor : Fraction
        λ and μ0N̂0 [m²/kg] of the controller; λ makes |h'| ≤ 1 of the base gains enough for the fault, with a tenth to
        spare.
    metric, scheme : str
    step, duration : float
        [s].
    """

    fault: Fault
    law: type[SlidingMode]
    scale: Fraction
    divisor: Fraction
    metric: str
    scheme: str
    step: float
    duration: float

    def controller(self, gains: Sequence[Fraction]) -> SlidingMode:
        """Controller of base gains."""
        return self.law.from_values(tuple(gains), scale=self.scale, divisor=self.divisor)

    def error(self, gains: Sequence[Fraction]) -> float | None:
        """Metric of a run from rest; None if it diverges."""
        run = simulate(
            self.fault,
            self.controller(gains),
            step=self.step,
            scheme=self.scheme,
            duration=self.duration,
            samples=2,
            compiled=False,
        )
        return getattr(run.metrics, self.metric)


def sampling(
    fault: Fault,
    law: str = "cta",
    *,
    metric: str = "max_slip_rate_error",
    scheme: str = "explicit",
    step: float | None = None,
    duration: float | None = None,
) -> Sampling:
    """Read how gains shall be tried out on a fault.

    Parameters
    ----------
    fault : Fault
    law : str
        A sliding mode.
    metric : str
        One of `Metrics`, smaller being better.
    scheme : str
        One of `quakedesign.simulation.schemes`.
    step : float, optional
        Sampling time T_s [s]; the fault's unless given.
    duration : float, optional
        [s]; 4000 T_s unless given.

    Raises
    ------
    ParameterError
        For a law that is no sliding mode, or an unknown metric.
    """
    chosen = control_law(law)
    if not issubclass(chosen, SlidingMode):
        raise ParameterError(f"sampled errors are searched for sliding modes. Received {law!r}.")
    if metric not in Metrics.__dataclass_fields__:
        raise ParameterError(f"metric must be one of {', '.join(Metrics.__dataclass_fields__)}. Received {metric!r}.")
    divisor = least_authority(fault)
    law_of_ones = chosen.from_values((1,) * len(chosen.gain_units), divisor=divisor)
    rho = smallest_root(required_lipschitz(fault, law_of_ones, divisor) * _HEADROOM)
    wanted = step or fault.sampling_time
    return Sampling(
        fault=fault,
        law=chosen,
        scale=rho**6,
        divisor=divisor,
        metric=metric,
        scheme=scheme,
        step=wanted,
        duration=duration or min(_WINDOW * wanted, fault.reference.operation_time),
    )


def synthesise_sampled(
    trial: Sampling, *, degrees: Iterable[int] | None = None, rounds: int = 60, compare: bool = True
) -> Synthesis | None:
    """Find base gains with a proof for |h'| ≤ 1 and the fault's range of β whose sampled run errs least.

    From the gains of the smallest norm, by the method of Nelder and Mead on the logarithms of the gains, every point
    being screened before it is simulated. The figure is measured on one window of one run, and no part of the proof.

    Parameters
    ----------
    trial : Sampling
    degrees : iterable of int, optional
        Of V, as for `synthesise`; the search itself uses the last.
    rounds : int
        Simulations at most.
    compare : bool

    Returns
    -------
    Synthesis or None
        Its value is the metric, in its unit.
    """
    beta = coefficient_range(trial.fault, trial.divisor)
    asked = question(trial.law, "norm", lipschitz=1, gain_range=beta, degrees=degrees)
    first = synthesise(trial.law, "norm", lipschitz=1, gain_range=beta, degrees=asked.degrees, starts=1, compare=False)
    if first is None:
        return None
    tried = _tried(trial, asked, first, rounds)
    for error, gains in sorted(tried.items(), key=lambda item: item[0]):
        loop = with_gains(asked.loop, dict(zip(asked.loop.gains, gains, strict=True)))
        certificate = find_certificate(loop, asked.degrees, subject=trial.law)
        if certificate is None:
            continue
        return Synthesis(
            law=trial.law.name,
            objective=trial.metric,
            unit=Metrics.unit(trial.metric),
            gains=loop.gains,
            certificate=certificate,
            value=error,
            norm=scaled_norm(loop, asked.setting.exponents),
            compared=_compared(trial, asked, error) if compare else (),
        )
    return None


def _tried(trial: Sampling, asked: Question, first: Synthesis, rounds: int) -> dict[float, tuple[Fraction, ...]]:
    """Screened gains by their errors."""
    import numpy as np
    from scipy.optimize import minimize

    base = {name: float(k) for name, k in first.gains.items()}
    free = [name for name, k in base.items() if k]
    setting = replace(asked.setting, degree=asked.degrees[-1])
    tried: dict[float, tuple[Fraction, ...]] = {}

    def error(factors) -> float:
        grown = {**base, **{n: base[n] * math.exp(x) for n, x in zip(free, factors, strict=True)}}
        loop = with_gains(asked.loop, short(asked.loop, grown))
        if look(setting, loop, scaled_norm(loop, setting.exponents)) is None:
            return _WORST
        found = trial.error(tuple(loop.gains.values()))
        if not found:
            return _WORST
        tried.setdefault(found, tuple(loop.gains.values()))
        return math.log(found)

    simplex = np.vstack([np.zeros(len(free)), _SIMPLEX * np.eye(len(free))])
    minimize(error, simplex[0], method="Nelder-Mead", options={"maxfev": rounds, "initial_simplex": simplex})
    return tried


def _compared(trial: Sampling, asked: Question, value: float) -> tuple[Compared, ...]:
    """Errors of the gains from the literature in the same trial; None for those without a proof."""
    found = []
    for loop in asked.known:
        certificate = find_certificate(loop, asked.degrees, subject=trial.law)
        error = trial.error(tuple(loop.gains.values())) if certificate else None
        norm = scaled_norm(loop, asked.setting.exponents)
        found.append(Compared(gains=dict(loop.gains), value=error, norm=norm, ratio=error and error / value))
    return tuple(found)
