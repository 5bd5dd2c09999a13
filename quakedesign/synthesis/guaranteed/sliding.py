"""What is guaranteed of a sliding mode as a scheme runs it, and why most schemes have nothing."""

from dataclasses import replace
from fractions import Fraction
from typing import Any, Unpack

from quakedesign.bounds import UpperBound
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, Task
from quakedesign.certificates.guarantee.held import Around
from quakedesign.controllers import SlidingMode
from quakedesign.errors import require_known
from quakedesign.loop.schemes import schemes
from quakedesign.synthesis.guaranteed.compensated import GUARANTEED, Compensation, compensated, design_compensated
from quakedesign.synthesis.guaranteed.slowly import tightened


def guarantee_of(task: Task, law: SlidingMode, **noise: Unpack[Around]) -> Guarantee | NoGuarantee:
    """What is guaranteed of a sliding mode as it runs: something only of one for the scheme ``compensated``."""
    own = law.sampling
    if own is None or own.scheme != GUARANTEED:
        scheme, step = ("continuous", Fraction(0)) if own is None else (own.scheme, own.step)
        return NoGuarantee(reason=_why_none(task, type(law), scheme, step), small_gain=None)
    settings = dict(own.settings)
    if not {"weight", "authority"} <= settings.keys():
        reason = f"the scheme {GUARANTEED} has a guarantee with a weight and an authority. Give both in its settings"
        return NoGuarantee(reason=reason, small_gain=None)
    around: Any = {**own.path, **noise}
    return tightened(compensated(task, law, settings["weight"], settings["authority"], own.step, **around))


def sliding_mode(
    task: Task,
    law: type[SlidingMode],
    step: Fraction,
    *,
    gains: tuple[str, ...] = (),
    scheme: str = GUARANTEED,
    objective: str = "tracking",
    **around: Unpack[Around],
) -> Compensation | NoGuarantee:
    """Design a sliding mode with given base gains, or the first ones known for it, in a scheme.

    Parameters
    ----------
    task : Task
    law : type
    step : Fraction
        T_s [s].
    gains : tuple of str
        Base gains (λ = 1); none for those that a design tries first.
    scheme : str
    objective : str
        ``tracking`` or ``peak``.
    **around : Fraction
        As in `design_held`.

    Raises
    ------
    ParameterError
        For an unknown scheme or objective, or a wrong number of gains.
    """
    require_known(scheme, sorted(schemes()), "scheme")
    base = law.from_values(gains) if gains else law.base_gains()[0].law
    if scheme != GUARANTEED:
        return NoGuarantee(reason=_why_none(task, law, scheme, step), small_gain=None)
    known = replace(base, gains=dict(base.gains), divisor=task.authority)
    made = design_compensated(task, known, step, objective=objective, **around)
    return replace(made, found=tightened(made.found))


def _why_none(task: Task, law: type[SlidingMode], scheme: str, step: Fraction) -> str:
    if scheme == "continuous":
        return f"a pressure that follows {law.title} at every instant is run by no sampled controller{_REMEDY}"
    if scheme == "implicit":
        rest = UpperBound(step**2 * task.authority * max(map(abs, task.rest_pressure)))
        return (
            "the implicit step knows no disturbance, so that a constant pressure p* holds it at e1 = T_s²·B0·p*, here "
            f"up to {rest:.2g} m{_REMEDY}"
        )
    return (
        f"at e1 = 0 the slope of {law.title} is infinite, so that its pressure held over T_s chatters, and no linear "
        f"loop with a range of slopes covers it{_REMEDY}"
    )


_REMEDY = f". Use the scheme {GUARANTEED}"
