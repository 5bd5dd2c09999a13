"""Premises under which a certificate applies to a given fault, reference and disturbance.

Chapters: premise as a value; premises of sliding modes, in ball arithmetic; sector premises of linear feedback (ERRATA
6 to 12); recognition of the plant of a loop, independently of the names of its states; check that the constants and
ranges of a certificate cover those of a fault.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.exact import Enclosure, LowerBound, UpperBound, float_above, rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller, SlidingMode
from quakedesign.laws.feed_forward import FEED_FORWARDS, FeedForward, feed_forward
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.claim import Loop, require
from quakedesign.lyapunov.exact.domain import Domain, DomainProblem, certified_domain, certified_lipschitz
from quakedesign.lyapunov.exact.loop_expressions import sympy_field
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    Range,
    coefficient_range,
    friction_range,
    initial_perturbation,
    largest_matched_rate,
    least_authority,
    plant_ranges,
    rest_pressure,
    sectors,
)
from quakedesign.lyapunov.exact.robustness import LevelSets, robustness
from quakedesign.symbolic import plant
from quakedesign.symbolic.homogeneity import relative_degree

# ----------------------------------------------------------------------
# One condition under which a certificate applies to a given loop.

_MOST_DIGITS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Premise:
    """One condition under which a certificate applies to a given loop."""

    name: str
    required: Fraction | float  # Value required by the loop, in `unit`; a rigorous upper bound unless `measured`
    certified: Fraction | float  # Value covered by the certificate, in `unit`
    unit: str
    measured: bool = False  # True if `required` was measured in a simulation
    # False if `certified` is only an upper limit for every certificate, or if another end of the certified ranges does
    # not cover the loop; the premise then never holds
    proved: bool = True
    note: str = ""  # Assumptions of the required value

    def __post_init__(self) -> None:
        object.__setattr__(self, "required", _bound(UpperBound, self.required))
        object.__setattr__(self, "certified", _bound(LowerBound, self.certified))

    @property
    def ratio(self) -> Fraction | float | None:
        """Ratio required/certified [-], an `UpperBound`; None if only `certified` is zero."""
        if self.certified == 0:
            return UpperBound(0) if self.required == 0 else None
        return _bound(UpperBound, self.required / self.certified)

    @property
    def holds(self) -> bool:
        """Whether `proved` is true and the ratio at most 1."""
        return self.proved and self.ratio is not None and self.ratio <= 1

    @property
    def sides(self) -> tuple[str, str]:
        """Texts of the required value (rounded up) and the certified value (rounded down), or a note on equality."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        if self.required == self.certified != 0:
            return f"at most {self.required:.4g}{unit}", "equal"
        for digits in range(4, _MOST_DIGITS):  # until the rounded values satisfy the premise, too
            required, certified = (f"{side:.{digits}g}" for side in (self.required, self.certified))
            if not self.holds or Fraction(required) <= Fraction(certified):
                return f"{required}{unit}", f"{certified}{unit}"
        return f"{self.required:.4g}{unit}", "at least as large"

    def to_dict(self) -> Json:
        """Dictionary with the keys of ``--json`` and the unit; infinite values are None."""
        return {
            "name": self.name,
            "required": _finite(self.required),
            "certified": _finite(self.certified),
            "ratio": _finite(self.ratio),
            "holds": self.holds,
            "unit": self.unit,
            "measured": self.measured,
            "note": self.note,
        }


def _bound(kind: type[UpperBound] | type[LowerBound], value: Fraction | float) -> Fraction | float:
    """Rigorous bound on a number; a number that is not finite, as after divergence, is returned unchanged."""
    return value if isinstance(value, float) and not math.isfinite(value) else kind(value)


