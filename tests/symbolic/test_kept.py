"""What is kept of derivations is what they derive."""

import json

import pytest
import sympy as sp

from quakedesign.symbolic import plant
from quakedesign.symbolic import plant as kept
from quakedesign.symbolic import rate_and_state_plant as state_plant


@pytest.mark.slow
def test_every_entry_is_derived_again():
    assert kept.derived_again() == kept.FILE.read_text(encoding="utf-8")


def test_what_is_read_is_what_was_derived():
    texts = json.loads(kept.FILE.read_text(encoding="utf-8"))
    derived = plant.shifted_acceleration.__wrapped__.__wrapped__()
    assert kept._read(texts["plant.shifted_acceleration"]) == derived
    assert derived.has(plant.disturbance(plant.x1, plant.x2, plant.t))
    names = ("theta",)
    assert kept._read(texts["rate_and_state_plant.jacobian theta"]) == state_plant.jacobian.__wrapped__.__wrapped__(
        names
    )


def test_what_is_not_kept_is_derived():
    found = state_plant.jacobian(("psi",))
    assert found.shape == (3, 3)
    assert sp.Symbol(r"\mu_{psi}", real=True) in found.free_symbols
