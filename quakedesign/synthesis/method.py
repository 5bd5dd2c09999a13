"""Design methods by family of control laws: problem, interface and sampled linear laws.

The base method also assesses a law that belongs to no family.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, Generic, TypeVar

import sympy as sp

from quakedesign.discovery import discovered
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import apart, to_sympy
from quakedesign.fault import Fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.guarantees import (
    CLASSES,
    OBJECTIVES,
    Compensation,
    ContinuousProof,
    FaultProof,
    NoProof,
    TrackingGuarantee,
    TrackingProof,
    best_guarantee,
)
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.float_bounds import spectral_radius
from quakedesign.guarantees.tracking_result import FACTOR, given_law_with_worst_case
from quakedesign.laws import Controller, LinearLaw, SampledController, Signals, SlidingMode, control_laws
from quakedesign.laws.feed_forward import NONE, FeedForward
from quakedesign.laws.sampled_law import steady_states
from quakedesign.linear.robust_stability import sector_loop
from quakedesign.linear.sampled_stability import SampledStability
from quakedesign.loop.loop_setup import IDEAL, MEASURED, LoopSetup
from quakedesign.lyapunov import Certificate, Verdict, cached_verdict
from quakedesign.lyapunov.exact.domain import Domain
from quakedesign.lyapunov.exact.perturbation_bounds import sectors
from quakedesign.lyapunov.exact.premises import Premise, Variant, linear_premises
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.plant import FaultPlant, uncertain_plant
from quakedesign.text import Progress, silent

# ----------------------------------------------------------------------
# Interface of the families of laws, and its implementation for a law of no family.

Designed = TypeVar("Designed")
MEMORYLESS = "user-defined laws are designed for friction of slip and slip rate alone"
L = TypeVar("L", bound=Controller)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowSlidingDesign:
    """Design problem of slow sliding; see `quakedesign.synthesis.design`.

    Attributes
    ----------
    diffusion : Fraction or None
        L²/D [s]; None for a well near the fault.
    stress : Fraction or None
        Bound of the shear stress disturbance [Pa]; None for nearly the largest with a guarantee.
    spread : Fraction
        Relative uncertainty of a, b and D_c [-].
    """

    diffusion: Fraction | None = None
    stress: Fraction | None = None
    spread: Fraction = Fraction(0)


@dataclass(frozen=True, kw_only=True)
class GainProblem(Generic[Designed]):
    """Design problem of gains for a fault; see `quakedesign.synthesis.design`.

    Attributes
    ----------
    fault : Fault
    result_type : callable
        Builds the `Design` from the results.
    objective : str
    continuous : bool
    feedforward : FeedForward
    setup : LoopSetup
    sliding : SlowSlidingDesign or None
        For friction with a state.
    disturbance_class : str
        Class of the disturbances of a guarantee, ``amplitude`` or ``rate``.
    plant : str or None
        ``printed`` for a guarantee on the plant without stick only.
    progress : callable
        Called with the present task of a long search, and the completed fraction [-].
    """

    fault: Fault
    result_type: Callable[..., Designed]
    objective: str = OBJECTIVES[0]
    continuous: bool = False
    feedforward: FeedForward = NONE
    setup: LoopSetup = IDEAL
    sliding: SlowSlidingDesign | None = None
    disturbance_class: str = CLASSES[0]
    plant: str | None = None
    progress: Progress = silent

    @property
    def task(self) -> FaultPlant:
        """Uncertain plant of the fault for a guarantee."""
        return uncertain_plant(self.fault, rate_limited=self.disturbance_class == "rate")

    def require_exact_in_continuous_time(self) -> None:
        """Reject a design in continuous time without exact slip and slip rate."""
        if self.continuous and self.setup != IDEAL:
            raise ParameterError(
                "a design in continuous time needs exact measurements of slip and slip rate, and no delay, lag or "
                f"diffusion path. Received {', '.join(self.setup.given())}. Omit continuous, or these."
            )

    def by_method(self, law: type[Controller]) -> Designed:
        """Gains by the method of the family that a law belongs to."""
        return method_of(law).design(self, law)

    def assessed(self, controller: Controller) -> Designed:
        """Verdict on gains, by the method of the family of their law."""
        return method_of(type(controller)).assess(self, controller)

    def judged(
        self,
        controller: Controller,
        certificate: Certificate | None = None,
        *,
        runs: FaultProof | NoProof | None = None,
        premises: tuple[Premise, ...] = (),
        **more: Any,
    ) -> Designed:
        """Result for given gains, with certificate and premises; premises of the sampled loop come first.

        By default the verdict is that on the certificate, or for a sampled law that on the sampled loop.
        """
        own, domain = method_of(type(controller)).premises(self.fault, controller, certificate)
        verdict = cached_verdict(certificate, type(controller)) if certificate is not None else Verdict.UNDECIDED
        if runs is not None and controller.sampling is not None:
            verdict = runs.check()
        entries = {
            "name": controller.name,
            "verdict": verdict,
            "domain": domain,
            "runs": runs,
            "setup": self.setup,
            **more,
        }
        entries["disturbance_class"] = self.disturbance_class
        entries["premises"] = (*premises, *own, *controller.premises(self.fault, certificate))
        return self.result_type(fault=self.fault, controller=controller, certificate=certificate, **entries)

    def undecided(self, name: str, reason: str, runs: NoProof | None = None, **more: Any) -> Designed:
        """Result without gains."""
        none: dict[str, Any] = {"controller": None, "certificate": None, "premises": (), "details": {"reason": reason}}
        none |= {"disturbance_class": self.disturbance_class, "setup": self.setup}
        return self.result_type(fault=self.fault, name=name, verdict=Verdict.UNDECIDED, runs=runs, **none, **more)


@dataclass(frozen=True, kw_only=True)
class GuaranteeRequest:
    """Problem of a guarantee for a sampled loop."""

    gains: tuple[str, ...] = ()
    objective: str = OBJECTIVES[0]
    scheme: str | None = None
    setup: LoopSetup = IDEAL

    def require_all_measured(self) -> None:
        """Reject other measured signals than slip and slip rate, for a law that needs both."""
        if self.setup.measured != MEASURED[0]:
            raise ParameterError(
                "measured is for the e-LQR (slip only for a design without gains); other laws need slip and slip rate. "
                f"Received {self.setup.measured!r}. Omit measured, or omit gains and controller."
            )


def linear_about_a_reference(controller: Controller) -> bool:
    """Whether the closed loop is x2' = s·x1 − w·x2 + β·b·p with the law's own p and ξ'."""
    try:
        model = controller.loop_field()
    except UnsupportedError:
        return False
    names = {str(symbol): symbol for symbol in (*model.uncertain, *model.constants)}
    if set(names) != {"beta", "s", "w", "b"} or model.domain != "reals" or len(model.states) < 2:
        return False
    slip, rate, *own = model.states
    signals = Signals(slip=slip, slip_rate=rate, slip_error=slip, slip_rate_error=rate, integrals=tuple(own))
    pushed = names["s"] * slip - names["w"] * rate + names["beta"] * names["b"] * controller.pressure(signals)
    rates = (rate, pushed, *controller.integral_rates(signals))
    gains = {gain: to_sympy(controller.gains[str(gain)]) for gain in model.gains}
    stated = [model.field[state].subs(gains) for state in model.states]
    return len(rates) == len(stated) and all(sp.expand(a - b) == 0 for a, b in zip(rates, stated, strict=True))


