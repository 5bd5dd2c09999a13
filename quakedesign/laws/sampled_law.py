"""Sampled linear control laws as exact matrices: p = Cz + Dy, z⁺ = Fz + Gy.

Chapters: feedback with a disturbance estimate and the sampled e-LQR; slip-only feedback with an observer;
laws with a model of the diffusion path between well and fault; a pressure limit at rest that prevents
integrator windup.
"""

from dataclasses import field
from fractions import Fraction
from typing import ClassVar

from flint import fmpq, fmpq_mat

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import fraction_of, shortly
from quakedesign.laws.implicit_root import ImplicitRoot

# ----------------------------------------------------------------------
# Sampled linear laws as exact matrices.

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]
Estimated = tuple[tuple[str, ...], tuple[Row, Row], Row]

MEASURED = ("slip_error", "slip_rate_error")
NOISES = ("slip_noise", "rate_noise")
MOST_STATES = 12


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class LinearLaw:
    """p = Cz + Dy and z⁺ = Fz + Gy at every sample, y = (e1, e2) measured, z from 0 by default.

    With an implicit root the law is linear in y = (e1, e2, w), where w solves an implicit step from e1 and e2.

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
        Equation of w; None for a linear law.
    first : tuple of rows
        S, two columns: z = S(e1, e2) at the first sample, as they are measured then; without rows 0.
    applied : tuple of Fraction
        Change of z⁺ per Pa of (applied pressure − p) under limits; empty if the law has no anti-windup.
    of_reference : tuple of rows
        Two columns, for r [m] and r′ [m/s]: terms of z⁺, row by row, and in a last row of p [Pa]. A law that
        measures the slip x1 = e1 + r has the same entries here as in `measured` and `feedback`. Without rows 0.

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
    of_reference: Matrix = ()

    def __post_init__(self) -> None:
        seen = len(MEASURED) + (self.root is not None)
        require_sizes(self.states, self.update, self.measured, self.output, self.feedback, seen)
        if self.first and [len(row) for row in self.first] != [len(MEASURED)] * len(self.states):
            raise ParameterError(
                f"first of a linear law must have {len(self.states)} rows of {len(MEASURED)} entries, or be empty. "
                f"Received rows of {', '.join(str(len(row)) for row in self.first)} entries."
            )
        if self.applied and len(self.applied) != len(self.states):
            raise ParameterError(
                f"applied of a linear law must have {len(self.states)} entries, one a state, or be empty. "
                f"Received {len(self.applied)}."
            )
        if self.of_reference and [len(row) for row in self.of_reference] != [2] * (len(self.states) + 1):
            raise ParameterError(
                f"of_reference of a linear law must have {len(self.states) + 1} rows of 2 entries, the last one for "
                f"the pressure, or be empty. Received rows of {', '.join(str(len(row)) for row in self.of_reference)} "
                "entries."
            )

    @property
    def of_slip_alone(self) -> bool:
        """Whether the law does not use the slip rate."""
        return self.root is None and not any(row[1] for row in (*self.measured, self.feedback))


def require_sizes(
    states: tuple[str, ...], own: Matrix, measured: Matrix, output: Row, feedback: Row, seen: int = len(MEASURED)
) -> None:
    """Reject matrices of inconsistent sizes, and too many states."""
    n = len(states)
    if n > MOST_STATES or len(set(states)) != n:
        raise ParameterError(
            f"a linear law needs at most {MOST_STATES} states with different names. "
            f"Received {n}: {', '.join(states[: MOST_STATES + 1])}."
        )
    rows = {"F": (own, n, n), "G": (measured, n, seen), "C": ((output,), 1, n), "D": ((feedback,), 1, seen)}
    for name, (matrix, height, width) in rows.items():
        if [len(row) for row in matrix] != [width] * height:
            raise ParameterError(
                f"matrix {name} of a linear law with {n} states must be {height} × {width}. Received "
                f"{len(matrix)} rows of {', '.join(str(len(row)) for row in matrix) or 'no'} entries."
            )


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class NominalModel:
    """Nominal model of a law: e2' = s·e1 − w·e2 + β·b·(p − p*) + d.

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


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Prediction of the slip-rate error by the model of a law; any coefficients define a law.

    Attributes
    ----------
    of_slip, of_rate : Fraction
        Coefficients of the present e1 and e2 for e2 at the next sample.
    of_pushes : tuple of Fraction
        γ_j [s]: coefficients of βb·p + d for it, p being the pressure commanded j samples ago, from j = 0 on.
    ahead : tuple of rows
        Coefficients of the present e1 and e2 for both when the present command arrives; the unit matrix without delay.
    ahead_of_pushes : tuple of (Fraction, Fraction)
        Coefficients of βb·p + d for these [s², s], p being the pressure commanded j samples ago, from j = 1 on.

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
                "of_pushes of a prediction must have one entry more than ahead_of_pushes, with a sum other than 0. "
                f"Received {len(self.of_pushes)} and {len(self.ahead_of_pushes)} entries, and the sum "
                f"{shortly(sum(self.of_pushes))}."
            )


