"""Packages load their public names when they are asked for, and these check their arguments whoever has loaded them."""

import importlib
import subprocess
import sys

import pytest

import quakedesign

FRESH = """
import sys
import quakedesign.fault.model
import quakedesign.fault as room
print(*sorted(name for name in sys.modules if name.startswith("quakedesign.fault.")))
try:
    quakedesign.fault.model.Reference(target_slip="far", operation_time=1.0)
except quakedesign.errors.ParameterError as error:
    print(error)
room.load_fault("real-fault"), room.load_fault("lab-fault")
print(*sorted({"sympy", "pint", "numpy"} & set(sys.modules)))
"""


def test_a_fresh_package_loads_what_is_asked_for_and_nothing_else():
    said = subprocess.run([sys.executable, "-c", FRESH], capture_output=True, text=True, check=True)
    loaded, refused, heavy = said.stdout.split("\n")[:3]
    assert "quakedesign.fault.model" in loaded
    assert refused.startswith("target_slip of Reference must be a number. Received 'far'.")
    assert heavy == ""


@pytest.mark.parametrize("name", ["simulation.simulate", "synthesis.design", "synthesis.guarantee"])
def test_a_public_name_goes_before_the_module_of_the_same_name(name):
    importlib.import_module(f"quakedesign.{name}")
    room, public = name.split(".")
    assert callable(getattr(importlib.import_module(f"quakedesign.{room}"), public))


def test_what_a_package_does_not_have_is_an_error():
    with pytest.raises(AttributeError, match=r"No quakedesign.fault attribute nothing"):
        importlib.import_module("quakedesign.fault").nothing  # noqa: B018


def test_names_are_listed_before_they_are_loaded():
    assert set(quakedesign.fault.__all__) <= set(dir(quakedesign.fault))
