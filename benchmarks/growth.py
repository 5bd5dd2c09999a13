"""What things cost by their size: steps, cells, states, degree, points of a map, samples and workers, in one run.

Run with ``python benchmarks/growth.py``; three minutes. All figures are processor seconds, those of processes that end
included; nothing is kept from one to the next. One line a size, with the ratio to the line before.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import quakedesign as qd
from quakedesign import cache
from quakedesign.guarantees import TrackingProof
from quakedesign.guarantees.exact.norms import _norms
from quakedesign.laws import family
from quakedesign.loop import Actuator, Diffusion
from quakedesign.lyapunov.maps.gain_map import gain_map
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.simulation.campaign import campaign_problem, run_campaign
from quakedesign.synthesis.sliding_mode_design import sliding_mode_loop

FAULT = qd.load_fault("real-fault")
BASE = family("cta")[0].law
SUBSTEPS = 100
LAW = qd.published("real-fault")["cta"]
Line = tuple[str, float, str]


def spent(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of a piece of work, and what it gives."""
    before = sum(os.times()[:4])
    found = work()
    return sum(os.times()[:4]) - before, found


def run(steps: int, cells: int | None = None) -> Any:
    """Machine code over many steps, through rock of some cells if there are any."""
    rock = None if cells is None else Actuator(stages=(Diffusion(length=1.0, diffusivity=1.0, cells=cells),))
    given: dict[str, Any] = {} if rock is None else {"scheme": "explicit", "actuator": rock, "substeps": SUBSTEPS}
    return qd.simulate(FAULT, LAW, duration=steps * FAULT.sampling_time, samples=100, compiled=True, **given)


def of_steps() -> Iterator[Line]:
    """A run of the published 2-CTA, all included."""
    run(1)
    for steps in (450_000, 900_000, 1_800_000, 3_600_000):
        yield f"{steps} steps", spent(partial(run, steps))[0], ""


def of_cells() -> Iterator[Line]:
    """The same through rock, ten thousand steps of a hundred substeps, compiled before."""
    for cells in (2, 4, 8):
        compiling, _ = spent(partial(run, 1, cells))
        yield f"{cells} cells", spent(partial(run, 10_000, cells))[0], f"compiling {compiling:.2f} s"


def of_states() -> Iterator[Line]:
    """Deciding a guarantee of the e-LQR that acts some periods late, p held over 50 ms."""
    for late in range(4):
        step = Fraction(1, 20)
        designing, found = spent(partial(qd.guarantee, FAULT, step=step, delay=late * step))
        if isinstance(found.proof, TrackingProof):
            _norms.cache_clear()
            yield f"{len(found.proof.loop.states)} states", spent(found.proof.check)[0], f"designing {designing:.1f} s"


def of_degree() -> Iterator[Line]:
    """A certificate of the 2-CTA of the literature."""
    loop = sliding_mode_loop(BASE, Fraction(1, 2), (Fraction(1), Fraction(1)))
    for degree in (5, 6, 8):
        took, found = spent(partial(find_certificate, loop, degree))
        yield f"degree {degree}", took, f"checking {spent(found.check)[0]:.2f} s" if found else "none"


def of_points() -> Iterator[Line]:
    """Screening of a map of the 2-CTA at one level, and the proofs of its edges."""
    given: dict[str, Any] = {"levels": ["1/2"], "interior": 0, "workers": 1}
    for points in (8, 16, 32):
        gains = tuple(map(str, BASE.gains.values()))
        took, drawn = spent(partial(gain_map, "cta", gains, ("k1", "k2"), points=points, **given))
        yield f"{points**2} points", took, f"{len(drawn.edges)} at edges"


def of_samples() -> Iterator[Line]:
    """A campaign in the laboratory, 20 s each, on one process and on two, their start included."""
    fault, law = qd.load_fault("lab-fault", box="ten-percent"), qd.published("lab-fault")["cta"]
    problem = campaign_problem(fault, law, scheme="compensated", duration=20.0)
    for samples, workers in ((500, 1), (1000, 1), (2000, 1), (2000, 2)):
        with tempfile.TemporaryDirectory() as folder:
            took, _ = spent(partial(run_campaign, problem, samples, Path(folder) / "campaign", workers=workers))
        yield f"{samples} samples, {workers} workers", took, ""


TABLES = (of_steps, of_cells, of_states, of_degree, of_points, of_samples)


def main() -> None:
    """Print every table."""
    os.environ[cache.PLACE] = "off"
    for table in TABLES:
        print((table.__doc__ or "").strip())
        before = None
        for name, seconds, more in table():
            ratio = "" if before is None else f", {seconds / before:.2g} times"
            print(f"  {name}: {seconds:.2f} s{ratio}{'; ' if more else ''}{more}", flush=True)
            before = seconds


if __name__ == "__main__":
    main()
