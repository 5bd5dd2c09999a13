"""Forged files about uncertain plants: every number, key and type changed; both checkers decide alike."""

import copy
import json
import re
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path
from time import process_time

import pytest
from standalone_guarantee import CHECK
from thinned import few, some_or_all, spread

from quakedesign.errors import CertificateError
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, read_guarantee

PATH = Path(__file__).parents[2] / "proofs" / "certificates" / "uncertain_plant_pendulum.json"
STORED = json.loads(PATH.read_text())
BROKEN = (
    *(None, 1, True, [], {}, ["1"], "", "1.0", "1e3", " 1", "+1", "-0", "2/4", "1/0", "nan", "1/" + "7" * 70000),
    "9" * 70000,
)  # none of them writes a number as FORMAT.md does
FREE = [("disturbances",), ("loads",)]  # of any number


def package(document):
    """The exact entries of a proved file as the package reads it; None where it is not proved or not read."""
    try:
        claim = read_guarantee(json.loads(json.dumps(document)))
    except CertificateError:
        return None
    return guarantee_document(claim) if str(claim.check()) == "proved" else None


def standalone(document):
    try:
        return CHECK.check(json.dumps(document)).statement
    except CHECK.Refused:
        return None


def nodes(value, way=()):
    if way:
        yield way, value
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in inside:
        yield from nodes(entry, (*way, key))


def edited(way, *new):
    """The stored file with an entry replaced, or left out."""
    document = copy.deepcopy(STORED)
    holder = document
    for key in way[:-1]:
        holder = holder[key]
    if new:
        holder[way[-1]] = new[0]
    else:
        del holder[way[-1]]
    return document


def leaves():
    return [(way, value) for way, value in nodes(STORED) if isinstance(value, str | int)]


def test_the_stored_file_is_proved_by_both():
    assert package(STORED) == STORED
    assert standalone(STORED) is not None


@some_or_all
def test_a_file_with_another_number_is_decided_alike_and_says_so(most):
    said = standalone(STORED)
    numbers = [(way, F(value)) for way, value in leaves() if way[0] not in ("format", "kind", "pieces")]
    tries = [(way, new) for way, v in numbers for new in (v + F(1, 997), -v or F(-1), v * F(99, 100) or F(1, 1000))]
    for way, new in spread(tries, most and 3):
        document = edited(way, str(new))
        ours, theirs = package(document), standalone(document)
        assert (ours is None) == (theirs is None), (way, new)
        assert ours != STORED, way
        assert theirs != said, way


@some_or_all
def test_what_is_no_number_or_no_key_is_refused_by_both(most):
    tries = [(way, (new,)) for way, value in leaves() for new in BROKEN if (way, new) != (("format",), 1)]
    tries = [(way, new) for way, new in tries if not (way == ("pieces",) and new == (1,))]
    tries += [(way, ()) for way, _ in nodes(STORED) if way[-1] != "within" and way[-2:-1] not in FREE]
    others = [(way, v) for way, v in nodes(STORED) if not isinstance(v, str) and way[-2:-1] not in FREE]
    tries += [(way, (new,)) for way, v in others for new in (None, "x", [[]], [v, v])]
    for way, new in spread(tries, most and 300):
        document = edited(way, *new)
        with pytest.raises(CertificateError):
            read_guarantee(document)
        with pytest.raises(CHECK.Refused):
            CHECK.check(json.dumps(document))


SWAPPED = [("plant", *pair) for pair in ("AB", "BC", ("noise", "start"), ("A", "outputs"))]
SWAPPED += [("law", *pair) for pair in ("AC", "BD", ("step", "delay"))]


@few(("part", "one", "other"), SWAPPED, every=2)
def test_swapped_matrices_are_decided_alike_and_say_so(part, one, other):
    document = copy.deepcopy(STORED)
    document[part][one], document[part][other] = STORED[part][other], STORED[part][one]
    ours, theirs = package(document), standalone(document)
    assert (ours is None) == (theirs is None)
    assert ours != STORED
    assert theirs != standalone(STORED)


