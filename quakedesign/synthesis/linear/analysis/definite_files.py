"""Definite matrices as files about polynomials (FORMAT.md): a sum of squares on all variables proves definiteness."""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from quakedesign.sos import Answer
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.proofs import Square, SumOfSquares
from quakedesign.sos.exact.statement import Statement
from quakedesign.synthesis.linear.analysis.inverse_optimality import InverseOptimality
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix
from quakedesign.synthesis.linear.sampled.varying_parameters import VaryingVerdict

_LARGEST = 16


def inverse_optimality_files(optimality: InverseOptimality) -> list[Answer]:
    """P and Q0 of a K that is optimal for a Q ≥ Q0 + R·D; nothing for another verdict."""
    if optimality.P is None or optimality.Q0 is None:
        return []
    return definite_files({"P": optimality.P, "Q": optimality.Q0})


def held_files(problem: LinearProblem, gains: Sequence[Fraction], verdict: VaryingVerdict) -> list[Answer]:
    """Every form, in SI, whose definiteness proves a held loop; nothing for another verdict."""
    return definite_files(verdict.proof.forms(problem, gains)) if verdict.proof is not None else []


def definite_files(forms: Mapping[str, Matrix]) -> list[Answer]:
    """Answers that together prove every matrix positive definite, each about forms in variables of their own.

    Parameters
    ----------
    forms : mapping of str to matrix (n × n)
        The variables of a form are its name with the numbers 1 … n; n at most 16.
    """
    return [_answer(group) for group in _groups(forms)]


def _groups(forms: Mapping[str, Matrix]) -> Iterator[dict[str, Matrix]]:
    """Forms in order, together of at most 16 variables."""
    group: dict[str, Matrix] = {}
    for name, matrix in forms.items():
        if group and sum(map(len, group.values())) + len(matrix) > _LARGEST:
            yield group
            group = {}
        group[name] = matrix
    if group:
        yield group


def _answer(group: Mapping[str, Matrix]) -> Answer:
    names = [f"{name}{i + 1}" for name, matrix in group.items() for i in range(len(matrix))]
    units = [tuple(int(i == j) for j in range(len(names))) for i in range(len(names))]
    polynomial: dict[tuple[int, ...], Fraction] = {}
    squares, before = [], 0
    for matrix in group.values():
        size = len(matrix)
        basis = tuple(units[before : before + size])
        for i in range(size):
            for j in range(i, size):
                place = tuple(a + b for a, b in zip(basis[i], basis[j], strict=True))
                polynomial[place] = matrix[i][j] * (1 if i == j else 2)
        gram = tuple(matrix[i][j] for i in range(size) for j in range(i, size))
        squares.append(Square(basis=basis, gram=gram))
        before += size
    asked = Statement(
        variables=tuple(names),
        polynomial={e: c for e, c in polynomial.items() if c},
        degree=2,
        multiplier=constant(len(names)),
    )
    return Answer(statement=asked, proof=SumOfSquares(squares=tuple(squares)))
