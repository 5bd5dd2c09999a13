"""Design of linear state feedback: Riccati equations, quadratic V, guarantees."""

from dataclasses import replace
from fractions import Fraction
from typing import Any, ClassVar

from quakedesign.errors import ParameterError
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.guarantees import (
    CLASSES,
    OBJECTIVES,
    ContinuousProof,
    FaultProof,
    NoProof,
    TrackingGuarantee,
    TrackingProof,
    best_guarantee,
    certified_peaks,
    design_sampled_law,
    sampled_design,
    with_worst_case,
)
from quakedesign.guarantees.exact.limit_theorems import infeasibility
from quakedesign.guarantees.exact.sampled_loop import ExactSetup, SampledLoop
from quakedesign.guarantees.search.linear_design import design_at, design_near_longer_step, longest_step, nearest_setup
from quakedesign.guarantees.search.lqg import near_path, sliding_model, why_no_law
from quakedesign.guarantees.search.stick_slip_design import design_stick_slip
from quakedesign.guarantees.sliding_result import guarantee_sliding
from quakedesign.guarantees.stick_slip_result import TAKEN
from quakedesign.guarantees.tracking_result import GAINS
from quakedesign.laws import Controller, summed_integrals
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.laws.feed_forward import NONE
from quakedesign.linear.linear_problem import FeedbackLoop, LinearProblem, Matrix
from quakedesign.linear.riccati import RiccatiDesign, riccati_design
from quakedesign.linear.robust_stability import finished_exactly, robust_stability, sector_loop, why_undecided
from quakedesign.linear.sampled_stability import SampledStability, sampled_stability
from quakedesign.loop.loop_setup import MEASURED, LoopSetup
from quakedesign.loop.sensing.differentiator import by_differences
from quakedesign.lyapunov import Certificate, Loop, Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import sectors
from quakedesign.lyapunov.search.lyapunov_search import certificate_of, claims_of, find_certificate, quadratic_margin
from quakedesign.plant import FaultPlant
from quakedesign.synthesis.method import (
    Designed,
    DesignMethod,
    GainProblem,
    GuaranteeRequest,
    SlowSlidingDesign,
    method_of,
)
from quakedesign.text import quantity


class StateFeedback(DesignMethod[ExtendedLQR]):
    """Sampled feedback with a disturbance estimate; Riccati equation in continuous time."""

    name: ClassVar[str] = "state-feedback"
    family: ClassVar[type] = ExtendedLQR
    designs: ClassVar[bool] = True
    without_state: ClassVar[str] = ""

    def design(self, problem: GainProblem[Designed], law: type[ExtendedLQR]) -> Designed:
        """Sampled design, or a design in continuous time with an exact proof about any constant reference."""
        if problem.feedforward != NONE:
            raise ParameterError(
                f"feedforward is for sliding modes. Received {problem.feedforward.name!r} with {law.name}. "
                "Omit feedforward."
            )
        problem.require_exact_in_continuous_time()
        if problem.sliding is not None:
            return _sliding(problem, problem.sliding, law)
        return _continuous(problem, law) if problem.continuous else _sampled(problem, law)

    def assess(self, problem: GainProblem[Designed], controller: ExtendedLQR) -> Designed:
        """Verdict over the fault's sectors."""
        loop = sector_loop(controller, sectors(problem.fault))
        return _judged(problem, controller, quadratic_certificate(loop), {})

    def guarantee(
        self, fault: Fault, task: FaultPlant, controller: ExtendedLQR, setup: LoopSetup
    ) -> FaultProof | NoProof:
        """Guarantee with integrals summed over the T_s of the fault."""
        if controller.feedback != "error" or controller.limits is not None or controller.offset:
            return super().guarantee(fault, task, controller, setup)
        step = rational(fault.sampling_time)
        law = summed_integrals(tuple(controller.gains.values()), step)
        return best_guarantee(task, SampledLoop(law=law, step=step))

    def certified_peaks(
        self, fault: Fault, controller: ExtendedLQR, disturbance_class: str
    ) -> ContinuousProof | NoProof:
        """Certified peaks in continuous time."""
        return certified_peaks(fault, controller, disturbance_class=disturbance_class)

    def sampled_stability(self, fault: Fault, controller: ExtendedLQR) -> SampledStability | None:
        """Stability of the unchanged law with zero-order hold over the fault's T_s."""
        return sampled_stability(LinearProblem.of(fault), tuple(controller.gains.values()), fault.sampling_time)

    def sampled(
        self, fault: Fault, task: FaultPlant, law: type[ExtendedLQR], step: Fraction, request: GuaranteeRequest
    ) -> TrackingGuarantee:
        """Guarantee of given gains with summed integrals, or of a law with an estimate."""
        setup, differs = request.setup, request.setup.measured == MEASURED[2]
        if request.gains and not differs:
            request.require_all_measured()
        if request.scheme not in (None, "explicit"):
            raise ParameterError(f"the e-LQR runs in the scheme explicit. Received {request.scheme!r}. Omit scheme.")
        exact = ExactSetup.of(setup)
        if request.gains:
            summed = summed_integrals(_four(request.gains), step)
            if differs and (reason := why_no_law(step, setup.measured, exact)):
                return TrackingGuarantee(fault=fault, proof=NoProof(reason=reason))
            summed = by_differences(summed, step) if differs else summed
            proof = best_guarantee(task, exact.with_law(summed, step))
            if proof.available:
                return with_worst_case(fault, proof)
            other = self.sampled(fault, task, law, step, replace(request, gains=()))
            if other.proof.available:
                return TrackingGuarantee(fault=fault, proof=proof, nearest=(GAINS, other.proof))
            return replace(other, proof=proof)
        entries: Any = {"measured": setup.measured, "setup": exact}
        designed = design_sampled_law(task, step, objective=request.objective, **entries)
        if designed.available:
            return with_worst_case(fault, designed)
        if setup.longest_step or designed.only_pressure_fails:
            nearest = nearest_setup(task, step, pressed=designed.only_pressure_fails, **entries)
            if nearest is not None or not designed.only_pressure_fails:
                return TrackingGuarantee(fault=fault, proof=designed, nearest=nearest)
        longest = longest_step(task, **entries)
        if (again := design_near_longer_step(task, step, longest, **entries)) is not None:
            return with_worst_case(fault, again)
        shorter, tried = (None, None) if longest is None else (design_at(task, longest), step)
        nearest = nearest_setup(task, step, **entries)
        return TrackingGuarantee(fault=fault, proof=designed, shorter=shorter, unproved_step=tried, nearest=nearest)


