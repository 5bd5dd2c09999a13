"""What gains can be best in: an order of levels, what a level asks of a loop, the proof and the figure at the end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import ClassVar

from quakedesign.certificates import Certificate, Loop
from quakedesign.certificates.obligations import Obligations
from quakedesign.controllers import Subject
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.synthesis.analysis.margins import largest_gain_range
from quakedesign.synthesis.analysis.settling_time import fastest_settling
from quakedesign.synthesis.gains.dilation import scaled_norm
from quakedesign.synthesis.gains.pace import box, degrees_of, fastest, least_margins, on_box, rounded
from quakedesign.synthesis.gains.path_following import look
from quakedesign.synthesis.gains.setting import FAINT, Objective, Setting, State
from quakedesign.synthesis.lyapunov.balancing import balance, below
from quakedesign.synthesis.lyapunov.certify_exactly import finish
from quakedesign.synthesis.lyapunov.claimed_rates import GIVE_AWAY, bounds_of, with_largest_decay

_HALVINGS = 8
_BITS = (16, 24, 34)


@dataclass(frozen=True, kw_only=True)
class SmallestNorm(Objective):
    """Smallest ‖k_i/L̄^{p_i}‖₂, p_i from homogeneity: (k1L̄^{−2/3}, k2L̄^{−1/2}, k3/L̄, k4/L̄) for the 2-CTA."""

    name: ClassVar[str] = "norm"
    unit: ClassVar[str] = "-"
    meaning: ClassVar[str] = "norm of the gains, scaled to a bound of one on |h'|"
    larger: ClassVar[bool] = False
    bounded: ClassVar[bool] = False

    def norm_bound(self, level: float) -> float | None:
        """The level itself."""
        return level

    def reached(self, level: float, loop: Loop, exponents: Mapping[str, Fraction]) -> float:
        """Norm of the gains."""
        return scaled_norm(loop, exponents)

    def start(self, setting: Setting, loop: Loop) -> State | None:
        """State at the gains."""
        return look(setting, loop, scaled_norm(loop, setting.exponents), least=FAINT)

    def figure(self, certificate: Certificate, setting: Setting) -> float:
        """Norm of the gains."""
        return scaled_norm(certificate.loop, setting.exponents)


@dataclass(frozen=True, kw_only=True)
class LargestDecay(Objective):
    """Largest κ in V̇ ≤ −κV^{n/m}, told as one over the settling time T = m/((m−n)κ)·C^{(m−n)/m} that it certifies.

    T holds for all starts |e_i| ≤ L̄, where V ≤ C. κ alone would compare neither two V, which may be multiplied by any
    number, nor two degrees m; T does. No λ changes it.
    """

    name: ClassVar[str] = "decay"
    unit: ClassVar[str] = "1/s"
    meaning: ClassVar[str] = "one over the certified settling time from where every error is at most the bound on |h'|"
    paced: ClassVar[bool] = True

    def speed(self, level: float) -> float | None:
        """The level itself."""
        return level

    def start(self, setting: Setting, loop: Loop) -> State | None:
        """State at half of what a V without a rate seems to reach, or less."""
        first = look(replace(setting, objective=SmallestNorm()), loop, scaled_norm(loop, setting.exponents))
        if first is None:
            return None
        largest = on_box(first.lyapunov, loop.states, box(loop, setting.units))
        function = rounded(first.lyapunov, _BITS[-1], largest)
        m, n = degrees_of(Obligations(loop, function))
        speed = fastest(loop, function) * (m - n) / m
        for _ in range(_HALVINGS):
            speed /= 2
            state = look(setting, loop, speed, function)
            if state is not None:
                return state
        return None

    def proved(self, setting: Setting, state: State, subject: Subject) -> Certificate | None:
        """Certificate with V of the state and the largest κ that the solver finds for it."""
        scale = balance(state.loop)
        for bits in _BITS:
            function = rounded(state.lyapunov, bits)
            positive, decrease = (GIVE_AWAY * below(t) for t in least_margins(state.loop, function, scale))
            if not (positive > 0 and decrease > 0):
                continue
            claims = {"positive": positive, "decrease": decrease, **bounds_of(state.loop, function, scale)}
            plain = finish(state.loop, function, claims, subject)
            certificate = plain and with_largest_decay(plain, scale, subject)
            if certificate:
                return certificate
        return None

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Certificate with the V of the largest margins, which is the better one where the forms w fit badly."""
        bound, beta = loop.uncertain["d"][1], loop.uncertain.get("beta", (Fraction(1), Fraction(1)))
        gains = tuple(loop.gains.values())
        settling = fastest_settling(subject, gains, lipschitz=bound, gain_range=beta, start=bound, degrees=degrees)
        return settling[0] if settling else None

    def figure(self, certificate: Certificate, setting: Setting) -> float:
        """1/T = κ·(m−n)/m·C^{−(m−n)/m} with V ≤ C where |e_i| ≤ L̄, rounded down."""
        loop = certificate.loop
        m, n = degrees_of(Obligations(loop, certificate.lyapunov))
        share = (m - n) / m
        largest = on_box(certificate.lyapunov, loop.states, box(loop, setting.units))
        return float(certificate.claims["decay"]) * share * float(largest**-share) * (1 - 1e-12)


