"""Limits of a fault: both sides, what is searched for, and what is said."""

import dataclasses
import json
from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import Disturbance
from quakedesign.guarantees import Claims, NoProof, SampledLoop, TrackingProof
from quakedesign.guarantees.exact.limit_theorems import longest_reaction
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.linear_design import Longest
from quakedesign.laws import summed_integrals
from quakedesign.plant import uncertain_plant
from quakedesign.report.limits_table import limits_figure, limits_lines
from quakedesign.studies import limits as study
from quakedesign.studies.fault_facts import beyond_control

REAL = qd.load_fault("real-fault")
LAW = summed_integrals((F(1), F(1), F(1), F(1)), F(1))
CLAIMS = Claims(
    slip_error=UpperBound(F(1, 10**4)),
    slip_rate_error=UpperBound(F(2, 10**4)),
    peak_slip_rate=UpperBound(F(2, 10**4)),
    least_pressure=LowerBound(-(10**7)),
    largest_pressure=UpperBound(10**7),
)


@pytest.fixture(autouse=True)
def _natural_peak(monkeypatch):
    monkeypatch.setattr("quakedesign.studies.performance_limits.natural_peak", lambda fault: 0.25)


@pytest.fixture
def designs(monkeypatch):
    """Designs that have a guarantee up to a longest T_s and a longest delay; the pairs that were asked for."""
    asked, tellings, longest = [], [], {"step": F(4, 5), "delay": F(95, 1000), "tracking": F(3, 10**4)}

    def designed(task, step, *, objective, delay=F(0), **told):
        tellings.append(told)
        if objective == "tracking":
            assert (step, delay) == (rational(REAL.sampling_time), 0)
            claims = dataclasses.replace(CLAIMS, slip_rate_error=UpperBound(longest["tracking"]))
            return TrackingProof(task=task, sampled_loop=SampledLoop(law=LAW, step=step, delay=delay), claims=claims)
        asked.append((step, delay))
        if step > longest["step"] or delay > longest["delay"]:
            return NoProof(reason="too long")
        return TrackingProof(task=task, sampled_loop=SampledLoop(law=LAW, step=step, delay=delay), claims=CLAIMS)

    def claimed(task, step, **around):
        return TrackingProof(task=task, sampled_loop=SampledLoop(law=LAW, step=step, **around), claims=CLAIMS)

    def longest_step(task, **told):
        tellings.append(told)
        return Longest(claimed(task, longest["step"]), None) if longest["step"] else None

    found = {
        "design_sampled_law": designed,
        "longest_step": longest_step,
        "design_at": lambda task, one: one.guarantee,
        "design_near_longer_step": lambda *_, **__: None,
        "longest_delay": lambda task, step, **_: claimed(task, step, delay=longest["delay"]),
        "longest_diffusion_time": lambda task, step, **_: claimed(task, step, diffusion=F(5)),
    }
    for name, search in found.items():
        monkeypatch.setattr(f"quakedesign.studies.performance_limits.{name}", search)
    return asked, longest, tellings


def test_both_sides_of_the_real_fault(designs):
    found = study(REAL, pressure=2e7)
    assert found.to_dict()["largest_step"]["impossible_beyond"] == "15.8694"
    assert found.largest_step.impossible_beyond == longest_reaction(uncertain_plant(REAL), F(2 * 10**7))
    assert found.largest_delay.impossible_beyond == found.largest_step.impossible_beyond - F(184, 1000)
    assert found.farthest_well.to_dict()["impossible_beyond"] == "11.7421"
    assert found.peak_slip_rate_error.proved_up_to == CLAIMS.slip_rate_error
    assert found.smallest_pressure.proved_up_to == 10**7
    for limit in found.named().values():
        assert isinstance(limit.impossible_beyond, LowerBound | UpperBound)
        if limit.proved_up_to is not None:
            assert type(limit.proved_up_to) is not type(limit.impossible_beyond)


