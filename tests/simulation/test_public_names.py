"""The room offers its public values by name and loads no numerical library before one is needed."""

import subprocess
import sys

import pytest

import quakedesign.loop
import quakedesign.simulation as room
from quakedesign.loop import Scheme, schemes, simulation_scheme, stages
from quakedesign.loop.actuators.base import Stage


def test_every_stage_of_an_actuator_has_its_name_in_the_room():
    named = (getattr(quakedesign.loop, name) for name in quakedesign.loop.__all__)
    offered = {item for item in named if isinstance(item, type) and issubclass(item, Stage)}
    assert offered == set(stages().values())


@pytest.mark.parametrize("name", sorted(schemes()))
def test_every_scheme_is_made_by_name(name):
    assert isinstance(simulation_scheme(name), Scheme)


def test_the_names_are_all_there_and_sorted():
    assert room.__all__ == sorted(room.__all__, key=lambda name: (name.islower(), name))
    assert all(hasattr(room, name) for name in room.__all__)


def test_the_import_loads_no_library_but_numpy():
    heavy = "scipy casadi matplotlib pandas xarray control dask".split()
    code = f"import sys, quakedesign.simulation; print(*[name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
