"""Names of commands and options for the shell."""

import sys
from typing import Literal

from quakedesign.cli.shared import app


@app.command
def completion(shell: Literal["bash", "zsh", "fish"], /) -> int:
    """Print a script that completes commands and options in a shell.

    For example: quakedesign completion bash > ~/.local/share/bash-completion/completions/quakedesign

    Parameters
    ----------
    shell
        bash, zsh or fish.
    """
    sys.stdout.write(app.generate_completion(shell=shell) + "\n")
    return 0
