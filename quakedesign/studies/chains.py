"""Faults of several blocks: what is proved of them, and how they run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import BlockChain, SlidingReference
from quakedesign.guarantees import NoGuarantee
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.guarantees.exact.plant_guarantee import PlantGuarantee, named
from quakedesign.guarantees.exact.sliding_small_gain import exponential
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.guarantees.search.sliding_block_design import covered_stress
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import UncertainPlant, uncertain_plant
from quakedesign.simulation.block_run import MPA, BlockRun, simulate_blocks, whole_periods
from quakedesign.simulation.coupled_sliders import (
    BlockEvent,
    SlidersRun,
    natural_cycles,
    simulate_held_blocks,
)
from quakedesign.simulation.state_plant import TIDE
from quakedesign.synthesis import guarantee
from quakedesign.synthesis.guarantee import BLOCK_LAWS
from quakedesign.text import counted, lasting, quantity

_NONE = UpperBound(0)
_NO_RUN = "nothing is simulated, as no law is proved"


def chain_lines(chain: BlockChain) -> list[str]:
    """What a file of several blocks says, within 80 columns."""
    said = [
        f"{chain.name}: {len(chain.blocks)} blocks, {counted(len(chain.wells), 'well')} (box {chain.fault.box.name}, "
        f"task {chain.fault.reference.target_slip:g} m in {chain.fault.reference.operation_time:g} s)",
        "",
        f"{'block':>5}{'length [m]':>12}{'stress [Pa]':>13}  {'share of each well':24}friction",
    ]
    for place, (block, row) in enumerate(zip(chain.blocks, chain.shares, strict=True), 1):
        shares = ", ".join(f"{float(v):.3g}" for v in row)
        stress = block.effective_normal_stress
        said.append(f"{place:5}{block.length:12g}{stress:13.4g}  {shares:24}{block.friction.name}")
    springs = ", ".join(f"{float(K):.4g}" for i, j, K in chain.springs if i < j)
    said += ["", f"springs to the next block over the mass of a block: {springs} 1/s^2"]
    if chain.diffusivity is not None:
        said.append(
            f"pressure along the fault diffuses with {chain.diffusivity:g} m^2/s; shares are those at steady state"
        )
    return said


def chain_dict(chain: BlockChain) -> dict[str, Any]:
    """The same as plain values, SI."""
    blocks = [
        {"length": b.length, "effective_normal_stress": b.effective_normal_stress, "friction": b.friction.name}
        for b in chain.blocks
    ]
    springs = [{"block": i + 1, "pulled_by": j + 1, "stiffness_over_mass": float(K)} for i, j, K in chain.springs]
    shares = [[float(v) for v in row] for row in chain.shares]
    along = {"wells": list(chain.wells), "shares": shares, "diffusivity": chain.diffusivity}
    return {"fault": chain.name, "blocks": blocks, **along, "springs": springs}


# ----------------------------------------------------------------------
# A designed law, its proof and a run.


def farthest_balance(chain: BlockChain, found: PlantGuarantee) -> UpperBound | None:
    """How far from the reference a block may be at balance [m], under fewer wells than blocks; else None."""
    N, task = len(chain.blocks), uncertain_plant(chain.fault)
    if len(chain.wells) == N:
        return None
    moves = [size for _, size in found.part.disturbances[N:]]  # behind the forces on the blocks
    return UpperBound(max(moves) / task.reference_rates[0] * task.target_slip)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainRun:
    """What is proved of a designed law, and a run with it; no run where nothing is proved."""

    chain: BlockChain
    controller: str
    found: Any
    run: BlockRun | None

    @property
    def safe(self) -> bool:
        """Whether there is a run, within its model."""
        return self.run is not None and not self.run.reversed and not self.run.opened

    def row(self) -> list[str]:
        """Largest values of all blocks for a table: law, proved slip rate and slip, those of the run, pressures."""
        if self.run is None:
            return [self.controller, "none", *[""] * 5]
        outputs, N = self.found.claims.outputs, len(self.chain.blocks)
        worst = self.run.slip_rate_error.max(), self.run.slip_error.max()
        return table_row(self.controller, max(outputs[N:]), max(outputs[:N]), worst, self.run.pressure)

    def lines(self) -> list[str]:
        """For people."""
        run = self.run
        if run is None:
            return [_NO_RUN]
        said = [
            f"run over {run.times[-1]:g} s on the stick-slip plant; what is proved is of the plant without stick, so "
            "that here a slip, a slip rate, or a pressure less its load may pass its bound:"
        ]
        for i, (slip, rate, rest) in enumerate(zip(run.slip_error, run.slip_rate_error, run.rest, strict=True), 1):
            said.append(
                f"block {i}: slip error {slip:.3g} m, slip-rate error {rate:.3g} m/s, at rest {100 * rest:.3g} %"
            )
        for i, (least, largest) in enumerate(zip(run.pressure.min(axis=0), run.pressure.max(axis=0), strict=True), 1):
            said.append(f"well {i}: pressure {least:.3g} Pa to {largest:.3g} Pa")
        for event, happened in (("a block would slip backward", run.reversed), ("a block opens", run.opened)):
            said += [f"{event}: the run is outside the model"] if happened else []
        return said

    def to_dict(self) -> dict[str, Any]:
        """Figures of the run, SI."""
        assert self.run is not None
        return self.run.to_dict()


def table_row(law: str, rate: Fraction, slip: Fraction, worst: Sequence[float], pressure: np.ndarray) -> list[str]:
    """Proved slip rate [m/s] and slip [m], the largest of a run, and the ends of its pressures [Pa], as texts."""
    proved = [UpperBound(v).quantity(unit) for v, unit in ((rate, "m/s"), (slip, "m"))]
    run = [*zip(worst, ("m/s", "m"), strict=True), (pressure.min(), "Pa"), (pressure.max(), "Pa")]
    return [law, *proved, *(quantity(float(v), unit) for v, unit in run)]


def chain_law(
    chain: BlockChain, controller: str = BLOCK_LAWS[0], certificate: str | Path | None = None, **sliding: Any
) -> Any:
    """Guarantee of a law for several blocks: designed, or that of a certificate, which is checked anew.

    Parameters
    ----------
    chain : BlockChain
    controller : str
        ``centralised`` or ``decentralised``.
    certificate : str or Path, optional
    **sliding
        Lag and stress for a design of blocks in slow sliding.

    Raises
    ------
    ParameterError, CertificateError
        For a file that does not hold, or is about another plant.
    """
    if certificate is None:
        return guarantee(chain, controller, **sliding)
    claim = load_guarantee(certificate)
    if chain.ages:
        if not isinstance(claim, PlantGuarantee):
            raise CertificateError(
                f"a certificate must be about several blocks. Received {certificate}, which is not. Give one of "
                "guarantee."
            )
        found: Any = covered_stress(chain, claim)[-1]
    else:
        plant = UncertainPlant.from_blocks(chain)
        if not isinstance(claim, PlantGuarantee) or claim.part != linear_part(plant, {}):
            raise CertificateError(
                f"a certificate must be about the fault. Received {certificate}, about another plant than "
                f"{plant.name}. Give a file of guarantee {chain.name} --out FILE."
            )
        found = named(claim, plant)
    if claim.law.delay or claim.check() is not Verdict.PROVED:
        raise CertificateError(
            f"a certificate must hold, for a law without delay. Received {certificate}. Prove it anew with guarantee."
        )
    return found


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
        [s]; the operation time unless given.
    certificate : str or Path, optional
        File of a guarantee of this fault, whose law is run instead.

    Raises
    ------
    ParameterError, CertificateError
    """
    whole_periods(chain, rational(chain.fault.sampling_time), duration)  # is refused before the long search
    found = chain_law(chain, controller, certificate)
    run = simulate_blocks(chain, found.law, duration=duration) if found.proved else None
    return ChainRun(chain=chain, controller=controller, found=found, run=run)


