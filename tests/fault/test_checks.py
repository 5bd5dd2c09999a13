"""The shared checks of physical values."""

import math

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault.checks import require_finite, require_nonnegative, require_positive

CHECKS = {require_positive: {1e-300, 2}, require_nonnegative: {0, -0.0, 2}, require_finite: {-2, 0, 1e300}}


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_each_check_lets_its_values_pass_and_no_infinity(check):
    for value in CHECKS[check]:
        assert check(it=value) is None
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(ParameterError, match=rf"^it must be .*finite\. Received {value!r} \(SI units\)\. Why\.$"):
            check("Why.", it=value)


@pytest.mark.parametrize(("check", "value"), [(require_positive, 0), (require_positive, -1), (require_nonnegative, -1)])
def test_signs(check, value):
    with pytest.raises(ParameterError, match=f"Received {value} "):
        check(fine=1, it=value)
