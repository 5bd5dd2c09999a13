"""Uncertain plants, user-defined or of several blocks: linear part, sectors, loads and disturbances.

x′ = Ax + B(u − v) + Σ entry·φ(row·(x, u − v), t) + Σ entry·d(t). A sector φ lies between two slopes, for all values of
its argument or for those within a bound; a load v(t) has a bounded rate; a disturbance d is any bounded measurable
function. The law measures Cx plus noise at every sample.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction
from types import MappingProxyType
from typing import Any, Self

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import rational, shortly
from quakedesign.fault import BlockChain, Fault
from quakedesign.plant.block_plant import block_parts
from quakedesign.plant.plant_values import MOST, ExactSector, Matrix, Row, SlowLoad, unit

Slopes = tuple[Any, Any] | Callable[[Fraction], tuple[Any, Any]]


@checked_dataclass(frozen=True, kw_only=True)
class Sector:
    """An uncertain term entry·φ(y, t) of a plant, y = row·x, or row·(x, u − v) with the controls u and their loads v.

    φ lies between low·y and high·y, and φ(0, t) = 0.

    Attributes
    ----------
    entry : sequence of numbers
        Input column of φ in x′, one number for every state.
    row : sequence of numbers
        Coefficients of the argument y: one for every state and, if y depends on the controls, one for every control.
    slopes : (number, number) or callable
        The slopes low and high, or a callable that returns them for a bound of |y|, such as
        ``lambda y: (-5 * y**2 / 2, 0)``. A search then chooses the bound, passed as a `Fraction`; returned floats are
        read as the decimals that Python prints for them.
    within : number, optional
        Bound of |y| for which the slopes are valid; the proof shows that |y| stays within it. y then depends on states
        alone.
    """

    entry: Any
    row: Any
    slopes: Any
    within: Any = None

    def at(self, bound: Fraction | None, sizes: tuple[int, int], name: str) -> "ExactSector":
        """The sector in exact numbers; callable slopes are evaluated at `within`, or at `bound` if `within` is None.

        `sizes` are the numbers of states and of controls.
        """
        n, m = sizes
        row = vector(self.row, f"row of sector {name}")
        if len(row) == n:
            row = (*row, *[Fraction(0)] * m)
        entry = vector(self.entry, f"entry of sector {name}", n)
        if len(row) != n + m:
            raise ParameterError(
                f"row of sector {name} must have {n} entries, or {n + m} with the controls. Received {len(row)}."
            )
        within = None if self.within is None else rational(self.within, f"within of sector {name}")
        if callable(self.slopes):
            within = bound if within is None else within
            assert within is not None
            slopes = self.slopes(within)
        else:
            slopes = self.slopes
        ends = vector(slopes, f"slopes of sector {name}", 2)
        if ends[0] > ends[1] or (within is not None and (within <= 0 or any(row[n:]))):
            raise ParameterError(
                f"sector {name} must have slopes low <= high; within must be positive, and its row without controls. "
                f"Received slopes {shortly(ends[0])} and {shortly(ends[1])}, within "
                f"{'None' if within is None else shortly(within)}."
            )
        return ExactSector(entry=entry, row=row, slopes=(ends[0], ends[1]), within=within)


@checked_dataclass(frozen=True, kw_only=True)
class UncertainPlant:
    """A linear plant with sectors, gains and disturbances; `guarantee` bounds its peaks under a sampled law.

    All numbers may be floats, strings or rationals; they are stored exactly.

    Attributes
    ----------
    A, B : matrices
        x′ = Ax + Bu + …; n × n and n × m.
    C : matrix, optional
        The measurements are Cx; all states unless given.
    sectors : mapping of str to Sector
    gains : mapping of str to (number, number)
        Least and largest value of the factor that multiplies a control minus its loads, u − v, by the name of the
        control; the factor may vary within this range at any rate.
    disturbances : mapping of str to (sequence, number)
        Input column in x′, and largest magnitude.
    loads : mapping of str to (sequence, sequence or None, number)
        Controls that balance the load, shift of the states at balance (0 for None) and largest rate; see `SlowLoad`.
    outputs : mapping of str to sequence
        Output rows over the states, whose peaks are bounded; the measurements unless given.
    controls, measurements : sequence of str
        Names of u and Cx; u1 … and y1 … unless given.
    noise : mapping of str to number
        Largest absolute measurement error, in the unit of the measurement, by its name; 0 by default.
    start : sequence of numbers, optional
        |x_i(0)| ≤ start_i; 0 unless given.
    units : mapping of str to str
        Units of outputs, controls and disturbances by their names, for printed text: SI units, or MPa.
    name : str
    remarks : mapping of str to str
        Text that follows the words "plant" and "disturbances" in a statement, by the keys ``plant``, ``disturbances``.

    Raises
    ------
    ParameterError
        For dimensions that do not match, unknown names, or numbers out of their range.
    """

    A: Any
    B: Any
    C: Any = None
    sectors: Mapping[str, Sector] = field(default_factory=dict)
    gains: Mapping[str, Any] = field(default_factory=dict)
    disturbances: Mapping[str, Any] = field(default_factory=dict)
    loads: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, Any] | None = None
    controls: Sequence[str] = ()
    measurements: Sequence[str] = ()
    noise: Mapping[str, Any] = field(default_factory=dict)
    start: Any = None
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "plant"
    remarks: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        put: Any = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        A, B = matrix(self.A, "A"), matrix(self.B, "B")
        n, m = len(A), len(B[0]) if B else 0
        C = matrix(self.C, "C") if self.C is not None else tuple(unit(n, i) for i in range(n))
        if not 1 <= n <= MOST or not 1 <= m <= MOST or len(C) > MOST:
            raise ParameterError(
                f"a plant must have 1 to {MOST} states, controls and measurements. Received {n}, {m} and {len(C)}."
            )
        for name, part, height, width in (("A", A, n, n), ("B", B, n, m), ("C", C, len(C), n)):
            if [len(row) for row in part] != [width] * height:
                raise ParameterError(
                    f"matrix {name} of a plant must be {height} x {width}. Received {len(part)} rows of "
                    f"{', '.join(map(str, sorted({len(row) for row in part})))} entries."
                )
        put("A", A)
        put("B", B)
        put("C", C)
        put("controls", _names(self.controls, "u", m, "controls"))
        put("measurements", _names(self.measurements, "y", len(C), "measurements"))
        outputs = dict(zip(self.measurements, C, strict=True)) if self.outputs is None else self.outputs
        put("outputs", _frozen({name: vector(row, f"output {name}", n) for name, row in outputs.items()}))
        put("disturbances", _frozen({name: _disturbance(name, one, n) for name, one in self.disturbances.items()}))
        put("loads", _frozen({name: _load(name, one, (n, m), C) for name, one in self.loads.items()}))
        for given, names, what in ((self.gains, self.controls, "gains"), (self.noise, self.measurements, "noise")):
            if unknown := set(given) - set(names):
                raise ParameterError(
                    f"{what} of a plant must be given for {', '.join(names)}. Received {', '.join(sorted(unknown))}."
                )
        ends = {name: vector(pair, f"gains of {name}", 2) for name, pair in self.gains.items()}
        if any(low > high for low, high in ends.values()):
            raise ParameterError("gains of a control must be (least, largest). Received them reversed. Swap them.")
        put("gains", _frozen(ends))
        sizes = {name: rational(size, f"noise of {name}") for name, size in self.noise.items()}
        start = (Fraction(0),) * n if self.start is None else vector(self.start, "start", n)
        if min([*sizes.values(), *start, Fraction(0)]) < 0:
            raise ParameterError("noise and start must be 0 or more. Received a negative number. Give absolute values.")
        put("noise", _frozen(sizes))
        put("start", start)
        put("sectors", _frozen(dict(self.sectors)))
        if unknown := set(self.units) - {*(self.outputs or ()), *self.controls, *self.disturbances}:
            raise ParameterError(
                "units of a plant must be given for outputs, controls or disturbances. Received "
                f"{', '.join(sorted(unknown))}. Use their names."
            )
        put("units", _frozen(dict(self.units)))
        if len(self.sectors) + len(ends) > MOST or not 1 <= len(self.outputs or ()) <= MOST:
            raise ParameterError(
                f"a plant must have at most {MOST} sectors and gains together, and 1 to {MOST} outputs. Received "
                f"{len(self.sectors) + len(ends)} and {len(self.outputs or ())}. Remove some, or add outputs."
            )
        if double := set(self.sectors) & set(ends):
            raise ParameterError(f"sectors and gains must have different names. Received {', '.join(sorted(double))}.")
        self.exact_sectors(lambda _: Fraction(1))

    @classmethod
    def from_statespace(cls, system: Any, **more: Any) -> Self:
        """Plant of a `control.StateSpace` in continuous time, with its signal names; `more` gives further fields.

        Raises
        ------
        ParameterError
            For a system in discrete time, or with direct feedthrough.
        """
        direct, step = getattr(system, "D", None), getattr(system, "dt", None)
        kind = f"dt = {step}" if step else "D not 0"
        if direct is None or step or any(v for row in direct.tolist() for v in row):
            raise ParameterError(
                "a plant must be a control.StateSpace in continuous time, with D = 0. Received "
                f"{type(system).__name__ if direct is None else kind}. Use control.ss(A, B, C, 0)."
            )
        labels = {"controls": tuple(system.input_labels), "measurements": tuple(system.output_labels)}
        return cls(**({"A": system.A, "B": system.B, "C": system.C, "name": system.name} | labels | more))

    @classmethod
    def from_blocks(
        cls, fault: Fault | BlockChain, blocks: int | None = None, *, wells: str = "each", coupling: Any = None
    ) -> Self:
        """Plant of the blocks of a fault, coupled by springs, with independent disturbances and friction.

        States: slip errors [m], then slip-rate errors [m/s] of all blocks; controls: pressures of the wells [Pa]. With
        an independent well for each block, errors are relative to the reference, and all are measured. With fewer
        wells, one average of the slips per well follows the reference. Slip errors are then relative to the equilibrium
        of the blocks at these averages, and the averages of slip and slip rate are measured.

        Parameters
        ----------
        fault : Fault or BlockChain
            A `BlockChain` has its own blocks, springs and wells; no other argument is given with it.
        blocks : int
            Number of blocks, 2 to 20; required for a `Fault`, None for a `BlockChain`.
        wells : str
            ``"each"``: a well for each block; ``"one"``: one well for all blocks.
        coupling : number, optional
            Stiffness of a spring between blocks divided by the mass of a block [1/s²]; by default that of elastic
            strips, G·blocks²/(ρL²).

        Raises
        ------
        ParameterError
            For wells that do not act independently, fewer wells than blocks with uncertain constants, unknown `wells`,
            `blocks` out of range, a coupling that is not positive, or a further argument with a `BlockChain`.
        """
        parts = block_parts(fault, blocks, wells, coupling)
        return cls(**parts | {"sectors": {name: Sector(**one) for name, one in parts["sectors"].items()}})

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of states and of controls."""
        return len(self.A), len(self.controls)

    def exact_sectors(self, bound: Callable[[str], Fraction]) -> dict[str, ExactSector]:
        """Sectors, including those of the gains; `bound` gives, by name, the bound of |y| for callable slopes."""
        n, m = self.sizes
        sectors = {name: sector.at(bound(name), (n, m), name) for name, sector in self.sectors.items()}
        for name, (low, high) in self.gains.items():
            k = list(self.controls).index(name)
            entry = tuple(row[k] for row in self.B)
            sectors[name] = ExactSector(entry=entry, row=unit(n + m, n + k), slopes=(low - 1, high - 1))
        return sectors

    def behind(self, lag: Any) -> "UncertainPlant":
        """The plant with a first-order actuator for each control, q′ = (u − q)/lag, lag in s; q are further states."""
        time = rational(lag, "lag")
        if time <= 0:
            raise ParameterError(f"lag must be positive. Received {shortly(time)} s. Omit lag.")
        (n, m), zero = self.sizes, Fraction(0)
        zeros = (zero,) * m

        def behind(name: str, one: ExactSector) -> Sector:
            given = self.sectors.get(name, one)
            return Sector(entry=(*one.entry, *zeros), row=(*one.row, *zeros), slopes=given.slopes, within=given.within)

        exact = self.exact_sectors(lambda _: Fraction(1))
        return replace(
            self,
            A=[[*a, *b] for a, b in zip(self.A, self.B, strict=True)]
            + [[zero] * n + [-(i == j) / time for j in range(m)] for i in range(m)],
            B=[zeros] * n + [[(i == j) / time for j in range(m)] for i in range(m)],
            C=[(*row, *zeros) for row in self.C],
            sectors={name: behind(name, one) for name, one in exact.items()},
            gains={},
            disturbances={name: ((*entry, *zeros), size) for name, (entry, size) in self.disturbances.items()},
            loads={name: (one.control, (*one.shift, *one.control), one.rate) for name, one in self.loads.items()},
            outputs={name: (*row, *zeros) for name, row in (self.outputs or {}).items()},
            start=(*self.start, *zeros),
        )


