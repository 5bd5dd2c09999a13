"""Campaigns on one worker and on several: seconds, efficiency, and the same digits.

Run with ``python benchmarks/campaign.py``; about a minute. ``--samples 1000 --duration 3600`` is the laboratory loop
over one hour at 1 ms. The efficiency is t(1)/(n·t(n)); starting the processes is part of it, deriving and compiling
the loop is not. On a machine that others use too, ``--repeats N`` takes the fastest of N runs of each kind, in turn,
and the processor time of all workers together shows what sharing the work costs by itself.
"""

import argparse
import os
import resource
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import quakedesign as qd
from quakedesign.simulation.campaign import Campaign, CampaignProblem, campaign_problem, run_campaign


@dataclass(frozen=True, kw_only=True)
class Run:
    """A campaign with its wall-clock time [s] and the processor time of its workers [s]."""

    workers: int
    seconds: float
    busy: float
    campaign: Campaign


def main() -> None:
    """Print the table."""
    chosen = arguments()
    fault = qd.load_fault("lab-fault", box="ten-percent")
    law = qd.published("lab-fault")[chosen.controller]
    problem = campaign_problem(fault, law, scheme=chosen.scheme, duration=chosen.duration)
    print(f"{chosen.samples} samples of {problem.setting.steps} steps, {chosen.controller}, {chosen.scheme}")
    counts = (1, chosen.workers)
    runs = [timed(problem, chosen.samples, count) for _ in range(chosen.repeats) for count in counts]
    for run in runs:
        rate = chosen.samples * problem.setting.steps / run.seconds
        print(f"{run.workers} workers: {run.seconds:7.2f} s, {run.busy:7.2f} s busy, {rate / 1e6:.2f} million steps/s")
    one, several = (min((r for r in runs if r.workers == n), key=lambda r: r.seconds) for n in counts)
    print(f"efficiency on {chosen.workers} workers: {one.seconds / (chosen.workers * several.seconds):.2f}")
    print(f"processor time on 1 worker over that on {chosen.workers}: {one.busy / several.busy:.2f}")
    print(f"load of the machine (1 min): {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    assert all(answer(run.campaign) == answer(runs[0].campaign) for run in runs)
    print("the same digits: yes")


def arguments() -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--duration", type=float, default=60.0, help="of one run [s]")
    parser.add_argument("--controller", default="cta")
    parser.add_argument("--scheme", default="compensated")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=1)
    return parser.parse_args()


def timed(problem: CampaignProblem, samples: int, workers: int) -> Run:
    """Campaign with all samples but one still to do."""
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(problem, 1, folder, workers=1, batch=1)  # derives and compiles the loop
        began, busy = perf_counter(), processor_time()
        campaign = run_campaign(problem, samples, Path(folder), workers=workers)
        seconds = perf_counter() - began
        return Run(workers=workers, seconds=seconds, busy=processor_time() - busy, campaign=campaign)


def processor_time() -> float:
    """Processor time [s] of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def answer(campaign: Campaign) -> dict[str, Any]:
    """Everything but how it came about."""
    return {name: value for name, value in campaign.to_dict().items() if name != "resumed"}


if __name__ == "__main__":
    main()
