"""Facts about a fault: equations in LaTeX, stability regions, sampling, derived quantities.

Stability regions are in stiffness, effective normal stress and injected pressure. The sampling period is compared with
the fastest unstable pole.
"""

import cmath
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import isfinite
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import Fault, fault_toml
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.fault_toml import SAMPLES_PER_STATE_TIME, mean_rate, rate_out_of_range, sliding_step
from quakedesign.files import Json
from quakedesign.guarantees.exact.limit_theorems import longest_reaction
from quakedesign.guarantees.search.lqg import sliding_model, sliding_poles
from quakedesign.laws import Controller, Signals
from quakedesign.laws.stick_slip_law import GAIN_UNITS, StickSlipLaw
from quakedesign.plant import uncertain_plant
from quakedesign.simulation.state_plant import spring_acceleration, stretch
from quakedesign.studies.comparison import need_sentence, needed_pressure, ways
from quakedesign.symbolic import derive, plant, rate_and_state_plant
from quakedesign.symbolic.rate_and_state_plant import rate, state_symbols
from quakedesign.symbolic.stability import StabilityVerdict, nucleation_length, stability
from quakedesign.text import lasting

# ----------------------------------------------------------------------
# Equations of a fault and of its laws in LaTeX, from their expressions.

_LONG = 100  # largest number of digits of numerators and denominators; longer ones are written as decimals


def plant_latex(fault: Fault) -> list[str]:
    """Plant of a fault, and its friction law."""
    return _latex(fault)


def _at_rest(fault: Fault) -> list[str]:
    friction = plant.mu(plant.x1, plant.x2)
    acceleration = plant.shifted_acceleration().subs(friction, sp.Symbol("mu"))
    law = sp.sympify(fault.friction.symbolic().coefficient(plant.x1, plant.x2))
    motion = rf"\dot x_1 = x_2, \qquad \dot x_2 = {sp.latex(acceleration)}"
    return [motion, rf"\mu = {sp.latex(law)}"]


def _with_state(fault: Fault) -> list[str]:
    states = state_symbols(fault.friction.state_names)
    law, mu, named = fault.friction.symbolic(), sp.Symbol("mu"), {stretch: sp.Symbol("s", real=True)}
    acceleration = spring_acceleration().replace(plant.mu, lambda *_: mu).subs(named)
    moved = zip(states, law.state_rates(plant.x1, rate, *states), strict=True)
    return [
        rf"\dot x_1 = v, \qquad \dot s = -v, \qquad \dot v = {sp.latex(acceleration)}",
        rf"\mu = {sp.latex(sp.sympify(law.coefficient(plant.x1, rate, *states)))}",
        *(rf"\dot {{{sp.latex(state)}}} = {sp.latex(sp.sympify(change))}" for state, change in moved),
    ]


_latex = by_equilibrium(rest=_at_rest, sliding=_with_state)


def law_latex(law: Controller | None) -> list[str]:
    """Pressure of a law while the fault moves and rates of its states, in four digits; empty without a law."""
    if law is None:
        return []
    law = law.while_moving
    states = sp.symbols([f"z_{i}" for i in range(1, len(law.integral_units) + 1)], real=True)
    signals = Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.e1,
        slip_rate_error=plant.e2,
        integrals=tuple(states),
        reference_acceleration=plant.reference(plant.t).diff(plant.t, 2),
    )
    rates = zip(states, law.integral_rates(signals), strict=True)
    named = [("p", law.pressure(signals)), *((rf"\dot {{{z}}}", rate) for z, rate in rates)]
    return [f"{name} = {_written(expression)}" for name, expression in named]


def stick_slip_latex(law: StickSlipLaw, step: float) -> list[str]:
    """Difference equations of a `StickSlipLaw` at the sample k, in four digits.

    Parameters
    ----------
    law : StickSlipLaw
        A law with an implicit step must be deadbeat, so that its target slip rate is linear.
    step : float
        T_s [s].
    """
    number = {name: _number(float(getattr(law, name))) for name in GAIN_UNITS}
    period, half = _number(step), _number(step / 2)
    rest = f" - {number['rest_slip']}" if law.rest_slip else ""
    return [
        rf"i_k = x_k - x_{{k-1}} - {half}\,(y_{{k-1}} + v^+_{{k-1}}), \quad T_s = {period}",
        rf"i_k \leftarrow \max(i_k, -{half}\,v^+_{{k-1}}{rest}) \text{{ if }} y_k = 0",
        rf"D_k = D_{{k-1}} + {number['level_gain']}\,(y_k - v^+_{{k-1}}) + {number['slip_gain']}\,i_k",
        rf"v_k = r'_k - {number['return_rate']}\,(x_k - r_k), \quad v^+_k = \max(v_k, 0)",
        rf"p_k = -{number['rate_gain']}\,y_k + {number['target_gain']}\,v_k - D_k",
    ]


