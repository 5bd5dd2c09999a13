"""Sums of squares side by side: this engine, Drake and SumOfSquares.py in floating point, triples for exact proofs.

Run with ``python benchmarks/positivity.py`` after ``pip install -e '.[benchmark]'``; four minutes. Every tool gets the
same SymPy Poly and is timed from its terms to its answer, in one process with one thread, in seconds of the processor.
Ours and the other take turns; what is printed is the median of the ratios of the turns.

*Drake* is asked as its manual does, for any Gram matrix, with Clarabel and that solver's own accuracy, 1e-8; *Drake,
margin* is asked what ours answers, the largest t for which p - t Σ m² is a sum of squares, m the monomials of the Gram
matrix. Ours says yes where its t is positive, the others where they are told that the solver succeeded.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import random
import sys
from collections.abc import Callable
from fractions import Fraction
from statistics import median
from time import perf_counter, process_time
from typing import Any

import sympy as sp

from quakedesign import sos
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.solve.program import Membership

TURNS, SECONDS = 31, 10.0  # of the processor, after which no further turn begins


Tool = Callable[[sp.Poly, tuple[sp.Symbol, ...]], bool]


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
    """Largest margin, modelled and solved from nothing."""
    asked = statement(tuple(map(str, x)), exact(p))
    return Membership(asked).margin(asked.polynomial) > 0


def exact(p: sp.Poly) -> dict[tuple[int, ...], Fraction]:
    """Terms of a polynomial."""
    return {e: Fraction(int(c.p), int(c.q)) for e, c in p.terms()}


def ours_exact(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Proof in rational arithmetic, checked."""
    answer = sos.prove(exact(p), variables=x)
    return str(answer.verdict) == "sos" and answer.check()


def drake(p: sp.Poly, x: tuple[sp.Symbol, ...], *, margin: bool = False) -> bool:
    """Drake with Clarabel: any Gram matrix, or the largest margin."""
    from pydrake.solvers import ClarabelSolver, MathematicalProgram
    from pydrake.symbolic import Monomial, Polynomial

    program = MathematicalProgram()
    v = program.NewIndeterminates(len(x), "x")
    terms: dict[Any, Any] = {Monomial(dict(zip(v, e, strict=True))): float(c) for e, c in p.terms()}
    if margin:
        (t,) = program.NewContinuousVariables(1, "t")
        squares = [Monomial(dict(zip(v, e, strict=True))) for e in p.monoms() if not any(n % 2 for n in e)]
        terms |= {square: terms[square] - t for square in squares}
        program.AddLinearCost(-t)
    program.AddSosConstraint(Polynomial(terms))
    result = ClarabelSolver().Solve(program)
    return bool(result.is_success()) and (not margin or result.GetSolution(t) > 0)


def drake_margin(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Drake with Clarabel, asked for the largest margin."""
    return drake(p, x, margin=True)


def sum_of_squares_py(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """SumOfSquares.py with CVXOPT, the solver that it brings."""
    from SumOfSquares import SOSProblem

    problem = SOSProblem()
    problem.add_sos_constraint(p.as_expr(), list(x))
    return str(problem.solve(solver="cvxopt").primalStatus) == "optimal"


def triples(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> bool:
    """Exact proof by triples."""
    from triples import sum_of_squares

    return sum_of_squares(p.as_expr()) is not None


def timed(action: Callable[[], bool]) -> float:
    """Time of one answer [s of the processor].

    Raises
    ------
    RuntimeError
        When the tool does not say yes.
    """
    began = process_time()
    yes = action()
    seconds = process_time() - began
    if not yes:
        raise RuntimeError("no yes")
    return seconds


def turns(ours: Callable[[], bool], other: Callable[[], bool]) -> list[tuple[float, float]]:
    """Times of ours and of the other in turn, after one of each that does not count."""
    spent, pairs = timed(ours) + timed(other), list[tuple[float, float]]()
    while len(pairs) < TURNS and (len(pairs) < 3 or spent < SECONDS):
        pairs.append((timed(ours), timed(other)))
        spent += sum(pairs[-1])
    return pairs


def repeated(p: sp.Poly, x: tuple[sp.Symbol, ...]) -> tuple[float, float]:
    """Time of one more margin of the same shape, and of the solver inside it [s]."""
    asked = statement(tuple(map(str, x)), exact(p))
    membership = Membership(asked)
    membership.margin(asked.polynomial)
    began = perf_counter()
    membership.margin(asked.polynomial)
    return perf_counter() - began, membership.solver_seconds


def show(name: str, ours: Tool, others: dict[str, Tool], p: sp.Poly, x: tuple[sp.Symbol, ...]) -> None:
    """One line: medians of ours [ms], of every other tool [ms], and of the ratios of ours to it."""
    told = []
    for tool, other in others.items():
        try:
            pairs = turns(lambda: ours(p, x), lambda other=other: other(p, x))
        except Exception as error:
            told.append(f"{tool} failed ({type(error).__name__}: {str(error)[:60]})")
            continue
        own, theirs = (median(times) * 1e3 for times in zip(*pairs, strict=True))
        ratio = median(a / b for a, b in pairs)
        told.append(f"{tool} {own:.1f} / {theirs:.1f} ms, ratio {ratio:.2f} of {len(pairs)}")
    print(f"{name:26} {'; '.join(told)}", flush=True)


def main() -> None:
    """Print the table."""
    cases: list[tuple[str, Any]] = [(f"random quartic, {n} variables", quartic(n, n)) for n in range(3, 7)]
    cases.append(("Motzkin times a square", motzkin_times_square()))
    print("Floating point, build and solve (below 1: ours is faster)")
    for name, (p, x) in cases:
        show(
            name,
            ours_first,
            {"Drake": drake, "Drake, margin": drake_margin, "SumOfSquares.py": sum_of_squares_py},
            p,
            x,
        )
    print("Repeated solve of one shape: time beyond the solver's own")
    octic = (quartic(4, 9)[0] ** 2, quartic(4, 9)[1]) if "--octic" in sys.argv else cases[2][1]
    for name, (p, x) in (*cases, ("octic, 4 variables" if "--octic" in sys.argv else "again", octic)):
        whole, inside = repeated(p, x)
        beyond = whole - inside
        print(f"{name:34} {whole * 1e3:.1f} ms, of which solver {inside * 1e3:.1f} ms: beyond {beyond * 1e3:.2f} ms")
    print("Exact proofs (at most 0.2: five times faster)")
    for name, (p, x) in cases:
        show(name, ours_exact, {"triples": triples}, p, x)


if __name__ == "__main__":
    main()
