"""`synthesise` on the command line."""

import json
from fractions import Fraction
from functools import cache, partial
from types import SimpleNamespace

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
    assert "synthesised" in out


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
    assert "simulated, not proved" in out
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


def test_the_sampled_objective_needs_a_fault_and_takes_degrees(capsys, monkeypatch):
    from quakedesign.synthesis import simulated_error

    asked = []
    monkeypatch.setattr(simulated_error, "synthesise_sampled", lambda trial, **told: asked.append(told))
    code, _, err = run(capsys, "cta", "--objective", "sampled")
    assert (code, err.count("\n"), asked) == (2, 1, [])
    assert "the objective sampled needs a fault. Received none. Give a preset or a file after cta" in err
    for told, degrees in (((), None), (("--degree", "5", "--degree", "6"), (5, 6))):
        code, out, _ = run(capsys, "cta", "real-fault", "--objective", "sampled", *told, "--json")
        answer = json.loads(out)
        assert (code, answer["verdict"], asked.pop()) == (1, "undecided", {"degrees": degrees})
        assert (answer["fault"], answer["scheme"], answer["step"]) == ("real-fault", "explicit", 0.184)


def found(unit, value, *, beta=None):
    """A synthesis as it is shown: gains of 1 and 3/2, compared with others that are proved and that are not."""
    gains = {"k1": Fraction(3, 2), "k2": Fraction(1)}
    others = [({"k1": Fraction(3), "k2": Fraction(2)}, 4.0, 3.5, 2.0)]
    others += [({"k1": Fraction(7), "k2": Fraction(5)}, None, 8.6, None)]
    uncertain = {"d": (Fraction(-2), Fraction(2))} | ({"beta": beta} if beta else {})
    return SimpleNamespace(
        objective="decay",
        gains=gains,
        value=value,
        unit=unit,
        norm=1.8,
        certificate=SimpleNamespace(loop=SimpleNamespace(uncertain=uncertain)),
        compared=[SimpleNamespace(gains=g, value=v, norm=n, ratio=r) for g, v, n, r in others],
    )


@pytest.mark.parametrize(
    ("unit", "value", "beta", "said"),
    [
        (
            "-",
            2.0,
            None,
            [
                "proved: cta with k1 = 3/2, k2 = 1 for |h'| <= 2",
                "gains decay norm improvement factor",
                "synthesised 2 1.8",
            ],
        ),
        (
            "1/s",
            None,
            (Fraction(1, 2), Fraction(3)),
            [
                "proved: cta with k1 = 3/2, k2 = 1 for |h'| <= 2, β in [1/2, 3]",
                "gains decay [1/s] norm improvement factor",
                "synthesised not proved 1.8",
            ],
        ),
    ],
)
def test_the_table_says_ranges_units_and_what_is_not_proved(capsys, monkeypatch, unit, value, beta, said):
    from quakedesign.lyapunov.gains import synthesise as gains
    from quakedesign.synthesis import simulated_error

    monkeypatch.setattr(gains, "synthesise", lambda *_, **__: found(unit, value, beta=beta))
    code, out, _ = run(capsys, "cta")
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert (code, lines) == (0, [*said, "3 2 4 3.5 2", "7 5 not proved 8.6"])
    monkeypatch.setattr(simulated_error, "synthesise_sampled", lambda *_, **__: found(unit, value, beta=beta))
    code, out, _ = run(capsys, "cta", "real-fault", "--objective", "sampled", "--step", "50 ms")
    first, measured, *_ = out.splitlines()
    assert first.startswith("proved: cta with k1 = 3/2")
    assert "simulated, not proved: decay of one explicit run on real-fault with scale" in measured
    assert "T_s = 0.05 s" in measured
    code, out, _ = run(capsys, "cta", "--json")
    answer = json.loads(out)
    assert answer["gain_range"] == (["1/2", "3"] if beta else None)
    assert (answer["lipschitz"], answer["certificate"], answer["value"]) == ("2", None, value)


def test_a_map_takes_several_numbers_after_one_option(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(["map", "cta", "--over", "k1", "k2", "--range", "1", "2", "3"])
    assert stop.value.code == 2
    assert "range needs four numbers, two for each gain. Received 3." in capsys.readouterr().err