def _number(value: float) -> str:
    """LaTeX of a number in four digits."""
    digits, _, power = f"{value:.4g}".partition("e")
    return rf"{digits} \cdot 10^{{{int(power)}}}" if power else digits


def _written(expression: Any) -> str:
    """LaTeX of an expression, with long numbers rounded to four digits."""
    sums = sp.expand(sp.sympify(expression))
    numbers = {part for part in sums.atoms(sp.Pow) if part.is_number}
    numbers |= {n for n in sums.atoms(sp.Rational) if max(abs(n.p), n.q) > _LONG}
    short = sums.xreplace({number: number.evalf(4) for number in numbers})
    whole = sp.Add(
        *(sp.Mul(*(f.evalf(4) if f.is_Float else f for f in sp.Mul.make_args(t))) for t in sp.Add.make_args(short))
    )
    return str(sp.latex(whole))


# ----------------------------------------------------------------------
# Stability regions of a fault: stiffness, effective normal stress and injected pressure.

_GRID = 240

Function = Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Plane:
    """Stability in the plane of stiffness and a quantity that determines the effective stress."""

    across: np.ndarray  # Values of this quantity [Pa], shape (points,)
    stable: np.ndarray  # Shape (stiffnesses, points)
    critical: np.ndarray  # Critical stiffness per area [Pa/m], shape (points,); nan where none exists
    limits: tuple[float, ...]  # Values at which damping alone decides [Pa]; nan outside the plane
    own: float  # Value of the fault [Pa]


@dataclass(frozen=True, kw_only=True)
class StabilityRegions:
    """Stable and unstable regions around a fault; only the verdict on the fault itself is exact."""

    verdict: StabilityVerdict  # Verdict on the fault itself
    stiffness: np.ndarray  # Stiffnesses per area of both planes [Pa/m]
    own: float  # Stiffness per area of the fault [Pa/m]
    # Critical stiffness per area at the fault's effective stress [Pa/m]; not positive or nan where there is none
    critical: float
    nucleation_length: float | None  # [m]; None without a critical stiffness
    # over_stress, over_pressure: The effective normal stress σ' varies at the given pressure, or the pressure at the
    # fault's σ'
    over_stress: Plane
    over_pressure: Plane


def stability_regions(fault: Fault, *, pressure: float, loading_rate: float | None, inertia: bool) -> StabilityRegions:
    """Regions from the symbolic stability conditions; the arguments and errors are those of `stability`."""
    verdict = stability(fault, pressure=pressure, loading_rate=loading_rate, inertia=inertia)
    rate = float(verdict.loading_rate)
    conditions, boundary, limits = _functions(fault, rate, inertia)
    normal, own = fault.effective_normal_stress, fault.stiffness / fault.area
    critical = float(boundary(normal - pressure))
    top = 2 * max(own, critical if np.isfinite(critical) else own)
    stiffness = np.linspace(top / _GRID, top, _GRID)
    stresses = np.linspace(max(pressure, 0), max(2 * normal, normal + pressure), _GRID + 1)[1:]
    pressures = np.linspace(-normal, normal, _GRID + 1)[:-1]

    def plane(across: np.ndarray, effective: np.ndarray, at: float) -> Plane:
        S, K = np.meshgrid(effective, stiffness)
        order = np.argsort(effective)
        places = (np.interp(x, effective[order], across[order], left=np.nan, right=np.nan) for x in limits)
        return Plane(
            across=across,
            stable=np.min([np.sign(c(S, K) + 0 * S) for c in conditions], axis=0) > 0,
            critical=boundary(effective),
            limits=tuple(map(float, places)),
            own=at,
        )

    return StabilityRegions(
        verdict=verdict,
        stiffness=stiffness,
        own=own,
        critical=critical,
        nucleation_length=nucleation_length(fault, pressure=pressure, loading_rate=rate or None)
        if 0 < critical < np.inf
        else None,
        over_stress=plane(stresses, stresses - pressure, normal),
        over_pressure=plane(pressures, normal - pressures, pressure),
    )


