"""Equations as MathML, which browsers draw without a script or a network."""

from latex2mathml.converter import convert
from markupsafe import Markup


def mathml(latex: str, *, display: str = "block") -> Markup:
    """MathML of an equation in LaTeX."""
    drawn = convert(latex, display=display)
    return Markup(drawn.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', ""))
