"""Sampled laws as controllers of a simulation, and the compensated implicit step.

Chapters: a law as expressions in states and reference; a sampled linear law as a controller; the implicit step with a
disturbance estimate in place of integral states, for simulation and proof.
"""

from collections.abc import Mapping
from dataclasses import field, fields, replace
from fractions import Fraction
from functools import partial
from math import log
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
import sympy as sp
from flint import fmpq, fmpq_mat

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import apart, fraction_of, to_sympy
from quakedesign.laws.base import Controller, Sampling, Signals
from quakedesign.laws.implicit_root import ImplicitStep
from quakedesign.laws.loop_field import LoopField
from quakedesign.laws.sampled_law import LinearLaw, RestLimit, require_gain
from quakedesign.symbolic import plant

# ----------------------------------------------------------------------
# A law as expressions in the states of the fault and in the reference.

r, r_rate, r_acceleration = sp.symbols("r r_rate r_acceleration", real=True)


def integral_symbols(controller: Controller | None) -> tuple[sp.Symbol, ...]:
    """Symbols ξ1, ξ2 … of the law's own states."""
    count = len(controller.integral_units) if controller else 0
    return tuple(sp.Symbol(f"xi_{i + 1}", real=True) for i in range(count))


def law_expressions(controller: Controller) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
    """Pressure [Pa] and ξ' of a law, in x1, x2, r, r', r'' and ξ."""
    signals = Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.x1 - r,
        slip_rate_error=plant.x2 - r_rate,
        integrals=integral_symbols(controller),
        reference_acceleration=r_acceleration,
    )
    return controller.pressure(signals), controller.integral_rates(signals)


def cut_off(
    commanded: sp.Expr,
    states: tuple[sp.Expr, ...],
    slip: sp.Expr,
    reference: sp.Expr,
    width: sp.Expr,
    per_slip: sp.Expr,
    resolution: sp.Expr,
    *,
    within: tuple[sp.Expr, ...] | None = None,
) -> tuple[sp.Expr, ...]:
    """Applied pressure [Pa] within the limit at rest, and the values of `RestLimit.STATES` after this sample.

    Parameters
    ----------
    commanded : Expr
        Commanded pressure [Pa].
    states : tuple of Expr
        Values of `RestLimit.STATES` before this sample [Pa, m].
    slip, reference : Expr
        Measured slip and reference slip [m].
    width, per_slip, resolution : Expr
        As in `RestLimit` [Pa, Pa/m, m].
    within : tuple of Expr, optional
        Least and largest pressure [Pa], and the largest slip between two samples [m] for which they apply.
    """
    highest, last = states
    moved = per_slip * reference
    short = sp.Max(highest - moved - width - commanded, 0)
    applied = commanded + sp.Piecewise((short, slip <= last + resolution), (0, True))
    if within is not None:
        least, largest, fastest = within
        inside = sp.Max(least, sp.Min(largest, applied)) - applied
        applied += sp.Piecewise((inside, slip <= last + fastest), (0, True))
    return applied, highest + sp.Max(applied + moved - highest, 0), slip


# ----------------------------------------------------------------------
# A sampled linear law as a controller for simulations.


def growth_time_at_rest(law: LinearLaw, step: Fraction) -> float | None:
    """Time [s] in which the states grow e-fold while the fault is at rest, sampled every T_s [s]; None if stable."""
    sizes = np.abs(np.linalg.eigvals(np.array(law.update, dtype=float).reshape((len(law.states),) * 2)))
    growth = float(np.max(sizes, initial=0.0))
    return float(step) / log(growth) if growth > 1 + 1e-6 else None  # rounding moves a repeated eigenvalue 1 by less


def winds_up(law: LinearLaw) -> bool:
    """Whether the eigenvalue 1 of the update has a Jordan block: the law then ramps in open loop (double integral)."""
    if not law.states:
        return False
    rows = [[v - (i == j) for j, v in enumerate(row)] for i, row in enumerate(law.update)]
    still = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows])
    return bool(still.rank() > (still * still).rank())


def warning_at_rest(law: LinearLaw, step: Fraction, *, limited: bool = False) -> str:
    """Warning about a law whose pressure grows while the fault is at rest, or empty.

    Empty for other laws and, if a limit at rest bounds the pressure (`limited`), for one that only ramps.
    """
    time = growth_time_at_rest(law, step)
    if time:
        return (
            "NOT for a stick-slip fault: the law is unstable in open loop, and while friction holds the fault at rest "
            f"its pressure grows e-fold in {time:.3g} s: use a law whose update matrix has no eigenvalue outside the "
            "unit circle"
        )
    if limited or not winds_up(law):
        return ""
    return (
        "MAY WIND UP on a stick-slip fault: the law has a double integral (the eigenvalue 1 of its update matrix has "
        "a Jordan block), which ramps the pressure while friction holds the fault at rest: run simulate before use, "
        "or use one integral"
    )


