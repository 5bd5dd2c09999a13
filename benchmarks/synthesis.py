"""Synthesised gains against those of the literature, objective by objective, each beside an equal norm and a proof.

Run with ``python benchmarks/synthesis.py [cta|dia] [norm|decay|beta|sampled]``; all of it takes about an hour on one
core, most of it for the 2-DIA. The numbers are the same in every run on one machine. Nothing in the table is without a
certificate; only ``sampled`` adds what is measured, on the real fault at its T_s of 184 ms.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
from collections.abc import Iterator
from time import perf_counter

import quakedesign as qd
from quakedesign.lyapunov.gains.path_following import scaled_norm
from quakedesign.lyapunov.gains.synthesise import OBJECTIVES, problem_of, synthesise
from quakedesign.synthesis.simulated_error import sampling, synthesise_sampled

DEGREES = {
    ("cta", "norm"): (5, 6),
    ("cta", "beta"): (5, 6),
    ("cta", "sampled"): (5, 6),
}  # else 5, which takes less time
STARTS = {("cta", "norm"): 2, ("cta", "beta"): 2}  # else 1
LAWS = ("cta", "dia")
SAME = 1 + 1e-9
Row = tuple[tuple[float, ...], float | None, tuple[float, ...], float, float | None]


def proved(law: str, objective: str, degrees: tuple[int, ...]) -> Iterator[Row]:
    """Rows of an objective that certificates decide: gains and value of the literature and of the search, ratio.

    For objectives with a bound on the norm, the gains to beat set it, so that every row is about equal norms.
    """
    asked = problem_of(law, objective, lipschitz=1, gain_range=(1, 1), degrees=degrees)
    starts = STARTS.get((law, objective), 1)
    found = None
    for place, loop in enumerate(asked.published):
        bound = scaled_norm(loop, asked.setting.exponents) * SAME if asked.setting.objective.bounded else None
        if found is None or bound is not None:
            found = synthesise(law, objective, bound=bound, degrees=degrees, starts=starts)
        assert found is not None
        assert str(found.certificate.check()) == "proved"
        theirs, gains = found.compared[place], tuple(map(float, found.gains.values()))
        yield tuple(map(float, theirs.gains.values())), theirs.value, gains, found.value, theirs.ratio


def sampled(law: str, degrees: tuple[int, ...]) -> Iterator[Row]:
    """The same for the largest slip-rate error of a sampled run."""
    found = synthesise_sampled(sampling(qd.load_fault("real-fault"), law), degrees=degrees)
    assert found is not None
    gains = tuple(map(float, found.gains.values()))
    for other in found.compared:
        yield tuple(map(float, other.gains.values())), other.value, gains, found.value, other.ratio


def shown(numbers: tuple[float, ...]) -> str:
    """Gains for a table."""
    return ", ".join(f"{k:.4g}" for k in numbers)


def main(laws: tuple[str, ...], objectives: tuple[str, ...]) -> None:
    """Print the table."""
    print("| law | objective | published gains | their value | gains found | their value | better by |")
    print("|---|---|---|---|---|---|---|")
    for law in laws:
        for objective in objectives:
            began, degrees = perf_counter(), DEGREES.get((law, objective), (5,))
            rows = sampled(law, degrees) if objective == "sampled" else proved(law, objective, degrees)
            for published, value, found, best, ratio in rows:
                theirs = "not proved" if value is None else f"{value:.3g}"
                better = "" if ratio is None else f"{ratio:.3g}"
                print(
                    f"| {law} | {objective} | {shown(published)} | {theirs} | {shown(found)} | {best:.3g} | {better} |"
                )
            print(f"{law} {objective}: {perf_counter() - began:.0f} s", file=sys.stderr, flush=True)


if __name__ == "__main__":
    known = (*OBJECTIVES, "sampled")
    if unknown := set(sys.argv[1:]) - {*LAWS, *known}:
        raise SystemExit(
            f"arguments must be among {', '.join((*LAWS, *known))}. Received {', '.join(sorted(unknown))}."
        )
    main(*(tuple(n for n in names if n in sys.argv) or names for names in (LAWS, known)))
