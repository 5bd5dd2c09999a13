"""Laws of users: what they compute, as python-control and written-out sums say, and what is refused."""

import json
from fractions import Fraction

import control
import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.errors import ParameterError, QuakedesignError, ScenarioError

STEP = 0.184
ERRORS = ["slip_error", "slip_rate_error"]


def asks_for_any_pressure(law):
    """Whether Az = z and Cz = 1 have a solution, by the ranks of the equations with and without their right side."""
    A, C = (sp.Matrix([[sp.Rational(str(v)) for v in row] for row in rows]) for rows in (law.update, [law.output]))
    left = (A - sp.eye(A.rows)).col_join(C)
    return left.rank() == left.row_join(sp.Matrix([*[0] * A.rows, 1])).rank()


def answers(law, signals):
    """Pressures of a law for rows of (x1, x2, r, r'), by its system of python-control."""
    system = qd.to_iosystem(law)
    times = np.arange(len(signals)) * float(law.step)
    return control.input_output_response(system, times, np.array(signals).T).outputs.ravel()


SIGNALS = np.random.default_rng(1).standard_normal((12, 4))
SLIP, RATE, R, R_RATE = SIGNALS.T
SEEN = {
    "slip_error": SLIP - R,
    "slip_rate_error": RATE - R_RATE,
    "slip": SLIP,
    "slip_rate": RATE,
    "reference": R,
    "reference_rate": R_RATE,
}


@pytest.mark.parametrize("inputs", [ERRORS, ["slip", "reference_rate", "slip_error"], ["slip_rate", "slip_rate_error"]])
def test_matrices_answer_as_those_of_python_control(inputs):
    random = np.random.default_rng(2)
    A, B, C, D = (random.standard_normal(shape) / 3 for shape in ((3, 3), (3, len(inputs)), (1, 3), (1, len(inputs))))
    system = control.ss(A, B, C, D, STEP)
    law = qd.SampledLaw.from_statespace(system, inputs=inputs, output="pressure")
    seen = np.array([SEEN[name] for name in inputs])
    expected = control.forced_response(system, np.arange(12) * STEP, seen).outputs.ravel()
    assert answers(law, SIGNALS) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("gains", [[7], [7, 5], [7, 0, 3], [[7, 5, 3]], (7, 5, 3, 2), np.array([[7.0, 5.0, 3.0, 2.0]])])
def test_gains_sum_their_integrals(gains):
    law = qd.SampledLaw.from_gains(gains, step="184 ms", inputs=("slip_error", "slip_rate"))
    k = [*np.ravel(gains), 0, 0, 0][:4]
    errors = SLIP - R
    once = STEP * np.concatenate([[0], np.cumsum(errors)[:-1]])
    twice = STEP * np.concatenate([[0], np.cumsum(once)[:-1]])
    assert answers(law, SIGNALS) == pytest.approx(-(k[0] * errors + k[1] * RATE + k[2] * once + k[3] * twice), rel=1e-9)
    assert len(law.law.states) == sum(bool(v) for v in k[2:]) + (not k[2] and bool(k[3]))


def test_a_pid_has_the_transfer_function_of_its_formula():
    kp, ki, kd, N = 3.0, 0.5, 2.0, 9.0
    law = qd.SampledLaw.from_pid(kp, ki, kd, N, step=STEP)
    z = control.tf([1, 0], [1], STEP)
    summed, derivative = STEP / (z - 1), N * (z - 1) / ((1 + N * STEP) * z - 1)
    expected = control.forced_response(-(kp + ki * summed + kd * derivative), np.arange(12) * STEP, SLIP - R).outputs
    assert answers(law, SIGNALS) == pytest.approx(expected, rel=1e-9)
    assert law.law.of_slip_alone
    same = qd.SampledLaw.from_statespace(-(kp + ki * summed + kd * derivative), inputs=["slip_error"])
    assert answers(same, SIGNALS) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("terms", "states"), [((3,), 0), ((3, 1), 1), ((3, 0, 1), 1), ((3, 1, 1), 2)])
def test_a_pid_has_no_state_that_it_does_not_use(terms, states):
    assert len(qd.SampledLaw.from_pid(*terms, step=STEP).law.states) == states


ROTATED = np.array([[1, 0.3, 0.1], [0, 2, 0.1], [0.5, 0.1, 1]])


