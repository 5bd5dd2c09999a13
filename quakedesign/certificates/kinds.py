"""Which claim a parsed file makes, where it says so: told without loading what decides each of them."""

from typing import Any

GUARANTEE, SLOW_SLIDING = "guarantee", "slow_sliding"


def is_guarantee(raw: Any) -> bool:
    """Whether a parsed file bounds the peaks of a loop, with samples or in continuous time."""
    return isinstance(raw, dict) and raw.get("kind") == GUARANTEE


def is_sliding(raw: Any) -> bool:
    """Whether a parsed file is about slow sliding."""
    return isinstance(raw, dict) and raw.get("kind") == SLOW_SLIDING
