"""The plant about steady sliding, against closed forms, finite differences and eigenvalues at fifty digits."""

import random
import time
from dataclasses import dataclass, field
from typing import ClassVar

import mpmath
import pytest
import sympy as sp
from thinned import few

from quakedesign.errors import UnsupportedError
from quakedesign.fault import FrictionLaw, friction_law, friction_laws
from quakedesign.symbolic import plant
from quakedesign.symbolic import rate_and_state_plant as state_plant
from quakedesign.symbolic.plant import N_hat, eta_hat, k_hat, p, sigma
from quakedesign.symbolic.rate_and_state_plant import loading_rate, rate

VALUES = {
    "residual": 0.3,
    "drop": 0.1,
    "critical_slip": 2e-5,
    "critical_rate": 0.02,
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-1,
}
THETA = sp.Symbol("theta", real=True)


def law_of(name, **options):
    kind = friction_law(name)
    return kind(**{q: VALUES[q] for q in kind.quantities() if q in VALUES}, **options)


STATEFUL = [
    law_of("rate-and-state-aging"),
    law_of("rate-and-state-slip"),
    law_of("regularised-rate-and-state"),
    law_of("regularised-rate-and-state", evolution="slip"),
]
LOGARITHMIC = STATEFUL[:2]


@dataclass(frozen=True, kw_only=True)
class TwoStates(FrictionLaw):
    """A user's law: μ = μ_0 + a log(v/v_0) + b_1 log(v_0 θ_1/d_1) + b_2 log(v_0 θ_2/d_2) (Ruina 1983, two states)."""

    name: ClassVar[str] = "two-states"
    source: ClassVar[str] = "Ruina (1983)"
    domain: ClassVar[str] = "rate > 0"
    state_names: ClassVar[tuple[str, ...]] = ("theta_1", "theta_2")
    state_units: ClassVar[tuple[str, ...]] = ("s", "s")
    bounds = (0.1, 1.0)
    slip_slope = 1.0
    rate_slope = 1.0
    operating_rate = 1e-6

    direct: float = field(default=0.01, metadata={"unit": "", "symbol": "a"})
    first: float = field(default=0.013, metadata={"unit": "", "symbol": "b_1"})
    second: float = field(default=0.004, metadata={"unit": "", "symbol": "b_2"})
    short: float = field(default=1e-5, metadata={"unit": "m", "symbol": "d_1"})
    long: float = field(default=7e-5, metadata={"unit": "m", "symbol": "d_2"})

    def coefficient(self, slip, rate, *state):
        friction = sp.Rational(3, 5) + self.direct * sp.log(rate * 10**6)
        for effect, length, theta in zip((self.first, self.second), (self.short, self.long), state, strict=True):
            friction += effect * sp.log(theta / length / 10**6)
        return friction

    extended = coefficient

    def state_rates(self, slip, rate, *state):
        return tuple(1 - rate * theta / length for theta, length in zip(state, (self.short, self.long), strict=True))

    def steady_state(self, rate):
        return self.short / rate, self.long / rate


def random_plant(draw):
    """k̂ [1/s²], η̂ [1/s], N̂ [m²/kg], σ' and p [Pa], v_∞ [m/s], of faults and laboratories."""
    return {
        k_hat: mpmath.mpf(10) ** draw.uniform(-2, 4),
        eta_hat: mpmath.mpf(10) ** draw.uniform(-3, 3),
        N_hat: mpmath.mpf(10) ** draw.uniform(-7, -3),
        sigma: mpmath.mpf(10) ** draw.uniform(6, 8),
        p: mpmath.mpf(10) ** 5 * draw.uniform(-9, 9),
        loading_rate: mpmath.mpf(10) ** draw.uniform(-8, -2),
    }


def field_of(law, number):
    """(x1', v', states') in mpmath, written from the force balance and the law's own numbers."""
    states = state_plant.state_symbols(law.state_names)
    exact = law.exact()
    friction = sp.lambdify((rate, *states), exact.coefficient(0, rate, *states), "mpmath")
    changes = sp.lambdify((rate, *states), list(exact.state_rates(0, rate, *states)), "mpmath")
    steady = [mpmath.mpf(1) * sp.lambdify(rate, s, "mpmath")(number[loading_rate]) for s in exact.steady_state(rate)]
    start = friction(number[loading_rate], *steady)
    stress = number[sigma] - number[p]

    def derivative(x1, v, *state):
        acceleration = -number[N_hat] * stress * (friction(v, *state) - start)
        acceleration -= number[k_hat] * x1 + number[eta_hat] * (v - number[loading_rate])
        return [v - number[loading_rate], acceleration, *changes(v, *state)]

    return derivative, [mpmath.mpf(0), number[loading_rate], *steady]


