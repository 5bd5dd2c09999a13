"""Where people wait: processor seconds of short commands beside those of another checkout, in one run.

Run with ``git worktree add BEFORE 81003dc && python benchmarks/latency.py --before BEFORE``; two minutes. Each figure
is the least of several processes, user and system time, both checkouts in turn; without ``--before`` there are the
limits alone. Bytecode is there, as after installation. Limits are for a quiet machine: on a busy one all figures are
up to half as large again, the ratios stay.
"""

import argparse
import compileall
import os
import resource
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TIMES = 5
LIMITS = {
    "-c import quakedesign": 0.05,
    "-m quakedesign --help": 0.12,
    "-m quakedesign simulte": 0.3,
    "-m quakedesign desing real-fault": 0.3,
    "-m quakedesign simulate real-fault --stp 3": 0.3,
    "-m quakedesign simulate real-fault --step 3x": 0.3,
    "-m quakedesign fault real-fautl": 0.3,
    "-m quakedesign certify cta --gains 7 5 x 1.1 --lipschitz 1": 0.3,
    "-m quakedesign fault real-fault": 0.8,
    "-m quakedesign check proofs/certificates/cta_7_5_2.3_1.1.json": 0.4,
    "-m quakedesign check proofs/certificates/elqr_real-fault.json": 0.4,
    "-m quakedesign check proofs/certificates/guarantee_real-fault.json": 0.4,
    "-m quakedesign check proofs/certificates/motzkin_not-sos.json": 0.4,
    "-m quakedesign certify cta --gains 7 5 2.3 1.1 --lipschitz 1": 1.0,
}


def words(call: str) -> list[str]:
    """Arguments of a call of Python; a programme is one of them."""
    return ["-c", call.removeprefix("-c ")] if call.startswith("-c ") else call.split()


def seconds(call: str, tree: Path) -> float:
    """Processor time of a call [s], of a checkout."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, *words(call)], cwd=tree, env=environment, capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print every call with its time, its limit, and the time of the other checkout."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--before", type=Path)
    before = parser.parse_args().before
    trees = [ROOT, *([before.absolute()] if before else [])]
    for tree in trees:
        compileall.compile_dir(tree / "quakedesign", quiet=1)
    for call, limit in LIMITS.items():
        now, *was = (
            min(found) for found in zip(*([seconds(call, t) for t in trees] for _ in range(TIMES)), strict=True)
        )
        other = "".join(f"; before {then:.3f} s, ratio {then / now:.2g}" for then in was)
        print(f"{call}: {now:.3f} s of at most {limit:g} s{other}", flush=True)


if __name__ == "__main__":
    main()
