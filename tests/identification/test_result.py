"""What is said at the thresholds of what a record tells, with results made by hand."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law
from quakedesign.identification.assessment import Assessment, Check
from quakedesign.identification.experiment import Coordinate, Experiment
from quakedesign.identification.fitting import Fit, Profile
from quakedesign.identification.identification_result import (
    Identification,
    OtherLaw,
    Outlier,
    ParameterEstimate,
    estimate,
)
from quakedesign.identification.record import Record

LAW = friction_law("exponential-slip-weakening")(residual=0.4, drop=0.17, critical_slip=2.5e-3)


@dataclass(frozen=True)
class Level(Experiment):
    """Friction that is the logarithm of `drop` plus `residual`, at every sample."""

    samples: int
    law = LAW
    coordinates = (
        Coordinate(name="drop", unit="", low=0.01, high=10.0, start=(0.1, 1.0)),
        Coordinate(name="residual", unit="", low=-1.0, high=1.0, start=(0.0, 1.0), logarithmic=False),
    )

    def friction(self, fitted):
        return np.full(self.samples, float(sum(fitted)))

    def slopes(self, _fitted):
        return np.ones((self.samples, 2))


def made(values=(0.5, -0.5, 0.25, -0.25, 0.0), *, used=(True,) * 5):
    return Fit(
        experiment=Level(len(values)),
        fitted=np.array([math.log(2.0), -math.log(2.0)]),
        measured=np.array(values),
        counts=np.array([1.0, 2.0, 1.0, 2.0, 1.0]),
        used=np.array(used),
        agreeing=2,
        starts=4,
    )


def told(name="drop", *, low=1.0, high=3.0, least=0.5, most=4.0, unit=""):
    return ParameterEstimate(name=name, unit=unit, value=2.0, low=low, high=high, least=least, most=most)


def identification(fit=None, *, estimates=None, difference=None, rival=None, law=LAW):
    record = Record(
        name="made",
        time=10.0 + np.arange(6),
        friction=np.zeros(6),
        load_point=None,
        slip=np.arange(6.0),
        normal=np.ones(6),
        normal_unit="",
    )
    return Identification(
        record=record,
        fit=fit or made(),
        used=np.arange(6) > 0,
        estimates=estimates or {"drop": told()},
        difference=difference,
        law=law,
        notes=("taken",),
        seed=3,
        rival=rival,
    )


def test_the_box_of_all_holds_the_ends_of_each():
    """e to the ends; a joint region that came out smaller than one of its sides is widened to it."""
    wide = estimate(Profile(made(), 0), (0.0, 1.0), (-1.0, 2.0))
    ends = [wide.low, wide.high, wide.least, wide.most]
    assert ends == pytest.approx([1.0, math.e, math.exp(-1), math.exp(2)], rel=1e-15)
    assert (wide.name, wide.unit, wide.value) == ("drop", "", pytest.approx(2.0, rel=1e-15))
    tight = estimate(Profile(made(), 0), (0.0, 1.0), (0.25, 0.75))
    assert (tight.least, tight.most) == (tight.low, tight.high) == (1.0, math.e)
    open_ = estimate(Profile(made(), 0), (-math.inf, math.inf), (-math.inf, math.inf))
    assert (open_.low, open_.high, open_.identified) == (-math.inf, math.inf, False)
    straight = estimate(Profile(made(), 1), (-1.0, math.inf), (-math.inf, math.inf))
    assert (straight.low, straight.high, straight.least) == (-1.0, math.inf, -math.inf)


@pytest.mark.parametrize("end", ["low", "high", "least", "most"])
def test_one_end_that_is_not_set_leaves_a_parameter_untold(end):
    found = told(**{end: math.inf})
    assert told().identified
    assert not found.identified
    assert found.to_dict().get(end, "joint") == (None if end in ("low", "high") else "joint")
    assert identification().identified
    assert not identification(estimates={"drop": found, "residual": told("residual")}).identified


def test_residuals_of_more_than_twice_the_noise_are_not_explained():
    for factor, verdict in ((2.0, "explains the record"), (math.nextafter(2.0, 3), "does not explain the record")):
        found = replace(identification(), assessment=Assessment(checks=(), factor=factor))
        assert found.assessment.verdict == verdict
        assert found.explained == found.identified == (factor == 2.0)
        assert found.determined
    doubtful = replace(identification(), assessment=Assessment(checks=(), factor=1.0, open=("sign",)))
    assert (doubtful.assessment.verdict, doubtful.explained, doubtful.identified) == ("cannot tell", False, True)


def test_an_aic_higher_by_more_than_ten_tells_laws_apart():
    assert "hardly distinguishes" in str(OtherLaw(law="x", squares=1.5, excess=10.0))
    assert "hardly distinguishes" not in str(OtherLaw(law="x", squares=1.5, excess=math.nextafter(10.0, 11)))


def test_a_set_on_the_edge_of_the_region_is_allowed_and_one_beyond_is_not(monkeypatch):
    found = identification()
    edge = found.fit.threshold(2)
    for distance, allowed in ((edge, True), (math.nextafter(edge, math.inf), False)):
        monkeypatch.setattr(Fit, "distance", lambda _, __, d=distance: d)
        assert found.allows({"drop": 2.0, "residual": 0.1}) is allowed
    with pytest.raises(ParameterError, match="Received no drop, residual"):
        found.allows({"critical_slip": 1.0})


def test_outliers_are_told_at_their_times_largest_first():
    found = identification(made((0.1, 9.0, 0.0, -20.0, 0.1), used=(True, False, True, False, True)))
    assert found.outliers == (Outlier(time=14.0, size=-20.0), Outlier(time=12.0, size=9.0))
    assert found.to_dict()["outliers"] == [
        {"time": 14.0, "time_unit": "s", "size": -20.0, "size_unit": ""},
        {"time": 12.0, "time_unit": "s", "size": 9.0, "size_unit": ""},
    ]


def test_what_is_not_told_is_said_with_the_end_that_is():
    ends = {"low": -math.inf, "high": math.inf, "least": -math.inf, "most": math.inf}
    estimates = {
        "a": told("a", high=math.inf, most=math.inf),
        "b": told("b", low=0.0, least=-math.inf, unit="m"),
        "c": told("c", **ends),
        "d": told("d"),
    }
    above, below, nothing = identification(estimates=estimates).undetermined()
    assert above == "a is not identifiable from this record: at least 0.5, without an upper end"
    assert below == "b is not identifiable from this record: at most 4 m, without a lower end"
    assert nothing == "c is not identifiable from this record: any value fits equally well"
    (joint,) = identification(estimates={"e": told("e", most=math.inf)}).undetermined()  # alone it lies in (1, 3)
    assert joint == "e is not identifiable from this record: at least 0.5, without an upper end"
    between = told("a - b", unit="m")
    (both, other) = identification(estimates=estimates, difference=between).undetermined()
    assert both == "a and b are not identifiable from this record: only a - b = 2 m (1 to 3) is"
    assert other == nothing
    assert len(identification(estimates=estimates, difference=told("a - b", **ends)).undetermined()) == 3
    pair = {name: estimates[name] for name in "ab"}
    assert identification(estimates=pair, difference=told("a - b")).undetermined() == [both.replace("2 m", "2")]
    one = identification(estimates=estimates | {"b": told("b")}, difference=between).undetermined()
    assert one == [above, nothing]
    assert identification().undetermined() == []


def test_what_to_try_leaves_out_what_was_tried():
    state = friction_law("rate-and-state-aging")(
        **{name: 1e-3 for name in ("direct_effect", "evolution_effect", "critical_slip")},
        reference_coefficient=0.6,
        reference_rate=1e-6,
        slowest_rate=1e-9,
        fastest_rate=1e-3,
    )
    assert "another --law" in identification().to_try()
    assert "no --law, which fits both laws with a state" in identification(law=state).to_try()
    rival = OtherLaw(law="x", squares=2.0, excess=30.0)
    assert len(identification(law=state, rival=rival).to_try()) == 3
    measured = identification(estimates={"stiffness": told("stiffness", unit="Pa/m")}, rival=rival).to_try()
    assert measured[1] == "--stiffness of the machine, if it was measured"


def test_the_file_of_a_result_has_its_numbers():
    fit = made(used=(True, True, True, True, False))
    found = identification(fit, estimates={"drop": told(least=-math.inf)}, difference=told("drop - x")).to_dict()
    assert found["residual"] == {
        "noise": fit.noise,
        "unit": "",
        "samples": 4,
        "correlation": fit.correlation,
        "correlated": None,
    }
    assert (found["measurements"], found["rival"], found["box"]) == (7, None, {"drop": [None, 4.0]})
    assert found["starts"] == {"seed": 3, "searches": 4, "agreeing": 2}
    assert list(found["chosen"]) == ["residual", "critical_slip"]
    assert found["chosen"]["critical_slip"] == {"value": 2.5e-3, "unit": "m"}
    assert (found["identified"], found["assumptions"]) == (False, ["taken"])
    assert found["difference"]["of"] == "drop - x"
    assert found["parameters"]["drop"] == {"value": 2.0, "low": 1.0, "high": 3.0, "unit": "", "identified": False}
    assert identification(rival=OtherLaw(law="x", squares=2.0, excess=3.0)).to_dict()["rival"] == {
        "law": "x",
        "squares": 2.0,
        "excess": 3.0,
    }


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("stiffness",), ["--stiffness"]),
        (("evolution_effect",), ["ten samples within"]),
        (("direct_effect", "critical_slip"), ["ten samples within", "longer sliding after"]),
        (("second_slip",), ["longer sliding after"]),
        (("second_effect",), ["longer sliding after"]),
        (("drop",), ["slip from rest"]),
        (("residual",), ["slip from rest"]),
        (("trend",), []),
    ],
)
def test_what_is_open_has_an_experiment_that_tells_it(names, said):
    found = identification(estimates={name: told(name, low=-math.inf) for name in names})
    for experiment, words in zip(found.experiments(), said, strict=True):
        assert words in experiment
    sign = Check(name="sign", passed=False, value=0.0, limit=0.0, sentence="open")
    assert ["before the step" in each for each in found.experiments(sign)].count(True) == 1
    assert found.experiments(replace(sign, passed=True)) == found.experiments()
