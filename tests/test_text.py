"""Text of users is shown as text: nothing that a terminal obeys, nothing endless."""

import pickle
import unicodedata
from time import perf_counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign import errors
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.text import in_lines, lasting, nearest_name, one_line, visible

EXCEPTIONS = [e for e in vars(errors).values() if isinstance(e, type) and issubclass(e, errors.QuakedesignError)]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("G = 30 GPa, Δμ", "G = 30 GPa, Δμ"),
        ("see [/foo] [bold]x[/bold] :bomb:", "see [/foo] [bold]x[/bold] :bomb:"),
        ("\x1b[2J\x07", r"\x1b[2J\x07"),
        ("a\nproved\r\tb", r"a\nproved\r\tb"),
        ("\x9b31m", r"\x9b31m"),
        ("\u202eevil\u2028", r"\u202eevil\u2028"),
        ("\U000e0041", r"\U000e0041"),
    ],
)
def test_what_a_terminal_obeys_is_written_out(text, shown):
    assert visible(text) == shown


@given(st.text())
def test_one_line_is_one_printable_line_and_stays_itself(text):
    line = one_line(text)
    assert not [c for c in line if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]
    assert one_line(line) == line


def test_long_words_and_long_messages_lose_their_middle():
    path = "/tmp/" + "a" * 5000 + "/fault.toml"
    line = one_line(f"fault file cannot be read: {path}: File name too long.")
    assert len(line) < 300
    assert line.startswith("fault file cannot be read: /tmp/aaa")
    assert line.endswith("a/fault.toml: File name too long.")
    assert f"({len(path) + 1} characters)" in line
    assert len(one_line("word " * 5000)) <= 2000


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("short: as it is", ["short: as it is"]),
        ("a" * 90 + ": " + "b, " * 50 + "c", ["a" * 90 + ":", "b, " * 50 + "c"]),
        ("a: " + "b" * 90 + ", " + "c" * 150, ["a: " + "b" * 90 + ",", "c" * 150]),  # nothing alone on a line
        ("a" * 199 + ". " + "b", ["a" * 199 + ".", "b"]),
        ("a" * 200 + ". " + "b" * 90 + "; " + "c" * 150, ["a" * 200 + ".", "b" * 90 + ";", "c" * 150]),
        ("x" * 500, ["x" * 500]),
        ("V = " + "f(x, 2) + " * 30, ["V = " + "f(x, 2) + " * 30]),  # a formula stays whole
        ("f(x, 2)*[1, 2]" * 20 + ", " + "b", ["f(x, 2)*[1, 2]" * 20 + ",", "b"]),
    ],
)
def test_a_long_text_is_told_in_lines_that_end_where_it_divides(text, lines):
    assert in_lines(text) == lines


@given(st.lists(st.text("ab", min_size=1, max_size=60), min_size=1), st.sampled_from([". ", "; ", ": ", ", "]))
def test_lines_have_at_most_two_hundred_characters_and_lose_none(words, mark):
    text = mark.join(words)
    assert " ".join(in_lines(text)) == text
    assert max(map(len, in_lines(text))) <= 200


def test_a_megabyte_is_told_in_lines_at_once():
    text = "L(x, y) = 13/64, " * 60_000
    began = perf_counter()
    assert " ".join(in_lines(text)) == text
    assert perf_counter() - began < 5


@pytest.mark.parametrize("kind", EXCEPTIONS)
def test_every_refusal_is_one_visible_line_and_survives_a_worker(kind):
    error = kind("first\nsecond \x1b[31m " + "x" * 400)
    said = str(error)
    assert said.startswith(r"first second \x1b[31m xxx")
    assert len(said) < 250
    assert str(pickle.loads(pickle.dumps(error))) == said


@pytest.mark.parametrize(
    ("name", "known", "asked"),
    [
        ("elqrr", ("cta", "dia", "elqr"), "elqr"),
        ("ELQR", ("cta", "dia", "elqr"), "elqr"),
        ("ten_percent", ("paper", "ten-percent"), "ten-percent"),
        ("mpa", ("Pa", "MPa"), "MPa"),
        ("kmm", ("m", "mm", "km"), "km"),  # as near to mm: the first letter decides
        ("kmm", ("km", "mm", "m"), "km"),
        ("rate-and-state", ("rate-and-state-slip", "rate-and-state-aging", "slip-rate"), "rate-and-state-aging"),
        ("smooth", ("cta", "dia"), None),
        ("x" * 10_000, ("x",), None),
        ("", ("cta",), None),
        ("cta", (), None),
    ],
)
def test_the_nearest_name_is_asked_for_if_one_is_near(name, known, asked):
    assert nearest_name(name, known) == (f" Did you mean {asked}?" if asked else "")


def test_a_name_that_is_none_of_those_known_is_refused_with_all_of_them_and_the_nearest():
    known = {"cta": 1, "elqr": 2}
    require_known("elqr", known, "controller")
    with pytest.raises(UnknownNameError) as refused:
        require_known("elqrr", known, "controller", UnknownNameError)
    assert str(refused.value) == "controller must be one of cta, elqr. Received 'elqrr'. Did you mean elqr?"
    for wrong in ("wide", 3, None):
        with pytest.raises(ParameterError) as refused:
            require_known(wrong, iter(known), "box")
        assert str(refused.value) == f"box must be one of cta, elqr. Received {wrong!r}."
    with pytest.raises(ParameterError, match=r"^box must be one of none\. Received 'wide'\.$"):
        require_known("wide", (), "box")


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (7199.0, "7199 s"),
        (7200.0, "7200 s (2 hours)"),
        (1.728e6, "1.728e+06 s (20 days)"),
        (31_557_600.0, "3.156e+07 s (365 days)"),
        (63_115_200.0, "6.312e+07 s (2 years)"),
    ],
)
def test_a_long_time_is_told_in_a_unit_that_people_count_in(seconds, said):
    assert lasting(seconds) == said
    assert lasting(1_234_567.0, 6) == "1.23457e+06 s (14.3 days)"
