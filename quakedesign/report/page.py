"""HTML report on one page with its figures and equations, without external resources.

Chapters: units and numbers as HTML; equations as MathML; account of every controller; parameter table; reproduction;
captions; page.
"""

import os
import platform
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from latex2mathml.converter import convert
from markupsafe import Markup, escape

from quakedesign.fault import Fault, fault_toml
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.fault_toml import DISTURBANCE, PLANT, TASK, WIDTHS
from quakedesign.files import Json
from quakedesign.laws import LinearLaw
from quakedesign.laws.stick_slip_controller import StickSlipController
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.lyapunov import Verdict
from quakedesign.report.sentences import (
    FEEDFORWARD_COLUMNS,
    cycle_sentences,
    domain_sentence,
    feedforward_rows,
    grade,
    guarantee_lines,
    limit_lines,
    run_sentences,
    scheme_sentence,
    sentences,
    without_stated_reason,
)
from quakedesign.report.summary import SUMMARY_COLUMNS, summary, summary_cells
from quakedesign.report.tables import COLUMNS, rows
from quakedesign.studies.fault_facts import fault_sentences, law_latex, plant_latex, stick_slip_latex
from quakedesign.text import quantity, visible

if TYPE_CHECKING:
    from quakedesign.lyapunov.exact.premises import Premise
    from quakedesign.studies.comparison import Compared, Entry


# ----------------------------------------------------------------------
# Units, numbers and sentences as HTML.

_SIGNS = (("&lt;=", "≤"), ("&gt;=", "≥"), ("T_s", "T<sub>s</sub>"))


def unit_html(unit: str) -> Markup:
    """``Pa s/m^2`` with a raised exponent and dots between factors; empty for a pure number."""
    return Markup("") if unit in ("", "-") else _set(unit.replace(" ", "·"))


def typeset(text: object) -> object:
    """Plain text typeset with signs, raised exponents and powers of ten; other values are unchanged."""
    return _set(text) if isinstance(text, str) and not isinstance(text, Markup) else text


def _set(text: str) -> Markup:
    sentence = str(escape(visible(text)))
    for written, shown in _SIGNS:
        sentence = sentence.replace(written, shown)
    sentence = re.sub(r"\^(?:\(([-\d/]+)\)|(-?\d+))", lambda power: f"<sup>{power[1] or power[2]}</sup>", sentence)
    sentence = re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e([-+]\d+)\b", _power_of_ten, sentence)
    return Markup(re.sub(r"(?<![\w<>./^;])-(?=\d)", "−", sentence))


def _power_of_ten(number: re.Match[str]) -> str:
    power = str(int(number[2])).replace("-", "−")
    return f"{number[1]}·10<sup>{power}</sup>"


# ----------------------------------------------------------------------
# Equations as MathML, which browsers render without a script or a network.


