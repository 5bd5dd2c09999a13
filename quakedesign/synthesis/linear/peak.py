"""Peak bounds of the e-LQR's tracking error: exact statements, decided in rational arithmetic."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.certificates import Verdict
from quakedesign.certificates.claim import require
from quakedesign.rationals import fraction_of
from quakedesign.sos.exact.definiteness import full_matrix, positive_definite
from quakedesign.synthesis.linear.plant.polytope import ERROR_STATES, ErrorLoop

ENTERS = {"force": "e2", "drift": "zeta", "drift_rate": "chi", "force_rate": "force"}
"""State whose rate every input adds to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """V = xᵀPx with V′ + αV ≤ Σ_j borrowed_j·V_j + Σ_i share_i·(u_i/b_i)², all shares together at most α.

    Attributes
    ----------
    shape : tuple of Fraction
        Upper triangle of P, row by row.
    decay : Fraction
        α [1/s].
    shares : mapping of str to Fraction
        One for every input [1/s].
    borrowed : tuple of Fraction
        One for every ellipsoid of the set, zero for this one [1/s].
    """

    shape: tuple[Fraction, ...]
    decay: Fraction
    shares: Mapping[str, Fraction]
    borrowed: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakBound:
    """|output| ≤ bound for ever, from rest, for every measurable course of the inputs and the parameters.

    The set where all V_j ≤ 1 holds the start and is never left: where the largest of them is at least 1 its own
    derivative is not positive, because its shares add to at most α, |u_i| ≤ b_i and no other V_j is larger. On the set
    (output/bound)² ≤ Σ weight_j·V_j ≤ 1. With one ellipsoid this is the classical bound on reachable sets (Boyd, El
    Ghaoui, Feron, Balakrishnan 1994, Linear Matrix Inequalities in System and Control Theory, section 6.1.3).

    Attributes
    ----------
    loop : ErrorLoop
    inputs : mapping of str to Fraction
        Bound of every input: ``force`` [m/s²], ``drift`` [Pa/s], ``drift_rate`` [Pa/s²]; with ``force_rate`` [m/s³]
        the force is a state that stays within its bound and may start anywhere in it.
    output : str
        ``slip_error`` [m], ``slip_rate_error`` [m/s] or ``pressure_offset`` [Pa].
    bound : Fraction
    ellipsoids : tuple of Ellipsoid
        States e1, e2, ζ, χ and, with ``force_rate``, the force.
    weights : tuple of Fraction
        One for every ellipsoid, with sum at most 1.
    """

    loop: ErrorLoop
    inputs: Mapping[str, Fraction]
    output: str
    bound: Fraction
    ellipsoids: tuple[Ellipsoid, ...]
    weights: tuple[Fraction, ...]

    @property
    def held(self) -> bool:
        """Whether the force is a state, with a bounded rate."""
        return "force_rate" in self.inputs

    @property
    def states(self) -> tuple[str, ...]:
        """States of V in order."""
        return (*ERROR_STATES, "force") if self.held else ERROR_STATES

    @property
    def free(self) -> tuple[str, ...]:
        """Inputs that may take any value within their bounds at any time."""
        return tuple(n for n in self.inputs if not (self.held and n == "force"))

    def check(self) -> Verdict:
        """Re-decide the statement from nothing but its parts, in exact arithmetic.

        Raises
        ------
        CertificateError
            When it does not hold.
        """
        require(set(self.inputs) <= set(ENTERS) and bool(self.inputs), f"inputs must be among {', '.join(ENTERS)}.")
        require(not self.held or "force" in self.inputs, "a rate of the force needs a bound of the force.")
        require(self.output in self.loop.outputs(), f"output must be one of {', '.join(self.loop.outputs())}.")
        require(all(v > 0 for v in (self.bound, *self.inputs.values())), "bounds must be positive.")
        require(len(self.weights) == len(self.ellipsoids) > 0, "every ellipsoid needs a weight.")
        require(min(self.weights) >= 0 and sum(self.weights) <= 1, "the weights must add to at most 1.")
        for i in range(len(self.ellipsoids)):
            self._check_ellipsoid(i)
        require(positive_definite(self.output_form()), "the ellipsoids do not bound the output.")
        return Verdict.PROVED

    def _check_ellipsoid(self, i: int) -> None:
        own, size = self.ellipsoids[i], len(self.states)
        require(set(own.shares) == set(self.inputs), "every input needs exactly one share.")
        require(len(own.borrowed) == len(self.ellipsoids) and own.borrowed[i] == 0, "a borrowed share is misplaced.")
        shares = (*own.shares.values(), *own.borrowed)
        require(own.decay > 0 and min(shares) >= 0, "shares must not be negative, the decay must be positive.")
        require(sum(shares) <= own.decay, "the shares add to more than the decay.")
        require(len(own.shape) == size * (size + 1) // 2, f"V must have {size} states.")
        require(self.start_level(i) <= 1, "the start is outside V ≤ 1.")
        for corner in self.loop.corners():
            name = "beta={} s={} w={}".format(*corner)
            require(positive_definite(self.dissipation(i, corner)), f"V′ is not bounded at {name}.")

    def start_level(self, i: int) -> Fraction:
        """Largest V_i at the start: all states zero, but for a force that is a state."""
        return self.ellipsoids[i].shape[-1] * self.inputs["force"] ** 2 if self.held else Fraction(0)

    def output_form(self) -> list[list[Fraction]]:
        """Matrix of bound²·Σ weight_j·V_j − output²."""
        rows = self.weighted(self.weights)
        c = [*self.loop.outputs()[self.output], Fraction(0)]
        return [[self.bound**2 * v - c[i] * c[j] for j, v in enumerate(row)] for i, row in enumerate(rows)]

    def dissipation(self, i: int, corner: tuple[Fraction, Fraction, Fraction]) -> list[list[Fraction]]:
        """Matrix of Σ borrowed_j·V_j + Σ share·(u/b)² − V_i′ − α_i·V_i, a form in the states, then the free inputs."""
        own, free, size = self.ellipsoids[i], self.free, len(self.states)
        P, A, lent = full_matrix(own.shape, size), self.system(corner), self.weighted(own.borrowed)
        form = [[Fraction(0)] * (size + len(free)) for _ in range(size + len(free))]
        for m in range(size):
            for n in range(size):
                rate = sum((P[m][k] * A[k][n] + P[n][k] * A[k][m] for k in range(size)), Fraction(0))
                form[m][n] = lent[m][n] - rate - own.decay * P[m][n]
        if self.held:
            form[size - 1][size - 1] += own.shares["force"] / self.inputs["force"] ** 2
        for n, name in enumerate(free, start=size):
            entry = self.states.index(ENTERS[name])
            form[n][n] = own.shares[name] / self.inputs[name] ** 2
            for m in range(size):
                form[m][n] = form[n][m] = -P[m][entry]
        return form

    def system(self, corner: tuple[Fraction, Fraction, Fraction]) -> list[list[Fraction]]:
        """Matrix of the states of V at a vertex."""
        rows = [list(row) for row in self.loop.matrix(*corner)]
        if not self.held:
            return rows
        for state, row in zip(ERROR_STATES, rows, strict=True):
            row.append(Fraction(int(state == ENTERS["force"])))
        return [*rows, [Fraction(0)] * 5]

    def weighted(self, factors: Sequence[Fraction]) -> list[list[Fraction]]:
        """Matrix of Σ factor_j·V_j."""
        size = len(self.states)
        total = [[Fraction(0)] * size for _ in range(size)]
        for factor, ellipsoid in zip(factors, self.ellipsoids, strict=True):
            for m, row in enumerate(full_matrix(ellipsoid.shape, size) if factor else ()):
                total[m] = [a + factor * v for a, v in zip(total[m], row, strict=True)]
        return total


def tightest_bound(rows: Sequence[Sequence[Fraction]], output: Sequence[Fraction], digits: int = 6) -> Fraction:
    """Short rational just above √(cP⁻¹cᵀ), the largest c·x where xᵀPx ≤ 1, for rows of P."""
    from flint import fmpq, fmpq_mat

    P = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows])
    column = fmpq_mat([[fmpq(v.numerator, v.denominator)] for v in output])
    square = (column.transpose() * P.solve(column))[0, 0]
    value = fraction_of(square)
    unit = Fraction(10) ** (math.floor(math.log10(float(value)) / 2) - digits)
    return (math.isqrt(math.floor(value / unit**2)) + 2) * unit
