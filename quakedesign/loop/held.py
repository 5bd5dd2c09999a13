"""A linear law around a fault: sample, hold, delay, lag, and diffusion between well and fault."""

from collections.abc import Collection
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import NOISES, LinearLaw, Matrix, Model, Row
from quakedesign.loop.layer import MODES, Layer
from quakedesign.loop.periodic import EVEN, Fading, PeriodicLoop, Segment

MOST_PERIODS = 8
SHORTEST = 32  # parts of a step: the modes of a faster layer are gone sooner than bounds can follow
BENT = tuple(Fraction(v, 128) for v in (0, 1, 3, 6, 10, 15, 22, 32, 46, 64, 84, 106, 128))  # as modes of a layer do
HALVES = tuple(Fraction(v, 2) for v in (0, 1, 2))


def held_loop(
    law: LinearLaw,
    model: Model,
    authority: Fraction,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    diffusion: Fraction = Fraction(0),
    noisy: Collection[str] = (),
) -> PeriodicLoop:
    """The error loop of a fault about p*, the pressure that holds it at rest at the reference.

    Order of events: at every multiple of T_s the law measures e1 and e2, finds p, and updates its states; p reaches the
    valve after the delay and stays for T_s; the pressure in the well follows the valve with the lag, that in the fault
    the well's through a layer. States, in this order: e1, e2, the law's, the pressures on their way, the valve's, with
    a lag what the well's is more than the valve's, what those of the layer's modes are more than the well's, with a
    layer and no lag the valve's last step; those of the law less what they are while p = p* holds the fault at rest,
    pressures as b·(p − p*).

    Inputs: ``acceleration`` a in e2' = s·e1 − w·e2 + βb(p − p*) + a [m/s²]; ``drift`` b·dp*/dt [m/s³]. Outputs:
    ``slip_error`` [m], ``slip_rate_error`` [m/s], ``push`` b·(p − p*) [m/s²], with a layer but for what its modes leave
    out, which ``left_out`` bounds [m/s²] and, where the well steps, an input of this name brings into e2' by its share.
    With an implicit root the loop has w = −γe1/T_s with the middle of its slopes, and w + γe1/T_s [m/s] is the sampled
    input ``root``. If asked for, what the measured e1 and e2 are more than the true ones are the sampled inputs
    ``slip_noise`` [m] and ``rate_noise`` [m/s]: the law does with them what it does with e1 and e2, w included.

    Parameters
    ----------
    law : LinearLaw
    model : Model
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].
    step, delay, lag : Fraction
        [s]; the delay at most 8 periods.
    diffusion : Fraction
        L²/D of the layer between well and fault [s]; 0 for none.
    noisy : collection of str
        Which of ``slip_noise`` and ``rate_noise`` are inputs.

    Raises
    ------
    ParameterError
        For a law that leaves an error under a constant p*, or times that are negative or too long.
    """
    if step <= 0 or not 0 <= delay <= MOST_PERIODS * step or lag < 0:
        raise ParameterError(
            f"a held loop needs a positive step, a delay of 0 to {MOST_PERIODS} steps and a lag of 0 or more. Received "
            f"{float(step):.4g} s, {float(delay):.4g} s, {float(lag):.4g} s. Shorten the delay."
        )
    if diffusion and SHORTEST * diffusion < step:
        raise ParameterError(
            f"diffusion must take at least T_s/{SHORTEST}, here {float(step / SHORTEST):.4g} s, or nothing. Received "
            f"{float(diffusion):.4g} s. Leave it out."
        )
    whole, part = delay // step, delay % step
    waiting = int(whole) + (1 if part else 0)
    behind = ["behind"] * (lag > 0) + [f"layer{i}" for i in range(MODES)] * (diffusion > 0)
    stepped = ["stepped"] * (diffusion > 0 and not lag)
    names = ("e1", "e2", *law.states, *(f"waiting{i}" for i in range(waiting)), "valve", *behind, *stepped)
    n, valve = len(names), 2 + len(law.states) + waiting
    still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
    steady = steady_states(still, law.output, (Fraction(0),) * len(law.states), Fraction(1))
    zero, one = Fraction(0), Fraction(1)
    sample, arrival = _events(law, authority, names, valve, part > 0)
    slope = Fraction(0) if law.root is None else law.root.middle / step
    jump = tuple((row[0] - slope * row[n], *row[1:n]) for row in sample)
    sampled = {} if law.root is None else {"root": tuple(row[n] for row in sample)}
    for k, name in enumerate(NOISES):
        if name in noisy:
            sampled[name] = tuple(row[k] - (i == k) for i, row in enumerate(jump))
    push = _push(n, valve, lag, diffusion)
    acceleration = tuple(Fraction(i == 1) for i in range(n))
    ends, past_ends = (BENT, HALVES) if diffusion else (EVEN, EVEN)
    left_out, fading = _left_out(n, valve, step, lag, diffusion, int(part > 0))
    return PeriodicLoop(
        states=names,
        flow=_flow(push, model, model.gain / authority, valve, lag, diffusion),
        segments=(
            Segment(jump=jump, duration=part or step, ends=ends, past_ends=past_ends),
            *([Segment(jump=arrival, duration=step - part, ends=ends, past_ends=past_ends)] if part else []),
        ),
        inputs={
            "acceleration": acceleration,
            "drift": (
                zero,
                zero,
                *(-v / authority for v in steady),
                *[-one] * (waiting + 1),
                *[zero] * (n - valve - 1),
            ),
        },
        outputs={
            "slip_error": tuple(Fraction(i == 0) for i in range(n)),
            "slip_rate_error": acceleration,
            "push": push,
            **left_out,
        },
        sampled=sampled,
        fading=fading,
    )


