"""The literature's polynomials (tests/sos/suite.toml) with their stored proofs, written as files and verified."""

import importlib.util
import itertools
import json
import re
import tomllib
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp

ROOT = Path(__file__).parents[2]
SPECIFICATION = importlib.util.spec_from_file_location("suite_check", ROOT / "proofs" / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)

SUITE = ROOT / "tests" / "sos"
ROWS = {row["name"]: row for row in tomllib.loads((SUITE / "suite.toml").read_text(encoding="utf-8"))["row"]}
PROOFS = json.loads((SUITE / "suite_proofs.json").read_text(encoding="utf-8"))


def of(verdict):
    return pytest.mark.parametrize("name", [name for name, row in ROWS.items() if row["verdict"] == verdict])


def expand(text, names):
    """Return exponents and coefficients, by SymPy."""
    symbols = sp.symbols(names)
    expression = sp.sympify(text.replace("^", "**"), locals=dict(zip(names, symbols, strict=True)), rational=True)
    terms = sp.Poly(expression, *symbols).terms()
    return {",".join(map(str, exponents)): str(number) for exponents, number in terms if number}


def statement(row, multiplier=None):
    """Write a row without its proof; variables stand in order of appearance, as in the stored proofs."""
    texts = [row["polynomial"], *row.get("on", []), row.get("multiplier", "0"), row.get("denominator", "0")]
    names = list(dict.fromkeys(re.findall(r"(?<![\w.])[a-z]\w*", " ".join(texts))))
    limits = {"inequalities": [], "equalities": []}
    for text in row.get("on", []):
        left, sign, right = re.split("(>=|<=|==)", text)
        difference = f"({right}) - ({left})" if sign == "<=" else f"({left}) - ({right})"
        limits["equalities" if sign == "==" else "inequalities"].append(expand(difference, names))
    plain = [i for i, g in enumerate(limits["inequalities"]) if len(g) == 1 and degree(g) == 1]
    products = [list(c) for count in range(len(plain) + 1) for c in itertools.combinations(plain, count)]
    products += [[i] for i in range(len(limits["inequalities"])) if i not in plain]
    polynomial = expand(row["polynomial"], names)
    mu = expand(multiplier or row.get("multiplier", "1"), names)
    least = max(degree(mu) + degree(polynomial), *map(degree, itertools.chain(*limits.values())), 0)
    header = {"format": 1, "variables": names, "polynomial": polynomial, "multiplier": mu}
    return header | limits | {"products": products, "degree": least + least % 2}


def degree(polynomial):
    return max((sum(map(int, key.split(","))) for key in polynomial), default=0)


def squares(stored):
    """Write stored matrices, some of them singular, as single squares: Q = sum of d * l l' by elimination."""
    for entry in stored:
        basis = [text.replace(" ", ",") for text in entry["basis"]]
        gram, numbers = [[Fraction(0)] * len(basis) for _ in basis], map(Fraction, entry["gram"])
        for i, j in itertools.combinations_with_replacement(range(len(basis)), 2):
            gram[i][j] = gram[j][i] = next(numbers)
        for k in range(len(basis)):
            pivot, row = gram[k][k], list(gram[k])
            if pivot:
                element = {basis[j]: str(row[j] / pivot) for j in range(k, len(basis)) if row[j]}
                alone = [list(map(int, key.split(","))) for key in element]
                yield {
                    "product": entry["times"],
                    "basis": alone if len(alone) == 1 else [element],
                    "gram": [str(pivot)],
                }
                for i, j in itertools.product(range(len(basis)), repeat=2):
                    gram[i][j] -= row[i] * row[j] / pivot


def proof(stored, multiplier=()):
    cofactors = [{key.replace(" ", ","): number for key, number in q.items()} for q in stored.get("cofactors", [])]
    return {"squares": list(squares(stored["squares"])), "cofactors": cofactors, "multiplier": list(multiplier)}


def verify(document):
    return checker.check(json.dumps(document))


def reason(document):
    with pytest.raises(checker.Refused) as refused:
        verify(document)
    return str(refused.value)


def raised(number):
    return str(Fraction(number) + Fraction(1, 10**6 + 3))


@of("negative")
def test_a_point_of_the_suite_refutes(name):
    document = statement(ROWS[name]) | {"negative": {"point": ROWS[name]["point"]}}
    assert verify(document).verdict == "refuted"


@of("sos")
def test_a_proof_of_the_suite_is_proved_and_no_other_number_is(name):
    """The suite's multipliers have positive terms, even ones or those of variables on the orthant."""
    document = statement(ROWS[name]) | {"sos": proof(PROOFS[name]["sos"])}
    assert verify(document).verdict == "proved"
    for square in document["sos"]["squares"][:3]:
        entry = square["gram"][0]
        square["gram"][0] = raised(entry)
        assert "identity" in reason(document)
        square["gram"][0] = entry


@of("not-sos")
def test_a_functional_of_the_suite_refutes(name):
    document = statement(ROWS[name])
    values = PROOFS[name].get("functional")
    if values:
        functional = {key.replace(" ", ","): number for key, number in values.items() if Fraction(number)}
        document["not-sos"] = {"functional": functional}
        assert verify(document).verdict == "refuted"
    else:  # a monomial that nothing on the other side has
        assert any(out_of_reach(document, key) for key in document["polynomial"])


def out_of_reach(document, key):
    sign = "-1" if Fraction(document["polynomial"][key]) > 0 else "1"
    try:
        return verify(document | {"not-sos": {"functional": {key: sign}}}).verdict == "refuted"
    except checker.Refused:
        return False


@of("not-sos")
def test_a_denominator_of_the_suite_proves_that_the_polynomial_is_nonnegative(name):
    """On all of space and on the orthant, where a multiplier may vanish on the boundary."""
    row, stored = ROWS[name], PROOFS[name]
    document = statement(row, row["denominator"])
    document["sos"] = proof(stored["nonnegative"], squares(stored["denominator"]["squares"]))
    free = [g for g in document["inequalities"] if len(g) > 1 or degree(g) > 1]
    if free:
        assert "positive everywhere" in reason(document)  # it vanishes somewhere, and the set might have no interior
    else:
        assert verify(document).verdict == "proved"
        document["polynomial"] = {key: raised(number) for key, number in document["polynomial"].items()}
        assert "identity" in reason(document)
