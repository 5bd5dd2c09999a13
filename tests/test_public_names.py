"""What README, documentation and notebooks import is public, and nothing else is shown."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import quakedesign as qd

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "notebooks").glob("*.py"))]


def imports(text):
    """Module and name of every import from the package, those in code blocks of a page included."""
    for found in re.finditer(r"^[ \t]*(from quakedesign[\w.]* import (?:\([^)]*\)|[^\n]*))", text, re.MULTILINE):
        (statement,) = ast.parse(found.group(1)).body
        yield from ((statement.module, alias.name) for alias in statement.names)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_a_page_imports_public_names_alone(page):
    for module, name in imports(page.read_text(encoding="utf-8")):
        place = importlib.import_module(module)
        if name not in getattr(place, "__all__", ()):
            assert isinstance(importlib.import_module(f"{module}.{name}"), ModuleType), f"{module}.{name}"


def test_the_package_shows_its_public_names_alone():
    assert dir(qd) == sorted(qd.__all__)
    assert all(hasattr(qd, name) for name in dir(qd))


@pytest.mark.parametrize(
    "value",
    [
        qd.load_fault("real-fault"),
        qd.derive(qd.load_fault("lab-fault")),
        qd.published("lab-fault")["cta"],
        qd.LoopSetup(delay="1 ms", slip_noise="1 um", measured="slip"),
        qd.simulate(qd.load_fault("lab-fault"), qd.published("lab-fault")["elqr"], duration=0.1),
        qd.certify("cta", gains=(7, 5, 2.3, 1.1), lipschitz=1),
        qd.assess(qd.load_fault("lab-fault"), qd.published("lab-fault")["cta"]),
        qd.load_guarantee(ROOT / "proofs" / "certificates" / "guarantee_real-fault.json"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_the_repr_of_a_public_value_fits_ten_lines_of_a_terminal(value):
    assert sum(-(-max(len(line), 1) // 120) for line in repr(value).splitlines()) <= 10


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
    assert set(qd.fault.__all__) <= set(dir(qd.fault))
