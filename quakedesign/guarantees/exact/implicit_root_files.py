"""Implicit steps in files of guarantees (proofs/FORMAT.md)."""

from typing import Any

from quakedesign.exact import exact_text
from quakedesign.laws.implicit_root import MOST_TERMS, ImplicitRoot, Power
from quakedesign.sos.exact.strict import listed, read_ends, read_rational, texts, with_keys


def root_document(root: ImplicitRoot) -> dict[str, Any]:
    """The sum q, and the lines between which its root lies."""
    return {"pull": sum_document(root.pull), "slopes": texts(root.slopes), "remainder": exact_text(root.remainder)}


def sum_document(terms: tuple[Power, ...]) -> list[dict[str, Any]]:
    """A sum of signed powers."""
    return [
        {
            "factor": texts(term.factor),
            "power": exact_text(term.exponent),
            "of": term.argument if isinstance(term.argument, str) else sum_document(term.argument),
        }
        for term in terms
    ]


def read_root(raw: Any) -> ImplicitRoot:
    """Implicit step from parsed entries.

    Raises
    ------
    CertificateError, ParameterError
        When they break a rule of FORMAT.md.
    """
    with_keys(raw, {"pull", "slopes", "remainder"})
    slopes, remainder = read_ends(raw["slopes"], "slopes"), read_rational(raw["remainder"])
    return ImplicitRoot(pull=read_sum(raw["pull"]), slopes=slopes, remainder=remainder)


def read_sum(raw: Any) -> tuple[Power, ...]:
    """A sum of signed powers from parsed entries; raises as `read_root`."""
    return tuple(_read_term(term) for term in listed(raw, "a sum of an implicit step", MOST_TERMS))


def _read_term(raw: Any) -> Power:
    with_keys(raw, {"factor", "power", "of"})
    factor, inner = read_ends(raw["factor"], "a factor"), raw["of"]
    argument = inner if isinstance(inner, str) else read_sum(inner)
    return Power(factor=factor, exponent=read_rational(raw["power"]), argument=argument)
