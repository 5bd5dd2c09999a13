"""The small gain of several channels against eigenvalues and closed forms."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, NoProof
from quakedesign.guarantees.exact.sampled_loop import NOISELESS, channels_of
from quakedesign.guarantees.exact.small_gain import bounds_from, spectral_radius
from quakedesign.laws import ImplicitStep, Power
from quakedesign.plant import uncertain_plant

STEP = F("0.184")
PULL = (Power(factor=(F(1), F(1)), exponent=F(0), argument="slip"),)
TASK, LIMITED = (uncertain_plant(load_fault("real-fault"), rate_limited=limited) for limited in (False, True))


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_the_spectral_radius_is_an_eigenvalue_from_above(size):
    random = np.random.default_rng(size)
    for _ in range(20):
        matrix = random.random((size, size)) * 10.0 ** random.uniform(-3, 3, (size, size))
        found = spectral_radius([[F(v) for v in row] for row in matrix])
        assert F(max(abs(np.linalg.eigvals(matrix)))) * (1 - F(1, 10**9)) <= found
        assert float(found) == pytest.approx(max(abs(np.linalg.eigvals(matrix))), rel=1e-3)


@pytest.mark.parametrize(
    ("rows", "exact"),
    [
        ([["1/2"]], "1/2"),
        ([[0, 0], [0, 0]], 0),
        ([["1/2", 1000], [0, 0]], "1/2"),
        ([["1/2", 0], ["1/3", "1/4"]], "1/2"),
        ([[0, 4], ["1/16", 0]], "1/2"),
        ([["1/2", "1/2"], [0, 0]], "1/2"),
        ([["1/4", 10**12], [F(1, 16 * 10**12), "1/4"]], "1/2"),
    ],
)
def test_spectral_radii_known_by_hand_are_bounded_closely(rows, exact):
    found = spectral_radius([[F(v) for v in row] for row in rows])
    assert F(exact) <= found <= F(exact) * F(1001, 1000)


NOISE = {"slip_noise": F(1, 10**6), "rate_noise": F(1, 10**5)}


def gains(
    acceleration=("1/20", "2/5", 2),
    drift=("1/50", "1/12", "1/2"),
    root=("3/10", 2, 13),
    slip_noise=(1, 7, 40),
    rate_noise=("1/3", 2, 9),
):
    """One part of the period."""
    outputs = ("slip_error", "slip_rate_error", "push")
    columns = {"acceleration": acceleration, "drift": drift, "root": root, "slip_noise": slip_noise}
    columns["rate_noise"] = rate_noise
    return {(y, name): (F(v),) for name, column in columns.items() for y, v in zip(outputs, column, strict=True)}


def bounds(task, given, root, step, noise=NOISELESS):
    """Bounds from the gains of those inputs that the loop has."""
    names = {channel.name for channel in channels_of(task, root, step, noise)}
    return bounds_from(task, {key: v for key, v in given.items() if key[1] in names}, root, step, noise)


def test_an_input_without_a_bound_is_an_error():
    with pytest.raises(ValueError, match="rate_noise, root, slip_noise without one"):
        bounds_from(TASK, gains(), None, STEP)


def test_one_channel_is_the_scalar_small_gain():
    """|a| ≤ F + m|a| + n·D, with m the ranges' halves times the gains."""
    found, half = bounds(TASK, gains(), None, STEP), TASK.half_ranges
    m, n = (half["slip_error"] * a + half["slip_rate_error"] * b + half["push"] * c
            for a, b, c in ((F(1, 20), F(2, 5), F(2)), (F(1, 50), F(1, 12), F(1, 2))))  # fmt: skip
    a = (TASK.reference_force + TASK.amplitude + n * TASK.drift) / (1 - m)
    assert isinstance(found, Bounds)
    assert m <= found.small_gain <= m * F(10001, 10000)
    assert found.slip_rate_error == F(2, 5) * a + F(1, 12) * TASK.drift


@pytest.mark.parametrize("task", [TASK, LIMITED], ids=["amplitude", "rate"])
@pytest.mark.parametrize("root", [None, ImplicitStep(pull=PULL, slopes=(F("0.9"), F(1)), remainder=F(1, 10**6))])
@pytest.mark.parametrize("noise", [{}, NOISE, {"rate_noise": F(1, 10**4)}], ids=["quiet", "noisy", "noisy rate"])
def test_the_inputs_are_the_fixed_point_of_what_the_outputs_make_of_them(task, root, noise):
    """W ← F + MW from 0, a thousand times in floats."""
    channels, given = channels_of(task, root, STEP, noise), gains()
    sizes = dict.fromkeys((c.name for c in channels), 0.0)
    for _ in range(1000):
        peaks = {y: sum(float(given[y, k][0]) * v for k, v in sizes.items()) for y in task.half_ranges}
        sizes = {
            c.name: float(c.constant) + sum(float(s) * peaks[y] for y, s in c.coefficients.items()) for c in channels
        }
    found = bounds(task, given, root, STEP, noise)
    assert isinstance(found, Bounds)
    assert float(found.slip_error) == pytest.approx(peaks["slip_error"], rel=1e-9)
    assert float(found.slip_rate_error) == pytest.approx(peaks["slip_rate_error"], rel=1e-9)


