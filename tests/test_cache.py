"""What is kept on a disk: found by content, taken from nobody else, and never in the way."""

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import pytest

from quakedesign import cache
from quakedesign.cli.options import Output

WRITER = """
import sys
from quakedesign import cache
for number in range(100):
    for size in (10, 100_000):
        cache.store("run", bytes([size % 251]) * size, b"%d" % size)
        found = cache.load("run", b"%d" % size)
        assert found == bytes([size % 251]) * size, number
"""


@dataclass(frozen=True)
class Asked:
    side: int

    @cached_property
    def area(self):
        return self.side**2


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    return tmp_path / "kept"


def only(folder):
    (file,) = folder.iterdir()
    return file


def test_what_is_kept_is_found_again_and_is_private(folder):
    assert cache.load("run", b"how long?") is None
    cache.store("run", b"so long", b"how long?")
    assert cache.load("run", b"how long?") == b"so long"
    assert [cache.load("run", b"how", b" long?"), cache.load("code", b"how long?")] == [None, None]
    assert (folder.stat().st_mode & 0o777, only(folder).stat().st_mode & 0o777) == (0o700, 0o600)


@pytest.mark.parametrize("spoil", [lambda c: c[:-1] + b"!", lambda c: c[:-1], lambda c: b"", lambda c: b"!" + c[1:]])
def test_a_file_that_is_not_what_was_written_counts_as_none(folder, spoil):
    cache.store("run", b"so long", b"how long?")
    only(folder).write_bytes(spoil(only(folder).read_bytes()))
    assert cache.load("run", b"how long?") is None
    cache.store("run", b"so long", b"how long?")
    assert cache.load("run", b"how long?") == b"so long"


def test_the_answer_to_another_question_is_not_taken_under_its_name(folder):
    cache.store("run", b"so long", b"how long?")
    first = only(folder)
    cache.store("run", b"so wide", b"how wide?")
    other = next(file for file in folder.iterdir() if file != first)
    other.replace(first)
    assert cache.load("run", b"how long?") is None


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_folder_that_others_may_write_is_not_used(folder, mode):
    cache.store("run", b"so long", b"how long?")
    folder.chmod(mode)
    assert cache.load("run", b"how long?") is None
    cache.store("run", b"so wide", b"how wide?")
    assert len(list(folder.iterdir())) == 1


def test_a_file_that_others_may_write_is_not_read(folder):
    cache.store("run", b"so long", b"how long?")
    only(folder).chmod(0o620)
    assert cache.load("run", b"how long?") is None


def test_what_belongs_to_somebody_else_is_not_used(folder, monkeypatch):
    cache.store("run", b"so long", b"how long?")
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    assert cache.load("run", b"how long?") is None
    cache.store("run", b"so wide", b"how wide?")
    assert len(list(folder.iterdir())) == 1


def test_what_is_no_file_is_not_waited_for(folder):
    """A pipe that nobody writes into would hold the command for ever."""
    cache.store("run", b"so long", b"how long?")
    place = only(folder)
    place.unlink()
    os.mkfifo(place, 0o600)
    asked = "from quakedesign import cache\nassert cache.load('run', b'how long?') is None"
    subprocess.run([sys.executable, "-c", asked], check=True, timeout=60)
    cache.store("run", b"so long", b"how long?")
    assert cache.load("run", b"how long?") == b"so long"


def test_links_are_not_followed(folder, tmp_path, monkeypatch):
    cache.store("run", b"so long", b"how long?")
    only(folder).rename(tmp_path / "elsewhere")
    (folder / next(iter([cache._name("run", (b"how long?",))]))).symlink_to(tmp_path / "elsewhere")
    assert cache.load("run", b"how long?") is None
    (tmp_path / "link").symlink_to(folder)
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "link"))
    cache.store("run", b"so wide", b"how wide?")
    assert cache.load("run", b"how wide?") is None


@pytest.mark.parametrize("changed", ["_version", "_features"])
def test_another_library_or_processor_has_answers_of_its_own(folder, monkeypatch, changed):
    cache.store("run", b"so long", b"how long?")
    monkeypatch.setattr(cache, "_here", cache._here.__wrapped__)
    assert cache.load("run", b"how long?") == b"so long"
    monkeypatch.setattr(cache, changed, lambda *_: "another")
    assert cache.load("run", b"how long?") is None