def differences(derivative, at):
    """Jacobian by central differences."""
    J = mpmath.matrix(len(at))
    for j, value in enumerate(at):
        step = (abs(value) or mpmath.mpf(1)) * mpmath.mpf(10) ** -18
        ends = [derivative(*[x + sign * step * (i == j) for i, x in enumerate(at)]) for sign in (1, -1)]
        for i in range(len(at)):
            J[i, j] = (ends[0][i] - ends[1][i]) / (2 * step)
    return J


def inserted(expression, law, number):
    """Number of an expression in slopes and plant symbols."""
    exact = {s: sp.Float(str(v), 50) for s, v in number.items()}
    slopes = {s: v.subs(exact) for s, v in state_plant.slopes(law.exact()).items()}
    stress = {state_plant.effective_stress: exact[sigma] - exact[p]}
    return mpmath.mpf(str(sp.N(sp.sympify(expression).subs(slopes).subs(law.values()).subs(exact).subs(stress), 45)))


@few("law", [*STATEFUL, TwoStates(), law_of("slip-rate-weakening")], ids=lambda law: law.name, every=3)
def test_the_jacobian_is_that_of_finite_differences(law):
    draw = random.Random(law.name)
    with mpmath.workdps(50):
        for _ in range(4):
            number = random_plant(draw)
            expected = differences(*field_of(law, number))
            J = state_plant.jacobian(law.state_names)
            for i in range(J.rows):
                for j in range(J.cols):
                    assert (
                        abs(inserted(J[i, j], law, number) - expected[i, j])
                        <= abs(expected[i, j]) * mpmath.mpf(10) ** -15
                    )


def largest_real_part(J, *, inertia):
    """Of the eigenvalues of a Jacobian; without inertia after elimination of the rate from the balance of forces."""
    if not inertia:
        kept = [0, *range(2, J.rows)]
        J = mpmath.matrix([[J[i, j] - J[i, 1] * J[1, j] / J[1, 1] for j in kept] for i in kept])
    return max(mpmath.re(z) for z in mpmath.eig(J, left=False, right=False))


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [True, False])
@pytest.mark.parametrize("law", STATEFUL, ids=lambda law: law.name)
def test_eigenvalues_cross_where_the_critical_stiffness_says(law, inertia):
    draw = random.Random(7)
    critical = state_plant.critical_stiffness(law.symbolic(), inertia=inertia)
    crossed = 0
    with mpmath.workdps(50):
        while crossed < 5:
            number = random_plant(draw)
            at = inserted(critical, law, number)
            if at <= 0:
                continue
            crossed += 1
            for side in (-1, 1):
                beside = number | {k_hat: at * (1 + side * mpmath.mpf(10) ** -9)}
                worst = largest_real_part(differences(*field_of(law, beside)), inertia=inertia)
                assert (worst < 0) == (side > 0)


@pytest.mark.slow
@pytest.mark.parametrize(("inertia", "plants"), [(True, 18), (False, 40)])
def test_the_conditions_of_a_law_with_two_states_agree_with_its_eigenvalues(inertia, plants):
    """So many plants that every condition that ever fails alone does so."""
    law, draw, seen = TwoStates(), random.Random(3), set()
    conditions = state_plant.stability_conditions(law.state_names, inertia=inertia)
    with mpmath.workdps(50):
        for _ in range(plants):
            number = random_plant(draw)
            says = all(inserted(c, law, number) > 0 for c in conditions)
            worst = largest_real_part(differences(*field_of(law, number)), inertia=inertia)
            assert says == (worst < 0)
            seen.add(says)
    assert seen == {True, False}


@pytest.mark.parametrize("law", LOGARITHMIC, ids=lambda law: law.name)
def test_the_critical_stiffness_is_that_of_ruina_and_of_rice_and_ruina(law):
    a, b, d = (sp.Symbol(s, positive=True) for s in ("a", "b", "d_c"))
    stress = N_hat * (sigma - p)
    quasi = state_plant.critical_stiffness(law.symbolic(), inertia=False)
    full = state_plant.critical_stiffness(law.symbolic())
    ruina = stress * (b - a) / d
    assert sp.simplify(quasi.subs(eta_hat, 0) - ruina) == 0
    # Rice and Ruina (1983): the factor 1 + m v²/(σ a d_c) of inertia, per unit of mass
    assert sp.simplify(full.subs(eta_hat, 0) - ruina * (1 + loading_rate**2 / (stress * a * d))) == 0
    assert sp.simplify(quasi - ruina + eta_hat * loading_rate / d) == 0


