"""A linear law of samples as a controller that simulations run."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, Self

import sympy as sp

from quakedesign.controllers import Controller, LoopField, Sampling, Signals
from quakedesign.errors import UnsupportedError
from quakedesign.loop.law_expressions import cut_off
from quakedesign.loop.laws import LinearLaw
from quakedesign.loop.rest_limit import RestLimit
from quakedesign.rationals import to_sympy


@dataclass(frozen=True, kw_only=True)
class SampledController(Controller):
    """p = Cz + Dy, whose states z ← Fz + Gy are those of the scheme ``explicit`` with the step T_s: ξ ← ξ + T_s·ξ′.

    Attributes
    ----------
    law : LinearLaw
    step : Fraction
        T_s [s] for which it is meant.
    delay, lag, diffusion, longest : Fraction
        As of `Sampling` [s].
    rest_limit : RestLimit, optional
        Of its pressure; its states are then told what is applied, and those of the limit follow them.
    gains : mapping of str to Fraction
        Read off the law: p = −k1·e1 − k2·e2 − Σ gain·state, every state under its name.
    """

    name: ClassVar[str] = "sampled"
    title: ClassVar[str] = "e-LQR"
    source: ClassVar[str] = "quakedesign.loop.laws"

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
        told = {part.name: getattr(self, part.name) for part in fields(self) if part.init}
        return partial(type(self), **told), ()

    @property
    def sampling(self) -> Sampling:
        """By the scheme ``explicit``, once every T_s."""
        return Sampling(step=self.step, delay=self.delay, lag=self.lag, diffusion=self.diffusion, longest=self.longest)

    @property
    def of_slip(self) -> LinearLaw | None:
        """The law, if it does without the slip rate."""
        return self.law if self.law.of_slip_alone else None

    @property
    def while_moving(self) -> "SampledController":
        """The linear law, without its limit at rest."""
        return replace(self, rest_limit=None)

    @property
    def gain_units(self) -> Mapping[str, str]:  # type: ignore[override]
        """Of a state: Pa per its own unit."""
        return {"k1": "Pa/m", "k2": "Pa s/m", **dict.fromkeys(self.law.states, "Pa")}

    @property
    def integral_units(self) -> tuple[str, ...]:  # type: ignore[override]
        """One for every state; the law's own."""
        return ("-",) * len(self.law.states) + (RestLimit.UNITS if self.rest_limit else ())

    def pressure(self, signals: Signals) -> sp.Expr:
        """Cz + Dy, at rest within the limit [Pa]."""
        return self._decided(signals)[0]

    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """(Fz + Gy − z)/T_s, of what the limit cuts off what the law makes of it besides, and of the limit's states."""
        cut, after = self._decided(signals)[1:]
        z, seen, period = signals.integrals, self._read(signals), to_sympy(self.step)
        told = self.law.applied or (Fraction(0),) * len(self.law.states)
        rows = zip(self.law.update, self.law.measured, told, z, strict=False)
        rates = [(_combined((*own, *fed), seen) - state) / period + to_sympy(h) * cut for own, fed, h, state in rows]
        return (*rates, *((new - old) / period for new, old in zip(after, z[len(rates) :], strict=True)))

    def _decided(self, signals: Signals) -> tuple[sp.Expr, sp.Expr, tuple[sp.Expr, ...]]:
        """The pressure that is applied, what that is more than is asked for, over T_s, and the limit's states after."""
        asked = _combined((*self.law.output, *self.law.feedback), self._read(signals))
        if self.rest_limit is None:
            return asked, sp.S.Zero, ()
        states = signals.integrals[len(self.law.states) :]
        limit, reference = self.rest_limit, signals.slip - signals.slip_error
        numbers = (to_sympy(v) for v in (limit.width, limit.per_slip, limit.resolution))
        within = None if limit.range is None else tuple(to_sympy(v) for v in limit.range)
        applied, *after = cut_off(asked, states, signals.slip, reference, *numbers, within=within)
        return applied, (applied - asked) / to_sympy(self.step), tuple(after)

    def _read(self, signals: Signals) -> tuple[Any, ...]:
        return (*signals.integrals[: len(self.law.states)], signals.slip_error, signals.slip_rate_error)

    @classmethod
    def from_values(cls, values: "tuple[str | float | Fraction, ...]", **more: Any) -> Self:
        """Refuse: gains in order do not make its matrices."""
        raise UnsupportedError("a sampled law is made from its matrices, not from gains in order. Use LinearLaw.")

    @classmethod
    def loop_field(cls) -> LoopField:
        """Refuse: it has no loop in continuous time."""
        raise UnsupportedError("a sampled law has no loop in continuous time. Use a guarantee of the loop that runs.")


def _combined(numbers: tuple[Fraction, ...], signals: tuple[Any, ...]) -> sp.Expr:
    return sp.Add(*(to_sympy(v) * signal for v, signal in zip(numbers, signals, strict=True)))
