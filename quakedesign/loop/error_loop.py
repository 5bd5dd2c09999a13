"""Error loops of a linear law and a fault as exact periodic systems.

Chapters: sampled law with zero-order hold, delay, lag and diffusion path; idealised law in continuous time; sampled law
about slow sliding with rate-and-state friction, without inertia.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import apart, shortly
from quakedesign.laws.sampled_law import NOISES, LinearLaw, Matrix, NominalModel, Row, require_sizes, steady_states
from quakedesign.loop.diffusion_path import MODES, DiffusionPath
from quakedesign.loop.periodic import EVEN, Fading, Instants, PeriodicLoop, Pulse, Segment
from quakedesign.loop.signals import Interconnection, Signal

# ----------------------------------------------------------------------
# Sampled linear law on a fault: sample, zero-order hold, delay, lag, and diffusion between well and fault.

MOST_PERIODS = 8
SHORTEST = 32  # largest T_s/(L²/D): through a shorter path all modes decay within one piece of the period
BENT = tuple(
    Fraction(v, 128) for v in (0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128)
)  # denser at first, where a lag and the diffusion modes change fastest
HALVES = tuple(Fraction(v, 2) for v in (0, 1, 2))
_ONE = Fraction(1)


def sampled_error_loop(
    law: LinearLaw,
    model: NominalModel,
    authority: Fraction,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    diffusion: Fraction = Fraction(0),
    noisy: Collection[str] = (),
    instants: Instants | None = None,
) -> PeriodicLoop:
    """Error loop of a fault about p*, the equilibrium pressure at the reference.

    At every multiple of T_s the law measures e1 and e2, computes p and updates its states. p reaches the valve after
    the delay, with a zero-order hold of T_s. The well pressure follows the valve with the lag, and the fault pressure
    follows the well by diffusion.

    States, in this order: e1; e2; the law's states; delayed pressures; valve pressure; with a lag, well minus valve
    pressure; with a diffusion path, mode minus well pressures; with this path and no lag, the last step of the valve
    pressure. The law's states are relative to those that command p* with zero errors; pressures are b·(p − p*).

    Inputs: ``acceleration`` a in e2' = s·e1 − w·e2 + βb(p − p*) + a [m/s²]; ``drift`` b·dp*/dt [m/s³]. Outputs:
    ``slip_error`` [m]; ``slip_rate_error`` [m/s]; ``push`` b·(p − p*) in the fault [m/s²]; with a lag or a diffusion
    path ``asked``, b·(p − p*) at the valve [m/s²]. ``push`` excludes the truncation error of the diffusion modes. The
    output ``left_out`` [m/s²] bounds this error, and without a lag an input of the same name acts on e2'.

    With an implicit step the nominal loop has w = −γe1/T_s, γ the midpoint of the slopes; the deviation w + γe1/T_s
    [m/s] is the sampled input ``root``. The measurement errors in `noisy` are the sampled inputs ``slip_noise`` [m] and
    ``rate_noise`` [m/s]; they enter the law, and w, as e1 and e2 do. For a law that also uses r and r′ there are two
    inputs in r′ [m/s]: ``reference`` moves the law's states away from those that command p* at r; the sampled
    ``reference_rate`` is the law's term in r′.

    With timing errors the last step of the valve pressure is also a state, and the output ``stepped`` [m/s²]. The input
    ``late`` is b times the deviation of the valve pressure from its schedule. Its size is at most that of the previous
    or the next pressure step, and it is nonzero only near the arrivals. During the timing error and the ramp, p*
    drifts: ``push`` (or ``asked``, where the fault pressure is not the valve pressure) changes by ``drift`` times this
    duration.

    Parameters
    ----------
    law, model : LinearLaw, NominalModel
        Law, and midpoints of the ranges of the plant.
    authority : Fraction
        b [m²/kg].
    step, delay, lag : Fraction
        [s]; the delay at most 8 periods.
    diffusion : Fraction
        L²/D of the diffusion path between well and fault [s]; 0 for none.
    noisy : collection of str
        Which of ``slip_noise`` and ``rate_noise`` are inputs.
    instants : Instants, optional
        Timing errors; None for exact timing without the output ``stepped``. Not with a diffusion path.

    Raises
    ------
    ParameterError
        For a law with a steady-state error under a constant p*; a step that is not positive; a negative time; a delay
        above 8 periods; 0 < L²/D < T_s/32; L²/D with timing errors; timing errors that let events overlap.
    """
    gain, outputs = model.gain / authority, {"slip_error": "e1", "slip_rate_error": "e2", "push": "push"}
    outputs |= ({"left_out": "left_out"} if diffusion else {}) | ({"asked": "valve"} if lag or diffusion else {})
    system, loop = _connected(
        law,
        authority,
        _Times(step=step, delay=delay, lag=lag, diffusion=diffusion, inexact=instants is not None),
        rates={"e1": {"e2": _ONE}, "e2": {"e1": model.slip, "e2": -model.rate, "push": gain}},
        signals={},
        inputs={"acceleration": {"e2": _ONE}, "drift": {}},
        outputs=outputs if instants is None else {**outputs, "stepped": "stepped"},
        of_left_out={"e2": _ONE},
        noisy=noisy,
    )
    if instants is None:
        return loop
    part, lead, after = delay % step, instants.arrived, instants.arrived + instants.ramp
    instants.require_within(step, part)
    if not after:
        return loop
    entry = system.column({"behind": 1 / lag} if lag else {"e2": gain})
    late = Pulse(entry=entry, first=int(part > 0), early=lead, late=after, before=lead, after=lead + instants.ramp / 2)
    return replace(loop, pulses={"late": late}, feedthrough={("asked" if lag else "push", "drift"): after})


def starts(
    law: LinearLaw, size: int, errors: tuple[Fraction, Fraction], noise: tuple[Fraction, Fraction]
) -> tuple[Row, ...]:
    """Columns of the box of initial states of a sampled loop, see `PeriodicLoop.start`.

    Pressures are 0, and errors are within their bounds [m], [m/s]. The law's states follow from the measured errors,
    whose noise is within its bounds.
    """
    initial = list(zip(*law.first, strict=True)) or [(Fraction(0),) * len(law.states)] * 2
    zeros = [Fraction(0)] * (size - 2 - len(law.states))
    columns = [(error, [Fraction(k == 0), Fraction(k == 1), *initial[k], *zeros]) for k, error in enumerate(errors)]
    columns += [(bound, [Fraction(0), Fraction(0), *initial[k], *zeros]) for k, bound in enumerate(noise)]
    return tuple(tuple(bound * v for v in column) for bound, column in columns if bound and any(column))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Times:
    """Times of the path of the pressure [s], and whether events have timing errors."""

    step: Fraction
    delay: Fraction
    lag: Fraction
    diffusion: Fraction
    inexact: bool = False

    def __post_init__(self) -> None:
        step, delay, lag, diffusion = self.step, self.delay, self.lag, self.diffusion
        if step <= 0:
            raise ParameterError(f"step of a loop must be positive. Received {shortly(step)} s.")
        if not 0 <= delay <= MOST_PERIODS * step:
            received, longest = apart(delay, MOST_PERIODS * step)
            raise ParameterError(
                f"delay must be 0 to {MOST_PERIODS} steps, here {longest} s. Received {received} s. "
                f"{'Shorten the delay, or lengthen the step.' if delay > 0 else 'Omit the minus sign.'}"
            )
        if lag < 0:
            raise ParameterError(f"lag must be 0 or more. Received {shortly(lag)} s. Omit the minus sign.")
        if diffusion and SHORTEST * diffusion < step:
            least, received = apart(step / SHORTEST, diffusion)
            raise ParameterError(
                f"the diffusion time L^2/D must be 0, or at least T_s/{SHORTEST} = {least} s. "
                f"Received {received} s. Omit diffusion, or shorten the step."
            )
        if diffusion and self.inexact:
            raise ParameterError(
                "no guarantee with a diffusion path covers jitter, averaging or the rate limit of a pump. Received "
                f"L^2/D = {shortly(diffusion)} s with one of them. Omit diffusion, or jitter, averaging and rate limit."
            )


def _connected(
    law: LinearLaw,
    authority: Fraction,
    times: _Times,
    *,
    rates: dict[str, Signal],
    signals: dict[str, Signal],
    inputs: dict[str, Signal],
    outputs: dict[str, str],
    of_left_out: Signal,
    noisy: Collection[str],
) -> tuple[Interconnection, PeriodicLoop]:
    """Loop of a law, the path of its pressure, and a plant with the states e1 and e2 that ``push`` acts on.

    `rates` and `signals` are those of the plant. `of_left_out` is the input column of the truncation error of the
    diffusion modes. The ``drift`` is added to the inputs.
    """
    step, lag, path, part = times.step, times.lag, DiffusionPath(time=times.diffusion), times.delay % times.step
    # the law
    own, measured = tuple(f"law {i}" for i in range(len(law.states))), ("slip", "slip_rate", "implicit")
    rows = zip((*law.measured, law.feedback), (*law.update, law.output), strict=True)
    *updates, output = (dict(zip((*measured[: len(e)], *own), (*e, *z), strict=True)) for e, z in rows)
    for signal, (_, by_rate) in zip((*updates, output), law.of_reference, strict=False):
        signal["reference_rate"] = by_rate
    # the path: delay line, valve, well, diffusion modes, and the last step of the valve
    line = tuple(f"waiting{i}" for i in range(int(times.delay // step) + (part > 0)))
    well: Signal = {"behind": 1 / lag} if lag else {}
    modes = {f"layer{i}": i for i in range(MODES if times.diffusion else 0)}
    stepped = times.inexact or (modes and not lag)
    pressures = (*line, "valve", *well, *modes, *["stepped"] * bool(stepped))
    system = Interconnection(
        ("e1", "e2", *own, *pressures),
        {
            "slip": {"e1": _ONE, "slip_noise": _ONE},
            "slip_rate": {"e2": _ONE, "rate_noise": _ONE},
            "implicit": {} if law.implicit_step is None else {"slip": -law.implicit_step.middle / step, "root": _ONE},
            "asked": {name: authority * v for name, v in output.items()},
            "push": {"valve": _ONE}
            | ({"behind": _ONE} if lag else {})
            | {name: path.share(n) for name, n in modes.items()},
            **signals,
        },
    )
    sample = dict(zip((*own, *line), (*updates, *({name: _ONE} for name in ("asked", *line))), strict=False))
    newest = ("asked", *line)[-1]
    arrival = {"valve": {newest: _ONE}, "stepped": {newest: _ONE, "valve": -_ONE}}
    arrival |= {name: {name: _ONE, newest: -_ONE, "valve": _ONE} for name in well or modes}
    events = [(sample, part), (arrival, step - part)] if part else [(sample | arrival, step)]
    flow = {**rates, "behind": {name: -v for name, v in well.items()}}
    flow |= {name: {name: -path.rate(n), **well} for name, n in modes.items()}
    # states are relative to those at which the law commands p*, at the reference
    change = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
    steady = steady_states(change, law.output, (Fraction(0),) * len(own), _ONE)
    drift = {name: -v / authority for name, v in zip(own, steady, strict=True)}
    inputs = {**inputs, "drift": drift | dict.fromkeys((*line, "valve"), -_ONE)}
    if law.of_reference:
        *rates_of_states, pressure = (-row[0] for row in law.of_reference)
        steady = steady_states(change, law.output, tuple(rates_of_states), pressure)
        inputs.setdefault("reference", {name: -v for name, v in zip(own, steady, strict=True)})
    sampled = (*["root"] * (law.implicit_step is not None), *["reference_rate"] * bool(law.of_reference))
    left_out, fading = dict[str, Signal](), dict[str, Fading]()
    if modes and lag:
        left_out["left_out"] = {"behind": path.truncation_integral / lag}
    elif modes:
        height, rate, floor = path.truncation_bound(step)
        most, entry = height + floor, system.column(of_left_out)
        left_out["left_out"] = {"stepped": most}
        fading["left_out"] = Fading(
            entry=entry, first=int(part > 0), height=height / most, rate=rate, floor=floor / most
        )
    ends, past_ends = (BENT, HALVES) if modes else (BENT if lag else EVEN, EVEN)
    jumps = ((system.jump(changed), time) for changed, time in events)
    return system, PeriodicLoop(
        states=("e1", "e2", *law.states, *pressures),
        flow=system.flow(flow),
        segments=tuple(Segment(jump=jump, duration=time, ends=ends, past_ends=past_ends) for jump, time in jumps),
        inputs={name: system.column(entries) for name, entries in inputs.items()},
        outputs={name: system.row(left_out.get(signal, {signal: _ONE})) for name, signal in outputs.items()},
        sampled={
            name: system.entry(events[0][0], name) for name in (*sampled, *(name for name in NOISES if name in noisy))
        },
        fading=fading,
    )


# ----------------------------------------------------------------------
# Linear law in continuous time with a pressure without delay: idealised loop without sampling.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousLaw:
    """p = Cz + Dy + R(r, r′) and z′ = Fz + Gy at every time, y = (e1, e2), z(0) = 0, r the reference.

    Attributes
    ----------
    states : tuple of str
        Names of z; their units are the law's own.
    rates : tuple of rows
        F [1/s].
    measured : tuple of rows
        G, two columns: for e1 [m] and e2 [m/s].
    output : tuple of Fraction
        C, so that Cz is in Pa.
    feedback : (Fraction, Fraction)
        D [Pa/m, Pa·s/m].
    of_reference : (Fraction, Fraction)
        R [Pa/m, Pa·s/m]: D for a law that feeds back slip and slip rate, 0 for one that feeds back their errors.

    Raises
    ------
    ParameterError
        When the dimensions do not match, or there are more than 12 states.
    """

    states: tuple[str, ...]
    rates: Matrix
    measured: Matrix
    output: Row
    feedback: Row
    of_reference: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))

    def __post_init__(self) -> None:
        require_sizes(self.states, self.rates, self.measured, self.output, self.feedback)


def exact_integrals(gains: tuple[Fraction, ...], *, of_state: bool = False) -> ContinuousLaw:
    """The e-LQR in continuous time: p = −k1e1 − k2e2 − k3ξ1 − k4ξ2, ξ1′ = e1, ξ2′ = ξ1, without unused integrals.

    Parameters
    ----------
    gains : tuple of Fraction
        k1 … k4 [Pa/m, Pa·s/m, Pa/(m s), Pa/(m s²)].
    of_state : bool
        Whether k1 and k2 act on slip and slip rate, as printed in the paper, instead of on their errors.

    Raises
    ------
    ParameterError
        When there are not four gains.
    """
    if len(gains) != 4:
        raise ParameterError(f"gains of exact_integrals must be four. Received {len(gains)}. Give k1 to k4.")
    k1, k2, k3, k4 = gains
    zero, one = Fraction(0), Fraction(1)
    used = 2 if k4 else 1 if k3 else 0
    return ContinuousLaw(
        states=("xi1", "xi2")[:used],
        rates=tuple(row[:used] for row in ((zero, zero), (one, zero))[:used]),
        measured=((one, zero), (zero, zero))[:used],
        output=(-k3, -k4)[:used],
        feedback=(-k1, -k2),
        of_reference=(-k1, -k2) if of_state else (zero, zero),
    )


def continuous_loop(law: ContinuousLaw, model: NominalModel, authority: Fraction) -> PeriodicLoop:
    """The error loop about p*, with the inputs and outputs of `sampled_error_loop`; states e1, e2 and z − z*.

    z* = ζ(p* − R(r, r′)) − ηR(r, r′)′ with Fζ = 0, Cζ = 1, Fη = ζ and Cη = 0, so that Cz* + R(r, r′) = p*. The entries
    of R that are not 0 add the inputs ``reference_acceleration`` r″ and ``reference_jerk`` r‴, through ηR(r, r′)″.

    Parameters
    ----------
    law : ContinuousLaw
    model : NominalModel
        Midpoints of the ranges.
    authority : Fraction
        b [m²/kg].

    Raises
    ------
    ParameterError
        For a law with a steady-state error under a constant p*, or with R not 0 and fewer than two integrals.
    """
    zeros = (Fraction(0),) * len(law.states)
    steady = steady_states(law.rates, law.output, zeros, _ONE)
    own = tuple(f"law {i}" for i in range(len(law.states)))
    rows = zip((law.feedback, *law.measured), (law.output, *law.rates), strict=True)
    acceleration, *rates = (dict(zip(("e1", "e2", *own), (*fed, *row), strict=True)) for fed, row in rows)
    system = Interconnection(("e1", "e2", *own), {"push": {name: authority * v for name, v in acceleration.items()}})
    plant = {"e1": model.slip, "e2": -model.rate, "push": model.gain / authority}
    inputs = {
        "acceleration": {"e2": _ONE},
        "drift": {name: -v / authority for name, v in zip(own, steady, strict=True)},
    }
    for name, fed in zip(("reference_acceleration", "reference_jerk"), law.of_reference, strict=True):
        if fed:
            moving = steady_states(law.rates, law.output, steady, Fraction(0))
            inputs[name] = {state: fed * v for state, v in zip(own, moving, strict=True)}
    outputs = {"slip_error": "e1", "slip_rate_error": "e2", "push": "push"}
    return PeriodicLoop(
        states=("e1", "e2", *law.states),
        flow=system.flow({"e1": {"e2": _ONE}, "e2": plant, **dict(zip(own, rates, strict=True))}),
        segments=(),
        inputs={name: system.column(entries) for name, entries in inputs.items()},
        outputs={name: system.row({signal: _ONE}) for name, signal in outputs.items()},
    )


# ----------------------------------------------------------------------
# Sampled linear law about slow sliding of a fault with rate-and-state friction, without inertia.

StateLaw = Literal["ageing", "slip"]


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingModel:
    """Nominal model about sliding at V: v = Ve^y, θ = (D/V)e^z, slip error x, q = p − p*.

    strength·y + weakening·z = −stiffness·x + coefficient·q + e with the stress input e of `sliding_loop` [Pa], x′ =
    V·c·y, z′ = −ρ(c_y·y + c_z·z), ρ = V/D. With all slopes 1 this is the linearisation about sliding at V, the same for
    both state laws. N is the effective normal stress [Pa], and D the characteristic slip distance [m].

    Attributes
    ----------
    rate : Fraction
        V [m/s].
    state_rate : Fraction
        ρ [1/s].
    slope : Fraction
        c [-], which replaces (e^y − 1)/y.
    state_slope : Fraction
        c_z [-], which replaces (1 − e^{−z})/z in the ageing law, and e^y in the slip law.
    strength : Fraction
        Stress per change of y: N·a plus the damping term [Pa].
    weakening : Fraction
        N·b [Pa].
    direct, evolution : Fraction
        a and b [-].
    stiffness : Fraction
        Stiffness of the spring [Pa/m].
    coefficient : Fraction
        Friction coefficient [-] of sliding at V.
    state_law : str
        ``"ageing"`` (Dieterich), z′ = −ρ(e^y − e^{−z}), or ``"slip"`` (Ruina), z′ = −ρe^y(y + z).
    """

    rate: Fraction
    state_rate: Fraction
    slope: Fraction
    state_slope: Fraction
    strength: Fraction
    weakening: Fraction
    direct: Fraction
    evolution: Fraction
    stiffness: Fraction
    coefficient: Fraction
    state_law: StateLaw = "ageing"

    @property
    def evolution_slope(self) -> Fraction:
        """c_y [-]: c for the ageing law, and c_z for the slip law, which depends on y + z."""
        return self.slope if self.state_law == "ageing" else self.state_slope


def sliding_loop(
    law: LinearLaw,
    model: SlidingModel,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    diffusion: Fraction = Fraction(0),
    noisy: Collection[str] = (),
) -> PeriodicLoop:
    """The error loop about sliding at V, with events, pressure path and arguments as in `sampled_error_loop`.

    States: the slip error x [m] and z [-] in place of e1 and e2; pressures in Pa. Inputs: ``stress`` e [Pa], ``rate`` f
    [-] in x′ = V(cy + f) and, for ageing, in z′ = −ρ(cy + c_z·z + f), ``state`` h [-] in z′ = … − ρh, the ``drift``
    dp*/dt [Pa/s], and ``reference`` g [-], the relative excess of the reference rate over V, in x′ = … − Vg.
    Outputs: ``slip_error`` x [m], ``log_rate`` y, ``log_state`` z, ``ageing`` c_y·y + c_z·z, ``strength`` a·y + b·z,
    ``push`` q [Pa], ``asked`` [Pa], valve pressure minus p*, and with a diffusion path ``left_out`` [Pa].
    ``log_rate``, ``ageing`` and ``strength`` exclude the direct feedthrough of e and of the truncation error
    (`at_once`); ``push`` excludes the truncation error.

    Raises
    ------
    ParameterError
        As for `sampled_error_loop`.
    """
    moving, aged = model.rate * model.slope, model.state_rate * model.evolution_slope
    stress = {"e1": moving / model.strength, "e2": -aged / model.strength}
    balance = {"push": model.coefficient, "e1": -model.stiffness, "e2": -model.weakening}
    outputs = {"slip_error": "e1", "log_rate": "log_rate", "log_state": "e2"}
    outputs |= {name: name for name in ("ageing", "strength", "push")}
    return _connected(
        law,
        _ONE,
        _Times(step=step, delay=delay, lag=lag, diffusion=diffusion),
        rates={"e1": {"log_rate": moving}, "e2": {"ageing": -model.state_rate}},
        signals={
            "log_rate": {name: v / model.strength for name, v in balance.items()},
            "ageing": {"log_rate": model.evolution_slope, "e2": model.state_slope},
            "strength": {"log_rate": model.direct, "e2": model.evolution},
        },
        inputs={
            "stress": stress,
            "rate": {"e1": model.rate} | ({"e2": -model.state_rate} if model.state_law == "ageing" else {}),
            "state": {"e2": -model.state_rate},
            "drift": {},
            "reference": {"e1": -model.rate},
        },
        outputs={**outputs, "asked": "valve"} | ({"left_out": "left_out"} if diffusion else {}),
        of_left_out={name: model.coefficient * v for name, v in stress.items()},
        noisy=noisy,
    )[1]


def at_once(model: SlidingModel) -> dict[tuple[str, str], Fraction]:
    """Direct feedthrough [1/Pa] of ``stress`` and ``left_out``, by (output, input)."""
    shares = {"log_rate": _ONE, "ageing": model.evolution_slope, "strength": model.direct}
    sizes = {"stress": 1 / model.strength, "left_out": model.coefficient / model.strength}
    return {(output, name): share * size for output, share in shares.items() for name, size in sizes.items()}
