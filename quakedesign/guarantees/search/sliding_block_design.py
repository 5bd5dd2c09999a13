"""Laws for blocks in slow sliding from the slip of each block, or its mean per well.

Linear-quadratic feedback of a Kalman filter of slips, states of friction, pressures and a constant pressure error of
each well, with weights from a search over estimates of provable bounds.
"""

from dataclasses import replace
from fractions import Fraction
from itertools import repeat
from typing import Any

import numpy as np
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize

from quakedesign.errors import CertificateError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import BlockChain
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw
from quakedesign.guarantees.exact.plant_proof import PlantProof, named
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sliding_blocks import MPA, BlockClaims, SlidingBlocks
from quakedesign.guarantees.exact.sliding_small_gain import exponential
from quakedesign.guarantees.search.block_design import estimate, middle, rounded
from quakedesign.guarantees.search.plant_search import linear_part, plant_guarantee
from quakedesign.plant.block_plant import measured_by

_STARTS = ((100.0, 100.0, 1e-2, 1e-9), (10.0, 100.0, 1e-4, 1e-9), (1000.0, 100.0, 1e-4, 1e-6), (100.0, 1.0, 1e-4, 1e-6))
"""Weights of pressure and slip error, variances of pressure error and slip measurement; all for scaled variables."""
_SPREAD = 2.0  # size of the first simplex, in logarithms
_EVALUATIONS = 60
_SLOWEST, _FORGET = 0.985, 1000  # largest eigenvalue of a period, and periods: slower loops take long to prove
_SMALL = 0.004  # least logarithm of the state at the start of the search
_TURNS = 14
_PIECES = 8  # pieces of a period, which is short compared with the times of the plant
_MARGIN = 1.03
_LOST = 100.0  # small gain reported without a law
_DIGITS = 10
_HALVINGS = 20  # bisections of a range of stresses


