"""Limits of what a file about a guarantee may hold: the same numbers in both checkers, and those of FORMAT.md."""

from pathlib import Path

import pytest
from standalone_guarantee import CHECK

from quakedesign.guarantees.exact import (
    file_entries,
    invariant_set,
    norms,
    plant_loop,
    plant_proof,
    sliding_blocks,
    sliding_small_gain,
    small_gain,
    stick_slip_set,
)
from quakedesign.plant import fault_plant, plant_values

FORMAT = (Path(__file__).parents[2] / "proofs" / "FORMAT.md").read_text()
BOTH = {
    "states of a loop": (file_entries.MOST_STATES, ("loop", "MAX_STATES")),
    "facets of an invariant set": (invariant_set.MOST_FACETS, ("invariant_set", "MAX_FACETS")),
    "entries of a facet": (invariant_set.MOST_SIZE, ("invariant_set", "MAX_ENTRIES")),
    "bases of an invariant set": (invariant_set.MOST_BASES, ("invariant_set", "MAX_BASES")),
    "pieces of an interval": (invariant_set.MOST_PIECES, ("invariant_set", "MAX_PIECES")),
    "numbers of a facet": (invariant_set.LARGEST, ("invariant_set", "TOO_LARGE")),
    "pieces of the shortest interval": (invariant_set.SOONEST, ("invariant_set", "SOONEST")),
    "doublings": (norms.MOST_DOUBLINGS, ("impulse_sums", "DOUBLINGS")),
    "products of periods, twice": (2 * norms._MOST_SUMS, ("impulse_sums", "MAX_SUMS")),
    "periods of a delay": (plant_loop.MOST_PERIODS, ("plant", "MOST_PERIODS")),
    "states of a loop of a plant": (plant_loop.MOST_LOOP_STATES, ("plant", "MOST_LOOP")),
    "work for a plant": (plant_loop._MOST_WORK, ("plant", "MOST_WORK")),
    "periods that may be followed": (plant_loop._BEYOND, ("plant", "BEYOND")),
    "pieces of a flow": (plant_proof.MOST_PIECES, ("plant", "MOST_PIECES")),
    "states of a law of a plant": (plant_proof._MOST_LAW_STATES, ("plant", "MOST_LAW")),
    "rows of a plant": (plant_values.MOST, ("plant", "MOST")),
    "parts of a slow input gain": (small_gain.MOST_PARTS, ("bounds", "MAX_PARTS")),
    "1/e from above": (small_gain._ONE_OVER_E, ("bounds", "ONE_OVER_E")),
    "logarithm of a rate": (sliding_small_gain._LARGEST, ("slow_sliding", "MAX_LOGARITHM")),
    "share that is left of a step": (sliding_small_gain._FADED, ("slow_sliding", "FADED")),
    "facets of a polytope": (stick_slip_set.MOST_FACETS, ("stick_slip", "MAX_FACETS")),
    "bases of a polytope": (stick_slip_set.MOST_BASES, ("stick_slip", "MAX_BASES")),
    "pieces of a period": (stick_slip_set.NODES, ("stick_slip", "PIECES")),
    "bounds of a slip until a stop": (stick_slip_set.LINES, ("stick_slip", "LINES")),
    "parts of a range of intervals": (stick_slip_set.PIECES, ("stick_slip", "PARTS")),
    "halvings of the range of a reference": (fault_plant._HALVINGS, ("task", "HALVINGS")),
}
WRITTEN = (
    ("At most 400 facets and 40 000 bases", stick_slip_set.MOST_FACETS, 400),
    ("At most 400 facets and 40 000 bases", stick_slip_set.MOST_BASES, 40_000),
    ("its chords over 16 pieces", stick_slip_set.NODES, 16),
    ("i = 0 … 5, θ0", stick_slip_set.LINES, 5),
    ("the five h = T + i·Δ", stick_slip_set.PIECES, 5 - 1),
    ("four equal pieces of [0, `step`]", invariant_set.SOONEST, 4),
    ("1 to 32 equal pieces", invariant_set.MOST_PIECES, 32),
    ("1 to 16 parts, 400 facets of at most 6 entries", small_gain.MOST_PARTS, 16),
    ("1 to 16 parts, 400 facets of at most 6 entries", invariant_set.MOST_FACETS, 400),
    ("400 facets of at most 6 entries with at most 20 digits each", invariant_set.MOST_SIZE, 6),
    ("400 facets of at most 6 entries with at most 20 digits each", invariant_set.LARGEST, 10**20),
    ("32 pieces and 4000 bases of a reach", invariant_set.MOST_BASES, 4000),
    ("At most 40 states, controls, measurements, disturbances, loads, sectors and outputs", plant_values.MOST, 40),
    ("48 states of the law, 96 of the loop", plant_proof._MOST_LAW_STATES, 48),
    ("48 states of the law, 96 of the loop", plant_loop.MOST_LOOP_STATES, 96),
    ("1 to 64 `pieces`, a delay of at most 8 steps", plant_proof.MOST_PIECES, 64),
    ("1 to 64 `pieces`, a delay of at most 8 steps", plant_loop.MOST_PERIODS, 8),
    ("At most 64 cells", CHECK.beside("guarantee.slow_sliding").MAX_CELLS, 64),
    ("K = 2^J are summed, J ≤ 12", norms.MOST_DOUBLINGS, 12),
    ("Bernstein coefficients on 2⁷ parts", fault_plant._HALVINGS, 7),
)


@pytest.mark.parametrize("what", BOTH)
def test_both_checkers_have_the_same_limit(what):
    ours, (module, name) = BOTH[what]
    assert ours == getattr(CHECK.beside(f"guarantee.{module}"), name)


@pytest.mark.parametrize(("words", "number", "written"), WRITTEN)
def test_the_format_states_it(words, number, written):
    assert words in FORMAT
    assert number == written


def test_blocks_in_slow_sliding_have_the_same_largest_logarithm_as_one():
    assert sliding_blocks._LARGEST == sliding_small_gain._LARGEST
    assert 3 * sliding_blocks.MOST_SLIDING <= plant_values.MOST
