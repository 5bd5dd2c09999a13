"""A few of many cases run by default, the others with -m slow."""

import pytest

ALL = pytest.param(None, marks=pytest.mark.slow, id="all")
some_or_all = pytest.mark.parametrize("most", [pytest.param(12, id="some"), ALL])
"""For a test that goes through a list of its own: `spread(values, most)`."""


def few(names, cases, *, every, **told):
    """Parametrize with each `every`-th case, the first among them."""
    several, chosen = not isinstance(names, str) or "," in names, []
    for i, case in enumerate(cases):
        if not hasattr(case, "marks"):
            case = pytest.param(*case) if several else pytest.param(case)
        marks = [*case.marks, *[pytest.mark.slow] * (i % every > 0)]
        chosen.append(pytest.param(*case.values, marks=marks, id=case.id))
    return pytest.mark.parametrize(names, chosen, **told)


def spread(values, most):
    """At most so many of some values, from the first to the last; all of them if it is None."""
    values = list(values)
    if most is None or len(values) <= most:
        return values
    return [values[k * (len(values) - 1) // (most - 1)] for k in range(most)]
