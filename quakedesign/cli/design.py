"""The main job."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.shared import (
    ExactMetres,
    ExactMetresPerSecond,
    Force,
    Json,
    app,
    console,
    print_json,
    print_lines,
    progress,
)
from quakedesign.errors import ParameterError, UnknownNameError


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LinearOptions:
    """How the e-LQR is designed.

    Parameters
    ----------
    objective
        Of the e-LQR: tracking, or peak for the smallest guaranteed slip-rate error.
    continuous
        Design the e-LQR in continuous time, as in the paper, in place of the loop that samples and holds.
    measured
        What the e-LQR that samples is told: slip-and-rate, or slip, from which it estimates the slip rate.
    slip_noise
        Bound of the error of the slip that it is told, such as '1 um', in its guarantee and in its run.
    rate_noise
        The same of the slip rate.
    """

    objective: Literal["tracking", "peak"] = "tracking"
    continuous: Annotated[bool, Parameter(negative="")] = False
    measured: Literal["slip-and-rate", "slip"] = "slip-and-rate"
    slip_noise: ExactMetres = "0"
    rate_noise: ExactMetresPerSecond = "0"

    def told(self, names: list[str]) -> dict[str, Any]:
        """Options of `quakedesign.design`, for laws that have them.

        Raises
        ------
        ParameterError
            When no e-LQR is designed.
        """
        if self != LinearOptions() and "elqr" not in names:
            raise ParameterError(
                "--continuous, --objective, --measured and noise are for the e-LQR. "
                f"Received --controller {', '.join(names)}. Leave them out."
            )
        return asdict(self)


_AS_USUAL = LinearOptions()


@app.command
def design(
    fault: str,
    /,
    *,
    controller: str = "all",
    box: str | None = None,
    linear: LinearOptions = _AS_USUAL,
    scheme: str | None = None,
    published_scheme: str = "continuous",
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Derive, synthesise, prove, simulate, compare with the published gains, and write a report.

    Exit code 0 if every designed controller is proved, for the fault's T_s, its premise along the reference holds, and
    its run is neither an earthquake nor diverges nor opens the fault; 1 otherwise.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        cta, dia, elqr or all.
    box
        Uncertainty box: paper or ten-percent.
    scheme
        Of the runs of designed gains: continuous (unless given), as in the paper, or sampled and held: explicit,
        implicit, semi-implicit, compensated. The e-LQR that samples runs as it was designed.
    published_scheme
        Of the runs of published gains.
    out
        Folder to write; ./quakedesign-FAULT unless given.
    force
        Replace a folder of earlier results.
    json
        Print results.json on stdout.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.folder import prepare

    names = controllers(controller)
    options = linear.told(names)
    found = load_fault(fault, box=box)
    folder = out or Path(f"quakedesign-{found.name}")
    prepare(folder, force=force)
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.folder import write_folder

    with progress() as tell:
        comparison = designed_comparison(
            found,
            names,
            tell,
            linear=options,
            scheme=scheme,
            published_scheme=published_scheme,
        )
        results = write_folder(comparison, folder, force=force, tell=tell)
    if json:
        print_json(results)
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console())
        print_lines(["", f"written: {folder}/ (results.json, report.html, certificates, figures)"])
    return 0 if positive(comparison) else 1


def controllers(name: str) -> list[str]:
    """Laws to design: the one named, or all.

    Raises
    ------
    UnknownNameError
    """
    from quakedesign.synthesis import DESIGNABLE

    if name not in (*DESIGNABLE, "all"):
        raise UnknownNameError(f"controller must be one of {', '.join(DESIGNABLE)}, all. Received {name!r}.")
    return list(DESIGNABLE) if name == "all" else [name]


def positive(comparison: Any) -> bool:
    """Whether every design is proved and its premises hold but for those on run and start, and its run is harmless."""
    needed = {"along_reference", "control_coefficient", "friction_slope", "sampling_time"}
    return all(
        str(entry.design.verdict) == "proved"
        and all(p.holds for p in entry.design.premises if p.name in needed)
        and (entry.run is None or entry.run.outcome.harmless)
        for entry in comparison.of("designed")
    )
