"""Elementary functions against mpmath, and the same digits in CasADi's virtual machine and in machine code."""

import ctypes
import math

import casadi as ca
import mpmath
import numpy as np
import pytest

from quakedesign.simulation import compiled as elementary
from quakedesign.simulation.compiled import (
    LANE_FLAGS,
    compiler,
    elementary_c,
    processor_flags,
    shared_library,
    verbatim,
)

COUNT = 1500
RANDOM = np.random.default_rng(4)
TINY = 10.0 ** RANDOM.uniform(-307, 0, COUNT) * RANDOM.choice([-1, 1], COUNT)
ONE = 1 + 10.0 ** RANDOM.uniform(-16, -1, COUNT) * RANDOM.choice([-1, 1], COUNT)
ALL = 10.0 ** RANDOM.uniform(-323, 308, COUNT)
TURNS = np.concatenate([RANDOM.uniform(-(2.0**31), 2.0**31, COUNT), np.arange(1, 500) * math.pi / 2])
RANGES = {
    "exp": (RANDOM.uniform(-708, 709.7, COUNT), RANDOM.uniform(-1, 1, COUNT), TINY),
    "expm1": (RANDOM.uniform(-60, 709.7, COUNT), RANDOM.uniform(-2, 2, COUNT), TINY),
    "log": (ALL, RANDOM.uniform(0.5, 2, COUNT), ONE),
    "sin": (RANDOM.uniform(-10, 10, COUNT), TURNS, TINY),
    "cos": (RANDOM.uniform(-10, 10, COUNT), TURNS, TINY),
    "tanh": (RANDOM.uniform(-23, 23, COUNT), TINY),
}
WORST = {"tanh": 2.0}
EXPONENTS = (2 / 3, 0.2, 0.75, -1 / 3, -0.4, 1.7, 1e-3)
SPECIAL = [
    0.0,
    -0.0,
    math.inf,
    -math.inf,
    math.nan,
    5e-324,
    -5e-324,
    2.0**-1022,
    1.797e308,
    1.0,
    -1.0,
    2.0**52 + 1,
    1e17,
]


def evaluated(function, *arguments):
    """Values by CasADi's virtual machine."""
    with verbatim():
        symbols = [ca.SX.sym("x") for _ in arguments]
        whole = ca.Function("f", symbols, [function(*symbols)])
    return whole.map(len(arguments[0]))(*(np.asarray(a)[None] for a in arguments)).full().ravel()


def errors(values, exact, *arguments):
    """Of values, in units in the last place of the exact ones."""
    with mpmath.workprec(200):
        true = [exact(*map(mpmath.mpf, map(float, pair))) for pair in zip(*arguments, strict=True)]
        return [float(abs(v - t) / mpmath.mpf(np.spacing(abs(float(t))))) for v, t in zip(values, true, strict=True)]


@pytest.mark.parametrize("name", RANGES)
def test_errors_are_within_the_unit_in_the_last_place(name):
    x = np.concatenate(RANGES[name])
    assert max(errors(evaluated(getattr(elementary, name), x), getattr(mpmath, name), x)) < WORST.get(name, 1.0)


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_errors_of_powers_are_within_one_and_a_half_units_in_the_last_place(exponent):
    x = np.concatenate([ALL[:COUNT] ** min(1.0, 1 / abs(exponent)), RANDOM.uniform(0.5, 2, COUNT)])
    a = np.full_like(x, exponent)
    inside = (x > 0) & (np.abs(np.log2(x) * exponent) < 1020)
    found = evaluated(lambda x: elementary.power(x, ca.SX(exponent)), x[inside])
    assert max(errors(found, mpmath.power, x[inside], a[inside])) < 1.5


@pytest.mark.parametrize("x", [ALL, 10.0 ** RANDOM.uniform(-323, -307, COUNT), RANDOM.uniform(0.125, 8, 8 * COUNT)])
def test_the_power_of_a_third_is_the_cube_root_within_two_thirds_of_a_unit(x):
    found = evaluated(lambda x: elementary.power(x, ca.SX(1 / 3)), x)
    assert max(errors(found, mpmath.cbrt, x)) < 0.65
    assert evaluated(elementary.power, x, np.full_like(x, 1 / 3)).tolist() == found.tolist()


def test_cube_roots_of_cubes_are_exact():
    cubes = np.arange(1.0, 2000.0) ** 3
    assert evaluated(elementary.cube_root, cubes).tolist() == np.arange(1.0, 2000.0).tolist()


