"""Laws that carry a model of what stands between their pressure and the fault."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import LinearLaw, Matrix, Row, combined, unit_row
from quakedesign.rationals import shortly


@dataclass(frozen=True, slots=True, kw_only=True)
class PathModel:
    """What a law expects of fault and path; any numbers give a law, good ones a good one.

    Attributes
    ----------
    of_errors : tuple of rows
        Φ: of e1 and e2 now, for both at the next sample.
    of_pressures : tuple of rows
        m_i [s², s]: what βb·q_i adds to either, q_i being the pressures of the path.
    of_asked : tuple of Fraction
        n [s², s]: what βb·p adds to either, p being what is asked for now.
    kept : tuple of rows
        R with q⁺ = Rq + (1 − R1)p, so that q = p where p is constant.

    Raises
    ------
    ParameterError
        When sizes do not fit, or no pressure moves the fault.
    """

    of_errors: Matrix
    of_pressures: Matrix
    of_asked: Row
    kept: Matrix

    def __post_init__(self) -> None:
        n = len(self.of_pressures[0])
        sizes = [len(row) for row in (*self.kept, *self.of_pressures)]
        if sizes != [n] * (n + 2) or not self.of_constant[1]:
            raise ParameterError(
                f"a model of {n} pressures needs {n} × {n} numbers of how they are kept, and a constant pressure must "
                "move the fault. Received another one. Complete it."
            )

    @property
    def of_constant(self) -> Row:
        """Γ [s², s]: what βb·p adds where p is constant."""
        return tuple(sum(row, own) for row, own in zip(self.of_pressures, self.of_asked, strict=True))


def estimate_through_path(gains: Row, weight: Fraction, model: PathModel, gain: Fraction) -> LinearLaw:
    """Feedback of slip, slip rate and the path's pressures, and a level d of all else that the last period showed.

    d ← d + a(e2 − π)/Γ2, p = −k1e1 − k2e2 − Σ k_i(q_i + d/(βb)) − d/(βb), π ← Φ2e + βb(Σ m_2iq_i + n2p) + Γ2d, and q ←
    Rq + (1 − R1)p, which is not measured but known. States: π [m/s], d and βb·q [m/s²], for numbers of one size.

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
    size, one = 4 + len(model.kept), Fraction(1)  # rows act on (π, d, q) and then on (e1, e2)
    share = weight / model.of_constant[1]
    level = unit_row(size, {0: -share, 1: one, size - 1: share})
    errors = unit_row(size, {size - 2: one}), unit_row(size, {size - 1: one})
    return _through(("predicted_rate", "disturbance"), gains, model, gain, errors, level)


def observer_through_path(
    gains: Row, corrections: tuple[Fraction, Fraction, Fraction], model: PathModel, gain: Fraction
) -> LinearLaw:
    """The same of the slip alone: an observer of slip error, slip-rate error and the level d of everything else.

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
    size, one = 5 + len(model.kept), Fraction(1)  # rows act on (π1, π2, d, q) and then on (e1, e2)
    innovation = unit_row(size, {0: -one, size - 2: one})
    slip, rate, level = (combined((one, unit_row(size, {i: one})), (v, innovation)) for i, v in enumerate(corrections))
    return _through(("predicted_slip", "predicted_rate", "disturbance"), gains, model, gain, (slip, rate), level)


def _through(
    names: Sequence[str], gains: Row, model: PathModel, gain: Fraction, errors: tuple[Row, Row], level: Row
) -> LinearLaw:
    """Law of the last so many predictions, the level and the path, from rows for the errors and the level."""
    count, own = len(model.kept), len(names)
    if len(gains) != 2 + count or gain <= 0:
        raise ParameterError(
            f"a law with a model of {count} pressures needs {2 + count} gains and a positive gain of the model. "
            f"Received {len(gains)} and {shortly(gain)} m²/kg. Complete them."
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
