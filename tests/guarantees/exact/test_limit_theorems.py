"""What no controller can do: closed forms, independent simulations, and no guarantee that contradicts it."""

from dataclasses import replace
from fractions import Fraction as F
from math import acosh, cosh, exp, log, sinh, sqrt

import mpmath
import numpy as np
import pytest
from random_loops import random_task
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq, linprog
from scipy.special import erfc

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, TrackingProof, guarantee
from quakedesign.guarantees.exact.limit_theorems import (
    farthest_well,
    infeasibility,
    longest_diffusion,
    longest_reaction,
    nearest_proved_well,
    smallest_peak,
    smallest_stick_slip_rate,
    smallest_withdrawal,
    too_slow,
)
from quakedesign.laws import ErrorModel, disturbance_estimate
from quakedesign.plant import uncertain_plant

REAL = uncertain_plant(load_fault("real-fault"))
STEP = F(184, 1000)
# κ = 0 and friction that never changes: e2′ = −w·e2 + u + φ with w = 1.6 1/s
STEADY = replace(
    REAL,
    friction=replace(REAL.friction, static=F(1, 4), least=F(1, 4), largest=F(1, 4), weakening=F(0)),
    growths=(REAL.stiffness[0], F(0)),
)


def pushed(task):
    """s, w, N̂μ* and λ of the plant of the theorem on withdrawals, where nothing but friction is uncertain."""
    law, area = task.friction, float(task.area_per_mass[0])
    s = area * float(law.weakening * task.normal_stress) - float(task.stiffness[0] - task.growths[0])
    w = float(task.specific_damping[0] - task.growths[1])
    return s, w, area * float(law.static), (sqrt(w * w + 4 * s) - w) / 2


def steep(task):
    """s, w, N̂, least friction nearby and slope of the steepest friction at the target, and E."""
    law, area = task.friction, float(task.area_per_mass[0])
    reach = min((law.static - law.least) / law.weakening, task.target_slip) / 20
    middle = max(law.least + law.weakening * reach, law.static - law.weakening * task.target_slip)
    kappa = float(task.stiffness[0] - task.growths[0])
    stress = float(law.static * task.normal_stress) - kappa / area * float(task.target_slip)
    m = float(law.weakening)
    s = area * m * stress / float(middle) - kappa
    return s, float(task.specific_damping[0]), area, float(middle), m, float(reach)


@pytest.mark.parametrize(("step", "held"), [(0.184, 0.184), (0.05, 0.05), (2.0, 1.0)])
def test_a_fault_that_sticks_reaches_what_a_turned_push_makes_of_it(step, held):
    """y = 2H(e^{r1 T} - e^{r2 T})/(r1 - r2), r² + wr + κ = 0; what holds for 2 s holds for 1 s, as κT² > 1 there."""
    w, kappa = 1.6, 0.48 - 3.2e-6
    fast, slow = (-w / 2 + sign * sqrt(w * w / 4 - kappa) for sign in (1, -1))
    peak = 2 * 3.2e-4 * (exp(fast * held) - exp(slow * held)) / (fast - slow)
    found = smallest_stick_slip_rate(REAL, F(str(step)))
    assert found <= peak * (1 + 1e-12)
    assert float(found) == pytest.approx(peak, rel=1e-9)


def test_the_least_slip_rate_of_a_fault_that_sticks_without_a_spring_is_that_of_a_first_order_lag():
    assert float(smallest_stick_slip_rate(STEADY, STEP)) == pytest.approx(2 * 3.2e-4 * (1 - exp(-1.6 * 0.184)) / 1.6)
    assert smallest_stick_slip_rate(replace(REAL, amplitude=F(0)), STEP) is None
    with pytest.raises(ParameterError, match="a step above 0"):
        smallest_stick_slip_rate(REAL, F(0))


def test_the_least_slip_rate_of_a_box_is_that_of_its_worst_corner():
    wide = uncertain_plant(load_fault("real-fault", box="ten-percent"))
    low, high = wide.specific_damping
    assert low < high
    assert smallest_stick_slip_rate(REAL, STEP) < smallest_stick_slip_rate(wide, STEP)


def test_a_sampled_first_order_plant_has_the_known_smallest_peak():
    for step in (F(1, 100), F(184, 1000), F(3)):
        found = smallest_peak(STEADY, step)
        exact = 2 * 3.2e-4 * (1 - exp(-1.6 * float(step))) / 1.6
        assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)
        assert found.slip_error is None
        assert isinstance(found.slip_rate_error, LowerBound)


