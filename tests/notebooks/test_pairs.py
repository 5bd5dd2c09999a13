"""Notebooks are numbered, paired with their percent-format text, stored without outputs, and end in an assertion."""

import ast
import re
from pathlib import Path

import jupytext
import pytest

FOLDER = Path(__file__).parent.parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)


def cells(path):
    return [(cell.cell_type, cell.source) for cell in jupytext.read(path).cells]


def test_every_text_has_a_notebook_and_the_other_way_round():
    assert NOTEBOOKS
    assert {p.stem for p in NOTEBOOKS} == {p.stem for p in FOLDER.glob("*.py")}


def test_numbers_count_from_one():
    assert [int(re.match(r"(\d\d)_", p.name)[1]) for p in NOTEBOOKS] == list(range(1, len(NOTEBOOKS) + 1))


@each
def test_notebook_equals_its_text(path):
    assert cells(path) == cells(path.with_suffix(".py"))


@each
def test_notebook_is_stored_without_outputs(path):
    notebook = jupytext.read(path)
    assert not any(c.get("outputs") or c.get("execution_count") for c in notebook.cells)
    assert notebook.metadata.kernelspec.name == "python3"


@each
def test_notebook_ends_in_an_assertion(path):
    kind, source = cells(path)[-1]
    assert kind == "code"
    assert isinstance(ast.parse(source).body[-1], ast.Assert)


WITHOUT_VALUE = {"print", "display", "plt.show", "plt.tight_layout", "np.savetxt"}
"""Calls that a cell may end in: a script shows the value of no other."""


@each
def test_a_script_shows_what_the_notebook_shows(path):
    """The value of an expression at the end of a cell is shown by a notebook alone, so `display` or `print` it."""
    for kind, source in cells(path):
        last = ast.parse(re.sub(r"(?m)^%.*$", "", source)).body[-1:] if kind == "code" else []
        for statement in last:
            if isinstance(statement, ast.Expr):
                assert isinstance(statement.value, ast.Call), ast.unparse(statement)
                assert ast.unparse(statement.value.func) in WITHOUT_VALUE, ast.unparse(statement)
