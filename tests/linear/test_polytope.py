"""The error loop against the force balance itself, and coordinates that forget the units."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.laws import Signals, published
from quakedesign.linear.linear_problem import Polytope, modal_scaling, polytope_of
from quakedesign.linear.robust_stability import sector_loop
from quakedesign.lyapunov.exact.perturbation_bounds import sectors
from quakedesign.symbolic import plant
from quakedesign.symbolic.terms import Term


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.mark.parametrize("feedback", ["error", "state"])
def test_the_substitution_turns_the_force_balance_into_the_error_loop(feedback):
    # zeta and chi as documented; s is the chord of -(friction)(sigma - p*) - k about r, beta*b = mu*N
    t = plant.t
    gains = dict(zip(("k1", "k2", "k3", "k4"), (F(7), F(5), F(3), F(2)), strict=True))
    from quakedesign.laws.elqr import ExtendedLQR

    law = ExtendedLQR(gains=gains, feedback=feedback)
    e1, e2, xi1, xi2 = sp.symbols("e1 e2 xi1 xi2", real=True)
    r = sp.Function("r", real=True)(t)
    mu_r, mu_x, phi, growth = sp.symbols("mu_r mu_x phi g", positive=True)
    slip, rate = e1 + r, e2 + r.diff(t)
    signals = Signals(slip=slip, slip_rate=rate, slip_error=e1, slip_rate_error=e2, integrals=(xi1, xi2))
    p = law.pressure(signals)
    balance = plant.shifted_acceleration().replace(plant.disturbance, lambda *_: phi + growth * slip)
    acceleration = balance.replace(plant.mu, lambda *_: mu_x).subs({plant.x1: slip, plant.x2: rate, plant.p: p})
    error_acceleration = acceleration - r.diff(t, 2)
    rest = plant.shifted_acceleration().replace(plant.disturbance, lambda x, *_: growth * x)
    rest = rest.replace(plant.mu, lambda *_: mu_r).subs({plant.x1: r, plant.x2: 0})
    p_star = sp.solve(rest, plant.p)[0]

    of_slip, of_rate = {"error": (0, 0), "state": (7, 5)}[feedback]
    known = of_slip * r + of_rate * r.diff(t)
    zeta = 3 * xi1 + 2 * xi2 + known + p_star
    chord = -(mu_x - mu_r) * plant.N_hat * (plant.sigma - p_star) / e1 - plant.k_hat + growth
    strength = mu_x * plant.N_hat
    force = phi - r.diff(t, 2) - plant.eta_hat * r.diff(t)
    claimed = chord * e1 - plant.eta_hat * e2 - strength * (7 * e1 + 5 * e2 + zeta) + force
    assert sp.simplify(error_acceleration - claimed) == 0

    # zeta' = k3 e1 + chi + drift, chi' = k4 e1 + drift_rate along xi1' = e1, xi2' = xi1
    rates = dict(zip((xi1, xi2), law.integral_rates(signals), strict=True))
    chi = 2 * xi1 + known.diff(t)
    drift = p_star.diff(t)
    along_zeta = sum(zeta.diff(x) * v for x, v in rates.items()) + zeta.diff(t)
    assert sp.simplify(along_zeta - (3 * e1 + chi + drift)) == 0
    along_chi = sum(chi.diff(x) * v for x, v in rates.items()) + chi.diff(t)
    assert sp.simplify(along_chi - (2 * e1 + known.diff(t, 2))) == 0

    # the drift is -s_r r'/(beta_r b) with the slope s_r of friction at rest at r
    slope = sp.Symbol("m_s")
    friction = sp.Function("m")(r)
    moving = p_star.subs(mu_r, friction).diff(t).subs(friction.diff(r), slope)
    moving = moving.replace(lambda e: isinstance(e, sp.Subs), lambda _: slope).subs(friction, mu_r)
    s_r = -slope * plant.N_hat * (plant.sigma - p_star) - plant.k_hat + growth
    assert sp.simplify(moving + s_r * r.diff(t) / (mu_r * plant.N_hat)) == 0


def test_a_field_that_is_not_linear_is_refused():
    from quakedesign.laws import control_law
    from quakedesign.lyapunov import loop_of

    law = control_law("cta")
    loop = loop_of(
        "cta",
        law.loop_field(),
        gains=dict.fromkeys(law.gain_units, F(1)),
        uncertain={"beta": (F(1), F(1)), "d": (F(0), F(0))},
    )
    with pytest.raises(ParameterError, match="linear field"):
        polytope_of(loop)


@pytest.mark.parametrize(
    "term",
    [
        Term(F(1), (), (("e1", F(3), "s"),)),
        Term(F(1), (), (("e1", F(1), "s"), ("e2", F(1), "s"))),
        Term(F(1), (), (("e1", F(1), "a"),)),
        Term(F(1), (), ()),
    ],
    ids=["cube", "product", "modulus", "constant"],
)
def test_a_field_with_one_other_term_is_no_polytope(real, term):
    loop = sector_loop(published("real-fault")["elqr"], sectors(real))
    assert len(polytope_of(loop).vertices) > 1
    state = next(iter(loop.states))
    parts = tuple((s, *rest) for s, (_, *rest) in zip(loop.states, term.factors, strict=False))
    changed = replace(loop, field=dict(loop.field) | {state: (*loop.field[state], replace(term, factors=parts))})
    with pytest.raises(ParameterError, match="linear field"):
        polytope_of(changed)


def test_a_linear_field_on_cells_is_no_polytope(real):
    loop = sector_loop(published("real-fault")["elqr"], sectors(real))
    with pytest.raises(ParameterError, match="linear field"):
        polytope_of(replace(loop, domain="cells"))


def test_the_slowest_vertex_bounds_the_rate():
    one, two = ((F(-1), F(0)), (F(0), F(-2))), ((F(-3), F(0)), (F(0), F(-4)))
    assert Polytope(states=("x", "y"), vertices={"one": one, "two": two}).slowest() == pytest.approx(-1)


def test_modal_coordinates_do_not_depend_on_the_units_of_the_states(real):
    polytope = polytope_of(sector_loop(published("real-fault")["elqr"], sectors(real)))
    units = (F(1, 1000), F(1000), F(1, 64), F(7))
    other = Polytope(
        states=polytope.states,
        vertices={
            name: tuple(
                tuple(v * b / a for v, b in zip(row, units, strict=True)) for a, row in zip(units, M, strict=True)
            )
            for name, M in polytope.vertices.items()
        },
    )
    entry = np.array([0.0, 1.0, 0.0, 0.0])
    first = modal_scaling(polytope, [entry])
    second = modal_scaling(other, [entry / np.array([float(u) for u in units])])
    assert second.pace == pytest.approx(first.pace, rel=1e-9)
    for A, M in zip(first.matrices(polytope), second.matrices(other), strict=True):
        # the sign of an eigenvector is free, powers of two of the balancing may differ by one
        np.testing.assert_allclose(
            np.sort(np.abs(np.linalg.eigvals(A))), np.sort(np.abs(np.linalg.eigvals(M))), rtol=1e-6
        )
        np.testing.assert_allclose(np.abs(np.diag(A)), np.abs(np.diag(M)), rtol=1e-6)
