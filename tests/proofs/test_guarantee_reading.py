"""What both checkers of a guarantee take from a file: every limit just reached and just passed, and the last steps."""

import copy
import json
from fractions import Fraction as F

import pytest
from standalone_guarantee import CHECK, PATH, checker

from quakedesign.errors import CertificateError
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee, read_guarantee
from quakedesign.plant import fault_plant as package_task

CLAIMS = ("slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure", "largest_pressure")
HELD = {
    "format": 1,
    "kind": "guarantee",
    "fault": {
        "name": "a fault",
        "density": "2",
        "shear_modulus": "3",
        "length": "2",
        "damping": "1",
        "normal_stress": "9",
        "spreads": {"stiffness": "0", "damping": "1/10", "authority": "1/5"},
        "friction": {"static": "2/5", "least": "1/5", "largest": "3/5",
                     "weakening": "1/10", "strengthening": "1/20", "rate_slope": "1/100"},
    },
    "reference": {"shape": ["0", "0", "3", "-2"], "target_slip": "2", "operation_time": "5"},
    "disturbance": {"amplitude": "1/3", "change": "1/7", "growths": {"slip": "1/9", "rate": "-1/9"}},
    "loop": {"step": "1", "delay": "0", "lag": "0", "states": ["z"], "update": [["1"]],
             "measured": [["1", "1"]], "output": ["1"], "feedback": ["1", "1"]},
    "claims": dict(zip(CLAIMS, ("1", "2", "3", "-4", "5"), strict=True)),
}  # fmt: skip


@pytest.fixture
def coarse(monkeypatch):
    """Few parts of the unit interval: cheap, and as strict."""
    monkeypatch.setattr(checker, "HALVINGS", 2)
    monkeypatch.setattr(package_task, "_HALVINGS", 2)


def changed(raw, *changes):
    raw = copy.deepcopy(raw)
    for path, new in changes:
        holder = raw
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = new
    return raw


TERM = {"factor": ["1/2", "1"], "power": "1/3", "of": "slip"}
ROOT = {"pull": [TERM, {"factor": ["1", "1"], "power": "1", "of": [TERM]}], "slopes": ["1/2", "1"], "remainder": "1/9"}
ROOTED = changed(HELD, (("loop", "root"), ROOT), (("loop", "measured"), [["1"] * 3]), (("loop", "feedback"), ["1"] * 3))
BEHIND = changed(HELD, (("loop", "lag"), "1"))
CONTINUOUS = changed(
    HELD,
    (("loop",), {"rates": [["0"]], **{key: HELD["loop"][key] for key in ("states", "measured", "output", "feedback")}}),
)


LAYERED = changed(HELD, (("loop", "diffusion"), "2"))
NOISY = changed(HELD, (("loop", "noise"), {"slip": "1/9", "rate": "1/7"}), (("loop", "feedback"), ["1", "0"]))
PUMPED = changed(HELD, (("loop", "pump"), {"least": "-4", "largest": "5"}))
STEPS = HELD["claims"] | {"largest_step": "5"}
PACED = changed(HELD, (("loop", "pump"), {"rate": "4", "ramp": "1/9"}), (("claims",), STEPS))
JITTERY = changed(HELD, (("loop", "jitter"), {"measured": "1/9", "delay": "1/7"}))
LATE = changed(JITTERY, (("loop", "delay"), "5/4"))
BOTH = changed(JITTERY, (("loop", "pump"), {"rate": "4", "ramp": "1/9"}), (("claims",), STEPS))
ALONE = changed(NOISY, (("loop", "measured"), [["1", "0"]]), (("loop", "noise", "rate"), "0"))


def many(states, delay, lag, diffusion=None):
    """A law of so many states, all integrals."""
    rows = [[str(int(i == j)) for j in range(states)] for i in range(states)]
    loop = HELD["loop"] | {"delay": delay, "lag": lag, "states": [f"z{i}" for i in range(states)], "update": rows}
    loop |= {"diffusion": diffusion} if diffusion else {}
    return changed(HELD, (("loop",), loop | {"measured": [["1", "0"]] * states, "output": ["1"] * states}))


def wide(count):
    return [TERM] * count


