"""Exported controllers: C against Python digit for digit, and against the simulated loop."""

import ctypes
import json
import os
import subprocess
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign.errors import OutputError, ParameterError, UnsupportedError
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof, compensated, design_compensated
from quakedesign.guarantees.exact.guarantee_files import load_guarantee, save_guarantee
from quakedesign.guarantees.search.compensated_search import implicit_pull, recovered
from quakedesign.laws import (
    ErrorModel,
    ImplicitStep,
    RestLimit,
    SampledController,
    SampledLaw,
    control_law,
    disturbance_estimate,
    published,
    slip_observer,
    summed_integrals,
)
from quakedesign.laws import compensated as compensated_law
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.loop import simulation_scheme
from quakedesign.loop.actuators.chain import Actuator
from quakedesign.loop.actuators.delay import Delay
from quakedesign.loop.actuators.lag_and_diffusion import Lag
from quakedesign.loop.actuators.pump_limits import RateLimit, Saturation
from quakedesign.loop.sensing import Averaging, Differentiator, OutputFeedback, Transducer
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.plant import uncertain_plant
from quakedesign.simulation import simulate
from quakedesign.simulation.export import FILES, _comment, _remarks, _sizes, controller_step, export_controller
from quakedesign.studies.single_runs import certified_choice

LAB = load_fault("lab-fault")
PUBLISHED = published("lab-fault")
FEED_FORWARD = PUBLISHED["cta"].with_feedforward(feed_forward("nominal", LAB, PUBLISHED["cta"].divisor))
LIMITED = Actuator(stages=(Delay(samples=2), RateLimit(rate=1e8), Saturation(lowest=-9e4, highest=9e4)))
SENSED = OutputFeedback(
    stages=(Transducer(deviation=1e-6), Averaging(samples=2)),
    differentiator=Differentiator(bound=100.0, step=1e-3, filter_order=1),
)
SAMPLED = SampledController(
    law=disturbance_estimate(
        (F(149400000), F(460800)),
        F("0.4"),
        ErrorModel.delayed(((F(1), F(0)), (F("0.6"), F("0.99"))), ((F(0), F("0.000995")),), F("0.002")),
    ),
    step=F(1, 1000),
)
OBSERVER = SampledController(
    law=slip_observer(
        (F(149400000), F(460800)),
        (F("0.9"), F(700), F(80000)),
        ErrorModel.delayed(((F(1), F("0.001")), (F("0.6"), F("0.99"))), ((F("5e-7"), F("0.000995")),), F("0.002")),
    ),
    step=F(1, 1000),
)
LIMIT = RestLimit(width=F(2000), per_slip=F(10**7), resolution=F(1, 10**6))
CASES = {
    "observer": (OBSERVER, "explicit", {}),
    "sampled": (SAMPLED, "explicit", {}),
    "sampled, with a limit": (replace(SAMPLED, rest_limit=LIMIT), "explicit", {}),
    "cta": (PUBLISHED["cta"], "explicit", {}),
    "dia": (PUBLISHED["dia"], "explicit", {}),
    "elqr": (PUBLISHED["elqr"], "explicit", {}),
    "cta feed-forward": (FEED_FORWARD, "explicit", {}),
    "cta implicit": (PUBLISHED["cta"], "implicit", {}),
    "dia compensated": (PUBLISHED["dia"], "compensated", {}),
    "elqr implicit": (PUBLISHED["elqr"], "implicit", {}),
    "cta limited": (PUBLISHED["cta"], "explicit", {"actuator": LIMITED}),
    "cta sensed": (PUBLISHED["cta"], "explicit", {"measurement": SENSED}),
    "dia semi-implicit sensed": (PUBLISHED["dia"], "semi-implicit", {"measurement": SENSED}),
}
Numbers = ctypes.POINTER(ctypes.c_double)


def compiled(folder, *flags):
    """Functions of the header from a shared library, compiled as the header says."""
    command = ["cc", "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Werror", *flags, "-fPIC", "-shared"]
    call = [*command, "controller.c", "-o", "controller.so", "-lm"]
    subprocess.run(call, cwd=folder, check=True, capture_output=True)
    library = ctypes.CDLL(str(folder / "controller.so"))
    library.controller_step.argtypes, library.controller_step.restype = [Numbers] * 4, None
    library.controller_reset.argtypes, library.controller_reset.restype = [Numbers], None
    return library


def pointer(array):
    return array.ctypes.data_as(Numbers)


