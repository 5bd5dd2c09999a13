"""The main job beside that of another checkout, in one run: processor seconds, of the compiler among them.

Run with ``git worktree add BEFORE 81003dc && python benchmarks/main_job.py --before BEFORE``; three minutes.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def seconds(tree: Path, fault: str) -> float:
    """Processor time of ``design`` [s], user and system, of a checkout."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        call = [sys.executable, "-m", "quakedesign", "design", fault, "--out", str(Path(folder) / "design")]
        environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
        subprocess.run(call, cwd=folder, env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--before", type=Path)
    parser.add_argument("--fault", default="real-fault")
    given = parser.parse_args()
    now = seconds(ROOT, given.fault)
    print(f"design {given.fault}: {now:.1f} s", end="", flush=True)
    if given.before:
        was = seconds(given.before.absolute(), given.fault)
        print(f"; before {was:.1f} s, ratio {was / now:.2g}", end="")
    print()


if __name__ == "__main__":
    main()
