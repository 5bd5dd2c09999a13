"""Options of runs of faults whose friction has a state."""

from dataclasses import asdict, dataclass, is_dataclass
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Group, Parameter

from quakedesign.cli.option_values import Pascals, Seconds
from quakedesign.cli.shared import given, refuse
from quakedesign.errors import ParameterError

if TYPE_CHECKING:
    from quakedesign.cli.options import LawOptions
    from quakedesign.fault import Fault
    from quakedesign.simulation.recording import Recording
    from quakedesign.studies.single import Choice

_GROUP = Group("Friction with a state (rate-and-state)")
_BOTH = {"duration": "duration", "plant": "plant", "method": "method"}
_FREE = {"drift": "loading_rate", **_BOTH}
_HELD = {"step": "step", "lag": "lag", "diffusion": "diffusion", **_BOTH}
_OF_LAW = ("step", "delay", "lag", "diffusion")  # what a certificate says itself
_PUMP = ("delay", "jitter", "quantum", "saturation", "withdrawal", "rate_limit")
_READING = {"slip_noise": "deviation", "bandwidth": "bandwidth", "slip_quantum": "quantum", "seed": "seed"}
_AROUND = ("fault", "controller", "gains", "state", "out", "force", "json")


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True)
class StateOptions:
    """How such a fault starts, and which pressure acts on it; it is loaded at --drift, or the law's reference rate.

    Parameters
    ----------
    pressure
        '5 MPa'; or instants, linear between and a step where one stands twice, as '0 s: 0 MPa, 1 day: 0 MPa, 1 day: 5
        MPa'; or a file FILE.csv with the columns 'time [s]' and 'pressure [Pa]', in any units.
    start
        steady (sliding; unless given), locked (held for --hold) or late (in the cycle: --share).
    hold
        Time for which the far end has been at rest before the run, such as '100 year'.
    share
        Of the time between two events that has passed at the start; 0.9 unless given.
    stress
        With --controller elqr: amplitude of a shear stress on the fault that swings as a sine, such as '20 kPa'.
    stress_period
        Its period; that of the tide, 12.42 hours, unless given.
    """

    pressure: str | None = None
    start: str | None = None
    hold: Seconds | None = None
    share: float | None = None
    stress: Pascals | None = None
    stress_period: Seconds | None = None

    def of_control(self) -> dict[str, Any]:
        """Those of a controlled run that are given."""
        if any(value is not None for value in (self.pressure, self.start, self.hold, self.share)):
            raise ParameterError(
                "a controlled run starts in steady sliding, and its law sets the pressure. Received pressure, start, "
                "hold or share. Leave them out."
            )
        return given({"stress": self.stress, "stress_period": self.stress_period})

    def of_free(self) -> dict[str, Any]:
        """Those of a run without control that are given."""
        from quakedesign.simulation import pressure_course

        if self.stress is not None or self.stress_period is not None:
            raise ParameterError("a stress disturbance needs a controller. Received none. Give --controller elqr.")
        told = given({"start": self.start, "hold": self.hold, "share": self.share})
        return told | ({} if self.pressure is None else {"pressure": pressure_course(self.pressure)})


NO_STATE = StateOptions()


def require_no_state_options(state: StateOptions, fault: "Fault") -> None:
    """Refuse options that friction without a state has no use for."""
    if state != NO_STATE:
        raise ParameterError(
            "pressure, start, hold, share and stress need friction with a state. "
            f"Received {fault.friction.name}. Leave them out."
        )


def show_state_run(fault: "Fault", command: Any, options: dict[str, Any]) -> int:
    """Run a fault whose friction has a state as `simulate` was asked to, and print what it comes to."""
    from quakedesign.report.state_runs import sliding_run_lines, state_run_lines
    from quakedesign.studies.state_runs import run_held, run_state

    asked, changed = _single(options), changed_options(command, options)
    trajectory: Recording
    certificate = changed.pop("certificate", None)
    if certificate is not None:
        told = _as_proved(fault, certificate, changed, options)
        held, more = run_held(fault, **told), told["stress"] > told["claim"].task.stress
        outside = [*(["stress"] if more else []), *(name for name in changed if name in (*_PUMP, *_READING, "plant"))]
        trajectory, answer = held.trajectory, held.to_dict() | {"outside": [n for n in outside if n != "seed"]}
        lines = sliding_run_lines
    elif "controller" in changed:
        _require_designed(asked)
        held = run_held(fault, **_instruments(fault, changed, options), **options["state"].of_control())
        trajectory, answer, lines = held.trajectory, held.to_dict(), sliding_run_lines
    else:
        free = run_state(fault, **_told(fault, changed, _FREE), **options["state"].of_free())
        trajectory, answer, lines = free.trajectory, free.to_dict(), state_run_lines
    if options["out"] is not None:
        trajectory.save(Path(options["out"]))
    options["output"].show(answer, [trajectory.name, *(f"  {line}" for line in lines(answer))])
    return 0


