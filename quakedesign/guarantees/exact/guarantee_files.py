"""Certificate files of guarantees (proofs/FORMAT.md): typed objects, reading, writing.

Each class declares its keys; `quakedesign.sos.exact.strict` reads and writes objects by their types. Numbers are in SI
units.
"""

import json
from collections.abc import Callable
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Union, cast

from msgspec import Meta
from msgspec.structs import astuple

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.files import Json, write_whole
from quakedesign.guarantees.exact.file_entries import (
    MOST_STATES,
    FaultName,
    ImplicitStepEntries,
    Matrix,
    Names,
    Pair,
    Row,
    SlipAndRate,
    TaskEntries,
    power_entries,
    task_entries,
)
from quakedesign.guarantees.exact.invariant_set import InvariantPolytope, require_fit
from quakedesign.guarantees.exact.plant_proof import PlantProof, plant_entries, read_plant_guarantee
from quakedesign.guarantees.exact.sampled_loop import SampledLoop
from quakedesign.guarantees.exact.sliding_proof import SlidingProof
from quakedesign.guarantees.exact.sliding_small_gain import SlidingClaims, loop_of, model_of
from quakedesign.guarantees.exact.small_gain import VaryingGain
from quakedesign.guarantees.exact.tracking_proof import Claims, ContinuousProof, TrackingProof
from quakedesign.laws import LinearLaw
from quakedesign.loop import ContinuousLaw, StateLaw
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.certificate_files import (
    GUARANTEE,
    SLOW_SLIDING,
    STICK_SLIP,
    UNCERTAIN_PLANT,
    kind_of,
    read_json,
)
from quakedesign.plant.sliding_plant import AXES, MOST_CELLS, Cuts, SlidingPlant, cells
from quakedesign.sos.exact.strict import Entries, headed, made, need, parse, read_as, read_rational, written
from quakedesign.text import shown

if TYPE_CHECKING:
    from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof

Claim = Union[TrackingProof, ContinuousProof, SlidingProof, "StickSlipProof"]
"""Types of the claims in certificate files about a fault."""
_ZERO = Fraction(0)

# ----------------------------------------------------------------------
# Files of the kind ``guarantee``: a law with zero-order hold, or one in continuous time, on a moving reference.


class JitterEntries(Entries):
    """Timing errors [s]."""

    measured: Fraction
    delay: Fraction
    mean: Fraction = _ZERO


class PumpEntries(Entries):
    """Limits of the valve pressure [Pa] and its rate [Pa/s], and the longest time of a change [s]."""

    least: Fraction | None = None
    largest: Fraction | None = None
    rate: Fraction | None = None
    ramp: Fraction = _ZERO


class SampledLoopEntries(Entries, kw_only=True):
    """A law with zero-order hold and its loop setup."""

    step: Fraction
    delay: Fraction
    lag: Fraction
    diffusion: Fraction = _ZERO
    states: Names
    update: Matrix
    first: Matrix = ()
    applied: Row = ()
    of_reference: Matrix = ()
    root: ImplicitStepEntries | None = None
    noise: SlipAndRate | None = None
    jitter: JitterEntries | None = None
    pump: PumpEntries | None = None
    longest: Fraction = _ZERO
    measured: Matrix
    output: Row
    feedback: Row

    def sampled_loop(self, start: SlipAndRate | None) -> SampledLoop:
        """The loop with bounds of its initial errors."""
        law = made(LinearLaw, self, implicit_step=None if self.root is None else self.root.value())
        need(not law.of_reference or any(map(any, law.of_reference)), "of_reference must not be zero if given")
        noise, initial = ((_ZERO, _ZERO) if pair is None else astuple(pair) for pair in (self.noise, start))
        need(start is None or any(initial), "start must have a bound above 0 if given")
        times = JitterEntries(measured=_ZERO, delay=_ZERO) if self.jitter is None else self.jitter
        need(self.jitter is None or any(astuple(times)), "jitter must be above 0 if given")
        pump = self.pump
        if pump is not None:
            need(astuple(pump) != astuple(PumpEntries()), "a pump must have limits or a rate")
            need(
                (pump.rate is not None) == (pump.ramp != 0),
                "the rate of a pump and a ramp above 0 must be given together",
            )
        return made(
            SampledLoop,
            self,
            law=law,
            slip_noise=noise[0],
            rate_noise=noise[1],
            initial_slip=initial[0],
            initial_slip_rate=initial[1],
            jitter=times.measured,
            delay_jitter=times.delay,
            averaging=times.mean,
            pump=None if pump is None else made(Pump, pump),
            ramp=_ZERO if pump is None else pump.ramp,
            longest_step=self.longest,
        )


class ContinuousLoopEntries(Entries, kw_only=True):
    """A law in continuous time, whose pressure acts without delay."""

    states: Names
    rates: Matrix
    of_reference: Pair = (_ZERO, _ZERO)
    measured: Matrix
    output: Row
    feedback: Row


class TrackingFile(TaskEntries, kw_only=True):
    """Content of a file about a sampled law, without format and kind."""

    loop: SampledLoopEntries
    start: SlipAndRate | None = None
    slow_gain: VaryingGain | None = None
    reach: InvariantPolytope | None = None
    claims: Claims


