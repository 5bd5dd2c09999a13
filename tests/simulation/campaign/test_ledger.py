"""The folder binds its campaign, and loses nothing that was written."""

import hashlib
import json
import math
import os
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from quakedesign.errors import OutputError, SimulationError
from quakedesign.files import FAMILY, PREFIX
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing import Transducer
from quakedesign.simulation.campaign.ledger import Ledger, _listed, differences, plain

INPUTS = {"seed": 1, "controller": {"gains": {"k1": "7"}}}


def filled(folder):
    ledger = Ledger.open(folder, INPUTS)
    starts, ends = np.array([[0.0, -math.inf], [1.0, math.inf]]), np.array([[2.0, 0.1], [math.nan, 3.0]])
    ledger.add(starts, ends)
    return ledger, starts, ends


def test_bits_come_back(tmp_path):
    ledger, starts, ends = filled(tmp_path / "new" / "one")
    found = Ledger.open(tmp_path / "new" / "one", INPUTS).read()
    assert [found[start.tobytes()].tobytes() for start in starts] == [end.tobytes() for end in ends]
    assert ledger.read().keys() == found.keys()


def test_another_campaign_is_refused_by_name(tmp_path):
    filled(tmp_path)
    other = {"seed": 2, "controller": {"gains": {"k1": "7", "k2": "5"}}}
    with pytest.raises(SimulationError, match=r"These differ: controller\.gains\.k2, seed"):
        Ledger.open(tmp_path, other)
    assert len(Ledger.open(tmp_path, INPUTS).read()) == 2
    assert not Ledger.open(tmp_path, other, renew=True).read()


def test_other_files_are_not_touched(tmp_path):
    (tmp_path / "thesis.txt").write_text("years")
    for renew in (False, True):
        with pytest.raises(OutputError, match=r"contains thesis\.txt"):
            Ledger.open(tmp_path, INPUTS, renew=renew)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_campaign_killed_while_it_wrote_its_manifest_goes_on(tmp_path):
    (tmp_path / "batches").mkdir()
    for prefix in (PREFIX, f"{FAMILY}another-machine-"):
        (tmp_path / f"{prefix}x7").mkdir()
        (tmp_path / f"{prefix}x7" / "new").write_text('{"se')
    assert not Ledger.open(tmp_path, INPUTS).read()
    assert {path.name for path in tmp_path.iterdir()} == {"batches", "campaign.json", f"{FAMILY}another-machine-x7"}


def test_force_leaves_what_is_not_of_a_campaign(tmp_path):
    filled(tmp_path)
    for name in ("results.json", "sample-3.nc", "notes.txt"):
        (tmp_path / name).write_text("")
    assert not Ledger.open(tmp_path, {"seed": 2}, renew=True).read()
    assert {path.name for path in tmp_path.iterdir()} == {"batches", "campaign.json", "notes.txt"}


def test_force_does_not_delete_the_same_campaign(tmp_path):
    filled(tmp_path)
    assert len(Ledger.open(tmp_path, INPUTS, renew=True).read()) == 2


def test_a_manifest_that_is_none(tmp_path):
    (tmp_path / "campaign.json").write_text("[1")
    with pytest.raises(SimulationError, match="These differ: everything"):
        Ledger.open(tmp_path, INPUTS)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04broken", b"\x80"])
def test_a_file_that_is_not_whole_is_passed_over(tmp_path, content):
    ledger, _, _ = filled(tmp_path)
    (tmp_path / "batches" / "0.npz").write_bytes(content)
    assert len(ledger.read()) == 2


def test_a_batch_of_another_campaign_is_refused(tmp_path):
    filled(tmp_path / "one")
    other = Ledger.open(tmp_path / "other", {"seed": 2})
    (batch,) = (tmp_path / "one" / "batches").iterdir()
    os.rename(batch, tmp_path / "other" / "batches" / "0.npz")
    with pytest.raises(SimulationError, match="must be a batch of this campaign"):
        other.read()


def test_plain_values_are_json_and_never_an_address():
    value = {"sensor": Transducer(bandwidth=math.inf), "scheme": simulation_scheme("continuous"), "kind": dict}
    text = json.dumps(plain(value), allow_nan=False)
    assert json.loads(text)["sensor"]["type"] == "Transducer"
    assert "0x" not in text


def test_differences_are_named_with_dots():
    assert differences({"a": {"b": 1}, "c": 2}, {"a": {"b": 2}, "d": 3}) == ["a.b", "c", "d"]
    assert differences({"a": [1, 2]}, {"a": [1, 2]}) == []


def test_a_batch_with_any_byte_changed_is_whole_or_passed_over(tmp_path):
    """Flags of encryption and methods of compression among them, whose errors are no errors of files."""
    ledger, starts, ends = filled(tmp_path)
    (path,) = (tmp_path / "batches").iterdir()
    content = path.read_bytes()
    whole = {start.tobytes(): end.tobytes() for start, end in zip(starts, ends, strict=True)}
    kept = 0
    for at in range(len(content)):
        path.write_bytes(content[:at] + bytes([content[at] ^ (0x01, 0x80, 0xFF)[at % 3]]) + content[at + 1 :])
        found = {start: end.tobytes() for start, end in ledger.read().items()}
        assert found in ({}, whole)
        kept += bool(found)
    assert 0 < kept < len(content)


