"""What decides a verdict, at its thresholds, with fits made by hand: every number follows from the values beside it."""

from dataclasses import replace
from importlib import import_module
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign.errors import RecordError
from quakedesign.exact import rational
from quakedesign.fault import friction_law, load_fault
from quakedesign.identification import assessment
from quakedesign.identification.assessment import Assessment, checks_of, sign_check, unsteady_beginning
from quakedesign.identification.experiment import START_STATE, TREND, TREND_IN_TIME
from quakedesign.identification.fault_file import cover, identified_fault
from quakedesign.identification.fault_file import next_command as checked_command
from quakedesign.identification.fitting import BetterFit
from quakedesign.identification.identification_result import ParameterEstimate
from quakedesign.identification.identify import _Choice, _Fitted, needed

COUNT = 401
IDENTIFY = import_module("quakedesign.identification.identify")
next_command = getattr(checked_command, "__wrapped__", checked_command)  # takes stubs, whatever has been imported


def checks(
    residuals, *, begins=None, raw=None, noise=1.0, values=None, slopes=None, used=None, path=None, whitened=None
):
    """Checks of residuals [-] at times 0, 1, 2 …, with a noise of 1 from sample to sample."""
    time = np.arange(float(len(residuals)))
    used = np.ones(len(residuals), dtype=bool) if used is None else used
    fit = SimpleNamespace(
        measured=np.array(residuals),
        residuals=np.array(residuals),
        used=used,
        whitened=np.array(residuals)[used] if whitened is None else whitened,
        noise=noise,
        weights=used.astype(float),
        slopes=(np.ones((len(residuals), 1)) if slopes is None else slopes)[used],
    )
    held = SimpleNamespace(time=time, friction=np.array(residuals if raw is None else raw))
    record = SimpleNamespace(time=time, load_point=time if path is None else path)
    loading = None if begins is None else SimpleNamespace(steps=np.array(begins), first_rate=1e-6)
    found, factor = checks_of(fit, held, record, np.ones(len(time), dtype=bool), loading, values or {})
    return {check.name: check for check in found}, factor


@pytest.fixture
def white(monkeypatch):
    monkeypatch.setattr(assessment, "scatter", lambda *_: 1.0)


@pytest.mark.usefixtures("white")
@pytest.mark.parametrize(("far", "factor", "verdict"), [(2, 2.0, "explains"), (3, None, "does not explain")])
def test_residuals_of_twice_the_noise_are_noise_but_for_one_sample_in_two_hundred(far, factor, verdict):
    residuals = np.full(400, 2.0)
    residuals[:far] = 40.0
    found, worst = checks(residuals)
    assert list(found) == ["residuals"]
    expected = factor or (4 * 397 / 398 + 1600 / 398) ** 0.5
    assert worst == found["residuals"].value == pytest.approx(expected, rel=1e-12)
    assert found["residuals"].passed == (factor is not None)
    assert Assessment(checks=(), factor=worst).verdict.startswith(verdict)


@pytest.mark.usefixtures("white")
@pytest.mark.parametrize(("before", "noise"), [(19, 1.0), (20, 3.0)])
def test_the_noise_is_that_about_a_line_of_twenty_samples_before_the_first_change_of_rate(before, noise):
    """Values of size 3 without a trend: blocks of four change sign as the square of their place does."""
    sign = np.resize([1.0, -1.0, -1.0, 1.0], COUNT)
    residuals = 3.0 * sign
    found, _ = checks(residuals, begins=[before - 0.5])
    assert found["residuals"].value == pytest.approx(3.0 / noise, rel=1e-9)
    assert ("about a line" in found["residuals"].sentence) == (before == 20)
    quiet, _ = checks(np.where(np.arange(COUNT) < before, 0.0, residuals), begins=[before - 0.5])
    assert quiet["residuals"].value > 2.9


@pytest.mark.usefixtures("white")
@pytest.mark.parametrize(
    ("slip", "samples"),
    [(0.0, 5), (0.5, 6), (1.0, 11), (50.0, 81)],
)
def test_what_follows_a_change_of_rate_is_judged_by_itself_within_ten_critical_slips(slip, samples):
    """The way is 0, 1, 2 … 400: at least a hundredth of it and at most a fifth are looked at."""
    residuals = np.zeros(COUNT)
    residuals[300 : 300 + samples] = 2.5
    found, worst = checks(residuals, begins=[300.0], values={"critical_slip": slip, START_STATE: 0.0})
    assert worst == found["peak"].value == pytest.approx(2.5, rel=1e-12)
    assert not found["peak"].passed
    assert "is not explained" in found["peak"].sentence
    residuals[300 + samples :] = 10.0
    beyond, _ = checks(residuals, begins=[300.0], values={"critical_slip": slip, START_STATE: 0.0})
    assert beyond["peak"].value == pytest.approx(2.5, rel=1e-12)