class ContinuousFile(TaskEntries):
    """Content of a file about a law in continuous time, without format and kind."""

    loop: ContinuousLoopEntries
    claims: Claims


def _tracking_entries(claim: TrackingProof | ContinuousProof) -> Any:
    task = task_entries(claim.task)
    if isinstance(claim, ContinuousProof):
        return written(ContinuousFile(**task, loop=made(ContinuousLoopEntries, claim.law), claims=claim.claims))
    sampled_loop, law = claim.sampled_loop, claim.sampled_loop.law
    noise, jitter, pump = None, None, None
    if any(sampled_loop.noise.values()):
        noise = SlipAndRate(
            slip=sampled_loop.noise.get("slip_noise", _ZERO), rate=sampled_loop.noise.get("rate_noise", _ZERO)
        )
    if sampled_loop.jitter or sampled_loop.delay_jitter or sampled_loop.averaging:
        jitter = JitterEntries(
            measured=sampled_loop.jitter, delay=sampled_loop.delay_jitter, mean=sampled_loop.averaging
        )
    if sampled_loop.pump is not None and sampled_loop.pump.to_dict():
        pump = made(
            PumpEntries, sampled_loop.pump, ramp=sampled_loop.ramp if sampled_loop.pump.rate is not None else _ZERO
        )
    implicit_step = (
        None
        if law.implicit_step is None
        else made(ImplicitStepEntries, law.implicit_step, pull=power_entries(law.implicit_step.pull))
    )
    loop = made(
        SampledLoopEntries,
        sampled_loop,
        law,
        root=implicit_step,
        noise=noise,
        jitter=jitter,
        pump=pump,
        longest=sampled_loop.longest_step,
    )
    start = (
        SlipAndRate(slip=sampled_loop.initial_errors[0], rate=sampled_loop.initial_errors[1])
        if any(sampled_loop.initial_errors)
        else None
    )
    return written(
        TrackingFile(
            **task, loop=loop, start=start, slow_gain=claim.varying_gain, reach=claim.invariant_set, claims=claim.claims
        )
    )


def _read_tracking(raw: Json) -> TrackingProof | ContinuousProof:
    if isinstance(raw.get("loop"), dict) and "rates" in raw["loop"]:
        file = read_as(ContinuousFile, raw)
        claim: TrackingProof | ContinuousProof = ContinuousProof(
            task=file.plant(), law=made(ContinuousLaw, file.loop), claims=file.claims
        )
        paced = pumped = False
    else:
        sampled = read_as(TrackingFile, raw)
        task, sampled_loop = sampled.plant(), sampled.loop.sampled_loop(sampled.start)
        invariant_set, slow_gain = sampled.reach, sampled.slow_gain
        if slow_gain is not None:
            slow_gain.models(task)
        free = bool(sampled_loop.longest_step)
        need(free == (invariant_set is not None), "reach must be given for aperiodic sampling, and for that alone")
        need(not free or slow_gain is None, "aperiodic sampling must have no slow_gain")
        claim = TrackingProof(
            task=task,
            sampled_loop=sampled_loop,
            claims=sampled.claims,
            varying_gain=slow_gain,
            invariant_set=invariant_set,
        )
        if invariant_set is not None:
            require_fit(claim.loop, invariant_set)
        paced, pumped = bool(sampled_loop.ramp), sampled_loop.pump is not None
    claims, loop = claim.claims, claim.loop
    both = (claims.least_asked is None) == (claims.largest_asked is None)
    need(both, "claims must have both of least_asked and largest_asked, or neither")
    apart = "asked" in loop.outputs
    need(apart or claims.least_asked is None, "claims on the valve pressure need a lag or a diffusion path")
    counted = "stepped" in loop.outputs
    need(counted or claims.largest_step is None, "largest_step may be claimed only with jitter or a pump rate")
    need(not paced or claims.largest_step is not None, "a pump rate needs the claim largest_step")
    need(
        not (pumped and apart) or claims.least_asked is not None,
        "a pump before a lag or diffusion path needs claims on its pressure",
    )
    _require_few(loop.states)
    return claim


def _require_few(states: tuple[str, ...]) -> None:
    need(len(states) <= MOST_STATES, f"a loop must have at most {MOST_STATES} states in all")


# ----------------------------------------------------------------------
# Files of the kind ``slow_sliding``: a fault with rate-and-state friction.


class SlidingFaultEntries(Entries):
    """A fault with rate-and-state friction, its constants in ranges."""

    name: FaultName
    density: Fraction
    shear_modulus: Fraction
    length: Fraction
    damping: Fraction
    direct_effect: Pair
    evolution_effect: Pair
    critical_slip: Pair
    coefficient: Pair
    normal_stress: Pair
    state_law: StateLaw = "ageing"
    regularised: bool = False


class SlidingReferenceEntries(Entries):
    """Rate, distance and planned pressure of slow sliding."""

    rate: Fraction
    distance: Fraction
    ramp: Fraction
    swing: Fraction = _ZERO


