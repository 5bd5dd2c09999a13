"""Whatever is written into files, on the command line or into calls is answered, or refused in one line.

A short profile runs by default, the long one, 10 000 commands and 50 000 calls, is slow. Work is bounded by short
tasks; commands and functions that search for minutes are drawn with something wrong, which they have to refuse first.
Commands and their options are those that the command line knows, functions, classes and methods those that are public.
"""

import contextlib
import copy
import importlib
import inspect
import io
import json
import os
import pkgutil
import re
import resource
import shlex
import signal
import time
import warnings
from collections import Counter
from enum import Enum
from fractions import Fraction
from functools import cache, partial
from importlib.resources import files
from inspect import Parameter, isabstract, isclass, isfunction, signature
from pathlib import Path
from random import Random
from typing import is_typeddict

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import quakedesign as qd
from quakedesign import sos
from quakedesign.cli import main
from quakedesign.cli.app import app
from quakedesign.errors import QuakedesignError
from quakedesign.exact import rational
from quakedesign.fault import parse_fault
from quakedesign.guarantees import SampledLoop, guarantee, longest_delay, longest_diffusion_time
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.small_gain import VaryingGain
from quakedesign.laws import summed_integrals
from quakedesign.laws.sampled_law import ErrorModel, RestLimit
from quakedesign.parallel import SIGNALS
from quakedesign.plant import uncertain_plant
from quakedesign.report import Comparison, scale_lines
from quakedesign.simulation.campaign import Space, campaign_problem
from quakedesign.studies import Entry
from quakedesign.symbolic import stability
from quakedesign.symbolic.term_expressions import real_symbols

LONGEST = 60  # seconds of this process
LAB = (files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text(encoding="utf-8")
SHORT = LAB.replace('"1 hour"', '"1 s"').replace('"lab-fault"', '"short"')
PROOFS = sorted(p for p in (Path(__file__).parents[1] / "proofs" / "certificates").glob("*.json"))
PROFILES = [pytest.param(1, id="short"), pytest.param(0, id="long", marks=pytest.mark.slow)]

JUNK = st.one_of(
    st.sampled_from(
        ["", " ", "nan", "inf", "-inf", "-1", "0", "-0", "1e400", "1e-400", "1e999999999", "1/0", "0x10", "１２", "1_0"]
    ),
    st.sampled_from(
        ["x", "[/foo]", "[bold]", "\x1b[2J", "\u202e", "a\nb", "'", '"', "\\", "$(id)", "../..", "∞", "9" * 400]
    ),
    st.sampled_from(
        ["5 MPas", "1 furlong", "30 GPa m", "GPa", "1 s 2", "1e150 s", "1e-150 m", "-3 %", "2 degC", "1 Hz"]
    ),
    st.text(max_size=8),
    st.floats().map(repr),
    st.integers().map(str),
)


@pytest.fixture(autouse=True)
def _memory_stays_below_two_gigabytes():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 2e9


def profile(count, which):
    """Settings of one of the two profiles."""
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
    return settings(max_examples=count[1 - which], deadline=None, suppress_health_check=checks, database=None)


def answer(*arguments):
    """Exit code and both streams of a command that ends in time, with one line if it is refused, and no defect."""
    out, err = io.StringIO(), io.StringIO()
    began = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as the program does for its users
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
    assert time.process_time() - began < LONGEST
    code, said = stop.value.code, err.getvalue()
    assert code in (0, 1, 2), f"{arguments}: {said}"
    assert "Traceback" not in said
    assert not any(c in out.getvalue() + said for c in "\x1b\x07\u202e")
    if code == 2:
        assert said.count("\n") == 1
        assert said.startswith("quakedesign: ")
        assert len(said) < 2100
    return code, out.getvalue(), said


# Fault files


@st.composite
def fault_files(draw):
    """Text of a valid file with a few entries changed, moved, doubled or lost, or with any characters in between."""
    lines = LAB.splitlines()
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(lines) - 1))
        key, equals, value = lines[at].partition(" = ")
        kind = draw(
            st.sampled_from(["value", "text", "magnitude", "magnitude", "bare", "key", "lose", "double", "cut"])
        )
        if kind == "value" and equals:
            literals = [
                "true",
                "[]",
                "{}",
                "1",
                "1e400",
                "nan",
                "inf",
                "1979-05-27",
                "0x1F",
                "1" * 310,
                "1" * 5000,
                "''",
            ]
            lines[at] = f"{key} = {draw(st.sampled_from(literals))}"
        elif kind == "text" and equals:
            lines[at] = f"{key} = {json.dumps(draw(JUNK))}"
        elif kind == "magnitude" and equals:
            power = draw(st.integers(-45, 45) | st.integers(-400, 400))
            unit = value.strip('"').partition(" ")[2]
            lines[at] = f'{key} = "{draw(st.sampled_from(["", "-"]))}3.2e{power} {unit}"'
        elif kind == "bare" and equals:
            lines[at] = f"{key} = {draw(st.floats())!r}"
        elif kind == "key":
            lines[at] = f"{draw(st.text('abc._-', min_size=1, max_size=5))}{equals}{value}"
        elif kind == "lose":
            del lines[at]
        elif kind == "double":
            lines.insert(at, lines[at])
        else:
            lines[at] = lines[at][: draw(st.integers(0, 30))] + draw(st.text(max_size=4))
        lines = lines or [""]
    return "\n".join(lines)


