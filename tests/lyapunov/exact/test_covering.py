"""Whom a certificate covers: a fault whose constants it has and whose ranges lie in its own."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path
from types import SimpleNamespace

import pytest

from quakedesign.errors import CertificateError
from quakedesign.fault import load_fault
from quakedesign.lyapunov import covers, load_certificate
from quakedesign.lyapunov.exact import premises as covering

CERTIFICATES = Path(__file__).parents[3] / "proofs" / "certificates"
LAB = load_fault("lab-fault")
ELQR = load_certificate(CERTIFICATES / "elqr_lab-fault.json")
CTA = load_certificate(CERTIFICATES / "cta_13_7.5_2.3_1.1.json")


def uncertain(certificate, **ranges):
    return replace(certificate, loop=replace(certificate.loop, uncertain={**certificate.loop.uncertain, **ranges}))


def test_a_linear_certificate_covers_a_fault_whose_ranges_it_holds_to_their_ends(monkeypatch):
    ranges = {name: ELQR.loop.uncertain[name] for name in ("s", "w", "beta")}
    needed = SimpleNamespace(authority=F(4, 1385), ranges=lambda: ranges)
    monkeypatch.setattr(covering, "sectors", lambda fault: needed)
    assert covers(ELQR, LAB) == ['covers elqr on "lab-fault", box paper']
    for name, (low, high) in ranges.items():
        for wrong in ((low + F(1, 10**12), high + 1), (low - 1, high - F(1, 10**12))):
            with pytest.raises(CertificateError, match=f"range of {name} does not cover lab-fault"):
                covers(uncertain(ELQR, **{name: wrong}), LAB)
        assert covers(uncertain(ELQR, **{name: (low - 1, high + 1)}), LAB)
    for constants in ({"b": F(8, 1385)}, {"b": F(4, 1385), "c": F(1)}):
        with pytest.raises(
            CertificateError, match="the control authority of the certificate differs from that of lab-fault"
        ):
            covers(replace(ELQR, loop=replace(ELQR.loop, constants=constants)), LAB)


@pytest.fixture
def asked(monkeypatch):
    """What is asked of the fault, with answers of round numbers."""
    found = {}
    monkeypatch.setattr(covering, "least_authority", lambda fault: ("divisor of", fault.name))
    monkeypatch.setattr(
        covering, "coefficient_range", lambda fault, divisor: found.update(beta=divisor) or (F(1), F(3, 2))
    )
    monkeypatch.setattr(covering, "largest_matched_rate", lambda *given: found.update(rate=given) or F(1, 3))
    return found


def test_a_sliding_mode_s_certificate_says_which_scale_a_fault_needs(asked):
    other = load_certificate(CERTIFICATES / "super-twisting_1.5_1.1.json")
    with pytest.raises(
        CertificateError,
        match="the plant of the certificate is not a fault: the first state of super-twisting has relative degree 1",
    ):
        covers(uncertain(other, beta=(F(1), F(2))), LAB)
    wide = uncertain(CTA, beta=(F(1), F(3, 2)), d=(F(-1, 5), F(1, 4)))
    assert covers(wide, LAB) == [
        'covers cta on "lab-fault", box paper',
        "|h'| <= 0.3334 m/s^3 along the reference needs a scale of at least 1.667",
    ]
    fault, divisor, errors = asked["rate"]
    assert (fault, divisor, asked["beta"]) == (LAB, ("divisor of", "lab-fault"), divisor)
    assert (errors.slip, errors.rate, errors.acceleration) == (0, 0, 0)
    for beta in ((F(1), F(3, 2) - F(1, 10**9)), (F(1) + F(1, 10**9), F(2))):
        with pytest.raises(CertificateError, match="range of beta does not cover"):
            covers(uncertain(wide, beta=beta), LAB)
    for d in ((F(0), F(1)), (F(-1), F(0))):
        with pytest.raises(CertificateError, match="must contain 0 in its interior"):
            covers(uncertain(wide, d=d), LAB)
    assert covers(uncertain(wide, d=(F(-1, 10**6), F(1, 10**6))), LAB)
