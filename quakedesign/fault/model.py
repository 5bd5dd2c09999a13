"""Spring-slider model of one fault: parameters, reference, disturbance, uncertainty box.

All values are in SI units. Chapters: uncertainty box, rest slip after an uncontrolled event, checks of physical values,
reference slip (eq. ref of the paper), disturbance, and the class `Fault` (eq. springmodel).
"""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import field, fields, replace
from fractions import Fraction
from functools import cached_property
from math import inf, nextafter
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, TypeVar

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import (
    ParameterError,
    QuakedesignError,
    ScenarioError,
    UnitError,
    UnknownNameError,
    require_known,
)
from quakedesign.exact import rational
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.units import quantity, si_value
from quakedesign.text import shown

if TYPE_CHECKING:
    import sympy as sp


# ----------------------------------------------------------------------
# Uncertainty box: largest deviations of the real fault from the nominal one.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBox:
    """Relative half-widths of the plant's parameters; friction is uncertain in every box.

    In every box slip ≥ 0, μ_res ≤ μ ≤ μ_max, and no chord of μ over slip is steeper than the steepest one of the law.

    Attributes
    ----------
    name : str
    stiffness, damping, authority : Fraction
        Half-widths of k̂ = k/m, η̂ = η/m and N̂ = A/m relative to their nominal values [-], in [0, 1).

    Raises
    ------
    ParameterError
        When a half-width is not in [0, 1).
    """

    name: str
    stiffness: Fraction = field(default=Fraction(0), metadata=quantity("", 0.1, text="of k/m"))
    damping: Fraction = field(default=Fraction(0), metadata=quantity("", 0.1, text="of η/m"))
    authority: Fraction = field(default=Fraction(0), metadata=quantity("", 0.1, text="of A/m, the area per mass"))

    def __post_init__(self) -> None:
        for part in ("stiffness", "damping", "authority"):
            if not 0 <= getattr(self, part) < 1:
                raise ParameterError(
                    f"{part} of the uncertainty box must be in [0, 1). Received {getattr(self, part)}. "
                    "Ten percent is 0.1."
                )


BOXES = {
    box.name: box
    for box in (
        UncertaintyBox(name="paper"),
        UncertaintyBox(
            name="ten-percent", stiffness=Fraction(1, 10), damping=Fraction(1, 10), authority=Fraction(1, 10)
        ),
    )
}


def uncertainty_box(name: str) -> UncertaintyBox:
    """Box ``paper`` (only friction uncertain) or ``ten-percent`` (also ±10 % on k̂, η̂, N̂); else `UnknownNameError`."""
    require_known(name, BOXES, "uncertainty box", UnknownNameError)
    return BOXES[name]


# ----------------------------------------------------------------------
# Rest slip: slip at which a fault that starts to slip comes to rest.

_SCAN = 4096
_DIGITS = 40  # cancellation: the excess of a barely unstable fault is a small difference


_strength_drop = by_equilibrium(rest=lambda law: law.bounds[1] - law.bounds[0], sliding=lambda law: math.nan)


def rest_slip(friction: FrictionLaw, load: float, stiffness: float) -> float:
    """Smallest positive slip [m] at which the excess of load over strength changes from positive to negative.

    The excess is (μ(0) − μ(x))σ'_n A − kx at zero pressure (statics of eq. shift), for a load σ'_n A [N] and a
    stiffness k [N/m]. All roots lie below (μ_max − μ_min)σ'_n A/k. The result is 0 for a fault with a stable origin,
    and nan for friction with a state, which has no fixed strength at rest.
    """
    furthest = float(_strength_drop(friction)) * load / stiffness * 1.0001
    if not furthest > 0:
        return furthest
    import mpmath
    import sympy as sp

    x = sp.Symbol("x", nonnegative=True)
    law = friction.exact().coefficient
    excess = law(sp.Integer(0), 0) - law(x, 0) - stiffness / load * x
    drive, drive_in_floats = (sp.lambdify(x, excess, module) for module in ("mpmath", "math"))
    try:
        ends = _bracket(drive_in_floats, furthest)
    except (NameError, ArithmeticError, ValueError):  # a function that `math` lacks, or float overflow
        ends = _bracket(drive, furthest)
    if ends is None:
        return 0.0
    with mpmath.workdps(_DIGITS):
        return float(mpmath.findroot(drive, ends, solver="anderson", tol=1e-60, maxsteps=100, verify=False))


