"""Every test asserts something itself."""

import ast
from pathlib import Path

ROOT = Path(__file__).parent.parent


def asserts(function):
    """Whether a test says what is true: by an assertion, NumPy's among them, or an error that it expects."""
    called = {node.attr for node in ast.walk(function) if isinstance(node, ast.Attribute)}
    plain = any(isinstance(node, ast.Assert) for node in ast.walk(function))
    return plain or bool(called & {"raises", "warns", "assert_allclose"})


def test_every_test_asserts_something():
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "tests").rglob("test_*.py")}
    functions = [
        (path.name, node)
        for path, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]
    assert len(functions) > 1000
    assert [(file, node.name) for file, node in functions if not asserts(node)] == []


VAGUE = ("Received others", "Leave it out", "Leave them out", "Change them", "Complete them", "Check their signs")
"""Ends of messages that do not say which quantity is meant."""


def test_messages_name_the_quantity_in_their_remedy():
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "quakedesign").rglob("*.py")}
    assert len(texts) > 200
    assert [(path.name, text) for path, said in texts.items() for text in VAGUE if text in said] == []
