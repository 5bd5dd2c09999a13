"""Verdicts on sliding-mode gains: what must be proved, what must not."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
from thinned import few

import quakedesign as qd
from quakedesign.errors import CertificateError, ParameterError, UnknownNameError
from quakedesign.lyapunov import Verdict

GAINS = ("7", "5", "2.3", "1.1")


@pytest.fixture(scope="module")
def proof():
    verdict, certificate = qd.certify("cta", GAINS, lipschitz=1, gain_range=(1, "57/40"))
    assert verdict is Verdict.PROVED
    return certificate


@few("gains", [GAINS, ("13", "7.5", "2.3", "1.1"), ("19", "10", "2.3", "1.1"), ("25", "15", "2.3", "1.1")], every=3)
def test_the_published_sets_are_proved_for_unit_lipschitz_bound(gains):
    # Torres-González et al. (2017) give these four sets for L = 1 and a known coefficient
    verdict, certificate = qd.certify("cta", gains, lipschitz=1)
    assert verdict is Verdict.PROVED
    assert certificate.check() is Verdict.PROVED


@pytest.mark.parametrize("lipschitz", ["1.2", "1.25", "3"])
def test_from_k3_minus_k4_on_the_gains_are_refuted(lipschitz):
    # ERRATA, end: k3 − |k4| = 1.2 must exceed L̄, equality fails too
    verdict, certificate = qd.certify("cta", GAINS, lipschitz=lipschitz)
    assert verdict is Verdict.REFUTED
    assert certificate.refutation.point == {"e1": F(1), "e2": F(0), "e3": F(7)}


def test_equal_k3_and_k4_are_refuted_even_without_disturbance():
    # ERRATA, end: a continuum of Filippov equilibria
    assert qd.certify("cta", (7, 5, 1, 1), lipschitz=0)[0] is Verdict.REFUTED


@pytest.mark.slow
@pytest.mark.parametrize(
    "gains", [(0, 0, 0, 0), (-7, -5, "-2.3", "-1.1"), ("1e-300", 1, 1, 0), ("1e30", "1e-30", 2, 1), (1, "0.01", 2, 1)]
)
def test_gains_without_a_certificate_are_an_answer_not_an_error(gains):
    assert qd.certify("cta", gains, lipschitz="0.1")[0] in (Verdict.UNDECIDED, Verdict.REFUTED)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gains", "lipschitz"),
    [
        (("1", "20", "1", "0"), "0.3"),
        (("2", "5", "1.44e-4", "0"), "1.3968e-4"),  # the paper's laboratory gains at 97 % of k_I3
        (("1", "20", "1", "1/10"), "0.3"),
    ],
)
def test_nested_powers_are_proved_over_the_range_of_beta(gains, lipschitz):
    verdict, certificate = qd.certify("dia", gains, lipschitz=lipschitz, gain_range=(1, "1.425"))
    assert verdict is Verdict.PROVED
    assert certificate.check() is Verdict.PROVED
    broken = dict(certificate.witnesses)
    name = next(n for n in broken if n.startswith("decrease"))
    broken[name] = replace(broken[name], cofactors=({(1, 0, 0, 0): F(1)},))
    with pytest.raises(CertificateError):
        replace(certificate, witnesses=broken).check()


@pytest.mark.slow
@pytest.mark.parametrize("lipschitz", ["1", "1.01", "3"])
def test_the_integral_action_bounds_what_the_nested_law_withstands(lipschitz):
    # d = k_I3 on e1 > 0 holds off ξ1' for ever
    assert qd.certify("dia", (1, 20, 1, 0), lipschitz=lipschitz)[0] is not Verdict.PROVED


@pytest.mark.slow
def test_a_root_outside_its_range_is_refused():
    certificate = qd.certify("dia", (2, 5, "1.44e-4", 0), lipschitz="1e-4")[1]
    of, (low, high) = certificate.loop.roots["kappa"]
    assert low**2 < certificate.loop.gains[of] < high**2
    loop = replace(certificate.loop, roots={"kappa": (of, (high, high))})
    with pytest.raises(CertificateError):
        replace(certificate, loop=loop).check()


@pytest.mark.slow
def test_decay_bounds_the_settling_time():
    from quakedesign.lyapunov.search.lyapunov_search import balance, with_largest_decay

    certificate = qd.certify("cta", GAINS, lipschitz=1)[1]
    faster = with_largest_decay(certificate, balance(certificate.loop))
    assert faster.check() is Verdict.PROVED
    assert F(1, 70) < faster.claims["decay"] < F(1, 40)  # κ = 1/66 is known for another V of the same gains
    doubled = {**faster.claims, "decay": 2 * faster.claims["decay"]}
    with pytest.raises(CertificateError):
        replace(faster, claims=doubled).check()


def test_the_sign_of_v_dot_agrees_with_an_independent_sampler(proof):
    # V̇ from the field and the power rules written out by hand, at random points for inner and outer parameters
    import numpy as np

    from quakedesign.symbolic.terms import value

    terms = [(float(value(t, {})), t.factors) for t in proof.lyapunov]

    def power(x, exponent, signed):
        return np.abs(x) ** float(exponent) * (np.sign(x) if signed else 1)

    def V(e, differentiated=None):
        total = 0.0
        for coefficient, factors in terms:
            known = {int(state[1]) - 1: (exponent, kind == "s") for state, exponent, kind in factors}
            product = coefficient * (differentiated is None or differentiated in known)
            for i, (exponent, signed) in known.items():
                if i == differentiated:
                    product = product * float(exponent) * power(e[i], exponent - 1, not signed)
                else:
                    product = product * power(e[i], exponent, signed)
            total = total + product
        return total

    rng = np.random.default_rng(7)
    u = np.abs(rng.normal(size=(3, 20000))) * np.array([[1.0], [1.4], [7.0]])
    e = np.sign(rng.normal(size=u.shape)) * u ** np.array([[3], [2], [1]])
    k1, k2, k3, k4 = 7.0, 5.0, 2.3, 1.1
    gradient = [V(e, i) for i in range(3)]
    assert V(e).min() > 0
    for beta in (1.0, 1.2, 1.425):
        for d in (-1.0, 0.3, 1.0):
            nu = -k1 * np.cbrt(e[0]) - k2 * np.sign(e[1]) * np.sqrt(np.abs(e[1])) + e[2]
            rate = gradient[0] * e[1] + gradient[1] * beta * nu
            rate += gradient[2] * (-k3 * np.sign(e[0]) - k4 * np.sign(e[1]) + d)
            assert rate.max() < 0


@pytest.mark.parametrize("name", ["k1", "k2", "k3", "k4"])
def test_a_changed_gain_loses_the_proof(proof, name):
    gains = dict(proof.loop.gains) | {name: proof.loop.gains[name] * F(1001, 1000)}
    with pytest.raises(CertificateError):
        replace(proof, loop=replace(proof.loop, gains=gains)).check()


def test_a_wider_range_loses_the_proof(proof):
    wider = dict(proof.loop.uncertain) | {"d": (F(-11, 10), F(11, 10))}
    with pytest.raises(CertificateError):
        replace(proof, loop=replace(proof.loop, uncertain=wider)).check()


def test_a_field_of_another_law_is_refused(proof):
    changed = dict(proof.loop.field)
    changed["e1"] = (replace(changed["e1"][0], coefficient=F(2)),)
    with pytest.raises(CertificateError, match="the field in the certificate differs from that of cta"):
        replace(proof, loop=replace(proof.loop, field=changed)).check()


@pytest.mark.parametrize("name", ["positive", "decrease", "bound_e1", "bound_e2", "bound_e3"])
def test_a_claim_ten_times_as_strong_is_refused(proof, name):
    claims = dict(proof.claims) | {name: proof.claims[name] * 10}
    with pytest.raises(CertificateError):
        replace(proof, claims=claims).check()


def test_a_missing_or_extra_witness_is_refused(proof):
    first, *rest = proof.witnesses
    without = {name: proof.witnesses[name] for name in rest}
    with pytest.raises(CertificateError, match="missing"):
        replace(proof, witnesses=without).check()
    with pytest.raises(CertificateError, match="must be those of the distinct obligations"):
        replace(proof, witnesses=proof.witnesses | {"decrease of nothing": proof.witnesses[first]}).check()


def test_a_function_that_is_not_differentiable_is_refused(proof):
    # Moreno's quadratic V for the super-twisting law has |e1| in it (CERTIFICATES.md)
    kink = replace(proof.lyapunov[0], factors=(("e3", F(1), "a"),))
    with pytest.raises((CertificateError, ArithmeticError)):
        replace(proof, lyapunov=(kink,)).check()


def test_the_equilibrium_of_a_refutation_is_checked_exactly():
    _, certificate = qd.certify("cta", GAINS, lipschitz="1.25")
    moved = replace(certificate.refutation, point=dict(certificate.refutation.point) | {"e3": F(7001, 1000)})
    with pytest.raises(CertificateError, match="does not vanish"):
        replace(certificate, refutation=moved).check()
    outside = replace(certificate.refutation, parameters={"beta": F(1), "d": F(13, 10)})
    with pytest.raises(CertificateError, match="outside"):
        replace(certificate, refutation=outside).check()


def test_exact_gains_are_read_exactly():
    _, certificate = qd.certify("cta", ("7", "50e-1", "23/10", "1.1"), lipschitz=1)
    assert certificate.loop.gains == {"k1": 7, "k2": 5, "k3": F(23, 10), "k4": F(11, 10)}


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: qd.certify("cta", ("nan", 1, 1, 1), lipschitz=1), ParameterError, "gain k1 must be a finite number"),
        (lambda: qd.certify("cta", (1, 1, 1), lipschitz=1), ParameterError, "needs 4 gains"),
        (lambda: qd.certify("cta", GAINS, lipschitz=-1), ParameterError, "must not be negative"),
        (lambda: qd.certify("cta", GAINS, lipschitz=1, gain_range=(2, 1)), ParameterError, "0 < b_m <= b_M"),
        (lambda: qd.certify("pid", GAINS, lipschitz=1), UnknownNameError, "controller must be one of"),
    ],
)
def test_bad_input_gets_one_clear_message(call, error, message):
    with pytest.raises(error, match=message):
        call()