def test_every_bound_is_on_the_side_where_the_claim_is_true():
    with mpmath.workdps(60):
        h, w, t = mpmath.mpf(32) / 10**5, mpmath.mpf(8) / 5, mpmath.mpf(184) / 1000
        peak = 2 * h * (1 - mpmath.exp(-w * t)) / w
        area = mpmath.mpf(8) / 10**8
        s = area * exact(REAL.friction.weakening) * 5 * 10**7
        s -= exact(REAL.stiffness[0] - REAL.growths[0])
        pole = (mpmath.sqrt(w * w + 4 * s) - w) / 2
        ratio = area * exact(REAL.friction.static) * 2 * 10**7 / h
        cases = (
            (smallest_peak(STEADY, STEP).slip_rate_error, peak, -1),
            (longest_reaction(REAL, F(2 * 10**7)), mpmath.log(ratio) / pole, 1),
            (longest_diffusion(REAL, F(2 * 10**7), F(0)), mpmath.acosh(ratio) ** 2 / pole, 1),
            (smallest_withdrawal(REAL, F(0)), 2 * 10**7 / ratio, -1),
        )
        for found, true, side in cases:
            excess = side * (exact(found) - true) / true
            assert -(mpmath.mpf(10) ** -50) <= excess < mpmath.mpf(10) ** -30


@pytest.mark.parametrize("left", [F(10) ** 24, F(-2), F(0)])
def test_a_slow_pole_beside_large_damping_is_a_number(left):
    """By a tool with 200 digits; also where the disturbance grows with the slip rate as fast as damping, or faster."""
    task = replace(REAL, growths=(REAL.growths[0], REAL.specific_damping[0] - left))
    with mpmath.workdps(200):
        w = exact(left)
        s = mpmath.mpf(8) / 10**8 * exact(REAL.friction.weakening) * 5 * 10**7
        s -= exact(REAL.stiffness[0] - REAL.growths[0])
        pole = (mpmath.sqrt(w * w + 4 * s) - w) / 2
        ratio = mpmath.mpf(8) / 10**8 * exact(REAL.friction.static) * 2 * 10**7 / (mpmath.mpf(32) / 10**5)
        excess = exact(longest_reaction(task, F(2 * 10**7))) * pole / mpmath.log(ratio) - 1
        assert 0 <= excess < mpmath.mpf(10) ** -30


def exact(value):
    return mpmath.mpf(value.numerator) / value.denominator


def answer_in_slip(slip, rate, time):
    """Of slip to a unit impulse of acceleration, x2' = slip·x1 − rate·x2 with real poles."""
    root = sqrt(rate * rate / 4 + slip)
    return exp(-rate * time / 2) * sinh(root * time) / root


@pytest.mark.parametrize("target", [REAL.target_slip, REAL.target_slip / 4], ids=["weak", "still weakening"])
def test_what_friction_gains_by_its_own_pressure_is_given_away(target):
    """X = 2H·h with σ of X, at steps at which σ matters."""
    task = replace(REAL, target_slip=target)
    s, w, _, middle, m, reach = steep(task)

    def sigma(peak, step):
        return s - m * (2 * peak / step + s * reach + w * peak) / (middle - m * reach)

    for step in (1.0, 10.0):
        top = 2 * 3.2e-4 * answer_in_slip(s, w, step)
        exact = brentq(lambda x, t=step: 2 * 3.2e-4 * answer_in_slip(sigma(x, t), w, t) - x, 0, top)
        found = smallest_peak(task, F(step))
        assert exact * (1 - 2e-3) < float(found.slip_rate_error) <= exact * (1 + 1e-9)
        assert float(found.slip_error) == pytest.approx(reach)
    assert exact < 0.95 * top


def test_a_disturbance_that_asks_for_too_much_pressure_leaves_friction_that_does_not_change():
    found = smallest_peak(replace(REAL, amplitude=700 * REAL.amplitude), STEP)
    exact = 2 * 700 * 3.2e-4 * answer_in_slip(-0.4799968, 1.6, 0.184)
    assert found.slip_error is None
    assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)


def test_a_long_step_of_a_stable_fault_counts_as_a_part_of_it():
    found = smallest_peak(replace(STEADY, growths=REAL.growths), F(20))
    exact = 2 * 3.2e-4 * answer_in_slip(-0.4799968, 1.6, 20 / 14)
    assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)


