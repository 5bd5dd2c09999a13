"""Certificates under attack by a sampler and a simulation that know only their text."""

import importlib.util
import json
import math
from fractions import Fraction as F
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from quakedesign.lyapunov import Verdict, certificate_text
from quakedesign.lyapunov.search.certify import certify

SPECIFICATION = importlib.util.spec_from_file_location("attack", Path(__file__).with_name("attack.py"))
attack = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attack)

CTA = ("7", "5", "2.3", "1.1")  # Torres-González et al. (2017)


def proof(*arguments, **options):
    verdict, certificate = certify(*arguments, **options)
    assert verdict is Verdict.PROVED
    return certificate_text(certificate)


def withstands(text, count, trajectories=24, steps=3000):
    """Whether neither the sampler nor the simulation breaks a certificate; chatter must vanish with the step."""
    claim = attack.Claim.read(text)
    pace = 2e-2 / max(1, *(abs(float(F(g))) for g in json.loads(text)["gains"].values()))
    runs = (attack.simulate(claim, trajectories, steps, pace / finer) for finer in (1, 8, 64))
    calm = any(rise < 0.01 and share <= 1 for share, rise, _ in runs)
    return calm and not attack.sample(claim, count)


@pytest.fixture(scope="module")
def cta():
    return proof("cta", CTA, lipschitz=1, gain_range=(1, "57/40"))


@pytest.fixture(scope="module")
def super_twisting():
    return proof("super-twisting", ("1.5", "1.1"), lipschitz=1)


@pytest.mark.slow
def test_proofs_withstand(cta, super_twisting):
    for text in (cta, super_twisting):
        assert withstands(text, 100_000)


def random_claim(name, rng):
    """Log-uniform gains and range of β, with d at 30 to 90 % of what no proof can exceed."""
    if name == "super-twisting":
        gains = np.exp(rng.uniform((-1, -1), (2.5, 2.5)))
        limit = gains[1]
    elif name == "cta":
        gains = np.exp(rng.uniform((0, 0, -1, -4), (3.5, 3, 1.5, 0)))
        gains[3] *= gains[2]
        limit = gains[2] - gains[3]
    elif name == "dia":
        gains = np.append(np.exp(rng.uniform((-0.7, 1, -7), (1, 3, 0))), 0)
        limit = gains[2]
    else:
        stretch = math.exp(rng.uniform(-2, 2)) ** np.array([3 / 4, 2 / 3, 1 / 2, 1, 1, 1])
        gains = np.array([1.0, 2.0, 2.0, 0.05, 0.02, 0.005]) * np.exp(rng.uniform(-0.2, 0.2, 6)) * stretch
        limit = 0.3 * gains[3]
    lipschitz, high = limit * rng.uniform(0.3, 0.9), math.exp(rng.uniform(0, 0.4))
    return tuple(f"{g:.4g}" for g in gains), f"{lipschitz:.3g}", (1, f"{high:.3g}")


def random_proofs(name, seed):
    """Texts of proofs of random claims, without end."""
    rng = np.random.default_rng(seed)
    while True:
        gains, lipschitz, gain_range = random_claim(name, rng)
        verdict, certificate = certify(name, gains, lipschitz=lipschitz, gain_range=gain_range)
        if verdict is Verdict.PROVED:
            yield certificate_text(certificate)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "wanted"), [("super-twisting", 4), ("cta", 1), ("dia", 1)])
def test_random_proofs_withstand(name, wanted):
    assert all(withstands(text, 30_000, trajectories=9, steps=800) for text in islice(random_proofs(name, 5), wanted))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "wanted"), [("super-twisting", 120), ("cta", 106), ("dia", 70), ("cta3", 4)])
def test_hundreds_of_random_proofs_withstand_a_million_points(name, wanted):
    assert all(withstands(text, 1_000_000) for text in islice(random_proofs(name, 12), wanted))


def changed(text, change):
    raw = json.loads(text)
    change(raw)
    return attack.Claim.read(json.dumps(raw))


def test_the_sampler_finds_what_is_wrong(cta):
    def weaker(raw):
        raw["gains"]["k3"] = "2"

    def wider(raw):
        raw["uncertain"]["d"] = ["-13/10", "13/10"]

    def negative(raw):
        raw["V"][0][0] = "-" + raw["V"][0][0]

    def faster(raw):
        raw["claims"]["decrease"] = str(F(raw["claims"]["decrease"]) * 5)

    def larger(raw):
        raw["claims"]["bound_e2"] = str(F(raw["claims"]["bound_e2"]) * 2)

    assert not attack.sample(changed(cta, lambda raw: None), 20_000)
    assert "decrease" in attack.sample(changed(cta, weaker), 100_000)
    assert "decrease" in attack.sample(changed(cta, wider), 100_000)
    assert "positive" in attack.sample(changed(cta, negative), 100_000)
    assert "decrease" in attack.sample(changed(cta, faster), 100_000)
    assert "bound_e2" in attack.sample(changed(cta, larger), 100_000)


@pytest.mark.slow
def test_the_simulation_tells_a_loop_that_settles_from_one_that_does_not(super_twisting):
    def unstable(raw):
        raw["gains"] = {"k1": "2/5", "k2": "3/2"}

    share, rise, settled = attack.simulate(changed(super_twisting, lambda raw: None))
    assert settled
    assert share < 1
    assert rise < 0.05
    _, rise, settled = attack.simulate(changed(super_twisting, unstable))
    assert not settled
    assert rise > 1
