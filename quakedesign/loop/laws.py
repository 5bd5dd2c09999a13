"""Linear laws that run once per sample, as exact matrices."""

from dataclasses import dataclass, field
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.implicit_root import ImplicitRoot
from quakedesign.rationals import shortly

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

MEASURED = ("slip_error", "slip_rate_error")
NOISES = ("slip_noise", "rate_noise")
MOST_STATES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLaw:
    """p = Cz + Dy and z⁺ = Fz + Gy at every sample, y = (e1, e2) measured, z from 0 unless told.

    With an implicit root the law is linear but for w, the end of an implicit step from e1 and e2, and y = (e1, e2, w).

    Attributes
    ----------
    states : tuple of str
        Names of z; their units are the law's own.
    update : tuple of rows
        F.
    measured : tuple of rows
        G, two columns: for e1 [m] and e2 [m/s]; a third for w [m/s].
    output : tuple of Fraction
        C, so that Cz is in Pa.
    feedback : (Fraction, Fraction)
        D [Pa/m, Pa·s/m]; a third entry for w [Pa·s/m].
    root : ImplicitRoot, optional
        What w solves; None for a linear law.
    first : tuple of rows
        S, two columns: z = S(e1, e2) at the first sample, as they are measured then; without rows 0.
    applied : tuple of Fraction
        What z⁺ gains per Pa that is applied beyond p, where limits cut it off; without entries the law is not told.

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
    root: ImplicitRoot | None = None
    first: Matrix = ()
    applied: Row = field(default=(), compare=False)

    def __post_init__(self) -> None:
        seen = len(MEASURED) + (self.root is not None)
        require_sizes(self.states, self.update, self.measured, self.output, self.feedback, seen)
        if self.first and [len(row) for row in self.first] != [len(MEASURED)] * len(self.states):
            raise ParameterError(
                f"first of a linear law needs {len(self.states)} rows of {len(MEASURED)} entries, or none. Received "
                f"{len(self.first)} rows. Complete them."
            )
        if self.applied and len(self.applied) != len(self.states):
            raise ParameterError(
                f"applied of a linear law needs {len(self.states)} entries, or none. Received {len(self.applied)}. "
                "Complete them."
            )

    @property
    def of_slip_alone(self) -> bool:
        """Whether it does without the slip rate."""
        return self.root is None and not any(row[1] for row in (*self.measured, self.feedback))


def require_sizes(
    states: tuple[str, ...], own: Matrix, measured: Matrix, output: Row, feedback: Row, seen: int = len(MEASURED)
) -> None:
    """Refuse matrices of a law whose sizes do not fit, and too many states.

    Raises
    ------
    ParameterError
    """
    n = len(states)
    fits = (
        n <= MOST_STATES
        and len(set(states)) == n
        and [len(row) for row in own] == [n] * n
        and [len(row) for row in measured] == [seen] * n
        and len(output) == n
        and len(feedback) == seen
    )
    if not fits:
        raise ParameterError(
            f"a linear law needs F of n × n, G of n × {seen}, C of n and D of {seen} entries, n at most {MOST_STATES} "
            f"states of different names. Received {n} states ({', '.join(states)}) and other sizes. Complete them."
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
    """What a law expects, from its model; any numbers give a law, good ones a good one.

    Attributes
    ----------
    of_slip, of_rate : Fraction
        Of e1 and e2 now, for e2 at the next sample.
    of_pushes : tuple of Fraction
        γ_j [s]: what βb·p + d adds to that, p being what was asked for j samples ago, from 0 on.
    ahead : tuple of rows
        Of e1 and e2 now, for both when the pressure asked for now arrives; the unit matrix without delay.
    ahead_of_pushes : tuple of (Fraction, Fraction)
        What βb·p + d adds to these [s², s], p being what was asked for j samples ago, from 1 on.

    Raises
    ------
    ParameterError
        When the pushes of both do not fit, or those of the next sample add up to zero.
    """

    of_slip: Fraction
    of_rate: Fraction
    of_pushes: Row
    ahead: Matrix = ((Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)))
    ahead_of_pushes: Matrix = ()

    def __post_init__(self) -> None:
        if len(self.of_pushes) != len(self.ahead_of_pushes) + 1 or not sum(self.of_pushes):
            raise ParameterError(
                "a prediction needs pushes from 0 and from 1 sample ago on, those of the next sample not zero in all. "
                f"Received {len(self.of_pushes)} and {len(self.ahead_of_pushes)}. Complete them."
            )


def summed_integrals(gains: tuple[Fraction, ...], step: Fraction) -> LinearLaw:
    """The e-LQR as it is sampled: p = −k1e1 − k2e2 − k3ξ1 − k4ξ2, ξ1⁺ = ξ1 + T_s·e1, ξ2⁺ = ξ2 + T_s·ξ1 if k4 ≠ 0.

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
    if not k4:  # a PID, of which ξ2 is no part
        return LinearLaw(
            states=("xi1",), update=((one,),), measured=((step, zero),), output=(-k3,), feedback=(-k1, -k2)
        )
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

    d ← d + a(e2 − π)/Σγ_j, p = −k1ê1 − k2ê2 − d/(βb) with ê = e as expected when p arrives, and
    π ← of_slip·e1 + of_rate·e2 + Σγ_j(βb·p_j + d). The estimate follows the innovation of the slip rate and has no
    trend, so that it does not wind up while the fault sticks. States: π [m/s], d [m/s²], and the pressures p_1, p_2 …
    asked for before [Pa].

    Parameters
    ----------
    gains : (Fraction, Fraction)
        k1, k2 [Pa/m, Pa·s/m].
    weight : Fraction
        a [-].
    prediction : Prediction
    gain : Fraction
        β·b of the model [m²/kg], positive.
    """
    require_gain(gain)
    late = len(prediction.ahead_of_pushes)
    size = 4 + late  # rows act on (π, d, p_1 …) and then on (e1, e2)
    share, one = weight / sum(prediction.of_pushes), Fraction(1)
    level = unit_row(size, {0: -share, 1: one, size - 1: share})
    errors = unit_row(size, {size - 2: one}), unit_row(size, {size - 1: one})
    waiting = [unit_row(size, {2 + j: one}) for j in range(late)]
    asked, pushes = answered(gains, gain, errors, level, waiting, prediction.ahead, prediction.ahead_of_pushes)
    own = unit_row(size, {size - 2: prediction.of_slip, size - 1: prediction.of_rate})
    predicted = combined((one, own), *zip(prediction.of_pushes, pushes, strict=True))
    pushed = (gain * prediction.of_pushes[0], Fraction(0))
    return law_of_rows(("predicted_rate", "disturbance"), [predicted, level], asked, waiting, pushed)


def require_gain(gain: Fraction) -> None:
    """Refuse a model whose pressure does nothing, or the wrong thing."""
    if gain <= 0:
        raise ParameterError(f"the gain of a model must be positive. Received {shortly(gain)} m²/kg. Check its sign.")


def answered(
    gains: tuple[Fraction, Fraction],
    gain: Fraction,
    errors: tuple[Row, Row],
    level: Row,
    waiting: list[Row],
    ahead: Matrix,
    ahead_of_pushes: Matrix,
) -> tuple[Row, list[Row]]:
    """The pressure asked for, and βb·p_j + d for it and every one that waits."""
    one = Fraction(1)
    before = [combined((gain, row), (one, level)) for row in waiting]
    expected = [
        combined(
            *zip(row, errors, strict=True), *((v[i], push) for v, push in zip(ahead_of_pushes, before, strict=True))
        )
        for i, row in enumerate(ahead)
    ]
    asked = combined((-gains[0], expected[0]), (-gains[1], expected[1]), (-1 / gain, level))
    return asked, [combined((gain, asked), (one, level)), *before]


def law_of_rows(names: tuple[str, ...], own: list[Row], asked: Row, waiting: list[Row], pushed: Row) -> LinearLaw:
    """Law of rows that act on its states and then on e1 and e2; pressures on their way move one place on.

    Its own states gain `pushed` per Pa that is applied.
    """
    rows = [*own, *[asked, *waiting][: len(waiting)]]
    return LinearLaw(
        states=(*names, *(f"asked_{j + 1}_ago" for j in range(len(waiting)))),
        update=tuple(row[:-2] for row in rows),
        measured=tuple(row[-2:] for row in rows),
        output=asked[:-2],
        feedback=asked[-2:],
        applied=(*pushed, *[Fraction(1), *[Fraction(0)] * len(waiting)][: len(waiting)]),
    )


def unit_row(size: int, entries: dict[int, Fraction]) -> Row:
    """Row of zeros but for these entries."""
    return tuple(entries.get(i, Fraction(0)) for i in range(size))


def combined(*parts: tuple[Fraction, Row]) -> Row:
    """Combination of rows."""
    scaled = ([factor * v for v in row] for factor, row in parts)
    return tuple(sum(column, Fraction(0)) for column in zip(*scaled, strict=True))