@pytest.mark.parametrize("tracking", [F(1, 10**4), F(3, 10**4)])
def test_what_is_proved_of_the_slip_rate_is_the_better_of_both_objectives(designs, tracking):
    designs[1]["tracking"] = tracking
    found = study(REAL)
    assert found.peak_slip_rate_error.proved_up_to == min(tracking, CLAIMS.slip_rate_error)
    assert found.achieved[0] == (rational(REAL.sampling_time), min(tracking, CLAIMS.slip_rate_error))


@pytest.mark.parametrize(("step", "said"), [(0.184, False), (5.0, True), (40.0, False)])
def test_between_both_sides_it_says_that_neither_is_known(designs, step, said):
    lines = limits_lines(study(dataclasses.replace(REAL, sampling_time=step)))
    assert (f"T_s = {step:g} s of this fault: neither proved for a design nor shown to be infeasible" in lines) is said


def test_what_is_proved_of_t_s_delay_and_rock_is_what_the_searches_of_designs_find(designs):
    found = study(REAL)
    assert found.largest_step.proved_up_to == F(4, 5)
    assert found.largest_delay.proved_up_to == F(95, 1000)
    assert found.largest_diffusion_time.proved_up_to == 5
    assert [g.sampled_loop.step for g in found.proved] == [rational(REAL.sampling_time), F(4, 5)]


@pytest.mark.parametrize(("diffusivity", "well"), [(1.0, 5**0.5), (0.02, 0.1**0.5)])
def test_the_farthest_well_that_is_proved_is_not_beyond_its_rock(designs, diffusivity, well):
    proved = study(REAL, diffusivity=diffusivity).farthest_well.proved_up_to
    assert isinstance(proved, LowerBound)
    assert proved**2 <= 5 * rational(diffusivity)
    assert float(proved) == pytest.approx(well, rel=1e-12)


def test_a_fault_that_is_sampled_too_slowly_gets_a_shorter_step(designs):
    longest = designs[1]
    longest["step"] = F(3, 100)
    found = study(REAL)
    assert found.largest_step.proved_up_to == F(3, 100)
    assert found.largest_delay.proved_up_to is None
    assert found.largest_diffusion_time.proved_up_to is None
    assert found.peak_slip_rate_error.proved_up_to is None


def test_nothing_proved_at_all(designs):
    _, longest, _ = designs
    longest["step"] = F(0)
    found = study(REAL)
    assert found.proved == ()
    assert {limit.proved_up_to for limit in found.named().values()} == {None}


def test_what_is_printed_stays_within_80_columns_and_on_the_safe_side(designs):
    found = study(REAL, pressure=2e7)
    lines = limits_lines(found)
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert "below 102 µm/s" in text  # 1.0255e-4 m/s
    assert "above 11.8 m" in text  # 11.7421 m
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.slow
def test_noise_limits_the_slip_rate_of_who_is_told_no_more(designs):
    plain, found = study(REAL), study(REAL, measured="slip", slip_noise="1e-6")
    least, noisy = (one.peak_slip_rate_error for one in (plain, found))
    assert 1.36 < noisy.impossible_beyond / least.impossible_beyond < 1.37
    assert noisy.holds_for.endswith(
        "and measure, up to the sample, the slip with errors of no more than 1 µm and nothing else"
    )
    assert found.largest_step == plain.largest_step  # even for those who know everything
    told = {"measured": "slip", "slip_noise": F(1, 10**6)}
    assert {"measured": "slip", "setup": ExactSetup(slip_noise=F(1, 10**6))} in designs[2]
    assert {"measured": "slip-and-rate", "setup": ExactSetup()} in designs[2]
    assert {key: found.to_dict()[key] for key in told} == {key: str(value) for key, value in told.items()}
    said = "even for a controller that measures the slip with errors of no more than 1 µm up to each sample"
    assert said in " ".join(" ".join(limits_lines(found)).split())
    assert found.smallest_peaks()[0][1] > 2 * found.smallest_peaks(measured=False)[0][1]
    label = "infeasible when measuring the slip with errors of no more than 1 µm"
    assert label in limits_figure(found).axes[0].get_legend_handles_labels()[1]
    assert found.smallest_peaks(measured=False) == plain.smallest_peaks()


