"""What the standalone checker prints, counts and returns, part by part, in this process."""

import importlib.util
import json
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.errors import CertificateError
from quakedesign.lyapunov.exact.certificate_files import evidence_of

PATH = Path(__file__).parents[2] / "proofs" / "check.py"


def module(name, path):
    specification = importlib.util.spec_from_file_location(name, path)
    found = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(found)
    return found


LOOPS = module("loops_by_hand", Path(__file__).with_name("test_check.py"))
POLYNOMIALS = module("polynomials_by_hand", Path(__file__).with_name("test_check_polynomials.py"))
checker = LOOPS.checker
exact_numbers, squares, polynomials, functionals, loops, stability, equilibria = map(
    checker.beside,
    ("numbers", "squares", "polynomials", "functionals", "lyapunov.loop", "lyapunov.stability", "lyapunov.equilibrium"),
)
Term = loops.Term


@pytest.fixture(autouse=True)
def all_steps_left():
    exact_numbers.budget.renew()


def loop(**parts):
    given = {"law": "own", "numbers": {}, "weights": {"x": 3, "y": 1}, "domain": "cells", "uncertain": {}}
    return loops.Loop(**given | {"roots": {}, "lifts": {}, "field": {}} | parts)


# ---------------------------------------------------------------- the statement


@pytest.mark.parametrize(
    ("exponents", "odd", "text"),
    [
        ((1, 1, 0), (True, True, False), "-2*sign(x)*|x|^(1/3)*y"),
        ((3, 0, 0), (True, True, False), "-2*x*sign(y)"),
        ((3, 1, 0), (False, False, False), "-2*|x|^(1)*|y|^(1)"),
        ((6, 2, F(1, 2)), (True, False, True), "-2*sign(x)*|x|^(2)*|y|^(2)*sign(n)*|n|^(1/2)"),
        ((0, 0, 1), (False, False, True), "-2*n"),
        ((0, 0, 1), (False, False, False), "-2*|n|^(1)"),
        ((0, 0, 0), (False, False, True), "-2*sign(n)"),
        ((0, 0, 0), (False, False, False), "-2"),
    ],
)
def test_a_term_is_written_with_every_power(exponents, odd, text):
    assert loops.term_text(Term(F(-2), (), exponents, odd), loop(lifts={"n": []})) == text


def test_parameters_and_terms_without_effect_are_written():
    term = Term(F(3, 7), ("b", "d"), (0, 1), (False, True))
    assert loops.term_text(term, loop()) == "3/7*b*d*y"
    assert loops.term_text(Term(F(0), (), (0, 1), (False, True), '["1"]'), loop()) == '0 for ["1"]'
    assert loops.sum_text([term, term], loop()) == "3/7*b*d*y + 3/7*b*d*y"
    assert loops.sum_text([], loop()) == "0"
    assert exact_numbers.named({"a": F(1, 2), "b": 3}) == "a = 1/2, b = 3"
    assert exact_numbers.named({}) == "none"


def test_a_term_keeps_what_was_written_where_its_number_is_zero():
    known = loop(numbers={"k": F(2), "c": F(0)})
    assert loops.read_term(["3", ["k"], []], "here", known).written == ""
    assert loops.read_term(["3", ["c"], []], "here", known).written == '["3", ["c"], []]'


def test_the_loop_is_described_line_by_line():
    document = LOOPS.nested_sign()
    described = loops.describe(loops.read_loop(document))
    assert described[1:] == [
        "gains and constants: c = 0, k = 2",
        "domain: cells; states with weights: x = 1, y = 1",
        "uncertain, measurable in time: none",
        "root: s in [7/5, 3/2] is the positive square root of k",
        'argument of a nested power: n = 1*x + 1*y + 0 for ["7", ["c", "s"], [["x", "3", "a"]]]',
        "dx/dt = -2*sign(x) + -1*sign(n)",
        "dy/dt = -2*sign(y) + -1*sign(n)",
    ]
    ranged = loops.describe(loops.read_loop(LOOPS.disturbed_relay()))
    assert ranged[3:] == ["uncertain, measurable in time: d in [-1, 1]", "dx/dt = -2*sign(x) + 1*d"]


