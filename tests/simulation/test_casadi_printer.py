import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.casadi_printer import to_casadi, to_numpy, vectorised

x, y = sp.symbols("x y", real=True)
POINTS = np.array([-2.5, -1.0, -1e-3, 0.0, 1e-9, 0.4, 3.0])
EXPRESSIONS = [
    *(SignedPower(x - y, sp.Rational(a)) for a in ("0", "1/3", "1/2", "2/3", "3/2", "2", "5/2", "3")),
    *(AbsolutePower(x, sp.Rational(a)) for a in ("1/2", "5/3", "2")),
    sp.Max(x, 0, y / 2),
    sp.Min(x, y),
    sp.exp(-x) + sp.sin(3 * x) * sp.Rational(1, 3),
    sp.Piecewise((x**2, x < 0), (y, x < 1), (sp.Integer(7), True)),
    (x**2 + 1) ** sp.Rational(-1, 2) + (x**2 + 2) ** sp.Rational(3, 2) + 1 / (x**4 + 3),
    sp.asinh(x) + sp.Abs(y) * sp.sign(x),
]


def oracle(expression, a, b):
    """SymPy's own evaluation in 30 digits."""
    return float(sp.N(expression.subs({x: sp.Float(a, 30), y: sp.Rational(3, 10)}).doit(), 30))


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_both_libraries_agree_with_sympy(expression):
    import casadi as ca

    symbols = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", list(symbols), to_casadi([expression], dict(zip((x, y), symbols, strict=True))))
    (in_numpy,) = to_numpy([expression], {x: POINTS, y: 0.3})
    expected = [oracle(expression, a, 0.3) for a in POINTS]
    assert np.allclose([float(function(a, 0.3)) for a in POINTS], expected, rtol=1e-14, atol=1e-15)
    assert np.allclose(in_numpy * np.ones(len(POINTS)), expected, rtol=1e-14, atol=1e-15)


def test_the_sign_at_zero_is_zero():
    (value,) = to_numpy([SignedPower(x, 0)], {x: 0.0})
    assert value == 0.0


def test_numbers_are_joined_before_they_are_rounded():
    third = sp.Rational(1, 3)
    (value,) = to_numpy([sp.Mul(3, third, x, evaluate=False)], {x: 0.1})
    assert value == 0.1


def test_a_symbol_without_a_value_is_named():
    with pytest.raises(ParameterError, match="y"):
        to_numpy([x + y], {x: 1.0})


def test_an_unknown_operation_is_named():
    with pytest.raises(ParameterError, match="zeta"):
        to_casadi([sp.zeta(x)], {x: 1.0})


X, V = sp.symbols("x v", real=True)
KINKS = [
    (sp.Max(X, 0), (1, 0)),
    (sp.Min(X, 0), (0, 0)),
    (sp.Max(-2 * X, 3 * X), (3, 0)),
    (sp.Abs(V), (0, 1)),
    (sp.Abs(X - V), (1, -1)),
    (sp.Max(0, 1 - sp.Max(X + 1, 0)), (0, 0)),
    (sp.exp(-sp.Max(X, 0)) * (1 + sp.Abs(V)), (-1, 1)),
    (sp.Max(X**2, V), (0, 1)),
    (sp.Min(sp.Max(sp.sin(X), 0), sp.Abs(V) - X), (-1, 1)),
    (sp.Max(X, 0, 2 * V), (1, 0)),
]


@pytest.mark.parametrize(("expression", "slopes"), KINKS, ids=lambda v: str(v)[:30])
def test_at_a_kink_the_derivative_is_that_of_the_branch_that_motion_enters(expression, slopes):
    """Along x first and v second, both at 0; the value stays that of CasADi's own functions."""
    import casadi as ca

    at = ca.SX.sym("at", 2)
    known = {X: at[0], V: at[1]}
    (found,), (plain,) = to_casadi([expression], known, [at[0], at[1]]), to_casadi([expression], known)
    both = ca.Function("both", [at], [found, plain, ca.jacobian(found, at)])
    assert both([0, 0])[2].full().ravel() == pytest.approx(slopes)
    for point in np.random.default_rng(1).normal(size=(50, 2)):
        ours, theirs, _ = both(point)
        assert float(ours) == float(theirs)


@pytest.mark.parametrize("expression", EXPRESSIONS, ids=str)
def test_a_function_at_many_points_at_once_is_the_function_at_each(expression):
    import casadi as ca

    a, b = ca.SX.sym("a", 2), ca.SX.sym("b")
    (value,) = to_casadi([expression], {x: a[0] + a[1], y: b})
    table = ca.densify(ca.jacobian(ca.vertcat(value, ca.exp(value) / 2), ca.vertcat(a, b)))
    one = ca.Function("one", [a, b], [table])
    points = np.random.default_rng(0).uniform(0.1, 2.0, (2, 6))
    found = vectorised(one)(points, np.array([[0.3]]))
    assert found.shape == (6, 6)
    for told, point in zip(found.T, points.T, strict=True):
        assert told == pytest.approx(one(point, 0.3).full().ravel(order="F"), rel=1e-13, abs=1e-13)


def test_an_instruction_that_numpy_lacks_is_named():
    import casadi as ca

    a = ca.SX.sym("a")
    with pytest.raises(ParameterError, match=r"the CasADi operation with code \d+ is not supported"):
        vectorised(ca.Function("one", [a], [ca.erf(a)]))
