"""Every sign cell counts: loops without odd symmetry, in which no cell repeats another."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import pytest
import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.laws import LoopField
from quakedesign.lyapunov import Certificate, Loop, Witness, loop_of
from quakedesign.lyapunov.exact.obligations import (
    Obligations,
    _require_different,
    claimed,
    different,
    obligation_degree,
)
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.terms import Term

x, y = sp.symbols("x y", real=True)
HALF = sp.Rational(1, 2)


def model(*rates):
    states = (x, y)[: len(rates)]
    return LoopField(
        states=dict.fromkeys(states, 2), field=dict(zip(states, rates, strict=True)), gains=(), constants=(),
        uncertain=(), domain="cells",
    )  # fmt: skip


def powers(*rates):
    """Certificate with V = Σ|x_i|^{3/2} and a witness for every obligation that is a positive sum of powers."""
    loop_field = model(*rates)
    loop = loop_of("custom", loop_field, gains={}, uncertain={})
    lyapunov = tuple(Term(F(1), (), ((state, F(3, 2), "a"),)) for state in loop.states)
    claims = {"positive": F(1, 2), "decrease": F(1)}
    witnesses = {}
    for one in different(claimed(loop, lyapunov, claims)):
        squares = tuple(
            Square(product=tuple(i for i, n in enumerate(e) if n % 2), basis=(tuple(n // 2 for n in e),), gram=(c,))
            for e, c in one.polynomial.items()
        )
        if all(c > 0 for c in one.polynomial.values()):
            witnesses[one.name] = Witness(multiplier={(0,) * len(loop.states): F(1)}, squares=squares)
    return loop_field, Certificate(loop=loop, lyapunov=lyapunov, claims=claims, witnesses=witnesses)


def test_a_loop_that_runs_away_on_its_last_cell_alone_is_not_proved():
    # x' = −|x|^½ comes back from the right and runs away to the left
    field, certificate = powers(-AbsolutePower(x, HALF))
    assert list(certificate.witnesses) == ["positive +", "decrease +"]
    with pytest.raises(CertificateError, match="the witness of 'decrease -' is missing"):
        certificate.check(field)


def test_the_last_of_four_cells_counts_too():
    # y' = −⌈y⌋^½ but for x, y < 0, where (1 − sign x)(1 − sign y)/4 = 1 turns it
    turned = (1 - SignedPower(x, 0)) * (1 - SignedPower(y, 0)) / 4
    field, certificate = powers(
        sp.expand(-SignedPower(x, HALF)), sp.expand(-SignedPower(y, HALF) - 3 * turned * AbsolutePower(y, HALF))
    )
    assert "decrease --" not in certificate.witnesses
    with pytest.raises(CertificateError, match="the witness of 'decrease --' is missing"):
        certificate.check(field)


def test_the_same_loops_with_every_cell_falling_are_proved():
    for rates in ((-SignedPower(x, HALF),), (-SignedPower(x, HALF), -SignedPower(y, HALF))):
        field, certificate = powers(*rates)
        assert str(certificate.check(field)) == "proved"


def test_a_function_that_is_negative_on_its_last_cell_is_not_positive():
    # V = ⌈x⌋^{3/2} is odd; its first cell is as good as |x|^{3/2}
    field, certificate = powers(-SignedPower(x, HALF))
    odd = Certificate(
        loop=certificate.loop, lyapunov=(Term(F(1), (), (("x", F(3, 2), "s"),)),), claims=certificate.claims,
        witnesses=certificate.witnesses,
    )  # fmt: skip
    with pytest.raises(CertificateError, match="the witness of 'positive -' is missing"):
        odd.check(field)


@pytest.mark.parametrize("count", [1, 2])
def test_there_are_two_cells_for_every_state(count):
    field, certificate = powers(*(-SignedPower(s, HALF) for s in (x, y)[:count]))
    words = [cell.name for cell in Obligations(certificate.loop, certificate.lyapunov).sign_cells()]
    assert words == {1: ["+", "-"], 2: ["++", "+-", "-+", "--"]}[count]
    assert len(field.states) == count


# ---------------------------------------------------------------- every condition by itself


def power(coefficient, *factors, parameters=()):
    return Term(F(coefficient), parameters, tuple((name, F(exponent), kind) for name, exponent, kind in factors))


def own(*, states=("x",), domain="cells", **parts):
    field = {state: (power(-1, (state, 1, "s")),) for state in states}
    given = {"gains": {}, "constants": {}, "uncertain": {}, "field": field}
    return Loop(law="own", states=dict.fromkeys(states, 1), domain=domain, **given | parts)


def function(*factors, parameters=()):
    return (power(1, *factors, parameters=parameters),)


@pytest.mark.parametrize(
    ("factors", "smooth"),
    [
        ([("x", 1, "s")], True),
        ([("x", 2, "a")], True),
        ([("x", "3/2", "a"), ("y", 1, "s")], True),
        ([("x", 1, "a")], False),
        ([("x", "1/2", "s")], False),
        ([("x", "1/2", "a")], False),
        ([("x", 0, "s")], False),
        ([("y", 2, "a"), ("x", 1, "a")], False),
    ],
)
def test_a_function_is_continuously_differentiable_in_every_factor(factors, smooth):
    obligations = Obligations(own(states=("x", "y")), function(*factors))
    if smooth:
        assert obligations.derivative
    else:
        with pytest.raises(CertificateError, match="not continuously differentiable"):
            _ = obligations.derivative


def test_the_derivative_is_affine_in_what_has_a_range():
    def derivative(*parameters):
        field = {"x": (power(-1, ("x", 1, "s"), parameters=parameters),)}
        loop = own(field=field, gains={"k": F(2)}, uncertain={"b": (F(1), F(2)), "d": (F(1), F(2))})
        return Obligations(loop, function(("x", 2, "a"))).derivative

    assert derivative("b", "d", "k", "k")
    with pytest.raises(CertificateError, match="not affine in b"):
        derivative("b", "d", "b")


def test_every_vertex_is_there_once():
    loop = own(uncertain={"a": (F(1), F(2)), "b": (F(3), F(3)), "c": (F(-1), F(0))})
    names = [name for name, _ in Obligations(loop, ()).vertices()]
    assert names == [f"a={a} b=3 c={c}" for a in (1, 2) for c in (-1, 0)]


def test_on_the_reals_only_polynomials_are_taken():
    loop = own(domain="reals")
    assert Obligations(loop, function(("x", 2, "a"))).potential({"x": 1}) == {(2,): 1}
    for bad in (("x", 3, "a"), ("x", 2, "s")):
        with pytest.raises(CertificateError):
            Obligations(loop, function(bad)).potential({"x": 1})
    kinked = replace(loop, field={"x": (power(-1, ("x", 1, "a")),)})
    with pytest.raises(CertificateError):
        list(Obligations(kinked, function(("x", 2, "a"))).decrease("rate"))


# ---------------------------------------------------------------- lifts


def lifted(lifts, *factors, states=("x", "y"), **parts):
    """Cells of a loop whose first rate has the given factors."""
    field = {state: (power(-1, (state, 1, "s")),) for state in states}
    field["x"] = (*field["x"], power(-1, *factors))
    return Obligations(own(states=states, lifts=lifts, field=field, **parts), function(("x", 2, "a")))


SUM = {"n": (power(1, ("x", 1, "s")), power("1/2", ("y", 1, "s")))}


def test_a_lift_with_a_power_has_an_equality():
    """t w = s u + r v/2; four cells have an interior for either sign, two for one."""
    cells = {cell.name: cell for cell in lifted(SUM, ("n", 1, "s")).cells}
    assert set(cells) == {"+++", "+-+", "+--", "-++", "-+-", "---"}
    assert cells["+--"].equalities == ({(0, 0, 1): -1, (1, 0, 0): -1, (0, 1, 0): F(1, 2)},)
    assert {cell.inequalities for cell in cells.values()} == {()}


def test_a_lift_with_a_sign_alone_has_an_inequality():
    cells = {cell.name: cell for cell in lifted(SUM, ("n", 0, "s")).cells}
    assert set(cells) == {"+++", "+-+", "+--", "-++", "-+-", "---"}
    assert cells["+--"].inequalities == ({(1, 0): -1, (0, 1): F(1, 2)},)
    assert cells["+++"].inequalities == ({(1, 0): 1, (0, 1): F(1, 2)},)
    assert {cell.equalities for cell in cells.values()} == {()}


def test_a_small_condition_leaves_its_cell():
    """x/3 - y/2: no coefficient reaches one."""
    small = {"n": (power("1/3", ("x", 1, "s")), power("1/2", ("y", 1, "s")))}
    assert "+++" in [cell.name for cell in lifted(small, ("n", 0, "s")).cells]


def test_two_lifts_have_their_own_conditions():
    """n = x + y/2 and m = x - y, with powers and with signs, and one of each."""
    both = SUM | {"m": (power(1, ("x", 1, "s")), power(-1, ("y", 1, "s")))}
    powers = {cell.name: cell for cell in lifted(both, ("n", 1, "s"), ("m", 1, "s")).cells}
    assert powers["+++-"].equalities == (
        {(0, 0, 1, 0): 1, (1, 0, 0, 0): -1, (0, 1, 0, 0): F(-1, 2)},
        {(0, 0, 0, 1): -1, (1, 0, 0, 0): -1, (0, 1, 0, 0): 1},
    )
    signs = {cell.name: cell for cell in lifted(both, ("n", 0, "s"), ("m", 0, "s")).cells}
    assert signs["+++-"].inequalities == ({(1, 0): 1, (0, 1): F(1, 2)}, {(1, 0): -1, (0, 1): 1})
    assert set(powers) == set(signs) == {"++++", "+++-", "+-++", "+--+", "-++-", "-+--", "---+", "----"}
    mixed = lifted(both, ("n", 0, "s"), ("m", 1, "s"))
    assert mixed.with_variable == ("m",)
    assert {cell.name for cell in mixed.cells} == set(powers)
    one = next(cell for cell in mixed.cells if cell.name == "+++-")
    assert one.equalities == ({(0, 0, 1): -1, (1, 0, 0): -1, (0, 1, 0): 1},)
    assert one.inequalities == ({(1, 0, 0): 1, (0, 1, 0): F(1, 2)},)


def test_a_lift_is_used_with_any_power_and_every_one_is_used():
    twice = own(states=("x", "y"), lifts=SUM, field={
        "x": (power(-1, ("n", 0, "s")),), "y": (power(-1, ("n", 1, "s")),),
    })  # fmt: skip
    assert Obligations(twice, ()).with_variable == ("n",)
    with pytest.raises(CertificateError, match="does not occur in the field"):
        _ = lifted(SUM | {"m": SUM["n"]}, ("n", 1, "s")).cells


def test_an_argument_is_a_form_on_every_cell():
    for terms in (
        (power(1, ("x", 1, "s")), power(1, ("x", 1, "a"))),  # zero for x < 0
        (power(1, ("x", 1, "s")), power(1, ("y", 2, "a"))),
        (power(1),),
    ):
        with pytest.raises(CertificateError, match="no single positive degree"):
            _ = lifted({"n": terms}, ("n", 1, "s")).cells


def test_the_parameter_of_a_lift_is_one_number():
    lift = {"n": (power(1, ("x", 1, "s"), parameters=("p",)),)}
    for value, names in ((F(3), {"++", "--"}), (F(-3), {"+-", "-+"})):
        point = lifted(lift, ("n", 1, "s"), states=("x",), uncertain={"p": (value, value)})
        assert {cell.name for cell in point.cells} == names
        gain = lifted(lift, ("n", 1, "s"), states=("x",), gains={"p": value})
        assert {cell.name for cell in gain.cells} == names
    for exponent in (0, 1):
        with pytest.raises(CertificateError, match="a parameter with a range, p"):
            _ = lifted(lift, ("n", exponent, "s"), states=("x",), uncertain={"p": (F(1), F(2))}).cells
    disregarded = {"n": (power(1, ("x", 1, "s")), power(1, ("x", 2, "a"), parameters=("c", "p")))}
    cells = lifted(disregarded, ("n", 1, "s"), states=("x",), gains={"c": F(0)}, uncertain={"p": (F(1), F(2))}).cells
    assert {cell.name for cell in cells} == {"++", "--"}


ROOTED = {"n": (power(1, ("x", 1, "s")), power("1/5", ("y", 1, "s"), parameters=("r",)))}
RANGE = {"gains": {"k": F(2)}, "roots": {"r": ("k", (F(7, 5), F(3, 2)))}}


def test_the_sign_of_an_argument_with_a_root_is_known_for_its_whole_range():
    """Wherever t (x + r y/5) >= 0 for one r of the range, g >= 0; at one end of the range both are the same."""
    cells = lifted(ROOTED, ("n", 0, "s"), **RANGE).cells
    assert {cell.name for cell in cells} == {"+++", "+-+", "+--", "-++", "-+-", "---"}
    ends = (F(7, 25), F(3, 10))
    for cell in cells:
        x_sign, y_sign, t = (1 if s == "+" else -1 for s in cell.name)
        (g,) = cell.inequalities
        arguments = [{(1, 0): F(t * x_sign), (0, 1): t * y_sign * end} for end in ends]
        assert g in arguments
        assert g[0, 1] == max(argument[0, 1] for argument in arguments)
        assert g[1, 0] == t * x_sign


def test_a_root_with_a_range_stands_under_signs_alone_and_leaves_no_sign_open():
    with pytest.raises(CertificateError, match="a parameter with a range, r"):
        _ = lifted(ROOTED, ("n", 1, "s"), **RANGE).cells
    for number in ("-29/20", "-7/5", "-3/2"):
        open_ = {"n": (power(1, ("x", 1, "s"), parameters=("r",)), power(number, ("x", 1, "s")))}
        with pytest.raises(CertificateError, match="the sign of a coefficient in the argument of n depends on a root"):
            _ = lifted(open_, ("n", 0, "s"), states=("x",), **RANGE).cells
    for number, kind in product(("1/5", "-1/5"), "sa"):  # 0 at the lower end of the range
        from_zero = {"n": (power(1, ("x", 1, "s")), power(number, ("y", 1, kind), parameters=("r",)))}
        wide = RANGE | {"roots": {"r": ("k", (F(0), F(3, 2)))}}
        with pytest.raises(CertificateError, match="the sign of a coefficient in the argument of n depends on a root"):
            _ = lifted(from_zero, ("n", 0, "s"), **wide).cells
    point = RANGE | {"gains": {"k": F(9, 4)}, "roots": {"r": ("k", (F(3, 2), F(3, 2)))}}
    assert lifted(ROOTED, ("n", 1, "s"), **point).cells[0].equalities == (
        {(0, 0, 1): 1, (1, 0, 0): -1, (0, 1, 0): F(-3, 10)},
    )


def test_an_argument_vanishes_on_a_null_set_only():
    """Of x, y, z and lifts n(x), m(y), l: x + n is zero on open sets, y + n and x y + x m are not."""
    loop = own(states=("x", "y", "z"))
    e = {name: tuple(int(i == k) for i in range(6)) for k, name in enumerate("xyznml")}

    def check(**arguments):
        Obligations(loop, ())._require_null_zeros(
            {name: {e[part]: F(1) for part in parts} for name, parts in arguments.items()}
        )

    check(n="x", m="y", l="zm")
    check(n="x", m="y", l="yn")
    check(n="x", m="yn", l="zm")
    check(n="x")
    for bad in (
        {"n": "x", "m": "xn"},
        {"n": "x", "m": "n"},
        {"n": "x", "m": "y", "l": "xn"},
        {"n": "x", "m": "yn", "l": "ym"},
        {"n": "x", "m": "yn", "l": "xm"},
    ):
        with pytest.raises(CertificateError, match="vanish on an open set"):
            check(**bad)


@pytest.mark.parametrize(
    ("conditions", "fine"),
    [
        ([], True),
        ([{(1, 0): F(1), (0, 1): F(1)}], True),
        ([{(1, 1): F(1)}], True),
        ([{(2, 0): F(1)}], True),
        ([{(1, 0): F(1), (0, 1): F(1)}, {(1, 0): F(1), (0, 1): F(2)}], True),
        ([{(1, 0): F(1), (0, 1): F(3)}, {(1, 0): F(2), (0, 1): F(6)}], False),
        ([{(1, 0): F(1), (0, 1): F(-3)}, {(1, 0): F(1, 2), (0, 1): F(-3, 2)}], False),
        ([{(1, 0): F(1), (0, 1): F(3)}, {(1, 0): F(-1), (0, 1): F(-3)}], True),
        ([{(1, 0): F(5)}], False),
        ([{(1, 0): F(1), (0, 1): F(1)}, {(0, 1): F(2)}], False),
    ],
)
def test_conditions_differ_from_each_other_and_from_variables(conditions, fine):
    if fine:
        _require_different(conditions, ["n", "m"])
    else:
        with pytest.raises(CertificateError, match="the signs of n, m coincide"):
            _require_different(conditions, ["n", "m"])


def test_equal_signs_on_a_cell_are_refused_by_name():
    double = {"n": SUM["n"], "m": tuple(replace(t, coefficient=2 * t.coefficient) for t in SUM["n"])}
    with pytest.raises(CertificateError, match="the signs of n, m coincide"):
        _ = lifted(double, ("n", 0, "s"), ("m", 0, "s")).cells
    assert lifted(double, ("n", 1, "s"), ("m", 0, "s")).cells


# ---------------------------------------------------------------- degrees


def test_forms_share_one_positive_degree():
    assert obligation_degree([{(2, 0): F(1), (1, 1): F(1)}, {(0, 2): F(1)}], "V") == 2
    for bad in ([{(2, 0): F(1), (1, 0): F(1)}], [{(1,): F(1)}, {(2,): F(1)}], [{(0, 0): F(1)}], [{}], []):
        with pytest.raises(CertificateError, match="not homogeneous of one positive degree"):
            obligation_degree(bad, "V")
    with pytest.raises(CertificateError, match="vanishes on a cell"):
        obligation_degree([{(1,): F(1)}, {}], "V")


def test_a_decay_is_named_as_the_decrease_that_it_is_about():
    # V = |x|^(3/2) = u^3 and x' = -decrease [x]^(1/2): -V' = 3/2 decrease u^2 on both cells
    rate = sp.Symbol("decrease", real=True)
    own = LoopField(
        states={x: 2}, field={x: -rate * SignedPower(x, HALF)}, gains=(), constants=(), uncertain=(rate,),
        domain="cells",
    )  # fmt: skip
    loop = loop_of("custom", own, gains={}, uncertain={"decrease": (F(1), F(2))})
    claims = {"positive": F(1), "decrease": F(1), "decay": F(1, 2)}
    found = list(claimed(loop, (Term(F(1), (), (("x", F(3, 2), "a"),)),), claims))[2:]
    assert [one.name for one in found] == [
        f"{claim} {sign} decrease={value}" for claim in ("decrease", "decay") for sign in "+-" for value in (1, 2)
    ]
    # on the last cell, with v^3 = u^3: 3/2*2 u^2 - 1/2 v^2
    assert found[-1].polynomial == {(2, 0): 3, (0, 2): F(-1, 2)}