def test_so_does_a_long_delay_of_it():
    found = smallest_peak(replace(STEADY, growths=REAL.growths), F(1, 10), F(20))
    exact = 2 * 3.2e-4 * answer_in_slip(-0.4799968, 1.6, 0.1 + 1 / sqrt(0.4799968))
    assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)


def test_a_disturbance_that_grows_with_the_rate_takes_from_the_damping():
    found = smallest_peak(replace(STEADY, growths=(STEADY.growths[0], F(1, 10))), STEP)
    exact = 2 * 3.2e-4 * (1 - exp(-1.5 * 0.184)) / 1.5
    assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)


CALM = {
    "falls without an end": {"least": REAL.friction.static},
    "does not fall": {"weakening": F(0)},
}


@pytest.mark.parametrize("changes", CALM.values(), ids=CALM)
def test_friction_that_cannot_fall_forbids_nothing_by_falling(changes):
    task = replace(REAL, friction=replace(REAL.friction, **changes))
    found = smallest_peak(task, STEP)
    exact = 2 * 3.2e-4 * answer_in_slip(-0.4799968, 1.6, 0.184)
    assert found.slip_error is None
    assert float(found.slip_rate_error) == pytest.approx(exact, rel=1e-12)
    assert longest_reaction(task, F(2 * 10**7)) is None


def test_friction_that_falls_no_faster_than_the_springs_take_is_not_unstable():
    gained = REAL.area_per_mass[0] * REAL.friction.weakening * REAL.normal_stress
    for left in (0, 1):
        calm = replace(REAL, growths=(REAL.stiffness[0] - gained - left, F(0)))
        assert longest_reaction(calm, F(2 * 10**7)) is None
        assert smallest_withdrawal(calm, STEP) is None


def test_a_delay_counts_as_a_longer_step():
    assert smallest_peak(STEADY, STEP, F(1, 2)) == smallest_peak(STEADY, STEP + F(1, 2))


def test_an_unstable_pole_and_a_pure_delay():
    s, w, authority, pole = pushed(REAL)
    assert pole**2 + w * pole == pytest.approx(s, rel=1e-12)
    for pressure in (10**5, 2 * 10**7):
        exact = log(authority * pressure / 3.2e-4) / pole
        found = longest_reaction(REAL, F(pressure))
        assert isinstance(found, UpperBound)
        assert float(found) == pytest.approx(exact, rel=1e-12)
        assert float(longest_reaction(REAL, smallest_withdrawal(REAL, F(3)))) == pytest.approx(3, rel=1e-12)


def test_a_diffusive_path():
    _, _, authority, pole = pushed(REAL)
    ratio = authority * 2e7 / 3.2e-4 * exp(-pole * 0.184)
    found = longest_diffusion(REAL, F(2 * 10**7), STEP)
    assert float(found) == pytest.approx(acosh(ratio) ** 2 / pole, rel=1e-12)
    assert cosh(sqrt(pole * float(found))) == pytest.approx(ratio, rel=1e-9)
    assert float(farthest_well(found, F(1))) == pytest.approx(11.74, abs=0.01)
    assert float(farthest_well(found, F(4))) == pytest.approx(2 * float(farthest_well(found, F(1))))


def test_nothing_is_impossible_without_a_disturbance_and_little_without_an_instability():
    still = replace(REAL, amplitude=F(0))
    assert smallest_peak(still, STEP) is None
    assert longest_reaction(still, F(1)) is None
    assert smallest_withdrawal(STEADY, STEP) is None
    assert longest_diffusion(STEADY, F(1), STEP) is None
    for little in (F(0), F(1)):  # 1 Pa holds nothing
        assert longest_reaction(REAL, little) == 0
        assert longest_diffusion(REAL, little, F(0)) == 0


@pytest.mark.parametrize(
    "call",
    [
        lambda: smallest_peak(REAL, F(0)),
        lambda: smallest_peak(REAL, F(1), F(-1)),
        lambda: longest_reaction(REAL, F(-1)),
        lambda: longest_diffusion(REAL, F(1), F(-1)),
        lambda: longest_diffusion(REAL, F(-1), F(1)),
        lambda: smallest_withdrawal(REAL, F(-1)),
        lambda: farthest_well(UpperBound(1), F(0)),
    ],
)
def test_meaningless_times_and_pressures_are_refused(call):
    with pytest.raises(ParameterError, match="a performance limit needs"):
        call()


