"""Domain of a certificate if the matched disturbance depends on the control (ERRATA 16).

Two ways to split h, both rigorous:

- *whole*: all of h(t, e) is in e3, so |h'| ≤ L̄ must hold including the part due to errors and control.
- *split*: only h(t, 0) is in e3, so |h'| ≤ L̄ is needed along the reference only. The rest w = h(t, e) − h(t, 0) is
  bounded by g1|e1| + g2|e2| and must leave V' negative (`Robustness`). The control does not enter.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import sympy as sp

from quakedesign.exact import LowerBound, UpperBound, end_of
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import SlidingMode
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    coefficient_range,
    largest_matched_rate,
    largest_sensitivities,
    parameter_ranges,
    rate_expression,
    sensitivity_expressions,
    stage,
)
from quakedesign.lyapunov.exact.robustness import LevelSets, Robustness
from quakedesign.symbolic import plant
from quakedesign.symbolic.enclosure import ball, upper_bound

_STEPS = (-640, 160)
"""Range of n in V^{1/m} = (1 + (n mod 8)/8)·2^{n div 8} that is searched."""

_PIECES = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Domain:
    """Largest level set found on which the premises of a certificate are proved."""

    level: float  # Level of V for the base gains; 0 if the set is empty
    # slip_error, slip_rate_error: Bounds on |e1| [m] and |e2| [m/s] on it; not every such pair lies in it
    slip_error: UpperBound
    slip_rate_error: UpperBound
    # start_slip_error, start_slip_rate_error, start_perturbation: Largest initial |e1| [m], |e2| [m/s] and |e3| [m/s²]
    # in the level set, each with all other errors zero. For x = 0 and ξ = 0 the initial e3 is h(0).
    start_slip_error: LowerBound
    start_slip_rate_error: LowerBound
    start_perturbation: LowerBound
    method: str  # ``"whole"`` or ``"split"`` (part of h in e3); empty for an empty set
    # Cause that limits the level set: for ``"whole"`` the largest part of h' that grows with the errors, for
    # ``"split"`` the error that cancels most of the decrease; for an empty set, the range of β or the largest part of
    # h' at zero errors
    limited_by: str
    feedforward: str  # Name of the feed-forward of the law

    def to_dict(self) -> Json:
        """Plain numbers and texts, in SI units."""
        return {name: float(v) if isinstance(v, Fraction) else v for name, v in asdict(self).items()}


@dataclass(frozen=True)
class DomainProblem:
    """Problem of finding the level sets of V on which a certificate applies to a fault under a control law."""

    fault: Fault
    controller: SlidingMode
    certificate: Certificate  # For the base gains, with bounds of all states
    robustness: Robustness | None  # None: only the method ``"whole"`` is available

    @cached_property
    def sets(self) -> LevelSets:
        """Level sets in metres and seconds."""
        return LevelSets(self.certificate, self.controller.scale, self.controller.loop_field())

    @property
    def allowed(self) -> Fraction:
        """Certified bound L̄ on |h'| for the scaled gains [m/s³]."""
        return certified_lipschitz(self.certificate) * self.controller.scale

    def along_reference(self) -> Fraction:
        """Bound on |h'| for zero errors [m/s³]."""
        return self._rate(Errors())

    def whole(self, level: Fraction, pieces: int = _PIECES) -> Fraction:
        """Bound on |h'|/L̄ on {V ≤ level}, errors and control included; the certificate applies if at most 1."""
        return self._rate(self.sets.errors(level), pieces=pieces) / self.allowed

    def holds_whole(self, level: Fraction) -> bool:
        """Whether `whole` is below 1, without its value."""
        return self._rate(self.sets.errors(level), pieces=_PIECES, limit=self.allowed) < self.allowed

    def split(self, level: Fraction, errors: Errors | None = None) -> dict[str, Fraction] | None:
        """Shares of the decrease of V that the error-dependent part of h can cancel on {V ≤ level}, by error.

        The certificate applies if the sum of the shares is below 1. The sensitivities of h are evaluated for the errors
        of the level, or for given errors. None without `robustness`, or if |h'| along the reference may exceed L̄.
        """
        robustness = self.robustness
        if robustness is None or self.along_reference() > self.allowed:
            return None
        bounds = errors or self.sets.errors(level)
        still = Errors(slip=bounds.slip, rate=bounds.rate)
        g1, g2 = largest_sensitivities(self.fault, self.controller.divisor, still, **self._added)
        return {
            "slip": robustness.slip * g1 * _root(level, robustness.slip_power),
            "rate": robustness.rate * g2 * _root(level, robustness.rate_power),
        }

    @property
    def _added(self) -> Json:
        return {"feedforward": self.controller.feedforward}

    def _rate(self, errors: Errors, **options: Any) -> Fraction:
        return largest_matched_rate(self.fault, self.controller.divisor, errors, **options, **self._added)


def certified_lipschitz(certificate: Certificate) -> Fraction:
    """L̄ of the base gains [m/s³]: the largest L̄ with [−L̄, L̄] in the certified range of d = h'."""
    low, high = certificate.loop.uncertain["d"]
    return min(-low, high)


