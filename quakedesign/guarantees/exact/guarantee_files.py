"""Certificate files of guarantees (proofs/FORMAT.md): strict reading, atomic writing."""

import json
import re
from collections.abc import Iterable
from dataclasses import asdict, fields
from fractions import Fraction
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound, exact_text
from quakedesign.files import write_whole
from quakedesign.guarantees.exact.implicit_root_files import read_root, root_document
from quakedesign.guarantees.exact.invariant_set import MOST_FACETS, MOST_PIECES, InvariantPolytope, require_fit
from quakedesign.guarantees.exact.loop import Held
from quakedesign.guarantees.exact.plant_guarantee import PlantGuarantee, plant_document, read_plant_guarantee
from quakedesign.guarantees.exact.sliding_small_gain import SlidingClaims, loop_of, model_of
from quakedesign.guarantees.exact.small_gain import SlowGain
from quakedesign.guarantees.exact.statement import Claims, ContinuousPeaks, Guarantee, SlidingGuarantee
from quakedesign.laws import LinearLaw
from quakedesign.loop import ContinuousLaw
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.certificate_files import (
    GUARANTEE,
    SLOW_SLIDING,
    STICK_SLIP,
    UNCERTAIN_PLANT,
    kind_of,
    read_json,
)
from quakedesign.plant.ranges import FaultPlant, Friction
from quakedesign.plant.sliding_plant import AXES, MOST_CELLS, Cuts, SlidingPlant, cells
from quakedesign.sos.exact.strict import (
    headed,
    listed,
    need,
    parse,
    read_ends,
    read_exactly,
    read_names,
    read_rational,
    read_row,
    texts,
    with_keys,
)
from quakedesign.text import shown

if TYPE_CHECKING:
    from quakedesign.guarantees.exact.stick_slip_guarantee import StickSlipGuarantee

Claim = Union[Guarantee, ContinuousPeaks, SlidingGuarantee, "StickSlipGuarantee"]
"""What files about a fault claim."""
_Claimed = TypeVar("_Claimed")
_ROCK = ("density", "shear_modulus", "length", "damping")
_SPREADS = ("stiffness", "damping", "authority")
_TIMES = ("step", "delay", "lag")
_SLIDING_TIMES = (*_TIMES, "diffusion", "slip_noise")
_SLIDING_REFERENCE = ("rate", "distance", "ramp")
_NOISE = ("slip", "rate")
_LIMITS, _JITTER = ("least", "largest"), ("measured", "delay")
_LAW = ("states", "measured", "output", "feedback")
_MORE = {"root", "noise", "diffusion", "first", "jitter", "pump", "applied", "longest", "of_reference"}
_FAULT = re.compile(r"\w[\w .-]{0,59}")
_MOST_COEFFICIENTS = 13
_MOST_STATES = 20
_ZERO = Fraction(0)


def guarantee_document(claim: Claim | PlantGuarantee) -> dict[str, Any]:
    """Content of the file."""
    if not hasattr(claim, "claims"):
        raise ParameterError(f"a claim must be a guarantee. Received {shown(claim)}. Prove one with guarantee.")
    if isinstance(claim, PlantGuarantee):
        return plant_document(claim)
    if isinstance(claim, Guarantee | ContinuousPeaks):
        about = _of_tracking(claim)
    else:
        about = _of_sliding(claim) if isinstance(claim, SlidingGuarantee) else _of_stick_slip(claim)
    bounds = {part.name: getattr(claim.claims, part.name) for part in fields(claim.claims)}
    claims = {name: bound.exact for name, bound in bounds.items() if bound is not None}
    return {"format": 1, **about, "claims": claims}


def guarantee_text(claim: Claim | PlantGuarantee) -> str:
    """Text of the file."""
    return json.dumps(guarantee_document(claim), indent=1) + "\n"


