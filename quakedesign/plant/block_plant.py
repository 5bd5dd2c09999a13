"""Uncertain plants of a fault of several blocks with wells.

With as many independent wells as blocks, errors are relative to the reference r(t). With fewer wells, only one average
of the slips per well can follow r. Let the rows of C be the weights of these averages; each row sums to 1. Slip errors
are then relative to the equilibrium x*(t) under well pressures p* with Cx* = r. Block i has e1′ = e2 + (r′ − x*′) and
e2′ = s·e1 + ΣK(e1_j − e1) − w·e2 + βb·S(p − p*) + φ − w·r′ − r″. The coefficients s, w and β lie in ranges, as in
`fault_plant`, and S are the shares of the wells in the pressure of each block.

**Balance.** Let N = σ′ − Sp* for each block. The force balance per mass is n(μ*σ′ − μN) − kx* + ΣK(x*_j − x*) = 0, with
n the area per mass. With μ = μ0 + δ and |δ| ≤ h, these equations and Cx* = r give N = N0(r) + Gc, where c = nδN and G
is S times a block of the inverse of a constant matrix. Then |N − N0| ≤ |G|nh|N|, which bounds N, and with it s and w.

With x*′ = r′(1 + ξ) and p*′ = r′q the derivative of the forces is s(1 + ξ) + ΣK(ξ_j − ξ) + βb·Sq = 0, and Cξ = 0.
With s = s0 + δs and β = β0 + δβ let F bound |δs(1 + ξ) + δβb·Sq|. The inverse of the matrix with s0 and β0 bounds
|1 + ξ| and b|Sq| by A + B·F. With the half-widths of s and β this gives F ≤ f + M·F. If M·F + f < F for a positive F,
the spectral radius of M is below 1 (Collatz and Wielandt), no matrix of the ranges is singular, the balance is a
Lipschitz function of r (Clarke), and |ξ| ≤ X and |q| ≤ Q follow from F.

With one well, identical blocks and symmetric springs, the springs drop out of the mean force. The mean force is that on
one block whose friction coefficient is the mean of μ(x*) over the blocks. N then lies in the range of one block whose
friction weakens and strengthens 1 + X times as fast. If X > 1, blocks may move backward, at up to X − 1 times the rate
of the reference; weakening friction then increases again.

If no F with M·F + f < F is found, no guarantee can be proved: the bound `within` of the slope sectors is then 1e-30 m.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import LowerBound, UpperBound, rational, shortly
from quakedesign.fault import BlockChain, Fault
from quakedesign.fault.block_chain import add_springs
from quakedesign.fault.units import exact_value
from quakedesign.plant.fault_plant import FaultPlant, Range
from quakedesign.plant.of_fault import uncertain_plant
from quakedesign.plant.plant_values import MOST, Matrix, Row, unit
from quakedesign.text import counted

_STEEP = Fraction(10**9)  # factor on friction slopes in the first pass: allows any coefficient at any slip
_LOST = Fraction(10**9)  # X [-], Q [Pa/m] and |σ′ − Sp*| [Pa] without proved bounds of the balance
_NOWHERE = Fraction(1, 10**30)  # bound [m] of the sectors in that case, with which no guarantee can be proved
_TURNS = 6
_GRID = 10**4
_DIGITS = 6  # significant digits of the middle of a range
_WIDER = 1 + 1e-9

Spring = tuple[int, int, Fraction]


def block_parts(fault: Fault | BlockChain, blocks: int | None, wells: str, coupling: Any) -> dict[str, Any]:
    """Fields of `UncertainPlant` for the blocks of a fault; arguments and errors as of `UncertainPlant.from_blocks`."""
    if isinstance(fault, BlockChain):
        if blocks is not None or coupling is not None or wells != "each":
            raise ParameterError(
                "a fault of several blocks has its own blocks, wells and coupling. Received a value for one of these. "
                "Omit blocks, wells and coupling."
            )
        N, m = len(fault.blocks), len(fault.wells)
        tasks = [uncertain_plant(one) for one in fault.faults]
        name = f"{fault.name}, {N} blocks, {counted(m, 'well')}"
        along = "" if fault.diffusivity is None else f", pressures diffuse along the fault, {fault.diffusivity:g} m²/s"
        box = fault.fault.box.name + along
        return _parts(tasks, fault.springs, fault.shares, name, box, fault.flow, fault.pressures)
    require_known(wells, ("each", "one"), "wells")
    if blocks is None or not 2 <= blocks <= MOST // 2:
        raise ParameterError(f"blocks must be a whole number from 2 to {MOST // 2}. Received {blocks}.")
    task = uncertain_plant(fault)
    elastic = task.shear_modulus * blocks**2 / (task.density * rational(fault.length) ** 2)
    K = elastic if coupling is None else exact_value(coupling, "1/s^2", "coupling")
    if K <= 0:
        raise ParameterError(f"coupling of blocks must be positive. Received {shortly(K)} 1/s^2.")
    springs = [(a, b, K) for i in range(blocks - 1) for a, b in ((i, i + 1), (i + 1, i))]
    shares = [unit(blocks, i) for i in range(blocks)] if wells == "each" else [(Fraction(1),)] * blocks
    wells_in_words = f"{blocks} wells" if wells == "each" else "one well"
    return _parts([task] * blocks, springs, shares, f"{blocks} blocks of {task.name}, {wells_in_words}", fault.box.name)


def _parts(
    tasks: Sequence[FaultPlant],
    springs: Iterable[Spring],
    shares: Sequence[Row],
    name: str,
    box: str,
    flow: Matrix = (),
    pressures: Matrix = (),
) -> dict[str, Any]:
    """Fields of a plant of blocks and wells, with pressures that diffuse between them as further states."""
    N, m, more, zero = len(tasks), len(shares[0]), len(flow), Fraction(0)
    size, springs, pressures = 2 * N + more, list(springs), pressures or tuple(shares)
    inverse, weights, lost = inverse_of(shares) if m == N else None, None, False
    if inverse is None:
        weights = _averages(tasks, shares)
        balance = _balance(tasks, springs, shares, weights)
        slopes, dampings, lost = balance.slopes, balance.dampings, max(balance.moves) >= _LOST
    else:
        slopes, dampings = [task.slip_chord for task in tasks], [task.rate_chord for task in tasks]
    pulls = [[zero] * size for _ in range(N)]
    add_springs(pulls, springs)
    for i, damping in enumerate(dampings):
        pulls[i][N + i] = -(damping[0] + damping[1]) / 2
    rate = [unit(size, N + i) for i in range(N)]
    sectors, disturbances, needed, first = {}, {}, [], tasks[0].reference_rates[0]
    for i, task in enumerate(tasks):
        half, place = (dampings[i][1] - dampings[i][0]) / 2, i + 1
        within = _NOWHERE if lost else None
        sectors[f"slope of block {place}"] = dict(entry=rate[i], row=unit(size, i), slopes=slopes[i], within=within)
        if half:
            sectors[f"damping of block {place}"] = dict(entry=rate[i], row=rate[i], slopes=(-half, half))
        acts = (*[zero] * (2 * N), *(task.authority * v for v in pressures[i]))
        sectors[f"input gain of block {place}"] = dict(entry=rate[i], row=acts, slopes=(zero, task.beta[1] - 1))
        needed.append(max(map(abs, dampings[i])) * first + task.reference_rates[1])
        disturbances[f"force on block {place}"] = (rate[i], needed[-1] + task.amplitude)
    if inverse is None:
        of_pressures = [unit(m, k) for k in range(m)]
        moving = [rate * first for rate in balance.pressures]
        for i, moved in enumerate(balance.moves):
            disturbances[f"balance of block {i + 1}"] = (unit(size, i), moved * first)
    else:  # well pressures that balance a pressure of 1 on block i
        of_pressures = [tuple(row[i] for row in inverse) for i in range(N)]
        moving = [max(map(abs, s)) * first / task.authority for s, task in zip(slopes, tasks, strict=True)]
    forces = [tuple(task.authority * v for v in row) for task, row in zip(tasks, pressures, strict=True)]
    pulls = [[*row[: 2 * N], *force[:more]] for row, force in zip(pulls, forces, strict=True)]
    measured = weights or ([unit(N, i) for i in range(N)] if more else None)
    steady = [row for row, read in zip(shares, pressures, strict=True) if any(read[:more])]
    shifts = [[*[zero] * (2 * N), *(_dot(row, one) for row in steady)] if more else None for one in of_pressures]
    order = ("slope", "damping", "input")
    springs_in_words = ", the stiffness of the springs between blocks known exactly" if any(tasks[0].spreads) else ""
    return {
        "A": [*rate, *pulls, *((*[zero] * (2 * N), *row[:more]) for row in flow)],
        "B": [(zero,) * m] * N + [row[more:] for row in (*forces, *flow)],
        "C": measured
        and [
            *((*row, *[zero] * (N + more)) for row in measured),
            *((*[zero] * N, *row, *[zero] * more) for row in measured),
        ],
        "sectors": dict(sorted(sectors.items(), key=lambda item: order.index(item[0].split()[0]))),
        "disturbances": disturbances,
        "loads": {
            f"pressure {i + 1}": (one, shift, v)
            for i, (one, shift, v) in enumerate(zip(of_pressures, shifts, moving, strict=True))
        },
        "outputs": {
            **{f"slip error {i + 1}": unit(size, i) for i in range(N)},
            **{f"slip-rate error {i + 1}": rate[i] for i in range(N)},
        },
        "controls": tuple(f"pressure {k + 1}" for k in range(m)),
        "units": {f"slip error {i + 1}": "m" for i in range(N)}
        | {f"slip-rate error {i + 1}": "m/s" for i in range(N)}
        | {f"pressure {k + 1}": "Pa" for k in range(m)}
        | {name: "m/s" if name.startswith("balance") else "m/s²" for name in disturbances},
        "name": name,
        "remarks": {
            "plant": f"of {name}, without stick (friction continues to negative slip rates), for all friction and "
            f"constants of box {box}{springs_in_words}",
            "disturbances": f"on a block: {LowerBound(tasks[0].amplitude).quantity('m/s²', 4)} of disturbance and at "
            f"most {UpperBound(max(needed)).quantity('m/s²')} that the reference needs",
        },
    }


def measured_by(shares: Sequence[Row]) -> Matrix:
    """Weights of the blocks [-] in each measurement: single blocks, or with fewer wells averages by well shares."""
    N, columns = len(shares), list(zip(*shares, strict=True))
    if len(columns) == N:
        return tuple(unit(N, i) for i in range(N))
    return tuple(tuple(v / (sum(column) or 1) for v in column) for column in columns)


def require_independent(shares: Sequence[Row]) -> None:
    """Reject wells whose effects on the measurements are linearly dependent."""
    N, m = len(shares), len(shares[0])
    weights = measured_by(shares)
    through = [[sum((c * shares[i][k] for i, c in enumerate(row)), Fraction(0)) for k in range(m)] for row in weights]
    if inverse_of(through) is None:
        raise ParameterError(
            f"a guarantee of several blocks needs wells that act independently. Received {counted(m, 'well')} for "
            f"{N} blocks, whose effects on the measured slips are linearly dependent. Move or omit wells."
        )


def _averages(tasks: Sequence[FaultPlant], shares: Sequence[Row]) -> Matrix:
    require_independent(shares)
    if any(any(task.spreads) for task in tasks):
        raise ParameterError(
            f"a fault with fewer wells than blocks needs exact constants, box paper. Received {tasks[0].name} with "
            "uncertain constants. Use fault.with_box('paper'), or a well for each block."
        )
    return measured_by(shares)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Balance:
    """Per block: ranges of s [1/s²] (`slopes`) and w [1/s] (`dampings`), X [-] (`moves`); per well: Q [Pa/m]."""

    slopes: list[Range]
    dampings: list[Range]
    moves: list[Fraction]
    pressures: list[Fraction]


def _balance(
    tasks: Sequence[FaultPlant], springs: Sequence[Spring], shares: Sequence[Row], weights: Matrix
) -> _Balance:
    """Bounds of slopes, rates and pressures at balance, with fewer wells than blocks."""
    symmetric = {(j, i, K) for i, j, K in springs} == set(springs)  # other springs do not drop out of the mean force
    alike = len(weights) == 1 and symmetric and all(task == tasks[0] for task in tasks)
    best: _Balance | None = None
    for _ in range(_TURNS if alike else 1):
        if alike:
            law, steep = tasks[0].friction, _STEEP if best is None else 1 + max(best.moves)
            stronger = max(law.strengthening * steep, law.weakening * (steep - 2))
            faster = replace(law, weakening=law.weakening * steep, strengthening=stronger)
            stresses = [replace(tasks[0], friction=faster).stress] * len(tasks)
        else:
            stresses = _stresses(tasks, springs, shares, weights)
        better = _moving(tasks, springs, shares, weights, stresses)
        if best is not None and max(better.moves) >= max(best.moves):
            break
        best = better
        if max(best.moves) >= _LOST:
            break
    assert best is not None
    return best


def _balancing(
    diagonal: Sequence[Fraction], springs: Sequence[Spring], acting: Sequence[Row], weights: Matrix
) -> "list[list[Fraction]] | None":
    """Inverse of [[diagonal + springs, acting], [weights, 0]]; None for a singular matrix."""
    N, m = len(diagonal), len(weights)
    rows = [[Fraction(0)] * N + list(acting[i]) for i in range(N)] + [[*row, *[Fraction(0)] * m] for row in weights]
    for i, value in enumerate(diagonal):
        rows[i][i] += value
    add_springs(rows, springs)
    return inverse_of(rows)


def _stresses(
    tasks: Sequence[FaultPlant], springs: Sequence[Spring], shares: Sequence[Row], weights: Matrix
) -> list[Range]:
    """Ranges of σ′ − Sp* [Pa] of every block at balance; ±1e9 Pa if no range is proved."""
    N, m = len(tasks), len(weights)
    area = [task.area_per_mass[0] for task in tasks]
    middle = [(task.friction.least + task.friction.largest) / 2 for task in tasks]
    half = [(task.friction.largest - task.friction.least) / 2 for task in tasks]
    stiff = [task.growths[0] - task.stiffness[0] for task in tasks]
    acting = [tuple(a * mu * v for v in row) for a, mu, row in zip(area, middle, shares, strict=True)]
    inverse = _balancing(stiff, springs, acting, weights)
    if inverse is None:
        return [(-_LOST, _LOST)] * N
    forces = [
        a * (mu - task.friction.static) * task.normal_stress for a, mu, task in zip(area, middle, tasks, strict=True)
    ]
    ends = []
    for slip in (Fraction(0), tasks[0].target_slip):
        right_side = [*forces, *[slip] * m]
        p = [_dot(row, right_side) for row in inverse[N:]]
        ends.append([task.normal_stress - _dot(row, p) for task, row in zip(tasks, shares, strict=True)])
    largest = [max(map(abs, pair)) for pair in zip(*ends, strict=True)]
    sensitivity = product(shares, inverse[N:], N)
    gains = [[abs(v) * a * h for v, a, h in zip(row, area, half, strict=True)] for row in sensitivity]
    deviations = _closed(gains, [_dot(row, largest) for row in gains])
    if deviations is None:
        return [(-_LOST, _LOST)] * N
    return [(min(pair) - d, max(pair) + d) for *pair, d in zip(*ends, deviations, strict=True)]


def _moving(
    tasks: Sequence[FaultPlant],
    springs: Sequence[Spring],
    shares: Sequence[Row],
    weights: Matrix,
    stresses: Sequence[Range],
) -> _Balance:
    """X and Q from ranges of σ′ − Sp* [Pa]."""
    N, m = len(tasks), len(weights)
    slopes = [task.slip_slopes(stress) for task, stress in zip(tasks, stresses, strict=True)]
    dampings = [task.rate_slopes(stress) for task, stress in zip(tasks, stresses, strict=True)]
    lost = _Balance(slopes=slopes, dampings=dampings, moves=[_LOST] * N, pressures=[_LOST] * m)
    s, half_s = zip(*map(_middle, slopes), strict=True)
    beta, half_beta = zip(*(_middle(task.beta) for task in tasks), strict=True)
    force = [tuple(task.authority * v for v in row) for task, row in zip(tasks, shares, strict=True)]
    acting = [tuple(b * v for v in row) for b, row in zip(beta, force, strict=True)]
    inverse = _balancing(s, springs, acting, weights)
    if inverse is None or (-_LOST, _LOST) in stresses:
        return lost
    right_side = [*(-v for v in s), *[Fraction(0)] * m]
    nominal = [_dot(row, right_side) for row in inverse]  # ξ and q with δs = δβ = 0
    gain_slip = [[abs(v) for v in row[:N]] for row in inverse[:N]]
    gain_force = [[abs(v) for v in row] for row in product(force, inverse[N:], N)]
    at_rest = [abs(1 + v) for v in nominal[:N]]
    at_pressure = [abs(_dot(row, nominal[N:])) for row in force]
    gains = [
        [hs * a + hb * b for a, b in zip(rows[0], rows[1], strict=True)]
        for hs, hb, *rows in zip(half_s, half_beta, gain_slip, gain_force, strict=True)
    ]
    first = [hs * a + hb * b for hs, hb, a, b in zip(half_s, half_beta, at_rest, at_pressure, strict=True)]
    F = _closed(gains, first)
    if F is None:
        return lost
    moves = [
        Fraction(ceil((abs(v) + _dot(row, F)) * _GRID), _GRID) for v, row in zip(nominal[:N], gain_slip, strict=True)
    ]
    pressures = [abs(v) + _dot([abs(g) for g in row[:N]], F) for v, row in zip(nominal[N:], inverse[N:], strict=True)]
    return replace(lost, moves=moves, pressures=[Fraction(ceil(v)) for v in pressures])


def _closed(gains: Sequence[Sequence[Fraction]], first: Sequence[Fraction]) -> list[Fraction] | None:
    """F > 0 with first + gains·F < F, computed in floats and checked exactly; None if the check fails."""
    matrix = np.array(gains, dtype=float)
    if max(abs(np.linalg.eigvals(matrix))) >= 1:
        return None
    wider = np.array(first, dtype=float)
    wider = wider * _WIDER + 1e-9 * max(wider.max(), 1e-100)
    bounds = [rational(float(v)) for v in np.linalg.solve(np.eye(len(wider)) - _WIDER * matrix, wider)]
    contracts = all(v > 0 and f + _dot(row, bounds) < v for v, f, row in zip(bounds, first, gains, strict=True))
    return bounds if contracts else None


def _middle(ends: Range) -> tuple[Fraction, Fraction]:
    """Rounded middle of a range, and the largest distance of its ends from there."""
    middle = rational(f"{float(sum(ends)) / 2:.{_DIGITS}g}")
    return middle, max(ends[1] - middle, middle - ends[0])


def _dot(row: Iterable[Fraction], values: Iterable[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(row, values, strict=False) if a and b), Fraction(0))


def product(
    rows: Sequence[Sequence[Fraction]], columns: Sequence[Sequence[Fraction]], count: int
) -> list[list[Fraction]]:
    """First `count` columns of the product of two matrices."""
    return [[_dot(row, (line[j] for line in columns)) for j in range(count)] for row in rows]


def inverse_of(rows: Sequence[Sequence[Fraction]]) -> "list[list[Fraction]] | None":
    """Rows of the inverse; None for a singular matrix."""
    matrix = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in rows])
    if matrix.det() == 0:
        return None
    return [[Fraction(int(v.p), int(v.q)) for v in row] for row in matrix.inv().tolist()]
