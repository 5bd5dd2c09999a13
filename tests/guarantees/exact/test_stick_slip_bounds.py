"""Bounds of linear functions on a polytope of the stick–slip set, against linear programming and in closed form."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from flint import arb, fmpq
from scipy.optimize import linprog

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees import load_guarantee
from quakedesign.guarantees.exact import stick_slip_set as module
from quakedesign.guarantees.exact.stick_slip_set import COMBINATIONS, SLICES, StickSlipClaims, Verifier, gap

SIZES = (F(2), F(3), F(5))  # of e1, y and d
FACETS = [((F(1, 2), F(0), F(0)), F(1)), ((F(0), F(1, 3), F(0)), F(1)), ((F(0), F(0), F(1, 5)), F(1)),
          ((F(-1, 2), F(0), F(0)), F(1)), ((F(0), F(0), F(-1, 5)), F(1)),
          ((F(1, 3), F(1, 4), F(1, 6)), F(1))]  # fmt: skip
UP, DOWN = (F(1), F(0), F(0)), (F(-1), F(0), F(0))
THRESHOLD, SLOPE, SLIP = F(3, 4), F(1, 7), F(1, 2)  # of e1; δ ≤ y/7; size of δ
ENDS = [[(UP, F(0))], [(DOWN, F(0)), (UP, THRESHOLD)], [(DOWN, -THRESHOLD)]]


def constraints(place):
    flat = [*FACETS, ((F(0), F(-1), F(0)), F(0)), *ENDS[place if place < SLICES else COMBINATIONS[place - SLICES][0]]]
    if place < SLICES:
        return flat
    tall = [((*row, F(0)), end) for row, end in flat]
    return [*tall, ((F(0), F(0), F(0), F(-1)), F(0)), ((F(0), -SLOPE, F(0), F(1)), F(0))]


PLACES = range(SLICES + len(COMBINATIONS))


def verifier(place, bases=None):
    rows = constraints(place)
    size = len(rows[0][0])
    given = list(combinations(range(len(rows)), size)) if bases is None else bases
    return Verifier(rows, given, (*SIZES, SLIP)[:size], place=place, facets=len(FACETS))


def exact(values):
    return np.array([[fmpq(v.numerator, v.denominator) for v in row] for row in values], dtype=object)


def fraction(value):
    return F(int(value.p), int(value.q))


@pytest.mark.parametrize("place", PLACES)
def test_bounds_are_those_of_linear_programming(place):
    rows = constraints(place)
    random, size = np.random.default_rng(place), len(rows[0][0])
    factors = [[F(int(v), 16) for v in random.integers(-40, 40, size)] for _ in range(20)]
    constants = np.array([fmpq(i, 3) for i in range(20)], dtype=object)
    found = verifier(place).largest(exact(factors), constants)
    A, b = (np.array([list(map(float, row)) for row, _ in rows]), np.array([float(end) for _, end in rows]))
    for i, (c, bound) in enumerate(zip(factors, found, strict=True)):
        best = -linprog(-np.array(c, dtype=float), A_ub=A, b_ub=b, bounds=(None, None)).fun + i / 3
        assert best - 1e-9 <= float(fraction(bound)) <= best + 1e-6


def by_signs(place, left, off=(F(0),) * 4):
    """Σ of max(c, 0) times the size: e1 has the sign of its slice, y and δ are not negative, d has any sign."""
    sign = -1 if (place if place < SLICES else COMBINATIONS[place - SLICES][0]) == 0 else 1
    signed = [sign * left[0], left[1], abs(left[2]), *left[3:]]
    return sum((max(v + o, F(0)) * s for v, o, s in zip(signed, off, (*SIZES, SLIP), strict=False)), F(0))


def first_vertex(place):
    """The basis of one vertex: the first end of the slice, y = 0, the facet −d, and δ = 0."""
    count = len(constraints(place))
    return [(7, 6, 4) if place < SLICES else (7, 6, 4, count - 2)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("radius", [F(0), F(1, 1 << 10)])
def test_with_multipliers_of_zero_a_bound_is_that_of_the_signs(place, radius):
    """At the one vertex that is named, all multipliers of this function are negative, and are set to 0."""
    size = 3 if place < SLICES else 4
    slice_number = place if place < SLICES else COMBINATIONS[place - SLICES][0]
    factors = [F(-1 if slice_number == 0 else 1), F(2), F(3), F(4)][:size]
    balls = np.array([[arb(str(v)) if not radius else arb(float(v), float(radius)) for v in factors]], dtype=object)
    constants = np.array([arb(7, float(radius))], dtype=object)
    found = fraction(verifier(place, first_vertex(place)).largest(balls, constants)[0])
    above = found - (by_signs(place, factors, (radius,) * 4) + 7 + radius)
    assert 0 <= above <= F(1, 10**6) * radius  # radii of balls are rounded up


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("way", [1, -1])
def test_a_function_near_a_facet_is_bounded_by_its_difference(place, way):
    """1 + (c − n)·z, with δ ≤ y/7, and e1 at most the end of its slice where that is positive."""
    size = 3 if place < SLICES else 4
    slice_number = place if place < SLICES else COMBINATIONS[place - SLICES][0]
    which, change = np.array([5, 1]), [way * v for v in (F(1, 90), F(1, 80), F(-1, 70), F(1, 60))]
    rows = [constraints(place)[i][0] for i in which]
    factors = [[a + b for a, b in zip(row, change, strict=False)] for row in rows]
    thirds = np.array([fmpq(1, 3)] * 2, dtype=object)
    found = verifier(place, first_vertex(place)).largest(exact(factors), thirds, which)
    for facet, c, bound in zip(which, factors, found, strict=True):
        left = list(change[:size])
        if size == 4:
            left[1], left[3] = left[1] + max(left[3], F(0)) * SLOPE, F(0)
        same = F(1)
        if slice_number == 1:
            same, left[0] = same + max(left[0], F(0)) * THRESHOLD, min(left[0], F(0))
        same += by_signs(place, left) + F(1, 3)
        alone = verifier(place, first_vertex(place)).largest(exact([c]), thirds[:1])[0]
        assert fraction(bound) == min(same, fraction(alone))
        assert facet != 5 or same < fraction(alone)


@pytest.mark.parametrize(
    ("bases", "reason"),
    [
        ([(0, 6, 8)], "must name constraints by their numbers, from 0 to 7"),
        ([(7, 6, 4), (0, 6, 8)], "must name constraints by their numbers, from 0 to 7"),
        ([(0, 3, 6)], "must have independent constraints"),
        ([(0, 6, 4)], "must give a vertex of it"),  # e1 = 2, outside the slice e1 <= 0
    ],
)
def test_bases_that_give_no_vertex_are_rejected(bases, reason):
    with pytest.raises(ParameterError, match=reason):
        verifier(0, bases)


def test_one_basis_that_gives_a_vertex_suffices():
    assert len(verifier(0, [(0, 3, 6), (0, 6, 4), (7, 6, 4)]).bases) == 1
    assert len(verifier(0, [(7, 6, 4)]).bases) == 1


# ----------------------------------------------------------------------
# Integrals, gaps and claims in closed form.


def test_weights_are_the_integrals_of_hat_functions_and_powers():
    """∫hat_i(t)·t^j dt over [0, NODES], each hat 1 at its node and 0 at the neighbours."""
    integral = lambda low, high, j: F(high ** (j + 1) - low ** (j + 1), j + 1)  # noqa: E731
    weights = module._weights()
    assert [len(line) for line in weights] == [module.NODES + 1] * 4
    for j, line in enumerate(weights):
        for i, found in enumerate(line):
            rising = integral(i - 1, i, j + 1) - (i - 1) * integral(i - 1, i, j) if i else F(0)
            falling = (i + 1) * integral(i, i + 1, j) - integral(i, i + 1, j + 1) if i < module.NODES else F(0)
            assert found == rising + falling
        assert sum(line) == F(module.NODES ** (j + 1), j + 1)


def test_the_gap_of_a_chord_of_one_over_beta_is_attained_at_its_middle():
    """The chord of 1/β over [β0, β1] minus 1/β is at most (β1 − β0)²/(4β0²β1), and nearly that for a narrow range."""
    low, high = F(3), F(31, 10)
    differences = [
        (1 / low + (beta - low) * (1 / high - 1 / low) / (high - low)) - 1 / beta
        for beta in (low + (high - low) * i / 100 for i in range(101))
    ]
    assert max(differences) <= gap((low, high)) <= max(differences) * F(104, 100)
    assert gap((low, low)) == 0
    assert gap((F(2), F(5))) == F(9, 4 * 4 * 5)


CLAIMS = StickSlipClaims(
    slip_behind=UpperBound(2), slip_ahead=UpperBound(3), peak_slip_rate=UpperBound(5), least_pressure=LowerBound(-7),
    largest_pressure=UpperBound(11),
)  # fmt: skip


def test_claims_hold_if_every_bound_is_within_them():
    assert CLAIMS.slip_error == replace(CLAIMS, slip_behind=UpperBound(3), slip_ahead=UpperBound(2)).slip_error == 3
    assert CLAIMS.follow(CLAIMS)
    for name in ("slip_behind", "slip_ahead", "peak_slip_rate", "largest_pressure"):
        assert not CLAIMS.follow(replace(CLAIMS, **{name: UpperBound(getattr(CLAIMS, name) + F(1, 10**9))}))
        assert CLAIMS.follow(replace(CLAIMS, **{name: UpperBound(getattr(CLAIMS, name) - F(1, 10**9))}))
    assert not CLAIMS.follow(replace(CLAIMS, least_pressure=LowerBound(F(-8))))


# ----------------------------------------------------------------------
# The set and the loop.

STORED = load_guarantee(Path(__file__).parents[3] / "proofs" / "certificates" / "stick_slip_real-fault.json")


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("change", ["sign", "axis", "zero", "second"])
def test_the_first_five_facets_bound_e1_y_and_d(place, change):
    """Along +e1, +y, +d, −e1 and −d, in this order, each alone."""
    found, axis = STORED.invariant_set, (0, 1, 2, 0, 2)[place]
    row = list(found.facets[place])
    value = row[axis]
    assert value * (1, 1, 1, -1, -1)[place] > 0
    other = (axis + 1) % 3
    row[axis] = {"sign": -value, "axis": F(0), "zero": F(0), "second": value}[change]
    row[other] = value if change in ("axis", "second") else F(0)
    facets = (*found.facets[:place], tuple(row), *found.facets[place + 1 :])
    with pytest.raises(ParameterError, match=r"begin with facets along \+e1, \+y, \+d, -e1 and -d alone"):
        replace(found, facets=facets)


def test_the_errors_of_an_implicit_step_count_noise_and_the_rate_of_the_reference():
    """|e1 + n| ≤ |e1| + N, and |y − r′| ≤ max(y, max r′), as both rates are not negative."""
    fastest = STORED.task.reference_rates[0]
    noisy = replace(STORED.sampled_loop, slip_noise=STORED.sampled_loop.law.rest_slip / 3)
    assert noisy.errors(STORED.task, F(5), 2 * fastest) == (5 + noisy.slip_noise, 2 * fastest)
    assert noisy.errors(STORED.task, F(5), fastest / 2) == (5 + noisy.slip_noise, fastest)
