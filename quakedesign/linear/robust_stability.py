"""Robust stability of a gain K over the uncertainty box by a common quadratic V.

V is proposed by a semidefinite programme and proved exactly. The analysis reports certified margins of friction slope,
range of β and decay rate, each with its limit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import eigh

from quakedesign.errors import CertificateError, WorkError
from quakedesign.exact import LowerBound, UpperBound, fraction_of, nearest, rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.linear.frequency import FrequencyFacts, circle_limit, frequency_properties, slip_limit
from quakedesign.linear.linear_problem import FeedbackLoop, Polytope, Vertex, modal_scaling, polytope_of
from quakedesign.lyapunov import Certificate, Loop, Verdict, Witness, certificate_text, loop_of, parse_certificate
from quakedesign.lyapunov.exact.obligations import Obligation, claimed, different
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors, plant_ranges, sectors
from quakedesign.lyapunov.search.lyapunov_search import below, certificate_of, quadratic_margin, quadratic_terms
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.proofs import Square
from quakedesign.sos.solve.conic import solve
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds

# ----------------------------------------------------------------------
# One quadratic V for a whole box, and feedback designed for it: semidefinite programs, exact proofs.

_SHARES = (0.99, 0.9, 0.5, 0.1, 0.01)
_LEAST_MARGIN = 1e-10
_DECADES, _GOOD = 13, 0.85


@dataclass(frozen=True, slots=True)
class QuadraticProposal:
    """Floating-point V = xᵀPx for a polytope; proves nothing."""

    form: np.ndarray  # shape (n, n): P
    rate: float  # Largest a with V′ ≤ −2aV at every vertex [1/s]


class CommonQuadratic:
    """Search for one V for all vertices of a polytope, in modal coordinates; one model serves all decay rates."""

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

    def __call__(self, rate: float = 0.0) -> QuadraticProposal | None:
        """V with at least a given decay rate [1/s] at all vertices, with the largest margin; None without one."""
        self._rate.value = rate / self.scaling.pace
        if not solve(self._problem) or self._margin.value is None or not self._margin.value > _LEAST_MARGIN:
            return None
        form = np.asarray(self._form.value, dtype=float)
        form = (form + form.T) / 2
        return QuadraticProposal(form=self.scaling.back(form), rate=self._decay(form) * self.scaling.pace)

    def _decay(self, form: np.ndarray) -> float:
        return min(float(eigh(-(A.T @ form + form @ A), 2 * form, eigvals_only=True)[0]) for A in self.systems)

    def fastest(self, tolerance: float = 1e-3) -> QuadraticProposal | None:
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
    """Certificate of exponential stability for all measurable time histories of the parameters of a loop, or None.

    Parameters
    ----------
    loop : Loop
        Linear, on the reals.
    fastest : bool
        Whether to search the V with the largest decay rate instead of that with the largest margin.
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
        other = search()  # where the fastest V is hard to find or to round, the best conditioned may succeed
        rounder = finished(loop, other) if other is not None else None
        certificate = max(filter(None, (certificate, rounder)), key=lambda c: c.claims["rate"], default=None)
    return certificate


def finished(loop: Loop, proposal: QuadraticProposal) -> Certificate | None:
    """Certificate for a proposed V, in exact arithmetic, with the largest provable share of its decay rate."""
    form = proposal.form
    size = float(abs(form).max())  # entries divided by this are read as the decimals that Python prints
    both = form + form.T - np.diag(np.diag(form))
    lyapunov = quadratic_terms(tuple(loop.states), lambda i, j: rational(float(both[i, j] / size)))
    positive = quadratic_margin(loop, lyapunov) / 2
    for share in _SHARES:
        claims = {"positive": positive, "rate": below(share * proposal.rate)}
        certificate = certificate_of(loop, lyapunov, claims) if min(claims.values()) > 0 else None
        if certificate is not None:
            return certificate
    return None


