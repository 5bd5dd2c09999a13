"""What the page tells of every controller: guarantee, run, limits, proof, each in sentences and rows."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from quakedesign.certificates import Verdict
from quakedesign.certificates.slow_sliding import SlidingGuarantee
from quakedesign.report.grade import grade
from quakedesign.report.headlines import (
    beside_guarantee,
    domain_sentence,
    feedforward_rows,
    guarantee_lines,
    limit_lines,
    sentences,
)
from quakedesign.report.html_text import unit_html
from quakedesign.report.mathml import mathml
from quakedesign.report.outcomes import run_sentences
from quakedesign.studies.equations import law_latex

if TYPE_CHECKING:
    from quakedesign.certificates.premise import Premise
    from quakedesign.controllers import Controller
    from quakedesign.studies.comparison import Compared, Entry

ASKED = {
    "sampling_time": "the pressure is renewed at least this often",
    "delay": "no more time passes from the measurement to the pressure",
    "control_coefficient": "the input gain β stays in the certified range",
    "friction_slope": "friction changes with slip no faster than certified",
    "along_reference": "reference and disturbance alone change h no faster than the law withstands",
    "level_set": "a start at rest lies in the certified region, at every phase of the disturbance",
    "on_trajectory": "h changes in the run that is shown no faster than the law withstands",
    "constant_reference": "the reference stands still",
    "vanishing_disturbance": "the disturbance vanishes at the equilibrium",
    "pressure_at_rest": "the pressure that the task needs lies inside the limits of the law",
    "differentiator": "the slip rate is estimated by a differentiator that is fast enough",
}
"""What every premise asks, in words; those of users' laws by their own notes."""


@dataclass(frozen=True, kw_only=True)
class Account:
    """What is told of one controller.

    Attributes
    ----------
    label, badge : str
    good : bool
        Whether the loop that ran has a guarantee, or its proof covers it.
    guarantee, run, limits, verdict, proof : list of str
        Sentences without a full stop.
    law : list of Markup
        Equations with the numbers of the design.
    gains : list of (str, str, Markup)
        Name, value, unit.
    premises, base_premises, known : list of tuple
        Rows of their tables: premises of what is proved first, of the certificate of base gains in continuous time, and
        what is certified with a feed-forward.
    """

    label: str
    badge: str
    good: bool
    guarantee: list[str]
    run: list[str]
    limits: list[str]
    verdict: list[str]
    proof: list[str]
    law: list[Markup]
    gains: list[tuple[str, str, Markup]]
    premises: list[tuple[str, ...]]
    base_premises: list[tuple[str, ...]]
    known: list[tuple[str, ...]]


def accounts(comparison: "Compared") -> list[Account]:
    """Of all controllers, designed ones first."""
    return [_account(entry) for origin in ("designed", "published") for entry in comparison.of(origin)]


def _account(entry: "Entry") -> Account:
    design = entry.design
    run = run_sentences(entry.run, design.fault) if entry.run else []
    said, limits = guarantee_lines(entry), limit_lines(entry)
    compensated = [entry.answer.compensation.sentence()] if entry.answer and entry.answer.compensation else []
    domain = [domain_sentence(design.domain)] if design.domain else []
    return Account(
        label=entry.label,
        badge=badge(entry),
        good=entry.guaranteed is not None or grade(entry) == "proved for this loop and task",
        guarantee=[line for line in said if line not in (*limits, *compensated)],
        run=run,
        limits=limits,
        verdict=beside_guarantee([sentence for sentence in sentences(entry) if sentence not in run], entry),
        proof=[*compensated, *_stepping(design.controller), *_slowly(entry), *domain],
        law=[mathml(equation) for equation in law_latex(design.controller)],
        gains=_gains(entry),
        premises=[_row(p) for p in design.conditions],
        base_premises=[_row(p) for p in design.premises if p not in design.conditions],
        known=feedforward_rows(entry.variants) if entry.variants else [],
    )


def _stepping(law: "Controller | None") -> list[str]:
    """How a law of samples runs; nothing for a law in continuous time."""
    sampling = law.sampling if law else None
    return [f"it runs in the scheme {sampling.scheme}, once every {float(sampling.step):g} s"] if sampling else []


def _slowly(entry: "Entry") -> list[str]:
    """How a guarantee of slow sliding is found; nothing for others."""
    found = entry.guaranteed
    if not isinstance(found, SlidingGuarantee):
        return []
    cells = "one cell" if len(found.cells) == 1 else f"{len(found.cells)} cells"
    return [
        "the pressure at the well is p beside what the nominal fault needs along its reference, kV/(μ*A) more a second",
        "about slow sliding at V, with v = V e^y and θ = (D_c/V) e^z, the loop is linear but for the exponentials, "
        "which stand in sectors on |y| ≤ Y, for inertia, whose fast mode is bounded, and for modes of the rock that "
        "the loop leaves out, bounded too; peaks of the responses of the linear loop bound all errors, and claims that "
        f"follow from themselves hold {found.lasts}; the box of constants falls into {cells}",
    ]


def badge(entry: "Entry") -> str:
    """Verdict in two or three words."""
    if entry.guaranteed is not None:
        step = entry.design.fault.sampling_time
        return f"not guaranteed at T_s = {step:g} s" if entry.design.other_step else "guaranteed as it runs"
    found = entry.design.verdict
    return "proved in continuous time only" if found is Verdict.PROVED else str(found)


def _row(premise: "Premise") -> tuple[str, ...]:
    ratio = "–" if premise.ratio is None else f"{premise.ratio:.3g}"
    return (premise.name, *premise.sides, ratio, "yes" if premise.holds else "no", premise.note)


_OTHER_UNITS = {"scale": "", "weight": "", "divisor": "m^2/kg", "authority": "m^2/kg"}
_OTHER_UNITS |= {"rest_width": "Pa", "rest_per_slip": "Pa/m", "rest_resolution": "m"}
_OTHER_UNITS |= {"rest_least": "Pa", "rest_largest": "Pa", "rest_fastest": "m"}


def _gains(entry: "Entry") -> list[tuple[str, str, Markup]]:
    units: dict[str, Any] = _OTHER_UNITS | (dict(entry.design.controller.gain_units) if entry.design.controller else {})
    return [(n, f"{float(v):.6g}", unit_html(units.get(n, ""))) for n, v in entry.design.gains.items()]