@pytest.mark.parametrize("pole", [1 - 1e-7, 1 + 3e-8, 1.0])
def test_an_integrator_that_rounding_has_moved_is_made_exact_and_this_is_said(pole):
    core = np.diag([pole, 0.4, -0.2])
    A, C = np.linalg.solve(ROTATED, core @ ROTATED), np.array([[1.0, 2.0, -1.0]]) @ ROTATED
    law = qd.SampledLaw.from_statespace(control.ss(A, np.ones((3, 2)), C, np.zeros((1, 2)), STEP), inputs=ERRORS)
    assert asks_for_any_pressure(law.law)
    assert len(law.notes) == 1
    assert law.notes[0].startswith(f"the pole at {pole:.12g} is taken for an integrator")
    moved = np.array([[float(v) for v in row] for row in law.law.update]) - A
    assert np.abs(moved).max() <= 20 * max(abs(pole - 1), 1e-15)
    assert sorted(np.abs(np.linalg.eigvals(A + moved))) == pytest.approx([0.2, 0.4, 1], abs=1e-6)


@pytest.mark.parametrize("pole", [1 - 1e-5, 0.9, 1 + 1e-5])
def test_a_pole_that_is_none_of_an_integrator_stays(pole):
    system = control.ss([[pole]], [[1, 0]], [[1]], [[0, 0]], STEP)
    law = qd.SampledLaw.from_statespace(system, inputs=ERRORS)
    assert float(law.law.update[0][0]) == pole
    assert law.notes == ()


def test_an_integrator_that_does_not_reach_the_pressure_stays():
    system = control.ss(np.diag([1 - 1e-8, 0.5]), np.ones((2, 2)), [[0, 1]], [[0, 0]], STEP)
    assert qd.SampledLaw.from_statespace(system, inputs=ERRORS).notes == ()


def test_a_double_integrator_that_rounding_has_moved_keeps_a_steady_state():
    A = np.array([[1.0, 0.0], [STEP, 1 - 1e-9]])
    law = qd.SampledLaw.from_statespace(control.ss(A, np.eye(2), [[3, 2]], [[0, 0]], STEP), inputs=ERRORS)
    assert asks_for_any_pressure(law.law)


@pytest.mark.parametrize("name", ["law.json", "law.npz"])
def test_a_file_gives_the_law_again(name, tmp_path):
    A, B, C, D = [[0.1, 0.0], [0.3, 1.0]], [[1.0, 2.0], [0.0, 0.25]], [[3.0, 4.0]], [[5.0, 1 / 3]]
    inputs = ["slip", "slip_rate_error"]
    law = qd.SampledLaw.from_statespace(control.ss(A, B, C, D, STEP), inputs=inputs)
    path = tmp_path / name
    if name.endswith("npz"):
        np.savez(path, A=A, B=B, C=C, D=D, dt=STEP, inputs=inputs)
    else:
        law.save(path)
    again = qd.SampledLaw.load(path)
    assert (again.law, again.step) == (law.law, Fraction("0.184"))


@pytest.mark.parametrize(
    ("content", "same"),
    [
        ({"gains": [7, "5", 3], "step": "184 ms"}, lambda: qd.SampledLaw.from_gains([7, 5, 3], step=STEP)),
        ({"pid": {"kp": 3, "kd": 1}, "step": 0.184}, lambda: qd.SampledLaw.from_pid(3, 0, 1, step=STEP)),
    ],
)
def test_a_file_may_have_gains(content, same, tmp_path):
    path = tmp_path / "law.json"
    path.write_text(json.dumps(content))
    assert qd.SampledLaw.load(path).law == same().law


@pytest.mark.parametrize("inputs", [ERRORS, ["slip", "slip_rate_error"]])
def test_a_saved_law_has_inputs_of_the_reference_only_where_it_uses_them(inputs):
    saved = qd.SampledLaw.from_statespace(control.ss([[0.1]], [[1, 2]], [[3]], [[4, 5]], STEP), inputs=inputs).to_dict()
    more = [] if inputs == ERRORS else ["reference", "reference_rate"]
    assert saved["inputs"] == ["slip_error", "slip_rate_error", *more]
    assert {len(row) for row in (*saved["B"], *saved["D"])} == {len(saved["inputs"])}


