"""Samples in lanes have the digits of one alone, on every processor and without a compiler."""

import ctypes
import re
from dataclasses import replace

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop import Actuator, Diffusion, simulation_scheme
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign.problem import Library, mover
from quakedesign.simulation.compiled import LANE_FLAGS, compiler, processor_flags, shared_library

LAB = load_fault("lab-fault", box="ten-percent")
NOISY = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-7))
ROCK = Actuator(stages=(Diffusion(length=0.1, diffusivity=1.0, cells=2),))
PUSHED = simulation_scheme("implicit", substeps=3, actuator=ROCK)
COUNT, STEPS = 11, 150
SETS = [("-DLANES=1",), ("-DLANES=8",), ("-DLANES=5", "-mavx2"), processor_flags(compiler())]


def problem(law, scheme):
    options = {"scheme": scheme, "duration": 1, "initial_slip": 1e-4, "plant": "printed"}
    return campaign_problem(LAB, published("lab-fault")[law], **options)


def starts(of):
    return np.array([of.start(of.sample(i)) for i in range(COUNT)])


def moved(library, vectors, steps):
    advance = ctypes.CDLL(str(library)).advance_samples
    advance.argtypes = [ctypes.c_void_p, ctypes.c_longlong, ctypes.c_longlong]
    assert advance(vectors.ctypes.data, len(vectors), steps) == 0
    return vectors


def without_compiler(program, vectors, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    mover.cache_clear()
    mover(program)(vectors, STEPS)
    mover.cache_clear()
    return vectors


@pytest.mark.slow
def test_the_digits_do_not_depend_on_the_lanes_nor_on_the_processor(monkeypatch, tmp_path):
    """On the verge of instability some samples diverge, each at its own time (ERRATA 22)."""
    of = problem("elqr", NOISY)
    ends = []
    for number, flags in enumerate(SETS):
        folder = tmp_path / str(number)
        folder.mkdir()
        library = shared_library(of.program.source, folder, compiler(), (*LANE_FLAGS, *flags))
        ends.append(moved(library, moved(library, starts(of), 40), STEPS - 40))
    times = ends[0][:, of.program.diverged]
    assert 1 < len({*times}) < COUNT + 1
    assert (times < 0).any()
    assert all(end.tobytes() == ends[0].tobytes() for end in ends)
    assert without_compiler(of.program, starts(of), monkeypatch).tobytes() == ends[0].tobytes()


@pytest.mark.slow
def test_branches_and_substeps_have_the_digits_of_the_virtual_machine(monkeypatch, tmp_path):
    of = problem("cta", PUSHED)
    assert "times < 3" in of.program.source
    assert "if (any)" in of.program.source
    library = of.program.compiled(tmp_path).library
    end = moved(library.path, starts(of), STEPS)
    assert np.isfinite(end[:, :4]).all()
    assert without_compiler(of.program, starts(of), monkeypatch).tobytes() == end.tobytes()


def test_no_function_of_the_c_library_decides_a_digit():
    """But for the remainder, which is exact, and the root, which IEEE 754 rounds."""
    called = set(re.findall(r"(?<![\w])([a-z]\w*)\(", problem("dia", PUSHED).program.source))
    own = {
        name
        for name in called
        if name.startswith(
            ("portable_", "one_step", "advance_", "exponent_of", "mantissa_of", "near_cube_root", "two_to")
        )
    }
    assert called - own <= {"sqrt", "fabs", "memcpy", "for", "if", "while", "defined", "made_for_this_processor"} | {
        "always_inline",
        "dllexport",
        "optimize",
        "__attribute__",
        "__declspec",
        "visibility",
        "__builtin_cpu_supports",
    }


def test_the_innermost_loops_are_vectors(tmp_path):
    """Roots of two lanes at once and more, on x86."""
    source = problem("cta", "explicit").program.source
    shared_library(source, tmp_path, compiler(), (*LANE_FLAGS, "-S"))
    text = (tmp_path / "steps.so").read_text()
    assert "sqrtpd" in text
    assert "sqrtsd" not in text


def test_a_library_for_another_processor_is_built_anew(tmp_path):
    of = problem("elqr", "explicit")
    text = "int made_for_this_processor(void) { return 0; } int advance_samples(void) { return 1; }"
    other = Library.of(shared_library(text, tmp_path, compiler()))
    program = replace(of.program, library=other)
    vectors = starts(of)
    mover(program)(vectors, 5)
    assert vectors[:, 0].tolist() == [5.0] * COUNT


def test_a_compiler_that_cannot_tell_gets_no_flags():
    assert processor_flags(("no-such-compiler",)) == ()
    assert processor_flags(("false",)) == ()
