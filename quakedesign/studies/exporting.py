"""Export of a controller as C, with the settings of its differentiator."""

from pathlib import Path
from typing import Any

from quakedesign.fault import Fault
from quakedesign.laws import Controller
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.loop.sensing import OutputFeedback
from quakedesign.loop.sensing.measurement import EXACT
from quakedesign.simulation import export_controller
from quakedesign.simulation.export import FILES
from quakedesign.simulation.run_settings import sampled_scheme
from quakedesign.studies.single_runs import differentiator_premise, sensor


def export_result(
    fault: Fault,
    law: Controller,
    folder: Path,
    *,
    step: float | None = None,
    scheme: str | None = None,
    differentiator_bound: float | None = None,
    differentiator_order: int = 1,
    filter_order: int = 0,
    averaging: int = 1,
    differentiator_steps: int = 1,
    remarks: tuple[str, ...] = (),
    fmu: bool = False,
    force: bool = False,
) -> dict[str, Any]:
    """Export a controller; return its facts, files and, with a differentiator, the premise of the differentiator.

    Parameters
    ----------
    fault, law, folder, step, remarks, fmu, force
        As in `quakedesign.simulation.export_controller`.
    scheme : str, optional
        By default that of a sampled law, or ``explicit``.
    differentiator_bound : float, optional
        λ_d [m/s^(n_d + 1)] of a differentiator, whose estimates the law then uses.
    differentiator_order : int
        n_d of the differentiator.
    filter_order : int
        n_f of the differentiator.
    averaging : int
        Number of readings whose mean is the input of the differentiator.
    differentiator_steps : int
        Steps of the differentiator per reading.

    Returns
    -------
    dict
        ``step, measurement, memory, facts, remarks, files, premises``.
    """
    way, step, own = scheme_of_run(law, scheme, step)
    period = fault.sampling_time if step is None else step
    inner = {"order": differentiator_order, "averaging": averaging, "inner_steps": differentiator_steps}
    seen = sensor(period, EXACT, differentiator_bound, filter_order, **inner)
    chosen = sampled_scheme(way, measurement=seen, **own)
    exported = export_controller(fault, law, folder, step=step, scheme=chosen, remarks=remarks, fmu=fmu, force=force)
    premises = []
    if isinstance(seen, OutputFeedback):
        premises.append(differentiator_premise(fault, law, seen, scheme=chosen.name))
    files = [str(folder / name) for name in (FILES if fmu else FILES[:2])]
    return exported.to_dict() | {"files": files, "premises": [p.to_dict() for p in premises]}