def finished_exactly(loop: Loop, theta: Sequence[Sequence[Fraction]]) -> Certificate | None:
    """Certificate for V = xᵀΘx, or None; its rate is the largest provable a·10⁻ⁿ, a the rate of the slowest pole.

    For a V so ill-conditioned that floating point cannot decide its decrease: witnesses are derived directly.
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


def sector_loop(controller: Any, sectors: Sectors) -> Loop:
    """Loop of a linear feedback over sectors."""
    return loop_of(
        controller.name,
        controller.loop_field(),
        gains=controller.gains,
        constants={"b": sectors.authority},
        uncertain=sectors.ranges(),
    )


# ----------------------------------------------------------------------
# Tolerances of a given K: friction slope, range of β, decay rate, each proved and reported with its limit.

_MARGIN_SHARES = (Fraction(9995, 10000), Fraction(999, 1000), Fraction(997, 1000), Fraction(992, 1000))
_STEPS = 10
_BETA_STEPS = 7
_LARGEST_BETA = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeMargin:
    """Friction-slope margin for all β of the box ``paper``.

    Friction adds s(t)·x1 to x2' with 0 ≤ s ≤ margin·s_max at any time. Unlike s of `Sectors`, this s is without spring.
    """

    certified: LowerBound  # The common quadratic V proves it up to here; 0 when nothing was proved
    # A constant s of limit·s_max, with β = `limit_beta`, is not asymptotically stable (Routh–Hurwitz, exact)
    limit: UpperBound
    limit_beta: Fraction
    circle: float  # What the circle criterion allows for time-varying s at `limit_beta`, over s_max [-], in floats
    slope: Fraction  # s_max [1/s²], see `nominal_slope`
    # The same with the largest effective stress on the way to the target slip (ERRATA 8) [1/s²]
    working_slope: Fraction
    certificate: Certificate | None

    def to_dict(self) -> Json:
        """Exact numbers as strings, floating-point results as numbers."""
        return {
            "friction_slope_margin": self.certified.exact,
            "linear_limit": self.limit.exact,
            "linear_limit_beta": str(self.limit_beta),
            "circle_limit": self.circle,
            "slope": str(self.slope),
            "working_slope": str(self.working_slope),
            "working_margin": float(LowerBound(self.certified * self.slope / self.working_slope)),
        }


def friction_slope_margin(fault: Fault, controller: Controller) -> SlopeMargin | None:
    """Certify a friction-slope margin, at most 0.5 % of the linear limit below the supremum for this family of V.

    Parameters
    ----------
    fault : Fault
        Its box is replaced by ``paper``; its disturbance does not count.
    controller : Controller
        e-LQR.

    Returns
    -------
    SlopeMargin or None
        None for friction without slope, or when the loop without friction slope is unstable for a β of the range.
    """
    fault = fault.with_box("paper")
    needed, slope = sectors(fault), nominal_slope(fault)
    spring, damping = (plant_ranges(fault)[symbol][0] for symbol in (plant.k_hat, plant.eta_hat))
    still = replace(needed, slip=(-spring, -spring), rate=(damping, damping))
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=still)
    critical = slip_limit(loop, damping)
    if slope == 0 or critical is None or critical[0] <= -spring:
        return None
    limit, beta = (critical[0] + spring) / slope, critical[1]

    def prove(margin: Fraction) -> Certificate | None:
        widened = replace(needed, slip=(-spring, margin * slope - spring), rate=(damping, damping))
        return robust_stability(sector_loop(controller, widened))

    certified, certificate = _largest(prove, limit)
    stress = needed.largest_effective_stress / rational(fault.effective_normal_stress)
    return SlopeMargin(
        certified=LowerBound(certified),
        limit=UpperBound(limit),
        limit_beta=beta,
        circle=circle_limit(loop, beta, damping, -spring) / float(slope),
        slope=slope,
        working_slope=slope * stress,
        certificate=certificate,
    )


def nominal_slope(fault: Fault) -> Fraction:
    """s_max = N̂σ'_n·(largest chord slope of friction in slip) at zero pressure [1/s²]."""
    values = plant.plant_values(fault)
    return fraction_of(values[plant.N_hat] * values[plant.sigma]) * friction_bounds(fault.friction).slip_slope


def _largest(prove: Callable[[Fraction], Certificate | None], limit: Fraction) -> tuple[Fraction, Certificate | None]:
    """Largest number below a limit that is proved: shares of the limit first, bisection below them."""
    for share in _MARGIN_SHARES:
        value = _decimal(limit * share)
        certificate = prove(value)
        if certificate is not None:
            return value, certificate
    low, high, best = Fraction(0), limit * _MARGIN_SHARES[-1], None
    for _ in range(_STEPS):
        middle = _decimal((low + high) / 2)
        proof = prove(middle)
        low, high, best = (middle, high, proof) if proof is not None else (low, middle, best)
    return low, best


def _decimal(value: Fraction) -> Fraction:
    """Value rounded to six digits, at most 4e-6 of it higher; the proof is then attempted for the rounded number."""
    digits = f"{float(value) * (1 - 1e-6):.5e}"
    return Fraction(digits)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainRange:
    """Range of β = μN̂/b beyond the box, with one V for each end and all other parameters anywhere in the box."""

    # low, high: Printed values stay inside the proved range. `low` is proved together with the largest β of the box,
    # `high` with the smallest. `high` is at most 1024 times the largest β of the box: larger values are not tried.
    low: UpperBound
    high: LowerBound
    # This constant β is not asymptotically stable at a constant vertex of the other parameters (exact)
    low_limit: LowerBound
    certificates: tuple[Certificate, ...]

    def to_dict(self) -> Json:
        """Exact numbers as strings."""
        return {"beta_low": self.low.exact, "beta_high": self.high.exact, "beta_low_limit": self.low_limit.exact}


