"""A guarantee is about a task where that asks for no more: constants the same, all ranges within."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.fault import load_fault
from quakedesign.plant import uncertain_plant

TASK = uncertain_plant(load_fault("real-fault", box="ten-percent"), rate_limited=True)
FRICTION = TASK.friction


def asked(**changes):
    return replace(TASK, **changes)


def rubbed(**changes):
    return replace(TASK, friction=replace(FRICTION, **changes))


@pytest.mark.parametrize(
    "task",
    [
        TASK,
        asked(name="another name"),
        asked(spreads=(F(0), F(1, 20), F(1, 10))),
        asked(amplitude=TASK.amplitude / 2),
        asked(change=TASK.change / 2),
        rubbed(least=FRICTION.static),
        rubbed(largest=FRICTION.static),
        rubbed(weakening=FRICTION.weakening / 2),
    ],
)
def test_what_asks_for_no_more_is_covered(task):
    assert TASK.differences(task) == []
    assert replace(TASK, change=None).differences(task) == []


@pytest.mark.parametrize(
    ("task", "said"),
    [
        *((asked(**{name: 2 * getattr(TASK, name)}), f"{name} [") for name in ("density", "shear_modulus", "length")),
        *((asked(**{name: 2 * getattr(TASK, name)}), f"{name} [") for name in ("damping", "normal_stress")),
        *((asked(**{name: getattr(TASK, name) / 2}), f"{name} [") for name in ("target_slip", "operation_time")),
        (asked(shape=(F(0), F(0), F(3), F(-2))), "the shape of the reference"),
        (asked(growths=(F(0), F(0))), "disturbance per slip [1/s^2] 0.0000032 in the certificate, 0 in the fault"),
        (asked(growths=(TASK.growths[0], F(-1))), "disturbance per rate [1/s] 0 in the certificate, -1"),
        (asked(spreads=(F(1, 5), F(0), F(0))), "spread of stiffness [-] up to 0.1"),
        (asked(spreads=(F(0), F(1, 5), F(0))), "spread of damping"),
        (asked(spreads=(F(0), F(0), F(1, 5))), "spread of authority"),
        (asked(amplitude=2 * TASK.amplitude), "disturbance [m/s^2] up to 0.00032"),
        (asked(change=2 * TASK.change), "change of the disturbance"),
        (asked(change=None), "class of the disturbance: rate in the certificate"),
        (rubbed(static=FRICTION.least), "static friction [-] 0.3353"),
        (rubbed(least=FRICTION.least / 2), "friction: least"),
        (rubbed(largest=2 * FRICTION.largest), "friction: largest"),
        (rubbed(weakening=2 * FRICTION.weakening), "friction: weakening"),
        (rubbed(strengthening=F(1)), "friction: strengthening"),
        (rubbed(rate_slope=F(1)), "friction: rate_slope"),
    ],
)
def test_what_asks_for_more_is_named_alone(task, said):
    (found,) = TASK.differences(task)
    assert found.startswith(said)