@pytest.mark.parametrize("which", PROFILES)
def test_fault_files(which, tmp_path):
    path = tmp_path / "own.toml"

    @profile((12, 1500), which)
    @given(fault_files(), st.sampled_from([("fault",), ("fault", "--json"), ("derive",)]))
    def check(text, command):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        code, out, _ = answer(command[0], str(path), *command[1:])
        assert code != 1
        if code == 0 and "--json" in command:
            json.loads(out)
        assert [p.name for p in tmp_path.iterdir()] == ["own.toml"]

    check()


# Arguments of commands

NUMBERS = ["1", "0.5", "7/5", "1 ms", "10 ms", "1 kPa", "2", "3", "1e-3", "0.01 s"]
WORDS = [
    "none",
    "cta",
    "dia",
    "elqr",
    "explicit",
    "implicit",
    "compensated",
    "continuous",
    "rk4",
    "stick-slip",
    "printed",
    "paper",
]
QUICK = {"simulate", "export", "scale", "fault", "derive", "check", "sos"}  # all others search
POLYNOMIALS = [
    "x^2 + 1",
    "x**2 - y",
    "x^4 + y^4 - 2*x*y",
    "(x",
    "x^99999",
    "1e999999*x",
    "x/0",
    "ü^2",
    "__import__('os')",
]


FAULTS = ["short.toml", "lab-fault", "nowhere", "no.toml"]
SUBJECTS = {
    "LAW": ["cta", "dia", "elqr", "pid"],
    "POLYNOMIAL": POLYNOMIALS,
    "FILES": [str(PROOFS[0].parent / "motzkin_not-sos.json"), "guarantee.json", "short.toml", "none.json"],
    "ROWS": ["0", "99", "-1", "x"],
}


def commands():
    """Places and options of every command, each with its name; an option also with how many values it takes."""
    for name in (name for name in app if not name.startswith("-")):
        places, options = [], {}
        for argument in app[name].assemble_argument_collection():
            first = argument.names[0]
            if not first.startswith("-"):
                places.append(first)
            elif first not in ("--out", "--force"):
                options[first] = argument.token_count()
        yield name, (places, options)


COMMANDS = dict(commands())


