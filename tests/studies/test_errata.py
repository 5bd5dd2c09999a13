"""What the command shows of the errata: rows by number, JSON, and an installed package without a checkout."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.studies import errata
from quakedesign.studies.errata import ErrataRow, Finding, find_rows, run_rows

ROOT = Path(__file__).parent.parent.parent


def test_results_have_the_promised_keys_and_go_into_json():
    (found,) = run_rows([4])
    assert list(found) == ["row", "printed", "correct", "kind", "holds", "evidence", "seconds"]
    assert json.loads(json.dumps(found, allow_nan=False))["row"] == 4


def test_rows_come_in_the_order_asked_for_and_once():
    assert [row.number for row in find_rows(["9", 3, " 9 "])] == [9, 3]
    assert len(find_rows([])) == len(find_rows()) == 29


@pytest.mark.parametrize("wrong", [0, 30, "x", "", "1.5", -1, "01"])
def test_an_unknown_row_is_refused_before_anything_runs(wrong, monkeypatch):
    monkeypatch.setattr(errata, "_run", lambda row: pytest.fail("a check ran"))
    with pytest.raises(UnknownNameError, match=r"whole number from 1 to 29\. Received") as caught:
        run_rows([3, wrong])
    assert "\n" not in str(caught.value)


def test_an_unknown_kind_is_refused():
    with pytest.raises(ParameterError, match="kind of an erratum must be one of symbolic identity"):
        ErrataRow(number=1, printed="p", correct="c", kind="opinion", check=lambda: Finding(True, ""))


MODULE = """
from quakedesign.studies.errata import ErrataRow, Finding
ROWS = (ErrataRow(number=5, printed="p", correct="c", kind="counterexample", check=lambda: Finding(True, "1")),)
"""


def test_two_rows_with_one_number_are_refused(tmp_path, monkeypatch):
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.setattr(errata, "errata_folder", lambda: tmp_path)
    with pytest.raises(ParameterError, match=r"one row. Received \[5\] twice"):
        errata.errata_rows.__wrapped__()


def installed(site):
    """Copy of the package as the wheel lays it out."""
    shutil.copytree(ROOT / "quakedesign", site / "quakedesign")
    shutil.copytree(ROOT / "proofs", site / "quakedesign" / "proofs")


def ask(site, code):
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=site,
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )


@pytest.mark.slow
def test_an_installed_package_finds_its_own_checks(tmp_path):
    installed(tmp_path)
    code = "from quakedesign.studies.errata import errata_folder as f, run_rows as r; print(f(), r([4])[0]['holds'])"
    done = ask(tmp_path, code)
    assert done.stdout.split() == [str(tmp_path / "quakedesign" / "proofs" / "errata"), "True"], done.stderr


def test_a_package_without_its_checks_says_so(tmp_path):
    installed(tmp_path)
    shutil.rmtree(tmp_path / "quakedesign" / "proofs")
    done = ask(tmp_path, "from quakedesign.studies.errata import run_rows; run_rows()")
    assert "UnknownNameError: the checks of the errata must be in" in done.stderr


def test_the_wheel_is_told_to_carry_the_proofs():
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    assert build["targets"]["wheel"]["force-include"] == {"proofs": "quakedesign/proofs"}


def test_the_finder_itself_needs_the_standard_library_only():
    lines = (ROOT / "quakedesign" / "studies" / "errata.py").read_text(encoding="utf-8").splitlines()
    roots = {line.split()[1].split(".")[0] for line in lines if line.startswith(("import ", "from "))}
    assert roots - {"quakedesign"} <= sys.stdlib_module_names
