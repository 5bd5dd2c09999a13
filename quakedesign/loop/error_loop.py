"""Error loops of a linear law and a fault as exact periodic systems.

Chapters: sampled law with zero-order hold, delay, lag and diffusion path; idealised law in continuous
time; sampled law about slow sliding with rate-and-state friction, without inertia.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import apart, shortly
from quakedesign.laws.sampled_law import (
    NOISES,
    LinearLaw,
    Matrix,
    NominalModel,
    Row,
    require_sizes,
    steady_states,
    unit_row,
)
from quakedesign.loop.layer import MODES, Layer
from quakedesign.loop.periodic import EVEN, Fading, Instants, PeriodicLoop, Pulse, Segment

# ----------------------------------------------------------------------
# Sampled linear law on a fault: sample, zero-order hold, delay, lag, and diffusion between well and fault.

MOST_PERIODS = 8
SHORTEST = 32  # parts of a step: faster modes of a layer decay within less than the resolution of the bounds
BENT = tuple(
    Fraction(v, 128) for v in (0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128)
)  # as a lag and the modes of a layer do
HALVES = tuple(Fraction(v, 2) for v in (0, 1, 2))


def held_loop(
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

    Order of events: at every multiple of T_s the law measures e1 and e2, finds p, and updates its states; p reaches the
    valve after the delay and stays for T_s; the pressure in the well follows the valve with the lag, that in the fault
    the well's through a layer. States, in this order: e1, e2, the law's, the pressures on their way, the valve's, with
    a lag what the well's is more than the valve's, what those of the layer's modes are more than the well's, with a
    layer and no lag the valve's last step; those of the law less what they are while p = p* holds the fault at rest,
    pressures as b·(p − p*).

    Inputs: ``acceleration`` a in e2' = s·e1 − w·e2 + βb(p − p*) + a [m/s²]; ``drift`` b·dp*/dt [m/s³]. Outputs:
    ``slip_error`` [m], ``slip_rate_error`` [m/s], ``push`` b·(p − p*) [m/s²], with a layer but for what its modes leave
    out, which ``left_out`` bounds [m/s²] and, where the well steps, an input of this name brings into e2' by its share;
    where the fault's pressure is not the valve's, ``asked``, b·(p − p*) at the valve [m/s²].
    With an implicit root the loop has w = −γe1/T_s with the middle of its slopes, and w + γe1/T_s [m/s] is the sampled
    input ``root``. If asked for, what the measured e1 and e2 are more than the true ones are the sampled inputs
    ``slip_noise`` [m] and ``rate_noise`` [m/s]: the law does with them what it does with e1 and e2, w included.
    Of a law that is given r and r′ as well, r′ is an input twice: ``reference`` moves its states away from those that
    ask for p* at r, and the sampled ``reference_rate`` is what it makes of r′ [m/s].

    Where instants may be off there is one state more, the valve's last step, which the output ``stepped`` is [m/s²].
    The input ``late`` is b times what the valve's pressure is more than on schedule, at most its last step or the next
    one, and there near the arrivals alone; in the meantime p* drifts, so that ``push`` (or ``asked``, where the fault's
    pressure is not the valve's) gains ``drift`` times that time.

    Parameters
    ----------
    law : LinearLaw
    model : NominalModel
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].
    step, delay, lag : Fraction
        [s]; the delay at most 8 periods.
    diffusion : Fraction
        L²/D of the layer between well and fault [s]; 0 for none.
    noisy : collection of str
        Which of ``slip_noise`` and ``rate_noise`` are inputs.
    instants : Instants, optional
        Timing errors; None for exact timing if the last step is not needed. Not with a layer.

    Raises
    ------
    ParameterError
        For a law that leaves an error under a constant p*, or times that are negative or too long.
    """
    watched = instants is not None
    path = _Path(own=len(law.states), step=step, delay=delay, lag=lag, diffusion=diffusion, watched=watched)
    sample, arrival = _events(law, authority, path)
    n = path.size
    slope = Fraction(0) if law.root is None else law.root.middle / step
    jump = tuple((row[0] - slope * row[n], *row[1:n]) for row in sample)
    sampled = {} if law.root is None else {"root": tuple(row[n] for row in sample)}
    moving = {"reference": _reference_drift(law, path)} if law.of_reference else {}
    if law.of_reference:
        sampled["reference_rate"] = tuple(row[n + 1] for row in sample)
    for k, name in enumerate(NOISES):
        if name in noisy:
            sampled[name] = tuple(row[k] - (i == k) for i, row in enumerate(jump))
    ends, past_ends = (BENT, HALVES) if diffusion else (BENT if lag else EVEN, EVEN)
    maps = [(jump, path.part or step), *([(arrival, step - path.part)] if path.part else [])]
    left_out, fading = _left_out(path)
    push = _push(path)
    valve_output = {"asked": _unit(n, path.valve)} if lag or diffusion else {}
    loop = PeriodicLoop(
        states=("e1", "e2", *law.states, *(f"waiting{i}" for i in range(path.waiting)), "valve", *path.behind),
        flow=_flow(path, push, model, model.gain / authority),
        segments=tuple(Segment(jump=j, duration=time, ends=ends, past_ends=past_ends) for j, time in maps),
        inputs={"acceleration": _unit(n, 1), "drift": _drift(law, authority, path), **moving},
        outputs={"slip_error": _unit(n, 0), "slip_rate_error": _unit(n, 1), "push": push, **left_out, **valve_output},
        sampled=sampled,
        fading=fading,
    )
    return loop if instants is None else _off_schedule(loop, instants, path)


