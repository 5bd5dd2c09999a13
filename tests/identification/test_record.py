"""Records are read with their units; what is wrong is said in one line."""

import re
from pathlib import Path

import numpy as np
import pytest

from quakedesign.errors import QuakedesignError, RecordError
from quakedesign.fault.units import si_value
from quakedesign.identification.record import read_record
from quakedesign.identification.record_file import COLUMNS, _meant

HEAD = "time [ms], load_point_displacement [um], shear_stress [MPa], normal_stress [kPa]"
ROWS = ["0, 5, 3, 5000", "100, 6, 3.1, 5000", "300, 8, 3.2, 6000"]


def written(tmp_path, *lines):
    path = tmp_path / "record.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_byte_order_mark_is_no_part_of_the_first_column(tmp_path):
    path = tmp_path / "marked.csv"
    path.write_text("\n".join([HEAD, *ROWS]) + "\n", encoding="utf-8-sig")
    assert read_record(path).time.tolist() == read_record(written(tmp_path, HEAD, *ROWS)).time.tolist()


def test_units_become_si(tmp_path):
    record = read_record(written(tmp_path, "# a remark", HEAD, *ROWS))
    np.testing.assert_allclose(record.time, [0, 0.1, 0.3])
    np.testing.assert_allclose(record.load_point, [0, 1e-6, 3e-6])
    np.testing.assert_allclose(record.friction, [0.6, 0.62, 3.2 / 6])
    np.testing.assert_allclose(record.normal, [5e6, 5e6, 6e6])
    assert (record.name, record.normal_unit, record.stiffness_unit, record.slip) == ("record", "Pa", "Pa/m", None)


def test_a_rate_is_a_staircase_that_is_summed_to_a_displacement(tmp_path):
    """1 um/s for a second, then 3 um/s for two."""
    path = written(tmp_path, "time [s], load_point_rate [um/s], friction", "0, 1, 0.6", "1, 3, 0.7", "3, 5, 0.6")
    record = read_record(path)
    np.testing.assert_allclose(record.load_point, [0, 1e-6, 7e-6])
    np.testing.assert_allclose(record.load_rates, [1e-6, 3e-6, 5e-6])
    assert record.stiffness_unit == "1/m"


@pytest.mark.parametrize(
    "head",
    [
        "Time (s), Load point displacement (um), Shear-stress [MPa], NORMAL STRESS (MPa)",
        " time[s] ,load_point_displacement(um),Shear  stress ( MPa ), Normal_Stress [MPa] ",
    ],
)
def test_headings_of_laboratories_are_read(tmp_path, head):
    """Round brackets, capitals, and blanks or hyphens between words."""
    plain = "time [s], load_point_displacement [um], shear_stress [MPa], normal_stress [MPa]"
    rows = ("0, 0, 3, 5", "1, 2, 2.9, 5", "2, 4, 3.1, 5")
    found, known = (read_record(written(tmp_path, line, *rows)) for line in (head, plain))
    for name in ("time", "friction", "load_point", "normal"):
        assert np.array_equal(getattr(found, name), getattr(known, name))


