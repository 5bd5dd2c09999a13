"""Result folders, written whole or not at all."""

import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from quakedesign.errors import OutputError
from quakedesign.fault import fault_toml
from quakedesign.files import Json, require_writable, whole_folder, write_whole
from quakedesign.guarantees.exact.guarantee_files import guarantee_text
from quakedesign.lyapunov import certificate_text
from quakedesign.report.comparison_table import Comparison
from quakedesign.report.drawing import DEFAULT, cached_figures, figure_bytes, write_results
from quakedesign.report.page import CAPTIONS, page_html, reproduction, versions
from quakedesign.report.paper_figures import PAPER
from quakedesign.report.tables import csv_text
from quakedesign.studies.fault_facts import fault_dict
from quakedesign.studies.paper import printed, table
from quakedesign.text import Progress, silent

if TYPE_CHECKING:
    from quakedesign.report.paper_figures import PaperStudy


def prepare(out: Path, *, force: bool) -> None:
    """Raise `OutputError` if a folder is not writable or exists; with `force`, a folder of results may exist."""
    if os.path.exists(out) and not force:
        raise OutputError(
            f"output folder must be new. Received {out}, which exists. Give another --out, or --force to replace it."
        )
    if os.path.exists(out) and not (out / "results.json").is_file():
        raise OutputError(f"only a folder with results.json is replaced. Received {out}. Choose another --out.")
    require_writable(out)


def results(comparison: Comparison, *, stored: bool = True) -> Json:
    """JSON-serialisable facts of a comparison, with the keys of ``--json`` and the versions of all libraries.

    Parameters
    ----------
    stored : bool
        Whether the results name the certificate files; otherwise None replaces their names.
    """
    results = {"fault": fault_dict(comparison.fault), **comparison.to_dict()}
    for origin, group in (("designed", "controllers"), ("published", "published")) if stored else ():
        for entry in comparison.of(origin):
            entry_values = results[group][entry.design.name]
            if entry.design.certificate is not None:
                entry_values["certificate"] = f"certificates/{_file(origin, entry.design.name)}"
            if entry.proof is not None:
                path = f"certificates/{entry.design.name}-guarantee.json"
                entry_values["guarantee"]["certificate"] = path
                entry_values["certificate"] = entry_values["certificate"] or path
            for kind in entry.peaks:
                entry_values["peaks"][kind]["certificate"] = f"certificates/{entry.design.name}-peaks-{kind}.json"
    results["versions"] = versions()
    return results


def study_results(study: "PaperStudy", formats: Sequence[str] = DEFAULT) -> Json:
    """Results of a study: those of its comparison, and ``induced``, ``figures``, ``numbers`` and ``printed``."""
    induced = study.induced
    induced_values = induced and {
        "outcome": induced.outcome.to_dict(),
        "metrics": induced.metrics.to_dict(),
        "events": dict(induced.events),
        "run": dict(induced.provenance),
    }
    drawn = {name: {"file": f"figures/{name}.{formats[0]}", "paper": PAPER.get(name)} for name in study.figures()}
    compared = study.comparison
    return {
        **results(compared),
        "induced": induced_values,
        "figures": drawn,
        "numbers": table(compared, {"induced": induced} if induced else {}),
        "printed": printed(compared),
    }


def _file(origin: str, name: str) -> str:
    return f"{name}.json" if origin == "designed" else f"{origin}-{name}.json"


def write_folder(
    comparison: Comparison,
    out: Path,
    *,
    force: bool,
    study: "PaperStudy | None" = None,
    formats: Sequence[str] = DEFAULT,
    command: str = "",
    progress: Progress = silent,
) -> dict[str, Any]:
    """Write certificates, figures, results and the page into a folder, whole or not at all.

    Parameters
    ----------
    force : bool
        Replace a folder of earlier results.
    study : PaperStudy, optional
        Study of the same comparison; its figures replace those of the comparison, and ``numbers.csv`` is written.
    formats : sequence of str
        Formats of the figure files, see `quakedesign.report.drawing.FORMATS`.
    command : str
        Command that reproduces the report, as stated in it.
    progress : callable
        Called with the current activity and the fraction done [-].

    Returns
    -------
    dict
        Content of ``results.json``.
    """
    prepare(out, force=force)
    values = study_results(study, formats) if study else results(comparison)
    shown = study or comparison
    with whole_folder(out) as partial:
        _write_certificates(partial, comparison)
        inside = _write_figures(partial, shown, formats, progress)
        page = page_html(comparison, inside, reproduction(comparison.fault, command))
        (partial / "report.html").write_text(page, encoding="utf-8")
        (partial / "fault.toml").write_text(fault_toml(comparison.fault), encoding="utf-8")
        write_results(partial, values)
        if study:
            (partial / "numbers.csv").write_text(csv_text(values["numbers"]), encoding="utf-8")
    return values


def _write_certificates(folder: Path, comparison: Comparison) -> None:
    (folder / "certificates").mkdir()
    for entry in comparison.entries:
        if entry.design.certificate is not None:
            path = folder / "certificates" / _file(entry.origin, entry.design.name)
            path.write_text(certificate_text(entry.design.certificate), encoding="utf-8")
        proof = entry.proof
        if proof is not None:
            write_whole(folder / "certificates" / f"{entry.design.name}-guarantee.json", guarantee_text(proof))
        for kind, peaks in entry.peaks.items():
            path = folder / "certificates" / f"{entry.design.name}-peaks-{kind}.json"
            path.write_text(guarantee_text(peaks), encoding="utf-8")


def _write_figures(
    folder: Path, shown: "Comparison | PaperStudy", formats: Sequence[str], progress: Progress
) -> dict[str, Markup]:
    """Write every figure in every format; return the SVG elements for the page, drawn together with the SVG files."""
    (folder / "figures").mkdir()
    draw = cache(shown.figures)
    progress("figures", 0.0)
    inside = {}
    for name, (vector, inside[name]) in cached_figures(draw, CAPTIONS, shown).items():
        for kind in formats:
            data = vector if kind == "svg" else figure_bytes(draw()[name], kind, name)
            (folder / "figures" / f"{name}.{kind}").write_bytes(data)
    return inside
