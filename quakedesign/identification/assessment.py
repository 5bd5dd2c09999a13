"""Assessment of a fit: tests of its assumptions, and the verdict whether it explains the record.

The reference noise is estimated without a friction law: from sample to sample, and about a straight line in the steady
beginning.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from quakedesign.files import Json
from quakedesign.identification.experiment import START_STATE, TREND, TREND_IN_TIME
from quakedesign.identification.fitting import Fit, weighted
from quakedesign.identification.loading import Loading
from quakedesign.identification.record import Record, scatter

SEVERAL = 2.0  # ratio of residuals to noise above which a fit does not explain a record
_PEAK = 10.0  # critical slips after a change of rate that count as its peak
_FADED = 5.0  # critical slips after which an unsteady beginning has decayed
_TREND_UNITS = {TREND: "1/m", TREND_IN_TIME: "1/s"}
_DRIFT = 4.0  # standard deviations by which a trend may change at the last change of rate
DECISIVE = 10.0  # difference of AIC (Akaike) above which the choice of a model is certain
EXPLAINS, EXPLAINS_NOT, CANNOT_TELL = "explains the record", "does not explain the record", "cannot tell"


@dataclass(frozen=True, kw_only=True)
class Check:
    """One test of an assumption."""

    name: str
    passed: bool
    value: float  # tested quantity [-]
    limit: float  # its limit
    sentence: str


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Tests of a fit, with the verdict on it."""

    checks: tuple[Check, ...]
    factor: float  # largest ratio of residuals to noise [-], of the whole record and of the parts after changes of rate
    open: tuple[str, ...] = ()  # sentences about quantities that the record does not determine
    experiments: tuple[str, ...] = ()  # experiments that would determine them

    @property
    def cautions(self) -> tuple[str, ...]:
        """Failed tests because of which intervals may be too narrow; empty if the fit does not explain the record."""
        failed = (check.sentence for check in self.checks if check.name == "halves" and not check.passed)
        return () if self.verdict == EXPLAINS_NOT else tuple(failed)

    @property
    def verdict(self) -> str:
        """`EXPLAINS`, `EXPLAINS_NOT` or `CANNOT_TELL`."""
        if self.factor > SEVERAL:
            return EXPLAINS_NOT
        return CANNOT_TELL if self.open else EXPLAINS

    def __str__(self) -> str:
        if self.verdict == EXPLAINS_NOT:
            return f"{self.verdict}: residuals are {self.factor:.2g} times the noise"
        return self.verdict

    def to_dict(self) -> Json:
        """JSON-able facts."""
        checks = [asdict(check) for check in self.checks]
        return {"verdict": self.verdict, "factor": self.factor, "checks": checks, "experiments": list(self.experiments)}


def checks_of(
    fit: Fit, raw: Record, record: Record, used: ndarray, loading: Loading | None, values: Mapping[str, float]
) -> tuple[tuple[Check, ...], float]:
    """Tests of beginning, residuals, peaks and halves of a record; and the largest ratio of residuals to noise.

    `raw` is the record as measured, `record` that of its means, of which `used` are in the fit; `values` in SI units.
    """
    time = record.time[used]
    begins = np.empty(0) if loading is None else loading.steps
    first = float(begins[0]) if len(begins) else float("inf")
    inside = (raw.time >= time[0]) & (raw.time <= time[-1])
    residuals = (raw.friction - np.interp(raw.time, time, fit.measured - fit.residuals))[inside]
    noise, origin = _noise(raw, first)
    whole = float(np.sqrt(np.mean(np.sort(residuals**2)[: max(int(0.995 * len(residuals)), 1)]))) / noise
    checks = [] if loading is None else [_beginning(values, loading)]
    checks.append(_within("residuals", whole, SEVERAL, f"residuals are {whole:.2g} times the noise {origin}"))
    factor = whole
    if len(begins):
        peak = _after_steps(fit, time, begins, record, used, values)
        factor = max(factor, peak)
        text = "is explained" if peak <= SEVERAL else "is not explained"
        sentence = f"friction after changes of rate {text}: residuals there are {peak:.2g} times the noise"
        checks.append(_within("peak", peak, SEVERAL, sentence))
        checks.append(_halves(fit, time, begins, record, used))
    return tuple(checks), factor


def in_doubt(excess: float, shift: float | None) -> bool:
    """Whether the sign test includes a fit with another trend: its AIC is close, or the selected trend may be late."""
    return excess < DECISIVE or shift is not None


