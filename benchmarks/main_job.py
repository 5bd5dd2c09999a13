"""The main job beside that of another checkout, in one run: processor seconds, of the compiler among them.

Run with ``git worktree add BEFORE 81003dc && python benchmarks/main_job.py --before BEFORE``; three minutes. The first
one finds nothing in the cache, the second what the first has kept there. Bytecode is there, as after
installation. Other work on the machine costs processor time, too, in shared caches: run it twice and take the less.
"""

import argparse
import compileall
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


LIMITS = {"first": 20.0, "again": 5.0}


def seconds(tree: Path, fault: str, cache: Path) -> float:
    """Processor time of ``design`` [s], user and system, of a checkout, with a folder for what is kept."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        call = [sys.executable, "-m", "quakedesign", "design", fault, "--out", str(Path(folder) / "design")]
        environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "QUAKEDESIGN_CACHE": str(cache)}
        subprocess.run(call, cwd=folder, env=environment, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print the times, their limits and their ratios."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--before", type=Path)
    parser.add_argument("--fault", default="real-fault")
    given = parser.parse_args()
    for tree in filter(None, (ROOT, given.before)):
        compileall.compile_dir(tree / "quakedesign", quiet=1)
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "cache"
        was = seconds(given.before.absolute(), given.fault, cache) if given.before else None
        for which, limit in LIMITS.items():
            now = seconds(ROOT, given.fault, cache)
            other = "" if was is None else f"; before {was:.1f} s, ratio {was / now:.2g}"
            print(f"design {given.fault}, {which}: {now:.1f} s of at most {limit:g} s{other}", flush=True)


if __name__ == "__main__":
    main()