@dataclass(frozen=True, kw_only=True)
class LargestRange(Objective):
    """Largest ρ for β ∈ [b/ρ, bρ] around the geometric middle b of the range asked for."""

    name: ClassVar[str] = "beta"
    unit: ClassVar[str] = "-"
    meaning: ClassVar[str] = "ratio of the ends of the range of β to its geometric middle"

    middle: Fraction = Fraction(1)
    first: float = 1.01

    def at(self, loop: Loop, level: float) -> Loop:
        """Loop with the range of the level."""
        ratio = Fraction(f"{level:.6g}")
        ends = (self.middle / ratio, self.middle * ratio)
        return replace(loop, uncertain={**loop.uncertain, "beta": ends})

    def start(self, setting: Setting, loop: Loop) -> State | None:
        """State with the range asked for, or a hundredth to either side."""
        return look(setting, loop, self.first, least=FAINT)

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Certificate of the largest range to four digits, in one number along which the programme is affine."""
        gains, bound = tuple(loop.gains.values()), loop.uncertain["d"][1]
        reach = largest_gain_range(
            subject, gains, lipschitz=bound, nominal=self.middle, symmetric=True, degrees=tuple(degrees)
        )
        return reach.certificate if reach.value is not None else None

    def figure(self, certificate: Certificate, setting: Setting) -> float:
        """ρ, rounded down."""
        low, high = certificate.loop.uncertain["beta"]
        return float(float(high / low) ** 0.5) * (1 - 1e-15)


_KNOWN: dict[str, type[Objective]] = {o.name: o for o in (SmallestNorm, LargestDecay, LargestRange)}
OBJECTIVES = tuple(_KNOWN)


def objective_for(name: str, loop: Loop, bound: float | None) -> Objective:
    """Objective of a name for the ranges of a loop.

    Raises
    ------
    UnknownNameError
    ParameterError
        For a bound that is missing or not positive, or a loop that is not uncertain in what the objective is about.
    """
    require_known(name, _KNOWN, "objective", UnknownNameError)
    chosen = _KNOWN[name]
    if chosen.bounded and not (bound is not None and bound > 0):
        raise ParameterError(f"the objective {name} needs a positive bound on the norm. Received {bound}. Give one.")
    make = partial(chosen, bound=bound if chosen.bounded else None)
    if chosen is not LargestRange:
        return make()
    if "beta" not in loop.uncertain:
        raise ParameterError(f"the objective {name} needs a loop with an uncertain beta. Received {loop.law}.")
    low, high = loop.uncertain["beta"]
    middle = low if low == high else Fraction(f"{float(low * high) ** 0.5:.6g}")
    return LargestRange(
        bound=bound, middle=middle, first=max(1.01, float(max(high / middle, middle / low)) * (1 + 1e-6))
    )