def python_step(found):
    """The step in Python on fixed arrays: measurement, applied pressure, memory, memory after, pressure, and a call."""
    measurement, applied, memory = np.zeros(len(found.measurement)), np.zeros(1), np.zeros(len(found.start))
    after, pressure = np.zeros_like(memory), np.zeros(1)
    buffer, evaluate = found.function.buffer()
    for i, array in enumerate((measurement, applied, memory)):
        buffer.set_arg(i, array.data)
    for i, array in enumerate((after, pressure)):
        buffer.set_res(i, array.data)
    return measurement, applied, memory, after, pressure, evaluate, buffer


def test_a_law_of_the_slip_alone_is_told_the_slip_alone():
    assert controller_step(LAB, OBSERVER).measurement == {"slip": "m"}
    assert controller_step(LAB, SAMPLED).measurement == {"slip": "m", "slip_rate": "m/s"}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_c_and_python_agree_bit_for_bit_over_random_steps(case, tmp_path):
    controller, scheme, settings = CASES[case]
    chosen = simulation_scheme(scheme, **settings)
    found = export_controller(LAB, controller, tmp_path / "c", step=1e-3, scheme=chosen)
    library = compiled(tmp_path / "c")
    steps = 100_000 if scheme == "explicit" or case == "cta implicit" else 20_000
    own, answer = np.zeros(len(found.start)), np.zeros(1)
    library.controller_reset(pointer(own))
    assert list(own) == list(found.start.values())
    measurement, applied, memory, after, pressure, evaluate, _ = python_step(found)
    memory[:] = own
    random = np.random.default_rng(7)
    signals = random.normal(size=(steps, len(measurement))) * [1e-3, 1e-2][: len(measurement)]
    signals[random.random(steps) < 0.05] = 0.0  # kinks too
    arguments = pointer(own), pointer(answer)
    told = np.where(random.random(steps) < 0.5, 1.0, random.uniform(0.5, 1.0, steps))
    different = 0
    for share, row in zip(told, signals, strict=True):
        measurement[:] = row
        applied[0] = share * answer[0]
        library.controller_step(pointer(measurement), None if share == 1 else pointer(applied), *arguments)
        evaluate()
        memory[:] = after
        different += answer.tobytes() != pressure.tobytes() or own.tobytes() != after.tobytes()
    assert different == 0
    assert np.isfinite(own).all()
    assert own[0] == steps
    assert abs(answer[0]) > 0


def asked_along(found, run, least=-np.inf, largest=np.inf):
    """Pressures of the exported step along a run, cut off by a pump that tells it what it applied."""
    measurement, applied, memory, after, pressure, evaluate, _ = python_step(found)
    memory[:] = list(found.start.values())
    pressures = []
    for slip, rate in zip(run.slip, run.slip_rate, strict=True):
        measurement[:] = (slip, rate)[: len(measurement)]
        evaluate()
        memory[:] = after
        applied[0] = np.clip(pressure[0], least, largest)
        pressures.append(applied[0])
    return pressures


@pytest.mark.parametrize("case", ["observer", "sampled", "elqr", "cta", "cta implicit", "dia compensated"])
def test_a_step_that_is_told_what_a_pump_applied_winds_up_no_more_than_in_simulate(case):
    controller, scheme, _ = CASES[case]
    found = controller_step(LAB, controller, step=1e-3, scheme=simulation_scheme(scheme))
    around = {"step": 1e-3, "method": "rk4", "duration": 0.2, "samples": 200, "compiled": False}
    free = simulate(LAB, controller, scheme=simulation_scheme(scheme), **around, plant="printed")
    most = float(np.abs(free.pressure).max()) / 4
    pump = Actuator(stages=(Saturation(lowest=-most, highest=most),))
    run = simulate(LAB, controller, scheme=simulation_scheme(scheme, actuator=pump), **around, plant="printed")
    pressures = asked_along(found, run, -most, most)
    assert run.pressure == pytest.approx(pressures, rel=1e-9, abs=1e-9 * most)
    assert np.sum(np.abs(pressures) == most) > 3
    untold, cut = asked_along(found, run), np.clip(asked_along(found, run), -most, most)
    assert max(np.abs(untold)) > most
    assert not np.allclose(cut, run.pressure, atol=1e-6 * most) or case not in ("sampled", "elqr")


