"""Runs that grow, against the exactly known region of super-twisting."""

import importlib.util
from pathlib import Path

import pytest

from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.lyapunov.search.infeasibility import escape

SPECIFICATION = importlib.util.spec_from_file_location(
    "escape_region", Path(__file__).with_name("super_twisting_region.py")
)
region = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(region)


@pytest.mark.slow
@pytest.mark.parametrize(("k1", "k2", "L"), [("0.4", "1.5", "1"), ("0.3", "1.05", "0.9"), ("1", "0.8", "1")])
def test_a_run_grows_where_the_gains_are_known_not_to_stabilise(k1, k2, L):
    assert region.contraction(float(k1), float(k2), float(L)) > 1.3
    found = escape(closed_loop("super-twisting", (k1, k2), lipschitz=L), steps=3000)
    assert found is not None
    assert found.growth > 1
    assert found.strategy.startswith("beta follows e1·e1', d follows ")


@pytest.mark.parametrize(("k1", "k2", "L"), [("1.5", "1.1", "1"), ("0.7", "2", "1"), ("0.3", "1.5", "0")])
def test_none_grows_where_they_stabilise(k1, k2, L):
    assert region.contraction(float(k1), float(k2), float(L)) < 1
    assert escape(closed_loop("super-twisting", (k1, k2), lipschitz=L)) is None


@pytest.mark.slow
def test_an_uncertain_coefficient_is_played_with_too():
    gains = ("0.9", "2")
    assert escape(closed_loop("super-twisting", gains, lipschitz="0.6"), steps=3000) is None
    assert region.contraction(0.9, 2.0, 0.6, 0.3, 4.0) > 1.3
    wide = closed_loop("super-twisting", gains, lipschitz="0.6", gain_range=("0.3", "4"))
    assert escape(wide, steps=3000) is not None


@pytest.mark.slow
def test_nested_powers_are_followed():
    assert escape(closed_loop("dia", ("1", "20", "1", "0"), lipschitz="0.3"), steps=1500) is None
    assert escape(closed_loop("dia", ("1", "-2", "1", "0"), lipschitz="0.3"), steps=1500) is not None
