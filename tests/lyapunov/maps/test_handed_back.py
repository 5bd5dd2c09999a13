"""The cvxpy problems of searches: handed back on request, solved again and extended like any other."""

import cvxpy as cp
import pytest

import quakedesign as qd
from quakedesign.lyapunov.maps.gain_map import gain_map


def test_a_certificate_comes_with_its_programmes():
    with qd.stated_problems() as problems:
        verdict, _ = qd.certify("super-twisting", ("1.5", "1.1"), lipschitz="0.9")
    assert str(verdict) == "proved"
    largest = max(problems, key=lambda p: p.param_dict["parts"].shape[0])
    margin = largest.value
    assert largest.solve(solver="CLARABEL", canon_backend="COO") == pytest.approx(margin, abs=1e-7)
    # from its side a constraint of the programme is a freedom of V: it can only have a larger margin
    fewer = cp.Problem(largest.objective, [*largest.constraints, largest.var_dict["moments"][0] == 0])
    assert fewer.solve(solver="CLARABEL", canon_backend="COO") > margin - 1e-7


def test_searches_that_would_use_processes_hand_back_theirs():
    with qd.stated_problems() as of_gains:
        found = qd.synthesise("super-twisting", degrees=(4,), starts=1, workers=2, compare=False)
    with qd.stated_problems() as of_map:
        region = gain_map(
            "super-twisting", ("1.5", "1.1"), ("k1", "k2"), points=2, levels=("0.5",), degree=4, interior=1
        )
    assert found is not None
    assert region is not None
    assert any("rows" in problem.param_dict or "parts" in problem.param_dict for problem in of_gains)
    assert any("numbers" in problem.param_dict for problem in of_map)
    assert all(problem.status == "optimal" for problem in (*of_gains, *of_map))
