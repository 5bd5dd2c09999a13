"""The summary of a comparison: what is said first, in 40 lines of 80 characters, with numbers on their outer side."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.exact import UpperBound
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.report.summary import Row, Summary, summary, summary_lines
from quakedesign.simulation import Metrics
from quakedesign.text import plain, power_of, quantity

REAL = qd.load_fault("real-fault")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0745, "74.5 mm/s"),
        (1.8e-4, "180 µm/s"),
        (0.001, "1 mm/s"),
        (9.996e-4, "1 mm/s"),
        (0.0, "0 m/s"),
        (-14.29e6, "-14.3 Mm/s"),
        (3e-14, "30 fm/s"),
        (5e12, "5 Tm/s"),
    ],
)
def test_a_measured_number_has_an_engineering_prefix(value, shown):
    assert quantity(value, "m/s") == shown


def test_a_number_keeps_its_significant_digits_without_a_power_of_ten():
    assert [plain(v) for v in (123456.0, 0.012345, -0.0)] == ["123000", "0.0123", "0"]
    assert [power_of(v) for v in (1.0, 999.0, 1000.0, 0.999, -2e-6)] == [0, 0, 3, -3, -6]


def made(**changes):
    rows = (
        Row(name="uncontrolled", outcome="earthquake", slip_rate=(None, None, 0.369), slip=(None,) * 3, pressure=None),
        Row(
            name="e-LQR",
            outcome="tracked",
            slip_rate=(UpperBound(Fraction(14801, 10**12)), 1.37e-8, 1.17e-8),
            slip=(UpperBound(Fraction(1, 3 * 10**5)), 1.3e-6, 6.4e-7),
            pressure=(-1.19e5, 1.81e6),
        ),
        Row(
            name="a law with a long name",
            outcome="slow slip",
            slip_rate=(None, None, 2e-8),
            slip=(None, None, None),
            pressure=(-0.8e6, 0.2),
        ),
    )
    parts = {
        "guarantee": "f: guaranteed",
        "rows": rows,
        "conditions": "e-LQR, proved: " + "from rest " * 20,
        "notes": (),
    }
    return Summary(**(parts | changes))


def test_the_table_has_proved_bounds_rounded_up_beside_the_worst_found_and_the_run():
    lines = summary_lines(made())
    heads, columns, natural, law, name, other, worst, tracked = lines[2:10]
    assert heads.split() == ["slip", "rate", "[nm/s]", "slip", "error", "[µm]", "pressure"]
    assert columns.split() == ["controller", "outcome", *["proved", "worst", "run"] * 2, "[MPa]"]
    assert natural.split() == ["uncontrolled", "earthquake", "369", "mm/s", "–", "–", "–", "–"]
    assert law.split() == ["e-LQR", "tracked", "14.9", "13.7", "11.7", "3.34", "1.3", "0.64", "-0.119", "…", "1.81"]
    assert name == "a law with a long name"
    assert other.split() == ["slow", "slip", "–", "–", "20", "–", "–", "–", "-0.8", "…", "0"]
    assert worst == "worst: worst case found; pressure (p < 0: withdrawal): proved, else simulated"
    assert tracked == "tracked: slip error <= 2 % of target, rate <= reference + 1 % of natural peak"
    assert max(map(len, lines)) <= 80


def test_without_a_proof_the_scale_is_that_of_the_runs():
    rows = (
        Row(name="uncontrolled", outcome="creep", slip_rate=(None, None, 5.0), slip=(None,) * 3, pressure=None),
        Row(name="x", outcome="tracked", slip_rate=(None, None, 3e-6), slip=(None, None, 2e-9), pressure=None),
    )
    assert summary_lines(made(rows=rows))[2].split() == ["slip", "rate", "[µm/s]", "slip", "error", "[nm]", "pressure"]


def entry(label, peak=None, slip=None, *, compensation=None, origin="designed", given=False):
    claims = SimpleNamespace(slip_error=slip and UpperBound(slip))
    found = peak and SimpleNamespace(
        peak_slip_rate=UpperBound(peak),
        claims=claims,
        task=SimpleNamespace(course=", which moves 50 mm in 5 days"),
        sentence=lambda: f"the sentence of {label}",
        scope="",
        motion="",
        valve_pressures=(-1e6, 2e6),
    )
    outcome = SimpleNamespace(kind="tracked", peak_slip_rate=1e-6)
    metrics, provenance = SimpleNamespace(max_slip_error=1e-7), {"scheme": "continuous"}
    run = SimpleNamespace(outcome=outcome, metrics=metrics, pressure=None, provenance=provenance)
    worst = WorstCase(slip_error=1e-6, slip_rate_error=2e-6)
    answer = SimpleNamespace(
        worst=worst if found else None,
        worst_with_stick=None,
        not_at_rest="",
        stick_slip_gap="",
        compensation=compensation,
        lines=lambda: [f"none: the reason of {label}"],
        limit_lines=lambda: ["no controller does better"],
    )
    design = SimpleNamespace(
        title=label.split(" ")[0],
        other_step=None,
        other_step_first="",
        verdict="undecided",
        premises=(),
        conditions=(),
        details={},
    )
    named = {"label": label, "origin": origin, "proof": found or None, "guarantee": answer, "run": run}
    named |= {"given": given, "kind": "given" if given else origin}
    return SimpleNamespace(**named, design=design, zero_order_hold=None, growth_per_step=None, peaks={})


def compared(monkeypatch, *entries, natural="earthquake"):
    monkeypatch.setattr("quakedesign.report.summary.pressure_extremes", lambda run: (-1e6, 2e6))
    outcome = SimpleNamespace(kind=natural, peak_slip_rate=0.01)
    fault = {"name": "mine", "source": "a paper", "assumed": ("a well",), "friction": REAL.friction, "box": REAL.box}
    fault["reference"] = REAL.reference
    return SimpleNamespace(
        fault=SimpleNamespace(**fault, magnitude=5.24),
        uncontrolled=SimpleNamespace(
            outcome=outcome, cycle=None, metrics=Metrics(settled_from=0.0, steps=1, seconds=0.0)
        ),
        of=lambda origin: tuple(e for e in entries if e.origin == origin),
        left_out={},
    )


def test_the_answer_is_the_smallest_proved_slip_rate_against_the_natural_earthquake(monkeypatch):
    said = summary(
        compared(monkeypatch, entry("A (designed)", "3e-4", "1e-5"), entry("B (designed)", "1/7000", "2e-5"))
    )
    assert said.guarantee == (
        "mine: guaranteed. With the B (designed) the slip rate never exceeds 143 µm/s (1.5 % of the natural "
        "earthquake's 10 mm/s, magnitude 5.2), and the slip stays within 20 µm of the reference, which moves 50 mm in "
        "5 days"
    )
    unknown = compared(monkeypatch, entry("B (designed)", "1/7000", "2e-5"))
    unknown.fault.magnitude = float("nan")
    assert "(1.5 % of the natural earthquake's 10 mm/s)," in summary(unknown).guarantee
    assert said.conditions == "B (designed), proved: the sentence of B (designed)"
    assert [row.slip_rate[1] for row in said.rows] == [None] * 3  # the worst case is one of the error
    assumed, box, model, limit = said.notes
    assert model.startswith("model: one block under a uniform pressure")
    assert (assumed, limit) == ("assumed: a well", "no controller does better")
    assert box.startswith("box paper: every friction from 0.2353 to 0.3353")
    stable = summary(compared(monkeypatch, entry("A (designed)", 3e-4, 1e-5), natural="creep"))
    assert "earthquake" not in stable.guarantee


def test_the_worst_case_on_the_stick_slip_plant_is_reported_with_why_nothing_is_proved_there(monkeypatch):
    one = entry("A (designed)", "3e-4", "1e-5")
    one.guarantee.worst_with_stick = WorstCase(slip_error=1.2e-6, slip_rate_error=3e-5)
    one.guarantee.not_at_rest = "T_s is too long"
    (note,) = (note for note in summary(compared(monkeypatch, one)).notes if "stick-slip" in note)
    assert note == (
        "worst case found on the stick-slip plant: slip error 1.2 µm, slip-rate error 30 µm/s; no proof there: T_s is "
        "too long"
    )


def test_proofs_without_stick_are_named_where_the_best_one_is_with_it(monkeypatch):
    """With the stored certificates of both kinds."""
    folder = Path(__file__).parents[2] / "proofs" / "certificates"
    stick, plain = (qd.load_guarantee(folder / f"{name}_real-fault.json") for name in ("stick_slip", "guarantee"))
    one, two, three = (entry(f"{name} (designed)", "1e-4", "1e-5") for name in "ABC")
    one.proof, two.proof, three.proof = stick, plain, plain
    said = summary(compared(monkeypatch, one, two, three))
    assert ". With the A (designed) the slip rate" in said.guarantee
    assert ", whether the fault slides or sticks, and the slip stays" in said.guarantee
    assert "B, C: proved on the plant without stick" in said.notes
    without = summary(compared(monkeypatch, two, three))
    assert ". On the plant without stick, with the B (designed), the slip rate" in without.guarantee
    assert "whether the fault slides or sticks" not in without.guarantee
    assert not any("proved on the plant without stick" in note for note in without.notes)
    assert not any("proved on the plant" in note for note in summary(compared(monkeypatch, one)).notes)


def test_a_share_is_rounded_up_from_the_numbers_themselves(monkeypatch):
    """0.109/12.4996 = 0.87203 %, which is less over 12.5, the earthquake as it is printed."""
    one = compared(monkeypatch, entry("A (designed)", "0.000109", "1e-5"))
    one.uncontrolled.outcome.peak_slip_rate = 0.0124996
    assert "(0.88 % of the natural earthquake's 12.5 mm/s, magnitude 5.2)" in summary(one).guarantee


def test_a_design_for_another_sampling_time_is_not_said_to_be_guaranteed(monkeypatch):
    """And one for the fault's own T_s comes first, also with a larger bound."""
    other, own = entry("A (designed)", "1e-4", "1e-5"), entry("B (designed)", "2e-4", "1e-5")
    other.design.other_step = 2
    other.design.other_step_first = "not guaranteed at T_s = 0.1 s; designed for T_s = 0.05 s"
    said = summary(compared(monkeypatch, other)).guarantee
    assert said.startswith("mine: not guaranteed at T_s = 0.1 s; designed for T_s = 0.05 s. With the A (designed) the")
    assert summary(compared(monkeypatch, other, own)).guarantee.startswith("mine: guaranteed. With the B (designed)")


