"""Designs for disturbances of bounded rate, such as tides: a smaller class, so a smaller bound."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import diags, vstack

import quakedesign as qd
from quakedesign.cli.design_commands import DesignOptions
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance
from quakedesign.guarantees import design_sampled_law, with_varying_gain, worst_tracking
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.search.worst_case import _steepest
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.studies.comparison import Entry

REAL = qd.load_fault("real-fault")
ANY = parse_guarantee((Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_real-fault.json").read_text())


@pytest.fixture(scope="module")
def tide():
    patch = pytest.MonkeyPatch()
    for name in ("longest_step", "longest_delay"):  # how far other designs would go is another test's
        patch.setattr(f"quakedesign.guarantees.search.default_designs.{name}", lambda *_, **__: None)
    yield qd.design(REAL, "elqr", disturbance_class="rate")
    patch.undo()


def test_a_design_is_proved_for_the_class_that_it_is_asked_for(tide):
    found = tide.guarantee
    assert (tide.verdict, found.check()) == (Verdict.PROVED, Verdict.PROVED)
    assert found.task.change == F("3.2e-4") * F("0.69")  # A·ω of the fault's sine
    assert found.claims.slip_rate_error < ANY.claims.slip_rate_error / 2
    assert "that starts at 0 and changes by at most 0.00022 m/s^3 (class rate)" in found.sentence()
    assert Entry(label="", origin="designed", design=tide, run=None).to_dict()["class"] == "rate"


def test_a_design_whose_proof_is_asked_for_later_is_judged_by_its_class(tide):
    later = replace(tide, runs=None)
    assert later.guarantee.task == uncertain_plant(REAL, rate_limited=True)
    assert replace(later, disturbance_class="amplitude").guarantee.task == uncertain_plant(REAL)


@pytest.mark.parametrize("law", ["elqr", "cta"])
def test_a_push_that_is_there_at_once_has_no_rate_and_another_class_is_none(law):
    pushed = replace(REAL, disturbance=Disturbance(constant=1e-4, amplitude=1e-4, frequency=0.69))
    with pytest.raises(ParameterError, match="class rate needs a disturbance that is 0 at t = 0"):
        qd.design(pushed, law, disturbance_class="rate")
    with pytest.raises(ParameterError, match=r"class must be one of amplitude, rate\. .*Did you mean rate\?"):
        qd.design(REAL, law, disturbance_class="rates")


def test_the_option_of_design_compare_and_figures_is_that_of_python():
    assert DesignOptions(disturbance_class="rate").arguments()["options"]["disturbance_class"] == "rate"
    assert DesignOptions().arguments()["options"]["disturbance_class"] == "amplitude"


def integrated(slopes, most):
    """φ at the beginning of every piece, and at the end."""
    return np.concatenate([[0.0], np.cumsum(slopes * most)])


def test_the_steepest_disturbance_is_that_of_a_linear_programme():
    """φ_{k+1} − φ_k = slope·most, |φ| ≤ 2 on levels 1/4 apart: the corners of the programme stand on them."""
    random, most = np.random.default_rng(5), np.full(60, 0.25)
    held, moved = random.normal(size=(60, 3)).cumsum(axis=0), random.normal(size=(60, 3))
    slopes = _steepest(held, moved, most, 2.0)
    for course in range(3):
        phi = integrated(slopes[:, course], most)
        assert np.abs(phi).max() <= 2
        worth = held[:, course] @ phi[:-1] + moved[:, course] @ slopes[:, course]
        along = np.r_[held[1:, course], 0] + (moved[:, course] - np.r_[moved[1:, course], 0]) / 0.25  # of φ_1 … φ_60
        change = diags([1.0, -1.0], [0, -1], shape=(60, 60))
        found = linprog(-along, vstack([change, -change]), np.full(120, 0.25), bounds=(-2, 2))
        assert worth == pytest.approx(-found.fun, rel=1e-9)


def test_the_steepest_disturbance_keeps_its_rate_in_short_pieces_too():
    most = np.tile([1.0, 0.3], 20)
    slopes = _steepest(np.ones((40, 1)), np.zeros((40, 1)), most, 2.0)
    assert np.abs(slopes).max() <= 1
    assert integrated(slopes[:, 0], most).max() == pytest.approx(2)
    assert not _steepest(np.ones((4, 1)), np.ones((4, 1)), np.zeros(4), 2.0).any()
    assert not _steepest(np.ones((4, 1)), np.ones((4, 1)), np.ones(4), 0.0).any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("objective", "most"), [("tracking", (1.15, 1.6)), pytest.param("peak", (1.55, 1.35), marks=pytest.mark.slow)]
)
def test_the_worst_found_is_near_what_is_proved_of_the_class_rate(objective, most):
    """For the smallest peak a search that takes the disturbance by the sign of its costate stays at 1.62."""
    claim = design_sampled_law(uncertain_plant(REAL, rate_limited=True), F("0.184"), objective=objective)
    found, claims = worst_tracking(with_varying_gain(claim)), with_varying_gain(claim).claims
    assert found.slip_error <= claims.slip_error <= most[0] * found.slip_error
    assert found.slip_rate_error <= claims.slip_rate_error <= most[1] * found.slip_rate_error