def test_more_uncertainty_and_larger_disturbances_forbid_more():
    wide = replace(REAL, spreads=(F(1, 10),) * 3)
    loud = replace(REAL, amplitude=2 * REAL.amplitude)
    plain = smallest_peak(REAL, STEP).slip_rate_error
    assert smallest_peak(wide, STEP).slip_rate_error > plain
    assert float(smallest_peak(loud, STEP).slip_rate_error) == pytest.approx(2 * float(plain), rel=1e-3)
    assert smallest_withdrawal(wide, STEP) > smallest_withdrawal(REAL, STEP)
    for task in (wide, loud):
        assert longest_reaction(task, F(2 * 10**7)) < longest_reaction(REAL, F(2 * 10**7))


@pytest.mark.parametrize("step", [F(184, 1000), F(1), F(2)])
def test_the_best_linear_law_is_hardly_above_the_limit_for_all(step):
    """l1-optimal: the answer of e2 to a disturbance over one period, brought to rest in ten, with the least sum."""
    s, w, *_ = steep(REAL)
    whole = expm(np.array([[0, 1, 0], [s, -w, 1], [0, 0, 0]]) * float(step))
    a, b = whole[:2, :2], whole[:2, 2]
    periods = 10
    answers = [b]  # of the state after each period to each pressure, and to the disturbance
    for _ in range(periods):
        answers.append(a @ answers[-1])
    forced = np.array(answers)
    moved = np.zeros((periods + 1, periods, 2))
    for k in range(periods + 1):
        for j in range(k):
            moved[k, j] = answers[k - 1 - j]
    rates, ends = moved[:, :, 1], moved[-1].T
    eye = np.eye(periods + 1)
    found = linprog(
        np.r_[np.zeros(periods), np.ones(periods + 1)],
        A_ub=np.block([[rates, -eye], [-rates, -eye]]),
        b_ub=np.r_[-forced[:, 1], forced[:, 1]],
        A_eq=np.c_[ends, np.zeros((2, periods + 1))],
        b_eq=-forced[-1],
        bounds=[(None, None)] * periods + [(0, None)] * (periods + 1),
    )
    best, limit = float(REAL.amplitude) * found.fun, float(smallest_peak(REAL, step).slip_rate_error)
    assert limit <= best * (1 + 1e-9)
    assert best == pytest.approx(limit, rel=0.02)


def deadbeat(whole, share):
    """Bring a share of both errors to zero in two periods, the last disturbance cancelled."""
    a, b = whole[:2, :2], whole[:2, 2]
    gains = np.linalg.solve(np.array([a @ b, b]).T, a @ a)[0]  # u now, with the best u next
    return lambda e, last, _k: -share * (gains @ e) - last


def controllers(step, s, w):
    whole = expm(np.array([[0, 1, 0], [s, -w, 1], [0, 0, 0]]) * step)
    return {
        "deadbeat": deadbeat(whole, 1.0),
        "half as fast": deadbeat(whole, 0.5),
        "linear": lambda e, last, _k: -0.5 * e[0] / step**2 - 0.9 * e[1] / step - last,
        "cautious": lambda e, last, _k: -0.05 * e[0] / step**2 - 0.6 * e[1] / step - 0.9 * last,
        "no estimate": lambda e, _last, _k: -0.6 * e[0] / step**2 - 1.1 * e[1] / step,
        "switching": lambda e, last, _k: -last - 5e-4 * np.tanh((e[1] + 0.3 * e[0] / step) / 1e-4),
        "dead zone": lambda e, last, _k: -last - (0.9 * e[1] + 0.4 * (e[0] - np.clip(e[0], -1e-4, 1e-4)) / step) / step,
        "in turn": lambda e, last, k: -last - (0.9 + 0.2 * (k % 2)) * e[1] / step - 0.3 * e[0] / step**2,
    }  # fmt: skip


def fault(e, q, phi, step, plant):
    """One period of the fault with affine friction at the target, by Runge and Kutta."""
    s, w, area, middle, m, _ = plant

    def change(x):
        return np.array([x[1], s * x[0] - w * x[1] + area * (middle - m * x[0]) * q + phi])

    h = step / 6
    for _ in range(6):
        k1 = change(e)
        k2 = change(e + h / 2 * k1)
        k3 = change(e + h / 2 * k2)
        k4 = change(e + h * k3)
        e = e + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return e