def mathml(latex: str, *, display: str = "block") -> Markup:
    """MathML of an equation in LaTeX."""
    drawn = convert(latex, display=display)
    return Markup(drawn.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', ""))


# ----------------------------------------------------------------------
# Account of every controller on the page: guarantee, run, limits, proof, each in sentences and rows.

_SHOWN_STATES = 4  # largest number of states of a law whose matrices are shown
ASKED = {
    "sampling_time": "the pressure is updated at least as often as certified",
    "delay": "the time from the measurement to the pressure is not longer than certified",
    "control_coefficient": "the input gain β stays in the certified range",
    "friction_slope": "friction changes with slip no faster than certified",
    "along_reference": "the rate |h'| due to reference and disturbance alone is within the certified bound",
    "level_set": "the initial condition at rest lies in the certified set, for every phase of the disturbance",
    "on_trajectory": "in the run shown, |h'| stays within the certified bound",
    "constant_reference": "the reference is constant",
    "vanishing_disturbance": "the disturbance vanishes at the equilibrium",
    "pressure_at_rest": "the equilibrium pressure of the task lies within the pressure limits of the law",
    "differentiator": "the slip rate is estimated by a differentiator that is fast enough",
}
"""Condition of every premise in words; premises of user-defined laws have notes instead."""


@dataclass(frozen=True, kw_only=True)
class Account:
    """Statements of the report about one controller."""

    label: str
    badge: str
    good: bool  # Whether there is a guarantee, or a certificate whose premises all hold for this loop and task
    # guarantee, run, limits, verdict, proof: Sentences without a full stop
    guarantee: list[str]
    run: list[str]
    limits: list[str]
    verdict: list[str]
    proof: list[str]
    law: list[Markup]  # Equations with the numbers of the design
    python: list[str]  # Lines of the sampled linear law for python-control; empty for other laws
    gains: list[tuple[str, str, Markup]]  # Name, value, unit
    # Rows of the tables: premises of the first proof, premises of the certificate of the base gains in continuous time,
    # and certified values with a feed-forward
    premises: list[tuple[str, ...]]
    base_premises: list[tuple[str, ...]]
    feedforward: list[tuple[str, ...]]


def accounts(comparison: "Compared") -> list[Account]:
    """Accounts of all controllers, designed ones first."""
    return [_account(entry) for origin in ("designed", "published") for entry in comparison.of(origin)]


def _shared_accounts(every: Iterable[Account]) -> list[Account]:
    """Accounts; controllers with equal guarantees, runs and verdicts share one."""
    cards: dict[tuple[Any, ...], Account] = {}
    for one in every:
        key = (tuple(one.guarantee), tuple(one.run), tuple(one.verdict))
        card = cards.get(key)
        label = one.label if card is None else f"{card.label.removesuffix(' (designed)')}, {one.label}"
        cards[key if one.guarantee else (one.label,)] = replace(one, label=label)
    return list(cards.values())


def _account(entry: "Entry") -> Account:
    design = entry.design
    run = run_sentences(entry.run, design.fault) if entry.run else []
    guaranteed, limits = guarantee_lines(entry), limit_lines(entry)
    compensated = [entry.guarantee.compensation.sentence()] if entry.guarantee and entry.guarantee.compensation else []
    domain = [domain_sentence(design.domain)] if design.domain else []
    # Sampling of a sampled law; None for a law in continuous time.
    sampling = design.controller.sampling if design.controller else None
    return Account(
        label=entry.label,
        badge=badge(entry),
        good=entry.proof is not None or grade(entry) == "proved for this loop and task",
        guarantee=[line for line in guaranteed if line not in (*limits, *compensated)],
        run=run,
        limits=limits,
        verdict=without_stated_reason([sentence for sentence in sentences(entry) if sentence not in run], entry),
        proof=[
            *compensated,
            *([f"it runs in the scheme {sampling.scheme}, once every {float(sampling.step):g} s"] if sampling else []),
            *_at_samples(entry),
            *_slow_sliding_proof(entry),
            *domain,
        ],
        law=_equations(entry) + _difference(entry),
        python=_python(entry),
        gains=_gains(entry),
        premises=[_row(p) for p in design.conditions],
        base_premises=[_row(p) for p in design.premises if p not in design.conditions],
        feedforward=feedforward_rows(entry.variants) if entry.variants else [],
    )


def _slow_sliding_proof(entry: "Entry") -> list[str]:
    """Explanation of a guarantee of slow sliding; empty for other guarantees."""
    proof = entry.proof
    if proof is None or not proof.cells:
        return []
    cells = "one cell" if len(proof.cells) == 1 else f"{len(proof.cells)} cells"
    return [
        "The pressure at the well is p plus a planned pressure, which the nominal fault needs along its reference and "
        "which grows at the rate kV/(μ* A)",
        "How the bound is proved: with v = V e^y and θ = (D_c/V) e^z, the loop about slow sliding at V is linear "
        "except for the exponentials. The model omits inertia and some diffusion modes. The exponentials lie in "
        "sectors for |y| ≤ Y; the omitted parts are bounded. L1 norms of the linear loop then bound all errors in "
        "terms of the claims, and the resulting bounds lie within the claims (small gain). The claims hold "
        f"{proof.validity}. The box of constants is divided into {cells}",
    ]


def _linear_law(entry: "Entry") -> "LinearLaw | None":
    """Sampled linear law of a guarantee; None for laws with an implicit step, and without a guarantee."""
    law = getattr(getattr(entry.proof, "sampled_loop", None), "law", None)
    return law if isinstance(law, LinearLaw) and law.implicit_step is None else None


def _at_samples(entry: "Entry") -> list[str]:
    """Definitions of the symbols in the difference equations of a stick–slip law; empty for other laws."""
    law = getattr(getattr(entry.proof, "sampled_loop", None), "law", None)
    if not isinstance(law, StickSlipLaw):
        return []
    root = " (within the proved errors, where the implicit step of the sliding mode is deadbeat)" if law.pull else ""
    return [
        f"the equations with the index k are the implemented law{root}: x and y are the measured slip [m] and slip "
        "rate [m/s], r the reference [m], v the target slip rate [m/s], i the innovation of the slip [m], D the "
        "estimate of the disturbance [Pa]; D, v+, x and y are 0 before the first sample"
    ]


def _equations(entry: "Entry") -> list[Markup]:
    """Equations of the law in continuous time, if any, and of a stick–slip law at its samples."""
    sampled: Any = getattr(entry.proof, "sampled_loop", None)
    controller, law = entry.design.controller, getattr(sampled, "law", None)
    latex = [] if isinstance(controller, StickSlipController) else law_latex(controller)
    if isinstance(law, StickSlipLaw):
        latex += stick_slip_latex(law, float(sampled.step))
    return [mathml(equation) for equation in latex]


def _difference(entry: "Entry") -> list[Markup]:
    """A sampled linear law as difference equations, rounded to four digits."""
    law = _linear_law(entry)
    if law is None or len(law.states) > _SHOWN_STATES:
        return []

    def matrix(rows: Iterable[Iterable[Any]]) -> str:
        inner = r" \\ ".join(" & ".join(f"{float(v):.4g}" for v in row) for row in rows)
        return rf"\begin{{bmatrix}} {inner} \end{{bmatrix}}"

    return [
        mathml(rf"z_{{k+1}} = {matrix(law.update)} z_k + {matrix(law.measured)} y_k"),
        mathml(rf"p_k = {matrix([law.output])} z_k + {matrix([law.feedback])} y_k"),
    ]


def _python(entry: "Entry") -> list[str]:
    """Lines of Python that give a sampled linear law to python-control; empty for other laws."""
    law = _linear_law(entry)
    if law is None or entry.proof is None:
        return []
    floats = [
        [[float(v) for v in row] for row in rows] for rows in (law.update, law.measured, [law.output], [law.feedback])
    ]
    step = float(entry.proof.sampled_loop.step)
    return [
        "import control",
        "",
        f"law = control.ss(  # states: {', '.join(law.states)}",
        *(f"    {matrix}," for matrix in floats),
        f"    {step!r},",
        ")",
    ]


def badge(entry: "Entry") -> str:
    """Verdict in a few words."""
    if entry.proof is not None:
        step = entry.design.fault.sampling_time
        return f"not guaranteed at T_s = {step:g} s" if entry.design.other_step else "guaranteed for the sampled loop"
    verdict = entry.design.verdict
    return "proved in continuous time only" if verdict is Verdict.PROVED else str(verdict)


def _row(premise: "Premise") -> tuple[str, ...]:
    ratio = "–" if premise.ratio is None else f"{premise.ratio:.3g}"
    return (premise.name, *premise.sides, ratio, "yes" if premise.holds else "no", premise.note)


_OTHER_UNITS = {"scale": "", "weight": "", "divisor": "m^2/kg", "authority": "m^2/kg"}
_OTHER_UNITS |= {"rest_width": "Pa", "rest_per_slip": "Pa/m", "rest_resolution": "m"}
_OTHER_UNITS |= {"rest_least": "Pa", "rest_largest": "Pa", "rest_fastest": "m", "rest_slip": "m"}


def _gains(entry: "Entry") -> list[tuple[str, str, Markup]]:
    units: dict[str, Any] = _OTHER_UNITS | (dict(entry.design.controller.gain_units) if entry.design.controller else {})
    return [(n, f"{float(v):.6g}", unit_html(units.get(n, ""))) for n, v in entry.design.gains.items()]


# ----------------------------------------------------------------------
# Parameters of a fault with symbols and units, as table rows.

_DERIVED = {
    "mass": ("m", "kg"),
    "stiffness": ("k", "N/m"),
    "specific_stiffness": (r"\hat k", "1/s^2"),
    "specific_damping": (r"\hat\eta", "1/s"),
    "authority": (r"\hat N", "m^2/kg"),
    "natural_frequency": (r"\omega_n", "rad/s"),
    "damping_ratio": (r"\zeta", ""),
}
_STEP = "sampling_time"
Row = tuple[Any, ...]
HEADINGS = ("parameter", "symbol", "value", "unit", "section")


def parameter_rows(fault: Fault) -> list[Row]:
    """One row per parameter under `HEADINGS`: those of the fault file, half-widths of the box, and derived ones.

    Faults whose friction has a state have no disturbance rows; their disturbance is the stress of the guarantee.
    """
    messages = fault.friction.equilibrium.messages
    rows = [
        *_field_rows(fault, PLANT, "fault"),
        *_field_rows(fault.friction, fault.friction.quantities(), "friction"),
        *_field_rows(fault.reference, [name for name in TASK if name != _STEP], "task"),
        *_field_rows(fault, [_STEP], "task"),
        *_field_rows(fault.disturbance, () if "disturbance" in messages else DISTURBANCE, "disturbance"),
    ]
    rows += [
        _parameter_row(f"half-width of {name}", float(getattr(fault.box, name)), "", "uncertainty", "±")
        for name in WIDTHS
    ]
    rows += [
        _parameter_row(name, getattr(fault, name), unit, "derived", symbol) for name, (symbol, unit) in _DERIVED.items()
    ]
    return [row for row in rows if row[2] is not None]


def _field_rows(part: Any, names: Iterable[str], where: str) -> Iterator[Row]:
    """Rows of the fields of a dataclass with these names."""
    metadata = {each.name: each.metadata for each in fields(part)}
    for name in names:
        yield _parameter_row(name, getattr(part, name), metadata[name]["unit"], where, metadata[name].get("symbol"))


def _parameter_row(name: str, value: float | None, unit: str, where: str, symbol: str | None = None) -> Row:
    shown = Markup("") if symbol is None else Markup("±") if symbol == "±" else mathml(symbol, display="inline")
    return (name.replace("_", " "), shown, None if value is None else f"{value:.6g}", unit_html(unit) or "–", where)


# ----------------------------------------------------------------------
# Data to reproduce a report: date, versions, command, and numbers of the fault.

_PACKAGES = ("quakedesign", "sympy", "cvxpy", "clarabel", "casadi", "numpy", "scipy", "control", "python-flint")


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """Data to reproduce a report."""

    date: str  # UTC; from SOURCE_DATE_EPOCH if set, for pages that are reproducible bitwise
    command: str  # Command as typed; empty for a report that was not made by a command
    versions: Mapping[str, str]  # Of the package, libraries that affect numbers, Python; and the machine
    scenario: list[str]  # Lines of the fault as TOML


def versions() -> dict[str, str]:
    """Versions by package."""
    return {package: version(package) for package in _PACKAGES}


def reproduction(fault: Fault, command: str = "") -> Reproduction:
    """Reproduction data of a report of a fault, at this time."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(epoch), UTC) if epoch.isdecimal() else datetime.now(UTC)
    return Reproduction(
        date=f"{now:%Y-%m-%d %H:%M} UTC",
        command=command,
        versions=versions() | {"Python": platform.python_version(), "machine": platform.machine()},
        scenario=fault_toml(fault).splitlines(),
    )


# ----------------------------------------------------------------------
# Captions of the figures, which are also their text alternatives.

CAPTIONS = {
    "overview": "Slip rate and slip over logarithmic time, without control and with the controllers in the legend. "
    "Thick line: designed controller with the smallest proved bound on the slip rate. Horizontal lines: bounds for "
    "this controller.",
    "uncontrolled": "Natural earthquake without control: slip and slip rate. Dotted: slip at which the fault comes to "
    "rest according to statics.",
    "cycle": "Without control, loaded by the far end of the spring at the reference rate of the friction law: slip and "
    "slip rate. Dotted: the loading rate.",
    "slow-sliding": "Controlled fault in slow sliding. The stress is a sine with the amplitude that the guarantee "
    "allows. Slip and its reference, slip rate and its proved bound, fluid pressure in the fault, and friction state "
    "divided by its value in steady sliding.",
    "sliding-errors": "Slip error and slip-rate error in the run of slow sliding.",
    "states": "Closed loop: slip and its reference (top); range of the slip rate under each law (below). The scale of "
    "the rate is linear near the reference rate and logarithmic beyond. Dashed: peak of the natural earthquake.",
    "pressure": "Fluid pressure commanded by each law; at negative pressures fluid is withdrawn.",
    "errors": "Magnitudes of slip error and slip-rate error: largest of every 40 stored samples. Lower is better.",
    "metrics": "Largest errors, and root mean square and total variation of the pressure, after the first quarter of "
    "the run. Hatched: published gains.",
    "friction-law": "Friction coefficient against slip, and the line along which the spring unloads. Where friction "
    "falls faster than this line, the fault is unstable.",
    "earthquakes": "Natural earthquake and the one that a constant injection induces.",
    "friction-coefficient": "Friction coefficient in closed loop; dotted: its smallest and largest values.",
    "errors-and-power": "Errors and pressure divided by those of the e-LQR; values below 1 are better.",
    "peak-against-tracking": "Trade-off between peak and tracking: simulated errors against the guaranteed slip-rate "
    "error, one point per design.",
}


# ----------------------------------------------------------------------
# The report as one HTML page that contains its figures and equations and loads nothing.

MODEL_LIMITS = (
    "the model is one block: it does not describe the arrest of a rupture, rupture speed, heating, or seismicity "
    "around the fault",
    "a guarantee covers the friction laws, parameters and disturbances that it names; whether those of the real fault "
    "are among them must be decided from data",
    "the pressure in the runs is not limited and is uniform over the patch",
)
REST_LIMITS = (
    "a guarantee that begins 'on the plant without stick' is for friction continued linearly to negative slip rates; "
    "for the stick–slip plant the worst case found is then reported, which is no proof",
)
_WAYS = {"delay": "a delay of", "lag": "a lag of", "diffusion": "a diffusion path of L^2/D ="}
SLIDING_LIMITS = (
    "the fault slides at the rate of its task from the beginning, and the far end of its spring is fixed: neither run "
    "nor proof includes the transition from rest to sliding",
    "the stress disturbance of the run is a sine, which need not be the worst; its period is that of the largest tide, "
    "or a quarter of the duration of a short run; the worst case found is reported with the guarantee",
)


def table_html(comparison: "Compared") -> str:
    """Tables of a comparison as HTML."""
    return str(_environment().get_template("tables.html").render(**_tables(comparison)))


def page_html(comparison: "Compared", figures: Mapping[str, Markup], made: Reproduction) -> str:
    """Whole report as HTML; `figures` are its SVG elements by name."""
    every, first = accounts(comparison), summary(comparison)
    page: str = (
        _environment()
        .get_template("page.html")
        .render(
            fault=comparison.fault,
            natural=_natural(comparison),
            first=first,
            overview=_figure("overview", figures["overview"]) if "overview" in figures else None,
            facts=fault_sentences(comparison.fault),
            coordinates=comparison.fault.friction.equilibrium.coordinates,
            plant=[mathml(equation) for equation in plant_latex(comparison.fault)],
            **_tables(comparison),
            accounts=every,
            cards=_shared_accounts(every),
            schemes=scheme_sentence(comparison),
            limits=_limits(comparison, every),
            feedforward_columns=FEEDFORWARD_COLUMNS,
            glossary=[(mathml(s, display="inline") if s else "", *rest) for s, *rest in _terms(comparison.fault)],
            asked=[(name, ASKED[name]) for name in ASKED if any(name == row[0] for a in every for row in a.premises)],
            figures=[_figure(name, drawn) for name, drawn in figures.items() if name != "overview"],
            parameters=parameter_rows(comparison.fault),
            parameter_headings=HEADINGS,
            made=made,
            css=Markup(_text("page.css")),
            script=Markup(_text("page.js")),
        )
    )
    return page


def _figure(name: str, drawn: Markup) -> dict[str, str]:
    return {"name": name, "svg": drawn, "caption": CAPTIONS[name]}


def _natural(comparison: "Compared") -> str:
    """Natural behaviour of the fault without control."""
    fault, run = comparison.fault, comparison.uncontrolled
    if cycle := cycle_sentences(comparison):
        return cycle[0]
    size = (
        f" of magnitude {fault.magnitude:.2f}" if run.outcome.kind == "earthquake" and fault.seismic_moment > 0 else ""
    )
    rate = run.outcome.peak_slip_rate
    return f"Without control: {run.outcome.kind}{size}" + (
        "" if rate is None else f", slip rate up to {quantity(rate, 'm/s')}"
    )


def _limits(comparison: "Compared", every: list[Account]) -> list[str]:
    """Limits, each stated once with the controllers concerned, and limitations of the model."""
    about: dict[str, list[str]] = {}
    for account in every:
        for line in account.limits:
            about.setdefault(line, []).append(account.label)
    own = [f"{', '.join(labels)}: {line}" for line, labels in about.items()]
    shares = [
        f"{100 * e.run.metrics.reverse_slip_fraction:.3g} % ({e.label})"
        for e in comparison.entries
        if e.run and e.run.metrics.reverse_slip_fraction
    ]
    reverse = (
        [f"on the plant without stick, the slip rate is negative in part of the steps: {', '.join(shares)}"]
        if shares
        else []
    )
    return [*own, *reverse, *MODEL_LIMITS, *_of_runs(comparison.fault, comparison)]


_of_runs = by_equilibrium(
    rest=lambda fault, comparison: (*REST_LIMITS, _loop_stages(comparison)), sliding=lambda _, __: SLIDING_LIMITS
)


def _loop_stages(comparison: "Compared") -> str:
    """Actuator stages and diffusion path of the runs, in words."""
    paths = (e.design.setup.path.items() for e in comparison.of("designed"))
    stages = dict.fromkeys(f"{_WAYS[name]} {float(time):.4g} s" for path in paths for name, time in path if time)
    return f"the pressure in the runs acts {'through ' + ', '.join(stages) if stages else 'without delay'}"


def _tables(comparison: "Compared") -> Json:
    """Columns and rows of the summary and of the table of metrics."""
    first = (SUMMARY_COLUMNS, summary_cells(summary(comparison).rows))
    return {"summary": first, "numbers": (COLUMNS, rows(comparison))}


def _terms(fault: "Fault") -> list[list[str]]:
    """Symbol, meaning and unit of the terms in a report of the fault."""
    terms: dict[str, list[list[str]]] = tomllib.loads(_text("glossary.toml"))
    own = terms[fault.friction.equilibrium.name]
    return sorted(terms["every"] + own, key=lambda term: not term[0])  # symbols first


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def _environment() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    made = Environment(autoescape=True, undefined=StrictUndefined, finalize=_shown, loader=FunctionLoader(_text))
    made.filters["typeset"] = typeset
    return made


def _shown(value: Any) -> Any:
    """Text with its invisible characters made visible; markup of the page and other values are unchanged."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
