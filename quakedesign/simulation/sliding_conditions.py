"""Around a fault in slow sliding: what pushes it, what its law does not know, and what the pressure goes through."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.controllers import Sampling
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.loop import Layer
from quakedesign.loop.actuators import Actuator, Delay, Diffusion, Lag, SampledStage
from quakedesign.loop.sensing import Transducer
from quakedesign.rationals import rational
from quakedesign.simulation.state_plants import SpringSlider

TIDE = 12.42 * 3600.0  # s, of the largest tide, M2
MODES = 24  # of the layer; the law has fewer
FRICTION = ("direct_effect", "evolution_effect", "critical_slip")
"""Constants of friction that a spread is about: a, b and D_c."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tide:
    """Shear stress S·sin(2πt/P + φ) on the fault, beside that of the spring; it begins with what it has at once.

    Attributes
    ----------
    amplitude : float
        S [Pa], not negative.
    period : float
        P [s], positive.
    phase : float
        φ [rad], not negative.
    """

    amplitude: float = 0.0
    period: float = 1.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        require_nonnegative(stress=self.amplitude, stress_phase=self.phase)
        require_positive(stress_period=self.period)

    def at(self, time: Any) -> Any:
        """Stress [Pa] at a time [s]."""
        return self.amplitude * np.sin(2 * math.pi / self.period * time + self.phase)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingVariation:
    """True constants of a fault over those that its law and its plan know [-], each positive.

    Attributes
    ----------
    direct_effect, evolution_effect, critical_slip : float
        Of a, b and D_c.
    normal_stress, stiffness, damping : float
        Of σ', k and η.
    """

    direct_effect: float = 1.0
    evolution_effect: float = 1.0
    critical_slip: float = 1.0
    normal_stress: float = 1.0
    stiffness: float = 1.0
    damping: float = 1.0

    def __post_init__(self) -> None:
        require_positive(**asdict(self))

    def slider(self, fault: Fault, *, inertia: bool) -> SpringSlider:
        """The true fault."""
        nominal, factors = SpringSlider.of(fault, inertia=inertia), asdict(self)
        changed = {name: getattr(nominal.law, name) * factors[name] for name in FRICTION if factors[name] != 1}
        law = replace(nominal.law, **changed) if changed else nominal.law  # type: ignore[type-var]
        plant = {name: getattr(nominal, name) * factors[name] for name in ("normal_stress", "stiffness", "damping")}
        return replace(nominal, law=law, **plant)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressurePath:
    """What a pressure goes through before it is in the fault: a pump, then a lag of pump and pipe, then rock.

    Attributes
    ----------
    lag, diffusion : Fraction
        Time constant and L²/D [s], not negative; 0 for none.
    stages : tuple of SampledStage
        What happens to it once a sample, before it is held. All but a delay see the pump's whole pressure, the planned
        one included; what is planned is known ahead, so that it is not late.
    """

    lag: Fraction = Fraction(0)
    diffusion: Fraction = Fraction(0)
    stages: tuple[SampledStage, ...] = ()

    @classmethod
    def of(cls, meant: Sampling, actuator: Actuator | None) -> "PressurePath":
        """That of an actuator; without a lag and rock in it that which a law of samples is meant for.

        Raises
        ------
        ParameterError
        """
        given = (
            Actuator.meant_for(replace(meant, lag=Fraction(0), diffusion=Fraction(0))) if actuator is None else actuator
        )
        stages, flowing = given.sampled, given.flowing
        if not flowing:
            return cls(lag=meant.lag, diffusion=meant.diffusion, stages=stages)
        if [type(stage) for stage in flowing] not in ([Lag], [Diffusion], [Lag, Diffusion]):
            raise ParameterError(
                "the pressure of slow sliding goes through a lag, rock, or both. Received "
                f"{', '.join(stage.name for stage in flowing)}. Leave out the others."
            )
        told = {stage.name: stage for stage in flowing}
        lag, rock = told.get("lag"), told.get("diffusion")
        return cls(
            stages=stages,
            lag=rational(lag.time_constant) if isinstance(lag, Lag) else Fraction(0),
            diffusion=rational(rock.time) if isinstance(rock, Diffusion) else Fraction(0),
        )

    @property
    def modes(self) -> "tuple[np.ndarray, np.ndarray]":
        """Rates λ_i [1/s] and shares c_i [-] of filters side by side, of a step 1 − Σ c_i·e^{−λ_i·t}.

        Partial fractions of those of the rock behind the lag: exact but for what 24 modes of the rock leave out. A lag
        that has the rate of a mode is taken as a billionth slower.
        """
        rock = Layer(time=self.diffusion or Fraction(1))
        found = [(float(rock.rate(i)), float(rock.share(i))) for i in range(MODES if self.diffusion else 0)]
        rates, shares = np.array(found).reshape(-1, 2).T
        if not self.lag:
            return rates, shares
        own = 1 / float(self.lag)
        own *= 1 - 1e-9 if np.any(np.abs(rates / own - 1) < 1e-9) else 1
        behind = shares * own / (own - rates)
        return np.append(rates, own), np.append(behind, 1 - sum(behind))