@checked_dataclass(frozen=True, kw_only=True)
class SampledController(Controller):
    """p = Cz + Dy with z ← Fz + Gy; the scheme ``explicit`` performs this update as ξ ← ξ + T_s·ξ′, ξ = z.

    Attributes
    ----------
    law : LinearLaw
    step : Fraction
        T_s [s] of the design.
    delay, lag, diffusion, longest : Fraction
        As in `Sampling` [s].
    rest_limit : RestLimit, optional
        Limit of the pressure at rest; the law then receives the applied pressure, and the states of the limit follow
        those of the law.
    gains : mapping of str to Fraction
        Derived from the law: p = −k1·e1 − k2·e2 − Σ gain·state, every state under its name.
    """

    name: ClassVar[str] = "sampled"
    title: ClassVar[str] = "e-LQR"
    source: ClassVar[str] = "quakedesign.laws.sampled_law"

    gains: Mapping[str, Fraction] = field(default_factory=dict, init=False)
    law: LinearLaw
    step: Fraction
    delay: Fraction = Fraction(0)
    lag: Fraction = Fraction(0)
    diffusion: Fraction = Fraction(0)
    longest: Fraction = Fraction(0)
    rest_limit: RestLimit | None = None

    def __post_init__(self) -> None:
        values = (-v for v in (*self.law.feedback, *self.law.output))
        object.__setattr__(self, "gains", MappingProxyType(dict(zip(self.gain_units, values, strict=True))))

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        values = {part.name: getattr(self, part.name) for part in fields(self) if part.init}
        return partial(type(self), **values), ()

    @property
    def sampling(self) -> Sampling:
        """Scheme ``explicit``, one step every T_s."""
        return Sampling(step=self.step, delay=self.delay, lag=self.lag, diffusion=self.diffusion, longest=self.longest)

    @property
    def warning_at_rest(self) -> str:  # type: ignore[override]
        """Warning if the pressure grows while the fault is at rest; else empty."""
        return warning_at_rest(self.law, self.step, limited=self.rest_limit is not None)

    @property
    def of_slip(self) -> LinearLaw | None:
        """The law, if it uses the slip error alone; None if it uses the slip rate or the reference."""
        return self.law if self.law.of_slip_alone and not self.law.of_reference else None

    @property
    def notes(self) -> tuple[str, ...]:
        """Changes of a user-defined law when its floats became exact numbers."""
        return ()

    def behind(self, **path: Fraction) -> Self:
        """The law with another delay, lag, diffusion time or longest interval [s] in runs."""
        return replace(self, **path)  # type: ignore[arg-type]

    @property
    def while_moving(self) -> "SampledController":
        """The linear law, without its limit at rest."""
        return replace(self, rest_limit=None)

    @property
    def gain_units(self) -> Mapping[str, str]:  # type: ignore[override]
        """Units of k1 and k2, then Pa for every state of the law, which has no declared unit."""
        return {"k1": "Pa/m", "k2": "Pa s/m", **dict.fromkeys(self.law.states, "Pa")}

    @property
    def integral_units(self) -> tuple[str, ...]:  # type: ignore[override]
        """A hyphen for every state of the law, then the units of the limit."""
        return ("-",) * len(self.law.states) + (RestLimit.UNITS if self.rest_limit else ())

    def pressure(self, signals: Signals) -> sp.Expr:
        """Cz + Dy plus the terms in r and r′, at rest within the limit [Pa]."""
        return self._decided(signals)[0]

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """(Fz + Gy − z)/T_s, with terms in r and r′ and the response to the limit; then rates of the limit's states."""
        cut, after = self._decided(signals)[1:]
        z, seen, period = signals.integrals, self._read(signals), to_sympy(self.step)
        applied = self.law.applied or (Fraction(0),) * len(self.law.states)
        rows = zip(self.law.update, self.law.measured, applied, z, strict=False)
        rates = [(_combined((*own, *fed), seen) - state) / period + to_sympy(h) * cut for own, fed, h, state in rows]
        rates = [rate + added / period for rate, added in zip(rates, self._of_reference(signals)[:-1], strict=True)]
        return (*rates, *((new - old) / period for new, old in zip(after, z[len(rates) :], strict=True)))

    def _decided(self, signals: Signals) -> tuple[sp.Expr, sp.Expr, tuple[sp.Expr, ...]]:
        """Applied pressure [Pa], its excess over the commanded one per T_s [Pa/s], next states of the limit."""
        commanded = _combined((*self.law.output, *self.law.feedback), self._read(signals))
        commanded += self._of_reference(signals)[-1]
        if self.rest_limit is None:
            return commanded, sp.S.Zero, ()
        states = signals.integrals[len(self.law.states) :]
        limit, reference = self.rest_limit, signals.slip - signals.slip_error
        numbers = (to_sympy(v) for v in (limit.width, limit.per_slip, limit.resolution))
        within = None if limit.range is None else tuple(to_sympy(v) for v in limit.range)
        applied, *after = cut_off(commanded, states, signals.slip, reference, *numbers, within=within)
        return applied, (applied - commanded) / to_sympy(self.step), tuple(after)

    def _read(self, signals: Signals) -> tuple[Any, ...]:
        return (*signals.integrals[: len(self.law.states)], signals.slip_error, signals.slip_rate_error)

    def _of_reference(self, signals: Signals) -> list[sp.Expr]:
        """Contributions of r and r′ to z⁺ and, last, to p."""
        moves = signals.slip - signals.slip_error, signals.slip_rate - signals.slip_rate_error
        rows = self.law.of_reference or ((Fraction(0),) * 2,) * (len(self.law.states) + 1)
        return [_combined(row, moves) for row in rows]

    @classmethod
    def from_values(cls, values: "tuple[str | float | Fraction, ...]", **more: Any) -> Self:
        """Raises: a sampled law is given by its matrices."""
        raise UnsupportedError("a sampled law is given by its matrices, not by gains in order. Use LinearLaw.")

    @classmethod
    def loop_field(cls) -> LoopField:
        """Raises: a sampled law has no closed loop in continuous time."""
        raise UnsupportedError(
            "a sampled law has no closed loop in continuous time. Use the guarantee of the sampled loop."
        )


