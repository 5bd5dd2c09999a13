"""Tables that are written from the program itself, and the notebooks as pages.

``python docs/_extensions/generated.py`` writes the tables into their pages again.
"""

import json
import re
import shutil
from pathlib import Path

DOCS = Path(__file__).parents[1]


def _fault_file():
    """Rows of the keys of a fault file: table, key, type, meaning."""
    from quakedesign.fault.fault_schema import fault_schema

    schema = fault_schema()
    yield from _keys("", schema)
    for table in ("task", "disturbance"):
        yield from _keys(f"[{table}]", schema["properties"][table])
    yield from _keys("[uncertainty]", schema["properties"]["uncertainty"]["oneOf"][1])
    for law in schema["properties"]["friction"]["oneOf"]:
        yield from _keys(f'[friction], law = "{law["properties"]["law"]["const"]}"', law)


def _keys(table, schema):
    for key, entry in schema["properties"].items():
        if key in ("friction", "task", "disturbance", "law"):
            continue
        example = json.dumps(entry["examples"][0]) if "examples" in entry else ""
        yield table, key, "yes" if key in schema["required"] else "", example, entry.get("description", "")


def _names():
    """Rows of the public names: name, first line of its docstring."""
    import inspect

    import quakedesign

    for name in quakedesign.__all__:
        said = inspect.getdoc(getattr(quakedesign, name)) or ""
        yield f"quakedesign.{name}", said.split("\n\n")[0].replace("\n", " ")


def _commands():
    """Rows of the commands: name, what it does."""
    from quakedesign.cli.app import app

    for name in sorted(name for name in app if not name.startswith("-")):
        yield f"quakedesign {name}", " ".join(app[name].help.split("\n\n")[0].split())


TABLES = {
    "reference/fault_file.md": (("table", "key", "needed", "example", "meaning"), _fault_file),
    "reference/api.md": (("name", "does"), _names),
    "reference/commands.md": (("command", "does"), _commands),
}
"""Head and rows of the table of a page."""
TABLE = re.compile(r"(?<=<!-- written by docs/_extensions/generated.py -->\n\n)(?:\|.*\n)*")


def regenerated(page):
    """Text of a page with its table as the program has it today."""
    head, rows = TABLES[page]
    lines = [_row(head), "|---" * len(head) + "|"]
    for *cells, said in rows():
        lines.append(_row([*(cell if cell in ("", "yes") else f"`{cell}`" for cell in cells), _escaped(said)]))
    return TABLE.sub(lambda _: "\n".join([*lines, ""]), (DOCS / page).read_text(encoding="utf-8"))


def _row(cells):
    return f"| {' | '.join(cells)} |"


def _escaped(text):
    return re.sub(r"([*|<])", r"\\\1", text)


def _bring_notebooks(app):
    source, target = DOCS.parent / "notebooks", DOCS / "tutorial"
    for path in sorted(source.glob("*.ipynb")):
        shutil.copy(path, target / path.name)
    shutil.copytree(source / "own", target / "own", dirs_exist_ok=True)


def _write_commands(_app):
    from quakedesign.cli.app import app

    told = app.generate_docs(output_format="markdown", usage_name="quakedesign")
    told = told[told.index("**Commands**") :].replace(" -m sphinx ", " ")  # how this process was started
    (DOCS / "reference" / "_commands.md").write_text(told, encoding="utf-8")


def _keep_bars(_app, _what, _name, _item, _options, lines):
    """Docstrings write sizes as |h'|, which would be a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Register copies and care for bars."""
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
    app.connect("builder-inited", _bring_notebooks)
    app.connect("builder-inited", _write_commands)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    for name in TABLES:
        (DOCS / name).write_text(regenerated(name), encoding="utf-8")
