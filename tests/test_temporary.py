"""Temporary folders of killed processes go at the next start, those of living ones stay."""

import os
from concurrent.futures import ThreadPoolExecutor

import pytest

from quakedesign.files import (
    FAMILY,
    PREFIX,
    discard_all,
    require_room,
    sweep,
    temporary_folder,
    whole_folder,
    write_whole,
)

HOLDS = """
import os, sys, time
from pathlib import Path
from quakedesign import files as output

def stop(*arguments):
    print("there", flush=True)
    time.sleep(600)

def stop_at_the_second(one, other, calls=[]):
    calls.append(one)
    stop() if len(calls) == 2 else rename(one, other)

target, rename = Path(sys.argv[1]), os.replace
"""
FILE = HOLDS + "os.replace = stop\noutput.write_whole(target, 'new')\n"
FOLDER = HOLDS + "with output.whole_folder(target) as new:\n    (new / 'new').write_text('half')\n    stop()\n"
SWAP = HOLDS + (
    "os.replace = stop_at_the_second\nwith output.whole_folder(target) as new:\n    (new / 'new').write_text('whole')\n"
)


@pytest.fixture
def holder(start):
    """Starts a process that stops in the middle of writing."""

    def begin(program, target):
        process = start("-c", program, target)
        assert process.stdout.readline() == "there\n"
        return process

    return begin


def left(folder):
    return sorted(path.name for path in folder.iterdir() if path.name.startswith(FAMILY))


@pytest.mark.parametrize("program", [FILE, FOLDER, SWAP], ids=["file", "folder", "swap"])
def test_what_a_killed_process_left_goes_and_what_was_there_is_there(tmp_path, holder, program):
    target = tmp_path / "results"
    if program is FILE:
        target.write_text("old")
    else:
        with whole_folder(target) as new:
            (new / "old").write_text("old")
    process = holder(program, target)
    count = 1 if program is FILE else 2  # beside what is half written, a folder has its lock
    assert len(left(tmp_path)) == count
    require_room(target)
    assert len(left(tmp_path)) == count, "the process lives"
    process.kill()
    process.communicate()
    require_room(target)
    assert os.listdir(tmp_path) == ["results"]
    assert (target if program is FILE else target / "old").read_text() == "old"


def test_an_interruption_between_the_two_renames_keeps_the_earlier_folder(tmp_path, monkeypatch):
    target, rename, calls = tmp_path / "results", os.replace, []
    with whole_folder(target) as new:
        (new / "old").write_text("old")

    def interrupted(one, other):
        calls.append(one)
        if len(calls) == 2:
            raise KeyboardInterrupt
        rename(one, other)

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_folder(target) as new:
        (new / "new").write_text("new")
    assert os.listdir(tmp_path) == ["results"]
    assert os.listdir(target) == ["old"]


def test_nobody_else_may_read_it_and_it_goes(tmp_path):
    with temporary_folder(tmp_path) as folder:
        assert folder.parent == tmp_path
        assert folder.stat().st_mode & 0o777 == 0o700
        sweep(tmp_path)
        assert folder.exists()
    assert os.listdir(tmp_path) == []


def test_only_folders_of_dead_processes_of_this_machine_are_taken_away(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "thesis.txt").write_text("years")
    (tmp_path / f"{PREFIX}link").symlink_to(elsewhere)
    (tmp_path / f"{PREFIX}file").write_text("")
    (tmp_path / f"{FAMILY}other-host").mkdir()
    (tmp_path / f"{PREFIX}dead").mkdir()
    sweep(tmp_path)
    assert left(tmp_path) == sorted([f"{PREFIX}link", f"{PREFIX}file", f"{FAMILY}other-host"])
    assert (elsewhere / "thesis.txt").read_text() == "years"


def test_no_sweep_ever_takes_a_folder_that_is_in_use(tmp_path):
    """Locks are those of descriptors, so that threads are as good as processes here."""

    def work(_):
        for _ in range(60):
            with temporary_folder(tmp_path) as folder:
                sweep(tmp_path)
                (folder / "here").write_text("")
                sweep(tmp_path)
                assert (folder / "here").exists()

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))
    assert os.listdir(tmp_path) == []


def test_where_folders_have_no_locks_nothing_is_swept(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError("no locks available")

    (tmp_path / f"{PREFIX}dead").mkdir()
    monkeypatch.setattr("quakedesign.files._locked", refuse)
    write_whole(tmp_path / "result", "x")
    sweep(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([f"{PREFIX}dead", "result"])


def test_all_of_this_process_can_be_discarded_from_anywhere(tmp_path):
    with temporary_folder(tmp_path) as one, temporary_folder(tmp_path) as other:
        (one / "content").write_text("")
        discard_all()
        assert not (one.exists())
        assert not (other.exists())
    assert os.listdir(tmp_path) == []
