"""Scale factors between faults, and how any quantity grows with them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import prod
from types import MappingProxyType
from typing import Self

from quakedesign.errors import ParameterError
from quakedesign.fault.dimensions import BASES, dimension, dimensional_matrix
from quakedesign.fault.radical import Radical, radical
from quakedesign.rationals import fraction_of


@dataclass(frozen=True, kw_only=True)
class Scales:
    """Scale factors λ of the five independent dimensions, target over source.

    Attributes
    ----------
    factors : mapping of str to Radical
        Positive, by name in `quakedesign.fault.dimensions.BASES`.

    Raises
    ------
    ParameterError
        For a factor that is missing, unknown or not positive.
    """

    factors: Mapping[str, Radical]

    def __post_init__(self) -> None:
        if set(self.factors) != set(BASES) or any(f.sign <= 0 for f in self.factors.values()):
            raise ParameterError(
                f"scale factors must be positive, one for each of {', '.join(BASES)}. "
                f"Received {', '.join(f'{n} = {f}' for n, f in self.factors.items()) or 'none'}."
            )
        object.__setattr__(self, "factors", MappingProxyType(dict(self.factors)))

    @classmethod
    def from_ratios(cls, ratios: Mapping[str, Radical | Fraction | int]) -> Self:
        """Scale factors from the ratios of five independent quantities.

        Parameters
        ----------
        ratios : mapping of unit to number
            Target over source, such as ``{"slip_m": …, "s": …, "normal_Pa": …, "fault_m": …, "kg/fault_m^3": …}``.

        Raises
        ------
        ParameterError
            When the units are not five independent ones, or a ratio is not positive.
        """
        matrix = dimensional_matrix(list(ratios))
        if matrix.shape != (5, 5) or matrix.det() == 0:
            raise ParameterError(
                f"scale factors need the ratios of five quantities with independent dimensions. "
                f"Received {', '.join(ratios) or 'none'}."
            )
        if any(radical(ratio).sign <= 0 for ratio in ratios.values()):
            raise ParameterError(f"ratios must be positive. Received {', '.join(str(r) for r in ratios.values())}.")
        inverse = matrix.inv()
        return cls(
            factors={
                base: power_product(
                    ratios, {unit: fraction_of(inverse[row, column]) for row, unit in enumerate(ratios)}
                )
                for column, base in enumerate(BASES)
            }
        )

    def of(self, unit: str) -> Radical:
        """Scale factor of any quantity from its unit; ``m`` is a slip, ``Pa`` a normal stress or fluid pressure."""
        return power_product(self.factors, dict(zip(BASES, dimension(unit), strict=True)))

    def inverse(self) -> Self:
        """The way back."""
        return replace(self, factors={base: factor**-1 for base, factor in self.factors.items()})


def power_product(bases: Mapping[str, Radical | Fraction | int], exponents: Mapping[str, Fraction]) -> Radical:
    """Π base^exponent, exact; bases may be zero only where they are not used."""
    return prod((radical(bases[n]) ** e for n, e in exponents.items() if e), start=radical(1))
