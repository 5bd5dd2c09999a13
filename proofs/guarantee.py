"""Verify certificate files of the kind ``guarantee`` (FORMAT.md) with the Python standard library alone.

From a fault's data, a controller's matrices and the order of events in a period to bounds of slip, slip rate and
pressure for ever. Nothing is searched for: ranges follow from rational inequalities, and the bounds from upper sums of
impulse responses in integers, multiples of 2^-BITS, each with a bound of its error. `check.py` calls `verify`.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import chain, count, pairwise, product
from math import ceil, comb, factorial, lcm
from typing import Any

BITS = 192
DOUBLINGS = 12  # at most 4096 periods are summed
SHARE = 256  # what is left of the past after those is below a 256th
MAX_STATES, MAX_LAW_STATES, MAX_PERIODS, MAX_DEGREE = 20, 12, 8, 12
MAX_TERMS, MAX_POWER = 16, 6
MAX_WORK = 3 * 10**7  # products of integers
STRETCHES, PARTS = 128, 6  # of time without samples, each of 2^PARTS pieces
LATE = 1 << 12  # what is left of the past after those is below a 4096th
LARGEST = 1 << 2 * BITS  # entries beyond 2^BITS
HALVINGS = 7
CELLS = 10  # how often the range of e1 is halved
MODES, PI = 8, Fraction(314159265358979323846, 10**20)  # of a layer of rock; PI is below pi by less than SHORT of it
SHORT = Fraction(1, 10**20)
MAX_PARTS = 16  # of the range of a slow input gain
ONE_OVER_E = Fraction(3679, 10000)  # from above
SHORTEST = 32  # a layer takes at least the 32nd part of a step
EVEN = [Fraction(i, 8) for i in range(9)]  # where a flow between two events is cut
HALVES = [Fraction(i, 2) for i in range(3)]
BENT = [Fraction(i, 128) for i in (0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128)]  # after a step into a layer

RATIONAL = re.compile(r"-?(0|[1-9][0-9]{0,399})(/[1-9][0-9]{0,399})?")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
FAULT = re.compile(r"\w[\w .+-]{0,59}")

Row = list[Fraction]


class Refused(Exception):
    """The file is no valid certificate, for the reason given."""


def need(condition: bool, reason: str) -> None:
    """Refuse the file unless the condition holds."""
    if not condition:
        raise Refused(reason)


# ---------------------------------------------------------------- reading


def keys(value: Any, where: str, *names: str) -> dict[str, Any]:
    """Object with exactly these keys."""
    need(type(value) is dict and set(value) == set(names), f"{where} must have exactly the keys {', '.join(names)}")
    return value  # type: ignore[no-any-return]


def number(value: Any, where: str) -> Fraction:
    """Rational in canonical form."""
    canonical = type(value) is str and RATIONAL.fullmatch(value) is not None
    need(canonical, f'{where} must be a rational such as "-3/2", at most 400 digits above and below')
    top, _, bottom = value.partition("/")
    found = Fraction(int(top), int(bottom or 1))
    need(str(found) == value, f"{where} must be in lowest terms")
    return found


def numbers(value: Any, where: str, *names: str) -> dict[str, Fraction]:
    """Object of rationals with exactly these keys."""
    return {name: number(v, f"{where}.{name}") for name, v in keys(value, where, *names).items()}


def row(value: Any, where: str, length: int) -> Row:
    """List of so many rationals."""
    need(type(value) is list and len(value) == length, f"{where} must be a list of {length} rationals")
    return [number(v, where) for v in value]


def matrix(value: Any, where: str, height: int, width: int) -> list[Row]:
    """List of rows."""
    need(type(value) is list and len(value) == height, f"{where} must have {height} rows")
    return [row(v, where, width) for v in value]


# ---------------------------------------------------------------- from the fault to ranges


def hull(values: Iterable[Fraction]) -> tuple[Fraction, Fraction]:
    """Least and largest."""
    found = list(values)
    return min(found), max(found)


def slope(shape: Row) -> Row:
    """Derivative of a polynomial, lowest power first."""
    return [n * c for n, c in enumerate(shape)][1:]


def on_unit_interval(shape: Row) -> tuple[Fraction, Fraction]:
    """Enclosure of a polynomial on [0, 1]: hull of its Bernstein coefficients on 2^HALVINGS parts."""
    n = len(shape) - 1
    parts = [[sum(Fraction(comb(i, j), comb(n, j)) * shape[j] for j in range(i + 1)) for i in range(n + 1)]]
    for _ in range(HALVINGS):
        finer = []
        for part in parts:
            triangle = [part]
            while len(triangle[-1]) > 1:
                triangle.append([(a + b) / 2 for a, b in pairwise(triangle[-1])])
            finer += [[line[0] for line in triangle], [line[-1] for line in reversed(triangle)]]
        parts = finer
    return hull(Fraction(v) for part in parts for v in part)


@dataclass
class Task:
    """Ranges of s, w and β, and what reference and disturbance put in; symbols of FORMAT.md, SI units."""

    name: str
    b: Fraction
    s: tuple[Fraction, Fraction]
    w: tuple[Fraction, Fraction]
    beta: tuple[Fraction, Fraction]
    rest: tuple[Fraction, Fraction]
    reference_rate: Fraction
    reference_acceleration: Fraction
    reference_jerk: Fraction
    smooth: bool
    reference_force: Fraction
    drift: Fraction
    amplitude: Fraction
    change: Fraction | None
    slope_of_beta: Fraction
    steady_beta: bool


def read_task(document: dict[str, Any]) -> Task:
    """Read fault, reference and disturbance, and derive."""
    parts = ("name", "density", "shear_modulus", "length", "damping", "normal_stress", "spreads", "friction")
    given = keys(document["fault"], "fault", *parts)
    name = given["name"]
    need(type(name) is str and FAULT.fullmatch(name) is not None, "fault.name must be a short text")
    rho, modulus, size, eta, sigma = (number(given[k], f"fault.{k}") for k in parts[1:6])
    spread = numbers(given["spreads"], "spreads", "stiffness", "damping", "authority")
    mu = numbers(
        given["friction"], "friction", "static", "least", "largest", "weakening", "strengthening", "rate_slope"
    )
    need(min(rho, modulus, size, sigma, mu["least"]) > 0, "density, modulus, length, stress and friction must be > 0")
    need(min(eta, mu["weakening"], mu["strengthening"], mu["rate_slope"]) >= 0, "damping and slopes must be >= 0")
    need(all(0 <= v < 1 for v in spread.values()), "spreads must be in [0, 1)")
    need(mu["least"] <= mu["static"] <= mu["largest"], "static friction must lie between the bounds")
    shape, target, duration = read_reference(document["reference"])
    amplitude, change, grows = read_disturbance(document["disturbance"])

    k, damping, area = (
        (value * (1 - spread[kind]), value * (1 + spread[kind]))
        for value, kind in (
            (modulus / (rho * size**2), "stiffness"),
            (eta / (rho * size**3), "damping"),
            (1 / (rho * size), "authority"),
        )
    )
    b = mu["least"] * area[0]
    stress = effective_stress(mu, sigma, target, [(k_ - grows["slip"]) / n for k_, n in product(k, area)])
    bent = hull(n * at * c for n in area for at in stress for c in (mu["weakening"], -mu["strengthening"]))
    s = bent[0] - k[1] + grows["slip"], bent[1] - k[0] + grows["slip"]
    sheared = area[1] * max(abs(v) for v in stress) * mu["rate_slope"]
    w = damping[0] - sheared - grows["rate"], damping[1] + sheared - grows["rate"]
    first = max(abs(v) for v in on_unit_interval(slope(shape))) * target / duration
    second = max(abs(v) for v in on_unit_interval(slope(slope(shape)))) * target / duration**2
    bent = slope(slope(shape))
    third = max(abs(v) for v in on_unit_interval(slope(bent))) * target / duration**3
    return Task(
        name=name,
        b=b,
        s=s,
        w=w,
        beta=(Fraction(1), mu["largest"] * area[1] / b),
        rest=(sigma - stress[1], sigma - stress[0]),
        reference_rate=first,
        reference_acceleration=second,
        reference_jerk=third,
        smooth=bent[0] == 0 and sum(bent) == 0,
        reference_force=max(abs(v) for v in w) * first + second,
        drift=max(abs(v) for v in s) * first,
        amplitude=amplitude,
        change=change,
        slope_of_beta=max(mu["weakening"], mu["strengthening"]) * area[1] / b,
        steady_beta=mu["rate_slope"] == 0,
    )


def read_reference(value: Any) -> tuple[Row, Fraction, Fraction]:
    """Shape, target slip and operation time."""
    given = keys(value, "reference", "shape", "target_slip", "operation_time")
    listed = given["shape"]
    need(type(listed) is list and len(listed) <= MAX_DEGREE + 1, "shape must have at most 13 coefficients")
    shape = row(listed, "shape", len(listed))
    target, duration = (number(given[k], k) for k in ("target_slip", "operation_time"))
    need(min(target, duration) > 0, "target slip and operation time must be > 0")
    rate = slope(shape)
    ends = shape[:1] == [0] and sum(shape) == 1 and rate[:1] == [0] and sum(rate) == 0
    need(ends and on_unit_interval(rate)[0] >= 0, "the shape must rise from 0 to 1 with slope 0 at both ends")
    return shape, target, duration


def read_disturbance(value: Any) -> tuple[Fraction, Fraction | None, dict[str, Fraction]]:
    """Bound, bound of the rate of change if there is one, and growths."""
    named = (
        ("amplitude", "change", "growths") if type(value) is dict and "change" in value else ("amplitude", "growths")
    )
    given = keys(value, "disturbance", *named)
    amplitude = number(given["amplitude"], "amplitude")
    change = number(given["change"], "change") if "change" in given else None
    need(amplitude >= 0 and (change is None or change >= 0), "bounds of the disturbance must be >= 0")
    return amplitude, change, numbers(given["growths"], "growths", "slip", "rate")


def effective_stress(
    mu: dict[str, Fraction], sigma: Fraction, target: Fraction, kappas: Row
) -> tuple[Fraction, Fraction]:
    """Range of (μ*σ' − κr)/μ for 0 ≤ r ≤ target: monotone in κ, in μ and, between the points tried, in r."""
    tried = [Fraction(0), target]
    for room, rate in ((mu["static"] - mu["least"], "weakening"), (mu["largest"] - mu["static"], "strengthening")):
        if mu[rate] and room / mu[rate] <= target:
            tried.append(room / mu[rate])
    found = []
    for r, kappa in product(tried, kappas):
        load = mu["static"] * sigma - kappa * r
        found.append(load / max(mu["least"], mu["static"] - mu["weakening"] * r))
        found.append(load / min(mu["largest"], mu["static"] + mu["strengthening"] * r))
    return hull(found)


# ---------------------------------------------------------------- an implicit step

Sum = list[tuple[Row, Fraction, Any]]


@dataclass
class Root:
    """w of w = e2 - q(e1 + step*w, w), said to lie between two lines: see FORMAT.md."""

    pull: Sum
    slopes: Row
    remainder: Fraction


def read_root(value: Any) -> Root:
    """Read q, the slopes of both lines and the remainder."""
    given = keys(value, "root", "pull", "slopes", "remainder")
    slopes, remainder = row(given["slopes"], "slopes", 2), number(given["remainder"], "remainder")
    need(0 <= slopes[0] <= slopes[1] <= 1 and remainder >= 0, "slopes must be ordered in [0, 1], the remainder >= 0")
    pull = read_sum(given["pull"])
    need(count_terms(pull) <= MAX_TERMS, f"an implicit step must have at most {MAX_TERMS} terms")
    return Root(pull, slopes, remainder)


def read_sum(value: Any) -> Sum:
    """Terms: ends of the factor, power, and what it is a power of."""
    need(type(value) is list and 0 < len(value) <= MAX_TERMS, "a sum must be a list of its terms, at most 16")
    found = []
    for term in value:
        given = keys(term, "a term", "factor", "power", "of")
        factor, power, inner = row(given["factor"], "factor", 2), number(given["power"], "power"), given["of"]
        need(0 <= factor[0] <= factor[1], "a factor must have two ends that are ordered and not negative")
        need(0 <= power.numerator <= MAX_POWER and power.denominator <= MAX_POWER, "powers must be p/q with p, q <= 6")
        plain = type(inner) is str
        need(not plain or inner in ("slip", "rate"), "a term must be of slip, of rate or of a sum")
        found.append((factor, power, inner if plain else read_sum(inner)))
    return found


def count_terms(terms: Sum) -> int:
    """Terms of a sum and of the sums in it."""
    return len(terms) + sum(count_terms(inner) for _, _, inner in terms if type(inner) is not str)


def least(terms: Sum, slip: Fraction, rate: Fraction) -> Fraction:
    """Lower bound of q at these arguments or larger ones, the sign of 0 taken as 1; a multiple of 2^-BITS."""
    total = 0
    for (low, high), power, inner in terms:
        value = least(inner, slip, rate) if type(inner) is not str else slip if inner == "slip" else rate
        factor, shift = (low, 0) if value >= 0 else (-high, 1)
        size = power_below(abs(value), power) + shift
        total += factor.numerator * size // factor.denominator
    return Fraction(total, 1 << BITS)


def power_below(value: Fraction, power: Fraction) -> int:
    """Floor of value^power in units of 2^-BITS, for a value that is not negative."""
    p, q = power.numerator, power.denominator
    return whole_root((value.numerator**p << BITS * q) // value.denominator**p, q)


def whole_root(value: int, q: int) -> int:
    """Floor of the q-th root, by Newton's steps from above."""
    found = 1 << value.bit_length() // q + 1
    while value:
        following = ((q - 1) * found + value // found ** (q - 1)) // q
        if following >= found:
            return found
        found = following
    return 0


def root_within(root: Root, step: Fraction, slip: Fraction, rate: Fraction) -> bool:
    """Whether |w + g*e1/step| <= remainder, for some g between the slopes, is shown for |e1| <= slip, |e2| <= rate."""
    low, high = root.slopes
    parts = [(1 - low, -low, Fraction(0), slip / step, 0), (high - 1, high, Fraction(0), slip / step, 0)]
    while parts:
        away, along, start, end, depth = parts.pop()
        ahead, at = (root.remainder + min(v * start, v * end) for v in (away, along))
        if at - rate + least(root.pull, step * ahead, at) < 0:
            if depth == CELLS:
                return False
            middle = (start + end) / 2
            parts += [(away, along, start, middle, depth + 1), (away, along, middle, end, depth + 1)]
    return True


# ---------------------------------------------------------------- the loop


@dataclass
class Fade:
    """At most height*e^(-rate*t) + floor, t after the event with this number."""

    event: int
    height: Fraction
    rate: Fraction
    floor: Fraction


@dataclass
class Loop:
    """Flow x' = Ax, then events (map, time until the next one; none in continuous time), inputs, the implicit step.

    The first two inputs flow; those of the implicit step and of the noise, if there are any, enter with the first
    event. `noise` bounds what the measured e1 and e2 are off, an input each where it is not 0. Without events there may
    be two inputs more, the second and third derivatives of the reference.
    With a layer of rock a fourth output bounds what its modes leave out; where `fade` is given, that is one more
    input, the last one.
    """

    flow: list[Row]
    events: list[tuple[list[Row], Fraction]]
    outputs: list[Row]
    inputs: list[Row]
    root: Root | None
    step: Fraction
    noise: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    cuts: Sequence[Fraction] = field(default_factory=lambda: EVEN)
    past_cuts: Sequence[Fraction] = field(default_factory=lambda: EVEN)
    fade: Fade | None = None


def read_loop(value: Any, task: Task) -> Loop:
    """Build the error loop: e1, e2, the law's states, pressures on their way, valve, and what lies behind it.

    That is: where there is a lag, the well's pressure less the valve's; modes of a layer of rock, less the well's.
    Where a layer has no lag before it, the last state is the last step of the valve.
    """
    if type(value) is dict and "rates" in value:
        return read_continuous(value, task)
    more = [k for k in ("root", "noise", "diffusion") if type(value) is dict and k in value]
    parts = ("step", "delay", "lag", "states", "update", "measured", "output", "feedback")
    given = keys(value, "loop", *parts, *more)
    implicit, layered = "root" in more, "diffusion" in more
    root = read_root(given["root"]) if implicit else None
    step, delay, lag = (number(given[k], k) for k in ("step", "delay", "lag"))
    need(step > 0 and 0 <= delay <= MAX_PERIODS * step and lag >= 0, "step > 0, delay of 0 to 8 steps, lag >= 0")
    n = count_states(given["states"])
    update, seen = matrix(given["update"], "update", n, n), matrix(given["measured"], "measured", n, 2 + implicit)
    output, feedback = row(given["output"], "output", n), row(given["feedback"], "feedback", 2 + implicit)
    noise = read_noise(given["noise"]) if "noise" in more else (Fraction(0), Fraction(0))
    need(implicit or not noise[1] or uses_rate(seen, feedback), "noise of the slip rate needs a law that measures it")
    time = number(given.get("diffusion", "0"), "diffusion")
    need(not layered or SHORTEST * time >= step, "diffusion must take at least the 32nd part of a step")
    whole, part = delay // step, delay % step
    waiting = int(whole) + (part > 0)
    behind, stepped = (lag > 0) + MODES * layered, layered and lag == 0
    size = 2 + n + waiting + 1 + behind + stepped
    need(size <= MAX_STATES, f"the loop must have at most {MAX_STATES} states")
    valve = 2 + n + waiting
    path = range(valve + 1, valve + 1 + behind)
    modes = path[lag > 0 :]

    push = [Fraction(i in (valve, valve + 1)) for i in range(size)]  # modes follow
    flow = zeros(size)
    flow[0][1] = Fraction(1)
    if lag > 0:
        flow[valve + 1][valve + 1] = -1 / lag
    for k, mode in enumerate(modes):
        push[mode], flow[mode][mode] = mode_share(k), -mode_rate(k, time)
        if lag > 0:
            flow[mode][valve + 1] = 1 / lag
    flow[1] = [sum(task.beta) / 2 * v for v in push]
    flow[1][0], flow[1][1] = sum(task.s) / 2, -sum(task.w) / 2

    rest = [Fraction(0)] * (size - 2 - n)  # behind it the column of w
    asked = [*(task.b * v for v in (*feedback[:2], *output)), *rest, task.b * sum(feedback[2:])]
    sample = [[*line, Fraction(0)] for line in unit(size)]
    for i in range(n):
        sample[2 + i] = [*seen[i][:2], *update[i], *rest, Fraction(sum(seen[i][2:]))]
    queue = [*range(2 + n, 2 + n + waiting), *([] if part else [valve])]
    for i, place in enumerate(queue):
        sample[place] = [*unit(size)[queue[i - 1]], Fraction(0)] if i else asked
    arrival = unit(size)
    arrival[valve] = unit(size)[valve - 1]
    pressures = [Fraction(0)] * (2 + n) + [Fraction(-1)] * (waiting + 1) + [Fraction(0)] * (behind + stepped)
    still = [[v - (i == j) for j, v in enumerate(line)] for i, line in enumerate(update)]
    drift = [
        *pressures[:2],
        *(-v / task.b for v in steady_states(still, output, [Fraction(0)] * n, Fraction(1))),
        *pressures[2 + n :],
    ]
    last = arrival if part else sample
    change = [v - (i == valve) for i, v in enumerate(last[valve])]
    for i in path[:1] if lag > 0 else path:  # it stays while the valve's pressure jumps
        last[i] = [v - c for v, c in zip(last[i], change, strict=True)]
    if stepped:
        last[-1] = change
    slope = sum(root.slopes) / (2 * step) if root else Fraction(0)
    events = [([[line[0] - slope * line[size], *line[1:size]] for line in sample], part or step)]
    events += [(arrival, step - part)] if part else []
    inputs = [unit(size)[1], drift, *([[line[size] for line in sample]] if root else [])]
    told = [[line[k] - (i == k) for i, line in enumerate(events[0][0])] for k in (0, 1)]  # what the law makes of both
    inputs += [entry for entry, off in zip(told, noise, strict=True) if off]
    outputs = [unit(size)[0], unit(size)[1], push]
    if not layered:
        return Loop(flow, events, outputs, inputs, root, step, noise)
    high, rate, floor = abs(mode_share(MODES)), mode_rate(MODES, time), 6 * MODES * SHORT
    if lag > 0:
        left = (high / rate + floor * time) / lag
        return Loop(
            flow, events, [*outputs, [left * v for v in unit(size)[valve + 1]]], inputs, root, step, noise, BENT, HALVES
        )
    height, floor = high * (1 + 1 / (rate * step)), floor * (1 + time / step)
    most = height + floor
    fade = Fade(int(part > 0), height / most, rate, floor / most)
    outputs, inputs = [*outputs, [most * v for v in unit(size)[-1]]], [*inputs, unit(size)[1]]
    return Loop(flow, events, outputs, inputs, root, step, noise, BENT, HALVES, fade)


def read_noise(value: Any) -> tuple[Fraction, Fraction]:
    """Bounds of what the measured slip and slip rate are off."""
    slip, rate = numbers(value, "noise", "slip", "rate").values()
    need(slip >= 0 and rate >= 0, "bounds of the noise must be >= 0")
    return slip, rate


def uses_rate(measured: list[Row], feedback: Row) -> bool:
    """Whether a law without an implicit step does anything with the slip rate."""
    return any(line[1] for line in (*measured, feedback))


def mode_rate(number: int, time: Fraction) -> Fraction:
    """How fast a mode of a layer decays, from below, for L^2/D = time."""
    return ((2 * number + 1) * PI / 2) ** 2 / time


def mode_share(number: int) -> Fraction:
    """What a mode of a layer takes of a step, its size from above."""
    return (-1) ** number * 4 / ((2 * number + 1) * PI)


def read_continuous(value: Any, task: Task) -> Loop:
    """Build the error loop of a law whose pressure acts at once: e1, e2 and the law's states."""
    parts = ("states", "rates", "measured", "output", "feedback")
    given = keys(value, "loop", *parts, *(["of_reference"] if "of_reference" in value else []))
    n = count_states(given["states"])
    rates, seen = matrix(given["rates"], "rates", n, n), matrix(given["measured"], "measured", n, 2)
    output, feedback = row(given["output"], "output", n), row(given["feedback"], "feedback", 2)
    push = [task.b * v for v in (*feedback, *output)]
    middles = [sum(task.s) / 2, -sum(task.w) / 2] + [Fraction(0)] * n
    flow = [unit(2 + n)[1]]
    flow.append([v + sum(task.beta) / 2 * p for v, p in zip(middles, push, strict=True)])
    flow += [[*fed, *kept] for fed, kept in zip(seen, rates, strict=True)]
    steady = steady_states(rates, output, [Fraction(0)] * n, Fraction(1))
    inputs = [unit(2 + n)[1], [Fraction(0)] * 2 + [-v / task.b for v in steady]]
    forward = row(given.get("of_reference", ["0", "0"]), "of_reference", 2)
    if any(forward):
        need(task.smooth, "the reference must start and end without acceleration for this law")
        moving = steady_states(rates, output, steady, Fraction(0))
        inputs += [[Fraction(0)] * 2 + [k * v for v in moving] for k in forward]
    return Loop(flow, [], [unit(2 + n)[0], unit(2 + n)[1], push], inputs, None, Fraction(0))


def count_states(names: Any) -> int:
    """Number of a law's states, after checking their names."""
    sound = type(names) is list and len(names) <= MAX_LAW_STATES and all(type(v) is str for v in names)
    need(sound and all(NAME.fullmatch(v) for v in names) and len(set(names)) == len(names), "states must be names")
    return len(names)


def zeros(size: int) -> list[Row]:
    """Square matrix of zeros."""
    return [[Fraction(0)] * size for _ in range(size)]


def unit(size: int) -> list[Row]:
    """Unit matrix."""
    return [[Fraction(i == j) for j in range(size)] for i in range(size)]


def steady_states(own: list[Row], output: Row, rates: Row, asked: Fraction) -> Row:
    """Some z with Mz = rates and Cz = asked, by elimination."""
    n = len(output)
    table = [[*line, rate] for line, rate in zip(own, rates, strict=True)]
    table.append([*output, asked])
    found = [Fraction(0)] * n
    pivots: list[tuple[int, Row]] = []
    for column in range(n):
        chosen = next((line for line in table if line[column]), None)
        if chosen is None:
            continue
        chosen = [v / chosen[column] for v in chosen]
        table = [[a - line[column] * c for a, c in zip(line, chosen, strict=True)] for line in table]
        pivots.append((column, chosen))
    need(not any(line[n] for line in table), "the law must be able to ask for a constant pressure without errors")
    for column, line in reversed(pivots):
        found[column] = line[n] - sum(v * f for v, f in zip(line, found, strict=False))
    return found


# ---------------------------------------------------------------- integers with bounds of their errors


@dataclass
class Fixed:
    """Matrix of integers in units of 2^-BITS; no entry is farther from the true one than `error` units."""

    rows: list[list[int]]
    error: int = 0

    def __mul__(self, other: "Fixed") -> "Fixed":
        columns = list(zip(*other.rows, strict=True))
        rows = [[sum(map(int.__mul__, line, column)) >> BITS for column in columns] for line in self.rows]
        widest = max(sum(map(abs, line)) for line in self.rows) + self.error * len(self.rows[0])
        tallest = max((sum(map(abs, column)) for column in columns), default=0)
        return bounded(Fixed(rows, (widest * other.error + tallest * self.error >> BITS) + 2))

    def __add__(self, other: "Fixed") -> "Fixed":
        rows = [[a + b for a, b in zip(*lines, strict=True)] for lines in zip(self.rows, other.rows, strict=True)]
        return Fixed(rows, self.error + other.error)

    def scaled(self, factor: Fraction) -> "Fixed":
        """Times a number that is not negative."""
        top, bottom = factor.numerator, factor.denominator
        return bounded(Fixed([[v * top // bottom for v in line] for line in self.rows], self.error * top // bottom + 2))

    def size(self) -> "Fixed":
        """Upper bounds of the absolute values, exact."""
        return Fixed([[abs(v) + self.error for v in line] for line in self.rows])

    def beside(self, *others: "Fixed") -> "Fixed":
        """Columns of several matrices side by side."""
        parts = (self, *others)
        rows = [[v for line in lines for v in line] for lines in zip(*(p.rows for p in parts), strict=True)]
        return Fixed(rows, max(p.error for p in parts))

    def above(self, *others: "Fixed") -> "Fixed":
        """Rows of several matrices, one after another."""
        parts = (self, *others)
        return Fixed([line for p in parts for line in p.rows], max(p.error for p in parts))

    def sums(self) -> list[int]:
        """Upper bounds of the sums of absolute values, row by row."""
        return [sum(map(abs, line)) + self.error * len(line) for line in self.rows]


def bounded(value: Fixed) -> Fixed:
    """Refuse numbers that only an unstable or absurd loop can have."""
    largest = max(map(abs, chain([value.error], *value.rows)))
    need(largest <= LARGEST, "the nominal loop must be stable, its numbers of ordinary size")
    return value


def fixed(rows: Sequence[Sequence[Fraction]]) -> Fixed:
    """Nearest multiples below."""
    return bounded(Fixed([[(v.numerator << BITS) // v.denominator for v in line] for line in rows], 1))


def column(values: Sequence[Fraction]) -> Fixed:
    """One column."""
    return fixed([[v] for v in values])


def exponential(flow: list[Row], time: Fraction) -> Fixed:
    """e^{At} by a Taylor sum at t/2^j and squaring."""
    norm = max(sum(map(abs, line)) for line in flow) * time
    need(norm <= 1 << 12, "the flow must change by a factor of ordinary size between two events")
    halvings = int(norm).bit_length()  # to a norm below 1
    base = fixed([[v * time / 2**halvings for v in line] for line in flow])
    term = total = fixed(unit(len(flow)))
    terms = next(n for n in count(2) if factorial(n) >> BITS + 1)
    for k in range(1, terms):
        term = (term * base).scaled(Fraction(1, k))
        total = total + term
    # what is left out is below 2/n!, n terms: less than the unit that the error of the exact first term has to spare
    for _ in range(halvings):
        total = total * total
    return total


def exponentials(flow: list[Row], times: Row) -> list[Fixed]:
    """The same of several times, as powers of that of the longest time that goes into all of them."""
    return shared_exponentials(tuple(map(tuple, flow)), tuple(times), BITS)


@lru_cache(maxsize=16)  # all inputs of a loop ask for the same ones
def shared_exponentials(flow: tuple[tuple[Fraction, ...], ...], times: tuple[Fraction, ...], _: int) -> list[Fixed]:
    """The same, computed once in so many bits."""
    grain = times[0] / lcm(*((times[0] / time).numerator for time in times))
    found = {1: exponential([list(line) for line in flow], grain)}

    def power(k: int) -> Fixed:
        if k not in found:
            half = power(k // 2)
            found[k] = half * half * found[1] if k % 2 else half * half
        return found[k]

    return [power(int(time / grain)) for time in times]


# ---------------------------------------------------------------- L1 norms


@dataclass
class Flow:
    """One event and the flow after it, cut into pieces, for one input.

    It enters at every time, with the event alone (`sudden`), or less and less (`masses`, of every piece).
    """

    event: Fixed
    pieces: Row
    steps: list[Fixed]
    nears: list[Fixed]
    whole: Fixed
    entry: Fixed
    generator: Fixed
    moved: set[int]
    sudden: bool
    masses: list[tuple[Fraction, Fraction]]

    def ends(self, start: int = 0) -> list[Fixed]:
        """Impulse response from the start of a piece on, at the ends of pieces."""
        found = [self.entry]
        for step in self.steps[start:]:
            found.append(step * found[-1])
        return found

    def slope(self, now: Fixed, i: int) -> Fixed:
        """Bound of the first derivative over a piece that begins like this."""
        return (self.nears[i] * (self.generator * now).size()).size()

    def bend(self, now: Fixed, i: int) -> Fixed:
        """The same of the second derivative."""
        return (self.nears[i] * (self.generator * (self.generator * now)).size()).size()


def cut(loop: Loop, cuts: Sequence[Fraction], entry: Row, sudden: bool, fade: Fade | None = None) -> list[Flow]:
    """Flows with their pieces between the cuts, for one input."""
    flows = []
    generator = fixed(loop.flow)
    moved = {i for i, v in enumerate(entry) if v}  # by the flow, at least
    moved = following = {i for i, line in enumerate(loop.flow) if any(line[j] for j in moved)}
    while following:
        following = {i for i, line in enumerate(loop.flow) if any(line[j] for j in moved)} - moved
        moved = moved | following
    for place, (event, duration) in enumerate(loop.events):
        entry = [Fraction(0)] * len(entry) if sudden and place else entry
        lengths = [(b - a) * duration for a, b in pairwise(cuts)]
        steps = exponentials(loop.flow, lengths)
        nears = [near.size() for near in exponentials(majorant(loop.flow), lengths)]
        whole = fixed(event)
        for step in steps:
            whole = step * whole
        masses = []
        if fade:
            turned = loop.events[fade.event :] + loop.events[: fade.event]
            since = sum(length for _, length in turned[: (place - fade.event) % len(turned)])
            masses = [mass(fade, since + c * duration, h) for c, h in zip(cuts, lengths, strict=False)]
        flows.append(Flow(fixed(event), lengths, steps, nears, whole, column(entry), generator, moved, sudden, masses))
    return flows


def mass(fade: Fade, start: Fraction, length: Fraction) -> tuple[Fraction, Fraction]:
    """Bounds of the integral of the weight over a piece, and of its first moment about the start."""
    x = fade.rate * start
    height = fade.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24)  # e^x is larger than this sum
    moment = height * min(1 / fade.rate**2, length**2 / 2) + fade.floor * length**2 / 2
    return height * min(1 / fade.rate, length) + fade.floor * length, moment


def majorant(flow: list[Row]) -> list[Row]:
    """M with |e^{Aδ}| ≤ e^{Mδ} ≤ e^{Mh} for 0 ≤ δ ≤ h: absolute values, on the diagonal no negative ones."""
    return [[max(v, Fraction(0)) if i == j else abs(v) for j, v in enumerate(line)] for i, line in enumerate(flow)]


def pieces(flow: Flow, later: Fixed | None) -> Fixed:
    """Columns whose sum of absolute values, after any row, bounds the integral over a flow that `later` may follow."""
    ends = flow.ends()
    if flow.sudden:
        return later * ends[-1] if later else ends[-1]
    if flow.masses:
        summed = [(flow.ends(i)[-1], m) for i, (m, _) in enumerate(flow.masses)]
        rests = [(flow.slope(flow.ends(i + 1)[-1], i), m) for i, (_, m) in enumerate(flow.masses)]
    else:
        around = [a + b for a, b in pairwise([Fraction(0), *flow.pieces, Fraction(0)])]
        summed = [(end, width / 2) for end, width in zip(ends, around, strict=True)]
        rests = [(flow.bend(ends[i], i), h**3 / 12) for i, h in enumerate(flow.pieces)]
    bound = [sum(bent.rows[j][0] * weight for bent, weight in rests) for j in range(len(flow.event.rows))]
    rest = Fixed([[ceil(v) if j in flow.moved else 0] for j, v in enumerate(bound)])
    if later:
        summed, rest = [(later * end, weight) for end, weight in summed], (later.size() * rest).size()
    corner = [i for i, (v,) in enumerate(rest.rows) if v]
    diagonal = Fixed([[v if i == j else 0 for j in corner] for i, (v,) in enumerate(rest.rows)])
    first, *others = (end.scaled(weight) for end, weight in summed)
    return first.beside(*others, diagonal)


@dataclass
class Past:
    """All periods before: columns of many of them, and what bounds the rest."""

    columns: Fixed
    far: Fixed
    left: Fixed

    def of(self, rows: Fixed) -> list[int]:
        """Bounds of the integrals for every row; equal rows are done once."""
        once = list(dict.fromkeys(map(tuple, rows.rows)))
        different = Fixed([list(line) for line in once], rows.error)
        rest = ((different * self.far).size() * self.left).size()
        sums = zip((different * self.columns).sums(), rest.rows, strict=True)
        found = dict(zip(once, (near + far for near, (far,) in sums), strict=True))
        return [found[tuple(line)] for line in rows.rows]


def past(flows: list[Flow], rows: int) -> Past:
    """Sum 2^j periods until what is left is below a 256th of every unit row's sum."""
    *earlier, flow = flows
    period, columns = flow.whole, pieces(flow, None)
    for flow in reversed(earlier):
        columns, period = columns.beside(pieces(flow, period)), period * flow.whole
    size = len(period.rows)
    sums = columns.sums()
    for _ in range(DOUBLINGS):
        width = len(columns.rows[0])
        need(2 * width * size * (size + rows) <= MAX_WORK, "the loop must forget its past sooner: it takes too long")
        following = period * columns
        sums = [a + b for a, b in zip(sums, following.sums(), strict=True)]
        columns, period = columns.beside(following), period * period
        left = (period.size() * Fixed([[v] for v in sums])).size()
        if all(v * SHARE <= total for (v,), total in zip(left.rows, sums, strict=True)):
            return Past(columns, period, Fixed([[ceil(Fraction(v * SHARE, SHARE - 1))] for v in sums]))
    raise Refused(f"the nominal loop must be stable, and seen to be within {2**DOUBLINGS} periods")


def gains(loop: Loop, entry: Row, sudden: bool, fade: Fade | None = None) -> list[list[Fraction]]:
    """Bounds of every output for an input of size 1, on every piece of the period."""
    if not loop.events:
        return [[v] for v in flow_gains(loop, entry)]
    loop, entry = in_even_units(loop, entry)
    size, many = len(loop.flow), len(loop.outputs)
    flows, early = (cut(loop, cuts, entry, sudden, fade) for cuts in (loop.cuts, loop.past_cuts))
    start = fixed(loop.outputs)
    square = flows[0].generator * flows[0].generator
    before = past(early, len(flows) * (many * len(loop.cuts) + size))
    found: list[list[Fraction]] = [[] for _ in loop.outputs]
    for number_of, flow in enumerate(flows):
        phases = [start]
        for step in flow.steps:
            phases.append(phases[-1] * step)
        stack = phases[0].above(*phases[1:], fixed(unit(size))) * flow.event
        earlier = integral(early[:number_of], before, stack)
        units = Fixed([[v] for v in earlier[-size:]])
        news = list(since_event(flow, start))
        for i, h in enumerate(flow.pieces):
            bent = (((phases[i] * square).size() * flow.nears[i]).size() * units).sums()
            for k in range(many):
                first, last, more = (part[k] for part in news[i])
                larger = max(earlier[many * i + k] + first, earlier[many * (i + 1) + k] + last)
                found[k].append((larger + more + bent[k] * h**2 / 8) / (1 << BITS))
    return found


def since_event(flow: Flow, outputs: Fixed) -> Iterator[tuple[Row, Row, Row]]:
    """What came since the event, in every piece: bounds at both ends, and of what may lie above both of them."""
    ends, size = flow.ends(), outputs.size()
    heights = [sums_of(outputs * end) for end in ends]
    total = [Fraction(0)] * len(size.rows)
    for i, h in enumerate(flow.pieces):
        bend, slope = sums_of(size * flow.bend(ends[i], i)), sums_of(size * flow.slope(ends[i], i))
        if flow.sudden:
            yield heights[i], heights[i + 1], [v * h**2 / 8 for v in bend]
        elif flow.masses:
            yield faded(flow, outputs, i)
        else:
            parts = zip(total, heights[i], heights[i + 1], bend, strict=True)
            following = [v + (a + b) * h / 2 + c * h**3 / 12 for v, a, b, c in parts]
            yield total, following, [v * h**2 / 8 for v in slope]
            total = following


def faded(flow: Flow, outputs: Fixed, i: int) -> tuple[Row, Row, Row]:
    """The same of what fades: pieces that have passed, and all that the present one may bring."""
    size, chord = outputs.size(), flow.pieces[i] ** 2 / 8
    first, last = [Fraction(0)] * len(size.rows), [Fraction(0)] * len(size.rows)
    ends = [sums_of(outputs * now) for now in (flow.entry, flow.steps[i] * flow.entry)]
    bent = sums_of(size * flow.bend(flow.entry, i))
    more = [flow.masses[i][0] * (max(a, b) + c * chord) for a, b, c in zip(*ends, bent, strict=True)]
    for p, (heavy, moment) in enumerate(flow.masses[:i]):
        now, later = flow.ends(p)[i - p], flow.ends(p + 1)[i - p - 1]
        slope = sums_of(size * (flow.nears[p] * flow.slope(later, i)).size())
        bent = sums_of(size * flow.bend(now, i))
        here, there = sums_of(outputs * now), sums_of(outputs * (flow.steps[i] * now))
        first = [v + heavy * a for v, a in zip(first, here, strict=True)]
        last = [v + heavy * a for v, a in zip(last, there, strict=True)]
        more = [v + heavy * a * chord + moment * b for v, a, b in zip(more, bent, slope, strict=True)]
    return first, last, more


def sums_of(values: Fixed) -> Row:
    """Upper bounds of one column."""
    return [Fraction(v) for v in values.sums()]


def flow_gains(loop: Loop, entry: Row) -> Row:
    """The same without events, for ever: stretches of pieces, each twice as long as the one before."""
    flow, outputs, now = balanced(loop, entry)
    size, piece = len(flow), Fraction(1)
    while max(sum(map(abs, line)) for line in flow) * piece > Fraction(1, 1 << PARTS):
        piece /= 2
    step, near = exponential(flow, piece), exponential(majorant(flow), piece).size()
    square, sums = fixed(flow) * fixed(flow), [[0] * (size + 1) for _ in outputs.rows]
    for _ in range(min(STRETCHES, MAX_WORK // (4 * size**2 * (size + 1) << PARTS))):
        ends, power = now, step
        for _ in range(PARTS):
            ends, power = ends.beside(power * ends), power * power
        now = power * now
        bends = ((outputs.size() * near).size() * (square * ends).size()).size()
        add_areas(sums, (outputs * ends.beside(now)).size(), bends, piece)
        late = (Fixed([line[:size] for line in sums]) * now.size()).size()
        pairs = list(zip(late.rows, sums, strict=True))
        if all(v * LATE <= total for far, line in pairs for v, total in zip(far[:size], line[:size], strict=True)):
            return [(line[size] + Fraction(LATE * far[size], LATE - 1)) / (1 << BITS) for far, line in pairs]
        further = (step.size() * near).size()
        near = Fixed([list(map(max, *lines)) for lines in zip(near.rows, further.rows, strict=True)])
        step, piece = step * step, 2 * piece
    raise Refused("the nominal loop must be stable, and seen to be")


def add_areas(sums: list[list[int]], heights: Fixed, bends: Fixed, piece: Fraction) -> None:
    """Add, to every entry of the sums, bounds of the integrals over all pieces whose ends have these heights."""
    for total, line, bent in zip(sums, heights.rows, bends.rows, strict=True):
        for i, bend in enumerate(bent):
            area = (line[i] + line[i + len(total)]) * piece / 2 + bend * piece**3 / 12
            total[i % len(total)] += ceil(area)


def balanced(loop: Loop, entry: Row) -> tuple[list[Row], Fixed, Fixed]:
    """A, outputs, and unit columns with the entry, in even units."""
    even, entry = in_even_units(loop, entry)
    return even.flow, fixed(even.outputs), fixed(unit(len(even.flow))).beside(column(entry))


def in_even_units(loop: Loop, entry: Row) -> tuple[Loop, Row]:
    """A loop and an input in units of the states that make the rows and columns of its maps alike."""
    maps = [loop.flow, *(line for line, _ in loop.events)]
    sizes = [[sum(map(abs, entries)) for entries in zip(*lines, strict=True)] for lines in zip(*maps, strict=True)]
    units = even_units(tuple(map(tuple, sizes)))
    flow, *jumps = [
        [[v * u / own for v, u in zip(line, units, strict=True)] for line, own in zip(lines, units, strict=True)]
        for lines in maps
    ]
    events = [(jump, time) for jump, (_, time) in zip(jumps, loop.events, strict=True)]
    outputs = [[v * u for v, u in zip(line, units, strict=True)] for line in loop.outputs]
    even = replace(loop, flow=flow, events=events, outputs=outputs)
    return even, [v / u for v, u in zip(entry, units, strict=True)]


@lru_cache(maxsize=4)
def even_units(table: tuple[tuple[Fraction, ...], ...]) -> Row:
    """Powers of 2 that make every row of a table u_i^-1 |t_ij| u_j about as large as its column."""
    size = len(table)
    units = [Fraction(1)] * size
    for i in list(range(size)) * 16:
        line = sum(abs(v) * units[j] / units[i] for j, v in enumerate(table[i]) if j != i)
        under = sum(abs(table[j][i]) * units[i] / units[j] for j in range(size) if j != i)
        if line and under:
            ratio = Fraction(line / under)
            units[i] *= Fraction(2) ** ((ratio.numerator.bit_length() - ratio.denominator.bit_length()) // 2)
    return units


def integral(flows: list[Flow], before: Past, rows: Fixed) -> list[int]:
    """Bounds for rows that act after the given flows of this period, and before the event of the next."""
    if not flows:
        return before.of(rows)
    own = (rows * pieces(flows[-1], None)).sums()
    return [a + b for a, b in zip(own, integral(flows[:-1], before, rows * flows[-1].whole), strict=True)]


# ---------------------------------------------------------------- a slow input gain


@dataclass
class Slow:
    """Cut the range of beta into so many parts; what is past counts e^(growth*t) times, t ago."""

    parts: int
    growth: Fraction


def read_slow(value: Any, task: Task, loop: Loop) -> Slow:
    """Read how the slow change of beta is used: friction of the slip alone, and a law of samples."""
    given = keys(value, "slow_gain", "parts", "growth")
    parts, growth = given["parts"], number(given["growth"], "growth")
    need(type(parts) is int and 1 <= parts <= MAX_PARTS and growth > 0, "slow_gain needs 1 to 16 parts, growth > 0")
    need(task.steady_beta and bool(loop.events), "slow_gain needs friction of the slip alone and a law of samples")
    return Slow(parts, growth)


def with_gain(loop: Loop, gain: Fraction, growth: Fraction) -> Loop:
    """The loop with another nominal beta, its responses e^(growth*t) as large after t."""
    flow = [[v + growth * (i == j) for j, v in enumerate(line)] for i, line in enumerate(loop.flow)]
    flow[1] = [*flow[1][:2], *(gain * v for v in loop.outputs[2][2:])]
    return replace(loop, flow=flow)


def slow_gains(task: Task, loop: Loop, slow: Slow) -> list[list[list[Fraction]]]:
    """Gains of every input, and of one more, the past of what enters as the first, one part after another."""
    width = (task.beta[1] - task.beta[0]) / slow.parts
    total: list[list[list[Fraction]]] = [[[] for _ in loop.outputs] for _ in [*loop.inputs, None]]
    for part in range(slow.parts):
        gain = task.beta[0] + (2 * part + 1) * width / 2
        steady, grown = (with_gain(loop, gain, growth) for growth in (Fraction(0), slow.growth))
        for whole, found in zip(total, [*input_gains(steady), gains(grown, loop.inputs[0], False)], strict=True):
            for line, values in zip(whole, found, strict=True):
                line += values
    return total


# ---------------------------------------------------------------- the theorem


def input_gains(loop: Loop) -> list[list[list[Fraction]]]:
    """Gains of every input."""
    fades = len(loop.inputs) - 1 if loop.fade else None
    return [
        gains(loop, entry, place > 1 and place != fades, *[loop.fade] * (place == fades))
        for place, entry in enumerate(loop.inputs)
    ]


def bounds(task: Task, loop: Loop, slow: Slow | None = None, slip: Fraction = Fraction(0)) -> tuple[Row, Fraction]:
    """Bounds of |e1|, |e2| and b|p − p*|, and the small gain (FORMAT.md, A guarantee); the best of both classes.

    With a slow gain they hold while the slip error stays below `slip`.
    """
    spread = None
    if slow:
        off = (task.beta[1] - task.beta[0]) / (2 * slow.parts) + 2 * task.slope_of_beta * slip
        spread = off, task.slope_of_beta * task.reference_rate * ONE_OVER_E / slow.growth
    found = slow_gains(task, loop, slow) if slow else input_gains(loop)
    proved, refusals = [], []
    for one in [task] if task.change is None else [task, replace(task, change=None)]:
        try:
            proved.append(of_class(one, loop, found, spread))
        except Refused as refusal:
            refusals.append(refusal)
    if not proved:
        raise refusals[0]
    return [min(values) for values in zip(*(peaks for peaks, _ in proved), strict=True)], min(m for _, m in proved)


def of_class(
    task: Task, loop: Loop, found: list[list[list[Fraction]]], spread: tuple[Fraction, Fraction] | None = None
) -> tuple[Row, Fraction]:
    """The same of one class of disturbances, from the gains of every input.

    `spread`: how far a slow beta is off that of a nominal loop by itself, and by its past.
    """
    half = [(high - low) / 2 for low, high in (task.s, task.w, task.beta)]
    force, drift, coupling, shifted = inputs(task, half[2])
    half[2] = spread[0] if spread else half[2]
    own, shares = [force, drift], [half, [Fraction(0), coupling, Fraction(0)]]
    if loop.root:
        low, high = loop.root.slopes
        wide = (high - low) / 2 / loop.step
        own.append(loop.root.remainder + wide * loop.noise[0])
        shares.append([wide, Fraction(0), Fraction(0)])
    noise = [off for off in loop.noise if off]
    own += noise
    shares += [[Fraction(0)] * 3] * len(noise)
    if not loop.events and len(loop.inputs) == 4:
        own += [task.reference_acceleration, task.reference_jerk]
        shares += [[Fraction(0)] * 3] * 2
    if len(loop.outputs) > 3:  # the last one bounds what the modes of a layer leave out
        shares = [[*share, Fraction(0)] for share in shares]
        if loop.fade:
            own.append(Fraction(0))
            shares.append([Fraction(0)] * 4)
        shares[-1 if loop.fade else 0][3] = task.beta[1]
    if spread:
        own.append(Fraction(0))
        shares.append([Fraction(0), Fraction(0), spread[1], *[Fraction(0)] * (len(loop.outputs) - 3)])
    table = [
        [max(sum(c * g for c, g in zip(share, at, strict=True)) for at in zip(*of, strict=True)) for of in found]
        for share in shares
    ]
    small = radius(table)
    need(small < 1, f"the small gain must be below 1. It is {upper(small)}")
    sizes = solve(table, own)
    peaks = [
        max(sum(g * v for g, v in zip(at, sizes, strict=True)) for at in zip(*of, strict=True))
        for of in zip(*found, strict=True)
    ]
    return [peaks[0], peaks[1], sum(peaks[2:]) + shifted], small


def solve(table: list[Row], own: Row) -> Row:
    """(1 − M)^-1 F by elimination: M >= 0 has all pivots positive if, and only if, its spectral radius is below 1."""
    lines = [[(i == j) - v for j, v in enumerate(line)] + [own[i]] for i, line in enumerate(table)]
    for i, line in enumerate(lines):
        need(line[i] > 0, "the small gain must be below 1")
        line[:] = [v / line[i] for v in line]
        for other in lines:
            if other is not line:
                other[:] = [v - other[i] * p for v, p in zip(other, line, strict=True)]
    return [line[-1] for line in lines]


def radius(table: list[Row]) -> Fraction:
    """Upper bound of the spectral radius of M >= 0, by halving: it is below v where M/v passes `solve`."""
    low, high = Fraction(0), max(sum(line) for line in table) + 1
    for _ in range(48):
        middle = (low + high) / 2
        try:
            solve([[v / middle for v in line] for line in table], [Fraction(0)] * len(table))
        except Refused:
            low = middle
        else:
            high = middle
    return high


def inputs(task: Task, half_beta: Fraction) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    """Bounds of the force and the drift, the coupling from e2 to the drift, and what the push is shifted by."""
    if task.change is None:
        return task.reference_force + task.amplitude, task.drift, Fraction(0), Fraction(0)
    if not task.steady_beta:
        middle = sum(task.beta) / 2
        left = task.amplitude * half_beta / middle
        return task.reference_force + left, task.drift + task.change / middle, Fraction(0), task.amplitude / middle
    coupling = task.amplitude * task.slope_of_beta
    return task.reference_force, task.drift + task.change + coupling * task.reference_rate, coupling, task.amplitude


CLAIMS = ("slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure", "largest_pressure")


def verify(document: dict[str, Any]) -> list[str]:
    """Verify the claims of a parsed file; the statement, line by line.

    Raises
    ------
    Refused
        When a rule is broken, or a claim does not follow.
    """
    more = ["slow_gain"] if "slow_gain" in document else []
    keys(document, "the file", "format", "kind", "fault", "reference", "disturbance", "loop", "claims", *more)
    claims = numbers(document["claims"], "claims", *CLAIMS)
    task = read_task(document)
    loop = read_loop(document["loop"], task)
    errors = [claims[name] + off for name, off in zip(CLAIMS[:2], loop.noise, strict=True)]
    within = loop.root is None or root_within(loop.root, loop.step, *errors)
    need(within, "the root of the implicit step must lie between its lines for all errors that are claimed")
    slow = read_slow(document["slow_gain"], task, loop) if more else None
    (slip, rate, push), small = bounds(task, loop, slow, claims["slip_error"])
    need(not slow or slip < claims["slip_error"], "the slip error that moves the input gain must stay below its claim")
    low, high = task.rest[0] - push / task.b, task.rest[1] + push / task.b
    found = dict(zip(CLAIMS, (slip, rate, rate + task.reference_rate, low, high), strict=True))
    for name, value in found.items():
        holds = value >= claims[name] if name == "least_pressure" else value <= claims[name]
        need(holds, f"the claim {name} must follow from the rest. It does not")
    return statement(document, task, claims, small)


def statement(document: dict[str, Any], task: Task, claims: dict[str, Fraction], small: Fraction) -> list[str]:
    """What was verified, in ASCII; bounds on their outer side, those of the disturbances on their inner one."""
    loop = document["loop"]
    when = "for a pressure that acts at once (continuous time), which no sampled controller has"
    if "step" in loop:
        when = f"every {loop['step']} s, {loop['delay']} s late, lag {loop['lag']} s"
        when += f", rock of L^2/D = {loop['diffusion']} s" if "diffusion" in loop else ""
    kind = f"|phi| <= {lower(task.amplitude)} m/s^2"
    if task.change is not None:
        kind += f", |phi'| <= {lower(task.change)} m/s^3, phi(0) = 0"
    implicit = " and an implicit step" if "root" in loop else ""
    alone = "root" not in loop and not any(line[1] != "0" for line in (*loop["measured"], loop["feedback"]))
    told = " of the slip alone" if alone else ""
    off = ""
    if "noise" in loop:
        rate = "" if alone else f", slip rate within {loop['noise']['rate']} m/s"
        off = f", measured slip within {loop['noise']['slip']} m of the true one{rate}"
    return [
        f"fault {ascii(task.name)[1:-1]} (a name; the data in the file are what counts), friction "
        + ("any function of the slip alone" if "slow_gain" in document else "anything")
        + " within its bounds and slopes, continued to negative slip rates",
        f"s in [{lower(task.s[0])}, {upper(task.s[1])}] 1/s^2, w in [{lower(task.w[0])}, {upper(task.w[1])}] 1/s, "
        f"beta in [1, {upper(task.beta[1])}], b = {upper(task.b)} m^2/kg, derived",
        f"law with {len(loop['states'])} states{implicit}{told}, {when}{off}",
        f"disturbance: {kind}; from rest, along the reference, for ever; small gain {upper(small)}",
        f"the slip rate of this fault never exceeds {upper(claims['peak_slip_rate'])} m/s",
        f"|slip - reference| <= {upper(claims['slip_error'])} m, "
        f"|slip rate - reference's| <= {upper(claims['slip_rate_error'])} m/s",
        f"pressure from {lower(claims['least_pressure'])} Pa to {upper(claims['largest_pressure'])} Pa",
    ]


def upper(value: Fraction) -> str:
    """Decimal with four digits that is not below the number."""
    exponent = len(str(abs(value.numerator))) - len(str(value.denominator)) - 4
    digits = -(-value // Fraction(10) ** exponent)
    while abs(digits) >= 10**4:
        exponent += 1
        digits = -(-value // Fraction(10) ** exponent)
    return f"{float(f'{digits}e{exponent}'):.4g}"


def lower(value: Fraction) -> str:
    """Decimal with four digits that is not above the number."""
    return f"{0 - float(upper(-value)):.4g}"
