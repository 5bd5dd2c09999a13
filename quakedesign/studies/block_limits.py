"""Performance limits of a fault of several blocks: unstable modes that no well reaches.

**Limit.** Let every block weaken at its steepest slope, with its least damping, and let ℓ be a left eigenvector of an
unstable pole p of this linear plant: z = ℓ·(x, x′), x the slips, obeys z′ = pz + ℓ·(φ + βbS(P − P*)), where ℓ· takes
the entries of ℓ that belong to x′. Here φ are the disturbing accelerations, βb the input gains of the blocks, S the
shares of the wells in the block pressures, P the well pressures and P* those of balance. Let φ be constant, of size H
and with the signs of ℓ. Then, as long as friction weakens at this slope, z grows from 0 unless Σ_j|ℓ·βb_j||P_j − P*_j|
reaches HΣ|ℓ_i|: every controller needs pressures this far from balance, with the largest β. A mode that no well reaches
grows. For diffusing pressures q, q′ = Fq + G(P − P*) from q = 0, S(p) = (pI − F)⁻¹G replaces S: z grows unless the
integral of e^{−pt}ℓ·(φ + βbq) is 0; the integral of e^{−pt}q is S(p) times that of e^{−pt}(P − P*).

Blocks in slow sliding are linearised like a single block (`limit_theorems`): S_iy_i = −ΣK_ijx_j − W_iz_i +
μ_iΣs_ijq_j + d_i, x_i′ = Vy_i and z_i′ = −ρ_i(y_i + z_i), where x_i is the slip error, y_i = ln(v_i/V), z_i the
logarithm of the friction state over its steady value, S_i the direct strength, W_i the weakening, K the stiffness, μ_i
the friction coefficient, s the shares, q_j the pressures, d_i the stress, ρ_i the rate of the state.
Theorem 2 there holds for ζ = ℓ·(x, z) of each
mode with a real pole, with Σ_i|ℓ·e_i| and Σ_j|ℓ·b_j| in place of the gains of stress and pressure, e_i and b_j being
the vectors by which the stress d_i and the pressure q_j enter (x, z)′, if all wells act
through diffusion paths of one diffusion time; theorem 1 holds for each y_i, with stresses that change sign on all
blocks.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction

import numpy as np
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.fault import BlockChain
from quakedesign.fault.block_chain import add_springs
from quakedesign.fault.model import require_positive
from quakedesign.files import Json
from quakedesign.guarantees.search.lqg import mean_rate, sliding_model
from quakedesign.plant import uncertain_plant
from quakedesign.simulation.coupled_sliders import CoupledSliders
from quakedesign.text import counted, quantity

_SAME = 1e-6  # largest relative difference of poles that count as equal
_UNREACHED = 1e-9  # relative gain of a mode below which no well reaches it
_MOST_SKEWED = 1e10  # largest condition number of the matrix of all modes
_APART = (
    "limits of blocks need modes that floating point tells apart. Received blocks of very different stiffness, or a "
    "double pole. Make lengths, stresses and critical slips of the blocks more alike."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class UnstableMode:
    """An unstable mode of a fault of several blocks."""

    pole: float  # Real part of the pole [1/s]
    frequency: float  # Imaginary part of the pole [rad/s]
    shape: tuple[float, ...]  # Slips of the blocks, the largest 1 [-]
    reached: bool  # Whether a well reaches it
    # Smallest pressure deviation from balance [Pa] that every controller needs, if known
    pressure: float | None
    # Blocks in slow sliding: largest sum of T_s and delay [s], and farthest well from the fault [m], for any controller
    longest_step: float | None = None
    farthest_well: float | None = None

    def row(self) -> str:
        """Table row as text."""
        needed = "oscillates" if self.frequency else "-"
        needed = needed if self.pressure is None else f"at least {quantity(self.pressure, 'Pa')}"
        ends = ((self.longest_step, "s"), (self.farthest_well, "m"))
        most = "".join(f"{quantity(v, unit):>10}" for v, unit in ends if v is not None)
        needed = needed if self.reached else "no well reaches it"
        return f"{self.pole:12.4g}{needed:>21}{most}  {', '.join(f'{v + 0.0:.2g}' for v in np.round(self.shape, 9))}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainLimits:
    """Unstable modes of a fault of several blocks under its wells, the fastest first; in floating point."""

    chain: BlockChain
    modes: tuple[UnstableMode, ...]
    stress: float | None = None  # Stress on blocks in slow sliding [Pa]
    largest_pressure: float = 0.0  # Largest pressure of their wells relative to the plan [Pa]
    diffusivity: float = 1.0  # Diffusivity between these wells and the fault [m²/s]
    slip_rate_error: tuple[float, ...] = ()  # Lower bounds of the slip-rate errors of blocks in slow sliding [m/s]

    @property
    def feasible(self) -> bool:
        """Whether the wells reach every unstable mode."""
        return all(mode.reached for mode in self.modes)

    def lines(self) -> list[str]:
        """The result as lines of at most 80 characters."""
        chain = self.chain
        assumed = [f"(box {chain.fault.box.name}, every block at its steepest weakening, for constant disturbances)"]
        if chain.has_state:
            V = quantity(float(mean_rate(chain.fault)), "m/s")
            assumed = [f"(linearised about steady sliding of every block at {V} and the pressure 0,"]
            assumed += [f"without inertia, all constants as given, T_s = {chain.fault.sampling_time:g} s)"]
        if self.stress is not None:
            assumed[-1] = assumed[-1].replace(")", ";")
            assumed += [f"for stress of {quantity(self.stress, 'Pa')} on every block, pressures within"]
            assumed += [f"{quantity(self.largest_pressure, 'Pa')} of the plan, diffusivity {self.diffusivity:g} m^2/s)"]
        parts = [
            f"{chain.name}: limits of every controller, {len(chain.blocks)} blocks, "
            f"{counted(len(chain.wells), 'well')}",
            *assumed,
            "",
            f"{'mode':>4}{'pole [1/s]':>12}{'pressure deviation':>21}"
            + (f"{'T_s up to':>10}{'well in':>10}" if self.stress is not None else "")
            + "  slips of the blocks",
            *(f"{place:4}{mode.row()}" for place, mode in enumerate(self.modes, 1)),
        ]
        if chain.has_state and self.stress is None:
            parts += ["", "--stress gives the pressure, T_s and distance of wells that every controller needs"]
        if self.slip_rate_error:
            rates = ", ".join(quantity(v, "m/s") for v in self.slip_rate_error)
            parts += ["", f"infeasible: slip-rate errors below {rates}"]
        escaping = sum(not mode.reached for mode in self.modes)
        if escaping:
            parts += ["", f"infeasible for every controller: {counted(escaping, 'unstable mode')}, reached by no well"]
        most, needs = max(b.effective_normal_stress for b in chain.blocks), [m.pressure or 0 for m in self.modes]
        if chain.diffusivity and max(needs, default=0) > most:
            parts += ["", f"a mode needs more than the effective normal stress, {quantity(most, 'Pa')}: move the wells"]
            parts += [f"closer to the blocks; the pressure diffuses along the fault with {chain.diffusivity:g} m^2/s"]
        return parts if self.modes else [*parts, "", "no mode is unstable"]

    def to_dict(self) -> Json:
        """Plain values, SI.

        Limits of a mode are null if no well reaches it, if it oscillates, or, in slow sliding, without a stress.
        """
        modes, values = [asdict(mode) for mode in self.modes], {"fault": self.chain.name, "feasible": self.feasible}
        if not self.chain.has_state:
            shown = ("pole", "shape", "reached", "pressure")
            return values | {"modes": [{name: mode[name] for name in shown} for mode in modes]}
        beside = {name: getattr(self, name) for name in ("stress", "largest_pressure", "diffusivity")}
        return values | {"modes": modes, **beside, "slip_rate_error": list(self.slip_rate_error) or None}


def _count(chain: BlockChain, slopes: Sequence[Fraction]) -> int:
    """Exact number of unstable modes for non-negative damping: positive pivots of the weakening minus spring matrix."""
    pulls, count, before = {(i, j): K for i, j, K in chain.springs}, 0, Fraction(0)
    for i, slope in enumerate(slopes):
        pivot = slope - pulls.get((i, i - 1), 0) - pulls.get((i, i + 1), 0)
        if i:
            pivot -= pulls[i, i - 1] * pulls[i - 1, i] / before
        before = pivot or Fraction(-1, 10**60)
        count += before > 0
    return count


def chain_limits(
    chain: BlockChain, *, stress: float | None = None, pressure: float | None = None, diffusivity: float | None = None
) -> ChainLimits:
    """Unstable modes of blocks with springs, and the pressures that every controller needs for them.

    Parameters
    ----------
    chain : BlockChain
    stress, pressure : float, optional
        For blocks in slow sliding: bound of the shear stress on every block (without it, only modes are computed), and
        largest pressure of the wells relative to the plan [Pa]; by default the smallest effective normal stress.
    diffusivity : float, optional
        Diffusivity of the rock between their wells and the fault [m²/s]; 1 by default.

    Raises
    ------
    ParameterError
        For modes that floating point cannot distinguish, and for numbers that are not positive.
    """
    if not chain.has_state:
        if {stress, pressure, diffusivity} != {None}:
            raise ParameterError(
                "stress, pressure and diffusivity of limits of several blocks need friction with a state. Received "
                f"{chain.blocks[0].friction.name}. Omit these."
            )
        return ChainLimits(chain=chain, modes=tuple(_modes(*_steepest(chain))))
    largest = min(block.effective_normal_stress for block in chain.blocks) if pressure is None else pressure
    diffusivity = 1.0 if diffusivity is None else diffusivity
    require_positive(pressure=largest, diffusivity=diffusivity, stress=1.0 if stress is None else stress)
    A, entries, B, gains, at_once = _sliding(chain)
    modes, step = [], chain.fault.sampling_time
    for mode in _modes(A, entries, B, stress):
        if mode.pressure is not None:
            ratio, p = largest / mode.pressure, mode.pole
            late = float(np.log(max(ratio, 1.0))) / p
            diffusion = float(np.arccosh(max(ratio * np.exp(-p * step), 1.0))) ** 2 / p
            far = float(np.sqrt(diffusion * diffusivity))
            needed = mode.pressure * float(np.exp(p * step))
            mode = replace(mode, pressure=needed, longest_step=late, farthest_well=far)
        modes.append(mode)
    rates: tuple[float, ...] = ()
    if stress is not None:
        N, V = len(chain.blocks), float(mean_rate(chain.fault))
        moved = expm(np.block([[A, entries], [np.zeros((N, 3 * N))]]) * step)[: 2 * N, 2 * N :]
        later = np.abs(gains @ moved + at_once).sum(axis=1)
        rates = tuple((V * stress * np.maximum(np.diag(at_once), later)).tolist())
    return ChainLimits(
        chain=chain,
        modes=tuple(modes),
        stress=stress,
        largest_pressure=largest,
        diffusivity=diffusivity,
        slip_rate_error=rates,
    )


def _steepest(chain: BlockChain) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, Callable[[float], np.ndarray]]:
    """A, disturbance entries, B, disturbance size [m/s²], and B at a pole, at the steepest weakening of every block."""
    tasks, N = [uncertain_plant(fault) for fault in chain.faults], len(chain.blocks)
    stiff = np.diag([float(task.slip_chord[1]) for task in tasks])
    add_springs(stiff, chain.springs, 1.0)
    damping = np.diag([-float(task.rate_chord[0]) for task in tasks])
    A = np.block([[np.zeros((N, N)), np.eye(N)], [stiff, damping]])
    poles = np.linalg.eigvals(A)
    count = np.count_nonzero(poles.real > _SAME * max(abs(poles)))
    if (np.diag(damping) <= 0).all() and count != _count(chain, [task.slip_chord[1] for task in tasks]):
        raise ParameterError(_APART)
    authority = np.array([[float(task.authority * task.beta[1])] for task in tasks])
    entries = np.vstack([np.zeros((N, N)), np.eye(N)])
    steady = entries @ (authority * np.array(chain.shares, dtype=float))
    through = lambda pole: np.asarray(entries @ (authority * _transmitted(chain, pole)))  # noqa: E731
    return A, entries, steady, float(tasks[0].amplitude), through


def _sliding(chain: BlockChain) -> tuple[np.ndarray, ...]:
    """A, stress entries and B about slow sliding; states are slip errors over D of block 1 and log states.

    The last two matrices give ln(v/V) as a function of these states and of the stresses.
    """
    for place, block in enumerate(chain.blocks, start=1):
        if sensitivity := getattr(block.friction, "stress_sensitivity", 0.0):
            raise ParameterError(
                f"limits of slow sliding need stress_sensitivity 0. Received {sensitivity:g} in block {place}. "
                "Simulate this fault."
            )
    models, N = [sliding_model(fault) for fault in chain.faults], len(chain.blocks)
    strength, weakening, aged, friction = (
        np.array([float(getattr(model, name)) for model in models])
        for name in ("strength", "weakening", "state_rate", "coefficient")
    )
    length, at_once = float(models[0].rate / models[0].state_rate), np.diag(1 / strength)
    gains = at_once @ np.hstack([-CoupledSliders.of(chain).stiffness * length, np.diag(-weakening)])
    into = np.vstack([aged[0] * np.eye(N), np.diag(-aged)])
    A, entries = into @ gains, into @ at_once
    A[N:, N:] -= np.diag(aged)
    return A, entries, entries @ (friction[:, None] * np.array(chain.shares, dtype=float)), gains, at_once


def _transmitted(chain: BlockChain, pole: float) -> np.ndarray:
    """Transfer functions from well pressures (columns) to block pressures (rows) at a pole [1/s]."""
    flow, pressures = np.array(chain.flow, dtype=float), np.array(chain.pressures, dtype=float)
    if not len(flow):
        return pressures
    K = len(flow)
    slow = np.linalg.solve(pole * np.eye(K) - flow[:, :K], flow[:, K:])
    return np.asarray(pressures[:, K:] + pressures[:, :K] @ slow)


def _modes(
    A: np.ndarray,
    entries: np.ndarray,
    B: np.ndarray,
    size: float | None,
    through: Callable[[float], np.ndarray] | None = None,
) -> Iterator[UnstableMode]:
    """Unstable modes under disturbances of a size, if known; `through` gives B at a pole, by default `B` itself.

    Without `through` poles may be complex; for these modes only the reach of the wells is computed.
    """
    (poles, right), N = np.linalg.eig(A), len(A) // 2
    largest = max(abs(poles))
    if through is not None and max(abs(poles[poles.real > 0].imag), default=0) > _SAME * largest:
        raise ParameterError(
            "limits of blocks need unstable poles that are real. Received complex ones. Simulate this fault."
        )
    if through is None and np.linalg.cond(right) > _MOST_SKEWED:
        raise ParameterError(_APART)
    left = np.linalg.inv(right)
    groups: list[list[int]] = []
    for i in np.argsort(-poles.real, kind="stable"):
        if poles[i].real <= _SAME * largest or poles[i].imag < -_SAME * largest:
            continue
        if groups and abs(poles[groups[-1][0]] - poles[i]) <= _SAME * largest:
            groups[-1].append(i)
        else:
            groups.append([i])
    for group in groups:  # modes of one pole: combinations that the wells reach, and those that no well reaches
        pole = poles[group[0]]
        wave = float(pole.imag) if abs(pole.imag) > _SAME * largest else 0.0
        rows, columns = (v if wave else np.real(v) for v in (left[group], right[:N, group]))
        felt = B if through is None else through(float(pole.real))
        turned = np.linalg.svd(rows @ felt)[0].conj().T
        shapes = columns @ np.linalg.inv(turned)
        for row, shape in zip(turned @ rows, shapes.T, strict=True):
            effect, steady = np.abs(row @ felt).sum(), np.abs(row @ B).sum()
            reached = bool(effect and steady > _UNREACHED * np.linalg.norm(row) * np.linalg.norm(B))
            sized = reached and not wave and size is not None
            yield UnstableMode(
                pole=float(pole.real),
                frequency=wave,
                shape=tuple(np.real(shape / shape[np.argmax(np.abs(shape))]).tolist()),
                reached=reached,
                pressure=size * float(np.abs(row @ entries).sum() / effect) if sized and size is not None else None,
            )
