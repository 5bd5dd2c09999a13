"""Signed powers ⌈x⌋^a = |x|^a sign(x) and absolute powers |x|^a as SymPy functions.

The normal form of an expression in signed powers reduces the proof of an identity to a comparison with zero.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from typing import Any, ClassVar

import sympy as sp
from sympy.core.cache import clear_cache

from quakedesign.errors import KinkError

# ----------------------------------------------------------------------
# Signed powers ⌈x⌋^a = |x|^a sign(x) and absolute powers |x|^a as SymPy functions.

_ALLOW_KINKS: ContextVar[bool] = ContextVar("allow_kinks", default=False)


@contextmanager
def off_kinks() -> Iterator[None]:
    """Allow derivatives that hold only where no argument of a signed or absolute power vanishes."""
    token = _ALLOW_KINKS.set(True)
    try:
        yield
    finally:
        _ALLOW_KINKS.reset(token)
        clear_cache()  # SymPy caches derivatives; those from this context must not be reused outside it


def slope_off_kinks(expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
    """Derivative that holds where no argument of a signed or absolute power vanishes."""
    with off_kinks() if expression.has(_Power) else nullcontext():
        return expression.diff(variable)


class _Power(sp.Function):  # type: ignore[misc]
    """Common base class: argument, exponent, and the rule for derivatives."""

    nargs = 2
    is_real = True
    _brackets: ClassVar[tuple[str, str]]

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        """Derivative with respect to the argument, if the function has no kink.

        Raises
        ------
        KinkError
            If the derivative is unbounded or jumps at zero, unless inside `off_kinks`; always for the exponent.
        """
        x, a = self.args
        if argindex != 1:
            raise KinkError("a signed power cannot be differentiated with respect to its exponent, which is constant.")
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
        Exponent; negative exponents arise only from derivatives off the kinks, and the power then has no value at zero.
    """

    _brackets = (r"\left\lceil ", r"\right\rfloor")

    @classmethod
    def eval(cls, x: Any, a: Any) -> sp.Expr | None:
        """Evaluate a = 1 and numeric arguments, and extract the sign of the argument."""
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
        Exponent; negative exponents arise only from derivatives off the kinks.
    """

    is_nonnegative = True
    _brackets = (r"\left|", r"\right|")

    @classmethod
    def eval(cls, x: Any, a: Any) -> sp.Expr | None:
        """Evaluate a = 0 and numeric arguments, and drop the sign of the argument."""
        if a == 0:
            return sp.Integer(1)
        if x.is_number and a.is_number and x.is_real and (x != 0 or a > 0):
            return sp.Abs(x) ** a
        if x.is_positive:
            return x**a
        if x.could_extract_minus_sign():
            return cls(-x, a)
        return None


# ----------------------------------------------------------------------
# Normal form of expressions in signed powers, which reduces an identity to a comparison with zero.

_ROUNDS = 6


def normal_form(expression: sp.Expr) -> sp.Expr:
    """Equivalent expanded expression with products of powers of one base merged and nested powers flattened.

    Rules, for real arguments: ⌈⌈x⌋^a⌋^b = ⌈x⌋^{ab}, |⌈x⌋^a|^b = |x|^{ab}, ⌈xy⌋^a = ⌈x⌋^a⌈y⌋^a, |x|^a⌈x⌋^b = ⌈x⌋^{a+b},
    ⌈x⌋^a⌈x⌋^b = |x|^{a+b}; `sympy.sign` and `sympy.Abs` become ⌈·⌋⁰ and |·|. A product of two signs of the same
    argument is 1 also where the argument is zero, which is correct for the limits that span a Filippov set.

    Parameters
    ----------
    expression : Expr
        In real symbols.

    Raises
    ------
    KinkError
        If a negative power of zero remains.
    """
    current = sp.sympify(expression)
    for _ in range(_ROUNDS):
        e = sp.expand(_flat(current))
        following = sp.Add(*(_merged(term) for term in sp.Add.make_args(e)))
        if following == current:
            break
        current = following
    for power in current.atoms(AbsolutePower, SignedPower):
        if power.args[0].is_zero and power.args[1].is_negative:
            raise KinkError(
                f"the expression contains 0 to the negative power {power.args[1]} and is therefore undefined."
            )
    return current


def signs(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    """Arguments P of the signs ⌈P⌋⁰ in an expression, in a fixed order."""
    arguments = {power.args[0] for power in expression.atoms(SignedPower) if power.args[1] == 0}
    return tuple(sorted(arguments, key=sp.default_sort_key))


def _flat(e: sp.Expr) -> sp.Expr:
    """Flatten nested powers, from the inside out."""
    if e.is_Atom:
        return e
    match e:
        case SignedPower() | AbsolutePower():
            return _spread(type(e), normal_form(e.args[0]), e.args[1])
        case sp.Abs():
            return _spread(AbsolutePower, normal_form(e.args[0]), sp.Integer(1))
        case sp.sign():
            return _spread(SignedPower, normal_form(e.args[0]), sp.Integer(0))
    arguments = [_flat(argument) for argument in e.args]
    if e.is_Pow and isinstance(arguments[0], AbsolutePower):
        x, a = arguments[0].args
        return AbsolutePower(x, a * arguments[1])
    if e.is_Pow and arguments[0].is_Add and arguments[0].is_nonnegative and not arguments[1].is_Integer:
        return _spread(AbsolutePower, normal_form(arguments[0]), arguments[1])
    return e.func(*arguments)


def _spread(kind: type, inner: sp.Expr, a: sp.Expr) -> sp.Expr:
    """⌈Π y_i^n_i⌋^a or |Π y_i^n_i|^a as a product of powers of the single y_i."""
    content, rest = _content(inner)
    result = sp.Integer(1)
    for factor in (*sp.Mul.make_args(content), *sp.Mul.make_args(rest)):
        plain = factor.is_positive or (factor.is_nonnegative and a.is_positive and not factor.is_Add)
        result *= factor**a if plain else _spread_factor(kind, factor, a)
    return result


def _spread_factor(kind: type, factor: sp.Expr, a: sp.Expr) -> sp.Expr:
    base, n = factor.as_base_exp()
    if not (n.is_Integer and n > 0):
        return kind(factor, a)
    odd = kind is SignedPower and n % 2 == 1
    match base:
        case AbsolutePower():
            return AbsolutePower(base.args[0], base.args[1] * n * a)
        case SignedPower():
            return (SignedPower if odd else AbsolutePower)(base.args[0], base.args[1] * n * a)
    return (SignedPower if odd else AbsolutePower)(base, n * a)


def _content(inner: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Common factor and remainder of an expanded sum; symbols of unknown sign have integer exponents in the factor."""
    terms = sp.Add.make_args(inner)
    if len(terms) == 1:
        return sp.Integer(1), inner
    shared = [term.as_powers_dict() for term in terms]
    factor = sp.Integer(1)
    for symbol in sorted({b for powers in shared for b in powers if b.is_Symbol}, key=sp.default_sort_key):
        exponents = [powers.get(symbol, sp.Integer(0)) for powers in shared]
        usable = all(n.is_Rational if symbol.is_positive else n.is_Integer for n in exponents)
        if usable and (least := min(exponents)) and (symbol.is_positive or least > 0):
            factor *= symbol**least
    content, rest = sp.expand(inner / factor).primitive()
    return factor * content, rest


