"""Plain-text output of scaled gains and of exported controllers."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.files import Json
from quakedesign.studies.scaling import SCALED

# ----------------------------------------------------------------------
# Scaled gains as lines of text.

_THREE_DIGITS = 0.005
_KEYS = {"scale_factors", "title", "from", "to", "source_gains", "gains", "published", "exponents", "unrounded"}


def scale_lines(result: Mapping[str, Any]) -> list[str]:
    """The result of `scale_answer` as lines of text."""
    if lacking := _KEYS - result.keys():
        raise ParameterError(f"result must be that of scale_answer. Received one without {', '.join(sorted(lacking))}.")
    factors = ", ".join(f"{SCALED[n][0]} = {_short(v)}" for n, v in result["scale_factors"].items())
    lines = [f"{result['title']}: {result['from']} → {result['to']}"]
    lines += _gain_lines(result["source_gains"], result["gains"], result["published"], result["exponents"])
    if "divisor" in result:
        same = result["divisor"] == result["source_divisor"]
        before = "" if same else f" (source: {_short(result['source_divisor'])})"
        lines.append(f"with λ = {_short(result['scale'])} and divisor μ0N̂0 = {_short(result['divisor'])} m²/kg{before}")
    if _rounded(result["published"]):
        lines.append("deviations from printed gains are due to their rounding for print (ERRATA 25)")
    if result["unrounded"]:
        more = result["unrounded"]
        lines.append("from the laboratory gains before they were rounded for print (ERRATA 25):")
        lines += _gain_lines(more["source_gains"], more["gains"], more["published"], result["exponents"])
    lines.append(f"scale factors: {factors}")
    return [*lines, *_similarity_lines(result)]


def _rounded(printed: Mapping[str, Any] | None) -> bool:
    """Whether printed gains differ, but by no more than rounding to three digits."""
    off = [abs(e["deviation"]) for e in (printed or {}).values() if not e["agrees"] and e["deviation"] is not None]
    return bool(off) and max(off) < _THREE_DIGITS


def _gain_lines(
    before: Mapping[str, str], after: Mapping[str, str], printed: Mapping[str, Any] | None, exponents: Mapping[str, str]
) -> list[str]:
    def comment(name: str) -> str:
        if not printed:
            return ""
        entry = printed[name]
        off = (
            ""
            if entry["agrees"] or entry["deviation"] is None
            else f", deviation {100 * abs(entry['deviation']):.2g} %"
        )
        return f"; printed {entry['printed']}{off}"

    return [f"  {n} = {_short(after[n])} from {_short(before[n])} ({exponents[n]}{comment(n)})" for n in after]


def _similarity_lines(result: Mapping[str, Any]) -> list[str]:
    percent = float(Fraction(result["tolerance"])) * 100
    far = [g for g in result["differing"] if g["group"] in result["violations"]]
    if result["similar"]:
        if not result["differing"]:
            return ["similar exactly: every π-group has the same value"]
        worst = max(abs(group["ratio"] - 1) for group in result["differing"])
        count = len(result["differing"])
        return [f"similar within {percent:g} %: {count} π-groups differ, by at most {100 * worst:.2g} %"]
    lines = [f"NOT similar within {percent:g} %: neither loop is a scaled copy of the other, as these π-groups differ:"]
    lines += [f"  {g['formula']}: {_short(g['source'])} and {_short(g['target'])}{_ratio(g)}" for g in far]
    return lines + [f"  {name} is not the same quantity in both faults" for name in result["unmatched"]]


def _ratio(group: Mapping[str, Any]) -> str:
    return "" if group["ratio"] is None else f", ratio {group['ratio']:.6g}"


def _short(text: str) -> str:
    return f"{float(Fraction(text)):.6g}"


def export_lines(result: Json) -> list[str]:
    """The result of `export_result` as lines of text."""
    measured = ", ".join(f"{name} [{unit}]" for name, unit in result["measurement"].items())
    lines = [
        *result["remarks"],
        f"written: {', '.join(result['files'])}",
        f"every {result['step']:g} s: inputs {measured}; output pressure [Pa]",
    ]
    lines += [f"  {name}: {value}" for name, value in result["facts"].items()]
    lines += [
        f"premise {p['name']} {'holds' if p['holds'] else 'FAILS'}: required {p['required']:.4g} {p['unit']}, "
        f"certified {p['certified']:.4g} {p['unit']}; {p['note']}"
        for p in result["premises"]
    ]
    return lines
