"""Regions of attraction: levels of the literature, closed forms, refutations, and the command."""

import contextlib
import io
import json
import re
import tomllib
from fractions import Fraction as F
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign import sos
from quakedesign.cli import main
from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.attraction import Region, load, read_field, text
from quakedesign.sos.exact.polynomial_files import load as load_polynomial
from quakedesign.sos.exact.proofs import Point
from quakedesign.sos.exact.words import region_entries, region_words
from quakedesign.sos.solve import attraction_search as attraction

ROOT = Path(__file__).parents[3]
PAGE, LEVELS = (
    (ROOT / "docs" / page).read_text(encoding="utf-8")
    for page in ("howto/region_of_attraction.md", "explanation/attraction_levels.md")
)
ROWS = {
    row[0]: row for row in re.findall(r"^\| (?!system|field)([a-z0-9-]+)" + r" \| (.+?)" * 6 + r" \|$", LEVELS, re.M)
}
SYSTEMS = tomllib.loads((ROOT / "tests" / "sos" / "regions.toml").read_text(encoding="utf-8"))
TRUTH = {
    "cubic": 1, "cubic-quartic": 1, "rational-cubic": 1, "drake-12876": 1 / 20, "hahn": 8 * sqrt(3) / 9,
    "ahmadi-krstic-parrilo": 27 / 4, "tibken": 4, "tan-2": 1 / 3,
    "tan-3": 1 - 1 / sqrt(2),
}  # fmt: skip  # by hand
PLANAR = [name for name, row in SYSTEMS.items() if len(row["field"]) == 2]
VAN_DER_POL = SYSTEMS["van-der-pol"]["field"]


@cache
def region(name):
    return sos.region_of_attraction(SYSTEMS[name]["field"], SYSTEMS[name].get("V"))


def test_the_table_is_about_all_systems():
    assert ROWS.keys() == SYSTEMS.keys()


@few("name", SYSTEMS, every=4)
def test_the_level_is_proved_and_a_point_just_above_refutes_more(name):
    found = region(name)
    *_, published, _, _, proved, above = ROWS[name]
    assert (found.verdict, found.proved.verdict, found.refuted.verdict) == ("proved", "proved", "refuted")
    assert load(text(found.proved)).check()
    assert load(text(found.refuted)).check()
    assert F(proved) <= found.level <= found.refuted_above <= F(above)
    assert found.level >= F(99, 100) * F(published.split("= ")[-1].replace("—", "0"))
    assert found.refuted_above - found.level < F(1, 10**4) * found.level


@pytest.mark.parametrize("name", TRUTH)
def test_levels_known_by_hand_are_met(name):
    assert float(region(name).level) == pytest.approx(TRUTH[name], rel=1e-5)
    assert float(region(name).level) <= TRUTH[name] * (1 + 1e-12)


def symbolic(name):
    """States, field and V, the latter from the linearised field unless given, all by SymPy alone."""
    row = SYSTEMS[name]
    x = sp.Matrix(sp.symbols(list(row["field"])))
    f = sp.Matrix([sp.nsimplify(sp.sympify(text.replace("^", "**")), rational=True) for text in row["field"].values()])
    if "V" in row:
        return x, f, sp.sympify(row["V"].replace("^", "**"))
    a, b, c = sp.symbols("p_a p_b p_c")
    A, P = f.jacobian(x).subs(dict.fromkeys(x, 0)), sp.Matrix([[a, b], [b, c]])
    return x, f, (x.T * P.subs(sp.solve(list(A.T * P + P * A + sp.eye(2)), [a, b, c])) * x)[0]


def least_on_the_zero_set(name):
    """Least V > 0 where V̇ = 0: V at all such points on the lines x = root of the resultant of Lagrange's equations."""
    (x, y), f, V = symbolic(name)
    rate = sp.expand(sp.diff(V, x) * f[0] + sp.diff(V, y) * f[1])
    rate = sp.expand(sp.cancel(rate / sp.gcd(rate, V)))  # V is no factor of what vanishes away from the origin
    tangent = sp.expand(sp.diff(V, x) * sp.diff(rate, y) - sp.diff(V, y) * sp.diff(rate, x))
    factors = sp.factor_list(sp.resultant(rate, tangent, y), x)[1]
    lines = [sp.re(r) for g, _ in factors for r in sp.Poly(g, x).nroots(n=40, maxsteps=500) if abs(sp.im(r)) < 1e-15]
    places = [(r, q.real) for r in lines for q in np.roots([float(c) for c in sp.Poly(rate.subs(x, r), y).all_coeffs()])
              if abs(q.imag) < 1e-4]  # fmt: skip
    return min(v for v in (float(V.subs({x: r, y: q})) for r, q in places) if v > 1e-9)