def _functions(fault: Fault, rate: float, inertia: bool) -> tuple[list[Function], Function, list[float]]:
    """Boundaries of the regions, from the symbolic conditions.

    The conditions as functions of effective stress [Pa] and stiffness per area [Pa/m], the critical stiffness as a
    function of effective stress, and the effective stresses at which a condition without stiffness is zero.
    """
    law = fault.friction
    at = sp.Rational(str(rational(rate)))
    values = {s: v for s, v in plant.plant_values(fault).items() if s not in (plant.k_hat, plant.sigma)}
    slopes = rate_and_state_plant.slopes(law.exact(), at)
    stress, per_area = rate_and_state_plant.effective_stress, sp.Symbol("K", positive=True)
    per_stiffness = {plant.k_hat: per_area * values[plant.N_hat]}
    numeric = [
        c.subs(slopes).subs(values).subs(per_stiffness)
        for c in rate_and_state_plant.stability_conditions(law.state_names, inertia=inertia)
    ]
    conditions = [sp.lambdify((stress, per_area), sp.N(c)) for c in numeric]
    fixed = [sp.Poly(c, stress) for c in numeric if stress in c.free_symbols and per_area not in c.free_symbols]
    limits = [float(sp.re(r)) for c in fixed for r in c.nroots() if sp.im(r) == 0 and sp.re(r) > 0]
    try:
        critical = rate_and_state_plant.critical_stiffness(law.symbolic(), inertia=inertia) / plant.N_hat
    except UnsupportedError:
        return conditions, lambda s: np.full(np.shape(s), np.nan), limits
    numbers = {**law.values(), **values, rate_and_state_plant.loading_rate: at, plant.sigma: stress, plant.p: 0}
    function = sp.lambdify(stress, sp.N(critical.subs(numbers)))
    return conditions, lambda s: function(s) + 0 * np.asarray(s, dtype=float), limits


# ----------------------------------------------------------------------
# Whether the sampling of a fault is fast enough for its instability.

