"""Polynomials and constraints read from text by a grammar of our own, in bounded time and memory.

A polynomial is built from numbers (12, 0.5, 1e-8), names, + - * / ^ ** and parentheses. Products need their *, powers
a whole number from 0 to 60, and only numbers divide. A constraint is two polynomials around >=, <= or ==.
A name that elsewhere is a number (pi, nan, …) is a variable only where the variables are given.
Nothing is ever handed to an interpreter, and every limit is enforced before the work that it limits.
"""

import re
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Literal

from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.expansion import Expansion, Exponents, Terms, Token, refuse

LENGTH = 20_000
"""Characters of one text."""
DEPTH = 100
"""Parentheses inside one another."""
VARIABLES = 16
"""Different names."""

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


def parse(text: str, variables: Sequence[str] | None = None) -> tuple[tuple[str, ...], dict[Exponents, Fraction]]:
    """Variables and expanded polynomial of a text.

    Parameters
    ----------
    text : str
        For example ``x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2``.
    variables : sequence of str, optional
        Names and their order; any other name in the text is refused. Unless given, the names in order of appearance,
        none of which may be that of a number (``pi``, ``E``, ``I``, ``nan``, ``inf``, ``oo``, …).

    Returns
    -------
    variables : tuple of str
    polynomial : dict of exponents to Fraction
        Without zeros; empty for the zero polynomial.

    Raises
    ------
    PolynomialError
        When the text is not a polynomial, names another variable, or exceeds a limit of this module.
    """
    tokens = _tokens(text)
    order = _order(text, tokens, variables)
    relation = next((token for token in tokens if token.kind == "relation"), None)
    if relation:
        refuse(text, relation, "a polynomial without relation", "Give constraints apart, for example on x>=0.")
    expansion = Expansion(text, order)
    return order, expansion.unpacked(_evaluate(text, tokens, expansion))


