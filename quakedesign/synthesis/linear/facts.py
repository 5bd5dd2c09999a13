"""What can be said about a given K on a fault, as plain values for the command line and for reports."""

from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.bounds import uncertainty_bounds
from quakedesign.synthesis.linear.feedback import compare_feedback
from quakedesign.synthesis.linear.hold_lyapunov import varying_verdict
from quakedesign.synthesis.linear.problem import LinearProblem
from quakedesign.synthesis.linear.region import smallest_gain
from quakedesign.synthesis.linear.sampled import hold_verdict, largest_step
from quakedesign.synthesis.linear.theorem import both_tests, printed_row


def linear_facts(fault: Fault, controller: ExtendedLQR, *, step: float | str | None = None) -> dict[str, Any]:
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
        ``tests``, ``bounds``, ``smallest_gain``, ``sampling`` and ``feedback``; SI.
    """
    gains, problem = tuple(controller.gains.values()), LinearProblem.of(fault)
    tests = both_tests(problem, gains, printed_row(fault))
    period = rational(fault.sampling_time if step is None else step, "step")
    held, longest, least = hold_verdict(problem, gains, period), largest_step(problem, gains), smallest_gain(problem)
    decided = {Verdict.PROVED: True, Verdict.REFUTED: False, Verdict.UNDECIDED: None}
    return {
        "inverse_optimal": decided[tests.sound.verdict],
        "tests": tests.to_dict(),
        "bounds": uncertainty_bounds(fault).to_dict(),
        "smallest_gain": {"k1": least.slip, "k2": least.rate},
        "sampling": {
            "constant": held.to_dict(),
            "varying": str(varying_verdict(problem, gains, period).verdict),
            "largest_step": float(longest.proved) if longest else None,
        },
        "feedback": [
            {"feedback": c.feedback, "lag": c.lag, "largest_term": c.largest_term, "pressure": c.pressure}
            for c in (compare_feedback(fault, gains) if gains[3] else ())
        ],
    }