CLAIMS = {"positive": F(1, 2), "decrease": F(3)}


@pytest.mark.parametrize(
    ("more", "m", "n", "lines"),
    [
        ({}, 5, 4, ["in finite time"]),
        ({}, 4, 4, ["finite time is not claimed"]),
        ({}, 4, 5, ["finite time is not claimed"]),
        (
            {"decay": F(2)},
            5,
            4,
            [
                "dV/dt <= -2 * V^(4/5)",
                "settling time: the origin is reached within 5/2 * V(0)^(1/5)",
                "in finite time",
            ],
        ),
        ({"decay": F(2)}, 4, 2, ["dV/dt <= -2 * V^(1/2)", "within 1 * V(0)^(1/2)", "in finite time"]),
        ({"decay": F(2)}, 4, 4, ["dV/dt <= -2 * V^(1)", "finite time is not claimed"]),
        ({"bound_x": F(7), "bound_y": F(8)}, 6, 5, ["V >= 7 * |x|^(2)", "V >= 8 * |y|^(6)", "in finite time"]),
    ],
)
def test_claims_on_cells_in_words(more, m, n, lines):
    first, *bounds, degrees, last = stability.describe_claims(loop(), CLAIMS | more, m, n)
    assert first == f"claims: V >= 1/2 * sum u_i^{m}; dV/dt <= -3 * sum u_i^{n}; u_i = |x_i|^(1/weight)"
    assert degrees == f"homogeneous degrees: V {m}, dV/dt {n}"
    assert [line.endswith(end) for line, end in zip([*bounds, last], lines, strict=True)] == [True] * len(lines)


@pytest.mark.parametrize(("m", "ending"), [(2, "exponentially with rate a"), (4, "with V(t) <= exp(-2*a*t)*V(0)")])
def test_claims_on_reals_in_words(m, ending):
    found = stability.describe_claims(loop(domain="reals"), {"positive": F(1, 2), "rate": F(3)}, m, 0)
    assert found == [
        f"claims: V >= 1/2 * sum x_i^{m}; dV/dt <= -2*a*V with a = 3",
        f"homogeneous degrees: V {m}",
        f"conclusion: the origin is globally asymptotically stable, {ending}",
    ]


def equilibrium(*terms, **values):
    field = {"x": [Term(F(n), names, (a,), (True,)) for n, names, a in terms]}
    return equilibria.describe_equilibrium(
        loop(weights={"x": 1}, field=field), {k: F(v) for k, v in values.items()}, {"x": F(1)}, {"+": F(1)}
    )


def test_a_refutation_in_words():
    found = equilibrium((1, (), 1), (-1, ("d",), 1), d=1)
    assert found[:4] == [
        "parameters: d = 1",
        "v, where x_i = sign(v_i)*|v_i|^weight: x = 1",
        "weights of the cells: + = 1",
        "homogeneous degrees: field 0",
    ]
    assert "is not asymptotically stable" in found[4]
    mixed = equilibrium((1, (), 1), (-1, ("d",), 2), d=1)
    assert mixed[3].endswith("field 0, 1")
    assert "is not globally asymptotically stable" in mixed[4]
    # what has no effect has no degree
    assert equilibrium((1, (), 1), (-1, ("d",), 2), d=0)[3].endswith("field 0")
    assert equilibrium((1, (), 1), (0, (), 2))[3].endswith("field 0")
    assert equilibrium()[3].endswith("field any")


def test_polynomials_in_words():
    statement = polynomials.read_statement(POLYNOMIALS.quadratic())
    assert polynomials.terms_text({}, statement) == "0"
    assert polynomials.terms_text({(2, 1): F(1), (0, 0): F(-2, 3), (1, 0): F(1)}, statement) == "1*x^2*y + 1*x + -2/3"


# ---------------------------------------------------------------- cells


def cell(equalities=(), inequalities=()):
    return loops.Cell("", 2, (1, 1), {}, list(equalities), list(inequalities))


