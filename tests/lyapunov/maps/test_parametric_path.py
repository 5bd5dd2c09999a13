"""Paths through a sweep against the margins of Clarabel, and the bounds that they decide by."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.lyapunov.maps import gain_map as maps
from quakedesign.lyapunov.maps import gain_map as workers
from quakedesign.lyapunov.maps import sweep as paths
from quakedesign.lyapunov.maps.gain_map import Screener
from quakedesign.lyapunov.maps.sweep import Path, Sweep
from quakedesign.sos.solve.conic import Compiled
from quakedesign.sos.solve.moment import MomentProgram

SHEETS = {
    "super-twisting": (("1.5", "1.1"), ("k1", "k2"), (("0.3", "3"), ("0.8", "5")), 8, ("0.5", "1"), 6),
    "cta": (("7", "5", "2.3", "1.1"), ("k1", "k2"), None, 5, ("0.3", "1"), 5),
    "dia": (("25/16", "27/5", "6/5", "0"), ("kI1", "kI2"), None, 3, ("0.3", "0.9"), 5),
}


def sheet_of(law):
    gains, over, ranges, points, levels, degree = SHEETS[law]
    return maps._sheet(law, gains, over, ranges, points, levels, (1, 1), degree)


def loops(sheet):
    return [sheet.at(place, level) for row in sheet.rows for place in row for level in (1, 2)]


@pytest.mark.slow
@pytest.mark.parametrize("law", SHEETS)
def test_the_sign_is_that_of_the_margin_that_a_solver_finds(law):
    every = loops(sheet_of(law))
    sweep = Sweep(every[0], SHEETS[law][-1])
    path = Path(sweep, sweep.frame(every[0]))
    answers = [path.feasible(loop) for loop in every]
    assert {True, False} <= set(answers)
    assert sum(answer is None for answer in answers) <= 0.1 * len(every)
    for loop, answer in list(zip(every, answers, strict=True))[:: 3 if law == "dia" else 1]:
        solved = sweep.solve(loop, path.frame)
        assert answer in (None, solved.feasible) or abs(solved.margin) < 1e-9


def test_a_path_leaves_shapes_alone_that_others_share():
    """Two threads would else ask one solver at once, and its digits would depend on what it was asked before."""
    sheet = sheet_of("super-twisting")
    every = loops(sheet)
    sweep = Sweep(every[0], sheet.degree)
    frame = sweep.frame(every[0])
    assert Path(sweep, frame).feasible(every[0]) is not None
    assert [shape._solver for shape in sweep.cones(frame).shapes] == [None] * len(sweep.cones(frame).shapes)


def test_both_bounds_hold_wherever_a_step_has_them(monkeypatch):
    every = loops(sheet_of("super-twisting"))
    sweep = Sweep(every[0], 6)
    path, steps, honest = Path(sweep, sweep.frame(every[0])), [], paths._Newton._refined

    def noted(self, *given):
        step = honest(self, *given)
        steps.append(step)
        ends = [f + d for f, d in zip(self._centre.functionals, step.moves, strict=True)]
        shares = [np.tensordot(c, f, axes=((0, 1), (0, 1))) for c, f in zip(self._tables, ends, strict=True)]
        assert step.residual >= 0.9 * np.abs(sum(shares) - np.eye(len(self._means))[0] - step.bound * self._means).max()
        return step

    monkeypatch.setattr(paths._Newton, "_refined", noted)
    reached = bounds = 0
    for loop in every[::7]:
        steps.clear()
        path.feasible(loop)
        margin = sweep.solve(loop, path.frame).margin
        for step in steps:
            if step.most < 1:
                reached += 1
                assert -step.tau * step.multipliers[0] <= margin + 1e-9
            if step.least > -1:
                bounds += 1
                assert step.bound >= margin - 1e-9
    assert min(reached, bounds) > 20


def test_a_bound_counts_only_where_it_holds_and_beyond_what_its_equations_are_missed_by():
    given = {"tau": 1.0, "moves": (), "least": -0.5, "most": 0.5, "residual": 1e-6}
    found = lambda **other: paths._Step(**given | other).feasible  # noqa: E731
    assert found(multipliers=np.array([-1e-3]), bound=2.0) is True
    assert found(multipliers=np.array([-1e-3]), bound=2.0, most=1.5) is None
    assert found(multipliers=np.array([-1e-3]), bound=2.0, residual=1e-3) is None
    assert found(multipliers=np.array([-4e-10]), bound=2.0, residual=0.0) is None
    assert found(multipliers=np.array([1e-3]), bound=-1e-3) is False
    assert found(multipliers=np.array([1e-3]), bound=-1e-3, least=-1.5) is None
    assert found(multipliers=np.array([1e-3]), bound=-1e-3, residual=1e-3) is None


def test_a_row_does_not_depend_on_the_rows_before(monkeypatch):
    sheet, taken = sheet_of("super-twisting"), []
    honest = paths._Newton.step
    monkeypatch.setattr(paths._Newton, "step", lambda self: taken.append(self._centre.tau) or honest(self))

    def steps_of(screener, row):
        taken.clear()
        return screener.row(row), list(taken)

    used = Screener(sheet)
    used.row(sheet.rows[0])
    assert steps_of(used, sheet.rows[5]) == steps_of(Screener(sheet), sheet.rows[5])


def test_a_certificate_does_not_depend_on_what_was_screened_before(monkeypatch):
    """Who computes which row of a map is a matter of chance, and a solver that goes on has other last digits."""
    sheet, begun, honest = sheet_of("cta"), [], Compiled.solve
    monkeypatch.setattr(
        Compiled, "solve", lambda self, *told, anew=True: begun.append(anew) or honest(self, *told, anew=anew)
    )
    screener = Screener(sheet)
    screener.row(sheet.rows[0])
    begun.clear()
    assert screener.proof((2, 2), 1)[2] is not None
    assert begun
    assert all(begun)


@pytest.mark.slow
def test_neighbours_help(monkeypatch):
    every, counted = loops(sheet_of("super-twisting")), []
    sweep = Sweep(every[0], 6)
    honest = paths._Newton.step
    monkeypatch.setattr(paths._Newton, "step", lambda self: counted.append(1) or honest(self))
    path = Path(sweep, sweep.frame(every[0]))

    def steps(begin):
        counted.clear()
        for loop in every[:32]:
            begin()
            path.feasible(loop)
        return len(counted)

    assert 2 * steps(lambda: None) < steps(lambda: path.begin(path.frame))


def test_a_solver_decides_where_no_path_does(monkeypatch):
    sheet = sheet_of("super-twisting")
    row = sheet.rows[3]
    told, _ = Screener(sheet).row(row)
    monkeypatch.setattr(Path, "feasible", lambda self, loop: None)
    alone, solves = Screener(sheet).row(row)
    assert alone == told
    assert solves >= len([limit for _, limit, _ in told if limit is None or limit > F("0.5")])
    monkeypatch.setattr(workers, "_solved", lambda sweep, loop: False)
    assert {level for _, _, level in Screener(sheet).row(row)[0]} == {0}


def test_problems_are_solved_by_cvxpy_while_they_are_handed_back(monkeypatch):
    sheet = sheet_of("super-twisting")
    monkeypatch.setattr(workers, "collecting", lambda: True)
    monkeypatch.setattr(Path, "feasible", lambda self, loop: pytest.fail("a path was asked"))
    assert Screener(sheet).row(sheet.rows[0][:2])[1] >= 2


def test_a_cone_without_interior_gives_no_answer(monkeypatch):
    every = loops(sheet_of("super-twisting"))
    sweep = Sweep(every[0], 6)
    monkeypatch.setattr(MomentProgram, "solve", lambda self, target: None)
    assert Path(sweep, sweep.frame(every[0])).feasible(every[0]) is None
