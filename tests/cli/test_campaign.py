"""The command line of campaigns."""

import json
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

from quakedesign.cli import main, simulate_commands
from quakedesign.parallel import SerialExecutor, UserExecutor
from quakedesign.report import terminal
from quakedesign.simulation.campaign import Campaign, running

CALL = ["campaign", "lab-fault", "--controller", "elqr", "--duration", "0.2", "--initial-slip", "1e-4", "--box"]


@pytest.fixture
def call(tmp_path, monkeypatch, capsys):
    """Exit code, standard output and standard error of the command, computed in this process without a figure."""
    monkeypatch.setattr(Campaign, "plot", lambda _: Figure())
    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(SerialExecutor()))

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
    code, out, _ = call("--samples", "6", "--format", "svg")
    assert (code, "(results.json, samples.csv, distribution.svg)" in out) == (0, True)
    assert (tmp_path / "out" / "distribution.svg").read_bytes().startswith(b"<?xml")


def test_for_people(call):
    code, out, err = call("--samples", "4", "--search", "peak_slip_rate")
    assert (code, err) == (0, "")
    assert "4 samples, 0 of them from an earlier run" in out
    assert "peak_slip_rate" in out
    assert "search-" in out


@pytest.mark.slow
def test_another_campaign_needs_force(call):
    assert call("--samples", "2")[0] == 0
    code, _, err = call("--samples", "2", box="paper")
    assert code == 2
    assert "Received changes of fault.box.authority" in err
    code, out, _ = call("--samples", "2", "--force", "--json", box="paper")
    assert (code, json.loads(out)["resumed"]) == (0, 0)


@pytest.mark.slow
def test_ctrl_c_says_that_it_can_go_on(call, monkeypatch):
    class Interrupted(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            raise KeyboardInterrupt

    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(Interrupted()))
    code, _, err = call("--samples", "2")
    assert code == 130
    assert "run the same command again to continue from" in err
    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(SerialExecutor()))
    assert call("--samples", "2")[0] == 0


def test_a_batch_that_fails_is_told(call, monkeypatch):
    class Failing(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            def fail():
                raise MemoryError("full")

            return super().submit(fail)

    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(Failing()))
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


def shown(**changes):
    """A campaign of eight samples as it is printed."""
    numbers = {"0.05": 1e-6, "0.5": 2e-6, "0.95": 3.14e-6, "1": None}
    worst = [{"index": i} for i in (7, 3, 1, 0)]
    answer = {
        "samples": 8,
        "resumed": 5,
        "quantiles": {"max_slip_error": numbers, "reverse_slip_fraction": dict.fromkeys(numbers, 0.25)},
        "worst": {"max_slip_error": worst, "reverse_slip_fraction": worst[:2]},
        "search": {"metric": "max_slip_error", "value": 1.23456789e-5, "index": "search-9", "looked_at": 40},
        "failures": [{"samples": ["4", "5", "6"], "reason": "MemoryError: full"}],
    }
    return answer | changes


def printed(capsys, answer, *, controller=None, kinds=None, events=None):
    problem = SimpleNamespace(fault=SimpleNamespace(name="lab-fault"), controller=controller)
    simulate_commands._print_campaign(
        problem, SimpleNamespace(kinds=kinds or {}, events=events or {}), answer, "out/ (a, b)"
    )
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


TABLE = [
    "metric unit 5 % 50 % 95 % worst samples",
    "max_slip_error m 1e-06 2e-06 3.1e-06 diverges 7, 3, 1",
    "reverse_slip_fraction - 0.25 0.25 0.25 0.25 7, 3",
]


def test_people_are_told_outcomes_quantiles_search_and_failures(capsys):
    counts = {"tracked": [0, 1, 2], "earthquake": [], "diverged": [7]}
    told = {"controller": SimpleNamespace(title="e-LQR"), "kinds": counts, "events": {"peak_rate": [7], "opening": []}}
    assert printed(capsys, shown(), **told) == [
        "lab-fault, e-LQR: 8 samples, 5 of them from an earlier run",
        "outcomes (samples): 3 tracked, 1 diverged",
        "events (samples): 1 peak rate",
        *TABLE,
        "search: worst max_slip_error = 1.23457e-05 m, in sample search-9; 40 samples evaluated",
        "failed: samples 4 … 6: MemoryError: full",
        "written: out/ (a, b)",
    ]


def test_a_narrow_terminal_wraps_samples_alone(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "68")
    worst = [{"index": f"search-{i}"} for i in range(3)]
    answer = shown(search=None, failures=[], worst={"max_slip_error": worst, "reverse_slip_fraction": worst})
    lines = printed(capsys, answer)
    assert max(len(line) for line in lines if "samples," not in line) <= 68
    assert [line.split()[0] for line in lines[4:] if line.startswith(("max_slip_error", "reverse_slip_fraction"))] == [
        "max_slip_error",
        "reverse_slip_fraction",
    ]
    assert [line for line in lines if "search-2" in line] == ["search-2", "search-2"]  # below those before it


def test_people_are_told_that_there_is_nothing(capsys):
    search = {"metric": "max_slip_error", "value": None, "index": "search-9", "looked_at": 40}
    diverged = "search: worst max_slip_error = diverges, in sample search-9; 40 samples evaluated"
    for found, said in ((None, []), (search, [diverged])):
        assert printed(capsys, shown(search=found, failures=[])) == [
            "lab-fault, no control: 8 samples, 5 of them from an earlier run",
            "outcomes (samples): none",
            "events (samples): none",
            *TABLE,
            *said,
            "written: out/ (a, b)",
        ]


def test_files_that_are_written_are_named(tmp_path):
    usual = "results.json, samples.csv, distribution.png"
    assert simulate_commands._written({}, ["png"]) == usual
    again = {"rerun": {"file": str(tmp_path / "sample-2.nc")}}
    assert simulate_commands._written(again, ["png"]) == f"{usual}, sample-2.nc"


def test_a_sample_is_run_again_by_its_number_or_its_name(tmp_path):
    def trajectory(index):
        outcome, metrics = (SimpleNamespace(to_dict=lambda: {"of": index}) for _ in range(2))
        return SimpleNamespace(outcome=outcome, metrics=metrics, events={"opening": 1.0}, save=lambda path: path)

    done = SimpleNamespace(trajectory=trajectory)
    assert simulate_commands._rerun(done, None, tmp_path) == {}
    for told, index in (("12", 12), ("search-3", "search-3")):
        (again,) = simulate_commands._rerun(done, told, tmp_path).values()
        assert (again["index"], again["metrics"], again["outcome"]) == (told, {"of": index}, {"of": index})
        assert (again["file"], again["events"]) == (str(tmp_path / f"sample-{told}.nc"), {"opening": 1.0})


@pytest.mark.parametrize("proved", ["", "proved: the slip rate never exceeds 1 m/s"])
@pytest.mark.parametrize("energy", [None, SimpleNamespace(relative_residual=1.234e-9)])
def test_what_is_proved_of_a_run_stands_last(capsys, monkeypatch, proved, energy):
    monkeypatch.setattr(terminal, "print_run", lambda *_: print("the run"))
    simulate_commands._print_run(SimpleNamespace(energy=energy), None, (), proved)
    lost = ["  energy error of the integration: 1.2e-09 of the largest energy"] if energy else []
    assert capsys.readouterr().out.splitlines() == ["the run", *lost, *([f"  {proved}"] if proved else [])]