@pytest.mark.parametrize(
    "case", ["observer", "sampled", "elqr", "cta", "cta implicit", "dia compensated", "cta sensed", "cta limited"]
)
def test_the_exported_step_decides_as_the_controller_of_the_simulated_loop(case):
    """Told the slips and slip rates of a run, it asks for the pressures of that run."""
    controller, scheme, settings = CASES[case]
    quiet = {k: (v.software if k == "measurement" else v) for k, v in settings.items()}
    found = controller_step(LAB, controller, step=1e-3, scheme=simulation_scheme(scheme, **settings))
    run = simulate(
        LAB,
        controller,
        step=1e-3,
        scheme=simulation_scheme(scheme, **quiet),
        method="rk4",
        duration=0.2,
        samples=200,
        compiled=False,
    )
    pressures = asked_along(found, run)
    assert run.pressure == pytest.approx(pressures, rel=1e-9, abs=1e-9 * max(np.abs(pressures)))
    assert len(set(pressures)) > 50


def test_the_files_say_what_every_number_is(tmp_path):
    found = export_controller(LAB, FEED_FORWARD, tmp_path / "c")
    header, source = ((tmp_path / "c" / name).read_text() for name in ("controller.h", "controller.c"))
    assert {f.name for f in (tmp_path / "c").iterdir()} == {"controller.h", "controller.c"}
    for said in ("slip [m]", "slip_rate [m/s]", "gain k1: 15/2 m^(2/3)/s^2", "lab-fault", "2-CTA", "xi_1", "4/1385"):
        assert said in header
    assert "CONTROLLER_STEP 0.001" in header
    assert "malloc" not in source
    assert json.loads(json.dumps(found.to_dict()))["memory"]["sample"] == 0.0


def test_a_sensed_controller_measures_the_slip_alone_and_leaves_the_noise_to_the_instrument():
    found = controller_step(LAB, PUBLISHED["cta"], scheme=simulation_scheme("explicit", measurement=SENSED))
    assert dict(found.measurement) == {"slip": "m"}
    noisy = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-6))
    plain = controller_step(LAB, PUBLISHED["cta"])
    assert controller_step(LAB, PUBLISHED["cta"], scheme=noisy).start == plain.start


def test_a_header_writes_exact_numbers_plainly(tmp_path):
    law = export_controller(LAB, SAMPLED, tmp_path / "c").facts["law"]
    assert law.startswith("states [predicted_rate, disturbance], update [[0, 0], [")
    assert "feedback [-149400000, -" in law
    assert "Fraction" not in law
    assert "None" not in law


def test_a_law_that_makes_nothing_of_the_slip_rate_measures_the_slip_alone():
    gains = {"k1": 2e8, "k2": 0, "k3": 1e6, "k4": 1e5}
    without = ExtendedLQR.from_values(tuple(map(str, gains.values())))
    assert dict(controller_step(LAB, without).measurement) == {"slip": "m"}
    assert dict(controller_step(LAB, PUBLISHED["elqr"]).measurement) == {"slip": "m", "slip_rate": "m/s"}


@pytest.mark.parametrize(
    ("case", "own"),
    [("cta", {"xi_1"}), ("elqr", {"xi_1", "xi_2"}), ("cta limited", {"xi_1", "kept_0", "kept_1", "kept_2"})],
)
def test_what_never_changes_is_no_memory_and_nothing_was_asked_before_the_first_call(case, own):
    """Integral states, what stages keep, the pressure of the sample before, and how far a law may wind up."""
    controller, scheme, settings = CASES[case]
    start = dict(controller_step(LAB, controller, step=1e-3, scheme=simulation_scheme(scheme, **settings)).start)
    before = {f"before_{name}" for name in own if name.startswith("xi")}
    assert set(start) == {"sample", "held_0", "push", *own, *before}
    assert set(start.values()) == {0.0}


def test_a_law_without_integral_states_cannot_wind_up():
    law = summed_integrals((F(1), F(2), F(3), F(4)), F(1, 1000))
    plain = replace(law, states=(), update=(), measured=(), output=())
    found = controller_step(LAB, SampledController(law=plain, step=F(1, 1000)))
    assert set(found.start) == {"sample", "held_0"}
    assert [found.function.numel_out(i) for i in range(2)] == [2, 1]


def test_a_law_whose_states_alone_use_the_slip_rate_measures_it():
    law = summed_integrals((F(1), F(2), F(3), F(4)), F(1, 1000))
    late = replace(law, measured=tuple((F(0), F(1)) for _ in law.states), feedback=(F(1), F(0)))
    found = controller_step(LAB, SampledController(law=late, step=F(1, 1000)))
    assert set(found.measurement) == {"slip", "slip_rate"}


