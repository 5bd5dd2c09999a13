"""The laboratory experiment of the paper under conditions that it does not print: table and figures of the docs.

Run with ``python benchmarks/laboratory.py FOLDER [conditions|whole|runs|guaranteed]``; an hour on one core. Findings go
to FOLDER/findings.jsonl as they come. The numbers are the same in every run on one machine.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import math
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import sympy as sp

from quakedesign.fault import Disturbance, Fault, load_fault
from quakedesign.files import temporary_folder
from quakedesign.guarantees import TrackingProof
from quakedesign.guarantees.tracking_result import TrackingGuarantee
from quakedesign.laws import Controller, published
from quakedesign.loop import Actuator, Delay, Lag, Saturation, simulation_scheme
from quakedesign.loop.actuators.base import Stage
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.loop.sensing import Averaging, Differentiator, OutputFeedback, Sensor, SlipStage, Transducer
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.parallel import SerialExecutor
from quakedesign.report.drawing import SMALL, colour, figure, finish, named
from quakedesign.simulation import Load, Trajectory, natural_earthquake
from quakedesign.simulation.campaign import Campaign, CampaignProblem, Space, campaign_problem, run_campaign
from quakedesign.simulation.compiled import LANES
from quakedesign.simulation.trajectory import KINDS
from quakedesign.synthesis import guarantee

PRESET = "lab-apparatus"
_WAVES = 3
_START = 1e-6  # m, within which specimens start
_DECADE = 0.7  # of wavelengths, from that of the grains on
_LARGEST_RATE = 0.4  # of a substep times η̂, from which on more substeps are taken
_SURROUNDINGS = (  # ms of delay, ms of lag, nm of the readings' error, class of the disturbance
    (1, 0, 500, "amplitude"),
    (1, 1, 500, "amplitude"),
    (1, 1, 500, "rate"),
    (2, 0, 500, "amplitude"),
    (2, 1, 500, "rate"),
)
_SPREAD = MappingProxyType(
    {"stiffness": (0.95, 1.05), "damping": (0.8, 1.2), "authority": (0.95, 1.05), "weakening": (0.9, 1.0)}
)


@dataclass(frozen=True, kw_only=True)
class Apparatus:
    """What the experiment consists of beside the fault of Table I: one number each, see ``apparatus.toml``.

    Attributes
    ----------
    bound, inner_steps, readings
        Differentiator: λ_d [m/s³], steps per reading, readings in a running mean.
    slip_noise, quantum : float
        Of the measured slip [m].
    delay, jitter, lag, lowest, highest
        From a reading to the bag: samples, further samples at random, time constant [s], range of pressures [Pa].
    stick : int
        Whether friction is set-valued.
    mass, damping, stiffness : float
        Of those of Table I [-].
    critical_slip : float
        d_c [m].
    roughness, grain : float
        Departure of the friction coefficient from its law, at most [-], and the shortest wavelength in slip [m].
    deficit : float
        Shear stress below the verge of slip at the start [Pa].
    initial_slip : float
        [m].
    """

    bound: float
    inner_steps: int
    readings: int
    slip_noise: float
    quantum: float
    delay: int
    jitter: int
    lag: float
    lowest: float
    highest: float
    stick: int
    mass: float
    damping: float
    stiffness: float
    critical_slip: float
    roughness: float
    grain: float
    deficit: float
    initial_slip: float

    @classmethod
    def known(cls) -> Self:
        """The apparatus as ``apparatus.toml`` has it."""
        return cls(**{field.name: numbers()[field.name]["value"] for field in fields(cls)})

    @classmethod
    def printed(cls) -> Self:
        """What the paper writes down, read in SI units, and nothing else: no stick, noise, latency or roughness."""
        absent = ("slip_noise", "quantum", "delay", "jitter", "lag", "roughness", "stick")
        nothing: dict[str, Any] = dict.fromkeys(absent, 0)
        return replace(cls.known(), bound=1e-5, **nothing)

    def fault(self) -> Fault:
        """Fault of this apparatus, without a disturbance in time."""
        base = load_fault(PRESET)
        return replace(
            base,
            density=base.density * self.mass,
            damping=base.damping * self.damping,
            shear_modulus=base.shear_modulus * self.stiffness,
            friction=replace(base.friction, critical_slip=self.critical_slip),  # type: ignore[type-var]
            disturbance=Disturbance(constant=-self.deficit * base.authority / self.mass),
        )

    def response(self) -> tuple[float, float]:
        """Slip [m] of the natural earthquake, and the time [s] from a tenth to nine tenths of it; 0 if it is stable."""
        fault = self.fault()
        if not fault.rest_slip:
            return 0.0, 0.0
        event = natural_earthquake(fault)
        slip = float(event.slip[-1])
        first, last = np.interp((0.1 * slip, 0.9 * slip), np.maximum.accumulate(event.slip), event.time)
        return slip, float(last - first)

    def load(self, seed: int) -> Load:
        """Roughness of one pair of surfaces: waves in slip of random length and phase, at nominal normal stress."""
        if not self.roughness:
            return Load()
        draw, fault, slip = np.random.default_rng(seed), self.fault(), sp.Symbol("slip", real=True)
        size = self.roughness / _WAVES * fault.authority * fault.effective_normal_stress
        lengths = self.grain * 10 ** draw.uniform(0, _DECADE, _WAVES)
        phases = draw.uniform(0, 2 * math.pi, _WAVES)
        waves = (sp.sin(sp.Float(2 * math.pi / w) * slip + sp.Float(p)) for w, p in zip(lengths, phases, strict=True))
        return Load(perturbation=sp.Float(size) * sum(waves))

    def sensor(self, step: float) -> Sensor:
        """LVDT, mean and the printed differentiator, n_d = n_f = 2."""
        transducer = Transducer(deviation=self.slip_noise, quantum=self.quantum)
        stages: list[SlipStage] = [transducer] if self.slip_noise or self.quantum else []
        stages += [Averaging(samples=self.readings)] if self.readings > 1 else []
        inner: dict[str, Any] = {"order": 2, "filter_order": 2, "inner_steps": self.inner_steps}
        return OutputFeedback(differentiator=Differentiator(bound=self.bound, step=step, **inner), stages=tuple(stages))

    def actuator(self) -> Actuator:
        """From the controller to the bag."""
        stages: list[Stage] = [Delay(samples=self.delay, jitter=self.jitter)] if self.delay or self.jitter else []
        stages += [Saturation(lowest=self.lowest, highest=self.highest)]
        return Actuator(stages=(*stages, Lag(time_constant=self.lag)) if self.lag else tuple(stages))

    def problem(
        self, law: Controller, seed: int, *, duration: float | None = None, measurement: Sensor | None = None
    ) -> CampaignProblem:
        """Campaign of a law over specimens: stiffness, damping, area, friction drop, start and noise differ by seed.

        Parameters
        ----------
        law : Controller
        seed : int
        duration : float, optional
            [s]; the whole task unless given.
        measurement : Sensor, optional
            In place of LVDT and differentiator.
        """
        fault = self.fault()
        name, own, numbers = scheme_of_run(law, None, None)
        step = fault.sampling_time if own is None else own
        substeps = max(2, math.ceil(step * fault.specific_damping / _LARGEST_RATE))
        around = {"substeps": substeps, "actuator": self.actuator(), "measurement": measurement or self.sensor(step)}
        whole = campaign_problem(
            fault,
            law,
            scheme=simulation_scheme(str(name), **around, **numbers),
            duration=duration,
            settled_from=0.0,
            plant="stick-slip" if self.stick else "printed",
            load=self.load(seed),
            seed=seed,
        )
        start = {"initial_slip": (self.initial_slip, self.initial_slip + _START)}
        return replace(whole, space=Space(MappingProxyType({**whole.space.ranges, **_SPREAD, **start})))


@cache
def numbers() -> Mapping[str, Mapping[str, Any]]:
    """Value, unit, range, how it is known and why of every number of `Apparatus`."""
    text = (Path(__file__).parent / "apparatus.toml").read_text(encoding="utf-8")
    return MappingProxyType({name: one for name, one in tomllib.loads(text).items() if name != "source"})


@dataclass(frozen=True, kw_only=True)
class LaboratoryFinding:
    """What one law does under one condition.

    Attributes
    ----------
    condition, law : str
    outcomes : mapping of str to int
        Number of specimens by the kind of their outcome.
    slip_error, peak_slip_rate, rms_pressure : tuple of float
        Least, median and largest of the specimens [m], [m/s], [Pa]; infinite where one diverges.
    """

    condition: str
    law: str
    outcomes: Mapping[str, int]
    slip_error: tuple[float, float, float]
    peak_slip_rate: tuple[float, float, float]
    rms_pressure: tuple[float, float, float]

    @property
    def harmless(self) -> int:
        """Number of specimens that slip slowly, on the reference or off it."""
        return self.outcomes["tracked"] + self.outcomes["slow slip"]

    @classmethod
    def of(cls, condition: str, law: str, found: Campaign) -> Self:
        """Finding of a campaign."""
        return cls(
            condition=condition,
            law=law,
            outcomes={kind: len(found.kinds[kind]) for kind in KINDS},
            slip_error=_spread(found, "max_slip_error"),
            peak_slip_rate=_spread(found, "peak_slip_rate"),
            rms_pressure=_spread(found, "rms_pressure"),
        )


def _spread(found: Campaign, metric: str) -> tuple[float, float, float]:
    values = np.sort(found.values(metric)) if metric in found.metrics else np.full(len(found.results), math.inf)
    return float(values[0]), float(values[(len(values) - 1) // 2]), float(values[-1])


def conditions() -> dict[str, Apparatus]:
    """Conditions by name: what is printed and one more at a time; the same with stick, and with λ_d in m/ms³; all.

    One that begins with stick keeps friction set-valued; one with quick λ_d reads the printed 1e-5 in m/ms³.
    """
    printed, known = Apparatus.printed(), Apparatus.known()
    stick = replace(printed, stick=1)
    single: dict[str, dict[str, Any]] = {
        "as printed": {},
        "10 steps inside": {"inner_steps": 10},
        "mean of 10 readings": {"readings": 10},
        "noise 1 um": {"slip_noise": 1e-6, "quantum": 1.5e-7},
        "1 to 2 ms late": {"delay": 1, "jitter": 1},
        "lag 20 ms": {"lag": 2e-2},
        "rough 0.005": {"roughness": 5e-3},
        "mass x5": {"mass": 5.0},
        "damping x10": {"damping": 10.0},
        "d_c 5 mm": {"critical_slip": 5e-3},
        "d_c 8 mm": {"critical_slip": 8e-3},
        "1 kPa below the verge": {"deficit": 1e3},
    }
    quick = replace(stick, bound=known.bound)
    bases = {"": printed, "stick, ": stick, "stick, quick λ_d, ": quick}
    every = {f"{base}{name}": replace(one, **more) for base, one in bases.items() for name, more in single.items()}
    smooth = replace(printed, bound=known.bound)
    every |= {
        f"quick λ_d, {name}": replace(smooth, **single[name]) for name in ("as printed", "mass x5", "damping x10")
    }
    every |= {f"stick, λ_d {bound:g} m/s³": replace(stick, bound=bound) for bound in (1e-4, 1e-3, 10.0)}
    return every | {"apparatus": known, "apparatus, λ_d 10 m/s³": replace(known, bound=10.0)}


def explain(
    chosen: Mapping[str, Apparatus],
    *,
    specimens: int = LANES,
    seed: int = 0,
    duration: float | None = None,
    laws: Sequence[str] = ("cta", "dia", "elqr"),
    report: Callable[[LaboratoryFinding], None] = lambda _: None,
) -> list[LaboratoryFinding]:
    """The published laboratory gains under conditions, over specimens.

    Parameters
    ----------
    chosen : mapping of str to Apparatus
        Such as `conditions()`.
    specimens : int
    seed : int
    duration : float, optional
        [s]; the whole task unless given.
    laws : sequence of str
    report : callable
        Called with every finding as it comes.
    """
    gains, findings = published("lab-fault"), []
    for name, one in chosen.items():
        for law in laws:
            findings.append(
                LaboratoryFinding.of(name, law, _run(one.problem(gains[law], seed, duration=duration), specimens))
            )
            report(findings[-1])
    return findings


def _run(problem: CampaignProblem, specimens: int) -> Campaign:
    with temporary_folder() as folder:
        return run_campaign(problem, specimens, folder / "specimens", executor=SerialExecutor(), batch=specimens)


def guarantees() -> dict[str, TrackingGuarantee]:
    """What is guaranteed of an e-LQR of the slip alone, in less and more of the apparatus, by its conditions."""
    fault = load_fault(PRESET)
    return {
        f"{delay} ms late, lag {lag} ms, readings off by {noise} nm, {kind}": guarantee(
            fault,
            "elqr",
            measured="slip",
            delay=Fraction(delay, 1000),
            lag=Fraction(lag, 1000),
            slip_noise=Fraction(noise, 10**9),
            disturbance_class=kind,
        )
        for delay, lag, noise, kind in _SURROUNDINGS
    }


def as_proved(one: Apparatus, proof: TrackingProof) -> Apparatus:
    """An apparatus with the delay and the lag of a proof, without jitter."""
    held = proof.sampled_loop
    return replace(one, delay=int(held.delay / held.step), jitter=0, lag=float(held.lag))


def guaranteed_in(
    one: Apparatus,
    proof: TrackingProof,
    *,
    specimens: int = LANES,
    seed: int = 0,
    duration: float | None = None,
    name: str = "guaranteed",
) -> LaboratoryFinding:
    """A guaranteed law in an apparatus, for readings off by anything within the bound of the proof."""
    problem = guaranteed_problem(one, proof, seed, duration=duration)
    return LaboratoryFinding.of(name, "elqr", _run(problem, specimens))


def guaranteed_problem(
    one: Apparatus, proof: TrackingProof, seed: int, *, duration: float | None = None
) -> CampaignProblem:
    """Campaign of a guaranteed law in an apparatus; duration in s, the whole task unless given."""
    noise = Measurement(slip_noise=float(proof.sampled_loop.slip_noise), bounded=True)
    return one.problem(proof.controller, seed, duration=duration, measurement=noise)


_LEAST, _MOST = 1e-7, 10.0  # m, of the axis of slip errors; what is outside lies on its edge
_MARKS = {"tracked": "o", "slow slip": "s", "earthquake": "x", "opened": "^", "diverged": "^"}
_APART = 0.22  # of laws in a row


def conditions_figure(findings: Sequence[LaboratoryFinding], title: str, note: str) -> Any:
    """Slip error [m] of the published laws under every condition: median, range and the commonest outcome."""
    names = list(dict.fromkeys(f.condition for f in findings))
    laws = list(dict.fromkeys(f.law for f in findings))
    drawing, axes = figure(1, 1.6 + 0.24 * len(names))
    axis = axes[0, 0]
    for place, law in enumerate(laws):
        for f in (f for f in findings if f.law == law):
            low, middle, high = np.clip(f.slip_error, _LEAST, _MOST)
            kind = max(f.outcomes, key=lambda k: f.outcomes[k])
            at = names.index(f.condition) + _APART * (place - (len(laws) - 1) / 2)
            axis.plot([low, high], [at, at], color=colour(law), linewidth=1)
            axis.plot(middle, at, _MARKS[kind], color=colour(law), markersize=4)
        axis.plot([], [], "-", color=colour(law), label=law)
    for kind in dict.fromkeys(max(f.outcomes, key=lambda k: f.outcomes[k]) for f in findings):
        axis.plot([], [], _MARKS[kind], color="#444444", label=kind)
    axis.set(xscale="log", xlim=(_LEAST / 1.5, _MOST), yticks=range(len(names)), xlabel="largest slip error [m]")
    axis.set_yticklabels(names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    return finish(drawing, title, [], note, legend=axis)


def runs_figure(runs: Mapping[str, Mapping[str, Trajectory]], title: str, note: str) -> Any:
    """Slip error, slip rate and pressure of runs over time, one column a condition, one line a law."""
    drawing, axes = figure(3, 5.0, len(runs), sharex=True, sharey="row")
    for column, (condition, laws) in zip(axes.T, runs.items(), strict=True):
        named(column[0], condition)
        for behind, (law, run) in enumerate(laws.items()):
            minutes = run.time / 60
            values = (run.slip - run.reference) * 1e3, run.slip_rate * 1e3, run.pressure / 1e3
            for axis, value in zip(column, values, strict=True):
                axis.plot(minutes, value, color=colour(law), linewidth=0.8, label=law, zorder=2 - behind / 10)
        column[-1].set_xlabel("time [min]", fontsize=SMALL)
    for axis, label in zip(axes[:, 0], ("slip error [mm]", "slip rate [mm/s]", "pressure [kPa]"), strict=True):
        axis.set_ylabel(label, fontsize=SMALL)
    for axis, width in zip(axes[:, 0], (1e-3, 1e-2, 10.0), strict=True):
        axis.set_yscale("symlog", linthresh=width)
    return finish(drawing, title, [run for laws in runs.values() for run in laws.values()], note, legend=axes[0, -1])


DURATION = 600.0  # s, in which friction weakens most steeply: its slope is still 0.86 of the first one at the end
WHOLE = ("stick, quick λ_d, as printed", "apparatus")
TITLE = "Published laboratory gains under conditions that the paper does not print"


def keep(folder: Path, findings: list[LaboratoryFinding]) -> None:
    """Print findings, and write them one a line."""
    with (folder / "findings.jsonl").open("a", encoding="utf-8") as file:
        for found in findings:
            print(row(found), flush=True)
            file.write(json.dumps(asdict(found)) + "\n")


def row(found: LaboratoryFinding) -> str:
    """Row of a table: median (least to largest)."""
    kinds = ", ".join(f"{count} {kind}" for kind, count in found.outcomes.items() if count)
    sizes = found.slip_error, found.peak_slip_rate, found.rms_pressure
    numbers = " | ".join(f"{middle:.2g} ({low:.2g} to {high:.2g})" for low, middle, high in sizes)
    return f"| {found.condition} | {found.law} | {kinds} | {numbers} |"


def all_conditions(folder: Path) -> None:
    """Campaign of every condition and law, sixteen specimens each, and their figure."""
    findings = explain(conditions(), duration=DURATION, report=lambda found: keep(folder, [found]))
    note = (
        f"first {DURATION:g} s of the task; median and range of 16 specimens; an error beyond the axis is at its edge"
    )
    conditions_figure(findings, TITLE, note).savefig(folder / "laboratory-conditions.png")


def whole(folder: Path) -> None:
    """Some of them over the whole task."""
    explain({name: conditions()[name] for name in WHOLE}, report=lambda found: keep(folder, [whole_task(found)]))


def whole_task(found: LaboratoryFinding) -> LaboratoryFinding:
    """Finding whose condition says that it is about the whole task."""
    return replace(found, condition=f"{found.condition}, one hour")


def runs(folder: Path) -> None:
    """One specimen over the whole task, in what is printed, with stick, and in the apparatus."""
    stick, drawn = replace(Apparatus.printed(), stick=1), {}
    proof = guarantees()["1 ms late, lag 1 ms, readings off by 500 nm, amplitude"].proof
    assert isinstance(proof, TrackingProof)
    for name, one in {"stick, λ_d = 1e-5 m/s³": stick, "apparatus, λ_d = 1e-5 m/ms³": Apparatus.known()}.items():
        problems = {law: one.problem(gains, 0) for law, gains in published("lab-fault").items()}
        if one.bound == Apparatus.known().bound:
            problems["guaranteed"] = guaranteed_problem(one, proof, 0)
        drawn[name] = {law: problem.trajectory(problem.sample(0), 4000) for law, problem in problems.items()}
    note = "one specimen; slip rates are those at the 4000 instants that are drawn, and higher in between"
    runs_figure(drawn, "The experiment in its apparatus", note).savefig(folder / "laboratory-runs.png")


def guaranteed(folder: Path) -> None:
    """What is guaranteed, and what the law does in the apparatus beyond the conditions of its proof."""
    known = Apparatus.known()
    for name, answer in guarantees().items():
        print(name, *answer.lines(), sep="\n  ", flush=True)
        if isinstance(answer.proof, TrackingProof):
            for where, one in (("as proved", as_proved(known, answer.proof)), ("apparatus", known)):
                keep(folder, [guaranteed_in(one, answer.proof, duration=DURATION, name=f"{where}: {name}")])


if __name__ == "__main__":
    where = Path(sys.argv[1])
    where.mkdir(parents=True, exist_ok=True)
    for part in sys.argv[2:] or ("conditions", "whole", "runs", "guaranteed"):
        {"conditions": all_conditions, "whole": whole, "runs": runs, "guaranteed": guaranteed}[part](where)
