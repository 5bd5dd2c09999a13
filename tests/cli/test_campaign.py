"""The command line of campaigns."""

import json

import pytest
from matplotlib.figure import Figure

from quakedesign.cli import main
from quakedesign.parallel import Given, SerialExecutor
from quakedesign.simulation.campaign import Campaign, running

CALL = ["campaign", "lab-fault", "--controller", "elqr", "--duration", "0.2", "--initial-slip", "1e-4", "--box"]


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Exit code, standard output and standard error of the command, computed in this process without a figure."""
    monkeypatch.setattr(Campaign, "plot", lambda _: Figure())
    monkeypatch.setattr(running, "crew_of", lambda *_: Given(SerialExecutor()))

    def run(*arguments, box="ten-percent"):
        with pytest.raises(SystemExit) as ended:
            main([*CALL, box, "--out", str(tmp_path / "out"), *arguments])
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return run


def test_json_then_resumed_then_run_again(call, tmp_path):
    code, out, _ = call("--samples", "6", "--json")
    first = json.loads(out)
    assert (code, first["samples"], first["resumed"], first["failures"]) == (0, 6, 0, [])
    code, out, _ = call("--samples", "6", "--search", "peak_slip_rate", "--rerun", "2", "--json")
    second = json.loads(out)
    assert (code, second["resumed"], second["quantiles"]) == (0, 6, first["quantiles"])
    assert second["worst"] == first["worst"]
    assert second["search"]["metric"] == "peak_slip_rate"
    assert second["rerun"]["file"] == str(tmp_path / "out" / "sample-2.nc")
    assert (tmp_path / "out" / "sample-2.nc").is_file()
    code, out, _ = call("--samples", "6", "--format", "svg", "pdf")
    assert (code, "(results.json, samples.csv, distribution.svg, distribution.pdf)" in out) == (0, True)
    assert (tmp_path / "out" / "distribution.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "out" / "distribution.pdf").read_bytes().startswith(b"%PDF")


def test_for_people(call):
    code, out, err = call("--samples", "4", "--search", "peak_slip_rate")
    assert (code, err) == (0, "")
    assert "4 samples, 0 of them from files" in out
    assert "peak_slip_rate" in out
    assert "search-" in out


@pytest.mark.slow
def test_another_campaign_needs_force(call):
    assert call("--samples", "2")[0] == 0
    code, _, err = call("--samples", "2", box="paper")
    assert code == 2
    assert "differs in fault.box.authority" in err
    code, out, _ = call("--samples", "2", "--force", "--json", box="paper")
    assert (code, json.loads(out)["resumed"]) == (0, 0)


def test_ctrl_c_says_that_it_can_go_on(call, monkeypatch):
    class Interrupted(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            raise KeyboardInterrupt

    monkeypatch.setattr(running, "crew_of", lambda *_: Given(Interrupted()))
    code, _, err = call("--samples", "2")
    assert code == 130
    assert "the same command goes on from" in err
    monkeypatch.setattr(running, "crew_of", lambda *_: Given(SerialExecutor()))
    assert call("--samples", "2")[0] == 0


def test_a_batch_that_fails_is_told(call, monkeypatch):
    class Failing(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            def fail():
                raise MemoryError("full")

            return super().submit(fail)

    monkeypatch.setattr(running, "crew_of", lambda *_: Given(Failing()))
    code, out, _ = call("--samples", "3")
    assert code == 1
    assert "MemoryError: full" in out


@pytest.mark.parametrize(
    "wrong",
    [["--samples", "0"], ["--samples", "2", "--seed", "-1"], ["--samples", "2", "--scheme", "none"]],
)
def test_refusals_are_one_line(call, wrong):
    code, _, err = call(*wrong)
    assert code == 2
    assert err.count("\n") == 1
