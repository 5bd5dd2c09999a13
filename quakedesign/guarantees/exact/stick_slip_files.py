"""Files of guarantees on the stick–slip plant (proofs/FORMAT.md)."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from quakedesign.exact import exact_text
from quakedesign.guarantees.exact.implicit_root_files import read_sum, sum_document
from quakedesign.guarantees.exact.stick_slip_guarantee import StickSlipGuarantee
from quakedesign.guarantees.exact.stick_slip_set import (
    COMBINATIONS,
    MOST_BASES,
    MOST_FACETS,
    SLICES,
    SampledStickSlip,
    StickSlipClaims,
    StickSlipPolytope,
)
from quakedesign.laws.implicit_root import ImplicitRoot, Power
from quakedesign.laws.stick_slip_law import GAIN_UNITS, StickSlipLaw
from quakedesign.plant.ranges import FaultPlant
from quakedesign.sos.exact.strict import listed, need, read_exactly, read_row, texts, with_keys

_OF_LOOP = ("step", "slip_noise")


def stick_slip_document(claim: StickSlipGuarantee) -> dict[str, Any]:
    """Loop and set."""
    return {
        "loop": {
            **{name: exact_text(getattr(claim.held, name)) for name in _OF_LOOP},
            **{name: exact_text(getattr(claim.held.law, name)) for name in GAIN_UNITS},
            **({"pull": sum_document(claim.held.law.pull)} if claim.held.law.pull else {}),
            **({"longest": exact_text(claim.held.longest_step)} if claim.held.longest_step else {}),
        },
        "set": set_document(claim.reach),
    }


def set_document(reach: StickSlipPolytope) -> dict[str, Any]:
    """An invariant set."""
    return {
        "facets": [texts(row) for row in reach.facets],
        "multipliers": [texts(row) for row in reach.multipliers],
        "sliding": [[list(basis) for basis in line] for line in reach.sliding],
        "resting": [[list(basis) for basis in line] for line in reach.resting],
    }


def read_stick_slip(raw: Any, task: FaultPlant, claims: Callable[[type], Any]) -> StickSlipGuarantee:
    """Claim from a parsed file, its task, and a reader of claims of a kind.

    Raises
    ------
    CertificateError, ParameterError
        When the file breaks a rule of FORMAT.md.
    """
    need(task.change is None, "a bounded change of the disturbance is not used where the fault sticks")
    given = dict(raw["loop"]) if isinstance(raw["loop"], dict) else raw["loop"]
    pull: tuple[Power, ...] = ()
    if isinstance(given, dict) and "pull" in given:
        pull = ImplicitRoot(pull=read_sum(given.pop("pull"))).pull
    aperiodic = isinstance(given, dict) and "longest" in given
    loop = read_exactly(given, (*_OF_LOOP, *GAIN_UNITS, *(("longest",) if aperiodic else ())))
    need(not aperiodic or loop["longest"] > 0, "longest must be positive where it is given")
    law = StickSlipLaw(**{name: loop[name] for name in GAIN_UNITS}, pull=pull)
    return StickSlipGuarantee(
        task=task,
        held=SampledStickSlip(
            law=law, **{name: loop[name] for name in _OF_LOOP}, longest_step=loop.get("longest", Fraction(0))
        ),
        reach=read_set(raw["set"]),
        claims=claims(StickSlipClaims),
    )


def read_set(raw: Any) -> StickSlipPolytope:
    """Invariant set from parsed entries.

    Raises
    ------
    CertificateError, ParameterError
    """
    given = with_keys(raw, {"facets", "multipliers", "sliding", "resting"})
    facets, multipliers = (
        tuple(read_row(row, name, length=length) for row in listed(given[name], name, MOST_FACETS))
        for name, length in (("facets", 3), ("multipliers", 5))
    )
    sliding, resting = (
        tuple(_vertices(line, length) for line in listed(given[name], name, length=count))
        for name, length, count in (("sliding", 3, SLICES), ("resting", 4, len(COMBINATIONS)))
    )
    return StickSlipPolytope(facets=facets, multipliers=multipliers, sliding=sliding, resting=resting)


def _vertices(raw: Any, length: int) -> tuple[tuple[int, ...], ...]:
    found = tuple(tuple(listed(basis, "a basis", length=length)) for basis in listed(raw, "bases", MOST_BASES))
    need(all(type(i) is int for basis in found for i in basis), "numbers of constraints must be integers")
    return found