@pytest.mark.parametrize("name", controllers(0.184, 1, 1))
def test_no_controller_is_seen_below_the_smallest_peak(name):
    plant = steep(REAL)
    step, periods, push = 0.184, 600, float(REAL.amplitude)
    limit, reach = float(smallest_peak(REAL, STEP).slip_rate_error), plant[-1]
    law = controllers(step, *plant[:2])[name]
    e, last, peak, slips = np.zeros(2), 0.0, 0.0, [0.0]
    for k in range(periods):
        q = law(e, last, k) / (plant[2] * plant[3])
        turned = fault(e, q, -push, step, plant)
        e, last = fault(e, q, push, step, plant), push
        peak = max(peak, abs(e[1]), abs(turned[1]))
        slips.append(e[0])
        assert abs(e[0]) <= reach
    left = (max(slips) - min(slips)) / (periods * step)  # the least e2 that the argument has found by now
    assert left < 0.02 * limit
    assert peak >= limit - left


@pytest.mark.parametrize("name", ["half as fast", "linear", "in turn"])
def test_nor_below_that_of_a_pressure_one_period_late(name):
    """Laws that predict the state at which their pressure arrives; the disturbance turns for two periods."""
    plant = steep(REAL)
    s, w, area, middle, _, reach = plant
    step, periods, push = 0.184, 600, float(REAL.amplitude)
    limit = float(smallest_peak(REAL, STEP, STEP).slip_rate_error)
    law = controllers(step, s, w)[name]
    whole = expm(np.array([[0, 1, 0], [s, -w, 1], [0, 0, 0]]) * step)
    e, waiting, peak, slips = np.zeros(2), 0.0, 0.0, [0.0]
    for k in range(periods):
        expected = whole[:2, :2] @ e + whole[:2, 2] * (area * middle * waiting + push)
        q = law(expected, push, k) / (area * middle)
        turned = fault(fault(e, waiting, -push, step, plant), q, -push, step, plant)
        e, waiting = fault(e, waiting, push, step, plant), q
        peak = max(peak, abs(e[1]), abs(turned[1]))
        slips.append(e[0])
        assert abs(e[0]) <= reach
    left = (max(slips) - min(slips)) / (periods * step)
    assert left < 0.02 * limit
    assert limit - left <= peak <= 1.5 * limit


def hidden_time(plant, push, slip_noise, rate_noise=None):
    """For how long a turned push is not seen: s, w of the plant; slips and slip rates in closed form by quadrature."""

    def rate(t):
        return answer_in_slip(*plant, t)

    def seen(t):
        slip = quad(rate, 0, t)[0] * push / slip_noise
        return max(slip, 0 if rate_noise is None else rate(t) * push / rate_noise) - 1

    return brentq(seen, 0, 100)


def test_noise_of_the_slip_counts_as_a_delay():
    """First-order plant, the slip told within n: H(τ/w − (1 − e^{−wτ})/w²) = n."""
    for noise in (1e-8, 1e-6, 1e-4):
        hidden = brentq(lambda t, n=noise: 3.2e-4 * (t / 1.6 - (1 - exp(-1.6 * t)) / 1.6**2) - n, 0, 100)
        exact = 2 * 3.2e-4 * (1 - exp(-1.6 * (0.184 + hidden))) / 1.6
        found = smallest_peak(STEADY, STEP, slip_noise=F(noise), rate_noise=None)
        assert exact * (1 - 1e-4) < float(found.slip_rate_error) <= exact * (1 + 1e-9)


def test_noise_of_the_slip_rate_of_a_first_order_plant_is_added_twice():
    """X = 2H(1 − e^{−wT})/w + 2n′e^{−wT}, the slip told within so much that it tells nothing."""
    for noise in (1e-7, 1e-5, 1e-4):
        exact = 2 * 3.2e-4 * (1 - exp(-1.6 * 0.184)) / 1.6 + 2 * noise * exp(-1.6 * 0.184)
        found = smallest_peak(STEADY, STEP, slip_noise=F(1), rate_noise=F(noise))
        assert exact * (1 - 1e-4) < float(found.slip_rate_error) <= exact * (1 + 1e-9)


def test_without_noise_of_one_of_both_nothing_is_hidden():
    plain = smallest_peak(REAL, STEP)
    assert smallest_peak(REAL, STEP, slip_noise=F(1), rate_noise=F(0)) == plain
    assert smallest_peak(REAL, STEP, slip_noise=F(0), rate_noise=F(1)) == plain
    assert smallest_peak(REAL, STEP, slip_noise=F(0), rate_noise=None) == plain


