"""The exact kernel: known identities pass, anything changed does not."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.sos import Block, Witness, proves
from quakedesign.sos.exact.definiteness import full_matrix, positive_definite

ONE = {(0, 0): F(1)}


def quadratic_witness() -> tuple[dict, Witness]:
    # 2x² + 2xy + 3y² = bᵀ[[2, 1], [1, 3]]b with b = (x, y)
    block = Block(times=(0, 0), basis=((1, 0), (0, 1)), gram=(F(2), F(1), F(3)))
    return {(2, 0): F(2), (1, 1): F(2), (0, 2): F(3)}, Witness(multiplier=ONE, blocks=(block,))


def test_a_positive_quadratic_is_proved_by_its_own_matrix():
    polynomial, witness = quadratic_witness()
    assert proves(polynomial, witness, orthant=False)


def test_a_monomial_multiplier_counts_only_on_the_orthant():
    block = Block(times=(1, 0), basis=((1, 0),), gram=(F(1),))
    witness = Witness(multiplier=ONE, blocks=(block,))
    assert proves({(3, 0): F(1)}, witness, orthant=True)
    assert not proves({(3, 0): F(1)}, witness, orthant=False)


def test_the_am_gm_inequality_is_proved_on_the_orthant():
    # a³ + b³ + c³ − 3abc = ½(a + b + c)((a−b)² + (b−c)² + (c−a)²), made strict by + ε(a³ + b³ + c³)
    epsilon = F(1, 10)
    p = {(3, 0, 0): 1 + epsilon, (0, 3, 0): 1 + epsilon, (0, 0, 3): 1 + epsilon, (1, 1, 1): F(-3)}
    half = F(1, 2)
    spread = (2 * half, -half, -half, 2 * half, -half, 2 * half)
    blocks = []
    for i in range(3):
        times = tuple(int(j == i) for j in range(3))
        gram = list(spread)
        gram[[0, 3, 5][i]] += epsilon
        blocks.append(Block(times=times, basis=((1, 0, 0), (0, 1, 0), (0, 0, 1)), gram=tuple(gram)))
    witness = Witness(multiplier={(0, 0, 0): F(1)}, blocks=tuple(blocks))
    assert not positive_definite(full_matrix(spread, 3))
    assert proves(p, witness, orthant=True)


@pytest.mark.parametrize("where", range(3))
@pytest.mark.parametrize("change", [F(1, 10**30), F(-1, 7)])
def test_any_changed_gram_entry_loses_the_proof(where, change):
    polynomial, witness = quadratic_witness()
    gram = list(witness.blocks[0].gram)
    gram[where] += change
    changed = replace(witness, blocks=(replace(witness.blocks[0], gram=tuple(gram)),))
    assert not proves(polynomial, changed, orthant=False)


def test_the_witness_of_another_polynomial_is_refused():
    polynomial, witness = quadratic_witness()
    assert not proves(polynomial | {(2, 0): F(3)}, witness, orthant=False)


def test_an_indefinite_matrix_with_the_right_identity_is_refused():
    # x² − y² is not non-negative although the identity holds
    block = Block(times=(0, 0), basis=((1, 0), (0, 1)), gram=(F(1), F(0), F(-1)))
    assert not proves({(2, 0): F(1), (0, 2): F(-1)}, Witness(multiplier=ONE, blocks=(block,)), orthant=False)


def test_a_repeated_basis_monomial_is_refused():
    block = Block(times=(0, 0), basis=((1, 0), (1, 0)), gram=(F(1), F(0), F(1)))
    assert not proves({(2, 0): F(2)}, Witness(multiplier=ONE, blocks=(block,)), orthant=False)


def test_a_negative_multiplier_is_refused():
    block = Block(times=(0, 0), basis=((1, 0),), gram=(F(1),))
    assert not proves({(2, 0): F(-1)}, Witness(multiplier={(0, 0): F(-1)}, blocks=(block,)), orthant=True)


def test_the_zero_polynomial_needs_no_squares():
    assert proves({}, Witness(multiplier=ONE), orthant=True)
    assert not proves({(1, 0): F(1)}, Witness(multiplier=ONE), orthant=True)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.integers(-6, 6), min_size=6, max_size=6), st.integers(1, 9))
def test_definiteness_agrees_with_sylvester_by_hand(entries, denominator):
    a, b, c, d, e, f = (F(v, denominator) for v in entries)
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    expected = a > 0 and a * d - b * b > 0 and determinant > 0
    assert positive_definite(full_matrix((a, b, c, d, e, f), 3)) == expected


def test_a_triangle_of_the_wrong_length_is_an_error():
    with pytest.raises(ValueError, match="upper triangle of size 2 has 3 entries"):
        full_matrix((F(1),), 2)
