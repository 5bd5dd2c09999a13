"""Files as laboratories write them: every dialect gives the record of a plain CSV, and every advice gets further."""

import struct

import numpy as np
import pytest
from scipy.io import savemat

from quakedesign.errors import QuakedesignError, RecordError
from quakedesign.identification.record import read_record

HEAD = ("time [s]", "load_point_displacement [um]", "shear_stress [MPa]", "normal_stress [MPa]")
ROWS = np.array([[0.0, 0.0, 3.0988, 5.0], [0.1, 0.1, 3.09801, 5.0], [0.2, 0.2, 3.09963, 5.0], [0.4, 0.4, 3.1, 5.0]])


def lines(sign, number=str):
    return [sign.join(map(number, row.tolist())) for row in ROWS]


def csv(sign=",", number=str, head=HEAD):
    return "\n".join([sign.join(head), *lines(sign, number)]) + "\n"


def fortran(value):
    return f"{value:.6E}".replace("E", "D")


def comma(value):
    return f"{value:.5f}".replace(".", ",")


DIALECTS = {
    "byte-order mark": "\ufeff" + csv(),
    "CRLF": csv().replace("\n", "\r\n"),
    "tabs": csv("\t"),
    "blanks": csv("   "),
    "blanks before numbers": csv("  ", lambda v: f"{v:12.5f}"),
    "semicolons": csv(";"),
    "semicolons and decimal commas": csv(";", comma),
    "tabs and decimal commas": csv("\t", comma),
    "semicolons at the end": "\n".join(line + ";" for line in csv(";").splitlines()),
    "quoted": csv(number=lambda v: f'"{v}"', head=[f'"{name}"' for name in HEAD]),
    "Fortran": csv(number=fortran),
    "remark as heading": "# " + csv(),
    "title before": "Experiment 12\nperformed by us\n\n" + csv(),
    "units in a line": csv(";", head=("time", "load_point_displacement", "shear_stress", "normal_stress")).replace(
        "\n", "\ns;mic;MPa;MPa\n", 1
    ),
    "microns": csv(head=("Time (sec)", "LP_Disp (mic)", "tau (Mpa)", "Effective Normal Stress (MPa)")),
    "Greek": csv(head=("t [s]", "Displ [µm]", "shear stress [MPa]", "sigma_n [MPa]")),
    "units in names": csv(head=("time_s", "Displ_um", "tau_MPa", "sigma_n_MPa")),
    "other columns": csv(head=HEAD).replace("\n", ", temperature [degC]\n", 1).replace(",5.0\n", ",5.0,21\n"),
    "friction too": csv(head=HEAD).replace("\n", ",mu\n", 1).replace(",5.0\n", ",5.0,0.62\n"),
    "xlook": "number of records = 4\n  col 1 col 2 col 3 col 4\n  LP_Disp Shr_stress Nor_stress Time\n"
    "  mic MPa MPa sec\n  4 recs 4 recs 4 recs 4 recs\n"
    + "\n".join(f"{i} {r[1]} {r[2]} {r[3]} {r[0]}" for i, r in enumerate(ROWS)),
    "dates": "\n".join(
        [",".join(HEAD), *(f"2024-03-05 10:00:00.{int(10 * r[0])}00,{r[1]},{r[2]},{r[3]}" for r in ROWS)]
    ),
    "displacements counted backwards": csv()
    .replace(",0.1,", ",-0.1,")
    .replace(",0.2,", ",-0.2,")
    .replace(",0.4,", ",-0.4,"),
}


def same(record):
    np.testing.assert_allclose(record.time, ROWS[:, 0], atol=1e-12)
    np.testing.assert_allclose(record.load_point, 1e-6 * ROWS[:, 1], rtol=1e-6, atol=1e-18)
    np.testing.assert_allclose(record.friction, ROWS[:, 2] / ROWS[:, 3], rtol=1e-6)
    np.testing.assert_allclose(record.normal, 5e6)
    return True


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_gives_the_same_record(dialect, tmp_path):
    path = tmp_path / "record.csv"
    path.write_bytes(DIALECTS[dialect].encode())
    assert same(read_record(path))


@pytest.mark.parametrize("code", ["utf-16", "latin-1"])
def test_other_codes_of_text_are_read(code, tmp_path):
    path = tmp_path / "record.csv"
    path.write_bytes(DIALECTS["Greek"].encode(code))
    assert same(read_record(path))


