"""The command from a record to a fault file."""

import json

import numpy as np
import pytest

from quakedesign.cli import main
from quakedesign.fault import fault_toml, load_fault


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(["identify", *map(str, arguments)])
    out, err = capsys.readouterr()
    return ended.value.code, out, err


@pytest.fixture
def record(tmp_path):
    slip = np.linspace(0, 20, 300)
    noise = 2e-3 * np.random.default_rng(0).standard_normal(300)
    shear = (0.4 + 0.17 * np.exp(-slip / 2.5) + noise) * 5
    rows = [f"{0.1 * i:.6f},{s:.6f},{t:.6f}" for i, (s, t) in enumerate(zip(slip, shear, strict=True))]
    path = tmp_path / "weakening.csv"
    path.write_text("\n".join(["time [s], slip [mm], shear_stress [MPa]", *rows]) + "\n")
    return path


def test_json_holds_what_is_promised(record, tmp_path, capsys):
    toml, figure = tmp_path / "found.toml", tmp_path / "found.svg"
    options = ("--law", "exponential-slip-weakening", "--normal-stress", "5 MPa")
    code, out, _ = run(capsys, record, *options, "--out", toml, "--figure", figure, "--json")
    answer = json.loads(out)
    assert code == 0
    assert {"law", "parameters", "residual", "box", "outliers", "figure", "file"} <= set(answer)
    drop = answer["parameters"]["drop"]
    assert drop["low"] < 0.17 < drop["high"]
    assert drop["unit"] == ""
    assert answer["box"]["drop"][0] < drop["low"] < drop["value"] < drop["high"] < answer["box"]["drop"][1]
    assert load_fault(toml).name == "lab-fault-identified-weakening"
    assert "<svg" in figure.read_text()[:2000]


def test_text_keeps_within_80_columns_and_says_what_is_not_from_the_record(record, capsys, tmp_path):
    told = (record, "--law", "linear-slip-weakening", "--normal-stress", "5 MPa")
    code, out, _ = run(capsys, *told)
    assert code == 1  # a line is no exponential
    assert "does not explain the record: residuals are" in " ".join(out.split())
    assert "not from the record" not in out
    written = run(capsys, *told, "--out", str(tmp_path / "own.toml"))[1]
    assert "from lab-fault, not from the record: normal stress, size, task, T_s, disturbance" in " ".join(
        written.split()
    )
    assert "suggested: --figure, which shows where the fit fails; another --law; one step alone" in " ".join(
        written.split()
    )
    assert "next: none: the fit does not explain the record" in written
    exponential = (*told[:2], "exponential-slip-weakening", *told[3:], "--out", str(tmp_path / "better.toml"))
    assert f"next: quakedesign design {tmp_path / 'better.toml'}" in run(capsys, *exponential)[1]
    assert "next: " not in out
    assert "next: --out FILE writes a fault file for design" in run(capsys, *exponential[:-2])[1]
    assert max(map(len, out.splitlines())) <= 80


def test_what_cannot_be_told_is_said_and_no_file_written(tmp_path, capsys):
    """Slip so long that only the residual is left."""
    path, toml = tmp_path / "late.csv", tmp_path / "found.toml"
    noise = 2e-3 * np.random.default_rng(0).standard_normal(100)
    rows = [f"{i},{50 + i},{0.4 + noise[i]}" for i in range(100)]
    path.write_text("\n".join(["time [s],slip [mm],friction", *rows]) + "\n")
    code, out, _ = run(capsys, path, "--law", "exponential-slip-weakening", "--out", toml)
    assert code == 1
    assert "critical_slip is not identifiable from this record" in " ".join(out.split())
    assert "not written" in out
    assert not toml.exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--law", "rate-and-state-agin"), "friction law must be one of"),
        (("--stiffness", "5 GPa"), "stiffness must be"),
        (("--figure", "x.bmp"), "must end in .svg, .pdf, .png"),
        (("--fault", "nowhere"), "fault must be a preset"),
        (("--out", "nowhere/found.toml"), "must be in a folder that can be written"),
        ((), "needs the motion of the load point"),
        (("--seed", "-1"), "seed must be a whole number of at least 0"),
        (("--out", "same.svg", "--figure", "same.svg"), "--out and --figure must be different files"),
    ],
)
def test_nonsense_is_refused_in_one_line(record, monkeypatch, tmp_path, capsys, more, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, record, "--normal-stress", "5 MPa", *more)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err


@pytest.mark.parametrize("option", ["--out", "--figure"])
def test_a_record_is_never_replaced_by_its_answer(record, capsys, tmp_path, option):
    data = tmp_path / "record.svg"
    data.write_text(record.read_text())
    (tmp_path / "link.svg").symlink_to(data)
    for place in (data, tmp_path / "link.svg"):
        code, out, err = run(capsys, data, option, place, "--force")
        assert (code, out) == (2, "")
        assert "the record must be different files" in err
    assert data.read_text() == record.read_text()


def test_nor_is_the_fault(record, capsys, tmp_path):
    (tmp_path / "own.toml").write_text(fault_toml(load_fault("lab-fault")))
    given = (record, "--fault", tmp_path / "own.toml", "--out", tmp_path / "own.toml", "--force")
    code, _, err = run(capsys, *given)
    assert code == 2
    assert "--out and --fault must be different files" in err
    assert load_fault(tmp_path / "own.toml").name == "lab-fault"


def test_files_of_several_steps_are_fitted_together_and_one_with_trend_in_time_by_itself(tmp_path, capsys):
    """Two files that cannot be fitted by one law without a state; options reach both."""
    rows = [f"{t / 10}, {t / 10}, {0.6 + 0.0001 * (t % 3)}" for t in range(60)]
    paths = [tmp_path / name for name in ("one.csv", "two.csv")]
    for path in paths:
        path.write_text("\n".join(["time [s], load_point_displacement [um], friction", *rows]))
    code, _, err = run(capsys, *paths, "--law", "rate-and-state-sli")
    assert code == 2
    assert "friction law must be one of" in err
    code, _, err = run(capsys, paths[0], "--steps", "0 s to 2 s, 2 s")
    assert code == 2
    assert "--steps must name windows" in err
    assert "auto" in run(capsys, paths[0], "--trend", "never")[2]
    for option, own in (("--out", tmp_path / "b.toml"), ("--figure", tmp_path / "b.svg")):
        own.write_text(paths[1].read_text())
        code, _, err = run(capsys, paths[0], own, option, own, "--force")
        assert code == 2
        assert f"{option} and record 2 must be different files" in err
    code, _, err = run(capsys, *paths, paths[1])
    assert code == 2
    assert "record 2 and record 3 must be different files" in err
