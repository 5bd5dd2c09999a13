"""Linear design problem of one fault with exact matrices, and its loop as a polytope.

Chapters: operations on small rational matrices (Lyapunov and Riccati residuals, Hurwitz test); the plant x2' = s·x1 −
w·x2 + βb·p over its uncertainty, in SI and nondimensional; the e-LQR loop as a polytope.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
from flint import arb, fmpq, fmpq_mat
from scipy.linalg import matrix_balance

from quakedesign.errors import ParameterError
from quakedesign.exact import end_of, fraction_of, rational
from quakedesign.fault import Fault
from quakedesign.lyapunov import Loop
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors, sectors
from quakedesign.sos.exact.polynomial import positive_definite
from quakedesign.symbolic import plant
from quakedesign.symbolic.terms import value

# ----------------------------------------------------------------------
# Small rational matrices: products, inverses, Lyapunov and Riccati residuals, Hurwitz, all exact.

Rows = Sequence[Sequence[Fraction]]
Matrix = tuple[tuple[Fraction, ...], ...]


def floats(matrix: Sequence[Sequence[Fraction | float]] | np.ndarray) -> np.ndarray:
    """Matrix as an array of floats."""
    return np.array([[float(v) for v in row] for row in matrix])


def exact(matrix: Sequence[Sequence[Fraction | float]] | np.ndarray) -> Matrix:
    """Rational matrix with the exact values of floats."""
    return tuple(tuple(Fraction(float(v)) for v in row) for row in matrix)


def rounded(matrix: Sequence[Sequence[Fraction | float]] | np.ndarray, bits: int = 60) -> Matrix:
    """Symmetric rational matrix near a symmetric one: entry (i, j) to `bits` binary digits of √(m_ii m_jj)."""
    n = len(matrix)
    sizes = [max(abs(float(matrix[i][i])), 1e-300) for i in range(n)]
    rows = [[Fraction(0)] * n for _ in range(n)]
    for i in range(n):
        for j in range(i, n):
            unit = Fraction(2) ** (math.floor(math.log2(sizes[i] * sizes[j]) / 2) - bits)
            rows[i][j] = rows[j][i] = round((Fraction(matrix[i][j]) + Fraction(matrix[j][i])) / 2 / unit) * unit
    return tuple(tuple(row) for row in rows)


def transpose(a: Rows) -> Matrix:
    """Aᵀ."""
    return tuple(zip(*a, strict=True))


def matrix_product(*factors: Rows) -> Matrix:
    """Product of matrices of fitting shapes."""
    left: Rows = factors[0]
    for right in factors[1:]:
        columns = transpose(right)
        left = tuple(
            tuple(sum((x * y for x, y in zip(row, c, strict=True)), Fraction(0)) for c in columns) for row in left
        )
    return tuple(tuple(row) for row in left)


def total(*parts: Rows) -> Matrix:
    """Sum of matrices of one shape."""
    return tuple(
        tuple(sum(entries, Fraction(0)) for entries in zip(*rows, strict=True)) for rows in zip(*parts, strict=True)
    )


def times(factor: Fraction | int, a: Rows) -> Matrix:
    """factor·A."""
    return tuple(tuple(factor * v for v in row) for row in a)


def congruent(matrix: Sequence[Sequence[Fraction | float]], units: Sequence[Fraction]) -> Matrix:
    """DMD with D = diag(units): a quadratic form in states divided by their units."""
    return tuple(
        tuple(Fraction(v) * a * b for v, b in zip(row, units, strict=True))
        for a, row in zip(units, matrix, strict=True)
    )


def outer(a: Sequence[Fraction], b: Sequence[Fraction]) -> Matrix:
    """a bᵀ."""
    return tuple(tuple(x * y for y in b) for x in a)


def diagonal(values: Sequence[Fraction]) -> Matrix:
    """Diagonal matrix."""
    return tuple(tuple(v if i == j else Fraction(0) for j in range(len(values))) for i, v in enumerate(values))


def trace_of_product(a: Rows, b: Rows) -> Fraction:
    """Trace of AB for symmetric matrices."""
    return sum((x * y for p, q in zip(a, b, strict=True) for x, y in zip(p, q, strict=True)), Fraction(0))


def lyapunov(a: Rows, p: Rows) -> Matrix:
    """AᵀP + PA."""
    half = matrix_product(p, a)
    return total(half, transpose(half))


def riccati_residual(a: Rows, g: Rows, q: Rows, x: Rows) -> Matrix:
    """Q + AᵀX + XA − XGX."""
    return total(q, lyapunov(a, x), times(-1, matrix_product(x, g, x)))


def frobenius(a: Rows) -> Fraction:
    """Rigorous upper bound on the Frobenius norm, tight to about 1e-15."""
    square = sum((v * v for row in a for v in row), Fraction(0))
    return end_of(arb(fmpq(square.numerator, square.denominator)).sqrt().upper())


def definite(a: Rows) -> bool:
    """Whether a symmetric rational matrix is positive definite, exactly."""
    return positive_definite(a)


def characteristic(a: Rows) -> tuple[Fraction, ...]:
    """Coefficients of det(zI − A), highest power first."""
    polynomial = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in a]).charpoly()
    return tuple(fraction_of(c) for c in reversed(polynomial.coeffs()))


def hurwitz(polynomial: Sequence[Fraction]) -> bool:
    """Whether all roots of a polynomial have negative real parts, exactly (Routh).

    Parameters
    ----------
    polynomial : sequence of Fraction
        Coefficients, highest power first; the leading one is not 0.
    """
    upper, lower = list(polynomial[::2]), list(polynomial[1::2])
    if polynomial[0] < 0:
        upper, lower = [-v for v in upper], [-v for v in lower]
    while lower:
        if lower[0] <= 0:
            return False
        ratio = upper[0] / lower[0]
        reduced = [u - ratio * v for u, v in zip(upper[1:], [*lower[1:], Fraction(0)], strict=False)]
        upper, lower = lower, reduced
    return True


# ----------------------------------------------------------------------
# The linear design problem of one fault, and its nondimensional twin, in exact numbers.

Vertex = tuple[Fraction, Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProblemScales:
    """Units in which a problem is solved."""

    time: Fraction  # [s]
    slip: Fraction  # [m]
    pressure: Fraction  # [Pa]

    @property
    def states(self) -> tuple[Fraction, ...]:
        """Units of x1 [m], x2 [m/s], ξ1 [m s], ξ2 [m s²]."""
        return tuple(self.slip * self.time**n for n in (0, -1, 1, 2))

    def gains_outside(self, gains: Sequence[Fraction | float]) -> tuple[Fraction, ...]:
        """Gains in SI (4) from nondimensional ones."""
        return tuple(Fraction(k) * self.pressure / u for k, u in zip(gains, self.states, strict=True))

    def gains_inside(self, gains: Sequence[Fraction | float]) -> tuple[Fraction, ...]:
        """Nondimensional gains (4) from gains in SI."""
        return tuple(Fraction(k) * u / self.pressure for k, u in zip(gains, self.states, strict=True))

    def form_inside(self, matrix: Sequence[Sequence[Fraction | float]]) -> Matrix:
        """Matrix (4 × 4) of the quadratic form xᵀMx in nondimensional states."""
        return congruent(matrix, self.states)

    def form_outside(self, matrix: Sequence[Sequence[Fraction | float]]) -> Matrix:
        """Matrix (4 × 4) of a nondimensional quadratic form in SI states."""
        return congruent(matrix, [1 / u for u in self.states])


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearProblem:
    """x1' = x2, x2' = s·x1 − w·x2 + β·b·p with s, w, β anywhere in their ranges; ξ1' = x1, ξ2' = ξ1.

    Raises
    ------
    ParameterError
        For an authority b that is not positive, or β below 1 (βb must be at least b, the smallest authority, ERRATA 9).
    """

    stiffness: Fraction  # Nominal k̂ [1/s²]: the nominal plant has s = −k̂
    damping: Fraction  # Nominal η̂ [1/s]
    sectors: Sectors  # Ranges, authority b, and g1, g2 with |h| ≤ g1|x1| + g2|x2| about the nominal plant

    def __post_init__(self) -> None:
        if self.sectors.authority <= 0 or self.sectors.beta[0] < 1:
            raise ParameterError(
                "authority b must be positive and the smallest in the range: beta >= 1. Received "
                f"b = {float(self.sectors.authority):.4g}, beta from {float(self.sectors.beta[0]):.4g}. "
                "Take b = min(mu N) (ERRATA 9)."
            )

    @classmethod
    def of(cls, fault: Fault) -> "LinearProblem":
        """Problem of a fault over its uncertainty box, about any constant reference up to the target slip."""
        values = {symbol: fraction_of(v) for symbol, v in plant.plant_values(fault).items()}
        return cls(stiffness=values[plant.k_hat], damping=values[plant.eta_hat], sectors=sectors(fault))

    @property
    def bounds(self) -> tuple[Fraction, Fraction]:
        """g1 [Pa/m] and g2 [Pa·s/m]."""
        return self.sectors.row_bounds

    def scales(self, slip: Fraction | float | str = 1) -> ProblemScales:
        """Units that make ω_n and the authority 1: time 1/ω_n, a slip [m], pressure slip·ω_n²/b.

        Without a positive stiffness the larger of |η̂| and max √|s| replaces ω_n.
        """
        k, eta = float(self.stiffness), float(self.damping)
        pace = math.sqrt(k) if k > 0 else max(abs(eta), math.sqrt(max(map(abs, map(float, self.sectors.slip)))), 1e-300)
        time, size = rational(f"{1 / pace:.13e}"), rational(slip, "slip")
        return ProblemScales(time=time, slip=size, pressure=size / time**2 / self.sectors.authority)

    def nondimensional(self, scales: ProblemScales) -> "LinearProblem":
        """Return the same problem in other units, exactly."""
        t, old = scales.time, self.sectors
        g1, g2 = old.row_bounds
        authority = old.authority * scales.pressure * t**2 / scales.slip
        return LinearProblem(
            stiffness=self.stiffness * t**2,
            damping=self.damping * t,
            sectors=Sectors(
                authority=authority,
                beta=old.beta,
                slip=(old.slip[0] * t**2, old.slip[1] * t**2),
                rate=(old.rate[0] * t, old.rate[1] * t),
                row_bounds=(g1 * scales.slip / scales.pressure, g2 * scales.slip / t / scales.pressure),
                largest_effective_stress=old.largest_effective_stress / scales.pressure,
            ),
        )

    def vertices(self) -> list[Vertex]:
        """Distinct corners (β, s, w) of the ranges."""
        return self.sectors.vertices()

    def nominal(self) -> Matrix:
        """A0 (4 × 4) of the nominal plant with both integrals."""
        return loop_matrix((Fraction(1), -self.stiffness, self.damping), self.sectors.authority, (Fraction(0),) * 4)

    def loop(self, vertex: Vertex, gains: Sequence[Fraction]) -> Matrix:
        """Matrix (4 × 4) of the loop with p = −Kx at (β, s, w)."""
        return loop_matrix(vertex, self.sectors.authority, gains)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackLoop:
    """The loop of p = −Kx, also about a moving reference: e1' = e2, e2' = s·e1 − w·e2 − βb(k1e1 + k2e2 + ζ) + force.

    ζ' = k3e1 + χ + drift and χ' = k4e1 + drift_rate, where ζ = k3ξ1 + k4ξ2 + p*(r) and χ = k4ξ1, each plus the
    feed-forward of the reference in the law. The substitution removes every large term: the remaining inputs are force
    = φ_e − r″ − w·r′, drift = dp*(r)/dt and, for feedback on the state, drift_rate = k1r″ + k2r‴.
    """

    gains: Sequence[Fraction]  # sequence of 4 Fraction: k1 … k4 in SI
    sectors: Sectors  # b and the ranges of β, s and w, which may change at any time

    def matrix(self, vertex: Vertex) -> Matrix:
        """Matrix (4 × 4) at constant (β, s, w)."""
        return loop_matrix(vertex, self.sectors.authority, self.gains)

    def stable(self, vertex: Vertex) -> bool:
        """Whether the loop is asymptotically stable with constant parameters, exactly (Routh, Hurwitz)."""
        return hurwitz(characteristic(self.matrix(vertex)))

    def unstable_vertex(self) -> Vertex | None:
        """Vertex whose constant loop is not asymptotically stable; None when all are."""
        return next((vertex for vertex in self.sectors.vertices() if not self.stable(vertex)), None)


def loop_matrix(vertex: Vertex, authority: Fraction, gains: Sequence[Fraction]) -> Matrix:
    """Matrix (4 × 4) of x1' = x2, x2' = s·x1 − w·x2 − β·b·Kx, ξ1' = x1, ξ2' = ξ1."""
    beta, s, w = vertex
    feedback = [-beta * authority * k for k in gains]
    zero, one = Fraction(0), Fraction(1)
    return (
        (zero, one, zero, zero),
        (feedback[0] + s, feedback[1] - w, feedback[2], feedback[3]),
        (one, zero, zero, zero),
        (zero, zero, one, zero),
    )


# ----------------------------------------------------------------------
# The e-LQR's loop as a polytope of exact matrices.


@dataclass(frozen=True, slots=True, kw_only=True)
class Polytope:
    """x' = A(t)x with A(t) anywhere in the convex hull of some matrices."""

    states: tuple[str, ...]
    vertices: Mapping[str, Matrix]  # Exact, by the name of the vertex

    def floats(self) -> list[np.ndarray]:
        """Vertices as arrays (n × n)."""
        return list(map(floats, self.vertices.values()))

    def slowest(self) -> float:
        """Largest real part r of an eigenvalue of a vertex [1/s]; no quadratic V has V′ ≤ −2aV with a > −r."""
        return max(float(np.linalg.eigvals(A).real.max()) for A in self.floats())


