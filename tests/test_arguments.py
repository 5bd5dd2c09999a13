"""Every public name says what it wants: what it is called with is of the type of its annotation."""

import dataclasses
import importlib
import pickle
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from fractions import Fraction
from inspect import isclass, isfunction
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.arguments import check_arguments, matches
from quakedesign.certificates import Verdict
from quakedesign.controllers import Law
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.errors import ParameterError, QuakedesignError
from quakedesign.fault import Disturbance, Reference, UncertaintyBox
from quakedesign.loop import summed_integrals

LAB = qd.load_fault("lab-fault")


def rooms():
    """Packages with public names, but for the command line."""
    found = [qd.__name__, *(i.name for i in pkgutil.walk_packages(qd.__path__, "quakedesign.") if i.ispkg)]
    modules = [importlib.import_module(name) for name in found if not name.startswith("quakedesign.cli")]
    return [module for module in modules if hasattr(module, "__all__") and hasattr(module, "check_arguments")]


PUBLIC = {
    f"{room.__name__}.{name}": getattr(room, name)
    for room in rooms()
    for name in room.__all__
    if isfunction(getattr(room, name)) or isclass(getattr(room, name))
}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_function_and_class_checks_its_arguments(name):
    value = PUBLIC[name]
    if isfunction(value):
        assert hasattr(value, "checks_arguments")
        assert pickle.loads(pickle.dumps(value)) is value
    elif dataclasses.is_dataclass(value) and "__init__" in vars(value) and not issubclass(value, Enum):
        assert hasattr(value.__init__, "checks_arguments")


WRONG = {
    "a name of a law": (
        lambda: qd.simulate(LAB, "cta"),
        "controller of simulate .* Received 'cta'. Take that of design",
    ),
    "a name of a fault": (lambda: qd.simulate("lab-fault"), "fault of simulate must be a Fault.*load_fault"),
    "a text as density": (lambda: dataclasses.replace(LAB, density="2600 kg/m^3"), "density of Fault must be a number"),
    "a float in a box": (lambda: UncertaintyBox(name="x", stiffness=0.2), "stiffness .* Fraction.* Received 0.2"),
    "a logical number": (lambda: Disturbance(constant=True), "constant of Disturbance must be a number"),
    "no text": (lambda: qd.load_fault(None), "source of load_fault must be a text or a Path"),
    "missing": (lambda: Reference(target_slip=1.0), "Reference cannot be called like this: missing .*operation_time"),
    "unknown": (lambda: qd.derive(LAB, colour=1), "derive cannot be called like this: .*colour"),
    "too few gains": (lambda: summed_integrals((), Fraction(1)), "gains of summed_integrals must be four"),
    "not to be called": (lambda: qd.simulate(LAB, progress=3), "progress of simulate must be a Callable or None"),
}


@pytest.mark.parametrize(("call", "said"), WRONG.values(), ids=WRONG)
def test_what_is_wrong_is_said_by_name(call, said):
    with pytest.raises(ParameterError, match=said) as raised:
        call()
    assert len(str(raised.value)) < 600


def test_a_path_that_no_system_has_is_refused():
    for call in (qd.load_fault, qd.load_certificate):
        with pytest.raises(QuakedesignError):
            call(Path("\0"))


FITS = [
    (1, float),
    (np.float32(1), float),
    (Fraction(1, 2), float),
    (np.int64(1), int),
    (sp.Rational(1, 2), Fraction),
    (1, sp.Expr),
    (np.bool_(1), bool),
    (None, str | None),
    ([1, 2], tuple[int, int]),
    (np.arange(3.0), Sequence[float]),
    ({"a": 1}, Mapping[str, float]),
    (ExtendedLQR, type[Law]),
    (print, Callable[[str], None]),
    ((), tuple[int, ...]),
]
DIFFERS = [
    (10**400, float),
    ("1", float),
    (True, float),
    (True, int),
    (1j, float),
    (0.5, Fraction),
    (1.0, int),
    (1, bool),
    (1, str | None),
    ([1, 2, 3], tuple[int, int]),
    (["a"], Sequence[float]),
    ("ab", Sequence[str]),
    ({1: 1}, Mapping[str, float]),
    ({"a": "b"}, Mapping[str, float]),
    (int, type[Law]),
    (3, Callable[[str], None]),
    ("proved", Verdict),
]


@pytest.mark.parametrize(("value", "hint"), FITS)
def test_what_fits(value, hint):
    assert matches(value, hint)


@pytest.mark.parametrize(("value", "hint"), DIFFERS)
def test_what_differs(value, hint):
    assert not matches(value, hint)


def test_checking_twice_is_checking_once():
    before = qd.simulate
    check_arguments("quakedesign.simulation")
    assert importlib.import_module("quakedesign.simulation").simulate is before
