"""One way to write derived equations: dots for rates, the reference without its argument, in LaTeX or plain text."""

import re
from typing import Any

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from quakedesign.symbolic.plant import reference, t


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _print_Derivative(self, rate: sp.Derivative) -> str:
        dots = {1: r"\dot", 2: r"\ddot"}.get(rate.derivative_count)
        return f"{dots} r" if dots and rate.expr == reference(t) else str(super()._print_Derivative(rate))

    def _print_Function(self, call: sp.Function, exp: Any = None) -> str:
        return "r" if call == reference(t) else str(super()._print_Function(call, exp))


class _Plain(StrPrinter):  # type: ignore[misc]
    def _print_Derivative(self, rate: sp.Derivative) -> str:
        known = rate.expr == reference(t)
        return "r" + "'" * rate.derivative_count if known else str(super()._print_Derivative(rate))

    def _print_Function(self, call: sp.Function) -> str:
        return "r" if call == reference(t) else str(super()._print_Function(call))


def latex(expression: Any) -> str:
    r"""LaTeX of a derived expression: r, \dot r and \ddot r for the reference and its rates."""
    return str(_Latex().doprint(expression))


def plain(expression: Any) -> str:
    """Text of a derived expression: r, r' and r'' for the reference and its rates, k_hat for a symbol with a hat."""
    if isinstance(expression, sp.MatrixBase):
        return f"Matrix({plain(expression.tolist())})"
    said = _Plain().doprint(expression).replace(r"\mu_0\hat{N}_0", "(mu_0*N_hat_0)").replace(r"\mu^*", "mu_star")
    return re.sub(r"\\hat\{\\?(\w+)\}", r"\1_hat", said).replace("\\", "")