@pytest.mark.parametrize(("channels", "kind"), [(16, ">f4"), (32, ">f4"), (32, "<f8"), (32, ">f8")])
def test_xlooks_reduced_binary_is_read(channels, kind, tmp_path):
    """Laid out by its source: title, three integers and a float, then names, units, gain, remark and length."""
    path, names = tmp_path / "p1", (("Time", "sec"), ("LP_Disp", "mic"), ("Shr_stress", "MPa"), ("Nor_stress", "MPa"))
    told = [(name.encode(), unit.encode(), len(ROWS)) for name, unit in names]
    told += [(b"no_val", b"no_val", 0)] * (channels - 4)
    header = struct.pack(">20siiif", b"p1", len(ROWS), 4, 0, 0.0)
    header += b"".join(struct.pack(">13s13sf50si", name, unit, 1.0, b"", length) for name, unit, length in told)
    path.write_bytes(header + ROWS.T.astype(kind).tobytes())
    assert same(read_record(path))
    path.write_bytes(header.replace(b"mic", b"bits"[:3]).replace(b"MPa\0", b"bits") + ROWS.T.astype(kind).tobytes())
    with pytest.raises(RecordError, match=r"raw readings, in bits\. Run its reduction"):
        read_record(path)


def test_arrays_of_matlab_are_read_and_nothing_else(tmp_path):
    path = tmp_path / "run.mat"
    t, x, tau, sigma = ROWS.T
    savemat(path, {"time_s": t, "Displ_um": x, "tau_MPa": tau, "sigma_n_MPa": sigma, "note": "ours", "n": 3})
    assert same(read_record(path))
    savemat(path, {"t": t[:, None], "x": x, "y": tau, "z": sigma, "data": {"inner": t}})
    with pytest.raises(RecordError, match="must have its unit in brackets"):
        read_record(path)
    named = "time=t [s], load_point_displacement=x [um], shear_stress=y [MPa], normal_stress=z [MPa]"
    assert same(read_record(path, columns=named))
    savemat(path, {"A": ROWS})
    with pytest.raises(RecordError, match=r"columns of numbers alone.*--columns 'time=1"):
        read_record(path)
    assert same(read_record(path, columns=NUMBERED))
    savemat(path, {"data": {"inner": t}})
    with pytest.raises(RecordError, match=r"numeric arrays of equal length.*data. Save the columns as vectors"):
        read_record(path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RecordError, match="MATLAB"):
        read_record(path)


NUMBERED = "time=1 [s], load_point_displacement=2 [um], shear_stress=3 [MPa], normal_stress=4 [MPa]"
ADVICE = {
    "decimal commas between commas: semicolons": (
        csv(",", comma),
        "Separate the columns by semicolons",
        csv(";", comma),
        "",
    ),
    "numbers alone": ("\n".join(lines(",")), "Write names and units above, or give them", None, NUMBERED),
    "a misspelt name": (csv().replace("shear_stress", "shear_stres"), "Did you mean shear_stress", csv(), ""),
    "a name of one's own": (csv().replace("time", "clock"), "--columns 'time=clock [s]'", None, "time=clock [s]"),
    "no unit": (csv().replace("time [s]", "time"), r"--columns 'time=time [s]'", None, "time=time [s]"),
    "two that mean the same": (
        csv(head=("time [s]", "Displ [um]", "shear_stress [MPa]", "sigma_n [MPa]"))
        .replace("\n", ",disp [um]\n", 1)
        .replace(",5.0\n", ",5.0,7\n"),
        "--columns 'load_point_displacement=disp [um]'",
        None,
        "load_point_displacement=Displ [um]",
    ),
    "readings of an instrument": (
        csv(head=("time [s]", "LP_Disp [bits]", *HEAD[2:])),
        "--columns 'load_point_displacement=LP_Disp [0.0765 um]'",
        None,
        "load_point_displacement=LP_Disp [1.0 um]",
    ),
    "a text among numbers": (csv().replace("3.09801", "three"), "line 3 .*leave it empty", csv(), ""),
    "dates of another order": (DIALECTS["dates"].replace("2024-03-05", "05.03.2024"), "as 2024-03-05", csv(), ""),
    "one decimal comma": (
        csv(";").replace("3.09963", "3,09963"),
        "or decimal commas in every number",
        csv(";", comma),
        "",
    ),
    "shear counted backwards": (csv().replace(",3.", ",-3."), "Change its sign", csv(), ""),
    "a clock that starts anew": (csv().replace("0.4,", "0.0,", 1), "Sort the record", csv(), ""),
}