def _bracket(drive: Callable[[float], float], furthest: float) -> tuple[float, float] | None:
    """Slips [m] that bracket the sign change of an excess; None if the excess is not positive near slip 0."""
    grid = [furthest * i / _SCAN for i in range(_SCAN + 1)]
    if drive(grid[1] / _SCAN) <= 0:
        return None
    after = next(i for i, slip in enumerate(grid) if i and drive(slip) <= 0)
    return grid[after - 1] if after > 1 else grid[1] / _SCAN, grid[after]


# ----------------------------------------------------------------------
# Checks of physical values, shared by the types of this package.

MOST_WORKERS = 256
"""Largest number of processes of one command."""

_Value = TypeVar("_Value")
_LARGEST = 1e40
_NAME = re.compile(r"\w[\w .-]{0,59}")
_MOST_BYTES = 120  # the name is part of file names, which systems limit to 255 bytes


class Problems:
    """Errors of one input, collected so that one exception reports all of them."""

    def __init__(self) -> None:
        self.errors: list[QuakedesignError] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Collect a `QuakedesignError` of the ``with`` block instead of propagating it."""
        try:
            yield
        except QuakedesignError as error:
            self.errors += error.parts or (error,)

    def raise_collected(self, where: str = "") -> None:
        """Raise the collected errors, if any, as one exception, whose message starts with `where` and numbers them."""
        if not self.errors:
            return
        kinds = {type(error) for error in self.errors}
        kind = kinds.pop() if len(kinds) == 1 else ScenarioError
        messages = [str(error) for error in self.errors]
        if len(messages) > 1:
            messages = [f"{len(messages)} errors.", *(f"({i}) {text}" for i, text in enumerate(messages, start=1))]
        error = kind(f"{where}: {' '.join(messages)}" if where else " ".join(messages))
        error.parts = tuple(self.errors) if len(messages) > 1 else ()
        raise error from None

    def resolved(self, value: _Value | None, where: str = "") -> _Value:
        """Raise the collected errors, see `raise_collected`, or return the value; None only if there are errors."""
        self.raise_collected(where)
        assert value is not None
        return value


def require_all(*checks: Callable[[], None]) -> None:
    """Run every check, and raise all errors as one exception."""
    problems = Problems()
    for check in checks:
        with problems.collected():
            check()
    problems.raise_collected()


def require_positive(remedy: str = "", **values: float | Fraction) -> None:
    """Raise unless all values are positive and finite; keywords are their names in the message."""
    _require(values, lambda v: v > 0, "positive and finite", remedy)


def require_nonnegative(remedy: str = "", **values: float) -> None:
    """Raise unless all values are finite and at least 0."""
    _require(values, lambda v: v >= 0, "zero or positive, and finite", remedy)


def require_finite(remedy: str = "", **values: float) -> None:
    """Raise unless all values are finite numbers."""
    _require(values, lambda v: True, "finite", remedy)


def is_ordinary(size: float | Fraction, least: float = 1 / _LARGEST) -> bool:
    """Whether a positive number is from `least` to 1e40, the range of physical values in SI units."""
    return least <= size <= _LARGEST


def require_ordinary(least: float = 1 / _LARGEST, **values: float | Fraction) -> None:
    """Raise unless each value is 0 or of a size from `least` to 1e40, so that products of values do not overflow."""
    problems = Problems()
    for name, value in values.items():
        with problems.collected():
            if value and not is_ordinary(max(value, -value), least):
                raise ParameterError(
                    f"{name} must have a magnitude between {least:g} and {_LARGEST:g} in SI units. "
                    f"Received {shown(value)}. Check its unit."
                )
    problems.raise_collected()


def require_count(most: int, **values: int) -> None:
    """Raise unless all values are whole numbers from 1 to `most`."""
    for name, value in values.items():
        if not isinstance(value, Integral) or isinstance(value, bool) or not 1 <= value <= most:
            raise ParameterError(f"{name} must be a whole number from 1 to {most}. Received {shown(value)}.")


def _require(values: dict[str, Any], condition: Callable[[Any], bool], what: str, remedy: str) -> None:
    problems = Problems()
    for name, value in values.items():
        with problems.collected():
            if not isinstance(value, Real) or isinstance(value, bool):
                raise ParameterError(f"{name} must be a number in SI units, {what}. Received {shown(value)}.")
            if not (is_finite(value) and condition(value)):
                raise ParameterError(f"{name} must be {what}. Received {shown(value)} (SI units). {remedy}".strip())
    problems.raise_collected()


def is_finite(value: Real | float) -> bool:
    """Whether a number is finite as a float."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def require_name(name: str) -> None:
    """Raise for a name that is not a valid part of a file name on every system."""
    if not isinstance(name, str) or not _NAME.fullmatch(name) or len(name.encode()) > _MOST_BYTES:
        raise ParameterError(
            "name must be a string of at most 60 letters, digits, spaces and _ . - (120 bytes in UTF-8), beginning "
            f"with a letter or digit. Received {shown(name)}."
        )


