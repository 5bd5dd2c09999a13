"""Guarantees of users' laws: certificates of both checkers, an independent run, and what is refused."""

import importlib.util
import json
import re
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.linalg import expm
from thinned import few

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.cli import main
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.guarantees import tracking_result
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, save_guarantee
from quakedesign.laws import NominalModel
from quakedesign.loop import sampled_error_loop
from quakedesign.plant import uncertain_plant
from quakedesign.report import comparison_table
from quakedesign.report.summary import summary
from quakedesign.synthesis import assess

CHECK = Path(__file__).parents[2] / "proofs" / "check.py"
PAGE = Path(__file__).parents[2] / "docs" / "howto" / "own_controller.md"
REAL = qd.load_fault("real-fault")
STEP = 0.184
ERRORS = ["slip_error", "slip_rate_error"]


def lqg(inputs, label="LQG"):
    """LQG of python-control with a disturbance and an unused fourth state, in coordinates that mix all of them."""
    plant = qd.to_statespace(REAL, step=STEP, vertex=("middle", "middle", "middle"))
    A = np.block([[plant.A, plant.B, np.zeros((2, 1))], [np.zeros((2, 2)), np.diag([1, 0.5])]])
    B, C = np.vstack([plant.B, [[0], [0]]]), np.eye(2, 4)
    gain = float(plant.B[1, 0])
    K, _, _ = control.dlqr(plant.A, plant.B, np.diag([1, 0.1]), np.array([[0.04 * gain**2]]))
    K = np.hstack([K, [[1, 0]]])
    L, _, _ = control.dlqe(A, np.eye(4), C, np.diag([1e-16, 1e-12, 1e7, 1e-3]), np.diag([1e-13, 1e-12]))
    M = np.linalg.solve(A, L)
    known = np.eye(4) - M @ C
    mixed = np.array([[1, 0.3, 0.1, 0], [0, 2, 0.1, 0], [0.5, 0.1, 1, 0], [0, 1, 0, 1]])
    mixed = np.diag([1e-5, 1e-4, 1e5, 1]) @ mixed
    F, G = np.linalg.solve(mixed, (A - B @ K) @ known @ mixed), np.linalg.solve(mixed, (A - B @ K) @ M)
    return qd.SampledLaw.from_statespace(control.ss(F, G, -K @ known @ mixed, -K @ M, STEP), inputs=inputs, label=label)


LAW, ABSOLUTE = lqg(ERRORS), lqg(["slip_error", "slip_rate"], "LQG of the slip rate")


@pytest.fixture(scope="module")
def proof_check():
    """The standalone checker."""
    specification = importlib.util.spec_from_file_location("check_user_laws", CHECK)
    module = importlib.util.module_from_spec(specification)
    sys.modules["check_user_laws"] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules["check_user_laws"]


def run(*arguments):
    """Exit code of a command."""
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    return stop.value.code


@pytest.fixture(scope="module")
def found():
    return qd.guarantee(REAL, law=LAW)


@pytest.fixture(scope="module")
def referred():
    return qd.guarantee(REAL, ABSOLUTE, delay="20 ms", slip_noise="1 um", rate_noise="1 um/s")


@pytest.fixture
def stuck(monkeypatch):
    """A quick search that finds the same on the stick-slip plant whatever the law."""
    seen = tracking_result.WorstCase(slip_error=1e-3, slip_rate_error=2e-5)
    monkeypatch.setattr(tracking_result, "worst_tracking", lambda claim, sticks=False: seen)


@pytest.mark.usefixtures("stuck")
def test_an_lqg_of_four_states_is_proved_without_and_with_noise(found):
    assert qd.guarantee(REAL, law=LAW, slip_noise="0.1 um").proved
    assert found.proved
    assert found.proof.claims.slip_rate_error < Fraction("2.5e-4")
    assert found.to_dict()["notes"] == list(LAW.notes)


def test_the_stick_slip_plant_is_searched_when_its_worst_case_is_read(stuck, found):
    told = replace(found).lines()
    assert "an integrator perturbed by rounding" in told[-1]
    assert told[2] == "worst case found on the stick-slip plant: slip error 1 mm, slip-rate error 20 µm/s"
    assert told[3].startswith(
        "on the stick-slip plant nothing is proved for a given law, and its worst pressure is not"
    )
    assert "a run was found that exceeds the bounds" in "".join(told)
    assert replace(found).to_dict()["worst_found_with_stick"]["slip_error"] == 1e-3