@pytest.mark.parametrize("case", ADVICE)
def test_who_follows_an_advice_gets_further(case, tmp_path):
    text, said, mended, columns = ADVICE[case]
    path = tmp_path / "record.csv"
    path.write_text(text)
    pattern = said if ".*" in said else said.replace("[", r"\[").replace("]", r"\]")
    with pytest.raises(QuakedesignError, match=pattern) as refused:
        read_record(path)
    assert "\n" not in str(refused.value)
    path.write_text(mended or text)
    assert same(read_record(path, columns=columns))


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ("tme=Time(s)", "Did you mean time"),
        ("time", "Write an equals sign"),
        ("time=clock", "must name a heading of the file. Received 'clock'. Write one of 'time"),
        ("friction=shear_stress [kg]", "column friction must be"),
    ],
)
def test_columns_that_cannot_be_named_are_refused(columns, said, tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(csv())
    with pytest.raises(QuakedesignError, match=said):
        read_record(path, columns=columns)


def test_rows_without_a_number_and_times_that_repeat_are_counted_once(tmp_path):
    path = tmp_path / "record.csv"
    rows = ["0.05,nan,nan,5", "0.06,,3,5", "0.2,0.3,3.2,5", "0.3,0.3,-,5"]
    text = csv().splitlines()
    path.write_text("\n".join([*text[:2], *rows[:2], *text[2:4], rows[2], rows[3], text[4]]))
    record = read_record(path)
    assert record.remarks == (
        "3 of 8 rows excluded, because a number is missing",
        "1 samples at the time of another: replaced by the mean at this time",
    )
    np.testing.assert_allclose(record.time, [0, 0.1, 0.2, 0.4])
    np.testing.assert_allclose(record.load_point[2], 0.25e-6)
    np.testing.assert_allclose(record.friction[2], (3.09963 + 3.2) / 2 / 5)
    path.write_text(text[0] + "\n" + "\n".join(["0,,3,5", "1,1,,5"]))
    with pytest.raises(RecordError, match="none in 2 rows"):
        read_record(path)


def test_what_names_were_taken_for_and_what_was_not_read_is_told(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(DIALECTS["microns"].replace("\n", ",nor_disp (mic)\n", 1).replace(",5.0\n", ",5.0,8\n"))
    assert read_record(path).remarks == (
        "LP_Disp (mic) is read as load_point_displacement",
        "tau (Mpa) is read as shear_stress",
        "Effective Normal Stress (MPa) is read as normal_stress",
        "not read: 'nor_disp (mic)'",
    )


@pytest.mark.parametrize(
    ("begin", "end", "kept"),
    [
        ("0.1 s", None, [1, 2, 3]),
        (None, "0.25 s", [0, 1, 2]),
        ("0.05 um", "200 nm", [1, 2]),
        ("100 ms", "0.4 um", [1, 2, 3]),
    ],
)
def test_a_window_is_counted_as_the_file_counts(begin, end, kept, tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(csv())
    record = read_record(path, begin=begin, end=end)
    np.testing.assert_allclose(record.time + record.origin, ROWS[kept, 0])
    np.testing.assert_allclose(record.friction, ROWS[kept, 2] / 5)
    with pytest.raises(
        RecordError, match=r"needs two samples\. Received from 7 s to the last in a record from 0 to 0.4"
    ):
        read_record(path, begin="7 s")
    with pytest.raises(QuakedesignError, match="a time, or a displacement"):
        read_record(path, begin="7 kg")


def test_no_file_ends_in_a_traceback(tmp_path):
    """Single bytes of every dialect replaced: read, or refused in one line."""
    draw, path = np.random.default_rng(0), tmp_path / "record.csv"
    told = []
    for text in DIALECTS.values():
        data = bytearray(text.encode())
        for _ in range(12):
            changed = bytearray(data)
            changed[draw.integers(len(data))] = draw.integers(256)
            path.write_bytes(bytes(changed))
            try:
                read_record(path)
            except QuakedesignError as refused:
                told.append(str(refused))
    assert len(told) > 20
    assert [said for said in told if "\n" in said] == []
