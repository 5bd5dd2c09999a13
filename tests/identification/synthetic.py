"""Records of made-up experiments: equations and integrator are SciPy's and this file's own, not the package's."""

from dataclasses import dataclass, replace
from functools import cache
from zlib import crc32

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from quakedesign.identification.record import Record

MICRON = 1e-6
NORMAL = 5e6
STEPS = ((20.0, 1 * MICRON), (15.0, 10 * MICRON), (25.0, 1 * MICRON), (20.0, 3 * MICRON))
HOLDS = ((10.0, 10 * MICRON), (20.0, 0.0), (8.0, 10 * MICRON), (50.0, 0.0), (12.0, 10 * MICRON))


@dataclass(frozen=True, kw_only=True)
class Made:
    """A record without noise, and what it was made with."""

    law: str
    time: np.ndarray
    friction: np.ndarray
    load_point: np.ndarray | None
    slip: np.ndarray | None
    truth: dict[str, float]
    stiffness: float | None
    noise: float

    def noisy(self, seed):
        """Gaussian noise of friction, readings in steps of a third of it, and of 0.1 µm in displacements."""
        draw = np.random.default_rng(seed)
        step = self.noise / 3
        friction = self.friction + self.noise * draw.standard_normal(len(self.time))
        slip = None if self.slip is None else self.slip + 0.2 * MICRON * draw.standard_normal(len(self.time))
        return Record(
            name="made",
            time=self.time,
            friction=np.round(friction / step) * step,
            load_point=None if self.load_point is None else read_in_steps(self.load_point),
            slip=None if slip is None else read_in_steps(slip),
            normal=np.full(len(self.time), NORMAL),
            normal_unit="Pa",
        )

    def true_at(self, rate):
        """True values where friction is told at another reference rate than 1 µm/s."""
        if "direct_effect" not in self.truth:
            return self.truth
        moved = (self.truth["direct_effect"] - self.truth["evolution_effect"]) * np.log(rate / MICRON)
        return self.truth | {"reference_coefficient": self.truth["reference_coefficient"] + moved}


def read_in_steps(values):
    return np.round(values / (0.1 * MICRON)) * 0.1 * MICRON


def sliding(
    law,
    pieces,
    *,
    sample=0.2,
    stiffness_given=True,
    a=0.008,
    b=0.010,
    critical_slip=10 * MICRON,
    spring=1e-3,
    second=(0.0, 100 * MICRON),
    drift=0.0,
):
    """Friction and states of a block, by Radau from piece to piece; the spring is in 1/µm.

    The normal stress grows by a share `drift` of its first value a second; `second` has the effect and the slip of
    another state.
    """
    k, reference = spring / MICRON, 0.6
    shift = np.log(pieces[0][1] / MICRON)
    more, far = second
    y, now, moved = np.array([reference + (a - b - more) * shift, -shift, -shift]), 0.0, 0.0
    times, friction, path = [], [], []

    def rates(speed, begin):
        def of(time, y):
            rate = MICRON * np.exp((y[0] - reference - b * y[1] - more * y[2]) / a)
            share = rate * np.exp(y[1:]) / MICRON
            ageing = (1 - share) if law.endswith("aging") else -share * np.log(share)
            grown = 1 + drift * (begin + time)
            pulled = (k * (speed - rate) - y[0] * drift) / grown
            return [pulled, *(ageing * MICRON / np.array([critical_slip, far]) * np.exp(-y[1:]))]

        return of

    for length, speed in pieces:
        instants = np.arange(0.0, length - sample / 2, sample)
        run = solve_ivp(
            rates(speed, now), (0, length), y, method="Radau", rtol=1e-9, atol=1e-11, t_eval=[*instants, length]
        )
        assert run.success
        times.append(now + instants)
        friction.append(run.y[0, :-1])
        path.append(moved + speed * instants)
        y, now, moved = run.y[:, -1], now + length, moved + speed * length
    truth = {
        "reference_coefficient": reference,
        "direct_effect": a,
        "evolution_effect": b,
        "critical_slip": critical_slip,
    }
    return Made(
        law=law,
        time=np.concatenate(times),
        friction=np.concatenate(friction),
        load_point=np.concatenate(path),
        slip=None,
        truth=truth if stiffness_given else truth | {"stiffness": k * NORMAL},
        stiffness=k * NORMAL if stiffness_given else None,
        noise=3e-4,
    )


def weakening(*, samples=400, residual=0.4, drop=0.17, critical_slip=2.5e-3):
    """Friction at measured slips, exponential."""
    slip = np.linspace(0, 0.02, samples)
    return Made(
        law="exponential-slip-weakening",
        time=np.linspace(0, 100, samples),
        friction=residual + drop * np.exp(-slip / critical_slip),
        load_point=None,
        slip=slip,
        truth={"residual": residual, "drop": drop, "critical_slip": critical_slip},
        stiffness=None,
        noise=2e-3,
    )


