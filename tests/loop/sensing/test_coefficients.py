"""The published table against the recursive form it comes from, and against the paper's differentiator."""

import pytest

from quakedesign.loop.sensing.differentiator import LONGEST, TABLES

RECURSIVE = (1.1, 1.5, 2, 3, 5, 7, 10, 12, 14, 17, 20, 26, 32)  # Levant and Livne 2020


def test_there_is_one_row_for_every_order():
    assert [len(row) for row in TABLES] == list(range(1, LONGEST + 2))


@pytest.mark.parametrize("order", range(LONGEST + 1))
def test_every_row_follows_from_the_recursive_form(order):
    found = [float(RECURSIVE[order])]
    for j in range(order - 1, -1, -1):
        found.insert(0, RECURSIVE[j] * found[0] ** (j / (j + 1)))
    assert TABLES[order] == pytest.approx(found, rel=1.2e-3)  # printed to three or more digits


def test_the_fifth_row_is_that_of_the_paper():
    assert TABLES[4] == (1.1, 4.57, 9.3, 10.03, 5.0)