class Instruments:
    """A transducer and a pump between samples of one run, with their memories.

    Attributes
    ----------
    step : float
        T_s [s].
    part : float
        Share of it after which the pressure that is held changes.
    """

    def __init__(self, step: float, part: float, reading: Any, late: Any, pumped: Any) -> None:
        self.step, self.part = step, part
        self._reading, self._late, self._pumped = reading, late, pumped

    @classmethod
    def of(cls, path: PressurePath, transducer: Transducer | None, step: float) -> "Instruments":
        """Before the first sample."""
        late = [stage for stage in path.stages if isinstance(stage, Delay)]
        others = [stage for stage in path.stages if not isinstance(stage, Delay)]
        stages = (_remembering(_held(s, step)) for s in (late, others))
        return cls(step, Actuator(stages=path.stages).part, _remembering(_read(transducer, step)), *stages)

    def read(self, slip: float) -> float:
        """Slip [m] that is told."""
        return float(self._reading(slip))

    def pump(self, asked: float, planned: float) -> float:
        """Pressure [Pa] beside a planned one that is held, of what is asked for beside it."""
        return float(self._pumped(float(self._late(asked)) + planned)) - planned

    def sections(self, now: float, before: float, after: float) -> list[tuple[float, float, float]]:
        """Starts and lengths [s] between a sample and the next of what is held, with the pressures."""
        late = self.part * self.step
        return [(now, late, before)] * (late > 0) + [(now + late, self.step - late, after)]


def _read(transducer: Transducer | None, step: float) -> Any:
    """CasADi Function (memory, slip) → reading, memory, and the memory at first; None without a transducer."""
    if transducer is None:
        return None
    memory, slip = ca.SX.sym("memory", len(transducer.start)), ca.SX.sym("slip")
    seen, after = transducer.pass_on([*map(ca.SX, transducer.numbers(step))], ca.vertsplit(memory), slip)
    return ca.Function("reading", [memory, slip], [seen, ca.vertcat(*after)]), transducer.start


def _held(stages: Sequence[SampledStage], step: float) -> Any:
    """The same of a pressure and what is held of it; None without stages."""
    if not stages:
        return None
    chain, start = Actuator(stages=tuple(stages)), tuple(v for stage in stages for v in stage.start)
    numbers = [ca.SX(v) for stage in stages for v in stage.numbers]
    memory, asked = ca.SX.sym("memory", len(start)), ca.SX.sym("asked")
    held, _, after = chain.hold(numbers, ca.vertsplit(memory), asked, step)
    return ca.Function("held", [memory, asked], [held, ca.vertcat(*after)]), start


def _remembering(element: Any) -> Any:
    """Number → number of such a Function, which keeps its memory; as it is without one."""
    if element is None:
        return float
    function, start = element
    memory = [ca.DM(start)]

    def passed_on(value: float) -> Any:
        found, memory[0] = function(memory[0], value)
        return found

    return passed_on
