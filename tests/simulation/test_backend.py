"""The C compiler ends with what asked for it, and leaves nothing behind."""

import os
import signal

import psutil
import pytest

from quakedesign.files import temporary_folder
from quakedesign.simulation import compiled as backend

COMPILER = """#!/bin/sh
touch "$TMPDIR/of-the-compiler"
sleep 600 &
echo $! > "{told}"
wait
"""
PROGRAM = """
import sys
from pathlib import Path
from quakedesign.parallel import ending
from quakedesign.simulation.compiled import shared_library
from quakedesign.files import temporary_folder

with ending(process=True), temporary_folder() as folder:
    shared_library("int i;", folder, (sys.argv[1],))
"""


def compiler(tmp_path, text):
    path = tmp_path / "compiler"
    path.write_text(text)
    path.chmod(0o755)
    return path


def test_an_interruption_ends_the_compiler_and_those_that_it_started(start, tmp_path):
    (tmp_path / "tmp").mkdir()
    told = tmp_path / "told"
    process = start("-c", PROGRAM, compiler(tmp_path, COMPILER.format(told=told)), TMPDIR=tmp_path / "tmp")
    while not told.exists() or not told.read_text().endswith("\n"):
        assert process.poll() is None, process.stderr.read()
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (143, "quakedesign: terminated; nothing was written.\n")
    started = int(told.read_text())
    assert not psutil.pid_exists(started) or psutil.Process(started).status() == psutil.STATUS_ZOMBIE
    assert os.listdir(tmp_path / "tmp") == []


def test_what_a_compiler_says_when_it_fails_is_the_reason(tmp_path):
    path = compiler(tmp_path, "#!/bin/sh\necho no room >&2\nexit 3\n")
    with temporary_folder(tmp_path) as folder, pytest.raises(backend.subprocess.CalledProcessError) as raised:
        backend.shared_library("int i;", folder, (str(path),))
    assert (raised.value.returncode, raised.value.stderr) == (3, b"no room\n")
