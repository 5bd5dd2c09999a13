"""Duals: exact proofs that no Lyapunov function of a family exists."""

from dataclasses import replace

import numpy as np
import pytest

from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.synthesis.decision import closed_loop
from quakedesign.synthesis.dual import dual

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
