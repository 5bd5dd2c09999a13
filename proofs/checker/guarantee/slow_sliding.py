"""Verify certificate files of the kind ``slow_sliding`` (FORMAT.md) with the Python standard library alone.

From a fault with rate-and-state friction, ranges of its constants, and a controller's matrices to a bound on the slip
rate. The pressure's path, the impulse responses and the small gain are those of the kind ``guarantee``. Symbols are
those of FORMAT.md: y and z are the logarithms of slip rate and state, x is the slip error, q = p - p*.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import accumulate
from typing import Any

from .bounds import peaks_of
from .gains import gains
from .loop import Loop, read_loop
from .matrices import unit
from .reading import Row, entries, exact, inside, keys, lower, need, number, numbers, row, upper
from .task import FAULT, Task

MAX_CELLS = 64
MAX_LOGARITHM = 3
TERMS = 24
FADED = Fraction(1, 16)
ROCK = ("density", "shear_modulus", "length", "damping")
CONSTANTS = ("direct_effect", "evolution_effect", "critical_slip", "coefficient", "normal_stress")
PATH = ("step", "delay", "lag", "diffusion", "slip_noise")
LAW = ("states", "update", "measured", "output", "feedback")
REFERENCE = ("rate", "distance", "ramp")
CLAIMS = ("log_rate", "log_state", "slip_error", "push", "asked")

Range = tuple[Fraction, Fraction]


@dataclass
class Fault:
    """Elastic constants, reference and disturbance in SI units; one box of constants at a time."""

    name: str
    inertia: Fraction
    stiffness: Fraction
    radiation: Fraction
    rate: Fraction
    distance: Fraction
    ramp: Fraction
    swing: Fraction
    stress: Fraction
    box: dict[str, Range]
    slips: bool
    regularised: bool

    def load(self) -> Fraction:
        """Rate at which sliding at the first rate releases shear stress."""
        return self.stiffness * self.rate

    def drift(self) -> Fraction:
        """Bound of the rate of change of p* minus that of the planned pressure, `ramp`."""
        return (1 + self.swing) * max(abs(self.load() / mu - self.ramp) for mu in self.box["coefficient"])

    def normal(self, push: Fraction) -> Range:
        """Range of the effective normal stress for pressures within `push` of p*."""
        low, high = self.box["normal_stress"]
        return low - self.stiffness * self.distance / self.box["coefficient"][0] - push, high + push


@dataclass
class Path:
    """Path of the pressure to the fault, and noise of the measurement."""

    lag: Fraction
    diffusion: Fraction
    noise: Fraction


# ---------------------------------------------------------------- reading


def read_fault(document: dict[str, Any]) -> Fault:
    """Read fault, reference and stress."""
    raw = document["fault"]
    more = [name for name in ("state_law", "regularised") if type(raw) is dict and name in raw]
    given = keys(raw, "fault", "name", *ROCK, *CONSTANTS, *more)
    need(given.get("state_law", "slip") == "slip", "state_law must be slip if given")
    need(given.get("regularised", True) is True, "regularised must be true if given")
    named = type(given["name"]) is str and FAULT.fullmatch(given["name"]) is not None
    need(named, "fault.name must be at most 60 letters, digits, spaces and _ . -")
    rho, modulus, size, eta = (number(given[name], name) for name in ROCK)
    box = {}
    for name in CONSTANTS:
        low, high = row(given[name], name, 2)
        need(0 < low <= high, f"{name} must be two ends in order, above 0")
        box[name] = low, high
    swings = ["swing"] if type(document["reference"]) is dict and "swing" in document["reference"] else []
    rate, distance, ramp, *swing = numbers(document["reference"], "reference", *REFERENCE, *swings).values()
    need(all(0 < v < 1 for v in swing), "swing must be above 0 and below 1 if given")
    stress = number(document["stress"], "stress")
    need(min(rho, modulus, size, rate) > 0, "density, modulus, length and rate must be > 0")
    need(min(eta, distance, ramp, stress) >= 0, "damping, distance, ramp and stress must be >= 0")
    kind = "state_law" in more, "regularised" in more
    plan = rate, distance, ramp, sum(swing, Fraction(0)), stress
    return Fault(given["name"], rho * size, modulus / size, eta / size**2, *plan, box, *kind)


def read_cells(value: Any, box: dict[str, Range]) -> list[dict[str, Range]]:
    """Cells of the box. After a cut come the entries of its lower part, then those of its upper; [] is a cell."""
    need(type(value) is list and len(value) < 2 * MAX_CELLS, f"there must be 1 to {MAX_CELLS} cells")
    open_boxes, cells = [box], []
    for entry in value:
        need(bool(open_boxes), "cells must have no entry after the last part")
        part = open_boxes.pop()
        if entry == []:
            cells.append(part)
            continue
        need(type(entry) is list and len(entry) == 2, "a cut must be a constant and a number")
        name, at = entry[0], number(entry[1], "a cut")
        need(name in CONSTANTS, f"a cut must be across one of {', '.join(CONSTANTS)}")
        low, high = part[name]
        need(low < at < high, "a cut must lie inside its box")
        open_boxes += [part | {name: (at, high)}, part | {name: (low, at)}]
    need(not open_boxes, "cells must have an entry for every part")
    return cells


def read_path(value: Any) -> tuple[Loop, Path]:
    """The loop of a guarantee with the pressure's path alone."""
    given = keys(value, "loop", *PATH, *LAW)
    path = Path(*(number(given[name], name) for name in ("lag", "diffusion", "slip_noise")))
    need(path.lag > 0 or path.diffusion > 0, "the pressure must reach the fault through a lag or a diffusion path")
    measured = given["measured"]
    need(type(measured) is list, "measured must be a list")
    plain = {name: given[name] for name in ("step", "delay", "lag", "states", "update", "output")}
    plain |= {"measured": [[v, "0"] for v in measured], "feedback": [given["feedback"], "0"]}
    plain |= {"diffusion": given["diffusion"]} if path.diffusion else {}
    plain |= {"noise": {"slip": given["slip_noise"], "rate": "0"}}
    still, zero = (Fraction(0), Fraction(0)), Fraction(0)
    one = Fraction(1)
    ranges, moves = (still, still, (one, one), one, still), (zero, zero, zero, True, zero, zero, zero, None)
    nothing = Task("", one, *ranges, *moves, zero, True)
    return read_loop(plain, nothing), path


