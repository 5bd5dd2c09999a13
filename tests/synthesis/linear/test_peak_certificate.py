"""Certified peaks as files: the same numbers, both kinds of gains, refused for any other fault or smaller inputs."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.bounds import UpperBound
from quakedesign.certificates import Verdict, certificate_text, parse_certificate
from quakedesign.certificates.command import check_files
from quakedesign.certificates.linear_premises import sectors
from quakedesign.certificates.tracking import needed_inputs, peaks_covered
from quakedesign.controllers import published
from quakedesign.errors import CertificateError
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.linear.certified_peaks import certified_peaks
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.peak_certificate import peak_certificate

REAL = qd.load_fault("real-fault")
CHECKER = Path(__file__).parents[3] / "proofs" / "check.py"


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
    assert any(f"never exceeds {UpperBound(peaks.peak_slip_rate):.6g} m/s" in line for line in said)
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


def with_outputs(certificate, renamed, scale=F(1)):
    """The same bounds with other names and rows times a scale: bounds and Gram matrices follow, so that all holds."""
    response = certificate.response
    witnesses = {}
    for name, witness in certificate.witnesses.items():
        kind, *middle, last = name.split(" ")
        if kind != "output":
            witnesses[name] = witness
            continue
        squares = tuple(replace(s, gram=tuple(g * scale**2 for g in s.gram)) for s in witness.squares)
        witnesses[" ".join((kind, *middle, renamed.get(last, last)))] = replace(witness, squares=squares)
    parts = {
        name: replace(
            part,
            bounds={renamed.get(n, n): replace(bound, bound=bound.bound * scale) for n, bound in part.bounds.items()},
        )
        for name, part in response.parts.items()
    }
    outputs = {
        renamed.get(name, name): tuple(replace(t, coefficient=t.coefficient * scale) for t in row)
        for name, row in response.outputs.items()
    }
    return replace(certificate, response=replace(response, outputs=outputs, parts=parts), witnesses=witnesses)


SWAPPED = {"slip_error": "slip_rate_error", "slip_rate_error": "slip_error"}


@pytest.mark.parametrize(
    ("renamed", "scale"), [({}, F(1, 1000)), (SWAPPED, F(1)), ({"slip_error": "pressure_offset"}, F(1))]
)
def test_an_output_whose_row_is_not_what_its_name_says_is_refused(designed, tmp_path, renamed, scale):
    path = tmp_path / "forged.json"
    with_outputs(designed[1], renamed, scale).save(path)
    for fault in ("real-fault", None):
        ((verdict, said),) = check_files([path], fault).values()
        assert verdict.startswith("invalid: the output")
        assert said == []


def test_other_names_are_not_verified_and_say_nothing_about_the_fault(designed, tmp_path):
    # all of it holds, so that only a name could mislead; the standard library's checker names rows alone
    path = tmp_path / "scaled.json"
    with_outputs(designed[1], {"slip_error": "slip", "slip_rate_error": "slip_rate"}, F(1, 1000)).save(path)
    ((verdict, said),) = check_files([path], "real-fault").values()
    assert verdict == "proved"
    assert not any("never exceeds" in line for line in said)
    assert [line.split(" for the file")[1][:29] for line in said if "for ever" in line] == 2 * [
        ", a name that is not verified"
    ]
    done = subprocess.run([sys.executable, CHECKER, path], capture_output=True, text=True, check=True)
    assert "row of the output slip_rate, a name that is not verified: 1/1000*e2" in done.stdout
    assert "|slip_rate|" not in done.stdout


def test_the_slip_rate_is_read_off_the_rows_under_any_name(designed, tmp_path):
    peaks, certificate = designed
    path = tmp_path / "named.json"
    with_outputs(certificate, {"slip_rate_error": "y", "slip_error": "z"}).save(path)
    ((verdict, said),) = check_files([path], "real-fault").values()
    assert verdict == "proved"
    assert any(f"never exceeds {UpperBound(peaks.peak_slip_rate):.6g} m/s" in line for line in said)


def test_gains_count_by_their_names_not_by_their_order(designed):
    # the feedback of the state feeds k1·r″ + k2·r‴ forward; k3 and k4 in their places would ask for another bound
    _, certificate = designed
    law, needed = published("real-fault")["elqr"], sectors(REAL)
    given = certificate.loop.gains
    backwards = dict(reversed(given.items()))
    inputs = {}
    for name, gains in (("true", given), ("backwards", dict(zip(given, backwards.values(), strict=True)))):
        inputs[name] = needed_inputs(REAL, replace(law, gains=gains), needed, True)["reference_drift_rate"]
    assert inputs["backwards"] < inputs["true"]
    push = Term(F(1), ("reference_drift_rate",), ())
    field = {**certificate.loop.field, "chi": (*certificate.loop.field["chi"], push)}
    for gains, limit, kinds in ((backwards, "true", "error or state"), (backwards, "backwards", "error")):
        loop = replace(
            certificate.loop, gains=gains, field=field,
            inputs={**certificate.loop.inputs, "reference_drift_rate": inputs[limit]},
        )  # fmt: skip
        assert peaks_covered(replace(certificate, loop=loop), REAL)[0].endswith(f"feedback of the {kinds}")


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