def test_another_kernel_of_linear_algebra_has_answers_of_its_own(folder, monkeypatch):
    cache.store("run", b"so long", b"how long?")
    monkeypatch.setattr(cache, "_here", cache._here.__wrapped__)
    monkeypatch.setenv("OPENBLAS_CORETYPE", "another")
    assert cache.load("run", b"how long?") is None


def test_other_sources_have_answers_of_their_own(folder, tmp_path, monkeypatch):
    (tmp_path / "package").mkdir()
    source = tmp_path / "package" / "part.toml"
    monkeypatch.setattr(cache, "_here", cache._here.__wrapped__)
    monkeypatch.setattr(cache, "__file__", str(tmp_path / "package" / "cache.py"))
    source.write_text("a = 1")
    cache.store("run", b"so long", b"how long?")
    assert cache.load("run", b"how long?") == b"so long"
    source.write_text("a = 2")
    assert cache.load("run", b"how long?") is None


@pytest.mark.parametrize("place", ["/proc/nowhere/kept", "/dev/null/kept", "/dev/null"])
def test_where_nothing_can_be_written_the_work_is_done_anew(monkeypatch, place):
    monkeypatch.setenv(cache.PLACE, place)
    cache.store("run", b"so long", b"how long?")
    assert cache.load("run", b"how long?") is None
    assert cache.search_once(lambda: [1.5], "asked") == [1.5]


def test_the_oldest_goes_when_there_is_too_much_and_what_was_asked_for_stays(folder, monkeypatch):
    monkeypatch.setattr(cache, "MOST_BYTES", 4500)
    for number in range(4):
        cache.store("run", bytes(1000), b"%d" % number)
        os.utime(folder / cache._name("run", (b"%d" % number,)), (number, number))
    assert cache.load("run", b"0") == bytes(1000)
    cache.store("run", bytes(1000), b"4")
    assert [cache.load("run", b"%d" % number) is not None for number in range(5)] == [True, False, False, True, True]


def test_two_processes_at_once_never_see_half_a_file(folder):
    where = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    both = [subprocess.Popen([sys.executable, "-c", WRITER], env=where) for _ in range(2)]
    assert [process.wait(60) for process in both] == [0, 0]
    assert len(list(folder.iterdir())) == 2


def test_a_search_is_made_once(folder):
    made = []

    def search():
        made.append(len(made))
        return [0.1 + 0.2, float("inf"), [made[-1]]]

    for _ in range(2):
        assert cache.search_once(search, "asked", 1) == [0.1 + 0.2, float("inf"), [0]]
    assert cache.search_once(search, "asked", 2)[2] == [1]
    value = Asked(3)
    assert cache.search_once(search, value)[2] == [2]
    assert value.area == 9
    assert cache.search_once(search, value)[2] == [2]  # it was known before its area was
    assert cache.search_once(search, Asked(4))[2] == [3]
    assert cache.search_once(search, lambda: "no text says what this is")[2] == [4]


def test_mappings_that_cannot_change_are_asked_about_by_what_they_hold(folder):
    calls = []

    def search():
        calls.append(0)
        return len(calls)

    for power, expected in ((1, 1), (2, 2), (1, 1), (2, 2)):
        assert cache.search_once(search, MappingProxyType({"powers": MappingProxyType({"x": power})})) == expected


@pytest.mark.parametrize("told", ["XDG_CACHE_HOME", "HOME"])
def test_the_folder_is_that_of_the_system_unless_told(tmp_path, monkeypatch, told):
    for name in (cache.PLACE, "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(told, str(tmp_path))
    cache.store("run", b"so long", b"how long?")
    (found,) = tmp_path.rglob("quakedesign/run-*")
    assert found.relative_to(tmp_path).parts[0] in ("quakedesign", ".cache", "Library")


def test_no_cache_takes_and_keeps_nothing(folder):
    cache.store("run", b"so long", b"how long?")
    Output(no_cache=True)
    assert not cache.in_use()
    assert cache.load("run", b"how long?") is None
    cache.store("run", b"so wide", b"how wide?")
    assert len(list(folder.iterdir())) == 1
