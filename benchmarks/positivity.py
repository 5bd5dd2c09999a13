"""Sums of squares side by side: this engine, Drake and SumOfSquares.py in floating point, triples for exact proofs.

Run with ``python benchmarks/positivity.py`` after ``pip install -e '.[benchmark]'``; a few minutes. Every tool gets the
same SymPy Poly and is timed from its terms to the answer, in one process, one thread, best of several.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import random
import sys
from collections.abc import Callable
from fractions import Fraction
from time import perf_counter
from typing import Any

import sympy as sp

from quakedesign import sos
from quakedesign.sos.exact.statement import statement
from quakedesign.sos.solve.membership import Membership

REPEATS = 5


def quartic(variables: int, seed: int) -> tuple[sp.Poly, tuple[sp.Symbol, ...]]:
    """Random quartic that is a sum of squares: a sum of random squares plus a positive multiple of |m|²."""
    x = sp.symbols(f"x1:{variables + 1}")
    rng = random.Random(seed)
    basis = sorted(sp.itermonomials(x, 2), key=sp.default_sort_key)
    squares = [sp.Poly(sum(rng.randint(-3, 3) * m for m in basis), *x) ** 2 for _ in range(variables)]
    return sum(squares, start=sp.Poly(sum(m**2 for m in basis), *x)), x


def motzkin_times_square() -> tuple[sp.Poly, tuple[sp.Symbol, ...]]:
    """Motzkin's form times x² + y² + z², plus 1/1000 of its squares, so that floating point can say yes."""
    x, y, z = sp.symbols("x y z")
    form = x**4 * y**2 + x**2 * y**4 + z**6 - 3 * x**2 * y**2 * z**2
    rest = sum(m**2 for m in sp.itermonomials((x, y, z), 4, 4)) / sp.Integer(1000)
    return sp.Poly(form * (x**2 + y**2 + z**2) + rest, x, y, z), (x, y, z)


def ours_first(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Model and solve from nothing."""
    asked = statement(tuple(map(str, x)), exact(p))
    return Membership(asked).margin(asked.polynomial) > -1e-7


def exact(p: sp.Poly) -> dict[tuple[int, ...], Fraction]:
    """Terms of a polynomial."""
    return {e: Fraction(int(c.p), int(c.q)) for e, c in p.terms()}


def ours_exact(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Proof in rational arithmetic, checked."""
    answer = sos.prove(exact(p), variables=x)
    return str(answer.verdict) == "sos" and answer.check()


def drake(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Drake with Clarabel."""
    from pydrake.solvers import ClarabelSolver, MathematicalProgram
    from pydrake.symbolic import Monomial, Polynomial

    program = MathematicalProgram()
    v = program.NewIndeterminates(len(x), "x")
    terms = {Monomial(dict(zip(v, e, strict=True))): float(c) for e, c in p.terms()}
    program.AddSosConstraint(Polynomial(terms))
    return bool(ClarabelSolver().Solve(program).is_success())


def sum_of_squares_py(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """SumOfSquares.py with CVXOPT, the solver that it brings."""
    from SumOfSquares import SOSProblem

    problem = SOSProblem()
    problem.add_sos_constraint(p.as_expr(), list(x))
    problem.solve(solver="cvxopt")
    return True


def triples(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Exact proof by triples."""
    from triples import sum_of_squares

    return sum_of_squares(p.as_expr()) is not None


def best(action: Callable[[], bool], repeats: int = REPEATS) -> float | None:
    """Shortest of several timings [s], None if the tool finds nothing or fails."""
    times = []
    for _ in range(repeats):
        began = perf_counter()
        try:
            if not action():
                return None
        except Exception as error:
            print(f"    {type(error).__name__}: {str(error)[:80]}", file=sys.stderr)
            return None
        times.append(perf_counter() - began)
    return min(times)


def repeated(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> tuple[float, float]:
    """Time of one more margin of the same shape, and of the solver inside it [s]."""
    asked = statement(tuple(map(str, x)), exact(p))
    membership = Membership(asked)
    membership.margin(asked.polynomial)
    began = perf_counter()
    membership.margin(asked.polynomial)
    return perf_counter() - began, membership.solver_seconds


def show(name: str, times: dict[str, float | None]) -> None:
    """One line: seconds of ours, ratios of ours to the others."""
    own = times["ours"]
    others = "  ".join(
        f"{tool} {'failed' if t is None else f'{t * 1e3:.1f} ms, ratio {own / t:.2f}'}" if own else f"{tool} {t}"
        for tool, t in times.items()
        if tool != "ours"
    )
    print(f"{name:34} ours {'failed' if own is None else f'{own * 1e3:.1f} ms'}  {others}", flush=True)


def main() -> None:
    """Print the table."""
    cases: list[tuple[str, Any]] = [(f"random quartic, {n} variables", quartic(n, n)) for n in range(3, 7)]
    cases.append(("Motzkin times a square", motzkin_times_square()))
    print("Floating point, build and solve (below 1: ours is faster)")
    for name, (p, x) in cases:
        tools = {"ours": ours_first, "Drake": drake, "SumOfSquares.py": sum_of_squares_py}
        show(name, {tool: best(lambda f=f, p=p, x=x: f(p, x)) for tool, f in tools.items()})
    print("Repeated solve of one shape: time beyond the solver's own")
    octic = (quartic(4, 9)[0] ** 2, quartic(4, 9)[1]) if "--octic" in sys.argv else cases[2][1]
    for name, (p, x) in (*cases, ("octic, 4 variables" if "--octic" in sys.argv else "again", octic)):
        whole, inside = repeated(p, x)
        beyond = whole - inside
        print(f"{name:34} {whole * 1e3:.1f} ms, of which solver {inside * 1e3:.1f} ms: beyond {beyond * 1e3:.2f} ms")
    print("Exact proofs (at most 0.2: five times faster)")
    for name, (p, x) in cases:
        tools = {"ours": ours_exact, "triples": triples}
        show(name, {tool: best(lambda f=f, p=p, x=x: f(p, x), 2) for tool, f in tools.items()})


if __name__ == "__main__":
    main()
