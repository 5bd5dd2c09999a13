"""Exact verification of Gram matrices from other solvers, given as arrays or in JSON or MATLAB's .mat files."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from io import BytesIO
from numbers import Real
from pathlib import Path
from time import perf_counter
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from quakedesign.errors import ParameterError, PolynomialError
from quakedesign.exact import UpperBound, rational
from quakedesign.files import Json, read_bytes
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.polynomial import Exponents, degree, full_matrix
from quakedesign.sos.exact.polynomial_statement import Statement, statement
from quakedesign.sos.exact.polynomial_text import read, read_element
from quakedesign.sos.exact.proofs import Square, SumOfSquares, as_polynomial, in_echelon_form, residual
from quakedesign.sos.exact.strict import unique
from quakedesign.sos.solve.decide import KERNELS
from quakedesign.sos.solve.engine import decide, versions
from quakedesign.sos.solve.facial_reduction import Block, at_kernels
from quakedesign.sos.solve.moment import MomentSolution
from quakedesign.sos.solve.rounding import Scaled, decimal_units, rounded, scaled
from quakedesign.text import shown

# ----------------------------------------------------------------------
# Gram matrices of other solvers: rounded and corrected exactly, or else the polynomial is decided without them.

Array = np.ndarray
Matrixed = tuple[Block, Array]
_NEAR = Fraction(1, 100)  # ratio of error to largest coefficient above which the matrix counts as wrong


def verify(
    polynomial: Any, gram: Any, basis: Any, *, on: Sequence[Any] = (), variables: Sequence[Any] | None = None
) -> Answer:
    """Exact proof from a Gram matrix in floating point, or the verdict without the matrix.

    The matrix is rounded and corrected to satisfy polynomial = bᵀQb exactly; the kernel of a singular matrix is made
    rational first. If no proof results, the polynomial is decided without the matrix, as by `prove` with
    ``products=False`` and, as ``degree_bound``, the largest degree of the polynomial, σ_0 and the products g_i·σ_i.

    Parameters
    ----------
    polynomial : str, SymPy expression or mapping of exponents to Fraction
    gram : array of float (n × n)
        Only its symmetric part is used. With constraints, a list of such arrays: for σ_0, then for the σ_i of every g_i
        ≥ 0 in polynomial = σ_0 + Σ g_i·σ_i.
    basis : sequence of n str, SymPy expressions or tuples of exponents
        Monomials or any polynomials; with constraints, a list of such sequences.
    on : sequence of str or SymPy relation, optional
        Inequalities of the set; ℝⁿ by default.
    variables : sequence of str or Symbol, optional
        Order of the variables in exponents; by default in order of appearance in the polynomial.

    Returns
    -------
    Answer
        Its ``remark`` states whether the matrix was used.

    Raises
    ------
    PolynomialError
        When an input is not readable, a constraint is an equality or occurs twice, the numbers of matrices or bases are
        wrong, the sizes of matrix and basis differ, or a basis is linearly dependent.
    """
    start = perf_counter()
    names, exact, inequalities, equalities, _ = read(polynomial, on, None, variables)
    if equalities:
        raise PolynomialError("constraints of a given proof must be inequalities. Received an equality. Use prove.")
    if len({frozenset(g.items()) for g in inequalities}) < len(inequalities):
        raise PolynomialError(
            "an inequality is given twice: give it once, with the sum of its Gram matrices in a common basis."
        )
    grams, bases = (_listed(gram), _listed(basis)) if inequalities else ([gram], [basis])
    if not len(grams) == len(bases) == 1 + len(inequalities):
        raise PolynomialError(
            f"{1 + len(inequalities)} Gram matrices and bases are needed: one for σ_0, then one for each inequality. "
            f"Received {len(grams)} and {len(bases)}."
        )
    products = [(), *((i,) for i in range(len(inequalities)))]
    squares = [_square(s, q, b, names) for s, q, b in zip(products, grams, bases, strict=True)]
    degrees = [0, *map(degree, inequalities)]
    reached = [d + 2 * max(degree(as_polynomial(b)) for b in s.basis) for d, s in zip(degrees, squares, strict=True)]
    problem = statement(
        names, exact, inequalities=inequalities, products=False, degree_bound=max(degree(exact), *reached)
    )
    return replace(_verified(problem, squares), seconds=perf_counter() - start)


def _listed(given: Any) -> list[Any]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise PolynomialError(f"matrices and bases must be sequences. Received {shown(given)}.")
    return list(given)


def _square(product: tuple[int, ...], gram: Any, basis: Any, names: tuple[str, ...]) -> Square:
    """`Square` of a Gram matrix, floats taken exactly; each element of the basis has a monomial that no other has."""
    elements = tuple(read_element(b, names) for b in _listed(basis))
    matrix = _matrix(gram, len(elements))
    upper = tuple(Fraction(float(matrix[i, j])) for i in range(len(elements)) for j in range(i, len(elements)))
    distinct = {tuple(sorted(as_polynomial(b).items())) for b in elements}
    if not elements or () in distinct or len(distinct) < len(elements):
        raise PolynomialError(
            f"a basis must have one or more elements, all different and not zero. Received {len(elements)} elements, "
            f"{len(distinct - {()})} of them different and not zero."
        )
    square = in_echelon_form(Square(product=product, basis=elements, gram=upper))
    if {} in square.basis:
        raise PolynomialError(
            f"the {len(elements)} elements of a basis must be linearly independent. Received dependent ones. Omit one."
        )
    return square


def _matrix(gram: Any, size: int) -> Any:
    """Symmetric part of a matrix as floats."""
    try:
        matrix = np.asarray(gram, dtype=object).astype(float)  # by entry, so that complex numbers raise
    except (TypeError, ValueError, OverflowError):
        raise PolynomialError(f"a Gram matrix must be an array of real numbers. Received {shown(gram)}.") from None
    if matrix.shape != (size, size) or not np.all(np.isfinite(matrix)):
        raise PolynomialError(
            f"a Gram matrix must be {size} x {size}, as its basis has {size} elements, and finite. "
            f"Received shape {matrix.shape}, {np.count_nonzero(~np.isfinite(matrix))} entries not finite."
        )
    return matrix / 2 + matrix.T / 2


def _verified(problem: Statement, squares: Sequence[Square]) -> Answer:
    error = max(map(abs, residual(problem, squares, ()).values()), default=Fraction(0))
    moved = scaled(problem)
    blocks, grams = zip(*(_block(moved.statement, moved.square(s)) for s in squares), strict=True)
    least = min(float(np.linalg.eigvalsh(g)[0]) for g in grams)
    sizes = f"largest error in a coefficient {UpperBound(error):.2g}, least eigenvalue of the scaled matrix {least:.2g}"
    matrix = f"the given matrix ({sizes})"
    near = error <= _NEAR * max(map(abs, problem.polynomial.values()), default=Fraction(1))
    for how, proof in _proposed(moved, blocks, grams) if near else ():
        answer = Answer(statement=problem, proof=proof, remark=f"proved by {matrix}, {how}", versions=versions())
        if proof is not None and answer.check():
            return answer
    answer = decide(problem)
    why = "neither a proof nor a counterexample was found" if answer.proof is None else "decided"
    return replace(answer, remark=f"{matrix} gives no proof; {why} without it")


def _block(moved: Statement, square: Square) -> Matrixed:
    """Block and floating-point Gram matrix of a square."""
    support = sorted({e for b in square.basis for e in as_polynomial(b)})
    monomials = tuple(b for b in square.basis if isinstance(b, tuple))
    rows = tuple(tuple(as_polynomial(b).get(e, Fraction(0)) for e in support) for b in square.basis)
    plain = len(monomials) == len(square.basis)
    block = Block(
        product=square.product,
        weight=moved.weight(square.product),
        monomials=monomials if plain else tuple(support),
        face=None if plain else rows,
    )
    return block, np.array([[float(v) for v in row] for row in full_matrix(square.gram, len(square.basis))])


def _proposed(moved: Scaled, blocks: Sequence[Block], grams: Sequence[Array]) -> Iterator[tuple[str, Any]]:
    """Proofs from the given matrices, then from the matrices without their kernels."""
    yield "rounded", _rounded(moved, blocks, grams)
    for threshold, tolerance in KERNELS:
        smaller = [_without_kernel(b, g, threshold, tolerance, moved) for b, g in zip(blocks, grams, strict=True)]
        left = [pair for pair in smaller if pair is not None]
        yield "rounded on the complement of its kernel", _rounded(moved, *zip(*left, strict=True)) if left else None


def _without_kernel(block: Block, gram: Array, threshold: float, tolerance: float, moved: Scaled) -> Matrixed | None:
    """Block without the numerical kernel of its matrix, and the restricted matrix; None if the block is empty."""
    smaller = at_kernels([block], [gram], threshold, tolerance, decimal_units(moved.scale))
    if smaller is None:
        return block, gram
    if not smaller:
        return None
    inverse = np.linalg.pinv(_rows(smaller[0], block.monomials))
    full = _rows(block, block.monomials)
    return smaller[0], inverse.T @ full.T @ gram @ full @ inverse


def _rows(block: Block, monomials: Sequence[Exponents]) -> np.ndarray:
    """Coefficients of the basis of a block in monomials, one element per row."""
    polynomials = [as_polynomial(b) for b in block.basis]
    return np.array([[float(p.get(e, 0)) for e in monomials] for p in polynomials])


def _rounded(moved: Scaled, blocks: Sequence[Block], grams: Sequence[np.ndarray]) -> SumOfSquares | None:
    least = min(float(np.linalg.eigvalsh(g)[0]) for g in grams)
    if not least > 0:
        return None
    solution = MomentSolution(margin=least, grams=list(grams), moments=[], functional={}, cofactors=[])
    proof = rounded(moved.statement, blocks, solution)
    return None if proof is None else moved.restored(proof)


# ----------------------------------------------------------------------
# Files with a Gram matrix of another program: JSON, and MATLAB's .mat.

_LARGEST = 4 << 20  # bytes
_KEYS = {"variables", "polynomial", "gram", "basis"}
_IN_MATLAB = {"vars": "variables", "p": "polynomial", "Q": "gram", "Z": "basis"}


@dataclass(frozen=True, kw_only=True)
class GramFile:
    """Contents of a file that claims polynomial = basisᵀ·gram·basis."""

    variables: tuple[str, ...]
    polynomial: Any  # str or mapping of exponents to Fraction
    gram: Any  # array of float (n × n)
    basis: list[Any]

    def verify(self) -> Answer:
        """Exact proof, or the verdict without the matrix; see `quakedesign.sos.verify`."""
        return verify(self.polynomial, self.gram, self.basis, variables=self.variables)


def read_gram(path: str | Path) -> GramFile:
    """Polynomial, Gram matrix and basis of a file.

    A ``.mat`` file has the variables p, Q, Z and vars; any other file is JSON with the keys polynomial, gram, basis and
    variables. A polynomial is text, or a list of terms, each a coefficient followed by exponents. Basis elements are
    texts or lists of exponents. Coefficients are read exactly: JSON numbers as written, MATLAB floats as their shortest
    decimals. Entries of the Gram matrix become floats.

    Raises
    ------
    PolynomialError
        When the file is not readable, or has other keys or values.
    """
    path = Path(path)
    content = read_bytes(path, "a file with a Gram matrix", largest=_LARGEST, refusal=PolynomialError)
    try:
        raw = (
            _matlab(content)
            if path.suffix == ".mat"
            else json.loads(content, object_pairs_hook=unique, parse_float=_number)
        )
    except Exception as error:  # a broken file may raise any exception
        reason = str(error).partition("\n")[0]
        raise PolynomialError(
            f"{path} must be JSON, or .mat as MATLAB's save -v7 writes. Received: {reason}."
        ) from None
    if not isinstance(raw, dict) or set(raw) != _KEYS:
        names = {key: name if path.suffix == ".mat" else key for name, key in _IN_MATLAB.items()}
        received = ", ".join(sorted(names.get(k, str(k)) for k in raw)) if isinstance(raw, dict) else type(raw).__name__
        raise PolynomialError(
            f"{path} must have exactly the keys {', '.join(sorted(names.values()))}. "
            f"Received {shown(received or 'none')}."
        )
    return _gram_file(raw)


def _number(written: str) -> Fraction | str:
    """Exact number, or its text if it has too many digits; `_matrix` converts both to floats."""
    try:
        return rational(written)
    except ParameterError:
        return written


def _gram_file(raw: Json) -> GramFile:
    names, polynomial, basis = raw["variables"], raw["polynomial"], raw["basis"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or not isinstance(basis, list):
        raise PolynomialError(
            "variables must be a list of names, and basis a list. "
            f"Received {shown(names)} and a basis of type {type(basis).__name__}."
        )
    given = polynomial if isinstance(polynomial, str) else _terms(polynomial, len(names))
    return GramFile(variables=tuple(names), polynomial=given, gram=raw["gram"], basis=basis)


def _terms(raw: Any, size: int) -> dict[tuple[int, ...], Fraction]:
    """Sum of terms, each a coefficient followed by its exponents (flat or as a list)."""
    total: dict[tuple[int, ...], Fraction] = {}
    for term in raw if isinstance(raw, list) else [raw]:
        parts = term if isinstance(term, list) and term else [term]
        exponents = parts[1] if len(parts) == 2 and isinstance(parts[1], list) else parts[1:]
        if len(exponents) != size or not all(_is_whole(e) for e in exponents):
            raise PolynomialError(
                f"a term must be a coefficient and {size} exponents, such as [2.5, [1, 0]]. Received {term!s:.60}."
            )
        key = tuple(map(int, exponents))
        try:
            total[key] = total.get(key, Fraction(0)) + rational(parts[0], "coefficient")
        except ParameterError as error:
            raise PolynomialError(str(error)) from None
    return total


def _is_whole(exponent: Any) -> bool:
    number = isinstance(exponent, Real) and not isinstance(exponent, bool)
    return number and exponent >= 0 and exponent % 1 == 0


def _matlab(content: bytes) -> dict[str, Any]:
    """Contents of a MATLAB file under the JSON keys; Z and p are matrices (one monomial or term per row) or text."""
    from scipy.io import loadmat

    with catch_warnings():
        simplefilter("ignore", DeprecationWarning)  # about the type of sparse matrices, made dense later
        raw = loadmat(BytesIO(content), squeeze_me=False, chars_as_strings=True)
    by_key = {key: raw[name] for name, key in _IN_MATLAB.items() if name in raw}
    if set(by_key) != _KEYS:
        return by_key
    terms, basis = _plain(by_key["polynomial"]), _plain(by_key["basis"])
    return {
        "variables": _texts(by_key["variables"]),
        "polynomial": terms[0] if len(terms) == 1 and isinstance(terms[0], str) else terms,
        "basis": _texts(by_key["basis"]) if basis and isinstance(basis[0], str) else basis,
        "gram": _dense(by_key["gram"]),
    }


def _dense(array: Any) -> Any:
    return array.toarray() if hasattr(array, "toarray") else array


def _plain(array: Any) -> list[Any]:
    listed: list[Any] = _dense(array).tolist()
    return listed


def _texts(array: Any) -> list[str]:
    """Names or monomials from a character matrix or a cell array."""
    return [str(entry.item() if hasattr(entry, "item") else entry).strip() for entry in array.ravel()]
