"""Designs for disturbances of bounded rate, such as tides: a smaller class, so a smaller bound."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import task_of
from quakedesign.certificates.guarantee.files import parse_guarantee
from quakedesign.cli.design import DesignOptions
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance
from quakedesign.studies.comparison import Entry

REAL = qd.load_fault("real-fault")
ANY = parse_guarantee((Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_real-fault.json").read_text())


@pytest.fixture(scope="module")
def tide():
    patch = pytest.MonkeyPatch()
    for name in ("longest_step", "longest_delay"):  # how far other designs would go is another test's
        patch.setattr(f"quakedesign.synthesis.guaranteed.default_design.{name}", lambda *_, **__: None)
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
    assert later.guarantee.task == task_of(REAL, rate_limited=True)
    assert replace(later, disturbance_class="amplitude").guarantee.task == task_of(REAL)


@pytest.mark.parametrize("law", ["elqr", "cta"])
def test_a_push_that_is_there_at_once_has_no_rate_and_another_class_is_none(law):
    pushed = replace(REAL, disturbance=Disturbance(constant=1e-4, amplitude=1e-4, frequency=0.69))
    with pytest.raises(ParameterError, match="class rate needs a disturbance that starts at 0"):
        qd.design(pushed, law, disturbance_class="rate")
    with pytest.raises(ParameterError, match=r"class must be one of amplitude, rate\. .*Did you mean rate\?"):
        qd.design(REAL, law, disturbance_class="rates")


def test_the_option_of_design_compare_and_figures_is_that_of_python():
    assert DesignOptions(disturbance_class="rate").told(["cta"])["options"]["disturbance_class"] == "rate"
    assert DesignOptions().told(["cta"])["options"]["disturbance_class"] == "amplitude"