def _off_schedule(loop: PeriodicLoop, instants: Instants, path: "_Path") -> PeriodicLoop:
    """Loop whose last state is the last step of the valve, with the inputs of early and late pressures."""
    instants.require_within(path.step, path.part)
    n, pushed, off = path.size, loop.flow[1][path.valve], instants.arrived
    outputs, pulses, at_once = {**loop.outputs, "stepped": _unit(n, n - 1)}, {}, dict[tuple[str, str], Fraction]()
    if off or instants.ramp:
        place, size = (path.valve + 1, 1 / path.lag) if path.lag else (1, pushed)
        pulses["late"] = Pulse(
            entry=tuple(size * v for v in _unit(n, place)),
            first=int(path.part > 0),
            early=off,
            late=off + instants.ramp,
            before=off,
            after=off + instants.ramp / 2,
        )
        at_once["asked" if path.lag else "push", "drift"] = off + instants.ramp
    return replace(loop, outputs=outputs, pulses=pulses, at_once=at_once)


def starts(
    law: LinearLaw, size: int, errors: tuple[Fraction, Fraction], noise: tuple[Fraction, Fraction]
) -> tuple[Row, ...]:
    """Columns of the box of initial states of a sampled loop, see `PeriodicLoop.start`.

    Its pressures are 0, the errors within their bounds [m], [m/s], and the law's states what it makes of them as they
    are measured, within bounds of noise.
    """
    made = list(zip(*law.first, strict=True)) or [(Fraction(0),) * len(law.states)] * 2
    rest = [Fraction(0)] * (size - 2 - len(law.states))
    columns = [(error, [*_unit(2, k), *made[k], *rest]) for k, error in enumerate(errors)]
    columns += [(off, [Fraction(0), Fraction(0), *made[k], *rest]) for k, off in enumerate(noise)]
    return tuple(tuple(bound * v for v in column) for bound, column in columns if bound and any(column))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """Path of the pressure from a law with a number of states to the fault, with the indices of its states."""

    own: int
    step: Fraction
    delay: Fraction
    lag: Fraction
    diffusion: Fraction
    watched: bool

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
        if diffusion and self.watched:
            raise ParameterError(
                "jitter, averaging and the rate limit of a pump have no guarantee with a diffusion path. Received "
                f"L^2/D = {shortly(diffusion)} s with one of them. Omit diffusion, or jitter, averaging and rate limit."
            )

    @property
    def part(self) -> Fraction:
        """Time from a sample to the arrival of a pressure [s]; 0 if it arrives with a sample."""
        return self.delay % self.step

    @property
    def waiting(self) -> int:
        """Number of pressures in the delay line."""
        return int(self.delay // self.step) + (1 if self.part else 0)

    @property
    def valve(self) -> int:
        """Index of the pressure at the valve."""
        return 2 + self.own + self.waiting

    @property
    def behind(self) -> tuple[str, ...]:
        """States behind the valve: the well, the modes of a layer, and the last step of the valve if needed."""
        layer = [f"layer{i}" for i in range(MODES)] * (self.diffusion > 0)
        stepped = self.watched or (self.diffusion > 0 and not self.lag)
        return (*["behind"] * (self.lag > 0), *layer, *["stepped"] * stepped)

    @property
    def size(self) -> int:
        """Number of states."""
        return self.valve + 1 + len(self.behind)

    @property
    def modes(self) -> dict[int, int]:
        """Indices of the modes of the layer, with their numbers."""
        first = self.valve + (2 if self.lag else 1)
        return {first + i: i for i in range(MODES if self.diffusion else 0)}


def _unit(n: int, place: int) -> Row:
    return tuple(Fraction(i == place) for i in range(n))


def _drift(law: LinearLaw, authority: Fraction, path: _Path) -> Row:
    """Effect of a change of p* on the states, which are relative to those at which the law commands p*."""
    still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
    steady = steady_states(still, law.output, (Fraction(0),) * path.own, Fraction(1))
    zero, pressures = Fraction(0), [Fraction(-1)] * (path.waiting + 1)
    return (zero, zero, *(-v / authority for v in steady), *pressures, *[zero] * len(path.behind))


def _reference_drift(law: LinearLaw, path: _Path) -> Row:
    """Effect of a change of r on the states, which are relative to those at which the law commands p* at r."""
    still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
    rates = tuple(-row[0] for row in law.of_reference[:-1])
    moved = steady_states(still, law.output, rates, -law.of_reference[-1][0])
    zero = Fraction(0)
    return (zero, zero, *(-v for v in moved), *[zero] * (path.size - 2 - path.own))


def _push(path: _Path) -> Row:
    """Pressure in the fault as a row of the states."""
    push = [Fraction(i == path.valve or (i == path.valve + 1 and path.lag > 0)) for i in range(path.size)]
    for place, number in path.modes.items():
        push[place] = Layer(time=path.diffusion).share(number)
    return tuple(push)


def _flow(path: _Path, push: Row, model: NominalModel, gain: Fraction) -> Matrix:
    rows = [[Fraction(0)] * path.size for _ in range(path.size)]
    rows[0][1] = Fraction(1)
    rows[1] = [gain * v for v in push]
    rows[1][:2] = model.slip, -model.rate
    well = path.valve + 1
    if path.lag:
        rows[well][well] = -1 / path.lag
    for place, number in path.modes.items():
        rows[place][place] = -Layer(time=path.diffusion).rate(number)
        if path.lag:
            rows[place][well] = 1 / path.lag
    return tuple(map(tuple, rows))


def _left_out(path: _Path) -> tuple[dict[str, Row], dict[str, Fading]]:
    """Output that bounds the truncation error of the modes of a layer, and its decay after a step of the well."""
    if not path.diffusion:
        return {}, {}
    n, layer = path.size, Layer(time=path.diffusion)
    if path.lag:
        size = layer.left_out_in_all / path.lag
        return {"left_out": tuple(size * v for v in _unit(n, path.valve + 1))}, {}
    height, rate, floor = layer.left_out(path.step)
    most, first = height + floor, int(path.part > 0)
    fading = Fading(entry=_unit(n, 1), first=first, height=height / most, rate=rate, floor=floor / most)
    return {"left_out": tuple(most * v for v in _unit(n, n - 1))}, {"left_out": fading}


def _events(law: LinearLaw, authority: Fraction, path: _Path) -> tuple[Matrix, Matrix]:
    """Jump of a sample, with further columns for w and r′, and of a pressure that arrives between samples, if any."""
    n, valve, first, zero = path.size, path.valve, 2 + path.own, Fraction(0)
    jump = [list(_unit(n + 2, i)) for i in range(n)]
    commanded = [zero] * (n + 2)
    commanded[0], commanded[1] = (authority * v for v in law.feedback[:2])
    commanded[n] = authority * sum(law.feedback[2:], zero)
    *moved, commanded[n + 1] = [row[1] for row in law.of_reference] or [zero] * (path.own + 1)
    commanded[n + 1] *= authority
    for i, fed, update, r_rate in zip(range(2, first), law.measured, law.update, moved, strict=True):
        jump[i] = [*fed[:2], *update, *[zero] * (n - first), sum(fed[2:], zero), r_rate]
        commanded[i] = authority * law.output[i - 2]
    line = [*range(first, valve), *([] if path.part else [valve])]
    for place, before in zip(reversed(line), [*reversed(line[:-1]), None], strict=True):
        jump[place] = commanded if before is None else list(_unit(n + 2, before))
    arrival = [list(_unit(n, valve - 1 if i == valve else i)) for i in range(n)]
    if path.part:
        return tuple(map(tuple, jump)), _stepped(arrival, path)
    return _stepped(jump, path), ()


def _stepped(jump: list[list[Fraction]], path: _Path) -> Matrix:
    """Leave the states behind the valve unchanged while its pressure jumps, and store its step."""
    step = [v - (j == path.valve) for j, v in enumerate(jump[path.valve])]
    for place, name in enumerate(path.behind, path.valve + 1):
        if name == "stepped":
            jump[place] = step
        elif name == "behind" or not path.lag:
            jump[place] = [v - w for v, w in zip(jump[place], step, strict=True)]
    return tuple(map(tuple, jump))


# ----------------------------------------------------------------------
# Linear law in continuous time with a pressure without delay: idealised loop without sampling.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousLaw:
    """p = Cz + Dy + R(r, r′) and z′ = Fz + Gy at every time, y = (e1, e2), z from 0, r the reference.

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
        R [Pa/m, Pa·s/m], D for feedback of the state in place of the errors.

    Raises
    ------
    ParameterError
        When the sizes do not fit, or there are more than 12 states.
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
        k1 and k2 act on slip and slip rate, as printed, instead of their errors.

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
    """The error loop about p*, with the inputs and outputs of `held_loop`; states e1, e2 and z − z*.

    z* = ζ(p* − R(r, r′)) − ηR(r, r′)′ with Fζ = 0, Cζ = 1, Fη = ζ and Cη = 0, so that Cz* + R(r, r′) = p*. Where R is
    not zero its entries give two inputs more, ``reference_acceleration`` r″ and ``reference_jerk`` r‴, through
    ηR(r, r′)″.

    Parameters
    ----------
    law : ContinuousLaw
    model : NominalModel
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].

    Raises
    ------
    ParameterError
        For a law that leaves an error under a constant p*, or that feeds the reference forward without two integrals.
    """
    zero, one, n = Fraction(0), Fraction(1), 2 + len(law.states)
    push = tuple(authority * v for v in (*law.feedback, *law.output))
    plant = (model.slip, -model.rate, *[zero] * len(law.states))
    pushed = tuple(v + model.gain / authority * p for v, p in zip(plant, push, strict=True))
    own = tuple((*fed, *rates) for fed, rates in zip(law.measured, law.rates, strict=True))
    still = (zero,) * len(law.states)
    steady = steady_states(law.rates, law.output, still, one)
    inputs = {
        "acceleration": tuple(Fraction(i == 1) for i in range(n)),
        "drift": (zero, zero, *(-v / authority for v in steady)),
    }
    for name, fed in zip(("reference_acceleration", "reference_jerk"), law.of_reference, strict=True):
        if fed:
            moving = steady_states(law.rates, law.output, steady, zero)
            inputs[name] = (zero, zero, *(fed * v for v in moving))
    return PeriodicLoop(
        states=("e1", "e2", *law.states),
        flow=((zero, one, *[zero] * len(law.states)), pushed, *own),
        segments=(),
        inputs=inputs,
        outputs={
            "slip_error": tuple(Fraction(i == 0) for i in range(n)),
            "slip_rate_error": tuple(Fraction(i == 1) for i in range(n)),
            "push": push,
        },
    )


# ----------------------------------------------------------------------
# Sampled linear law about slow sliding of a fault with rate-and-state friction, without inertia.

StateLaw = Literal["ageing", "slip"]
_ONE = Fraction(1)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingModel:
    """Nominal model about sliding at V: v = Ve^y, θ = (D/V)e^z, slip error x, q = p − p*.

    strength·y + weakening·z = −stiffness·x + coefficient·q + e, x′ = V·c·y, z′ = −ρ(c_y·y + c_z·z), ρ = V/D. With all
    slopes 1 this is the linearisation about sliding at V, the same for both laws of the state.

    Attributes
    ----------
    rate : Fraction
        V [m/s].
    state_rate : Fraction
        ρ [1/s].
    slope : Fraction
        c [-], in place of e^y − 1 over y.
    state_slope : Fraction
        c_z [-]: of ageing in place of 1 − e^{−z} over z; of the slip law in place of e^y.
    strength : Fraction
        Stress per change of y: N·a and damping [Pa].
    weakening : Fraction
        N·b [Pa].
    direct, evolution : Fraction
        a and b [-].
    stiffness : Fraction
        [Pa/m].
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
        """c_y [-], which is c of ageing and c_z of the slip law, by which y + z evolves as a whole."""
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
    """The error loop about sliding at V, with the order of events and the path of the pressure of `held_loop`.

    States: the slip error x [m] and z [-] in place of e1 and e2; pressures in Pa. Inputs: ``stress`` e [Pa], ``rate`` f
    [-] in x′ = V(cy + f) and, of ageing, in z′ = −ρ(cy + c_z·z + f), ``state`` h [-] in z′ = … − ρh, the ``drift``
    dp*/dt [Pa/s], and ``reference``, by how much of V the reference is faster [-], in x′ = … − V·it.
    Outputs: ``slip_error`` x [m], ``log_rate`` y, ``log_state`` z, ``ageing`` c_y·y + c_z·z, ``strength`` a·y + b·z,
    ``push`` q [Pa], ``asked`` [Pa], pressure at the valve less that for p*, and with a layer ``left_out`` [Pa].
    The outputs of y and q exclude the direct feedthrough of e and of the truncation error (`at_once`).

    Raises
    ------
    ParameterError
        As `held_loop`.
    """
    plain = NominalModel(slip=Fraction(0), rate=Fraction(0), gain=_ONE)
    loop = held_loop(law, plain, _ONE, step, delay=delay, lag=lag, diffusion=diffusion, noisy=noisy)
    size = len(loop.states)
    push = loop.outputs["push"]
    y = [model.coefficient * v / model.strength for v in push]
    y[0] -= model.stiffness / model.strength
    y[1] -= model.weakening / model.strength
    z = unit_row(size, {1: _ONE})
    ageing = tuple(model.evolution_slope * a + model.state_slope * b for a, b in zip(y, z, strict=True))
    moving = model.rate * model.slope
    flow = (tuple(moving * v for v in y), tuple(-model.state_rate * v for v in ageing), *loop.flow[2:])
    aged = model.state_rate * model.evolution_slope
    by_stress = unit_row(size, {0: moving / model.strength, 1: -aged / model.strength})
    by_rate = {0: model.rate} | ({1: -model.state_rate} if model.state_law == "ageing" else {})
    by_pressure = tuple(model.coefficient * v for v in by_stress)
    left_out = {"left_out": row} if (row := loop.outputs.get("left_out")) else {}
    return replace(
        loop,
        flow=flow,
        inputs={
            "stress": by_stress,
            "rate": unit_row(size, by_rate),
            "state": unit_row(size, {1: -model.state_rate}),
            "drift": loop.inputs["drift"],
            "reference": unit_row(size, {0: -model.rate}),
        },
        outputs={
            "slip_error": unit_row(size, {0: _ONE}),
            "log_rate": tuple(y),
            "log_state": z,
            "ageing": ageing,
            "strength": tuple(model.direct * a + model.evolution * b for a, b in zip(y, z, strict=True)),
            "push": push,
            "asked": loop.outputs.get("asked", push),
            **left_out,
        },
        fading={name: replace(fading, entry=by_pressure) for name, fading in loop.fading.items()},
    )


def at_once(model: SlidingModel) -> dict[tuple[str, str], Fraction]:
    """Direct feedthrough from each input to each output, by (output, input)."""
    heard = {"log_rate": _ONE, "ageing": model.evolution_slope, "strength": model.direct}
    sizes = {"stress": 1 / model.strength, "left_out": model.coefficient / model.strength}
    return {(output, name): share * size for output, share in heard.items() for name, size in sizes.items()}