# ---------------------------------------------------------------- exponentials and sectors


def partial(size: Fraction) -> Fraction:
    """e^x from below, x >= 0."""
    total = term = Fraction(1)
    for k in range(1, TERMS):
        term = term * size / k
        total += term
    return total


def power_of_e(size: Fraction) -> Fraction:
    """e^x from above, 0 <= x <= 3: omitted terms are below a geometric series."""
    term = Fraction(1)
    for k in range(1, TERMS + 1):
        term = term * size / k
    return partial(size) + term / (1 - size / (TERMS + 1))


def sector(size: Fraction) -> Range:
    """Slopes of e^y - 1, and of 1 - e^-y, for |y| <= size."""
    return (1 - 1 / partial(size)) / size, (power_of_e(size) - 1) / size


def middle(ends: Range) -> Fraction:
    """Middle of a range."""
    return (ends[0] + ends[1]) / 2


def half(ends: Range) -> Fraction:
    """Half the width of a range."""
    return (ends[1] - ends[0]) / 2


# ---------------------------------------------------------------- one cell


@dataclass
class Cell:
    """A box of constants with the ranges that follow from the claims."""

    fault: Fault
    path: Path
    claims: dict[str, Fraction]
    normal: Range

    def __post_init__(self) -> None:
        self.a, self.b, slips, self.mu, _ = (self.fault.box[name] for name in CONSTANTS)
        self.ageing = self.fault.rate / slips[1], self.fault.rate / slips[0]
        self.rates, self.states = sector(self.claims["log_rate"]), sector(self.claims["log_state"])
        self.grown, self.aged = power_of_e(self.claims["log_rate"]), power_of_e(self.claims["log_state"])
        self.off = half(self.ageing) / middle(self.ageing)
        if self.fault.slips:
            self.states = (1 - self.off) / self.grown, (1 + self.off) * self.grown
        self.evolving = middle(self.states if self.fault.slips else self.rates), middle(self.states)
        self.viscous = self.fault.radiation * self.fault.rate
        self.strength = middle(self.normal) * middle(self.a) + self.viscous * middle(self.rates)
        self.weakening = middle(self.normal) * middle(self.b)

    def fastest_push(self) -> Fraction:
        """Bound of |q'|."""
        path, drift = self.path, self.fault.drift()
        late = path.diffusion / 2 + path.lag
        fast = Fraction(5, 2) / path.diffusion if path.diffusion > 0 else 1 / path.lag
        return fast * (self.claims["asked"] + drift * late + self.claims["push"]) + drift

    def fastest_pull(self) -> Fraction:
        """Bound of K|x'|."""
        return self.fault.load() * (self.grown - 1 + self.fault.swing)

    def fastest_state(self) -> Fraction:
        """Bound of |z'|."""
        if self.fault.slips:
            return self.ageing[1] * self.grown * (self.claims["log_rate"] + self.claims["log_state"])
        return self.ageing[1] * max(self.grown - 1 / self.aged, self.aged - 1 / self.grown)

    def rounding(self) -> Fraction:
        """Bound of regularised friction minus its logarithmic form, as a stress."""
        if not self.fault.regularised:
            return Fraction(0)
        least = self.mu[0] - self.a[1] * self.claims["log_rate"] - self.b[1] * self.claims["log_state"]
        need(2 * least >= self.a[1], "regularised friction must stay above half its direct effect")
        return self.normal[1] * 4 * self.a[1] / partial(2 * least / self.a[1])

    def stress(self) -> Fraction:
        """Stress, including the bound of the inertial term."""
        fault, claims, push = self.fault, self.claims, self.fastest_push()
        bent = self.a[1] * claims["log_rate"] + self.b[1] * claims["log_state"]
        needed = fault.load() * (1 + fault.swing) / self.mu[0]
        moved = (needed + push) * bent + self.normal[1] * self.b[1] * self.fastest_state()
        moved += self.fastest_pull() + self.mu[1] * push
        return (
            fault.stress
            + self.rounding()
            + moved * fault.inertia * fault.rate * self.grown / (self.normal[0] * self.a[0])
        )

    def soon(self, time: Fraction) -> Row:
        """Bounds of the change of y, cy + c_z z and ay + bz within this time, without the stress."""
        state = self.fastest_state()
        change = self.fastest_pull() + self.weakening * state
        change += middle(self.mu) * self.fastest_push()
        y, z = change * time / self.strength, state * time
        return [
            y,
            self.evolving[0] * y + self.evolving[1] * z,
            middle(self.a) * y + middle(self.b) * z,
        ]