def sliding_block_guarantee(
    blocks: SlidingBlocks, step: Fraction, *, decentralised: bool = False
) -> PlantProof | NoProof:
    """Design a law for blocks in slow sliding and prove it, or return the reason for failure.

    Parameters
    ----------
    blocks : SlidingBlocks
    step : Fraction
        T_s [s].
    decentralised : bool
        Whether the pressure of each well depends on its own measurements alone.
    """
    search = _WeightSearch(blocks, step, decentralised)
    x = min((np.log(start) for start in _STARTS), key=search.log_rate)
    simplex = np.vstack([x, x + _SPREAD * np.eye(len(x))])
    options = {"maxfev": _EVALUATIONS, "initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-4}
    law, claims, small = search.closed(minimize(search.log_rate, x, method="Nelder-Mead", options=options).x)
    if claims is None or law is None:
        if small >= _LOST / 2:
            return NoProof(
                reason="no law is found whose loop decays fast enough: with fewer wells than blocks, modes that no "
                "well reaches must decay within some 60 T_s. Run limits, which says whether wells are missing; "
                "else lengthen T_s"
            )
        reason = f"no self-consistent bounds of slip rate and state: small gain {small:.3g}. Reduce the stress"
        return NoProof(reason=reason, small_gain=UpperBound(rational(f"{small:.6g}")))
    for _ in range(3):
        claims = _grown(claims, _MARGIN)
        plant, rate = blocks.plant(claims), blocks.log_rate(claims)
        if plant is None or rate is None:
            break
        proof = plant_guarantee(plant, law, _PIECES)
        if proof.available and max(proof.claims.controls) * MPA < claims.push:
            return replace(proof, notes=(_slip_rates(blocks, rate),))
    return NoProof(reason="the proof failed for the estimated bounds: reduce the stress")


def covered_stress(chain: BlockChain, claim: PlantProof) -> tuple[Fraction, Fraction, UpperBound, PlantProof]:
    """Lag [s], largest shear stress [Pa] and bound of |ln(v/V)| of a guarantee for blocks.

    The last result is the guarantee with the names of these blocks. The claims Z (log state) and W (shear stress by
    springs and wells) follow from the sectors of its plant, and Q (pressure minus planned pressure) from the bounds of
    its pressures; for a smaller Q its sectors and disturbances still cover the blocks.

    Raises
    ------
    CertificateError
        When the guarantee is about another plant.
    """
    part, size = claim.part, 2 * len(chain.blocks)
    within = [sector.within for sector in part.sectors[:2]]
    if len(part.A) <= size or not part.A[size][size] < 0 or len(within) < 2 or None in within:
        raise _of_another(chain)
    lag, pressure = -1 / part.A[size][size], max(claim.claims.controls) * MPA * (1 + Fraction(1, 10**9))
    claims = BlockClaims(log_state=within[0], pull=within[1] * MPA, push=pressure)  # type: ignore[arg-type, operator]

    def covers(stress: Fraction) -> bool:
        plant = SlidingBlocks(chain=chain, lag=lag, stress=stress).plant(claims)
        return plant is not None and _within(linear_part(plant, {}), part)

    high = max((entry[1] for entry in part.disturbances), default=Fraction(0)) * MPA
    high = high / min((s.slopes[1] for s in part.sectors[1::3] if s.slopes[1] > 0), default=Fraction(1))
    low = high / 2**_HALVINGS
    if not low or not covers(low):
        raise _of_another(chain)
    for _ in range(_HALVINGS):
        half = (low + high) / 2
        low, high = (half, high) if covers(half) else (low, half)
    blocks = SlidingBlocks(chain=chain, lag=lag, stress=low)
    rate, plant = blocks.log_rate(claims), blocks.plant(claims)
    assert rate is not None  # since the plant is covered
    assert plant is not None
    return lag, low, rate, replace(named(claim, plant), notes=(_slip_rates(blocks, rate),))


def _within(required: LinearPart, proved: LinearPart) -> bool:
    """Whether the required plant equals the proved one up to narrower sectors and smaller disturbances."""
    same = all(getattr(required, name) == getattr(proved, name) for name in ("A", "B", "C", "loads", "noise", "start"))
    if not same or required.outputs != proved.outputs or len(required.sectors) != len(proved.sectors):
        return False
    narrower = all(
        (a.entry, a.row, a.within) == (b.entry, b.row, b.within)
        and b.slopes[0] <= a.slopes[0] <= a.slopes[1] <= b.slopes[1]
        for a, b in zip(required.sectors, proved.sectors, strict=True)
    )
    pushed = zip(required.disturbances, proved.disturbances, strict=False)
    return (
        narrower
        and len(required.disturbances) == len(proved.disturbances)
        and all(a[0] == b[0] and a[1] <= b[1] for a, b in pushed)
    )


def _of_another(chain: BlockChain) -> CertificateError:
    return CertificateError(
        f"a certificate must be about these blocks in slow sliding. Received one about another plant than "
        f"{chain.name}. Give a file of guarantee {chain.name} --out FILE."
    )


def _slip_rates(blocks: SlidingBlocks, rate: UpperBound) -> str:
    V = blocks.tasks[0].rate
    fastest, most = UpperBound(V * exponential(rate)), LowerBound(blocks.stress)
    return (
        f"so the slip rate of every block stays at most {fastest:.4g} m/s, |ln(v/V)| <= {rate:.3g} with "
        f"V = {UpperBound(V):.4g} m/s, under any shear stress of at most {most.quantity('Pa', 4)} on every block"
    )


def _grown(claims: BlockClaims, by: float) -> BlockClaims:
    return BlockClaims(
        **{name: rational(f"{float(getattr(claims, name)) * by:.6g}") for name in ("log_state", "pull", "push")}
    )


class _WeightSearch:
    """Laws given by four weights, with their estimated bounds."""

    def __init__(self, blocks: SlidingBlocks, step: Fraction, decentralised: bool) -> None:
        self.blocks, self.step = blocks, step
        task, shares = blocks.tasks[0], np.array(blocks.chain.shares, dtype=float)
        N, m = shares.shape
        self.slip = float(task.ranges["critical_slip"][0])
        weights = np.array(measured_by(blocks.chain.shares), dtype=float)
        spread = shares @ np.linalg.inv(weights @ shares) if m < N else np.eye(N)
        self.mean = np.block([[np.kron(np.eye(2), weights), np.zeros((2 * m, m))], [np.zeros((m, 2 * N)), np.eye(m)]])
        self.back = np.block([[np.kron(np.eye(2), spread), np.zeros((2 * N, m))], [np.zeros((m, 2 * m)), np.eye(m)]])
        self.count, self.own = m, np.eye(m) if decentralised else np.ones((m, m))
        stress = float(blocks.stress)
        b = float(task.ranges["evolution_effect"][0]) * float(task.ranges["normal_stress"][0])
        self.small = BlockClaims(
            log_state=rational(f"{max(stress / b / 5, _SMALL):.3g}"),
            pull=rational(f"{stress:.3g}"),
            push=rational(f"{9 * stress:.3g}"),
        )

    def log_rate(self, x: np.ndarray) -> float:
        """Bound Y of |ln(v/V)| for self-consistent claims, or a penalty if there are none."""
        _, claims, small = self.closed(x)
        rate = None if claims is None else self.blocks.log_rate(claims)
        return 10 + small if rate is None else float(rate)

    def closed(self, x: np.ndarray) -> tuple[MatrixLaw | None, BlockClaims | None, float]:
        """Law, claims that imply bounds no larger than themselves, and small gain."""
        claims, law, small, N = self.small, None, _LOST, len(self.blocks.tasks)
        for _ in range(_TURNS):
            part = self._part(claims)
            law = None if part is None else law or self._law(part, x)
            if part is None or law is None:
                return None, None, small
            small, bounds = estimate(part, law, _SLOWEST, _FORGET)
            if bounds is None:
                return law, None, small
            reached = {
                "log_state": bounds[N : 2 * N].max(),
                "pull": bounds[2 * N : 3 * N].max() * MPA,
                "push": bounds[3 * N :].max() * MPA,
            }
            if all(v <= getattr(claims, name) for name, v in reached.items()):
                return law, claims, small
            responses = {
                name: rational(f"{max(v * _MARGIN, float(getattr(claims, name))):.6g}") for name, v in reached.items()
            }
            claims = BlockClaims(**responses)
        return law, None, small

    def _part(self, claims: BlockClaims) -> Any:
        plant = self.blocks.plant(claims)
        return None if plant is None else linear_part(plant, {})

    def _log_rates(self, part: Any) -> np.ndarray:
        """Rows of ln(v/V) of the blocks, without the stress, with sectors at their midpoints."""
        size = len(part.A)
        rows = [
            sum(np.array(one.row[:size], dtype=float) * float(sum(one.slopes)) / 2 * sign for one, sign in pair)
            for pair in zip(zip(part.sectors[::3], repeat(-1)), zip(part.sectors[1::3], repeat(1)), strict=True)
        ]
        return np.array(rows)

    def _decentralised(self, matrix: np.ndarray) -> np.ndarray:
        """Matrix restricted to entries between signals of the same well, if the law is decentralised."""
        height, width = (size // self.count for size in matrix.shape)
        return np.asarray(matrix * np.kron(np.ones((height, width)), self.own))

    def _law(self, part: Any, x: np.ndarray) -> MatrixLaw | None:
        """Feedback of the estimate in exact numbers; None if a Riccati equation fails."""
        pressure, slip, drift, noise = np.exp(x)
        (A, B), m = middle(part), self.count
        A, B = self._decentralised(self.mean @ A @ self.back), self._decentralised(self.mean @ B)
        stressed = self.mean @ np.array([entry for entry, _ in part.disturbances], dtype=float).T
        stressed = stressed * [float(size) for _, size in part.disturbances]
        k, T = len(A), float(self.step)
        whole = np.block([[A, B, B], [np.zeros((2 * m, k + 2 * m))]])
        step_map = expm(whole * T)
        As, Bs = step_map[: k + m, : k + m], step_map[: k + m, k + m :]
        C = np.hstack([np.eye(m), np.zeros((m, k))])
        entered = np.vstack([stressed, np.zeros((m, stressed.shape[1]))])
        covariance = (
            self._decentralised(entered @ entered.T) * T**2
            + np.diag(np.r_[np.zeros(k), np.full(m, drift)])
            + 1e-14 * np.eye(k + m)
        )
        rates = self.mean[:m, : len(self.blocks.tasks)] @ self._log_rates(part) @ self.back
        aims = self._decentralised(rates.T @ rates) + np.diag(np.r_[np.full(m, slip), np.zeros(2 * m)])
        try:
            P = solve_discrete_are(As[:k, :k], Bs[:k], aims, pressure * np.eye(m))
            K = np.linalg.solve(pressure * np.eye(m) + Bs[:k].T @ P @ Bs[:k], Bs[:k].T @ P @ As[:k, :k])
            S = solve_discrete_are(As.T, C.T, covariance, noise * np.eye(m))
            L = S @ C.T @ np.linalg.inv(C @ S @ C.T + noise * np.eye(m))
        except (ValueError, np.linalg.LinAlgError):
            return None
        K, L = self._decentralised(np.hstack([K, np.eye(m)])), self._decentralised(L)
        rest, moved = np.eye(k + m) - L @ C, As - Bs @ K
        return MatrixLaw(
            step=self.step,
            delay=Fraction(0),
            update=rounded(moved @ rest, _DIGITS),
            measured=rounded(moved @ L / self.slip, _DIGITS),
            output=rounded(-K @ rest, _DIGITS),
            feedback=rounded(-K @ L / self.slip, _DIGITS),
        )
