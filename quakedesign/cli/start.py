"""The command with which a fault of one's own begins."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from quakedesign.cli.options import PLAIN, Force, Output
from quakedesign.cli.shared import app, new_file


@app.command
def init(
    file: Path = Path("my-fault.toml"),
    /,
    *,
    law: str = "exponential-slip-weakening",
    schema: Annotated[bool, Parameter(negative="")] = False,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Write a commented fault file to start from: every key with its unit, and what happens if it is left out.

    Parameters
    ----------
    file
        Path of the .toml file.
    law
        Friction law.
    schema
        Write a JSON Schema beside it too, with which editors complete and check TOML.
    """
    import json

    from quakedesign.errors import OutputError
    from quakedesign.fault.template import SCHEMA_NAME, fault_schema, template
    from quakedesign.output import write_whole

    if file.suffix != ".toml":
        raise OutputError(f"the file of a fault must end in .toml. Received {file}. Write {file.stem or 'fault'}.toml.")
    beside = file.parent / SCHEMA_NAME if schema else None
    text = template(law, schema=schema)
    for path in (file, beside):
        new_file(path, "fault file" if path == file else "schema", force=force)
    write_whole(file, text)
    if beside is not None:
        write_whole(beside, json.dumps(fault_schema(), indent=1, ensure_ascii=False) + "\n")
    written = [str(path) for path in (file, beside) if path is not None]
    facts = {"file": str(file), "schema": str(beside) if beside else None}
    output.show(facts, [f"written: {', '.join(written)}", f"next: edit it, then quakedesign fault {file}"])
    return 0
