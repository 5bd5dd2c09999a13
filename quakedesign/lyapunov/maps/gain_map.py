"""Map of certified gains over a grid of two gains.

One compiled problem screens the grid in worker processes. The edges and a random sample of points are proved exactly.
"""

import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from math import log10
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import rational
from quakedesign.fault.model import MOST_WORKERS, require_count
from quakedesign.laws import Subject
from quakedesign.lyapunov.exact.certificate_files import certificate_text
from quakedesign.lyapunov.exact.claim import Loop, root_enclosure
from quakedesign.lyapunov.maps.sweep import CLEAR, Frame, Path, Sweep, prove
from quakedesign.lyapunov.search.certify import Number, closed_loop, necessary_limit
from quakedesign.lyapunov.search.lyapunov_search import candidate_degrees
from quakedesign.parallel import Crew, InProcess, crew_or_here
from quakedesign.sos.solve.conic import collecting
from quakedesign.text import Progress, silent

# ----------------------------------------------------------------------
# Computation of the points of a map, by workers that cache their compiled sweeps.

Place = tuple[int, int]  # indices of a grid point on both axes
_FAST = 1e-8  # tolerance of the solver for a first decision


@dataclass(frozen=True, slots=True, kw_only=True)
class MapDefinition:
    """Definition of a map: law, gains, axes, levels and degree."""

    subject: Subject
    loop: Loop  # Loop with the base gains
    over: tuple[str, str]  # Names of the two gains that vary
    axes: tuple[tuple[Fraction, ...], tuple[Fraction, ...]]  # Their values
    levels: tuple[Fraction, ...]  # L̄, increasing
    degree: int  # Degree of V

    def at(self, place: Place, level: int) -> Loop:
        """Loop at a point, for the bound of a level (counted from 1)."""
        gains = {**self.loop.gains, **{n: axis[i] for n, axis, i in zip(self.over, self.axes, place, strict=True)}}
        roots = {name: (of, root_enclosure(gains[of])) for name, (of, _) in self.loop.roots.items()}
        bound = self.levels[level - 1]
        return replace(self.loop, gains=gains, roots=roots, uncertain={**self.loop.uncertain, "d": (-bound, bound)})

    @property
    def rows(self) -> list[list[Place]]:
        """All points in rows; if possible, the gain that varies along a row does not change the loop's structure."""
        nested = {name for terms in self.loop.lifts.values() for term in terms for name in term.parameters}
        first, second = (range(len(axis)) for axis in self.axes)
        if self.over[0] in nested:
            return [[(i, j) for j in second] for i in first]
        return [[(i, j) for i in first] for j in second]


class Screener:
    """Compiled sweeps of one map, one per structure of its points."""

    def __init__(self, sheet: MapDefinition) -> None:
        self.sheet = sheet
        self._sweeps: list[Sweep] = []
        self._paths: dict[tuple[Sweep, tuple[Fraction, ...]], Path] = {}
        self._followed: dict[Sweep, Path] = {}
        self._decided = 0

    def row(self, places: Sequence[Place]) -> tuple[list[tuple[Place, Fraction | None, int]], int]:
        """Limit and number of feasible levels of every point, and number of solves.

        The search at a point begins at the level of the previous point.
        """
        limits, start, before = [], len(self.sheet.levels), self._solves()
        self._followed.clear()
        for place in places:
            limit, start = self._reached(place, max(start, 1))
            limits.append((place, limit, start))
        return limits, self._solves() - before

    def _reached(self, place: Place, start: int) -> tuple[Fraction | None, int]:
        limit = necessary_limit(self.sheet.at(place, 1), self.sheet.subject)
        possible = [k for k, bound in enumerate(self.sheet.levels, 1) if limit is None or bound < limit]
        low, high = 0, len(possible)
        level = min(start, high)
        while low < high:
            if self._solvable(place, level):
                low = level
            else:
                high = level - 1
            level = low + 1 if low >= start else high
        return limit, low

    def _solvable(self, place: Place, level: int) -> bool:
        loop = self.sheet.at(place, level)
        sweep = self._sweep(loop)
        if sweep is None:
            return False
        feasible = None if collecting() else self._follow(sweep, loop)
        return _solved(sweep, loop) if feasible is None else feasible

    def _follow(self, sweep: Sweep, loop: Loop) -> bool | None:
        """Feasibility from the neighbours in the row, in the units of the first neighbour; None if undecided."""
        path = self._followed.get(sweep) or self._path(sweep, sweep.frame(loop))
        feasible = path.feasible(loop)
        if feasible is None:
            self._followed.pop(sweep, None)
        else:
            self._followed[sweep] = path
            self._decided += 1
        return feasible

    def _path(self, sweep: Sweep, frame: Frame) -> Path:
        """Path for a frame without cached neighbours."""
        key = sweep, frame.scale
        if key not in self._paths:
            self._paths[key] = Path(sweep, frame)
        return self._paths[key].begin(frame)

    def proof(self, place: Place, level: int) -> tuple[Place, int, str | None, int]:
        """Point, level, text of the certificate for this point and level (None without proof), and number of solves."""
        before, loop = self._solves(), self.sheet.at(place, level)
        sweep = self._sweep(loop)
        solution = None if sweep is None else sweep.solve(loop, anew=True)
        certificate = None
        if sweep is not None and solution is not None and solution.feasible:
            certificate = prove(sweep, loop, solution, self.sheet.subject)
        return place, level, certificate_text(certificate) if certificate else None, self._solves() - before

    def _sweep(self, loop: Loop) -> Sweep | None:
        sweep = next((s for s in self._sweeps if s.covers(loop)), None)
        if sweep is None:
            try:
                sweep = Sweep(loop, self.sheet.degree)
            except CertificateError:
                return None
            self._sweeps.append(sweep)
        return sweep

    def _solves(self) -> int:
        return self._decided + sum(s.solves for s in self._sweeps)