LIMITS = [
    (HELD, ("fault", "name"), ["x" * 60, "a-b.c d e_f"], ["", "a+b", "x" * 61, "a\n", "-a", 5, None]),
    *[(HELD, ("fault", key), ["1/9"], ["0", "-1"]) for key in ("density", "shear_modulus", "length", "normal_stress")],
    (HELD, ("fault", "damping"), ["0", "1/2"], ["-1/2"]),
    *[(HELD, ("fault", "spreads", key), ["0", "99/100"], ["1", "-1/10"]) for key in HELD["fault"]["spreads"]],
    (HELD, ("fault", "friction", "least"), ["2/5", "1/100"], ["0", "-1", "41/100"]),
    (HELD, ("fault", "friction", "largest"), ["2/5"], ["39/100"]),
    *[(HELD, ("fault", "friction", key), ["0", "1/2"], ["-1/2"])
      for key in ("weakening", "strengthening", "rate_slope")],
    (HELD, ("reference", "shape"),
     [["0", "0", "3", "-2", *["0"] * 9], ["0", "0", "0", "4", "-3"], ["0", "0", "6", "-8", "3"]],
     [["0", "1"], [], ["1"], ["0", "0", "3", "-2", *["0"] * 10], "x", 5, ["1", "0", "0"], ["0", "0", "6", "-4"],
      ["0", "1", "1", "-1"], ["0", "0", "1"], ["0", "0", "33", "-62", "30"], ["1", "0", "-3", "2"],
      ["0", "0", "3", -2]]),
    *[(HELD, ("reference", key), ["1/2"], ["0", "-1"]) for key in ("target_slip", "operation_time")],
    (HELD, ("disturbance", "amplitude"), ["0", "1" * 400, "1/" + "3" * 400],
     ["-1/2", "1" * 401, "1/0", "2/4", "-0", "01", "1/01", 1, True, None, ["1"], "", "1/", "1 ", "+1"]),
    (HELD, ("disturbance", "change"), ["0", "1/2"], ["-1/2"]),
    (HELD, ("disturbance",), [{"amplitude": "1", "growths": {"slip": "0", "rate": "0"}}],
     [5, "change", [], {"amplitude": "1"}, {"amplitude": "1", "growths": {"slip": "0", "rate": "0", "more": "0"}}]),
    (HELD, ("loop", "step"), ["1/2"], ["0", "-1"]),
    (HELD, ("loop", "delay"), ["8", "1/3"], ["801/100", "-1/100"]),
    (HELD, ("loop", "lag"), ["1/3"], ["-1/100"]),
    (HELD, ("loop", "states"), [["a" * 40], ["Z_9"]],
     [["a" * 41], ["1a"], [""], [5], ["z", 5], ["a b"], ["z", "z"], [], "z", 5]),
    (HELD, ("loop", "update"), [[["1"]]], [[["1", "0"]], [["1"], ["1"]], [], [5], "1", ["1"], 5, {"1": 1}]),
    (HELD, ("loop", "measured"), [[["0", "-1"]]], [[["1"]], [["1", "1", "1"]], [["1", "1"]] * 2, [], ["11"], [5]]),
    (HELD, ("loop", "output"), [["-1"]], [["0"], ["1", "1"], []]),
    (HELD, ("loop", "feedback"), [["0", "0"]], [["1"], ["1", "1", "1"], "11", 5, {"1": 1, "2": 2}]),
    (HELD, ("loop",), [HELD["loop"] | {"step": "1/2", "delay": "4"}], [HELD["loop"] | {"step": "1/2", "delay": "5"}]),
    (HELD, ("loop",), [many(9, "8", "0")["loop"], many(8, "8", "1")["loop"], many(12, "5", "0")["loop"]],
     [5, [], *(many(2, "0", "0")["loop"] | {"states": names} for names in (["z", "z"], ["z", "1a"])),
      many(9, "8", "1")["loop"], many(10, "8", "0")["loop"], many(13, "0", "0")["loop"],
      HELD["loop"] | {"root": ROOT}, HELD["loop"] | {"more": "1"}]),
    (ROOTED, ("loop", "root"), [ROOT], [ROOT | {"more": "1"}, {"pull": [TERM]}, {}, 5, None]),
    (CONTINUOUS, ("loop",), [CONTINUOUS["loop"]], [CONTINUOUS["loop"] | {"more": "1"}, {"rates": [["0"]]}]),
    (CONTINUOUS, ("loop", "noise"), [], [{"slip": "0", "rate": "0"}]),
    (CONTINUOUS, ("loop", "diffusion"), [], ["1"]),
    (CONTINUOUS, ("loop", "pump"), [], [PUMPED["loop"]["pump"]]),
    (CONTINUOUS, ("loop", "applied"), [], [["0"]]),
    (HELD, ("loop", "applied"), [["0"], ["-1/3"]], [[], ["0", "1"], ["0.5"], [0], [["0"]], "0", None, 5, {"0": 1}]),
    (PUMPED, ("loop", "pump"), [{"least": "0", "largest": "5"}, {"least": "-4", "largest": "0"}],
     [{"least": "0", "largest": "0"}, {"least": "1/9", "largest": "5"}, {"least": "-4", "largest": "-1/9"},
      {"least": "-4"}, {"largest": "5"}, {"least": "-4", "largest": "5", "rate": "1"}, {}, [], "5", None, 5]),
    (PACED, ("loop", "pump"), [{"rate": "4", "ramp": "1"}, {"least": "-4", "largest": "0", "rate": "1", "ramp": "1"}],
     [{"rate": "0", "ramp": "1"}, {"rate": "4", "ramp": "0"}, {"rate": "4"}, {"ramp": "1"}, {"rate": "-4", "ramp": "1"},
      {"rate": "4", "ramp": "-1"}, {"rate": "4", "ramp": "11/10"}, {"rate": "4", "ramp": "1", "least": "-4"},
      {"rate": "4", "ramp": "1", "least": "0", "largest": "0"}, {"rate": "4", "ramp": "1", "more": "1"}]),
    (PACED, ("loop", "diffusion"), [], ["1"]),
    (JITTERY, ("loop", "diffusion"), [], ["1"]),
    (CONTINUOUS, ("loop", "jitter"), [], [JITTERY["loop"]["jitter"]]),
    (JITTERY, ("loop", "jitter"),
     [{"measured": "1/2", "delay": "0"}, {"measured": "0", "delay": "1/2"}, {"measured": "1/4", "delay": "1/4"}],
     [{"measured": "0", "delay": "0"}, {"measured": "-1/9", "delay": "1/2"}, {"measured": "1/2", "delay": "-1/9"},
      {"measured": "51/100", "delay": "0"}, {"measured": "1/4", "delay": "13/50"}, {"measured": "1/9"},
      {"delay": "1/9"}, {"measured": "1/9", "delay": "0", "more": "0"}, {}, [], "1/9", None]),
    (JITTERY, ("loop", "jitter"),
     [{"measured": "0", "delay": "0", "mean": "1"}, {"measured": "1/4", "delay": "0", "mean": "1/2"}],
     [{"measured": "0", "delay": "0", "mean": "101/100"}, {"measured": "1/4", "delay": "0", "mean": "51/100"},
      {"measured": "1/9", "delay": "0", "mean": "0"}, {"measured": "1/9", "delay": "0", "mean": "-1"}, {"mean": "1"}]),
    (LATE, ("loop", "jitter"), [{"measured": "1/4", "delay": "0"}, {"measured": "0", "delay": "1/4"}],
     [{"measured": "13/50", "delay": "0"}, {"measured": "0", "delay": "13/50"}]),
    (changed(LATE, (("loop", "delay"), "7/4")), ("loop", "jitter", "delay"), ["5/36"], ["1/6"]),
    (BOTH, ("loop", "pump", "ramp"), ["31/63"], ["32/63"]),
    (changed(BOTH, (("loop", "delay"), "1/2")), ("loop", "pump", "ramp"), ["31/126"], ["16/63"]),
    (JITTERY, ("loop",), [many(12, "3", "1")["loop"] | {"jitter": JITTERY["loop"]["jitter"]}],
     [many(12, "4", "1")["loop"] | {"jitter": JITTERY["loop"]["jitter"]}]),
    (LAYERED, ("loop", "diffusion"), ["1/32", "1/31", "5"], ["1/33", "0", "-1", 1, None]),
    (LAYERED, ("loop",), [many(7, "1", "0", "1")["loop"], many(8, "0", "1", "1")["loop"]],
     [many(8, "1", "0", "1")["loop"], many(8, "1/2", "1", "1")["loop"]]),
    (NOISY, ("loop", "noise"), [{"slip": "0", "rate": "0"}, {"slip": "0", "rate": "1/9"}],
     [{"slip": "1"}, {"rate": "1"}, {"slip": "1", "rate": "1", "time": "1"}, {"slip": "-1/9", "rate": "0"},
      {"slip": "0", "rate": "-1/9"}, {"slip": "0", "rate": 0}, [], "1", None]),
    (NOISY, ("loop", "measured"), [[["1", "1"]]], [[["1", "0"]]]),
    (NOISY, ("loop", "noise", "rate"), ["0", "5"], ["-5"]),
    (ALONE, ("loop", "noise", "rate"), ["0"], ["1/9"]),
    (changed(ALONE, (("loop", "noise", "rate"), "1/9")), ("loop", "feedback"), [["0", "-1"]], [["1", "0"]]),
    (changed(ROOTED, (("loop", "measured"), [["1", "0", "1"]]), (("loop", "feedback"), ["1", "0", "1"])),
     ("loop", "noise"), [{"slip": "0", "rate": "1"}], []),
    (ROOTED, ("loop", "root", "slopes"), [["0", "0"], ["1", "1"], ["0", "1"]],
     [["1/2", "1/4"], ["-1/2", "1"], ["0", "3/2"], ["0", "1", "1"], ["0"], "0"]),
    (ROOTED, ("loop", "root", "remainder"), ["0"], ["-1/2"]),
    (ROOTED, ("loop", "root", "pull"), [wide(1), wide(16), [TERM | {"of": wide(15)}]],
     [[], wide(17), [TERM | {"of": wide(16)}], "slip", 5, [5], [{"factor": ["1", "1"], "power": "1"}]]),
    (ROOTED, ("loop", "root", "pull", 0, "factor"), [["0", "0"], ["0", "3"]],
     [["1", "0"], ["-1", "0"], ["1"], ["1"] * 3]),
    (ROOTED, ("loop", "root", "pull", 0, "power"), ["0", "6", "1/6", "6/5"], ["7", "1/7", "-1", "-1/2"]),
    (ROOTED, ("loop", "root", "pull", 0, "of"), ["rate", wide(2)], ["time", [], 5, None]),
    (ROOTED, ("loop", "feedback"), [["0"] * 3], [["0"] * 2]),
    (ROOTED, ("loop", "measured"), [[["0"] * 3]], [[["0"] * 2]]),
    (CONTINUOUS, ("loop", "rates"), [[["0"]]], [[["1"]], [["0", "0"]], []]),
    (CONTINUOUS, ("loop", "measured"), [[["1", "2"]]], [[["1"]], [["1"] * 3]]),
    (CONTINUOUS, ("loop", "feedback"), [["1", "2"]], [["1"], ["1"] * 3]),
    (CONTINUOUS, ("loop", "output"), [["2"]], [["0"], []]),
    (CONTINUOUS, ("loop", "states"), [["other"]], [["1a"], [], ["z", "y"]]),
]  # fmt: skip


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize(("raw", "path", "taken", "refused"), LIMITS, ids=lambda v: str(v) if type(v) is tuple else "")
def test_both_take_what_is_just_allowed_and_refuse_what_is_just_beyond(raw, path, taken, refused):
    for expected, values in ((True, taken), (False, refused)):
        for value in values:
            given = changed(raw, (path, value))
            try:
                checker.read_loop(given["loop"], checker.read_task(given))
                standalone = True
            except checker.Refused:
                standalone = False
            try:
                parse_guarantee(json.dumps(given))
                package = True
            except CertificateError:
                package = False
            assert (standalone, package) == (expected, expected), value


