"""What is guaranteed of a sliding mode as a scheme runs it, and why most schemes have nothing."""

from dataclasses import replace
from fractions import Fraction
from typing import Unpack

from quakedesign.bounds import UpperBound
from quakedesign.certificates.guarantee import Around, NoGuarantee, Task
from quakedesign.controllers import SlidingMode, family
from quakedesign.errors import ParameterError
from quakedesign.loop.schemes import schemes
from quakedesign.synthesis.guaranteed.compensated import Compensation, design_compensated

GUARANTEED = "compensated"


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
    if scheme not in schemes():
        raise ParameterError(f"scheme must be one of {', '.join(sorted(schemes()))}. Received {scheme!r}.")
    base = law.from_values(gains) if gains else family(law.name)[0].law
    if scheme != GUARANTEED or not isinstance(base, SlidingMode):
        return NoGuarantee(reason=_why_none(task, law, scheme, step), small_gain=None)
    known = replace(base, gains=dict(base.gains), divisor=task.authority)
    return design_compensated(task, known, step, objective=objective, **around)


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
