"""Limits, models and printed ranges of slow sliding, on the stored claim."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sliding_proof import _inside
from quakedesign.guarantees.exact.sliding_small_gain import bounds_from, model_of

CLAIM = parse_guarantee(
    (Path(__file__).parents[3] / "proofs" / "certificates" / "sliding_crustal-patch.json").read_text()
)


def test_logarithms_are_claimed_up_to_three():
    for name in ("log_rate", "log_state"):
        assert getattr(replace(CLAIM.claims, **{name: UpperBound(3)}), name) == 3
        with pytest.raises(ParameterError, match="log_rate and log_state at most 3"):
            replace(CLAIM.claims, **{name: UpperBound(F(3001, 1000))})


def pressed(share):
    """Claims whose pressure leaves a normal stress of so many pascals."""
    low = CLAIM.task.normal_stress(F(0))[0]
    return replace(CLAIM.claims, push=UpperBound(low - share))


def test_a_model_needs_a_closed_fault():
    assert CLAIM.task.normal_stress(pressed(F(1, 2)).push)[0] == F(1, 2)
    assert model_of(CLAIM.task, pressed(F(1, 2))) is not None
    assert model_of(CLAIM.task, pressed(F(0))) is None
    found = bounds_from(CLAIM.task, CLAIM.sampled_loop, pressed(F(0)), None, {}, ())
    assert isinstance(found, NoProof)
    assert found.reason == "the pressure may open the fault"


def test_only_regularised_friction_needs_an_exponent_of_one():
    """2m/a with m = μ − aY − bZ: friction so small that it is below 1 has a model unless it is regularised."""
    a, b = (CLAIM.task.ranges[name][1] for name in ("direct_effect", "evolution_effect"))
    small = a * CLAIM.claims.log_rate + b * CLAIM.claims.log_state + a / 3
    task = replace(CLAIM.task, ranges=CLAIM.task.ranges | {"coefficient": (small, small)}, regularised=False)
    task = replace(task, distance=F(1, 10**9))
    assert model_of(task, CLAIM.claims) is not None
    assert model_of(replace(task, regularised=True), CLAIM.claims) is None


@pytest.mark.parametrize(
    ("high", "text"),
    [
        (F(2, 3), "0.333334 to 0.666666"),
        (F(1, 3) + F(2, 10**6), "0.333334 to 0.333335"),
        (F(1, 3) + F(2, 10**7), "0.3333334 to 0.3333335"),
        (F(1, 3) + F(2, 10**15), "0.333333333333334 to 0.333333333333335"),
        (F(1, 3) + F(3, 10**16), f"1/3 to {F(1, 3) + F(3, 10**16)}"),
    ],
)
def test_a_range_is_printed_inward_with_the_digits_that_it_needs(high, text):
    assert _inside(F(1, 3), high) == text
