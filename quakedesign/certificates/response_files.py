"""The part of a certificate file that bounds outputs under bounded inputs, read and written."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from quakedesign.certificates.claim import Loop
from quakedesign.certificates.response import InputResponse, InvariantSet, OutputBound, Response
from quakedesign.certificates.term_files import LIMITS, plain_terms, read_terms
from quakedesign.sos.exact.strict import NAME, listed, need, objected, read_rational, with_keys


def limits_of(raw: Any) -> tuple[Fraction, ...]:
    """Limits of one input."""
    entries = with_keys(raw, {"limits", "sets", "bounds"})["limits"]
    return tuple(read_rational(v) for v in listed(entries, "limits", 2))


def read_response(raw: dict[str, Any], loop: Loop) -> Response:
    """Claim of a parsed file about a loop. Raises CertificateError when it breaks a rule of FORMAT.md."""
    still, states = replace(loop, inputs={}), tuple(loop.states)
    outputs = objected(raw["outputs"], "outputs", LIMITS["outputs"])
    need(all(NAME.fullmatch(name) for name in outputs), "outputs need names")
    return Response(
        outputs={name: read_terms(row, still, states) for name, row in outputs.items()},
        parts={
            name: _input_response(entry, still, (*states, *((name,) if len(loop.inputs[name]) == 2 else ())))
            for name, entry in raw["inputs"].items()
        },
    )


def _input_response(raw: dict[str, Any], loop: Loop, variables: tuple[str, ...]) -> InputResponse:
    sets, bounds = [], objected(raw["bounds"], "bounds", LIMITS["outputs"])
    for entry in listed(raw["sets"], "sets", LIMITS["sets"]):
        parts = with_keys(entry, {"V", "decay", "shares", "borrowed"})
        sets.append(
            InvariantSet(
                function=read_terms(parts["V"], loop, variables),
                decay=read_rational(parts["decay"]),
                shares=_numbers(parts["shares"], "shares"),
                borrowed=_numbers(parts["borrowed"], "borrowed"),
            )
        )
    return InputResponse(sets=tuple(sets), bounds={name: _bound(entry) for name, entry in bounds.items()})


def _bound(raw: Any) -> OutputBound:
    entries = with_keys(raw, {"bound", "weights"})
    return OutputBound(bound=read_rational(entries["bound"]), weights=_numbers(entries["weights"], "weights"))


def _numbers(raw: Any, what: str) -> tuple[Fraction, ...]:
    return tuple(read_rational(v) for v in listed(raw, what, LIMITS["sets"]))


def plain_response(response: Response, loop: Loop) -> dict[str, Any]:
    """Inverse of `read_response`."""
    return {
        "inputs": {
            name: {
                "limits": _plain_numbers(loop.inputs[name]),
                "sets": [_plain_set(own) for own in part.sets],
                "bounds": {
                    output: {"bound": str(claim.bound), "weights": _plain_numbers(claim.weights)}
                    for output, claim in part.bounds.items()
                },
            }
            for name, part in response.parts.items()
        },
        "outputs": {name: plain_terms(row) for name, row in response.outputs.items()},
    }


def _plain_set(own: InvariantSet) -> dict[str, Any]:
    return {
        "V": plain_terms(own.function),
        "decay": str(own.decay),
        "shares": _plain_numbers(own.shares),
        "borrowed": _plain_numbers(own.borrowed),
    }


def _plain_numbers(values: Sequence[Fraction]) -> list[str]:
    return [str(v) for v in values]
