"""Design of sliding modes: base gains with a proof, and a scale λ for the fault."""

from dataclasses import replace
from fractions import Fraction
from math import floor, log10
from typing import Any, ClassVar

from quakedesign.errors import CertificateError, KinkError, ParameterError, UnsupportedError
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.guarantees import (
    Compensation,
    FaultProof,
    NoProof,
    StickSlipProof,
    TrackingGuarantee,
    TrackingProof,
    guarantee_of,
    sampled_sliding_mode,
    with_worst_case,
)
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.compensated_search import GUARANTEED, design_sticking
from quakedesign.guarantees.search.default_designs import deadbeat, sliding_mode
from quakedesign.guarantees.search.linear_design import longest_step, nearest_setup
from quakedesign.laws import BaseGains, Controller, SlidingMode
from quakedesign.laws.feed_forward import NONE, FeedForward
from quakedesign.loop.loop_setup import MEASURED, LoopSetup
from quakedesign.lyapunov import Certificate, Loop, loop_of
from quakedesign.lyapunov.exact.domain import Domain
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    coefficient_range,
    largest_matched_rate,
    least_authority,
)
from quakedesign.lyapunov.exact.premises import Premise, Variant, feedforward_variants, sliding_mode_premises
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.plant import FaultPlant
from quakedesign.synthesis.method import Designed, DesignMethod, GainProblem, GuaranteeRequest
from quakedesign.synthesis.state_feedback import may_stick, sticking_options

_HEADROOM = Fraction(11, 10)
_SHARES = (Fraction(99, 100), Fraction(9, 10), Fraction(1, 2))


class SlidingModes(DesignMethod[SlidingMode]):
    """Base gains of families.toml, proved in continuous time for the fault's range of β."""

    name: ClassVar[str] = "sliding-mode"
    family: ClassVar[type] = SlidingMode
    designs: ClassVar[bool] = True
    takes_base_gains: ClassVar[bool] = True
    without_state: ClassVar[str] = (
        "sliding modes of second order do not apply to friction with a state, where the slip rate responds to the "
        "pressure without delay (algebraically without inertia)"
    )

    def design(self, problem: GainProblem[Designed], law: type[SlidingMode]) -> Designed:
        """Choose λ for the scheme ``stick-slip`` or ``compensated``; in continuous time, for the bound L̄ of |h'|."""
        if problem.setup.measured != MEASURED[0]:
            raise ParameterError(
                f"a sliding mode needs slip and slip rate. Received {problem.setup.measured!r} for {law.name}. "
                "Omit measured, or design an e-LQR."
            )
        problem.require_exact_in_continuous_time()
        if problem.setup.path:
            raise UnsupportedError(
                f"sliding modes are designed without delay, lag and diffusion path. Received "
                f"{', '.join(problem.setup.path)} with {law.name}. Design an elqr, or use guarantee for a sliding mode "
                "with given gains."
            )
        if problem.feedforward != NONE and not problem.continuous:
            raise ParameterError(
                "feedforward has no guarantee with zero-order hold. "
                f"Received {problem.feedforward.name!r}. Design with continuous, or omit feedforward."
            )
        base, certificate = _proved_base(problem.fault, law)
        if problem.continuous:
            return _scaled(problem, base, certificate)
        return _compensated(problem, base, certificate)

    def assess(self, problem: GainProblem[Designed], controller: SlidingMode) -> Designed:
        """Verdict for 99, 90 and 50 % of the bound on |h'| that no V can exceed."""
        runs = guarantee_of(problem.task, controller) if controller.sampling else None
        limit = controller.lipschitz_limit / controller.scale
        beta = coefficient_range(problem.fault, controller.divisor)
        for share in _SHARES if limit > 0 else ():
            try:
                loop = sliding_mode_loop(controller, limit * share, beta)
                certificate = find_certificate(loop, controller.loop_field().degree, subject=type(controller))
            except (CertificateError, KinkError):
                break
            if certificate is not None:
                return problem.judged(
                    controller, certificate, details={"base_lipschitz": str(limit * share)}, runs=runs
                )
        return problem.judged(controller, runs=runs)

    def premises(
        self, fault: Fault, controller: SlidingMode, certificate: Certificate | None
    ) -> tuple[tuple[Premise, ...], Domain | None]:
        """Premises on |h'| and its certified bound L̄, along the reference and on a level set."""
        premises, domain = sliding_mode_premises(fault, controller, certificate)
        return tuple(premises), domain

    def guarantee(
        self, fault: Fault, task: FaultPlant, controller: SlidingMode, setup: LoopSetup
    ) -> FaultProof | NoProof:
        """Guarantee in the scheme ``compensated`` or ``stick-slip``, and in no other."""
        return guarantee_of(task, controller, ExactSetup(**setup.noise))

    def base_law(self, task: FaultPlant, law: type[SlidingMode], gains: tuple[str, ...]) -> SlidingMode:
        """Given base gains, by default the first stored ones."""
        return deadbeat(task, law, gains).controller

    def compensation(self, controller: SlidingMode, proof: FaultProof | NoProof) -> Compensation:
        """Sliding mode with weight and authority of its scheme."""
        return Compensation(controller=controller, proof=proof)

    def variants(self, fault: Fault, controller: SlidingMode, certificate: Certificate | None) -> tuple[Variant, ...]:
        """Every named feed-forward, its own first; takes a few seconds."""
        return feedforward_variants(fault, controller, certificate)

    def sampled(
        self, fault: Fault, task: FaultPlant, law: type[SlidingMode], step: Fraction, request: GuaranteeRequest
    ) -> TrackingGuarantee:
        """Guarantee in a scheme, with given base gains or the first stored ones."""
        request.require_all_measured()
        options: Any = {"gains": request.gains, "scheme": request.scheme or GUARANTEED, "objective": request.objective}
        setup = ExactSetup.of(request.setup)
        made = sliding_mode(task, law, step, **options, setup=setup)
        if isinstance(made, NoProof):
            return TrackingGuarantee(fault=fault, proof=made)
        if not made.proof.available:
            laws, none = deadbeat(task, law, request.gains), made.proof
            longest = longest_step(task, kind=laws, setup=setup)
            again = laws.design_near_longer_step(task, step, longest, setup=setup)
            if again is None:
                nearest = nearest_setup(task, step, kind=laws, pressed=none.only_pressure_fails, setup=setup)
                shorter = None if longest is None else laws.at(task, longest).proof
                near = shorter if isinstance(shorter, TrackingProof) else None
                entries: Any = {"shorter": near, "unproved_step": step if near else None, "nearest": nearest}
                return TrackingGuarantee(fault=fault, proof=none, **entries)
            made = again
        return replace(with_worst_case(fault, made.without_stick), compensation=made)