SLIDING = json.loads((PATH.parent / "certificates" / "sliding_crustal-patch.json").read_text(encoding="utf-8"))
NEGATIVE = [
    (HELD, ("loop", "of_reference"), [["0", "0"], ["0", "0"]], "of_reference must not be zero if given"),
    (HELD, ("start",), {"slip": "0", "rate": "0"}, "start must have a bound above 0"),
    (HELD, ("start",), {"slip": "-1/9", "rate": "1/9"}, "bounds of the initial slip and slip rate"),
    (HELD, ("start",), {"slip": "1/9", "rate": "-1/9"}, "bounds of the initial slip and slip rate"),
    (HELD, ("loop", "diffusion"), "-1", "diffusion"),
    (HELD, ("loop", "longest"), "-1", "the longest step must exceed the step"),
    (HELD, ("loop", "jitter"), {"measured": "-1/9", "delay": "1/2"}, "averaging and ramp must be 0 or more"),
    (HELD, ("loop", "jitter"), {"measured": "1/2", "delay": "-1/9"}, "averaging and ramp must be 0 or more"),
    (HELD, ("loop", "jitter"), {"measured": "1/9", "delay": "0", "mean": "-1"}, "averaging and ramp must be 0 or more"),
    (SLIDING, ("reference", "swing"), "-1/20", "swing of crustal-patch must be from 0 to below 1"),
    (SLIDING, ("cells",), [["rate", "1/2"], [], []], "a cut must be along one of direct_effect"),
    (SLIDING, ("cells",), [["direct_effect"], [], []], "a cut must be one of direct_effect, .* and a number"),
]  # fmt: skip


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize(("raw", "path", "value", "said"), NEGATIVE)
def test_the_package_names_the_rule_that_a_file_breaks(raw, path, value, said):
    given = changed(raw, (path, value))
    with pytest.raises(CertificateError, match=said):
        parse_guarantee(json.dumps(given))
    with pytest.raises(CHECK.Refused):
        CHECK.check(json.dumps(given))


