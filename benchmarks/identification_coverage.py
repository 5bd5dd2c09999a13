"""How often regions of `identify` hold the truth, and how often the sign of a - b is told wrongly.

Run with ``python benchmarks/identification_coverage.py``; 50 minutes of one core. ``--kinds trend 'rate column'``
takes some kinds. The records are those of `tests/identification/synthetic.py`, simulated by SciPy with equations of
their own, each with one trouble of laboratories; the seed of a record is its number. ``--results FILE`` keeps a line
for every record and goes on where it ended. ``--at-truth`` tests noise and regions alone, in 0.5 s a record: one search
begins at the truth, with the trend and the beginning that the record was made with, and no model is chosen.

A region holds the truth if the likelihood of the true parameters, with nuisance parameters at their best, lies within
that of 95 % of all parameters at once. A sign is told wrongly if the test of the sign of a - b passes with the wrong
one, whatever the verdict.
"""

import argparse
import importlib.util
import json
import sys
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from time import process_time
from types import ModuleType
from typing import Any

import numpy as np

from quakedesign.fault import FrictionLaw, friction_law
from quakedesign.identification.experiment import START_STATE, TREND, TREND_IN_TIME
from quakedesign.identification.fitting import Fit, fit, minimised, settled
from quakedesign.identification.identification_result import Identification
from quakedesign.identification.identify import _Choice, _Fitted, identified_as, set_up
from quakedesign.identification.loading import prepared
from quakedesign.identification.two_states import with_two_states


def main() -> None:
    """Print one line a kind."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--records", type=int, default=100, help="of every kind")
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--kinds", nargs="+", default=[*synthetic.TROUBLES, *synthetic.OTHER_TROUBLES])
    parser.add_argument("--results", type=Path, help="file with a line for every record")
    parser.add_argument("--at-truth", action="store_true", help="begin at the truth, and choose no model")
    given = parser.parse_args()
    if given.at_truth:
        for kind in given.kinds:
            seeds = range(given.first, given.first + given.records)
            inside = sum(holds(*begun_at_truth(kind, seed)) for seed in seeds)
            print(f"{kind:40}{given.records:8}{inside:13}", flush=True)
        return
    head = f"{'kind':40}{'records':>8}{'truth inside':>13}{'wrong signs':>12}{'cannot tell':>12}{'trends':>8}"
    print(f"{head}{'s a record':>11}")
    for kind in given.kinds:
        told = [one(kind, seed, given.results) for seed in range(given.first, given.first + given.records)]
        sums = {name: sum(each[name] for each in told) for name in ("inside", "wrong", "open", "trend", "seconds")}
        counts = f"{sums['inside']:13}{sums['wrong']:12}{sums['open']:12}{sums['trend']:8}"
        print(f"{kind:40}{len(told):8}{counts}{sums['seconds'] / len(told):11.1f}", flush=True)


def one(kind: str, seed: int, results: Path | None = None) -> dict[str, Any]:
    """What a record of a kind tells: whether its region holds the truth, whether its sign is wrong, or open."""
    known = results.read_text().splitlines() if results is not None and results.exists() else []
    for line in known:
        if (told := json.loads(line))["kind"] == kind and told["seed"] == seed:
            return dict(told)
    began = process_time()
    found, truth = identified(kind, seed)
    sign = next((check for check in found.assessment.checks if check.name == "sign"), None)
    effects = effects_of(truth)
    facts = {
        "kind": kind,
        "seed": seed,
        "inside": holds(found.fit, truth),
        "wrong": bool(sign is not None and sign.passed and sign.value * effects < 0),
        "open": bool(found.assessment.open),
        "trend": any(c.name in (TREND, TREND_IN_TIME) for c in found.fit.experiment.coordinates),
        "start": any(c.name == START_STATE for c in found.fit.experiment.coordinates),
        "verdict": found.assessment.verdict,
        "seconds": process_time() - began,
    }
    if results is not None:
        with results.open("a") as file:
            file.write(json.dumps(facts) + "\n")
    return facts


def begun_at_truth(kind: str, seed: int) -> tuple[Fit, dict[str, float]]:
    """The best fit of a record near the truth with the noise that its residuals show, and the truth."""
    raw, truth = synthetic.troubled(kind, seed)
    law = _law(kind)
    made = kind.rpartition(", ")[2]
    nuisance = {TREND} if made.startswith("trend") else {START_STATE} if made == "unsteady beginning" else set()
    means, loading = prepared(raw)
    now = _Choice(record=means, raw=raw, loading=loading, stiffness=None, seed=seed)
    for moves in reversed(range(5)):  # at most, until changes of rate are at the times that friction shows
        record = now.record
        setup = set_up(record, law, None, now.loading, nuisance)
        near = setup.experiment.near(truth | {TREND: -1.0 if made == "trend over slip" else synthetic.TRUE_TREND})
        best = fit(
            setup.experiment,
            record.friction[setup.used],
            seed=seed,
            counts=None if record.counts is None else record.counts[setup.used],
            near=near,
            least=1,
            most=0,
        )
        moved = now._moved(_Fitted(kind=law, setup=setup, best=best)) if moves else None
        if moved is None:
            break
        now = moved
    for _ in range(2):
        noise = now._noise(_Fitted(kind=law, setup=setup, best=best))
        best = settled(replace(best, correlated=noise))
    if law.state_names:
        template: Any = setup.experiment.law
        truth["reference_coefficient"] += effects_of(truth) * np.log(template.reference_rate / synthetic.MICRON)
    return best, truth


def _law(kind: str) -> type[FrictionLaw]:
    name = (synthetic.TROUBLES | synthetic.OTHER_TROUBLES)[kind]().law
    return with_two_states(name) if kind == "two states" else friction_law(name)


def identified(kind: str, seed: int) -> tuple[Identification, dict[str, float]]:
    """What is identified from a record of a kind by the law that it was made with, and the truth."""
    record, truth = synthetic.troubled(kind, seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        found = identified_as(record, [_law(kind)], seed=seed)
    if "reference_coefficient" in truth:
        fitted: Any = found.law
        truth["reference_coefficient"] += effects_of(truth) * np.log(fitted.reference_rate / synthetic.MICRON)
    return found, truth


def effects_of(truth: Mapping[str, float]) -> float:
    """The true a - b."""
    return truth.get("direct_effect", 0.0) - truth.get("evolution_effect", 0.0) - truth.get("second_effect", 0.0)


def holds(best: Fit, truth: Mapping[str, float]) -> bool:
    """Whether the joint region of what is known holds the truth, the nuisance parameters at their best."""
    names = [c.name for c in best.experiment.coordinates]
    known = np.array([name in truth for name in names])
    start = best.fitted.copy()
    values = best.experiment.near(truth)
    start[known] = values[known]
    experiment = best.experiment.resolved(start, best.accuracy)
    _, squares = minimised(experiment, best.measured, best.weights, start, fixed=known)
    return bool(best.excess(squares) <= best.threshold(int(known.sum())))


def _synthetic() -> ModuleType:
    """The records, from the tests beside this folder."""
    path = Path(__file__).resolve().parents[1] / "tests" / "identification" / "synthetic.py"
    told = importlib.util.spec_from_file_location("synthetic_records", path)
    assert told is not None
    assert told.loader is not None
    module = importlib.util.module_from_spec(told)
    sys.modules["synthetic_records"] = module
    told.loader.exec_module(module)
    return module


synthetic = _synthetic()

if __name__ == "__main__":
    main()
