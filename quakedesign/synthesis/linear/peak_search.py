"""Search for the ellipsoid that bounds an output best, finished in exact arithmetic."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.errors import CertificateError
from quakedesign.rationals import nearest
from quakedesign.sos.solve.conic import solve
from quakedesign.synthesis.linear.peak import ENTERS, Ellipsoid, PeakBound, tightest_bound
from quakedesign.synthesis.linear.plant.polytope import ERROR_STATES, ErrorLoop, modal_scaling

_GRID = (0.03, 0.08, 0.2, 0.4, 0.6, 0.8, 0.93, 0.99)
_BACK_OFF = (0.002, 0.01, 0.05, 0.2)
_BITS = (24, 34, 44, 53)


def find_peak_bound(loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> PeakBound | None:
    """Smallest bound on |output| that a common quadratic V proves for bounded inputs, or None.

    The decay α is searched on a line; for each α the largest 1/bound² is one semidefinite program (Clarabel, through
    cvxpy) in modal coordinates and relative inputs, so that the units do not matter. Loops whose poles lie decades
    apart get one ellipsoid for every time scale instead, because a single one decays as slowly as the slowest pole.

    Parameters
    ----------
    loop : ErrorLoop
    inputs : mapping of str to Fraction
        As in `PeakBound`.
    output : str

    Returns
    -------
    PeakBound or None
        Checked in exact arithmetic. None when a vertex is not stable or no V was found.
    """
    if loop.polytope().slowest() >= 0:
        return None
    from quakedesign.synthesis.linear.peak_cascade import cascade, separated

    joint = cascade(loop, inputs, output) if separated(loop) else None
    return joint if joint is not None else _single(loop, inputs, output)


def _single(loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> PeakBound | None:
    problem = _Reach(loop, inputs, output)
    best = problem.best_decay()
    if best is None:
        return None
    for give in _BACK_OFF:
        answer = problem.interior(best[0], best[1] * (1 - give) ** 2)
        candidates = (problem.exact(answer, bits) for bits in _BITS) if answer is not None else ()
        found = next((bound for bound in candidates if bound is not None), None)
        if found is not None:
            return found
    return None


@dataclass(frozen=True, slots=True)
class _Answer:
    """Floating-point proposal in scaled coordinates."""

    decay: float
    form: Any
    shares: dict[str, float]


class ScaledInputs:
    """One loop, its inputs and one output in modal coordinates, relative inputs and scaled time.

    Attributes
    ----------
    systems : list of ndarray, shape (n, n)
        Vertices.
    columns : ndarray, shape (n, m)
        One for every free input, for its bound.
    row : ndarray, shape (n,)
        The output, normalised.
    weights : ndarray, shape (n,)
        Size of the pole of every mode; 1 for a force that is a state.
    inverse : ndarray, shape (n, n)
        From the states to these coordinates.
    """

    def __init__(self, loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> None:
        import numpy as np

        self.loop, self.inputs, self.output = loop, dict(inputs), output
        blank = PeakBound(loop=loop, inputs=self.inputs, output=output, bound=Fraction(1), ellipsoids=(), weights=())
        self.held, self.free, size = blank.held, blank.free, len(blank.states)
        entering = {ENTERS[n]: float(bound) for n, bound in inputs.items() if ENTERS[n] in ERROR_STATES}
        entries = [bound * np.eye(4)[ERROR_STATES.index(state)] for state, bound in entering.items()]
        scaling = modal_scaling(loop.polytope(), entries)
        transform = np.eye(size)
        transform[:4, :4] = scaling.transform
        if self.held:
            transform[4, 4] = float(inputs["force"])
        self.pace, self.inverse = scaling.pace, np.linalg.inv(transform)
        raw = [np.array([[float(v) for v in row] for row in blank.system(c)]) for c in loop.corners()]
        self.systems = [self.inverse @ A @ transform / self.pace for A in raw]
        columns = [float(inputs[n]) * np.eye(size)[blank.states.index(ENTERS[n])] for n in self.free]
        self.columns = self.inverse @ np.array(columns).T / self.pace
        row = np.array([float(v) for v in loop.outputs()[output]] + [0.0] * (size - 4)) @ transform
        self.row = row / np.linalg.norm(row)
        self.weights = np.append(scaling.poles, np.ones(size - 4))

    def corner(self) -> Any:
        """Square of a force that is a state, as a matrix; zero without one."""
        import numpy as np

        square = np.zeros_like(self.inverse)
        square[-1, -1] = float(self.held)
        return square

    def rational_form(self, form: Any, bits: int) -> tuple[Fraction, ...]:
        """Upper triangle of a form of these coordinates in the states, rounded relative to its own units."""
        import numpy as np

        full = self.inverse.T @ form @ self.inverse
        units = [Fraction(2) ** round(float(-np.log2(v) / 2)) if v > 0 else Fraction(1) for v in np.diag(full)]
        size = len(units)
        return tuple(
            nearest(float(full[i, j]) * float(units[i] * units[j]), 1 << bits) / (units[i] * units[j])
            for i in range(size)
            for j in range(i, size)
        )

    def rational_shares(self, decay: Fraction, shares: Sequence[float]) -> list[Fraction]:
        """Shares scaled to add to just below a decay."""
        total = sum(shares)
        return [short(max(v, 0.0) / total * float(decay) * (1 - 1e-9)) for v in shares]

    def statement(self, ellipsoids: Sequence[Ellipsoid], weights: Sequence[Fraction]) -> PeakBound | None:
        """Checked statement with the smallest bound that the ellipsoids give, or None."""
        blank = PeakBound(
            loop=self.loop,
            inputs=self.inputs,
            output=self.output,
            bound=Fraction(1),
            ellipsoids=tuple(ellipsoids),
            weights=tuple(weights),
        )
        try:
            rows = blank.weighted(weights)
            row = [*self.loop.outputs()[self.output], Fraction(0)][: len(rows)]
            found = replace(blank, bound=tightest_bound(rows, row))
            found.check()
        except (CertificateError, ZeroDivisionError, ValueError, OverflowError):
            return None
        return found


class _Reach(ScaledInputs):
    """The program for one ellipsoid."""

    def __init__(self, loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> None:
        super().__init__(loop, inputs, output)
        self._model()

    def _model(self) -> None:
        import cvxpy as cp
        import numpy as np

        size, count = len(self.inverse), len(self.free)
        self._form, self._level = cp.Variable((size, size), symmetric=True), cp.Variable()
        self._shares, self._kept = cp.Variable(count, nonneg=True), cp.Variable(nonneg=True)
        self._decay, self._floor, margin = cp.Parameter(nonneg=True), cp.Parameter(nonneg=True), cp.Variable()
        corner, reach = self.corner(), np.outer(self.row, self.row)

        def inequalities(level: Any, slack: Any) -> list[Any]:
            found = [
                cp.sum(self._shares) + self._kept <= self._decay,
                self._form - level * reach - slack * np.eye(size) >> 0,
            ]
            if self.held:
                found.append(self._form[-1, -1] + slack <= 1)
            for A in self.systems:
                top = -(A.T @ self._form + self._form @ A) - self._decay * self._form + self._kept * corner
                side = -self._form @ self.columns
                block = cp.bmat([[top, side], [side.T, cp.diag(self._shares)]])
                found.append(block - slack * np.diag([*self.weights, *np.ones(count)]) >> 0)
            return found

        self._best = cp.Problem(cp.Maximize(self._level), inequalities(self._level, 0))
        self._inner = cp.Problem(cp.Maximize(margin), [*inequalities(self._floor, margin), margin <= 1])

    def level(self, decay: float) -> float:
        """Largest 1/bound² in scaled coordinates for one α; 0 without an answer."""
        self._decay.value = decay
        if not solve(self._best) or self._level.value is None:
            return 0.0
        return max(0.0, float(self._level.value))

    def best_decay(self) -> tuple[float, float] | None:
        """α with the largest level, and that level."""
        import numpy as np
        from scipy.optimize import minimize_scalar

        limit = 2 * -self.loop.polytope().slowest() / self.pace
        levels = [self.level(limit * share) for share in _GRID]
        place = int(np.argmax(levels))
        if not levels[place] > 0:
            return None
        ends = (_GRID[max(place - 1, 0)], _GRID[min(place + 1, len(_GRID) - 1)])
        fine = minimize_scalar(
            lambda x: -self.level(limit * x), bounds=ends, method="bounded", options={"xatol": 0.01, "maxiter": 12}
        )
        if -fine.fun > levels[place]:
            return limit * float(fine.x), -float(fine.fun)
        return limit * _GRID[place], levels[place]

    def interior(self, decay: float, level: float) -> _Answer | None:
        """Answer with the largest margin for a level slightly below the best."""
        import numpy as np

        self._decay.value, self._floor.value = decay, level
        if not solve(self._inner) or self._form.value is None:
            return None
        form = np.asarray(self._form.value, dtype=float)
        given = np.asarray(self._shares.value, dtype=float).tolist()
        shares = dict(zip(self.free, given, strict=True))
        if self.held:
            shares["force"] = float(np.asarray(self._kept.value))
        return _Answer(decay=decay, form=(form + form.T) / 2, shares=shares)

    def exact(self, answer: _Answer, bits: int) -> PeakBound | None:
        """Round a proposal, take the smallest bound that it gives, and check."""
        decay = short(answer.decay * self.pace)
        shares = self.rational_shares(decay, [answer.shares[n] for n in self.inputs])
        own = Ellipsoid(
            shape=self.rational_form(answer.form, bits),
            decay=decay,
            shares=dict(zip(self.inputs, shares, strict=True)),
            borrowed=(Fraction(0),),
        )
        return self.statement([own], [Fraction(1)])


def short(value: float) -> Fraction:
    """Rational with twelve digits near a float."""
    return Fraction(f"{value:.11e}")