OF_REFERENCE = [["1/3", "1/5"], ["0", "1/7"]]


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (changed(HELD, (("loop", "of_reference"), [["0", "0"], ["0", "0"]])), "of_reference must not be zero if given"),
        *((changed(raw, (("loop", "of_reference"), OF_REFERENCE)), "without diffusion, root and longest")
          for raw in (LAYERED, ROOTED, changed(HELD, (("loop", "longest"), "11/10")))),
    ],
)  # fmt: skip
def test_gains_of_the_reference_are_refused_where_no_theorem_covers_them(raw, reason):
    with pytest.raises(checker.Refused, match=reason):
        checker.read_loop(raw["loop"], checker.read_task(raw))
    with pytest.raises(CertificateError):
        parse_guarantee(json.dumps(raw))


@pytest.mark.parametrize("errors", [(1, 0), (0, 1), (1, 1)])
def test_a_law_in_continuous_time_starts_at_rest(errors):
    task = checker.read_task(CONTINUOUS)
    found = checker.read_loop(CONTINUOUS["loop"], task, [F(0), F(0)])
    assert (found.start, found.longest, found.layer, found.asked, found.stepped) == ([], 0, 0, False, False)
    with pytest.raises(checker.Refused, match="must start at rest"):
        checker.read_loop(CONTINUOUS["loop"], task, list(map(F, errors)))


def test_the_box_of_initial_conditions_has_the_law_s_answer_to_errors_and_to_their_noise():
    raw = changed(NOISY, (("loop", "first"), [["2", "3"]]))
    found = checker.read_loop(raw["loop"], checker.read_task(raw), [F(1, 2), F(1, 5)]).start
    assert [column[:3] for column in found] == [
        [F(1, 2), 0, 1], [0, 0, F(2, 9)], [0, F(1, 5), F(3, 5)], [0, 0, F(3, 7)]
    ]  # fmt: skip


WITHOUT_RATE = [[["1", "0"]], ["1", "0"]]


@pytest.mark.parametrize(
    ("raw", "heard"),
    [
        (HELD, []),
        (changed(HELD, *zip((("loop", "measured"), ("loop", "feedback")), WITHOUT_RATE, strict=True)), [0]),
        (changed(HELD, (("loop", "measured"), [["1", "1"]]), (("loop", "feedback"), ["1", "0"])), [0, 1]),
        (changed(HELD, (("loop", "measured"), [["1", "0"]]), (("loop", "feedback"), ["1", "1"])), [0, 1]),
        (changed(ROOTED, (("loop", "measured"), [["1", "0", "1"]]), (("loop", "feedback"), ["1", "0", "1"])), [0, 1]),
    ],
)
def test_a_timing_error_is_an_error_of_what_the_law_uses(raw, heard):
    late = {"jitter": {"measured": "1/9", "delay": "0"}} if heard else {}
    assert checker.read_loop(raw["loop"] | late, checker.read_task(raw)).told == heard


@pytest.mark.usefixtures("coarse")
def test_a_largest_step_is_claimed_where_it_counts_alone_and_has_to_be_for_a_pump_of_some_rate(monkeypatch):
    """Steps of 1/5 m/s², 5 Pa with b = 1/25 m²/kg; ramps of 1/9 s at 45 Pa/s are just enough for them."""
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(0), F(0), F(0), F(1, 5)], F(1, 3)))
    rest = checker.read_task(HELD).rest
    wide = STEPS | {"least_pressure": str(rest[0]), "largest_pressure": str(rest[1])}
    enough = changed(PACED, (("claims",), wide), (("loop", "pump", "rate"), "45"))
    said = checker.verify(enough)
    assert said[2].endswith(", a pump of 45 Pa/s whose limits are never reached")
    assert said[6].endswith(" Pa, changes of at most 5 Pa per sample")
    with pytest.raises(checker.Refused, match="must fit into the ramp of the pump"):
        checker.verify(changed(enough, (("loop", "pump", "rate"), "449/10")))
    with pytest.raises(checker.Refused, match="claim largest_step must follow"):
        checker.verify(changed(enough, (("claims", "largest_step"), "499/100")))
    missing = {name: v for name, v in wide.items() if name != "largest_step"}
    for raw, claims, why in (
        (enough, missing, "needs the claim largest_step"),
        (
            HELD,
            wide,
            "only with jitter or a pump rate",
        ),
    ):
        with pytest.raises(checker.Refused, match=why):
            checker.verify(changed(raw, (("claims",), claims)))
        with pytest.raises(CertificateError, match=why):
            read_guarantee(changed(raw, (("claims",), claims)))
    assert checker.verify(changed(JITTERY, (("claims",), missing)))[2].endswith(
        "measurements within 1/9 s of their instants, pressures within that plus 1/7 s"
    )
    mean = changed(JITTERY, (("loop", "jitter", "mean"), "1/9"), (("claims",), missing))
    assert ", each averaged over 1/9 s around its instant, measurements within 1/9 s" in checker.verify(mean)[2]
    assert read_guarantee(changed(JITTERY, (("claims",), missing))).claims.largest_step is None


