"""True parameters at run time must give what a fault with those parameters gives."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.fault.model import UncertaintyBox
from quakedesign.laws import published
from quakedesign.simulation import compiled as backend
from quakedesign.simulation import simulate
from quakedesign.simulation.closed_loop import Variation

REAL = dataclasses.replace(
    load_fault("real-fault"),
    box=UncertaintyBox(name="wide", stiffness=Fraction(1, 2), damping=Fraction(1, 2), authority=Fraction(1, 2)),
)
LAW = published("real-fault")["elqr"]


def same_motion(fault, **factors):
    """Runs of the nominal fault with factors and of another fault, both under one controller."""
    setting = {"step": 0.02, "duration": 60.0, "samples": 60}
    varied = simulate(REAL, LAW, variation=Variation(**factors), **setting)
    other = simulate(fault, LAW, **setting)
    scale = np.max(np.abs(other.slip))
    assert scale > 0
    assert np.max(np.abs(varied.slip - other.slip)) < 1e-9 * scale
    assert varied.energy.frictional == pytest.approx(other.energy.frictional, rel=1e-8)
    assert varied.energy.viscous == pytest.approx(other.energy.viscous, rel=1e-8)
    return varied


@pytest.mark.parametrize("plant", ["printed", "stick-slip"])
def test_ones_change_nothing(plant):
    runs = [simulate(REAL, LAW, duration=60.0, plant=plant, variation=variation) for variation in (None, Variation())]
    assert np.allclose(runs[0].slip, runs[1].slip, rtol=1e-9, atol=1e-12 * np.max(np.abs(runs[0].slip)))


@pytest.mark.slow
def test_less_damping():
    varied = same_motion(dataclasses.replace(REAL, damping=0.8 * REAL.damping), damping=0.8)
    assert varied.provenance["variation_damping"] == 0.8


@pytest.mark.slow
def test_less_weakening():
    """The drop is what changes; friction starts at its own static value."""
    friction = dataclasses.replace(REAL.friction, drop=0.6 * REAL.friction.drop)
    varied = same_motion(dataclasses.replace(REAL, friction=friction), weakening=0.6)
    assert varied.friction[0] == pytest.approx(REAL.friction.residual + 0.6 * REAL.friction.drop)
    assert varied.provenance["variation_weakening"] == 0.6


def test_stiffness_and_authority_change_the_acceleration_as_the_shifted_plant_says():
    from quakedesign.simulation.closed_loop import ClosedLoop

    slip, rate, p, k, N = 0.03, 1e-3, 2e6, 1.2, 0.9
    nominal, varied = ClosedLoop(REAL), ClosedLoop(REAL, factors=(k, 1.0, N, 1.0))
    found, base = (float(loop.plant(0, [slip, rate], p)[1]) for loop in (varied, nominal))
    law, stress = REAL.friction, REAL.effective_normal_stress
    mu = law.residual + law.drop * np.exp(-slip / law.critical_slip)
    push = REAL.authority * ((law.residual + law.drop) * stress - mu * (stress - p))
    assert found - base == pytest.approx((N - 1) * push - (k - 1) * REAL.specific_stiffness * slip, rel=1e-9)


def test_one_machine_code_serves_every_variation(monkeypatch):
    built = []
    compile_ = backend._compile.__wrapped__
    backend._compile.cache_clear()
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)

    def counted(*arguments):
        built.append(arguments)
        return compile_(*arguments)

    from functools import lru_cache

    monkeypatch.setattr(backend, "_compile", lru_cache(counted))
    runs = [simulate(REAL, LAW, duration=20.0, variation=Variation(weakening=w)) for w in (0.1, 0.4, 1.0)]
    if runs[0].provenance["backend"] == "compiled":
        assert len(built) == 1
    assert len({run.slip[-1] for run in runs}) == 3


def test_the_box_is_kept():
    with pytest.raises(ParameterError, match=r"stiffness of a variation must be 1 to 1 in the box 'paper'"):
        simulate(load_fault("real-fault"), LAW, duration=10.0, variation=Variation(stiffness=1.05))
    with pytest.raises(ParameterError, match="weakening"):
        simulate(REAL, LAW, duration=10.0, variation=Variation(weakening=1.1))
    with pytest.raises(ParameterError, match="authority"):
        simulate(REAL, LAW, duration=10.0, variation=Variation(authority=float("nan")))