@pytest.mark.parametrize(("times", "noise", "step"), [(1, 1e-6, 0.184), (1, 1e-4, 0.184), (50, 1e-2, 2.0)])
def test_noise_is_hidden_while_friction_weakens(times, noise, step):
    """X = 2H·h(T + τ) with σ of X, and σ₊ of the X that there would be without what friction gains."""
    push = 3.2e-4 * times
    s, w, _, middle, m, reach = steep(REAL)
    found = smallest_peak(replace(REAL, amplitude=F(push)), F(step), slip_noise=F(noise), rate_noise=None)

    def gained(peak, more=0.0):
        return m * (2 * peak / step + s * reach + w * peak + more) / (middle - m * reach)

    def peak(slip, hidden):
        return 2 * push * answer_in_slip(slip, w, step + hidden)

    most = peak(s, hidden_time((s, w), push, noise))
    hidden = hidden_time((s + gained(most, push), w), push, noise)
    exact = brentq(lambda x: peak(s - gained(x), hidden) - x, most / 4, most)
    assert exact * (1 - 3e-4) < float(found.slip_rate_error) <= exact * (1 + 1e-9)
    assert float(found.slip_error) == pytest.approx(reach)


@pytest.mark.parametrize("told", [(1e-6, None), (1e-6, 1e-5), (1e-4, 2e-4)])
def test_no_turn_that_noise_hides_moves_the_slip_rate_further(told):
    """Of all pushes in [0, 2H] whose slip and slip rate stay within 2n and 2n′ up to the sample: a linear programme."""
    kappa, w, span, cells = 0.4799968, 1.6, 8 * STEP, 160
    calm = replace(STEADY, growths=REAL.growths)
    flow = expm(np.array([[0, 1, 0], [-kappa, -w, 1], [0, 0, 0]]) * float(span / cells))
    answers = [flow[:2, 2]]
    for _ in range(cells - 1):
        answers.append(flow[:2, :2] @ answers[-1])
    answers = np.array(answers)
    past = cells * 7 // 8  # cells before the sample
    seen = np.zeros((past, 2, cells))
    for k in range(past):
        seen[k, :, : k + 1] = answers[k::-1].T
    rows = [seen[:, i] for i, noise in enumerate(told) if noise is not None]
    sizes = [np.full(past, 2 * noise) for noise in told if noise is not None]
    found = linprog(
        -answers[::-1, 1],
        A_ub=np.vstack([*rows, *(-row for row in rows)]),
        b_ub=np.concatenate(sizes * 2),
        bounds=(0, 2 * 3.2e-4),
    )
    slip, rate = told
    limit = smallest_peak(calm, STEP, slip_noise=F(slip), rate_noise=None if rate is None else F(rate))
    assert -found.fun == pytest.approx(float(limit.slip_rate_error), rel=5e-3)


def test_more_noise_and_larger_disturbances_forbid_more():
    peaks = [smallest_peak(REAL, STEP, slip_noise=F(n, 10**8), rate_noise=None) for n in (0, 1, 100, 10**4, 10**6)]
    rates = [peak.slip_rate_error for peak in peaks]
    assert rates == sorted(set(rates))
    calm = replace(STEADY, growths=REAL.growths)
    swings = [smallest_peak(calm, STEP, slip_noise=F(n, 10**6), rate_noise=None) for n in (1, 10**2, 10**4)]
    assert [peak.slip_rate_error for peak in swings] == sorted(peak.slip_rate_error for peak in swings)
    loud = replace(REAL, amplitude=2 * REAL.amplitude)
    assert smallest_peak(loud, STEP, slip_noise=F(1, 10**6), rate_noise=None).slip_rate_error > rates[2]


@pytest.mark.parametrize("noise", [{"slip_noise": F(-1)}, {"slip_noise": F(1), "rate_noise": F(-1)}])
def test_negative_noise_is_refused(noise):
    with pytest.raises(ParameterError, match="bounds of noise of at least 0"):
        smallest_peak(REAL, STEP, **noise)