def test_no_search_of_the_stick_slip_plant_is_said_of_laws_that_it_does_not_take(stuck, found, referred, monkeypatch):
    gap = "on the stick-slip plant nothing is proved for a given law, and its worst case is not searched"
    assert referred.stick_slip_gap.startswith(gap)
    assert referred.to_dict()["worst_found_with_stick"] is None
    monkeypatch.setattr(tracking_result, "growth_time_at_rest", lambda law, step: 0.5)  # e-fold in 0.5 s at rest
    assert replace(found).stick_slip_gap.startswith(gap)
    assert replace(found).to_dict()["worst_found_with_stick"] is None


@pytest.mark.slow
def test_independent_runs_that_stick_stay_below_the_worst_case_found(found):
    rates = [float(found.proof.task.reference_rates[0]) * share for share in (1, 0.05)]
    runs = [worst_course(found.proof, LAW, seed, rate, parts=16) for seed in range(6) for rate in rates]
    seen, reached = found.worst_with_stick, np.max(runs, axis=0)
    assert reached[0] < seen.slip_error < 2 * reached[0]
    assert reached[1] < seen.slip_rate_error < 2 * reached[1]


@few("name", ["found", "referred"], every=2)
def test_both_checkers_decide_the_file_and_refuse_a_tighter_claim(name, request, tmp_path):
    claim = request.getfixturevalue(name).proof
    path = tmp_path / "law.json"
    save_guarantee(claim, path)
    assert check_files([path], "real-fault")[str(path)][0] == "proved"
    assert subprocess.run([sys.executable, CHECK, path], capture_output=True, check=False).returncode == 0
    document = json.loads(path.read_text())
    document["claims"]["slip_rate_error"] = str(Fraction(document["claims"]["slip_rate_error"]) * Fraction(99, 100))
    path.write_text(json.dumps(document))
    assert check_files([path], "real-fault")[str(path)][0] != "proved"
    assert subprocess.run([sys.executable, CHECK, path], capture_output=True, check=False).returncode == 1


def leaves(value, way=()):
    """Ways to every rational of a document."""
    if isinstance(value, dict):
        for key, entry in value.items():
            if key not in ("name", "states"):
                yield from leaves(entry, (*way, key))
    elif isinstance(value, list):
        for place, entry in enumerate(value):
            yield from leaves(entry, (*way, place))
    elif isinstance(value, str) and way[0] != "kind":
        yield way


@pytest.mark.slow
def test_every_number_of_the_law_is_bound_by_what_is_printed(referred, proof_check):
    """A law of another digit is refused or stated otherwise: the entries that are printed tell them apart."""
    document = guarantee_document(referred.proof)
    stated = proof_check.check(json.dumps(document)).statement
    ways = list(leaves(document["loop"], ("loop",)))
    assert len(ways) >= 4 * 4 + 2 * 4 + 4 + 2 + 10 + 5
    for way in ways[::5]:
        changed = json.loads(json.dumps(document))
        inner = changed
        for key in way[:-1]:
            inner = inner[key]
        inner[way[-1]] = str(Fraction(inner[way[-1]]) * Fraction(1000001, 1000000) + Fraction(1, 10**12))
        try:
            assert proof_check.check(json.dumps(changed)).statement != stated, way
        except proof_check.Refused:
            pass


def test_zero_rows_of_the_reference_are_refused(referred, proof_check):
    document = guarantee_document(referred.proof)
    document["loop"]["of_reference"] = [["0", "0"]] * 5
    with pytest.raises(proof_check.Refused, match="of_reference"):
        proof_check.check(json.dumps(document))


