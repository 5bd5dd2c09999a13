"""A sampled step of a controller, and the text of its C files."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from quakedesign.simulation.c_files import c_file

SOURCE, HEADER = "controller.c", "controller.h"
_WIDTH = 110
_USE = """
Call controller_reset once, and controller_step every CONTROLLER_STEP seconds: it reads CONTROLLER_MEASUREMENTS
numbers and the pressure [Pa] that was applied since the last call, updates CONTROLLER_MEMORY numbers, and writes the
fluid pressure [Pa] to hold until the next call (zero-order hold). Where pump or valve limit the pressure, tell it what
was applied: the law does not wind up then, as in simulate --saturation; else give a null pointer. The reference of
the fault is computed from the number of calls. The functions keep nothing between calls but the memory they are given,
allocate nothing, and may be called from several threads with different memories. Numbers that
are not finite are not caught: check measurement and pressure.
"""
_COMPILE = "Compile with: cc -std=c99 -O2 -ffp-contract=off -c controller.c, and link with -lm."


@dataclass(frozen=True, kw_only=True)
class ControllerStep:
    """What a controller does once per sample, as one function of its measurement and its memory.

    Attributes
    ----------
    function : casadi.Function
        (measurement, applied pressure since the last sample [Pa], memory) → memory, pressure [Pa].
    measurement : mapping of str to str
        Unit of every measured signal, in order.
    start : mapping of str to float
        Memory before the first sample, in order, SI units.
    step : float
        Sampling period T_s [s].
    facts : mapping of str to str
        Where it comes from: fault, law, gains, scheme, versions.
    remarks : tuple of str
        What is said first of it, a sentence each.
    """

    function: Any
    measurement: Mapping[str, str]
    start: Mapping[str, float]
    step: float
    facts: Mapping[str, str]
    remarks: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """JSON-able facts."""
        return {
            "step": self.step,
            "measurement": dict(self.measurement),
            "memory": dict(self.start),
            "facts": dict(self.facts),
            "remarks": list(self.remarks),
        }


def header_text(exported: ControllerStep) -> str:
    """Header with the meaning of every number."""
    measured = (f"measurement[{i}]: {name} [{unit}]" for i, (name, unit) in enumerate(exported.measurement.items()))
    kept = (f"memory[{i}]: {name}, {value!r} at the start" for i, (name, value) in enumerate(exported.start.items()))
    facts = (f"{name}: {value}" for name, value in exported.facts.items())
    said = [part for remark in exported.remarks for part in (*_wrapped(remark), "")]
    lines = [
        *said,
        "A sampled controller for a fault, in SI units.",
        "",
        *_wrapped(_USE),
        "",
        _COMPILE,
        "",
        *measured,
        *kept,
    ]
    comment = _comment([*lines, "", "Where it comes from:", *facts])
    sizes = {"step": repr(exported.step), "measurements": len(exported.measurement), "memory": len(exported.start)}
    return comment + c_file("controller.h", **sizes)


def source_text(exported: ControllerStep, header: str) -> str:
    """CasADi's C for the step, followed by the two functions of the header."""
    generator = ca.CodeGenerator("sampled_step.c", {"with_export": False})
    generator.add(exported.function)
    start = ",\n".join(f"    {value!r}" for value in exported.start.values())
    return generator.dump() + c_file(
        "controller.c",
        header=header,
        start=start,
        held=list(exported.start).index("held_0"),
        **_sizes(exported.function),
    )


def _sizes(function: Any) -> dict[str, int]:
    sizes = {
        "arguments": function.sz_arg(),
        "results": function.sz_res(),
        "integers": function.sz_iw(),
        "work": function.sz_w(),
    }
    return {name: max(1, size) for name, size in sizes.items()}


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), _WIDTH)


def _comment(lines: list[str]) -> str:
    """Lines in one comment of C, which no text of the user can end."""
    wrapped = [part for line in lines for part in (textwrap.wrap(" ".join(line.split()), _WIDTH) or [""])]
    safe = "\n".join(f" * {line}".rstrip() for line in wrapped).replace("*/", "* /")
    return "/*\n" + safe + "\n */\n"
