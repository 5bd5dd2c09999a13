"""Signed powers ⌈x⌋^a = |x|^a sign(x) and absolute powers |x|^a as SymPy functions."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any, ClassVar

import sympy as sp
from sympy.core.cache import clear_cache

from quakedesign.errors import KinkError

_ALLOW_KINKS: ContextVar[bool] = ContextVar("allow_kinks", default=False)


@contextmanager
def off_kinks() -> Iterator[None]:
    """Allow derivatives that hold only where no argument of a signed power vanishes."""
    token = _ALLOW_KINKS.set(True)
    try:
        yield
    finally:
        _ALLOW_KINKS.reset(token)
        clear_cache()  # SymPy remembers derivatives, and must not remember these outside


def slope_off_kinks(expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
    """Derivative that holds where no argument of a signed power vanishes."""
    with off_kinks() if expression.has(_Power) else nullcontext():
        return expression.diff(variable)


class _Power(sp.Function):  # type: ignore[misc]
    """Common part: argument, exponent, and the rule for derivatives."""

    nargs = 2
    is_real = True
    _brackets: ClassVar[tuple[str, str]]

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Derivative with respect to the argument; refused where the function has a kink.

        Raises
        ------
        KinkError
            When the derivative is unbounded or jumps at zero, unless inside `off_kinks`.
        """
        x, a = self.args
        if argindex != 1:
            raise KinkError("the exponent of a signed power is a constant; it cannot be differentiated.")
        smooth = sp.simplify(a - 1).is_nonnegative if isinstance(self, SignedPower) else (a - 1).is_positive
        if not smooth and not _ALLOW_KINKS.get():
            raise KinkError(
                f"the derivative of {self} is not continuous where {x} = 0. "
                "Use `with off_kinks():` for the derivative away from that set."
            )
        partner = AbsolutePower if isinstance(self, SignedPower) else SignedPower
        return a * partner(x, a - 1)

    def _latex(self, printer: Any, exp: Any = None) -> str:
        x, a = (printer._print(arg) for arg in self.args)
        body = x.join(self._brackets) + f"^{{{a}}}"
        return body if exp is None else rf"\left({body}\right)^{{{exp}}}"


class SignedPower(_Power):
    """⌈x⌋^a = |x|^a sign(x) for a ≥ 0; the sign at zero is the set [−1, 1], evaluated as 0.

    Parameters
    ----------
    x : Expr
    a : Expr
        Exponent; a negative one arises only from derivatives off the kinks, and has no value at zero.
    """

    _brackets = (r"\left\lceil ", r"\right\rfloor")

    @classmethod
    def eval(cls, x: Any, a: Any) -> sp.Expr | None:
        """Evaluate a = 1, numbers, and pull out signs."""
        if a == 1:
            return x
        if x.is_number and a.is_number and x.is_real and (x != 0 or a >= 0):
            return sp.sign(x) * sp.Abs(x) ** a if x != 0 else sp.Integer(0)
        if x.is_positive:
            return x**a
        if x.could_extract_minus_sign():
            return -cls(-x, a)
        return None


class AbsolutePower(_Power):
    """|x|^a.

    Parameters
    ----------
    x : Expr
    a : Expr
        Exponent; a negative one arises only from derivatives off the kinks.
    """

    is_nonnegative = True
    _brackets = (r"\left|", r"\right|")

    @classmethod
    def eval(cls, x: Any, a: Any) -> sp.Expr | None:
        """Evaluate a = 0, numbers, and drop signs."""
        if a == 0:
            return sp.Integer(1)
        if x.is_number and a.is_number and x.is_real and (x != 0 or a > 0):
            return sp.Abs(x) ** a
        if x.is_positive:
            return x**a
        if x.could_extract_minus_sign():
            return cls(-x, a)
        return None
