"""Laws and friction of a user's own go through the same calls as those of the package."""

import re
import sys
from fractions import Fraction as F
from pathlib import Path

import own_parts
import pytest

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.cli.app import app
from quakedesign.errors import CertificateError, UnknownNameError, UnsupportedError, UserCodeError
from quakedesign.fault import friction_law, parse_fault
from quakedesign.fault.fault_schema import template
from quakedesign.fault.fault_toml import fault_toml
from quakedesign.laws import control_law, family
from quakedesign.loop import simulation_scheme
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.symbolic.friction_bounds import friction_bounds
from quakedesign.synthesis import assess
from quakedesign.synthesis.method import method_of

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
    with pytest.raises(CertificateError, match="is not in the package"):
        found.certificate.check()
    assert {"control_coefficient", "friction_slope"} <= {p.name for p in found.premises if p.holds}
    assert found.guarantee.sentence().startswith("none: no analysis of PID")
    assert found.title == "PID"
    assert (found.sampled_stability(), found.compensation, found.feedforward_variants()) == (None, None, ())


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

    with pytest.raises(UnsupportedError, match=r"PID has no design method. Give its class a classmethod design"):
        qd.design(LAB, Silent)


def test_premises_of_a_law_stand_beside_those_of_its_family():
    own = Premise(name="mine", required=F(1), certified=F(2), unit="-")

    class Careful(own_parts.Mislaid):
        def premises(self, fault, certificate):
            return (own,) if fault == LAB and certificate is None else ()

    assert assess(LAB, Careful.from_values(("1e8", "1e8", "1e7"))).premises == (own,)


def test_what_runs_is_asked_of_ones_own_law_too():
    assert qd.guarantee(LAB, controller=own_parts.PID).proof.reason.startswith("no analysis of PID")


def test_a_run_names_ones_own_law():
    law = control_law("own_parts:PID").from_values(("2e7", "2e7", "2e6"))
    run = qd.simulate(REAL, law, scheme="explicit", duration=10 * REAL.sampling_time, compiled=False)
    assert (run.name, run.integral_units) == ("real-fault, PID", ("m s",))
    assert run.outcome.harmless


def test_friction_of_ones_own_stands_in_a_file():
    fault = parse_fault(TEXT, "own.toml", allow_code=True)
    assert fault.friction == own_parts.Hyperbolic(residual=0.2, drop=0.1, critical_slip=0.2)
    assert qd.derive(fault).unstable
    assert friction_bounds(fault.friction).slip_slope == F(1, 2)


def test_the_file_of_such_a_fault_is_read_as_the_same_fault():
    fault = parse_fault(TEXT, "own.toml", allow_code=True)
    assert parse_fault(fault_toml(fault), "again", allow_code=True).friction == fault.friction


ENDS = """
import sys
from own_parts import Hyperbolic, PID
open("ran", "a").close()
class Exits(Hyperbolic):
    def coefficient(self, slip, rate, *state):
        sys.exit(0)
class Fails(Hyperbolic):
    def coefficient(self, slip, rate, *state):
        raise RuntimeError("no")
class ExitsEarly(Hyperbolic):
    def __post_init__(self):
        raise SystemExit(0)
class Bare(Hyperbolic):
    @property
    def bounds(self):
        raise BaseException("bare")
class ExitsLaw(PID):
    def pressure(self, signals):
        sys.exit(0)
"""
PROVED = Path(__file__).parents[1] / "proofs" / "certificates" / "guarantee_no-clock_lab-fault.json"


@pytest.fixture
def code(tmp_path, monkeypatch):
    """Folder of modules that end the process, in which a program is started."""
    monkeypatch.chdir(tmp_path)
    Path("ends.py").write_text(ENDS, encoding="utf-8")
    Path("exits.py").write_text("open('ran', 'a').close(); raise SystemExit(0)", encoding="utf-8")
    yield tmp_path
    for name in ("ends", "exits"):
        sys.modules.pop(name, None)


