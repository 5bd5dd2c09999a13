"""Temporary folders of killed processes go at the next start, those of living ones stay."""

import os
import tempfile
from concurrent.futures import ThreadPoolExecutor

import pytest

from quakedesign import files
from quakedesign.files import (
    FAMILY,
    PREFIX,
    discard_all,
    is_temporary,
    lock_of,
    number_placed,
    require_writable,
    sweep,
    sweep_system,
    temporary_folder,
    unlock,
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
    require_writable(target)
    assert len(left(tmp_path)) == count, "the process lives"
    process.kill()
    process.communicate()
    require_writable(target)
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


def test_a_folder_made_anew_after_a_sweep_has_locked_the_old_one_is_not_swept(tmp_path, monkeypatch):
    def locked(folder, lock=files._locked):
        descriptor = lock(folder)
        folder.rmdir()
        folder.mkdir()
        (folder / "here").touch()
        return descriptor

    (tmp_path / f"{PREFIX}anew").mkdir()
    monkeypatch.setattr(files, "_locked", locked)
    sweep(tmp_path)
    assert (tmp_path / f"{PREFIX}anew" / "here").exists()


def test_where_folders_have_no_locks_nothing_is_swept(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError("no locks available")

    (tmp_path / f"{PREFIX}dead").mkdir()
    monkeypatch.setattr("quakedesign.files._locked", refuse)
    write_whole(tmp_path / "result", "x")
    with whole_folder(tmp_path / "results") as new:
        (new / "a").touch()
    sweep(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([f"{PREFIX}dead", "result", "results"])


def test_all_of_this_process_can_be_discarded_from_anywhere(tmp_path):
    with temporary_folder(tmp_path) as one, temporary_folder(tmp_path) as other:
        (one / "content").write_text("")
        discard_all()
        assert not (one.exists())
        assert not (other.exists())
    assert os.listdir(tmp_path) == []


@pytest.fixture
def nothing_left(tmp_path):
    """No descriptor, no folder and no note of one is left of what a test does."""
    opened, noted = os.listdir("/dev/fd"), set(files._mine)
    yield
    assert os.listdir("/dev/fd") == opened
    assert files._mine == noted
    assert os.listdir(tmp_path) == []


@pytest.fixture
def pauses(monkeypatch):
    """Pauses between trials, which take no time."""
    taken = []
    monkeypatch.setattr(files, "sleep", taken.append)
    return taken


@pytest.fixture
def first_lock(monkeypatch):
    """Sets what happens in place of the first locks."""
    own, calls = files._locked, []

    def begin(*deeds):
        def locked(folder):
            calls.append(folder)
            return (deeds[len(calls) - 1] if len(calls) <= len(deeds) else own)(folder)

        monkeypatch.setattr(files, "_locked", locked)
        return calls

    begin.own = own
    return begin


def held(folder):
    raise BlockingIOError


def swept(folder):
    folder.rmdir()
    raise FileNotFoundError


def swept_when_open(folder):
    opened = os.open(folder, os.O_RDONLY)
    folder.rmdir()
    return opened


def without_locks(folder):
    raise OSError("no locks available")


@pytest.mark.usefixtures("nothing_left")
def test_the_lock_of_a_place_is_a_private_folder_beside_it(tmp_path, pauses):
    folder, lock = lock_of(tmp_path / "results")
    assert folder.parent == tmp_path
    assert os.path.samestat(os.fstat(lock), folder.stat())
    assert folder.stat().st_mode & 0o777 == 0o700
    with pytest.raises(BlockingIOError):
        lock_of(tmp_path / "results")
    assert pauses == []  # nobody waits for himself
    with pytest.raises(BlockingIOError):
        files._locked(folder)
    discard_all()
    assert not folder.exists()
    unlock(folder, lock)


@pytest.mark.usefixtures("nothing_left")
def test_a_lock_that_a_sweep_holds_for_a_moment_is_waited_for(tmp_path, pauses, first_lock):
    first_lock(held, held)
    folder, lock = lock_of(tmp_path / "results")
    assert pauses == [files._PAUSE] * 2
    assert os.path.samestat(os.fstat(lock), folder.stat())
    unlock(folder, lock)


def test_a_lock_that_stays_with_another_is_given_up(tmp_path, pauses, first_lock, monkeypatch):
    monkeypatch.setattr(files, "_TRIALS", 4)
    calls = first_lock(*[held] * 5)
    with pytest.raises(BlockingIOError):
        lock_of(tmp_path / "results")
    assert (len(calls), pauses) == (4, [files._PAUSE] * 3)


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("before", [False, True])
def test_a_folder_that_is_swept_while_it_is_locked_is_made_again(tmp_path, first_lock, again, before):
    def swept_at_once(folder):
        lock = None if before else first_lock.own(folder)
        folder.rmdir()
        if again:
            (folder.parent / "other").mkdir()  # a folder of its own number
            (folder.parent / "other").rename(folder)
        if before:
            raise FileNotFoundError
        return lock

    first_lock(swept_at_once)
    folder, lock = lock_of(tmp_path / "results")
    assert os.path.samestat(os.fstat(lock), folder.stat())
    unlock(folder, lock)


@pytest.mark.usefixtures("nothing_left")
def test_where_there_are_no_locks_a_place_is_had_without(tmp_path, first_lock):
    calls = first_lock(*[without_locks] * 9)
    folder, lock = lock_of(tmp_path / "results")
    assert (len(calls), lock) == (1, None)
    unlock(folder, lock)
    with temporary_folder(tmp_path) as work:
        assert work.exists()


@pytest.mark.usefixtures("nothing_left")
@pytest.mark.parametrize("deed", [held, swept, swept_when_open])
def test_a_new_folder_that_is_swept_before_it_is_locked_is_made_again(tmp_path, first_lock, deed):
    calls = first_lock(deed)
    with temporary_folder(tmp_path) as folder:
        assert folder.exists()
        assert len(calls) == 2


@pytest.mark.usefixtures("nothing_left")
def test_what_cannot_be_made_or_locked_leaves_nothing(tmp_path):
    with pytest.raises(FileNotFoundError), temporary_folder(tmp_path / "none"):
        raise AssertionError("the block must not begin")
    elsewhere, link, file = tmp_path / "folder", tmp_path / "link", tmp_path / "file"
    elsewhere.mkdir()
    link.symlink_to(elsewhere)
    file.touch()
    for place in (link, file):
        with pytest.raises(OSError, match=r"Not a directory|Too many levels"):
            files._locked(place)
        place.unlink()
    elsewhere.rmdir()


@pytest.mark.usefixtures("nothing_left")
def test_a_folder_that_is_swept_at_every_trial_is_not_had_without_a_lock(tmp_path, first_lock, monkeypatch):
    monkeypatch.setattr(files, "_TRIALS", 3)
    calls = first_lock(*[swept] * 5)
    with pytest.raises(BlockingIOError):
        lock_of(tmp_path / "results")
    assert len(calls) == 3


@pytest.mark.usefixtures("nothing_left")
def test_windows_has_no_locks_of_folders(tmp_path, monkeypatch):
    monkeypatch.setattr(files.sys, "platform", "win32")
    with pytest.raises(OSError, match="folders cannot be locked on this system"):
        files._locked(tmp_path)


def test_folders_of_other_users_stay(tmp_path, monkeypatch):
    (tmp_path / f"{PREFIX}dead").mkdir()
    opened, own = os.listdir("/dev/fd"), os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: own + 1)
    sweep(tmp_path)
    assert os.listdir(tmp_path) == [f"{PREFIX}dead"]
    monkeypatch.undo()
    sweep(tmp_path)
    assert os.listdir(tmp_path) == []
    assert os.listdir("/dev/fd") == opened


def test_the_folder_of_the_system_is_used_and_swept(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / f"{PREFIX}dead").mkdir()
    sweep_system()
    assert os.listdir(tmp_path) == []
    with temporary_folder() as folder:
        assert folder.parent == tmp_path
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    sweep_system()


def test_what_is_put_in_its_place_is_counted_but_for_what_is_temporary(tmp_path):
    before = number_placed()
    with temporary_folder(tmp_path) as folder:
        assert is_temporary(folder / "a" / "b")
        assert not is_temporary(tmp_path / "a")
        write_whole(folder / "a", "x")
        assert number_placed() == before
    write_whole(tmp_path / "a", "x")
    assert number_placed() == before + 1
    with whole_folder(tmp_path / "b") as new:
        write_whole(new / "c", "x")
    assert number_placed() == before + 2