def _four(gains: tuple[str, ...]) -> tuple[Fraction, ...]:
    if len(gains) != 4:
        raise ParameterError(f"gains must be four numbers, k1 to k4. Received {len(gains)}. Omit gains to design them.")
    return tuple(rational(v, f"k{i}") for i, v in enumerate(gains, 1))


def may_stick(law: type[Controller], setup: LoopSetup, disturbance_class: str) -> bool:
    """Whether the stick–slip plant is tried by default for a law, setup and disturbance class."""
    covered = law is ExtendedLQR or method_of(law).takes_base_gains
    return covered and not setup.given().keys() - TAKEN and disturbance_class == CLASSES[0]


def sticking_options(problem: GainProblem[Any]) -> dict[str, Any]:
    """Options of `design_stick_slip` for a problem."""
    healing, setup = rational(problem.fault.friction.rest_excess), problem.setup
    noise = {"slip_noise": setup.slip_noise, "longest_step": setup.longest_step}
    return {"objective": problem.objective, **noise, "healing": healing, "progress": problem.progress}


def _sampled(problem: GainProblem[Designed], law: type[ExtendedLQR]) -> Designed:
    """Design on the stick–slip plant if proved there, else on the plant without stick."""
    fault = problem.fault
    step, task, setup = rational(fault.sampling_time), problem.task, problem.setup
    without: dict[str, Any] = {}
    if problem.plant != TrackingProof.plant and may_stick(law, setup, problem.disturbance_class):
        sticking = design_stick_slip(task, step, **sticking_options(problem))
        if sticking.available:
            details = {"objective": problem.objective, "step": str(step), "reason": None, "measured": setup.measured}
            details |= {name: str(value) for name, value in sticking.sampled_loop.noise.items()}
            return problem.judged(sticking.controller, name=law.name, details=details, runs=sticking)
        without = {"not_at_rest": sticking.reason}
    exact = ExactSetup.of(setup)
    most = rational(fault.effective_normal_stress)
    if beyond := infeasibility(task, most, exact.delay, setup.diffusion):
        return problem.undecided(law.name, beyond, NoProof(reason=beyond))
    designed = sampled_design(task, step, problem.objective, measured=setup.measured, setup=exact)
    if designed.runs is None:
        return problem.undecided(law.name, designed.reason)
    runs, sampled_loop = designed.runs, designed.runs.sampled_loop
    details = {
        "objective": problem.objective,
        "step": str(sampled_loop.step),
        "reason": designed.reason or None,
        "measured": setup.measured,
        **{name: str(value) for name, value in (*sampled_loop.noise.items(), *sampled_loop.path.items()) if value},
        **without,
    }
    return problem.judged(runs.controller, name=law.name, details=details, runs=runs, premises=designed.premises())


