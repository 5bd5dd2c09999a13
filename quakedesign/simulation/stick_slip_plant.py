"""The stick–slip plant: friction holds the fault at rest, and it never slips backward (ERRATA 14)."""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from quakedesign.loop.schemes.base import Motion
from quakedesign.simulation.closed_loop import ClosedLoop, Number
from quakedesign.simulation.integrators import Integrator

_BISECTIONS = 4  # leave 1/16 of the step, from which Newton's method converges quadratically
_NEWTON_STEPS = 3
_TINY = 1e-300  # smallest slope: avoids a division by zero at a multiple root


@dataclass(frozen=True)
class StickSlipLoop(ClosedLoop):
    """A closed loop with x2 ≥ 0: x2' = load − F + λ, with the reaction λ ≥ 0, λ·x2 = 0 and F = μ N̂ max(σ' − p, 0).

    While the fault slips it obeys eq. shift, and results equal those of `ClosedLoop` bitwise as long as p < σ'. It
    stops when the slip rate falls to zero. It rests as long as friction can carry the load, with a slip rate of exactly
    zero. In one step at most one release and one stop are located, with the integrator's order. Backward slip is not
    modelled: `reversing` indicates a load that exceeds friction in that direction. With healing, the friction at rest
    is larger by `rest_excess` of the law; this excess vanishes at the release.

    Attributes
    ----------
    fault, controller, constant_pressure
        As in `ClosedLoop`.
    """

    plant_name: ClassVar[str] = "stick-slip"
    plant_title: ClassVar[str] = ""
    sticks: ClassVar[bool] = True

    @property
    def plant(self) -> Motion:
        """Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²] while the fault slips; no friction where p > σ'."""
        _, normal, _, stress = self.hats()

        def rates(time: ca.SX, x: ca.SX, pressure: ca.SX) -> ca.SX:
            # where p > σ', friction of the printed plant would be negative; this term cancels it
            pulling = normal * self.friction(x) * ca.fmin(stress - pressure, 0)
            rate = self.printed(time, x, pressure)
            return rate + ca.vertcat(0, pulling)

        return rates

    @property
    def resting_plant(self) -> Motion:
        """As `plant`, with the friction of a fault at rest, which is larger with healing."""
        plant, excess = self.plant, self.fault.friction.rest_excess
        _, normal, _, stress = self.hats()
        if not excess:
            return plant
        return lambda time, x, p: plant(time, x, p) - ca.vertcat(0, normal * excess * ca.fmax(stress - p, 0))

    def resting_load(self, time: ca.SX, slip: ca.SX, pressure: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Load minus and load plus friction at rest [m/s²] (SX); the fault stays at rest while 0 is between them."""
        forward = self.resting_plant(time, ca.vertcat(slip, 0), pressure)[1]
        _, normal, _, stress = self.hats()
        friction = self.friction(ca.vertcat(slip, 0)) + self.fault.friction.rest_excess
        return forward, forward + 2 * normal * friction * ca.fmax(stress - pressure, 0)

    def reversing(self, time: ca.SX, state: ca.SX, pressure: ca.SX) -> ca.SX:
        """Whether the load on a fault at rest exceeds friction in the backward direction (SX)."""
        return ca.logic_and(state[1] == 0, self.resting_load(time, state[0], pressure)[1] < 0)

    def shear_stress(self, time: ca.SX, state: ca.SX, pressure: ca.SX, friction: ca.SX) -> ca.SX:
        """Shear stress [Pa]: μ max(σ' − p, 0) in slip, or the stress that balances the load at rest (SX)."""
        closed = ca.fmax(self.fault.effective_normal_stress - pressure, 0)
        strength, rest_strength = friction * closed, (friction + self.fault.friction.rest_excess) * closed
        load = self.resting_load(time, state[0], pressure)[0] / self.hats()[1] + rest_strength
        return ca.if_else(state[1] == 0, ca.fmin(load, rest_strength), strength)

    def advance(self, method: type[Integrator], motion: Motion, state: ca.SX, step: float, works: int = 0) -> ca.SX:
        """State after one step, with at most one release and one stop; the last `works` states are works."""
        moved = _SplitStep(self.plant, self.resting_plant, method, motion, step, works)
        rests, starting = state[1] == 0, moved.starting_acceleration(0.0, state)
        release = _crossing(starting, moved.starting_acceleration(1.0, moved.rested(0.0, 1.0, state)))
        begin = ca.if_else(rests, ca.if_else(starting > 0, 0.0, release), 0.0)
        start = moved.rested(0.0, begin, state)
        ahead = moved.slid(begin, 1 - begin, start)
        stop, stopped = moved.stop(begin, start, ahead)
        return ca.if_else(ahead[1] < 0, moved.rested(stop, 1 - stop, stopped), ahead)


@dataclass(frozen=True)
class _SplitStep:
    """Motion within one step, divided at shares [-] of its length."""

    plant: Motion
    resting_plant: Motion
    method: type[Integrator]
    motion: Motion
    step: float
    works: int

    def rates(self, passed: Number, state: ca.SX) -> ca.SX:
        """Time derivative of the state while the fault slips."""
        return self.motion(self.plant, passed, state)

    def starting_acceleration(self, passed: Number, state: ca.SX) -> ca.SX:
        """Acceleration [m/s²] from rest; positive if friction cannot carry the load."""
        return self.motion(self.resting_plant, passed, ca.vertcat(state[0], 0, state[2:]))[1]

    def slid(self, passed: Number, share: Number, state: ca.SX) -> ca.SX:
        """State after the fault slips for a share of the step."""
        return self.method.advance(lambda part, now: self.rates(passed + share * part, now), state, share * self.step)

    def rested(self, passed: Number, share: Number, state: ca.SX) -> ca.SX:
        """State after a share of the step at rest: slip and slip rate stay, the other states evolve."""

        def field(part: Number, now: ca.SX) -> ca.SX:
            return self.motion(lambda *_: ca.SX.zeros(2), passed + share * part, ca.vertcat(state[0], 0, now[2:]))

        if self._further(state):
            return self.method.advance(field, state, share * self.step)
        return state + share * self.step * field(0.0, state)

    def _further(self, state: ca.SX) -> bool:
        """Whether the state has more than slip, slip rate and works: states of the law or of the pressure path."""
        return bool(state.shape[0] - 2 - self.works)

    def stop(self, begin: Number, start: ca.SX, ahead: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Share of the step at which the slip rate falls to zero, and the state at this time.

        The slip rate is interpolated by a quartic in time with the same end values, end slopes and integral (slip).
        States of the law and of the pressure path are integrated to this time; without these, works are cubic in time.
        """
        length = (1 - begin) * self.step
        first, last = self.rates(begin, start), self.rates(1.0, ahead)
        rate = _Quartic.of(start[1], ahead[1], length * first[1], length * last[1], (ahead[0] - start[0]) / length)
        share = rate.root()
        stop = begin + share * (1 - begin)
        if self._further(start):
            stopped = self.slid(begin, share * (1 - begin), start)
        else:
            up = share * share * (3 - 2 * share)
            slopes = share * (1 - share) * ((1 - share) * first - share * last)
            stopped = start + up * (ahead - start) + length * slopes
        return stop, ca.vertcat(start[0] + length * rate.integral(share), 0, stopped[2:])


def _crossing(before: ca.SX, after: ca.SX) -> ca.SX:
    """Share of a step at which a quantity becomes positive, by linear interpolation; 1 if it does not."""
    crosses = ca.logic_and(before <= 0, after > 0)
    return ca.if_else(crosses, before / ca.if_else(crosses, before - after, 1), 1)


@dataclass(frozen=True)
class _Quartic:
    """Polynomial of degree four on [0, 1], by its coefficients."""

    coefficients: tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]

    @classmethod
    def of(cls, start: ca.SX, end: ca.SX, start_slope: ca.SX, end_slope: ca.SX, mean: ca.SX) -> "_Quartic":
        """Quartic with these values and slopes at 0 and 1, and this mean."""
        cubic = 2 * (start - end) + start_slope + end_slope
        square = 3 * (end - start) - 2 * start_slope - end_slope
        bulge = 30 * (mean - (start + start_slope / 2 + square / 3 + cubic / 4))  # coefficient of s²(1 − s)²
        return cls((start, start_slope, square + bulge, cubic - 2 * bulge, bulge))

    def at(self, share: Number) -> ca.SX:
        """Value at a share."""
        a, b, c, d, e = self.coefficients
        return a + share * (b + share * (c + share * (d + share * e)))

    def integral(self, share: Number) -> ca.SX:
        """Integral from 0 to a share."""
        a, b, c, d, e = self.coefficients
        return share * (a + share * (b / 2 + share * (c / 3 + share * (d / 4 + share * e / 5))))

    def slope(self, share: Number) -> ca.SX:
        """Derivative at a share."""
        _, b, c, d, e = self.coefficients
        return b + share * (2 * c + share * (3 * d + share * 4 * e))

    def root(self) -> ca.SX:
        """A share at which the polynomial falls through zero, for values ≥ 0 at 0 and < 0 at 1."""
        low, high = ca.SX(0), ca.SX(1)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            positive = self.at(middle) > 0
            low, high = ca.if_else(positive, middle, low), ca.if_else(positive, high, middle)
        share = (low + high) / 2
        for _ in range(_NEWTON_STEPS):
            falling = ca.fmin(self.slope(share), -_TINY)
            share = ca.fmin(ca.fmax(share - self.at(share) / falling, low), high)
        return share
