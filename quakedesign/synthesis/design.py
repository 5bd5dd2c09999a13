"""Design of a controller for one fault, with its proof and the premises of the proof.

`design` finds gains with a proof; `assess` gives the verdict on given gains.
"""

from collections.abc import Mapping
from dataclasses import field, replace
from fractions import Fraction
from html import escape
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError, require_known
from quakedesign.fault import Fault, require_fault, with_accepted_fit
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.units import exact_value
from quakedesign.guarantees import (
    CLASSES,
    OBJECTIVES,
    Compensation,
    ContinuousProof,
    FaultProof,
    NoProof,
    StickSlipProof,
    TrackingProof,
)
from quakedesign.guarantees.search.default_designs import PREMISES_OF_TIMES
from quakedesign.guarantees.sliding_result import SlidingGuarantee
from quakedesign.laws import Controller, control_law, control_laws
from quakedesign.laws.feed_forward import NONE, feed_forward
from quakedesign.linear.sampled_stability import SampledStability
from quakedesign.loop.loop_setup import IDEAL, LoopSetup, Quantity
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.lyapunov import Certificate, Verdict
from quakedesign.lyapunov.exact.domain import Domain
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.lyapunov.exact.premises import Premise, Variant
from quakedesign.plant import uncertain_plant
from quakedesign.synthesis.method import GainProblem, SlowSlidingDesign, method_of
from quakedesign.text import Progress

# ----------------------------------------------------------------------
# A controller for one fault with its proof.


