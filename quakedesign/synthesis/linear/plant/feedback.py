"""Feedback of the state as printed against feedback of the error (ERRATA 28, 29): one loop, two ways to a reference.

About a constant reference both are one loop. With s, w the chords of slip and slip rate and β the control coefficient,
a moving reference leaves Δ(z)·e1 = −N(z)·r, Δ(z) = z⁴ + (w + βb k2)z³ + (βb k1 − s)z² + βb k3 z + βb k4 and

    error feedback: N = z²(z² + wz − s),      state feedback: N = z²(z² + (w + βb k2)z + βb k1 − s),

so that the error behind a slow reference is r̈ times −s/(βb k4), or (βb k1 − s)/(βb k4).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.certificates.sectors import rest_pressure
from quakedesign.controllers.elqr import FEEDBACKS
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackComparison:
    """What one kind of feedback costs on the task of a fault.

    Attributes
    ----------
    feedback : str
        ``"error"`` or ``"state"``.
    lag : float
        Largest |e1| [m] behind the reference by its acceleration alone, over the vertices of the box; the curvature of
        p*(r) comes on top of it for both (ERRATA 28).
    largest_term : float
        Largest of the terms of Kx [Pa] at rest at the target slip.
    pressure : float
        Largest |p*| [Pa] that they add up to.
    """

    feedback: str
    lag: float
    largest_term: float
    pressure: float


def compare_feedback(fault: Fault, gains: Sequence[Fraction]) -> tuple[FeedbackComparison, ...]:
    """Both kinds of feedback with one K on the task of a fault.

    Parameters
    ----------
    fault : Fault
    gains : sequence of 4 Fraction
        K in SI, k4 not 0.
    """
    problem, target = LinearProblem.of(fault), rational(fault.reference.target_slip)
    rest = max(abs(float(p)) for p in rest_pressure(fault, (Fraction(0), target), nominal=True, pieces=200))
    bend = largest_reference_acceleration(fault)
    comparisons = []
    for feedback in FEEDBACKS:
        offset = float(gains[0]) * float(target) if feedback == "state" else 0.0
        lag = max(abs(lag_coefficient(problem, gains, vertex, feedback)) for vertex in problem.vertices()) * bend
        comparisons.append(
            FeedbackComparison(
                feedback=feedback,
                lag=lag,
                largest_term=rest + abs(offset),
                pressure=rest,
            )
        )
    return tuple(comparisons)


def lag_coefficient(problem: LinearProblem, gains: Sequence[Fraction], vertex: Vertex, feedback: str) -> float:
    """−e1/r̈ [s²] behind a slow reference at a vertex (β, s, w)."""
    beta, s, _ = vertex
    push = beta * problem.sectors.authority
    stiff = -s + (push * gains[0] if feedback == "state" else 0)
    return float(stiff / (push * gains[3]))


def largest_reference_acceleration(fault: Fault) -> float:
    """Rigorous to rounding: max |r̈| [m/s²] of the reference, from the zeros of its third derivative."""
    stage = sp.Symbol("s", nonnegative=True)
    shape = fault.reference.shape(stage)
    bend, turns = sp.diff(shape, stage, 2), sp.solve(sp.diff(shape, stage, 3), stage)
    ends = [*(root for root in turns if root.is_real and 0 <= root <= 1), sp.Integer(0), sp.Integer(1)]
    peak = max(abs(float(bend.subs(stage, end))) for end in ends)
    return peak * fault.reference.target_slip / fault.reference.operation_time**2
