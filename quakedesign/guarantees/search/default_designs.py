"""Default designs for a fault, at its own T_s or at the longest T_s with a proof.

The second chapter states which schemes of a sliding mode have a guarantee (``compensated`` and ``stick-slip``) and why.
"""

from dataclasses import replace
from fractions import Fraction
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import UnsupportedError, require_known
from quakedesign.exact import UpperBound
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.guarantees.exact.tracking_proof import TrackingProof
from quakedesign.guarantees.search.compensated_search import (
    GUARANTEED,
    STICK_SLIP,
    Compensation,
    Deadbeat,
    compensated,
    design_compensated,
    sticking_loop,
)
from quakedesign.guarantees.search.linear_design import (
    design_at,
    design_near_longer_step,
    design_sampled_law,
    longest_delay,
    longest_step,
    with_varying_gain,
)
from quakedesign.guarantees.search.stick_slip_design import proved
from quakedesign.laws import SlidingMode
from quakedesign.loop import schemes
from quakedesign.loop.loop_setup import MEASURED
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.plant.fault_plant import FaultPlant

# ----------------------------------------------------------------------
# The default designs of a fault: for its own T_s, else for the longest T_s that has a guarantee.

PREMISES_OF_TIMES = frozenset({"sampling_time", "delay"})
"""Premises of a guarantee, see `SampledDesign.premises`."""


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SampledDesign:
    """A sampled law for a fault, and the longest T_s and delay of similar laws with a guarantee.

    Attributes
    ----------
    step : Fraction
        T_s of the fault [s].
    runs : TrackingProof or None
        Proof at the fault's T_s or a shorter one; None where none was found.
    reason : str
        Why there is no guarantee at the fault's T_s; empty if there is.
    longest_step : Fraction
        Longest T_s found for which a design has a guarantee [s].
    longest_delay : Fraction
        Longest delay found at the T_s of the proof [s].
    """

    step: Fraction
    runs: TrackingProof | None
    reason: str
    longest_step: Fraction = Fraction(0)
    longest_delay: Fraction = Fraction(0)

    def premises(self) -> tuple[Premise, ...]:
        """Hardware requirements of the guarantee, and the longest T_s and delay of other designs."""
        return (
            Premise(
                name="sampling_time",
                required=self.step,
                certified=self.longest_step,
                unit="s",
                note="T_s of the fault, and the longest for which a design with a guarantee was found",
            ),
            Premise(
                name="delay",
                required=self.runs.sampled_loop.delay if self.runs else Fraction(0),
                certified=self.longest_delay,
                unit="s",
                note="from the measurement to the pressure: that of the design, and the longest for which a design of "
                "the same kind was found with a guarantee",
            ),
        )


def sampled_design(
    task: FaultPlant,
    step: Fraction,
    objective: str = "tracking",
    *,
    measured: str = MEASURED[0],
    setup: ExactSetup = PLAIN,
) -> SampledDesign:
    """e-LQR for a T_s [s], or for the longest shorter T_s that has a guarantee.

    Raises
    ------
    ParameterError
        For an unknown objective.
    """
    options: Any = {"measured": measured, "setup": setup}
    proof = design_sampled_law(task, step, objective=objective, **options)
    longest = longest_step(task, **options)
    if not proof.available:
        proof = design_near_longer_step(task, step, longest, **options) or proof
    reason = proof.reason if not proof.available else ""
    if not proof.available and longest is not None:
        proof = design_at(task, longest)
    if not proof.available:
        return SampledDesign(step=step, runs=None, reason=reason)
    delayed, own = longest_delay(task, proof.sampled_loop.step, **options), proof.sampled_loop.delay
    return SampledDesign(
        step=step,
        runs=proof,
        reason=reason,
        longest_step=max(
            proof.sampled_loop.step, longest.guarantee.sampled_loop.step if longest else proof.sampled_loop.step
        ),
        longest_delay=max(own, delayed.sampled_loop.delay) if delayed else own,
    )


def sampled_sliding_mode(
    task: FaultPlant, law: SlidingMode, step: Fraction, objective: str = "tracking", setup: ExactSetup = PLAIN
) -> tuple[Compensation, SampledDesign]:
    """Sliding mode for a T_s [s], or for the longest shorter T_s that has a guarantee.

    The longest T_s and delay of such designs are searched as for linear laws; sliding modes contain no model of the
    delay.

    Raises
    ------
    ParameterError
        For an unknown objective.
    """
    laws = Deadbeat(law)
    made = design_compensated(task, law, step, objective=objective, setup=setup)
    longest = longest_step(task, kind=laws, setup=setup)
    if not made.proof.available:
        made = laws.design_near_longer_step(task, step, longest, setup=setup) or made
    reason = made.proof.reason if not made.proof.available else ""
    if reason and longest is not None:
        made = laws.at(task, longest, objective)
    if not made.without_stick.available:
        return made, SampledDesign(step=step, runs=None, reason=reason)
    runs = with_varying_gain(made.without_stick)
    sampled_loop = runs.sampled_loop
    delayed = longest_delay(task, sampled_loop.step, kind=laws, setup=setup)
    return replace(made, proof=runs), SampledDesign(
        step=step,
        runs=runs,
        reason=reason,
        longest_step=max(sampled_loop.step, longest.guarantee.sampled_loop.step if longest else sampled_loop.step),
        longest_delay=delayed.sampled_loop.delay if delayed else Fraction(0),
    )


