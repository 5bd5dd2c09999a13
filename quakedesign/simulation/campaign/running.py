"""Execution of a campaign: dispatch of batches with bounded retries, and resumption."""

import math
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from fractions import Fraction
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.errors import ParameterError, require_whole
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.model import require_count
from quakedesign.files import sole_writer, temporary_folder
from quakedesign.laws import Controller
from quakedesign.loop import Scheme
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.parallel import Crew, crew_of
from quakedesign.simulation.campaign.campaign_result import Campaign, Failure, metric_names, require_metric, severity
from quakedesign.simulation.campaign.ledger import Ledger
from quakedesign.simulation.campaign.problem import (
    CampaignProblem,
    CampaignProgram,
    SampleResult,
    SlidingProblem,
    SteppedProblem,
    sliding_space,
)
from quakedesign.simulation.campaign.space import MOST_SAMPLES, Sample, Space, WorstSample, search
from quakedesign.simulation.closed_loop import Load
from quakedesign.simulation.integrators import DormandPrince, integrator
from quakedesign.simulation.run_settings import STICK_SLIP, RunSetting, designed_path, sampled_scheme
from quakedesign.simulation.slow_sliding import PLANTS
from quakedesign.simulation.state_plant import TIDE
from quakedesign.text import Progress, silent

# ----------------------------------------------------------------------
# Dispatch of batches to workers until each has a result or has failed a bounded number of times.

ATTEMPTS = 3
_MOST_DEATHS = 2 * ATTEMPTS  # after more consecutive deaths than this, the workers are assumed unable to run at all
_DEATH = (
    "a worker died each time that this batch was computed: out of memory, killed, or started by a script without "
    "if __name__ == '__main__':"
)


def dispatch(
    task: Callable[..., Any], batches: Mapping[int, tuple[Any, ...]], crew: Crew, keep: Callable[[int, Any], None]
) -> dict[int, str]:
    """Run all batches, and return the reason of each failure by the key of its batch.

    A worker that dies stops the whole pool, and it is unknown which batch caused the death. All running batches are
    therefore repeated one at a time; a death counts as a failure of a batch only if that batch ran alone.

    Parameters
    ----------
    task : callable
        Computes one batch from its arguments.
    batches : mapping of int to tuple
        Arguments, by key.
    crew : Crew
        Workers.
    keep : callable
        Called with the key and result of each finished batch, in any order.
    """
    return _Dispatch(task, batches, crew, keep).run()


class _Dispatch:
    def __init__(
        self, task: Callable[..., Any], batches: Mapping[int, tuple[Any, ...]], crew: Crew, keep: Callable[..., None]
    ) -> None:
        self._task, self._batches, self._crew, self._keep = task, batches, crew, keep
        self._waiting, self._suspects = deque(batches), deque[int]()
        self._running: dict[Future[Any], int] = {}
        self._failure_counts = Counter[int]()
        self._failed: dict[int, str] = {}
        self._deaths = 0

    def run(self) -> dict[int, str]:
        while self._waiting or self._suspects or self._running:
            dead = self._fill()
            done = () if dead else wait(self._running, return_when=FIRST_COMPLETED).done
            for future in done:
                dead += self._collect(self._running.pop(future), future)
            if dead:
                self._after_deaths([*dead, *self._unfinished()])
        return self._failed

    def _fill(self) -> list[int]:
        """Submit batches until all workers are busy; return the batch that a broken executor rejects, if any."""
        queue, most = (self._suspects, 1) if self._suspects else (self._waiting, self._crew.width)
        while queue and len(self._running) < most:
            key = queue.popleft()
            try:
                self._running[self._crew.submit(self._task, *self._batches[key])] = key
            except BrokenExecutor:
                return [key]
        return []

    def _collect(self, key: int, future: "Future[Any]") -> list[int]:
        """Store a result, or count its error as a failure of the batch; return a batch whose worker died."""
        try:
            result = future.result()
        except BrokenExecutor:
            return [key]
        except (Exception, CancelledError) as error:
            self._count_failure(key, " ".join(f"{type(error).__name__}: {error}".split()), self._waiting)
            return []
        self._deaths = 0
        self._keep(key, result)
        return []

    def _after_deaths(self, dead: list[int]) -> None:
        """Renew the workers and decide which batches are suspected of the death."""
        self._running.clear()
        self._deaths += 1
        if self._deaths > _MOST_DEATHS:
            self._failed |= dict.fromkeys((*dead, *self._suspects, *self._waiting), _DEATH)
            self._suspects.clear()
            self._waiting.clear()
            return
        self._crew.renew()
        if len(dead) == 1:
            self._count_failure(dead[0], _DEATH, self._suspects)
        else:
            self._suspects.extend(dead)

    def _unfinished(self) -> list[int]:
        """Running batches left without a result by the broken workers."""
        done, pending = wait(self._running, timeout=1.0)
        lost = [key for future in done for key in self._collect(self._running[future], future)]
        return lost + [self._running[future] for future in pending]

    def _count_failure(self, key: int, reason: str, queue: "deque[int]") -> None:
        self._failure_counts[key] += 1
        if self._failure_counts[key] < ATTEMPTS:
            queue.append(key)
        else:
            self._failed[key] = reason


