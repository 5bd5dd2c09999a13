"""Laws and friction of a user's own go through the same calls as those of the package."""

import sys
from fractions import Fraction as F

import own_parts
import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.certificates.premises import Premise
from quakedesign.controllers import control_law, family
from quakedesign.errors import CertificateError, UnknownNameError, UnsupportedError
from quakedesign.fault import friction_law, parse_fault
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.symbolic.friction_bounds import friction_bounds
from quakedesign.synthesis import answer, assess
from quakedesign.synthesis.methods.base import method_of

REAL, LAB = qd.load_fault("real-fault"), qd.load_fault("lab-fault")
TEXT = """
name = "own-fault"
source = "tests"
density = "2500 kg/m^3"
shear_modulus = "30 GPa"
length = "5 km"
damping = "1.96e12 kg/s"
effective_normal_stress = "50 MPa"
[friction]
law = "own_parts:Hyperbolic"
residual = 0.2
drop = 0.1
critical_slip = "20 cm"
[task]
target_slip = "30 cm"
operation_time = "1 day"
sampling_time = "0.2 s"
"""


def test_a_linear_law_of_ones_own_is_proved_by_its_class_alone():
    found = qd.design(LAB, own_parts.PID)
    assert found.verdict is Verdict.PROVED
    assert found.certificate.check(own_parts.PID) is Verdict.PROVED
    with pytest.raises(CertificateError, match="is not one of the package"):
        found.certificate.check()
    assert {"control_coefficient", "friction_slope"} <= {p.name for p in found.premises if p.holds}
    assert found.guarantee.sentence().startswith("none: no analysis of PID")
    assert found.title == "PID"
    assert (found.held_loop(), found.compensation, found.feedforward_variants()) == (None, None, ())


def test_a_law_that_states_another_loop_than_its_own_is_not_proved():
    found = assess(LAB, own_parts.Mislaid.from_values(("1e8", "1e8", "1e7")))
    assert (found.verdict, found.certificate) == (Verdict.UNDECIDED, None)


def test_a_sliding_mode_of_ones_own_is_designed_as_those_of_the_package_are():
    assert family("own_parts:OwnTwisting") == own_parts.OwnTwisting.base_gains()
    assert method_of(own_parts.OwnTwisting) is method_of(control_law("cta"))
    assert method_of(own_parts.PID) is not method_of(control_law("elqr"))


@pytest.mark.slow
def test_it_has_the_scale_and_the_premises_of_the_same_law_of_the_package():
    own, known = (qd.design(LAB, law, continuous=True) for law in ("own_parts:OwnTwisting", "cta"))
    assert own.verdict is Verdict.PROVED
    assert own.gains == known.gains
    assert [p.required for p in own.premises] == [p.required for p in known.premises]


def test_a_law_that_says_nothing_of_its_design_has_none():
    class Silent(own_parts.PID):
        design = classmethod(lambda cls, problem: problem.by_method(cls))

    with pytest.raises(UnsupportedError, match=r"no way to design PID is known. Give its class a classmethod design"):
        qd.design(LAB, Silent)


def test_premises_of_a_law_stand_beside_those_of_its_family():
    own = Premise(name="mine", required=F(1), certified=F(2), unit="-")

    class Careful(own_parts.Mislaid):
        def premises(self, fault, certificate):
            return (own,) if fault == LAB and certificate is None else ()

    assert assess(LAB, Careful.from_values(("1e8", "1e8", "1e7"))).premises == (own,)


def test_what_runs_is_asked_of_ones_own_law_too():
    assert answer(LAB, controller=own_parts.PID).found.reason.startswith("no analysis of PID")


def test_a_run_names_ones_own_law():
    law = control_law("own_parts:PID").from_values(("2e7", "2e7", "2e6"))
    run = qd.simulate(REAL, law, scheme="explicit", duration=10 * REAL.sampling_time, compiled=False)
    assert (run.name, run.integral_units) == ("real-fault, PID", ("m s",))
    assert run.outcome.harmless


def test_friction_of_ones_own_stands_in_a_file():
    fault = parse_fault(TEXT, "own.toml")
    assert fault.friction == own_parts.Hyperbolic(residual=0.2, drop=0.1, critical_slip=0.2)
    assert qd.derive(fault).unstable
    assert friction_bounds(fault.friction).slip_slope == F(1, 2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("own_parts:Nothing", "fails with AttributeError"),
        ("no_such_module:Law", "fails with ModuleNotFoundError: No module named 'no_such_module'"),
        ("own_parts:Fraction", "a class with a name that derives from Controller"),
        ("own_parts:Controller", "leaves nothing abstract"),
        ("own_parts:X1", "a class with a name"),
        (":PID", "fails with ValueError"),
    ],
)
def test_what_cannot_be_had_is_one_line(given, said):
    with pytest.raises(UnknownNameError, match=said) as raised:
        control_law(given)
    assert "\n" not in str(raised.value)
    for name in (friction_law, simulation_scheme):
        with pytest.raises(UnknownNameError):
            name(given)


def test_a_module_is_found_where_the_program_is_started(tmp_path, monkeypatch):
    (tmp_path / "beside_me.py").write_text("from own_parts import PID as Mine\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    assert control_law("beside_me:Mine") is own_parts.PID