@few("name", PLANAR, every=7)
def test_the_level_is_almost_the_least_v_where_it_does_not_fall(name):
    largest = least_on_the_zero_set(name)
    written = float(sp.sympify(ROWS[name][3].replace("√3", "*sqrt(3)")))
    assert (1 - 1e-4) * largest < float(region(name).level) <= (1 + 1e-12) * largest
    assert largest == pytest.approx(written, rel=2e-7)


def test_levels_that_are_simple_numbers_are_proved_exactly():
    exact = {"cubic": 1, "drake-12876": F(1, 20), "ahmadi-krstic-parrilo": F(27, 4), "chesi-1": 4, "tibken": 4}
    assert {name: region(name).level for name in exact} == exact


@pytest.mark.parametrize("size", [F(1, 10**8), F(10**8)])
def test_the_size_of_v_does_not_matter(size):
    scaled = sos.region_of_attraction(SYSTEMS["parrilo"]["field"], f"{size}*(x^2 + y^2)")
    assert float(scaled.level / size) == pytest.approx(float(region("parrilo").level), rel=1e-4)


def test_v_of_the_linearised_field_solves_its_equation():
    assert region("van-der-pol").proved.lyapunov == {(2, 0): F(3, 2), (1, 1): -1, (0, 2): 1}


def test_solutions_from_just_inside_the_proved_region_arrive():
    claim = region("van-der-pol").proved
    level = float(claim.level)
    for angle in np.linspace(0, 6, 7):
        direction = np.array([np.cos(angle), np.sin(angle)])
        size = sqrt(level / (1.5 * direction[0] ** 2 - direction[0] * direction[1] + direction[1] ** 2))
        start = 0.9999 * size * direction
        end = solve_ivp(lambda t, x: [-x[1], x[0] + (x[0] ** 2 - 1) * x[1]], (0, 60), start, rtol=1e-9).y[:, -1]
        assert np.abs(end).max() < 1e-6


@pytest.fixture(scope="module")
def on_the_page(tmp_path_factory):
    """Names of the page's Python, what it prints and the folder that it writes to."""
    said, names = io.StringIO(), {"folder": tmp_path_factory.mktemp("page")}
    with contextlib.chdir(names["folder"]), contextlib.redirect_stdout(said):
        for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
            exec(compile(block, "region_of_attraction.md", "exec"), names)
    return names | {"said": said.getvalue()}


# ---------------------------------------------------------------- searched functions

SEARCHED = {row[0]: row[1:] for row in re.findall(r"^\| ([a-z0-9-]+)" + r" \| ([\d.]+)" * 5 + r" \|$", LEVELS, re.M)}


@cache
def grown(name, degree):
    shape = " + ".join(f"{x}^2" for x in SYSTEMS[name]["field"])
    return sos.region_of_attraction(SYSTEMS[name]["field"], SYSTEMS[name].get("V"), degree=degree, shape=shape)


def test_the_table_of_searched_functions_is_about_all_fields_of_which_a_start_outside_is_known():
    assert SEARCHED.keys() == {name for name, row in SYSTEMS.items() if "escape" in row}


@pytest.mark.parametrize("name", SEARCHED)
def test_a_solution_from_just_outside_does_not_arrive(name):
    x, f, _ = symbolic(name)
    start = SYSTEMS[name]["escape"]
    far = lambda t, z: float(np.dot(z, z)) - 1e4  # noqa: E731
    far.terminal = True
    rates = sp.lambdify([list(x)], list(f))
    end = solve_ivp(lambda t, z: rates(z), (0, 200), start, rtol=1e-9, atol=1e-12, events=far).y[:, -1]
    assert np.abs(end).max() > 1
    assert float(SEARCHED[name][-1]) == pytest.approx(float(np.dot(start, start)), rel=1e-4)


