"""Signals that end a command: one line and the exit code of the shell, whatever libraries make of them."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from quakedesign.cli import main
from quakedesign.files import write_whole
from quakedesign.parallel import SIGNALS, ending, remedy, signals_delayed


@pytest.fixture(autouse=True)
def _ordinary():
    """The signals of the tests themselves are ordinary ones, even in a job that ignores them."""
    before = {number: signal.signal(number, signal.default_int_handler) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def ended(block, capsys):
    with pytest.raises(SystemExit) as found, ending():
        block()
    assert all(signal.getsignal(number) is signal.default_int_handler for number in SIGNALS)
    return found.value.code, capsys.readouterr().err


def send(number):
    os.kill(os.getpid(), number)
    time.sleep(1)


@pytest.mark.parametrize(("number", "said"), SIGNALS.items(), ids=[number.name for number in SIGNALS])
def test_one_line_and_the_exit_code_of_the_shell(capsys, number, said):
    assert ended(lambda: send(number), capsys) == (128 + number, f"quakedesign: {said}; nothing was written.\n")


def test_what_a_library_makes_of_it_is_still_an_interruption(capsys):
    def block():
        try:
            send(signal.SIGTERM)
        except KeyboardInterrupt:
            raise ImportError("numpy.core.multiarray failed to import") from None

    assert ended(block, capsys) == (143, "quakedesign: terminated; nothing was written.\n")


def test_further_signals_do_not_disturb_the_end(capsys):
    done = []

    def block():
        try:
            send(signal.SIGTERM)
        finally:
            for number in SIGNALS:
                os.kill(os.getpid(), number)
            time.sleep(0.01)
            done.append("in order")

    assert ended(block, capsys)[0] == 143
    assert done == ["in order"]


def test_a_signal_waits_for_the_block_even_if_another_thread_receives_it(capsys):
    """As the thread that watches over the end does: a process that starts meanwhile would not be known."""
    done, over = [], threading.Event()
    other = threading.Thread(target=over.wait)
    other.start()

    def block():
        with signals_delayed():
            signal.pthread_kill(other.ident, signal.SIGTERM)
            for _ in range(20):  # bytecode, between which Python calls its handlers
                time.sleep(0.01)
            done.append("the block")
        done.append("what follows")

    code, said = ended(block, capsys)
    over.set()
    other.join()
    assert (code, done, said) == (143, ["the block"], "quakedesign: terminated; nothing was written.\n")


def test_an_ignored_signal_stays_ignored(capsys):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with ending():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    assert capsys.readouterr().err == ""


def test_a_process_that_goes_on_runs_the_next_command_as_before(capsys):
    """A caller that catches `SystemExit` takes an ended command for an answer without JSON; the next one is whole."""
    code, said = ended(lambda: send(signal.SIGTERM), capsys)
    assert (code, said) == (143, "quakedesign: terminated; nothing was written.\n")
    with pytest.raises(SystemExit) as found:
        main(["fault", "lab-fault", "--json"])
    out, err = capsys.readouterr()
    assert (found.value.code, err, json.loads(out)["name"]) == (0, "", "lab-fault")
    assert signal.set_wakeup_fd(-1) == -1


def test_inner_blocks_leave_the_signals_to_the_outer_one(capsys):
    def block():
        with ending():
            send(signal.SIGTERM)

    assert ended(block, capsys) == (143, "quakedesign: terminated; nothing was written.\n")


def test_what_was_written_is_not_denied(capsys, tmp_path):
    def block():
        write_whole(tmp_path / "result", "x")
        raise KeyboardInterrupt

    assert ended(block, capsys) == (130, "quakedesign: interrupted; all files written so far are complete.\n")


def test_a_command_may_say_how_to_go_on(capsys):
    def block():
        remedy("the same command\ngoes on")
        raise KeyboardInterrupt

    assert ended(block, capsys) == (130, "quakedesign: interrupted; the same command goes on.\n")


def test_other_errors_pass(capsys):
    with pytest.raises(ZeroDivisionError), ending():
        divmod(1, 0)
    assert capsys.readouterr().err == ""


GENERATED = """
from quakedesign.parallel import ending
with ending():
    exec("import signal; signal.raise_signal(signal.SIGTERM)")
"""


def test_the_exit_code_is_that_of_the_signal_even_within_generated_code(start, tmp_path):
    (tmp_path / "program.py").write_text(GENERATED)
    process = start("-m", "program")
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (143, "quakedesign: terminated; nothing was written.\n")


LATE = """
import atexit, signal, sys
from quakedesign.parallel import SIGNALS, ending
atexit.register(lambda: [signal.raise_signal(number) for number in SIGNALS])
with ending(process=True):
    sys.exit(1)
"""


def test_a_signal_after_the_end_changes_nothing(start):
    process = start("-c", LATE)
    assert process.communicate(timeout=60) == ("", "")
    assert process.returncode == 1


LOADED = """
import atexit, signal
from quakedesign.parallel import ending

class Loaded:
    def __del__(self):
        print("taken apart", flush=True)

kept = Loaded()
atexit.register(print, "in order")
with ending(process=True):
    signal.raise_signal(signal.SIGTERM)
"""


def test_after_a_signal_the_process_ends_without_being_taken_apart(start):
    process = start("-c", LOADED)
    assert process.communicate(timeout=60) == ("in order\n", "quakedesign: terminated; nothing was written.\n")
    assert process.returncode == 143


SWALLOWS = """
import time
from quakedesign.parallel import ending
from quakedesign.files import temporary_folder

with ending(), temporary_folder():
    while True:
        try:
            print("there", flush=True)
            time.sleep(600)
        except KeyboardInterrupt:
            pass
"""


def test_an_interruption_that_is_swallowed_ends_the_process_all_the_same(start, tmp_path):
    (tmp_path / "tmp").mkdir()
    process = start("-c", SWALLOWS, TMPDIR=tmp_path / "tmp")
    assert process.stdout.readline() == "there\n"
    assert os.listdir(tmp_path / "tmp")
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (143, "quakedesign: terminated; nothing was written.\n")
    assert not os.listdir(tmp_path / "tmp")


def test_an_interruption_that_python_can_only_report_ends_the_command_all_the_same():
    text = """
import os, signal, time
from quakedesign.parallel import ending

class Slow:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(30)

signal.signal(signal.SIGTERM, signal.SIG_DFL)
with ending(process=True):
    Slow()
    time.sleep(30)
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert (done.returncode, done.stderr) == (143, "quakedesign: terminated; nothing was written.\n")