@pytest.mark.parametrize("name", [*CLAIMS, "least_asked", "largest_asked"])
def test_every_claim_may_be_what_follows_and_no_less(name, monkeypatch):
    """Bounds 1 m, 2 m/s and, of the push, 1/25 m/s², at the valve 4 m/s², with b = 1/25 m²/kg; the rest by the task."""
    task = checker.read_task(HELD)
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(1), F(2), F(1, 25), F(4)], F(1, 3)))
    assert task.b == F(1, 25)
    low, high = task.rest
    tight = (F(1), F(2), 2 + task.reference_rate, low - 1, high + 1, low - 100, high + 100)
    claims = dict(zip([*CLAIMS, "least_asked", "largest_asked"], map(str, tight), strict=True))
    found = checker.verify(BEHIND | {"claims": claims})
    ends = checker.lower(tight[5]), checker.upper(tight[6])
    assert found[6].endswith(f", at the valve from {ends[0]} Pa to {ends[1]} Pa")
    side = 1 if name.startswith("least") else -1
    with pytest.raises(checker.Refused, match=f"claim {name} must follow"):
        checker.verify(BEHIND | {"claims": claims | {name: str(F(claims[name]) + F(side, 10**12))}})
    assert checker.verify(BEHIND | {"claims": claims | {name: str(F(claims[name]) - F(side, 10**12))}})
    fewer = {key: claims[key] for key in CLAIMS}
    assert "valve" not in "".join(checker.verify(BEHIND | {"claims": fewer})[3:])
    with pytest.raises(checker.Refused, match="least_asked, largest_asked"):
        checker.verify(BEHIND | {"claims": fewer | {"least_asked": claims["least_asked"]}})
    with pytest.raises(checker.Refused, match="claims on the valve pressure need a lag"):
        checker.verify(HELD | {"claims": claims})


@pytest.mark.parametrize(("raw", "names"), [(HELD, CLAIMS[3:]), (BEHIND, ("least_asked", "largest_asked"))])
def test_what_is_claimed_at_the_valve_may_touch_the_limits_of_its_pump_and_not_pass_them(raw, names, monkeypatch):
    """Claims of the fault's pressure are from -4 to 5 Pa, in all that is derived; those of the valve twice that."""
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(0)] * 4, F(1, 3)))
    given = checker.read_task(HELD)
    given.rest = (F(-1), F(1))
    monkeypatch.setattr(checker, "read_task", lambda _: given)
    claims = HELD["claims"] | dict(zip(names, ("-8", "10"), strict=True))
    for least, largest, holds in (("-8", "10", True), ("-79/10", "10", False), ("-8", "99/10", False)):
        pumped = changed(raw, (("loop", "pump"), {"least": least, "largest": largest}), (("claims",), claims))
        if holds:
            assert checker.verify(pumped)[2].endswith(", a pump from -8 Pa to 10 Pa whose limits are never reached")
        else:
            with pytest.raises(checker.Refused, match="must stay within the limits of the pump"):
                checker.verify(pumped)
    fewer = changed(BEHIND, (("loop", "pump"), {"least": "-8", "largest": "10"}))
    with pytest.raises(checker.Refused, match="a pump before a lag or diffusion path needs claims on its pressure"):
        checker.verify(fewer)


def test_a_pressure_that_reaches_the_effective_normal_stress_is_refused(monkeypatch):
    """σ′ = 9 Pa and b = 1/25 m²/kg: a push of (9 − p*)/25 reaches it, in the fault; at the valve it may be larger."""
    given = checker.read_task(HELD)
    room = (given.normal_stress - given.rest[1]) / 25
    claims = {**HELD["claims"], "least_pressure": "-99", "largest_pressure": "99"}
    for raw, more in ((HELD, ()), (BEHIND, (2 * room,))):
        monkeypatch.setattr(checker, "bounds", lambda *_, m=more: ([F(0), F(0), room * F(999, 1000), *m], F(1, 3)))
        assert checker.verify(raw | {"claims": claims})
        monkeypatch.setattr(checker, "bounds", lambda *_, m=more: ([F(0), F(0), room, *m], F(1, 3)))
        with pytest.raises(checker.Refused, match="the pressure must not open the fault"):
            checker.verify(raw | {"claims": claims})


@pytest.mark.usefixtures("coarse")
def test_the_package_reads_claims_about_the_valve_behind_a_lag_alone_and_both_or_none():
    both = {"least_asked": "-1", "largest_asked": "1"}
    found = parse_guarantee(json.dumps(BEHIND | {"claims": HELD["claims"] | both})).claims
    assert (found.least_asked, found.largest_asked) == (-1, 1)
    assert parse_guarantee(json.dumps(BEHIND)).claims.least_asked is None
    for name in both:
        with pytest.raises(CertificateError, match="both of least_asked and largest_asked, or neither"):
            parse_guarantee(json.dumps(BEHIND | {"claims": HELD["claims"] | {name: both[name]}}))
    for raw in (HELD, CONTINUOUS):
        with pytest.raises(CertificateError, match="claims on the valve pressure need a lag"):
            parse_guarantee(json.dumps(raw | {"claims": HELD["claims"] | both}))


@pytest.mark.parametrize(
    ("path", "value"), [(("format",), None), (("more",), 1), (("claims", "more"), "1"), (("claims", "slip_error"), 1)]
)
def test_files_with_other_keys_or_claims_are_refused(path, value):
    raw = changed(HELD, (path, value))
    if value is None:
        del raw["format"]
    with pytest.raises(checker.Refused, match=r"must have exactly the keys|must be a rational"):
        checker.verify(raw)
    with pytest.raises(CertificateError):
        read_guarantee(raw)


@pytest.mark.parametrize("claims", [5, None, True, "slip_error", ["slip_error"]])
def test_claims_that_are_no_object_are_refused(claims):
    with pytest.raises(checker.Refused, match="claims"):
        checker.verify(changed(HELD, (("claims",), claims)))