@dataclass(frozen=True)
class Part:
    """A value with a number that does not matter."""

    size: float
    cost: int = field(default=0, compare=False)


class Silent:
    """A value without a text."""


class Spoken:
    """A value with a text."""

    def __repr__(self):
        return "spoken"


class Told:
    """A value with a text for people alone."""

    def __str__(self):
        return "told"


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (Told(), "told"),
        (Part(math.inf, 5), {"type": "Part", "size": "inf"}),
        (Part, "Part"),
        ({1: Part(2.0)}, {"1": {"type": "Part", "size": 2.0}}),
        ([1, (2.5, -math.inf)], [1, [2.5, "-inf"]]),
        (math.nan, "nan"),
        (Fraction(1, 3), "1/3"),
        (Silent(), "Silent"),
        (Silent, "Silent"),
        (Spoken(), "spoken"),
        *((value, value) for value in (None, True, 3, 2.5, "text")),
    ],
    ids=lambda value: type(value).__name__,
)
def test_every_value_has_a_plain_one(value, told):
    found = plain(value)
    assert found == told
    assert type(found) is type(told)


def test_differences_name_what_one_of_the_two_has_alone():
    assert differences({"a": {"b": 1, "c": 2}}, {"a": {"b": 1}}) == ["a.c"]
    assert differences({"a": {}}, {"a": {"b": {"c": 1}}}) == ["a.b"]
    assert differences({"a": {"b": 1}}, {"a": 1}) == ["a"]
    assert differences([1], {"a": 1}) == [""]
    assert differences({"a": 1}, {"a": 1}) == []


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ([""], "everything"),
        (["arithmetic"], "arithmetic"),
        (["seed", "arithmetic"], "seed"),
        (list("abcde"), "a, b, c, d, e"),
        (list("abcdef"), "a, b, c, d, e and more"),
    ],
)
def test_five_differences_are_told(names, told):
    assert _listed(names) == told


def test_a_campaign_is_known_by_its_inputs_in_any_order(tmp_path):
    text = '{\n "b": [\n  1\n ],\n "seed": 2\n}'
    for inputs in ({"seed": 2, "b": [1]}, {"b": [1], "seed": 2}):
        ledger = Ledger.open(tmp_path, inputs)
        assert ledger.fingerprint == hashlib.sha256(text.encode()).hexdigest()
        assert (tmp_path / "campaign.json").read_text() == text + "\n"
    with pytest.raises(ValueError, match="not JSON compliant"):
        Ledger.open(tmp_path / "other", {"seed": math.nan})
    assert not (tmp_path / "other").exists()


def test_what_killed_writers_left_goes_from_the_folder_and_from_its_batches(tmp_path):
    Ledger.open(tmp_path, INPUTS)
    for place in (tmp_path, tmp_path / "batches"):
        (place / f"{PREFIX}dead").mkdir()
    Ledger.open(tmp_path, INPUTS)
    assert {path.name for path in tmp_path.rglob("*")} == {"batches", "campaign.json"}


@pytest.mark.parametrize(
    ("place", "said"),
    [("file", "file must be a folder: Not a directory"), ("file/below", "below cannot be written: Not a directory")],
)
def test_a_place_that_is_no_folder(tmp_path, place, said):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=said):
        Ledger.open(tmp_path / place, INPUTS)


def test_batches_have_the_name_of_their_starts(tmp_path):
    ledger, starts, ends = filled(tmp_path)
    ledger.add(starts, ends)
    (first,) = (tmp_path / "batches").iterdir()
    assert first.name == hashlib.sha256(starts.tobytes()).hexdigest()[:16] + ".npz"
    ledger.add(starts[:1], ends[:1])
    assert len(list((tmp_path / "batches").iterdir())) == 2
    assert len(ledger.read()) == 2


def test_hidden_files_are_no_batches_and_no_file_runs_code(tmp_path):
    ledger, *_ = filled(tmp_path)
    (batch,) = (tmp_path / "batches").iterdir()
    batch.rename(batch.with_name("." + batch.name))
    assert ledger.read() == {}
    objects = np.array([[Part(1.0)]], dtype=object)
    np.savez(tmp_path / "batches" / "a.npz", fingerprint=np.array(ledger.fingerprint), starts=objects, ends=objects)
    assert ledger.read() == {}


def test_force_goes_on_where_something_is_gone_already(tmp_path, monkeypatch):
    filled(tmp_path)
    for path in (tmp_path / "batches").iterdir():
        path.unlink()
    (tmp_path / "batches").rmdir()
    with monkeypatch.context() as patch:
        own = Path.glob
        gone = {"results.json": [tmp_path / "gone"]}
        patch.setattr(Path, "glob", lambda folder, pattern: [*own(folder, pattern), *gone.get(pattern, ())])
        Ledger.open(tmp_path, {"seed": 2}, renew=True)
    assert {path.name for path in tmp_path.iterdir()} == {"batches", "campaign.json"}
