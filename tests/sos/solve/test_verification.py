"""Gram matrices of other solvers: made exact, or answered otherwise; and the files and pages about them."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.io import savemat
from scipy.sparse import csc_matrix

from quakedesign import sos
from quakedesign.cli import main
from quakedesign.errors import ParameterError, PolynomialError

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "howto" / "own_certificate.md").read_text(encoding="utf-8")
TEXT = "2*x^4 + 2*x^3*y - x^2*y^2 + 5*y^4"  # Parrilo's thesis, example 4.1; below a Gram matrix by hand
BASIS, EXPONENTS = ["x^2", "x*y", "y^2"], [(2, 0), (1, 1), (0, 2)]
EXACT = np.array([[2.0, 1.0, -2.0], [1.0, 3.0, 0.0], [-2.0, 0.0, 5.0]])
TERMS = [[2, 4, 0], [2, 3, 1], [-1, 2, 2], [5, 0, 4]]
MOTZKIN = "x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2"


def noise(size, scale=1e-7):
    return scale * np.random.default_rng(1).standard_normal((size, size))


def test_a_matrix_with_errors_becomes_a_proof_that_both_checkers_accept(tmp_path):
    answer = sos.verify(TEXT, EXACT + noise(3), BASIS)
    assert answer.verdict is sos.Positivity.SOS
    assert answer.remark.startswith("proved by the given matrix")
    (square,) = answer.proof.squares
    assert [float(q) for q in square.gram] == pytest.approx([2, 1, -2, 3, 0, 5], abs=0.1)
    answer.save(tmp_path / "proof.json")
    done = subprocess.run([sys.executable, ROOT / "proofs/check.py", tmp_path / "proof.json"], check=False)
    assert done.returncode == 0


def test_a_singular_matrix_is_rounded_beside_its_kernel():
    root = np.array([[1.0, -2.0, 1.0], [0.0, 1.0, -1.0]])  # (x - 2y + z)² + (y - z)²
    answer = sos.verify("(x - 2*y + z)^2 + (y - z)^2", root.T @ root + noise(3, 1e-8), ["x", "y", "z"])
    assert answer.verdict is sos.Positivity.SOS
    assert answer.remark.endswith("on the complement of its kernel")
    assert [len(s.basis) for s in answer.proof.squares] == [2]


@pytest.mark.parametrize("size", [1e-8, 1e8])
def test_units_do_not_matter(size):
    polynomial = {(4, 0): 2, (3, 1): 2 * size, (2, 2): -(size**2), (0, 4): 5 * size**4}
    units = np.diag([1, size, size**2])
    answer = sos.verify(polynomial, units @ (EXACT + noise(3)) @ units, EXPONENTS, variables=("x", "y"))
    assert answer.remark.startswith("proved by the given matrix")


def test_only_the_symmetric_part_counts():
    skew = np.array([[0, 7, 1], [-7, 0, 2], [-1, -2, 0]])
    assert sos.verify(TEXT, EXACT + skew, BASIS).remark.startswith("proved by the given matrix (largest error in a co")


@pytest.mark.parametrize(
    ("polynomial", "matrix", "basis", "verdict"),
    [
        ("x^2 - 3*x*y + y^2", [[1, -1.5], [-1.5, 1]], ["x", "y"], "negative"),
        (MOTZKIN, np.diag([1.0, 1.0, 1.0, -3.0]), ["1", "x^2*y", "x*y^2", "x*y"], "not-sos"),
        (TEXT, np.zeros((3, 3)), BASIS, "sos"),
        (TEXT, EXACT, BASIS[::-1], "sos"),
        ("x^4 - 2*x^2*y + 2*y^2", np.eye(2), ["x", "y"], "sos"),
        ("x^4 - 3*x^2 + 9/4 + 1/1000000", [[2.25, -1.6], [-1.6, 1]], ["1", "x^2"], "sos"),
    ],
)
def test_where_the_matrix_proves_nothing_the_polynomial_is_decided(polynomial, matrix, basis, verdict):
    answer = sos.verify(polynomial, matrix, basis)
    assert str(answer.verdict) == verdict
    assert answer.check()
    assert answer.remark.endswith("; decided without it")


def test_what_stays_undecided_says_why(monkeypatch):
    undecided = sos.Answer(statement=sos.prove("x^2").statement, proof=None)
    monkeypatch.setattr("quakedesign.sos.solve.verification.decide", lambda asked: undecided)
    answer = sos.verify("x^2 + 4*y^2", np.eye(2), ["x^2", "y^2"])
    assert answer.verdict is sos.Positivity.UNDECIDED
    assert answer.remark.startswith("the given matrix (largest error in a coefficient 4,")
    assert answer.remark.endswith("neither a proof nor a counterexample was found without it")


def test_a_basis_may_have_polynomials_and_sympy_expressions():
    x, y = sp.symbols("x y")
    answer = sos.verify((x - y) ** 2 + x**4, np.diag([1.0, 1.0]), [x - y, x**2])
    assert answer.remark.startswith("proved by the given matrix")
    answer = sos.verify("2*x^2 + 2*y^2", np.eye(2), ["x - y", "x + y"])
    assert answer.remark.startswith("proved by the given matrix")


def test_under_constraints_there_is_a_matrix_for_every_inequality():
    # 2 - x = (x - 2)²/4 + (4 - x²)/4
    answer = sos.verify("2 - x", [[[0.25]], [[0.25]]], [["x - 2"], ["1"]], on=["4 - x^2 >= 0"])
    assert answer.remark.startswith("proved by the given matrix")
    answer = sos.verify("1 - x", [[[0.25]], [[0.25]]], [["x - 2"], ["1"]], on=["4 - x^2 >= 0"])
    assert answer.verdict is sos.Positivity.NEGATIVE


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((TEXT, np.eye(2), BASIS), "must be 3 x 3"),
        ((TEXT, np.full((3, 3), np.nan), BASIS), "9 entries not finite"),
        ((TEXT, [["a"]], ["x"]), "array of real numbers"),
        ((TEXT, [[1.0 + 2.0j]], ["x"]), "array of real numbers"),
        ((TEXT, [[10**400]], ["x"]), "array of real numbers"),
        ((TEXT, np.eye(2), ["x^2", "x^2"]), "all different and not zero"),
        ((TEXT, np.zeros((0, 0)), []), "all different and not zero"),
        ((TEXT, np.eye(3), ["x", "y", "x + y"]), "linearly independent"),
        ((TEXT, np.eye(1), [(1, 2, 3)]), "2 non-negative integers"),
        ((TEXT, np.eye(1), [(0.5, 1)]), "2 non-negative integers"),
        ((TEXT, np.eye(1), [(float("nan"), 1)]), "2 non-negative integers"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, said):
    with pytest.raises(PolynomialError, match=said):
        sos.verify(*arguments)


def test_constraints_that_do_not_fit_are_refused():
    with pytest.raises(PolynomialError, match="must be inequalities"):
        sos.verify("x", [[1.0]], ["x"], on=["x == 0"])
    with pytest.raises(PolynomialError, match="Received 1 and 1"):
        sos.verify("x", [[[1.0]]], [["x"]], on=["x >= 0"])
    with pytest.raises(PolynomialError, match="an inequality is given twice"):
        sos.verify("2*x", [[[1.0]]] * 3, [["1"]] * 3, on=["x >= 0", "-x <= 0"])


def test_matrices_at_the_ends_of_floats_are_answered():
    for gram in (np.full((2, 2), 1e308), np.diag([1e308, 1.0]), np.diag([5e-324, 1.0])):
        answer = sos.verify("x^2 + y^2", gram, ["x", "y"])
        assert answer.verdict is sos.Positivity.SOS
        assert answer.remark.startswith("the given matrix (largest error in a coefficient ")


# ---------------------------------------------------------------- files


def in_matlab(**changes):
    names = np.empty((2, 1), dtype=object)
    names[:] = [["x"], ["y"]]
    return {"p": np.array(TERMS, dtype=float), "Q": EXACT, "Z": np.array(EXPONENTS), "vars": names} | changes


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"p": csc_matrix(np.array(TERMS, dtype=float)), "Z": csc_matrix(np.array(EXPONENTS, dtype=float))},
        {"p": TEXT, "Z": np.array(BASIS), "vars": np.array(["x", "y"])},
    ],
)
def test_a_file_of_matlab(tmp_path, changes):
    savemat(tmp_path / "gram.mat", in_matlab(**changes))
    answer = sos.read_gram(tmp_path / "gram.mat").verify()
    assert answer.remark.startswith("proved by the given matrix (largest error in a coefficient 0,")
    assert answer.statement.polynomial == sos.prove(TEXT).statement.polynomial


def in_json(**changes):
    nested = [[c, [i, j]] for c, i, j in TERMS]
    return {"variables": ["x", "y"], "polynomial": nested, "basis": EXPONENTS, "gram": EXACT.tolist()} | changes


@pytest.mark.parametrize("changes", [{}, {"polynomial": TERMS}, {"polynomial": TEXT, "basis": BASIS}])
def test_a_file_of_json(tmp_path, changes):
    path = tmp_path / "gram.json"
    path.write_text(json.dumps(in_json(**changes)))
    answer = sos.read_gram(path).verify()
    assert answer.remark.startswith("proved by the given matrix (largest error in a coefficient 0,")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "must be JSON"),
        ("[]", "exactly the keys basis, gram, polynomial, variables"),
        (json.dumps(in_json(polynomial=[["a", [1, 1]]])), "coefficient must be a finite number"),
        (json.dumps(in_json(more=1)), "exactly the keys"),
        (json.dumps(in_json(variables="xy")), "list of names"),
        (json.dumps(in_json(basis="x")), "list of names"),
        (json.dumps(in_json(polynomial=[[1, [1]]])), "a coefficient and 2 exponents"),
        (json.dumps(in_json(polynomial=[[1, 0.5, 1]])), "a coefficient and 2 exponents"),
        (json.dumps(in_json(polynomial=[[1, [float("inf"), 1]]])), "a coefficient and 2 exponents"),
        (json.dumps(in_json(polynomial=[[1, [10**400, 1]]])), "Lower the degree"),
        (json.dumps(in_json(basis=[[10**400, 1], [1, 1], [0, 2]])), "Lower the degree"),
        (json.dumps(in_json(polynomial=3)), "a coefficient and 2 exponents"),
        (json.dumps(in_json(polynomial=[[float("nan"), [1, 1]]])), "coefficient must be a finite number"),
        (json.dumps(in_json(polynomial=["x^4", "-y^4"])), "a coefficient and 2 exponents"),
        (json.dumps(in_json(basis=[[[2, 0]], [1, 1], [0, 2]])), "2 non-negative integers"),
        ('{"polynomial": 1, "polynomial": 2}', "a key occurs twice"),
        (json.dumps(in_json(gram=[[1, None]])), "3 x 3"),
        ("[" * 100_000, "must be JSON"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path, content, said):
    path = tmp_path / "gram.json"
    path.write_text(content)
    with pytest.raises((PolynomialError, ParameterError), match=said) as refused:
        sos.read_gram(path).verify()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("constant", ["[-1e-300, [0]]", "[0.99999999999999999999999, [0]], [-1, [0]]"])
def test_numbers_of_json_are_read_as_they_are_written(tmp_path, constant):
    """The sum of the constants is negative; with floats the second is zero."""
    terms = f"{constant}, [1.0, [2.0]]"
    path = tmp_path / "gram.json"
    path.write_text(f'{{"variables": ["x"], "polynomial": [{terms}], "basis": [[1.0]], "gram": [[1.0]]}}')
    assert sos.read_gram(path).verify().verdict is sos.Positivity.NEGATIVE


def test_a_number_too_small_for_a_float_is_no_coefficient_but_an_entry_of_a_matrix(tmp_path):
    path = tmp_path / "gram.json"
    common = '{"variables": ["x"], "basis": ["x", "1"], "gram": [[1.0, 0.0], [-1e-400, 1.0]], "polynomial":'
    path.write_text(f'{common} "x^2 + 1"}}')
    assert sos.read_gram(path).verify().remark.startswith("proved by the given matrix")
    path.write_text(f"{common} [[1, [2]], [-1e-400, [0]]]}}")
    with pytest.raises(PolynomialError, match="coefficient must have at most 308 digits"):
        sos.read_gram(path)


def test_two_rows_of_text_are_no_polynomial(tmp_path):
    savemat(tmp_path / "gram.mat", in_matlab(p=np.array(["x^4", "-y^4"])))
    with pytest.raises(PolynomialError, match="a coefficient and 2 exponents"):
        sos.read_gram(tmp_path / "gram.mat")


def test_a_file_that_is_not_there_too_long_or_no_matlab_is_refused(tmp_path):
    with pytest.raises(PolynomialError, match="No such file"):
        sos.read_gram(tmp_path / "none.json")
    (tmp_path / "long.json").write_bytes(b" " * ((4 << 20) + 1))
    with pytest.raises(PolynomialError, match="at most 4 MiB"):
        sos.read_gram(tmp_path / "long.json")
    (tmp_path / "gram.mat").write_bytes(b"MATLAB 7.3 MAT-file")
    with pytest.raises(PolynomialError, match="MATLAB's save -v7"):
        sos.read_gram(tmp_path / "gram.mat")
    savemat(tmp_path / "gram.mat", {"p": TEXT})
    with pytest.raises(PolynomialError, match=r"exactly the keys Q, Z, p, vars\. Received 'p'"):
        sos.read_gram(tmp_path / "gram.mat")


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, arguments)))
    return ended.value.code, *capsys.readouterr()


def test_the_command_reads_a_file_and_writes_the_proof(tmp_path, capsys):
    path = tmp_path / "gram.json"
    path.write_text(json.dumps(in_json()))
    code, out, _ = run(capsys, "sos", "--gram", path, "--out", tmp_path / "proof.json", "--json")
    assert (code, json.loads(out)["verdict"]) == (0, "sos")
    assert json.loads(out)["remark"].startswith("proved by the given matrix")
    assert run(capsys, "check", tmp_path / "proof.json")[0] == 0
    for more in (["x^2"], ["--margin", "2"], ["--on", "x >= 0"], ["--degree", "4"]):
        assert run(capsys, "sos", "--gram", path, *more)[0] == 2
    assert run(capsys, "sos")[0] == 2


# ---------------------------------------------------------------- the page


def test_everything_on_the_page_runs(tmp_path, monkeypatch):
    """With stand-ins for what the other programmes have left: their matrix, their monomials, their files."""
    monkeypatch.chdir(tmp_path)
    x, y = sp.symbols("x y")
    monomials = [SimpleNamespace(degree={x: i, y: j}.get) for i, j in EXPONENTS]
    constraint = SimpleNamespace(Qval=EXACT + noise(3), b_sym=sp.Matrix([x**2, x * y, y**2]))
    setting = {
        **{"x": x, "y": y, "Q": EXACT + noise(3), "monomials": monomials, "constraint": constraint},
        **{"p": sp.sympify(TEXT.replace("^", "**")), "result": SimpleNamespace(GetSolution=lambda matrix: matrix)},
    }
    savemat("gram.mat", in_matlab())
    Path("gram.json").write_text(re.search(r"```json\n(.*?)```", PAGE, flags=re.DOTALL)[1])
    blocks = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(blocks) == 5
    for block in blocks:
        assert len(block.splitlines()) <= 10
        here = dict(setting)
        exec(compile(block, "own_certificate.md", "exec"), here)
        assert here["answer"].remark.startswith("proved by the given matrix")
        assert here["answer"].check()


@pytest.mark.parametrize(("gram", "basis"), [(None, None), ([[1.0]], None), ([[1.0]], 3), ([[1.0]], "x")])
def test_what_is_no_sequence_is_no_basis(gram, basis):
    with pytest.raises(PolynomialError, match="matrices and bases must be sequences"):
        sos.verify("x**2", gram, basis)
    with pytest.raises(PolynomialError, match="matrices and bases must be sequences"):
        sos.verify("x**2", gram, basis, on=["x >= 0"])


def test_a_name_that_no_file_has_is_refused():
    with pytest.raises(PolynomialError, match="no file can have this name"):
        sos.read_gram("\0")
