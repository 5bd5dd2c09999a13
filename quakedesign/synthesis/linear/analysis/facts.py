"""What can be said about a given K on a fault, as plain values for the command line and for reports."""

from collections.abc import Sequence
from fractions import Fraction
from math import isfinite
from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.analysis.printed_theorem import both_tests, printed_row
from quakedesign.synthesis.linear.design.admissible_weights import smallest_gain
from quakedesign.synthesis.linear.plant.feedback import compare_feedback
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.uncertainty_bounds import uncertainty_bounds
from quakedesign.synthesis.linear.sampled.input_delay import varying_verdict
from quakedesign.synthesis.linear.sampled.stability import hold_verdict, largest_step


def linear_facts(
    fault: Fault, controller: ExtendedLQR, *, step: float | str | Fraction | None = None
) -> dict[str, Any]:
    """Bounds, both tests of Theorem 2, sampled stability and the cost of both kinds of feedback.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    step : number or text, optional
        Sampling period [s]; the fault's without.

    Returns
    -------
    dict
        Keys ``inverse_optimal`` (whether K is optimal for a Q that covers the uncertainty; None when undecided),
        ``tests``, ``bounds``, ``smallest_gain``, ``held`` (see `held_facts`) and ``feedback``; SI.
    """
    gains, problem = tuple(controller.gains.values()), LinearProblem.of(fault)
    tests = both_tests(problem, gains, printed_row(fault))
    period = rational(fault.sampling_time if step is None else step, "step")
    least = smallest_gain(problem)
    decided = {Verdict.PROVED: True, Verdict.REFUTED: False, Verdict.UNDECIDED: None}
    return {
        "inverse_optimal": decided[tests.sound.verdict],
        "tests": tests.to_dict(),
        "bounds": uncertainty_bounds(fault).to_dict(),
        "smallest_gain": {"k1": least.slip, "k2": least.rate},
        "held": held_facts(problem, gains, period),
        "feedback": [
            {"feedback": c.feedback, "lag": c.lag, "largest_term": c.largest_term, "pressure": c.pressure}
            for c in (compare_feedback(fault, gains) if gains[3] else ())
        ],
    }


def held_facts(problem: LinearProblem, gains: Sequence[Fraction], step: Fraction) -> dict[str, Any]:
    """What is decided of a K when p is held over a sampling period [s]; SI.

    Returns
    -------
    dict
        ``step``; ``verdict`` for constant parameters anywhere in the box, ``varying`` for any course of them, both with
        integrals of the slip error at all times; ``summed`` for constant parameters and integrals that are sums of
        T_s·(sample), as in an explicit sampled law; the
        spectral ``radius`` of a period (largest over the vertices, measured); ``witness`` (β, s, w) of a refutation;
        ``largest_step`` up to which every period is proved for constant parameters, None when the loop is unstable.
    """
    held, longest = hold_verdict(problem, gains, step), largest_step(problem, gains)
    return {
        "step": float(step),
        "verdict": str(held.verdict),
        "varying": str(varying_verdict(problem, gains, step).verdict),
        "summed": str(hold_verdict(problem, gains, step, integration="euler").verdict),
        "radius": held.radius if isfinite(held.radius) else None,
        "witness": [float(v) for v in held.witness] if held.witness else None,
        "largest_step": float(longest.proved) if longest else None,
    }
