"""e-LQR from the Riccati equation with a bound on the uncertainty that the plant can meet (ERRATA 6, 7, 9, 10)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from quakedesign.controllers import control_law
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.fault import Fault
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.linear.analysis.printed_theorem import decreases
from quakedesign.synthesis.linear.design.algebraic_riccati import solve_care
from quakedesign.synthesis.linear.design.nondimensional import COST, Choice, ScaledDesign, sound_bound
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, floats, outer, times, total
from quakedesign.synthesis.lyapunov.quadratic import quadratic_terms

BANDWIDTH_TIMES_STEP = 1.5
_STATES = ("x1", "x2", "xi1", "xi2")


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiDesign:
    """u = −Kx with K, S, E in python-control's order, and the weights that gave them.

    Attributes
    ----------
    controller : ExtendedLQR
        K in SI, with exact decimals.
    lyapunov : tuple of Term
        xᵀSx in SI, exact.
    K : ndarray, shape (4,)
        In SI, before it is rounded to decimals.
    Q, S : ndarray, shape (4, 4)
        Nondimensional: time in 1/ω_n, slip in the target slip, p in target·ω_n²/b. Q holds Q0 + R·W.
    R : float
        Nondimensional.
    split : float
        w of W = diag(g1²/w, g2²/(1−w), 0, 0) [-].
    residual : float
        Rigorous relative residual of the Riccati equation that S solves.
    E : ndarray, shape (4,)
        Nominal closed-loop poles [1/s].
    fastest_pole : float
        Largest modulus of a pole over the vertices of the uncertainty [rad/s].
    """

    controller: ExtendedLQR
    lyapunov: tuple[Term, ...]
    K: Any
    Q: Any
    R: float
    S: Any
    E: Any
    split: float
    residual: float
    fastest_pole: float

    @property
    def theta(self) -> Matrix:
        """Matrix (4 × 4) of V in SI, exact."""
        return _matrix(self.lyapunov)


def riccati_design(fault: Fault, *, bandwidth: float | None = None) -> RiccatiDesign:
    """Solve the Riccati equation with Q = Q0 + R·W, so that the guarantee holds over the whole uncertainty.

    W = diag(g1²/w, g2²/(1−w), 0, 0) bounds h² for |h| ≤ g1|x1| + g2|x2| (ERRATA 7), its split w chosen for the smallest
    trace of S. Q0 is 1 for slip, 1/100 for slip rate and 1 for the integrals in nondimensional variables, and R is such
    that the fastest pole meets a bandwidth.

    Parameters
    ----------
    fault : Fault
    bandwidth : float, optional
        Largest modulus of a closed-loop pole over the uncertainty [rad/s]; 1.5/T_s without.

    Returns
    -------
    RiccatiDesign
        With the nearest bandwidth that weights R from 1e-14 to 1 reach, where the wanted one is out of reach.
    """
    problem = LinearProblem.of(fault)
    task = ScaledDesign(problem, problem.scales(fault.reference.target_slip))
    target = BANDWIDTH_TIMES_STEP / fault.sampling_time if bandwidth is None else bandwidth
    return _finished(task, task.weight_for_pole(target))


def _finished(task: ScaledDesign, choice: Choice) -> RiccatiDesign:
    """Design in SI with exact gains and an exact V, from a Riccati equation solved to the end."""
    R, split = choice
    weight = Fraction(R)
    Q = total(COST, times(weight, sound_bound(task.inside.bounds, Fraction(split))))
    unit = (Fraction(0), Fraction(1), Fraction(0), Fraction(0))
    solution = solve_care(task.inside.nominal(), times(1 / weight, outer(unit, unit)), Q)
    inner = [row[1] / weight for row in solution.X]
    gains = task.scales.gains_outside(inner)
    form = task.scales.form_outside(solution.X)
    lyapunov = quadratic_terms(_STATES, lambda i, j: _decimal(form[i][j] * (1 if i == j else 2)))
    exact = _rounded_gains(task.outside, gains, _matrix(lyapunov))
    loop = task.inside.loop((Fraction(1), -task.inside.stiffness, task.inside.damping), inner)
    return RiccatiDesign(
        controller=control_law("elqr").from_values(exact),  # type: ignore[arg-type]
        lyapunov=lyapunov,
        K=floats([gains])[0],
        Q=floats(Q),
        R=R,
        S=floats(solution.X),
        E=np.linalg.eigvals(floats(loop)) / float(task.scales.time),
        split=split,
        residual=float(solution.residual),
        fastest_pole=task.fastest_pole([inner]),
    )


def _rounded_gains(problem: LinearProblem, gains: Sequence[Fraction], theta: Matrix) -> tuple[Fraction, ...]:
    """Gains to ten significant digits, or to as many more as V needs to decrease over the whole box."""
    for digits in (10, 17):
        decimals = tuple(_decimal(g, digits) for g in gains)
        if decreases(problem, decimals, theta):
            return decimals
    return tuple(_decimal(g, 10) for g in gains)


def _matrix(lyapunov: Sequence[Term]) -> Matrix:
    """Matrix (4 × 4) of a quadratic form."""
    rows = [[Fraction(0)] * 4 for _ in range(4)]
    for term in lyapunov:
        places = [_STATES.index(name) for name, *_ in term.factors]
        i, j = places[0], places[-1]
        rows[i][j] = rows[j][i] = term.coefficient if i == j else term.coefficient / 2
    return tuple(tuple(row) for row in rows)


def _decimal(value: Fraction, digits: int = 17) -> Fraction:
    """Value to some significant digits, as a decimal."""
    if not value:
        return value
    unit = Fraction(10) ** (math.floor(math.log10(abs(float(value)))) - digits + 1)
    return round(value / unit) * unit
