"""The commands that show all controllers side by side."""

import csv
import importlib.resources
import json
import subprocess
import sys

import pytest

from quakedesign.cli import main


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return stop.value.code, out, err


@pytest.fixture
def short(tmp_path):
    """The laboratory fault, stable and with a task of a second, as a file of the user's."""
    text = (importlib.resources.files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text()
    text = text.replace("drop = 0.17", "drop = 0.01").replace('"lab-fault"', '"short"').replace("1 hour", "1 s")
    path = tmp_path / "short.toml"
    path.write_text(text)
    return path


@pytest.mark.slow
def test_compare_prints_the_keys_of_design_and_writes_nothing(short, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(capsys, "compare", str(short), "--controller", "elqr", "--json")
    found = json.loads(out)
    assert code == 0
    told = {"fault", "controllers", "published", "uncontrolled", "not_applicable", "versions", "numbers", "printed"}
    assert told == set(found)
    assert found["not_applicable"] == {}
    assert found["controllers"]["elqr"]["certificate"] is None
    assert found["controllers"]["elqr"]["verdict"] == "proved"
    assert [p.name for p in tmp_path.iterdir()] == ["short.toml"]


@pytest.mark.parametrize("command", ["design", "compare", "figures"])
def test_a_scheme_is_refused_for_laws_of_samples_which_run_as_they_were_designed(command, short, capsys):
    code, out, err = run(capsys, command, str(short), "--controller", "cta", "--scheme", "compensated")
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert "--scheme needs --continuous" in err


@pytest.mark.slow
def test_designs_are_compared_in_the_scheme_asked_for(short, capsys):
    asked = ("--continuous", "--scheme", "compensated")
    code, out, _ = run(capsys, "compare", str(short), "--controller", "elqr", *asked, "--json")
    found = json.loads(out)["controllers"]["elqr"]
    assert code == 0
    assert found["run"]["scheme"] == "compensated"
    assert any("scheme compensated" in remark for remark in found["remarks"])
    assert found["growth_per_step"] is None


@pytest.mark.slow
def test_figures_writes_one_folder_and_says_what_is_in_it(short, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("quakedesign.studies.paper.ROOMS", (1.6,))  # two designs make a front
    folder = tmp_path / "drawn"
    code, out, err = run(capsys, "figures", str(short), "--controller", "elqr", "--out", str(folder))
    assert (code, err) == (0, "")
    assert f"{folder}/figures/earthquakes.svg: figure 3 of the paper" in out
    written = [line.split(":")[0] for line in out.splitlines() if line.startswith(f"{folder}/figures/")]
    assert sorted(written) == sorted(str(path) for path in (folder / "figures").iterdir())
    assert json.loads((folder / "results.json").read_text())["numbers"][-1]["mise_slip_over_elqr"] == 1
    code, _, err = run(capsys, "figures", str(short), "--out", str(folder))
    assert code == 2
    assert "--force" in err


@pytest.mark.parametrize("command", ["compare", "figures"])
@pytest.mark.parametrize(
    "wrong",
    [
        ("nowhere",),
        ("lab-fault", "--controller", "pid"),
        ("lab-fault", "--box", "huge"),
        ("lab-fault", "--continuous", "--scheme", "magic"),
        ("lab-fault", "--published-scheme", "magic"),
    ],
)
def test_bad_input_is_one_line_and_code_two(command, wrong, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, command, *wrong)
    assert (code, out) == (2, "")
    assert len([line for line in err.splitlines() if line.strip()]) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_all_figures_of_the_laboratory_fault(tmp_path):
    command = [sys.executable, "-m", "quakedesign", "figures", "lab-fault", "--plant", "printed", "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    found, folder = json.loads(done.stdout), tmp_path / "quakedesign-lab-fault-figures"
    assert all((folder / drawn["file"]).stat().st_size > 20_000 for drawn in found["figures"].values())
    with open(folder / "numbers.csv", newline="") as stream:
        rows = {row["run"]: row for row in csv.DictReader(stream)}
    assert {f"{law} ({origin})" for law in ("2-CTA", "2-DIA", "e-LQR") for origin in ("published", "designed")} | {
        "uncontrolled",
        "induced",
    } == set(rows)
    # section IV-A, said of the real fault, which is similar: sliding modes follow the slip better, the e-LQR its rate
    for law in ("2-CTA (published)", "2-DIA (published)"):
        assert float(rows[law]["mise_slip_over_elqr"]) < 1 < float(rows[law]["mise_slip_rate_over_elqr"])
        assert float(rows[law]["rms_pressure_over_elqr"]) == pytest.approx(1, abs=0.05)
