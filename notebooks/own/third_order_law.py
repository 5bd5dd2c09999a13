"""User-defined homogeneous control law: a third-order sliding mode with nested signed powers."""

import sympy as sp

from quakedesign.symbolic import SignedPower

x1, x2, x3 = sp.symbols("x1 x2 x3", real=True)
k1, k2, k3 = sp.symbols("k1 k2 k3", positive=True)

inner = SignedPower(x2, sp.Rational(3, 2)) + k1 * x1
outer = SignedPower(x3, 2) + k2 * SignedPower(inner, sp.Rational(2, 3))

states = (x1, x2, x3)
field = {x1: x2, x2: x3, x3: -k3 * SignedPower(outer, 0)}
