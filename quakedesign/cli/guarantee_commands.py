"""Commands `guarantee` and `limits`.

The first proves bounds of the sampled loop for all t ≥ 0; the second gives the performance limits of every controller.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.app import app, new_file, progress
from quakedesign.cli.options import (
    PLAIN,
    Box,
    DisturbanceClass,
    ExactPascals,
    FaultName,
    Force,
    Formats,
    Gains,
    Output,
    Pascals,
    Scheduler,
    SetupOptions,
    Shaking,
    Whole,
)
from quakedesign.errors import ParameterError, QuakedesignError, SimulationError
from quakedesign.exact import rational
from quakedesign.files import Json, lock_folder, made_folder, require_writable

# ----------------------------------------------------------------------
# The command about the sampled loop.


_IDEAL = SetupOptions()


@app.command
def guarantee(
    fault: FaultName,
    /,
    *more: Annotated[FaultName, Parameter(help="Further faults with the same options.")],
    controller: str = "elqr",
    objective: Literal["tracking", "peak"] = "tracking",
    gains: Gains = (),
    law: Path | None = None,
    scheme: str | None = None,
    measured: Literal["slip-and-rate", "slip", "differentiator"] = "slip-and-rate",
    setup_options: SetupOptions = _IDEAL,
    disturbance_class: DisturbanceClass = "amplitude",
    plant: Literal["stick-slip", "printed"] | None = None,
    stress: ExactPascals | None = None,
    spread: str = "0",
    box: Box = None,
    disturbance: Shaking = None,
    accept_poor_fit: bool = False,
    workers: Whole = 1,
    scheduler: Scheduler = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Prove bounds on slip, slip rate and pressure of the sampled loop.

    The bounds hold along the reference for every friction law and all constant parameters of the box, for every
    disturbance of the class, from rest or from bounded initial errors, for all t >= 0. For rate-and-state faults they
    hold during the slip of the task, which begins in steady sliding. The controller is designed for the loop setup
    unless gains are given. Exit code 0 only if every fault has a proof.
    Give quantities with a unit, such as '20 ms', or as numbers in SI units.

    Parameters
    ----------
    controller
        elqr, or a sliding mode: cta, dia. For several blocks: centralised (default) or decentralised.
    objective
        Of a design. peak: the smallest certified slip rate (plant without stick: slip-rate error). tracking: a smaller
        slip error under a drifting disturbance, with a somewhat larger slip rate.
    gains
        k1 to k4 of an e-LQR in SI units, whose two integrals are sums over the samples; by default a law is designed
        with an estimate of the disturbance instead of integral action. Of a sliding mode: base gains (λ = 1); the
        command chooses λ.
    law
        File of a user-defined sampled linear law (.json or .npz, see SampledLaw.load) in place of controller and gains.
    scheme
        Sliding modes: stick-slip on the stick-slip plant or compensated on the plant without stick, by default the one
        for the plant of the guarantee; no other scheme has a guarantee. The e-LQR uses the scheme explicit.
    measured
        Measurement of the e-LQR: slip-and-rate; slip, from which a designed law estimates the slip rate; or
        differentiator (implicit, n_d = 2, any n_f), for which the smallest λ_d is printed.
    disturbance_class
        amplitude: any disturbance bounded by the fault's amplitude; rate: its rate of change is bounded too, by the
        fault's amplitude times frequency, and it starts at 0.
    plant
        stick-slip: friction holds the fault at rest, and the fault never slips backward (only for a designed e-LQR or a
        sliding mode, with an exactly measured slip rate and a pressure without delay); printed: the paper's plant,
        without stick. By default stick-slip where it has a proof, else printed; with --class rate printed.
    stress
        Rate-and-state faults (slow sliding, e-LQR through a diffusion path or a lag): bound of the shear stress
        disturbance, such as '25 kPa'; by default about the largest with a guarantee.
    spread
        Rate-and-state faults: relative uncertainty of a, b and D_c, such as 0.1.
    accept_poor_fit
        Continue although the laboratory record does not support the friction law of the fault; results are labelled.
    workers
        Number of processes for several faults.
    out
        Certificate file to write; for several faults a folder.
    """
    options = dict(locals())
    from quakedesign.cli.block_commands import guarantee_chain, require_loads, several_blocks
    from quakedesign.fault import load_fault, with_accepted_fit
    from quakedesign.studies.fault_facts import box_sentences
    from quakedesign.synthesis import guarantee as guaranteed
    from quakedesign.synthesis import guarantees_of

    accepted = ("step", "out", "controller", "stress", "lag")
    if (blocks := several_blocks(fault, globals()["guarantee"], options, accepted, box)) is not None:
        setup = setup_options.setup()
        loads = {"stress": stress, "lag": setup.lag}
        require_loads(blocks, loads)
        return guarantee_chain(blocks, controller, setup.step, loads if blocks.has_state else None, out, force, output)
    began, faults = perf_counter(), [load_fault(name, box=box, disturbance=disturbance) for name in (fault, *more)]
    faults = [with_accepted_fit(one, accept_poor_fit) for one in faults]
    files = _files(out, [one.name for one in faults], force=force)
    setup = setup_options.setup(measured=measured)
    arguments: dict[str, Any] = {"gains": gains, "objective": objective, "scheme": scheme, "stress": stress}
    arguments |= {"disturbance_class": disturbance_class, "spread": spread, "plant": plant}
    if law is not None:
        from quakedesign.laws import SampledLaw

        arguments["law"] = SampledLaw.load(law)
    calls = [partial(guaranteed, one, controller, setup, **arguments) for one in faults]
    with progress() as bar:
        if not more and scheduler is None and workers == 1:
            calls = [partial(calls[0], progress=bar)]
        results: Any = guarantees_of(calls, workers=workers, scheduler=scheduler, progress=bar if more else None)
    entries = {"class": disturbance_class, "seconds": perf_counter() - began}
    if not more:
        if isinstance(results[0], QuakedesignError):
            raise results[0]
        written = f"written: {files[0]}" if _proved(results[0]) else f"{files[0]} is not written, as nothing is proved"
        box_of = box_sentences(faults[0]) if _proved(results[0]) else []
        lines = [*results[0].lines(), *box_of, *([written] if files[0] else [])]
        output.show(_values(results[0], files[0]) | entries, chain(_first(faults[0], results[0]), lines))
    else:
        each = zip(faults, results, files, strict=True)
        parts = [{"fault": one.name} | _values(proof, path) for one, proof, path in each]
        lines = [f'"{one.name}": {line}' for one, proof in zip(faults, results, strict=True) for line in _lines(proof)]
        output.show({"guarantees": parts, **entries}, lines)
    return 0 if all(_proved(one) for one in results) else 1