def test_a_law_of_slip_and_slip_rate_moves_its_errors_as_the_inputs_of_the_loop_say():
    """A plant without uncertainty in slip and slip rate, by matrix exponentials, beside the loop of its errors."""
    s, w, gain, pace = 0.9, 1.6, 2.5e-8, 3.0e-4
    one = Fraction
    law = qd.SampledLaw.from_gains([7e8, 4e8, 1e8], step="0.1", inputs=("slip", "slip_rate")).law
    model = NominalModel(slip=one("0.9"), rate=one("1.6"), gain=one("2.5e-8"))
    loop = sampled_error_loop(law, model, one("2.5e-8"), one("0.1"), delay=one("0.03"))
    n = len(loop.states)
    rows = lambda matrix: np.array([[float(v) for v in row] for row in matrix])  # noqa: E731
    drift = -s * pace  # b·dp*/dt, as b(p* ) = −s·r
    pushed = sum(
        np.array([float(v) for v in loop.inputs[name]]) * size
        for name, size in (("acceleration", -w * pace), ("drift", drift), ("reference", pace))
    )
    told = np.array([float(v) for v in loop.sampled["reference_rate"]]) * pace
    flow = np.block([[rows(loop.flow), pushed[:, None]], [np.zeros((1, n + 1))]])
    state, errors = np.zeros(n), []
    state[1] = -pace  # r' jumps to its rate
    x, z, held = np.zeros(2), np.zeros(1), 0.0
    exact = np.block([[np.array([[0, 1], [s, -w]]), np.array([[0], [gain]])], [np.zeros((1, 3))]])
    for k in range(60):
        state = rows(loop.segments[0].jump) @ state + told
        state = (expm(flow * 0.03) @ [*state, 1])[:-1]
        state = rows(loop.segments[1].jump) @ state
        state = (expm(flow * 0.07) @ [*state, 1])[:-1]
        r = pace * k * 0.1
        asked = -(7e8 * x[0] + 4e8 * x[1] + 1e8 * z[0])
        z = z + 0.1 * (x[0] - r)
        x = (expm(exact * 0.03) @ [*x, held])[:2]
        held = asked
        x = (expm(exact * 0.07) @ [*x, held])[:2]
        errors.append((state[:2], x - [r + 0.1 * pace, pace]))
    got, expected = np.array(errors).transpose(1, 0, 2)
    assert np.abs(expected).max() > 1e-4
    assert got == pytest.approx(expected, rel=1e-7, abs=1e-12)


def worst_course(claim, law, seed, rest=np.inf, parts=4):
    """Largest |e1|, |e2| of random and resonant courses at the ends of all ranges, by SciPy alone.

    The slip rate is never negative along a reference of the rate `rest` [m/s].
    """
    random, task = np.random.default_rng(seed), claim.task
    b, H = float(task.authority), float(task.amplitude)
    slope, damping = ([float(v) for v in ends] for ends in (task.slip_chord, task.rate_chord))
    F, G, C, D = (
        np.array(part, dtype=float) for part in (law.law.update, law.law.measured, [law.law.output], [law.law.feedback])
    )
    part = STEP / parts
    steps = {}
    for s in slope:
        for w in damping:
            for beta in (1.0, float(task.beta[1])):
                A = np.zeros((4, 4))
                A[0, 1], A[1, 0], A[1, 1], A[1, 2], A[1, 3] = 1, s, -w, beta * b, 1
                steps[s, w, beta] = expm(A * part)[:2]
    largest = np.zeros(2)
    for beta in (1.0, float(task.beta[1])):
        x, z, sign = np.zeros(2), np.zeros(len(F)), 1.0
        period = random.uniform(1, 12)
        for k in range(1500):
            p = float((C @ z + D @ x)[0])
            z = F @ z + G @ x
            for j in range(parts):
                sign = np.sign(np.sin(2 * np.pi * (k + j / parts) / period)) or 1.0
                s = slope[int(x[0] * sign > 0)]  # the slope pushes with the disturbance
                x = steps[s, random.choice(damping), beta] @ [*x, p, sign * H]
                x[1] = max(x[1], -rest)
                largest = np.maximum(largest, np.abs(x))
    return largest


def test_an_independent_run_with_adverse_disturbances_stays_inside(found):
    reached = np.max([worst_course(found.proof, LAW, seed) for seed in range(6)], axis=0)
    claims = found.proof.claims
    assert reached[0] < claims.slip_error
    assert reached[1] < claims.slip_rate_error
    assert reached[1] > 0.5 * float(claims.slip_rate_error)  # the runs are no idle ones