# ----------------------------------------------------------------------
# Reference slip of the controller.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """Smooth slip r(t) from rest to rest, constant at its final value for t > operation_time (ERRATA 26).

    Raises `ParameterError` for values outside the ranges below.

    Attributes
    ----------
    target_slip : float
        d_max [m], positive.
    operation_time : float
        t_op [s], positive.
    ramp : float, optional
        Rate-and-state friction: fraction of the slip that follows a smooth ramp, above 0 and below 1. The rest is
        released at a constant rate.
    """

    target_slip: float = field(metadata=quantity("m", "5 cm", "the next rest slip", symbol="d_{max}"))
    operation_time: float = field(
        metadata=quantity("s", "2 days", "about as many natural periods as for the paper's faults", symbol="t_{op}")
    )
    ramp: float | None = field(
        default=None,
        metadata=quantity("", 0.1, "all of it at a constant rate", symbol=r"\lambda_r", directed_unit="slip_m/slip_m"),
    )

    def __post_init__(self) -> None:
        require_positive(target_slip=self.target_slip, operation_time=self.operation_time)
        if self.ramp is not None and not 0 < self.ramp < 1:
            raise ParameterError(
                f"ramp must be above 0 and below 1. Received {self.ramp!r}. Omit ramp for a constant rate."
            )
        require_ordinary(0, target_slip=self.target_slip)
        require_ordinary(operation_time=self.operation_time)

    def shape(self, stage: Any) -> Any:
        """Share of the target slip [-] at the stage s = t/t_op in [0, 1] (eq. ref): number, array or expression.

        Raises
        ------
        ParameterError
            For a value of `stage` that cannot be raised to a power, or whose powers overflow.
        """
        if isinstance(stage, type) or not hasattr(stage, "__pow__"):
            raise ParameterError(
                f"stage must be a number, an array or an expression. Received {shown(stage)}. Give t/t_op."
            )
        try:
            return stage**3 * (10 - 15 * stage + 6 * stage**2)
        except (OverflowError, TypeError):
            raise ParameterError(f"stage must be from 0 to 1. Received {shown(stage)}. Give t/t_op.") from None

    def slip(self, time: "sp.Expr") -> "sp.Expr":
        """Reference slip [m] at a time [s] of [0, operation_time], with exact numbers."""
        import sympy as sp

        d_max, t_op = (sp.Rational(str(rational(v))) for v in (self.target_slip, self.operation_time))
        return d_max * self.shape(time / t_op)

    @property
    def largest_rate(self) -> float:
        """Largest r' [m/s]: 15/8 of the mean, at half of the operation time."""
        return 15 / 8 * self.target_slip / self.operation_time


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingReference:
    """Slip r(t) = d_max((1 − λ)t/t_op + λ·shape(t/t_op)) of a fault whose initial and final slip rate is r′(0).

    Attributes
    ----------
    task : Reference
        Gives d_max, t_op, and λ, its ramp or 0.
    """

    task: Reference

    @property
    def _shares(self) -> tuple[Fraction, Fraction]:
        """1 − λ and λ."""
        share = rational(self.task.ramp or 0)
        return 1 - share, share

    @property
    def first_rate(self) -> Fraction:
        """V = r′(0) [m/s], the smallest r′."""
        return rational(self.task.target_slip) / rational(self.task.operation_time) * self._shares[0]

    @property
    def swing(self) -> Fraction:
        """w [-], the largest excess of r′ over V, divided by V: V ≤ r′ ≤ V(1 + w)."""
        steady, share = self._shares
        return Fraction(15, 8) * share / steady

    def slip(self, time: Any) -> Any:
        """r [m] at times ≥ 0 [s], number or array; the rate is V after t_op."""
        steady, share = map(float, self._shares)
        stage = time / self.task.operation_time
        ended = (stage < 1) * stage + (stage >= 1)
        return self.task.target_slip * (steady * stage + share * self.task.shape(ended))

    def rate(self, time: Any) -> Any:
        """r′ [m/s] at times ≥ 0 [s], number or array."""
        steady, share = map(float, self._shares)
        stage = time / self.task.operation_time
        ramping = 30 * stage**2 * (1 - stage) ** 2 * (stage < 1)
        return self.task.target_slip / self.task.operation_time * (steady + share * ramping)