def _proved(result: Any) -> bool:
    return not isinstance(result, QuakedesignError) and result.proved


def _first(fault: Any, result: Any) -> Iterator[str]:
    """The guarantee relative to the natural earthquake, and a blank line; empty without a proof."""
    if not _proved(result):
        return
    from textwrap import wrap

    from quakedesign.report.summary import guaranteed_sentence
    from quakedesign.simulation.earthquake import natural_peak

    try:
        peak = natural_peak(fault)
    except (ParameterError, SimulationError):  # friction with a state, or an earthquake that cannot be computed
        peak = None
    yield from wrap(f"{guaranteed_sentence(f'{fault.name}: guaranteed', result.proof, peak, fault.magnitude)}.", 80)
    yield ""


def _lines(result: Any) -> list[str]:
    return [f"refused: {result}"] if isinstance(result, QuakedesignError) else result.lines()


def _files(out: Path | None, names: list[str], *, force: bool) -> list[Path | None]:
    """Paths of the certificate files, one per fault. Raises before the work begins if one cannot be written."""
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise ParameterError(f"faults must have different names. Received {repeated} twice. Rename one of them.")
    if out is None:
        return [None] * len(names)
    if len(names) == 1:
        new_file(out, "certificate file", force=force)
        return [out]
    require_writable(out)
    lock_folder(out)
    files = [out / f"{name}-guarantee.json" for name in names]
    for path in (path for path in files if out.exists()):
        new_file(path, "certificate file", force=force)
    return [*files]


