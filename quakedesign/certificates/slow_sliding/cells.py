"""A box of constants, cut in two again and again: whatever the cuts, the cells cover it."""

from dataclasses import replace
from fractions import Fraction

from quakedesign.certificates.slow_sliding.task import AXES, SlidingTask
from quakedesign.errors import ParameterError

MOST_CELLS = 64
Cuts = tuple[tuple[str, Fraction] | None, ...]
"""For a box, then for its part below the cut with all of its parts, then for that above: axis and place, or no cut."""
WHOLE: Cuts = (None,)


def cells(task: SlidingTask, cuts: Cuts) -> tuple[SlidingTask, ...]:
    """The same task on every cell.

    Raises
    ------
    ParameterError
        For a cut outside its box, too few or too many cuts, or more than 64 cells.
    """
    boxes, leaves = [task], []
    for cut in cuts[: 2 * MOST_CELLS]:
        if not boxes:
            break
        box = boxes.pop()
        if cut is None:
            leaves.append(box)
        else:
            boxes += reversed(parts(box, *cut))
    if boxes or len(cuts) != 2 * len(leaves) - 1 or len(leaves) > MOST_CELLS:
        raise ParameterError(
            f"a box must be cut into 1 to {MOST_CELLS} cells, with one cut less. Received {len(cuts)} entries and "
            f"{len(leaves)} cells. Complete them."
        )
    return tuple(leaves)


def parts(task: SlidingTask, axis: str, at: Fraction) -> tuple[SlidingTask, SlidingTask]:
    """Both parts of a box, below and above a cut.

    Raises
    ------
    ParameterError
        For a cut that is not inside.
    """
    low, high = task.ranges.get(axis, (at, at))
    if not low < at < high:
        raise ParameterError(
            f"a cut must be across one of {', '.join(AXES)}, inside its box. Received {axis} at {at}. Check it."
        )
    below, above = ({**task.ranges, axis: ends} for ends in ((low, at), (at, high)))
    return replace(task, ranges=below), replace(task, ranges=above)
