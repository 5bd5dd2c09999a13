import os
import subprocess
import sys

import pytest

COUNTED = """
import atexit, gc, sys
from quakedesign.__main__ import main
atexit.register(lambda: print("searches", sum(generation["collections"] for generation in gc.get_stats())))
sys.argv = ["quakedesign", "fault", "real-fault"]
main()
"""


@pytest.mark.slow
def test_a_command_does_not_look_again_and_again_for_cycles_in_what_it_has_loaded():
    told = subprocess.run([sys.executable, "-c", COUNTED], capture_output=True, text=True, check=True).stdout
    assert int(told.split("searches")[1]) < 50


@pytest.mark.slow
@pytest.mark.parametrize("asked", [None, "2"])
def test_a_command_has_one_thread_of_linear_algebra_unless_it_is_told_another_number(asked):
    """Of small matrices threads wait for another: most of the time of a guarantee on a busy machine."""
    threads = 'import os; atexit.register(lambda: print("threads", os.environ["OMP_NUM_THREADS"]))'
    told = COUNTED.replace("sys.argv", f"{threads}\nsys.argv")
    around = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    given = {} if asked is None else {"OMP_NUM_THREADS": asked}
    said = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True, env=around | given)
    assert f"threads {asked or 1}" in said.stdout