def test_the_package_reads_this_format_and_kind_alone():
    assert read_guarantee(HELD).task.name == "a fault"
    for change in (
        {"format": 2},
        {"format": True},
        {"format": 1.0},
        {"format": "1"},
        {"kind": "proof"},
        {"kind": None},
    ):
        with pytest.raises(CertificateError, match="must be"):
            read_guarantee(HELD | change)


def test_the_text_of_a_file_has_a_line_for_every_entry_and_no_forward_part_of_zero():
    for raw in (HELD, ROOTED, CONTINUOUS):
        text = guarantee_text(read_guarantee(raw))
        assert json.loads(text) == raw
        assert text.startswith('{\n "format": 1,\n "kind": "guarantee",\n "fault": {\n  "name": "a fault",\n')
        assert text.endswith("}\n")


@pytest.mark.parametrize(("slip_rate", "holds"), [("1/4", True), ("1/2", False)])
def test_the_root_must_lie_between_its_lines_for_the_errors_that_are_claimed(slip_rate, holds, monkeypatch):
    """w = e2 − sign(e1 + w)/3 is 0 where |e2| ≤ 1/3."""
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(0), F(0), F(0)], F(1, 3)))
    sign = {"pull": [{"factor": ["1/3", "1/3"], "power": "0", "of": "slip"}], "slopes": ["0", "0"], "remainder": "0"}
    task = checker.read_task(HELD)
    tight = ("0", slip_rate, "9", str(task.rest[0]), str(task.rest[1]))
    raw = changed(ROOTED, (("loop", "root"), sign), (("claims",), dict(zip(CLAIMS, tight, strict=True))))
    if holds:
        assert "law with 1 states and an implicit step, every 1 s, 0 s late, lag 0 s" in checker.verify(raw)
    else:
        with pytest.raises(checker.Refused, match="root of the implicit step"):
            checker.verify(raw)


def test_the_statement_has_every_number_on_its_outer_side_and_those_of_the_disturbance_on_the_inner():
    """What holds for |φ| ≤ 1/3 holds for 0.3333, not for 0.3334."""
    task = checker.read_task(HELD)
    task.s, task.w, task.beta, task.b = (F(-1, 3), F(2, 3)), (F(-2, 3), F(1, 3)), (F(1), F(1, 3)), F(2, 3)
    claims = dict(zip(CLAIMS, (F(1, 3), F(2, 3), F(1, 7), F(-1, 3), F(2, 3)), strict=True))
    raw = changed(HELD, (("loop", "delay"), "1/3"), (("loop", "lag"), "2/3"))
    assert checker.statement(raw, task, claims, F(1, 3)) == [
        'fault "a fault" (a label; the data of the file define it), friction any function of slip and slip rate '
        "within its bounds and slopes, linearly continued to negative slip rates, parameters constant",
        "derived accelerations: per slip error [-0.3334, 0.6667] 1/s^2, per slip-rate error minus [-0.6667, 0.3334] "
        "1/s, per pressure 0.6667 m^2/kg times [1, 0.3334]",
        "law with 1 states, every 1 s, 1/3 s late, lag 2/3 s",
        "disturbance: any acceleration of at most 0.3333 m/s^2 that starts at 0 and changes by at most 0.1428 m/s^3; "
        "from rest, along the reference, for all t >= 0; small gain 0.3334",
        "the slip rate of this fault never exceeds 0.1429 m/s",
        "|slip - reference| <= 0.3334 m, |slip rate - reference's| <= 0.6667 m/s",
        "pressure from -0.3334 Pa to 0.6667 Pa",
    ]
    task.change, task.name = None, "größe"
    lines = checker.statement(changed(CONTINUOUS), task, claims, F(1, 3))
    assert lines[0].startswith('fault "gr\\xf6\\xdfe" (a label')
    at_once = "in continuous time (pressure without sampling or delay), which excludes sampled controllers"
    assert lines[2] == f"law with 1 states, {at_once}"
    assert lines[3].startswith("disturbance: any acceleration of at most 0.3333 m/s^2; from rest")


def test_a_layer_in_numbers():
    """L²/D = 2 s, every second: e1, e2, z, the valve, eight modes and the last step."""
    task, pi = checker.read_task(LAYERED), F("3.14159265358979323846")
    shares, rates = zip(
        *((F(4 * (-1) ** n, 2 * n + 1) / pi, F((2 * n + 1) ** 2, 8) * pi**2) for n in range(9)), strict=True
    )
    loop = checker.read_loop(LAYERED["loop"], task)
    assert [loop.flow[4 + n][4 + n] for n in range(8)] == [-rate for rate in rates[:8]]
    assert loop.outputs[2] == [0, 0, 0, 1, *shares[:8], 0]
    height, floor = shares[8] * (1 + 1 / rates[8]), F(3 * 6 * 8, 10**20)
    assert loop.outputs[3] == [F(0)] * 12 + [height + floor]
    assert loop.fade == checker.Fade(0, height / (height + floor), rates[8], floor / (height + floor))
    assert [128 * cut for cut in loop.cuts] == [0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128]
    assert [2 * cut for cut in loop.past_cuts] == [0, 1, 2]
    lagging = changed(LAYERED, (("loop", "lag"), "1/3"))
    loop = checker.read_loop(lagging["loop"], task)
    assert loop.outputs[3] == [F(i == 4) * 3 * (shares[8] / rates[8] + F(2 * 6 * 8, 10**20)) for i in range(13)]
    assert loop.fade is None
    plain = checker.read_loop(HELD["loop"], task)
    assert list(plain.cuts) == list(plain.past_cuts) == [F(i, 8) for i in range(9)]