def polytope_of(loop: Loop) -> Polytope:
    """Polytope of a loop on the reals whose field is linear in the states.

    Raises
    ------
    ParameterError
        For a field that is not linear.
    """
    linear = all(
        len(t.factors) == 1 and t.factors[0][1:] == (Fraction(1), "s") for terms in loop.field.values() for t in terms
    )
    if loop.domain != "reals" or not linear:
        raise ParameterError(f"a polytope needs a linear field. Received the one of {loop.law}.")
    names = tuple(loop.uncertain)
    vertices = {}
    for ends in product(*(sorted(set(loop.uncertain[n])) for n in names)):
        chosen = dict(zip(names, ends, strict=True))
        label = " ".join(f"{n}={v}" for n, v in chosen.items())
        vertices[label] = tuple(_row(loop, state, {**loop.parameters, **chosen}) for state in loop.states)
    return Polytope(states=tuple(loop.states), vertices=vertices)


def _row(loop: Loop, state: str, parameters: Mapping[str, Fraction]) -> tuple[Fraction, ...]:
    entries = dict.fromkeys(loop.states, Fraction(0))
    for term in loop.field[state]:
        entries[term.factors[0][0]] += value(term, parameters)
    return tuple(entries.values())


@dataclass(frozen=True, slots=True)
class ModalScaling:
    """Real coordinates z, x = T·z: the mean of a polytope is block diagonal, the input at most as large as the poles.

    The coordinates do not depend on the units of x; the unit of time is 1/pace.
    """

    transform: np.ndarray  # shape (n, n): T
    inverse: np.ndarray  # shape (n, n)
    poles: np.ndarray  # shape (n,): Moduli of the mean's eigenvalues over `pace` [-]
    pace: float  # Largest modulus [rad/s]

    def matrices(self, polytope: Polytope) -> list[np.ndarray]:
        """Vertices in z and scaled time."""
        return [self.inverse @ A @ self.transform / self.pace for A in polytope.floats()]

    def back(self, form: np.ndarray) -> np.ndarray:
        """Matrix of the quadratic form zᵀFz in x."""
        return np.asarray(self.inverse.T @ form @ self.inverse)