def test_noise_of_both_is_told_and_that_of_one_hides_nothing(designs):
    both = study(REAL, slip_noise="1e-6", rate_noise="1e-5", prove=False)
    errors = "the slip with errors of no more than 1 µm, the slip rate with errors of no more than 10 µm/s"
    assert both.sensing.summary() == errors
    said = " ".join(" ".join(limits_lines(both)).split())
    assert f"even for a controller that measures {errors} up to each sample" in said
    plain = study(REAL, prove=False).peak_slip_rate_error
    assert both.peak_slip_rate_error.impossible_beyond > plain.impossible_beyond
    for told in ({"slip_noise": "1e-6"}, {"rate_noise": "1e-6"}, {"measured": "slip"}):
        assert study(REAL, **told, prove=False).peak_slip_rate_error == plain


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"slip_noise": -1}, "slip noise must be 0 or more"),
        ({"measured": "slip", "rate_noise": 1}, "rate noise must be 0 unless the slip rate is measured"),
        ({"measured": "rate"}, "measured must be one of"),
    ],
)
def test_noise_that_cannot_be_is_refused(told, said):
    with pytest.raises(ParameterError, match=said):
        study(REAL, prove=False, **told)


def test_without_a_disturbance_nothing_is_impossible():
    quiet = qd.load_fault("lab-fault").with_disturbance(Disturbance())
    found = study(quiet, prove=False)
    assert {limit.impossible_beyond for limit in found.named().values()} == {None}
    assert found.smallest_peaks() == []
    text = " ".join(limits_lines(found))
    assert "without a disturbance no limit is known: give an amplitude in [disturbance]" in text
    assert limits_figure(found).axes[0].get_ylabel().endswith("[m/s]")


def test_a_stable_fault_has_a_smallest_peak_and_nothing_else():
    stiff = dataclasses.replace(REAL, shear_modulus=3e11)
    found = study(stiff, prove=False)
    impossible = {name: limit.impossible_beyond for name, limit in found.named().items()}
    assert impossible.pop("peak_slip_rate_error") > 0
    assert set(impossible.values()) == {None}
    assert max(map(len, limits_lines(found))) <= 80


def test_the_curve_ends_where_no_controller_holds(designs):
    found = study(REAL, pressure=2e7)
    curve = found.smallest_peaks()
    assert float(curve[-1][0]) == pytest.approx(15.87, abs=0.01)
    assert curve[0][0] == F(184, 10000)
    values = [float(peak) for _, peak in curve]
    assert values == sorted(values)


def test_the_figure_shows_the_earthquake_and_what_is_proved(designs):
    axis = limits_figure(study(REAL)).axes[0]
    labels = axis.get_legend_handles_labels()[1]
    assert "natural earthquake (slip rate)" in labels
    (points,) = [line for line in axis.lines if line.get_label().startswith("proved")]
    assert list(points.get_xdata()) == pytest.approx([0.184, 0.8])
    assert axis.get_ylim()[1] > 0.1


@pytest.mark.parametrize(("step", "said"), [(17.8, False), (17.9, True)])
def test_a_fault_says_when_no_controller_can_hold_it_at_its_step(step, said):
    told = " ".join(beyond_control(dataclasses.replace(REAL, sampling_time=step)))
    assert ("T_s must not exceed 17.9 s" in told) is said  # 17.828 s


@pytest.mark.parametrize("given", [{"pressure": 0.0}, {"pressure": -1.0}, {"diffusivity": 0.0}])
def test_meaningless_numbers_are_refused(given):
    with pytest.raises(ParameterError, match="must be positive"):
        study(REAL, **given)


@pytest.mark.slow
def test_the_laboratory_fault_in_earnest():
    found = study(qd.load_fault("lab-fault"))
    assert found.largest_step.proved_up_to >= F(2, 1000)
    for guarantee in found.proved:
        assert guarantee.check() is qd.Verdict.PROVED
    assert found.peak_slip_rate_error.proved_up_to > found.peak_slip_rate_error.impossible_beyond
