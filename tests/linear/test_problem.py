"""Scaling: the same fault in other units gives the same design."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from own.printed_theorem import inverse_optimality
from scipy.linalg import eigvalsh, solve_continuous_lyapunov

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, Reference
from quakedesign.linear.linear_problem import LinearProblem, decreases, definite, lyapunov, rounded, times
from quakedesign.linear.riccati import riccati_design
from quakedesign.linear.sampled_stability import HeldPoles
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors

YEAR = 31557600.0
UNITS = {
    "km, years, tonnes": (1e3, YEAR, 1e3),
    "mm, ms, g": (1e-3, 1e-3, 1e-3),
    "feet, days, lb": (0.3048, 86400.0, 0.45359237),
}


def in_units(fault, metre, second, kilogram):
    """The same fault with its numbers in units of so many metres, seconds, kilograms."""
    pascal = kilogram / metre / second**2
    d, law = fault.disturbance, fault.friction
    return replace(
        fault,
        density=fault.density * metre**3 / kilogram,
        shear_modulus=fault.shear_modulus / pascal,
        length=fault.length / metre,
        damping=fault.damping * second / kilogram,
        effective_normal_stress=fault.effective_normal_stress / pascal,
        friction=replace(law, critical_slip=law.critical_slip / metre),
        reference=Reference(
            target_slip=fault.reference.target_slip / metre, operation_time=fault.reference.operation_time / second
        ),
        sampling_time=fault.sampling_time / second,
        disturbance=Disturbance(
            amplitude=d.amplitude * second**2 / metre,
            frequency=d.frequency * second,
            slip_growth=d.slip_growth * second**2,
            rate_growth=d.rate_growth * second,
        ),
    )


def gains_in_si(gains, metre, second, kilogram):
    pascal = kilogram / metre / second**2
    per = (pascal / metre, pascal * second / metre, pascal / metre / second, pascal / metre / second**2)
    return np.array([float(k) * u for k, u in zip(gains, per, strict=True)])


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("preset", [pytest.param("real-fault", marks=pytest.mark.slow), "lab-fault"])
def test_designs_do_not_depend_on_the_units(preset, name):
    fault = qd.load_fault(preset, box="ten-percent").with_disturbance(
        Disturbance(amplitude=1e-4, frequency=0.5, slip_growth=1e-3, rate_growth=1e-2)
    )
    other, units = in_units(fault, *UNITS[name]), UNITS[name]
    here, there = riccati_design(fault), riccati_design(other)
    assert gains_in_si(there.K, *units) == pytest.approx(here.K, rel=1e-9)
    assert there.split == here.split
    assert np.sort_complex(there.E) / units[1] == pytest.approx(np.sort_complex(here.E), rel=1e-9)
    assert there.fastest_pole / units[1] == pytest.approx(here.fastest_pole, rel=1e-9)


def test_verdicts_and_radii_do_not_depend_on_the_units():
    fault, units = qd.load_fault("lab-fault"), UNITS["km, years, tonnes"]
    gains = [float(k) for k in qd.published("lab-fault")["elqr"].gains.values()]
    one, second = LinearProblem.of(fault), units[1]
    two = LinearProblem.of(in_units(fault, *units))
    there = [F(float(k)) for k in np.array(gains) / gains_in_si([1, 1, 1, 1], *units)]
    here = [F(k) for k in gains]
    assert inverse_optimality(one, here).verdict is inverse_optimality(two, there).verdict
    for step in (1e-3, 0.5e-3):
        period = F(step) / F(second)
        first, again = HeldPoles(one, here), HeldPoles(two, there)
        assert (first.unstable(F(step)) is None) == (again.unstable(period) is None)
        assert first.radius(F(step)) == pytest.approx(again.radius(period), rel=1e-9)


def test_scaling_is_undone_exactly():
    problem = LinearProblem.of(qd.load_fault("real-fault", box="ten-percent"))
    scales = problem.scales("0.785")
    gains = (F(3), F(1, 7), F("1e9"), F(-2))
    assert scales.gains_outside(scales.gains_inside(gains)) == gains
    form = tuple(tuple(F(i + j, 1 + i + j) for j in range(4)) for i in range(4))
    assert scales.form_outside(scales.form_inside(form)) == form
    inside = problem.nondimensional(scales)
    assert inside.sectors.authority == 1
    assert float(inside.stiffness) == pytest.approx(1, rel=1e-12)
    # g1 in Pa/m over the unit of pressure per unit of slip
    assert inside.bounds[0] == problem.bounds[0] * scales.slip / scales.pressure
    low, high = problem.sectors.rate
    assert low < high
    assert inside.sectors.rate == (low * scales.time, high * scales.time)
    assert inside.sectors.largest_effective_stress == problem.sectors.largest_effective_stress / scales.pressure
    assert problem.scales() == problem.scales(1)


def test_a_loop_and_its_twin_have_the_same_poles():
    problem = LinearProblem.of(qd.load_fault("lab-fault"))
    scales = problem.scales("0.0071")
    gains = tuple(qd.published("lab-fault")["elqr"].gains.values())
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    for a, b in zip(problem.vertices(), inside.vertices(), strict=True):
        poles = [
            np.sort_complex(np.linalg.eigvals(np.array(m, dtype=float)))
            for m in (problem.loop(a, gains), inside.loop(b, K))
        ]
        assert poles[1] / float(scales.time) == pytest.approx(poles[0], rel=1e-6)
    assert HeldPoles(problem, gains).radius(F("5e-4")) == pytest.approx(
        HeldPoles(inside, K).radius(F("5e-4") / scales.time), rel=1e-9
    )


def test_an_authority_that_is_not_the_least_is_refused():
    problem = LinearProblem.of(qd.load_fault("real-fault"))
    for change in ({"beta": (F(9, 10), F(3, 2))}, {"authority": F(0)}, {"authority": F(-1)}):
        with pytest.raises(ParameterError, match="the smallest in the range: beta >= 1"):
            replace(problem, sectors=replace(problem.sectors, **change))


def unit_problem(**ranges):
    """b = 1 and the nominal plant k̂ = η̂ = 1."""
    given = {"beta": (F(1), F(1)), "slip": (F(-1), F(-1)), "rate": (F(1), F(1))} | ranges
    sectors = Sectors(authority=F(1), row_bounds=(F(0), F(0)), largest_effective_stress=F(1), **given)
    return LinearProblem(stiffness=F(1), damping=F(1), sectors=sectors)


def test_the_nominal_plant_has_both_integrals_and_no_feedback():
    assert unit_problem().nominal() == ((0, 1, 0, 0), (-1, -1, 0, 0), (1, 0, 0, 0), (0, 0, 1, 0))


def exact_form(problem, gains, vertex):
    """Θ with AᵀΘ + ΘA = −1 at a vertex, rounded."""
    A = np.array(problem.loop(vertex, gains), dtype=float)
    return rounded(solve_continuous_lyapunov(A.T, -np.eye(4)))


def test_a_form_decreases_as_fast_as_its_generalised_eigenvalues_say():
    problem, gains = unit_problem(beta=(F(1), F(2)), slip=(F(-1), F(1, 10))), (F(20), F(8), F(15), F(5))
    form = exact_form(problem, gains, problem.vertices()[0])
    theta, rates = np.array(form, dtype=float), []
    for vertex in problem.vertices():
        A = np.array(problem.loop(vertex, gains), dtype=float)
        rates.append(eigvalsh(-(A.T @ theta + theta @ A), 2 * theta).min())
    fastest = min(rates)
    assert fastest > 0
    assert decreases(problem, gains, form)
    assert decreases(problem, gains, form, rate=F(fastest * 0.999))
    assert not decreases(problem, gains, form, rate=F(fastest * 1.001))


def test_a_form_that_is_not_positive_proves_nothing_though_it_decreases():
    problem, gains = unit_problem(), (F(-20), F(8), F(15), F(5))
    (vertex,) = problem.vertices()
    assert np.linalg.eigvals(np.array(problem.loop(vertex, gains), dtype=float)).real.max() > 0
    form = exact_form(problem, gains, vertex)
    assert definite(times(-1, lyapunov(problem.loop(vertex, gains), form)))
    assert not decreases(problem, gains, form)