def test_noise_adds_what_its_gains_make_of_it():
    """Without anything else: 1e-6 m times the gain, and what the ranges make of that, (1 − m)⁻¹."""
    task = replace(TASK, amplitude=F(0), damping=F(0), target_slip=F(1, 10**30))
    found = bounds(task, gains(drift=(0, 0, 0)), None, STEP, {"slip_noise": F(1, 10**6)})
    half = task.half_ranges.values()
    m, n = (sum(h * g for h, g in zip(half, v, strict=True)) for v in ((F(1, 20), F(2, 5), F(2)), (F(1), F(7), F(40))))
    assert found.slip_error == pytest.approx(F(1, 10**6) * (1 + n / (1 - m) / 20), rel=1e-12)


def test_the_root_of_a_noisy_step_may_lie_wider_by_the_noise():
    """|w + γe1/T_s| ≤ δγ|e1 + n1|/T_s + ε."""
    root = ImplicitStep(pull=PULL, slopes=(F("0.9"), F(1)), remainder=F(1, 10**6))
    found = {c.name: c for c in channels_of(TASK, root, STEP, NOISE)}
    assert found["root"].constant == F(1, 10**6) + F(1, 20) / STEP * NOISE["slip_noise"]
    assert [found[name].constant for name in NOISE] == list(NOISE.values())
    assert not any(found[name].coefficients for name in NOISE)


def test_a_loop_through_the_implicit_step_can_fail_by_itself():
    root = ImplicitStep(pull=PULL, slopes=(F(0), F(1)))
    found = bounds(TASK, gains(root=(F("0.4"), 2, 13)), root, STEP)
    assert isinstance(found, NoProof)
    assert found.small_gain >= 1
    assert found.reason.startswith("small gain")
    assert found.reason.endswith("the range of the implicit step's slope contributes 1.08")  # 0.4/2/0.184


@pytest.mark.parametrize("share", ["4129/10", "1001/1000", "4126/10", "98765"])
def test_no_share_is_more_than_the_whole(share):
    """Of the whole an upper bound is said, of the share a lower one."""
    one = gains(acceleration=(F(share) / TASK.half_ranges["slip_error"], 0, 0), drift=(0, 0, 0))
    found = bounds(TASK, one, None, STEP)
    whole, part = (F(text.split()[-1].rstrip(",")) for text in
                   (found.reason.split(", which")[0], found.reason))  # fmt: skip
    assert F(99, 100) * whole <= part <= F(share) <= whole


def test_a_small_gain_of_one_proves_nothing():
    """Only the slip error's share of the acceleration, exactly 1."""
    one = gains(acceleration=(1 / TASK.half_ranges["slip_error"], 0, 0), drift=(0, 0, 0))
    found = bounds(TASK, one, None, STEP)
    assert isinstance(found, NoProof)
    assert found.small_gain == 1


def test_the_reason_is_the_largest_share_in_the_worst_part_of_the_period():
    share = TASK.half_ranges["slip_error"]
    parts = gains(acceleration=(0, 0, 0), drift=(0, 0, 0)) | {("push", "acceleration"): (F(1), F(2))}
    parts = {key: v if len(v) == 2 else v * 2 for key, v in parts.items()}
    parts["slip_error", "acceleration"] = (F(0), 3 / share)
    found = bounds(TASK, parts, None, STEP)
    assert isinstance(found, NoProof)
    assert found.reason.endswith("the range of friction's slope in slip contributes 3")
    assert 3 + 2 * TASK.half_ranges["push"] <= found.small_gain <= F(1001, 1000) * (3 + 2 * TASK.half_ranges["push"])


def test_what_is_measured_at_another_time_is_off_by_what_moves_until_then():
    """J = 1/50 s: J(|e2| + r′), and J(|r″| + F) with J times the largest slopes for e1, e2 and the push."""
    jitter, noise = F(1, 50), {"slip_noise": F(1, 3), "rate_noise": F(0)}
    root = ImplicitStep(pull=PULL, slopes=(F(1, 2), F(1)), remainder=F(1, 9))
    found = {c.name: c for c in channels_of(TASK, root, STEP, noise, None, jitter)}
    first, second = TASK.reference_rates
    force = TASK.reference_force + TASK.amplitude
    assert found["slip_noise"].constant == F(1, 3) + jitter * first
    assert found["slip_noise"].coefficients == {"slip_rate_error": jitter}
    assert found["rate_noise"].constant == jitter * (second + force)
    largest = [max(map(abs, ends)) for ends in (TASK.slip_chord, TASK.rate_chord, TASK.beta)]
    assert list(found["rate_noise"].coefficients) == ["slip_error", "slip_rate_error", "push"]
    assert list(found["rate_noise"].coefficients.values()) == [jitter * v for v in largest]
    assert found["root"].constant == F(1, 9) + (F(1, 3) + jitter * first) * F(1, 4) / STEP
