"""Faults of several blocks: guarantees and runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound, rational, shortly
from quakedesign.fault import BlockChain, Disturbance, SlidingReference
from quakedesign.files import Json
from quakedesign.guarantees import NoProof
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.guarantees.exact.plant_proof import PlantProof, named
from quakedesign.guarantees.exact.sliding_small_gain import exponential
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.guarantees.search.sliding_block_design import covered_stress
from quakedesign.lyapunov.exact.certificate_files import UNCERTAIN_PLANT
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import UncertainPlant, uncertain_plant
from quakedesign.plant.block_plant import inverse_of
from quakedesign.simulation.block_run import MPA, SUBSTEPS, BlockRun, simulate_blocks, whole_periods
from quakedesign.simulation.coupled_sliders import BlockEvent, SlidersRun, natural_cycles, simulate_sampled_blocks
from quakedesign.simulation.earthquake import STILL, event_nudge
from quakedesign.simulation.state_plant import TIDE
from quakedesign.studies.block_limits import chain_limits
from quakedesign.synthesis import guarantee
from quakedesign.synthesis.guarantee import BLOCK_LAWS
from quakedesign.text import PREFIXES, counted, lasting, plain, power_of, quantity

_NONE = UpperBound(0)
_FORESHOCK = 0.1  # share of the largest slip below which an event is no separate cycle
_FINENESS = 1e-3  # product of substep and natural frequency in a run without control
_NO_RUN = "nothing is simulated, as no law is proved"


def chain_lines(chain: BlockChain) -> list[str]:
    """Facts about a file of several blocks as lines of at most 80 characters."""
    lines = [
        f"{chain.name}: {len(chain.blocks)} blocks, {counted(len(chain.wells), 'well')} (box {chain.fault.box.name}, "
        f"task {chain.fault.reference.target_slip:g} m in {chain.fault.reference.operation_time:g} s)",
        "",
        f"{'block':>5}{'length [m]':>12}{'stress':>13}  {'share of each well':24}friction",
    ]
    for place, (block, row) in enumerate(zip(chain.blocks, chain.shares, strict=True), 1):
        shares = ", ".join(f"{float(v):.3g}" for v in row)
        stress = block.effective_normal_stress
        lines.append(f"{place:5}{block.length:12g}{quantity(stress, 'Pa', 4):>13}  {shares:24}{block.friction.name}")
    springs = ", ".join(f"{float(K):.4g}" for i, j, K in chain.springs if i < j)
    lines += ["", f"stiffness of the springs between neighbours over the mass of a block: {springs} 1/s^2"]
    pole, peak = _growth(chain), natural_peak(chain)
    stable = "stable" if pole == 0 else "stability unknown: its modes are not resolved in floating point"
    lines += [f"without control: {f'unstable, errors grow at up to {pole:.4g} 1/s' if pole else stable}"]
    lines += [] if peak is None else [f"natural earthquake: slip rate up to {quantity(peak, 'm/s')}"]
    if chain.diffusivity is not None:
        lines.append(
            f"pressure along the fault diffuses with {chain.diffusivity:g} m^2/s; shares are those at steady state"
        )
    return lines


def chain_dict(chain: BlockChain) -> Json:
    """The same facts as plain values, SI."""
    blocks = [
        {"length": b.length, "effective_normal_stress": b.effective_normal_stress, "friction": b.friction.name}
        for b in chain.blocks
    ]
    springs = [{"block": i + 1, "pulled_by": j + 1, "stiffness_over_mass": float(K)} for i, j, K in chain.springs]
    shares = [[float(v) for v in row] for row in chain.shares]
    along = {"wells": list(chain.wells), "shares": shares, "diffusivity": chain.diffusivity}
    events = {"growth_rate": _growth(chain), "natural_peak_slip_rate": natural_peak(chain)}
    return {"fault": chain.name, "blocks": blocks, **along, "springs": springs, **events}


# ----------------------------------------------------------------------
# A designed law, its proof and a run.


def farthest_balance(chain: BlockChain, proof: PlantProof) -> UpperBound | None:
    """Largest distance of a block's equilibrium from the reference [m] with fewer wells than blocks; else None."""
    N, task = len(chain.blocks), uncertain_plant(chain.fault)
    if len(chain.wells) == N:
        return None
    moves = [size for _, size in proof.part.disturbances[N:]]  # listed after the forces on the blocks
    return UpperBound(max(moves) / task.reference_rates[0] * task.target_slip)


