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
CHECKER = PROOFS / "checker"
NAMES = sorted(".".join(p.relative_to(CHECKER).with_suffix("").parts) for p in CHECKER.rglob("[!_]*.py"))
LOOP = {"numbers", "lyapunov.loop"}
SQUARES = {"numbers", "squares", "polynomials"}
FORGED = 'raise SystemExit("another module")\n'


OTHERS = {"guarantee.slow_sliding", "guarantee.stick_slip", "guarantee.polytope", "guarantee.plant"}


def test_the_finder_finds_the_modules_of_the_folder_alone():
    check = LOOPS.checker
    assert check.Finder().find_spec("json") is None
    for name in NAMES:
        found = check.Finder().find_spec(f"{check.PACKAGE}.{name}")
        assert Path(found.origin) == CHECKER.joinpath(*name.split(".")).with_suffix(".py")
    with pytest.raises(OSError, match=re.escape("absent.py must stand beside check.py")):
        check.Finder().find_spec(f"{check.PACKAGE}.absent")


def guarantee():
    return {"format": 1, "kind": "guarantee"}


def stick_slip():
    return {"format": 1, "kind": "stick_slip"}


def uncertain_plant():
    return {"format": 1, "kind": "uncertain_plant"}


KINDS = {
    "proof": (LOOPS.relay, LOOP | {"squares", "lyapunov.stability"}),
    "refutation": (LOOPS.sliding_rest, LOOP | {"lyapunov.equilibrium"}),
    "sos": (POLYNOMIALS.quadratic, SQUARES),
    "negative": (POLYNOMIALS.POINTS[0], SQUARES),
    "not-sos": (POLYNOMIALS.FUNCTIONALS[0], SQUARES | {"functionals"}),
    "guarantee": (
        guarantee,
        {"numbers", *(n for n in NAMES if n.startswith("guarantee"))} - OTHERS,
    ),
    "stick_slip": (
        stick_slip,
        {
            "numbers",
            *(f"guarantee.{name}" for name in ("reading", "task", "matrices", "root", "polytope", "stick_slip")),
        },
    ),
    "uncertain_plant": (
        uncertain_plant,
        {"numbers", *(f"guarantee.{name}" for name in ("reading", "matrices", "plant"))},
    ),
    "attraction": (ATTRACTIONS.cubic, SQUARES | {"attraction"}),
}


@pytest.fixture
def folder(tmp_path):
    """A copy of what the checker consists of."""
    shutil.copytree(CHECKER, tmp_path / "copy" / "checker", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(PROOFS / "check.py", tmp_path / "copy")
    return tmp_path / "copy"


def source(folder, name):
    """The file of a module of the package, or of a module beside it."""
    path = folder.joinpath("checker", *name.split(".")).with_suffix(".py")
    return path if path.is_file() else folder / f"{name}.py"


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
    (planted / "checker").mkdir()
    for name in ("__init__", "numbers", "squares"):
        (planted / "checker" / f"{name}.py").write_text(FORGED)
    (planted / "__main___checker.py").write_text(FORGED)
    before = sorted(folder.rglob("*"))
    files = written(planted, *KINDS)
    result = run(folder / "check.py", *files, options=options, cwd=planted, PYTHONPATH=str(planted))
    verdicts = [line.split(": ")[1] for line in result.stdout.splitlines() if line[0] != " "]
    assert verdicts == ["proved", "refuted", "proved", "refuted", "refuted", "invalid", "invalid", "invalid", "proved"]
    assert (result.stderr, result.returncode) == ("", 1)
    assert sorted(folder.rglob("*")) == before


def test_compiled_files_beside_the_source_are_not_taken(folder, tmp_path):
    """Such as Python would believe unread: those that say that they need not be compared with a source."""
    (tmp_path / "forged.py").write_text(FORGED)
    for name in NAMES:
        cached = importlib.util.cache_from_source(str(source(folder, name)))
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
            source(folder, name).unlink()
    assert run(folder / "check.py", *written(folder, kind), cwd=folder).returncode in (0, 1)
    checker = module(f"one_kind_{kind}", PROOFS / "check.py")
    try:
        checker.check(json.dumps(make()))
    except checker.Refused:
        assert kind in ("guarantee", "stick_slip", "uncertain_plant")
    loaded = {name.removeprefix(f"{checker.PACKAGE}.") for name in sys.modules if name.startswith(checker.PACKAGE)}
    assert loaded - {checker.PACKAGE, "lyapunov", "guarantee"} == needed


@pytest.mark.parametrize("missing", ["numbers", "squares"])
def test_what_is_missing_is_named_in_one_line(folder, missing):
    source(folder, missing).unlink()
    result = run(folder / "check.py", *written(folder, "sos"), cwd=folder)
    assert result.returncode == 2
    assert f"checker/{missing}.py must stand beside check.py" in result.stderr
    assert (result.stdout, result.stderr.count("\n")) == ("", 1)


def test_the_format_says_what_an_auditor_reads():
    text = (PROOFS / "FORMAT.md").read_text(encoding="utf-8")
    lines = {name: source(PROOFS, name).read_text(encoding="utf-8").count("\n") for name in ("check", *NAMES)}
    said = {("check",): re.search(r"`check.py` \((\d+) lines\)", text)[1]}
    said |= {("numbers", "squares"): re.search(r"A kernel of (\d+) lines", text)[1]}
    rows = re.findall(r"^\| [^|]+ \| (`numbers`[^|]*) \| (\d+) \|$", text, flags=re.MULTILINE)
    said |= {tuple(re.findall(r"`([\w.]+)`", names)): number for names, number in rows}
    assert {frozenset(names) for names in list(said)[2:]} == {frozenset(needed) for _, needed in KINDS.values()}
    for names, number in said.items():
        assert sum(lines[name] for name in names) == pytest.approx(int(number), rel=0.1), names


def test_a_link_to_the_checker_finds_its_folder(folder, tmp_path):
    (tmp_path / "link.py").symlink_to(folder / "check.py")
    assert run(tmp_path / "link.py", *written(tmp_path, "proof"), cwd=tmp_path).returncode == 0


def test_modules_of_the_same_names_in_this_process_are_left_alone(monkeypatch):
    own = ModuleType("checker")
    monkeypatch.setitem(sys.modules, "checker", own)
    checker = module("with_a.namesake", PROOFS / "check.py")
    stability, loop = checker.beside("lyapunov.stability"), checker.beside("lyapunov.loop")
    assert stability.describe(loop.read_loop(LOOPS.relay()))[-1] == "dx/dt = -2*sign(x)"
    assert stability.read_loop is loop.read_loop
    assert stability.need is loop.need is checker.beside("numbers").need
    assert sys.modules["checker"] is own
    assert not {"checker.numbers", "lyapunov.loop"} & sys.modules.keys()


def test_a_shipped_certificate_is_verified_from_any_folder(tmp_path):
    """Without Python's path, its environment and what is installed for the user."""
    shipped = PROOFS / "certificates" / "super-twisting_1.5_1.1.json"
    result = run(PROOFS / "check.py", str(shipped), options=("-I", "-S"), cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith(f"{shipped}: proved\n")


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
