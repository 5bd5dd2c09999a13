"""Exit codes of the command line, and what all commands share: output, files, options that were given."""

import errno
import importlib
import io
import json
import logging
import os
import re
import sys
import warnings
from pathlib import Path

import pytest
from cyclopts import CoercionError
from rich.console import Console

from quakedesign import cli, discovery, files
from quakedesign.errors import OutputError, ParameterError

shared = importlib.import_module("quakedesign.cli.app")
DISK = ("ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EACCES", "EPERM")


@pytest.fixture
def ends(monkeypatch, capsys):
    """Exit code and stderr of a command that does something."""

    def run(deed, arguments=("fault",)):
        monkeypatch.setattr(cli, "app", lambda *_, **__: deed())
        with pytest.raises(SystemExit) as end:
            cli.main(None if arguments is None else list(arguments))
        return end.value.code, capsys.readouterr().err

    return run


def raising(error):
    def deed():
        raise error

    return deed


@pytest.mark.parametrize(("value", "code"), [(0, 0), (1, 1), (7, 7), (None, 0), ("text", 0)])
def test_a_command_ends_with_the_number_that_it_returns(ends, value, code):
    assert ends(lambda: value) == (code, "")


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (ParameterError("step must be positive"), 2, "quakedesign: step must be positive\n"),
        (
            ValueError("a\nb"),
            3,
            "quakedesign: internal error: ValueError: a b. Set QUAKEDESIGN_TRACEBACK=1 for the traceback.\n",
        ),
        (MemoryError(), 4, "quakedesign: out of memory. Raise the memory limit, or reduce the problem.\n"),
        (
            OSError(errno.EIO, "it fails", "stdout"),
            2,
            "quakedesign: stdout cannot be written: it fails. Choose another",
        ),
        (
            OSError(errno.EIO, "it fails", "/a"),
            3,
            "quakedesign: internal error: OSError: [Errno 5] it fails: '/a'. Set",
        ),
        *((OSError(getattr(errno, name), "it fails", "/a"), 2, "quakedesign: /a cannot be written") for name in DISK),
        (OSError(errno.ENOSPC, "it fails"), 2, "quakedesign: the output cannot be written: it fails. Choose another"),
        (CoercionError(msg="this is wrong"), 2, "quakedesign: this is wrong\n"),
    ],
    ids=repr,
)
def test_every_error_has_its_code_and_one_line(ends, error, code, said):
    found, err = ends(raising(error))
    assert (found, err.count("\n")) == (code, 1)
    assert err.startswith(said)


def test_a_reader_that_goes_is_code_one_and_nothing_more_is_said(ends):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stderr", io.StringIO())
        assert ends(raising(BrokenPipeError()))[0] == 1
        assert sys.stderr.closed


def test_the_place_of_a_defect_is_shown_on_request(monkeypatch):
    monkeypatch.setattr(cli, "app", lambda *_, **__: raising(ValueError("wrong"))())
    monkeypatch.setenv("QUAKEDESIGN_TRACEBACK", "1")
    with pytest.raises(ValueError, match="wrong"):
        cli.main(["fault"])


@pytest.mark.parametrize("deed", [lambda: 0, raising(ParameterError("no")), raising(ValueError("no"))])
def test_folders_are_let_go_however_a_command_ends(ends, deed, tmp_path):
    ends(lambda: (files.lock_folder(tmp_path / "results"), deed())[1])
    assert files.lock_folder(tmp_path / "results"), "nobody holds it"
    files.release()


def test_the_command_is_known_as_it_was_typed(ends, monkeypatch):
    known = []
    ends(lambda: known.append(shared.command_line()), ["fault", "a b"])
    ends(lambda: known.append(shared.command_line()), [])
    monkeypatch.setattr(sys, "argv", ["/bin/quakedesign", "fault", "x"])
    ends(lambda: known.append(shared.command_line()), None)
    assert known == ["quakedesign fault 'a b'", "", "quakedesign fault x"]


def test_a_command_allows_no_code_and_is_not_quiet_because_the_one_before_was(ends, capsys):
    discovery.allow_code(True)
    shared.set_output(quiet=True, level="debug")
    seen = []

    def deed():
        shared.print_lines(["heard"])
        seen.append((discovery._allowed.get(), logging.getLogger("quakedesign").level))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cli, "app", lambda *_, **__: deed())
        with pytest.raises(SystemExit):
            cli.main(["fault"])
    assert capsys.readouterr().out == "heard\n"
    assert seen == [(False, logging.WARNING)]
    assert len(logging.getLogger("quakedesign").handlers) == 1
    assert logging.getLogger("quakedesign").propagate is False


@pytest.mark.parametrize(
    ("arguments", "options", "kept", "before"),
    [(None, [], False, None), (None, [], False, "error"), (None, ["default"], True, None), (["fault"], [], True, None)],
)
def test_users_see_no_warnings_of_libraries_unless_they_ask(ends, monkeypatch, arguments, options, kept, before):
    monkeypatch.setattr(sys, "argv", ["quakedesign", "fault"])
    monkeypatch.setattr(sys, "warnoptions", options)
    monkeypatch.delenv("PYTHONWARNINGS", raising=False)
    if before is not None:
        monkeypatch.setenv("PYTHONWARNINGS", before)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ends(lambda: 0, arguments)
        first = warnings.filters[0][0]
    assert first == ("error" if kept else "ignore")
    assert os.environ.get("PYTHONWARNINGS") == (before or (None if kept else "ignore"))


def test_a_stream_of_few_letters_gets_the_others_by_their_numbers(ends):
    held = io.BytesIO()
    stream = io.TextIOWrapper(held, encoding="ascii")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        assert ends(lambda: print("μ", flush=True))[0] == 0
    assert held.getvalue() == b"\\u03bc\n"


