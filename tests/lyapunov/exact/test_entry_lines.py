"""Lines with the entries of a guarantee file, written out by hand."""

import pytest
from standalone_guarantee import CHECK

from quakedesign.errors import CertificateError
from quakedesign.lyapunov.exact.certificate_files import entry_lines, read_json

CLAIMS = {"claims": {"least_pressure": "-1/3", "slip_error": "1/3"}}


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (["1"] * 64, f"[{', '.join(['1'] * 64)}]"),
        (["1"] * 65, "(65 entries)"),
        ([[]] * 64, f"[{', '.join(['[]'] * 64)}]"),
        ([[]] * 65, "(65 entries)"),
        ([["1", "2"]] * 32, f"[{', '.join(['[1, 2]'] * 32)}]"),
        ([["1", "2"]] * 33, "(66 entries)"),
        ([{"a": "1", "b": "2"}] * 33, "(66 entries)"),
        ("1/" + "3" * 21 + "7", "1/" + "3" * 21 + "7"),  # 24 characters
        ("1/" + "3" * 22 + "7", "~3.00000e-23"),
        ("-1/4", "-0.25"),
        ("1/3", "1/3"),
        ("slip", "slip"),
        (7, "7"),
        ({"b": "1", "a": "1/2"}, "a 0.5, b 1"),
        ({"b": {"d": "2", "c": "1"}, "a": "3"}, "a 3; b c 1, d 2"),
        ({"b": {"c": {"d": "4"}}}, "b c d 4"),
        ([{"a": "1"}, "2"], "[{a 1}, 2]"),
        ({"name": "any", "a": "1"}, "a 1"),
    ],
)
def test_every_part_has_a_line(part, said):
    document = {"format": 1, "kind": "any", "part": part} | CLAIMS
    head, line, claims, digest = entry_lines(document)
    assert line == f"part: {said}"
    assert claims == "claims: least_pressure -0.333334, slip_error 0.333334"
    assert head.startswith("entries in SI units")
    assert digest.startswith("SHA-256 of the entries without claims: ")
    assert CHECK.beside("guarantee.reading").entries(document) == [head, line, claims, digest]


def test_a_file_with_a_byte_order_mark_is_rejected(tmp_path):
    path = tmp_path / "marked.json"
    path.write_bytes(b"\xef\xbb\xbf{}")
    with pytest.raises(CertificateError):
        read_json(path)
    path.write_bytes(b"{}")
    assert read_json(path) == {}
