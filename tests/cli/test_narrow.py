"""On a terminal of 80 columns, for scripts that want silence, and for shells that complete."""

import logging
import re
import subprocess

import pytest
from rich.cells import cell_len
from thinned import few

from quakedesign.cli import main
from quakedesign.cli.app import app, progress

COMMANDS = sorted(name for name in app if not name.startswith("-"))
CHEAP = [
    ("fault", "real-fault"),
    ("fault", "crustal-patch"),
    ("derive", "real-fault"),
    ("scale", "lab-fault", "real-fault"),
]


def said(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return stop.value.code, out, err


@few("command", COMMANDS, every=4)
def test_help_fits_eighty_columns(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = said(capsys, command, "--help")
    assert (code, err) == (0, "")
    assert max(cell_len(line.rstrip()) for line in out.splitlines()) <= 80


@pytest.mark.parametrize("arguments", CHEAP, ids=" ".join)
def test_no_number_is_cut(arguments, capsys, monkeypatch):
    """The same numbers stand in a narrow and in a wide terminal."""
    numbers = []
    for width in ("80", "400"):
        monkeypatch.setenv("COLUMNS", width)
        code, out, _ = said(capsys, *arguments)
        assert code == 0
        numbers.append(re.findall(r"\d[\d.e+-]*", out))
    assert numbers[0] == numbers[1] != []


def test_quiet_says_nothing_but_the_exit_code(capsys):
    assert said(capsys, "fault", "real-fault", "--quiet") == (0, "", "")
    assert said(capsys, "derive", "real-fault", "--quiet") == (0, "", "")
    code, out, err = said(capsys, "scale", "lab-fault", "real-fault", "--quiet", "--json")
    assert (code, out[0], err) == (0, "{", "")
    code, out, err = said(capsys, "fault", "nowhere", "--quiet")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said(capsys, "fault", "real-fault")[1].startswith("real-fault")  # the next command speaks again


def test_steps_are_logged_for_those_who_ask(capsys):
    for level, count in (("warning", 0), ("info", 2), ("debug", 3)):
        with pytest.raises(SystemExit):
            main(["fault", "real-fault", "--quiet", "--log-level", level])
        capsys.readouterr()
        with progress() as report:
            for what in ("first", "first", "second\x1b"):
                report(what, 0.5)
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == count
        assert all(re.fullmatch(r"[\d-]+ [\d:,]+ (INFO|DEBUG) (first|second\\x1b) \(50 %\)", line) for line in lines)
    assert logging.getLogger("quakedesign").propagate is False


@few("shell", ["bash", "zsh", "fish"], every=3)
def test_a_shell_completes_every_command(shell, capsys):
    code, out, err = said(capsys, "completion", shell)
    assert (code, err) == (0, "")
    assert all(command in out for command in COMMANDS)
    assert "log-level" in out
    if shell == "bash":
        done = subprocess.run(["bash", "-n"], input=out, text=True, capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


def test_each_command_that_writes_has_a_folder_of_its_own(capsys):
    names = re.compile(r"\./(quakedesign-[\w-]+)")
    told = {command: set(names.findall(" ".join(said(capsys, command, "--help")[1].split()))) for command in COMMANDS}
    folders = [folder for found in told.values() for folder in found]
    assert len(folders) == len(set(folders)) > 4
