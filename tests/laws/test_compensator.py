"""LQG compensator against its recursion in exact arithmetic, and in the loop of its own model."""

from fractions import Fraction as F
from random import Random

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import compensator


def some(random, *size):
    """Random fractions, in rows of rows."""
    return tuple(some(random, *size[1:]) for _ in range(size[0])) if size else F(random.randint(1, 40), 9) - 2


def dot(row, column):
    return sum((a * b for a, b in zip(row, column, strict=True)), F(0))


def model_of(n, seed=0):
    """Random A, B, C, L and K."""
    random = Random(seed)
    shapes = {"update": (n, n), "command": (n,), "measured": (2, n), "estimator": (n, 2), "feedback": (n,)}
    return {"states": tuple(f"x{i}" for i in range(n))} | {name: some(random, *size) for name, size in shapes.items()}


def recursion(model, readings, excess=F(0)):
    """Commands and predictions of x̂ = π + L(y − Cπ), p = −Kx̂, π⁺ = Ax̂ + B(p + excess), from π = 0."""
    predicted = [F(0)] * len(model["states"])
    for y in readings:
        innovation = [v - dot(row, predicted) for v, row in zip(y, model["measured"], strict=True)]
        x = [v + dot(row, innovation) for v, row in zip(predicted, model["estimator"], strict=True)]
        p = -dot(model["feedback"], x)
        moved = zip(model["update"], model["command"], strict=True)
        predicted = [dot(row, x) + b * (p + excess) for row, b in moved]
        yield p, predicted


def sampled(law, readings, excess=F(0)):
    """Commands and states of a law."""
    z = [F(0)] * len(law.states)
    for y in readings:
        p = dot(law.output, z) + dot(law.feedback, y)
        z = [dot(f, z) + dot(g, y) for f, g in zip(law.update, law.measured, strict=True)]
        z = [v + excess * a for v, a in zip(z, law.applied, strict=True)]
        yield p, z


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("excess", [F(0), F(7, 3)])
def test_a_law_is_the_recursion_of_filter_and_feedback(n, excess):
    model, readings = model_of(n, seed=n), some(Random(9), 5, 2)
    law = compensator(**model)
    assert law.states == model["states"]
    assert list(sampled(law, readings, excess)) == list(recursion(model, readings, excess))


def test_a_prediction_that_the_measurement_replaces_is_no_state():
    """y1 = x1 and x̂1 = y1, and the innovation of y1 corrects no other state."""
    model = model_of(4)
    model["measured"] = (F(0), F(1), F(0), F(0)), (F(2), F(0), F(-1), F(3))
    model["estimator"] = tuple((F(i == 1), of_second) for i, (_, of_second) in enumerate(model["estimator"]))
    law, readings = compensator(**model), some(Random(2), 5, 2)
    assert law.states == ("x0", "x2", "x3")
    for (p, z), (same, predicted) in zip(sampled(law, readings, F(1)), recursion(model, readings, F(1)), strict=True):
        assert (p, z) == (same, [predicted[0], *predicted[2:]])


def test_on_its_own_model_the_poles_are_those_of_feedback_and_of_filter():
    """Separation principle: the poles of A − BK and of A − ALC."""
    model = model_of(3, seed=4)
    law = compensator(**model)
    a, b, c, l, k = (
        np.array(model[name], float) for name in ("update", "command", "measured", "estimator", "feedback")
    )
    f, g, output, d = (np.array(part, float) for part in (law.update, law.measured, law.output, law.feedback))
    loop = np.block([[a + np.outer(b, d @ c), np.outer(b, output)], [g @ c, f]])
    poles = [*np.linalg.eigvals(a - np.outer(b, k)), *np.linalg.eigvals(a - a @ l @ c)]
    assert np.allclose(np.sort_complex(np.linalg.eigvals(loop)), np.sort_complex(np.array(poles)), rtol=1e-8)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("update", "matrix A of a compensator with 3 states must be 3 × 3"),
        ("command", "matrix B of a compensator with 3 states must be 1 × 3"),
        ("measured", "matrix C of a compensator with 3 states must be 2 × 3"),
        ("estimator", "matrix L of a compensator with 3 states must be 3 × 2"),
        ("feedback", "matrix K of a compensator with 3 states must be 1 × 3"),
    ],
)
def test_matrices_of_other_sizes_are_rejected(name, said):
    model = model_of(3)
    with pytest.raises(ParameterError, match=said):
        compensator(**model | {name: model[name][1:]})
