"""A linear law around a fault: sample, hold, delay and lag."""

from collections.abc import Collection
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import NOISES, LinearLaw, Matrix, Model, Row
from quakedesign.loop.periodic import PeriodicLoop, Segment

MOST_PERIODS = 8


def held_loop(
    law: LinearLaw,
    model: Model,
    authority: Fraction,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    noisy: Collection[str] = (),
) -> PeriodicLoop:
    """The error loop of a fault about p*, the pressure that holds it at rest at the reference.

    Order of events: at every multiple of T_s the law measures e1 and e2, finds p, and updates its states; p reaches the
    valve after the delay and stays for T_s; the pressure in the fault follows the valve with the lag. States, in this
    order: e1, e2, the law's, the pressures on their way, the valve's, with a lag what the fault's pressure is more than
    the valve's; those of the law less what they are while p = p* holds the fault at rest, pressures as b·(p − p*).

    Inputs: ``acceleration`` a in e2' = s·e1 − w·e2 + βb(p − p*) + a [m/s²]; ``drift`` b·dp*/dt [m/s³]. Outputs:
    ``slip_error`` [m], ``slip_rate_error`` [m/s], ``push`` b·(p − p*) [m/s²]. With an implicit root the loop has w =
    −γe1/T_s with the middle of its slopes, and w + γe1/T_s [m/s] is the sampled input ``root``. If asked for, what the
    measured e1 and e2 are more than the true ones are the sampled inputs ``slip_noise`` [m] and ``rate_noise`` [m/s]:
    the law does with them what it does with e1 and e2, w included.

    Parameters
    ----------
    law : LinearLaw
    model : Model
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].
    step, delay, lag : Fraction
        [s]; the delay at most 8 periods.
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
    whole, part = delay // step, delay % step
    waiting = int(whole) + (1 if part else 0)
    names = ("e1", "e2", *law.states, *(f"waiting{i}" for i in range(waiting)), "valve", *(("behind",) if lag else ()))
    n, valve = len(names), len(names) - (2 if lag else 1)
    still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(law.update))
    steady = steady_states(still, law.output, (Fraction(0),) * len(law.states), Fraction(1))
    zero, one = Fraction(0), Fraction(1)
    sample, arrival = _events(law, authority, n, waiting, valve, part > 0)
    slope = Fraction(0) if law.root is None else law.root.middle / step
    jump = tuple((row[0] - slope * row[n], *row[1:n]) for row in sample)
    sampled = {} if law.root is None else {"root": tuple(row[n] for row in sample)}
    for k, name in enumerate(NOISES):
        if name in noisy:
            sampled[name] = tuple(row[k] - (i == k) for i, row in enumerate(jump))
    return PeriodicLoop(
        states=names,
        flow=_flow(n, model.slip, model.rate, model.gain / authority, valve, lag),
        segments=(
            Segment(jump=jump, duration=part or step),
            *([Segment(jump=arrival, duration=step - part)] if part else []),
        ),
        inputs={
            "acceleration": tuple(Fraction(i == 1) for i in range(n)),
            "drift": (zero, zero, *(-v / authority for v in steady), *[-one] * (waiting + 1), *([zero] if lag else [])),
        },
        outputs={
            "slip_error": tuple(Fraction(i == 0) for i in range(n)),
            "slip_rate_error": tuple(Fraction(i == 1) for i in range(n)),
            "push": tuple(Fraction(i >= valve) for i in range(n)),
        },
        sampled=sampled,
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


def _flow(n: int, slip: Fraction, rate: Fraction, gain: Fraction, valve: int, lag: Fraction) -> Matrix:
    rows = [[Fraction(0)] * n for _ in range(n)]
    rows[0][1] = Fraction(1)
    rows[1][:2] = slip, -rate
    rows[1][valve:] = [gain] * (n - valve)
    if lag:
        rows[n - 1][n - 1] = -1 / lag
    return tuple(map(tuple, rows))


def _events(
    law: LinearLaw, authority: Fraction, n: int, waiting: int, valve: int, between: bool
) -> tuple[Matrix, Matrix]:
    """The sample, with one more column for w, and the arrival of a pressure between samples, if that is where it is."""
    own, first, zero = range(2, 2 + len(law.states)), 2 + len(law.states), Fraction(0)
    jump = [[Fraction(i == j) for j in range(n + 1)] for i in range(n)]
    asked = [zero] * (n + 1)
    asked[0], asked[1] = (authority * v for v in law.feedback[:2])
    asked[n] = authority * sum(law.feedback[2:], zero)
    for i, fed, kept in zip(own, law.measured, law.update, strict=True):
        jump[i] = [*fed[:2], *kept, *[zero] * (n - first), sum(fed[2:], zero)]
        asked[i] = authority * law.output[i - 2]
    line = [*range(first, first + waiting), *([] if between else [valve])]
    for place, before in zip(reversed(line), [*reversed(line[:-1]), None], strict=True):
        jump[place] = asked if before is None else [Fraction(j == before) for j in range(len(asked))]
    arrival = [[Fraction(j == (first + waiting - 1 if i == valve else i)) for j in range(n)] for i in range(n)]
    if between:
        return tuple(map(tuple, jump)), _with_lag(arrival, valve)
    return _with_lag(jump, valve), ()


def _with_lag(jump: list[list[Fraction]], valve: int) -> Matrix:
    """The fault's pressure stays where it is while the valve's jumps."""
    for behind in range(valve + 1, len(jump)):
        jump[behind] = [v + (j == valve) - w for j, (v, w) in enumerate(zip(jump[behind], jump[valve], strict=True))]
    return tuple(map(tuple, jump))