@pytest.mark.parametrize(
    ("equalities", "inequalities", "interior"),
    [
        ([], [], True),
        ([{(1, 0): 1, (0, 1): -1}], [], True),
        ([{(1, 0): 1, (0, 1): 2}], [], False),
        ([{(1, 0): -1}], [], False),
        ([{(1, 0): 1, (0, 1): -1}, {(1, 0): 1}], [], False),
        ([], [{(1, 0): F(1, 3), (0, 1): -1}], True),
        ([], [{(1, 0): F(1, 3)}], True),
        ([], [{(1, 0): -1, (0, 1): -2}], False),
        ([], [{(1, 0): 1}, {(1, 0): -1, (0, 1): -2}], False),
        ([{(1, 0): 1, (0, 1): -1}], [{(1, 0): -1}], False),
    ],
)
def test_signs_alone_tell_whether_a_cell_may_have_an_interior(equalities, inequalities, interior):
    assert cell(equalities, inequalities).has_interior() is interior


def test_powers_of_lifts_must_be_whole():
    """n of degree 3: n^(1/3) is w, n^(1/2) is none."""
    one = loops.Cell("", 1, (1, 1), {0: 1, 1: 3}, [], [])
    assert loops.restrict({((), (2, F(1, 3)), (False, False)): F(5)}, one, {}) == {(2, 1): 5}
    for powers in ((2, F(1, 2)), (F(1, 2), F(1))):
        with pytest.raises(checker.Refused, match="powers of lifts"):
            loops.restrict({((), powers, (False, False)): F(5)}, one, {})


def test_the_reach_of_a_lift_is_that_of_the_lifts_in_it():
    """Of x, y, z and the lifts n(x), m(y): x + n is zero on open sets, y + n and x y + x m are not."""
    reaches = {3: {0}, 4: {1}}
    e = {name: tuple(int(i == k) for i in range(5)) for k, name in enumerate("xyznm")}
    assert loops.reach_of({e["y"]: 1, e["n"]: 1}, reaches, 3) == {0, 1}
    assert loops.reach_of({e["z"]: 1, e["m"]: 1}, reaches, 3) == {1, 2}
    assert loops.reach_of({e["x"]: 1}, reaches, 3) == {0}
    assert loops.reach_of({e["x"]: 1, e["m"]: 1}, reaches, 3) == {0, 1}
    for form in ({e["x"]: 1, e["n"]: 1}, {e["n"]: 1}, {e["x"]: 1, e["n"]: 1, e["m"]: 1}):
        with pytest.raises(checker.Refused, match="null set"):
            loops.reach_of(form, reaches, 3)


def nested(field, **parts):
    """Cells of a loop in x with a lift n = x, and more."""
    document = LOOPS.relay() | {"gains": {}, "lifts": {"n": LOOPS.X1}} | parts
    document["field"] = {"x": field}
    return [one.label for one in loops.cells_with_lifts(loops.read_loop(document))]


def test_lifts_are_used_by_sign_or_by_power():
    for factors in ([["n", "0", "s"]], [["n", "1", "s"]], [["n", "2", "a"]]):
        assert nested([["-1", [], factors]]) == [" ++", " --"]
    for factors in ([["x", "1", "s"]], []):
        with pytest.raises(checker.Refused, match="used"):
            nested([["-1", [], factors]])


def test_a_term_that_is_disregarded_uses_no_lift():
    lifts = {"n": LOOPS.X1, "m": [*LOOPS.X1, ["1", ["c"], [["n", "1", "s"]]]]}
    field = [["-1", [], [["m", "1", "s"]]]]
    with pytest.raises(checker.Refused, match="used"):
        nested(field, lifts=lifts, gains={"c": "0"})


@pytest.mark.parametrize(
    ("number", "ends", "small", "large"),
    [
        (3, ("1/2", 2), {(2,): F(3, 2)}, {(2,): F(6)}),
        (-3, ("1/2", 2), {(2,): F(-6)}, {(2,): F(-3, 2)}),
        (3, (0, 0), {}, {}),
        (3, (0, 2), None, None),
        (-3, (0, 2), None, None),
    ],
)
def test_the_argument_of_a_lift_is_taken_at_both_ends_of_a_root(number, ends, small, large, monkeypatch):
    """A coefficient that is 0 at one end has no sign on the whole range."""
    monkeypatch.setattr(loops, "restrict", lambda of, _cell, at: {(2,): of["term"] * at["r"]} if at["r"] else {})
    given = loop(uncertain={"r": tuple(map(F, ends))})
    if small is None:
        with pytest.raises(checker.Refused, match="whose signs the ranges of roots decide"):
            loops.restrict_to_ends({"term": F(number)}, None, given, "lift n")
    else:
        assert loops.restrict_to_ends({"term": F(number)}, None, given, "lift n") == (small, large)