def sign_check(
    difference: Any, others: Mapping[str, tuple[Any, float]], shift: float | None = None, unsteady: str = ""
) -> Check | None:
    """Whether a - b has one sign, with the selected trend and with others that are about as likely.

    `difference` is the estimate of a - b; `others` maps a description of fits with another trend or none to their a - b
    and the increase of their AIC; `shift` is the change of a - b if the trend begins with the first change of rate [-],
    None if it begins earlier; `unsteady` is the reason why the beginning does not determine steady sliding.
    """
    if difference is None:
        return None
    differences = [difference, *(other for other, _ in others.values())]
    low = min(each.low for each in differences) + min(shift or 0.0, 0.0)
    high = max(each.high for each in differences) + max(shift or 0.0, 0.0)
    passed = bool(low > 0 or high < 0) and not unsteady
    if passed:
        trends = "".join(f", also {what} (AIC {excess:+.3g})" for what, (_, excess) in others.items())
        sign = "negative: friction weakens with rate" if high < 0 else "positive: friction strengthens with rate"
        text = f"a - b is {sign}{trends}"
    else:
        late = ": the trend may begin with the change of rate, as slow evolution does"
        spans = {f" {what} (AIC {excess:+.3g})": other for what, (other, excess) in others.items()}
        spans = {" in the selected fit" if others else "": difference, **spans}
        between = ": " + ", ".join(f"from {each.low:.2g} to {each.high:.2g}{what}" for what, each in spans.items())
        text = f"the sign of a - b is open{unsteady or (late if shift is not None else between)}"
    return Check(name="sign", passed=passed, value=difference.value, limit=0.0, sentence=text)


def unsteady_beginning(difference: Any, values: Mapping[str, float], loading: Loading) -> str:
    """Reason why a fitted initial deviation from steady sliding masks the sign of a - b; empty if it does not.

    It masks the sign, like a drift, if its effect on friction exceeds that of the rate step and has not decayed before
    this step.
    """
    step, slip = loading.first_step, values.get("critical_slip", 0.0)
    moved = abs(values.get("evolution_effect", 0.0) * values.get(START_STATE, 0.0))
    if difference is None or step is None or loading.before >= _FADED * slip or moved <= abs(difference.value * step):
        return ""
    before = f"{loading.before / slip:.2g} critical slips"
    return f": the beginning, of {before}, deviates from steady sliding by {moved:.2g} in friction"


def _within(name: str, value: float, limit: float, sentence: str) -> Check:
    return Check(name=name, passed=value <= limit, value=value, limit=limit, sentence=sentence)


def _noise(raw: Record, first: float) -> tuple[float, str]:
    """Noise of friction: from sample to sample, and about a line before the first change of rate."""
    least = max(scatter(raw.time, raw.friction), 1e-12)
    before = raw.time < first
    if np.isinf(first) or before.sum() < 20:
        return least, "from sample to sample"
    t, y = raw.time[before], raw.friction[before]
    about = y - np.polyval(np.polyfit(t - t[0], y, 1), t - t[0])
    line = float(np.sqrt(np.mean(about**2)))
    return max(line, least), f"about a line in the beginning ({line / least:.2g} times that from sample to sample)"


def _beginning(values: Mapping[str, float], loading: Loading) -> Check:
    off = abs(values.get(START_STATE, 0.0))
    text = f"begins in steady sliding at {loading.first_rate:.3g} m/s"
    if off:
        older = float(np.exp(values[START_STATE]))
        text = f"does not begin in steady sliding: its state is {older:.3g} times that of steady sliding (fitted)"
    text += "".join(f", on a trend of {values[n]:.3g} {u}" for n, u in _TREND_UNITS.items() if n in values)
    return _within("beginning", off, 0.0, f"the record {text}")


def _after_steps(
    fit: Fit, time: ndarray, begins: ndarray, record: Record, used: ndarray, values: Mapping[str, float]
) -> float:
    """Largest ratio of the RMS residual within some critical slips after a change of rate to the noise."""
    assert record.load_point is not None
    path, scores = record.load_point[used], fit.whitened / fit.noise
    way = float(np.ptp(path))
    within = min(max(_PEAK * values.get("critical_slip", 0.0), 0.01 * way), 0.2 * way)
    after = [(time >= begin) & (path - np.interp(begin, time, path) <= within) for begin in begins.tolist()]
    several = [some for each in after if len(some := scores[each[fit.used]]) >= 5]
    return max((float(np.sqrt(np.mean(some**2))) for some in several), default=0.0)


def _halves(fit: Fit, time: ndarray, begins: ndarray, record: Record, used: ndarray) -> Check:
    """Whether the trend is equal before and after the last change of rate, and the noise equal in both halves."""
    assert record.load_point is not None
    path = record.load_point[used]
    hinge = np.maximum(path - np.interp(begins[-1], time, path), 0)
    extra = weighted(fit.weights, hinge)
    across = extra - fit.slopes @ np.linalg.lstsq(fit.slopes, extra, rcond=None)[0]
    size = float(np.linalg.norm(across))
    score = 0.0 if size <= 1e-6 * np.linalg.norm(extra) else float(across @ fit.whitened) / size / fit.noise
    early, late = (float(np.mean(part**2)) for part in np.array_split(fit.whitened, 2))
    ratio = float(np.sqrt(max(late / max(early, 1e-300), early / max(late, 1e-300))))
    value, narrow = max(abs(score) / _DRIFT, ratio / SEVERAL), "so the intervals may be too narrow"
    change, factor = f"{abs(score):.2g} standard deviations", f"early and late residuals differ by a factor {ratio:.2g}"
    if abs(score) > _DRIFT:
        other = ", or use --steps auto" if len(begins) > 1 else ""
        text = f"the trend changes at the last step ({change}): the drift is not linear, {narrow}. Cut with --to{other}"
    elif value > 1:
        text = f"{factor}, {narrow}"
    else:
        text = f"the trend does not change at the last step (within {change}), and {factor}"
    return _within("halves", value, 1.0, text)
