"""The work of CasADi Functions of scalar operations, one instruction after the other, and what they call."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import casadi as ca

from quakedesign.loop.steps.inclusion import where_needed
from quakedesign.simulation.elementary import FUNCTIONS, verbatim

_WRITTEN_OUT = 60
"""Instructions of an elementary function, on the average of a step."""


class NotPortableError(ValueError):
    """Work that has no text in C here."""


@dataclass(frozen=True)
class Instruction:
    """One step of a function's work.

    Attributes
    ----------
    operation : int
        CasADi's code.
    taken : tuple of int
        Places of the arguments; for an input its number and the entry.
    given : tuple of int
        Places of the results, −1 where none is wanted; for an output its number and the entry.
    constant : float
    """

    operation: int
    taken: tuple[int, ...]
    given: tuple[int, ...]
    constant: float


def instructions(function: Any) -> Iterator[Instruction]:
    """The work of a CasADi Function of scalar operations, in order."""
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        value = function.instruction_constant(k) if operation == ca.OP_CONST else 0.0
        yield Instruction(operation, tuple(function.instruction_input(k)), tuple(function.instruction_output(k)), value)


@dataclass(frozen=True)
class Called:
    """What one instruction of a function calls.

    Attributes
    ----------
    function : casadi.Function
        Of scalar operations, one vector in and one out.
    times : int
        How often, on its own result; 0: once if the first argument, which it does not take, is not zero, else its
        result is 0.
    """

    function: Any
    times: int

    def __call__(self, function: Any, arguments: list[Any]) -> Any:
        """Result (SX) with another function in the place of this one."""
        if self.times:
            return function.fold(self.times, {"never_inline": True})(ca.vertcat(*arguments))
        return where_needed(function)(arguments[0], ca.vertcat(*arguments[1:]))


def called(function: Any, work: Instruction) -> Called:
    """What an instruction of a function calls.

    Raises
    ------
    NotPortableError
        When that is neither a repetition nor a branch, or cannot be told.
    """
    found = [f for f in function.find_functions(0) if f.nnz_in() == len(work.taken) and f.nnz_out() == len(work.given)]
    name = found[0].name() if len(found) == 1 else ""
    if name.startswith("fold_"):
        inner = name.removeprefix("fold_")
        return Called(found[0].find_function(inner), int(found[0].find_function(f"mapaccum_{inner}").size2_out(0)))
    if name == "where_needed":
        return Called(found[0].find_function("solved"), 0)
    raise NotPortableError(f"a call in {function.name()} is neither a repetition nor a branch")


def expanded(function: Any) -> Any:
    """Function with the elementary functions written out, for CasADi's virtual machine."""
    with verbatim():
        return _expanded(function)


def expanded_size(function: Any) -> int:
    """About how many instructions a function has when it is expanded."""
    operations = [function.instruction_id(k) for k in range(function.n_instructions())]
    return len(operations) + _WRITTEN_OUT * sum(operation in FUNCTIONS for operation in operations)


def _expanded(function: Any) -> Any:
    inputs = [ca.SX.sym(f"i{n}", function.sparsity_in(n)) for n in range(function.n_in())]
    results = [ca.SX(function.sparsity_out(n)) for n in range(function.n_out())]
    values: dict[int, Any] = {}
    for work in instructions(function):
        if work.operation == ca.OP_INPUT:
            values[work.given[0]] = inputs[work.taken[0]].nz[work.taken[1]]
        elif work.operation == ca.OP_OUTPUT:
            results[work.given[0]].nz[work.given[1]] = values[work.taken[0]]
        elif work.operation == ca.OP_CALL:
            call = called(function, work)
            after = call(_expanded(call.function), [values[i] for i in work.taken])
            values |= {place: after[i] for i, place in enumerate(work.given) if place >= 0}
        else:
            values[work.given[0]] = _operated(work, [values[i] for i in work.taken])
    return ca.Function(function.name(), inputs, results, function.name_in(), function.name_out())


def _operated(work: Instruction, arguments: list[Any]) -> Any:
    if work.operation == ca.OP_CONST:
        return ca.SX(work.constant)
    if work.operation in FUNCTIONS:
        return FUNCTIONS[work.operation](*arguments)
    return (ca.SX.unary if len(arguments) == 1 else ca.SX.binary)(work.operation, *arguments)