def _solved(sweep: Sweep, loop: Loop) -> bool:
    solution = sweep.solve(loop, accuracy=_FAST)
    if solution is not None and abs(solution.margin) < CLEAR:
        solution = sweep.solve(loop)
    return solution is not None and solution.feasible


class Screeners:
    """Screeners of one map on the workers of a crew."""

    def __init__(self, sheet: MapDefinition, crew: Crew) -> None:
        self._sheet, self._crew = sheet, crew

    def results(self, method: str, arguments: Iterable[tuple[object, ...]]) -> Iterator[Any]:
        """Results of one method of `Screener` for many arguments, in any order.

        Raises
        ------
        SimulationError
            When workers die repeatedly; a single killed worker is replaced.
        """
        tasks = [(self._sheet, method, one) for one in arguments]
        return (result for _, result in self._crew.results(_screened, tasks))


class _Cached(threading.local):
    """Cached screener of the last map, one per thread, as compiled sweeps store their parameters in place."""

    screener: Screener | None = None


_cached = _Cached()


def _screened(sheet: MapDefinition, method: str, arguments: tuple[object, ...]) -> Any:
    if _cached.screener is None or _cached.screener.sheet != sheet:
        _cached.screener = Screener(sheet)
    return getattr(_cached.screener, method)(*arguments)


# ----------------------------------------------------------------------
# Certified region of two gains: a grid screened with one compiled problem; its edges and a sample proved exactly.

SHARES = tuple(Fraction(s, 100) for s in (25, 50, 75, 90, 99))
"""Default levels of L̄, as shares of the necessary limit of the base gains."""
_NEIGHBOURS = ((1, 0), (-1, 0), (0, 1), (0, -1))


@dataclass(frozen=True, slots=True, kw_only=True)
class GainMap:
    """Largest level of L̄ at every point of a grid of two gains, as screened and as proved."""

    sheet: MapDefinition  # Law, gains, axes, levels
    limits: Mapping[Place, Fraction | None]  # Necessary limit of L̄; None if none is known
    # Number of levels at which the floating-point search finds a Lyapunov function, without proof
    screened: Mapping[Place, int]
    # Number of levels covered by a certificate, checked in exact arithmetic; only for points with an attempted proof
    proved: Mapping[Place, int]
    edges: frozenset[Place]  # Points with a neighbour of a lower level, all with an attempted proof
    certificates: Mapping[Place, str]  # Text of the certificate for the highest proved level
    solves: int  # Number of conic programmes solved
    seconds: Mapping[str, float] = field(default_factory=dict)  # Wall time of ``"screening"`` and ``"proving"``

    def role(self, place: Place) -> str:
        """``"edge"``, ``"interior"`` (drawn at random), or an empty string for a point that was only screened."""
        if place in self.edges:
            return "edge"
        return "interior" if place in self.proved else ""

    def counts(self, level: int) -> dict[str, int]:
        """Number of points screened and proved at a level (counted from 1), in total and on its edge."""
        inside = {p for p, reached in self.screened.items() if reached >= level}
        edge = {p for p in inside if _at_edge(p, inside, self.sheet)}
        proved = {p for p, reached in self.proved.items() if reached >= level}
        return {"screened": len(inside), "proved": len(proved), "edge": len(edge), "edge_proved": len(edge & proved)}


