"""Maps of two gains: questions answered along a path beside a solver for each, and whole maps in processor time.

Run with ``python benchmarks/maps.py``; five minutes. The first lines ask every tenth row of a map of a hundred by a
hundred points at five levels, both ways, and count points with another answer. ``--whole cta`` and ``--whole dia`` draw
such a map on two processes, edges and 200 points inside proved.
"""

import argparse
import os
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

from quakedesign import cache
from quakedesign.laws import family
from quakedesign.lyapunov.maps.gain_map import Screener, _sheet, gain_map
from quakedesign.lyapunov.maps.sweep import Path

OVER = {"cta": ("k1", "k2"), "dia": ("kI1", "kI2")}
MINUTES = {"cta": 3, "dia": 10}
POINTS = 100


def spent(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds, those of processes that have ended included, and what was found."""
    before = sum(os.times()[:4])
    found = work()
    return sum(os.times()[:4]) - before, found


def gains(law: str) -> tuple[str, ...]:
    """Those of the literature."""
    return tuple(map(str, family(law)[0].law.gains.values()))


def screening(law: str, every: int) -> None:
    """Some rows, along a path and with a solver alone."""
    sheet = _sheet(law, gains(law), OVER[law], None, POINTS, None, (1, 1), None)
    rows = sheet.rows[::every]

    def levels() -> dict[tuple[int, int], int]:
        screener = Screener(sheet)
        return {place: level for row in rows for place, _, level in screener.row(row)[0]}

    new, along = spent(levels)
    with patch.object(Path, "feasible", lambda _self, _loop: None):
        old, alone = spent(levels)
    other = sum(along[place] != alone[place] for place in alone)
    print(
        f"{law}: {len(alone)} points screened by a solver {old:.1f} s, along a path {new:.1f} s, "
        f"{old / new:.1f} times; {other} points differ",
        flush=True,
    )


def whole(law: str) -> None:
    """A map of ten thousand points."""
    took, drawn = spent(lambda: gain_map(law, gains(law), OVER[law], points=POINTS, workers=2))
    unproved = sum(level == 0 for level in drawn.proved.values())
    print(
        f"{law}: {len(drawn.screened)} points, {drawn.solves} solves, {len(drawn.edges)} edge points, "
        f"{len(drawn.certificates)} proved, {unproved} not: {took / 60:.1f} min of the processor, on two cores "
        f"{took / 120:.1f} min of {MINUTES[law]}; waited {sum(drawn.seconds.values()) / 60:.1f} min",
        flush=True,
    )


def main() -> None:
    """Print every comparison."""
    os.environ[cache.PLACE] = "off"
    os.environ["OMP_NUM_THREADS"] = "1"
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--whole", choices=OVER)
    asked = parser.parse_args().whole
    if asked:
        whole(asked)
        return
    screening("cta", 10)
    screening("dia", 50)


if __name__ == "__main__":
    main()