@lru_cache(maxsize=8)
def _growth(chain: BlockChain) -> float | None:
    """Largest pole without control [1/s], 0 if no mode is unstable; None if floating point cannot decide."""
    try:
        return max((mode.pole for mode in chain_limits(chain).modes), default=0.0)
    except ParameterError:
        return None


@lru_cache(maxsize=8)
def natural_peak(chain: BlockChain) -> float | None:
    """Largest slip rate of blocks without control [m/s], released as by `natural_earthquake`.

    None if no mode is unstable or its modes are not resolved, if the peak is only that due to the small acceleration,
    for friction with a state, and for healing friction, which runs of blocks do not model.
    """
    beyond = chain.has_state or any(block.friction.rest_excess for block in chain.blocks)
    pole = None if beyond else _growth(chain)
    if not pole:
        return None
    nudge, omega = max(map(event_nudge, chain.faults)), chain.fault.natural_frequency
    released = replace(chain, fault=chain.fault.with_disturbance(Disturbance(constant=nudge)))
    still = ((Fraction(0),) * 2 * len(chain.wells),) * len(chain.wells)
    none = ((),) * len(still)
    step = SUBSTEPS * rational(_FINENESS / omega)
    law = MatrixLaw(step=step, delay=Fraction(0), update=(), measured=(), output=none, feedback=still)
    run = simulate_blocks(released, law, duration=max(90 / pole, 30 / pole + 20 * np.pi / omega))
    peak = float(run.slip_rate.max())
    return peak if peak > STILL * nudge / pole else None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainRun:
    """Guarantee of a designed law, and a run with it; no run without a guarantee."""

    chain: BlockChain
    controller: str
    proof: Any
    run: BlockRun | None

    @property
    def safe(self) -> bool:
        """Whether there is a run, within its model."""
        return self.run is not None and not self.run.reversed and not self.run.opened

    def row(self) -> list[str]:
        """Table row, largest values of all blocks: law, proved rate and slip errors, those of the run, pressures."""
        if self.run is None:
            return [self.controller, "none", *[""] * 5]
        outputs, N = self.proof.claims.outputs, len(self.chain.blocks)
        worst = self.run.slip_rate_error.max(), self.run.slip_error.max()
        return table_row(self.controller, max(outputs[N:]), max(outputs[:N]), worst, self.run.pressure)

    @property
    def summary(self) -> str:
        """The guarantee, relative to the natural earthquake."""
        N, peak = len(self.chain.blocks), natural_peak(self.chain)
        rate, slip = max(self.proved_slip_rates), max(self.proof.claims.outputs[:N])
        share = ""
        if peak is not None:
            ratio = UpperBound(100 * rate / rational(peak))
            share = f" ({ratio:.2g} % of the natural earthquake's {quantity(peak, 'm/s')})"
        far = farthest_balance(self.chain, self.proof)
        about = "the reference"
        if far is not None:
            about = f"its equilibrium, which lies within {far.quantity('m')} of the reference"
        return (
            f"{self.chain.name}: guaranteed on the plant without stick. With the {self.controller} law the slip rate "
            f"of no block exceeds {rate.quantity('m/s')}{share}, and the slip of each stays within "
            f"{UpperBound(slip).quantity('m')} of {about}."
        )

    @property
    def proved_slip_rates(self) -> list[UpperBound]:
        """Bounds of the slip rates themselves [m/s], including the reference rate."""
        first = uncertain_plant(self.chain.fault).reference_rates[0]
        return [UpperBound(first + error) for error in self.proof.claims.outputs[len(self.chain.blocks) :]]

    @property
    def proved_pressures(self) -> list[tuple[LowerBound, UpperBound]] | None:
        """Bounds of the pressures themselves [Pa]; None for fewer wells than blocks, and with diffusion."""
        chain = self.chain
        square = chain.diffusivity is None and len(chain.wells) == len(chain.blocks)
        if not square or (inverse := inverse_of(chain.shares)) is None:
            return None
        rest = [uncertain_plant(fault).rest_pressure for fault in chain.faults]
        ends = []
        for row, error in zip(inverse, self.proof.claims.controls, strict=True):
            low, high = (
                sum((v * p[(v < 0) != side] for v, p in zip(row, rest, strict=True)), Fraction(0)) for side in (0, 1)
            )
            ends.append((LowerBound(low - error), UpperBound(high + error)))
        return ends

    def proved_values(self) -> Json:
        """Proved slip rates of blocks [m/s] and pressures of wells [Pa], and the peak without control [m/s]."""
        ends = self.proved_pressures
        return {
            "slip_rates": [v.exact for v in self.proved_slip_rates],
            "pressures": ends and [[low.exact, high.exact] for low, high in ends],
            "natural_peak_slip_rate": natural_peak(self.chain),
        }

    def screen(self, conditions: Sequence[str]) -> list[str]:
        """Lines of at most 80 characters: the result, a table of blocks and wells, and the conditions of the proof."""
        wrapped = [wrap(line, 80, subsequent_indent="  ", break_on_hyphens=False) for line in conditions]
        return [*wrap(self.summary, 80), "", *self.lines(), "", *(line for lines in wrapped for line in lines)]

    def lines(self) -> list[str]:
        """Lines of at most 80 characters: blocks and wells, with proved and simulated values."""
        chain, run, N = self.chain, self.run, len(self.chain.blocks)
        if not self.proof.available:
            return [_NO_RUN]
        rates, slips = self.proved_slip_rates, [UpperBound(v) for v in self.proof.claims.outputs[:N]]
        powers = [power_of(float(max(values))) for values in (rates, slips)]
        heads = ["", f"slip rate [{PREFIXES[powers[0]]}m/s]", f"slip error [{PREFIXES[powers[1]]}m]"]
        parts = [
            f"{heads[0]:10}{heads[1]:>20}{heads[2]:>20}",
            f"{'':10}{'proved':>10}{'run':>10}{'proved':>10}{'run':>10}",
        ]
        for i in range(N):
            seen = (None, None) if run is None else (run.slip_rate[:, i].max(), run.slip_error[i])
            cells = ""
            for bound, value, power in zip((rates[i], slips[i]), seen, powers, strict=True):
                shown = "–" if value is None else plain(float(value) / 10.0**power)
                cells += f"{plain(float(f'{UpperBound(bound / Fraction(10) ** power):.3g}')):>10}{shown:>10}"
            rests = "" if run is None else f"   at rest {100 * run.rest[i]:.3g} % of the run"
            parts.append(f"{f'block {i + 1}':10}{cells}{rests}")
        ends, left = self.proved_pressures, False
        parts += [] if ends is None and run is None else ["pressure"]
        for j in range(len(chain.wells)):
            ranges = []
            if ends is not None:
                ranges.append(f"proved {ends[j][0].quantity('Pa')} to {ends[j][1].quantity('Pa')}")
            if run is not None:
                low, high = float(run.pressure[:, j].min()), float(run.pressure[:, j].max())
                outside = ends is not None and not ends[j][0] <= low <= high <= ends[j][1]
                ranges.append(f"run {quantity(low, 'Pa')} to {quantity(high, 'Pa')}{' (OUTSIDE)' if outside else ''}")
                left |= outside
            parts += [f"{f'well {j + 1}':10}{', '.join(ranges)}"] if ranges else []
        if run is not None:
            did = ", as pressures do here" if left else ""
            parts += [f"run: {lasting(float(run.times[-1]))} on the stick-slip plant, where errors and pressures may"]
            parts += [f"exceed bounds that are proved for the plant without stick{did}"]
            if len(chain.wells) < N:
                parts.append("slip error: relative to equilibrium in the proof, to the reference in the run")
            for event, happened in (("a block would slip backward", run.reversed), ("a block opens", run.opened)):
                parts += [f"{event}: the run is outside the model"] if happened else []
        return parts

    def to_dict(self) -> Json:
        """Values of the run, SI."""
        assert self.run is not None
        return self.run.to_dict()


