"""Verify certificate files of the kind ``guarantee`` (FORMAT.md) with the Python standard library alone.

From a fault's data, a controller's matrices and the order of events in a period to bounds on slip, slip rate and
pressure for all t. Nothing is searched for: ranges follow from rational inequalities, and the bounds from upper sums of
impulse responses in integers, multiples of 2^-BITS, each with a bound of its error. `check.py` calls `verify`.
"""

from fractions import Fraction
from typing import Any

from .bounds import bounds, read_slow
from .invariant_set import bounds_within, read_reach
from .loop import read_loop
from .reading import Row, entries, keys, lower, need, numbers, upper
from .root import root_within
from .task import Task, read_task

CLAIMS = ("slip_error", "slip_rate_error", "peak_slip_rate", "least_pressure", "largest_pressure")
ASKED = ("least_asked", "largest_asked")  # at the valve
STEP = "largest_step"  # of the commanded pressure


def verify(document: dict[str, Any]) -> list[str]:
    """Verify the claims of a parsed file; the statement, line by line.

    Raises
    ------
    Refused
        When a rule is broken, or a claim does not follow.
    """
    more = [name for name in ("slow_gain", "start", "reach") if name in document]
    keys(document, "the file", "format", "kind", "fault", "reference", "disturbance", "loop", "claims", *more)
    given = document["claims"] if type(document["claims"]) is dict else {}
    asked = ASKED if any(name in given for name in ASKED) else ()
    claims = numbers(document["claims"], "claims", *CLAIMS, *asked, *([STEP] if STEP in given else []))
    task = read_task(document)
    start = read_start(document["start"]) if "start" in more else [Fraction(0)] * 2
    loop = read_loop(document["loop"], task, start)
    moved = [loop.off * v for v in (task.reference_rate, task.reference_acceleration)]
    errors = [claims[name] + off + way for name, off, way in zip(CLAIMS[:2], loop.noise, moved, strict=True)]
    need(loop.asked or not asked, "claims on the valve pressure need a lag or a diffusion path")
    need(
        not (loop.pump and loop.asked) or bool(asked),
        "a pump before a lag or diffusion path needs claims on its pressure",
    )
    need(
        loop.stepped or STEP not in claims,
        "largest_step may be claimed only with jitter or a pump rate",
    )
    need("rate" not in loop.pump or STEP in claims, "a pump rate needs the claim largest_step")
    within = loop.root is None or root_within(loop.root, loop.step, *errors)
    need(within, "the root of the implicit step must lie between its lines for all claimed errors")
    slow = read_slow(document["slow_gain"], task, loop) if "slow_gain" in more else None
    need(("reach" in more) == (loop.longest > 0), "reach must be given for aperiodic sampling, and for that alone")
    need(not (slow and loop.longest), "aperiodic sampling must have no slow_gain")
    if loop.longest:
        (slip, rate, *pushes), small = bounds_within(task, loop, read_reach(document["reach"], loop))
    else:
        (slip, rate, *pushes), small = bounds(task, loop, slow, claims["slip_error"])
    need(not slow or slip < claims["slip_error"], "with slow_gain the slip error must stay below its claim")
    steps = [pushes.pop() / task.b] if loop.stepped else []
    ends = [end for push in pushes for end in (task.rest[0] - push / task.b, task.rest[1] + push / task.b)]
    found = dict(zip([*CLAIMS, *ASKED], (slip, rate, rate + task.reference_rate, *ends), strict=False))
    found |= dict(zip([STEP], steps, strict=False))
    for name in claims:
        value = found[name]
        holds = value >= claims[name] if name.startswith("least") else value <= claims[name]
        need(holds, f"the claim {name} must follow from the rest. It does not")
    need(found["largest_pressure"] < task.normal_stress, "the pressure must not open the fault")
    least, largest = ASKED if asked else CLAIMS[3:]
    pump = loop.pump
    need(
        "least" not in pump or (pump["least"] <= claims[least] and claims[largest] <= pump["largest"]),
        "the claimed valve pressure must stay within the limits of the pump",
    )
    need(
        "rate" not in pump or claims[STEP] <= pump["rate"] * pump["ramp"],
        "the claimed largest step must fit into the ramp of the pump",
    )
    return [*statement(document, task, claims, small), *entries(document)]


