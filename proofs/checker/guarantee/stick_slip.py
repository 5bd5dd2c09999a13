"""Verify certificate files of the kind ``stick_slip`` (FORMAT.md) with the Python standard library alone.

From a stick-slip fault, a sampled law and a polytope of its states to bounds on slip, slip rate and pressure for all t.
Whether the fault slides through a period or ends it at rest, no facet may exceed 1 at its end. Symbols are those of
FORMAT.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import comb
from typing import Any

from .matrices import exponential
from .polytope import NOTHING, ONE, Constraint, Function, Near, Polytope
from .reading import Row, entries, keys, lower, matrix, need, number, numbers, upper
from .root import MAX_TERMS, Root, Sum, count_terms, read_sum, root_within
from .task import Rock, Task, read_rock, read_task

MAX_FACETS, MAX_BASES = 400, 40_000
PIECES = 16  # of a period, for integrals of impulse responses
LINES = 5  # bounds of the slip until a stop, less one
PARTS = 4  # of a range of intervals between samples
AXES = ((0, 1), (1, 1), (2, 1), (0, -1), (2, -1))
LAW = ("rate_gain", "target_gain", "return_rate", "level_gain", "slip_gain", "rest_slip")
CLAIMS = ("slip_behind", "slip_ahead", "peak_slip_rate", "least_pressure", "largest_pressure")

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True)
class End:
    """An end r' = of_error·e1 + constant of the range of the reference's rate, for a slice of e1 and a target sign."""

    place: int
    positive: bool
    of_error: Fraction
    constant: Fraction

    @property
    def still(self) -> bool:
        """Whether r' is 0."""
        return not self.of_error and not self.constant


@dataclass
class Law:
    """Gains of the law, its period, slip taken for rest, measurement noise, and implicit step.

    Intervals between samples are from `step` to `longest`, which is 0 where all are `step`.
    """

    step: Fraction
    rate: Fraction
    target: Fraction
    back: Fraction
    level: Fraction
    slip: Fraction
    rest_slip: Fraction
    slip_noise: Fraction
    longest: Fraction
    pull: Sum

    @property
    def longest_interval(self) -> Fraction:
        """The longest interval."""
        return self.longest or self.step

    @property
    def intervals(self) -> list[Fraction]:
        """Intervals at which facets are checked."""
        parts = PARTS if self.longest else 0
        return [self.step + (self.longest_interval - self.step) * i / (parts or 1) for i in range(parts + 1)]

    @property
    def excess(self) -> Fraction:
        """Bound of the law's r' minus that of the reference."""
        return 2 * self.back * self.slip_noise


@dataclass
class Reach:
    """The set and the multipliers and bases of its proof."""

    facets: list[Row]
    multipliers: list[Row]
    sliding: list[list[list[int]]]
    resting: list[list[list[int]]]


# ---------------------------------------------------------------- reading


def read_law(value: Any) -> Law:
    """Gains and period."""
    more = [name for name in ("pull", "longest") if type(value) is dict and name in value]
    given = keys(value, "loop", "step", *LAW, "slip_noise", *more)
    pull = read_sum(given["pull"]) if "pull" in more else []
    longest = number(given["longest"], "longest") if "longest" in more else Fraction(0)
    law = Law(*(number(given[name], name) for name in ("step", *LAW, "slip_noise")), longest, pull)
    need("longest" not in more or law.longest > law.step, "longest must be above step if given")
    need(not (law.longest and pull), "a sliding mode must be sampled periodically, without longest")
    need(min(law.step, law.rate, law.target, law.back) > 0, "step, rate, target and return gains must be > 0")
    need(min(law.level, law.slip) >= 0, "level_gain and slip_gain must be >= 0")
    need(0 <= 2 * law.slip_noise <= law.rest_slip, "slip_noise must be from 0 to half of rest_slip")
    need(count_terms(pull) <= MAX_TERMS, f"an implicit step must have at most {MAX_TERMS} terms")
    deadbeat = law.rate == law.target and law.back * law.step == 1
    need(deadbeat or not pull, "a sliding mode must have target_gain = rate_gain and return_rate = 1/step")
    return law