@few("name", SEARCHED, every=3)
def test_what_is_inside_is_below_what_is_outside(name):
    found = grown(name, None)
    level = float(found.shape_level)
    assert float(SEARCHED[name][0]) <= level < float(SEARCHED[name][-1])
    assert found.inclusion.check()


@pytest.mark.slow
def test_a_searched_function_is_proved_and_its_region_has_the_part_of_the_shape(on_the_page):
    found = on_the_page["grown"]
    assert (found.verdict, found.proved.verdict, found.refuted.verdict) == ("proved", "proved", "refuted")
    assert found.proved.check()
    assert found.inclusion.check()
    asked = found.inclusion.statement
    inside = {(0, 0): found.shape_level, (2, 0): -1, (0, 2): -1}
    assert asked.inequalities == (inside,)
    assert asked.polynomial == {e: -c for e, c in found.proved.lyapunov.items()} | {
        (0, 0): F(999999, 10**6) * found.level
    }
    assert float(SEARCHED["parrilo"][1]) <= float(found.shape_level) < float(SEARCHED["parrilo"][-1])


@pytest.mark.slow
@pytest.mark.parametrize("name", SEARCHED)
@pytest.mark.parametrize(("degree", "column"), [(2, 1), (4, 2), (6, 3)])
def test_functions_of_higher_degree_prove_more(name, degree, column):
    found = grown(name, degree)
    assert found.proved.check()
    assert found.inclusion.check()
    assert load(text(found.proved)).check()
    assert float(SEARCHED[name][column]) <= float(found.shape_level) < float(SEARCHED[name][-1])
    assert max(map(sum, found.proved.lyapunov)) <= degree


@pytest.mark.parametrize("degree", [0, 3, -2])
def test_a_degree_must_be_even(degree):
    with pytest.raises(PolynomialError, match="degree must be an even number from 2"):
        sos.region_of_attraction({"x": "-x + x^3"}, degree=degree)


def test_a_shape_with_a_constant_term_is_rejected_as_a_shape():
    with pytest.raises(PolynomialError, match="a shape must vanish at the origin"):
        sos.region_of_attraction({"x": "-x + x^3"}, "x^2", shape="1 + x^2")


def test_a_shape_without_a_part_in_the_region_is_left_out():
    """−x² is at most β everywhere; the region is not."""
    found = sos.region_of_attraction({"x": "-x + x^3"}, "x^2", shape="-x^2")
    assert (found.level, found.inclusion, found.shape_level) == (1, None, None)
    with pytest.raises(PolynomialError, match="vanish at the origin"):
        sos.region_of_attraction({"x": "-x + x^3"}, "x^2", shape="x^2 + 1")


def test_states_may_have_the_names_of_decisions():
    claim = sos.stability({"c0": "-c0^3 + c1", "c1": "-c0 - c1^3"}, degrees=(2,))
    assert (claim.verdict, claim.check()) == ("proved", True)


# ---------------------------------------------------------------- everywhere


def test_the_example_of_the_manual_of_sostools_is_stable_everywhere():
    field = {"x": "(-x^3 - x*z^2)*(z^2 + 1)", "y": "(-y - x^2*y)*(z^2 + 1)", "z": "(-z + 3*x^2*z)*(z^2 + 1) - 3*z"}
    claim = sos.stability(field, "6*x^2 + 4*y^2 + 2*z^2")
    assert claim.verdict == "proved"
    assert claim.level is None
    assert claim.check()


def test_a_function_is_searched():
    claim = sos.stability({"x": "-x^3 + y", "y": "-x - y^3"}, degrees=(2,))
    assert (claim.verdict, claim.check()) == ("proved", True)
    assert load(text(claim)).check()


def test_another_equilibrium_refutes():
    claim = sos.stability({"x": "-x + x^3"})
    assert (claim.verdict, claim.equilibrium, claim.check()) == ("refuted", True, True)
    assert abs(claim.proof.coordinates[0]) == 1


