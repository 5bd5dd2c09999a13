"""From the data of a fault to ranges: slopes, input gain, friction and reference, from rational inequalities alone."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product
from math import comb
from typing import Any

from .reading import Row, keys, need, number, numbers, row

MAX_DEGREE = 12
HALVINGS = 7
FAULT = re.compile(r"\w[\w .-]{0,59}")


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
    """Ranges of s, w and β, and inputs by reference and disturbance; symbols of FORMAT.md, SI units."""

    name: str
    b: Fraction
    s: tuple[Fraction, Fraction]
    w: tuple[Fraction, Fraction]
    beta: tuple[Fraction, Fraction]
    normal_stress: Fraction
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


@dataclass
class Rock:
    """A fault: stiffness, damping and area per mass, each in its range, and friction; SI units."""

    name: str
    normal_stress: Fraction
    mu: dict[str, Fraction]
    stiffness: tuple[Fraction, Fraction]
    damping: tuple[Fraction, Fraction]
    area: tuple[Fraction, Fraction]

    def stress(self, slip: Fraction, growth: Fraction) -> tuple[Fraction, Fraction]:
        """Range of the effective normal stress that holds the fault at rest, for slips up to a given one."""
        kappas = [(k - growth) / n for k, n in product(self.stiffness, self.area)]
        return effective_stress(self.mu, self.normal_stress, slip, kappas)

    def of_slip(self, stress: tuple[Fraction, Fraction], growth: Fraction) -> tuple[Fraction, Fraction]:
        """Range of the acceleration per slip under such stresses."""
        falls = (self.mu["weakening"], -self.mu["strengthening"])
        low, high = hull(n * at * c for n in self.area for at in stress for c in falls)
        return low - self.stiffness[1] + growth, high - self.stiffness[0] + growth

    def of_rate(self, stress: tuple[Fraction, Fraction], growth: Fraction) -> tuple[Fraction, Fraction]:
        """Range of the deceleration per slip rate."""
        sheared = self.area[1] * max(abs(v) for v in stress) * self.mu["rate_slope"]
        return self.damping[0] - sheared - growth, self.damping[1] + sheared - growth


def read_rock(value: Any) -> Rock:
    """Read a fault."""
    parts = ("name", "density", "shear_modulus", "length", "damping", "normal_stress", "spreads", "friction")
    given = keys(value, "fault", *parts)
    name = given["name"]
    need(
        type(name) is str and FAULT.fullmatch(name) is not None,
        "fault.name must be at most 60 letters, digits, spaces and _ . -",
    )
    rho, modulus, size, eta, sigma = (number(given[k], f"fault.{k}") for k in parts[1:6])
    spread = numbers(given["spreads"], "spreads", "stiffness", "damping", "authority")
    mu = numbers(
        given["friction"], "friction", "static", "least", "largest", "weakening", "strengthening", "rate_slope"
    )
    need(min(rho, modulus, size, sigma, mu["least"]) > 0, "density, modulus, length, stress and friction must be > 0")
    need(min(eta, mu["weakening"], mu["strengthening"], mu["rate_slope"]) >= 0, "damping and slopes must be >= 0")
    need(all(0 <= v < 1 for v in spread.values()), "spreads must be in [0, 1)")
    need(mu["least"] <= mu["static"] <= mu["largest"], "static friction must lie between the bounds")
    stiffness, damping, area = (
        (value * (1 - spread[kind]), value * (1 + spread[kind]))
        for value, kind in (
            (modulus / (rho * size**2), "stiffness"),
            (eta / (rho * size**3), "damping"),
            (1 / (rho * size), "authority"),
        )
    )
    return Rock(name, sigma, mu, stiffness, damping, area)


def read_task(document: dict[str, Any]) -> Task:
    """Read fault, reference and disturbance, and derive."""
    rock = read_rock(document["fault"])
    shape, target, duration = read_reference(document["reference"])
    amplitude, change, grows = read_disturbance(document["disturbance"])
    stress, mu, area = rock.stress(target, grows["slip"]), rock.mu, rock.area
    s, w = rock.of_slip(stress, grows["slip"]), rock.of_rate(stress, grows["rate"])
    b, sigma = mu["least"] * area[0], rock.normal_stress
    first = max(abs(v) for v in on_unit_interval(slope(shape))) * target / duration
    second = max(abs(v) for v in on_unit_interval(slope(slope(shape)))) * target / duration**2
    bent = slope(slope(shape))
    third = max(abs(v) for v in on_unit_interval(slope(bent))) * target / duration**3
    return Task(
        name=rock.name,
        b=b,
        s=s,
        w=w,
        beta=(Fraction(1), mu["largest"] * area[1] / b),
        normal_stress=sigma,
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
