"""The page: signs as people write them, figures whose values can be read, a glossary that agrees with the docs."""

import json
import re
import tomllib
from fractions import Fraction as F
from html import unescape
from importlib.resources import files
from itertools import chain
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import control
import numpy as np
import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.cli.app import command_line, store_command
from quakedesign.fault import parse_fault
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.report import page
from quakedesign.report.drawing import FORMATS, figure, figure_bytes, inline_svg
from quakedesign.report.page import ASKED, CAPTIONS, mathml, parameter_rows, reproduction, typeset, unit_html
from quakedesign.report.paper_figures import PAPER
from quakedesign.studies.fault_facts import law_latex, plant_latex

FAULT = qd.load_fault("real-fault")
PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("|h'| <= 0.00032 m/s^2", "|h&#39;| ≤ 0.00032 m/s<sup>2</sup>"),
        ("within 4.12e-05 m", "within 4.12·10<sup>−5</sup> m"),
        ("a 2-CTA from -14.4 MPa to 1e+02", "a 2-CTA from −14.4 MPa to 1·10<sup>2</sup>"),
        ("T_s < 1 & L^2/D", "T<sub>s</sub> &lt; 1 &amp; L<sup>2</sup>/D"),
        ("<b>\x1b", "&lt;b&gt;\\x1b"),
        ("m^(2/3)/s^-1", "m<sup>2/3</sup>/s<sup>-1</sup>"),
        ("2026-11-22, 0x1e5f, v1.0e2.3", "2026-11-22, 0x1e5f, v1.0e2.3"),
    ],
)
def test_a_sentence_is_set_as_people_write_it(written, shown):
    assert typeset(written) == shown
    assert typeset(typeset(written)) == shown  # what is set stays as it is


def test_units_have_raised_exponents_and_dots():
    assert unit_html("Pa s/m^2") == "Pa·s/m<sup>2</sup>"
    assert (unit_html("-"), unit_html("")) == ("", "")


def test_equations_are_those_of_the_plant_and_of_the_law():
    motion, friction = plant_latex(FAULT)
    assert all(part in motion for part in (r"\hat{N}", r"\hat{k} x_{1}", r"\hat{\varphi}_e", r"\mu^{*} - \mu"))
    assert friction == r"\mu = \Delta\mu e^{- \frac{x_{1}}{d_{c}}} + \mu_{res}"
    pressure, first, second = law_latex(qd.published("real-fault")["elqr"])
    assert pressure.count("cdot 10^{9}") == 1  # 1.88e9 Pa/m, printed in the paper
    assert (first, second) == (r"\dot {z_1} = e_{1}", r"\dot {z_2} = z_{1}")
    assert law_latex(None) == []
    tree = ElementTree.fromstring(mathml(motion))
    assert tree.tag == "math"
    assert "".join(tree.itertext()).count("=") == 2


def test_the_numbers_in_an_equation_are_those_of_the_gains():
    law = qd.published("real-fault")["cta"]
    _, rate = law_latex(law)
    k3, k4 = (float(law.gains[k] * law.scale) for k in ("k3", "k4"))
    assert rate.startswith(r"\dot {z_1} = ")
    assert [float(number) for number in re.findall(r"\d+\.\d+", rate)] == pytest.approx([k3, k4], rel=1e-3)


@pytest.fixture(scope="module")
def drawing():
    made, ((first,), (second,)) = figure(2, 3.0)
    time = np.linspace(0, 10, 11)
    first.plot(time, time**2 + 1)
    first.set_yscale("log")
    first.set_ylabel("slip [m]")
    second.plot(time, time - 5)
    second.set_yscale("symlog", linthresh=0.1)
    second.set(xlabel="time [s]", ylabel="slip rate [m/s]", xlim=(0, 10), ylim=(-100, 100))
    return made