def _finite(value: Fraction | float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


# ----------------------------------------------------------------------
# Ranges of a certificate, compared with those of a given fault, reference and disturbance, in ball arithmetic only.

__all__ = [
    "Domain",
    "Errors",
    "LevelSets",
    "Premise",
    "Range",
    "Variant",
    "certified_lipschitz",
    "coefficient_range",
    "control_coefficient",
    "feedforward_variants",
    "friction_range",
    "largest_matched_rate",
    "least_authority",
    "matched_rate_premise",
    "plant_ranges",
    "sliding_mode_premises",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """Premises and domain of given gains with one feed-forward."""

    feedforward: FeedForward
    premises: tuple[Premise, ...]
    domain: Domain | None  # None without a certificate, or if it has no bounds of its states

    def to_dict(self) -> Json:
        """Plain values in SI units; exact coefficients as strings."""
        return {
            "feedforward": self.feedforward.name,
            "coefficients": {name: str(v) for name, v in self.feedforward.coefficients.items()},
            "premises": [p.to_dict() for p in self.premises],
            "domain": self.domain.to_dict() if self.domain else None,
        }


def sliding_mode_premises(
    fault: Fault, controller: SlidingMode, certificate: Certificate | None
) -> tuple[list[Premise], Domain | None]:
    """Premises of a sliding mode that are decided without simulation, and the certified domain.

    The premise `along_reference` assumes zero errors. The premise `level_set` bounds h' on the level set of V that
    contains the initial state x = 0, ξ = 0 for every disturbance of the class, by the method *whole* or *split* of
    `domain`, whichever has the smaller ratio.

    Raises
    ------
    CertificateError
        If the certificate belongs to other gains.
    """
    (only,) = _variants(fault, controller, certificate, [controller.feedforward])
    return list(only.premises), only.domain


def feedforward_variants(fault: Fault, controller: SlidingMode, certificate: Certificate | None) -> tuple[Variant, ...]:
    """Premises of the same gains and certificate with every named feed-forward, the controller's own first.

    Raises
    ------
    CertificateError
        If the certificate belongs to other gains.
    """
    laws = [feed_forward(name, fault, controller.divisor) for name in FEED_FORWARDS]
    return _variants(fault, controller, certificate, dict.fromkeys([controller.feedforward, *laws]))


def _variants(
    fault: Fault, controller: SlidingMode, certificate: Certificate | None, choices: Iterable[FeedForward]
) -> tuple[Variant, ...]:
    laws = [controller.with_feedforward(choice) for choice in choices]
    if certificate is None or certificate.refutation is not None:
        premises = [_along_reference(fault, law, None) for law in laws]
        return tuple(
            Variant(feedforward=law.feedforward, premises=(premise,), domain=None)
            for law, premise in zip(laws, premises, strict=True)
        )
    require(
        certificate.loop.law == controller.name and dict(certificate.loop.gains) == dict(controller.gains),
        "the gains of the certificate differ from those of the controller.",
    )
    bounded = all(f"bound_{state}" in certificate.claims for state in certificate.loop.states)
    margins = robustness(certificate, controller.loop_field()) if bounded else None
    return tuple(_variant(DomainProblem(fault, law, certificate, margins), bounded=bounded) for law in laws)


def _variant(problem: DomainProblem, *, bounded: bool) -> Variant:
    fault, law, certificate = problem.fault, problem.controller, problem.certificate
    premises = [
        control_coefficient(fault, law.divisor, certificate.loop.uncertain["beta"]),
        _along_reference(fault, law, certified_lipschitz(certificate)),
    ]
    if bounded:
        premises.append(_level_set(problem))
    domain = certified_domain(problem) if bounded else None
    return Variant(feedforward=law.feedforward, premises=tuple(premises), domain=domain)


def control_coefficient(fault: Fault, divisor: Fraction, certified: Range) -> Premise:
    """Premise that β of the fault, in [b_m, b_M], is in the certified [β_m, β_M]; ratio max(b_M/β_M, β_m/b_m)."""
    low, high = coefficient_range(fault, divisor)
    worst = max(high / certified[1], certified[0] / low)
    return Premise(
        name="control_coefficient",
        required=worst * certified[1],
        certified=certified[1],
        unit="-",
        note=f"β from {Enclosure.of(low, high):.6g}; certified from {UpperBound(certified[0]):.6g} to "
        f"{LowerBound(certified[1]):.6g}",
    )


def matched_rate_premise(
    fault: Fault, controller: SlidingMode, name: str, errors: Errors, certified: Fraction | None, note: str
) -> Premise:
    """Premise that |h'| ≤ L̄ for bounded errors; without a certificate, L̄ is the law's upper limit for every V."""
    required = largest_matched_rate(fault, controller.divisor, errors, feedforward=controller.feedforward)
    against = controller.lipschitz_limit if certified is None else certified * controller.scale
    note += _with(controller)
    return Premise(
        name=name,
        required=required,
        certified=against,
        unit="m/s^3",
        proved=certified is not None,
        note=note if certified is not None else note + "; no certificate: compared with an upper limit for every V",
    )


def _along_reference(fault: Fault, controller: SlidingMode, certified: Fraction | None) -> Premise:
    note = "rigorous over the uncertainty box and the disturbance class, errors zero"
    return matched_rate_premise(fault, controller, "along_reference", Errors(), certified, note)


def _level_set(problem: DomainProblem) -> Premise:
    """Premise on the level set of the initial state: method *whole* or *split*, whichever has the smaller ratio."""
    fault, law = problem.fault, problem.controller
    level = problem.sets.level(initial_perturbation(fault, law.divisor))
    errors = problem.sets.errors(level)
    start = f"rigorous on the level set of V that contains the initial state: |e1| <= {UpperBound(errors.slip):.2g} m, "
    start += f"|e2| <= {UpperBound(errors.rate):.2g} m/s"
    parts, rate = problem.split(level), problem.whole(level)
    share = sum(parts.values(), Fraction(0)) if parts else None
    if share is None or rate <= share:
        return matched_rate_premise(fault, law, "level_set", errors, certified_lipschitz(problem.certificate), start)
    return Premise(
        name="level_set",
        required=share,
        certified=1.0,
        unit="-",
        note=f"{start}; required: fraction of the decrease of V that the error-dependent part of h can cancel"
        + _with(law),
    )


def _with(controller: SlidingMode) -> str:
    """Note on the feed-forward that the law adds to ν."""
    name = controller.feedforward.name
    return "" if name == "none" else f"; with {name} feed-forward"


# ----------------------------------------------------------------------
# Premises of the certificate of linear feedback on a fault: sectors for any constant reference (ERRATA 6 to 12).


def linear_premises(fault: Fault, controller: Controller, certificate: Certificate | None) -> list[Premise]:
    """Premises of linear feedback: sectors inside the certified ones; constant reference; vanishing disturbance.

    The certificate is about constant references and disturbances that vanish at the equilibrium. `constant_reference`
    and `vanishing_disturbance` quantify the deviation of a task from both (ERRATA 8, 11); for such a task `certify
    --peaks` proves bounds of the errors.

    Raises
    ------
    CertificateError
        If the certificate belongs to other gains.
    """
    needed = sectors(fault)
    proved = certificate is not None
    ranges = certificate.loop.uncertain if certificate is not None else needed.ranges()
    if certificate is not None:
        require(
            certificate.loop.law == controller.name
            and dict(certificate.loop.gains) == dict(controller.gains)
            and certificate.loop.constants.get("b") == needed.authority,
            "law, gains or control authority of the certificate differ from those on this fault.",
        )
    inside = ranges["s"][0] <= needed.slip[0] and ranges["w"][0] <= needed.rate[0] <= needed.rate[1] <= ranges["w"][1]
    peak_rate = Fraction(15, 8) * rational(fault.reference.target_slip) / rational(fault.reference.operation_time)
    return [
        Premise(
            name="control_coefficient",
            required=needed.beta[1],
            certified=ranges["beta"][1],
            unit="-",
            proved=proved and ranges["beta"][0] <= needed.beta[0],
        ),
        Premise(
            name="friction_slope",
            required=needed.slip[1],
            certified=ranges["s"][1],
            unit="1/s^2",
            proved=proved and inside,
            note="chord slope of weakening minus that of the spring; effective stress up to "
            f"{UpperBound(needed.largest_effective_stress):.4g} Pa",
        ),
        Premise(
            name="constant_reference",
            required=peak_rate,
            certified=0.0,
            unit="m/s",
            note="certified for constant references; for a moving reference, see the error bounds (--peaks)",
        ),
        Premise(
            name="vanishing_disturbance",
            required=float_above(fault.disturbance_bounds[0]),
            certified=0.0,
            unit="m/s^2",
            note="certified for disturbances vanishing in equilibrium; for others, see the error bounds (--peaks)",
        ),
        *_limits_premise(fault, controller),
    ]


def _limits_premise(fault: Fault, controller: Controller) -> list[Premise]:
    """Premise that the pressure at rest is within the controller's limits, for every constant reference and plant."""
    limits = getattr(controller, "limits", None)
    if limits is None:
        return []
    low, high = rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip)))
    worst = max((low, limits.lowest), (high, limits.highest), key=lambda pair: pair[0] / pair[1])
    return [
        Premise(
            name="pressure_at_rest",
            required=abs(worst[0]),
            certified=abs(worst[1]),
            unit="Pa",
            note="the equilibrium pressure must be within the limits of the law; the proof assumes no saturation",
        )
    ]