def around(loop: Loop, cell: Cell) -> Loop:
    """The loop about slow sliding: y, cy + c_z z, ay + bz, z, x, q, the valve's pressure and the truncation error."""
    size, fault = len(loop.flow), cell.fault
    unit_rows, push = unit(size), loop.outputs[2]
    y = [middle(cell.mu) * v / cell.strength for v in push]
    y[0] -= fault.stiffness / cell.strength
    y[1] -= cell.weakening / cell.strength
    c, (cy, cz), speed = middle(cell.rates), cell.evolving, middle(cell.ageing)
    z = unit_rows[1]
    ageing = [cy * a + cz * b for a, b in zip(y, z, strict=True)]
    strong = [middle(cell.a) * a + middle(cell.b) * b for a, b in zip(y, z, strict=True)]
    flow = [[fault.rate * c * v for v in y], [-speed * v for v in ageing], *loop.flow[2:]]

    def entry(slip: Fraction, state: Fraction) -> Row:
        return [slip, state, *[Fraction(0)] * (size - 2)]

    stress = entry(fault.rate * c / cell.strength, -speed * cy / cell.strength)
    inputs = [stress, entry(fault.rate, Fraction(0) if fault.slips else -speed), entry(Fraction(0), -speed)]
    inputs += [loop.inputs[1]] if fault.drift() else []
    inputs += [entry(-fault.rate, Fraction(0))] if fault.swing else []
    inputs += [loop.inputs[2]] if cell.path.noise else []
    inputs += [[middle(cell.mu) * v for v in stress]] if loop.fade else []
    outputs = [y, ageing, strong, z, unit_rows[0], push, loop.outputs[-1], *loop.outputs[3:-1]]
    return replace(loop, flow=flow, inputs=inputs, outputs=outputs)