@checked_dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Design:
    """A controller for one fault, its proof, and the premises of the proof.

    Attributes
    ----------
    fault : Fault
    name : str
        Name of the control law.
    verdict : Verdict
    controller : Controller or None
        None only when no gains with a proof were found.
    certificate : Certificate or None
        Proof in continuous time for the base gains (λ = 1); None without a proof, and for a sampled linear law. The
        verdict on a sampled law is that on its `guarantee`.
    premises : tuple of Premise
        Premises of the guarantee of a sampled law (those named in `PREMISES_OF_TIMES`), and of the certificate.
    domain : Domain or None
        Certified set of initial errors for which the premise on |h'| holds along every trajectory.
    details : mapping
        Results of the synthesis; exact numbers as strings.
    setup : LoopSetup
        Loop setup for which a sampled law is designed.
    runs : FaultProof or NoProof, optional
        Proof of the sampled loop from the design; None if `guarantee` computes the proof on access.
    sliding : SlidingGuarantee, optional
        For friction with a state: the sampled law with its diffusion path, and the plant of the design.
    disturbance_class : str
        Class of the disturbances: ``amplitude``, or ``rate`` for those of bounded rate.
    """

    fault: Fault
    name: str
    verdict: Verdict
    controller: Controller | None
    certificate: Certificate | None
    premises: tuple[Premise, ...]
    domain: Domain | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    setup: LoopSetup = IDEAL
    runs: FaultProof | NoProof | None = None
    sliding: SlidingGuarantee | None = None
    disturbance_class: str = CLASSES[0]

    @property
    def gains(self) -> dict[str, Fraction]:
        """Exact gains; of a sliding mode also ``scale`` λ and ``divisor`` μ0N̂0 [m²/kg].

        Feed-forward coefficients follow. A sampled sliding mode also has the settings of its scheme, such as ``weight``
        [-] and ``authority`` B0 [m²/kg].
        """
        return self.controller.numbers if self.controller else {}

    @property
    def title(self) -> str:
        """Name for display."""
        law = self.controller or control_laws().get(self.name)
        return law.title if law else self.name

    @property
    def measurement(self) -> Measurement | None:
        """Sensor with the noise of the design, for a simulation; None without noise."""
        slip, rate = float(self.setup.slip_noise), float(self.setup.rate_noise)
        return Measurement(slip_noise=slip, rate_noise=rate, bounded=True) if slip or rate else None

    @property
    def conditions(self) -> tuple[Premise, ...]:
        """Premises of the main proof: of the guarantee if sampled, else of the certificate."""
        sampled = self.controller is not None and self.controller.sampling is not None
        return tuple(p for p in self.premises if p.name in PREMISES_OF_TIMES) if sampled else self.premises

    @property
    def other_step(self) -> str:
        """Note that T_s of a sampled law differs from that of the fault; empty if both are equal."""
        return self.controller.other_step(self.fault) if self.controller else ""

    @property
    def other_step_first(self) -> str:
        """Note that the fault's own T_s has no guarantee; empty if the design uses that T_s."""
        if not self.other_step or self.controller is None:
            return ""
        own = f"not guaranteed at T_s = {self.fault.sampling_time:g} s"
        return f"{own}; designed for T_s = {self.controller.sampling_time:.4g} s"

    def with_premise(self, premise: Premise) -> "Design":
        """Return the design with one more premise, such as one evaluated on a simulated run."""
        return replace(self, premises=(*(p for p in self.premises if p.name != premise.name), premise))

    def feedforward_variants(self) -> tuple[Variant, ...]:
        """Premises and domain of the same gains with every named feed-forward, the design's first; takes seconds."""
        law = self.controller
        return method_of(type(law)).variants(self.fault, law, self.certificate) if law else ()

    def certified_peaks(self, disturbance_class: str = "amplitude") -> ContinuousProof | NoProof:
        """Certified peaks of slip, slip rate and pressure of an e-LQR in continuous time.

        The bounds of the sampled law are in `guarantee`.

        Parameters
        ----------
        disturbance_class : str
            ``"amplitude"``: any disturbance bounded by the fault's amplitude; ``"rate"``: its rate is bounded too.

        Raises
        ------
        ParameterError
            For the class ``rate`` and a disturbance that does not start at 0.
        """
        law = self.controller
        if law is None:
            return NoProof(reason=f"no gains of {self.title} are available")
        return method_of(type(law)).certified_peaks(self.fault, law, disturbance_class)

    @property
    def guarantee(self) -> FaultProof | NoProof:
        """Guarantee of the sampled law with zero-order hold, or the reason why there is none.

        A sampled law has its own T_s, a sampled sliding mode its own scheme; the integrals of an e-LQR in continuous
        time become sums over the T_s of the fault. The proof is computed on access unless `runs` contains one.
        """
        law = self.controller
        if self.runs is not None:
            return self.runs
        if law is None:
            return NoProof(reason=f"no gains of {self.title} are available")
        task = uncertain_plant(self.fault, rate_limited=self.disturbance_class == "rate")
        return method_of(type(law)).guarantee(self.fault, task, law, self.setup)

    @property
    def compensation(self) -> Compensation | None:
        """A sampled sliding mode with its guarantee; None for another law."""
        law, proof = self.controller, self.guarantee
        if law is None or law.sampling is None or self.sliding is not None:
            return None
        return method_of(type(law)).compensation(law, proof)

    def sampled_stability(self) -> SampledStability | None:
        """Stability of an e-LQR with zero-order hold over the fault's T_s; None for another law."""
        law = self.controller
        return method_of(type(law)).sampled_stability(self.fault, law) if law else None

    def __repr__(self) -> str:
        gains = ", ".join(f"{name} = {value}" for name, value in self.gains.items()) or "none"
        verdict = ": ".join(filter(None, (self.other_step_first, str(self.verdict))))
        return f"Design of {self.title} for {self.fault.name}: {verdict}; gains {gains}"

    def _repr_html_(self) -> str:
        gains = ", ".join(f"{name} = {float(v):.6g}" for name, v in self.gains.items())
        rows = "".join(
            f"<tr><td>{escape(p.name)}</td><td>{p.sides[0]}</td><td>{p.sides[1]}</td>"
            f"<td>{'yes' if p.holds else 'no'}</td></tr>"
            for p in self.premises
        )
        head = "<tr><th>premise</th><th>required</th><th>certified</th><th>holds</th></tr>"
        verdict = ": ".join(filter(None, (self.other_step_first, str(self.verdict))))
        return f"<b>{self.title}: {escape(verdict)}</b><br>{escape(gains)}<table>{head}{rows}</table>"


# ----------------------------------------------------------------------
# From a fault to gains with a proof, and from given gains to a verdict.


