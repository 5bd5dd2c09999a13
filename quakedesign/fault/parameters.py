"""One fault as a spring-slider, in SI units."""

import math
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import Problems, require_name, require_nonnegative, require_ordinary, require_positive
from quakedesign.fault.disturbance import Disturbance
from quakedesign.fault.friction import FrictionLaw
from quakedesign.fault.reference import Reference
from quakedesign.fault.statics import rest_slip
from quakedesign.fault.uncertainty import UncertaintyBox, uncertainty_box
from quakedesign.rationals import rational


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Spring-slider analogue of one fault, eq. springmodel.

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
        The side of the patch beside its length [m]; None for a square one, the paper's.
    damping : float
        η [kg/s], not negative.
    effective_normal_stress : float
        σ'_n [Pa], positive in compression.
    friction : FrictionLaw
    reference : Reference
        Slip to follow.
    sampling_time : float
        T_s [s].
    disturbance : Disturbance
    box : UncertaintyBox
    assumed : tuple of str
        What a file left to physics or to the paper's example, each in a sentence.

    Notes
    -----
    A patch of two sides is a row of squares of its shorter side h that slip as one. Stress that slip changes reaches
    about h into the rock, so each has the paper's mass ρh³ and stiffness Gh, and the damping is shared among them: the
    natural frequency √(G/ρ)/h is that of one square, and moment, mass and stiffness are those of all.

    Raises
    ------
    ParameterError
        When a value is unphysical or not finite.
    """

    name: str
    source: str
    density: float = field(metadata={"unit": "kg/m^3", "directed_unit": "kg/fault_m^3", "symbol": r"\rho"})
    shear_modulus: float = field(metadata={"unit": "Pa", "directed_unit": "shear_Pa/(slip_m/fault_m)", "symbol": "G"})
    length: float = field(metadata={"unit": "m", "directed_unit": "fault_m", "symbol": "L"})
    width: float | None = field(default=None, metadata={"unit": "m", "directed_unit": "fault_m"})
    damping: float = field(metadata={"unit": "kg/s", "symbol": r"\eta"})
    effective_normal_stress: float = field(metadata={"unit": "Pa", "symbol": r"\sigma'_n"})
    friction: FrictionLaw
    reference: Reference
    sampling_time: float = field(metadata={"unit": "s", "symbol": "T_s"})
    disturbance: Disturbance = field(default_factory=Disturbance)
    box: UncertaintyBox = field(default_factory=lambda: uncertainty_box("paper"))
    assumed: tuple[str, ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        problems = Problems()
        with problems.collected():
            require_name(self.name)
        with problems.collected():
            require_plant(**{name: getattr(self, name) for name in _PLANT}, **self._other_side)
        with problems.collected():
            require_ordinary(**{name: getattr(self.friction, name) for name in self.friction.quantities()})
        problems.refuse()
        if self.reference.ramp is not None and not self.friction.state_names:
            raise ParameterError(
                f"a ramp beside a constant rate needs friction with a state. Received {self.reference.ramp!r} with "
                f"{self.friction.name}, whose reference is a smooth ramp from rest to rest. Leave it out."
            )
        if self.reference.operation_time < 1000 * self.sampling_time:
            raise ParameterError(
                f"sampling_time must be at most a thousandth of the operation time "
                f"({self.reference.operation_time!r} s). Received {self.sampling_time!r} s."
            )

    def require_memoryless(self, purpose: str) -> None:
        """Refuse friction with a state variable where only slip and slip rate are covered.

        Raises
        ------
        ParameterError
        """
        if self.friction.state_names:
            raise ParameterError(
                f"{purpose} needs a friction law of slip and slip rate alone. Received {self.friction.name}, with the "
                f"state {', '.join(self.friction.state_names)}. "
                "Use fault, derive, simulate, guarantee or design for it."
            )

    def with_box(self, name: str) -> "Fault":
        """Return the same fault with a named uncertainty box."""
        return replace(self, box=uncertainty_box(name))

    @property
    def disturbance_bounds(self) -> tuple[Fraction, Fraction]:
        """Bounds of the disturbance [m/s²] and of its rate [m/s³]; of a stress for every area per mass of the box."""
        return self.disturbance.exact_bounds(self.box.authority)

    def with_disturbance(self, disturbance: Disturbance) -> "Fault":
        """Return the same fault under another disturbance."""
        return replace(self, disturbance=disturbance)

    @property
    def _other_side(self) -> dict[str, float]:
        return {} if self.width is None else {"width": self.width}

    @property
    def side(self) -> float:
        """h [m], the shorter side of the patch; L of a square one."""
        return min((self.length, *self._other_side.values()))

    @cached_property
    def squares(self) -> Fraction:
        """n, exact: the longer over the shorter side [-]; 1 of a square one."""
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
        """A/m = 1/(ρh) [m²/kg] of the decimals given."""
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
        """Δτ = (μ_max − μ_res)σ'_n [Pa]; nan for friction with a state, whose drop is that of an event."""
        if self.friction.state_names:
            return math.nan
        low, high = self.friction.bounds
        return (high - low) * self.effective_normal_stress

    @property
    def seismic_moment(self) -> float:
        """M0 = GAD [N·m] of the rest slip D; 0 for a stable fault, nan for friction with a state: see `moment_of`.

        The paper's nh³Δτ is that of a fault on which friction loses all that it can.
        """
        return self.moment_of(self.rest_slip)

    @property
    def magnitude(self) -> float:
        """M_w = ⅔log10(M0) − 6.07 [-], eq. magnitude; minus infinity for a stable fault, nan as `seismic_moment`."""
        return magnitude(self.seismic_moment)

    def moment_of(self, slip: float) -> float:
        """M0 = GAD [N·m] of an event that slips by D [m]: L³Δτ with the stress that the spring loses."""
        return self.shear_modulus * self.area * slip

    @cached_property
    def rest_slip(self) -> float:
        """Slip [m] at which the fault comes to rest next: the stable root of the statics; 0 for a stable fault.

        nan for friction with a state, which has no strength of its own at rest.
        """
        return rest_slip(self.friction, self.effective_normal_stress * self.area, self.stiffness)


_PLANT = {
    "density": "kg/m^3",
    "shear_modulus": "Pa",
    "length": "m",
    "damping": "kg/s",
    "effective_normal_stress": "Pa",
    "sampling_time": "s",
}


def require_plant(**numbers: float) -> None:
    """Refuse numbers of a fault that are unphysical, all of them at once.

    Raises
    ------
    ParameterError
    """
    problems = Problems()
    compression = "Compression is positive here; check the sign."
    for name, value in numbers.items():
        with problems.collected():
            if name == "damping":
                require_nonnegative(damping=value)
            else:
                usual = f"It is in {_PLANT[name]} here; check sign and unit." if name in _PLANT else ""
                require_positive(compression if name == "effective_normal_stress" else usual, **{name: value})
            require_ordinary(**{name: value})
    problems.refuse()


def magnitude(seismic_moment: float) -> float:
    """M_w = ⅔log10(M0) − 6.07 [-] of a seismic moment [N·m], eq. magnitude; minus infinity of none."""
    return -math.inf if seismic_moment <= 0 else 2 / 3 * math.log10(seismic_moment) - 6.07


def require_fault(fault: Fault) -> Fault:
    """The fault, if it is one.

    Raises
    ------
    ParameterError
    """
    if not isinstance(fault, Fault):
        raise ParameterError(f"fault must be a Fault. Received {fault!r:.60}. Write load_fault('real-fault'), say.")
    return fault
