"""Files and folders are written whole or not at all."""

import errno
import os
import subprocess
import sys

import pytest

from quakedesign import files as output
from quakedesign.cli import main
from quakedesign.errors import OutputError
from quakedesign.files import whole_folder, write_whole


@pytest.mark.parametrize(("content", "held"), [("μ = ½\n", "μ = ½\n".encode()), (b"\x00\xff", b"\x00\xff")])
def test_text_is_utf8_and_bytes_are_kept(tmp_path, content, held):
    path = tmp_path / "result"
    write_whole(path, "something longer that was there before")
    write_whole(path, content)
    assert path.read_bytes() == held
    assert path.stat().st_mode & 0o777 == 0o644
    assert os.listdir(tmp_path) == ["result"]


def test_a_missing_folder_is_one_clear_message(tmp_path):
    with pytest.raises(OutputError, match=r"nowhere/result cannot be written: No such file or directory\. Choose"):
        write_whole(tmp_path / "nowhere" / "result", "x")


@pytest.mark.parametrize("name", ["\0", "\ud800"])
def test_what_no_system_can_name_is_refused(tmp_path, name):
    with pytest.raises(OutputError, match=r"cannot be written: .*\. Choose another name"):
        write_whole(tmp_path / name, "x")
    with (
        pytest.raises(OutputError, match=r"cannot be written: .*\. Choose another name"),
        whole_folder(tmp_path / name),
    ):
        raise AssertionError("the block must not begin")
    assert os.listdir(tmp_path) == []


def test_nothing_is_left_behind_when_the_target_is_a_folder(tmp_path):
    (tmp_path / "result").mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        write_whole(tmp_path / "result", "x")
    assert os.listdir(tmp_path) == ["result"]


def test_the_old_file_survives_a_crash_while_writing(tmp_path, monkeypatch):
    path = tmp_path / "result"
    write_whole(path, "old")

    def crash(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", crash)
    with pytest.raises(KeyboardInterrupt):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["result"]


def test_a_folder_appears_whole_and_replaces_an_earlier_one(tmp_path):
    target = tmp_path / "results"
    for text in ("first", "second"):
        with whole_folder(target) as partial:
            assert not (target / text).exists()
            write_whole(partial / text, text)
        assert os.listdir(target) == [text]
    assert target.stat().st_mode & 0o777 == 0o755
    assert os.listdir(tmp_path) == ["results"]


def test_an_earlier_folder_survives_a_failure(tmp_path):
    target = tmp_path / "results"
    with whole_folder(target) as partial:
        write_whole(partial / "old", "old")

    def fill():
        with whole_folder(target) as partial:
            write_whole(partial / "new", "new")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fill()
    assert os.listdir(target) == ["old"]
    assert os.listdir(tmp_path) == ["results"]


def test_a_folder_in_no_folder_is_one_clear_message(tmp_path):
    with (
        pytest.raises(OutputError, match=r"nowhere/results cannot be written"),
        whole_folder(tmp_path / "nowhere" / "results"),
    ):
        pass


HOLDING = """
import sys
from pathlib import Path
from quakedesign.files import lock_folder
lock_folder(Path(sys.argv[1]), make=True)
print("held", flush=True)
sys.stdin.readline()
"""


def test_a_folder_is_written_by_one_command_at_a_time(tmp_path):
    """Two campaigns with --force into one folder had ended with files of both."""
    place = tmp_path / "above" / "results"
    other = subprocess.Popen([sys.executable, "-c", HOLDING, place], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert other.stdout.readline() == b"held\n"
        for spelling in (place, place.parent / ".." / "above" / "results"):
            with pytest.raises(OutputError, match="must be written by one command at a time"):
                output.lock_folder(spelling)
        with pytest.raises(OutputError, match="one command at a time"), output.whole_folder(place):
            pass
        with pytest.raises(SystemExit) as stop:
            main(["campaign", "lab-fault", "--samples", "1", "--duration", "1", "--force", "--out", str(place)])
        assert stop.value.code == 2
        assert output.lock_folder(place.with_name("another"))
        output.release()
    finally:
        other.kill()
        other.communicate()
    assert output.lock_folder(place), "a lock ends with its process"
    assert not output.lock_folder(place), "a command may hold what it holds"
    output.release(place)
    with output.whole_folder(place) as new:
        (new / "a").touch()
    assert [path.name for path in place.parent.iterdir()] == ["results"]


def test_a_folder_that_was_made_for_files_goes_where_none_could_be_written(tmp_path):
    with pytest.raises(OutputError, match="No space left"), output.made_folder(tmp_path / "a" / "b"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []
    with output.made_folder(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "c").touch()
    with pytest.raises(ValueError, match="other"), output.made_folder(tmp_path / "a" / "b"):
        raise ValueError("other")
    assert (tmp_path / "a" / "b" / "c").is_file()


@pytest.fixture(autouse=True)
def _nothing_stays_held():
    yield
    output.release()


def test_one_folder_is_let_go_and_the_others_are_kept(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    assert output.lock_folder(one)
    assert output.lock_folder(other)
    output.release(one)
    assert output.lock_folder(one)
    assert not output.lock_folder(other)
    with output.sole_writer(other):
        pass
    assert not output.lock_folder(other), "who holds it already goes on holding it"
    output.release()
    assert output.lock_folder(other)
    assert output.lock_folder(one)


def test_folders_above_are_made_where_they_are_wanted(tmp_path):
    assert output.lock_folder(tmp_path / "none" / "results")
    assert os.listdir(tmp_path) == []
    for _ in range(2):
        output.release()
        assert output.lock_folder(tmp_path / "a" / "b" / "results", make=True)
    output.release()
    assert os.listdir(tmp_path / "a" / "b") == []
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"results cannot be written: (Not a directory|File exists)\. Choose another"):
        output.lock_folder(tmp_path / "file" / "results", make=True)


def test_everybody_may_read_what_is_written_whatever_the_mask(tmp_path):
    before = os.umask(0o077)
    try:
        write_whole(tmp_path / "file", "x")
        with whole_folder(tmp_path / "folder"):
            pass
    finally:
        os.umask(before)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("file", "folder")] == [0o644, 0o755]


def test_a_refusal_within_a_made_folder_keeps_its_words(tmp_path):
    with pytest.raises(OutputError, match=r"^own words$"), output.made_folder(tmp_path / "a"):
        raise OutputError("own words")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    ("place", "reason"), [("none/a", r": No such file or directory\. Choose"), ("\0", r": embedded null byte\. Choose")]
)
def test_why_there_is_no_room(tmp_path, place, reason):
    with pytest.raises(OutputError, match=f"must be in a folder that can be written.*{reason}"):
        output.require_writable(tmp_path / place)
