"""Sampled linear control laws as exact matrices: p = Cz + Dy, z⁺ = Fz + Gy.

Chapters: sizes, steady states and the sampled e-LQR; LQG compensators with an estimate of the disturbance, for a delay,
a lag or a diffusion path; a pressure limit at rest that prevents integrator windup.
"""

from collections.abc import Sequence
from dataclasses import field
from fractions import Fraction
from typing import ClassVar

from flint import fmpq, fmpq_mat

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import fraction_of, shortly
from quakedesign.laws.implicit_root import ImplicitStep

# ----------------------------------------------------------------------
# Sampled linear laws as exact matrices.

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

MEASURED = ("slip_error", "slip_rate_error")
NOISES = ("slip_noise", "rate_noise")
MOST_STATES = 12


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class LinearLaw:
    """p = Cz + Dy and z⁺ = Fz + Gy at every sample, y = (e1, e2) measured, z(0) = 0 by default.

    With an implicit step the law is linear in y = (e1, e2, w), where w solves the equation of the step for e1 and e2.

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
    implicit_step : ImplicitStep, optional
        Equation of w; None for a linear law.
    first : tuple of rows
        S, two columns: z = S(e1, e2) with the errors measured at the first sample; z = 0 if empty.
    applied : tuple of Fraction
        Change of z⁺ per Pa of (applied pressure − p) under limits; empty if the law has no anti-windup.
    of_reference : tuple of rows
        Two columns, for r [m] and r′ [m/s]: terms of z⁺ and, in the last row, terms of p [Pa]; 0 if empty. A law that
        measures the slip x1 = e1 + r has the same entries here as in `measured` and `feedback`.

    Raises
    ------
    ParameterError
        When the dimensions do not match, two states have the same name, or there are more than 12 states.
    """

    states: tuple[str, ...]
    update: Matrix
    measured: Matrix
    output: Row
    feedback: Row
    implicit_step: ImplicitStep | None = None
    first: Matrix = ()
    applied: Row = field(default=(), compare=False)
    of_reference: Matrix = ()

    def __post_init__(self) -> None:
        seen = len(MEASURED) + (self.implicit_step is not None)
        require_sizes(self.states, self.update, self.measured, self.output, self.feedback, seen)
        if self.first and [len(row) for row in self.first] != [len(MEASURED)] * len(self.states):
            raise ParameterError(
                f"first of a linear law must have {len(self.states)} rows of {len(MEASURED)} entries, or be empty. "
                f"Received rows of {', '.join(str(len(row)) for row in self.first)} entries."
            )
        if self.applied and len(self.applied) != len(self.states):
            raise ParameterError(
                f"applied of a linear law must have {len(self.states)} entries, one per state, or be empty. "
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
        return self.implicit_step is None and not any(row[1] for row in (*self.measured, self.feedback))


def require_sizes(
    states: tuple[str, ...], own: Matrix, measured: Matrix, output: Row, feedback: Row, seen: int = len(MEASURED)
) -> None:
    """Reject matrices of inconsistent sizes, and too many states."""
    n = len(states)
    if n > MOST_STATES or len(set(states)) != n:
        raise ParameterError(
            f"a linear law must have at most {MOST_STATES} states, with different names. "
            f"Received {n}: {', '.join(states[: MOST_STATES + 1])}."
        )
    matrices = {"F": (own, n, n), "G": (measured, n, seen), "C": ((output,), 1, n), "D": ((feedback,), 1, seen)}
    _require_shapes(f"a linear law with {n} states", matrices)


def _require_shapes(owner: str, matrices: dict[str, tuple[Matrix, int, int]]) -> None:
    for name, (matrix, height, width) in matrices.items():
        if [len(row) for row in matrix] != [width] * height:
            raise ParameterError(
                f"matrix {name} of {owner} must be {height} × {width}. Received "
                f"{len(matrix)} rows of {', '.join(str(len(row)) for row in matrix) or 'no'} entries."
            )


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class NominalModel:
    """Nominal model for the design of a law: e2' = s·e1 − w·e2 + β·b·(p − p*) + d.

    p* is the equilibrium pressure [Pa], and d the disturbance [m/s²].

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


def require_gain(gain: Fraction) -> None:
    """Reject a model whose input gain is not positive."""
    if gain <= 0:
        raise ParameterError(f"the input gain of a model must be positive. Received {shortly(gain)} m²/kg.")


def unit_row(size: int, entries: dict[int, Fraction]) -> Row:
    """Row of zeros but for these entries."""
    return tuple(entries.get(i, Fraction(0)) for i in range(size))


def _exact(rows: Sequence[Sequence[Fraction]]) -> fmpq_mat:
    return fmpq_mat([[fmpq(*v.as_integer_ratio()) for v in row] for row in rows])


def steady_states(own: Matrix, output: Row, rates: Row, pressure: Fraction) -> Row:
    """Steady state z of a law with zero errors: Mz = v and Cz = p; free components are 0.

    `own` is M, F − I of a sampled law and F in continuous time; `output` is C, `rates` v, and `pressure` p [Pa].

    Raises
    ------
    ParameterError
        When there is no such z.
    """
    rows = [*([*row, rate] for row, rate in zip(own, rates, strict=True)), [*output, pressure]]
    reduced, rank = _exact(rows).rref()
    solution = [Fraction(0)] * (len(output) + 1)
    for i in range(rank):
        pivot = next(j for j in range(len(solution)) if reduced[i, j] != 0)
        solution[pivot] = fraction_of(reduced[i, len(output)])
    if solution.pop():
        raise ParameterError(
            "a law must have a steady state with zero errors and a constant pressure. Received a law without "
            "integral action. Add an integral of the slip error, or an estimate of the disturbance."
        )
    return tuple(solution)


# ----------------------------------------------------------------------
# LQG compensators: a filter of a sampled model, and feedback of its estimate.


def compensator(
    states: tuple[str, ...], update: Matrix, command: Row, measured: Matrix, estimator: Matrix, feedback: Row
) -> LinearLaw:
    """Linear quadratic Gaussian (LQG) compensator of a sampled model x⁺ = Ax + Bp, y = Cx.

    x̂ = π + L(y − Cπ), p = −Kx̂ and π⁺ = Ax̂ + Bp, so that π⁺ = (A − BK)((I − LC)π + Ly). The states of the law are π.
    A prediction with a column of zeros in I − LC is replaced by the measurement and is no state of the law.

    Parameters
    ----------
    states : tuple of str
        Names of x.
    update, command : tuple of rows, tuple of Fraction
        A; B, per Pa.
    measured : tuple of rows
        C, two rows: of e1 [m] and e2 [m/s].
    estimator : tuple of rows
        L, two columns, per m and per m/s.
    feedback : tuple of Fraction
        K [Pa per unit of x].

    Raises
    ------
    ParameterError
        When the dimensions do not match, or more than 12 states remain.
    """
    n, seen = len(states), len(MEASURED)
    shapes = {"A": (update, n, n), "B": ((command,), 1, n), "C": (measured, seen, n), "L": (estimator, n, seen)}
    _require_shapes(f"a compensator with {n} states", shapes | {"K": ((feedback,), 1, n)})
    gains, corrections = _exact([feedback]), _exact(estimator)
    closed = _exact(update) - _exact([command]).transpose() * gains
    of_prediction = fmpq_mat([[fmpq(i == j) for j in range(n)] for i in range(n)]) - corrections * _exact(measured)
    used = [j for j in range(n) if any(of_prediction[i, j] != 0 for i in range(n))]

    def rows(matrix: fmpq_mat, of_rows: Sequence[int], columns: Sequence[int] = range(seen)) -> Matrix:
        return tuple(tuple(fraction_of(matrix[i, j]) for j in columns) for i in of_rows)

    return LinearLaw(
        states=tuple(states[j] for j in used),
        update=rows(closed * of_prediction, used, used),
        measured=rows(closed * corrections, used),
        output=rows(-gains * of_prediction, [0], used)[0],
        feedback=rows(-gains * corrections, [0])[0],
        applied=tuple(command[j] for j in used),
    )


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModel:
    """Sampled model of both errors and of the delayed pressures, under a constant disturbance d [m/s²].

    x⁺ = Ax + Bp + (As + B − s)d/b, x = (e1, e2, q), s = (0, 0, σ, …, σ). The constant pressure p = −d/b balances d: x =
    s·p is then a steady state. This is so for any A and B, so a law designed with rounded coefficients also has zero
    steady-state errors.

    Attributes
    ----------
    update : tuple of rows
        A.
    command : tuple of Fraction
        B, per Pa.
    gain : Fraction
        b [m²/kg], positive: β·b of the model.
    pressures : tuple of str
        Names of q.
    unit : Fraction
        σ: value of every q at a constant pressure of 1 Pa.

    Raises
    ------
    ParameterError
        When the dimensions do not match, the gain is not positive, or a constant pressure has no effect on the slip
        rate.
    """

    update: Matrix
    command: Row
    gain: Fraction
    pressures: tuple[str, ...] = ()
    unit: Fraction = Fraction(1)

    def __post_init__(self) -> None:
        n = 2 + len(self.pressures)
        _require_shapes(f"an error model with {n} states", {"A": (self.update, n, n), "B": ((self.command,), 1, n)})
        require_gain(self.gain)
        if not self.of_disturbance[1]:
            raise ParameterError(
                "the effect of a constant pressure on the slip rate of an error model must not be 0. Received 0. "
                "Correct update or command."
            )

    @classmethod
    def delayed(cls, of_errors: Matrix, of_commands: Matrix, gain: Fraction) -> "ErrorModel":
        """Model e⁺ = Φe + Σ_j γ_j(b·p_j + d), where p_j [Pa] is the pressure commanded j ≥ 0 samples ago.

        Parameters
        ----------
        of_errors : tuple of rows
            Φ.
        of_commands : tuple of (Fraction, Fraction)
            γ_j [s², s], at least one.
        gain : Fraction
            b [m²/kg], positive.
        """
        late = max(len(of_commands), 1) - 1
        _require_shapes("a delayed error model", {"Φ": (of_errors, 2, 2), "γ": (of_commands, late + 1, 2)})
        now, *before = (tuple(gain * v for v in row) for row in of_commands)
        errors = ((*row, *(v[i] for v in before)) for i, row in enumerate(of_errors))
        shifted = (unit_row(2 + late, {1 + j: Fraction(1)} if j else {}) for j in range(late))
        return cls(
            update=(*errors, *shifted),
            command=(*now, *(Fraction(j == 0) for j in range(late))),
            gain=gain,
            pressures=tuple(f"asked_{j + 1}_ago" for j in range(late)),
        )

    @property
    def of_disturbance(self) -> Row:
        """(As + B − s)/b: coefficients of d."""
        steady = (Fraction(0),) * 2 + (self.unit,) * len(self.pressures)
        rows = zip(self.update, self.command, steady, strict=True)
        return tuple((self.unit * sum(row[2:]) + own - rest) / self.gain for row, own, rest in rows)

    def compensator(self, gains: Row, corrections: Matrix) -> LinearLaw:
        """Compensator of e1, e2, d and q: p = −k(ê, q) − (1 + ks)d/b; q is computed, not corrected.

        Parameters
        ----------
        gains : tuple of Fraction
            k [Pa/m, Pa·s/m, and Pa per unit of q].
        corrections : tuple of rows
            Corrections of e1, e2 and d (rows) per innovation of e1 [m] and of e2 [m/s] (columns).
        """
        n, zero = 2 + len(self.pressures), Fraction(0)
        _require_shapes(f"an error model with {n} states", {"k": ((gains,), 1, n), "l": (corrections, 3, 2)})

        def inserted(row: Row, level: Fraction) -> Row:
            return (*row[:2], level, *row[2:])

        rows = [inserted(row, level) for row, level in zip(self.update, self.of_disturbance, strict=True)]
        return compensator(
            states=("predicted_slip", "predicted_rate", "disturbance", *self.pressures),
            update=(*rows[:2], unit_row(n + 1, {2: Fraction(1)}), *rows[2:]),
            command=inserted(self.command, zero),
            measured=tuple(unit_row(n + 1, {i: Fraction(1)}) for i in range(2)),
            estimator=(*corrections, *[(zero, zero)] * len(self.pressures)),
            feedback=inserted(gains, (1 + self.unit * sum(gains[2:])) / self.gain),
        )


def disturbance_estimate(gains: Row, weight: Fraction, model: ErrorModel) -> LinearLaw:
    """Feedback of slip and slip rate, with an estimate d of the disturbance over the last period.

    The measured errors replace the predicted ones, and d ← d + a(e2 − π2)/Γ2, where Γ2 is the effect of d on e2. The
    estimate follows the innovation of the slip rate and has no trend, so that it does not wind up while the fault is at
    rest. States: π2 [m/s], d [m/s²] and q.

    Parameters
    ----------
    gains : tuple of Fraction
        As those of `ErrorModel.compensator`.
    weight : Fraction
        a [-].
    model : ErrorModel
    """
    zero, one = Fraction(0), Fraction(1)
    return model.compensator(gains, ((one, zero), (zero, one), (zero, weight / model.of_disturbance[1])))


def slip_observer(gains: Row, corrections: tuple[Fraction, Fraction, Fraction], model: ErrorModel) -> LinearLaw:
    """Feedback of the slip alone: observer of slip error, slip-rate error and disturbance d.

    States: π [m, m/s], d [m/s²] and q. d is modelled as constant, without a trend state.

    Parameters
    ----------
    gains : tuple of Fraction
        As those of `ErrorModel.compensator`.
    corrections : (Fraction, Fraction, Fraction)
        l1, l2, l3 [-, 1/s, 1/s²], for the innovation e1 − π1.
    model : ErrorModel
    """
    return model.compensator(gains, tuple((correction, Fraction(0)) for correction in corrections))


# ----------------------------------------------------------------------
# Limit of the pressure while the fault is at rest, against windup of the law.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class RestLimit:
    """Limit at rest: lower limit of the pressure relative to all earlier pressures while the fault is at rest.

    The pressure is at least every earlier one minus `width` and `per_slip` times the motion of the reference since
    then. Let p* be the equilibrium pressure. A loop whose pressure stays within P of p*, with |dp*/dr| at most
    `per_slip`, never reaches a limit with a width of 2P, so that the limit does not affect a guarantee. While friction
    holds the fault at rest, measurements do not respond to the pressure, and while the slip is ahead of the reference
    an integral would lower the pressure without bound. The limit then saturates the pressure, with anti-windup of the
    law. The saturation ends when the fault moves, for any cause. The range of pressure that a proof covers is a limit
    too, at rest and in motion, unless the fault moves faster than the proof covers.

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
        For a width that is not positive, a negative per_slip, resolution or fastest, or an incomplete or invalid range.
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
        """Least and largest pressure, and the slip between two samples up to which they apply, or None."""
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