def test_what_is_near_a_cube_root_has_seventeen_bits_and_a_cube_within_a_tenth():
    x = np.concatenate([10.0 ** RANDOM.uniform(-307, 308, COUNT), 2.0 ** np.arange(-1022, 1024), np.ones(1)])
    near = evaluated(elementary.near_cube_root, x)
    mantissas = np.frexp(near)[0] * 2.0**17
    assert np.array_equal(mantissas, np.floor(mantissas))
    assert np.max(np.abs(1 - near / x * near * near)) < float(elementary._RESIDUAL)


def test_values_at_the_ends_are_those_of_the_definition():
    inf, nan = math.inf, math.nan
    ends = {
        "exp": (1.0, inf, 0.0, nan),
        "expm1": (0.0, inf, -1.0, nan),
        "log": (-inf, inf, nan, nan),
        "sin": (0.0, nan, nan, nan),
        "cos": (1.0, nan, nan, nan),
        "tanh": (0.0, 1.0, -1.0, nan),
        "floor": (0.0, inf, -inf, nan),
    }
    for name, expected in ends.items():
        found = evaluated(getattr(elementary, name), [0.0, inf, -inf, nan])
        assert np.array_equal(found, expected, equal_nan=True), name
    assert evaluated(elementary.exp, [710.0, -746.0]).tolist() == [inf, 0.0]


def test_powers_at_the_ends_are_those_of_python():
    bases, exponents = [0.0, 2.0, math.inf, 0.5, -2.0, -3.0], [0.0, 1 / 3, 1.5, 2.0, 3.0, 101.0]
    x, a = (m.ravel() for m in np.meshgrid(bases, exponents))
    kept = ~((x < 0) & (a != np.floor(a)))
    found = evaluated(elementary.power, x, a)
    exact = np.array([b**e for b, e in zip(x[kept].tolist(), a[kept].tolist(), strict=True)])
    assert np.allclose(found[kept], exact, rtol=2e-14, atol=0)
    assert np.isnan(found[~kept]).all()
    known = [evaluated(lambda x, e=e: elementary.power(x, ca.SX(e)), bases) for e in exponents]
    assert np.array_equal(np.concatenate(known), found, equal_nan=True)
    assert evaluated(elementary.power, [0.0, math.inf], [-0.5, -0.5]).tolist() == [math.inf, 0.0]
    assert np.isnan(evaluated(elementary.power, [math.nan, 2.0], [0.5, math.nan])).all()


def test_larger_smaller_and_floor_are_those_of_the_field():
    x, y = (m.ravel() for m in np.meshgrid(SPECIAL, [*SPECIAL, 2.5, -2.5]))
    assert np.array_equal(evaluated(elementary.fmax, x, y), np.fmax(x, y), equal_nan=True)
    assert np.array_equal(evaluated(elementary.fmin, x, y), np.fmin(x, y), equal_nan=True)
    z = np.array([2.5, -2.5, 2.0, -2.0, 2.0**51 + 0.5, -(2.0**51) - 0.5, 1e300, 0.999])
    assert evaluated(elementary.floor, z).tolist() == np.floor(z).tolist()


def test_powers_of_two_are_exact_in_the_virtual_machine():
    n = np.arange(-1022.0, 1024.0)
    assert evaluated(elementary.two_to, n).tolist() == np.ldexp(1.0, n.astype(int)).tolist()


NAMES = (*RANGES, "floor")
MANY = "".join(
    f"\nEXPORTED void many_{name}(const double* x, double* y, int n) {{"
    f" int i; for (i = 0; i < n; ++i) y[i] = portable_{name}(x[i]); }}"
    for name in NAMES
)
POWERS = """
EXPORTED void many_power(const double* x, const double* a, double* y, int n) {
  int i;
  for (i = 0; i < n; ++i) y[i] = portable_power(x[i], a[i]);
}
"""


@pytest.mark.parametrize("flags", [(), ("-mavx2",), processor_flags(compiler())], ids=["baseline", "avx2", "widest"])
def test_machine_code_has_the_digits_of_the_virtual_machine(flags, tmp_path):
    text = elementary_c() + MANY + POWERS
    library = ctypes.CDLL(str(shared_library(text, tmp_path, compiler(), (*LANE_FLAGS, *flags))))
    x = np.concatenate([SPECIAL, TINY, ALL, -ALL, TURNS, RANDOM.uniform(-800, 800, COUNT)])
    a = RANDOM.uniform(-3, 3, len(x))
    a[::3], a[1::3] = 1 / 3, np.round(a[1::3])
    for name in (*NAMES, "power"):
        given = (x, a) if name == "power" else (x,)
        found, expected = np.empty_like(x), evaluated(getattr(elementary, name), *given)
        getattr(library, f"many_{name}")(*(ctypes.c_void_p(v.ctypes.data) for v in (*given, found)), len(x))
        number = ~np.isnan(expected)
        assert found[number].tobytes() == expected[number].tobytes(), name
        assert np.isnan(found[~number]).all()
