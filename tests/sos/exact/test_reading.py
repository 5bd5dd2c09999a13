"""What may be given as a polynomial and as a condition, and what it is read as."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import ParameterError, PolynomialError
from quakedesign.sos.exact.polynomial_text import read, read_element

x, y, z = sp.symbols("x y z")


def test_text_expressions_and_exponents_are_the_same():
    expected = (("x", "y"), {(2, 0): 1, (0, 1): F(-1, 2)}, ({(1, 0): 1},), ({(0, 1): 1},), None)
    assert read("x^2 - y/2", ("x >= 0", "y == 0"), None, None) == expected
    assert read(x**2 - y / 2, (x >= 0, sp.Eq(y, 0)), None, None) == expected
    assert read({(2, 0): 1, (0, 1): F(-1, 2), (1, 1): 0}, ("x >= 0", "y == 0"), None, ("x", "y")) == expected
    assert read(x**2 - y / 2, (0 <= x, sp.Eq(y, 0)), "auto", (x, y)) == (*expected[:4], "auto")


@pytest.mark.parametrize(
    ("constant", "below"), [(0.9999999999999999, F(1, 10**16)), (1 - sp.Float(2, 40) ** -99, F(1, 2**99))]
)
def test_floats_of_sympy_are_not_rounded(constant, below):
    """A square where SymPy's own rationals are taken: they are only close to floats."""
    assert read(9 * x**2 - 6 * x + constant, (), None, None)[1] == {(2,): 9, (1,): -6, (0,): 1 - below}


def test_both_directions_of_a_relation():
    assert read(x, (x <= 3,), None, None)[2] == ({(1,): -1, (0,): 3},)
    assert read(x, (sp.Ge(x, y),), None, None)[2] == ({(1, 0): 1, (0, 1): -1},)
    assert read(x, (sp.Eq(x, y + 1),), None, None)[3] == ({(1, 0): 1, (0, 1): -1, (0, 0): -1},)
    assert read(x, "x >= 1", None, None)[2] == ({(1,): 1, (0,): -1},)


def test_variables_are_found_in_order_or_given():
    assert read("y + x", ("z >= 0",), None, None)[0] == ("y", "x", "z")
    assert read(z * y, (x >= 0,), None, None)[0] == ("y", "z", "x")
    assert read("x", (), "z^2", None)[0] == ("x", "z")
    assert read("x", (), "auto", None)[0] == ("x",)
    assert read("x", (), None, ("z", "x"))[:2] == (("z", "x"), {(0, 1): 1})
    assert read(3, (), None, None)[:2] == (("x",), {(0,): 3})
    assert read("0", (), None, ("x", "y"))[1] == {}
    assert read(0, (), None, ("x", "y"))[1] == {}
    assert read(F(1, 3), (), None, ("x", "y"))[1] == {(0, 0): F(1, 3)}


def test_a_multiplier_is_read_like_a_polynomial():
    assert read("x", (), "1 + x^2", None)[4] == {(0,): 1, (2,): 1}
    assert read("x", (), 1 + x**2, None)[4] == {(0,): 1, (2,): 1}
    assert read("x", (), {(2,): 1}, ("x",))[4] == {(2,): 1}


@pytest.mark.parametrize(
    ("polynomial", "on", "variables"),
    [
        ({(1, 0): 1}, (), None),
        ({(1,): 1}, (), ("x", "y")),
        ({(1, -1): 1}, (), ("x", "y")),
        ({(1, True): 1}, (), ("x", "y")),
        ({(1, 1.0): 1}, (), ("x", "y")),
        ({"11": 1}, (), ("x", "y")),
        ({frozenset((1, 2)): 1}, (), ("x", "y")),
        (x * z, (), ("x", "y")),
        ("x*z", (), ("x", "y")),
        ("x", ("x - x >= 0",), None),
        (x, (x > 0,), None),
        (x, (x,), None),
        (x, (sp.Ne(x, 0),), None),
        (x, ({(1,): 1},), ("x",)),
        (sp.Symbol("x", commutative=False), (), None),
        (sp.Matrix([[x]]), (), None),
        (sp.Eq(x, 0), (), None),
    ],
)
def test_everything_else_is_refused(polynomial, on, variables):
    with pytest.raises((PolynomialError, ParameterError)):
        read(polynomial, on, None, variables)


def test_variables_differ_from_each_other():
    with pytest.raises(PolynomialError, match=r"variables must be different\. Received x, y, x\. Rename one"):
        read({(1, 0, 0): 1}, (), None, ("x", "y", "x"))


def test_what_the_variables_lack_is_said():
    with pytest.raises(PolynomialError, match="needs its variables"):
        read({(1, 0): 1}, (), None, None)
    with pytest.raises(PolynomialError, match=r"variables must be among x, y\. Received z as well"):
        read(x * z, (), None, ("x", "y"))


@pytest.mark.parametrize(
    ("given", "element"),
    [
        ([1, 2], (1, 2)),
        ((0, 0), (0, 0)),
        ((1.0, 2), (1, 2)),
        ((F(2), 1), (2, 1)),
        ("x*y^2", (1, 2)),
        ({(1, 2): 1}, (1, 2)),
        (x * y**2, (1, 2)),
        ("x - y", {(1, 0): 1, (0, 1): -1}),
        ({(1, 2): 3}, {(1, 2): 3}),
    ],
)
def test_an_element_of_a_basis_is_a_monomial_or_a_polynomial(given, element):
    assert read_element(given, ("x", "y")) == element


@pytest.mark.parametrize("given", [(1.5, 2), ("1", 2), (None, 1), (-1, 1), (1,)])
def test_other_exponents_of_an_element_are_rejected(given):
    with pytest.raises(PolynomialError):
        read_element(given, ("x", "y"))
