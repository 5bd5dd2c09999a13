"""Objects shared by several kinds of guarantee files: fault, reference, disturbance, step.

Each class declares the keys of one object, with numbers in SI units. Methods and functions convert objects to values of
the package, and back.
"""

from fractions import Fraction
from typing import Annotated

from msgspec import Meta
from msgspec.structs import astuple

from quakedesign.files import Json
from quakedesign.laws.implicit_root import MOST_TERMS, ImplicitStep, Power
from quakedesign.plant.fault_plant import FaultPlant, Friction
from quakedesign.sos.exact.strict import Entries, Name, made

Pair = tuple[Fraction, Fraction]
Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]
MOST_STATES = 20
Names = Annotated[tuple[Name, ...], Meta(max_length=MOST_STATES)]
FaultName = Annotated[str, Meta(pattern=r"\A\w[\w .-]{0,59}\Z")]


class SlipAndRate(Entries):
    """One number for the slip and one for the slip rate."""

    slip: Fraction
    rate: Fraction


class SpreadEntries(Entries):
    """Relative half-widths [-] of the uncertain parameters of a fault."""

    stiffness: Fraction
    damping: Fraction
    authority: Fraction


class FaultEntries(Entries):
    """A fault whose friction depends on slip and slip rate."""

    name: FaultName
    density: Fraction
    shear_modulus: Fraction
    length: Fraction
    damping: Fraction
    normal_stress: Fraction
    spreads: SpreadEntries
    friction: Friction


class ReferenceEntries(Entries):
    """The specified slow slip."""

    shape: Annotated[Row, Meta(max_length=13)]
    target_slip: Fraction
    operation_time: Fraction


class DisturbanceEntries(Entries, kw_only=True):
    """Bounds of the disturbance."""

    amplitude: Fraction
    change: Fraction | None = None
    growths: SlipAndRate


class TaskEntries(Entries):
    """Common keys of files about a fault whose friction depends on slip and slip rate."""

    fault: FaultEntries
    reference: ReferenceEntries
    disturbance: DisturbanceEntries

    def plant(self) -> FaultPlant:
        """The fault with its task."""
        spreads, growths = astuple(self.fault.spreads), astuple(self.disturbance.growths)
        return made(FaultPlant, self.fault, self.reference, self.disturbance, spreads=spreads, growths=growths)


def task_entries(task: FaultPlant) -> Json:
    """The three objects of `TaskEntries` by name."""
    stiffness, damping, authority = task.spreads
    slip, rate = task.growths
    spreads = SpreadEntries(stiffness=stiffness, damping=damping, authority=authority)
    return {
        "fault": made(FaultEntries, task, spreads=spreads),
        "reference": made(ReferenceEntries, task),
        "disturbance": made(DisturbanceEntries, task, growths=SlipAndRate(slip=slip, rate=rate)),
    }


class PowerEntries(Entries):
    """A signed power in an implicit step."""

    factor: Pair
    power: Fraction
    of: "str | tuple[PowerEntries, ...]"


Powers = Annotated[tuple[PowerEntries, ...], Meta(max_length=MOST_TERMS)]


class ImplicitStepEntries(Entries):
    """The sum q of an implicit step, and the sector bound of its solution."""

    pull: Powers
    slopes: Pair
    remainder: Fraction

    def value(self) -> ImplicitStep:
        """The implicit step."""
        return made(ImplicitStep, self, pull=powers(self.pull))


def powers(terms: tuple[PowerEntries, ...]) -> tuple[Power, ...]:
    """A sum of signed powers from its entries."""
    return tuple(
        Power(
            factor=term.factor, exponent=term.power, argument=term.of if isinstance(term.of, str) else powers(term.of)
        )
        for term in terms
    )


def power_entries(terms: tuple[Power, ...]) -> tuple[PowerEntries, ...]:
    """Entries of a sum of signed powers."""
    return tuple(
        PowerEntries(
            factor=term.factor,
            power=term.exponent,
            of=term.argument if isinstance(term.argument, str) else power_entries(term.argument),
        )
        for term in terms
    )