def test_where_to_look_is_told():
    assert cli._with_help(cli.CycloptsError(msg="unknown")) == "unknown See quakedesign --help."


# What commands share


def test_options_that_were_given_are_those_that_are_not_none():
    assert shared.specified({"a": None, "b": 0, "c": "", "d": False}) == {"b": 0, "c": "", "d": False}
    assert shared.reject({"a": None}, "a certificate") is None
    with pytest.raises(ParameterError, match=r"^step, lag cannot be used with a certificate\. Omit step, lag\.$"):
        shared.reject({"step": 0.0, "delay": None, "lag": 1.0}, "a certificate")


def test_json_is_strict_and_ends_with_its_line(capsys):
    shared.print_json({"a": [1.5, None, "μ"]})
    out = capsys.readouterr().out
    assert json.loads(out) == {"a": [1.5, None, "μ"]}
    assert out.endswith("}\n")
    with pytest.raises(ValueError, match="not JSON compliant"):
        shared.print_json({"a": float("inf")})


@pytest.mark.parametrize(
    ("place", "force", "said"),
    [
        (None, False, None),
        ("new", False, None),
        ("new", True, None),
        ("there", True, None),
        ("there", False, "figure must be new. Received .*there, which exists. Give --force"),
        ("folder", True, "figure must be a file. Received .*folder, which is a folder"),
        ("folder", False, "figure must be a file. Received .*folder, which is a folder"),
        ("none/new", True, "must be in a folder that can be written"),
    ],
)
def test_a_file_is_new_or_replaced_by_force(tmp_path, place, force, said):
    (tmp_path / "there").touch()
    (tmp_path / "folder").mkdir()
    path = place and tmp_path / place
    if said is None:
        assert shared.new_file(path, "figure", force=force) is None
    else:
        with pytest.raises(OutputError, match=said):
            shared.new_file(path, "figure", force=force)


def test_two_names_are_two_places(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "a")
    places = {"record": tmp_path / "a", "fault": None, "out": tmp_path / "b", "copy": None}
    assert shared.require_different(places) is None
    for other in (tmp_path / "link", tmp_path / "c" / ".." / "a", Path(tmp_path / "b")):
        with pytest.raises(OutputError, match=r"^(record|out) and copy must be different files"):
            shared.require_different({**places, "copy": other})


@pytest.mark.parametrize(("terminal", "quiet"), [(True, False), (True, True), (False, False)])
def test_progress_is_shown_on_a_terminal_unless_it_is_quiet(monkeypatch, terminal, quiet):
    shown = io.StringIO()
    asked = []

    def console(**options):
        asked.append(options)
        return Console(file=shown, force_terminal=terminal, width=120)

    monkeypatch.setattr(shared, "Console", console)
    shared.set_output(quiet=quiet, level="warning")
    try:
        with shared.progress() as progress:
            progress("integrating", 0.25)
    finally:
        shared.set_output(quiet=False, level="warning")
    assert asked == [{"stderr": True}]
    assert ("integrating" in shown.getvalue()) == (terminal and not quiet)
    assert (" 25%" in shown.getvalue()) == (terminal and not quiet)
    assert shown.getvalue() == "" or shown.getvalue().endswith("\x1b[2K"), "what was shown is wiped out at the end"


@pytest.mark.parametrize(
    ("level", "heard"), [("warning", []), ("info", ["INFO a (0 %)", "INFO b (50 %)"]), ("debug", "all")]
)
def test_progress_is_logged_for_those_who_ask(capsys, level, heard):
    shared.set_output(quiet=True, level=level)
    try:
        with shared.progress() as progress:
            for what, done in (("a", 0.0), ("a", 0.25), ("b", 0.5), ("b", 1.0)):
                progress(what, done)
    finally:
        lines = capsys.readouterr().err.splitlines()
        shared.set_output(quiet=False, level="warning")
    every = ["INFO a (0 %)", "DEBUG a (25 %)", "INFO b (50 %)", "DEBUG b (100 %)"]
    assert [re.sub(r"^[\d-]{10} [\d:,]{12} ", "", line) for line in lines] == (every if heard == "all" else heard)


def test_no_word_of_a_terminal_is_cut_at_its_hyphens():
    out = io.StringIO()
    shared.console(file=out, force_terminal=True, color_system=None, width=20).print(
        f"one two three four-five-six {'x' * 30}"
    )
    assert [line.strip() for line in out.getvalue().splitlines()] == ["one two three", "four-five-six", "x" * 30]


@pytest.mark.parametrize("terminal", [True, False])
def test_a_string_is_no_emoji_and_has_no_colour(terminal):
    out, told = io.StringIO(), ":bomb: [bold]5[/bold] 'x' 1.5"
    shared.console(file=out, force_terminal=terminal, color_system="truecolor", width=60).print(told)
    assert out.getvalue() == f"{told}\n"


def test_a_long_line_goes_on_two_columns_further_in():
    out = io.StringIO()
    screen = shared.console(file=out, force_terminal=True, color_system=None, width=30)
    screen.print("    " + "word " * 12)
    first, *others = out.getvalue().rstrip().splitlines()
    assert first.startswith("    word")
    assert all(line.startswith("      word") for line in others)


def test_a_long_line_goes_on_below_its_beginning_in_a_pipe_too(capsys):
    shared.console().print("  one\ntwo")
    assert capsys.readouterr().out == "  one\\ntwo\n"
    shared.console().print("  " + "a part of it, " * 40)
    first, *others = capsys.readouterr().out.rstrip().splitlines()
    assert first.startswith("  a part")
    assert len(others) > 1
    assert all(line.startswith("    a part") for line in others)
