"""One normal form for expressions in signed powers: an identity between them becomes a comparison with zero."""

from collections.abc import Iterable

import sympy as sp

from quakedesign.errors import KinkError, ParameterError
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

_ROUNDS = 6


def normal_form(expression: sp.Expr) -> sp.Expr:
    """Equal expression, expanded, with every product of powers of one base merged and every nested power flattened.

    Rules, for real arguments: ⌈⌈x⌋^a⌋^b = ⌈x⌋^{ab}, |⌈x⌋^a|^b = |x|^{ab}, ⌈xy⌋^a = ⌈x⌋^a⌈y⌋^a, |x|^a⌈x⌋^b = ⌈x⌋^{a+b},
    ⌈x⌋^a⌈x⌋^b = |x|^{a+b}; `sympy.sign` and `sympy.Abs` become ⌈·⌋⁰ and |·|. A product of two signs of one argument is
    1, as for the limits that make up a Filippov set.

    Parameters
    ----------
    expression : Expr
        In real symbols.

    Returns
    -------
    Expr

    Raises
    ------
    KinkError
        Where a negative power of zero remains.
    """
    current = sp.sympify(expression)
    for _ in range(_ROUNDS):
        following = _collected(sp.expand(_flat(current)))
        if following == current:
            break
        current = following
    for power in current.atoms(AbsolutePower, SignedPower):
        if power.args[0].is_zero and power.args[1].is_negative:
            raise KinkError(
                f"a negative power {power.args[1]} of zero remains: the expression is not defined on this set."
            )
    return current


def signs(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    """Arguments P of the signs ⌈P⌋⁰ in an expression, in a fixed order."""
    found = {power.args[0] for power in expression.atoms(SignedPower) if power.args[1] == 0}
    return tuple(sorted(found, key=sp.default_sort_key))


def solve_signed(condition: sp.Expr | sp.Eq, variable: sp.Symbol) -> sp.Expr:
    """Only real solution of condition = 0 for a variable that occurs in one signed power.

    c·⌈Q⌋^a + rest = 0 becomes Q = −⌈rest/c⌋^{1/a}, again and again, until the variable stands alone.

    Parameters
    ----------
    condition : Expr or Eq
    variable : Symbol

    Returns
    -------
    Expr

    Raises
    ------
    ParameterError
        When the variable occurs not at all, in several terms, in an even power, or with a coefficient that may vanish.
    """
    left = condition.lhs - condition.rhs if isinstance(condition, sp.Equality) else condition
    left = normal_form(left)
    terms = sp.Add.make_args(left)
    own = [term for term in terms if term.has(variable)]
    if len(own) != 1:
        raise ParameterError(
            f"{variable} must occur in exactly one term of {left} = 0 to be solved for. It occurs in {len(own)}. "
            "Solve for another variable, or split into sign cells."
        )
    coefficient, power = own[0].as_independent(variable, as_Add=False)
    inner, exponent = _odd_power(power, left)
    if not coefficient.is_nonzero:
        raise ParameterError(f"the coefficient {coefficient} of {power} must not vanish. Declare its symbols positive.")
    target = -SignedPower(normal_form((left - own[0]) / coefficient), 1 / exponent)
    return normal_form(target) if inner == variable else solve_signed(inner - target, variable)


def _odd_power(power: sp.Expr, left: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    base, n = power.as_base_exp()
    inner, a = base.args if isinstance(base, SignedPower) else (base, sp.Integer(1))
    if n.is_Integer and n % 2 == 1 and (a * n).is_positive and not isinstance(base, AbsolutePower):
        return inner, a * n
    raise ParameterError(
        f"{power} in {left} = 0 takes a value twice or jumps. Only odd powers ⌈·⌋^a, a > 0, are solved."
    )


def _flat(e: sp.Expr) -> sp.Expr:
    """Flatten nested powers, from the inside out."""
    if e.is_Atom:
        return e
    if isinstance(e, SignedPower | AbsolutePower):
        return _spread(type(e), normal_form(e.args[0]), e.args[1])
    if isinstance(e, sp.Abs):
        return _spread(AbsolutePower, normal_form(e.args[0]), sp.Integer(1))
    if isinstance(e, sp.sign):
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
    if isinstance(base, AbsolutePower):
        return AbsolutePower(base.args[0], base.args[1] * n * a)
    if isinstance(base, SignedPower):
        return (SignedPower if odd else AbsolutePower)(base.args[0], base.args[1] * n * a)
    return (SignedPower if odd else AbsolutePower)(base, n * a)


def _content(inner: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Positive factor and rest of an expanded sum: powers of positive symbols and whole powers that all terms share."""
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


def _collected(e: sp.Expr) -> sp.Expr:
    return sp.Add(*(_merged(term) for term in sp.Add.make_args(e)))


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


def is_identity(left: sp.Expr, right: sp.Expr | int = 0) -> bool:
    """Whether two expressions have one normal form; False does not mean that they differ."""
    return bool(normal_form(left - right) == 0)


def symbols_of(expressions: Iterable[sp.Expr]) -> tuple[sp.Symbol, ...]:
    """All free symbols, in a fixed order."""
    return tuple(sorted(set().union(*(e.free_symbols for e in expressions)), key=sp.default_sort_key))
