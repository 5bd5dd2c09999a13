"""The report as one HTML page beside its figures."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from quakedesign.report.grade import GRADES
from quakedesign.report.headlines import (
    FEEDFORWARD_COLUMNS,
    domain_sentence,
    feedforward_rows,
    guarantee_lines,
    headline,
    scheme_sentence,
)
from quakedesign.report.tables import COLUMNS, OUTCOMES, outcome_rows, rows
from quakedesign.text import visible

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Compared

_TABLE = """<table><thead><tr>{% for c in columns %}<th>{{ c }}</th>{% endfor %}</tr></thead><tbody>
{% for row in rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table>"""

_TABLES = f"""<div class="outcomes">{{% set columns, rows = outcomes %}}{_TABLE}</div>
{{% set columns, rows = numbers %}}{_TABLE}"""

_PAGE = (
    """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>quakedesign: {{ fault.name }}</title><style>
body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0;font-size:.85rem}
th,td{border-bottom:1px solid #ccc;padding:.3rem .6rem;text-align:right}
th:first-child,td:first-child,.outcomes :is(th,td):is(:nth-child(2),:last-child){text-align:left}
img{max-width:100%}code{background:#f3f3f3;padding:0 .2rem}</style></head><body>
<h1>{{ fault.name }}</h1><p>{{ fault.source }}. Uncertainty box: {{ fault.box.name }}.</p>
<h2>The fault</h2><ul>{% for line in facts %}<li>{{ line }}</li>{% endfor %}</ul>
<h2>Comparison</h2>"""
    + _TABLES
    + """<p>{{ grades }}. Errors count after a quarter of the task; p &lt; 0 is withdrawal. {{ schemes }}.</p>
<h2>What is proved, and under which premises</h2>
{% for e in entries %}<h3>{{ e.label }}</h3>
{% for line in guaranteed(e) %}<p>{{ line }}.</p>{% endfor %}<p>{{ headline(e) }}.</p>
<p>Gains: {% for n, v in e.design.gains.items() %}<code>{{ n }} = {{ number(v) }}</code> {% endfor %}</p>
<table><thead><tr><th>premise</th><th>note</th><th>required</th><th>certified</th><th>ratio</th>
<th>holds</th></tr></thead>
<tbody>{% for p in e.design.premises %}<tr><td>{{ p.name }}</td>
<td>{{ "" if p in e.design.conditions else "certificate in continuous time: " }}{{ p.note }}</td>
<td>{{ p.sides[0] }}</td><td>{{ p.sides[1] }}</td>
<td>{{ "–" if p.ratio is none else "{:.3g}".format(p.ratio) }}</td><td>{{ "yes" if p.holds else "no" }}</td></tr>
{% endfor %}</tbody></table>
{% if e.design.domain %}<p>{{ domain(e.design.domain) }}.</p>{% endif %}
{% if e.variants %}<p>The same gains with what is known of the fault added to the control (ratios of the premises):</p>
<table><thead><tr>{% for c in known_columns %}<th>{{ c }}</th>{% endfor %}</tr></thead><tbody>
{% for row in known_rows(e.variants) %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table>{% endif %}{% endfor %}
<h2>Figures</h2>{% for name in figures %}<p><img src="figures/{{ name }}.png" alt="{{ name }}"></p>{% endfor %}
<p>Certificates: <code>certificates/*.json</code>; re-check with <code>quakedesign check</code>.</p></body></html>
"""
)


def _environment() -> Any:
    from jinja2 import Environment, StrictUndefined

    return Environment(autoescape=True, undefined=StrictUndefined, finalize=_shown)


def _shown(value: Any) -> Any:
    """Text of users as text; the page's own markup has none."""
    return visible(value) if isinstance(value, str) else value


def table_html(comparison: "Compared") -> str:
    """Tables of a comparison as HTML."""
    return str(_environment().from_string(_TABLES).render(**_tables(comparison)))


def _tables(comparison: "Compared") -> dict[str, Any]:
    """Columns and rows of both tables."""
    return {"outcomes": (OUTCOMES, outcome_rows(comparison)), "numbers": (COLUMNS, rows(comparison))}


def page_html(comparison: "Compared", facts: Iterable[str], figures: Iterable[str]) -> str:
    """Whole report as HTML; figures are expected at ``figures/NAME.png``."""
    page: str = (
        _environment()
        .from_string(_PAGE)
        .render(
            fault=comparison.fault,
            facts=list(facts),
            **_tables(comparison),
            entries=comparison.entries,
            headline=headline,
            guaranteed=guarantee_lines,
            domain=domain_sentence,
            known_columns=FEEDFORWARD_COLUMNS,
            known_rows=feedforward_rows,
            grades=GRADES,
            schemes=scheme_sentence(comparison),
            number=lambda v: f"{float(v):.6g}",
            figures=list(figures),
        )
    )
    return page
