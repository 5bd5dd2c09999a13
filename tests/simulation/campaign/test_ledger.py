"""The folder binds its campaign, and loses nothing that was written."""

import json
import math
import os

import numpy as np
import pytest

from quakedesign.errors import OutputError, SimulationError
from quakedesign.files import FAMILY, PREFIX
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing import Transducer
from quakedesign.simulation.campaign.ledger import Ledger, differences, plain

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
    with pytest.raises(SimulationError, match=r"differs in controller\.gains\.k2, seed"):
        Ledger.open(tmp_path, other)
    assert len(Ledger.open(tmp_path, INPUTS).read()) == 2
    assert not Ledger.open(tmp_path, other, renew=True).read()


def test_other_files_are_not_touched(tmp_path):
    (tmp_path / "thesis.txt").write_text("years")
    for renew in (False, True):
        with pytest.raises(OutputError, match=r"holds thesis\.txt"):
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
    with pytest.raises(SimulationError, match="differs in everything"):
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
