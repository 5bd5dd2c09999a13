"""The search proposes; what it returns is checked exactly, and impossible things are not found."""

from fractions import Fraction as F

import pytest

from quakedesign.sos import proves
from quakedesign.sos.solve.cone import Cone
from quakedesign.sos.solve.rounding import find_witness
from quakedesign.sos.solve.search import Family, GramSearch, largest_multiple, propose

UNIT = (F(1), F(1), F(1))


def am_gm(constant: F) -> dict:
    """a³ + b³ + c³ − constant·abc, non-negative on the orthant if and only if constant ≤ 3."""
    return {(3, 0, 0): F(1), (0, 3, 0): F(1), (0, 0, 3): F(1), (1, 1, 1): -constant}


def test_blocks_of_a_quartic_form_in_three_variables_are_those_of_methods():
    # METHODS.md: blocks 6 + 3 + 3 + 3
    assert sorted(len(basis) for _, basis in Cone(3, 4, True).blocks) == [3, 3, 3, 6]


def test_every_gram_entry_feeds_exactly_one_monomial():
    cone = Cone(3, 5, True)
    entries = [entry for places in cone.positions.values() for entry in places]
    assert len(entries) == len(set(entries)) == sum(len(b) * (len(b) + 1) // 2 for _, b in cone.blocks)


@pytest.mark.parametrize("constant", [F(0), F(2), F(299, 100)])
def test_below_the_exact_threshold_a_witness_is_found(constant):
    search = GramSearch(Cone(3, 3, True))
    witness = find_witness(am_gm(constant), search, UNIT)
    assert witness is not None
    assert proves(am_gm(constant), witness, orthant=True)


@pytest.mark.parametrize("constant", [F(3001, 1000), F(4)])
def test_above_the_threshold_none_is_found(constant):
    assert find_witness(am_gm(constant), GramSearch(Cone(3, 3, True)), UNIT) is None


def test_a_badly_scaled_form_is_proved_through_its_scale():
    scale = (F(1), F(1024), F(1, 256))
    form = {e: c / (scale[1] ** e[1] * scale[2] ** e[2]) for e, c in am_gm(F(2)).items()}
    witness = find_witness(form, GramSearch(Cone(3, 3, True)), scale)
    assert witness is not None
    assert proves(form, witness, orthant=True)


def test_the_largest_multiple_of_abc_below_the_cubes_is_three():
    # AM-GM: a³ + b³ + c³ ≥ 3abc with equality at a = b = c
    cubes = am_gm(F(0))
    assert largest_multiple(Cone(3, 3, True), [cubes], {(1, 1, 1): F(1)}) == pytest.approx(3, abs=1e-4)


def test_a_family_without_any_positive_member_has_no_proposal():
    # a·(−x²−y²) + b·(x²−y²): every combination is negative or indefinite somewhere, unless a < 0
    cone = Cone(2, 2, False)
    indefinite = {(2, 0): F(1), (0, 2): F(-1)}
    assert propose([Family(cone, [indefinite])], 1) is None


def test_a_proposal_maximises_the_margin():
    # a·(x² + y²), |a| ≤ 1: the margin is 1
    proposal = propose([Family(Cone(2, 2, False), [{(2, 0): F(1), (0, 2): F(1)}])], 1)
    assert proposal is not None
    assert proposal.margin == pytest.approx(1, abs=1e-6)