@pytest.mark.parametrize(
    ("grade", "said"),
    [
        ("undecided", "undecided"),
        (
            "proved, but along_reference fails: requires 295 times the certified value",
            ", and this task violates its conditions",
        ),
        (
            "proved, but level_set fails: requires 2 times the certified value; UNSTABLE with zero-order hold",
            ", and this task violates its conditions; unstable with zero-order hold",
        ),
        (
            "proved, but with zero-order hold, stability is proved for no T_s",
            "; with zero-order hold, stability is proved for no T_s",
        ),
        (
            "proved, but level_set fails: requires 2 times the certified value; UNSTABLE with zero-order hold over T_s",
            ", and this task violates its conditions; unstable with zero-order hold over T_s",
        ),
    ],
)
def test_published_gains_keep_what_is_said_of_how_they_run(monkeypatch, grade, said):
    one = compared(monkeypatch, entry("A (designed)", "1e-4", "1e-5"), entry("P (published)", origin="published"))
    monkeypatch.setattr("quakedesign.report.summary.grade", lambda _: grade)
    (note,) = (note for note in summary(one).notes if "(published)" in note)
    unproved = f"not proved here: the proof is for continuous time{said}"
    assert note == f"P (published): {said if grade == 'undecided' else unproved}"
    unsampled = "runs of published gains are in continuous time, without zero-order hold"
    assert unsampled in summary(one).notes
    one.of("published")[0].run.provenance["scheme"] = "explicit"
    assert unsampled not in summary(one).notes


