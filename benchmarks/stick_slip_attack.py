"""Attack certificates of the kind `stick_slip` with a simulator of its own: NumPy and the numbers of the file alone.

    python benchmarks/stick_slip_attack.py proofs/certificates/stick_slip_real-fault.json

Intervals between samples are any in the range of the file. Friction is any function of the slip with its slopes, the
disturbance turns within periods, and r' is any number of its range in each period. A sliding mode runs as it is: the
end of its implicit step is found by bisection, wherever it lies. For every facet the courses that come nearest to it
are continued. Then courses of 10 000 periods without selection: friction falls and rests in stairs of a slip, the
disturbance turns within every period, with the period, after many periods or as a facet asks. Printed are the largest
facet value, which the file says never exceeds 1, and the largest values over the claims, of both.
"""

import json
import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

SUBSTEPS, BRANCHES, HALVINGS = 48, 24, 60
LONG, COURSES, LONGEST_WAVE = 10_000, 320, 400  # periods, courses, periods between turns of the disturbance


def numbers(raw):
    """Floats of the texts of a table."""
    return {name: float(Fraction(v)) for name, v in raw.items() if isinstance(v, str) and name != "name"}


def pulled(terms, slip, rate):
    """q of an implicit step at the slip error and slip-rate error at its end."""
    total = 0 * slip
    for term in terms:
        inner = term["of"]
        value = {"slip": slip, "rate": rate}[inner] if isinstance(inner, str) else pulled(inner, slip, rate)
        factor = sum(float(Fraction(end)) for end in term["factor"]) / 2
        total = total + factor * np.sign(value) * abs(value) ** float(Fraction(term["power"]))
    return total


def end_of_step(terms, step, slip, rate):
    """The w at which w - e2 + q(e1 + T w, w) changes its sign: it rises, and q has the sign of its arguments."""
    low = np.minimum(np.minimum(-slip / step, 0), rate) - 1e-12
    high = np.maximum(np.maximum(-slip / step, 0), rate) + 1e-12
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        above = middle - rate + pulled(terms, slip + step * middle, middle) > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return (low + high) / 2


@dataclass
class Courses:
    """States of many courses at a sample, one a row."""

    x: np.ndarray
    y: np.ndarray
    mu: np.ndarray
    level: np.ndarray
    predicted: np.ndarray
    slip_before: np.ndarray
    rate_before: np.ndarray
    r: np.ndarray
    noise: np.ndarray

    def picked(self, which):
        """Some of them."""
        return Courses(**{name: value[which] for name, value in vars(self).items()})