def test_a_parameter_may_vary_in_a_term_of_a_lift_that_is_disregarded():
    lifts = {"n": [["1", [], [["x", "1", "s"]]], ["1", ["c", "p"], [["x", "1", "s"]]]]}
    field = [["-1", ["k"], [["n", "0", "s"]]]]
    given = {"gains": {"k": "1", "c": "0"}, "lifts": lifts, "uncertain": {"p": ["1", "2"]}}
    assert nested(field, **given)
    with pytest.raises(checker.Refused, match="without parameters that vary"):
        nested(field, **given | {"gains": {"k": "1", "c": "1"}})


def test_a_parameter_of_one_point_stands_in_a_lift():
    lifts = {"n": [["1", ["p"], [["x", "1", "s"]]]]}
    field = [["-1", [], [["n", "1", "s"]]]]
    assert nested(field, lifts=lifts, uncertain={"p": ["2", "2"]}) == [" ++", " --"]
    assert nested(field, lifts=lifts, uncertain={"p": ["-2", "-2"]}) == [" +-", " -+"]
    with pytest.raises(checker.Refused, match="vary"):
        nested(field, lifts=lifts, uncertain={"p": ["1", "2"]})


# ---------------------------------------------------------------- witnesses


def judged(obligation, witness, on_cells=True):
    try:
        stability.check_witness(obligation, witness, on_cells)
    except checker.Refused as refused:
        return str(refused)
    return "proved"


def test_where_nothing_is_to_prove_nothing_may_be_said():
    nothing = stability.Obligation("here", {}, 1, equalities=({(1,): F(1)},), inequalities=({(1,): F(1)},))
    square = LOOPS.square([0], [[0]], "1")
    plain = {"obligation": "here", "multiplier": {"0": "1"}, "squares": [], "equalities": [{}], "inequalities": [[]]}
    assert judged(nothing, plain) == "proved"
    assert "empty for P = 0" in judged(nothing, plain | {"squares": [square]})
    assert "empty for P = 0" in judged(nothing, plain | {"equalities": [{"1": "1"}]})
    assert "empty for P = 0" in judged(nothing, plain | {"inequalities": [[square]]})
    cancelling = {"equalities": [{"0": "-1"}], "inequalities": [[square]]}
    assert "empty for P = 0" in judged(nothing, plain | cancelling)
    assert "nonempty" in judged(nothing, plain | {"multiplier": {}})
    assert "positive" in judged(nothing, plain | {"multiplier": {"0": "-1"}})


def test_a_negative_multiplier_proves_nothing():
    """-1 times -u^2 is a square."""
    minus = stability.Obligation("here", {(2,): F(-1)}, 1)
    forged = {"obligation": "here", "squares": [LOOPS.square([0], [[1]], "1")], "equalities": [], "inequalities": []}
    assert "positive" in judged(minus, forged | {"multiplier": {"0": "-1"}})
    half = forged | {"multiplier": {"0": "1", "1": "-1"}, "squares": []}
    assert "positive" in judged(minus, half)
    assert "nonempty" in judged(
        stability.Obligation("here", {(2,): F(-1)}, 1), forged | {"multiplier": {}, "squares": []}
    )


@pytest.mark.parametrize(("count", "said"), [(4, "proved"), (5, "0 to 4")])
def test_there_are_as_many_squares_as_products_of_variables(count, said):
    """Four times u^2/4, five times u^2/5, in two variables."""
    one = stability.Obligation("here", {(2, 0): F(1)}, 2)
    squares = [LOOPS.square([0, 0], [[1, 0]], f"1/{count}")] * count
    document = {"obligation": "here", "multiplier": {"0,0": "1"}, "squares": squares, "equalities": []}
    assert said in judged(one, document | {"inequalities": []})
    three = stability.Obligation("here", {(2, 0, 0): F(1)}, 3)
    squares = [LOOPS.square([0, 0, 0], [[1, 0, 0]], "1/8")] * 8
    document = {"obligation": "here", "multiplier": {"0,0,0": "1"}, "squares": squares, "equalities": []}
    assert judged(three, document | {"inequalities": []}) == "proved"


