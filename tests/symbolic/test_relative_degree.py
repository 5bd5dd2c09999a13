"""Relative degrees of chains whose control acts where it is put, of every law and of the plant."""

from itertools import pairwise

import pytest
import sympy as sp

from quakedesign.laws import control_laws, laws
from quakedesign.symbolic.homogeneity import relative_degree

u = sp.Symbol("u", real=True)


@pytest.mark.parametrize("length", [1, 2, 3, 4])
def test_a_chain_of_n_integrators_has_degree_n_and_less_for_its_later_states(length):
    states = sp.symbols(f"x1:{length + 1}", real=True)
    field = {**dict(pairwise(states)), states[-1]: states[0] ** 2 + u}
    assert [relative_degree(x, field, u) for x in states] == list(range(length, 0, -1))


def test_a_control_that_cancels_or_never_acts_has_none():
    x, y, z = sp.symbols("x y z", real=True)
    assert relative_degree(x, {x: y + z, y: u, z: -u}, u) is None
    assert relative_degree(x, {x: -x, y: u}, u) is None
    assert relative_degree(x + y, {x: y, y: z, z: u}, u) == 2


def test_every_law_for_a_fault_has_the_degree_of_the_slip_and_every_chain_its_order():
    beta = sp.Symbol("beta", real=True)
    found = {}
    for name, law in laws().items():
        model = law.loop_field()
        found[name] = relative_degree(next(iter(model.states)), model.field, beta)
    assert {found[name] for name in control_laws()} == {2}
    assert {name: law.order for name, law in laws().items() if hasattr(law, "order")}.items() <= found.items()
