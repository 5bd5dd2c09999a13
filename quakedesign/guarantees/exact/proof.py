"""Base class of all proofs about a loop, and `NoProof` with its reason."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from fractions import Fraction
from types import MappingProxyType
from typing import Any, ClassVar, Generic, Literal, TypeVar

from quakedesign.arguments import checked_dataclass
from quakedesign.exact import Bound, LowerBound, UpperBound
from quakedesign.files import Json
from quakedesign.laws.implicit_root import ImplicitStep
from quakedesign.lyapunov.exact.claim import Verdict

B = TypeVar("B")


class Proof(ABC, Generic[B]):
    """Claims about one loop with their check; abstract base, with one subclass for each theorem.

    **Principle.** A theorem bounds the claimed quantities over the time range `validity`, and the claims follow if each
    bound is at most its claim. Two theorems assume claims up to time t. The theorem of slow sliding bounds all inputs
    by them, on every cell of its box of constants. The theorem of tracking bounds by them the effect of an implicit
    step or of a slowly varying input gain, if there is one. Then the bound of each assumed claim must be below this
    claim, or at most equal to it where the input depends on earlier samples alone. As the quantities are continuous and
    initially within the claims, they stay within them.

    Attributes
    ----------
    available : bool
        True; False for `NoProof`. True does not mean proved: `check` decides a proof that was read from a file.
    kind : str
        Kind of its certificate file (proofs/FORMAT.md).
    plant : str
        Value of `plant` in `simulate` that the proof is about; empty for slow sliding (proved with inertia), for laws
        in continuous time and for uncertain plants.
    scope : str
        Idealisation of its plant, as text; empty without one, or if the sentence or the premises state it.
    motion : str
        Condition of the slip-rate bound, as text.
    validity : str
        Time range of the claims, as text.
    covers_healing : bool
        Whether friction at rest may exceed friction in slip, see `StickSlipProof.beside_healing`.
    slides : bool
        Whether the proof is about slow sliding with rate-and-state friction.
    sampled : bool
        Whether its law is sampled.
    implicit_step : ImplicitStep or None
        Implicit step of its law.
    slip_rate_error : Bound or None
        [m/s]; None where it is not claimed.
    """

    __slots__ = ()
    available: ClassVar[Literal[True]] = True
    kind: ClassVar[str]
    plant: ClassVar[str] = ""
    scope: ClassVar[str] = ""
    covers_healing: ClassVar[bool] = False
    slides: ClassVar[bool] = False
    sampled: ClassVar[bool] = True

    @abstractmethod
    def theorem_bounds(self) -> "B | NoProof":
        """Bounds that the theorem gives, in ball and rational arithmetic, or the reason why it gives none."""

    @abstractmethod
    def follows_from(self, bounds: B) -> bool:
        """Whether the claims follow from bounds of the theorem."""

    def check(self) -> Verdict:
        """PROVED if the claims follow from the bounds of the theorem; else UNDECIDED."""
        return self.verdict_of(self.theorem_bounds())

    def verdict_of(self, bounds: "B | NoProof") -> Verdict:
        """Verdict for the bounds that `theorem_bounds` returned."""
        if isinstance(bounds, NoProof) or not self.follows_from(bounds):
            return Verdict.UNDECIDED
        return Verdict.PROVED

    @abstractmethod
    def sentence(self) -> str:
        """Statement of the claims and of all that they depend on, as text."""

    @abstractmethod
    def to_dict(self) -> Json:
        """Exact claims as strings, SI."""

    @property
    @abstractmethod
    def bounds(self) -> Mapping[str, Bound]:
        """Claimed bounds by name, in SI units; for an uncertain plant in the units of that plant."""

    @property
    def validity(self) -> str:
        """Time range of the claims, as text."""
        return "for all t >= 0"

    @property
    def motion(self) -> str:
        """Condition of the slip-rate bound, as text."""
        return ""

    @property
    def slip_rate_error(self) -> Bound | None:
        """Bound of the slip-rate error [m/s]; None where it is not claimed."""
        return self.bounds.get("slip_rate_error")

    @property
    def cells(self) -> tuple[Any, ...]:
        """Cells of the box of constants, each with its own proof; empty if not divided."""
        return ()

    @property
    def implicit_step(self) -> ImplicitStep | None:
        """Implicit step of the law."""
        return None


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class NoProof:
    """Result without a proof, with its reason.

    Attributes
    ----------
    reason : str
        Names the quantity that fails.
    small_gain : UpperBound or None
        Small gain [-], usually at least 1; None where something else fails, such as the stability of the nominal loop.
    required_change : Fraction, optional
        Pressure change between samples that the pump would have to make [Pa].
    only_pressure_fails : bool
        Whether the pressure alone prevents a proof: it exceeds a pump limit, or opens the fault.
    """

    available: ClassVar[Literal[False]] = False
    bounds: ClassVar[Mapping[str, LowerBound | UpperBound]] = MappingProxyType({})
    reason: str
    small_gain: UpperBound | None = None
    required_change: Fraction | None = None
    only_pressure_fails: bool = False

    def check(self) -> Verdict:
        """UNDECIDED."""
        return Verdict.UNDECIDED

    def sentence(self) -> str:
        """Result and its reason, as text."""
        return f"none: {self.reason}"
