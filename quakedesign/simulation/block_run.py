"""Runs of a fault of several blocks under a sampled law, on the stick–slip plant."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from scipy.linalg import expm

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import rational
from quakedesign.fault import BlockChain, SlidingReference
from quakedesign.fault.block_chain import add_springs
from quakedesign.files import Json
from quakedesign.plant.block_plant import measured_by
from quakedesign.symbolic.casadi_printer import to_casadi

MPA = 1e6  # Pa, unit of the pressures of a law for blocks in slow sliding
SUBSTEPS = 8
"""Default number of substeps per period; the error is proportional to the length of a substep."""
_POINTS = 1000  # recorded intervals of a run, approximately
_MOST_PERIODS = 5 * 10**7


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockRun:
    """A run of several blocks. Arrays have shape (instants, blocks); `pressure` has shape (instants, wells).

    Attributes
    ----------
    times : ndarray
        Ends of the recorded intervals [s].
    slip, slip_rate, pressure : ndarray
        Slip [m] at `times`, largest slip rate in each interval [m/s], and pressure of the wells at `times` [Pa].
    reference : ndarray
        Reference r at `times` [m].
    slip_error, slip_rate_error : ndarray
        Largest |slip − r| [m] and |slip rate − r'| [m/s] of every block over the run.
    rest : ndarray
        Fraction of the time that each block is at rest [-].
    reversed, opened : bool
        Whether the load on a block, at rest or not, exceeded friction in the backward direction; whether an effective
        normal stress fell to 0.
    """

    times: np.ndarray
    slip: np.ndarray
    slip_rate: np.ndarray
    pressure: np.ndarray
    reference: np.ndarray
    slip_error: np.ndarray
    slip_rate_error: np.ndarray
    rest: np.ndarray
    reversed: bool
    opened: bool

    def to_dict(self) -> Json:
        """Summary figures of the run, in SI units."""
        return {
            "max_slip_error": self.slip_error.tolist(),
            "max_slip_rate_error": self.slip_rate_error.tolist(),
            "peak_slip_rate": self.slip_rate.max(axis=0).tolist(),
            "time_at_rest_fraction": self.rest.tolist(),
            "least_pressure": self.pressure.min(axis=0).tolist(),
            "largest_pressure": self.pressure.max(axis=0).tolist(),
            "load_reversed": self.reversed,
            "opened": self.opened,
            "duration": float(self.times[-1]),
        }


def reference(chain: BlockChain, time: ca.SX | float) -> tuple[ca.SX, ca.SX]:
    """r [m] and r' [m/s] at a time [s], as CasADi expressions."""
    task = chain.fault.reference
    stage = ca.fmin(time / task.operation_time, 1)
    mean = task.target_slip / task.operation_time
    return task.target_slip * task.shape(stage), mean * 30 * stage**2 * (1 - stage) ** 2