class SlidingLoopEntries(Entries):
    """A law of the slip with zero-order hold."""

    step: Fraction
    delay: Fraction
    lag: Fraction
    diffusion: Fraction
    slip_noise: Fraction
    states: Names
    update: Matrix
    measured: Row
    output: Row
    feedback: Fraction


class SlidingFile(Entries):
    """Content of a file without its format and kind."""

    fault: SlidingFaultEntries
    reference: SlidingReferenceEntries
    stress: Fraction
    loop: SlidingLoopEntries
    cells: Annotated[tuple[Annotated[tuple[str, ...], Meta(max_length=2)], ...], Meta(max_length=2 * MOST_CELLS)]
    claims: SlidingClaims


def _sliding_entries(claim: SlidingProof) -> Any:
    task, sampled_loop, law = claim.task, claim.sampled_loop, claim.sampled_loop.law
    file = SlidingFile(
        fault=made(SlidingFaultEntries, task, **task.ranges),
        reference=made(SlidingReferenceEntries, task),
        stress=task.stress,
        loop=made(
            SlidingLoopEntries,
            sampled_loop,
            law,
            measured=tuple(row[0] for row in law.measured),
            feedback=law.feedback[0],
        ),
        cells=tuple(() if cut is None else (cut[0], str(cut[1])) for cut in claim.cuts),
        claims=claim.claims,
    )
    return written(file)


def _read_sliding(raw: Json) -> SlidingProof:
    file = read_as(SlidingFile, raw)
    ranges = {axis: getattr(file.fault, axis) for axis in AXES}
    task = made(SlidingPlant, file.fault, file.reference, ranges=ranges, stress=file.stress)
    measured = tuple((gain, _ZERO) for gain in file.loop.measured)
    law = made(LinearLaw, file.loop, measured=measured, feedback=(file.loop.feedback, _ZERO))
    claim = SlidingProof(
        task=task, sampled_loop=made(SampledLoop, file.loop, law=law), cuts=_cuts(file), claims=file.claims
    )
    cells(task, claim.cuts)
    model = model_of(task, claim.claims)
    _require_few(loop_of(claim.sampled_loop, model, task).states if model is not None else ())
    return claim


def _cuts(file: SlidingFile) -> Cuts:
    for cut in filter(None, file.cells):
        need(len(cut) == 2, f"a cut must be one of {', '.join(AXES)} and a number")
    return tuple((cut[0], read_rational(cut[1])) if cut else None for cut in file.cells)


# ----------------------------------------------------------------------
# Any of these files.


def guarantee_document(claim: Claim | PlantProof) -> Json:
    """Content of the file."""
    if not hasattr(claim, "claims"):
        raise ParameterError(f"a claim must be a guarantee. Received {shown(claim)}. Prove one with guarantee.")
    writers: dict[str, Callable[[Any], dict[str, Any]]] = {
        UNCERTAIN_PLANT: plant_entries,
        SLOW_SLIDING: _sliding_entries,
        GUARANTEE: _tracking_entries,
        STICK_SLIP: lambda stick_slip: _stick_slip().stick_slip_entries(stick_slip),
    }
    return {"format": 1, "kind": claim.kind, **writers[claim.kind](claim)}


def _stick_slip() -> Any:
    """Module of files about the stick–slip plant, imported on demand, as it needs NumPy."""
    return import_module("quakedesign.guarantees.exact.stick_slip_files")


def guarantee_text(claim: Claim | PlantProof) -> str:
    """Text of the file."""
    return json.dumps(guarantee_document(claim), indent=1) + "\n"


def load_guarantee(path: str | Path) -> Claim | PlantProof:
    """Read a certificate file of a guarantee; `check` of the result verifies it.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    TrackingProof, ContinuousProof, SlidingProof, StickSlipProof or PlantProof
        The ``controller`` of a TrackingProof is for `simulate`, `export_controller` and `loop_transfer`: the law with
        its T_s, its limit at rest (against windup), and the delay, lag and diffusion path of the proof.

    Raises
    ------
    CertificateError
        When the file cannot be read or breaks a rule of FORMAT.md.
    """
    return read_guarantee(read_json(path))


def save_guarantee(claim: Claim | PlantProof, path: str | Path) -> None:
    """Write the file atomically."""
    write_whole(Path(path), guarantee_text(claim))


def parse_guarantee(text: str) -> Any:
    """Claim from the text of a file; reading verifies nothing. Raises as `read_guarantee`."""
    return read_guarantee(parse(text))


def read_guarantee(raw: Any) -> Claim | PlantProof:
    """Claim from a parsed file.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    kind = kind_of(raw)
    try:
        entries = headed(raw, kind if kind in (STICK_SLIP, UNCERTAIN_PLANT, SLOW_SLIDING) else GUARANTEE)
        if kind == STICK_SLIP:
            return cast("StickSlipProof", _stick_slip().read_stick_slip(entries))
        if kind == UNCERTAIN_PLANT:
            return read_plant_guarantee(entries)
        return _read_sliding(entries) if kind == SLOW_SLIDING else _read_tracking(entries)
    except ParameterError as error:
        raise CertificateError(str(error)) from None