def test_exponents_reach_up_to_999():
    """x^999 x^999 = (x^999)^2 for x >= 0."""
    power = POLYNOMIALS.file(
        {"999": "1"},
        "sos",
        POLYNOMIALS.sos(POLYNOMIALS.square([[999]], "1")),
        names="x",
        on=[{"1": "1"}],
        products=((), (0,)),
        multiplier={"999": "1"},
    )
    assert POLYNOMIALS.verify(power).verdict == "proved"


# ---------------------------------------------------------------- what it may cost


def test_steps_are_counted_with_the_square_of_the_length():
    budget = exact_numbers.Budget()
    assert budget.left == exact_numbers.MAX_STEPS
    budget.left = 100
    budget.spend(3, 1023)
    assert budget.left == 97
    budget.spend(3, 1024)
    assert budget.left == 91
    budget.spend(1, 2048)
    assert budget.left == 86
    budget.spend(86, 0)
    with pytest.raises(checker.Refused, match="fewer steps"):
        budget.spend(1, 0)


def test_other_elements_than_monomials_are_read_where_they_are_asked_for():
    entry = {"product": [], "basis": [{"1": "3"}], "gram": ["2"]}
    assert squares.read_square(entry, "here", "product", 1, mixed=True) == ([], [{(1,): 3}], {(2,): 18})
    with pytest.raises(checker.Refused):
        squares.read_square(entry, "here", "product", 1)


def plain(*equalities, inequalities=(), degree=0):
    return polynomials.Statement(("x",), {}, {(0,): F(1)}, inequalities, equalities, ((),), degree)


STEPS_BY_HAND = {
    "a sum": (lambda: exact_numbers.add({}, (0,), F(1)), 6),
    "a square, and a product of one factor": (lambda: exact_numbers.multiply([], [F(3)], (2,)), 1 + 6),
    "a product of two factors": (lambda: exact_numbers.multiply([F(1), F(3)], [], ()), 12),
    "an elimination of three rows": (
        lambda: squares.is_positive_definite([[int(i == j) for j in range(3)] for i in range(3)]), 3 + 1,
    ),
    "the reach of two terms": (lambda: loops.reach_of({(1,): F(1), (0,): F(1)}, {}, 1), 2 * 6),
    "a product that is kept": (
        lambda: polynomials.product_expander(plain(inequalities=({(1,): F(1)},)))((0,)), 6 + 300,
    ),
    "a value of two terms": (lambda: functionals.apply({0: 1}, 0, {0: 1, 1: 1}), 2),
    "an equality of two terms beyond the degree": (
        lambda: functionals.check_equalities({}, plain({(1,): F(1), (0,): F(1)})), 2,
    ),
    "pairs of a basis of three": (lambda: list(functionals.survivors(plain(degree=4), set())), 6),
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS_BY_HAND)
def test_steps_are_counted_before_they_are_done(name):
    work, steps = STEPS_BY_HAND[name]
    budget = exact_numbers.budget
    budget.left = steps
    work()
    assert budget.left == 0
    budget.left = steps - 1
    with pytest.raises(checker.Refused, match="fewer steps"):
        work()


def test_polynomials_and_denominators_are_limited(monkeypatch):
    monkeypatch.setattr(exact_numbers, "MAX_POLYNOMIAL", 2)
    monkeypatch.setattr(exact_numbers, "MAX_DENOMINATOR_BITS", 3)
    one, two, three = ({(i,): F(1) for i in range(n)} for n in (1, 2, 3))
    assert exact_numbers.add_product({}, one, two) == two
    with pytest.raises(checker.Refused, match="an expanded polynomial must be of at most 2 terms"):
        exact_numbers.add_product({}, one, three)
    assert exact_numbers.read_polynomial({"0": "1", "1": "1"}, "p", 1) == two
    with pytest.raises(checker.Refused, match="p must be of at most 2 terms"):
        exact_numbers.read_polynomial({"0": "1", "1": "1", "2": "1"}, "p", 1)
    assert exact_numbers.to_integers([F(1, 7)], "g") == ([1], 7)
    with pytest.raises(checker.Refused, match="g must be of common denominator"):
        exact_numbers.to_integers([F(1, 8)], "g")


