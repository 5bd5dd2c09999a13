"""Laws from outside the package: the same call, the same checkers."""

import importlib.util
import json
from dataclasses import dataclass, replace
from fractions import Fraction as F
from pathlib import Path
from typing import ClassVar

import pytest
import sympy as sp

from quakedesign.errors import CertificateError, ParameterError, UnknownNameError
from quakedesign.laws import LoopField, law, laws
from quakedesign.laws.sliding_mode import IntegratorChain
from quakedesign.lyapunov import Verdict, certificate_text, load_certificate, parse_certificate
from quakedesign.lyapunov.search.certify import certify
from quakedesign.symbolic import SignedPower

PATH = Path(__file__).parents[3] / "proofs" / "check.py"
SPECIFICATION = importlib.util.spec_from_file_location("user_law_check", PATH)
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)

e1, e2, e3, l1, l2, l3, d = sp.symbols("e1 e2 e3 l1 l2 l3 d", real=True)
DIFFERENTIATOR = LoopField(
    states={e1: 3, e2: 2, e3: 1},
    field={
        e1: -l1 * SignedPower(e1, sp.Rational(2, 3)) + e2,
        e2: -l2 * SignedPower(e1, sp.Rational(1, 3)) + e3,
        e3: -l3 * SignedPower(e1, 0) + d,
    },
    gains=(l1, l2, l3),
    constants=(),
    uncertain=(d,),
    domain="cells",
)


@dataclass(frozen=True, kw_only=True)
class Leaky(IntegratorChain):
    """Super-twisting whose integral also feeds on ξ's own sign; a law that the package does not have."""

    name = "leaky"
    title = "leaky super-twisting"
    source = "made up for this test"
    gain_units: ClassVar[dict] = {"a": "m^(1/2)/s^(3/2)", "b": "m/s^3"}
    order = 1

    @staticmethod
    def virtual_control(errors, gains):
        return -gains[0] * SignedPower(errors[0], sp.Rational(1, 2))

    @staticmethod
    def integral_rate(errors, gains):
        return -gains[1] * SignedPower(errors[0], 0)

    @classmethod
    def loop_field(cls):
        found = super().loop_field()
        last = list(found.states)[-1]
        return replace(found, field=found.field | {last: found.field[last] - SignedPower(last, 0) / 10})


@pytest.fixture(scope="module")
def differentiator():
    # λ = (1.1, 1.5, 2) for L = 1, Levant (2005), Homogeneity approach to HOSM design, Automatica 41;
    # not recursive: l1 = 2, l2 = 1.5·√2, l3 = 1.1
    verdict, certificate = certify(DIFFERENTIATOR, ("2", "2.12", "1.1"), lipschitz=1)
    assert verdict is Verdict.PROVED
    return certificate


@pytest.fixture(scope="module")
def leaky():
    verdict, certificate = certify(Leaky, ("1.5", "1.3"), lipschitz=1, gain_range=(1, "1.1"))
    assert verdict is Verdict.PROVED
    return certificate


def test_the_second_order_differentiator_is_proved_from_a_bare_loop(differentiator):
    assert differentiator.loop.law == "custom"
    assert differentiator.check(DIFFERENTIATOR) is Verdict.PROVED
    assert differentiator.loop.uncertain == {"d": (F(-1), F(1))}


def test_a_class_of_the_users_own_is_proved(leaky):
    assert leaky.loop.law == "leaky"
    assert "leaky" not in laws()
    assert leaky.check(Leaky) is Verdict.PROVED
    assert leaky.check(Leaky.loop_field()) is Verdict.PROVED


def test_files_about_them_pass_both_checkers(differentiator, leaky, tmp_path):
    for certificate, subject in ((differentiator, DIFFERENTIATOR), (leaky, Leaky)):
        path = tmp_path / f"{certificate.loop.law}.json"
        certificate.save(path)
        again = load_certificate(path)
        assert again == certificate
        assert again.check(subject) is Verdict.PROVED
        assert checker.check(path.read_text(encoding="utf-8")).verdict == "proved"


def test_without_the_law_the_field_cannot_be_vouched_for(differentiator, leaky):
    for certificate in (differentiator, leaky):
        with pytest.raises(CertificateError, match=r"not in the package.*Pass its class or its LoopField"):
            certificate.check()


def test_another_law_is_refused(differentiator, leaky):
    with pytest.raises(CertificateError, match="is about 'leaky', not 'super-twisting'"):
        leaky.check(law("super-twisting"))
    with pytest.raises(CertificateError, match="is about 'leaky', not 'cta'"):
        leaky.check("cta")
    with pytest.raises(
        CertificateError, match="the names of gains, constants or uncertain parameters differ from those"
    ):
        leaky.check(law("super-twisting").loop_field())
    other = replace(DIFFERENTIATOR, field=DIFFERENTIATOR.field | {e2: 2 * DIFFERENTIATOR.field[e2]})
    with pytest.raises(CertificateError, match="the field in the certificate differs from that of"):
        differentiator.check(other)


def test_a_name_of_the_package_stands_for_its_own_field_only(leaky):
    borrowed = replace(leaky, loop=replace(leaky.loop, law="super-twisting"))
    with pytest.raises(CertificateError, match="differ from those of super-twisting"):
        borrowed.check()


def test_a_changed_gain_loses_the_proof_of_a_users_law(differentiator):
    gains = dict(differentiator.loop.gains) | {"l2": differentiator.loop.gains["l2"] + F(1, 1000)}
    with pytest.raises(CertificateError, match="does not prove"):
        replace(differentiator, loop=replace(differentiator.loop, gains=gains)).check(DIFFERENTIATOR)


