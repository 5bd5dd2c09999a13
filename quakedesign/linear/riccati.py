"""Riccati designs of the e-LQR with a sound bound on the uncertainty.

The solution is proposed by python-control and refined with exact residuals. Chapters: Riccati equation; nondimensional
design; design with Q = Q0 + R·W for the whole uncertainty box (ERRATA 6, 7, 9, 10); infimum of the guaranteed gain.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import brentq, minimize_scalar

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.laws import control_law
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.linear import linear_problem
from quakedesign.linear.linear_problem import (
    LinearProblem,
    Matrix,
    ProblemScales,
    decreases,
    diagonal,
    exact,
    floats,
    frobenius,
    matrix_product,
    outer,
    riccati_residual,
    rounded,
    times,
    total,
)
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors
from quakedesign.lyapunov.search.lyapunov_search import quadratic_terms
from quakedesign.symbolic.terms import Term

# ----------------------------------------------------------------------
# Continuous algebraic Riccati equations: proposed by python-control, refined with exact residuals.

Entries = Sequence[Sequence[Fraction | float]] | np.ndarray
METHOD = "scipy"
_STEPS = 12
_ENOUGH = Fraction(1, 10**30)


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiSolution:
    """X of Q + AᵀX + XA − XGX = 0 in rationals, with the residual of the equation."""

    X: Matrix  # Symmetric, n × n
    # Rigorous bound on ‖Q + AᵀX + XA − XGX‖ relative to ‖Q‖ + 2‖AᵀX‖ + ‖XGX‖, Frobenius norms, in the scaled states in
    # which X has a unit diagonal
    residual: Fraction


def solve_care(a: Entries, g: Entries, q: Entries) -> RiccatiSolution:
    """Stabilising solution of Q + AᵀX + XA − XGX = 0.

    python-control's `care` (method "scipy") proposes X, first in the given states, then in states scaled by powers of
    two to a unit diagonal of X. Newton steps (Kleinman 1968, IEEE Trans. Autom. Control 13, 114), with the closed loop
    of the proposal and with residuals in rational arithmetic, then remove the rounding error.

    Parameters
    ----------
    a, g, q : matrix (n × n) of Fraction or float
        Entries are taken exactly; G = BR⁻¹Bᵀ.

    Raises
    ------
    ParameterError
        When no stabilising solution is found.
    """
    A, G, Q = (_rational(m) for m in (a, g, q))
    units = tuple(Fraction(1) for _ in A)
    for _ in range(3):
        proposal = _propose(*_scaled(A, G, Q, units))
        sizes = [max(float(proposal[i, i]), 1e-300) for i in range(len(A))]
        change = [Fraction(2) ** round(-math.log2(s) / 2) for s in sizes]
        units = tuple(u * c for u, c in zip(units, change, strict=True))
    scaled = _scaled(A, G, Q, units)
    X, residual = _refined(*scaled, _propose(*scaled))
    back = tuple(tuple(v / u / w for v, w in zip(row, units, strict=True)) for u, row in zip(units, X, strict=True))
    return RiccatiSolution(X=back, residual=residual)


def _rational(matrix: Entries) -> Matrix:
    return tuple(tuple(v if isinstance(v, Fraction) else Fraction(float(v)) for v in row) for row in matrix)


def _scaled(a: Matrix, g: Matrix, q: Matrix, units: Sequence[Fraction]) -> tuple[Matrix, Matrix, Matrix]:
    """Data in states y with x = diag(units)·y."""

    def change(m: Matrix, left: int, right: int) -> Matrix:
        return tuple(
            tuple(v * u**left * w**right for v, w in zip(row, units, strict=True))
            for u, row in zip(units, m, strict=True)
        )

    return change(a, -1, 1), change(g, -1, -1), change(q, 1, 1)


def _propose(a: Matrix, g: Matrix, q: Matrix) -> np.ndarray:
    """Floating-point X from python-control, with B and R from the eigenvalue decomposition of G = BR⁻¹Bᵀ."""
    import control

    A, G, Q = map(floats, (a, g, q))
    values, vectors = np.linalg.eigh(G)
    significant = np.abs(values) > 1e-15 * np.abs(values).max()
    try:
        solution = control.care(A, vectors[:, significant], Q, np.diag(1 / values[significant]), method=METHOD)[0]
    except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
        raise ParameterError(
            "the Riccati equation must have a stabilising solution. Received one for which none was found "
            f"({error}). Give a stabilisable pair, and a Q that sees every mode on the imaginary axis."
        ) from None
    return np.asarray(solution)


def _refined(a: Matrix, g: Matrix, q: Matrix, proposal: np.ndarray) -> tuple[Matrix, Fraction]:
    """Newton steps, Lyapunov equations in floating point, residuals exact; the best X and its relative residual."""
    best = rounded(proposal, 100)
    least = relative_residual(a, g, q, best)
    closed = floats(linear_problem.total(a, times(-1, matrix_product(g, best))))
    for _ in range(_STEPS):
        if least < _ENOUGH:
            break
        left = floats(riccati_residual(a, g, q, best))
        step = solve_continuous_lyapunov(closed.T, -(left + left.T) / 2)
        tried = rounded(linear_problem.total(best, exact((step + step.T) / 2)), 150)
        residual = relative_residual(a, g, q, tried)
        if residual >= least:
            break
        best, least = tried, residual
    return best, least


def relative_residual(a: Matrix, g: Matrix, q: Matrix, x: Matrix) -> Fraction:
    """Rigorous bound on ‖Q + AᵀX + XA − XGX‖/(‖Q‖ + 2‖AᵀX‖ + ‖XGX‖) in Frobenius norms, rational."""
    parts = (
        frobenius(q)
        + 2 * frobenius(matrix_product(linear_problem.transpose(a), x))
        + frobenius(matrix_product(x, g, x))
    )
    low = parts * Fraction(999_999, 1_000_000)  # from below: the norms are above the exact ones by far less
    return frobenius(riccati_residual(a, g, q, x)) / low if low else Fraction(0)


# ----------------------------------------------------------------------
# The Riccati design in nondimensional variables: cost, split of W, and the weight that meets a bandwidth.

LIGHTEST = -14.0  # decimal logarithm of the smallest weight R; `_HEAVIEST`: of the largest
_HEAVIEST, _ROUNDS = 0.0, 5
COST = diagonal((Fraction(1), Fraction(1, 100), Fraction(1), Fraction(1)))
"""Q0 on x1, x2, ξ1, ξ2."""
Choice = tuple[float, float]
"""R, and the split w of W = diag(g1²/w, g2²/(1−w), 0, 0)."""


class ScaledDesign:
    """Design in nondimensional variables, converted to SI at the end.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    """

    def __init__(self, problem: LinearProblem, scales: ProblemScales) -> None:
        self.outside, self.scales = problem, scales
        self.inside = problem.nondimensional(scales)
        self.A, self.Q0 = (floats(m) for m in (self.inside.nominal(), COST))
        self.B = np.array([[0.0], [1.0], [0.0], [0.0]])
        self.g = tuple(float(g) for g in self.inside.bounds)

    def bound(self, split: float | Fraction) -> np.ndarray:
        """W with h² ≤ xᵀWx."""
        return floats(sound_bound(self.inside.bounds, Fraction(split)))

    def solve(self, R: float, split: float | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """K, S, E and the split of W for a weight R; the best split unless one is given.

        Raises
        ------
        ParameterError
            When the time scales of the plant lie too far apart.
        """
        import control

        used = self.best_split(R) if split is None else split
        try:
            solution = control.lqr(self.A, self.B, self.Q0 + R * self.bound(used), [[R]], method=METHOD)
        except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
            ranges = self.inside.sectors
            raise ParameterError(
                "the Riccati equation of the fault must be solvable in floating point. Received one that is not "
                f"({error}), with damping {float(max(map(abs, ranges.rate))):.2g} and softening "
                f"{float(max(map(abs, ranges.slip))):.2g} in units of the natural frequency and its square. Check the "
                "units of the damping, the shear modulus and the lengths."
            ) from None
        return (*solution, used)

    def best_split(self, R: float) -> float:
        """Split of W with the smallest trace of S, to six digits; 1/2 where one of the bounds is 0."""
        if min(self.g) == 0:
            return 0.5
        best = minimize_scalar(
            lambda w: self.solve(R, w)[1].trace(), bounds=(0.01, 0.99), method="bounded", options={"xatol": 1e-4}
        )
        return round(float(best.x), 6)

    def gains(self, K: Entries) -> list[float]:
        """K in SI."""
        return [float(k) for k in self.scales.gains_outside([Fraction(float(v)) for v in K[0]])]

    def fastest_pole(self, K: Entries) -> float:
        """Largest modulus of a pole over the vertices of the uncertainty [rad/s]."""
        return max(abs(pole) for pole in vertex_poles(self.outside.sectors, self.gains(K)))

    def weight_for_pole(self, target: float) -> Choice:
        """R for a modulus of the fastest pole [rad/s], or the nearest R from 1e-14 to 1; and the split.

        The split of W is iterated in a few rounds.
        """
        split, root = 0.5, _HEAVIEST
        for _ in range(_ROUNDS):

            def excess(log_weight: float, split: float = split) -> float:
                return math.log(self.fastest_pole(self.solve(10.0**log_weight, split)[0]) / target)

            root = _root(excess, LIGHTEST, _HEAVIEST)
            best = self.best_split(10.0**root)
            if abs(best - split) < 1e-5:
                break
            split = best
        return 10.0**root, split


def sound_bound(bounds: Sequence[Fraction], split: Fraction) -> Matrix:
    """W = diag(g1²/w, g2²/(1−w), 0, 0) with h² ≤ xᵀWx wherever |h| ≤ g1|x1| + g2|x2| (ERRATA 7)."""
    g1, g2 = bounds
    first, second = (g1**2 / split, g2**2 / (1 - split)) if g1 and g2 else (g1**2, g2**2)
    return diagonal((first, second, Fraction(0), Fraction(0)))


def vertex_poles(needed: Sectors, gains: Sequence[float | Fraction]) -> list[complex]:
    """Closed-loop poles [1/s] at all vertices of the uncertainty, for gains in SI."""
    b, poles = float(needed.authority), list[complex]()
    for beta, s, w in product(needed.beta, needed.slip, needed.rate):
        feedback = [-float(beta) * b * float(k) for k in gains]
        row = [feedback[0] + float(s), feedback[1] - float(w), *feedback[2:]]
        poles += [complex(z) for z in np.linalg.eigvals(np.array([[0, 1, 0, 0], row, [1, 0, 0, 0], [0, 0, 1, 0]]))]
    return poles


def _root(excess: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a decreasing function, or the end nearest to a zero."""
    if excess(low) <= 0:
        return low
    if excess(high) >= 0:
        return high
    return float(brentq(excess, low, high, xtol=1e-6))