@st.composite
def command_lines(draw):
    """A command with options of its own, right or wrong; commands that search have at least one that is wrong."""
    name = draw(st.sampled_from(sorted(COMMANDS)))
    places, options = COMMANDS[name]
    line = [name]
    for place in places * draw(st.sampled_from([1, 1, 1, 1, 2, 0])):
        line.append(draw(st.sampled_from(SUBJECTS.get(place, FAULTS)) | JUNK))
    for option in draw(st.lists(st.sampled_from(sorted(options)), max_size=4)):
        count, more = options[option]
        values = st.sampled_from(["designed" if name in QUICK else "published", *NUMBERS, *WORDS]) | JUNK
        line += [option, *draw(st.lists(values, min_size=count, max_size=4 if more else count))]
    if name == "simulate":
        line += ["--duration", draw(st.sampled_from(["0.01", "20 ms", "0.5 s"]))]
    if name not in QUICK:
        line += draw(
            st.sampled_from([["--box", "wide"], ["--out", "no/such/place"], ["--colour", "red"], ["--json", "x"]])
        )
    return line


SOUND = """
{fault;fault;derive} {short.toml;lab-fault;real-fault;crustal-patch} | --json
fault {short.toml;real-fault} | --box {paper;ten-percent} | --quiet | --log-level debug
derive {short.toml;lab-fault;creeping-patch} | --latex
scale {lab-fault;real-fault} {short.toml;lab-fault} | --controller {cta;dia;elqr} \
 | --clock {natural-period;operation-time} | --json
simulate short.toml --duration {'20 ms';0.1} | --plant {printed;stick-slip} | --method rk4 \
 | --initial-slip '1 mm' | --json
simulate lab-fault --controller {cta;dia;elqr} --duration '30 ms' | --plant {printed;stick-slip} | --method rk4 \
 | --scheme explicit --substeps {2;10} | --json
simulate lab-fault --controller {cta;dia} --duration {'20 ms';'60 ms'} --scheme {explicit;implicit;semi-implicit} \
 | --delay {'2 ms';'10 ms'} --jitter 1 | --saturation {'1 MPa';'20 MPa'} --withdrawal 0 \
 | --rate-limit '1 MPa/s' | --seed 3 \
 | --quantum '1 kPa' | --lag '5 ms' | --slip-noise-deviation '1 um' | --out run.nc --force \
 | --substeps 10 | --scale 3/2
simulate lab-fault --controller cta --duration '30 ms' --scheme compensated | --weight {0.5;1} \
 | --plant stick-slip | --drift '1 mm/s'
simulate {lab-fault;short.toml} --controller elqr --gains 1e8 1e6 1e7 1e5 --duration '30 ms' --scheme explicit \
 | --quiet | --delay '10 ms' | --differentiator-bound 2 --slip-quantum '0.1 um' --averaging {1;2} \
 | --perturbation '1e-3*sin(time)' | --json
simulate crustal-patch --duration '1 day' \
 | --pressure {'1 MPa';'0 s: 0 MPa, 1 hour: 1 MPa';course.csv} | --plant quasi-dynamic
export lab-fault --out made --force | --controller {cta;dia;elqr} | --scheme {explicit;implicit} \
 | --step '5 ms' | --json
check {CTA;SOS;TWIST;CTA TWIST;ELQR} | --json | --quiet | --fault lab-fault
sos {'x^2 + 1';'x^2 - 1';'x^2*y^2 + x^2 + 1 - y';'2*x^4 + 2*x^3*y - x^2*y^2 + 5*y^4'} | --json \
 | --degree 4 | --verbose | --out p.json --force
sos {'1 - x^2';'x*y'} --on {'x >= 0';'1 - x^2 - y^2 >= 0';'x == 1'} | --on 'y >= 0' | --no-products | --json
attraction field.toml | --everywhere | --json | --out p.json --force
certify {super-twisting --gains 1.5 1.1;cta --gains 25 15 2.3 1.1} --lipschitz {1/2;1} | --json | --out p.json --force
{init own.toml --force;init own.toml --force --law rate-and-state-slip;completion zsh} | --quiet
"""
RARE = """
guarantee lab-fault --gains 1546085894 358137872 1490578667 524519950 | --slip-noise '1 um' \
 | --class rate | --json | --delay '1 ms'
identify record.csv --stiffness '1e-3 1/um' | --law rate-and-state-aging | --seed 2 \
 | --out identified.toml --force | --json
sampling lab-fault --gains published --duration '50 ms' --out sampled --force | --controller {cta;elqr} | --json
export lab-fault --certificate GUARANTEE --out proved --force | --fmu
simulate lab-fault --certificate GUARANTEE --duration '0.2 s' | --plant stick-slip | --saturation '1 MPa' | --json
guarantee real-fault --plant stick-slip | --json | --out stick.json --force
{check STICK;export real-fault --certificate STICK --out stuck --force} | --json
simulate real-fault --certificate STICK --duration '2 s' --plant {stick-slip;printed} | --json
map cta --over k1 k2 --lipschitz 1/2 --points 3 --interior 1 --workers 1 --out mapped --force | --json
"""
"""Lines that are done in a moment, and in seconds: one of {a;b} each, and any of the options after | beside them."""
NAMES = {
    "CTA": "cta_7",
    "TWIST": "super-twisting",
    "SOS": "motzkin_not",
    "ELQR": "elqr_lab",
    "GUARANTEE": "guarantee_lab",
    "STICK": "stick_slip",
}
NAMED = {name: str(next(p for p in PROOFS if p.name.startswith(begin))) for name, begin in NAMES.items()}