# ----------------------------------------------------------------------
# Disturbance: forces besides spring, dashpot, friction and injected fluid.

STRESSES = ("constant", "amplitude")  # entries that may be given as a shear stress


def acceleration(quantity: object, authority: Fraction, name: str) -> tuple[float, bool]:
    """Acceleration [m/s²] of a text such as ``"1e-4 m/s^2"`` or ``"35 kPa"``; whether the text is a shear stress.

    A stress τ accelerates a fault by τA/m, rounded away from 0, so that a proof for the float covers the stress.

    Parameters
    ----------
    quantity : str
        Acceleration, or shear stress on the fault, with its unit.
    authority : Fraction
        Nominal A/m of the fault [m²/kg].
    name : str
        Name of the quantity in error messages.

    Raises
    ------
    UnitError
        For a unit that is neither of an acceleration nor of a stress.
    ParameterError
        For a stress outside the range of `require_ordinary`.
    """
    try:
        return si_value(quantity, "m/s^2", name), False
    except UnitError as error:
        try:
            stress = rational(si_value(quantity, "Pa", name), name)
        except UnitError as other:
            if "Did you mean" in str(other):
                raise
            raise UnitError(f"{error} A shear stress in Pa is accepted too.") from None
    require_ordinary(**{name: float(stress)})
    exact = abs(stress) * authority
    size = float(exact)
    while rational(size) < exact:  # proofs use `rational(size)`, the decimal of the float
        size = nextafter(size, inf)
    return (size if stress >= 0 else -size), True


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Acceleration φ̂_e(x1, x2, t) = constant + amplitude·sin(frequency·t) + slip_growth·x1 + rate_growth·x2.

    Raises `ParameterError` for values that are not finite or are outside the ranges below.

    Attributes
    ----------
    constant : float
        Constant acceleration [m/s²], in a file also as a shear stress on the fault, such as "35 kPa".
    amplitude : float
        Amplitude of the sine [m/s²], not negative, in a file also as a shear stress on the fault, such as "35 kPa".
    frequency : float
        Angular frequency [rad/s], not negative.
    slip_growth : float
        Slope of the disturbance in slip [1/s²]: a known term, not counted in the disturbance bound of a guarantee.
    rate_growth : float
        Slope of the disturbance in slip rate [1/s]: a known term, not counted in the disturbance bound of a guarantee.
    stresses : tuple of str
        Which of ``constant`` and ``amplitude`` were given as a shear stress. Their stored accelerations are for the
        nominal area per mass; proofs cover the stress for every area per mass of the fault's box.
    """

    constant: float = field(default=0.0, metadata=quantity("m/s^2", "0 m/s^2"))
    amplitude: float = field(default=0.0, metadata=quantity("m/s^2", "1e-4 m/s^2"))
    frequency: float = field(default=0.0, metadata=quantity("rad/s", "1 rad/s"))
    slip_growth: float = field(default=0.0, metadata=quantity("1/s^2", "0 1/s^2"))
    rate_growth: float = field(default=0.0, metadata=quantity("1/s", "0 1/s"))
    stresses: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_finite(constant=self.constant, slip_growth=self.slip_growth, rate_growth=self.rate_growth)
        require_nonnegative(amplitude=self.amplitude, frequency=self.frequency)
        require_ordinary(**{each.name: getattr(self, each.name) for each in fields(self) if "unit" in each.metadata})

    def acceleration(self, slip: "sp.Expr", rate: "sp.Expr", time: "sp.Expr") -> "sp.Expr":
        """φ̂_e [m/s²] at a slip [m], slip rate [m/s] and time [s]."""
        import sympy as sp

        return self.explicit(time) + sp.Float(self.slip_growth) * slip + sp.Float(self.rate_growth) * rate

    def explicit(self, time: "sp.Expr") -> "sp.Expr":
        """Part of φ̂_e [m/s²] that depends on time [s] alone."""
        import sympy as sp

        return self.constant + self.amplitude * sp.sin(sp.Float(self.frequency) * time)

    @property
    def largest_explicit(self) -> float:
        """Bound on the part of φ̂_e that depends on time alone [m/s²]."""
        return abs(self.constant) + self.amplitude

    @property
    def largest_rate(self) -> float:
        """Bound on the time derivative of the part of φ̂_e that depends on time alone [m/s³]."""
        return self.amplitude * self.frequency

    def exact_bounds(self, width: Fraction = Fraction(0)) -> tuple[Fraction, Fraction]:
        """Exact `largest_explicit` [m/s²] and `largest_rate` [m/s³] for proofs; those two are rounded floats.

        `width` [-] is the half-width of the area per mass: a stress accelerates by up to 1 + `width` times as much.
        """
        constant, amplitude = (
            abs(rational(getattr(self, name))) * (1 + width * (name in self.stresses)) for name in STRESSES
        )
        return constant + amplitude, amplitude * rational(self.frequency)


# ----------------------------------------------------------------------
# One fault as a spring-slider, in SI units.


@checked_dataclass(frozen=True, kw_only=True)
class Fault:
    """Spring-slider model of one fault.

    Attributes
    ----------
    name : str
    source : str
        Where the numbers come from.
    density : float
        ρ of the host rock [kg/m³].
    shear_modulus : float
        G of the host rock [Pa].
    length : float
        L_ac, length of the activated fault [m].
    width : float, optional
        Second side of the patch [m]; omitted for a square patch, as in the paper.
    damping : float
        η [kg/s], not negative.
    effective_normal_stress : float
        σ'_n [Pa], positive in compression.
    friction : FrictionLaw
    reference : Reference
        Slip to follow.
    sampling_time : float
        Sampling time T_s [s], at most a thousandth of the operation time.
    disturbance : Disturbance
    box : UncertaintyBox
    assumed : tuple of str
        Default values that replace missing entries of a file, and remarks on the disturbance, one sentence each.
    poor_fit : str
        Reason why friction that was identified from a record is not reliable; empty if it is reliable.

    Notes
    -----
    A rectangular patch is a row of squares of its shorter side h that slip as one. Slip changes the stress up to a
    distance of about h, so each square has the paper's mass ρh³ and stiffness Gh, and all share the damping. The
    natural frequency √(G/ρ)/h is that of one square; moment, mass and stiffness are sums over all squares.

    Raises
    ------
    ParameterError
        When a value is unphysical or not finite, the sampling time is too long, or friction excludes a ramp.
    """

    name: str = field(metadata={"text": "letters, digits, spaces and _ . -"})
    source: str = field(metadata={"default": "no source given"})
    density: float = field(metadata=quantity("kg/m^3", "2600 kg/m^3", symbol=r"\rho", directed_unit="kg/fault_m^3"))
    shear_modulus: float = field(
        metadata=quantity("Pa", "25 GPa", symbol="G", directed_unit="shear_Pa/(slip_m/fault_m)")
    )
    length: float = field(metadata=quantity("m", "1.5 km", symbol="L", directed_unit="fault_m"))
    width: float | None = field(default=None, metadata=quantity("m", "1.5 km", "square", directed_unit="fault_m"))
    damping: float = field(
        metadata=quantity("kg/s", "1e13 kg/s", "radiation of shear waves, G A/(2 c_s)", symbol=r"\eta")
    )
    effective_normal_stress: float = field(metadata=quantity("Pa", "25 MPa", symbol=r"\sigma'_n"))
    friction: FrictionLaw
    reference: Reference
    sampling_time: float = field(
        metadata=quantity(
            "s",
            "10 ms",
            "at least ten samples per e-folding time, or near D_c/(20 V) if friction has a state",
            symbol="T_s",
        )
    )
    disturbance: Disturbance = field(default_factory=Disturbance)
    box: UncertaintyBox = field(default_factory=lambda: uncertainty_box("paper"))
    assumed: tuple[str, ...] = field(default=(), compare=False, repr=False)
    poor_fit: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        problems = Problems()
        with problems.collected():
            require_name(self.name)
        with problems.collected():
            require_plant(**{name: value for name in _UNITS if (value := getattr(self, name)) is not None})
        with problems.collected():
            require_ordinary(**{name: getattr(self.friction, name) for name in self.friction.quantities()})
        problems.raise_collected()
        self.friction.require(ramp=self.reference.ramp)
        if self.reference.operation_time < 1000 * self.sampling_time:
            raise ParameterError(
                f"sampling_time must be at most a thousandth of the operation time "
                f"({self.reference.operation_time!r} s). Received {self.sampling_time!r} s."
            )

    def require_memoryless(self, purpose: str) -> None:
        """Raise for friction with a state variable, which `purpose` does not cover."""
        self.friction.require(purpose=purpose)

    def with_box(self, name: str) -> "Fault":
        """Return the same fault with a named uncertainty box."""
        return replace(self, box=uncertainty_box(name))

    @property
    def disturbance_bounds(self) -> tuple[Fraction, Fraction]:
        """Bounds of the disturbance [m/s²] and its rate [m/s³]; for a stress, over every area per mass of the box."""
        return self.disturbance.exact_bounds(self.box.authority)

    def with_disturbance(self, disturbance: Disturbance) -> "Fault":
        """Return the same fault under another disturbance."""
        return replace(self, disturbance=disturbance)

    @property
    def side(self) -> float:
        """h [m], the shorter side of the patch; L for a square patch."""
        return min(self.length, self.width or self.length)

    @cached_property
    def squares(self) -> Fraction:
        """n, exact: the longer over the shorter side [-]; 1 for a square patch."""
        sides = [rational(self.length), rational(self.length if self.width is None else self.width)]
        return max(sides) / min(sides)

    @property
    def mass(self) -> float:
        """m = nρh³ [kg]."""
        return float(self.squares) * self.density * self.side**3

    @property
    def area(self) -> float:
        """A = nh² [m²]."""
        return float(self.squares) * self.side**2

    @property
    def stiffness(self) -> float:
        """k = nGh [N/m] (the paper prints G/L: ERRATA 3)."""
        return float(self.squares) * self.shear_modulus * self.side

    @property
    def authority(self) -> float:
        """N̂ = A/m [m²/kg]."""
        return self.area / self.mass

    @property
    def exact_authority(self) -> Fraction:
        """A/m = 1/(ρh) [m²/kg], exact for the given decimals."""
        return 1 / (rational(self.density) * rational(self.side))

    @property
    def authority_range(self) -> tuple[float, float]:
        """Smallest and largest input gain μN̂ [m²/kg] over the uncertainty box."""
        low, high = self.friction.bounds
        width = float(self.box.authority)
        return low * self.authority * (1 - width), high * self.authority * (1 + width)

    @property
    def specific_stiffness(self) -> float:
        """k̂ = k/m [1/s²]."""
        return self.stiffness / self.mass

    @property
    def specific_damping(self) -> float:
        """η̂ = η/m [1/s]."""
        return self.damping / self.mass

    @property
    def natural_frequency(self) -> float:
        """ω_n = √(k/m) [rad/s]."""
        return math.sqrt(self.specific_stiffness)

    @property
    def damping_ratio(self) -> float:
        """ζ = η/(2mω_n) [-]."""
        return self.specific_damping / (2 * self.natural_frequency)

    @property
    def stress_drop(self) -> float:
        """Δτ = (μ_max − μ_res)σ'_n [Pa]; nan for friction with a state, whose drop depends on the event."""
        return float(_strength_drop(self.friction)) * self.effective_normal_stress

    @property
    def seismic_moment(self) -> float:
        """M0 = GAD [N·m] of the rest slip D; 0 for a stable fault, nan for friction with a state: see `moment_of`.

        The paper's nh³Δτ assumes that friction drops from its maximum to its residual value.
        """
        return self.moment_of(self.rest_slip)

    @property
    def magnitude(self) -> float:
        """M_w = ⅔log10(M0) − 6.07 [-], eq. magnitude; minus infinity for a stable fault, nan for a moment of nan."""
        return magnitude(self.seismic_moment)

    def moment_of(self, slip: float) -> float:
        """M0 = GAD [N·m] of an event that slips by D [m]; equal to nh³Δτ, with Δτ the stress drop of the spring."""
        return self.shear_modulus * self.area * slip

    @cached_property
    def rest_slip(self) -> float:
        """Slip [m] at which the fault comes to rest next: the stable root of the statics; 0 for a stable fault.

        nan for friction with a state, which has no fixed strength at rest.
        """
        return rest_slip(self.friction, self.effective_normal_stress * self.area, self.stiffness)