def read_reach(value: Any) -> Reach:
    """Facets, multipliers and bases."""
    given = keys(value, "set", "facets", "multipliers", "sliding", "resting")
    listed = given["facets"]
    many = len(listed) if type(listed) is list else 0
    need(len(AXES) <= many <= MAX_FACETS, f"there must be {len(AXES)} to {MAX_FACETS} facets")
    facets, multipliers = matrix(listed, "facets", many, 3), matrix(given["multipliers"], "multipliers", many, 5)
    for row, (index, sign) in zip(facets, AXES, strict=False):
        alone = row[index] * sign > 0 and not any(v for i, v in enumerate(row) if i != index)
        need(alone, "the first five facets must bound +e1, +y, +d, -e1 and -d alone")
    for row in multipliers:
        sound = row[0] >= 0 and row[1] in (0, 1) and row[3] in (0, 1) and 0 <= row[4] <= 1
        need(sound, "the five multipliers must be, in order: >= 0; 0 or 1; any number; 0 or 1; in [0, 1]")
    sliding = read_bases(given["sliding"], "sliding", 3, (many + 2, many + 3, many + 2))
    tall = [many + more for more in (10, 10, 11, 11, 11, 10, 10)]
    resting = read_bases(given["resting"], "resting", 4, tuple(tall))
    total = sum(map(len, (*sliding, *resting)))
    need(total <= MAX_BASES, f"there must be at most {MAX_BASES} bases")
    return Reach(facets, multipliers, sliding, resting)


def read_bases(value: Any, where: str, size: int, counts: tuple[int, ...]) -> list[list[list[int]]]:
    """Read the bases of every polytope: lists of `size` numbers of constraints, of which it has `counts`."""
    need(type(value) is list and len(value) == len(counts), f"{where} must have {len(counts)} lists of bases")
    for line, count in zip(value, counts, strict=True):
        need(type(line) is list and bool(line), f"{where} must have bases of every polytope")
        for basis in line:
            sound = type(basis) is list and len(basis) == size and all(type(j) is int and 0 <= j < count for j in basis)
            need(sound, f"a basis of {where} must be {size} numbers of constraints")
    return value  # type: ignore[no-any-return]


# ---------------------------------------------------------------- the loop in one period


