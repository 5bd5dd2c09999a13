"""Bounds on the pressure: −p_max ≤ p < σ', a region that never reaches them, and a start without a jump (ERRATA 23)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from quakedesign.certificates.linear_premises import rest_pressure
from quakedesign.controllers.elqr import ExtendedLQR, PressureLimits
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.analysis.printed_theorem import decreases
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, inverse, product, transpose

_OPENING_MARGIN = Fraction(1, 100)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnsaturatedRegion:
    """{x̃ᵀΘx̃ ≤ level} about the equilibrium of any constant reference: invariant, and p stays inside its limits.

    Attributes
    ----------
    theta : Matrix
        SI, exact.
    level : Fraction
    room : Fraction
        Distance [Pa] from p* to the nearer limit, over all constant references and the whole box.
    sizes : tuple of float
        Largest |x̃1| [m], |x̃2| [m/s], |ξ̃1| [m s], |ξ̃2| [m s²] in it.
    """

    theta: Matrix
    level: Fraction
    room: Fraction
    sizes: tuple[float, ...]

    def holds(self, state: Sequence[Fraction | float | str]) -> bool:
        """Whether a deviation x̃ from the equilibrium is inside, exactly."""
        x = [rational(v, "state") for v in state]
        return product((x,), self.theta, transpose((x,)))[0][0] <= self.level


def pressure_limits(
    fault: Fault, largest_withdrawal: float | str, *, margin: float | str | Fraction = _OPENING_MARGIN
) -> PressureLimits:
    """−p_max and (1 − margin)σ', below the pressure that opens the fault.

    Parameters
    ----------
    fault : Fault
    largest_withdrawal : float or str
        p_max [Pa], positive.
    margin : float or str
        Share of σ' to keep [-], between 0 and 1.

    Raises
    ------
    ParameterError
        For values outside their ranges.
    """
    most, share = rational(largest_withdrawal, "largest_withdrawal"), rational(margin, "margin")
    if most <= 0 or not 0 < share < 1:
        raise ParameterError(
            "largest_withdrawal must be positive and margin between 0 and 1. Received "
            f"{float(most):.4g} Pa and {float(share):.4g}. A hundredth keeps p below 0.99 of the normal stress."
        )
    return PressureLimits(lowest=-most, highest=(1 - share) * rational(fault.effective_normal_stress))


def with_limits(controller: ExtendedLQR, limits: PressureLimits, recovery_time: float | str) -> ExtendedLQR:
    """Return the law with its pressure limited and its integrals brought back while it is (anti-windup).

    Parameters
    ----------
    controller : ExtendedLQR
    limits : PressureLimits
    recovery_time : float or str
        Time constant [s] of both integrals while p is at a limit.
    """
    return replace(controller, limits=replace(limits, recovery_time=rational(recovery_time, "recovery_time")))


def bumpless_start(
    controller: ExtendedLQR, pressure: float | str, slip_error: float | str = 0, rate_error: float | str = 0
) -> ExtendedLQR:
    """Return the law that starts, with ξ = 0, at the pressure that is in the fault already.

    Parameters
    ----------
    controller : ExtendedLQR
    pressure : float or str
        p at the start [Pa].
    slip_error, rate_error : float or str
        What k1 [m] and k2 [m/s] act on at the start: errors, or the state for feedback of the state.
    """
    k1, k2, *_ = controller.gains.values()
    offset = rational(pressure, "pressure") + k1 * rational(slip_error, "slip_error")
    return replace(controller, offset=offset + k2 * rational(rate_error, "rate_error"))


def unsaturated_region(
    fault: Fault, controller: ExtendedLQR, theta: Matrix, limits: PressureLimits | None = None
) -> UnsaturatedRegion:
    """Largest level set of a proved V on which p stays inside its limits, for every constant reference of the task.

    p = p* − Kx̃ and the largest |Kx̃| on {x̃ᵀΘx̃ ≤ c} is √(c·KΘ⁻¹Kᵀ): all exact, p* enclosed by balls.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    theta : matrix (4 × 4) of Fraction
        V = xᵀΘx in SI; V > 0 and V̇ < 0 over the box are decided again here.
    limits : PressureLimits, optional
        Those of the controller without.

    Raises
    ------
    ParameterError
        When V is no proof for these gains, no limits are given, or rest itself needs a pressure outside of them.
    """
    bounds, gains = limits or controller.limits, tuple(controller.gains.values())
    if bounds is None:
        raise ParameterError("limits of the pressure must be given. Received none. Use pressure_limits.")
    if not decreases(LinearProblem.of(fault), gains, theta):
        raise ParameterError("V must decrease over the whole box. Received one that does not. Use the design's own V.")
    low, high = rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip)))
    room = min(low - bounds.lowest, bounds.highest - high)
    if room <= 0:
        raise ParameterError(
            f"the limits must hold the pressure at rest, {float(low):.4g} to {float(high):.4g} Pa. Received "
            f"{float(bounds.lowest):.4g} to {float(bounds.highest):.4g} Pa. Allow more withdrawal, or a smaller target."
        )
    across = inverse(theta)
    level = room**2 / product((gains,), across, transpose((gains,)))[0][0]
    return UnsaturatedRegion(
        theta=theta, level=level, room=room, sizes=tuple(float(level * across[i][i]) ** 0.5 for i in range(4))
    )
