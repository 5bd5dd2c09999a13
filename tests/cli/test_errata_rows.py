"""How a row of the errata is printed."""

import pytest

from quakedesign.cli.fault_commands import _row_lines


@pytest.mark.parametrize(("holds", "said"), [(True, "correction confirmed"), (False, "CORRECTION NOT CONFIRMED")])
def test_a_row_says_whether_its_correction_holds(holds, said):
    row = {"row": 7, "holds": holds, "kind": "sign", "evidence": "by SymPy", "printed": "a - b", "correct": "a + b"}
    assert _row_lines(row) == [f"7. {said} (sign): by SymPy", "    printed: a - b", "    correct: a + b"]
