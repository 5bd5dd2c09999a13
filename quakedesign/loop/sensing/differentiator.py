"""Robust exact filtering differentiator: coefficients, discretisations, output feedback.

Discretisations: forward Euler, homogeneous (Livne and Levant 2014, Automatica 50, 2040) and implicit (Mojallizadeh,
Brogliato and Acary 2021, Int. J. Robust Nonlinear Control 31, 7679). Coefficients: Levant and Livne (2020), European
Journal of Control 55, 33. Last chapter: for a fault initially at rest and a sufficiently large bound λ_d, the implicit
differentiator is a filter of backward differences.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import comb

import casadi as ca

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, require_known, require_whole
from quakedesign.fault.model import require_positive
from quakedesign.laws.sampled_law import LinearLaw
from quakedesign.loop.sensing.measurement import Entries, Sensor, SlipStage

# ----------------------------------------------------------------------
# One sample of the filtering differentiator, discretised in three ways.
#
# With y = (w_1 … w_nf, z_0 … z_nd), N = n_d + n_f + 1 entries, and a slip x the differentiator is, in continuous time,
#
#     y_j' = −λ̃_(N−j) λ_d^(j/N) ⌈s⌋^((N−j)/N) + y_(j+1) − [j = n_f]·x,    y_(N+1) = 0,
#
# where s is y_1, or z_0 − x without a filter (n_f = 0); its estimates are z_0 … z_nd.
#
# - ``euler``: forward Euler.
# - ``homogeneous``: forward Euler with the further Taylor terms T²/2·z_(i+2) + … of every z_i; without them z_i
#   settles at x^(i) + T/2·x^(i+1), 0 < i < n_d, an error of the order of T for every n_d. Livne and Levant (2014),
#   Automatica 50, 2040; Levant and Livne (2020), European Journal of Control 55, 33.
# - ``implicit``: backward Euler with the latest reading. All y_j⁺ follow from s⁺. Eliminating them leaves
#   s⁺ + Σ_j T^j λ̃_(N−j) λ_d^(j/N) ⌈s⁺⌋^((N−j)/N) ∋ b with a known b. The left-hand side increases, so the solution is
#   unique and has the sign of b. With |s⁺| = λ_d·(qT)^N it is the root q ≥ 0 of the polynomial
#   q^N + Σ_j λ̃_(N−j) q^(N−j) = |b|/(λ_d·T^N) if the right-hand side exceeds λ̃_0, and s⁺ = 0 otherwise. The
#   polynomial is convex and increasing for q > 0, so that Newton's method decreases monotonically from any bound above
#   the root. Mojallizadeh, Brogliato and Acary (2021), Int. J. Robust Nonlinear Control 31, 7679.
#
# In the implicit sliding mode z_i = ∇^i x/T^i, which lags: the i-th derivative is (−ln(1 − ∇))^i x/T^i, whose terms up
# to ∇^nd x are a combination of z_i … z_nd. `lag_free` has its coefficients i!/j!·|S1(j, i)|; with them the estimates
# have the accuracy T^(nd+1−i) of the continuous differentiator. For n_f = 0 this is the proper implicit discretisation
# of Seeber (2024), arXiv:2404.02770.

NEWTON_STEPS = 8


def explicit_step(gains: Entries, step: ca.SX, state: Entries, slip: ca.SX, filters: int, taylor: bool) -> Entries:
    """y after one sample (SX); the gains are T·λ̃_(N−j)·λ_d^(j/N), j = 1 … N."""
    size = len(state)
    distance = state[0] if filters else state[0] - slip
    root = _root(ca.fabs(distance), size)
    after = []
    for j, (value, gain) in enumerate(zip(state, gains, strict=True), start=1):
        drift = state[j] if j < size else ca.SX(0)
        drift = drift - slip if j == filters else drift
        moved = value + step * drift - gain * ca.sign(distance) * _whole_power(root, size - j)
        after.append(moved + _taylor(step, state[j + 1 :]) if taylor and j > filters else moved)
    return after


def implicit_step(
    gains: Entries, scale: ca.SX, table: Sequence[float], step: ca.SX, state: Entries, slip: ca.SX, filters: int
) -> Entries:
    """y after one sample (SX); the gains are λ̃_(N−j)·λ_d·T^(N−j+1), j = 1 … N, and the scale is λ_d·T^N."""
    size = len(state)
    ahead = state[-1]
    for value in reversed(state[:-1]):
        ahead = value + step * ahead
    ahead = (ahead - _whole_power(step, filters) * slip) / scale
    root, share = _solve(ca.fabs(ahead), table)
    injection = [_whole_power(root, size - j) for j in range(1, size)] + [share]
    after: Entries = []
    following = ca.SX(0)
    for j in range(size, 0, -1):
        drift = following - slip if j == filters else following
        following = state[j - 1] + step * drift - gains[j - 1] * ca.sign(ahead) * injection[j - 1]
        after.insert(0, following)
    return after


def lag_free(order: int) -> tuple[tuple[Fraction, ...], ...]:
    """Row i has the coefficients of T^(j−i)·z_j, j = i … order, in the estimate of derivative i."""
    rows = []
    for i in range(order + 1):
        shares = (Fraction(math.factorial(i) * _stirling(j, i), math.factorial(j)) for j in range(i, order + 1))
        rows.append(tuple(shares))
    return tuple(rows)


def _solve(target: ca.SX, table: Sequence[float]) -> tuple[ca.SX, ca.SX]:
    """q of the polynomial, and the selection of |⌈s⁺⌋⁰| from [0, 1]."""
    size, (jump, *rest) = len(table), table
    excess = ca.fmax(target - jump, 0)
    rising = [*rest, 1.0]  # coefficients of q, q² … q^N
    root = _root(excess, size)
    for power, weight in enumerate(rest, start=1):
        root = ca.fmin(root, _root(excess / weight, power))
    for _ in range(NEWTON_STEPS):
        value, slope = ca.SX(rising[-1]), ca.SX(0)
        for weight in reversed(rising[:-1]):
            slope = slope * root + value
            value = value * root + weight
        slope = slope * root + value
        root = root - (value * root - excess) / slope
    return root, ca.fmin(target / jump, 1)


def _root(value: ca.SX, degree: int) -> ca.SX:
    """Root of a non-negative number; square roots are correctly rounded."""
    return value if degree == 1 else ca.sqrt(value) if degree == 2 else value ** (1.0 / degree)


def _whole_power(value: ca.SX, exponent: int) -> ca.SX:
    product = ca.SX(1)
    for _ in range(exponent):
        product = product * value
    return product


def _taylor(step: ca.SX, later: Entries) -> ca.SX:
    """T²/2·z_(i+2) + T³/6·z_(i+3) + …."""
    total = ca.SX(0)
    for degree in range(len(later) + 1, 1, -1):
        total = (total + later[degree - 2]) * step / degree
    return total * step


def _stirling(j: int, i: int) -> int:
    """Unsigned Stirling number of the first kind."""
    row = [1]
    for k in range(j):
        row = [(row[m - 1] if m else 0) + k * (row[m] if m < len(row) else 0) for m in range(len(row) + 1)]
    return row[i] if i < len(row) else 0


# ----------------------------------------------------------------------
# Published coefficients of the homogeneous differentiator.
#
# Levant and Livne (2020), Robust exact filtering differentiators, European Journal of Control 55, 33, doi
# 10.1016/j.ejcon.2019.08.006: λ̃_0 … λ̃_n for n = n_d + n_f = 0 … 12, rounded to about four digits. They are those of
# the recursive form with λ = 1.1, 1.5, 2, 3, 5, 7, 10, 12, 14, 17, 20, 26, 32 (also given there, and up to n = 5 in
# Levant (2003), Higher-order sliding modes, differentiation and output-feedback control, Int. J. Control 76, 924), by
# λ̃_n = λ_n and λ̃_j = λ_j·λ̃_(j+1)^(j/(j+1)).

LONGEST = 12
TABLES = (
    (1.1,),
    (1.1, 1.5),
    (1.1, 2.12, 2.0),
    (1.1, 3.06, 4.16, 3.0),
    (1.1, 4.57, 9.30, 10.03, 5.0),
    (1.1, 6.75, 20.26, 32.24, 23.72, 7.0),
    (1.1, 9.91, 43.65, 101.96, 110.08, 47.69, 10.0),
    (1.1, 14.13, 88.78, 295.74, 455.40, 281.37, 84.14, 12.0),
    (1.1, 19.66, 171.73, 795.63, 1703.9, 1464.2, 608.99, 120.79, 14.0),
    (1.1, 26.93, 322.31, 2045.8, 6002.3, 7066.2, 4026.3, 1094.1, 173.72, 17.0),
    (1.1, 36.34, 586.78, 5025.4, 19895.0, 31601.0, 24296.0, 8908.0, 1908.5, 251.99, 20.0),
    (1.1, 48.86, 1061.1, 12220.0, 65053.0, 138954.0, 143658.0, 70830.0, 20406.0, 3623.1, 386.7, 26.0),
    (1.1, 65.22, 1890.6, 29064.0, 206531.0, 588869.0, 812652.0, 534837.0, 205679.0, 48747.0, 6944.8, 623.30, 32.0),
)


# ----------------------------------------------------------------------
# Robust exact filtering differentiator (eq. dif of the paper).

DISCRETISATIONS = ("euler", "homogeneous", "implicit")


@checked_dataclass(frozen=True, kw_only=True)
class Differentiator:
    """Estimates slip and n_d derivatives, exact after a transient if |x1^(n_d+1)| ≤ L_d < λ_d; filter order n_f.

    With measurement errors of at most ε and sampling period T, the error of the estimate of derivative i is at most a
    constant times λ_d·δ^(n_d+1−i), δ = max(T, (ε/λ_d)^(1/(n_d+1))); with ``euler`` this holds for n_d = 1 only. Levant
    and Livne (2020), European Journal of Control 55, 33. The paper takes n_d = n_f = 2, for which no λ_d suffices under
    a sliding-mode law, since x1‴ is unbounded there; for n_d = 1 some λ_d does (ERRATA 21). See
    `quakedesign.loop.sensing.differentiator` for the equations.

    Attributes
    ----------
    bound : float
        λ_d [m/s^(n_d+1)].
    step : float
        Sampling period T [s].
    order : int
        n_d, at least 1.
    filter_order : int
        n_f; n_d + n_f is 12 at most.
    discretisation : str
        ``"euler"``, ``"homogeneous"`` (both estimate from earlier readings), or ``"implicit"`` (with the latest too).
    inner_steps : int
        n, at least 1: number of steps of T/n per reading, under the same reading.
    """

    bound: float
    step: float
    order: int = 1
    filter_order: int = 0
    discretisation: str = "implicit"
    inner_steps: int = 1

    def __post_init__(self) -> None:
        require_positive(bound=self.bound, step=self.step)
        for name, least in (("order", 1), ("filter_order", 0), ("inner_steps", 1)):
            require_whole(least, **{name: getattr(self, name)})
        if self.order + self.filter_order > LONGEST:
            raise ParameterError(
                f"order + filter_order must be at most {LONGEST}, the end of the published table. "
                f"Received {self.order} + {self.filter_order}."
            )
        require_known(self.discretisation, DISCRETISATIONS, "discretisation")
        size = math.log(self.bound) + (self.size + 1) * math.log(self.step / self.inner_steps)
        if not math.log(sys.float_info.min) < size < math.log(sys.float_info.max):
            raise ParameterError(
                f"bound·(step/inner_steps)^{self.size + 1} must be representable in double precision. Received "
                f"{self.bound!r} m/s^{self.order + 1}, {self.step!r} s and inner_steps {self.inner_steps}. Take "
                "another order or step."
            )

    @property
    def size(self) -> int:
        """N = n_d + n_f + 1, the number of states."""
        return self.order + self.filter_order + 1

    @property
    def table(self) -> tuple[float, ...]:
        """λ̃_0 … λ̃_(N−1)."""
        return TABLES[self.size - 1]

    @property
    def start(self) -> tuple[float, ...]:
        """States before the first sample, for a fault at rest at slip 0."""
        return (0.0,) * self.size

    @property
    def numbers(self) -> tuple[float, ...]:
        """T/n, the N gains of an inner step, and λ_d·(T/n)^N for an implicit one."""
        size, step, bound = self.size, self.step / self.inner_steps, self.bound
        places = range(1, size + 1)
        if self.discretisation == "implicit":
            gains = tuple(self.table[size - j] * bound * step ** (size - j + 1) for j in places)
            return (step, *gains, bound * step**size)
        return (step, *(step * self.table[size - j] * bound ** (j / size) for j in places))

    def estimate(self, numbers: Entries, memory: Entries, slip: ca.SX) -> tuple[Entries, Entries]:
        """Estimates (SX) of slip and its derivatives at the time of a reading, and the states afterwards.

        Parameters
        ----------
        slip : SX
            Reading [m].

        Returns
        -------
        list of SX, list of SX
            n_d + 1 estimates [m], [m/s] …; the states.
        """
        step, gains, after = numbers[0], numbers[1 : self.size + 1], memory
        for _ in range(self.inner_steps):
            if self.discretisation == "implicit":
                after = implicit_step(gains, numbers[-1], self.table, step, after, slip, self.filter_order)
            else:
                taylor = self.discretisation == "homogeneous"
                after = explicit_step(gains, step, after, slip, self.filter_order, taylor)
        if self.discretisation == "implicit":
            return _without_lag(after[self.filter_order :], step), after
        return memory[self.filter_order :], after


def _without_lag(derivatives: Entries, step: ca.SX) -> Entries:
    totals = []
    for i, shares in enumerate(lag_free(len(derivatives) - 1)):
        total = ca.SX(0)
        for share, value in reversed(list(zip(shares, derivatives[i:], strict=True))):
            total = total * step + float(share) * value
        totals.append(total)
    return totals


# ----------------------------------------------------------------------
# Output feedback: a law of estimates, p(x̂1, x̂2).


@checked_dataclass(frozen=True, kw_only=True)
class OutputFeedback(Sensor):
    """Slip through a chain of stages into a differentiator, which estimates slip and slip rate.

    A loop that is stable with exact states may be unstable with estimates (no separation principle);
    `joint_condition` is a sufficient condition for the differentiator to converge.

    Attributes
    ----------
    differentiator : Differentiator
    stages : tuple of SlipStage
        In the order of the signal, hardware first.

    Raises
    ------
    ParameterError
        For an entry that is not a stage, or hardware after software.
    """

    differentiator: Differentiator
    stages: tuple[SlipStage, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "stages", tuple(self.stages))
        hardware = True
        for stage in self.stages:
            if not isinstance(stage, SlipStage):
                raise ParameterError(f"stages must be Transducer, Averaging and the like. Received {stage!r}.")
            if stage.hardware and not hardware:
                raise ParameterError(
                    f"stages in hardware must come before those in software. Received {stage!r} after software. "
                    "Reorder the stages."
                )
            hardware = stage.hardware

    @property
    def step(self) -> float:
        """See `Sensor.step`."""
        return self.differentiator.step

    @property
    def numbers(self) -> tuple[float, ...]:
        """See `Sensor.numbers`."""
        return (*(v for stage in self.stages for v in stage.numbers(self.step)), *self.differentiator.numbers)

    @property
    def start(self) -> tuple[float, ...]:
        """See `Sensor.start`."""
        return (*(v for stage in self.stages for v in stage.start), *self.differentiator.start)

    @property
    def software(self) -> "OutputFeedback":
        """See `Sensor.software`."""
        return replace(self, stages=tuple(stage for stage in self.stages if not stage.hardware))

    def measure(self, numbers: Entries, memory: Entries, x: ca.SX) -> tuple[ca.SX, Entries]:
        """See `Sensor.measure`."""
        own, past = iter(numbers), iter(memory)
        slip, memories = x[0], []
        for stage in self.stages:
            slip, after = stage.pass_on(_next(own, len(stage.numbers(self.step))), _next(past, len(stage.start)), slip)
            memories += after
        estimates, after = self.differentiator.estimate(list(own), list(past), slip)
        return ca.vertcat(estimates[0], estimates[1]), [*memories, *after]


def _next(entries: Iterator[ca.SX], count: int) -> Entries:
    return [next(entries) for _ in range(count)]


# ----------------------------------------------------------------------
# With a sufficiently large λ_d the implicit differentiator of a fault initially at rest is a filter of differences.
#
# With y = (w_1 … w_nf, z_0 … z_nd) as in the first chapter, let w = 0 before a reading x, let z_0 = x⁻ be the previous
# reading, and z_i = ∇ⁱx⁻/Tⁱ. Then b = y_1 + T(y_2 + … + T(z_0 − x + T·z_1 + …)) is −T^nf·∇^(nd+1)x, and if |∇^(nd+1)x|
# ≤ λ̃_0·λ_d·T^(nd+1) the step gives s⁺ = 0. So w stays 0, z_0⁺ = x and, from z_i⁺ = z_i + T·z_(i+1)⁺, z_(i+1)⁺ =
# ∇^(i+1)x/T^(i+1). At rest at slip 0 all of y is 0. By induction the differentiator is this filter for all t and any
# n_f: its slip is the reading, its slip rate Σ ∇ʲx/(jT), 1 ≤ j ≤ n_d (`lag_free`), and a law with its estimates is a
# law of the slip alone, whose guarantee includes all errors of the estimates.
#
# With |x1″| ≤ A and readings within ε, |∇^(nd+1)x| ≤ c·A·T² + 2^(nd+1)·ε: no bound of x1‴ is needed; none exists with
# zero-order hold. ∇²x1 is T times the integral of x1″ weighted by a triangular function over two periods. So c is the
# integral of the absolute value of the (n_d−1)-th difference of this function, in units of T. That difference is
# piecewise linear, and its corners are binomial coefficients of alternating sign: c = 1 for n_d = 1, 3/2 for n_d = 2.

ORDER = 2  # n_d of the paper


def names_before(order: int = ORDER) -> tuple[str, ...]:
    """Names of the states that store previous readings."""
    return tuple(f"reading_{i}" for i in range(1, order + 1))


def rate_shares(order: int = ORDER) -> tuple[Fraction, ...]:
    """Weights of the latest reading, the previous one, and so on in T times the estimated slip rate."""
    return tuple(
        sum((Fraction((-1) ** back * comb(j, back), j) for j in range(1, order + 1)), Fraction(0))
        for back in range(order + 1)
    )


def by_differences(law: LinearLaw, step: Fraction, order: int = ORDER) -> LinearLaw:
    """Law of the slip alone: a law of slip and slip rate with the rate estimated by differences every T_s [s]."""
    now, *before = (share / step for share in rate_shares(order))
    zero, names = Fraction(0), names_before(order)

    def fed(seen: tuple[Fraction, ...]) -> tuple[Fraction, Fraction]:
        return seen[0] + seen[1] * now, zero

    def buffered(own: tuple[Fraction, ...], seen: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
        return (*own, *(seen[1] * share for share in before))

    shifted = [
        (*[zero] * len(law.states), *(Fraction(i == place) for i in range(order))) for place in range(-1, order - 1)
    ]
    return replace(
        law,
        states=(*law.states, *names),
        update=(*(buffered(own, seen) for own, seen in zip(law.update, law.measured, strict=True)), *shifted),
        measured=(*map(fed, law.measured), *((Fraction(place == 0), zero) for place in range(order))),
        output=buffered(law.output, law.feedback),
        feedback=fed(law.feedback),
        applied=law.applied and (*law.applied, *[zero] * order),
    )


def least_bound(acceleration: Fraction, noise: Fraction, step: Fraction, order: int = ORDER) -> Fraction:
    """Smallest λ_d [m/s^(n_d+1)] for this filter, for a bound of |x1″| [m/s²], noise within a bound [m] and T_s [s]."""
    least = min(Fraction(str(table[0])) for table in TABLES)
    corners = [0, *(comb(order - 1, j) for j in range(order)), 0]
    area = sum((Fraction(p**2 + q**2, 2 * (p + q)) for p, q in pairwise(corners)), Fraction(0))
    return Fraction((area * acceleration * step**2 + 2 ** (order + 1) * noise) / (least * step ** (order + 1)))