def test_a_long_file_is_not_read_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(exact_numbers, "MAX_BYTES", 4)
    (tmp_path / "fine").write_text("éé", encoding="utf-8")
    (tmp_path / "long").write_text("ééé", encoding="utf-8")  # cut within a character
    assert checker.read_file(str(tmp_path / "fine")) == "éé"
    with pytest.raises(checker.Refused, match="at most 4 bytes"):
        checker.read_file(str(tmp_path / "long"))


def test_the_limits_are_those_of_the_format():
    text = (PATH.parent / "FORMAT.md").read_text(encoding="utf-8")
    for limit in (
        f"file {exact_numbers.MAX_BYTES // 2**20} MiB; nesting {exact_numbers.MAX_NESTING}; {loops.MAX_STATES} states",
        f"{loops.MAX_UNCERTAIN} uncertain parameters; {loops.MAX_NUMBERS} gains and constants",
        f"{loops.MAX_TERMS} terms for each state",
        f"exponents at most {loops.MAX_EXPONENT}; {stability.MAX_OBLIGATIONS} obligations",
        f"basis of {squares.MAX_BASIS};",
        f"{loops.MAX_PARAMETERS} parameters in a term; {loops.MAX_ROOTS} roots; {loops.MAX_LIFTS} lifts",
        f"weight r_i (integer 1 … {loops.MAX_WEIGHT}",
        f"{exact_numbers.MAX_POLYNOMIAL} terms in one polynomial",
        f"at most {squares.MAX_REDUCED} elements in a square, {functionals.MAX_MONOMIALS} monomials before",
        f"and {squares.MAX_REDUCED} after reduction",
        f"names, different, 1 … {polynomials.MAX_VARIABLES} |",
        f"no g_i twice; at most {polynomials.MAX_CONSTRAINTS} together",
        f"the empty one among them, at most {polynomials.MAX_PRODUCTS} |",
    ):
        assert limit in text, limit
    assert exact_numbers.MAX_BYTES % 2**20 == 0
    assert exact_numbers.MAX_DENOMINATOR_BITS == 2**14


# ---------------------------------------------------------------- the command


@pytest.fixture
def written(tmp_path):
    def write(document, name="file.json"):
        path = tmp_path / name
        path.write_bytes(document if isinstance(document, bytes) else json.dumps(document).encode())
        return str(path)

    return write


def test_a_proof_is_printed_with_its_statement(written, capsys):
    path = written(LOOPS.relay())
    assert checker.main([path]) == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert first == f"{path}: proved"
    assert rest == ["    " + line for line in checker.check(json.dumps(LOOPS.relay())).statement]


def test_the_worst_result_counts(written, capsys):
    good, refuted = written(LOOPS.relay(), "a"), written(LOOPS.overpowered_relay(), "b")
    bad, none = written({"format": 2}, "c"), written({}, "d") + ".none"
    assert checker.main([good, good]) == 0
    assert checker.main([refuted]) == checker.main([good, refuted]) == checker.main([refuted, good]) == 1
    assert checker.main([bad]) == checker.main([good, bad]) == 1
    assert checker.main([none]) == checker.main([none, good]) == checker.main([bad, none]) == 2
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert f"{refuted}: refuted" in lines
    assert f"{bad}: invalid: format must be the integer 1. Received 2" in lines
    assert said.err.splitlines()[0].startswith(f"FILE must be readable. Received {none!r}: 'No such file")


def test_only_readable_text_is_read(written, tmp_path, capsys):
    assert checker.main([written(b"\xff\xfe")]) == 1
    assert "invalid: the file must be UTF-8. Received another byte at 0" in capsys.readouterr().out
    assert checker.main([str(tmp_path)]) == 2
    assert "it is not a regular file" in capsys.readouterr().err
    assert checker.main([written(b" " * (exact_numbers.MAX_BYTES + 1))]) == 1
    assert "bytes long" in capsys.readouterr().out
    assert checker.main([written(json.dumps(LOOPS.relay()).encode().ljust(exact_numbers.MAX_BYTES))]) == 0
    assert checker.main(["a\0b"]) == 2


