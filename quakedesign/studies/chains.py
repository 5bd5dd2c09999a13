"""Faults of several blocks: what is proved of them, how they run, and which modes no well holds.

**Limit.** Let every block weaken at its steepest slope, with its least damping, and let ℓ be a left eigenvector of an
unstable pole p of this linear plant: z = ℓ·(x, x′) obeys z′ = pz + ℓ·(φ + βbS(P − P*)). With constant φ of size H whose
signs are those of ℓ, z grows from 0, as long as friction weakens so, unless Σ_j|ℓ·βb_j||P_j − P*_j| reaches HΣ|ℓ_i|: a
controller of any kind needs pressures that far from balance, with the largest β. A mode that no well reaches grows.
Pressures q that diffuse, q′ = Fq + G(P − P*) from q = 0, are those of S(p) = (pI − F)⁻¹G in place of S: unless the
integral of e^{−pt}ℓ·(φ + βbq) is 0, z grows, and that of e^{−pt}q is S(p) times that of e^{−pt}(P − P*).
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import BlockChain, SlidingReference
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.guarantees.exact.plant_guarantee import PlantGuarantee, named
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.guarantees.search.sliding_block_design import covered_stress
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import UncertainPlant, uncertain_plant
from quakedesign.simulation.block_run import BlockRun, simulate_blocks, whole_periods
from quakedesign.simulation.coupled_sliders import (
    MPA,
    BlockEvent,
    SlidersRun,
    natural_cycles,
    simulate_held_blocks,
)
from quakedesign.simulation.state_plant import TIDE
from quakedesign.synthesis import guarantee
from quakedesign.synthesis.guarantee import BLOCK_LAWS
from quakedesign.text import counted, lasting, quantity

_SAME = 1e-6  # poles that are one, relative to the largest
_UNREACHED = 1e-9  # of a mode's vectors
_NONE = UpperBound(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnstableMode:
    """An unstable mode of a fault of several blocks."""

    pole: float  # p [1/s]
    shape: tuple[float, ...]  # Slips of the blocks, the largest 1 [-]
    # Least size [Pa] of pressures less their balance that a controller of any kind needs; infinite where no well
    # reaches the mode
    pressure: float

    @property
    def reached(self) -> bool:
        """Whether a well reaches it."""
        return bool(np.isfinite(self.pressure))


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainLimits:
    """Unstable modes of a fault of several blocks under its wells, the fastest first; in floating point."""

    chain: BlockChain
    modes: tuple[UnstableMode, ...]

    @property
    def feasible(self) -> bool:
        """Whether the wells reach every unstable mode."""
        return all(mode.reached for mode in self.modes)

    def lines(self) -> list[str]:
        """For people, within 80 columns."""
        blocks, wells = len(self.chain.blocks), len(self.chain.wells)
        said = [
            f"{self.chain.name}: limits of every controller, {blocks} blocks, {counted(wells, 'well')}",
            f"(box {self.chain.fault.box.name}, every block at its steepest friction, for constant disturbances)",
            "",
            f"{'mode':>4}{'pole [1/s]':>12}{'pressure less equilibrium':>26}  slips of the blocks",
        ]
        for place, mode in enumerate(self.modes, 1):
            needed = f"at least {mode.pressure:.3g} Pa" if mode.reached else "no well reaches it"
            said.append(f"{place:4}{mode.pole:12.4g}{needed:>26}  {', '.join(f'{v:.2g}' for v in mode.shape)}")
        escaping = sum(not mode.reached for mode in self.modes)
        if escaping:
            said += [
                "",
                f"infeasible for every controller: {counted(escaping, 'unstable mode')} out of reach",
            ]
        elif not self.modes:
            said += ["", "no mode is unstable"]
        return said

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; pressure null where no well reaches a mode."""
        modes = [
            {
                "pole": m.pole,
                "shape": list(m.shape),
                "reached": m.reached,
                "pressure": m.pressure if m.reached else None,
            }
            for m in self.modes
        ]
        return {"fault": self.chain.name, "feasible": self.feasible, "modes": modes}


def _count(chain: BlockChain, slopes: Sequence[Fraction]) -> int:
    """Unstable modes of blocks that damping never pushes, exactly: pivots above 0 of what weakens less what holds."""
    pulls, found, before = {(i, j): K for i, j, K in chain.springs}, 0, Fraction(0)
    for i, slope in enumerate(slopes):
        pivot = slope - pulls.get((i, i - 1), 0) - pulls.get((i, i + 1), 0)
        if i:
            pivot -= pulls[i, i - 1] * pulls[i - 1, i] / before
        before = pivot or Fraction(-1, 10**60)
        found += before > 0
    return found


