"""Feed-forward terms of ν from the nominal plant or the uncertainty box."""

from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.errors import UnknownNameError, require_known
from quakedesign.exact import fraction_of, rational
from quakedesign.fault import Fault
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForward:
    """k̂0·x1 + η̂0·x2 + ι0·r'' [m/s²], added to ν before it is divided by μ0N̂0 (remark after eq. ps).

    The feed-forward adds the same terms to the matched perturbation h and does not change the loop in the errors. So a
    certificate of the law is valid with and without it; only the required bounds of h change.
    """

    name: str = "none"
    stiffness: Fraction = Fraction(0)  # k̂0 [1/s²]
    damping: Fraction = Fraction(0)  # η̂0 [1/s]
    inertia: Fraction = Fraction(0)  # ι0 [-], the share of r'' that is added; 1 in the paper's remark

    def __post_init__(self) -> None:
        for part in ("stiffness", "damping", "inertia"):
            object.__setattr__(self, part, rational(getattr(self, part), f"feed-forward {part}"))

    def acceleration(self, slip: sp.Expr, slip_rate: sp.Expr, reference_acceleration: sp.Expr) -> sp.Expr:
        """Feed-forward of ν [m/s²] at x1 [m], x2 [m/s] and r'' [m/s²]."""
        parts = zip(
            (self.stiffness, self.damping, self.inertia), (slip, slip_rate, reference_acceleration), strict=True
        )
        return sum((sp.Rational(c.numerator, c.denominator) * x for c, x in parts if c), start=sp.Integer(0))

    @property
    def coefficients(self) -> dict[str, Fraction]:
        """Exact coefficients by name."""
        return {"stiffness": self.stiffness, "damping": self.damping, "inertia": self.inertia}


NONE = FeedForward()


def _nominal(fault: Fault, _divisor: Fraction) -> FeedForward:
    """k̂ and η̂ at the midpoint of the uncertainty box, and all of r'': the paper's remark."""
    middle = plant.plant_values(fault)
    return FeedForward(
        name="nominal",
        stiffness=_fraction(middle[plant.k_hat]),
        damping=_fraction(middle[plant.eta_hat]),
        inertia=Fraction(1),
    )


def _centred(fault: Fault, divisor: Fraction) -> FeedForward:
    """Coefficients that minimise the largest residuals of ∂h/∂x1, ∂h/∂x2 and of r'' over the uncertainty box.

    They differ from the nominal ones since h = (…)/β with an uncertain β, and since slip weakening reduces the
    stiffness; k̂0 is negative if the weakening term exceeds twice that of the spring.
    """
    friction, middle, box = friction_bounds(fault.friction), plant.plant_values(fault), fault.box
    least, most = friction.least, friction.most
    authority = _fraction(middle[plant.N_hat])
    inverse = divisor / (most * authority * (1 + box.authority)), divisor / (least * authority * (1 - box.authority))
    k, eta = _fraction(middle[plant.k_hat]), _fraction(middle[plant.eta_hat])
    weakening = _fraction(middle[plant.sigma]) * divisor * most * friction.slip_slope / least**2
    stiffness = k * (1 + box.stiffness) * inverse[1], k * (1 - box.stiffness) * inverse[1] - weakening
    damping = eta * (1 - box.damping) * inverse[0], eta * (1 + box.damping) * inverse[1]
    return FeedForward(name="centred", stiffness=_middle(stiffness), damping=_middle(damping), inertia=_middle(inverse))


def _middle(ends: tuple[Fraction, Fraction]) -> Fraction:
    return (ends[0] + ends[1]) / 2


_NAMED = {"none": lambda _fault, _divisor: NONE, "nominal": _nominal, "centred": _centred}
FEED_FORWARDS = tuple(_NAMED)


def feed_forward(name: str, fault: Fault, divisor: Fraction) -> FeedForward:
    """Named feed-forward of a fault for a law with a divisor.

    Parameters
    ----------
    name : str
        ``none``; ``nominal``, the paper's remark; or ``centred``, with the smallest residuals.
    divisor : Fraction
        μ0N̂0 of the law [m²/kg].
    """
    require_known(name, _NAMED, "feed-forward", UnknownNameError)
    return _NAMED[name](fault, divisor)


def _fraction(value: sp.Expr) -> Fraction:
    exact = sp.nsimplify(value, rational=True)
    return fraction_of(exact)