@st.composite
def sound_lines(draw, rare=50):
    """A command whose every option is right, and whether it is; in one of four something is lost, doubled or other."""
    text = draw(
        st.sampled_from((RARE if draw(st.integers(1, rare)) == rare else SOUND).replace("\\\n", "").split("\n")[1:-1])
    )
    always, *options = text.split("|")
    chosen = draw(st.lists(st.sampled_from(options), unique=True)) if options else []
    text = re.sub(r"\{(.*?)\}", lambda found: draw(st.sampled_from(found[1].split(";"))), " ".join([always, *chosen]))
    line = [NAMED.get(word, word) for word in shlex.split(text)]
    if draw(st.integers(0, 3)):
        return line, True
    at = draw(st.integers(0 if len(line) < 3 else 1, len(line) - 1))
    swapped = [*line[:at], *line[at : at + 2][::-1], *line[at + 2 :]]
    changes = [line[:at] + line[at + 1 :], [*line[: at + 1], *line[at:]], swapped]
    return draw(st.sampled_from(changes) | JUNK.map(lambda word: [*line[:at], word, *line[at + 1 :]])), False


def test_every_command_is_drawn():
    assert {"guarantee", "limits", "check", "campaign"} <= COMMANDS.keys()
    assert QUICK <= COMMANDS.keys()
    assert all(places and "--json" in options for places, options in COMMANDS.values())


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """Folder with the files that lines name."""
    monkeypatch.chdir(tmp_path)
    time, load = np.arange(60.0), np.maximum(np.arange(60.0), 10 * np.arange(60.0) - 270)
    friction = 0.6 + np.where(time > 30, 0.01 * np.exp(-(load - 30) / 10) - 0.005, 0)
    record = np.column_stack([time, load, friction])
    np.savetxt(
        "record.csv", record, delimiter=",", header="time [s],load_point_displacement [um],friction [1]", comments=""
    )
    for name, text in {
        "short.toml": SHORT,
        "guarantee.json": guaranteed(),
        "field.toml": '[field]\nx = "-x + y"\ny = "-y - x^3"\n',
        "course.csv": "time [s],pressure [MPa]\n0,0\n3600,1\n",
    }.items():
        Path(name).write_text(text, encoding="utf-8")
    return tmp_path


def leaves_nothing_behind(line, place):
    """Exit code of a line that is refused without a file, and prints JSON where it is asked to."""
    before = {p.name for p in place.iterdir()}
    code, out, _ = answer(*line)
    after = {p.name for p in place.iterdir()}
    assert code != 2 or after == before
    assert not any(name.startswith(".") for name in after)
    if code != 2 and "--json" in line:
        json.loads(out)
    return code


