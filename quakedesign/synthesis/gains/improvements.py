"""By how much synthesised gains beat those from the literature, one objective after the other."""

from collections.abc import Iterable, Sequence
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.controllers import Subject
from quakedesign.synthesis.analysis.certify import Number
from quakedesign.synthesis.gains.dilation import scaled_norm
from quakedesign.synthesis.gains.objectives import OBJECTIVES
from quakedesign.synthesis.gains.problem import question
from quakedesign.synthesis.gains.synthesise import Synthesis, beside, synthesise

_SAME = 1 + 1e-9


def improvements(
    subject: Subject,
    objectives: Sequence[str] = OBJECTIVES,
    *,
    lipschitz: Number = 1,
    gain_range: tuple[Number, Number] = (1, 1),
    against: Sequence[int] | None = None,
    degrees: Iterable[int] | None = None,
    starts: int = 2,
    seed: int = 0,
    workers: int = 1,
) -> list[dict[str, Any]]:
    """Rows of a table: gains from the literature against synthesised ones, both proved for the same ranges.

    For objectives with a bound on the norm, the gains to beat set it, so that every row is about equal norms.

    Parameters
    ----------
    subject : str, type of Law or LoopField
    objectives : sequence of str
    against : sequence of int, optional
        Which gains from the literature, counted from zero; all unless given.
    lipschitz, gain_range, degrees, starts, seed, workers
        As `synthesise`.

    Returns
    -------
    list of dict
        ``objective``, ``unit``, ``published`` and ``synthesised`` (gains as floats), ``published_value``, ``value``
        (both proved, or None), ``ratio``, how many times better (never below one), ``published_norm``, ``norm``, and
        the ``certificate`` of the gains found. None where nothing was proved.
    """
    chosen = None if degrees is None else tuple(degrees)
    options: dict[str, Any] = {"lipschitz": lipschitz, "gain_range": gain_range, "degrees": chosen}
    more: dict[str, Any] = {"starts": starts, "seed": seed, "workers": workers, "compare": False}
    rows = []
    for name in objectives:
        asked = question(subject, name, **options)
        synthesis = None if asked.setting.objective.bounded else synthesise(subject, name, **options, **more)
        for loop in asked.known if against is None else [asked.known[i] for i in against]:
            bound = scaled_norm(loop, asked.setting.exponents) * _SAME
            equal = question(subject, name, **options, bound=bound)
            mine = synthesis or synthesise(subject, name, **options, **more, bound=bound)
            rows.append(_row(name, loop, beside(equal, mine, (loop,))))
    return rows


def _row(name: str, published: Loop, mine: Synthesis | None) -> dict[str, Any]:
    theirs = mine.compared[0] if mine else None
    return {
        "objective": name,
        "unit": mine.unit if mine else None,
        "published": tuple(map(float, published.gains.values())),
        "synthesised": tuple(map(float, mine.gains.values())) if mine else None,
        "published_value": theirs.value if theirs else None,
        "value": mine.value if mine else None,
        "ratio": theirs.ratio if theirs else None,
        "published_norm": theirs.norm if theirs else None,
        "norm": mine.norm if mine else None,
        "certificate": mine.certificate if mine else None,
    }
