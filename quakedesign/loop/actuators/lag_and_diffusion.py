"""Dynamic actuator stages: first-order lag of pump and pipe, and the diffusion path."""

import math
from itertools import pairwise
from typing import Any, ClassVar, Self

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, is_whole
from quakedesign.fault.model import require_positive
from quakedesign.loop.actuators.base import FlowStage, Option
from quakedesign.loop.sensing.measurement import Entries


@checked_dataclass(frozen=True, kw_only=True)
class Lag(FlowStage):
    """A first-order lag: τq' = p − q.

    Attributes
    ----------
    time_constant : float
        τ [s], positive.
    """

    name: ClassVar[str] = "lag"
    rank: ClassVar[int] = 5
    options: ClassVar[tuple[Option, ...]] = (
        Option(name="lag", unit="s", help="Time constant of pump and pipe, such as '1 s'."),
    )

    time_constant: float

    def __post_init__(self) -> None:
        require_positive(time_constant=self.time_constant)

    @classmethod
    def from_options(cls, step: float, *, lag: float) -> Self:  # type: ignore[override]
        """See `Stage.from_options`."""
        return cls(time_constant=lag)

    @property
    def numbers(self) -> tuple[float, ...]:
        """1/τ [1/s]."""
        return (1 / self.time_constant,)

    @property
    def start(self) -> tuple[float, ...]:
        """Pressure at the outlet [Pa]."""
        return (0.0,)

    @property
    def fastest(self) -> float:
        """1/τ [1/s]."""
        return 1 / self.time_constant

    def rates(self, numbers: Entries, memory: Entries, pressure: Any) -> Entries:
        """See `FlowStage.rates`."""
        return [numbers[0] * (pressure - memory[0])]

    def output(self, numbers: Entries, memory: Entries, pressure: Any) -> Any:
        """See `FlowStage.output`."""
        return memory[0]


# ----------------------------------------------------------------------
# Pressure diffusion between well and fault.

MOST_CELLS = 200


@checked_dataclass(frozen=True, kw_only=True)
class Diffusion(FlowStage):
    """One-dimensional diffusion ∂p/∂t = D∂²p/∂x² through a layer of length L that ends, without outflow, in the fault.

    The pressure at the well is given. With τ = L²/D the exact transfer functions are 1/cosh√(sτ) from the pressure at
    the well to that in the fault, and S·tanh√(sτ)/√(sτ) to the injected volume (Carslaw and Jaeger, Conduction of Heat
    in Solids, 1959, sec. 3.4); the pressure in the fault after a unit step at the well is
    2Σ(−1)ⁿerfc((2n+1)/(2√(t/τ))).

    The model has N cells of equal width with their pressures at the centres (finite volumes). Its transfer functions
    are 1/cosh(Nφ) and S·tanh(Nφ)/(N sinh φ) with sinh(φ/2) = √(sτ)/(2N): rational functions of degree N, both exact in
    the limit of low frequencies. The injected volume is the volume stored in the cells. Over all frequencies the error
    of the pressure is at most 0.32/N² of the amplitude at the well, that of its step response 0.25/N², and that of the
    volume 0.22/N of S times this amplitude. For 16 cells these bounds are 0.13 %, 0.1 % and 1.4 %.

    Attributes
    ----------
    length : float
        L [m], positive.
    diffusivity : float
        D [m²/s], positive.
    storage : float or None
        S [m³/Pa], positive: fluid volume stored in the whole layer per unit pressure: its volume times its specific
        storage. Without it the pressures are the same, but volume and flow rate are not computed.
    cells : int
        N, 1 … 200.
    """

    name: ClassVar[str] = "diffusion"
    rank: ClassVar[int] = 6
    options: ClassVar[tuple[Option, ...]] = (
        Option(
            name="diffusion",
            unit="s",
            help="L^2/D of the diffusion path between well and fault, such as '100 s'; if small, use more substeps.",
        ),
        Option(
            name="storage",
            unit="m^3/Pa",
            help="Fluid volume stored in the path per unit pressure, such as '1e-4 m^3/Pa'; gives injected volume "
            "and flow rate.",
        ),
        Option(name="cells", unit="", help="Number of cells of the diffusion path.", default=16),
    )

    length: float
    diffusivity: float
    storage: float | None = None
    cells: int = 16

    def __post_init__(self) -> None:
        require_positive(length=self.length, diffusivity=self.diffusivity)
        if self.storage is not None:
            require_positive(storage=self.storage)
        if not is_whole(self.cells, 1, MOST_CELLS):
            raise ParameterError(f"cells must be a whole number, 1 to {MOST_CELLS}. Received {self.cells!r}.")

    @classmethod
    def of_time(cls, time: float, *, storage: float | None = None, cells: int = 16) -> Self:
        """Stage with a given τ = L²/D [s]; its length of 1 m is arbitrary."""
        require_positive(time=time)
        return cls(length=1.0, diffusivity=1.0 / time, storage=storage, cells=cells)

    @classmethod
    def from_options(cls, step: float, *, diffusion: float, **values: Any) -> Self:  # type: ignore[override]
        """See `Stage.from_options`."""
        return cls.of_time(diffusion, **values)

    @property
    def time(self) -> float:
        """τ = L²/D [s]."""
        return self.length**2 / self.diffusivity

    @property
    def numbers(self) -> tuple[float, ...]:
        """N²/τ [1/s], and S/N [m³/Pa] if the storage is given."""
        share = () if self.storage is None else (self.storage / self.cells,)
        return (self.cells**2 / self.time, *share)

    @property
    def stores(self) -> bool:
        """See `FlowStage.stores`."""
        return self.storage is not None

    @property
    def start(self) -> tuple[float, ...]:
        """Pressures in the cells [Pa], from the well to the fault."""
        return (0.0,) * self.cells

    @property
    def fastest(self) -> float:
        """Largest eigenvalue of the cells, (4N²/τ)cos²(π/(4N)) [1/s]."""
        return 4 * self.numbers[0] * math.cos(math.pi / (4 * self.cells)) ** 2

    def rates(self, numbers: Entries, memory: Entries, pressure: Any) -> Entries:
        """Inflow minus outflow of every cell; see `FlowStage.rates`."""
        inflow = [2 * (pressure - memory[0]), *(a - b for a, b in pairwise(memory))]
        outflow = [*inflow[1:], 0.0]
        return [numbers[0] * (a - b) for a, b in zip(inflow, outflow, strict=True)]

    def output(self, numbers: Entries, memory: Entries, pressure: Any) -> Any:
        """Pressure in the last cell, which has no outflow; see `FlowStage.output`."""
        return memory[-1]

    def flows(self, numbers: Entries, memory: Entries, pressure: Any) -> dict[str, Any]:
        """Injected volume [m³] and flow rate [m³/s] at the well, if the storage is given."""
        if not self.stores:
            return {}
        share = numbers[1]
        return {
            "injected_volume": share * sum(memory[1:], start=memory[0]),
            "flow_rate": share * numbers[0] * 2 * (pressure - memory[0]),
        }