@pytest.mark.usefixtures("white")
def test_a_peak_of_twice_the_noise_passes_and_four_samples_or_those_left_out_tell_none():
    residuals = np.zeros(COUNT)
    residuals[300:305] = 2.0
    found, _ = checks(residuals, begins=[300.0])
    assert found["peak"].passed
    assert "is explained" in found["peak"].sentence
    used = np.ones(COUNT, dtype=bool)
    used[302] = False
    assert checks(residuals, begins=[300.0], used=used)[0]["peak"].value == 0.0
    worst, _ = checks(np.where(np.arange(COUNT) < 250, 1.5, residuals), begins=[100.0, 300.0])
    assert worst["peak"].value == 2.0
    _, quiet_after = checks(np.where(np.arange(COUNT) < 250, 3.0, 0.0), begins=[300.0])
    assert quiet_after == pytest.approx((9 * 247 / 398) ** 0.5, rel=1e-12)


@pytest.mark.usefixtures("white")
@pytest.mark.parametrize(("late", "passed"), [(2.0, True), (2.0001, False), (0.5, True), (0.49999, False)])
def test_halves_may_differ_by_a_factor_of_two_in_noise(late, passed):
    residuals = np.resize([1.0, -1.0], COUNT) * np.where(np.arange(COUNT) < 201, 1.0, late)
    found, _ = checks(residuals, begins=[399.0], noise=1e9)
    assert found["halves"].passed == passed
    assert found["halves"].value == pytest.approx(max(late, 1 / late) / 2, rel=1e-12)
    told = Assessment(checks=tuple(found.values()), factor=1.0)
    assert told.cautions == (() if passed else (found["halves"].sentence,))
    assert passed or "residuals differ by a factor 2, so the intervals may be too narrow" in told.cautions[0]
    assert replace(told, factor=3.0).cautions == ()


@pytest.mark.usefixtures("white")
@pytest.mark.parametrize("size", [3.999, 4.001])
def test_a_trend_may_change_by_four_of_its_deviations_at_the_last_change_of_rate(size):
    """Residuals along the hinge that is square to the slopes; the other half of the noise keeps both halves alike."""
    time = np.arange(float(COUNT))
    hinge = np.maximum(time - 200.0, 0.0)
    slopes = np.column_stack([np.ones(COUNT), time])
    across = hinge - slopes @ np.linalg.lstsq(slopes, hinge, rcond=None)[0]
    found, _ = checks(-size * across / np.linalg.norm(across), begins=[100.0, 200.0], slopes=slopes, noise=1.0)
    assert found["halves"].value == pytest.approx(size / 4, rel=1e-9)
    assert found["halves"].passed == (size < 4)
    changes = f"the trend changes at the last step ({size:.2g} standard deviations): the drift is not linear, so the "
    changes += "intervals may be too narrow. Cut with --to, or use --steps auto"
    assert (found["halves"].sentence == changes) == (size > 4)
    one, _ = checks(-5 * across / np.linalg.norm(across), begins=[200.0], slopes=slopes, noise=1.0)
    assert one["halves"].sentence.endswith("too narrow. Cut with --to")
    told = slopes if size > 4 else np.column_stack([slopes, hinge])
    same, _ = checks(np.ones(COUNT), begins=[200.0], slopes=told)
    assert same["halves"].value == pytest.approx(0.5, abs=1e-6)


def between(low, high):
    return ParameterEstimate(name="a - b", unit="", value=(low + high) / 2, low=low, high=high, least=low, most=high)


@pytest.mark.parametrize("ends", [(0.0, 0.003), (-0.003, 0.0), (-0.001, 0.003)])
def test_a_difference_that_may_be_zero_has_no_sign(ends):
    check = sign_check(between(*ends), {})
    assert not check.passed
    assert check.sentence == f"the sign of a - b is open: from {ends[0]:.2g} to {ends[1]:.2g}"


@pytest.mark.parametrize(
    ("ends", "said"), [((1e-9, 1.0), "positive: friction strengthens"), ((-1.0, -1e-9), "weakens")]
)
def test_a_sign_is_that_of_the_whole_interval(ends, said):
    check = sign_check(between(*ends), {})
    assert check.passed
    assert said in check.sentence
    assert not sign_check(between(*ends), {}, np.sign(ends[0]) * -2e-9).passed
    assert not sign_check(between(*ends), {"with a trend": (between(-ends[1], -ends[0]), 9.0)}).passed
    assert not sign_check(between(*ends), {}, None, ": the beginning is off").passed
    assert sign_check(between(*ends), {}, np.sign(ends[0]) * 2e-9).passed