def parse_constraint(
    text: str, variables: Sequence[str] | None = None
) -> tuple[Kind, tuple[str, ...], dict[Exponents, Fraction]]:
    """Kind, variables and polynomial g of a constraint, which is g ≥ 0 for an inequality and g = 0 for an equality.

    Parameters
    ----------
    text : str
        Two polynomials around one of ``>=``, ``<=``, ``==``; for example ``x^2 + y^2 == 1``.
    variables : sequence of str, optional
        As in `parse`.

    Returns
    -------
    kind : "inequality" or "equality"
    variables : tuple of str
    polynomial : dict of exponents to Fraction
        Left minus right, but right minus left for ``<=``.

    Raises
    ------
    PolynomialError
        As in `parse`, and when there is not exactly one relation or it is strict.
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


def names(*texts: str) -> tuple[str, ...]:
    """Variables of several polynomials and constraints, in order of first appearance.

    Raises
    ------
    PolynomialError
        When a text has a character that no polynomial has, or together they have too many variables.
    """
    found = dict.fromkeys(name for text in texts for name in _order(text, _tokens(text), None))
    if len(found) > VARIABLES:
        raise PolynomialError(
            f"at most {VARIABLES} different variables are read. Received {len(found)}. Use fewer, or rename them."
        )
    return tuple(found)


def _tokens(text: str) -> list[Token]:
    if not isinstance(text, str):
        raise PolynomialError(f"a polynomial is text. Received {type(text).__name__}. Write for example 'x^2 + 1'.")
    if len(text) > LENGTH:
        raise PolynomialError(
            f"a polynomial has at most {LENGTH} characters. Received {len(text)}. Factor it, or hand over its terms."
        )
    return [*_scan(text), Token("end", "", len(text))]


def _scan(text: str) -> Iterator[Token]:
    place = _blank(text, 0)
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            remedy = "Use numbers, names, + - * / ^ ** and parentheses."
            refuse(text, Token("other", text[place], place), "a number, a name or an operator", remedy)
        yield Token(str(match.lastgroup), _SAME.get(match[0], match[0]), place)
        place = _blank(text, match.end())


def _blank(text: str, place: int) -> int:
    found = _BLANK.match(text, place)
    return found.end() if found else place


def _order(text: str, tokens: Sequence[Token], variables: Sequence[str] | None) -> tuple[str, ...]:
    used = {token.text: token for token in reversed(tokens) if token.kind == "name"}
    order = tuple(sorted(used, key=lambda name: used[name].start)) if variables is None else _checked(variables)
    for name, token in used.items():
        if len(name) > _NAME:
            refuse(text, token, f"a name of at most {_NAME} characters", "Shorten it.")
        if variables is None and name in _NUMBERS:
            remedy = "Write numbers in digits; name a variable otherwise, or declare it (variables=)."
            refuse(text, token, "a number in digits or the name of a variable", remedy)
        if name not in order:
            refuse(text, token, f"one of the variables {', '.join(order)}", "Correct the name, or declare it.")
    if len(order) > VARIABLES:
        refuse(text, used[order[VARIABLES]], f"at most {VARIABLES} different variables", "Use fewer.")
    return order


def _checked(variables: Sequence[str]) -> tuple[str, ...]:
    order = (variables,) if isinstance(variables, str) else tuple(variables)
    good = all(isinstance(name, str) and re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{,31}", name) for name in order)
    if not good or len(set(order)) != len(order) or len(order) > VARIABLES:
        raise PolynomialError(
            f"variables must be at most {VARIABLES} different names of ASCII letters, digits and underscores. "
            f"Received {str(order)[:60]}. Rename them."
        )
    return order


def _relation(text: str, tokens: Sequence[Token]) -> int:
    """Place of the only relation among the tokens."""
    places = [i for i, token in enumerate(tokens) if token.kind == "relation"]
    if not places:
        refuse(text, tokens[-1], "one of >=, <=, ==", "Write for example x >= 0.")
    if len(places) > 1:
        refuse(text, tokens[places[1]], "only one relation", "Give two constraints instead of a chain.")
    token = tokens[places[0]]
    if token.text not in _RELATIONS:
        refuse(text, token, "one of >=, <=, ==", "Sets are closed here; write >= for >.")
    return places[0]


def _evaluate(text: str, tokens: Sequence[Token], expansion: Expansion) -> Terms:
    """Value of a whole expression, by two stacks (Dijkstra's shunting yard), so that nesting costs no recursion."""
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
                refuse(text, tokens[place + 1], "only one exponent", "Write (x^2)^3 for a power of a power.")
        else:
            operand = _continue(text, tokens[place], values, pending, expansion)
        place += 1
    return values.pop()


def _begin(text: str, token: Token, values: list[Terms], pending: list[Token], expansion: Expansion) -> bool:
    """Take a token where an operand must begin; whether it is complete."""
    if token.kind in ("number", "name"):
        values.append(expansion.number(token) if token.kind == "number" else expansion.variable(token))
        return True
    sign = token.text
    if sign == "(":
        if sum(other.text == "(" for other in pending) >= DEPTH:
            refuse(text, token, f"at most {DEPTH} nested parentheses", "Remove some, or expand.")
        pending.append(token)
    elif sign == "-":
        pending.append(token._replace(kind="negative"))
    elif sign != "+":
        refuse(text, token, "a number, a name or (", "Complete the expression there.")
    return False


def _continue(text: str, token: Token, values: list[Terms], pending: list[Token], expansion: Expansion) -> bool:
    """Take a token after a complete operand; whether another operand must follow."""
    sign = token.text
    if token.kind not in ("end", "operator") or sign == "(":
        refuse(text, token, "an operator", "Write products with *, for example 2*x.")
    strength = _STRENGTH.get(sign, 0)
    while pending and pending[-1].text != "(" and _strength(pending[-1]) >= strength:
        _apply(pending.pop(), values, expansion)
    if token.kind == "end" and pending:
        refuse(text, pending[-1], "a closing partner of this (", "Balance the parentheses.")
    if sign == ")" and not pending:
        refuse(text, token, "no ) without its (", "Balance the parentheses.")
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
