"""Commands `guarantee` and `limits`.

The first proves bounds of the sampled loop for all t ≥ 0; the second gives the performance limits of
every controller.
"""

from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.app import app, given, new_file, progress
from quakedesign.cli.options import (
    PLAIN,
    Box,
    DisturbanceClass,
    ExactMetres,
    ExactMetresPerSecond,
    ExactPascals,
    ExactPascalsPerSecond,
    ExactSeconds,
    ExactSquareMetresPerSecond,
    FaultName,
    Force,
    Formats,
    Gains,
    Output,
    Pascals,
    Scheduler,
    Shaking,
    Whole,
    rock,
)
from quakedesign.errors import ParameterError, QuakedesignError
from quakedesign.exact import rational
from quakedesign.files import hold, made_folder, require_room

# ----------------------------------------------------------------------
# The command about the loop that runs.


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What is between a law and its fault, what the law is told wrongly, and where the loop may start.

    Parameters
    ----------
    delay
        From the measurement to the pressure at the valve.
    lag
        Time constant between the valve and the fault, or the well where there is a diffusion; the designed e-LQR knows
        it.
    diffusion
        L²/D of the rock between well and fault; the designed e-LQR carries a model of it.
    well
        Distance of the well, such as '40 m', with --diffusivity, in place of --diffusion.
    diffusivity
        Of the rock between well and fault, such as '0.5 m^2/s'.
    slip_noise
        Bound of the error of the measured slip, whatever its course, such as '1 um'; q/2 for readings in steps of q.
        --slip-noise-deviation of simulate is a standard deviation.
    rate_noise
        The same of the measured slip rate.
    initial_slip
        Bound of the slip at the start, of either sign, such as '0.01 mm'; the law begins as it always does.
    initial_slip_rate
        The same of the slip rate, such as '0.1 mm/s'. Slip rates below zero are those of the continued plant.
    jitter
        By how much a measurement is early or late at most, and its pressure with it, such as '2 ms'.
    delay_jitter
        The same of the delay alone.
    averaging_time
        Over which the law is told means of slip and slip rate, up to each sample; the delay counts from its end.
    longest_step
        By no clock: the next sample comes any time from T_s to this after the last, each time anew, as a computer that
        sleeps for T_s does; the law is not told.
    saturation
        Largest pressure of the pump, such as '20 MPa', and largest withdrawal unless that is given: a proof is one that
        these limits are never reached.
    withdrawal
        Largest decrease of the pressure; 0 for a pump that only injects.
    rate_limit
        How fast the pump goes from one pressure to the next, such as '10 MPa/s': a proof counts that it takes its time,
        and is one that it is there before the next sample.
    """

    delay: ExactSeconds = "0"
    lag: ExactSeconds = "0"
    diffusion: ExactSeconds = "0"
    well: ExactMetres | None = None
    diffusivity: ExactSquareMetresPerSecond | None = None
    slip_noise: ExactMetres = "0"
    rate_noise: ExactMetresPerSecond = "0"
    initial_slip: ExactMetres = "0"
    initial_slip_rate: ExactMetresPerSecond = "0"
    jitter: ExactSeconds = "0"
    delay_jitter: ExactSeconds = "0"
    averaging_time: ExactSeconds = "0"
    longest_step: ExactSeconds = "0"
    saturation: ExactPascals | None = None
    withdrawal: ExactPascals | None = None
    rate_limit: ExactPascalsPerSecond | None = None

    def exact(self) -> dict[str, Any]:
        """All of it as rationals in SI units, and the pump, None without limits.

        Raises
        ------
        ParameterError
            For a withdrawal without a largest pressure, or for a well that is not told as one.
        """
        from quakedesign.synthesis.guarantee import exact_surroundings

        return exact_surroundings(**self.plain(alone=False))

    def plain(self, *, alone: bool = True) -> dict[str, Any]:
        """All of it as it was given, with rock in place of a well; a diffusivity may stand alone or may not.

        Raises
        ------
        ParameterError
            For a well that is not told as one.
        """
        told = asdict(self)
        well, spread = told.pop("well"), told.pop("diffusivity")
        told["diffusion"] = rock(self.diffusion, well, (spread or "1") if well and alone else None if alone else spread)
        return given(told)


_ALONE = Surroundings()


@app.command
def guarantee(
    fault: FaultName,
    /,
    *more: Annotated[FaultName, Parameter(help="Further faults, of which the same is asked.")],
    controller: str = "elqr",
    objective: Literal["tracking", "peak"] = "tracking",
    gains: Gains = (),
    scheme: str | None = None,
    step: ExactSeconds | None = None,
    measured: Literal["slip-and-rate", "slip", "differentiator"] = "slip-and-rate",
    around: Surroundings = _ALONE,
    disturbance_class: DisturbanceClass = "amplitude",
    stress: ExactPascals | None = None,
    spread: str = "0",
    box: Box = None,
    disturbance: Shaking = None,
    workers: Whole = 1,
    scheduler: Scheduler = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Prove how far slip, slip rate and pressure of the loop that runs can go: sampled, held, late, for ever.

    For all friction and constant parameters of the box and every disturbance of a class, from rest or from every start
    near it, along the reference. Of several faults each has its own answer. Exit code 0 only if all are proved.

    Parameters
    ----------
    controller
        elqr, or a sliding mode: cta, dia.
    objective
        Of a design: tracking, or peak for the smallest proved slip-rate error.
    gains
        k1 to k4 of an e-LQR whose integrals are summed once per sample; a law with an estimate of the disturbance is
        designed unless given. Of a sliding mode its base gains, scaled by λ.
    scheme
        Of a sliding mode: compensated unless given; no other has a guarantee. The e-LQR runs in explicit.
    step
        T_s, such as '184 ms' or 7/50 (s); the fault's unless given.
    measured
        What the e-LQR is told: slip-and-rate; or slip, from which a designed one estimates the slip rate; or slip with
        the differentiator, implicit and of n_d = 2 with any n_f, of which the least λ_d is told.
    disturbance_class
        amplitude: any disturbance as large as the fault's; rate: one that starts at 0 and is no faster either.
    stress
        Of a fault with rate-and-state friction, held in slow sliding by an e-LQR through rock or a lag: bound of the
        shear stress disturbance, such as '25 kPa'; the largest that the design stands unless given.
    spread
        Of such a fault: by how much of their values a, b and D_c may be off, such as 0.1.
    workers
        Of several faults: number of processes.
    out
        Certificate file to write; of several faults a folder for one each.
    """
    from quakedesign.fault import load_fault
    from quakedesign.synthesis import answers
    from quakedesign.synthesis.guarantee import question

    began, faults = perf_counter(), [load_fault(name, box=box, disturbance=disturbance) for name in (fault, *more)]
    files = _files(out, [one.name for one in faults], force=force)
    asked: dict[str, Any] = {"controller": controller, "gains": gains, "objective": objective, "scheme": scheme}
    exact: dict[str, Any] = {
        "step": None if step is None else rational(step, "step"),
        "spread": rational(spread, "spread"),
    }
    exact["stress"] = None if stress is None else rational(stress, "stress")
    asked |= {"measured": measured, "disturbance_class": disturbance_class, **around.exact()}
    questions = [question(one, **asked, **exact) for one in faults]
    with progress() as tell:
        if not more and faults[0].friction.state_names and scheduler is None and workers == 1:
            questions = [partial(questions[0], tell=tell)]  # type: ignore[call-arg]
        found = answers(questions, workers=workers, scheduler=scheduler, tell=tell if more else None)
    said = {"class": disturbance_class, "seconds": perf_counter() - began}
    if not more:
        if isinstance(found[0], QuakedesignError):
            raise found[0]
        unwritten = (
            [] if files[0] is None or _proved(found[0]) else [f"{files[0]} is not written, as nothing is proved"]
        )
        output.show(_facts(found[0], files[0]) | said, [*found[0].lines(), *unwritten])
    else:
        each = zip(faults, found, files, strict=True)
        facts = [{"fault": one.name} | _facts(proof, path) for one, proof, path in each]
        lines = [f'"{one.name}": {line}' for one, proof in zip(faults, found, strict=True) for line in _lines(proof)]
        output.show({"guarantees": facts, **said}, lines)
    return 0 if all(_proved(one) for one in found) else 1