def test_a_figure_inside_a_page_is_small_and_keeps_what_it_says(drawing):
    first, second = (figure_bytes(drawing, "svg", "one").decode() for _ in range(2))
    assert first == second
    inside = inline_svg(first, drawing, "one", 'said "so"')
    assert len(inside) < 0.9 * len(first)
    assert ElementTree.fromstring(inside.replace("xlink:", "")).get("aria-label") == 'said "so"'
    names = re.findall(r'\bid="([^"]+)"', inside)
    assert len(names) == len(set(names)) > 20
    assert all(name.startswith("one-") for name in names)
    assert set(re.findall(r'(?:href="|url\()#([^")]+)', inside)) <= set(names)
    assert "#000000" not in inside
    said = [unescape(text).strip() for text in re.findall(r">([^<>]+)</text>", first)]
    assert said == [unescape(text).strip() for text in re.findall(r">([^<>]+)</text>", inside)]


def test_a_pointer_reads_the_values_that_were_drawn(drawing):
    inside = inline_svg(figure_bytes(drawing, "svg", "one").decode(), drawing, "one", "")
    logarithmic, symmetric = json.loads(unescape(re.search(r'data-axes="([^"]+)"', inside)[1]))
    assert logarithmic["x"] == {"label": "time [s]", "scale": "linear", "low": 0.0, "high": 10.0}
    low, high = drawing.axes[0].get_ylim()
    assert (logarithmic["y"]["low"], logarithmic["y"]["high"]) == pytest.approx(np.log10([low, high]))
    side = symmetric["y"]
    # linear·10^(u − bend), as the page has it: symlog of base 10 is linear up to linthresh at u = 10/9
    assert (side["linear"], side["bend"]) == pytest.approx((0.1, 10 / 9))
    assert side["linear"] * 10 ** (side["high"] / side["linear"] - side["bend"]) == pytest.approx(100)
    (left, top, right, bottom), height = symmetric["box"], drawing.get_figheight() * 72
    assert 0 < left < right < drawing.get_figwidth() * 72
    assert logarithmic["box"][3] < top < bottom < height


def test_a_figure_is_laid_out_once_for_all_its_files(monkeypatch):
    made, _ = figure(1, 2.0)
    times, draw = [], type(made).draw
    monkeypatch.setattr(type(made), "draw", lambda *given: times.append(1) or draw(*given))
    for kind in FORMATS:
        figure_bytes(made, kind, "one")
    assert len(times) == len(FORMATS)


@pytest.mark.parametrize("kind", FORMATS)
def test_figures_are_the_same_twice_and_carry_their_fonts(drawing, kind):
    data = figure_bytes(drawing, kind, "one")
    assert data == figure_bytes(drawing, kind, "one")
    start = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}[kind]
    assert data.startswith(start)
    assert b"2026" not in data if kind != "png" else b"Software" not in data
    if kind == "pdf":
        assert b"/FontFile2" in data  # TrueType, inside the file
        assert b"/Type3" not in data


def test_every_figure_has_a_caption_and_every_premise_is_told():
    own = {"overview", "errors", "metrics", "peak-against-tracking", "cycle", "slow-sliding", "sliding-errors"}
    assert set(PAPER) | own == set(CAPTIONS)
    assert all(said.endswith(".") for said in CAPTIONS.values())
    source = "".join(path.read_text(encoding="utf-8") for path in Path(qd.__file__).parent.rglob("*premise*.py"))
    named = set(re.findall(r'\bname="(\w+)"', source))
    assert len(named) > 4
    assert named <= set(ASKED)


def test_the_glossary_of_the_page_agrees_with_that_of_the_documentation():
    kinds = tomllib.loads((files("quakedesign.report") / "glossary.toml").read_text(encoding="utf-8"))
    told = (Path(__file__).parents[2] / "docs" / "explanation" / "glossary.md").read_text(encoding="utf-8")
    for symbols, meaning, unit in chain.from_iterable(kinds.values()):
        if symbols and unit not in ("", "–", "depends on the law"):
            assert set(unit.split(", ")) <= set(re.findall(r"[^\s|,]+", told)), (symbols, unit)
        word = meaning.split(":")[0] if not symbols else ""
        assert word.split(",")[0] in told


def test_the_table_of_parameters_is_the_fault():
    rows = {row[0]: row for row in parameter_rows(FAULT)}
    assert rows["shear modulus"][2:] == ("3e+10", "Pa", "fault")
    assert rows["critical slip"][2:] == ("0.27635", "m", "friction")
    assert rows["mass"][2:4] == ("3.125e+14", "kg")
    assert "width" not in rows  # square
    assert all(row[3] for row in rows.values())


