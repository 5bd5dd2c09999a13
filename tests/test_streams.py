"""A command says what is wrong with its surroundings in one line: closed streams, absurd widths, too little memory."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from thinned import few

from quakedesign import streams

ROOT = Path(__file__).parents[1]
PROVED = str(ROOT / "proofs" / "certificates" / "super-twisting_1.5_1.1.json")
CLOSING = "import os, sys; [os.close(int(n)) for n in sys.argv[1].split(',')]; os.execv(sys.executable, sys.argv[2:])"
COMMAND = (sys.executable, "-m", "quakedesign")
CHECKER = (sys.executable, str(ROOT / "proofs" / "check.py"))


def run(*command, closed="", **more):
    """Exit code and stderr of a command that begins with closed streams."""
    start = [sys.executable, "-c", CLOSING, closed, *command] if closed else command
    done = subprocess.run(start, capture_output=True, text=True, check=False, timeout=120, **more)
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, done.stderr


@few("closed", ["0", "1", "2", "0,1,2"], every=3)
def test_a_verdict_that_nobody_wants_told_is_the_exit_code(closed):
    assert run(*COMMAND, "check", PROVED, "--quiet", closed=closed) == (0, "", "")


@few("line", [("check", PROVED), ("check", PROVED, "--json"), ("--help",), ("fault", "--help")], every=2)
def test_what_cannot_be_told_is_one_line_and_no_verdict(line):
    code, out, err = run(*COMMAND, *line, closed="1")
    assert (code, out) == (2, "")
    assert err == "quakedesign: stdout cannot be written: it is closed. Choose another folder, or free disk space.\n"


def test_the_checker_of_the_standard_library_tells_its_verdict_or_says_that_it_cannot():
    assert run(*CHECKER, PROVED, closed="1")[::2] == (
        2,
        "The verdict must be written. Received: standard output is closed. Redirect it.\n",
    )
    assert run(*CHECKER, PROVED, closed="2")[0] == 0


@few("columns", ["0", "1", "2", "9" * 30], every=3)
def test_help_ends_in_any_width(columns):
    code, out, _ = run(*COMMAND, "fault", "--help", env={**os.environ, "COLUMNS": columns})
    assert code == 0
    assert 1000 < len(out) < 100_000


@pytest.mark.parametrize(
    ("given", "taken"),
    [
        ("0", "20"),
        ("2", "20"),
        ("20", "20"),
        ("80", "80"),
        ("1000", "1000"),
        ("1001", "1000"),
        ("²", None),
        ("-3", None),
    ],
)
def test_a_width_is_one_in_which_help_can_be_laid_out(given, taken, monkeypatch):
    monkeypatch.setenv("COLUMNS", given)
    monkeypatch.setattr(os, "get_terminal_size", lambda _: os.terminal_size((100, 30)))
    streams.widen()
    assert os.environ.get("COLUMNS") == taken


def test_a_terminal_may_be_too_narrow_too(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(os, "get_terminal_size", lambda _: os.terminal_size((1, 30)))
    streams.widen()
    assert os.environ.pop("COLUMNS") == "20"


@few("megabytes", [150, 250, 500], every=3)
def test_too_little_memory_is_no_verdict(megabytes):
    limit = megabytes * 10**6

    def lower():
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    code, out, err = run(*COMMAND, "check", PROVED, "--quiet", preexec_fn=lower)
    assert (code, out) == (streams.LACKS_MEMORY, "")
    assert err == "quakedesign: out of memory. Raise the memory limit, or reduce the problem.\n"


LACKING = [
    MemoryError(),
    OSError(errno.ENOMEM, "Cannot allocate memory"),
    ImportError("libopenblas.so: failed to map segment from shared object"),
    RuntimeError("can't start new thread"),
    RuntimeError("std::bad_alloc"),
]


@pytest.mark.parametrize("error", LACKING, ids=lambda error: type(error).__name__)
def test_libraries_say_in_their_own_words_that_memory_lacks(error):
    assert streams.lacks_memory(error)
    outer = ValueError("while loading")
    outer.__cause__ = error
    assert streams.lacks_memory(outer)
    assert not streams.lacks_memory(ValueError("memory of an elephant"))


def test_a_command_that_runs_out_of_memory_has_its_own_exit_code(monkeypatch, capsys):
    from quakedesign import cli

    def greedy(*_, **__):
        raise MemoryError

    monkeypatch.setattr(cli, "app", greedy)
    with pytest.raises(SystemExit) as stop:
        cli.main(["fault", "lab-fault"])
    assert stop.value.code == streams.LACKS_MEMORY == 4
    assert capsys.readouterr().err.startswith("quakedesign: out of memory.")