# ----------------------------------------------------------------------
# Blocks with rate-and-state friction: cycles without control, and runs of a law that is proved.


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingChainRun:
    """A run of blocks with rate-and-state friction: without control, or under the law of a guarantee."""

    chain: BlockChain
    run: SlidersRun | None
    inertia: bool
    found: PlantGuarantee | NoGuarantee | None = None
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
        """As of `ChainRun`; slip rates themselves, and pressures beside the plan."""
        if self.run is None or self.found is None:
            return [self.controller, "none", *[""] * 5]
        rate = SlidingReference(task=self.chain.fault.reference).first_rate * exponential(self.log_rate)
        slip = max(self.found.claims.outputs[: len(self.chain.blocks)])  # type: ignore[union-attr]
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
        """Largest slip error [m], |ln(v/V)| and |ln(θ/θ*)| of blocks, and pressure beside the plan [Pa] of wells."""
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
        """Whether all errors of a run under a law are within what is proved of their blocks and wells."""
        assert isinstance(self.found, PlantGuarantee)
        N, claims, errors = len(self.chain.blocks), self.found.claims, self.errors
        told = [errors[name] for name in ("slip_error", "log_state", "pressure_beside_plan", "log_rate")]
        proved = [*claims.outputs[: 2 * N], *(v * MPA for v in claims.controls), *[self.log_rate] * N]
        return bool((np.concatenate(told) <= np.array(proved, dtype=float)).all())

    def lines(self) -> list[str]:
        """For people."""
        if self.run is None:
            return [_NO_RUN]
        end = lasting(float(self.run.times[-1]))
        if self.found is not None:
            covered = LowerBound(self.covered).quantity("Pa")
            said = [
                f"run over {end} under a sine of {quantity(self.stress, 'Pa')} of shear on every block; proved for up "
                f"to {covered}, a lag of {float(self.lag):g} s, with |ln(v/V)| <= {self.log_rate:.3g}",
                *(
                    f"block {i}: slip error {quantity(float(slip), 'm')}, |ln(v/V)| {rate:.3g}, |ln(state)| {state:.3g}"
                    for i, (slip, rate, state) in enumerate(zip(*list(self.errors.values())[:3], strict=True), 1)
                ),
                *(
                    f"well {i}: {quantity(float(v), 'Pa')} beside the plan"
                    for i, v in enumerate(self.errors["pressure_beside_plan"], 1)
                ),
            ]
            return [
                *said,
                f"{'within' if self.within else 'OUTSIDE'} what is proved of slips, slip rates, states and pressures",
            ]
        events = self.events
        loaded = f"{self.chain.name}, loaded from afar at {quantity(self.run.loading_rate, 'm/s')}"
        said = [f"{loaded}: {counted(len(events), 'event')} in {end}"]
        said += [
            f"event {i}: from {lasting(event.onset)}, slip "
            + (", ".join(quantity(v, "m") for v in event.slip) if event.slip else "not ended")
            + f", up to {', '.join(quantity(v, 'm/s') for v in event.peak_slip_rate)}"
            + ("" if event.magnitude is None else f", magnitude {event.magnitude:.2f}")
            for i, event in enumerate(events, 1)
        ]
        last = self.run.onsets[-2:]
        return [*said, f"recurrence interval {lasting(float(last[1] - last[0]))}"] if len(last) > 1 else said

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI."""
        run = self.run
        assert run is not None
        facts: dict[str, Any] = {
            "plant": "smooth" if self.inertia else "quasi-dynamic",
            "duration": float(run.times[-1]),
            "steps": len(run.times),
        }
        if self.found is not None:
            errors = {f"max_{name}": values.tolist() for name, values in self.errors.items()}
            told = {"lag": float(self.lag), "stress": self.stress, "covered_stress": float(self.covered)}
            told |= {"proved_log_rate": float(self.log_rate)}
            return facts | told | errors | {"within": self.within}
        last = run.onsets[-2:]
        return facts | {
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
    tell: Callable[[float], None] = lambda _: None,
) -> SlidingChainRun:
    """Run blocks with rate-and-state friction without control, or under a law that is proved.

    Parameters
    ----------
    chain : BlockChain
    controller, certificate
        As of `chain_law`.
    sliding : mapping, optional
        Lag and stress of a law that is designed. Without it and a certificate there is no control.
    stress : float, optional
        Amplitude of a sine of shear on every block, shifted by its share of a turn [Pa]; what is covered unless given.
    stress_period : float
        Its period [s].
    loading_rate, duration, inertia
        As of `natural_cycles`, or of `simulate_held_blocks` with a law.

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
        raise ParameterError("the far end rests in slow sliding. Received a loading rate. Omit it.")
    found = chain_law(chain, controller, certificate, **(sliding or {}))
    if not found.proved:
        return SlidingChainRun(chain=chain, run=None, inertia=inertia, found=found, controller=controller)
    lag, covered, rate, _ = covered_stress(chain, found)
    size = float(covered) if stress is None else stress
    held = simulate_held_blocks(
        chain,
        found.law,
        lag=float(lag),
        stress=size,
        period=stress_period,
        duration=duration,
        inertia=inertia,
        progress=tell,
    )
    told: dict[str, Any] = {"lag": lag, "covered": covered, "log_rate": rate, "stress": size}
    return SlidingChainRun(chain=chain, run=held, inertia=inertia, found=found, controller=controller, **told)