def gain_map(
    subject: Subject,
    gains: tuple[Number, ...],
    over: tuple[str, str],
    *,
    ranges: Sequence[tuple[Number, Number]] | None = None,
    points: int = 100,
    levels: Sequence[Number] | None = None,
    gain_range: tuple[Number, Number] = (1, 1),
    degree: int | None = None,
    interior: int = 200,
    seed: int = 0,
    workers: int = 2,
    scheduler: str | None = None,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> GainMap:
    """Certified region over two gains, at one or more levels of L̄.

    Every point is screened. All points at the edge of a level, and `interior` random points inside, are then proved
    exactly. A point without a proof loses its level, and its neighbours become edge points.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        See `certify`.
    gains : tuple of number or text
        Base gains, in the order of the law; those that vary take the values of the axes instead.
    over : tuple of two str
        Names of the gains that vary.
    ranges : sequence of two pairs, optional
        Ends of both axes; by default from one quarter of the base gain to four times the base gain. The points of a
        positive range are spaced geometrically.
    points : int
        Number of points along each axis.
    levels : sequence of number or text, optional
        Values of L̄; by default the shares `SHARES` of the necessary limit of the base gains.
    gain_range : tuple of two
        Range [b_m, b_M] of β [-].
    degree : int, optional
        Degree of V; by default the lowest with a clear margin for the base gains at the lowest level.
    interior : int
        Number of interior points to prove.
    seed : int
        Seed of the choice of interior points.
    workers : int
        Number of processes; 1 computes in the calling process. Results do not depend on this number (bitwise).
    scheduler : str, optional
        Address of a dask.distributed scheduler, used instead of local processes.
    executor : Executor, optional
        Executor of `concurrent.futures`, used instead of local processes.
    progress : callable
        Function that reports progress, called with a text and the completed fraction.

    Returns
    -------
    GainMap

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        For unknown or equal gains, fewer than two points per axis, empty ranges or levels, and as in `certify`.
    SimulationError
        If the workers cannot be reached, or die repeatedly.
    """
    require_count(MOST_WORKERS, workers=workers)
    sheet = _sheet(subject, gains, over, ranges, points, levels, gain_range, degree)
    with InProcess() if collecting() else crew_or_here(workers, scheduler, executor) as crew:
        began, screeners = perf_counter(), Screeners(sheet, crew)
        limits, screened, solves = _screen(sheet, screeners, progress)
        middle = perf_counter()
        proved, texts, edges, more = _prove(sheet, screeners, dict(screened), interior, seed, progress)
        ended = perf_counter()
    return GainMap(
        sheet=sheet,
        limits=limits,
        screened=screened,
        proved=proved,
        edges=edges,
        certificates=texts,
        solves=solves + more,
        seconds={"screening": middle - began, "proving": ended - middle},
    )


def _sheet(
    subject: Subject,
    gains: tuple[Number, ...],
    over: tuple[str, str],
    ranges: Sequence[tuple[Number, Number]] | None,
    points: int,
    levels: Sequence[Number] | None,
    gain_range: tuple[Number, Number],
    degree: int | None,
) -> MapDefinition:
    loop = closed_loop(subject, gains, lipschitz=1, gain_range=gain_range)
    if "d" not in loop.uncertain or len(set(over)) != 2 or not set(over) <= set(loop.gains):
        raise ParameterError(
            "a map needs a law with an uncertain parameter d, and two different gains among "
            f"{', '.join(loop.gains)}. Received {' '.join(over) or 'none'}."
        )
    if points < 2:
        raise ParameterError(f"a map needs at least two points along each axis. Received {points}.")
    ends = ranges or [(loop.gains[name] / 4, loop.gains[name] * 4) for name in over]
    first, second = (axis(low, high, points, f"range of {name}") for name, (low, high) in zip(over, ends, strict=True))
    chosen = _levels(subject, loop, levels)
    sheet = MapDefinition(
        subject=subject, loop=loop, over=over, axes=(first, second), levels=chosen, degree=degree or 0
    )
    return sheet if degree else replace(sheet, degree=_lowest_degree(loop, chosen[0]))


def axis(low: Number, high: Number, points: int, what: str = "range") -> tuple[Fraction, ...]:
    """Values from low to high, those between rounded to four or more digits; spaced geometrically if both are positive.

    Parameters
    ----------
    low, high : number or text
        Ends of the axis.
    points : int
        Number of values.
    what : str
        Name of the range in error messages.

    Raises
    ------
    ParameterError
        If the range is empty, or too narrow for the number of points.
    """
    first, last = rational(low, what), rational(high, what)
    if not first < last:
        raise ParameterError(f"the lower end of the {what} must be below the upper end. Received {low} to {high}.")
    shares = [i / (points - 1) for i in range(1, points - 1)]
    a, b = float(first), float(last)
    inner = [a * (b / a) ** s if first > 0 else a + (b - a) * s for s in shares]
    digits = 3 + max(0, round(log10(points)) - 1)
    values = (first, *(Fraction(f"{v:.{digits}e}") for v in inner), last)
    if any(u >= v for u, v in pairwise(values)):
        raise ParameterError(f"{what} is too narrow for {points} points. Received {low} to {high}. Use fewer points.")
    return values


def _levels(subject: Subject, loop: Loop, levels: Sequence[Number] | None) -> tuple[Fraction, ...]:
    if levels is not None:
        ordered = tuple(sorted({rational(v, "lipschitz") for v in levels}))
        if not ordered or ordered[0] < 0:
            values = ", ".join(map(str, levels)) or "none"
            raise ParameterError(f"lipschitz must not be negative, and one level is required. Received {values}.")
        return ordered
    limit = necessary_limit(loop, subject)
    if not limit:
        raise ParameterError("levels of L̄ are required (--lipschitz): no limit is known for the base gains.")
    return tuple(share * limit for share in SHARES)


def _lowest_degree(loop: Loop, bound: Fraction) -> int:
    """Lowest degree with a clear margin for the base gains; the lowest candidate if there is none."""
    bounded, degrees = replace(loop, uncertain={**loop.uncertain, "d": (-bound, bound)}), candidate_degrees(loop)
    for degree in degrees:
        solution = Sweep(bounded, degree).solve(bounded)
        if solution is not None and solution.margin > CLEAR:
            return degree
    return degrees[0]


def _screen(
    sheet: MapDefinition, screeners: Screeners, progress: Progress
) -> tuple[dict[Place, Fraction | None], dict[Place, int], int]:
    """Limit and screened level of every point, and number of solves."""
    limits: dict[Place, Fraction | None] = {}
    screened: dict[Place, int] = {}
    rows, solves = sheet.rows, 0
    progress(f"screening 0 of {sum(map(len, rows))} points", 0.0)
    for points, more in screeners.results("row", ((row,) for row in rows)):
        solves += more
        for place, limit, reached in points:
            limits[place], screened[place] = limit, reached
        progress(f"screening {len(screened)} of {sum(map(len, rows))} points", len(screened) / sum(map(len, rows)))
    return limits, screened, solves


def _prove(
    sheet: MapDefinition,
    screeners: Screeners,
    reached: dict[Place, int],
    interior: int,
    seed: int,
    progress: Progress,
) -> tuple[dict[Place, int], dict[Place, str], frozenset[Place], int]:
    """Proved level of edge points and random points, certificates, edges, and number of solves.

    Levels are proved from the highest down. A point without a proof drops to the next level, which moves the edge.
    """
    proved: dict[Place, int] = {}
    texts: dict[Place, str] = {}
    edges: set[Place] = set()
    solves = 0

    def run(open_places: list[tuple[Place, int]], what: str) -> None:
        nonlocal solves
        for done, (place, level, text, more) in enumerate(screeners.results("proof", open_places), 1):
            solves += more
            if text is None:
                reached[place] = level - 1
                proved.setdefault(place, 0)
            else:
                proved[place], texts[place] = level, text
            progress(f"proving {what}: {done} of {len(open_places)}", done / len(open_places))

    for level in range(len(sheet.levels), 0, -1):
        while True:
            inside = {p for p, k in reached.items() if k >= level}
            edge = {p for p in inside if _at_edge(p, inside, sheet)}
            edges |= edge
            open_places = [(p, level) for p in sorted(edge) if proved.get(p, 0) < level]
            if not open_places:
                break
            run(open_places, f"the edge at L̄ = {float(sheet.levels[level - 1]):.4g}")
    run(_drawn(reached, proved, interior, seed), "interior points")
    return proved, texts, frozenset(edges), solves


def _drawn(reached: Mapping[Place, int], proved: Mapping[Place, int], count: int, seed: int) -> list[tuple[Place, int]]:
    """Random points without an attempted proof, each with its level."""
    inside = sorted(p for p, k in reached.items() if k and p not in proved)
    chosen = np.random.default_rng(seed).permutation(len(inside))[:count]
    return [(inside[i], reached[inside[i]]) for i in sorted(chosen.tolist())]


def _at_edge(place: Place, inside: set[Place], sheet: MapDefinition) -> bool:
    """Whether a neighbour on the grid is outside."""
    sizes = tuple(len(axis) for axis in sheet.axes)
    neighbours = ((place[0] + a, place[1] + b) for a, b in _NEIGHBOURS)
    return any(0 <= i < sizes[0] and 0 <= j < sizes[1] and (i, j) not in inside for i, j in neighbours)
