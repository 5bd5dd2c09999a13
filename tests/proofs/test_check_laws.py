"""Certificates of the laws themselves, with roots, nested powers and settling times, by the stand-alone checker."""

import importlib.util
import json
import random
import re
import time
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.lyapunov import certificate_text, load_certificate
from quakedesign.lyapunov.search.lyapunov_search import balance, with_largest_decay

PATH = Path(__file__).parents[2] / "proofs" / "check.py"
SPECIFICATION = importlib.util.spec_from_file_location("laws_check", PATH)
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)

NUMBER = re.compile(r'(?<=")-?\d+(?:/\d+)?(?=")|(?<=[\[,:])\d+(?=[\],}])')


def settling():
    certificate = qd.certify("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "57/40"))[1]
    return with_largest_decay(certificate, balance(certificate.loop))


def two_lifts():
    return qd.certify("dia", ("1", "20", "1", "1/10"), lipschitz="0.3")[1]


def irrational_root():
    return qd.certify("dia", (2, 5, "1.44e-4", 0), lipschitz="1.3968e-4")[1]


def root_in_a_sign():
    return load_certificate(PATH.parent / "certificates" / "dia_2_5_1_0.1.json")


MAKERS = {
    "settling": settling, "two lifts": two_lifts, "irrational root": irrational_root, "root in a sign": root_in_a_sign,
}  # fmt: skip


@pytest.fixture(scope="module", params=MAKERS)
def text(request):
    return certificate_text(MAKERS[request.param]())


@pytest.mark.slow
def test_real_files_are_proved_within_seconds(text):
    start = time.process_time()
    assert checker.check(text).verdict == "proved"
    assert time.process_time() - start < 5


@pytest.mark.slow
def test_a_changed_number_of_a_real_file_is_refused_or_visible(text):
    """All numbers before the witnesses (in turn doubled, negated and zero), and a sample of those in them."""
    statement, generator, start = checker.check(text).statement, random.Random(3), text.index('"witnesses"')
    places = list(NUMBER.finditer(text))
    chosen = [place for place in places if place.start() < start]
    chosen += generator.sample(places[len(chosen) :], 40)
    for index, place in enumerate(chosen):
        other = (f"1{place[0].lstrip('-')}", f"-{place[0]}".replace("--", ""), "0")[index % 3]
        changed = text[: place.start()] + other + text[place.end() :]
        if other == place[0]:
            continue
        try:
            result = checker.check(changed)
        except checker.Refused:
            continue
        assert place.start() < start
        assert result.statement != statement


@pytest.mark.slow
def test_no_witness_can_be_left_out(text):
    document, generator = json.loads(text), random.Random(4)
    for index in generator.sample(range(len(document["witnesses"])), 8):
        rest = document["witnesses"][:index] + document["witnesses"][index + 1 :]
        with pytest.raises(checker.Refused, match="witness"):
            checker.check(json.dumps(document | {"witnesses": rest}))