@pytest.mark.parametrize(
    ("asked", "applied", "push", "frozen"),
    [
        (2.0, 1.0, 1e-3, True),
        (2.0, 1.0, -1e-3, False),
        (1.0, 2.0, -1e-3, True),
        (1.0, 2.0, 1e-3, False),
        (1.0, 1.0, 5.0, False),
        (2.0, 1.0, 0.0, False),
    ],
)
@pytest.mark.parametrize("case", ["observer", "elqr"])
def test_an_integral_that_pushes_beyond_what_was_applied_stays_as_it_was_before(case, asked, applied, push, frozen):
    controller, scheme, _ = CASES[case]
    found = controller_step(LAB, controller, step=1e-3, scheme=simulation_scheme(scheme))
    integrals = [name for name in found.start if name.startswith("xi")]
    own = {name: 1e-6 * i for i, name in enumerate(integrals, start=5)}
    before = {f"before_{name}": -value for name, value in own.items()}
    memory = {**found.start, "sample": 10.0, **own, **before, "held_0": asked, "push": push}
    seen = [1e-6, 2e-6][: len(found.measurement)]

    def after(applied, **changed):
        later, pressure = found.function(seen, applied, list({**memory, **changed}.values()))
        told = dict(zip(found.start, later.full().ravel(), strict=True))
        return [told[name] for name in ("sample", "held_0", *integrals)], float(pressure)

    kept = {name: -value for name, value in own.items()} if frozen else own
    expected = after(asked, push=0.0, **kept)
    assert after(applied) == expected
    assert expected[0][:2] == [11.0, expected[1]]
    assert after(asked, push=0.0, **own) != after(asked, push=0.0, **{name: -value for name, value in own.items()})


@pytest.mark.parametrize(
    ("other", "path", "longest", "said"),
    [
        ("", {}, None, []),
        ("another T_s", {}, None, ["another T_s"]),
        ("", {"delay": F(1, 50)}, None, ["designed for a delay of 0.02 s between controller and fault"]),
        (
            "another T_s",
            {"delay": F(1, 50), "lag": F(2), "diffusion": F(300)},
            F(1, 2),
            ["another T_s", "of 0.02 s, a lag of 2 s, a diffusion path of L^2/D = 300 s between", "once every 0.25 s"],
        ),
        ("", {}, F(1, 2), ["to be called periodically, once every 0.25 s"]),
        (None, None, None, []),
    ],
)
def test_what_is_said_first_is_what_a_law_is_for(other, path, longest, said):
    none = {"delay": F(0), "lag": F(0), "diffusion": F(0)}
    own = None if path is None else SimpleNamespace(**{**none, **path}, longest=longest, step=F(1, 4))
    found = _remarks(LAB, SimpleNamespace(sampling=own, other_step=lambda _: other, warning_at_rest=""))
    assert len(found) == len(said)
    assert all(part in remark for part, remark in zip(said, found, strict=True))


@pytest.mark.parametrize(("eigenvalue", "warned"), [(1.1, True), (1.0, False), (-1.1, True), (0.5, False)])
def test_a_law_that_is_unstable_at_rest_is_exported_with_a_warning(eigenvalue, warned):
    system = SimpleNamespace(A=[[eigenvalue]], B=[[1]], C=[[1]], D=[[1e8]], dt=0.25)
    law = SampledLaw.from_statespace(system, inputs=["slip_error"])
    said = [line for line in _remarks(LAB, law) if line.startswith("NOT for a stick-slip fault")]
    assert bool(said) == warned
    assert not warned or f"e-fold in {0.25 / np.log(1.1):.3g} s" in said[0]


def test_gains_and_sampling_are_told_in_words_of_their_own():
    facts = controller_step(LAB, SAMPLED).facts
    assert not {"gains", "sampling"} & facts.keys()
    assert {"law", "step", "scheme", "fault"} <= facts.keys()


def test_substeps_are_those_of_a_simulation():
    plain = controller_step(LAB, PUBLISHED["cta"], scheme=simulation_scheme("explicit"))
    found = controller_step(LAB, PUBLISHED["cta"], scheme=simulation_scheme("explicit", substeps=10))
    assert (found.facts, found.start) == (plain.facts, plain.start)
    assert found.facts["substeps"] == "1"


