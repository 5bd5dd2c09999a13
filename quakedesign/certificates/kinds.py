"""Which claim a parsed file makes: told without loading what decides each of them."""

from typing import Any

GUARANTEE, SLOW_SLIDING, ATTRACTION = "guarantee", "slow_sliding", "attraction"
POLYNOMIAL, LOOP = "polynomial", "loop"


def kind_of(raw: Any) -> str:
    """What a parsed file says that it is, else what its keys say: about a polynomial, or a closed loop."""
    if not isinstance(raw, dict):
        return LOOP
    said = next((kind for kind in (GUARANTEE, SLOW_SLIDING, ATTRACTION) if raw.get("kind") == kind), None)
    return said or (POLYNOMIAL if "polynomial" in raw else LOOP)
