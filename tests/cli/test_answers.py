"""Exit codes, JSON and files of the commands that prove, for every kind of answer that the package may give."""

import json
from fractions import Fraction as F
from importlib import import_module
from types import SimpleNamespace

import pytest

from quakedesign import files
from quakedesign.cli import main
from quakedesign.errors import ParameterError, SimulationError
from quakedesign.loop.loop_setup import IDEAL

guarantee_commands = import_module("quakedesign.cli.guarantee_commands")
simulate_commands = import_module("quakedesign.cli.simulate_commands")


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    """Exit code, stdout and stderr of a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main([*map(str, arguments)])
        files.release()
        return end.value.code, *capsys.readouterr()

    return run


class Written:
    """Something that is saved, with its name as content."""

    def __init__(self, name):
        self.name = name

    def save(self, path):
        path.write_text(self.name)


# guarantee


def proof(proved, name="claim"):
    return SimpleNamespace(
        proved=proved, proof=name, lines=lambda: [f"line of {name}"], to_dict=lambda: {"verdict": name}
    )


@pytest.fixture
def prove(monkeypatch, call):
    """Runs `guarantee` with answers that are set, and tells what it was called with."""
    asked = []
    saved = "quakedesign.guarantees.exact.guarantee_files.save_guarantee"
    monkeypatch.setattr(saved, lambda found, path: path.write_text(found))
    monkeypatch.setattr("quakedesign.synthesis.guarantee", lambda *_, **__: None)
    sentence = "quakedesign.report.summary.guaranteed_sentence"
    monkeypatch.setattr(
        sentence, lambda first, found, peak, _: f"{first}: {found} beside {peak and round(peak, 4)} m/s"
    )

    def run(answers, *arguments):
        def found(calls, **more):
            asked.append((calls, more))
            return answers

        monkeypatch.setattr("quakedesign.synthesis.guarantees_of", found)
        return call("guarantee", *arguments)

    run.asked = asked
    return run


REFUSED = ParameterError("a step is needed")


@pytest.mark.parametrize(
    ("answers", "code"),
    [
        ([proof(True)], 0),
        ([proof(False)], 1),
        ([REFUSED], 2),
        ([proof(True), proof(True)], 0),
        ([proof(True), proof(False)], 1),
        ([proof(True), REFUSED], 1),
        ([REFUSED, REFUSED], 1),
    ],
)
@pytest.mark.parametrize("json_too", [True, False])
def test_only_proofs_for_every_fault_are_code_zero(prove, answers, code, json_too):
    faults = ("real-fault", "lab-fault")[: len(answers)]
    found, out, err = prove(answers, *faults, *["--json"] * json_too)
    assert found == code
    if code == 2:
        assert err == "quakedesign: a step is needed\n"
    elif not json_too:
        lines = ["refused: a step is needed" if one is REFUSED else "line of claim" for one in answers]
        names = [f'"{name}": ' for name in faults] if len(faults) > 1 else [""]
        first = ["real-fault: guaranteed: claim beside 0.0745 m/s.", ""] * (len(answers) == 1 and code == 0)
        said = [*first, *(name + line for name, line in zip(names, lines, strict=True))]
        box = out.splitlines()[len(said) :]
        assert out.splitlines()[: len(said)] == said
        assert [line[:29] for line in box] == ["box paper: every friction from"[:29]] * (
            len(answers) == 1 and code == 0
        )
    else:
        told = json.loads(out)
        assert 0 <= told.pop("seconds") < 60
        refused = {"verdict": "refused", "reason": "a step is needed", "certificate": None}
        each = [refused if one is REFUSED else {"verdict": "claim", "certificate": None} for one in answers]
        if len(answers) == 1:
            assert told == {**each[0], "class": "amplitude"}
        else:
            named = [{"fault": name, **one} for name, one in zip(faults, each, strict=True)]
            assert told == {"guarantees": named, "class": "amplitude"}


def test_a_fault_whose_earthquake_cannot_be_computed_has_its_guarantee_without(prove, monkeypatch):
    def drowned(_):
        raise SimulationError("is unstable, but it stays at rest in simulation")

    monkeypatch.setattr("quakedesign.simulation.earthquake.natural_peak", drowned)
    code, out, _ = prove([proof(True)], "real-fault")
    assert (code, out.splitlines()[0]) == (0, "real-fault: guaranteed: claim beside None m/s.")


def test_friction_with_a_state_has_no_box(prove):
    assert prove([proof(True)], "crustal-patch")[1].splitlines()[2:] == ["line of claim"]


def test_what_is_asked_is_what_was_typed(prove):
    more = "--gains 1 2 3 4 --objective peak --scheme explicit --stress 3 --spread 0.1 --class rate --delay 1/50"
    prove([proof(True)], "real-fault", "--step", "92 ms", "--measured", "slip", *more.split())
    ((one,), _) = prove.asked[0]
    fault, controller, setup = one.args if one.args else one.func.args
    assert (fault.name, controller) == ("real-fault", "elqr")
    assert setup == IDEAL.with_given(step="0.092", measured="slip", delay="1/50")
    assert {name: value for name, value in one.keywords.items() if name != "progress"} == {
        "gains": ("1", "2", "3", "4"),
        "objective": "peak",
        "scheme": "explicit",
        "stress": "3",
        "disturbance_class": "rate",
        "spread": "0.1",
        "plant": None,
    }


@pytest.mark.parametrize(
    ("faults", "more", "within", "beside"),
    [
        (("real-fault",), {}, True, False),
        (("real-fault",), {"workers": 2}, False, False),
        (("real-fault",), {"scheduler": "tcp://a:1"}, False, False),
        (("real-fault", "lab-fault"), {}, False, True),
        (("real-fault", "lab-fault"), {"workers": 2, "scheduler": "tcp://a:1"}, False, True),
    ],
)
def test_progress_is_told_by_the_one_computation_or_by_the_crew(prove, faults, more, within, beside):
    options = [word for name, value in more.items() for word in (f"--{name}", value)]
    prove([proof(True)] * len(faults), *faults, *options)
    ((calls, told),) = prove.asked
    assert ["progress" in one.keywords for one in calls] == [within] * len(faults)
    assert (told["progress"] is not None) == beside
    assert (told["workers"], told["scheduler"]) == (more.get("workers", 1), more.get("scheduler"))


def test_a_certificate_is_written_where_there_is_a_proof(prove, tmp_path):
    code, out, _ = prove([proof(False)], "real-fault", "--out", "a.json")
    assert (code, out.splitlines()) == (1, ["line of claim", "a.json is not written, as nothing is proved"])
    assert list(tmp_path.iterdir()) == []
    code, out, _ = prove([proof(True)], "real-fault", "--out", "a.json", "--json")
    assert (code, json.loads(out)["certificate"], (tmp_path / "a.json").read_text()) == (0, "a.json", "claim")
    assert prove([proof(True)], "real-fault", "--out", "a.json")[0] == 2
    code, out, _ = prove([proof(True, "other")], "real-fault", "--out", "a.json", "--force")
    *_, first, box, last = out.splitlines()
    assert (code, first, last) == (0, "line of other", "written: a.json")
    assert box.startswith("box paper: every friction from")
    assert (tmp_path / "a.json").read_text() == "other"


def test_certificates_of_several_faults_lie_in_a_folder_that_no_other_command_writes(prove, tmp_path, monkeypatch):
    both = ("real-fault", "lab-fault", "--out", "made")
    held = []
    monkeypatch.setattr(guarantee_commands, "progress", lambda own=guarantee_commands.progress: (held.append(
        not files.lock_folder(tmp_path / "made")), own())[1])  # fmt: skip
    code, out, _ = prove([proof(True), REFUSED], *both, "--json")
    assert (code, held) == (1, [True])
    assert [one["certificate"] for one in json.loads(out)["guarantees"]] == ["made/real-fault-guarantee.json", None]
    assert [path.name for path in (tmp_path / "made").iterdir()] == ["real-fault-guarantee.json"]
    calls = len(prove.asked)
    code, _, err = prove([proof(True)] * 2, *both)
    assert (code, "certificate file must be new. Received made/real-fault-guarantee.json" in err) == (2, True)
    assert prove([proof(True)] * 2, *both, "--force")[0] == 0
    for place in ("none/made", "made"):
        assert prove([proof(True)] * 2, "real-fault", "lab-fault", "--out", place)[0] == 2
    assert len(prove.asked) == calls + 1


def test_two_faults_of_one_name_are_refused(prove):
    code, _, err = prove([proof(True)] * 3, "real-fault", "lab-fault", "lab-fault")
    assert (code, "Received lab-fault twice" in err, prove.asked) == (2, True, [])


# limits


@pytest.mark.parametrize(
    ("given", "diffusivity", "diffusion"),
    [
        ((), 1.0, None),
        (("--well", "40 m"), 1.0, "1600"),
        (("--well", "40 m", "--diffusivity", "0.5"), 0.5, "3200"),
        (("--diffusivity", "1/2"), 0.5, None),
    ],
)
def test_the_diffusivity_of_limits_is_one_unless_given(call, monkeypatch, given, diffusivity, diffusion):
    asked = {}
    answer = SimpleNamespace(to_dict=lambda: {"limit": 1})
    monkeypatch.setattr(
        "quakedesign.studies.limits", lambda fault, setup, **told: asked.update(told, setup=setup) or answer
    )
    monkeypatch.setattr("quakedesign.report.limits_table.limits_lines", lambda _: ["a limit"])
    assert call("limits", "lab-fault", *given) == (0, "a limit\n", "")
    assert asked["diffusivity"] == diffusivity
    assert asked["setup"] == IDEAL.with_given(**({} if diffusion is None else {"diffusion": diffusion}))
    assert json.loads(call("limits", "lab-fault", *given, "--json")[1]) == {"limit": 1}


def test_limits_are_written_where_a_folder_is_given(call, monkeypatch, tmp_path):
    held = []
    answer = SimpleNamespace(to_dict=dict)
    monkeypatch.setattr("quakedesign.report.limits_table.limits_lines", lambda _: ["a limit"])
    monkeypatch.setattr(
        "quakedesign.report.limits_table.write_limits",
        lambda _, out, kinds: held.append((out.name, kinds, not files.lock_folder(tmp_path / "made"))),
    )
    monkeypatch.setattr("quakedesign.studies.limits", lambda *_, **__: answer)
    code, out, _ = call("limits", "lab-fault", "--out", "made", "--format", "svg", "pdf")
    assert (code, held) == (0, [("made", ("svg", "pdf"), True)])
    assert out == "a limit\nwritten: made/ (limits.svg, limits.pdf, results.json)\n"
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "thesis").touch()
    assert call("limits", "lab-fault", "--out", "there")[0] == 2


# simulate


@pytest.mark.parametrize(
    ("changed", "outside"),
    [
        ({}, []),
        ({"duration": 3.0, "seed": 2, "method": "rk4"}, []),
        ({"delay": 0.02, "lag": 2.0}, []),
        ({"delay": 0.03, "lag": 2.0, "diffusion": 1.0}, ["delay", "diffusion"]),
        ({"initial_slip": 1e-3, "initial_slip_rate": -1e-2}, []),
        ({"initial_slip": 1.1e-3, "initial_slip_rate": -1.1e-2}, ["initial_slip", "initial_slip_rate"]),
        ({"slip_noise": 1e-6, "saturation": 1e6}, ["saturation", "slip_noise"]),
        ({"averaging": 2, "drift": 1e-9, "scheme": "implicit"}, ["scheme", "drift", "averaging"]),
        ({"perturbation": "time", "weight": 0.5, "authority": 1.0}, ["perturbation", "weight", "authority"]),
    ],
)
def test_what_a_proof_does_not_know_of_a_run_is_named(changed, outside):
    """Delay 20 ms and lag 2 s, and from initial errors of at most 1 mm and 1 cm/s."""
    held = SimpleNamespace(path={"delay": F(1, 50), "lag": F(2)}, initial_errors=(F(1, 1000), F(1, 100)))
    claim = SimpleNamespace(sampled_loop=held, plant="printed")
    assert simulate_commands._outside(changed, claim, "printed") == outside
    asked = {**changed, "plant": "printed"}  # what ran counts, not what was asked for
    named = simulate_commands._outside(asked, claim, "stick-slip")
    assert named == sorted([*outside, "plant"], key=lambda name: (name != "scheme", name != "plant"))


@pytest.mark.parametrize("full", [True, False])
def test_a_run_is_told_with_all_that_is_known_of_it(monkeypatch, full):
    def named(name, **more):
        return SimpleNamespace(to_dict=lambda: {"name": name}, **more)

    metrics = SimpleNamespace(to_dict=lambda: {"steps": 3, "seconds": 0.5}, unit=lambda name: f"unit of {name}")
    run = SimpleNamespace(
        metrics=metrics,
        energy=named("energy", relative_residual=1e-9) if full else None,
        outcome=named("outcome"),
        events={"stick": 0.1},
        provenance={"scheme": "explicit"},
    )
    monkeypatch.setattr("quakedesign.simulation.earthquake.waiting", lambda *_: named("waiting") if full else None)
    monkeypatch.setattr("quakedesign.studies.comparison.shortfall", lambda *_: "a shortfall")
    assert simulate_commands._values(run, None, [named("premise")]) == {
        "outcome": {"name": "outcome"},
        "waiting": {"name": "waiting"} if full else None,
        "shortfall": "a shortfall",
        "metrics": {"steps": 3, "seconds": 0.5},
        "units": {"steps": "unit of steps", "seconds": "unit of seconds"},
        "premises": [{"name": "premise"}],
        "events": {"stick": 0.1},
        "energy": {"name": "energy", "relative_residual": 1e-9} if full else None,
        "steps": 3,
        "seconds": 0.5,
        "run": {"scheme": "explicit"},
    }


# certify


@pytest.mark.parametrize(("verdict", "code"), [("proved", 0), ("refuted", 1), ("undecided", 1)])
@pytest.mark.parametrize("found", [True, False])
def test_a_sliding_mode_is_certified(call, monkeypatch, tmp_path, verdict, code, found):
    asked = []
    certificate = Written("certificate") if found else None
    answer = SimpleNamespace(facts={"verdict": verdict}, lines=["a line"], verdict=verdict, certificate=certificate)
    monkeypatch.setattr("quakedesign.studies.certified.certified", lambda *given, **more: asked.append(more) or answer)
    gains = ("certify", "cta", "--gains", "1", "2", "3", "4")
    assert call(*gains, "--lipschitz", "1/2") == (code, "a line\n", "")
    assert asked[0] == {"lipschitz": "1/2", "maximize": None, "gain_range": ("1", "1")}
    told = json.loads(call(*gains, "--maximize", "beta", "--gain-range", "2", "3", "--json")[1])
    assert told == {"verdict": verdict, "certificate": None}
    assert asked[1] == {"lipschitz": None, "maximize": "beta", "gain_range": ("2", "3")}
    told = json.loads(call(*gains, "--lipschitz", "1", "--out", "a.json", "--json")[1])
    assert told["certificate"] == ("a.json" if found else None)
    assert [path.name for path in tmp_path.iterdir()] == (["a.json"] if found else [])
    if found:
        assert call(*gains, "--lipschitz", "1", "--out", "a.json")[0] == 2
        assert call(*gains, "--lipschitz", "1", "--out", "a.json", "--force")[0] == code


@pytest.mark.parametrize(
    ("law", "more", "said"),
    [
        ("cta", ["lab-fault"], "FAULT cannot be used with cta, which needs --lipschitz instead"),
        ("cta", ["--box", "paper"], "--box cannot be used with cta"),
        ("cta", ["--feedback", "error"], "--feedback cannot be used with cta"),
        ("cta", ["--step", "1 s"], "--step cannot be used with cta"),
        ("cta", ["--peaks", "rate"], "--peaks cannot be used with cta"),
        ("elqr", ["--lipschitz", "1"], "--lipschitz cannot be used with elqr, which needs a FAULT instead"),
        ("elqr", ["--maximize", "beta"], "--maximize cannot be used with elqr"),
        ("elqr", ["--gain-range", "1", "1"], "--gain-range cannot be used with elqr"),
        ("elqr", [], "certify elqr needs a fault"),
    ],
)
def test_an_option_of_another_law_is_refused(call, law, more, said):
    code, out, err = call("certify", law, *more, "--gains", "1", "2", "3", "4")
    assert (code, out) == (2, "")
    assert said in err


@pytest.mark.parametrize(
    ("verdict", "wanted", "peaks", "code"),
    [
        ("proved", None, None, 0),
        ("proved", "rate", {"slip": 1}, 0),
        ("proved", "rate", None, 1),
        ("refuted", None, None, 1),
        ("undecided", "rate", {"slip": 1}, 1),
    ],
)
def test_gains_of_an_elqr_are_certified_with_their_peaks(call, monkeypatch, verdict, wanted, peaks, code):
    asked, saved = {}, []
    judged = SimpleNamespace(
        to_dict=lambda: {"verdict": verdict, "peaks": peaks},
        save=lambda out, force: saved.append((str(out), force)) or {"stability": "a.json", "peaks": "b.json"},
    )
    monkeypatch.setattr(
        "quakedesign.linear.verdict.judge",
        lambda fault, law, **more: asked.update(more, fault=fault.name, feedback=law.feedback) or judged,
    )
    monkeypatch.setattr("quakedesign.report.sentences.verdict_lines", lambda _: ["a line"])
    words = ("certify", "elqr", "lab-fault", "--gains", "1", "2", "3", "4", *(["--peaks", wanted] if wanted else []))
    assert call(*words) == (code, "a line\n", "")
    assert asked == {"fault": "lab-fault", "feedback": "error", "step": None, "peaks": wanted}
    told = json.loads(call(*words, "--feedback", "state", "--step", "7/50", "--json")[1])
    assert 0 <= told.pop("seconds") < 60
    assert told == {"verdict": verdict, "peaks": peaks, "certificate": None, "certificates": {}}
    assert (asked["feedback"], asked["step"], saved) == ("state", "7/50", [])
    told = json.loads(call(*words, "--json", "--out", "a.json")[1])
    assert (told["certificate"], told["certificates"]) == ("a.json", {"stability": "a.json", "peaks": "b.json"})
    assert call(*words, "--out", "a.json", "--force")[0] == code
    assert saved == [("a.json", False), ("a.json", True)]


# check


@pytest.mark.parametrize(
    ("verdicts", "rocq", "code"),
    [
        (["proved"], None, 0),
        (["proved", "proved"], None, 0),
        (["proved", "refuted"], None, 1),
        (["invalid: broken"], None, 1),
        (["proved", "proved"], ["a.v", "b.v"], 0),
        (["proved", "proved"], ["a.v", None], 1),
        (["proved", "invalid: broken"], ["a.v"], 1),
        (["refuted"], ["a.v"], 1),
    ],
)
def test_only_proofs_of_every_file_and_files_for_coqc_are_code_zero(call, monkeypatch, tmp_path, verdicts, rocq, code):
    names = [f"{i}.json" for i in range(len(verdicts))]
    asked, wrote = [], []
    monkeypatch.setattr(
        "quakedesign.checking.check_files",
        lambda files, fault: asked.append(fault) or dict(zip(names, ((v, ["covers"]) for v in verdicts), strict=True)),
    )

    def write(kept, folder, *, force):
        wrote.append(([str(path) for path in kept], str(folder), force))
        return {
            path: made or "it has none" if made is None else tmp_path / made
            for path, made in zip(kept, rocq, strict=True)
        }

    monkeypatch.setattr("quakedesign.rocq.rocq_export.write_rocq", write)
    options = ["--rocq"] * (rocq is not None)
    kept = [name for name, verdict in zip(names, verdicts, strict=True) if ":" not in verdict]
    found, out, _ = call("check", *names, *options, "--fault", "lab-fault")
    assert (found, asked) == (code, ["lab-fault"])
    made = dict(zip(kept, rocq or (), strict=False))
    lines = []
    for name, verdict in zip(names, verdicts, strict=True):
        lines += [f"{name}: {verdict}", "    covers"]
        if name in made:
            file = made[name]
            lines.append("    no file for coqc: it has none" if file is None else f"    for coqc: {tmp_path / file}")
    assert out.splitlines() == lines
    found, out, _ = call("check", *names, *options, "--json", *(["--out", "made", "--force"] if rocq else []))
    told = json.loads(out)
    assert (found, told["files"]) == (code, dict(zip(names, verdicts, strict=True)))
    if rocq is None:
        assert ("rocq" in told, wrote) == (False, [])
    else:
        assert told["rocq"] == {name: str(tmp_path / made[name]) if made.get(name) else None for name in names}
        assert wrote == [(kept, "quakedesign-rocq", False), (kept, "made", True)]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [([], "check needs at least one certificate file"), (["a.json", "--out", "b"], "--out needs --rocq")],
)
def test_a_check_of_nothing_or_into_nothing_is_refused(call, arguments, said):
    code, _, err = call("check", *arguments)
    assert (code, said in err) == (2, True)


# sos


@pytest.mark.parametrize(("verdict", "code"), [("sos", 0), ("not_sos", 1), ("undecided", 1)])
@pytest.mark.parametrize("with_proof", [True, False])
def test_a_polynomial_is_judged(call, monkeypatch, tmp_path, verdict, code, with_proof):
    asked = []
    answer = SimpleNamespace(
        verdict=verdict,
        proof="proof" if with_proof else None,
        save=Written("proof").save,
        statement=SimpleNamespace(variables=("x",), degree=2),
        blocks={"before": 1},
        remark="",
        set_is_empty=False,
        seconds=1.5,
        versions={"clarabel": "1"},
    )
    monkeypatch.setattr("quakedesign.sos.prove", lambda text, **more: asked.append((text, more)) or answer)
    monkeypatch.setattr(
        "quakedesign.sos.read_gram", lambda path: SimpleNamespace(verify=lambda: asked.append(path) or answer)
    )
    monkeypatch.setattr("quakedesign.sos.exact.polynomial_files.proof_entries", lambda proof: {"plain": proof})
    monkeypatch.setattr("quakedesign.sos.exact.words.sentences", lambda _, verbose: [f"verbose {verbose}"])
    assert call("sos", "x^2") == (code, "verbose False\n", "")
    told = json.loads(
        call("sos", "x^2", "--on", "x >= 0", "--margin", "1/2", "--degree", "4", "--products", "--json")[1]
    )
    assert told == {
        "verdict": verdict,
        "variables": ["x"],
        "degree": 2,
        "blocks": {"before": 1},
        "witness": {"plain": "proof"} if with_proof else None,
        "file": None,
        "remark": None,
        "empty_set": False,
        "seconds": 1.5,
        "versions": {"clarabel": "1"},
    }
    assert call("sos", "--gram", "g.json", "--verbose")[:2] == (code, "verbose True\n")
    plain = {"on": (), "multiplier": None, "margin": "0", "degree_bound": None, "products": None}
    given = {"on": ("x >= 0",), "multiplier": None, "margin": "1/2", "degree_bound": 4, "products": True}
    assert asked[:2] == [("x^2", plain), ("x^2", given)]
    assert str(asked[2]) == "g.json"
    told = json.loads(call("sos", "x^2", "--out", "p.json", "--json")[1])
    assert told["file"] == ("p.json" if with_proof else None)
    assert [path.name for path in tmp_path.iterdir()] == (["p.json"] if with_proof else [])
    if with_proof:
        assert call("sos", "x^2", "--out", "p.json")[0] == 2
        assert call("sos", "x^2", "--out", "p.json", "--force")[0] == code


@pytest.mark.parametrize(
    "more",
    [["x"], ["--on", "x >= 0"], ["--multiplier", "auto"], ["--margin", "1"], ["--degree", "2"], ["--no-products"]],
)
def test_a_file_of_gram_says_all_that_is_asked(call, more):
    code, _, err = call("sos", *more, "--gram", "g.json")
    assert (code, "--gram FILE contains the polynomial" in err) == (2, True)


def test_a_polynomial_and_a_constraint_may_begin_with_a_sign(call):
    code, out, _ = call("sos", "-x^2 + x", "--on", "-x^2 + x >= 0", "--json")
    assert (code, json.loads(out)["verdict"]) == (0, "sos")


def test_nothing_is_no_polynomial(call):
    code, _, err = call("sos")
    assert (code, "sos needs a polynomial, or --gram FILE" in err) == (2, True)


# attraction


@pytest.mark.parametrize(
    ("proved", "refuted", "inclusion"),
    [(True, True, True), (True, False, False), (False, True, False), (False, False, False)],
)
@pytest.mark.parametrize("everywhere", [True, False])
def test_a_region_is_code_zero_where_a_level_is_proved(
    call, monkeypatch, tmp_path, proved, refuted, inclusion, everywhere
):
    asked = []
    parts = {"proved": proved, "refuted": refuted, "inclusion": inclusion}
    region = SimpleNamespace(**{name: name if there else None for name, there in parts.items()})
    monkeypatch.setattr("quakedesign.sos.exact.attraction.read_field", lambda path: ("rates", "V"))
    monkeypatch.setattr("quakedesign.sos.stability", lambda *given: asked.append(given) or "stability")
    monkeypatch.setattr("quakedesign.sos.Region", SimpleNamespace(of=lambda found: region))
    monkeypatch.setattr(
        "quakedesign.sos.region_of_attraction", lambda *given, **more: asked.append((*given, more)) or region
    )
    monkeypatch.setattr("quakedesign.sos.save_attraction", lambda proof, path: path.write_text(proof))
    monkeypatch.setattr("quakedesign.sos.exact.words.region_entries", lambda _: {"level": 1})
    monkeypatch.setattr("quakedesign.sos.exact.words.region_words", lambda _: ["a region"])
    words = ("attraction", "field.toml", *["--everywhere"] * everywhere)
    code, out, _ = call(*words)
    assert (code, out.splitlines()[0]) == (0 if proved else 1, "a region")
    assert out.splitlines()[1].endswith(" s; checked in exact arithmetic")
    assert 0 <= float(out.splitlines()[1].split()[0]) < 60
    usual = ("rates", "V", {"relative": 1e-4, "degree": None, "shape": None})
    assert asked == [("rates", "V") if everywhere else usual]
    assert list(tmp_path.iterdir()) == []
    told = json.loads(call(*words, "--out", "p.json", "--json")[1])
    assert 0 <= told.pop("seconds") < 60
    first = "proved" if proved else "refuted" if refuted else None
    assert told == {"level": 1, "file": first and "p.json", "file_above": None, "file_inclusion": None}
    assert [path.read_text() for path in tmp_path.iterdir()] == ([first] if first else [])
    every = ("--out", "p.json", "--above", "a.json", "--inclusion", "i.json", "--force")
    (tmp_path / "p.json").unlink(missing_ok=True)
    told = json.loads(call(*words, *every, "--json")[1])
    assert {name for name in ("file", "file_above", "file_inclusion") if told[name]} == {
        name for name, there in zip(("file", "file_above", "file_inclusion"), parts.values(), strict=True) if there
    }
    content = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert content == {
        name: part for name, (part, there) in zip(("p.json", "a.json", "i.json"), parts.items(), strict=True) if there
    }


@pytest.mark.parametrize("more", [["--degree", "4"], ["--shape", "x^2"], ["--degree", "2", "--shape", "x^2"]])
def test_what_is_of_a_region_is_not_asked_of_all(call, tmp_path, more):
    (tmp_path / "field.toml").write_text('[field]\nx = "-x"\n')
    code, _, err = call("attraction", "field.toml", "--everywhere", *more)
    assert (code, "--degree and --shape cannot be used with --everywhere" in err) == (2, True)


@pytest.mark.parametrize("option", ["--out", "--above", "--inclusion"])
def test_every_file_of_a_region_is_new(call, tmp_path, option):
    (tmp_path / "field.toml").write_text('[field]\nx = "-x"\n')
    (tmp_path / "there.json").touch()
    code, _, err = call("attraction", "field.toml", option, "there.json")
    assert (code, "must be new" in err) == (2, True)