class Period:
    """What a period needs: ranges on the set, impulse responses, polytopes."""

    def __init__(self, rock: Rock, task: Task, target: Fraction, growths: Row, law: Law, reach: Reach) -> None:
        self.task, self.law, self.reach = task, law, reach
        self.bend, self.force = task.reference_acceleration, task.amplitude
        self.rate = task.reference_rate + law.excess  # bound of r' as the law uses it
        self.still = self.bend * law.longest_interval / 2 + law.excess  # largest r' if the reference stands still
        ahead, self.peak, up, behind, down = (1 / abs(sum(row)) for row in reach.facets[:5])
        self.ahead, self.behind, self.level = ahead, behind, max(up, down)
        zero, one = Fraction(0), Fraction(1)
        lowest, level, most = (zero, zero), (law.back, zero), (zero, self.rate)
        self.ends = [
            End(place, positive, *end)
            for place, positive, end in (
                (0, True, lowest), (0, True, most), (1, True, level), (1, True, most),
                (1, False, lowest), (2, False, lowest), (2, False, most),
            )
        ]  # fmt: skip
        own: list[Constraint] = [(row, one) for row in reach.facets]
        own.append(([zero, -one, zero], zero))
        to, turn = [one, zero, zero], self.rate / law.back
        away = [-one, zero, zero]
        cuts: list[list[Constraint]] = [[(to, zero)], [(away, zero), (to, turn)], [(away, -turn)]]
        self.slices = [[*own, *cut] for cut in cuts]
        self.sizes = [[size, self.peak, self.level] for size in (behind, min(ahead, turn), ahead)]
        self.signs = [(sign, 1, 0) for sign in (-1, 1, 1)]
        self.flat = [Polytope(*given) for given in zip(self.slices, self.sizes, self.signs, reach.sliding, strict=True)]
        self.push = self.pushes()
        self.find_ranges(rock, target, growths)
        self.find_curvature()

    def pushes(self) -> Range:
        """Least and largest U = p* - p at a sample, over the set."""
        law = self.law
        row = [law.target * law.back, law.rate, Fraction(1)]
        high = max(p.largest(Function(row, Fraction(0), [NOTHING] * 3)) for p in self.flat)
        turned = Function([-v for v in row], law.target * self.rate, [NOTHING] * 3)
        low = max(p.largest(turned) for p in self.flat)
        noise = law.slip * law.slip_noise
        return -Fraction(low, ONE) - noise, Fraction(high, ONE) + noise

    def find_ranges(self, rock: Rock, target: Fraction, growths: Row) -> None:
        """Ranges of slopes and damping, and the conditions on them."""
        task, law = self.task, self.law
        slip = target + self.ahead + task.reference_rate * law.longest_interval
        still = rock.stress(slip, growths[0])
        stress = still[0] + self.push[0], still[1] + self.push[1]
        need(stress[0] > 0, "the fault must not open")
        self.rest = task.normal_stress - still[1], task.normal_stress - still[0]
        low, high = rock.of_slip(stress, growths[0])
        self.slope = min(low, Fraction(0)), max(high, Fraction(0))
        self.damping = rock.of_rate(stress, growths[1])
        need(self.damping[0] >= 0, "the damping must not be negative")
        stiffness = max(rock.stiffness[1] - growths[0], Fraction(0))
        load = rock.area[0] * rock.mu["static"] * task.normal_stress
        need(load > stiffness * slip + self.force, "the shear stress must not reverse")
        need(self.slope[1] * law.longest_interval**2 < 1, "the step must be short against the weakening of friction")
        moves = 1 + task.slope_of_beta * law.longest_interval * self.peak
        low, high = (moves * v for v in rock.of_slip(still, growths[0]))
        self.chord = min(low, Fraction(0)), max(high, Fraction(0))
        self.longest = min(g * self.peak + h for g, h in self.stops())
        large = self.force + self.slope[0] * self.longest >= 0
        need(large, "the disturbance must be large enough for the condition of rest")

    def find_curvature(self) -> None:
        """Bounds of the impulse responses and their curvature over the longest interval, and their consequences."""
        step, zero, one = self.law.longest_interval, Fraction(0), Fraction(1)
        (s, ds), (w, dw) = (((high + low) / 2, (high - low) / 2) for low, high in (self.slope, self.damping))
        self.growth = 1 / (1 - self.slope[1] * step**2 / 2)
        self.per_slip, self.per_rate = ds * self.growth, dw  # in addition to the force
        within = exponential([[zero, one], [abs(s), max(-w, zero)]], step).size()
        square = [[abs(s), abs(w)], [abs(s * w), abs(s + w * w)]]
        once = [[zero, one], [abs(s), abs(w)]]
        own = [Near(within.rows[i][1], 0) for i in (0, 1)]
        moved, self.bent = ([Near.of(a) * own[0] + Near.of(b) * own[1] for a, b in rows] for rows in (once, square))
        self.margin = self.margins(own, moved)

    def margins(self, own: list[Near], moved: list[Near]) -> list[Near]:
        """Margin between the bounds at two intervals, for factors of slip and slip rate.

        It is the squared distance of the two over 8, times a bound of the second derivative with respect to the
        interval.
        """
        law, task, most = self.law, self.task, self.law.longest_interval
        part = (most - law.step) ** 2 / PARTS**2 / 8
        noise = law.slip * law.slip_noise
        pushed = task.beta[1] * task.b * (max(map(abs, self.push)) + law.target * self.still + noise)
        force, steep = self.force + pushed, 3 * self.per_rate * self.slope[1] * self.growth
        first, last = self.force + self.per_rate * self.peak, self.per_rate * force
        last += most * force * (self.per_slip + steep * most)
        return [
            (bent.times(self.peak) + step.times(pushed + first) + size.times(last)).times(part)
            for size, step, bent in zip(own, moved, self.bent, strict=True)
        ]

    def respond(self, interval: Fraction) -> None:
        """Responses to slip rate, force and impulses over an interval between samples."""
        self.interval, zero, one = interval, Fraction(0), Fraction(1)
        (s, w) = (sum(pair) / 2 for pair in (self.slope, self.damping))
        whole = exponential([[zero, one, zero], [s, -w, one], [zero, zero, zero]], interval)
        self.of_rate, self.of_force = ([Near(whole.rows[i][j], whole.error) for i in (0, 1)] for j in (1, 2))
        flow = [[zero, one], [s, -w]]
        nodes = [exponential(flow, interval * i / PIECES) for i in range(PIECES + 1)]
        self.nodes = [[Near(node.rows[i][1], node.error) for i in (0, 1)] for node in reversed(nodes)]
        alone = self.integrals(one, zero)
        of_rate, of_force = self.others(alone)
        off = (self.task.beta[1] - 1) ** 2 / (4 * self.task.beta[1] * self.task.b)  # distance of 1/beta from its chord
        self.gap = (self.of_rate[0] + of_rate).times(off), (self.of_force[0] + of_force).times(off)
        self.gap_margin = self.margin[0].times(off)

    def integrals(self, of_slip: Fraction, of_rate: Fraction) -> list[Near]:
        """Integrals of h(t)·t^j over a period, h >= |of_slip·X(T - t) + of_rate·Y(T - t)| by chords between nodes."""
        first, second, piece = Near.of(of_slip), Near.of(of_rate), self.interval / PIECES
        above = (abs(first) * self.bent[0] + abs(second) * self.bent[1]).times(piece**2 / 8)
        sizes = [abs(first * x + second * y) + above for x, y in self.nodes]
        off = max(v.off for v in sizes)
        return [
            Near(sum(w * v.at for w, v in zip(line, sizes, strict=True)), sum(line) * off).times(piece ** (j + 1) / 60)
            for j, line in enumerate(WEIGHTS)
        ]

    def others(self, area: list[Near]) -> tuple[Near, Near]:
        """Additions of the ranges of slope and damping to the factors of y and of the force H - b·beta·U."""
        steep = self.per_rate * self.slope[1] * self.growth
        of_rate = area[1].times(self.per_slip) + area[0].times(self.per_rate) + area[2].times(steep)
        of_force = (area[2].times(self.per_slip) + area[3].times(steep)).times(Fraction(1, 2))
        return of_rate, of_force + area[1].times(self.per_rate)

    def pushed(self, end: End) -> tuple[Row, Fraction]:
        """U as a function of (e1, y, d), and its constant."""
        law = self.law
        return [law.target * (law.back - end.of_error), law.rate, Fraction(1)], -law.target * end.constant

    def carried(self, facet: Row, end: End, interval: Fraction) -> tuple[Fraction, Fraction, Fraction]:
        """Effect of law and reference on a facet: factor of e1, constant, factor of r' if r may stand still."""
        law, (n1, _, n3) = self.law, facet
        predicted = n3 * (law.level + law.slip * law.step / 2)
        sign = int(end.positive)
        of_error = n1 - n1 * interval * end.of_error - predicted * sign * (end.of_error - law.back)
        constant = -n1 * interval * end.constant - predicted * sign * end.constant
        if n1 > 0 and end.still:  # the reference never falls
            return of_error, constant, -predicted * sign
        constant += abs(n1) * self.bend * interval**2 / 2 + max(n1, Fraction(0)) * law.excess * interval
        return of_error, constant, Fraction(0)

    def sliding(self, facet: Row, given: Row, cut: bool) -> Iterator[tuple[int, Function]]:
        """Bounds of a facet after a period of the sliding map, as functions of (e1, y, d) on a slice."""
        task, law, (n1, n2, n3) = self.task, self.law, facet
        flag, free = (given[3], given[2]) if cut else (given[1], given[0])
        of_rate = n2 if cut else n2 + n3 * law.level
        of_rate = max(of_rate, Fraction(0)) if flag and not cut else of_rate
        of_rate += free
        for chord in self.chord:
            slips = [n1 + n3 * ((0 if cut else law.slip) - chord / (beta * task.b)) for beta in task.beta]
            slips = [max(v, Fraction(0)) if flag else v for v in slips]
            curved = abs(n3 * chord) if any(slips) else Fraction(0)
            bent = [v.times(curved) for v in self.gap]
            for beta, of_slip in zip(task.beta, slips, strict=True):
                area = self.integrals(of_slip, of_rate)
                beside = self.others(area)
                own = [
                    x.times(of_slip) + y.times(of_rate) + part
                    for (x, y), part in zip((self.of_rate, self.of_force), beside, strict=True)
                ]
                by_push = own[1].times(-beta * task.b)
                by_rate = own[0] + bent[0]
                if not cut:
                    by_rate += Near.of(-n3 * law.slip * law.step / 2)
                by_force = (area[0] + beside[1] + bent[1]).times(self.force)
                by_force += abs(by_push).times(law.slip * law.slip_noise)
                by_force += self.margin[0].times(abs(of_slip)) + self.margin[1].times(abs(of_rate))
                by_force += self.gap_margin.times(curved)
                for end in self.ends:
                    row, push = self.pushed(end)
                    of_error, constant, late = self.carried(facet, end, self.interval)
                    more = [by_push.times(share) for share in row]
                    more[1] += by_rate
                    total = by_push.times(push) + by_force
                    if n1 > 0 and end.still:
                        moved = (by_push.times(-law.target) + Near.of(late)).above()
                        total += moved.times(self.still)
                    yield end.place, Function([of_error, Fraction(0), n3], constant, more, total)

    def stops(self) -> list[Range]:
        """Factors g of y and constants h: the slip until the last stop is at most g*y + h."""
        step, (low, high) = self.law.longest_interval, self.damping
        least = Fraction(1, 2) + low * step / 24
        found = []
        for i in range(LINES + 1):
            share = least + (1 - least) * i / LINES
            m, x = share * step, (1 - share) * step
            short = least < 1 and low * x < 1
            room = 1 + self.slope[0] * step**2 / 2 - (high - low) * x / (1 - low * x / 2) if short else Fraction(0)
            need(room > 0, "the step must be short against damping and slope for a bound of stops")
            start, late = m - low * m**2 / 2 + low**2 * m**3 / 6, self.force * x**2 / (1 - low * x / 3)
            found.append((start / room, late / room))
        return found

    def resting(self) -> list[tuple[Polytope, list[End]]]:
        """For each slice and sign of the target rate the states and slips that may end at rest, and the ends of r'.

        The condition of rest is taken at the least r', where it is weakest, as a given slip may end at
        rest for some r' only.
        """
        stops, zero = self.stops(), Fraction(0)
        most, found = self.task.beta[1] * self.task.b, []
        for first, second in ((0, 1), (2, 3), (4, 2), (5, 6)):
            least = self.ends[first]
            row, push = self.pushed(least)
            lines = [([*line, zero], end) for line, end in self.slices[least.place]]
            lines += [([zero, zero, zero, Fraction(-1)], zero)]
            room = most * (push + self.law.slip * self.law.slip_noise) - self.force
            lines += [([*(-most * v for v in row), self.slope[0]], room)]
            lines += [([zero, -g, zero, Fraction(1)], h) for g, h in stops]
            bases = self.reach.resting[first] + (self.reach.resting[second] if second == first + 1 else [])
            sizes, signs = [*self.sizes[least.place], self.longest], [*self.signs[least.place], 1]
            polytope = Polytope(lines, sizes, signs, bases)
            largest = self.ends[second]
            found.append((polytope, [least, End(least.place, least.positive, largest.of_error, largest.constant)]))
        return found

    def stopped(self, facet: Row, given: Row, end: End) -> Iterator[Function]:
        """Bounds of a facet after a period that ends at rest, functions of (e1, y, d) and the slip until a stop."""
        law, (n1, _, n3) = self.law, facet
        for interval in {law.step, law.longest_interval}:
            of_error, constant, late = self.carried(facet, end, interval)
            constant += max(late, Fraction(0)) * self.still
            for chord in self.chord:
                for share in (Fraction(0), Fraction(1)) if n3 > 0 else (given[4],):
                    part = n3 * law.slip * share
                    less = Fraction(0) if n3 > 0 else (part - n3 * law.slip) * (law.rest_slip + 2 * law.slip_noise)
                    row = [of_error, -part * law.step / 2, n3, n1 - n3 * chord / self.task.b + part]
                    yield Function(row, constant + less, [NOTHING] * 4)

    def verify(self) -> None:
        """Refuse the set unless no facet exceeds 1 after a period."""
        given = list(enumerate(zip(self.reach.facets, self.reach.multipliers, strict=True)))
        at_first = self.law.slip_noise, self.law.slip * self.law.slip_noise
        inside = all(n1 * at_first[0] + max(n3, 0) * at_first[1] <= 1 for n1, _, n3 in self.reach.facets)
        need(inside, "the set must contain the initial state, with noise of the first measurement")
        for interval in self.law.intervals:
            self.respond(interval)
            for which, (facet, multipliers) in given:
                for cut in (False, True) if facet[2] > 0 else (False,):
                    for place, function in self.sliding(facet, multipliers, cut):
                        within = self.flat[place].largest(function, which) <= ONE
                        need(within, f"facet {which} must hold after a sliding period. It is not shown to")
        for polytope, ends in self.resting():
            for which, (facet, multipliers) in given:
                for end in ends:
                    for function in self.stopped(facet, multipliers, end):
                        within = polytope.largest(function, which) <= ONE
                        need(within, f"facet {which} must hold after a period that ends at rest. It is not shown to")
        step, least = self.law.longest_interval, Fraction(0 if self.law.longest else 1)
        share = self.per_slip * step**2 / 2 + self.per_rate * step * (1 + self.slope[1] * self.growth * step**2)
        spread = self.task.b * (self.task.beta[1] - least) * max(self.push[1], Fraction(0))
        need(share * spread <= self.force, "the disturbance must be at least the effect of the range of beta")

    def bounds(self) -> dict[str, Fraction]:
        """Bounds that follow from the set, by claims."""
        noise, moved = self.law.slip_noise, self.task.reference_rate * self.law.longest_interval
        pressure = self.rest[0] - self.push[1], self.rest[1] - self.push[0]
        return dict(
            zip(CLAIMS, (self.behind + noise + moved, self.ahead - noise + moved, self.peak, *pressure), strict=True)
        )


