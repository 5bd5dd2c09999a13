"""The same noise from other seeds."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

Value = TypeVar("Value")


def reseeded(value: Value, seed: int) -> Value:
    """A frozen dataclass, or a tuple, in which every entry called ``seed`` is derived from another seed.

    Entries within entries are reached too; no two get the same seed, so that two noises stay independent.
    """
    walked: Value = _walk(value, seed, [0])
    return walked


def _walk(value: Any, seed: int, count: list[int]) -> Any:
    if isinstance(value, tuple) and type(value) is tuple:
        walked = tuple(_walk(entry, seed, count) for entry in value)
        return walked if any(new is not old for new, old in zip(walked, value, strict=True)) else value
    if not is_dataclass(value) or isinstance(value, type):
        return value
    changed = {}
    for field in fields(value):
        before = getattr(value, field.name)
        after = _derived(seed, count) if field.name == "seed" else _walk(before, seed, count)
        if after is not before:
            changed[field.name] = after
    return replace(value, **changed) if changed else value


def _derived(seed: int, count: list[int]) -> int:
    count[0] += 1
    return int(np.random.SeedSequence(seed, spawn_key=(count[0],)).generate_state(1)[0])
