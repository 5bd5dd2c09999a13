"""Linear laws that run once per sample, as exact matrices."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

MEASURED = ("slip_error", "slip_rate_error")
MOST_STATES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLaw:
    """p = Cz + Dy and z⁺ = Fz + Gy at every sample, y = (e1, e2) measured, z from 0.

    Attributes
    ----------
    states : tuple of str
        Names of z; their units are the law's own.
    update : tuple of rows
        F.
    measured : tuple of rows
        G, two columns: for e1 [m] and e2 [m/s].
    output : tuple of Fraction
        C, so that Cz is in Pa.
    feedback : (Fraction, Fraction)
        D [Pa/m, Pa·s/m].

    Raises
    ------
    ParameterError
        When the sizes do not fit, or there are more than 12 states.
    """

    states: tuple[str, ...]
    update: Matrix
    measured: Matrix
    output: Row
    feedback: Row

    def __post_init__(self) -> None:
        n = len(self.states)
        fits = (
            n <= MOST_STATES
            and len(set(self.states)) == n
            and [len(row) for row in self.update] == [n] * n
            and [len(row) for row in self.measured] == [len(MEASURED)] * n
            and len(self.output) == n
            and len(self.feedback) == len(MEASURED)
        )
        if not fits:
            raise ParameterError(
                f"a linear law needs F of n × n, G of n × 2, C of n and D of 2 entries, n at most {MOST_STATES} states "
                f"of different names. Received {n} states ({', '.join(self.states)}) and other sizes. Complete them."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Middle of what may be: e2' = s·e1 − w·e2 + β·b·(p − p*) + d, which a law predicts with.

    Attributes
    ----------
    slip : Fraction
        s [1/s²].
    rate : Fraction
        w [1/s].
    gain : Fraction
        β·b [m²/kg], positive.
    """

    slip: Fraction
    rate: Fraction
    gain: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """One sample ahead, e2⁺ ≈ of_slip·e1 + of_rate·e2 + of_push·(β·b·p + d); any numbers give a law."""

    of_slip: Fraction
    of_rate: Fraction
    of_push: Fraction


def summed_integrals(gains: tuple[Fraction, ...], step: Fraction) -> LinearLaw:
    """The e-LQR as it is sampled: p = −k1e1 − k2e2 − k3ξ1 − k4ξ2, ξ1⁺ = ξ1 + T_s·e1, ξ2⁺ = ξ2 + T_s·ξ1.

    Parameters
    ----------
    gains : tuple of Fraction
        k1 … k4 [Pa/m, Pa·s/m, Pa/(m s), Pa/(m s²)].
    step : Fraction
        T_s [s].

    Raises
    ------
    ParameterError
        When there are not four gains.
    """
    if len(gains) != 4:
        raise ParameterError(f"gains of summed_integrals must be four. Received {len(gains)}. Give k1 to k4.")
    k1, k2, k3, k4 = gains
    zero, one = Fraction(0), Fraction(1)
    return LinearLaw(
        states=("xi1", "xi2"),
        update=((one, zero), (step, one)),
        measured=((step, zero), (zero, zero)),
        output=(-k3, -k4),
        feedback=(-k1, -k2),
    )


def disturbance_estimate(
    gains: tuple[Fraction, Fraction], weight: Fraction, prediction: Prediction, gain: Fraction
) -> LinearLaw:
    """Feedback of slip and slip rate, and a level d of everything else that the last period showed.

    d ← d + a(e2 − π)/γ, p = −k1e1 − k2e2 − d/(βb), π ← of_slip·e1 + of_rate·e2 + γ(βb·p + d): the estimate follows the
    innovation of the slip rate and has no trend, so that it does not wind up while the fault sticks.

    Parameters
    ----------
    gains : (Fraction, Fraction)
        k1, k2 [Pa/m, Pa·s/m].
    weight : Fraction
        a [-].
    prediction : Prediction
        Of the slip rate, with γ = of_push [s] other than 0.
    gain : Fraction
        β·b of the model [m²/kg].
    """
    if not prediction.of_push or gain <= 0:
        raise ParameterError("a disturbance estimate needs of_push other than 0 and a positive gain. Received others.")
    k1, k2 = gains
    gamma, share, one = prediction.of_push, weight / prediction.of_push, Fraction(1)
    level = ((-share, one), (Fraction(0), share))  # d⁺ of (π, d) and of (e1, e2)
    output = tuple(-v / gain for v in level[0])
    feedback = (-k1, -k2 - level[1][1] / gain)
    ahead = tuple(gamma * (gain * p + d) for p, d in zip(output, level[0], strict=True))
    own = (prediction.of_slip, prediction.of_rate)
    seen = tuple(x + gamma * (gain * p + d) for x, p, d in zip(own, feedback, level[1], strict=True))
    return LinearLaw(
        states=("predicted_rate", "disturbance"),
        update=(ahead, level[0]),
        measured=(seen, level[1]),
        output=output,
        feedback=feedback,
    )
