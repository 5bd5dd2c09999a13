"""The grammar of polynomials: what it reads it reads exactly, the rest it refuses in bounded time and memory."""

import contextlib
import json
import subprocess
import sys
import time
from fractions import Fraction as F

import flint
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import PolynomialError, QuakedesignError
from quakedesign.sos.exact import polynomial_text as expansion
from quakedesign.sos.exact.polynomial_text import DEPTH, LENGTH, VARIABLES, names_in_text, parse, parse_constraint


@pytest.mark.parametrize(
    ("text", "variables", "polynomial"),
    [
        ("x^4*y^2 + x**2*y^4 + 1 - 3*x^2*y^2", "xy", {(4, 2): 1, (2, 4): 1, (0, 0): 1, (2, 2): -3}),
        ("y + x", "yx", {(1, 0): 1, (0, 1): 1}),
        ("-x^2", "x", {(2,): -1}),
        ("(-x)^2", "x", {(2,): 1}),
        ("2*-x - -x", "x", {(1,): -1}),
        ("+x − 1", "x", {(1,): 1, (0,): -1}),
        ("x - 1 - 1", "x", {(1,): 1, (0,): -2}),
        ("x - 1 + 2", "x", {(1,): 1, (0,): 1}),
        ("12/6/2*x", "x", {(1,): 1}),
        ("12/-2*3*x", "x", {(1,): -18}),
        ("x/(1/2 + 1/6)", "x", {(1,): F(3, 2)}),
        ("(x^2)^3 + x^0", "x", {(6,): 1, (0,): 1}),
        ("1e-8*x + .5 + 2.", "x", {(1,): F(1, 10**8), (0,): F(5, 2)}),
        ("2.50E+1", "", {(): 25}),
        ("x - x", "x", {}),
        ("(x + y)*(x - y)\n", "xy", {(2, 0): 1, (0, 2): -1}),
        ("0^0", "", {(): 1}),
    ],
)
def test_what_the_grammar_has_is_read_exactly(text, variables, polynomial):
    assert parse(text) == (tuple(variables), polynomial)


NUMBERS = ["nan", "NaN", "NAN", "inf", "Inf", "INF", "infinity", "Infinity", "oo", "zoo", "pi", "E", "I"]


@pytest.mark.parametrize("name", NUMBERS)
def test_the_name_of_a_number_is_a_variable_only_where_it_is_declared(name):
    for read in (parse, names_in_text, lambda text: parse_constraint(f"{text} >= 0")):
        with pytest.raises(PolynomialError, match=rf"at character 7\..*x\^2 \+ ⟦{name}⟧.*Write numbers in digits"):
            read(f"x^2 + {name}")
    assert parse(f"x^2 + {name}", ["x", name]) == (("x", name), {(2, 0): 1, (0, 1): 1})
    assert parse(f"{name}1 + e + i") == ((f"{name}1", "e", "i"), {(1, 0, 0): 1, (0, 1, 0): 1, (0, 0, 1): 1})


def test_given_variables_fix_the_order_and_exclude_other_names():
    assert parse("x + 2*y", ["y", "z", "x"]) == (("y", "z", "x"), {(0, 0, 1): 1, (1, 0, 0): 2})
    assert parse("1", "x") == (("x",), {(0,): 1})
    with pytest.raises(PolynomialError, match=r"expected one of the variables x, y at character 5\..*⟦z⟧"):
        parse("x + z", ["x", "y"])


SIXTEEN = [f"v{i}" for i in range(16)]


def test_as_many_and_as_long_names_as_allowed_are_read():
    assert names_in_text(*SIXTEEN) == names_in_text("+".join(SIXTEEN)) == parse("1", SIXTEEN)[0] == tuple(SIXTEEN)
    assert parse("+".join(SIXTEEN))[0] == tuple(SIXTEEN)
    assert parse("x" * 32)[0] == parse("1", "x" * 32)[0] == ("x" * 32,)
    with pytest.raises(PolynomialError, match="a name of at most 32"):
        parse("x" * 33)


