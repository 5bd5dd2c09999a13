"""Quantities with units, each wrong one with its own message."""

import math
import re
import subprocess
import sys

import pytest

from quakedesign.errors import UnitError
from quakedesign.fault import units
from quakedesign.fault.units import si_value


@pytest.mark.parametrize(
    ("quantity", "unit", "value"),
    [
        ("30 GPa", "Pa", 30e9),
        ("225.5 kPa", "Pa", 225500.0),
        ("276.35 mm", "m", 0.27635),
        ("184.17 hour", "s", 663012.0),
        ("184 ms", "s", 0.184),
        ("2 hours", "s", 7200.0),
        ("3 meters", "m", 3.0),
        ("5e14 kg/s", "kg/s", 5e14),
        ("2.5 g/cm^3", "kg/m^3", 2500.0),
        ("2500 kg/m³", "kg/m^3", 2500.0),
        ("-3.2e-6 1/s^2", "1/s^2", -3.2e-6),
        ("007 MPa", "Pa", 7e6),
        (".5MPa", "Pa", 5e5),
        ("5. MPa", "Pa", 5e6),
        ("+08", "", 8.0),
        ("3 m s^-1", "m/s", 3.0),
        ("2 m*s**-2", "m/s^2", 2.0),
        ("4 /s", "1/s", 4.0),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("10 %", "", 0.1),
        ("0.4", "", 0.4),
        (0.4, "", 0.4),
        (3, "", 3.0),
    ],
)
def test_conversion(quantity, unit, value):
    assert si_value(quantity, unit, "it") == pytest.approx(value, rel=1e-15)


def test_decimals_are_not_rounded_twice():
    assert si_value("0.1 MPa", "Pa", "it") == 100000.0
    assert si_value("276.35 mm", "m", "it") == 0.27635
    assert si_value("7.1 mm", "m", "it") == 0.0071


@pytest.mark.parametrize(
    ("quantity", "unit", "reason"),
    [
        ("30 GPaa", "Pa", "whose unit is unknown. Did you mean GPa"),
        ("20 MPas", "Pa", "symbols have no plural. Write MPa."),
        ("3 Pas", "Pa", "symbols have no plural. Write Pa."),
        ("30 m", "Pa", "whose unit has another dimension"),
        ("30 + 2 GPa", "Pa", "more than one number and a unit. Write the number in one piece"),
        ("30", "Pa", "without a unit. Add the unit"),
        (30, "Pa", "without a unit. Add the unit"),
        (30.5, "Pa", "without a unit. Add the unit"),
        ("GPa", "Pa", "without a number. Add the number"),
        ("", "Pa", "cannot be read"),
        ("(1 Pa", "Pa", "more than one number and a unit"),
        ("1 (Pa", "Pa", "cannot be read"),
        ("1/0 Pa", "Pa", "more than one number and a unit"),
        ("5 1/2 Pa", "Pa", "more than one number and a unit"),
        ("1 000 Pa", "Pa", "more than one number and a unit"),
        ("1_000 Pa", "Pa", "more than one number and a unit"),
        ("1.5.5 Pa", "Pa", "more than one number and a unit"),
        ("--5 Pa", "Pa", "more than one number and a unit"),
        ("5 - 3", "", "more than one number and a unit"),
        ("Pa 5", "Pa", "more than one number and a unit"),
        ("2*3 Pa", "Pa", "more than one number and a unit"),
        ("1,5 Pa", "Pa", "with a comma. Write a decimal point, and nothing between thousands"),
        ("+1,000", "", "with a comma"),
        ("9**9**9**9 Pa", "Pa", "more than one number and a unit"),
        ("1e999999999 Pa", "Pa", "cannot be read"),
        ("20 degC", "Pa", "Received '20 degC'"),
        ("10 m", "", "whose unit has another dimension"),
        ("1" * 101, "Pa", "a text of 101 characters"),
        (True, "", "Received True"),
        (None, "Pa", "Received None"),
        ([1, "Pa"], "Pa", "Received [1, 'Pa']"),
    ],
    ids=lambda v: str(v)[:20],
)
def test_wrong_quantities(quantity, unit, reason):
    with pytest.raises(UnitError) as raised:
        si_value(quantity, unit, "shear_modulus")
    message = str(raised.value)
    assert message.startswith(
        "shear_modulus must be a " + ("quantity in Pa, such as '30 GPa'" if unit else "plain number")
    )
    assert reason in message
    assert "Received" in message
    assert "\n" not in message