# ----------------------------------------------------------------------
# e-LQR from the Riccati equation with a bound that the plant's uncertainty satisfies (ERRATA 6, 7, 9, 10).

BANDWIDTH_TIMES_STEP = 1.5
_STATES = ("x1", "x2", "xi1", "xi2")


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiDesign:
    """u = −Kx with K, S and E as `control.lqr` names them, and the weights of the design.

    Attributes
    ----------
    controller : ExtendedLQR
        K in SI, with exact decimals.
    lyapunov : tuple of Term
        xᵀSx in SI, exact.
    K : ndarray, shape (4,)
        In SI, before it is rounded to decimals.
    Q, S : ndarray, shape (4, 4)
        Nondimensional: time in 1/ω_n, slip in the target slip, p in target·ω_n²/b. Q is Q0 + R·W.
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
    K: np.ndarray
    Q: np.ndarray
    R: float
    S: np.ndarray
    E: np.ndarray
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
    bandwidth : float, optional
        Largest modulus of a closed-loop pole over the uncertainty [rad/s]; by default 1.5/T_s.

    Returns
    -------
    RiccatiDesign
        With the nearest bandwidth for weights R from 1e-14 to 1 if the specified one is infeasible.
    """
    problem = LinearProblem.of(fault)
    task = ScaledDesign(problem, problem.scales(fault.reference.target_slip))
    target = BANDWIDTH_TIMES_STEP / fault.sampling_time if bandwidth is None else bandwidth
    return _finished(task, task.weight_for_pole(target))


