"""How far the real fault may be from the nominal one."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError, UnknownNameError, require_known


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBox:
    """Relative half-widths of the plant's parameters; friction is uncertain in every box.

    In every box μ_res ≤ μ ≤ μ_max, the chord slope of μ in slip is at most that of the law, and slip ≥ 0.

    Attributes
    ----------
    name : str
    stiffness, damping, authority : Fraction
        Half-widths of k̂, η̂ and N̂ relative to their nominal values [-], in [0, 1).
    """

    name: str
    stiffness: Fraction = Fraction(0)
    damping: Fraction = Fraction(0)
    authority: Fraction = Fraction(0)

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
    """Named box: ``paper`` (only friction is uncertain) or ``ten-percent`` (also ±10 % on k, η and N̂).

    Raises
    ------
    UnknownNameError
    """
    require_known(name, BOXES, "uncertainty box", UnknownNameError)
    return BOXES[name]
