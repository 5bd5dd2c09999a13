"""Every public name says what it wants: what it is called with is of the type of its annotation."""

import dataclasses
import importlib
import inspect
import pickle
import pkgutil
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from fractions import Fraction
from inspect import isclass, isfunction, signature
from pathlib import Path
from types import SimpleNamespace
from typing import TypedDict, Unpack

import casadi as ca
import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign import arguments
from quakedesign.arguments import checked, matches
from quakedesign.errors import ParameterError, QuakedesignError
from quakedesign.fault import Disturbance, Reference, UncertaintyBox
from quakedesign.guarantees import Claims, guarantee
from quakedesign.laws import Law, summed_integrals
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.loop import Diffusion
from quakedesign.loop.loop_setup import LoopSetup  # reads its quantities itself
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.lyapunov import Verdict
from quakedesign.report import headline
from quakedesign.simulation.campaign import run_campaign

LAB = qd.load_fault("lab-fault")
CERTIFICATE = qd.load_certificate(Path(__file__).parents[1] / "proofs" / "certificates" / "super-twisting_1.5_1.1.json")
DESIGN = qd.Design(
    fault=LAB, name="cta", verdict=Verdict.UNDECIDED, controller=None, certificate=None, premises=(), details={}
)


def rooms():
    """Packages with public names, but for the command line."""
    found = [qd.__name__, *(i.name for i in pkgutil.walk_packages(qd.__path__, "quakedesign.") if i.ispkg)]
    modules = [importlib.import_module(name) for name in found if not name.startswith("quakedesign.cli")]
    return [module for module in modules if hasattr(module, "__all__")]


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
    elif dataclasses.is_dataclass(value) and "__init__" in vars(value) and not issubclass(value, Enum | LoopSetup):
        assert hasattr(value.__init__, "checks_arguments")
    if (
        isclass(value)
        and not issubclass(value, Enum | BaseException | sp.Basic | LoopSetup)
        and "quakedesign" in value.__module__
    ):
        assert all(hasattr(method, "checks_arguments") for method in methods(value))


def methods(kind):
    """Public methods of a class that take arguments and are not for others to write; those of its bases too."""
    for name in (name for name in dir(kind) if not name.startswith("_")):
        member = inspect.getattr_static(kind, name)
        function = getattr(member, "__func__", member)
        if isfunction(function) and "quakedesign" in function.__module__:
            given = len(signature(getattr(kind, name)).parameters) - isfunction(member)
            if given > 0 and not getattr(function, "__isabstractmethod__", False):
                yield function


