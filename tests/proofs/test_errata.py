"""Every point of the errata is computed, and a wrong correction is found out."""

import ast
import time
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from thinned import few

from quakedesign.studies.errata import KINDS, errata_folder, errata_rows, find_rows, run_rows

ROWS = {row.number: row for row in errata_rows()}


def source(number):
    """Names of the file that holds a row."""
    return ROWS[number].check.__globals__


def test_every_point_of_the_table_is_there_once():
    assert [row.number for row in errata_rows()] == list(range(1, 30))


@pytest.mark.parametrize("number", range(1, 30))
def test_a_row_says_what_is_printed_what_is_correct_and_how_it_is_checked(number):
    row = ROWS[number]
    assert row.kind in KINDS
    assert row.printed != row.correct
    assert all(text.strip() == text != "" and "\n" not in text for text in (row.printed, row.correct))
    assert row.check.__doc__


DEAR = (21,)
EACH = [pytest.param(n, marks=[pytest.mark.slow] * (n in DEAR)) for n in range(1, 30)]


@pytest.mark.parametrize("number", EACH)
def test_the_corrected_form_holds_with_numbers_within_seconds(number):
    began = time.process_time()
    (result,) = run_rows([number])
    assert time.process_time() - began < 10
    assert result["holds"] is True, result["evidence"]
    assert any(character.isdigit() for character in result["evidence"])
    assert "\n" not in result["evidence"]
    assert result["seconds"] > 0


def without_control_in_the_rate(values):
    """h' in which the control's own contribution is forgotten."""
    return source(16)["correct_rate"](values | {"x2'": 0})


WRONG = {
    1: lambda: {"entries": source(1)["printed_entries"]},
    2: lambda: {"unstable": lambda determinant, trace: (determinant < 0) & (trace > 0)},
    3: lambda: {"power": -1},
    4: lambda: {"constant": 6.07},
    5: lambda: {"exponent": Fraction(1, 3)},
    6: lambda: {"load": source(6)["LOAD"] * 0.9},
    7: lambda: {"bound": lambda g1, g2, split: np.outer([g1, g2, 0, 0], [g1, g2, 0, 0])},
    8: lambda: {"rest": lambda mu, N, sigma, k, r0, start, phi: -((start - mu) * N * sigma + phi) / (mu * N)},
    9: lambda: {"nominal": Fraction("0.2353") / 12_500_000},
    10: lambda: {"rate_load": 0.0},
    11: lambda: {"bound": lambda g1, g2, x1, x2: abs(g1 * x1 + g2 * x2)},
    12: lambda: {"friction": source(12)["printed_law"]},
    13: lambda: {"slowest": "1e-25"},
    14: lambda: {"order": 1.0},
    15: lambda: {"amplitude": 3.2e-6},
    16: lambda: {"rate": without_control_in_the_rate},
    17: lambda: {"smoothness": {"e1": 1, "e2": 1, "e3": 1}},
    18: lambda: {"vertices": 2},
    19: lambda: {"sign": -1},
    20: lambda: {"xi_factor": lambda by, law: by["slip"] * by["time"]},
    21: lambda: {"widths": (1, 100)},
    22: lambda: {"said": source(22)["RADII"] | {"lab-fault": ((0.99, 1.1), (2.01, 0.699))}},
    23: lambda: {"slip": 0.020},
    24: lambda: {"residual": lambda k, v, t: 0},
    25: lambda: {"lab": tuple(Fraction(v) for v in ("4.17e8", "6.94e5", "4.17e7", "1.39e5"))},
    26: lambda: {"rest": (7.5e-3, 0.785)},
    27: lambda: {"rates": (-0.060, -0.010)},
    28: lambda: {"residual": lambda bend, rate, k4: 0.0},
    29: lambda: {"feedback": "state"},
}


@few("number", EACH, every=3)
def test_another_form_in_place_of_the_corrected_one_fails(number):
    assert ROWS[number].check(**WRONG[number]()).holds is False


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "near"),
    [
        (1, lambda: {"entries": lambda k, eta, N, s, a, b: (-k - N * s["with p"] * a, -eta + N * s["with p"] * b)}),
        (5, lambda: {"exponent": Fraction(501, 1000)}),
        (7, lambda: {"bound": lambda g1, g2, w: 0.99 * source(7)["diagonal_bound"](g1, g2, w)}),
        (8, lambda: {"rest": lambda mu, *a: source(8)["correct_rest_pressure"](mu, *a) * sp.Rational(999, 1000)}),
        (16, lambda: {"rate": lambda v: source(16)["correct_rate"](v | {"h": 0})}),
        (20, lambda: {"xi_factor": lambda by, law: by["p"]}),
        (24, lambda: {"residual": lambda k, v, t: 2 * k * v * t}),
        (26, lambda: {"rest": (7.1e-3, 0.7846)}),
        (27, lambda: {"rates": (0.061, 0.010)}),
        (28, lambda: {"residual": lambda bend, rate, k4: -bend * rate**2 / k4 / 2}),
    ],
)
def test_a_form_that_is_nearly_right_fails_too(number, near):
    assert ROWS[number].check(**near()).holds is False


@pytest.mark.slow
def test_the_switched_loop_grows_in_a_plain_integration_as_well():
    """Explicit Euler over the switching of row 7, without matrix exponentials, meets the factor 48 within 60 s."""
    module, step = source(7), 1e-4
    A = module["open_loop"](1, 0.1)
    K, _ = module["answer"](A, 1, 1e-4 * np.eye(4) + np.outer([1, 1, 0, 0], [1, 1, 0, 0]))
    soft, stiff = (module["closed"](A, 1, K, -stiffness, 1) for stiffness in (-1, 1))
    x, grown = np.array([1.0, 0, 0, 0]), 1.0
    for n in range(int(60 / step)):
        matrix = soft if (n * step) % (module["SOFT"] + module["STIFF"]) < module["SOFT"] else stiff
        x = x + step * (matrix @ x)
        grown = max(grown, float(np.linalg.norm(x)))
    assert grown > 48


def test_the_point_of_the_dia_row_agrees_with_finite_differences_of_the_lyapunov_function():
    gamma, k1, k2, k3 = 2.01, 2.0, 5.0, 1.44e-4

    def V(e1, e2, e3):
        f3 = e3 / (k1**0.5 * k2)
        f1 = e1 - f3**3
        return 0.6 * gamma * abs(f1) ** (5 / 3) + f1 * e2 + 0.4 * k1**-1.5 * abs(e2) ** 2.5 + abs(f3) ** 5 / 5

    e1, e2, e3 = 1.2, 0.2, k1**0.5 * k2
    force = 1.425 * (e3 - k2 * (e2**1.5 + k1**1.5 * e1) ** (1 / 3))
    h = 1e-6
    ahead, behind = (V(e1 + s * h * e2, e2 + s * h * force, e3 - s * h * k3) for s in (1, -1))
    assert source(27)["dia_rate"](np.array([0.2, 0.2, 1.0]), 1.425, gamma) == pytest.approx(
        (ahead - behind) / (2 * h), abs=1e-8
    )


def test_the_checks_use_no_semidefinite_solver_and_need_no_compiler():
    paths = sorted(errata_folder().glob("*.py"))
    assert len(paths) > 1
    for path in paths:
        names = {
            alias.name.split(".")[0]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.Import)
            for alias in node.names
        }
        assert not names & {"cvxpy", "clarabel", "numba", "subprocess"}


def test_the_checks_lie_in_the_folder_of_proofs():
    assert errata_folder().parts[-2:] == ("proofs", "errata")
    assert len(find_rows()) == 29
