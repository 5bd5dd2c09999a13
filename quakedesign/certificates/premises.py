"""What a certificate needs, against what a given fault, reference and disturbance ask for. Ball arithmetic only."""

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.bounds import Enclosure, UpperBound
from quakedesign.certificates.certificate import Certificate
from quakedesign.certificates.claim import require
from quakedesign.certificates.domain import Domain, Question, certified_domain, certified_lipschitz
from quakedesign.certificates.level_sets import LevelSets
from quakedesign.certificates.matched import (
    Errors,
    Range,
    coefficient_range,
    friction_range,
    initial_perturbation,
    largest_matched_rate,
    least_authority,
    plant_ranges,
)
from quakedesign.certificates.premise import Premise
from quakedesign.certificates.robustness import robustness
from quakedesign.controllers import SlidingMode
from quakedesign.controllers.feed_forward import FEED_FORWARDS, FeedForward, feed_forward
from quakedesign.fault import Fault

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
    """What is certified of the same gains with one feed-forward.

    Attributes
    ----------
    feedforward : FeedForward
    premises : tuple of Premise
    domain : Domain or None
        None where the certificate has no bounds of its states, or there is none.
    """

    feedforward: FeedForward
    premises: tuple[Premise, ...]
    domain: Domain | None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; exact coefficients as texts."""
        return {
            "feedforward": self.feedforward.name,
            "coefficients": {name: str(v) for name, v in self.feedforward.coefficients.items()},
            "premises": [p.to_dict() for p in self.premises],
            "domain": self.domain.to_dict() if self.domain else None,
        }


def sliding_mode_premises(
    fault: Fault, controller: SlidingMode, certificate: Certificate | None
) -> tuple[list[Premise], Domain | None]:
    """Premises that can be decided without a run, and the certified domain.

    `along_reference` takes the errors as zero. `level_set` takes the level set of V that holds the start x = 0, ξ = 0
    for every disturbance of the class, and the errors' own part of h on it, by the better of two methods (`Domain`).

    Raises
    ------
    CertificateError
        When the certificate is about other gains.
    """
    (only,) = _variants(fault, controller, certificate, [controller.feedforward])
    return list(only.premises), only.domain


def feedforward_variants(fault: Fault, controller: SlidingMode, certificate: Certificate | None) -> tuple[Variant, ...]:
    """The same gains and certificate with every named feed-forward, the controller's own first.

    Raises
    ------
    CertificateError
        When the certificate is about other gains.
    """
    known = [feed_forward(name, fault, controller.divisor) for name in FEED_FORWARDS]
    return _variants(fault, controller, certificate, dict.fromkeys([controller.feedforward, *known]))


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
        "the certificate is about other gains than the controller's.",
    )
    bounded = all(f"bound_{state}" in certificate.claims for state in certificate.loop.states)
    known = robustness(certificate, controller.loop_field()) if bounded else None
    return tuple(_variant(Question(fault, law, certificate, known), bounded=bounded) for law in laws)


def _variant(question: Question, *, bounded: bool) -> Variant:
    fault, law, certificate = question.fault, question.controller, question.certificate
    premises = [
        control_coefficient(fault, law.divisor, certificate.loop.uncertain["beta"]),
        _along_reference(fault, law, certified_lipschitz(certificate)),
    ]
    if bounded:
        premises.append(_level_set(question))
    domain = certified_domain(question) if bounded else None
    return Variant(feedforward=law.feedforward, premises=tuple(premises), domain=domain)


def control_coefficient(fault: Fault, divisor: Fraction, certified: Range) -> Premise:
    """β inside the certified range; the ratio is the larger of b_M/β_M and β_m/b_m."""
    low, high = coefficient_range(fault, divisor)
    worst = max(high / certified[1], certified[0] / low)
    return Premise(
        name="control_coefficient",
        required=worst * certified[1],
        certified=certified[1],
        unit="-",
        note=f"β from {Enclosure.of(low, high):.6g}; certified from {UpperBound(certified[0]):.6g}",
    )


def matched_rate_premise(
    fault: Fault, controller: SlidingMode, name: str, errors: Errors, certified: Fraction | None, note: str
) -> Premise:
    """|h'| ≤ L̄ while the errors stay within bounds; without a certificate against the limit of the gains."""
    required = largest_matched_rate(fault, controller.divisor, errors, feedforward=controller.feedforward)
    against = controller.lipschitz_limit if certified is None else certified * controller.scale
    note += _with(controller)
    return Premise(
        name=name,
        required=required,
        certified=against,
        unit="m/s^3",
        proved=certified is not None,
        note=note if certified is not None else note + "; no certificate: compared with the limit that no V can exceed",
    )


def _along_reference(fault: Fault, controller: SlidingMode, certified: Fraction | None) -> Premise:
    note = "rigorous over the uncertainty box and the disturbance class, errors zero"
    return matched_rate_premise(fault, controller, "along_reference", Errors(), certified, note)


def _level_set(question: Question) -> Premise:
    """Either |h'| ≤ L̄ with the errors' part, or the errors' part against the decrease of V: whichever is closer."""
    fault, law = question.fault, question.controller
    level = question.sets.level(initial_perturbation(fault, law.divisor))
    errors = question.sets.errors(level)
    start = f"rigorous on the level set of V that holds the start: |e1| <= {UpperBound(errors.slip):.2g} m, "
    start += f"|e2| <= {UpperBound(errors.rate):.2g} m/s"
    parts, rate = question.split(level), question.whole(level)
    share = sum(parts.values(), Fraction(0)) if parts else None
    if share is None or rate <= share:
        return matched_rate_premise(fault, law, "level_set", errors, certified_lipschitz(question.certificate), start)
    return Premise(
        name="level_set",
        required=share,
        certified=1.0,
        unit="-",
        note=start
        + "; share of the decrease of V that the errors' part of h takes, along_reference holding"
        + _with(law),
    )


def _with(controller: SlidingMode) -> str:
    """What the law adds to ν, for a note."""
    name = controller.feedforward.name
    return "" if name == "none" else f"; with {name} feed-forward"
