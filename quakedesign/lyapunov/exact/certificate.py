"""Lyapunov certificates and their exact check, which returns proved or refuted, or raises an error."""

import pickle
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from fractions import Fraction
from functools import lru_cache
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from quakedesign.arguments import checked_dataclass
from quakedesign.laws.known_fields import field_of, is_law
from quakedesign.lyapunov.exact.certificate_files import evidence_of, read_json, save_certificate
from quakedesign.lyapunov.exact.claim import Equilibrium, Evidence, Loop, Verdict, loop_of, require
from quakedesign.lyapunov.exact.obligations import Obligation, claimed, different, proves
from quakedesign.sos.exact.strict import parse
from quakedesign.sos.exact.work_budget import limited
from quakedesign.symbolic.terms import Term, value

if TYPE_CHECKING:
    from quakedesign.laws import Law, LoopField, Subject


# ----------------------------------------------------------------------
# Exact check whether a certificate proves or refutes its claim.


def check(certificate: Evidence, law: "Subject | None" = None) -> Verdict:
    """Check a certificate in exact arithmetic; see `Certificate.check`."""
    with limited():
        return _decided(certificate, law)


def _decided(certificate: Evidence, law: "Subject | None") -> Verdict:
    _check_roots(certificate.loop)
    _same_field(certificate.loop, law)
    if certificate.refutation is not None:
        _check_equilibrium(certificate.loop, certificate.refutation)
        return Verdict.REFUTED
    _check_proof(certificate)
    return Verdict.PROVED


def _same_field(loop: Loop, law: "Subject | None") -> None:
    """Require the field derived from the law's expressions, and the law's name unless the field is bare."""
    require(
        law is not None or is_law(loop.law),
        f"the law {loop.law!r} is not in the package, so its field cannot be derived. "
        "Pass its class or its LoopField to check().",
    )
    name, model = field_of(loop.law if law is None else law)
    bare = not isinstance(law, str | type | None)
    require(bare or name == loop.law, f"the certificate is about {loop.law!r}, not {name!r}.")
    names = (model.gains, model.constants, model.uncertain)
    given = (loop.gains, loop.constants, loop.uncertain)
    require(
        all(set(own) == set(values) for own, values in zip(names, given, strict=True)),
        f"the names of gains, constants or uncertain parameters differ from those of {loop.law}.",
    )
    derived = loop_of(loop.law, model, gains=loop.gains, uncertain=loop.uncertain, constants=loop.constants)
    require(
        list(derived.states.items()) == list(loop.states.items())
        and derived.domain == loop.domain
        and {name: of for name, (of, _) in derived.roots.items()} == {name: of for name, (of, _) in loop.roots.items()}
        and _sorted(derived, derived.field) == _sorted(loop, loop.field)
        and _sorted(derived, derived.lifts) == _sorted(loop, loop.lifts),
        f"the field in the certificate differs from that of {loop.law}.",
    )


def _sorted(loop: Loop, sums: Mapping[str, tuple[Term, ...]]) -> dict[str, list[Term]]:
    order = {s: i for i, s in enumerate((*loop.states, *loop.lifts))}
    return {
        state: sorted(
            Term(t.coefficient, tuple(sorted(t.parameters)), tuple(sorted(t.factors, key=lambda f: order[f[0]])))
            for t in terms
        )
        for state, terms in sums.items()
    }


def _check_proof(certificate: Evidence) -> None:
    loop, claims = certificate.loop, certificate.claims
    second = "decrease" if loop.domain == "cells" else "rate"
    required, allowed = {"positive", second}, {f"bound_{state}" for state in loop.states}
    allowed |= {"decay"} if second == "decrease" else set()
    require(
        required <= set(claims) <= required | allowed,
        f"the claims must be 'positive', '{second}', and optionally 'bound_<state>' or, on cells, 'decay'.",
    )
    require(all(c > 0 for c in claims.values()), "the value of every claim must be positive.")
    uncertain = {p for t in certificate.lyapunov for p in t.parameters} & set(loop.ranges)
    require(not uncertain, "V must not depend on an uncertain parameter.")
    _check_witnesses(certificate, claimed(loop, certificate.lyapunov, claims))


def _check_witnesses(certificate: Evidence, obligations: Iterable[Obligation]) -> None:
    """Require an exact witness for every distinct obligation, in order."""
    expected = list[str]()
    for one in different(obligations):
        expected.append(one.name)
        require(one.name in certificate.witnesses, f"the witness of {one.name!r} is missing.")
        proved = proves(one, certificate.witnesses[one.name], certificate.loop.domain)
        require(proved, f"the witness of {one.name!r} does not prove that its polynomial is non-negative.")
    extra = "the witnesses must be those of the distinct obligations, in the same order, without further ones."
    require(expected == list(certificate.witnesses), extra)


def _check_roots(loop: Loop) -> None:
    for name, (of, (low, high)) in loop.roots.items():
        number = loop.parameters[of]
        require(
            number > 0 and 0 <= low <= high and low**2 <= number <= high**2,
            f"the range of {name} does not contain the root of {of}.",
        )
    require(loop.domain == "cells" or not loop.lifts, "lifts require the domain 'cells'.")


