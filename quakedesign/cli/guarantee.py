"""The command about the loop that runs."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from quakedesign.cli.options import PLAIN, Box, FaultName, Force, Output
from quakedesign.cli.shared import ExactMetres, ExactMetresPerSecond, ExactSeconds, Gains, app, new_file
from quakedesign.rationals import rational


@app.command
def guarantee(
    fault: FaultName,
    /,
    *,
    controller: str = "elqr",
    objective: Literal["tracking", "peak"] = "tracking",
    gains: Gains = (),
    scheme: str | None = None,
    step: ExactSeconds | None = None,
    delay: ExactSeconds = "0",
    lag: ExactSeconds = "0",
    diffusion: ExactSeconds = "0",
    measured: Literal["slip-and-rate", "slip"] = "slip-and-rate",
    slip_noise: ExactMetres = "0",
    rate_noise: ExactMetresPerSecond = "0",
    disturbance_class: Annotated[Literal["amplitude", "rate"], Parameter(name="--class")] = "amplitude",
    box: Box = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Prove how far slip, slip rate and pressure of the loop that runs can go: sampled, held, late, for ever.

    For all friction and constant parameters of the box and every disturbance of a class, from rest, along the
    reference. Exit code 0 only if proved.

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
    delay
        From the measurement to the pressure at the valve.
    lag
        Time constant between the valve and the fault, or the well where there is a diffusion.
    diffusion
        L²/D of the rock between well and fault; the designed e-LQR carries a model of it.
    measured
        What the designed e-LQR is told: slip-and-rate, or slip, from which it estimates the slip rate.
    slip_noise
        Bound of the error of the measured slip, whatever its course, such as '1 um'; q/2 for readings in steps of q.
        simulate takes a standard deviation by this name.
    rate_noise
        The same of the measured slip rate.
    disturbance_class
        amplitude: any disturbance as large as the fault's; rate: one that starts at 0 and is no faster either.
    out
        Certificate file to write.
    """
    from time import perf_counter

    from quakedesign.certificates.guarantee import Guarantee
    from quakedesign.certificates.guarantee.files import save_guarantee
    from quakedesign.fault import load_fault
    from quakedesign.synthesis import answer

    new_file(out, "certificate file", force=force)
    began = perf_counter()
    found = answer(
        load_fault(fault, box=box),
        controller=controller,
        gains=gains,
        objective=objective,
        scheme=scheme,
        step=None if step is None else rational(step, "step"),
        delay=rational(delay, "delay"),
        lag=rational(lag, "lag"),
        diffusion=rational(diffusion, "diffusion"),
        measured=measured,
        slip_noise=rational(slip_noise, "slip noise"),
        rate_noise=rational(rate_noise, "rate noise"),
        disturbance_class=disturbance_class,
    )
    if out is not None and isinstance(found.found, Guarantee):
        save_guarantee(found.found, out)
    written = str(out) if out is not None and found.proved else None
    output.show({**found.to_dict(), "certificate": written, "seconds": perf_counter() - began}, found.lines())
    return 0 if found.proved else 1