@pytest.mark.slow
def test_none_names_what_fails():
    weak = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([1e8, 1e8, 1e7], step="0.184"))
    assert not weak.proved
    assert "range" in weak.lines()[0]
    assert weak.proof.small_gain > 1
    standing = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([3e8, 2e8], step="0.05"))
    assert "no integral action" in standing.lines()[0]
    wild = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([9e9, 9e9, 1e9], step="0.184"))
    assert "largest eigenvalue over a period has modulus" in wild.lines()[0]


def test_a_double_integral_is_said_to_wind_up_while_the_fault_is_at_rest(stuck):
    double = qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7, 1e6], step="0.184")
    assert double.warning_at_rest.startswith("MAY WIND UP on a stick-slip fault: the law has a double integral")
    assert double.warning_at_rest in qd.guarantee(REAL, law=double).lines()
    for once in ([3e8, 2.5e8, 5e7], [3e8, 2.5e8]):
        assert qd.SampledLaw.from_gains(once, step="0.184").warning_at_rest == ""
    both = ([[1, 0], [0, 1]], [[1, 0], [0, 1]], [[-1e7, -1e7]], [[-3e8, -2e8]])  # two integrals side by side
    apart = qd.SampledLaw.from_statespace(control.ss(*both, 0.184), inputs=["slip_error", "slip_rate_error"])
    assert apart.warning_at_rest == ""


@pytest.mark.usefixtures("stuck")
def test_a_law_without_a_guarantee_names_a_factor_of_its_pressure_that_has_one():
    strong = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([6e8, 5e8, 1e8], step="0.184"))
    half = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7], step="0.184"))
    assert not strong.proved
    assert "largest eigenvalue over a period has modulus" in strong.lines()[0]
    assert (
        strong.lines()[1]
        == f"not this law, but the same law with its output multiplied by 0.5: {half.proof.sentence()}"
    )
    near = strong.to_dict()["nearest"]
    assert (near["quantity"], near["value"]) == ("pressure_factor", "1/2")
    assert near["peak_slip_rate"] == half.to_dict()["peak_slip_rate"]
    wrong = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([-3e8, -2.5e8, -5e7], step="0.184"))
    assert (
        wrong.lines()[1] == f"not this law, but the same law with its output multiplied by -1: {half.proof.sentence()}"
    )
    of_slip = {"step": "0.184", "inputs": ("slip", "slip_rate")}
    turned = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([-3e8, -2.5e8, -5e7], **of_slip)).nearest[1]
    assert (
        turned.sampled_loop.law == qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7], **of_slip).law
    )  # what acts on r' turns too
    standing = qd.guarantee(REAL, law=qd.SampledLaw.from_gains([3e8, 2e8], step="0.184"))
    assert (standing.nearest, len(standing.lines())) == (None, 1)  # no factor adds an integral


def eigenvalue(gains, step, sign=1):
    """Largest |λ| over a period of p = −k1·e1 − k2·e2 − k3·ξ on the nominal plant, by SciPy alone."""
    task = uncertain_plant(REAL)
    s, w, b = (float(sum(ends)) / 2 for ends in (task.slip_chord, task.rate_chord, task.beta))
    A = np.zeros((4, 4))
    A[0, 1], A[1] = 1, [s, -w, b * float(task.authority), 0]
    k1, k2, k3 = gains
    jump = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-sign * k1, -sign * k2, 0, -sign * k3], [step, 0, 0, 1]])
    return np.abs(np.linalg.eigvals(expm(A * step) @ jump)).max()


def test_an_unstable_loop_has_its_eigenvalue_and_the_sign_that_is_stable():
    gains = np.array([3e8, 2e8, 5e7])
    wrong = qd.assess(REAL, qd.SampledLaw.from_gains(-gains, step="0.012")).guarantee.reason
    assert f"largest eigenvalue over a period has modulus {eigenvalue(-gains, 0.012):.4g}" in wrong
    assert eigenvalue(-gains, 0.012, -1) < 1
    assert wrong.endswith("with the opposite sign of the pressure it is stable")
    strong = qd.assess(REAL, qd.SampledLaw.from_gains(30 * gains, step="0.184")).guarantee.reason
    assert eigenvalue(30 * gains, 0.184, -1) > 1
    assert strong.endswith(f"largest eigenvalue over a period has modulus {eigenvalue(30 * gains, 0.184):.4g}")