def certified_domain(problem: DomainProblem) -> Domain:
    """Largest level set on which one of the two methods proves the premises.

    The result is rigorous; V^{1/m} is searched in steps of an eighth of each power of two. The set is empty if β leaves
    its certified range, or h' exceeds L̄ at zero errors.
    """
    low_beta, high_beta = coefficient_range(problem.fault, problem.controller.divisor)
    certified = problem.certificate.loop.uncertain["beta"]
    if low_beta < certified[0] or high_beta > certified[1]:
        return _domain(problem, Fraction(0), "", "the input gain β, whose range exceeds the certified one")

    def whole(step: int) -> bool:
        return problem.holds_whole(_level(step, problem.sets.degree))

    split = _largest_split(problem)
    low = _STEPS[0] if split is None else split
    best = _largest(whole, low, _STEPS[1]) if whole(low) else None
    if best is not None and (split is None or best > split):
        level = _level(best, problem.sets.degree)
        return _domain(problem, level, "whole", _whole_limit(problem, problem.sets.errors(level)))
    if split is not None:
        level = _level(split, problem.sets.degree)
        return _domain(problem, level, "split", _split_limit(problem, level))
    return _domain(problem, Fraction(0), "", _whole_limit(problem, Errors()))


def _largest(condition: Callable[[int], bool], low: int, high: int) -> int:
    """Largest step for which `holds` is true, by bisection; it must be true for `low`."""
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if condition(middle) else (low, middle)
    return low


def _largest_split(problem: DomainProblem) -> int | None:
    """Largest step for which `split` is proved, searched downwards from the step for sensitivities at zero errors."""
    degree = problem.sets.degree

    def is_valid(step: int, errors: Errors | None = None) -> bool:
        parts = problem.split(_level(step, degree), errors)
        return parts is not None and sum(parts.values()) < 1

    low, high = _STEPS
    if not is_valid(low):
        return None
    guess = _largest(lambda step: is_valid(step, Errors()), low, high)
    above, stride = guess, 1
    while not is_valid(guess):
        above, guess, stride = guess, max(low, guess - stride), 2 * stride
    return _largest(is_valid, guess, above)


def _level(step: int, degree: Fraction) -> Fraction:
    """Level ((1 + (n mod 8)/8)·2^{n div 8})^m of V for the step n, with m rounded to an integer."""
    whole, part = divmod(step, 8)
    return ((1 + Fraction(part, 8)) * Fraction(2) ** whole) ** round(degree)


def _domain(problem: DomainProblem, level: Fraction, method: str, limit: str) -> Domain:
    errors = problem.sets.errors(level)
    first, second, *_, last = problem.sets.starts(level)
    return Domain(
        level=float(level),
        slip_error=UpperBound(errors.slip),
        slip_rate_error=UpperBound(errors.rate),
        start_slip_error=LowerBound(first),
        start_slip_rate_error=LowerBound(second),
        start_perturbation=LowerBound(last),
        method=method,
        limited_by=limit,
        feedforward=problem.controller.feedforward.name,
    )


_FROM_ERRORS = {
    "the control, through viscosity and rate weakening (e2')": (plant.acceleration_error,),
    "the slip-rate error, through spring and weakening friction": (plant.e2, plant.e1),
}
_GIVEN = {"the disturbance": (plant.phi, plant.phi_t), "the moving reference": (stage,)}


def _whole_limit(problem: DomainProblem, errors: Errors) -> str:
    """Cause of the largest part of h': among the errors or, at zero errors, among disturbance and reference.

    For each cause the symbols of all others are set to zero.
    """
    expression = rate_expression(problem.fault, problem.controller.divisor, problem.controller.feedforward)
    box = parameter_ranges(problem.fault) | errors.ranges()
    every = _FROM_ERRORS | _GIVEN

    def alone(cause: str) -> Fraction:
        others = {s: sp.Integer(0) for other, group in every.items() if other != cause for s in group}
        return upper_bound(expression.xreplace(others), box, pieces=_PIECES)

    return max(_GIVEN if errors == Errors() else _FROM_ERRORS, key=alone)


_ERRORS = {
    "slip": ("the slip error", plant.slip_slope, "the spring"),
    "rate": ("the slip-rate error", plant.rate_slope, "viscosity"),
}


def _split_limit(problem: DomainProblem, level: Fraction) -> str:
    """Error that cancels most of the decrease, and the cause of its effect."""
    parts = problem.split(level) or {}
    error = max(parts, key=lambda name: parts[name])
    name, slope, rest = _ERRORS[error]
    fault, controller = problem.fault, problem.controller
    expressions = sensitivity_expressions(fault, controller.divisor, controller.feedforward)
    expression = dict(zip(_ERRORS, expressions, strict=True))[error]
    box = parameter_ranges(fault) | problem.sets.errors(level).ranges()
    straight = expression.xreplace({slope: sp.Integer(0)})
    calm = straight.xreplace(dict.fromkeys((plant.phi_1, plant.phi_2), sp.Integer(0)))
    less = "" if controller.feedforward.name == "none" else " minus its feed-forward"
    causes = {
        f"{rest}{less}": calm,
        "friction": expression - straight,
        "the growth of the disturbance": straight - calm,
    }
    return f"{name}, through {max(causes, key=lambda cause: upper_bound(causes[cause], box, pieces=_PIECES))}"


def _root(level: Fraction, power: Fraction) -> Fraction:
    """Upper bound of level^power."""
    return end_of((ball(level, level) ** ball(power, power)).upper())
