"""A simulator of a held loop that knows numbers only, and courses made to hurt it. NumPy; nothing of the package.

The plant e1′ = e2, e2′ = s·e1 − w·e2 + β·b·p + φ is integrated by RK4 in small steps, many courses at once. The law is
p = Cz + Dy, z ← Fz + Gy at every sample, held from a delay later, through a lag or spreading through a layer of rock
where there is one; y = (e1, e2), or (e1, e2, w) with w by a rule, of the errors as they are measured.
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Held:
    """Numbers of a loop: matrices of the law, b, ranges of s, w and β, T_s, delay, bounds of φ and noise, all in SI.

    For a friction of the slip alone: how much β changes per slip at most, and the reference's rate. The rock's L²/D, of
    which so many modes are followed, is zero where the well is at the fault; a lag in its place has one. The law's
    states begin at 0, or at first times the errors that it is told then.
    """

    F: np.ndarray
    G: np.ndarray
    C: np.ndarray
    D: np.ndarray
    b: float
    s: tuple
    w: tuple
    beta: tuple
    step: float
    delay: float
    force: float
    ends: object = None
    noise: tuple = (0.0, 0.0)
    slope: float = 0.0
    pace: float = 0.0
    rock: float = 0.0
    modes: int = 40
    lag: float = 0.0
    first: object = None


@dataclass(frozen=True)
class Moved:
    """By how many small steps every measurement and every pressure of every course is late (periods × courses).

    A pressure that arrives is reached at a rate [m/s³], from b·p of the one before, or at once. What is told may be the
    mean over so many small steps up to the measurement.
    """

    measured: np.ndarray
    arrived: np.ndarray
    rate: object = None
    mean: int = 0


def numbers(claim, force=None):
    """What a guarantee says of its loop; a bound of φ of its own in place of amplitude and reference."""
    held, law, task = claim.sampled_loop, claim.sampled_loop.law, claim.task
    floats = lambda m: np.array(m, dtype=float)  # noqa: E731
    return Held(
        F=floats(law.update),
        G=floats(law.measured),
        C=floats(law.output),
        D=floats(law.feedback),
        b=float(task.authority),
        s=tuple(map(float, task.slip_chord)),
        w=tuple(map(float, task.rate_chord)),
        beta=tuple(map(float, task.beta)),
        step=float(held.step),
        delay=float(held.delay),
        force=float(task.amplitude + task.reference_force if force is None else force),
        noise=(float(held.slip_noise), float(held.rate_noise)),
        slope=float(task.friction.weakening * task.area_per_mass[1] / task.authority),
        pace=float(task.reference_rates[0]),
        rock=float(held.diffusion),
        lag=float(held.lag),
    )


def sliding(controller, weight, authority, claim, divisor):
    """The same of a 2-CTA or 2-DIA; the end of the implicit step is found here."""
    known = numbers(claim)
    step, scale, a = known.step, float(controller.scale), float(weight)
    gain = step * float(authority)
    push, k = gain / divisor, [float(v) for v in controller.gains.values()]

    def pull(slip, rate, sign):
        """q, with a given selection of the sign of the slip."""
        if controller.name == "cta":
            smooth = scale ** (2 / 3) * k[0] * np.cbrt(slip) + scale**0.5 * k[1] * np.sign(rate) * abs(rate) ** 0.5
            return push * (smooth + step * scale * (k[2] * sign + k[3] * np.sign(rate)))
        inner = np.sign(rate) * abs(rate) ** 1.5 + scale**0.5 * k[0] ** 1.5 * slip
        return push * (scale**0.5 * k[1] * np.cbrt(inner) + step * scale * k[2] * sign)

    def ends(e1, e2):
        dead = -e1 / step
        low, high = (dead - e2 + pull(0 * e1, dead, sign) for sign in (-1, 1))
        found, moving = dead.copy(), (low > 0) | (high < 0)
        if moving.any():
            left, right, p, q = np.full(moving.sum(), -50.0), np.full(moving.sum(), 50.0), e1[moving], e2[moving]
            for _ in range(90):
                w = (left + right) / 2
                above = w - q + pull(p + step * w, w, np.sign(p + step * w)) > 0
                left, right = np.where(above, left, w), np.where(above, w, right)
            found[moving] = (left + right) / 2
        return found

    return replace(  # z = (e2 before, what was asked for before [Pa], estimate [Pa])
        known,
        F=np.array([[0, 0, 0], [a / gain, a, -(1 - a)], [-a / gain, -a, 1 - a]]),
        G=np.array([[0, 1, 0], [0, -(1 + a) / gain, 1 / gain], [0, a / gain, 0]]),
        C=np.array([a / gain, a, -(1 - a)]),
        D=np.array([0, -(1 + a) / gain, 1 / gain]),
        ends=ends,
    )


def spreading(rock, modes):
    """Rates and shares of the modes of ∂p/∂t = D ∂²p/∂x² with p held at x = 0 and a fault at x = L that nothing passes.

    The step response 1 − Σ cₙ exp(−λₙt); what the modes left out would add is there at once.
    """
    odd = 2 * np.arange(modes) + 1
    shares = 4 / np.pi * (-1.0) ** np.arange(modes) / odd
    shares[-1] += 1 - shares.sum()
    return (odd * np.pi / 2) ** 2 / rock, shares


def middle(ends):
    return (ends[0] + ends[1]) / 2


def run(held, periods, pieces, choose, courses, kick=None, back=None, hear=None, start=None, off=None):
    """Largest |e1| and |e2| of every course and the errors at the end.

    choose(k, e, v) gives s, w, β and φ for one small step from its number, the errors (2 × courses) and b·p; kick(k) is
    an amount added to e2 before a step, hear(k) to both errors that the law is told
    (2 × courses); start has the errors at first (2 × courses), 0 unless given; back is the slip rate of the reference
    on a plant that never slides backward; off says what is late, all else being on time. Then what is told is the error
    at that time, and a pressure arrives no sooner than it is measured.
    """
    size, h = len(held.C), held.step / pieces
    late = round(held.delay / h)
    e = np.zeros((2, courses)) if start is None else np.array(start, dtype=float)
    z, v = np.zeros((size, courses)), np.zeros(courses)
    through = held.rock or held.lag
    rates, shares = (
        spreading(held.rock, held.modes) if held.rock else (np.array([1 / (held.lag or 1e-300)]), np.ones(1))
    )
    fade, spread = np.exp(-rates * h / 2)[:, None], np.zeros((len(shares), courses))
    waiting, largest = [], np.abs(e)
    schedule = None if off is None else _Schedule(held, off, pieces, late, courses)
    for k in range(periods * pieces):
        if schedule is not None:
            v = schedule.pressure(k, e)
        elif k % pieces == 0:
            told = e if hear is None else e + hear(k)
            z = held.first @ told if k == 0 and held.first is not None else z
            y = told if held.ends is None else np.vstack([told, held.ends(told[0], told[1])])
            waiting.append((k + late, held.b * (held.C @ z + held.D @ y)))
            z = held.F @ z + held.G @ y
        if waiting and waiting[0][0] == k:
            v = waiting.pop(0)[1]
        if kick is not None:
            e[1] += kick(k)
        halfway = v + (spread - v) * fade
        after = v + (halfway - v) * fade
        first, second, third = (shares @ part for part in (spread if through else halfway, halfway, after))
        spread = after
        s, w, beta, phi = choose(k, e, first)

        def rate(x, p, s=s, w=w, beta=beta, phi=phi):
            return np.array([x[1], s * x[0] - w * x[1] + beta * p + phi])

        k1 = rate(e, first)
        k2 = rate(e + h / 2 * k1, second)
        k3 = rate(e + h / 2 * k2, second)
        before, e = e, e + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(e + h * k3, third))
        if back is not None:  # a step that ends stuck: the slip rate falls evenly, none of it is backward
            e[0] = np.where(e[1] < -back, before[0] + h / 2 * (before[1] - back), e[0])
            e[1] = np.maximum(e[1], -back)
        largest = np.maximum(largest, np.abs(e))
    return largest, e


class _Schedule:
    """Measurements and pressures of courses that differ in when they happen."""

    def __init__(self, held, off, pieces, late, courses):
        self.sampled_loop, self.off, self.pieces, self.late = held, off, pieces, late
        self.z, self.v = np.zeros((len(held.C), courses)), np.zeros(courses)
        self.asked = np.zeros((len(off.measured), courses))
        self.target = np.zeros(courses)
        self.past = []
        self.most = np.inf if off.rate is None else off.rate * held.step / pieces

    def measured(self, n):
        """When measurement n is made; the first is on time."""
        return n * self.pieces + self.off.measured[n] * (n > 0)

    def pressure(self, k, e):
        """b·p over a small step; measurements that are due in it are made first."""
        self.past = [*self.past[-self.off.mean :], e] if self.off.mean else []
        e = np.mean(self.past, axis=0) if self.past else e
        for n in range(max(k // self.pieces - 1, 0), min(k // self.pieces + 2, len(self.asked))):
            now = self.measured(n) == k
            if now.any():
                y = e if self.sampled_loop.ends is None else np.vstack([e, self.sampled_loop.ends(e[0], e[1])])
                asked = self.sampled_loop.b * (self.sampled_loop.C @ self.z + self.sampled_loop.D @ y)
                self.asked[n] = np.where(now, asked, self.asked[n])
                self.z = np.where(now, self.sampled_loop.F @ self.z + self.sampled_loop.G @ y, self.z)
        first = (k - self.late) // self.pieces
        for n in range(max(first - 1, 0), min(first + 2, len(self.asked))):
            due = np.maximum(n * self.pieces + self.late + self.off.arrived[n], self.measured(n))
            self.target = np.where(due == k, self.asked[n], self.target)
        self.v = self.v + np.clip(self.target - self.v, -self.most, self.most)
        return self.v


def nominal(held):
    """Choice of the middle of all ranges, no disturbance."""
    return lambda k, e, v: (middle(held.s), middle(held.w), middle(held.beta), 0.0)


def responses(held, periods, pieces, size=1.0):
    """e1 and e2 at the end of the last period after a kick at every earlier small step."""
    count = periods * pieces
    _, end = run(held, periods, pieces, nominal(held), count, kick=lambda k: size * (np.arange(count) == k))
    return end


def aligned(held, response, sign=1.0, lag=0):
    """Everything pushes e the way that the nominal response wants: the natural adversary of a small gain."""
    count = len(response)

    def choose(k, e, v):
        way = np.sign(response[min(k + lag, count - 1)]) * sign
        return (
            np.where(way * e[0] > 0, held.s[1], held.s[0]),
            np.where(way * e[1] > 0, held.w[0], held.w[1]),
            np.where(way * v > 0, held.beta[1], held.beta[0]),
            way * held.force * np.ones(e.shape[1]),
        )

    return choose


def slowly(held, pieces, choose):
    """The same with β a function of the slip: from either end of its range on, with the slip or against it."""

    def slow(k, e, v):
        s, w, _, phi = choose(k, e, v)
        course = np.arange(e.shape[1])
        slip = e[0] + held.pace * k * held.step / pieces
        beta = np.take(held.beta, course % 2) + held.slope * np.where(course // 2 % 2, slip, -slip)
        return s, w, np.clip(beta, *held.beta), phi

    return slow


def heard(held, response):
    """Noise at its ends, each time the way that the nominal response to it wants: response(k) for either error."""
    bounds = np.array(held.noise)[:, None]
    return lambda k: bounds * np.sign(response[:, k : k + 1])


def noisy(held, courses, count, seed):
    """Noise at its ends: of one sign for random times, from every sample to the next for half of the courses."""
    random = np.random.default_rng(seed)
    changes = random.random((count, 2, courses)) < 10.0 ** random.uniform(-2.5, 0, courses)
    changes[:, :, : courses // 2] = random.random((count, 2, courses // 2)) < 0.5
    signs = 1 - 2 * (np.cumsum(changes, axis=0) % 2)
    return lambda k: np.array(held.noise)[:, None] * signs[k]


def switching(held, courses, count, seed):
    """Bang-bang courses with random dwell times, many at once."""
    random = np.random.default_rng(seed)

    def flips(share):
        changes = random.random((count, courses)) < share
        return np.where((np.cumsum(changes, axis=0) + random.integers(2, size=courses)) % 2, 1, 0)

    shares = 10.0 ** random.uniform(-2.5, 0, courses)
    s, w, beta, phi = (flips(shares) for _ in range(4))
    follow = random.random(courses) < 0.5  # half of the courses choose s and β by the state, against e2

    def choose(k, e, v):
        way = 2 * phi[k] - 1
        by_state = np.where(way * e[0] > 0, 1, 0), np.where(way * v > 0, 1, 0)
        return (
            np.asarray(held.s)[np.where(follow, by_state[0], s[k])],
            np.asarray(held.w)[w[k]],
            np.asarray(held.beta)[np.where(follow, by_state[1], beta[k])],
            way * held.force,
        )

    return choose


def drifting(held, change, pieces, choose):
    """The same with a disturbance that goes to the end that `choose` wants no faster than `change` [m/s³]."""
    now = [0.0]

    def slow(k, e, v):
        s, w, beta, phi = choose(k, e, v)
        most = change * held.step / pieces
        now[0] = now[0] + np.clip(phi - now[0], -most, most)
        return s, w, beta, now[0]

    return slow


def mixed(held, pieces, count, seed, memory):
    """Courses of every kind at once, and the noise beside them: `choose` and `hear` for `run`.

    Most courses push along a nominal response of either error, of either end of β, that ends at a random time and
    begins anew, some with random turns; others turn at random alone. s, w and β follow the state, or turn at random.
    With a slope of β it is one function of the slip for a whole course, which rises and falls as steeply as it may,
    once or many times. `memory`: over how many periods responses are followed.
    """
    random, past = np.random.default_rng(seed), memory * pieces
    nominals = [replace(held, beta=(gain, gain)) for gain in held.beta]
    responses = np.vstack([responses_of(one, memory, pieces) for one in nominals])
    which, end = random.integers(len(responses), size=count), random.integers(1, past + 1, size=count)
    end[random.random(count) < 0.5] = past
    alone, turning = random.random(count) < 0.25, random.random(count) < 0.5
    share = np.where(alone | turning, 10.0 ** random.uniform(-2.5, 0, count), 0)
    turns, start = np.zeros((5, count), dtype=int), random.integers(2, size=(5, count))
    follows, wavy = random.random((3, count)) < 0.7, np.full(count, bool(held.slope))
    spans = (held.beta[1] - held.beta[0]) / (held.slope or 1) * 10.0 ** random.uniform(-2, 0.5, count)
    phase = random.random(count)

    def choose(k, e, v):
        place = (k + past - end) % past
        turns[:] += random.random((5, count)) < share
        own = np.array((1, -1))[(turns + start) % 2]
        way = own[0] * np.where(alone, 1, np.sign(responses[which, 0, place]))
        toward = [
            np.where(follow, way * x, side) > 0 for follow, x, side in zip(follows, (*e, v), own[1:4], strict=True)
        ]
        s, w, beta = (
            np.where(up, ends[1], ends[0]) for up, ends in zip(toward, (held.s, held.w, held.beta), strict=True)
        )
        slip = e[0] + held.pace * k * held.step / pieces
        wave = held.beta[0] + held.slope * spans * np.abs((slip / spans / 2 + phase) % 1 - 0.5) * 2
        return s, w, np.where(wavy, np.clip(wave, *held.beta), beta), way * held.force

    def hear(k):
        place = (k + past - end) % past
        signs = np.where(turning, 1 - 2 * random.integers(2, size=(2, count)), np.sign(responses[which, 1:, place].T))
        return np.array(held.noise)[:, None] * signs

    return choose, hear if any(held.noise) else None


def responses_of(held, periods, pieces):
    """Of both errors at the end: to a kick, and to noise of slip and of slip rate, at every earlier small step."""
    size = 1e-6  # where a sliding mode is told it: well within its bounds
    found = [responses(held, periods, pieces, size=size)]
    count = periods * pieces
    for place in (0, 1):
        pushed = np.outer(np.arange(2) == place, np.ones(count)) * size
        told = lambda k, pushed=pushed: pushed * (np.arange(count) == k)  # noqa: E731
        found.append(run(held, periods, pieces, nominal(held), count, hear=told)[1])
    return np.array(found).swapaxes(0, 1)
