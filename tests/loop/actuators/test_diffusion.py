"""Diffusion between well and fault against its closed forms."""

import cmath
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quakedesign.loop import Diffusion

LAYER = {"length": 30.0, "diffusivity": 0.9, "storage": 2e-6}  # τ = 1000 s


def exact_step(time):
    """Pressure in the fault after a unit step at the well (images of the half space)."""
    return 2 * sum((-1) ** n * math.erfc((2 * n + 1) / (2 * math.sqrt(time))) for n in range(30))


def exact_volume(time):
    """Share of the storage that is filled: the integral of the flow, by its modes."""
    modes = ((2 * n + 1) * math.pi / 2 for n in range(200))
    return 1 - 2 * sum(math.exp(-(k**2) * time) / k**2 for k in modes)


def step_response(layer, times):
    """Pressure, volume and flow rate after a step of 1 Pa at the well."""
    numbers, inlet = layer.numbers, 1.0

    def rates(_, p):
        return layer.rates(numbers, list(p), inlet)

    cells = solve_ivp(rates, (0, times[-1]), np.zeros(layer.cells), "Radau", t_eval=times, rtol=1e-9, atol=1e-12).y
    flows = layer.flows(numbers, list(cells), inlet)
    return layer.output(numbers, list(cells), inlet), flows["injected_volume"], flows["flow_rate"]


def exact_response(layer, frequency):
    """Pressure in the fault [-] and volume over S [-] per pressure at the well, at a frequency [rad/s] above 0."""
    root = cmath.sqrt(1j * frequency * layer.time)
    grown = cmath.exp(-2 * root)
    return 2 * cmath.exp(-root) / (1 + grown), (1 - grown) / (1 + grown) / root


def response(layer, frequency):
    """The same of the cells."""
    phi = 2 * cmath.asinh(cmath.sqrt(1j * frequency * layer.time) / (2 * layer.cells))
    grown = cmath.exp(-2 * layer.cells * phi)
    volume = (1 - grown) / (1 + grown) / (layer.cells * cmath.sinh(phi))
    return 2 * cmath.exp(-layer.cells * phi) / (1 + grown), volume


@pytest.mark.parametrize("cells", [2, 4, 16])
def test_the_step_response_is_that_of_erfc_within_the_stated_error(cells):
    layer = Diffusion(**LAYER, cells=cells)
    times = layer.time * np.geomspace(1e-3, 5, 60)
    pressure, volume, _ = step_response(layer, times)
    expected = np.array([exact_step(t / layer.time) for t in times])
    assert np.max(np.abs(pressure - expected)) < 0.25 / cells**2
    filled = np.array([exact_volume(t / layer.time) for t in times])
    assert np.max(np.abs(volume / layer.storage - filled)) < 0.3 / cells


def test_the_flow_rate_fills_the_volume():
    layer = Diffusion(**LAYER, cells=8)
    times = np.linspace(0, 3 * layer.time, 4001)
    _, volume, flow = step_response(layer, times)
    assert volume[-1] - volume[10] == pytest.approx(np.trapezoid(flow[10:], times[10:]), rel=1e-3)
    assert volume[-1] == pytest.approx(layer.storage, rel=1e-3)


@pytest.mark.parametrize("frequency", [1e-5, 1e-3, 0.02])
def test_both_transfer_functions_are_the_closed_ones(frequency):
    layer = Diffusion(**LAYER, cells=6)
    root = mp.sqrt(1j * frequency * layer.time)
    closed = [complex(1 / mp.cosh(root)), complex(mp.tanh(root) / root)]
    assert exact_response(layer, frequency) == pytest.approx(closed)
    matrix = np.array([layer.rates(layer.numbers, list(row), 0.0) for row in np.eye(6)]).T
    inlet = np.array(layer.rates(layer.numbers, [0.0] * 6, 1.0))
    cells = np.linalg.solve(1j * frequency * np.eye(6) - matrix, inlet)
    assert response(layer, frequency) == pytest.approx([cells[-1], cells.mean()], rel=1e-9)


@pytest.mark.parametrize("cells", [1, 4, 16, 40])
def test_the_deviation_over_all_frequencies_is_as_stated(cells):
    layer = Diffusion(**LAYER, cells=cells)
    for frequency in np.geomspace(1e-3, 1e3 * cells**2, 400) / layer.time:
        pressure, volume = np.subtract(response(layer, frequency), exact_response(layer, frequency))
        assert abs(pressure) < 0.32 / cells**2
        assert abs(volume) < 0.22 / cells
