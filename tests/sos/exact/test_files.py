import json
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign import sos
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.files import load, text
from quakedesign.sos.exact.proofs import holds

QUESTIONS = {
    "square": ("(x - y)^2 + y^2", {}),
    "face": ("(x - y)^2", {}),
    "interval": ("x - x^2 + 1", {"on": ("x >= 0", "x <= 1")}),
    "circle": ("2 - x*y", {"on": ("x^2 + y^2 == 1",)}),
    "motzkin": ("x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2", {"multiplier": "1 + x^2 + y^2"}),
    "refuted": ("x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2", {}),
    "negative": ("x^2 - 2*x", {}),
}


@pytest.fixture(scope="module", params=QUESTIONS)
def written(request):
    polynomial, options = QUESTIONS[request.param]
    answer = sos.prove(polynomial, **options)
    return text(answer.statement, answer.proof)


def test_what_is_written_reads_back_and_holds(written):
    statement, proof = load(written)
    assert holds(statement, proof)
    assert text(statement, proof) == written


def leaves(value, path=()):
    if isinstance(value, dict):
        for key in value:
            yield from leaves(value[key], (*path, key))
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            yield from leaves(entry, (*path, i))
    else:
        yield path, value


def replaced(value, path, new):
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], new)
    return copy


def test_changing_any_number_of_the_proof_loses_it(written):
    """A changed value of a functional may stay a proof of the same statement; everything else must break."""
    raw = json.loads(written)
    kind = next(k for k in ("sos", "not-sos", "negative") if k in raw)
    for path, value in leaves(raw[kind]):
        if kind != "sos":
            continue
        new = str(Fraction(value) + 1) if isinstance(value, str) else value + 1
        try:
            statement, proof = load(json.dumps(replaced(raw, (kind, *path), new)))
        except CertificateError:
            continue
        assert not holds(statement, proof), path


def test_pairing_a_proof_with_another_polynomial_loses_it(written):
    raw = json.loads(written)
    if "sos" in raw:
        for key, c in raw["polynomial"].items():
            other = raw | {"polynomial": raw["polynomial"] | {key: str(Fraction(c) + Fraction(1, 7))}}
            statement, proof = load(json.dumps(other))
            assert not holds(statement, proof)


HOSTILE = [
    "",
    "[]",
    "{",
    '{"polynomial": {}}',
    "[" * 100_000,
    '{"polynomial": ' + "9" * 5000 + "}",
    '{"polynomial": NaN}',
    '{"polynomial": 1.5}',
    '{"polynomial": {}, "polynomial": {}}',
]


@pytest.mark.parametrize("hostile", HOSTILE)
def test_hostile_texts_are_refused(hostile):
    with pytest.raises(CertificateError):
        load(hostile)


@given(data=st.data())
def test_truncated_or_mistyped_files_are_refused(data):
    answer = sos.prove("(x - y)^2 + y^2")
    raw = json.loads(text(answer.statement, answer.proof))
    path, _ = data.draw(st.sampled_from(list(leaves(raw))))
    new = data.draw(st.sampled_from([None, True, -1, 10**6, "1/0", "01", "2/4", "", [], {}, 1.5, "x" * 500]))
    try:
        statement, proof = load(json.dumps(replaced(raw, path, new)))
    except CertificateError:
        return
    assert not holds(statement, proof)
