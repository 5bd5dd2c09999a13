"""What the commands do, a line each: read off their sources, because loading them for ``--help`` takes longer."""

import ast
import os
import sys
from collections.abc import Iterator

_NARROWEST = 60
_OPTIONS = {"--help (-h)": "Display this message and exit.", "--version": "Display application version."}


def print_overview() -> bool:
    """Print it on stdout, if that takes it."""
    width = _width()
    if width < _NARROWEST or not (sys.stdout.encoding or "").lower().startswith("utf"):
        return False
    try:
        print("\n".join(overview(width)), flush=True)
    except OSError:
        return False
    return True


def overview(width: int) -> Iterator[str]:
    """Lines of at most a width."""
    folder = os.path.join(os.path.dirname(__file__), "cli")
    with os.scandir(folder) as files:
        sources = {file.name: _tree(file.path) for file in files if file.name.endswith(".py")}
    told = dict(sorted(entry for tree in sources.values() for entry in _commands(tree))) | _OPTIONS
    longest = max(map(len, told))
    yield "Usage: quakedesign COMMAND"
    yield ""
    yield from _wrapped(_purpose(sources["app.py"]), width)
    yield ""
    yield f"╭─ Commands {'─' * (width - 13)}╮"
    for name, what in told.items():
        for i, line in enumerate(_wrapped(what, width - longest - 6)):
            yield f"│ {'' if i else name:{longest}}  {line:{width - longest - 6}} │"
    yield f"╰{'─' * (width - 2)}╯"


def _width() -> int:
    """Columns of the terminal; 80 without one."""
    if (given := os.environ.get("COLUMNS", "")).isdecimal():
        return int(given)
    for stream in (0, 1, 2):
        try:
            return os.get_terminal_size(stream).columns or 80
        except OSError:
            continue
    return 80


def _tree(path: str) -> ast.Module:
    with open(path, encoding="utf-8") as file:
        return ast.parse(file.read())


def _commands(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Name and first paragraph of every function that ``app.command`` decorates."""
    for node in tree.body:
        for decorator in getattr(node, "decorator_list", ()):
            call = decorator if isinstance(decorator, ast.Call) else ast.Call(decorator, [], [])
            if isinstance(node, ast.FunctionDef) and ast.unparse(call.func) == "app.command":
                named = [ast.literal_eval(word.value) for word in call.keywords if word.arg == "name"]
                paragraph = (ast.get_docstring(node) or "").partition("\n\n")[0]
                yield [*named, node.name.replace("_", "-")][0], " ".join(paragraph.replace("`", "").split())


def _purpose(tree: ast.Module) -> str:
    """What the application is for."""
    calls = (node.value for node in tree.body if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call))
    return str(next(ast.literal_eval(word.value) for call in calls for word in call.keywords if word.arg == "help"))


def _wrapped(text: str, width: int) -> list[str]:
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > width:
            lines.append(word)
        else:
            lines[-1] = f"{lines[-1]} {word}".lstrip()
    return lines
