"""Certified peaks as files: the same numbers, both kinds of gains, refused for any other fault or smaller inputs."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict, certificate_text, parse_certificate
from quakedesign.certificates.command import check_files
from quakedesign.certificates.tracking import peaks_covered
from quakedesign.controllers import published
from quakedesign.errors import CertificateError
from quakedesign.synthesis.linear.certified_peaks import certified_peaks
from quakedesign.synthesis.linear.peak_certificate import peak_certificate
from quakedesign.synthesis.linear.riccati import riccati_design

REAL = qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def designed():
    controller = riccati_design(REAL).controller
    peaks = certified_peaks(REAL, controller, disturbance_class="rate", outputs=("slip_rate_error", "slip_error"))
    return peaks, peak_certificate(peaks, controller)


@pytest.fixture(scope="module")
def printed():
    controller = published("real-fault")["elqr"]
    peaks = certified_peaks(REAL, controller, disturbance_class="rate", outputs=("slip_rate_error", "pressure_offset"))
    return peaks, peak_certificate(peaks, controller)


@pytest.mark.parametrize("which", ["designed", pytest.param("printed", marks=pytest.mark.slow)])
def test_the_file_holds_the_bounds_and_is_proved(which, request, tmp_path):
    peaks, certificate = request.getfixturevalue(which)
    for output in certificate.response.outputs:
        assert certificate.response.total(output) == peaks.total(output)
    path = tmp_path / "peaks.json"
    certificate.save(path)
    read = parse_certificate(path.read_text())
    assert read == certificate
    ((verdict, said),) = check_files([path], "real-fault").values()
    assert verdict == "proved"
    assert any(f"never exceeds {float(peaks.peak_slip_rate):.6g} m/s" in line for line in said)
    kinds = {"designed": "feedback of the error", "printed": "feedback of the error or state"}
    assert any(line.endswith(kinds[which]) for line in said)


def test_another_fault_box_or_disturbance_is_not_covered(designed, tmp_path):
    _, certificate = designed
    path = tmp_path / "peaks.json"
    certificate.save(path)
    ((verdict, _),) = check_files([path], "lab-fault").values()
    assert verdict.startswith("invalid")
    for fault in (
        REAL.with_disturbance(replace(REAL.disturbance, amplitude=4e-4)),
        REAL.with_disturbance(replace(REAL.disturbance, frequency=0.8)),
    ):
        with pytest.raises(CertificateError, match="inputs are smaller"):
            peaks_covered(certificate, fault)


def test_an_input_that_acts_elsewhere_as_well_is_not_covered(designed):
    _, certificate = designed
    loop = certificate.loop
    push = loop.field["e2"][-1]
    assert push.parameters[0] in loop.inputs
    doubled = replace(loop, field={**loop.field, "zeta": (*loop.field["zeta"], push)})
    with pytest.raises(CertificateError, match="act elsewhere"):
        peaks_covered(replace(certificate, loop=doubled), REAL)


def test_a_changed_gain_bound_or_field_loses_the_proof(designed):
    _, certificate = designed
    loop, response = certificate.loop, certificate.response
    part = response.parts["disturbance"]
    claim = part.bounds["slip_error"]
    smaller = replace(part, bounds={**part.bounds, "slip_error": replace(claim, bound=claim.bound * F(999, 1000))})
    for changed in (
        replace(certificate, loop=replace(loop, gains={**loop.gains, "k1": loop.gains["k1"] + 1})),
        replace(certificate, loop=replace(loop, uncertain={**loop.uncertain, "beta": (F(1), F(3, 2))})),
        replace(certificate, loop=replace(loop, inputs={**loop.inputs, "disturbance": (F(1), F(1))})),
        replace(certificate, response=replace(response, parts={**response.parts, "disturbance": smaller})),
    ):
        with pytest.raises(CertificateError):
            changed.check()
    other = {**loop.field, "chi": (replace(loop.field["chi"][0], coefficient=F(2)),)}
    with pytest.raises(CertificateError, match="field is not that of elqr"):
        replace(certificate, loop=replace(loop, field=other)).check()


def test_every_ellipsoid_alone_holds_the_states_that_a_sine_reaches(designed):
    # V ≤ 1 for the whole run of one input, in floating point
    import numpy as np

    from quakedesign.certificates.response_obligations import OneInput

    _, certificate = designed
    alone, part = OneInput(certificate.loop, "disturbance"), certificate.response.parts["disturbance"]
    b, c = (float(v) for v in certificate.loop.inputs["disturbance"])
    forms = [{e: float(v) for e, v in alone.form(own.function).items()} for own in part.sets]
    k, authority = [float(v) for v in certificate.loop.gains.values()], float(certificate.loop.constants["b"])
    beta, s, w = 1.4, 1.3, 1.6
    A = np.array([[0, 1, 0, 0], [s - beta * authority * k[0], -w - beta * authority * k[1], -beta * authority, 0]])
    A = np.vstack([A, [k[2], 0, 0, 1], [k[3], 0, 0, 0]])
    x, step, top = np.zeros(4), 1e-3, 0.0
    for n in range(30000):
        u = b * np.sin(c / b * n * step)
        x = x + step * (A @ x + np.array([0, u, 0, 0]))
        if n % 50 == 0:
            point = np.append(x, u)
            top = max(top, *(sum(v * np.prod(point ** np.array(e)) for e, v in f.items()) for f in forms))
    assert 0.01 < top < 1


def test_the_text_is_the_same_every_time(designed):
    peaks, certificate = designed
    again = peak_certificate(peaks, riccati_design(REAL).controller)
    assert certificate_text(again) == certificate_text(certificate)
    assert again.check() is Verdict.PROVED