class Attack:
    """One file."""

    def __init__(self, document, seed=0):
        fault, friction = numbers(document["fault"]), numbers(document["fault"]["friction"])
        self.law, self.claims, self.pull = numbers(document["loop"]), document["claims"], document["loop"].get("pull")
        self.facets = np.array([[float(Fraction(v)) for v in row] for row in document["set"]["facets"]])
        self.random, self.friction = np.random.default_rng(seed), friction
        mass = fault["density"] * fault["length"]
        self.n, self.k = 1 / mass, fault["shear_modulus"] / (mass * fault["length"])
        self.damping = fault["damping"] / (mass * fault["length"] ** 2)
        self.stress, self.amplitude = fault["normal_stress"], float(Fraction(document["disturbance"]["amplitude"]))
        task = document["reference"]
        self.target = float(Fraction(task["target_slip"]))
        shape = np.polynomial.Polynomial([float(Fraction(v)) for v in task["shape"]])
        grid = np.linspace(0, 1, 100_001)
        self.fastest = self.target / float(Fraction(task["operation_time"])) * shape.deriv()(grid).max()

    def rest_pressure(self, one):
        """p that balances the fault at its slip."""
        load = self.n * self.friction["static"] * self.stress - self.k * one.x
        return self.stress - load / (self.n * one.mu)

    def begun(self, count):
        """At rest on the reference, anywhere in the task, the law at equilibrium."""
        f, zero = self.friction, np.zeros(count)
        x = self.random.uniform(0, self.target, count) * (self.random.random(count) < 0.8)
        least = np.maximum(f["least"], f["static"] - f["weakening"] * x)
        most = np.minimum(f["largest"], f["static"] + f["strengthening"] * x)
        mu = least + (most - least) * self.random.choice([0.0, 0.5, 1.0], count)
        one = Courses(x, zero, mu, zero, zero, x.copy(), zero, x.copy(), zero)
        one.level = -self.rest_pressure(one)
        return one

    def chosen(self, count):
        """Of a period: r', a time at which the disturbance turns, its sign before, slopes of friction before and after.

        The time is in periods; friction is what grows with the slip.
        """
        random = self.random
        rate = np.where(random.random(count) < 0.7, random.choice([0.0, 1.0], count), random.random(count))
        turn, sign = random.uniform(0, 1, count), random.choice([-1.0, 1.0], count)
        turn = np.where(random.random(count) < 0.3, 1.0, turn)
        slopes = -self.friction["weakening"], self.friction["strengthening"]
        slope, other = random.choice(slopes, (2, count))
        return rate * self.fastest, turn, sign, lambda x, early: np.where(early, slope, other)

    def interval(self, count):
        """Of each course to its next sample [s]: an end of the range for most, and otherwise anywhere within."""
        step = self.law["step"]
        longest, random = self.law.get("longest", step), self.random
        ends = random.choice([step, longest], count)
        return np.where(random.random(count) < 0.7, ends, random.uniform(step, longest, count))

    def after(self, one, chosen=None):
        """A sample later."""
        law, random, count, step = self.law, self.random, len(one.x), self.law["step"]
        rate, turn, sign, growth = chosen or self.chosen(count)
        error = one.x + one.noise - one.r
        back = -law["return_rate"] * error
        v = rate + (back if self.pull is None else end_of_step(self.pull, step, error, one.y - rate))
        p = -law["rate_gain"] * one.y + law["target_gain"] * v - one.level
        interval = self.interval(count)
        h, x, y, mu = interval / SUBSTEPS, one.x.copy(), one.y.copy(), one.mu.copy()
        hold = self.n * self.friction["static"] * self.stress
        for i in range(SUBSTEPS):
            early = (i + 0.5) / SUBSTEPS < turn
            push, grown = self.amplitude * np.where(early, sign, -sign), growth(x, early)
            force = hold - self.k * x - self.n * mu * (self.stress - p) + push

            steep = self.k + self.n * grown * (self.stress - p)  # the force is linear in the slip of a substep
            half = np.maximum(y + h / 2 * (force - self.damping * y), 0)
            second = force - steep * h / 2 * (y + half) / 2 - self.damping * half
            end = y + h * second
            braked = np.where(second < 0, y**2 / (2 * np.maximum(-second, 1e-300)), 0)
            moved = np.where(end < 0, np.minimum(braked, h * y), h * (y + np.maximum(end, 0)) / 2)
            x, y = x + moved, np.maximum(end, 0)
            mu = np.clip(mu + grown * moved, self.friction["least"], self.friction["largest"])
        noise = law["slip_noise"] * random.choice([-1.0, 1.0], count)
        predicted = np.maximum(v, 0)
        innovation = x + noise - one.x - one.noise - step * (one.y + predicted) / 2
        lowest = -step * predicted / 2 - law["rest_slip"]
        innovation = np.where(y == 0, np.maximum(innovation, lowest), innovation)
        level = one.level + law["level_gain"] * (y - predicted) + law["slip_gain"] * innovation
        return Courses(x, y, mu, level, predicted, one.x, one.y, one.r + interval * rate, noise), p

    def values(self, one):
        """Facets of courses, (courses, facets), and slip less reference."""
        error = one.x - one.r
        known = one.level + self.rest_pressure(one) - self.law["slip_gain"] * one.noise
        return np.column_stack([error + self.law["slip_noise"], one.y, known]) @ self.facets.T, error

    def run(self, periods=300, long=LONG):
        """Largest facet value, and largest values over the claims."""
        self.found = dict.fromkeys(("facet", "slip_rate", "behind", "ahead", "pressure"), 0.0)
        one, tried = self.begun(2000), 0
        for _ in range(periods):
            one, p = self.after(one.picked(np.repeat(np.arange(len(one.x)), BRANCHES)))
            tried += len(p)
            kept = np.unique(self.seen(one, p).argmax(axis=0))
            kept = np.concatenate([kept, self.random.integers(0, len(p), 300)])
            inside = (one.x[kept] <= self.target) & (one.x[kept] >= 0)
            one = one.picked(kept[inside])
        return self.found | {"periods": tried} | self.endured(long)

    def endured(self, periods):
        """Courses without selection; each has its stairs of friction, wave of the disturbance and of the reference."""
        random, count, friction = self.random, COURSES, self.friction
        one, before = self.begun(count), self.found
        self.found = dict.fromkeys(before, 0.0)
        kind, facet = random.integers(0, 4, count), random.integers(0, len(self.facets), count)
        wave, rates = np.exp(random.uniform(0, np.log(LONGEST_WAVE), (2, count)))
        turn, first = random.uniform(0, 1, count), random.choice([-1.0, 1.0], count)
        stair, share = np.exp(random.uniform(np.log(1e-8), np.log(1e-3), count)), random.choice([0.2, 0.5, 0.8], count)
        fall = -friction["weakening"], friction["strengthening"]
        for period in range(periods):
            known = one.level + self.rest_pressure(one)
            state = np.column_stack([one.x - one.r, one.y, known]) * self.facets[facet]
            flipped = np.where(np.floor(period / wave) % 2 == 0, first, -first)
            asked = np.where(state.sum(axis=1) >= 0, 1.0, -1.0) * first
            sign = np.choose(kind, [first, flipped, np.where(period % 2 == 0, first, -first), asked])
            rate = np.where(np.floor(period / rates) % 2 == 0, self.fastest, 0.0)
            longest = self.law.get("longest", self.law["step"])
            rate = np.where(one.r + longest * rate > self.target, 0.0, rate)

            def growth(x, early):
                return np.where(x / stair % 1 < share, fall[0], np.where(kind == 1, fall[1], 0.0))

            one, p = self.after(one, (rate, np.where(kind == 1, 1.0, turn), sign, growth))
            self.seen(one, p)
        later, self.found = self.found, {name: max(value, self.found[name]) for name, value in before.items()}
        return self.found | {"long_facet": later["facet"], "long_slip_rate": later["slip_rate"]}

    def seen(self, one, p):
        """Facet values, of which and of the rest the largest are kept."""
        claims = numbers(self.claims)
        values, error = self.values(one)
        for name, value in (
            ("facet", values.max()),
            ("slip_rate", one.y.max() / claims["peak_slip_rate"]),
            ("behind", -error.min() / claims["slip_behind"]),
            ("ahead", error.max() / claims["slip_ahead"]),
            ("pressure", max(p.max() / claims["largest_pressure"], p.min() / claims["least_pressure"])),
        ):
            self.found[name] = max(self.found[name], float(value))
        return values


if __name__ == "__main__":
    for name in sys.argv[1:]:
        told = Attack(json.loads(Path(name).read_text())).run()
        print(name, {key: round(value, 6) for key, value in told.items()})