def test_a_report_says_how_it_is_made_again(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    made = reproduction(FAULT, "quakedesign design real-fault")
    assert made.date == "1970-01-02 00:00 UTC"
    assert parse_fault("\n".join(made.scenario), "again") == FAULT
    assert {"quakedesign", "clarabel", "Python"} <= set(made.versions)
    store_command(["design", "my fault.toml"])
    assert command_line() == "quakedesign design 'my fault.toml'"
    store_command([])
    assert command_line() == ""


def test_numbers_of_many_digits_become_decimals_and_no_others():
    from quakedesign.studies.fault_facts import _written

    x = sp.Symbol("x", real=True)
    assert _written(sp.Rational(1, 3) * x) == r"\frac{x}{3}"
    assert _written(sp.Rational(123456, 1000) * x) == "123.5 x"
    assert _written(sp.sqrt(2) * x) == "1.414 x"


def test_the_report_says_behind_what_its_runs_are():
    def compared(**path):
        design = SimpleNamespace(setup=SimpleNamespace(path={name: time for name, time in path.items() if time}))
        return SimpleNamespace(of=lambda _: [SimpleNamespace(design=design)])

    assert (
        page._loop_stages(compared())
        == page._loop_stages(compared(lag=F(0)))
        == "the pressure in the runs acts without delay"
    )
    found = page._loop_stages(compared(delay=F("0.15"), lag=F("0.03"), diffusion=F(2)))
    assert found.endswith("acts through a delay of 0.15 s, a lag of 0.03 s, a diffusion path of L^2/D = 2 s")


def test_a_linear_law_is_shown_as_difference_equation_and_for_python_control():
    """The text for python-control builds the law of the certificate, matrix by matrix."""
    found = parse_guarantee((PROOFS / "guarantee_real-fault.json").read_text())
    entry = SimpleNamespace(proof=found)
    names = {}
    exec("\n".join(page._python(entry)), names)
    law, own = names["law"], found.sampled_loop.law
    assert law.dt == float(found.sampled_loop.step) == 0.184
    for matrix, rows in ((law.A, own.update), (law.B, own.measured), (law.C, [own.output]), (law.D, [own.feedback])):
        assert matrix.tolist() == [[float(v) for v in row] for row in rows]
    assert isinstance(law, control.StateSpace)
    equations = page._difference(entry)
    assert len(equations) == 2
    assert f"{float(own.feedback[0]):.4g}".split("e")[0].lstrip("-") in equations[1]
    sliding = parse_guarantee((PROOFS / "guarantee_cta_real-fault.json").read_text())
    implicit = SimpleNamespace(proof=sliding)
    assert page._python(implicit) == page._difference(implicit) == []
    large = parse_guarantee((PROOFS / "sliding_crustal-patch.json").read_text())
    many = SimpleNamespace(proof=large)
    assert len(large.sampled_loop.law.states) > 4
    assert page._python(many)
    assert page._difference(many) == []
    assert page._python(SimpleNamespace(proof=None)) == []


def test_controllers_of_which_everything_is_the_same_share_a_card():
    empty = {"badge": "b", "good": True, "limits": [], "proof": [], "law": [], "python": [], "gains": []}
    empty |= {"premises": [], "base_premises": [], "feedforward": []}
    made = [
        page.Account(label=label, guarantee=guarantee, run=["r"], verdict=["v"], **empty)
        for label, guarantee in [
            ("A (designed)", ["g"]),
            ("B (designed)", ["g"]),
            ("C (designed)", ["h"]),
            ("D (published)", []),
            ("E (published)", []),
        ]
    ]
    labels = ["A, B (designed)", "C (designed)", "D (published)", "E (published)"]
    assert [card.label for card in page._shared_accounts(made)] == labels


def test_numbers_of_a_sliding_mode_have_their_units():
    gains = {"scale": F(2), "authority": F(3), "slip_weight": F(1, 2), "rest_slip": F(1, 10**6)}
    rows = page._gains(SimpleNamespace(design=SimpleNamespace(controller=None, gains=gains)))
    assert [(name, text) for name, text, _ in rows] == list(zip(gains, ("2", "3", "0.5", "1e-06"), strict=True))
    assert [unit for *_, unit in rows] == [unit_html(unit) for unit in ("", "m^2/kg", "", "m")]
