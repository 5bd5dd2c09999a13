"""Side-by-side timings of the spine in one run; ratios, because machines are noisy.

Run with ``python benchmarks/spine.py``; about a minute.
"""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import quakedesign as qd

ROOT = Path(__file__).parents[1]


def best_of(times: int, action: Callable[[], object]) -> float:
    """Shortest of several timings [s]."""
    found = []
    for _ in range(times):
        began = perf_counter()
        action()
        found.append(perf_counter() - began)
    return min(found)


def stepping() -> tuple[float, float]:
    """Compiled loop and CasADi's virtual machine, the same 400 000 steps of the 2-CTA [s]."""
    fault = qd.load_fault("real-fault")
    controller = qd.published("real-fault")["cta"]
    duration = 400_000 * fault.sampling_time

    def run(compiled: bool) -> float:
        done = qd.simulate(fault, controller, duration=duration, compiled=compiled)
        return float(done.provenance["stepping_seconds"])

    return min(run(True) for _ in range(3)), run(False)


def checking() -> tuple[float, float]:
    """Package (python-flint, in process) and standard-library checker (new process), one 2-CTA certificate [s]."""
    _, certificate = qd.certify("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "57/40"))
    assert certificate is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cta.json"
        certificate.save(path)
        command = [sys.executable, str(ROOT / "proofs" / "check.py"), str(path)]
        return best_of(3, certificate.check), best_of(
            3, lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        )


def main() -> None:
    """Print every pair with its ratio."""
    for name, (first, second) in {
        "400 000 steps: compiled, virtual machine": stepping(),
        "check one 2-CTA certificate: package, check.py with start-up": checking(),
    }.items():
        print(f"{name}: {first:.3g} s, {second:.3g} s, ratio {second / first:.2g}")


if __name__ == "__main__":
    main()
