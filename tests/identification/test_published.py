"""Real records against printed fits, and against a fit by SciPy with equations of this file.

The basalt and sepiolite steps are means of neighbouring samples in `tests/data/records`. The others are there after
``python benchmarks/published_records.py CLONES FOLDER``, with ``QUAKEDESIGN_RECORDS=FOLDER``.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from published_records import P655_WINDOWS, ordered
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from quakedesign.fault import friction_law
from quakedesign.identification import identify, next_command, read_record
from quakedesign.simulation import SpringSlider, simulate_state

CUT = Path(__file__).parents[1] / "data" / "records"
FETCHED = Path(os.environ.get("QUAKEDESIGN_RECORDS", "nowhere"))
fetched = pytest.mark.skipif(not FETCHED.exists(), reason="QUAKEDESIGN_RECORDS names no folder")


def friction_after(time, rates, a, b, slip, softness):
    """Friction, less that before, from a change of rate on [s], by the slip law behind a spring [1/m]."""
    slow, fast = rates

    def change(_, y):
        rate, aged = np.exp(y[0]), y[0] + y[1]
        evolved = -rate / slip * (aged - np.log(slip))
        return [(softness * (fast - rate) - b * evolved) / a, evolved]

    run = solve_ivp(
        change, (0, time[-1]), [np.log(slow), np.log(slip / slow)], "Radau", t_eval=time, rtol=1e-5, atol=1e-7
    )
    assert run.success
    return a * (run.y[0] - np.log(slow)) + b * (run.y[1] - np.log(slip / slow))


def independent(record, first, near):
    """Slip law, trend and spring by least squares about `near`, b and D_c [m], of a step at about a time [s]."""
    time, load, friction = record.time, record.load_point, record.friction
    early, late = time < 0.9 * first, time > first + 0.1 * (time[-1] - first)
    lines = [np.polyfit(time[part], load[part], 1) for part in (early, late)]
    rates = [line[0] for line in lines]
    step = (lines[0][1] - lines[1][1]) / (rates[1] - rates[0])
    path = np.where(time < step, rates[0] * time, rates[0] * step + rates[1] * (time - step)) / np.ptp(load)

    def left(at):
        level, trend, b, delay = at[:4]
        a, slip, k = np.exp(at[4:])
        after = time > step + delay * 0.01
        found = level + trend * path
        found[after] += friction_after(time[after] - step - delay * 0.01, rates, a, b, slip, k)
        return (friction - found) * 1e3

    guess = [friction[early].mean(), 0.0, near[0], 0.0, np.log(0.01), np.log(near[1]), np.log(8e3)]
    best = least_squares(left, guess, x_scale=[1e-3, 1e-3, 1e-3, 1, 0.1, 0.3, 0.3])
    told = np.exp(best.x[4:])
    return {"direct_effect": told[0], "evolution_effect": best.x[2], "critical_slip": told[1], "trend": best.x[1]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "at", "near", "sign", "explained"),
    [
        ("basalt_7", 2.51, (0.01, 1e-5), -1, True),
        ("basalt_4", 30.0, (0.01, 1e-4), 0, False),
        ("sepiolite_3", 3265.0, (-0.008, 1e-4), 1, False),
    ],
)
def test_a_real_step_agrees_with_an_independent_fit_and_has_no_wrong_sign(name, at, near, sign, explained):
    """The independent one is of white noise and known rates: it lies in the box of the joint region, not in its middle.

    The sign is 0 where it is open: after step 4 on basalt friction may drift or evolve. The means of step 3 on
    sepiolite have few independent pieces of noise: they tell a - b, but not a and b apart.
    """
    record = read_record(CUT / f"{name}.csv")
    own = independent(record, at, near)
    found = identify(record, "rate-and-state-slip")
    assert next_command(found, "found.toml").startswith("none")  # basalt 7 is too wide for a guarantee
    for quantity in ("direct_effect", "evolution_effect", "critical_slip"):
        assert found.estimates[quantity].least < own[quantity] < found.estimates[quantity].most, quantity
    difference = own["direct_effect"] - own["evolution_effect"]
    assert found.difference.least < difference < found.difference.most
    (check,) = [check for check in found.assessment.checks if check.name == "sign"]
    assert np.sign(check.value) * check.passed == sign
    assert (found.assessment.verdict == "explains the record") == explained


@pytest.mark.slow
def test_the_sign_after_a_step_down_on_sepiolite_is_open():
    """An independent fit with a short D_c has a - b = +0.012, one with a D_c of 1.3 mm +0.023 and a trend upward."""
    found = identify(read_record(CUT / "sepiolite_2.csv"), "rate-and-state-slip")
    assert found.assessment.verdict == "cannot tell"
    assert found.difference.low < 0.0121 < found.difference.high


@pytest.mark.slow
def test_two_steps_on_basalt_are_not_explained_by_one_law():
    """Whose a differ by a quarter and whose D_c hardly do."""
    from quakedesign.identification.several_steps import identify_steps

    found = identify_steps([read_record(CUT / f"basalt_{step}.csv") for step in (4, 7)], "rate-and-state-slip")
    assert found.steps[0].estimates["direct_effect"].value < found.steps[1].estimates["direct_effect"].value
    assert found.common.assessment.verdict == "cannot tell"


# ----------------------------------------------------------------------
# What is fetched: p655 of xlook, printed in its file p655_r, and QDYN's frozen run.

PRINTED = {
    "p655_1": ((0.006005, 0.000053), (0.004230, 0.000051), (17.745e-6, 0.334e-6)),
    "p655_2": ((0.005903, 0.000062), (0.004501, 0.000059), (40.959e-6, 0.910e-6)),
}
"""a, b and D_c [m] of the slip law at 1.6e-3 /um, each with its printed deviation."""
NAMES = "direct_effect", "evolution_effect", "critical_slip"


@fetched
@pytest.mark.slow
@pytest.mark.parametrize(("name", "step", "rates"), [("p655_1", 24533, (2.2, 22)), ("p655_2", 25675, (23, 232))])
def test_xlooks_printed_fits_come_from_rows_of_rising_displacement_without_a_trend(name, step, rates):
    """Friction over displacement, of every row at which that is larger than before, unweighted, known rates and row.

    Within three of the printed deviations; with a trend the squares fall by a third and a half, and a - b grows.
    """
    table = np.load(FETCHED / "p655.npz")["table"]
    rows = ordered(table[:, 1])
    first, last = P655_WINDOWS[name]
    path, friction = table[rows[first : last + 1], 1] * 1e-6, (table[:, 2] / table[:, 3])[rows[first : last + 1]]
    place = step - first
    rates = tuple(rate * 1e-6 for rate in rates)

    def left(at, trend):
        found = np.full(len(path), at[0]) + (at[4] * (path - path[place]) if trend else 0.0)
        time = (path[place + 1 :] - path[place]) / rates[1]
        found[place + 1 :] += friction_after(time, rates, np.exp(at[1]), np.exp(at[2]), np.exp(at[3]), 1.6e3)
        return (friction - found) * 1e4

    fits = {}
    for trend in (False, True):
        start = [friction[:place].mean(), np.log(0.0067), np.log(0.005), np.log(2e-5), *([0.0] if trend else [])]
        fits[trend] = least_squares(left, start, x_scale=[1e-3, 0.1, 0.1, 0.3, 1.0][: len(start)], args=(trend,))
    for value, (printed, deviation) in zip(np.exp(fits[False].x[1:4]), PRINTED[name], strict=True):
        assert abs(value - printed) < 3 * deviation
    assert 2 * fits[False].cost * 1e-8 == pytest.approx({"p655_1": 0.000129, "p655_2": 0.00042}[name], rel=0.01)
    assert fits[True].cost < 0.7 * fits[False].cost
    without, with_trend = (np.exp(fits[trend].x[1]) - np.exp(fits[trend].x[2]) for trend in (False, True))
    assert with_trend > without + 4e-4


@fetched
@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTED)
def test_without_a_trend_the_printed_fits_lie_in_our_intervals(name):
    record = read_record(FETCHED / f"{name}.csv")
    found = identify(record, "rate-and-state-slip", stiffness=1.6e11, trend="none")
    for quantity, (printed, _) in zip(NAMES, PRINTED[name], strict=True):
        assert found.estimates[quantity].low < printed < found.estimates[quantity].high
    assert found.difference.low < PRINTED[name][0][0] - PRINTED[name][1][0] < found.difference.high


@fetched
@pytest.mark.slow
def test_every_row_of_qdyns_frozen_run_but_the_last_which_repeats_the_one_before():
    """test/stickslip of ydluo/qdyn: 44 036 rows of 17 cycles. Times differ by 1e-5 s at most, friction by 2e-7."""
    run = np.load(FETCHED / "qdyn_stick_slip.npz")
    time, theta, friction = (run[name][:-1] for name in ("time", "theta", "friction"))
    assert len(time) == 44036
    law = friction_law("rate-and-state-aging")(
        reference_coefficient=0.6,
        direct_effect=0.01,
        evolution_effect=0.025,
        critical_slip=1e-5,
        reference_rate=1e-6,
        slowest_rate=1e-14,
        fastest_rate=10.0,
    )
    slider = SpringSlider(law=law, stiffness=2e9, normal_stress=5e6, damping=2e10 / 3000 / 2)
    rate = 1e-6 * np.exp((friction[0] - 0.6 - 0.025 * np.log(theta[0] / 10)) / 0.01)
    ours = simulate_state(
        slider,
        1e-6,
        duration=1e4,
        start_rate=float(rate),
        start_state=(float(theta[0]),),
        times=time,
        method="dop853",
        rtol=1e-11,
    )
    loading = 400 * np.abs(ours.slip_rate - 1e-6)  # k/sigma (V - V_pl) is the rate of friction [1/s]
    assert np.all(np.abs(ours.friction - friction) < 2e-7 + 1e-5 * loading)
    assert (ours.friction.min(), ours.friction.max()) == pytest.approx((0.4116624, 0.6788654), abs=3e-7)
    fast = ours.slip_rate > 1e-3
    peaks = [
        time[part][np.argmax(ours.slip_rate[part])]
        for part in np.split(np.arange(len(time)), _edges(fast))
        if fast[part[0]]
    ]
    assert np.diff(peaks)[1:] == pytest.approx(585.48391779, abs=2e-6)


def _edges(inside):
    return np.flatnonzero(np.diff(inside.astype(int))) + 1
