"""One ellipsoid for every time scale: peak bounds for loops whose poles lie decades apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any

from quakedesign.sos.solve.conic import solve
from quakedesign.synthesis.linear.peak import Ellipsoid, PeakBound
from quakedesign.synthesis.linear.peak_search import ScaledInputs, short
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop

_GAP = 20.0
_ROUNDS = 20
_LEAST_SIZE = 1e-4
_SPENT = 0.98
_DECAYS = (0.3, 0.6, 0.85, 0.97)
_INFLATIONS = (1.005, 1.02, 1.1, 1.3)
_BITS = (34, 44, 53, 60)


def separated(loop: ErrorLoop) -> bool:
    """Whether the moduli of the poles of a vertex leave a gap of a factor ten."""
    import numpy as np

    for A in loop.polytope().floats():
        moduli = np.sort(np.abs(np.linalg.eigvals(A)))
        if (moduli[1:] > _GAP * moduli[:-1]).any():
            return True
    return False


def cascade(loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> PeakBound | None:
    """Bound from the intersection of one ellipsoid for every time scale, each an input of the others.

    A single V decays as slowly as the slowest mode, so it credits the fast modes with hardly any damping. Here every
    group of modes has its own α and sees the others as bounded inputs (a small-gain argument with vector Lyapunov
    functions: Bellman 1962, SIAM J. Control 1). The ellipsoids are enlarged in turn until none grows any more.

    Returns
    -------
    PeakBound or None
        Checked in exact arithmetic.
    """
    problem = _Cascade(loop, inputs, output)
    for answer in _proposals(loop, tuple(inputs.items())):
        for bits in _BITS:
            found = problem.exact(answer, bits)
            if found is not None:
                return found
    return None


@lru_cache(maxsize=8)
def _proposals(loop: ErrorLoop, inputs: tuple[tuple[str, Fraction], ...]) -> list[list["_Part"]]:
    """Sets of ellipsoids with shares, tightest first; they serve every output."""
    problem = _Cascade(loop, dict(inputs), "slip_error")
    forms = problem.settled()
    answers = [problem.shares(forms, factor) for factor in _INFLATIONS] if forms is not None else []
    return [answer for answer in answers if answer is not None]


@dataclass(frozen=True, slots=True)
class _Part:
    """Floating-point proposal of one ellipsoid: form, decay, shares of the inputs and of the others."""

    form: Any
    decay: float
    shares: Sequence[float]
    borrowed: Sequence[float]


class _Cascade(ScaledInputs):
    """Groups of modes by the size of their poles; a force that is a state belongs to the fastest, the others see it."""

    def __init__(self, loop: ErrorLoop, inputs: Mapping[str, Fraction], output: str) -> None:
        import numpy as np

        super().__init__(loop, inputs, output)
        order = np.argsort(-self.weights[:4])
        groups: list[list[int]] = [[int(order[0])]]
        for before, place in pairwise(order.tolist()):
            if self.weights[before] > _GAP * self.weights[place]:
                groups.append([])
            groups[-1].append(place)
        self.groups = [g + [4] * (self.held and n == 0) for n, g in enumerate(groups)]
        self.decays: list[float] = []
        for group in groups:
            blocks = [A[np.ix_(group, group)] for A in self.systems]
            self.decays.append(2 * min(-float(np.linalg.eigvals(b).real.max()) for b in blocks))

    def settled(self) -> list[tuple[Any, float]] | None:
        """Forms and decays after enlarging the ellipsoids in turn until they change by less than a thousandth."""
        import numpy as np

        if min(self.decays) <= 0:
            return None
        found: list[tuple[Any, float] | None] = [None] * len(self.groups)
        for rounds in range(_ROUNDS):
            change = 0.0
            for i in range(len(self.groups)):
                others = [(j, part[0]) for j, part in enumerate(found) if part is not None and j != i]
                if rounds == 0 and not others and not self._pushed(i):  # only groups that come later push it
                    continue
                best = self._grown(i, others, found[i])
                if best is None:
                    return None
                before = found[i]
                grown = np.inf if before is None else float(np.abs(np.trace(best[0]) / np.trace(before[0]) - 1))
                change, found[i] = max(change, grown), best
            if change < 1e-3:
                break
        return [part for part in found if part is not None] if None not in found else None

    def _pushed(self, i: int) -> bool:
        """Whether an input moves a group noticeably by itself."""
        import numpy as np

        own = [m for m in self.groups[i] if m < 4]
        push = max(float(np.abs(v).max()) for v in (self.columns[own], *(A[own, 4:] for A in self.systems)) if v.size)
        return push > _LEAST_SIZE * self.decays[i]

    def _grown(
        self, i: int, others: Sequence[tuple[int, Any]], before: tuple[Any, float] | None
    ) -> tuple[Any, float] | None:
        """Smallest ellipsoid of a group for given ellipsoids of the others: best of a few decays."""
        again = before is not None and len(others) == len(self.groups) - 1
        shares = (before[1] / self.decays[i],) if again and before is not None else _DECAYS
        answers = [(self._one(i, others, self.decays[i] * share, before), self.decays[i] * share) for share in shares]
        good = [(level, form, decay) for (level, form), decay in answers if form is not None]
        if not good:
            return None
        _, form, decay = max(good, key=lambda answer: answer[0])
        return form, decay

    def _one(
        self, i: int, others: Sequence[tuple[int, Any]], decay: float, before: tuple[Any, float] | None
    ) -> tuple[float, Any]:
        """Level and form of the smallest ellipsoid of a group; groups that have none yet are left at rest."""
        import cvxpy as cp
        import numpy as np

        group, units = self.groups[i], self._units(i, others, decay, before)
        embed = np.eye(len(units))[:, group]
        own = cp.Variable((len(group), len(group)), symmetric=True)
        lent: Any = cp.Variable(len(others), nonneg=True) if others else None
        known = [(units.T @ f @ units, lent[n]) for n, (_, f) in enumerate(others)]
        moving = sorted({*group, *range(4, len(units)), *(m for j, _ in others for m in self.groups[j])})
        bounds, total = self._inequalities(embed @ own @ embed.T, decay, known, units, moving)
        total = total + (cp.sum(lent) if lent is not None else 0)
        bounds.append(total <= _SPENT)
        if 4 in group:
            bounds.append(own[-1, -1] <= 1)
        volume = cp.log_det(own) if len(group) > 1 else own[0, 0]
        if not solve(cp.Problem(cp.Maximize(volume), bounds)) or own.value is None:
            return -np.inf, None
        scale = float(np.linalg.slogdet(units[np.ix_(group, group)])[1])
        level = float(np.linalg.slogdet(np.asarray(own.value))[1]) - 2 * scale
        back = embed @ np.linalg.inv(units[np.ix_(group, group)]).T
        value = np.asarray(own.value, dtype=float)
        if not np.linalg.eigvalsh((value + value.T) / 2).min() > 0:
            return -np.inf, None
        return level, back @ ((value + value.T) / 2) @ back.T

    def _units(self, i: int, others: Sequence[tuple[int, Any]], decay: float, before: tuple[Any, float] | None) -> Any:
        """Coordinates in which every other ellipsoid is a ball and this one is expected to be of size one."""
        import numpy as np

        units = np.eye(len(self.inverse))
        known = others if before is None else [*others, (i, before[0])]
        for j, form in known:
            modes = [m for m in self.groups[j] if m < 4]
            units[np.ix_(modes, modes)] = _root_of_inverse(form[np.ix_(modes, modes)])
        if before is not None:
            return units
        own = [m for m in self.groups[i] if m < 4]
        pushed = [float(v) for v in np.abs(self.columns[own]).max(axis=0)]
        if self.held:
            pushed += [float(np.abs(A[own, 4]).max()) for A in self.systems]
        for j, _ in others:
            modes = [m for m in self.groups[j] if m < 4]
            spread = units[np.ix_(modes, modes)]
            pushed += [float(np.linalg.norm(A[np.ix_(own, modes)] @ spread, 2)) for A in self.systems]
        units[own, own] = max(max(pushed) / decay, _LEAST_SIZE**3)
        return units

    def _inequalities(
        self,
        form: Any,
        decay: float,
        lent: Sequence[tuple[Any, Any]],
        units: Any,
        moving: Sequence[int],
        slack: Any = 0,
    ) -> tuple[list[Any], Any]:
        """Dissipation at every vertex in given units and in time of 1/decay, and the shares of the inputs together."""
        import cvxpy as cp
        import numpy as np

        count, inverse = len(self.free), np.linalg.inv(units)
        shares, kept = cp.Variable(count, nonneg=True), cp.Variable(nonneg=True)
        self._last = shares, kept
        given = sum((factor * f for f, factor in lent), start=np.zeros_like(self.inverse))
        corner = units.T @ self.corner() @ units
        keep = [*moving, *range(len(units), len(units) + count)]
        pick = np.eye(len(units) + count)[:, keep]
        bounds = []
        for matrix in self.systems:
            A = inverse @ matrix @ units / decay
            top = given - (A.T @ form + form @ A) - form + kept * corner
            side = -form @ (inverse @ self.columns / decay)
            block = cp.bmat([[top, side], [side.T, cp.diag(shares)]])
            bounds.append(pick.T @ (block - slack) @ pick >> 0)
        return bounds, cp.sum(shares) + kept

    def shares(self, forms: Sequence[tuple[Any, float]], factor: float) -> list[_Part] | None:
        """Shares with margin for ellipsoids enlarged by a factor."""
        import cvxpy as cp
        import numpy as np

        full = [f / factor**2 for f, _ in forms]
        units = _root_of_inverse(sum(full))
        parts = []
        for i, (_, decay) in enumerate(forms):
            margin, others = cp.Variable(), [n for n in range(len(full)) if n != i]
            lent: Any = cp.Variable(len(others), nonneg=True) if others else None
            pairs = [(units.T @ full[n] @ units, lent[m]) for m, n in enumerate(others)]
            slack = margin * np.eye(len(units) + len(self.free))
            bounds, total = self._inequalities(units.T @ full[i] @ units, decay, pairs, units, range(len(units)), slack)
            spent = total + (cp.sum(lent) if lent is not None else 0)
            problem = cp.Problem(cp.Maximize(margin), [*bounds, spent <= 1])
            if not solve(problem) or margin.value is None or not margin.value > 0:
                return None
            given, kept = (np.asarray(v.value, dtype=float) for v in self._last)
            named = dict(zip(self.free, given.tolist(), strict=True)) | ({"force": float(kept)} if self.held else {})
            borrowed = np.zeros(len(full))
            borrowed[others] = lent.value if lent is not None else []
            parts.append(_Part(full[i], decay, [named[n] for n in self.inputs], borrowed.tolist()))
        return parts

    def exact(self, parts: Sequence[_Part], bits: int) -> PeakBound | None:
        """Round a proposal, weigh the ellipsoids for the output, and check."""
        import numpy as np

        ellipsoids, reach = [], []
        for part in parts:
            decay = short(part.decay * self.pace)
            shares = self.rational_shares(decay, [*part.shares, *part.borrowed])
            count = len(part.shares)
            named = dict(zip(self.inputs, shares[:count], strict=True))
            shape = self.rational_form(part.form, bits)
            ellipsoids.append(Ellipsoid(shape=shape, decay=decay, shares=named, borrowed=tuple(shares[count:])))
        for group, part in zip(self.groups, parts, strict=True):
            row = self.row[group]
            reach.append(float(np.sqrt(row @ np.linalg.solve(part.form[np.ix_(group, group)], row))))
        floor = 1e-6 * sum(reach)
        total = sum(reach) + floor * len(reach)
        return self.statement(ellipsoids, [short((r + floor) / total * (1 - 1e-9)) for r in reach])


def _root_of_inverse(form: Any) -> Any:
    """S with SᵀFS = 1, for a positive definite F."""
    import numpy as np

    return np.linalg.inv(np.linalg.cholesky(form)).T
