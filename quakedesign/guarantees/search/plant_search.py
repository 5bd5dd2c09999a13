"""Search for a proof about an uncertain plant under a sampled law: bounds of the sectors."""

from dataclasses import replace
from fractions import Fraction
from math import ceil
from typing import Any

import numpy as np
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound, rational
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw, PlantLoop, ResponseBounds, response_bounds
from quakedesign.guarantees.exact.plant_proof import MOST_PIECES, PlantClaims, PlantProof, named, peaks, row_bounds
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.tracking_proof import MARGIN, above
from quakedesign.plant.plant_values import Row
from quakedesign.plant.user_plant import UncertainPlant

_TURNS = 60  # largest number of turns for the bounds of sectors
_WIDER = Fraction(51, 50)  # enlargement of each bound over the last requirement
_PIECES = ((36, 16), (96, 8))  # largest number of states, and pieces of a flow
_MARGIN = 1.002  # margin for a checker with other bounds of the same integrals


def linear_part(plant: UncertainPlant, bounds: dict[str, Fraction]) -> LinearPart:
    """Uncertain plant in exact numbers; `bounds`: largest argument of callable slopes by sector name, 1 by default."""
    sectors = plant.exact_sectors(lambda name: bounds.get(name, Fraction(1)))
    return LinearPart(
        A=plant.A,
        B=plant.B,
        C=plant.C,
        disturbances=tuple(plant.disturbances.values()),
        loads=tuple(plant.loads.values()),
        sectors=tuple(sectors.values()),
        noise=tuple(plant.noise.get(name, Fraction(0)) for name in plant.measurements),
        start=plant.start,
        outputs=tuple((plant.outputs or {}).values()),
    )


def plant_guarantee(plant: UncertainPlant, law: MatrixLaw, pieces: int | None = None) -> PlantProof | NoProof:
    """Peaks of a plant under a law, or the reason why none are proved.

    Raises
    ------
    ParameterError
        For a law that does not fit the plant, or a plant without disturbances, loads, noise and initial states.
    """
    bounds = _first_bounds(plant)
    free = list(bounds)
    for _ in range(_TURNS):
        part = linear_part(plant, bounds)
        if not (part.disturbances or part.loads or any(part.noise) or any(part.start)):
            raise ParameterError(
                "an uncertain plant needs disturbances, loads, noise or start. Received none of them: from rest every "
                "output stays 0. Give one."
            )
        loop = part.loop(law)
        if reason := _unstable(part, loop):
            return NoProof(reason=reason)
        cut = pieces or pieces_of(loop)
        try:
            responses = response_bounds(loop, cut)
        except ParameterError as error:
            return NoProof(reason=str(error))
        inputs = _numbers(plant, part, responses)
        if isinstance(inputs, NoProof):
            return inputs
        rows = row_bounds(part, responses, inputs)[len(part.outputs) :]
        reached = {name: rows[list(plant.sectors).index(name)] for name in free}
        left = [name for name in free if reached[name] >= bounds[name]]
        if not left:
            return _claimed(plant, part, law, cut, responses, inputs)
        for name in left:
            bounds[name] = _rounded(reached[name] * _WIDER)
    name = left[0]
    reason = f"the argument of {name} may exceed every bound that was tried, up to about {float(bounds[name]):.3g}"
    return NoProof(reason=reason)


def _first_bounds(plant: UncertainPlant) -> dict[str, Fraction]:
    """Bounds of the arguments with callable slopes, from the box of initial states."""
    exact, bounds = plant.exact_sectors(lambda _: Fraction(1)), {}
    for name, sector in plant.sectors.items():
        if callable(sector.slopes) and sector.within is None:
            first = sum((abs(a) * b for a, b in zip(exact[name].row, plant.start, strict=False)), Fraction(0))
            bounds[name] = _rounded(first * _WIDER) or Fraction(1, 1000)
    return bounds


def _claimed(
    plant: UncertainPlant, part: LinearPart, law: MatrixLaw, pieces: int, responses: ResponseBounds, inputs: Row
) -> PlantProof | NoProof:
    bounds = peaks(part, responses, inputs)
    if bounds is None:
        rows = row_bounds(part, responses, inputs)[len(part.outputs) :]
        names = [*plant.sectors, *plant.gains]
        beyond = [
            f"{name} is valid up to {UpperBound(s.within):.4g}, but its argument may reach {UpperBound(row):.4g}"
            for name, s, row in zip(names, part.sectors, rows, strict=False)
            if s.within is not None and row >= s.within
        ]
        return NoProof(reason="; ".join(beyond) or "the small-gain inequalities are not satisfied")
    claimed = tuple(UpperBound(above(v * MARGIN)) for v in bounds)
    count = len(part.outputs)
    claims = PlantClaims(outputs=claimed[:count], controls=claimed[count:])
    return named(PlantProof(part=part, law=law, pieces=pieces, inputs=inputs, claims=claims), plant)


