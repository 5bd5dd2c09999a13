"""e-LQR for a given sampling period: the continuous design where the period is short enough, else a discrete one.

Both are about the law that runs: p held, integrals summed over the samples, parameters that vary in time.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.controllers import Controller, control_law
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.design.algebraic_riccati import METHOD
from quakedesign.synthesis.linear.design.nondimensional import ScaledDesign
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.design.specifications import Specifications
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix
from quakedesign.synthesis.linear.sampled.stability import HoldVerdict, hold_verdict, largest_radius
from quakedesign.synthesis.linear.sampled.varying_parameters import VaryingVerdict, varying_verdict
from quakedesign.synthesis.linear.sampled.zero_order_hold import held_plant

_SHARES = (1.5, 1.2, 1.0, 0.8, 0.6)
_TRIES = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledDesign:
    """An e-LQR for a sampling period, over the whole box.

    Attributes
    ----------
    controller : ExtendedLQR
    method : str
        ``"continuous"``: the Riccati design, with its guarantee for the continuous loop too; ``"discrete"``: from
        python-control's `dlqr`, guaranteed for this period only.
    step : Fraction
        T_s [s].
    constant : HoldVerdict
        Of the law that runs for constant parameters; proved.
    varying : VaryingVerdict
        The same for parameters that vary in time, with its proof; undecided only where no gains are proved so.
    theta : Matrix or None
        xᵀΘx in SI of the Riccati equation; None for a discrete design.
    """

    controller: ExtendedLQR
    method: str
    step: Fraction
    constant: HoldVerdict
    varying: VaryingVerdict
    theta: Matrix | None = None


def sampled_design(fault: Fault, step: float | str | None = None, *, feedback: str = "error") -> SampledDesign:
    """Design for a sampling period, proved over the whole box.

    The Riccati design is slowed down from a bandwidth of 1.5/T_s to 0.6/T_s until it is proved for parameters that vary
    in time; where none is, a discrete linear-quadratic design takes over. The last resort is proved for constant
    parameters only.

    Parameters
    ----------
    fault : Fault
    step : number or text, optional
        T_s [s]; the fault's without.
    feedback : str
        ``"error"`` or ``"state"``.

    Raises
    ------
    ParameterError
        When no gains are found; the message says how much the fault moves away within one period.
    """
    period = rational(fault.sampling_time if step is None else step, "step")
    problem = LinearProblem.of(fault)
    tried = (
        _judged(problem, found.controller, "continuous", period, found.theta)
        for found in (riccati_design(fault, bandwidth=share / float(period), feedback=feedback) for share in _SHARES)
    )
    best = _first_proved(tried)
    if best is not None and best.varying.verdict is Verdict.PROVED:
        return best
    try:
        other = discrete_design(fault, period, feedback=feedback)
    except ParameterError:
        if best is None:
            raise
        return best
    return other if best is None or other.varying.verdict is Verdict.PROVED else best


def _first_proved(tried: Iterable[SampledDesign]) -> SampledDesign | None:
    """First design that is proved for parameters that vary, else the first that is for constant ones."""
    kept = None
    for design in tried:
        if design.constant.verdict is not Verdict.PROVED:
            continue
        if design.varying.verdict is Verdict.PROVED:
            return design
        kept = kept or design
    return kept


def _judged(
    problem: LinearProblem, controller: Controller, method: str, step: Fraction, theta: Matrix | None = None
) -> SampledDesign:
    gains = tuple(controller.gains.values())
    return SampledDesign(
        controller=controller,  # type: ignore[arg-type]
        method=method,
        step=step,
        constant=hold_verdict(problem, gains, step, integration="euler"),
        varying=varying_verdict(problem, gains, step),
        theta=theta,
    )


def discrete_design(fault: Fault, step: float | str | Fraction, *, feedback: str = "error") -> SampledDesign:
    """Discrete linear-quadratic gains, those with a small spectral radius over the box first, proved.

    python-control's `dlqr` (method "scipy") on the held plant at the middle and at the most unstable corner of the box,
    weights R over sixteen decades; where none is stable at every corner, the best one is improved by a direct search
    (Nelder and Mead) on the spectral radius. Those with the smallest radii may not be proved for parameters that vary
    in time, so that a few of all are tried.

    Raises
    ------
    ParameterError
        When none is proved, not even for constant parameters.
    """
    period = rational(step, "step")
    problem = LinearProblem.of(fault)
    law = control_law("elqr")
    candidates = _candidates(fault, problem, float(period))
    spread = candidates[:: max(len(candidates) // _TRIES, 1)]
    found = _first_proved(
        _judged(problem, law.from_values(gains, feedback=feedback), "discrete", period) for gains in spread
    )
    if found is None:
        raise ParameterError(refusal(problem, float(period)))
    return found


def refusal(problem: LinearProblem, step: float) -> str:
    """Why no gains were found for a sampling period."""
    grown = open_loop_growth(problem, step)
    return (
        f"no gains were found that hold this fault when p is held for {step:.4g} s: in that time the plant alone moves "
        f"away {grown:.4g}-fold at its weakest, and μN̂ is uncertain by a factor {float(problem.sectors.beta[1]):.4g}. "
        "Sample faster, or narrow the box."
    )


def open_loop_growth(problem: LinearProblem, step: float) -> float:
    """Factor by which the plant without control leaves the equilibrium in a period, at its weakest corner."""
    s, w = float(problem.sectors.slip[1]), float(problem.sectors.rate[0])
    pole = (-w + math.sqrt(max(w * w + 4 * s, 0.0))) / 2
    return math.exp(min(max(pole, 0.0) * step, 700.0))


def _candidates(fault: Fault, problem: LinearProblem, step: float) -> list[tuple[Fraction, ...]]:
    """Gains with stable vertices in floating point, smallest spectral radius first."""
    import numpy as np

    scales = problem.scales(fault.reference.target_slip)
    task = ScaledDesign(problem, scales, Specifications())
    inside, length = task.inside, step / float(scales.time)
    found: list[tuple[float, tuple[Fraction, ...]]] = []
    for vertex in _plants(inside):
        for R in np.logspace(-8, 8, 33):
            inner = _discrete_gains(vertex, length, task.Q0, float(R))
            if inner is None:
                continue
            gains = tuple(rational(f"{float(k):.9e}") for k in scales.gains_outside(inner))
            found.append((largest_radius(problem, gains, step, "euler"), gains))
    found.sort()
    if found and found[0][0] >= 1:
        found = [_improved(problem, found[0][1], step)]
    return [gains for radius, gains in found if radius < 1]


def _improved(problem: LinearProblem, gains: tuple[Fraction, ...], step: float) -> tuple[float, tuple[Fraction, ...]]:
    """Spectral radius and gains after a direct search on the logarithms of the gains."""
    import numpy as np
    from scipy.optimize import minimize

    def moved(change: Any) -> tuple[Fraction, ...]:
        return tuple(
            rational(f"{float(k) * float(f):.9e}") for k, f in zip(gains, np.exp(np.clip(change, -20, 20)), strict=True)
        )

    found = minimize(
        lambda change: largest_radius(problem, moved(change), step, "euler"),
        np.zeros(4), method="Nelder-Mead", options={"maxfev": 600, "fatol": 1e-6, "xatol": 1e-4},
    )  # fmt: skip
    return float(found.fun), moved(found.x)


def _plants(inside: LinearProblem) -> list[Vertex]:
    (low, high), (s0, s1), (w0, w1) = inside.sectors.beta, inside.sectors.slip, inside.sectors.rate
    return [((low + high) / 2, s, w) for s, w in (((s0 + s1) / 2, (w0 + w1) / 2), (s1, w0))]


def _discrete_gains(vertex: Vertex, length: float, Q0: Any, R: float) -> list[Fraction] | None:
    """K of the held plant, nondimensional; None where the plant leaves the range of floating point or no K exists."""
    import control
    import numpy as np

    beta, s, w = (float(v) for v in vertex)
    F, G = held_plant(length, s, w, "euler")
    if not np.isfinite(F).all() or np.abs(F).max() > 1e8:
        return None
    try:
        K = control.dlqr(F, beta * G[:, None], Q0 * length, [[R * length]], method=METHOD)[0]
    except (np.linalg.LinAlgError, ValueError, control.ControlArgument):
        return None
    return [Fraction(float(k)) for k in K[0]]