def table_row(law: str, rate: Fraction, slip: Fraction, worst: Sequence[float], pressure: np.ndarray) -> list[str]:
    """Proved slip rate [m/s] and slip [m], largest values of a run, and range of its pressures [Pa], as strings."""
    proved = [UpperBound(v).quantity(unit) for v, unit in ((rate, "m/s"), (slip, "m"))]
    run = [*zip(worst, ("m/s", "m"), strict=True), (pressure.min(), "Pa"), (pressure.max(), "Pa")]
    return [law, *proved, *(quantity(float(v), unit) for v, unit in run)]


def chain_law(
    chain: BlockChain, controller: str = BLOCK_LAWS[0], certificate: str | Path | None = None, **sliding: Any
) -> Any:
    """Guarantee of a law for several blocks: of a new design, or of a certificate, which is re-checked.

    Parameters
    ----------
    chain : BlockChain
    controller : str
        ``centralised`` or ``decentralised``.
    certificate : str or Path, optional
    **sliding
        Lag and stress of a design for blocks in slow sliding.

    Raises
    ------
    ParameterError, CertificateError
        For a certificate that is invalid, or about another plant.
    """
    if certificate is None:
        return guarantee(chain, controller, **sliding).proof
    claim: Any = load_guarantee(certificate)
    several = claim.kind == UNCERTAIN_PLANT
    if chain.has_state:
        if not several:
            raise CertificateError(
                f"a certificate must be about several blocks. Received {certificate}, about one block. Give a file "
                f"of guarantee {chain.name} --out FILE."
            )
        proof: Any = covered_stress(chain, claim)[-1]
    else:
        plant = UncertainPlant.from_blocks(chain)
        if not several or claim.part != linear_part(plant, {}):
            raise CertificateError(
                f"a certificate must be about {plant.name}. Received {certificate}, about another plant. Give a file "
                f"of guarantee {chain.name} --out FILE."
            )
        proof = named(claim, plant)
    if claim.law.delay:
        raise CertificateError(
            f"the law of a certificate must have no delay. Received {certificate} with a delay of "
            f"{shortly(claim.law.delay)} s. Prove one with guarantee."
        )
    if claim.check() is not Verdict.PROVED:
        raise CertificateError(
            f"a certificate must be valid. Received {certificate}: its claims do not follow. Prove one with guarantee."
        )
    return proof