def _finished(task: ScaledDesign, choice: Choice) -> RiccatiDesign:
    """Design in SI with exact gains and an exact V, from a refined solution of the Riccati equation."""
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
    """Gains to ten significant digits, or to 17 if only then V decreases over the whole box."""
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


# ----------------------------------------------------------------------
# The smallest gain of all Riccati designs with a guarantee over the uncertainty.


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestGain:
    """Infimum of √(k1² + (ω_n·k2)²) over all Q0 > 0 and R > 0 for which the Riccati design has a guarantee.

    It is the limit for Q0/R → 0, where k3, k4 → 0.
    """

    # slip, rate: k1 [Pa/m] and k2 [Pa·s/m] with the smallest k1² + (ω_n·k2)²
    slip: float
    rate: float
    split: float  # w of W = diag(g1²/w, g2²/(1−w), 0, 0) for these gains [-]


def limiting_gains(problem: LinearProblem, split: float) -> tuple[float, float]:
    """k1 [Pa/m] and k2 [Pa·s/m] as Q0/R → 0: the Riccati equation of the plant alone with Q = R·W, in closed form.

    b·k1 = −k̂ + √(k̂² + b²w1), b·k2 = −η̂ + √(η̂² + b²w2 + 2b·k1), w1 and w2 the entries of W.
    """
    k, eta, b = float(problem.stiffness), float(problem.damping), float(problem.sectors.authority)
    W = sound_bound(problem.bounds, Fraction(split))
    first = -k + math.sqrt(k**2 + b**2 * float(W[0][0]))
    second = -eta + math.sqrt(eta**2 + b**2 * float(W[1][1]) + 2 * first)
    return first / b, second / b


def smallest_gain(problem: LinearProblem) -> SmallestGain:
    """Infimum of the gain over the guaranteed set.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    """
    g1, g2 = problem.bounds
    pace = math.sqrt(abs(float(problem.stiffness))) or 1.0

    def size(split: float) -> float:
        k1, k2 = limiting_gains(problem, split)
        return math.hypot(k1, pace * k2)

    split = 0.5
    if g1 and g2:
        split = float(minimize_scalar(size, bounds=(1e-6, 1 - 1e-6), method="bounded", options={"xatol": 1e-9}).x)
    k1, k2 = limiting_gains(problem, split)
    return SmallestGain(slip=k1, rate=k2, split=split)