def decided(chain: BlockChain, law: Any, count: ca.SX, x: ca.SX, v: ca.SX, z: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Pressures of the wells [Pa] commanded by a law, and the next states of the law, as CasADi expressions.

    In slow sliding the pressures are the feedback pressures alone; the planned pressure is not included.

    Parameters
    ----------
    chain : BlockChain
    law : MatrixLaw
        Its inputs are the errors of slip [m] and slip rate [m/s] of all blocks, or of their averages at each well; its
        outputs are pressures [Pa]. In slow sliding its inputs are slip errors alone [m], its outputs pressures [MPa].
    count : SX
        Number of earlier samples [-].
    x, v : SX
        Slip [m] and slip rate [m/s] of every block.
    z : SX
        States of the law.
    """
    weights, time = ca.DM(np.array(measured_by(chain.shares), dtype=float)), count * float(law.step)
    if chain.has_state:
        r, unit = SlidingReference(task=chain.fault.reference).slip(time), MPA
        errors = weights @ x - r
    else:
        (r, r_rate), unit = reference(chain, time), 1
        errors = ca.vertcat(weights @ x - r, weights @ v - r_rate)
    F, G, H, D = (np.array(part, dtype=float) for part in (law.update, law.measured, law.output, law.feedback))
    p = (ca.mtimes(H, z) if len(F) else 0) + ca.mtimes(D, errors)
    return unit * p, ca.mtimes(F, z) + ca.mtimes(G, errors) if len(F) else z


@checked_dataclass(frozen=True, kw_only=True)
class _Period:
    """One sampling period of a chain under a law, as a CasADi function of the state vector."""

    chain: BlockChain
    law: Any
    substeps: int

    def function(self) -> ca.Function:
        """CasADi Function from the state vector (see `sizes`) to that one period later."""
        slip, speed = sp.Symbol("slip", real=True), sp.Symbol("speed", real=True)
        chain, fault, law = self.chain, self.chain.fault, self.law
        N = len(chain.blocks)
        parts = [ca.SX.sym(name, size) for name, size in self.sizes]
        x, v, z, q, _, count, worst, rate, peak, rest, margins = parts
        step, h = float(law.step), float(law.step) / self.substeps
        pressures, flow = np.array(chain.pressures, dtype=float), np.array(chain.flow, dtype=float)
        slow, columns = len(flow), pressures.shape[1]
        transition = expm(np.vstack([flow, np.zeros((columns - slow, columns))]) * h) if slow else np.eye(columns)
        springs = np.zeros((N, N))
        add_springs(springs, chain.springs, 1.0)
        stress = np.array([b.effective_normal_stress for b in chain.blocks])
        external = fault.disturbance
        phases = 2 * np.pi * np.arange(N) / N

        def friction(slips: ca.SX, rates: ca.SX) -> ca.SX:
            laws = [block.friction.extended(slip, speed) for block in chain.blocks]
            values = [to_casadi([mu], {slip: slips[i], speed: rates[i]})[0] for i, mu in enumerate(laws)]
            return ca.vertcat(*values)

        began = count * step
        p, z = decided(chain, law, count, x, v, z)
        static = friction(ca.SX.zeros(N), ca.SX.zeros(N))
        for k in range(self.substeps):
            time = began + k * h
            disturbance = external.constant + external.amplitude * ca.sin(external.frequency * time + phases)
            after = ca.mtimes(transition[:slow], ca.vertcat(q, p))  # zero-order hold of p
            acting, q = ca.mtimes(pressures, ca.vertcat((q + after) / 2, p)), after
            strength = fault.authority * friction(x, v) * (stress - acting)
            drive = fault.authority * static * stress - fault.specific_stiffness * x + ca.mtimes(springs, x)
            drive += disturbance + external.slip_growth * x + (external.rate_growth - fault.specific_damping) * v
            v = ca.fmax(v + h * (drive - strength), 0)
            x = x + h * v
            r, r_rate = reference(chain, time + h)
            worst, rate = ca.fmax(worst, ca.fabs(x - r)), ca.fmax(rate, ca.fabs(v - r_rate))
            peak, rest = ca.fmax(peak, v), rest + (v <= 0) / self.substeps
            margins = ca.fmin(margins, ca.vertcat(ca.mmin(drive + strength), ca.mmin(stress - acting)))
        last = [x, v, z, q, p, count + 1, worst, rate, peak, rest, margins]
        return ca.Function("period", [ca.vertcat(*parts)], [ca.vertcat(*last)])

    @property
    def sizes(self) -> tuple[tuple[str, int], ...]:
        """Names and sizes of the parts of the state vector."""
        N, m, q = len(self.chain.blocks), len(self.chain.wells), len(self.law.update)
        of_blocks = tuple((name, N) for name in ("worst", "rate", "peak", "rest"))
        return (
            ("x", N),
            ("v", N),
            ("z", q),
            ("q", len(self.chain.flow)),
            ("p", m),
            ("count", 1),
            *of_blocks,
            ("margins", 2),
        )


def whole_periods(chain: BlockChain, step: Fraction, duration: float | None) -> int:
    """Number of whole periods in a duration [s], 1 to 5e7; the duration is the operation time unless given."""
    whole = chain.fault.reference.operation_time if duration is None else duration
    if not step <= whole <= _MOST_PERIODS * step:
        raise ParameterError(
            f"duration must be between 1 and {_MOST_PERIODS:.0e} steps, that is {float(step):g} s to "
            f"{float(_MOST_PERIODS * step):g} s. Received {whole:g} s. Change the duration, or the sampling time."
        )
    return int(rational(whole) / step)


def simulate_blocks(
    chain: BlockChain, law: Any, *, duration: float | None = None, substeps: int = SUBSTEPS
) -> BlockRun:
    """Simulate blocks, initially at rest, under a sampled law.

    Parameters
    ----------
    chain : BlockChain
        The disturbance of block i = 0 … N − 1 has the phase 2πi/N.
    law : MatrixLaw
        Law without delay. Its inputs are the errors of all blocks, or of the averages that each well measures.
    duration : float, optional
        Duration [s]; the operation time unless given.
    substeps : int
        Number of substeps per period, 1 to 1000. A substep is a projected Euler step, v = max(v + h·a, 0), x = x + h·v.

    Raises
    ------
    ParameterError
        For friction with healing, a duration outside 1 to 5e7 periods, substeps outside 1 to 1000, or infinite slip.
    """
    if any(block.friction.rest_excess for block in chain.blocks):
        raise ParameterError("the simulation of several blocks does not support healing: set healing to 0")
    step, periods = float(law.step), whole_periods(chain, law.step, duration)
    if not 1 <= substeps <= 1000:
        raise ParameterError(f"substeps must be 1 to 1000. Received {substeps}.")
    period = _Period(chain=chain, law=law, substeps=substeps)
    once = period.function()
    chunk = max(periods // _POINTS, 1)
    sizes = [chunk] * (periods // chunk) + [periods % chunk] * (periods % chunk > 0)
    many = {size: once.fold(size) for size in set(sizes)}
    ends = np.cumsum([0, *(size for _, size in period.sizes)])
    place = {name: slice(*ends[i : i + 2]) for i, (name, _) in enumerate(period.sizes)}
    now = np.zeros(ends[-1])
    now[place["margins"]] = np.inf
    recorded = []
    for size in sizes:
        now[place["peak"]] = 0
        now = np.array(many[size](now)).ravel()
        recorded.append(now.copy())
        if not np.isfinite(now[place["x"]]).all():
            raise ParameterError("the slip of a block is not finite: reduce the gains of the law")
    stored = np.array(recorded)
    times = stored[:, place["count"]].ravel() * step
    task = chain.fault.reference
    least = stored[-1, place["margins"]]
    return BlockRun(
        times=times,
        slip=stored[:, place["x"]],
        slip_rate=stored[:, place["peak"]],
        pressure=stored[:, place["p"]],
        reference=task.target_slip * task.shape(np.minimum(times / task.operation_time, 1)),
        slip_error=stored[-1, place["worst"]],
        slip_rate_error=stored[-1, place["rate"]],
        rest=stored[-1, place["rest"]] / stored[-1, place["count"]],
        reversed=bool(least[0] < 0),
        opened=bool(least[1] <= 0),
    )
