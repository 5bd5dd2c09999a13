"""The pressure that a task needs against a fine grid of the statics, and runs that could not have it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quakedesign.cli import main
from quakedesign.fault import Reference, load_fault
from quakedesign.laws import published
from quakedesign.loop import Actuator, Saturation
from quakedesign.report.sentences import run_sentences
from quakedesign.simulation import simulate
from quakedesign.studies.comparison import needed_pressure, shortfall, ways
from quakedesign.studies.fault_facts import fault_dict, fault_sentences

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
UNDERSAMPLED = load_fault(Path(__file__).parent.parent / "data" / "undersampled_fault.toml")


def statics(fault, slip):
    """p with μ(x)(σ' − p)A = μ(0)σ'A − kx, plus the growth of the disturbance."""
    law, stress = fault.friction, fault.effective_normal_stress
    friction = law.residual + law.drop * np.exp(-slip / law.critical_slip)
    pull = (fault.specific_stiffness - fault.disturbance.slip_growth) / fault.authority
    return stress - (law.bounds[1] * stress - pull * slip) / friction


@pytest.mark.parametrize("fault", [REAL, LAB, UNDERSAMPLED], ids=lambda fault: fault.name)
def test_the_range_encloses_the_statics_closely(fault):
    needed = needed_pressure(fault)
    found = statics(fault, np.linspace(0, fault.reference.target_slip, 200_001))
    span = found.max() - found.min()
    assert needed.low <= found.min() + 1e-9 * span
    assert needed.high >= found.max() - 1e-9 * span
    assert float(needed.low) == pytest.approx(found.min(), abs=2e-4 * span)
    assert float(needed.high) == pytest.approx(found.max(), abs=2e-4 * span)
    assert ways(needed) == ("withdrawal",)


def test_the_paper_s_fault_needs_withdrawal_of_5_7_megapascals():
    assert float(needed_pressure(REAL).low) == pytest.approx(-5.7e6, rel=0.01)
    assert any("-5.67 MPa" in line and "the task needs withdrawal" in line for line in fault_sentences(REAL))
    told = fault_dict(REAL)
    assert told["needs"] == ["withdrawal"]
    assert told["equilibrium_pressure"][0] <= -5.66e6


def test_beyond_its_rest_slip_a_fault_is_pushed():
    """The spring is slack at twice the rest slip: there only injection brings the fault on."""
    further = replace(REAL, reference=Reference(target_slip=2 * REAL.rest_slip, operation_time=1e6))
    needed = needed_pressure(further)
    assert float(needed.high) == pytest.approx(statics(further, 2 * REAL.rest_slip), rel=1e-3)
    assert ways(needed) == ("withdrawal", "injection")


def test_a_stable_fault_needs_injection_alone():
    stable = replace(REAL, friction=replace(REAL.friction, drop=0.0))
    assert ways(needed_pressure(stable)) == ("injection",)
    assert "needs injection of fluid" in " ".join(fault_sentences(stable))


@pytest.mark.slow
def test_a_run_that_can_only_inject_says_why_it_fails():
    """e-LQR of the paper behind a pump without withdrawal: the fault goes as without control."""
    pump = Actuator(stages=(Saturation(lowest=0.0, highest=2e4),))
    hurried = replace(LAB, reference=Reference(target_slip=LAB.reference.target_slip, operation_time=20.0))
    run = simulate(hurried, published("lab-fault")["elqr"], scheme="explicit", step=5e-4, actuator=pump)
    assert run.outcome.kind == "earthquake"
    assert run.metrics.min_pressure == 0
    assert shortfall(run, hurried) == (
        "falls short of its task: the reference needs -11.4 kPa at equilibrium, and this run never withdraws"
    )
    free = simulate(hurried, published("lab-fault")["elqr"], scheme="explicit", step=5e-4)
    assert free.outcome.kind == "slow slip"  # its integrals are too slow for this task, its pressure is what it takes
    assert shortfall(free, hurried) is None
    assert "(withdrawal) to" in run_sentences(free, hurried)[1]


@pytest.mark.slow
def test_the_command_says_outcome_and_reason_first(capsys):
    call = ("simulate", "lab-fault", "--controller", "elqr", "--scheme", "explicit", "--step", "0.5 ms")
    limited = ("--saturation", "20 kPa", "--withdrawal", "0", "--duration", "600")
    with pytest.raises(SystemExit) as stop:
        main([*call, *limited, "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert stop.value.code == 0
    assert next(iter(answer)) == "outcome"
    assert answer["outcome"]["kind"] == "earthquake"
    assert answer["shortfall"].endswith("and this run never withdraws")
    with pytest.raises(SystemExit):
        main([*call, *limited])
    said = capsys.readouterr().out.splitlines()
    assert said[1].strip().startswith("earthquake: peak slip rate ")
    assert said[2].strip() == "pressure from 0 MPa to 0 MPa"
    assert said[3].strip() == answer["shortfall"]