MATRICES = {"A": [[1]], "B": [[1, 0]], "C": [[1]], "D": [[0, 0]], "inputs": ERRORS, "step": 1}


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "must be JSON"),
        ("[" * 100000, "must be JSON"),
        ("[1]", "must be an object"),
        (json.dumps({}), "must have the key step"),
        (json.dumps({"step": 1}), "either A, B, C, D and inputs, or gains"),
        (json.dumps({"step": 1, "gains": [1], "A": [[1]]}), "either A, B, C, D and inputs, or gains"),
        (json.dumps(MATRICES | {"more": 1}), "either A, B, C, D and inputs, or gains"),
        (json.dumps({"step": 1, "pid": {"ki": 1}}), "must have the key kp"),
        (json.dumps({"step": 1, "pid": [1, 2, 3]}), "must have the key kp"),
        (json.dumps({"step": 1, "pid": {"kp": 1}, "N": 50}), "the file may have only step, pid and label"),
        (json.dumps({"step": 1, "pid": {"kp": 1, "K": 2}}), "must have the key kp"),
        (json.dumps({"step": [1], "gains": [1]}), "step of .* must be a string or a number"),
        (json.dumps({"step": 0, "gains": [1]}), "step of a law must be positive"),
        (json.dumps({"step": 1, "gains": [None]}), "k1 must be a finite number"),
        (json.dumps(MATRICES | {"A": [[1, 2]]}), "matrix A of a law must be 1 x 1"),
        (json.dumps(MATRICES | {"A": [["nan"]]}), "an entry of A must be a finite number"),
        (json.dumps(MATRICES | {"B": "x"}), "matrix B of a law must be a list of rows"),
        (json.dumps(MATRICES | {"B": [[1]]}), "matrix B of a law must be 1 x 2"),
        (json.dumps(MATRICES | {"C": [[1], [1]]}), "matrix C of a law must be 1 x 1"),
        (json.dumps(MATRICES | {"D": [[1]]}), "matrix D of a law must be 1 x 2"),
        (json.dumps(MATRICES | {"inputs": "slip"}), "inputs of law .* must be a list of names"),
        (json.dumps(MATRICES | {"inputs": ["slip", "speed"]}), "input of a law"),
        (json.dumps(MATRICES | {"output": "force"}), "output of a law"),
        (json.dumps(MATRICES | {"A": [[0] * 13] * 13}), "at most 12 states"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(content, said, tmp_path):
    path = tmp_path / "law.json"
    path.write_text(content)
    with pytest.raises(QuakedesignError, match=said) as refused:
        qd.SampledLaw.load(path)
    assert isinstance(refused.value, ParameterError | ScenarioError)
    assert "\n" not in str(refused.value)


def test_a_file_with_pickles_or_too_much_in_it_is_refused(tmp_path):
    for name, arrays in (("pickle", {"A": np.array([{}], dtype=object)}), ("bomb", {"A": np.zeros((600, 600))})):
        path = tmp_path / f"{name}.npz"
        (np.savez if name == "pickle" else np.savez_compressed)(path, **arrays)
        with pytest.raises(ScenarioError, match="without pickles"):
            qd.SampledLaw.load(path)
    path.write_bytes(b"PK")
    with pytest.raises(ScenarioError, match="without pickles"):
        qd.SampledLaw.load(path)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (lambda: qd.SampledLaw.from_statespace(control.ss(1, 1, 1, 1), inputs=["slip"]), "in discrete time"),
        (lambda: qd.SampledLaw.from_statespace(control.ss(1, 1, 1, 1, True), inputs=["slip"]), "in discrete time"),
        (lambda: qd.SampledLaw.from_statespace(3, inputs=["slip"]), "must have the matrices"),
        (lambda: qd.SampledLaw.from_statespace(control.ss(1, 1, 1, 1, STEP)), r"such as inputs=\["),
        (lambda: qd.SampledLaw.from_statespace(control.tf([1], [1, 2]), inputs=["slip"]), "in discrete time"),
        (lambda: qd.SampledLaw.from_gains([1] * 5, step=1), "one to four numbers"),
        (lambda: qd.SampledLaw.from_gains([], step=1), "one to four numbers"),
        (lambda: qd.SampledLaw.from_gains([1], step=1, inputs=("slip_rate", "slip")), "inputs of gains"),
        (lambda: qd.SampledLaw.from_gains([1], step=1, inputs=("slip",)), "inputs of gains"),
        (lambda: qd.SampledLaw.from_pid(1, step=1, N=0), "N of a PID must be positive"),
    ],
)
def test_a_law_that_cannot_be_built_is_refused(build, said):
    with pytest.raises(ParameterError, match=said):
        build()


def test_a_law_has_its_label_as_its_name():
    law = qd.SampledLaw.from_gains([1, 2], step=1, label="H-infinity (v2)")
    assert (law.title, law.name) == ("H-infinity (v2)", "H-infinity-v2")
