"""What the laws for chains of integrators share: homogeneity, units, and the equilibria that they suggest."""

from fractions import Fraction as F

import pint
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.laws import law, laws
from quakedesign.laws.sliding_mode import IntegratorChain
from quakedesign.symbolic.homogeneity import homogeneous

LAWS = sorted(name for name, item in laws().items() if issubclass(item, IntegratorChain))
STA, CTA3 = law("super-twisting"), law("cta3")
UNCERTAIN = {"beta": (F(1), F(7, 5)), "d": (F(-1), F(1))}
SIGN = {"+": 1, "-": -1}


@pytest.mark.parametrize("name", LAWS)
def test_the_loop_is_proved_homogeneous_of_degree_minus_one(name):
    loop = law(name).loop_field()
    assert list(loop.states.values()) == list(range(law(name).order + 1, 0, -1))
    assert homogeneous(loop.field, loop.states, -1)


@pytest.mark.parametrize("name", LAWS)
def test_every_term_of_a_rate_has_the_unit_of_the_rate(name):
    # e1 in m with the order-fold derivative in ν's unit m/s^(order+…): for super-twisting e1 is a slip rate
    units = pint.UnitRegistry()
    chain, loop = law(name), law(name).loop_field()
    first = 1 if chain.order == 1 else 0
    state_units = {s: units.Unit("m") / units.Unit("s") ** (first + i) for i, s in enumerate(loop.states)}
    known = state_units | {g: units.Unit(u) for g, u in zip(loop.gains, chain.gain_units.values(), strict=True)}
    known |= {s: units.Unit("dimensionless") for s in loop.uncertain if s.name == "beta"}
    known |= {s: state_units[list(loop.states)[-1]] / units.Unit("s") for s in loop.uncertain if s.name == "d"}

    def dimension(term):
        total = units.Unit("dimensionless")
        for factor in sp.Mul.make_args(term):
            if factor.is_Symbol:
                total = total * known[factor]
            elif not factor.is_number:
                total = total * known[factor.args[0]] ** F(str(factor.args[1]))
        return dict(total.dimensionality)

    for state, rate in loop.field.items():
        expected = dict((state_units[state] / units.Unit("s")).dimensionality)
        for term in sp.Add.make_args(rate):
            assert {k: F(v).limit_denominator(100) for k, v in dimension(term).items() if v} == pytest.approx(expected)


def test_super_twisting_has_the_equilibrium_where_the_integral_is_held():
    found = STA.counterexample({"k1": F(2), "k2": F(1)}, UNCERTAIN)
    assert found == {
        "parameters": {"beta": F(1), "d": F(1)},
        "point": {"e1": F(1), "e2": F(2)},
        "weights": {"++": F(1)},
    }
    assert STA.counterexample({"k1": F(2), "k2": F(11, 10)}, UNCERTAIN) is None
    assert STA.counterexample({"k1": F(0), "k2": F(1)}, UNCERTAIN) is None


small = st.fractions(-2, 2, max_denominator=8)


@given(small, small, small, small)
def test_the_third_order_law_is_held_exactly_where_the_signs_of_e2_and_e3_allow(k1, k4, k5, k6):
    # at e1 = 1 the integral falls at k4 + k5 s2 + k6 s3, s2 and s3 anywhere in [−1, 1] while e2 = e3 = 0
    gains = dict(zip(CTA3.gain_units, (k1, F(2), F(2), k4, k5, k6), strict=True))
    found = CTA3.counterexample(gains, UNCERTAIN)
    reach = abs(k5) + abs(k6)
    assert (found is not None) == (k1 != 0 and k4 - reach <= 1 and k4 + reach >= -1)
    if found is None:
        return
    assert found["point"] == {"e1": 1, "e2": 0, "e3": 0, "e4": k1}
    weights = found["weights"]
    assert len(weights) == 4
    assert sum(weights.values()) == 1
    assert min(weights.values()) >= 0
    assert {(cell[0], cell[3]) for cell in weights} == {("+", "+" if k1 > 0 else "-")}
    assert -1 <= found["parameters"]["d"] <= 1
    drift = sum(w * (-k4 - k5 * SIGN[cell[1]] - k6 * SIGN[cell[2]]) for cell, w in weights.items())
    assert drift + found["parameters"]["d"] == 0