def summed_integrals(gains: tuple[Fraction, ...], step: Fraction) -> LinearLaw:
    """The sampled e-LQR: p = −k1e1 − k2e2 − k3ξ1 − k4ξ2, ξ1⁺ = ξ1 + T_s·e1, ξ2⁺ = ξ2 + T_s·ξ1 if k4 ≠ 0.

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
    if not k4:  # a PID has no ξ2
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
    """Feedback of slip and slip rate, with an estimate d of the disturbance over the last period.

    d ← d + a(e2 − π)/Σγ_j, p = −k1ê1 − k2ê2 − d/(βb) with ê the prediction of e when p arrives, and
    π ← of_slip·e1 + of_rate·e2 + Σγ_j(βb·p_j + d). The estimate follows the innovation of the slip rate and has no
    trend, so that it does not wind up while the fault is at rest. States: π [m/s], d [m/s²], and the earlier commands
    p_1, p_2 … [Pa].

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
    names, errors, level = _estimated(weight / sum(prediction.of_pushes), len(prediction.ahead_of_pushes))
    of_errors, of_pushes = ((prediction.of_slip, prediction.of_rate),), tuple((push,) for push in prediction.of_pushes)
    return _delayed(names, gains, gain, errors, level, of_errors, of_pushes, prediction)


def require_gain(gain: Fraction) -> None:
    """Reject a model whose input gain is not positive."""
    if gain <= 0:
        raise ParameterError(f"the input gain of a model must be positive. Received {shortly(gain)} m²/kg.")


def _estimated(share: Fraction, behind: int) -> Estimated:
    """Names of the first states, and rows for errors and disturbance that act on (π, d, `behind` others, e1, e2)."""
    size, one = 4 + behind, Fraction(1)
    level = unit_row(size, {0: -share, 1: one, size - 1: share})
    errors = unit_row(size, {size - 2: one}), unit_row(size, {size - 1: one})
    return ("predicted_rate", "disturbance"), errors, level


def _observed(corrections: tuple[Fraction, Fraction, Fraction], behind: int) -> Estimated:
    """As `_estimated`, acting on (π1, π2, d, `behind` others, e1, e2)."""
    size, one = 5 + behind, Fraction(1)
    innovation = unit_row(size, {0: -one, size - 2: one})
    slip, rate, level = (combined((one, unit_row(size, {i: one})), (v, innovation)) for i, v in enumerate(corrections))
    return ("predicted_slip", "predicted_rate", "disturbance"), (slip, rate), level