def test_a_suggested_counterexample_is_checked_against_the_users_own_field():
    # a constant d holds ξ of the leaky law only from b + 1/10 on, that of super-twisting from b on
    assert certify("super-twisting", ("1.5", "0.9"), lipschitz="0.95")[0] is Verdict.REFUTED
    assert certify(Leaky, ("1.5", "0.9"), lipschitz="0.95")[0] is Verdict.PROVED
    assert certify(Leaky, ("1.5", "0.9"), lipschitz="1.0")[0] is Verdict.UNDECIDED


@pytest.mark.slow
def test_the_order_in_which_rates_are_written_does_not_matter():
    turned = replace(DIFFERENTIATOR, field=dict(reversed(DIFFERENTIATOR.field.items())))
    found = certify(turned, ("2", "2.12", "1.1"), lipschitz=1)[1]
    assert found.check(DIFFERENTIATOR) is Verdict.PROVED


x, k, root = sp.symbols("x k root", real=True)
PLAIN = LoopField(
    states={x: 1}, field={x: -k * SignedPower(x, 0) + d}, gains=(k,), constants=(), uncertain=(d,), domain="cells"
)


def test_a_function_that_stands_still_proves_nothing():
    assert certify(PLAIN, (1,), lipschitz="0.9")[0] is Verdict.PROVED
    assert certify(PLAIN, (1,), lipschitz=1)[0] is Verdict.UNDECIDED


def test_neither_checker_takes_a_root_of_zero():
    # FORMAT.md: the positive square root of a positive number
    loop = replace(PLAIN, field={x: -2 * SignedPower(x, 0) + root * d}, roots={root: k})
    text = certificate_text(certify(loop, (1,), lipschitz=1)[1])
    raw = json.loads(text)
    raw["gains"]["k"], raw["roots"]["root"] = "0", ["k", "0", "1"]
    with pytest.raises(CertificateError, match="does not contain the root of k"):
        parse_certificate(json.dumps(raw)).check(loop)
    with pytest.raises(checker.Refused, match="the root of a positive number"):
        checker.check(json.dumps(raw))


def test_a_number_that_a_declaration_excludes_is_refused():
    sure = sp.Symbol("k", positive=True)
    loop = replace(PLAIN, field={x: -sp.sqrt(sure**2) * SignedPower(x, 0) + d}, gains=(sure,))
    assert certify(loop, (2,), lipschitz=1)[0] is Verdict.PROVED
    with pytest.raises(ParameterError, match=r"k must be not .*, as declared in the loop.* the value -2"):
        certify(loop, (-2,), lipschitz=1)


def test_a_declaration_that_only_the_ends_of_a_range_meet_is_refused():
    whole = sp.Symbol("d", integer=True)
    rate = -2 * k * SignedPower(x, 0) + whole + 100 * sp.sin(sp.pi * whole) * SignedPower(x, 0)
    with pytest.raises(ParameterError, match="d must be integer, as declared"):
        certify(replace(PLAIN, field={x: rate}, uncertain=(whole,)), (1,), lipschitz=1)


def test_a_root_that_is_declared_negative_is_refused():
    below = sp.Symbol("r", negative=True)
    with pytest.raises(ParameterError, match="r must be extended_negative"):
        certify(replace(PLAIN, field={x: 2 * sp.sign(below * x) + d}, roots={below: k}), (4,), lipschitz=1)


def test_signs_that_say_the_same_are_named():
    with pytest.raises(CertificateError, match=r"that of a state\. Use"):
        certify(replace(PLAIN, field={x: -2 * sp.sign(k * x) + d}), (3,), lipschitz=1)


@pytest.mark.parametrize(
    ("rate", "error", "message"),
    [
        (-k * x + d, ParameterError, "homogeneous in the weights .* Received degree 0 of .* and -1 of"),
        (-k * SignedPower(x + d * SignedPower(x, 0), 0), ParameterError, "homogeneous .* in a nested power"),
        (-k * SignedPower(x, 0) + d**2, CertificateError, "not affine in d"),
        (-sp.sqrt(2) * k * SignedPower(x, 0) + d, CertificateError, "Received the factor sqrt"),
    ],
)
def test_loops_beyond_the_format_are_refused_with_the_reason(rate, error, message):
    with pytest.raises(error, match=message):
        certify(replace(PLAIN, field={x: rate}), (1,), lipschitz="0.5")


@pytest.mark.slow
def test_what_the_largest_range_holds_is_proved_when_asked_for_directly():
    assert certify("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, 334))[0] is Verdict.PROVED


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: certify(DIFFERENTIATOR, (1, 2), lipschitz=1), ParameterError, r"needs 3 gains \(l1, l2, l3\).*2\."),
        (lambda: certify(DIFFERENTIATOR, (1, 2, "x"), lipschitz=1), ParameterError, "gain l3 must be a finite number"),
        (lambda: certify(Leaky, (1, 2, 3), lipschitz=1), ParameterError, r"leaky needs 2 gains \(a, b\)"),
        (lambda: certify("pid", (1,), lipschitz=1), UnknownNameError, "controller must be one of .*super-twisting"),
        (lambda: certify("elqr", (1, 1, 1, 1), lipschitz=1), ParameterError, "requires a sliding-mode law.*'elqr'"),
        (lambda: certify("cta", (1, 1, 1, 1), lipschitz=-1), ParameterError, "must not be negative"),
        (lambda: certify("cta", (1,) * 4, lipschitz=1, gain_range=(2, 1)), ParameterError, "0 < b_m <= b_M"),
    ],
)
def test_bad_input_gets_one_clear_message(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_the_text_of_a_users_certificate_names_no_code(leaky):
    assert set(json.loads(certificate_text(leaky))["gains"]) == {"a", "b"}