def _values(result: Any, path: Path | None) -> Json:
    """Result as JSON; its file is written if there is a proof."""
    from quakedesign.guarantees.exact.guarantee_files import save_guarantee

    if isinstance(result, QuakedesignError):
        return {"verdict": "refused", "reason": str(result), "certificate": None}
    written = path if result.proved else None
    if written is not None:
        with made_folder(written.parent):
            save_guarantee(result.proof, written)
    return {**result.to_dict(), "certificate": written and str(written)}


@app.command
def limits(
    fault: FaultName,
    /,
    *,
    pressure: Pascals | None = None,
    setup_options: SetupOptions = _IDEAL,
    stress: Pascals | None = None,
    spread: str = "0",
    measured: Literal["slip-and-rate", "slip"] = "slip-and-rate",
    box: Box = None,
    disturbance: Shaking = None,
    out: Path | None = None,
    format: Formats = ("png",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Give performance limits that no controller can beat on a fault, with the proved bounds of a designed controller.

    The limits are the smallest slip-rate error (plant without stick) and slip rate (stick-slip plant), the longest T_s,
    delay and diffusion time, the largest distance of a well and the smallest withdrawal. Beyond a limit every
    controller fails for some disturbance of at most the given amplitude and, for slip weakening, some friction law of
    the box. The distance of a well is for the diffusivity --diffusivity, 1 m^2/s by default. Delay, lag, diffusion,
    timing errors and pump are those of the proved designs; with slip noise, and a slip rate that is noisy or not
    measured, the limit on the slip-rate error is larger. Give quantities with a unit, such as '20 ms', or as numbers in
    SI units.

    Parameters
    ----------
    pressure
        Largest withdrawal that the limits assume, such as '20 MPa'; in slow sliding the largest deviation from the
        planned pressure. By default the effective normal stress, of several blocks the smallest. --withdrawal and the
        other options of the pump are for the proved designs alone.
    setup_options
        Loop setup of the proved designs.
    stress
        Rate-and-state faults (limits of the plant linearised about slow sliding): bound of the shear stress
        disturbance, such as '25 kPa'; by default about the largest with a guarantee. For several blocks there is no
        default; without this option only their unstable modes are listed.
    spread
        Rate-and-state faults: relative uncertainty of a, b and D_c in the proofs, such as 0.1; the limits are those of
        the nominal values.
    measured
        Measurements available to every controller: slip-and-rate, or slip.
    out
        Folder for a figure and results.json; by default nothing is written.
    """
    options = dict(locals())
    from quakedesign.cli.block_commands import chain_at_step, chain_limits, several_blocks
    from quakedesign.fault import load_fault

    given, accepted = setup_options.diffusivity, ("step", "stress", "pressure", "diffusivity")
    if (chain := several_blocks(fault, globals()["limits"], options, accepted, box)) is not None:
        value = None if given is None else float(rational(given))
        chain = chain_at_step(chain, replace(setup_options, diffusivity=None).setup())
        return chain_limits(chain, output, stress=stress, pressure=pressure, diffusivity=value)
    loaded = load_fault(fault, box=box, disturbance=disturbance)
    if out is not None:
        from quakedesign.report.folder import prepare

        prepare(out, force=force)
        lock_folder(out)
    from quakedesign.report.drawing import file_names
    from quakedesign.report.limits_table import limits_lines, write_limits
    from quakedesign.studies import limits as all_limits

    result = all_limits(
        loaded,
        replace(setup_options, diffusivity=(given or "1") if setup_options.well else None).setup(measured=measured),
        pressure=pressure,
        diffusivity=float(rational(given or "1")),
        stress=stress,
        spread=spread,
    )
    if out is not None:
        write_limits(result, out, format)
    written = [] if out is None else [f"written: {out}/ ({file_names('limits', format)}, results.json)"]
    output.show(result.to_dict(), [*limits_lines(result), *written])
    return 0
