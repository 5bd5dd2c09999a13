"""Interconnections by name against python-control's, and jumps against equations that are evaluated in turn."""

from fractions import Fraction as F
from random import Random

import control
import numpy as np
import pytest

from quakedesign.loop.signals import Interconnection


def rational(random):
    return F(random.randint(-30, 30), random.randint(1, 9))


@pytest.mark.parametrize("seed", range(5))
def test_the_flow_and_the_outputs_are_those_of_python_control(seed):
    """A plant of two states, a law of one, and a lag: u = c·z + d·e1, v' = (u − v)/τ."""
    random = Random(seed)
    s, w, b, f, g, c, d, tau = (rational(random) or F(1) for _ in range(8))
    system = Interconnection(
        ("e1", "e2", "z", "v"), {"u": {"z": c, "e1": d}, "y": {"e1": F(2), "push": b}, "push": {"v": F(1)}}
    )
    flow = system.flow(
        {
            "e1": {"e2": F(1)},
            "e2": {"e1": s, "e2": w, "push": b},
            "z": {"z": f, "e1": g},
            "v": {"u": 1 / tau, "v": -1 / tau},
        }
    )
    blocks = [
        control.ss(
            [[0, 1], [s, w]], [[0], [b]], [[1, 0], [2, 0]], [[0], [b]], inputs="v", outputs=["e1", "y"], name="plant"
        ),
        control.ss([[f]], [[g]], [[c]], [[d]], inputs="e1", outputs="u", name="law"),
        control.ss([[-1 / tau]], [[1 / tau]], [[1]], [[0]], inputs="u", outputs="v", name="lag"),
    ]
    theirs = control.interconnect(blocks, inputs=[], outputs=["y", "u"])
    assert np.allclose(np.array(flow, float), theirs.A, rtol=1e-12)
    assert np.allclose(np.array([system.row({"y": F(1)}), system.row({"u": F(1)})], float), theirs.C, rtol=1e-12)


def test_a_jump_with_inputs_is_what_its_equations_give():
    random = Random(1)
    shares = [rational(random) for _ in range(6)]
    signals = {"seen": {"x": F(1), "noise": F(1)}, "made": {"seen": shares[0], "z": shares[1], "push": shares[5]}}
    system = Interconnection(("x", "z", "kept"), signals)
    updates = {"z": {"made": shares[2], "seen": shares[3]}, "x": {"z": shares[4]}}
    jump, entry, other = system.jump(updates), system.entry(updates, "noise"), system.entry(updates, "push")
    for _ in range(4):
        x, z, kept, noise, push = (rational(random) for _ in range(5))
        seen = x + noise
        made = shares[0] * seen + shares[1] * z + shares[5] * push
        after = [shares[4] * z, shares[2] * made + shares[3] * seen, kept]
        found = [sum((a * v for a, v in zip(row, (x, z, kept), strict=True)), F(0)) for row in jump]
        assert [v + noise * a + push * b for v, a, b in zip(found, entry, other, strict=True)] == after
