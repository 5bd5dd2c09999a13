"""What it takes to make a report again: when, with which versions, by which command, from which numbers."""

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version

from quakedesign.fault import Fault, fault_toml

_PACKAGES = ("quakedesign", "sympy", "cvxpy", "clarabel", "casadi", "numpy", "scipy", "control", "python-flint")


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """How a report was made.

    Attributes
    ----------
    date : str
        UTC; that of SOURCE_DATE_EPOCH where it is set, for pages that are the same byte for byte.
    command : str
        As it was typed; empty where the report was not made by one.
    versions : mapping of str to str
        Of the package, of all libraries that numbers depend on, and of Python.
    scenario : list of str
        Lines of the fault as TOML.
    """

    date: str
    command: str
    versions: Mapping[str, str]
    scenario: list[str]


def versions() -> dict[str, str]:
    """Versions by package."""
    return {package: version(package) for package in _PACKAGES}


def reproduction(fault: Fault, command: str = "") -> Reproduction:
    """How a report of a fault is made now."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(given), UTC) if given.isdecimal() else datetime.now(UTC)
    return Reproduction(
        date=f"{now:%Y-%m-%d %H:%M} UTC",
        command=command,
        versions=versions() | {"Python": platform.python_version(), "machine": platform.machine()},
        scenario=fault_toml(fault).splitlines(),
    )
