"""A law that carries a model of what stands between its pressure and the fault."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import LinearLaw, Matrix, Row, combined


@dataclass(frozen=True, slots=True, kw_only=True)
class PathModel:
    """What a law expects of fault and path; any numbers give a law, good ones a good one.

    Attributes
    ----------
    of_slip, of_rate : Fraction
        Of e1 and e2 now, for e2 at the next sample.
    of_pressures : tuple of Fraction
        m_i [s]: what βb·q_i adds to that, q_i being the pressures of the path.
    of_asked : Fraction
        n [s]: what βb·p adds, p being what is asked for now.
    kept : tuple of rows
        R with q⁺ = Rq + (1 − R1)p, so that q = p where p is constant.

    Raises
    ------
    ParameterError
        When sizes do not fit, or no pressure moves the fault.
    """

    of_slip: Fraction
    of_rate: Fraction
    of_pressures: Row
    of_asked: Fraction
    kept: Matrix

    def __post_init__(self) -> None:
        n = len(self.of_pressures)
        if [len(row) for row in self.kept] != [n] * n or not self.of_constant:
            raise ParameterError(
                f"a model of {n} pressures needs {n} × {n} numbers of how they are kept, and a constant pressure must "
                "move the fault. Received another one. Complete it."
            )

    @property
    def of_constant(self) -> Fraction:
        """Γ [s]: what βb·p adds where p is constant."""
        return sum(self.of_pressures, self.of_asked)


def estimate_through_path(gains: Row, weight: Fraction, model: PathModel, gain: Fraction) -> LinearLaw:
    """Feedback of slip, slip rate and the path's pressures, and a level d of all else that the last period showed.

    d ← d + a(e2 − π)/Γ, p = −k1e1 − k2e2 − Σ k_i(q_i + d/(βb)) − d/(βb), π ← of_slip·e1 + of_rate·e2 + βb(Σ m_iq_i +
    np) + Γd, and q ← Rq + (1 − R1)p, which is not measured but known. States: π [m/s], d and βb·q [m/s²], for numbers
    of one size.

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
    count = len(model.of_pressures)
    if len(gains) != 2 + count or gain <= 0:
        raise ParameterError(
            f"a law with a model of {count} pressures needs {2 + count} gains and a positive gain of the model. "
            f"Received {len(gains)} and {float(gain):.4g} m²/kg. Complete them."
        )
    size = 4 + count  # rows act on (π, d, q) and then on (e1, e2)
    unit = [tuple(Fraction(i == j) for j in range(size)) for i in range(size)]
    share = weight / model.of_constant
    level = combined((Fraction(1), unit[1]), (share, unit[-1]), (-share, unit[0]))
    path = unit[2 : 2 + count]
    away = [combined((1 / gain, q), (1 / gain, level)) for q in path]
    seen = zip(gains, (*unit[-2:], *away), strict=True)
    asked = combined(*((-k, row) for k, row in seen), (-1 / gain, level))
    pushed = zip(model.of_pressures, path, strict=True)
    predicted = combined(
        (model.of_slip, unit[-2]),
        (model.of_rate, unit[-1]),
        *pushed,
        (gain * model.of_asked, asked),
        (model.of_constant, level),
    )
    kept = [combined(*zip(row, path, strict=True), (gain * (1 - sum(row)), asked)) for row in model.kept]
    rows = [predicted, level, *kept]
    return LinearLaw(
        states=("predicted_rate", "disturbance", *(f"path{i}" for i in range(count))),
        update=tuple(row[:-2] for row in rows),
        measured=tuple(row[-2:] for row in rows),
        output=asked[:-2],
        feedback=asked[-2:],
        applied=(gain * model.of_asked, Fraction(0), *(gain * (1 - sum(row)) for row in model.kept)),
    )
