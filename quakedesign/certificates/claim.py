"""What a certificate is about, and what it consists of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

import sympy as sp

from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.sos import Witness
from quakedesign.symbolic.terms import Term, from_terms, to_terms

Range = tuple[Fraction, Fraction]


class Verdict(Enum):
    """Outcome of a question about a closed loop."""

    PROVED = "the witness checks in exact arithmetic"
    REFUTED = "a counterexample checks in exact arithmetic"
    UNDECIDED = "neither was found"

    def __str__(self) -> str:
        return self.name.lower()


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A closed loop with exact gains and ranges: the subject of a claim.

    Attributes
    ----------
    law : str
    gains, constants : mapping of str to Fraction
    states : mapping of str to int
        Weight of every state.
    domain : str
        ``"cells"`` or ``"reals"``.
    uncertain : mapping of str to (Fraction, Fraction)
    field : mapping of str to tuple of Term
    """

    law: str
    gains: Mapping[str, Fraction]
    constants: Mapping[str, Fraction]
    states: Mapping[str, int]
    domain: str
    uncertain: Mapping[str, Range]
    field: Mapping[str, tuple[Term, ...]]

    def __post_init__(self) -> None:
        for name, (low, high) in self.uncertain.items():
            if low > high:
                raise ParameterError(f"range of {name} must be ordered. Received [{low}, {high}].")

    @property
    def symbols(self) -> dict[str, sp.Symbol]:
        """SymPy symbol of every name."""
        return {n: sp.Symbol(n, real=True) for n in (*self.states, *self.gains, *self.constants, *self.uncertain)}

    @property
    def parameters(self) -> dict[str, Fraction]:
        """Exact values of gains and constants."""
        return {**self.gains, **self.constants}


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """A Filippov equilibrium away from the origin, for admissible constant parameters.

    Attributes
    ----------
    parameters : mapping of str to Fraction
    point : mapping of str to Fraction
        v_i with x_i = sign(v_i)|v_i|^{r_i}.
    weights : mapping of str to Fraction
        Convex weight of every sign cell that touches the point.
    """

    parameters: Mapping[str, Fraction]
    point: Mapping[str, Fraction]
    weights: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """A statement about one closed loop with its proof or its counterexample.

    Attributes
    ----------
    loop : Loop
    lyapunov : tuple of Term
        V; empty for a refutation.
    claims : mapping of str to Fraction
        ``positive`` and ``decrease`` or ``rate`` [1/s on `reals`].
    witnesses : mapping of str to Witness
        One for every different obligation, by name.
    refutation : Equilibrium, optional
    """

    loop: Loop
    lyapunov: tuple[Term, ...] = ()
    claims: Mapping[str, Fraction] = field(default_factory=dict)
    witnesses: Mapping[str, Witness] = field(default_factory=dict)
    refutation: Equilibrium | None = None

    def check(self) -> Verdict:
        """Re-decide the statement from nothing but its claim, in exact arithmetic; field against law as well.

        Raises
        ------
        CertificateError
            When the proof does not hold.
        """
        from quakedesign.certificates.checking import check

        return check(self)

    def save(self, path) -> None:
        """Write the file of FORMAT.md, whole or not at all."""
        from quakedesign.certificates.files import save_certificate

        save_certificate(self, path)


def loop_of(
    law: str,
    model: LoopField,
    *,
    gains: Mapping[str, Fraction],
    uncertain: Mapping[str, Range],
    constants: Mapping[str, Fraction] | None = None,
) -> Loop:
    """Bind a symbolic loop to exact numbers.

    Raises
    ------
    CertificateError
        When the law has parts that this format cannot express, such as nested powers.
    """
    states = tuple(model.states)
    return Loop(
        law=law,
        gains=dict(gains),
        constants=dict(constants or {}),
        states={s.name: w for s, w in model.states.items()},
        domain=model.domain,
        uncertain=dict(uncertain),
        field={s.name: to_terms(rate, states) for s, rate in model.field.items()},
    )


def sympy_field(loop: Loop) -> dict[sp.Symbol, sp.Expr]:
    """Vector field of a loop as SymPy expressions."""
    symbols = loop.symbols
    return {symbols[state]: from_terms(terms, symbols) for state, terms in loop.field.items()}


def require(condition: bool, reason: str) -> None:
    """Refuse a certificate.

    Raises
    ------
    CertificateError
    """
    if not condition:
        raise CertificateError(reason)
