"""One quadratic V for a whole box, and feedback designed for it: semidefinite programs, exact proofs."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import eigh

from quakedesign.certificates import Certificate, Loop, Verdict, Witness, certificate_text, loop_of, parse_certificate
from quakedesign.certificates.obligations import Obligation, claimed, different
from quakedesign.certificates.sectors import Sectors
from quakedesign.errors import CertificateError, WorkError
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


def sector_loop(controller: Any, sectors: Sectors) -> Loop:
    """Loop of a linear feedback over sectors."""
    return loop_of(
        controller.name,
        controller.loop_field(),
        gains=controller.gains,
        constants={"b": sectors.authority},
        uncertain=sectors.ranges(),
    )