class DesignMethod(Generic[L]):
    """Design method of a family of laws; this one is for laws of no family.

    Attributes
    ----------
    name : str
    family : type of Controller
        Base class of the laws of the family.
    designs : bool
        Whether the method computes gains for a fault.
    without_state : str
        Reason why the method designs no gains for friction with a state; empty if it does.
    takes_base_gains : bool
        Whether the method scales base gains, as for a sliding mode.
    """

    name: ClassVar[str] = "any"
    family: ClassVar[type] = Controller
    designs: ClassVar[bool] = False
    without_state: ClassVar[str] = MEMORYLESS
    takes_base_gains: ClassVar[bool] = False

    def design(self, problem: GainProblem[Designed], law: type[L]) -> Designed:
        """Find gains with a proof.

        Raises
        ------
        UnsupportedError
            For a law without a design method.
        """
        raise UnsupportedError(f"{law.title} has no design method. Give its class a classmethod design(problem).")

    def assess(self, problem: GainProblem[Designed], controller: L) -> Designed:
        """Verdict on given gains by a quadratic V, for a linear law about any constant reference."""
        if not linear_about_a_reference(controller):
            return problem.judged(controller, details={"reason": f"{controller.title} has no form of certificate"})
        loop = sector_loop(controller, sectors(problem.fault))
        return problem.judged(controller, find_certificate(loop, 2, subject=type(controller)))

    def premises(
        self, fault: Fault, controller: L, certificate: Certificate | None
    ) -> tuple[tuple[Premise, ...], Domain | None]:
        """Premises and certified domain of the certificate."""
        linear = linear_about_a_reference(controller)
        return tuple(linear_premises(fault, controller, certificate)) if linear else (), None

    def guarantee(self, fault: Fault, task: FaultPlant, controller: L, setup: LoopSetup) -> FaultProof | NoProof:
        """Guarantee of the sampled law on a plant of the fault, with the noise of a loop setup."""
        return NoProof(reason=f"no analysis of {controller.title} with zero-order hold is available")

    def certified_peaks(self, fault: Fault, controller: L, disturbance_class: str) -> ContinuousProof | NoProof:
        """Certified peaks of slip, slip rate and pressure in continuous time."""
        return NoProof(reason=f"there are no certified peaks in continuous time for {controller.title}")

    def compensation(self, controller: L, proof: FaultProof | NoProof) -> Compensation | None:
        """Sampled sliding mode with its guarantee; None for other laws."""
        return None

    def base_law(self, task: FaultPlant, law: type[L], gains: tuple[str, ...]) -> SlidingMode | None:
        """Sliding mode with base gains, by default the first stored ones; None for other laws."""
        return None

    def sampled_stability(self, fault: Fault, controller: L) -> SampledStability | None:
        """Stability with zero-order hold over the fault's T_s; None if undefined."""
        return None

    def variants(self, fault: Fault, controller: L, certificate: Certificate | None) -> tuple[Variant, ...]:
        """Premises and domain of the same gains with every named feed-forward; may be empty."""
        return ()

    def sampled(
        self, fault: Fault, task: FaultPlant, law: type[L], step: Fraction, request: GuaranteeRequest
    ) -> TrackingGuarantee:
        """Guarantee of given gains, or of a design, with T_s [s]."""
        reason = f"no analysis of {law.title} with zero-order hold is available"
        return TrackingGuarantee(fault=fault, proof=NoProof(reason=reason))

    def given(self, fault: Fault, task: FaultPlant, controller: L, setup: LoopSetup) -> TrackingGuarantee:
        """Guarantee of a given controller in a loop setup.

        Raises
        ------
        UnsupportedError
            For a controller that is not a sampled linear law.
        """
        raise UnsupportedError(
            "a given controller must be a sampled linear law; other laws are given by name and gains. Received "
            f"{controller!r:.80}. Give its name and gains, or a SampledLaw."
        )