def load_guarantee(path: str | Path) -> Claim | PlantGuarantee:
    """Read a file of `guarantee`; reading verifies nothing, `check` of what is read does.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Guarantee, ContinuousPeaks, SlidingGuarantee, StickSlipGuarantee or PlantGuarantee
        The first has a ``controller`` for `simulate`, `export_controller` and `loop_transfer`: the law with its T_s and
        its limit at rest, behind the delay, lag and rock that it is proved for.

    Raises
    ------
    CertificateError
        When the file cannot be read or breaks a rule of FORMAT.md.
    """
    return read_guarantee(read_json(path))


def save_guarantee(claim: Claim | PlantGuarantee, path: str | Path) -> None:
    """Write the file whole."""
    write_whole(Path(path), guarantee_text(claim))


def parse_guarantee(text: str) -> Any:
    """Claim from the text of a file; reading verifies nothing. Raises as `read_guarantee`."""
    return read_guarantee(parse(text))


def read_guarantee(raw: Any) -> Claim | PlantGuarantee:
    """Claim from a parsed file.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    try:
        kind = kind_of(raw)
        if kind == STICK_SLIP:
            headed(raw, {"fault", "reference", "disturbance", "loop", "set", "claims"}, STICK_SLIP)
            reader = partial(read_claims, raw=raw)
            return cast("StickSlipGuarantee", _stick_slip().read_stick_slip(raw, read_task(raw), reader))
        if kind == UNCERTAIN_PLANT:
            return read_plant_guarantee(raw)
        return _read_sliding(raw) if kind == SLOW_SLIDING else _read_tracking(raw)
    except ParameterError as error:
        raise CertificateError(str(error)) from None


def _exactly(value: Any, names: Iterable[str]) -> dict[str, str]:
    return {name: exact_text(getattr(value, name)) for name in names}


def _of_tracking(claim: Guarantee | ContinuousPeaks) -> dict[str, Any]:
    slow, start, reach = None, {}, None
    if isinstance(claim, Guarantee):
        reach = claim.reach
        slow, errors = claim.slow_gain, dict(zip(_NOISE, texts(claim.held.start), strict=True))
        start = {"start": errors} if any(claim.held.start) else {}
    return {
        "kind": GUARANTEE,
        **task_document(claim.task),
        "loop": _loop(claim),
        **start,
        **({} if slow is None else {"slow_gain": {"parts": slow.parts, "growth": str(slow.growth)}}),
        **({} if reach is None else {"reach": _reach_document(reach)}),
    }


def task_document(task: FaultPlant) -> dict[str, Any]:
    """Fault, reference and disturbance."""
    change = {} if task.change is None else {"change": str(task.change)}
    return {
        "fault": {
            "name": task.name,
            **_exactly(task, (*_ROCK, "normal_stress")),
            "spreads": dict(zip(_SPREADS, texts(task.spreads), strict=True)),
            "friction": {name: str(value) for name, value in asdict(task.friction).items()},
        },
        "reference": {"shape": texts(task.shape), **_exactly(task, ("target_slip", "operation_time"))},
        "disturbance": {
            "amplitude": str(task.amplitude),
            **change,
            "growths": dict(zip(_NOISE, texts(task.growths), strict=True)),
        },
    }


def _stick_slip() -> Any:
    """Module of files about the stick–slip plant, loaded for these alone: it takes NumPy."""
    return import_module("quakedesign.guarantees.exact.stick_slip_files")


def _of_stick_slip(claim: "StickSlipGuarantee") -> dict[str, Any]:
    return {"kind": STICK_SLIP, **task_document(claim.task), **_stick_slip().stick_slip_document(claim)}


def _of_sliding(claim: SlidingGuarantee) -> dict[str, Any]:
    task, law = claim.task, claim.held.law
    return {
        "kind": SLOW_SLIDING,
        "fault": {
            "name": task.name,
            **_exactly(task, _ROCK),
            **{name: texts(task.ranges[name]) for name in AXES},
            **({"state_law": task.state_law} if task.state_law != "ageing" else {}),
            **({"regularised": True} if task.regularised else {}),
        },
        "reference": _exactly(task, (*_SLIDING_REFERENCE, *(("swing",) if task.swing else ()))),
        "stress": str(task.stress),
        "loop": {
            **_exactly(claim.held, _SLIDING_TIMES),
            "states": list(law.states),
            "update": [texts(row) for row in law.update],
            "measured": [str(row[0]) for row in law.measured],
            "output": texts(law.output),
            "feedback": str(law.feedback[0]),
        },
        "cells": [[] if cut is None else [cut[0], str(cut[1])] for cut in claim.cuts],
    }


def _loop(claim: Guarantee | ContinuousPeaks) -> dict[str, Any]:
    """What the file says of the law; `rates` in place of `update` and times where the pressure acts at once."""
    if isinstance(claim, ContinuousPeaks):
        law: LinearLaw | ContinuousLaw = claim.law
        times, own = dict[str, str](), dict[str, Any](rates=[texts(row) for row in claim.law.rates])
        own |= {"of_reference": texts(claim.law.of_reference)} if any(claim.law.of_reference) else {}
    else:
        law, times = claim.held.law, _exactly(claim.held, _TIMES)
        times |= {"diffusion": str(claim.held.diffusion)} if claim.held.diffusion else {}
        own = {"update": [texts(row) for row in claim.held.law.update]}
        own |= {"first": [texts(row) for row in claim.held.law.first]} if claim.held.law.first else {}
        own |= {"applied": texts(claim.held.law.applied)} if claim.held.law.applied else {}
        moved = claim.held.law.of_reference
        own |= {"of_reference": [texts(row) for row in moved]} if moved else {}
        root = claim.held.law.root
        own |= {} if root is None else {"root": root_document(root)}
        noise = claim.held.noise
        own |= {"noise": {name: str(noise.get(f"{name}_noise", 0)) for name in _NOISE}} if any(noise.values()) else {}
        jitter = dict(zip(_JITTER, (claim.held.jitter, claim.held.delay_jitter), strict=True))
        jitter |= {"mean": claim.held.averaging} if claim.held.averaging else {}
        own |= {"jitter": {name: str(v) for name, v in jitter.items()}} if any(jitter.values()) else {}
        own |= {"pump": _pump_document(claim.held)} if claim.held.pump else {}
        own |= {"longest": str(claim.held.longest_step)} if claim.held.longest_step else {}
    return {
        **times,
        "states": list(law.states),
        **own,
        "measured": [texts(row) for row in law.measured],
        "output": texts(law.output),
        "feedback": texts(law.feedback),
    }


def _read_tracking(raw: Any) -> Guarantee | ContinuousPeaks:
    more = {"slow_gain", "start", "reach"} & set(raw) if isinstance(raw, dict) else set[str]()
    headed(raw, {"fault", "reference", "disturbance", "loop", "claims"} | more, GUARANTEE)
    task, claims, loop = read_task(raw), read_claims(Claims, raw), raw["loop"]
    if isinstance(loop, dict) and "rates" in loop:
        need(not more, f"{min(more, default='')} is for a law of samples")
        claim: Guarantee | ContinuousPeaks = ContinuousPeaks(task=task, law=_continuous(loop), claims=claims)
    else:
        slow_gain = _slow_gain(raw["slow_gain"], task) if "slow_gain" in more else None
        held = _held(loop, _start(raw["start"]) if "start" in more else {})
        reach = _reach(raw["reach"]) if "reach" in more else None
        free = bool(held.longest_step)
        need(free == (reach is not None), "reach must be given for aperiodic sampling, and for that alone")
        need(not free or slow_gain is None, "aperiodic sampling must have no slow gain")
        claim = Guarantee(task=task, held=held, claims=claims, slow_gain=slow_gain, reach=reach)
        if reach is not None:
            require_fit(claim.loop, reach)
    loop = claim.loop
    told = "asked" in loop.outputs or claims.least_asked is None
    need(told, "without a lag and rock the claims must not tell the valve's pressure from the fault's")
    counted = "stepped" in loop.outputs or claims.largest_step is None
    need(counted, "a largest step is claimed of a loop with jitter or a pump of some rate alone")
    paced = isinstance(claim, Guarantee) and claim.held.ramp
    need(not paced or claims.largest_step is not None, "the rate of a pump needs a claim of the largest step")
    pumped = isinstance(claim, Guarantee) and claim.held.pump and "asked" in loop.outputs
    need(not pumped or claims.least_asked is not None, "a pump behind which there is a lag or rock needs claims of it")
    _require_few(loop.states)
    return claim


def _read_sliding(raw: Any) -> SlidingGuarantee:
    headed(raw, {"fault", "reference", "stress", "loop", "cells", "claims"}, SLOW_SLIDING)
    task, held, claims = _sliding_task(raw), _sliding_held(raw["loop"]), read_claims(SlidingClaims, raw)
    claim = SlidingGuarantee(task=task, held=held, cuts=_cuts(raw["cells"]), claims=claims)
    cells(task, claim.cuts)
    model = model_of(task, claims)
    _require_few(loop_of(held, model, task).states if model is not None else ())
    return claim


def _require_few(states: tuple[str, ...]) -> None:
    need(len(states) <= _MOST_STATES, f"at most {_MOST_STATES} states in all")


def read_claims(kind: type[_Claimed], raw: dict[str, Any]) -> _Claimed:
    """Claims of a parsed file; a kind is a dataclass of bounds."""
    given, known = raw["claims"], fields(cast(Any, kind))
    more = {part.name for part in known if part.default is None}
    left_out = set[str]()
    for group in (more - {"largest_step"}, more & {"largest_step"}):
        left_out |= group if isinstance(given, dict) and not group & set(given) else set[str]()
    found = read_exactly(given, (part.name for part in known if part.name not in left_out))
    ends: dict[str, Any] = {name: LowerBound if name.startswith("least") else UpperBound for name in found}
    return kind(**{name: ends[name](value) for name, value in found.items()})


def _name(fault: dict[str, Any]) -> str:
    name = fault["name"]
    need(
        isinstance(name, str) and _FAULT.fullmatch(name) is not None,
        "name must be at most 60 letters, digits, spaces and _ . -",
    )
    return str(name)


def read_task(raw: dict[str, Any]) -> FaultPlant:
    """Fault, reference and disturbance of a parsed file."""
    rock = (*_ROCK, "normal_stress")
    fault = with_keys(raw["fault"], {"name", *rock, "spreads", "friction"})
    reference = with_keys(raw["reference"], {"shape", "target_slip", "operation_time"})
    given = raw["disturbance"]
    limited = isinstance(given, dict) and "change" in given
    with_keys(given, {"amplitude", "growths"} | ({"change"} if limited else set()))
    stiffness, damping, authority = read_exactly(fault["spreads"], _SPREADS).values()
    slip, rate = read_exactly(given["growths"], _NOISE).values()
    return FaultPlant(
        name=_name(fault),
        **{name: read_rational(fault[name]) for name in rock},
        spreads=(stiffness, damping, authority),
        friction=Friction(**read_exactly(fault["friction"], (part.name for part in fields(Friction)))),
        shape=read_row(reference["shape"], "shape", _MOST_COEFFICIENTS),
        target_slip=read_rational(reference["target_slip"]),
        operation_time=read_rational(reference["operation_time"]),
        amplitude=read_rational(given["amplitude"]),
        change=read_rational(given["change"]) if limited else None,
        growths=(slip, rate),
    )


def _sliding_task(raw: dict[str, Any]) -> SlidingPlant:
    told = {"state_law": "slip", "regularised": True}
    more: Any = {name: raw["fault"][name] for name in told if isinstance(raw["fault"], dict) and name in raw["fault"]}
    fault = with_keys(raw["fault"], {"name", *_ROCK, *AXES, *more})
    for name, value in more.items():
        need(json.dumps(value) == json.dumps(told[name]), f"{name} must be {json.dumps(told[name])} where told")
    swings = ("swing",) if isinstance(raw["reference"], dict) and "swing" in raw["reference"] else ()
    more |= {name: read_rational(fault[name]) for name in _ROCK}
    more |= read_exactly(raw["reference"], (*_SLIDING_REFERENCE, *swings))
    need(not swings or more["swing"] > 0, "swing must be positive where it is given")
    ranges = {name: read_ends(fault[name], name) for name in AXES}
    return SlidingPlant(name=_name(fault), ranges=ranges, stress=read_rational(raw["stress"]), **more)


def _slow_gain(raw: Any, task: FaultPlant) -> SlowGain:
    with_keys(raw, {"parts", "growth"})
    need(type(raw["parts"]) is int, "parts must be an integer")
    slow_gain = SlowGain(parts=raw["parts"], growth=read_rational(raw["growth"]))
    slow_gain.models(task)
    return slow_gain


def _start(raw: Any) -> dict[str, Fraction]:
    slip, rate = read_exactly(raw, _NOISE).values()
    need(min(slip, rate) >= 0 and max(slip, rate) > 0, "bounds of the start must be 0 or more, one of them above")
    return {"initial_slip": slip, "initial_slip_rate": rate}


def _held(raw: Any, start: dict[str, Fraction]) -> Held:
    given = _MORE & set(raw) if isinstance(raw, dict) else set[str]()
    with_keys(raw, {*_TIMES, "update", *_LAW} | given)
    root = read_root(raw["root"]) if "root" in given else None
    first = _first(raw) if "first" in given else ()
    applied = read_row(raw["applied"], "applied", length=_count(raw)) if "applied" in given else ()
    moved = raw["of_reference"] if "of_reference" in given else None
    rows = () if moved is None else listed(moved, "of_reference", length=_count(raw) + 1)
    of_reference = tuple(read_ends(row, "of_reference") for row in rows)
    need(moved is None or any(map(any, of_reference)), "of_reference must not be zero where it is given")
    law = LinearLaw(
        update=_square(raw, "update"), root=root, first=first, applied=applied, of_reference=of_reference, **_rest(raw)
    )
    noise = read_exactly(raw["noise"], _NOISE) if "noise" in given else {}
    diffusion = read_rational(raw["diffusion"]) if "diffusion" in given else _ZERO
    need(diffusion > 0 or "diffusion" not in given, "diffusion must be positive where it is given")
    times: dict[str, Any] = {name: read_rational(raw[name]) for name in _TIMES}
    times |= {f"{name}_noise": v for name, v in noise.items()} | start
    times |= _jitter(raw["jitter"]) if "jitter" in given else {}
    times |= _pump(raw["pump"]) if "pump" in given else {}
    times |= {"longest_step": read_rational(raw["longest"])} if "longest" in given else {}
    need(times.get("longest_step", 1) > 0, "the longest step must be positive where it is given")
    return Held(law=law, diffusion=diffusion, **times)


def _jitter(raw: Any) -> dict[str, Fraction]:
    """That of measurements and of the delay, and over how long measurements are means."""
    mean = ("mean",) * (isinstance(raw, dict) and "mean" in raw)
    measured, delay, *over = read_exactly(raw, (*_JITTER, *mean)).values()
    need(min(measured, delay) >= 0, "jitter must be 0 or more")
    need(measured + delay > 0 or bool(over), "jitter must be there where it is given")
    need(min(over, default=1) > 0, "a mean must be over some time where it is given")
    return {"jitter": measured, "delay_jitter": delay, "averaging": over[0] if over else _ZERO}


def _reach_document(reach: InvariantPolytope) -> dict[str, Any]:
    return {
        "inputs": texts(reach.inputs),
        "facets": [texts(row) for row in reach.facets],
        "at_samples": [[list(basis) for basis in line] for line in reach.at_samples],
        "between": [[list(basis) for basis in line] for line in reach.between],
    }


def _reach(raw: Any) -> InvariantPolytope:
    with_keys(raw, {"inputs", "facets", "at_samples", "between"})
    return InvariantPolytope(
        inputs=read_row(raw["inputs"], "inputs", _MOST_STATES),
        facets=tuple(read_row(row, "a facet", _MOST_STATES) for row in listed(raw["facets"], "facets", MOST_FACETS)),
        at_samples=_bases(raw["at_samples"]),
        between=_bases(raw["between"]),
    )


def _bases(raw: Any) -> tuple[tuple[tuple[int, ...], ...], ...]:
    lines = [listed(line, "bases", MOST_PIECES + 1) for line in listed(raw, "bases", MOST_FACETS)]
    found = tuple(tuple(tuple(listed(basis, "a basis", _MOST_STATES)) for basis in line) for line in lines)
    need(all(type(i) is int for line in found for basis in line for i in basis), "numbers of facets must be integers")
    return found


def _pump_document(held: Held) -> dict[str, str]:
    """The pump, and how long it takes at most where it has a rate."""
    pump = held.pump.to_dict() if held.pump else {}
    return pump | ({"ramp": str(held.ramp)} if "rate" in pump else {})


def _pump(raw: Any) -> dict[str, Any]:
    """A pump and its ramp."""
    paced = isinstance(raw, dict) and "rate" in raw
    limited = not paced or not set(raw) <= {"rate", "ramp"}
    given = read_exactly(raw, (*_LIMITS * limited, *("rate", "ramp") * paced))
    ramp = given.pop("ramp", _ZERO)
    need(ramp > 0 or not paced, "a ramp must be positive")
    return {"pump": Pump(**given), "ramp": ramp}


def _sliding_held(raw: Any) -> Held:
    with_keys(raw, {*_SLIDING_TIMES, "update", *_LAW})
    states = read_names(raw["states"], "states", _MOST_STATES)
    law = LinearLaw(
        states=states,
        update=_square(raw, "update"),
        measured=tuple((v, _ZERO) for v in read_row(raw["measured"], "measured", length=len(states))),
        output=read_row(raw["output"], "output", length=len(states)),
        feedback=(read_rational(raw["feedback"]), _ZERO),
    )
    around: dict[str, Any] = {name: read_rational(raw[name]) for name in _SLIDING_TIMES}
    return Held(law=law, **around)


def _cuts(raw: Any) -> Cuts:
    given = (listed(entry, "a cut", 2) for entry in listed(raw, "cells", 2 * MOST_CELLS))
    return tuple(_cut(entry) if entry else None for entry in given)


def _cut(entry: list[Any]) -> tuple[str, Fraction]:
    axis, at = listed(entry, "a cut", length=2)
    need(axis in AXES, f"a cut must be across one of {', '.join(AXES)}")
    return axis, read_rational(at)


def _first(raw: dict[str, Any]) -> tuple[tuple[Fraction, ...], ...]:
    rows = listed(raw["first"], "first", length=_count(raw))
    return tuple(read_ends(row, "first") for row in rows)


def _continuous(raw: Any) -> ContinuousLaw:
    fed = {"of_reference"} if "of_reference" in raw else set()
    with_keys(raw, {"rates", *_LAW} | fed)
    of_reference = read_ends(raw["of_reference"], "of_reference") if fed else (_ZERO, _ZERO)
    return ContinuousLaw(of_reference=of_reference, rates=_square(raw, "rates"), **_rest(raw))


def _square(raw: dict[str, Any], name: str) -> tuple[tuple[Fraction, ...], ...]:
    size = _count(raw)
    return tuple(read_row(row, name, length=size) for row in listed(raw[name], name, length=size))


def _count(raw: dict[str, Any]) -> int:
    return len(listed(raw["states"], "states", _MOST_STATES))


def _rest(raw: dict[str, Any]) -> dict[str, Any]:
    """Everything of a law but the matrix of its own states."""
    names = read_names(raw["states"], "states", _MOST_STATES)
    return {
        "states": names,
        "measured": tuple(read_row(row, "measured", 3) for row in listed(raw["measured"], "measured", len(names))),
        "output": read_row(raw["output"], "output", len(names)),
        "feedback": read_row(raw["feedback"], "feedback", 3),
    }
