"""Reading of polynomials and constraints from text, SymPy or mappings.

Text is parsed with a dedicated grammar and never passed to an interpreter. Every limit on time and memory is checked
before the operation that it limits.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import comb, floor, prod
from numbers import Real
from typing import Any, Literal, NamedTuple, NoReturn

from flint import fmpq

from quakedesign.errors import PolynomialError
from quakedesign.exact import fraction_of, rational
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, from_sympy
from quakedesign.sos.exact.proofs import Element, as_element

# ----------------------------------------------------------------------
# Expansion of polynomials with a work budget: every limit is checked before the operation that it limits.

DEGREE = 60
"""Largest total degree of any intermediate polynomial, and largest exponent."""
MONOMIALS = 10_000
"""Largest number of monomials of any intermediate polynomial."""
DIGITS = 400
"""Largest number of decimal digits of the numerator and of the denominator of a number in the text."""
COEFFICIENT_DIGITS = 1000
"""Largest number of decimal digits of any intermediate numerator or denominator."""

_WORK = 2_000_000  # sums and products of two short coefficients in one text: about a second
_FIELD = 7  # bits per exponent; the sum of two exponents up to DEGREE fits
_BITS_OF_NUMBERS = (10**DIGITS).bit_length()
_BITS = (10**COEFFICIENT_DIGITS).bit_length()
_SHORT = 256  # bits; longer coefficients cost more of the budget

ExpandedExponents = tuple[int, ...]
Terms = dict[int, Any]
"""Exponents packed into one integer, the total degree on top, to nonzero fmpq."""


class Token(NamedTuple):
    """A token of the text: kind, characters and position of the first character."""

    kind: str
    text: str
    start: int


def reject(text: str, token: Token, expected: str, remedy: str) -> NoReturn:
    """Raise PolynomialError with a short one-line excerpt, in which ⟦ ⟧ marks the token."""
    start, end = token.start, token.start + min(len(token.text), 24)
    before, after = text[max(0, start - 24) : start], text[end : end + 24]
    shown = f"{'…' if start > 24 else ''}{before}⟦{text[start:end]}⟧{after}{'…' if end + 24 < len(text) else ''}"
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in shown)
    where = "at the end" if token.kind == "end" else f"at character {start + 1}"
    raise PolynomialError(f"expected {expected} {where}. Received {line}. {remedy}")


class Expansion:
    """Arithmetic on the polynomials of one text, which share one work budget.

    Operands must not be reused, as a sum may be formed in place.

    Parameters
    ----------
    text : str
        Text that messages quote.
    variables : sequence of str
        Names in the order of the exponents.
    """

    def __init__(self, text: str, variables: Sequence[str]) -> None:
        self._text = text
        count = len(variables)
        self._top = _FIELD * count
        self._units = {name: (1 << _FIELD * i) + (1 << self._top) for i, name in enumerate(variables)}
        self._count = count
        self._work = _WORK

    def number(self, token: Token) -> Terms:
        """Constant polynomial of a decimal number."""
        mantissa, _, exponent = token.text.lower().partition("e")
        whole, _, decimals = mantissa.partition(".")
        if len(mantissa) > DIGITS or len(exponent) > 5 or abs(int(exponent or "0")) > DIGITS:
            self._too_long(token)
        power = int(exponent or "0") - len(decimals)
        value = fmpq(int(whole + decimals)) * fmpq(10) ** power
        if value.height_bits() > _BITS_OF_NUMBERS:
            self._too_long(token)
        return {0: value} if value else {}

    def _too_long(self, token: Token) -> NoReturn:
        reject(self._text, token, f"a number of at most {DIGITS} digits", "Round it, or scale the polynomial.")

    def variable(self, token: Token) -> Terms:
        """Polynomial of one name."""
        return {self._units[token.text]: fmpq(1)}

    def negative(self, terms: Terms, token: Token) -> Terms:
        """−p."""
        self._spend(len(terms), token)
        return {key: -value for key, value in terms.items()}

    def add(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p + q, formed in the longer of the two."""
        total, other = (left, right) if len(left) >= len(right) else (right, left)
        self._spend(len(other), token, other)
        for key, value in other.items():
            self._accumulate(total, key, value, token)
        self._check_size(len(total), token)
        return total

    def multiply(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p·q."""
        if self._degree(left) + self._degree(right) > DEGREE:
            reject(self._text, token, f"degree at most {DEGREE}", "Lower the degree.")
        self._spend(len(left) * len(right), token, left, right)
        total: Terms = {}
        for key, value in left.items():
            for other, factor in right.items():
                self._accumulate(total, key + other, value * factor, token)
            self._check_size(len(total), token)
        return total

    def divide(self, left: Terms, right: Terms, token: Token) -> Terms:
        """p/c for a nonzero number c."""
        if set(right) != {0}:
            reject(self._text, token, "a nonzero number after /", "Multiply out; only a number can be a divisor.")
        return self.multiply(left, {0: 1 / right[0]}, token)

    def power(self, base: Terms, token: Token) -> Terms:
        """Power p^n; the token must be a whole number n."""
        if not token.text.isdigit() or len(token.text) > 9 or int(token.text) > DEGREE:
            expected = f"a whole number from 0 to {DEGREE} as exponent"
            reject(self._text, token, expected, "Write the exponent in digits, for example x^2.")
        exponent = int(token.text)
        self._check_size(self._size_of_power(base, exponent), token)
        total: Terms = {0: fmpq(1)}
        for _ in range(exponent):
            total = self.multiply(total, base, token)
        return total

    def _size_of_power(self, base: Terms, exponent: int) -> int:
        """Upper bound on the number of monomials of a power, from its terms, exponents and degree."""
        sizes = [max((key >> _FIELD * i) % (1 << _FIELD) for key in base or (0,)) for i in range(self._count)]
        box = prod(size * exponent + 1 for size in sizes)
        degree = self._degree(base) * exponent
        within = comb(degree + sum(size > 0 for size in sizes), degree)
        return min(comb(max(len(base), 1) + exponent - 1, exponent), box, within)

    def unpacked(self, terms: Terms) -> dict[ExpandedExponents, Fraction]:
        """Exponents and rational coefficients of a result."""
        fields = [_FIELD * i for i in range(self._count)]
        return {
            tuple(key >> field & (1 << _FIELD) - 1 for field in fields): fraction_of(value)
            for key, value in terms.items()
        }

    def _degree(self, terms: Terms) -> int:
        return max(terms, default=0) >> self._top

    def _spend(self, operations: int, token: Token, *operands: Terms) -> None:
        longest = sum(max((value.height_bits() for value in terms.values()), default=0) for terms in operands)
        self._work -= operations * (1 + longest // _SHORT) + sum(map(len, operands))
        if self._work < 0:
            reject(self._text, token, "an expression with fewer operations", "Expand or simplify it.")

    def _check_size(self, monomials: int, token: Token) -> None:
        if monomials > MONOMIALS:
            reject(self._text, token, f"at most {MONOMIALS} monomials", "Use fewer variables, or a lower degree.")

    def _accumulate(self, total: Terms, key: int, value: Any, token: Token) -> None:
        old = total.get(key)
        new = value if old is None else old + value
        if not new:
            total.pop(key, None)
        elif new.height_bits() > _BITS:
            expected = f"coefficients of at most {COEFFICIENT_DIGITS} digits"
            reject(self._text, token, expected, "Round or scale the numbers.")
        else:
            total[key] = new


# ----------------------------------------------------------------------
# Polynomials and constraints read from text by a dedicated grammar, in bounded time and memory.
#
# A polynomial is built from numbers (12, 0.5, 1e-8), names, + - * / ^ ** and parentheses. A product needs a *, an
# exponent is a whole number from 0 to 60, and a divisor is a number. A constraint is two polynomials joined by >=, <=
# or ==. A name that commonly denotes a number (pi, nan, …) is a variable only if the variables are given. Text is never
# passed to an interpreter, and every limit is checked before the operation that it limits.

LENGTH = 20_000
"""Largest number of characters of a text."""
DEPTH = 100
"""Largest depth of nested parentheses."""
VARIABLES = 16
"""Largest number of different names."""

_NAME = 32  # characters
_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<operator>\*\*|[-+*/^−()])"
    r"|(?P<relation>[<>=]=?)"
)
_BLANK = re.compile(r"[ \t\r\n]*")
_SAME = {"**": "^", "−": "-", "=": "=="}
_STRENGTH = {"+": 1, "-": 1, "*": 2, "/": 2, "negative": 3}
_NUMBERS = frozenset({"nan", "NaN", "NAN", "inf", "Inf", "INF", "infinity", "Infinity", "oo", "zoo", "pi", "E", "I"})
_RELATIONS = {">=": "inequality", "<=": "inequality", "==": "equality"}

Kind = Literal["inequality", "equality"]


def parse(
    text: str, variables: Sequence[str] | None = None
) -> tuple[tuple[str, ...], dict[ExpandedExponents, Fraction]]:
    """Variables and expanded polynomial of a text.

    Parameters
    ----------
    text : str
        For example ``x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2``.
    variables : sequence of str, optional
        Names in order; any other name in the text is rejected. By default, the names in order of appearance, none of
        which may denote a number (``pi``, ``E``, ``I``, ``nan``, ``inf``, ``oo``, …).

    Returns
    -------
    variables : tuple of str
    polynomial : dict of exponents to Fraction
        Without zero coefficients; empty for the zero polynomial.

    Raises
    ------
    PolynomialError
        When the text is not a polynomial, names another variable, or exceeds a limit of this module.
    """
    tokens = _tokens(text)
    order = _order(text, tokens, variables)
    relation = next((token for token in tokens if token.kind == "relation"), None)
    if relation:
        reject(text, relation, "a polynomial without relation", 'Give constraints separately: on="x >= 0".')
    expansion = Expansion(text, order)
    return order, expansion.unpacked(_evaluate(text, tokens, expansion))


def parse_constraint(
    text: str, variables: Sequence[str] | None = None
) -> tuple[Kind, tuple[str, ...], dict[ExpandedExponents, Fraction]]:
    """Kind, variables and polynomial g of a constraint: g ≥ 0 for an inequality, g = 0 for an equality.

    Parameters
    ----------
    text : str
        Two polynomials joined by ``>=``, ``<=``, ``==`` or ``=``; for example ``x^2 + y^2 == 1``.
    variables : sequence of str, optional
        As in `parse`.

    Returns
    -------
    kind : "inequality" or "equality"
    variables : tuple of str
    polynomial : dict of exponents to Fraction
        Left side minus right side; right side minus left side for ``<=``.

    Raises
    ------
    PolynomialError
        As in `parse`, and when there is no relation, more than one, or a strict one.
    """
    tokens = _tokens(text)
    order = _order(text, tokens, variables)
    at = _relation(text, tokens)
    sign = tokens[at].text
    expansion = Expansion(text, order)
    stop = Token("end", "", tokens[at].start)
    sides = [_evaluate(text, [*tokens[:at], stop], expansion), _evaluate(text, tokens[at + 1 :], expansion)]
    greater, smaller = reversed(sides) if sign == "<=" else sides
    difference = expansion.add(greater, expansion.negative(smaller, tokens[at]), tokens[at])
    kind: Kind = "equality" if sign == "==" else "inequality"
    return kind, order, expansion.unpacked(difference)


def names_in_text(*texts: str) -> tuple[str, ...]:
    """Variables of several polynomials and constraints, in order of first appearance.

    Raises
    ------
    PolynomialError
        When a text has an invalid character, or all texts together have too many variables.
    """
    names = dict.fromkeys(name for text in texts for name in _order(text, _tokens(text), None))
    if len(names) > VARIABLES:
        raise PolynomialError(f"different variables must be at most {VARIABLES}. Received {len(names)}. Use fewer.")
    return tuple(names)


def _tokens(text: str) -> list[Token]:
    if not isinstance(text, str):
        raise PolynomialError(f"a polynomial is text. Received {type(text).__name__}. Write for example 'x^2 + 1'.")
    if len(text) > LENGTH:
        raise PolynomialError(
            f"a polynomial has at most {LENGTH} characters. Received {len(text)}. "
            "Factor it, or give a mapping of exponents to coefficients."
        )
    return [*_scan(text), Token("end", "", len(text))]


def _scan(text: str) -> Iterator[Token]:
    place = _blank(text, 0)
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            remedy = "Use numbers, names, + - * / ^ ** and parentheses."
            reject(text, Token("other", text[place], place), "a number, a name or an operator", remedy)
        yield Token(str(match.lastgroup), _SAME.get(match[0], match[0]), place)
        place = _blank(text, match.end())


def _blank(text: str, place: int) -> int:
    match = _BLANK.match(text, place)
    return match.end() if match else place


def _order(text: str, tokens: Sequence[Token], variables: Sequence[str] | None) -> tuple[str, ...]:
    used = {token.text: token for token in reversed(tokens) if token.kind == "name"}
    order = tuple(sorted(used, key=lambda name: used[name].start)) if variables is None else _checked(variables)
    for name, token in used.items():
        if len(name) > _NAME:
            reject(text, token, f"a name of at most {_NAME} characters", "Shorten it.")
        if variables is None and name in _NUMBERS:
            remedy = "Write numbers in digits; rename a variable, or declare it (variables=)."
            reject(text, token, "a number in digits or the name of a variable", remedy)
        if name not in order:
            reject(text, token, f"one of the variables {', '.join(order)}", "Correct the name, or declare it.")
    if len(order) > VARIABLES:
        reject(text, used[order[VARIABLES]], f"at most {VARIABLES} different variables", "Use fewer.")
    return order


def _checked(variables: Sequence[str]) -> tuple[str, ...]:
    order = (variables,) if isinstance(variables, str) else tuple(variables)
    good = all(isinstance(name, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{,31}", name) for name in order)
    if not good or len(set(order)) != len(order) or len(order) > VARIABLES:
        raise PolynomialError(
            f"variables must be at most {VARIABLES} different names of at most {_NAME} ASCII letters, digits and "
            f"underscores, without a digit in front. Received {str(order)[:60]}. Rename them."
        )
    return order


def _relation(text: str, tokens: Sequence[Token]) -> int:
    """Index of the only relation among the tokens."""
    places = [i for i, token in enumerate(tokens) if token.kind == "relation"]
    if not places:
        reject(text, tokens[-1], "one of >=, <=, ==", "Write for example x >= 0.")
    if len(places) > 1:
        reject(text, tokens[places[1]], "only one relation", "Give two constraints instead of a chain.")
    token = tokens[places[0]]
    if token.text not in _RELATIONS:
        reject(text, token, "one of >=, <=, ==", "Only closed sets are supported; write >= for >.")
    return places[0]


def _evaluate(text: str, tokens: Sequence[Token], expansion: Expansion) -> Terms:
    """Value of an expression, by two stacks (Dijkstra's shunting yard), so that nesting needs no recursion."""
    values: list[Terms] = []
    pending: list[Token] = []
    place, operand = 0, True
    while place < len(tokens):
        if operand:
            operand = not _begin(text, tokens[place], values, pending, expansion)
        elif tokens[place].text == "^":
            place += 1
            values[-1] = expansion.power(values[-1], tokens[place])
            if tokens[place + 1].text == "^":
                reject(text, tokens[place + 1], "only one exponent", "Write (x^2)^3 for a power of a power.")
        else:
            operand = _continue(text, tokens[place], values, pending, expansion)
        place += 1
    return values.pop()


def _begin(text: str, token: Token, values: list[Terms], pending: list[Token], expansion: Expansion) -> bool:
    """Process a token where an operand must begin; whether the operand is complete."""
    if token.kind in ("number", "name"):
        values.append(expansion.number(token) if token.kind == "number" else expansion.variable(token))
        return True
    sign = token.text
    if sign == "(":
        if sum(other.text == "(" for other in pending) >= DEPTH:
            reject(text, token, f"at most {DEPTH} nested parentheses", "Remove some, or expand.")
        pending.append(token)
    elif sign == "-":
        pending.append(token._replace(kind="negative"))
    elif sign != "+":
        reject(text, token, "a number, a name or (", "Complete the expression.")
    return False


def _continue(text: str, token: Token, values: list[Terms], pending: list[Token], expansion: Expansion) -> bool:
    """Process a token after a complete operand; whether another operand must follow."""
    sign = token.text
    if token.kind not in ("end", "operator") or sign == "(":
        reject(text, token, "an operator", "Write products with *, for example 2*x.")
    strength = _STRENGTH.get(sign, 0)
    while pending and pending[-1].text != "(" and _strength(pending[-1]) >= strength:
        _apply(pending.pop(), values, expansion)
    if token.kind == "end" and pending:
        reject(text, pending[-1], "a closing parenthesis for this (", "Balance the parentheses.")
    if sign == ")" and not pending:
        reject(text, token, "an opening parenthesis for this )", "Balance the parentheses.")
    if sign == ")":
        pending.pop()
    else:
        pending.append(token)
    return sign != ")"


def _strength(token: Token) -> int:
    return _STRENGTH["negative" if token.kind == "negative" else token.text]


def _apply(token: Token, values: list[Terms], expansion: Expansion) -> None:
    last = values.pop()
    sign = token.text
    if token.kind == "negative":
        values.append(expansion.negative(last, token))
    elif sign == "*":
        values.append(expansion.multiply(values.pop(), last, token))
    elif sign == "/":
        values.append(expansion.divide(values.pop(), last, token))
    else:
        values.append(expansion.add(values.pop(), last if sign == "+" else expansion.negative(last, token), token))


# ----------------------------------------------------------------------
# Conversion of text, SymPy expressions or sparse mappings to sparse polynomials in common variables.

_AUTO = "auto"


def read(
    polynomial: Any, on: Sequence[Any], multiplier: Any, variables: Sequence[Any] | None
) -> tuple[tuple[str, ...], dict[Exponents, Fraction], tuple[Polynomial, ...], tuple[Polynomial, ...], Any]:
    """Variables, polynomial, inequalities, equalities and multiplier (None, ``"auto"`` or a polynomial).

    Raises
    ------
    PolynomialError
        When an input is not readable, a variable occurs twice, or a mapping is given without variables.
    """
    if isinstance(on, str):
        on = (on,)
    automatic = multiplier is None or (isinstance(multiplier, str) and multiplier == _AUTO)
    inputs = [polynomial, *on, *([] if automatic else [multiplier])]
    names = tuple(map(str, variables)) if variables is not None else _names_of_inputs(inputs)
    if len(set(names)) < len(names):
        raise PolynomialError(f"variables must be different. Received {', '.join(names)}. Rename one.")
    exact = _polynomial(polynomial, names)
    constraints = [_constraint(c, names) for c in on]
    factor = multiplier if automatic else _polynomial(multiplier, names)
    inequalities = tuple(p for kind, p in constraints if kind == "inequality")
    equalities = tuple(p for kind, p in constraints if kind == "equality")
    return names, exact, inequalities, equalities, factor


def read_element(given: Any, names: tuple[str, ...]) -> Element:
    """Basis element from a polynomial as for `read`, or from the exponents of a monomial."""
    exponents = tuple(map(_whole, given)) if isinstance(given, Sequence) and not isinstance(given, str) else None
    return as_element(_polynomial({exponents: 1} if exponents is not None else given, names))


def _whole(exponent: Any) -> Any:
    """Exponent as an integer if its value is whole, otherwise as text, which is rejected later."""
    return floor(exponent) if isinstance(exponent, Real) and exponent % 1 == 0 else str(exponent)


def _names_of_inputs(inputs: Sequence[Any]) -> tuple[str, ...]:
    names: dict[str, None] = {}
    for one in inputs:
        match one:
            case str():
                names |= dict.fromkeys(names_in_text(one))
            case object(free_symbols=symbols):
                names |= dict.fromkeys(sorted(s.name for s in symbols))
            case Mapping():
                raise PolynomialError(
                    "a polynomial given by its exponents needs its variables. Received none. Give variables=('x', 'y')."
                )
    return tuple(names) or ("x",)


def _polynomial(given: Any, names: tuple[str, ...]) -> dict[Exponents, Fraction]:
    if isinstance(given, str):
        return parse(given, names)[1]
    if isinstance(given, Mapping):
        for e in given:
            if not isinstance(e, tuple) or len(e) != len(names) or not all(type(x) is int and x >= 0 for x in e):
                raise PolynomialError(
                    f"exponents must be {len(names)} non-negative integers in a tuple. Received {e!r}."
                )
        exact = {e: rational(c, "coefficient") for e, c in given.items()}
        return {e: c for e, c in exact.items() if c}
    if hasattr(given, "free_symbols"):
        return _sympy(given, names)
    return {e: c for e, c in {(0,) * len(names): rational(given, "polynomial")}.items() if c}


def _sympy(given: Any, names: tuple[str, ...]) -> dict[Exponents, Fraction]:
    by_name = {s.name: s for s in given.free_symbols}
    unknown = sorted(set(by_name) - set(names))
    if unknown:
        raise PolynomialError(f"variables must be among {', '.join(names)}. Received {', '.join(unknown)} as well.")
    import sympy as sp

    return from_sympy(given, [by_name.get(n, sp.Symbol(n)) for n in names])


def _constraint(given: Any, names: tuple[str, ...]) -> tuple[str, dict[Exponents, Fraction]]:
    read = parse_constraint if isinstance(given, str) else _read_relation
    kind, *_, polynomial = read(given, names)
    if not polynomial:
        raise PolynomialError(f"the constraint {given} reduces to 0 >= 0 or 0 == 0: omit it.")
    return kind, polynomial


def _read_relation(given: Any, names: tuple[str, ...]) -> tuple[str, dict[Exponents, Fraction]]:
    import sympy as sp

    match given:
        case sp.GreaterThan():
            return "inequality", _sympy(given.lhs - given.rhs, names)
        case sp.LessThan():
            return "inequality", _sympy(given.rhs - given.lhs, names)
        case sp.Equality():
            return "equality", _sympy(given.lhs - given.rhs, names)
    raise PolynomialError(
        f"a constraint is text such as 'x >= 0', or a SymPy relation >=, <=, Eq. Received {given!s:.60}. "
        "Strict inequalities are not supported, as their sets are not closed; use >=."
    )
