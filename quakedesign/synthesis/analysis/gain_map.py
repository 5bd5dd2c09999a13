"""Where two gains are certified: a grid screened with one compiled problem, its edges and a sample proved exactly."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from math import log10
from time import perf_counter

import numpy as np

from quakedesign.certificates import Loop
from quakedesign.controllers import Subject
from quakedesign.errors import ParameterError
from quakedesign.executors import Here, crew_or_here
from quakedesign.fault.checks import MOST_WORKERS, require_count
from quakedesign.rationals import rational
from quakedesign.sos.solve.conic import handing_back
from quakedesign.synthesis.analysis.certify import Number, closed_loop
from quakedesign.synthesis.analysis.gain_map_workers import Place, Screeners, Sheet
from quakedesign.synthesis.analysis.margins import necessary_limit
from quakedesign.synthesis.analysis.parametric_program import CLEAR, Sweep
from quakedesign.synthesis.lyapunov.search import candidate_degrees

SHARES = tuple(Fraction(s, 100) for s in (25, 50, 75, 90, 99))
"""Levels of L̄ as shares of the necessary limit of the base gains, unless levels are given."""
_NEIGHBOURS = ((1, 0), (-1, 0), (0, 1), (0, -1))


@dataclass(frozen=True, slots=True, kw_only=True)
class GainMap:
    """Largest level of L̄ at every point of a grid of two gains, as screened and as proved.

    Attributes
    ----------
    sheet : Sheet
        What was asked: law, gains, axes, levels.
    limits : mapping of (i, j) to Fraction or None
        Necessary limit of L̄.
    screened : mapping of (i, j) to int
        Number of levels at which the search in floating point finds a Lyapunov function; proves nothing.
    proved : mapping of (i, j) to int
        Number of levels that a certificate, checked in exact arithmetic, covers; only for points that were tried.
    edges : frozenset of (i, j)
        Points with a neighbour of a lower level; all of them were tried.
    certificates : mapping of (i, j) to str
        Text of the certificate for the highest level proved.
    solves : int
    seconds : mapping of str to float
        Of ``"screening"`` and ``"proving"``.
    """

    sheet: Sheet
    limits: Mapping[Place, Fraction | None]
    screened: Mapping[Place, int]
    proved: Mapping[Place, int]
    edges: frozenset[Place]
    certificates: Mapping[Place, str]
    solves: int
    seconds: Mapping[str, float] = field(default_factory=dict)

    def role(self, place: Place) -> str:
        """``"edge"``, ``"interior"`` (drawn at random) or nothing for a point that was only screened."""
        if place in self.edges:
            return "edge"
        return "interior" if place in self.proved else ""

    def counts(self, level: int) -> dict[str, int]:
        """Points screened and proved at a level (from 1), and among them those on its own edge."""
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
    tell: Callable[[str, float], None] = lambda _what, _done: None,
) -> GainMap:
    """Certified region over two gains, at one or more levels of L̄.

    Every point is screened. All points at the edge of a level, and `interior` random points inside, are then proved
    exactly; where no proof can be finished the point counts as screened only, and its neighbours are tried for it.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        See `certify`.
    gains : tuple of number or text
        Values of the gains that do not vary, in the order of the law.
    over : tuple of two str
        Names of the gains that vary.
    ranges : sequence of two pairs, optional
        Ends of both axes; a quarter to four times the base gain unless given. Positive ranges are divided in equal
        ratios.
    points : int
        Along each axis.
    levels : sequence of number or text, optional
        L̄; the shares `SHARES` of the necessary limit of the base gains unless given.
    gain_range : tuple of two
        b_m and b_M [-].
    degree : int, optional
        Of V; the lowest that clearly finds the base gains at the lowest level unless given.
    interior : int
        Number of points inside to prove.
    seed : int
        Of their choice.
    workers : int
        Number of processes; 1 computes in this one. No digit depends on who computes.
    scheduler : str, optional
        Address of a dask.distributed scheduler that is used instead.
    executor : Executor, optional
        Any other executor of `concurrent.futures` that is used instead.
    tell : callable
        Progress.

    Returns
    -------
    GainMap

    Raises
    ------
    ParameterError, UnknownNameError, CertificateError
        For unknown gains, empty ranges or levels, and as `certify`.
    SimulationError
        When the workers cannot be reached, or do not live.
    """
    require_count(MOST_WORKERS, workers=workers)
    sheet = _sheet(subject, gains, over, ranges, points, levels, gain_range, degree)
    with Here() if handing_back() else crew_or_here(workers, scheduler, executor) as crew:
        began, screeners = perf_counter(), Screeners(sheet, crew)
        limits, screened, solves = _screen(sheet, screeners, tell)
        middle = perf_counter()
        proved, texts, edges, more = _prove(sheet, screeners, dict(screened), interior, seed, tell)
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
) -> Sheet:
    loop = closed_loop(subject, gains, lipschitz=1, gain_range=gain_range)
    if "d" not in loop.uncertain or len(set(over)) != 2 or not set(over) <= set(loop.gains):
        raise ParameterError(
            f"a map needs two different gains among {', '.join(loop.gains)}. Received {' '.join(over)}."
        )
    if points < 2:
        raise ParameterError(f"a map needs at least two points along each axis. Received {points}.")
    ends = ranges or [(loop.gains[name] / 4, loop.gains[name] * 4) for name in over]
    first, second = (axis(low, high, points, f"range of {name}") for name, (low, high) in zip(over, ends, strict=True))
    chosen = _levels(subject, loop, levels)
    sheet = Sheet(subject=subject, loop=loop, over=over, axes=(first, second), levels=chosen, degree=degree or 0)
    return sheet if degree else replace(sheet, degree=_lowest_degree(loop, chosen[0]))


def axis(low: Number, high: Number, points: int, what: str = "range") -> tuple[Fraction, ...]:
    """Values from low to high: decimals of four or more digits, in equal ratios where both ends are positive.

    Raises
    ------
    ParameterError
        When the range is empty.
    """
    first, last = rational(low, what), rational(high, what)
    if not first < last:
        raise ParameterError(f"{what} must rise. Received {low} to {high}.")
    shares = [i / (points - 1) for i in range(1, points - 1)]
    a, b = float(first), float(last)
    inner = [a * (b / a) ** s if first > 0 else a + (b - a) * s for s in shares]
    digits = 3 + max(0, round(log10(points)) - 1)
    values = (first, *(Fraction(f"{v:.{digits}e}") for v in inner), last)
    if any(u >= v for u, v in pairwise(values)):
        raise ParameterError(
            f"{what} is too narrow for {points} points. Received {low} to {high}. Ask for fewer points."
        )
    return values


def _levels(subject: Subject, loop: Loop, levels: Sequence[Number] | None) -> tuple[Fraction, ...]:
    if levels is not None:
        ordered = tuple(sorted({rational(v, "lipschitz") for v in levels}))
        if not ordered or ordered[0] < 0:
            raise ParameterError(f"lipschitz must not be negative. Received {', '.join(map(str, levels)) or 'none'}.")
        return ordered
    limit = necessary_limit(loop, subject)
    if not limit:
        raise ParameterError("levels of L̄ are needed, since the base gains give no limit. Give --lipschitz.")
    return tuple(share * limit for share in SHARES)


def _lowest_degree(loop: Loop, bound: Fraction) -> int:
    """First degree that finds the base gains with a clear margin, or the first of all."""
    asked, degrees = replace(loop, uncertain={**loop.uncertain, "d": (-bound, bound)}), candidate_degrees(loop)
    for degree in degrees:
        answer = Sweep(asked, degree).solve(asked)
        if answer is not None and answer.margin > CLEAR:
            return degree
    return degrees[0]


def _screen(
    sheet: Sheet, screeners: Screeners, tell: Callable[[str, float], None]
) -> tuple[dict[Place, Fraction | None], dict[Place, int], int]:
    """Limit and screened level of every point, and solves."""
    limits: dict[Place, Fraction | None] = {}
    screened: dict[Place, int] = {}
    rows, solves = sheet.rows, 0
    tell(f"screening 0 of {sum(map(len, rows))} points", 0.0)
    for found, more in screeners.answers("row", ((row,) for row in rows)):
        solves += more
        for place, limit, reached in found:
            limits[place], screened[place] = limit, reached
        tell(f"screening {len(screened)} of {sum(map(len, rows))} points", len(screened) / sum(map(len, rows)))
    return limits, screened, solves


def _prove(
    sheet: Sheet,
    screeners: Screeners,
    reached: dict[Place, int],
    interior: int,
    seed: int,
    tell: Callable[[str, float], None],
) -> tuple[dict[Place, int], dict[Place, str], frozenset[Place], int]:
    """Proved level of the points at edges and of random ones, certificates, edges, and solves.

    Levels are taken from the highest down. A point that cannot be proved leaves its level, which moves the edge.
    """
    proved: dict[Place, int] = {}
    texts: dict[Place, str] = {}
    edges: set[Place] = set()
    solves = 0

    def run(asked: list[tuple[Place, int]], what: str) -> None:
        nonlocal solves
        for done, (place, level, text, more) in enumerate(screeners.answers("proof", asked), 1):
            solves += more
            if text is None:
                reached[place] = level - 1
                proved.setdefault(place, 0)
            else:
                proved[place], texts[place] = level, text
            tell(f"proving {what}: {done} of {len(asked)}", done / len(asked))

    for level in range(len(sheet.levels), 0, -1):
        while True:
            inside = {p for p, k in reached.items() if k >= level}
            edge = {p for p in inside if _at_edge(p, inside, sheet)}
            edges |= edge
            asked = [(p, level) for p in sorted(edge) if proved.get(p, 0) < level]
            if not asked:
                break
            run(asked, f"the edge at L̄ = {float(sheet.levels[level - 1]):.4g}")
    run(_drawn(reached, proved, interior, seed), "points inside")
    return proved, texts, frozenset(edges), solves


def _drawn(reached: Mapping[Place, int], proved: Mapping[Place, int], count: int, seed: int) -> list[tuple[Place, int]]:
    """Random points that were not tried yet, each with its own level."""
    inside = sorted(p for p, k in reached.items() if k and p not in proved)
    chosen = np.random.default_rng(seed).permutation(len(inside))[:count]
    return [(inside[i], reached[inside[i]]) for i in sorted(chosen.tolist())]


def _at_edge(place: Place, inside: set[Place], sheet: Sheet) -> bool:
    """Whether a neighbour on the grid is not inside."""
    sizes = tuple(len(axis) for axis in sheet.axes)
    around = ((place[0] + a, place[1] + b) for a, b in _NEIGHBOURS)
    return any(0 <= i < sizes[0] and 0 <= j < sizes[1] and (i, j) not in inside for i, j in around)
