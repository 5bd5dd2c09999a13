"""Uncertainty box: largest deviations of the real fault from the nominal one."""

from fractions import Fraction as F

import pytest

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import BOXES, UncertaintyBox, uncertainty_box


def test_the_two_boxes_of_the_design():
    assert set(BOXES) == {"paper", "ten-percent"}
    paper, ten = uncertainty_box("paper"), uncertainty_box("ten-percent")
    assert (paper.stiffness, paper.damping, paper.authority) == (0, 0, 0)
    assert (ten.stiffness, ten.damping, ten.authority) == (F(1, 10),) * 3


def test_an_unknown_box_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"must be one of paper, ten-percent\. Received 'wide'"):
        uncertainty_box("wide")


@pytest.mark.parametrize("width", [F(-1, 100), F(1), F(10)])
@pytest.mark.parametrize("part", ["stiffness", "damping", "authority"])
def test_a_width_leaves_the_parameter_positive(part, width):
    with pytest.raises(
        ParameterError, match=rf"^{part} of the uncertainty box must be in \[0, 1\).*Ten percent is 0.1"
    ):
        UncertaintyBox(name="own", **{part: width})