@pytest.mark.parametrize(
    ("field", "V"),
    [
        ({"x": "x"}, "x^2"),
        ({"x": "-x", "y": "-y"}, "x^2 - y^2"),
        ({"x": "-x", "y": "-y"}, "x^2 - y^2/1000"),
        ({"x": "y", "y": "-x"}, "x^2 + y^2"),
        ({"x": "-x + y^2", "y": "-y"}, "x^2 + y^2"),
    ],
)
def test_a_function_that_does_not_fall_or_is_not_positive_is_refuted(field, V):
    claim = sos.stability(field, V)
    assert (claim.verdict, claim.level, claim.check()) == ("refuted", None, True)
    assert isinstance(claim.proof, Point)


def test_what_is_stable_everywhere_has_no_level():
    found = sos.region_of_attraction({"x": "-x - x^3"})
    assert (found.verdict, found.level, found.refuted_above) == ("proved", None, None)
    assert found.proved.check()


def test_what_is_not_proved_says_why():
    assert (
        sos.region_of_attraction({"x": "x"}).remark
        == "the linearised field has no positive definite V = x^T P x with A^T P + P A = -I: give a V"
    )
    assert sos.region_of_attraction({"x": "-x", "y": "-y"}, "x^2 - y^2").remark == "V is not positive"
    found = sos.region_of_attraction({"x": "x"}, "x^2")
    assert (found.verdict, found.level, found.remark) == (
        "undecided",
        None,
        "no level below the refuted one was proved",
    )
    claim = sos.stability(VAN_DER_POL, degrees=())
    assert (claim.verdict, claim.check(), claim.reason) == ("undecided", True, "no degree of V was tried")
    motzkin = "x^4*y^2 + x^2*y^4 + z^6 - 3*x^2*y^2*z^2 + (x^6 + y^6 + z^6)/100"  # positive, and no sum of squares
    claim = sos.stability({"x": "-x", "y": "-y", "z": "-z"}, motzkin)
    assert (claim.verdict, claim.reason[:8]) == ("undecided", "neither ")
    given = sos.stability({"x": "-x^3"}, "x^2 + x^4 - x^6")
    assert given.verdict == "refuted"
    assert given.reason == ""


def test_a_search_for_v_that_ends_without_one_says_which_degree_and_why():
    searched = sos.stability({"x": "-x + y", "y": "-x*y^2 - y^3"}, degrees=(2,))
    assert searched.verdict == "undecided"
    assert searched.reason == "no V of degree 2: the programme is infeasible in floating point"
    forced = sos.stability({"x": "-x + x*y", "y": "-y"}, degrees=(2,)).reason
    assert "so the coefficient of x^2 = 0" in forced  # -dV/dt has 2*c*x^2*y, which no square produces
    assert region_words(Region.of(searched))[-1] == searched.reason
    assert region_entries(Region.of(searched))["remark"] == searched.reason


@pytest.mark.parametrize(
    ("field", "V", "said"),
    [
        ({}, None, "a rate for every state"),
        ({"x": "-x + 1"}, None, "vanish at the origin"),
        ({"x": "-x"}, "x^2 + 1", "vanish at the origin"),
        ({"x": "-y"}, None, "y"),
        ({"x": "-x"}, "y^2", "y"),
    ],
)
def test_another_field_is_refused(field, V, said):
    with pytest.raises(PolynomialError, match=said):
        sos.region_of_attraction(field, V)


@pytest.mark.parametrize("relative", [float("nan"), float("inf"), 1.0, 0.0, -1.0, 1e-7])
def test_a_step_of_no_bisection_is_refused(relative):
    with pytest.raises(PolynomialError, match=r"relative must be from 1e-06 to below 1\. Received"):
        sos.region_of_attraction({"x": "-x + x^3"}, "x^2", relative=relative)


def test_a_level_is_bisected_where_less_is_proved_than_is_not_refuted(monkeypatch):
    """Proofs only below 77/100; the finest step that is taken."""
    monkeypatch.setattr(
        attraction, "_proved", lambda claim, **_: claim if claim.level and claim.level < F(77, 100) else None
    )
    found = sos.region_of_attraction({"x": "-x + x^3"}, "x^2", relative=1e-6)
    assert F(77, 100) * (1 - F(2, 10**6)) < found.level < F(77, 100)


