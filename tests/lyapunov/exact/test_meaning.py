"""What a certificate says about a fault comes from its rows and its field, never from what they are called."""

from fractions import Fraction as F
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.errors import CertificateError
from quakedesign.laws import control_laws, laws
from quakedesign.lyapunov import Loop, loop_of
from quakedesign.lyapunov.exact.premises import require_degree_of_slip, slip_degree
from quakedesign.symbolic.terms import Term

CERTIFICATES = Path(__file__).parents[3] / "proofs" / "certificates"


def test_the_pressure_acts_on_the_second_derivative_of_the_slip():
    assert slip_degree() == 2


@pytest.mark.parametrize("name", laws())
def test_only_a_law_that_acts_where_the_pressure_does_is_about_a_fault(name):
    model = laws()[name].loop_field()
    gains = {str(k): F(1) for k in model.gains}
    loop = loop_of(
        name, model, gains=gains, constants={str(c): F(1) for c in model.constants},
        uncertain={str(u): (F(1), F(1)) for u in model.uncertain},
    )  # fmt: skip
    if name in control_laws():
        require_degree_of_slip(loop)
    else:
        with pytest.raises(CertificateError, match="is not a fault"):
            require_degree_of_slip(loop)


def test_a_loop_without_a_control_is_about_no_fault():
    still = {"x": (Term(F(-1), (), (("x", F(1), "s"),)),)}
    loop = Loop(law="custom", gains={}, constants={}, states={"x": 1}, domain="reals", uncertain={}, field=still)
    with pytest.raises(CertificateError, match="is not a fault"):
        require_degree_of_slip(loop)


@pytest.fixture(scope="module")
def super_twisting(tmp_path_factory):
    path = tmp_path_factory.mktemp("certificates") / "first-order.json"
    verdict, certificate = qd.certify("super-twisting", ("3", "1.1"), lipschitz="0.1", gain_range=(1, "57/40"))
    assert str(verdict) == "proved"
    certificate.save(path)
    return path


def test_a_certificate_of_first_order_does_not_cover_a_fault_whose_ranges_it_holds(super_twisting):
    assert next(iter(check_files([super_twisting]).values()))[0] == "proved"
    ((verdict, said),) = check_files([super_twisting], "lab-fault").values()
    assert verdict.startswith(
        "invalid: the plant of the certificate is not a fault: the first state of super-twisting has relative degree 1"
    )
    assert said == []


def test_a_certificate_of_third_order_does_not_cover_a_fault():
    ((verdict, _),) = check_files([CERTIFICATES / "cta3_1_2_2_0.05_0.02_0.01.json"], "lab-fault").values()
    assert verdict.startswith(
        "invalid: the plant of the certificate is not a fault: the first state of cta3 has relative degree 3"
    )