# ----------------------------------------------------------------------
# Fields in exact numbers.


def _frozen(values: dict[str, Any]) -> Mapping[str, Any]:
    return MappingProxyType(values)


def vector(values: Any, name: str, length: int | None = None) -> Row:
    """Exact numbers of a sequence or array."""
    entries = values.tolist() if hasattr(values, "tolist") else values
    if isinstance(entries, str) or not isinstance(entries, Sequence):
        raise ParameterError(f"{name} must be a sequence of numbers. Received {entries!r:.60}.")
    numbers = tuple(rational(v, name) for v in entries)
    if length is not None and len(numbers) != length:
        raise ParameterError(f"{name} must have {length} numbers. Received {len(numbers)}.")
    return numbers


def matrix(values: Any, name: str) -> Matrix:
    """Exact numbers of rows or a matrix."""
    rows = values.tolist() if hasattr(values, "tolist") else values
    if isinstance(rows, str) or not isinstance(rows, Sequence):
        raise ParameterError(f"matrix {name} must be a sequence of rows. Received {rows!r:.60}.")
    return tuple(vector(row, f"a row of {name}") for row in rows)


def _names(given: Sequence[str], letter: str, count: int, what: str) -> tuple[str, ...]:
    names = tuple(given) or tuple(f"{letter}{i + 1}" for i in range(count))
    if len(names) != count or len(set(names)) != count:
        raise ParameterError(f"{what} must be {count} different names. Received {', '.join(map(str, names))}.")
    return names


def _disturbance(name: str, given: Any, n: int) -> tuple[Row, Fraction]:
    entry, size = given
    disturbance = vector(entry, f"entry of disturbance {name}", n), rational(size, f"size of disturbance {name}")
    if disturbance[1] < 0:
        raise ParameterError(f"size of disturbance {name} must be 0 or more. Received {shortly(disturbance[1])}.")
    return disturbance


def _load(name: str, given: Any, sizes: tuple[int, int], C: Matrix) -> SlowLoad:
    if isinstance(given, SlowLoad):
        return given
    control, shift, rate = given
    n, m = sizes
    load = SlowLoad(
        control=vector(control, f"control of load {name}", m),
        shift=(Fraction(0),) * n if shift is None else vector(shift, f"shift of load {name}", n),
        rate=rational(rate, f"rate of load {name}"),
    )
    measured = any(sum(c * s for c, s in zip(row, load.shift, strict=True)) for row in C)
    if load.rate < 0 or measured:
        raise ParameterError(
            f"load {name} must have a rate of 0 or more and a shift that is not measured, C·shift = 0. Received the "
            f"rate {shortly(load.rate)}{' and a shift that is measured' * measured}."
        )
    return load