def weights() -> list[list[int]]:
    """60 times the integrals of hat functions at 0, 1, …, PIECES times t^j, j = 0 to 3."""
    found = [[0] * (PIECES + 1) for _ in range(4)]
    for j in range(4):
        for i in range(PIECES):
            for k in range(j + 1):
                part = 60 * comb(j, k) * i ** (j - k)
                found[j][i] += part // ((k + 1) * (k + 2))
                found[j][i + 1] += part // (k + 2)
    return found


WEIGHTS = weights()


# ---------------------------------------------------------------- the theorem


def verify(document: dict[str, Any]) -> list[str]:
    """Verify the claims of a parsed file; the statement, line by line.

    Raises
    ------
    Refused
        When a rule is broken, or a claim does not follow.
    """
    keys(document, "the file", "format", "kind", "fault", "reference", "disturbance", "loop", "set", "claims")
    claims = numbers(document["claims"], "claims", *CLAIMS)
    task, rock = read_task(document), read_rock(document["fault"])
    need(task.change is None, "the disturbance must have no key change")
    target = number(document["reference"]["target_slip"], "target_slip")
    growths = [number(document["disturbance"]["growths"][name], name) for name in ("slip", "rate")]
    law, reach = read_law(document["loop"]), read_reach(document["set"])
    period = Period(rock, task, target, growths, law, reach)
    found = period.bounds()
    for name, claim in claims.items():
        holds = found[name] >= claim if name.startswith("least") else found[name] <= claim
        need(holds, f"the claim {name} must follow from the set. It does not")
    if law.pull:
        slip = max(found["slip_behind"], found["slip_ahead"]) + law.slip_noise
        rate = max(found["peak_slip_rate"], task.reference_rate)
        deadbeat = Root(law.pull, [Fraction(1), Fraction(1)], Fraction(0))
        shown = root_within(deadbeat, law.step, slip, rate)
        need(shown, "the implicit step must be deadbeat in the set. It is not shown to be")
    period.verify()
    return [*statement(document, period, claims), *entries(document)]


