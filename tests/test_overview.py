"""The overview of all commands is what the application would print."""

from io import StringIO

import pytest
from rich.console import Console

from quakedesign.cli.app import app
from quakedesign.overview import overview, print_overview


@pytest.mark.parametrize("width", [60, 80, 133])
def test_the_overview_is_that_of_the_application(width):
    screen = Console(file=StringIO(), width=width, color_system=None)
    app.help_print([], console=screen)
    assert list(overview(width)) == [line.rstrip() for line in screen.file.getvalue().splitlines()]


@pytest.mark.parametrize(("columns", "printed"), [("80", True), ("59", False)])
def test_narrow_terminals_are_left_to_the_application(columns, printed, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    assert print_overview() is printed
    assert capsys.readouterr().out.startswith("Usage: quakedesign COMMAND\n") is printed
