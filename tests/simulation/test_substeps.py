"""Substeps are a function that generated C calls in a loop: the digits of steps written out, in code of one size."""

import casadi as ca
import numpy as np
import pytest
from thinned import few

from quakedesign import load_fault, published
from quakedesign.loop import Actuator, Diffusion, simulation_scheme
from quakedesign.simulation import integrator
from quakedesign.simulation.closed_loop import WORKS, Meter, Variation
from quakedesign.simulation.compiled import _source, expanded, verbatim
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run_settings import _step, loop_class

LAB = load_fault("lab-fault")
LAW = published("lab-fault")["cta"]
METHOD = integrator("dormand-prince")


def step_of(substeps, cells=3):
    rock = Actuator(stages=(Diffusion(length=0.1, diffusivity=1.0, cells=cells),))
    scheme = simulation_scheme("explicit", substeps=substeps, actuator=rock)
    return _step(Recorder(loop_class("printed")(LAB, LAW), scheme, LAB.sampling_time), METHOD)


def written_out(loop, motion, given, state, step, times):
    """States and works after every step, one after the other."""
    for number in range(times):

        def one(plant, passed, now, before=number):
            return motion(plant, before + passed, now, given)

        state = loop.advance(METHOD, one, state, step)
    return state


@few("plant", ["printed", "stick-slip"], every=2)
@pytest.mark.parametrize("factors", [(), Variation(stiffness=1.07).values], ids=["nominal", "varied"])
def test_the_digits_are_those_of_steps_written_out(plant, factors):
    def motion(plant, passed, now, given):
        return ca.vertcat(plant(given[0] + passed / 7, now[:2], given[1]), (given[1] - now[2]) / 3)

    step, vector = 0.01, ca.SX.sym("z", 5 + len(WORKS) + len(factors))
    given, state, works = vector[:2], vector[2:5], vector[5 : 5 + len(WORKS)]
    varied = tuple(ca.vertsplit(vector[5 + len(WORKS) :]))
    ends = []
    for often in (lambda loop, *told: loop.advance_often(METHOD, *told), written_out):
        meter = Meter(loop_class(plant)(LAB, LAW).with_factors(varied), works)
        end = often(meter, motion, given, state, step, 7)
        ends.append(ca.Function("end", [vector], [ca.vertcat(end, meter.works)]))
    random = np.random.default_rng(3)
    for scale in (1e-6, 1e-3, 1.0):
        start = [*scale * random.standard_normal(5 + len(WORKS)), *factors]
        assert np.array_equal(np.array(ends[0](start)), np.array(ends[1](start)), equal_nan=True)


def test_the_code_does_not_grow_with_the_substeps():
    few, many = (len(_source(step_of(substeps))) for substeps in (11, 99))
    assert many - few < 5000  # characters; one substep written out takes 10 000


def test_the_code_of_a_substep_grows_evenly_with_the_cells():
    sizes = [step_of(99, cells).find_function("substep", 9).n_instructions() for cells in (3, 6, 9)]
    assert sizes[2] - sizes[1] == sizes[1] - sizes[0] > 0


@pytest.mark.parametrize("times", [2, 9, 10, 11, 100, 110])
def test_every_number_of_substeps_is_read_back(times):
    """CasADi names what it repeats otherwise where the number is a power of ten."""
    x = ca.SX.sym("x")
    substep = ca.Function("substep", [x], [2 * x + 1])
    with verbatim():
        step = ca.Function("step", [x], [substep.fold(times, {"never_inline": True})(x)])
    assert float(expanded(step)(0)) == float(2**times - 1)