_UNITS = {each.name: each.metadata["unit"] for each in fields(Fault) if "unit" in each.metadata}


def require_plant(**numbers: float) -> None:
    """Raise for unphysical numbers of a fault, all in one exception."""
    problems = Problems()
    compression = "Compression is positive here; check the sign."
    for name, value in numbers.items():
        with problems.collected():
            if name == "damping":
                require_nonnegative(damping=value)
            else:
                usual = f"It is in {_UNITS[name]} here; check sign and unit."
                require_positive(compression if name == "effective_normal_stress" else usual, **{name: value})
            require_ordinary(**{name: value})
    problems.raise_collected()


def magnitude(seismic_moment: float) -> float:
    """M_w = ⅔log10(M0) − 6.07 [-] of a seismic moment [N·m], eq. magnitude; minus infinity for a moment of 0."""
    return -math.inf if seismic_moment <= 0 else 2 / 3 * math.log10(seismic_moment) - 6.07


_ACCEPTED = "poor-fit"


def with_accepted_fit(fault: Fault, accept_poor_fit: bool) -> Fault:
    """The fault to design for, renamed if it has a poor fit; raises `ParameterError` if that is not accepted."""
    if not fault.poor_fit:
        return fault
    if not accept_poor_fit:
        raise ParameterError(
            f"the friction of {fault.name} must be supported by its record. Received: {fault.poor_fit}. Identify "
            "it from a better record, or accept it with --accept-poor-fit (accept_poor_fit=True)."
        )
    source = f"poor fit accepted ({fault.poor_fit}); {fault.source}"
    return replace(fault, name=f"{fault.name[:40].rstrip()}-{_ACCEPTED}", source=source, poor_fit="")


def require_fault(fault: Fault) -> Fault:
    """Return the fault; raise `ParameterError` for any other object."""
    if not isinstance(fault, Fault):
        raise ParameterError(f"fault must be a Fault. Received {fault!r:.60}. Write load_fault('real-fault'), say.")
    return fault
