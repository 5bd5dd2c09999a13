"""Search for a Lyapunov function of given gains, finished in exact arithmetic. One pipeline for every law."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.certificates import Certificate, Equilibrium, Loop
from quakedesign.certificates.obligations import Obligation, Obligations, power_sum
from quakedesign.certificates.witnesses import statement_of
from quakedesign.controllers import LoopField, Subject, law
from quakedesign.controllers.loop_field import lowest_degree
from quakedesign.errors import CertificateError
from quakedesign.rationals import nearest
from quakedesign.sos.exact.polynomial import monomial
from quakedesign.sos.solve.joint import Demand, Proposal, joint_program
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import balance, below, exponents_of, lifted_scale, normal, scaled
from quakedesign.synthesis.lyapunov.certify_exactly import finish
from quakedesign.synthesis.lyapunov.claimed_rates import bounds_of, claims_of
from quakedesign.synthesis.lyapunov.kept import kept

_WORTH_A_PROOF = 1e-9
"""Margins above this are worth a proof in exact arithmetic, which decides."""
_DIGITS = (1 << 14, 1 << 20, 1 << 30)
_HIGHEST_DEGREE, _HIGHEST_IN_THE_PLANE = 8, 10  # beyond, rounding errors or seconds of search outweigh what is gained


def candidate_degrees(loop: Loop) -> tuple[int, ...]:
    """Degrees of V to try in turn: the lowest that couples the heaviest states, then even ones up to 8, in 2-D 10."""
    lowest = lowest_degree(loop.states.values(), loop.domain)
    if loop.domain == "reals":
        return (lowest,)
    highest = _HIGHEST_IN_THE_PLANE if len(loop.states) <= 2 else _HIGHEST_DEGREE
    return (lowest, *(m for m in range(lowest + 1, highest + 1) if m % 2 == 0))


def find_certificate(
    loop: Loop, degrees: int | Iterable[int] | None = None, *, subject: Subject | None = None
) -> Certificate | None:
    """Lyapunov function with an exact proof, or None when the search finds none.

    Parameters
    ----------
    loop : Loop
    degrees : int or iterable of int, optional
        Of V in the weights of the loop, tried in turn; `candidate_degrees` unless given.
    subject : str, type of Law or LoopField, optional
        What the loop is one of; needed for a law from outside the package.

    Returns
    -------
    Certificate or None
        Already checked in exact arithmetic. None says nothing about the loop.
    """
    if degrees is None:
        degrees = candidate_degrees(loop)
    chosen = (degrees,) if isinstance(degrees, int) else degrees
    return next(filter(None, (_of_degree(loop, degree, subject) for degree in chosen)), None)


@kept
def _of_degree(loop: Loop, degree: int, subject: Subject | None) -> Certificate | None:
    scale = balance(loop)
    family = family_of(loop, degree, scale)
    if family is None:
        return None
    proposal = joint_program(family.demands).solve(family.demands)
    if proposal is None or not proposal.margin > _WORTH_A_PROOF:
        return None
    return finished(loop, family, proposal, scale, subject)


def finished(
    loop: Loop, family: "Family", proposal: Proposal, scale: Sequence[Fraction], subject: Subject | None = None
) -> Certificate | None:
    """Certificate from a proposal of a family in scaled variables, with the shortest rounding that has a proof.

    Roundings that are coarser than the margin are not tried.
    """
    degree = sum(exponents_of(family.monomials[0], loop.states))
    for digits in [d for d in _DIGITS if d * proposal.margin > 1] or _DIGITS[-1:]:
        lyapunov = family.function(proposal.decision, digits)
        margins = (
            below(proposal.margin * float(min(1 / r**degree for r in scale))),
            below(proposal.margin * float(family.pace * min(1 / r**family.fallen for r in scale))),
        )
        claims = claims_of(loop, lyapunov, margins) | bounds_of(loop, lyapunov, scale)
        certificate = finish(loop, lyapunov, claims, subject)
        if certificate is not None:
            return certificate
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Lyapunov functions Σ a_j V_j with the monomials of one degree, as demands on a_j.

    Attributes
    ----------
    monomials : tuple of Term
        V_j·size_j.
    sizes : tuple of Fraction
        What a monomial is divided by, so that all are about one in the scaled variables.
    demands : tuple of Demand
        V and −V̇ on every different cell and vertex, scaled.
    pace : Fraction
        What −V̇ was divided by.
    fallen : int
        Degree of V̇.
    """

    monomials: tuple[Term, ...]
    sizes: tuple[Fraction, ...]
    demands: tuple[Demand, ...]
    pace: Fraction
    fallen: int

    def function(self, decision: Sequence[float], digits: int) -> tuple[Term, ...]:
        """V with coefficients rounded to multiples of 1/digits in the scaled variables."""
        return sum_of(self.monomials, self.sizes, decision, digits)