def _check_equilibrium(loop: Loop, equilibrium: Equilibrium) -> None:
    plain = loop.domain == "cells" and not (loop.lifts or loop.roots)
    require(plain, "an equilibrium requires the domain 'cells' and a loop without lifts and roots.")
    point, parameters = equilibrium.point, equilibrium.parameters
    require(set(point) == set(loop.states) and any(point.values()), "the point must be away from the origin.")
    require(
        set(parameters) == set(loop.uncertain)
        and all(low <= parameters[name] <= high for name, (low, high) in loop.uncertain.items()),
        "the parameters of the counterexample are outside their ranges.",
    )
    cells = touching_cells(loop, point)
    weights = equilibrium.weights
    require(
        set(weights) == set(cells) and all(w >= 0 for w in weights.values()) and sum(weights.values()) == 1,
        "the weights of the counterexample are not convex weights of the touching cells.",
    )
    for state, terms in loop.field.items():
        mean = sum(
            (weights[cell] * limit(terms, loop, point, signs, parameters) for cell, signs in cells.items()), Fraction(0)
        )
        require(mean == 0, f"the field does not vanish in {state} at the counterexample.")


def touching_cells(loop: Loop, point: Mapping[str, Fraction]) -> dict[str, dict[str, int]]:
    """Sign cells whose closure contains a point, by name."""
    choices = [(1, -1) if point[s] == 0 else ((1,) if point[s] > 0 else (-1,)) for s in loop.states]
    return {
        "".join("+" if s > 0 else "-" for s in signs): dict(zip(loop.states, signs, strict=True))
        for signs in product(*choices)
    }


def limit(
    terms: Iterable[Term],
    loop: Loop,
    point: Mapping[str, Fraction],
    signs: Mapping[str, int],
    parameters: Mapping[str, Fraction],
) -> Fraction:
    """Limit of a sum of terms at a point from one cell."""
    total = Fraction(0)
    for term in terms:
        part = value(term, {**loop.parameters, **parameters})
        for state, exponent, kind in term.factors:
            power = exponent * loop.states[state]
            require(power.denominator == 1, f"⌈{state}⌋^{exponent} is not polynomial on a cell.")
            part *= abs(point[state]) ** power.numerator * (signs[state] if kind == "s" else 1)
        total += part
    return total


# ----------------------------------------------------------------------
# Evidence with its exact check and its file.


@checked_dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Certificate(Evidence):
    """A statement about one closed loop with its proof or its counterexample.

    Attributes
    ----------
    loop : Loop
    lyapunov : tuple of Term
        Lyapunov function V; empty for a refutation.
    claims : mapping of str to Fraction
        ``positive``, and ``decrease`` on `cells` or ``rate`` [1/s] on `reals`; optionally ``bound_<state>`` and, on
        `cells`, ``decay``.
    witnesses : mapping of str to Witness
        One for every distinct obligation, by name.
    refutation : Equilibrium, optional
    """

    @classmethod
    def of(cls, evidence: Evidence) -> "Certificate":
        """Certificate with the parts of an `Evidence`."""
        return cls(**{part.name: getattr(evidence, part.name) for part in fields(Evidence)})

    def check(self, law: "str | type[Law] | LoopField | None" = None) -> Verdict:
        """Check the proof or counterexample, and compare the field with that of the law, in exact arithmetic.

        Parameters
        ----------
        law : str, type of Law or LoopField, optional
            Law to which the field must belong; by default the law of the package that the certificate names.

        Returns
        -------
        Verdict
            ``PROVED`` or ``REFUTED``, never ``UNDECIDED``.

        Raises
        ------
        CertificateError
            When the proof does not hold, or the field is not that of the law.
        WorkError
            If the check exceeds its work budget (proofs/FORMAT.md); the certificate is then undecided.
        """
        return check(self, law)

    def save(self, path: str | Path) -> None:
        """Write the file of FORMAT.md atomically."""
        save_certificate(self, path)


@dataclass(frozen=True, slots=True)
class _Problem:
    """A certificate and a law, compared by contents."""

    digest: bytes
    law: "str | type[Law] | None"
    certificate: Certificate = field(compare=False)


def cached_verdict(certificate: Certificate, law: "str | type[Law] | LoopField | None" = None) -> Verdict:
    """Verdict of `Certificate.check`, cached per process by contents and law.

    The verdict on a bare loop is not cached.

    Raises
    ------
    CertificateError, WorkError
        As `Certificate.check`, on every call.
    """
    if not isinstance(law, str | type | None):
        return certificate.check(law)
    return _verdict(_Problem(sha256(pickle.dumps(certificate)).digest(), law, certificate))


@lru_cache(maxsize=64)
def _verdict(problem: _Problem) -> Verdict:
    return problem.certificate.check(problem.law)


def load_certificate(path: str | Path) -> Certificate:
    """Read a certificate file without checking the certificate.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Certificate

    Raises
    ------
    CertificateError
        When the file is not readable or breaks a rule of FORMAT.md.
    """
    return Certificate.of(evidence_of(read_json(path)))


def parse_certificate(text: str) -> Certificate:
    """Parse the text of a certificate file; raises CertificateError as `load_certificate`."""
    return Certificate.of(evidence_of(parse(text)))