def test_the_step_is_seen_in_its_file_alone_and_arrays_have_an_entry_at_least(tmp_path):
    export_controller(LAB, PUBLISHED["elqr"], tmp_path / "c")
    lines = (tmp_path / "c" / "controller.c").read_text().splitlines()
    assert (
        "int sampled_step(const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w, int mem){"
        in lines
    )
    sizes = SimpleNamespace(sz_arg=lambda: 3, sz_res=lambda: 2, sz_iw=lambda: 0, sz_w=lambda: 1)
    assert _sizes(sizes) == {"arguments": 3, "results": 2, "integers": 1, "work": 1}


def test_a_comment_keeps_its_empty_lines():
    assert _comment(["a", "", "b */ c"]) == "/*\n * a\n *\n * b * / c\n */\n"


def test_only_an_export_is_replaced_by_force(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "empty").mkdir()
    (tmp_path / "whole").mkdir()
    for name in FILES:
        (tmp_path / "whole" / name).touch()
    with pytest.raises(OutputError, match=r"^only a folder with no files but controller\.h, .* is replaced"):
        export_controller(LAB, PUBLISHED["cta"], tmp_path / "file", force=True)
    for place in ("empty", "whole"):
        export_controller(LAB, PUBLISHED["cta"], tmp_path / place, force=True)
        assert sorted(path.name for path in (tmp_path / place).iterdir()) == ["controller.c", "controller.h"]


def test_a_law_of_slow_sliding_is_refused():
    with pytest.raises(ParameterError, match="a controller in C needs a friction law of slip and slip rate alone"):
        controller_step(load_fault("crustal-patch"), PUBLISHED["elqr"])


def test_no_text_of_the_user_ends_the_comment(tmp_path, monkeypatch):
    monkeypatch.setattr(type(PUBLISHED["elqr"]), "title", "*/ #error \n#error")
    export_controller(LAB, PUBLISHED["elqr"], tmp_path / "c")
    assert "* / #error" in (tmp_path / "c" / "controller.h").read_text(encoding="utf-8")
    compiled(tmp_path / "c")


def test_what_is_there_stays_unless_forced(tmp_path):
    target = tmp_path / "c"
    export_controller(LAB, PUBLISHED["elqr"], target)
    before = (target / "controller.h").read_bytes()
    with pytest.raises(OutputError, match="must be new"):
        export_controller(LAB, PUBLISHED["cta"], target)
    assert (target / "controller.h").read_bytes() == before
    export_controller(LAB, PUBLISHED["cta"], target, force=True)
    assert b"2-CTA" in (target / "controller.h").read_bytes()
    (target / "notes").write_text("mine")
    with pytest.raises(OutputError, match="only a folder"):
        export_controller(LAB, PUBLISHED["cta"], target, force=True)
    with pytest.raises(OutputError, match="must be in a folder that can be written"):
        export_controller(LAB, PUBLISHED["cta"], tmp_path / "none" / "c")


def test_nothing_is_left_of_a_failed_export(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(OutputError, match="No space"):
        export_controller(LAB, PUBLISHED["elqr"], tmp_path / "c")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"scheme": "continuous"}, "sampled scheme"),
        (
            {"scheme": simulation_scheme("explicit", actuator=Actuator(stages=(Lag(time_constant=0.1),)))},
            "continuous-time dynamics",
        ),
        ({"scheme": simulation_scheme("explicit", measurement=SENSED), "step": 2e-3}, "sampling period"),
        ({"step": 0.0}, "step"),
    ],
)
def test_what_no_controller_can_do_is_refused(settings, named):
    with pytest.raises(ParameterError, match=named):
        controller_step(LAB, PUBLISHED["cta"], **settings)


STORED = Path(__file__).parents[2] / "proofs" / "certificates" / "guarantee_cta_real-fault.json"


def test_a_sliding_mode_of_a_certificate_is_exported_and_asks_for_what_is_proved():
    """Near the reference its step is deadbeat, w = -e1/T_s, so that the matrices of the file tell every pressure."""
    real = load_fault("real-fault")
    claim, chosen = load_guarantee(STORED), certified_choice(real, STORED)
    found, law, step = controller_step(real, chosen.controller), claim.sampled_loop.law, float(claim.sampled_loop.step)
    matrices = (law.update, law.measured, law.output, law.feedback)
    update, fed, output, feedback = (np.array(rows, dtype=float) for rows in matrices)
    random = np.random.default_rng(3)
    slips, rates = random.uniform(-1e-6, 1e-6, 50), random.uniform(-1e-5, 1e-5, 50)
    shape = np.polynomial.Polynomial([float(c) for c in claim.task.shape])
    end = float(claim.task.operation_time)
    z, memory, pressure = np.array([rates[0], 0.0, 0.0]), list(found.start.values()), 0.0
    for i, (slip, rate) in enumerate(zip(slips, rates, strict=True)):
        seen = np.array([slip, rate, -slip / step])
        told = (slip + 0.785 * shape(i * step / end), rate + 0.785 * shape.deriv()(i * step / end) / end)
        memory, pressure = found.function(told, pressure, memory)
        assert float(pressure) == pytest.approx(output @ z + feedback @ seen, rel=1e-6, abs=1e-3)
        z = update @ z + fed @ seen


