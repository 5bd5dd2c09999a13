import subprocess
import sys

COUNTED = """
import atexit, gc, sys
from quakedesign.__main__ import main
atexit.register(lambda: print("searches", sum(generation["collections"] for generation in gc.get_stats())))
sys.argv = ["quakedesign", "fault", "real-fault"]
main()
"""


def test_a_command_does_not_look_again_and_again_for_cycles_in_what_it_has_loaded():
    told = subprocess.run([sys.executable, "-c", COUNTED], capture_output=True, text=True, check=True).stdout
    assert int(told.split("searches")[1]) < 50