def statement(document: dict[str, Any], period: Period, claims: dict[str, Fraction]) -> list[str]:
    """What was verified, in ASCII; bounds are rounded outward, those of the disturbance inward."""
    task, law = period.task, period.law
    measured = "slip and slip rate measured exactly"
    if law.slip_noise:
        measured = f"slip measured within {lower(law.slip_noise)} m, slip rate exactly"
    kind = f"any acceleration of at most {lower(task.amplitude)} m/s^2" if task.amplitude else "none (amplitude 0)"
    return [
        f'fault "{ascii(task.name)[1:-1]}" (a label; the data of the file define it), friction any function of '
        + ("the slip alone" if task.steady_beta else "slip and slip rate")
        + " within its bounds and slopes, whether the fault slides or sticks, parameters constant",
        f"derived accelerations: per slip within a period [{lower(period.slope[0])}, {upper(period.slope[1])}] 1/s^2, "
        f"per slip rate minus [{lower(period.damping[0])}, {upper(period.damping[1])}] 1/s, per pressure "
        f"{upper(task.b)} m^2/kg times [1, {upper(task.beta[1])}]",
        f"{'sliding mode' if law.pull else 'law'} for the stick-slip plant, every {document['loop']['step']} s"
        + (f" to {document['loop']['longest']} s in any order" if law.longest else "")
        + f", with zero-order hold, {measured}; a set of {len(period.reach.facets)} facets"
        + ("; its implicit step is deadbeat, w = -e1/step, on this set" if law.pull else ""),
        f"disturbance: {kind}; from rest, along the reference, for all t >= 0",
        f"the slip rate of this fault never exceeds {upper(claims['peak_slip_rate'])} m/s",
        f"the slip is at most {upper(claims['slip_behind'])} m behind and {upper(claims['slip_ahead'])} m ahead of the "
        "reference",
        f"pressure from {lower(claims['least_pressure'])} Pa to {upper(claims['largest_pressure'])} Pa",
    ]
