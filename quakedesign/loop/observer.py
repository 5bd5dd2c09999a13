"""A law of samples that measures the slip alone: an observer of both errors and of the disturbance."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import LinearLaw, Matrix, answered, combined, law_of_rows, require_gain, unit_row


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorPrediction:
    """What an observer expects of both errors, from its model; any numbers give a law, good ones a good one.

    Attributes
    ----------
    of_errors : tuple of rows
        Φ: of e1 and e2 now, for both at the next sample.
    of_pushes : tuple of (Fraction, Fraction)
        γ_j [s², s]: what βb·p + d adds to that, p being what was asked for j samples ago, from 0 on.
    ahead, ahead_of_pushes : tuple of rows
        As those of `Prediction`.

    Raises
    ------
    ParameterError
        When the pushes of both do not fit.
    """

    of_errors: Matrix
    of_pushes: Matrix
    ahead: Matrix = ((Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)))
    ahead_of_pushes: Matrix = ()

    def __post_init__(self) -> None:
        if len(self.of_pushes) != len(self.ahead_of_pushes) + 1:
            raise ParameterError(
                "a prediction needs pushes from 0 and from 1 sample ago on. "
                f"Received {len(self.of_pushes)} and {len(self.ahead_of_pushes)}. Complete them."
            )


def slip_observer(
    gains: tuple[Fraction, Fraction],
    corrections: tuple[Fraction, Fraction, Fraction],
    prediction: ErrorPrediction,
    gain: Fraction,
) -> LinearLaw:
    """Feedback of the slip alone: an observer of slip error, slip-rate error and the level d of everything else.

    ê ← π + l·(e1 − π1) and d ← d + l3(e1 − π1), p = −k1ê1 − k2ê2 − d/(βb) with ê as expected when p arrives, and π ←
    Φê + Σγ_j(βb·p_j + d). The level has no trend. States: π [m, m/s], d [m/s²], and the pressures p_1, p_2 … asked for
    before [Pa].

    Parameters
    ----------
    gains : (Fraction, Fraction)
        k1, k2 [Pa/m, Pa·s/m].
    corrections : (Fraction, Fraction, Fraction)
        l1, l2, l3 [-, 1/s, 1/s²].
    prediction : ErrorPrediction
    gain : Fraction
        β·b of the model [m²/kg], positive.

    Raises
    ------
    ParameterError
    """
    require_gain(gain)
    late = len(prediction.ahead_of_pushes)
    size, one = 5 + late, Fraction(1)  # rows act on (π1, π2, d, p_1 …) and then on (e1, e2)
    innovation = unit_row(size, {0: -one, size - 2: one})
    slip, rate, level = (combined((one, unit_row(size, {i: one})), (v, innovation)) for i, v in enumerate(corrections))
    waiting = [unit_row(size, {3 + j: one}) for j in range(late)]
    asked, pushes = answered(gains, gain, (slip, rate), level, waiting, prediction.ahead, prediction.ahead_of_pushes)
    predicted = [
        combined(
            (of_slip, slip),
            (of_rate, rate),
            *((v[i], push) for v, push in zip(prediction.of_pushes, pushes, strict=True)),
        )
        for i, (of_slip, of_rate) in enumerate(prediction.of_errors)
    ]
    pushed = (*(gain * v for v in prediction.of_pushes[0]), Fraction(0))
    return law_of_rows(("predicted_slip", "predicted_rate", "disturbance"), [*predicted, level], asked, waiting, pushed)
