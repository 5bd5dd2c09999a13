"""One quadratic V for a whole box, and feedback designed for it: semidefinite programs, exact proofs."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import eigh

from quakedesign.certificates import Certificate, Loop, Verdict, Witness, certificate_text, loop_of, parse_certificate
from quakedesign.certificates.obligations import Obligation, claimed, different
from quakedesign.certificates.sectors import Sectors
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.errors import CertificateError, ParameterError, WorkError
from quakedesign.rationals import rational
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.proofs import Square
from quakedesign.sos.solve.conic import solve
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.linear.plant.polytope import Polytope, modal_scaling, polytope_of
from quakedesign.synthesis.lyapunov.balancing import below
from quakedesign.synthesis.lyapunov.certify_exactly import finish
from quakedesign.synthesis.lyapunov.quadratic import quadratic_margin, quadratic_terms

_SHARES = (0.99, 0.9, 0.5, 0.1, 0.01)
_LEAST_MARGIN = 1e-10
_DECADES, _GOOD = 13, 0.85


@dataclass(frozen=True, slots=True)
class Proposal:
    """Floating-point V = xᵀPx for a polytope; proves nothing.

    Attributes
    ----------
    form : ndarray, shape (n, n)
        P.
    rate : float
        Largest a with V′ ≤ −2aV at every vertex [1/s].
    """

    form: Any
    rate: float


class CommonQuadratic:
    """Search for one V for all vertices of a polytope, in modal coordinates; modelled once for every decay rate.

    Parameters
    ----------
    polytope : Polytope
    """

    def __init__(self, polytope: Polytope) -> None:
        import cvxpy as cp

        self.polytope, size = polytope, len(polytope.states)
        matrices = polytope.floats()
        varying = np.ptp(matrices, axis=0).max(axis=1) > 0
        self.scaling = modal_scaling(polytope, list(np.eye(size)[varying] if varying.any() else np.eye(size)))
        self.systems = self.scaling.matrices(polytope)
        self._form, margin = cp.Variable((size, size), symmetric=True), cp.Variable()
        self._rate, pace = cp.Parameter(nonneg=True), np.diag(self.scaling.poles)
        bounds = [self._form >> margin * np.eye(size), self._form << np.eye(size)]
        for A in self.systems:
            bounds.append(-(A.T @ self._form + self._form @ A) - 2 * self._rate * self._form - margin * pace >> 0)
        self._margin, self._problem = margin, cp.Problem(cp.Maximize(margin), bounds)

    def __call__(self, rate: float = 0.0) -> Proposal | None:
        """V that decreases at least at a rate [1/s] everywhere, with the largest margin; None if none is found."""
        self._rate.value = rate / self.scaling.pace
        if not solve(self._problem) or self._margin.value is None or not self._margin.value > _LEAST_MARGIN:
            return None
        form = np.asarray(self._form.value, dtype=float)
        form = (form + form.T) / 2
        return Proposal(form=self.scaling.back(form), rate=self._decay(form) * self.scaling.pace)

    def _decay(self, form: Any) -> float:
        return min(float(eigh(-(A.T @ form + form @ A), 2 * form, eigvals_only=True)[0]) for A in self.systems)

    def fastest(self, tolerance: float = 1e-3) -> Proposal | None:
        """V with the largest decay rate, by bisection up to the slowest pole of a vertex."""
        best = self()
        if best is None:
            return None
        low, high = max(best.rate, 0.0), -self.polytope.slowest()
        while high - low > tolerance * high:
            middle = (low + high) / 2
            proposal = self(middle)
            if proposal is None:
                high = middle
            else:
                best, low = proposal, max(middle, min(proposal.rate, high))
        return best


def robust_stability(loop: Loop, *, fastest: bool = False) -> Certificate | None:
    """Certificate of exponential stability for all measurable parameters of a loop, or None.

    Parameters
    ----------
    loop : Loop
        Linear, on the reals.
    fastest : bool
        Whether to look for the V with the largest decay rate instead of the one with the largest margin.
    """
    polytope = polytope_of(loop)
    if polytope.slowest() >= 0:
        return None
    search = CommonQuadratic(polytope)
    proposal = search.fastest() if fastest else search()
    if proposal is None:
        return None
    certificate = finished(loop, proposal)
    if fastest and (certificate is None or float(certificate.claims["rate"]) < -_GOOD * polytope.slowest()):
        other = search()  # where the fastest V is hard to find or to round, the roundest may do better
        rounder = finished(loop, other) if other is not None else None
        certificate = max(filter(None, (certificate, rounder)), key=lambda c: c.claims["rate"], default=None)
    return certificate


def finished(loop: Loop, proposal: Proposal) -> Certificate | None:
    """Certificate for a proposed V, in exact arithmetic, with the largest share of its decay rate that holds."""
    lyapunov = _decimal_terms(tuple(loop.states), proposal.form)
    positive = quadratic_margin(loop, lyapunov) / 2
    for share in _SHARES:
        claims = {"positive": positive, "rate": below(share * proposal.rate)}
        certificate = finish(loop, lyapunov, claims) if min(claims.values()) > 0 else None
        if certificate is not None:
            return certificate
    return None


def finished_exactly(loop: Loop, theta: Sequence[Sequence[Fraction]]) -> Certificate | None:
    """Certificate for V = xᵀΘx with the largest decay rate a·10⁻ⁿ, a the slowest pole, that exact forms allow, or None.

    For a V so far from round that floating point cannot tell whether it decreases: witnesses are read off.
    """
    lyapunov = quadratic_terms(tuple(loop.states), lambda i, j: theta[i][j] * (1 if i == j else 2))
    slowest, positive = -polytope_of(loop).slowest(), quadratic_margin(loop, lyapunov) / 2
    for n in range(_DECADES) if slowest > 0 and positive > 0 else ():
        claims = {"positive": positive, "rate": below(slowest / 10**n)}
        witnesses = {one.name: quadratic_witness(one) for one in different(claimed(loop, lyapunov, claims))}
        try:
            certificate = Certificate(loop=loop, lyapunov=lyapunov, claims=claims, witnesses=witnesses)
            if (
                certificate.check() is Verdict.PROVED
                and parse_certificate(certificate_text(certificate)) == certificate
            ):
                return certificate
        except (CertificateError, WorkError):
            continue
    return None


def quadratic_witness(one: Obligation) -> Witness:
    """The only Gram matrix of a quadratic form, on all its variables."""
    size = len(next(iter(one.polynomial)))
    basis = tuple(tuple(int(i == j) for j in range(size)) for i in range(size))

    def entry(i: int, j: int) -> Fraction:
        value = one.polynomial.get(tuple(a + b for a, b in zip(basis[i], basis[j], strict=True)), Fraction(0))
        return value if i == j else value / 2

    gram = tuple(entry(i, j) for i in range(size) for j in range(i, size))
    return Witness(multiplier=constant(size), squares=(Square(basis=basis, gram=gram),))


def _decimal_terms(states: Sequence[str], form: Any) -> tuple[Term, ...]:
    """xᵀPx over its largest entry, every float of it read as the decimal that Python prints for it."""
    size = float(abs(form).max())
    both = form + form.T - np.diag(np.diag(form))
    return quadratic_terms(states, lambda i, j: rational(float(both[i, j] / size)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MatrixDesign:
    """Gains from a matrix inequality, with the exact proof of their decay rate over the box.

    Attributes
    ----------
    controller : ExtendedLQR
    certificate : Certificate
        Its claim ``rate`` is at least the rate asked for.
    gain_use : float
        √Σ(k_i/limit_i)² [-]; below 1.
    """

    controller: ExtendedLQR
    certificate: Certificate
    gain_use: float


def synthesise(sectors: Sectors, *, rate: Fraction, largest_gains: Sequence[Fraction]) -> MatrixDesign | None:
    """Smallest gains that make the loop decay at a rate over the whole box, within bounds on the gains.

    With Q = P⁻¹ ⪰ diag(1/limit_i²) and Y = KQ the inequality AQ + QAᵀ − βB(Y) + … + 2aQ ≺ 0 is linear at every vertex,
    and KQKᵀ ≤ t gives Σ(k_i/limit_i)² ≤ t (Bernussou, Peres, Geromel 1989, Systems & Control Letters 13). Sufficient,
    not necessary: another V might allow smaller gains.

    Parameters
    ----------
    sectors : Sectors
    rate : Fraction
        Decay rate a [1/s], positive.
    largest_gains : sequence of 4 Fraction
        Limits of |k1| … |k4| in SI, positive.

    Returns
    -------
    MatrixDesign or None
        None when no gains within the limits are found.

    Raises
    ------
    ParameterError
        For a rate or limits that are not positive.
    """
    limits = tuple(rational(v, "limit of a gain") for v in largest_gains)
    if rate <= 0 or len(limits) != 4 or min(limits) <= 0:
        raise ParameterError(f"rate and four limits of gains must be positive. Received {rate}, {limits}.")
    for headroom in (1.02, 1.1, 1.3):
        gains, use = _feedback(sectors, float(rate) * headroom, [float(v) for v in limits])
        if gains is None:
            return None
        exact = tuple(Fraction(f"{g:.9e}") for g in gains)
        if any(abs(g) > limit for g, limit in zip(exact, limits, strict=True)):
            continue
        controller = ExtendedLQR.from_values(exact, feedback="error")
        certificate = robust_stability(sector_loop(controller, sectors), fastest=True)
        if certificate is not None and certificate.claims["rate"] >= rate:
            return MatrixDesign(controller=controller, certificate=certificate, gain_use=use)
    return None


def sector_loop(controller: Any, sectors: Sectors) -> Loop:
    """Loop of a linear feedback over sectors."""
    return loop_of(
        controller.name,
        controller.loop_field(),
        gains=controller.gains,
        constants={"b": sectors.authority},
        uncertain=sectors.ranges(),
    )


def _feedback(sectors: Sectors, rate: float, limits: Sequence[float]) -> tuple[list[float] | None, float]:
    """Gains of the program in the limits' own units: x_i counted in 1/limit_i, time in 1/pace, p in its own."""
    import cvxpy as cp

    units = 1 / np.array(limits)
    chain = np.zeros((4, 4))
    chain[0, 1] = chain[2, 0] = chain[3, 2] = 1
    pace = limits[2] / limits[0] + limits[3] / limits[2]
    B = np.zeros((4, 1))
    B[1, 0] = float(sectors.authority) / units[1] / pace
    Q, Y, cost = cp.Variable((4, 4), symmetric=True), cp.Variable((1, 4)), cp.Variable((1, 1))
    bounds = [Q >> np.eye(4), cp.bmat([[cost, Y], [Y.T, Q]]) >> 0, cost <= 1]
    for beta, s, w in product(*(sorted(set(r)) for r in (sectors.beta, sectors.slip, sectors.rate))):
        A = chain.copy()
        A[1, :2] = float(s), -float(w)
        A = A * units / units[:, None] / pace
        flow = A @ Q - float(beta) * B @ Y
        bounds.append(flow + flow.T + 2 * rate / pace * Q << 0)
    if not solve(cp.Problem(cp.Minimize(cost[0, 0]), bounds)) or Y.value is None or Q.value is None:
        return None, 0.0
    scaled = np.linalg.solve(np.asarray(Q.value), np.asarray(Y.value)[0])
    return [float(k / u) for k, u in zip(scaled, units, strict=True)], float(np.linalg.norm(scaled))
