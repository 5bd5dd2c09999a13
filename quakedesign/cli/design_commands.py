"""Commands `design`, `compare` and `figures`.

They design, prove, simulate and compare the controllers of one fault and write the report.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.app import app, command_line, console, print_json, print_lines, progress
from quakedesign.cli.options import (
    PLAIN,
    Box,
    DisturbanceClass,
    ExactPascals,
    FaultName,
    Force,
    Formats,
    Output,
    Shaking,
    WellOptions,
    of_the_setup,
)
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.exact import rational
from quakedesign.files import lock_folder

if TYPE_CHECKING:
    from quakedesign.fault import Fault


# ----------------------------------------------------------------------
# The command `design`.

_SHARED = ("objective", "continuous", "stress", "spread", "disturbance_class")


@Parameter(name="*")
@of_the_setup("step", "delay", "lag", "diffusion", "slip_noise", "rate_noise")
@dataclass(frozen=True, kw_only=True)
class DesignOptions(WellOptions):
    """Controllers to design for a fault, and the design options.

    Parameters
    ----------
    controller
        Control law to design: cta, dia, elqr or all. For several blocks (design and compare): centralised, or
        decentralised, which computes the pressure of each well from its own measurements.
    objective
        peak: the smallest certified slip rate (plant without stick: slip-rate error). tracking: a smaller slip error
        under a drifting disturbance, with a somewhat larger slip rate.
    continuous
        Design in continuous time, as in the paper, instead of a sampled loop with a guarantee.
    measured
        Measurement of the sampled e-LQR: slip-and-rate, or slip, from which it estimates the slip rate. Sliding modes
        measure both.
    disturbance_class
        Disturbances of the guarantee. amplitude: any disturbance bounded by the fault's amplitude; rate: its rate of
        change is bounded too, by the fault's amplitude times frequency, and it starts at 0, as a tide does.
    scheme
        Scheme that simulates the gains designed with --continuous: continuous (default, as in the paper), or sampled
        with a zero-order hold: explicit, implicit, semi-implicit, compensated, stick-slip. Other designs run as
        designed.
    stress
        Rate-and-state faults: bound of the shear stress disturbance, such as '25 kPa'; by default about the largest
        with a guarantee.
    spread
        Rate-and-state faults: relative uncertainty of a, b and D_c, such as 0.1.
    published_scheme
        Scheme of the runs of published gains, see --scheme.
    plant
        Plant of the runs and of the guarantee: stick-slip (friction holds the fault at rest), or printed (the paper's
        plant, without stick). By default the runs are on stick-slip, and so is the guarantee if one is found there;
        otherwise, and with --class rate, the guarantee is on printed. Not for rate-and-state faults, which never rest.
    whole_task
        Rate-and-state faults: simulate the whole task instead of its first 500 D_c/V, V the mean slip rate of the task.
        The proof covers the whole task in either case.
    accept_poor_fit
        Continue although the laboratory record does not support the friction law of the fault; results are labelled.
    """

    controller: str = "all"
    box: Box = None
    disturbance: Shaking = None
    objective: Literal["tracking", "peak"] = "tracking"
    continuous: bool = False
    measured: Literal["slip-and-rate", "slip"] = "slip-and-rate"
    disturbance_class: DisturbanceClass = "amplitude"
    scheme: str | None = None
    stress: ExactPascals | None = None
    spread: str = "0"
    published_scheme: str = "continuous"
    plant: Literal["stick-slip", "printed"] | None = None
    whole_task: bool = False
    accept_poor_fit: bool = False

    def problem(self, fault: str) -> "tuple[Fault, dict[str, Any]]":
        """Fault that a name denotes, and arguments of `designed_comparison`; checked before heavy libraries load."""
        from quakedesign.fault import load_fault, with_accepted_fit

        loaded = load_fault(fault, box=self.box, disturbance=self.disturbance)
        loaded = with_accepted_fit(loaded, self.accept_poor_fit)
        entered = vars(self)["diffusion"]
        if entered is not None and not rational(entered, "diffusion"):
            loaded.friction.require(no_diffusion=entered)
        behind = bool(self.setup().path)  # a delay, a lag or a diffusion path, for which only the e-LQR is designed
        laws = "elqr" if behind and self.controller == "all" else self._laws
        names = controllers(laws, loaded)
        loaded.friction.require(plant=self.plant)
        shown = {"published_scheme": self.published_scheme, "plant": self.plant, "whole_task": self.whole_task}
        arguments = self.arguments()
        loaded, arguments["options"]["setup"] = arguments["options"]["setup"].at_step(loaded)
        return loaded, {"names": names, **shown, **arguments}

    def arguments(self) -> dict[str, Any]:
        """Options of `designed_comparison`.

        Raises
        ------
        ParameterError
            For a scheme without `continuous`, as sampled designs have their own scheme.
        """
        if self.scheme is not None and not self.continuous:
            raise ParameterError(
                "--scheme needs --continuous; other designs run in the scheme of their guarantee. Received --scheme "
                f"{self.scheme} alone. Add --continuous, or omit --scheme."
            )
        options = {name: getattr(self, name) for name in _SHARED} | {"setup": self.setup(measured=self.measured)}
        return {"options": options, "scheme": self.scheme}

    @property
    def sliding(self) -> dict[str, Any]:
        """Lag [s] and stress [Pa] for several blocks in slow sliding."""
        return {"lag": self.setup().lag, "stress": None if self.stress is None else rational(self.stress)}

    @property
    def _laws(self) -> str:
        """Requested law or all; elqr if only the slip is measured, as no other law can then be designed."""
        if self.measured != "slip" or self.controller == "elqr":
            return self.controller
        if self.controller != "all":
            raise ParameterError(
                f"--measured slip is for the e-LQR. Received --controller {self.controller}. Omit --measured."
            )
        return "elqr"


_AS_USUAL = DesignOptions()


@app.command
def design(
    fault: FaultName,
    /,
    *,
    options: DesignOptions = _AS_USUAL,
    out: Path | None = None,
    format: Formats = ("svg",),
    force: Force = False,
    verbose: bool = False,
    output: Output = PLAIN,
) -> int:
    """Design, prove and simulate controllers, compare them with published gains, and write a report.

    Without --continuous, every designed controller runs as guaranteed: sampled, with a zero-order hold over T_s. Exit
    code 0 if every design is proved at the fault's T_s and no run of a designed controller is an earthquake, diverges
    or opens the fault; with --continuous, the premises control_coefficient, along_reference and friction_slope must
    hold too. Exit code 1 otherwise. Give quantities with a unit, such as '20 ms', or as numbers in SI units.

    Parameters
    ----------
    out
        Output folder; ./quakedesign-FAULT by default.
    verbose
        Also print the fault, gains, verdicts with premises, certified domains and all metrics, as in the report.
    """
    entered = dict(locals())
    from quakedesign.cli.block_commands import block_law, chain_at_step, require_loads, run_chain, several_blocks
    from quakedesign.report.folder import prepare

    accepted = ("step", "out", "format", "verbose", "box", "controller", "lag", "stress")
    if (chain := several_blocks(fault, globals()["design"], entered, accepted, options.box)) is not None:
        chain = chain_at_step(chain, options.setup())
        require_loads(chain, options.sliding)
        law = {"controller": block_law(options.controller, "all")} | (
            {"sliding": options.sliding} if chain.has_state else {}
        )
        return run_chain(chain, out or Path(f"quakedesign-{chain.name}"), force, output, format, **law)
    loaded, arguments = options.problem(fault)
    folder = out or Path(f"quakedesign-{loaded.name}")
    prepare(folder, force=force)
    lock_folder(folder)
    from quakedesign.report.comparison_table import designed_comparison
    from quakedesign.report.folder import write_folder

    with progress() as bar:
        comparison = designed_comparison(loaded, progress=bar, **arguments)
        results = write_folder(comparison, folder, force=force, formats=format, command=command_line(), progress=bar)

    def printed() -> None:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console(), whole=verbose)
        print_lines(["", f"written: {folder}/ (results.json, report.html, certificates, figures)"])
        if not verbose:
            print_lines([f"gains, premises and equations: {folder}/report.html, or --verbose"])

    output.show(results, printed)
    return 0 if positive(comparison) else 1


def controllers(name: str, fault: "Fault | None" = None) -> list[str]:
    """Laws to design: the one named, or all that apply to a fault."""
    from quakedesign.laws import control_law
    from quakedesign.synthesis import designable

    names = designable()
    if ":" in name:
        control_law(name)
    else:
        require_known(name, (*names, "all"), "controller", UnknownNameError)
    return list(designable(fault)) if name == "all" else [name]


def positive(comparison: Any) -> bool:
    """Whether every design is proved, its premises in `needed` hold, and its run is harmless.

    False for a design without the guarantee of its sampled loop.
    """
    needed = {"along_reference", "control_coefficient", "friction_slope", "sampling_time"}
    return all(
        str(entry.design.verdict) == "proved"
        and (entry.design.runs is None or entry.design.runs.available)
        and all(p.holds for p in entry.design.conditions if p.name in needed)
        and (entry.run is None or entry.run.outcome.harmless)
        for entry in comparison.of("designed")
    )


# ----------------------------------------------------------------------
# Commands that compare all controllers of a fault: in a table, and in the figures of the paper.

_FIGURES_AS_USUAL = DesignOptions()


@app.command
def compare(
    fault: FaultName, /, *, options: DesignOptions = _FIGURES_AS_USUAL, verbose: bool = False, output: Output = PLAIN
) -> int:
    """Do the same as `design`, but only print the comparison; no files are written.

    Exit code and units as for `design`.

    Parameters
    ----------
    verbose
        Also print the fault, gains, verdicts with premises, all metrics, and numbers that the paper prints.
    """
    entered = dict(locals())
    from quakedesign.cli.block_commands import chain_at_step, compare_chain, several_blocks
    from quakedesign.report.comparison_table import designed_comparison
    from quakedesign.report.folder import results
    from quakedesign.report.terminal import printed_lines
    from quakedesign.studies.paper import printed, table

    accepted = ("step", "verbose", "box", "controller", "lag", "stress")
    if (chain := several_blocks(fault, compare, entered, accepted, options.box)) is not None:
        return compare_chain(chain_at_step(chain, options.setup()), options.controller, options.sliding, output)
    loaded, arguments = options.problem(fault)
    with progress() as bar:
        comparison = designed_comparison(loaded, progress=bar, **arguments)
    if output.json:
        of_paper = {"numbers": table(comparison), "printed": printed(comparison)}
        print_json({**results(comparison, stored=False), **of_paper})
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console(), whole=verbose)
        if verbose:
            print_lines(printed_lines(printed(comparison), loaded.name))
    return 0 if positive(comparison) else 1


@app.command
def figures(
    fault: FaultName,
    /,
    *,
    options: DesignOptions = _FIGURES_AS_USUAL,
    out: Path | None = None,
    format: Formats = ("svg",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Draw the paper's figures of simulations for any fault, with published and designed gains.

    Writes the folder of `design`, these figures, and their numbers in numbers.csv and results.json. Units of quantities
    as for `design`.

    Parameters
    ----------
    out
        Output folder; ./quakedesign-FAULT-figures by default.
    """
    from quakedesign.report.folder import prepare, write_folder

    loaded, arguments = options.problem(fault)
    folder = out or Path(f"quakedesign-{loaded.name}-figures")
    prepare(folder, force=force)
    lock_folder(folder)
    from quakedesign.report.comparison_table import designed_comparison
    from quakedesign.report.paper_figures import paper_study
    from quakedesign.report.sentences import run_sentences
    from quakedesign.report.terminal import printed_lines

    with progress() as bar:
        comparison = designed_comparison(loaded, progress=bar, **arguments)
        study = paper_study(comparison, progress=bar)
        results = write_folder(
            comparison, folder, force=force, study=study, formats=format, command=command_line(), progress=bar
        )
    if output.json:
        print_json(results)
        return 0
    runs = ((e.label, "; ".join(run_sentences(e.run, loaded))) for e in comparison.entries if e.run)
    print_lines(f"{label}: {sentence}" for label, sentence in runs)
    files = [(drawn["file"], drawn["paper"]) for drawn in results["figures"].values()]
    print_lines(f"{folder}/{file}" + (f": {paper} of the paper" if paper else "") for file, paper in files)
    print_lines(printed_lines(results["printed"], loaded.name))
    print_lines(["", f"written: {folder}/ (also results.json, numbers.csv, report.html, certificates)"])
    return 0
