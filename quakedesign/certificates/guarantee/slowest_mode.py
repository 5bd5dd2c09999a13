"""The slowest mode of a periodic loop, seen alone, so that nothing else has to be followed until it is gone."""

from functools import reduce
from typing import Any

from flint import arb, arb_mat

from quakedesign.certificates.guarantee.ball_matrices import identity
from quakedesign.certificates.guarantee.responses import Flow
from quakedesign.errors import ParameterError

MOST_DOUBLINGS = 12


def slowest(flows: list[Flow]) -> list[Any]:
    """What the slowest mode is seen along, if there is one: a row of what is left of all states after 2^12 periods.

    That with the largest entry on the diagonal, which is the same in all units of the states: whoever else takes it
    looks back as far, and finds the same bounds.

    Raises
    ------
    ParameterError
        When that is more than there was.
    """
    period = reduce(lambda now, flow: flow.whole * now, flows[1:], flows[0].whole)
    growth = before = 0.0
    for _ in range(MOST_DOUBLINGS):
        period = period * period
        largest = max(v.abs_upper() for v in period.entries())
        if not largest > 0:
            return [arb(0)] * period.nrows()
        before, growth = growth, 2 * growth + float(largest.log())
        period = arb_mat([[(v / largest).mid() for v in row] for row in period.tolist()])
    if not growth < before:
        raise unstable()
    return list(period.tolist()[max(range(period.nrows()), key=lambda i: abs(period[i, i]))])


def seen_alone(row: list[Any], sums: list[Any]) -> tuple[int, Any, Any]:
    """W of `norms`, its inverse, and which of its rows, that of the state that counts most, is the given one."""
    seen, back = identity(len(row)), identity(len(row))
    place = max(range(len(row)), key=lambda i: (abs(row[i]) * sums[i]).mid())
    for i, v in enumerate(row):
        if i != place and row[place] != 0:
            seen[place, i] = (v / row[place]).mid()
            back[place, i] = -seen[place, i]
    return place, seen, back


def unstable() -> ParameterError:
    """What is said of a loop that is not seen to be stable."""
    return ParameterError(
        f"the nominal loop must be stable. Received one that is not seen to be in {2**MOST_DOUBLINGS} periods. "
        "Change the gains, or shorten T_s."
    )