def sum_of(
    monomials: Sequence[Term], sizes: Sequence[Fraction], decision: Sequence[float], digits: int
) -> tuple[Term, ...]:
    """Σ a_j·monomial_j/size_j with every a_j rounded to a multiple of 1/digits."""
    chosen = [nearest(a, digits) for a in decision]
    return tuple(
        Term(a / size, t.parameters, t.factors) for a, size, t in zip(chosen, sizes, monomials, strict=True) if a
    )


def family_of(loop: Loop, degree: int, scale: Sequence[Fraction]) -> Family | None:
    """Demands of all Lyapunov functions of one degree; None where there are no candidates."""
    monomials = signed_monomials(loop.states, degree, loop.domain)
    sizes = tuple(monomial(scale, exponents_of(term, loop.states)) for term in monomials)
    columns = [Obligations(loop, (term,)) for term in monomials]
    function = _rows([[Obligation(name, p) for name, p in c.function()] for c in columns])
    decrease = _rows([[one for _, one in c.decrease("")] for c in columns])
    fallen = max((sum(e) for row in decrease for one in row for e in one.polynomial), default=0)
    if not fallen or not function or not all(any(one.polynomial for one in row) for row in decrease):
        return None
    moved = [[_moved(one, scale, 1 / size) for one, size in zip(row, sizes, strict=True)] for row in decrease]
    pace = max(abs(c) for row in moved for one in row for c in one.polynomial.values())
    demands = [
        *(
            _demand([_moved(o, scale, 1 / s) for o, s in zip(row, sizes, strict=True)], loop, degree)
            for row in function
        ),
        *(_demand([_moved(o, (), 1 / pace) for o in row], loop, fallen) for row in moved),
    ]
    return Family(monomials=monomials, sizes=sizes, demands=tuple(demands), pace=pace, fallen=fallen)


def _rows(columns: list[list[Obligation]]) -> list[list[Obligation]]:
    """Obligations (rows) without repetitions, each for every candidate."""
    rows = {tuple(one.key for one in row): list(row) for row in zip(*columns, strict=True)}
    return list(rows.values())


def _moved(one: Obligation, scale: Sequence[Fraction], factor: Fraction) -> Obligation:
    """Obligation in scaled variables, its polynomial times a factor; no scale leaves the variables."""
    if not scale:
        return Obligation(
            one.name, {e: c * factor for e, c in one.polynomial.items()}, one.equalities, one.inequalities
        )
    whole = lifted_scale(one.equalities, scale)
    return Obligation(
        one.name,
        scaled(one.polynomial, whole, factor),
        tuple(normal(h, whole) for h in one.equalities),
        tuple(normal(g, whole) for g in one.inequalities),
    )


def _demand(row: Sequence[Obligation], loop: Loop, power: int) -> Demand:
    size = next(len(e) for one in row for p in (one.polynomial, *one.equalities) for e in p)
    margin = power_sum(len(loop.states), power, size)
    support = dict.fromkeys([*(e for one in row for e in one.polynomial), *margin], Fraction(1))
    template = statement_of(Obligation("", support, row[0].equalities, row[0].inequalities), loop.domain)
    return Demand(template=template, parts=[one.polynomial for one in row], margin=margin)


def refute(loop: Loop, subject: Subject) -> Certificate | None:
    """Counterexample suggested by the law, checked in exact arithmetic, or None; a bare loop suggests none."""
    if isinstance(subject, LoopField):
        return None
    chosen = law(subject) if isinstance(subject, str) else subject
    parts = chosen.counterexample(loop.gains, loop.uncertain)
    if parts is None:
        return None
    certificate = Certificate(loop=loop, refutation=Equilibrium(**parts))
    try:
        certificate.check(subject)
    except CertificateError:
        return None
    return certificate