def chain_limits(chain: BlockChain) -> ChainLimits:
    """Unstable modes of blocks with springs, and the pressures that every controller needs for them."""
    tasks, N = [uncertain_plant(fault) for fault in chain.faults], len(chain.blocks)
    stiff = np.diag([float(task.slip_chord[1]) for task in tasks])
    for i, j, K in chain.springs:
        stiff[i, j] += float(K)
        stiff[i, i] -= float(K)
    damping = np.diag([-float(task.rate_chord[0]) for task in tasks])
    A = np.block([[np.zeros((N, N)), np.eye(N)], [stiff, damping]])
    authority = np.array([[float(task.authority * task.beta[1])] for task in tasks])
    within = authority * np.array(chain.shares, dtype=float)
    size = float(tasks[0].amplitude)
    poles, right = np.linalg.eig(A)
    if max(abs(poles[poles.real > 0].imag), default=0) > _SAME * max(abs(poles)):
        raise ParameterError(
            "limits of blocks need unstable poles that are real. Received complex ones. Simulate this fault."
        )
    left = np.linalg.inv(right)
    order = [i for i in np.argsort(-poles.real) if poles[i].real > _SAME * max(abs(poles))]
    if (np.diag(damping) <= 0).all() and len(order) != _count(chain, [task.slip_chord[1] for task in tasks]):
        raise ParameterError(
            "limits of blocks need modes that floating point tells apart. Received blocks of very different stiffness. "
            "Make lengths, stresses and critical slips of the blocks more alike."
        )
    groups: list[list[int]] = []
    for i in order:
        if groups and poles[groups[-1][0]].real - poles[i].real <= _SAME * max(abs(poles)):
            groups[-1].append(i)
        else:
            groups.append([i])
    modes = []
    for group in groups:  # of one pole: combinations that the wells reach, and those that none does
        rows = np.real(left[group])
        B = np.vstack([np.zeros_like(within), authority * _transmitted(chain, float(poles[group[0]].real))])
        turned = np.linalg.svd(rows @ B)[0].T
        shapes = np.real(right[:N, group]) @ np.linalg.inv(turned)
        for row, shape in zip(turned @ rows, shapes.T, strict=True):
            reach = np.abs(row @ B).sum()
            steady = np.abs(row[N:] @ within).sum()
            out = not reach or steady <= _UNREACHED * np.linalg.norm(row) * np.linalg.norm(within)
            modes.append(
                UnstableMode(
                    pole=float(poles[group[0]].real),
                    shape=tuple((shape / shape[np.argmax(np.abs(shape))]).tolist()),
                    pressure=np.inf if out else size * float(np.abs(row[N:]).sum() / reach),
                )
            )
    return ChainLimits(chain=chain, modes=tuple(modes))


def _transmitted(chain: BlockChain, pole: float) -> np.ndarray:
    """Transfer functions from pressures of wells (columns) to those of blocks (rows) at a pole [1/s]."""
    flow, pressures = np.array(chain.flow, dtype=float), np.array(chain.pressures, dtype=float)
    if not len(flow):
        return pressures
    K = len(flow)
    found: np.ndarray = pressures[:, K:] + pressures[:, :K] @ np.linalg.solve(
        pole * np.eye(K) - flow[:, :K], flow[:, K:]
    )
    return found


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

    def row(self) -> list[str]:
        """Largest values of all blocks for a table: law, proved slip rate and slip, those of the run, pressures."""
        if self.run is None:
            return [self.controller, "none", *[""] * 5]
        N = len(self.chain.blocks)
        outputs = self.found.claims.outputs
        slips, rates = UpperBound(max(outputs[:N])), UpperBound(max(outputs[N:]))
        worst = (self.run.slip_rate_error.max(), self.run.slip_error.max())
        ends = (self.run.pressure.min(), self.run.pressure.max())
        return [
            self.controller,
            rates.quantity("m/s"),
            slips.quantity("m"),
            *(quantity(float(v), unit) for v, unit in zip(worst, ("m/s", "m"), strict=True)),
            *(quantity(float(v), "Pa") for v in ends),
        ]