@pytest.mark.parametrize(
    "variables", [["x", "x"], ["x", "1y"], ["1y", "x"], ["x y"], [""], ["é"], [1], [f"v{i}" for i in range(17)]]
)
def test_variables_that_are_no_names_are_refused(variables):
    with pytest.raises(PolynomialError, match="different names"):
        parse("1", variables)


@pytest.mark.parametrize(
    ("text", "kind", "polynomial"),
    [
        ("x>=0", "inequality", {(1, 0): 1}),
        ("x <= 1", "inequality", {(0, 0): 1, (1, 0): -1}),
        ("x^2 + y^2 == 1", "equality", {(2, 0): 1, (0, 2): 1, (0, 0): -1}),
        ("x = y", "equality", {(1, 0): 1, (0, 1): -1}),
        ("1 - x >= y", "inequality", {(0, 0): 1, (1, 0): -1, (0, 1): -1}),
        ("x >= x", "inequality", {}),
    ],
)
def test_constraints_are_read_as_differences(text, kind, polynomial):
    assert parse_constraint(text, ["x", "y"]) == (kind, ("x", "y"), polynomial)


def test_variables_of_several_texts_are_collected_in_order():
    assert names_in_text("y*x + 1", "z >= x", "w == 0") == ("y", "x", "z", "w")
    with pytest.raises(PolynomialError, match="at most 16"):
        names_in_text(*(f"v{i}" for i in range(17)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x > 0", r"expected one of >=, <=, == at character 3.*closed"),
        ("0 <= x <= 1", r"expected only one relation at character 8"),
        ("x + 1", r"expected one of >=, <=, == at the end"),
        ("x >=", r"expected a number, a name or \( at the end"),
        (">= 0", r"expected .*>= 0"),
        ("(x >= 0)", r"expected a closing parenthesis for this \( at character 1"),
        ("x != 0", r"expected .*at character 3.*⟦!⟧"),
    ],
)
def test_other_relations_are_refused(text, message):
    with pytest.raises(PolynomialError, match=message):
        parse_constraint(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2x", r"expected an operator at character 2\. Received 2⟦x⟧\. Write products with \*"),
        ("x(y)", r"expected an operator at character 2"),
        ("x y", r"expected an operator at character 3"),
        ("1.2.3", r"expected an operator at character 4"),
        ("1_000", r"expected an operator at character 2"),
        ("0x1", r"expected an operator at character 2"),
        ("1e", r"expected an operator at character 2"),
        ("x +", r"expected a number, a name or \( at the end"),
        ("x + * y", r"expected a number, a name or \( at character 5"),
        ("", r"expected a number, a name or \( at the end"),
        ("()", r"expected a number, a name or \( at character 2"),
        ("(x", r"expected a closing parenthesis for this \( at character 1"),
        ("x + 1)", r"expected an opening parenthesis for this \) at character 6"),
        ("x/0", r"expected a nonzero number after / at character 2"),
        ("x/(1 - 1)", r"a nonzero number after /"),
        ("1/x", r"a nonzero number after /"),
        ("x^-1", r"expected a whole number from 0 to 60 as exponent at character 3"),
        ("x^1.0", r"whole number"),
        ("x^1e1", r"whole number"),
        ("x^y", r"whole number"),
        ("x^", r"expected a whole number from 0 to 60 as exponent at the end"),
        ("2^3^2", r"expected only one exponent at character 4"),
        ("x >= 0", r"expected a polynomial without relation at character 3"),
        ("x\x00", r"expected .*at character 2. Received x⟦\\x00⟧"),
        ("x² + 1", r"expected .*at character 2"),
        ("١", r"expected .*at character 1"),
        ("sin(x)", r"expected an operator at character 4"),
        ("__import__('os')", r"expected .*at character 12"),
        ("x.y", r"expected .*at character 2"),
        ("x[0]", r"expected .*at character 2"),
        ("x if 1 else y", r"expected an operator at character 3"),
        ("lambda: 1", r"expected .*at character 7"),
        ("x; y", r"expected .*at character 2"),
        ("x # y", r"expected .*at character 3"),
    ],
    ids=repr,
)
def test_anything_else_is_refused_with_its_place_on_one_line(text, message):
    with pytest.raises(PolynomialError, match=message) as caught:
        parse(text)
    assert "\n" not in str(caught.value)
    assert "Received" in str(caught.value)
    assert isinstance(caught.value, QuakedesignError)