def _merged(term: sp.Expr) -> sp.Expr:
    """Merge the powers of every base that occurs in a signed or absolute power."""
    factors = [factor.as_base_exp() for factor in sp.Mul.make_args(term)]
    bases = {base.args[0] for base, n in factors if isinstance(base, SignedPower | AbsolutePower) and n.is_Integer}
    rest, totals = sp.Integer(1), dict.fromkeys(sorted(bases, key=sp.default_sort_key), (sp.Integer(0), 0))
    for base, n in factors:
        power = isinstance(base, SignedPower | AbsolutePower)
        y, a = base.args if power else (base, sp.Integer(1))
        if y in totals and n.is_Integer:
            odd = int(n) if not isinstance(base, AbsolutePower) else 0
            totals[y] = (totals[y][0] + a * n, totals[y][1] + odd)
        else:
            rest *= base**n
    return rest * sp.Mul(*(_rebuilt(y, total, odd % 2 == 1) for y, (total, odd) in totals.items()))


def _rebuilt(y: sp.Expr, total: sp.Expr, odd: bool) -> sp.Expr:
    if total.is_Integer and total >= 0 and (total % 2 == 1) == odd:
        return y**total
    return (SignedPower if odd else AbsolutePower)(y, total)


def symbols_of(expressions: Iterable[sp.Expr]) -> tuple[sp.Symbol, ...]:
    """All free symbols, in a fixed order."""
    return tuple(sorted(set().union(*(e.free_symbols for e in expressions)), key=sp.default_sort_key))