@pytest.mark.parametrize("which", PROFILES)
def test_command_lines(which, workplace):
    @profile((15, 2000), which)
    @given(command_lines())
    def check(line):
        assert leaves_nothing_behind(line, workplace) in (0, 1, 2)

    check()


@pytest.mark.parametrize("which", PROFILES)
def test_sound_command_lines(which, workplace):
    """Thousands of them in one process, which is as it was before: handlers of signals, folder, open files."""
    handlers = [signal.getsignal(number) for number in SIGNALS]
    codes, opened = Counter(), len(os.listdir("/dev/fd"))

    @profile((10, 8000), which)
    @given(sound_lines(rare=50 if which == 0 else 10**6))
    def check(drawn):
        codes[leaves_nothing_behind(drawn[0], workplace), drawn[1]] += 1

    check()
    print(dict(codes))  # of exit codes, by whether the line is sound
    assert [signal.getsignal(number) for number in SIGNALS] == handlers
    assert sum(codes.values()) >= (1000 if which == 0 else 10)
    assert Path.cwd() == workplace
    assert len(os.listdir("/dev/fd")) < opened + 20
    assert codes[2, True] == 0
    assert codes[2, False] > 0


PROVED, REFUTED = (str(PROOFS[0].parent / name) for name in ("super-twisting_1.5_1.1.json", "dia_1_20_1_0.json"))
ANSWERED = """
fault {short.toml;lab-fault;real-fault;crustal-patch}
check PROVED
check PROVED {REFUTED;broken.toml}
sos {'x^2 + 1';'x^2 - 1';'x^4 + y^4 - 2*x*y + 1'}
errata {1;2;12}
scale lab-fault real-fault --controller {cta;dia}
export lab-fault --controller cta --out made --force
simulate short.toml --duration '10 ms' --plant {printed;stick-slip}
"""
REFUSED = """
fault {nowhere;no.toml;broken.toml;.}
check PROVED none.json
sos {'(x';'x/0';'__import__("os")'}
errata {99;-1;x}
{design;guarantee;limits;compare;sampling;campaign;figures} nowhere
{design;guarantee;limits;compare} lab-fault --box wide
guarantee real-fault --plant stick-slip {--delay;--lag;--slip-noise;--jitter} {'1 ms';'1 um';-1}
simulate short.toml --duration {0;-1;nan;'1 MPa'}
{simulate;export} lab-fault --controller {nobody;''}
identify {none.csv;short.toml}
{nothing;--nothing;map cta --over k9}
"""


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_each_command_of_a_long_process_prints_one_document_or_one_line(count, workplace):
    """Commands that are answered and refused, in turn: none leaves a stream or a handler to the next."""
    (workplace / "broken.toml").write_bytes(b"[material\n\xff")
    handlers = [signal.getsignal(number) for number in SIGNALS]
    chance, codes = Random(count), Counter()
    for number in range(count):
        refused = number % 2 == 1
        template = chance.choice((REFUSED if refused else ANSWERED).strip().splitlines())
        line = shlex.split(re.sub(r"\{(.*?)\}", lambda found: chance.choice(found[1].split(";")), template))
        line = [{"PROVED": PROVED, "REFUTED": REFUTED}.get(word, word) for word in line]
        code, out, err = answer(*line, "--json")
        codes[code] += 1
        if refused:
            assert (code, out) == (2, ""), line
        else:
            assert (code in (0, 1), err) == (True, ""), (line, err)
            assert isinstance(json.loads(out), dict), line
    assert [signal.getsignal(number) for number in SIGNALS] == handlers
    assert min(codes[0], codes[1]) > 0


# Certificates

GAINS = (1546085894, 358137872, 1490578667, 524519950)