@pytest.mark.parametrize("value", [None, 1, b"x", ["x"], sp.Symbol("x")], ids=repr)
def test_only_text_is_read(value):
    with pytest.raises(PolynomialError, match="a polynomial is text"):
        parse(value)


HOSTILE = {
    "dense power": ("(a + b + c + d + e + f + g + h)^60", "at most 10000 monomials"),
    "dense power of powers": ("((a + b + c + d)^10)^6", "at most 10000 monomials"),
    "dense product": ("(a+b+c+d+e)^15*(a-b+c-d+e)^15", "an expression with fewer operations"),
    "many variables": ("*".join(f"(1 + v{i})" for i in range(16)), "at most 10000 monomials"),
    "many products": ("+".join(["(a+b+c)^22*(a-b+c)^22"] * 600), "an expression with fewer operations"),
    "many signs": ("-" * 19000 + "(a + b + c + d)^19", "an expression with fewer operations"),
    "many long sums": ("+".join(["(a+b+c)^40"] * 1500), "an expression with fewer operations"),
    "decimal exponent": ("1e999999999*x", "at most 400 digits"),
    "negative decimal exponent": ("1e-999999999*x", "at most 400 digits"),
    "zero with an exponent": ("0e999999999", "at most 400 digits"),
    "exponent": ("x^999999999", "whole number from 0 to 60"),
    "long exponent": ("x^" + "9" * 10000, "whole number from 0 to 60"),
    "tower": ("(((2^60)^60)^60)^60", "at most 1000 digits"),
    "denominators": ("1/" + "/".join(["7"] * 9000), "at most 1000 digits"),
    "coprime denominators": ("+".join(f"x/{7 + 2 * i}^60" for i in range(1000)), "at most 1000 digits"),
    "long number": ("9" * 401, "at most 400 digits"),
    "long decimals": ("0." + "9" * 401, "at most 400 digits"),
    "long product": ("9" * 399 + ("*" + "9" * 399) * 2, "at most 1000 digits"),
    "degree": ("x^40*y^21", "degree at most 60"),
    "degree of a power": ("(x^10)^7", "degree at most 60"),
    "nesting": ("(" * 10_000 + ")" * 10_000, f"at most {DEPTH} nested"),
    "nested signs": ("-(" * 5000 + "x" + ")" * 5000, f"at most {DEPTH} nested"),
    "length": ("x+" * LENGTH, f"at most {LENGTH} characters"),
    "names": ("+".join(f"v{i}" for i in range(VARIABLES + 1)), "at most 16 different variables"),
    "long name": ("x" * 10_000, "a name of at most 32"),
    "long rubbish": ("é" * 19_000, "expected .*at character 1"),
}