# ----------------------------------------------------------------------
# A campaign from beginning to end, or resumed.

LARGEST_BATCH = 1024
BATCHES_PER_WORKER = 8
ROUNDS = 12


def campaign_problem(
    fault: Fault,
    controller: Controller | None = None,
    *,
    scheme: str | Scheme | None = None,
    step: float | None = None,
    method: str = "dormand-prince",
    duration: float | None = None,
    settled_from: float | None = None,
    plant: str | None = None,
    load: Load | None = None,
    initial_slip: float = 0.0,
    initial_slip_rate: float = 0.0,
    spread: float | Fraction = 0,
    stress: float = 0.0,
    stress_period: float = TIDE,
    seed: int = 0,
) -> CampaignProblem:
    """Campaign problem: one closed loop and the ranges of its varied parameters.

    Parameters
    ----------
    fault : Fault
    controller : Controller, optional
        None: the pressure is 0. Friction with a state requires an e-LQR from `design`, under which sliding stays slow.
    scheme, step, method, duration, settled_from, plant, load
        As in `simulate`, but the default scheme is ``"explicit"``; step, duration, settled_from [s].
    initial_slip : float
        Largest initial slip of a sample [m].
    initial_slip_rate : float
        Largest initial slip rate of a sample [m/s].
    spread : float or Fraction
        For friction with a state: largest relative error of a, b and D_c [-]. σ', k and η vary within the fault's box,
        where `authority` is the relative error of σ'.
    stress, stress_period : float
        For friction with a state: largest amplitude [Pa] and period [s] of a sinusoidal stress of varied phase.
    seed : int
        Seed of the Sobol' sequence and of all other random numbers.

    Raises
    ------
    ParameterError
        If a value is out of range, or a scheme or integrator is unknown.
    """
    require_whole(0, seed=seed)
    way, step, own = scheme_of_run(controller, scheme, step)
    entries: dict[str, Any] = {"fault": fault, "controller": controller, "seed": seed}
    entries["setting"] = RunSetting.of(fault, step, duration, 1, settled_from)

    def stepped(fault: Fault) -> CampaignProblem:
        actuator, substeps = designed_path(controller, None) if isinstance(way, str) else (None, 1)
        entries["scheme"] = sampled_scheme(way, substeps, actuator, **own)
        if spread or stress:
            raise ParameterError(
                f"spread and stress apply only to friction with a state. Received {fault.friction.name}. Omit both."
            )
        space = Space.of(fault, initial_slip=initial_slip, initial_slip_rate=initial_slip_rate)
        entries.update(space=space, plant=plant or STICK_SLIP, load=load or Load())
        return SteppedProblem(**entries, method=integrator(method))

    def slid(fault: Fault) -> CampaignProblem:
        entries["scheme"] = sampled_scheme(way, **own)
        if load not in (None, Load()) or initial_slip or initial_slip_rate:
            raise ParameterError(
                "load, initial_slip and initial_slip_rate do not apply to friction with a state. Received one of "
                f"these with {fault.friction.name}. Omit these arguments; use stress for a disturbance."
            )
        space = sliding_space(fault, rational(spread, "spread"))
        solver = "cvodes" if method == DormandPrince.name else method
        entries.update(space=space, plant=plant or next(iter(PLANTS)), stress=stress, stress_period=stress_period)
        return SlidingProblem(**entries, method=solver)

    return by_equilibrium(rest=stepped, sliding=slid)(fault)


def run_campaign(
    problem: CampaignProblem,
    samples: int,
    folder: str | Path,
    *,
    metric: str | None = None,
    rounds: int = ROUNDS,
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    batch: int | None = None,
    renew: bool = False,
    progress: Progress = silent,
) -> Campaign:
    """Run many samples of a closed loop, and store every finished batch in a folder.

    After an interruption at any moment the same call resumes from the files. Its result equals that of an uninterrupted
    call bitwise, for any kind and number of workers. A call with more samples computes only the new ones. Results do
    not depend on the processor, the C compiler or the C library, unless a load contains tan, an inverse function, or a
    hyperbolic function other than tanh.

    Parameters
    ----------
    problem : CampaignProblem
        See `campaign_problem`.
    samples : int
        Number of samples; sample i depends only on i and on the seed.
    folder : str or Path
        New, empty, or that of this campaign. It contains one file for each finished batch.
    metric : str, optional
        Metric whose worst value is searched for, from the worst sample and the corners of the box; no search if None.
    rounds : int
        Number of rounds of this search.
    workers : int, optional
        Number of processes; one per core unless given.
    scheduler : str, optional
        Address of a dask.distributed scheduler to use in place of local processes.
    executor : Executor, optional
        Executor in the sense of `concurrent.futures` to use in place of local processes.
    batch : int, optional
        Number of samples in a batch; by default such that a batch takes at most about half a minute.
    renew : bool
        Delete another campaign in the folder; the same campaign is resumed.
    progress : callable
        Called with the current task and the fraction done [-].

    Returns
    -------
    Campaign

    Raises
    ------
    ParameterError
        If `samples` or `batch` is outside 1 … 2^20, or the metric is unknown.
    OutputError
        If the folder contains other files, or cannot be written.
    SimulationError
        If the folder contains another campaign, or the workers cannot be reached.
    """
    require_count(MOST_SAMPLES, samples=samples, **({} if batch is None else {"batch": batch}))
    if metric is not None:
        require_metric(metric, problem.metrics)
    began = perf_counter()
    place = Path(folder)
    with sole_writer(place, make=True), temporary_folder() as private, crew_of(workers, scheduler, executor) as crew:
        ledger = Ledger.open(place, problem.inputs, renew=renew)
        runner = _Runner(problem, ledger, problem.program.compiled(private), crew, batch, progress)
        chosen = [problem.sample(i) for i in range(samples)]
        results = runner.results(chosen, list(map(str, range(samples))), "samples")
        worst = runner.search(results, metric, rounds) if metric else None
    return Campaign(
        problem=problem,
        results=tuple(results),
        failures=tuple(runner.failures),
        resumed=runner.resumed,
        search=worst,
        seconds=perf_counter() - began,
    )


