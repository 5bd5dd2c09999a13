"""Ways to find a proof of one statement, one a file, found by looking into this folder."""

from functools import cache

from quakedesign.discovery import discovered
from quakedesign.sos.solve.methods.base import Method


@cache
def methods() -> tuple[Method, ...]:
    """Every method, in the order in which they are tried."""
    found = discovered(__name__, Method, shared=("base",)).values()
    return tuple(sorted((method() for method in found), key=lambda method: method.order))