def gain_range(fault: Fault, controller: Controller) -> GainRange | None:
    """Certify how far β may leave the box: below by bisection, above by factors of 4; None if the box is not proved."""
    needed = sectors(fault)

    def prove(low: Fraction, high: Fraction) -> Certificate | None:
        return robust_stability(sector_loop(controller, replace(needed, beta=(low, high))))

    least, most = needed.beta
    inside = prove(least, most)
    if inside is None:
        return None
    limit = _least_stable(FeedbackLoop(gains=tuple(controller.gains.values()), sectors=needed))
    ends = {"low": (least, inside), "high": (most, inside)}
    low, certified = limit, least
    for _ in range(_BETA_STEPS):
        middle = nearest(float((low + certified) / 2), 1 << 24)
        proof = prove(middle, most)
        if proof is None:
            low = middle
        else:
            certified, ends["low"] = middle, (middle, proof)
    factor, failed = Fraction(4), False
    while factor <= _LARGEST_BETA and not failed:
        proof = prove(least, most * factor)
        failed = proof is None
        if proof is not None:
            ends["high"] = (most * factor, proof)
        factor *= 4
    return GainRange(
        low=UpperBound(ends["low"][0]),
        high=LowerBound(ends["high"][0]),
        low_limit=LowerBound(limit),
        certificates=(ends["low"][1], ends["high"][1]),
    )


def _least_stable(loop: FeedbackLoop) -> Fraction:
    """Largest β below the range at which a constant vertex (s, w) is not stable, or 0; to 2⁻²⁰ of the lower end."""
    low, high = Fraction(0), loop.sectors.beta[0]
    for _ in range(20):
        middle = (low + high) / 2
        there = replace(loop, sectors=replace(loop.sectors, beta=(middle, middle)))
        low, high = (low, middle) if there.unstable_vertex() is None else (middle, high)
    return low


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayRate:
    """Exponential decay for all measurable time histories of the parameters in the box."""

    certified: LowerBound  # a with |x(t)| ≤ C·e^{−at} [1/s]
    limit: float  # Slowest pole of a constant vertex [1/s], in floats: an upper limit of a
    certificate: Certificate


def decay_rate(loop: Loop) -> DecayRate | None:
    """Certify the largest decay rate of a common quadratic V; None when stability is not proved."""
    certificate = robust_stability(loop, fastest=True)
    if certificate is None:
        return None
    limit = -polytope_of(loop).slowest()
    return DecayRate(certified=LowerBound(certificate.claims["rate"]), limit=limit, certificate=certificate)


# ----------------------------------------------------------------------
# Verdict on a given K over a whole box, with every certified margin and its limit.


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """Proved stability of a K about any constant reference, with margins beyond the box."""

    decay: DecayRate | None  # None when no V was found for the whole box
    # β, s [1/s²] and w [1/s] of a vertex at which the loop is not asymptotically stable (Routh–Hurwitz, exact)
    unstable_at: Vertex | None
    slope: SlopeMargin | None
    span: GainRange | None
    frequency: tuple[FrequencyFacts, ...]  # In floats, one for every vertex

    @property
    def verdict(self) -> Verdict:
        """PROVED with a V for the whole box, REFUTED by a vertex, else UNDECIDED."""
        if self.decay is not None:
            return Verdict.PROVED
        return Verdict.UNDECIDED if self.unstable_at is None else Verdict.REFUTED

    @property
    def certificates(self) -> dict[str, Certificate]:
        """Certificates by name: ``stability``, ``friction-slope``, ``low-beta`` and ``high-beta``."""
        by_name: dict[str, Certificate | None] = {"stability": self.decay.certificate if self.decay else None}
        by_name["friction-slope"] = self.slope.certificate if self.slope else None
        if self.span is not None:
            by_name["low-beta"], by_name["high-beta"] = self.span.certificates
        return {name: certificate for name, certificate in by_name.items() if certificate is not None}

    def to_dict(self) -> Json:
        """Exact numbers as strings, floating-point results as numbers, SI."""
        return {
            "verdict": str(self.verdict),
            "unstable_at": [float(v) for v in self.unstable_at] if self.unstable_at else None,
            "decay_rate": self.decay.certified.exact if self.decay else None,
            "decay_limit": self.decay.limit if self.decay else None,
            **(self.slope.to_dict() if self.slope else {"friction_slope_margin": None}),
            **(self.span.to_dict() if self.span else {}),
            "frequency": [{name: getattr(f, name) for name in f.__slots__} for f in self.frequency],
        }


def analysis(fault: Fault, controller: Controller) -> Analysis:
    """Judge a given K on a fault, over its uncertainty box.

    Parameters
    ----------
    controller : Controller
        e-LQR.
    """
    needed = sectors(fault)
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=needed)
    return Analysis(
        decay=decay_rate(sector_loop(controller, needed)),
        unstable_at=loop.unstable_vertex(),
        slope=friction_slope_margin(fault, controller),
        span=gain_range(fault, controller),
        frequency=tuple(frequency_properties(loop, corner) for corner in needed.vertices()),
    )


def why_undecided(loop: FeedbackLoop) -> str:
    """Reason why no V was found for gains: an unstable vertex, or none known."""
    vertex = loop.unstable_vertex()
    if vertex is None:
        return (
            "every constant vertex of the box is stable, but no common quadratic V was found for parameters that vary; "
            "a narrower box or more bandwidth may help"
        )
    beta, s, w = map(float, vertex)
    return (
        f"the loop is not stable near beta = {beta:.4g}, s = {s:.4g} 1/s^2, w = {w:.4g} 1/s of the box, so no V "
        "exists; a narrower box or a shorter sampling time (more bandwidth) may help"
    )