def modal_scaling(polytope: Polytope, entries: Sequence[Sequence[float]]) -> ModalScaling:
    """Modal coordinates of the mean of the vertices, balanced so that the coupling of the modes is minimal.

    Parameters
    ----------
    entries : sequence of sequence of float
        Columns through which the disturbances, or the uncertainty, enter.
    """
    modes, moduli = _modes(np.mean(polytope.floats(), axis=0))
    pace, poles = float(moduli.max()), moduli / moduli.max()
    modes = modes / np.max(np.linalg.norm(np.linalg.solve(modes, np.asarray(entries, dtype=float).T), axis=1))
    inverse = np.linalg.inv(modes)
    coupling = np.max([np.abs(inverse @ A @ modes) for A in polytope.floats()], axis=0) / pace
    roots = np.sqrt(np.maximum(poles, 1e-12))
    _, (factors, _) = matrix_balance(coupling / roots[:, None] / roots[None, :], permute=False, separate=True)
    T = modes * factors
    pushed = np.abs(np.linalg.solve(T, np.asarray(entries, dtype=float).T)) / pace
    T = T * (float((pushed / poles[:, None]).max()) or 1.0)
    return ModalScaling(transform=T, inverse=np.linalg.inv(T), poles=poles, pace=pace)


def _modes(mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Real eigenvectors as columns (real and imaginary part of a pair) and the moduli of their eigenvalues."""
    values, vectors = np.linalg.eig(mean)
    columns, moduli = [], []
    for pole, vector in zip(values, vectors.T, strict=True):
        if pole.imag >= 0:
            columns += [vector.real] if pole.imag == 0 else [vector.real, vector.imag]
            moduli += [abs(pole)] * (1 if pole.imag == 0 else 2)
    return np.array(columns).T, np.array(moduli)


def decreases(
    problem: LinearProblem, gains: Sequence[Fraction], theta: Matrix, *, rate: Fraction = Fraction(0)
) -> bool:
    """Whether V = xᵀΘx is positive and V̇ < −2aV at every vertex, hence over the whole box; exact.

    V̇ is affine in each of β, s and w, so that the vertices suffice, also for time-varying parameters.

    Parameters
    ----------
    theta : matrix (4 × 4)
    rate : Fraction
        a [1/s].
    """
    term = times(-2 * rate, theta)
    return definite(theta) and all(
        definite(total(times(-1, lyapunov(problem.loop(v, gains), theta)), term)) for v in problem.vertices()
    )