def test_numbers_of_any_size_stay_apart():
    rates = (UpperBound("69.7e-6"), 5.08e-6, 0.542e-6)
    rows = [Row(name="a", outcome="t", slip_rate=rates, slip=(UpperBound("1.32e-6"), 1.45e-7, 8.08e-9), pressure=None)]
    rows += [replace(rows[0], slip_rate=(UpperBound("1.00001e-12"), 123456e-6, 3e-3))]
    lines = summary_lines(made(rows=tuple(rows)))
    assert lines[4].split() == ["a", "t", "69.7", "5.08", "0.542", "1.32", "0.145", "0.008", "–"]
    assert lines[5].split()[2:5] == ["2e-06", "1e+05", "3000"]


def test_without_a_guarantee_each_reason_is_given(monkeypatch):
    said = summary(compared(monkeypatch, entry("A (designed)"), entry("B (designed)")))
    assert said.guarantee == "mine: no guarantee for any designed controller"
    assert said.conditions.split("; ") == [
        "A (designed): none: the reason of A (designed)",
        "B (designed): none: the reason of B (designed)",
    ]
    assert not any(note.startswith("box ") for note in said.notes)


def test_a_design_without_a_guarantee_beside_one_that_has_it_is_named(monkeypatch):
    said = summary(compared(monkeypatch, entry("A (designed)", 3e-4, 1e-5), entry("B (designed)")))
    assert "B (designed): undecided" in said.notes