def read_start(value: Any) -> Row:
    """Bounds on initial slip and slip rate."""
    found = [*numbers(value, "start", "slip", "rate").values()]
    need(min(found) >= 0 and any(found), "bounds of the start must be >= 0, and not both 0")
    return found


def statement(document: dict[str, Any], task: Task, claims: dict[str, Fraction], small: Fraction) -> list[str]:
    """What was verified, in ASCII; bounds are rounded outward, those of the disturbance inward."""
    loop = document["loop"]
    when = "in continuous time (pressure without sampling or delay), which excludes sampled controllers"
    if "step" in loop:
        often = f"every {loop['step']} s"
        often += f" to {loop['longest']} s in any order" if "longest" in loop else ""
        when = f"{often}, {loop['delay']} s late, lag {loop['lag']} s"
        when += f", diffusion path of distance^2/diffusivity = {loop['diffusion']} s" if "diffusion" in loop else ""
    kind = f"any acceleration of at most {lower(task.amplitude)} m/s^2" if task.amplitude else "none (amplitude 0)"
    if task.change is not None and task.amplitude:
        kind += f" that starts at 0 and changes by at most {lower(task.change)} m/s^3"
    implicit = " and an implicit step" if "root" in loop else ""
    alone = "root" not in loop and not any(line[1] != "0" for line in (*loop["measured"], loop["feedback"]))
    told = ", slip alone measured" if alone else ""
    off = ""
    if "noise" in loop:
        rate = "" if alone else f", slip rate within {loop['noise']['rate']} m/s"
        off = f", measured slip within {loop['noise']['slip']} m of the true one{rate}"
    if "jitter" in loop:
        measured, late = (loop["jitter"][name] for name in ("measured", "delay"))
        off += f", each averaged over {loop['jitter']['mean']} s around its instant" if "mean" in loop["jitter"] else ""
        off += f", measurements within {measured} s of their instants, pressures within that plus {late} s"
    if "pump" in loop:
        parts = [f"from {loop['pump']['least']} Pa to {loop['pump']['largest']} Pa"] if "least" in loop["pump"] else []
        parts += [f"of {loop['pump']['rate']} Pa/s"] if "rate" in loop["pump"] else []
        off += f", a pump {' and '.join(parts)} whose limits are never reached"
    where = "from rest"
    if "start" in document:
        slip, rate = (lower(Fraction(document["start"][name])) for name in ("slip", "rate"))
        where = f"from initial |slip| <= {slip} m, |slip rate| <= {rate} m/s"
    return [
        f'fault "{ascii(task.name)[1:-1]}" (a label; the data of the file define it), friction any function of '
        + ("the slip alone" if task.steady_beta else "slip and slip rate")
        + " within its bounds and slopes, linearly continued to negative slip rates, parameters constant",
        f"derived accelerations: per slip error [{lower(task.s[0])}, {upper(task.s[1])}] 1/s^2, per slip-rate error "
        f"minus [{lower(task.w[0])}, {upper(task.w[1])}] 1/s, per pressure {upper(task.b)} m^2/kg times "
        f"[1, {upper(task.beta[1])}]",
        f"law with {len(loop['states'])} states{implicit}{told}, {when}{off}",
        f"disturbance: {kind}; {where}, along the reference, for all t >= 0; small gain {upper(small)}",
        f"the slip rate of this fault never exceeds {upper(claims['peak_slip_rate'])} m/s",
        f"|slip - reference| <= {upper(claims['slip_error'])} m, "
        f"|slip rate - reference's| <= {upper(claims['slip_rate_error'])} m/s",
        f"pressure from {lower(claims['least_pressure'])} Pa to {upper(claims['largest_pressure'])} Pa"
        + (
            f", at the valve from {lower(claims[ASKED[0]])} Pa to {upper(claims[ASKED[1]])} Pa"
            if ASKED[0] in claims
            else ""
        )
        + (f", changes of at most {upper(claims[STEP])} Pa per sample" if STEP in claims else ""),
    ]
