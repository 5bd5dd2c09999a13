"""Linter and type checker are green."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


TOOLS = {
    "lint": ("ruff", "check", "--no-cache", "."),
    "format": ("ruff", "format", "--check", "--no-cache", "."),
    "types": ("mypy",),
}


@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_tool_is_green(tool):
    call = [sys.executable, "-m", *tool]
    done = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stdout + done.stderr
