"""Several blocks with rate-and-state friction in slow sliding, as an uncertain plant.

Each block obeys the equations of `sliding_small_gain`, whose symbols are used here, and springs pull it towards its
neighbours: with q the well pressures after a lag, minus the plan Kr/μ*, S the shares of the wells, and w = −Kx + Σk(x_j
− x) + μ*Sq,

    y·B = ŝ − Nbz + w,  B = Na + HV·f/y,    x′ = V(f − ω),    z′ = −ρ(f + g),    q′ = (u − q)/lag.

For |y| ≤ Y and |z| ≤ Z let f = γy and g = ηz, γ and η between the chords. So f = −γα·z + γκ·(w + ŝ) with α = Nb/B and κ
= 1/B. While |u| ≤ Q, also |Sq| ≤ Q, and N lies between σ′ − P − Q and σ′ + Q, P the largest planned pressure. This
gives ranges of α and κ. The plant below has the sectors γα and η of z and γκ of w, valid for |z| ≤ Z and |w| ≤ W, and
disturbances of size sup(γκ)·sup|ŝ|. These claims give Y = sup α·Z + sup κ·(W + sup|ŝ|).

|ŝ| is at most the sum of the shear stress, the rounding error of μ* and the term of inertia, sup|R|/λ₀, with R the κ of
`sliding_small_gain`. In R, |w′| ≤ (K + 2Σk)V(e^Y − 1 + swing) + μ*q̇ replaces K|x′| + μ*|q′|, q̇ = 2Q/lag, Y the
largest of all blocks. y, z, w and q are continuous and initially 0, and u is determined by samples before it acts. So
if bounds below the claims Z, W and Q follow from these, no claim is ever reached. ∎
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound, rational, shortly
from quakedesign.fault import BlockChain
from quakedesign.fault.block_chain import add_springs
from quakedesign.guarantees.exact.sliding_small_gain import chords, exponential
from quakedesign.plant import Sector, SlidingPlant, UncertainPlant, slow_sliding_plant
from quakedesign.plant.block_plant import measured_by, require_independent
from quakedesign.plant.plant_values import MOST, Row, unit
from quakedesign.plant.sliding_plant import Range
from quakedesign.text import counted

MOST_SLIDING = MOST // 3
MPA = 10**6  # Pa, unit of pressures and pulls of the plant
_LARGEST = 3  # largest Y, as for one block
_TURNS = 30
_WIDER = Fraction(1001, 1000)
_OUTWARD = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockClaims:
    """Claimed bounds of absolute values, of all blocks, for all t ≥ 0.

    Attributes
    ----------
    log_state : Fraction
        Z: logarithm of θ over D/V [-].
    pull : Fraction
        W: shear stress by springs and wells [Pa].
    push : Fraction
        Q: commanded pressure at a well minus the plan [Pa]; the pressures in the blocks are weighted means of its past
        values.
    """

    log_state: Fraction
    pull: Fraction
    push: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ranges:
    """Ranges of γα [-], γκ [1/Pa] and η [-], sup|ŝ| [Pa] and Y [-]."""

    by_state: Range
    by_pull: Range
    ageing: Range
    stress: Fraction
    log_rate: Fraction


@checked_dataclass(frozen=True, kw_only=True)
class SlidingBlocks:
    """Blocks in slow sliding with a lag at all wells and a bound of the shear stress.

    Attributes
    ----------
    chain : BlockChain
        With one steady friction coefficient; identical blocks if there are fewer wells than blocks.
    lag : Fraction
        Time constant of the lag of every well [s], positive.
    stress : Fraction
        Bound of the shear stress on every block [Pa], positive.
    """

    chain: BlockChain
    lag: Fraction
    stress: Fraction

    def __post_init__(self) -> None:
        N, m = len(self.chain.blocks), len(self.chain.wells)
        if N > MOST_SLIDING:
            raise ParameterError(f"blocks in slow sliding must be 2 to {MOST_SLIDING}. Received {N}. Join blocks.")
        if self.lag <= 0 or self.stress <= 0:
            raise ParameterError(
                "blocks in slow sliding need a positive lag and a positive bound of the shear stress. Received "
                f"{shortly(self.lag)} s and {shortly(self.stress)} Pa. Give both."
            )
        box = self.chain.fault.box
        if any((box.stiffness, box.damping, box.authority)):
            raise UnsupportedError(
                f"blocks in slow sliding need constants that are known, box paper. Received the box {box.name}. "
                "Use --box paper, or fault.with_box('paper')."
            )
        for place, task in enumerate(self.tasks, 1):
            if task.state_law != "ageing" or task.regularised:
                raise UnsupportedError(
                    "blocks in slow sliding need rate-and-state-aging friction. Received "
                    f"{self.chain.blocks[place - 1].friction.name} in block {place}: no guarantee of several blocks "
                    "with this friction is known. Use the command limits, or a fault of one block."
                )
        if len({task.ranges["coefficient"] for task in self.tasks}) > 1:
            raise UnsupportedError(
                "blocks in slow sliding need one steady friction coefficient at the rate of the task, so that all need "
                "the same pressure. Received different coefficients. Change reference_coefficient of the blocks."
            )
        require_independent(self.chain.shares)
        if m < N and not self.chain.alike:
            raise UnsupportedError(
                "blocks in slow sliding must be identical if there are fewer wells than blocks. Received "
                f"{counted(m, 'well')} and {N} blocks that differ. Add wells."
            )

    @cached_property
    def tasks(self) -> tuple[SlidingPlant, ...]:
        """Slow sliding of each block by itself."""
        return tuple(slow_sliding_plant(fault, self.stress) for fault in self.chain.faults)

    @cached_property
    def springs(self) -> tuple[Row, ...]:
        """Stiffness matrix of the stresses on blocks [Pa/m], including the far end."""
        N, inertia = len(self.tasks), self.tasks[0].inertia
        rows = [[-task.stiffness * (i == j) for j in range(N)] for i, task in enumerate(self.tasks)]
        add_springs(rows, self.chain.springs, inertia)
        return tuple(map(tuple, rows))

    @property
    def size(self) -> int:
        """States of the plant."""
        return 2 * len(self.tasks) + len(self.chain.wells)

    def log_rate(self, claims: BlockClaims) -> UpperBound | None:
        """Largest Y of all blocks [-] under the claims; None if a block may open or Y exceeds 3."""
        ranges = self._ranges(claims)
        return None if ranges is None else UpperBound(max(one.log_rate for one in ranges))

    def _ranges(self, claims: BlockClaims) -> list[_Ranges] | None:
        """Ranges of all blocks under the claims."""
        fastest = claims.log_state
        for _ in range(_TURNS):
            ranges = [self._of_block(i, claims, fastest) for i in range(len(self.tasks))]
            bounded = [one for one in ranges if one is not None]
            if len(bounded) < len(ranges):
                return None
            largest = max(one.log_rate for one in bounded)
            if largest <= fastest:
                return bounded
            fastest = min(_outward(largest, largest * _WIDER)[1], Fraction(_LARGEST))
        return None

    def _of_block(self, i: int, claims: BlockClaims, fastest: Fraction) -> _Ranges | None:
        """Ranges of one block, given a bound of |y| of its neighbours."""
        task, Z, (mu_low, mu) = self.tasks[i], claims.log_state, self.tasks[i].ranges["coefficient"]
        a, b = task.ranges["direct_effect"][1], task.ranges["evolution_effect"][1]
        low, high = task.normal_stress(claims.push)
        if low <= 0 or Z > _LARGEST:
            return None
        moved = 2 * claims.push / self.lag
        ageing = task.rate / task.ranges["critical_slip"][0]
        off = (mu - mu_low) / 2
        rounding = off * (claims.push + task.stiffness * task.distance / mu_low)
        damping, pulls, aged = task.radiation * task.rate, sum(map(abs, self.springs[i])), exponential(Z)
        Y = Z
        for _ in range(_TURNS):
            if Y > _LARGEST:
                return None
            grown, (least, most) = exponential(Y), chords(Y)
            of_state = ageing * (grown - 1 / aged)  # the larger end, as Y >= Z
            change = (task.pressure_per_slip * task.fastest + moved) * (a * Y + b * Z) + high * b * of_state
            change += pulls * task.rate * (exponential(fastest) - 1 + task.swing) + mu * moved
            stress = task.stress + rounding + change * task.inertia * task.rate * grown / (low * a)
            alpha = b / (a + damping * most / low), b / (a + damping * least / high)
            kappa = 1 / (high * a + damping * most), 1 / (low * a + damping * least)
            needed = alpha[1] * Z + kappa[1] * (claims.pull + stress)
            if needed <= Y:
                by_state = _outward(least * alpha[0], most * alpha[1])
                by_pull = _outward(least * kappa[0], most * kappa[1])
                ageings = _outward(*chords(Z))
                return _Ranges(by_state=by_state, by_pull=by_pull, ageing=ageings, stress=stress, log_rate=Y)
            Y = _outward(needed, needed * _WIDER)[1]
        return None

    def plant(self, claims: BlockClaims) -> UncertainPlant | None:
        """Uncertain plant under the claims, or None where `log_rate` is None.

        States: slip errors over D [-], logarithms of states [-], pressures of wells [MPa]; controls [MPa].
        """
        N, m, V, size, zero = len(self.tasks), len(self.chain.wells), self.tasks[0].rate, self.size, Fraction(0)
        sectors, disturbances, pulls, ranges = {}, {}, [], self._ranges(claims)
        if ranges is None:
            return None
        slip = [task.ranges["critical_slip"][0] for task in self.tasks]
        for i, task in enumerate(self.tasks):
            block, place = ranges[i], i + 1
            mu, D = sum(task.ranges["coefficient"]) / 2, task.ranges["critical_slip"][0]
            ageing = V / D
            state = unit(size, N + i)
            slips = tuple(ageing * (a - b) for a, b in zip(unit(size, i), state, strict=True))
            ages = tuple(-ageing * v for v in state)
            scaled = (k * one.ranges["critical_slip"][0] for k, one in zip(self.springs[i], self.tasks, strict=True))
            pull = (*(v / MPA for v in scaled), *[zero] * N, *(mu * v for v in self.chain.shares[i]))
            pulls.append(pull)
            sectors[f"rate of block {place} by its state"] = Sector(
                entry=tuple(-v for v in slips), row=state, slopes=block.by_state, within=claims.log_state
            )
            sectors[f"rate of block {place} by its pull"] = Sector(
                entry=slips, row=pull, slopes=tuple(MPA * v for v in block.by_pull), within=claims.pull / MPA
            )
            sectors[f"ageing of block {place}"] = Sector(
                entry=ages, row=state, slopes=block.ageing, within=claims.log_state
            )
            disturbances[f"stress on block {place}"] = (slips, _outward(*[block.by_pull[1] * block.stress] * 2)[1])
            if task.swing:
                disturbances[f"reference of block {place}"] = (unit(size, i), ageing * task.swing)
        weights = measured_by(self.chain.shares)
        more = UpperBound(max(block.stress for block in ranges) - self.stress)
        name = f"{self.chain.name}, {N} blocks, {counted(m, 'well')}"
        return UncertainPlant(
            A=[(zero,) * size] * (2 * N) + [tuple(-v / self.lag for v in unit(size, 2 * N + k)) for k in range(m)],
            B=[(zero,) * m] * (2 * N) + [tuple(v / self.lag for v in unit(m, k)) for k in range(m)],
            C=[(*(c * d for c, d in zip(row, slip, strict=True)), *[zero] * (N + m)) for row in weights],
            sectors=sectors,
            disturbances=disturbances,
            outputs={
                **{f"slip error {i + 1}": tuple(slip[i] * v for v in unit(size, i)) for i in range(N)},
                **{f"log state {i + 1}": unit(size, N + i) for i in range(N)},
                **{f"pull {i + 1}": pull for i, pull in enumerate(pulls)},
            },
            controls=tuple(f"pressure {k + 1}" for k in range(m)),
            units={f"slip error {i + 1}": "m" for i in range(N)}
            | {f"pull {i + 1}": "MPa" for i in range(N)}
            | {f"pressure {k + 1}": "MPa" for k in range(m)},
            name=name,
            remarks={
                "plant": f"of {name}, in slow sliding with all constants as given, from steady sliding, with a lag of "
                f"{shortly(self.lag)} s at the wells, which does not act on the planned pressure",
                "disturbances": f"changes of slip rate, divided by V, due to "
                f"{LowerBound(self.stress).quantity('Pa', 4)} of shear stress and up to {more.quantity('Pa')} of "
                "inertia and rounding",
            },
        )


def _outward(low: Fraction, high: Fraction) -> Range:
    """Range of positive numbers, rounded outward to few digits."""
    return tuple(rational(f"{float(v) * (1 + s * _OUTWARD):.10g}") for v, s in ((low, -1), (high, 1)))  # type: ignore[return-value]