def test_memory_that_runs_out_says_nothing_about_the_claim(written, monkeypatch, capsys):
    def fail(_):
        raise MemoryError

    monkeypatch.setattr(checker, "check", fail)
    assert checker.main([written({})]) == 4
    said = capsys.readouterr()
    assert (said.out, said.err.startswith("FILE must fit into memory.")) == ("", True)


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-"], ["a", "-b"]])
def test_arguments_are_files(arguments, capsys):
    assert checker.main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    options = [argument for argument in arguments if argument.startswith("-")]
    assert said.err == f"Arguments must be files. Received {options}. Use: python check.py FILE...\n"


@pytest.mark.parametrize("version", [True, 1.0, "1", 2, None, [1]])
def test_the_format_is_the_integer_one(version):
    with pytest.raises(checker.Refused):
        checker.check(json.dumps(LOOPS.relay() | {"format": version}))


def test_an_edge_of_the_set_belongs_to_it():
    """-x is negative at x = 1, the edge of 1 - x >= 0."""
    edge = POLYNOMIALS.file({"1": "-1"}, "negative", {"point": ["1"]}, names="x", on=[{"0": "1", "1": "-1"}])
    edge["products"] = [[], [0]]
    assert POLYNOMIALS.verify(edge).verdict == "refuted"


def test_a_product_beyond_the_degree_is_left_out():
    """Evaluation at 0 is negative at x^2 - 1; x^12 >= 0 and its squares are of degree 12 at least."""
    functional = {"functional": {"0": "1"}}
    beyond = POLYNOMIALS.file({"2": "1", "0": "-1"}, "not-sos", functional, names="x", on=[{"12": "1"}])
    beyond["products"] = [[], [0]]
    assert POLYNOMIALS.verify(beyond).verdict == "refuted"


def test_a_diagonal_entry_that_is_dropped_hinders_nothing_and_frees_only_what_it_hindered():
    # on 1 + x^2 >= 0, squares in (1, x, x^2): x^6 has the entry of x^2 alone, so that goes; x^4 = 1 * x^4 of the plain
    # squares still balances the entry of x
    bases, factors = {(): [0, 4], (0,): [0, 1, 2]}, {(): {0: 1}, (0,): {0: 1, 2: 1}}
    assert functionals.reduce(bases, factors, {0, 2, 8}) == {(): {0, 4}, (0,): {0, 1}}
    assert functionals.reduce(bases, factors, {0, 8}) == {(): {0, 4}, (0,): set()}


def test_a_file_of_a_kind_is_a_guarantee():
    with pytest.raises(checker.Refused, match="kind must be guarantee"):
        checker.check('{"format": 1, "kind": "other"}')
    with pytest.raises(checker.Refused, match="fault, reference"):
        checker.check('{"format": 1, "kind": "guarantee"}')


def test_a_bound_under_inputs_is_no_longer_read(tmp_path, capsys):
    path = tmp_path / "old.json"
    path.write_text('{"format": 1, "inputs": {}, "outputs": {}}')
    assert checker.main([str(path)]) == 2
    assert "of an older kind: no longer supported" in capsys.readouterr().err


@pytest.mark.parametrize("key", ["inputs", "outputs"])
def test_a_file_with_one_key_of_such_a_bound_is_invalid(key, tmp_path, capsys):
    """Files about uncertain plants have inputs too; one without its kind is no bound of before."""
    path = tmp_path / "other.json"
    path.write_text(json.dumps({"format": 1, key: {}}))
    assert checker.main([str(path)]) == 1
    assert "invalid: the file must be complete" in capsys.readouterr().out
    with pytest.raises(CertificateError):
        evidence_of({"format": 1, key: {}})


def test_keys_are_looked_at_before_anything_is_read():
    with pytest.raises(checker.Refused, match="the file must be complete; law is missing"):
        checker.check('{"format": 1, "other": 1}')
