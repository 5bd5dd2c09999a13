"""Files in which other programmes leave a Gram matrix: JSON, and MATLAB's .mat."""

import json
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from numbers import Real
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

from quakedesign.errors import ParameterError, PolynomialError
from quakedesign.input import read_bytes
from quakedesign.rationals import rational
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.strict import unique
from quakedesign.sos.solve.verification import verify

_LARGEST = 4 << 20  # bytes
_KEYS = {"variables", "polynomial", "gram", "basis"}
_IN_MATLAB = {"vars": "variables", "p": "polynomial", "Q": "gram", "Z": "basis"}


@dataclass(frozen=True, kw_only=True)
class GramFile:
    """What a file says: that polynomial = basisᵀ·gram·basis.

    Attributes
    ----------
    variables : tuple of str
    polynomial : str or mapping of exponents to Fraction
    gram : array of float (n × n)
    basis : list of str or of exponents (length n)
    """

    variables: tuple[str, ...]
    polynomial: Any
    gram: Any
    basis: list[Any]

    def verify(self) -> Answer:
        """Exact proof, or what is true instead; see `quakedesign.sos.verify`."""
        return verify(self.polynomial, self.gram, self.basis, variables=self.variables)


def read_gram(path: str | Path) -> GramFile:
    """Polynomial, Gram matrix and basis of a file.

    A file ``.mat`` has the variables p, Q, Z and vars, any other is JSON with the keys polynomial, gram, basis and
    variables. A polynomial is text, or a list of terms, each its coefficient and then the exponents; a basis has texts,
    or lists of exponents. Numbers of JSON are read as they are written, floats of MATLAB as the decimals that they
    print as.

    Raises
    ------
    PolynomialError
        When the file cannot be read, or has other contents.
    """
    path = Path(path)
    content = read_bytes(path, "a file with a Gram matrix", largest=_LARGEST, refusal=PolynomialError)
    try:
        raw = _matlab(content) if path.suffix == ".mat" else _json(content)
    except Exception as error:  # a broken file raises anything
        reason = str(error).partition("\n")[0]
        raise PolynomialError(
            f"{path} must be JSON, or .mat as MATLAB's save -v7 writes. Received: {reason}."
        ) from None
    if not isinstance(raw, dict) or set(raw) != _KEYS:
        raise PolynomialError(f"{path} must have exactly the keys {', '.join(sorted(_KEYS))}. Received others.")
    return _gram_file(raw)


def _json(content: bytes) -> Any:
    return json.loads(content, object_pairs_hook=unique, parse_float=_number)


def _number(written: str) -> Fraction | str:
    """The number exactly; where it has too many digits for that its text, which is good enough for a matrix."""
    try:
        return rational(written)
    except ParameterError:
        return written


def _gram_file(raw: dict[str, Any]) -> GramFile:
    names, polynomial, basis = raw["variables"], raw["polynomial"], raw["basis"]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or not isinstance(basis, list):
        raise PolynomialError("variables must be a list of names, and basis a list. Received others.")
    given = polynomial if isinstance(polynomial, str) else _terms(polynomial, len(names))
    return GramFile(variables=tuple(names), polynomial=given, gram=raw["gram"], basis=basis)


def _terms(raw: Any, size: int) -> dict[tuple[int, ...], Fraction]:
    """Sum of terms, each a coefficient and then its exponents (flat, or in a list of their own)."""
    total: dict[tuple[int, ...], Fraction] = {}
    for term in raw if isinstance(raw, list) else [raw]:
        parts = term if isinstance(term, list) and term else [term]
        exponents = parts[1] if len(parts) == 2 and isinstance(parts[1], list) else parts[1:]
        if len(exponents) != size or not all(_is_whole(e) for e in exponents):
            raise PolynomialError(
                f"a term must be a coefficient and {size} exponents, such as [2.5, [1, 0]]. Received {term!s:.60}."
            )
        key = tuple(map(int, exponents))
        total[key] = total.get(key, Fraction(0)) + rational(parts[0], "coefficient")
    return total


def _is_whole(exponent: Any) -> bool:
    number = isinstance(exponent, Real) and not isinstance(exponent, bool)
    return number and exponent >= 0 and exponent % 1 == 0


def _matlab(content: bytes) -> dict[str, Any]:
    """The same keys from MATLAB's names: Z and p as matrices, one monomial or term a row, or as text."""
    from scipy.io import loadmat

    with catch_warnings():
        simplefilter("ignore", DeprecationWarning)  # of the kind of sparse matrices, which are made dense
        raw = loadmat(BytesIO(content), squeeze_me=False, chars_as_strings=True)
    found = {key: raw[name] for name, key in _IN_MATLAB.items() if name in raw}
    if set(found) != _KEYS:
        return found
    terms, basis = _plain(found["polynomial"]), _plain(found["basis"])
    return {
        "variables": _texts(found["variables"]),
        "polynomial": terms[0] if len(terms) == 1 and isinstance(terms[0], str) else terms,
        "basis": _texts(found["basis"]) if basis and isinstance(basis[0], str) else basis,
        "gram": _dense(found["gram"]),
    }


def _dense(array: Any) -> Any:
    return array.toarray() if hasattr(array, "toarray") else array


def _plain(array: Any) -> list[Any]:
    listed: list[Any] = _dense(array).tolist()
    return listed


def _texts(array: Any) -> list[str]:
    """Names or monomials from a matrix of characters or a cell array."""
    return [str(entry.item() if hasattr(entry, "item") else entry).strip() for entry in array.ravel()]
