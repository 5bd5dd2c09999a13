"""A controller for one fault with what is proved of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from html import escape
from typing import Any

from quakedesign.certificates import Certificate, Verdict
from quakedesign.certificates.guarantee import ContinuousPeaks, Guarantee, NoGuarantee, task_of
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.premises import Domain, Premise, Variant
from quakedesign.certificates.slow_sliding import SlidingGuarantee
from quakedesign.controllers import Controller, control_laws
from quakedesign.fault import Fault
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.synthesis.guaranteed import CLASSES, Compensation
from quakedesign.synthesis.guaranteed.default_design import REACH
from quakedesign.synthesis.guaranteed.sliding_answer import SlidingAnswer
from quakedesign.synthesis.linear.sampled.held import HeldLoop
from quakedesign.synthesis.methods.base import method_of


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Design:
    """A controller for one fault, what is proved of it, and under which premises.

    Attributes
    ----------
    fault : Fault
    name : str
        Name of the control law.
    verdict : Verdict
    controller : Controller or None
        None only when no gains with a proof were found.
    certificate : Certificate or None
        Proof in continuous time for the base gains (λ = 1), or the counterexample; None for a linear law of samples.
        The verdict on a law of samples is that on its `guarantee`.
    premises : tuple of Premise
        Of the guarantee of a law of samples (`reach`), and of the certificate.
    domain : Domain or None
        Certified domain of the self-consistent premise on |h'|.
    details : mapping
        What synthesis decided: exact numbers as texts.
    slip_noise, rate_noise : Fraction
        Bounds of what a law of samples is told wrongly of slip [m] and slip rate [m/s].
    path : mapping of str to Fraction
        Delay, lag and diffusion [s] behind which a law of samples is designed to act, where they are told.
    runs : Guarantee, SlidingGuarantee or NoGuarantee, optional
        What was proved of the loop that runs while it was designed; None to find it when `guarantee` is asked for.
    sliding : SlidingAnswer, optional
        For friction with a state: the law as it runs, with its rock, and the task that it is designed for.
    disturbance_class : str
        Of the disturbances that the guarantee is about: ``amplitude``, or ``rate`` for those of bounded rate.
    """

    fault: Fault
    name: str
    verdict: Verdict
    controller: Controller | None
    certificate: Certificate | None
    premises: tuple[Premise, ...]
    domain: Domain | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    slip_noise: Fraction = Fraction(0)
    rate_noise: Fraction = Fraction(0)
    path: Mapping[str, Any] = field(default_factory=dict)
    runs: Guarantee | SlidingGuarantee | NoGuarantee | None = None
    sliding: SlidingAnswer | None = None
    disturbance_class: str = CLASSES[0]

    @property
    def gains(self) -> dict[str, Fraction]:
        """Exact gains; for a sliding mode also ``scale`` λ, ``divisor`` μ0N̂0 [m²/kg] and a feed-forward that is on.

        A sliding mode of samples has the numbers of its scheme too, ``weight`` [-] and ``authority`` B0 [m²/kg].
        """
        return self.controller.numbers if self.controller else {}

    @property
    def title(self) -> str:
        """Name for people."""
        known = self.controller or control_laws().get(self.name)
        return known.title if known else self.name

    @property
    def measurement(self) -> Measurement | None:
        """What the controller is told in a run, with the noise that it is designed for; None without."""
        slip, rate = float(self.slip_noise), float(self.rate_noise)
        return Measurement(slip_noise=slip, rate_noise=rate, bounded=True) if slip or rate else None

    @property
    def conditions(self) -> tuple[Premise, ...]:
        """Premises of what is proved first: of the guarantee of a law of samples, of the certificate of another."""
        sampled = self.controller is not None and self.controller.sampling is not None
        return tuple(p for p in self.premises if p.name in REACH) if sampled else self.premises

    @property
    def other_step(self) -> str:
        """That a law of samples does not run at the fault's T_s, for which it is not proved; empty if it does."""
        return self.controller.other_step(self.fault) if self.controller else ""

    @property
    def other_step_first(self) -> str:
        """That nothing is guaranteed at the fault's own T_s, before what is for another; empty if its T_s runs."""
        if not self.other_step or self.controller is None:
            return ""
        own = f"not guaranteed at T_s = {self.fault.sampling_time:g} s"
        return f"{own}; designed for T_s = {self.controller.sampling_time:.4g} s"

    def with_premise(self, premise: Premise) -> "Design":
        """Return the design with one more premise, such as one read off a run."""
        return replace(self, premises=(*(p for p in self.premises if p.name != premise.name), premise))

    def feedforward_variants(self) -> tuple[Variant, ...]:
        """Premises and domain of the same gains with every named feed-forward, its own first; none for other laws.

        Takes a few seconds.
        """
        law = self.controller
        return method_of(type(law)).variants(self.fault, law, self.certificate) if law else ()

    def certified_peaks(self, disturbance_class: str = "amplitude") -> ContinuousPeaks | NoGuarantee:
        """How far an e-LQR lets slip, slip rate and pressure go at most if the pressure acts at once.

        What holds for the law as it runs is `guarantee`.

        Parameters
        ----------
        disturbance_class : str
            ``"amplitude"``: any disturbance as large as the fault's; ``"rate"``: and no faster.

        Raises
        ------
        ParameterError
            For the class ``rate`` and a disturbance that does not start at 0.
        """
        law = self.controller
        if law is None:
            return NoGuarantee(reason=f"no gains of {self.title} are known", small_gain=None)
        return method_of(type(law)).certified_peaks(self.fault, law, disturbance_class)

    @property
    def guarantee(self) -> Guarantee | SlidingGuarantee | NoGuarantee:
        """What is proved of the law as it runs, once per T_s, p held; or why nothing.

        A law of samples has its own T_s, a sliding mode of samples runs in the scheme ``compensated``; the integrals of
        an e-LQR in continuous time are summed over the T_s of the fault. Computed when asked for unless it is known.
        """
        law = self.controller
        if self.runs is not None:
            return self.runs
        if law is None:
            return NoGuarantee(reason=f"no gains of {self.title} are known", small_gain=None)
        noise = Around(slip_noise=self.slip_noise, rate_noise=self.rate_noise)
        task = task_of(self.fault, rate_limited=self.disturbance_class == "rate")
        return method_of(type(law)).guarantee(self.fault, task, law, noise)

    @property
    def compensation(self) -> Compensation | None:
        """A sliding mode of samples with its guarantee; None for another law."""
        law, found = self.controller, self.guarantee
        if law is None or law.sampling is None or isinstance(found, SlidingGuarantee):
            return None
        return method_of(type(law)).compensation(law, found)

    def held_loop(self) -> HeldLoop | None:
        """What is decided of an e-LQR when p is held over the fault's sampling time; None for another law."""
        law = self.controller
        return method_of(type(law)).held_loop(self.fault, law) if law else None

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