def _ends(program: CampaignProgram, starts: "np.ndarray", steps: int) -> "np.ndarray":
    return program.ends(starts, steps)


class _Runner:
    """Results of samples, from the ledger or from the crew."""

    def __init__(
        self,
        problem: CampaignProblem,
        ledger: Ledger,
        program: CampaignProgram,
        crew: Crew,
        batch: int | None,
        progress: Progress,
    ) -> None:
        self._problem, self._ledger, self._program, self._crew = problem, ledger, program, crew
        self._sent = crew.shared(program)
        self._batch, self._report_progress = batch, progress
        self._records = ledger.read()
        self._filed, self._used = frozenset(self._records), set[bytes]()
        self.failures = list[Failure]()

    @property
    def resumed(self) -> int:
        """Number of samples whose result was read from the folder."""
        return len(self._used & self._filed)

    def results(self, samples: Sequence[Sample], names: Sequence[str], task: str) -> list[SampleResult | None]:
        """Result of every sample, None where its batch failed; `task` names the progress."""
        starts = self._problem.starts(samples)
        missing = [i for i, start in enumerate(starts) if start.tobytes() not in self._records]
        self._used.update(start.tobytes() for start in starts)
        self._compute([starts[i] for i in missing], [names[i] for i in missing], task, len(starts))
        ends = [self._records.get(start.tobytes()) for start in starts]
        results = iter(self._problem.results([end for end in ends if end is not None]))
        return [None if end is None else next(results) for end in ends]

    def _compute(self, starts: "list[np.ndarray]", names: list[str], task: str, total: int) -> None:
        size = self._batch_size(len(starts))
        batches = {first: np.array(starts[first : first + size]) for first in range(0, len(starts), size)}
        done = total - len(starts)
        self._report_progress(task, done / total)

        def keep(first: int, ends: "np.ndarray") -> None:
            nonlocal done
            self._ledger.add(batches[first], ends)
            self._records |= {start.tobytes(): end for start, end in zip(batches[first], ends, strict=True)}
            done += len(ends)
            self._report_progress(task, done / total)

        steps = self._problem.setting.steps
        tasks = {first: (self._sent, rows, steps) for first, rows in batches.items()}
        for first, reason in sorted(dispatch(_ends, tasks, self._crew, keep).items()):
            self.failures.append(Failure(samples=tuple(names[first : first + size]), reason=reason))

    def _batch_size(self, count: int) -> int:
        if self._batch is not None:
            return self._batch
        width, steps, lanes = self._crew.width, self._problem.setting.steps, self._program.lanes
        preferred = min(LARGEST_BATCH, -(-count // (BATCHES_PER_WORKER * width)), self._program.batch_steps // steps)
        return max(1, min(-(-count // width), max(lanes, preferred // lanes * lanes)))

    def search(self, results: Sequence[SampleResult | None], metric: str, rounds: int) -> WorstSample | None:
        """Worst sample by a metric, searched from the worst result and the corners; None if all failed."""
        completed = [(i, result) for i, result in enumerate(results) if result]
        if not completed:
            return None
        require_metric(metric, metric_names([result for _, result in completed]))
        first = max(completed, key=lambda pair: severity(pair[1], metric))[0]
        counter = 0

        def evaluate(samples: Sequence[Sample]) -> list[float]:
            nonlocal counter
            names = [f"search-{counter + i}" for i in range(len(samples))]
            counter += len(samples)
            evaluated = self.results(samples, names, f"search, {counter} samples")
            return [-math.inf if result is None else severity(result, metric) for result in evaluated]

        start, seed = self._problem.point(first), self._problem.sample(first).noise_seed
        return search(self._problem.space, metric, evaluate, [start], noise_seed=seed, rounds=rounds)