def _sliding(problem: GainProblem[Designed], given: SlowSlidingDesign, law: type[ExtendedLQR]) -> Designed:
    """Design of a law of the slip alone for slow sliding along the reference."""
    wrong = {
        "continuous": problem.continuous,
        f"objective {problem.objective!r}": problem.objective != OBJECTIVES[0],
        f"class {problem.disturbance_class!r}": problem.disturbance_class != CLASSES[0],
        "noise": bool(problem.setup.noise),
    }
    if any(wrong.values()):
        raise ParameterError(
            "a law for friction with a state is designed for the sampled loop without noise, with the objective "
            f"{OBJECTIVES[0]} and the disturbance class {CLASSES[0]}. Received "
            f"{', '.join(name for name, is_wrong in wrong.items() if is_wrong)}. Omit these options, "
            "or use guarantee, which takes slip noise."
        )
    fault = problem.fault
    path = given.diffusion or near_path(sliding_model(fault))
    result = guarantee_sliding(
        fault, stress=given.stress, spread=given.spread, progress=problem.progress, setup=ExactSetup(diffusion=path)
    )
    reason = result.proof.reason if not result.proof.available else None
    if result.sampled_loop is None:
        return problem.undecided(law.name, str(reason), sliding=result)
    near = quantity(float(path) ** 0.5, "m")
    assumed = None if given.diffusion else f"a well near the fault, L^2/D = {float(path):.3g} s ({near} at D = 1 m^2/s)"
    details = {"step": str(result.sampled_loop.step), "diffusion": str(path), "measured": MEASURED[1]}
    details |= {name: text for name, text in {"assumed": assumed, "reason": reason}.items() if text}
    return problem.judged(
        result.sampled_loop.controller, name=law.name, details=details, runs=result.proof, sliding=result
    )


def _continuous(problem: GainProblem[Designed], law: type[ExtendedLQR]) -> Designed:
    bounds = sectors(problem.fault)
    try:
        designed = riccati_design(problem.fault)
    except ParameterError as error:
        return problem.undecided(law.name, str(error))
    loop = sector_loop(designed.controller, bounds)
    certificate = _of_riccati(loop, designed) or quadratic_certificate(loop, theta=designed.theta)
    details = {
        "R": designed.R,
        "poles": [[float(z.real), float(z.imag)] for z in designed.E],
        "fastest_pole": designed.fastest_pole,
    }
    return _judged(problem, designed.controller, certificate, details)


def _of_riccati(loop: Loop, designed: RiccatiDesign) -> Certificate | None:
    """Certificate with the V of the Riccati equation."""
    margin = quadratic_margin(loop, designed.lyapunov)
    claims = claims_of(loop, designed.lyapunov, (margin, Fraction(0)))
    return certificate_of(loop, designed.lyapunov, claims) if min(claims.values()) > 0 else None


def quadratic_certificate(loop: Loop, *, theta: Matrix | None = None) -> Certificate | None:
    """Quadratic V for a linear loop, decided exactly: two searches with different scalings, then V = xᵀΘx.

    Parameters
    ----------
    loop : Loop
    theta : matrix (4 × 4) of Fraction, optional
        Candidate V = xᵀΘx in SI.
    """
    certificate = find_certificate(loop, 2) or robust_stability(loop)
    return certificate or (finished_exactly(loop, theta) if theta is not None else None)


def _judged(
    problem: GainProblem[Designed], controller: ExtendedLQR, certificate: Certificate | None, details: dict[str, Any]
) -> Designed:
    """Verdict on gains; without a certificate, refuted if a constant vertex of the box is unstable, else undecided."""
    details = {**details, "rate": str(certificate.claims["rate"]) if certificate else None}
    if certificate is not None:
        return problem.judged(controller, certificate, details=details)
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=sectors(problem.fault))
    verdict = Verdict.UNDECIDED if loop.unstable_vertex() is None else Verdict.REFUTED
    return problem.judged(controller, verdict=verdict, details={**details, "reason": why_undecided(loop)})
