"""What a certificate says about a fault comes from its rows and its field, never from what they are called."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.certificates import Loop, loop_of
from quakedesign.certificates.command import check_files
from quakedesign.certificates.error_coordinates import in_error_coordinates
from quakedesign.certificates.meaning import meaning, require_degree_of_slip, rows, slip_degree
from quakedesign.controllers import control_laws, laws, model_of
from quakedesign.errors import CertificateError
from quakedesign.symbolic.terms import Term

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
K = {"k1": F(7), "k2": F(5, 2), "k3": F(11, 3), "k4": F(13)}
RANGES = {"beta": (F(1), F(2)), "s": (F(-1), F(1)), "w": (F(1), F(1))}
LOOP = loop_of(
    "elqr", in_error_coordinates(model_of("elqr")[1]), gains=K, constants={"b": F(1, 2)}, uncertain=RANGES
)  # fmt: skip


def row(**coefficients):
    return tuple(Term(F(c), (), ((state, F(1), "s"),)) for state, c in coefficients.items())


def test_the_pressure_is_what_the_field_multiplies_with_the_authority():
    # p = −Kx and ζ = k3·ξ1 + k4·ξ2 in error coordinates
    assert meaning(LOOP, row(e1=-7, e2=F(-5, 2), zeta=-1)) == "pressure_offset"
    assert meaning(LOOP, row(e1=-7, e2=F(-5, 2))) is None


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [({"e1": 1}, "slip_error"), ({"e2": 1}, "slip_rate_error"), ({"e2": F(1, 1000)}, None), ({"e1": 2}, None),
     ({"e1": 1, "e2": 1}, None), ({"zeta": 1}, None), ({"chi": 1}, None), ({"e2": -1}, None)],
)  # fmt: skip
def test_a_row_is_known_by_its_numbers(coefficients, expected):
    assert meaning(LOOP, row(**coefficients)) == expected


def test_terms_that_add_up_and_gains_in_a_row_are_numbers_too():
    halves = (*row(e2=F(1, 2)), *row(e2=F(1, 2)))
    assert meaning(LOOP, halves) == "slip_rate_error"
    by_name = (Term(F(2, 5), ("k2",), (("e2", F(1), "s"),)),)
    assert meaning(LOOP, by_name) == "slip_rate_error"


def test_a_loop_without_integrals_has_the_same_rows():
    e2 = tuple(t for t in LOOP.field["e2"] if not any(state == "zeta" for state, *_ in t.factors))
    short = replace(LOOP, states={"e1": 1, "e2": 1}, field={"e1": LOOP.field["e1"], "e2": e2})
    assert meaning(short, row(e1=1)) == "slip_error"
    assert meaning(short, row(e1=-7, e2=F(-5, 2))) == "pressure_offset"


def test_a_loop_in_other_coordinates_has_no_such_rows():
    plain = loop_of("elqr", model_of("elqr")[1], gains=K, constants={"b": F(1, 2)}, uncertain=RANGES)
    assert rows(plain) == {}


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
        with pytest.raises(CertificateError, match="another plant"):
            require_degree_of_slip(loop)


def test_a_loop_without_a_control_is_about_no_fault():
    loop = Loop(
        law="custom", gains={}, constants={}, states={"x": 1}, domain="reals", uncertain={}, field={"x": row(x=-1)}
    )  # fmt: skip
    with pytest.raises(CertificateError, match="another plant"):
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
    assert verdict.startswith("invalid: super-twisting acts on derivative 1")
    assert said == []


def test_a_certificate_of_third_order_does_not_cover_a_fault():
    ((verdict, _),) = check_files([CERTIFICATES / "cta3_1_2_2_0.05_0.02_0.01.json"], "lab-fault").values()
    assert verdict.startswith("invalid: cta3 acts on derivative 3")
