"""What users wrote is printed as they wrote it, and nothing of it is obeyed."""

import io
import re
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

import quakedesign
from quakedesign.cli import main
from quakedesign.cli.app import console, print_lines

LAB = (files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text(encoding="utf-8")


def sourced(source, tmp_path):
    """Path of a fault file with another source, as TOML writes it."""
    path = tmp_path / "own.toml"
    path.write_text(re.sub(r'(?m)^source = ".*"$', lambda _: f'source = "{source}"', LAB), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("see [/foo]", "(see [/foo])"),
        ("[preprint] of 2020", "([preprint] of 2020)"),
        ("[bold]loud[/bold] :bomb:", "([bold]loud[/bold] :bomb:)"),
        (r"\u001b[2Jgone", r"(\x1b[2Jgone)"),
        (r"a\nproved", r"(a\nproved)"),
    ],
)
def test_the_source_of_a_fault_is_text(source, shown, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["fault", sourced(source, tmp_path)])
    out, err = capsys.readouterr()
    assert (stop.value.code, err) == (0, "")
    assert out.splitlines()[0] == f"lab-fault {shown}"
    assert "\x1b" not in out


def test_a_table_and_a_heading_are_text_even_on_a_colour_terminal():
    from rich.table import Table

    out = io.StringIO()
    screen = console(file=out, force_terminal=True, color_system=None, width=60)
    table = Table("[/a]", "\x1b]0;title\x07")
    table.add_row("[red]x", "\x9b")
    screen.print("[/b]", style="bold")
    screen.print(table)
    for text in ("[/a]", r"\x1b]0;title\x07", "[red]x", r"\x9b", "[/b]"):
        assert text in out.getvalue()
    assert "\x1b]" not in out.getvalue()


def test_lines_stay_lines(capsys):
    print_lines(["x" * 300, "", "[/c]"])
    assert capsys.readouterr().out.splitlines() == ["x" * 300, "", "[/c]"]


def test_a_terminal_shows_a_long_line_below_its_beginning_and_cuts_no_word():
    out = io.StringIO()
    told = "  the slip rate [m/s] stays below a-bound-as-long-as-a-path " + "and so on, " * 9 + "\x1b[31mto the end"
    screen = console(file=out, force_terminal=True, color_system=None, width=44)
    screen.print(told)
    screen.print("")
    *lines, last = out.getvalue().splitlines()
    assert last == ""
    assert " ".join(line.strip() for line in lines) == told.strip().replace("\x1b", r"\x1b")
    assert lines[0].startswith("  the slip")
    assert all(re.match(r"    \S", line) for line in lines[1:])
    assert max(map(len, lines)) <= 44


def test_nothing_else_prints_or_marks_up():
    """All text for people leaves through one console."""
    package = Path(quakedesign.__file__).parent
    for path in (*(package / "cli").glob("*.py"), *(package / "report").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\[/?(bold|red|dim|green)\]", text), path.name
        assert not re.search(r"markup=True|(?<!soft_wrap=)\bConsole\((?!stderr)", text) or path.name == "shared.py"
        plain = re.findall(r"(?<![\w.])(?<!def )print\((?!json\.dumps)(?!.*sys\.stderr)", text)
        assert not plain, f"{path.name} prints past the console"


def test_the_page_shows_text_as_text(tmp_path):
    from types import SimpleNamespace

    from quakedesign.fault import load_fault
    from quakedesign.report import page

    fault = load_fault(sourced(r"<script>\u001b\u202e</script>", tmp_path))
    empty = SimpleNamespace(fault=fault, entries=[], of=lambda _: [])
    template = page._environment().from_string("<h1>{{ fault.source }}</h1>{{ 3 }}{{ none }}")
    assert template.render(fault=empty.fault, none=None) == r"<h1>&lt;script&gt;\x1b\u202e&lt;/script&gt;</h1>3None"


def test_warnings_of_libraries_are_not_shown_to_users():
    """A program that warns and then refuses leaves one line."""
    program = (
        "import sys, warnings; sys.argv = ['quakedesign', 'fault', 'real-fault']\n"
        "import quakedesign.fault, quakedesign.cli as cli\n"
        "def warning(*_, **__):\n"
        "    import numpy; numpy.float64(1e300) * numpy.float64(1e300)\n"
        "    warnings.warn('from scipy'); raise quakedesign.errors.ScenarioError('refused')\n"
        "quakedesign.fault.load_fault = warning\n"
        "cli.main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (2, "quakedesign: refused\n")