def _proved_base(fault: Fault, law: type[SlidingMode]) -> tuple[BaseGains[SlidingMode], Certificate | None]:
    """First base gains of a law with a proof for the fault's range of β, else the first ones."""
    beta, candidates = coefficient_range(fault, least_authority(fault)), law.base_gains()
    for base in candidates:
        loop = sliding_mode_loop(base.law, base.lipschitz, beta)
        certificate = find_certificate(loop, law.loop_field().degree, subject=law)
        if certificate is not None:
            return base, certificate
    return candidates[0], None


def _compensated(
    problem: GainProblem[Designed], base: BaseGains[SlidingMode], certificate: Certificate | None
) -> Designed:
    """Design on the stick–slip plant, else without stick, else in continuous time."""
    fault = problem.fault
    law = base.law.with_divisor(least_authority(fault))
    step = rational(fault.sampling_time)
    without: dict[str, Any] = {}
    if problem.plant != TrackingProof.plant and may_stick(type(law), problem.setup, problem.disturbance_class):
        sticking = design_sticking(problem.task, law, step, **sticking_options(problem))
        if isinstance(sticking, Compensation):
            assert isinstance(sticking.proof, StickSlipProof)
            details = {
                "objective": problem.objective,
                "step": str(step),
                "reason": None,
                **{name: str(value) for name, value in sticking.proof.sampled_loop.noise.items()},
                "rho": str(smallest_root(sticking.controller.scale)),
                **_origin(base),
            }
            return problem.judged(sticking.controller, certificate, details=details, runs=sticking.proof)
        without = {"not_at_rest": sticking.reason}
    made, designed = sampled_sliding_mode(problem.task, law, step, problem.objective, ExactSetup(**problem.setup.noise))
    if designed.runs is None:
        none = NoProof(reason=f"run in the scheme compensated, {designed.reason}")
        return _scaled(problem, base, certificate, runs=none)
    details = {
        "objective": problem.objective,
        "step": str(designed.runs.sampled_loop.step),
        "reason": designed.reason or None,
        **{name: str(value) for name, value in designed.runs.sampled_loop.noise.items()},
        "rho": str(smallest_root(made.controller.scale)),
        **_origin(base),
        **without,
    }
    return problem.judged(made.limited, certificate, details=details, runs=designed.runs, premises=designed.premises())


def _scaled(
    problem: GainProblem[Designed],
    base: BaseGains[SlidingMode],
    certificate: Certificate | None,
    runs: NoProof | None = None,
) -> Designed:
    """Design in continuous time; `runs` gives the reason why there is no sampled guarantee."""
    law, divisor, added = base.law, least_authority(problem.fault), problem.feedforward
    why = {"reason": runs.reason} if runs else {}
    if certificate is None:
        none = "no base gains of the family were proved for the fault's range of β"
        return problem.undecided(law.name, none, runs)
    rho = smallest_root(required_lipschitz(problem.fault, divisor, added) * _HEADROOM / base.lipschitz)
    scaled = law.scaled(rho**6).with_divisor(divisor).with_feedforward(added)
    details = {**why, "rho": str(rho), **_origin(base)}
    return problem.judged(scaled, certificate, details=details, runs=runs)


def _origin(base: BaseGains[SlidingMode]) -> dict[str, str]:
    return {"base_lipschitz": str(base.lipschitz), "base_source": base.source}


def required_lipschitz(fault: Fault, divisor: Fraction, added: FeedForward = NONE) -> Fraction:
    """Bound on |h'| [m/s³] that reference, disturbance and uncertainty require at zero errors."""
    return largest_matched_rate(fault, divisor, Errors(), feedforward=added)


def smallest_root(scale: Fraction) -> Fraction:
    """Smallest ρ with three significant digits and ρ⁶ ≥ scale."""
    estimate = float(scale) ** (1 / 6)
    unit = Fraction(10) ** (floor(log10(estimate)) - 2)
    steps = floor(Fraction(estimate) / unit)
    while (steps * unit) ** 6 < scale:
        steps += 1
    return steps * unit


def sliding_mode_loop(controller: Controller, lipschitz: Fraction, beta: tuple[Fraction, Fraction]) -> Loop:
    """Loop of base gains for |h'| ≤ lipschitz and a range of β.

    Raises
    ------
    CertificateError
        When the law has parts that certificates cannot express.
    """
    uncertain = {"beta": beta, "d": (-lipschitz, lipschitz)}
    return loop_of(controller.name, controller.loop_field(), gains=controller.gains, uncertain=uncertain)
