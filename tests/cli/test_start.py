"""``init``: a file to start from, which no other is lost for."""

import json

import pytest

from quakedesign.cli import main
from quakedesign.fault import load_fault


def ran(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    said = capsys.readouterr()
    return ended.value.code, said.out, said.err


def test_a_file_is_written_that_the_next_command_reads(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = ran(capsys, "init", "--schema")
    assert code == 0
    assert "next: edit it, then quakedesign fault my-fault.toml" in out
    assert (tmp_path / "my-fault.toml").read_text().startswith("#:schema ./fault.schema.json\n")
    assert json.loads((tmp_path / "fault.schema.json").read_text())["required"][0] == "name"
    code, out, _ = ran(capsys, "fault", "my-fault.toml")
    assert code == 0
    assert "assumed: damping" in out
    told = json.loads(ran(capsys, "fault", "my-fault.toml", "--json")[1])
    assert len(told["assumed"]) == 5
    (tmp_path / "resolved.toml").write_text(told["scenario"])
    resolved = load_fault(tmp_path / "resolved.toml")
    assert resolved == load_fault(tmp_path / "my-fault.toml")
    assert resolved.assumed == ()


@pytest.mark.parametrize("there", ["own.toml", "fault.schema.json"])
def test_nothing_is_replaced_unless_forced(tmp_path, capsys, there):
    (tmp_path / there).write_text("mine")
    code, _, err = ran(capsys, "init", str(tmp_path / "own.toml"), "--schema")
    assert code == 2
    assert "exists. Give --force" in err
    assert [p.name for p in tmp_path.iterdir()] == [there]
    assert (tmp_path / there).read_text() == "mine"
    code, out, _ = ran(capsys, "init", str(tmp_path / "own.toml"), "--schema", "--force", "--json")
    assert code == 0
    assert json.loads(out)["file"] == str(tmp_path / "own.toml")
    assert len(list(tmp_path.iterdir())) == 2


def test_what_cannot_be_written_is_said_in_one_line(tmp_path, capsys):
    for arguments, said in (
        ((str(tmp_path / "own.txt"),), "must end in .toml"),
        ((str(tmp_path / "own.toml"), "--law", "linear-slip-weakning"), "friction law must be one of"),
        ((str(tmp_path / "no" / "own.toml"),), "in a folder that can be written"),
    ):
        code, out, err = ran(capsys, "init", *arguments)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert said in err
    assert not list(tmp_path.iterdir())
