"""Around a fault in slow sliding: what pushes it, what its law does not know, and what the pressure goes through."""

import math
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from quakedesign.controllers import Sampling
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.loop import Layer
from quakedesign.loop.actuators import Actuator, Diffusion, Lag
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
    """What a held pressure goes through before it is in the fault: a lag of pump and pipe, then rock.

    Attributes
    ----------
    lag, diffusion : Fraction
        Time constant and L²/D [s], not negative; 0 for none.
    """

    lag: Fraction = Fraction(0)
    diffusion: Fraction = Fraction(0)

    @classmethod
    def of(cls, meant: Sampling, actuator: Actuator | None) -> "PressurePath":
        """That of an actuator of these two stages, or, without one, that which a law of samples is meant for.

        Raises
        ------
        ParameterError
        """
        if actuator is None or not actuator.stages:
            return cls(lag=meant.lag, diffusion=meant.diffusion)
        kinds = [type(stage) for stage in actuator.stages]
        if kinds not in ([Lag], [Diffusion], [Lag, Diffusion]):
            raise ParameterError(
                "the pressure of slow sliding goes through a lag, rock, or both. Received "
                f"{', '.join(stage.name for stage in actuator.stages)}. Leave out the others."
            )
        told = {stage.name: stage for stage in actuator.stages}
        lag, rock = told.get("lag"), told.get("diffusion")
        return cls(
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