def _proved(answer: Any) -> bool:
    return not isinstance(answer, QuakedesignError) and answer.proved


def _lines(answer: Any) -> list[str]:
    return [f"refused: {answer}"] if isinstance(answer, QuakedesignError) else answer.lines()


def _files(out: Path | None, names: list[str], *, force: bool) -> list[Path | None]:
    """Files of certificates, one a fault, refused early where they cannot be written.

    Raises
    ------
    ParameterError, OutputError
    """
    again = next((name for name in names if names.count(name) > 1), None)
    if again is not None:
        raise ParameterError(f"several faults need names of their own. Received {again} twice. Rename one.")
    if out is None:
        return [None] * len(names)
    if len(names) == 1:
        new_file(out, "certificate file", force=force)
        return [out]
    require_room(out)
    hold(out)
    files = [out / f"{name}-guarantee.json" for name in names]
    for path in (path for path in files if out.exists()):
        new_file(path, "certificate file", force=force)
    return [*files]


def _facts(answer: Any, path: Path | None) -> dict[str, Any]:
    """Answer as JSON, and its file written if there is a proof."""
    from quakedesign.guarantees.exact.guarantee_files import save_guarantee

    if isinstance(answer, QuakedesignError):
        return {"verdict": "refused", "reason": str(answer), "certificate": None}
    written = path if answer.proved else None
    if written is not None:
        with made_folder(written.parent):
            save_guarantee(answer.found, written)
    return {**answer.to_dict(), "certificate": written and str(written)}


