"""Guarantees of uncertain plants under laws in exact numbers."""

from dataclasses import replace
from typing import Any

import numpy as np

from quakedesign.errors import ParameterError
from quakedesign.exact import rational, shortly
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.guarantees.exact.plant_proof import PlantProof
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.search.block_design import block_law
from quakedesign.guarantees.search.plant_search import escaping, plant_guarantee
from quakedesign.laws.user_law import exact_matrix, integrating
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.plant import UncertainPlant

_SUPPORTED = {"step", "delay", "lag"}
_UNSEEN = 1e-9


def guarantee_plant(
    plant: UncertainPlant, law: Any, gains: Any, setup: LoopSetup, *, decentralised: bool = False
) -> PlantProof | NoProof:
    """Peaks of a plant's outputs under a law, a gain matrix or a law designed for blocks.

    Parameters
    ----------
    plant : UncertainPlant
    law : object with A, B, C, D and dt, SampledLaw or None
    gains : matrix
        u = −gains·y, with the step of the setup.
    setup : LoopSetup
        Step, delay and lag.
    decentralised : bool
        For a designed law: whether the pressure of each well depends on its own measurements alone.
    """
    if unknown := setup.given().keys() - _SUPPORTED:
        raise ParameterError(
            f"a guarantee of an uncertain plant takes step, delay and lag of the loop setup; noise and start are "
            f"fields of the plant. Received {', '.join(sorted(unknown))}. Omit these."
        )
    behind = plant.behind(setup.lag) if setup.lag else plant
    exact, notes = _law_of(behind, law, gains, setup, decentralised)
    radius, mode = escaping(behind, exact)
    if radius >= 1:
        count = _shown(behind)
        mode = mode / (max(mode[:count], key=abs) or 1)  # blocks may have pressures [Pa] as well as slips [m]
        shape = ", ".join(f"{v + 0.0:.2g}" for v in np.round(mode[:count], 9))
        seen = np.abs(np.array(behind.C, dtype=float) @ mode).max() > _UNSEEN
        return NoProof(
            reason=f"a mode {'' if seen else 'that is not measured '}is unstable: with every uncertain term at its "
            f"upper slope the states ({shape}) grow by a factor of {radius:.4g} per sample"
        )
    proof = plant_guarantee(behind, exact)
    return replace(proof, notes=notes) if proof.available else proof


def _shown(plant: UncertainPlant) -> int:
    """Number of leading states that are shown: the slip errors of blocks, or all states."""
    return len(plant.outputs or ()) // 2 if any("block" in name for name in plant.sectors) else len(plant.A)


def _law_of(
    plant: UncertainPlant, law: Any, gains: Any, setup: LoopSetup, decentralised: bool
) -> tuple[MatrixLaw, tuple[str, ...]]:
    """Law in exact numbers, and notes on changes by rounding."""
    entries: Any = gains if hasattr(gains, "shape") else list(gains)
    empty = len(entries) == 0
    if (law is None) == empty and not (law is None and "slope of block 1" in plant.sectors and not setup.delay):
        raise ParameterError(
            "an uncertain plant needs a law, or gains with a step. Received "
            f"{'none of them' if empty else 'both'}. Give law=control.ss(A, B, C, D, dt), or gains=K and step."
        )
    if law is None:
        if setup.step is None:
            raise ParameterError("gains of an uncertain plant need a step. Received none. Give step='0.1 s', say.")
        if empty:
            return block_law(plant, setup.step, decentralised=decentralised), ()
        rows = exact_matrix(np.atleast_2d(np.asarray(entries, dtype=object)), "gains")
        feedback = tuple(tuple(-v for v in row) for row in rows)
        output: tuple[Any, ...] = ((),) * len(feedback)
        static: dict[str, Any] = {"update": (), "measured": (), "output": output, "feedback": feedback}
        return MatrixLaw(step=setup.step, delay=setup.delay, **static), ()
    linear, notes = getattr(law, "law", None), tuple(getattr(law, "notes", ()))
    step = rational(law.step if linear is not None else getattr(law, "dt", None) or 0, "dt")
    if step <= 0 or getattr(law, "dt", 0) is True or (setup.step or step) != step:
        raise ParameterError(
            "dt of a law must be positive, and equal to the step of the loop setup where that is given"
            f"{f', here {shortly(setup.step)} s' if setup.step else ''}. Received dt = {getattr(law, 'dt', step)!r}. "
            "Use control.ss(A, B, C, D, dt)."
        )
    if linear is not None:
        others = {
            "an implicit step": linear.implicit_step,
            "r or r' as an input": linear.of_reference,
            "nonzero initial states": linear.first,
        }
        if received := [feature for feature, part in others.items() if part]:
            raise ParameterError(
                "a law of an uncertain plant must be linear in the measurements, with zero initial states. Received "
                f"one with {' and '.join(received)}. Give law=control.ss(A, B, C, D, dt) of the measurements."
            )
        parts: tuple[Any, ...] = (linear.update, linear.measured, (linear.output,), (linear.feedback,))
    else:
        parts = tuple(exact_matrix(getattr(law, name, None), name) for name in "ABCD")
        if len(parts[2]) == 1 and plant.loads:
            update, notes = integrating(parts[0], parts[2][0])
            parts = (update, *parts[1:])
    A, B, C, D = parts
    return MatrixLaw(step=step, delay=setup.delay, update=A, measured=B, output=C, feedback=D), notes