@pytest.mark.parametrize("weights", [(0.5, 0.9, 0.3), (0.2, 0.6, 0.1), (0.5, 1.0, 0.9)])
def test_no_law_that_is_told_a_noisy_slip_is_seen_below_the_smallest_peak(weights):
    """An observer of e1, e2 and the push, the slip told too low, against a push that turns before some sample."""
    plant = steep(REAL)
    s, w, area, middle, _, reach = plant
    step, periods, push, noise = 0.184, 300, float(REAL.amplitude), 1e-6
    limit = float(smallest_peak(REAL, STEP, slip_noise=F(noise), rate_noise=None).slip_rate_error)
    hidden = hidden_time((s, w), push, noise)
    whole = expm(np.array([[0, 1, 0], [s, -w, 1], [0, 0, 0]]) * step)
    corrections = np.array([weights[0] + 0.4, weights[1] / step, weights[2] / step**2])

    def law(guess, told):
        guess = guess + corrections * (told - guess[0])
        u = -0.5 * guess[0] / step**2 - 0.9 * guess[1] / step - guess[2]
        return u / (area * middle), whole @ [guess[0], guess[1], guess[2] + u] + [0, 0, -u]

    e, guess, peak, slips = np.zeros(2), np.zeros(3), 0.0, []
    for _ in range(periods):
        q, ahead = law(guess, e[0] - noise)
        follows = fault(e, q, push, step, plant)
        early = fault(e, q, push, step - hidden, plant)
        turned = fault(early, q, -push, hidden, plant)  # up to the next sample, at which it is told the same
        assert abs(follows[0] - turned[0]) < 2 * noise * 1.01
        again, _ = law(ahead, follows[0] - noise)
        peak = max(peak, abs(follows[1]), abs(fault(turned, again, -push, step, plant)[1]))
        e, guess = follows, ahead
        slips.append(e[0])
        assert abs(e[0]) <= reach
    left = (max(slips[50:]) - min(slips[50:])) / (250 * step)
    assert left < 0.02 * limit
    assert peak >= limit - left


def escapes(task, pressure, reaction, path):
    """Whether slip passes E under the push although everything is withdrawn from the first moment on."""
    s, w, authority, pole = pushed(task)
    law = task.friction
    end, m = float((law.static - law.least) / law.weakening), float(law.weakening)
    area, push = float(task.area_per_mass[0]), float(task.amplitude)
    x, rate, time, h = 0.0, 0.0, 0.0, 2e-3 / pole
    while time < reaction + 25 / pole and 0 <= x < end and rate >= 0:
        p = -pressure * path(time - reaction)
        rate += h * (s * x - w * rate + (authority - area * m * x) * p + push)
        x += h * rate
        time += h
    return x >= end


def test_the_longest_reaction_parts_what_escapes_from_what_can_be_held():
    pressure = 5 * 3.2e-4 / pushed(REAL)[2]
    limit = float(longest_reaction(REAL, F(pressure)))
    assert escapes(REAL, pressure, 1.01 * limit, lambda t: float(t >= 0))
    assert not escapes(REAL, pressure, 0.97 * limit, lambda t: float(t >= 0))


def test_the_longest_diffusion_time_does_as_well():
    pressure = 20 * 3.2e-4 / pushed(REAL)[2]
    limit = float(longest_diffusion(REAL, F(pressure), STEP))

    def path(span):
        def step_answer(t):
            n = np.arange(30)
            return 2 * float(((-1.0) ** n * erfc((2 * n + 1) / 2 * sqrt(span / t))).sum()) if t > 0 else 0.0

        return step_answer

    assert escapes(REAL, pressure, 0.184, path(1.03 * limit))
    assert not escapes(REAL, pressure, 0.184, path(0.93 * limit))


WITHDRAWAL = F(10**5)
JUST = F(1, 10**9)  # seconds


@pytest.mark.parametrize(("share", "infeasible"), [(F(1), False), (F(1) + JUST, True), (F(99, 100), False)])
def test_sampling_and_delay_are_infeasible_where_their_sum_is_above_the_longest_reaction(share, infeasible):
    late = longest_reaction(REAL, WITHDRAWAL)
    step, delay = F(2, 3) * late * share, F(1, 3) * late * share
    reason = too_slow(REAL, WITHDRAWAL, step, delay)
    assert bool(reason) is infeasible
    assert too_slow(replace(REAL, change=F(1, 10**4)), WITHDRAWAL, step, delay) == ""  # the limit is for any change
    if infeasible:
        assert f"at most 100 kPa can hold the fault with T_s + delay above {late.quantity('s')}" in reason
        assert late < step + delay


