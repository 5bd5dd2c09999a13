"""One law compiled for many gains: V and −V̇ as functions of gains and ranges, one structure for all points.

V = Σ a_j V_j with the monomials of one degree. At every point the programme is

    maximise t  subject to  V − t·N_m  and  −V̇ − t·N_n  in the cone on every cell and vertex,  mean of V = 1,

so that t goes on below zero beyond the largest disturbance, and its derivatives in gains and bounds follow from the
multipliers. All numbers are floating point: a sweep screens, it proves nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from quakedesign.certificates import Certificate, Loop
from quakedesign.controllers import Subject
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.polynomial import monomial
from quakedesign.sos.solve.joint import Proposal
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.synthesis.analysis.parametric_cones import Cones
from quakedesign.synthesis.lyapunov.balancing import balance, exponents_of, lifted_scale
from quakedesign.synthesis.lyapunov.parametric_forms import ends_of, rows_of, values_of
from quakedesign.synthesis.lyapunov.search import Family, finished

ACCURACY = 1e-10
"""What the solver is asked for unless told."""
SURE = 5e-10
"""Margins above this count as found; the solver's answers are about as accurate as that."""
CLEAR = 1e-6
"""Margins above this decide what is chosen once for many points, such as a degree, on every processor alike: kernels of
linear algebra move margins near zero by up to 2e-9."""
_TOO_FAR = "the gains are too far apart for a search in floating point."
_KEPT = 64  # scales whose numbers are kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Units in which a point is solved, so that its numbers are about one.

    Attributes
    ----------
    scale : tuple of Fraction
        Powers of two, u_i = scale_i·ũ_i.
    pace : float
        What −V̇ is divided by.
    """

    scale: tuple[Fraction, ...]
    pace: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """Floating-point answer at one point; proves nothing.

    Attributes
    ----------
    margin : float
        Largest t.
    decision : list of float
        a_j, in the units of the frame.
    frame : Frame
    slopes : mapping of str to float
        Derivative of the margin in every number that V̇ depends on, by the names of `rows_of`.
    """

    margin: float
    decision: list[float]
    frame: Frame
    slopes: Mapping[str, float]

    @property
    def found(self) -> bool:
        """Whether the search finds a Lyapunov function of the family."""
        return self.margin > SURE


class Sweep:
    """Screening of one law and one degree of V at many gains and ranges.

    Parameters
    ----------
    loop : Loop
        Any point of the sweep. Which ranges are points, and the parameters inside nested powers, are the same at all.
    degree : int
        Of V.

    Raises
    ------
    CertificateError
        When there are no candidates of this degree, or the law has parts that certificates do not know.
    """

    def __init__(self, loop: Loop, degree: int) -> None:
        self.loop, self.degree = loop, degree
        self.monomials = signed_monomials(loop.states, degree, loop.domain)
        self.rows = rows_of(loop, self.monomials) if self.monomials else ()
        if not any(row.rate for row in self.rows):
            raise CertificateError(f"there are no Lyapunov functions of degree {degree} to try for {loop.law}.")
        self.products = sorted({names for row in self.rows for _, _, names, _ in row.parts})
        order = {names: i for i, names in enumerate(self.products)}
        parts = [part for row in self.rows for part in row.parts]
        coefficients = [Fraction(c) for *_, c in parts]
        self.parts = np.array([j for j, *_ in parts])
        self.places = np.array([order[names] for _, _, names, _ in parts])
        self.rate = np.array([row.rate for row in self.rows for _ in row.parts])
        self.exponents = _exponents(coefficients)
        self.mantissas = np.array(
            [float(c / Fraction(2) ** int(n)) for c, n in zip(coefficients, self.exponents, strict=True)]
        )
        self.solves = 0
        self.solver_seconds = 0.0
        self._numbers: dict[tuple[Fraction, ...], _Numbers] = {}

    def covers(self, loop: Loop) -> bool:
        """Whether a point has the structure of this sweep."""
        return ends_of(loop) == ends_of(self.loop) and _nested(loop) == _nested(self.loop)

    def frame(self, loop: Loop) -> Frame:
        """Units that suit one point."""
        scale = balance(loop)
        return Frame(scale=scale, pace=self._in_units(scale).pace(self._features(values_of(loop))))

    def solve(
        self, loop: Loop, frame: Frame | None = None, accuracy: float = ACCURACY, *, anew: bool = False
    ) -> Screened | None:
        """Largest margin at one point; None if the solver fails.

        Parameters
        ----------
        loop : Loop
        frame : Frame, optional
            Units; those of the point unless given. Margins in different units share their sign only.
        accuracy : float
            That the solver is asked for.
        anew : bool
            Whether no digit may depend on what was solved before.

        Raises
        ------
        ValueError
            When the point has another structure.
        CertificateError
            When its numbers are too far apart for floating point.
        """
        if not self.covers(loop):
            raise ValueError("the point has another structure. Compile a sweep for it.")
        values, units = values_of(loop), frame or self.frame(loop)
        solution = self._in_units(units.scale).solve(self._features(values), units.pace, accuracy, anew=anew)
        self.solves += 1
        if solution is None:
            return None
        margin, decision, per_product, seconds = solution
        self.solver_seconds += seconds
        slopes = self._slopes(values, per_product)
        return Screened(margin=margin, decision=decision, frame=units, slopes=slopes)

    def family(self, frame: Frame) -> Family:
        """Lyapunov functions in the units of a frame."""
        return Family(
            monomials=self.monomials,
            sizes=self._in_units(frame.scale).sizes,
            demands=(),
            pace=Fraction(frame.pace),
            fallen=max(sum(e) for row in self.rows if row.rate for e in row.margin),
        )

    def cones(self, frame: Frame) -> Cones:
        """The programme in the units of a frame."""
        return self._in_units(frame.scale).cones

    def parts_at(self, loop: Loop, frame: Frame) -> Any:
        """Values of all parts at a point, as `Cones` takes them."""
        features = self._features(values_of(loop))
        numbers = self._in_units(frame.scale)
        return numbers.weights(frame.pace) * features[numbers.products]

    def _in_units(self, scale: tuple[Fraction, ...]) -> "_Numbers":
        if scale not in self._numbers:
            free = self._numbers and not any(row.equalities or row.inequalities for row in self.rows)
            known = next(iter(self._numbers.values())).cones if free else None
            if len(self._numbers) >= _KEPT:
                self._numbers.pop(next(iter(self._numbers)))
            try:
                self._numbers[scale] = _Numbers(self, scale, known)
            except OverflowError:
                raise CertificateError(_TOO_FAR) from None
        return self._numbers[scale]

    def _features(self, values: Mapping[str, float]) -> Any:
        """Value of every product of names."""
        return np.array([_product(values, names) for names in self.products])

    def _slopes(self, values: Mapping[str, float], per_product: Any) -> dict[str, float]:
        """Derivative of the margin in every name, from that in every product."""
        slopes = {name: 0.0 for names in self.products for name in names}
        for names, slope in zip(self.products, per_product.tolist(), strict=True):
            for i, name in enumerate(names):
                slopes[name] += slope * _product(values, (*names[:i], *names[i + 1 :]))
        return slopes


def prove(sweep: Sweep, loop: Loop, answer: Screened, subject: Subject | None = None) -> Certificate | None:
    """Certificate of a screened point, checked in exact arithmetic; None when none could be finished."""
    family, proposal = sweep.family(answer.frame), Proposal(answer.decision, answer.margin)
    return finished(loop, family, proposal, answer.frame.scale, subject)


class _Numbers:
    """The coefficients of a sweep in the units of one scale; without conditions all scales share a programme."""

    def __init__(self, sweep: Sweep, scale: tuple[Fraction, ...], cones: Cones | None) -> None:
        self.cones = cones or Cones(sweep.rows, sweep.loop, sweep.monomials, scale)
        self.sizes = tuple(monomial(scale, exponents_of(t, sweep.loop.states)) for t in sweep.monomials)
        self.products, self.rate = sweep.places, sweep.rate
        moved = [
            np.array([part[1] for part in row.parts]) @ _exponents(lifted_scale(row.equalities, scale))
            for row in sweep.rows
        ]
        grown = sweep.exponents + np.concatenate(moved) - _exponents(self.sizes)[sweep.parts]
        with np.errstate(over="ignore"):
            self.coefficients = np.ldexp(sweep.mantissas, grown)
        if not np.isfinite(self.coefficients).all():
            raise OverflowError

    def pace(self, features: Any) -> float:
        """Largest coefficient of all −V̇_j."""
        with np.errstate(over="ignore", invalid="ignore"):
            merged = np.bincount(self.cones.slots[self.rate], (self.coefficients * features[self.products])[self.rate])
        if not np.isfinite(merged).all():
            raise CertificateError(_TOO_FAR)
        return float(np.abs(merged).max(initial=0.0)) or 1.0

    def weights(self, pace: float) -> Any:
        """What the products are multiplied by in every part."""
        return np.where(self.rate, self.coefficients / pace, self.coefficients)

    def solve(
        self, features: Any, pace: float, accuracy: float, *, anew: bool
    ) -> tuple[float, list[float], Any, float] | None:
        """Margin, decision, derivative of the margin in every product, and seconds; None if the solver fails."""
        weights = self.weights(pace)
        solution = self.cones.solve(weights * features[self.products], accuracy, anew=anew)
        if solution is None:
            return None
        margin, decision, moments = solution
        shares = weights * decision[self.cones.parts] * moments[self.cones.columns]
        per_product = np.bincount(self.products, shares, minlength=len(features))
        return margin, decision.tolist(), per_product, self.cones.compiled.solver_seconds


def _exponents(values: Sequence[Fraction]) -> Any:
    """n of 2^n within a factor of two, exact where the values are powers of two: numbers of any size have one."""
    return np.array([v.numerator.bit_length() - v.denominator.bit_length() for v in values])


def _product(values: Mapping[str, float], names: tuple[str, ...]) -> float:
    product = 1.0
    for name in names:
        product *= values[name]
    return product


def _nested(loop: Loop) -> list[tuple[Fraction, ...]]:
    """Gains and constants inside nested powers, which shape the cells; those of terms that vanish do not."""
    known = loop.parameters | {name: loop.parameters[of] for name, (of, _) in loop.roots.items()}
    terms = [term for terms in loop.lifts.values() for term in terms]
    values = [tuple(known[name] for name in term.parameters) for term in terms]
    return [v if all(v) else (Fraction(0),) for v in values]