# ----------------------------------------------------------------------
# Whether a loop has the plant of a fault, from its relative degree, whatever the names of its states in a file.

_CONTROL = "beta"


@cache
def slip_degree() -> int | None:
    """Relative degree of the slip with respect to the pressure, derived from the force balance."""
    return relative_degree(plant.x1, {plant.x1: plant.x2, plant.x2: plant.shifted_acceleration()}, plant.p)


def require_degree_of_slip(loop: Loop) -> None:
    """Reject a loop whose relative degree differs from that of the slip with respect to the pressure."""
    first, *_ = loop.states
    control = loop.symbols.get(_CONTROL, sp.Dummy())
    degree = relative_degree(loop.symbols[first], sympy_field(loop), control)
    if degree != slip_degree():
        raise CertificateError(
            f"the plant of the certificate is not a fault: the first state of {loop.law} has relative degree {degree}, "
            f"the slip has relative degree {slip_degree()} with respect to pressure"
        )


# ----------------------------------------------------------------------
# Check whether the constants and ranges of a certificate cover those of a fault.


def covers(certificate: Certificate, fault: Fault) -> list[str]:
    """Check that the constants and ranges of a certificate cover those of a fault, and report the coverage.

    The divisor of the control law is μ_res·N̂_min, that of designed gains.

    The certificate of a sliding mode is for the base gains (λ = 1); the returned lines state the least gain scale λ for
    this fault.

    Returns
    -------
    list of str
        Lines of text about the coverage.

    Raises
    ------
    CertificateError
        If the certificate does not cover the fault, or its plant is not a fault.
    """
    require_degree_of_slip(certificate.loop)
    loop, lines = certificate.loop, [f'covers {certificate.loop.law} on "{fault.name}", box {fault.box.name}']
    if loop.domain == "reals":
        needed = sectors(fault)
        if loop.constants != {"b": needed.authority}:
            raise CertificateError(f"the control authority of the certificate differs from that of {fault.name}")
        ranges = needed.ranges()
    else:
        divisor = least_authority(fault)
        ranges = {"beta": coefficient_range(fault, divisor)}
        zero = Errors(slip=Fraction(0), rate=Fraction(0), acceleration=Fraction(0))
        if certified_lipschitz(certificate) <= 0:
            raise CertificateError("the certified range of d = h' must contain 0 in its interior to cover a fault")
        rate = largest_matched_rate(fault, divisor, zero)
        least = UpperBound(rate / certified_lipschitz(certificate))
        lines.append(f"|h'| <= {UpperBound(rate):.4g} m/s^3 along the reference needs a scale of at least {least:.4g}")
    for name, (low, high) in ranges.items():
        if not loop.uncertain[name][0] <= low <= high <= loop.uncertain[name][1]:
            raise CertificateError(f"the certified range of {name} does not cover {fault.name}")
    return lines