def chain_law(chain: BlockChain, controller: str = BLOCK_LAWS[0], certificate: str | Path | None = None) -> Any:
    """Guarantee of a law for several blocks: designed, or that of a certificate, which is checked anew.

    Raises
    ------
    CertificateError
        For a file that does not hold, or is about another plant.
    """
    if certificate is None:
        return guarantee(chain, controller)
    claim, plant = load_guarantee(certificate), UncertainPlant.from_blocks(chain)
    if not isinstance(claim, PlantGuarantee) or claim.part != linear_part(plant, {}):
        raise CertificateError(
            f"a certificate must be about the fault. Received {certificate}, about another plant than {plant.name}. "
            f"Give a file of guarantee {chain.name} --out FILE."
        )
    if claim.law.delay or claim.check() is not Verdict.PROVED:
        raise CertificateError(
            f"a certificate must hold, for a law without delay. Received {certificate}. Prove it anew with guarantee."
        )
    return named(claim, plant)


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
    run: SlidersRun
    inertia: bool
    found: PlantGuarantee | None = None
    # Lag [s] and largest stress [Pa] that the guarantee covers, its bound of |ln(v/V)|, and the stress of the run [Pa]
    lag: Fraction = Fraction(0)
    covered: Fraction = Fraction(0)
    log_rate: UpperBound = _NONE
    stress: float = 0.0

    @property
    def events(self) -> tuple[BlockEvent, ...]:
        """Events without control."""
        fault = self.chain.fault
        per_slip = [fault.shear_modulus * fault.area * float(v) / fault.length for v in self.chain.lengths]
        return self.run.events(np.array(per_slip))

    @property
    def errors(self) -> dict[str, "np.ndarray"]:
        """Largest slip error [m], |ln(v/V)| and |ln(θ/θ*)| of blocks, and pressure beside the plan [Pa] of wells."""
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
        assert self.found is not None
        N, claims, errors = len(self.chain.blocks), self.found.claims, self.errors
        told = [errors[name] for name in ("slip_error", "log_state", "pressure_beside_plan", "log_rate")]
        proved = [*claims.outputs[: 2 * N], *(v * MPA for v in claims.controls), *[self.log_rate] * N]
        return bool((np.concatenate(told) <= np.array(proved, dtype=float)).all())

    def lines(self) -> list[str]:
        """For people."""
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
    *,
    certificate: str | Path | None = None,
    stress: float | None = None,
    stress_period: float = TIDE,
    loading_rate: float | None = None,
    duration: float | None = None,
    inertia: bool = False,
    tell: Callable[[float], None] = lambda _: None,
) -> SlidingChainRun:
    """Run blocks with rate-and-state friction without control, or under the law of a certificate that is checked anew.

    Parameters
    ----------
    chain : BlockChain
    certificate : str or Path, optional
        File of a guarantee of this fault.
    stress : float, optional
        Amplitude of a sine of shear on every block, shifted by its share of a turn [Pa]; what is covered unless given.
    stress_period : float
        Its period [s].
    loading_rate, duration, inertia
        As of `natural_cycles`, or of `simulate_held_blocks` with a certificate.

    Raises
    ------
    ParameterError, CertificateError, SimulationError
    """
    if certificate is None:
        if stress is not None:
            raise ParameterError("stress on blocks needs a law. Received no certificate. Give --certificate.")
        run = natural_cycles(chain, duration, loading_rate=loading_rate, inertia=inertia)
        return SlidingChainRun(chain=chain, run=run, inertia=inertia)
    if loading_rate is not None:
        raise ParameterError("the far end rests in slow sliding. Received a loading rate. Omit it.")
    claim = load_guarantee(certificate)
    if not isinstance(claim, PlantGuarantee):
        raise CertificateError(
            f"a certificate must be about several blocks. Received {certificate}, which is not. Give one of guarantee."
        )
    lag, covered, rate = covered_stress(chain, claim)
    if claim.check() is not Verdict.PROVED:
        raise CertificateError(f"a certificate must hold. Received {certificate}. Prove it anew with guarantee.")
    size = float(covered) if stress is None else stress
    held = simulate_held_blocks(
        chain,
        claim.law,
        lag=float(lag),
        stress=size,
        period=stress_period,
        duration=duration,
        inertia=inertia,
        progress=tell,
    )
    return SlidingChainRun(
        chain=chain, run=held, inertia=inertia, found=claim, lag=lag, covered=covered, log_rate=rate, stress=size
    )