def _delayed(
    names: tuple[str, ...],
    gains: tuple[Fraction, Fraction],
    gain: Fraction,
    errors: tuple[Row, Row],
    level: Row,
    of_errors: Matrix,
    of_pushes: Matrix,
    prediction: "Prediction | ErrorPrediction",
) -> LinearLaw:
    """Law from rows for its states, then e1 and e2; the delay line shifts by one place."""
    require_gain(gain)
    one, late = Fraction(1), len(prediction.ahead_of_pushes)
    waiting = [unit_row(len(level), {len(names) + j: one}) for j in range(late)]
    before = [combined((gain, row), (one, level)) for row in waiting]
    slip, rate = (
        combined(
            *zip(row, errors, strict=True),
            *((v[i], p) for v, p in zip(prediction.ahead_of_pushes, before, strict=True)),
        )
        for i, row in enumerate(prediction.ahead)
    )
    asked = combined((-gains[0], slip), (-gains[1], rate), (-1 / gain, level))
    pushes = [combined((gain, asked), (one, level)), *before]
    predicted = [
        combined(*zip(row, errors, strict=True), *((v[i], push) for v, push in zip(of_pushes, pushes, strict=True)))
        for i, row in enumerate(of_errors)
    ]
    rows = [*predicted, level, *[asked, *waiting][:late]]
    return LinearLaw(
        states=(*names, *(f"asked_{j + 1}_ago" for j in range(late))),
        update=tuple(row[:-2] for row in rows),
        measured=tuple(row[-2:] for row in rows),
        output=asked[:-2],
        feedback=asked[-2:],
        applied=(*(gain * v for v in of_pushes[0]), Fraction(0), *[one, *[Fraction(0)] * late][:late]),
    )


def unit_row(size: int, entries: dict[int, Fraction]) -> Row:
    """Row of zeros but for these entries."""
    return tuple(entries.get(i, Fraction(0)) for i in range(size))


def combined(*parts: tuple[Fraction, Row]) -> Row:
    """Combination of rows."""
    scaled = ([factor * v for v in row] for factor, row in parts)
    return tuple(sum(column, Fraction(0)) for column in zip(*scaled, strict=True))


def steady_states(own: Matrix, output: Row, rates: Row, asked: Fraction) -> Row:
    """Steady states z of a law with zero errors: Mz = v and Cz = p; free components are 0.

    Raises
    ------
    ParameterError
        When there are none.
    """
    rows = [*([*row, rate] for row, rate in zip(own, rates, strict=True)), [*output, asked]]
    reduced, rank = fmpq_mat([[fmpq(*v.as_integer_ratio()) for v in row] for row in rows]).rref()
    found = [Fraction(0)] * (len(output) + 1)
    for i in range(rank):
        pivot = next(j for j in range(len(found)) if reduced[i, j] != 0)
        found[pivot] = fraction_of(reduced[i, len(output)])
    if found.pop():
        raise ParameterError(
            "a law must have a steady state with zero errors and a constant pressure. Received a law without "
            "integral action. Add an integral of the slip error, or an estimate of the disturbance."
        )
    return tuple(found)


