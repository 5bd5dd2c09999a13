"""A design is for the delay, lag and rock that it is told of: searched, judged, run and compared behind them."""

from fractions import Fraction as F
from unittest.mock import Mock

import pytest

import quakedesign as qd
from quakedesign.cli.design_commands import DesignOptions
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.guarantees import SampledLoop, guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.default_designs import SampledDesign
from quakedesign.laws import ErrorModel, disturbance_estimate
from quakedesign.plant import uncertain_plant
from quakedesign.report.comparison_table import designed_comparison
from quakedesign.studies import comparison
from quakedesign.synthesis import state_feedback

REAL = qd.load_fault("real-fault")
LAW = disturbance_estimate(
    (F(672300000), F(206000000)),
    F("0.57"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), F("2.282e-8")),
)
LAG = F(1, 50)
CLAIM = guarantee(uncertain_plant(REAL), SampledLoop(law=LAW, step=F(23, 125), lag=LAG))


@pytest.fixture
def asked(monkeypatch):
    """What the search is asked, which answers at once with a law behind a lag."""
    told = []

    def search(task, step, objective, **around):
        told.append(around)
        return SampledDesign(step=step, runs=CLAIM, reason="", longest_step=step, longest_delay=F(0))

    monkeypatch.setattr(state_feedback, "sampled_design", search)
    return told


def test_a_design_knows_what_stands_between_law_and_fault(asked):
    design = qd.design(REAL, "elqr", lag="0.02", delay=F(1, 100), diffusion=0.5, slip_noise="1e-7")
    setup = ExactSetup(delay=F(1, 100), lag=LAG, diffusion=F(1, 2), slip_noise=F(1, 10**7))
    assert asked == [{"measured": "slip-and-rate", "setup": setup}]
    assert design.setup.path == {"delay": F(1, 100), "lag": LAG, "diffusion": F(1, 2)}
    assert design.controller.sampling.path == {"delay": 0, "lag": LAG, "diffusion": 0}
    assert (design.guarantee, str(design.verdict), design.details["lag"]) == (CLAIM, "proved", "1/50")


def test_nothing_is_searched_beyond_what_any_controller_can_do(asked):
    design = qd.design(REAL, "elqr", delay="1000")
    assert (asked, design.controller) == ([], None)
    assert "no controller" in design.details["reason"]


def test_it_is_compared_behind_its_path_without_what_acts_at_once(asked, monkeypatch):
    runs = []
    monkeypatch.setattr(comparison, "natural_earthquake", lambda fault, **more: Mock(spec=qd.Trajectory))
    monkeypatch.setattr(comparison, "simulate", lambda fault, law, **more: runs.append(law))
    monkeypatch.setattr(comparison, "_guarantee_of", lambda *_, given: None)
    design = qd.design(REAL, "elqr", lag=LAG)
    found = qd.compare(REAL, [design])
    assert ([entry.origin for entry in found.entries], runs) == (["designed"], [design.controller])
    assert found.path == {"lag": LAG}
    assert set(found.left_out) == {"cta", "dia"}
    assert "assume a pressure without delay" in found.left_out["cta"]
    found = designed_comparison(REAL, ["elqr"], lambda *_: None, options={"setup": qd.LoopSetup(lag=LAG)})
    assert [entry.origin for entry in found.entries] == ["designed"]


def test_the_command_designs_the_e_lqr_alone_behind_a_path():
    assert DesignOptions().problem("real-fault")[1]["names"] == ["cta", "dia", "elqr"]
    for more in ({"lag": "0.02"}, {"delay": "0.1"}, {"diffusion": "2"}):
        asked = DesignOptions(**more).problem("real-fault")[1]
        assert (asked["names"], asked["options"]["setup"]) == (["elqr"], qd.LoopSetup(**more))
    assert DesignOptions(lag="0.02", controller="cta").problem("real-fault")[1]["names"] == ["cta"]


@pytest.mark.parametrize(
    ("fault", "law", "more", "error", "said"),
    [
        (
            "real-fault",
            "cta",
            {"lag": "0.02"},
            UnsupportedError,
            "sliding modes are designed without delay, lag and diffusion path",
        ),
        (
            "real-fault",
            "elqr",
            {"lag": "0.02", "continuous": True},
            ParameterError,
            "and no delay, lag or diffusion path",
        ),
        ("real-fault", "elqr", {"lag": -1}, ParameterError, "lag must be 0 or more. Received -1 s"),
        ("crustal-patch", "elqr", {"lag": 1}, ParameterError, "has no delay or lag, only a diffusion path"),
        ("crustal-patch", "elqr", {"delay": 1}, ParameterError, "has no delay or lag, only a diffusion path"),
    ],
)
def test_what_no_design_knows_is_refused(fault, law, more, error, said):
    with pytest.raises(error, match=said):
        qd.design(qd.load_fault(fault), law, **more)
