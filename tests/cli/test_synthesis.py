"""`synthesise` on the command line."""

import json
from functools import cache, partial

import pytest

import quakedesign as qd
from quakedesign.cli import main


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(["synthesise", *arguments])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


FAST = ("--degree", "4", "--starts", "1", "--workers", "1")


def test_gains_and_their_certificate(capsys, tmp_path):
    path = tmp_path / "gains.json"
    code, out, _ = run(capsys, "super-twisting", "--lipschitz", "0.5", *FAST, "--out", str(path), "--json")
    found = json.loads(out)
    certificate = qd.load_certificate(path)
    assert code == 0
    assert found["verdict"] == str(certificate.check()) == "proved"
    assert found["gains"] == {name: str(k) for name, k in certificate.loop.gains.items()}
    assert found["lipschitz"] == "1/2"
    assert found["gain_range"] == ["1", "1"]
    assert found["value"] == found["norm"]
    assert {"objective", "unit", "compared", "certificate", "seconds"} < set(found)


def test_an_existing_file_is_kept(capsys, tmp_path):
    path = tmp_path / "gains.json"
    path.write_text("mine")
    code, _, err = run(capsys, "super-twisting", *FAST, "--out", str(path))
    assert code == 2
    assert "--force" in err
    assert path.read_text() == "mine"


def test_nothing_proved_is_exit_code_one(capsys, monkeypatch):
    from quakedesign.lyapunov.gains import synthesise as gains

    monkeypatch.setattr(gains, "synthesise", lambda *a, **k: None)
    code, out, _ = run(capsys, "cta", "--json")
    assert code == 1
    assert json.loads(out)["verdict"] == "undecided"
    code, out, _ = run(capsys, "cta")
    assert code == 1
    assert out.startswith("undecided")


def test_people_get_a_table(capsys):
    code, out, _ = run(capsys, "super-twisting", *FAST)
    assert code == 0
    assert out.startswith("proved: super-twisting with k1 = ")
    assert "these" in out


@pytest.mark.slow
def test_the_smallest_sampled_error_on_a_fault(capsys, tmp_path, monkeypatch):
    from quakedesign.synthesis import simulated_error

    search = cache(partial(simulated_error.synthesise_sampled, rounds=2))  # so that the second call is short
    monkeypatch.setattr(simulated_error, "synthesise", lambda *_, **__: None)
    monkeypatch.setattr(simulated_error, "synthesise_sampled", search)
    path = tmp_path / "gains.json"
    asked = ("cta", "real-fault", "--objective", "sampled", "--step", "92 ms", "--degree", "5")
    code, out, _ = run(capsys, *asked, "--out", str(path), "--json")
    found = json.loads(out)
    certificate = qd.load_certificate(path)
    assert code == 0
    assert str(certificate.check()) == found["verdict"] == "proved"
    assert found["gains"] == {name: str(k) for name, k in certificate.loop.gains.items()}
    assert (found["objective"], found["unit"]) == ("max_slip_rate_error", "m/s")
    assert (found["step"], found["scheme"], found["fault"]) == (0.092, "explicit", "real-fault")
    assert min(c["ratio"] for c in found["compared"]) >= 1
    code, out, _ = run(capsys, *asked)
    assert code == 0
    assert "measured, not proved" in out
    assert "max_slip_rate_error [m/s]" in out


def test_a_folder_that_does_not_exist_is_refused_before_the_search(capsys, tmp_path, monkeypatch):
    from quakedesign.lyapunov.gains import synthesise as gains

    monkeypatch.setattr(gains, "synthesise", lambda *_, **__: pytest.fail("searched"))
    for path in (tmp_path / "none" / "gains.json", tmp_path):
        code, _, err = run(capsys, "cta", "--out", str(path), "--force")
        assert code == 2
        assert "must be in a folder that can be written" in err or "which is a folder" in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("pid",),
        ("elqr",),
        ("cta", "--objective", "speed"),
        ("cta", "--lipschitz", "-1"),
        ("cta", "--degree", "-1"),
        ("cta", "--step", "1"),
        ("cta", "real-fault"),
        ("cta", "--objective", "sampled"),
        ("cta", "nowhere", "--objective", "sampled"),
        ("cta", "real-fault", "--objective", "sampled", "--step", "0"),
        ("cta", "real-fault", "--objective", "sampled", "--starts", "2"),
        ("cta", "real-fault", "--objective", "sampled", "--metric", "steps"),
    ],
)
def test_input_that_cannot_be_understood(capsys, arguments):
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert err.count("\n") == 1
