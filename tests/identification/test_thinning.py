"""Means in place of samples keep what a fit is about: lines, steps, single outliers and their weights."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quakedesign.fault import friction_law
from quakedesign.identification.fitting import fit
from quakedesign.identification.identify import identify, set_up
from quakedesign.identification.loading import prepared
from quakedesign.identification.record import MOST_MEANS, Record, reading_step, thinned
from quakedesign.report.identification_page import identification_lines

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_records", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)

SAMPLES, AT = 40000, 25000


def stepped(seed=0):
    """A rate that becomes tenfold at a sample, friction that jumps there and decays within 100 samples."""
    time = 0.05 * np.arange(SAMPLES)
    after = np.maximum(np.arange(SAMPLES) - AT, 0)
    true = 0.6 + 0.02 * np.exp(-after / 100) * (after > 0)
    friction = true + 3e-4 * np.random.default_rng(seed).standard_normal(SAMPLES)
    moved = 1e-6 * (time + 9 * 0.05 * after)
    normal = np.full(SAMPLES, 5e6)
    record = Record(
        name="long", time=time, friction=friction, load_point=moved, slip=None, normal=normal, normal_unit="Pa"
    )
    return record, true


def test_short_records_stay_as_they_are():
    record = synthetic.KINDS["velocity steps, slip"]().noisy(0)
    assert thinned(record) is record


def test_samples_near_a_step_stay_and_all_others_count_once():
    record, _ = stepped()
    means, loading = prepared(record)
    assert means.counts.sum() == SAMPLES
    assert len(means.time) < 500
    assert means.counts[0] == 1
    assert loading.first_rate == pytest.approx(1e-6, rel=1e-9)
    near = np.abs(means.time - record.time[AT]) < 9 * 0.05
    assert np.all(means.counts[near] == 1)
    np.testing.assert_allclose(means.counts @ means.friction, record.friction.sum())
    np.testing.assert_allclose(means.counts @ means.time, record.time.sum())


def test_a_mean_is_what_friction_is_at_the_mean_time_but_for_far_less_than_its_noise():
    """Friction without noise, averaged over the means of the noisy record, against the curve at their times."""
    record, true = stepped()
    means = thinned(record)
    edges = np.concatenate([[0], np.cumsum(means.counts)])
    averaged = np.add.reduceat(true, edges[:-1]) / means.counts
    after = means.time / 0.05 - AT
    curve = 0.6 + 0.02 * np.exp(-np.maximum(after, 0) / 100) * (after > 0)
    assert np.max(np.abs(averaged - curve) * np.sqrt(means.counts)) < 0.1 * 3e-4


def test_means_are_short_against_the_time_since_a_change_and_their_piece():
    """An eighth of windows of half of that time, and of an eighth of the piece."""
    starts = np.array([0, 40000, 40500, 100000])
    time, flat = np.arange(100000.0), 0.6 + 1e-3 * np.random.default_rng(0).standard_normal(100000)
    record, ones = stepped()[0], np.ones(100000)
    record = replace(record, time=time, friction=flat, load_point=1e-6 * time, normal=ones)
    edges = np.concatenate([[0], np.cumsum(thinned(record, time[starts[:-1]]).counts)])
    begin, end = edges[:-1], edges[1:] - 1
    piece = np.searchsorted(starts, begin, side="right")
    assert np.all(end - begin <= 0.07 * (begin - starts[piece - 1]))
    assert np.all(end - begin <= (starts[piece] - starts[piece - 1]) / 64)
    assert set(starts) <= set(edges)
    assert len(edges) < 600


@pytest.mark.parametrize("name", ["slip", "normal", "friction"])
def test_a_mean_over_which_a_column_bends_is_halved(name):
    """Without a change of rate, by a kink of a hundred times the noise or a thousandth of the range."""
    record, _ = stepped()
    flat = 0.6 + 3e-4 * np.random.default_rng(1).standard_normal(SAMPLES)
    line = 1e-6 * record.time
    straight = replace(record, friction=flat, load_point=line, slip=line)
    after = np.maximum(np.arange(SAMPLES) - AT, 0)
    bent = {"slip": record.load_point, "normal": 5e6 + 1e3 * after, "friction": flat + 0.03 * np.minimum(after / 30, 1)}
    longest = [
        means.counts[np.searchsorted(np.cumsum(means.counts), AT, side="right")]
        for means in (thinned(straight), thinned(replace(straight, **{name: bent[name]})))
    ]
    assert longest[1] < longest[0] / 4


def test_a_long_record_is_fitted_by_its_means_and_says_so():
    made = synthetic.weakening(samples=8000)
    found = identify(made.noisy(2), made.law)
    assert len(found.fit.counts) < 500
    assert found.fit.noise == pytest.approx(made.noise, rel=0.1)
    assert found.to_dict()["measurements"] == found.record.counts[found.used].sum()
    told = " ".join(" ".join(identification_lines(found, verbose=True)).split())
    assert f"; {found.fit.counts.sum()} samples averaged to {len(found.fit.counts)};" in told


def test_an_outlier_stays_a_sample_of_its_own():
    record, _ = stepped()
    friction = record.friction.copy()
    friction[10000] += 0.05
    means = thinned(replace(record, friction=friction))
    (place,) = np.flatnonzero(np.abs(means.time - record.time[10000]) < 1e-9)
    assert means.counts[place] == 1


def test_what_bends_everywhere_is_cut_into_so_many_means_and_no_more():
    record, _ = stepped()
    waves = 0.6 + 0.002 * np.sin(np.arange(SAMPLES) / 30) + 3e-4 * np.random.default_rng(1).standard_normal(SAMPLES)
    assert MOST_MEANS <= len(thinned(replace(record, friction=waves)).time) < MOST_MEANS + 16


def test_weights_are_the_numbers_of_samples():
    """Two halves of a record, one of them as means of four: the fit is that of all samples, linear in the law."""
    made = synthetic.weakening(samples=800)
    plain = made.noisy(5)
    edges = np.concatenate([np.arange(400), np.arange(400, 800, 4)])
    counts = np.diff([*edges, 800])

    def means(values):
        return np.add.reduceat(values, edges) / counts

    fits = []
    for record in (
        plain,
        replace(
            plain,
            time=means(plain.time),
            friction=means(plain.friction),
            slip=means(plain.slip),
            normal=means(plain.normal),
            counts=counts,
        ),
    ):
        setup = set_up(record, friction_law(made.law), None)
        taken = None if record.counts is None else record.counts[setup.used]
        fits.append(fit(setup.experiment, record.friction[setup.used], seed=0, counts=taken))
    whole, part = fits
    np.testing.assert_allclose(part.fitted, whole.fitted, atol=0.1 * np.min(whole.standard_errors))
    np.testing.assert_allclose(part.standard_errors, whole.standard_errors, rtol=0.15)
    assert part.noise == pytest.approx(whole.noise, rel=0.1)
    assert part.distance(part.fitted) == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "other"), [("slip", "aging"), ("aging", "slip")])
def test_the_law_that_made_a_record_is_preferred_unless_one_is_asked_for(law, other):
    made = synthetic.sliding(f"rate-and-state-{law}", synthetic.STEPS[:2], sample=0.4)
    found = identify(made.noisy(0), stiffness=made.stiffness)
    assert (found.law.name, found.rival.law) == (f"rate-and-state-{law}", f"rate-and-state-{other}")
    asked = identify(made.noisy(0), found.rival.law, stiffness=made.stiffness)
    assert asked.rival is None
    assert found.rival.squares > 1.5
    assert found.rival.excess > 10
    independent = found.fit.used.sum() / min(found.fit.correlation, asked.fit.correlation)
    assert found.rival.excess == pytest.approx(independent * np.log(found.rival.squares), rel=0.1)


def test_readings_in_steps_are_known():
    time = np.arange(1000.0)
    assert reading_step(np.round(0.15 * time, 1)) == pytest.approx(0.1)
    assert reading_step(np.round(0.01 * time, 1)) == pytest.approx(0.1)
    assert reading_step(np.where(time < 5, time, 5 + 3 * (time - 5))) < 1e-5


def test_means_of_weighted_samples_are_weighted_means():
    """Doubtful samples that are off move a mean by their share of the weights."""
    draw = np.random.default_rng(0)
    count = 4000
    bad = np.arange(count) % 2 == 1
    record = Record(
        name="weighted",
        time=np.arange(count) * 0.1,
        friction=0.6 + 1e-4 * draw.standard_normal(count) + 0.01 * bad,
        load_point=np.arange(count) * 1e-7,
        slip=None,
        normal=np.ones(count),
        normal_unit="",
        counts=np.where(bad, 0.002, 1.998),
    )
    found = thinned(record)
    assert float(np.sum(found.counts)) == pytest.approx(count)
    long = found.counts > 5
    off = found.friction[long] - (0.6 + 0.01 * 0.001)
    assert np.max(np.abs(off) / (1e-4 * np.sqrt(2 / found.counts[long]))) < 4.5
