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
    rate = next(axis for axis in drawing.axes if axis.get_ylabel() == "rate [um/s]")
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
    far = stepped.fit.deviations * stepped.fit.threshold(2) ** 0.5
    a, b = (names.index(name) for name in ("direct_effect", "evolution_effect"))
    assert np.ptp(np.log(axis.lines[0].get_xdata())) == pytest.approx(2 * far[a], rel=0.01)
    assert np.ptp(axis.lines[0].get_ydata()) == pytest.approx(2 * far[b], rel=0.01)


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_a_record_of_slip_weakening_is_drawn_over_its_slip_in_every_format(kind, tmp_path):
    found = identify(synthetic.weakening().noisy(0), "exponential-slip-weakening")
    assert "slip [µm]" in {axis.get_xlabel() for axis in identification_figure(found).axes}
    save_figure(found, tmp_path / f"weak.{kind}")
    begins = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind]
    assert (tmp_path / f"weak.{kind}").read_bytes().startswith(begins)
