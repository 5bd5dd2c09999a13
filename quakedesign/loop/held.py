"""A linear law around a fault: sample, hold, delay and lag."""

from fractions import Fraction

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.loop.laws import LinearLaw, Model
from quakedesign.loop.periodic import Matrix, PeriodicLoop, Row, Segment
from quakedesign.rationals import fraction_of, to_sympy

MOST_PERIODS = 8


def held_loop(
    law: LinearLaw,
    model: Model,
    authority: Fraction,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
) -> PeriodicLoop:
    """The error loop of a fault about p*, the pressure that holds it at rest at the reference.

    Order of events: at every multiple of T_s the law measures e1 and e2, finds p, and updates its states; p reaches the
    valve after the delay and stays for T_s; the pressure in the fault follows the valve with the lag. States, in this
    order: e1, e2, the law's, the pressures on their way, the valve's (with a lag), the fault's; those of the law less
    what they are while p = p* holds the fault at rest, pressures as b·(p − p*).

    Inputs: ``acceleration`` a in e2' = s·e1 − w·e2 + βb(p − p*) + a [m/s²]; ``drift`` b·dp*/dt [m/s³]. Outputs:
    ``slip_error`` [m], ``slip_rate_error`` [m/s], ``push`` b·(p − p*) [m/s²].

    Parameters
    ----------
    law : LinearLaw
    model : Model
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].
    step, delay, lag : Fraction
        [s]; the delay at most 8 periods.

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
    names = ("e1", "e2", *law.states, *(f"waiting{i}" for i in range(waiting)), *(("valve",) if lag else ()), "fault")
    places = {name: i for i, name in enumerate(names)}
    valve = places["valve" if lag else "fault"]
    steady = _steady(law)
    return PeriodicLoop(
        states=names,
        flow=_flow(len(names), model.slip, model.rate, model.gain / authority, valve, lag),
        segments=_segments(law, authority, len(names), waiting, valve, step, part),
        inputs={
            "acceleration": tuple(Fraction(i == 1) for i in range(len(names))),
            "drift": (Fraction(0), Fraction(0), *(-v / authority for v in steady))
            + (Fraction(-1),) * (len(names) - 2 - len(steady)),
        },
        outputs={
            name: tuple(Fraction(i == place) for i in range(len(names)))
            for name, place in (("slip_error", 0), ("slip_rate_error", 1), ("push", places["fault"]))
        },
    )


def _steady(law: LinearLaw) -> Row:
    """States of a law that asks for 1 Pa without errors for ever."""
    n = len(law.states)
    left = sp.Matrix([[to_sympy(v - (i == j)) for j, v in enumerate(row)] for i, row in enumerate(law.update)])
    whole = left.reshape(n, n).col_join(sp.Matrix(1, n, [to_sympy(v) for v in law.output]))
    try:
        solution, free = whole.gauss_jordan_solve(sp.Matrix([0] * n + [1]))
    except ValueError:
        raise ParameterError(
            "a law must be able to ask for a constant pressure without errors. Received one that cannot. "
            "Give it an integral or an estimate of the disturbance."
        ) from None
    return tuple(fraction_of(v) for v in solution.subs(dict.fromkeys(free, 0)))


def _flow(n: int, slip: Fraction, rate: Fraction, gain: Fraction, valve: int, lag: Fraction) -> Matrix:
    rows = [[Fraction(0)] * n for _ in range(n)]
    rows[0][1] = Fraction(1)
    rows[1][0], rows[1][1], rows[1][n - 1] = slip, -rate, gain
    if lag:
        rows[n - 1][valve], rows[n - 1][n - 1] = 1 / lag, -1 / lag
    return tuple(map(tuple, rows))


def _segments(
    law: LinearLaw, authority: Fraction, n: int, waiting: int, valve: int, step: Fraction, part: Fraction
) -> tuple[Segment, ...]:
    """The sample and, if the delay is no whole number of periods, the arrival of a pressure between samples."""
    own, first = range(2, 2 + len(law.states)), 2 + len(law.states)
    jump = [[Fraction(i == j) for j in range(n)] for i in range(n)]
    asked = [Fraction(0)] * n
    asked[:2] = [authority * v for v in law.feedback]
    for i, fed, kept in zip(own, law.measured, law.update, strict=True):
        jump[i] = [*fed, *kept, *[Fraction(0)] * (n - first)]
        asked[i] = authority * law.output[i - 2]
    line = [*range(first, first + waiting), *([] if part else [valve])]
    for place, before in zip(reversed(line), [*reversed(line[:-1]), None], strict=True):
        jump[place] = asked if before is None else [Fraction(j == before) for j in range(n)]
    sample = tuple(map(tuple, jump))
    if not part:
        return (Segment(jump=sample, duration=step),)
    arrival = tuple(
        tuple(Fraction(j == (first + waiting - 1 if i == valve else i)) for j in range(n)) for i in range(n)
    )
    return Segment(jump=sample, duration=part), Segment(jump=arrival, duration=step - part)
