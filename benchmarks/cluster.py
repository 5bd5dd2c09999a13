"""Many tiny samples on a dask cluster of this machine: memory of the scheduler, efficiency of two workers.

Run with ``python benchmarks/cluster.py``; a minute. ``--samples 100000 --steps 10000`` takes ten. Scheduler and workers
are processes of their own; compiling the loop and reaching the cluster are not part of the times, all else is.
"""

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import quakedesign as qd
from quakedesign.simulation.campaign import CampaignProblem, campaign_problem, run_campaign

MOST_GROWTH, LEAST_EFFICIENCY = 100.0, 0.9


def main() -> None:
    """Print one line a cluster, and the efficiency."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--samples", type=int, default=5000)
    parser.add_argument("--steps", type=int, default=2000, help="of 1 ms, of one sample")
    given = parser.parse_args()
    fault, law = qd.load_fault("lab-fault", box="ten-percent"), qd.published("lab-fault")["cta"]
    problem = campaign_problem(fault, law, scheme="compensated", duration=given.steps * fault.sampling_time)
    print(f"{given.samples} samples of {problem.setting.steps} steps")
    two, one = (timed(problem, given.samples, workers) for workers in (2, 1))
    print(
        f"efficiency on 2 workers: {one / (2 * two):.2f}; at least {LEAST_EFFICIENCY} where samples take 1 ms or more"
    )


def timed(problem: CampaignProblem, samples: int, workers: int) -> float:
    """Seconds of a campaign on a cluster of its own."""
    with tempfile.TemporaryDirectory() as folder, cluster(workers, Path(folder)) as (address, scheduler):
        out = Path(folder) / "campaign"
        run_campaign(problem, 32 * workers, out, scheduler=address, batch=16)  # every worker has the program
        before, mine, own = memory(scheduler), memory(os.getpid()), time.process_time()
        began = perf_counter()
        done = run_campaign(problem, samples, out, scheduler=address)
        seconds, own = perf_counter() - began, time.process_time() - own
        grown, files = memory(scheduler) - before, len(list((out / "batches").iterdir()))
        assert not done.failures
        print(
            f"{workers} workers: {seconds:.1f} s; scheduler {before:.0f} MB, {grown:+.0f} MB of {MOST_GROWTH:.0f}; "
            f"here {own:.1f} s of the processor, {memory(os.getpid()) - mine:+.0f} MB; {files} files",
            flush=True,
        )
    return seconds


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[tuple[str, int]]:
    """Address of a cluster and process of its scheduler."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    common = {"cwd": folder, "env": os.environ | {"OMP_NUM_THREADS": "1"}, "stderr": subprocess.DEVNULL}
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--dashboard-address", ":0", "--host", "127.0.0.1"]
    work = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        address,
        "--dashboard-address",
        ":0",
        "--nthreads",
        "1",
    ]
    scheduler = subprocess.Popen([*start, "--port", str(port)], **common)
    crew = subprocess.Popen([*work, "--nworkers", str(workers), "--local-directory", str(folder)], **common)
    try:
        time.sleep(8)  # until all workers are there
        yield address, scheduler.pid
    finally:
        for process in (crew, scheduler):
            process.terminate()
            process.wait()


def memory(process: int) -> float:
    """Resident memory of a process [MB]."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


if __name__ == "__main__":
    main()
