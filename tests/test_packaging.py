"""One version wherever it is told, and a lock that holds all that the package needs."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_version_is_the_same_wherever_it_is_told():
    told = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    sections = re.findall(r"^## \[(\d[^\]]*)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert told == [PROJECT["version"]] == sections[:1]
    assert len(sections) == len(set(sections)) >= 2


def test_every_version_of_the_changelog_has_its_date_and_the_newest_is_that_of_the_citation():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    dates = re.findall(r"^## \[\d[^\]]*\] - (\d{4}-\d\d-\d\d)$", text, re.MULTILINE)
    assert f"date-released: {dates[0]}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert dates == sorted(dates, reverse=True)


def test_the_lock_pins_all_that_the_package_needs_and_names_no_place():
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[a-z0-9-]+==[\w.]+", pin) for pin in pins)
    locked = dict(pin.split("==") for pin in pins)
    assert list(locked) == sorted(locked)
    assert len(locked) == len(pins)
    for wanted in map(Requirement, PROJECT["dependencies"]):
        assert wanted.specifier.contains(locked[canonicalize_name(wanted.name)])


def test_every_library_that_is_needed_is_imported():
    source = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "quakedesign").rglob("*.py"))
    modules = {"python-flint": "flint", "docstring-parser": "docstring_parser"}
    files = {"h5netcdf", "h5py"}  # by xarray, to which NetCDF's engine is named
    for wanted in {Requirement(line).name for line in PROJECT["dependencies"]} - files:
        assert re.search(rf"^\s*(from|import) {modules.get(wanted, wanted)}\b", source, re.MULTILINE), wanted


def test_the_extras_that_the_documentation_installs_have_what_its_commands_need():
    extras = PROJECT["optional-dependencies"]
    pages = [path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]]
    assert {name for text in pages for name in re.findall(r"'\.\[(\w+)\]'", text)} <= set(extras)
    assert any("jupyter lab notebooks" in text for text in pages)
    assert {"jupyterlab", "nbconvert"} <= {Requirement(line).name for line in extras["notebook"]}
