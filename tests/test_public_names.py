"""What README, documentation and notebooks import is public, and nothing else is shown."""

import ast
import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest

import quakedesign as qd

ROOT = Path(__file__).parent.parent
CERTIFICATES = ROOT / "proofs" / "certificates"
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
    assert dir(qd) == sorted([*qd.__all__, "__version__"])
    assert all(hasattr(qd, name) for name in dir(qd))


REPRESENTED = {
    "Fault": lambda: qd.load_fault("real-fault"),
    "Model": lambda: qd.derive(qd.load_fault("lab-fault")),
    "Controller": lambda: qd.published("lab-fault")["cta"],
    "LoopSetup": lambda: qd.LoopSetup(delay="1 ms", slip_noise="1 um", measured="slip"),
    "Trajectory": lambda: qd.simulate(qd.load_fault("lab-fault"), qd.published("lab-fault")["elqr"], duration=0.1),
    "Certificate": lambda: qd.load_certificate(CERTIFICATES / "cta_7_5_2.3_1.1.json"),
    "Design": lambda: qd.assess(qd.load_fault("lab-fault"), qd.published("lab-fault")["elqr"]),
    "TrackingProof": lambda: qd.load_guarantee(CERTIFICATES / "guarantee_real-fault.json"),
}


@pytest.mark.parametrize("name", REPRESENTED)
def test_the_repr_of_a_public_value_fits_ten_lines_of_a_terminal(name):
    value = REPRESENTED[name]()
    assert sum(-(-max(len(line), 1) // 120) for line in repr(value).splitlines()) <= 10