def design(
    fault: Fault,
    controller: str | type[Controller] = "cta",
    setup: LoopSetup = IDEAL,
    *,
    feedforward: str = "none",
    objective: str = "tracking",
    continuous: bool = False,
    plant: str | None = None,
    stress: Quantity | None = None,
    spread: Quantity = 0,
    disturbance_class: str = CLASSES[0],
    progress: Progress | None = None,
    accept_poor_fit: bool = False,
    **entered: Quantity | None,
) -> Design:
    """Find gains with a proof for a fault.

    The guarantee is for the sampled law with zero-order hold over the fault's T_s. Where that T_s has no guarantee, the
    longest T_s that has one is used; see `Design.guarantee`.

    2-CTA, 2-DIA: base gains (families.toml) are proved in continuous time for the fault's range of β. The scale λ = ρ⁶
    (ρ rational, so that every scaled gain is rational) and the settings of the scheme are chosen for guaranteed bounds.
    The scheme is ``stick-slip``, or ``compensated`` on the plant without stick. e-LQR: feedback with a disturbance
    estimate.

    With `continuous`: the paper's designs, without a sampled guarantee. 2-CTA, 2-DIA: λ grows until the proved bound on
    |h'| is 1.1 times the bound that reference and disturbance require. This is also the design if no T_s has a proof.
    e-LQR: Riccati equation with the corrected bound on the uncertainty (errata, rows 7 and 10), then an exact proof
    about any constant reference.

    Rate-and-state friction: an e-LQR of the slip alone controls slow sliding along the reference, through the diffusion
    path (`Design.sliding`); sliding modes do not apply.

    Parameters
    ----------
    fault : Fault
    controller : str or type of Controller
        ``"cta"``, ``"dia"`` or ``"elqr"``; or a user-defined law, also as ``"module:Class"``, with its own design
        method or derived from one of these.
    setup : LoopSetup
        T_s in place of the fault's; delay, lag, diffusion path and measured signals of an e-LQR; bounds of measurement
        errors. Rate-and-state friction: by default a diffusion path with L²/D = 0.1 D_c/V [s], V the sliding rate.
    feedforward : str
        Feed-forward of a sliding mode from a plant model: ``"none"``, ``"nominal"`` or ``"centred"``, see
        `quakedesign.laws.feed_forward`. It enlarges the certified domain in continuous time and has no sampled
        guarantee, so it needs `continuous`; the e-LQR takes no feed-forward.
    objective : str
        ``"tracking"`` for small errors under slow disturbances, ``"peak"`` for the smallest guaranteed slip-rate error.
    continuous : bool
        The paper's design in continuous time.
    plant : str, optional
        ``printed`` for a guarantee on the plant without stick; by default the guarantee is on the stick–slip plant if
        it can be proved there.
    stress : str, float or Fraction, optional
        For rate-and-state friction: bound of the shear stress disturbance [Pa]; by default the largest that the design
        withstands.
    spread : str, float or Fraction
        For rate-and-state friction: relative uncertainty of a, b and D_c [-].
    disturbance_class : str
        For the guarantee: ``"amplitude"``, any disturbance bounded by the fault's amplitude, or ``"rate"``, whose rate
        is bounded too and which starts at 0, such as a tide.
    progress : callable, optional
        Called with the current task of a search (rate-and-state friction, stick–slip plant) and the completed fraction.
    accept_poor_fit : bool
        Whether to continue for a fault whose friction is not supported by its record (`Fault.poor_fit`); its name then
        ends with ``poor-fit``.
    **entered : str, float or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Returns
    -------
    Design
        Without a proof: verdict ``UNDECIDED``, or ``REFUTED`` for an unstable vertex, and ``reason`` in its details.

    Raises
    ------
    UnknownNameError
        For an unknown controller or feed-forward.
    ParameterError
        For a feed-forward with a law that takes none or is sampled; an unknown objective, class or plant, or ``"peak"``
        in continuous time; quantities of the setup that a design does not take; stress or spread for friction without a
        state; a delay or a lag for friction with a state; a poor fit that is not accepted.
    UnsupportedError
        For a law that does not apply to friction with a state or has no design method, or a sliding mode with a path.
    """
    require_fault(fault)
    fault = with_accepted_fit(fault, accept_poor_fit)
    law, setup = control_law(controller), setup.with_given(**entered)
    if unknown := setup.given().keys() - _DESIGNED_FOR:
        raise ParameterError(
            f"a design takes {', '.join(_DESIGNED_FOR)} of the loop setup. Received {', '.join(sorted(unknown))}. "
            "Use guarantee, which designs for all of them."
        )
    fault, setup = setup.at_step(fault)
    requested = SlowSlidingDesign(
        diffusion=setup.diffusion or None,
        stress=None if stress is None else exact_value(stress, "Pa", "stress"),
        spread=exact_value(spread, "", "spread"),
    )
    setup, sliding = _request(fault, law, setup, requested, entered.get("diffusion") is not None)
    added = NONE if feedforward == NONE.name else feed_forward(feedforward, fault, least_authority(fault))
    require_known(objective, OBJECTIVES, "objective")
    require_known(disturbance_class, CLASSES, "class")
    if plant is not None:
        require_known(plant, (StickSlipProof.plant, TrackingProof.plant), "plant")
    if continuous and objective != OBJECTIVES[0]:
        raise ParameterError(
            f"the objective of a design in continuous time must be {OBJECTIVES[0]}. Received {objective!r}. "
            "Omit objective, or continuous."
        )
    entries: Any = {"objective": objective, "continuous": continuous, "disturbance_class": disturbance_class}
    entries |= {"plant": plant, "setup": setup}
    entries |= {"progress": progress} if progress else {}
    return law.design(GainProblem(fault=fault, result_type=Design, feedforward=added, sliding=sliding, **entries))


