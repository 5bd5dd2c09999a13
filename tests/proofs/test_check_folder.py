"""The standalone checker as a folder: what runs is the source that stands beside it, and only what a file needs."""

import importlib.util
import json
import os
import py_compile
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

PROOFS = Path(__file__).parents[2] / "proofs"


def module(name, path):
    specification = importlib.util.spec_from_file_location(name, path)
    found = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(found)
    return found


LOOPS = module("loops_in_a_folder", Path(__file__).with_name("test_check.py"))
POLYNOMIALS = module("polynomials_in_a_folder", Path(__file__).with_name("test_check_polynomials.py"))
ATTRACTIONS = module("attractions_in_a_folder", Path(__file__).with_name("test_check_attraction.py"))
NAMES = tuple(LOOPS.checker.IMPORTS)
LOOP = {"exact_numbers", "loop", "cells"}
FORGED = 'raise SystemExit("another module")\n'


def guarantee():
    return {"format": 1, "kind": "guarantee"}


KINDS = {
    "proof": (LOOPS.relay, LOOP | {"squares", "stability"}),
    "refutation": (LOOPS.sliding_rest, LOOP | {"equilibrium"}),
    "sos": (POLYNOMIALS.quadratic, {"exact_numbers", "squares", "polynomials"}),
    "negative": (POLYNOMIALS.POINTS[0], {"exact_numbers", "squares", "polynomials"}),
    "not-sos": (POLYNOMIALS.FUNCTIONALS[0], {"exact_numbers", "squares", "polynomials", "functionals"}),
    "guarantee": (guarantee, {"exact_numbers", *(name for name in NAMES if name.startswith("guarantee"))}),
    "attraction": (ATTRACTIONS.cubic, {"exact_numbers", "squares", "polynomials", "attraction"}),
}


@pytest.fixture
def folder(tmp_path):
    """A copy of what the checker consists of."""
    (tmp_path / "copy").mkdir()
    for name in ("check", *NAMES):
        shutil.copy(PROOFS / f"{name}.py", tmp_path / "copy")
    return tmp_path / "copy"


def written(folder, *kinds):
    paths = [folder / f"{kind}.json" for kind in kinds]
    for path, kind in zip(paths, kinds, strict=True):
        path.write_text(json.dumps(KINDS[kind][0]()), encoding="utf-8")
    return [path.name for path in paths]


def run(checker, *arguments, options=(), cwd, **environment):
    command = [sys.executable, *options, "-W", "error", str(checker), *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, timeout=60, check=False)


@pytest.mark.parametrize("options", [(), ("-P",), ("-I",)])
def test_modules_of_the_working_directory_are_not_taken(folder, tmp_path, options):
    """Nor those on Python's path; and no file is written."""
    planted = tmp_path / "planted"
    planted.mkdir()
    for name in NAMES:
        (planted / f"{name}.py").write_text(FORGED)
    before = sorted(folder.rglob("*"))
    files = written(planted, *KINDS)
    result = run(folder / "check.py", *files, options=options, cwd=planted, PYTHONPATH=str(planted))
    verdicts = [line.split(": ")[1] for line in result.stdout.splitlines() if line[0] != " "]
    assert verdicts == ["proved", "refuted", "proved", "refuted", "refuted", "invalid", "proved"]
    assert (result.stderr, result.returncode) == ("", 1)
    assert sorted(folder.rglob("*")) == before