BELOW = [
    (("plant", "noise", 0), "-1/997"),
    (("plant", "start", 0), "-1/997"),
    (("plant", "disturbances", 0, "size"), "-1"),
    (("plant", "loads", 0, "rate"), "-1"),
    (("plant", "loads", 0, "shift"), ["1", "0"]),
    (("inputs", 0), "-1"),
    (("plant", "sectors", 0, "within"), "0"),
    (("plant", "sectors", 1, "within"), "1"),
]


@pytest.mark.parametrize(("way", "value"), BELOW)
def test_negative_sizes_and_measured_shifts_are_refused_by_both(way, value):
    document = edited(way[:-1], {**_holder(way), way[-1]: value}) if way[-1] == "within" else edited(way, value)
    assert package(document) is None
    assert standalone(document) is None


@pytest.mark.parametrize(("key", "value"), [("rate", "-1"), ("shift", ["1", "0"]), ("shift", ["1", "2"])])
def test_the_checker_names_the_rule_of_loads(key, value):
    with pytest.raises(CHECK.Refused, match=re.escape("a load needs rate >= 0 and C*shift = 0")):
        CHECK.check(json.dumps(edited(("plant", "loads", 0, key), value)))
    assert CHECK.beside("guarantee.plant").read_plant(edited(("plant", "loads", 0, "rate"), "0")["plant"]).loads


def _holder(way):
    holder = STORED
    for key in way[:-1]:
        holder = holder[key]
    return holder


def test_a_loop_that_is_not_stable_is_refused_at_once():
    """With the integral's sign turned no power of a period's map is small; the bound of work alone takes minutes."""
    document = edited(("law", "C", 0, 0), "10")
    began = process_time()
    assert package(document) is None
    with pytest.raises(CHECK.Refused, match="must be stable"):
        CHECK.check(json.dumps(document))
    assert process_time() - began < 5


def test_a_load_that_the_law_does_not_hold_is_refused_by_both():
    document = edited(("law", "A"), [["1/2"]])
    with pytest.raises(CertificateError, match="balance every load"):
        read_guarantee(document)
    with pytest.raises(CHECK.Refused, match=re.escape("balance every load")):
        CHECK.check(json.dumps(document))


WIDE = {"A": [["0"] * 49] * 49, "B": [["0"] * 2] * 49, "C": [["0"] * 49]}
"""A law of 49 states that fits the plant."""


@pytest.mark.parametrize(
    ("way", "value", "said"),
    [
        (("plant", "loads", 0, "shift"), ["1", "0"], "a shift that is not measured"),
        (("plant", "loads", 0, "rate"), "-1", "a rate of 0 or more"),
        (("plant", "loads", 0, "more"), "1", "plant.loads.0.*is an unknown key"),
        (("plant", "B"), [["0", "1"], ["1"]], "rows and columns of a plant must fit"),
        (("plant", "B"), [[], []], "1 to 40 controls"),
        (("plant", "A", 1), ["1"], "rows and columns of a plant must fit"),
        (("plant", "sectors", 0, "within"), "0", "a bound of a sector must be positive"),
        (("plant", "sectors", 0, "slopes"), ["1", "0"], "slopes must be in order"),
        (("plant", "sectors", 0, "row"), ["1", "0", "1"], "a sector with a bound must depend on the states alone"),
        *(
            (("plant", name), STORED["plant"][name][:1] * 41, f"{name} must have at most 40 entries")
            for name in ("C", "disturbances", "loads", "sectors", "outputs")
        ),
        (("law",), {**STORED["law"], **WIDE}, "a law must have at most 48 states"),
    ],
)
def test_the_package_names_the_rule_that_a_file_breaks(way, value, said):
    document = copy.deepcopy(STORED)
    holder = document
    for key in way[:-1]:
        holder = holder[key]
    holder[way[-1]] = value
    with pytest.raises(CertificateError, match=said):
        read_guarantee(document)
    with pytest.raises(CHECK.Refused):
        CHECK.check(json.dumps(document))


def test_a_load_that_does_not_move_is_read_and_one_negative_number_closes_nothing():
    still = read_guarantee(edited(("plant", "loads", 0, "rate"), "0"))
    assert still.part.loads[0].rate == 0
    mixed = replace(still, inputs=(F(-1), *still.inputs[1:]))
    assert str(mixed.check()) == "undecided"
