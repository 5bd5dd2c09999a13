"""What `design`, `compare` and `figures` ask for, and what their exit code says, without the work between."""

from pathlib import Path
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.cli import block_commands, main
from quakedesign.cli.design_commands import DesignOptions, positive
from quakedesign.errors import QuakedesignError
from quakedesign.guarantees import NoProof
from quakedesign.report import comparison_table

BLOCKS = Path(__file__).parents[1] / "data" / "three_blocks.toml"
DEFAULTS = {
    "objective": "tracking",
    "continuous": False,
    "stress": None,
    "spread": "0",
    "disturbance_class": "amplitude",
}


class AskedError(QuakedesignError):
    """Ends a command where its work would begin."""


@pytest.fixture
def asked(monkeypatch, capsys, tmp_path):
    """What `designed_comparison` is asked by a command line, or the line that refuses it."""
    monkeypatch.chdir(tmp_path)

    def line(*arguments):
        told = []

        def comparison(fault, names, progress, **more):
            told.append((fault.name, names, more))
            raise AskedError("asked")

        monkeypatch.setattr(comparison_table, "designed_comparison", comparison)
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
        said = capsys.readouterr().err
        assert stop.value.code == 2
        return told[0] if told else said

    return line


@pytest.mark.parametrize("command", ["design", "compare", "figures"])
def test_all_laws_of_a_fault_are_designed_in_samples_unless_told(asked, command):
    fault, names, more = asked(command, "lab-fault")
    setup = more["options"].pop("setup")
    assert (fault, names) == ("lab-fault", ["cta", "dia", "elqr"])
    shown = {"published_scheme": "continuous", "plant": None, "whole_task": False}
    assert more == {**shown, "scheme": None, "options": DEFAULTS}
    assert setup == qd.LoopSetup()
    assert DesignOptions().problem("lab-fault")[1] == {"names": names, **more, "options": {**DEFAULTS, "setup": setup}}


@pytest.mark.parametrize(
    ("told", "names"),
    [
        (("crustal-patch",), ["elqr"]),  # a state of friction
        (("crustal-patch", "--diffusion", "800 s"), ["elqr"]),
        (("lab-fault", "--delay", "1 ms"), ["elqr"]),  # no other law is designed behind a path
        (("lab-fault", "--delay", "1 ms", "--controller", "cta"), ["cta"]),
        (("lab-fault", "--controller", "dia"), ["dia"]),
        (("lab-fault", "--measured", "slip"), ["elqr"]),
        (("lab-fault", "--controller", "own_parts:OwnTwisting"), ["own_parts:OwnTwisting"]),
    ],
)
def test_which_laws_are_designed(asked, told, names):
    assert asked("compare", *told)[1] == names


def test_every_option_reaches_the_design(asked):
    told = ("--objective", "peak", "--continuous", "--scheme", "explicit", "--published-scheme", "implicit")
    told += ("--class", "rate", "--spread", "0.1", "--stress", "2 kPa", "--whole-task", "--controller", "elqr")
    _, names, more = asked(
        "design", "lab-fault", *told, "--measured", "slip", "--slip-noise", "1 um", "--plant", "printed"
    )
    setup, stress = more["options"].pop("setup"), more["options"].pop("stress")
    assert (names, float(stress), more["whole_task"]) == (["elqr"], 2000, True)
    assert (more["scheme"], more["published_scheme"], more["plant"]) == ("explicit", "implicit", "printed")
    changed = {"objective": "peak", "continuous": True, "disturbance_class": "rate", "spread": "0.1"}
    assert more["options"] == changed
    assert setup == qd.LoopSetup(measured="slip", slip_noise="1 um")


@pytest.mark.parametrize("command", ["design", "compare", "figures"])
def test_a_step_is_the_sampling_time_of_the_fault(monkeypatch, command):
    seen = []

    def comparison(fault, names, progress, **more):
        seen.append((fault.sampling_time, more["options"]["setup"]))
        raise AskedError("asked")

    monkeypatch.setattr(comparison_table, "designed_comparison", comparison)
    for given in ((), ("--step", "7/2000"), ("--step", "3.5 ms")):
        with pytest.raises(SystemExit):
            main([command, "lab-fault", *given])
    own = qd.load_fault("lab-fault").sampling_time
    assert seen == [(own, qd.LoopSetup()), *2 * [(0.0035, qd.LoopSetup())]]


@pytest.mark.parametrize(
    ("command", "work"), [("design", "run_chain"), ("compare", "compare_chain"), ("limits", "chain_limits")]
)
def test_a_step_is_the_sampling_time_of_several_blocks(monkeypatch, tmp_path, command, work):
    monkeypatch.chdir(tmp_path)
    seen = []
    monkeypatch.setattr(block_commands, work, lambda chain, *_, **__: seen.append(chain.fault.sampling_time) or 0)
    for given in ((), ("--step", "20 ms")):
        with pytest.raises(SystemExit) as stop:
            main([command, str(BLOCKS), *given])
        assert stop.value.code == 0
    assert seen == [qd.load_chain(BLOCKS).fault.sampling_time, 0.02]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (("--controller", "nobody"), "controller must be one of"),
        (("--controller", "own_parts:Nobody"), "own_parts"),
        (("--scheme", "explicit"), "--scheme needs --continuous"),
        (("--measured", "slip", "--controller", "cta"), "--measured slip is for the e-LQR. Received --controller cta"),
    ],
)
def test_options_that_do_not_apply_are_refused_before_the_work(asked, told, said, tmp_path):
    for command in ("design", "compare", "figures"):
        assert said in asked(command, "lab-fault", *told)
    assert list(tmp_path.iterdir()) == []


def test_a_fault_that_never_rests_has_no_other_plant(asked):
    assert "plant must be omitted for friction with a state" in asked("compare", "crustal-patch", "--plant", "printed")


def test_a_well_at_the_fault_is_no_path_of_slow_sliding(asked):
    assert "diffusion must be above 0 s" in asked("compare", "crustal-patch", "--diffusion", "0 s")
    assert asked("compare", "lab-fault", "--diffusion", "0 s")[1] == ["cta", "dia", "elqr"]


def entry(*, verdict="proved", runs=None, premises=(), harmless=True):
    conditions = [SimpleNamespace(name=name, holds=holds) for name, holds in premises]
    run = None if harmless is None else SimpleNamespace(outcome=SimpleNamespace(harmless=harmless))
    return SimpleNamespace(design=SimpleNamespace(verdict=verdict, runs=runs, conditions=conditions), run=run)


@pytest.mark.parametrize(
    ("second", "positively"),
    [
        ({}, True),
        ({"harmless": None}, True),  # a design without a run
        ({"premises": [("sampling_time", True), ("start", False)]}, True),  # of the run and its start
        ({"verdict": "undecided"}, False),
        ({"verdict": "refuted"}, False),
        ({"runs": NoProof(reason="small gain")}, False),
        ({"harmless": False}, False),
        *(
            ({"premises": [(name, False), ("start", True)]}, False)
            for name in ("along_reference", "control_coefficient")
        ),
        *(({"premises": [("start", True), (name, False)]}, False) for name in ("friction_slope", "sampling_time")),
    ],
)
def test_exit_code_zero_needs_every_design(second, positively):
    by_origin = {"designed": [entry(), entry(**second)], "published": [entry(verdict="refuted")]}
    assert positive(SimpleNamespace(of=by_origin.__getitem__)) is positively
