"""The report as one HTML page that holds its figures and equations and loads nothing."""

import tomllib
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from quakedesign.certificates.guarantee import NoGuarantee
from quakedesign.report.account import ASKED, Account, accounts
from quakedesign.report.captions import CAPTIONS
from quakedesign.report.grade import GRADES
from quakedesign.report.headlines import FEEDFORWARD_COLUMNS, scheme_sentence
from quakedesign.report.html_text import typeset
from quakedesign.report.mathml import mathml
from quakedesign.report.parameter_table import HEADINGS, parameter_rows
from quakedesign.report.reproduction import Reproduction
from quakedesign.report.state_runs import cycle_sentence, left_out_lines
from quakedesign.report.tables import COLUMNS, OUTCOMES, outcome_rows, rows
from quakedesign.studies.equations import coordinates, plant_latex
from quakedesign.studies.facts import fault_sentences
from quakedesign.studies.state_runs import StateRun
from quakedesign.text import visible

if TYPE_CHECKING:
    from quakedesign.fault import Fault
    from quakedesign.studies.comparison import Compared, Entry

MODEL_LIMITS = (
    "the model is a block with one degree of freedom: it says nothing of where an earthquake ends, of rupture speed, "
    "of heating, or of seismicity around the fault",
    "a guarantee is about what it names, such as every friction law, parameter and disturbance of a box; whether the "
    "fault is in it is a question of geology",
    "in these runs the pressure has no limit and is even over the patch",
)
REST_LIMITS = (
    "proofs are about a plant continued to negative slip rates; the worst found with stick is what a search found on "
    "one that stops and reverses",
)
_WAYS = {"delay": "a delay of", "lag": "a lag of", "diffusion": "rock of L^2/D ="}
SLIDING_LIMITS = (
    "the fault slides at the rate of its task from the start, and its far end rests: how it came to slide is not part "
    "of the run nor of the proof",
    "the stress disturbance of the run is a sine with the period of the largest tide, or a quarter of a short run, "
    "which need not be the worst; what a search found stands beside the guarantee",
)


def table_html(comparison: "Compared") -> str:
    """Tables of a comparison as HTML."""
    return str(_environment().get_template("tables.html").render(**_tables(comparison)))


def page_html(comparison: "Compared", figures: Mapping[str, Markup], made: Reproduction) -> str:
    """Whole report as HTML with its figures, SVG elements by name, inside."""
    told = accounts(comparison)
    page: str = (
        _environment()
        .get_template("page.html")
        .render(
            fault=comparison.fault,
            answer=answer(comparison),
            facts=fault_sentences(comparison.fault),
            coordinates=coordinates(comparison.fault),
            plant=[mathml(equation) for equation in plant_latex(comparison.fault)],
            **_tables(comparison),
            accounts=told,
            grades=GRADES,
            schemes=scheme_sentence(comparison),
            limits=_limits(comparison, told),
            known_columns=FEEDFORWARD_COLUMNS,
            glossary=[(mathml(s, display="inline") if s else "", *rest) for s, *rest in _terms(comparison.fault)],
            asked=[(name, ASKED[name]) for name in ASKED if any(name == row[0] for a in told for row in a.premises)],
            figures=[{"name": name, "svg": drawn, "caption": CAPTIONS[name]} for name, drawn in figures.items()],
            parameters=parameter_rows(comparison.fault),
            parameter_headings=HEADINGS,
            made=made,
            css=Markup(_text("page.css")),
            script=Markup(_text("page.js")),
        )
    )
    return page


