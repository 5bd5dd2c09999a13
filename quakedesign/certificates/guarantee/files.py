"""The file of a guarantee (proofs/FORMAT.md): read strictly, written whole."""

import json
import re
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.guarantee.continuous import ContinuousPeaks
from quakedesign.certificates.guarantee.slow_gain import SlowGain
from quakedesign.certificates.guarantee.statement import Claims, Guarantee, Held
from quakedesign.certificates.guarantee.task import Friction, Task
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.loop import ContinuousLaw, ImplicitRoot, LinearLaw, Power
from quakedesign.loop.implicit_root import MOST_TERMS
from quakedesign.output import write_whole
from quakedesign.sos.exact.strict import NAME, listed, need, parse, read_rational, with_keys

_ROCK = ("density", "shear_modulus", "length", "damping", "normal_stress")
_SPREADS = ("stiffness", "damping", "authority")
_FRICTION = ("static", "least", "largest", "weakening", "strengthening", "rate_slope")
_TIMES = ("step", "delay", "lag")
_NOISE = ("slip", "rate")
_LAW = ("states", "measured", "output", "feedback")
_FAULT = re.compile(r"\w[\w .+-]{0,59}")
_MOST_COEFFICIENTS = 13
_MOST_STATES = 20


def guarantee_text(claim: Guarantee | ContinuousPeaks) -> str:
    """Text of the file."""
    task = claim.task
    change = {} if task.change is None else {"change": str(task.change)}
    slow, start = None, {}
    if isinstance(claim, Guarantee):
        slow, errors = claim.slow_gain, dict(zip(_NOISE, map(str, claim.held.start), strict=True))
        start = {"start": errors} if any(claim.held.start) else {}
    document = {
        "format": 1,
        "kind": "guarantee",
        "fault": {
            "name": task.name,
            **{name: str(getattr(task, name)) for name in _ROCK},
            "spreads": dict(zip(_SPREADS, map(str, task.spreads), strict=True)),
            "friction": {name: str(value) for name, value in asdict(task.friction).items()},
        },
        "reference": {
            "shape": _texts(task.shape),
            "target_slip": str(task.target_slip),
            "operation_time": str(task.operation_time),
        },
        "disturbance": {
            "amplitude": str(task.amplitude),
            **change,
            "growths": {"slip": str(task.growths[0]), "rate": str(task.growths[1])},
        },
        "loop": _loop(claim),
        **start,
        **({} if slow is None else {"slow_gain": {"parts": slow.parts, "growth": str(slow.growth)}}),
        "claims": {name: value.exact for name, value in _claims(claim.claims).items()},
    }
    return json.dumps(document, indent=1) + "\n"


def _loop(claim: Guarantee | ContinuousPeaks) -> dict[str, Any]:
    """What the file says of the law; `rates` in place of `update` and times where the pressure acts at once."""
    if isinstance(claim, ContinuousPeaks):
        law: LinearLaw | ContinuousLaw = claim.law
        times, own = dict[str, str](), dict[str, Any](rates=[_texts(row) for row in claim.law.rates])
        own |= {"of_reference": _texts(claim.law.of_reference)} if any(claim.law.of_reference) else {}
    else:
        law, times = claim.held.law, {name: str(getattr(claim.held, name)) for name in _TIMES}
        times |= {"diffusion": str(claim.held.diffusion)} if claim.held.diffusion else {}
        own = {"update": [_texts(row) for row in claim.held.law.update]}
        own |= {"first": [_texts(row) for row in claim.held.law.first]} if claim.held.law.first else {}
        root = claim.held.law.root
        own |= {} if root is None else {"root": _root_document(root)}
        noise = claim.held.noise
        own |= {"noise": {name: str(noise.get(f"{name}_noise", 0)) for name in _NOISE}} if noise else {}
    return {
        **times,
        "states": list(law.states),
        **own,
        "measured": [_texts(row) for row in law.measured],
        "output": _texts(law.output),
        "feedback": _texts(law.feedback),
    }


def save_guarantee(claim: Guarantee | ContinuousPeaks, path: str | Path) -> None:
    """Write the file whole."""
    write_whole(Path(path), guarantee_text(claim))


