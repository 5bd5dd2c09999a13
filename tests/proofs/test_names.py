"""A name stands in quotation marks, holds no claim of its own, and no statement depends on it: in both checkers."""

import importlib.util
import json
import sys
from pathlib import Path

import pytest

from quakedesign.checking import check_files
from quakedesign.errors import ParameterError
from quakedesign.fault.model import require_name

FILES = Path(__file__).parents[2] / "proofs" / "certificates"
KINDS = ("guarantee_no-clock_lab-fault.json", "sliding_crustal-patch.json")
spec = importlib.util.spec_from_file_location("check_names", FILES.parent / "check.py")
check = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = check
spec.loader.exec_module(check)
CLAIM = "real-fault. The slip rate never exceeds 1 nm per s"
NAMES = [CLAIM, "a", "x" * 60, "T_1 b-2.c"]
BAD = [
    "",
    "x" * 61,
    "a\nb",
    "a: proved",
    'a" (proved',
    "a'b",
    "a+b",
    "-a",
    " a",
    "a,b",
    "a\x1b[2J",
    "a\u202eb",
    "a/b",
    "<b>",
]


@pytest.fixture(scope="module", params=[KINDS[0], pytest.param(KINDS[1], marks=pytest.mark.slow)])
def document(request):
    return json.loads((FILES / request.param).read_text(encoding="utf-8"))


def named(document, name):
    return document | {"fault": document["fault"] | {"name": name}}


def both(document, path):
    """Verdict and statement of the package, and of the checker of the standard library."""
    path.write_text(json.dumps(document), encoding="utf-8")
    verdict, lines = check_files([path])[str(path)]
    try:
        own = check.check(path.read_text(encoding="utf-8"))
    except check.Refused as error:
        return (verdict, lines), ("invalid", [str(error)])
    return (verdict, lines), (own.verdict, list(own.statement))


def test_no_statement_depends_on_a_name(document, tmp_path):
    plain = both(document, tmp_path / "c.json")
    for name in NAMES[:1]:
        for (verdict, lines), (_, before) in zip(both(named(document, name), tmp_path / "c.json"), plain, strict=True):
            assert verdict == "proved"
            assert lines[0].startswith(f'fault "{name}"')
            old = document["fault"]["name"]
            assert [line.replace(f'"{name}"', f'"{old}"') for line in lines] == before


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_name_is_refused(document, name, tmp_path):
    for verdict, _ in both(named(document, name), tmp_path / "c.json"):
        assert verdict.startswith("invalid")
    with pytest.raises(ParameterError, match="name must be a string of at most 60 letters"):
        require_name(name)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_one_is_taken_for_faults_too(name):
    assert require_name(name) is None


def test_a_file_is_about_a_fault_by_its_data_whatever_their_names(tmp_path):
    document = json.loads((FILES / KINDS[0]).read_text(encoding="utf-8"))
    path = tmp_path / "c.json"
    path.write_text(json.dumps(named(document, "another")), encoding="utf-8")
    verdict, lines = check_files([path], "lab-fault")[str(path)]
    assert verdict == "proved"
    assert lines[-1].startswith('the data are those of "lab-fault"')
