"""What compiling a loop takes by its substeps and diffusion cells, beside the same substeps written out, in one run.

Run with ``python benchmarks/compiling.py``; a minute. Written out, as all were once, 76 substeps take 20 s and 700 MB.
"""

import resource
import tempfile
from pathlib import Path
from typing import Any

import casadi as ca

import quakedesign as qd
from quakedesign.loop import Actuator, Diffusion, simulation_scheme
from quakedesign.simulation import integrator
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.compiled import compiler, shared_library
from quakedesign.simulation.recorder import Recorder

FAULT = qd.load_fault("real-fault")
LAW = qd.published("real-fault")["cta"]
LONGEST_WRITTEN_OUT = 20


class WrittenOut(ClosedLoop):
    """Loop whose substeps are expressions one after the other."""

    def metered_often(
        self, method: Any, motion: Any, given: Any, start: tuple[Any, Any], step: float, times: int
    ) -> tuple[Any, Any]:
        """See `ClosedLoop.metered_often`."""
        for number in range(times):

            def one(plant: Any, passed: Any, now: Any, told: Any, before: int = number) -> Any:
                return motion(plant, before + passed, now, told)

            start = super().metered_often(method, one, given, start, step, 1)
        return start


def compiled(kind: type[ClosedLoop], substeps: int, cells: int) -> tuple[float, int]:
    """Processor seconds of the compiler, and kilobytes of C."""
    rock = Actuator(stages=(Diffusion(length=1.0, diffusivity=1.0, cells=cells),))
    scheme = simulation_scheme("explicit", substeps=substeps, actuator=rock)
    recorder = Recorder(kind(FAULT, LAW), scheme, FAULT.sampling_time)
    vector = ca.SX.sym("z", recorder.size)
    generator = ca.CodeGenerator("steps.c")
    generator.add(ca.Function("step", [vector], [recorder.advance(vector, integrator("dormand-prince"))]))
    text, before = generator.dump(), resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        shared_library(text, Path(folder), compiler())
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, len(text) // 1000


def main() -> None:
    """Print every pair with its ratio."""
    for substeps, cells in ((10, 2), (20, 2), (100, 2), (100, 4), (100, 8)):
        seconds, size = compiled(ClosedLoop, substeps, cells)
        print(f"{substeps} substeps, {cells} cells: {seconds:.2f} s, {size} kB of C", end="", flush=True)
        if substeps <= LONGEST_WRITTEN_OUT:
            before, large = compiled(WrittenOut, substeps, cells)
            print(f"; written out {before:.2f} s, {large} kB, ratio {before / seconds:.2g}", end="")
        print(flush=True)
    most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    print(f"largest process: {most} MB")


if __name__ == "__main__":
    main()