@pytest.mark.parametrize("name", ["exponential-slip-weakening", "linear-slip-weakening"])
def test_slip_weakening_is_unstable_below_drop_over_critical_slip(name):
    drop, d, G = (sp.Symbol(s, positive=True) for s in (r"\Delta\mu", "d_c", "G"))
    law = law_of(name).symbolic()
    at_rest = {loading_rate: 0}
    assert sp.simplify(state_plant.critical_stiffness(law).subs(at_rest) - N_hat * (sigma - p) * drop / d) == 0
    assert sp.simplify(state_plant.nucleation_length(law) - G * d / (drop * (sigma - p))) == 0


def test_without_state_and_at_rest_it_is_the_shifted_plant():
    ours = state_plant.sliding_acceleration().subs(loading_rate, 0).subs(rate, plant.x2)
    assert sp.simplify(ours - plant.shifted_acceleration()) == 0
    assert sp.simplify(state_plant.jacobian() - plant.jacobian()) == sp.zeros(2)
    damping, stiffness = state_plant.stability_conditions()
    stress = {state_plant.effective_stress: sigma - p}
    limits = {c.args[0]: c.args[1] for c in plant.instability().args}
    assert sp.simplify(sp.expand(stiffness.subs(stress) - (k_hat - limits[k_hat]))) == 0
    assert sp.simplify(sp.expand(damping.subs(stress) - (eta_hat - limits[eta_hat]))) == 0


@pytest.mark.parametrize("law", STATEFUL, ids=lambda law: law.name)
def test_without_inertia_the_differential_equation_has_the_eigenvalues_of_the_constraint(law):
    # x1 is eliminated on one side, the rate on the other
    exact = {
        k_hat: 3,
        eta_hat: 2,
        N_hat: sp.Rational(1, 10**5),
        sigma: 10**7,
        p: 10**6,
        loading_rate: sp.Rational(1, 10**4),
    }
    rates = [sp.sympify(r).subs(exact) for r in state_plant.quasi_dynamic_rates(law.exact())]
    function = sp.lambdify((rate, THETA), rates, "mpmath")
    with mpmath.workdps(50):
        J = differences(function, [mpmath.mpf("1e-4"), mpmath.mpf("0.2")])
        for power, coefficient in ((1, -J[0, 0] - J[1, 1]), (2, J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0])):
            number = {s: mpmath.mpf(sp.Rational(x).p) / sp.Rational(x).q for s, x in exact.items()}
            leading, *rest = (inserted(c, law, number) for c in state_plant.characteristic(("theta",), inertia=False))
            assert abs(coefficient - rest[power - 1] / leading) < abs(coefficient) * mpmath.mpf(10) ** -12


def test_the_third_order_plant_rests_in_steady_sliding():
    for law in STATEFUL:
        rates = state_plant.third_order_rates(law.symbolic())
        quiet = [r.replace(plant.disturbance, lambda *_: sp.Integer(0)) for r in map(sp.sympify, rates)]
        at = {plant.x1: 0, rate: loading_rate, THETA: law.symbolic().steady_state(loading_rate)[0], p: 0}
        assert [sp.simplify(r.subs(at)) for r in quiet] == [0, 0, 0]


def test_with_state_the_error_dynamics_carry_it():
    derived = state_plant.error_dynamics(("theta",))
    friction = plant.mu(
        plant.e1 + plant.reference(plant.t), loading_rate + plant.e2 + plant.reference(plant.t).diff(plant.t), THETA
    )
    assert sp.simplify(derived.beta - N_hat * friction / plant.divisor) == 0
    assert THETA in derived.h.free_symbols
    assert state_plant.error_dynamics() is plant.error_dynamics()


@pytest.mark.parametrize("name", sorted(friction_laws()))
def test_no_derivation_takes_more_than_two_seconds(name):
    law = law_of(name).symbolic()
    for cached in (state_plant.jacobian, state_plant.characteristic, state_plant.stability_conditions):
        cached.cache_clear()
    begin = time.process_time()
    state_plant.instability(law)
    state_plant.nucleation_length(law)
    state_plant.third_order_rates(law)
    state_plant.quasi_dynamic_rates(law)
    assert time.process_time() - begin < 2


@pytest.mark.slow
def test_a_closed_critical_stiffness_needs_at_most_one_state():
    with pytest.raises(UnsupportedError, match="at most one state"):
        state_plant.critical_stiffness(TwoStates().symbolic())


def test_only_laws_that_do_not_depend_on_slip_slide_steadily():
    steady = {name: state_plant.is_steady(law_of(name).symbolic()) for name in friction_laws()}
    assert [name for name, is_steady in steady.items() if not is_steady] == [
        "exponential-slip-weakening",
        "linear-slip-weakening",
    ]