def _numbers(plant: UncertainPlant, part: LinearPart, responses: ResponseBounds) -> Row | NoProof:
    """Sector inputs W of the theorem, from floats; or `NoProof` with the sector that contributes most by itself."""
    count, names = len(part.outputs), [*plant.sectors, *plant.gains]
    halves = np.array([float(s.slopes[1] - s.slopes[0]) / 2 for s in part.sectors])
    if not halves.any():
        return (Fraction(0),) * len(halves)
    first = len(part.disturbances) + len(part.loads)
    span = slice(count, count + len(halves))
    gains = np.array([[float(v) for v in row[span]] for row in responses.inputs[first:]]).T
    matrix = halves[:, None] * gains
    radius = max(abs(np.linalg.eigvals(matrix)))
    if radius * _MARGIN >= 1:
        alone = int(np.argmax(np.diag(matrix)))
        return NoProof(
            reason=f"small gain {radius:.3g}, which must be below 1: {names[alone]} contributes "
            f"{matrix[alone, alone]:.3g} by itself",
            small_gain=UpperBound(rational(f"{radius:.6g}")),
        )
    none = tuple(Fraction(0) for _ in halves)
    own = halves * np.array([float(v) for v in row_bounds(part, responses, none)[span]])
    own += 1e-12 * max(own.max(), 1e-300)
    solved = np.linalg.solve(np.eye(len(own)) - _MARGIN * matrix, _MARGIN * own)
    return tuple(_rounded(rational(float(v)), 8) for v in solved)


def _rounded(value: Fraction, digits: int = 4) -> Fraction:
    """Non-negative number, rounded up to a few digits."""
    if not value:
        return value
    scale = Fraction(10) ** (digits - 1 - len(str(ceil(value))) if value >= 1 else digits - 1 + _zeros(value))
    return Fraction(ceil(value * scale)) / scale


def _zeros(value: Fraction) -> int:
    return len(str(int(1 / value)))


def pieces_of(loop: PlantLoop) -> int:
    """Number of pieces of a flow: few for a large loop, more for a fast mode."""
    size, flow = len(loop.flow), np.array(loop.flow, dtype=float)
    fastest = max(abs(np.linalg.eigvals(flow)))
    fast = max(float(time) for _, time in loop.segments) * fastest
    usual = next(count for most, count in _PIECES if size <= most)
    return int(min(max(usual, 2 * ceil(fast)), MOST_PIECES))


def spectral_radius(loop: PlantLoop) -> tuple[float, np.ndarray]:
    """Spectral radius of a period, and its eigenvector."""
    flow, period = np.array(loop.flow, dtype=float), np.eye(len(loop.flow))
    for jump, time in loop.segments:
        period = expm(flow * float(time)) @ np.array(jump, dtype=float) @ period
    values, vectors = np.linalg.eig(period)
    place = int(np.argmax(abs(values)))
    return float(abs(values[place])), vectors[:, place]


def _unstable(part: LinearPart, loop: PlantLoop) -> str:
    """Reason why the nominal loop is not stable; empty if it is."""
    radius, mode = spectral_radius(loop)
    if radius < 1:
        return ""
    states = np.real(mode[: len(part.A)] / mode[np.argmax(abs(mode[: len(part.A)]))])
    shape = ", ".join(f"{v:.2g}" for v in states)
    return (
        f"the nominal loop is not stable: the mode ({shape}) of the states grows by a factor of {radius:.4g} per sample"
    )


def escaping(plant: UncertainPlant, law: MatrixLaw) -> tuple[float, np.ndarray]:
    """Growth per sample and shape of the fastest-growing mode, with every sector at its upper slope."""
    part = linear_part(plant, _first_bounds(plant))
    steep = tuple(replace(s, slopes=(s.slopes[1], s.slopes[1])) for s in part.sectors)
    radius, mode = spectral_radius(replace(part, sectors=steep).loop(law))
    states: Any = mode[: len(plant.A)]
    return radius, np.real(states / states[np.argmax(abs(states))])
