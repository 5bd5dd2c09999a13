"""Runs and machine code from the disk: the same digits, of the same question only."""

from pathlib import Path

import numpy as np
import pytest

from quakedesign import cache
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.simulation import compiled as backend
from quakedesign.simulation import run_settings as running
from quakedesign.simulation import simulate
from quakedesign.simulation import stepping as kept_runs

REAL = load_fault("real-fault")
LAW = published("real-fault")["cta"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to keep things in; every run is long enough, and nothing is in memory."""
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    monkeypatch.setattr(backend, "_WORTH", 0)
    monkeypatch.setattr(kept_runs, "LONG", 0)
    backend._compile.cache_clear()
    simulate(REAL, LAW, duration=1.0, compiled=False)  # its peak without control, which is not kept
    return tmp_path / "kept"


def never(*_arguments, **_named):
    raise AssertionError("computed again")


def test_a_run_is_computed_once(folder, monkeypatch):
    first = simulate(REAL, LAW, duration=20.0)
    if first.provenance["backend"] != "compiled":
        assert not folder.exists()
        return
    monkeypatch.setattr(running, "march", never)
    monkeypatch.setattr(running, "prepare", never)
    again = simulate(REAL, LAW, duration=20.0)
    assert np.array_equal(again.slip, first.slip)
    assert np.array_equal(again.pressure, first.pressure)
    assert again.metrics.peak_slip_rate == first.metrics.peak_slip_rate
    assert again.provenance["backend_reason"] == first.provenance["backend_reason"] + "; from the cache"
    for other in ({"duration": 20.184}, {"duration": 20.0, "samples": 50}, {"duration": 20.0, "scheme": "explicit"}):
        with pytest.raises(AssertionError, match="computed again"):
            simulate(REAL, LAW, **other)


@pytest.mark.slow
def test_machine_code_is_compiled_once_by_one_compiler(folder, monkeypatch, tmp_path):
    if simulate(REAL, LAW, duration=20.0).provenance["backend"] != "compiled":
        return
    backend._compile.cache_clear()
    with monkeypatch.context() as alone:
        alone.setattr(backend, "shared_library", never)
        assert simulate(REAL, LAW, duration=30.0).provenance["backend"] == "compiled"
    other = tmp_path / "other"
    other.write_text(f'#!/bin/sh\nexec {backend.compiler()[0]} "$@"\n')
    other.chmod(0o755)
    monkeypatch.setenv("CC", str(other))
    monkeypatch.setattr(backend, "shared_library", never)
    with pytest.raises(AssertionError, match="computed again"):
        simulate(REAL, LAW, duration=40.0)


def test_a_short_run_is_not_kept(folder, monkeypatch):
    monkeypatch.setattr(kept_runs, "LONG", 10**12)
    simulate(REAL, LAW, duration=20.0)
    assert not list(Path(folder).glob("run-*"))
