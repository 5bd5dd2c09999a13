"""`quakedesign.guarantee`: proved bounds of a sampled loop, for given laws or designs."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from fractions import Fraction
from typing import Any, TypeVar

from quakedesign.errors import ParameterError, QuakedesignError, require_known
from quakedesign.exact import exact_text, rational
from quakedesign.fault import BlockChain, Fault, with_accepted_fit
from quakedesign.fault.equilibrium import STEADY_SLIDING
from quakedesign.fault.units import exact_value
from quakedesign.guarantees import (
    CLASSES,
    OBJECTIVES,
    Guarantee,
    NoProof,
    PlantGuarantee,
    StickSlipProof,
    TrackingGuarantee,
    TrackingProof,
)
from quakedesign.guarantees.exact.limit_theorems import infeasibility, too_slow
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.exact.sliding_blocks import SlidingBlocks
from quakedesign.guarantees.search.linear_design import nearest_setup
from quakedesign.guarantees.search.sliding_block_design import sliding_block_guarantee
from quakedesign.guarantees.sliding_result import guarantee_sliding
from quakedesign.guarantees.stick_slip_result import guarantee_stick_slip
from quakedesign.laws import Controller, control_law
from quakedesign.loop.loop_setup import IDEAL, LoopSetup, Quantity
from quakedesign.parallel import crew_or_here
from quakedesign.plant import FaultPlant, UncertainPlant, uncertain_plant
from quakedesign.synthesis.method import GuaranteeRequest, method_of
from quakedesign.synthesis.plant_guarantees import guarantee_plant
from quakedesign.synthesis.state_feedback import may_stick
from quakedesign.text import Progress, silent

Result = TypeVar("Result")


def guarantees_of(
    questions: Sequence[Callable[[], Result]],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Result | QuakedesignError]:
    """Results of several calls, in their order, computed in parallel; errors are results too.

    Parameters
    ----------
    questions : sequence of callable
        Calls without arguments that other processes can import, as ``partial(guarantee, fault, step=Fraction(1, 20))``.
    workers : int
        Number of processes; 1 computes in this one. Results do not depend on it.
    scheduler : str, optional
        Address of a dask.distributed scheduler that is used instead.
    executor : Executor, optional
        Any other executor of `concurrent.futures` that is used instead.
    progress : callable, optional
        Called with a progress text and the completed fraction [-].

    Raises
    ------
    SimulationError
        When the workers cannot be reached, or terminate.
    """
    results: dict[int, Result | QuakedesignError] = {}
    with crew_or_here(workers, scheduler, executor) as crew:
        for place, one in crew.results(_called, [(call,) for call in questions]):
            results[place] = one
            if progress is not None:
                progress(f"{len(results)} of {len(questions)} computed", len(results) / len(questions))
    return [results[place] for place in range(len(questions))]


def _called(call: Callable[[], Result]) -> Result | QuakedesignError:
    try:
        return call()
    except QuakedesignError as error:
        return error


STICK_SLIP, PRINTED = PLANTS = StickSlipProof.plant, TrackingProof.plant
BLOCK_LAWS = ("centralised", "decentralised")
"""Laws of several blocks: the pressure of each well depends on all measurements, or only on its own."""
_PUMP = ("saturation", "withdrawal", "rate_limit")
_OF_SLOW_SLIDING = ("step", "measured", "delay", "lag", "diffusion", "slip_noise", *_PUMP)


def guarantee(
    fault: Fault | BlockChain | UncertainPlant,
    controller: str | type[Controller] | Controller = "elqr",
    setup: LoopSetup = IDEAL,
    *,
    law: Any = None,
    objective: str = "tracking",
    gains: "Sequence[str | float | Fraction] | Sequence[Sequence[float]]" = (),
    scheme: str | None = None,
    disturbance_class: str = CLASSES[0],
    stress: Quantity | None = None,
    spread: Quantity = 0,
    plant: str | None = None,
    progress: Progress | None = None,
    accept_poor_fit: bool = False,
    **entered: Quantity | None,
) -> Guarantee:
    """Prove bounds on slip, slip rate and pressure of a sampled loop.

    The controller is designed for the loop setup unless gains are given.

    Parameters
    ----------
    fault : Fault, BlockChain or UncertainPlant
        For a `BlockChain` or an `UncertainPlant`, peaks of the outputs are proved for a law or gains; only law, gains,
        step, delay and lag apply. For several blocks (`UncertainPlant.from_blocks`, `load_chain`) the law is designed
        unless given; with rate-and-state friction they slide slowly, and lag and stress are required.
    controller : str, type of Controller, or SampledLaw
        ``elqr``; a sliding mode, ``cta`` or ``dia``; or a user-defined law. For several blocks ``centralised``
        (default), or ``decentralised``: the pressure of each well depends on its own measurements alone.
    setup : LoopSetup
        Sampling, delay, lag, diffusion path, noise, jitter, pump, initial errors. A user-defined law has its own T_s.
    law : SampledLaw or control.StateSpace, optional
        User-defined law; alternative to `controller`. A ``StateSpace`` in discrete time is for an `UncertainPlant`,
        from its measurements to its controls.
    objective : str
        For a design. ``peak``: nearly the smallest slip-rate error, as estimated in the search. ``tracking``: a smaller
        slip error under a drifting disturbance, with a somewhat larger slip-rate error.
    gains : sequence or array of str, float or Fraction, optional
        k1 to k4 [Pa/m, Pa·s/m, Pa/(m s), Pa/(m s²)] of an e-LQR whose integrals are summed once per sample, run by the
        scheme ``explicit``; or base gains of a sliding mode. A matrix of one row, as the K of ``control.dlqr``, is
        accepted.
    scheme : str, optional
        For a sliding mode: ``stick-slip`` unless given, or ``compensated`` on the plant without stick; no other has a
        guarantee. For the e-LQR ``explicit``.
    disturbance_class : str
        ``amplitude``: any measurable disturbance bounded by the fault's amplitude; ``rate``: its rate is bounded too.
    stress : str, float or Fraction, optional
        For rate-and-state friction: bound of the shear stress disturbance [Pa]; by default the largest that the design
        withstands.
    spread : str, float or Fraction
        For rate-and-state friction: relative uncertainty of a, b and D_c [-].
    plant : str, optional
        ``stick-slip``: friction holds the fault at rest and it never slips backward. The design is an e-LQR or a
        sliding mode whose predicted slip rate is never negative (`StickSlipLaw`), for an exact slip rate and a pressure
        without delay.
        ``printed``: the plant without stick, its friction continued to negative slip rates. By default the first where
        it applies and has a proof, else the second.
    progress : callable, optional
        Called with the current task of a search (rate-and-state friction, stick–slip plant) and the completed fraction.
    accept_poor_fit : bool
        Whether to continue for a fault whose friction is not supported by its record (`Fault.poor_fit`); its name then
        ends with ``poor-fit``.
    **entered : str, float or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Returns
    -------
    Guarantee
        With ``verdict``, ``bounds`` and ``worst_case`` (by name, SI units), ``reason``, ``sentence()``, ``check()``,
        ``controller`` for `simulate`, `loop_transfer` and `export_controller`, ``save(path)`` of the certificate and
        ``to_dict()``; ``lines()`` are the printed lines, and ``proof`` is the proof in exact numbers.

    Raises
    ------
    ParameterError
        For a quantity out of its range, one that does not apply to the friction or the controller, or a poor fit that
        is not accepted.
    UnsupportedError
        For a controller that does not apply to the friction.
    """
    setup = setup.with_given(**entered)
    if plant is not None:
        require_known(plant, PLANTS, "plant")
    uncertainty = exact_value(spread, "", "spread")
    chosen: dict[str, object] = {
        "plant": None if plant == PRINTED else plant,
        "objective": None if objective == OBJECTIVES[0] else objective,
        "class": None if disturbance_class == CLASSES[0] else disturbance_class,
        "gains": bool(len(gains)),
        "scheme": scheme,
        "spread": uncertainty,
    }
    if isinstance(fault, BlockChain):
        fault = replace(fault, fault=with_accepted_fit(fault.fault, accept_poor_fit))
        setup = setup if law is not None or setup.step else setup.with_given(step=rational(fault.fault.sampling_time))
        if fault.has_state:
            designed = controller in ("elqr", *BLOCK_LAWS)
            other = dict.fromkeys(sorted(setup.given().keys() - {"step", "lag"}), True)
            wrong = chosen | other | {"law": law is not None, "controller": None if designed else controller}
            if stress is None or _names(wrong):
                raise ParameterError(
                    "a guarantee of blocks in slow sliding needs stress (--stress) and lag (--lag, near D_c/(10 V)), "
                    f"and takes only step (--step, near D_c/(20 V)) besides. Received {_names(wrong) or 'no stress'}."
                )
            blocks = SlidingBlocks(chain=fault, lag=setup.lag, stress=exact_value(stress, "Pa", "stress"))
            assert setup.step is not None
            proof = sliding_block_guarantee(blocks, setup.step, decentralised=controller == BLOCK_LAWS[1])
            return PlantGuarantee(proof=proof)
        fault = UncertainPlant.from_blocks(fault)
    if isinstance(fault, UncertainPlant):
        of_blocks = law is None and not len(gains) and "slope of block 1" in fault.sectors
        named = isinstance(controller, str) and (controller == "elqr" or (of_blocks and controller in BLOCK_LAWS))
        wrong = chosen | {"gains": False, "stress": stress, "controller": None if named else controller}
        if received := _names(wrong):
            raise ParameterError(
                f"options of a fault do not apply to an uncertain plant. Received {received}. Omit these."
            )
        proof = guarantee_plant(fault, law, gains, setup, decentralised=controller == BLOCK_LAWS[1])
        return PlantGuarantee(proof=proof)
    fault = with_accepted_fit(fault, accept_poor_fit)
    if law is not None and not isinstance(law, Controller):
        raise ParameterError(
            f"law of a fault must be a SampledLaw. Received {type(law).__name__}. Use SampledLaw.from_statespace."
        )
    if law is None and isinstance(controller, Controller):
        law = controller
    elif law is not None and controller != "elqr":
        raise ParameterError("a controller must be given by law or by controller. Received both. Omit controller.")
    slides = fault.friction.equilibrium is STEADY_SLIDING
    if law is not None:
        wrong = chosen | {"class": None, "stress": stress, f"{fault.friction.name} friction": slides}
        if received := _names(wrong):
            raise ParameterError(
                "a given law has guarantees on the plant without stick, for friction without a state. Received "
                f"{received}. Omit these, or use a fault whose friction has no state."
            )
        require_known(disturbance_class, CLASSES, "class")
        task = uncertain_plant(fault, rate_limited=disturbance_class == "rate")
        return method_of(type(law)).given(fault, task, law, setup)
    assert not isinstance(controller, Controller)
    if STICK_SLIP in (plant, scheme) and plant != PRINTED:
        fault.friction.require(stick_slip=True)
        require_known(disturbance_class, CLASSES, "class")  # a proof for the class amplitude holds for the class rate
        family = control_law(controller)
        takes_gains = method_of(family).takes_base_gains
        wrong = {
            "controller": None if takes_gains or family.name == "elqr" else family.name,
            "gains": not takes_gains and bool(len(gains)),
            "scheme": None if takes_gains and scheme == STICK_SLIP else scheme,
            "stress": stress,
            "spread": uncertainty,
        }
        if received := _names(wrong):
            raise ParameterError(
                "a guarantee on the stick-slip plant needs a designed elqr or a sliding mode in the scheme stick-slip, "
                f"and friction without a state. Received {received}. Omit these."
            )
        require_known(objective, OBJECTIVES, "objective")
        mode = method_of(family).base_law(uncertain_plant(fault), family, _exact_texts(gains))
        return guarantee_stick_slip(fault, setup, objective=objective, sliding=mode, progress=progress)
    stress_bound = None if stress is None else exact_value(stress, "Pa", "stress")
    if slides:
        wrong = chosen | dict.fromkeys(sorted(setup.given().keys() - set(_OF_SLOW_SLIDING)), True) | {"spread": None}
        if received := _names(wrong):
            raise ParameterError(
                "slow sliding has a guarantee for a designed law of the slip alone, from steady sliding, under a "
                f"stress of bounded amplitude. Received {received}. Omit these options."
            )
        return guarantee_sliding(
            fault,
            controller=control_law(controller).name,
            step=setup.step,
            stress=stress_bound,
            spread=uncertainty,
            setup=ExactSetup.of(setup),
            progress=progress or silent,
        )
    if stress is not None or uncertainty:
        raise ParameterError(
            f"stress and spread need friction with a state. Received {fault.friction.name}. Omit both."
        )
    require_known(disturbance_class, CLASSES, "class")
    task, family = uncertain_plant(fault, rate_limited=disturbance_class == "rate"), control_law(controller)
    request = GuaranteeRequest(gains=_exact_texts(gains), objective=objective, scheme=scheme, setup=setup)
    not_at_rest = ""
    usual = scheme is None and (method_of(family).takes_base_gains or not request.gains)
    if plant is None and usual and may_stick(family, setup, disturbance_class):
        mode = method_of(family).base_law(task, family, request.gains)
        sticking = guarantee_stick_slip(fault, setup, objective=objective, sliding=mode, progress=progress)
        if sticking.proof.available:
            return sticking
        not_at_rest = sticking.proof.reason
    result = _sampled(fault, task, family, request)
    return replace(result, not_at_rest=not_at_rest) if not_at_rest else result


def _sampled(fault: Fault, task: FaultPlant, law: type[Controller], request: GuaranteeRequest) -> TrackingGuarantee:
    """Guarantee for a moving reference; without a design if this is infeasible for all pressures up to σ′."""
    setup, most = request.setup, rational(fault.effective_normal_stress)
    step = rational(fault.sampling_time) if setup.step is None else setup.step
    exact = ExactSetup.of(setup)
    delay = exact.delay
    infeasible = infeasibility(task, most, delay, setup.diffusion)
    if infeasible and not request.gains:
        near = nearest_setup(task, step, measured=setup.measured, setup=exact) if law.name == "elqr" else None
        return TrackingGuarantee(fault=fault, proof=NoProof(reason=infeasible), nearest=near)
    result = method_of(law).sampled(fault, task, law, step, request)
    slow = "" if request.gains else too_slow(task, most, max(step, setup.longest_step), delay)
    if not slow or result.proved:
        return result
    return replace(result, proof=NoProof(reason=slow))


def _names(wrong: Mapping[str, object]) -> str:
    """Names of the given options that do not apply (not None, 0 or False), each with its value unless that is True."""
    given = {name: value for name, value in wrong.items() if value is not None and value != 0}
    return ", ".join(name if value is True else f"{name} {_shown(value)}" for name, value in given.items())


def _shown(value: object) -> str:
    return str(value) if isinstance(value, Fraction) else repr(value)


def _exact_texts(gains: "Sequence[str | float | Fraction] | Sequence[Sequence[float]]") -> tuple[str, ...]:
    """Gains as exact texts; raises `ParameterError` for a gain that is not a finite number."""
    values: list[Any] = list(gains)
    if len(values) == 1 and not isinstance(values[0], str) and hasattr(values[0], "__len__"):
        values = list(values[0])
    return tuple(exact_text(rational(value, f"gain k{place}")) for place, value in enumerate(values, start=1))