@pytest.mark.parametrize("lag", ["0", "1/3"])
def test_the_statement_says_what_rock_there_is(lag):
    raw = changed(LAYERED, (("loop", "lag"), lag))
    said = f"law with 1 states, every 1 s, 0 s late, lag {lag} s, diffusion path of distance^2/diffusivity = 2 s"
    assert checker.statement(raw, checker.read_task(raw), dict.fromkeys(CLAIMS, F(1)), F(1, 3))[2] == said
    claim, lagging = read_guarantee(raw), "" if lag == "0" else ", through a lag of 0.333334 s"
    assert (
        f"with zero-order hold over 1 s{lagging}, through a diffusion path of L^2/D = 2 s, with exact"
        in claim.sentence()
    )
    assert json.loads(guarantee_text(claim)) == raw
    assert "diffusion path" not in read_guarantee(HELD).sentence()


@pytest.mark.parametrize(
    ("seen", "feedback", "alone"), [("0", "0", True), ("1/3", "0", False), ("0", "-1", False), ("1", "1", False)]
)
def test_the_statement_says_what_is_measured_and_how_well(seen, feedback, alone):
    claims = dict.fromkeys(CLAIMS, F(1))
    raw = changed(HELD, (("loop", "measured"), [["1", seen]]), (("loop", "feedback"), ["1", feedback]))
    told = ", slip alone measured" if alone else ""
    said = f"law with 1 states{told}, every 1 s, 0 s late, lag 0 s"
    assert checker.statement(raw, checker.read_task(raw), claims, F(1, 3))[2] == said
    raw = changed(raw, (("loop", "noise"), {"slip": "1/9", "rate": "0" if alone else "1/7"}))
    said += ", measured slip within 1/9 m of the true one" + ("" if alone else ", slip rate within 1/7 m/s")
    assert checker.statement(raw, checker.read_task(raw), claims, F(1, 3))[2] == said


def test_a_law_with_an_implicit_step_measures_the_slip_rate():
    raw = changed(ROOTED, (("loop", "measured"), [["1", "0", "1"]]), (("loop", "feedback"), ["1", "0", "1"]))
    raw = changed(raw, (("loop", "noise"), {"slip": "0", "rate": "1/7"}))
    said = checker.statement(raw, checker.read_task(raw), dict.fromkeys(CLAIMS, F(1)), F(1, 3))[2]
    assert said.startswith("law with 1 states and an implicit step, every 1 s")
    assert said.endswith("measured slip within 0 m of the true one, slip rate within 1/7 m/s")


def test_the_root_must_lie_between_its_lines_for_the_noise_on_top(monkeypatch):
    """w = e2 − sign(e1 + w)/3 is 0 for e1 = 0 where |e2| ≤ 1/3; as measured, by 1/4 and a noise below 1/12."""
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(0), F(0), F(0)], F(1, 3)))
    sign = {"pull": [{"factor": ["1/3", "1/3"], "power": "0", "of": "slip"}], "slopes": ["0", "0"], "remainder": "0"}
    task = checker.read_task(HELD)
    tight = ("0", "1/4", "9", str(task.rest[0]), str(task.rest[1]))
    raw = changed(ROOTED, (("loop", "root"), sign), (("claims",), dict(zip(CLAIMS, tight, strict=True))))
    assert checker.verify(changed(raw, (("loop", "noise"), {"slip": "0", "rate": "1/13"})))
    for noise in ({"slip": "0", "rate": "1/11"}, {"slip": "1/100", "rate": "0"}):
        with pytest.raises(checker.Refused, match="root of the implicit step"):
            checker.verify(changed(raw, (("loop", "noise"), noise)))
    late = changed(raw, (("loop", "jitter"), {"measured": "1/9", "delay": "0"}))
    with pytest.raises(checker.Refused, match="root of the implicit step"):  # the slip of the reference until then
        checker.verify(late)
    monkeypatch.setattr(checker, "bounds", lambda *_: ([F(0)] * 4, F(1, 3)))
    assert checker.verify(changed(late, (("loop", "jitter"), {"measured": "0", "delay": "1/9"})))
    asked = []
    monkeypatch.setattr(checker, "root_within", lambda _root, _step, *errors: asked.append(errors) or True)
    both = changed(late, (("loop", "noise"), {"slip": "1/100", "rate": "1/13"}))
    assert checker.verify(both)
    moved = task.reference_rate / 9, task.reference_acceleration / 9
    assert asked == [(F(1, 100) + moved[0], F(1, 4) + F(1, 13) + moved[1])]


def test_zero_has_no_sign():
    assert checker.upper(F(0)) == checker.lower(F(0)) == "0"


@pytest.mark.parametrize("value", ["1/3", "2/3", "99999", "100001", "10000", "1/99999", "123456789", "3/10000000", "0"])
@pytest.mark.parametrize("sign", [1, -1])
def test_four_digits_are_the_nearest_on_the_outer_side(value, sign):
    value = sign * F(value)
    up, down = (F(repr(float(text))) for text in (checker.upper(value), checker.lower(value)))
    assert down <= value <= up
    assert up - value <= abs(value) / 1000
    assert value - down <= abs(value) / 1000
    assert (checker.upper(F(12345)), checker.lower(F(12345))) == ("1.235e+04", "1.234e+04")


def test_numbers_beyond_those_of_floats_and_longer_than_python_writes_are_not_rounded_inward():
    small, large = F(1, 10**340), 10**340 + F(1, 3)  # 0 and infinity as floats
    assert (checker.upper(small), checker.lower(small), checker.upper(-small)) == (
        "1000e-343",
        "1000e-343",
        "-1000e-343",
    )
    assert (checker.upper(large), checker.lower(large), checker.lower(-large)) == ("1001e337", "1000e337", "-1001e337")
    long = F(3**10_000 + 1, 7 * 3**10_000)  # 4772 digits, more than Python writes
    assert (checker.upper(long), checker.lower(long)) == ("0.1429", "0.1428")


