"""A region of attraction in sentences, and as facts."""

from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.sos.exact.attraction import Attraction, Region
from quakedesign.sos.exact.proofs import Point
from quakedesign.sos.exact.words import polynomial_words


def claim_words(claim: Attraction) -> list[str]:
    """The field, V, and what is proved or refuted of them."""
    names = claim.variables
    lines = [f"{name}' = {polynomial_words(f, names)}" for name, f in zip(names, claim.field, strict=True)]
    lines.append(f"V = {polynomial_words(claim.lyapunov, names)}")
    if isinstance(claim.proof, Point):
        level = [f"level {claim.level} is not proved by V"] if claim.level is not None else []
        return [*lines, *level, *_point_words(claim)]
    if claim.proof is None:
        return lines
    return [*lines, f"every solution {_start(claim)} tends to the origin, which is asymptotically stable"]


def region_words(found: Region) -> list[str]:
    """What is proved, what is refuted, and the reason where nothing is proved."""
    lines = [found.verdict]
    shown = found.proved or found.refuted
    if shown is not None:
        lines += claim_words(shown)
    if found.inclusion is not None:
        lines.append(_inclusion_words(found))
    if found.proved is not None and found.refuted is not None:
        lines += _point_words(found.refuted)
    return [*lines, *filter(None, [found.remark])]


def region_facts(found: Region) -> dict[str, Any]:
    """The same for JSON; exact numbers are texts."""
    shown = found.proved or found.refuted
    point = found.refuted.proof if found.refuted is not None else None
    coordinates = point.coordinates if isinstance(point, Point) else None
    return {
        "verdict": found.verdict,
        "variables": list(shown.variables) if shown else None,
        "V": polynomial_words(shown.lyapunov, shown.variables) if shown else None,
        "everywhere": found.proved is not None and found.proved.level is None,
        "level": None if found.level is None else str(found.level),
        "shape": None if found.inclusion is None else _shape(found),
        "shape_level": None if found.shape_level is None else str(found.shape_level),
        "refuted_above": None if found.refuted_above is None else str(found.refuted_above),
        "point": None if coordinates is None else [str(x) for x in coordinates],
        "equilibrium": None if found.refuted is None else found.refuted.equilibrium,
        "remark": found.remark or None,
    }


def _shape(found: Region) -> str:
    """The polynomial s of the inequality β − s ≥ 0."""
    assert found.inclusion is not None
    asked = found.inclusion.statement
    return polynomial_words({e: -c for e, c in asked.inequalities[0].items() if any(e)}, asked.variables)


def _inclusion_words(found: Region) -> str:
    assert found.shape_level is not None
    return f"that is so wherever {_shape(found)} <= {found.shape_level} ({LowerBound(found.shape_level)} rounded down)"


def _start(claim: Attraction) -> str:
    if claim.level is None:
        return "from everywhere"
    return f"that starts where V < {claim.level} ({LowerBound(claim.level)} rounded down)"


def _point_words(claim: Attraction) -> list[str]:
    assert isinstance(claim.proof, Point)
    assert claim.height is not None
    point = ", ".join(f"{name} = {x}" for name, x in zip(claim.variables, claim.proof.coordinates, strict=True))
    if claim.equilibrium:
        return [f"another equilibrium, so that no V helps beyond: {point}"]
    what = "V is not positive" if claim.height <= 0 else "V does not fall"
    above = "" if claim.height <= 0 else f", so that no level above {UpperBound(claim.height)} (rounded up) holds"
    return [f"{what} at {point}{above}"]