@cache
def methods() -> dict[str, DesignMethod[Any]]:
    """Every method by name."""
    return {name: method() for name, method in discovered("quakedesign.synthesis", DesignMethod).items()}


def method_of(law: type[Controller]) -> DesignMethod[Any]:
    """Design method of a law: that of the nearest class from which the law derives."""
    by_family = {method.family: method for method in methods().values()}
    return next(by_family[base] for base in law.__mro__ if base in by_family)


def designable(fault: Fault | None = None) -> tuple[str, ...]:
    """Names of the package's laws with a design method for a fault, or for any fault if none is given."""
    left = left_out(fault) if fault is not None else {}
    return tuple(name for name, law in control_laws().items() if method_of(law).designs and name not in left)


def left_out(fault: Fault) -> dict[str, str]:
    """Reasons why laws with a design method for other faults have none for this fault, by name."""
    able = {name: method_of(law) for name, law in control_laws().items()}
    return {name: why for name, method in able.items() if method.designs and (why := _why_none(fault, method))}


_why_none = by_equilibrium(rest=lambda fault, method: "", sliding=lambda fault, method: method.without_state)


# ----------------------------------------------------------------------
# Sampled linear laws.


class Samples(DesignMethod[SampledController]):
    """Design method of sampled laws, which have a guarantee only in the sampled loop."""

    name: ClassVar[str] = "samples"
    family: ClassVar[type] = SampledController

    def assess(self, problem: GainProblem[Designed], controller: SampledController) -> Designed:
        """Verdict of the guarantee."""
        proof = self.guarantee(problem.fault, problem.task, controller, problem.setup)
        return problem.judged(controller.behind(**problem.setup.path), runs=proof)

    def premises(
        self, fault: Fault, controller: SampledController, certificate: Certificate | None
    ) -> tuple[tuple[Premise, ...], Domain | None]:
        """None: the premises are part of the guarantee."""
        return (), None

    def guarantee(
        self, fault: Fault, task: FaultPlant, controller: SampledController, setup: LoopSetup
    ) -> TrackingProof | NoProof:
        """Guarantee at the law's T_s; delay, lag and diffusion are those of the law unless the setup gives them.

        Raises
        ------
        ParameterError
            For another step than that of the law, or other measured signals than its inputs.
        """
        law, step = controller.law, controller.step
        if setup.step is not None and setup.step != step:
            own, requested = apart(step, setup.step)
            raise ParameterError(
                f"step of the loop setup must be that of the law, {own} s. Received {requested} s. Omit step, or give "
                "a law for that step."
            )
        if setup.measured == MEASURED[2] or (setup.measured == MEASURED[1] and not law.of_slip_alone):
            raise ParameterError(
                "a law is given with the signals that it measures: measured must be slip-and-rate, or slip for a law "
                f"of the slip alone. Received {setup.measured!r}. Omit measured."
            )
        exact = ExactSetup.of(setup)
        path = {name: time for name, time in controller.sampling.path.items() if not getattr(exact, name)}
        still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
        try:
            steady_states(still, law.output, (Fraction(0),) * len(law.states), Fraction(1))
        except ParameterError:
            return NoProof(reason=_STANDING)
        sampled_loop = replace(exact, **path).with_law(law, step)
        proof = best_guarantee(task, sampled_loop)
        if proof.available or proof.small_gain is not None or sampled_loop.longest_step:
            return proof
        largest, opposite = (spectral_radius(replace(sampled_loop, law=_times(f, law)).loop(task)) for f in (1, -1))
        if largest < _STABLE:
            return proof
        text = "the nominal closed loop is not asymptotically stable: its largest eigenvalue over a period has modulus "
        text += f"{largest:.4g}"
        if not any(row[0] for row in (*law.measured, law.feedback)):
            text += (
                "; the law does not use the slip, so that any constant slip error remains (eigenvalue 1): add "
                "slip_error or slip to its inputs"
            )
        return replace(proof, reason=text + _OPPOSITE * (opposite < _STABLE))

    def given(
        self, fault: Fault, task: FaultPlant, controller: SampledController, setup: LoopSetup
    ) -> TrackingGuarantee:
        """Guarantee; for a law that uses the errors alone also the worst case found."""
        proof = self.guarantee(fault, task, controller, setup)
        result = given_law_with_worst_case(fault, proof, controller.notes)
        if proof.available or proof.only_pressure_fails or proof.reason == _STANDING or setup.longest_step:
            return result
        for factor in _FACTORS:
            other = self.guarantee(fault, task, replace(controller, law=_times(factor, controller.law)), setup)
            if other.available:
                return replace(result, nearest=(FACTOR, other), factor=factor)
        for share in _DELAYS if setup.delay else ():
            other = self.guarantee(fault, task, controller, setup.with_given(delay=share * setup.delay))
            if other.available:
                return replace(result, nearest=("delay", other))
        return result


def _times(factor: Fraction | int, law: LinearLaw) -> LinearLaw:
    """Law with its pressure multiplied by a factor."""
    output, feedback = (tuple(factor * v for v in row) for row in (law.output, law.feedback))
    *states, pressure = law.of_reference or ((),)
    of_reference = (*states, tuple(factor * v for v in pressure)) if law.of_reference else ()
    return replace(law, output=output, feedback=feedback, of_reference=of_reference)


_STABLE = 1 - 1e-6  # an eigenvalue of 1 may be computed below 1
_OPPOSITE = "; with the opposite sign of the pressure it is stable"
_FACTORS = tuple(map(Fraction, ("1/2", "2", "1/4", "4", "-1", "1/16", "16")))  # tried if a law has no guarantee
_DELAYS = Fraction(3, 4), Fraction(1, 2), Fraction(1, 4)
"""Shares of a delay for which a given law is tried where it has no guarantee."""
_STANDING = (
    "the law cannot supply a constant pressure at zero error, as it has no integral action: give it an integral of "
    "the slip error or an estimate of the disturbance"
)
