"""Whatever is written into files, on the command line or into calls is answered, or refused in one line.

A short profile runs by default, the long one, ten thousand examples together, is slow. Work is bounded by short
tasks; commands and functions that search for minutes are drawn with something wrong, which they have to refuse first.
"""

import contextlib
import copy
import importlib
import io
import json
import pkgutil
import time
import warnings
from enum import Enum
from fractions import Fraction
from importlib.resources import files
from inspect import Parameter, isabstract, isclass, isfunction, signature
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.errors import QuakedesignError
from quakedesign.fault import parse_fault

LONGEST = 60
LAB = (files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text(encoding="utf-8")
SHORT = LAB.replace('"1 hour"', '"1 s"').replace('"lab-fault"', '"short"')
PROOFS = sorted(p for p in (Path(__file__).parents[1] / "proofs" / "certificates").glob("*.json"))
SMALL = [p.read_text(encoding="utf-8") for p in PROOFS if p.stat().st_size < 6000]
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


def profile(count, which):
    """Settings of one of the two profiles."""
    checks = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
    return settings(max_examples=count[1 - which], deadline=None, suppress_health_check=checks, database=None)


def answer(*arguments):
    """Exit code and both streams of a command that ends in time, with one line if it is refused, and no defect."""
    out, err = io.StringIO(), io.StringIO()
    began = time.perf_counter()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as the program does for its users
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
    assert time.perf_counter() - began < LONGEST
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

    @profile((60, 2500), which)
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
WORDS = ["none", "cta", "dia", "elqr", "explicit", "implicit", "compensated", "continuous", "rk4", "coulomb", "paper"]
COMMANDS = {
    "simulate": "controller gains scale feedforward step scheme substeps method plant drift perturbation delay quantum "
    "saturation withdrawal rate-limit lag diffusion storage cells averaging differentiator-bound filter-order "
    "slip-noise rate-noise bandwidth seed json",
    "export": "controller gains scale feedforward step scheme averaging differentiator-bound filter-order json",
    "scale": "controller gains clock json",
    "fault": "box json",
    "derive": "latex json",
    "check": "fault json",
    "sos": "on multiplier margin degree products verbose json",
    "certify": "gains lipschitz maximize gain-range box feedback step peaks json",
    "synthesise": "objective lipschitz gain-range bound degree starts seed workers step scheme metric json",
    "map": "over gains range lipschitz gain-range points degree interior seed workers json",
    "campaign": "samples controller scheme step duration workers search rerun seed box json",
    "sampling": "controller gains scale schemes duration json",
    "design": "controller box held scheme published-scheme json",
    "compare": "controller box scheme published-scheme json",
    "figures": "controller box scheme published-scheme json",
    "errata": "json",
}
SEARCHES = {"certify", "synthesise", "map", "campaign", "sampling", "design", "compare", "figures", "errata"}
FLAGS = {"json", "latex", "held", "verbose", "products"}
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


@st.composite
def command_lines(draw, short):
    """A command with options of its own, right or wrong; commands that search have at least one that is wrong."""
    name = draw(st.sampled_from(sorted(COMMANDS)))
    wrong = name in SEARCHES
    subject = draw(st.sampled_from([short, "lab-fault", "nowhere", "no.toml"]) | JUNK)
    if name == "sos":
        subject = draw(st.sampled_from(POLYNOMIALS) | JUNK)
    elif name in ("certify", "synthesise", "map"):
        subject = draw(st.sampled_from(["cta", "dia", "elqr", "pid"]) | JUNK)
    elif name == "check":
        subject = draw(st.sampled_from([str(PROOFS[0].parent / "motzkin_not-sos.json"), short, "none.json"]) | JUNK)
    elif name == "errata":
        subject = draw(st.sampled_from(["0", "99", "-1", "x"]))
    line = [name, *([subject] * draw(st.sampled_from([1, 1, 1, 1, 2, 0])))]
    for option in draw(st.lists(st.sampled_from(COMMANDS[name].split()), max_size=4)):
        if option in FLAGS:
            line.append(f"--{option}")
            continue
        values = st.sampled_from(["designed" if name not in SEARCHES else "published", *NUMBERS, *WORDS]) | JUNK
        line += [f"--{option}", *draw(st.lists(values, min_size=1, max_size=1 if option != "gains" else 4))]
    if name == "simulate":
        line += ["--duration", draw(st.sampled_from(["0.01", "20 ms", "0.5 s"]))]
    if wrong:
        line += draw(
            st.sampled_from([["--box", "wide"], ["--out", "no/such/place"], ["--colour", "red"], ["--json", "x"]])
        )
    return line


@pytest.mark.parametrize("which", PROFILES)
def test_command_lines(which, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SHORT, encoding="utf-8")

    @profile((60, 2500), which)
    @given(command_lines("short.toml"))
    def check(line):
        before = {p.name for p in tmp_path.iterdir()}
        code, out, _ = answer(*line)
        after = {p.name for p in tmp_path.iterdir()}
        assert code != 2 or after == before
        assert not any(name.startswith(".") for name in after)
        if code != 2 and "--json" in line:
            json.loads(out)

    check()


# Certificates

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
    text = draw(st.sampled_from(SMALL))
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
            parent[last] = draw(VALUES)
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

    @profile((60, 2500), which)
    @given(certificates(), st.sampled_from([(), ("--fault", "lab-fault"), ("--json",)]))
    def check(text, more):
        path.write_text(text, encoding="utf-8", errors="surrogatepass")
        code, out, _ = answer("check", str(path), *more)
        if "--json" in more and code != 2:
            json.loads(out)

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
MINUTES = {"design", "compare", "certify", "assess", "natural_earthquake", "run_campaign", "simulate_state", "prove"}
MINUTES |= {"decide", "largest", "accuracy", "gain_sensitivity", "noise_sensitivity", "weight_study", "velocity_step"}


def public():
    names = [qd.__name__, *(i.name for i in pkgutil.walk_packages(qd.__path__, "quakedesign.") if i.ispkg)]
    for room in (importlib.import_module(name) for name in names if not name.startswith("quakedesign.cli")):
        for name in getattr(room, "__all__", ()) if hasattr(room, "check_arguments") else ():
            value = getattr(room, name)
            plain = isclass(value) and not isabstract(value) and not issubclass(value, Enum | sp.Basic)
            if (isfunction(value) or plain) and value.__module__.startswith("quakedesign"):
                yield f"{value.__module__}.{name}", value


PUBLIC = dict(public())


@st.composite
def calls(draw):
    """Name of a public function or class and its arguments, some of them of the type that is wanted."""
    name = draw(st.sampled_from(sorted(PUBLIC)))
    given = {}
    for parameter in signature(PUBLIC[name]).parameters.values():
        if parameter.default is not Parameter.empty and draw(st.booleans()):
            continue
        said = str(parameter.annotation)
        fitting = [value for kind, values in VALID.items() if kind in said for value in values]
        given[parameter.name] = draw(st.sampled_from([*ANYTHING, *fitting * 4]))
    if PUBLIC[name].__name__ in MINUTES and given:
        given[draw(st.sampled_from(sorted(given)))] = object()
    return name, given


@pytest.mark.parametrize("which", PROFILES)
def test_calls(which, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    @profile((150, 2500), which)
    @given(calls())
    def check(call):
        name, given = call
        kinds = {p.name: p.kind for p in signature(PUBLIC[name]).parameters.values()}
        first = [v for k, v in given.items() if kinds[k] is Parameter.POSITIONAL_ONLY]
        rest = [v for k, v in given.items() if kinds[k] is Parameter.VAR_POSITIONAL]
        named = {
            k: v for k, v in given.items() if kinds[k] in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
        }
        began = time.perf_counter()
        with contextlib.suppress(QuakedesignError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            PUBLIC[name](*first, *rest, **named)
        assert time.perf_counter() - began < LONGEST

    check()