def _combined(numbers: tuple[Fraction, ...], signals: tuple[Any, ...]) -> sp.Expr:
    return sp.Add(*(to_sympy(v) * signal for v, signal in zip(numbers, signals, strict=True)))


# ----------------------------------------------------------------------
# Implicit step with an estimate of the disturbance in place of integral states; simulated and proved.
#
# The first two functions take floats, SymPy and CasADi expressions. B0 [m²/kg] is the nominal input gain. The estimate
# d [Pa] is corrected by the part of the change of e2 over the last period that T_s·B0·p does not explain. The pressure
# p [Pa] is −d plus the pressure that drives e2 to the solution w within one period.

_STATES = ("rate_error_before", "push_before", "disturbance")


def followed(rate_error: Any, before: Any, pushed: Any, estimate: Any, weight: Any, gain: Any) -> Any:
    """d + a[(e2 − e2⁻)/(T_sB0) − p⁻ − d] [Pa], the new d; `weight` is a [-] and `gain` is T_sB0 [m/(s Pa)]."""
    return estimate + weight * ((rate_error - before) / gain - pushed - estimate)


def compensating_pressure(rate_error: Any, end_rate: Any, estimate: Any, gain: Any) -> Any:
    """p = (w − e2)/(T_sB0) − d [Pa]; `end_rate` is w [m/s] and `gain` is T_sB0 [m/(s Pa)]."""
    return (end_rate - rate_error) / gain - estimate


def compensated(implicit_step: ImplicitStep, weight: Fraction, gain: Fraction) -> LinearLaw:
    """The compensated step as matrices, with the states e2⁻, T_sB0·p⁻ and T_sB0·d [m/s].

    The first sample has no predecessor and gives no information on the disturbance: there e2⁻ = e2.

    Parameters
    ----------
    implicit_step : ImplicitStep
        Gives the solution w of the step.
    weight : Fraction
        a [-], above 0 and at most 1.
    gain : Fraction
        T_sB0 [m/(s Pa)], positive.
    """
    if not 0 < weight <= 1:
        received, _ = apart(weight, Fraction(1))
        raise ParameterError(f"weight of a compensated step must be above 0 and at most 1. Received {received}.")
    require_gain(gain)
    symbols = before, pushed, estimate, _, rate_error, end_rate = sp.symbols("before pushed estimate e1 e2 w")
    share, size = to_sympy(weight), to_sympy(gain)
    level = followed(rate_error, before, pushed / size, estimate / size, share, size)
    pressure = compensating_pressure(rate_error, end_rate, level, size)
    rows = [_coefficients(expression, symbols) for expression in (rate_error, size * pressure, size * level)]
    output = _coefficients(pressure, symbols)
    return LinearLaw(
        states=_STATES,
        update=tuple(row[:3] for row in rows),
        measured=tuple(row[3:] for row in rows),
        output=output[:3],
        feedback=output[3:],
        implicit_step=implicit_step,
        first=tuple(tuple(Fraction(k == 1 == entry) for k in (0, 1)) for entry in (1, 0, 0)),
        applied=(Fraction(0), gain, Fraction(0)),
    )


def _coefficients(expression: sp.Expr, symbols: tuple[sp.Symbol, ...]) -> tuple[Fraction, ...]:
    """Coefficients of a linear expression."""
    expanded = sp.expand(expression)
    return tuple(fraction_of(sp.Rational(expanded.coeff(symbol))) for symbol in symbols)