def test_a_given_law_without_a_guarantee_has_its_reason_and_is_no_design(monkeypatch):
    known, other = entry("A (given)", given=True), entry("B (given)", 3e-4, 1e-5, given=True)
    assert summary(compared(monkeypatch, known)).guarantee == "mine: no guarantee for any given controller"
    both = summary(compared(monkeypatch, entry("C (designed)"), known)).guarantee
    assert both == "mine: no guarantee for any designed or given controller"
    other.guarantee.stick_slip_gap = "nothing is searched there"
    said = summary(compared(monkeypatch, known, other))
    assert "A (given): none: the reason of A (given)" in said.notes
    assert "nothing is searched there" in said.notes
    assert [row.name for row in said.rows[1:]] == ["A", "B"]


def test_what_a_design_and_a_fault_take_for_granted_is_said(monkeypatch):
    one = compared(monkeypatch, entry("A (designed)", "3e-4", "1e-5"))
    one.of("designed")[0].design.details["assumed"] = "a well near the fault"
    one.fault.source = "poor fit accepted (the sign is open); a record"
    notes = summary(one).notes
    assert notes[0] == one.fault.source
    assert "A (designed) assumes a well near the fault" in notes


def test_friction_that_is_extrapolated_to_the_rate_of_the_task_is_said(monkeypatch):
    one = compared(monkeypatch, entry("A (designed)", "3e-4", "1e-5"))
    patch = qd.load_fault("crustal-patch")
    one.fault.reference = patch.reference  # 1 µm/s
    one.fault.friction = patch.friction
    assert not any("extrapolated" in note for note in summary(one).notes)
    one.fault.friction = replace(patch.friction, fastest_rate=1e-7)
    (said,) = (note for note in summary(one).notes if "extrapolated" in note)
    assert said.startswith("V = 1e-06 m/s is above the rates of the working range, 1e-20 to 1e-07")


def test_two_sliding_modes_with_deadbeat_steps_and_the_same_bounds_say_why(monkeypatch):
    law = SimpleNamespace(deadbeat=True)
    one, other = (entry(f"{name} (designed)", 3e-4, 1e-5, compensation=law) for name in ("2-CTA", "2-DIA"))
    other.proof.claims = one.proof.claims
    assert any("2-CTA and 2-DIA act identically" in note for note in summary(compared(monkeypatch, one, other)).notes)
    law.deadbeat = False
    assert not any("act identically" in note for note in summary(compared(monkeypatch, one, other)).notes)
    law.deadbeat = True
    other.proof.claims = SimpleNamespace(slip_error=UpperBound(1))
    assert not any("act identically" in note for note in summary(compared(monkeypatch, one, other)).notes)


@pytest.mark.slow
def test_the_summary_of_a_fault_fits_a_screen():
    comparison = qd.compare(qd.load_fault("lab-fault"), [qd.design(qd.load_fault("lab-fault"), "elqr")])
    lines = summary_lines(summary(comparison))
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80


def test_the_legend_says_what_the_controllers_are_where_there_are_several():
    said = made()
    laws = "2-CTA, 2-DIA: sliding modes; e-LQR: feedback with disturbance estimate"
    assert laws not in summary_lines(said)
    several = replace(said, rows=(*said.rows, replace(said.rows[1], name="2-CTA")))
    assert laws in summary_lines(several)
    assert len(laws) <= 80