def since_step(loop: Loop) -> Row:
    """Time since the last step reached the well, at the beginning of every piece; 0 if the well has no steps."""
    starts = list(accumulate((length for _, length in loop.events), initial=Fraction(0)))
    if not loop.fade:
        return [Fraction(0)] * (len(loop.events) * (len(loop.cuts) - 1))
    origin = starts[loop.fade.event]
    return [
        (starts[i] + cut * length - origin) % starts[-1]
        for i, (_, length) in enumerate(loop.events)
        for cut in loop.cuts[:-1]
    ]


def found_gains(loop: Loop, cell: Cell, times: Row, late: Fraction) -> list[list[Row]]:
    """Gains by input, output and piece, with direct terms.

    A piece that begins less than `late` after a step of the well has the gains of the piece before the step.
    """
    noisy = len(loop.inputs) - 1 - bool(loop.fade) if cell.path.noise else None
    fades = len(loop.inputs) - 1 if loop.fade else None
    last = times.index(max(times))
    once = [1 / cell.strength, cell.evolving[0] / cell.strength, middle(cell.a) / cell.strength]
    found = []
    for place, entry in enumerate(loop.inputs):
        lines = gains(loop, entry, place == noisy, *[loop.fade] * (place == fades))
        for k in range(3):
            if place == 0:
                lines[k] = [v + once[k] for v in lines[k]]
            if place == fades and loop.fade:
                size = middle(cell.mu) * once[k]
                lines[k] = [v + size * loop.fade.weight(t) for v, t in zip(lines[k], times, strict=True)]
            lines[k] = [lines[k][last] if t < late else v for v, t in zip(lines[k], times, strict=True)]
        found.append(lines)
    return found


def shares_of(loop: Loop, cell: Cell) -> tuple[Row, list[Row]]:
    """Own bound and shares of the outputs for every input."""
    zero, high = Fraction(0), cell.normal[1]
    many = len(loop.outputs)
    off = cell.off
    bent, layer = half(cell.rates), many - 7
    stress = [high * half(cell.a) + cell.viscous * bent, zero, half(cell.normal), high * half(cell.b), zero]
    stress += [half(cell.mu), zero, *[half(cell.mu) if loop.fade else cell.mu[1]] * layer]
    state = [off * bent, off, zero, (1 + off) * half(cell.states), *[zero] * (many - 4)]
    if cell.fault.slips:
        state = [zero, half(cell.states) / middle(cell.states), *[zero] * (many - 2)]
    own, shares = [cell.stress(), zero, zero], [stress, [bent, *[zero] * (many - 1)], state]
    for size in [v for v in (cell.fault.drift(), cell.fault.swing, cell.path.noise) if v]:
        own.append(size)
        shares.append([zero] * many)
    if loop.fade:
        own.append(zero)
        shares.append([*[zero] * (many - 1), Fraction(1)])
    return own, shares


