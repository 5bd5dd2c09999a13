"""Errors tell scripts their kind and the quantity."""

import pytest

import quakedesign as qd
from quakedesign import errors


def every(kind):
    """A class and all derived from it."""
    return [kind, *(one for below in kind.__subclasses__() for one in every(below))]


def test_every_kind_of_error_has_a_code_of_its_own():
    kinds = {kind for kind in every(errors.QuakedesignError) if kind.__module__ == "quakedesign.errors"}
    codes = [kind.code for kind in kinds]
    assert len(codes) == len(set(codes))
    assert (errors.ParameterError.code, errors.UnknownNameError.code) == ("parameter", "unknown-name")


@pytest.mark.parametrize(
    ("call", "code", "quantity"),
    [
        (lambda: qd.load_fault("real-fualt"), "unknown-name", "fault"),
        (lambda: qd.simulate(qd.load_fault("real-fault"), duration=-1.0), "parameter", "duration"),
        (lambda: qd.SampledLaw.from_pid(1, step="1 s", N=0), "parameter", "N of a PID"),
        (lambda: qd.simulate(qd.load_fault("crustal-patch"), step=1.0), "parameter", ""),
    ],
)
def test_an_error_names_its_quantity(call, code, quantity):
    with pytest.raises(errors.QuakedesignError) as caught:
        call()
    assert (caught.value.code, caught.value.quantity) == (code, quantity)


def test_a_message_without_a_condition_has_no_quantity():
    assert errors.OutputError("x cannot be written: no space. Choose another folder.").quantity == ""
