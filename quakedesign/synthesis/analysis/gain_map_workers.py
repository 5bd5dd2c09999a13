"""Who computes the points of a map: what is asked at each, and workers that keep their compiled sweeps."""

import threading
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Loop, certificate_text
from quakedesign.certificates.claim import root_enclosure
from quakedesign.controllers import Subject
from quakedesign.errors import CertificateError
from quakedesign.sos.solve.conic import handing_back
from quakedesign.synthesis.analysis.margins import necessary_limit
from quakedesign.synthesis.analysis.parametric_path import Path
from quakedesign.synthesis.analysis.parametric_program import CLEAR, Frame, Sweep, prove
from quakedesign.workers import Crew

Place = tuple[int, int]
_FAST = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """What a map is about.

    Attributes
    ----------
    subject : str, type of Law or LoopField
    loop : Loop
        With the base gains.
    over : tuple of two str
        Gains that vary.
    axes : tuple of two tuples of Fraction
        Their values.
    levels : tuple of Fraction
        L̄, rising.
    degree : int
        Of V.
    """

    subject: Subject
    loop: Loop
    over: tuple[str, str]
    axes: tuple[tuple[Fraction, ...], tuple[Fraction, ...]]
    levels: tuple[Fraction, ...]
    degree: int

    def at(self, place: Place, level: int) -> Loop:
        """Loop at a point, for the bound of a level (from 1)."""
        gains = {**self.loop.gains, **{n: axis[i] for n, axis, i in zip(self.over, self.axes, place, strict=True)}}
        roots = {name: (of, root_enclosure(gains[of])) for name, (of, _) in self.loop.roots.items()}
        bound = self.levels[level - 1]
        return replace(self.loop, gains=gains, roots=roots, uncertain={**self.loop.uncertain, "d": (-bound, bound)})

    @property
    def rows(self) -> list[list[Place]]:
        """All points in rows along a gain that keeps the structure of the loop, if one does."""
        nested = {name for terms in self.loop.lifts.values() for term in terms for name in term.parameters}
        first, second = (range(len(axis)) for axis in self.axes)
        if self.over[0] in nested:
            return [[(i, j) for j in second] for i in first]
        return [[(i, j) for i in first] for j in second]


class Screener:
    """Compiled sweeps of one sheet, one for every structure that its points have."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self._sweeps: list[Sweep] = []
        self._paths: dict[tuple[Sweep, tuple[Fraction, ...]], Path] = {}
        self._followed: dict[Sweep, Path] = {}
        self._answered = 0

    def row(self, places: Sequence[Place]) -> tuple[list[tuple[Place, Fraction | None, int]], int]:
        """Limit and number of levels found at every point, beginning each at the level of its neighbour; and solves."""
        found, start, before = [], len(self.sheet.levels), self._solves()
        self._followed.clear()
        for place in places:
            limit, start = self._reached(place, max(start, 1))
            found.append((place, limit, start))
        return found, self._solves() - before

    def _reached(self, place: Place, start: int) -> tuple[Fraction | None, int]:
        limit = necessary_limit(self.sheet.at(place, 1), self.sheet.subject)
        possible = [k for k, bound in enumerate(self.sheet.levels, 1) if limit is None or bound < limit]
        low, high = 0, len(possible)
        level = min(start, high)
        while low < high:
            if self._found(place, level):
                low = level
            else:
                high = level - 1
            level = low + 1 if low >= start else high
        return limit, low

    def _found(self, place: Place, level: int) -> bool:
        loop = self.sheet.at(place, level)
        sweep = self._sweep(loop)
        if sweep is None:
            return False
        answer = None if handing_back() else self._follow(sweep, loop)
        return _solved(sweep, loop) if answer is None else answer

    def _follow(self, sweep: Sweep, loop: Loop) -> bool | None:
        """Answer from the neighbours in the row, in the units of the first of them; None where that gives none."""
        path = self._followed.get(sweep) or self._path(sweep, sweep.frame(loop))
        answer = path.found(loop)
        if answer is None:
            self._followed.pop(sweep, None)
        else:
            self._followed[sweep] = path
            self._answered += 1
        return answer

    def _path(self, sweep: Sweep, frame: Frame) -> Path:
        """Path without neighbours."""
        known = sweep, frame.scale
        if known not in self._paths:
            self._paths[known] = Path(sweep, frame)
        return self._paths[known].begin(frame)

    def proof(self, place: Place, level: int) -> tuple[Place, int, str | None, int]:
        """Text of a certificate of a point at a level, or None; and solves."""
        before, loop = self._solves(), self.sheet.at(place, level)
        sweep = self._sweep(loop)
        answer = None if sweep is None else sweep.solve(loop, anew=True)
        certificate = None
        if sweep is not None and answer is not None and answer.found:
            certificate = prove(sweep, loop, answer, self.sheet.subject)
        return place, level, certificate_text(certificate) if certificate else None, self._solves() - before

    def _sweep(self, loop: Loop) -> Sweep | None:
        known = next((s for s in self._sweeps if s.covers(loop)), None)
        if known is None:
            try:
                known = Sweep(loop, self.sheet.degree)
            except CertificateError:
                return None
            self._sweeps.append(known)
        return known

    def _solves(self) -> int:
        return self._answered + sum(s.solves for s in self._sweeps)


def _solved(sweep: Sweep, loop: Loop) -> bool:
    answer = sweep.solve(loop, accuracy=_FAST)
    if answer is not None and abs(answer.margin) < CLEAR:
        answer = sweep.solve(loop)
    return answer is not None and answer.found


class Screeners:
    """Screeners of a sheet, wherever a crew computes.

    Parameters
    ----------
    sheet : Sheet
    crew : Crew
    """

    def __init__(self, sheet: Sheet, crew: Crew) -> None:
        self._sheet, self._crew = sheet, crew

    def answers(self, question: str, arguments: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Answers of one method of `Screener` to many arguments, in any order.

        Raises
        ------
        SimulationError
            When processes die again and again; one that was killed from outside is replaced.
        """
        asked = [(self._sheet, question, one) for one in arguments]
        return (answer for _, answer in self._crew.answers(_answer, asked))


class _Kept(threading.local):
    """Screener of the last sheet that a thread was asked about: compiled sweeps have one place for their parameters."""

    screener: Screener | None = None


_kept = _Kept()


def _answer(sheet: Sheet, question: str, arguments: tuple[Any, ...]) -> Any:
    if _kept.screener is None or _kept.screener.sheet != sheet:
        _kept.screener = Screener(sheet)
    return getattr(_kept.screener, question)(*arguments)
