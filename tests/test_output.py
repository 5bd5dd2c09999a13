"""Files are written whole or not at all."""

import os

import pytest

from quakedesign.errors import OutputError
from quakedesign.output import write_whole


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