@cache
def guaranteed():
    """File of a guarantee, whose claims are proved."""
    fault = qd.load_fault("real-fault")
    step = rational(fault.sampling_time)
    held = SampledLoop(law=summed_integrals(tuple(map(Fraction, GAINS)), step), step=step)
    return guarantee_text(guarantee(uncertain_plant(fault), held))


@cache
def small():
    """Texts of files that are checked in a moment, those with the same keys together: one list for every kind."""
    texts = [guaranteed(), *(path.read_text(encoding="utf-8") for path in PROOFS if path.stat().st_size < 6000)]
    kinds = {}
    for text in texts:
        kinds.setdefault(tuple(sorted(json.loads(text))), []).append(text)
    return list(kinds.values())


VALUES = st.one_of(
    st.none() | st.booleans() | st.integers(-3, 13) | st.floats() | st.text(max_size=6),
    st.sampled_from(["0", "-1", "1/2", "1/0", "1e5", "nan", "9" * 401, "x**2", 10**400, [], {}, [[]], {"a": 1}, "cta"]),
)


def places(value, path=()):
    """Paths of everything inside a JSON value."""
    yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield from places(entry, (*path, key))


@st.composite
def certificates(draw):
    """Text of a certificate with an entry replaced, lost, renamed or doubled, or with bytes changed."""
    text = draw(st.sampled_from(draw(st.sampled_from(small()))))
    if draw(st.integers(0, 3)) == 0:
        at = draw(st.integers(0, len(text)))
        return text[:at] + draw(st.text(max_size=3)) + text[at + draw(st.integers(0, 3)) :]
    value = json.loads(text)
    for _ in range(draw(st.integers(1, 2))):
        found = [path for path in places(value) if path]
        *above, last = draw(st.sampled_from(found)) if found else ("format",)
        parent = value
        for key in above:
            parent = parent[key]
        kind = draw(st.sampled_from(["replace", "replace", "copy", "lose"]))
        if kind == "replace":
            parent[last] = copy.deepcopy(draw(VALUES))
        elif kind == "lose":
            del parent[last]
        elif isinstance(parent, list):
            parent.append(copy.deepcopy(parent[last]))
        else:
            parent[draw(st.sampled_from(sorted(parent)))] = copy.deepcopy(parent[last])
    return json.dumps(value)


@pytest.mark.parametrize("which", PROFILES)
def test_certificates(which, tmp_path):
    path = tmp_path / "c.json"

    @profile((15, 2500), which)
    @given(certificates(), st.sampled_from([(), ("--fault", "lab-fault"), ("--json",)]))
    def check(text, more):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        code, out, _ = answer("check", str(path), *more)
        assert code == 2 or "--json" not in more or list(json.loads(out)["files"]) == [str(path)]

    check()


# Calls

FAULT = parse_fault(SHORT, "short")
LAWS = qd.published("lab-fault")
VALID = {
    "Fault": [FAULT],
    "Controller": list(LAWS.values()),
    "Law": list(LAWS.values()),
    "SlidingMode": [LAWS["cta"]],
    "FrictionLaw": [FAULT.friction],
    "Reference": [FAULT.reference],
    "float": [0.0, 1.0, 1e-3, -1.0, float("nan"), float("inf"), 1e300, 10**400, Fraction(1, 3)],
    "int": [0, 1, 2, -1, 10**30, np.int64(3)],
    "str": ["cta", "lab-fault", "explicit", "x**2", "slip", "", "\0", "a" * 300],
    "Fraction": [Fraction(1, 2), Fraction(-1), Fraction(10**400), 0],
    "Symbol": [sp.Symbol("x", positive=True), sp.Symbol("y", real=True)],
    "Expr": [sp.Symbol("x"), sp.Integer(2), sp.Symbol("x") ** 2, sp.nan, sp.oo],
    "Path": [Path("none.json"), Path("\0"), Path("/proc/self/none")],
    "bool": [True, False],
}
ANYTHING = [None, 3, -1, 0.5, float("nan"), "x", "\0", b"x", [], [1], {}, {"a": 1}, (), object(), print, int, FAULT, 1j]
ANYTHING += [
    *(np.longdouble(1e-3), np.float32(2), np.array(0.5), np.ma.masked, np.ma.array([1.0, 2.0], mask=[0, 1])),
    *(np.array([]), np.int8(3), 1e300, -1e300, 5e-324, 10**400, range(3), frozenset(), Path("/dev/null"), sp.I),
    np.datetime64(1, "Y"),
]
MINUTES = {"design", "compare", "certify", "assess", "natural_earthquake", "run_campaign", "simulate_state", "prove"}
MINUTES |= {"decide", "largest", "accuracy", "gain_sensitivity", "noise_sensitivity", "velocity_step"}


