"""Perturbations written as text: parsed exactly, never executed."""

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.simulation import Load, perturbation, simulate

LAB = load_fault("lab-fault")
slip, rate, time = sp.symbols("slip slip_rate time", real=True)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("3.2e-4*sin(0.69*time)", sp.Rational(32, 10**5) * sp.sin(sp.Rational(69, 100) * time)),
        ("1/3 - 2*slip**2", sp.Rational(1, 3) - 2 * slip**2),
        ("-exp(-time/5) + tanh(slip_rate)", -sp.exp(-time / 5) + sp.tanh(rate)),
        (" Max(slip, 0) * sqrt(Abs(slip)) * pi ", sp.Max(slip, 0) * sp.sqrt(sp.Abs(slip)) * sp.pi),
        ("0", sp.Integer(0)),
    ],
)
def test_texts_are_read_exactly(text, meant):
    assert perturbation(text) == meant


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').getcwd()",
        "slip.real",
        "x1",
        "sin",
        "sin(1, 2)",
        "sin(x=1)",
        "slip if 1 else 2",
        "True",
        "nan",
        "1e400",
        "1/0",
        "1/(2 - 2)",
        "log(0)",
        "sqrt(-1)",
        "(-1)**(1/3)*slip",
        "slip**slip",
        "2**9999",
        "((2**64)**64)**64",
        "",
        "slip;1",
        "(" * 500,
        "+".join(["slip"] * 500),
    ],
)
def test_anything_else_is_refused(text):
    with pytest.raises(ParameterError, match="perturbation"):
        perturbation(text)


def test_the_text_of_the_disturbance_acts_as_the_disturbance():
    from quakedesign.fault import Disturbance

    quiet = LAB.with_disturbance(Disturbance())
    own, told = (
        simulate(fault, None, duration=0.05, load=load, compiled=False)
        for fault, load in (
            (LAB.with_disturbance(Disturbance(constant=0.01)), Load()),
            (quiet, Load(perturbation=perturbation("0.01"))),
        )
    )
    assert own.slip[-1] != 0
    assert (own.slip == told.slip).all()