@few("name", ["slip_rate_error", "slip_rate"], every=2)
def test_a_law_of_the_slip_rate_alone_leaves_the_slip_to_itself(name):
    law = qd.SampledLaw.from_statespace(control.ss(1, 0.012, -1e8, -1e8, 0.012), inputs=[name])
    reason = qd.guarantee(REAL, law=law).reason
    assert "largest eigenvalue over a period has modulus 1; the law does not use the slip" in reason
    assert "add slip_error or slip to its inputs" in reason
    assert "opposite sign" not in reason


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"step": "0.1"}, "step of the loop setup must be that of the law"),
        ({"measured": "differentiator"}, "signals that it measures"),
        ({"measured": "slip"}, "signals that it measures"),
        ({"gains": [1]}, "Received gains. Omit"),
        ({"plant": "stick-slip"}, "Received plant 'stick-slip'. Omit"),
        ({"objective": "peak"}, "Received objective 'peak'. Omit"),
        ({"controller": "cta"}, "by law or by controller. Received both"),
        ({"disturbance_class": "no"}, "class"),
        ({"law": ABSOLUTE, "diffusion": "0.02 s"}, "no guarantee with a diffusion"),
        ({"law": ABSOLUTE, "longest_step": "0.2 s"}, "no guarantee with a diffusion"),
    ],
)
def test_what_does_not_apply_is_refused(more, said):
    with pytest.raises(ParameterError, match=said):
        qd.guarantee(REAL, **({"law": LAW} | more))


def test_a_law_in_continuous_time_is_refused():
    with pytest.raises(UnsupportedError, match="sampled linear law"):
        qd.guarantee(REAL, law=qd.published("real-fault")["elqr"])
    with pytest.raises(ParameterError, match="needs a sampled law"):
        qd.assess(REAL, qd.published("real-fault")["elqr"], qd.LoopSetup(delay="10 ms"))


def test_friction_with_a_state_has_no_guarantee_of_a_user_s_law():
    with pytest.raises(ParameterError, match="without a state"):
        qd.guarantee(qd.load_fault("crustal-patch"), law=LAW)


@pytest.mark.slow
def test_a_law_is_compared_and_assessed_in_its_setup():
    designed = qd.assess(REAL, LAW, qd.LoopSetup(delay="20 ms"))
    assert str(designed.verdict) == "proved"
    assert designed.controller.delay == Fraction("0.02")
    assert designed.guarantee.sampled_loop.delay == Fraction("0.02")
    seen = qd.compare(qd.load_fault("lab-fault"), [qd.SampledLaw.from_pid(1, 0.1, step=0.01)], with_published=False)
    (entry,) = seen.of("designed")
    assert entry.label == "PID (given)"
    assert entry.proof is None


def test_a_comparison_judges_and_runs_a_given_law_in_its_setup(monkeypatch, stuck):
    judged, fault = [], replace(REAL, reference=replace(REAL.reference, operation_time=200.0))

    def noted(fault, law, setup):
        judged.append(setup)
        return assess(fault, law, setup)

    monkeypatch.setattr(comparison_table, "assess", noted)
    weak = qd.SampledLaw.from_gains([1e7, 1e7, 1e5], step="0.184", label="weak")
    setup = qd.LoopSetup(slip_noise="1 um", delay="5 ms")
    seen = qd.compare(fault, [weak], setup=setup, delay="46 ms")
    assert judged == [qd.LoopSetup(slip_noise="1 um", delay="46 ms")]
    (entry,) = seen.entries  # published gains know no delay
    assert (entry.label, entry.given, entry.design.controller.delay) == ("weak (given)", True, Fraction("0.046"))
    assert "part=0.25" in str(entry.run.provenance["actuator"])  # 46 of 184 ms
    assert entry.run.provenance["measurement"] != "exact"
    assert entry.guarantee.lines() == [f"none: {entry.design.guarantee.reason}"]
    assert "no T_s was found" not in repr(seen)
    assert summary(seen).guarantee == "real-fault: no guarantee for any given controller"


