"""Steps of a campaign in lanes beside one sample after the other with the C library's functions, on one core.

Run with ``python benchmarks/lanes.py``; a minute. The loop before is CasADi's C for one step, called for every sample;
those after are of one source, compiled for two, four and eight numbers at once as far as this processor goes. Times are
processor time, the least of three. ``--hour`` runs 1000 samples of 3600 s on two processes; with
``CC='gcc -mno-avx512f'`` before the command AVX2 is the widest set that is used.
"""

import argparse
import ctypes
import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import casadi as ca
import numpy as np

import quakedesign as qd
from quakedesign.simulation.campaign import CampaignProblem, campaign_problem, run_campaign
from quakedesign.simulation.compiled import LANE_FLAGS, LANES, compiler, lanes_c, processor_flags, shared_library

STEPS = 4000
LOOPS = (("cta", "compensated"), ("dia", "compensated"), ("cta", "continuous"), ("elqr", "compensated"))
SETS = {"SSE2": (), "AVX2": ("-mavx2",), "AVX-512": ("-mavx512f", "-mprefer-vector-width=512")}
ONE_BY_ONE = """
__attribute__((visibility("default")))
int advance_samples(double* vectors, long long samples, long long steps) {{
  double first[{size}], second[{size}], work[{work}];
  casadi_int integers[{integers}];
  const double* arguments[{arguments}];
  double* results[{results}];
  long long sample, taken;
  int i;
  for (sample = 0; sample < samples; ++sample) {{
    double* vector = vectors + sample * {size};
    double *now = first, *next = second, *other;
    for (i = 0; i < {size}; ++i) now[i] = vector[i];
    for (taken = 0; taken < steps && !(now[{diverged}] >= 0); ++taken) {{
      arguments[0] = now;
      results[0] = next;
      if (loop_step(arguments, results, integers, work, 0)) return 1;
      other = now;
      now = next;
      next = other;
    }}
    for (i = 0; i < {size}; ++i) vector[i] = now[i];
  }}
  return 0;
}}
"""


def one_by_one(step: Any, diverged: int) -> str:
    """C with the C library's functions, one sample after the other."""
    generator = ca.CodeGenerator("steps.c")
    generator.add(step)
    sizes = {"work": step.sz_w(), "integers": step.sz_iw(), "arguments": step.sz_arg(), "results": step.sz_res()}
    least = {name: max(1, size) for name, size in sizes.items()}
    return str(generator.dump()) + ONE_BY_ONE.format(size=step.size1_in(0), diverged=diverged, **least)


def timed(text: str, flags: tuple[str, ...], starts: np.ndarray) -> tuple[float, np.ndarray]:
    """Nanoseconds of a step of one sample, and the vectors at the end."""
    with tempfile.TemporaryDirectory() as folder:
        advance = ctypes.CDLL(str(shared_library(text, Path(folder), compiler(), flags))).advance_samples
    advance.argtypes = [ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong]
    took = []
    for _ in range(3):
        vectors = starts.copy()
        began = process_time()
        assert advance(vectors.ctypes.data, len(vectors), STEPS) == 0
        took.append(process_time() - began)
    return min(took) / (len(starts) * STEPS) * 1e9, vectors


def known_sets() -> dict[str, tuple[str, ...]]:
    """Sets of instructions that this processor has, up to the widest."""
    widest = list(SETS.values()).index(processor_flags(compiler()))
    return dict(list(SETS.items())[: widest + 1])


def beside(law: str, scheme: str) -> None:
    """One line for a loop."""
    fault = qd.load_fault("lab-fault", box="ten-percent")
    problem = campaign_problem(fault, qd.published("lab-fault")[law], scheme=scheme, duration=60.0)
    vector, watched = ca.SX.sym("z", problem.recorder(problem.sample(0)).size), problem.recorder(problem.sample(0))
    step = ca.Function("loop_step", [vector], [watched.advance(vector, problem.method)])
    diverged, starts = watched.index("diverged"), np.array([problem.start(problem.sample(i)) for i in range(2 * LANES)])
    before, _ = timed(one_by_one(step, diverged), (), starts)
    print(f"{law}, {scheme}: one by one {before:.0f} ns a step and sample", end="", flush=True)
    ends = []
    for name, flags in known_sets().items():
        after, vectors = timed(lanes_c(step, diverged), (*LANE_FLAGS, *flags), starts)
        ends.append(vectors.tobytes())
        print(f"; {name} {after:.0f} ns, {before / after:.1f} times", end="", flush=True)
    assert len({*ends}) == 1
    print("; the same digits with all sets")


def hour() -> None:
    """The laboratory loop over an hour, 1000 samples, on two processes."""
    fault = qd.load_fault("lab-fault", box="ten-percent")
    problem: CampaignProblem = campaign_problem(
        fault, qd.published("lab-fault")["cta"], scheme="compensated", duration=3600.0
    )
    with tempfile.TemporaryDirectory() as folder:
        began, before = perf_counter(), sum(os.times()[:4])
        campaign = run_campaign(problem, 1000, Path(folder) / "campaign", workers=2)
        took, spent = (perf_counter() - began) / 60, (sum(os.times()[:4]) - before) / 60
    widest = list(known_sets())[-1]
    print(f"1000 samples of {problem.setting.steps} steps, {widest}: {took:.1f} min, {spent:.1f} min of the processor")
    print(f"{len(campaign.failures)} failed batches")


def main() -> None:
    """Print every comparison."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hour", action="store_true")
    if parser.parse_args().hour:
        hour()
        return
    for law, scheme in LOOPS:
        beside(law, scheme)


if __name__ == "__main__":
    main()
