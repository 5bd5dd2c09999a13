"""Which claim a file makes, by what it says of itself or by its keys."""

import pytest

from quakedesign.lyapunov.exact.certificate_files import ATTRACTION, GUARANTEE, LOOP, POLYNOMIAL, SLOW_SLIDING, kind_of


@pytest.mark.parametrize("kind", [GUARANTEE, SLOW_SLIDING, ATTRACTION])
def test_a_file_may_say_its_kind(kind):
    assert kind_of({"kind": kind}) == kind_of({"kind": kind, "polynomial": {}}) == kind


def test_files_about_polynomials_are_told_by_their_key():
    assert kind_of({"polynomial": {}}) == POLYNOMIAL


@pytest.mark.parametrize("raw", [{"V": []}, {"kind": "proof"}, {"kind": []}, {}, [], ["polynomial"], "guarantee", None])
def test_all_else_is_read_as_a_claim_about_a_closed_loop(raw):
    assert kind_of(raw) == LOOP