def run_of_chain(
    chain: BlockChain,
    controller: str = BLOCK_LAWS[0],
    duration: float | None = None,
    *,
    certificate: str | Path | None = None,
) -> ChainRun:
    """Design a law for several blocks, prove it, and run it on the stick–slip plant.

    Parameters
    ----------
    chain : BlockChain
    controller : str
        ``centralised`` or ``decentralised``.
    duration : float, optional
        Duration of the run [s]; by default the operation time.
    certificate : str or Path, optional
        File of a guarantee of this fault, whose law is run instead of a new design.

    Raises
    ------
    ParameterError, CertificateError
    """
    whole_periods(chain, rational(chain.fault.sampling_time), duration)  # reject before the long search
    proof = chain_law(chain, controller, certificate)
    run = simulate_blocks(chain, proof.law, duration=duration) if proof.available else None
    return ChainRun(chain=chain, controller=controller, proof=proof, run=run)


# ----------------------------------------------------------------------
# Blocks with rate-and-state friction: cycles without control, and runs of a proved law.


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingChainRun:
    """A run of blocks with rate-and-state friction: without control, or under the law of a guarantee."""

    chain: BlockChain
    run: SlidersRun | None
    inertia: bool
    proof: PlantProof | NoProof | None = None
    controller: str = ""
    # Lag [s] and largest stress [Pa] that the guarantee covers, its bound of |ln(v/V)|, and the stress of the run [Pa]
    lag: Fraction = Fraction(0)
    covered: Fraction = Fraction(0)
    log_rate: UpperBound = _NONE
    stress: float = 0.0

    @property
    def safe(self) -> bool:
        """Whether there is a run."""
        return self.run is not None

    def row(self) -> list[str]:
        """As in `ChainRun`; slip rates themselves, and pressures relative to the plan."""
        if self.run is None or self.proof is None or not self.proof.available:
            return [self.controller, "none", *[""] * 5]
        rate = SlidingReference(task=self.chain.fault.reference).first_rate * exponential(self.log_rate)
        slip = max(self.proof.claims.outputs[: len(self.chain.blocks)])
        worst = self.run.slip_rate.max(), self.errors["slip_error"].max()
        return table_row(self.controller, rate, slip, worst, self.run.pressure)

    @property
    def events(self) -> tuple[BlockEvent, ...]:
        """Events without control."""
        assert self.run is not None
        fault = self.chain.fault
        per_slip = [fault.shear_modulus * fault.area * float(v) / fault.length for v in self.chain.lengths]
        return self.run.events(np.array(per_slip))

    @property
    def errors(self) -> dict[str, "np.ndarray"]:
        """Largest slip error [m], |ln(v/V)| and |ln(θ/θ*)| of blocks, and well pressure relative to the plan [Pa]."""
        assert self.run is not None
        run, V = self.run, float(SlidingReference(task=self.chain.fault.reference).first_rate)
        steady = np.array([float(block.friction.steady_state(V)[0]) for block in self.chain.blocks])
        return {
            "slip_error": np.abs(run.slip - run.reference[:, None]).max(axis=0),
            "log_rate": np.abs(np.log(run.slip_rate / V)).max(axis=0),
            "log_state": np.abs(np.log(run.state / steady)).max(axis=0),
            "pressure_beside_plan": np.abs(run.pressure).max(axis=0),
        }

    @property
    def within(self) -> bool:
        """Whether all errors of a controlled run are within the proved bounds of their blocks and wells."""
        assert self.proof is not None
        assert self.proof.available
        N, claims, errors = len(self.chain.blocks), self.proof.claims, self.errors
        values = [errors[name] for name in ("slip_error", "log_state", "pressure_beside_plan", "log_rate")]
        proved = [*claims.outputs[: 2 * N], *(v * MPA for v in claims.controls), *[self.log_rate] * N]
        return bool((np.concatenate(values) <= np.array(proved, dtype=float)).all())

    def screen(self, conditions: Sequence[str]) -> list[str]:
        """Conditions of the proof, and the run."""
        return [*conditions, "", *self.lines()]

    def proved_values(self) -> Json:
        """Empty: the bounds of the blocks are those of the guarantee."""
        return {}

    def lines(self) -> list[str]:
        """The run as lines of text."""
        if self.run is None:
            return [_NO_RUN]
        end = lasting(float(self.run.times[-1]))
        if self.proof is not None:
            covered = LowerBound(self.covered).quantity("Pa")
            parts = [
                f"run of {end} under a sinusoidal shear stress of {quantity(self.stress, 'Pa')} on every block; proved "
                f"for stresses up to {covered} and a lag of {float(self.lag):g} s: |ln(v/V)| <= {self.log_rate:.3g}",
                *(
                    f"block {i}: slip error {quantity(float(slip), 'm')}, |ln(v/V)| {rate:.3g}, |ln(state)| {state:.3g}"
                    for i, (slip, rate, state) in enumerate(zip(*list(self.errors.values())[:3], strict=True), 1)
                ),
                *(
                    f"well {i}: pressure within {quantity(float(v), 'Pa')} of the plan"
                    for i, v in enumerate(self.errors["pressure_beside_plan"], 1)
                ),
            ]
            return [
                *parts,
                f"{'within' if self.within else 'OUTSIDE'} the proved bounds of slips, rates, states and pressures",
            ]
        events = self.events
        loaded = f"{self.chain.name}, under remote loading at {quantity(self.run.loading_rate, 'm/s')}"
        parts = [f"{loaded}: {counted(len(events), 'event')} in {end}"]
        parts += [
            f"event {i}: from {lasting(event.onset)}, slip "
            + (", ".join(quantity(v, "m") for v in event.slip) if event.slip else "not ended")
            + f", up to {', '.join(quantity(v, 'm/s') for v in event.peak_slip_rate)}"
            + ("" if event.magnitude is None else f", magnitude {event.magnitude:.2f}")
            for i, event in enumerate(events, 1)
        ]
        sizes = [sum(event.slip or ()) for event in events]
        main = [event.onset for event, size in zip(events, sizes, strict=True) if size > _FORESHOCK * max(sizes)]
        if len(main) > 1:
            small = f", of events with over {_FORESHOCK:.0%} of the largest slip" if len(main) < len(events) else ""
            parts.append(f"recurrence interval {lasting(main[-1] - main[-2])}{small}")
        return parts

    def to_dict(self) -> Json:
        """Plain values, SI."""
        run = self.run
        assert run is not None
        entries: Json = {
            "plant": "smooth" if self.inertia else "quasi-dynamic",
            "duration": float(run.times[-1]),
            "steps": len(run.times),
        }
        if self.proof is not None:
            errors = {f"max_{name}": values.tolist() for name, values in self.errors.items()}
            content = {"lag": float(self.lag), "stress": self.stress, "covered_stress": float(self.covered)}
            content |= {"proved_log_rate": float(self.log_rate)}
            return entries | content | errors | {"within": self.within}
        last = run.onsets[-2:]
        return entries | {
            "loading_rate": run.loading_rate,
            "recurrence_interval": float(last[1] - last[0]) if len(last) > 1 else None,
            "slip_events": [asdict(event) for event in self.events],
        }