WRONG = {
    "a name of a law": (
        lambda: qd.simulate(LAB, "cta"),
        "controller of simulate .* Received 'cta'. Give for example design",
    ),
    "a name of a fault": (lambda: qd.simulate("lab-fault"), "fault of simulate must be a Fault.*load_fault"),
    "a text as density": (lambda: dataclasses.replace(LAB, density="2600 kg/m^3"), "density of Fault must be a number"),
    "a float in a box": (lambda: UncertaintyBox(name="x", stiffness=0.2), "stiffness .* Fraction.* Received 0.2"),
    "a logical number": (lambda: Disturbance(constant=True), "constant of Disturbance must be a number"),
    "no text": (lambda: qd.load_fault(None), "source of load_fault must be a string or a Path"),
    "missing": (lambda: Reference(target_slip=1.0), "Reference cannot be called like this: missing .*operation_time"),
    "unknown": (lambda: qd.derive(LAB, colour=1), "derive cannot be called like this: .*colour"),
    "too few gains": (lambda: summed_integrals((), Fraction(1)), "gains of summed_integrals must be four"),
    "no path": (lambda: qd.load_certificate(3), "path of load_certificate must be a string or a Path. Received 3"),
    "no entry": (lambda: headline(None), "entry of headline must be an Entry. Received None"),
    "no task": (lambda: guarantee(3, 3), "task of guarantee must be a FaultPlant. Received 3"),
    "no campaign": (lambda: run_campaign(None, 3, "x"), "must be a CampaignProblem. Received None"),
    "no such quantity": (lambda: qd.guarantee(LAB, wind=Fraction(1)), "quantity of the loop setup must be .*'wind'"),
    "no law to guarantee": (
        lambda: qd.guarantee(LAB, controller=3),
        "a class derived from a Controller or a Controller. Received 3",
    ),
    "a number as a box": (lambda: LAB.with_box(3), "name of Fault.with_box must be a string. Received 3"),
    "a text as slip": (lambda: LAB.moment_of("x"), "slip of Fault.moment_of must be a number. Received 'x'"),
    "no premise": (lambda: DESIGN.with_premise(3), "premise of Design.with_premise must be a Premise. Received 3"),
    "no factors": (lambda: qd.Scales(factors=None), "factors of Scales must be .* Received None"),
    "no fault to scale": (lambda: qd.scaled_fault(3, None), "of scaled_fault must be .* Received 3"),
    "a number as a class": (
        lambda: DESIGN.certified_peaks(3),
        "disturbance_class of Design.certified_peaks must be a string. Received 3",
    ),
    "no law to check": (lambda: CERTIFICATE.check(3), "law of Certificate.check must be .* Received 3"),
    "nowhere to save": (lambda: CERTIFICATE.save(None), "path of Certificate.save must be a string or a Path"),
    "no values": (lambda: ExtendedLQR.from_values(3), "values of Law.from_values must be a tuple.* Received 3"),
    "no time": (lambda: Diffusion.of_time("1 s"), "time of Diffusion.of_time must be a number. Received '1 s'"),
    "a fraction as a claim": (
        lambda: Claims(**dict.fromkeys(Claims.__dataclass_fields__, Fraction(1))),
        "slip_error of Claims must be an UpperBound. Received Fraction",
    ),
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


def test_of_a_wrong_run_nothing_else_is_said(tmp_path):
    run = qd.simulate(LAB, qd.published("lab-fault")["elqr"], scheme="explicit", duration=0.01)
    with pytest.raises(ParameterError, match=r"path of Trajectory.save must be a string or a Path. Received 3"):
        run.save(3)


NUMBERS = [
    np.longdouble("0.001"),
    np.float32(0.001),
    np.float16(0.001),
    Fraction(1, 1000),
    sp.Rational(1, 1000),
    sp.Float(0.001),
]


@pytest.mark.parametrize("number", [*NUMBERS, np.int64(0), np.longdouble(0)], ids=lambda number: type(number).__name__)
def test_whatever_number_is_given_python_computes_with_its_float(number):
    """A long float of NumPy ended the process: where C computes, it is a float of Python before."""
    as_float = qd.to_statespace(LAB, float(number))
    assert np.array_equal(qd.to_statespace(LAB, number).A, as_float.A)
    loops = [qd.loop_transfer(LAB, qd.published("lab-fault")["elqr"], at=at) for at in (number, float(number))]
    assert np.array_equal(loops[0].A, loops[1].A)
    assert type(dataclasses.replace(LAB.reference, target_slip=number or 1.0).target_slip) is float


def test_numbers_in_collections_are_those_of_python():
    plain = ExtendedLQR.from_values((1.0, 2.0, 3.0, 4.0))
    long = [np.longdouble(i) for i in (1, 2, 3, 4)]
    for values in (long, tuple(long), np.array(long), np.array([1, 2, 3, 4]), np.arange(1, 5, dtype=np.float32)):
        assert ExtendedLQR.from_values(values) == plain


@pytest.mark.parametrize(
    "values",
    [
        np.array(0.5),
        np.ma.masked,
        np.ma.array([1.0, 2, 3, 4], mask=[0, 1, 0, 0]),
        np.ma.arange(2.0).sum(),
        np.float64(1),
    ],
    ids=["0-d", "masked", "partly masked", "sum", "number"],
)
def test_one_number_and_masked_ones_are_no_collection(values):
    with pytest.raises(ParameterError, match=r"values of Law\.from_values must be a tuple"):
        ExtendedLQR.from_values(values)


class Times(TypedDict, total=False):
    """Times of a loop [s]."""

    delay: Fraction
    lag: Fraction


def of_a_loop(**times: Unpack[Times]) -> None:
    """Take arguments by the names of a typed dictionary."""


def test_of_several_unknown_arguments_the_first_is_named():
    with pytest.raises(ParameterError, match="there is no argument 'colour'"):
        checked(of_a_loop)(lag=Fraction(1), colour=1, **{f"unknown{i}": i for i in range(20)})


@pytest.mark.parametrize("value", [ca.SX.sym("x"), ca.MX.sym("x"), ca.DM(2.0), 2.0, 3])
def test_an_expression_of_casadi_may_be_of_any_kind_or_a_number(value):
    assert Measurement().measure([], [], value)[0] is value


@pytest.mark.parametrize("value", ["x", None, True, np.ones(2)])
def test_what_is_no_expression_of_casadi_is_refused(value):
    with pytest.raises(ParameterError, match=r"x of Measurement\.measure must be a CasADi expression"):
        Measurement().measure([], [], value)


def test_threads_parse_one_after_the_other(monkeypatch):
    """CPython 3.11 counts the recursion of all threads together: two trees at once may raise SystemError."""
    now, most = [], []

    def parse(text, mode):
        now.append(text)
        time.sleep(0.01)
        most.append(len(now))
        now.remove(text)

    monkeypatch.setattr(arguments, "ast", SimpleNamespace(parse=parse))
    threads = [threading.Thread(target=arguments.parsed, args=(str(i),)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 4
