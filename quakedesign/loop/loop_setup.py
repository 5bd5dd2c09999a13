"""Loop setup: sampling, delay, actuator, diffusion path and noise between a law and the fault.

`LoopSetup` is read by the guarantee, the simulation, the command line and the documentation: each quantity carries its
unit and its help text.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Self

from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import LowerBound, UpperBound, shortly
from quakedesign.fault.units import exact_value

if TYPE_CHECKING:
    from quakedesign.fault import Fault

Quantity = str | float | Fraction
"""Number in the SI unit, decimal or p/q as text, or a text with a unit such as ``"80 ms"``."""

MEASURED = ("slip-and-rate", "slip", "differentiator")
"""Signals that a law measures; `differentiator` estimates the slip rate from the slip."""


# ----------------------------------------------------------------------
# The pump at the valve.


@dataclass(frozen=True, slots=True, kw_only=True)
class Pump:
    """Limits of the pressure at the valve and of its rate of change; None for no limit.

    Attributes
    ----------
    least, largest : Fraction, optional
        [Pa]; 0, the initial pressure, lies between them. Both or none.
    rate : Fraction, optional
        Rate limit of the pressure [Pa/s].

    Raises
    ------
    ParameterError
        For limits that exclude 0 or are equal, one limit without the other, or a rate that is not positive.
    """

    least: Fraction | None = None
    largest: Fraction | None = None
    rate: Fraction | None = None

    def __post_init__(self) -> None:
        if (self.least is None) != (self.largest is None):
            present = "largest" if self.least is None else "least"
            raise ParameterError(
                "the least pressure of a pump must be given with the largest. "
                f"Received the {present} pressure alone. Give both."
            )
        if self.limits and not (self.limits[0] <= 0 <= self.limits[1] and self.limits[0] < self.limits[1]):
            low, high = map(shortly, self.limits)
            raise ParameterError(
                "the least pressure of a pump must be 0 or less, the largest 0 or more, and they must differ. Received "
                f"{low} Pa and {high} Pa. Give the withdrawal as negative, the injection as positive."
            )
        if self.rate is not None and self.rate <= 0:
            raise ParameterError(
                f"the rate limit of a pump must be positive. Received {shortly(self.rate)} Pa/s. "
                "Omit the rate limit if the pump has none."
            )

    @property
    def limits(self) -> tuple[Fraction, Fraction] | None:
        """Least and largest pressure [Pa]."""
        return None if self.least is None or self.largest is None else (self.least, self.largest)

    def exceeded(self, low: LowerBound, high: UpperBound) -> str:
        """Reason why pressures between two bounds [Pa] exceed the limits; empty if they do not."""
        if self.limits is None or (self.limits[0] <= low and high <= self.limits[1]):
            return ""
        return (
            f"pressures from {low.quantity('Pa')} to {high.quantity('Pa')} may be commanded, but the pump "
            f"supplies only {self._range()}"
        )

    def too_slow(self, step: UpperBound | None, time: Fraction) -> str:
        """Reason why a pressure change [Pa] may take longer than a time [s]; empty if it does not."""
        if self.rate is None or (step is not None and step <= self.rate * time):
            return ""
        most = "of any size" if step is None else f"of {step.quantity('Pa')}"
        return (
            f"changes {most} from one sample to the next may be commanded, which a pump of "
            f"{LowerBound(self.rate).quantity('Pa/s')} cannot complete in {LowerBound(time).quantity('s')}"
        )

    def to_dict(self) -> dict[str, str]:
        """Exact numbers as strings."""
        values = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: str(value) for name, value in values.items() if value is not None}

    def words(self) -> str:
        """Clause of a statement on the pump."""
        of = [] if self.limits is None else [self._range()]
        of += [] if self.rate is None else [LowerBound(self.rate).quantity("Pa/s")]
        return f"with a pump of {', '.join(of)}, whose limits are never reached"

    def _range(self) -> str:
        """Limits as text, rounded inward."""
        assert self.limits is not None
        low, high = self.limits
        return f"{UpperBound(low).quantity('Pa')} to {LowerBound(high).quantity('Pa')}"


# ----------------------------------------------------------------------
# The setup: one field per quantity.


def quantity(unit: str, text: str, default: Fraction | None = Fraction(0)) -> Any:
    """Field of a quantity with its SI unit and its help text."""
    return field(default=default, metadata={"unit": unit, "help": text})


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSetup:
    """Loop setup: sampling, delay, actuator, diffusion path, noise, initial errors.

    A quantity is given as a number in the SI unit, a decimal or p/q as text, or a text with a unit, such as
    ``LoopSetup(step="184 ms", slip_noise="5 um")``, and stored as a `Fraction` in the SI unit; 0 or None if not given.

    Attributes
    ----------
    step : Fraction or None
        T_s [s].
    measured : str
        One of `MEASURED`.
    delay, lag, diffusion : Fraction
        Delay, time constant of the actuator, and L²/D of the diffusion path [s].
    slip_noise, rate_noise : Fraction
        Bounds of the measurement errors of slip [m] and slip rate [m/s].
    initial_slip, initial_slip_rate : Fraction
        Bounds of the initial errors, of either sign [m], [m/s].
    jitter, delay_jitter, averaging_time, longest_step : Fraction
        Largest timing errors, averaging time of the measurements and longest sampling interval [s].
    saturation, withdrawal : Fraction or None
        Limits of the pressure at the valve [Pa].
    rate_limit : Fraction or None
        Rate limit of the pressure at the valve [Pa/s].

    Raises
    ------
    ParameterError
        For a negative quantity, a step outside 1e-9 to 1e9 s, a rate limit of 0, an unknown `measured`, withdrawal
        without saturation, or a saturation of 0 without withdrawal.
    UnitError
        For a unit that is unknown or of another dimension.
    """

    step: Fraction | None = quantity(
        "s", "Sampling time T_s, such as '184 ms' or 7/50 (s); the fault's unless given.", None
    )
    measured: str = MEASURED[0]
    delay: Fraction = quantity("s", "Delay from the measurement to the pressure at the valve.")
    lag: Fraction = quantity(
        "s",
        "Time constant of the lag from valve to fault, or to the well of a diffusion path; e-LQR designs include it.",
    )
    diffusion: Fraction = quantity("s", "L^2/D of the diffusion path between well and fault; e-LQR designs include it.")
    slip_noise: Fraction = quantity(
        "m",
        "Bound of the measurement error of the slip at any time, such as '1 um'. For a gauge with resolution q, give "
        "q/2. --slip-noise-deviation of simulate is a standard deviation.",
    )
    rate_noise: Fraction = quantity("m/s", "Bound of the measurement error of the slip rate at any time.")
    initial_slip: Fraction = quantity(
        "m",
        "Bound of the initial slip, of either sign, such as '0.01 mm'; the states of the law start at 0 (those of a "
        "sliding mode at values computed from its first measurement). The guarantee is on the plant without stick.",
    )
    initial_slip_rate: Fraction = quantity(
        "m/s",
        "Bound of the initial slip rate, of either sign, such as '0.1 mm/s'; the guarantee is on the plant without "
        "stick.",
    )
    jitter: Fraction = quantity(
        "s", "Largest timing error of a measurement and its pressure, early or late, such as '2 ms'."
    )
    delay_jitter: Fraction = quantity("s", "Largest additional timing error of the pressure, early or late.")
    averaging_time: Fraction = quantity(
        "s",
        "The law measures means of slip and slip rate over this time before each sample; --delay counts from the "
        "sample.",
    )
    longest_step: Fraction = quantity(
        "s",
        "Aperiodic sampling: longest interval between samples; T_s is the shortest. The law does not know the "
        "intervals.",
    )
    saturation: Fraction | None = quantity(
        "Pa",
        "Largest pressure of the pump, such as '20 MPa'; largest withdrawal too, unless --withdrawal is given. A proof "
        "shows that these limits are never reached.",
        None,
    )
    withdrawal: Fraction | None = quantity(
        "Pa", "Largest withdrawal below the initial pressure; 0 for a pump that only injects.", None
    )
    rate_limit: Fraction | None = quantity(
        "Pa/s",
        "Rate limit of the pressure at the valve, such as '10 MPa/s'. A proof includes the time that a change "
        "takes, and shows that every change ends before the next sample.",
        None,
    )

    if TYPE_CHECKING:

        def __init__(self, *, measured: str = "slip-and-rate", **quantities: Quantity | None) -> None: ...

    def __post_init__(self) -> None:
        require_known(self.measured, MEASURED, "measured")
        for name, part in quantities().items():
            value, title = getattr(self, name), name.replace("_", " ")
            if value is None:
                continue
            exact = exact_value(value, part["unit"], title)
            if exact < 0 and name not in ("step", "rate_limit"):  # these must be positive, see below
                raise ParameterError(
                    f"{title} must be 0 or more. Received {shortly(exact)} {part['unit']}. Omit the minus sign."
                )
            object.__setattr__(self, name, exact)
        if self.step is not None:
            require_step(self.step)
        if self.withdrawal is not None and self.saturation is None:
            raise ParameterError(
                "withdrawal needs saturation, the largest pressure of the pump. Received withdrawal alone. Give both."
            )
        _ = self.pump  # raises for invalid limits

    @property
    def pump(self) -> Pump | None:
        """Limits of the pump; None without any."""
        if self.saturation is None and self.rate_limit is None:
            return None
        lowest = None if self.saturation is None else -(self.saturation if self.withdrawal is None else self.withdrawal)
        return Pump(least=lowest, largest=self.saturation, rate=self.rate_limit)

    @property
    def path(self) -> dict[str, Any]:
        """Delay, lag and L²/D [s] between law and fault, those that are not 0."""
        return {name: value for name in ("delay", "lag", "diffusion") if (value := getattr(self, name))}

    @property
    def noise(self) -> dict[str, Any]:
        """Bounds of the measurement errors [m], [m/s], those that are not 0."""
        return {name: value for name in ("slip_noise", "rate_noise") if (value := getattr(self, name))}

    def given(self) -> dict[str, Any]:
        """Fields that differ from their default, by name, in SI units."""
        return {part.name: value for part in fields(self) if (value := getattr(self, part.name)) != part.default}

    def with_given(self, **entered: Quantity | None) -> Self:
        """The setup with these fields replaced; None leaves a field unchanged.

        Raises
        ------
        ParameterError
            For an unknown field; the message suggests the nearest name.
        """
        for name in entered:
            require_known(name, [part.name for part in fields(self)], "quantity of the loop setup")
        values: Any = {name: value for name, value in entered.items() if value is not None}
        return replace(self, **values) if values else self

    def at_step(self, fault: "Fault") -> tuple["Fault", Self]:
        """The fault with T_s of this setup as its sampling time, and the setup without a step."""
        timed = fault if self.step is None else replace(fault, sampling_time=float(self.step))
        return timed, replace(self, step=None)

    def to_dict(self) -> dict[str, str]:
        """Fields that differ from their default, exact numbers as strings, in SI units."""
        return {name: str(value) for name, value in self.given().items()}

    def __repr__(self) -> str:
        units = {name: part["unit"] for name, part in quantities().items()}
        parts = (f"{name}={_shown(value, units.get(name))}" for name, value in self.given().items())
        return f"LoopSetup({', '.join(parts)})"


def require_step(step: Fraction) -> None:
    """Reject a sampling time [s] outside the range of the floating-point computations."""
    if not Fraction(1, 10**9) <= step <= 10**9:
        raise ParameterError(f"step must be positive, between 1e-9 s and 1e9 s. Received {shortly(step)} s.")


def quantities() -> dict[str, Any]:
    """Unit and help text of every quantity of a setup, by name."""
    return dict(_parts())


def _parts() -> Iterator[tuple[str, Any]]:
    return ((part.name, part.metadata) for part in fields(LoopSetup) if part.metadata)


def _shown(value: Any, unit: str | None) -> str:
    return repr(value) if unit is None else repr(f"{shortly(value)} {unit}")


IDEAL = LoopSetup()
"""Pressure without delay, exact measurements, zero initial errors, sampling time of the fault."""
