"""What acts on a run beside the fault's own disturbance: the far field, and a perturbation of the user's."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import require_nonnegative
from quakedesign.rationals import rational
from quakedesign.symbolic import plant

if TYPE_CHECKING:
    import sympy as sp

    from quakedesign.fault import Fault

SYMBOLS = ("slip", "slip_rate", "time")


@dataclass(frozen=True, kw_only=True)
class Load:
    """Drift of the far end of the spring, and a perturbation φ_e(slip, slip rate, time).

    The far end is at rest until t = 0 in the sense that the fault is then on the verge of slip, moves at the drift rate
    from then on, and so adds k̂·drift·t to x2' (ERRATA 24); a perturbation is added to that of the fault.

    Attributes
    ----------
    drift : float
        v_∞ [m/s], not negative.
    perturbation : Expr or None
        φ̂_e [m/s²], a SymPy expression of the symbols ``slip`` [m] (x1), ``slip_rate`` [m/s] (x2) and ``time`` [s].

    Raises
    ------
    ParameterError
        For a drift that is negative or not finite, or a perturbation in other symbols.
    """

    drift: float = 0.0
    perturbation: "sp.Expr | None" = None

    def __post_init__(self) -> None:
        require_nonnegative(drift=self.drift)
        if self.perturbation is None:
            return
        try:
            expression = sp.sympify(self.perturbation, strict=True)
        except sp.SympifyError:
            expression = None
        names = {symbol.name for symbol in expression.free_symbols} if isinstance(expression, sp.Expr) else {"?"}
        if not names <= set(SYMBOLS):
            raise ParameterError(
                f"perturbation must be a SymPy expression of the symbols {', '.join(SYMBOLS)}, in m/s². "
                f"Received {self.perturbation!r}."
            )
        object.__setattr__(self, "perturbation", expression)

    @cached_property
    def acceleration(self) -> "sp.Expr":
        """φ̂_e [m/s²] of the user alone, in x1, x2 and t of `quakedesign.symbolic.plant`."""
        if self.perturbation is None:
            return sp.Integer(0)
        meant = dict(zip(SYMBOLS, (plant.x1, plant.x2, plant.t), strict=True))
        named = {symbol: meant[symbol.name] for symbol in self.perturbation.free_symbols}
        return self.perturbation.subs(named, simultaneous=True)

    def push(self, fault: "Fault") -> "sp.Expr":
        """k̂·drift·t [m/s²] of the far end on a fault, in t of `quakedesign.symbolic.plant`."""
        return plant.plant_values(fault)[plant.k_hat] * sp.Rational(str(rational(self.drift))) * plant.t


NOTHING = Load()
