"""Plants for which Theorem 2 as printed fails (ERRATA 6, 7), with designs that are proved."""

from dataclasses import dataclass
from fractions import Fraction

from scipy.optimize import minimize_scalar

from quakedesign.lyapunov.exact.perturbation_bounds import Sectors
from quakedesign.fault import load_fault
from quakedesign.linear.linear_problem import decreases
from own.printed_theorem import Switching, printed_row
from quakedesign.linear.riccati import solve_care
from quakedesign.linear.riccati import sound_bound
from quakedesign.linear.linear_problem import LinearProblem, ProblemScales
from quakedesign.linear.linear_problem import Matrix, diagonal, outer, rounded, times, total

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A plant, its printed row G, and the weights with which Theorem 2 as printed is applied to it.

    Attributes
    ----------
    name : str
    problem : LinearProblem
    printed : (Fraction, Fraction)
    Q0 : Matrix
    R : Fraction
    switching : Switching or None
    """

    name: str
    problem: LinearProblem
    printed: Range
    Q0: Matrix
    R: Fraction
    switching: Switching | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactDesign:
    """K and V = xᵀΘx in rationals.

    Attributes
    ----------
    gains : tuple of Fraction
        In the units of the problem.
    theta : Matrix
    proved : bool
        Whether V > 0 and V̇ < 0 at every vertex, exactly; then for every plant of the box, switched ones included.
    """

    gains: tuple[Fraction, ...]
    theta: Matrix
    proved: bool


def printed_design(example: Example) -> ExactDesign:
    """K and Θ of Theorem 2 as printed, Q = Q0 + R·GᵀG; the theorem states that this is a proof."""
    g = (*example.printed, Fraction(0), Fraction(0))
    return _designed(example, times(example.R, outer(g, g)))


def corrected_design(example: Example) -> ExactDesign:
    """K and Θ with the sound bound, Q = Q0 + R·W, the split of W chosen for the smallest trace of Θ."""
    bounds = example.problem.bounds

    def design(split: float) -> ExactDesign:
        return _designed(example, times(example.R, sound_bound(bounds, Fraction(round(split * 1000), 1000))))

    if not min(bounds):
        return design(0.5)
    best = minimize_scalar(
        lambda w: float(sum(design(w).theta[i][i] for i in range(4))), bounds=(0.05, 0.95), method="bounded",
        options={"xatol": 1e-2},
    )  # fmt: skip
    return design(float(best.x))


def _designed(example: Example, bound: Matrix) -> ExactDesign:
    problem, Q = example.problem, total(example.Q0, bound)
    unit = (Fraction(0), problem.sectors.authority, Fraction(0), Fraction(0))
    solution = solve_care(problem.nominal(), times(1 / example.R, outer(unit, unit)), Q)
    theta = rounded(solution.X, 60)
    gains = tuple(problem.sectors.authority * row[1] / example.R for row in theta)
    return ExactDesign(gains=gains, theta=theta, proved=decreases(problem, gains, theta))


def printed_bound_example() -> Example:
    """ERRATA 6: the real fault, N̂ known, so that the printed bound has no friction; Q0 = 1e-6·I, R = 1, p in MPa."""
    fault = load_fault("real-fault")
    mega = ProblemScales(time=Fraction(1), slip=Fraction(1), pressure=Fraction(10**6))
    g1, g2 = printed_row(fault)
    return Example(
        name="friction missing in G",
        problem=LinearProblem.of(fault).nondimensional(mega),
        printed=(g1 / mega.pressure, g2 / mega.pressure),
        Q0=diagonal((Fraction(1, 10**6),) * 4),
        R=Fraction(1),
    )


def printed_row_example() -> Example:
    """ERRATA 7: k̂ = 1 ± 1, η̂ = 0.1 ± 1, b = 1: g1 = g2 = 1; Q0 = 1e-4·I, R = 1."""
    one, damping = Fraction(1), Fraction(1, 10)
    problem = LinearProblem(
        stiffness=one,
        damping=damping,
        sectors=Sectors(
            authority=one, beta=(one, one), slip=(Fraction(-2), Fraction(0)), rate=(damping - 1, damping + 1),
            row_bounds=(one, one), largest_effective_stress=Fraction(0),
        ),
    )  # fmt: skip
    soft, stiff = (one, Fraction(0), damping - 1), (one, Fraction(-2), damping - 1)
    return Example(
        name="one row for two bounds",
        problem=problem,
        printed=(one, one),
        Q0=diagonal((Fraction(1, 10**4),) * 4),
        R=one,
        switching=Switching(vertices=(soft, stiff), durations=(Fraction("1.861"), Fraction("1.025"))),
    )