def test_a_constant_normal_stress_stands_in_for_a_column(tmp_path):
    path = written(tmp_path, "time [s], shear_stress [MPa], slip [mm]", "0, 3, 0", "1, 2, 1")
    np.testing.assert_allclose(read_record(path, normal_stress=5e6).friction, [0.6, 0.4])


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([], "is empty"),
        ([HEAD.replace("shear_stress", "shear_stres"), *ROWS], "Did you mean shear_stress"),
        ([HEAD.replace("time [ms]", "pressure [Pa]"), *ROWS], r"column time\. .*--columns 'time=pressure \[s\]'"),
        ([HEAD.replace("time [ms]", "slip [mm]"), *ROWS], "the column time"),
        ([HEAD.replace(" [MPa]", ""), *ROWS], "must have its unit in brackets"),
        ([HEAD.replace("[ms]", "[MPa]"), *ROWS], "another dimension"),
        ([HEAD.replace("[ms]", "[lightyearz]"), *ROWS], "unit is unknown"),
        ([HEAD + ", normal_stress [Pa]", *(row + ", 5" for row in ROWS)], "twice"),
        ([HEAD.replace(", normal_stress [kPa]", ""), "0, 5, 3"], "needs the column normal_stress"),
        ([HEAD.replace("shear_stress [MPa]", "shear_force [kN]"), *ROWS], "Divide the force by the sliding area"),
        ([HEAD.replace("shear_stress [MPa]", "slip [mm]"), *ROWS], "exactly one column friction"),
        ([HEAD + ", friction", "0, 5, 3, 5000, 1", "1, 5, 3, 5000, 1"], "exactly one column friction"),
        ([HEAD, ROWS[1], ROWS[0]], "time must ascend"),
        ([HEAD, ROWS[0], "1, 2, 3, 4, 5"], "line 3 must have 4 values. Received 5"),
        ([HEAD, ROWS[0], "1, 2, three, 4"], r"3 must have a number in column shear_stress\. Received 'three'"),
        ([*ROWS], r"begin with a line of headings\. Received 4 columns of numbers alone.*--columns 'time=1 \[s\]"),
        ([HEAD, ROWS[0], "100, 2, 3, -1"], "normal_stress must be positive"),
        ([HEAD, *["0, 0, 0, 0"] * 5], "at most 4 samples. Received 5"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, monkeypatch, lines, said):
    monkeypatch.setattr("quakedesign.identification.record_file.MOST_SAMPLES", 4)
    with pytest.raises(QuakedesignError, match=said) as refused:
        read_record(written(tmp_path, *lines))
    assert "\n" not in str(refused.value)


def test_a_line_of_headings_alone_is_no_record(tmp_path):
    path = tmp_path / "none.csv"
    path.write_text("time [s], load_point_displacement [um], shear_stress [MPa], normal_stress [MPa]\n# a remark\n")
    with pytest.raises(RecordError, match=r"must have samples\. Received .*none\.csv"):
        read_record(path)


@pytest.mark.parametrize(
    ("shear", "normal", "said"),
    [
        ("-15", "25 MPa", "shear_stress must be positive. Received a median friction of -0.6. Change its sign."),
        ("15", "25 Pa", "median from 0.01 to 3. Received 6e+05. Check the units"),
        ("0.2", "25 MPa", "Received 0.008. Check the units of shear_stress and normal_stress, or of --normal-stress."),
    ],
)
def test_friction_that_no_rock_has_is_refused_with_its_likely_cause(shear, normal, said, tmp_path):
    path = tmp_path / "wrong.csv"
    path.write_text("time [s], load_point_displacement [um], shear_stress [MPa]\n" + f"0, 0, {shear}\n1, 1, {shear}\n")
    with pytest.raises(RecordError, match=re.escape(said)):
        read_record(path, normal_stress=si_value(normal, "Pa", "normal stress"))


SCALED = [
    ("time", 1e-300, "the duration must be from 1e-06"),
    ("time", 1e30, "the duration must be from 1e-06"),
    ("load_point_displacement", 1e30, "the range of load_point_displacement"),
    ("load_point_displacement", 1e-300, "the range of load_point_displacement"),
    ("load_point_displacement", 1e10, "the mean rate of load_point_displacement must be from 1e-15"),
    ("normal_stress", 1e30, "the largest normal_stress"),
]


@pytest.mark.parametrize(("column", "factor", "said"), SCALED)
def test_sizes_that_no_experiment_has_are_refused(column, factor, said, tmp_path):
    """Rates of 1e24 m/s were accepted; times of 1e-300 s ended in the words of LAPACK."""
    factors = dict.fromkeys(("time", "load_point_displacement", "shear_stress", "normal_stress"), 1.0) | {
        column: factor
    }
    rows = [(0.001 * i, 1e-8 * i, 6e6, 1e7) for i in range(50)]
    lines = [",".join(repr(v * f) for v, f in zip(row, factors.values(), strict=True)) for row in rows]
    units = "time [s],load_point_displacement [m],shear_stress [Pa],normal_stress [Pa]"
    path = tmp_path / "r.csv"
    path.write_text("\n".join([units, *lines]), encoding="utf-8")
    with pytest.raises(RecordError, match=said):
        read_record(path)