_DESIGNED_FOR = ("step", "measured", "delay", "lag", "diffusion", "slip_noise", "rate_noise")


def _tracking(
    fault: Fault, law: type[Controller], setup: LoopSetup, requested: SlowSlidingDesign, path: bool
) -> tuple[LoopSetup, SlowSlidingDesign | None]:
    if requested.stress is not None or requested.spread:
        raise ParameterError(
            f"stress and spread of a design need friction with a state. Received {fault.friction.name}. "
            "Omit stress and spread."
        )
    return setup, None


def _sliding(
    fault: Fault, law: type[Controller], setup: LoopSetup, requested: SlowSlidingDesign, path: bool
) -> tuple[LoopSetup, SlowSlidingDesign | None]:
    """Setup without the diffusion path, and the request, which contains it; rejects a law that does not apply."""
    if path and not setup.diffusion:
        raise ParameterError("a diffusion must be above 0 s. Received 0 s. Omit diffusion for a well near the fault.")
    if setup.delay or setup.lag:
        received = f"delay {float(setup.delay):g} s and lag {float(setup.lag):g} s with {fault.friction.name}"
        raise ParameterError(
            "a design for friction with a state has no delay or lag, only a diffusion path. "
            f"Received {received}. Omit delay and lag, or use guarantee, which takes both."
        )
    if why := method_of(law).without_state:
        raise UnsupportedError(f"{why}. Received {law.name}. Design an elqr.")
    return replace(setup, diffusion=Fraction(0)), requested


_request = by_equilibrium(rest=_tracking, sliding=_sliding)


def assess(fault: Fault, controller: Controller, setup: LoopSetup = IDEAL, **entered: Quantity | None) -> Design:
    """Verdict, certificate and premises of given gains on a fault.

    Sliding modes are tried at 99, 90 and 50 % of the bound on |h'| that no V can exceed; the e-LQR over the fault's
    sectors. A law without a form of certificate is ``UNDECIDED``. The verdict on a sampled law is that on its
    guarantee.

    Parameters
    ----------
    fault : Fault
    controller : Controller
    setup : LoopSetup
        Loop setup of a sampled linear law; not used for a sampled sliding mode, rejected for a law in continuous time.
    **entered : str, float or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Raises
    ------
    ParameterError
        For friction with a state, or a loop setup with a law in continuous time.
    """
    setup = setup.with_given(**entered)
    fault.require_memoryless("a verdict on gains")
    if setup != IDEAL and controller.sampling is None:
        raise ParameterError("a loop setup needs a sampled law. Received a law in continuous time. Omit setup.")
    return GainProblem(fault=fault, result_type=Design, setup=setup).assessed(controller)