def bounds(plain: Loop, cell: Cell) -> tuple[dict[str, Fraction], Fraction]:
    """Bounds that follow from the claims on one cell, and the small gain."""
    loop = around(plain, cell)
    times = since_step(loop)
    late = min((t for t in times if loop.fade and loop.fade.weight(t) <= FADED), default=Fraction(0))
    found, more = found_gains(loop, cell, times, late), cell.soon(late)
    own, shares = shares_of(loop, cell)
    own = [v + sum(c * m for c, m in zip(share, more, strict=False)) for v, share in zip(own, shares, strict=True)]
    peaks, small = peaks_of(found, own, shares)
    y, _, _, z, slip, push, asked, *left = peaks
    values = (y + more[0], z, slip, push + sum(left), asked)
    return dict(zip(CLAIMS, values, strict=True)), small


# ---------------------------------------------------------------- the theorem


def verify(document: dict[str, Any]) -> list[str]:
    """Verify the claims of a parsed file; the statement, line by line.

    Raises
    ------
    Refused
        When a rule is broken, or a claim does not follow.
    """
    keys(document, "the file", "format", "kind", "fault", "reference", "stress", "loop", "cells", "claims")
    fault = read_fault(document)
    claims = numbers(document["claims"], "claims", *CLAIMS)
    need(min(claims.values()) > 0, "claims must be > 0")
    need(max(claims["log_rate"], claims["log_state"]) <= MAX_LOGARITHM, "log_rate and log_state must be at most 3")
    boxes = read_cells(document["cells"], fault.box)
    loop, path = read_path(document["loop"])
    small = Fraction(0)
    for box in boxes:
        part = replace(fault, box=box)
        normal = part.normal(claims["push"])
        need(normal[0] > 0, "the pressure must not open the fault")
        found, gain = bounds(loop, Cell(part, path, claims, normal))
        small = max(small, gain)
        for name in CLAIMS:
            need(found[name] < claims[name], f"the claim {name} must follow from all claims on every cell. It does not")
    return [*statement(document, fault, claims, len(boxes), small), *entries(document)]


def statement(
    document: dict[str, Any], fault: Fault, claims: dict[str, Fraction], cells: int, small: Fraction
) -> list[str]:
    """What was verified, in ASCII; bounds are rounded outward, conditions inward."""
    loop, ranges = document["loop"], [f"{name} {inside(*fault.box[name])}" for name in CONSTANTS]
    when = f"every {loop['step']} s, {loop['delay']} s late, lag {loop['lag']} s"
    when += f", diffusion path of distance^2/diffusivity = {loop['diffusion']} s"
    off = f", measured slip within {loop['slip_noise']} m of the true one" if loop["slip_noise"] != "0" else ""
    along = f", along any reference whose rate stays within (1 +- {lower(fault.swing)}) times this slip rate"
    along = along if fault.swing else ""
    peak = fault.rate * power_of_e(claims["log_rate"])
    needed = fault.stiffness * fault.distance / fault.box["coefficient"][0]
    at = {"in the fault": claims["push"], "at the valve": claims["asked"]}
    stress = f"any shear stress of at most {lower(fault.stress)} Pa" if fault.stress else "none (stress 0)"
    empty = [] if fault.distance else ["vacuous: the reference covers 0 m in 0 s"]
    return [
        *empty,
        f'fault "{ascii(fault.name)[1:-1]}" (a label; the data of the file define it), '
        f"{'regularised ' * fault.regularised}rate-and-state friction with "
        f"the {'slip' if fault.slips else 'ageing'} law, "
        f"with inertia, every constant {', '.join(ranges)}; {cells} cells",
        f"law with {len(loop['states'])} states, slip alone measured, {when}{off}",
        f"disturbance: {stress}; from steady sliding at "
        f"{exact(fault.rate)} m/s over {lower(fault.distance)} m{along}; small gain {upper(small)}",
        f"the slip rate of this fault never exceeds {upper(peak)} m/s: |ln(slip rate/first rate)| <= "
        f"{upper(claims['log_rate'])}",
        f"|slip - reference| <= {upper(claims['slip_error'])} m, |ln(state*first rate/critical_slip)| <= "
        f"{upper(claims['log_state'])}",
        *(f"pressure {where} from {lower(-v)} Pa to {upper(needed + v)} Pa" for where, v in at.items()),
    ]