MINUTES |= {
    "limits",
    "guarantee",
    "design_sampled_law",
    "worst_tracking",
    "judge",
    "gain_map",
    "settling",
    "natural_run",
}
MINUTES |= {"largest_lipschitz", "stability_map", "gain_map_figure", "uncertainty_bounds", "check_files"}


@cache
def values():
    """Values of public classes, whose methods are called."""
    cta, elqr = LAWS["cta"], LAWS["elqr"]
    certificate = qd.load_certificate(PROOFS[0].parent / "super-twisting_1.5_1.1.json")
    claim = parse_guarantee(guaranteed())
    judged = {"certificate": certificate, "verdict": certificate.check(), "premises": ()}
    designs = [qd.Design(fault=FAULT, name=law.name, controller=law, **judged) for law in (cta, elqr)]
    run = qd.simulate(FAULT, elqr, scheme="explicit", duration=0.02)
    entries = tuple(Entry(label="x", origin="designed", design=design, run=run) for design in designs)
    compared = Comparison(fault=FAULT, uncontrolled=run, entries=entries)
    fault = (FAULT, FAULT.friction, FAULT.reference, FAULT.disturbance, FAULT.box)
    laws = (cta, elqr, *designs, *entries, compared, certificate, certificate.loop)
    loop = (claim, claim.task, claim.sampled_loop, claim.claims, claim.sampled_loop.controller)
    several = (campaign_problem(FAULT, elqr, scheme="explicit", duration=0.02), Space.of(FAULT))
    return (
        *fault,
        *laws,
        *loop,
        *several,
        run,
        run.metrics,
        sos.prove("x^2 + 1"),
        sos.Program(["x"], ["a"]),
        qd.limits(FAULT, prove=False),
    )


@cache
def fitting(annotation):
    """Values that an annotation speaks of."""
    known = VALID | {type(value).__name__: [value] for value in values()}
    return [value for kind, found in known.items() if kind in annotation for value in found]


@cache
def public():
    """Public functions and classes by their names, and methods of public classes that take arguments.

    What laws and stages override, the package calls while it builds a loop, with symbols of several libraries.
    """
    found, rooms = {}, [i.name for i in pkgutil.walk_packages(qd.__path__, "quakedesign.") if i.ispkg]
    for room in map(importlib.import_module, (qd.__name__, *rooms)):
        for value in (getattr(room, name) for name in getattr(room, "__all__", ()) if ".cli" not in room.__name__):
            plain = (
                isclass(value)
                and not (isabstract(value) or is_typeddict(value))
                and not issubclass(value, Enum | sp.Basic)
            )
            if (isfunction(value) or plain) and value.__module__.startswith("quakedesign"):
                found[f"{value.__module__}.{value.__name__}"] = value
    for owner in (*(value for value in found.values() if isclass(value)), *values()):
        kind = owner if isclass(owner) else type(owner)
        for name in (name for name in dir(kind) if not name.startswith("_")):
            member = inspect.getattr_static(kind, name)
            called = isinstance(member, classmethod) or (isfunction(member) and owner is not kind)
            overrides = sum(name in vars(base) for base in kind.__mro__) > 1
            if called and not overrides and signature(getattr(owner, name)).parameters:
                found[f"{kind.__name__}.{name}"] = getattr(owner, name)
    return found


