"""The file of a guarantee of slow sliding (proofs/FORMAT.md): read strictly, written whole."""

import json
import re
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.bounds import UpperBound
from quakedesign.certificates.guarantee.statement import Held
from quakedesign.certificates.kinds import SLOW_SLIDING
from quakedesign.certificates.slow_sliding.cells import MOST_CELLS, Cuts, cells
from quakedesign.certificates.slow_sliding.statement import SlidingGuarantee
from quakedesign.certificates.slow_sliding.task import AXES, SlidingTask
from quakedesign.certificates.slow_sliding.theorem import SlidingClaims, loop_of, model_of
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.loop import LinearLaw
from quakedesign.output import write_whole
from quakedesign.sos.exact.strict import NAME, listed, need, parse, read_rational, with_keys

_ROCK = ("density", "shear_modulus", "length", "damping")
_REFERENCE = ("rate", "distance", "ramp")
_TIMES = ("step", "delay", "lag", "diffusion", "slip_noise")
_LAW = ("states", "update", "measured", "output", "feedback")
_CLAIMS = tuple(SlidingClaims.__dataclass_fields__)
_FAULT = re.compile(r"\w[\w .+-]{0,59}")
_MOST_STATES = 20
_ZERO = Fraction(0)


def sliding_text(claim: SlidingGuarantee) -> str:
    """Text of the file."""
    task, held = claim.task, claim.held
    law = held.law
    document = {
        "format": 1,
        "kind": SLOW_SLIDING,
        "fault": {
            "name": task.name,
            **{name: str(getattr(task, name)) for name in _ROCK},
            **{name: [str(end) for end in task.ranges[name]] for name in AXES},
        },
        "reference": {name: str(getattr(task, name)) for name in _REFERENCE},
        "stress": str(task.stress),
        "loop": {
            **{name: str(getattr(held, name)) for name in _TIMES},
            "states": list(law.states),
            "update": [[str(v) for v in row] for row in law.update],
            "measured": [str(row[0]) for row in law.measured],
            "output": [str(v) for v in law.output],
            "feedback": str(law.feedback[0]),
        },
        "cells": [[] if cut is None else [cut[0], str(cut[1])] for cut in claim.cuts],
        "claims": {name: getattr(claim.claims, name).exact for name in _CLAIMS},
    }
    return json.dumps(document, indent=1) + "\n"


def save_sliding(claim: SlidingGuarantee, path: str | Path) -> None:
    """Write the file whole."""
    write_whole(Path(path), sliding_text(claim))


def parse_sliding(text: str) -> SlidingGuarantee:
    """Claim from the text of a file; reading verifies nothing. Raises as `read_sliding`."""
    return read_sliding(parse(text))


def read_sliding(raw: Any) -> SlidingGuarantee:
    """Claim from a parsed file.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    with_keys(raw, {"format", "kind", "fault", "reference", "stress", "loop", "cells", "claims"})
    need(type(raw["format"]) is int and raw["format"] == 1, "format must be 1")
    need(raw["kind"] == SLOW_SLIDING, f"kind must be {SLOW_SLIDING}")
    try:
        task, held = _task(raw), _held(raw["loop"])
        given = with_keys(raw["claims"], set(_CLAIMS))
        claims = SlidingClaims(**{name: UpperBound(read_rational(given[name])) for name in _CLAIMS})
        claim = SlidingGuarantee(task=task, held=held, cuts=_cuts(raw["cells"]), claims=claims)
        cells(task, claim.cuts)
        model = model_of(task, claims)
        need(model is None or len(loop_of(held, model, task).states) <= _MOST_STATES, "at most 20 states in all")
    except ParameterError as error:
        raise CertificateError(str(error)) from None
    return claim


def _task(raw: dict[str, Any]) -> SlidingTask:
    fault = with_keys(raw["fault"], {"name", *_ROCK, *AXES})
    reference = with_keys(raw["reference"], set(_REFERENCE))
    need(isinstance(fault["name"], str) and _FAULT.fullmatch(fault["name"]) is not None, "name must be a short text")
    return SlidingTask(
        name=fault["name"],
        **{name: read_rational(fault[name]) for name in _ROCK},
        ranges={name: _ends(fault[name], name) for name in AXES},
        **{name: read_rational(reference[name]) for name in _REFERENCE},
        stress=read_rational(raw["stress"]),
    )


def _held(raw: Any) -> Held:
    with_keys(raw, {*_TIMES, *_LAW})
    names = listed(raw["states"], "states", _MOST_STATES)
    need(all(isinstance(n, str) and NAME.fullmatch(n) for n in names), "states must be names")
    size = len(names)
    law = LinearLaw(
        states=tuple(names),
        update=tuple(_row(row, "update", size) for row in listed(raw["update"], "update", length=size)),
        measured=tuple((v, _ZERO) for v in _row(raw["measured"], "measured", size)),
        output=_row(raw["output"], "output", size),
        feedback=(read_rational(raw["feedback"]), _ZERO),
    )
    return Held(law=law, **{name: read_rational(raw[name]) for name in _TIMES})


def _cuts(raw: Any) -> Cuts:
    given = (listed(entry, "a cut", 2) for entry in listed(raw, "cells", 2 * MOST_CELLS))
    return tuple(_cut(entry) if entry else None for entry in given)


def _cut(entry: list[Any]) -> tuple[str, Fraction]:
    axis, at = listed(entry, "a cut", length=2)
    need(axis in AXES, f"a cut must be across one of {', '.join(AXES)}")
    return axis, read_rational(at)


def _ends(raw: Any, what: str) -> tuple[Fraction, Fraction]:
    low, high = (read_rational(v) for v in listed(raw, what, length=2))
    return low, high


def _row(raw: Any, what: str, size: int) -> tuple[Fraction, ...]:
    return tuple(read_rational(v) for v in listed(raw, what, length=size))
