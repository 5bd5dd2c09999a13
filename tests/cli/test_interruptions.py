"""Commands killed at random moments: nobody is left, nothing temporary, and nothing half-written."""

import json
import os
import random
import signal
import subprocess
import time

import numpy as np
import psutil
import pytest

from quakedesign.files import FAMILY

MAP = "map super-twisting --gains 1.5 1.1 --over k1 k2 --points 5 --lipschitz 1 --interior 2 --workers 2 --out out"
GAINS = "synthesise super-twisting --workers 2 --starts 2 --out out"
CAMPAIGN = "campaign lab-fault --samples 40 --duration 60 --workers 2 --out out"
ALONE = "simulate lab-fault --scheme explicit --duration 60 --out out"
WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
READY = """
import sys
from quakedesign.parallel import ending
with ending(process=True):
    print("ready", flush=True)
    from quakedesign.__main__ import main
    main()
"""
TIMEOUT = 5  # seconds: nobody is left after these


@pytest.fixture
def run(start, tmp_path):
    """Starts a command that receives its signals from now on; its temporary files lie in a folder of their own."""
    for name in ("tmp", "work"):
        (tmp_path / name).mkdir()

    def begin(command):
        process = start("-c", READY, *command.split(), folder=tmp_path / "work", TMPDIR=tmp_path / "tmp")
        assert process.stdout.readline() == "ready\n"
        return process

    return begin


def temporary(folder):
    return [path for path in folder.rglob("*") if path.parent.name == "tmp" or path.name.startswith(FAMILY)]


def half_written(folder):
    """Files of a folder that are not whole."""
    found = []
    for path in (path for path in folder.rglob("*") if path.is_file() and FAMILY not in str(path)):
        try:
            if path.suffix == ".npz":
                with np.load(path) as held:
                    assert len(held["ends"]) == len(held["starts"])
            elif path.suffix == ".json" or (path.name == "out" and path.read_bytes()[:1] == b"{"):
                json.loads(path.read_text())
            else:
                assert path.stat().st_size
        except (ValueError, AssertionError, KeyError):
            found.append(path)
    return found


def begun(run, tmp_path, command):
    return run(f"{command} --force" if (tmp_path / "work" / "out").exists() else command)


def kill(run, tmp_path, command, number, delay):
    """Kill a command after a delay [s]; whether it was still at work."""
    process = begun(run, tmp_path, command)
    time.sleep(delay)
    return end(process, tmp_path, number)


def end(process, tmp_path, number):
    """End a command by a signal; whether it was still at work."""
    process.send_signal(number)
    out, err = process.communicate(timeout=TIMEOUT)
    assert not half_written(tmp_path)
    if number == signal.SIGKILL:
        return process.returncode == -signal.SIGKILL
    assert not temporary(tmp_path)
    if process.returncode in (0, 1):
        assert (out, err) != ("", "")
        return False
    assert process.returncode == 128 + number
    assert err.startswith(f"quakedesign: {WORDS[number]}; ")
    assert err.count("\n") == 1
    return True


def at_work(process, workers):
    """Wait until a command has started so many workers, beside the process that tracks their resources."""
    while len(psutil.Process(process.pid).children()) <= workers:
        assert process.poll() is None
        time.sleep(0.05)


def tidy(run, tmp_path, command):
    """The next start removes what SIGKILL left."""
    left, end = temporary(tmp_path), time.monotonic() + 60
    process = begun(run, tmp_path, command)
    while any(path.exists() for path in left) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=TIMEOUT)
    assert not temporary(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "number"),
    [(MAP, signal.SIGTERM), (GAINS, signal.SIGINT), (CAMPAIGN, signal.SIGKILL)],
    ids=["map", "synthesise", "campaign"],
)
def test_a_kill_leaves_nobody_and_nothing(run, tmp_path, command, number):
    process = run(command)
    at_work(process, 2)
    assert end(process, tmp_path, number)
    if number == signal.SIGKILL:
        tidy(run, tmp_path, command)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda number: number.name)
@pytest.mark.parametrize("command", [MAP, GAINS, CAMPAIGN, ALONE], ids=lambda command: command.split()[0])
def test_five_kills_at_random_moments(run, tmp_path, command, number):
    """Sixty in all; the moments reach from the first import to the last file."""
    chance = random.Random(f"{command}{number}")
    length = _length(run, tmp_path, command)
    killed = [kill(run, tmp_path, command, number, chance.uniform(0, length)) for _ in range(5)]
    assert any(killed)
    tidy(run, tmp_path, command)


def _length(run, tmp_path, command):
    """Time that a command takes now [s]; its results are there to be replaced."""
    began = time.monotonic()
    process = run(command)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert not temporary(tmp_path)
    return time.monotonic() - began


def test_an_interruption_ends_with_one_line(start):
    process = start("-m", "quakedesign", *GAINS.split())
    at_work(process, 2)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err == "quakedesign: interrupted; nothing was written.\n"


@pytest.mark.slow
def test_a_job_in_the_background_is_not_interrupted(start):
    """A shell lets such jobs ignore SIGINT, and nohup SIGHUP; SIGTERM ends them."""
    process = start("-m", "quakedesign", *GAINS.split(), ignored=("SIGINT", "SIGHUP"))
    at_work(process, 2)
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGINT):
        process.send_signal(number)
    with pytest.raises(subprocess.TimeoutExpired):
        process.communicate(timeout=2)
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (143, "quakedesign: terminated; nothing was written.\n")