def test_assess_and_compare_take_quantities_of_the_setup_by_name():
    with pytest.raises(ParameterError, match=r"must be one of .*delay.* Received 'dela'\. Did you mean delay"):
        qd.assess(REAL, LAW, dela="5 ms")
    with pytest.raises(ParameterError, match="loop setup of a comparison needs given laws"):
        qd.compare(REAL, [], delay="5 ms")
    assert qd.assess(REAL, LAW, delay="20 ms").guarantee.sampled_loop.delay == Fraction("0.02")


def test_the_command_line_takes_the_file_of_a_law(stuck, tmp_path, capsys):
    path = tmp_path / "own.json"
    LAW.save(path)
    assert run("guarantee", "real-fault", "--law", path, "--out", tmp_path / "c.json", "--json") == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "proved"
    assert run("guarantee", "real-fault", "--law", path, "--out", tmp_path / "again.json") == 0
    assert f"written: {tmp_path / 'again.json'}" in "".join(capsys.readouterr().out.split("\n")).replace("  ", " ")
    assert run("check", tmp_path / "c.json") == 0
    assert run("simulate", "real-fault", "--law", path, "--duration", "60 s", "--json") == 0
    assert run("export", "real-fault", "--law", path, "--out", tmp_path / "c") == 0
    assert (tmp_path / "c" / "controller.c").exists()
    capsys.readouterr()
    assert run("simulate", "real-fault", "--law", path, "--controller", "cta") == 2
    assert "Omit the other options" in capsys.readouterr().err
    assert run("guarantee", "real-fault", "--law", tmp_path / "none.json") == 2


def test_runs_of_a_law_that_is_unstable_at_rest_carry_its_warning(tmp_path, capsys):
    law = {"step": "0.184", "inputs": ["slip_error"], "A": [[1.1]], "B": [[1]], "C": [[0]], "D": [[-1e7]]}
    for eigenvalue, warned in ((1.1, True), (0.9, False)):
        (tmp_path / "law.json").write_text(json.dumps(law | {"A": [[eigenvalue]]}))
        assert run("simulate", "real-fault", "--law", tmp_path / "law.json", "--duration", "2 s") == 0
        assert ("NOT for a stick-slip fault" in capsys.readouterr().out) == warned


def cells():
    """Code of the page on users' laws."""
    return re.findall(r"```\{code-cell\} python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("delay", ["0 ms", "20 ms"])
def test_the_lqg_of_the_page_is_proved_with_a_delay_and_without(stuck, delay):
    names, (lqg, *_) = {}, cells()
    assert lqg.count('"20 ms"') == 1
    exec(lqg.replace('"20 ms"', repr(delay)), names)
    assert names["answer"].proved
    assert names["answer"].proof.sampled_loop.delay == Fraction(delay.split()[0]) / 1000


@pytest.mark.slow
def test_every_snippet_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in cells():
        exec(cell, names)
    out = capsys.readouterr().out
    assert [line.split(": ")[0] for line in out.splitlines() if re.match("proved: |none: ", line)] == [
        *["proved"] * 3,
        "none",
    ]
    assert "Design of LQG for real-fault: proved; " in out
    assert names["hinf"].step == Fraction("0.184")


@pytest.mark.slow
def test_a_law_without_a_guarantee_names_a_smaller_delay_that_has_one(monkeypatch):
    """150 ms has no guarantee for this law, three quarters of it have one; multiples of the law are not tried here."""
    monkeypatch.setattr("quakedesign.synthesis.method._FACTORS", ())
    law = qd.SampledLaw.from_gains([3e8, 2.5e8, 5e7], step="0.184")
    late = qd.guarantee(REAL, law=law, delay="0.15 s")
    assert not late.proved
    name, near = late.nearest
    assert (name, near.sampled_loop.delay) == ("delay", Fraction(9, 80))
    assert str(near.check()) == "proved"
    assert near.sampled_loop.law == law.law
    assert late.lines()[1].startswith("this law with a delay of 0.1125 s: on the plant without stick")
