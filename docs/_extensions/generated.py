"""Tables that are written from the program itself, and the notebooks as pages."""

import json
import shutil
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList

DOCS = Path(__file__).parents[1]


def _fault_file():
    """Rows of the keys of a fault file: table, key, type, meaning."""
    from quakedesign.fault.template import fault_schema

    schema = fault_schema()
    yield from _keys("", schema)
    for table in ("task", "disturbance"):
        yield from _keys(f"[{table}]", schema["properties"][table])
    yield from _keys("[uncertainty]", schema["properties"]["uncertainty"]["oneOf"][1])
    for law in schema["properties"]["friction"]["oneOf"]:
        yield from _keys(f'[friction], law = "{law["properties"]["law"]["const"]}"', law)


def _keys(table, schema):
    for key, said in schema["properties"].items():
        if key in ("friction", "task", "disturbance", "law"):
            continue
        example = json.dumps(said["examples"][0]) if "examples" in said else ""
        yield table, key, "yes" if key in schema["required"] else "", example, said.get("description", "")


def _names():
    """Rows of the public names: name, first line of its docstring."""
    import inspect

    import quakedesign

    for name in quakedesign.__all__:
        said = inspect.getdoc(getattr(quakedesign, name)) or ""
        yield f"quakedesign.{name}", said.split("\n\n")[0].replace("\n", " ")


TABLES = {
    "fault-file": (("table", "key", "needed", "example", "meaning"), _fault_file),
    "names": (("name", "does"), _names),
}


class GeneratedTable(Directive):
    """``.. generated-table:: NAME``."""

    required_arguments = 1

    def run(self):
        """Return the table."""
        head, rows = TABLES[self.arguments[0]]
        lines = [".. list-table::", "   :header-rows: 1", ""]
        for row in (head, *rows()):
            for i, cell in enumerate(row):
                said = cell.replace("*", r"\*").replace("|", r"\|").replace("_ ", r"\_ ")
                plain = row is head or i == len(row) - 1 or not cell
                lines.append(f"   {'* -' if i == 0 else '  -'} {said if plain else f'``{cell}``'}".rstrip())
        parent = nodes.container()
        self.state.nested_parse(StringList(lines, "generated"), self.content_offset, parent)
        return parent.children


def _bring_notebooks(app):
    source, target = DOCS.parent / "notebooks", DOCS / "tutorial"
    for path in sorted(source.glob("*.ipynb")):
        shutil.copy(path, target / path.name)
    shutil.copytree(source / "own", target / "own", dirs_exist_ok=True)


def _write_commands(_app):
    from quakedesign.cli import app

    told = app.generate_docs(output_format="markdown", usage_name="quakedesign")
    (DOCS / "reference" / "_commands.md").write_text(told[told.index("**Commands**") :], encoding="utf-8")


def _keep_bars(_app, _what, _name, _item, _options, lines):
    """Docstrings write sizes as |h'|, which would be a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Register directive, copy and care for bars."""
    app.connect("autodoc-process-docstring", _keep_bars, priority=900)
    app.add_directive("generated-table", GeneratedTable)
    app.connect("builder-inited", _bring_notebooks)
    app.connect("builder-inited", _write_commands)
    return {"parallel_read_safe": True}