def answer(comparison: "Compared") -> list[str]:
    """What a reader in a hurry wants: the earthquake, what is guaranteed against it, and of whom nothing is."""
    designed = comparison.of("designed")
    lines, proved, covers = [_natural(comparison)], {}, ""
    for entry in designed:
        if entry.guaranteed is not None:
            title = entry.design.title
            proved[title] = f"{entry.guaranteed.peak_slip_rate:.3g} m/s ({title})"
            covers = entry.guaranteed.covers
    others = ((e.design.title, e.design.other_step_first) for e in designed)
    faster = {title: said for title, said in others if said and title in proved}
    lines += [f"{title}: {said}" for title, said in faster.items()]
    if proved:
        lines.append(
            f"With a designed controller the slip rate never exceeds {', '.join(proved.values())}: proved, for the "
            f"loop as it runs, {covers}"
        )
    for why, titles in _without(e for e in designed if e.design.title not in proved).items():
        lines.append(f"No guarantee was found for the designed {', '.join(titles)}{f': {why}' if why else ''}")
    return [*lines, *left_out_lines(comparison)]


def _without(entries: Iterable["Entry"]) -> dict[str, list[str]]:
    """Titles of laws without a guarantee, by why there is none; no reason where nothing was asked."""
    found: dict[str, list[str]] = {}
    for entry in entries:
        why = entry.guarantee.reason if isinstance(entry.guarantee, NoGuarantee) else entry.design.details.get("reason")
        found.setdefault(str(why or ""), []).append(entry.design.title)
    return found


def _natural(comparison: "Compared") -> str:
    """What the fault does without control."""
    fault, run = comparison.fault, comparison.uncontrolled
    if isinstance(run, StateRun):
        return cycle_sentence(run)
    size = (
        f" of magnitude {fault.magnitude:.2f}" if run.outcome.kind == "earthquake" and fault.seismic_moment > 0 else ""
    )
    rate = run.outcome.peak_slip_rate
    return f"Without control: {run.outcome.kind}{size}" + ("" if rate is None else f", slip rate up to {rate:.3g} m/s")


def _limits(comparison: "Compared", told: list[Account]) -> list[str]:
    """What cannot be had, each said once with whom it is about, and what the model leaves out."""
    about: dict[str, list[str]] = {}
    for account in told:
        for line in account.limits:
            about.setdefault(line, []).append(account.label)
    own = [f"{', '.join(labels)}: {line}" for line, labels in about.items()]
    shares = [
        f"{100 * e.run.metrics.reverse_slip_fraction:.3g} % ({e.label})"
        for e in comparison.entries
        if e.run and e.run.metrics.reverse_slip_fraction
    ]
    reverse = (
        [f"the slip rate is negative, outside the model, in part of the steps: {', '.join(shares)}"] if shares else []
    )
    about_runs = SLIDING_LIMITS if comparison.fault.friction.state_names else (*REST_LIMITS, _way(comparison))
    return [*own, *reverse, *MODEL_LIMITS, *about_runs]


def _way(comparison: "Compared") -> str:
    """What the pressure of the runs goes through."""
    paths = (e.design.path.items() for e in comparison.of("designed"))
    told = dict.fromkeys(f"{_WAYS[name]} {float(time):.4g} s" for path in paths for name, time in path if time)
    return f"in these runs the pressure {'comes behind ' + ', '.join(told) if told else 'acts at once'}"


def _tables(comparison: "Compared") -> dict[str, Any]:
    """Columns and rows of both tables."""
    return {"outcomes": (OUTCOMES, outcome_rows(comparison)), "numbers": (COLUMNS, rows(comparison))}


def _terms(fault: "Fault") -> list[list[str]]:
    """Symbol, meaning and unit of what a report of the fault may speak of."""
    terms: dict[str, list[list[str]]] = tomllib.loads(_text("glossary.toml"))
    own = terms["state" if fault.friction.state_names else "stateless"]
    return sorted(terms["every"] + own, key=lambda term: not term[0])  # symbols first


def _text(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def _environment() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    made = Environment(autoescape=True, undefined=StrictUndefined, finalize=_shown, loader=FunctionLoader(_text))
    made.filters["typeset"] = typeset
    return made


def _shown(value: Any) -> Any:
    """Text of users as text; the page's own markup has none."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