def drawn(*, samples=400, residual=0.4, drop=0.17, critical_slip=2.5e-3, spring=200.0):
    """Stick, then slip, of exponential friction behind a spring [1/m]: the balance solved by Lambert's function."""
    path = np.linspace(0, 0.02, samples)
    force = spring * path
    scale = drop / (spring * critical_slip)
    turned = (force - residual) / (spring * critical_slip)
    slip = np.real(path - residual / spring + critical_slip * lambertw(-scale * np.exp(-turned)))
    friction = np.where(force < residual + drop, force, spring * (path - slip))
    truth = {"residual": residual, "drop": drop, "critical_slip": critical_slip, "start_friction": 0.0}
    return Made(
        law="exponential-slip-weakening",
        time=np.linspace(0, 100, samples),
        friction=friction,
        load_point=path,
        slip=None,
        truth=truth | {"stiffness": spring * NORMAL},
        stiffness=None,
        noise=2e-3,
    )


KINDS = {
    "velocity steps, ageing": cache(lambda: sliding("rate-and-state-aging", STEPS)),
    "velocity steps, slip": cache(lambda: sliding("rate-and-state-slip", STEPS)),
    "slide-hold-slide, stiffness fitted": cache(lambda: sliding("rate-and-state-aging", HOLDS, stiffness_given=False)),
    "slip weakening at measured slip": weakening,
    "slip weakening behind a spring": drawn,
}

ONE_STEP = ((30.0, 1 * MICRON), (25.0, 10 * MICRON))
DRIFT = 2e-4
TRUE_TREND = -25.0  # 1/m


def _step(**more):
    told = {"sample": 0.05, "a": 0.008, "b": 0.012, "spring": 3e-3, "stiffness_given": False} | more
    return sliding("rate-and-state-slip", told.pop("pieces", ONE_STEP), **told)


def shared(draw, count, fading):
    """Noise of size one that fades by a factor from sample to sample."""
    noise = draw.standard_normal(count)
    for i in range(1, count):
        noise[i] = fading * noise[i - 1] + (1 - fading**2) ** 0.5 * noise[i]
    return noise


def _cut(record, kept):
    return replace(
        record,
        time=record.time[kept] - record.time[kept][0],
        friction=record.friction[kept],
        load_point=record.load_point[kept] - record.load_point[kept][0],
        normal=record.normal[kept],
    )


def _with(record, draw, kind):
    """A record with one trouble of laboratories."""
    count = len(record.time)
    if kind == "trend":
        return replace(record, friction=record.friction + TRUE_TREND * record.load_point)
    if kind == "trend over slip":
        return replace(record, friction=record.friction - record.slip)
    if kind == "noisy load point":
        return replace(record, load_point=record.load_point + 0.3 * MICRON * draw.standard_normal(count))
    if kind == "very noisy load point":
        return replace(record, load_point=record.load_point + 20 * MICRON * draw.standard_normal(count))
    if kind == "correlated transducer":
        return replace(record, load_point=record.load_point + 0.45 * MICRON * shared(draw, count, 0.9))
    if kind == "correlated friction":
        size = 3e-3 if record.load_point is None or record.load_point[-1] > 1e-3 else 5e-4
        return replace(record, friction=record.friction + size * shared(draw, count, 0.9))
    if kind == "drifting normal stress":
        return replace(record, normal=NORMAL * (1 + DRIFT * record.time))
    if kind == "unsteady beginning":
        return _cut(record, record.time >= 8.0)
    if kind == "uneven sampling":
        return _cut(record, (draw.uniform(size=count) < 0.5) | (np.arange(count) == 0))
    if kind == "rate column":
        return replace(record, load_rates=np.where(record.time < 30, 1 * MICRON, 10 * MICRON))
    return record


TROUBLES = {
    "trend": cache(_step),
    "noisy load point": cache(_step),
    "correlated transducer": cache(_step),
    "correlated friction": cache(_step),
    "drifting normal stress": cache(lambda: _step(drift=DRIFT)),
    "unsteady beginning": cache(lambda: _step(pieces=((3.0, 3 * MICRON), *ONE_STEP))),
    "two states": cache(lambda: _step(second=(-0.003, 60 * MICRON), b=0.010)),
    "uneven sampling": cache(_step),
    "rate column": cache(_step),
}
"""Velocity steps with one trouble each; `troubled` gives a record."""


def _holds():
    return sliding("rate-and-state-aging", HOLDS, stiffness_given=False)


OTHER_TROUBLES = {
    "slide-hold-slide, trend": cache(_holds),
    "slide-hold-slide, noisy load point": cache(_holds),
    "slide-hold-slide, correlated friction": cache(_holds),
    "measured slip, trend over slip": weakening,
    "measured slip, correlated friction": weakening,
    "behind a spring, trend": drawn,
    "behind a spring, very noisy load point": drawn,
    "behind a spring, correlated friction": drawn,
}
"""The other experiments, each with one trouble."""


def troubled(kind, seed):
    """A record with a trouble, and the truth that its fit must hold, but for the trend and the beginning."""
    made = (TROUBLES | OTHER_TROUBLES)[kind]()
    own = crc32(kind.encode())
    record = _with(made.noisy((own, seed)), np.random.default_rng((own, seed, 1)), kind.rpartition(", ")[2])
    truth = dict(made.truth)
    if kind == "two states":
        truth |= {"second_effect": -0.003, "second_slip": 60 * MICRON}
    return record, truth


LONG = {
    "long velocity steps, stiffness fitted": cache(
        lambda: sliding("rate-and-state-slip", STEPS, sample=0.01, stiffness_given=False)
    ),
    "long slip weakening behind a spring": lambda: drawn(samples=20000),
}
"""Which are fitted by means."""
