"""The derived model of one fault."""

from dataclasses import replace

import pytest
import sympy as sp

from quakedesign.fault import load_fault
from quakedesign.symbolic import derive, plant

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")


def test_the_real_fault_is_unstable_with_the_pole_of_the_errata():
    # λ² + 1.6λ + (0.48 − 8e-8·5e7·0.1/0.27635) = 0: λ = −0.8 ± √(0.64 + 0.967439…) = +0.468, −2.068
    model = derive(REAL)
    assert model.unstable
    first, second = model.eigenvalues
    assert first == pytest.approx(0.4679, abs=1e-4)
    assert second == pytest.approx(-2.0679, abs=1e-4)


def test_the_printed_conditions_would_call_it_stable():
    # ERRATA 2: read as "and", η < −mμ_x2 = 0 fails
    model = derive(REAL)
    values = model.values
    slip, rate = values[plant.slip_slope], values[plant.rate_slope]
    spring = values[plant.k_hat] < -values[plant.N_hat] * values[plant.sigma] * slip
    damping = values[plant.eta_hat] < -rate
    assert bool(spring)
    assert not bool(damping)
    assert len(model.reasons) == 1
    assert model.reasons[0].endswith("stiffness 0.48 < 1.447 1/s²")


def test_the_laboratory_fault_is_unstable_too():
    assert derive(LAB).unstable
    assert derive(LAB).eigenvalues[0].real > 0


def test_a_stable_fault_has_no_reasons():
    model = derive(replace(REAL, friction=replace(REAL.friction, drop=0.03)))
    # 8e-8·5e7·0.03/0.27635 = 0.434 < 0.48
    assert not model.unstable
    assert model.reasons == ()
    assert all(root.real < 0 for root in model.eigenvalues)


def test_a_complex_pair_is_conjugate():
    model = derive(replace(REAL, damping=1e13, friction=replace(REAL.friction, drop=0.0)))
    # λ² + 0.032λ + 0.48 = 0
    first, second = model.eigenvalues
    assert first == pytest.approx(complex(-0.016, (0.48 - 0.016**2) ** 0.5), rel=1e-12)
    assert second == first.conjugate()


def test_rest_slip_is_zero_exactly_for_stable_faults():
    for drop, unstable in ((0.03, False), (0.034, True)):
        fault = replace(REAL, friction=replace(REAL.friction, drop=drop))
        assert derive(fault).unstable is unstable
        assert (fault.rest_slip > 0) is unstable


def test_equations_are_shown_in_the_papers_symbols():
    text = derive(REAL)._repr_latex_()
    assert all(part in text for part in (r"\hat{k}", r"\hat{N}", r"\mu^{*}", r"\hat{\varphi}_e", "iff"))
    assert derive(REAL).acceleration.has(sp.exp)
    assert derive(REAL).error_dynamics == plant.error_dynamics()


def test_a_model_is_printed_as_its_equation_and_its_condition():
    """In a terminal and in a script, which show no LaTeX."""
    acceleration, unstable = str(derive(REAL)).splitlines()
    assert acceleration.startswith("x1'' = ")
    assert acceleration.count("\\hat{k}") == 1
    assert unstable.startswith("unstable without control if ")
    assert "<" in unstable