def run_sliding_chain(
    chain: BlockChain,
    controller: str = BLOCK_LAWS[0],
    *,
    certificate: str | Path | None = None,
    sliding: Mapping[str, Any] | None = None,
    stress: float | None = None,
    stress_period: float = TIDE,
    loading_rate: float | None = None,
    duration: float | None = None,
    inertia: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> SlidingChainRun:
    """Run blocks with rate-and-state friction without control, or under a proved law.

    Parameters
    ----------
    chain : BlockChain
    controller, certificate
        As in `chain_law`.
    sliding : mapping, optional
        Lag and stress of a new design. With neither it nor a certificate there is no control.
    stress : float, optional
        Amplitude of sinusoidal shear stress on every block, with equally spaced phases [Pa]; by default the proved one.
    stress_period : float
        Period of this stress [s].
    loading_rate, duration, inertia
        As in `natural_cycles`, or `simulate_sampled_blocks` with a law.

    Raises
    ------
    ParameterError, CertificateError, SimulationError
    """
    if certificate is None and sliding is None:
        if stress is not None:
            raise ParameterError("stress on blocks needs a law. Received no certificate. Give --certificate.")
        run = natural_cycles(chain, duration, loading_rate=loading_rate, inertia=inertia)
        return SlidingChainRun(chain=chain, run=run, inertia=inertia)
    if loading_rate is not None:
        raise ParameterError("the far end of the springs is fixed in slow sliding. Received a loading rate. Omit it.")
    proof = chain_law(chain, controller, certificate, **(sliding or {}))
    if not proof.available:
        return SlidingChainRun(chain=chain, run=None, inertia=inertia, proof=proof, controller=controller)
    lag, covered, rate, _ = covered_stress(chain, proof)
    size = float(covered) if stress is None else stress
    trajectory = simulate_sampled_blocks(
        chain,
        proof.law,
        lag=float(lag),
        stress=size,
        period=stress_period,
        duration=duration,
        inertia=inertia,
        progress=progress,
    )
    entries: dict[str, Any] = {"lag": lag, "covered": covered, "log_rate": rate, "stress": size}
    return SlidingChainRun(chain=chain, run=trajectory, inertia=inertia, proof=proof, controller=controller, **entries)
