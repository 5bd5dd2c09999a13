"""Proof for a sampled loop on the stick–slip plant: claims, check, statement."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import TYPE_CHECKING, ClassVar

from quakedesign import laws
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import Bound, LowerBound, UpperBound
from quakedesign.files import Json
from quakedesign.guarantees.exact.proof import NoProof, Proof
from quakedesign.guarantees.exact.sliding_proof import SlidingProof
from quakedesign.guarantees.exact.stick_slip_set import (
    SampledStickSlip,
    StickSlipClaims,
    StickSlipPolytope,
    stick_slip_bounds,
)
from quakedesign.guarantees.exact.tracking_proof import TrackingProof
from quakedesign.laws import ImplicitStep
from quakedesign.laws.stick_slip_law import GAIN_UNITS
from quakedesign.lyapunov.exact.certificate_files import STICK_SLIP
from quakedesign.plant.fault_plant import FaultPlant

if TYPE_CHECKING:
    from quakedesign.laws.stick_slip_controller import StickSlipController


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipProof(Proof[StickSlipClaims]):
    """Claims about one loop on the stick–slip plant, from rest; `check` decides them.

    Attributes
    ----------
    task : FaultPlant
    sampled_loop : SampledStickSlip
    invariant_set : StickSlipPolytope
    claims : StickSlipClaims
    healing : Fraction
        Δμ_h [-] included in the task's disturbance, see `covered_healing`; not part of the file.
    """

    kind: ClassVar[str] = STICK_SLIP
    plant: ClassVar[str] = "stick-slip"
    covers_healing: ClassVar[bool] = True
    task: FaultPlant
    sampled_loop: SampledStickSlip
    invariant_set: StickSlipPolytope
    claims: StickSlipClaims
    healing: Fraction = Fraction(0)

    def __repr__(self) -> str:
        return f"StickSlipProof({self.task.name}: slip rate at most {self.claims.peak_slip_rate:.4g} m/s)"

    @property
    def peak_slip_rate(self) -> UpperBound:
        """Bound of the slip rate [m/s]."""
        return self.claims.peak_slip_rate

    @property
    def motion(self) -> str:
        """States for which the slip rate is bounded, as text."""
        return ", whether the fault slides or sticks"

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Claims by name, SI; both errors follow from them, since slip rate and reference rate are at least 0."""
        named = {part.name: getattr(self.claims, part.name) for part in fields(self.claims)}
        rate_error = UpperBound(max(self.claims.peak_slip_rate, self.task.reference_rates[0]))
        return named | {"slip_error": self.claims.slip_error, "slip_rate_error": rate_error}

    @property
    def valve_pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure [Pa]."""
        return self.claims.pressures[-1]

    @property
    def implicit_step(self) -> ImplicitStep | None:
        """Implicit step of a sliding mode."""
        return ImplicitStep(pull=self.sampled_loop.law.pull) if self.sampled_loop.law.pull else None

    @property
    def controller(self) -> "StickSlipController":
        """The law for `simulate`.

        Raises
        ------
        UnsupportedError
            For a sliding mode, whose gains the certificate does not state.
        """
        if self.sampled_loop.law.pull:
            raise UnsupportedError(
                "a certificate of a sliding mode states its implicit step, not the gains. Use the controller of the "
                "design, or run the file with simulate --certificate."
            )
        return laws.StickSlipController(
            law=self.sampled_loop.law, step=self.sampled_loop.step, longest=self.sampled_loop.longest_step
        )

    def covered_healing(self, disturbance: Fraction = Fraction(0)) -> LowerBound:
        """Healing Δμ_h [-] that these claims also cover, for a disturbance bound [m/s²].

        Friction that holds a fault at rest may then exceed sliding friction by up to Δμ_h, after a rest of any length.
        This adds at most Δ = N̂Δμ_h(σ' − p) to the force that holds the fault. Let H be the disturbance and G the force
        without it, constant within a rest. A fault at rest has G + φ ≤ Δ, hence −G ≥ −(H + Δ). If G ≥ −(H + Δ), the
        rest is a slide at rate 0 under the disturbance −G, which is at most H + Δ; if not, no φ of at most H can
        release the fault before the next sample. These are the two cases of the theorem for the disturbance H + Δ,
        which must be at most that of the claims.

        Raises
        ------
        ParameterError
            For a disturbance that is negative or above that of the claims.
        """
        most = self.task.amplitude
        if not 0 <= disturbance <= most:
            raise ParameterError(
                f"disturbance must be from 0 to that of the claims, {float(most):g} m/s^2, got {float(disturbance):g} "
                "m/s^2"
            )
        return LowerBound((most - disturbance) / self._per_healing)

    def beside_healing(self, task: FaultPlant, healing: Fraction) -> tuple[FaultPlant, LowerBound | None]:
        """Task with the disturbance of the claims, and the covered healing if it is too small.

        A task with a larger disturbance is returned unchanged, with None.
        """
        if task.amplitude > self.task.amplitude:
            return task, None
        covered = self.covered_healing(task.amplitude)
        return replace(task, amplitude=self.task.amplitude), covered if covered < healing else None

    @property
    def disturbance(self) -> Fraction:
        """Bound of the disturbance [m/s²] without `healing`."""
        return self.task.amplitude - self.healing * self._per_healing

    @property
    def _per_healing(self) -> Fraction:
        """Δ/Δμ_h [m/s²]."""
        stress = self.task.normal_stress - Fraction(self.claims.least_pressure)
        return self.task.area_per_mass[1] * stress

    def theorem_bounds(self) -> StickSlipClaims | NoProof:
        """Claims that the theorem gives."""
        try:
            return stick_slip_bounds(self.task, self.sampled_loop, self.invariant_set)
        except ParameterError as error:
            return NoProof(reason=str(error))

    def follows_from(self, bounds: StickSlipClaims) -> bool:
        """Whether the claims follow, and the task's disturbance includes the healing."""
        return self.claims.follow(bounds) and self.healing >= 0 and self.disturbance >= 0

    def to_dict(self) -> Json:
        """Exact numbers as strings, SI."""
        sampled_loop = self.sampled_loop
        return {
            "plant": self.plant,
            "slip_error": self.claims.slip_error.exact,
            **self.claims.to_dict(),
            "covered_healing": float(self.covered_healing()),
            "healing": str(self.healing),
            "step": str(sampled_loop.step),
            **({"longest_step": str(sampled_loop.longest_step)} if sampled_loop.longest_step else {}),
            **{name: str(size) for name, size in sampled_loop.noise.items()},
            "law": {name: str(getattr(sampled_loop.law, name)) for name in GAIN_UNITS},
        }

    def sentence(self) -> str:
        """Statement of the guarantee; bounds are rounded outward, conditions inward."""
        task, sampled_loop, claims = self.task, self.sampled_loop, self.claims
        stress = LowerBound(self.disturbance / task.area_per_mass[1])
        size = f"{LowerBound(self.disturbance):.3g} m/s^2 ({stress.quantity('Pa')} of shear)"
        if self.healing:
            size += f" and friction at rest up to {LowerBound(self.healing):.3g} above friction in slip"
        behind, ahead = claims.slip_behind.quantity("m"), claims.slip_ahead.quantity("m")
        pressures = f"{claims.least_pressure.quantity('Pa')} and {claims.largest_pressure.quantity('Pa')}"
        over = f"{UpperBound(sampled_loop.step):.6g} s"
        if sampled_loop.longest_step:
            over = f"sampling intervals from {over} to {LowerBound(sampled_loop.longest_step):.6g} s in any order"
        return (
            f"from rest, with zero-order hold over {over} and {self._measured()}, "
            f"for every disturbance of at most {size}, for every friction law and all constant parameters of the box: "
            f"the slip rate never exceeds {claims.peak_slip_rate.quantity('m/s')}, whether the fault slides or sticks, "
            f"the slip stays between {behind} behind and {ahead} ahead of the reference, the pressure between "
            f"{pressures}, for all t >= 0"
        )

    def _measured(self) -> str:
        """Part of the statement on measurement errors, rounded inward."""
        if not self.sampled_loop.slip_noise:
            return "exact measurements of slip and slip rate"
        noise = LowerBound(self.sampled_loop.slip_noise).quantity("m")
        return f"slip measured within {noise} and slip rate measured exactly"


def stick_slip_guarantee(
    task: FaultPlant, sampled_loop: SampledStickSlip, invariant_set: StickSlipPolytope
) -> StickSlipProof | NoProof:
    """Claims that the theorem gives for a polytope, or the condition that fails."""
    try:
        bounds = stick_slip_bounds(task, sampled_loop, invariant_set)
    except ParameterError as error:
        return NoProof(reason=str(error))
    return StickSlipProof(task=task, sampled_loop=sampled_loop, invariant_set=invariant_set, claims=bounds.rounded())


FaultProof = TrackingProof | SlidingProof | StickSlipProof
"""What is proved of a sampled law on a fault."""