def test_a_slow_gain_is_read_to_its_limits_and_needs_friction_of_slip_and_samples():
    steady, held = changed(HELD, (("fault", "friction", "rate_slope"), "0")), HELD["loop"]
    task, jumpy = checker.read_task(steady), checker.read_task(HELD)
    loop = checker.read_loop(held, task)
    for parts in (1, 16):
        assert checker.read_slow({"parts": parts, "growth": "1/9"}, task, loop) == checker.Slow(parts, F(1, 9))
    for wrong in ({"parts": 0}, {"parts": 17}, {"parts": "2"}, {"parts": True}, {"growth": "0"}, {"growth": "-1/9"}):
        with pytest.raises(checker.Refused, match="1 to 16 parts, growth > 0"):
            checker.read_slow({"parts": 2, "growth": "1"} | wrong, task, loop)
    at_once = checker.read_loop(CONTINUOUS["loop"], task)
    for given, other in ((jumpy, loop), (task, at_once), (jumpy, at_once)):
        with pytest.raises(checker.Refused, match="friction of the slip alone and a sampled law"):
            checker.read_slow({"parts": 2, "growth": "1"}, given, other)


@pytest.mark.usefixtures("coarse")
def test_a_slow_gain_is_refused_from_a_file_that_breaks_its_rules():
    slow = {"parts": 2, "growth": "1/9"}
    steady, at_once = (changed(raw, (("fault", "friction", "rate_slope"), "0")) for raw in (HELD, CONTINUOUS))
    found = read_guarantee(steady | {"slow_gain": slow}).varying_gain
    assert (found.parts, found.growth) == (2, F(1, 9))
    assert read_guarantee(steady).varying_gain is None
    assert json.loads(guarantee_text(read_guarantee(at_once))) == at_once
    for wrong in ({"parts": "2"}, {"parts": True}, {"parts": 2.0}):
        with pytest.raises(CertificateError, match=r"slow_gain.parts: expected `int`"):
            read_guarantee(steady | {"slow_gain": slow | wrong})
    for wrong, said in (
        (steady | {"slow_gain": slow | {"more": "1"}}, "slow_gain.*unknown|slow_gain.*must be a known key"),
        (steady | {"more": "1"}, "unknown field `more`"),
        (at_once | {"slow_gain": slow}, "unknown field `slow_gain`"),
        (HELD | {"slow_gain": slow}, "friction that depends on the slip alone"),
        (steady | {"slow_gain": slow | {"parts": 17}}, "1 to 16 parts"),
        (5, "an object"),
        (None, "an object"),
    ):
        with pytest.raises(CertificateError, match=said):
            read_guarantee(wrong)


@pytest.mark.usefixtures("coarse")
def test_the_slip_error_on_which_a_slow_gain_rests_stays_below_its_claim(monkeypatch):
    wide = (("claims", "least_pressure"), "-99"), (("claims", "largest_pressure"), "99")
    steady, asked = changed(HELD, (("fault", "friction", "rate_slope"), "0"), *wide), []
    slow = steady | {"slow_gain": {"parts": 3, "growth": "1/9"}}

    def verified(raw, slip):
        monkeypatch.setattr(checker, "bounds", lambda *given: asked.append(given) or ([slip, F(0), F(0)], F(1, 2)))
        return checker.verify(raw)[0]

    first = 'fault "a fault" (a label; the data of the file define it), friction any function of the slip alone '
    first += "within its bounds and slopes, linearly continued to negative slip rates, parameters constant"
    assert [verified(slow, F(999, 1000)), verified(steady, F(1))] == [first, first]
    assert [given[2:] for given in asked] == [(checker.Slow(3, F(1, 9)), F(1)), (None, F(1))]
    for slip in (F(1), F(2)):
        with pytest.raises(checker.Refused, match="with slow_gain the slip error must stay below its claim"):
            verified(slow, slip)
    with pytest.raises(checker.Refused, match="the file"):
        verified(steady | {"more": "1"}, F(0))


@pytest.mark.parametrize(
    ("low", "high", "digits"),
    [("1/3", "2/3", 4), ("0.60000122360451", "0.60000122360559", 13), ("0.0098", "0.0102", 4), ("2/3", "200001/3", 4)],
)
def test_ranges_are_shown_on_their_inner_side_with_as_many_digits_as_it_takes(low, high, digits):
    low, high = F(low), F(high)
    left, right = map(F, checker.inside(low, high).removeprefix("in [").removesuffix("]").split(", "))
    assert low <= left < right <= high
    assert max(left / low, high / right) <= 1 + F(1, 10 ** (digits - 1))


def test_points_and_what_is_narrower_than_fifteen_digits_are_shown_exactly():
    for value, shown in ((F(1, 125), "0.008"), (F(1, 3), "1/3"), (F(50 * 10**6), "50000000"), (F(10**330), "1e+330")):
        assert F(checker.inside(value, value).removeprefix("= ")) == value == F(shown)
    assert checker.inside(F(1, 125), F(1, 125)) == "= 0.008"
    assert checker.inside(F(1, 3), F(1, 3)) == "= 1/3"
    for digits in (15, 16):
        long = F(int("1234567890123456"[:digits]), 10**20)
        assert checker.exact(long) == (f"{float(long):.15g}" if digits == 15 else str(long))
    for width in (F(1, 10**20), F(4, 10**16)):
        low, high = F(1, 3), F(1, 3) + width
        assert checker.inside(low, high) == f"in [{low}, {high}]"
    assert checker.inside(F(1, 3), F(1, 3) + F(25, 10**16)) == "in [0.333333333333334, 0.333333333333335]"
    assert checker.inside(F(1, 3), F(2, 3)) == "in [0.3334, 0.6666]"


@pytest.mark.parametrize("bounds", [("0", "0"), ("-1", "0"), ("-1", "2"), ("2", "-1")])
def test_bounds_of_a_start_are_not_negative_and_one_is_above_zero(bounds):
    with pytest.raises(checker.Refused, match="bounds of the start must be >= 0"):
        checker.read_start(dict(zip(("slip", "rate"), bounds, strict=True)))
    assert checker.read_start({"slip": "0", "rate": "2"}) == [0, 2]