@pytest.mark.parametrize(("text", "message"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_text_is_refused_in_bounded_time(text, message):
    parse("x")  # python-flint is loaded
    began = time.process_time()
    with pytest.raises(PolynomialError, match=message) as caught:
        parse(text)
    assert time.process_time() - began < 5
    assert len(str(caught.value)) < 250


@pytest.mark.slow
def test_hostile_text_is_refused_in_bounded_memory():
    program = """
import json, resource, sys
from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.polynomial_text import parse
resource.setrlimit(resource.RLIMIT_AS, (500 * 2**20,) * 2)
refused = 0
for text in json.load(sys.stdin):
    try:
        parse(text)
    except PolynomialError:
        refused += 1
print(refused)
"""
    texts = json.dumps([text for text, _ in HOSTILE.values()])
    done = subprocess.run([sys.executable, "-c", program], input=texts, capture_output=True, text=True, check=True)
    assert int(done.stdout) == len(HOSTILE)


def test_what_the_limits_allow_is_read():
    assert parse("(" * DEPTH + "x" + ")" * DEPTH) == (("x",), {(1,): 1})
    assert parse("-" * 10_000 + "x") == (("x",), {(1,): 1})
    assert parse("x^60")[1] == {(60,): 1}
    assert parse("9" * 400 + "/" + "7" * 399)[1] == {(): F(int("9" * 400), int("7" * 399))}
    assert len(parse("(x^2 + y^2 + z^2)^30")[1]) == 496
    long = "+".join(f"{i + 1}*x^{i % 40}*y^{i // 40}" for i in range(800))
    assert parse(long)[1] == {(i % 40, i // 40): i + 1 for i in range(800)}


def leaf():
    number = st.tuples(st.just("number"), st.integers(0, 999), st.integers(0, 4), st.integers(-3, 3))
    return number | st.tuples(st.just("name"), st.sampled_from(["x", "y", "z_1"]))


def branch(inner):
    return (
        st.tuples(st.sampled_from("+-*"), inner, inner)
        | st.tuples(st.just("negative"), inner)
        | st.tuples(st.just("/"), inner, st.integers(1, 50))
        | st.tuples(st.sampled_from(["^", "**"]), inner, st.integers(0, 2))
    )


TREES = st.recursive(leaf(), branch, max_leaves=8)
BINDING = {"+": 1, "-": 1, "*": 2, "/": 2, "negative": 3, "^": 4, "**": 4, "number": 5, "name": 5}


def written(tree):
    """Text of a tree, with no more parentheses than its meaning needs."""

    def inside(child, least):
        text = written(child)
        return text if BINDING[child[0]] >= least else f"({text})"

    kind, *parts = tree
    if kind == "name":
        return parts[0]
    if kind == "number":
        digits, decimals, exponent = parts
        return f"{digits / 10**decimals:.{decimals}f}" + (f"e{exponent:+d}" if exponent else "")
    if kind == "negative":
        return "-" + inside(parts[0], 3)
    if kind in ("^", "**"):
        return f"{inside(parts[0], 5)}{kind}{parts[1]}"
    right = str(parts[1]) if kind == "/" else inside(parts[1], BINDING[kind] + 1)
    return f"{inside(parts[0], BINDING[kind])} {kind} {right}"


def built(tree):
    """The same tree in SymPy."""
    kind, *parts = tree
    if kind == "name":
        return sp.Symbol(parts[0])
    if kind == "number":
        digits, decimals, exponent = parts
        return sp.Rational(digits, 10**decimals) * sp.Integer(10) ** exponent
    left = built(parts[0])
    right = sp.Integer(parts[1]) if kind in ("/", "^", "**") else built(parts[1]) if kind != "negative" else None
    operations = {"+": sp.Add, "-": lambda a, b: a - b, "*": sp.Mul, "/": lambda a, b: a / b, "^": sp.Pow, "**": sp.Pow}
    return -left if kind == "negative" else operations[kind](left, right)


@settings(max_examples=300, deadline=None)
@given(TREES)
def test_text_means_what_sympy_expands_from_the_same_tree(tree):
    variables = sp.symbols("x y z_1")
    expected = sp.Poly(built(tree), *variables, domain="QQ")
    coefficients = {e: F(int(c.p), int(c.q)) for e, c in expected.terms() if c}
    assert parse(written(tree), ["x", "y", "z_1"])[1] == coefficients


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="xy12.e+-*/^()<>= _,'[", max_size=30))
def test_any_text_is_read_or_refused_with_the_one_error(text):
    for read in (parse, parse_constraint):
        polynomial = {}
        with contextlib.suppress(PolynomialError):
            polynomial = read(text)[-1]
        assert all(value for value in polynomial.values())


def test_a_written_rational_polynomial_is_read_back():
    polynomial = {(2, 1): F(-3, 7), (0, 0): F(1, 10**8), (1, 5): F(22)}
    text = " + ".join(f"({c})*x^{i}*y^{j}" for (i, j), c in polynomial.items())
    assert parse(text, ["x", "y"]) == (("x", "y"), polynomial)


def packed(polynomial):
    """Terms as `Expansion` keeps them: seven bits an exponent, the degree on top."""
    return {sum(e << 7 * i for i, e in enumerate(k)) + (sum(k) << 7 * len(k)): c for k, c in polynomial.items()}


@pytest.mark.parametrize(
    ("text", "exponent", "size"),
    [
        ("x^2 + y^2", 9, 10),  # products of terms: 9 out of 2 with repetition
        ("x^3", 4, 1),
        ("0", 3, 1),
        ("2", 4, 1),
        ("(1 + x)*(1 + y)", 10, 11**2),  # the box of exponents
        ("1 + x + x^2 + x^3 + x^4", 10, 41),
        ("(x + y + 1)^2", 5, 66),  # degree 10 in two variables: 12 over 2
        ("(x + y + 1)^2 + 0*z", 5, 66),
    ],
)
def test_the_bound_of_a_power_is_the_least_of_three_counts(text, exponent, size):
    order, polynomial = parse(text)
    assert expansion.Expansion(text, order)._size_of_power(packed(polynomial), exponent) == size
    assert size >= len(parse(f"({text})^{exponent}")[1])


ALPHABET = "abcdefghijklmnopqrstuvwxyz"


@pytest.mark.parametrize(
    ("start", "length", "shown"),
    [
        (30, 30, "…ghijklmnopqrstuvwxyzabcd⟦efghijklmnopqrstuvwxyzab⟧cdefghijklmnopqrstuvwxyz…"),
        (24, 2, "abcdefghijklmnopqrstuvwx⟦yz⟧abcdefghijklmnopqrstuvwx…"),
        (25, 1, "…bcdefghijklmnopqrstuvwxy⟦z⟧abcdefghijklmnopqrstuvwx…"),
        (3, 1, "abc⟦d⟧efghijklmnopqrstuvwxyzab…"),
        (78, 2, "…cdefghijklmnopqrstuvwxyz⟦ab⟧cdefghijklmnopqrstuvwxyz"),
        (77, 2, "…bcdefghijklmnopqrstuvwxy⟦za⟧bcdefghijklmnopqrstuvwxy…"),
    ],
)
def test_a_refusal_shows_24_characters_on_either_side(start, length, shown):
    text = 4 * ALPHABET
    token = expansion.Token("name", text[start : start + length], start)
    with pytest.raises(PolynomialError) as caught:
        expansion.reject(text, token, "another", "Write it.")
    assert str(caught.value) == f"expected another at character {start + 1}. Received {shown}. Write it."


LIMITS = [  # allowed, and refused
    ("1e400", "1e401"),
    ("1e-400", "1e-401"),
    ("1e00001", "1e000001"),
    ("0e400", "0e401"),
    ("9" * 395 + "e5", "9" * 396 + "e5"),
    ("0." + "9" * 398, "0." + "9" * 399),
    ("0" * 399 + "1", "0" * 400 + "1"),
    ("x^000000060", "x^0000000060"),
    ("1^60", "1^61"),
    ("x^59*x", "x^59*x^2"),
    ("(x^30)^2", "(x^31)^2"),
    ("(a + b + c + d)^30*e + a*f", "(a + b + c + d)^30*e + (a + b + c + d)^30*f"),
    ("2^60", "((2^60)^60)"),
    ("(" * DEPTH + "x" + ")" * DEPTH, "(" * (DEPTH + 1) + "x" + ")" * (DEPTH + 1)),
]


@pytest.mark.parametrize(("allowed", "refused"), LIMITS, ids=lambda text: text[:20])
def test_what_is_just_allowed_is_read_and_what_is_just_beyond_refused(allowed, refused):
    parse(allowed)
    with pytest.raises(PolynomialError, match=r"at most|from 0 to 60"):
        parse(refused)


def test_a_refusal_writes_what_cannot_be_printed_and_nothing_else_differently():
    with pytest.raises(PolynomialError) as caught:
        expansion.reject("é\\'\n\x1b\u2028", expansion.Token("other", "é", 0), "another", "Write it.")
    assert str(caught.value) == "expected another at character 1. Received ⟦é⟧\\'\\n\\x1b\\u2028. Write it."


def test_a_sum_costs_the_shorter_of_its_two_operands_twice():
    """Once for what is added, once for looking at its lengths."""
    sums, token = expansion.Expansion("", ("x",)), expansion.Token("operator", "+", 0)
    long, short = ({i + (i << 7): flint.fmpq(1) for i in range(first, first + n)} for first, n in ((0, 9), (20, 2)))
    left = sums._work
    assert len(sums.add(short, long, token)) == 11
    assert left - sums._work == 2 + 2