@pytest.mark.parametrize("unit", ["Pa", "m", "s", "kg/m^3", "kg/s", "m/s", "m/s^2", "m^2/s", "rad/s", "Pa/s", "1/s"])
def test_the_example_of_a_message_is_a_short_quantity_of_the_unit(unit):
    with pytest.raises(UnitError) as raised:
        si_value(None, unit, "it")
    example = re.search(r"such as '(.*)'\. Received", str(raised.value)).group(1)
    assert 0 < si_value(example, unit, "it") < 1e15
    assert len(example.split()[0]) <= 4


@pytest.mark.parametrize("quantity", ["0.11 Hz", "1 kHz"])
def test_hertz_are_not_silently_radians_per_second(quantity):
    with pytest.raises(
        UnitError, match=r"must be an angular frequency in rad/s\. Received .* Multiply a frequency by 2π"
    ):
        si_value(quantity, "rad/s", "frequency")


USUAL = [(unit, each) for unit, sizes in units._PLAIN.items() for each in sizes]
NUMBERS = [
    "0",
    "-0",
    "30",
    "5E-3",
    "-2.7",
    "+3",
    "0.1",
    "1e400",
    "1e-400",
    "3.14159265358979323846264338327950288",
    "1e22",
]


@pytest.mark.parametrize(("unit", "written"), USUAL)
def test_pint_says_the_same_of_usual_units(unit, written, monkeypatch):
    texts = [f"{number} {written}".strip() for number in NUMBERS]
    assert all(units._plain(text, unit) is not None for text in texts)
    usual = [si_value(text, unit, "it") for text in texts]
    monkeypatch.setattr(units, "_PLAIN", {})
    assert list(map(repr, usual)) == [repr(si_value(text, unit, "it")) for text in texts]


def test_every_unit_that_pint_knows_may_be_one():
    known = units._registry()
    names = [name for name in known._units if name.isascii() and name.isalpha()]
    prefixes = [name for name in known._prefixes if name.isascii() and name.isalpha()]
    assert len(names) > 400
    assert len(prefixes) > 40
    assert not [name for name in names if units._is_unknown_unit(name) or units._is_unknown_unit(f"{name}s")]
    assert not [
        name for name in prefixes if units._is_unknown_unit(f"{name}m") or units._is_unknown_unit(f"{name}pascals")
    ]


@pytest.mark.parametrize("word", ["x", "GPaa", "kpa", "secnds", "metters", "xs"])
def test_what_is_no_unit_is_told_as_pint_tells_it(word, monkeypatch):
    assert units._is_unknown_unit(word)
    said = []
    for words in (units._words_of_units, frozenset):
        monkeypatch.setattr(units, "_words_of_units", words)
        with pytest.raises(UnitError) as raised:
            si_value(f"3{word}", "s", "step")
        said.append(str(raised.value))
    assert said[0] == said[1]
    assert "whose unit is unknown" in said[0]


FRESH = """
import sys
from quakedesign.fault.units import si_value
try:
    si_value("3x", "s", "step")
except ValueError:
    print("pint" in sys.modules)
"""


def test_a_unit_that_is_none_is_refused_without_waiting_for_pint():
    said = subprocess.run([sys.executable, "-c", FRESH], capture_output=True, text=True, check=True)
    assert said.stdout == "False\n"
