"""Files: what is written is read back; two independent checkers agree; every changed number loses the proof."""

import importlib.util
import json
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import quakedesign as qd
from quakedesign.errors import CertificateError, OutputError
from quakedesign.lyapunov import certificate_text, load_certificate, parse_certificate

CHECKER = Path(__file__).parents[3] / "proofs" / "check.py"


@pytest.fixture(scope="module")
def standalone():
    import sys

    specification = importlib.util.spec_from_file_location("standalone_check", CHECKER)
    module = importlib.util.module_from_spec(specification)
    sys.modules["standalone_check"] = module
    specification.loader.exec_module(module)
    return module


def sliding_mode():
    return qd.certify("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "57/40"))[1]


def linear():
    return qd.design(qd.load_fault("lab-fault"), "elqr", continuous=True).certificate


def refutation():
    return qd.certify("cta", ("7", "5", "2.3", "1.1"), lipschitz="5/4")[1]


@pytest.fixture(scope="module")
def texts():
    return {
        "cta": certificate_text(sliding_mode()),
        "elqr": certificate_text(linear()),
        "no": certificate_text(refutation()),
    }


@pytest.mark.parametrize(("name", "verdict"), [("cta", "proved"), ("elqr", "proved"), ("no", "refuted")])
def test_both_checkers_agree(texts, standalone, name, verdict):
    assert str(parse_certificate(texts[name]).check()) == verdict
    assert standalone.check(texts[name]).verdict == verdict


@pytest.mark.parametrize("name", ["cta", "elqr", "no"])
def test_reading_gives_back_what_was_written(texts, name):
    assert certificate_text(parse_certificate(texts[name])) == texts[name]


def verdicts(text, standalone):
    """Verdict of each checker, with the statement of the standalone one."""
    try:
        mine = str(parse_certificate(text).check())
    except (CertificateError, ArithmeticError):
        mine = "refused"
    try:
        result = standalone.check(text)
    except standalone.Refused:
        return mine, "refused", None
    return mine, result.verdict, result.statement


NUMBER = re.compile(r'(?<=")-?\d+(?:/\d+)?(?=")|(?<=[\[,:])-?\d+(?=[\],}])')


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_changed_number_is_refused_or_a_changed_true_claim(texts, standalone, data):
    text = texts[data.draw(st.sampled_from(sorted(texts)))]
    places = [m for m in NUMBER.finditer(text)]
    place = data.draw(st.sampled_from(places))
    fresh = data.draw(
        st.sampled_from(
            ["0", "1", "2", "-1", "3/7", f"-{place[0]}".replace("--", ""), place[0] + "1", "1" + place[0].lstrip("-")]
        )
    )
    if fresh == place[0]:
        return
    changed = text[: place.start()] + fresh + text[place.end() :]
    mine, other, statement = verdicts(changed, standalone)
    original = standalone.check(text)
    if other != "refused":
        assert statement != original.statement
    if mine != "refused":
        assert other == mine
    if "witnesses" in json.loads(text):
        start = text.index('"witnesses"')
        if place.start() > start:
            assert (mine, other) == ("refused", "refused")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.floats(0, 1), junk=st.sampled_from(["", "}", "[" * 50, '"', "\x00", "NaN", "1e999"]))
def test_truncated_or_garbled_files_are_refused(texts, standalone, cut, junk):
    text = texts["elqr"]
    broken = text[: int(cut * (len(text) - 2))] + junk
    assert verdicts(broken, standalone)[:2] == ("refused", "refused")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"format":1', '"format":1,"format":1'),
        ('"format":1', '"format":2'),
        ('"format":1', '"format":true'),
        ('"format":1', '"format":1.0'),
        ('"format":1', '"format":1,"note":"x"'),
        ('"domain":"cells"', '"domain":"reals"'),
        ('"e1":3', '"e1":4'),
        ('"k3":"23/10"', '"k3":"46/20"'),
        ('"k1":"7"', '"k1":"7/1"'),
        ('"k1":"7"', '"k1":7'),
        ('"k1":"7"', '"k1":"+7"'),
        ('"k1":"7"', '"k1":"' + "7" * 5000 + '"'),
        ('"law":"cta"', '"law":"dia"'),
    ],
)
def test_every_departure_from_the_format_is_refused(texts, standalone, old, new):
    assert old in texts["cta"]
    changed = texts["cta"].replace(old, new, 1)
    mine, other, statement = verdicts(changed, standalone)
    assert mine == "refused"
    if '"law"' not in old:
        assert other == "refused"
    else:  # the standalone checker says that it cannot verify a name, and prints it
        assert statement != standalone.check(texts["cta"]).statement


def test_the_witnesses_of_one_certificate_do_not_serve_another(texts, standalone):
    other = certificate_text(qd.certify("cta", ("13", "7.5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "57/40"))[1])
    first, second = json.loads(texts["cta"]), json.loads(other)
    first["witnesses"] = second["witnesses"]
    assert verdicts(json.dumps(first), standalone)[:2] == ("refused", "refused")


def test_a_missing_file_is_one_clear_message(tmp_path):
    with pytest.raises(CertificateError, match=r"cannot be read.*No such file"):
        load_certificate(tmp_path / "nothing.json")


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    certificate = refutation()
    with pytest.raises(OutputError, match="cannot be written"):
        certificate.save(tmp_path / "no" / "such" / "folder.json")
    certificate.save(tmp_path / "good.json")
    assert load_certificate(tmp_path / "good.json") == certificate
    assert [p.name for p in tmp_path.iterdir()] == ["good.json"]


def test_a_function_with_a_kink_is_refused_even_if_its_terms_cancel(texts, standalone):
    raw = json.loads(texts["cta"])
    raw["V"] += [["1", [], [["e2", "1/2", "s"]]], ["-1", [], [["e2", "1/2", "s"]]]]
    assert verdicts(json.dumps(raw), standalone)[:2] == ("refused", "refused")


def test_a_derivative_once_taken_off_the_kinks_does_not_prove_a_kink(texts):
    from quakedesign.lyapunov.exact.obligations import Obligations
    from quakedesign.symbolic import off_kinks
    from quakedesign.symbolic.term_expressions import from_terms

    raw = json.loads(texts["cta"])
    raw["V"].append(["1/1152921504606846976", [], [["e1", "1", "a"], ["e2", "1", "s"]]])
    certificate = parse_certificate(json.dumps(raw))
    symbols = certificate.loop.symbols
    with off_kinks():
        for state in certificate.loop.states:
            from_terms(certificate.lyapunov, symbols).diff(symbols[state])
    with pytest.raises(CertificateError, match="continuously differentiable"):
        _ = Obligations(certificate.loop, certificate.lyapunov).derivative


def test_a_matrix_with_huge_denominators_is_refused_in_bounded_time(texts, standalone):
    raw = json.loads(texts["cta"])
    size = 12
    entries = [f"1/{10**398 + 2 * i + 1}" for i in range(size * (size + 1) // 2)]
    basis = [[i, 0, 0] for i in range(size)]
    raw["witnesses"][0]["squares"].append({"times": [0, 0, 0], "basis": basis, "gram": entries})
    assert verdicts(json.dumps(raw), standalone)[:2] == ("refused", "refused")


def test_reordered_states_are_refused_by_the_package(texts):
    raw = json.loads(texts["no"])
    raw["states"] = {"e3": 1, "e2": 2, "e1": 3}
    with pytest.raises(CertificateError, match="the field in the certificate differs from that of"):
        parse_certificate(json.dumps(raw)).check()