@st.composite
def calls(draw):
    """Name of a public function, class or method and its arguments, some of them of the type that is wanted."""
    name = draw(st.sampled_from(sorted(public())))
    given = {}
    for parameter in signature(public()[name]).parameters.values():
        if parameter.default is not Parameter.empty and draw(st.booleans()):
            continue
        given[parameter.name] = draw(st.sampled_from([*ANYTHING, *fitting(str(parameter.annotation)) * 4]))
    single = sorted(k for k in given if signature(public()[name]).parameters[k].kind is not Parameter.VAR_KEYWORD)
    if public()[name].__name__ in MINUTES and single:
        given[draw(st.sampled_from(single))] = object()
    return name, given


@pytest.mark.parametrize("which", PROFILES)
def test_calls(which, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    @profile((120, 50_000), which)
    @given(calls())
    def check(call):
        name, given = call
        kinds = {p.name: p.kind for p in signature(public()[name]).parameters.values()}
        first = [v for k, v in given.items() if kinds[k] is Parameter.POSITIONAL_ONLY]
        rest = [v for k, v in given.items() if kinds[k] is Parameter.VAR_POSITIONAL]
        named = {
            k: v for k, v in given.items() if kinds[k] in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
        }
        began = time.process_time()
        with contextlib.suppress(QuakedesignError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            public()[name](*first, *rest, **named)
        assert time.process_time() - began < LONGEST

    check()


EYE = ((1, 0), (0, 1))
FOUND = [
    (Space.of(FAULT).sample, (np.array(0.5), 0)),
    (Space.of(FAULT).sample, (np.ma.masked, -1)),
    (FAULT.reference.shape, (-1e300,)),
    (FAULT.reference.shape, (np.datetime64(1, "Y"),)),
    (real_symbols, ((i for i in range(3)),)),
    (sos.Program(["x"], ["a"]).proposal, (0.5,)),
    (sos.Program(["x"], ["a"]).proposal, (float("nan"),)),
    (partial(VaryingGain, parts=10**400, growth=Fraction(1)), ()),
    (partial(VaryingGain, parts=-1, growth=Fraction(10**400)), ()),
    (partial(RestLimit, width=3, per_slip=10**400, resolution=0, least=1, largest=10**400), ()),
    (ErrorModel, {"update": (), "command": (), "gain": 1}),
    (ErrorModel.delayed, (EYE, (), 1)),
    (longest_delay, (uncertain_plant(qd.load_fault("real-fault")), Fraction(0))),
    (longest_delay, (uncertain_plant(qd.load_fault("real-fault")), Fraction(10**400))),
    (longest_diffusion_time, (uncertain_plant(qd.load_fault("real-fault")), Fraction(1, 10**20))),
    (ErrorModel, {"update": EYE, "command": (1, 1), "gain": 1, "pressures": ("q",)}),
    (ErrorModel, {"update": EYE, "command": (1, 1, 1), "gain": 1}),
    (partial(stability, FAULT, loading_rate=Fraction(10**400)), ()),
    (partial(stability, qd.load_fault("crustal-patch"), loading_rate=Fraction(10**400)), ()),
    (partial(stability, FAULT, pressure=(Fraction(10**400), Fraction(1))), ()),
    (scale_lines, ({},)),
    (qd.LoopSetup, {"measured": np.array([])}),
    (partial(sos.prove, multiplier=np.array([])), (object(),)),
    (partial(RestLimit, width=Fraction(-1), per_slip=Fraction(10**400), resolution=Fraction(1)), ()),
]


@pytest.mark.parametrize("call", FOUND, ids=lambda call: getattr(call[0], "__qualname__", None))
def test_what_was_found_is_refused(call):
    with pytest.raises(QuakedesignError):
        call[0](**call[1]) if isinstance(call[1], dict) else call[0](*call[1])
