"""Random tests are reproducible and have no deadline; every worker computes on one thread."""

import contextlib
import gc
import os
import signal
import subprocess
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["QUAKEDESIGN_CACHE"] = "off"  # tests compute, and do not use the user's cache

import pytest
from hypothesis import settings

sys.set_int_max_str_digits(640)  # the minimum: `str` of a long exact number fails early
for name, examples in (("reproducible", 25), ("thorough", 100)):  # the second with --hypothesis-profile=thorough
    settings.register_profile(name, max_examples=examples, derandomize=True, print_blob=True, deadline=None)
settings.load_profile("reproducible")

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / "tests" / "data"))  # user-defined parts, `own_parts`
sys.path.append(str(ROOT / "benchmarks"))  # studies beside the package
sys.path.append(str(ROOT / "notebooks"))  # modules of the notebooks, `own`
LAUNCH = """
import os, signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):
    signal.signal(getattr(signal, name), signal.SIG_IGN if name in sys.argv[1].split(",") else signal.SIG_DFL)
os.execv(sys.executable, [sys.executable, *sys.argv[2:]])
"""


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Ten thousand tests are created, none of which is garbage; garbage is collected at the end of each file."""
    gc.disable()
    yield
    gc.freeze()
    gc.set_threshold(20_000)
    gc.enable()


NOTEBOOK = "02_equations_and_scaling.ipynb"
"""Notebook that runs by default; the others run with -m slow."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """The longest files first, so that no worker ends with one of them alone."""
    moving = [item.nodeid for item in items if " at 0x" in item.nodeid]
    if moving:
        raise pytest.UsageError(f"a name with an address differs from worker to worker: {moving[0]}")
    for item in items:
        if item.path.suffix == ".ipynb" and item.path.name != NOTEBOOK:
            item.add_marker("slow")
    items.sort(key=lambda item: (item.path.suffix != ".ipynb", item.path.name != "test_cli.py"))


@pytest.fixture(scope="module", autouse=True)
def _no_warning_wanders():
    """Warnings about unclosed resources of a test file are raised in that file."""
    yield
    gc.collect()
    gc.freeze()  # remaining objects are not searched again


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Results that another file has searched, compiled, run or drawn are cached in one folder of all workers.

    For tests of output. A test of a computation computes.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "kept"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("QUAKEDESIGN_CACHE", str(folder))
        yield


@pytest.fixture
def start(tmp_path):
    """Starts Python with some arguments, in its own session and with its own signals; always ends and closes it.

    Its workers hold its stderr, so that `communicate` returns when the last of them is gone.
    """
    started = []

    def begin(*arguments, folder=tmp_path, ignored=(), **environment):
        where = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        process = subprocess.Popen(
            [sys.executable, "-c", LAUNCH, ",".join(ignored), *map(str, arguments)],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": where} | {name: str(value) for name, value in environment.items()},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        with contextlib.suppress(ProcessLookupError):  # the session has no processes left
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
        process.stderr.close()