def steady_states(own: Matrix, output: Row, rates: Row, asked: Fraction) -> Row:
    """States of a law that asks for p without errors and has the rates v: Mz = v and Cz = p, by elimination.

    Raises
    ------
    ParameterError
        When there are none.
    """
    n = len(output)
    rows = [[*row, rate] for row, rate in zip(own, rates, strict=True)]
    rows.append([*output, asked])
    pivots: list[tuple[int, list[Fraction]]] = []
    for column in range(n):
        pivot = next((row for row in rows if row[column]), None)
        if pivot is not None:
            pivot = [v / pivot[column] for v in pivot]
            rows = [[v - row[column] * p for v, p in zip(row, pivot, strict=True)] for row in rows]
            pivots.append((column, pivot))
    if any(row[n] for row in rows):
        raise ParameterError(
            "a law must be able to ask for a constant pressure without errors. Received one that cannot. "
            "Give it an integral or an estimate of the disturbance."
        )
    found = [Fraction(0)] * n
    for column, pivot in reversed(pivots):
        found[column] = pivot[n] - sum((v * f for v, f in zip(pivot, found, strict=False)), Fraction(0))
    return tuple(found)


def _push(n: int, valve: int, lag: Fraction, diffusion: Fraction) -> Row:
    """What the states say of the fault's pressure."""
    push = [Fraction(i in (valve, valve + 1)) for i in range(n)]  # modes follow
    if diffusion:
        first, layer = valve + (2 if lag else 1), Layer(time=diffusion)
        push[first : first + MODES] = [layer.share(i) for i in range(MODES)]
    return tuple(push)


def _flow(push: Row, model: Model, gain: Fraction, valve: int, lag: Fraction, diffusion: Fraction) -> Matrix:
    n = len(push)
    rows = [[Fraction(0)] * n for _ in range(n)]
    rows[0][1] = Fraction(1)
    rows[1] = [gain * v for v in push]
    rows[1][:2] = model.slip, -model.rate
    if lag:
        rows[valve + 1][valve + 1] = -1 / lag
    for i in range(MODES if diffusion else 0):
        mode, rate = valve + (2 if lag else 1) + i, Layer(time=diffusion).rate(i)
        rows[mode][mode] = -rate
        if lag:
            rows[mode][valve + 1] = 1 / lag
    return tuple(map(tuple, rows))


def _left_out(
    n: int, valve: int, step: Fraction, lag: Fraction, diffusion: Fraction, first: int
) -> tuple[dict[str, Row], dict[str, Fading]]:
    """Bound of what the modes of a layer leave out, as an output, and how it fades where the well steps."""
    if not diffusion:
        return {}, {}
    layer = Layer(time=diffusion)
    if lag:
        size = layer.left_out_in_all / lag
        return {"left_out": tuple(size * (i == valve + 1) for i in range(n))}, {}
    height, rate, floor = layer.left_out(step)
    most, acceleration = height + floor, tuple(Fraction(i == 1) for i in range(n))
    fading = Fading(entry=acceleration, first=first, height=height / most, rate=rate, floor=floor / most)
    return {"left_out": tuple(most * (i == n - 1) for i in range(n))}, {"left_out": fading}


def _events(
    law: LinearLaw, authority: Fraction, names: tuple[str, ...], valve: int, between: bool
) -> tuple[Matrix, Matrix]:
    """The sample, with one more column for w, and the arrival of a pressure between samples, if that is where it is."""
    own, first, zero = range(2, 2 + len(law.states)), 2 + len(law.states), Fraction(0)
    n = len(names)
    jump = [[Fraction(i == j) for j in range(n + 1)] for i in range(n)]
    asked = [zero] * (n + 1)
    asked[0], asked[1] = (authority * v for v in law.feedback[:2])
    asked[n] = authority * sum(law.feedback[2:], zero)
    for i, fed, kept in zip(own, law.measured, law.update, strict=True):
        jump[i] = [*fed[:2], *kept, *[zero] * (n - first), sum(fed[2:], zero)]
        asked[i] = authority * law.output[i - 2]
    line = [*range(first, valve), *([] if between else [valve])]
    for place, before in zip(reversed(line), [*reversed(line[:-1]), None], strict=True):
        jump[place] = asked if before is None else [Fraction(j == before) for j in range(len(asked))]
    arrival = [[Fraction(j == (valve - 1 if i == valve else i)) for j in range(n)] for i in range(n)]
    if between:
        return tuple(map(tuple, jump)), _stepped(arrival, valve, names)
    return _stepped(jump, valve, names), ()


def _stepped(jump: list[list[Fraction]], valve: int, names: tuple[str, ...]) -> Matrix:
    """What follows the valve's pressure at once stays where it is while that jumps; its step is kept."""
    step = [v - (j == valve) for j, v in enumerate(jump[valve])]
    for place in range(valve + 1, len(names)):
        if names[place] == "stepped":
            jump[place] = step
        elif names[place] == "behind" or "behind" not in names:
            jump[place] = [v - w for v, w in zip(jump[place], step, strict=True)]
    return tuple(map(tuple, jump))
