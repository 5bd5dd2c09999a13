"""Questions about given gains and maps of gains against the naive loop, which builds everything anew for every point.

Then the time of checking every shipped certificate, with the package and with the standalone `proofs/check.py`.
Run with ``python benchmarks/gains.py``; about half a minute. All times are CPU seconds of one process with one thread,
so that other work on the machine does not count. Both ways use the same law, the same degree of V and the same solver.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from statistics import median
from time import process_time
from types import ModuleType
from typing import Any

import clarabel
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import dims_to_solver_cones
from scipy import sparse

from quakedesign.checking import check_files
from quakedesign.lyapunov import Loop
from quakedesign.lyapunov.maps.gain_map import MapDefinition, Screener, axis
from quakedesign.lyapunov.maps.sweep import ACCURACY, Sweep
from quakedesign.lyapunov.search.certify import closed_loop, largest_lipschitz
from quakedesign.lyapunov.search.lyapunov_search import balance, certificate_from_proposal, family_of
from quakedesign.sos.solve.joint import JointProgram, Proposal
from quakedesign.sos.solve.moment import settings

DEGREE = 5
SETS = (("5", "5", "2.3", "1.1"), ("5", "15", "2.3", "1.1"), ("7", "5", "2.3", "1.1"), ("25", "15", "2.3", "1.1"))
PROOFS = Path(__file__).parents[1] / "proofs"
MAPPED, OVER, LEVEL = ("7", "5", "2.3", "1.1"), ("k1", "k2"), Fraction(1)


def cpu(action: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds and result."""
    began = process_time()
    result = action()
    return process_time() - began, result


def one_solve(loop: Loop, repeats: int = 20) -> float:
    """Time of Clarabel alone on the programme that the search solves, as accurately, without building it."""
    sweep = Sweep(loop, DEGREE)
    sweep.solve(loop)
    (numbers,) = sweep._numbers.values()
    data, _, _ = numbers.cones.compiled.data()
    nothing, cones = sparse.csc_array((len(data["c"]),) * 2), dims_to_solver_cones(data["dims"])
    solver = clarabel.DefaultSolver(nothing, data["c"], data["A"], data["b"], cones, settings(ACCURACY))
    return median(cpu(solver.solve)[0] for _ in range(repeats))


def naive_proposal(loop: Loop) -> tuple[Any, Proposal | None]:
    """Everything from the law's expressions on, for one point."""
    family = family_of(loop, DEGREE, balance(loop))
    assert family is not None
    return family, JointProgram(family.demands).solve(family.demands)


def at(loop: Loop, bound: Fraction) -> Loop:
    """The loop with another bound."""
    return replace(loop, uncertain={**loop.uncertain, "d": (-bound, bound)})


def naive_largest(gains: tuple[str, ...]) -> tuple[Fraction, int]:
    """Bisection to four digits, each step from nothing; then one proof."""
    loop = closed_loop("cta", gains, lipschitz=1)
    low, high, solves = Fraction(0), loop.gains["k3"] - loop.gains["k4"], 0
    best: tuple[Any, Proposal] | None = None
    while high > low * Fraction(10_001, 10_000):
        middle = Fraction(f"{float((low + high) / 2):.7e}")
        family, proposal = naive_proposal(at(loop, middle))
        solves += 1
        if proposal is not None and proposal.margin > 1e-9:
            low, best = middle, (family, proposal)
        else:
            high = middle
    assert best is not None
    assert certificate_from_proposal(at(loop, low), *best, balance(loop), "cta") is not None
    return low, solves


def question() -> None:
    """Largest L̄: time in solves, and against the naive way."""
    unit = one_solve(closed_loop("cta", SETS[0], lipschitz=1))
    print(f"one Clarabel solve of the 2-CTA, degree {DEGREE}: {unit * 1e3:.1f} ms")
    print("largest L̄ to four digits, proved exactly (at most 25 solves' worth of time is the aim)")
    for gains in SETS:
        own, reach = min(
            (cpu(lambda g=gains: largest_lipschitz("cta", g, degrees=DEGREE)) for _ in range(3)), key=first
        )
        other, (value, solves) = cpu(lambda g=gains: naive_largest(g))
        print(
            f"  {' '.join(gains):14} {float(reach.value):.6f} in {own:.2f} s = {own / unit:.1f} solves ({reach.solves} "
            f"made); naive {float(value):.6f} in {other:.2f} s = {other / unit:.1f} ({solves}); ratio {own / other:.3f}"
        )


def first(pair: tuple[float, Any]) -> float:
    """Key of a timing."""
    return pair[0]


def mapping(across: int = 16) -> None:
    """Throughput of screening one core, and of exact proofs."""
    loop = closed_loop("cta", MAPPED, lipschitz=LEVEL)
    axes = [axis(loop.gains[n] / 4, loop.gains[n] * 4, across) for n in OVER]
    sheet = MapDefinition(subject="cta", loop=loop, over=OVER, axes=(axes[0], axes[1]), levels=(LEVEL,), degree=DEGREE)
    own, (screener, found) = cpu(lambda: screened(sheet))
    places = [place for row in sheet.rows for place in row]
    sample = places[:: max(1, len(places) // 64)]
    other, naive = cpu(lambda: [bool((p := naive_proposal(sheet.at(s, 1))[1]) and p.margin > 1e-9) for s in sample])
    agreed = sum(bool(found[place]) == answer for place, answer in zip(sample, naive, strict=True))
    per_point, per_naive = own / len(places), other / len(sample)
    print(f"map over k1, k2: {1 / per_point:.1f} points a second and core, compiling included")
    print(f"  naive {1 / per_naive:.1f}; ratio of times {per_point / per_naive:.3f}")
    print(f"  same answer at {agreed} of {len(sample)}")
    inside = [place for place in places if found[place]][::7]
    proving, proofs = cpu(lambda: [screener.proof(place, 1)[2] is not None for place in inside])
    print(f"  exact proofs: {proving / len(inside):.2f} s each, {sum(proofs)} of {len(inside)} done")


def screened(sheet: MapDefinition) -> tuple[Screener, dict]:
    """All points of a sheet."""
    screener = Screener(sheet)
    return screener, {place: reached for row in sheet.rows for place, _, reached in screener.row(row)[0]}


def catalogue() -> None:
    """Time of reading and checking every shipped certificate; a first one leaves imports out."""
    standalone = standalone_checker()
    files = sorted((PROOFS / "certificates").glob("*.json"))
    check_files(files[:1])
    print("checking the catalogue (aims: package 0.2 s, 1 s for 2-DIA; proofs/check.py 2 s, 10 s for 2-DIA)")
    for path in files:
        own, verdicts = cpu(lambda p=path: check_files([p]))
        other, result = cpu(lambda p=path: standalone.check(p.read_text(encoding="utf-8")))
        assert verdicts[str(path)][0] == result.verdict
        print(f"  {path.name:34} {result.verdict:7} package {own:.2f} s, proofs/check.py {other:.2f} s")


def standalone_checker() -> ModuleType:
    """The standalone checker, as a module."""
    specification = importlib.util.spec_from_file_location("standalone_check", PROOFS / "check.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules["standalone_check"] = module
    specification.loader.exec_module(module)
    return module


if __name__ == "__main__":
    question()
    mapping()
    catalogue()