def answered(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([*arguments])
    return stop.value.code


def with_law(name):
    Path("own.toml").write_text(TEXT.replace("own_parts:Hyperbolic", name), encoding="utf-8")
    return "own.toml"


# Commands that search are refused for their faults before; they take the file as `limits` does.
READING = [("fault", "FILE"), ("derive", "FILE"), ("check", str(PROVED), "--fault", "FILE"), ("simulate", "FILE"),
           ("design", "FILE"), ("guarantee", "FILE"), ("limits", "FILE"), ("campaign", "FILE", "--samples", "1"),
           ("sampling", "FILE"), ("export", "FILE"), ("scale", "real-fault", "FILE"), ("compare", "FILE"),
           ("certify", "elqr", "FILE", "--gains", "1", "1", "1", "1"), ("synthesise", "elqr", "FILE"),
           ("guarantee", "lab-fault", "FILE"), ("identify", "no.csv", "--fault", "FILE")]  # fmt: skip


@pytest.mark.parametrize("command", READING, ids=" ".join)
@pytest.mark.parametrize("law", ["ends:Exits", "exits:X", "os.path:join", "venv.__main__:x"])
def test_no_command_runs_code_that_a_file_names(command, law, code, capsys):
    path = with_law(law)
    assert answered(*(path if word == "FILE" else word for word in command)) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert not (code / "ran").exists()
    if command[0] == "fault":
        assert "add --allow-code, or allow_code=True in Python" in said.err
        with pytest.raises(UnknownNameError, match="allow_code=True"):
            qd.load_fault(path)


@pytest.mark.parametrize("law", ["Exits", "Fails", "ExitsEarly", "Bare"])
def test_code_that_is_allowed_does_not_decide_the_exit_code(law, code, capsys):
    path = with_law(f"ends:{law}")
    assert answered("fault", path, "--quiet", "--allow-code") == 2
    assert re.fullmatch(r"quakedesign: .*ends fails with \w+: .*Fix its code\.\n", capsys.readouterr().err)
    assert answered("fault", path, "--quiet") == 2, "what one call allows, the next does not"
    assert "add --allow-code" in capsys.readouterr().err


def test_a_module_that_exits_is_one_error(code, capsys):
    path = with_law("exits:X")
    with pytest.raises(UnknownNameError, match="SystemExit: 0"):
        qd.load_fault(path, allow_code=True)
    for line in (("fault", path, "--allow-code"), ("check", str(PROVED), "--fault", path, "--allow-code")):
        assert answered(*line) == 2
        assert "fails with SystemExit: 0" in capsys.readouterr().err
    with pytest.raises(UserCodeError, match="ends fails with SystemExit"):
        qd.load_fault(with_law("ends:ExitsEarly"), allow_code=True)


def test_a_law_that_is_typed_and_exits_is_one_error(code, capsys):
    line = ("simulate", "lab-fault", "--controller", "ends:ExitsLaw", "--gains", "1", "1", "1", "--duration", "1")
    assert answered(*line) == 2
    assert "ends fails with SystemExit: 0" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["venv.__main__:x", "__main__:Controller", "quakedesign.__main__:main"])
def test_programs_are_no_modules_of_laws(name, code):
    with pytest.raises(UnknownNameError, match="must not be in __main__"):
        control_law(name)
    with pytest.raises(UnknownNameError, match="must not be in __main__"):
        qd.load_fault(with_law(name), allow_code=True)


def test_every_command_takes_the_option():
    names = [name for name in app if not name.startswith("-")]
    assert all(any("--allow-code" in a.names for a in app[n].assemble_argument_collection()) for n in names)


def test_pages_say_that_files_run_no_code():
    folder = Path(__file__).parents[1]
    for page in ("README.md", "docs/howto/own_friction_law.md", "docs/reference/fault_file.md"):
        text = (folder / page).read_text(encoding="utf-8")
        assert "--allow-code" in text
        assert "allow_code=True" in text
    assert "--allow-code" in template()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("own_parts:Nothing", "fails with AttributeError"),
        ("no_such_module:Law", "fails with ModuleNotFoundError: No module named 'no_such_module'"),
        ("own_parts:Fraction", "a concrete class derived from Controller"),
        ("own_parts:Controller", "must be a concrete class"),
        ("own_parts:X1", "with an attribute name"),
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