# ----------------------------------------------------------------------
# Sampled law that measures the slip alone: observer of both errors and of the disturbance.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ErrorPrediction:
    """Prediction of both errors by the model of an observer; any coefficients define a law.

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
                "of_pushes of a prediction must have one entry more than ahead_of_pushes. "
                f"Received {len(self.of_pushes)} and {len(self.ahead_of_pushes)} entries."
            )


def slip_observer(
    gains: tuple[Fraction, Fraction],
    corrections: tuple[Fraction, Fraction, Fraction],
    prediction: ErrorPrediction,
    gain: Fraction,
) -> LinearLaw:
    """Feedback of the slip alone: observer of slip error, slip-rate error and disturbance d.

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
    """
    names, errors, level = _observed(corrections, len(prediction.ahead_of_pushes))
    return _delayed(names, gains, gain, errors, level, prediction.of_errors, prediction.of_pushes, prediction)


# ----------------------------------------------------------------------
# Laws with a model of the path between their pressure and the fault.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class PathModel:
    """Model of fault and diffusion path in a law; any coefficients define a law.

    Attributes
    ----------
    of_errors : tuple of rows
        Φ: of e1 and e2 now, for both at the next sample.
    of_pressures : tuple of rows
        m_i [s², s]: coefficients of βb·q_i for either, q_i being the pressures of the path.
    of_asked : tuple of Fraction
        n [s², s]: coefficients of βb·p for either, p being the present command.
    kept : tuple of rows
        R with q⁺ = Rq + (1 − R1)p, so that q = p where p is constant.

    Raises
    ------
    ParameterError
        When sizes do not fit, or the pressure has no effect on the fault.
    """

    of_errors: Matrix
    of_pressures: Matrix
    of_asked: Row
    kept: Matrix

    def __post_init__(self) -> None:
        n = max(map(len, self.of_pressures), default=0)
        sizes = [len(row) for row in (*self.kept, *self.of_pressures)]
        if sizes != [n] * (n + 2) or len(self.of_pressures) != 2 or len(self.of_asked) != 2:
            raise ParameterError(
                f"a path model with {n} pressures needs kept of {n} × {n}, of_pressures of 2 × {n} and of_asked of 2 "
                f"entries. Received {len(self.kept)} and {len(self.of_pressures)} rows of "
                f"{', '.join(map(str, sizes)) or 'no'} entries, and {len(self.of_asked)} entries of of_asked."
            )
        if not self.of_constant[1]:
            raise ParameterError(
                "the gain of a path model from a constant pressure to the slip rate must not be 0. Received 0. "
                "Correct of_asked or of_pressures."
            )

    @property
    def of_constant(self) -> Row:
        """Γ [s², s]: coefficients of βb·p for constant p."""
        return tuple(sum(row, own) for row, own in zip(self.of_pressures, self.of_asked, strict=True))


def estimate_through_path(gains: Row, weight: Fraction, model: PathModel, gain: Fraction) -> LinearLaw:
    """Feedback of slip, slip rate and path pressures, with an estimate d of the disturbance.

    d ← d + a(e2 − π)/Γ2, p = −k1e1 − k2e2 − Σ k_i(q_i + d/(βb)) − d/(βb), π ← Φ2e + βb(Σ m_2iq_i + n2p) + Γ2d, and q ←
    Rq + (1 − R1)p, which is computed, not measured. States: π [m/s], d and βb·q [m/s²], of similar magnitude.

    Parameters
    ----------
    gains : tuple of Fraction
        k1 [Pa/m], k2 [Pa·s/m] and k_i [-] of every pressure.
    weight : Fraction
        a [-].
    model : PathModel
    gain : Fraction
        β·b of the model [m²/kg], positive.

    Raises
    ------
    ParameterError
        When the gains do not fit, or the model's is not positive.
    """
    return _through(*_estimated(weight / model.of_constant[1], len(model.kept)), gains, model, gain)


def observer_through_path(
    gains: Row, corrections: tuple[Fraction, Fraction, Fraction], model: PathModel, gain: Fraction
) -> LinearLaw:
    """Feedback of the slip alone through a path: observer of both errors and disturbance d.

    ê ← π + l(e1 − π1) and d ← d + l3(e1 − π1), p of ê as that of `estimate_through_path` of e, and π ← Φê + βb(Σ m_iq_i
    + np) + Γd. States: π [m, m/s], d and βb·q [m/s²].

    Parameters
    ----------
    gains : tuple of Fraction
        k1 [Pa/m], k2 [Pa·s/m] and k_i [-] of every pressure.
    corrections : (Fraction, Fraction, Fraction)
        l1, l2, l3 [-, 1/s, 1/s²].
    model : PathModel
    gain : Fraction
        β·b of the model [m²/kg], positive.

    Raises
    ------
    ParameterError
        As `estimate_through_path`.
    """
    return _through(*_observed(corrections, len(model.kept)), gains, model, gain)


def _through(
    names: tuple[str, ...], errors: tuple[Row, Row], level: Row, gains: Row, model: PathModel, gain: Fraction
) -> LinearLaw:
    """Law of the last so many predictions, the level and the path, from rows for the errors and the level."""
    count, own = len(model.kept), len(names)
    if len(gains) != 2 + count or gain <= 0:
        raise ParameterError(
            f"a law with a path model of {count} pressures needs {2 + count} gains and a positive input gain of the "
            f"model. Received {len(gains)} gains and the input gain {shortly(gain)} m²/kg."
        )
    path = [unit_row(len(level), {own + i: Fraction(1)}) for i in range(count)]
    away = [combined((1 / gain, q), (1 / gain, level)) for q in path]
    asked = combined(*((-k, row) for k, row in zip(gains, (*errors, *away), strict=True)), (-1 / gain, level))
    expected = zip(model.of_errors, model.of_pressures, model.of_asked, model.of_constant, strict=True)
    predicted = [
        combined(*zip(now, errors, strict=True), *zip(pushed, path, strict=True), (gain * n, asked), (constant, level))
        for now, pushed, n, constant in expected
    ]
    fresh = [gain * (1 - sum(row)) for row in model.kept]
    kept = [combined(*zip(row, path, strict=True), (new, asked)) for row, new in zip(model.kept, fresh, strict=True)]
    rows = [*predicted[1 - own :], level, *kept]
    return LinearLaw(
        states=(*names, *(f"path{i}" for i in range(count))),
        update=tuple(row[:-2] for row in rows),
        measured=tuple(row[-2:] for row in rows),
        output=asked[:-2],
        feedback=asked[-2:],
        applied=(*[gain * n for n in model.of_asked[1 - own :]], Fraction(0), *fresh),
    )


# ----------------------------------------------------------------------
# Limit of the pressure while the fault is at rest, against windup of the law.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class RestLimit:
    """Limit at rest: lower limit of the pressure relative to all earlier pressures while the fault is at rest.

    The pressure is at least any earlier one minus `width` minus `per_slip` times the motion of the reference since. A
    loop whose pressure stays within P of p*, with dp*/dr at most `per_slip`, never reaches a limit with a width of 2P,
    so that the limit does not affect a guarantee. While friction holds the fault, measurements do not respond to the
    pressure, and an integral ahead of the reference would lower the pressure without end. The limit then saturates the
    pressure, with anti-windup of the law. It ends when the fault moves, for any cause. The proved range of pressure
    limits the pressure too, at rest and after it, unless the fault moves faster than is proved.

    Attributes
    ----------
    width : Fraction
        [Pa].
    per_slip : Fraction
        [Pa/m].
    resolution : Fraction
        Largest measured slip between two samples of a fault at rest [m].
    least, largest : Fraction, optional
        Proved range of the pressure [Pa]; both or none.
    fastest : Fraction
        Largest measured slip between two samples for which this range applies [m].
    STATES : tuple of str
        Largest p + per_slip·r of all samples so far [Pa], r being the reference, which never decreases, and the last
        measured slip [m].

    Raises
    ------
    ParameterError
        For a width that is not positive, or another number that is negative.
    """

    STATES: ClassVar[tuple[str, ...]] = ("highest_pressure", "last_slip")
    UNITS: ClassVar[tuple[str, ...]] = ("Pa", "m")

    width: Fraction
    per_slip: Fraction
    resolution: Fraction = Fraction(0)
    least: Fraction | None = None
    largest: Fraction | None = None
    fastest: Fraction = Fraction(0)

    @property
    def range(self) -> tuple[Fraction, Fraction, Fraction] | None:
        """Least and largest pressure, and the slip between two samples up to which they hold, or None."""
        return None if self.least is None or self.largest is None else (self.least, self.largest, self.fastest)

    def __post_init__(self) -> None:
        if (self.least is None) != (self.largest is None) or not (self.least or 0) <= 0 <= (self.largest or 0):
            ends = [None if end is None else f"{shortly(end)} Pa" for end in (self.least, self.largest)]
            raise ParameterError(
                "least and largest of a limit at rest must be both omitted, or least <= 0 <= largest. "
                f"Received least {ends[0]} and largest {ends[1]}."
            )
        if self.width <= 0:
            raise ParameterError(f"width of a limit at rest must be positive. Received {shortly(self.width)} Pa.")
        for name, unit in (("per_slip", "Pa/m"), ("resolution", "m"), ("fastest", "m")):
            if (value := getattr(self, name)) < 0:
                raise ParameterError(f"{name} of a limit at rest must be 0 or more. Received {shortly(value)} {unit}.")
