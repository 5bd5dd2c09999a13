"""Values of options as they are typed: numbers with units, exact numbers, whole ones, gains."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

from cyclopts import Parameter

from quakedesign.errors import ParameterError, UnitError
from quakedesign.rationals import rational

# Negative decimals are values anyhow; with leading hyphens allowed, options after the values would be values too.
Texts = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]


def _gains(_type: Any, tokens: Sequence[Any]) -> tuple[str, ...]:
    """One word, or numbers as they are written."""
    texts = tuple(token.value for token in tokens)
    for place, text in enumerate(texts if len(texts) > 1 else (), start=1):
        rational(text, f"gain k{place}")
    return texts


Gains = Annotated[tuple[str, ...], Parameter(consume_multiple=True, converter=_gains)]


def quantity(unit: str) -> Callable[[Any, Sequence[Any]], float]:
    """Converter of an option's text, with a unit or a bare number in the SI unit."""

    def read(_type: Any, tokens: Sequence[Any]) -> float:
        return in_unit(tokens[0].value, unit, (tokens[0].keyword or "value").strip("-").replace("-", " "))

    return read


def in_unit(text: str, unit: str, name: str) -> float:
    """Number of a text with a unit, or a bare one in that SI unit."""
    try:
        return float(text)
    except ValueError:
        return _with_unit(text, unit, name)


def whole(_type: Any, tokens: Sequence[Any]) -> int:
    """Whole number of an option's text."""
    text, name = tokens[0].value, (tokens[0].keyword or "value").strip("-").replace("-", " ")
    try:
        return int(text)
    except ValueError:
        raise ParameterError(f"{name} must be a whole number. Received {text!r}. Write for example 8.") from None


def _exact_reader(unit: str) -> Callable[[Any, Sequence[Any]], str]:
    """Converter to a number as it is written, p/q among them, or that of a text with a unit."""

    def read(_type: Any, tokens: Sequence[Any]) -> str:
        text, name = tokens[0].value, (tokens[0].keyword or "value").strip("-").replace("-", " ")
        try:
            rational(text)
        except ParameterError:
            return repr(_with_unit(text, unit, name))
        return str(text)

    return read


def rock(diffusion: str | None, well: str | None, diffusivity: str | None) -> str | None:
    """L²/D [s] as it is told, or of the distance of a well [m] and the diffusivity of the rock [m²/s].

    Raises
    ------
    ParameterError
        For both, for one of the two alone, or for one that is not positive.
    """
    if well is None and diffusivity is None:
        return diffusion
    if well is None or diffusivity is None or diffusion not in (None, "0"):
        units = {"well": "m", "diffusivity": "m^2/s", "diffusion": "s"}
        told = {"well": well, "diffusivity": diffusivity, "diffusion": diffusion}
        received = " and ".join(
            f"--{name} of {value} {units[name]}" for name, value in told.items() if value not in (None, "0")
        )
        alone = " alone" if " and " not in received else ""
        raise ParameterError(
            "a well is told by its distance and the diffusivity of the rock, or by L^2/D. Received "
            f"{received}{alone}. Give --well and --diffusivity, or --diffusion alone."
        )
    distance, spread = rational(well, "well"), rational(diffusivity, "diffusivity")
    if distance <= 0 or spread <= 0:
        raise ParameterError(
            f"the distance of a well and a diffusivity must be positive. Received {well} m and {diffusivity} m^2/s. "
            "Leave out --well for the nearest."
        )
    return str(distance**2 / spread)


def _with_unit(text: str, unit: str, name: str) -> float:
    from quakedesign.fault.units import si_value

    if unit == "Hz" and "rad" in text:
        raise UnitError(f"{name} must be a frequency in Hz. Received {text!r}. Divide it by 2π.")
    return si_value(text, unit, name)


Seconds = Annotated[float, Parameter(converter=quantity("s"))]
Hertz = Annotated[float, Parameter(converter=quantity("Hz"))]
Metres = Annotated[float, Parameter(converter=quantity("m"))]
MetresPerSecond = Annotated[float, Parameter(converter=quantity("m/s"))]
Pascals = Annotated[float, Parameter(converter=quantity("Pa"))]
ExactSeconds = Annotated[str, Parameter(converter=_exact_reader("s"))]
ExactPascals = Annotated[str, Parameter(converter=_exact_reader("Pa"))]
ExactPascalsPerSecond = Annotated[str, Parameter(converter=_exact_reader("Pa/s"))]
ExactSquareMetresPerSecond = Annotated[str, Parameter(converter=_exact_reader("m^2/s"))]
ExactMetres = Annotated[str, Parameter(converter=_exact_reader("m"))]
ExactMetresPerSecond = Annotated[str, Parameter(converter=_exact_reader("m/s"))]
Whole = Annotated[int, Parameter(converter=whole)]
Push = Annotated[str, Parameter(allow_leading_hyphen=True)]