def test_states_of_one_name_are_refused():
    plain, real = sp.Symbol("x"), sp.Symbol("x", real=True)
    with pytest.raises(PolynomialError, match="variables must be different"):
        sos.stability({plain: -plain, real: -real})


# ---------------------------------------------------------------- the command, and the page


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, arguments)))
    return ended.value.code, *capsys.readouterr()


def test_the_command_proves_refutes_and_writes_both(tmp_path, capsys):
    (tmp_path / "field.toml").write_text('V = "x^2"\n[field]\nx = "-x + x^3"\n')
    files = [tmp_path / "proof.json", tmp_path / "above.json"]
    line = ["attraction", tmp_path / "field.toml", "--out", files[0], "--above", files[1]]
    code, out, _ = run(capsys, *line, "--json")
    facts = json.loads(out)
    assert (code, facts["verdict"], facts["level"], facts["refuted_above"]) == (0, "proved", "1", "1")
    assert facts["equilibrium"]
    assert run(capsys, *line)[0] == 2
    code, out, _ = run(capsys, *line, "--force")
    assert "every solution that starts where V < 1 (1 rounded down) tends to the origin" in out
    assert "another equilibrium, which no region of attraction contains: x = " in out
    code, out, _ = run(capsys, "check", *files)
    assert (code, out.count(": proved"), out.count(": refuted")) == (1, 1, 1)


def test_the_command_writes_the_proof_of_the_part_of_a_shape(tmp_path, capsys):
    (tmp_path / "field.toml").write_text('V = "x^2"\n[field]\nx = "-x + x^3"\n')
    line = ["attraction", tmp_path / "field.toml", "--shape", "4*x^2", "--inclusion", tmp_path / "part.json"]
    code, out, _ = run(capsys, *line, "--json")
    facts = json.loads(out)
    assert (code, facts["shape"], facts["file_inclusion"]) == (0, "4*x^2", str(tmp_path / "part.json"))
    assert float(F(facts["shape_level"])) == pytest.approx(4, rel=2e-5)
    assert F(facts["shape_level"]) < 4
    code, out, _ = run(capsys, *line, "--force")
    assert f"the region contains 4*x^2 <= {facts['shape_level']} (3.9999" in out
    assert run(capsys, "check", tmp_path / "part.json")[0] == 0
    code, _, said = run(capsys, *line[:2], "--everywhere", "--degree", "2")
    assert (code, "--degree and --shape cannot be used with --everywhere" in said) == (2, True)


def test_the_command_says_what_is_not_so_everywhere(tmp_path, capsys):
    (tmp_path / "field.toml").write_text('V = "x^2"\n[field]\nx = "-x + x^3"\n')
    code, out, _ = run(capsys, "attraction", tmp_path / "field.toml", "--everywhere", "--out", tmp_path / "no.json")
    assert (code, out.splitlines()[0]) == (1, "refuted")
    assert run(capsys, "check", tmp_path / "no.json")[1].startswith(f"{tmp_path / 'no.json'}: refuted")


@pytest.mark.parametrize(
    "content",
    ["[field", "x = 1", "[field]\nx = 1", 'V = 2\n[field]\nx = "-x"', '[field]\nx = "-x"\n[more]', "\x00" * 70_000],
)
def test_another_file_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "field.toml").write_text(content)
    with pytest.raises(PolynomialError) as refused:
        read_field(tmp_path / "field.toml")
    assert "\n" not in str(refused.value)
    with pytest.raises(PolynomialError, match="No such file"):
        read_field(tmp_path / "none.toml")


@pytest.mark.slow
def test_everything_on_the_page_runs(on_the_page, tmp_path):
    assert on_the_page["said"].count("True True") == 2
    assert on_the_page["said"].endswith("\nproved\n")
    assert (
        load_polynomial((on_the_page["folder"] / "inclusion.json").read_text())[1]
        == on_the_page["grown"].inclusion.proof
    )
    (tmp_path / "field.toml").write_text(re.search(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)[1])
    assert read_field(tmp_path / "field.toml") == (SYSTEMS["parrilo"]["field"], SYSTEMS["parrilo"]["V"])