# ----------------------------------------------------------------------
# Guarantees of sliding modes in their schemes, and reasons why most schemes have none.


def guarantee_of(
    task: FaultPlant, law: SlidingMode, setup: ExactSetup = PLAIN
) -> TrackingProof | StickSlipProof | NoProof:
    """Guarantee of a sliding mode in its scheme, ``compensated`` or ``stick-slip``."""
    own = law.sampling
    if own is not None and own.scheme == STICK_SLIP:
        if missing := {"authority", "weight", "slip_weight", "rest_slip"} - dict(own.settings).keys():
            reason = f"a guarantee in the scheme {STICK_SLIP} requires {', '.join(sorted(missing))} in its settings"
            return NoProof(reason=reason)
        if setup.rate_noise:
            reason = "guarantees on the stick-slip plant do not cover rate_noise: set it to 0"
            return NoProof(reason=reason)
        try:
            return proved(task, sticking_loop(law, setup.slip_noise))
        except UnsupportedError as error:
            return NoProof(reason=str(error))
    if own is None or own.scheme != GUARANTEED:
        scheme, step = ("continuous", Fraction(0)) if own is None else (own.scheme, own.step)
        return NoProof(reason=_why_none(task, type(law), scheme, step))
    settings = dict(own.settings)
    if not {"weight", "authority"} <= settings.keys():
        reason = f"a guarantee in the scheme {GUARANTEED} requires the settings weight and authority"
        return NoProof(reason=reason)
    setup = replace(setup, **own.path)
    return with_varying_gain(compensated(task, law, settings["weight"], settings["authority"], own.step, setup=setup))


def sliding_mode(
    task: FaultPlant,
    law: type[SlidingMode],
    step: Fraction,
    *,
    gains: tuple[str, ...] = (),
    scheme: str = GUARANTEED,
    objective: str = "tracking",
    setup: ExactSetup = PLAIN,
) -> Compensation | NoProof:
    """Sliding mode with given base gains, by default the first stored ones, in a scheme.

    Parameters
    ----------
    task : FaultPlant
    law : type
    step : Fraction
        T_s [s].
    gains : tuple of str
        Base gains (λ = 1); empty for the first ones that a design tries.
    scheme : str
        Discretisation scheme; this function finds a guarantee for ``compensated`` alone.
    objective : str
        ``tracking`` or ``peak``.
    setup : ExactSetup
        As in `design_sampled_law`.

    Raises
    ------
    ParameterError
        For an unknown scheme or objective, or a wrong number of gains.
    """
    require_known(scheme, sorted(schemes()), "scheme")
    compensation = deadbeat(task, law, gains)
    if scheme != GUARANTEED:
        return NoProof(reason=_why_none(task, law, scheme, step))
    made = design_compensated(task, compensation.controller, step, objective=objective, setup=setup)
    return replace(made, proof=with_varying_gain(made.without_stick))


def deadbeat(task: FaultPlant, law: type[SlidingMode], gains: tuple[str, ...] = ()) -> Deadbeat:
    """Sliding modes of a law with given base gains, by default the first stored ones."""
    base = law.from_values(gains) if gains else law.base_gains()[0].law
    return Deadbeat(replace(base, gains=dict(base.gains), divisor=task.authority))


def _why_none(task: FaultPlant, law: type[SlidingMode], scheme: str, step: Fraction) -> str:
    if scheme == "continuous":
        return (
            f"{law.title} is designed in continuous time, and a sampled controller cannot change the pressure at every "
            "instant. Design the law for the sampled loop: without --continuous, and in the scheme stick-slip"
        )
    if scheme == STICK_SLIP:
        return (
            f"the disturbance estimate of the scheme {STICK_SLIP} is limited at rest, which the linear small-gain "
            f"theorem does not cover{_REMEDY}"
        )
    if scheme == "implicit":
        rest = UpperBound(step**2 * task.authority * max(map(abs, task.rest_pressure)))
        return (
            "the implicit step has no estimate of the disturbance, so that an equilibrium pressure p* leaves the error "
            f"e1 = T_s²·B0·p*, here up to {rest:.2g} m{_REMEDY}"
        )
    return (
        f"at e1 = 0 the slope of {law.title} is infinite, so that its pressure chatters with zero-order hold, and no "
        f"linear loop with a range of slopes covers it{_REMEDY}"
    )


_REMEDY = f". Use the scheme {GUARANTEED}"
