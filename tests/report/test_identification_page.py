"""Figures of identified records: what each panel shows, in numbers."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from quakedesign.identification import identify
from quakedesign.report.identification_page import identification_figure, save_figure

SPECIFICATION = importlib.util.spec_from_file_location(
    "synthetic_of_figures", Path(__file__).parents[1] / "identification" / "synthetic.py"
)
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)


@pytest.fixture(scope="module")
def stepped():
    made = synthetic.sliding("rate-and-state-slip", synthetic.STEPS)
    return identify(made.noisy(0), "rate-and-state-slip", stiffness=made.stiffness)


def test_every_step_has_a_panel_and_the_rate_is_that_of_the_load_point(stepped):
    drawing = identification_figure(stepped)
    titles = [axis.get_title() for axis in drawing.axes if axis.get_title()]
    assert [float(title.split()[2]) for title in titles] == pytest.approx([20, 170, 195], abs=3)
    rate = next(axis for axis in drawing.axes if axis.get_ylabel() == "rate [µm/s]")
    assert set(np.round(rate.lines[0].get_ydata(), 1)) >= {1.0, 10.0, 3.0}


def test_the_correlation_is_one_at_no_lag_and_within_the_dashes_for_white_noise(stepped):
    drawing = identification_figure(stepped)
    (axis,) = [axis for axis in drawing.axes if axis.get_ylabel().startswith("autocorrelation")]
    for line in axis.lines[:2]:
        found = line.get_ydata()
        assert found[0] == 1
        assert np.mean(np.abs(found[1:]) < 2.5 / len(stepped.fit.whitened) ** 0.5) > 0.9


def test_the_region_touches_the_ellipse_of_the_slopes(stepped):
    """Its width is the deviation of each parameter times the root of the threshold for two."""
    drawing = identification_figure(stepped)
    (axis,) = [axis for axis in drawing.axes if axis.get_xlabel().startswith("direct_effect")]
    names = [c.name for c in stepped.fit.experiment.coordinates]
    far = stepped.fit.standard_errors * stepped.fit.threshold(2) ** 0.5
    a, b = (names.index(name) for name in ("direct_effect", "evolution_effect"))
    assert np.ptp(np.log(axis.lines[0].get_xdata())) == pytest.approx(2 * far[a], rel=0.01)
    assert np.ptp(axis.lines[0].get_ydata()) == pytest.approx(2 * far[b], rel=0.01)


def test_profiles_pass_the_thresholds_at_the_ends_of_the_intervals(stepped):
    """Of a, b, a - b and D_c; along a straight line between the points that were tried."""
    drawing = identification_figure(stepped)
    symbols = {"direct_effect": "a [$10^{-3}$]", "evolution_effect": "b [$10^{-3}$]", "critical_slip": "$D_c$ [µm]"}
    units = {"direct_effect": 1e3, "evolution_effect": 1e3, "critical_slip": 1e6}
    panels = {axis.get_xlabel(): axis for axis in drawing.axes}
    assert "a - b [$10^{-3}$]" in panels
    for name, label in symbols.items():
        told, (line, alone, jointly) = stepped.estimates[name], panels[label].lines
        value, distance = line.get_data()
        assert np.interp(told.value * units[name], value, distance) == pytest.approx(0, abs=1e-9)
        levels = [level.get_ydata()[0] for level in (alone, jointly)]
        assert levels == pytest.approx([stepped.fit.threshold(n) ** 0.5 for n in (1, len(stepped.fit.fitted))])
        for ends, level in (((told.low, told.high), levels[0]), ((told.least, told.most), levels[1])):
            assert np.interp(np.array(ends) * units[name], value, distance) == pytest.approx(level, rel=0.02)


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_a_record_of_slip_weakening_is_drawn_over_its_slip_in_every_format(kind, tmp_path):
    found = identify(synthetic.weakening().noisy(0), "exponential-slip-weakening")
    assert "slip [µm]" in {axis.get_xlabel() for axis in identification_figure(found).axes}
    save_figure(found, tmp_path / f"weak.{kind}")
    begins = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind]
    assert (tmp_path / f"weak.{kind}").read_bytes().startswith(begins)
