"""`certify` for sliding modes, and `map`, on the command line."""

import json

import pytest

from quakedesign.cli import main


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def test_the_largest_bound_is_proved_and_written(capsys, tmp_path):
    out = tmp_path / "c.json"
    asked = ("certify", "super-twisting", "--gains", "0.7", "2", "--maximize", "lipschitz", "--out", str(out), "--json")
    code, said, _ = run(capsys, *asked)
    found = json.loads(said)
    assert code == 0
    assert {"verdict", "lipschitz", "gain_range", "decay", "certificate", "seconds", "limit", "settling"} <= set(found)
    assert (found["verdict"], found["limit"], found["certificate"]) == ("proved", "2", str(out))
    code, said, _ = run(capsys, "check", str(out))
    assert code == 0
    assert found["lipschitz"] in said


def test_what_is_not_proved_is_code_one(capsys):
    code, said, _ = run(capsys, "certify", "cta", "--gains", "7", "5", "2.3", "2.3", "--maximize", "lipschitz")
    assert code == 1
    assert "an exact counterexample was found" in said


MAP = ("map", "super-twisting", "--gains", "1.5", "1.1", "--degree", "6", "--interior", "2", "--workers", "1")
OVER, FIVE, ONE = ("--over", "k1", "k2"), ("--points", "5"), ("--lipschitz", "1")


@pytest.mark.slow
def test_a_map_is_a_folder_with_figure_table_and_certificates(capsys, tmp_path):
    folder = tmp_path / "m"
    code, said, err = run(
        capsys, *MAP, *OVER, *FIVE, *ONE, "--range", "0.4", "3", "0.8", "4", "--out", str(folder), "--format", "svg"
    )
    assert code == 0
    assert "proved exactly, among them" in said
    assert {p.name for p in folder.iterdir()} == {"map.svg", "map.csv", "results.json", "certificates"}
    files = [str(p) for p in sorted((folder / "certificates").iterdir())]
    assert run(capsys, "check", *files)[0] == 0
    assert run(capsys, *MAP, *OVER, *FIVE, *ONE, "--out", str(folder))[0] == 2
    code, said, err = run(capsys, *MAP, *OVER, *ONE, "--points", "3", "--out", str(folder), "--force", "--json")
    found = json.loads(said)
    assert (code, err) == (0, "")
    assert {"points", "screened", "proved"} <= set(found)
    assert found["points"] == 9
    assert found["ranges"] == {"k1": ["3/8", "6"], "k2": ["11/40", "22/5"]}


WRONG = {
    "gain": ("--over", "k1", "k7"),
    "range": (*OVER, "--range", "1", "2"),
    "falling range": (*OVER, "--range", "2", "1", "1", "2"),
    "no number": (*OVER, "--lipschitz", "x"),
    "points": (*OVER, "--points", "1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_input_is_one_line_and_nothing_is_written(case, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *MAP, *WRONG[case])
    assert (code, out) == (2, "")
    assert len([line for line in err.splitlines() if line.strip()]) == 1
    assert list(tmp_path.iterdir()) == []


def test_gains_are_needed_where_none_are_known(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, "map", "super-twisting", *OVER)
    assert code == 2
    assert "base gains exist for" in err