@pytest.mark.parametrize(
    ("before", "step", "value", "hidden"),
    [
        (5e-5, 2.0, 0.001, False),  # five critical slips fade it
        (4.99e-5, 2.0, 0.001, True),
        (1e-5, 2.0, 0.005, False),  # it moves as much as the change of rate
        (1e-5, 2.0, 0.00499, True),
        (1e-5, -2.0, 0.005, False),
        (1e-5, None, 0.001, False),
    ],
)
def test_a_beginning_that_moves_more_than_the_step_and_does_not_fade_hides_the_sign(before, step, value, hidden):
    """b times the logarithm of the age is 0.02 · 0.5 = 0.01."""
    values = {"critical_slip": 1e-5, "evolution_effect": 0.02, START_STATE: -0.5}
    loading = SimpleNamespace(first_step=step, before=before)
    said = unsteady_beginning(between(value, value), values, loading)
    assert bool(said) == hidden
    assert not hidden or said.endswith(
        f"of {before / 1e-5:.2g} critical slips, deviates from steady sliding by 0.01 in friction"
    )
    assert not unsteady_beginning(None, values, loading)


def best(squares, *names, chance=1.0):
    """A fit whose excess is that of its squares, with a threshold of 3, and a friction that spans 1."""
    return SimpleNamespace(
        sum_of_squares=squares,
        degrees_of_freedom=100,
        measured=np.array([0.0, 1.0]),
        excess=lambda other: other - squares,
        threshold=lambda fewer, _chance: 3.0 * fewer,
        experiment=SimpleNamespace(coordinates=[SimpleNamespace(name=name) for name in names]),
    )


@pytest.mark.parametrize(
    ("squares", "fewer", "told"), [(13.0, 1, False), (13.1, 1, True), (13.1, 2, False), (16.1, 2, True)]
)
def test_what_noise_explains_is_not_needed(squares, fewer, told):
    assert needed(best(10.0), squares, fewer) is told


@pytest.mark.parametrize(("share", "told"), [(0.99e-5, False), (1.01e-5, True)])
def test_what_no_machine_measures_is_not_needed(share, told):
    exact = best(0.0)
    exact.excess = lambda _: 1e9
    assert needed(exact, share**2 * 100) is told


class Stubbed(_Choice):
    """A choice whose other fits have squares that are known."""

    squares = None

    def _refitted(self, _fitted, nuisance):
        name = next(iter(nuisance - {START_STATE}), "")
        return _Fitted(kind=None, setup=name, best=best(self.squares[name], name)), self.squares[name]


def chosen(own, choice="auto", *, monkeypatch, **squares):
    monkeypatch.setattr(IDENTIFY, "settled", lambda fit: fit)
    stubbed = Stubbed(record=None, raw=None, loading=None, stiffness=None, seed=0, trend=choice)
    object.__setattr__(stubbed, "squares", {name.replace("none", ""): value for name, value in squares.items()})
    fitted = _Fitted(kind=None, setup="own", best=best(100.0, *filter(None, [own]), START_STATE))
    taken, others = stubbed._trend(fitted)
    return taken.setup, {what: excess for what, (_, excess) in others.items()}


def test_a_trend_in_time_takes_the_place_of_one_in_displacement_by_ten_of_aic(monkeypatch):
    """AIC: squares and 2 for a trend; only differences count."""
    told = chosen(TREND, trend_in_time=90.0, none=200.0, monkeypatch=monkeypatch)
    assert told == ("own", {"without a trend": 98.0, "with a trend in time": -10.0})
    told = chosen(TREND, trend_in_time=89.9, none=200.0, monkeypatch=monkeypatch)
    assert told[0] == TREND_IN_TIME
    assert told[1] == {"without a trend": pytest.approx(108.1), "with a trend in displacement": pytest.approx(10.1)}
    told = chosen(TREND, "displacement", none=200.0, monkeypatch=monkeypatch)
    assert told == ("own", {"without a trend": 98.0})


def test_a_trend_that_noise_explains_is_not_taken(monkeypatch):
    told = chosen(TREND, trend_in_time=95.0, none=103.0, monkeypatch=monkeypatch)
    assert told == ("", {"with a trend in displacement": -1.0, "with a trend in time": -6.0})
    assert chosen(TREND, trend_in_time=95.0, none=103.1, monkeypatch=monkeypatch)[0] == "own"
    told = chosen("", "none", trend=90.0, trend_in_time=80.0, monkeypatch=monkeypatch)
    assert told == ("own", {"with a trend in displacement": -8.0, "with a trend in time": -18.0})