def test_nothing_is_too_slow_where_there_is_no_limit():
    still = replace(REAL, amplitude=F(0))
    assert longest_reaction(still, WITHDRAWAL) is None
    assert too_slow(still, WITHDRAWAL, F(10**6), F(10**6)) == ""
    assert infeasibility(still, WITHDRAWAL, F(10**6), F(10**6)) == ""


@pytest.mark.parametrize("what", ["delay", "diffusion"])
def test_a_path_is_infeasible_beyond_its_own_limit_for_any_step(what):
    late, far = longest_reaction(REAL, WITHDRAWAL), longest_diffusion(REAL, WITHDRAWAL, F(0))
    limit = {"delay": late, "diffusion": far}[what]
    said = {"delay": "with a delay above", "diffusion": "through a diffusion path of L^2/D above"}[what]
    for value, infeasible in ((F(limit), False), (limit + JUST, True), (limit / 2, False)):
        given = {"delay": F(0), "diffusion": F(0)} | {what: value}
        reason = infeasibility(REAL, WITHDRAWAL, **given)
        assert bool(reason) is infeasible
        assert infeasibility(replace(REAL, change=F(1, 10**4)), WITHDRAWAL, **given) == ""
    beyond = infeasibility(REAL, WITHDRAWAL, **{"delay": F(0), "diffusion": F(0)} | {what: limit + JUST})
    assert f"at most 100 kPa can hold the fault {said} {limit.quantity('s')}, for any T_s" in beyond


def test_a_proved_well_is_at_the_distance_of_its_diffusion_time_rounded_down():
    distance = nearest_proved_well(LowerBound(2), F(3))
    assert 0 <= 6 - distance**2 < 1e-12
    assert 0 <= farthest_well(UpperBound(2), F(3)) ** 2 - 6 < 1e-12
    assert 0 <= farthest_well(UpperBound(2), F(1, 2)) - 1 < 1e-12
    assert 0 <= 1 - nearest_proved_well(LowerBound(2), F(1, 2)) < 1e-12
    for well, time in ((nearest_proved_well, LowerBound(2)), (farthest_well, UpperBound(2))):
        for diffusivity in (F(0), F(-1)):
            with pytest.raises(ParameterError, match="a diffusivity above 0"):
                well(time, diffusivity)


def law_for(task, step):
    """Feedback with an estimate of the disturbance, its three numbers as usual ones."""
    model = task.model
    flow = np.array([[0, 1, 0], [float(model.slip), -float(model.rate), 1], [0, 0, 0]])
    moved, gain = expm(flow * float(step)), model.gain
    of_errors, of_command = (tuple(tuple(map(F, row)) for row in m) for m in (moved[:2, :2], moved[:2, 2:].T))
    known = ErrorModel.delayed(of_errors, of_command, gain)
    return disturbance_estimate((F(3, 5) / gain / step**2, 1 / gain / step), F(1, 10), known)


def contradicted(numbers, noise=(F(0), F(0))):
    """How many random faults have a guarantee, and those whose guarantee is beyond a limit.

    Noise of slip and slip rate as shares of what the disturbance does within T_s.
    """
    proved, wrong = 0, []
    for number in numbers:
        task, step = random_task(number)
        told = {"slip_noise": noise[0] * task.amplitude * step**2, "rate_noise": noise[1] * task.amplitude * step}
        found = guarantee(task, SampledLoop(law=law_for(task, step), step=step, **told))
        if isinstance(found, TrackingProof):
            limit, claims = smallest_peak(task, step, **told), found.claims
            proved += 1
            held = limit.slip_error is None or claims.slip_error <= limit.slip_error
            least = smallest_withdrawal(task, step)
            if held and claims.slip_rate_error < limit.slip_rate_error:
                wrong.append(number)
            if least is not None and -claims.least_pressure < least:
                wrong.append(number)
    return proved, wrong


@pytest.mark.parametrize("first", range(0, 20, 4))
def test_no_guarantee_contradicts_a_limit(first):
    proved, wrong = contradicted(range(first, first + 4))
    assert proved >= 3
    assert not wrong


def test_none_with_noise_contradicts_a_limit_for_who_is_told_no_more():
    proved, wrong = contradicted(range(4), (F(1, 10), F(1, 10)))
    assert proved >= 3
    assert not wrong


@pytest.mark.slow
def test_no_guarantee_of_two_hundred_random_faults_contradicts_a_limit():
    for noise in ((F(0), F(0)), (F(1, 10), F(1, 10))):
        proved, wrong = contradicted(range(200), noise)
        assert proved >= 100
        assert not wrong