def test_the_same_record_is_read_in_its_own_units(tmp_path):
    path = tmp_path / "r.csv"
    rows = "\n".join(f"{0.001 * i},{1e-8 * i},6e6,1e7" for i in range(50))
    path.write_text(f"time [s],load_point_rate [m/s],shear_stress [Pa],normal_stress [Pa]\n{rows}", encoding="utf-8")
    assert len(read_record(path).time) == 50
    path.write_text(path.read_text(encoding="utf-8").replace("4.9e-07", "1e24"), encoding="utf-8")
    with pytest.raises(RecordError, match="the largest load_point_rate"):
        read_record(path)


def test_a_column_of_weights_counts_samples_and_leaves_out_those_of_weight_0(tmp_path):
    lines = ["time [s], load_point_displacement [um], friction, weight"]
    lines += [f"{t}, {t}, {0.6 + 0.001 * t}, {w}" for t, w in enumerate((2, 1, 0, 3))]
    path = tmp_path / "weighted.csv"
    path.write_text("\n".join(lines))
    record = read_record(path)
    assert record.time.tolist() == [0, 1, 3]
    assert record.counts.tolist() == [1, 0.5, 1.5]
    assert "1 samples of weight 0 excluded" in record.remarks
    for rows, ends in (([*lines[:3], "2, 2, 0.6, -1"], "-1 to 2"), ([*lines[:2], "1, 1, 0.6, 0"], "0 to 2")):
        path.write_text("\n".join(rows))
        with pytest.raises(RecordError, match=rf"weight must be positive, or 0 for excluded samples. Received {ends}"):
            read_record(path)


def test_names_of_columns_on_the_page_are_understood():
    page = (Path(__file__).parents[2] / "docs" / "explanation" / "identification.md").read_text(encoding="utf-8")
    rows = [row.split("|")[1:3] for row in page.splitlines() if row.startswith("| `") and row.split("`")[1] in COLUMNS]
    assert {name for meant, _ in rows for name in re.findall("`(.+?)`", meant)} == {*COLUMNS} - {"slip", "weight"}
    for meant, names in rows:
        for name, others in zip(re.findall("`(.+?)`", meant), names.split(";"), strict=False):
            for other in re.findall("`(.+?)`", others):
                assert _meant(other) == name


def test_what_falls_is_turned_and_what_slows_down_is_not(tmp_path):
    """A displacement above zero that falls, and rates that are positive and fall."""
    record = read_record(written(tmp_path, "time [s], displ [um], mu", "0, 100, 0.6", "1, 80, 0.61", "2, 50, 0.6"))
    assert record.load_point.tolist() == pytest.approx([0, 20e-6, 50e-6])
    assert "load_point_displacement runs backward: its sign is changed" in record.remarks
    record = read_record(written(tmp_path, "time [s], velocity [um/s], mu", "0, 10, 0.6", "1, 3, 0.61", "2, 1, 0.6"))
    assert record.load_point.tolist() == pytest.approx([0, 10e-6, 13e-6])
    assert not any("sign is changed" in remark for remark in record.remarks)


@pytest.mark.parametrize(
    ("head", "remedy"),
    [
        (
            "clock, displ [um], mu",
            r"Received load_point_displacement, friction, and unknown: 'clock'.*'time=clock \[s\]'",
        ),
        (
            "displ [um], mu, tau [MPa]",
            r"Received load_point_displacement, friction, shear_stress\. Add.*'time=1 \[s\]'",
        ),
        ("time [s], displ [um], tau [MPa]", r"needs the column normal_stress or a constant normal stress\. Received"),
        ("time [s], displ [um], shear_force [kN]", r"needs the column normal_force\. Received .*Add it\."),
        ("time [s], tau [MPa], normal_force [kN]", r"Divide the force by the sliding area\."),
    ],
)
def test_a_missing_column_is_named_with_its_remedy(head, remedy, tmp_path):
    with pytest.raises(RecordError, match=remedy):
        read_record(written(tmp_path, head, "0, 1, 0.6", "1, 2, 0.61", "2, 3, 0.6"))
