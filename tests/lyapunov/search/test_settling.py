"""Bounds on the settling time, against runs and against their own formula."""

import importlib.util
import math
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest

from quakedesign.lyapunov import Verdict, load_certificate
from quakedesign.lyapunov.search.certify import certify
from quakedesign.lyapunov.search.settling_time import fastest_settling, settling

SPECIFICATION = importlib.util.spec_from_file_location(
    "settling_region", Path(__file__).with_name("super_twisting_region.py")
)
region = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(region)

K1, K2, L, START = 1.5, 1.1, 0.5, F(1, 2)


@pytest.fixture(scope="module")
def found():
    return fastest_settling("super-twisting", (str(K1), str(K2)), lipschitz=str(L), start=START, degrees=(5, 6))


def longest_run(rng, step=2e-4):
    """Time from |e_i| ≤ START until super-twisting is at rest but for chatter, the worst of many disturbances."""
    e = np.array(np.meshgrid([-1, 0.3, 1], [-1, 0, 1])).reshape(2, -1) * float(START)
    e = np.repeat(e, 3, axis=1)
    play, time, jumps = np.arange(e.shape[1]) % 3, np.zeros(e.shape[1]), np.zeros(e.shape[1])
    for i in range(round(20 / step)):
        speed = e[1] - K1 * np.sign(e[0]) * np.sqrt(np.abs(e[0]))
        if i % 500 == 0:
            jumps = L * rng.choice((-1, 1), size=e.shape[1])
        d = np.choose(play, (L * np.sign(speed), L * np.sign(e[0]), jumps))
        e = e + step * np.array([speed, d - K2 * np.sign(e[0])])
        moving = (np.abs(e[0]) > 1e-5) | (np.abs(e[1]) > 5e-3)
        time = np.where(moving, (i + 1) * step, time)
        if not moving.any() and i > 5000:
            break
    return time.max()


def test_no_run_takes_longer(found):
    _, told = found
    measured = longest_run(np.random.default_rng(1), step=1e-3)
    assert 0.3 < measured <= told.seconds


def test_the_bound_follows_from_the_claim(found):
    certificate, told = found
    assert certificate.check() is Verdict.PROVED
    kappa = certificate.claims["decay"]
    degree = {sum(a * certificate.loop.states[s] for s, a, _ in t.factors) for t in certificate.lyapunov}.pop()
    assert (told.decay, told.power, told.factor) == (kappa, F(1, degree), degree / kappa)
    top = sum(
        abs(t.coefficient) * math.prod(float(START) ** float(a) for _, a, _ in t.factors) for t in certificate.lyapunov
    )
    inside = [value(certificate, x, y) for x in (-0.5, 0.1, 0.5) for y in (-0.5, 0, 0.5)]
    least, most = (float(told.factor) * level ** (1 / degree) for level in (max(inside), top))
    assert least <= told.seconds <= most * (1 + 1e-12)


def value(certificate, x, y):
    state = {"e1": x, "e2": y}
    return sum(
        float(t.coefficient)
        * math.prod(
            abs(state[s]) ** float(a) * (math.copysign(1, state[s]) if kind == "s" else 1) for s, a, kind in t.factors
        )
        for t in certificate.lyapunov
    )


def test_the_degree_that_settles_first_is_kept(found):
    one = fastest_settling("super-twisting", (str(K1), str(K2)), lipschitz=str(L), start=START, degrees=5)
    assert found[1].seconds <= one[1].seconds


def test_without_a_claimed_decay_nothing_is_said():
    _, certificate = certify("super-twisting", ("3", "2"), lipschitz=1)
    assert settling(certificate) is None


def test_gains_without_a_proof_have_no_settling_time():
    assert fastest_settling("super-twisting", ("0.4", "1.5"), lipschitz=1, degrees=4) is None


def test_the_start_is_of_errors_whatever_the_states_stand_for():
    # the 2-DIA's first state is κ³e1 with κ = √k_I1 = 5/4, so that |e1| ≤ 1/10 means |f1| ≤ 125/640; the rate does
    # not matter here
    file = Path(__file__).parents[3] / "proofs" / "certificates" / "dia_1.5625_5.248_1.183_0.json"
    proved = load_certificate(file)
    certificate = replace(proved, claims={**proved.claims, "decay": F(1, 10)})
    told = settling(certificate, F(1, 10))
    powers = {"s": lambda x, a: math.copysign(abs(x) ** a, x), "a": lambda x, a: abs(x) ** a}

    def value(point):
        return sum(
            float(t.coefficient) * math.prod(powers[kind](point[s], float(a)) for s, a, kind in t.factors)
            for t in certificate.lyapunov
        )

    corners = [{"f1": 125 / 640, "e2": second, "e3": third} for second in (-0.1, 0.1) for third in (-0.1, 0.1)]
    least = float(told.factor) * max(map(value, corners)) ** float(told.power)
    assert least <= told.seconds <= 4 * least
    assert told.seconds > settling(certificate, F(1, 20)).seconds