def test_gains_of_another_step_are_not_read_off():
    claim = load_guarantee(STORED)
    first, *rest = claim.sampled_loop.law.implicit_step.pull
    nested = replace(first, argument=(first,))
    for law in (
        replace(
            claim.sampled_loop.law, implicit_step=replace(claim.sampled_loop.law.implicit_step, pull=(nested, *rest))
        ),
        replace(claim.sampled_loop.law, implicit_step=replace(claim.sampled_loop.law.implicit_step, pull=tuple(rest))),
        replace(claim.sampled_loop.law, update=((F(0), F(0), F(1, 9)), *claim.sampled_loop.law.update[1:])),
        replace(claim.sampled_loop.law, feedback=(*claim.sampled_loop.law.feedback[:2], F(0))),
    ):
        with pytest.raises(UnsupportedError, match="can be recovered only for a 2-CTA or 2-DIA"):
            recovered(replace(claim, sampled_loop=replace(claim.sampled_loop, law=law)))
    assert recovered(claim).weight == F(7, 20)


@pytest.mark.parametrize(
    ("gains", "scale"), [(("25/16", "27/5", "6/5", "0"), "1/64"), (("2", "3", "1.1", "0.3"), "64/729")]
)
def test_the_gains_of_a_2_dia_stand_in_powers_and_are_read_off_too(gains, scale, tmp_path):
    """The same pressures as those of the controller itself, of other gains with λ = 1 and the divisor B0."""
    real, step, weight, authority = load_fault("real-fault"), F("0.184"), F("0.3"), F("2.25e-8")
    own = control_law("dia").from_values(gains, scale=F(scale), divisor=F(2353, 125000000000))
    claim = compensated(uncertain_plant(real), own, weight, authority, step)
    if isinstance(claim, NoProof):  # the step is that of the law, proved or not
        claim = load_guarantee(STORED)
        root = ImplicitStep(pull=implicit_pull(own, step, authority))
        claim = replace(
            claim, sampled_loop=replace(claim.sampled_loop, law=compensated_law(root, weight, step * authority))
        )
    found = recovered(claim).controller
    assert found.name == "dia"
    assert implicit_pull(found, step, authority) == implicit_pull(own, step, authority)
    scheme = simulation_scheme("compensated", weight=float(weight), authority=float(authority))
    one = controller_step(real, own, step=float(step), scheme=scheme)
    two = controller_step(real, found)
    first, second, random = list(one.start.values()), list(two.start.values()), np.random.default_rng(5)
    pressures = [0.0, 0.0]
    for seen in random.uniform(-1, 1, (30, 2)) * (1e-4, 1e-4):
        first, pressures[0] = one.function(seen, pressures[0], first)
        second, pressures[1] = two.function(seen, pressures[1], second)
        assert float(pressures[0]) == pytest.approx(float(pressures[1]), rel=1e-9, abs=1e-6)
    scaled = replace(
        claim.sampled_loop.law.implicit_step.pull[0],
        factor=tuple(2 * v for v in claim.sampled_loop.law.implicit_step.pull[0].factor),
    )
    other = replace(claim.sampled_loop.law.implicit_step, pull=(*claim.sampled_loop.law.implicit_step.pull, scaled))
    with pytest.raises(UnsupportedError):
        recovered(
            replace(
                claim,
                sampled_loop=replace(claim.sampled_loop, law=replace(claim.sampled_loop.law, implicit_step=other)),
            )
        )


def test_a_certificate_of_a_2_dia_is_exported(tmp_path):
    real = load_fault("real-fault")
    made = design_compensated(
        uncertain_plant(real), control_law("dia").base_gains()[0].law, F("0.184"), objective="peak"
    )
    path = tmp_path / "dia.json"
    save_guarantee(made.proof, path)
    chosen = certified_choice(real, path)
    found = export_controller(real, chosen.controller, tmp_path / "c")
    assert found.facts["law"] == "2-DIA"
    assert (tmp_path / "c" / "controller.c").exists()
