"""SEAS BP6-QD-A as a chain of blocks: the published run, the closed form of the pressure, and finer blocks."""

import bp6
import numpy as np
import pytest


def test_pressure_of_the_chain_is_the_closed_form():
    """At the places of the blocks, of an infinite fault, while injection lasts and after it."""
    found = bp6.injection(200.0, duration=120 * bp6.DAY)
    times = [day * bp6.DAY for day in (30, 99, 119)]
    here = np.array([[found.at(time, z)[2] for z in (0.0, 400.0, 1600.0)] for time in times])
    wanted = np.array([[bp6.pressure(z, time) for z in (0.0, 400.0, 1600.0)] for time in times])
    assert np.abs(here - wanted).max() < 0.02 * wanted.max()


def test_the_stiffness_is_that_of_slip_in_a_whole_space():
    """Uniform slip on |z| ≤ c takes Gc/π/(c² − z²) per unit of slip; slip of all of the fault takes little."""
    z, sliders = bp6.blocks(100.0)
    slip = (z <= 1000).astype(float)
    c = 1050.0
    wanted = bp6.SHEAR_MODULUS * c / np.pi / (c**2 - z**2)
    assert sliders.stiffness @ slip == pytest.approx(wanted, rel=1e-9)


def apart(found):
    """Largest differences from the published run: of slip, relative, of log10 of the slip rate, of pressure [MPa]."""
    pairs = [(found.at(row["time"], row["place"]), row) for row in bp6.published()]
    differences = [
        (abs(slip / row["slip"] - 1), abs(rate - row["rate"]), abs(pressure - row["pressure"]))
        for (slip, rate, pressure), row in pairs
    ]
    return np.array(differences).max(axis=0)


@pytest.mark.slow
def test_a_chain_of_blocks_of_50_m_gives_the_published_run():
    """Slip within 5 %, rate within 2.2 %, pressure within 2 kPa; half of the length of blocks takes half of it away."""
    coarse, fine = apart(bp6.injection(100.0)), apart(bp6.injection(50.0))
    assert (fine < [0.05, 0.0095, 0.002]).all()
    assert (fine[:2] < 0.6 * coarse[:2]).all()


@pytest.mark.slow
def test_a_tighter_tolerance_gives_the_same():
    usual, tight = (bp6.injection(200.0, duration=102 * bp6.DAY, rtol=rtol) for rtol in (1e-6, 1e-10))
    for day in (20, 60, 99):
        here, wanted = (run.at(day * bp6.DAY, 0.0) for run in (usual, tight))
        assert here == pytest.approx(wanted, rel=1e-3)