LARGEST_PRODUCT = 0.2
"""Largest adequate product of T_s and the unstable pole: an error grows by at most 22 % between two samples, and
e-fold over five."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingAdequacy:
    """Sampling time of a fault compared with its fastest unstable pole."""

    step: float  # T_s [s]
    pole: float  # Modulus of the fastest unstable pole [1/s]; 0 if there is none
    # Whether `pole` is the fastest over the uncertainty box, at any pressure that equilibrium along the reference may
    # need there; if not, it is that of the nominal fault at its operating point: at rest, or for friction with one
    # state in slow sliding at the mean rate of the task
    over_box: bool

    @property
    def pole_times_step(self) -> float:
        """T_s times the pole [-]: logarithm of the growth factor of an error between two samples."""
        return self.pole * self.step

    @property
    def adequate(self) -> bool:
        """Whether `pole_times_step` is at most 1/5."""
        return self.pole_times_step <= LARGEST_PRODUCT

    @property
    def adequate_step(self) -> float | None:
        """Largest adequate T_s [s]; None if every T_s is adequate."""
        return LARGEST_PRODUCT / self.pole if self.pole else None

    def to_dict(self) -> Json:
        """Keys of ``--json``, with the pole [1/s], the limit [-] and the largest adequate step [s]."""
        return {
            "step": self.step,
            "pole": self.pole,
            "over_box": self.over_box,
            "pole_times_step": self.pole_times_step,
            "limit": LARGEST_PRODUCT,
            "adequate": self.adequate,
            "adequate_step": self.adequate_step,
        }


@lru_cache(maxsize=64)
def sampling_adequacy(fault: Fault) -> SamplingAdequacy:
    """Compare a fault's sampling time with its fastest unstable pole.

    This is a rule of thumb, roughly a necessary condition: a sampled law responds to an event between two samples only
    after its effect has grown by a factor of up to e^{pT_s}, p the pole. It is no proof; the largest step of a given
    law is certified separately.
    """
    try:
        poles, over_box = _box_poles(fault), True
    except ParameterError:
        one = len(fault.friction.state_names) == 1
        poles, over_box = [*(sliding_poles(sliding_model(fault)) if one else derive(fault).eigenvalues)], False
    pole = max((abs(z) for z in poles if z.real > 0), default=0.0)
    return SamplingAdequacy(step=fault.sampling_time, pole=pole, over_box=over_box)


def _box_poles(fault: Fault) -> list[complex]:
    """Poles [1/s] of λ² + wλ − s at the corners: real ones increase with s and decrease with w; for others |λ|² = −s.

    Raises
    ------
    ParameterError
        When s has no finite range, or friction has a state.
    """
    fault.require_memoryless("the range of unstable poles")
    task = uncertain_plant(fault)
    poles = []
    for slope in map(float, task.slip_chord):
        for damping in map(float, task.rate_chord):
            root = cmath.sqrt(damping**2 + 4 * slope)
            poles += [(-damping + root) / 2, (-damping - root) / 2]
    return poles


# ----------------------------------------------------------------------
# Facts about a fault, in numbers and in sentences.

SHEAR_SPEEDS = 500.0, 6000.0  # shear-wave speeds of soft sediments and of the mantle, m/s
IN_A_LABORATORY = 10.0  # m; a shorter fault need not be rock


def fault_dict(fault: Fault) -> Json:
    """Keys of ``fault --json``; SI, eigenvalues as [real, imaginary] in 1/s.

    ``equilibrium_pressure`` is the range [Pa] that the task needs, and ``needs`` says whether this is withdrawal,
    injection or both. ``assumed`` lists values that the file omits, ``scenario`` is the whole fault as a TOML file.
    """
    model, needed = derive(fault), needed_pressure(fault)
    return {
        "name": fault.name,
        "source": fault.source,
        "assumed": list(fault.assumed),
        "natural_frequency": fault.natural_frequency,
        "damping_ratio": fault.damping_ratio,
        "seismic_moment": _finite(fault.seismic_moment) or None,
        "magnitude": _finite(fault.magnitude),
        "rest_slip": _finite(fault.rest_slip),
        "unstable": model.unstable,
        "reasons": list(model.reasons),
        "eigenvalues": [[z.real, z.imag] for z in model.eigenvalues],
        "mass": fault.mass,
        "area": fault.area,
        "stiffness": fault.stiffness,
        "authority": fault.authority,
        "specific_stiffness": fault.specific_stiffness,
        "specific_damping": fault.specific_damping,
        "uncertainty_box": fault.box.name,
        "sampling": sampling_adequacy(fault).to_dict(),
        "equilibrium_pressure": [float(needed.low), float(needed.high)] if needed else None,
        "needs": list(ways(needed)) if needed else None,
        "scenario": fault_toml(fault),
    }


def fault_sentences(fault: Fault) -> list[str]:
    """The same facts as sentences."""
    model = derive(fault)
    poles = ", ".join(f"{z.real:.4g}{z.imag:+.4g}i" if z.imag else f"{z.real:.4g}" for z in model.eigenvalues)
    mean, about = mean_rate(fault.reference), fault.friction.equilibrium.poles
    state = "unstable: " + "; ".join(model.reasons) if model.unstable else "stable without control"
    return [
        f"mass {fault.mass:.4g} kg, stiffness {fault.stiffness:.4g} N/m, natural frequency "
        f"{fault.natural_frequency:.4g} rad/s, damping ratio {fault.damping_ratio:.4g}",
        *_material_lines(fault),
        *_event(fault),
        *(f"assumed: {assumption}" for assumption in fault.assumed),
        f"{state}; eigenvalues {poles} 1/s{about.format(fault.friction.operating_rate)}",
        f"{sampling_sentence(sampling_adequacy(fault))}{about and '; the pole is that'}{about.format(mean)}",
        *_of_sliding(fault),
        *beyond_control(fault),
        *([need_sentence(needed)] if (needed := needed_pressure(fault)) else []),
    ]


def beyond_rest(fault: Fault) -> str:
    """Remark on a target more than one percent beyond the next rest slip; empty for other targets."""
    if not 0 < 1.01 * fault.rest_slip < fault.reference.target_slip:
        return ""
    return f", {fault.reference.target_slip / fault.rest_slip:.3g} times the rest slip: it needs a sustained pressure"


def sampling_sentence(adequacy: SamplingAdequacy) -> str:
    """Whether T_s is short enough for the instability, and the largest adequate T_s."""
    if adequacy.adequate_step is None:
        return f"T_s = {adequacy.step:.4g} s: no unstable pole limits it"
    pole = f"at most {UpperBound(adequacy.pole):.4g}" if adequacy.over_box else f"{adequacy.pole:.4g}"
    where = "over the uncertainty box" if adequacy.over_box else "of the nominal fault"
    longest = LowerBound(Fraction(adequacy.adequate_step)).quantity("s")
    judged = "is adequate" if adequacy.adequate else "is TOO LONG by a rule of thumb for the unstable pole"
    return (
        f"T_s = {adequacy.step:.4g} s {judged}: T_s times the unstable pole, {pole} 1/s {where}, is "
        f"{adequacy.pole_times_step:.3g}; the limit is {LARGEST_PRODUCT:g} (T_s = {longest})"
        f"{'' if adequacy.adequate else '; the command guarantee may still find a proof at this T_s'}"
    )


def _sliding_sentence(fault: Fault) -> list[str]:
    """Extrapolation of friction, and the T_s of a guarantee of slow sliding if it differs by a factor of two."""
    beyond = list(filter(None, [rate_out_of_range(fault.friction, mean_rate(fault.reference))]))
    suits = sliding_step(fault.friction, fault.reference)
    if suits / 2 <= fault.sampling_time <= 2 * suits:
        return beyond
    return [
        *beyond,
        f"for a guarantee of slow sliding choose sampling_time near D_c/({SAMPLES_PER_STATE_TIME:g} V) = {suits:g} s",
    ]


_of_sliding = by_equilibrium(rest=lambda fault: [], sliding=_sliding_sentence)


def beyond_control(fault: Fault) -> list[str]:
    """Statement that no controller can stabilise a fault at its T_s, if this is proved."""
    try:
        task = uncertain_plant(fault)
        longest = longest_reaction(task, task.normal_stress)
    except (ParameterError, UnsupportedError):  # friction with a state, or friction without a proof
        return []
    if longest is None or rational(fault.sampling_time) <= longest:
        return []
    return [
        f"NO CONTROLLER can stabilise this fault at T_s = {fault.sampling_time:.4g} s for every friction law of its "
        f"box and every disturbance within its amplitude: T_s must not exceed {longest.quantity('s')}, even for a "
        "withdrawal as large as the effective normal stress"
    ]


def _finite(value: float) -> float | None:
    """A number if it is finite, else None."""
    return value if isfinite(value) else None


def _material_lines(fault: Fault) -> list[str]:
    """Shear-wave speed, which reveals a wrong unit, the stress, friction as it was read, and its box."""
    speed, law = (fault.shear_modulus / fault.density) ** 0.5, fault.friction
    usual = fault.length < IN_A_LABORATORY or SHEAR_SPEEDS[0] <= speed <= SHEAR_SPEEDS[1]
    unlikely = "" if usual else " (UNLIKELY for rock: check density and shear modulus)"
    stress = LowerBound(rational(fault.effective_normal_stress)).quantity("Pa")
    numbers = ", ".join(
        f"{name} {getattr(law, name):.4g} {field.metadata['unit']}".strip() for name, field in law.quantities().items()
    )
    material = f"shear waves {speed:.4g} m/s{unlikely}, effective normal stress {stress}"
    return [f"{material}, friction {law.name}: {numbers}", *box_sentences(fault)]


def box_sentence(fault: Fault) -> str:
    """Parameters, and friction laws without a state, that a guarantee covers; numbers are rounded inward."""
    law = fault.friction
    low, high = UpperBound(rational(law.bounds[0])), LowerBound(rational(law.bounds[1]))
    slopes = [f"{LowerBound(rational(law.slip_slope)):.4g} per m of slip"] * (law.slip_slope > 0)
    slopes += [f"{LowerBound(rational(law.rate_slope)):.4g} per m/s"] * (law.rate_slope > 0)
    parts = {"stiffness": "stiffness", "damping": "damping", "authority": "area per mass"}
    widths = {part: LowerBound(100 * getattr(fault.box, name)) for name, part in parts.items()}
    off = [f"{part} within {width:.4g} %" for part, width in widths.items() if width]
    friction = f"every friction from {low:.4g} to {high:.4g} that changes by at most {', '.join(slopes)}"
    exact = "stiffness, damping and area per mass are exact"
    return f"box {fault.box.name}: {friction}; {', '.join(off) or exact}"


box_sentences = by_equilibrium(rest=lambda fault: [box_sentence(fault)], sliding=lambda fault: [])


def _event(fault: Fault) -> list[str]:
    """Earthquake of the fault, as far as it is known without a simulation, and the task."""
    task = f"target slip {fault.reference.target_slip:.4g} m in {lasting(fault.reference.operation_time, 6)}"
    return _earthquake(fault, task)


_HISTORY = "stress drop, magnitude and slip of an event depend on its history: simulate a cycle (simulate --start late)"


def _natural_earthquake(fault: Fault, task: str) -> list[str]:
    moment = f"seismic moment {fault.seismic_moment:.4g} N·m, magnitude {fault.magnitude:.2f}"
    return [
        moment if fault.seismic_moment > 0 else "no earthquake, so no seismic moment and no magnitude",
        f"the uncontrolled earthquake slips {fault.rest_slip:.4g} m (next rest slip), {task}{beyond_rest(fault)}",
    ]


_earthquake = by_equilibrium(rest=_natural_earthquake, sliding=lambda fault, task: [_HISTORY, task])