# ----------------------------------------------------------------------
# The command about what no controller can do.

_LIMITS_ALONE = Surroundings()


@app.command
def limits(
    fault: FaultName,
    /,
    *,
    pressure: Pascals | None = None,
    around: Surroundings = _LIMITS_ALONE,
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
    """Say what no controller whatever can do with a fault, beside what a designed one is proved to do.

    The smallest slip-rate error, the longest T_s, delay and diffusion time, the farthest well and the smallest
    withdrawal, for any disturbance as large as the fault's.

    Parameters
    ----------
    pressure
        Largest withdrawal, such as '20 MPa'; the effective normal stress unless given.
    around
        What designs are proved with. The diffusivity, 1 m²/s unless given, is that of the farthest well too; noise says
        how far it limits the slip-rate error of any controller as well.
    stress
        Of a fault with rate-and-state friction, whose limits are those of its linearisation about slow sliding: bound
        of the shear stress disturbance, such as '25 kPa'; the largest that a design stands unless given.
    spread
        Of such a fault: by how much of their values a, b and D_c may be off in what is proved, such as 0.1; what is
        impossible is so for the nominal ones.
    measured
        What controllers are told: slip-and-rate, or slip.
    out
        Folder for a figure and results.json; nothing is written unless given.
    """
    from quakedesign.fault import load_fault

    loaded = load_fault(fault, box=box, disturbance=disturbance)
    if out is not None:
        from quakedesign.report.folder import prepare

        prepare(out, force=force)
        hold(out)
    from quakedesign.report.drawing import file_names
    from quakedesign.report.limits_table import limits_lines, write_limits
    from quakedesign.studies import limits as all_limits

    answer = all_limits(
        loaded,
        pressure=pressure,
        diffusivity=float(rational(around.diffusivity or "1")),
        stress=stress,
        spread=spread,
        measured=measured,
        **around.plain(),
    )
    if out is not None:
        write_limits(answer, out, format)
    written = [] if out is None else [f"written: {out}/ ({file_names('limits', format)}, results.json)"]
    output.show(answer.to_dict(), [*limits_lines(answer), *written])
    return 0