@pytest.mark.parametrize(("excess", "opened"), [(9.9, True), (10.1, False)])
def test_a_fit_with_another_trend_whose_valley_leads_elsewhere_leaves_the_sign_open(monkeypatch, excess, opened):
    def elsewhere(*_, **__):
        raise BetterFit(np.zeros(1))

    monkeypatch.setattr(IDENTIFY, "checks_of", lambda *_: ((), 1.0))
    monkeypatch.setattr(IDENTIFY, "_difference", elsewhere)
    monkeypatch.setattr(_Choice, "_late_trend", lambda *_: None)
    experiment = SimpleNamespace(outward=lambda _: {})
    found = SimpleNamespace(
        fit=SimpleNamespace(experiment=experiment, fitted=None),
        used=None,
        difference=between(0.001, 0.003),
        undetermined=lambda: [],
        experiments=lambda sign: [f"passed: {sign.passed}"],
    )
    choice = _Choice(record=None, raw=None, loading=None, stiffness=None, seed=0)
    told = choice._assessed(found, {"without a trend": (SimpleNamespace(best=None), excess)})
    assert told.verdict == ("cannot tell" if opened else "explains the record")
    assert told.experiments == (f"passed: {not opened}",)
    assert [check.name for check in told.checks] == ["sign"]
    assert [sentence.startswith("the sign of a - b is open") for sentence in told.open] == [True] * opened


def written(share=0.1, low=-0.002, high=-0.001, verdict="explains the record"):
    """What a file and the command after it are made from: a, b and D_c of 1 within a share of it."""
    ends = {"low": 1 - share / 2, "high": 1 + share / 2, "least": 1 - share, "most": 1 + share}
    names = ("direct_effect", "evolution_effect", "critical_slip")
    kind, rates = (
        friction_law("rate-and-state-aging"),
        {"reference_rate": 1e-6, "slowest_rate": 1e-9, "fastest_rate": 1e-3},
    )
    return SimpleNamespace(
        law=kind(**dict.fromkeys(kind.quantities(), 1.0) | rates),
        estimates={name: ParameterEstimate(name=name, unit="", value=1.0, **ends) for name in names},
        difference=between(low, high),
        explained=verdict == "explains the record",
        assessment=SimpleNamespace(verdict=verdict, open=("the sign",)),
        determined=False,
        record=SimpleNamespace(name="made"),
        undetermined=lambda: ["D_c is not identifiable"],
    )


@pytest.mark.parametrize(("share", "spread"), [(0.199, " --spread 0.2"), (0.201, "")])
def test_a_box_wider_than_a_fifth_has_no_spread_that_covers_it(share, spread):
    said = next_command(written(share), "made.toml")
    assert said.startswith(f"quakedesign design made.toml{spread}" if spread else "none that covers the record")
    assert spread or "critical_slip within 20%" in said


@pytest.mark.parametrize(
    ("low", "told"), [(0.0, "quakedesign design"), (1e-9, "none is needed"), (-1e-9, "quakedesign")]
)
def test_friction_that_strengthens_for_certain_needs_no_controller(low, told):
    assert next_command(written(low=low, high=0.002), "made.toml").startswith(told)
    before = next_command(written(low=low, high=0.002), None)
    assert before.startswith("none is needed" if low > 0 else "--out FILE writes a fault file")
    unclear = written(low=low, high=0.002, verdict="cannot tell")
    assert next_command(unclear, "made.toml").startswith("none: the record cannot tell: the sign")


def test_a_record_that_tells_not_every_parameter_makes_no_fault():
    with pytest.raises(RecordError, match=r"needs every parameter. Received made: D_c is not identifiable."):
        identified_fault(written(), load_fault("lab-fault"))


@pytest.mark.parametrize("seed", range(5))
def test_a_cover_is_rounded_to_the_safe_side_exactly(seed):
    """Of every corner, scaled to one static friction: no residual is below that of the cover, and no slope above."""
    draw = np.random.default_rng(seed)
    ranges = {
        name: tuple(value * (1 + share) for share in (-draw.uniform(0.01, 0.05), draw.uniform(0.01, 0.05)))
        for name, value in (("residual", 0.4), ("drop", 0.17), ("critical_slip", 2.5e-3))
    }
    law = friction_law("exponential-slip-weakening")(residual=0.4, drop=0.17, critical_slip=2.5e-3)
    held, _ = cover(law, ranges, load_fault("lab-fault").box)
    residual, drop, slip = (rational(getattr(held, name)) for name in ("residual", "drop", "critical_slip"))
    for corner in product(*(ranges[name] for name in ("residual", "drop", "critical_slip"))):
        left, fall, over = map(rational, corner)
        scale = (residual + drop) / (left + fall)
        assert left * scale >= residual
        assert fall / over * scale <= drop / slip