def test_compiled_files_beside_the_source_are_not_taken(folder, tmp_path):
    """Such as Python would believe unread: those that say that they need not be compared with a source."""
    (tmp_path / "forged.py").write_text(FORGED)
    for name in NAMES:
        cached = importlib.util.cache_from_source(str(folder / f"{name}.py"))
        py_compile.compile(
            str(tmp_path / "forged.py"), cached, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
        )
    result = run(folder / "check.py", *written(folder, "proof", "sos"), cwd=folder)
    assert (result.stderr, result.returncode) == ("", 0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_file_needs_the_kernel_and_its_own_modules(kind, folder):
    make, needed = KINDS[kind]
    for name in NAMES:
        if name not in needed:
            (folder / f"{name}.py").unlink()
    assert run(folder / "check.py", *written(folder, kind), cwd=folder).returncode in (0, 1)
    checker = module("one_kind", PROOFS / "check.py")
    try:
        checker.check(json.dumps(make()))
    except checker.Refused:
        assert kind == "guarantee"
    assert set(checker.LOADED) == needed


@pytest.mark.parametrize("missing", NAMES[:2])
def test_what_is_missing_is_named_in_one_line(folder, missing):
    (folder / f"{missing}.py").unlink()
    result = run(folder / "check.py", *written(folder, "sos"), cwd=folder)
    assert result.returncode == 2
    assert f"{missing}.py must stand beside check.py" in result.stderr
    assert (result.stdout, result.stderr.count("\n")) == ("", 1)


def test_the_format_says_what_an_auditor_reads():
    text = (PROOFS / "FORMAT.md").read_text(encoding="utf-8")
    lines = {name: (PROOFS / f"{name}.py").read_text(encoding="utf-8").count("\n") for name in ("check", *NAMES)}
    said = {("check",): re.search(r"`check.py` \((\d+) lines\)", text)[1]}
    said |= {("exact_numbers", "squares"): re.search(r"A kernel of (\d+) lines", text)[1]}
    rows = re.findall(r"^\| [^|]+ \| (`exact_numbers`[^|]*) \| (\d+) \|$", text, flags=re.MULTILINE)
    said |= {tuple(re.findall(r"`(\w+)`", names)): number for names, number in rows}
    assert {frozenset(names) for names in list(said)[2:]} == {frozenset(needed) for _, needed in KINDS.values()}
    for names, number in said.items():
        assert sum(lines[name] for name in names) == pytest.approx(int(number), rel=0.1), names


def test_a_link_to_the_checker_finds_its_folder(folder, tmp_path):
    (tmp_path / "link.py").symlink_to(folder / "check.py")
    assert run(tmp_path / "link.py", *written(tmp_path, "proof"), cwd=tmp_path).returncode == 0


def test_modules_of_the_same_names_in_this_process_are_left_alone(monkeypatch):
    own, checker = ModuleType("loop"), LOOPS.checker
    monkeypatch.setitem(sys.modules, "loop", own)
    monkeypatch.setattr(checker, "LOADED", {})
    stability, loop = checker.beside("stability"), checker.beside("loop")
    assert stability.describe(loop.read_loop(LOOPS.relay()))[-1] == "dx/dt = -2*sign(x)"
    assert stability.read_loop is loop.read_loop
    assert stability.need is loop.need is checker.beside("exact_numbers").need
    assert sys.modules["loop"] is own
    assert not {"exact_numbers", "cells", "stability"} & sys.modules.keys()


def test_every_file_has_all_steps(monkeypatch):
    """A file that is refused for its steps leaves the next one as many as any other."""
    checker, numbers, text = LOOPS.checker, LOOPS.exact_numbers, json.dumps(LOOPS.relay())
    checker.check(text)
    needed = numbers.MAX_STEPS - numbers.budget.left
    monkeypatch.setattr(numbers, "MAX_STEPS", needed)
    assert [checker.check(text).verdict for _ in range(2)] == ["proved"] * 2
    with pytest.raises(checker.Refused, match="fewer steps"):
        checker.check(json.dumps(LOOPS.oscillator_on_cells()))
    assert checker.check(text).verdict == "proved"
    monkeypatch.setattr(numbers, "MAX_STEPS", needed - 1)
    with pytest.raises(checker.Refused, match="fewer steps"):
        checker.check(text)


def test_who_stops_reading_is_told_nothing_more(folder):
    """As with `| head -1`: the pipe is closed before anything is written."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, str(folder / "check.py"), *written(folder, "sos")]
    with open(writing, "wb") as pipe:
        found = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, cwd=folder, timeout=60, check=False)
    assert (found.returncode, found.stderr) == (1, b"")