def changed_options(command: Any, options: dict[str, Any]) -> dict[str, Any]:
    """What was given to a command other than its defaults, by the names of single options; those of the state apart."""
    usual = _single({name: option.default for name, option in signature(command).parameters.items()})
    return {name: value for name, value in _single(options).items() if value != usual[name]}


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True)
class SpreadOptions:
    """What varies in a campaign of such a fault.

    Parameters
    ----------
    spread
        Held in slow sliding by the e-LQR that design finds: by how much of their values a, b and D_c are off, such as
        0.1; the effective normal stress, stiffness and damping by the box.
    stress
        Bound of a sine of shear stress, such as '25 kPa'; what is proved of the design unless given.
    stress_period
        Its period; that of the tide, 12.42 hours, unless given.
    """

    spread: str = "0"
    stress: Pascals | None = None
    stress_period: Seconds | None = None

    def choose(
        self, fault: "Fault", law: "LawOptions", step: float | None, path: dict[str, float]
    ) -> tuple["Choice | None", dict[str, Any]]:
        """Law of a campaign, and what it is told of spread and stress, which friction without a state does not have.

        With a state it is the law that `design` finds for the nominal normal stress, stiffness and damping, whatever
        the box of the campaign.

        Raises
        ------
        ParameterError
        """
        if not fault.friction.state_names:
            if self != SpreadOptions():
                raise ParameterError(
                    f"spread and stress need friction with a state. Received {fault.friction.name}. Leave them out."
                )
            return law.choose(fault, step, path), {}
        from quakedesign.rationals import rational
        from quakedesign.studies.single import Choice
        from quakedesign.synthesis import design

        period = {} if self.stress_period is None else {"stress_period": self.stress_period}
        if law.certificate is not None and (chosen := law.choose(fault.with_box("paper"))):
            return chosen, _of_proof(chosen.claim, self.spread, self.stress) | period
        _require_designed({"controller": law.controller, "gains": law.gains})
        off = rational(self.spread, "spread")
        diffusion = path.get("diffusion")
        designed = design(fault.with_box("paper"), "elqr", diffusion=diffusion, stress=self.stress, spread=off)
        if designed.controller is None or designed.sliding is None:
            raise ParameterError(f"a campaign needs a law. Received none from design: {designed.details['reason']}.")
        told = {"spread": off, "stress": float(designed.sliding.task.stress)}
        return Choice(controller=designed.controller), told | period


def _of_proof(claim: Any, spread: str, stress: float | None) -> dict[str, Any]:
    """Spread and stress of a campaign with the law of a certificate: all that it is proved for unless told.

    Raises
    ------
    ParameterError
        For a delay or noise, which campaigns of slow sliding do not have.
    """
    from quakedesign.rationals import rational

    if claim.held.delay or claim.held.slip_noise:
        raise ParameterError(
            "a campaign of slow sliding is told the slip at once and as it is. Received a certificate with a delay or "
            "noise. Use simulate --certificate."
        )
    low, high = claim.task.ranges["direct_effect"]
    off = rational(spread, "spread") or (high - low) / (high + low)
    return {"spread": off, "stress": float(claim.task.stress) if stress is None else stress}


def _as_proved(fault: "Fault", certificate: Path, changed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """The law of a certificate around its fault, under a sine of all the stress that it is proved for unless told.

    The reading is off by at most the noise of the certificate: the nearest multiple of twice that.
    """
    from quakedesign.loop.sensing import Transducer

    claim = options["law"].choose(fault).claim
    refuse({name: changed.get(name) for name in _OF_LAW}, f"{certificate}, whose law has its own")
    told = {"stress": float(claim.task.stress)} | options["state"].of_control()
    told |= _instruments(fault, {**changed, "step": float(claim.held.step)}, options)
    if told["transducer"] is None and claim.held.slip_noise:
        told["transducer"] = Transducer(quantum=2 * float(claim.held.slip_noise))
    return {**told, "step": None, "claim": claim}


def _instruments(fault: "Fault", changed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """What a controlled run was asked for, the pump and the transducer made of their options."""
    from quakedesign.loop.sensing import Transducer

    others = {name: value for name, value in changed.items() if name not in (*_PUMP, *_READING)}
    told = _told(fault, others, _HELD, (*_PUMP, *_READING))
    chain = options["actuator"].build(told.get("step", fault.sampling_time), options["seed"])
    reading: dict[str, Any] = {_READING[name]: value for name, value in changed.items() if name in _READING}
    transducer = Transducer(**reading) if set(reading) - {"seed"} else None
    return told | {"stages": chain.sampled, "transducer": transducer}


def _told(fault: "Fault", changed: dict[str, Any], taken: dict[str, str], more: tuple[str, ...] = ()) -> dict[str, Any]:
    """What was asked for, by the name that a run has for it; refuses what does not apply."""
    if foreign := [name for name in changed if name not in (*taken, *_AROUND)]:
        kind = f"friction with a state {'with' if taken is _HELD else 'without'} control"
        raise ParameterError(
            f"{', '.join(foreign)}: not for {kind}. Received {fault.friction.name}. "
            f"Leave out what is not among {', '.join((*taken, *more))} and the options of friction with a state."
        )
    return {taken[name]: value for name, value in changed.items() if name in taken}


def _require_designed(options: dict[str, Any]) -> None:
    if options["controller"] != "elqr" or tuple(options["gains"]) not in (("published",), ("designed",)):
        raise ParameterError(
            "friction with a state is controlled by elqr with designed gains; no sliding mode, as the slip rate "
            f"follows the pressure at once. Received {options['controller']}. Give --controller elqr."
        )


def _single(options: dict[str, Any]) -> dict[str, Any]:
    """Options of all groups but that of the state, by their own names."""
    groups = [name for name, value in options.items() if is_dataclass(value) and name != "state"]
    alone = {name: value for name, value in options.items() if name not in groups}
    return alone | {name: value for group in groups for name, value in asdict(options[group]).items()}