def parse_guarantee(text: str) -> Guarantee | ContinuousPeaks:
    """Claim from the text of a file; reading verifies nothing. Raises as `read_guarantee`."""
    return read_guarantee(parse(text))


def read_guarantee(raw: Any) -> Guarantee | ContinuousPeaks:
    """Claim from a parsed file.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    more = {"slow_gain", "start"} & set(raw) if isinstance(raw, dict) else set[str]()
    with_keys(raw, {"format", "kind", "fault", "reference", "disturbance", "loop", "claims"} | more)
    need(type(raw["format"]) is int and raw["format"] == 1, "format must be 1")
    need(raw["kind"] == "guarantee", "kind must be guarantee")
    try:
        task, claims, loop = _task(raw), _read_claims(raw["claims"]), raw["loop"]
        if isinstance(loop, dict) and "rates" in loop:
            need(not more, f"{min(more, default='')} is for a law of samples")
            claim: Guarantee | ContinuousPeaks = ContinuousPeaks(task=task, law=_continuous(loop), claims=claims)
        else:
            slow_gain = _slow_gain(raw["slow_gain"], task) if "slow_gain" in more else None
            held = _held(loop, _start(raw["start"]) if "start" in more else {})
            claim = Guarantee(task=task, held=held, claims=claims, slow_gain=slow_gain)
        need(len(claim.loop.states) <= _MOST_STATES, f"at most {_MOST_STATES} states in all")
    except ParameterError as error:
        raise CertificateError(str(error)) from None
    return claim


def _task(raw: dict[str, Any]) -> Task:
    fault = with_keys(raw["fault"], {"name", *_ROCK, "spreads", "friction"})
    reference = with_keys(raw["reference"], {"shape", "target_slip", "operation_time"})
    given = raw["disturbance"]
    limited = isinstance(given, dict) and "change" in given
    with_keys(given, {"amplitude", "growths"} | ({"change"} if limited else set()))
    growths = with_keys(given["growths"], {"slip", "rate"})
    spreads, friction = with_keys(fault["spreads"], set(_SPREADS)), with_keys(fault["friction"], set(_FRICTION))
    need(isinstance(fault["name"], str) and _FAULT.fullmatch(fault["name"]) is not None, "name must be a short text")
    return Task(
        name=fault["name"],
        **{name: read_rational(fault[name]) for name in _ROCK},
        spreads=(*(read_rational(spreads[name]) for name in _SPREADS),),  # type: ignore[arg-type]
        friction=Friction(**{name: read_rational(friction[name]) for name in _FRICTION}),
        shape=_rationals(reference["shape"], "shape", _MOST_COEFFICIENTS),
        target_slip=read_rational(reference["target_slip"]),
        operation_time=read_rational(reference["operation_time"]),
        amplitude=read_rational(given["amplitude"]),
        change=read_rational(given["change"]) if limited else None,
        growths=(read_rational(growths["slip"]), read_rational(growths["rate"])),
    )


def _slow_gain(raw: Any, task: Task) -> SlowGain:
    with_keys(raw, {"parts", "growth"})
    need(type(raw["parts"]) is int, "parts must be an integer")
    slow_gain = SlowGain(parts=raw["parts"], growth=read_rational(raw["growth"]))
    slow_gain.models(task)
    return slow_gain


def _start(raw: Any) -> dict[str, Fraction]:
    with_keys(raw, set(_NOISE))
    slip, rate = (read_rational(raw[name]) for name in _NOISE)
    need(min(slip, rate) >= 0 and max(slip, rate) > 0, "bounds of the start must be 0 or more, one of them above")
    return {"initial_slip": slip, "initial_slip_rate": rate}


def _held(raw: Any, start: dict[str, Fraction]) -> Held:
    given = {"root", "noise", "diffusion", "first"} & set(raw) if isinstance(raw, dict) else set[str]()
    with_keys(raw, {*_TIMES, "update", *_LAW} | given)
    root = _read_root(raw["root"]) if "root" in given else None
    law = LinearLaw(
        update=_square(raw, "update"), root=root, first=_first(raw) if "first" in given else (), **_rest(raw)
    )
    noise = with_keys(raw["noise"], set(_NOISE)) if "noise" in given else {}
    bounds = {f"{name}_noise": read_rational(value) for name, value in noise.items()}
    diffusion = read_rational(raw["diffusion"]) if "diffusion" in given else Fraction(0)
    need(diffusion > 0 or "diffusion" not in given, "diffusion must be positive where it is given")
    times = {name: read_rational(raw[name]) for name in _TIMES}
    return Held(law=law, diffusion=diffusion, **times, **bounds, **start)


def _first(raw: dict[str, Any]) -> tuple[tuple[Fraction, ...], ...]:
    rows = listed(raw["first"], "first", length=len(listed(raw["states"], "states", _MOST_STATES)))
    return tuple(_ends(row, "first") for row in rows)


def _continuous(raw: Any) -> ContinuousLaw:
    fed = {"of_reference"} if "of_reference" in raw else set()
    with_keys(raw, {"rates", *_LAW} | fed)
    of_reference = _ends(raw["of_reference"], "of_reference") if fed else (Fraction(0), Fraction(0))
    return ContinuousLaw(of_reference=of_reference, rates=_square(raw, "rates"), **_rest(raw))


def _square(raw: dict[str, Any], name: str) -> tuple[tuple[Fraction, ...], ...]:
    size = len(listed(raw["states"], "states", _MOST_STATES))
    return tuple(_rationals(row, name, size) for row in listed(raw[name], name, size))


def _rest(raw: dict[str, Any]) -> dict[str, Any]:
    """Everything of a law but the matrix of its own states."""
    names = listed(raw["states"], "states", _MOST_STATES)
    need(all(isinstance(n, str) and NAME.fullmatch(n) for n in names), "states must be names")
    return {
        "states": tuple(names),
        "measured": tuple(_rationals(row, "measured", 3) for row in listed(raw["measured"], "measured", len(names))),
        "output": _rationals(raw["output"], "output", len(names)),
        "feedback": _rationals(raw["feedback"], "feedback", 3),
    }


def _root_document(root: ImplicitRoot) -> dict[str, Any]:
    return {"pull": _sum_document(root.pull), "slopes": _texts(root.slopes), "remainder": str(root.remainder)}


def _sum_document(terms: tuple[Power, ...]) -> list[dict[str, Any]]:
    return [
        {
            "factor": _texts(term.factor),
            "power": str(term.exponent),
            "of": term.argument if isinstance(term.argument, str) else _sum_document(term.argument),
        }
        for term in terms
    ]


def _read_root(raw: Any) -> ImplicitRoot:
    with_keys(raw, {"pull", "slopes", "remainder"})
    slopes, remainder = _ends(raw["slopes"], "slopes"), read_rational(raw["remainder"])
    return ImplicitRoot(pull=_read_sum(raw["pull"]), slopes=slopes, remainder=remainder)


def _read_sum(raw: Any) -> tuple[Power, ...]:
    return tuple(_read_term(term) for term in listed(raw, "a sum of an implicit step", MOST_TERMS))


def _read_term(raw: Any) -> Power:
    with_keys(raw, {"factor", "power", "of"})
    factor, inner = _ends(raw["factor"], "a factor"), raw["of"]
    argument = inner if isinstance(inner, str) else _read_sum(inner)
    return Power(factor=factor, exponent=read_rational(raw["power"]), argument=argument)


def _read_claims(raw: Any) -> Claims:
    names = set(Claims.__dataclass_fields__)
    values = {name: read_rational(value) for name, value in with_keys(raw, names).items()}
    return Claims(
        least_pressure=LowerBound(values.pop("least_pressure")),
        **{name: UpperBound(value) for name, value in values.items()},
    )


def _claims(claims: Claims) -> dict[str, Any]:
    return {name: getattr(claims, name) for name in Claims.__dataclass_fields__}


def _texts(values: tuple[Fraction, ...]) -> list[str]:
    return [str(v) for v in values]


def _ends(raw: Any, what: str) -> tuple[Fraction, Fraction]:
    low, high = (read_rational(v) for v in listed(raw, what, length=2))
    return low, high


def _rationals(raw: Any, what: str, most: int) -> tuple[Fraction, ...]:
    return tuple(read_rational(v) for v in listed(raw, what, most))
