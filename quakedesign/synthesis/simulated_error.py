"""Search for gains with a proof and the least simulated error at a given sampling time."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.optimize import minimize

from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.laws import Controller, control_law
from quakedesign.loop import simulation_scheme
from quakedesign.lyapunov import Loop
from quakedesign.lyapunov.exact.perturbation_bounds import coefficient_range, least_authority
from quakedesign.lyapunov.gains.path_following import scaled_norm, short, state_at, with_gains
from quakedesign.lyapunov.gains.synthesise import ComparedGains, Synthesis, SynthesisProblem, problem_of, synthesise
from quakedesign.lyapunov.search.certify import Number
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.simulation import Metrics, simulate
from quakedesign.simulation.run_settings import PRINTED
from quakedesign.synthesis.sliding_mode_design import required_lipschitz, smallest_root

_HEADROOM = Fraction(11, 10)
_WINDOW = 4000
_SIMPLEX = 0.15
_WORST = 50.0
_NO_AIM = ("min_pressure", "settled_from", "steps", "seconds")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialSampling:
    """Simulation settings for trials of gains.

    Attributes
    ----------
    fault : Fault
    law : type of Controller
    gain_range : tuple of two
        Smallest and largest β [-] of the required proof.
    scale, divisor : Fraction
        λ and μ0N̂0 [m²/kg] of the controller; λ scales |h'| ≤ 1 of the base gains to the required bound.
    metric, scheme : str
    step, duration : float
        T_s and simulated time [s].
    """

    fault: Fault
    law: type[Controller]
    gain_range: tuple[Fraction, Fraction]
    scale: Fraction
    divisor: Fraction
    metric: str
    scheme: str
    step: float
    duration: float

    def controller(self, gains: Sequence[Fraction]) -> Controller:
        """Controller of base gains."""
        return self.law.for_authority(tuple(gains), self.divisor).scaled(self.scale)

    def error(self, gains: Sequence[Fraction]) -> float | None:
        """Metric of a run from rest on the plant without stick, as in the certificates; None if the run diverges."""
        run = simulate(
            self.fault,
            self.controller(gains),
            step=self.step,
            scheme=self.scheme,
            duration=self.duration,
            samples=2,
            compiled=False,
            plant=PRINTED,
        )
        error: float | None = getattr(run.metrics, self.metric)
        return error


def sampling(
    fault: Fault,
    law: str = "cta",
    *,
    lipschitz: Number | None = None,
    gain_range: tuple[Number, Number] | None = None,
    metric: str = "max_slip_rate_error",
    scheme: str = "explicit",
    step: float | None = None,
    duration: float | None = None,
) -> TrialSampling:
    """Simulation settings for trials on a fault.

    Parameters
    ----------
    fault : Fault
    law : str
        A sliding mode.
    lipschitz : number or text, optional
        Bound L̄ of |h'| [m/s³]; by default 1.1 times the bound that reference and disturbance require.
    gain_range : tuple of two, optional
        Smallest and largest β [-]; those of the fault's box unless given.
    metric : str
        Field of `Metrics` to minimise.
    scheme : str
        One of `quakedesign.loop.schemes`.
    step : float, optional
        Sampling time T_s [s]; the fault's unless given.
    duration : float, optional
        Simulated time [s]; by default 4000 T_s, at most the operation time.

    Raises
    ------
    ParameterError
        For a law that is not a sliding mode, an unknown metric or scheme, or numbers that are not positive.
    """
    chosen = control_law(law)
    divisor = least_authority(fault)
    law_of_ones = chosen.for_authority((1,) * len(chosen.gain_units), divisor)
    if law_of_ones.scale is None:
        raise ParameterError(
            f"the search for the least simulated error needs a sliding mode. Received {law!r}. Give cta or dia."
        )
    require_known(metric, [name for name in Metrics.__dataclass_fields__ if name not in _NO_AIM], "metric")
    simulation_scheme(scheme)
    for name, value in (("step", step), ("duration", duration)):
        if value is not None and not 0 < value < math.inf:
            raise ParameterError(f"{name} must be positive. Received {value} s.")
    needed = required_lipschitz(fault, divisor) * _HEADROOM if lipschitz is None else rational(lipschitz)
    if not needed > 0:
        raise ParameterError(f"lipschitz must be positive. Received {lipschitz}.")
    low, high = coefficient_range(fault, divisor) if gain_range is None else map(rational, gain_range)
    requested = step or fault.sampling_time
    return TrialSampling(
        fault=fault,
        law=chosen,
        gain_range=(low, high),
        scale=smallest_root(needed) ** 6,
        divisor=divisor,
        metric=metric,
        scheme=scheme,
        step=requested,
        duration=duration or min(_WINDOW * requested, fault.reference.operation_time),
    )


def synthesise_sampled(
    trial: TrialSampling, *, degrees: Iterable[int] | None = None, rounds: int = 80
) -> Synthesis | None:
    """Find proved base gains with the least simulated error, for |h'| ≤ 1 and a range of β.

    The search uses the Nelder–Mead method on the logarithms of the gains, from the gains of the smallest norm and from
    the best published ones. Every point is screened before it is simulated. The error is that of one window of one run,
    and is not part of the proof.

    Parameters
    ----------
    trial : TrialSampling
    degrees : iterable of int, optional
        Of V, as for `synthesise`; the search itself uses the last.
    rounds : int
        Largest number of points of the search, besides the published gains.

    Returns
    -------
    Synthesis or None
        Its value is the metric, in its unit; never worse than that of proved gains from the literature.
    """
    problem = problem_of(trial.law, "norm", lipschitz=1, gain_range=trial.gain_range, degrees=degrees)
    measured = [_measured(trial, problem, loop) for loop in problem.published]
    small = synthesise(
        trial.law, "norm", lipschitz=1, gain_range=trial.gain_range, degrees=problem.degrees, starts=1, compare=False
    )
    begin = [tuple(small.gains.values())] if small else []
    good = [one for one in measured if one.value is not None]
    begin += [tuple(one.gains.values()) for one in sorted(good, key=lambda one: one.value or 0.0)[:1]]
    tried = {one.value: tuple(one.gains.values()) for one in good if one.value is not None}
    for gains in begin:
        tried |= _tried(trial, problem, gains, rounds // len(begin))
    for error, gains in sorted(tried.items(), key=lambda item: item[0]):
        loop = with_gains(problem.loop, dict(zip(problem.loop.gains, gains, strict=True)))
        certificate = find_certificate(loop, problem.degrees, subject=trial.law)
        if certificate is None:
            continue
        return Synthesis(
            law=trial.law.name,
            objective=trial.metric,
            unit=Metrics.unit(trial.metric),
            gains=loop.gains,
            certificate=certificate,
            value=error,
            norm=scaled_norm(loop, problem.setting.exponents),
            compared=tuple(replace(c, ratio=c.value and c.value / error) for c in measured),
        )
    return None


def _tried(
    trial: TrialSampling, problem: SynthesisProblem, begin: Sequence[Fraction], rounds: int
) -> dict[float, tuple[Fraction, ...]]:
    """Screened gains and their errors, from given initial gains."""
    base = {name: float(k) for name, k in zip(problem.loop.gains, begin, strict=True)}
    free = [name for name, k in base.items() if k]
    setting = replace(problem.setting, degree=problem.degrees[-1])
    tried: dict[float, tuple[Fraction, ...]] = {}

    def error(factors: Any) -> float:
        grown = {**base, **{n: base[n] * math.exp(x) for n, x in zip(free, factors, strict=True)}}
        loop = with_gains(problem.loop, short(problem.loop, grown))
        if state_at(setting, loop, scaled_norm(loop, setting.exponents)) is None:
            return _WORST
        value = trial.error(tuple(loop.gains.values()))
        if not value:
            return _WORST
        tried.setdefault(value, tuple(loop.gains.values()))
        return math.log(value)

    simplex = np.vstack([np.zeros(len(free)), _SIMPLEX * np.eye(len(free))])
    minimize(error, simplex[0], method="Nelder-Mead", options={"maxfev": rounds, "initial_simplex": simplex})
    return tried


def _measured(trial: TrialSampling, problem: SynthesisProblem, loop: Loop) -> ComparedGains:
    """Error of published gains in the same trial; None for those without a proof."""
    certificate = find_certificate(loop, problem.degrees, subject=trial.law)
    error = trial.error(tuple(loop.gains.values())) if certificate else None
    norm = scaled_norm(loop, problem.setting.exponents)
    return ComparedGains(gains=dict(loop.gains), value=error, norm=norm, ratio=None, certificate=certificate)
