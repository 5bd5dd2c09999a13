"""Duals: exact proofs that no Lyapunov function of a family exists."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

from quakedesign.laws import LoopField
from quakedesign.lyapunov.search.certify import certify, closed_loop
from quakedesign.lyapunov.search.infeasibility import dual
from quakedesign.symbolic import SignedPower
from quakedesign.symbolic.term_expressions import signed_monomials

WEAK = ("super-twisting", ("0.4", "1.5"))  # not stable for L = 1 (Seeber and Horn, 2018)


@pytest.fixture(scope="module")
def weak():
    return closed_loop(*WEAK, lipschitz=1)


@pytest.mark.parametrize("degree", [3, 4, 6])
def test_an_unstable_loop_has_a_dual_in_every_degree(weak, degree):
    found = dual(weak, degree)
    assert found.holds
    assert len(found.atoms) <= len(signed_monomials(weak.states, degree, "cells")) + 1


def test_a_dual_contradicts_every_function_of_its_family(weak):
    # V and V' written out by hand for x' = −k1⌈x⌋^½ + y, y' = −k2⌈x⌋⁰ + d and V = a|x|^{3/2} + bxy + c|y|³
    found = dual(weak, 3)
    signs = {"+": 1.0, "-": -1.0}
    total = np.zeros(3)
    for atom in found.atoms:
        claim, cell, *vertex = atom.obligation.split()
        u, v = map(float, atom.point)
        s, t = (signs[c] for c in cell)
        x, y = s * u**2, t * v
        if claim == "positive":
            row = np.array([u**3, x * y, v**3])
        else:
            d = float(dict(part.split("=") for part in vertex)["d"])
            speed, pull = -0.4 * s * u + y, -1.5 * s + d
            row = -np.array([1.5 * u * s * speed, y * speed + x * pull, 3 * v * y * pull])
        total += float(atom.weight) * row
    sizes = sum(float(atom.weight) for atom in found.atoms)
    assert np.abs(total).max() < 1e-12 * sizes


def test_a_changed_dual_proves_nothing(weak):
    found = dual(weak, 4)
    first, *rest = found.atoms
    for changed in (
        replace(first, weight=first.weight * 2),
        replace(first, weight=-first.weight),
        replace(first, point=(first.point[0] + 1, *first.point[1:])),
        replace(first, point=(-first.point[0] - 1, *first.point[1:])),
        replace(first, point=first.point[:1]),
        replace(first, obligation="decrease"),
    ):
        assert not replace(found, atoms=(changed, *rest)).holds
    assert not replace(found, atoms=()).holds
    assert not replace(found, degree=3).holds
    assert not replace(found, loop=closed_loop(*WEAK, lipschitz="0.5")).holds


def test_none_where_there_is_a_proof_and_where_powers_are_nested():
    assert dual(closed_loop("super-twisting", ("1.5", "1.1"), lipschitz="0.5"), 3) is None
    assert dual(closed_loop("dia", ("1", "20", "1", "0"), lipschitz="0.3"), 5) is None


def test_a_degree_can_be_excluded_where_a_higher_one_proves():
    loop = closed_loop("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, 334))
    assert dual(loop, 5).holds


x, y, k, d, r = sp.symbols("x y k d r", real=True)


def loop_in(field, **more):
    states = dict.fromkeys(field, 1)
    return LoopField(
        states=states, field=field, gains=(k,), constants=(), domain="cells", **({"uncertain": (d,)} | more)
    )


@pytest.mark.parametrize("square", [x**2 * (x - y) ** 2, x**2 * (x**2 + y**2 - x * y)])
def test_a_cell_without_interior_excludes_nothing(square):
    # the sign of a square is one almost everywhere, so this is y' = −2⌈y⌋⁰ + d, which is stable
    sign = SignedPower(sp.expand(square), 0)
    model = loop_in({x: -k * SignedPower(x, 0), y: -2 * SignedPower(y, 0) * sign + d})
    assert [dual(closed_loop(model, (2,), lipschitz=1), degree) for degree in (2, 3, 4)] == [None] * 3
    plain = loop_in({x: -k * SignedPower(x, 0), y: -2 * SignedPower(y, 0) + d})
    assert str(certify(plain, (2,), lipschitz=1)[0]) == "proved"


def test_the_ends_of_an_irrational_root_exclude_nothing():
    # between the lower end of the root's enclosure and √2: x' = −(√2 − q)⌈x⌋⁰ is stable, but not at that end
    lower = closed_loop(loop_in({x: -r * SignedPower(x, 0)}, uncertain=(), roots={r: k}), (2,), lipschitz=0).roots["r"][
        1
    ][0]
    q = next(lower + F(1, 2**n) for n in range(20, 60) if (lower + F(1, 2**n)) ** 2 < 2)
    field = {x: -(r - sp.Rational(q.numerator, q.denominator)) * SignedPower(x, 0)}
    loop = closed_loop(loop_in(field, uncertain=(), roots={r: k}), (2,), lipschitz=0)
    assert lower < q
    assert dual(loop, 2) is None
