"""What can be said about a given K on a fault, as plain values for the command line and for reports."""

from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.fault import Fault
from quakedesign.synthesis.linear.analysis.printed_theorem import both_tests, printed_row
from quakedesign.synthesis.linear.design.admissible_weights import smallest_gain
from quakedesign.synthesis.linear.plant.feedback import compare_feedback
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.uncertainty_bounds import uncertainty_bounds
from quakedesign.synthesis.linear.sampled.held import HeldLoop


def linear_facts(fault: Fault, controller: ExtendedLQR, held: HeldLoop) -> dict[str, Any]:
    """Bounds, both tests of Theorem 2, sampled stability and the cost of both kinds of feedback.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    held : HeldLoop
        What is decided of the same gains when p is held.

    Returns
    -------
    dict
        Keys ``inverse_optimal`` (whether K is optimal for a Q that covers the uncertainty; None when undecided),
        ``tests``, ``bounds``, ``smallest_gain``, ``held`` and ``feedback``; SI.
    """
    gains, problem = tuple(controller.gains.values()), LinearProblem.of(fault)
    tests = both_tests(problem, gains, printed_row(fault))
    least = smallest_gain(problem)
    decided = {Verdict.PROVED: True, Verdict.REFUTED: False, Verdict.UNDECIDED: None}
    return {
        "inverse_optimal": decided[tests.sound.verdict],
        "tests": tests.to_dict(),
        "bounds": uncertainty_bounds(fault).to_dict(),
        "smallest_gain": {"k1": least.slip, "k2": least.rate},
        "held": held.to_dict(),
        "feedback": [
            {"feedback": c.feedback, "lag": c.lag, "largest_term": c.largest_term, "pressure": c.pressure}
            for c in (compare_feedback(fault, gains) if gains[3] else ())
        ],
    }
