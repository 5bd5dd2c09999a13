"""Names of commands and options for the shell."""

import sys
from typing import Literal

from quakedesign.cli.options import PLAIN, Output
from quakedesign.cli.shared import app


@app.command
def completion(shell: Literal["bash", "zsh", "fish"], /, *, output: Output = PLAIN) -> int:
    """Print a script that completes commands and options in a shell.

    For example: quakedesign completion bash > ~/.local/share/bash-completion/completions/quakedesign

    Parameters
    ----------
    shell
        bash, zsh or fish.
    """
    script = app.generate_completion(shell=shell)
    output.show({"shell": shell, "script": script}, lambda: sys.stdout.write(f"{script}\n"))
    return 0
